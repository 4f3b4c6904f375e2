//! Where frames are classified: on the CPU, or on a device that may not be open yet.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use super::device::Classifier;
use super::{Splats, classify};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::particles::Particles;
use crate::settings::{Classify, Processor};

/// Frames of fewer particles take the CPU about as long as the device takes to answer.
const FEW: usize = 8192;

/// Where frames are classified. Its clones are one place; any thread may ask.
#[derive(Debug, Clone, Default)]
pub struct Place {
    shared: Arc<Shared>,
}

#[derive(Debug, Default)]
struct Shared {
    device: Mutex<Device>,
    come: Condvar,
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

impl Place {
    /// On a device, where the settings allow it.
    pub fn on(gpu: &Gpu) -> Self {
        let place = Self::default();
        place.set(Some(gpu));
        place
    }

    /// On a device that is about to be opened: who needs it waits until [`Place::set`] tells of it.
    pub fn awaited() -> Self {
        let place = Self::default();
        place.wait_for_device();
        place
    }

    /// Whether there is no device, and none is awaited.
    pub fn is_without_device(&self) -> bool {
        matches!(*self.lock(), Device::None)
    }

    /// From now on, who needs a device waits until [`Place::set`] tells of one.
    pub fn wait_for_device(&self) {
        *self.lock() = Device::Awaited;
    }

    /// The device from now on; without one, whoever waits hears that there is none.
    pub fn set(&self, gpu: Option<&Gpu>) {
        *self.lock() = gpu.map_or(Device::None, |gpu| Device::Open(gpu.clone(), None));
        self.shared.come.notify_all();
    }

    /// As [`super::classify`], where the settings say: [`Classify::on`].
    ///
    /// # Errors
    /// Of [`Processor::Gpu`]: [`Error::Usage`] without a device, [`Error::Adapter`] if it cannot
    /// classify, and as [`Gpu::check`]. Of the others none: what the device does not do, the CPU
    /// does.
    pub fn classify(
        &self,
        particles: &Particles,
        default_radius: f32,
        settings: &Classify,
    ) -> Result<Splats> {
        let on_cpu = || classify(particles, default_radius, settings);
        let on_device = |c: &Classifier| c.classify(particles, default_radius, settings);
        match settings.on {
            Processor::Cpu => Ok(on_cpu()),
            Processor::Gpu => on_device(&*self.classifier(|_| true)?.ok_or_else(no_device)?),
            Processor::Auto if particles.len() < FEW => Ok(on_cpu()),
            Processor::Auto => {
                let classifier = self.classifier(is_hardware).ok().flatten();
                let splats = classifier.and_then(|classifier| on_device(&classifier).ok());
                Ok(splats.unwrap_or_else(on_cpu))
            }
        }
    }

    /// What classifies on the device, if there is one and it is `wanted`.
    fn classifier(&self, wanted: impl Fn(&Gpu) -> bool) -> Result<Option<Arc<Classifier>>> {
        let mut device = self.lock();
        while matches!(*device, Device::Awaited) {
            device = self.shared.come.wait(device).unwrap_or_else(PoisonError::into_inner);
        }
        match &mut *device {
            Device::Open(gpu, classifier) if wanted(gpu) => {
                let there = match classifier.take() {
                    Some(classifier) => classifier,
                    None => Arc::new(Classifier::new(gpu)?),
                };
                Ok(Some(classifier.insert(there).clone()))
            }
            _ => Ok(None),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Device> {
        self.shared.device.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn no_device() -> Error {
    let problem =
        "classify.on is gpu, but no device was given to classify on; auto or cpu needs none";
    Error::Usage(problem.into())
}

/// Whether it is faster than the CPU: it is not the CPU itself.
fn is_hardware(gpu: &Gpu) -> bool {
    use wgpu::DeviceType::{DiscreteGpu, IntegratedGpu, VirtualGpu};
    matches!(gpu.device.adapter_info().device_type, DiscreteGpu | IntegratedGpu | VirtualGpu)
}
