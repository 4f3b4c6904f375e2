//! The graphics device, and pictures that it draws.

use std::collections::VecDeque;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use glam::UVec2;
use limpid::aov::{Aov, Part};
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::liquid::Up;
use limpid::look::Framing;
use limpid::motion::Motion;
use limpid::offscreen::{Offscreen, PendingRadiance};
use limpid::scene::Scene;
use limpid::wgpu;
use limpid_cli::PipelineCache;
use limpid_io::adjustments::Adjustments;
use limpid_io::color_by::ColorScale;
use limpid_io::input::{FrameTime, Input, Loaded, Loader};
use limpid_io::notice;
use limpid_io::project::Project;
use limpid_io::shared_classifier::SharedClassifier;
use numpy::{IntoPyArray as _, PyArray3, PyArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::Arrays;
use crate::camera::Camera;
use crate::colors::{Colored, Coloring};
use crate::diffuse::DiffuseArrays;
use crate::frames::{self, Frames, Setting, Source, Staged};
use crate::images::{chosen, images, interleaved};
use crate::kept::{Cause, Kept};
use crate::numbers::short;
use crate::{colors, errors, pictures, scene, series, work};

/// Number of pictures of one thread whose radiance stays on the device.
const KEPT: usize = 4;

/// Time in which motion vectors move, s: a frame of a sequence of unknown rate, as in the program.
const SHUTTER: f32 = 1.0 / 30.0;

/// A device with its pipelines, for any number of threads: each that draws at a time has a renderer of its own.
#[pyclass(frozen, weakref, module = "limpid._limpid")]
pub(crate) struct Device {
    /// Part of the adapter's name; `None` for the best one.
    wanted: Option<String>,
    /// `None` after it was closed.
    state: Arc<Mutex<Option<Open>>>,
}

/// An open device.
struct Open {
    gpu: Gpu,
    cache: Option<PipelineCache>,
    classifier: SharedClassifier,
    /// Renderers that no thread uses.
    idle: Vec<Drawer>,
    /// Whether the device has failed, and the next picture opens it anew.
    lost: bool,
}

impl Open {
    fn new(wanted: Option<&str>) -> limpid_io::Result<Self> {
        let (gpu, cache) = match wanted {
            Some(wanted) => limpid_cli::open_adapter_named(wanted)?,
            None => limpid_cli::open_adapter()?,
        };
        let classifier = SharedClassifier::on(&gpu);
        Ok(Self { gpu, cache, classifier, idle: Vec::new(), lost: false })
    }
}

/// A renderer, with what its thread needs.
struct Drawer {
    offscreen: Offscreen,
    classifier: SharedClassifier,
    interrupt: Arc<AtomicBool>,
    /// Of the last pictures.
    radiances: VecDeque<Arc<Slot>>,
    kept: Option<Kept>,
}

/// The radiance of a picture on the device, while it is kept.
#[derive(Default)]
struct Slot(Mutex<Option<PendingRadiance>>);

impl Slot {
    fn locked(&self) -> MutexGuard<'_, Option<PendingRadiance>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        if work::must_leak() {
            std::mem::forget(self.locked().take());
        }
    }
}

/// The radiance of a picture.
#[pyclass(frozen, module = "limpid._limpid")]
pub(crate) struct Radiance(Arc<Slot>);

#[pymethods]
impl Radiance {
    /// Reads it as an array of shape (height, width, 3 or 4); `None` if it is not kept any more.
    fn read<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f32>>>> {
        let slot = self.0.clone();
        let read = move |_: &_| {
            let pending = slot.locked();
            Ok(pending.as_ref().map(PendingRadiance::read).transpose()?)
        };
        let Some(part) = work::run(py, read)? else { return Ok(None) };
        Ok(Some(interleaved(py, part.size, &part.channels)?))
    }
}

