//! Particles in the scene that they are drawn in, and the frames of files.

use std::path::PathBuf;
use std::sync::Arc;

use limpid::liquid::{Particles, Up};
use limpid::look::Framing;
use limpid_io::adjustments::Adjustments;
use limpid_io::camera_axes::CameraAxes;
use limpid_io::color_by::{Attribute, ColorBy, ColorRange, Values};
use limpid_io::input::{FrameTime, Input, Loader};
use limpid_io::open::{Opened, Request};
use limpid_io::particles::ReadOptions;
use limpid_io::project::{LiquidSource, Project};
use numpy::IntoPyArray as _;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::camera::{Camera, Kind};
use crate::diffuse::Given;
use crate::series::unmeasured;
use crate::{arrays, colors, errors, scene, work};

/// Properties that decide how particles are drawn, apart from the picture.
#[derive(Clone, Default)]
pub(crate) struct Setting {
    pub(crate) project: Option<Project>,
    /// In the world of the particles.
    pub(crate) camera: Option<Camera>,
    /// The axis that points up in the particles' world.
    pub(crate) up: Option<Up>,
    /// Particle radius, m.
    pub(crate) radius: Option<f32>,
    /// Rays per pixel.
    pub(crate) samples: Option<u32>,
    /// The pictures that a fitted camera is for.
    pub(crate) framing: Framing,
    pub(crate) alpha: bool,
    pub(crate) motion: bool,
    /// Whether the particles are in metres, whatever the unit of the scene's files.
    pub(crate) in_metres: bool,
    /// The attribute that colours the particles, which needs an opaque liquid, and its map and range.
    pub(crate) colors: Adjustments,
    /// Foam, spray, bubbles and dust.
    pub(crate) diffuse: Option<Given>,
    /// Whether that attribute is an array of the caller's, of which the scene knows nothing.
    pub(crate) takes_values: bool,
}

/// Particles in their scene.
pub(crate) struct Staged {
    pub(crate) opened: Opened,
    /// The camera in the world of the scene.
    pub(crate) camera: Camera,
    /// The camera in the world of the particles, which is another one if z points up there.
    pub(crate) own_camera: Camera,
}

impl Setting {
    /// Puts particles into the scene, which is completed where it lacks something.
    ///
    /// # Errors
    /// As [`Request::open_from`].
    pub(crate) fn stage(&self, mut input: Input) -> limpid_io::Result<Staged> {
        // Values have another look than other particles without a scene.
        let says_nothing = |own: &&Project| self.takes_values && **own == unmeasured(None);
        let given = self.project.as_ref().filter(|own| !says_nothing(own));
        let is_alike = |project: Option<&Project>| project.is_none_or(|own| !own.has_directions());
        let is_bare = is_alike(given) && is_alike(input.project.as_ref());
        let aimed = self.camera.and_then(|camera| camera.camera());
        if let Some(mut project) = given.cloned() {
            // Those of an earlier picture.
            project.color_by = project.color_by.filter(|by| by.attribute != colors::of_values());
            // A complete scene is not measured, which takes time; the camera is replaced below.
            let placeholder = || {
                self.camera
                    .map(|_| limpid::camera::Camera::fit(-glam::DVec3::ONE, glam::DVec3::ONE))
            };
            if self.in_metres {
                project.source.files_mut().iter_mut().for_each(|files| files.scale = None);
            }
            if let Some(camera) = aimed.or_else(placeholder) {
                (project.camera, project.camera_axes) = (Some(camera), CameraAxes::default());
            }
            input = input.with_project(project);
        }
        let up = self.up.or_else(|| self.camera.filter(|_| is_bare)?.likely_up());
        let mut overrides = Vec::from_iter(self.samples.map(|n| format!("refract.samples={n}")));
        overrides.extend(self.alpha.then(|| "refract.transparent=true".to_owned()));
        let mut adjustments = Adjustments { up, ..self.colors.clone() };
        let shown = input.project.as_ref().and_then(|project| project.color_by.as_ref());
        if shown.is_none() && adjustments.color_by.is_none() {
            // As without values in arrays.
            adjustments.color_range =
                adjustments.color_range.filter(|range| *range != ColorRange::Auto);
        }
        let request = Request {
            radius: self.radius,
            overrides,
            adjustments,
            framing: self.framing,
            ..Request::default()
        };
        let mut opened = request.open_from(input)?;
        if self.takes_values {
            let own = self.project.as_ref().and_then(|project| project.color_by.clone());
            opened.plain.color_by.clone_from(&own);
            opened.project.color_by = own;
        }
        let up = opened.loader.up().0;
        let camera = match self.camera {
            Some(camera) => camera.to_y_up(up),
            None => Camera(Kind::Aimed(opened.project.camera_for(Default::default()))),
        };
        let own_camera = self.camera.unwrap_or_else(|| camera.y_up_to(up));
        (opened.plain.camera, opened.project.camera) = (camera.camera(), camera.camera());
        opened.plain.source = match opened.loader.source() {
            // With the radius that was found.
            source @ LiquidSource::File(_) => source,
            _ => opened.plain.source,
        };
        opened.loader.with_velocities = self.motion;
        if let Some(given) = &self.diffuse {
            let mut diffuse = given.diffuse.clone();
            diffuse.to_y_up(up);
            if !given.has_radii {
                // As of files without radii.
                let source = opened.loader.source();
                let radius = source.files().first().and_then(|files| files.radius).unwrap_or(0.01);
                diffuse.radii.fill(0.2 * radius);
            }
            opened.loader = opened.loader.with_diffuse(Arc::new(diffuse));
        }
        Ok(Staged { opened, camera, own_camera })
    }
}

