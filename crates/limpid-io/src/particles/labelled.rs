//! Text with one particle per line and a name for each column.

use std::borrow::Cow;
use std::path::Path;

use super::cursor::{Cursor, FileBytes};
use super::values::ELLIPSOID_COLUMNS;
use super::{Attribute, AttributeMap, Column, Contents, Scalar, Table};
use crate::error::{Error, Result};
use limpid::memory;

/// Names of positions, before the axis.
pub(super) const POSITION: [&str; 9] =
    ["", "p", "points", "point", "pos", "position", "positions", "coord", "coordinates"];

/// A column's name in lower case, without a unit as in `Rhop [kg/m^3]`.
pub(super) fn canonical(label: &str) -> String {
    let name = label.to_ascii_lowercase();
    name.split(" [").next().unwrap_or_default().trim().to_owned()
}

pub(super) fn float(field: &[u8]) -> Option<f64> {
    std::str::from_utf8(field).ok()?.parse().ok()
}

/// Parses an integer, which may be written as a float; returns its bytes.
fn integer_bytes(field: &[u8]) -> Option<[u8; 8]> {
    let exact = || {
        let number = float(field)?;
        const EXACT: f64 = 9_007_199_254_740_992.0; // 2⁵³
        (number.fract() == 0.0 && number.abs() <= EXACT).then_some(number as i64)
    };
    let integer = std::str::from_utf8(field).ok()?.parse().ok().or_else(exact)?;
    Some(integer.to_le_bytes())
}

/// Finds the columns of a vector whose names begin with one of `bases`, among names in lower case: `vx`,
/// `Points:0`, `Points_0`, `Pos.x` and so on.
pub(super) fn vector_among(names: &[String], bases: &[&str]) -> Option<Vec<usize>> {
    let find = |column: &str| names.iter().position(|name| name == column);
    let mut spellings = bases.iter().flat_map(|base| {
        ["", ":", "_", "."].into_iter().flat_map(move |separator| {
            [["x", "y", "z"], ["0", "1", "2"]]
                .map(|axes| axes.map(|axis| format!("{base}{separator}{axis}")))
        })
    });
    spellings.find_map(|names| names.iter().map(|name| find(name)).collect())
}

/// Finds the columns of the velocities.
pub(super) fn velocity_among(names: &[String], map: &AttributeMap) -> Option<Vec<usize>> {
    match map.array_of(Attribute::Velocity) {
        Some(name) => vector_among(names, &[&name]),
        None => vector_among(names, &["velocity", "velocities", "vel", "velo", "v"]),
    }
}

/// Finds the columns of the ellipsoids.
pub(super) fn ellipsoid_among(names: &[String], map: &AttributeMap) -> Option<Vec<usize>> {
    let base = map.array_of(Attribute::Ellipsoid).unwrap_or_else(|| "ellipsoid".into());
    let find = |column: &String| names.iter().position(|name| name == column);
    let numbered = |separator: &str| [0, 1, 2, 3, 4, 5].map(|k| format!("{base}{separator}{k}"));
    let lettered = ELLIPSOID_COLUMNS.map(|name| name.replacen("ellipsoid", &base, 1));
    let spellings = [lettered, numbered(":"), numbered("_")];
    spellings.iter().find_map(|names| names.iter().map(find).collect())
}

/// The assignment of columns to positions and attributes.
pub(super) struct Layout {
    /// Labels of all columns, as in the file.
    labels: Vec<String>,
    /// Fields of the positions in a record.
    positions: Vec<usize>,
    /// Fields of each attribute, in the order of [`Layout::among`].
    attributes: Vec<(Attribute, Vec<usize>)>,
}

impl Layout {
    /// Finds positions and attributes among the columns.
    pub(super) fn among(path: &Path, labels: Vec<String>, map: &AttributeMap) -> Result<Self> {
        let names: Vec<String> = labels.iter().map(|label| canonical(label)).collect();
        let Some(positions) = vector_among(&names, &POSITION) else {
            let first: Vec<&str> = names.iter().take(8).map(String::as_str).collect();
            let problem = format!(
                "no columns x, y and z or Points:0 to Points:2; there are: {}",
                first.join(", ")
            );
            return Err(Error::format(path, problem));
        };
        let velocity = velocity_among(&names, map).map(|fields| (Attribute::Velocity, fields));
        let ellipsoid = ellipsoid_among(&names, map).map(|fields| (Attribute::Ellipsoid, fields));
        let single = names.iter().enumerate().filter_map(|(field, name)| {
            let attribute = map.attribute_of(name).or_else(|| map.attribute_of(&labels[field]))?;
            let single = !matches!(attribute, Attribute::Velocity | Attribute::Ellipsoid);
            single.then(|| (attribute, vec![field]))
        });
        let attributes = velocity.into_iter().chain(ellipsoid).chain(single).collect();
        Ok(Self { labels, positions, attributes })
    }

    /// Name and field of every number to read, and whether it is an integer.
    fn fields(&self) -> impl Iterator<Item = (&'static str, usize, bool)> {
        let positions = self.positions.iter().map(|&field| ("position", field, false));
        let attributes = self.attributes.iter().flat_map(|(attribute, fields)| {
            let integer = *attribute == Attribute::Id;
            fields.iter().map(move |&field| (attribute.name(), field, integer))
        });
        positions.chain(attributes)
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
        for (name, field, integer) in self.fields() {
            let problem = |found: &str| {
                let problem =
                    format!("particle {row}: expected a number for {name}, found {found}");
                source.error(offset, problem)
            };
            let field = of(field).ok_or_else(|| problem("no such column"))?;
            let number =
                if integer { integer_bytes(field) } else { float(field).map(f64::to_le_bytes) };
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
            .map(|(k, (_, _, integer))| {
                let scalar = if integer { Scalar::I64 } else { Scalar::F64 };
                Column { offset: k * scalar.size(), scalar }
            })
            .collect();
        let (positions, mut rest) = columns.split_at(3);
        let positions = [positions[0], positions[1], positions[2]];
        let mut contents = Contents::from(table.particles(positions)?);
        let mut used = vec![false; self.labels.len()];
        self.positions.iter().for_each(|&at| used[at] = true);
        for (attribute, fields) in &self.attributes {
            let names: Vec<&str> = fields.iter().map(|&at| self.labels[at].as_str()).collect();
            let shape = [table.rows, fields.len()];
            let shape = if fields.len() == 1 { &shape[..1] } else { &shape[..] };
            let columns;
            (columns, rest) = rest.split_at(fields.len());
            contents.take_as(Some(*attribute), &names.join(" "), shape, table, columns)?;
            fields.iter().for_each(|&at| used[at] = true);
        }
        for (label, _) in self.labels.iter().zip(used).filter(|(_, used)| !used) {
            contents.list(label, &[table.rows], None);
        }
        Ok(contents)
    }
}
