//! Errors as Python exceptions, and notices as texts, with remedies in terms of this package.

use std::io;

use limpid::error::Limited;
use limpid_io::Error;
use limpid_io::notice::Notice;
use pyo3::exceptions::{PyFileNotFoundError, PyMemoryError, PyOSError, PyValueError};
use pyo3::prelude::*;

/// The exceptions of `python/limpid/_errors.py`.
mod python {
    pyo3::import_exception!(limpid._errors, Error);
    pyo3::import_exception!(limpid._errors, SceneError);
    pyo3::import_exception!(limpid._errors, FileError);
    pyo3::import_exception!(limpid._errors, NoAdapter);
    pyo3::import_exception!(limpid._errors, DeviceLost);
}

/// A `limpid.Error`.
pub(crate) fn error(problem: impl Into<String>) -> PyErr {
    python::Error::new_err(problem.into())
}

/// The exception for work that has panicked; standard error has the details.
pub(crate) fn panicked() -> PyErr {
    error("this is a bug in limpid, whose details are on standard error; please report it")
}

/// The exception for an error, with its remedy.
pub(crate) fn raise(error: Error) -> PyErr {
    let text = error.to_string();
    match error {
        Error::Io { path, source, .. } => match source.raw_os_error() {
            // Python chooses the class by the number.
            Some(number) => {
                let reason = source.to_string();
                let reason = reason.split(" (os error").next().unwrap_or(&reason).to_owned();
                PyOSError::new_err((number, reason, path.display().to_string()))
            }
            None if source.kind() == io::ErrorKind::NotFound => PyFileNotFoundError::new_err(text),
            None => PyOSError::new_err(text),
        },
        Error::Sequence { .. } => PyFileNotFoundError::new_err(text),
        Error::Malformed { .. }
        | Error::Unplaced { .. }
        | Error::TooLarge { .. }
        | Error::Format { .. }
        | Error::MissingFrame { .. }
        | Error::MissingFrames { .. }
        | Error::OtherBake { .. }
        | Error::UnknownBake { .. } => python::FileError::new_err(text),
        Error::NotBaked { .. } => {
            python::FileError::new_err(format!("{text}; limpid.bake simulates its frames"))
        }
        Error::Scene { .. } | Error::Override { .. } => python::SceneError::new_err(text),
        Error::UnknownRadius { .. } => PyValueError::new_err(format!("{text}; give radius")),
        Error::Mismatch(_) | Error::Usage(_) => PyValueError::new_err(text),
        Error::Frame { frame, source } => {
            let inner = raise(*source);
            Python::attach(|py| {
                // The class of the cause, and the frame in its text.
                let _ = inner.value(py).call_method1("add_note", (format!("in frame {frame}"),));
            });
            inner
        }
        Error::Render(error) => raise_render(&error),
        _ => python::Error::new_err(text),
    }
}

fn raise_render(error: &limpid::Error) -> PyErr {
    let text = error.to_string();
    match error {
        limpid::Error::Invalid { .. } => python::SceneError::new_err(text),
        limpid::Error::Empty { .. } => PyValueError::new_err(text),
        limpid::Error::NoAdapter => python::NoAdapter::new_err(format!(
            "{text}; install a Vulkan driver, or Mesa's software one (Debian, Ubuntu: apt-get install \
             mesa-vulkan-drivers)"
        )),
        limpid::Error::NoMatchingAdapter { .. } | limpid::Error::Refused { .. } => {
            python::NoAdapter::new_err(text)
        }
        limpid::Error::DeviceLost(_) => python::DeviceLost::new_err(text),
        limpid::Error::Memory { .. } => PyMemoryError::new_err(text),
        limpid::Error::Limit { of: Limited::Classify, .. } => {
            python::Error::new_err(format!("{text}: scene.settings[\"classify.on\"] = \"cpu\""))
        }
        _ => python::Error::new_err(text),
    }
}

/// The text of a notice, with its remedy.
pub(crate) fn describe(notice: &Notice) -> String {
    let remedy = match notice {
        Notice::Crowded(_) | Notice::Scattered(_) => {
            "if the places are not in metres, multiply them by the unit's length; if the radius is wrong, give radius"
        }
        Notice::Opaque(_) => {
            "if these are millimetres, multiply the positions by 0.001, or choose a smaller absorption"
        }
        Notice::Unseen { .. } | Notice::Outside(..) => {
            "move the camera, or give none: it is made to fit"
        }
        _ => return notice.to_string(),
    };
    format!("{notice}; {remedy}")
}

/// A `limpid.SceneError`.
pub(crate) fn scene_error(problem: String) -> PyErr {
    python::SceneError::new_err(problem)
}
