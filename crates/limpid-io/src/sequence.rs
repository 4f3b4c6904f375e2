//! Sequences: the files of an input, as numbered frames.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::particles::{extensions, readable_stem};
use crate::pattern::placeholder;
use crate::{files, vtk_lists};

/// The frames of an input, ordered by their numbers, which are unique.
#[derive(Debug, Clone, PartialEq)]
pub struct Sequence {
    /// The frames, by ascending number. Never empty.
    pub frames: Vec<Frame>,
    /// The pattern of the files, with `{}` for the number where limpid has derived it.
    pub pattern: String,
    /// Frames per second, if a list of the files has their times.
    pub fps: Option<f64>,
}

/// One file of a sequence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// The number in the file name.
    pub number: i64,
    /// Path of the file.
    pub path: PathBuf,
}

impl Sequence {
    /// Finds the frames of `input`:
    ///
    /// - a time series, `.pvd` or `.series`: the listed files, numbered from 0;
    /// - another existing file: one frame, numbered by the last digits in its name, or 0;
    /// - an existing folder: the particle files in it, whose names must differ only in the number;
    /// - a pattern, whose file name contains one of `{}`, `%d`, `$F` (a number of any width), `%04d`,
    ///   `$F4`, `####` (a number of at least that many digits). Gaps between numbers are allowed.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the file or folder does not exist or cannot be listed,
    /// [`Error::Sequence`] if nothing matches or two files have the same number.
    pub fn open(input: &str) -> Result<Self> {
        let path = Path::new(input);
        let pattern = match std::fs::metadata(path) {
            Ok(metadata) if metadata.is_dir() => return Self::from_folder(path),
            Ok(_) => None,
            Err(error) => {
                Some(Pattern::parse(input)?.ok_or_else(|| Error::io(path, "read", error))?)
            }
        };
        match pattern {
            Some(pattern) => Self::from_pattern(input, &pattern),
            None if is_series(path) => Self::from_series(path),
            None => {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                let number = split_number(&name).map_or(0, |(_, number, _)| number);
                let frames = vec![Frame { number, path: path.to_owned() }];
                Ok(Self { frames, pattern: input.into(), fps: None })
            }
        }
    }

    /// Finds the sequence that a file belongs to: the files in its folder whose names differ only in the
    /// last number. `None` if the name has no number.
    pub(crate) fn around(file: &Path) -> Option<Self> {
        let name = file.file_name()?.to_str()?;
        let (prefix, _, suffix) = split_number(name)?;
        let parent = file.parent().filter(|parent| !parent.as_os_str().is_empty());
        let folder = parent.unwrap_or(Path::new("."));
        let pattern = Pattern { folder, prefix, suffix, width: 1 };
        Self::from_pattern(&file.to_string_lossy(), &pattern).ok()
    }

    /// The frame with this number, if there is one.
    pub fn frame(&self, number: i64) -> Option<&Frame> {
        let at = self.frames.binary_search_by_key(&number, |frame| frame.number).ok()?;
        self.frames.get(at)
    }

    /// Stride of the frame numbers: the greatest common divisor of their differences, 1 for a single
    /// frame. Some simulators number files by time step and write, say, every hundredth.
    pub fn stride(&self) -> u64 {
        let gcd = |mut a: u64, mut b: u64| {
            while b > 0 {
                (a, b) = (b, a % b);
            }
            a
        };
        let pairs = self.frames.array_windows();
        pairs.map(|[a, b]| b.number.abs_diff(a.number)).fold(0, gcd).max(1)
    }

    /// The ranges of missing numbers between frames, as the first and the last of each.
    pub fn gaps(&self) -> Vec<(i64, i64)> {
        let stride = self.stride();
        let pairs = self.frames.array_windows();
        let gaps = pairs.filter(|[a, b]| b.number.abs_diff(a.number) > stride);
        let ends = |[a, b]: &[Frame; 2]| {
            (a.number.saturating_add_unsigned(stride), b.number.saturating_sub_unsigned(stride))
        };
        gaps.map(ends).collect()
    }

    /// Merges the frames of two sequences by number; where both have a frame, that of `self` is kept.
    pub(crate) fn joined(mut self, other: &Self) -> Self {
        let new = other.frames.iter().filter(|frame| self.frame(frame.number).is_none());
        let new: Vec<Frame> = new.cloned().collect();
        self.frames.extend(new);
        self.frames.sort_by_key(|frame| frame.number);
        self.pattern = format!("{}, {}", self.pattern, other.pattern);
        self
    }

    fn from_series(path: &Path) -> Result<Self> {
        /// Largest list, bytes.
        const MOST: u64 = 256 << 20;
        let mut bytes = Vec::new();
        files::read(path, |_| MOST, &mut bytes)?;
        let listed = match extension(path).as_str() {
            "pvd" => vtk_lists::parse_xml(path, &bytes)?,
            _ => vtk_lists::parse_series(path, &bytes)?,
        };
        let times: Vec<f64> = listed.iter().filter_map(|file| file.time).collect();
        if let Some([time, _]) = times.array_windows().find(|[a, b]| a == b) {
            let problem = format!("several parts at the time {time}; save each time as one file");
            return Err(Error::format(path, problem));
        }
        let fps = vtk_lists::rate(&listed);
        let frames = (0..).zip(listed).map(|(number, file)| Frame { number, path: file.path });
        Ok(Self { frames: frames.collect(), pattern: path.display().to_string(), fps })
    }

