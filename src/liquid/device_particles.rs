//! Particles in memory of the graphics device.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::liquid::particles::drawable;

/// Particles in buffers of the device that draws them, as simulations on the device have them.
///
/// Positions that are not finite, and radii that are not positive, are not drawn. What only the host could know of them
/// is asked of the caller: how large they are, and in which box they stay.
#[derive(Debug, Clone, Copy)]
pub struct DeviceParticles<'a> {
    /// Centres relative to the origin, m: three 32-bit floats each.
    pub positions: Attribute<'a>,
    /// Number of particles; with a counter, the largest number that there may be.
    pub count: u32,
    /// The number of particles, a 32-bit integer, where only the device knows it.
    pub counter: Option<Counter<'a>>,
    /// Particle radius, m; of different ones the common one.
    pub radius: f32,
    /// Particle radii, m: a 32-bit float each. Those of less than a quarter or of more than four times the common radius count
    /// as that.
    pub radii: Option<Attribute<'a>>,
    /// Origin of the positions in world space, m.
    pub origin: DVec3,
    /// Minimum and maximum corner of a box in world space, m, that holds the particles: the walls of the simulation. Those outside
    /// of it are drawn, but more slowly; lights and the near plane go by the box.
    pub bounds: (DVec3, DVec3),
}

/// An attribute of each particle in a buffer, which has [`wgpu::BufferUsages::STORAGE`].
#[derive(Debug, Clone, Copy)]
pub struct Attribute<'a> {
    /// The buffer.
    pub buffer: &'a wgpu::Buffer,
    /// Place of the first particle's, bytes; a multiple of 4.
    pub offset: u64,
    /// From one particle's to the next one's, bytes; a multiple of 4.
    pub stride: u64,
}

/// A number in a buffer, which has [`wgpu::BufferUsages::STORAGE`].
#[derive(Debug, Clone, Copy)]
pub struct Counter<'a> {
    /// The buffer.
    pub buffer: &'a wgpu::Buffer,
    /// Its place, bytes; a multiple of 4.
    pub offset: u64,
}

impl DeviceParticles<'_> {
    /// Fails if they cannot be read.
    pub(crate) fn check(&self) -> Result<()> {
        let fail = |problem: String| Err(Error::invalid("particles", problem));
        if !drawable(self.radius) {
            return fail(format!("a radius of {} m cannot be drawn", self.radius));
        }
        let (min, max) = self.bounds;
        if !(min.is_finite() && max.is_finite() && self.origin.is_finite() && min.cmple(max).all())
        {
            return fail(format!("{min} to {max} m around {} m are no bounds", self.origin));
        }
        let attributes =
            [Some((self.positions, 12, "positions")), self.radii.map(|radii| (radii, 4, "radii"))];
        for (attribute, bytes, name) in attributes.into_iter().flatten() {
            attribute.check(self.count, bytes, name)?;
        }
        self.counter.map_or(Ok(()), |Counter { buffer, offset }| {
            Attribute { buffer, offset, stride: 4 }.check(1, 4, "counter")
        })
    }
}

impl Attribute<'_> {
    fn check(&self, count: u32, bytes: u64, name: &str) -> Result<()> {
        let fail = |problem: String| Err(Error::invalid("particles", format!("{name}: {problem}")));
        let Self { buffer, offset, stride } = *self;
        if !buffer.usage().contains(wgpu::BufferUsages::STORAGE) {
            return fail("the buffer lacks BufferUsages::STORAGE".into());
        }
        if !offset.is_multiple_of(4) || !stride.is_multiple_of(4) || stride < bytes {
            return fail(format!(
                "an offset of {offset} and a stride of {stride} bytes are not multiples of 4, or leave no room for \
                 {bytes} bytes"
            ));
        }
        let needed = match count {
            0 => 0,
            _ => u64::from(count - 1).saturating_mul(stride).saturating_add(offset + bytes),
        };
        if needed > buffer.size() {
            let size = buffer.size();
            return fail(format!(
                "the buffer has {size} bytes, and {count} particles need {needed}"
            ));
        }
        Ok(())
    }
}
