//! Selection of the settings for `--max-error` and `--budget`.

use std::time::Instant;

use limpid::gpu::Gpu;
use limpid::offscreen::Offscreen;
use limpid_io::project::overrides::replaced;
use limpid_io::quality::{Curve, Limits, List, calibration};
use limpid_io::shared_classifier::Processor;
use limpid_io::{Error, Result};
use serde::Serialize;

use super::Args;
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

/// A choice, and what was opened for it.
pub(super) struct Pick {
    pub(super) picked: Picked,
    pub(super) opened: (Gpu, Option<PipelineCache>),
    /// With a budget, and a renderer that has compiled the shaders of the first frame.
    pub(super) budget: Option<(Budget, Offscreen)>,
}

/// Applies the settings that satisfy the limits to the scene, and reports them; `None` without limits.
pub(super) fn pick(args: &Args, plan: &mut Plan) -> Result<Option<Pick>> {
    let limits = Limits { max_error: args.max_error, budget: args.budget };
    if limits == Limits::default() {
        if args.calibrate {
            let problem = "--calibrate: measures for --max-error or --budget; give one of them";
            return Err(Error::Usage(problem.into()));
        }
        return Ok(None);
    }
    let curve = Curve::shipped();
    // Before the device is opened.
    curve.candidates(limits).map_err(by_option)?;
    let (gpu, pipelines) = pipeline_cache::open_adapter()?;
    let (costs, origin) = costs(args, &gpu, curve, limits.list())?;
    let choices = curve.choices(limits.list());
    let (index, budget) = match limits.budget {
        None => {
            let index = curve.fastest(limits, &costs).map_err(by_option)?;
            plan.scene.settings = replaced(&plan.scene.settings, &choices[index].set)?;
            (index, None)
        }
        Some(ms) => {
            let ladder = curve.ladder(limits, &costs).map_err(by_option)?;
            let costs = ladder.iter().map(|&i| costs[i]).collect();
            let sets = ladder.iter().map(|&i| choices[i].set.clone()).collect();
            let (budget, offscreen) = start(args, plan, &gpu, ms, costs, sets)?;
            (ladder[budget.rung()], Some((budget, offscreen)))
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
    Ok(Some(Pick { picked, opened: (gpu, pipelines), budget }))
}

/// The costs of a list's choices, from an earlier run or measured now, and which of these, in words.
fn costs(args: &Args, gpu: &Gpu, curve: &Curve, list: List) -> Result<(Vec<f64>, String)> {
    let mut cache = CalibrationCache::open(gpu, curve, args.size);
    let stored = cache.as_ref().filter(|_| !args.calibrate).and_then(|cache| cache.costs(list));
    if let Some(costs) = stored {
        return Ok((costs, "calibrated before (--calibrate measures anew)".into()));
    }
    let (choices, size, begun) = (curve.choices(list), args.size, Instant::now());
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

/// Finds the settings of the first picture for a budget, ms, and applies them. `costs` and `sets` are those of
/// the ladder.
fn start(
    args: &Args,
    plan: &mut Plan,
    gpu: &Gpu,
    budget: f64,
    costs: Vec<f64>,
    sets: Vec<Vec<String>>,
) -> Result<(Budget, Offscreen)> {
    let Plan { input, scene, frame_times, shots, .. } = plan;
    let at = frame_times[shots[0].frame];
    // On the CPU: the classifier is not ready yet, and the choice does not depend on the processor.
    let loaded = input.clone().processed_by(Processor::Cpu).load(at, scene)?;
    let mut offscreen = Offscreen::new(gpu);
    let first = loaded.scene(scene).into_owned();
    let view = (&shots[0].camera, args.size);
    let budget = Budget::start(budget, costs, sets, &mut offscreen, first, &loaded.splats, view)?;
    scene.settings = budget.settings().clone();
    Ok((budget, offscreen))
}

/// Names a limit by its option.
fn by_option(error: Error) -> Error {
    match error {
        Error::Usage(problem) => Error::Usage(format!("--{}", problem.replacen('_', "-", 1))),
        error => error,
    }
}

/// Parses a number above 0.
pub(super) fn parse_limit(text: &str) -> std::result::Result<f64, &'static str> {
    let limit = text.parse().ok().filter(|limit: &f64| limit.is_finite() && *limit > 0.0);
    limit.ok_or("expected a number above 0")
}
