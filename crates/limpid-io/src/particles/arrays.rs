//! The arrays of a particle file, and their assignment to attributes.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use limpid::liquid::Up;
use serde::{Deserialize, Serialize};

use super::remark::Remark;
use super::table::{Column, Table};
use super::{Attribute, Particles};
use crate::error::{Error, Result, printable};

/// The axis that points up in files of `DualSPHysics`.
pub(super) const DUALSPHYSICS: (Up, &str) = (Up::Z, "DualSPHysics");

/// Largest number of listed arrays.
pub(super) const MOST_LISTED: usize = 1024;

/// An array of a particle file, other than the positions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Array {
    /// Its name in the file; if several columns form the attribute, all their names.
    pub name: String,
    /// Its size along each axis, particles first, as in `NumPy`.
    pub shape: Vec<usize>,
    /// The attribute that it is read as; `None` if it is ignored.
    pub used_as: Option<Attribute>,
}

impl fmt::Display for Array {
    /// Formats name and shape: `U (4732, 3)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shape: Vec<String> = self.shape.iter().map(usize::to_string).collect();
        write!(f, "{} ({})", self.name, shape.join(", "))
    }
}

/// The contents of a particle file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Contents {
    /// The particles.
    pub particles: Particles,
    /// The first 1024 arrays other than the positions, in the order of the file.
    pub arrays: Vec<Array>,
    /// Number of triangles, polygons and other cells with several points. Above 0 the file is a mesh,
    /// whose vertices are read as particles.
    pub cells: usize,
    /// The axis that points up, and the program whose files have it so, if the format or the names of the arrays tell.
    pub up: Option<(Up, &'static str)>,
    /// What was left out, or understood in a way that the user should know.
    pub remarks: Vec<Remark>,
}

impl From<Particles> for Contents {
    fn from(particles: Particles) -> Self {
        Self { particles, ..Self::default() }
    }
}

impl Contents {
    /// Reads an array as the attribute of its name, if there is one and the particles lack it.
    pub(super) fn take(
        &mut self,
        map: &AttributeMap,
        name: &str,
        table: &Table<'_>,
        columns: &[Column],
    ) -> Result<()> {
        let shape = match columns.len() {
            1 => vec![table.rows],
            size => vec![table.rows, size],
        };
        self.take_as(map.attribute_of(name), name, &shape, table, columns)
    }

    /// As [`Contents::take`], for an array with a known attribute or none.
    pub(super) fn take_as(
        &mut self,
        attribute: Option<Attribute>,
        name: &str,
        shape: &[usize],
        table: &Table<'_>,
        columns: &[Column],
    ) -> Result<()> {
        let used_as = match attribute {
            Some(attribute) if self.attach(attribute, name, table, columns)? => Some(attribute),
            _ => None,
        };
        self.list(name, shape, used_as);
        Ok(())
    }

