//! Environment maps, as equirectangular pictures.

use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use glam::{UVec2, Vec3};
use image::{ImageError, ImageReader};
use limpid::environment::{Environment, is_radiance};

use crate::error::{Error, Result};
use crate::files;

/// Reads an equirectangular picture: Radiance HDR, OpenEXR, or PNG (sRGB).
///
/// # Errors
/// [`Error::Io`] or [`Error::Format`] naming the file.
pub fn load(path: &Path) -> Result<Environment> {
    let mut bytes = Vec::new();
    files::read_picture(path, &mut bytes)?;
    parse(path, &bytes)
}

/// As [`load`], from the header alone: the map has no pixels.
///
/// # Errors
/// As [`load`].
pub(crate) fn outline(path: &Path) -> Result<Environment> {
    let mut bytes = Vec::new();
    files::read_picture(path, &mut bytes)?;
    files::catch_panics(path, || {
        let mut reader = reader(path, &bytes)?;
        let limits = files::picture_limits(&bytes);
        reader.limits(limits.map_err(|problem| Error::format(path, problem))?);
        let (width, height) = reader.into_dimensions().map_err(|e| format_error(path, e))?;
        Ok(Environment::Map { size: UVec2::new(width, height), pixels: Arc::new([]) })
    })
}

/// As [`load`], from the file's contents; `path` is for messages.
///
/// # Errors
/// [`Error::Format`] naming the file, [`limpid::Error::Memory`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Environment> {
    /// Rows converted at a time, few enough that their memory is negligible.
    const ROWS: u32 = 64;
    let reader = reader(path, bytes)?;
    let srgb = reader.format() == Some(image::ImageFormat::Png);
    let bytes_per_pixel = size_of::<[f32; 4]>() as u64;
    let picture = files::catch_panics(path, || {
        files::decode_picture(path, bytes, reader, bytes_per_pixel)?
            .map_err(|e| format_error(path, e))
    })?;
    let size = UVec2::new(picture.width(), picture.height());
    let linear = |c: f32| match srgb {
        true if c <= 0.04045 => c / 12.92,
        true => ((c + 0.055) / 1.055).powf(2.4),
        false => c,
    };
    let count = size.x as usize * size.y as usize;
    if count == 0 {
        return Err(Error::format(path, "the environment has no pixels"));
    }
    let mut pixels: Arc<[_]> = std::iter::repeat_n([0.0; 4], count).collect();
    let filled: &mut [[f32; 4]] = Arc::get_mut(&mut pixels).expect("the only reference");
    let bands = (0..size.y).step_by(ROWS as usize);
    for (top, rows) in bands.zip(filled.chunks_mut(ROWS as usize * size.x as usize)) {
        let part = picture.crop_imm(0, top, size.x, ROWS.min(size.y - top)).into_rgb32f();
        for (p, pixel) in part.pixels().zip(rows) {
            *pixel = [linear(p[0]), linear(p[1]), linear(p[2]), 1.0];
        }
    }
    if let Some(c) = pixels.iter().flatten().find(|&&c| !is_radiance(Vec3::splat(c))) {
        let problem = format!("the environment has a radiance of {c}: expected 0 to 1e12");
        return Err(Error::format(path, problem));
    }
    Ok(Environment::Map { size, pixels })
}

fn reader<'a>(path: &Path, bytes: &'a [u8]) -> Result<ImageReader<Cursor<&'a [u8]>>> {
    let reader = ImageReader::new(Cursor::new(bytes));
    reader.with_guessed_format().map_err(|e| Error::io(path, "read", e))
}

fn format_error(path: &Path, error: ImageError) -> Error {
    match error {
        ImageError::IoError(error) => Error::io(path, "read", error),
        error => {
            let problem = format!("not a picture for an environment (HDR, EXR, PNG): {error}");
            Error::format(path, problem)
        }
    }
}
