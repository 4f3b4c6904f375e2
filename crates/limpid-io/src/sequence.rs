//! Sequences: the files of an input, as numbered frames.

mod companions;
mod frame_time;
mod missing;
mod names;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::budget::Budget;
use crate::error::{Error, Result};
use crate::identity::folder_of;
use crate::particles::{
    Contents, ReadOptions, Remark, Section, extensions, is_particles, particles_in, pieces,
    readable_stem, trajectory,
};
use crate::pattern::placeholder;
use crate::{files, vtk_lists};

pub(crate) use self::companions::companions_of;
pub use self::frame_time::FrameTime;
pub use self::missing::Missing;
pub(crate) use self::names::is_absent;
#[cfg(not(target_arch = "wasm32"))]
pub(crate) use self::names::name_of_frames;
use self::names::{
    NOT_TEXT, Pattern, absent, common_prefix, extension, file_name, file_names, is_piece_list,
    is_series, is_text, split_number,
};

/// The frames of an input, ordered by their numbers, which are unique.
#[derive(Debug, Clone, PartialEq)]
pub struct Sequence {
    /// The frames, by ascending number. Never empty.
    pub frames: Vec<Frame>,
    /// The pattern of the files, with `{}` for the number where limpid has derived it.
    pub pattern: String,
    /// Frames per second, if a list of the files has their times.
    pub fps: Option<f64>,
    /// Frames that a list of the files names, but whose files are missing, by ascending number.
    pub absent: Vec<Frame>,
}

/// One frame of a sequence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// The number in the file name.
    pub number: i64,
    /// Path of the file.
    pub path: PathBuf,
    /// Further files with particles of the frame, as of a simulation on several ranks.
    pub parts: Vec<PathBuf>,
    /// Its part of the file, if that has several frames.
    pub section: Option<Section>,
}

impl Frame {
    /// A frame in one file.
    pub fn new(number: i64, path: PathBuf) -> Self {
        Self { number, path, parts: Vec::new(), section: None }
    }

    /// Reads its part of a file, its file, or its files as one.
    ///
    /// # Errors
    /// As [`Contents::read`].
    pub fn read(&self, options: &ReadOptions) -> Result<Contents> {
        if let Some(section) = self.section {
            return trajectory::read_section(&self.path, section, options);
        }
        let budget = Budget::new(options.max_unpacked);
        let mut parts = Vec::new();
        for path in std::iter::once(&self.path).chain(&self.parts) {
            let contents = Contents::read_within(path, options, &budget)?;
            parts.push((path.display().to_string(), contents));
        }
        pieces::joined(&self.path, parts)
    }
}

impl Sequence {
    /// Finds the frames of `input`:
    ///
    /// - a time series, `.pvd` or `.series`: the listed files, numbered from 0, of which some may be
    ///   [absent](Self::absent);
    /// - extended XYZ, LAMMPS dumps and arrays (`.npy`, `.npz`, HDF5) with several frames: these, numbered from 0 or
    ///   by their time steps;
    /// - another existing file: one frame, numbered by the last digits in its name, or 0;
    /// - an existing folder: the particle files in it, whose names must differ only in the number; if the names of
    ///   none say so, those that begin like particle files; or a case of OpenFOAM, its times numbered from 0;
    /// - a pattern, whose file name contains one of `{}`, `%d`, `$F` (a number of any width), `%04d`,
    ///   `$F4`, `####` (a number of at least that many digits). Gaps between numbers are allowed;
    /// - a pattern with `*`, which stands for any text: files whose names differ only in the number;
    /// - a pattern with `{r}` for the number of a rank, and perhaps a placeholder for that of the frame: the files
    ///   of all ranks are one frame. Ranks are numbered from 0 or 1 without gaps.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the file or folder does not exist or cannot be listed,
    /// [`Error::Sequence`] if nothing matches or two files have the same number.
    pub fn open(input: impl AsRef<Path>) -> Result<Self> {
        let sequence = Self::find(input.as_ref())?;
        if let [Frame { path, parts, .. }] = sequence.frames.as_slice()
            && parts.is_empty()
            && let Some(trajectory) = trajectory::frames_of(path)?
        {
            let frame = |(number, section)| Frame {
                section: Some(section),
                ..Frame::new(number, path.clone())
            };
            let frames = trajectory.frames.into_iter().map(frame).collect();
            return Ok(Self { frames, fps: trajectory.fps.or(sequence.fps), ..sequence });
        }
        Ok(sequence)
    }

