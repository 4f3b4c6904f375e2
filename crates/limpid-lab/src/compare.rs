//! Difference of two pictures: FLIP, RMSE, PSNR and the worst pixel.
//!
//! FLIP measures visibility, RMSE and PSNR grey levels; a small change of a thin highlight scores
//! high in the first and low in the others, so all are reported. Pictures are 8-bit sRGB, row by
//! row from the top left. Every sum runs in pixel order or over integers, so results do not depend
//! on the number of threads.

mod flip;

use std::fmt;
use std::io::Cursor;
use std::path::Path;

use image::{DynamicImage, ImageError, ImageFormat, ImageReader, Rgb, RgbImage};
use serde::Serialize;

use limpid_io::error::{Error, Location, Result};
use limpid_io::files;
use limpid_io::output::{self, FileKind, Files, PictureFormat};

pub use flip::{PIXELS_PER_DEGREE, flip};

/// The difference between a reference and a test picture, in numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Mean of the FLIP map, 0 (identical) to 1.
    pub mean_flip: f64,
    /// 99th percentile of the FLIP map.
    pub p99_flip: f64,
    /// Root mean square difference of the sRGB values, 0 to 1, over pixels and channels.
    pub rmse: f64,
    /// Peak signal-to-noise ratio, −20 log₁₀ `rmse`, in decibels; `None` if identical.
    pub psnr_db: Option<f64>,
    /// The pixel with the greatest FLIP.
    pub worst: Worst,
    /// The greatest difference of any channel of any pixel, in levels of 255.
    pub max_channel_error: u8,
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "mean FLIP {:.4}, 99th percentile {:.4}", self.mean_flip, self.p99_flip)?;
        match self.psnr_db {
            Some(psnr) => writeln!(f, "RMSE {:.4}, PSNR {psnr:.2} dB", self.rmse)?,
            None => writeln!(f, "identical")?,
        }
        let Worst { x, y, flip, reference, test } = self.worst;
        write!(
            f,
            "worst pixel ({x}, {y}): FLIP {flip:.3}, {reference:?} in the reference, {test:?} in the test"
        )
    }
}

/// The pixel with the greatest FLIP; of equals the first in reading order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Worst {
    /// Column, from the left.
    pub x: u32,
    /// Row, from the top.
    pub y: u32,
    /// FLIP there.
    pub flip: f32,
    /// The reference's sRGB there.
    pub reference: [u8; 3],
    /// The test's sRGB there.
    pub test: [u8; 3],
}

/// The FLIP map of two pictures: the visible difference at each pixel, 0 (none) to 1.
#[derive(Debug, Clone, PartialEq)]
pub struct FlipMap {
    /// Columns, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// `width · height` values, row by row from the top left.
    pub values: Vec<f32>,
}

impl FlipMap {
    /// The mean over all pixels.
    pub fn mean(&self) -> f64 {
        self.values.iter().map(|&value| f64::from(value)).sum::<f64>() / self.values.len() as f64
    }

    /// The mean over the pixels (x, y) that `chosen` accepts; `None` if it accepts none.
    pub fn mean_where(&self, chosen: impl Fn(u32, u32) -> bool) -> Option<f64> {
        let (sum, count) = self
            .pixels()
            .filter(|&(x, y, _)| chosen(x, y))
            .fold((0.0, 0_u64), |(sum, count), (_, _, value)| (sum + f64::from(value), count + 1));
        (count > 0).then(|| sum / count as f64)
    }

    /// The smallest value that at least `fraction` (0 to 1) of the pixels do not exceed.
    pub fn percentile(&self, fraction: f64) -> f64 {
        let rank = (fraction * self.values.len() as f64).ceil() as usize;
        let index = rank.clamp(1, self.values.len()) - 1;
        let mut values = self.values.clone();
        let (_, &mut value, _) = values.select_nth_unstable_by(index, f32::total_cmp);
        f64::from(value)
    }

