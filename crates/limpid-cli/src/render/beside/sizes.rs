//! Sizes of pictures beside each other.

use glam::UVec2;
use image::{DynamicImage, Rgb, RgbImage};
use limpid_io::{Error, overlay};

/// Pixels between two pictures.
const GAP: u32 = 2;

/// Sizes of the pictures that are put together.
pub(super) struct Sizes {
    /// Of all pictures together.
    pub(super) whole: UVec2,
    /// Of one picture.
    pub(super) picture: UVec2,
    /// Of one with its name.
    pub(super) side: UVec2,
    count: u32,
    /// Pixels of one dot of a letter.
    pub(super) dot: u32,
    /// Whether pictures have coverage.
    alpha: bool,
}

impl Sizes {
    pub(super) fn new(whole: UVec2, count: usize, alpha: bool) -> limpid_io::Result<Self> {
        let count = count as u32;
        let (wide, below) =
            (whole.x.saturating_sub(GAP * (count - 1)) / count, overlay::line_height(whole));
        let picture = UVec2::new(wide, whole.y.saturating_sub(below));
        if picture.min_element() < 16 {
            let problem =
                format!("--size: {}x{} leaves no room for {count} pictures", whole.x, whole.y);
            return Err(Error::Usage(problem));
        }
        let side = UVec2::new(wide, whole.y);
        Ok(Self { whole, picture, side, count, dot: overlay::dot(whole), alpha })
    }

    /// Left borders of the pictures.
    pub(super) fn lefts(&self) -> impl Iterator<Item = u32> {
        (0..self.count).map(|i| i * (self.side.x + GAP))
    }

    /// Nothing drawn yet: dark, or transparent.
    pub(super) fn blank(&self, size: UVec2) -> DynamicImage {
        const DARK: Rgb<u8> = Rgb([24; 3]);
        match self.alpha {
            true => DynamicImage::new_rgba8(size.x, size.y),
            false => RgbImage::from_pixel(size.x, size.y, DARK).into(),
        }
    }
}
