//! Which format a file has: by its name, or, where the name has none, by how the file begins. LAMMPS and LIGGGHTS
//! leave names to their users (`dump.melt.1500`, `dump1500.liggghts`), and `.txt`, `.dat` and `.asc` say nothing.

use std::io::Read as _;
use std::path::Path;

use flate2::read::MultiGzDecoder;

use super::labelled::{POSITION, canonical, vector_among};
use super::{Format, extxyz, foam, format_of, kinds, unknown_kind};
use crate::error::{Error, Result};
use crate::files;
use crate::number::float;

/// The format of a file.
pub(super) struct Found {
    pub(super) format: Format,
    /// Whether the file is compressed by gzip, which the format itself knows nothing of.
    pub(super) gzip: bool,
}

/// The format of a file that can be opened.
pub(super) fn of_file(path: &Path) -> Result<Found> {
    let start = || {
        /// Bytes that decide.
        const START: u64 = 4096;
        let (file, _) = files::open(path)?;
        let mut start = Vec::new();
        let read = file.take(START).read_to_end(&mut start);
        read.map_err(|source| Error::io(path, "read", source))?;
        Ok(start)
    };
    of(path, start)
}

/// The format of a file with these bytes.
pub(super) fn of_bytes(path: &Path, bytes: &[u8]) -> Result<Found> {
    of(path, || Ok(bytes.get(..4096).unwrap_or(bytes).to_vec()))
}

fn of(path: &Path, start: impl FnOnce() -> Result<Vec<u8>>) -> Result<Found> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    if let Some((_, format)) = format_of(&name) {
        return Ok(Found { format, gzip: false });
    }
    let gzip = is_gzip(&name);
    let inner = if gzip { &name[..name.len() - ".gz".len()] } else { &*name };
    if let Some((_, format)) = format_of(inner).filter(|_| gzip) {
        return Ok(Found { format, gzip });
    }
    let unknown = || unknown_kind(path, &name);
    if kinds::remedy(inner).is_some() {
        return Err(unknown());
    }
    let start = start()?;
    let unpacked = if gzip { unpacked(&start) } else { start };
    let extension = extension_of(&unpacked).or_else(|| is_table(&unpacked).then_some(".csv"));
    let (_, format) = extension.and_then(format_of).ok_or_else(unknown)?;
    Ok(Found { format, gzip })
}

/// Whether a file whose name has no format is one of particles by its contents.
pub(crate) fn is_particles(path: &Path) -> bool {
    of_file(path).is_ok()
}

/// The files of particles among those in a folder whose names have no format. Tables are taken by their usual
/// extensions alone, and only where nothing else is, since logs are tables too.
pub(crate) fn particles_in(folder: &Path, mut names: Vec<String>) -> Vec<String> {
    let is_table = |name: &String| {
        let found = of_file(&folder.join(name)).ok()?;
        Some(found.format.extension == ".csv")
    };
    let kinds: Vec<Option<bool>> = names.iter().map(is_table).collect();
    let tables = !kinds.contains(&Some(false));
    let mut kinds = kinds.into_iter();
    names.retain(|name| match kinds.next().flatten() {
        Some(true) => tables && is_table_name(name),
        kind => kind.is_some(),
    });
    names
}

/// Whether a name has the extension of a table, perhaps compressed.
fn is_table_name(name: &str) -> bool {
    let name = if is_gzip(name) { &name[..name.len() - ".gz".len()] } else { name };
    Path::new(name).extension().is_some_and(|extension| {
        ["txt", "dat", "asc"].iter().any(|known| extension.eq_ignore_ascii_case(known))
    })
}

/// Whether a name ends with `.gz`.
pub(super) fn is_gzip(name: &str) -> bool {
    let end = name.len().checked_sub(".gz".len()).and_then(|at| name.get(at..));
    end.is_some_and(|end| end.eq_ignore_ascii_case(".gz"))
}

/// The beginning of compressed contents, as far as it can be unpacked from the file's beginning.
fn unpacked(start: &[u8]) -> Vec<u8> {
    let mut unpacked = Vec::new();
    // Ends with an error where the start does.
    let _ = MultiGzDecoder::new(start).take(4096).read_to_end(&mut unpacked);
    unpacked
}

/// The extension of the format that a file of this beginning has by its magic.
fn extension_of(start: &[u8]) -> Option<&'static str> {
    const MAGIC: [(&[u8], &str); 13] = [
        (b"ITEM:", ".lammpstrj"),
        (b"# vtk DataFile", ".vtk"),
        (b"ply\n", ".ply"),
        (b"ply\r\n", ".ply"),
        (b"\x93NUMPY", ".npy"),
        (b"PK\x03\x04", ".npz"),
        (b"\x89HDF\r\n\x1a\n", ".h5"),
        (b"\x7fNSJ", ".bgeo"),
        (b"BgeoV", ".bgeo"),
        (b"scf1", ".bgeo.sc"),
        (b"#FileJBD", ".bi4"),
        (super::prt::MAGIC, ".prt"),
        (b"<VTKFile", ".vtu"),
    ];
    let known = MAGIC.iter().find(|(magic, _)| start.starts_with(magic));
    let counted = || {
        let text =
            start.iter().take(64).all(|byte| byte.is_ascii_graphic() || byte.is_ascii_whitespace());
        let several = start.iter().filter(|&&byte| byte == b'\n').count() > 2;
        (text && several && extxyz::is_counted(start)).then_some(".extxyz")
    };
    let foam = || foam::is_foam(start).then_some(foam::EXTENSION);
    known.map(|&(_, extension)| extension).or_else(foam).or_else(counted)
}

/// Whether a file begins as text of lines with three numbers or more, after comments and a line that names x, y and z.
fn is_table(start: &[u8]) -> bool {
    let text = |byte: &u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace() || *byte >= 0x80;
    let start = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start);
    // The last line may be cut off.
    let complete = start.iter().rposition(|&byte| byte == b'\n').map_or(start.len(), |at| at + 1);
    let lines = start[..complete].split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii);
    let mut lines = lines.filter(|line| !line.is_empty() && !line.starts_with(b"#"));
    let words = |line: &[u8]| -> Vec<String> {
        let separator = |byte: &u8| byte.is_ascii_whitespace() || matches!(byte, b',' | b';');
        let words = line.split(separator).filter(|word| !word.is_empty());
        words.map(|word| String::from_utf8_lossy(word).into_owned()).collect()
    };
    let numbers = |line: &[u8]| {
        let words = words(line);
        words.len() >= 3 && words.iter().take(3).all(|word| float(word.as_bytes()).is_some())
    };
    let names = |line: &[u8]| {
        let names = words(line);
        let names: Vec<String> =
            names.iter().map(|word| canonical(word.trim_matches('"'))).collect();
        vector_among(&names, &POSITION).is_some()
    };
    let first = lines.next().unwrap_or_default();
    start.iter().all(text) && (numbers(first) || names(first)) && lines.take(8).all(numbers)
}
