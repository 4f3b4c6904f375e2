//! Decoding of fixed-size records of any layout to attributes.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use bytemuck::Zeroable;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::cursor::{Cursor, FileBytes};
use super::{Contents, Particles};
use crate::error::{Error, Location, Result};
use limpid::camera::is_position;
use limpid::memory;

/// The first particle of a file that has no position.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Unplaced {
    /// The file, or the array of an archive.
    pub(super) path: PathBuf,
    pub(super) location: Location,
    /// Its number, from 0.
    pub(super) row: usize,
    /// Its coordinates.
    pub(super) position: Vec3,
}

/// Types of numbers in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F16,
    F32,
    F64,
}

impl<'a> Cursor<'a> {
    /// Takes `rows` records of `stride` bytes as a table.
    pub(super) fn table(
        &mut self,
        rows: usize,
        stride: usize,
        big_endian: bool,
        what: &str,
    ) -> Result<Table<'a>> {
        let bytes = Cow::Borrowed(self.take_records(rows, stride, what)?);
        let (source, start) = (self.source, self.start);
        Ok(Table { source, start, bytes, rows, stride, big_endian, starts: None })
    }
}

impl Scalar {
    pub(crate) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 | Self::F16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The number at the start of some bytes as the nearest f64.
    pub(crate) fn number(self, bytes: &[u8], big_endian: bool) -> f64 {
        Column { offset: 0, scalar: self }.number(bytes, big_endian)
    }
}

/// The number of IEEE 754's 16-bit format: a sign, 5 bits of exponent, 10 of fraction.
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023) / 1024.0);
    let size = match exponent {
        0 => fraction * 2_f64.powi(-14),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction) * 2_f64.powi(exponent - 15),
    };
    if bits >> 15 == 1 { -size } else { size }
}

/// A column of a table: the offset of a number from the start of each record, and its type.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Column {
    pub(crate) offset: usize,
    pub(crate) scalar: Scalar,
}

impl Column {
    /// A column of zeros: it lies outside all records.
    pub(super) const ZERO: Self = Self { offset: usize::MAX, scalar: Scalar::F32 };

    /// The columns of `count` consecutive numbers.
    pub(super) fn adjacent(offset: usize, count: usize, scalar: Scalar) -> Vec<Self> {
        (0..count).map(|k| Self { offset: offset + k * scalar.size(), scalar }).collect()
    }

    /// The columns of three consecutive numbers at the start of a record.
    pub(crate) fn triple(scalar: Scalar) -> [Self; 3] {
        [0, 1, 2].map(|k| Self { offset: k * scalar.size(), scalar })
    }

    /// The bytes of the number. Readers derive a table's stride from its columns, so that no record is
    /// too short; if one is, the number is 0.
    pub(super) fn bytes<const N: usize>(self, record: &[u8]) -> [u8; N] {
        record.get(self.offset..).and_then(|rest| rest.first_chunk()).map_or([0; N], |b| *b)
    }

    /// The number as the nearest f64.
    pub(crate) fn number(self, record: &[u8], big_endian: bool) -> f64 {
        macro_rules! number {
            ($type:ty) => {
                if big_endian {
                    <$type>::from_be_bytes(self.bytes(record)) as f64
                } else {
                    <$type>::from_le_bytes(self.bytes(record)) as f64
                }
            };
        }
        match self.scalar {
            Scalar::I8 => number!(i8),
            Scalar::U8 => number!(u8),
            Scalar::I16 => number!(i16),
            Scalar::U16 => number!(u16),
            Scalar::I32 => number!(i32),
            Scalar::U32 => number!(u32),
            Scalar::I64 => number!(i64),
            Scalar::U64 => number!(u64),
            Scalar::F16 if big_endian => half(u16::from_be_bytes(self.bytes(record))),
            Scalar::F16 => half(u16::from_le_bytes(self.bytes(record))),
            Scalar::F32 => number!(f32),
            Scalar::F64 => number!(f64),
        }
    }

    /// The number as an integer, if it is one exactly.
    pub(super) fn integer(self, record: &[u8], big_endian: bool) -> Option<i64> {
        const EXACT: f64 = 9_007_199_254_740_992.0; // 2⁵³
        match (self.scalar, big_endian) {
            (Scalar::I64, true) => Some(i64::from_be_bytes(self.bytes(record))),
            (Scalar::I64, false) => Some(i64::from_le_bytes(self.bytes(record))),
            (Scalar::U64, true) => u64::from_be_bytes(self.bytes(record)).try_into().ok(),
            (Scalar::U64, false) => u64::from_le_bytes(self.bytes(record)).try_into().ok(),
            _ => {
                let number = self.number(record, big_endian);
                (number.fract() == 0.0 && number.abs() <= EXACT).then_some(number as i64)
            }
        }
    }
}

