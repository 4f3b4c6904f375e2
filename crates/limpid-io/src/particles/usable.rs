//! Selection of a file's usable contents. Positions alone decide which particles are read: simulators mark inactive ones
//! by NaN, and others diverge. Numbers of attributes that cannot be used are replaced, or the attribute is left
//! out; each of these is a [`Remark`].

use std::path::Path;

use glam::Vec3;
use limpid::liquid::Ellipsoid;

#[cfg(doc)]
use super::ReadOptions;
use super::remark::Remark;
use super::table::{NO_ID, Unplaced};
use super::{Attribute, AttributeMap, Contents, Reading};
use crate::error::{Error, Result};

/// Largest share of particles without a position, or of numbers that cannot be used, in a file that is not
/// taken to be damaged.
const LARGEST_SHARE: f64 = 0.5;

impl Contents {
    /// Leaves out the particles that are not selected, those without a position, and the unusable numbers of
    /// attributes. Does nothing a second time.
    ///
    /// # Errors
    /// [`Error::Format`] if the file lacks an array of the selection; [`Error::Unplaced`] if too many particles
    /// have no position, unless [`ReadOptions::skip_invalid`] allows any number.
    pub(super) fn settle(&mut self, path: &Path, reading: &Reading<'_>) -> Result<()> {
        if std::mem::replace(&mut self.settled, true) {
            return Ok(());
        }
        let selected = self.selected(path, reading)?;
        self.columns.retain(|(name, _)| reading.wants_column(name));
        self.show(reading);
        let placed = self.placed(reading)?;
        if placed.is_some() || selected.is_some() {
            let keeps =
                |mask: &Option<Vec<bool>>, i: usize| mask.as_ref().is_none_or(|mask| mask[i]);
            self.particles.retain(|i| keeps(&placed, i) && keeps(&selected, i));
            for (_, numbers) in &mut self.columns {
                let mut i = 0..;
                numbers
                    .retain(|_| i.next().is_some_and(|i| keeps(&placed, i) && keeps(&selected, i)));
            }
            self.describe(|i| keeps(&placed, i) && keeps(&selected, i));
        }
        self.describe(|_| true);
        self.apply(reading.map);
        self.repair();
        Ok(())
    }

    /// Which particles have a position, if some have none, which a remark says.
    fn placed(&mut self, reading: &Reading<'_>) -> Result<Option<Vec<bool>>> {
        let Some(Unplaced { path, location, row, position }) = self.unplaced.take() else {
            return Ok(None);
        };
        let placed: Vec<bool> =
            self.particles.positions.iter().map(|position| !position.is_nan()).collect();
        let particles = placed.len();
        let unplaced = particles - placed.iter().filter(|&&placed| placed).count();
        if unplaced as f64 > LARGEST_SHARE * particles as f64 && !reading.skip_invalid {
            let position = position.to_array();
            return Err(Error::Unplaced { path, location, row, position, unplaced, particles });
        }
        self.remarks.push(Remark::Unplaced { unplaced, particles, first: row });
        Ok(Some(placed))
    }

    /// Leaves out the attributes of which the map says so, where the format has them without an array, and multiplies
    /// the others by its factors.
    fn apply(&mut self, map: &AttributeMap) {
        for attribute in map.left_out() {
            let used = self.arrays.iter_mut().filter(|array| array.used_as == Some(attribute));
            used.for_each(|array| array.used_as = None);
            let particles = &mut self.particles;
            match attribute {
                Attribute::Position => {}
                Attribute::Velocity => particles.velocities = None,
                Attribute::Density => particles.densities = None,
                Attribute::Radius => particles.radii = None,
                Attribute::Id => particles.ids = None,
                Attribute::Ellipsoid => particles.ellipsoids = None,
            }
        }
        let particles = &mut self.particles;
        let [velocity, density, radius] =
            [Attribute::Velocity, Attribute::Density, Attribute::Radius]
                .map(|attribute| map.factor_of(attribute) as f32);
        particles.velocities.iter_mut().flatten().for_each(|v| *v *= velocity);
        particles.densities.iter_mut().flatten().for_each(|x| *x *= density);
        particles.radii.iter_mut().flatten().for_each(|r| *r *= radius);
    }

