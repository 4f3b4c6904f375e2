//! Particles, loaded ahead of what is drawn.

use std::sync::Arc;

use limpid::scene::Scene;
use limpid_io::film::Take;
use limpid_io::input::{Input, Loaded, Moment};
use limpid_io::place::Place;
use limpid_io::ring::Ring;

pub(super) struct Loader {
    ring: Ring,
    /// The moments in the ring, ascending: pictures of the same particles share their loading.
    wanted: Vec<usize>,
    /// What a loop comes back to may still be there.
    looped: bool,
    place: Place,
}

impl Loader {
    /// For these pictures, with so many bytes for what is loaded ahead of the next one; their particles
    /// are classified in this place, which is closed with the loader.
    pub(super) fn new(
        input: Input,
        place: Place,
        scene: &Scene,
        moments: &[Moment],
        takes: &[Take],
        memory: u64,
    ) -> Self {
        let mut wanted: Vec<usize> = takes.iter().map(|take| take.frame).collect();
        wanted.sort_unstable();
        wanted.dedup();
        let loading: Vec<Moment> = wanted.iter().map(|&frame| moments[frame]).collect();
        let workers = std::thread::available_parallelism().map_or(1, |n| n.get().min(wanted.len()));
        let scene = scene.clone();
        let input = input.classified(place.clone());
        let load = move |i: usize| input.load(loading[i], &scene);
        let ring = Ring::new(wanted.len(), memory, workers, load, |_| ());
        Self { ring, looped: takes.len() > wanted.len(), wanted, place }
    }

    /// Begins to load what comes after another picture, and what lies further that way.
    pub(super) fn aim(&self, take: &Take, after: &Take) {
        let step = if take.frame < after.frame && !self.looped { -1 } else { 1 };
        self.ring.aim(self.index(take), step, self.looped);
    }

    /// Whether nobody has to wait for the particles of a picture.
    pub(super) fn has(&self, take: &Take) -> bool {
        self.ring.get(self.index(take)).is_some()
    }

    pub(super) fn wait(&self, take: &Take) -> limpid_io::Result<Arc<Loaded>> {
        self.ring.wait(self.index(take))
    }

    /// Where particles are classified.
    pub(super) fn place(&self) -> &Place {
        &self.place
    }

    fn index(&self, take: &Take) -> usize {
        self.wanted.partition_point(|&frame| frame < take.frame)
    }
}

impl Drop for Loader {
    fn drop(&mut self) {
        self.place.close();
    }
}
