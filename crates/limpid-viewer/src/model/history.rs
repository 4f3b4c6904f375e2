//! The changes of the settings, to take them back.

use limpid::scene::Scene;
use limpid_io::shared_classifier::Processor;

use crate::model::coloring::Coloring;
use crate::model::document::Source;

/// Most changes that are kept.
const MOST: usize = 100;

/// All that the panels change.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct State {
    /// The source with its adjustments.
    pub(crate) source: Source,
    /// Settings A and B.
    pub(crate) scenes: [Scene; 2],
    pub(crate) processor: Processor,
    pub(crate) colors: Coloring,
}

/// States of a document, in order.
#[derive(Debug)]
pub(crate) struct History<T> {
    states: Vec<T>,
    /// Index of the present one.
    at: usize,
}

impl<T> Default for History<T> {
    fn default() -> Self {
        Self { states: Vec::new(), at: 0 }
    }
}

impl<T: PartialEq> History<T> {
    /// Makes a state the present one, if it is another; those that were taken back are then forgotten.
    pub(crate) fn record(&mut self, state: T) {
        if self.states.get(self.at) == Some(&state) {
            return;
        }
        self.states.truncate(self.at + 1);
        self.states.push(state);
        let old = self.states.len().saturating_sub(MOST);
        self.states.drain(..old);
        self.at = self.states.len() - 1;
    }

    /// Goes back, or on again; returns the state there, if there is one.
    pub(crate) fn step(&mut self, forwards: bool) -> Option<&T> {
        let to = if forwards { self.at + 1 } else { self.at.checked_sub(1)? };
        let state = self.states.get(to)?;
        self.at = to;
        Some(state)
    }

    /// Whether there is a state before the present one, and after it.
    pub(crate) fn can_step(&self) -> [bool; 2] {
        [self.at > 0, self.at + 1 < self.states.len()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each change is taken back by itself, and made again until another one is made.
    #[test]
    fn changes_are_taken_back_in_order() {
        let mut history = History::default();
        for state in [1, 2, 2, 3] {
            history.record(state);
        }
        assert_eq!(history.can_step(), [true, false]);
        assert_eq!(history.step(false), Some(&2));
        history.record(2);
        assert_eq!(history.step(true), Some(&3));
        assert_eq!(history.step(true), None);
        assert_eq!(history.step(false), Some(&2));
        history.record(4);
        assert_eq!(history.step(true), None);
        assert_eq!(history.step(false), Some(&2));
        for state in 0..200 {
            history.record(state);
        }
        let back = std::iter::from_fn(|| history.step(false).copied()).count();
        assert_eq!(back, MOST - 1);
    }
}
