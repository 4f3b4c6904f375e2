//! Meaning of an array's axes: of positions, and of the attributes beside them.
//!
//! | shape of positions | meaning |
//! |---|---|
//! | (n, 3), (n, k) | a particle a row; further columns are none of the position |
//! | (3, n) with n above 3 | a row for each coordinate, as MATLAB, Julia and Fortran write |
//! | (k, n) with k up to 16 and n above 64 | the same, with rows of other quantities after the first three |
//! | (n, 2), (2, n) | the same in two dimensions: x and y |
//! | (T, n, 3), (T, 3, n), (3, T, n) | T time steps; where coordinates come first, the steps are the axis whose numbers lie farther apart |
//!
//! So (3, 3) is rows, and (3, 4) is four particles.

use std::borrow::Cow;
use std::ops::Range;

use super::Attribute;
use super::cursor::FileBytes;
use super::remark::Remark;
use super::table::{Column, Scalar, Table};

/// Largest number of columns beside and including the positions.
const MOST_COLUMNS: usize = 4096;

/// Largest number of rows that may each be a coordinate or another quantity of all particles, and the number of
/// columns beyond which they are.
const MOST_ROWS: usize = 16;
const MANY: usize = 64;

/// The axes of an array, by their indices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Axes {
    /// The time steps, if there are several arrays in one.
    pub(super) steps: Option<usize>,
    pub(super) particles: usize,
    /// The numbers of a particle, if they are an axis.
    pub(super) numbers: Option<usize>,
}

impl Axes {
    const ROWS: Self = Self { steps: None, particles: 0, numbers: Some(1) };

    /// Whether a particle's numbers are a row, as nearly all programs write.
    pub(super) fn are_rows(self) -> bool {
        self.numbers.is_none_or(|numbers| numbers > self.particles)
    }
}

/// An array of plain numbers: its size along each axis, and how its numbers lie in memory.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    pub(super) sizes: Vec<usize>,
    /// The first axis is the one whose numbers are adjacent, as in Fortran; otherwise the last.
    pub(super) columns_first: bool,
    pub(super) scalar: Scalar,
    pub(super) big_endian: bool,
}

impl Grid {
    /// Whether the numbers may be coordinates: bytes are colours or masks.
    pub(super) fn may_be_places(&self) -> bool {
        !matches!(self.scalar, Scalar::I8 | Scalar::U8)
    }

    /// Whether it has one number for each particle of one step.
    pub(super) fn is_column(&self) -> bool {
        matches!(self.sizes.as_slice(), [_] | [_, 1])
    }

    pub(super) fn is_float(&self) -> bool {
        matches!(self.scalar, Scalar::F16 | Scalar::F32 | Scalar::F64)
    }

    /// The axes if the array holds positions; `None` for other shapes.
    pub(super) fn positions(&self) -> Option<Axes> {
        let stacked = |steps, particles, numbers| Axes {
            steps: Some(steps),
            particles,
            numbers: Some(numbers),
        };
        let turned = Axes { steps: None, particles: 1, numbers: Some(0) };
        Some(match *self.sizes.as_slice() {
            [_, 3] => Axes::ROWS,
            [3, n] if n > 3 => turned,
            [_, 2] => Axes::ROWS,
            [2, n] if n > 3 => turned,
            [rows, n] if (4..=MOST_ROWS).contains(&rows) && n > MANY => turned,
            [_, columns] if (3..=MOST_COLUMNS).contains(&columns) => Axes::ROWS,
            [_, _, 3] => stacked(0, 1, 2),
            [_, 3, n] if n > 3 => stacked(0, 2, 1),
            [3, n, _] if self.columns_first && n > 3 => stacked(2, 1, 0),
            [3, _, n] if !self.columns_first && n > 3 => stacked(1, 2, 0),
            [_, _, 2] => stacked(0, 1, 2),
            [_, 2, n] if n > 3 => stacked(0, 2, 1),
            [2, n, _] if self.columns_first && n > 3 => stacked(2, 1, 0),
            [2, _, n] if !self.columns_first && n > 3 => stacked(1, 2, 0),
            _ => return None,
        })
    }

