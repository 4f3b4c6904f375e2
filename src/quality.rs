//! Settings by what a picture may cost, or how wrong it may be: `limpid render --max-error` and
//! `--budget`.
//!
//! They are chosen from what was measured, `src/quality.toml`, which `limpid report --curve` writes.
//! Errors are the same on every adapter. Costs are relative to the defaults', so a few frames of the
//! scene tell what they are on the adapter that is there.

use std::sync::LazyLock;

use glam::UVec2;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::passes::classify::Splats;
use crate::renderer::{Picture, Renderer};
use crate::scene::Scene;

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
    /// Intersectors with less or more smoothing, rays and bounces: those that no other is better
    /// than in everything.
    pub pictures: Vec<Choice>,
}

/// Settings, and what they cost.
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
    /// Time of a frame over that with the defaults.
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
    /// Time of a frame on this adapter, measured, ms; if a budget was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ms: Option<f64>,
}

/// Frames of which the median is taken.
const FRAMES: usize = 3;

/// Frames that are measured before a budget is given up.
const ATTEMPTS: usize = 4;

impl Curve {
    /// The measurements that limpid has with it.
    pub fn shipped() -> &'static Self {
        static SHIPPED: LazyLock<Curve> = LazyLock::new(|| {
            toml::from_str(include_str!("quality.toml")).expect("a test reads the curve")
        });
        &SHIPPED
    }

    /// The cheapest intersector whose error is at most `max_error` pixels.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the least error, if that is larger.
    pub fn cheapest(&self, max_error: f64) -> Result<&Choice> {
        let right = self.intersectors.iter().filter(|choice| choice.error_px <= max_error);
        let cheaper = |a: &&Choice, b: &&Choice| a.cost.total_cmp(&b.cost);
        right.min_by(cheaper).ok_or_else(|| too_exact(&self.intersectors, max_error))
    }

    /// The settings with the best picture that cost at most `cost`, and whose intersector's error is
    /// at most `max_error` pixels. `unit` is what a cost of 1 is, ms.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the best that can be had, if nothing satisfies both.
    pub fn best(&self, max_error: Option<f64>, budget: f64, unit: f64) -> Result<&Choice> {
        let max_error = max_error.unwrap_or(f64::INFINITY);
        let right: Vec<_> =
            self.pictures.iter().filter(|choice| choice.error_px <= max_error).collect();
        let cheaper = |a: &&&Choice, b: &&&Choice| a.cost.total_cmp(&b.cost);
        let Some(cheapest) = right.iter().min_by(cheaper) else {
            return Err(too_exact(&self.pictures, max_error));
        };
        let better =
            |a: &&&Choice, b: &&&Choice| a.flip.total_cmp(&b.flip).then(a.cost.total_cmp(&b.cost));
        let affordable = right.iter().filter(|choice| choice.cost * unit <= budget);
        affordable.min_by(better).copied().ok_or_else(|| {
            let (ms, set) = (cheapest.cost * unit, cheapest.set.join(" "));
            Error::Usage(format!(
                "--budget {budget}: the fastest settings take about {ms:.2} ms a frame here ({set})"
            ))
        })
    }

    /// What satisfies `limits`, and the scene's settings with it; none if there are none. A budget is
    /// measured on `gpu`, by frames of this scene.
    ///
    /// # Errors
    /// As [`Curve::cheapest`], [`Curve::best`] and [`Renderer::render`].
    pub fn pick(
        &self,
        limits: Limits,
        gpu: impl FnOnce() -> Result<Gpu>,
        scene: &mut Scene,
        frame: impl FnOnce(&Scene) -> Result<(Camera, Splats)>,
        size: UVec2,
    ) -> Result<Option<Picked>> {
        let Some(budget) = limits.budget else {
            let Some(max_error) = limits.max_error else { return Ok(None) };
            let choice = self.cheapest(max_error)?;
            scene.settings = scene.settings.with(&choice.set)?;
            return Ok(Some(Picked { choice: choice.clone(), ms: None }));
        };
        let (camera, splats) = frame(scene)?;
        let gpu = gpu()?;
        let mut renderer = Renderer::new(&gpu);
        let mut take = |set: &[String]| -> Result<(f64, Scene)> {
            let settings = scene.settings.with(set)?;
            let scene = Scene { settings, ..scene.clone() };
            let ms = frame_ms(&gpu, &mut renderer, &scene, &camera, &splats, size)?;
            Ok((ms, scene))
        };
        // The defaults' time is the unit of all others'; where it foretells one wrongly, it is
        // corrected by that.
        let mut unit = take(&self.intersectors[0].set)?.0;
        for _ in 0..ATTEMPTS {
            let choice = self.best(limits.max_error, budget, unit)?;
            let (ms, with) = take(&choice.set)?;
            if ms <= budget {
                *scene = with;
                return Ok(Some(Picked { choice: choice.clone(), ms: Some(ms) }));
            }
            unit = unit.max(ms / choice.cost);
        }
        let problem = "what the settings take here varies too much; a larger one expected";
        Err(Error::Usage(format!("--budget {budget}: {problem}")))
    }
}

/// Nothing is so exact; the best is told.
fn too_exact(choices: &[Choice], max_error: f64) -> Error {
    let exact = |a: &&Choice, b: &&Choice| a.error_px.total_cmp(&b.error_px);
    let best = choices.iter().min_by(exact).map_or(String::new(), |best| {
        format!("; the least is {} ({})", best.error_px, best.set.join(" "))
    });
    Error::Usage(format!("--max-error {max_error}: no intersector is so exact{best}"))
}

/// Time of a frame on the device, ms, the median of some after one that may compile; by the clock
/// where the adapter has no timestamps.
fn frame_ms(
    gpu: &Gpu,
    renderer: &mut Renderer,
    scene: &Scene,
    camera: &Camera,
    splats: &Splats,
    size: UVec2,
) -> Result<f64> {
    let target = Picture::new(gpu, size)?;
    renderer.timing = true;
    let mut times = Vec::new();
    for _ in 0..=FRAMES {
        renderer.forget();
        let begun = std::time::Instant::now();
        let passes =
            renderer.render(scene, camera, splats, &target.view(), Picture::FORMAT, size)?;
        if passes.is_empty() {
            target.read(gpu)?;
            times.push(1e3 * begun.elapsed().as_secs_f64());
        } else {
            times.push(passes.iter().map(|pass| pass.ms).sum());
        }
    }
    times.remove(0);
    times.sort_by(f64::total_cmp);
    Ok(times[FRAMES / 2])
}
