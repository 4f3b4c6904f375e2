//! A liquid with any number of particles, for the benches.

use std::path::Path;

use limpid::liquid::Particles;
use limpid_io::Result;
use limpid_io::bake::{self, Bake};
use limpid_io::project::Project;

/// Particle counts of the benches. Layers are whole, so the actual counts are 4,752, 39,128,
/// 116,424 and 1,056,000.
pub(crate) const COUNTS: [usize; 4] = [5_000, 40_000, 125_000, MILLION];

/// About the most that can be simulated: 9,702,000.
#[allow(dead_code, reason = "not all benches go so far")]
pub(crate) const TEN_MILLION: usize = 9_800_000;

/// Number of particles of `sims/million.toml`.
const MILLION: usize = 1_056_000;
/// Radius of these, m.
const RADIUS: f64 = 0.0125;

/// The tank of `sims/million.toml`, filled with particles of the same size or larger ones: the same
/// waves from the same camera.
pub(crate) struct Swell {
    pub(crate) project: Project,
    pub(crate) particles: Particles,
    /// Particle radius, m.
    pub(crate) radius: f32,
}

impl Swell {
    /// Simulates the tank with about `count` particles.
    ///
    /// # Errors
    /// As [`Bake::step`], which writes a frame to a temporary folder.
    pub(crate) fn new(count: usize) -> Result<Self> {
        let radius = RADIUS * (MILLION as f64 / count as f64).cbrt();
        let text = include_str!("../../sims/million.toml")
            .replace("radius = 0.0125", &format!("radius = {radius}"))
            .replace("frames = 60", "frames = 1");
        let mut project = Project::parse(&text, "swell", Path::new(""))?;
        let simulation = project.simulation_mut("swell")?.clone();
        let solids = &project.scene.solids;
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut bake = Bake::in_folder(&simulation, solids, "swell", folder.path())?;
        while bake.step()?.is_some() {}
        let particles = limpid_io::particles::read(&bake::frame_path(folder.path(), "swell", 1))?;
        Ok(Self { project, particles, radius: radius as f32 })
    }
}
