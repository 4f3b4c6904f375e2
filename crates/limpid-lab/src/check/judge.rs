//! Runs an entry: renders it and compares it with the expected pictures.

use std::collections::BTreeMap;
use std::path::Path;

use image::RgbImage;
use toml::{Table, Value};

use super::draw::OpenedEntry;
use super::exhibit::{Exhibit, false_colour, png};
use super::suite::{AovTolerance, Content, Entry, Suite, Tolerance};
use super::{Adapter, Measure, Outcome, images};
use crate::compare::{self, FlipMap, load_picture};
use limpid::aov::Aov;
use limpid::offscreen::Offscreen;
use limpid_io::error::{Error, Result};
use limpid_io::input::FrameTime;
use limpid_io::output::OutputNames;

pub(super) const MEAN_FLIP: &str = "mean FLIP";
const P99_FLIP: &str = "99th percentile of FLIP";
const MAX_CHANNEL_ERROR: &str = "greatest channel error";
const TEMPORAL: &str = "change from frame to frame";

/// Number of pictures of a sequence that are shown, the worst first.
const SHOWN: usize = 6;

/// Frame-to-frame change that is invisible, in grey levels of 255: smaller means count as this, so
/// that a still sequence passes whatever the ratio.
const STILL: f64 = 0.05;

/// Renders and compares an entry. All errors end up in the outcome.
pub(super) fn judge(
    suite: &Suite,
    entry: &Entry,
    adapter: &Adapter,
    offscreen: &mut Offscreen,
) -> Outcome {
    let tolerance = suite.tolerance(entry, adapter);
    let mut outcome = Outcome::new(&entry.name);
    let judged = OpenedEntry::open(entry).and_then(|source| {
        let source = source.classified_on(offscreen.gpu());
        let frame_times = source.frame_times()?;
        outcome.drawn = drawn(entry, &source, &frame_times)?;
        match &entry.content {
            Content::Frame { expected, aovs, expected_aov, .. } => {
                let aovs = (aovs, expected_aov.as_path());
                let frame_time = frame_times[0].1;
                frame(&mut outcome, &source, frame_time, offscreen, &tolerance, expected, aovs)
            }
            Content::Sequence { expected, .. } => {
                sequence(&mut outcome, &source, &frame_times, offscreen, &tolerance, expected)
            }
        }
    });
    if let Err(error) = judged {
        // A partly compared entry must not be blessed.
        outcome.blessing.clear();
        outcome.error = Some(error);
    }
    outcome
}

/// Returns the settings that an entry was rendered with, for the record.
fn drawn(
    entry: &Entry,
    source: &OpenedEntry<'_>,
    frame_times: &[(i64, FrameTime)],
) -> Result<Table> {
    let defect = |e: toml::ser::Error| limpid::Error::Defect(format!("recording settings: {e}"));
    let mut table = Table::new();
    table.insert("size".into(), Value::try_from(entry.size).map_err(defect)?);
    let frames: Vec<i64> = frame_times.iter().map(|(number, _)| *number).collect();
    match (&entry.content, frame_times) {
        (Content::Frame { .. }, &[(_, frame_time)]) => {
            let step = (frame_time.next - frame_time.frame) as f64;
            let at = frame_time.frame as f64 + frame_time.fraction * step;
            table.insert("at".into(), at.into());
        }
        _ => drop(table.insert("frames".into(), Value::try_from(frames).map_err(defect)?)),
    }
    table.insert("camera".into(), source.camera.to_string().into());
    table.extend(Table::try_from(&source.scene.settings).map_err(defect)?);
    Ok(table)
}

/// The comparison of a picture with its expected file.
#[derive(Default)]
struct Compared {
    expected: Option<RgbImage>,
    measures: Vec<Measure>,
    map: Option<FlipMap>,
    missing: bool,
    error: Option<Error>,
}

impl Compared {
    fn new(path: &Path, actual: &RgbImage, tolerance: &Tolerance) -> Self {
        let expected = match load_picture(path) {
            Ok(expected) => expected,
            Err(error) if images::is_missing(&error) => {
                return Self { missing: true, ..Self::default() };
            }
            Err(error) => return Self { error: Some(error), ..Self::default() },
        };
        let compared = match compare::compare(&expected, actual) {
            Ok((c, map)) => {
                let Tolerance { mean_flip, p99_flip, max_channel_error, .. } = *tolerance;
                let (channel, most) = (c.max_channel_error.into(), max_channel_error.into());
                let measures = vec![
                    Measure::new(MEAN_FLIP, c.mean_flip, mean_flip, ""),
                    Measure::new(P99_FLIP, c.p99_flip, p99_flip, ""),
                    Measure::new(MAX_CHANNEL_ERROR, channel, most, "of 255"),
                ];
                Self { measures, map: Some(map), ..Self::default() }
            }
            Err(_) => {
                let (width, height) = expected.dimensions();
                let (w, h) = actual.dimensions();
                let path = path.display();
                let problem = format!("{path}: {width}x{height} pixels, the frame has {w}x{h}");
                Self { error: Some(Error::Mismatch(problem)), ..Self::default() }
            }
        };
        Self { expected: Some(expected), ..compared }
    }

