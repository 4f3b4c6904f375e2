//! Text with a line a particle, as `ParaView`, `DualSPHysics` and spreadsheets write it. The
//! delimiter is the one of comma, semicolon and tab that the first line has most of.
//!
//! The first line may name the columns. A vector's are told by its name, perhaps a `:`, `_` or `.`,
//! and `x`, `y`, `z` or `0`, `1`, `2`: `x`, `px`, `Points:0`, `Points_0`, `Pos.x [m]`. Without such
//! a line the first three columns are x, y and z.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use csv::{ByteRecord, ReaderBuilder, Trim};
use glam::DVec3;

use super::{
    Column, Cursor, ELLIPSOID_COLUMNS, Particles, Scalar, Table, Values, foreign, known,
    known_magic, origin_for,
};
use crate::error::{Error, Result};

/// What positions and velocities are called before the axis.
const POSITION: [&str; 9] =
    ["", "p", "points", "point", "pos", "position", "positions", "coord", "coordinates"];
const VELOCITY: [&str; 4] = ["velocity", "velocities", "vel", "v"];

pub(crate) fn read(path: &Path, bytes: &[u8]) -> Result<Particles> {
    const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";
    if known_magic(bytes).is_some() {
        return Err(foreign(path, bytes, "a table of text"));
    }
    let skipped = if bytes.starts_with(BYTE_ORDER_MARK) { BYTE_ORDER_MARK.len() } else { 0 };
    let text = &bytes[skipped..];
    let file = Cursor::new(path, bytes, true);
    let mut records = ReaderBuilder::new()
        .delimiter(delimiter(text))
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .trim(Trim::All)
        .from_reader(text);
    let mut record = ByteRecord::new();
    let mut next = |record: &mut ByteRecord| -> Result<Option<usize>> {
        let there = records.read_byte_record(record).map_err(|error| {
            let offset = error.position().map_or(0, |position| position.byte() as usize);
            file.source.error(skipped + offset, format!("not a table: {error}"))
        })?;
        let start = skipped + record.position().map_or(0, |position| position.byte() as usize);
        let blank = |byte: &&u8| byte.is_ascii_whitespace();
        Ok(there.then(|| start + bytes[start.min(bytes.len())..].iter().take_while(blank).count()))
    };

    let mut start = next(&mut record)?;
    let named = record.iter().take(3).any(|field| float(field).is_none());
    let names: Vec<String> = match named {
        true => record.iter().map(canonical).collect(),
        false => ["x", "y", "z"].map(String::from).into(),
    };
    if start.is_none() {
        return Ok(Particles::default());
    }
    let wanted = Wanted::among(path, &names)?;
    if named {
        start = next(&mut record)?;
    }

    let (mut numbers, mut starts) = (Vec::new(), Vec::new());
    while let Some(offset) = start {
        let row = starts.len();
        for (name, field, integer) in wanted.fields() {
            let problem = |found: &str| {
                let problem =
                    format!("particle {row}: a number for {name} expected, found {found}");
                file.source.error(offset, problem)
            };
            let field = record.get(field).ok_or_else(|| problem("no such column"))?;
            let number =
                if integer { integer_bytes(field) } else { float(field).map(f64::to_le_bytes) };
            let found = || problem(&format!("`{}`", String::from_utf8_lossy(field)));
            numbers.extend(number.ok_or_else(found)?);
        }
        starts.push(offset);
        start = next(&mut record)?;
    }
    let table = Table {
        source: file.source,
        start: skipped,
        rows: starts.len(),
        bytes: Cow::Owned(numbers),
        stride: wanted.fields().count() * Scalar::F64.size(),
        big_endian: false,
        starts: Some(starts),
    };
    wanted.particles(&table)
}

fn delimiter(text: &[u8]) -> u8 {
    let line = text.split(|&byte| byte == b'\n').find(|line| !line.trim_ascii().is_empty());
    let count =
        |delimiter: &u8| line.unwrap_or_default().iter().filter(|&byte| byte == delimiter).count();
    // The last of those that are equal: comma, if there is none.
    [b'\t', b';', b','].into_iter().max_by_key(count).unwrap_or(b',')
}

/// A column's name without case and unit, as `Rhop [kg/m^3]` has one.
fn canonical(name: &[u8]) -> String {
    let name = String::from_utf8_lossy(name).to_ascii_lowercase();
    name.split(" [").next().unwrap_or_default().trim().to_owned()
}

fn float(field: &[u8]) -> Option<f64> {
    std::str::from_utf8(field).ok()?.parse().ok()
}

