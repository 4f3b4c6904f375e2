//! From an entry to pictures.

use std::ops::ControlFlow;
use std::path::Path;

use image::RgbImage;
use tempfile::TempDir;

use super::suite::{Bake, Content, Entry};
use limpid::camera::Camera;
use limpid::gpu::Gpu;
use limpid::offscreen::Offscreen;
use limpid::scene::Scene;
use limpid_io::bake;
use limpid_io::error::{Error, Result};
use limpid_io::frames::FrameSpec;
use limpid_io::input::{FrameTime, Input, Loaded};
use limpid_io::output::CleanupGuard;
use limpid_io::project::Project;
use limpid_io::project::open::Request;
use limpid_io::shared_classifier::SharedClassifier;

/// A folder that is gone when this is dropped or the process is ended by [`limpid_io::output::abandon`].
struct Baked {
    // In this order: removed, then forgotten.
    folder: TempDir,
    _litter: CleanupGuard,
}

/// An entry's particles and scene, opened.
pub(super) struct Source<'a> {
    entry: &'a Entry,
    input: Input,
    pub(super) scene: Scene,
    /// Where it is seen from.
    pub(super) camera: Camera,
    // Where the frames of a bake are, as long as they are needed.
    _baked: Option<Baked>,
}

impl<'a> Source<'a> {
    /// Opens what `limpid render` would with the same options; simulates it first if wanted.
    pub(super) fn open(entry: &'a Entry) -> Result<Self> {
        let samples = entry.samples.map(|samples| format!("refract.samples={samples}"));
        let request = Request {
            input: Some(entry.input.clone()),
            scene: entry.scene.clone(),
            radius: entry.radius,
            overrides: entry.set.iter().cloned().chain(samples).collect(),
            camera: entry.camera,
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
        let (input, scene) = (opened.input, opened.project.scene);
        Ok(Self { entry, input, scene, camera, _baked: baked })
    }

    /// The same, with its particles classified on this device.
    pub(super) fn classified_on(self, gpu: &Gpu) -> Self {
        Self { input: self.input.classified(SharedClassifier::on(gpu)), ..self }
    }

    /// The frame times to draw, with the numbers of their pictures.
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
        let moment = match (at, self.input.frame, numbers.as_slice()) {
            // A frame that is not there is an error, not its neighbours and not the nearest one.
            (Some(at), ..) if at.fract() == 0.0 => {
                let frame = at as i64;
                if numbers.binary_search(&frame).is_err() {
                    return Err(fail(format!("frame {frame} is not there; {}", has(&numbers))));
                }
                FrameTime::at(frame)
            }
            (Some(at), ..) => {
                let moment = self.input.moment(&numbers, at)?;
                if moment.fraction == 0.0 {
                    return Err(fail(format!(
                        "time {at} is not between frames; {}",
                        has(&numbers)
                    )));
                }
                moment
            }
            (None, Some(frame), _) => FrameTime::at(frame),
            (None, None, &[frame]) => FrameTime::at(frame),
            (None, None, &[.., last]) if self.entry.bake.is_some() => FrameTime::at(last),
            (None, None, _) => {
                return Err(fail(format!("has {} frames; give frame or at", numbers.len())));
            }
        };
        Ok(vec![(moment.frame, moment)])
    }

    /// Which of some frames a sequence of all frames should have, and the input has not.
    pub(super) fn lost(&self, expected: &[i64]) -> Vec<i64> {
        match &self.entry.content {
            Content::Sequence { frames: FrameSpec::All, .. } => {
                let there = |&number: &i64| self.input.sequence.frame(number).is_some();
                expected.iter().copied().filter(|number| !there(number)).collect()
            }
            // A list that names one is an error; one that does not leaves it out.
            _ => Vec::new(),
        }
    }

    /// Reads and classifies what there is at a moment.
    pub(super) fn load(&self, moment: FrameTime) -> Result<Loaded> {
        self.input.load(moment, &self.scene)
    }

    /// Draws it.
    pub(super) fn draw(&self, offscreen: &mut Offscreen, loaded: &Loaded) -> Result<RgbImage> {
        let shot = offscreen.draw(&self.scene, &self.camera, &loaded.splats, self.entry.size)?;
        Ok(shot.picture)
    }
}

/// The frames that there are, as a part of a message.
fn has(numbers: &[i64]) -> String {
    match numbers {
        [] => "there are none".into(),
        [only] => format!("the only one is {only}"),
        [first, .., last] => format!("there are {} from {first} to {last}", numbers.len()),
    }
}

/// Simulates a scene anew, so that no frames of an older simulation pass for it.
fn baked(scene_file: &str, bake: Bake) -> Result<(Input, Baked)> {
    let mut project = Project::load(Path::new(scene_file))?;
    let simulation = project.simulation_mut(scene_file)?;
    simulation.radius = bake.radius.unwrap_or(simulation.radius);
    // The first frame is the start.
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
    bake::bake(&simulation, solids, "baked", &folder, |_| ControlFlow::Continue(()))?;
    let input = Input::from_project(project, &origin.to_string_lossy())?;
    Ok((input, baked))
}
