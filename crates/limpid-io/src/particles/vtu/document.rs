//! The XML of VTK's formats: where the arrays of each piece are.

use std::borrow::Cow;
use std::ops::Range;

use quick_xml::Reader;
use quick_xml::events::Event;

use super::super::vtk::{is_permutation, is_point};
use super::super::{Column, FileBytes, MOST_LISTED, Reading, Scalar, foreign};
use super::array::{Array, Data, Section};
use super::element::{Element, text_of};
use super::encoded::{Compressor, Encoded, Packed};
use crate::budget::Budget;
use crate::error::{Error, Result};
use crate::number;
use limpid::memory;

/// Lists an array that is not read, together with those of the same name in other pieces.
pub(super) fn ignore(
    ignored: &mut Vec<(String, [usize; 2])>,
    name: String,
    [rows, size]: [usize; 2],
) {
    if let Some((_, shape)) = ignored.iter_mut().find(|(known, _)| *known == name) {
        shape[0] = shape[0].saturating_add(rows);
    } else if ignored.len() < MOST_LISTED {
        ignored.push((name, [rows, size]));
    }
}

/// The parsed XML.
pub(super) struct Document<'a> {
    pub(super) source: FileBytes<'a>,
    pub(super) big_endian: bool,
    /// Size of a number in the headers of arrays: 4 or 8 bytes.
    pub(super) word: usize,
    pub(super) compressor: Option<Compressor>,
    /// Number of points of all pieces.
    pub(super) rows: usize,
    pub(super) arrays: Vec<Array>,
    /// Names and shapes of ignored point and cell data.
    pub(super) ignored: Vec<(String, [usize; 2])>,
    /// Number of lines, strips and polygons.
    pub(super) cells: usize,
    /// The types of cells, one array per piece.
    pub(super) types: Vec<Array>,
    /// The points of cells, one array per piece, with a row for each cell.
    pub(super) connectivity: Vec<Array>,
    /// Numbers of points and cells of each piece; of polygonal data the cells are its vertices.
    pub(super) pieces: Vec<[usize; 2]>,
    /// Offset of the appended data, and whether it is base64.
    pub(super) appended: Option<(usize, bool)>,
    /// End of the XML read so far.
    pub(super) end: usize,
}

/// An element `DataArray`.
pub(super) struct Declared {
    /// The array, if it is read.
    pub(super) array: Option<Array>,
    pub(super) section: Section,
    pub(super) name: String,
    /// Rows and columns.
    pub(super) shape: [usize; 2],
}

impl Declared {
    /// Reads the attributes of an array of `rows`.
    pub(super) fn read(
        at: Element<'_, '_>,
        section: Section,
        rows: usize,
        reading: &Reading<'_>,
    ) -> Result<Self> {
        let name = at.attribute("Name")?.unwrap_or_default();
        let size = at.count("NumberOfComponents")?.unwrap_or(1);
        let is_data = matches!(section, Section::PointData | Section::CellData);
        let used = match section {
            Section::Points => true,
            Section::PointData | Section::CellData => {
                reading.wants(&name) || reading.values && size <= 4
            }
            Section::Cells | Section::Other => name == "types" || name == "connectivity",
        };
        let needless = name == "connectivity" || is_data && !reading.wants(&name);
        let array = match used.then(|| at.array(name.clone(), section, size, rows)) {
            // The particles do not depend on it.
            Some(Err(_)) if needless => None,
            read => read.transpose()?.flatten(),
        };
        Ok(Self { array, section, name, shape: [rows, size] })
    }
}