/// An integer that may be written as a float.
fn integer_bytes(field: &[u8]) -> Option<[u8; 8]> {
    let exact = || {
        let number = float(field)?;
        const EXACT: f64 = 9_007_199_254_740_992.0; // 2⁵³
        (number.fract() == 0.0 && number.abs() <= EXACT).then_some(number as i64)
    };
    let integer = std::str::from_utf8(field).ok()?.parse().ok().or_else(exact)?;
    Some(integer.to_le_bytes())
}

/// The columns of positions and attributes, and what they are.
struct Wanted {
    /// Name, fields of the record, whether they are integers.
    attributes: Vec<(&'static str, Vec<usize>, bool)>,
}

impl Wanted {
    fn among(path: &Path, names: &[String]) -> Result<Self> {
        let find = |wanted: &str| names.iter().position(|name| name == wanted);
        let vector = |bases: &[&str]| {
            let spellings = bases.iter().flat_map(|base| {
                ["", ":", "_", "."].into_iter().flat_map(move |between| {
                    [["x", "y", "z"], ["0", "1", "2"]]
                        .map(|axes| axes.map(|axis| format!("{base}{between}{axis}")))
                })
            });
            spellings
                .filter_map(|names| names.iter().map(|name| find(name)).collect::<Option<Vec<_>>>())
                .next()
        };
        let Some(positions) = vector(&POSITION) else {
            let there: Vec<&str> = names.iter().take(8).map(String::as_str).collect();
            let problem = format!(
                "no columns x, y and z or Points:0 to Points:2; there are: {}",
                there.join(", ")
            );
            return Err(Error::format(path, problem));
        };
        let mut attributes = vec![("position", positions, false)];
        attributes.extend(vector(&VELOCITY).map(|fields| ("velocity", fields, false)));
        let spelt = |between: &str| [0, 1, 2, 3, 4, 5].map(|k| format!("ellipsoid{between}{k}"));
        let ellipsoid = [ELLIPSOID_COLUMNS.map(String::from), spelt(":"), spelt("_")];
        let ellipsoid = ellipsoid
            .iter()
            .find_map(|names| names.iter().map(|name| find(name)).collect::<Option<Vec<_>>>());
        attributes.extend(ellipsoid.map(|fields| ("ellipsoid", fields, false)));
        for (field, name) in names.iter().enumerate() {
            if let Some(name @ ("density" | "radius" | "id")) = known(name) {
                attributes.push((name, vec![field], name == "id"));
            }
        }
        Ok(Self { attributes })
    }

    fn fields(&self) -> impl Iterator<Item = (&'static str, usize, bool)> {
        self.attributes.iter().flat_map(|(name, fields, integer)| {
            fields.iter().map(move |&field| (*name, field, *integer))
        })
    }

    fn particles(&self, table: &Table<'_>) -> Result<Particles> {
        let mut particles = Particles::default();
        let mut offset = 0;
        for (name, fields, integer) in &self.attributes {
            let scalar = if *integer { Scalar::I64 } else { Scalar::F64 };
            let columns = Column::adjacent(offset, fields.len(), scalar);
            offset += fields.len() * scalar.size();
            match (*name, columns.as_slice()) {
                ("position", &[x, y, z]) => particles = table.particles([x, y, z])?,
                _ => particles.attach(name, table, &columns)?,
            }
        }
        Ok(particles)
    }
}

/// Writes a line of names and one a particle, with as many digits as tell the numbers apart.
pub(crate) fn write(particles: &Particles, out: &mut BufWriter<&File>) -> io::Result<()> {
    let attributes = particles.attributes();
    // A cloud far from 0 is read as 64-bit numbers; with all their digits these are the same.
    let places = (0..particles.len()).map(|i| particles.place(i));
    let single = particles.narrow() && origin_for(places) == DVec3::ZERO;
    write!(out, "x,y,z")?;
    for &(name, values) in &attributes {
        for column in values.column_names(name) {
            write!(out, ",{column}")?;
        }
    }
    writeln!(out)?;
    for i in 0..particles.len() {
        if single {
            let [x, y, z] = particles.positions[i].to_array();
            write!(out, "{x},{y},{z}")?;
        } else {
            let [x, y, z] = particles.place(i).to_array();
            write!(out, "{x},{y},{z}")?;
        }
        for &(_, values) in &attributes {
            match values {
                Values::Integers(ids) => write!(out, ",{}", ids[i])?,
                _ => values.floats_of(i).iter().try_for_each(|x| write!(out, ",{x}"))?,
            }
        }
        writeln!(out)?;
    }
    Ok(())
}
