//! The contents of a particle file: its particles, and its arrays.

use std::fmt;
use std::path::Path;

use glam::{BVec3, Vec3};
use limpid::liquid::Up;
use limpid::memory;
use serde::{Deserialize, Serialize};

#[cfg(doc)]
use super::ReadOptions;
use super::labelled::canonical;
use super::remark::Remark;
use super::shown::{Part, spelling, unit_of};
use super::table::{Column, Table, Unplaced};
use super::{Attribute, AttributeMap, Particles, Reading};
use crate::error::{Error, Result, printable};
use crate::spread::Spread;

/// The axis that points up in files of `DualSPHysics`.
pub(super) const DUALSPHYSICS: (Up, &str) = (Up::Z, "DualSPHysics");

/// Largest number of listed arrays.
pub(super) const MOST_LISTED: usize = 1024;

/// An array of a particle file, other than the positions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Array {
    /// Its name in the file; if several columns form the attribute, all their names.
    pub name: String,
    /// Its size along each axis, particles first, as in `NumPy`.
    pub shape: Vec<usize>,
    /// The attribute that it is read as; `None` if it is ignored.
    pub used_as: Option<Attribute>,
    /// Its values, if it is ignored, they are few integers, and [`ReadOptions::values`] asks for them.
    pub values: Vec<i64>,
    /// Whether it is read as [`ReadOptions::shown`].
    pub is_shown: bool,
    /// The spread of its values, or of the lengths of its vectors, among the particles that were read, if it has one to
    /// four numbers a particle and [`ReadOptions::values`] asks for it. Of several files together, the extremes.
    pub spread: Option<Spread>,
}

impl Array {
    /// Its name without a unit, and this: that of `Pressure [Pa]`; empty without one.
    pub fn name_and_unit(&self) -> (&str, &str) {
        match unit_of(&self.name) {
            Some(unit) => (spelling(&self.name), unit),
            None => (&self.name, ""),
        }
    }
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
    /// Parts that were left out, or understood in a way that the user should know.
    pub remarks: Vec<Remark>,
    /// Columns that attributes are made of, or that decide which particles are read: their names in lower case,
    /// without units, and their numbers. In the end those of [`ReadOptions::columns`], of the particles that are read.
    pub(super) columns: Vec<(String, Vec<f64>)>,
    /// Arrays that are shown or described.
    pub(super) parts: Vec<Part>,
    /// Whether [`Contents::settle`] has selected its usable contents.
    pub(super) settled: bool,
    /// The first particle without a position, until it is left out.
    pub(super) unplaced: Option<Unplaced>,
}

impl From<Particles> for Contents {
    fn from(particles: Particles) -> Self {
        Self { particles, ..Self::default() }
    }
}

impl Contents {
    /// Returns the usable contents of those that a reader has found.
    ///
    /// # Errors
    /// [`Error::Format`] if an array of the attribute map is missing; [`Error::Unplaced`].
    pub(super) fn finished(mut self, path: &Path, reading: &Reading<'_>) -> Result<Self> {
        self.note_up();
        for attribute in [Attribute::Position, Attribute::Velocity, Attribute::Ellipsoid] {
            self.assemble(path, reading.map, attribute)?;
        }
        if let Some(problem) = self.unread(reading.map) {
            return Err(Error::format(path, problem));
        }
        self.settle(path, reading)?;
        self.check_shown(path, reading)?;
        Ok(self)
    }

    /// Reads an attribute from the columns that the map names for it, if they were kept.
    fn assemble(&mut self, path: &Path, map: &AttributeMap, attribute: Attribute) -> Result<()> {
        let Some(names) = map.columns_of(attribute) else { return Ok(()) };
        let column = |name: &String| self.columns.iter().find(|(kept, _)| kept == name);
        let columns: Option<Vec<_>> = names.iter().map(column).collect();
        let Some(columns) = columns else { return Ok(()) };
        let columns: Vec<&[f64]> = columns.into_iter().map(|(_, numbers)| &numbers[..]).collect();
        let (table, columns) = Table::of_columns(path, &columns)?;
        let shape = [table.rows, columns.len()];
        self.take_as(Some(attribute), &names.join(" "), &shape, &table, &columns)
    }