    fn passes(&self) -> bool {
        self.error.is_none() && !self.missing && self.measures.iter().all(Measure::passes)
    }

    fn exhibit(&self, stem: &str, title: &str, actual: &RgbImage) -> Exhibit {
        let difference = self.map.as_ref().map(FlipMap::picture);
        let mut pictures = vec![("actual", actual)];
        pictures.extend(difference.as_ref().map(|picture| ("difference", picture)));
        if let Some(expected) = &self.expected {
            pictures.insert(0, ("expected", expected));
        }
        Exhibit::new(stem, title, &pictures)
    }
}

/// Compares one frame and its intermediate images.
fn frame(
    outcome: &mut Outcome,
    source: &OpenedEntry<'_>,
    frame_time: FrameTime,
    offscreen: &mut Offscreen,
    tolerance: &Tolerance,
    expected: &Path,
    aovs: (&BTreeMap<Aov, AovTolerance>, &Path),
) -> Result<()> {
    let loaded = source.load(frame_time)?;
    if aovs.0.contains_key(&Aov::Motion) {
        let problem = "motion is not checked, since it belongs to two pictures; leave it out";
        return Err(Error::Usage(problem.into()));
    }
    let chosen: Vec<Aov> = aovs.0.keys().copied().collect();
    let actual = source.draw(offscreen, &loaded, &chosen)?;
    let compared = Compared::new(expected, &actual, tolerance);
    if !compared.passes() {
        let exhibit = compared.exhibit(&outcome.name, "the picture", &actual);
        outcome.exhibits.push(exhibit);
        outcome.blessing.push((expected.to_owned(), png(&actual)));
    }
    if compared.missing {
        outcome.problems.push(format!("{}: no expected picture", expected.display()));
    }
    compared.measures.into_iter().for_each(|measure| outcome.measured(measure));
    outcome.error = compared.error;
    if aovs.0.is_empty() {
        return Ok(());
    }
    images::judge(outcome, offscreen.images(&chosen)?, aovs, loaded.splats.radius)
}

/// Compares the pictures of a sequence, each by itself and their frame-to-frame change.
fn sequence(
    outcome: &mut Outcome,
    source: &OpenedEntry<'_>,
    frame_times: &[(i64, FrameTime)],
    offscreen: &mut Offscreen,
    tolerance: &Tolerance,
    names: &OutputNames,
) -> Result<()> {
    if frame_times.len() < 2 {
        let problem = format!("{} frame; a [[sequence]] has 2 or more", frame_times.len());
        return Err(Error::Usage(problem));
    }
    let mut worst: Vec<Measure> = Vec::new();
    let (mut differ, mut missing) = (Vec::new(), Vec::new());
    let mut shown: Vec<(f64, Exhibit)> = Vec::new();
    let mut all = Vec::new();
    let mut changes = Changes::default();
    for &(number, frame_time) in frame_times {
        let actual = source.draw(offscreen, &source.load(frame_time)?, &[])?;
        let path = names.path(number);
        let compared = Compared::new(&path, &actual, tolerance);
        all.push((path.clone(), png(&actual)));
        if !compared.passes() {
            let flip = compared.map.as_ref().map_or(1.0, FlipMap::mean);
            let stem = format!("{}.{number:04}", outcome.name);
            shown.push((flip, compared.exhibit(&stem, &format!("frame {number}"), &actual)));
            shown.sort_by(|a, b| b.0.total_cmp(&a.0));
            shown.truncate(SHOWN);
        }
        match (&compared.missing, &compared.error) {
            (true, _) => missing.push(path),
            (_, None) if !compared.passes() => differ.push(number),
            _ => {}
        }
        for measure in compared.measures {
            match worst.iter_mut().find(|other| other.name == measure.name) {
                Some(other) => other.value = other.value.max(measure.value),
                None => worst.push(measure),
            }
        }
        outcome.error = outcome.error.take().or(compared.error);
        changes.add(actual, compared.expected);
    }
    let count = frame_times.len();
    if let Some(first) = missing.first() {
        let (number, first) = (missing.len(), first.display());
        outcome.problems.push(format!("{number} of {count} expected pictures missing: {first}"));
    }
    if !differ.is_empty() {
        let some: Vec<String> = differ.iter().take(10).map(i64::to_string).collect();
        let (more, number) = (if differ.len() > 10 { ", ..." } else { "" }, differ.len());
        let problem = format!("{number} of {count} frames differ: {}{more}", some.join(", "));
        outcome.problems.push(problem);
    }
    worst.into_iter().for_each(|measure| outcome.measured(measure));
    outcome.exhibits.extend(shown.into_iter().map(|(_, exhibit)| exhibit));
    if let Some(measure) = changes.measure(tolerance.temporal) {
        if !measure.passes() {
            outcome.exhibits.push(changes.exhibit(&outcome.name));
        }
        outcome.measured(measure);
    }
    if outcome.error.is_some() || !outcome.problems.is_empty() {
        // All pictures, because their change is a property of the whole sequence.
        outcome.blessing = all;
    }
    let lost = source.lost(&names.existing());
    for &number in lost.iter().take(SHOWN) {
        outcome.problems.push(format!("frame {number}: expected, but the input has none"));
    }
    if lost.len() > SHOWN {
        outcome.problems.push(format!("{} more frames likewise", lost.len() - SHOWN));
    }
    if !lost.is_empty() {
        // Blessing would keep their expected pictures; these must be removed by hand first.
        outcome.blessing.clear();
    }
    Ok(())
}