    fn find(path: &Path) -> Result<Self> {
        let pattern = match files::metadata(path) {
            Ok(metadata) if metadata.is_dir() => return Self::from_folder(path),
            Ok(_) => None,
            Err(_) if is_text(path) && file_name(path).contains("{r}") => {
                return Self::from_ranks(path);
            }
            Err(_) if is_text(path) && file_name(path).contains('*') => {
                return Self::from_glob(path);
            }
            Err(error) => Some(Pattern::parse(path)?.ok_or_else(|| absent(path, error))?),
        };
        match pattern {
            Some(pattern) => Self::from_pattern(path, &pattern),
            None if is_series(path) => Self::from_series(path),
            None => {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                let number = split_number(&name).map_or(0, |(_, number, _)| number);
                let frames = vec![Frame::new(number, path.to_owned())];
                let pattern = path.display().to_string();
                Ok(Self { frames, pattern, fps: None, absent: Vec::new() })
            }
        }
    }

    /// Finds the sequence that a file belongs to: the files in its folder whose names differ only in the
    /// last number. `None` if the name has no number.
    pub(crate) fn around(file: &Path) -> Option<Self> {
        let name = file.file_name()?.to_str()?;
        let (prefix, _, suffix) = split_number(name)?;
        let folder = folder_of(file);
        let pattern = Pattern { folder, prefix, suffix, width: 1 };
        Self::from_pattern(file, &pattern).ok()
    }

    /// The names of the files of these frames, by the last part of a pattern; `None` without a placeholder.
    pub fn names(pattern: &str, numbers: impl Iterator<Item = i64>) -> Option<Vec<String>> {
        let name = file_name(Path::new(pattern));
        let (at, length, width) = placeholder(&name)?;
        let (prefix, suffix) = (&name[..at], &name[at + length..]);
        Some(numbers.map(|number| format!("{prefix}{number:0width$}{suffix}")).collect())
    }

    /// The frame with this number, if there is one.
    pub fn frame(&self, number: i64) -> Option<&Frame> {
        let at = self.frames.binary_search_by_key(&number, |frame| frame.number).ok()?;
        self.frames.get(at)
    }

    /// The frame to show for a number, if there is one.
    pub(crate) fn shown(&self, number: i64, missing: Missing) -> Option<&Frame> {
        let after = self.frames.partition_point(|frame| frame.number <= number);
        let before = after.checked_sub(1).and_then(|at| self.frames.get(at));
        before.filter(|frame| frame.number == number || missing == Missing::Hold)
    }

    /// As [`Sequence::shown`], for a frame that must be there unless missing ones are allowed.
    ///
    /// # Errors
    /// [`Error::MissingFrame`].
    pub(crate) fn shown_or_missing(&self, number: i64, missing: Missing) -> Result<Option<&Frame>> {
        match self.shown(number, missing) {
            None if missing == Missing::Error => {
                Err(Error::MissingFrame { pattern: self.pattern.clone(), frame: number })
            }
            shown => Ok(shown),
        }
    }

