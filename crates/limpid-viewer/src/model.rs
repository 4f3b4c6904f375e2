//! The open document and its view: plain data, which all other folders use.

pub mod clip;
pub mod coloring;
pub mod demos;
pub mod document;
pub(crate) mod editing;
pub(crate) mod eye;
pub(crate) mod history;
pub mod level;
pub(crate) mod log;
pub(crate) mod notices;
pub(crate) mod platform;
pub mod playback;
pub mod reading;
pub mod shortcuts;
pub(crate) mod sketch;
pub(crate) mod stage;
pub mod views;
