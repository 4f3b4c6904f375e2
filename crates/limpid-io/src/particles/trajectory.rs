//! Text files with several frames: extended XYZ and LAMMPS dumps. A scan finds where each frame begins, and a
//! frame is read alone, so that a file may be larger than the memory.

use std::io::{self, BufRead, BufReader, Read as _, Seek as _, SeekFrom};
use std::path::Path;

use super::{Contents, ReadOptions, Reading, format_for};
use crate::error::{Error, Location, Result};
use crate::files;
use limpid::memory;

/// A part of a text file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Section {
    /// Offset, bytes.
    pub start: u64,
    /// Length, bytes.
    pub length: u64,
    /// Number of lines before it.
    pub lines: u64,
}

/// Reads a frame of a file with several, as [`Contents::read`] reads a file.
///
/// # Errors
/// As [`Contents::read`].
pub(crate) fn read_section(
    path: &Path,
    section: Section,
    options: &ReadOptions,
) -> Result<Contents> {
    let fail = |source| Error::io(path, "read", source);
    let format = format_for(path)?;
    let (mut file, metadata) = files::open(path)?;
    let limit = options.max_unpacked.unwrap_or_else(|| files::unpacked_limit(section.length));
    if section.length > limit {
        let length = section.length;
        let problem = format!("a frame of {length} bytes, expected at most {limit}");
        return Err(Error::format(path, problem));
    }
    let length =
        usize::try_from(section.length).map_err(|_| fail(io::ErrorKind::FileTooLarge.into()))?;
    let mut bytes = memory::zeroed(length, path.display())?;
    file.seek(SeekFrom::Start(section.start)).map_err(fail)?;
    let read = file.read_exact(&mut bytes);
    files::unchanged(path, &file, &metadata)?;
    read.map_err(fail)?;
    let contents = format.parse(path, &bytes, &Reading { limit, map: &options.map });
    contents.map_err(|error| match error {
        Error::Malformed { path, location: Location::Line(line), problem } => {
            Error::Malformed { path, location: Location::Line(section.lines + line), problem }
        }
        error => error,
    })
}

/// Formats whose files may have several frames.
#[derive(Clone, Copy)]
enum Kind {
    ExtendedXyz,
    Lammps,
}

/// Whether a file of this name may have several frames.
pub(crate) fn may_have_several(path: &Path) -> bool {
    kind_of(path).is_some()
}

fn kind_of(path: &Path) -> Option<Kind> {
    let extension = path.extension()?.to_string_lossy().to_ascii_lowercase();
    match extension.as_str() {
        "xyz" | "extxyz" => Some(Kind::ExtendedXyz),
        "lammpstrj" | "dump" => Some(Kind::Lammps),
        _ => None,
    }
}

/// Finds the frames of a file with several; `None` for other files. They are numbered from 0, those of LAMMPS
/// by their time steps. A step that is there twice in a row, as at the start of a continued run, counts once.
///
/// # Errors
/// [`Error::Io`], and [`Error::Malformed`] if something else follows a frame.
pub(crate) fn frames_of(path: &Path) -> Result<Option<Vec<(i64, Section)>>> {
    let Some(kind) = kind_of(path) else { return Ok(None) };
    let (file, _) = files::open(path)?;
    let mut scan =
        Scan { path, file: BufReader::with_capacity(1 << 20, file), offset: 0, lines: 0 };
    let mut frames: Vec<(i64, Section)> = Vec::new();
    loop {
        scan.skip_blank_lines()?;
        let (start, lines) = (scan.offset, scan.lines);
        let skipped = match kind {
            Kind::ExtendedXyz => scan.skip_counted(),
            Kind::Lammps => scan.skip_step(),
        };
        let number = match skipped {
            // The reader tells what the file is.
            Err(_) if frames.is_empty() => return Ok(None),
            number => number?,
        };
        if scan.offset == start {
            break;
        }
        let section = Section { start, length: scan.offset - start, lines };
        let number = number.unwrap_or(frames.len() as i64);
        if frames.last().is_some_and(|(last, _)| *last == number) {
            continue;
        }
        memory::grow(&mut frames, 1, path.display())?;
        frames.push((number, section));
    }
    if !frames.is_sorted_by_key(|(number, _)| *number) {
        (0..).zip(&mut frames).for_each(|(new, (number, _))| *number = new);
    }
    Ok((frames.len() > 1).then_some(frames))
}

