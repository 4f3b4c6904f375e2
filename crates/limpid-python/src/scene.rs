//! Scenes: the text of a scene file, and what it names in memory instead of files.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use glam::{DVec3, UVec2, Vec2};
use limpid::environment::Environment;
use limpid::mesh::{Material, MeshData, Texture};
use limpid::settings::Settings;
use limpid_io::camera_axes::CameraAxes;
use limpid_io::project::controls::table;
use limpid_io::project::{self, Given};
use numpy::{IntoPyArray as _, PyArray2, PyArray3, PyArrayMethods as _};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::camera::Camera;
use crate::colors::of_values;
use crate::{errors, work};

/// A scene with its source of particles, its camera and its settings.
#[pyclass(frozen, module = "limpid._limpid")]
pub(crate) struct Project {
    project: Mutex<project::Project>,
}

/// Name, vertices (v, 3), faces (f, 3), texture coordinates (v, 2).
type MeshArrays<'py> = (
    PathBuf,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<i64>>,
    Option<Bound<'py, PyArray2<f32>>>,
);

/// Name, and pixels of shape (height, width, 3) or (height, width, 4).
type Image<'py, T> = (PathBuf, Bound<'py, PyArray3<T>>);

#[pymethods]
impl Project {
    /// Parses the text of a scene file, whose paths are relative to `folder`. `labels` says for each line of the
    /// text what the user has given there. Meshes that `like` has are not read again.
    #[staticmethod]
    #[pyo3(signature = (text, labels, folder, meshes, environments, textures, like))]
    #[expect(clippy::too_many_arguments, reason = "the Python half passes what it has")]
    fn parse(
        py: Python<'_>,
        text: String,
        labels: Vec<String>,
        folder: PathBuf,
        meshes: Vec<MeshArrays<'_>>,
        environments: Vec<Image<'_, f32>>,
        textures: Vec<Image<'_, u8>>,
        like: Option<PyRef<'_, Self>>,
    ) -> PyResult<Self> {
        let given = Given {
            meshes: meshes.into_iter().map(mesh).collect::<PyResult<_>>()?,
            environments: environments.into_iter().map(environment).collect::<PyResult<_>>()?,
            textures: textures.into_iter().map(texture).collect::<PyResult<_>>()?,
            like: like.map(|like| Arc::new(like.locked().solid_files.clone())),
        };
        let parse = move |_: &_| project::Project::parse_given(&text, "Scene", &folder, given);
        let project = work::run(py, parse).map_err(|error| labelled(py, error, &labels))?;
        Ok(Self::of(project))
    }

    /// Reads a scene file.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Ok(Self::of(work::run(py, move |_| project::Project::load(&path))?))
    }

    /// Writes a scene file.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let mut project = self.project();
        // Those of the caller, which no file has.
        project.color_by = project.color_by.filter(|by| by.attribute != of_values());
        work::run(py, move |_| project.save(&path))
    }

    /// The text of a scene file that is read back as this scene.
    fn text(&self) -> PyResult<String> {
        self.project().to_toml(Some("environment")).map_err(errors::raise)
    }

    /// A copy.
    fn copy(&self) -> Self {
        Self::of(self.project())
    }

    /// Replaces values, each given as `pass.name=value`.
    fn set(&self, overrides: Vec<String>) -> PyResult<()> {
        let mut project = self.project();
        project.set(&overrides).and_then(|()| project.check()).map_err(errors::raise)?;
        *self.locked() = project;
        Ok(())
    }

    /// The tables of that text.
    fn table<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let table = self.text()?.parse().map_err(|e| errors::error(format!("the scene: {e}")))?;
        to_python(py, &toml::Value::Table(table))
    }

    /// Whether another scene has the same values.
    fn is_same(&self, other: PyRef<'_, Self>) -> bool {
        let other = other.project();
        self.project() == other
    }

    /// The names of all settings.
    #[staticmethod]
    fn names() -> Vec<String> {
        let passes = table(&Settings::default());
        let names = passes.iter().flat_map(|(pass, settings)| {
            let names = settings.as_table().into_iter().flat_map(toml::Table::keys);
            names.map(move |name| format!("{pass}.{name}"))
        });
        names.chain(["classify.on".to_owned()]).collect()
    }

    /// The value of a setting.
    fn get<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let project = self.project();
        if name == "classify.on" {
            return Ok(project.processor.to_string().into_pyobject(py)?.into_any());
        }
        let settings = table(&project.scene.settings);
        let value = name.split_once('.').and_then(|(pass, name)| settings.get(pass)?.get(name));
        match value {
            Some(value) => to_python(py, value),
            None => Err(PyKeyError::new_err(name.to_owned())),
        }
    }

    /// The aimed camera, if the scene has one.
    #[getter]
    fn camera(&self) -> Option<Camera> {
        self.locked().camera.map(|camera| Camera(crate::camera::Kind::Aimed(camera)))
    }

    /// Replaces the camera; `None` fits one to the particles.
    #[setter]
    fn set_camera(&self, camera: Option<PyRef<'_, Camera>>) -> PyResult<()> {
        let Some(camera) = camera else {
            self.locked().camera = None;
            return Ok(());
        };
        let problem = "a scene's camera is aimed; give one from matrices to render";
        let aimed = camera.camera().ok_or_else(|| PyValueError::new_err(problem))?;
        let mut project = self.locked();
        (project.camera, project.camera_axes) = (Some(aimed), CameraAxes::default());
        Ok(())
    }

    /// The pixels of the environment map, (height, width, 4), if the environment is one.
    fn environment_map<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f32>>>> {
        let Environment::Map { size, pixels } = self.locked().scene.environment.clone() else {
            return Ok(None);
        };
        let shape = [size.y as usize, size.x as usize, 4];
        Ok(Some(pixels.as_flattened().to_vec().into_pyarray(py).reshape(shape)?))
    }

    /// Contents of the scene's files that its pictures do not show.
    fn remarks(&self) -> Vec<String> {
        self.locked().solid_files.remarks.clone()
    }
}

