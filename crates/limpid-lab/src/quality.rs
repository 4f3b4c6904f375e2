//! Settings by what a picture may cost, or how wrong it may be: `limpid render --max-error` and
//! `--budget`.
//!
//! How wrong they are was measured beforehand, `crates/limpid-lab/src/quality.toml`, which `limpid report --curve` writes:
//! errors are the same on every adapter. What they take depends on adapter, scene and size, so it
//! is measured where it is asked for.

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

/// What was measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Curve {
    /// On which adapter.
    pub adapter: String,
    /// Of which scenes of `sims/`.
    pub scenes: Vec<String>,
    /// Width of the pictures whose rays' hits were judged, pixels.
    pub hits_width: u32,
    /// Width of the pictures that were timed and compared, pixels.
    pub width: u32,
    /// Intersectors; all other settings are the defaults. The defaults themselves come first.
    pub intersectors: Vec<Choice>,
    /// Intersectors with less or more smoothing, rays and bounces: the defaults, and those that no
    /// other is better than in everything.
    pub pictures: Vec<Choice>,
}

/// Settings, and how good they are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choice {
    /// The settings, as `--set` takes them.
    pub set: Vec<String>,
    /// Error of the intersector's hits, pixels: the root mean square distance from the true hits of
    /// all rays whose hit the layers show. One that is missing, on another surface or further off
    /// counts as 10.
    pub error_px: f64,
    /// Mean FLIP of the pictures against traced ones.
    pub flip: f64,
    /// Time of a frame over that with the defaults, on the curve's adapter and at its width: of no
    /// other size or scene.
    pub cost: f64,
}

/// What is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Limits {
    /// The largest error of the intersector's hits, pixels.
    pub max_error: Option<f64>,
    /// The longest time of a frame on the device, ms.
    pub budget: Option<f64>,
}

/// What was picked.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Picked {
    /// The settings and what is known of them.
    #[serde(flatten)]
    pub choice: Choice,
    /// Time of a frame, ms, measured on this adapter, on this scene, at the size asked for.
    pub ms: f64,
}

/// Frames of which the median is taken.
const FRAMES: usize = 3;

/// Times that differ by no more than this share of the shorter are alike: medians of a few frames
/// vary so much.
pub const NOISE: f64 = 0.1;

impl Curve {
    /// The measurements that limpid has with it.
    pub fn shipped() -> &'static Self {
        static SHIPPED: LazyLock<Curve> = LazyLock::new(|| {
            toml::from_str(include_str!("quality.toml")).expect("a test reads the curve")
        });
        &SHIPPED
    }

    /// What is exact enough: intersectors, or with a budget pictures. The defaults are among them if
    /// they are.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the least error, if that is larger.
    pub fn candidates(&self, limits: Limits) -> Result<Vec<&Choice>> {
        let all = if limits.budget.is_some() { &self.pictures } else { &self.intersectors };
        let Some(max_error) = limits.max_error else { return Ok(all.iter().collect()) };
        let right: Vec<_> = all.iter().filter(|choice| choice.error_px <= max_error).collect();
        if right.is_empty() {
            let exact = |a: &&Choice, b: &&Choice| a.error_px.total_cmp(&b.error_px);
            let best = all.iter().min_by(exact).map_or(String::new(), |best| {
                format!("; the least is {} ({})", best.error_px, best.set.join(" "))
            });
            let problem = format!("--max-error {max_error}: no intersector is so exact{best}");
            return Err(Error::Usage(problem));
        }
        Ok(right)
    }

    /// What satisfies the limits best, of `candidates` that take so many ms a frame each.
    ///
    /// Without a budget: of those that take as long as the fastest, or longer by no more than
    /// [`NOISE`], the most exact. With one: of those that fit it, the best picture; but nothing
    /// whose hits are worse than the defaults' where something else fits. So a larger limit never
    /// picks what is slower, a larger budget never what is worse, and nothing worse than the
    /// defaults is picked where these fit.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the fastest, if none fits the budget.
    pub fn decide(&self, limits: Limits, candidates: &[&Choice], ms: &[f64]) -> Result<Picked> {
        let timed = || candidates.iter().copied().zip(ms.iter().copied());
        let fastest = timed().min_by(|a, b| a.1.total_cmp(&b.1));
        let (quick, least) = fastest.ok_or_else(|| Error::Usage("nothing to pick".into()))?;
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
            let (budget, set) = (limits.budget.unwrap_or(0.0), quick.set.join(" "));
            let problem = "the fastest settings take about";
            let what = format!("--budget {budget}: {problem} {least:.2} ms a frame here ({set})");
            return Err(Error::Usage(what));
        };
        Ok(Picked { choice: choice.clone(), ms })
    }

    /// What satisfies `limits`, and the scene's settings with it; none if there are none. All that
    /// may be picked draws the frame at `size` some times on `gpu`.
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

/// Time of a frame of each scene on the device, ms, the median of some after one that may compile; by
/// the clock where the adapter has no timestamps. By turns, so that what disturbs one disturbs all.
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