    /// Reads the frame to show for a number; `None` where there is none. Unless missing frames are errors, one that
    /// cannot be read is treated as missing, with a remark. Returns also the number of the frame that was read.
    ///
    /// # Errors
    /// [`Error::MissingFrame`]; as `read`.
    pub(crate) fn read_shown<T>(
        &self,
        number: i64,
        missing: Missing,
        remarks: &mut Vec<Remark>,
        mut read: impl FnMut(&Frame) -> Result<T>,
    ) -> Result<Option<(i64, T)>> {
        let mut frame = self.shown_or_missing(number, missing)?;
        // That of the frame which should have been shown.
        let mut problem = None;
        let mut shown = None;
        while let Some(wanted) = frame {
            match read(wanted) {
                Ok(contents) => {
                    shown = Some((wanted.number, contents));
                    break;
                }
                Err(error) if missing != Missing::Error && error.is_of_reading() => {
                    problem.get_or_insert_with(|| error.to_string());
                    let before = wanted.number.checked_sub(1);
                    let before = before.filter(|_| missing == Missing::Hold);
                    frame = before.and_then(|before| self.shown(before, missing));
                }
                Err(error) => return Err(error),
            }
        }
        let number = shown.as_ref().map(|(number, _)| *number);
        remarks.extend(problem.map(|problem| Remark::Unread { problem, shown: number }));
        Ok(shown)
    }

    /// Stride of the frame numbers, which is the length of a frame on the clock: the [even](Self::even_stride)
    /// one, or else the mean difference, rounded down.
    pub fn stride(&self) -> u64 {
        self.even_stride().unwrap_or_else(|| {
            let differences = self.differences();
            let span = differences.iter().copied().fold(0, u64::saturating_add);
            (span / differences.len().max(1) as u64).max(1)
        })
    }

    /// The stride of evenly numbered frames: the greatest common divisor of the differences of their numbers,
    /// 1 for a single frame. Some simulators number files by time step and write, say, every hundredth.
    ///
    /// `None` for frames that are numbered unevenly, as by steps of varying length: those for which fewer than half
    /// of the numbers by that stride exist, and which have another difference more often.
    pub fn even_stride(&self) -> Option<u64> {
        let gcd = |mut a: u64, mut b: u64| {
            while b > 0 {
                (a, b) = (b, a % b);
            }
            a
        };
        let differences = self.differences();
        let stride = differences.iter().copied().fold(0, gcd).max(1);
        let span = differences.iter().copied().fold(0, u64::saturating_add);
        let is_dense = span / stride < 2 * (differences.len() as u64 + 1);
        // Of equally frequent ones, the least.
        let usual = differences.chunk_by(|a, b| a == b).rev().max_by_key(|equal| equal.len());
        (is_dense || usual.is_none_or(|equal| equal[0] == stride)).then_some(stride)
    }

    /// Whether consecutive frames have numbers that are not consecutive: the steps of a simulation, which may
    /// vary. Ranges of numbers then mean the frames in them.
    pub fn is_by_steps(&self) -> bool {
        self.even_stride() != Some(1)
    }

    /// The numbers of the frames and of those that are [absent](Self::absent), ascending.
    pub fn numbers(&self) -> Vec<i64> {
        let mut numbers: Vec<i64> =
            self.frames.iter().chain(&self.absent).map(|frame| frame.number).collect();
        numbers.sort_unstable();
        numbers
    }

    /// Differences of consecutive numbers, ascending.
    fn differences(&self) -> Vec<u64> {
        let numbers = self.numbers();
        let mut differences: Vec<u64> =
            numbers.array_windows().map(|[a, b]| b.abs_diff(*a)).collect();
        differences.sort_unstable();
        differences
    }

    /// The ranges of missing numbers between frames, as the first and the last of each, and the frames before and
    /// after all others that are absent. Unevenly numbered frames have none between them.
    pub fn gaps(&self) -> Vec<(i64, i64)> {
        let Some(stride) = self.even_stride() else { return Vec::new() };
        let pairs = self.frames.array_windows();
        let gaps = pairs.filter(|[a, b]| b.number.abs_diff(a.number) > stride);
        let ends = |[a, b]: &[Frame; 2]| {
            (a.number.saturating_add_unsigned(stride), b.number.saturating_sub_unsigned(stride))
        };
        let outside = self.absent.iter().map(|frame| frame.number).filter(|&number| {
            let after = self.frames.partition_point(|frame| frame.number < number);
            after == 0 || after == self.frames.len()
        });
        let mut gaps: Vec<_> = gaps.map(ends).chain(outside.map(|n| (n, n))).collect();
        gaps.sort_unstable();
        gaps
    }

