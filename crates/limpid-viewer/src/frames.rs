//! The frames of both settings that can be compared, loaded ahead in rings.

use std::sync::Arc;

use crate::document::Document;
use limpid::scene::Scene;
use limpid::settings::Classify;
use limpid_io::input::Moment;
use limpid_io::place::Place;
use limpid_io::project::Processor;
use limpid_io::ring::{Outcome, Ring, RingState};

/// What a ring's frames depend on besides the document.
#[derive(Debug, Clone, PartialEq)]
struct Key {
    classify: Classify,
    processor: Processor,
    /// Frames from moment to moment.
    step: f64,
    count: usize,
    budget: u64,
}

/// Frees what may be large on a thread of its own, for that takes longer than the interface may
/// work.
pub(crate) fn let_go(what: impl Send + 'static) {
    std::thread::spawn(move || drop(what));
}

/// One ring for each different way of classifying that is looked at.
#[derive(Debug)]
pub(crate) struct Frames {
    rings: Vec<(Key, Ring)>,
    /// Memory for all rings, bytes.
    budget: u64,
    place: Place,
    /// What classifies the frames.
    pub(crate) processor: Processor,
}

impl Frames {
    /// None yet; they will be classified there.
    pub(crate) fn new(budget: u64, place: Place) -> Self {
        Self { rings: Vec::new(), budget, place, processor: Processor::default() }
    }

    /// Lets go of all.
    pub(crate) fn clear(&mut self) {
        let_go(std::mem::take(&mut self.rings));
    }

    /// Sees to it that there is a ring for each of `scenes`, and no other.
    ///
    /// `hold` keeps the rings as they are until one of them has frame `at`: a slider that is dragged
    /// changes faster than frames are classified.
    pub(crate) fn prepare(
        &mut self,
        document: &Arc<Document>,
        moments: &Arc<[Moment]>,
        step: f64,
        scenes: &[&Scene],
        (at, hold): (usize, bool),
        ready: impl Fn() + Clone + Send + Sync + 'static,
    ) {
        let mut different: Vec<&Scene> = Vec::new();
        for scene in scenes {
            if !different.iter().any(|d| d.settings.classify == scene.settings.classify) {
                different.push(scene);
            }
        }
        let budget = self.budget / different.len().max(1) as u64;
        let key = |scene: &Scene| Key {
            classify: scene.settings.classify.clone(),
            processor: self.processor,
            step,
            count: moments.len(),
            budget,
        };
        let keys: Vec<Key> = different.iter().map(|scene| key(scene)).collect();
        if self.rings.iter().map(|(key, _)| key).eq(&keys) {
            return;
        }
        let busy = self.rings.iter().any(|(_, ring)| ring.get(at).is_none());
        if hold && busy && self.rings.len() == keys.len() {
            return;
        }
        let mut old = std::mem::take(&mut self.rings);
        for (key, scene) in keys.into_iter().zip(different) {
            if let Some(same) = old.iter().position(|(k, _)| *k == key) {
                self.rings.push(old.swap_remove(same));
                continue;
            }
            let input = document.input.clone().classified(self.place.clone());
            let input = input.processed_by(self.processor);
            let (moments, scene) = (moments.clone(), scene.clone());
            let workers = std::thread::available_parallelism().map_or(1, |n| n.get());
            let workers = workers.min(moments.len());
            let load = move |i: usize| input.load(moments[i], &scene);
            let ready = ready.clone();
            let ring = Ring::new(key.count, budget, workers, load, move |_| ready());
            self.rings.push((key, ring));
        }
        let_go(old);
    }

    /// Says where playback is and where it goes.
    pub(crate) fn aim(&self, at: usize, step: isize, looped: bool) {
        for (_, ring) in &self.rings {
            ring.aim(at, step, looped);
        }
    }

    /// A moment's particles, if they have come, and whether they are as the scene classifies them:
    /// while a slider is dragged there may be others.
    pub(crate) fn get(&self, scene: &Scene, i: usize) -> Option<(Outcome, bool)> {
        let fits = |key: &Key| {
            (&key.classify, key.processor) == (&scene.settings.classify, self.processor)
        };
        let (key, ring) = self.rings.iter().find(|(key, _)| fits(key)).or(self.rings.first())?;
        Some((ring.get(i)?, fits(key)))
    }

    /// Whether all rings have a moment, loaded or failed.
    pub(crate) fn have(&self, i: usize) -> bool {
        !self.rings.is_empty() && self.rings.iter().all(|(_, ring)| ring.get(i).is_some())
    }

    /// What the first ring holds, and the bytes of all.
    pub(crate) fn state(&self) -> RingState {
        let mut states = self.rings.iter().map(|(_, ring)| ring.state());
        let first = states.next().unwrap_or_default();
        states.fold(first, |mut all, state| {
            all.bytes += state.bytes;
            all.budget += state.budget;
            all.loading.extend(state.loading);
            all
        })
    }
}
