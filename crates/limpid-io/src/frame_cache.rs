//! A cache that loads frames ahead of playback.
//!
//! A [`FrameCache`] holds the frames around the current one, as many as fit its memory budget, and loads
//! them on its own threads: first the current frame, then those ahead in the direction of playback, then
//! those behind. Distant frames are evicted for nearer ones.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock};

use rayon::ThreadPoolBuilder;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::input::Loaded;

/// The result of loading a frame, shared, since it may be drawn after the cache has evicted it.
pub type Outcome = Result<Arc<Loaded>, Arc<Error>>;

/// Number of particles below which a frame is loaded by one thread: workers load frames side by side, and sharing one of them
/// with all others takes longer than its work.
const SHARED_PARTICLES: usize = 8192;

/// A cache that loads frames ahead of playback; see [the module](self).
pub struct FrameCache {
    shared: Arc<Shared>,
}

/// The contents of a cache.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CacheState {
    /// Memory of the loaded frames and, estimated, of those being loaded, bytes.
    pub bytes: u64,
    /// The memory budget, bytes.
    pub budget: u64,
    /// Peak of `bytes`.
    pub most: u64,
    /// Loaded frames, ascending.
    pub loaded: Vec<usize>,
    /// Frames being loaded, ascending.
    pub loading: Vec<usize>,
    /// Frames that failed to load, ascending.
    pub failed: Vec<usize>,
}

struct Shared {
    count: usize,
    budget: u64,
    state: Mutex<State>,
    /// Signals the workers that a frame may be due, or that the cache is closed.
    work: Condvar,
    /// Signals that a frame has loaded or failed.
    finished: Condvar,
    /// The error of the first thread, if the system has started none.
    no_worker: OnceLock<Arc<Error>>,
}

#[derive(Default)]
struct State {
    aim: Aim,
    slots: BTreeMap<usize, Slot>,
    /// Memory of all slots, bytes.
    bytes: u64,
    most: u64,
    /// Memory reserved for a frame before its size is known: the largest so far, bytes.
    estimate: u64,
    /// Number of particles of the largest frame so far.
    particles: Option<usize>,
    closed: bool,
}

enum Slot {
    /// Being loaded, with the memory reserved for it, bytes.
    Loading(u64),
    Done(Outcome, u64),
}

impl Slot {
    fn bytes(&self) -> u64 {
        match self {
            Self::Loading(bytes) | Self::Done(_, bytes) => *bytes,
        }
    }
}

/// The frame to load first, and the direction of playback from there.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
struct Aim {
    at: usize,
    step: isize,
    looped: bool,
}

impl Aim {
    /// Rank of frame `i` of `count` in loading order: the number of steps until playback reaches it, 0
    /// for the current frame. Frames behind or skipped by the step rank as if four times as far away.
    fn rank(self, i: usize, count: usize) -> usize {
        let step = self.step.unsigned_abs().max(1);
        let far = |distance: usize| 4 * distance + 1;
        let ahead = |distance: usize| {
            if distance.is_multiple_of(step) { distance / step } else { far(distance) }
        };
        let forwards = self.step >= 0;
        let (from, to) = if forwards { (self.at, i) } else { (i, self.at) };
        if to >= from {
            ahead(to - from)
        } else if self.looped {
            ahead(to + count - from)
        } else {
            far(from - to)
        }
    }
}

impl FrameCache {
    /// Creates a cache without threads, whose caller loads the frames: [`FrameCache::begin`] and
    /// [`FrameCache::finish`]. For programs whose threads share no memory.
    pub fn without_workers(count: usize, budget: u64) -> Self {
        let shared = Shared {
            count,
            budget,
            state: Mutex::new(State::default()),
            work: Condvar::new(),
            finished: Condvar::new(),
            no_worker: OnceLock::new(),
        };
        Self { shared: Arc::new(shared) }
    }

    /// The rank of the next frame to load: the steps of playback until it is shown. Never blocks.
    pub fn next_rank(&self) -> Option<usize> {
        let (state, count) = (self.shared.lock(), self.shared.count);
        let missing = (0..count).filter(|i| !state.slots.contains_key(i));
        missing.map(|i| state.aim.rank(i, count)).min()
    }

    /// The next frame to load, for which memory is reserved; `None` if nothing is to be loaded now. Never blocks.
    pub fn begin(&self) -> Option<usize> {
        // Freed without the lock, since freeing takes time.
        let mut evicted = Vec::new();
        let shared = &self.shared;
        let mut state = shared.lock();
        let next = state.claim(shared.count, shared.budget, &mut evicted);
        drop(state);
        next
    }

