//! Scenes of `sims/` for the crates above, since a published crate holds the files of no other.

/// Text of `sims/breaker.toml`.
pub const BREAKER: &str = include_str!("../sims/breaker.toml");
/// Text of `sims/cascade.toml`.
pub const CASCADE: &str = include_str!("../sims/cascade.toml");
/// Text of `sims/dam.toml`.
pub const DAM: &str = include_str!("../sims/dam.toml");
/// Text of `sims/demo.toml`.
pub const DEMO: &str = include_str!("../sims/demo.toml");
/// Text of `sims/drop.toml`.
pub const DROP: &str = include_str!("../sims/drop.toml");
/// Text of `sims/glass_ball.toml`.
pub const GLASS_BALL: &str = include_str!("../sims/glass_ball.toml");
/// Text of `sims/idol.toml`.
pub const IDOL: &str = include_str!("../sims/idol.toml");
/// Text of `sims/lagoon.toml`.
pub const LAGOON: &str = include_str!("../sims/lagoon.toml");
/// Text of `sims/pool.toml`.
pub const POOL: &str = include_str!("../sims/pool.toml");
/// Text of `sims/reef.toml`.
pub const REEF: &str = include_str!("../sims/reef.toml");
/// Text of `sims/slab.toml`.
pub const SLAB: &str = include_str!("../sims/slab.toml");
/// Text of `sims/vase.toml`.
pub const VASE: &str = include_str!("../sims/vase.toml");
/// The particles of [`DEMO`], BGEO.
pub const DEMO_PARTICLES: &[u8] = include_bytes!("../sims/demo.bgeo");
