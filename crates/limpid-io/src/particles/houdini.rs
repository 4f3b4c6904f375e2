//! Houdini's geometry since version 12, `.geo` in text and `.bgeo` in binary [JSON](json), as described by the
//! `hgeo` module that comes with Houdini. The document is a list of names and values in turn:
//!
//! ```text
//! "pointcount", n, "vertexcount", ..., "primitivecount", ...,
//! "attributes", ["pointattributes", [[DEFINITION, VALUES], ...], ...], "primitives", [...]
//! DEFINITION: ["scope", ..., "type", "numeric", "name", "P", ...]
//! VALUES: ["size", 3, "storage", "fpreal32", "values", ["size", 3, "storage", ..., DATA]]
//! DATA: "tuples", [[x, y, z], ...]    or "arrays", [[x, x, ...], [y, y, ...], [z, z, ...]]
//!    or "pagesize", 1024, "packing", [3], "constantpageflags", [[false, ...]], "rawpagedata", [...]
//! ```
//!
//! Pages hold `pagesize` points. A page has its parts in turn, each with as many numbers a point as `packing`
//! says; a part whose flag is set has them once for all its points.

mod json;

use std::borrow::Cow;
use std::path::Path;

use super::cursor::FileBytes;
use super::{Column, Contents, POSITION_BYTES, Reading, Table, foreign};
use crate::budget::Budget;
use crate::error::{Error, Location, Result};
use limpid::memory;

use json::{Numbers, Value};

/// Whether a file seems to be one of these documents.
pub(super) fn is_geometry(bytes: &[u8]) -> bool {
    json::is_binary(bytes) || bytes.trim_ascii_start().starts_with(b"[")
}

/// Parses an unpacked file.
pub(super) fn parse(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    let budget = reading.budget;
    if !is_geometry(bytes) {
        return Err(foreign(path, bytes, "Houdini's geometry"));
    }
    let source = FileBytes { path, bytes, text: !json::is_binary(bytes) };
    let document = json::parse(source, budget)?;
    let fail = |problem: &str| Err(Error::malformed(path, Location::Byte(0), problem));
    let Some(points) = document.get("pointcount").and_then(Value::count) else {
        return fail("no number `pointcount`: not a geometry of Houdini");
    };
    // Only positions that are all the same could be shorter.
    if points > bytes.len() {
        return fail(&format!("{points} points, more than can be in {} bytes", bytes.len()));
    }
    let attributes = document.get("attributes").and_then(|all| all.get("pointattributes"));
    let attributes: Vec<_> = attributes
        .map_or(&[][..], Value::list)
        .iter()
        .filter_map(|attribute| {
            let [definition, values] = attribute.list() else { return None };
            let name = definition.get("name")?.text()?.into_owned();
            Some(PointAttribute { name, values: values.get("values").unwrap_or(&Value::Null) })
        })
        .collect();
    let bytes_of = attributes.iter().map(|attribute| reading.bytes_of(&attribute.name));
    let read = bytes_of.fold(POSITION_BYTES, u64::saturating_add);
    source.take(budget, read.saturating_mul(points as u64), 0)?;

    let Some(positions) = attributes.iter().find(|attribute| attribute.name == "P") else {
        return fail("no point attribute `P`");
    };
    if !matches!(positions.size(), 3 | 4) {
        return fail(&format!("attribute P: {} numbers a point, expected 3", positions.size()));
    }
    let (table, columns) = positions.table(source, points, budget)?;
    // A fourth number is 1.
    let mut contents = table.particles([columns[0], columns[1], columns[2]])?;
    let mut tried = Vec::new();
    for attribute in attributes.iter().filter(|attribute| attribute.name != "P") {
        let (name, size) = (&attribute.name, attribute.size());
        match reading.map.attribute_of(name) {
            // The first of several, since each may repeat a few numbers for all points.
            Some(kind) if kind.takes(size) && !tried.contains(&kind) => {
                tried.push(kind);
                let (table, columns) = attribute.table(source, points, budget)?;
                contents.take(reading, name, &table, &columns)?;
            }
            _ if size == 1 && reading.keeps(name) || size > 0 && reading.shows(name) => {
                let (table, columns) = attribute.table(source, points, budget)?;
                contents.take(reading, name, &table, &columns)?;
            }
            None if (1..=4).contains(&size) && reading.values => {
                match attribute.table(source, points, budget) {
                    Ok((table, columns)) => contents.take(reading, name, &table, &columns)?,
                    // Only its values would have been listed.
                    Err(_) => contents.list(name, &[points, size][..size.min(2)], None),
                }
            }
            kind if size < 2 => contents.pass_over(kind, name, &[points]),
            kind => contents.pass_over(kind, name, &[points, size]),
        }
    }
    contents.cells = cells(&document);
    Ok(contents)
}

/// Number of polygons and the like. Particle systems are primitives too, and so are volumes, of one vertex.
fn cells(document: &Value<'_>) -> usize {
    let count = |name| document.get(name).and_then(Value::count).unwrap_or(0);
    let primitives = document.get("primitives").map_or(&[][..], Value::list);
    let particles = primitives.iter().any(|primitive| {
        let kind = primitive.list().first().and_then(|definition| definition.get("type"));
        kind.is_some_and(|kind| kind.is_text("Part"))
    });
    let primitives = count("primitivecount");
    if particles || count("vertexcount") <= primitives { 0 } else { primitives }
}

struct PointAttribute<'a> {
    name: String,
    values: &'a Value<'a>,
}

