//! Selection of the frames of a sequence, and shards for several machines.

use std::collections::{HashSet, VecDeque};
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::sequence::{Frame, Missing, Sequence};

/// Largest number of selected frames; more are taken for a typing error.
const MAX_FRAMES: u64 = 10_000_000;

/// Prefixes of a step in various programs, longer ones first.
const STEP_PREFIXES: [&str; 7] = ["every", "step", "by", "x", ":", "@", "s"];

/// Checks a rate, frames per second.
///
/// # Errors
/// [`Error::Usage`] unless it is between 0.01 and 1000.
pub fn check_fps(fps: f64) -> Result<()> {
    if (0.01..=1000.0).contains(&fps) {
        return Ok(());
    }
    Err(Error::Usage(format!("{fps} frames per second: expected between 0.01 and 1000")))
}

/// A selection of frames.
///
/// Its text is a list of frame numbers and ranges, separated by commas or blanks, in the notations of
/// renderers and render farms. A frame that is listed twice is drawn once.
///
/// | notation | frames | used by |
/// |---|---|---|
/// | `7`, `1,3,5`, `1 3 5` | these | all |
/// | `1-10`, `1..10` | 1 to 10 | all; Blender |
/// | `10-1` | the same, backwards | Deadline, `OpenCue` |
/// | `-5--1`, `-5..-1` | negative numbers | Nuke, `OpenCue`; Blender |
/// | `1-10x2` | every second frame: 1, 3, 5, 7, 9 | Nuke, Deadline, `OpenCue` |
/// | `1-10:2` | the same | Slurm's job arrays |
/// | `1-10s2`, `1-10@2`, `1-10step2`, `1-10by2`, `1-10every2` | the same | Deadline and others |
/// | `10-1x2`, `10-1x-2` | 10, 8, 6, 4, 2 | Deadline; `OpenCue` |
/// | `1-10y3` | the frames that `1-10x3` skips: 2, 3, 5, 6, 8, 9 | `OpenCue` |
/// | `1-10@b` | all, in binary order for a preview: the ends, then the middles | |
/// | `all` | all existing frames | |
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum FrameSpec {
    /// Every existing frame.
    #[default]
    All,
    /// These frames, in this order, without duplicates.
    List(Vec<i64>),
}

impl FrameSpec {
    /// The listed numbers, in order; none for `all`.
    pub fn frames(&self) -> impl Iterator<Item = i64> {
        let numbers: &[i64] = match self {
            Self::All => &[],
            Self::List(numbers) => numbers,
        };
        numbers.iter().copied()
    }

    /// The selected frames of a sequence.
    ///
    /// # Errors
    ///
    /// [`Error::MissingFrames`] if a listed frame does not exist, or for all frames of a sequence that lacks files.
    pub fn select<'a>(&self, sequence: &'a Sequence) -> Result<Vec<&'a Frame>> {
        let numbers = match self {
            Self::All => match sequence.absent.as_slice() {
                [] => return Ok(sequence.frames.iter().collect()),
                absent => return Err(absent_frames(sequence, absent)),
            },
            Self::List(numbers) => numbers,
        };
        let missing: Vec<i64> =
            numbers.iter().copied().filter(|&n| sequence.frame(n).is_none()).collect();
        if missing.is_empty() {
            return Ok(numbers.iter().filter_map(|&n| sequence.frame(n)).collect());
        }
        let some: Vec<String> = missing.iter().take(5).map(i64::to_string).collect();
        let problem = format!(
            "{} of {} frames are missing: {}{}; there are {} from {} to {}",
            missing.len(),
            numbers.len(),
            some.join(", "),
            if missing.len() > 5 { ", ..." } else { "" },
            sequence.frames.len(),
            sequence.frames.first().map_or(0, |frame| frame.number),
            sequence.frames.last().map_or(0, |frame| frame.number),
        );
        Err(Error::MissingFrames { pattern: sequence.pattern.clone(), problem })
    }
}

