//! Text of any size, in Ubuntu Light.

use ab_glyph::{Font as _, FontRef, PxScale, ScaleFont as _, point};
use glam::DVec2;

use super::Ink;

/// A font, with letters of a size.
pub(super) struct Letters {
    font: FontRef<'static>,
    scale: PxScale,
}

impl Letters {
    /// Letters whose lines are `size` pixels high; `None` without a font.
    pub(super) fn new(size: f64) -> Option<Self> {
        let font = FontRef::try_from_slice(epaint_default_fonts::UBUNTU_LIGHT).ok()?;
        Some(Self { font, scale: PxScale::from(size as f32) })
    }

    /// Width of a text, pixels.
    pub(super) fn width(&self, text: &str) -> f64 {
        let font = self.font.as_scaled(self.scale);
        let mut before = None;
        let advances = text.chars().map(|letter| {
            let glyph = font.glyph_id(letter);
            let kern = before.replace(glyph).map_or(0.0, |before| font.kern(before, glyph));
            kern + font.h_advance(glyph)
        });
        advances.sum::<f32>().into()
    }

    /// Height of a figure, pixels.
    pub(super) fn height(&self) -> f64 {
        let figure = self.font.glyph_id('0').with_scale_and_position(self.scale, point(0.0, 0.0));
        self.font.outline_glyph(figure).map_or(0.0, |figure| figure.px_bounds().height().into())
    }

    /// Adds a text that begins at a place on its base line.
    pub(super) fn write(&self, text: &str, at: DVec2, ink: &mut Ink) {
        let font = self.font.as_scaled(self.scale);
        let mut x = at.x as f32;
        let mut before = None;
        for letter in text.chars() {
            let glyph = font.glyph_id(letter);
            x += before.replace(glyph).map_or(0.0, |before| font.kern(before, glyph));
            let placed = glyph.with_scale_and_position(self.scale, point(x, at.y as f32));
            if let Some(outline) = self.font.outline_glyph(placed) {
                let corner = outline.px_bounds().min;
                outline.draw(|dx, dy, share| {
                    let (dx, dy) = (i64::from(dx), i64::from(dy));
                    // The strokes of a light font are thin: half covered pixels count for more.
                    let share = f64::from(share).clamp(0.0, 1.0).powf(0.7);
                    ink.cover(corner.x as i64 + dx, corner.y as i64 + dy, share);
                });
            }
            x += font.h_advance(glyph);
        }
    }
}
