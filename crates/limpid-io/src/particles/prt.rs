//! `.prt`, the particles of Krakatoa (Thinkbox, "PRT File Format v1.1"), also written by Naiad, `FumeFX` and
//! Houdini's plug-ins. All numbers are little-endian:
//!
//! ```text
//! 0xc0 "PRT" 0x0d 0x0a 0x1a 0x0a, i32 length of this header, 32 bytes of text, i32 version, i64 particles,
//!     metadata; i32 4, i32 channels, i32 length of a channel's definition
//! channel: 32 bytes of name, i32 type, i32 numbers a particle, i32 offset in the particle
//! particles, one after the other, compressed by zlib
//! ```

use std::borrow::Cow;
use std::path::Path;

use flate2::{Decompress, FlushDecompress, Status};

use super::{Attribute, Column, Contents, Cursor, Reading, Scalar, Table, foreign};
use crate::budget::Budget;
use crate::error::{Error, Location, Result};
use crate::files::DEFLATE_RATIO;
use limpid::memory;

pub(super) const MAGIC: &[u8] = b"\xc0PRT\r\n\x1a\n";

/// The first bytes of zlib's streams with its usual settings, which are no text.
const ZLIB: &[u8] = b"\x78\x9c";

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    if !bytes.starts_with(MAGIC) {
        return Err(foreign(path, bytes, "particles of Krakatoa"));
    }
    let mut file = Cursor::new(path, bytes, false);
    file.take(MAGIC.len(), "the magic")?;
    let header = count(&mut file, "the length of the header")?;
    file.take(32 + 4, "the version")?;
    let particles = file.array("the number of particles").map(i64::from_le_bytes)?;
    let particles = usize::try_from(particles).map_err(|_| {
        file.error(format!("{particles} particles: the program that wrote it did not finish it"))
    })?;
    let before = header.checked_sub(file.offset);
    let before = before.ok_or_else(|| file.error(format!("a header of {header} bytes")))?;
    file.take(before + 4, "the header")?;
    let channels = count(&mut file, "the number of channels")?;
    let length = count(&mut file, "the length of a channel")?;
    let (mut named_columns, mut stride, mut spans) = (Vec::new(), 0_usize, Vec::new());
    for _ in 0..channels {
        // Partio counts its attributes of text, but does not define channels for them.
        if file.rest().starts_with(ZLIB) {
            break;
        }
        let definition = file.take(length.max(44), "a channel")?;
        let mut channel = Cursor { start: file.start, ..Cursor::new(path, definition, false) };
        let name = channel.take(32, "a channel")?.split(|&byte| byte == 0).next();
        let name = String::from_utf8_lossy(name.unwrap_or_default()).into_owned();
        let [kind, size, offset] = [(); 3].map(|()| count(&mut channel, "a channel").ok());
        let (Some(scalar), Some(size), Some(offset)) = (kind.and_then(scalar), size, offset) else {
            return Err(file.error(format!("channel {name} has an unknown type")));
        };
        let end = offset.saturating_add(size.saturating_mul(scalar.size()));
        stride = stride.max(end);
        spans.push((offset, end));
        const MOST: usize = 16;
        let columns = Column::adjacent(offset, if size > MOST { 0 } else { size }, scalar);
        named_columns.push((name, size, columns));
    }

    spans.sort_unstable();
    if spans.array_windows().any(|[before, after]| after.0 < before.1) {
        return Err(file.error("channels that lie in one another"));
    }

    let start = file.offset;
    let unpacked = unpack(&mut file, particles.saturating_mul(stride), reading.budget)?;
    let table = Table {
        source: file.source,
        start,
        bytes: Cow::Owned(unpacked),
        rows: particles,
        stride,
        big_endian: false,
        // All that follows is compressed.
        starts: Some(Vec::new()),
    };
    let positions = named_columns.iter().find(|(name, ..)| name == "Position");
    let Some(&[x, y, z]) = positions.map(|(_, _, columns)| columns.as_slice()) else {
        return Err(Error::format(path, "no channel Position of three numbers"));
    };
    let mut contents = table.particles([x, y, z])?;
    for (name, size, columns) in named_columns.iter().filter(|(name, ..)| name != "Position") {
        let shape = [particles, *size];
        let shape = if *size == 1 { &shape[..1] } else { &shape[..] };
        contents.keep(reading, name, &table, columns)?;
        let attribute = reading.map.attribute_of(name);
        // Krakatoa's is of its shading, without a unit.
        let shading = attribute == Some(Attribute::Density) && !reading.map.has(Attribute::Density);
        contents.take_as(attribute.filter(|_| !shading), name, shape, &table, columns)?;
        contents.find_values(reading, name, &table, columns);
    }
    Ok(contents)
}

/// Unpacks the rest of a file, of this length.
fn unpack(file: &mut Cursor<'_>, length: usize, budget: &Budget) -> Result<Vec<u8>> {
    let (path, packed) = (file.source.path, file.rest());
    file.source.take(budget, length as u64, file.offset)?;
    let possible = (packed.len() as u64).saturating_mul(DEFLATE_RATIO);
    let fail =
        |problem: String| Error::malformed(path, Location::Byte(file.offset as u64), problem);
    if length as u64 > possible {
        return Err(fail(format!("{length} bytes of particles cannot be in {}", packed.len())));
    }
    // Without particles there may be no stream.
    if length == 0 && packed.is_empty() {
        return Ok(Vec::new());
    }
    // A byte more shows whether the stream has more.
    let mut unpacked = memory::zeroed(length.saturating_add(1), path.display())?;
    let mut zlib = Decompress::new(true);
    let status = zlib.decompress(packed, &mut unpacked, FlushDecompress::Finish);
    let status = status.map_err(|error| fail(format!("the particles are damaged: {error}")))?;
    let (found, rest) = (zlib.total_out() as usize, packed.len() as u64 - zlib.total_in());
    let problem = match status {
        _ if found > length => format!("more than the {length} bytes of particles that it says"),
        Status::StreamEnd if found < length => {
            format!("{length} bytes of particles expected, found {found}")
        }
        // The end has a checksum.
        Status::Ok | Status::BufError => "the particles are cut off".into(),
        Status::StreamEnd if rest > 0 => format!("{rest} bytes follow the particles"),
        Status::StreamEnd => {
            unpacked.truncate(length);
            return Ok(unpacked);
        }
    };
    Err(fail(problem))
}

fn count(file: &mut Cursor<'_>, what: &str) -> Result<usize> {
    let count = file.array(what).map(i32::from_le_bytes)?;
    count.try_into().map_err(|_| file.error(format!("{what}: expected 0 or more, found {count}")))
}

fn scalar(kind: usize) -> Option<Scalar> {
    Some(match kind {
        0 => Scalar::I16,
        1 => Scalar::I32,
        2 => Scalar::I64,
        3 => Scalar::F16,
        4 => Scalar::F32,
        5 => Scalar::F64,
        6 => Scalar::U16,
        7 => Scalar::U32,
        8 => Scalar::U64,
        9 => Scalar::I8,
        10 => Scalar::U8,
        _ => return None,
    })
}