impl Project {
    pub(crate) fn of(project: project::Project) -> Self {
        Self { project: Mutex::new(project) }
    }

    pub(crate) fn project(&self) -> project::Project {
        self.locked().clone()
    }

    fn locked(&self) -> MutexGuard<'_, project::Project> {
        self.project.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The error of a scene with what the user has given in place of the line of a text.
fn labelled(py: Python<'_>, error: PyErr, labels: &[String]) -> PyErr {
    let text = error.value(py).to_string();
    let cut = text.strip_prefix("Scene: line ").and_then(|rest| rest.split_once(": "));
    let Some((line, problem)) = cut else { return error };
    let label = line.parse::<usize>().ok().and_then(|line| labels.get(line.checked_sub(1)?));
    errors::scene_error(format!("{}: {problem}", label.map_or("Scene", String::as_str)))
}

fn to_python<'py>(py: Python<'py>, value: &toml::Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        toml::Value::Boolean(value) => value.into_pyobject(py)?.to_owned().into_any(),
        toml::Value::Integer(value) => value.into_pyobject(py)?.into_any(),
        toml::Value::Float(value) => value.into_pyobject(py)?.into_any(),
        toml::Value::String(value) => value.into_pyobject(py)?.into_any(),
        toml::Value::Array(values) => {
            let values: PyResult<Vec<_>> =
                values.iter().map(|value| to_python(py, value)).collect();
            values?.into_pyobject(py)?
        }
        toml::Value::Table(table) => {
            let found = PyDict::new(py);
            for (key, value) in table {
                found.set_item(key, to_python(py, value)?)?;
            }
            found.into_any()
        }
        other => other.to_string().into_pyobject(py)?.into_any(),
    })
}

fn mesh((name, vertices, faces, coordinates): MeshArrays<'_>) -> PyResult<(PathBuf, MeshData)> {
    let (vertices, faces) = (vertices.try_readonly()?, faces.try_readonly()?);
    let (vertices, faces) = (vertices.as_array(), faces.as_array());
    let count = vertices.nrows();
    let mut triangles = Vec::with_capacity(faces.nrows());
    for (i, face) in faces.outer_iter().enumerate() {
        let corners = [face[0], face[1], face[2]];
        let within = |corner: i64| u32::try_from(corner).ok().filter(|&c| (c as usize) < count);
        match corners.map(within) {
            [Some(a), Some(b), Some(c)] => triangles.push([a, b, c]),
            _ => {
                let problem = format!("faces: face {i} is {corners:?}, of {count} vertices");
                return Err(PyValueError::new_err(problem));
            }
        }
    }
    let coordinates = match coordinates {
        Some(array) => {
            let array = array.try_readonly()?;
            array.as_array().outer_iter().map(|row| Vec2::new(row[0], row[1])).collect()
        }
        None => Vec::new(),
    };
    let positions = vertices.outer_iter().map(|row| DVec3::new(row[0], row[1], row[2])).collect();
    let materials = vec![Material::default()];
    Ok((name, MeshData { positions, triangles, coordinates, materials, ..MeshData::default() }))
}

fn environment((name, pixels): Image<'_, f32>) -> PyResult<(PathBuf, Environment)> {
    let pixels = pixels.try_readonly()?;
    let pixels = pixels.as_array();
    let (height, width, _) = pixels.dim();
    let texels = pixels.outer_iter().flat_map(|row| {
        let texels: Vec<_> =
            row.outer_iter().map(|texel| [texel[0], texel[1], texel[2], 1.0]).collect();
        texels
    });
    let pixels: Arc<[[f32; 4]]> = texels.collect();
    if let Some(i) = pixels.iter().position(|texel| !texel.iter().all(|c| (0.0..=1e12).contains(c)))
    {
        let (x, y) = (i % width, i / width);
        let problem = format!(
            "environment: row {y}, column {x} has {:?}; expected radiances of 0 to 1e12",
            &pixels[i][..3]
        );
        return Err(PyValueError::new_err(problem));
    }
    Ok((name, Environment::Map { size: UVec2::new(width as u32, height as u32), pixels }))
}

fn texture((name, pixels): Image<'_, u8>) -> PyResult<(PathBuf, Arc<Texture>)> {
    let pixels = pixels.try_readonly()?;
    let pixels = pixels.as_array();
    let (height, width, channels) = pixels.dim();
    let alpha =
        |texel: &numpy::ndarray::ArrayView1<'_, u8>| if channels == 4 { texel[3] } else { 255 };
    let texels = pixels.outer_iter().flat_map(|row| {
        let texels: Vec<_> =
            row.outer_iter().map(|texel| [texel[0], texel[1], texel[2], alpha(&texel)]).collect();
        texels
    });
    let size = UVec2::new(width as u32, height as u32);
    let texture = Texture::new(size, texels.collect()).map_err(|e| errors::raise(e.into()))?;
    Ok((name, Arc::new(texture)))
}
