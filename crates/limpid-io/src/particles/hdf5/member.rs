//! The arrays of a group.

use std::collections::BTreeSet;
use std::ops::Range;

use hdf5_pure::{Dataset, Datatype, DatatypeByteOrder, FixedPointLayout, FloatingPointLayout};

use super::super::Scalar;
use super::super::axes::{Grid, Places};
use super::super::npz::POSITIONS;
use crate::error::{Result, printable};

/// An array of a group.
pub(super) struct Member {
    pub(super) name: String,
    pub(super) dataset: Dataset,
    /// Its size along each axis.
    pub(super) shape: Vec<usize>,
    /// The same with the type of its numbers; `None` for other data.
    pub(super) grid: Option<Grid>,
}

impl Member {
    /// Whether it has one number per particle.
    pub(super) fn is_column(&self) -> bool {
        self.grid.is_some() && matches!(self.shape.as_slice(), [_] | [_, 1])
    }

    /// Size of its first axis.
    pub(super) fn rows(&self) -> usize {
        self.shape.first().copied().unwrap_or(0)
    }

    /// Whether it has one number per particle, at each step if the positions are columns with steps.
    pub(super) fn is_column_beside(&self, places: &Places) -> bool {
        let stepped = places.axes.numbers.is_none() && self.shape == [places.steps, places.rows];
        self.is_column() || self.grid.is_some() && stepped
    }
}

/// An array of a group; `None` if its shape cannot be read.
pub(super) fn member(name: String, dataset: Dataset) -> Option<Member> {
    let shape = dataset.shape().ok()?;
    let shape: Vec<usize> =
        shape.into_iter().map(usize::try_from).collect::<Result<_, _>>().ok()?;
    let grid = number_of(&dataset).map(|(scalar, big_endian)| Grid {
        sizes: shape.clone(),
        columns_first: false,
        scalar,
        big_endian,
    });
    Some(Member { name, dataset, shape, grid })
}

/// Fails if some of these rows of an array have no chunk, or if a chunk is not of the array's grid or too short: the decoder
/// would put zeros there.
pub(super) fn check_chunks(member: &Member, rows: Range<usize>) -> Result<(), String> {
    let dataset = &member.dataset;
    let (Ok(Some(sizes)), false) = (dataset.chunk_shape(), rows.is_empty()) else { return Ok(()) };
    if sizes.contains(&0) {
        return Err(format!("chunks of {sizes:?}"));
    }
    // One kind of index cannot be listed.
    let Ok(chunks) = dataset.chunks() else { return Ok(()) };
    let shape: Vec<u64> = member.shape.iter().map(|&extent| extent as u64).collect();
    // Filters make chunks of any length.
    let whole = member.grid.as_ref().filter(|_| dataset.filters().is_empty()).map_or(0, |grid| {
        sizes.iter().fold(grid.scalar.size() as u64, |bytes, &size| bytes.saturating_mul(size))
    });
    let mut found = BTreeSet::new();
    for chunk in chunks {
        let mut axes = chunk.offset.iter().zip(&shape).zip(&sizes);
        let inside = |((at, extent), size): ((&u64, &u64), &u64)| at < extent && at % size == 0;
        if !axes.all(inside) {
            return Err(format!("a chunk at {:?} of an array of {shape:?}", chunk.offset));
        }
        if chunk.storage_size < whole {
            let bytes = chunk.storage_size;
            return Err(format!("a chunk of {bytes} bytes where {whole} are expected"));
        }
        found.insert(chunk.offset);
    }
    let [first, last] = [rows.start, rows.end - 1].map(|row| row as u64 / sizes[0]);
    let there = found.iter().filter(|at| (first..=last).contains(&(at[0] / sizes[0]))).count();
    let others = shape.iter().zip(&sizes).skip(1).map(|(extent, &size)| extent.div_ceil(size));
    let expected = others.fold(last - first + 1, u64::saturating_mul);
    if there as u64 != expected {
        return Err(format!("{there} of {expected} chunks were written"));
    }
    Ok(())
}

/// The problem of positions that have a usual name and shape, but numbers of a type that is not read.
pub(super) fn unusual_positions(members: &[Member]) -> Option<String> {
    let unusual = |member: &&Member| member.grid.as_ref().is_none_or(|grid| !grid.may_be_places());
    let known = |member: &&Member| {
        POSITIONS.iter().any(|known| member.name.eq_ignore_ascii_case(known))
            && matches!(member.shape.as_slice(), [_, 2 | 3] | [_, _, 2 | 3])
    };
    let member = members.iter().filter(unusual).find(known)?;
    let kind = match member.dataset.datatype() {
        Ok(Datatype::FloatingPoint { size, .. }) => {
            format!("floats of {size} bytes that are not IEEE 754's")
        }
        Ok(Datatype::FixedPoint { size, .. }) => format!("integers of {size} bytes"),
        _ => "data of another type".into(),
    };
    let name = printable(member.name.clone());
    Some(format!("{name} has {kind}; expected IEEE floats, or integers of 2 to 8 bytes"))
}

/// The arrays that are columns of one number a particle, chosen by `among` by their names.
pub(super) fn columns_among(
    members: &[Member],
    is_column: impl Fn(&Member) -> bool,
    among: impl Fn(&[&str]) -> Option<Vec<usize>>,
) -> Option<Vec<usize>> {
    let columns: Vec<_> = (0..members.len()).filter(|&at| is_column(&members[at])).collect();
    let names: Vec<_> = columns.iter().map(|&at| members[at].name.as_str()).collect();
    Some(among(&names)?.into_iter().map(|k| columns[k]).collect())
}

/// The type of a dataset's numbers, and whether they are big-endian; `None` for types that are none of IEEE 754's
/// or whole numbers of a few bytes.
fn number_of(dataset: &Dataset) -> Option<(Scalar, bool)> {
    const HALF: FloatingPointLayout = FloatingPointLayout {
        bit_offset: 0,
        bit_precision: 16,
        exponent_location: 10,
        exponent_size: 5,
        mantissa_location: 0,
        mantissa_size: 10,
        exponent_bias: 15,
    };
    let (order, scalar) = match dataset.datatype().ok()? {
        Datatype::FloatingPoint { size, byte_order, layout } => {
            let scalar = match size {
                2 if layout == HALF => Scalar::F16,
                4 if layout == FloatingPointLayout::IEEE754_BINARY32 => Scalar::F32,
                8 if layout == FloatingPointLayout::IEEE754_BINARY64 => Scalar::F64,
                _ => return None,
            };
            (byte_order, scalar)
        }
        Datatype::FixedPoint { size, byte_order, layout } => {
            let FixedPointLayout { signed, bit_offset, bit_precision } = layout;
            if bit_offset != 0 || u32::from(bit_precision) != size.saturating_mul(8) {
                return None;
            }
            let scalar = match (size, signed) {
                (1, true) => Scalar::I8,
                (1, false) => Scalar::U8,
                (2, true) => Scalar::I16,
                (2, false) => Scalar::U16,
                (4, true) => Scalar::I32,
                (4, false) => Scalar::U32,
                (8, true) => Scalar::I64,
                (8, false) => Scalar::U64,
                _ => return None,
            };
            (byte_order, scalar)
        }
        _ => return None,
    };
    match order {
        DatatypeByteOrder::LittleEndian => Some((scalar, false)),
        DatatypeByteOrder::BigEndian => Some((scalar, true)),
        DatatypeByteOrder::Vax => None,
    }
}
