//! Decoding of fixed-size records of any layout to attributes.

use std::borrow::Cow;

use bytemuck::Zeroable;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::Particles;
use super::cursor::{Cursor, FileBytes};
use crate::error::{Error, Result};
use limpid::camera::is_position;
use limpid::memory;

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

/// Number of rows decoded at a time, few enough to stay in the CPU's cache until they are checked.
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

impl Table<'_> {
    pub(super) fn error(&self, row: usize, column: Column, problem: String) -> Error {
        let offset = match &self.starts {
            Some(starts) => starts.get(row).copied().unwrap_or(self.start),
            None => self.start + row * self.stride + column.offset,
        };
        self.source.error(offset, problem)
    }

    /// Decodes `columns` to positions.
    pub(super) fn particles(&self, columns: [Column; 3]) -> Result<Particles> {
        if columns.iter().all(|column| column.scalar == Scalar::F32) {
            let positions = self.vectors(columns, "position")?;
            self.check_positions(columns, positions.iter().map(|x| x.as_dvec3()))?;
            return Ok(Particles::from_positions(positions));
        }
        let positions = self.decode(
            |bytes, rows: &mut [DVec3]| {
                for (i, position) in rows.iter_mut().enumerate() {
                    let record = bytes.get(i * self.stride..).unwrap_or_default();
                    *position = columns.map(|column| column.number(record, self.big_endian)).into();
                }
                rows.iter().all(|position| position.as_vec3().is_finite())
            },
            |record| self.not_finite(columns, "position", record),
        )?;
        self.check_positions(columns, positions.iter().copied())?;
        // 32-bit floats stored as 64-bit ones need no origin.
        memory::probe(positions.len() * size_of::<Vec3>(), self.source.path.display())?;
        if positions.iter().all(|&position| position.as_vec3().as_dvec3() == position) {
            return Ok(Particles::from_positions(positions.iter().map(|p| p.as_vec3()).collect()));
        }
        Ok(Particles::from_places(&positions))
    }

    /// Fails at the first position too large to be drawn, whose square does not fit a 32-bit float.
    fn check_positions(
        &self,
        columns: [Column; 3],
        mut positions: impl Iterator<Item = DVec3> + Clone,
    ) -> Result<()> {
        let invalid = positions.clone().position(|position| !is_position(position));
        let Some(row) = invalid else { return Ok(()) };
        let position = positions.nth(row).unwrap_or_default().as_vec3().to_array();
        let problem = format!("particle {row}: position {position:?}, expected less than 1e18 m");
        Err(self.error(row, columns[0], problem))
    }

    /// Decodes `columns` to vectors, all of them finite.
    pub(super) fn vectors(&self, columns: [Column; 3], name: &str) -> Result<Vec<Vec3>> {
        Ok(bytemuck::allocation::cast_vec(self.floats(columns, name)?))
    }

    /// Decodes `columns` to 32-bit floats, record by record, all of them finite.
    pub(super) fn floats<const N: usize>(
        &self,
        columns: [Column; N],
        name: &str,
    ) -> Result<Vec<[f32; N]>> {
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
            all_finite(rows.as_flattened())
        };
        self.decode(fill, |record| self.not_finite(columns, name, record))
    }

    /// Decodes a column to integers.
    pub(super) fn integers(&self, column: Column, name: &str) -> Result<Vec<i64>> {
        self.decode(
            |bytes, rows: &mut [i64]| {
                rows.iter_mut().enumerate().fold(true, |valid, (i, row)| {
                    let record = bytes.get(i * self.stride..).unwrap_or_default();
                    let integer = column.integer(record, self.big_endian);
                    *row = integer.unwrap_or_default();
                    valid & integer.is_some()
                })
            },
            |record| {
                if column.integer(record, self.big_endian).is_some() {
                    return None;
                }
                let number = column.number(record, self.big_endian);
                Some((column, format!("{name} {number}, expected a 64-bit integer")))
            },
        )
    }

    /// The column of a record's first number that is not finite as a 32-bit float, and the problem.
    fn not_finite<const N: usize>(
        &self,
        columns: [Column; N],
        name: &str,
        record: &[u8],
    ) -> Option<(Column, String)> {
        let numbers = columns.map(|column| column.number(record, self.big_endian) as f32);
        let first = numbers.iter().position(|number| !number.is_finite())?;
        Some((columns[first], format!("{name} {numbers:?}, expected finite numbers")))
    }

    /// Decodes all rows, block by block on all cores. `fill` decodes rows from the start of some bytes
    /// and returns whether they are valid; if not, `problem` finds a record's invalid column and the
    /// problem.
    fn decode<T: Zeroable + Clone + Send>(
        &self,
        fill: impl Fn(&[u8], &mut [T]) -> bool + Sync,
        problem: impl Fn(&[u8]) -> Option<(Column, String)>,
    ) -> Result<Vec<T>> {
        let from = |row: usize| self.bytes.get(row * self.stride..).unwrap_or_default();
        let mut values: Vec<T> = memory::zeroed(self.rows, self.source.path.display())?;
        // A few rows are decoded in less time than other threads need to wake up.
        let valid = if self.rows <= BLOCK {
            fill(from(0), &mut values)
        } else {
            let blocks = values.par_chunks_mut(BLOCK).enumerate();
            blocks.map(|(i, rows)| fill(from(i * BLOCK), rows)).reduce(|| true, |a, b| a & b)
        };
        if !valid {
            for row in 0..self.rows {
                if let Some((column, problem)) = problem(from(row)) {
                    return Err(self.error(row, column, format!("particle {row}: {problem}")));
                }
            }
        }
        Ok(values)
    }
}

/// Whether all numbers are finite. Unlike `all`, it does not stop early, so that it can be vectorized.
pub(super) fn all_finite(numbers: &[f32]) -> bool {
    numbers.iter().fold(true, |finite, x| finite & x.is_finite())
}
