//! The native half of the Python package `limpid`, which `python/limpid/` completes: that half checks arguments
//! and shapes objects, this one copies arrays, and does all work without holding the interpreter's lock.

mod arrays;
mod bake;
mod camera;
mod colors;
mod device;
mod diffuse;
mod errors;
mod film;
mod frames;
mod images;
mod kept;
mod numbers;
mod pictures;
mod scene;
mod series;
mod work;

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the program `limpid` with `arguments`, the first of which is its name, and returns its exit code.
#[pyfunction]
fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| limpid_cli::run(arguments))
}

// Without the lock of the interpreter nothing has been tested: where it can be off, it is turned on.
#[pymodule(gil_used = true)]
#[pyo3(name = "_limpid")]
fn limpid_module(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<bake::Bake>()?;
    module.add_class::<camera::Camera>()?;
    module.add_class::<device::Device>()?;
    module.add_class::<device::Radiance>()?;
    module.add_class::<film::FilmFile>()?;
    module.add_class::<frames::Frames>()?;
    module.add_class::<frames::Series>()?;
    module.add_class::<scene::Project>()?;
    module.add_function(wrap_pyfunction!(arrays::read, module)?)?;
    module.add_function(wrap_pyfunction!(arrays::write, module)?)?;
    module.add_function(wrap_pyfunction!(colors::colormap, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::legend, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::encode, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::flip, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::load, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::numbered, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::save, module)?)?;
    module.add_function(wrap_pyfunction!(work::finish, module)?)?;
    module.add_function(wrap_pyfunction!(main, module)?)
}
