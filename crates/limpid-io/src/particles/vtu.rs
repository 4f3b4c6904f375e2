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

mod element;
mod encoded;
mod write;

use std::borrow::Cow;
use std::ops::Range;
use std::path::Path;

use quick_xml::Reader;
use quick_xml::events::Event;

use self::element::{Element, text_of};
use self::encoded::{Compressor, Encoded, Packed};
use super::vtk::{at_points, is_permutation, is_point};
use super::{
    Column, Contents, FileBytes, MOST_LISTED, POSITION_BYTES, Reading, Scalar, Table, foreign,
};
use crate::budget::Budget;
use crate::error::{Error, Result};
use crate::number;
use limpid::memory;

pub(crate) use write::write;

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

/// Lists an array that is not read, together with those of the same name in other pieces.
fn ignore(ignored: &mut Vec<(String, [usize; 2])>, name: String, [rows, size]: [usize; 2]) {
    if let Some((_, shape)) = ignored.iter_mut().find(|(known, _)| *known == name) {
        shape[0] = shape[0].saturating_add(rows);
    } else if ignored.len() < MOST_LISTED {
        ignored.push((name, [rows, size]));
    }
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

/// The parsed XML.
struct Document<'a> {
    source: FileBytes<'a>,
    big_endian: bool,
    /// Size of a number in the headers of arrays: 4 or 8 bytes.
    word: usize,
    compressor: Option<Compressor>,
    /// Number of points of all pieces.
    rows: usize,
    arrays: Vec<Array>,
    /// Names and shapes of ignored point and cell data.
    ignored: Vec<(String, [usize; 2])>,
    /// Number of lines, strips and polygons.
    cells: usize,
    /// The types of cells, one array per piece.
    types: Vec<Array>,
    /// The points of cells, one array per piece, with a row for each cell.
    connectivity: Vec<Array>,
    /// Numbers of points and cells of each piece; of polygonal data the cells are its vertices.
    pieces: Vec<[usize; 2]>,
    /// Offset of the appended data, and whether it is base64.
    appended: Option<(usize, bool)>,
    /// End of the XML read so far.
    end: usize,
}

/// An array of a piece.
struct Array {
    name: String,
    /// The part of the piece that it belongs to.
    section: Section,
    scalar: Scalar,
    size: usize,
    rows: usize,
    /// Offset of its element.
    start: usize,
    data: Data,
}

/// The location of an array's numbers.
enum Data {
    Ascii(Range<usize>),
    Base64(Range<usize>),
    /// Offset from the start of the appended data.
    Appended(usize),
}

/// The part of a piece to which arrays belong.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Section {
    Points,
    PointData,
    CellData,
    Cells,
    Other,
}

