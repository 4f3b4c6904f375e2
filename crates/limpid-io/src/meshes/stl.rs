//! STL (3D Systems, "Stereo Lithography Interface Specification", 1989), ASCII and binary. Binary files are
//! little-endian:
//!
//! ```text
//! 80 bytes of any contents   u32 count
//! count × { f32 normal[3], corners[3][3]   u16 attribute }
//! ```
//!
//! Equal corners become one vertex. Normals are those of the triangles, so they are not read; neither are
//! the attributes, which some programs use for colours.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;

use super::{Builder, Vertex};
use crate::error::{Error, Result};
use crate::particles::cursor::Cursor;
use crate::particles::foreign;
use crate::particles::table::{Column, Scalar};

/// Length of the header of a binary file, bytes.
const HEADER: usize = 80;
/// Length of a triangle's record, bytes.
const RECORD: usize = 50;

// Our own, not the crate `stl_io` (0.11): it takes each file for text that begins with `solid `, as many
// binary ones do, and `solid` alone for binary; its errors have no lines.
pub(super) fn read(path: &Path, bytes: &[u8], mesh: &mut Builder<'_>) -> Result<()> {
    let count = bytes.get(HEADER..).and_then(|rest| rest.first_chunk().copied());
    let records = count.map(|count| u32::from_le_bytes(count) as usize);
    let left = bytes.len().saturating_sub(HEADER + 4);
    let exact = records.and_then(|records| records.checked_mul(RECORD)) == Some(left);
    let mut reader = Reader { mesh, vertices: HashMap::new() };
    let word = bytes.trim_ascii_start().get(..5).unwrap_or_default();
    if word.eq_ignore_ascii_case(b"solid") && !exact {
        return reader.text(Cursor::new(path, bytes, true));
    }
    let Some(records) = records else { return Err(foreign(path, bytes, "an STL mesh")) };
    reader.binary(Cursor::new(path, bytes, false), records)
}

struct Reader<'m, 'b> {
    mesh: &'m mut Builder<'b>,
    /// Indices of the vertices by the bits of their positions.
    vertices: HashMap<[u64; 3], u32>,
}

impl Reader<'_, '_> {
    fn binary(&mut self, mut file: Cursor<'_>, records: usize) -> Result<()> {
        file.take(HEADER + 4, "the header")?;
        let taken = file.take_records(records, RECORD, "the triangles")?;
        if !file.rest().is_empty() {
            self.mesh.remark(&format!(
                "the {} bytes after the triangles are not read",
                file.rest().len()
            ));
        }
        for (i, record) in taken.chunks_exact(RECORD).enumerate() {
            let at = HEADER + 4 + i * RECORD;
            let mut corners = [0; 3];
            for (k, corner) in corners.iter_mut().enumerate() {
                // After the normal.
                let offset = 12 * (k + 1);
                let number = |column: Column| column.number(&record[offset..], false);
                let position = DVec3::from(Column::triple(Scalar::F32).map(number));
                let fail = |problem: String| file.source.error(at + offset, problem);
                *corner = self.vertex(position, fail)?;
            }
            self.mesh.triangle(corners, 0)?;
        }
        Ok(())
    }

    fn text(&mut self, mut file: Cursor<'_>) -> Result<()> {
        let mut corners = Vec::new();
        let mut ended = false;
        while let Some(line) = file.filled_line() {
            let mut words = line.split_ascii_whitespace();
            let keyword = words.next().unwrap_or("").to_ascii_lowercase();
            match keyword.as_str() {
                "vertex" => {
                    let mut position = DVec3::ZERO;
                    for number in position.as_mut() {
                        let word =
                            words.next().ok_or_else(|| file.error("expected three numbers"))?;
                        *number = file.number(word)?;
                    }
                    corners.push(self.vertex(position, |problem| file.error(problem))?);
                }
                "facet" => corners.clear(),
                "endfacet" if corners.len() < 3 => {
                    let problem = format!("a facet of {} corners; expected three", corners.len());
                    return Err(file.error(problem));
                }
                "endfacet" => {
                    self.mesh.polygon(&corners, 0)?;
                    corners.clear();
                }
                "solid" | "outer" | "endloop" => {}
                "endsolid" => ended = true,
                _ => return Err(file.error(format!("expected a facet or vertex, found `{line}`"))),
            }
        }
        if ended { Ok(()) } else { Err(file.error("the file ends before `endsolid`")) }
    }

    /// The index of the vertex at a position.
    fn vertex(&mut self, position: DVec3, fail: impl FnOnce(String) -> Error) -> Result<u32> {
        // Adding 0 makes the negative zero positive.
        let key = (position + 0.0).to_array().map(f64::to_bits);
        if let Some(&index) = self.vertices.get(&key) {
            return Ok(index);
        }
        let index = self.mesh.vertex(Vertex { position, ..Vertex::default() }, fail)?;
        self.vertices.insert(key, index);
        Ok(index)
    }
}
