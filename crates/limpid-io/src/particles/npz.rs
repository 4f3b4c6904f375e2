//! `.npz`, a zip archive of numpy arrays (`numpy.savez`, `numpy.savez_compressed`): each attribute is a
//! member `NAME.npy`, stored or deflated.

use std::fs::File;
use std::io::{self, BufWriter, Read};
use std::path::{Path, PathBuf};

use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

use super::npy::{self, Header};
use super::{
    Attribute, AttributeMap, Column, Contents, Cursor, Particles, Reading, Table, Values, foreign,
    write_numbers,
};
use crate::error::{Error, Location, Result, printable};
use crate::files::DEFLATE_RATIO;
use limpid::memory;

/// Names of positions, the most likely first; numpy calls the first array without a name `arr_0`.
const POSITIONS: [&str; 7] =
    ["positions", "position", "pos", "x", "points", "coordinates", "arr_0"];

type Archive<'a> = ZipArchive<io::Cursor<&'a [u8]>>;

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    if !bytes.starts_with(b"PK\x03\x04") && !bytes.starts_with(b"PK\x05\x06") {
        return Err(foreign(path, bytes, "an archive of NumPy arrays"));
    }
    let mut archive = ZipArchive::new(io::Cursor::new(bytes))
        .map_err(|error| damaged(path, &format!("the zip archive is damaged: {error}")))?;
    let mut arrays = Vec::new();
    for index in 0..archive.len() {
        let name = match archive.by_index(index) {
            Ok(member) => String::from_utf8_lossy(member.name_raw()).into_owned(),
            Err(error) => return Err(damaged(path, &format!("member {index}: {error}"))),
        };
        if let Some(name) = name.strip_suffix(".npy") {
            arrays.push((index, name.to_owned()));
        }
    }
    let (limit, map) = (reading.limit, reading.map);
    let packed = bytes.len() as u64;
    let mut archive = Members { path, archive, packed, limit, used: 0 };
    let headers = headers(&mut archive, &arrays)?;
    let positions = find_positions(path, map, &arrays, &headers)?;
    let mut contents = {
        let (index, name) = &arrays[positions];
        let path = archive.display_path(name);
        let bytes = archive.unpack(*index, name, usize::MAX)?;
        // The positions take no more memory than their array.
        archive.count(bytes.len() as u64, name)?;
        let mut file = Cursor::new(&path, &bytes, false);
        Contents::from(Header::read(&mut file)?.positions(&mut file)?)
    };
    let others = arrays.iter().zip(&headers).enumerate().filter(|(at, _)| *at != positions);
    for (_, ((index, name), header)) in others {
        let shape = header.as_ref().map(Header::shape).unwrap_or_default();
        let attribute = map.attribute_of(name);
        // The first array of an attribute is used, and no other is unpacked.
        let has = |attribute: Attribute| {
            super::attribute_names(&contents.particles).any(|has| has == attribute.name())
        };
        let Some(attribute) = attribute.filter(|&attribute| !has(attribute)) else {
            contents.list(name, &shape, None);
            continue;
        };
        let path = archive.display_path(name);
        let bytes = archive.unpack(*index, name, usize::MAX)?;
        let mut file = Cursor::new(&path, &bytes, false);
        let Some((table, columns)) = Header::read(&mut file)?.table(&mut file, name)? else {
            contents.list(name, &shape, None);
            continue;
        };
        let table = broadcast(table, &columns, attribute, &shape, contents.particles.len());
        archive.count(attribute.bytes().saturating_mul(table.rows as u64), name)?;
        contents.take_as(Some(attribute), name, &shape, &table, &columns)?;
    }
    Ok(contents)
}

/// Repeats a single radius or density for all particles.
fn broadcast<'a>(
    table: Table<'a>,
    columns: &[Column],
    attribute: Attribute,
    shape: &[usize],
    rows: usize,
) -> Table<'a> {
    let single = matches!(attribute, Attribute::Radius | Attribute::Density);
    match columns {
        [column] if single && matches!(shape, [] | [1]) && rows != 1 => {
            Table { rows, stride: 0, bytes: table.bytes, ..table }
        }
        _ => table,
    }
}

/// Reads the headers of all arrays; `None` for members without a valid one.
fn headers(archive: &mut Members<'_>, arrays: &[(usize, String)]) -> Result<Vec<Option<Header>>> {
    /// Size that suffices for the header of any array of plain numbers, bytes.
    const MAX_HEADER: usize = 1 << 12;
    let mut header = |(index, name): &(usize, String)| {
        let path = archive.display_path(name);
        let start = archive.unpack(*index, name, MAX_HEADER)?;
        Ok(Header::read(&mut Cursor::new(&path, &start, false)).ok())
    };
    arrays.iter().map(&mut header).collect()
}

/// Finds the array of the positions.
fn find_positions(
    path: &Path,
    map: &AttributeMap,
    arrays: &[(usize, String)],
    headers: &[Option<Header>],
) -> Result<usize> {
    let triples = headers.iter().enumerate();
    let triples = triples.filter(|(_, header)| header.as_ref().is_some_and(Header::triples));
    let triples: Vec<(usize, &str)> = triples.map(|(at, _)| (at, arrays[at].1.as_str())).collect();
    positions_among(&triples, map).ok_or_else(|| {
        let names: Vec<&str> = arrays.iter().take(8).map(|(_, name)| name.as_str()).collect();
        let problem = format!(
            "no array `{}` of shape (n, 3) of floats, nor a single other one; there are: {}",
            POSITIONS.join("`, `"),
            names.join(", ")
        );
        Error::format(path, problem)
    })
}

