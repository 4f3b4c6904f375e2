//! The viewer in a web page: what JavaScript calls, and the state in an address. [`crate::worker`] does the work.

pub mod link;
mod page;

pub use crate::worker::work;
pub use page::{Page, PageOptions};
