//! Speed against error, both measured in one run: `limpid report`.
//!
//! - [`intersect`]: one intersection per pixel by each intersector, against the same layers
//!   intersected exactly or the opaque scene itself.
//! - [`smooth`]: the surface after each smoothing filter, against the true surface.
//! - [`caustics`]: light through liquid by each method, against light traced in f64.
//! - [`picture`]: whole frames by the presets, against path-traced pictures.
//! - [`flicker`]: the change of pictures from frame to frame, against that of path-traced pictures.
//! - [`stress`]: extreme scales, positions, fields of view and indices, against a closed form.
//! - [`passes`]: time of each pass, against the time that its memory traffic and arithmetic need at
//!   the adapter's peak rates.
//! - [`elisions`]: work skipped when a frame does not need it, and the time that this saves.
//! - [`against`]: errors that have increased since an earlier report.
//! - [`curve`]: the measurements that `limpid render --max-error` and `--budget` choose from.
//!
//! Times are device timestamps. Methods are interleaved, after a warm-up; a row has the median and
//! half the interquartile range.

pub mod against;
pub mod caustics;
pub mod curve;
pub mod elisions;
pub mod flicker;
mod html;
pub mod intersect;
mod markdown;
mod output;
pub mod passes;
pub mod picture;
mod plot;
pub mod rates;
mod rows;
#[cfg(test)]
mod sample;
pub mod shaders;
pub mod smooth;
pub mod stress;
pub mod subjects;

pub use html::html;
pub use markdown::markdown;
pub use output::Output;
pub use plot::pareto;
pub use rows::{ErrorKind, Figure, Orders, Row, RowKind, Stress};

use elisions::{Elision, Frame};
use limpid::gpu::Gpu;
use limpid::renderer::Renderer;
use limpid_io::error::Result;
use passes::Budget;
use picture::Effort;
use rates::Rates;
use serde::Serialize;
use subjects::Subject;

/// Options of a report.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Options {
    /// Small pictures and few methods: a few minutes on two cores without a GPU.
    pub quick: bool,
    /// Width of traced pictures, pixels; 320 or 1024 if absent.
    pub width: Option<u32>,
    /// Names of scenes; all if empty.
    pub scenes: Vec<String>,
    /// Kinds of rows; all if empty.
    pub kinds: Vec<RowKind>,
}

/// The measurements made on each scene: intersections, smoothing, caustics, pictures.
const SCENES: [(&str, [bool; 4]); 12] = [
    ("pool", [true, true, true, true]),
    ("reef", [true, false, false, false]),
    ("drop", [true, true, false, true]),
    ("slab", [true, false, false, true]),
    ("idol", [true, false, false, true]),
    ("breaker", [true, true, false, true]),
    ("cascade", [true, false, true, true]),
    ("demo", [true, false, false, true]),
    ("lagoon", [false, false, true, true]),
    ("glass_ball", [false, false, true, true]),
    ("vase", [false, false, true, true]),
    ("dam", [false, false, true, true]),
];

/// Scenes whose passes are budgeted by default: one with splashes, light and shadow; one with
/// 250,000 particles; one without light.
const BUDGETED: [&str; 4] = ["cascade", "pool", "vase", "demo"];

/// The results of all measurements.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// The adapter and its driver.
    pub adapter: String,
    /// Whether it is the short form.
    pub quick: bool,
    /// The measurements.
    pub rows: Vec<Row>,
    /// Peak rates of the adapter, if passes were budgeted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rates: Option<Rates>,
    /// Budgets of passes.
    pub budgets: Vec<Budget>,
    /// Time saved by skipping work.
    pub elisions: Vec<Elision>,
    /// Shares of the orders in which rays meet splashes and aggregates.
    pub orders: Vec<Orders>,
    /// Errors in extreme scenes.
    pub stress: Vec<Stress>,
    /// Pictures; not in the JSON.
    #[serde(skip)]
    pub figures: Vec<Figure>,
}

