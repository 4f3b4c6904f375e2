//! The suite file: parsing, validation, tolerances.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::{Component, Path, PathBuf};

use glam::UVec2;
use serde::Deserialize;

use super::Adapter;
use limpid::aov::Aov;
use limpid::camera::Camera;
use limpid_io::error::{Error, Result, toml_error};
use limpid_io::frames::FrameSpec;
use limpid_io::output::{FileKind, Files, OutputNames, folder_of};
use limpid_io::{files, input};

/// A picture test suite: entries, expected pictures and tolerances.
#[derive(Debug, Clone, PartialEq)]
pub struct Suite {
    /// The suite's file.
    pub path: PathBuf,
    /// The entries in the order in which they run; never empty.
    pub entries: Vec<Entry>,
    limits: Limits,
    adapters: Vec<AdapterLimits>,
}

/// One picture test: a frame or a sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// The name, unique in the suite: letters, digits, `-`, `_` and `.`.
    pub name: String,
    /// A scene, a recipe, a particle file, a pattern or a folder.
    pub input: PathBuf,
    /// A scene to render the input's particles in.
    pub scene: Option<PathBuf>,
    /// Width and height, pixels.
    pub size: UVec2,
    /// The camera, if other than the scene's.
    pub camera: Option<Camera>,
    /// Overrides of settings and optics, in the form of `--set`.
    pub set: Vec<String>,
    /// Rays per pixel, if other than the scene's.
    pub samples: Option<u32>,
    /// Particle radius, m, if the files have none.
    pub radius: Option<f32>,
    /// Bakes a scene with a `[simulation]` first.
    pub bake: Option<Bake>,
    /// One frame or a sequence.
    pub content: Content,
    limits: Limits,
    adapters: Vec<AdapterLimits>,
}

/// A short simulation whose frames are rendered.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bake {
    /// Time from the start to the last frame, s: 0 to 3600.
    pub seconds: f64,
    /// Particle radius instead of the scene's, m: a larger one takes less time.
    pub radius: Option<f64>,
}

/// The frames of the input to render.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// One frame.
    Frame {
        /// The time in frames: 12, or 12.25 for a quarter of the way to 13. If absent: the scene's
        /// frame, the only one, or the last of a bake.
        at: Option<f64>,
        /// The expected picture.
        expected: PathBuf,
        /// The intermediate images that are compared too.
        aovs: BTreeMap<Aov, AovTolerance>,
        /// The file with the expected intermediate images.
        expected_aov: PathBuf,
    },
    /// Several frames; their frame-to-frame change is compared with that of the expected ones too.
    Sequence {
        /// The frames.
        frames: FrameSpec,
        /// The expected pictures.
        expected: OutputNames,
    },
}

/// Tolerances of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// Mean FLIP, 0 to 1.
    pub mean_flip: f64,
    /// 99th percentile of FLIP, 0 to 1.
    pub p99_flip: f64,
    /// The greatest difference of any channel of any pixel, in levels of 255.
    pub max_channel_error: u8,
    /// Factor by which the frame-to-frame change of a sequence may exceed or fall short of the
    /// expected one: 1 or more.
    pub temporal: f64,
}

impl Default for Tolerance {
    /// A correct picture of another adapter passes: its rounding moves a few rays across edges.
    fn default() -> Self {
        Self { mean_flip: 0.01, p99_flip: 0.2, max_channel_error: 255, temporal: 1.1 }
    }
}

/// Tolerances of an intermediate image, in its own unit.
///
/// m for depths and lengths, degrees for normals, a count for interfaces, iterations and failures,
/// W/m² for irradiance, W/(m² sr) for radiance.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AovTolerance {
    /// The error above which a pixel differs. Defaults: a tenth of the particle radius for depths
    /// and lengths, 1 degree for normals, 0 for counts, 0.01 for light.
    pub within: Option<f64>,
    /// The share of the pixels that may differ, 0 to 1, default 0.01. A pixel present in only one
    /// of the two images differs.
    pub share: Option<f64>,
    /// The mean error of the pixels present in both; default unlimited.
    pub mean: Option<f64>,
    /// Its 99th percentile; default unlimited.
    pub p99: Option<f64>,
}

