//! Rendering of a suite's entries.

use std::path::Path;

use image::RgbImage;
use tempfile::TempDir;

use super::suite::{Bake, Content, Entry};
use limpid::aov::Aov;
use limpid::camera::Camera;
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::look::Framing;
use limpid::motion::Motion;
use limpid::offscreen::Offscreen;
use limpid::scene::Scene;
use limpid_io::bake;
use limpid_io::camera_axes::GivenCamera;
use limpid_io::error::{Error, Result};
use limpid_io::frames::FrameSpec;
use limpid_io::input::{FrameTime, Input, Loaded, Loader};
use limpid_io::open::Request;
use limpid_io::output::CleanupGuard;
use limpid_io::project::Project;
use limpid_io::shared_classifier::SharedClassifier;

/// A temporary folder, removed when this is dropped or when [`limpid_io::output::abandon`] ends the
/// process.
struct Baked {
    // Drop order: the folder is removed first, then taken off the cleanup list.
    folder: TempDir,
    _litter: CleanupGuard,
}

/// An opened entry: its particles and its scene.
pub(super) struct OpenedEntry<'a> {
    entry: &'a Entry,
    input: Loader,
    pub(super) scene: Scene,
    /// The camera.
    pub(super) camera: Camera,
    // Keeps the folder of baked frames alive as long as they are read.
    _baked: Option<Baked>,
}

impl<'a> OpenedEntry<'a> {
    /// Opens the entry as `limpid render` would with the same options, baking its simulation first
    /// if requested.
    pub(super) fn open(entry: &'a Entry) -> Result<Self> {
        let samples = entry.samples.map(|samples| format!("refract.samples={samples}"));
        let request = Request {
            input: Some(entry.input.clone()),
            scene: entry.scene.clone(),
            radius: entry.radius,
            overrides: entry.set.iter().cloned().chain(samples).collect(),
            camera: entry.camera.map(GivenCamera::from),
            framing: Framing::of(entry.size),
            ..Request::default()
        };
        let (opened, baked) = match entry.bake {
            Some(bake) => {
                let (input, folder) = baked(&entry.input, bake)?;
                (request.open_from(input)?, Some(folder))
            }
            None => (request.open()?, None),
        };
        let camera = opened.project.camera_for(Default::default());
        let (input, scene) = (opened.loader, opened.project.scene);
        Ok(Self { entry, input, scene, camera, _baked: baked })
    }

    /// Moves the classification of its particles to this device.
    pub(super) fn classified_on(self, gpu: &Gpu) -> Self {
        Self { input: self.input.classified(SharedClassifier::on(gpu)), ..self }
    }

    /// The frame times to render, with the numbers of their pictures.
    pub(super) fn frame_times(&self) -> Result<Vec<(i64, FrameTime)>> {
        let sequence = &self.input.sequence;
        let at = match &self.entry.content {
            Content::Sequence { frames, .. } => {
                let numbers = frames.numbers(sequence, self.input.missing)?;
                let frame_times = numbers.iter().map(|&number| (number, FrameTime::at(number)));
                return Ok(frame_times.collect());
            }
            Content::Frame { at, .. } => *at,
        };
        let numbers: Vec<i64> = sequence.frames.iter().map(|frame| frame.number).collect();
        let fail = |problem| Error::Sequence { pattern: sequence.pattern.clone(), problem };
        let frame_time = match (at, self.input.frame, numbers.as_slice()) {
            // A missing frame is an error; it is neither interpolated nor replaced by the nearest
            // one.
            (Some(at), ..) if at.fract() == 0.0 => {
                let frame = at as i64;
                if numbers.binary_search(&frame).is_err() {
                    return Err(fail(format!(
                        "frame {frame} is not there; {}",
                        existing_frames(&numbers)
                    )));
                }
                FrameTime::at(frame)
            }
            (Some(at), ..) => {
                let frame_time = self.input.frame_time(&numbers, at)?;
                if frame_time.fraction == 0.0 {
                    return Err(fail(format!(
                        "time {at} is not between frames; {}",
                        existing_frames(&numbers)
                    )));
                }
                frame_time
            }
            (None, Some(frame), _) => FrameTime::at(frame),
            (None, None, &[frame]) => FrameTime::at(frame),
            (None, None, &[.., last]) if self.entry.bake.is_some() => FrameTime::at(last),
            (None, None, _) => {
                return Err(fail(format!("has {} frames; give frame or at", numbers.len())));
            }
        };
        Ok(vec![(frame_time.frame, frame_time)])
    }

    /// The frames out of `expected` that a sequence of all frames should have but the input lacks.
    pub(super) fn lost(&self, expected: &[i64]) -> Vec<i64> {
        match &self.entry.content {
            Content::Sequence { frames: FrameSpec::All, .. } => {
                let exists = |&number: &i64| self.input.sequence.frame(number).is_some();
                expected.iter().copied().filter(|number| !exists(number)).collect()
            }
            // An explicit list with a missing frame is an error, and one without it does not expect
            // it.
            _ => Vec::new(),
        }
    }

    /// Reads and classifies the particles at a frame time.
    pub(super) fn load(&self, frame_time: FrameTime) -> Result<Loaded> {
        self.input.load(frame_time, &self.scene)
    }

    /// Renders one frame, with its other images if they are chosen.
    pub(super) fn draw(
        &self,
        offscreen: &mut Offscreen,
        loaded: &Loaded,
        chosen: &[Aov],
    ) -> Result<RgbImage> {
        let scene = loaded.scene(&self.scene);
        let motion = Motion::default();
        let composed = chosen.iter().any(|aov| aov.is_for_compositing());
        let shot = offscreen.draw(FrameInput {
            diagnose: !chosen.is_empty(),
            surface: composed.then_some(&motion),
            ..loaded.picture(&scene, &self.camera, self.entry.size)
        })?;
        Ok(shot.picture)
    }
}

/// Describes the existing frames, as a part of a message.
fn existing_frames(numbers: &[i64]) -> String {
    match numbers {
        [] => "there are none".into(),
        [only] => format!("the only one is {only}"),
        [first, .., last] => format!("there are {} from {first} to {last}", numbers.len()),
    }
}

/// Bakes a scene into a new folder, so that frames of an older simulation are never used.
fn baked(scene_file: &Path, bake: Bake) -> Result<(Input, Baked)> {
    let mut project = Project::load(scene_file)?;
    let simulation = project.simulation_mut(&scene_file.display().to_string())?;
    simulation.radius = bake.radius.unwrap_or(simulation.radius);
    // The first frame is the initial state.
    simulation.frames = 1 + (bake.seconds * simulation.fps).round() as u32;
    let simulation = simulation.clone();
    let created = CleanupGuard::create(|| {
        let folder = tempfile::tempdir()?;
        let path = folder.path().to_owned();
        Ok((folder, path))
    });
    let created = created.map_err(|e| Error::io(&std::env::temp_dir(), "write", e))?;
    let baked = Baked { folder: created.0, _litter: created.1 };
    let origin = baked.folder.path().join("baked.toml");
    let folder = bake::folder(&origin);
    let solids = &project.scene.solids;
    let mut frames = bake::Bake::in_folder(&simulation, solids, "baked", &folder)?;
    while frames.step()?.is_some() {}
    let input = Input::from_project(project, &origin)?;
    Ok((input, baked))
}
