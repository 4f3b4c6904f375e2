//! Files and arguments that want to do harm, by accident or not.
//!
//! Protects whoever runs limpid on files of others: whatever a file holds, reading it ends with
//! particles that are sound or with one message that names the file and the place in it. It never
//! panics, never hangs, and allocates no more than the file's length warrants. `docs/hostile.md`
//! tells the outcome of each case.

mod cases;
mod damage;
mod files;
mod memory;
mod numbers;
mod prepare;
mod runner;
mod scenes;
