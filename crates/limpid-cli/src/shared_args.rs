//! Options shared by several commands.

use std::path::{Path, PathBuf};

use glam::UVec2;
use limpid::liquid::Up;
use limpid::look::Look;
use limpid_io::adjustments::{Adjustments, Floor, Sun, Tint};
use limpid_io::color_by::{Attribute, ColorRange, MapName};
use limpid_io::frames::FrameSpec;
use limpid_io::media::MediumName;
use limpid_io::particles::{AttributeMap, ReadOptions, Selection};
use limpid_io::sequence::Sequence;

// Options of all commands that read particles; a doc comment here would become their help.
#[derive(clap::Args)]
pub(crate) struct Reading {
    /// Memory limit of one unpacked particle file, MiB [default: 100 times its length, but 1024 to
    /// 16384].
    #[arg(long, value_name = "MIB", value_parser = parse_mib)]
    max_unpacked: Option<u64>,
    /// Read attributes (position, velocity, density, radius or diameter, id, ellipsoid) from arrays with
    /// unusual names: velocity=U,radius=h; from one for each number: position=x,y,z; with a factor:
    /// radius=d/2; or not at all: id=none. `limpid info` lists the arrays.
    #[arg(long, value_name = "ATTRIBUTE=ARRAY,...")]
    map: Option<AttributeMap>,
    /// Read the particles that satisfy a condition on arrays of one number a particle: type==1, 'mk in 1..3',
    /// 'type in 1,3 and rhop>=990'; or all, also walls and bodies, which known layouts leave out. `limpid info`
    /// lists the arrays with their values.
    #[arg(long, value_name = "CONDITION")]
    select: Option<Selection>,
    /// Leave out particles without a finite position even if they are more than half of a file, which
    /// otherwise counts as damaged.
    #[arg(long)]
    skip_invalid: bool,
}

impl Reading {
    pub(crate) fn options(&self) -> ReadOptions {
        let map = self.map.clone().unwrap_or_default();
        ReadOptions {
            max_unpacked: self.max_unpacked,
            map,
            skip_invalid: self.skip_invalid,
            select: self.select.clone().unwrap_or_default(),
            ..ReadOptions::default()
        }
    }
}

// The particles of a command; a doc comment here would become their help.
#[derive(clap::Args)]
pub(crate) struct Inputs {
    /// A scene or recipe (.toml), a particle file, a pattern such as frame_{}.bgeo, a folder, a list
    /// (.pvd, .series), or all files of a sequence, as a shell expands frame_*.bgeo; - reads .npz or PLY from
    /// standard input [default: built in].
    #[arg(value_name = "INPUT")]
    inputs: Vec<PathBuf>,
    /// Merge the files of several ranks into one frame each: rank{r}_{}.vtu.
    #[arg(long, value_name = "PATTERN", conflicts_with = "inputs")]
    merge: Option<String>,
}

impl Inputs {
    /// The inputs as given, each of its own.
    pub(crate) fn each(&self) -> &[PathBuf] {
        &self.inputs
    }

    /// The input, and the frames if they were named one by one.
    pub(crate) fn resolve(&self) -> limpid_io::Result<(Option<PathBuf>, Option<FrameSpec>)> {
        match (&self.merge, self.inputs.as_slice()) {
            (Some(pattern), _) if !pattern.contains("{r}") => {
                let problem = format!(
                    "--merge {pattern}: expected {{r}} for the rank, as rank{{r}}_{{}}.vtu"
                );
                Err(limpid_io::Error::Usage(problem))
            }
            (Some(pattern), _) => Ok((Some(pattern.into()), None)),
            (None, [] | [_]) => Ok((self.inputs.first().cloned(), None)),
            (None, files) if let Some(output) = files.iter().find(|file| is_output(file)) => {
                let output = output.display();
                let problem = format!("{output} is no input; to write it: -o {output}");
                Err(limpid_io::Error::Usage(problem))
            }
            (None, files) => {
                let (pattern, numbers) = Sequence::pattern_of(files)?;
                Ok((Some(pattern), Some(FrameSpec::list(numbers))))
            }
        }
    }
}

