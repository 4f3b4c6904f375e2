//! Text with one particle per line and a name for each column.

use std::borrow::Cow;
use std::path::Path;

use super::cursor::{Cursor, FileBytes};
use super::table::NO_ID;
use super::values::ELLIPSOID_COLUMNS;
use super::{Attribute, AttributeMap, Column, Contents, Reading, Scalar, Table};
use crate::error::{Error, Result};
use crate::number::float;
use limpid::memory;

/// Names of positions, before the axis.
pub(super) const POSITION: [&str; 9] =
    ["", "p", "points", "point", "pos", "position", "positions", "coord", "coordinates"];

/// A column's name in lower case, without a unit as in `Rhop [kg/m^3]` or `Position[i] (m)`.
pub(super) fn canonical(label: &str) -> String {
    let name = label.to_ascii_lowercase();
    let end = [" [", " ("].iter().filter_map(|unit| name.find(unit)).min();
    name[..end.unwrap_or(name.len())].trim().to_owned()
}

/// Parses an integer, which may be written as a float; returns its bytes, or those of [`NO_ID`] for another
/// number.
fn integer_bytes(field: &[u8]) -> Option<[u8; 8]> {
    let rounded = || {
        let number = float(field)?;
        const EXACT: f64 = 9_007_199_254_740_992.0; // 2⁵³
        let exact = number.fract() == 0.0 && number.abs() <= EXACT;
        Some(if exact { number as i64 } else { NO_ID })
    };
    let integer = std::str::from_utf8(field).ok()?.parse().ok().or_else(rounded)?;
    Some(integer.to_le_bytes())
}

/// Finds the columns of a vector whose names begin with one of `bases`, among names in lower case: `vx`,
/// `Points:0`, `Points_0`, `Pos.x`, `Position[i]` and so on.
pub(super) fn vector_among(names: &[String], bases: &[&str]) -> Option<Vec<usize>> {
    columns_among(names, bases, [["x", "y", "z"], ["0", "1", "2"], ["[i]", "[j]", "[k]"]])
}

/// As [`vector_among`], for vectors with these names of axes.
fn columns_among<const N: usize>(
    names: &[String],
    bases: &[&str],
    axes: [[&str; N]; 3],
) -> Option<Vec<usize>> {
    let find = |column: &str| names.iter().position(|name| name == column);
    let mut spellings = bases.iter().flat_map(|base| {
        ["", ":", "_", "."].into_iter().flat_map(move |separator| {
            axes.map(|axes| axes.map(|axis| format!("{base}{separator}{axis}")))
        })
    });
    spellings.find_map(|names| names.iter().map(|name| find(name)).collect())
}

/// Finds columns by their names.
pub(super) fn all_among(names: &[String], wanted: &[impl AsRef<str>]) -> Option<Vec<usize>> {
    wanted.iter().map(|wanted| names.iter().position(|name| name == wanted.as_ref())).collect()
}

fn canonical_names(labels: &[impl AsRef<str>]) -> Vec<String> {
    labels.iter().map(|label| canonical(label.as_ref())).collect()
}

/// Finds the columns of the positions among labels: those that the map names, or those of the usual names.
pub(super) fn position_among(labels: &[impl AsRef<str>], map: &AttributeMap) -> Option<Vec<usize>> {
    let names = canonical_names(labels);
    if let Some(columns) = map.columns_of(Attribute::Position) {
        return all_among(&names, &columns);
    }
    match map.array_of(Attribute::Position) {
        Some(base) => vector_among(&names, &[&base]),
        None => vector_among(&names, &POSITION),
    }
}

/// Finds the columns of the velocities among labels: three, or two of a simulation in two dimensions.
pub(super) fn velocity_among(labels: &[impl AsRef<str>], map: &AttributeMap) -> Option<Vec<usize>> {
    let names = canonical_names(labels);
    if let Some(columns) = map.columns_of(Attribute::Velocity) {
        return all_among(&names, &columns);
    }
    let mapped = map.array_of(Attribute::Velocity);
    let own = mapped.as_deref().map(|name| [name]);
    let bases: &[&str] = match &own {
        Some(own) => own,
        None if map.has(Attribute::Velocity) => return None,
        None => &["velocity", "velocities", "vel", "velo", "v"],
    };
    let pair = || columns_among(&names, bases, [["x", "y"], ["0", "1"], ["[i]", "[j]"]]);
    let found = vector_among(&names, bases).or_else(pair);
    if found.is_some() || mapped.is_some() {
        return found;
    }
    // Capital letters of the same name may be something else, as PySPH's V.
    let exact: Vec<String> = labels.iter().map(|label| label.as_ref().to_owned()).collect();
    all_among(&exact, &["u", "v", "w"]).or_else(|| all_among(&names, &["u", "v", "w"]))
}

