//! CSV: text with one particle per line, as written by `ParaView`, `DualSPHysics` and spreadsheets. The
//! delimiter is the most frequent of comma, semicolon and tab in the first line, or else blanks, as `NumPy` writes.
//!
//! The first line may name the columns. Those of a vector have its name, optionally `:`, `_` or `.`,
//! and `x`, `y`, `z` or `0`, `1`, `2`: `x`, `px`, `Points:0`, `Points_0`, `Pos.x [m]`. Without such a
//! line the first three columns are x, y and z. Lines that begin with `#` are comments, except one
//! before the numbers that names as many columns as they have.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use csv::{ByteRecord, ReaderBuilder, Trim};
use glam::DVec3;

use super::labelled::{Layout, position_among};
use super::{
    AttributeMap, Contents, Cursor, Others, Particles, Reading, Values, foreign, known_magic,
};
use crate::error::Result;
use crate::number::float;
use limpid::liquid::particles::origin_for;
use limpid::memory;

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";
    if known_magic(bytes).is_some() {
        return Err(foreign(path, bytes, "a table of text"));
    }
    let skipped = if bytes.starts_with(BYTE_ORDER_MARK) { BYTE_ORDER_MARK.len() } else { 0 };
    let text = &bytes[skipped..];
    let (comments, delimiter) = beginning(text);
    let Some(delimiter) = delimiter else {
        return read_words(path, bytes, skipped, &comments, reading);
    };
    let file = Cursor::new(path, bytes, true);
    let mut records = ReaderBuilder::new()
        .delimiter(delimiter)
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .trim(Trim::All)
        .from_reader(text);
    let mut record = ByteRecord::new();
    let mut next = |record: &mut ByteRecord| -> Result<Option<usize>> {
        let found = records.read_byte_record(record).map_err(|error| {
            let offset = error.position().map_or(0, |position| position.byte() as usize);
            file.source.error(skipped + offset, format!("not a table: {error}"))
        })?;
        let start = skipped + record.position().map_or(0, |position| position.byte() as usize);
        let blank = |byte: &&u8| byte.is_ascii_whitespace();
        Ok(found.then(|| start + bytes[start.min(bytes.len())..].iter().take_while(blank).count()))
    };

    let mut start = next(&mut record)?;
    let named = record.iter().take(3).any(|field| float(field).is_none());
    let labels: Vec<String> = match named {
        true => record.iter().map(label).collect(),
        false => {
            let fields = |comment: &[u8]| fields(comment, delimiter);
            commented(&comments, fields, record.len(), reading.map)
                .unwrap_or_else(|| unnamed(record.len()))
        }
    };
    if start.is_none() {
        return Ok(Contents::default());
    }
    let layout = Layout::among(path, labels, *reading)?;
    if named {
        start = next(&mut record)?;
    }

    let stride = layout.stride();
    let (mut numbers, mut starts) = (Vec::new(), Vec::new());
    while let Some(offset) = start {
        let row = starts.len();
        memory::grow(&mut numbers, stride, path.display())?;
        memory::grow(&mut starts, 1, path.display())?;
        layout.push_row(file.source, offset, row, |field| record.get(field), &mut numbers)?;
        starts.push(offset);
        start = next(&mut record)?;
    }
    layout.contents(file.source, skipped, numbers, starts)
}

/// Reads a table whose columns are apart by blanks. `start` is the offset of the text.
fn read_words(
    path: &Path,
    bytes: &[u8],
    start: usize,
    comments: &[&[u8]],
    reading: &Reading<'_>,
) -> Result<Contents> {
    let mut file = Cursor::new(path, bytes, true);
    file.offset = start;
    let mut layout: Option<Layout<'_>> = None;
    let (mut numbers, mut starts) = (Vec::new(), Vec::new());
    while let Some(line) = file.filled_line() {
        if line.trim_ascii_start().starts_with('#') {
            continue;
        }
        let words: Vec<&[u8]> = line.split_ascii_whitespace().map(str::as_bytes).collect();
        if layout.is_none() {
            let named = words.iter().take(3).any(|word| float(word).is_none());
            let labels = match named {
                true => words.iter().map(|word| label(word)).collect(),
                false => commented(comments, blank_fields, words.len(), reading.map)
                    .unwrap_or_else(|| unnamed(words.len())),
            };
            layout = Some(Layout::among(path, labels, *reading)?);
            if named {
                continue;
            }
        }
        let Some(layout) = &layout else { continue };
        memory::grow(&mut numbers, layout.stride(), path.display())?;
        memory::grow(&mut starts, 1, path.display())?;
        let word = |field: usize| words.get(field).copied();
        layout.push_row(file.source, file.start, starts.len(), word, &mut numbers)?;
        starts.push(file.start);
    }
    match layout {
        Some(layout) => layout.contents(file.source, start, numbers, starts),
        None => Ok(Contents::default()),
    }
}

