//! PLY (Greg Turk, "The PLY Polygon File Format", 1994): the `vertex` element, in ASCII or binary of
//! either byte order. Velocities are `vx, vy, vz` or `velocity_x, velocity_y, velocity_z`.
//!
//! Other elements and properties, including lists, are skipped.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::labelled::{ellipsoid_among, position_among, velocity_among};
use super::{
    Attribute, Column, Contents, Cursor, Others, Particles, Reading, Scalar, Table, Values,
    foreign, narrow_id,
};
use crate::error::{Error, Result};
use limpid::memory;

/// Encoding of the elements.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// An element of the header.
pub(crate) struct Element {
    pub(crate) name: String,
    pub(crate) count: usize,
    pub(crate) properties: Vec<Property>,
}

/// A property of an element.
pub(crate) enum Property {
    Number { name: String, scalar: Scalar },
    List { name: String, length: Scalar, item: Scalar },
}

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    if !has_magic(bytes) {
        return Err(foreign(path, bytes, "a PLY file"));
    }
    let mut file = Cursor::new(path, bytes, true);
    let (encoding, elements) = header(&mut file)?;
    let Some(vertex) = elements.iter().position(|element| element.name == "vertex") else {
        return Err(file.error("the header has no `element vertex`"));
    };
    file.source.text = encoding == Encoding::Ascii;
    for element in elements.iter().take(vertex) {
        skip(&mut file, element, encoding)?;
    }
    let mut contents = vertices(&mut file, &elements[vertex], encoding, reading)?;
    for element in elements.iter().skip(vertex + 1) {
        skip(&mut file, element, encoding)?;
    }
    let left = file.rest().trim_ascii().len();
    if left > 0 {
        file.start = file.offset;
        return Err(file.error(format!("{left} bytes follow the elements of the header")));
    }
    let cells = ["face", "tristrips", "edge"];
    let cells = elements.iter().filter(|element| cells.contains(&element.name.as_str()));
    contents.cells = cells.map(|element| element.count).fold(0, usize::saturating_add);
    Ok(contents)
}

/// Whether a file begins as PLY does.
pub(crate) fn has_magic(bytes: &[u8]) -> bool {
    bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r\n")
}

/// Reads the header: the encoding of the elements and their properties.
pub(crate) fn header(file: &mut Cursor<'_>) -> Result<(Encoding, Vec<Element>)> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    file.line(); // the magic
    while let Some(line) = file.line() {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["format", "ascii", "1.0"] => encoding = Some(Encoding::Ascii),
            ["format", "binary_little_endian", "1.0"] => encoding = Some(Encoding::LittleEndian),
            ["format", "binary_big_endian", "1.0"] => encoding = Some(Encoding::BigEndian),
            ["element", name, count] => {
                let (name, count) = (String::from(*name), file.count(Some(count), &line)?);
                elements.push(Element { name, count, properties: Vec::new() });
            }
            ["property", kind @ .., name] => {
                let property = match kind {
                    ["list", length, item] => {
                        let (length, item) = (scalar(file, length)?, scalar(file, item)?);
                        Property::List { name: (*name).into(), length, item }
                    }
                    [kind] => {
                        Property::Number { name: (*name).into(), scalar: scalar(file, kind)? }
                    }
                    _ => return Err(file.error(format!("expected a property, found `{line}`"))),
                };
                let Some(element) = elements.last_mut() else {
                    return Err(file.error("a property before the first element"));
                };
                element.properties.push(property);
            }
            ["comment" | "obj_info", ..] | [] => {}
            ["end_header"] => {
                let encoding = encoding.ok_or_else(|| file.error("the header has no `format`"))?;
                return Ok((encoding, elements));
            }
            _ => return Err(file.error(format!("unknown header line `{line}`"))),
        }
    }
    Err(file.error("the file ends before `end_header`"))
}

