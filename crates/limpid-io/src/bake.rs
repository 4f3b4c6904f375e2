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

use self::record::Record;

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

/// Simulates the frames that are missing in `folder`, with `solids` as obstacles, and makes those again that
/// are not as they were written.
///
/// `progress` is called for each frame on disk in order, including existing ones, and may end the bake
/// by [`ControlFlow::Break`]. The frames on disk are then complete, and the next bake continues from
/// them.
///
/// # Errors
/// As [`Simulation::check`]; [`Error::Io`] if the folder cannot be written, or a frame in it cannot be read;
/// [`Error::OtherBake`] if it contains frames of this name with other parameters, [`Error::UnknownBake`] if
/// these have no record.
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
    let mut record = Record::keep(simulation, solids, name, folder)?;
    std::thread::scope(|scope| {
        // A thread writes each frame while the next one is simulated.
        let (job_sender, jobs) = sync_channel::<Job>(1);
        let (outcome_sender, outcomes) = channel();
        let write = move || {
            for job in jobs {
                let outcome = job.done(folder, name);
                let failed = outcome.is_err();
                if outcome_sender.send(outcome).is_err() || failed {
                    return;
                }
            }
        };
        std::thread::Builder::new().spawn_scoped(scope, write).map_err(Error::Threads)?;
        let mut report = |outcome: Result<Written>, record: &mut Record| -> Result<_> {
            let Written { number, sum, again } = outcome?;
            record.add(number, sum)?;
            Ok(progress(Progress { done: number, frames, again }))
        };
        // The solver, if it has made the frame before.
        let mut solver: Option<Solver<'_>> = None;
        for number in 1..=frames {
            let found = found(&record, folder, name, number)?;
            let again = matches!(found, Found::Damaged);
            let made = if let Found::Whole(sum) = found {
                solver = None;
                Made::Before(sum)
            } else {
                let solver = match &mut solver {
                    Some(solver) => solver,
                    None => {
                        let before = number.checked_sub(1).filter(|&before| before > 0);
                        let last = before.map(|before| state(folder, name, before)).transpose()?;
                        memory::probe(simulation.memory(last.as_ref()), name)?;
                        solver.insert(Solver::new(simulation, solids, last))
                    }
                };
                Made::Now(Box::new(solver.make(number)))
            };
            // A failed writer has closed the channel; its error is among the outcomes.
            let closed = job_sender.send(Job { number, again, made }).is_err();
            for outcome in outcomes.try_iter() {
                if report(outcome, &mut record)?.is_break() {
                    return Ok(());
                }
            }
            if closed {
                break;
            }
        }
        drop(job_sender);
        for outcome in outcomes {
            if report(outcome, &mut record)?.is_break() {
                break;
            }
        }
        Ok(())
    })
}

/// A frame for the writer.
struct Job {
    number: u32,
    /// Whether a damaged file is in its place.
    again: bool,
    made: Made,
}

enum Made {
    /// By an earlier bake, with this checksum.
    Before(u32),
    Now(Box<Particles>),
}

/// A frame on disk.
struct Written {
    number: u32,
    /// Checksum of its file.
    sum: u32,
    again: bool,
}

impl Job {
    /// Writes the frame, unless it is there.
    fn done(self, folder: &Path, name: &str) -> Result<Written> {
        let Self { number, again, made } = self;
        let sum = match made {
            Made::Before(sum) => sum,
            Made::Now(particles) => {
                let path = frame_path(folder, name, number);
                if again {
                    // Only particle files are replaced. A failure is reported by writing.
                    let _ = std::fs::remove_file(&path);
                }
                particles::write(&particles, &path)?;
                record::checksum(&path)?
            }
        };
        Ok(Written { number, sum, again })
    }
}

/// Remains of a frame from an earlier bake.
enum Found {
    Nothing,
    /// The frame as it was written, with the checksum of its file.
    Whole(u32),
    Damaged,
}

/// Looks for a frame. One whose checksum is not recorded is whole if the next frame can be made from it.
///
/// # Errors
/// [`Error::Io`] or [`limpid::Error::Memory`] for a frame that cannot be read, but may be whole.
fn found(record: &Record, folder: &Path, name: &str, number: u32) -> Result<Found> {
    let path = frame_path(folder, name, number);
    if !path.exists() {
        return Ok(Found::Nothing);
    }
    let sum = record::checksum(&path)?;
    let whole = match record.sum(number) {
        Some(recorded) => recorded == sum,
        None => match particles::read(&path) {
            Ok(particles) => State::from_particles(particles).is_some(),
            Err(
                Error::Malformed { .. }
                | Error::Unplaced { .. }
                | Error::TooLarge { .. }
                | Error::Format { .. },
            ) => false,
            Err(error) => return Err(error),
        },
    };
    Ok(if whole { Found::Whole(sum) } else { Found::Damaged })
}

/// The state of a whole frame.
fn state(folder: &Path, name: &str, number: u32) -> Result<State> {
    let path = frame_path(folder, name, number);
    let state = State::from_particles(particles::read(&path)?);
    state.ok_or_else(|| Error::format(&path, "no frame of a bake: it has no velocities or ids"))
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
