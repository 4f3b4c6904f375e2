//! Films of the playback.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use glam::UVec2;

use crate::app::Viewer;
use crate::backend::core::filming::Filming;
use crate::backend::native::filming::Script;
use crate::model::document::Document;
use limpid_io::color_by::ColorBy;
use limpid_io::error::{Error, Result};
use limpid_io::film::{self, Motion, Shot};

impl Viewer {
    /// Draws all frame times between the marks from the camera or along its path, with the edited settings, and writes them as a film
    /// at the speed of playback, in the background. The extension selects the format.
    pub fn save_film(&mut self, path: PathBuf, size: UVec2, samples: u32) {
        let Some(document) = self.opened.document.clone() else { return };
        if self.filming.is_some() {
            self.fail(&Error::Usage("another film is being written".into()));
            return;
        }
        let script = match self.script(&document, size, samples) {
            Ok(script) => script,
            Err(error) => return self.fail(&error),
        };
        self.check_legend(size);
        let stop = Arc::<AtomicBool>::default();
        let pictures = script.shots.len();
        let (begun, left) = (Instant::now(), None);
        self.filming = Some(Filming { done: 0, pictures, begun, left, stop: stop.clone() });
        self.backend.film(script, path, document, stop);
    }

    /// Frames, length and rate of the film that would be saved, in words.
    pub(super) fn film_facts(&self) -> String {
        match self.shots() {
            Ok(shots) => {
                let (frames, fps) = (shots.len(), self.stage.playback.fps);
                let seconds = frames as f64 / fps;
                let which = self.stage.playback.marked().map_or("", |_| " between the marks");
                let rate = decimals(fps);
                format!("{frames} frames{which}, {seconds:.2} s at {rate} frames per second")
            }
            Err(error) => error.to_string(),
        }
    }

    /// The pictures of a film of what is played.
    fn shots(&self) -> Result<Vec<Shot>> {
        let motion = match self.stage.eye.is_led() {
            true => Motion::Path(self.stage.eye.path.clone()),
            false => Motion::Still,
        };
        let playback = &self.stage.playback;
        let numbers: Vec<i64> = (0..playback.count().max(1) as i64).collect();
        let mut shots = film::shots(&numbers, self.stage.eye.camera, &motion, playback.fps)?;
        if let Some([first, last]) = playback.marked() {
            // The camera is where it is between the marks, too.
            shots = shots.drain(first..=last).collect();
        }
        let shots: Vec<Shot> = shots.into_iter().step_by(playback.speed().stride()).collect();
        if shots.len() < 2 {
            let problem = "not saved: a film needs several frames, or a camera path to follow";
            return Err(Error::Usage(problem.into()));
        }
        Ok(shots)
    }

    fn script(&self, document: &Document, size: UVec2, samples: u32) -> Result<Script> {
        let (frame_times, shots) = (self.stage.frame_times.clone(), self.shots()?);
        let fps = self.stage.playback.fps;
        let mut scene = self.picture.fine_scene(&self.stage.editing);
        scene.settings.refract.samples = samples;
        let colors = &self.stage.colors;
        let legend = colors.legend_of(&scene).cloned();
        // The usual range need not be found again.
        let range = colors.scale.as_ref().map(|scale| scale.range);
        let by = colors.by.clone().map(|by| ColorBy { range, ..by });
        let input = document.input.clone().processed_by(self.stage.processor).colored_by(by);
        Ok(Script { input, scene, frame_times, shots, size, fps, legend })
    }
}

/// A number with at most two decimals.
fn decimals(value: f64) -> String {
    let text = format!("{value:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