impl<'a> Document<'a> {
    fn read(source: FileBytes<'a>, reading: &Reading<'_>) -> Result<Self> {
        // The XML reader counts from the end of a byte order mark.
        let bytes = source.bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(source.bytes);
        let source = FileBytes { bytes, ..source };
        let mut document = Self {
            source,
            big_endian: false,
            word: 4,
            compressor: None,
            rows: 0,
            arrays: Vec::new(),
            ignored: Vec::new(),
            cells: 0,
            types: Vec::new(),
            connectivity: Vec::new(),
            pieces: Vec::new(),
            appended: None,
            end: 0,
        };
        let mut xml = Reader::from_reader(source.bytes);
        let (mut opened, mut closed) = (false, false);
        let (mut section, mut rows, mut cells) = (Section::Other, 0, 0);
        loop {
            let start = xml.buffer_position() as usize;
            let event = xml.read_event().map_err(|error| {
                let offset = xml.error_position() as usize;
                source.error(offset, format!("not XML: {error}"))
            })?;
            document.end = start;
            let element = match &event {
                Event::Start(element) | Event::Empty(element) => element,
                Event::End(element) => {
                    match element.name().as_ref() {
                        b"Points" | b"PointData" | b"CellData" | b"Cells" | b"Verts" => {
                            section = Section::Other;
                        }
                        b"VTKFile" => closed = true,
                        _ => {}
                    }
                    continue;
                }
                Event::Eof => break,
                _ => continue,
            };
            let empty = matches!(event, Event::Empty(_));
            let at = Element { source, start, element };
            match element.name().as_ref() {
                b"VTKFile" => {
                    document.open(at)?;
                    opened = true;
                }
                _ if !opened => break,
                b"Piece" => {
                    rows = at.count("NumberOfPoints")?.unwrap_or(0);
                    document.rows = document.rows.saturating_add(rows);
                    cells = at.count("NumberOfCells")?.unwrap_or(0);
                    let vertices = at.count("NumberOfVerts")?.unwrap_or(0);
                    cells = cells.max(vertices);
                    document.pieces.push([rows, cells]);
                    for kind in ["NumberOfLines", "NumberOfStrips", "NumberOfPolys"] {
                        let count = at.count(kind)?.unwrap_or(0);
                        document.cells = document.cells.saturating_add(count);
                    }
                }
                b"Points" if !empty => section = Section::Points,
                b"PointData" if !empty => section = Section::PointData,
                b"CellData" if !empty => section = Section::CellData,
                b"Cells" | b"Verts" if !empty => section = Section::Cells,
                b"DataArray" if section != Section::Other => {
                    let name = at.attribute("Name")?.unwrap_or_default();
                    let size = at.count("NumberOfComponents")?.unwrap_or(1);
                    let used = match section {
                        Section::Points => true,
                        Section::PointData | Section::CellData => {
                            reading.wants(&name) || reading.values && size <= 4
                        }
                        Section::Cells | Section::Other => {
                            name == "types" || name == "connectivity"
                        }
                    };
                    let of_cells = matches!(section, Section::Cells | Section::CellData);
                    let rows = if of_cells { cells } else { rows };
                    let read = used.then(|| at.array(name.clone(), section, size, rows));
                    let array = match read {
                        // The particles do not depend on it.
                        Some(Err(_)) if section != Section::Points && !reading.wants(&name) => None,
                        read => read.transpose()?.flatten(),
                    };
                    let text = if empty { start..start } else { text_of(&mut xml, source)? };
                    match (array, section) {
                        (Some(array), Section::Cells) if array.name == "types" => {
                            document.types.push(array.with_text(text));
                        }
                        (Some(array), Section::Cells) => {
                            document.connectivity.push(array.with_text(text));
                        }
                        (Some(array), _) => document.arrays.push(array.with_text(text)),
                        (None, Section::PointData | Section::CellData) => {
                            ignore(&mut document.ignored, name, [rows, size]);
                        }
                        _ => {}
                    }
                }
                b"AppendedData" => {
                    let base64 = match at.attribute("encoding")?.as_deref() {
                        Some("raw") => false,
                        None | Some("base64") => true,
                        Some(other) => {
                            return Err(
                                at.error(&format!("encoding `{other}`: expected raw or base64"))
                            );
                        }
                    };
                    let from = xml.buffer_position() as usize;
                    let rest = source.bytes.get(from..).unwrap_or_default();
                    let mark = rest.iter().position(|byte| !byte.is_ascii_whitespace());
                    match mark.filter(|&at| rest[at] == b'_') {
                        Some(mark) => document.appended = Some((from + mark + 1, base64)),
                        None => return Err(source.error(from, "expected `_` before appended data")),
                    }
                    break;
                }
                _ => {}
            }
        }
        closed |=
            document.appended.is_some() && source.bytes.trim_ascii_end().ends_with(b"</VTKFile>");
        if opened && closed {
            return Ok(document);
        }
        if opened {
            return Err(
                source.error(source.bytes.len(), "the file ends before </VTKFile>: cut off")
            );
        }
        if source.bytes.starts_with(b"<?xml") {
            let problem = "this is XML, but not VTK's: it has no <VTKFile>";
            return Err(Error::format(source.path, problem));
        }
        Err(foreign(source.path, source.bytes, "VTK's XML format"))
    }

    /// Reads the attributes of the element `VTKFile`.
    fn open(&mut self, at: Element<'_, '_>) -> Result<()> {
        let format = |problem: String| Error::format(self.source.path, problem);
        let kind = at.attribute("type")?.unwrap_or_default();
        if !matches!(&*kind, "UnstructuredGrid" | "PolyData") {
            return Err(format(format!("dataset `{kind}`: expected UnstructuredGrid or PolyData")));
        }
        self.big_endian = match at.attribute("byte_order")?.as_deref() {
            None | Some("LittleEndian") => false,
            Some("BigEndian") => true,
            Some(other) => return Err(at.error(&format!("byte order `{other}`"))),
        };
        self.word = match at.attribute("header_type")?.as_deref() {
            None | Some("UInt32") => 4,
            Some("UInt64") => 8,
            Some(other) => return Err(at.error(&format!("header type `{other}`"))),
        };
        self.compressor = match at.attribute("compressor")?.as_deref() {
            None | Some("") => None,
            Some("vtkZLibDataCompressor") => Some(Compressor::Zlib),
            Some("vtkLZ4DataCompressor") => Some(Compressor::Lz4),
            Some("vtkLZMADataCompressor") => Some(Compressor::Lzma),
            Some(other) => {
                let problem = format!(
                    "compressor {other}: expected zlib, LZ4, LZMA or none; save it again with one of these"
                );
                return Err(format(problem));
            }
        };
        Ok(())
    }

