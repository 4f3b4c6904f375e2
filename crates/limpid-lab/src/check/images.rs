//! Comparison of intermediate images with the expected ones: coverage and error, in the unit of
//! each.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

use glam::{UVec2, Vec3};
use image::{Rgb, RgbImage};

use super::exhibit::{Exhibit, false_colour};
use super::suite::AovTolerance;
use super::{Measure, Outcome};
use limpid::aov::{Aov, Part};
use limpid_io::error::{Error, Result};
use limpid_io::exr;

/// An image: one channel, or the three of a vector or a colour.
struct Image<'a> {
    aov: Aov,
    name: String,
    size: UVec2,
    // Sorted by name.
    channels: Vec<&'a [f32]>,
}

/// The meaning of an image's pixels.
#[derive(Clone, Copy, PartialEq, Eq)]
enum ImageKind {
    /// 0 where empty.
    Depth,
    /// 0 where empty, else of length 1.
    Normal,
    /// A length, m.
    Length,
    Count,
    Light,
    /// Pixels right and down.
    Motion,
}

impl ImageKind {
    fn of(aov: Aov) -> Self {
        match aov {
            Aov::Depth | Aov::SmoothDepth | Aov::SolidDepth => Self::Depth,
            Aov::Normal | Aov::SmoothNormal => Self::Normal,
            Aov::Inside => Self::Length,
            Aov::Interfaces | Aov::Iterations | Aov::Failures => Self::Count,
            Aov::Motion => Self::Motion,
            Aov::Radiance
            | Aov::Caustics
            | Aov::Coverage
            | Aov::Mask
            | Aov::Diffuse
            | Aov::Value => Self::Light,
        }
    }

    fn unit(self) -> &'static str {
        match self {
            Self::Depth | Self::Length => "m",
            Self::Normal => "degrees",
            Self::Motion => "pixels",
            Self::Count | Self::Light => "",
        }
    }

    /// The default error above which a pixel differs.
    fn within(self, radius: f32) -> f64 {
        match self {
            Self::Depth | Self::Length => 0.1 * f64::from(radius),
            Self::Normal => 1.0,
            Self::Count => 0.0,
            Self::Light => 0.01,
            Self::Motion => 0.1,
        }
    }
}

/// Compares the images of a frame whose particles have this radius.
pub(super) fn judge(
    outcome: &mut Outcome,
    actual: Vec<Part>,
    (limits, path): (&BTreeMap<Aov, AovTolerance>, &Path),
    radius: f32,
) -> Result<()> {
    let rendered = images(&actual, limits);
    if rendered.is_empty() {
        let names: Vec<_> = limits.keys().map(Aov::to_string).collect();
        let problem = format!("the frame has no images of {}", names.join(", "));
        return Err(Error::Usage(problem));
    }
    let problems = outcome.problems.len();
    let mut finite = true;
    for image in &rendered {
        if let Some(place) = image.not_finite() {
            outcome.problems.push(format!("drawn: {place}"));
            finite = false;
        }
    }
    let error = match exr::load(path) {
        Ok(expected) => {
            let expected = images(&expected, limits);
            compare(outcome, path, &expected, &rendered, limits, radius).err()
        }
        Err(error) if is_missing(&error) => {
            outcome.problems.push(format!("{}: no expected images", path.display()));
            None
        }
        Err(error) => Some(error),
    };
    if error.is_none() && outcome.problems.len() == problems {
        return Ok(());
    }
    outcome.error = outcome.error.take().or(error);
    drop(rendered);
    let exr = exr::to_bytes(actual).map_err(|e| Error::io(path, "write", e))?;
    let exr: std::sync::Arc<[u8]> = exr.into();
    outcome.files.push((format!("{}.actual.exr", outcome.name), exr.clone()));
    if finite {
        outcome.blessing.push((path.to_owned(), exr));
    }
    Ok(())
}