    /// Hands in a frame that [`FrameCache::begin`] has named.
    pub fn finish(&self, i: usize, outcome: Result<Loaded>) {
        self.shared.finish(i, outcome);
    }

    /// Creates a cache of frames 0 to `count` − 1 of at most `budget` bytes, or of one frame if that is
    /// larger.
    ///
    /// `load` reads and classifies a frame on one of `workers` threads (at least one). `ready` is
    /// called for each frame that has loaded or failed. If the system starts no thread at all, every
    /// frame fails with [`Error::Threads`].
    pub fn new(
        count: usize,
        budget: u64,
        workers: usize,
        load: impl Fn(usize) -> Result<Loaded> + Send + Sync + 'static,
        ready: impl Fn(usize) + Send + Sync + 'static,
    ) -> Self {
        let cache = Self::without_workers(count, budget);
        let shared = &cache.shared;
        let (load, ready) = (Arc::new(load), Arc::new(ready));
        for started in 0..workers.max(1) {
            let (load, ready) = (load.clone(), ready.clone());
            let worker = shared.clone();
            let work = move || {
                // Without one, if the system starts no more threads, all frames are shared.
                let alone = ThreadPoolBuilder::new().num_threads(1).build().ok();
                while let Some(i) = worker.next() {
                    let alone = alone.as_ref().filter(|_| worker.has_small_frames());
                    let load = || alone.map_or_else(|| load(i), |pool| pool.install(|| load(i)));
                    // A panic is reported as the frame's error, so that no caller waits forever.
                    let loaded = catch_unwind(AssertUnwindSafe(load));
                    let defect = |_| {
                        Err(Error::from(limpid::Error::Defect(
                            "a frame could not be loaded".into(),
                        )))
                    };
                    worker.finish(i, loaded.unwrap_or_else(defect));
                    ready(i);
                }
            };
            if let Err(error) = std::thread::Builder::new().spawn(work) {
                // Fewer workers are enough.
                if started == 0 {
                    shared.no_worker.get_or_init(|| Arc::new(Error::Threads(error)));
                }
                break;
            }
        }
        cache
    }

    /// Sets the current frame and the direction of playback: `step` frames at a time, negative for
    /// backwards, and `looped` if playback wraps around. Never blocks. A failed frame is loaded again
    /// when it becomes the current one, since it may have been incomplete.
    pub fn aim(&self, at: usize, step: isize, looped: bool) {
        let mut state = self.shared.lock();
        let aim = Aim { at: at.min(self.shared.count.saturating_sub(1)), step, looped };
        if state.aim != aim {
            state.aim = aim;
            // A failed frame has no memory to subtract.
            if matches!(state.slots.get(&aim.at), Some(Slot::Done(Err(_), _))) {
                state.slots.remove(&aim.at);
            }
            self.shared.work.notify_all();
        }
    }

    /// Frame `i`, if it has loaded or failed. Never blocks.
    pub fn get(&self, i: usize) -> Option<Outcome> {
        if let Some(error) = self.shared.no_worker.get() {
            return Some(Err(error.clone()));
        }
        match self.shared.lock().slots.get(&i)? {
            Slot::Loading(_) => None,
            Slot::Done(outcome, _) => Some(outcome.clone()),
        }
    }

    /// Makes `i` the current frame and waits for it.
    ///
    /// # Errors
    /// As loading the frame; [`Error::Usage`] for a frame out of range.
    pub fn wait(&self, i: usize) -> Result<Arc<Loaded>> {
        if i >= self.shared.count {
            return Err(Error::Usage(format!("frame {i} of {}", self.shared.count)));
        }
        if let Some(error) = self.shared.no_worker.get() {
            return Err(error.clone().into());
        }
        let aim = self.shared.lock().aim;
        self.aim(i, aim.step, aim.looped);
        let mut state = self.shared.lock();
        loop {
            if let Some(Slot::Done(outcome, _)) = state.slots.get(&i) {
                return Ok(outcome.clone()?);
            }
            state = self.shared.finished.wait(state).expect("no panic holds this lock");
        }
    }

    /// The contents of the cache. Never blocks.
    pub fn state(&self) -> CacheState {
        let state = self.shared.lock();
        let mut summary = CacheState {
            bytes: state.bytes,
            budget: self.shared.budget,
            most: state.most,
            ..CacheState::default()
        };
        for (&i, slot) in &state.slots {
            match slot {
                Slot::Loading(_) => summary.loading.push(i),
                Slot::Done(Ok(_), _) => summary.loaded.push(i),
                Slot::Done(Err(_), _) => summary.failed.push(i),
            }
        }
        summary
    }
}