/// A picture to draw.
struct Job {
    source: Source,
    coloring: Option<Coloring>,
    /// Number of the frame, for solids that move.
    frame: i64,
    size: UVec2,
    aovs: Vec<Aov>,
    /// Cameras in the world of the particles, each of a picture, in place of the scene's.
    views: Vec<Camera>,
    described: bool,
}

/// A drawn picture.
struct Drawn {
    /// Time that classification and drawing took, s.
    seconds: f64,
    /// Of each view.
    rgba: Vec<u8>,
    radiance: Arc<Slot>,
    images: Vec<Part>,
    /// In the world of the particles.
    camera: Camera,
    project: Project,
    /// The axis that points up in the world of the particles.
    up: Up,
    radius: f32,
    /// The values that colours stand for.
    scale: Option<ColorScale>,
    particles: usize,
    splashes: usize,
    notices: Vec<String>,
}

#[pymethods]
impl Device {
    /// Opens the device of an adapter whose name contains `wanted`, or the best one.
    #[new]
    fn new(py: Python<'_>, wanted: Option<String>) -> PyResult<Self> {
        let name = wanted.clone();
        let open = work::run(py, move |_| Open::new(name.as_deref()))?;
        Ok(Self { wanted, state: Arc::new(Mutex::new(Some(open))) })
    }

    /// The adapter's name.
    #[getter]
    fn adapter(&self, py: Python<'_>) -> PyResult<String> {
        work::check_process()?;
        py.detach(|| locked(&self.state).as_ref().map(|open| open.gpu.adapter())).ok_or_else(closed)
    }

    /// Closes the device, and keeps its compiled pipelines for later processes. Pictures keep what they need.
    fn close(&self, py: Python<'_>) {
        if work::must_leak() {
            return;
        }
        py.detach(|| {
            let open = locked(&self.state).take();
            if let Some(open) = open {
                open.cache.iter().for_each(PipelineCache::save);
                open.classifier.close();
            }
        });
    }

    /// Draws particles.
    #[pyo3(signature = (arrays, coloring, project, camera, up, radius, frame, size, samples, aovs, alpha, views, diffuse, described, tick))]
    #[expect(clippy::too_many_arguments, reason = "the Python half passes what it was given")]
    fn draw<'py>(
        &self,
        py: Python<'py>,
        arrays: Arrays<'py>,
        coloring: colors::Arguments<'py>,
        project: Option<PyRef<'py, scene::Project>>,
        camera: Option<PyRef<'py, Camera>>,
        up: Option<&str>,
        radius: Option<f32>,
        frame: i64,
        size: (u32, u32),
        samples: Option<u32>,
        aovs: Vec<String>,
        alpha: bool,
        views: Vec<PyRef<'py, Camera>>,
        diffuse: Option<DiffuseArrays<'py>>,
        described: bool,
        tick: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let chosen = chosen(&aovs)?;
        let coloring = coloring.coloring()?;
        let is_of_values = coloring.as_ref().is_some_and(Coloring::is_of_values);
        let setting = Setting {
            colors: Adjustments {
                color_by: is_of_values.then(colors::of_values),
                ..Adjustments::default()
            },
            takes_values: is_of_values,
            diffuse: diffuse.map(|arrays| arrays.given()).transpose()?,
            project: project.map(|project| project.project()),
            camera: camera.map(|camera| *camera),
            up: frames::up(up)?,
            radius,
            samples,
            framing: Framing::of(size.into()),
            alpha,
            motion: chosen.contains(&Aov::Motion),
            in_metres: true,
        };
        let source = Source::Particles(Arc::new(arrays.particles()?), Box::new(setting));
        let size = UVec2::new(size.0, size.1);
        let views = views.iter().map(|camera| **camera).collect();
        let job = Job { source, coloring, frame, size, aovs: chosen, views, described };
        self.draw_job(py, job, &aovs, tick.as_ref())
    }

    /// Draws a frame of files, from another camera if one is given.
    #[pyo3(signature = (frames, index, camera, size, aovs, described, tick))]
    #[expect(clippy::too_many_arguments, reason = "the Python half passes what it was given")]
    fn draw_frame<'py>(
        &self,
        py: Python<'py>,
        frames: PyRef<'py, Frames>,
        index: usize,
        camera: Option<PyRef<'py, Camera>>,
        size: (u32, u32),
        aovs: Vec<String>,
        described: bool,
        tick: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let job = Job {
            source: Source::Frame(frames.staged.clone(), camera.map(|camera| Box::new(*camera))),
            coloring: None,
            frame: frames.numbers[index],
            size: UVec2::new(size.0, size.1),
            aovs: chosen(&aovs)?,
            views: Vec::new(),
            described,
        };
        self.draw_job(py, job, &aovs, tick.as_ref())
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        if work::must_leak() {
            // The lock may be another thread's for ever.
            std::mem::forget(self.state.clone());
        }
    }
}

