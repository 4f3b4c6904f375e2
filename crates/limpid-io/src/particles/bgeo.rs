//! BGEO version 5, Houdini's classic binary geometry, as written by Partio (Walt Disney Animation
//! Studios, `BGEO.cpp`) and by the simulator SPlisHSPlasH, which uses it.
//!
//! All numbers are big-endian, and the whole file may be compressed by gzip:
//!
//! ```text
//! "Bgeo" 'V'  i32 version = 5
//! i32 points, primitives, point groups, primitive groups,
//!     point attributes, vertex attributes, primitive attributes, detail attributes
//! each point attribute: u16 length, name, u16 size, i32 type, defaults
//! each point: f32 x, y, z, w, then size × 4 bytes per attribute
//! ```
//!
//! Primitives, groups and detail attributes follow the points and are not read; limpid writes none.

use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, Read, Write};
use std::path::Path;

use flate2::read::MultiGzDecoder;
use flate2::{Compression, write::GzEncoder};

use super::{
    Column, Contents, Cursor, Others, POSITION_BYTES, Particles, Reading, Scalar, Values, foreign,
    houdini, narrow_id, scf, too_large,
};
use crate::budget::Budget;
use crate::error::{Error, Location, Result};
use crate::files::DEFLATE_RATIO;
use limpid::memory;

/// Reads this format, or the one that succeeded it under the same name.
pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    let parse = |bytes: &[u8]| {
        let parse = if houdini::is_geometry(bytes) { houdini::parse } else { parse };
        parse(path, bytes, reading)
    };
    if bytes.starts_with(&[0x1f, 0x8b]) {
        parse(&unpack(path, bytes, reading.budget)?)
    } else if scf::is_container(bytes) {
        parse(&scf::unpack(path, bytes, reading.budget)?)
    } else {
        parse(bytes)
    }
}

/// Unpacks gzip, which takes the bytes of the budget.
pub(super) fn unpack(path: &Path, bytes: &[u8], budget: &Budget) -> Result<Vec<u8>> {
    let limit = budget.left();
    // Reserves the length stated in the file, as far as deflate can reach it, to avoid reallocations.
    let length = bytes.last_chunk().map_or(0, |&length| u64::from(u32::from_le_bytes(length)));
    let length = length.min(DEFLATE_RATIO.saturating_mul(bytes.len() as u64)).min(limit);
    let mut unpacked = memory::reserve(usize::try_from(length).unwrap_or(0), path.display())?;
    let result =
        MultiGzDecoder::new(bytes).take(limit.saturating_add(1)).read_to_end(&mut unpacked);
    let length = unpacked.len() as u64;
    if let Err(error) = result {
        if error.kind() == ErrorKind::OutOfMemory {
            return Err(Error::io(path, "unpack", error));
        }
        let problem = format!("the gzip stream is damaged or cut off: {error}");
        return Err(Error::malformed(path, Location::Byte(length), problem));
    }
    budget.take(length, path, Location::Byte(limit))?;
    Ok(unpacked)
}

pub(super) fn write_gzip(
    particles: &Particles,
    others: &Others<'_>,
    out: &mut BufWriter<&File>,
) -> io::Result<()> {
    let mut gzip = GzEncoder::new(out, Compression::fast());
    encode(particles, others, &mut gzip)?;
    gzip.finish().map(drop)
}

pub(super) fn write(
    particles: &Particles,
    others: &Others<'_>,
    out: &mut BufWriter<&File>,
) -> io::Result<()> {
    encode(particles, others, out)
}

/// The file of particles in memory.
///
/// # Errors
/// As [`crate::particles::write`].
pub fn to_bytes(particles: &Particles) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    encode(particles, &[], &mut bytes)?;
    Ok(bytes)
}

/// Writes the points with the attributes that they have; the radius under Houdini's name `pscale`.
fn encode(particles: &Particles, others: &Others<'_>, out: &mut impl Write) -> io::Result<()> {
    const FLOAT: i32 = 0;
    const INTEGER: i32 = 1;
    const VECTOR: i32 = 5;
    let points = i32::try_from(particles.len())
        .map_err(|_| too_large("BGEO holds at most 2147483647 particles"))?;
    let attributes = super::with_others(particles, others);

    out.write_all(b"BgeoV")?;
    for number in [5, points, 0, 0, 0, attributes.len() as i32, 0, 0, 0] {
        out.write_all(&number.to_be_bytes())?;
    }
    for &(name, values) in &attributes {
        let name = if name == "radius" { "pscale" } else { name };
        let kind = match values {
            Values::Integers(_) => INTEGER,
            Values::Vectors(_) => VECTOR,
            Values::Floats(_) | Values::Ellipsoids(_) => FLOAT,
        };
        out.write_all(&(name.len() as u16).to_be_bytes())?;
        out.write_all(name.as_bytes())?;
        out.write_all(&(values.size() as u16).to_be_bytes())?;
        out.write_all(&kind.to_be_bytes())?;
        out.write_all(&[0; 24][..4 * values.size()])?;
    }
    let mut record = Vec::new();
    for i in 0..particles.len() {
        record.clear();
        let position = particles.single_place(i);
        let point = [position.x, position.y, position.z, 1.0];
        record.extend(point.map(f32::to_be_bytes).as_flattened());
        for &(_, values) in &attributes {
            match values {
                Values::Integers(ids) => record.extend(narrow_id(ids[i], "BGEO")?.to_be_bytes()),
                _ => record.extend(values.floats_of(i).iter().flat_map(|x| x.to_be_bytes())),
            }
        }
        out.write_all(&record)?;
    }
    // The end of the primitives.
    out.write_all(&[0x00, 0xff])
}

