//! Files with several frames: extended XYZ, LAMMPS dumps, and arrays with an axis of time steps. The place
//! of each frame is found first, and a frame is read alone, so that a file may be larger than the memory.

use std::io::{self, BufRead, BufReader, Read as _, Seek as _, SeekFrom};
use std::path::Path;

use super::{Contents, ReadOptions, Reading, Remark, by_content, hdf5, npy, npz};
use crate::budget::Budget;
use crate::error::{Error, Location, Result};
use crate::{files, vtk_lists};
use limpid::memory;

/// A frame of a file with several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Section {
    /// A part of a text file.
    Text {
        /// Offset, bytes.
        start: u64,
        /// Length, bytes.
        length: u64,
        /// Number of lines before it.
        lines: u64,
        /// The first time step in the file that does not follow the one before it, for which the frames are
        /// numbered from 0 instead of by their steps.
        unordered: Option<i64>,
    },
    /// A time step of arrays, from 0.
    Step(usize),
}

/// The frames of a file with several.
pub(crate) struct Trajectory {
    /// Their numbers, ascending, and where they are.
    pub(crate) frames: Vec<(i64, Section)>,
    /// Whether the file has more than one, of which some may be the same.
    several: bool,
    /// Frames per second, if the file has even times.
    pub(crate) fps: Option<f64>,
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
    let contents = match (section, kind_of(path)) {
        (Section::Text { start, length, lines, unordered }, _) => {
            let mut contents = read_text(path, Text { start, length, lines }, options)?;
            contents.remarks.extend(unordered.map(|step| Remark::Renumbered { step }));
            return Ok(contents);
        }
        (Section::Step(step), Some(Kind::Npy)) => npy::read_step(path, step, options),
        (Section::Step(step), Some(Kind::Npz)) => npz::read_step(path, step, options),
        (Section::Step(step), _) => hdf5::read_step(path, step, options),
    }?;
    contents.finished(path, &Reading::new(options, &Budget::new(options.max_unpacked)))
}

/// A part of a text file: [`Section::Text`].
#[derive(Clone, Copy)]
struct Text {
    start: u64,
    length: u64,
    lines: u64,
}

fn read_text(path: &Path, text: Text, options: &ReadOptions) -> Result<Contents> {
    let Text { start, length, lines } = text;
    let fail = |source| Error::io(path, "read", source);
    let format = by_content::of_file(path)?.format;
    let (mut file, metadata) = files::open(path)?;
    let budget = Budget::of_length(options.max_unpacked, length);
    if length > budget.limit() {
        let limit = budget.limit();
        let problem = format!("a frame of {length} bytes, expected at most {limit}");
        return Err(Error::format(path, problem));
    }
    let length = usize::try_from(length).map_err(|_| fail(io::ErrorKind::FileTooLarge.into()))?;
    let mut bytes = memory::zeroed(length, path.display())?;
    file.seek(SeekFrom::Start(start)).map_err(fail)?;
    let read = file.read_exact(&mut bytes);
    files::unchanged(path, &file, &metadata)?;
    read.map_err(fail)?;
    let contents = format.parse(path, &bytes, &Reading::new(options, &budget));
    contents.map_err(|mut error| {
        if let Error::Malformed { location: Location::Line(line), .. }
        | Error::Unplaced { location: Location::Line(line), .. } = &mut error
        {
            *line += lines;
        }
        error
    })
}

/// Formats whose files may have several frames.
#[derive(Clone, Copy)]
enum Kind {
    ExtendedXyz,
    Lammps,
    Npy,
    Npz,
    Hdf5,
}

/// Whether a file may have several frames.
pub(crate) fn may_have_several(path: &Path) -> bool {
    kind_of(path).is_some()
}

fn kind_of(path: &Path) -> Option<Kind> {
    let found = by_content::of_file(path).ok()?;
    match found.format.extension {
        // A frame in a compressed file cannot be read alone.
        _ if found.gzip => None,
        ".xyz" | ".extxyz" => Some(Kind::ExtendedXyz),
        ".lammpstrj" | ".dump" => Some(Kind::Lammps),
        ".npy" => Some(Kind::Npy),
        ".npz" => Some(Kind::Npz),
        ".h5" | ".hdf5" => Some(Kind::Hdf5),
        _ => None,
    }
}