/// Collects the images with limits from the channels of `parts`, sorted by name.
fn images<'a>(parts: &'a [Part], limits: &BTreeMap<Aov, AovTolerance>) -> Vec<Image<'a>> {
    let mut images: BTreeMap<String, Image<'a>> = BTreeMap::new();
    for part in parts {
        let mut channels: Vec<_> = part.channels.iter().collect();
        channels.sort_by(|a, b| a.name.cmp(&b.name));
        for channel in channels {
            let base = match channel.name.rsplit_once('.') {
                Some((base, "X" | "Y" | "Z" | "R" | "G" | "B" | "A")) => base,
                _ => channel.name.as_str(),
            };
            let light = part.name.starts_with("caustics.");
            let name = if light { format!("{}.{base}", part.name) } else { base.to_owned() };
            let aov = name.split('.').next().and_then(|name| name.parse().ok());
            let Some(aov) = aov.filter(|aov| limits.contains_key(aov)) else { continue };
            let empty = Image { aov, name: name.clone(), size: part.size, channels: Vec::new() };
            images.entry(name).or_insert(empty).channels.push(&channel.values);
        }
    }
    images.into_values().collect()
}

fn compare(
    outcome: &mut Outcome,
    path: &Path,
    expected: &[Image<'_>],
    actual: &[Image<'_>],
    limits: &BTreeMap<Aov, AovTolerance>,
    radius: f32,
) -> Result<()> {
    if let Some(image) = expected.iter().find(|image| !image.is_whole()) {
        return Err(Error::format(path, format!("the channels of {} differ in size", image.name)));
    }
    if let Some(place) = expected.iter().find_map(Image::not_finite) {
        return Err(Error::format(path, place));
    }
    for image in expected.iter().filter(|e| !actual.iter().any(|a| a.name == e.name)) {
        outcome.problems.push(format!("{}: expected, but the frame has none", image.name));
    }
    for image in actual {
        let name = &image.name;
        let Some(expected) = expected.iter().find(|e| e.name == *name) else {
            outcome.problems.push(format!("{name}: the frame has it, but it is not expected"));
            continue;
        };
        let same = expected.size == image.size && expected.channels.len() == image.channels.len();
        if !same {
            let what = |i: &Image<'_>| {
                format!("{}x{} pixels of {} numbers", i.size.x, i.size.y, i.channels.len())
            };
            let path = path.display();
            let problem =
                format!("{path}: {name}: {}, the frame has {}", what(expected), what(image));
            return Err(Error::Mismatch(problem));
        }
        let kind = ImageKind::of(image.aov);
        let limits = limits[&image.aov];
        let errors = errors(kind, expected, image);
        let before = outcome.problems.len();
        measures(kind, name, &errors, limits, radius).into_iter().for_each(|m| outcome.measured(m));
        if outcome.problems.len() > before {
            outcome.exhibits.push(exhibit(&outcome.name, kind, expected, image, &errors));
        }
    }
    Ok(())
}

impl Image<'_> {
    /// Whether all its channels have its size: channels from parts of the same name may not.
    fn is_whole(&self) -> bool {
        let pixels = u64::from(self.size.x) * u64::from(self.size.y);
        self.channels.iter().all(|values| values.len() as u64 == pixels)
    }

    /// Describes the first non-finite value, as a part of a sentence.
    fn not_finite(&self) -> Option<String> {
        self.channels.iter().find_map(|values| {
            let at = values.iter().position(|value| !value.is_finite())?;
            let (x, y) = (at as u32 % self.size.x, at as u32 / self.size.x);
            Some(format!("{} is {} at pixel ({x}, {y})", self.name, values[at]))
        })
    }

    fn vector(&self, pixel: usize) -> Vec3 {
        let axis = |i: usize| self.channels.get(i).map_or(0.0, |values| values[pixel]);
        Vec3::new(axis(0), axis(1), axis(2))
    }

    fn pixels(&self) -> usize {
        self.channels.first().map_or(0, |values| values.len())
    }
}

/// The error of each pixel in the image's unit: ∞ if only one image covers it, `None` if neither
/// does.
fn errors(kind: ImageKind, expected: &Image<'_>, actual: &Image<'_>) -> Vec<Option<f32>> {
    let error = |pixel| {
        let (e, a) = (expected.vector(pixel), actual.vector(pixel));
        let sparse = matches!(kind, ImageKind::Depth | ImageKind::Normal);
        match (sparse && e == Vec3::ZERO, sparse && a == Vec3::ZERO) {
            (true, true) => None,
            (false, false) if kind == ImageKind::Normal => Some(e.angle_between(a).to_degrees()),
            (false, false) => Some((e - a).abs().max_element()),
            _ => Some(f32::INFINITY),
        }
    };
    (0..expected.pixels().min(actual.pixels())).map(error).collect()
}