/// Names of columns without any: x, y, z and the number of others.
fn unnamed(columns: usize) -> Vec<String> {
    let others = (3..columns).map(|column| format!("column {}", column + 1));
    ["x", "y", "z"].map(String::from).into_iter().chain(others).collect()
}

/// The comments before the first other line, and the delimiter of that line; `None` for blanks.
fn beginning(text: &[u8]) -> (Vec<&[u8]>, Option<u8>) {
    let mut comments = Vec::new();
    let mut first: &[u8] = &[];
    for line in text.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii) {
        match line.strip_prefix(b"#") {
            Some(comment) => comments.push(comment),
            None if line.is_empty() => {}
            None => {
                first = line;
                break;
            }
        }
    }
    let count = |delimiter: &u8| first.iter().filter(|&byte| byte == delimiter).count();
    // The last of equally frequent ones.
    let delimiter = [b'\t', b';', b','].into_iter().max_by_key(count);
    let delimiter = delimiter.filter(|delimiter| count(delimiter) > 0);
    let blanks = first.contains(&b' ');
    (comments, delimiter.or_else(|| (!blanks).then_some(b',')))
}

/// The names of all columns in a comment, as written by `NumPy`.
fn commented(
    comments: &[&[u8]],
    fields: impl Fn(&[u8]) -> Vec<String>,
    columns: usize,
    map: &AttributeMap,
) -> Option<Vec<String>> {
    comments.iter().rev().find_map(|comment| {
        let labels = fields(comment);
        let complete = labels.len() == columns && position_among(&labels, map).is_some();
        complete.then_some(labels)
    })
}

/// The labels in a line; none if it is no such line.
fn fields(line: &[u8], delimiter: u8) -> Vec<String> {
    let mut line = ReaderBuilder::new()
        .delimiter(delimiter)
        .has_headers(false)
        .trim(Trim::All)
        .from_reader(line);
    let mut record = ByteRecord::new();
    let read = line.read_byte_record(&mut record);
    if read.is_ok() { record.iter().map(label).collect() } else { Vec::new() }
}

fn blank_fields(line: &[u8]) -> Vec<String> {
    let words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    words.map(label).collect()
}

fn label(field: &[u8]) -> String {
    String::from_utf8_lossy(field).trim().trim_matches('"').to_owned()
}

/// Writes a line of names and one per particle, with the shortest digits that identify each number.
pub(super) fn write(
    particles: &Particles,
    others: &Others<'_>,
    out: &mut BufWriter<&File>,
) -> io::Result<()> {
    let attributes = super::with_others(particles, others);
    // Positions far from 0 are read as 64-bit numbers, so they need all digits to read back the same.
    let origin = || origin_for(particles.len(), |i| particles.place(i));
    let single = particles.narrow() && origin() == DVec3::ZERO;
    write!(out, "x,y,z")?;
    for &(name, values) in &attributes {
        for column in values.column_names(name) {
            write!(out, ",{column}")?;
        }
    }
    writeln!(out)?;
    for i in 0..particles.len() {
        if single {
            let [x, y, z] = particles.positions[i].to_array();
            write!(out, "{x},{y},{z}")?;
        } else {
            let [x, y, z] = particles.place(i).to_array();
            write!(out, "{x},{y},{z}")?;
        }
        for &(_, values) in &attributes {
            match values {
                Values::Integers(ids) => write!(out, ",{}", ids[i])?,
                _ => values.floats_of(i).iter().try_for_each(|x| write!(out, ",{x}"))?,
            }
        }
        writeln!(out)?;
    }
    Ok(())
}
