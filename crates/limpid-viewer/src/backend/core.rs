//! The tasks of opening a source, loading its frames and drawing pictures: one implementation, which threads and the
//! worker of a page schedule.

pub mod drawing;
pub(crate) mod filming;
pub(crate) mod loading;
pub mod messages;
pub mod opening;
pub mod picking;
pub mod queue;
pub(crate) mod recoloring;
pub mod truth;
