//! Where frames are classified: on the CPU, or on a device that may not be open yet.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use crate::error::{Error, Result};
use crate::project::Processor;
use limpid::gpu::Gpu;
use limpid::liquid::Particles;
use limpid::liquid::classify::{Classifier, Splats, classify, probe_memory};
use limpid::settings::Classify;

/// Frames of fewer particles take the CPU about as long as the device takes to answer.
const FEW: usize = 8192;

/// Where frames are classified. Its clones share one device; any thread may ask.
#[derive(Debug, Clone, Default)]
pub struct SharedClassifier {
    shared: Arc<Shared>,
}

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    /// A device has come, or someone has done.
    come: Condvar,
}

#[derive(Debug, Default)]
struct State {
    device: Device,
    /// How many classify on it.
    users: usize,
    closed: bool,
}

#[derive(Debug, Default)]
enum Device {
    #[default]
    None,
    /// Someone opens one.
    Awaited,
    /// With what classifies on it, once that was needed.
    Open(Gpu, Option<Arc<Classifier>>),
}

/// Someone who classifies on the device.
struct User<'a> {
    shared: &'a SharedClassifier,
    // Always there until it is dropped.
    classifier: Option<Arc<Classifier>>,
}

impl Drop for User<'_> {
    fn drop(&mut self) {
        // First this: whoever waits for the last user is the last to have the device.
        self.classifier = None;
        self.shared.lock().users -= 1;
        self.shared.shared.come.notify_all();
    }
}

impl SharedClassifier {
    /// On a device, where the settings allow it.
    pub fn on(gpu: &Gpu) -> Self {
        let shared = Self::default();
        shared.set(Some(gpu));
        shared
    }

    /// On a device that is about to be opened: who needs it waits until [`SharedClassifier::set`] tells of it.
    pub fn awaited() -> Self {
        let shared = Self::default();
        shared.wait_for_device();
        shared
    }

    /// From now on, who needs a device waits until [`SharedClassifier::set`] tells of one. Returns whether: not if
    /// there is a device, or one is awaited already.
    pub fn wait_for_device(&self) -> bool {
        let mut state = self.lock();
        let waits = matches!(state.device, Device::None) && !state.closed;
        if waits {
            state.device = Device::Awaited;
        }
        waits
    }

    /// The device from now on; without one, whoever waits hears that there is none.
    pub fn set(&self, gpu: Option<&Gpu>) {
        self.change(gpu.map_or(Device::None, |gpu| Device::Open(gpu.clone(), None)));
    }

    /// Lets go of the device, for ever, and waits for those who classify on it: drivers do not bear
    /// threads that still have one when the program ends.
    pub fn close(&self) {
        self.set(None);
        let mut state = self.lock();
        (state.device, state.closed) = (Device::None, true);
        while state.users > 0 {
            state = self.wait(state);
        }
    }

    fn change(&self, device: Device) {
        let mut state = self.lock();
        if !state.closed {
            let old = std::mem::replace(&mut state.device, device);
            drop(state);
            self.shared.come.notify_all();
            // A device may take its time to go.
            drop(old);
        }
    }

    /// As [`classify`], on the device or the CPU.
    ///
    /// # Errors
    /// [`limpid::Error::Memory`]. Of [`Processor::Gpu`]: [`Error::Usage`] without a device,
    /// [`limpid::Error::Limit`] if it cannot classify, and as [`Gpu::check`]: of the others what the device
    /// does not do, the CPU does.
    pub fn classify(
        &self,
        particles: &Particles,
        default_radius: f32,
        settings: &Classify,
        processor: Processor,
    ) -> Result<Splats> {
        // When the device is open: that takes memory too.
        let on_cpu = || -> Result<Splats> {
            probe_memory(particles.len(), "the shapes of particles")?;
            Ok(classify(particles, default_radius, settings))
        };
        let on_device = |user: User<'_>| {
            let classifier = user.classifier.as_ref().ok_or_else(no_device)?;
            Ok(classifier.classify(particles, default_radius, settings)?)
        };
        match processor {
            Processor::Cpu => on_cpu(),
            Processor::Gpu => on_device(self.user(|_| true)?.ok_or_else(no_device)?),
            Processor::Auto if particles.len() < FEW => on_cpu(),
            Processor::Auto => {
                let user = self.user(is_hardware).ok().flatten();
                let splats = user.and_then(|user| on_device(user).ok());
                splats.map_or_else(on_cpu, Ok)
            }
        }
    }

    /// Someone who classifies on the device, if there is one and it is `wanted`.
    fn user(&self, wanted: impl Fn(&Gpu) -> bool) -> Result<Option<User<'_>>> {
        let mut state = self.lock();
        while matches!(state.device, Device::Awaited) {
            state = self.wait(state);
        }
        match &mut state.device {
            Device::Open(gpu, classifier) if wanted(gpu) => {
                let there = match classifier.take() {
                    Some(classifier) => classifier,
                    None => Arc::new(Classifier::new(gpu)?),
                };
                let classifier = Some(classifier.insert(there).clone());
                state.users += 1;
                Ok(Some(User { shared: self, classifier }))
            }
            _ => Ok(None),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.shared.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State>) -> MutexGuard<'a, State> {
        self.shared.come.wait(state).unwrap_or_else(PoisonError::into_inner)
    }
}

fn no_device() -> Error {
    let problem =
        "classify.on is gpu, but no device was given to classify on; auto or cpu needs none";
    Error::Usage(problem.into())
}

/// Whether it is faster than the CPU: it is not the CPU itself.
fn is_hardware(gpu: &Gpu) -> bool {
    use limpid::wgpu::DeviceType::{DiscreteGpu, IntegratedGpu, VirtualGpu};
    matches!(gpu.device.adapter_info().device_type, DiscreteGpu | IntegratedGpu | VirtualGpu)
}
