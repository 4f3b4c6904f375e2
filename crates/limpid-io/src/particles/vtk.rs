//! Legacy VTK, versions 1.0 to 5.1 (Kitware, "VTK File Formats", section "Simple Legacy Formats"), as
//! written by SPlisHSPlasH, `DualSPHysics` and `ParaView`: the points and point data of unstructured
//! grids and polygonal data, binary (big-endian) or ASCII.
//!
//! Keywords are lines of text between blocks of numbers, so the exact length of each block must be
//! known, whether or not it is used.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::{
    Column, Contents, Cursor, Others, Particles, Reading, Scalar, Table, Values, foreign,
    write_numbers,
};
use crate::error::{Error, Result};
use limpid::memory;

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    if !bytes.starts_with(b"# vtk DataFile Version ") {
        return Err(foreign(path, bytes, "a legacy VTK file"));
    }
    Vtk::open(path, bytes, *reading)?.read()
}

/// Whether cells of this type consist of points only.
pub(super) fn is_point(kind: Option<i64>) -> bool {
    const VERTEX: i64 = 1;
    const POLY_VERTEX: i64 = 2;
    matches!(kind, Some(VERTEX | POLY_VERTEX))
}

/// Whether each of `count` numbers occurs once.
pub(super) fn is_permutation(order: &[usize], count: usize) -> bool {
    let mut seen = vec![false; order.len()];
    let mut first =
        |at: &usize| seen.get_mut(*at).is_some_and(|seen| !std::mem::replace(seen, true));
    order.len() == count && order.iter().all(&mut first)
}

/// The rows of cell data, of `row` bytes each, in the order of the points, by the point of each cell.
pub(super) fn at_points(bytes: &[u8], row: usize, points: &[usize]) -> Vec<u8> {
    let mut moved = vec![0; bytes.len()];
    for (&point, values) in points.iter().zip(bytes.chunks_exact(row.max(1))) {
        if let Some(place) = moved.get_mut(point * row..(point + 1) * row) {
            place.copy_from_slice(values);
        }
    }
    moved
}

/// The part of the dataset to which attributes belong, with its number of rows.
#[derive(Clone, Copy)]
enum Section {
    Dataset,
    Cells(usize),
    Points(usize),
}

struct Vtk<'a> {
    file: Cursor<'a>,
    /// Cells are stored as offsets and connectivity, as from version 5 on.
    split_cells: bool,
    section: Section,
    reading: Reading<'a>,
    contents: Option<Contents>,
    /// Number of cells with several points.
    cells: usize,
    /// The point of each cell, if all have one; `None` for others and before the cells.
    points_of_cells: Option<Vec<usize>>,
    /// Arrays of the cells: name, size of a row, type and numbers.
    cell_data: Vec<(String, usize, Scalar, Table<'a>)>,
    /// Number of components of the latest array.
    components: usize,
}

impl<'a> Vtk<'a> {
    fn open(path: &'a Path, bytes: &'a [u8], reading: Reading<'a>) -> Result<Self> {
        let mut file = Cursor::new(path, bytes, true);
        let first = file.line().unwrap_or_default();
        let version = first.rsplit(' ').next().and_then(|version| {
            let (major, minor) = version.split_once('.')?;
            Some((major.parse::<u32>().ok()?, minor.parse::<u32>().ok()?))
        });
        let split_cells = match version {
            Some((1..5, _)) => false,
            Some((5, 0..=1)) => true,
            _ => {
                let problem = format!("`{first}`: versions 1.0 to 5.1 can be read");
                return Err(Error::format(path, problem));
            }
        };
        file.line(); // the title
        let encoding = file.line().unwrap_or_default();
        let text = match encoding.trim_ascii() {
            "ASCII" => true,
            "BINARY" => false,
            _ => {
                let problem = format!("expected `ASCII` or `BINARY`, found `{encoding}`");
                return Err(file.error(problem));
            }
        };
        file.source.text = text;
        let section = Section::Dataset;
        Ok(Self {
            file,
            split_cells,
            section,
            reading,
            contents: None,
            cells: 0,
            points_of_cells: None,
            cell_data: Vec::new(),
            components: 0,
        })
    }

