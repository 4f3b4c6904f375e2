//! Sliders and fields of numbers.

use eframe::egui;
use eframe::egui::SliderClamping::Edits;

/// End of sliders with a larger range: larger values can only be typed.
const SLIDER_END: f64 = 1e6;

/// A slider over a range, logarithmic if the range is wide. Showing a number does not change it, even if
/// it is finer than a step of the slider or outside the range.
pub(super) fn number_slider(x: &mut f32, low: f64, high: f64) -> egui::Slider<'_> {
    let wide = high - low > 50.0;
    let symmetric = low < 0.0;
    let shown = significant((*x).into());
    let slider = egui::Slider::new(x, low as f32..=high.min(SLIDER_END) as f32)
        .clamping(Edits)
        .smart_aim(true);
    let slider = slider.custom_formatter(|x, _| significant(x));
    let slider = slider.custom_parser(edited_number(shown));
    match wide {
        true if !symmetric => slider.logarithmic(true).smallest_positive(low.max(1e-3)),
        true => slider.logarithmic(true).smallest_positive(1e-2),
        false => slider,
    }
}

/// A field for a positive number. Returns it once it is typed or no longer dragged, for what takes long to follow.
pub(super) fn settled_number(
    ui: &mut egui::Ui,
    name: &egui::Response,
    x: f64,
    suffix: &str,
) -> Option<f64> {
    settled(ui, name, x, |drag| {
        drag.speed(0.005 * x).suffix(suffix).range(1e-12..=1e12).clamp_existing_to_range(false)
    })
}

/// As [`settled_number`], for a place that `speed` moves for each point of a drag.
pub(super) fn settled_place(
    ui: &mut egui::Ui,
    name: &egui::Response,
    x: f64,
    speed: f64,
) -> Option<f64> {
    settled(ui, name, x, |drag| drag.speed(speed))
}

fn settled(
    ui: &mut egui::Ui,
    name: &egui::Response,
    x: f64,
    with: impl FnOnce(egui::DragValue<'_>) -> egui::DragValue<'_>,
) -> Option<f64> {
    let id = name.id.with("dragged");
    let mut edited = ui.data(|data| data.get_temp(id)).unwrap_or(x);
    let drag = with(egui::DragValue::new(&mut edited)).update_while_editing(false);
    let drag = drag.custom_formatter(|x, _| significant(x));
    let response = ui.add(drag.custom_parser(edited_number(significant(x)))).labelled_by(name.id);
    if response.dragged() {
        ui.data_mut(|data| data.insert_temp(id, edited));
        return None;
    }
    ui.data_mut(|data| data.remove_temp::<f64>(id));
    (edited != x).then_some(edited)
}

/// Formats a number with four significant digits, without trailing zeros.
pub(super) fn significant(x: f64) -> String {
    let size = x.abs();
    if size != 0.0 && !(1e-6..1e9).contains(&size) {
        return format!("{x:.3e}");
    }
    let decimals = if size == 0.0 { 0.0 } else { 3.0 - size.log10().floor() };
    rounded(x, decimals.clamp(0.0, 9.0) as usize)
}

/// Formats a number with `decimals` decimals, without trailing zeros.
pub(super) fn rounded(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    let text =
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    text.to_owned()
}

/// Parses a number, but rejects the text that is `shown`: entering and leaving a field must not drop the
/// digits that it does not show.
pub(super) fn edited_number(shown: String) -> impl Fn(&str) -> Option<f64> {
    move |text| text.trim().parse().ok().filter(|_| text.trim() != shown)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers are shown with four digits, whatever their size.
    #[test]
    fn four_digits_are_shown() {
        let shown =
            [0.433_779_72, 4.120_904, 1.33, 0.0, -104.2, 99_999.99, 1.234e-7, 0.000_123_456];
        let texts = shown.map(significant);
        assert_eq!(
            texts,
            ["0.4338", "4.121", "1.33", "0", "-104.2", "100000", "1.234e-7", "0.0001235"]
        );
    }
}