    /// Column, row and value of the greatest difference; of equals the first in reading order.
    pub fn worst(&self) -> (u32, u32, f32) {
        let greater = |best: (u32, u32, f32), pixel: (u32, u32, f32)| {
            if pixel.2 > best.2 { pixel } else { best }
        };
        self.pixels().fold((0, 0, 0.0), greater)
    }

    /// The map in the magma colour map: black for no difference, then violet, orange, cream.
    pub fn picture(&self) -> RgbImage {
        RgbImage::from_fn(self.width, self.height, |x, y| {
            magma(self.values[y as usize * self.width as usize + x as usize])
        })
    }

    /// Checks the file of [`FlipMap::write`]; `files` has what is read.
    ///
    /// # Errors
    /// As [`Files::writes`]; [`Error::Usage`] for a format without 8 bits.
    pub fn check_output(path: &Path, files: &mut Files) -> Result<()> {
        files.writes(path, FileKind::PICTURE)?;
        if PictureFormat::of(path)? == PictureFormat::Exr {
            let problem = "differences are an 8-bit picture: expected .png, .jpg or .webp";
            return Err(Error::Usage(format!("{}: {problem}", path.display())));
        }
        Ok(())
    }

    /// Writes [`FlipMap::picture`].
    ///
    /// # Errors
    /// As [`output::write_picture`].
    pub fn write(&self, path: &Path) -> Result<()> {
        output::write_picture(path, &self.picture().into(), &[])
    }

    fn pixels(&self) -> impl Iterator<Item = (u32, u32, f32)> {
        let places = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        places.zip(&self.values).map(|((x, y), &value)| (x, y, value))
    }
}

/// Compares two pictures of the same size as seen at [`PIXELS_PER_DEGREE`].
pub fn compare(reference: &RgbImage, test: &RgbImage) -> Result<(Comparison, FlipMap)> {
    let map = flip(reference, test, PIXELS_PER_DEGREE)?;
    let (x, y, flip) = map.worst();

    let channel_errors = || reference.iter().zip(test.iter()).map(|(&a, &b)| a.abs_diff(b));
    let squares: u64 = channel_errors().map(|error| u64::from(error).pow(2)).sum();
    let rmse = (squares as f64 / reference.len() as f64).sqrt() / 255.0;

    let comparison = Comparison {
        mean_flip: map.mean(),
        p99_flip: map.percentile(0.99),
        rmse,
        psnr_db: (squares > 0).then(|| -20.0 * rmse.log10()),
        worst: Worst {
            x,
            y,
            flip,
            reference: reference.get_pixel(x, y).0,
            test: test.get_pixel(x, y).0,
        },
        max_channel_error: channel_errors().max().unwrap_or(0),
    };
    Ok((comparison, map))
}

/// Loads and compares two PNG files; every error names the files. Their sizes are compared before
/// any pixel is decoded.
pub fn compare_files(reference: &Path, test: &Path) -> Result<(Comparison, FlipMap)> {
    let read = |path| -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        files::read_picture(path, &mut bytes)?;
        Ok(bytes)
    };
    let (reference_bytes, test_bytes) = (read(reference)?, read(test)?);
    let named = |error| match error {
        Error::Mismatch(problem) => {
            Error::Mismatch(format!("{} and {}: {problem}", reference.display(), test.display()))
        }
        other => other,
    };
    // A broken header is reported by the decoder.
    let sizes = size(&reference_bytes).zip(size(&test_bytes));
    if let Some((of_reference, of_test)) = sizes {
        check_sizes(of_reference, of_test).map_err(named)?;
    }
    let reference = parse_picture(reference, &reference_bytes)?;
    let test = parse_picture(test, &test_bytes)?;
    compare(&reference, &test).map_err(named)
}

/// Reads width and height from the header.
fn size(bytes: &[u8]) -> Option<(u32, u32)> {
    let header = files::catch_panics(Path::new(""), || {
        let reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
        Ok(reader.into_dimensions().ok())
    });
    header.ok()?
}

/// Loads a PNG of 8 or 16 bits as 8-bit sRGB; 16 bits are rounded, grey becomes RGB.
///
/// Pictures with transparent pixels are rejected: their appearance depends on a background that the
/// file does not define.
pub fn load_picture(path: &Path) -> Result<RgbImage> {
    let mut bytes = Vec::new();
    files::read_picture(path, &mut bytes)?;
    parse_picture(path, &bytes)
}

