//! Particles from arrays, and arrays from particles.
//!
//! The Python half gives arrays of the right number of axes, of native and aligned numbers. Each is copied once,
//! under the interpreter's lock: another thread might change it.

use std::path::PathBuf;

use glam::{DMat3, DVec3, Vec3};
use limpid::camera::is_position;
use limpid::liquid::Ellipsoid;
use limpid::liquid::Particles;
use limpid::liquid::particles::origin_for;
use limpid_io::particles::{self, Contents, ReadOptions};
use numpy::ndarray::{ArrayView2, Axis};
use numpy::{Element, IntoPyArray as _, PyArray1, PyArray2, PyArrayMethods as _};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::work;

/// The arrays of particles, `None` for those that are not given: positions and velocities of shape (n, 3), radii,
/// densities and ids of shape (n), ellipsoids of shape (n, 9).
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Arrays<'py> {
    positions: Bound<'py, PyAny>,
    velocities: Option<Bound<'py, PyAny>>,
    radii: Option<Bound<'py, PyAny>>,
    densities: Option<Bound<'py, PyAny>>,
    ids: Option<Bound<'py, PyAny>>,
    ellipsoids: Option<Bound<'py, PyAny>>,
}

/// A number of an array of floats.
trait Float: Element + Copy + Sync {
    fn single(self) -> f32;
    fn double(self) -> f64;
}

impl Float for f32 {
    fn single(self) -> f32 {
        self
    }

    fn double(self) -> f64 {
        self.into()
    }
}

impl Float for f64 {
    fn single(self) -> f32 {
        self as f32
    }

    fn double(self) -> f64 {
        self
    }
}

impl Arrays<'_> {
    /// Copies the arrays.
    ///
    /// # Errors
    /// `ValueError` naming the array and the first particle whose value is not finite or out of range.
    pub(crate) fn particles(&self) -> PyResult<Particles> {
        let mut particles = places(&self.positions)?;
        if let Some(array) = &self.velocities {
            particles.velocities =
                Some(bytemuck::allocation::cast_vec(floats::<3>(array, "velocities")?));
        }
        let column =
            |array, name| -> PyResult<Vec<f32>> { Ok(floats::<1>(array, name)?.into_flattened()) };
        if let Some(array) = &self.radii {
            let radii = column(array, "radius")?;
            if let Some(i) = radii.iter().position(|&radius| radius < 0.0) {
                return Err(at("radius", i, &radii[i], "0 or more, in metres"));
            }
            particles.radii = Some(radii);
        }
        particles.densities =
            self.densities.as_ref().map(|array| column(array, "densities")).transpose()?;
        if let Some(array) = &self.ids {
            let ids = array.cast::<PyArray1<i64>>()?.try_readonly()?;
            particles.ids = Some(ids.as_array().iter().copied().collect());
        }
        if let Some(array) = &self.ellipsoids {
            let rows = floats::<9>(array, "ellipsoids")?;
            let shapes = rows.iter().map(|row| {
                // Rows of the array are rows of the matrix.
                let rows = row.map(f64::from);
                Ellipsoid::of_map(DMat3::from_cols_array(&rows).transpose())
            });
            particles.ellipsoids = Some(shapes.collect());
        }
        Ok(particles)
    }
}

/// The error of a particle's value.
fn at(name: &str, particle: usize, value: &dyn std::fmt::Debug, expected: &str) -> PyErr {
    // As Python writes it.
    let value = format!("{value:?}").replace("NaN", "nan");
    PyValueError::new_err(format!("{name}: particle {particle} has {value}; expected {expected}"))
}

/// Particles at the rows of an array of either kind of floats.
pub(crate) fn places(array: &Bound<'_, PyAny>) -> PyResult<Particles> {
    match array.cast::<PyArray2<f32>>() {
        Ok(array) => positions(array.try_readonly()?.as_array()),
        Err(_) => positions(array.cast::<PyArray2<f64>>()?.try_readonly()?.as_array()),
    }
}

/// Particles at the rows of an array, with an origin as files of these numbers would have it.
fn positions<T: Float>(array: ArrayView2<'_, T>) -> PyResult<Particles> {
    let place = |row: &[T; 3]| DVec3::from(row.map(Float::double));
    let rows = || array.axis_iter(Axis(0)).map(|row| [row[0], row[1], row[2]]);
    let mut single = true;
    for (i, row) in rows().enumerate() {
        let place = place(&row);
        if !is_position(place) {
            return Err(at(
                "positions",
                i,
                &place.to_array(),
                "finite numbers below 1e18, in metres",
            ));
        }
        single &= place.as_vec3().as_dvec3() == place;
    }
    // 32-bit floats stored as 64-bit ones need no origin.
    let at = |i: usize| place(&[array[(i, 0)], array[(i, 1)], array[(i, 2)]]);
    let origin = if single { DVec3::ZERO } else { origin_for(array.nrows(), at) };
    let near = |row: [T; 3]| match single {
        true => Vec3::from(row.map(Float::single)),
        false => (place(&row) - origin).as_vec3(),
    };
    let positions = rows().map(near).collect();
    Ok(Particles { origin, positions, ..Particles::default() })
}