/// Finds the columns of the ellipsoids among labels.
pub(super) fn ellipsoid_among(
    labels: &[impl AsRef<str>],
    map: &AttributeMap,
) -> Option<Vec<usize>> {
    let names = canonical_names(labels);
    if let Some(columns) = map.columns_of(Attribute::Ellipsoid) {
        return all_among(&names, &columns);
    }
    if map.has(Attribute::Ellipsoid) && map.array_of(Attribute::Ellipsoid).is_none() {
        return None;
    }
    let base = map.array_of(Attribute::Ellipsoid).unwrap_or_else(|| "ellipsoid".into());
    let numbered = |separator: &str| [0, 1, 2, 3, 4, 5].map(|k| format!("{base}{separator}{k}"));
    let lettered = ELLIPSOID_COLUMNS.map(|name| name.replacen("ellipsoid", &base, 1));
    let spellings = [lettered, numbered(":"), numbered("_")];
    spellings.iter().find_map(|spelling| all_among(&names, spelling))
}

/// The assignment of columns to positions and attributes.
pub(super) struct Layout<'a> {
    reading: Reading<'a>,
    /// Labels of all columns, as in the file.
    labels: Vec<String>,
    /// Fields of the positions in a record.
    positions: Vec<usize>,
    /// Whether the attribute map names them.
    mapped: bool,
    /// Fields of each attribute, in the order of [`Layout::among`].
    attributes: Vec<(Attribute, Vec<usize>)>,
    /// Fields that are read beside.
    others: Vec<usize>,
}

impl<'a> Layout<'a> {
    /// Finds positions and attributes among the columns.
    pub(super) fn among(path: &Path, labels: Vec<String>, reading: Reading<'a>) -> Result<Self> {
        let map = reading.map;
        let names = canonical_names(&labels);
        let Some(positions) = position_among(&labels, map) else {
            return Err(Error::format(
                path,
                map.no_positions("columns", "x, y and z or Points:0 to Points:2", &labels),
            ));
        };
        let velocity = velocity_among(&labels, map).map(|fields| (Attribute::Velocity, fields));
        let ellipsoid = ellipsoid_among(&labels, map).map(|fields| (Attribute::Ellipsoid, fields));
        let vectors: Vec<(Attribute, Vec<usize>)> = velocity.into_iter().chain(ellipsoid).collect();
        let single = names.iter().enumerate().filter_map(|(field, name)| {
            let attribute = map.attribute_of(name).or_else(|| map.attribute_of(&labels[field]))?;
            let used = vectors.iter().any(|(_, fields)| fields.contains(&field));
            (attribute.width() == 1 && !used).then(|| (attribute, vec![field]))
        });
        let single: Vec<_> = single.collect();
        let attributes: Vec<(Attribute, Vec<usize>)> = vectors.into_iter().chain(single).collect();
        let fields = attributes.iter().flat_map(|(_, fields)| fields).chain(&positions);
        let used: Vec<usize> = fields.copied().collect();
        let is_read = |field: &usize| {
            let label = &labels[*field];
            reading.keeps(label) || reading.shows_or_describes(label)
        };
        let others = (0..labels.len()).filter(|field| !used.contains(field)).filter(is_read);
        let others = others.collect();
        let mapped = map.has(Attribute::Position);
        Ok(Self { reading, labels, positions, mapped, attributes, others })
    }

    /// Attribute and field of every number to read, positions first.
    fn fields(&self) -> impl Iterator<Item = (Option<Attribute>, usize)> {
        let positions = self.positions.iter().map(|&field| (Some(Attribute::Position), field));
        let attributes = self.attributes.iter().flat_map(|(attribute, fields)| {
            fields.iter().map(move |&field| (Some(*attribute), field))
        });
        let others = self.others.iter().map(|&field| (None, field));
        positions.chain(attributes).chain(others)
    }

    /// Bytes of a row's numbers.
    pub(super) fn stride(&self) -> usize {
        self.fields().count() * Scalar::F64.size()
    }