    /// Merges the frames of two sequences by number; where both have a frame, that of `self` is kept.
    pub(crate) fn joined(mut self, other: &Self) -> Self {
        let new = other.frames.iter().filter(|frame| self.frame(frame.number).is_none());
        let new: Vec<Frame> = new.cloned().collect();
        self.frames.extend(new);
        self.frames.sort_by_key(|frame| frame.number);
        self.absent.extend(other.absent.iter().cloned());
        self.absent.sort_by_key(|frame| frame.number);
        self.absent.dedup_by_key(|frame| frame.number);
        let frames = &self.frames;
        let has = |number| frames.binary_search_by_key(&number, |frame| frame.number).is_ok();
        self.absent.retain(|frame| !has(frame.number));
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
        let all_have_one = times.len() == listed.len();
        let fps = vtk_lists::rate(&times).filter(|_| all_have_one);
        let frames = (0..).zip(listed).map(|(number, file)| Frame::new(number, file.path));
        let (absent, frames): (Vec<_>, Vec<_>) = frames.partition(|frame| is_absent(&frame.path));
        let pattern = path.display().to_string();
        match absent.first().filter(|_| frames.is_empty()) {
            Some(first) => {
                let problem = format!("none of its files is there: {}", first.path.display());
                Err(Error::Sequence { pattern, problem })
            }
            None => Ok(Self { frames, pattern, fps, absent }),
        }
    }

    fn from_pattern(path: &Path, pattern: &Pattern<'_>) -> Result<Self> {
        let (input, folder) = (path.display().to_string(), pattern.folder);
        let names = file_names(folder)?;
        let matches = names
            .iter()
            .filter_map(|name| Some(Frame::new(pattern.number(name)?, folder.join(name))));
        let frames: Vec<Frame> = matches.collect();
        if frames.is_empty() {
            let similar = names.iter().filter(|name| readable_stem(name).is_some());
            let hint = similar
                .max_by_key(|name| common_prefix(pattern.prefix.bytes(), name.bytes()))
                .map_or(String::new(), |name| format!("; `{name}` is there"));
            let problem = format!("no file of this name in {}{hint}", folder.display());
            return Err(Error::Sequence { pattern: input, problem });
        }
        Self::sorted(frames, input)
    }

    fn from_folder(folder: &Path) -> Result<Self> {
        let names = file_names(folder)?;
        // The pieces of listed frames are no frames of their own.
        let lists = names.iter().any(|name| is_piece_list(name));
        let is_frame =
            |name: &String| readable_stem(name).is_some() && is_piece_list(name) == lists;
        let mut known: Vec<String> = names.iter().filter(|name| is_frame(name)).cloned().collect();
        if known.is_empty() {
            known = particles_in(folder, names);
        }
        let names = known;
        if names.is_empty() {
            if let Some(case) = Self::from_foam_case(folder)? {
                return Ok(case);
            }
            let problem =
                format!("no particle files in this folder; limpid reads {}", extensions());
            return Err(Error::Sequence { pattern: folder.display().to_string(), problem });
        }
        Self::from_names(folder, &names, "in this folder")
    }

