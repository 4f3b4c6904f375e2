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
///
/// Of a sequence that is [numbered by steps](Sequence::is_by_steps), a range means the frames between its ends:
/// of files 0, 1500, 3000, the range `0-3000` means these three, and `0-3000x2` the first and the last.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum FrameSpec {
    /// Every existing frame.
    #[default]
    All,
    /// The frames of these ranges, in this order, without duplicates.
    Ranges(Vec<Range>),
}

impl FrameSpec {
    /// These frames, in this order.
    pub fn list(numbers: impl IntoIterator<Item = i64>) -> Self {
        let mut ranges = Vec::new();
        for number in numbers {
            push(&mut ranges, Range::of(number));
        }
        Self::Ranges(ranges)
    }

    /// The listed numbers, in order; none for `all`.
    ///
    /// # Errors
    /// [`Error::Usage`] for more than can be intended.
    pub fn frames(&self) -> Result<Vec<i64>> {
        let mut numbers = Numbers::default();
        for range in self.ranges() {
            numbers.extend(range, |distance| range.at(distance), range.order, range.span())?;
        }
        Ok(numbers.list)
    }

    fn ranges(&self) -> &[Range] {
        match self {
            Self::All => &[],
            Self::Ranges(ranges) => ranges,
        }
    }

    /// Whether it has a range that [counts](Self) the frames of a sequence that is numbered by steps.
    pub fn counts_steps(&self, sequence: &Sequence) -> bool {
        sequence.is_by_steps() && self.ranges().iter().any(|range| range.span() > 0)
    }

    /// The selected frames of a sequence.
    ///
    /// # Errors
    ///
    /// As [`FrameSpec::numbers`], where missing frames are errors.
    pub fn select<'a>(&self, sequence: &'a Sequence) -> Result<Vec<&'a Frame>> {
        let numbers = self.numbers(sequence, Missing::Error)?;
        Ok(numbers.into_iter().filter_map(|number| sequence.frame(number)).collect())
    }

    /// The numbers of the selected frames. They include those in the [gaps](Sequence::gaps), unless a
    /// missing frame is an error.
    ///
    /// # Errors
    ///
    /// [`Error::MissingFrames`] if a listed frame does not exist and must, or for all frames of a sequence that
    /// lacks files, [`Error::Sequence`] for a range without any; [`Error::Usage`] for more missing frames than can be
    /// intended.
    pub fn numbers(&self, sequence: &Sequence, missing: Missing) -> Result<Vec<i64>> {
        // Those that a list names and that are not there count as frames.
        let existing = sequence.numbers();
        let Self::Ranges(ranges) = self else {
            let absent = sequence.absent.as_slice();
            return match (sequence.even_stride(), sequence.frames.as_slice()) {
                _ if missing == Missing::Error && !absent.is_empty() => {
                    Err(absent_frames(sequence, absent))
                }
                (Some(_), [first, .., last]) if missing != Missing::Error && absent.is_empty() => {
                    grid(sequence, first.number, last.number)
                }
                _ => Ok(existing),
            };
        };
        let mut numbers = Numbers::default();
        for range in ranges {
            if range.span() == 0 || !sequence.is_by_steps() {
                numbers.extend(range, |distance| range.at(distance), range.order, range.span())?;
                continue;
            }
            let (low, high) = (range.first.min(range.last), range.first.max(range.last));
            let stride = sequence.even_stride();
            let mut candidates = match stride {
                Some(_) => grid(sequence, low, high)?,
                None => {
                    let within = |number: &&i64| (low..=high).contains(*number);
                    existing.iter().filter(within).copied().collect()
                }
            };
            if range.last < range.first {
                candidates.reverse();
            }
            // Steps of a whole number of strides count numbers, others files.
            let order = match (range.order, stride) {
                (Order::Step(n), Some(stride)) if n % stride == 0 => Order::Step(n / stride),
                (Order::Between(n), Some(stride)) if n % stride == 0 => Order::Between(n / stride),
                (order, _) => order,
            };
            let last = candidates.len().checked_sub(1).filter(|_| order != Order::Between(1));
            let Some(last) = last else {
                let problem = format!("no frame is in {range}; {}", described(sequence));
                return Err(Error::Sequence { pattern: sequence.pattern.clone(), problem });
            };
            numbers.extend(range, |at| candidates[at as usize], order, last as u64)?;
        }
        let numbers = numbers.list;
        if missing == Missing::Error {
            check_existing(&numbers, sequence)?;
        }
        Ok(numbers)
    }
}

/// The numbers from `low` to `high` at which an evenly numbered sequence has frames, or gaps.
fn grid(sequence: &Sequence, low: i64, high: i64) -> Result<Vec<i64>> {
    let stride = i128::from(sequence.stride());
    let first = sequence.frames.first().map_or(0, |frame| i128::from(frame.number));
    let (low, high) = (i128::from(low), i128::from(high));
    let start = low + (first - low).rem_euclid(stride);
    if (high - start) / stride >= i128::from(MAX_FRAMES) {
        let problem = format!("frames {low} to {high}: more than {MAX_FRAMES}");
        return Err(Error::Usage(problem));
    }
    let numbers = (0..).map(|k| start + k * stride).take_while(|&number| number <= high);
    // Between two numbers of 64 bits.
    Ok(numbers.map(|number| number as i64).collect())
}

