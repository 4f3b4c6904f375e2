//! Frames that are loaded ahead of playback.
//!
//! A [`FrameCache`] holds the frames around the one that is wanted, as many as its memory budget takes,
//! and loads them on threads of its own: first the wanted frame, then those that playback comes to,
//! then those that it comes from. Frames far from there make room for nearer ones.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock};

use crate::error::{Error, Result};
use crate::input::Loaded;

/// What has become of a frame: shared, for it may be drawn while the cache lets go of it.
pub type Outcome = Result<Arc<Loaded>, Arc<Error>>;

/// Loads frames ahead; see the module.
pub struct FrameCache {
    shared: Arc<Shared>,
}

/// What a cache holds.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CacheState {
    /// Memory of the loaded frames and, by estimate, of those that are being loaded, bytes.
    pub bytes: u64,
    /// What that may come to, bytes.
    pub budget: u64,
    /// Most that it has ever come to, bytes.
    pub most: u64,
    /// Frames that can be shown at once, in order.
    pub loaded: Vec<usize>,
    /// Frames that are being loaded, in order.
    pub loading: Vec<usize>,
    /// Frames that cannot be loaded, in order.
    pub failed: Vec<usize>,
}

struct Shared {
    count: usize,
    budget: u64,
    state: Mutex<State>,
    // Something to do for a worker.
    work: Condvar,
    // A frame has come.
    came: Condvar,
    /// Why there is no worker, if the system has started none.
    no_worker: OnceLock<Arc<Error>>,
}

#[derive(Default)]
struct State {
    aim: Aim,
    slots: BTreeMap<usize, Slot>,
    /// Bytes of all slots.
    bytes: u64,
    most: u64,
    /// What a frame is taken to need before it is known: the most that one has needed.
    estimate: u64,
    closed: bool,
}

enum Slot {
    /// With so many bytes set aside for it.
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

/// What is wanted, and where playback goes from there.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
struct Aim {
    at: usize,
    step: isize,
    looped: bool,
}

impl Aim {
    /// How soon frame `i` of `count` is wanted: 0 the wanted one, then those that playback comes to,
    /// and those behind or stepped over as if they were four times as far.
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
    /// A cache over frames 0 to `count` − 1 that holds at most `budget` bytes, but always one frame.
    ///
    /// `load` reads and classifies a frame on one of `workers` threads (at least one); `ready` is
    /// told of each that has come, loaded or failed. If the system starts not even one thread, every
    /// frame fails with [`Error::Threads`].
    pub fn new(
        count: usize,
        budget: u64,
        workers: usize,
        load: impl Fn(usize) -> Result<Loaded> + Send + Sync + 'static,
        ready: impl Fn(usize) + Send + Sync + 'static,
    ) -> Self {
        let shared = Arc::new(Shared {
            count,
            budget,
            state: Mutex::new(State::default()),
            work: Condvar::new(),
            came: Condvar::new(),
            no_worker: OnceLock::new(),
        });
        let (load, ready) = (Arc::new(load), Arc::new(ready));
        for started in 0..workers.max(1) {
            let (load, ready) = (load.clone(), ready.clone());
            let worker = shared.clone();
            let work = move || {
                while let Some(i) = worker.next() {
                    // Whoever waits for the frame must hear of it, even of a defect.
                    let loaded = catch_unwind(AssertUnwindSafe(|| load(i)));
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
                // Fewer do the same work.
                if started == 0 {
                    shared.no_worker.get_or_init(|| Arc::new(Error::Threads(error)));
                }
                break;
            }
        }
        Self { shared }
    }

    /// Says which frame is wanted now and where playback goes: `step` frames at a time, negative for
    /// backwards; `looped` if it begins again at the other end. Never blocks. A frame that could not
    /// be loaded is tried again when it comes to be wanted: it may have been about to be written.
    pub fn aim(&self, at: usize, step: isize, looped: bool) {
        let mut state = self.shared.lock();
        let aim = Aim { at: at.min(self.shared.count.saturating_sub(1)), step, looped };
        if state.aim != aim {
            state.aim = aim;
            // What has failed takes no memory.
            if matches!(state.slots.get(&aim.at), Some(Slot::Done(Err(_), _))) {
                state.slots.remove(&aim.at);
            }
            self.shared.work.notify_all();
        }
    }

    /// Frame `i`, if it has come. Never blocks.
    pub fn get(&self, i: usize) -> Option<Outcome> {
        if let Some(error) = self.shared.no_worker.get() {
            return Some(Err(error.clone()));
        }
        match self.shared.lock().slots.get(&i)? {
            Slot::Loading(_) => None,
            Slot::Done(outcome, _) => Some(outcome.clone()),
        }
    }

    /// Frame `i`: aims there and waits for it.
    ///
    /// # Errors
    /// Those of loading it; [`Error::Usage`] for a frame that there is not.
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
            state = self.shared.came.wait(state).expect("no panic holds this lock");
        }
    }

    /// What the cache holds. Never blocks.
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
    /// Stops the workers; a frame that one of them has in hand is not waited for.
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.work.notify_all();
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().expect("no panic holds this lock")
    }

    /// Waits for the next frame to load, with memory set aside for it; `None` when the cache closes.
    fn next(&self) -> Option<usize> {
        let mut evicted = Vec::new();
        let mut state = self.lock();
        loop {
            if state.closed {
                return None;
            }
            if let Some(i) = state.claim(self.count, self.budget, &mut evicted) {
                // Giving memory back takes time, in which nobody is to wait for the lock.
                drop(state);
                drop(evicted);
                return Some(i);
            }
            state = self.work.wait(state).expect("no panic holds this lock");
        }
    }

    fn finish(&self, i: usize, outcome: Result<Loaded>) {
        let outcome = outcome.map(Arc::new).map_err(Arc::new);
        let bytes = outcome.as_ref().map_or(0, |loaded| loaded.bytes());
        let mut state = self.lock();
        state.estimate = state.estimate.max(bytes);
        state.put(i, Slot::Done(outcome, bytes));
        // What it needs is known only now: it may be more than was set aside.
        let mut evicted = Vec::new();
        while state.bytes > self.budget && state.evict(self.count, usize::MAX, &mut evicted) {}
        state.most = state.most.max(state.bytes);
        drop(state);
        drop(evicted);
        self.came.notify_all();
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

    /// The frame that is wanted soonest and not here, if there is or can be made room for it.
    /// What makes room goes to `evicted`.
    fn claim(&mut self, count: usize, budget: u64, evicted: &mut Vec<Slot>) -> Option<usize> {
        let aim = self.aim;
        let missing = (0..count).filter(|i| !self.slots.contains_key(i));
        let i = missing.min_by_key(|&i| aim.rank(i, count))?;
        let rank = aim.rank(i, count);
        // Without an idea of a frame's size, one is loaded first.
        if self.estimate == 0 && self.slots.values().any(|slot| matches!(slot, Slot::Loading(_))) {
            return None;
        }
        // Frames that are wanted later make room, if that is enough; the wanted one comes whatever it
        // takes, once it is alone.
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

    /// Lets go of the loaded frame that is wanted last, if that is later than `rank`; with
    /// `usize::MAX` of any but the wanted one.
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
