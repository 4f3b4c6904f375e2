//! Pictures: encoding, writing and comparing them.

use std::path::PathBuf;

use glam::UVec2;
use image::{DynamicImage, RgbImage, RgbaImage};
use limpid::aov::{Channel, Part};
use limpid_io::color_by::{ColorScale, MapName};
use limpid_io::exr;
use limpid_io::output::{self, PictureFormat};
use limpid_io::overlay;
use limpid_lab::compare;
use numpy::ndarray::ArrayView3;
use numpy::{IntoPyArray as _, PyArray2, PyArray3, PyArrayMethods as _};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::numbers::short;
use crate::work;

/// The colours of an array of shape (height, width, 3 or 4).
pub(crate) fn rgb(pixels: ArrayView3<'_, u8>) -> RgbImage {
    let (height, width, _) = pixels.dim();
    let bytes: Vec<u8> = match pixels.as_slice() {
        Some(bytes) if pixels.dim().2 == 4 => {
            bytes.as_chunks::<4>().0.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect()
        }
        _ => pixels.rows().into_iter().flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect(),
    };
    RgbImage::from_raw(width as u32, height as u32, bytes).expect("each pixel has three bytes")
}

/// The picture, with coverage if `alpha`.
fn picture(pixels: ArrayView3<'_, u8>, alpha: bool) -> PyResult<DynamicImage> {
    let (height, width, channels) = pixels.dim();
    if channels != 4 || height * width == 0 {
        let problem = format!(
            "rgba has the shape ({height}, {width}, {channels}); expected (height, width, 4)"
        );
        return Err(PyValueError::new_err(problem));
    }
    if !alpha {
        return Ok(rgb(pixels).into());
    }
    let bytes = pixels.iter().copied().collect();
    let picture = RgbaImage::from_raw(width as u32, height as u32, bytes);
    Ok(picture.expect("each pixel has four bytes").into())
}

/// The bytes of a PNG.
#[pyfunction]
pub(crate) fn png<'py>(
    py: Python<'py>,
    rgba: &Bound<'py, PyArray3<u8>>,
    alpha: bool,
) -> PyResult<Bound<'py, PyBytes>> {
    let picture = picture(rgba.try_readonly()?.as_array(), alpha)?;
    let bytes =
        work::run(py, move |_| {
            let mut bytes = Vec::new();
            output::encode_png(&mut bytes, &picture, &[]).map_err(|source| {
                limpid_io::Error::Io { path: "PNG".into(), action: "encode", source }
            })?;
            Ok(bytes)
        })?;
    Ok(PyBytes::new(py, &bytes))
}

/// Name and unit of values, and the map and the range that show them.
#[derive(FromPyObject, IntoPyObject)]
pub(crate) struct Scale(String, String, String, (f64, f64));

impl From<ColorScale> for Scale {
    fn from(scale: ColorScale) -> Self {
        let ColorScale { name, unit, map, range: [low, high], .. } = scale;
        Self(name, unit, map.to_string(), (short(low), short(high)))
    }
}

/// The pixels under a legend of the colours, unless they are too few for it.
#[pyfunction]
pub(crate) fn legend<'py>(
    py: Python<'py>,
    rgba: &Bound<'py, PyArray3<u8>>,
    scale: Scale,
) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let Scale(name, unit, map, (low, high)) = scale;
    let map: MapName = map.parse().map_err(PyValueError::new_err)?;
    let range = [low as f32, high as f32];
    let scale = ColorScale { name, unit, map, range, automatic: false };
    let mut picture = picture(rgba.try_readonly()?.as_array(), true)?;
    overlay::draw_legend(&mut picture, &scale);
    let shape = [picture.height() as usize, picture.width() as usize, 4];
    picture.into_rgba8().into_raw().into_pyarray(py).reshape(shape)
}

/// Writes a picture in the format of the extension: `.exr` the radiance, others the 8-bit picture.
#[pyfunction]
pub(crate) fn save(
    py: Python<'_>,
    path: PathBuf,
    rgba: &Bound<'_, PyArray3<u8>>,
    alpha: bool,
    radiance: Option<&Bound<'_, PyArray3<f32>>>,
) -> PyResult<()> {
    let picture = picture(rgba.try_readonly()?.as_array(), alpha)?;
    let radiance = match radiance {
        Some(radiance) => {
            let texels = radiance.try_readonly()?;
            let texels = texels.as_array();
            let (height, width, count) = texels.dim();
            let channels = ["R", "G", "B", "A"].into_iter().take(count).enumerate();
            let channels = channels.map(|(i, name)| Channel {
                name: name.into(),
                values: texels.rows().into_iter().map(|texel| texel[i]).collect(),
            });
            let size = UVec2::new(width as u32, height as u32);
            Some(Part { name: String::new(), size, channels: channels.collect() })
        }
        None => None,
    };
    work::run(py, move |_| match (PictureFormat::of(&path)?, radiance) {
        (PictureFormat::Exr, Some(radiance)) => exr::write(&path, vec![radiance]),
        _ => output::write_picture(&path, &picture, &[]),
    })
}

/// Mean FLIP of two pictures, and the FLIP of each pixel.
#[pyfunction]
pub(crate) fn flip<'py>(
    py: Python<'py>,
    reference: &Bound<'py, PyArray3<u8>>,
    test: &Bound<'py, PyArray3<u8>>,
) -> PyResult<(f64, Bound<'py, PyArray2<f32>>)> {
    let reference = rgb(reference.try_readonly()?.as_array());
    let test = rgb(test.try_readonly()?.as_array());
    let (comparison, map) = work::run(py, move |_| compare::compare(&reference, &test))?;
    let (width, height) = (map.width as usize, map.height as usize);
    Ok((comparison.mean_flip, map.values.into_pyarray(py).reshape([height, width])?))
}

/// Loads an 8-bit picture as an array of shape (height, width, 3).
#[pyfunction]
pub(crate) fn load(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyArray3<u8>>> {
    let picture = work::run(py, move |_| compare::load_picture(&path))?;
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    picture.into_raw().into_pyarray(py).reshape([height, width, 3])
}
