//! The resolution of pictures while things move, chosen so that a slow machine stays responsive.

use glam::UVec2;

/// Target time of a draft, ms.
const TARGET_MS: f64 = 50.0;

/// Scales of width and height for drafts, largest first: few, because each change of size creates new
/// textures, and none so small that the liquid cannot be recognised.
const SCALES: [f64; 5] = [1.0, 0.75, 0.5, 0.375, 0.25];

/// Index of the scale that is used before any measurement.
const START: usize = 3;

/// Chooses the resolution of drafts from measured times.
///
/// Part of a picture's time does not depend on its size, so the time at one scale predicts little about
/// another: each scale is measured by itself, and estimated from its neighbours until then.
#[derive(Debug, Clone, Default)]
pub struct AdaptiveResolution {
    /// Measured times by scale, ms.
    known: [Option<f64>; SCALES.len()],
    full: UVec2,
}

impl AdaptiveResolution {
    /// Records that a picture of `size` took `ms`, in a window of `full` pixels.
    pub fn measured(&mut self, size: UVec2, full: UVec2, ms: f64) {
        if size.min_element() == 0 || full.min_element() == 0 || !ms.is_finite() {
            return;
        }
        self.resize(full);
        let scale = f64::from(size.y) / f64::from(full.y);
        let difference = |i: &usize| (SCALES[*i].ln() - scale.ln()).abs();
        let Some(i) = (0..SCALES.len()).min_by(|a, b| difference(a).total_cmp(&difference(b)))
        else {
            return;
        };
        // Slow outliers, such as frames that compiled pipelines, are forgotten sooner.
        let mean = |old: f64| if ms < old { 0.25 * old + 0.75 * ms } else { 0.5 * (old + ms) };
        self.known[i] = Some(self.known[i].map_or(ms, mean));
        // Liquid and settings change, so scales that were too slow are eventually tried again.
        for slower in self.known[..i].iter_mut().flatten() {
            *slower *= 0.995;
        }
    }

    fn resize(&mut self, full: UVec2) {
        if self.full != full && self.full.min_element() > 0 {
            let area = |size: UVec2| f64::from(size.x) * f64::from(size.y);
            for ms in self.known.iter_mut().flatten() {
                *ms *= area(full) / area(self.full);
            }
        }
        self.full = full;
    }

    /// Expected time of a picture at a scale, ms.
    fn expected(&self, i: usize) -> Option<f64> {
        let area = |i: usize| SCALES[i] * SCALES[i];
        let at = |j: usize| self.known[j].map(|ms| (area(j), ms));
        let larger = (0..i).rev().find_map(at);
        let mut below = (i + 1..SCALES.len()).filter_map(at);
        let (smaller, still_smaller) = (below.next(), below.next());
        let here = area(i);
        match (at(i), larger, smaller) {
            (Some((_, ms)), ..) => Some(ms),
            (_, Some((a, x)), Some((b, y))) => Some(y + (x - y) * (here - b) / (a - b)),
            // Part of the time does not depend on the size.
            (_, Some((a, x)), None) => Some(x * (0.1 + 0.9 * here / a)),
            (_, None, Some((b, y))) => Some(match still_smaller {
                Some((c, z)) => y + ((y - z) / (b - c)).max(0.0) * (here - b),
                None => y * (0.4 + 0.6 * here / b),
            }),
            (_, None, None) => None,
        }
    }

    /// Expected time of a picture at full size, ms; `None` before any measurement.
    pub fn full_ms(&self) -> Option<f64> {
        self.expected(0)
    }

    /// The scale of width and height for drafts: 1/4 to 1.
    pub fn scale(&self) -> f64 {
        if self.known.iter().all(Option::is_none) {
            return SCALES[START];
        }
        let last = SCALES.len() - 1;
        // If the size affects the time little, a coarse draft gains nothing.
        let limit = self
            .expected(last)
            .map_or(TARGET_MS, |least| TARGET_MS.max((1.4 * least).min(4.0 * TARGET_MS)));
        let fits = |i: &usize| self.expected(*i).is_some_and(|ms| ms <= limit);
        SCALES[(0..SCALES.len()).find(fits).unwrap_or(last)]
    }

    /// The size of a draft of a picture of `full` size.
    pub fn draft(&self, full: UVec2) -> UVec2 {
        (full.as_dvec2() * self.scale()).round().as_uvec2().max(UVec2::ONE).min(full)
    }
}