// The TOML layout of the file.

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SuiteFile {
    size: Option<UVec2>,
    samples: Option<u32>,
    #[serde(default)]
    set: Vec<String>,
    #[serde(default)]
    tolerance: Limits,
    #[serde(default)]
    adapter: Vec<AdapterLimits>,
    #[serde(default)]
    frame: Vec<EntryFile>,
    #[serde(default)]
    sequence: Vec<EntryFile>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Limits {
    mean_flip: Option<f64>,
    p99_flip: Option<f64>,
    max_channel_error: Option<u8>,
    temporal: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct AdapterLimits {
    name: String,
    mean_flip: Option<f64>,
    p99_flip: Option<f64>,
    max_channel_error: Option<u8>,
    temporal: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EntryFile {
    name: String,
    input: String,
    scene: Option<PathBuf>,
    frame: Option<i64>,
    at: Option<f64>,
    frames: Option<String>,
    size: Option<UVec2>,
    camera: Option<Camera>,
    #[serde(default)]
    set: Vec<String>,
    samples: Option<u32>,
    radius: Option<f32>,
    bake: Option<Bake>,
    expected: Option<String>,
    expected_aov: Option<PathBuf>,
    #[serde(default)]
    tolerance: Limits,
    #[serde(default)]
    adapter: Vec<AdapterLimits>,
    aov: Option<BTreeMap<Aov, AovTolerance>>,
}

impl Suite {
    /// Reads a suite. Paths in it are relative to it.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Scene`] naming the line or the entry and the key, with a
    /// suggestion for an unknown one. A suite without entries is an error.
    pub fn load(path: &Path) -> Result<Self> {
        Self::parse(&files::read_text(path)?, path)
    }

    /// Parses a suite's text as the contents of `path`.
    ///
    /// # Errors
    /// As [`Suite::load`].
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let origin = path.display().to_string();
        let file: SuiteFile = toml::from_str(text).map_err(|e| toml_error(text, &origin, &e))?;
        let fail = |problem: String| Error::Scene { origin: origin.clone(), problem };
        let defaults = Defaults {
            folder: path.parent().unwrap_or(Path::new("")),
            expected: path.with_extension(""),
            size: file.size.unwrap_or(UVec2::new(320, 240)),
            samples: file.samples,
            set: file.set,
        };
        let mut entries = Vec::new();
        let frames = file.frame.into_iter().map(|entry| (entry, false));
        let sequences = file.sequence.into_iter().map(|entry| (entry, true));
        for (entry, sequence) in frames.chain(sequences) {
            let table = if sequence { "[[sequence]]" } else { "[[frame]]" };
            let name = entry.name.clone();
            let entry = entry.validated(&defaults, sequence);
            entries.push(entry.map_err(|e| fail(format!("{table} `{name}`: {e}")))?);
        }
        let suite =
            Self { path: path.to_owned(), entries, limits: file.tolerance, adapters: file.adapter };
        suite.limits.check().map_err(|e| fail(format!("[tolerance] {e}")))?;
        check_adapters(&suite.adapters).map_err(&fail)?;
        if suite.entries.is_empty() {
            return Err(fail("nothing to check: expected a [[frame]] or a [[sequence]]".into()));
        }
        // On case-insensitive file systems two such entries would share a file.
        let mut names: Vec<_> = suite.entries.iter().map(|e| e.name.to_lowercase()).collect();
        names.sort();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(fail(format!("two entries are named `{}`", pair[0])));
        }
        Ok(suite)
    }

    /// Returns an entry's tolerances on an adapter. In decreasing priority: the entry's for the
    /// adapter, the entry's, the suite's for the adapter, the suite's, the defaults.
    pub fn tolerance(&self, entry: &Entry, adapter: &Adapter) -> Tolerance {
        let text = format!("{} {} {}", adapter.name, adapter.driver, adapter.backend);
        let text = text.to_lowercase();
        let of = |adapters: &[AdapterLimits]| {
            let matching = adapters.iter().filter(|a| text.contains(&a.name.to_lowercase()));
            matching.map(AdapterLimits::limits).collect::<Vec<_>>()
        };
        let layers =
            [vec![self.limits], of(&self.adapters), vec![entry.limits], of(&entry.adapters)];
        layers.concat().into_iter().fold(Tolerance::default(), |below, limits| Tolerance {
            mean_flip: limits.mean_flip.unwrap_or(below.mean_flip),
            p99_flip: limits.p99_flip.unwrap_or(below.p99_flip),
            max_channel_error: limits.max_channel_error.unwrap_or(below.max_channel_error),
            temporal: limits.temporal.unwrap_or(below.temporal),
        })
    }

    /// Collects the files that the suite reads: itself, and the scenes and particles of its
    /// entries.
    fn inputs(&self) -> Files {
        let mut files = Files::default();
        files.reads(&self.path);
        for entry in &self.entries {
            for input in [Some(&entry.input), entry.scene.as_ref()].into_iter().flatten() {
                input::files_of(input).iter().for_each(|path| files.reads(path));
            }
        }
        files
    }

    /// Collects the files that no result may overwrite: the inputs and the expected files.
    pub fn files(&self) -> Files {
        let mut files = self.inputs();
        self.entries.iter().flat_map(Entry::expectations).for_each(|path| files.reads(&path));
        files
    }

    /// Fails unless the expected files of the chosen entries may be written: none is an input, and
    /// all are pictures below the suite's folder.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the file, or the filter that matches no entry; [`Error::Io`].
    pub fn check_blessings(&self, filter: &[String]) -> Result<()> {
        let inputs = self.inputs();
        for path in self.chosen(filter)?.into_iter().flat_map(Entry::expectations) {
            if inputs.has_input(&path) {
                let problem = "the suite reads this file; expect another";
                return Err(Error::Usage(format!("{}: {problem}", path.display())));
            }
            check_blessing(&self.path, &path)?;
        }
        FileKind::BLESS_RECORD.check_if_there(&self.path.with_extension("").join("blessed.toml"))
    }

    /// Returns the entries whose names contain one of `filter`; all if it is empty.
    pub(super) fn chosen(&self, filter: &[String]) -> Result<Vec<&Entry>> {
        let matches = |entry: &&Entry| {
            filter.is_empty() || filter.iter().any(|part| entry.name.contains(part.as_str()))
        };
        let chosen: Vec<_> = self.entries.iter().filter(matches).collect();
        if chosen.is_empty() {
            let names: Vec<_> = self.entries.iter().map(|entry| entry.name.as_str()).collect();
            let (filter, suite) = (filter.join("`, `"), self.path.display());
            let problem = format!("{suite}: no entry is named `{filter}`; ");
            return Err(Error::Usage(problem + "there are " + &names.join(", ")));
        }
        Ok(chosen)
    }
}

/// Fails unless an expected file may be written: it must lie below the suite's folder after links
/// are resolved, and may only replace a picture.
pub(super) fn check_blessing(suite: &Path, path: &Path) -> Result<()> {
    let exists = |path: &Path| path.symlink_metadata().is_ok();
    // A file that does not exist yet is resolved by its nearest existing ancestor.
    let nearest = path.ancestors().find(|path| exists(path)).unwrap_or(Path::new(""));
    let nearest = if nearest == Path::new("") { Path::new(".") } else { nearest };
    let folder = folder_of(suite).canonicalize().map_err(|e| Error::io(suite, "read", e))?;
    let real = nearest.canonicalize().map_err(|e| Error::io(path, "write", e))?;
    if !real.starts_with(folder) {
        let problem = "a link leads out of the suite's folder; expectations stay below it";
        return Err(Error::Usage(format!("{}: {problem}", path.display())));
    }
    FileKind::PICTURE.check_if_there(path)
}

/// Resolves the path of an expected file, which must lie below the suite's folder and have the
/// extension `ending`.
fn expectation(folder: &Path, file: &Path, ending: &str) -> Result<PathBuf, String> {
    let below = |part| matches!(part, Component::Normal(_) | Component::CurDir);
    let name = file.display();
    if !file.components().all(below) {
        return Err(format!("expected `{name}`: expected a path below the suite's folder"));
    }
    if !file.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending)) {
        return Err(format!("expected `{name}`: expected a name that ends in .{ending}"));
    }
    Ok(folder.join(file))
}