/// The rows of an array of N finite numbers.
pub(crate) fn floats<const N: usize>(
    array: &Bound<'_, PyAny>,
    name: &str,
) -> PyResult<Vec<[f32; N]>> {
    match array.cast::<PyArray2<f32>>() {
        Ok(array) => rows(array.try_readonly()?.as_array(), name),
        Err(_) => rows(array.cast::<PyArray2<f64>>()?.try_readonly()?.as_array(), name),
    }
}

fn rows<T: Float, const N: usize>(array: ArrayView2<'_, T>, name: &str) -> PyResult<Vec<[f32; N]>> {
    let mut copied = Vec::with_capacity(array.nrows());
    for (i, row) in array.axis_iter(Axis(0)).enumerate() {
        let row: [f32; N] = std::array::from_fn(|k| row[k].single());
        if !row.iter().all(|x| x.is_finite()) {
            return Err(at(name, i, &row, "finite numbers"));
        }
        copied.push(row);
    }
    Ok(copied)
}

/// The arrays of particles by name, without those that they lack. Positions are 64-bit where 32 bits would lose
/// digits; radii are called `radii`.
pub(crate) fn to_arrays<'py>(
    py: Python<'py>,
    particles: Particles,
) -> PyResult<Bound<'py, PyDict>> {
    let arrays = PyDict::new(py);
    let Particles { origin, positions, velocities, densities, radii, ids, ellipsoids, .. } =
        particles;
    if origin == DVec3::ZERO {
        arrays.set_item("positions", vectors(py, positions)?)?;
    } else {
        let count = positions.len();
        let places = positions.iter().flat_map(|x| (origin + x.as_dvec3()).to_array());
        let places: Vec<f64> = places.collect();
        arrays.set_item("positions", places.into_pyarray(py).reshape([count, 3])?)?;
    }
    if let Some(velocities) = velocities {
        arrays.set_item("velocities", vectors(py, velocities)?)?;
    }
    if let Some(densities) = densities {
        arrays.set_item("densities", densities.into_pyarray(py))?;
    }
    if let Some(radii) = radii {
        arrays.set_item("radii", radii.into_pyarray(py))?;
    }
    if let Some(ids) = ids {
        arrays.set_item("ids", ids.into_pyarray(py))?;
    }
    if let Some(ellipsoids) = ellipsoids {
        let matrices: Vec<f32> = ellipsoids
            .iter()
            .flat_map(|e| [e.xx, e.xy, e.xz, e.xy, e.yy, e.yz, e.xz, e.yz, e.zz])
            .collect();
        arrays
            .set_item("ellipsoids", matrices.into_pyarray(py).reshape([ellipsoids.len(), 3, 3])?)?;
    }
    Ok(arrays)
}

/// Vectors as an array of shape (n, 3).
pub(crate) fn vectors(py: Python<'_>, vectors: Vec<Vec3>) -> PyResult<Bound<'_, PyArray2<f32>>> {
    let count = vectors.len();
    let numbers: Vec<f32> = bytemuck::allocation::cast_vec(vectors);
    numbers.into_pyarray(py).reshape([count, 3])
}

/// Reads a particle file; returns also what was left out of it, or understood in a way of its own.
#[pyfunction]
#[pyo3(signature = (path, map, select, skip_invalid))]
pub(crate) fn read(
    py: Python<'_>,
    path: PathBuf,
    map: Option<String>,
    select: Option<String>,
    skip_invalid: bool,
) -> PyResult<(Bound<'_, PyDict>, Vec<String>)> {
    let contents = work::run(py, move |_| {
        let map = map.map(|text| text.parse()).transpose()?.unwrap_or_default();
        let select = select.map(|text| text.parse()).transpose()?.unwrap_or_default();
        let options = ReadOptions { map, select, skip_invalid, ..ReadOptions::default() };
        Contents::read(&path, &options)
    })?;
    let remarks = contents.remarks.iter().map(ToString::to_string).collect();
    Ok((to_arrays(py, contents.particles)?, remarks))
}

/// Writes a particle file; returns the names of the attributes that its format cannot hold.
#[pyfunction]
pub(crate) fn write(
    py: Python<'_>,
    path: PathBuf,
    arrays: Arrays<'_>,
) -> PyResult<Vec<&'static str>> {
    let particles = arrays.particles()?;
    work::run(py, move |_| {
        let lost = particles::unsupported_attributes(&particles, &path)?;
        particles::write(&particles, &path)?;
        Ok(lost)
    })
}