    fn read(mut self) -> Result<Contents> {
        while let Some(line) = self.keyword_line() {
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            let keyword = words.first().copied().unwrap_or_default().to_ascii_uppercase();
            self.block(&keyword, &words)?;
        }
        let missing = || self.file.error("the file ends before `POINTS`");
        let mut contents = self.contents.ok_or_else(missing)?;
        let rows = contents.particles.len();
        let points = self.points_of_cells.filter(|points| {
            self.cells == 0 && !self.cell_data.is_empty() && is_permutation(points, rows)
        });
        for (name, size, scalar, table) in self.cell_data {
            match &points {
                Some(points) if size <= 6 => {
                    let bytes = at_points(&table.bytes, table.stride, points).into();
                    let table = Table { bytes, ..table };
                    contents.take(
                        &self.reading,
                        &name,
                        &table,
                        &Column::adjacent(0, size, scalar),
                    )?;
                }
                _ => contents.list(&name, &[table.rows, size][..size.min(2)], None),
            }
        }
        Ok(Contents { cells: self.cells, ..contents })
    }

    /// Reads the next line with a keyword. Blank lines and METADATA blocks, which end at a blank line, may precede it.
    fn keyword_line(&mut self) -> Option<Cow<'a, str>> {
        loop {
            let line = self.file.filled_line()?;
            if line.trim_ascii() != "METADATA" {
                return Some(line);
            }
            self.skip_metadata()?;
        }
    }

    /// Skips the rest of a METADATA block.
    fn skip_metadata(&mut self) -> Option<()> {
        loop {
            let line = self.file.line()?;
            match line.trim_ascii() {
                "" => return Some(()),
                "COMPONENT_NAMES" => {
                    // A line for each component of the array before, blank for those without a name. Some programs
                    // leave the last ones out. Names have no blanks.
                    for _ in 0..self.components {
                        let start = self.file.offset;
                        let name = self.file.line()?;
                        if name.trim_ascii().contains(' ') {
                            self.file.offset = start;
                            if name.starts_with("INFORMATION ") {
                                break;
                            }
                            return Some(());
                        }
                    }
                }
                _ => {}
            }
        }
    }

    /// Reads the block of numbers that follows a keyword line.
    fn block(&mut self, keyword: &str, words: &[&str]) -> Result<()> {
        let count = |at: usize| self.file.count(words.get(at).copied(), keyword);
        match keyword {
            "DATASET" => match words.get(1).copied().unwrap_or_default() {
                "UNSTRUCTURED_GRID" | "POLYDATA" => Ok(()),
                other => {
                    let problem = format!("dataset `{other}`: expected unstructured grid or polydata");
                    Err(Error::format(self.file.source.path, problem))
                }
            },
            "POINTS" => {
                let (rows, scalar) = (count(1)?, self.scalar(words.get(2))?);
                self.points(rows, scalar)
            }
            "CELLS" | "VERTICES" | "LINES" | "POLYGONS" | "TRIANGLE_STRIPS" => {
                let (cells, size) = (count(1)?, count(2)?);
                if !matches!(keyword, "CELLS" | "VERTICES") {
                    self.cells = self.cells.saturating_add(cells);
                }
                let points = self.cells(cells, size)?;
                if matches!(keyword, "CELLS" | "VERTICES") {
                    self.points_of_cells = points;
                }
                Ok(())
            }
            "CELL_TYPES" => {
                let cells = count(1)?;
                let table = self.table(cells, 1, Scalar::I32, keyword)?;
                let column = Column { offset: 0, scalar: self.stored(Scalar::I32) };
                let records = table.bytes.chunks_exact(table.stride);
                let points = records.filter(|record| is_point(column.integer(record, true)));
                self.cells = self.cells.saturating_add(table.rows - points.count());
                Ok(())
            }
            "CELL_DATA" => {
                self.section = Section::Cells(count(1)?);
                Ok(())
            }
            "POINT_DATA" => {
                let rows = count(1)?;
                let particles = self.contents.as_ref().map_or(0, |contents| contents.particles.len());
                if rows != particles {
                    let problem = format!("POINT_DATA for {rows} points, but there are {particles}");
                    return Err(self.file.error(problem));
                }
                self.section = Section::Points(rows);
                Ok(())
            }
            "FIELD" => {
                for _ in 0..count(2)? {
                    self.field_array()?;
                }
                Ok(())
            }
            "LOOKUP_TABLE" => {
                let rows = count(2)?;
                self.table(rows, 4, Scalar::U8, keyword).map(drop)
            }
            "SCALARS" => {
                let size = if words.len() > 3 { count(3)? } else { 1 };
                let scalar = self.scalar(words.get(2))?;
                self.skip_table_name();
                self.attribute(words, size, scalar)
            }
            "COLOR_SCALARS" => {
                let size = count(2)?;
                self.attribute(words, size, Scalar::U8)
            }
            "TEXTURE_COORDINATES" => {
                let size = count(2)?;
                self.attribute(words, size, self.scalar(words.get(3))?)
            }
            "VECTORS" | "NORMALS" => self.attribute(words, 3, self.scalar(words.get(2))?),
            "TENSORS" => self.attribute(words, 9, self.scalar(words.get(2))?),
            "TENSORS6" => self.attribute(words, 6, self.scalar(words.get(2))?),
            "GLOBAL_IDS" | "PEDIGREE_IDS" => {
                self.attribute(words, 1, self.scalar(words.get(2))?)
            }
            _ => Err(self.file.error(format!(
                "expected a VTK keyword, found `{}`; or the block before is not as long as announced",
                shorten(words.first().copied().unwrap_or_default())
            ))),
        }
    }

    fn points(&mut self, rows: usize, scalar: Scalar) -> Result<()> {
        if self.contents.is_some() {
            return Err(self.file.error("a second POINTS block"));
        }
        let table = self.table(rows, 3, scalar, "POINTS")?;
        let xyz = Column::triple(self.stored(scalar));
        self.contents = Some(table.particles(xyz)?);
        Ok(())
    }

    /// Reads cells; returns the point of each, if all have one.
    fn cells(&mut self, cells: usize, size: usize) -> Result<Option<Vec<usize>>> {
        if !self.split_cells {
            let table = self.table(size, 1, Scalar::I32, "cells")?;
            let numbers = indices(&table, self.stored(Scalar::I32));
            // Each cell is the number of its points and these.
            let single = |cell: &[usize]| match *cell {
                [1, point] => Some(point),
                _ => None,
            };
            let even = size.checked_div(2) == Some(cells) && size.is_multiple_of(2);
            let numbers = numbers.filter(|_| even);
            return Ok(numbers.and_then(|numbers| numbers.chunks(2).map(single).collect()));
        }
        // Versions with offsets count one more of them than there are cells.
        let mut points = None;
        if cells == 0 {
            return Ok(None);
        }
        for (keyword, rows) in [("OFFSETS", cells), ("CONNECTIVITY", size)] {
            let line = self.keyword_line().unwrap_or_default();
            let scalar = match line.split_ascii_whitespace().collect::<Vec<_>>().as_slice() {
                [word, kind] if *word == keyword => self.scalar(Some(kind))?,
                _ => {
                    let problem = format!("expected `{keyword}`, found `{}`", shorten(&line));
                    return Err(self.file.error(problem));
                }
            };
            let table = self.table(rows, 1, scalar, keyword)?;
            points =
                indices(&table, self.stored(scalar)).filter(|points| points.len() + 1 == cells);
        }
        Ok(points)
    }

    /// Reads an array of a field: a line `name size rows type`, then the numbers.
    fn field_array(&mut self) -> Result<()> {
        let line = self.keyword_line().unwrap_or_default();
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let &[name, size, rows, kind] = words.as_slice() else {
            let problem =
                format!("expected a field's name, size, rows and type: `{}`", shorten(&line));
            return Err(self.file.error(problem));
        };
        let size = self.file.count(Some(size), name)?;
        let rows = self.file.count(Some(rows), name)?;
        let scalar = self.scalar(Some(&kind))?;
        if let Section::Cells(expected) | Section::Points(expected) = self.section
            && rows != expected
        {
            let problem = format!("attribute {name} has {rows} entries, expected {expected}");
            return Err(self.file.error(problem));
        }
        self.values(name, rows, size, scalar)
    }

    /// Reads an attribute whose line begins with a keyword and its name.
    fn attribute(&mut self, words: &[&str], size: usize, scalar: Scalar) -> Result<()> {
        let name = words.get(1).copied().unwrap_or_default();
        match self.section {
            Section::Cells(rows) | Section::Points(rows) => self.values(name, rows, size, scalar),
            Section::Dataset => {
                Err(self.file.error(format!("attribute {name} before POINT_DATA or CELL_DATA")))
            }
        }
    }

    fn values(&mut self, name: &str, rows: usize, size: usize, scalar: Scalar) -> Result<()> {
        let table = self.table(rows, size, scalar, name)?;
        let stored = self.stored(scalar);
        match (&mut self.contents, self.section) {
            // No attribute has more than six numbers; ignored arrays may have any size.
            (Some(contents), Section::Points(_)) if size <= 6 => {
                contents.take(&self.reading, name, &table, &Column::adjacent(0, size, stored))
            }
            (Some(contents), Section::Points(_)) => {
                contents.list(name, &[rows, size], None);
                Ok(())
            }
            (_, Section::Cells(_)) => {
                memory::grow(&mut self.cell_data, 1, self.file.source.path.display())?;
                self.cell_data.push((name.to_owned(), size, stored, table));
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Reads a table of `rows` × `size` numbers.
    fn table(&mut self, rows: usize, size: usize, scalar: Scalar, what: &str) -> Result<Table<'a>> {
        self.components = size;
        if !self.file.source.text {
            return self.file.table(rows, size.saturating_mul(scalar.size()), true, what);
        }
        let start = self.file.offset;
        let (mut bytes, mut starts) = (Vec::new(), Vec::new());
        // Memory grows with the numbers read, not with the stated count.
        for row in 0..if size == 0 { 0 } else { rows } {
            for column in 0..size {
                let Some(word) = self.file.word() else {
                    let problem = format!("{what}: the file ends in row {row} of {rows}");
                    return Err(self.file.source.error(self.file.offset, problem));
                };
                memory::grow(&mut bytes, Scalar::F64.size(), self.file.source.path.display())?;
                bytes.extend(self.file.number(&word)?.to_be_bytes());
                if column == 0 {
                    memory::grow(&mut starts, 1, self.file.source.path.display())?;
                    starts.push(self.file.start);
                }
            }
        }
        Ok(Table {
            source: self.file.source,
            start,
            bytes: Cow::Owned(bytes),
            rows: starts.len(),
            stride: size.saturating_mul(Scalar::F64.size()),
            big_endian: true,
            starts: Some(starts),
        })
    }

    /// The type in which a table stores numbers of this type.
    fn stored(&self, scalar: Scalar) -> Scalar {
        if self.file.source.text { Scalar::F64 } else { scalar }
    }

    /// Skips the name of the colour table after `SCALARS`, which some programs do not write.
    fn skip_table_name(&mut self) {
        let rest = self.file.rest();
        let rest = if self.file.source.text { rest.trim_ascii_start() } else { rest };
        if rest.starts_with(b"LOOKUP_TABLE") {
            self.file.filled_line();
        }
    }

    fn scalar(&self, name: Option<&&str>) -> Result<Scalar> {
        let name = name.copied().unwrap_or("nothing");
        Ok(match name.to_ascii_lowercase().as_str() {
            "char" | "signed_char" | "vtktypeint8" => Scalar::I8,
            "unsigned_char" | "vtktypeuint8" => Scalar::U8,
            "short" | "vtktypeint16" => Scalar::I16,
            "unsigned_short" | "vtktypeuint16" => Scalar::U16,
            // In legacy files VTK's index type always has 32 bits.
            "int" | "vtktypeint32" | "vtkidtype" => Scalar::I32,
            "unsigned_int" | "vtktypeuint32" => Scalar::U32,
            "long" | "long_long" | "vtktypeint64" => Scalar::I64,
            "unsigned_long" | "unsigned_long_long" | "vtktypeuint64" => Scalar::U64,
            "float" => Scalar::F32,
            "double" => Scalar::F64,
            _ => {
                let problem = format!("expected a number type (float, int, ...), found `{name}`");
                return Err(self.file.error(problem));
            }
        })
    }
}

/// The numbers of a table of one column; `None` if one is no index.
fn indices(table: &Table<'_>, scalar: Scalar) -> Option<Vec<usize>> {
    let column = Column { offset: 0, scalar };
    let records = table.bytes.chunks_exact(scalar.size());
    records.map(|record| usize::try_from(column.integer(record, true)?).ok()).collect()
}

/// The start of a word or line for messages, since binary numbers read as text may be long.
fn shorten(text: &str) -> String {
    text.chars().take(40).map(|c| if c.is_control() { '?' } else { c }).collect()
}

/// Writes an unstructured grid of vertices as SPlisHSPlasH does: version 4.1, binary, ids as scalars,
/// the other attributes as field data. Ids beyond unsigned 32 bits are written as 64-bit integers, with
/// the type name of newer versions.
pub(super) fn write(
    particles: &Particles,
    others: &Others<'_>,
    out: &mut BufWriter<&File>,
) -> io::Result<()> {
    let n = particles.len();
    write!(out, "# vtk DataFile Version 4.1\nparticles\nBINARY\nDATASET UNSTRUCTURED_GRID\n")?;
    if particles.narrow() {
        writeln!(out, "POINTS {n} float")?;
        write_numbers(bytemuck::cast_slice(&particles.positions), f32::to_be_bytes, out)?;
    } else {
        writeln!(out, "POINTS {n} double")?;
        for i in 0..n {
            out.write_all(particles.place(i).to_array().map(f64::to_be_bytes).as_flattened())?;
        }
    }
    write!(out, "\nCELLS {n} {}\n", 2 * n)?;
    for i in 0..n as u32 {
        out.write_all([1, i].map(u32::to_be_bytes).as_flattened())?;
    }
    write!(out, "\nCELL_TYPES {n}\n")?;
    for _ in 0..n {
        out.write_all(&1_u32.to_be_bytes())?;
    }
    write!(out, "\nPOINT_DATA {n}\n")?;
    let (ids, fields): (Vec<_>, Vec<_>) = super::with_others(particles, others)
        .into_iter()
        .partition(|(_, v)| matches!(v, Values::Integers(_)));
    for (name, values) in ids {
        let Values::Integers(ids) = values else { continue };
        let short = ids.iter().all(|&id| u32::try_from(id).is_ok());
        let kind = if short { "unsigned_int" } else { "vtktypeint64" };
        write!(out, "SCALARS {name} {kind} 1\nLOOKUP_TABLE {name}_table\n")?;
        if short {
            write_numbers(ids, |id| (id as u32).to_be_bytes(), out)?;
        } else {
            write_numbers(ids, i64::to_be_bytes, out)?;
        }
        writeln!(out)?;
    }
    writeln!(out, "FIELD FieldData {}", fields.len())?;
    for (name, values) in fields {
        writeln!(out, "{name} {} {n} float", values.size())?;
        write_numbers(values.floats(), f32::to_be_bytes, out)?;
        writeln!(out)?;
    }
    Ok(())
}