/// Stands for an id that is no integer.
pub(super) const NO_ID: i64 = i64::MIN;

/// Number of rows that a thread decodes at a time.
const BLOCK: usize = 4096;

/// Records of equal size, one per particle. Text is first converted to binary numbers, so that all
/// formats share the decoder.
pub(super) struct Table<'a> {
    pub(super) source: FileBytes<'a>,
    /// Offset of the table in the file.
    pub(super) start: usize,
    /// All columns of all rows.
    pub(super) bytes: Cow<'a, [u8]>,
    pub(super) rows: usize,
    /// Distance between consecutive records, bytes.
    pub(super) stride: usize,
    pub(super) big_endian: bool,
    /// Offsets of the records in the file, if not multiples of `stride`; the table's start for those not
    /// listed.
    pub(super) starts: Option<Vec<usize>>,
}

impl<'a> Table<'a> {
    /// A table with these columns side by side; `path` is that of messages.
    pub(super) fn of_columns(
        path: &'a Path,
        columns: &[impl AsRef<[f64]>],
    ) -> Result<(Self, Vec<Column>)> {
        let rows = columns.iter().map(|column| column.as_ref().len());
        let (least, rows) = (rows.clone().min().unwrap_or(0), rows.max().unwrap_or(0));
        if least != rows {
            let problem =
                format!("columns of {least} and of {rows} numbers, expected as many of each");
            return Err(Error::malformed(path, Location::Byte(0), problem));
        }
        let stride = columns.len() * Scalar::F64.size();
        let mut bytes = memory::zeroed(rows.saturating_mul(stride), path.display())?;
        for (k, column) in columns.iter().enumerate() {
            for (row, number) in bytes.chunks_exact_mut(stride).zip(column.as_ref()) {
                row[8 * k..][..8].copy_from_slice(&number.to_le_bytes());
            }
        }
        let table = Self {
            source: FileBytes { path, bytes: &[], text: false },
            start: 0,
            bytes: Cow::Owned(bytes),
            rows,
            stride,
            big_endian: false,
            // They are at several places in the file.
            starts: Some(Vec::new()),
        };
        Ok((table, Column::adjacent(0, columns.len(), Scalar::F64)))
    }
}

