//! The controller of `limpid render --budget`: the settings of each frame of a sequence, from the times of
//! the frames before.

use std::collections::VecDeque;

/// Share of the budget that predictions leave free, since frames differ from the ones before and times
/// vary by [`NOISE`](super::NOISE).
pub const MARGIN: f64 = 0.1;

/// Number of frames since the last change after which the picture may improve, and over which the better
/// settings must have fitted, so that pictures do not flicker.
pub const HOLD: usize = 6;

/// Largest factor by which one frame raises a cost: the frame may have been slow for another reason.
const MAX_RAISE: f64 = 1.5;

/// Share of a raise that remains after each further frame, so that the settings are tried again.
const RAISE_KEPT: f64 = 0.98;

/// Chooses the settings of each frame such that it takes at most a budget.
///
/// Settings are *rungs*, numbered from 0, the best picture, each cheaper than those before. A frame's time
/// over the cost of its rung is its *load*, the time that it would take with the defaults; the next frame is
/// predicted to have the same. A rung that is predicted to exceed the budget is left at once, for the best
/// that fits. The way back is taken when a better rung would have fitted in all of the last [`HOLD`] frames.
/// Should it turn out slower than predicted, its cost is raised for some time.
///
/// It reads no clock: times are given to it.
#[derive(Debug, Clone)]
pub struct Controller {
    budget: f64,
    /// Cost of each rung.
    costs: Vec<f64>,
    /// Factor by which each cost is raised, at least 1.
    raises: Vec<f64>,
    rung: usize,
    /// Loads of the last frames, the latest last, ms.
    loads: VecDeque<f64>,
    /// Number of frames drawn since the last change.
    since: usize,
    /// The rung changed to for a better picture, not drawn with yet, and the load before, ms.
    risen: Option<(usize, f64)>,
    first_ms: f64,
    kept: Kept,
}

/// How a budget was kept.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Kept {
    /// Number of frames.
    pub frames: usize,
    /// Number of frames that took longer than the budget.
    pub over: usize,
    /// The longest time of a frame, ms.
    pub longest_ms: f64,
    /// Number of those over the budget that were drawn with the cheapest settings.
    pub over_at_cheapest: usize,
}

impl Controller {
    /// Finds the settings of the first frame: `costs` are those of the rungs over that of the defaults, and
    /// `probe` draws the frame with a rung and returns its time, ms. The budget is kept by that frame unless
    /// [`Controller::first_ms`] exceeds it; then no rung keeps it.
    ///
    /// # Errors
    /// That of `probe`.
    ///
    /// # Panics
    /// Without rungs.
    pub fn start<E>(
        budget: f64,
        costs: Vec<f64>,
        mut probe: impl FnMut(usize) -> Result<f64, E>,
    ) -> Result<Self, E> {
        let cheapest = costs.len() - 1;
        let mut start = Self {
            budget,
            raises: vec![1.0; costs.len()],
            // The one nearest to the defaults.
            rung: costs.iter().position(|cost| *cost <= 1.0).unwrap_or(cheapest),
            costs,
            loads: VecDeque::new(),
            since: 0,
            risen: None,
            first_ms: 0.0,
            kept: Kept::default(),
        };
        // All better rungs than this are too slow. From a rung that fits the search goes to better ones only,
        // and from others never back, so it ends.
        let mut best = 0;
        loop {
            start.first_ms = probe(start.rung)?;
            let fitting = start.fitting(start.first_ms / start.costs[start.rung]);
            if fitting > start.rung {
                best = start.rung + 1;
            }
            let next = fitting.max(best);
            if next == start.rung {
                break;
            }
            start.rung = next;
        }
        if start.first_ms > budget {
            // A single time may be that of a disturbance.
            let mut times = [start.first_ms, probe(start.rung)?, probe(start.rung)?];
            times.sort_by(f64::total_cmp);
            start.first_ms = times[1];
        }
        Ok(start)
    }

    /// Time of the first frame with its settings, ms.
    pub fn first_ms(&self) -> f64 {
        self.first_ms
    }

    /// The rung of the next frame.
    pub fn rung(&self) -> usize {
        self.rung
    }

    /// How the budget has been kept.
    pub fn kept(&self) -> Kept {
        self.kept
    }

    /// Takes the time of a frame, ms, and the rung that it was drawn with, which is that of an earlier
    /// [`Controller::rung`] if frames are submitted before the times of the ones before are known.
    ///
    /// # Panics
    /// If there is no such rung.
    pub fn observe(&mut self, rung: usize, ms: f64) {
        let (over, cheapest) = (ms > self.budget, self.costs.len() - 1);
        self.kept.frames += 1;
        self.kept.over += usize::from(over);
        self.kept.over_at_cheapest += usize::from(over && rung == cheapest);
        self.kept.longest_ms = self.kept.longest_ms.max(ms);
        for raise in &mut self.raises {
            *raise = 1.0 + RAISE_KEPT * (*raise - 1.0);
        }
        if let Some((_, before)) = self.risen.take_if(|(risen, _)| *risen == rung) {
            let predicted = before * self.cost(rung);
            if ms > self.allowed() && ms > predicted {
                self.raises[rung] *= (ms / predicted).min(MAX_RAISE);
            }
        }
        let load = ms / self.cost(rung);
        self.loads.push_back(load);
        if self.loads.len() > HOLD {
            self.loads.pop_front();
        }
        self.since += 1;
        let next = self.fitting(load);
        let at_peak = self.fitting(self.loads.iter().copied().fold(load, f64::max));
        if next > self.rung {
            self.change(next);
        } else if self.since >= HOLD && at_peak < self.rung {
            self.change(at_peak);
            self.risen = Some((at_peak, load));
        }
    }