    /// The times of a case of OpenFOAM with one cloud of parcels, numbered from 0; `None` for other folders.
    fn from_foam_case(folder: &Path) -> Result<Option<Self>> {
        let mut times = Vec::new();
        for name in file_names(folder)? {
            let Some(time) = name.parse::<f64>().ok().filter(|time| time.is_finite()) else {
                continue;
            };
            let parcels = folder.join(&name).join("lagrangian");
            let mut clouds = file_names(&parcels).unwrap_or_default();
            clouds.retain(|cloud| files::is_file(&parcels.join(cloud).join("positions")));
            match clouds.as_slice() {
                [] => {}
                [cloud] => times.push((time, parcels.join(cloud).join("positions"))),
                _ => {
                    let problem = format!(
                        "several clouds in {name}/lagrangian: {}; name the `positions` of one",
                        clouds.join(", ")
                    );
                    return Err(Error::Sequence { pattern: folder.display().to_string(), problem });
                }
            }
        }
        times.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let seconds: Vec<f64> = times.iter().map(|(time, _)| *time).collect();
        let frames: Vec<Frame> =
            (0..).zip(times).map(|(number, (_, path))| Frame::new(number, path)).collect();
        let pattern = folder.display().to_string();
        let fps = vtk_lists::rate(&seconds);
        Ok(Some(Self { frames, pattern, fps, absent: Vec::new() })
            .filter(|case| !case.frames.is_empty()))
    }

    /// The files that match a name with `*`.
    fn from_glob(path: &Path) -> Result<Self> {
        let (folder, name) = (folder_of(path), file_name(path));
        let parts: Vec<&str> = name.split('*').collect();
        let matches = |name: &String| {
            let [first, between @ .., last] = parts.as_slice() else { return false };
            let Some(rest) = name.strip_prefix(first) else { return false };
            let Some(mut rest) = rest.strip_suffix(last) else { return false };
            between.iter().all(|part| match rest.split_once(part) {
                Some((_, after)) => {
                    rest = after;
                    true
                }
                None => false,
            })
        };
        let names: Vec<String> = file_names(folder)?.into_iter().filter(matches).collect();
        let known: Vec<String> =
            names.iter().filter(|name| readable_stem(name).is_some()).cloned().collect();
        let by_content = || names.into_iter().filter(|name| is_particles(&folder.join(name)));
        let names = if known.is_empty() { by_content().collect() } else { known };
        if names.is_empty() {
            let problem = format!("no particle file of this name in {}", folder.display());
            return Err(Error::Sequence { pattern: path.display().to_string(), problem });
        }
        Self::from_names(folder, &names, "match")
    }

    /// The files of several ranks: a name with `{r}` and a placeholder for the frame, in any order.
    fn from_ranks(path: &Path) -> Result<Self> {
        let input = path.display().to_string();
        let (folder, name) = (folder_of(path), file_name(path));
        let fail = |problem: String| Error::Sequence { pattern: input.clone(), problem };
        let (before, after) = name.split_once("{r}").unwrap_or((&name, ""));
        // In place of the rank's number, each of those that occur.
        let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
        let of_frame = |text: &str| placeholder(text).is_some();
        if of_frame(before) && of_frame(after) {
            return Err(fail(
                "expected one place for the frame's number, as rank{r}_{}.vtu".into(),
            ));
        }
        // The number of a single frame is the last in its name but the rank's.
        let single = split_number(&format!("{before}{after}")).map_or(0, |(_, number, _)| number);
        let mut frames: BTreeMap<i64, BTreeMap<i64, PathBuf>> = BTreeMap::new();
        for file in file_names(folder)? {
            // The literal text before the rank ends at the first placeholder or at the rank.
            for at in 0..file.len() {
                let Some(rest) = file.get(at..) else { continue };
                let length = digits(rest);
                if length == 0 || at > 0 && file.as_bytes()[at - 1].is_ascii_digit() {
                    continue;
                }
                let Ok(rank) = rest[..length].parse::<i64>() else { continue };
                let (left, right) = (&file[..at], &rest[length..]);
                let number = match of_frame(before) {
                    true if right == after => {
                        Pattern::of_name(folder, before).and_then(|p| p.number(left))
                    }
                    false if left == before && right == after => Some(single),
                    false if left == before => {
                        Pattern::of_name(folder, after).and_then(|p| p.number(right))
                    }
                    _ => None,
                };
                if let Some(number) = number {
                    frames.entry(number).or_default().insert(rank, folder.join(&file));
                    break;
                }
            }
        }
        let ranks: BTreeSet<i64> =
            frames.values().flat_map(|ranks| ranks.keys().copied()).collect();
        let numbers: Vec<i64> = ranks.iter().copied().collect();
        let gap = numbers.array_windows().find(|[a, b]| *b != a + 1).map(|[a, _]| a + 1);
        if let Some(missing) = gap.or_else(|| (*numbers.first()? > 1).then_some(0)) {
            return Err(fail(format!("the file of rank {missing} is missing")));
        }
        for (number, of_frame) in &frames {
            if let Some(missing) = ranks.iter().find(|rank| !of_frame.contains_key(rank)) {
                return Err(fail(format!("frame {number} lacks the file of rank {missing}")));
            }
        }
        let frame = |(number, ranks): (i64, BTreeMap<i64, PathBuf>)| {
            let mut paths = ranks.into_values();
            let first = Frame::new(number, paths.next()?);
            Some(Frame { parts: paths.collect(), ..first })
        };
        let frames: Vec<Frame> = frames.into_iter().filter_map(frame).collect();
        if frames.is_empty() {
            return Err(fail(format!("no file of this name in {}", folder.display())));
        }
        Self::sorted(frames, input)
    }