impl FrameSpec {
    /// The numbers of the selected frames. They include those in the [gaps](Sequence::gaps), unless a
    /// missing frame is an error.
    ///
    /// # Errors
    ///
    /// [`Error::MissingFrames`] if a listed frame does not exist and must; [`Error::Usage`] for more missing
    /// frames than can be intended.
    pub fn numbers(&self, sequence: &Sequence, missing: Missing) -> Result<Vec<i64>> {
        if missing == Missing::Error {
            return Ok(self.select(sequence)?.iter().map(|frame| frame.number).collect());
        }
        match (self, sequence.frames.as_slice()) {
            (Self::List(numbers), _) => Ok(numbers.clone()),
            (Self::All, _) if !sequence.absent.is_empty() => Ok(sequence.numbers()),
            (Self::All, [first, .., last]) => {
                let (first, last, stride) = (first.number, last.number, sequence.stride());
                let steps = last.abs_diff(first) / stride;
                if steps >= MAX_FRAMES {
                    let problem = format!("frames {first} to {last}: more than {MAX_FRAMES}");
                    return Err(Error::Usage(problem));
                }
                Ok((0..=steps).map(|k| first.saturating_add_unsigned(k * stride)).collect())
            }
            (Self::All, frames) => Ok(frames.iter().map(|frame| frame.number).collect()),
        }
    }
}

/// The error of a list with files that are missing.
fn absent_frames(sequence: &Sequence, absent: &[Frame]) -> Error {
    let some = absent.iter().take(5);
    let some: Vec<String> =
        some.map(|frame| format!("{} ({})", frame.number, frame.path.display())).collect();
    let problem = format!(
        "{} of {} listed files are missing: {}{}",
        absent.len(),
        sequence.frames.len() + absent.len(),
        some.join(", "),
        if absent.len() > 5 { ", ..." } else { "" },
    );
    Error::MissingFrames { pattern: sequence.pattern.clone(), problem }
}

impl fmt::Display for FrameSpec {
    /// Writes it as it is parsed, with consecutive frames as ranges: `1-3,5`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self::List(numbers) = self else { return f.write_str("all") };
        let runs = numbers.chunk_by(|a, b| a.checked_add(1) == Some(*b));
        for (i, run) in runs.enumerate() {
            let comma = if i > 0 { "," } else { "" };
            match run {
                [first, .., last] => write!(f, "{comma}{first}-{last}")?,
                _ => write!(f, "{comma}{}", run[0])?,
            }
        }
        Ok(())
    }
}

impl FromStr for FrameSpec {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        if text.trim().eq_ignore_ascii_case("all") {
            return Ok(Self::All);
        }
        let parts = || text.split([',', ' ', '\t']).filter(|part| !part.is_empty());
        // Counted before listing, since a short text may denote a huge range.
        let mut total = 0_u64;
        let mut ranges = Vec::new();
        for part in parts() {
            let range = Range::parse(part)?;
            total = total.saturating_add(range.count());
            if total > MAX_FRAMES {
                let problem = format!("frames `{text}`: more than {MAX_FRAMES} frames");
                return Err(Error::Usage(problem));
            }
            ranges.push(range);
        }
        if ranges.is_empty() {
            return Err(Error::Usage("frames: none given; write `1-10`, `1,5,9` or `all`".into()));
        }
        let mut seen = HashSet::new();
        let mut numbers = Vec::new();
        for range in ranges {
            range.for_each(|number| {
                if seen.insert(number) {
                    numbers.push(number);
                }
            });
        }
        Ok(Self::List(numbers))
    }
}

/// The frames from `first` to `last`, ascending or descending.
struct Range {
    first: i64,
    last: i64,
    order: Order,
}

enum Order {
    /// Every n-th frame.
    Step(u64),
    /// The frames that a step of n skips.
    Between(u64),
    Binary,
}

