//! Names of the files of a sequence.

use std::ffi::OsStr;
use std::path::Path;

use crate::error::{Error, Result};
use crate::files;
use crate::identity::folder_of;
use crate::particles::readable_stem;
use crate::pattern::placeholder;

/// Whether there is no file of this name. A server is not asked for each file of a list.
pub(crate) fn is_absent(path: &Path) -> bool {
    let not_found = |error: &std::io::Error| error.kind() == std::io::ErrorKind::NotFound;
    !cfg!(target_arch = "wasm32") && files::metadata(path).is_err_and(|error| not_found(&error))
}

/// The problem of a name that has to be compared with others.
pub(super) const NOT_TEXT: &str = "the names of a sequence are text in UTF-8, and this one is not; rename its files, or name one of them";

/// The error of a file that cannot be opened, with the most similar name that is there.
pub(super) fn absent(path: &Path, error: std::io::Error) -> Error {
    const SIMILAR: f64 = 0.85;
    if error.kind() != std::io::ErrorKind::NotFound {
        return Error::io(path, "read", error);
    }
    let described = |problem| Error::Sequence { pattern: path.display().to_string(), problem };
    if let Ok(target) = path.read_link() {
        let problem = format!("a link to `{}`, which is missing", target.display());
        return described(problem);
    }
    let name = file_name(path);
    // The name of a file may be any bytes, but that of several is text.
    if !is_text(path) && (placeholder(&name).is_some() || name.contains('*')) {
        return described(NOT_TEXT.into());
    }
    let names = file_names(folder_of(path)).unwrap_or_default();
    let similar = names
        .iter()
        .filter(|other| readable_stem(other).is_some())
        .map(|other| (strsim::jaro_winkler(other, &name), other))
        .filter(|&(similarity, _)| similarity > SIMILAR)
        .max_by(|(a, _), (b, _)| a.total_cmp(b));
    match similar {
        Some((_, other)) => described(format!("no such file; `{other}` is there")),
        None => Error::io(path, "read", error),
    }
}

/// Whether the name of a file is text.
pub(super) fn is_text(path: &Path) -> bool {
    path.file_name().is_none_or(|name| name.to_str().is_some())
}

pub(super) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Whether a file lists the frames of a sequence.
pub(super) fn is_series(path: &Path) -> bool {
    ["pvd", "series"].contains(&extension(path).as_str())
}

pub(super) fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}

/// Whether a file lists the pieces of a frame.
pub(super) fn is_piece_list(name: &str) -> bool {
    ["pvtu", "pvtp", "vtm"].contains(&extension(Path::new(name)).as_str())
}

/// A file name with a placeholder for the number.
pub(super) struct Pattern<'a> {
    pub(super) folder: &'a Path,
    pub(super) prefix: &'a str,
    pub(super) suffix: &'a str,
    /// Minimum number of digits.
    pub(super) width: usize,
}

impl<'a> Pattern<'a> {
    /// Parses a path; `None` if its file name has no placeholder.
    pub(super) fn parse(path: &'a Path) -> Result<Option<Self>> {
        let Some(name) = path.file_name().and_then(OsStr::to_str) else { return Ok(None) };
        let folder = folder_of(path);
        let Some((at, length, width)) = placeholder(name) else { return Ok(None) };
        let (prefix, rest) = name.split_at(at);
        let (_, suffix) = rest.split_at(length);
        if placeholder(suffix).is_some() {
            let problem = "the file name has two places for a number, expected one".into();
            return Err(Error::Sequence { pattern: path.display().to_string(), problem });
        }
        Ok(Some(Self { folder, prefix, suffix, width }))
    }

    /// A part of a file name that contains a placeholder.
    pub(super) fn of_name(folder: &'a Path, name: &'a str) -> Option<Self> {
        let (at, length, width) = placeholder(name)?;
        Some(Self { folder, prefix: &name[..at], suffix: &name[at + length..], width })
    }

    pub(super) fn number(&self, name: &str) -> Option<i64> {
        let number = name.strip_prefix(self.prefix)?.strip_suffix(self.suffix)?;
        let digits = number.strip_prefix('-').unwrap_or(number);
        let valid = digits.len() >= self.width && digits.bytes().all(|byte| byte.is_ascii_digit());
        number.parse().ok().filter(|_| valid)
    }
}

/// Splits a file name at the last number before its extension: prefix, number, suffix.
pub(super) fn split_number(name: &str) -> Option<(&str, i64, &str)> {
    let plain = name.strip_suffix(".gz").unwrap_or(name);
    // The extension may be the number, as in `dump.melt.1500`.
    let numbered = Path::new(plain)
        .extension()
        .is_some_and(|end| end.to_string_lossy().bytes().all(|byte| byte.is_ascii_digit()));
    let stem = if numbered { Some(plain) } else { Path::new(plain).file_stem()?.to_str() };
    let stem = readable_stem(name).or(stem)?;
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem[..end].rfind(|c: char| !c.is_ascii_digit());
    let start = start.map_or(0, |at| at + stem[at..].chars().next().map_or(1, char::len_utf8));
    Some((&name[..start], name[start..end].parse().ok()?, &name[end..]))
}

/// The name of a file without the number and what stands before it, as `water` of `water_0001.bgeo`.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn name_of_frames(path: &Path) -> String {
    let name = file_name(path);
    let stem = match split_number(&name) {
        Some((before, ..)) => before,
        None => {
            let plain = Path::new(&name).file_stem().and_then(OsStr::to_str);
            readable_stem(&name).or(plain).unwrap_or(&name)
        }
    };
    stem.trim_end_matches(|c: char| !c.is_alphanumeric()).to_owned()
}

/// The names in a folder, sorted, except hidden ones and those that are not Unicode.
pub(super) fn file_names(folder: &Path) -> Result<Vec<String>> {
    let names = files::names_in(folder).map_err(|source| Error::io(folder, "list", source))?;
    let mut names: Vec<String> = names.into_iter().filter(|name| !name.starts_with('.')).collect();
    names.sort(); // for messages that do not depend on the file system
    Ok(names)
}

/// Length of the common prefix of two names, bytes.
pub(super) fn common_prefix(a: impl Iterator<Item = u8>, b: impl Iterator<Item = u8>) -> usize {
    a.zip(b).take_while(|(a, b)| a == b).count()
}
