//! Simulations as files: the frames of a scene's `[simulation]`, made once and read from then on.

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

/// How far a bake has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Frames that are on disk.
    pub done: u32,
    /// Frames that there will be.
    pub frames: u32,
}

/// Where the frames of a scene file are baked to if nothing else is said: `sims/baked/dam_break`
/// for `sims/dam_break.toml`.
pub fn folder(scene_file: &Path) -> PathBuf {
    let name = scene_file.file_stem().unwrap_or_default();
    scene_file.parent().unwrap_or(Path::new("")).join("baked").join(name)
}

/// The file of a frame.
pub fn frame_path(folder: &Path, name: &str, number: u32) -> PathBuf {
    folder.join(format!("{name}_{number:04}.bgeo"))
}

/// The pattern of all frames' files.
pub fn frame_pattern(folder: &Path, name: &str) -> String {
    folder.join(format!("{name}_{{}}.bgeo")).to_string_lossy().into_owned()
}

/// Makes the frames of a simulation among `solids` that are not in `folder` yet.
///
/// `progress` is told of each frame that is on disk, also of those found there, in order, and ends
/// the bake by [`ControlFlow::Break`]; what is there then is whole, and the next bake goes on
/// from it.
///
/// # Errors
/// As [`Simulation::check`]; [`Error::Io`] if
/// the folder cannot be written, [`Error::OtherBake`] if it holds frames of this name that other
/// parameters made.
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
    let (found, last) = found(simulation, name, folder)?;
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
        // A frame is written while the next one is made.
        let (made, to_write) = sync_channel::<(u32, Particles)>(1);
        let (wrote, written) = channel();
        let write = move || {
            for (number, particles) in to_write {
                let outcome = particles::write(&particles, &frame_path(folder, name, number))
                    .map(|()| number);
                let failed = outcome.is_err();
                if wrote.send(outcome).is_err() || failed {
                    return;
                }
            }
        };
        std::thread::Builder::new().spawn_scoped(scope, write).map_err(Error::Threads)?;
        let mut frame = Solver::new(simulation, solids, last);
        let mut tell =
            |outcome: Result<u32>| outcome.map(|done| progress(Progress { done, frames }));
        for number in found + 1..=frames {
            // The writer is gone once it has failed; why is among what it said.
            let gone = made.send((number, frame.make(number))).is_err();
            for outcome in written.try_iter() {
                if tell(outcome)?.is_break() {
                    return Ok(());
                }
            }
            if gone {
                break;
            }
        }
        drop(made);
        for outcome in written {
            if tell(outcome)?.is_break() {
                break;
            }
        }
        Ok(())
    })
}

/// Removes a bake's frames and its record, so that the next one begins anew.
///
/// # Errors
/// [`Error::Io`] naming the file that could not be removed; [`Error::UnknownBake`] for frames without a
/// record, which may be another program's.
pub fn clear(name: &str, folder: &Path) -> Result<()> {
    let remove = |path: &Path| std::fs::remove_file(path).map_err(|e| Error::io(path, "remove", e));
    let (frames, record) = (frames_in(folder, name)?, record::path(folder, name));
    if !frames.is_empty() && !record.exists() {
        return Err(Error::UnknownBake { folder: folder.to_owned(), name: name.to_owned() });
    }
    if record.exists() {
        output::FileKind::BAKE_RECORD.check(&record)?;
    }
    // The record last: without it the frames that are left would be nobody's.
    for path in frames {
        remove(&path)?;
    }
    if record.exists() { remove(&record) } else { Ok(()) }
}

/// The frames of this name that are there, whatever their numbers.
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

/// The number of whole frames that are there without a gap, and the particles of the last.
///
/// # Errors
/// [`Error::Io`], [`limpid::Error::Memory`]: the frame may be whole.
fn found(simulation: &Simulation, name: &str, folder: &Path) -> Result<(u32, Option<State>)> {
    let there = |number: &u32| frame_path(folder, name, *number).exists();
    let mut found = (1..=simulation.frames).take_while(there).count() as u32;
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
        // By the record it is this bake's, but it is no particle file, which would be replaced. That it
        // cannot be removed is an error once it is written.
        let _ = std::fs::remove_file(path);
        found -= 1;
    }
    Ok((0, None))
}
