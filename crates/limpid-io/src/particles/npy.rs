//! `.npy`, an array of numpy (Robert Kern, "A simple file format for numpy arrays", 2007, and the
//! module documentation of `numpy.lib.format`): positions as an array of shape (n, 3), or with further columns that are ignored, of 32- or 64-bit
//! floats, of either byte order, in C or Fortran order.
//!
//! ```text
//! "\x93NUMPY"  u8 major, minor  u16 (major 1) or u32 length, little-endian
//! "{'descr': '<f4', 'fortran_order': False, 'shape': (n, 3), }" padded with blanks
//! the numbers
//! ```
//!
//! The header is a Python literal. Only these three entries matter, and none can be nested, so they are
//! found by their names without parsing Python.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::{Column, Contents, Cursor, Particles, Reading, Scalar, Table, foreign, write_numbers};
use crate::error::{Error, Result};

pub(super) fn read(path: &Path, bytes: &[u8], _: &Reading<'_>) -> Result<Contents> {
    if !bytes.starts_with(MAGIC) {
        return Err(foreign(path, bytes, "a NumPy array"));
    }
    let mut file = Cursor::new(path, bytes, false);
    let header = Header::read(&mut file)?;
    let mut contents = Contents::from(header.positions(&mut file)?);
    if header.further_columns() > 0 {
        let rows = contents.particles.len();
        contents.list("columns after the third", &[rows, header.further_columns()], None);
    }
    Ok(contents)
}

/// Largest number of values of an attribute.
const MAX_SIZE: usize = 6;

/// Largest number of columns beside and including the positions.
const MAX_COLUMNS: usize = 4096;

const MAGIC: &[u8] = b"\x93NUMPY";

/// The header of an array.
pub(super) struct Header {
    /// Type of the numbers in numpy's notation, such as `<f4`.
    kind: String,
    columns_first: bool,
    shape: String,
}

impl Header {
    pub(super) fn read(file: &mut Cursor<'_>) -> Result<Self> {
        if file.take(MAGIC.len(), "the magic")? != MAGIC {
            return Err(file.error("this is not a NumPy array"));
        }
        let [major, _minor] = file.array("the version")?;
        let length = match major {
            1 => file.array("the header's length").map(u16::from_le_bytes)?.into(),
            2 | 3 => file.array("the header's length").map(u32::from_le_bytes)? as usize,
            _ => {
                let problem = format!("version {major} of the .npy format; 1 to 3 can be read");
                return Err(Error::format(file.source.path, problem));
            }
        };
        let header = String::from_utf8_lossy(file.take(length, "the header")?).replace('"', "'");
        let entry = |key: &str| {
            let (_, rest) = header.split_once(&format!("'{key}'"))?;
            Some(rest.trim_start().strip_prefix(':')?.trim_start())
        };
        let missing = |key: &str| file.error(format!("the header has no valid `{key}`"));

        let kind = entry("descr").ok_or_else(|| missing("descr"))?;
        let kind = kind.strip_prefix('\'').and_then(|rest| rest.split('\'').next()).unwrap_or(kind);
        let columns_first = match entry("fortran_order") {
            Some(value) if value.starts_with("True") => true,
            Some(value) if value.starts_with("False") => false,
            _ => return Err(missing("fortran_order")),
        };
        let shape = entry("shape").and_then(|rest| rest.strip_prefix('(')?.split_once(')'));
        let (shape, _) = shape.ok_or_else(|| missing("shape"))?;
        Ok(Self { kind: kind.into(), columns_first, shape: shape.into() })
    }

    fn sizes(&self) -> Vec<&str> {
        self.shape.split(',').map(str::trim).filter(|size| !size.is_empty()).collect()
    }

    /// The sizes along all axes, without those that are not numbers.
    pub(super) fn shape(&self) -> Vec<usize> {
        self.sizes().iter().filter_map(|size| size.parse().ok()).collect()
    }

    /// Whether the array can be positions.
    pub(super) fn triples(&self) -> bool {
        matches!(self.sizes().as_slice(), [_, "3"])
            && matches!(self.scalar(), Some((_, Scalar::F32 | Scalar::F64)))
    }