fn measures(
    kind: ImageKind,
    name: &str,
    errors: &[Option<f32>],
    limits: AovTolerance,
    radius: f32,
) -> Vec<Measure> {
    let within = limits.within.unwrap_or_else(|| kind.within(radius));
    let differing = errors.iter().flatten().filter(|&&error| f64::from(error) > within).count();
    let share = differing as f64 / errors.len().max(1) as f64;
    let title = format!("{name} off by more than {} {}", super::digits(within), kind.unit());
    let title = format!("{}: share of pixels", title.trim_end());
    let mut measures = vec![Measure::new(title, share, limits.share.unwrap_or(0.01), "")];
    let mut both: Vec<f32> = errors.iter().flatten().copied().filter(|e| e.is_finite()).collect();
    if let Some(limit) = limits.mean {
        let sum: f64 = both.iter().map(|&error| f64::from(error)).sum();
        let mean = sum / both.len().max(1) as f64;
        measures.push(Measure::new(format!("{name}: mean error"), mean, limit, kind.unit()));
    }
    if let Some(limit) = limits.p99 {
        let rank = (0.99 * both.len() as f64).ceil() as usize;
        both.sort_by(f32::total_cmp);
        let p99 = both.get(rank.saturating_sub(1)).map_or(0.0, |&error| f64::from(error));
        let name = format!("{name}: 99th percentile of the error");
        measures.push(Measure::new(name, p99, limit, kind.unit()));
    }
    measures
}

/// The expected image, the rendered one and the error in false colours.
fn exhibit(
    entry: &str,
    kind: ImageKind,
    expected: &Image<'_>,
    actual: &Image<'_>,
    errors: &[Option<f32>],
) -> Exhibit {
    let size: (u32, u32) = actual.size.into();
    let range = |image: &Image<'_>| {
        let pixels = (0..image.pixels()).map(|pixel| image.vector(pixel));
        let values = pixels.map(Vec3::max_element).filter(|&value| value != 0.0);
        values.fold((f32::INFINITY, 0.0_f32), |(low, high), v| (low.min(v), high.max(v)))
    };
    let (a, b) = (range(expected), range(actual));
    let (low, high) = (a.0.min(b.0), a.1.max(b.1));
    let picture = |image: &Image<'_>| -> RgbImage {
        if kind == ImageKind::Normal {
            return RgbImage::from_fn(size.0, size.1, |x, y| {
                let normal = image.vector((y * size.0 + x) as usize);
                let level = if normal == Vec3::ZERO { Vec3::ZERO } else { 0.5 + 0.5 * normal };
                Rgb((255.0 * level).round().to_array().map(|c| c as u8))
            });
        }
        // Covered pixels are never quite black, to stand out from empty ones.
        let base = if kind == ImageKind::Depth { low - 0.25 * (high - low).max(1e-6) } else { 0.0 };
        let value = |pixel| {
            let value = image.vector(pixel).max_element();
            if value == 0.0 { 0.0 } else { value - base }
        };
        let values: Vec<f32> = (0..image.pixels()).map(value).collect();
        false_colour(size, &values, high - base)
    };
    let values: Vec<f32> = errors.iter().map(|error| error.unwrap_or(0.0)).collect();
    let largest = values.iter().copied().filter(|e| e.is_finite()).fold(0.0, f32::max);
    let difference = false_colour(size, &values, largest);
    let name = &actual.name;
    let unit = kind.unit();
    let scale = if high > 0.0 && kind != ImageKind::Normal {
        format!(", {low:.3} to {high:.3} {unit}")
    } else {
        String::new()
    };
    let title = format!("{name}{scale}; errors up to {largest:.3} {unit}, white: only one has it");
    let pictures = [
        ("expected", &picture(expected)),
        ("actual", &picture(actual)),
        ("difference", &difference),
    ];
    Exhibit::new(&format!("{entry}.{name}"), title, &pictures)
}

/// Whether the error is that the expected file does not exist.
pub(super) fn is_missing(error: &Error) -> bool {
    matches!(error, Error::Io { source, .. } if source.kind() == ErrorKind::NotFound)
}