/// Finds the frames of a file with several; `None` for other files. They are numbered from 0, or by their time
/// steps where the file has these.
///
/// # Errors
/// [`Error::Io`], and [`Error::Malformed`] if something else follows a frame.
pub(crate) fn frames_of(path: &Path) -> Result<Option<Trajectory>> {
    let trajectory = match kind_of(path) {
        None => return Ok(None),
        Some(Kind::ExtendedXyz) => scan(path, |scan| scan.skip_counted())?,
        Some(Kind::Lammps) => scan(path, |scan| scan.skip_step())?,
        Some(Kind::Npy) => steps(npy::steps(path)?, &[], &[]),
        Some(Kind::Npz) => {
            let (count, times) = npz::steps(path)?;
            steps(count, &[], &times)
        }
        Some(Kind::Hdf5) => {
            let hdf5::Steps { count, numbers, times } = hdf5::steps(path)?;
            steps(count, &numbers, &times)
        }
    };
    Ok(Some(trajectory).filter(|trajectory| trajectory.several))
}

/// The frames of time steps, with their numbers, if they ascend, and their times.
fn steps(count: usize, numbers: &[i64], times: &[f64]) -> Trajectory {
    /// Largest number of steps: a header can claim any. The reader refuses more.
    const MOST: usize = 1 << 20;
    let count = if count > MOST { 1 } else { count };
    let ascend = numbers.len() == count && numbers.array_windows().all(|[a, b]| a < b);
    let number = |step: usize| if ascend { numbers[step] } else { step as i64 };
    Trajectory {
        several: count > 1,
        frames: (0..count).map(|step| (number(step), Section::Step(step))).collect(),
        fps: vtk_lists::rate(times).filter(|_| times.len() == count),
    }
}

/// Finds the frames of a text file by a function that skips one and returns its number, if it has one. A frame that is
/// there twice in a row, as at the start of a continued run, counts once; numbers that do not ascend are replaced.
fn scan(path: &Path, skip: impl Fn(&mut Scan<'_>) -> Result<Option<i64>>) -> Result<Trajectory> {
    let (file, _) = files::open(path)?;
    let mut scan =
        Scan { path, file: BufReader::with_capacity(1 << 20, file), offset: 0, lines: 0 };
    let mut frames: Vec<(i64, Text)> = Vec::new();
    let mut several = false;
    loop {
        scan.skip_blank_lines()?;
        let (start, lines) = (scan.offset, scan.lines);
        let number = match skip(&mut scan) {
            // The reader reports the kind of the file.
            Err(_) if frames.is_empty() => break,
            number => number?,
        };
        if scan.offset == start {
            break;
        }
        let section = Text { start, length: scan.offset - start, lines };
        let number = number.unwrap_or(frames.len() as i64);
        several = !frames.is_empty();
        if let Some((last, before)) = frames.last()
            && *last == number
            && are_same(path, *before, section)?
        {
            continue;
        }
        memory::grow(&mut frames, 1, path.display())?;
        frames.push((number, section));
    }
    let unordered =
        frames.array_windows().find(|[(a, _), (b, _)]| a >= b).map(|[_, (step, _)]| *step);
    if unordered.is_some() {
        (0..).zip(&mut frames).for_each(|(new, (number, _))| *number = new);
    }
    let frames = frames.into_iter().map(|(number, Text { start, length, lines })| {
        (number, Section::Text { start, length, lines, unordered })
    });
    Ok(Trajectory { frames: frames.collect(), several, fps: None })
}

/// Whether two parts of a file have the same bytes.
fn are_same(path: &Path, a: Text, b: Text) -> Result<bool> {
    const BLOCK: usize = 1 << 16;
    if a.length != b.length || !files::READS_PARTS {
        return Ok(false);
    }
    let (file, _) = files::open(path)?;
    let mut blocks = [vec![0; BLOCK], vec![0; BLOCK]];
    let mut offset = 0;
    while offset < a.length {
        let length = (a.length - offset).min(BLOCK as u64) as usize;
        for (block, start) in blocks.iter_mut().zip([a.start, b.start]) {
            let read = files::read_at(&file, &mut block[..length], start + offset);
            read.map_err(|source| Error::io(path, "read", source))?;
        }
        if blocks[0][..length] != blocks[1][..length] {
            return Ok(false);
        }
        offset += length as u64;
    }
    Ok(true)
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