    fn change(&mut self, rung: usize) {
        (self.rung, self.since, self.risen) = (rung, 0, None);
    }

    /// Longest time that is predicted of a frame, ms.
    fn allowed(&self) -> f64 {
        (1.0 - MARGIN) * self.budget
    }

    fn cost(&self, rung: usize) -> f64 {
        self.costs[rung] * self.raises[rung]
    }

    /// The best rung that keeps the budget at this load, ms; the cheapest if none does.
    fn fitting(&self, load: f64) -> usize {
        let fits = |&rung: &usize| load * self.cost(rung) <= self.allowed();
        (0..self.costs.len()).find(fits).unwrap_or(self.costs.len() - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Costs of rungs, as calibrated.
    const COSTS: [f64; 5] = [1.4, 1.0, 0.8, 0.6, 0.35];

    const BUDGET: f64 = 100.0;

    /// Draws frames of these loads, whose times are known `late` frames later, where rungs cost `costs` in
    /// truth; returns the rung and the time of each, and how the budget was kept.
    fn played(costs: [f64; 5], loads: &[f64], late: usize) -> (Vec<usize>, Vec<f64>, Kept) {
        let probe = |rung: usize| Ok::<_, ()>(costs[rung] * loads[0]);
        let mut controller = Controller::start(BUDGET, COSTS.to_vec(), probe).unwrap();
        let (mut rungs, mut times) = (Vec::new(), Vec::new());
        for (i, load) in loads.iter().enumerate() {
            if let Some(known) = i.checked_sub(late + 1) {
                controller.observe(rungs[known], times[known]);
            }
            rungs.push(controller.rung());
            times.push(costs[controller.rung()] * load);
        }
        for i in loads.len().saturating_sub(late + 1)..loads.len() {
            controller.observe(rungs[i], times[i]);
        }
        let kept = controller.kept();
        assert_eq!(kept.over, times.iter().filter(|ms| **ms > BUDGET).count());
        assert_eq!(kept.frames, times.len());
        (rungs, times, kept)
    }

    /// Number of changes from one frame to the next.
    fn changes(rungs: &[usize]) -> usize {
        rungs.windows(2).filter(|pair| pair[0] != pair[1]).count()
    }

    /// Times that vary by ± `noise`, from a fixed sequence.
    fn noisy(load: f64, noise: f64, frames: usize) -> Vec<f64> {
        // The golden ratio's multiples are spread evenly.
        (0..frames)
            .map(|i| load * (1.0 + noise * (2.0 * (i as f64 * 0.618_034).fract() - 1.0)))
            .collect()
    }

    /// The first frame has the best settings that are predicted to keep the budget, found in few probes, and
    /// a larger budget never has worse ones.
    #[test]
    fn the_first_frame_has_the_best_settings_that_fit() {
        let mut last = usize::MAX;
        for budget in (36..400).map(f64::from) {
            let mut probes = 0;
            let controller = Controller::start(budget, COSTS.to_vec(), |rung| {
                probes += 1;
                Ok::<_, ()>(100.0 * COSTS[rung])
            });
            let controller = controller.unwrap();
            let fits = |cost: &f64| 100.0 * cost <= (1.0 - MARGIN) * budget;
            assert_eq!(controller.rung(), COSTS.iter().position(fits).unwrap_or(4), "{budget}");
            assert_eq!(controller.first_ms(), 100.0 * COSTS[controller.rung()]);
            assert!(controller.rung() <= last && probes <= 2, "{budget}: {probes}");
            last = controller.rung();
        }
        assert_eq!(last, 0, "an ample budget has the best picture");
    }

    /// Where the calibration does not hold for the scene, the first frame's own times decide.
    #[test]
    fn the_first_frame_is_measured() {
        // Rungs 2 and 3 are no cheaper than the defaults here.
        let costs = [1.4, 1.0, 1.0, 1.0, 0.35];
        let (rungs, times, kept) = played(costs, &[120.0; 20], 0);
        assert_eq!(rungs[0], 4, "{times:?}");
        assert!(kept.over <= 1, "one is tried once: {times:?}");
        // Nor is any other.
        let mut probes = Vec::new();
        let controller = Controller::start(BUDGET, COSTS.to_vec(), |rung| {
            probes.push(rung);
            Ok::<_, ()>(120.0)
        });
        let controller = controller.unwrap();
        assert_eq!((controller.rung(), controller.first_ms()), (4, 120.0), "hopeless");
        assert!(probes.len() <= 7, "{probes:?}");
        // A disturbance of one probe of the cheapest is none of the others.
        let mut count = 0;
        let controller = Controller::start(50.0, vec![1.0, 0.5], |rung| {
            count += 1;
            Ok::<_, ()>(if count == 2 { 500.0 } else { [80.0, 40.0][rung] })
        });
        assert_eq!(controller.unwrap().first_ms(), 40.0);
        assert_eq!(
            Controller::start(1.0, vec![1.0], |_| Err::<f64, _>("lost")).err(),
            Some("lost")
        );
    }

    /// A constant load, with noise below the margin, never changes the settings.
    #[test]
    fn a_constant_load_keeps_its_settings() {
        for load in [20.0, 60.0, 89.0, 130.0, 220.0] {
            let (rungs, _, kept) = played(COSTS, &[load; 60], 0);
            assert_eq!((changes(&rungs), kept.over), (0, 0), "{load}: {rungs:?}");
        }
        for (load, late) in [(70.0, 0), (95.0, 0), (125.0, 1), (200.0, 2)] {
            let loads = noisy(load, 0.05, 200);
            let (rungs, _, kept) = played(COSTS, &loads, late);
            assert!(changes(&rungs) <= 2 && kept.over == 0, "{load}: {rungs:?}");
        }
    }

    /// A load that grows by 5 % a frame, and falls again, keeps the budget and comes back to the settings that
    /// it had, also where times are known late.
    #[test]
    fn a_load_may_grow_and_fall() {
        let up: Vec<f64> = (0..26).map(|i| 60.0 * 1.05f64.powi(i)).collect();
        let loads: Vec<f64> =
            up.iter().chain(up.iter().rev()).chain(&[60.0; 20]).copied().collect();
        for late in [0, 1] {
            let (rungs, times, kept) = played(COSTS, &loads, late);
            assert!(kept.over == 0, "{late}: {times:?}");
            assert_eq!(rungs[rungs.len() - 1], rungs[0], "{rungs:?}");
            assert!(rungs.contains(&4) && changes(&rungs) <= 10, "{rungs:?}");
        }
        // By the settings of the first frame alone it does not.
        let first = played(COSTS, &loads, 0).0[0];
        let over = loads.iter().filter(|load| COSTS[first] * **load > BUDGET).count();
        assert!(over > loads.len() / 4, "{over} of {}", loads.len());
    }

    /// One slow frame costs one frame: a few cheaper ones follow, then the settings of before.
    #[test]
    fn a_spike_passes() {
        let mut loads = vec![80.0; 40];
        loads[15] = 400.0;
        let (rungs, _, kept) = played(COSTS, &loads, 0);
        assert_eq!((kept.over, kept.longest_ms), (1, 400.0));
        assert_eq!((rungs[15], rungs[16]), (rungs[0], 4), "{rungs:?}");
        assert_eq!(changes(&rungs), 2, "{rungs:?}");
        assert_eq!(rungs[16..].iter().filter(|rung| **rung == 4).count(), HOLD, "{rungs:?}");
    }

    /// A load that no settings can bear is drawn with the cheapest, and counted.
    #[test]
    fn a_hopeless_load_is_counted() {
        let mut loads = vec![80.0; 10];
        loads.extend([500.0; 30]);
        let (rungs, _, kept) = played(COSTS, &loads, 0);
        assert!(rungs[11..].iter().all(|rung| *rung == 4), "{rungs:?}");
        let expected = Kept { frames: 40, over: 30, longest_ms: 500.0, over_at_cheapest: 29 };
        assert_eq!(kept, expected);
    }

    /// Settings that cost more in this scene than the calibration says are not tried again and again.
    #[test]
    fn wrong_costs_are_corrected() {
        // By the calibration rung 1 fits a load that rung 2 shows to be 85 ms; in truth it takes 110 ms.
        let costs = [1.8, 1.3, 0.8, 0.6, 0.35];
        let (rungs, times, kept) = played(costs, &[85.0; 200], 0);
        assert!(kept.over <= 200 / 20, "{} frames: {times:?}", kept.over);
        assert_eq!(*rungs.last().unwrap(), 2, "{rungs:?}");
        // It is cheaper than calibrated: nothing is missed.
        let (_, times, kept) = played([1.0, 0.8, 0.6, 0.5, 0.3], &[120.0; 60], 0);
        assert_eq!(kept.over, 0, "{times:?}");
    }

    /// Frames without liquid take no time; those that follow are corrected by the first.
    #[test]
    fn frames_without_liquid_choose_nothing() {
        let loads: Vec<f64> = [0.0; 10].into_iter().chain([150.0; 20]).collect();
        let (rungs, times, kept) = played(COSTS, &loads, 0);
        assert_eq!((rungs[0], kept.over), (0, 1), "{times:?}");
    }
}
