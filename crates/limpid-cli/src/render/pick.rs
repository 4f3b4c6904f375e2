//! Selection of the settings for `--max-error` and `--budget`.

use std::time::Instant;

use limpid::gpu::Gpu;
use limpid::offscreen::Offscreen;
use limpid::settings::Settings;
use limpid_io::project::overrides::replaced;
use limpid_io::quality::{Curve, List, calibration};
use limpid_io::shared_classifier::Processor;
use limpid_io::{Error, Result};
use serde::Serialize;

use super::budget::Budget;
use super::plan::Plan;
use crate::calibration_cache::CalibrationCache;
use crate::pipeline_cache::{self, PipelineCache};
use crate::terminal;

/// The settings that were picked.
#[derive(Debug, Serialize)]
pub(super) struct Picked {
    /// The settings, in the form that `--set` accepts.
    set: Vec<String>,
    /// Error of the intersector's hits, pixels.
    error_px: f64,
    /// Mean FLIP of the pictures that the settings were judged by.
    flip: f64,
    /// Time of a frame over that with the defaults, by the calibration.
    cost: f64,
    /// With a budget: time of the first frame, ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    ms: Option<f64>,
}

/// A choice, and the inputs that were opened for it.
pub(super) struct Pick {
    pub(super) picked: Picked,
    /// The settings of the first picture.
    pub(super) settings: Settings,
    pub(super) opened: (Gpu, Option<PipelineCache>),
    /// With a budget, and a renderer that has compiled the shaders of the first frame.
    pub(super) budget: Option<(Budget, Offscreen)>,
}

/// Picks the settings that satisfy the plan's limits, and reports them; `None` without limits.
pub(super) fn pick(plan: &Plan) -> Result<Option<Pick>> {
    let Some(limits) = plan.limits else { return Ok(None) };
    let curve = Curve::shipped();
    // Before the device is opened.
    curve.candidates(limits).map_err(by_option)?;
    let (gpu, pipelines) = pipeline_cache::open_adapter()?;
    let (costs, origin) = costs(plan, &gpu, curve, limits.list())?;
    let choices = curve.choices(limits.list());
    let (index, settings, budget) = match limits.budget {
        None => {
            let index = curve.fastest(limits, &costs).map_err(by_option)?;
            (index, replaced(&plan.scene.settings, &choices[index].set)?, None)
        }
        Some(ms) => {
            let ladder = curve.ladder(limits, &costs).map_err(by_option)?;
            let costs = ladder.iter().map(|&i| costs[i]).collect();
            let sets = ladder.iter().map(|&i| choices[i].set.clone()).collect();
            let (budget, offscreen) = start(plan, &gpu, ms, costs, sets)?;
            (ladder[budget.rung()], budget.settings().clone(), Some((budget, offscreen)))
        }
    };
    let choice = &choices[index];
    let (set, error_px, flip, cost) =
        (choice.set.clone(), choice.error_px, choice.flip, costs[index]);
    let ms = budget.as_ref().map(|(budget, _)| budget.first_ms());
    let first = ms.map_or(String::new(), |ms| format!(", {ms:.3} ms for the first frame"));
    terminal::remark(format!(
        "picked {}: {error_px} px, FLIP {flip}, {cost:.2} of the defaults' time{first}; {origin}",
        set.join(" ")
    ));
    let picked = Picked { set, error_px, flip, cost, ms };
    Ok(Some(Pick { picked, settings, opened: (gpu, pipelines), budget }))
}

/// The costs of a list's choices, from an earlier run or measured now, and which of these, in words.
fn costs(plan: &Plan, gpu: &Gpu, curve: &Curve, list: List) -> Result<(Vec<f64>, String)> {
    let size = plan.drawing.size;
    let mut cache = CalibrationCache::open(gpu, curve, size);
    let stored = cache.as_ref().filter(|_| !plan.calibrate).and_then(|cache| cache.costs(list));
    if let Some(costs) = stored {
        return Ok((costs, "calibrated before (--calibrate measures anew)".into()));
    }
    let (choices, begun) = (curve.choices(list), Instant::now());
    terminal::remark(format!(
        "measuring {} choices of settings at {}x{}, once for this adapter and size",
        choices.len(),
        size.x,
        size.y
    ));
    let costs = calibration::measure(gpu, list, choices, size)?;
    if let Some(cache) = &mut cache {
        cache.keep(list, &costs);
    }
    Ok((costs, format!("calibrated in {:.1} s", begun.elapsed().as_secs_f64())))
}

/// Finds the settings of the first picture for a budget, ms. `costs` and `sets` are those of
/// the ladder.
fn start(
    plan: &Plan,
    gpu: &Gpu,
    budget: f64,
    costs: Vec<f64>,
    sets: Vec<Vec<String>>,
) -> Result<(Budget, Offscreen)> {
    let Plan { loader, scene, clock, shots, .. } = plan;
    let at = clock.times[shots[0].frame];
    // On the CPU: the classifier is not ready yet, and the choice does not depend on the processor.
    let loaded = loader.clone().processed_by(Processor::Cpu).load(at, scene)?;
    let mut offscreen = Offscreen::new(gpu);
    let first = loaded.scene(scene).into_owned();
    let view = (&shots[0].camera, plan.drawing.size);
    let budget = Budget::start(budget, costs, sets, &mut offscreen, first, &loaded.splats, view)?;
    Ok((budget, offscreen))
}

/// Names a limit by its option.
fn by_option(error: Error) -> Error {
    match error {
        Error::Usage(problem) => Error::Usage(format!("--{}", problem.replacen('_', "-", 1))),
        error => error,
    }
}