    /// Keeps the numbers of an array that is one of several from which an attribute is read, that decides which
    /// particles are, or that is shown.
    pub(super) fn keep(
        &mut self,
        reading: &Reading<'_>,
        name: &str,
        table: &Table<'_>,
        columns: &[Column],
    ) -> Result<()> {
        if let &[column] = columns
            && reading.keeps(name)
        {
            self.check_rows(name, table)?;
            self.columns.push((canonical(name), table.numbers(column)?));
        }
        self.keep_shown(reading, name, table, columns)
    }

    /// Reads an array as the attribute of its name, if there is one and the particles lack it.
    pub(super) fn take(
        &mut self,
        reading: &Reading<'_>,
        name: &str,
        table: &Table<'_>,
        columns: &[Column],
    ) -> Result<()> {
        let shape = match columns.len() {
            1 => vec![table.rows],
            size => vec![table.rows, size],
        };
        self.keep(reading, name, table, columns)?;
        self.take_as(reading.map.attribute_of(name), name, &shape, table, columns)?;
        self.find_values(reading, name, table, columns);
        Ok(())
    }

    /// Finds the values of the array that was listed last, if they are asked for.
    pub(super) fn find_values(
        &mut self,
        reading: &Reading<'_>,
        name: &str,
        table: &Table<'_>,
        columns: &[Column],
    ) {
        let listed = self.arrays.last_mut().filter(|array| array.used_as.is_none());
        if let &[column] = columns
            && let Some(array) = listed.filter(|array| reading.values && array.name == name)
        {
            array.values = table.few_integers(column);
        }
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
        match attribute {
            Some(attribute) if self.attach(attribute, name, table, columns)? => {
                self.list(name, shape, Some(attribute));
            }
            _ => self.pass_over(attribute, name, shape),
        }
        Ok(())
    }

    /// Lists an array that is not read, with a remark if only its width keeps it from being an attribute.
    pub(super) fn pass_over(&mut self, attribute: Option<Attribute>, name: &str, shape: &[usize]) {
        self.list(name, shape, None);
        let lacks = |attribute: &Attribute| {
            !super::attribute_names(&self.particles).any(|has| has == attribute.name())
        };
        let (rows, width) = match *shape {
            [rows] => (rows, 1),
            [rows, width] => (rows, width),
            _ => return,
        };
        if rows == self.particles.len()
            && let Some(attribute) = attribute.filter(lacks)
            && attribute.width() != width
        {
            let array = printable(name.into());
            let problem = format!("{width} numbers a particle, expected {}", attribute.width());
            self.remarks.push(Remark::Unusable { array, problem });
        }
    }