/// Runs all measurements, reporting each step to `progress`.
///
/// # Errors
/// [`limpid_io::Error::Usage`] for an unknown scene; as [`Renderer::render`].
pub fn measure(gpu: &Gpu, options: &Options, progress: &mut dyn FnMut(&str)) -> Result<Report> {
    let mut report = Report {
        adapter: gpu.adapter(),
        quick: options.quick,
        rows: Vec::new(),
        rates: None,
        budgets: Vec::new(),
        elisions: Vec::new(),
        orders: Vec::new(),
        stress: Vec::new(),
        figures: Vec::new(),
    };
    let effort = if options.quick {
        Effort { width: 320, truth_samples: 4, repeats: 3, variants: false }
    } else {
        Effort { width: 1024, truth_samples: 16, repeats: 7, variants: true }
    };
    let effort = Effort { width: options.width.unwrap_or(effort.width), ..effort };
    let mut renderer = Renderer::new(gpu);
    for name in &options.scenes {
        // Unknown names are reported before an hour of measuring.
        if options.kinds != [RowKind::Pass] || !subjects::is_file(name) {
            subjects::check(name)?;
        }
    }
    let asked = |kind: RowKind| options.kinds.contains(&kind);
    let all = options.scenes.is_empty() && options.kinds.is_empty();
    for (name, [intersect, smooth, caustics, picture]) in SCENES {
        if !options.scenes.is_empty() && !options.scenes.iter().any(|wanted| wanted == name) {
            continue;
        }
        // The short form omits slow measurements unless the scene is named.
        let short = options.quick && options.scenes.is_empty();
        let picture = picture && !(short && caustics && name != "cascade");
        let caustics = caustics && !(short && name != "pool");
        let wanted = |kind: RowKind| options.kinds.is_empty() || options.kinds.contains(&kind);
        let [intersect, smooth, caustics, picture] = [
            intersect && wanted(RowKind::Intersect),
            smooth && wanted(RowKind::Smooth),
            caustics && wanted(RowKind::Caustics),
            picture && wanted(RowKind::Picture),
        ];
        if !(intersect || smooth || caustics || picture) {
            continue;
        }
        progress(&format!("{name}: scene and truth"));
        let subject = Subject::new(name)?;
        if intersect {
            progress(&format!("{name}: intersectors"));
            intersect::report(gpu, &mut renderer, &subject, options.quick, &mut report)?;
        }
        if smooth {
            progress(&format!("{name}: smoothing"));
            report.rows.extend(smooth::measure(gpu, &mut renderer, &subject, &effort)?);
        }
        if caustics {
            progress(&format!("{name}: caustics"));
            report.rows.extend(caustics::measure(gpu, &subject, options.quick)?);
        }
        if picture {
            progress(&format!("{name}: pictures"));
            let (rows, figure) = picture::measure(gpu, &mut renderer, &subject, &effort)?;
            report.rows.extend(rows);
            report.figures.push(figure);
            if !subject.scene.is_lit() && (!options.quick || name == "demo") {
                progress(&format!("{name}: flicker"));
                report.rows.extend(flicker::measure(gpu, &mut renderer, &subject, &effort)?);
            }
        }
    }
    if all || asked(RowKind::Pass) {
        progress("rates");
        report.rates = rates::measure(gpu)?;
        for name in budgeted(options) {
            progress(&format!("{name}: passes"));
            let (rates, repeats) = (report.rates, effort.repeats.max(5));
            let budgets =
                passes::measure(gpu, &mut renderer, rates.as_ref(), name, effort.width, repeats)?;
            report.budgets.extend(budgets);
        }
    }
    if all && !options.quick || asked(RowKind::Elision) {
        progress("skipped work");
        let (_, project, loaded) = subjects::load("demo")?;
        let scene = project.scene.clone();
        let (camera, splats) = (project.camera_for(loaded.bulk.bounds), loaded.splats);
        let (frame, size) = (Frame { scene, camera, splats }, subjects::size("demo", effort.width));
        report.elisions = elisions::measure(gpu, &mut renderer, &frame, size, effort.repeats)?;
    }
    if all {
        progress("extreme scenes");
        let pictures = if options.quick { 3 } else { 100 };
        report.stress = stress::measure(gpu, &mut renderer, pictures)?;
    }
    Ok(report)
}

/// The scenes whose passes are budgeted.
fn budgeted(options: &Options) -> Vec<&str> {
    match (&options.scenes[..], options.quick) {
        ([], true) => vec![BUDGETED[0]],
        ([], false) => BUDGETED.to_vec(),
        (scenes, _) => scenes.iter().map(String::as_str).collect(),
    }
}
