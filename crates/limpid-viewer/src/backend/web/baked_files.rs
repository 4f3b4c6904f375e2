//! Frames of simulations, as files in memory.

use std::path::{Path, PathBuf};

use limpid::liquid::Particles;
use limpid::memory;
use limpid_io::bake::{self, Found, Store};
use limpid_io::error::{Error, Result};
use limpid_io::files::given;
use limpid_io::particles::bgeo;

/// Memory for a particle of a frame, bytes: its record in the file, and its place in the list of them.
const FRAME_BYTES: usize = 64;

/// The frames of a simulation, as files that are given to the worker.
pub(super) struct BakedFiles<'a> {
    pub(super) folder: &'a Path,
    pub(super) name: &'a str,
    /// Whether files that are there belong to this simulation.
    pub(super) goes_on: bool,
}

impl Store for BakedFiles<'_> {
    fn find(&mut self, number: u32) -> Result<Found> {
        let is_there = self.goes_on && given::has(&self.path(number));
        Ok(if is_there { Found::Whole } else { Found::Nothing })
    }

    fn path(&self, number: u32) -> PathBuf {
        bake::frame_path(self.folder, self.name, number)
    }

    fn write(&mut self, number: u32, particles: Particles, _: Found) -> Result<()> {
        memory::probe(particles.len().saturating_mul(FRAME_BYTES), self.name)?;
        let path = self.path(number);
        let bytes = bgeo::to_bytes(&particles);
        given::give_bytes(&path, bytes.map_err(|error| Error::io(&path, "write", error))?);
        Ok(())
    }

    fn has_written(&mut self, _: bool) -> Result<bool> {
        Ok(true)
    }
}
