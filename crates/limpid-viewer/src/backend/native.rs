//! The work on threads.

pub mod draw_thread;