    /// Stores an attribute; returns whether it did. An attribute that the particles have already, one
    /// with another number of columns, and radii that are all 0 are not stored.
    fn attach(
        &mut self,
        attribute: Attribute,
        name: &str,
        table: &Table<'_>,
        columns: &[Column],
    ) -> Result<bool> {
        match (attribute, columns) {
            (Attribute::Velocity, &[x, y, z]) if self.particles.velocities.is_none() => {
                self.check_rows(name, table)?;
                self.particles.velocities = Some(table.vectors([x, y, z], "velocity")?);
            }
            (Attribute::Density, &[column]) if self.particles.densities.is_none() => {
                self.check_rows(name, table)?;
                self.particles.densities =
                    Some(table.floats([column], "density")?.into_flattened());
            }
            (Attribute::Radius, &[column]) if self.particles.radii.is_none() => {
                self.check_rows(name, table)?;
                let radii = table.floats([column], "radius")?.into_flattened();
                if let Some(i) = radii.iter().position(|&r| r < 0.0) {
                    let problem = format!("particle {i}: radius {}, expected 0 or more", radii[i]);
                    return Err(table.error(i, column, problem));
                }
                // An array that was never filled in: the radius is unknown.
                if radii.iter().all(|&r| r == 0.0) {
                    return Ok(false);
                }
                self.particles.radii = Some(radii);
            }
            (Attribute::Id, &[column]) if self.particles.ids.is_none() => {
                self.check_rows(name, table)?;
                self.particles.ids = Some(table.integers(column, "id")?);
            }
            (Attribute::Ellipsoid, &[xx, yy, zz, xy, yz, xz])
                if self.particles.ellipsoids.is_none() =>
            {
                self.check_rows(name, table)?;
                let entries = table.floats([xx, yy, zz, xy, yz, xz], "ellipsoid")?;
                self.particles.ellipsoids = Some(bytemuck::allocation::cast_vec(entries));
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn check_rows(&self, name: &str, table: &Table<'_>) -> Result<()> {
        let (rows, particles) = (table.rows, self.particles.len());
        if rows == particles {
            return Ok(());
        }
        let problem = format!("attribute {name} has {rows} entries for {particles} particles");
        Err(table.source.error(table.start, problem))
    }

    /// Lists an array.
    pub(super) fn list(&mut self, name: &str, shape: &[usize], used_as: Option<Attribute>) {
        if self.arrays.len() < MOST_LISTED {
            let (name, shape) = (printable(name.into()), shape.to_vec());
            self.arrays.push(Array { name, shape, used_as });
        }
    }

    /// Notes the axis that points up in files with arrays of these names. `DualSPHysics`, its tool `PartVTK` and what
    /// `ParaView` exports of them have `Idp`, `Rhop` and `Mk`, and z up whatever their format.
    pub(super) fn note_up(&mut self) {
        let is_its = |name: &str| {
            // Without a unit, as in `Rhop [kg/m^3]`.
            let bare = name.split([' ', '[']).next().unwrap_or_default();
            ["Idp", "Rhop", "Mk"].iter().any(|its| its.eq_ignore_ascii_case(bare))
        };
        if self.up.is_none() && self.arrays.iter().any(|array| is_its(&array.name)) {
            self.up = Some(DUALSPHYSICS);
        }
    }

    /// Describes the problem if an array of the map was not read.
    pub(super) fn unread(&self, map: &AttributeMap) -> Option<String> {
        if self.particles.is_empty() {
            return None;
        }
        let used = |attribute: Attribute| self.arrays.iter().any(|a| a.used_as == Some(attribute));
        let (attribute, name) = map.0.iter().find(|(attribute, _)| !used(**attribute))?;
        let numbers = match attribute {
            Attribute::Velocity => "3 numbers",
            Attribute::Ellipsoid => "6 numbers",
            Attribute::Density | Attribute::Radius | Attribute::Id => "one number",
        };
        let arrays: Vec<String> = self.arrays.iter().take(12).map(Array::to_string).collect();
        let arrays = if arrays.is_empty() { "none".into() } else { arrays.join(", ") };
        Some(format!(
            "{attribute}={name}: no array `{name}` of {numbers} a particle; there are: {arrays}"
        ))
    }
}

/// The arrays from which some attributes are read, instead of those with the usual names. Its text is
/// `velocity=U,radius=h`; case does not matter.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct AttributeMap(BTreeMap<Attribute, String>);

impl AttributeMap {
    /// Whether it has no entries.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The attribute that an array of this name is read as.
    pub(super) fn attribute_of(&self, array: &str) -> Option<Attribute> {
        let mapped = self.0.iter().find(|(_, name)| name.eq_ignore_ascii_case(array));
        let usual = || Attribute::from_alias(array).filter(|usual| !self.0.contains_key(usual));
        mapped.map(|(attribute, _)| *attribute).or_else(usual)
    }

    /// The array from which an attribute must be read, in lower case.
    pub(super) fn array_of(&self, attribute: Attribute) -> Option<String> {
        self.0.get(&attribute).map(|name| name.to_ascii_lowercase())
    }
}

impl fmt::Display for AttributeMap {
    /// Writes the text that parses to the same map.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let pairs: Vec<String> = self.0.iter().map(|(a, name)| format!("{a}={name}")).collect();
        f.write_str(&pairs.join(","))
    }
}

impl FromStr for AttributeMap {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let fail = |problem: &str| Error::Usage(format!("map `{text}`: {problem}"));
        let mut map = BTreeMap::new();
        for pair in text.split(',') {
            let pair = pair.split_once('=').map(|(a, name)| (a.trim(), name.trim()));
            let (attribute, name) = pair
                .filter(|(_, name)| !name.is_empty())
                .ok_or_else(|| fail("expected ATTRIBUTE=ARRAY, as in velocity=U,radius=h"))?;
            let unknown =
                || fail(&format!("no attribute `{attribute}`; there are: {}", Attribute::list()));
            let attribute = Attribute::from_alias(attribute).ok_or_else(unknown)?;
            if map.insert(attribute, name.to_owned()).is_some() {
                return Err(fail(&format!("{attribute} is given twice")));
            }
        }
        Ok(Self(map))
    }
}