/// Like [`load_picture`], from bytes in memory; `path` is used in error messages.
///
/// # Errors
/// As [`load_picture`], except those of reading the file.
pub fn parse_picture(path: &Path, bytes: &[u8]) -> Result<RgbImage> {
    files::catch_panics(path, || decode(path, bytes))
}

/// Whether a PNG has an animation control chunk, which precedes its pixel data.
fn is_animated(bytes: &[u8]) -> bool {
    let mut rest = bytes.get(8..).unwrap_or_default();
    while let Some((length, chunk)) = rest.split_first_chunk::<4>() {
        match chunk.get(..4) {
            Some(b"acTL") => return true,
            None | Some(b"IDAT") => return false,
            Some(_) => {}
        }
        // Skips the chunk's type and checksum too.
        let length = u32::from_be_bytes(*length) as usize;
        rest = chunk.get(length.saturating_add(8)..).unwrap_or_default();
    }
    false
}

fn decode(path: &Path, bytes: &[u8]) -> Result<RgbImage> {
    if !matches!(image::guess_format(bytes), Ok(ImageFormat::Png)) {
        return Err(Error::format(path, "not a PNG; pictures to compare are PNG files in sRGB"));
    }

    /// Memory per pixel in a comparison, bytes: the RGB pixel, and half of the FLIP map and of its
    /// sorted copy.
    const EACH: u64 = 3 + 4;
    if is_animated(bytes) {
        return Err(Error::format(path, "a film (animated PNG); compare pictures of it"));
    }
    let mut cursor = Cursor::new(bytes);
    let reader = ImageReader::with_format(&mut cursor, ImageFormat::Png);
    let picture = files::decode_picture(path, bytes, reader, EACH)?;
    let picture = picture.map_err(|error| match error {
        ImageError::Decoding(_) | ImageError::IoError(_) => {
            Error::malformed(path, Location::Byte(cursor.position()), error.to_string())
        }
        // A valid file that is too large or of a kind that the decoder does not support.
        other => Error::format(path, other.to_string()),
    })?;

    if !picture.color().has_alpha() {
        return Ok(picture.into_rgb8());
    }
    let rgba = picture.into_rgba8();
    match rgba.enumerate_pixels().find(|(_, _, pixel)| pixel.0[3] < 255) {
        None => Ok(DynamicImage::from(rgba).into_rgb8()),
        Some((x, y, _)) => Err(Error::format(
            path,
            format!("transparent at pixel ({x}, {y}); flatten it onto a background first"),
        )),
    }
}

/// Fails unless both pictures have the same size and at least one pixel.
fn check_sizes((width, height): (u32, u32), test: (u32, u32)) -> Result<()> {
    if (width, height) != test {
        return Err(Error::Mismatch(format!(
            "the reference is {width}x{height} pixels, the test {}x{}; render both at one size",
            test.0, test.1
        )));
    }
    if width == 0 || height == 0 {
        return Err(Error::Usage(format!("cannot compare pictures of {width}x{height} pixels")));
    }
    Ok(())
}

/// The magma colour map (S. van der Walt and N. Smith, for matplotlib, 2015) at `value` in 0..1.
///
/// A quintic per channel, fitted to within 5/255 of the original: close enough to read by eye,
/// without a table.
fn magma(value: f32) -> Rgb<u8> {
    const COEFFICIENTS: [[f32; 6]; 3] = [
        [-0.031, 1.182, -0.145, 5.273, -9.447, 4.145],
        [0.017, 0.209, 0.621, -2.695, 5.738, -2.882],
        [-0.008, 2.416, 1.860, -21.660, 30.065, -11.940],
    ];
    Rgb(COEFFICIENTS.map(|channel| {
        let level = channel.iter().rev().fold(0.0, |sum, coefficient| sum * value + coefficient);
        (255.0 * level.clamp(0.0, 1.0)).round() as u8
    }))
}