// Options that change the scene; a doc comment here would become their help.
#[derive(clap::Args)]
pub(crate) struct SceneChanges {
    /// The look: studio, daylight, pool, night, chart or paint. Replaces sky, light and tone curve, and, unless
    /// the scene has solids of its own, the ground [default: studio for files and for scenes without an
    /// [environment]].
    #[arg(long)]
    look: Option<Look>,
    /// The sky of a look alone.
    #[arg(long, value_name = "LOOK")]
    sky: Option<Look>,
    /// Direction of the sun, in degrees: AZIMUTH,ELEVATION, from +z towards +x and above the horizon; or
    /// none.
    #[arg(long, allow_hyphen_values = true, value_name = "AZIMUTH,ELEVATION")]
    sun: Option<Sun>,
    /// Height of the ground in metres, or none.
    #[arg(long, allow_hyphen_values = true, value_name = "Y")]
    floor: Option<Floor>,
    /// Index of refraction: water 1.33, oil 1.47, an air bubble in water 0.75.
    #[arg(long, value_name = "N")]
    ior: Option<f32>,
    /// Colour of the liquid: that of white light behind its typical thickness, as 0.3,0.7,0.9; physical
    /// (water, whatever its size); or clear.
    #[arg(long, value_name = "R,G,B")]
    tint: Option<Tint>,
    /// Color the particles by an attribute of their files: velocity, density, radius, any other scalar or the length of any
    /// vector by its name, x, y or z; id and fluid as categories; color for colors of their own. Makes the liquid
    /// opaque; without a scene the look is paint. `limpid info` lists the attributes with their ranges.
    #[arg(long, value_name = "ATTRIBUTE", value_parser = parse_attribute)]
    color_by: Option<Attribute>,
    /// The color map of --color-by: viridis, plasma, inferno, magma, cividis, turbo, coolwarm, spectral or greys [default:
    /// viridis].
    #[arg(long, value_name = "NAME")]
    colormap: Option<MapName>,
    /// The values that the map's ends stand for, as 20:80; auto is the 2nd to 98th percentile of the whole sequence, the
    /// same for every frame [default: auto].
    #[arg(long, allow_hyphen_values = true, value_name = "LOW:HIGH")]
    range: Option<ColorRange>,
    /// Medium with measured coefficients: milk, skimmed-milk, muddy-river, sea, coffee, orange-juice, blood or
    /// honey. The body looks as one that is 1 m thick.
    #[arg(long, value_name = "NAME", conflicts_with = "tint")]
    medium: Option<MediumName>,
    /// The medium keeps its coefficients, whatever the size of the body.
    #[arg(long, requires = "medium")]
    physical: bool,
    /// The axis that points up in the files: y or z.
    #[arg(long, value_parser = parse_up)]
    up: Option<Up>,
    /// Length of the files' unit in metres: 0.001 for millimetres.
    #[arg(long, value_name = "METRES", value_parser = parse_scale)]
    scale: Option<f64>,
}

impl SceneChanges {
    /// The changes, with the rate of the sequence.
    pub(crate) fn adjustments(&self, fps: Option<f64>) -> Adjustments {
        let Self {
            look,
            sky,
            sun,
            floor,
            ior,
            tint,
            colormap,
            range,
            medium,
            physical,
            up,
            scale,
            ..
        } = *self;
        let (color_by, color_range) = (self.color_by.clone(), range);
        Adjustments {
            look,
            sky,
            sun,
            floor,
            ior,
            tint,
            color_by,
            colormap,
            color_range,
            medium,
            physical,
            up,
            scale,
            fps,
        }
    }
}

/// The text of a path, for commands that need it.
pub(crate) fn text(path: PathBuf) -> limpid_io::Result<String> {
    path.into_os_string().into_string().map_err(|path| {
        let problem = format!("INPUT {}: expected text in UTF-8 here; rename it", path.display());
        limpid_io::Error::Usage(problem)
    })
}

/// Whether a file is a picture or a film by its name.
fn is_output(file: &Path) -> bool {
    const ENDINGS: [&str; 10] =
        ["png", "jpg", "jpeg", "webp", "exr", "mp4", "webm", "gif", "apng", "tiff"];
    let extension = file.extension().unwrap_or_default().to_string_lossy();
    ENDINGS.iter().any(|ending| extension.eq_ignore_ascii_case(ending))
}

/// Parses the length of a unit.
pub(crate) fn parse_scale(text: &str) -> Result<f64, &'static str> {
    text.parse().map_err(|_| "expected the unit's length in metres, as 0.001")
}

/// Parses the name of an attribute.
fn parse_attribute(text: &str) -> Result<Attribute, &'static str> {
    match text.trim() {
        "" => Err("expected the name of an attribute, as velocity"),
        name => Ok(name.into()),
    }
}

/// Parses the name of an axis.
pub(crate) fn parse_up(text: &str) -> Result<Up, &'static str> {
    match text {
        "y" | "Y" => Ok(Up::Y),
        "z" | "Z" => Ok(Up::Z),
        _ => Err("expected y or z"),
    }
}

/// Parses a number of MiB; returns bytes.
fn parse_mib(text: &str) -> Result<u64, &'static str> {
    let mib = text.parse().ok().filter(|mib| (1..1 << 40).contains(mib));
    mib.map(|mib: u64| mib << 20).ok_or("expected a number of MiB, 1 or more")
}

/// Parses a size in pixels such as `1024x768`.
pub(crate) fn parse_size(text: &str) -> Result<UVec2, String> {
    let parse = || {
        let (width, height) = text.split_once(['x', 'X'])?;
        Some(UVec2::new(width.parse().ok()?, height.parse().ok()?))
    };
    parse().filter(|size| size.min_element() > 0).ok_or("expected WIDTHxHEIGHT, as 1024x768".into())
}
