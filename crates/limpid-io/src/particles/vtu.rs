//! VTK's XML formats (Kitware, "VTK File Formats", section "XML File Formats"): the points and point
//! data of unstructured grids (`.vtu`) and polygonal data (`.vtp`), in one piece or several. Arrays are
//! ASCII, inline base64, or appended as base64 or raw data, optionally in blocks compressed by zlib, LZ4
//! or LZMA.
//!
//! ```text
//! uncompressed   length, bytes
//! compressed     blocks, bytes of a block, of the last or 0, compressed bytes of each; blocks
//! ```
//!
//! These headers have the type `header_type` and the `byte_order`. In base64, VTK encodes a length
//! together with its bytes, other programs separately; the header of compressed blocks is always
//! separate.
//!
//! Raw appended data is not XML, so the document is read as a stream up to it.

mod array;
mod document;
mod element;
mod encoded;
mod write;

use std::borrow::Cow;
use std::path::Path;

use self::array::Section;
use self::document::{Document, ignore};
use super::vtk::at_points;
use super::{Column, Contents, FileBytes, Reading, Scalar, Table};
use crate::error::Result;
use limpid::memory;

pub(super) use write::write;

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    let source = FileBytes { path, bytes, text: false };
    let budget = reading.budget;
    let document = Document::read(source, reading)?;
    let points_of_cells = document.points_of_cells(budget);
    let mut ignored = document.ignored.clone();
    let has_cells = points_of_cells.is_some();
    let mut merged = merge(&document, source, reading, has_cells, &mut ignored)?;
    let mut contents: Option<Contents> = None;
    // Points may follow their attributes, and attributes of points go before those of cells.
    merged.sort_by_key(|array| array.section);
    for array in merged {
        let (rows, size, scalar) = (array.rows, array.size, array.scalar);
        let bytes = match &points_of_cells {
            Some(points) if array.section == Section::CellData => {
                memory::probe(array.data.len(), path.display())?;
                at_points(&array.data, size * scalar.size(), points).into()
            }
            _ => array.data,
        };
        let table = Table {
            source,
            start: array.start,
            bytes,
            rows,
            stride: size * scalar.size(),
            big_endian: document.big_endian,
            // In most encodings rows have no offset of their own.
            starts: Some(Vec::new()),
        };
        let columns = Column::adjacent(0, size, scalar);
        match (&mut contents, columns.as_slice()) {
            (None, &[x, y, z]) if array.section == Section::Points => {
                contents = Some(table.particles([x, y, z])?);
            }
            (Some(contents), _) => contents.take(reading, array.name, &table, &columns)?,
            _ => {}
        }
    }
    match contents {
        Some(mut contents) if contents.particles.len() == document.rows => {
            for (name, [rows, size]) in &ignored {
                let shape = [*rows, *size];
                contents.list(name, if *size == 1 { &shape[..1] } else { &shape }, None);
            }
            contents.cells = document.cells.saturating_add(document.cells_by_type(budget));
            Ok(contents)
        }
        None if document.rows == 0 => Ok(Contents::default()),
        _ => {
            let problem = format!("{} points, but not all have a place", document.rows);
            Err(source.error(document.end, problem))
        }
    }
}

/// The arrays of all pieces, each as one. Cell arrays are `ignored` where cells are not points, and so are unreadable
/// arrays that nothing needs.
fn merge<'a>(
    document: &'a Document<'a>,
    source: FileBytes<'_>,
    reading: &Reading<'_>,
    has_cells: bool,
    ignored: &mut Vec<(String, [usize; 2])>,
) -> Result<Vec<Merged<'a>>> {
    let budget = reading.budget;
    let mut merged: Vec<Merged<'a>> = Vec::new();
    for array in &document.arrays {
        if array.section == Section::CellData && !has_cells {
            ignore(ignored, array.name.clone(), [array.rows, array.size]);
            continue;
        }
        // Arrays may share their bytes, so nothing in the file bounds the sum.
        let (scalar, data) = match document.decode(array, budget) {
            // Only its values would have been listed.
            Err(_) if array.section != Section::Points && !reading.wants(&array.name) => {
                ignore(ignored, array.name.clone(), [array.rows, array.size]);
                continue;
            }
            decoded => decoded?,
        };
        source.take(budget, array.read_bytes(reading), array.start)?;
        // A piece has one array of points, which may have any name.
        let same = |m: &&mut Merged<'_>| {
            m.section == array.section && (m.section == Section::Points || m.name == array.name)
        };
        match merged.iter_mut().find(same) {
            None => merged.push(Merged {
                name: &array.name,
                section: array.section,
                scalar,
                size: array.size,
                rows: array.rows,
                start: array.start,
                data,
            }),
            Some(first) if first.scalar == scalar && first.size == array.size => {
                first.rows += array.rows;
                memory::probe(first.data.len() + data.len(), source.path.display())?;
                first.data.to_mut().extend_from_slice(&data);
            }
            Some(_) => {
                let problem = format!("array {} has another type in another piece", array.name);
                return Err(source.error(array.start, problem));
            }
        }
    }
    Ok(merged)
}

/// An array, merged from all pieces.
struct Merged<'a> {
    name: &'a str,
    section: Section,
    scalar: Scalar,
    size: usize,
    rows: usize,
    start: usize,
    data: Cow<'a, [u8]>,
}
