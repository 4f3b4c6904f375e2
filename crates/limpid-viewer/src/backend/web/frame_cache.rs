//! The page's side of a frame cache, which is in the worker.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;

use limpid_io::error::Error;
use limpid_io::frame_cache::{CacheState, Outcome};
use limpid_io::input::Loaded;

use super::wire::Ask;

/// The outlines of the frames of a cache in the worker: as [`limpid_io::frame_cache::FrameCache`].
pub(crate) struct FrameCache {
    id: u64,
    ask: Box<dyn Fn(&Ask)>,
    aim: Cell<Option<(usize, isize, bool)>>,
    mirror: Rc<RefCell<Mirror>>,
}

/// State of a cache, as its worker has told it.
pub(super) struct Mirror {
    frames: BTreeMap<usize, Outcome>,
    state: CacheState,
    ready: Box<dyn Fn()>,
}

impl std::fmt::Debug for Mirror {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Mirror").field("state", &self.state).finish_non_exhaustive()
    }
}

impl Mirror {
    pub(super) fn loaded(&mut self, i: usize, outcome: Result<Arc<Loaded>, String>) {
        self.frames.insert(i, outcome.map_err(|error| Arc::new(Error::Usage(error))));
        (self.ready)();
    }

    pub(super) fn cached(&mut self, state: CacheState) {
        self.frames.retain(|i, _| {
            [&state.loaded, &state.failed].into_iter().any(|these| these.binary_search(i).is_ok())
        });
        self.state = state;
        (self.ready)();
    }
}

impl std::fmt::Debug for FrameCache {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FrameCache").field("mirror", &self.mirror).finish_non_exhaustive()
    }
}

impl FrameCache {
    pub(super) fn new(id: u64, ask: impl Fn(&Ask) + 'static, ready: impl Fn() + 'static) -> Self {
        let (frames, state) = Default::default();
        let mirror = Rc::new(RefCell::new(Mirror { frames, state, ready: Box::new(ready) }));
        Self { id, ask: Box::new(ask), aim: Cell::default(), mirror }
    }

    pub(super) fn mirror(&self) -> &Rc<RefCell<Mirror>> {
        &self.mirror
    }

    /// Sets the current frame and the direction of playback.
    pub(crate) fn aim(&self, at: usize, step: isize, looped: bool) {
        let aim = Some((at, step, looped));
        if self.aim.replace(aim) != aim {
            (self.ask)(&Ask::Aim { id: self.id, at, step, looped });
        }
    }

    /// Frame `i`, if it has loaded or failed.
    pub(crate) fn get(&self, i: usize) -> Option<Outcome> {
        self.mirror.borrow().frames.get(&i).cloned()
    }

    /// The contents of the cache.
    pub(crate) fn state(&self) -> CacheState {
        self.mirror.borrow().state.clone()
    }
}

impl Drop for FrameCache {
    fn drop(&mut self) {
        (self.ask)(&Ask::Uncache { id: self.id });
    }
}
