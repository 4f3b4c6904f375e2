//! Simulations, frame by frame.

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use limpid::liquid::Particles;
use limpid::memory;
use limpid_io::project::Project;
use limpid_sim::sim::Solver;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::{arrays, errors, work};

/// How long an interrupt may take to be seen.
const PATIENCE: Duration = Duration::from_millis(20);

/// The frames of a simulation: one is computed while the last is used.
#[pyclass(frozen, module = "limpid._limpid")]
pub(crate) struct Bake {
    frames: Arc<Mutex<Frames>>,
    /// Number of frames.
    #[pyo3(get)]
    count: u32,
    /// Particle radius, m.
    #[pyo3(get)]
    radius: f64,
    /// Frames per second.
    #[pyo3(get)]
    fps: f64,
}

/// The frames that are computed.
struct Frames {
    receiver: Receiver<Particles>,
    /// A frame that was received and not yet taken, as after Ctrl-C.
    ready: Option<Particles>,
    /// Number of frames that are to come.
    left: u32,
}

#[pymethods]
impl Bake {
    /// Begins the simulation of a scene file; `count` is the number of frames, or the scene's.
    #[new]
    fn new(py: Python<'_>, path: PathBuf, count: Option<u32>) -> PyResult<Self> {
        let (simulation, solids) = work::run(py, move |_| {
            let mut project = Project::load(&path)?;
            let mut simulation = project.simulation_mut(&path.display().to_string())?.clone();
            simulation.frames = count.unwrap_or(simulation.frames);
            simulation.check()?;
            memory::probe(simulation.memory(None), path.display())?;
            Ok((simulation, project.scene.solids))
        })?;
        let (count, radius, fps) =
            (simulation.frames, simulation.particle_radius(), simulation.fps);
        let (sender, receiver) = sync_channel(1);
        // Ends with the frame that nobody takes any more.
        let simulate = move || {
            let mut solver = Solver::new(&simulation, &solids, None);
            for number in 1..=count {
                if sender.send(solver.make(number)).is_err() {
                    return;
                }
            }
        };
        let spawned = std::thread::Builder::new().name("limpid bake".into()).spawn(simulate);
        spawned.map_err(|error| errors::raise(limpid_io::Error::Threads(error)))?;
        let frames = Frames { receiver, ready: None, left: count };
        Ok(Self { frames: Arc::new(Mutex::new(frames)), count, radius, fps })
    }

    /// The arrays of the next frame; `None` after the last.
    fn next<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let frames = self.frames.clone();
        work::run(py, move |interrupt| {
            let mut frames = locked(&frames);
            while frames.ready.is_none() && frames.left > 0 && !interrupt.load(Ordering::Relaxed) {
                match frames.receiver.recv_timeout(PATIENCE) {
                    Ok(particles) => frames.ready = Some(particles),
                    // The solver has panicked.
                    Err(RecvTimeoutError::Disconnected) => break,
                    Err(RecvTimeoutError::Timeout) => {}
                }
            }
            Ok(())
        })?;
        // A signal that came last must not lose the frame between here and the caller.
        py.check_signals()?;
        let mut frames = locked(&self.frames);
        match frames.ready.take() {
            Some(particles) => {
                frames.left -= 1;
                arrays::to_arrays(py, particles).map(Some)
            }
            None if frames.left > 0 => Err(errors::panicked()),
            None => Ok(None),
        }
    }
}

fn locked(frames: &Mutex<Frames>) -> MutexGuard<'_, Frames> {
    frames.lock().unwrap_or_else(PoisonError::into_inner)
}
