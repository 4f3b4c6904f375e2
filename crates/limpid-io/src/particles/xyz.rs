//! `.xyz`: positions only, without a header. Two formats have this name: raw little-endian f32 triples,
//! as read and written by splashsurf, and text with the three coordinates of one particle per line, as
//! written by point-cloud tools.
//!
//! Text that begins with the number of particles is extended XYZ: [`super::extxyz`].
//!
//! A file whose first kilobyte is printable ASCII is text, which floats almost never are.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::Path;

use glam::Vec3;
use rayon::prelude::*;

use super::{
    Column, Contents, Cursor, Others, Particles, Reading, Scalar, Table, extxyz, foreign,
    known_magic, stl_length,
};
use crate::error::{Error, Location, Result};
use crate::files;
use limpid::camera::is_position;
use limpid::memory;

/// Reads raw floats directly into the positions, in half the time of reading the bytes first. `None` on
/// any failure, which [`read`] then reports.
pub(crate) fn read_raw(path: &Path, limit: u64) -> Option<Particles> {
    /// Number of positions per block, few enough to stay in the CPU's cache until they are checked.
    const BLOCK: usize = 1 << 14;
    let (mut file, metadata) = files::open(path).ok()?;
    let length = metadata.len();
    if length > limit {
        return None;
    }
    let mut start = Vec::new();
    (&mut file).take(TEXT_SAMPLE as u64).read_to_end(&mut start).ok()?;
    let foreign = known_magic(&start).is_some() || stl_length(&start) == Some(length);
    if length % 12 != 0 || foreign || is_text(&start) || cfg!(target_endian = "big") {
        return None;
    }
    let rows = usize::try_from(length / 12).ok()?;
    let mut positions: Vec<Vec3> = bytemuck::allocation::try_zeroed_vec(rows).ok()?;
    let blocks = positions.par_chunks_mut(BLOCK).enumerate();
    let valid = blocks.map(|(i, block)| {
        let offset = (i * BLOCK * size_of::<Vec3>()) as u64;
        files::read_at(&file, bytemuck::cast_slice_mut(block), offset).is_ok()
            && block.iter().all(|x| is_position(x.as_dvec3()))
    });
    let valid = valid.reduce(|| true, |a, b| a & b);
    let valid = valid && files::unchanged(path, &file, &metadata).is_ok();
    valid.then(|| Particles::from_positions(positions))
}

/// Fails if a file of raw floats with this start cannot have this length.
pub(crate) fn check_length(path: &Path, start: &[u8], length: u64) -> Result<()> {
    let left = length % 12;
    if is_text(start) || left == 0 {
        return Ok(());
    }
    let problem = format!("particle {}: expected 12 bytes, {left} are left", length / 12);
    Err(Error::malformed(path, Location::Byte(length - left), problem))
}

/// Whether a file with this start and length appears to contain positions.
pub(super) fn is_sound(path: &Path, head: &[u8], length: u64, reading: &Reading<'_>) -> bool {
    let last = |is_end: fn(&u8) -> bool| head.iter().rposition(is_end).map_or(0, |at| at + 1);
    let end = match (head.len() as u64 == length, is_text(head)) {
        (true, _) => head.len(),
        (false, true) => last(|&byte| byte == b'\n'),
        (false, false) => head.len() / 12 * 12,
    };
    let sound = |contents: Contents| contents.unplaced.is_none();
    check_length(path, head, length).is_ok() && read(path, &head[..end], reading).is_ok_and(sound)
}

/// Number of bytes by which text is distinguished from floats.
const TEXT_SAMPLE: usize = 1024;

fn is_text(bytes: &[u8]) -> bool {
    let printable = |byte: &u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
    !bytes.is_empty() && bytes.iter().take(TEXT_SAMPLE).all(printable)
}

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    if known_magic(bytes).is_some() {
        return Err(foreign(path, bytes, "raw or text positions"));
    }
    let text = is_text(bytes);
    if text && extxyz::is_counted(bytes) {
        return extxyz::read(path, bytes, reading);
    }
    let mut file = Cursor::new(path, bytes, text);
    let (table, scalar) = if text {
        (text_table(&mut file)?, Scalar::F64)
    } else {
        let rows = bytes.len() / 12;
        let table = file.table(rows, 12, false, "positions")?;
        let left = file.rest().len();
        if left != 0 {
            file.start = file.offset;
            let problem = format!("particle {rows}: expected 12 bytes, {left} are left");
            return Err(file.error(problem));
        }
        (table, Scalar::F32)
    };
    table.particles(Column::triple(scalar))
}

/// Writes raw floats.
pub(super) fn write(
    particles: &Particles,
    _: &Others<'_>,
    out: &mut BufWriter<&File>,
) -> io::Result<()> {
    (0..particles.len()).try_for_each(|i| {
        let position = particles.single_place(i).to_array();
        out.write_all(position.map(f32::to_le_bytes).as_flattened())
    })
}

fn text_table<'a>(file: &mut Cursor<'a>) -> Result<Table<'a>> {
    let mut bytes = Vec::new();
    let mut starts = Vec::new();
    while let Some(line) = file.filled_line() {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let &[x, y, z] = words.as_slice() else {
            let problem = format!(
                "particle {}: expected x, y and z, found {} words",
                starts.len(),
                words.len()
            );
            return Err(file.error(problem));
        };
        memory::grow(&mut bytes, size_of::<[f64; 3]>(), file.source.path.display())?;
        memory::grow(&mut starts, 1, file.source.path.display())?;
        for word in [x, y, z] {
            bytes.extend(file.number(word)?.to_le_bytes());
        }
        starts.push(file.start);
    }
    Ok(Table {
        source: file.source,
        start: 0,
        bytes: Cow::Owned(bytes),
        rows: starts.len(),
        stride: 3 * Scalar::F64.size(),
        big_endian: false,
        starts: Some(starts),
    })
}
