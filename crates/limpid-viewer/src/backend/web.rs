//! The work in a browser: one worker.
//!
//! A page may not wait, and a browser's threads share no memory unless its server sends special headers. So the page
//! runs the interface alone, and a worker reads files, classifies particles, simulates, and draws by WebGPU ([`worker`]).
//! They exchange messages ([`wire`]); the page has a [`Backend`] to ask. On the page a document and a frame are outlines:
//! what the interface shows of them, without particles and solids. In the worker waiting is allowed, so that it
//! reads files as other programs do; it yields while it waits for the device, and after each frame.

mod baked_files;
pub(crate) mod demos;
mod fetch;
mod frame_cache;
mod handle;
mod signal;
mod wire;
mod worker;

pub(crate) use frame_cache::FrameCache;
pub(crate) use handle::{Backend, Crash};
pub(crate) use wire::{Ask, Edits};
pub use worker::work;

/// Runs `work` at once: in a browser, what is long is the worker's.
pub(crate) fn spawn(work: impl FnOnce()) {
    work();
}

/// Drops a value, which in a browser is a small one: the worker has the large ones.
pub(crate) fn drop_in_background(what: impl Sized) {
    drop(what);
}