    /// The axes if the array holds an attribute of the particles at these positions; `None` for other shapes. A
    /// number of rows that is wrong remains to be found.
    pub(super) fn attribute(&self, attribute: Attribute, positions: &Places) -> Option<Axes> {
        let of_two = || match attribute {
            Attribute::Velocity => self.axes_of(2, positions),
            _ => None,
        };
        let planar = (positions.width == 2).then(of_two).flatten();
        planar.or_else(|| self.axes_of(attribute.width(), positions)).or_else(of_two)
    }

    /// As [`Grid::attribute`], for an array of one to four numbers a particle that is shown or described.
    pub(super) fn shown(&self, positions: &Places) -> Option<Axes> {
        let fits = |axes: &Axes| self.sizes.get(axes.particles) == Some(&positions.rows);
        [1, 3, 2, 4].iter().find_map(|&width| self.axes_of(width, positions).filter(fits))
    }

    /// As [`Grid::attribute`], for `width` numbers a particle.
    pub(super) fn axes_of(&self, width: usize, positions: &Places) -> Option<Axes> {
        let (steps, rows, own) = (positions.steps, positions.rows, positions.axes);
        let only = |particles, numbers| Axes { steps: None, particles, numbers };
        match *self.sizes.as_slice() {
            [_] if width == 1 => Some(only(0, None)),
            [a, b] => {
                if width == 1 && own.steps.is_some() {
                    let first = Axes { steps: Some(0), particles: 1, numbers: None };
                    let last = Axes { steps: Some(1), particles: 0, numbers: None };
                    let as_ours = own.steps < Some(own.particles);
                    for (axes, fits) in
                        [(first, [a, b] == [steps, rows]), (last, [b, a] == [steps, rows])]
                    {
                        if fits && (steps != rows || as_ours == (axes == first)) {
                            return Some(axes);
                        }
                    }
                }
                let (as_rows, as_columns) = (b == width, a == width);
                let turned = only(1, Some(0));
                match (as_rows, as_columns) {
                    (true, true) if !own.are_rows() => Some(turned),
                    (_, true) if b == rows && (!as_rows || a != rows) => Some(turned),
                    (true, _) => Some(Axes::ROWS),
                    (false, true) => Some(turned),
                    (false, false) => None,
                }
            }
            [_, _, _] => {
                let fits = |axes: &Axes| {
                    let size =
                        |axis: Option<usize>| axis.and_then(|at| self.sizes.get(at)).copied();
                    size(axes.steps) == Some(steps)
                        && size(Some(axes.particles)) == Some(rows)
                        && size(axes.numbers) == Some(width)
                };
                let plain = Axes { steps: Some(0), particles: 1, numbers: Some(2) };
                [own, plain].into_iter().find(fits)
            }
            _ => None,
        }
    }

    /// Distances of the numbers along each axis, in numbers; `None` for an array beyond all memory.
    fn strides(&self) -> Option<Vec<usize>> {
        let mut strides = vec![0; self.sizes.len()];
        let mut stride = 1_usize;
        for k in 0..self.sizes.len() {
            let axis = if self.columns_first { k } else { self.sizes.len() - 1 - k };
            strides[axis] = stride;
            stride = stride.checked_mul(self.sizes[axis])?;
        }
        Some(strides)
    }

    /// Size of its first axis.
    pub(super) fn rows(&self) -> usize {
        self.sizes.first().copied().unwrap_or(1)
    }

    /// Size of all numbers at one place of the first axis, bytes.
    pub(super) fn row_bytes(&self) -> usize {
        let sizes = self.sizes.get(1..).unwrap_or_default();
        sizes.iter().fold(self.scalar.size(), |size, &extent| size.saturating_mul(extent))
    }

    /// Size of the array, bytes; `None` beyond all memory.
    pub(super) fn bytes(&self) -> Option<usize> {
        self.sizes.iter().try_fold(self.scalar.size(), |size, &extent| size.checked_mul(extent))
    }

    /// Number of steps along its axis, 1 without one.
    pub(super) fn steps(&self, axes: Axes) -> usize {
        axes.steps.map_or(1, |axis| self.sizes[axis])
    }

