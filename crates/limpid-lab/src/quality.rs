//! Selection of settings by error or frame time: `limpid render --max-error` and `--budget`.
//!
//! The error of each choice was measured beforehand and is read from
//! `crates/limpid-lab/src/quality.toml`, which `limpid report --curve` writes: errors are the same
//! on every adapter. Frame times depend on adapter, scene and size, so they are measured on demand.

use std::sync::LazyLock;

use glam::UVec2;
use serde::{Deserialize, Serialize};

use limpid::camera::Camera;
use limpid::gpu::Gpu;
use limpid::liquid::classify::Splats;
use limpid::offscreen::Picture;
use limpid::renderer::Renderer;
use limpid::scene::Scene;
use limpid_io::error::{Error, Result};
use limpid_io::project::overrides::replaced;

/// The measured error, FLIP and cost of each choice of settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Curve {
    /// The adapter that they were measured on.
    pub adapter: String,
    /// The scenes of `sims/` that they were measured on.
    pub scenes: Vec<String>,
    /// Width of the pictures whose ray hits were scored, pixels.
    pub hits_width: u32,
    /// Width of the pictures that were timed and compared, pixels.
    pub width: u32,
    /// Intersectors; all other settings are the defaults. The defaults themselves come first.
    pub intersectors: Vec<Choice>,
    /// Intersectors with less or more smoothing, rays and bounces: the defaults, and those on the
    /// Pareto front of error, FLIP and cost.
    pub pictures: Vec<Choice>,
}

/// Settings with their error and cost.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choice {
    /// The settings, in the form that `--set` accepts.
    pub set: Vec<String>,
    /// Error of the intersector's hits, pixels: the root mean square distance from the true hits
    /// over all rays whose hit the layers show. A hit that is missing, on another surface or
    /// further off counts as 10.
    pub error_px: f64,
    /// Mean FLIP of the pictures against path-traced ones.
    pub flip: f64,
    /// Frame time relative to that with the defaults, on the curve's adapter and at its width; it
    /// does not carry over to other sizes or scenes.
    pub cost: f64,
}

/// The limits that the user requests.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Limits {
    /// The largest error of the intersector's hits, pixels.
    pub max_error: Option<f64>,
    /// The longest frame time on the device, ms.
    pub budget: Option<f64>,
}

/// The settings that were picked.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Picked {
    /// The settings with their measured error and cost.
    #[serde(flatten)]
    pub choice: Choice,
    /// Frame time, ms, measured on this adapter, with this scene, at the requested size.
    pub ms: f64,
}

/// Number of timed frames; their median is used.
const FRAMES: usize = 3;

/// Relative difference below which two times are treated as equal: medians of a few frames vary by
/// this much.
pub const NOISE: f64 = 0.1;