/// Parses an unpacked file.
fn parse(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    if !bytes.starts_with(b"BgeoV") {
        return Err(foreign(path, bytes, "a BGEO file of version 5"));
    }
    let mut file = Cursor::new(path, bytes, false);
    file.take(5, "the magic")?;
    let version = int(&mut file, "the version")?;
    if version != 5 {
        let problem = format!("BGEO version {version}; only version 5 (.bhclassic) can be read");
        return Err(Error::format(path, problem));
    }
    let points = count(&mut file, "the number of points")?;
    let others = file.take(3 * 4, "the header")?.iter().any(|&byte| byte != 0);
    let attributes = count(&mut file, "the number of point attributes")?;
    let others = others | file.take(3 * 4, "the header")?.iter().any(|&byte| byte != 0);

    let mut stride = 4 * Scalar::F32.size(); // x, y, z, and w, which is 1
    let mut named_columns = Vec::new();
    let mut read = POSITION_BYTES;
    for _ in 0..attributes {
        let length = file.array("an attribute's name").map(u16::from_be_bytes)?;
        let name = String::from_utf8_lossy(file.take(length.into(), "an attribute's name")?);
        let size = usize::from(file.array("an attribute's size").map(u16::from_be_bytes)?);
        let columns = match int(&mut file, "an attribute's type")? {
            0 | 5 => Column::adjacent(stride, skip_defaults(&mut file, size)?, Scalar::F32),
            1 => Column::adjacent(stride, skip_defaults(&mut file, size)?, Scalar::I32),
            4 => {
                skip_strings(&mut file)?;
                Vec::new()
            }
            other => {
                let problem = format!(
                    "attribute {name} has type {other}; expected 0 (float), 1 (integer), 4 (string) or 5 (vector)"
                );
                return Err(file.error(problem));
            }
        };
        read = read.saturating_add(reading.bytes_of(&name));
        named_columns.push((name, size, columns));
        stride = stride.saturating_add(4 * size);
    }

    let table = file.table(points, stride, true, "points")?;
    // Without primitives, groups and details only an end of two bytes may follow.
    let left = file.rest().strip_suffix(&[0x00, 0xff]).unwrap_or_else(|| file.rest()).len();
    if !others && left >= stride && left.is_multiple_of(stride) {
        let more = left / stride;
        return Err(file.error(format!("{points} points announced, but {more} more follow")));
    }
    file.source.take(reading.budget, read.saturating_mul(points as u64), file.start)?;
    let mut contents = table.particles(Column::triple(Scalar::F32))?;
    for (name, size, columns) in &named_columns {
        match columns.as_slice() {
            // Strings.
            [] => contents.list(name, &[points, *size], None),
            columns => contents.take(reading, name, &table, columns)?,
        }
    }
    Ok(contents)
}

fn skip_defaults(file: &mut Cursor<'_>, size: usize) -> Result<usize> {
    file.take_records(size, 4, "an attribute's defaults")?;
    Ok(size)
}

/// Skips the table of strings to which an attribute's entries are indices.
fn skip_strings(file: &mut Cursor<'_>) -> Result<()> {
    for _ in 0..count(file, "an attribute's number of strings")? {
        let length = file.array("an attribute's strings").map(u16::from_be_bytes)?;
        file.take(length.into(), "an attribute's strings")?;
    }
    Ok(())
}

fn int(file: &mut Cursor<'_>, what: &str) -> Result<i32> {
    file.array(what).map(i32::from_be_bytes)
}

fn count(file: &mut Cursor<'_>, what: &str) -> Result<usize> {
    let count = int(file, what)?;
    count.try_into().map_err(|_| file.error(format!("{what}: expected 0 or more, found {count}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A small file that unpacks to a huge one is refused at the limit.
    #[test]
    fn unpacking_stops_at_the_limit() {
        let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
        gzip.write_all(&[0; 1000]).unwrap();
        let gzip = gzip.finish().unwrap();
        let path = Path::new("bomb.bgeo");
        let unpack = |limit| unpack(path, &gzip, &Budget::new(Some(limit)));
        assert_eq!(unpack(1000).unwrap().len(), 1000);
        let error = unpack(999).unwrap_err().to_string();
        assert!(
            error.contains("bomb.bgeo: byte 999: the file unpacks to more than 999"),
            "{error}"
        );
    }
}
