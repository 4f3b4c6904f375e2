//! How a source is opened, its frames are loaded, and pictures are drawn: one implementation, which threads and the
//! worker of a page schedule.

pub mod drawing;
pub(crate) mod filming;
pub(crate) mod loading;
pub mod messages;
pub mod opening;
pub mod queue;
pub mod truth;