impl Curve {
    /// The measurements that ship with limpid.
    pub fn shipped() -> &'static Self {
        static SHIPPED: LazyLock<Curve> = LazyLock::new(|| {
            toml::from_str(include_str!("quality.toml")).expect("a test reads the curve")
        });
        &SHIPPED
    }

    /// The choices within the error limit: intersectors, or with a budget whole pictures. The
    /// defaults are among them if they satisfy the limit.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the smallest error, if even that exceeds the limit.
    pub fn candidates(&self, limits: Limits) -> Result<Vec<&Choice>> {
        let all = if limits.budget.is_some() { &self.pictures } else { &self.intersectors };
        let Some(max_error) = limits.max_error else { return Ok(all.iter().collect()) };
        let exact_enough: Vec<_> =
            all.iter().filter(|choice| choice.error_px <= max_error).collect();
        if exact_enough.is_empty() {
            let exact = |a: &&Choice, b: &&Choice| a.error_px.total_cmp(&b.error_px);
            let best = all.iter().min_by(exact).map_or(String::new(), |best| {
                format!("; the least is {} ({})", best.error_px, best.set.join(" "))
            });
            let problem = format!("max_error {max_error}: no intersector is that accurate{best}");
            return Err(Error::Usage(problem));
        }
        Ok(exact_enough)
    }

    /// Picks the best of `candidates`, whose frame times are `ms`.
    ///
    /// Without a budget: the most exact of those that are as fast as the fastest, or slower by no
    /// more than [`NOISE`]. With a budget: of those that fit it, the one with the best picture, but
    /// none whose hits are worse than the defaults' if another fits. A looser error limit therefore
    /// never picks slower settings, a larger budget never picks worse ones, and nothing worse than
    /// the defaults is picked where these fit.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the fastest choice, if none fits the budget.
    pub fn decide(&self, limits: Limits, candidates: &[&Choice], ms: &[f64]) -> Result<Picked> {
        let timed = || candidates.iter().copied().zip(ms.iter().copied());
        let fastest = timed().min_by(|a, b| a.1.total_cmp(&b.1));
        let (fastest_choice, least) =
            fastest.ok_or_else(|| Error::Usage("nothing to pick".into()))?;
        let best = match limits.budget {
            None => timed()
                .filter(|(_, ms)| *ms <= (1.0 + NOISE) * least)
                .min_by(|(a, _), (b, _)| a.error_px.total_cmp(&b.error_px)),
            Some(budget) => {
                let default = self.intersectors.first().map_or(f64::INFINITY, |d| d.error_px);
                timed().filter(|(_, ms)| *ms <= budget).min_by(|(a, a_ms), (b, b_ms)| {
                    let worse = |choice: &Choice| choice.error_px > default;
                    (worse(a).cmp(&worse(b)))
                        .then(a.flip.total_cmp(&b.flip))
                        .then(a.error_px.total_cmp(&b.error_px))
                        .then(a_ms.total_cmp(b_ms))
                })
            }
        };
        let Some((choice, ms)) = best else {
            let (budget, set) = (limits.budget.unwrap_or(0.0), fastest_choice.set.join(" "));
            let problem = "the fastest settings take about";
            let message = format!("budget {budget}: {problem} {least:.2} ms a frame here ({set})");
            return Err(Error::Usage(message));
        };
        Ok(Picked { choice: choice.clone(), ms })
    }

    /// Picks the settings that satisfy `limits` and applies them to the scene; `None` without
    /// limits. Every candidate renders the frame a few times at `size` on `gpu`.
    ///
    /// # Errors
    /// As [`Curve::candidates`], [`Curve::decide`] and [`Renderer::render`].
    pub fn pick(
        &self,
        limits: Limits,
        gpu: impl FnOnce() -> Result<Gpu>,
        scene: &mut Scene,
        frame: impl FnOnce(&Scene) -> Result<(Camera, Splats)>,
        size: UVec2,
    ) -> Result<Option<Picked>> {
        if limits == Limits::default() {
            return Ok(None);
        }
        let candidates = self.candidates(limits)?;
        let with = |choice: &&Choice| -> Result<Scene> {
            Ok(Scene { settings: replaced(&scene.settings, &choice.set)?, ..scene.clone() })
        };
        let scenes: Vec<_> = candidates.iter().map(with).collect::<Result<_>>()?;
        let (camera, splats) = frame(scene)?;
        let ms = frame_times(&gpu()?, &scenes, &camera, &splats, size)?;
        let picked = self.decide(limits, &candidates, &ms)?;
        scene.settings = replaced(&scene.settings, &picked.choice.set)?;
        Ok(Some(picked))
    }
}

/// Device time of a frame of each scene, ms: the median of several, after one that may compile
/// pipelines. Uses wall-clock time where the adapter has no timestamps. The scenes are interleaved,
/// so that a disturbance affects all of them.
fn frame_times(
    gpu: &Gpu,
    scenes: &[Scene],
    camera: &Camera,
    splats: &Splats,
    size: UVec2,
) -> Result<Vec<f64>> {
    let mut renderer = Renderer::new(gpu);
    let target = Picture::new(gpu, size)?;
    renderer.timing = true;
    let mut times = vec![Vec::new(); scenes.len()];
    for round in 0..=FRAMES {
        for (scene, times) in scenes.iter().zip(&mut times) {
            renderer.forget();
            let begun = std::time::Instant::now();
            let view = target.view();
            let passes = renderer.render(scene, camera, splats, &view, Picture::FORMAT, size)?;
            let ms = if passes.is_empty() {
                target.read(gpu)?;
                1e3 * begun.elapsed().as_secs_f64()
            } else {
                passes.iter().map(|pass| pass.ms).sum()
            };
            if round > 0 {
                times.push(ms);
            }
        }
    }
    let median = |mut times: Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[FRAMES / 2]
    };
    Ok(times.into_iter().map(median).collect())
}
