//! Simulations, frame by frame.

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::mpsc::{Receiver, sync_channel};

use limpid::liquid::Particles;
use limpid::memory;
use limpid_io::project::Project;
use limpid_sim::sim::Solver;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::{arrays, work};

/// The frames of a simulation: one is computed while the last is used.
#[pyclass(frozen, module = "limpid._limpid")]
pub(crate) struct Bake {
    frames: std::sync::Arc<Mutex<Receiver<Particles>>>,
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
        let (sender, frames) = sync_channel(1);
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
        spawned.map_err(|error| crate::errors::raise(limpid_io::Error::Threads(error)))?;
        Ok(Self { frames: std::sync::Arc::new(Mutex::new(frames)), count, radius, fps })
    }

    /// The arrays of the next frame; `None` after the last.
    fn next<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let frames = self.frames.clone();
        let particles = work::run(py, move |interrupt| {
            let frames = frames.lock().unwrap_or_else(PoisonError::into_inner);
            loop {
                match frames.recv_timeout(std::time::Duration::from_millis(20)) {
                    Ok(particles) => return Ok(Some(particles)),
                    Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => return Ok(None),
                    Err(_) if interrupt.load(std::sync::atomic::Ordering::Relaxed) => {
                        return Ok(None);
                    }
                    Err(_) => {}
                }
            }
        })?;
        particles.map(|particles| arrays::to_arrays(py, particles)).transpose()
    }
}
