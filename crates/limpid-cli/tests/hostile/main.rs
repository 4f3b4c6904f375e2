//! Damaged and malicious files and arguments. Reading any file gives valid particles or a single error
//! that names the file and the location, never a panic or an endless loop, with no more memory than the
//! file's length justifies. `cases.rs` lists the outcome of each case, `docs/hostile.md` the rules. A program of its
//! own, since its allocator counts all memory of the process.

mod cases;
mod damage;
mod files;
mod memory;
mod mutants;
mod numbers;
mod prepare;
mod runner;
mod scenes;
