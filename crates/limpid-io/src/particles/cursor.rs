//! Sequential reading of a file's bytes, with locations for errors.

use std::borrow::Cow;
use std::path::Path;

use crate::budget::Budget;
use crate::error::{Error, Location, Result};
use crate::number::float;

/// The bytes of a file, and the kind of its locations in messages.
#[derive(Clone, Copy)]
pub(crate) struct FileBytes<'a> {
    pub(crate) path: &'a Path,
    pub(crate) bytes: &'a [u8],
    /// Locations are lines instead of bytes.
    pub(crate) text: bool,
}

impl FileBytes<'_> {
    pub(crate) fn error(&self, offset: usize, problem: impl Into<String>) -> Error {
        Error::malformed(self.path, self.location(offset), problem)
    }

    /// Takes `bytes` of a budget for data unpacked from the file at `offset`.
    pub(crate) fn take(&self, budget: &Budget, bytes: u64, offset: usize) -> Result<()> {
        budget.take(bytes, self.path, self.location(offset))
    }

    /// The location of the byte at `offset` in messages.
    pub(crate) fn location(&self, offset: usize) -> Location {
        if self.text {
            let before = self.bytes.get(..offset).unwrap_or(self.bytes);
            Location::Line(1 + before.iter().filter(|&&byte| byte == b'\n').count() as u64)
        } else {
            Location::Byte(offset as u64)
        }
    }
}

/// Reads a file sequentially and never beyond its end.
pub(crate) struct Cursor<'a> {
    pub(crate) source: FileBytes<'a>,
    pub(crate) offset: usize,
    /// Start of the latest read, which is the location of `Cursor::error`.
    pub(crate) start: usize,
}

impl<'a> Cursor<'a> {
    pub(crate) fn new(path: &'a Path, bytes: &'a [u8], text: bool) -> Self {
        Self { source: FileBytes { path, bytes, text }, offset: 0, start: 0 }
    }

    pub(crate) fn error(&self, problem: impl Into<String>) -> Error {
        self.source.error(self.start, problem)
    }

    pub(crate) fn rest(&self) -> &'a [u8] {
        self.source.bytes.get(self.offset..).unwrap_or_default()
    }

    pub(crate) fn take(&mut self, length: usize, what: &str) -> Result<&'a [u8]> {
        self.take_records(1, length, what)
    }

    /// Takes `rows` records of `stride` bytes.
    pub(crate) fn take_records(
        &mut self,
        rows: usize,
        stride: usize,
        what: &str,
    ) -> Result<&'a [u8]> {
        self.start = self.offset;
        let rest = self.rest();
        match rows.checked_mul(stride).and_then(|length| rest.get(..length)) {
            Some(taken) => {
                self.offset += taken.len();
                Ok(taken)
            }
            None => Err(self.error(format!(
                "{what}: expected {rows} × {stride} bytes, {} are left",
                rest.len()
            ))),
        }
    }

    pub(crate) fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N]> {
        let bytes = self.take(N, what)?;
        bytes.try_into().map_err(|_| self.error(what))
    }

    /// Reads the next line without its terminator; `None` at the end of the file.
    pub(crate) fn line(&mut self) -> Option<Cow<'a, str>> {
        self.start = self.offset;
        let rest = self.rest();
        let line = rest.split(|&byte| byte == b'\n').next().filter(|_| !rest.is_empty())?;
        self.offset += (line.len() + 1).min(rest.len());
        Some(String::from_utf8_lossy(line.strip_suffix(b"\r").unwrap_or(line)))
    }

    /// Reads the next line that is not blank.
    pub(crate) fn filled_line(&mut self) -> Option<Cow<'a, str>> {
        loop {
            let line = self.line()?;
            if !line.trim_ascii().is_empty() {
                return Some(line);
            }
        }
    }

    /// Reads the next word, delimited by white space.
    pub(crate) fn word(&mut self) -> Option<Cow<'a, str>> {
        let rest = self.rest();
        self.start = self.offset + rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let word = self.source.bytes.get(self.start..)?;
        let word = word.split(u8::is_ascii_whitespace).next()?;
        self.offset = self.start + word.len();
        Some(String::from_utf8_lossy(word))
    }

    /// Parses a count of a header.
    pub(crate) fn count(&self, word: Option<&str>, what: &str) -> Result<usize> {
        let word = word.unwrap_or("nothing");
        word.parse().map_err(|_| self.error(format!("{what}: expected a count, found `{word}`")))
    }

    pub(crate) fn number(&self, word: &str) -> Result<f64> {
        float(word.as_bytes())
            .ok_or_else(|| self.error(format!("expected a number, found `{word}`")))
    }
}