    /// Whether the numbers are big-endian, and their type, if it is a plain one.
    fn scalar(&self) -> Option<(bool, Scalar)> {
        let (order, kind) = self.kind.split_at_checked(1)?;
        let scalar = match kind {
            "i1" => Scalar::I8,
            "u1" => Scalar::U8,
            "i2" => Scalar::I16,
            "u2" => Scalar::U16,
            "i4" => Scalar::I32,
            "u4" => Scalar::U32,
            "i8" => Scalar::I64,
            "u8" => Scalar::U64,
            "f4" => Scalar::F32,
            "f8" => Scalar::F64,
            _ => return None,
        };
        match order {
            "<" | "|" => Some((false, scalar)),
            ">" => Some((true, scalar)),
            _ => None,
        }
    }

    pub(super) fn positions(&self, file: &mut Cursor<'_>) -> Result<Particles> {
        let path = file.source.path;
        if !matches!(self.scalar(), Some((_, Scalar::F32 | Scalar::F64))) {
            let problem = format!("numbers of type `{}`; expected 32- or 64-bit floats", self.kind);
            return Err(Error::format(path, problem));
        }
        let problem = || {
            let shape = &self.shape;
            Error::format(path, format!("shape ({shape}); expected (n, 3), or more columns"))
        };
        let [_, _] = *self.sizes() else { return Err(problem()) };
        let (table, columns) = self.columns(file, "positions", MAX_COLUMNS)?.ok_or_else(problem)?;
        match columns.as_slice() {
            &[x, y, z, ..] => table.particles([x, y, z]),
            _ => Err(problem()),
        }
    }

    /// Number of columns after the positions.
    fn further_columns(&self) -> usize {
        let columns = self.sizes().get(1).and_then(|size| size.parse::<usize>().ok());
        columns.unwrap_or(3).saturating_sub(3)
    }

    /// The array with one row per particle, if its shape is (n) or (n, k) and its numbers have a plain
    /// type; shape (), a single number, is one row.
    pub(super) fn table<'a>(
        &self,
        file: &mut Cursor<'a>,
        what: &str,
    ) -> Result<Option<(Table<'a>, Vec<Column>)>> {
        self.columns(file, what, MAX_SIZE)
    }

    /// As [`Header::table`], for up to `most` values of a particle.
    fn columns<'a>(
        &self,
        file: &mut Cursor<'a>,
        what: &str,
        most: usize,
    ) -> Result<Option<(Table<'a>, Vec<Column>)>> {
        let Some((big_endian, scalar)) = self.scalar() else { return Ok(None) };
        let sizes = self.sizes();
        let (rows, size) = match *sizes.as_slice() {
            [] => ("1", 1),
            [rows] => (rows, 1),
            [rows, size] => (rows, file.count(Some(size), "the shape")?),
            _ => return Ok(None),
        };
        let rows = file.count(Some(rows), "the shape")?;
        if size == 0 || size > most {
            return Ok(None);
        }
        let mut table = file.table(rows, size * scalar.size(), big_endian, what)?;
        let columns = if self.columns_first {
            table.stride = scalar.size();
            (0..size).map(|k| Column { offset: k * rows * scalar.size(), scalar }).collect()
        } else {
            Column::adjacent(0, size, scalar)
        };
        Ok(Some((table, columns)))
    }
}

/// Writes the positions.
pub(crate) fn write(particles: &Particles, out: &mut BufWriter<&File>) -> io::Result<()> {
    write_positions(particles, out)
}

pub(super) fn write_positions(particles: &Particles, out: &mut impl Write) -> io::Result<()> {
    if particles.narrow() {
        write_header("<f4", particles.len(), 3, out)?;
        return write_numbers(bytemuck::cast_slice(&particles.positions), f32::to_le_bytes, out);
    }
    write_header("<f8", particles.len(), 3, out)?;
    (0..particles.len()).try_for_each(|i| {
        out.write_all(particles.place(i).to_array().map(f64::to_le_bytes).as_flattened())
    })
}

/// Writes the header of an array in C order, of shape (rows) or (rows, size).
pub(super) fn write_header(
    kind: &str,
    rows: usize,
    size: usize,
    out: &mut impl Write,
) -> io::Result<()> {
    /// Bytes before the header: magic, version and length.
    const PREFIX: usize = 10;
    /// Alignment of the numbers, bytes.
    const ALIGNMENT: usize = 64;
    let shape = if size == 1 { format!("{rows},") } else { format!("{rows}, {size}") };
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    let length = (PREFIX + header.len() + 1).next_multiple_of(ALIGNMENT) - PREFIX;
    out.write_all(MAGIC)?;
    out.write_all(&[1, 0])?;
    out.write_all(&(length as u16).to_le_bytes())?;
    writeln!(out, "{header:<width$}", width = length - 1)
}