/// The suite's defaults for its entries.
struct Defaults<'a> {
    folder: &'a Path,
    expected: PathBuf,
    size: UVec2,
    samples: Option<u32>,
    set: Vec<String>,
}

impl EntryFile {
    fn validated(self, defaults: &Defaults<'_>, sequence: bool) -> Result<Entry, String> {
        let Self { name, frame, at, frames, expected, expected_aov, aov, .. } = self;
        let is_allowed = |c: char| c.is_alphanumeric() || "-_.".contains(c);
        if name.is_empty() || name.starts_with('.') || !name.chars().all(is_allowed) {
            return Err("a name is letters, digits, -, _ and . (not the first)".into());
        }
        let size = self.size.unwrap_or(defaults.size);
        if size.min_element() == 0 {
            return Err(format!("size: a picture of {}x{} has no pixels", size.x, size.y));
        }
        if let Some(Bake { seconds, .. }) = self.bake {
            within("bake.seconds", seconds, 0.0..=3600.0)?;
        }
        self.tolerance.check().map_err(|e| format!("tolerance.{e}"))?;
        check_adapters(&self.adapter)?;
        let not_for = |keys: &[(&str, bool)], table: &str| match keys.iter().find(|key| key.1) {
            Some((key, _)) => Err(format!("`{key}` is a key of {table}")),
            None => Ok(()),
        };
        let content = if sequence {
            let keys = [("frame", frame.is_some()), ("at", at.is_some()), ("aov", aov.is_some())];
            not_for(&keys, "[[frame]]")?;
            not_for(&[("expected_aov", expected_aov.is_some())], "[[frame]]")?;
            let frames = frames.as_deref().unwrap_or("all").parse().map_err(text)?;
            let expected = match expected {
                Some(pattern) => expectation(defaults.folder, Path::new(&pattern), "png")?,
                None => defaults.expected.join(&name).join("####.png"),
            };
            let expected = OutputNames::parse(&expected, 2);
            Content::Sequence { frames, expected: expected.map_err(text)? }
        } else {
            not_for(&[("frames", frames.is_some())], "[[sequence]]")?;
            if frame.is_some() && at.is_some() {
                return Err("takes one of frame and at".into());
            }
            if at.is_some_and(|at| !at.is_finite()) {
                return Err("at must be finite".into());
            }
            let expected = match expected {
                Some(file) => expectation(defaults.folder, Path::new(&file), "png")?,
                None => defaults.expected.join(format!("{name}.png")),
            };
            let expected_aov = match expected_aov {
                Some(file) => expectation(defaults.folder, &file, "exr")?,
                None => expected.with_extension("exr"),
            };
            let aovs = aov.unwrap_or_default();
            for (aov, tolerance) in &aovs {
                tolerance.check().map_err(|e| format!("aov.{aov}.{e}"))?;
            }
            // Frame numbers are exact up to 2^53.
            let at = at.or(frame.map(|frame| frame as f64));
            Content::Frame { at, expected, aovs, expected_aov }
        };
        Ok(Entry {
            name,
            input: defaults.folder.join(self.input),
            scene: self.scene.map(|scene| defaults.folder.join(scene)),
            size,
            camera: self.camera,
            set: defaults.set.iter().cloned().chain(self.set).collect(),
            samples: self.samples.or(defaults.samples),
            radius: self.radius,
            bake: self.bake,
            content,
            limits: self.tolerance,
            adapters: self.adapter,
        })
    }
}

