//! What shows why an entry failed: pictures of what is expected, what was drawn, and how the two
//! differ.

use std::sync::Arc;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, GenericImage, ImageEncoder, RgbImage};

use crate::compare::FlipMap;

/// Pixels between the pictures that stand side by side.
const GAP: u32 = 4;

/// Pictures of one thing.
#[derive(Debug, Clone)]
pub struct Exhibit {
    /// What they show.
    pub title: String,
    /// What is expected, what was drawn, the difference, as far as there are such pictures.
    pub panels: Vec<Panel>,
    /// All of them in one picture.
    pub side_by_side: Panel,
}

/// A picture as a file.
#[derive(Debug, Clone)]
pub struct Panel {
    /// Its name.
    pub file: String,
    /// `expected`, `actual`, `difference` or `side by side`.
    pub caption: &'static str,
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// The PNG.
    pub png: Arc<[u8]>,
}

impl Panel {
    fn new(stem: &str, caption: &'static str, picture: &RgbImage) -> Self {
        let file = format!("{stem}.{}.png", caption.replace(' ', "-"));
        Self { file, caption, size: picture.dimensions(), png: png(picture) }
    }
}

impl Exhibit {
    /// Encodes the pictures, whose files begin with `stem`.
    pub(super) fn new(
        stem: &str,
        title: impl Into<String>,
        pictures: &[(&'static str, &RgbImage)],
    ) -> Self {
        let panels = pictures.iter().map(|(caption, picture)| Panel::new(stem, caption, picture));
        let images: Vec<_> = pictures.iter().map(|(_, picture)| *picture).collect();
        let beside = Panel::new(stem, "side by side", &side_by_side(&images));
        Self { title: title.into(), panels: panels.collect(), side_by_side: beside }
    }

    pub(super) fn files(&self) -> impl Iterator<Item = (&str, &[u8])> {
        let panels = self.panels.iter().chain([&self.side_by_side]);
        panels.map(|panel| (panel.file.as_str(), &*panel.png))
    }
}

/// An 8-bit sRGB picture as the bytes of a small PNG.
pub(super) fn png(picture: &RgbImage) -> Arc<[u8]> {
    let mut bytes = Vec::new();
    let encoder =
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive);
    let (width, height) = picture.dimensions();
    encoder
        .write_image(picture, width, height, ExtendedColorType::Rgb8)
        .expect("a picture with pixels is written to memory");
    bytes.into()
}

/// Pictures in a row, on grey, from the left.
fn side_by_side(pictures: &[&RgbImage]) -> RgbImage {
    let width: u32 = pictures.iter().map(|picture| picture.width() + GAP).sum();
    let height = pictures.iter().map(|picture| picture.height()).max().unwrap_or(1);
    let width = width.saturating_sub(GAP).max(1);
    let mut row = RgbImage::from_pixel(width, height, image::Rgb([128; 3]));
    let mut left = 0;
    for picture in pictures {
        row.copy_from(*picture, left, 0).expect("the row is as long as its pictures");
        left += picture.width() + GAP;
    }
    row
}

/// Values of 0 to `largest` in the colours of magma; what is not finite is white.
pub(super) fn false_colour(size: (u32, u32), values: &[f32], largest: f32) -> RgbImage {
    let scale = if largest > 0.0 { largest.recip() } else { 0.0 };
    let scaled = |&value: &f32| if value.is_finite() { value * scale } else { 1.0 };
    let (width, height) = size;
    let mut picture =
        FlipMap { width, height, values: values.iter().map(scaled).collect() }.picture();
    for (pixel, value) in picture.pixels_mut().zip(values) {
        if !value.is_finite() {
            *pixel = image::Rgb([255; 3]);
        }
    }
    picture
}
