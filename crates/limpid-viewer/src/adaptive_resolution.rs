//! How large a picture is drawn while things move, so that a slow machine stays responsive.

use glam::UVec2;

/// What a draft may take, ms.
const AIM: f64 = 50.0;

/// Shares of the full width and height that drafts are drawn at, the largest first: few, because
/// each change of size makes new textures.
const SCALES: [f64; 7] = [1.0, 0.75, 0.5, 0.375, 0.25, 0.1875, 0.125];

/// The scale before anything is known.
const START: usize = 4;

/// What is drawn at a moment, from moving to long at rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// A lower resolution, one ray per pixel.
    Draft,
    /// Full resolution, one ray per pixel.
    Full,
    /// Full resolution, several rays per pixel.
    Fine,
}

/// Chooses the resolution of drafts by the times that pictures have taken.
///
/// A picture's time has a part that does not depend on its size, so what one scale takes says
/// little of another: each is known by itself, and guessed from its neighbours until it has been
/// tried.
#[derive(Debug, Clone, Default)]
pub struct AdaptiveResolution {
    /// Times by scale, ms.
    known: [Option<f64>; SCALES.len()],
    full: UVec2,
}

impl AdaptiveResolution {
    /// A picture of `size` took so long, where the window's has `full` pixels.
    pub fn measured(&mut self, size: UVec2, full: UVec2, ms: f64) {
        if size.min_element() == 0 || full.min_element() == 0 || !ms.is_finite() {
            return;
        }
        self.resize(full);
        let scale = f64::from(size.y) / f64::from(full.y);
        let off = |i: &usize| (SCALES[*i].ln() - scale.ln()).abs();
        let Some(i) = (0..SCALES.len()).min_by(|a, b| off(a).total_cmp(&off(b))) else { return };
        // What was slow once, because something was compiled, is forgotten sooner.
        let mean = |old: f64| if ms < old { 0.25 * old + 0.75 * ms } else { 0.5 * (old + ms) };
        self.known[i] = Some(self.known[i].map_or(ms, mean));
        // Liquid and settings change: what was too slow once is tried again some day.
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

    /// What a picture at a scale should take, ms.
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
            // A part is the same whatever the size.
            (_, Some((a, x)), None) => Some(x * (0.1 + 0.9 * here / a)),
            (_, None, Some((b, y))) => Some(match still_smaller {
                Some((c, z)) => y + ((y - z) / (b - c)).max(0.0) * (here - b),
                None => y * (0.4 + 0.6 * here / b),
            }),
            (_, None, None) => None,
        }
    }

    /// The share of the full width and height for drafts: 1/8 to 1.
    pub fn scale(&self) -> f64 {
        if self.known.iter().all(Option::is_none) {
            return SCALES[START];
        }
        let last = SCALES.len() - 1;
        // Where the size matters little, coarse pictures would be coarse for nothing.
        let limit = self.expected(last).map_or(AIM, |least| AIM.max((1.4 * least).min(4.0 * AIM)));
        let fits = |i: &usize| self.expected(*i).is_some_and(|ms| ms <= limit);
        SCALES[(0..SCALES.len()).find(fits).unwrap_or(last)]
    }

    /// The size of a draft of a picture of `full` size.
    pub fn draft(&self, full: UVec2) -> UVec2 {
        (full.as_dvec2() * self.scale()).round().as_uvec2().max(UVec2::ONE).min(full)
    }
}
