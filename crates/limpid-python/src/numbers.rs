//! Numbers of Python: arguments that name themselves in errors, and 32-bit floats with their own digits.

use std::ops::RangeInclusive;

use glam::DVec3;
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;

use crate::errors::scene_error;

/// A 32-bit float as the number with the fewest digits that is rounded to it: 0.1, not 0.10000000149.
pub(crate) fn short(x: f32) -> f64 {
    x.to_string().parse().unwrap_or(x.into())
}

/// The error of an argument.
fn unexpected(name: &str, value: &Bound<'_, PyAny>, expected: &str) -> PyErr {
    const LONGEST: usize = 80;
    let text = value.repr().map_or_else(|_| "?".into(), |text| text.to_string());
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let short: String = text.chars().take(LONGEST).collect();
    let more = if short.len() < text.len() { "..." } else { "" };
    scene_error(format!("{name} is {short}{more}; expected {expected}"))
}

/// A number within a range.
pub(crate) fn number(
    name: &str,
    value: &Bound<'_, PyAny>,
    range: &RangeInclusive<f64>,
    expected: &str,
) -> PyResult<f64> {
    let found = value.extract::<f64>().ok().filter(|x| range.contains(x));
    found.ok_or_else(|| unexpected(name, value, expected))
}

/// A length above 0, m.
pub(crate) fn length(name: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    number(name, value, &(f64::from(f32::MIN_POSITIVE)..=1e18), "a length above 0 m")
}

/// Three finite numbers.
pub(crate) fn vector(name: &str, value: &Bound<'_, PyAny>) -> PyResult<DVec3> {
    let found = value.extract::<[f64; 3]>().ok().map(DVec3::from);
    let found = found.filter(|x| x.is_finite() && x.abs().max_element() < 1e18);
    found.ok_or_else(|| unexpected(name, value, "3 numbers, as (0, 1, 0)"))
}

/// The places of an array of shape (n, 3), or of particles.
pub(crate) fn places(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<DVec3>> {
    let py = value.py();
    let own = value.getattr_opt("positions")?;
    let numpy = py.import("numpy")?;
    let expected = "an array of shape (n, 3) of finite numbers, not empty";
    let array = numpy.call_method1("asarray", (own.as_ref().unwrap_or(value), "float64"));
    let array = array.ok().and_then(|array| array.extract::<PyReadonlyArray2<'_, f64>>().ok());
    let array = array.ok_or_else(|| unexpected(name, value, expected))?;
    let array = array.as_array();
    let is_good = array.ncols() == 3 && array.nrows() > 0 && array.iter().all(|x| x.abs() < 1e18);
    if !is_good {
        return Err(unexpected(name, value, expected));
    }
    Ok(array.outer_iter().map(|row| DVec3::new(row[0], row[1], row[2])).collect())
}