fn scalar(file: &Cursor<'_>, name: &str) -> Result<Scalar> {
    Ok(match name {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "int64" => Scalar::I64,
        "uint64" => Scalar::U64,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return Err(file.error(format!("unknown property type `{name}`"))),
    })
}

impl Element {
    fn has_lists(&self) -> bool {
        self.properties.iter().any(|property| matches!(property, Property::List { .. }))
    }

    /// Names and columns of the numbers of a record, without lists, in the layout of [`record`].
    pub(crate) fn columns(&self, encoding: Encoding) -> Vec<(&str, Column)> {
        let mut offset = 0;
        let numbers = self.properties.iter().filter_map(|property| match property {
            Property::Number { name, scalar } => Some((name.as_str(), *scalar)),
            Property::List { .. } => None,
        });
        numbers
            .map(|(name, scalar)| {
                let scalar = if encoding == Encoding::Ascii { Scalar::F64 } else { scalar };
                let column = Column { offset, scalar };
                offset += scalar.size();
                (name, column)
            })
            .collect()
    }

    fn stride(&self, encoding: Encoding) -> usize {
        self.columns(encoding).iter().map(|(_, column)| column.scalar.size()).sum()
    }
}

/// Skips the records of an element.
pub(crate) fn skip(file: &mut Cursor<'_>, element: &Element, encoding: Encoding) -> Result<()> {
    if element.has_lists() || encoding == Encoding::Ascii {
        for _ in 0..element.count {
            record(file, element, encoding, &mut |_| {}, &mut |_, _| {})?;
        }
    } else {
        file.take_records(element.count, element.stride(encoding), &element.name)?;
    }
    Ok(())
}

/// Reads one record. `keep` gets the bytes of its numbers, those of text as little-endian f64; `item` gets
/// the items of its lists, each after the index of its property: NaN for text that is no number.
pub(crate) fn record(
    file: &mut Cursor<'_>,
    element: &Element,
    encoding: Encoding,
    keep: &mut impl FnMut(&[u8]),
    item: &mut impl FnMut(usize, f64),
) -> Result<()> {
    let name = &element.name;
    if encoding == Encoding::Ascii {
        let ends = format!("the file ends before the last {name}");
        let line = file.filled_line().ok_or_else(|| file.error(ends))?;
        let mut words = line.split_ascii_whitespace();
        let short = || file.error(format!("{name}: the line has too few values"));
        for (k, property) in element.properties.iter().enumerate() {
            let word = words.next().ok_or_else(short)?;
            match property {
                Property::Number { .. } => keep(&file.number(word)?.to_le_bytes()),
                Property::List { .. } => {
                    for _ in 0..file.count(Some(word), "a list's length")? {
                        let word = words.next().ok_or_else(short)?;
                        item(k, word.parse().unwrap_or(f64::NAN));
                    }
                }
            }
        }
        return match words.next() {
            Some(word) => Err(file.error(format!("{name}: `{word}` is one value too many"))),
            None => Ok(()),
        };
    }
    let big_endian = encoding == Encoding::BigEndian;
    for (k, property) in element.properties.iter().enumerate() {
        match *property {
            Property::Number { scalar, .. } => keep(file.take(scalar.size(), name)?),
            Property::List { length, item: scalar, .. } => {
                let column = Column { offset: 0, scalar: length };
                let bytes = file.take(length.size(), name)?;
                let Some(Ok(length)) = column.integer(bytes, big_endian).map(usize::try_from)
                else {
                    return Err(file.error("a list's length: expected 0 or more"));
                };
                let items = file.take_records(length, scalar.size(), name)?;
                for bytes in items.chunks_exact(scalar.size()) {
                    item(k, scalar.number(bytes, big_endian));
                }
            }
        }
    }
    Ok(())
}

