//! The contents of a report: rows of numbers, and the figures that go with them.

use std::str::FromStr;

use image::RgbImage;
use serde::{Deserialize, Serialize};

/// The kind of measurement of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RowKind {
    /// One intersection per pixel.
    Intersect,
    /// A smoothing filter on splatted layers.
    Smooth,
    /// A caustic map.
    Caustics,
    /// A whole picture.
    Picture,
    /// One pass of a frame, and its budget: [`Budget`](super::passes::Budget).
    Pass,
    /// The time saved by skipping work: [`Elision`](super::elisions::Elision).
    Elision,
}

impl FromStr for RowKind {
    type Err = &'static str;

    /// Reads a kind as `limpid report --kinds` names it.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "intersect" => Ok(Self::Intersect),
            "smooth" => Ok(Self::Smooth),
            "caustics" => Ok(Self::Caustics),
            "picture" => Ok(Self::Picture),
            "passes" => Ok(Self::Pass),
            "elisions" => Ok(Self::Elision),
            _ => Err("there are intersect, smooth, caustics, picture, passes and elisions"),
        }
    }
}

/// One measurement. Fields that do not apply to its kind, or could not be measured, are absent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The kind of measurement.
    pub kind: RowKind,
    /// The scene: a name of `sims/`, with `:view` for a further view.
    pub scene: String,
    /// The method: an intersector, a filter, a preset, a pass.
    pub method: String,
    /// The settings that distinguish it from the method's other rows; empty for its defaults.
    pub settings: String,
    /// Median time on the device, ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ms: Option<f64>,
    /// Half the interquartile range of the times, ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ms_spread: Option<f64>,
    /// Texels read per ray, mean.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fetches: Option<f64>,
    /// Evaluations of a layer per ray, mean; of a filter, its iterations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations: Option<f64>,
    /// Share of the solvable rays, whose true hit the layers show, that were solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solved_of_solvable: Option<f64>,
    /// Share of all rays that were solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solved_of_all: Option<f64>,
    /// Share of all rays with a wrong hit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wrong_accepts: Option<f64>,
    /// Root mean square distance of the solved hits from the truth, pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_px: Option<f64>,
    /// Of a caustic map: the light that it holds over the true light.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light_kept: Option<f64>,
    /// Of a caustic map: the share of the lit texels whose centre light reaches by several paths.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub several_paths: Option<f64>,
    /// Of a picture: the share of the liquid's pixels whose straight rays cross several intervals of the true
    /// liquid, with air between them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub several_intervals: Option<f64>,
    /// The error, smaller is better.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
    /// The measure of the error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_kind: Option<ErrorKind>,
    /// The ground truth that it is measured against.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<String>,
}

/// The measure of a row's error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ErrorKind {
    /// Share of all rays with a wrong answer: solvable rays that were not solved, and hits of
    /// unsolvable rays.
    RaysWrong,
    /// Median angle between normals, degrees.
    NormalMedianDegrees,
    /// 90th percentile of the angle between normals, degrees.
    NormalP90Degrees,
    /// Root mean square difference of depths over all pixels that both surfaces cover, particle
    /// radii.
    DepthRmsAllRadii,
    /// As [`ErrorKind::DepthRmsAllRadii`] without the tenth of the pixels with the largest
    /// differences: at silhouettes a pixel off is on another surface.
    #[serde(alias = "depth_rms_radii")]
    DepthRmsNineTenthsRadii,
    /// Mean FLIP of the whole picture (Andersson et al. 2020).
    MeanFlip,
    /// Mean FLIP over the pixels of the true liquid.
    FlipOfLiquid,
    /// Mean FLIP over the pixels whose rays cross one interval of the true liquid.
    FlipOneInterval,
    /// Mean FLIP over the pixels whose rays cross several intervals of the true liquid.
    FlipSeveralIntervals,
    /// Mean change of a picture's pixels from frame to frame while the camera orbits, over the truth's; more than 1
    /// is flicker.
    ChangeInOrbit,
    /// As [`ErrorKind::ChangeInOrbit`] while the particles move and the camera does not.
    ChangeInPlay,
    /// Relative L1 difference.
    RelativeL1,
    /// Relative L1 difference over the texels of a caustic map that light reaches by one path, as
    /// it does their neighbours.
    RelativeL1OnePath,
}

impl Row {
    /// Creates a row without figures.
    pub fn new(kind: RowKind, scene: &str, method: &str, settings: &str) -> Self {
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
            several_intervals: None,
            error: None,
            error_kind: None,
            truth: None,
        }
    }

    /// Sets the median and the spread of repeated times.
    #[must_use]
    pub fn timed(mut self, times: &[f64]) -> Self {
        let [low, middle, high] = [0.25, 0.5, 0.75].map(|share| quantile(times, share));
        self.ms = middle;
        self.ms_spread = low.zip(high).map(|(low, high)| 0.5 * (high - low));
        self
    }

    /// Sets the error.
    #[must_use]
    pub fn with_error(mut self, error: f64, kind: ErrorKind, truth: &str) -> Self {
        self.error = Some(error);
        self.error_kind = Some(kind);
        self.truth = Some(truth.into());
        self
    }
}

/// The quantile of some numbers, interpolated linearly; `None` without numbers.
fn quantile(numbers: &[f64], share: f64) -> Option<f64> {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = sorted.len().checked_sub(1)? as f64 * share;
    let (below, above) = (sorted[rank as usize], sorted[rank.ceil() as usize]);
    Some(below + rank.fract() * (above - below))
}

/// The median of some numbers; `None` without numbers.
pub(crate) fn median(numbers: &[f64]) -> Option<f64> {
    quantile(numbers, 0.5)
}

/// Order in which rays meet splashes (S) and aggregates (A) at their first two interfaces, as
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

/// Errors of pictures of extreme scenes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stress {
    /// The parameter that was varied.
    pub case: String,
    /// Number of pictures rendered.
    pub pictures: u32,
    /// Number of non-finite pixels among all of them: must be 0.
    pub not_finite: u64,
    /// Mean absolute difference of radiance from the truth, median over the pictures.
    pub median_error: f64,
    /// The largest mean absolute difference.
    pub worst_error: f64,
    /// Parameters of that picture, to reproduce it.
    pub worst: String,
}

/// Related pictures, shown in a row.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// The title.
    pub title: String,
    /// The scene.
    pub scene: String,
    /// Caption and picture; the first is the truth.
    pub panels: Vec<(String, RgbImage)>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Absent figures are omitted from `report.json`, not null, and its keys are the documented
    /// ones.
    #[test]
    fn absent_figures_are_omitted() {
        let row = Row::new(RowKind::Intersect, "pool", "guarded", "")
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