impl Range {
    fn parse(part: &str) -> Result<Self> {
        let usage = |problem: &str| Error::Usage(format!("frames `{part}`: {problem}"));
        let syntax = || usage("expected a number, a range `1-10`, steps `1-10x2`, or `1-10@b`");
        let (first, rest) = number(part).ok_or_else(syntax)?;
        if rest.is_empty() {
            return Ok(Self { first, last: first, order: Order::Step(1) });
        }
        let to = rest.strip_prefix("..").or_else(|| rest.strip_prefix('-'));
        let (last, rest) = to.and_then(number).ok_or_else(syntax)?;
        if matches!(rest, "" | "@b") {
            let order = if rest.is_empty() { Order::Step(1) } else { Order::Binary };
            return Ok(Self { first, last, order });
        }
        let step = STEP_PREFIXES.iter().find_map(|word| rest.strip_prefix(word));
        let step = step.or_else(|| rest.strip_prefix('y')).ok_or_else(syntax)?;
        // A descending range may have a negative step; an ascending one may not.
        let step = if last < first { step.strip_prefix('-').unwrap_or(step) } else { step };
        let order = match step.parse() {
            Ok(0) => return Err(usage("expected a step of 1 or more")),
            Ok(1) if rest.starts_with('y') => return Err(usage("leaves out every frame")),
            Ok(step) if rest.starts_with('y') => Order::Between(step),
            Ok(step) => Order::Step(step),
            Err(_) => return Err(syntax()),
        };
        Ok(Self { first, last, order })
    }

    /// Number of frames visited, before [`Order::Between`] skips any.
    fn count(&self) -> u64 {
        let step = if let Order::Step(step) = self.order { step } else { 1 };
        (self.last.abs_diff(self.first) / step).saturating_add(1)
    }

    fn for_each(&self, mut visit: impl FnMut(i64)) {
        let (first, last) = (self.first, self.last);
        let at = |distance: u64| match last < first {
            true => first.saturating_sub_unsigned(distance),
            false => first.saturating_add_unsigned(distance),
        };
        match self.order {
            Order::Step(step) => (0..self.count()).for_each(|i| visit(at(i * step))),
            Order::Between(step) => {
                (0..self.count()).filter(|i| i % step != 0).for_each(|i| visit(at(i)));
            }
            Order::Binary => {
                visit(first);
                visit(last);
                let mut gaps = VecDeque::from([(0, last.abs_diff(first))]);
                while let Some((low, high)) = gaps.pop_front() {
                    let middle = low + (high - low) / 2;
                    if middle > low {
                        visit(at(middle));
                        gaps.extend([(low, middle), (middle, high)]);
                    }
                }
            }
        }
    }
}

/// Splits `text` after the integer that it begins with, which may be negative.
fn number(text: &str) -> Option<(i64, &str)> {
    let unsigned = text.strip_prefix('-').unwrap_or(text);
    let digits = unsigned.bytes().take_while(u8::is_ascii_digit).count();
    let (number, rest) = text.split_at(text.len() - unsigned.len() + digits);
    Some((number.parse().ok()?, rest))
}

/// One machine's share of the work: every `count`-th frame, starting with the `index`-th.
///
/// Its text is `index/count`, with `index` from 1: `2/4` is the second of four shards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    index: usize,
    count: usize,
}

impl Shard {
    /// Shard `index` (from 1) of `count`.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] unless 1 ≤ `index` ≤ `count`.
    pub fn new(index: usize, count: usize) -> Result<Self> {
        if (1..=count).contains(&index) {
            return Ok(Self { index, count });
        }
        Err(Error::Usage(format!("shard {index}/{count}: expected an index from 1 to the count")))
    }

    /// The items of this shard, in order.
    pub fn of<T>(self, items: impl IntoIterator<Item = T>) -> impl Iterator<Item = T> {
        items.into_iter().skip(self.index - 1).step_by(self.count)
    }
}

impl Default for Shard {
    /// The single shard `1/1`.
    fn default() -> Self {
        Self { index: 1, count: 1 }
    }
}

impl FromStr for Shard {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let parts = text.split_once('/').and_then(|(index, count)| {
            Some((index.trim().parse().ok()?, count.trim().parse().ok()?))
        });
        let (index, count) = parts
            .ok_or_else(|| Error::Usage(format!("shard `{text}`: expected `1/4` or the like")))?;
        Self::new(index, count)
    }
}