/// Parses the name of an axis.
pub(crate) fn up(name: Option<&str>) -> PyResult<Option<Up>> {
    match name {
        None => Ok(None),
        Some("y") => Ok(Some(Up::Y)),
        Some("z") => Ok(Some(Up::Z)),
        Some(other) => {
            let problem = format!("up is {other:?}; expected \"y\" or \"z\"");
            Err(PyValueError::new_err(problem))
        }
    }
}

/// The properties that decide how files are drawn.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Opening<'py> {
    project: Option<PyRef<'py, scene::Project>>,
    camera: Option<PyRef<'py, Camera>>,
    up: Option<String>,
    radius: Option<f32>,
    samples: Option<u32>,
    size: (u32, u32),
    alpha: bool,
    motion: bool,
    values: Option<String>,
    colormap: Option<String>,
    range: Option<(f32, f32)>,
    /// Whether the range is that of the values, whatever the scene has.
    automatic: bool,
}

/// The frames of particle files, in a scene that is the same for all.
#[pyclass(frozen, module = "limpid._limpid")]
pub(crate) struct Frames {
    pub(crate) staged: Arc<Staged>,
    pub(crate) numbers: Vec<i64>,
}

#[pymethods]
impl Frames {
    /// Opens a file, a pattern, a folder or a scene file.
    #[staticmethod]
    fn open(py: Python<'_>, source: PathBuf, opening: Opening<'_>) -> PyResult<Self> {
        let color_range = match opening.range {
            Some((low, high)) => Some(ColorRange::Of([low, high])),
            None => opening.automatic.then_some(ColorRange::Auto),
        };
        let setting = Setting {
            project: opening.project.map(|project| project.project()),
            camera: opening.camera.map(|camera| *camera),
            up: up(opening.up.as_deref())?,
            radius: opening.radius,
            samples: opening.samples,
            framing: Framing::of(opening.size.into()),
            alpha: opening.alpha,
            motion: opening.motion,
            colors: Adjustments {
                color_by: opening.values.as_deref().map(Attribute::from),
                colormap: opening.colormap.as_deref().map(colors::map_named).transpose()?,
                color_range,
                ..Adjustments::default()
            },
            ..Setting::default()
        };
        let staged = work::run(py, move |_| setting.stage(Input::open(&source)?))?;
        let numbers = numbers(&staged.opened.loader);
        Ok(Self { staged: Arc::new(staged), numbers })
    }

    /// The numbers of the frames.
    #[getter]
    fn numbers(&self) -> Vec<i64> {
        self.numbers.clone()
    }

    fn __len__(&self) -> usize {
        self.numbers.len()
    }

    /// Frames per second, if the scene or the files have them.
    #[getter]
    fn fps(&self) -> Option<f64> {
        self.staged.opened.loader.fps()
    }
}

