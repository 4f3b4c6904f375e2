//! Films: pictures that are encoded one by one.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use glam::UVec2;
use image::RgbImage;
use limpid_io::film::Film;
use numpy::{PyArray3, PyArrayMethods as _};
use pyo3::prelude::*;

use crate::{errors, pictures, work};

/// A film that is being written.
#[pyclass(frozen, module = "limpid._limpid")]
pub(crate) struct FilmFile {
    /// `None` once it is finished, or abandoned.
    film: Arc<Mutex<Option<Film>>>,
    /// The process whose film it is.
    process: u32,
}

impl Drop for FilmFile {
    fn drop(&mut self) {
        if !self.is_own() {
            // A forked child would remove the file of its parent.
            std::mem::forget(self.film.clone());
        }
    }
}

#[pymethods]
impl FilmFile {
    #[new]
    fn new(py: Python<'_>, path: PathBuf, width: u32, height: u32, fps: f64) -> PyResult<Self> {
        let create = move |_: &_| Film::create(&path, UVec2::new(width, height), fps);
        let film = work::run(py, create)?;
        Ok(Self { film: Arc::new(Mutex::new(Some(film))), process: std::process::id() })
    }

    /// Appends a picture.
    fn push(&self, py: Python<'_>, rgba: &Bound<'_, PyArray3<u8>>) -> PyResult<()> {
        let picture: RgbImage = pictures::rgb(rgba.try_readonly()?.as_array());
        let film = self.film.clone();
        work::run(py, move |_| {
            let mut film = film.lock().unwrap_or_else(PoisonError::into_inner);
            let closed = || limpid_io::Error::Usage("the film is closed".into());
            film.as_mut().ok_or_else(closed)?.push(&picture)
        })
    }

    /// Completes the file.
    fn finish(&self, py: Python<'_>) -> PyResult<()> {
        work::check_process()?;
        let film = py.detach(|| self.take());
        let film = film.ok_or_else(|| errors::error("the film is closed"))?;
        work::run(py, move |_| film.finish())
    }

    /// Removes the unfinished file.
    fn abandon(&self, py: Python<'_>) {
        if self.is_own() {
            py.detach(|| drop(self.take()));
        }
    }
}

impl FilmFile {
    fn is_own(&self) -> bool {
        self.process == std::process::id()
    }

    fn take(&self) -> Option<Film> {
        self.film.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}
