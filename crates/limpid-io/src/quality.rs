//! Selection of settings by error or frame time: `limpid render --max-error` and `--budget`.
//!
//! The error of each choice was measured beforehand and is read from
//! `crates/limpid-io/src/quality.toml`, which `limpid report --curve` writes: errors are the same
//! on every adapter. The cost of a choice depends on adapter and size: [`calibration`] measures it. The
//! [`controller`] keeps a budget over a sequence.

#[cfg(not(target_arch = "wasm32"))]
pub mod calibration;
pub mod controller;

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

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

/// One of a curve's lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum List {
    /// [`Curve::intersectors`].
    Intersectors,
    /// [`Curve::pictures`].
    Pictures,
}

impl Limits {
    /// The list to choose from: whole pictures with a budget.
    pub fn list(self) -> List {
        if self.budget.is_some() { List::Pictures } else { List::Intersectors }
    }
}

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

    /// The choices of a list, the defaults first.
    pub fn choices(&self, list: List) -> &[Choice] {
        match list {
            List::Intersectors => &self.intersectors,
            List::Pictures => &self.pictures,
        }
    }

    /// Indices of the choices of [`Limits::list`] that satisfy the error limit. The defaults are among them
    /// if they do.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the smallest error, if even that exceeds the limit.
    pub fn candidates(&self, limits: Limits) -> Result<Vec<usize>> {
        let all = self.choices(limits.list());
        let Some(max_error) = limits.max_error else { return Ok((0..all.len()).collect()) };
        let exact_enough: Vec<_> =
            (0..all.len()).filter(|&i| all[i].error_px <= max_error).collect();
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

    /// Picks by an error limit without a budget: of the candidates, the most exact of those that are as fast
    /// as the fastest, or slower by no more than [`NOISE`]. A looser limit therefore never picks slower
    /// settings, but for noise. `costs` are those of the limits' list. Returns an index into that.
    ///
    /// # Errors
    /// As [`Curve::candidates`].
    ///
    /// # Panics
    /// If `costs` has another length than the list.
    pub fn fastest(&self, limits: Limits, costs: &[f64]) -> Result<usize> {
        let (all, candidates) = (self.choices(limits.list()), self.candidates(limits)?);
        assert_eq!(costs.len(), all.len(), "a cost for each choice");
        let least = candidates.iter().map(|&i| costs[i]).fold(f64::INFINITY, f64::min);
        let alike = candidates.into_iter().filter(|&i| costs[i] <= (1.0 + NOISE) * least);
        let best = alike.min_by(|&a, &b| all[a].error_px.total_cmp(&all[b].error_px));
        best.ok_or_else(|| Error::Usage("nothing to pick".into()))
    }

    /// Choices of a budget: the candidates from the best picture to the cheapest, each cheaper than all
    /// before. Those whose hits are worse than the defaults' come last. So where the defaults keep a budget,
    /// nothing with worse hits or a worse picture is the first that does, and a larger budget never finds a
    /// worse one. `costs` are those of the limits' list. Returns indices into that, one at least.
    ///
    /// # Errors
    /// As [`Curve::candidates`].
    ///
    /// # Panics
    /// If `costs` has another length than the list.
    pub fn ladder(&self, limits: Limits, costs: &[f64]) -> Result<Vec<usize>> {
        let (all, mut candidates) = (self.choices(limits.list()), self.candidates(limits)?);
        assert_eq!(costs.len(), all.len(), "a cost for each choice");
        let default = self.intersectors.first().map_or(f64::INFINITY, |d| d.error_px);
        let worse = |i: usize| all[i].error_px > default;
        candidates.sort_by(|&a, &b| {
            (worse(a).cmp(&worse(b)))
                .then(all[a].flip.total_cmp(&all[b].flip))
                .then(all[a].error_px.total_cmp(&all[b].error_px))
                .then(costs[a].total_cmp(&costs[b]))
        });
        let mut least = f64::INFINITY;
        candidates.retain(|&i| {
            let cheaper = costs[i] < least;
            least = least.min(costs[i]);
            cheaper
        });
        Ok(candidates)
    }
}
