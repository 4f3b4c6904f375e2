//! An array of a piece: what it holds, and where its numbers are.

use std::ops::Range;

use super::super::{POSITION_BYTES, Reading, Scalar};

/// An array of a piece.
pub(super) struct Array {
    pub(super) name: String,
    /// The part of the piece that it belongs to.
    pub(super) section: Section,
    pub(super) scalar: Scalar,
    pub(super) size: usize,
    pub(super) rows: usize,
    /// Offset of its element.
    pub(super) start: usize,
    pub(super) data: Data,
}

/// The location of an array's numbers.
pub(super) enum Data {
    Ascii(Range<usize>),
    Base64(Range<usize>),
    /// Offset from the start of the appended data.
    Appended(usize),
}

/// The part of a piece to which arrays belong.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Section {
    Points,
    PointData,
    CellData,
    Cells,
    Other,
}

impl Array {
    /// Memory of the positions or the attribute read from it, bytes.
    pub(super) fn read_bytes(&self, reading: &Reading<'_>) -> u64 {
        let of_points = self.section == Section::Points;
        let bytes = if of_points { POSITION_BYTES } else { reading.bytes_of(&self.name) };
        bytes.saturating_mul(self.rows as u64)
    }

    pub(super) fn with_text(mut self, text: Range<usize>) -> Self {
        match &mut self.data {
            Data::Ascii(range) | Data::Base64(range) => *range = text,
            Data::Appended(_) => {}
        }
        self
    }
}
