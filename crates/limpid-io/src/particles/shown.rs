//! The attribute that pictures show in colours, of all that a file has. It is read if it is asked for: any array of one
//! to three numbers a particle, or the columns of a vector, whose length counts; or colours of three or four numbers, of
//! which the fourth does not count.

use std::path::Path;

use glam::{DVec3, Vec3};
use limpid::mesh::linear_from_srgb;

use super::labelled::{all_among, canonical, vector_among};
use super::table::{Column, Scalar, Table};
use super::{Attribute, Contents, Reading};
use crate::error::{Error, Result};
use crate::spread::Spread;

/// The name by which colours are asked for.
pub(crate) const COLOR: &str = "color";

/// Names of arrays of colours, and of their numbers.
const COLORS: [&str; 9] =
    [COLOR, "colors", "colour", "colours", "cd", "rgb", "rgba", "diffuse", "diffuse_color"];
const CHANNELS: [[&str; 3]; 3] =
    [["red", "green", "blue"], ["r", "g", "b"], ["diffuse_red", "diffuse_green", "diffuse_blue"]];

/// Whether a name in lower case asks for colours.
pub(crate) fn is_color(name: &str) -> bool {
    COLORS.contains(&name)
}

/// Whether some of these arrays are colours.
pub(crate) fn has_colors<'a>(arrays: impl IntoIterator<Item = &'a super::Array>) -> bool {
    let named = |array: &super::Array| (canonical(&array.name), array.shape.clone());
    let all: Vec<(String, Vec<usize>)> = arrays.into_iter().map(named).collect();
    let whole =
        |(name, shape): &(String, Vec<usize>)| is_color(name) && matches!(**shape, [_, 3 | 4]);
    let names: Vec<String> = all.iter().map(|(name, _)| name.clone()).collect();
    all.iter().any(whole) || CHANNELS.iter().any(|channels| all_among(&names, channels).is_some())
}

/// Most numbers a particle.
const WIDEST: usize = 4;

/// Numbers of an array, by columns, until it is known which particles are used.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Part {
    /// The array's name in lower case, without a unit.
    name: String,
    columns: Vec<Vec<f32>>,
    /// The integer that stands for 1, if the file's numbers are those of a colour.
    whole: Option<f32>,
}

impl Reading<'_> {
    /// Whether an array is the one to be shown, or may be a part of it.
    pub(super) fn shows(&self, array: &str) -> bool {
        let Some(shown) = self.shown.map(canonical) else { return false };
        // limpid reads the attributes that it knows in any case.
        if known(&shown).is_some() {
            return false;
        }
        let array = canonical(array);
        if shown == COLOR {
            let is_channel = CHANNELS.as_flattened().contains(&array.as_str());
            return is_channel || COLORS.iter().any(|name| is_part(&array, name));
        }
        is_part(&array, &shown)
    }

    /// Whether the numbers of an array are needed: to be shown, or to be described.
    pub(super) fn shows_or_describes(&self, array: &str) -> bool {
        self.values || self.shows(array)
    }
}

/// The attribute of this name that [`limpid::liquid::Particles`] have in any case.
fn known(name: &str) -> Option<Attribute> {
    let known = [Attribute::Velocity, Attribute::Density, Attribute::Radius, Attribute::Id];
    known.into_iter().find(|attribute| attribute.name() == name)
}

/// Whether an array is one of this name, or a column of such a vector.
fn is_part(array: &str, name: &str) -> bool {
    let Some(rest) = array.strip_prefix(name) else { return false };
    let axis = rest.trim_start_matches([':', '_', '.']);
    const AXES: [&str; 14] =
        ["", "x", "y", "z", "0", "1", "2", "3", "[i]", "[j]", "[k]", "r", "g", "b"];
    AXES.contains(&axis)
}

impl Part {
    pub(super) fn of(name: &str, table: &Table<'_>, columns: &[Column]) -> Result<Self> {
        let read = |column: &Column| Ok(table.floats([*column])?.into_flattened());
        let whole = match columns.first().map(|column| column.scalar) {
            Some(Scalar::F16 | Scalar::F32 | Scalar::F64) | None => None,
            Some(Scalar::U16) => Some(f32::from(u16::MAX)),
            Some(_) => Some(f32::from(u8::MAX)),
        };
        let columns = columns.iter().map(read).collect::<Result<_>>()?;
        Ok(Self { name: canonical(name), columns, whole })
    }