    /// The pattern of several files whose names differ only in the number, and their numbers, ascending:
    /// of a pattern that a shell has expanded.
    ///
    /// # Errors
    /// [`Error::Sequence`] if they differ in more than the number.
    pub fn pattern_of(files: &[PathBuf]) -> Result<(PathBuf, Vec<i64>)> {
        let mut numbers = BTreeSet::new();
        let mut pattern: Option<PathBuf> = None;
        for path in files {
            let fail =
                |problem: String| Error::Sequence { pattern: path.display().to_string(), problem };
            let name = path.file_name().unwrap_or_default().to_str();
            let name = name.ok_or_else(|| fail(NOT_TEXT.into()))?;
            let (prefix, number, suffix) = split_number(name)
                .ok_or_else(|| fail("several inputs, but this name has no number".into()))?;
            let own = path.with_file_name(format!("{prefix}{{}}{suffix}"));
            match &pattern {
                Some(first) if *first != own => {
                    let problem = format!(
                        "does not belong to the sequence {}; name the files of one sequence",
                        first.display()
                    );
                    return Err(fail(problem));
                }
                _ => pattern = Some(own),
            }
            numbers.insert(number);
        }
        let pattern = pattern.ok_or_else(|| Error::Usage("expected a file".into()))?;
        Ok((pattern, numbers.into_iter().collect()))
    }

    /// Frames of files in a folder whose names differ only in the number; `place` is where they were found. Files of
    /// foam and the like beside liquid are left out.
    fn from_names(folder: &Path, names: &[String], place: &str) -> Result<Self> {
        let names = &companions::liquid_among(names);
        let mut stems = BTreeSet::new();
        let mut frames = Vec::new();
        for name in names {
            let (stem, number) = match split_number(name) {
                Some((prefix, number, suffix)) => (format!("{prefix}{{}}{suffix}"), number),
                None => (name.clone(), 0),
            };
            stems.insert(stem);
            frames.push(Frame::new(number, folder.join(name)));
        }
        let count = stems.len();
        let some: Vec<String> = stems.into_iter().take(8).collect();
        match some.as_slice() {
            [stem] => Self::sorted(frames, folder.join(stem).display().to_string()),
            _ => {
                let more = if count > some.len() { ", ..." } else { "" };
                let problem = format!(
                    "{count} sequences {place}; name one by its pattern: {}{more}",
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
        Ok(Self { frames, pattern, fps: None, absent: Vec::new() })
    }
}
