//! Pictures of a failed entry: expected, rendered, and their difference.

use std::sync::Arc;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, GenericImage, ImageEncoder, RgbImage};

use crate::compare::FlipMap;

/// Gap between pictures that stand side by side, pixels.
const GAP: u32 = 4;

/// A group of pictures of one image.
#[derive(Debug, Clone)]
pub struct Exhibit {
    /// The title.
    pub title: String,
    /// The expected picture, the rendered one and their difference, as far as they exist.
    pub panels: Vec<Panel>,
    /// All panels in one picture.
    pub side_by_side: Panel,
}

/// A picture and its file.
#[derive(Debug, Clone)]
pub struct Panel {
    /// The file name.
    pub file: String,
    /// `expected`, `actual`, `difference` or `side by side`.
    pub caption: &'static str,
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// The PNG data.
    pub png: Arc<[u8]>,
}

impl Panel {
    fn new(stem: &str, caption: &'static str, picture: &RgbImage) -> Self {
        let file = format!("{stem}.{}.png", caption.replace(' ', "-"));
        Self { file, caption, size: picture.dimensions(), png: png(picture) }
    }
}

impl Exhibit {
    /// Encodes the pictures; their file names begin with `stem`.
    pub(super) fn new(
        stem: &str,
        title: impl Into<String>,
        pictures: &[(&'static str, &RgbImage)],
    ) -> Self {
        let panels = pictures.iter().map(|(caption, picture)| Panel::new(stem, caption, picture));
        let images: Vec<_> = pictures.iter().map(|(_, picture)| *picture).collect();
        let side_by_side_panel = Panel::new(stem, "side by side", &side_by_side(&images));
        Self { title: title.into(), panels: panels.collect(), side_by_side: side_by_side_panel }
    }

    pub(super) fn files(&self) -> impl Iterator<Item = (&str, &[u8])> {
        let panels = self.panels.iter().chain([&self.side_by_side]);
        panels.map(|panel| (panel.file.as_str(), &*panel.png))
    }
}

/// Encodes an 8-bit sRGB picture as a small PNG.
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

/// Joins pictures from left to right on a grey background.
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

/// Maps values from 0 to `largest` to the magma colour map; non-finite values become white.
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
