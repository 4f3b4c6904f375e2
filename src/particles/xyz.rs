//! `.xyz`: positions and nothing else, without a header. Two kinds go by this name:
//! raw little-endian f32 triples, as splashsurf reads and writes them, and text with the three
//! coordinates of one particle a line, as point-cloud tools write it.
//!
//! A file whose first kilobyte is printable ASCII is text: floats almost never are.

use std::borrow::Cow;
use std::path::Path;

use super::{Column, Cursor, Particles, Scalar, Table, foreign, known_magic};
use crate::error::Result;

pub(crate) fn read(path: &Path, bytes: &[u8]) -> Result<Particles> {
    if known_magic(bytes).is_some() {
        return Err(foreign(path, bytes, "raw or text positions"));
    }
    let printable = |byte: &u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
    let text = !bytes.is_empty() && bytes.iter().take(1024).all(printable);
    let mut file = Cursor::new(path, bytes, text);
    let (table, scalar) = if text {
        (text_table(&mut file)?, Scalar::F64)
    } else {
        let rows = bytes.len() / 12;
        let table = file.table(rows, 12, false, "positions")?;
        let left = file.rest().len();
        if left != 0 {
            file.start = file.offset;
            let problem = format!("particle {rows}: 12 bytes expected, {left} are left");
            return Err(file.error(problem));
        }
        (table, Scalar::F32)
    };
    table.particles(Column::triple(scalar))
}

fn text_table<'a>(file: &mut Cursor<'a>) -> Result<Table<'a>> {
    let mut bytes = Vec::new();
    let mut starts = Vec::new();
    while let Some(line) = file.filled_line() {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let &[x, y, z] = words.as_slice() else {
            let problem = format!(
                "particle {}: x, y and z expected, found {} words",
                starts.len(),
                words.len()
            );
            return Err(file.error(problem));
        };
        for word in [x, y, z] {
            bytes.extend(file.number(word)?.to_le_bytes());
        }
        starts.push(file.start);
    }
    Ok(Table {
        source: file.source,
        start: 0,
        bytes: Cow::Owned(bytes),
        stride: 3 * Scalar::F64.size(),
        big_endian: false,
        starts: Some(starts),
    })
}