/// Accumulates the frame-to-frame change of a sequence.
#[derive(Default)]
struct Changes {
    last: Option<(RgbImage, Option<RgbImage>)>,
    // Sums over the steps of each pixel's change, averaged over its channels, in grey levels of
    // 255.
    actual: Vec<f32>,
    expected: Vec<f32>,
    steps: u32,
    incomplete: bool,
}

impl Changes {
    fn add(&mut self, actual: RgbImage, expected: Option<RgbImage>) {
        // Pictures of another size cannot be compared.
        let expected = expected.filter(|e| e.dimensions() == actual.dimensions());
        self.incomplete |= expected.is_none();
        if let Some((before, Some(expected_before))) = &self.last
            && let Some(expected) = &expected
        {
            add_change(&mut self.actual, before, &actual);
            add_change(&mut self.expected, expected_before, expected);
            self.steps += 1;
        }
        self.last = Some((actual, expected));
    }

    /// Mean frame-to-frame change, rendered and expected, in grey levels of 255.
    fn means(&self) -> [f64; 2] {
        [&self.actual, &self.expected].map(|sums| {
            let sum: f64 = sums.iter().map(|&sum| f64::from(sum)).sum();
            sum / (sums.len() as f64 * f64::from(self.steps))
        })
    }

    /// The ratio of the two; `None` unless all expected pictures exist.
    fn measure(&self, temporal: f64) -> Option<Measure> {
        if self.incomplete || self.steps == 0 {
            return None;
        }
        let [actual, expected] = self.means().map(|mean| mean.max(STILL));
        let ratio = Measure::new(TEMPORAL, actual / expected, temporal, "times as expected");
        Some(Measure { at_least: temporal.recip(), ..ratio })
    }

    fn exhibit(&self, name: &str) -> Exhibit {
        let size = self.last.as_ref().map_or((1, 1), |(picture, _)| picture.dimensions());
        let difference: Vec<f32> =
            self.actual.iter().zip(&self.expected).map(|(a, e)| (a - e).abs()).collect();
        let all = self.actual.iter().chain(&self.expected);
        let largest = all.copied().fold(0.0, f32::max);
        let [expected, actual, difference] = [&self.expected, &self.actual, &difference]
            .map(|sums| false_colour(size, sums, largest));
        let [a, e] = self.means();
        let title = format!("mean change from frame to frame: {a:.3} of 255, expected {e:.3}");
        let pictures = [("expected", &expected), ("actual", &actual), ("difference", &difference)];
        Exhibit::new(&format!("{name}.temporal"), title, &pictures)
    }
}

fn add_change(sums: &mut Vec<f32>, before: &RgbImage, after: &RgbImage) {
    sums.resize((after.width() * after.height()) as usize, 0.0);
    for ((sum, a), b) in sums.iter_mut().zip(before.pixels()).zip(after.pixels()) {
        let change: u16 = a.0.iter().zip(b.0).map(|(&a, b)| u16::from(a.abs_diff(b))).sum();
        *sum += f32::from(change) / 3.0;
    }
}