impl Table<'_> {
    /// Where a number of a row is in the file.
    pub(super) fn location(&self, row: usize, column: Column) -> Location {
        let offset = match &self.starts {
            Some(starts) => starts.get(row).copied().unwrap_or(self.start),
            None => self.start + row * self.stride + column.offset,
        };
        self.source.location(offset)
    }

    /// Decodes `columns` to positions. Those that are not finite, or too large to be drawn, are NaN until
    /// [`Contents::settle`] leaves them out.
    pub(super) fn particles(&self, columns: [Column; 3]) -> Result<Contents> {
        let mut first = None;
        let mut check = |row: usize, position: DVec3| {
            let valid = is_position(position);
            if !valid && first.is_none() {
                first = Some((row, position.as_vec3()));
            }
            valid
        };
        let particles = if columns.iter().all(|column| column.scalar == Scalar::F32) {
            let mut positions = self.vectors(columns)?;
            for (row, position) in positions.iter_mut().enumerate() {
                if !check(row, position.as_dvec3()) {
                    *position = Vec3::NAN;
                }
            }
            Particles::from_positions(positions)
        } else {
            let mut places = self.decode(|bytes, rows: &mut [DVec3]| {
                for (i, place) in rows.iter_mut().enumerate() {
                    let record = bytes.get(i * self.stride..).unwrap_or_default();
                    *place = columns.map(|column| column.number(record, self.big_endian)).into();
                }
            })?;
            for (row, place) in places.iter_mut().enumerate() {
                if !check(row, *place) {
                    *place = DVec3::NAN;
                }
            }
            memory::probe(places.len() * size_of::<Vec3>(), self.source.path.display())?;
            // 32-bit floats stored as 64-bit ones need no origin.
            let narrow = |&place: &DVec3| place.is_nan() || place.as_vec3().as_dvec3() == place;
            match places.iter().all(narrow) {
                true => Particles::from_positions(places.iter().map(|x| x.as_vec3()).collect()),
                false => Particles::from_places(&places),
            }
        };
        let unplaced = first.map(|(row, position)| {
            let worst = (0..3).find(|&k| !position[k].is_finite()).unwrap_or(0);
            let (path, location) = (self.source.path.into(), self.location(row, columns[worst]));
            Unplaced { path, location, row, position }
        });
        Ok(Contents { particles, unplaced, ..Contents::default() })
    }

    /// Decodes `columns` to vectors.
    pub(super) fn vectors(&self, columns: [Column; 3]) -> Result<Vec<Vec3>> {
        Ok(bytemuck::allocation::cast_vec(self.floats(columns)?))
    }

    /// Decodes `columns` to 32-bit floats, record by record.
    pub(super) fn floats<const N: usize>(&self, columns: [Column; N]) -> Result<Vec<[f32; N]>> {
        let width = N * Scalar::F32.size();
        let first = columns.first().map_or(0, |column| column.offset);
        let adjacent = columns.iter().enumerate().all(|(k, column)| {
            column.scalar == Scalar::F32 && column.offset == first + k * Scalar::F32.size()
        });
        let (stride, big) = (self.stride, self.big_endian);
        // The fast paths are for adjacent floats, as in nearly all files.
        let adjacent = adjacent && first + width <= stride;
        let native = big == cfg!(target_endian = "big");
        let fill = |bytes: &[u8], rows: &mut [[f32; N]]| {
            let filled = rows.as_flattened_mut();
            if adjacent && stride == width && filled.len() * 4 <= bytes.len() {
                let words: &mut [u8] = bytemuck::cast_slice_mut(filled);
                words.copy_from_slice(&bytes[..words.len()]);
                if !native {
                    filled.iter_mut().for_each(|x| *x = f32::from_bits(x.to_bits().swap_bytes()));
                }
            } else if adjacent {
                for (record, row) in bytes.chunks_exact(stride).zip(rows.iter_mut()) {
                    let words = record[first..first + width].as_chunks().0;
                    for (x, word) in row.iter_mut().zip(words) {
                        *x =
                            if big { f32::from_be_bytes(*word) } else { f32::from_le_bytes(*word) };
                    }
                }
            } else {
                for (i, row) in rows.iter_mut().enumerate() {
                    let record = bytes.get(i * stride..).unwrap_or_default();
                    *row = columns.map(|column| column.number(record, big) as f32);
                }
            }
        };
        self.decode(fill)
    }

    /// Decodes a column to integers; [`NO_ID`] stands for other numbers.
    pub(super) fn integers(&self, column: Column) -> Result<Vec<i64>> {
        self.decode(|bytes, rows: &mut [i64]| {
            for (i, row) in rows.iter_mut().enumerate() {
                let record = bytes.get(i * self.stride..).unwrap_or_default();
                *row = column.integer(record, self.big_endian).unwrap_or(NO_ID);
            }
        })
    }

    /// Decodes a column to 64-bit floats.
    pub(super) fn numbers(&self, column: Column) -> Result<Vec<f64>> {
        self.decode(|bytes, rows: &mut [f64]| {
            for (i, row) in rows.iter_mut().enumerate() {
                let record = bytes.get(i * self.stride..).unwrap_or_default();
                *row = column.number(record, self.big_endian);
            }
        })
    }

    /// The distinct numbers of a column, in ascending order, if they are few integers; else none.
    pub(super) fn few_integers(&self, column: Column) -> Vec<i64> {
        /// Largest number of them.
        const FEW: usize = 8;
        let mut found = Vec::new();
        for row in 0..self.rows {
            let record = self.bytes.get(row * self.stride..).unwrap_or_default();
            match column.integer(record, self.big_endian) {
                Some(integer) if found.contains(&integer) => {}
                Some(integer) if found.len() < FEW => found.push(integer),
                _ => return Vec::new(),
            }
        }
        found.sort_unstable();
        found
    }

    /// Decodes all rows, block by block on all cores. `fill` decodes rows from the start of some bytes.
    fn decode<T: Zeroable + Clone + Send>(
        &self,
        fill: impl Fn(&[u8], &mut [T]) + Sync,
    ) -> Result<Vec<T>> {
        let from = |row: usize| self.bytes.get(row * self.stride..).unwrap_or_default();
        let mut values: Vec<T> = memory::zeroed(self.rows, self.source.path.display())?;
        // A few rows are decoded in less time than other threads need to wake up.
        if self.rows <= BLOCK {
            fill(from(0), &mut values);
        } else {
            let blocks = values.par_chunks_mut(BLOCK).enumerate();
            blocks.for_each(|(i, rows)| fill(from(i * BLOCK), rows));
        }
        Ok(values)
    }
}
