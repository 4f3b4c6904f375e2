//! `.npy`, an array of numpy (Robert Kern, "A simple file format for numpy arrays", 2007, and the
//! module documentation of `numpy.lib.format`): positions as an array of a shape of [`super::axes`], of floats or
//! integers of either byte order, in C or Fortran order.
//!
//! ```text
//! "\x93NUMPY"  u8 major, minor  u16 (major 1) or u32 length, little-endian
//! "{'descr': '<f4', 'fortran_order': False, 'shape': (n, 3), }" padded with blanks
//! the numbers
//! ```
//!
//! The header is a Python literal. Only these three entries matter, and none can be nested, so they are
//! found by their names without parsing Python.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

use super::axes::{Grid, Places};
use super::{
    Contents, Cursor, FileBytes, Others, Particles, ReadOptions, Reading, Scalar, foreign,
    write_numbers,
};
use crate::budget::Budget;
use crate::error::{Error, Result};
use crate::files::{self, File as InputFile};
use limpid::memory;

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    if !bytes.starts_with(MAGIC) {
        return Err(foreign(path, bytes, "a NumPy array"));
    }
    let mut file = Cursor::new(path, bytes, false);
    let header = Header::read(&mut file)?;
    let places = header.places(path)?;
    match places.steps {
        0 => return Ok(Contents::default()),
        1 => {}
        _ => return Err(super::several(path)),
    }
    let numbers = file.take_records(header.grid.rows(), header.grid.row_bytes(), "positions")?;
    let left = file.rest().len();
    if left > 0 {
        let shape: Vec<String> = header.grid.sizes.iter().map(usize::to_string).collect();
        let problem = format!("{left} bytes follow the array of shape ({})", shape.join(", "));
        return Err(file.source.error(file.offset, problem));
    }
    header.contents(path, reading, &places, 0, file.start, numbers)
}

/// Number of time steps in the array; 1 if it has no axis of them, or cannot be read.
pub(super) fn steps(path: &Path) -> Result<usize> {
    let (mut file, _) = files::open(path)?;
    let (start, _) = beginning(path, &mut file)?;
    let header = Header::read(&mut Cursor::new(path, &start, false));
    let places = header.and_then(|header| header.places(path));
    Ok(places.map_or(1, |places| places.steps))
}

/// Reads the positions of one step of several.
pub(super) fn read_step(path: &Path, step: usize, options: &ReadOptions) -> Result<Contents> {
    let fail = |source| Error::io(path, "read", source);
    let (mut file, metadata) = files::open(path)?;
    let (start, length) = beginning(path, &mut file)?;
    let mut cursor = Cursor::new(path, &start, false);
    let header = Header::read(&mut cursor)?;
    let places = header.places(path)?;
    let part = header.grid.part(places.axes, step).unwrap_or(usize::MAX..usize::MAX);
    let from = (cursor.offset as u64).saturating_add(part.start as u64);
    let size = part.len();
    if step >= places.steps || from.saturating_add(size as u64) > length {
        cursor.start = cursor.offset;
        let problem = format!("step {step} of {} lies beyond the end of the file", places.steps);
        return Err(cursor.error(problem));
    }
    let budget = Budget::of_length(options.max_unpacked, size as u64);
    cursor.source.take(&budget, size as u64, cursor.offset)?;
    let mut bytes = memory::zeroed(size, path.display())?;
    file.seek(SeekFrom::Start(from)).map_err(fail)?;
    let read = file.read_exact(&mut bytes);
    files::unchanged(path, &file, &metadata)?;
    read.map_err(fail)?;
    let reading = Reading::new(options, &budget);
    header.contents(path, &reading, &places, step, from as usize, &bytes)
}

