//! Which files are the frames of a sequence.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::particles::{extensions, readable_stem};

/// The frames that an input stands for, in the order of their numbers, each number once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sequence {
    /// The frames, by ascending number; never empty.
    pub frames: Vec<Frame>,
    /// The pattern that the files match, with `{}` for the number where limpid found it itself.
    pub pattern: String,
}

/// One file of a sequence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// Its number, from its name.
    pub number: i64,
    /// The file.
    pub path: PathBuf,
}

impl Sequence {
    /// Finds the frames of `input`:
    ///
    /// - an existing file: that frame, numbered by the last digits in its name, or 0;
    /// - an existing folder: the particle files in it, which must differ in the number alone;
    /// - a pattern, whose file name holds one of `{}`, `%d`, `$F` (any number), `%04d`, `$F4`,
    ///   `####` (a number of at least so many digits). Gaps between numbers are allowed.
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
            None => {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                let number = numbered(&name).map_or(0, |(_, number, _)| number);
                let frames = vec![Frame { number, path: path.to_owned() }];
                Ok(Self { frames, pattern: input.into() })
            }
        }
    }

    /// The frames of the sequence that a file is of: those in its folder whose names differ from
    /// its own in the last number alone. None where the name has no number.
    pub(crate) fn around(file: &Path) -> Option<Self> {
        let name = file.file_name()?.to_str()?;
        let (prefix, _, suffix) = numbered(name)?;
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

    /// How far the numbers of two frames are apart that follow each other: the largest number that
    /// all differences are multiples of, 1 for a single frame. Simulators number their files by steps,
    /// of which they write every hundredth.
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

    /// The ranges of numbers that are missing between frames: the first and the last of each.
    pub fn gaps(&self) -> Vec<(i64, i64)> {
        let stride = self.stride();
        let pairs = self.frames.array_windows();
        let gaps = pairs.filter(|[a, b]| b.number.abs_diff(a.number) > stride);
        let ends = |[a, b]: &[Frame; 2]| {
            (a.number.saturating_add_unsigned(stride), b.number.saturating_sub_unsigned(stride))
        };
        gaps.map(ends).collect()
    }

    /// The frames of both, by number; where both have one, this one's.
    pub(crate) fn joined(mut self, other: &Self) -> Self {
        let new = other.frames.iter().filter(|frame| self.frame(frame.number).is_none());
        let new: Vec<Frame> = new.cloned().collect();
        self.frames.extend(new);
        self.frames.sort_by_key(|frame| frame.number);
        self.pattern = format!("{}, {}", self.pattern, other.pattern);
        self
    }

    fn from_pattern(input: &str, pattern: &Pattern<'_>) -> Result<Self> {
        let folder = pattern.folder;
        let names = list(folder)?;
        let matches = names.iter().filter_map(|name| {
            Some(Frame { number: pattern.number(name)?, path: folder.join(name) })
        });
        let frames: Vec<Frame> = matches.collect();
        if frames.is_empty() {
            let similar = names.iter().filter(|name| readable_stem(name).is_some());
            let hint = similar
                .max_by_key(|name| common(pattern.prefix.bytes(), name.bytes()))
                .map_or(String::new(), |name| format!("; `{name}` is there"));
            let problem = format!("no file of this name in {}{hint}", folder.display());
            return Err(Error::Sequence { pattern: input.into(), problem });
        }
        Self::sorted(frames, input.into())
    }

    fn from_folder(folder: &Path) -> Result<Self> {
        let mut stems = BTreeSet::new();
        let mut frames = Vec::new();
        for name in list(folder)?.iter().filter(|name| readable_stem(name).is_some()) {
            let (stem, number) = match numbered(name) {
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
        Ok(Self { frames, pattern })
    }
}

/// A file name with a number left open.
struct Pattern<'a> {
    folder: &'a Path,
    prefix: &'a str,
    suffix: &'a str,
    /// The least number of digits.
    width: usize,
}

impl<'a> Pattern<'a> {
    /// `None` if the file name leaves no number open.
    fn parse(input: &'a str) -> Result<Option<Self>> {
        let path = Path::new(input);
        let Some(name) = path.file_name().and_then(OsStr::to_str) else { return Ok(None) };
        let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
        let folder = parent.unwrap_or(Path::new("."));
        let Some((at, length, width)) = placeholder(name) else { return Ok(None) };
        let (prefix, rest) = name.split_at(at);
        let (_, suffix) = rest.split_at(length);
        if placeholder(suffix).is_some() {
            let problem = "the file name has two places for a number, one expected".into();
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

/// Where the first place for a number begins, its length, and the least number of digits.
pub(crate) fn placeholder(name: &str) -> Option<(usize, usize, usize)> {
    name.char_indices().find_map(|(at, _)| {
        let rest = &name[at..];
        let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
        if rest.starts_with("{}") {
            Some((at, 2, 1))
        } else if rest.starts_with('#') {
            let width = rest.bytes().take_while(|&byte| byte == b'#').count();
            Some((at, width, width))
        } else if let Some(rest) = rest.strip_prefix("$F") {
            let (length, width) = width(rest, digits(rest))?;
            Some((at, 2 + length, width))
        } else {
            let rest = rest.strip_prefix('%')?;
            let (length, width) = width(rest, digits(rest))?;
            rest[length..].starts_with('d').then_some((at, length + 2, width))
        }
    })
}

/// The length and the value of the `digits` that `text` begins with; without any, 1.
fn width(text: &str, digits: usize) -> Option<(usize, usize)> {
    let value = if digits == 0 { 1 } else { text[..digits].parse().ok()? };
    Some((digits, value))
}

/// Splits a file name around the last digits before its extension.
fn numbered(name: &str) -> Option<(&str, i64, &str)> {
    let stem = readable_stem(name).or_else(|| Path::new(name).file_stem()?.to_str())?;
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem[..end].rfind(|c: char| !c.is_ascii_digit());
    let start = start.map_or(0, |at| at + stem[at..].chars().next().map_or(1, char::len_utf8));
    Some((&name[..start], name[start..end].parse().ok()?, &name[end..]))
}

/// The names in a folder, without hidden ones and those that are not Unicode.
fn list(folder: &Path) -> Result<Vec<String>> {
    let error = |source| Error::io(folder, "list", source);
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(error)? {
        if let Ok(name) = entry.map_err(error)?.file_name().into_string()
            && !name.starts_with('.')
        {
            names.push(name);
        }
    }
    names.sort(); // so that messages do not depend on the file system
    Ok(names)
}

/// How many bytes two names share at their start.
fn common(a: impl Iterator<Item = u8>, b: impl Iterator<Item = u8>) -> usize {
    a.zip(b).take_while(|(a, b)| a == b).count()
}
