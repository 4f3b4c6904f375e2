//! Baking: simulating the frames of a scene's `[simulation]`.

mod folder;
mod record;

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use limpid::liquid::Particles;
use limpid::memory;
use limpid::scene::Solid;
use limpid_sim::sim::{Simulation, Solver, State};

use crate::error::{Error, Result};
use crate::particles;

pub use self::folder::{Folder, clear};
#[cfg(not(target_arch = "wasm32"))]
pub(crate) use self::record::checksum;

/// The progress of a bake.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Number of frames on disk.
    pub done: u32,
    /// Number of all frames.
    pub frames: u32,
    /// Whether the last of the frames on disk was there, but damaged, and has been made again.
    pub again: bool,
}

/// Default folder for the frames of a scene file: `sims/baked/dam_break` for `sims/dam_break.toml`.
pub fn folder(scene_file: &Path) -> PathBuf {
    let name = scene_file.file_stem().unwrap_or_default();
    scene_file.parent().unwrap_or(Path::new("")).join("baked").join(name)
}

/// Path of a frame's file.
pub fn frame_path(folder: &Path, name: &str, number: u32) -> PathBuf {
    folder.join(format!("{name}_{number:04}.bgeo"))
}

/// Pattern of all frames' files.
pub fn frame_pattern(folder: &Path, name: &str) -> String {
    folder.join(format!("{name}_{{}}.bgeo")).to_string_lossy().into_owned()
}

/// Store of a bake's frames: the files of a [`Folder`], or in a browser files in memory.
pub trait Store {
    /// Looks for a frame from an earlier bake.
    ///
    /// # Errors
    /// Those of reading a frame that may be whole.
    fn find(&mut self, number: u32) -> Result<Found>;

    /// Path from which [`particles::read`] reads a frame.
    fn path(&self, number: u32) -> PathBuf;

    /// Begins to write a frame in the place of `found`.
    ///
    /// # Errors
    /// Those of writing it, if they are known at once.
    fn write(&mut self, number: u32, particles: Particles, found: Found) -> Result<()>;

    /// Whether the oldest of the frames being written has been written; if not, `wait` for it. Each is reported once.
    ///
    /// # Errors
    /// Those of writing it.
    fn has_written(&mut self, wait: bool) -> Result<bool>;
}

/// Remains of a frame from an earlier bake.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Found {
    /// No frame.
    Nothing,
    /// The frame as it was written.
    Whole,
    /// A frame that was cut or changed.
    Damaged,
}

/// A bake: makes the frames that are missing in its store, with solids as obstacles, and makes those again that are not
/// as they were written.
///
/// Dropping it ends the bake. The frames in the store are then complete, and the next bake continues from them.
pub struct Bake<'a, S> {
    simulation: &'a Simulation,
    solids: &'a [Solid],
    /// For errors.
    name: &'a str,
    store: S,
    /// The solver, if it has made the frame before.
    solver: Option<Solver<'a>>,
    /// Number of frames that have been reported.
    done: u32,
    /// Remains in the places of the frames that were made since.
    made: VecDeque<Found>,
}

impl<'a> Bake<'a, Folder> {
    /// Begins or continues a bake in files.
    ///
    /// # Errors
    /// As [`Folder::open`].
    pub fn in_folder(
        simulation: &'a Simulation,
        solids: &'a [Solid],
        name: &'a str,
        folder: &Path,
    ) -> Result<Self> {
        let store = Folder::open(simulation, solids, name, folder)?;
        Ok(Self::new(simulation, solids, name, store))
    }
}

impl<'a, S: Store> Bake<'a, S> {
    /// Frames that are made before the oldest of them is reported, at most.
    const AHEAD: usize = 3;

    /// Begins or continues a bake of a simulation that passes [`Simulation::check`].
    pub fn new(simulation: &'a Simulation, solids: &'a [Solid], name: &'a str, store: S) -> Self {
        Self { simulation, solids, name, store, solver: None, done: 0, made: VecDeque::new() }
    }

    /// Works until one more frame is in the store, in order and existing ones included. Returns `None` after the last.
    ///
    /// # Errors
    /// Those of the store; [`limpid::Error::Memory`] if the simulation needs too much.
    pub fn step(&mut self) -> Result<Option<Progress>> {
        let frames = self.simulation.frames;
        loop {
            let number = self.done + self.made.len() as u32 + 1;
            let wait = number > frames || self.made.len() >= Self::AHEAD;
            match self.made.front() {
                Some(&found) if found == Found::Whole || self.store.has_written(wait)? => {
                    self.made.pop_front();
                    self.done += 1;
                    let again = found == Found::Damaged;
                    return Ok(Some(Progress { done: self.done, frames, again }));
                }
                None if number > frames => return Ok(None),
                _ => self.make(number)?,
            }
        }
    }

    /// Makes a frame, unless it is in the store.
    fn make(&mut self, number: u32) -> Result<()> {
        let found = self.store.find(number)?;
        if found == Found::Whole {
            self.solver = None;
        } else {
            let solver = match &mut self.solver {
                Some(solver) => solver,
                None => {
                    let last =
                        (number > 1).then(|| state(&self.store.path(number - 1))).transpose()?;
                    memory::probe(self.simulation.memory(last.as_ref()), self.name)?;
                    self.solver.insert(Solver::new(self.simulation, self.solids, last))
                }
            };
            self.store.write(number, solver.make(number), found)?;
        }
        self.made.push_back(found);
        Ok(())
    }
}

/// Reads the state of a whole frame.
fn state(path: &Path) -> Result<State> {
    let state = State::from_particles(particles::read(path)?);
    state.ok_or_else(|| Error::format(path, "no frame of a bake: it has no velocities or ids"))
}

/// Paths of all frames of this name in a folder, in any order and with any numbers.
fn frames_in(folder: &Path, name: &str) -> Result<Vec<PathBuf>> {
    let fail = |e| Error::io(folder, "list", e);
    let entries = match std::fs::read_dir(folder) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(fail)?,
    };
    let paths = entries.map(|entry| entry.map(|entry| entry.path()).map_err(fail));
    let is_frame = |path: &PathBuf| {
        let stem = path.file_name().and_then(|n| n.to_str()).and_then(|n| n.strip_suffix(".bgeo"));
        let number = stem.and_then(|stem| stem.strip_prefix(name)?.strip_prefix('_'));
        let number = number.and_then(|number| number.parse().ok());
        number.is_some_and(|number| *path == frame_path(folder, name, number))
    };
    let frames: Result<Vec<PathBuf>> = paths.collect();
    Ok(frames?.into_iter().filter(is_frame).collect())
}
