//! Films of what is played, drawn and written on a thread of their own with a device of its own.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::UVec2;

use crate::Viewer;
use crate::backend::core::messages::Message;
use crate::model::document::Document;
use limpid::frame::FrameInput;
use limpid::offscreen::Offscreen;
use limpid::scene::Scene;
use limpid_io::device;
use limpid_io::error::{Error, Result};
use limpid_io::film::{self, Film, Motion, Shot};
use limpid_io::input::{FrameTime, Input};
use limpid_io::output::FileKind;
use limpid_io::shared_classifier::SharedClassifier;

/// A film that is being written.
#[derive(Debug)]
pub(crate) struct Filming {
    /// Pictures that are written.
    pub(crate) done: usize,
    /// All its pictures.
    pub(crate) pictures: usize,
    stop: Arc<AtomicBool>,
}

impl Filming {
    /// Stops after the current picture; the film is removed.
    pub(crate) fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// The contents of a film.
struct Script {
    input: Input,
    scene: Scene,
    frame_times: Arc<[FrameTime]>,
    shots: Vec<Shot>,
    size: UVec2,
    fps: f64,
}

impl Viewer {
    /// Size of films by default, pixels: that of the picture, even, as videos must be.
    pub(crate) fn film_size(&self) -> UVec2 {
        (self.picture.viewport_size / 2 * 2).max(UVec2::splat(2))
    }

    /// Draws all frame times from the camera or along its path, with the edited settings, and writes them as a film
    /// at the speed of playback, in the background. The extension selects the format.
    pub fn save_film(&mut self, path: PathBuf, size: UVec2, samples: u32) {
        let Some(document) = self.opened.document.clone() else { return };
        if self.jobs.filming.is_some() {
            self.fail(&Error::Usage("another film is being written".into()));
            return;
        }
        let script = match self.script(&document, size, samples) {
            Ok(script) => script,
            Err(error) => return self.fail(&error),
        };
        let stop = Arc::<AtomicBool>::default();
        let pictures = script.shots.len();
        self.jobs.filming = Some(Filming { done: 0, pictures, stop: stop.clone() });
        let post = self.jobs.post.clone();
        let report = move || {
            let checked = document.check_output(&path, FileKind::FILM);
            let written = checked.and_then(|()| {
                write(&script, &path, |done| {
                    post.send(Message::Filmed(done));
                    !stop.load(Ordering::Relaxed)
                })
            });
            post.send(Message::FilmEnded(written.map(|whole| whole.then_some(path))));
        };
        self.jobs.writers.retain(|writer| !writer.is_finished());
        self.jobs.writers.push(std::thread::spawn(report));
    }

    fn script(&self, document: &Document, size: UVec2, samples: u32) -> Result<Script> {
        let frame_times = self.opened.frame_times.clone();
        let keys = !self.eye.path.keys.is_empty();
        let motion = match self.eye.follow && keys {
            true => Motion::Path(self.eye.path.clone()),
            false => Motion::Still,
        };
        let numbers: Vec<i64> = (0..frame_times.len() as i64).collect();
        let fps = self.playback.fps;
        let stride = self.playback.speed().stride();
        let shots = film::shots(&numbers, self.eye.camera, &motion, fps)?;
        let shots: Vec<Shot> = shots.into_iter().step_by(stride).collect();
        if shots.len() < 2 {
            let problem = "not saved: a film needs several frames, or a camera path to follow";
            return Err(Error::Usage(problem.into()));
        }
        let mut scene = self.fine_scene();
        scene.settings.refract.samples = samples;
        let input = document.input.clone().processed_by(self.opened.frames.processor);
        Ok(Script { input, scene, frame_times, shots, size, fps })
    }

    /// Handles the end of a film: its path, or nothing if it was stopped.
    pub(crate) fn film_ended(&mut self, written: Result<Option<PathBuf>>) {
        self.jobs.filming = None;
        match written.transpose() {
            Some(saved) => self.take_saved(saved),
            None => self.show_info("the film was stopped and removed".into()),
        }
    }
}

/// Writes a film; `proceed` is called with the number of finished pictures and decides whether to go on. Returns
/// whether the film is whole.
fn write(script: &Script, path: &Path, mut proceed: impl FnMut(usize) -> bool) -> Result<bool> {
    let Script { input, scene, frame_times, shots, size, fps } = script;
    let mut film = Film::create(path, *size, *fps)?;
    let gpu = device::open()?;
    let input = input.clone().classified(SharedClassifier::on(&gpu));
    let mut offscreen = Offscreen::new(&gpu);
    // A still is loaded once.
    let mut last = None;
    for (done, shot) in (1..).zip(shots) {
        let loaded = match last.take() {
            Some((frame, loaded)) if frame == shot.frame => loaded,
            _ => input.load(frame_times[shot.frame], scene)?,
        };
        let scene = loaded.scene(scene);
        let input = FrameInput::new(&scene, &shot.camera, &loaded.splats, *size);
        let frame = offscreen.draw(input)?;
        film.push(&frame.picture)?;
        last = Some((shot.frame, loaded));
        if !proceed(done) {
            return Ok(false);
        }
    }
    film.finish()?;
    Ok(true)
}
