//! A classifier for frames, on the CPU or on a device that may be opened later.

use std::fmt;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use crate::error::{Error, Result};
use limpid::gpu::Gpu;
use limpid::liquid::Particles;
use limpid::liquid::classify::{Classifier, Cloud, Splats, classify, probe_memory};
use limpid::settings::Classify;
use serde::{Deserialize, Serialize};

/// The processor that classifies particles: `classify.on` in a scene file. The results differ by less
/// than 10⁻⁴ r, at the surface by less than 10⁻³ r in all but one of a thousand splats.
///
/// The device leaves to the CPU the frames for which a uniform grid is unsuitable (very different radii,
/// crowded particles) and those that exceed its memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Processor {
    /// The graphics device if it is hardware and the frame has at least 8192 particles; otherwise the
    /// CPU.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// The graphics device, also a software one; frames fail if it cannot classify them.
    Gpu,
}

impl Processor {
    /// All processors, the default first.
    pub const ALL: [Self; 3] = [Self::Auto, Self::Cpu, Self::Gpu];
}

impl fmt::Display for Processor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
        })
    }
}

/// Number of particles below which the CPU takes about as long as a round trip to the device.
const MIN_DEVICE_PARTICLES: usize = 8192;

/// Classifies frames on the CPU or the device. Clones share one device; any thread may use them.
#[derive(Debug, Clone, Default)]
pub struct SharedClassifier {
    shared: Arc<Shared>,
}

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    /// Signals that the device has changed or a use of it has ended.
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    device: Device,
    /// Number of threads that classify on the device.
    uses: usize,
    closed: bool,
}

#[derive(Debug, Default)]
enum Device {
    #[default]
    None,
    /// Being opened.
    Pending,
    /// Open, with its classifier once one has been needed.
    Open(Gpu, Option<Arc<Classifier>>),
}

/// A thread's use of the device for classification.
struct DeviceUse<'a> {
    shared: &'a SharedClassifier,
    // `None` only during the drop.
    classifier: Option<Arc<Classifier>>,
}

impl Drop for DeviceUse<'_> {
    fn drop(&mut self) {
        // Before the count: a thread that waits for the last use must then hold the last reference.
        self.classifier = None;
        self.shared.lock().uses -= 1;
        self.shared.shared.changed.notify_all();
    }
}

impl SharedClassifier {
    /// Classifies on `gpu`, where the settings allow it.
    pub fn on(gpu: &Gpu) -> Self {
        let shared = Self::default();
        shared.set(Some(gpu));
        shared
    }

    /// Classifies on a device that is about to be opened: threads that need it wait for
    /// [`SharedClassifier::set`].
    pub fn awaited() -> Self {
        let shared = Self::default();
        shared.wait_for_device();
        shared
    }

    /// Makes threads that need a device wait for [`SharedClassifier::set`]. Returns `false`, without
    /// effect, if a device is open or already awaited, or after [`SharedClassifier::close`].
    pub fn wait_for_device(&self) -> bool {
        let mut state = self.lock();
        let waits = matches!(state.device, Device::None) && !state.closed;
        if waits {
            state.device = Device::Pending;
        }
        waits
    }

    /// Sets the device; `None` ends all waits without one.
    pub fn set(&self, gpu: Option<&Gpu>) {
        self.change(gpu.map_or(Device::None, |gpu| Device::Open(gpu.clone(), None)));
    }

    /// Releases the device for good and waits for the threads that use it: drivers do not tolerate
    /// threads that still hold a device when the program ends.
    pub fn close(&self) {
        self.set(None);
        let mut state = self.lock();
        (state.device, state.closed) = (Device::None, true);
        while state.uses > 0 {
            state = self.wait(state);
        }
    }

    fn change(&self, device: Device) {
        let mut state = self.lock();
        if !state.closed {
            let old = std::mem::replace(&mut state.device, device);
            drop(state);
            self.shared.changed.notify_all();
            // Dropped without the lock, since closing a device takes time.
            drop(old);
        }
    }

    /// As `SharedClassifier::finish`, blocking.
    ///
    /// # Errors
    /// As `SharedClassifier::finish`.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn classify(
        &self,
        particles: &Particles,
        default_radius: f32,
        settings: &Classify,
        processor: Processor,
    ) -> Result<Splats> {
        pollster::block_on(self.finish(particles, default_radius, settings, processor))
    }

    /// As [`classify`], on the device or the CPU. Waiting for the device yields in a browser and blocks elsewhere.
    ///
    /// # Errors
    /// [`limpid::Error::Memory`]. With [`Processor::Gpu`] also [`Error::Usage`] without a device,
    /// [`limpid::Error::Limit`] if the device cannot classify, and as [`Gpu::check`]; otherwise the CPU
    /// takes over.
    pub async fn finish(
        &self,
        particles: &Particles,
        default_radius: f32,
        settings: &Classify,
        processor: Processor,
    ) -> Result<Splats> {
        // Probed only now, since opening the device takes memory too.
        let on_cpu = || -> Result<Splats> {
            probe_memory(particles.len(), "the shapes of particles")?;
            Ok(classify(particles, default_radius, settings))
        };
        let on_device = async |device_use: DeviceUse<'_>| -> Result<Splats> {
            let classifier = device_use.classifier.as_ref().ok_or_else(no_device)?;
            Ok(classifier.finish(&Cloud::new(particles, default_radius), settings).await?)
        };
        match processor {
            Processor::Cpu => on_cpu(),
            Processor::Gpu => on_device(self.begin_use(|_| true)?.ok_or_else(no_device)?).await,
            Processor::Auto if particles.len() < MIN_DEVICE_PARTICLES => on_cpu(),
            Processor::Auto => {
                let splats = match self.begin_use(is_hardware).ok().flatten() {
                    Some(device_use) => on_device(device_use).await.ok(),
                    None => None,
                };
                splats.map_or_else(on_cpu, Ok)
            }
        }
    }

    /// Begins a use of the device, if there is one and it is `wanted`, after waiting for a pending one.
    fn begin_use(&self, wanted: impl Fn(&Gpu) -> bool) -> Result<Option<DeviceUse<'_>>> {
        let mut state = self.lock();
        while matches!(state.device, Device::Pending) {
            state = self.wait(state);
        }
        match &mut state.device {
            Device::Open(gpu, classifier) if wanted(gpu) => {
                let created = match classifier.take() {
                    Some(classifier) => classifier,
                    None => Arc::new(Classifier::new(gpu)?),
                };
                let classifier = Some(classifier.insert(created).clone());
                state.uses += 1;
                Ok(Some(DeviceUse { shared: self, classifier }))
            }
            _ => Ok(None),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.shared.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State>) -> MutexGuard<'a, State> {
        self.shared.changed.wait(state).unwrap_or_else(PoisonError::into_inner)
    }
}

fn no_device() -> Error {
    let problem =
        "classify.on is gpu, but no device was given to classify on; auto or cpu needs none";
    Error::Usage(problem.into())
}

/// Whether the device is hardware, and so faster than the CPU.
fn is_hardware(gpu: &Gpu) -> bool {
    use limpid::wgpu::Backend::BrowserWebGpu;
    use limpid::wgpu::DeviceType::{DiscreteGpu, IntegratedGpu, Other, VirtualGpu};
    let info = gpu.device.adapter_info();
    match info.device_type {
        DiscreteGpu | IntegratedGpu | VirtualGpu => true,
        // Browsers say no more than that an adapter is not a software one.
        Other => info.backend == BrowserWebGpu,
        _ => false,
    }
}
