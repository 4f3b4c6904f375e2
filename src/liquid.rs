//! Particles and their classification into splats.

mod between;
#[doc(hidden)]
pub mod blocks;
pub mod bulk;
pub mod classify;
#[doc(hidden)]
pub mod counting_sort;
mod device_particles;
mod ellipsoid;
pub mod particles;
mod up;

pub use crate::up_axis::Up;
pub use bulk::Bulk;
pub use classify::colors::{ColorMap, Colors};
pub use device_particles::{Attribute, Counter, DeviceParticles};
pub use ellipsoid::Ellipsoid;
pub use particles::Particles;
pub use up::likely_up;