    /// Stores an attribute; returns whether it did. An attribute that the particles have already, one
    /// with another number of columns, and radii that are all 0 are not stored. [`Contents::settle`]
    /// judges its numbers.
    fn attach(
        &mut self,
        attribute: Attribute,
        name: &str,
        table: &Table<'_>,
        columns: &[Column],
    ) -> Result<bool> {
        match (attribute, columns) {
            (Attribute::Position, &[x, y, z]) => {
                self.check_rows(name, table)?;
                let Self { particles: Particles { origin, positions, .. }, unplaced, .. } =
                    table.particles([x, y, z])?;
                (self.particles.origin, self.particles.positions) = (origin, positions);
                self.unplaced = unplaced;
            }
            (Attribute::Velocity, &[x, y, z]) if self.particles.velocities.is_none() => {
                self.check_rows(name, table)?;
                self.particles.velocities = Some(table.vectors([x, y, z])?);
            }
            // Of a simulation in two dimensions.
            (Attribute::Velocity, &[a, b])
                if self.particles.velocities.is_none() && self.flat_axis().is_some() =>
            {
                self.check_rows(name, table)?;
                let third = self.flat_axis().unwrap_or(2);
                let velocity = |[a, b]: [f32; 2]| match third {
                    0 => Vec3::new(0.0, a, b),
                    1 => Vec3::new(a, 0.0, b),
                    _ => Vec3::new(a, b, 0.0),
                };
                let pairs = table.floats([a, b])?.into_iter().map(velocity);
                let velocities = memory::collect(pairs, table.source.path.display())?;
                self.particles.velocities = Some(velocities);
            }
            (Attribute::Density, &[column]) if self.particles.densities.is_none() => {
                self.check_rows(name, table)?;
                self.particles.densities = Some(table.floats([column])?.into_flattened());
            }
            (Attribute::Radius, &[column]) if self.particles.radii.is_none() => {
                self.check_rows(name, table)?;
                let radii = table.floats([column])?.into_flattened();
                // An array that was never filled in: the radius is unknown.
                if radii.iter().all(|&r| r == 0.0) {
                    return Ok(false);
                }
                self.particles.radii = Some(radii);
            }
            (Attribute::Id, &[column]) if self.particles.ids.is_none() => {
                self.check_rows(name, table)?;
                self.particles.ids = Some(table.integers(column)?);
            }
            (Attribute::Ellipsoid, &[xx, yy, zz, xy, yz, xz])
                if self.particles.ellipsoids.is_none() =>
            {
                self.check_rows(name, table)?;
                let entries = table.floats([xx, yy, zz, xy, yz, xz])?;
                self.particles.ellipsoids = Some(bytemuck::allocation::cast_vec(entries));
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// The axis along which the positions do not differ, if they lie in a plane: z, if it is one of several.
    fn flat_axis(&self) -> Option<usize> {
        let mut placed = self.particles.positions.iter().filter(|position| !position.is_nan());
        let first = placed.next()?;
        let flat = placed.fold(BVec3::TRUE, |flat, position| flat & position.cmpeq(*first));
        [2, 1, 0].into_iter().find(|&axis| flat.test(axis))
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
            self.arrays.push(Array {
                name,
                shape,
                used_as,
                values: Vec::new(),
                is_shown: false,
                spread: None,
            });
        }
    }

    /// Notes the axis that points up in files with arrays of these names. `DualSPHysics`, its tool `PartVTK` and what
    /// `ParaView` exports of them have `Idp`, `Rhop` and `Mk`, and z up whatever their format.
    fn note_up(&mut self) {
        let is_its = |name: &str| {
            // Without a unit, as in `Rhop [kg/m^3]`.
            let bare = name.split([' ', '[']).next().unwrap_or_default();
            ["Idp", "Rhop", "Mk"].iter().any(|its| its.eq_ignore_ascii_case(bare))
        };
        if self.up.is_none() && self.arrays.iter().any(|array| is_its(&array.name)) {
            self.up = Some(DUALSPHYSICS);
        }
    }

    /// Lists the first arrays for messages.
    pub(super) fn listed_arrays(&self) -> String {
        let listed: Vec<String> = self.arrays.iter().take(12).map(Array::to_string).collect();
        if listed.is_empty() { "none".into() } else { listed.join(", ") }
    }

    /// Describes the problem if an array of the map was not read.
    pub(super) fn unread(&self, map: &AttributeMap) -> Option<String> {
        if self.particles.is_empty() {
            return None;
        }
        let used = |attribute: Attribute| self.arrays.iter().any(|a| a.used_as == Some(attribute));
        let (attribute, name, arrays) = map.wanted().find(|(attribute, ..)| !used(*attribute))?;
        let numbers = match attribute.width() {
            width if width > 1 && arrays == 1 => format!("{width} numbers"),
            _ => "one number".to_owned(),
        };
        let no = if arrays == 1 { "no array" } else { "no arrays" };
        let listed = self.listed_arrays();
        Some(format!(
            "{attribute}={name}: {no} `{name}` of {numbers} a particle; there are: {listed}"
        ))
    }
}
