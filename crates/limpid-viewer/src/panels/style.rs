//! The style of the window, dark and light.

use eframe::egui::{
    self, Color32, CornerRadius, FontFamily, FontId, Stroke, TextStyle, Theme, Visuals,
};

/// The accent colour, for selections, loaded frames and handles.
pub(crate) fn accent(ui: &egui::Ui) -> Color32 {
    match ui.visuals().dark_mode {
        true => Color32::from_rgb(64, 156, 214),
        false => Color32::from_rgb(22, 116, 178),
    }
}

/// Sets up both themes and shows the dark one.
pub(crate) fn apply(ctx: &egui::Context) {
    for theme in [Theme::Dark, Theme::Light] {
        ctx.style_mut_of(theme, |style| {
            let font = |size| FontId::new(size, FontFamily::Proportional);
            style.text_styles = [
                (TextStyle::Small, font(11.0)),
                (TextStyle::Body, font(13.0)),
                (TextStyle::Button, font(13.0)),
                (TextStyle::Heading, font(15.0)),
                (TextStyle::Monospace, FontId::new(12.0, FontFamily::Monospace)),
            ]
            .into();
            style.spacing.item_spacing = egui::vec2(8.0, 5.0);
            style.spacing.button_padding = egui::vec2(8.0, 3.0);
            style.spacing.interact_size = egui::vec2(32.0, 22.0);
            style.spacing.combo_width = 90.0;
            colors(&mut style.visuals, theme);
        });
    }
    ctx.set_theme(Theme::Dark);
}

fn colors(visuals: &mut Visuals, theme: Theme) {
    let radius = CornerRadius::same(4);
    let (accent, on_accent) = match theme {
        Theme::Dark => (Color32::from_rgb(30, 92, 134), Color32::WHITE),
        Theme::Light => (Color32::from_rgb(176, 214, 240), Color32::from_rgb(8, 46, 74)),
    };
    visuals.selection.bg_fill = accent;
    visuals.selection.stroke = Stroke::new(1.0, on_accent);
    visuals.slider_trailing_fill = true;
    // Gray levels of the dark and the light theme.
    let gray = |dark, light| Color32::from_gray(if theme == Theme::Dark { dark } else { light });
    visuals.panel_fill = gray(30, 246);
    visuals.window_fill = gray(34, 252);
    visuals.extreme_bg_color = gray(18, 255);
    visuals.faint_bg_color = gray(36, 238);
    visuals.widgets.noninteractive.bg_stroke = Stroke::new(1.0, gray(52, 210));
    visuals.widgets.noninteractive.fg_stroke = Stroke::new(1.0, gray(190, 60));
    visuals.widgets.inactive.fg_stroke = Stroke::new(1.0, gray(215, 40));
    visuals.widgets.inactive.weak_bg_fill = gray(48, 228);
    visuals.widgets.inactive.bg_fill = gray(58, 214);
    let widgets = &mut visuals.widgets;
    for widget in [
        &mut widgets.noninteractive,
        &mut widgets.inactive,
        &mut widgets.hovered,
        &mut widgets.active,
        &mut widgets.open,
    ] {
        widget.corner_radius = radius;
        widget.expansion = 0.0;
    }
    visuals.window_corner_radius = CornerRadius::same(8);
}

/// Formats a number with three significant digits, and with an exponent only if it is far from 1.
pub(crate) fn number(value: f32) -> String {
    let size = value.abs();
    match size {
        _ if value == 0.0 => "0".into(),
        _ if !(1e-3..1e6).contains(&size) => format!("{value:.2e}"),
        _ => {
            let decimals = (2 - size.log10().floor() as i32).clamp(0, 5) as usize;
            format!("{value:.decimals$}")
        }
    }
}