    /// The bytes of the array that a step needs: its own, where these are adjacent, or all.
    pub(super) fn part(&self, axes: Axes, step: usize) -> Option<Range<usize>> {
        let all = self.bytes()?;
        match axes.steps {
            Some(axis) if self.adjacent(axis) => {
                let one = all.checked_div(self.sizes[axis]).unwrap_or(0);
                Some(one.checked_mul(step)?..one.checked_mul(step.checked_add(1)?)?)
            }
            _ => Some(0..all),
        }
    }

    /// Whether the numbers at one place of an axis are adjacent in memory: it is the slowest one.
    fn adjacent(&self, axis: usize) -> bool {
        axis == if self.columns_first { self.sizes.len() - 1 } else { 0 }
    }

    /// The table of a step, with a row for each particle, and its columns. `bytes` are those of its
    /// [`Grid::part`], which begin at `start` of the file.
    pub(super) fn table<'a>(
        &self,
        axes: Axes,
        step: usize,
        source: FileBytes<'a>,
        start: usize,
        bytes: Cow<'a, [u8]>,
    ) -> Option<(Table<'a>, Vec<Column>)> {
        let size = self.scalar.size();
        let strides = self.strides()?;
        let skipped = match axes.steps {
            Some(axis) if !self.adjacent(axis) => step.checked_mul(strides[axis] * size)?,
            _ => 0,
        };
        let width = axes.numbers.map_or(1, |axis| self.sizes[axis]);
        let apart = axes.numbers.map_or(0, |axis| strides[axis] * size);
        let bytes = match bytes {
            Cow::Borrowed(bytes) => Cow::Borrowed(bytes.get(skipped..).unwrap_or_default()),
            Cow::Owned(mut bytes) => {
                bytes.drain(..skipped.min(bytes.len()));
                Cow::Owned(bytes)
            }
        };
        let table = Table {
            source,
            start: start + skipped,
            bytes,
            rows: self.sizes[axes.particles],
            stride: strides[axes.particles] * size,
            big_endian: self.big_endian,
            starts: None,
        };
        let column = |k: usize| Column { offset: k * apart, scalar: self.scalar };
        Some((table, (0..width).map(column).collect()))
    }
}

/// How positions lie in their array, which the attributes beside it follow.
#[derive(Clone, Copy, Debug)]
pub(super) struct Places {
    pub(super) axes: Axes,
    pub(super) steps: usize,
    pub(super) rows: usize,
    /// Number of coordinates in the array: 2 are x and y.
    pub(super) width: usize,
}

impl Places {
    /// The positions of columns, one for each coordinate, of shape (n) or (T, n).
    pub(super) fn of_columns(shape: &[usize]) -> Self {
        match *shape {
            [steps, rows] if rows > 1 => {
                let axes = Axes { steps: Some(0), particles: 1, numbers: None };
                Self { axes, steps, rows, width: 3 }
            }
            _ => {
                let rows = shape.first().copied().unwrap_or(0);
                Self { axes: Axes::ROWS, steps: 1, rows, width: 3 }
            }
        }
    }

    /// Those of an array whose shape is that of positions.
    pub(super) fn of(grid: &Grid) -> Option<Self> {
        let axes = grid.positions()?;
        let width = axes.numbers.map_or(1, |axis| grid.sizes[axis]);
        Some(Self { axes, steps: grid.steps(axes), rows: grid.sizes[axes.particles], width })
    }

    /// The columns of x, y and z.
    pub(super) fn coordinates(&self, columns: &[Column]) -> Option<[Column; 3]> {
        match *columns {
            [x, y, z, ..] => Some([x, y, z]),
            [x, y] => Some([x, y, Column::ZERO]),
            _ => None,
        }
    }

    /// The columns of a vector beside positions of two dimensions, which has two numbers as well.
    pub(super) fn vector(&self, mut columns: Vec<Column>) -> Vec<Column> {
        if self.width == 2 && columns.len() == 2 {
            columns.push(Column::ZERO);
        }
        columns
    }

    /// Returns remarks on the array's shape for the user.
    pub(super) fn remarks(&self, array: &str, grid: &Grid) -> Vec<Remark> {
        let (array, shape) = (array.to_owned(), grid.sizes.clone());
        let transposed = (!self.axes.are_rows()).then(|| Remark::Transposed {
            array: array.clone(),
            shape,
            particles: self.rows,
        });
        let planar = (self.width == 2).then_some(Remark::Planar { array });
        transposed.into_iter().chain(planar).collect()
    }
}