/// Fails if a sequence lacks one of these frames.
fn check_existing(numbers: &[i64], sequence: &Sequence) -> Result<()> {
    let missing: Vec<i64> =
        numbers.iter().copied().filter(|&n| sequence.frame(n).is_none()).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let some: Vec<String> = missing.iter().take(5).map(i64::to_string).collect();
    let problem = format!(
        "{} of {} frames are missing: {}{}; {}",
        missing.len(),
        numbers.len(),
        some.join(", "),
        if missing.len() > 5 { ", ..." } else { "" },
        described(sequence),
    );
    Err(Error::MissingFrames { pattern: sequence.pattern.clone(), problem })
}

/// Describes the frames of a sequence: `there are 5 from 0 to 6000, by steps of 1500`.
fn described(sequence: &Sequence) -> String {
    let number = |frame: Option<&Frame>| frame.map_or(0, |frame| frame.number);
    let (first, last) = (number(sequence.frames.first()), number(sequence.frames.last()));
    let steps = match sequence.even_stride() {
        Some(1) => String::new(),
        Some(stride) => format!(", by steps of {stride}"),
        None => ", unevenly numbered".into(),
    };
    format!("there are {} from {first} to {last}{steps}", sequence.frames.len())
}

/// Numbers in order, without duplicates.
#[derive(Default)]
struct Numbers {
    list: Vec<i64>,
    seen: HashSet<i64>,
    /// Number of visited ones.
    total: u64,
}

impl Numbers {
    /// Adds those that `at` gives for distances from 0 to `span`, in this order.
    fn extend(
        &mut self,
        range: &Range,
        at: impl Fn(u64) -> i64,
        order: Order,
        span: u64,
    ) -> Result<()> {
        // Counted before listing, since a short text may denote a huge range.
        self.total = self.total.saturating_add(order.count(span));
        if self.total > MAX_FRAMES {
            let problem = format!("frames `{range}`: more than {MAX_FRAMES} frames");
            return Err(Error::Usage(problem));
        }
        order.for_each(span, |distance| {
            let number = at(distance);
            if self.seen.insert(number) {
                self.list.push(number);
            }
        });
        Ok(())
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
        let Self::Ranges(ranges) = self else { return f.write_str("all") };
        for (i, range) in ranges.iter().enumerate() {
            let comma = if i > 0 { "," } else { "" };
            write!(f, "{comma}{range}")?;
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
        let mut ranges = Vec::new();
        for part in text.split([',', ' ', '\t']).filter(|part| !part.is_empty()) {
            push(&mut ranges, Range::parse(part)?);
        }
        if ranges.is_empty() {
            return Err(Error::Usage("frames: none given; write `1-10`, `1,5,9` or `all`".into()));
        }
        Ok(Self::Ranges(ranges))
    }
}

/// Adds a range. A single frame that follows the last range continues it.
fn push(ranges: &mut Vec<Range>, range: Range) {
    match ranges.last_mut() {
        Some(last)
            if range.span() == 0
                && last.first <= last.last
                && last.order == Order::Step(1)
                && last.last.checked_add(1) == Some(range.first) =>
        {
            last.last = range.first;
        }
        _ => ranges.push(range),
    }
}

/// The frames from `first` to `last`, ascending or descending.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Range {
    first: i64,
    last: i64,
    order: Order,
}

/// The order in which the frames of a range are visited.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Order {
    /// Every n-th frame.
    Step(u64),
    /// The frames that a step of n skips.
    Between(u64),
    Binary,
}

impl Range {
    /// A single frame.
    fn of(number: i64) -> Self {
        Self { first: number, last: number, order: Order::Step(1) }
    }

    fn parse(part: &str) -> Result<Self> {
        let usage = |problem: &str| Error::Usage(format!("frames `{part}`: {problem}"));
        let syntax = || usage("expected a number, a range `1-10`, steps `1-10x2`, or `1-10@b`");
        let (first, rest) = number(part).ok_or_else(syntax)?;
        if rest.is_empty() {
            return Ok(Self::of(first));
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

    /// Distance of its ends.
    fn span(&self) -> u64 {
        self.last.abs_diff(self.first)
    }

    /// The number at a distance from the first.
    fn at(&self, distance: u64) -> i64 {
        match self.last < self.first {
            true => self.first.saturating_sub_unsigned(distance),
            false => self.first.saturating_add_unsigned(distance),
        }
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { first, last, order } = self;
        if first == last && *order == Order::Step(1) {
            return write!(f, "{first}");
        }
        write!(f, "{first}-{last}")?;
        match order {
            Order::Step(1) => Ok(()),
            Order::Step(step) => write!(f, "x{step}"),
            Order::Between(step) => write!(f, "y{step}"),
            Order::Binary => f.write_str("@b"),
        }
    }
}

impl Order {
    /// Number of distances visited from 0 to `span`, before [`Order::Between`] skips any.
    fn count(self, span: u64) -> u64 {
        let step = if let Self::Step(step) = self { step } else { 1 };
        (span / step).saturating_add(1)
    }

    /// Visits distances from 0 to `span`.
    fn for_each(self, span: u64, mut visit: impl FnMut(u64)) {
        match self {
            Self::Step(step) => (0..self.count(span)).for_each(|i| visit(i * step)),
            Self::Between(step) => (0..=span).filter(|i| i % step != 0).for_each(visit),
            Self::Binary => {
                visit(0);
                visit(span);
                let mut gaps = VecDeque::from([(0, span)]);
                while let Some((low, high)) = gaps.pop_front() {
                    let middle = low + (high - low) / 2;
                    if middle > low {
                        visit(middle);
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