impl Device {
    fn draw_job<'py>(
        &self,
        py: Python<'py>,
        job: Job,
        aovs: &[String],
        tick: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        work::check_process()?;
        let idle = py.detach(|| locked(&self.state).as_mut().map(|open| open.idle.pop()));
        let idle = idle.ok_or_else(closed)?;
        let interrupt = idle.as_ref().map_or_else(Arc::default, |drawer| drawer.interrupt.clone());
        let (state, wanted) = (self.state.clone(), self.wanted.clone());
        let (size, views) = (job.size, job.views.len());
        let drawn = work::run_interruptible(py, interrupt, tick, move |interrupt| {
            let mut drawer = match idle {
                Some(drawer) => drawer,
                None => new_drawer(&state, wanted.as_deref(), interrupt)?,
            };
            let drawn = drawer.draw(job);
            // Before another thread takes the renderer. Otherwise the device may still draw.
            if !work::end_unless_interrupted(interrupt) {
                return drawn;
            }
            let mut state = locked(&state);
            let Some(open) = state.as_mut() else { return drawn };
            match &drawn {
                Err(limpid_io::Error::Render(
                    limpid::Error::DeviceLost(_) | limpid::Error::Defect(_),
                )) => {
                    open.lost = true;
                    open.idle.clear();
                }
                _ if !open.lost => open.idle.push(drawer),
                _ => {}
            }
            drawn
        })?;
        to_python(py, drawn, (views, size), aovs)
    }
}

/// A renderer for one more thread; opens the device anew if it has failed.
fn new_drawer(
    state: &Mutex<Option<Open>>,
    wanted: Option<&str>,
    interrupt: &Arc<AtomicBool>,
) -> limpid_io::Result<Drawer> {
    let (gpu, classifier) = {
        let mut state = locked(state);
        let closed = || limpid_io::Error::Usage("the renderer was closed".into());
        let open = state.as_mut().ok_or_else(closed)?;
        if open.lost {
            *open = Open::new(wanted)?;
        }
        (open.gpu.clone(), open.classifier.clone())
    };
    let gpu = gpu.with_interrupt(interrupt.clone());
    let offscreen = Offscreen::new(&gpu);
    let (interrupt, radiances) = (interrupt.clone(), VecDeque::new());
    Ok(Drawer { offscreen, classifier, interrupt, radiances, kept: None })
}

