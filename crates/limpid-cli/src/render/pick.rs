//! Selection of the settings for `--max-error` and `--budget`.

use limpid::scene::Scene;
use limpid_io::shared_classifier::Processor;
use limpid_io::{Error, device};
use limpid_lab::quality::{Choice, Curve, Limits, Picked};

use super::Args;
use super::plan::Plan;

/// Applies the settings that satisfy the limits to the scene, reports them, and returns them.
pub(super) fn pick(args: &Args, plan: &mut Plan) -> limpid_io::Result<Option<Picked>> {
    let limits = Limits { max_error: args.max_error, budget: args.budget };
    let Plan { input, scene, frame_times, shots, .. } = plan;
    if limits == Limits::default() {
        return Ok(None);
    }
    let at = frame_times[shots[0].frame];
    let mut first = input.moved(at, scene)?.scene(scene).into_owned();
    let frame = |_: &Scene| {
        // On the CPU: no device is open yet, and the choice does not depend on the processor.
        let input = input.clone().processed_by(Processor::Cpu);
        let loaded = input.load(at, scene)?;
        Ok((shots[0].camera, loaded.splats))
    };
    let curve = Curve::shipped();
    let picked = curve.pick(limits, device::open, &mut first, frame, args.size);
    scene.settings = first.settings;
    // Errors name the limits by their options.
    let picked = picked.map_err(|error| match error {
        Error::Usage(problem) => Error::Usage(format!("--{}", problem.replacen('_', "-", 1))),
        error => error,
    })?;
    if let Some(Picked { choice: Choice { set, error_px, flip, .. }, ms }) = &picked {
        let set = set.join(" ");
        if !args.quiet {
            crate::terminal::warn(format!(
                "picked {set}: {error_px} px, FLIP {flip}, {ms:.3} ms a frame"
            ));
        }
    }
    Ok(picked)
}

/// Parses a number above 0.
pub(super) fn parse_limit(text: &str) -> Result<f64, &'static str> {
    let limit = text.parse().ok().filter(|limit: &f64| limit.is_finite() && *limit > 0.0);
    limit.ok_or("expected a number above 0")
}