    /// The spread of its values among those particles that are used.
    fn spread(&self, used: impl Fn(usize) -> bool) -> Option<Spread> {
        let columns: Vec<&[f32]> = self.columns.iter().map(Vec::as_slice).collect();
        let values = lengths(&columns).into_iter().enumerate();
        Spread::of(values.filter(|(i, _)| used(*i)).map(|(_, value)| value).collect())
    }
}

/// The numbers of a column, or the lengths of the vectors of several; NaN where one is not finite.
fn lengths(columns: &[&[f32]]) -> Vec<f32> {
    let finite = |x: f32| if x.is_finite() { x } else { f32::NAN };
    match columns {
        [numbers] => numbers.iter().copied().map(finite).collect(),
        columns => {
            let rows = columns.first().map_or(0, |column| column.len());
            let length = |row: usize| {
                let mut numbers = DVec3::ZERO;
                for (k, column) in columns.iter().take(3).enumerate() {
                    numbers[k] = column[row].into();
                }
                finite(numbers.length() as f32)
            };
            (0..rows).map(length).collect()
        }
    }
}

/// Linear colours of sRGB in whole numbers, of which `whole` stands for 1, or of linear ones. Text tells no types: there
/// whole numbers up to 255 are bytes, if one of them is above 1.
fn colors(columns: &[&[f32]], whole: Option<f32>) -> Vec<Vec3> {
    let columns = &columns[..3];
    let all = || columns.iter().copied().flatten();
    let are_bytes =
        || all().all(|x| x.fract() == 0.0 && (0.0..=255.0).contains(x)) && all().any(|&x| x > 1.0);
    let whole = whole.or_else(|| are_bytes().then_some(f32::from(u8::MAX)));
    let channel = |x: f32| match whole {
        Some(whole) => linear_from_srgb((x / whole).clamp(0.0, 1.0)),
        None if x.is_finite() => x,
        None => 0.0,
    };
    let rows = columns.iter().map(|column| column.len()).min().unwrap_or(0);
    let color = |row: usize| Vec3::from_array([0, 1, 2].map(|k| channel(columns[k][row])));
    (0..rows).map(color).collect()
}

impl Contents {
    /// Keeps the numbers of an array that is to be shown, or to be described.
    pub(super) fn keep_shown(
        &mut self,
        reading: &Reading<'_>,
        name: &str,
        table: &Table<'_>,
        columns: &[Column],
    ) -> Result<()> {
        let fits = table.rows == self.particles.len() && (1..=WIDEST).contains(&columns.len());
        let again = self.parts.iter().any(|part| part.name == canonical(name));
        if fits && !again && reading.shows_or_describes(name) {
            self.parts.push(Part::of(name, table, columns)?);
        }
        Ok(())
    }

    /// Reads the values to show from the arrays that were kept; without any of them, `x`, `y` and `z` are the positions
    /// in the file.
    pub(super) fn show(&mut self, reading: &Reading<'_>) {
        let Some(shown) = reading.shown.map(canonical) else { return };
        if known(&shown).is_some() {
            return;
        }
        let names: Vec<String> = self.parts.iter().map(|part| part.name.clone()).collect();
        let colored = shown == COLOR;
        let bases = if colored { &COLORS[..] } else { &[shown.as_str()] };
        let whole = bases.iter().find_map(|base| names.iter().position(|name| name == base));
        let apart = || {
            let channels = || CHANNELS.iter().find_map(|channels| all_among(&names, channels));
            let of_channels = colored.then(channels).flatten();
            of_channels.or_else(|| vector_among(&names, bases)).or_else(|| pair(&names, &shown))
        };
        let found = match whole {
            Some(part) => Some(vec![part]),
            None => apart(),
        };
        for part in found.iter().flatten().map(|&at| &self.parts[at]) {
            let mut arrays = self.arrays.iter_mut();
            // Columns of a vector may be listed together.
            let is_its = |array: &&mut super::Array| {
                is_named(&array.name, &part.name)
                    || array.name.split(' ').any(|column| is_named(column, &part.name))
            };
            arrays.find(is_its).into_iter().for_each(|array| array.is_shown = true);
        }
        let parts: Vec<&Part> = found.iter().flatten().map(|&at| &self.parts[at]).collect();
        let columns = parts.iter().flat_map(|part| &part.columns).map(Vec::as_slice);
        let columns: Vec<&[f32]> = columns.collect();
        match columns.len() {
            3 | 4 if colored => {
                self.particles.colors = Some(colors(&columns, parts[0].whole));
            }
            1..=3 => self.particles.values = Some(lengths(&columns)),
            _ => {
                let axis = ["x", "y", "z"].iter().position(|axis| *axis == shown);
                let Some(axis) = axis else { return };
                let particles = &self.particles;
                let height = |i: usize| particles.place(i)[axis] as f32;
                self.particles.values = Some((0..particles.len()).map(height).collect());
            }
        }
    }