impl Drawer {
    fn draw(&mut self, job: Job) -> limpid_io::Result<Drawn> {
        let Job { source, coloring, frame, size, aovs, views, described } = job;
        let owned: Staged;
        let shared: Arc<Staged>;
        let mut colored = Colored::default();
        // The camera that was given for a frame of files.
        let mut aimed = None;
        // With the particles whose thickness the tints are for.
        let mut tinted = None;
        // The scene that was given.
        let mut given = None;
        let (mut cause, mut bare) = (None, None);
        let staged = match source {
            Source::Frame(staged, camera) => {
                shared = staged;
                aimed = camera.map(|camera| *camera);
                &*shared
            }
            Source::Particles(mut particles, setting) => {
                if let Some(coloring) = coloring {
                    let project = setting.project.as_ref();
                    colored = coloring.apply(Arc::make_mut(&mut particles), project);
                    tinted = colored.tints.take().map(|tints| (particles.clone(), tints));
                }
                given = Some(setting.project.clone());
                let by = colored.by.clone();
                bare = Some(particles.clone());
                cause = Some(Cause::new(particles.clone(), frame, &setting, by));
                owned = setting.stage(Input::from_particles(particles, "positions"))?;
                &owned
            }
        };
        let Staged { opened, .. } = staged;
        let up = opened.loader.up().0;
        let own_camera = aimed.unwrap_or(staged.own_camera);
        let camera = aimed.map_or(staged.camera, |aimed| aimed.to_y_up(up));
        let mut scene = opened.project.scene.clone();
        let mut project = opened.plain.clone();
        if let Some((particles, tints)) = tinted {
            let thickness = series::tint_thickness(&mut project, &opened.loader, &particles)?;
            let absorption = |tint: &_| colors::absorption(*tint, thickness);
            scene.fluids = tints.iter().map(absorption).map(limpid::scene::Medium::clear).collect();
        }
        let mut loader = opened.loader.clone().classified(self.classifier.clone());
        let Colored { by, scale, .. } = colored;
        let is_given = by.is_some();
        if is_given {
            loader = loader.colored_by(by);
        }
        let started = Instant::now();
        let cause = cause.map(|cause| cause.in_project(&project, &scene, up));
        let loaded = self.loaded(&loader, frame, &scene, cause)?;
        self.check()?;
        let scale = if is_given { scale } else { loader.color_scale()? };
        if let Some(scale) = &scale {
            series::keep_scale(&mut project, scale);
        }
        if let Some(given) = given.filter(|_| loaded.particles == 0) {
            project = series::unmeasured(given);
        }
        let interface =
            |aov: &Aov| aov.is_for_compositing() || matches!(aov, Aov::Depth | Aov::Normal);
        let motion =
            Motion { velocities: loaded.velocities.clone(), seconds: SHUTTER, previous: None };
        let of_loaded = loaded.scene(&scene);
        let frame_input = FrameInput {
            surface: aovs.iter().any(interface).then_some(&motion),
            diagnose: !aovs.is_empty(),
            reuse: true,
            ..loaded.picture(&of_loaded, camera.view(), size)
        };
        let lying = || series::lying(&loader, bare.as_ref()?, loaded.splats.radius);
        let standing = match described {
            true => None,
            false => lying().or_else(|| series::standing(&loader)),
        };
        let describe = |own: &Self| {
            let notices = own.notices(&loaded, &scene, (&camera, size), described);
            standing.into_iter().map(str::to_owned).chain(notices).collect()
        };
        let (rgba, images, radiance, notices);
        if views.is_empty() {
            let drawing = self.offscreen.begin(frame_input)?;
            images = if aovs.is_empty() { Vec::new() } else { self.offscreen.images(&aovs)? };
            notices = describe(self);
            radiance = self.keep_radiance();
            rgba = drawing.wait_rgba()?.into_raw();
        } else {
            rgba = self.rgba_of_views(frame_input, &views, up)?;
            images = Vec::new();
            notices = describe(self);
            radiance = self.keep_radiance();
        }
        Ok(Drawn {
            seconds: started.elapsed().as_secs_f64(),
            rgba,
            radiance,
            images,
            camera: own_camera,
            project,
            up,
            radius: loaded.splats.radius,
            scale,
            particles: loaded.particles,
            splashes: loaded.splats.splashes.len(),
            notices,
        })
    }