    /// Adds the numbers of a particle's row, which begins at `offset`, from its fields.
    pub(super) fn push_row<'r>(
        &self,
        source: FileBytes<'_>,
        offset: usize,
        row: usize,
        of: impl Fn(usize) -> Option<&'r [u8]>,
        numbers: &mut Vec<u8>,
    ) -> Result<()> {
        for (attribute, field) in self.fields() {
            let Some(attribute) = attribute else {
                let number = of(field).and_then(float).unwrap_or(f64::NAN);
                numbers.extend(number.to_le_bytes());
                continue;
            };
            let problem = |found: &str| {
                let problem =
                    format!("particle {row}: expected a number for {attribute}, found {found}");
                source.error(offset, problem)
            };
            let field = of(field).ok_or_else(|| problem("no such column"))?;
            let number = match attribute {
                Attribute::Id => integer_bytes(field),
                _ => float(field).map(f64::to_le_bytes),
            };
            let found = || problem(&format!("`{}`", String::from_utf8_lossy(field)));
            numbers.extend(number.ok_or_else(found)?);
        }
        Ok(())
    }

    /// Reads `count` particles of one line each, which end the file. `adjust` may change a particle's numbers,
    /// the first three of which are its position.
    pub(super) fn read_lines(
        &self,
        file: &mut Cursor<'_>,
        count: usize,
        adjust: impl Fn(&mut [[u8; 8]]),
    ) -> Result<Contents> {
        let path = file.source.path;
        let (mut numbers, mut starts) = (Vec::new(), Vec::new());
        let begin = file.offset;
        for row in 0..count {
            let Some(line) = file.line() else {
                return Err(file.error(format!("particle {row}: expected {count} lines")));
            };
            let words: Vec<&[u8]> = line.split_ascii_whitespace().map(str::as_bytes).collect();
            memory::grow(&mut numbers, self.stride(), path.display())?;
            memory::grow(&mut starts, 1, path.display())?;
            let at = numbers.len();
            let word = |field: usize| words.get(field).copied();
            self.push_row(file.source, file.start, row, word, &mut numbers)?;
            // The last number of a row that is cut off may have lost digits.
            let (found, expected) = (words.len(), self.labels.len());
            if found < expected {
                let problem = format!("particle {row}: {found} columns, expected {expected}");
                return Err(file.error(problem));
            }
            adjust(numbers[at..].as_chunks_mut().0);
            starts.push(file.start);
        }
        if file.filled_line().is_some() {
            return Err(super::several(path));
        }
        self.contents(file.source, begin, numbers, starts)
    }

    /// The particles of rows that were added by [`Layout::push_row`]; `starts` are their offsets, and
    /// `start` is that of the first.
    pub(super) fn contents(
        &self,
        source: FileBytes<'_>,
        start: usize,
        numbers: Vec<u8>,
        starts: Vec<usize>,
    ) -> Result<Contents> {
        let table = &Table {
            source,
            start,
            rows: starts.len(),
            bytes: Cow::Owned(numbers),
            stride: self.stride(),
            big_endian: false,
            starts: Some(starts),
        };
        let columns: Vec<Column> = self
            .fields()
            .enumerate()
            .map(|(k, (attribute, _))| {
                let is_id = attribute == Some(Attribute::Id);
                let scalar = if is_id { Scalar::I64 } else { Scalar::F64 };
                Column { offset: k * scalar.size(), scalar }
            })
            .collect();
        let (positions, mut rest) = columns.split_at(3);
        let positions = [positions[0], positions[1], positions[2]];
        let mut contents = table.particles(positions)?;
        let mut used = vec![false; self.labels.len()];
        self.positions.iter().for_each(|&at| used[at] = true);
        if self.mapped {
            let names: Vec<&str> =
                self.positions.iter().map(|&at| self.labels[at].as_str()).collect();
            contents.list(&names.join(" "), &[table.rows, 3], Some(Attribute::Position));
        }
        for (attribute, fields) in &self.attributes {
            let names: Vec<&str> = fields.iter().map(|&at| self.labels[at].as_str()).collect();
            let shape = [table.rows, fields.len()];
            let shape = if fields.len() == 1 { &shape[..1] } else { &shape[..] };
            let columns;
            (columns, rest) = rest.split_at(fields.len());
            for (&at, column) in fields.iter().zip(columns) {
                contents.keep(&self.reading, &self.labels[at], table, &[*column])?;
            }
            contents.take_as(Some(*attribute), &names.join(" "), shape, table, columns)?;
            fields.iter().for_each(|&at| used[at] = true);
        }
        let unused = used.iter().enumerate().filter(|(_, used)| !**used);
        for (field, label) in unused.map(|(field, _)| (field, &self.labels[field])) {
            match self.others.iter().position(|&other| other == field) {
                Some(k) => contents.take(&self.reading, label, table, &rest[k..=k])?,
                None => contents.list(label, &[table.rows], None),
            }
        }
        Ok(contents)
    }
}
