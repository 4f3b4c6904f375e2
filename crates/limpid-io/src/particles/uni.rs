//! `.uni`, the particles of mantaflow, also in Blender, by the source of its `fileio`. The whole file is
//! compressed by gzip, and all numbers are little-endian:
//!
//! ```text
//! "PB02", i32 particles, i32 cells of the grid along x, y and z, i32 type = 0, i32 bytes of a particle = 16,
//!     256 bytes of text, u64 time; each particle: f32 x, y, z in cells, i32 flags
//! ```
//!
//! Velocities are in a file of their own, and not read. Particles that are to be deleted are left out.

use std::path::Path;

use super::{Column, Contents, Cursor, POSITION_BYTES, Reading, Scalar, bgeo, foreign};
use crate::error::{Error, Result};

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    let unpacked;
    let bytes = if bytes.starts_with(&[0x1f, 0x8b]) {
        unpacked = bgeo::unpack(path, bytes, reading.budget)?;
        &unpacked
    } else {
        bytes
    };
    let other = match bytes.get(..4) {
        Some(b"PB02") => None,
        Some(b"PD01") => Some("one attribute of mantaflow's particles; name the file of positions"),
        Some(b"MNT1" | b"MNT2" | b"MNT3" | b"M4T3") => Some("a grid of mantaflow, not particles"),
        _ => return Err(foreign(path, bytes, "particles of mantaflow (PB02)")),
    };
    if let Some(other) = other {
        return Err(Error::format(path, other));
    }
    let mut file = Cursor::new(path, bytes, false);
    file.take(4, "the magic")?;
    let particles = file.array("the number of particles").map(i32::from_le_bytes)?;
    let particles = usize::try_from(particles)
        .map_err(|_| file.error(format!("{particles} particles, expected 0 or more")))?;
    file.take(4 * 4, "the header")?;
    let size = file.array("the size of a particle").map(u32::from_le_bytes)?;
    if size != 16 {
        return Err(file.error(format!("expected particles of 16 bytes, found {size}")));
    }
    file.take(256 + 8, "the header")?;
    let table = file.table(particles, 16, false, "particles")?;
    let left = file.rest().len();
    if left > 0 {
        file.start = file.offset;
        return Err(file.error(format!("{left} bytes follow the {particles} particles")));
    }
    file.source.take(reading.budget, POSITION_BYTES * table.rows as u64, table.start)?;
    let mut contents = table.particles(Column::triple(Scalar::F32))?;
    /// Flags of particles that are to be deleted, and of those that are gone.
    const GONE: u32 = 1 << 10 | 1 << 30;
    let there: Vec<bool> = table
        .bytes
        .chunks_exact(16)
        .map(|row| row.last_chunk().map_or(0, |&flags| u32::from_le_bytes(flags)) & GONE == 0)
        .collect();
    contents.keep(reading, "flags", &table, &[Column { offset: 12, scalar: Scalar::I32 }])?;
    for (_, flags) in &mut contents.columns {
        let mut i = 0..;
        flags.retain(|_| i.next().is_some_and(|i: usize| there[i]));
    }
    contents.particles.retain(|i| there[i]);
    contents.list("flags", &[table.rows], None);
    Ok(contents)
}