    /// The point of each cell, if there is one vertex cell for each point; `None` for other cells. What cannot be decoded
    /// is none, since the particles do not depend on it.
    fn points_of_cells(&self, budget: &Budget) -> Option<Vec<usize>> {
        let has_data = self.arrays.iter().any(|array| array.section == Section::CellData);
        let one_each = self.pieces.iter().all(|[points, cells]| points == cells);
        let known = self.connectivity.len() == self.pieces.len();
        if !has_data || !one_each || !known || self.cells > 0 || self.cells_by_type(budget) > 0 {
            return None;
        }
        // Pieces may share their bytes, which are counted for this alone.
        let budget = Budget::new(Some(budget.left()));
        let (mut order, mut first) = (Vec::new(), 0);
        for (array, [points, _]) in self.connectivity.iter().zip(&self.pieces) {
            let (scalar, bytes) = self.decode(array, &budget).ok()?;
            let column = Column { offset: 0, scalar };
            memory::grow(&mut order, *points, self.source.path.display()).ok()?;
            for bytes in bytes.chunks_exact(scalar.size()) {
                let point = usize::try_from(column.integer(bytes, self.big_endian)?).ok()?;
                order.push(first + Some(point).filter(|point| point < points)?);
            }
            first += points;
        }
        is_permutation(&order, self.rows).then_some(order)
    }

    /// Counts the cells with several points by their types. Types that cannot be decoded are ignored,
    /// since the particles do not depend on them.
    fn cells_by_type(&self, budget: &Budget) -> usize {
        // Pieces may share their bytes, which are counted for this alone.
        let budget = Budget::new(Some(budget.left()));
        let others = self.types.iter().map(|array| {
            let Ok((scalar, bytes)) = self.decode(array, &budget) else { return 0 };
            let column = Column { offset: 0, scalar };
            let records = bytes.chunks_exact(scalar.size());
            let points = records.filter(|x| is_point(column.integer(x, self.big_endian)));
            array.rows.saturating_sub(points.count())
        });
        others.fold(0, usize::saturating_add)
    }

    /// Decodes an array to numbers in the file's byte order, which are taken of the budget, and their type.
    fn decode(&self, array: &Array, budget: &Budget) -> Result<(Scalar, Cow<'a, [u8]>)> {
        let error = |problem: String| {
            self.source.error(array.start, format!("array {}: {problem}", array.name))
        };
        let row = array.size * array.scalar.size();
        let length = array.rows.checked_mul(row).ok_or_else(|| error("too long".into()))?;
        let slice = |range: &Range<usize>| self.source.bytes.get(range.clone()).unwrap_or_default();
        let encoded = match &array.data {
            Data::Ascii(range) => {
                let (scalar, data) = self.ascii(array, slice(range))?;
                self.source.take(budget, data.len() as u64, array.start)?;
                return Ok((scalar, data.into()));
            }
            Data::Base64(range) => Encoded { base64: true, bytes: slice(range).trim_ascii() },
            &Data::Appended(offset) => {
                let missing = || error("no appended data".into());
                let (start, base64) = self.appended.ok_or_else(missing)?;
                let from = start.saturating_add(offset);
                let bytes = self.source.bytes.get(from..);
                let beyond = || error(format!("its data begins at byte {from}, beyond the file"));
                Encoded { base64, bytes: bytes.ok_or_else(beyond)? }
            }
        };
        if length == 0 {
            return Ok((array.scalar, Cow::Borrowed(&[])));
        }
        // The memory of the decoded base64.
        memory::probe(length.min(encoded.bytes.len()), self.source.path.display())?;
        let data = if let Some(compressor) = self.compressor {
            let packed = self.packed(compressor, encoded, length).map_err(error)?;
            self.source.take(budget, length as u64, array.start)?;
            let mut unpacked = memory::zeroed(length, self.source.path.display())?;
            packed.inflate(&mut unpacked).map_err(error)?;
            Cow::Owned(unpacked)
        } else {
            let data = self.uncompressed(encoded, length).map_err(error)?;
            self.source.take(budget, length as u64, array.start)?;
            data
        };
        Ok((array.scalar, data))
    }