    /// Replaces numbers of attributes that cannot be used, if they are few: velocities by 0, densities and
    /// radii by the median of the others, ellipsoids by ones that the classifier replaces. Otherwise, and if an id is not an integer, the
    /// attribute is left out.
    fn repair(&mut self) {
        let not_finite = "not finite";
        self.repair_attribute(Attribute::Velocity, not_finite, "0", |p| {
            repair(&mut p.velocities, |v| v.is_finite(), |_| Vec3::ZERO)
        });
        self.repair_attribute(Attribute::Density, not_finite, "the median of the others", |p| {
            repair(&mut p.densities, |density| density.is_finite(), median)
        });
        let no_length = "not finite or negative";
        self.repair_attribute(Attribute::Radius, no_length, "the median of the others", |p| {
            repair(&mut p.radii, |radius| radius.is_finite() && *radius >= 0.0, median)
        });
        self.repair_attribute(Attribute::Ellipsoid, not_finite, "a fitted shape", |p| {
            let is_finite =
                |e: &Ellipsoid| bytemuck::cast_ref::<_, [f32; 6]>(e).iter().all(|x| x.is_finite());
            repair(&mut p.ellipsoids, is_finite, |_| Ellipsoid::default())
        });
        self.repair_attribute(Attribute::Id, "not integers", "", |p| {
            let first = p.ids.as_ref()?.iter().position(|&id| id == NO_ID)?;
            let ids = p.ids.take().unwrap_or_default();
            let count = ids.iter().filter(|&&id| id == NO_ID).count();
            Some(Repaired { count, values: ids.len(), first, left_out: true })
        });
    }

    /// Repairs an attribute, and remarks on the repair: `substitute` names the value in the place of `wrong` ones.
    fn repair_attribute(
        &mut self,
        attribute: Attribute,
        wrong: &str,
        substitute: &'static str,
        repair: impl FnOnce(&mut limpid::liquid::Particles) -> Option<Repaired>,
    ) {
        let Some(Repaired { count, values, first, left_out }) = repair(&mut self.particles) else {
            return;
        };
        let mut source = self.arrays.iter_mut().find(|array| array.used_as == Some(attribute));
        let array =
            source.as_ref().map_or_else(|| attribute.name().into(), |source| source.name.clone());
        let problem =
            format!("{count} of {values} values are {wrong} (the first: of particle {first})");
        if left_out {
            source.iter_mut().for_each(|source| source.used_as = None);
            self.remarks.push(Remark::Unusable { array, problem });
        } else {
            self.remarks.push(Remark::Repaired { array, problem, substitute });
        }
    }
}

/// Repairs of an attribute.
struct Repaired {
    /// Number of values that could not be used, and of all.
    count: usize,
    values: usize,
    /// The first particle that has one.
    first: usize,
    /// Whether the attribute was left out, instead of replacing them.
    left_out: bool,
}

/// Replaces the values that are not usable by one made of the others, or leaves out the attribute if they are
/// too many; `None` if there are none.
fn repair<T: Copy>(
    attribute: &mut Option<Vec<T>>,
    is_usable: impl Fn(&T) -> bool,
    substitute: impl FnOnce(Vec<T>) -> T,
) -> Option<Repaired> {
    let values = attribute.as_mut()?;
    let first = values.iter().position(|value| !is_usable(value))?;
    let usable: Vec<T> = values.iter().copied().filter(&is_usable).collect();
    let (count, all) = (values.len() - usable.len(), values.len());
    let left_out = count as f64 > LARGEST_SHARE * all as f64;
    if left_out {
        *attribute = None;
    } else {
        let substitute = substitute(usable);
        values.iter_mut().filter(|value| !is_usable(value)).for_each(|value| *value = substitute);
    }
    Some(Repaired { count, values: all, first, left_out })
}

/// The median of some numbers, the upper of two.
fn median(mut numbers: Vec<f32>) -> f32 {
    let middle = numbers.len() / 2;
    match numbers.is_empty() {
        true => 0.0,
        false => *numbers.select_nth_unstable_by(middle, f32::total_cmp).1,
    }
}
