//! Baking: simulating the frames of a scene's `[simulation]` into files.

mod record;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{channel, sync_channel};

use limpid::liquid::Particles;
use limpid::memory;
use limpid::scene::Solid;
use limpid_sim::sim::{Simulation, Solver, State};

use crate::error::{Error, Result};
use crate::output;
use crate::particles;

/// The progress of a bake.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Number of frames on disk.
    pub done: u32,
    /// Number of all frames.
    pub frames: u32,
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

/// Simulates the frames that are missing in `folder`, with `solids` as obstacles.
///
/// `progress` is called for each frame on disk in order, including existing ones, and may end the bake
/// by [`ControlFlow::Break`]. The frames on disk are then complete, and the next bake continues from
/// them.
///
/// # Errors
/// As [`Simulation::check`]; [`Error::Io`] if the folder cannot be written; [`Error::OtherBake`] if it
/// contains frames of this name with other parameters, [`Error::UnknownBake`] if these have no record.
pub fn bake(
    simulation: &Simulation,
    solids: &[Solid],
    name: &str,
    folder: &Path,
    mut progress: impl FnMut(Progress) -> ControlFlow<()>,
) -> Result<()> {
    simulation.check()?;
    let frames = simulation.frames;
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
    record::keep(simulation, solids, name, folder)?;
    let (found, last) = existing(simulation, name, folder)?;
    for done in 1..=found {
        if progress(Progress { done, frames }).is_break() {
            return Ok(());
        }
    }
    if found >= frames {
        return Ok(());
    }

    memory::probe(simulation.memory(last.as_ref()), name)?;

    std::thread::scope(|scope| {
        // A thread writes each frame while the next one is simulated.
        let (frame_sender, frames_to_write) = sync_channel::<(u32, Particles)>(1);
        let (outcome_sender, outcomes) = channel();
        let write = move || {
            for (number, particles) in frames_to_write {
                let outcome = particles::write(&particles, &frame_path(folder, name, number))
                    .map(|()| number);
                let failed = outcome.is_err();
                if outcome_sender.send(outcome).is_err() || failed {
                    return;
                }
            }
        };
        std::thread::Builder::new().spawn_scoped(scope, write).map_err(Error::Threads)?;
        let mut solver = Solver::new(simulation, solids, last);
        let mut report =
            |outcome: Result<u32>| outcome.map(|done| progress(Progress { done, frames }));
        for number in found + 1..=frames {
            // A failed writer has closed the channel; its error is among the outcomes.
            let closed = frame_sender.send((number, solver.make(number))).is_err();
            for outcome in outcomes.try_iter() {
                if report(outcome)?.is_break() {
                    return Ok(());
                }
            }
            if closed {
                break;
            }
        }
        drop(frame_sender);
        for outcome in outcomes {
            if report(outcome)?.is_break() {
                break;
            }
        }
        Ok(())
    })
}

/// Removes a bake's frames and its record, so that the next bake starts from the beginning.
///
/// # Errors
/// [`Error::Io`] naming the file that could not be removed; [`Error::UnknownBake`] for frames without a
/// record, which may belong to another program.
pub fn clear(name: &str, folder: &Path) -> Result<()> {
    let remove = |path: &Path| std::fs::remove_file(path).map_err(|e| Error::io(path, "remove", e));
    let (frames, record) = (frames_in(folder, name)?, record::path(folder, name));
    if !frames.is_empty() && !record.exists() {
        return Err(Error::UnknownBake { folder: folder.to_owned(), name: name.to_owned() });
    }
    if record.exists() {
        output::FileKind::BAKE_RECORD.check(&record)?;
    }
    // The record is removed last, since frames without it would be unknown.
    for path in frames {
        remove(&path)?;
    }
    if record.exists() { remove(&record) } else { Ok(()) }
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

/// Counts the complete frames without a gap from the first, and reads the state of the last.
///
/// # Errors
/// [`Error::Io`] or [`limpid::Error::Memory`] for a frame that cannot be read, but may be complete.
fn existing(simulation: &Simulation, name: &str, folder: &Path) -> Result<(u32, Option<State>)> {
    let exists = |number: &u32| frame_path(folder, name, *number).exists();
    let mut found = (1..=simulation.frames).take_while(exists).count() as u32;
    while found > 0 {
        let path = frame_path(folder, name, found);
        let last = match particles::read(&path) {
            Ok(last) => State::from_particles(last),
            Err(Error::Malformed { .. } | Error::TooLarge { .. } | Error::Format { .. }) => None,
            Err(error) => return Err(error),
        };
        if last.is_some() {
            return Ok((found, last));
        }
        // A frame of this bake that is not a particle file: removed, since only particle files are
        // replaced. A failure is reported when the frame is written.
        let _ = std::fs::remove_file(path);
        found -= 1;
    }
    Ok((0, None))
}