/// The bytes at the beginning of a file, more than any header has, and its length.
fn beginning(path: &Path, file: &mut InputFile) -> Result<(Vec<u8>, u64)> {
    const START: u64 = 1 << 16;
    let fail = |source| Error::io(path, "read", source);
    let length = file.metadata().map_err(fail)?.len();
    let mut start = Vec::new();
    file.take(START).read_to_end(&mut start).map_err(fail)?;
    Ok((start, length))
}

pub(super) const MAGIC: &[u8] = b"\x93NUMPY";

/// The header of an array.
pub(super) struct Header {
    /// Type of the numbers in numpy's notation, such as `<f4`.
    pub(super) kind: String,
    /// The array. Numbers of another than a plain type count as bytes.
    pub(super) grid: Grid,
    /// Whether the numbers have a plain type.
    pub(super) plain: bool,
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
        let sizes = shape.split(',').map(str::trim).filter(|size| !size.is_empty());
        let sizes = sizes.map(|size| file.count(Some(size), "the shape"));
        let sizes = sizes.collect::<Result<Vec<usize>>>()?;
        let number = scalar(kind);
        let (big_endian, scalar) = number.unwrap_or((false, Scalar::U8));
        let grid = Grid { sizes, columns_first, scalar, big_endian };
        Ok(Self { kind: kind.into(), grid, plain: number.is_some() })
    }

    /// How positions lie in the array, if it is one of coordinates.
    fn places(&self, path: &Path) -> Result<Places> {
        if !self.plain || !self.grid.may_be_places() {
            let kind = &self.kind;
            let problem = format!(
                "numbers of type `{kind}`; expected floats, or integers of 16 bits or more"
            );
            return Err(Error::format(path, problem));
        }
        Places::of(&self.grid).ok_or_else(|| {
            let shape: Vec<String> = self.grid.sizes.iter().map(usize::to_string).collect();
            let comma = if shape.len() == 1 { "," } else { "" };
            let shape = shape.join(", ");
            let problem = format!(
                "shape ({shape}{comma}); expected (n, 3), or more columns, (3, n), (n, 2), or steps of these"
            );
            Error::format(path, problem)
        })
    }

    /// The positions of a step; `bytes` are those of its part, which begins at `start` of the file.
    fn contents(
        &self,
        path: &Path,
        reading: &Reading<'_>,
        places: &Places,
        step: usize,
        start: usize,
        bytes: &[u8],
    ) -> Result<Contents> {
        let source = FileBytes { path, bytes: &[], text: false };
        let table = self.grid.table(places.axes, step, source, start, Cow::Borrowed(bytes));
        let (table, columns) =
            table.ok_or_else(|| source.error(start, "an array beyond all memory"))?;
        let Some(xyz) = places.coordinates(&columns) else { return Ok(Contents::default()) };
        let mut contents = table.particles(xyz)?;
        contents.remarks = places.remarks("the array", &self.grid);
        if columns.len() > 3 {
            let what = if places.axes.are_rows() { "columns" } else { "rows" };
            let shape = [table.rows, columns.len() - 3];
            contents.list(&format!("{what} after the third"), &shape, None);
            for (number, &column) in (1..).zip(&columns).skip(3) {
                contents.keep(reading, &format!("column {number}"), &table, &[column])?;
            }
        }
        Ok(contents)
    }
}

/// Whether numbers of this type are big-endian, and the type, if it is a plain one.
fn scalar(kind: &str) -> Option<(bool, Scalar)> {
    let (order, kind) = kind.split_at_checked(1)?;
    let scalar = match kind {
        "i1" => Scalar::I8,
        "u1" => Scalar::U8,
        "i2" => Scalar::I16,
        "u2" => Scalar::U16,
        "i4" => Scalar::I32,
        "u4" => Scalar::U32,
        "i8" => Scalar::I64,
        "u8" => Scalar::U64,
        "f2" => Scalar::F16,
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

/// Writes the positions.
pub(super) fn write(
    particles: &Particles,
    _: &Others<'_>,
    out: &mut BufWriter<&File>,
) -> io::Result<()> {
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
