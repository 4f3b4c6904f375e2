//! The legend of the colours of values over the picture, as saved pictures have it.

use eframe::egui::{self, Color32, ColorImage, Rect, TextureHandle, TextureOptions, pos2, vec2};
use glam::UVec2;
use limpid_io::color_by::ColorScale;
use limpid_io::overlay::legend_alone;

/// The last legend that was drawn.
#[derive(Default)]
pub(crate) struct ColorLegend {
    /// Its values, and the size of the picture.
    of: Option<(ColorScale, UVec2)>,
    /// Its texture and its upper left corner, pixels; `None` if the picture is too small.
    drawn: Option<(TextureHandle, UVec2)>,
}

impl ColorLegend {
    /// Shows the legend over a picture of `size` pixels in `rect`.
    pub(crate) fn show(&mut self, ui: &egui::Ui, rect: Rect, size: UVec2, scale: &ColorScale) {
        if self.of.as_ref().is_none_or(|(of, at)| (of, *at) != (scale, size)) {
            self.of = Some((scale.clone(), size));
            self.drawn = legend_alone(size, scale).map(|(picture, corner)| {
                let pixels = [picture.width() as usize, picture.height() as usize];
                let image = ColorImage::from_rgba_unmultiplied(pixels, picture.as_raw());
                (ui.ctx().load_texture("legend", image, TextureOptions::LINEAR), corner)
            });
        }
        let Some((texture, corner)) = &self.drawn else { return };
        let points = rect.size() / vec2(size.x as f32, size.y as f32);
        let corner = rect.min + vec2(corner.x as f32, corner.y as f32) * points;
        let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        let place = Rect::from_min_size(corner, texture.size_vec2() * points);
        ui.painter().image(texture.id(), place, whole, Color32::WHITE);
    }
}