impl<'a> Document<'a> {
    pub(super) fn read(source: FileBytes<'a>, reading: &Reading<'_>) -> Result<Self> {
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
                b"Piece" => [rows, cells] = document.piece(at)?,
                b"Points" if !empty => section = Section::Points,
                b"PointData" if !empty => section = Section::PointData,
                b"CellData" if !empty => section = Section::CellData,
                b"Cells" | b"Verts" if !empty => section = Section::Cells,
                b"DataArray" if section != Section::Other => {
                    let of_cells = matches!(section, Section::Cells | Section::CellData);
                    let rows = if of_cells { cells } else { rows };
                    let array = Declared::read(at, section, rows, reading)?;
                    let text = if empty { start..start } else { text_of(&mut xml, source)? };
                    document.add(array, text);
                }
                b"AppendedData" => {
                    document.append(at, xml.buffer_position() as usize)?;
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

    /// Reads the element `Piece`: numbers of its points and cells.
    pub(super) fn piece(&mut self, at: Element<'_, '_>) -> Result<[usize; 2]> {
        let rows = at.count("NumberOfPoints")?.unwrap_or(0);
        self.rows = self.rows.saturating_add(rows);
        let cells = at.count("NumberOfCells")?.unwrap_or(0);
        let vertices = at.count("NumberOfVerts")?.unwrap_or(0);
        let cells = cells.max(vertices);
        self.pieces.push([rows, cells]);
        for kind in ["NumberOfLines", "NumberOfStrips", "NumberOfPolys"] {
            let count = at.count(kind)?.unwrap_or(0);
            self.cells = self.cells.saturating_add(count);
        }
        Ok([rows, cells])
    }

    /// Adds an array with its `text`, or lists it as ignored.
    pub(super) fn add(
        &mut self,
        Declared { array, section, name, shape }: Declared,
        text: Range<usize>,
    ) {
        match (array, section) {
            (Some(array), Section::Cells) if array.name == "types" => {
                self.types.push(array.with_text(text));
            }
            (Some(array), Section::Cells) => self.connectivity.push(array.with_text(text)),
            (Some(array), _) => self.arrays.push(array.with_text(text)),
            (None, Section::PointData | Section::CellData) => {
                ignore(&mut self.ignored, name, shape);
            }
            _ => {}
        }
    }

    /// Reads the element `AppendedData`, whose contents begin at `from`.
    pub(super) fn append(&mut self, at: Element<'_, '_>, from: usize) -> Result<()> {
        let base64 = match at.attribute("encoding")?.as_deref() {
            Some("raw") => false,
            None | Some("base64") => true,
            Some(other) => {
                return Err(at.error(&format!("encoding `{other}`: expected raw or base64")));
            }
        };
        let rest = self.source.bytes.get(from..).unwrap_or_default();
        let mark = rest.iter().position(|byte| !byte.is_ascii_whitespace());
        match mark.filter(|&at| rest[at] == b'_') {
            Some(mark) => self.appended = Some((from + mark + 1, base64)),
            None => return Err(self.source.error(from, "expected `_` before appended data")),
        }
        Ok(())
    }

    /// Reads the attributes of the element `VTKFile`.
    pub(super) fn open(&mut self, at: Element<'_, '_>) -> Result<()> {
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

    /// The point of each cell, if there is one vertex cell for each point; `None` for other cells, and for arrays that
    /// cannot be decoded, since the particles do not depend on them.
    pub(super) fn points_of_cells(&self, budget: &Budget) -> Option<Vec<usize>> {
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
    pub(super) fn cells_by_type(&self, budget: &Budget) -> usize {
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
    pub(super) fn decode(&self, array: &Array, budget: &Budget) -> Result<(Scalar, Cow<'a, [u8]>)> {
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

    pub(super) fn ascii(&self, array: &Array, text: &[u8]) -> Result<(Scalar, Vec<u8>)> {
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
    pub(super) fn words(&self, bytes: &[u8]) -> Vec<u64> {
        let word = |bytes: &[u8]| {
            let digits = bytes.iter().map(|&byte| u64::from(byte));
            let number = |number: u64, digit: u64| number << 8 | digit;
            if self.big_endian { digits.fold(0, number) } else { digits.rev().fold(0, number) }
        };
        bytes.chunks_exact(self.word).map(word).collect()
    }

    /// The `length` bytes of an uncompressed array.
    pub(super) fn uncompressed(
        &self,
        encoded: Encoded<'a>,
        length: usize,
    ) -> Result<Cow<'a, [u8]>, String> {
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
    pub(super) fn packed(
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
