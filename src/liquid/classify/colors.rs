//! Colours of particles, which opaque bodies show.

use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use super::{Splat, Splats};
use crate::error::{Error, Result};
use crate::liquid::particles::{Particles, drawable};
use crate::memory;

/// Support of the kernel that colours are averaged with, in particle radii.
pub const SUPPORT: f32 = 4.0;

/// Colours of a colour map on the device, as in `color/means.wgsl`.
pub const MAP_COLORS: usize = 256;

/// Ranges on either side of the map's that a value counts for at most: sums have 32 bits.
const BEYOND: f32 = 16.0;

/// Colours for a range of values.
#[derive(Debug, Clone, PartialEq)]
pub struct ColorMap {
    /// Linear RGB, at equal steps from the first to the last value; between them colours are interpolated. At least one.
    pub colors: Vec<Vec3>,
    /// Values of the first and the last colour. Values beyond have the nearer one's.
    pub range: [f32; 2],
}

impl ColorMap {
    /// The value at a place in the range.
    pub(crate) fn value(&self, share: f32) -> f32 {
        let (low, span) = self.span();
        low + share * span
    }

    /// The colour of a value, linear RGB.
    pub fn color(&self, value: f32) -> Vec3 {
        self.at(self.share(value))
    }

    /// Place of a value in the range: 0 to 1 from its first to its last value.
    fn share(&self, value: f32) -> f32 {
        let (low, span) = self.span();
        ((value - low) / span).clamp(0.0, 1.0)
    }

    /// The range's first value and its length. Where all values are the same, theirs is in its middle.
    fn span(&self) -> (f32, f32) {
        let [low, high] = self.range;
        if high > low { (low, high - low) } else { (low - 0.5, 1.0) }
    }

    fn at(&self, share: f32) -> Vec3 {
        let Some(last) = self.colors.len().checked_sub(1) else { return Vec3::splat(0.5) };
        let place = share * last as f32;
        let first = (place as usize).min(last);
        self.colors[first].lerp(self.colors[(first + 1).min(last)], place - first as f32)
    }

    /// The map at [`MAP_COLORS`] equal steps.
    pub(crate) fn table(&self) -> Vec<Vec3> {
        let at = |i| self.at(i as f32 / (MAP_COLORS - 1) as f32);
        (0..MAP_COLORS).map(at).collect()
    }
}

/// Colours of a frame's particles. At a surface, the particles within four radii are averaged, weighted by a cubic spline
/// and by their volumes; of values, the mean is looked up in the map. Clones share memory.
#[derive(Debug, Clone)]
pub struct Colors {
    kernels: Arc<Splats>,
    map: Option<Arc<ColorMap>>,
}

impl PartialEq for Colors {
    fn eq(&self, other: &Self) -> bool {
        let same_kernels =
            Arc::ptr_eq(&self.kernels, &other.kernels) || self.kernels == other.kernels;
        same_kernels && self.map == other.map
    }
}

impl Colors {
    /// Colours by one value a particle. Particles whose value is not finite do not count.
    ///
    /// `splats` are those of the particles; `default_radius` is for particles without radii.
    ///
    /// # Errors
    /// [`Error::Invalid`] for another number of values than particles, and for a range that is not finite.
    pub fn by_value(
        particles: &Particles,
        default_radius: f32,
        splats: &Splats,
        values: &[f32],
        map: ColorMap,
    ) -> Result<Self> {
        check_count(values.len(), particles)?;
        check_range(&map)?;
        let stored = |i: usize| {
            values[i].is_finite().then(|| Vec3::new(share(values[i], &map), values[i], 0.0))
        };
        let kernels = kernels(particles, default_radius, splats, stored);
        Ok(Self { kernels: Arc::new(kernels), map: Some(Arc::new(map)) })
    }