impl Drop for FrameCache {
    /// Stops the workers, without waiting for the frames being loaded.
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.work.notify_all();
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().expect("no panic holds this lock")
    }

    /// Waits for the next frame to load and reserves memory for it; `None` if the cache is closed.
    fn next(&self) -> Option<usize> {
        let mut evicted = Vec::new();
        let mut state = self.lock();
        loop {
            if state.closed {
                return None;
            }
            if let Some(i) = state.claim(self.count, self.budget, &mut evicted) {
                // Freed without the lock, since freeing takes time.
                drop(state);
                drop(evicted);
                return Some(i);
            }
            state = self.work.wait(state).expect("no panic holds this lock");
        }
    }

    /// Whether all frames so far, of which there are some, have few particles.
    fn has_small_frames(&self) -> bool {
        self.lock().particles.is_some_and(|particles| particles < SHARED_PARTICLES)
    }

    fn finish(&self, i: usize, outcome: Result<Loaded>) {
        let particles = outcome.as_ref().ok().map(|loaded| loaded.particles);
        let outcome = outcome.map(Arc::new).map_err(Arc::new);
        let bytes = outcome.as_ref().map_or(0, |loaded| loaded.bytes());
        let mut state = self.lock();
        state.estimate = state.estimate.max(bytes);
        state.particles = state.particles.max(particles);
        state.put(i, Slot::Done(outcome, bytes));
        // The size is known only now, and may exceed the reservation.
        let mut evicted = Vec::new();
        while state.bytes > self.budget && state.evict(self.count, usize::MAX, &mut evicted) {}
        state.most = state.most.max(state.bytes);
        drop(state);
        drop(evicted);
        self.finished.notify_all();
        self.work.notify_all();
    }
}

impl State {
    fn put(&mut self, i: usize, slot: Slot) {
        self.bytes += slot.bytes();
        if let Some(old) = self.slots.insert(i, slot) {
            self.bytes -= old.bytes();
        }
    }

    /// Reserves memory for the missing frame of the lowest rank, moving evicted frames to `evicted`. `None`
    /// if no frame is missing, or not enough memory can be freed.
    fn claim(&mut self, count: usize, budget: u64, evicted: &mut Vec<Slot>) -> Option<usize> {
        let aim = self.aim;
        let missing = (0..count).filter(|i| !self.slots.contains_key(i));
        let i = missing.min_by_key(|&i| aim.rank(i, count))?;
        let rank = aim.rank(i, count);
        // Until a frame's size is known, only one is loaded.
        if self.estimate == 0 && self.slots.values().any(|slot| matches!(slot, Slot::Loading(_))) {
            return None;
        }
        // Loaded frames of higher rank are evicted if that frees enough memory. If no other frame
        // remains, the frame is loaded at any size.
        let later = |(j, slot): (&usize, &Slot)| {
            matches!(slot, Slot::Done(..)) && aim.rank(*j, count) > rank
        };
        let kept = self.slots.iter().filter(|&slot| !later(slot));
        let (count_kept, bytes_kept) =
            kept.fold((0, 0), |(n, bytes), (_, slot)| (n + 1, bytes + slot.bytes()));
        if count_kept > 0 && bytes_kept + self.estimate > budget {
            return None;
        }
        while self.bytes + self.estimate > budget && self.evict(count, rank, evicted) {}
        self.put(i, Slot::Loading(self.estimate));
        Some(i)
    }

    /// Evicts the loaded frame of the highest rank, if that is above `rank`; with `usize::MAX`, if it is not
    /// the current frame.
    fn evict(&mut self, count: usize, rank: usize, evicted: &mut Vec<Slot>) -> bool {
        let aim = self.aim;
        let done = self.slots.iter().filter(|(_, slot)| matches!(slot, Slot::Done(..)));
        let last = done.map(|(&i, _)| (aim.rank(i, count), i)).max();
        let keep = if rank == usize::MAX { 0 } else { rank };
        match last {
            Some((far, i)) if far > keep => {
                if let Some(slot) = self.slots.remove(&i) {
                    self.bytes -= slot.bytes();
                    evicted.push(slot);
                }
                true
            }
            _ => false,
        }
    }
}

impl std::fmt::Debug for FrameCache {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FrameCache").field("state", &self.state()).finish_non_exhaustive()
    }
}
