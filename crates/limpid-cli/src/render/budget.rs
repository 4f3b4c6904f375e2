//! `--budget` over a sequence: the settings of each picture, from the times of the pictures before.

use std::time::Instant;

use glam::UVec2;
use limpid::camera::Camera;
use limpid::frame::FrameInput;
use limpid::gpu::PassTime;
use limpid::liquid::classify::Splats;
use limpid::offscreen::{Offscreen, PendingFrame};
use limpid::scene::Scene;
use limpid::settings::Settings;
use limpid::wgpu;
use limpid_io::project::overrides::replaced;
use limpid_io::quality::calibration;
use limpid_io::quality::controller::Controller;
use limpid_io::{Error, Result};
use serde::Serialize;

use crate::fingerprint::Fingerprints;

/// The budget of a run.
pub(super) struct Budget {
    ms: f64,
    controller: Controller,
    rungs: Vec<Rung>,
    /// Shaders of the last picture.
    drawn: Option<Drawn>,
}

/// Key of a picture's shaders, which drivers compile with the first one: the number of its settings,
/// and whether it has splashes.
type Drawn = (usize, bool);

/// Settings to choose from, as [`Controller`] numbers them.
struct Rung {
    /// The settings, in the form that `--set` accepts.
    set: Vec<String>,
    settings: Settings,
    /// Fingerprints of pictures with these settings, once there is one.
    fingerprints: Option<Fingerprints>,
}

/// How a budget was kept, for `--stats`.
#[derive(Debug, Serialize)]
pub(super) struct BudgetStats {
    /// The budget, ms.
    ms: f64,
    /// Number of frames over it.
    over: usize,
    /// Time of the longest frame, ms.
    longest_ms: f64,
}

impl Budget {
    /// Finds the settings of the first picture, which is drawn a few times; `costs` and `sets` are those of
    /// the settings to choose from, the best picture first, each cheaper than those before.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the fastest settings if the picture takes longer than the budget with these;
    /// those of drawing.
    pub(super) fn start(
        ms: f64,
        costs: Vec<f64>,
        sets: Vec<Vec<String>>,
        offscreen: &mut Offscreen,
        mut scene: Scene,
        splats: &Splats,
        (camera, size): (&Camera, UVec2),
    ) -> Result<Self> {
        let rung = |set: Vec<String>| {
            let settings = replaced(&scene.settings, &set)?;
            Ok(Rung { set, settings, fingerprints: None })
        };
        let rungs: Vec<Rung> = sets.into_iter().map(rung).collect::<Result<_>>()?;
        let mut drawn = None;
        let controller = Controller::start(ms, costs, |i| {
            scene.settings = rungs[i].settings.clone();
            let input = FrameInput::new(&scene, camera, splats, size);
            let mut time = || calibration::frame_ms(offscreen, input);
            if drawn.replace(i) != Some(i) {
                time()?;
            }
            time()
        })?;
        let first = controller.first_ms();
        if first > ms {
            let set = rungs[controller.rung()].set.join(" ");
            let problem = "the fastest settings take about";
            let message = format!("--budget {ms}: {problem} {first:.2} ms a frame here ({set})");
            return Err(Error::Usage(message));
        }
        let drawn = Some((controller.rung(), !splats.splashes.is_empty()));
        Ok(Self { ms, controller, rungs, drawn })
    }

    /// Number of the next picture's settings.
    pub(super) fn rung(&self) -> usize {
        self.controller.rung()
    }

    /// The next picture's settings.
    pub(super) fn settings(&self) -> &Settings {
        &self.rungs[self.rung()].settings
    }

    /// Settings by their number, in the form that `--set` accepts.
    pub(super) fn set(&self, rung: usize) -> &[String] {
        &self.rungs[rung].set
    }

    /// Time of the first picture, ms.
    pub(super) fn first_ms(&self) -> f64 {
        self.controller.first_ms()
    }

    /// Fingerprints of pictures of `size` pixels in `scene`, which has the next picture's settings; `others` are
    /// those of the same pictures in another scene.
    pub(super) fn fingerprints(
        &mut self,
        others: &Fingerprints,
        scene: &Scene,
        size: UVec2,
    ) -> &Fingerprints {
        let rung = self.rung();
        self.rungs[rung].fingerprints.get_or_insert_with(|| others.drawn_in(scene, size))
    }

    /// Begins drawing a picture, whose scene has its settings, and takes its time.
    pub(super) fn draw(
        &mut self,
        offscreen: &mut Offscreen,
        input: FrameInput<'_>,
    ) -> Result<PendingFrame> {
        let rung = self.rung();
        let drawn = (rung, !input.splats.splashes.is_empty());
        if self.drawn.replace(drawn) != Some(drawn) {
            // Not shown: compiling is no time of the picture's.
            offscreen.draw(input)?;
            offscreen.renderer.forget();
        }
        let begun = Instant::now();
        let frame = offscreen.begin(input)?;
        let ms = match frame.passes() {
            // The adapter has no timestamps. A lost device is found when the picture is read.
            [] => {
                let _ = offscreen.gpu().device.poll(wgpu::PollType::wait_indefinitely());
                1e3 * begun.elapsed().as_secs_f64()
            }
            passes => total_ms(passes),
        };
        self.controller.observe(rung, ms);
        Ok(frame)
    }

    /// The renderer has been replaced, whose shaders are not compiled.
    pub(super) fn renew(&mut self) {
        self.drawn = None;
    }

    pub(super) fn stats(&self) -> BudgetStats {
        let kept = self.controller.kept();
        BudgetStats { ms: self.ms, over: kept.over, longest_ms: kept.longest_ms }
    }

    /// The remark on the frames that exceeded the budget, with the remedy; `None` if there are none.
    pub(super) fn remark(&self) -> Option<String> {
        let kept = self.controller.kept();
        if kept.over == 0 {
            return None;
        }
        let (over, frames, most) = (kept.over, kept.frames, kept.longest_ms);
        let mut remark = format!(
            "--budget {}: {over} of {frames} frames took longer, up to {most:.0} ms",
            self.ms
        );
        if kept.over_at_cheapest > 0 {
            let with = kept.over_at_cheapest;
            remark += &format!(", {with} of them with the fastest settings");
            remark += "; a smaller --size or a larger budget can be kept";
        }
        Some(remark)
    }
}

/// Device time of all passes, ms.
pub(super) fn total_ms(passes: &[PassTime]) -> f64 {
    passes.iter().map(|pass| pass.ms).sum()
}