    /// Loads a frame, or takes the last one if it is the same.
    fn loaded(
        &mut self,
        loader: &Loader,
        frame: i64,
        scene: &Scene,
        cause: Option<Cause>,
    ) -> limpid_io::Result<Arc<Loaded>> {
        if let Some((kept, loaded)) = &self.kept
            && cause.as_ref() == Some(kept)
        {
            return Ok(loaded.clone());
        }
        self.kept = None;
        let loaded = Arc::new(loader.load(FrameTime::at(frame), scene)?);
        self.kept = cause.map(|cause| (cause, loaded.clone()));
        Ok(loaded)
    }

    /// The pixels of all views, one after the other.
    fn rgba_of_views(
        &mut self,
        input: FrameInput<'_>,
        views: &[Camera],
        up: Up,
    ) -> limpid_io::Result<Vec<u8>> {
        let views: Vec<_> = views.iter().map(|camera| camera.to_y_up(up).view()).collect();
        let pictures = self.offscreen.draw_views(input, &views)?;
        Ok(pictures.into_iter().flat_map(image::RgbaImage::into_raw).collect())
    }

    /// Fails if the work was interrupted.
    fn check(&self) -> limpid_io::Result<()> {
        Ok(self.offscreen.gpu().check()?)
    }

    /// Leaves the radiance of the last frame on the device, for a few frames.
    fn keep_radiance(&mut self) -> Arc<Slot> {
        let unused = self.radiances.iter().position(|slot| Arc::strong_count(slot) == 1);
        let full = (self.radiances.len() >= KEPT).then_some(0);
        let old = unused.or(full).and_then(|i| self.radiances.remove(i));
        let spare: Option<wgpu::Texture> =
            old.and_then(|slot| Some(slot.locked().take()?.into_spare()));
        let slot = Arc::new(Slot(Mutex::new(Some(self.offscreen.take_radiance(spare)))));
        self.radiances.push_back(slot.clone());
        slot
    }

    /// Lists likely mistakes in a picture; if one like it was `described`, only those in its view.
    fn notices(
        &self,
        loaded: &Loaded,
        scene: &Scene,
        (camera, size): (&Camera, UVec2),
        described: bool,
    ) -> Vec<String> {
        let mut notices = Vec::new();
        if !described {
            notices.extend(notice::of_frame(loaded, scene));
            notices.extend(notice::of_scene(scene));
            let straight = self.offscreen.renderer.lights_without_caustics();
            notices.extend((!straight.is_empty()).then_some(notice::Notice::Straight(straight)));
        }
        if let Some(camera) = camera.camera() {
            notices.extend(notice::of_view(loaded, &camera, size, loaded.up.0));
        }
        notices.iter().map(errors::describe).collect()
    }
}

fn locked(state: &Mutex<Option<Open>>) -> MutexGuard<'_, Option<Open>> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

fn closed() -> PyErr {
    errors::error("the renderer was closed")
}

fn to_python<'py>(
    py: Python<'py>,
    drawn: Drawn,
    (views, size): (usize, UVec2),
    aovs: &[String],
) -> PyResult<Bound<'py, PyDict>> {
    let result = PyDict::new(py);
    let (rgba, shape) = (drawn.rgba.into_pyarray(py), [size.y as usize, size.x as usize, 4]);
    match views {
        0 => result.set_item("rgba", rgba.reshape(shape)?)?,
        _ => result.set_item("rgba", rgba.reshape([views, shape[0], shape[1], shape[2]])?)?,
    }
    result.set_item("radiance", Radiance(drawn.radiance))?;
    result.set_item("aov", images(py, drawn.images, aovs)?)?;
    result.set_item("camera", drawn.camera)?;
    result.set_item("project", scene::Project::of(drawn.project))?;
    result.set_item("up", drawn.up.to_string())?;
    result.set_item("radius", short(drawn.radius))?;
    result.set_item("scale", drawn.scale.map(pictures::Scale::from))?;
    result.set_item("particles", drawn.particles)?;
    result.set_item("splashes", drawn.splashes)?;
    result.set_item("seconds", drawn.seconds)?;
    result.set_item("notices", drawn.notices)?;
    Ok(result)
}