    /// Describes the arrays by the spread of their values among the particles that are used.
    pub(super) fn describe(&mut self, used: impl Fn(usize) -> bool) {
        for part in std::mem::take(&mut self.parts) {
            let same = |array: &&mut super::Array| canonical(&array.name) == part.name;
            let color = is_color(&part.name) && part.columns.len() > 1;
            if let Some(array) = self.arrays.iter_mut().find(same).filter(|_| !color) {
                array.spread = part.spread(&used);
            }
        }
    }

    /// Fails if the file lacks the array to show.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the arrays that it has.
    pub(super) fn check_shown(&self, path: &Path, reading: &Reading<'_>) -> Result<()> {
        let Some(shown) = reading.shown else { return Ok(()) };
        let has = |attribute: Attribute| {
            super::attribute_names(&self.particles).any(|name| name == attribute.name())
        };
        let shows = match known(&canonical(shown)) {
            Some(attribute) => has(attribute),
            None => self.particles.values.is_some() || self.particles.colors.is_some(),
        };
        if shows || self.particles.is_empty() {
            return Ok(());
        }
        let (path, has) = (path.display(), self.colorable());
        Err(Error::Usage(format!("{path}: no `{shown}` to color by; there are: {has}")))
    }

    /// Lists what particles can be coloured by, for messages.
    fn colorable(&self) -> String {
        const MOST: usize = 48;
        let own = super::attribute_names(&self.particles).filter(|name| known(name).is_some());
        let own: Vec<String> = own.map(str::to_owned).collect();
        let others = self.arrays.iter().filter(|array| match *array.shape {
            [_] => true,
            [_, width] => width <= WIDEST,
            _ => false,
        });
        let others = others.map(|array| spelling(&array.name).to_owned());
        let mut all = own;
        for name in others.chain(["x", "y", "z"].map(str::to_owned)) {
            if !all.contains(&name) {
                all.push(name);
            }
        }
        all.truncate(MOST);
        all.join(", ")
    }
}

/// An array's name without its unit.
pub(super) fn spelling(name: &str) -> &str {
    let end = [" [", " ("].iter().filter_map(|unit| name.find(unit)).min();
    name[..end.unwrap_or(name.len())].trim()
}

/// The columns of a vector in two dimensions.
fn pair(names: &[String], base: &str) -> Option<Vec<usize>> {
    let named = |separator: &str| {
        [["x", "y"], ["0", "1"]].map(|of| of.map(|axis| format!("{base}{separator}{axis}")))
    };
    ["", ":", "_", "."].iter().find_map(|s| named(s).iter().find_map(|n| all_among(names, n)))
}

/// Whether an array has this name, in any case and without its unit.
pub(crate) fn is_named(array: &str, name: &str) -> bool {
    canonical(array) == canonical(name)
}

/// The unit in the name of an array, as in `Pressure [Pa]`.
pub(super) fn unit_of(array: &str) -> Option<&str> {
    let (_, unit) = array.split_once(" [").or_else(|| array.split_once(" ("))?;
    unit.strip_suffix([']', ')']).map(str::trim).filter(|unit| !unit.is_empty())
}