/// The frames that a user sees: all, or the one that the scene selects.
fn numbers(loader: &Loader) -> Vec<i64> {
    let all = || loader.sequence.frames.iter().map(|frame| frame.number).collect();
    loader.frame.map_or_else(all, |frame| vec![frame])
}

/// The particles of files, read frame by frame.
#[pyclass(frozen, module = "limpid._limpid")]
pub(crate) struct Series {
    loader: Loader,
    values: Option<Attribute>,
    /// The axis that points up, and the length of the unit, if the files tell neither.
    up: Up,
    scale: f64,
    /// The numbers of the frames.
    #[pyo3(get)]
    numbers: Vec<i64>,
    /// The radius that a scene gives, m.
    #[pyo3(get)]
    radius: Option<f64>,
}

#[pymethods]
impl Series {
    /// Opens a file, a pattern, a folder or a scene file.
    #[staticmethod]
    #[pyo3(signature = (source, map, select, skip_invalid, up, scale, values))]
    #[expect(clippy::too_many_arguments, reason = "the Python half passes what it was given")]
    fn open(
        py: Python<'_>,
        source: PathBuf,
        map: Option<String>,
        select: Option<String>,
        skip_invalid: bool,
        up: Option<&str>,
        scale: Option<f64>,
        values: Option<&str>,
    ) -> PyResult<Self> {
        let up = self::up(up)?;
        let values = values.map(Attribute::from);
        let shown = values.clone();
        let input = work::run(py, move |_| {
            let options = ReadOptions {
                map: map.map(|text| text.parse()).transpose()?.unwrap_or_default(),
                select: select.map(|text| text.parse()).transpose()?.unwrap_or_default(),
                skip_invalid,
                ..ReadOptions::default()
            };
            let mut input = Input::open(&source)?.with_options(&options);
            if let Some(shown) = shown {
                input.loader = input.loader.colored_by(Some(ColorBy::new(shown)));
            }
            Ok(input)
        })?;
        let radius = input.project.as_ref().and_then(|project| {
            let of_files = project.source.files().first().and_then(|files| files.radius);
            let simulated = || Some(project.source.simulation()?.particle_radius());
            of_files.map(f64::from).or_else(simulated)
        });
        if input.project.is_some() && (up.is_some() || scale.is_some()) {
            let problem = "up and scale are those of the scene file; give neither";
            return Err(PyValueError::new_err(problem));
        }
        let (up, scale) = (up.unwrap_or_default(), scale.unwrap_or(1.0));
        let numbers = numbers(&input.loader);
        Ok(Self { loader: input.loader, values, up, scale, numbers, radius })
    }

    /// Frames per second, if the scene or the files have them.
    #[getter]
    fn fps(&self) -> Option<f64> {
        self.loader.fps()
    }

    /// The arrays of a frame by name, y up and in metres, and what was left out or understood in a way of its own.
    fn read<'py>(
        &self,
        py: Python<'py>,
        index: usize,
    ) -> PyResult<(Bound<'py, PyDict>, Vec<String>)> {
        let (loader, number) = (self.loader.clone(), self.numbers[index]);
        let mut contents = work::run(py, move |_| loader.contents(FrameTime::at(number)))?;
        contents.particles.to_y_up(self.up);
        contents.particles.scale(self.scale);
        let shown = match &self.values {
            Some(attribute) => Some(
                attribute
                    .values(&contents.particles)
                    .ok_or_else(|| errors::error(format!("frame {number} has no {attribute}")))?,
            ),
            None => None,
        };
        let remarks = contents.remarks.iter().map(ToString::to_string).collect();
        let arrays = arrays::to_arrays(py, contents.particles)?;
        match shown {
            Some(Values::Colors(colors)) => {
                arrays.set_item("colors", arrays::vectors(py, colors)?)?;
            }
            Some(values) => {
                let values = values.scalars().unwrap_or_default();
                arrays.set_item("values", values.into_pyarray(py))?;
            }
            None => {}
        }
        Ok((arrays, remarks))
    }
}

/// Source of a picture: particles, or a frame of files.
pub(crate) enum Source {
    Particles(Arc<Particles>, Box<Setting>),
    /// From this camera, in the world of the particles, instead of the scene's.
    Frame(Arc<Staged>, Option<Box<Camera>>),
}