impl PointAttribute<'_> {
    /// Numbers a point; 0 if it has none.
    fn size(&self) -> usize {
        self.values.get("size").and_then(Value::count).unwrap_or(0)
    }

    /// The numbers point by point, at most six each.
    fn table<'t>(
        &'t self,
        source: FileBytes<'t>,
        points: usize,
        budget: &Budget,
    ) -> Result<(Table<'t>, Vec<Column>)> {
        let get = |name| self.values.get(name);
        let size = self.size();
        let problem = format!("expected {size} numbers for each of {points} points");
        let numbers = if let Some(raw) = get("rawpagedata") {
            self.unpaged(source, &raw.numbers(), points)?
        } else if let Some(tuples) = get("tuples") {
            let tuples = tuples.list().iter().map(Value::numbers);
            joined(tuples.filter(|tuple| tuple.len() == size), size)
        } else if let Some(arrays) = get("arrays") {
            // Of one number a point there may be no list of arrays, but the array.
            let flat = arrays.numbers();
            let arrays: Vec<_> = match arrays.list() {
                _ if flat.len() > 0 => vec![flat],
                arrays => arrays.iter().map(Value::numbers).collect(),
            };
            let even = arrays.len() == size && arrays.iter().all(|array| array.len() == points);
            if !even {
                return Err(self.error(source, &problem));
            }
            let number = |row: usize, array: &Cow<'_, Numbers<'_>>| array.number(row);
            let all =
                (0..points).flat_map(|row| arrays.iter().map(move |array| number(row, array)));
            Numbers::of_floats(all)
        } else {
            return Err(self.error(source, "no `rawpagedata`, `tuples` or `arrays`"));
        };
        if numbers.len() != points.saturating_mul(size) {
            return Err(self.error(source, &problem));
        }
        let Numbers { bytes, scalar, big_endian, start } = numbers;
        if let Cow::Owned(bytes) = &bytes {
            source.take(budget, bytes.len() as u64, self.offset(source))?;
        }
        let start = if source.text { self.offset(source) } else { start };
        let stride = size * scalar.size();
        // Locations are that of the array alone, if it is not stored row by row.
        let starts = matches!(bytes, Cow::Owned(_)).then(Vec::new);
        let table = Table { source, start, bytes, rows: points, stride, big_endian, starts };
        Ok((table, Column::adjacent(0, size, scalar)))
    }

    /// Puts the parts of pages side by side.
    fn unpaged<'t>(
        &self,
        source: FileBytes<'_>,
        raw: &Cow<'t, Numbers<'t>>,
        points: usize,
    ) -> Result<Numbers<'t>> {
        let (get, size) = (|name| self.values.get(name), self.size());
        let packing: Vec<usize> = match get("packing").map(Value::numbers) {
            Some(packing) => (0..packing.len()).map(|k| packing.number(k) as usize).collect(),
            None => vec![size],
        };
        if packing.iter().fold(0, |sum: usize, part| sum.saturating_add(*part)) != size {
            return Err(self.error(source, &format!("packing {packing:?} of {size} numbers")));
        }
        let flags = get("constantpageflags").map_or(&[][..], Value::list);
        let flags: Vec<_> = flags.iter().map(Value::flags).collect();
        if packing.len() == 1 && !flags.iter().any(|flags| flags.contains(&true)) {
            return Ok(raw.clone().into_owned());
        }
        let page_size = get("pagesize").and_then(Value::count).filter(|&size| size > 0);
        let page_size = page_size.ok_or_else(|| self.error(source, "no number `pagesize`"))?;

        let word = raw.scalar.size();
        let mut bytes = memory::zeroed(points * size * word, source.path.display())?;
        let mut rest = &raw.bytes[..];
        for (page, rows) in bytes.chunks_mut(page_size.saturating_mul(size * word)).enumerate() {
            let mut offset = 0;
            for (part, width) in packing.iter().map(|numbers| numbers * word).enumerate() {
                let constant = flags.get(part).and_then(|flags| flags.get(page));
                let constant = constant.is_some_and(|&constant| constant);
                let stored = if constant { 1 } else { rows.len() / (size * word) };
                let Some((numbers, after)) = rest.split_at_checked(stored * width) else {
                    return Err(self.error(source, &format!("page {page} is cut off")));
                };
                for (i, row) in rows.chunks_exact_mut(size * word).enumerate() {
                    let start = if constant { 0 } else { i * width };
                    row[offset..][..width].copy_from_slice(&numbers[start..][..width]);
                }
                (rest, offset) = (after, offset + width);
            }
        }
        if !rest.is_empty() {
            let left = rest.len() / word;
            return Err(self.error(source, &format!("{left} numbers follow the last page")));
        }
        Ok(Numbers { bytes: Cow::Owned(bytes), ..raw.clone().into_owned() })
    }

    fn error(&self, source: FileBytes<'_>, problem: &str) -> Error {
        source.error(self.offset(source), format!("attribute {}: {problem}", self.name))
    }

    /// Where the attribute's name first occurs.
    fn offset(&self, source: FileBytes<'_>) -> usize {
        let name = self.name.as_bytes();
        let quoted = if source.text { [b"\"", name, b"\""].concat() } else { name.to_vec() };
        let mut windows = source.bytes.windows(quoted.len().max(1));
        windows.position(|window| window == quoted).unwrap_or(0)
    }
}

/// The numbers of tuples as rows of 64-bit floats.
fn joined<'a>(tuples: impl Iterator<Item = Cow<'a, Numbers<'a>>>, size: usize) -> Numbers<'static> {
    Numbers::of_floats(tuples.flat_map(|tuple| (0..size).map(move |k| tuple.number(k))))
}