impl Entry {
    /// Its expected files; of a sequence those that exist.
    pub(super) fn expectations(&self) -> Vec<PathBuf> {
        match &self.content {
            Content::Frame { expected, expected_aov, .. } => {
                vec![expected.clone(), expected_aov.clone()]
            }
            Content::Sequence { expected, .. } => {
                expected.existing().into_iter().map(|number| expected.path(number)).collect()
            }
        }
    }
}

impl Limits {
    fn check(&self) -> Result<(), String> {
        let shares = [("mean_flip", self.mean_flip), ("p99_flip", self.p99_flip)];
        for (key, share) in shares {
            share.map_or(Ok(()), |share| within(key, share, 0.0..=1.0))?;
        }
        self.temporal.map_or(Ok(()), |ratio| within("temporal", ratio, 1.0..=1e6))
    }
}

impl AdapterLimits {
    fn limits(&self) -> Limits {
        let Self { mean_flip, p99_flip, max_channel_error, temporal, .. } = *self;
        Limits { mean_flip, p99_flip, max_channel_error, temporal }
    }
}

impl AovTolerance {
    fn check(&self) -> Result<(), String> {
        let Self { within: distance, share, mean, p99 } = *self;
        share.map_or(Ok(()), |share| within("share", share, 0.0..=1.0))?;
        for (key, error) in [("within", distance), ("mean", mean), ("p99", p99)] {
            error.map_or(Ok(()), |error| within(key, error, 0.0..=f64::MAX))?;
        }
        Ok(())
    }
}

fn check_adapters(adapters: &[AdapterLimits]) -> Result<(), String> {
    for adapter in adapters {
        if adapter.name.is_empty() {
            return Err("[[adapter]] name: a part of an adapter's or a driver's name".into());
        }
        adapter.limits().check().map_err(|e| format!("[[adapter]] `{}`: {e}", adapter.name))?;
    }
    Ok(())
}

fn within(key: &str, value: f64, range: RangeInclusive<f64>) -> Result<(), String> {
    match (range.contains(&value), *range.end()) {
        (true, _) => Ok(()),
        (_, f64::MAX) => Err(format!("{key} is {value}, expected {} or more", range.start())),
        (_, end) => Err(format!("{key} is {value}, expected {} to {end}", range.start())),
    }
}

fn text(error: impl Display) -> String {
    error.to_string()
}
