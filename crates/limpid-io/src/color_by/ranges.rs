//! The attributes that particles can be coloured by, with the values that they have.

use limpid::liquid::Particles;
use serde::{Deserialize, Serialize};

use super::Attribute;
use crate::particles::Array;
#[cfg(doc)]
use crate::particles::ReadOptions;
use crate::particles::shown::{COLOR, has_colors};
use crate::spread::Spread;

/// An attribute, and its values in a frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AttributeRange {
    /// Its name, as [`Attribute::from`] takes it.
    pub name: String,
    /// Unit of its values; empty if it is not known.
    pub unit: String,
    /// Its values, of vectors their lengths; `None` for colours and for the axes.
    pub spread: Option<Spread>,
}

impl AttributeRange {
    /// The attributes of particles, and the other arrays of their file, which [`ReadOptions::values`] describes.
    pub fn of<'a>(
        particles: &Particles,
        arrays: impl IntoIterator<Item = &'a Array> + Clone,
    ) -> Vec<Self> {
        let row = |name: &str, unit: &str, spread| Self {
            name: name.to_owned(),
            unit: unit.to_owned(),
            spread,
        };
        let own = Attribute::of(particles).into_iter().filter_map(|attribute| {
            let spread = Spread::of(attribute.values(particles)?.scalars()?)?;
            Some(row(attribute.name(), attribute.unit(), Some(spread)))
        });
        let ignored = arrays.clone().into_iter().filter(|array| array.used_as.is_none());
        let others = ignored.filter_map(|array| {
            let (name, unit) = array.name_and_unit();
            Some(row(name, unit, Some(array.spread?)))
        });
        let mut all: Vec<Self> = Vec::new();
        let colors = has_colors(arrays).then_some(COLOR);
        let axes = ["x", "y", "z"].into_iter().filter(|_| !particles.is_empty());
        let named = colors.into_iter().chain(axes).map(|name| row(name, "", None));
        for row in own.chain(others).chain(named) {
            // Of several fluids, or of the ranks of a frame, the first stands for all.
            if !all.iter().any(|known| known.name.eq_ignore_ascii_case(&row.name)) {
                all.push(row);
            }
        }
        all
    }
}