    /// The colours of the same particles by another map, to the bit those that [`Colors::by_value`] gives; colours that are
    /// not by value stay.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a range that is not finite; [`Error::Memory`].
    pub fn over(&self, map: ColorMap) -> Result<Self> {
        let Some(own) = &self.map else { return Ok(self.clone()) };
        check_range(&map)?;
        if own.range == map.range {
            return Ok(Self { kernels: self.kernels.clone(), map: Some(Arc::new(map)) });
        }
        let Splats { aggregates, radius, origin, .. } = &*self.kernels;
        let of = |kernel: &Splat| {
            let value = f32::from_bits(kernel.particle);
            Splat { radius: share(value, &map), ..*kernel }
        };
        let aggregates = memory::collect(aggregates.iter().map(of), "colors")?;
        let kernels = Splats { aggregates, radius: *radius, origin: *origin, ..Splats::default() };
        Ok(Self { kernels: Arc::new(kernels), map: Some(Arc::new(map)) })
    }

    /// One colour a particle, linear RGB from 0 to 1. Particles whose colour is not finite do not count.
    ///
    /// # Errors
    /// [`Error::Invalid`] for another number of colours than particles.
    pub fn given(
        particles: &Particles,
        default_radius: f32,
        splats: &Splats,
        colors: &[Vec3],
    ) -> Result<Self> {
        check_count(colors.len(), particles)?;
        let stored = |i: usize| {
            let color = colors[i];
            color.is_finite().then_some(color.clamp(Vec3::ZERO, Vec3::ONE))
        };
        let kernels = kernels(particles, default_radius, splats, stored);
        Ok(Self { kernels: Arc::new(kernels), map: None })
    }

    /// The map, if colours are by value.
    pub fn map(&self) -> Option<&ColorMap> {
        self.map.as_deref()
    }

    /// A sphere of the kernel's support around each particle; the fields that placing it does not read have the colour, or
    /// a value as the map's range stores it and the value itself.
    pub(crate) fn kernels(&self) -> &Splats {
        &self.kernels
    }

    /// Stored value of the map's first colour, and the stored length of its range.
    pub(crate) fn stored_range() -> [f32; 2] {
        [BEYOND / (1.0 + 2.0 * BEYOND), 1.0 / (1.0 + 2.0 * BEYOND)]
    }
}

fn check_range(map: &ColorMap) -> Result<()> {
    match map.range.iter().all(|end| end.is_finite()) {
        true => Ok(()),
        false => Err(Error::invalid("color range", "its ends must be finite")),
    }
}

/// A value as kernels have it: 0 to 1 from [`BEYOND`] ranges below the map's to as many above.
fn share(value: f32, map: &ColorMap) -> f32 {
    let (low, span) = map.span();
    let place = ((value - low) / span).clamp(-BEYOND, 1.0 + BEYOND);
    (place + BEYOND) / (1.0 + 2.0 * BEYOND)
}

fn check_count(count: usize, particles: &Particles) -> Result<()> {
    if count == particles.len() {
        return Ok(());
    }
    let problem = format!("{count} for {} particles; each needs one", particles.len());
    Err(Error::invalid("colors", problem))
}

/// The particles' kernels, relative to the origin of the splats, with what `stored` says of each.
fn kernels(
    particles: &Particles,
    default_radius: f32,
    splats: &Splats,
    stored: impl Fn(usize) -> Option<Vec3> + Sync,
) -> Splats {
    let shift = particles.origin - splats.origin;
    let kernel = |i: usize| {
        let radius = particles.radii.as_ref().map_or(default_radius, |radii| radii[i]);
        let position = particles.positions[i];
        let color = stored(i).filter(|_| position.is_finite() && drawable(radius))?;
        Some(Splat {
            centre: (position.as_dvec3() + shift).as_vec3().to_array(),
            radius: color.x,
            diagonal: [SUPPORT * radius; 3],
            particle: color.y.to_bits(),
            off_diagonal: [0.0; 3],
            tags: color.z.to_bits(),
        })
    };
    let aggregates = (0..particles.len()).into_par_iter().filter_map(kernel).collect();
    Splats { aggregates, radius: splats.radius, origin: splats.origin, ..Splats::default() }
}