/// Chooses the positions among arrays of triples, with their numbers: by their name, or the only one that is
/// no attribute.
pub(super) fn positions_among(triples: &[(usize, &str)], map: &AttributeMap) -> Option<usize> {
    let named = POSITIONS
        .iter()
        .find_map(|known| triples.iter().find(|(_, name)| name.eq_ignore_ascii_case(known)));
    let other = || {
        let mut others = triples.iter().filter(|(_, name)| map.attribute_of(name).is_none());
        others.next().filter(|_| others.next().is_none())
    };
    named.or_else(other).map(|&(at, _)| at)
}

/// An archive, with a limit of its unpacked size.
struct Members<'a> {
    path: &'a Path,
    archive: Archive<'a>,
    /// Size of the file, bytes.
    packed: u64,
    /// Limit of the unpacked members and the attributes read from them, bytes.
    limit: u64,
    /// Their size so far, bytes.
    used: u64,
}

impl Members<'_> {
    /// Path of a member for messages.
    fn display_path(&self, name: &str) -> PathBuf {
        format!("{} ({}.npy)", self.path.display(), printable(name.into())).into()
    }

    fn too_large(&self, name: &str, byte: u64) -> Error {
        let (path, location) = (self.display_path(name), Location::Byte(byte));
        Error::TooLarge { path, location, what: "file", limit: self.limit }
    }

    /// Counts the bytes read from a member; fails beyond the limit.
    fn count(&mut self, bytes: u64, name: &str) -> Result<()> {
        self.used = self.used.saturating_add(bytes);
        if self.used <= self.limit {
            return Ok(());
        }
        Err(self.too_large(name, 0))
    }

    /// Unpacks at most `length` bytes of a member.
    fn unpack(&mut self, index: usize, name: &str, length: usize) -> Result<Vec<u8>> {
        let path = self.display_path(name);
        let fail = |unpacked: usize, problem: String| {
            Error::malformed(&path, Location::Byte(unpacked as u64), problem)
        };
        let member = self.archive.by_index(index);
        let member = member.map_err(|error| fail(0, format!("cannot be unpacked: {error}")))?;
        let left = self.limit.saturating_sub(self.used);
        let limit = (length as u64).min(left.saturating_add(1));
        // The stated size may be wrong, but is bounded by the ratio of deflate.
        let claim = member.size().min(self.packed.saturating_mul(DEFLATE_RATIO)).min(limit);
        let mut unpacked = memory::reserve(usize::try_from(claim).unwrap_or(0), path.display())?;
        if let Err(error) = member.take(limit).read_to_end(&mut unpacked) {
            if error.kind() == io::ErrorKind::OutOfMemory {
                return Err(Error::io(&path, "unpack", error));
            }
            return Err(fail(
                unpacked.len(),
                format!("the archive is damaged or cut off: {error}"),
            ));
        }
        if unpacked.len() as u64 > left {
            return Err(self.too_large(name, unpacked.len() as u64 - 1));
        }
        // Headers are not counted, since they are not kept.
        if length == usize::MAX {
            self.used += unpacked.len() as u64;
        }
        Ok(unpacked)
    }
}

fn damaged(path: &Path, problem: &str) -> Error {
    Error::malformed(path, Location::Byte(0), problem)
}

/// Writes the positions and all attributes without compression, since deflate saves little on floats.
pub(crate) fn write(particles: &Particles, out: &mut BufWriter<&File>) -> io::Result<()> {
    let n = particles.len();
    // Members of more than 4 GiB need a zip64 header, which is written first.
    let options = SimpleFileOptions::default()
        .compression_method(zip::CompressionMethod::Stored)
        .large_file(n >= u32::MAX as usize / size_of::<[f64; 3]>());
    let mut archive = ZipWriter::new_stream(out);
    archive.start_file("positions.npy", options)?;
    npy::write_positions(particles, &mut archive)?;
    for (name, values) in super::attributes(particles) {
        archive.start_file(format!("{name}.npy"), options)?;
        match values {
            Values::Integers(ids) => {
                npy::write_header("<i8", n, 1, &mut archive)?;
                write_numbers(ids, i64::to_le_bytes, &mut archive)?;
            }
            _ => {
                npy::write_header("<f4", n, values.size(), &mut archive)?;
                write_numbers(values.floats(), f32::to_le_bytes, &mut archive)?;
            }
        }
    }
    archive.finish()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    /// A small archive that unpacks to a huge one is refused at the limit.
    #[test]
    fn unpacking_stops_at_the_limit() {
        let mut zip = ZipWriter::new(io::Cursor::new(Vec::new()));
        zip.start_file("a.npy", SimpleFileOptions::default()).unwrap();
        zip.write_all(&[0; 1000]).unwrap();
        let bytes = zip.finish().unwrap().into_inner();
        let unpack = |limit| {
            let archive = ZipArchive::new(io::Cursor::new(&bytes[..])).unwrap();
            let (path, packed) = (Path::new("bomb.npz"), bytes.len() as u64);
            Members { path, archive, packed, limit, used: 0 }.unpack(0, "a", usize::MAX)
        };
        assert_eq!(unpack(1000).unwrap().len(), 1000);
        let error = unpack(999).unwrap_err().to_string();
        assert!(error.contains("bomb.npz") && error.contains("more than 999 bytes"), "{error}");
    }
}
