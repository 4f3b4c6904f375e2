//! `.npz`, a zip archive of numpy's arrays (`numpy.savez`, `numpy.savez_compressed`): each
//! attribute is a member `NAME.npy`, stored or deflated.

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

/// What positions are called, the likeliest first; numpy calls arrays without a name `arr_0`.
const POSITIONS: [&str; 6] = ["positions", "position", "pos", "x", "points", "arr_0"];

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
    let mut archive = Members { path, archive, packed, limit, taken: 0 };
    let heads = heads(&mut archive, &arrays)?;
    let places = positions(path, map, &arrays, &heads)?;
    let mut contents = {
        let (index, name) = &arrays[places];
        let path = archive.named(name);
        let bytes = archive.unpack(*index, name, usize::MAX)?;
        // No more than the array itself.
        archive.take(bytes.len() as u64, name)?;
        let mut file = Cursor::new(&path, &bytes, false);
        Contents::from(Header::read(&mut file)?.positions(&mut file)?)
    };
    let others = arrays.iter().zip(&heads).enumerate().filter(|(at, _)| *at != places);
    for (_, ((index, name), head)) in others {
        let shape = head.as_ref().map(Header::shape).unwrap_or_default();
        let attribute = map.attribute_of(name);
        // The first of several counts, and no other is unpacked.
        let has = |attribute: Attribute| {
            super::attribute_names(&contents.particles).any(|has| has == attribute.name())
        };
        let Some(attribute) = attribute.filter(|&attribute| !has(attribute)) else {
            contents.list(name, &shape, None);
            continue;
        };
        let path = archive.named(name);
        let bytes = archive.unpack(*index, name, usize::MAX)?;
        let mut file = Cursor::new(&path, &bytes, false);
        let Some((table, columns)) = Header::read(&mut file)?.table(&mut file, name)? else {
            contents.list(name, &shape, None);
            continue;
        };
        let table = for_all(table, &columns, attribute, &shape, contents.particles.len());
        archive.take(attribute.bytes().saturating_mul(table.rows as u64), name)?;
        contents.take_as(Some(attribute), name, &shape, &table, &columns)?;
    }
    Ok(contents)
}

/// One radius or density that holds for all particles, as one for each.
fn for_all<'a>(
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

/// The headers of all arrays; none of what is no array of plain numbers.
fn heads(archive: &mut Members<'_>, arrays: &[(usize, String)]) -> Result<Vec<Option<Header>>> {
    /// Enough for the header of any array of plain numbers.
    const HEADER: usize = 1 << 12;
    let mut head = |(index, name): &(usize, String)| {
        let path = archive.named(name);
        let start = archive.unpack(*index, name, HEADER)?;
        Ok(Header::read(&mut Cursor::new(&path, &start, false)).ok())
    };
    arrays.iter().map(&mut head).collect()
}

/// Which array holds the positions.
fn positions(
    path: &Path,
    map: &AttributeMap,
    arrays: &[(usize, String)],
    heads: &[Option<Header>],
) -> Result<usize> {
    let triples = heads.iter().enumerate();
    let triples = triples.filter(|(_, head)| head.as_ref().is_some_and(Header::triples));
    let triples: Vec<(usize, &str)> = triples.map(|(at, _)| (at, arrays[at].1.as_str())).collect();
    let named = POSITIONS
        .iter()
        .find_map(|known| triples.iter().find(|(_, name)| name.eq_ignore_ascii_case(known)));
    let other = || {
        let mut others = triples.iter().filter(|(_, name)| map.attribute_of(name).is_none());
        others.next().filter(|_| others.next().is_none())
    };
    named.or_else(other).map(|&(at, _)| at).ok_or_else(|| {
        let there: Vec<&str> = arrays.iter().take(8).map(|(_, name)| name.as_str()).collect();
        let problem = format!(
            "no array `{}` of shape (n, 3) of floats, nor a single other one; there are: {}",
            POSITIONS.join("`, `"),
            there.join(", ")
        );
        Error::format(path, problem)
    })
}

struct Members<'a> {
    path: &'a Path,
    archive: Archive<'a>,
    /// Bytes of the file.
    packed: u64,
    /// Bytes that all members, and what is read from them, may take.
    limit: u64,
    /// Bytes that they have taken.
    taken: u64,
}

impl Members<'_> {
    /// How a member is told in messages.
    fn named(&self, name: &str) -> PathBuf {
        format!("{} ({}.npy)", self.path.display(), printable(name.into())).into()
    }

    fn too_large(&self, name: &str, byte: u64) -> Error {
        let (path, location) = (self.named(name), Location::Byte(byte));
        Error::TooLarge { path, location, what: "file", limit: self.limit }
    }

    /// Counts what is read from a member.
    fn take(&mut self, bytes: u64, name: &str) -> Result<()> {
        self.taken = self.taken.saturating_add(bytes);
        if self.taken <= self.limit {
            return Ok(());
        }
        Err(self.too_large(name, 0))
    }

    /// The contents of a member, at most `length` of its bytes.
    fn unpack(&mut self, index: usize, name: &str, length: usize) -> Result<Vec<u8>> {
        let path = self.named(name);
        let fail = |unpacked: usize, problem: String| {
            Error::malformed(&path, Location::Byte(unpacked as u64), problem)
        };
        let member = self.archive.by_index(index);
        let member = member.map_err(|error| fail(0, format!("cannot be unpacked: {error}")))?;
        let left = self.limit.saturating_sub(self.taken);
        let limit = (length as u64).min(left.saturating_add(1));
        // The sizes are claims; deflate cannot hold more than this.
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
        // Headers that are looked at are gone again.
        if length == usize::MAX {
            self.taken += unpacked.len() as u64;
        }
        Ok(unpacked)
    }
}

fn damaged(path: &Path, problem: &str) -> Error {
    Error::malformed(path, Location::Byte(0), problem)
}

/// Writes the positions and all attributes, stored: deflate gains little from floats.
pub(crate) fn write(particles: &Particles, out: &mut BufWriter<&File>) -> io::Result<()> {
    let n = particles.len();
    // Members of more than 4 GiB need another kind of header, from the beginning.
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

    /// Protects memory from a small archive that unpacks to a huge one.
    #[test]
    fn unpacking_stops_at_the_limit() {
        let mut zip = ZipWriter::new(io::Cursor::new(Vec::new()));
        zip.start_file("a.npy", SimpleFileOptions::default()).unwrap();
        zip.write_all(&[0; 1000]).unwrap();
        let bytes = zip.finish().unwrap().into_inner();
        let unpack = |limit| {
            let archive = ZipArchive::new(io::Cursor::new(&bytes[..])).unwrap();
            let (path, packed) = (Path::new("bomb.npz"), bytes.len() as u64);
            Members { path, archive, packed, limit, taken: 0 }.unpack(0, "a", usize::MAX)
        };
        assert_eq!(unpack(1000).unwrap().len(), 1000);
        let error = unpack(999).unwrap_err().to_string();
        assert!(error.contains("bomb.npz") && error.contains("more than 999 bytes"), "{error}");
    }
}