fn vertices(
    file: &mut Cursor<'_>,
    element: &Element,
    encoding: Encoding,
    reading: &Reading<'_>,
) -> Result<Contents> {
    let columns = element.columns(encoding);
    let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
    let stride = element.stride(encoding);
    let big_endian = encoding == Encoding::BigEndian;
    let position = position_among(&names, reading.map);
    let Some(&[x, y, z]) = position.as_deref() else {
        let problem = reading.map.no_positions("properties", "x, y and z", &names);
        return Err(Error::format(file.source.path, format!("the vertices have {problem}")));
    };

    let table = if element.has_lists() || encoding == Encoding::Ascii {
        let (mut bytes, mut starts) = (Vec::new(), Vec::new());
        let start = file.offset;
        for _ in 0..element.count {
            let offset = file.offset;
            memory::grow(&mut bytes, stride, file.source.path.display())?;
            memory::grow(&mut starts, 1, file.source.path.display())?;
            let keep = &mut |number: &[u8]| bytes.extend_from_slice(number);
            record(file, element, encoding, keep, &mut |_, _| {})?;
            // In text, blank lines may precede the record.
            starts.push(if file.source.text { file.start } else { offset });
        }
        let (bytes, rows, starts) = (Cow::Owned(bytes), starts.len(), Some(starts));
        Table { source: file.source, start, bytes, rows, stride, big_endian, starts }
    } else {
        file.table(element.count, stride, big_endian, "vertices")?
    };

    let position = [x, y, z];
    let mut contents = table.particles(position.map(|at| columns[at].1))?;
    if reading.map.has(Attribute::Position) {
        let names = position.map(|at| names[at]).join(" ");
        contents.list(&names, &[table.rows, 3], Some(Attribute::Position));
    }
    let mut used = position.to_vec();
    let vectors = [
        (Attribute::Velocity, velocity_among(&names, reading.map)),
        (Attribute::Ellipsoid, ellipsoid_among(&names, reading.map)),
    ];
    for (attribute, at) in vectors {
        let Some(at) = at else { continue };
        let (names, columns): (Vec<&str>, Vec<Column>) = at.iter().map(|&k| columns[k]).unzip();
        let shape = [table.rows, at.len()];
        for (name, column) in names.iter().zip(&columns) {
            contents.keep(reading, name, &table, &[*column])?;
        }
        contents.take_as(Some(attribute), &names.join(" "), &shape, &table, &columns)?;
        used.extend(at);
    }
    for (at, (name, column)) in columns.iter().enumerate() {
        if !used.contains(&at) {
            contents.take(reading, name, &table, &[*column])?;
        }
    }
    for property in &element.properties {
        if let Property::List { name, .. } = property {
            contents.list(name, &[table.rows], None);
        }
    }
    Ok(contents)
}

/// Writes the vertices, binary and little-endian.
pub(super) fn write(
    particles: &Particles,
    others: &Others<'_>,
    out: &mut BufWriter<&File>,
) -> io::Result<()> {
    let attributes = super::with_others(particles, others);
    let narrow = particles.narrow();
    writeln!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}", particles.len())?;
    for axis in ["x", "y", "z"] {
        writeln!(out, "property {} {axis}", if narrow { "float" } else { "double" })?;
    }
    for &(name, values) in &attributes {
        let kind = if matches!(values, Values::Integers(_)) { "int" } else { "float" };
        for column in values.column_names(name) {
            writeln!(out, "property {kind} {column}")?;
        }
    }
    writeln!(out, "end_header")?;
    let mut record = Vec::new();
    for i in 0..particles.len() {
        record.clear();
        if narrow {
            record.extend(particles.positions[i].to_array().map(f32::to_le_bytes).as_flattened());
        } else {
            record.extend(particles.place(i).to_array().map(f64::to_le_bytes).as_flattened());
        }
        for &(_, values) in &attributes {
            match values {
                Values::Integers(ids) => record.extend(narrow_id(ids[i], "PLY")?.to_le_bytes()),
                _ => record.extend(values.floats_of(i).iter().flat_map(|x| x.to_le_bytes())),
            }
        }
        out.write_all(&record)?;
    }
    Ok(())
}
