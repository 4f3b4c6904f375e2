//! Calibration: how long frames take with each choice of settings on an adapter at a size, relative to the
//! defaults.
//!
//! Measured on the built-in demo, a dam break, so that costs do not depend on what is drawn first.

use std::time::Instant;

use glam::UVec2;

use super::{Choice, List, NOISE};
use crate::error::Result;
use crate::input::{FrameTime, Input};
use crate::project::overrides::replaced;
use crate::shared_classifier::Processor;
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::offscreen::Offscreen;
use limpid::scene::Scene;
use limpid::settings::Settings;

/// Number of timed frames of a choice; its cost is their median.
const ROUNDS: usize = 3;

/// Size of the pictures, pixels, with which drivers compile the shaders.
const COMPILING_SIZE: UVec2 = UVec2::new(64, 48);

/// Measures the cost of each of `choices`, the curve's `list`: device time of a frame of `size` pixels over
/// that with the first choice, which are the defaults. The costs are in the order of the choices, and the
/// first is 1.
///
/// Each choice draws a small frame, which may compile shaders, and up to three timed ones, by turns; choices that
/// are [`dominated`] after the first of these draw no more.
///
/// # Errors
/// As [`Renderer::render`](limpid::renderer::Renderer::render).
pub fn measure(gpu: &Gpu, list: List, choices: &[Choice], size: UVec2) -> Result<Vec<f64>> {
    let (input, project) = Input::demo()?.resolve()?;
    // As reports classify: costs do not depend on where classification runs.
    let input = input.processed_by(Processor::Cpu);
    let frame = FrameTime::at(input.sequence.frames[0].number);
    let loaded = input.load(frame, &project.scene)?;
    let camera = project.camera_for(loaded.bulk.bounds);
    let scenes: Vec<Scene> = choices
        .iter()
        .map(|choice| {
            let settings = replaced(&Settings::default(), &choice.set)?;
            Ok(Scene { settings, ..project.scene.clone() })
        })
        .collect::<Result<_>>()?;
    let mut offscreen = Offscreen::new(gpu);
    for scene in &scenes {
        let size = size.min(COMPILING_SIZE);
        offscreen.draw(loaded.picture(scene, &camera, size))?;
    }
    let mut time = |i: usize| frame_ms(&mut offscreen, loaded.picture(&scenes[i], &camera, size));
    let mut ratios = vec![Vec::new(); choices.len()];
    let mut remaining: Vec<usize> = (1..choices.len()).collect();
    for _ in 0..ROUNDS {
        // Ratios of frames that were drawn one after the other: the speed of a machine that does other
        // work too changes from round to round.
        let default = time(0)?;
        for &i in &remaining {
            ratios[i].push(time(i)? / default);
        }
        let costs: Vec<f64> = ratios.iter().map(|ratios| median(ratios)).collect();
        remaining.retain(|&i| !dominated(list, choices, &costs, i));
    }
    Ok(ratios.iter().map(|ratios| median(ratios)).collect())
}

impl Choice {
    /// Whether this is picked rather than `other`, whatever the limits, unless it is slower.
    fn is_as_good(&self, other: &Self, list: List) -> bool {
        self.error_px <= other.error_px && (list == List::Intersectors || self.flip <= other.flip)
    }
}

/// Whether a choice is never picked, whatever the limits: another that is at least as good is clearly
/// faster, by more than twice [`NOISE`].
///
/// # Panics
/// If there are fewer costs than choices, or `i` is out of range.
pub fn dominated(list: List, choices: &[Choice], costs: &[f64], i: usize) -> bool {
    let mut others = choices.iter().zip(costs);
    others.any(|(other, cost)| {
        other.is_as_good(&choices[i], list) && (1.0 + 2.0 * NOISE) * cost < costs[i]
    })
}

/// Draws a whole frame and returns its device time, ms: of all passes, or wall-clock time where the adapter
/// has no timestamps.
///
/// # Errors
/// As [`Renderer::render`](limpid::renderer::Renderer::render).
pub fn frame_ms(offscreen: &mut Offscreen, input: FrameInput<'_>) -> Result<f64> {
    let begun = Instant::now();
    let frame = offscreen.draw(FrameInput { timing: true, reuse: false, ..input })?;
    Ok(match &*frame.passes {
        [] => 1e3 * begun.elapsed().as_secs_f64(),
        passes => passes.iter().map(|pass| pass.ms).sum(),
    })
}

/// The median; 1 of no ratios, which are those of the defaults.
fn median(ratios: &[f64]) -> f64 {
    let mut sorted = ratios.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(1.0)
}
