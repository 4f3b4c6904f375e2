//! Sliders of numbers.

use eframe::egui;
use eframe::egui::SliderClamping::Edits;

/// End of sliders with a larger range: larger values can only be typed.
const SLIDER_END: f64 = 1e6;

/// A slider over a range, logarithmic if the range is wide. Showing a number does not change it, even if
/// it is finer than a step of the slider or outside the range.
pub(super) fn number_slider(x: &mut f32, low: f64, high: f64) -> egui::Slider<'_> {
    let wide = high - low > 50.0;
    let symmetric = low < 0.0;
    let slider = egui::Slider::new(x, low as f32..=high.min(SLIDER_END) as f32)
        .clamping(Edits)
        .smart_aim(true);
    // Format it as f32: 0.12, not 0.119999997. Show all digits, because leaving the field parses the text
    // again.
    let slider = slider.custom_formatter(|x, _| (x as f32).to_string());
    match wide {
        true if !symmetric => slider.logarithmic(true).smallest_positive(low.max(1e-3)),
        true => slider.logarithmic(true).smallest_positive(1e-2),
        false => slider,
    }
}