/// A scan through the lines of a file.
struct Scan<'a> {
    path: &'a Path,
    file: BufReader<files::File>,
    /// Bytes and lines so far.
    offset: u64,
    lines: u64,
}

impl Scan<'_> {
    /// Reads a line, of which all but the start is skipped; empty at the end of the file.
    fn line(&mut self) -> Result<String> {
        /// Longest line of a header, bytes.
        const MOST: u64 = 1 << 12;
        let mut line = Vec::new();
        let read = self.file.by_ref().take(MOST).read_until(b'\n', &mut line);
        read.map_err(|source| Error::io(self.path, "read", source))?;
        self.offset += line.len() as u64;
        match line.last() {
            Some(b'\n') => self.lines += 1,
            Some(_) => self.skip_lines(1)?,
            None => {}
        }
        Ok(String::from_utf8_lossy(&line).into_owned())
    }

    /// Skips as many lines, or fewer at the end of the file.
    fn skip_lines(&mut self, count: u64) -> Result<()> {
        for _ in 0..count {
            let skipped = self.file.skip_until(b'\n');
            let skipped = skipped.map_err(|source| Error::io(self.path, "read", source))?;
            if skipped == 0 {
                break;
            }
            self.offset += skipped as u64;
            self.lines += 1;
        }
        Ok(())
    }

    fn skip_blank_lines(&mut self) -> Result<()> {
        loop {
            let start =
                self.file.fill_buf().map_err(|source| Error::io(self.path, "read", source))?;
            let blank = start.iter().take_while(|byte| byte.is_ascii_whitespace()).count();
            if blank == 0 {
                return Ok(());
            }
            self.lines += start[..blank].iter().filter(|&&byte| byte == b'\n').count() as u64;
            self.offset += blank as u64;
            self.file.consume(blank);
        }
    }

    fn count(&self, line: &str) -> Result<u64> {
        let found = line.trim();
        found.parse().map_err(|_| {
            let problem =
                format!("expected the number of particles of a frame, found `{found:.40}`");
            Error::malformed(self.path, Location::Line(self.lines), problem)
        })
    }

    /// Skips a frame of extended XYZ, which has no number.
    fn skip_counted(&mut self) -> Result<Option<i64>> {
        let line = self.line()?;
        if !line.is_empty() {
            let count = self.count(&line)?;
            self.skip_lines(count.saturating_add(1))?;
        }
        Ok(None)
    }

    /// Skips a frame of LAMMPS, and returns its time step.
    fn skip_step(&mut self) -> Result<Option<i64>> {
        let (mut step, mut count) = (None, 0);
        loop {
            let line = self.line()?;
            let Some(item) = line.strip_prefix("ITEM:").map(str::trim) else {
                if line.is_empty() {
                    return Ok(step);
                }
                let problem = format!("expected `ITEM:`, found `{:.40}`", line.trim_end());
                return Err(Error::malformed(self.path, Location::Line(self.lines), problem));
            };
            if item.starts_with("ATOMS") {
                self.skip_lines(count)?;
                return Ok(step);
            } else if item.starts_with("TIMESTEP") {
                step = self.line()?.trim().parse().ok();
            } else if item.starts_with("NUMBER OF ATOMS") {
                let line = self.line()?;
                count = self.count(&line)?;
            } else {
                self.skip_lines(if item.starts_with("BOX BOUNDS") { 3 } else { 1 })?;
            }
        }
    }
}
