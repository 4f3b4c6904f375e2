//! Splats that stay on the device.

use bytemuck::Zeroable;
use glam::{DVec3, Vec3};

use crate::liquid::classify::Splat;

/// The splats of particles on the device: one for each, some of them hidden. The host knows only their box.
#[derive(Debug, Clone, PartialEq)]
pub struct DeviceSplats {
    /// `array<Splat>` in the order of the particles.
    pub(crate) buffer: wgpu::Buffer,
    /// Splats of the particles, then copies of them.
    pub(crate) count: u32,
    /// Particles.
    pub(crate) members: u32,
    /// Corners of a box around the centres, relative to the splats' origin, m.
    pub(crate) bounds: (DVec3, DVec3),
    /// Greatest semi-axis of a splat, m, and of most splats.
    pub(crate) reach: f32,
    pub(crate) usual_reach: f32,
    /// Whether there may be droplets.
    pub(crate) has_splashes: bool,
    /// Whether there may be particles of different radii.
    pub(crate) radii_differ: bool,
    /// Which classification they come from.
    pub(crate) generation: u64,
}

impl DeviceSplats {
    /// Spheres around the corners of the box, as large as splats reach: any directional bound that holds for these spheres
    /// holds for the splats.
    pub(crate) fn corners(&self) -> [Splat; 8] {
        let (min, max) = self.bounds;
        std::array::from_fn(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { min[axis] } else { max[axis] };
            Splat {
                centre: DVec3::new(pick(0), pick(1), pick(2)).as_vec3().to_array(),
                radius: self.reach,
                diagonal: [self.reach; 3],
                ..Zeroable::zeroed()
            }
        })
    }

    /// Lower bound on the distance of the splats from a place relative to their origin, m; 0 among them.
    pub(crate) fn distance(&self, place: DVec3) -> f64 {
        let (min, max) = self.bounds;
        let beside = (min - place).max(place - max).max(DVec3::ZERO).length();
        (beside - f64::from(self.reach)).max(0.0)
    }

    /// The corners of the box, in 32 bits.
    pub(crate) fn bounds_32(&self) -> (Vec3, Vec3) {
        (self.bounds.0.as_vec3(), self.bounds.1.as_vec3())
    }
}