    fn ascii(&self, array: &Array, text: &[u8]) -> Result<(Scalar, Vec<u8>)> {
        let error = |problem: String| {
            self.source.error(array.start, format!("array {}: {problem}", array.name))
        };
        let float = matches!(array.scalar, Scalar::F32 | Scalar::F64);
        let scalar = if float { Scalar::F64 } else { Scalar::I64 };
        let mut data = Vec::new();
        let mut count = 0;
        for word in text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()) {
            let word = String::from_utf8_lossy(word);
            let bytes = if float {
                number::float(word.as_bytes()).map(f64::to_bits)
            } else {
                word.parse().ok().map(i64::cast_unsigned)
            };
            let problem = || error(format!("expected a number, found `{word:.40}`"));
            let bytes = bytes.ok_or_else(problem)?;
            memory::grow(&mut data, size_of::<u64>(), self.source.path.display())?;
            data.extend(if self.big_endian { bytes.to_be_bytes() } else { bytes.to_le_bytes() });
            count += 1;
        }
        match array.rows.checked_mul(array.size) {
            Some(expected) if expected == count => Ok((scalar, data)),
            _ => {
                let (rows, size) = (array.rows, array.size);
                Err(error(format!("expected {rows} × {size} numbers, found {count}")))
            }
        }
    }

    /// Decodes the words of a header.
    fn words(&self, bytes: &[u8]) -> Vec<u64> {
        let word = |bytes: &[u8]| {
            let digits = bytes.iter().map(|&byte| u64::from(byte));
            let number = |number: u64, digit: u64| number << 8 | digit;
            if self.big_endian { digits.fold(0, number) } else { digits.rev().fold(0, number) }
        };
        bytes.chunks_exact(self.word).map(word).collect()
    }

    /// The `length` bytes of an uncompressed array.
    fn uncompressed(&self, encoded: Encoded<'a>, length: usize) -> Result<Cow<'a, [u8]>, String> {
        let (head, separate) = encoded.take(self.word)?;
        let found = self.words(&head).first().copied().unwrap_or_default();
        if found != length as u64 {
            return Err(format!("expected {length} bytes, {found} announced"));
        }
        if separate {
            return encoded.after(self.word).take(length).map(|(data, _)| data);
        }
        let (mut data, _) = encoded.take(self.word.checked_add(length).ok_or("too long")?)?;
        match &mut data {
            Cow::Borrowed(data) => *data = &data[self.word..],
            Cow::Owned(data) => drop(data.drain(..self.word)),
        }
        Ok(data)
    }

    /// The compressed blocks of `length` bytes.
    fn packed(
        &self,
        compressor: Compressor,
        encoded: Encoded<'a>,
        length: usize,
    ) -> Result<Packed<'a>, String> {
        let (head, _) = encoded.take(3 * self.word)?;
        let &[blocks, size, last] = self.words(&head).as_slice() else {
            return Err("the header of its blocks is cut off".into());
        };
        let full = if last == 0 { blocks } else { blocks.saturating_sub(1) };
        let unpacked = full.checked_mul(size).and_then(|bytes| bytes.checked_add(last));
        if unpacked != Some(length as u64) || size == 0 || last > size {
            return Err(format!(
                "expected {length} bytes, {blocks} blocks of {size} and a last of {last} announced"
            ));
        }
        let blocks = usize::try_from(blocks).map_err(|_| "too many blocks".to_owned())?;
        let header = blocks.saturating_add(3).saturating_mul(self.word);
        let (head, _) = encoded.take(header)?;
        let sizes = self.words(&head).split_off(3);
        let total = sizes.iter().fold(0_u64, |total, &size| total.saturating_add(size));
        if length as u64 > total.saturating_mul(compressor.ratio()) {
            return Err(format!("{length} bytes cannot be in {total} compressed ones"));
        }
        let data = encoded.after(header);
        let (data, _) = data.take(usize::try_from(total).unwrap_or(usize::MAX))?;
        let block = usize::try_from(size).map_err(|_| "the blocks are too large".to_owned())?;
        Ok(Packed { data, sizes, block, compressor })
    }
}

impl Array {
    /// Memory of the positions or the attribute read from it, bytes.
    fn read_bytes(&self, reading: &Reading<'_>) -> u64 {
        let of_points = self.section == Section::Points;
        let bytes = if of_points { POSITION_BYTES } else { reading.bytes_of(&self.name) };
        bytes.saturating_mul(self.rows as u64)
    }

    fn with_text(mut self, text: Range<usize>) -> Self {
        match &mut self.data {
            Data::Ascii(range) | Data::Base64(range) => *range = text,
            Data::Appended(_) => {}
        }
        self
    }
}
