//! Generated particles for [`limpid`]: closed-form [`recipe`]s, and [`sim`]ulations by position-based
//! dynamics or linear waves; and the foam, spray and bubbles of any liquid, [`whitewater`].

#![forbid(unsafe_code)]

pub mod recipe;
pub mod rng;
pub mod sim;
pub mod waves;
pub mod whitewater;