    fn from_pattern(input: &str, pattern: &Pattern<'_>) -> Result<Self> {
        let folder = pattern.folder;
        let names = file_names(folder)?;
        let matches = names.iter().filter_map(|name| {
            Some(Frame { number: pattern.number(name)?, path: folder.join(name) })
        });
        let frames: Vec<Frame> = matches.collect();
        if frames.is_empty() {
            let similar = names.iter().filter(|name| readable_stem(name).is_some());
            let hint = similar
                .max_by_key(|name| common_prefix(pattern.prefix.bytes(), name.bytes()))
                .map_or(String::new(), |name| format!("; `{name}` is there"));
            let problem = format!("no file of this name in {}{hint}", folder.display());
            return Err(Error::Sequence { pattern: input.into(), problem });
        }
        Self::sorted(frames, input.into())
    }

    fn from_folder(folder: &Path) -> Result<Self> {
        let mut stems = BTreeSet::new();
        let mut frames = Vec::new();
        let names = file_names(folder)?;
        // The pieces of listed frames are no frames of their own.
        let lists = names.iter().any(|name| is_piece_list(name));
        let is_frame =
            |name: &&String| readable_stem(name).is_some() && is_piece_list(name) == lists;
        for name in names.iter().filter(is_frame) {
            let (stem, number) = match split_number(name) {
                Some((prefix, number, suffix)) => (format!("{prefix}{{}}{suffix}"), number),
                None => (name.clone(), 0),
            };
            stems.insert(stem);
            frames.push(Frame { number, path: folder.join(name) });
        }
        let count = stems.len();
        let some: Vec<String> = stems.into_iter().take(8).collect();
        match some.as_slice() {
            [stem] => Self::sorted(frames, folder.join(stem).display().to_string()),
            [] => {
                let problem = format!("no particle files ({}) in this folder", extensions());
                Err(Error::Sequence { pattern: folder.display().to_string(), problem })
            }
            _ => {
                let more = if count > some.len() { ", ..." } else { "" };
                let problem = format!(
                    "{count} sequences in this folder; name one by its pattern: {}{more}",
                    some.join(", ")
                );
                Err(Error::Sequence { pattern: folder.display().to_string(), problem })
            }
        }
    }

    fn sorted(mut frames: Vec<Frame>, pattern: String) -> Result<Self> {
        frames.sort_by(|a, b| (a.number, &a.path).cmp(&(b.number, &b.path)));
        for pair in frames.windows(2) {
            if let [a, b] = pair
                && a.number == b.number
            {
                let (number, a, b) = (a.number, a.path.display(), b.path.display());
                let problem = format!("frame {number} is there twice: {a} and {b}");
                return Err(Error::Sequence { pattern, problem });
            }
        }
        Ok(Self { frames, pattern, fps: None })
    }
}

/// Whether a file lists the frames of a sequence.
fn is_series(path: &Path) -> bool {
    ["pvd", "series"].contains(&extension(path).as_str())
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}

/// Whether a file lists the pieces of a frame.
fn is_piece_list(name: &str) -> bool {
    ["pvtu", "pvtp", "vtm"].contains(&extension(Path::new(name)).as_str())
}

/// A file name with a placeholder for the number.
struct Pattern<'a> {
    folder: &'a Path,
    prefix: &'a str,
    suffix: &'a str,
    /// Minimum number of digits.
    width: usize,
}

impl<'a> Pattern<'a> {
    /// Parses a path; `None` if its file name has no placeholder.
    fn parse(input: &'a str) -> Result<Option<Self>> {
        let path = Path::new(input);
        let Some(name) = path.file_name().and_then(OsStr::to_str) else { return Ok(None) };
        let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
        let folder = parent.unwrap_or(Path::new("."));
        let Some((at, length, width)) = placeholder(name) else { return Ok(None) };
        let (prefix, rest) = name.split_at(at);
        let (_, suffix) = rest.split_at(length);
        if placeholder(suffix).is_some() {
            let problem = "the file name has two places for a number, expected one".into();
            return Err(Error::Sequence { pattern: input.into(), problem });
        }
        Ok(Some(Self { folder, prefix, suffix, width }))
    }

    fn number(&self, name: &str) -> Option<i64> {
        let number = name.strip_prefix(self.prefix)?.strip_suffix(self.suffix)?;
        let digits = number.strip_prefix('-').unwrap_or(number);
        let valid = digits.len() >= self.width && digits.bytes().all(|byte| byte.is_ascii_digit());
        number.parse().ok().filter(|_| valid)
    }
}

/// Splits a file name at the last number before its extension: prefix, number, suffix.
fn split_number(name: &str) -> Option<(&str, i64, &str)> {
    let stem = readable_stem(name).or_else(|| Path::new(name).file_stem()?.to_str())?;
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem[..end].rfind(|c: char| !c.is_ascii_digit());
    let start = start.map_or(0, |at| at + stem[at..].chars().next().map_or(1, char::len_utf8));
    Some((&name[..start], name[start..end].parse().ok()?, &name[end..]))
}

/// The names in a folder, sorted, except hidden ones and those that are not Unicode.
fn file_names(folder: &Path) -> Result<Vec<String>> {
    let error = |source| Error::io(folder, "list", source);
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(error)? {
        if let Ok(name) = entry.map_err(error)?.file_name().into_string()
            && !name.starts_with('.')
        {
            names.push(name);
        }
    }
    names.sort(); // for messages that do not depend on the file system
    Ok(names)
}

/// Length of the common prefix of two names, bytes.
fn common_prefix(a: impl Iterator<Item = u8>, b: impl Iterator<Item = u8>) -> usize {
    a.zip(b).take_while(|(a, b)| a == b).count()
}
