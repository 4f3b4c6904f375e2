//! Foam, spray, bubbles and dust from arrays.

use limpid::diffuse::{Diffuse, DiffuseKind};
use limpid::liquid::Particles;
use numpy::{PyArray1, PyArrayMethods as _};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{floats, places};

/// The arrays of diffuse particles, `None` for those that are not given: positions and velocities of shape (n, 3), radii, ages
/// and lifetimes of shape (n, 1), kinds of shape (n).
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct DiffuseArrays<'py> {
    positions: Bound<'py, PyAny>,
    velocities: Option<Bound<'py, PyAny>>,
    radii: Option<Bound<'py, PyAny>>,
    kinds: Option<Bound<'py, PyAny>>,
    ages: Option<Bound<'py, PyAny>>,
    lifetimes: Option<Bound<'py, PyAny>>,
}

/// Diffuse particles whose radii may be those that the liquid suggests.
#[derive(Clone, PartialEq)]
pub(crate) struct Given {
    pub(crate) diffuse: Diffuse,
    pub(crate) has_radii: bool,
}

impl DiffuseArrays<'_> {
    /// Copies the arrays. Particles whose lifetime is over are left out.
    ///
    /// # Errors
    /// `ValueError` naming the array and the first particle whose value is out of range.
    pub(crate) fn given(&self) -> PyResult<Given> {
        let Particles { origin, positions, .. } = places(&self.positions)?;
        let column = |array: &Option<Bound<'_, PyAny>>, name: &str| {
            let read =
                |array| -> PyResult<Vec<f32>> { Ok(floats::<1>(array, name)?.into_flattened()) };
            array.as_ref().map(read).transpose()
        };
        let velocities = self.velocities.as_ref();
        let velocities =
            velocities.map(|array| floats::<3>(array, "diffuse velocities")).transpose()?;
        let radii = column(&self.radii, "diffuse radius")?;
        if let Some(i) = radii.iter().flatten().position(|&radius| radius <= 0.0) {
            return Err(wrong("radius", i, "above 0, in metres"));
        }
        let ages = column(&self.ages, "diffuse ages")?;
        if let Some(i) = ages.iter().flatten().position(|&age| age < 0.0) {
            return Err(wrong("ages", i, "0 or more, in seconds"));
        }
        let lifetimes = column(&self.lifetimes, "diffuse lifetimes")?;
        let kinds = match &self.kinds {
            None => vec![DiffuseKind::Foam; positions.len()],
            Some(array) => {
                let array = array.cast::<PyArray1<i64>>()?.try_readonly()?;
                let kind = |(i, &number): (usize, &i64)| {
                    let known = usize::try_from(number).ok().and_then(|n| DiffuseKind::ALL.get(n));
                    let expected = "0 foam, 1 spray, 2 bubble or 3 dust";
                    known.copied().ok_or_else(|| wrong("kinds", i, expected))
                };
                array.as_array().iter().enumerate().map(kind).collect::<PyResult<_>>()?
            }
        };
        let has_radii = radii.is_some();
        let mut diffuse = Diffuse {
            origin,
            velocities: velocities.map(bytemuck::allocation::cast_vec),
            radii: radii.unwrap_or_else(|| vec![0.0; positions.len()]),
            positions,
            kinds,
            ages,
            lifetimes: lifetimes.clone(),
            ..Diffuse::default()
        };
        if let Some(left) = lifetimes {
            diffuse.retain(|i| left[i] > 0.0);
        }
        Ok(Given { diffuse, has_radii })
    }
}

fn wrong(name: &str, particle: usize, expected: &str) -> PyErr {
    PyValueError::new_err(format!("diffuse {name}: particle {particle}: expected {expected}"))
}
