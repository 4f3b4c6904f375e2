//! The viewer in a web page.
//!
//! A page may not wait, and a browser's threads share no memory unless its server sends special headers. So the page
//! runs the interface alone, and one worker does what threads do elsewhere: it reads files, classifies particles,
//! simulates, and draws by WebGPU. They exchange messages ([`wire`]). On the page a document and a frame are outlines:
//! what the interface shows of them, without particles and solids. In the worker waiting is allowed, so that it
//! reads files as other programs do; it yields while it waits for the device, and after each frame.

mod frame_cache;
pub mod link;
mod page;
mod signal;
mod wire;
mod worker;

pub(crate) use frame_cache::FrameCache;
pub(crate) use page::Worker;
pub use page::{Page, PageOptions};
pub use worker::work;
