//! Particles in memory of the graphics device.

use glam::{DVec3, Vec3};

use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::liquid::particles::drawable;

/// Particles in buffers of the device that draws them, as simulations on the device have them.
///
/// Positions that are not finite, and radii that are not positive, are not drawn. The caller supplies what the renderer
/// cannot read back: the radius and a bounding box.
#[derive(Debug, Clone, Copy)]
pub struct DeviceParticles<'a> {
    /// Centres relative to the origin, m: three 32-bit floats each.
    pub positions: Attribute<'a>,
    /// Number of particles; with a counter, the largest number that there may be.
    pub count: u32,
    /// The number of particles, a 32-bit integer, where only the device knows it. Cells deep inside of bodies then keep a
    /// splat for each particle.
    pub counter: Option<Counter<'a>>,
    /// Particle radius, m; if radii differ, the most common one.
    pub radius: f32,
    /// Particle radii, m: a 32-bit float each. Radii are clamped to between a quarter of and four times the common radius.
    /// They make the search for neighbours several times longer.
    pub radii: Option<Attribute<'a>>,
    /// Origin of the positions in world space, m: near the liquid, so that 32 bits are precise.
    pub origin: DVec3,
    /// Minimum and maximum corner of a box in world space, m, that holds the particles: the walls of the simulation. Light views
    /// and the near plane are fitted to it. A box that is much larger than the liquid makes classification slower, and so do
    /// particles outside of it; thousands beside one place of its border count as a crowd.
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

/// The part of a buffer that has an attribute, as it is bound.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Part<'a> {
    pub(crate) name: &'static str,
    buffer: &'a wgpu::Buffer,
    first: u64,
    pub(crate) bytes: u64,
    /// Words from its beginning to the first particle's, and from one particle's to the next one's.
    pub(crate) words: [u32; 2],
}

impl<'a> Part<'a> {
    fn new(gpu: &Gpu, name: &'static str, of: Attribute<'a>, count: u32, each: u64) -> Self {
        let alignment: u64 = gpu.device.limits().min_storage_buffer_offset_alignment.into();
        let first = of.offset / alignment * alignment;
        let end = of.offset + u64::from(count.max(1) - 1) * of.stride + each;
        let words = [of.offset - first, of.stride].map(|bytes| (bytes / 4) as u32);
        Self { name, buffer: of.buffer, first, bytes: end - first, words }
    }

    pub(crate) fn resource(&self) -> wgpu::BindingResource<'a> {
        wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: self.buffer,
            offset: self.first,
            size: wgpu::BufferSize::new(self.bytes),
        })
    }
}

impl<'a> DeviceParticles<'a> {
    /// Fails if they cannot be read.
    pub(crate) fn check(&self) -> Result<()> {
        let fail = |problem: String| Err(Error::invalid("particles", problem));
        if !drawable(self.radius) {
            return fail(format!("a radius of {} m cannot be drawn", self.radius));
        }
        let (min, max) = self.bounds;
        let in_32_bits = |place: DVec3| -> Vec3 { (place - self.origin).as_vec3() };
        let finite = in_32_bits(min).is_finite() && in_32_bits(max).is_finite();
        if !(finite && self.origin.is_finite() && min.cmple(max).all()) {
            return fail(format!("{min} to {max} m around {} m are no bounds", self.origin));
        }
        self.positions.check(self.count, 12, "positions")?;
        if let Some(radii) = self.radii {
            radii.check(self.count, 4, "radii")?;
        }
        self.counter.map_or(Ok(()), |Counter { buffer, offset }| {
            Attribute { buffer, offset, stride: 4 }.check(1, 4, "counter")
        })
    }

    /// The parts of buffers that have positions, radii and the counter.
    pub(crate) fn parts(&self, gpu: &Gpu) -> (Part<'a>, Option<Part<'a>>, Option<Part<'a>>) {
        let part = |name, of, count, each| Part::new(gpu, name, of, count, each);
        let radii = self.radii.map(|radii| part("radii", radii, self.count, 4));
        let counter = self.counter.map(|Counter { buffer, offset }| {
            part("counter", Attribute { buffer, offset, stride: 4 }, 1, 4)
        });
        (part("positions", self.positions, self.count, 12), radii, counter)
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
