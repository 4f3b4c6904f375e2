//! What a report holds: rows of numbers, and the figures that go with them.

use image::RgbImage;
use serde::{Deserialize, Serialize};

use super::elisions::Elision;
use super::passes::Budget;
use super::rates::Rates;

/// What a row measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// One intersection per pixel.
    Intersect,
    /// A smoothing filter on splatted layers.
    Smooth,
    /// A caustic map.
    Caustics,
    /// A whole picture.
    Picture,
    /// One pass of a frame, and its budget: [`Budget`].
    Pass,
    /// What leaving out saves: [`Elision`].
    Elision,
}

/// One measurement. What does not apply to its kind, or could not be measured, is absent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// What was measured.
    pub kind: Kind,
    /// On which scene: a name of `sims/`, with `:view` for a further view.
    pub scene: String,
    /// Which method: an intersector, a filter, a preset, a pass.
    pub method: String,
    /// What distinguishes it from the method's other rows; empty for its defaults.
    pub settings: String,
    /// Median time on the device, ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ms: Option<f64>,
    /// Half the range between the quartiles of the times, ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ms_spread: Option<f64>,
    /// Texels read per ray, mean.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fetches: Option<f64>,
    /// Evaluations of a layer per ray, mean; of a filter, its iterations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations: Option<f64>,
    /// Rays solved, of those whose true hit the layers show.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solved_of_solvable: Option<f64>,
    /// Rays solved, of all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solved_of_all: Option<f64>,
    /// Rays with a hit that is wrong, of all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wrong_accepts: Option<f64>,
    /// Root mean square distance of the solved hits from the truth, pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_px: Option<f64>,
    /// Of a caustic map: the light that it holds over that which the truth sends there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light_kept: Option<f64>,
    /// Of a caustic map: texels to whose centre light comes by several paths, of those to which it
    /// comes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub several_paths: Option<f64>,
    /// The error, smaller is better.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
    /// What the error is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_kind: Option<ErrorKind>,
    /// What it is measured against.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<String>,
}

/// The measure of a row's error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ErrorKind {
    /// Share of all rays that were answered other than by the truth: solvable ones that were not
    /// solved, and hits of rays that cannot be solved.
    RaysWrong,
    /// Median angle between normals, degrees.
    NormalMedianDegrees,
    /// Angle between normals that 90 % of the pixels do not exceed, degrees.
    NormalP90Degrees,
    /// Root mean square difference of depths over all pixels that both surfaces cover, particle
    /// radii.
    DepthRmsAllRadii,
    /// As [`ErrorKind::DepthRmsAllRadii`] without the tenth of the pixels that differ most: at
    /// silhouettes a pixel more or less is another surface.
    #[serde(alias = "depth_rms_radii")]
    DepthRmsNineTenthsRadii,
    /// Mean FLIP of the whole picture (Andersson et al. 2020).
    MeanFlip,
    /// Relative L1 difference.
    RelativeL1,
    /// Relative L1 difference over the texels of a caustic map to which, and to whose neighbours,
    /// light comes by one path.
    RelativeL1OnePath,
}

impl Row {
    /// A row without figures.
    pub fn new(kind: Kind, scene: &str, method: &str, settings: &str) -> Self {
        Self {
            kind,
            scene: scene.into(),
            method: method.into(),
            settings: settings.into(),
            ms: None,
            ms_spread: None,
            fetches: None,
            iterations: None,
            solved_of_solvable: None,
            solved_of_all: None,
            wrong_accepts: None,
            rms_px: None,
            light_kept: None,
            several_paths: None,
            error: None,
            error_kind: None,
            truth: None,
        }
    }

    /// The row with the median and spread of repeated times.
    #[must_use]
    pub fn timed(mut self, times: &[f64]) -> Self {
        let [low, middle, high] = [0.25, 0.5, 0.75].map(|share| quantile(times, share));
        self.ms = middle;
        self.ms_spread = low.zip(high).map(|(low, high)| 0.5 * (high - low));
        self
    }

    /// The row with an error.
    #[must_use]
    pub fn with_error(mut self, error: f64, kind: ErrorKind, truth: &str) -> Self {
        self.error = Some(error);
        self.error_kind = Some(kind);
        self.truth = Some(truth.into());
        self
    }
}

/// The number that a share of the given ones does not exceed, interpolated between two; none of none.
fn quantile(numbers: &[f64], share: f64) -> Option<f64> {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = sorted.len().checked_sub(1)? as f64 * share;
    let (below, above) = (sorted[rank as usize], sorted[rank.ceil() as usize]);
    Some(below + rank.fract() * (above - below))
}

/// The middle of some numbers; none of none.
pub(crate) fn median(numbers: &[f64]) -> Option<f64> {
    quantile(numbers, 0.5)
}

/// In which order rays meet splashes (S) and aggregates (A) at their first two interfaces, as
/// shares of the rays that have two (Imai et al. 2016, captions of figures 7 and 8).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Orders {
    /// The scene.
    pub scene: String,
    /// Into a splash, out of a splash.
    pub ss: f64,
    /// Into a splash, out of an aggregate.
    pub sa: f64,
    /// Into an aggregate, out of a splash.
    #[serde(rename = "as")]
    pub as_: f64,
    /// Into an aggregate, out of an aggregate.
    pub aa: f64,
}

/// Pictures of extreme scenes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stress {
    /// What was varied.
    pub case: String,
    /// Pictures drawn.
    pub pictures: u32,
    /// Pixels among all of them that are not finite: must be 0.
    pub not_finite: u64,
    /// Mean absolute difference of radiance from the truth: median over the pictures.
    pub median_error: f64,
    /// And the largest.
    pub worst_error: f64,
    /// Settings of the largest, to find it again.
    pub worst: String,
}

/// Pictures that belong together, in a row.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// What they show.
    pub title: String,
    /// The scene.
    pub scene: String,
    /// Caption and picture; the first is the truth.
    pub panels: Vec<(String, RgbImage)>,
}

/// All that was measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// The adapter and its driver.
    pub adapter: String,
    /// Whether it is the short form.
    pub quick: bool,
    /// The measurements.
    pub rows: Vec<Row>,
    /// What the adapter moves and computes at best, if passes were budgeted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rates: Option<Rates>,
    /// Budgets of passes.
    pub budgets: Vec<Budget>,
    /// What leaving out saves.
    pub elisions: Vec<Elision>,
    /// Order shares.
    pub orders: Vec<Orders>,
    /// Extreme scenes.
    pub stress: Vec<Stress>,
    /// Pictures; not in the JSON.
    #[serde(skip)]
    pub figures: Vec<Figure>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Protects the form of `report.json`: what does not apply is absent, not null, and the names
    /// are those that are documented.
    #[test]
    fn absent_figures_are_not_written() {
        let row = Row::new(Kind::Intersect, "pool", "guarded", "")
            .timed(&[3.0, 1.0, 2.0])
            .with_error(0.01, ErrorKind::RaysWrong, "exact layers");
        let json = serde_json::to_string(&row).expect("a row is JSON");
        assert_eq!(
            json,
            r#"{"kind":"intersect","scene":"pool","method":"guarded","settings":"","ms":2.0,"#
                .to_owned()
                + r#""ms_spread":0.5,"error":0.01,"error_kind":"rays_wrong","truth":"exact layers"}"#
        );
    }
}
