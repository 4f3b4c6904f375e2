//! Frames of a bake in files of a folder.

use std::io;
use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::JoinHandle;

use limpid::liquid::Particles;
use limpid::scene::Solid;
use limpid_sim::sim::{Simulation, State};

use super::record::{self, Record};
use super::{Found, Store, frame_path, frames_in};
use crate::error::{Error, Result};
use crate::output;
use crate::particles;

/// The frames of a bake in files of a folder. A thread writes each while the next one is made; dropping this waits for it.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    name: String,
    record: Record,
    /// `None` when this is dropped.
    jobs: Option<Sender<Job>>,
    outcomes: Receiver<Result<Written>>,
    /// `None` after a panic, and when this is dropped.
    writer: Option<JoinHandle<()>>,
}

/// A frame to write.
struct Job {
    number: u32,
    particles: Box<Particles>,
    /// Whether a damaged file is in its place.
    again: bool,
}

/// A frame on disk.
#[derive(Debug)]
struct Written {
    number: u32,
    /// Checksum of its file.
    sum: u32,
}

impl Folder {
    /// Opens a folder for the frames of a simulation, `NAME_0001.bgeo` and so on, and creates it if it is missing.
    ///
    /// # Errors
    /// As [`Simulation::check`]; [`Error::Io`] if the folder cannot be written; [`Error::OtherBake`] if it contains
    /// frames of this name with other parameters, [`Error::UnknownBake`] if these have no record.
    pub fn open(
        simulation: &Simulation,
        solids: &[Solid],
        name: &str,
        folder: &Path,
    ) -> Result<Self> {
        simulation.check()?;
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
        let record = Record::keep(simulation, solids, name, folder)?;
        let (job_sender, jobs) = channel::<Job>();
        let (outcome_sender, outcomes) = channel();
        let (path, name) = (folder.to_owned(), name.to_owned());
        let write = {
            let (path, name) = (path.clone(), name.clone());
            move || {
                for job in jobs {
                    let outcome = job.done(&path, &name);
                    let failed = outcome.is_err();
                    if outcome_sender.send(outcome).is_err() || failed {
                        return;
                    }
                }
            }
        };
        let writer = std::thread::Builder::new().spawn(write).map_err(Error::Threads)?;
        let (jobs, writer) = (Some(job_sender), Some(writer));
        Ok(Self { path, name, record, jobs, outcomes, writer })
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        self.jobs = None;
        if let Some(writer) = self.writer.take() {
            // Nobody waits for the frames that a panic has lost.
            let _ = writer.join();
        }
    }
}

impl Store for Folder {
    /// One whose checksum is not recorded is whole if the next frame can be made from it.
    ///
    /// # Errors
    /// [`Error::Io`] or [`limpid::Error::Memory`] for a frame that cannot be read, but may be whole.
    fn find(&mut self, number: u32) -> Result<Found> {
        let path = self.path(number);
        if !path.exists() {
            return Ok(Found::Nothing);
        }
        let sum = record::checksum(&path)?;
        let whole = match self.record.sum(number) {
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
        if !whole {
            return Ok(Found::Damaged);
        }
        self.record.add(number, sum)?;
        Ok(Found::Whole)
    }

    fn path(&self, number: u32) -> PathBuf {
        frame_path(&self.path, &self.name, number)
    }

    fn write(&mut self, number: u32, particles: Particles, found: Found) -> Result<()> {
        let particles = Box::new(particles);
        let job = Job { number, particles, again: found == Found::Damaged };
        // A failed writer has closed the channel; its error is among the outcomes.
        let _ = self.jobs.as_ref().map(|jobs| jobs.send(job));
        Ok(())
    }

    fn has_written(&mut self, wait: bool) -> Result<bool> {
        let outcome = match self.outcomes.try_recv() {
            Err(TryRecvError::Empty) if !wait => return Ok(false),
            Err(TryRecvError::Empty) => self.outcomes.recv().ok(),
            outcome => outcome.ok(),
        };
        let Some(outcome) = outcome else {
            return match self.writer.take().map(JoinHandle::join) {
                Some(Err(panic)) => resume_unwind(panic),
                // It ends after an error, which has been returned before.
                _ => Err(Error::Threads(io::ErrorKind::BrokenPipe.into())),
            };
        };
        let Written { number, sum } = outcome?;
        self.record.add(number, sum)?;
        Ok(true)
    }
}

impl Job {
    fn done(self, folder: &Path, name: &str) -> Result<Written> {
        let Self { number, particles, again } = self;
        let path = frame_path(folder, name, number);
        if again {
            // Only particle files are replaced. A failure is reported by writing.
            let _ = std::fs::remove_file(&path);
        }
        particles::write(&particles, &path)?;
        Ok(Written { number, sum: record::checksum(&path)? })
    }
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
