//! The command `limpid info`.
use limpid::diffuse::DiffuseKind;
use limpid::liquid::Particles;
use limpid_io::Error;
use limpid_io::color_by::AttributeRange;
use limpid_io::frames::FrameSpec;
use limpid_io::input::Input;
use limpid_io::notice::brief;
use limpid_io::particles::{Array, Attribute, Contents, ReadOptions, attribute_names};
use limpid_io::spread::Spread;
use serde::Serialize;

use crate::remedy::of_remark;
use crate::standard;

#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    inputs: crate::shared_args::Inputs,
    /// Frames to describe [default: the first].
    #[arg(long, allow_hyphen_values = true)]
    frames: Option<FrameSpec>,
    /// Particle radius in metres, if the files have none.
    #[arg(long)]
    radius: Option<f32>,
    #[command(flatten)]
    reading: crate::shared_args::Reading,
    /// Print machine-readable results.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Info {
    pattern: String,
    frames: usize,
    first: i64,
    last: i64,
    /// Difference of consecutive numbers; `None` if they differ unevenly.
    stride: Option<u64>,
    /// The axis that points up in the files; the description has y up.
    up: String,
    /// The rule that decided: option, scene, flat, guessed, default, or the name of a program.
    up_from: &'static str,
    /// Whether z points up and neither an option nor a scene says so.
    turned: bool,
    /// The patterns of the files of foam, spray, bubbles and dust beside the liquid.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    diffuse: Vec<String>,
    described: Vec<FrameInfo>,
}

#[derive(Serialize)]
struct FrameInfo {
    frame: i64,
    path: String,
    particles: usize,
    min: [f64; 3],
    max: [f64; 3],
    /// Bounds of the bulk of the particles, to which default cameras and floors are fitted.
    bulk_min: [f64; 3],
    bulk_max: [f64; 3],
    /// Number of particles outside these bounds.
    outside: usize,
    attributes: Vec<&'static str>,
    /// Arrays of the file other than the positions.
    arrays: Vec<ArrayInfo>,
    /// The values that particles can be colored by.
    ranges: Vec<RangeInfo>,
    /// Remarks on the file.
    remarks: Vec<String>,
    /// m; estimated from the spacing unless given; `None` for a single particle.
    radius: Option<f32>,
    /// Numbers of foam, spray, bubbles and dust beside the liquid; empty without any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    diffuse: Vec<(&'static str, usize)>,
}

#[derive(Serialize)]
struct ArrayInfo {
    name: String,
    shape: Vec<usize>,
    /// The attribute that the array is read as; `None` if it is ignored.
    used_as: Option<&'static str>,
    /// Its values, if it is ignored and they are few integers.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    values: Vec<i64>,
    /// Name and shape, as text.
    #[serde(skip)]
    label: String,
}

/// The values of an attribute, or of an array that is none: of vectors, their lengths.
#[derive(Serialize)]
struct RangeInfo {
    name: String,
    unit: String,
    min: f32,
    max: f32,
    /// The 2nd and the 98th percentile.
    low: f32,
    high: f32,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<u8> {
    let options = ReadOptions { values: true, ..args.reading.options() };
    let (input, named) = args.inputs.resolve()?;
    let input = match input {
        Some(path) if standard::is_dash(&path) => standard::input(&options)?,
        Some(path) => Input::outline(path)?,
        None => Input::demo()?,
    };
    let mut input = input.with_options(&options);
    if let Some(radius) = args.radius {
        input = input.with_radius(radius)?;
    }
    // Resolves the radius as `render` does; input without one is described without it.
    let input = match input.clone().resolve() {
        Ok((resolved, _)) => resolved,
        Err(error @ Error::Render(limpid::Error::Memory { .. })) => return Err(error.into()),
        Err(_) => input.loader,
    };
    let frames = &input.sequence.frames;
    let chosen = match args.frames.as_ref().or(named.as_ref()) {
        Some(spec) => spec.select(&input.sequence)?,
        None => frames.iter().take(1).collect(),
    };
    let mut info = Info {
        pattern: input.sequence.pattern.clone(),
        frames: frames.len(),
        first: frames.first().map_or(0, |frame| frame.number),
        last: frames.last().map_or(0, |frame| frame.number),
        up: input.up().0.to_string(),
        up_from: input.up().1.word(),
        stride: input.sequence.even_stride(),
        turned: input.is_turned(),
        diffuse: input.diffuse_patterns().map(str::to_owned).collect(),
        described: Vec::new(),
    };
    for frame in chosen {
        let Contents { particles, arrays, remarks, .. } = input.contents(frame)?;
        // A file without a radius is described all the same.
        let radius = match input.radius(frame, &particles) {
            Err(Error::UnknownRadius { .. }) => None,
            radius => Some(radius?),
        };
        let (diffuse, on_diffuse) = input.diffuse(frame, radius.unwrap_or(1.0))?;
        let counts = diffuse.map(|diffuse| diffuse.counts()).unwrap_or_default();
        let counts = DiffuseKind::ALL.map(DiffuseKind::name).into_iter().zip(counts);
        let (min, max) = particles.bounds().unwrap_or_default();
        let bulk = input.bulk(&particles);
        info.described.push(FrameInfo {
            frame: frame.number,
            path: frame.path.display().to_string(),
            particles: particles.len(),
            min: min.to_array().map(shortest),
            max: max.to_array().map(shortest),
            bulk_min: bulk.bounds.0.to_array().map(shortest),
            bulk_max: bulk.bounds.1.to_array().map(shortest),
            outside: bulk.outside,
            attributes: attribute_names(&particles).collect(),
            ranges: ranges(&particles, &arrays),
            arrays: arrays.into_iter().map(array_info).collect(),
            remarks: remarks.iter().chain(&on_diffuse).map(of_remark).collect(),
            radius,
            diffuse: counts.filter(|(_, count)| *count > 0).collect(),
        });
    }
    let text = if args.json { serde_json::to_string_pretty(&info)? } else { describe(&info) };
    crate::terminal::print(&text)?;
    Ok(crate::SUCCESS)
}

impl ArrayInfo {
    /// Describes the array: `velocity (4732, 3)`, `U (4732, 3) as velocity`.
    fn description(&self) -> String {
        match self.used_as {
            Some(attribute) if attribute != self.name => format!("{} as {attribute}", self.label),
            _ => self.label.clone(),
        }
    }
}

/// The ranges of the attributes of particles, and of the other arrays of their file.
fn ranges(particles: &Particles, arrays: &[Array]) -> Vec<RangeInfo> {
    // Few integers are listed by themselves.
    let spread = arrays.iter().filter(|array| array.values.is_empty());
    let info = |AttributeRange { name, unit, spread }| {
        let Spread { extremes: [min, max], usual: [low, high] } = spread?;
        Some(RangeInfo { name, unit, min, max, low, high })
    };
    AttributeRange::of(particles, spread).into_iter().filter_map(info).collect()
}

impl RangeInfo {
    /// Describes the values: `density: 998 to 1004 kg/m³ (96 % from 999.1 to 1002.7)`.
    fn description(&self) -> String {
        let Self { name, unit, min, max, low, high } = self;
        let [min, max, low, high] = [min, max, low, high].map(|&x| brief(x));
        let space = if unit.is_empty() { "" } else { " " };
        match min == max {
            true => format!("{name}: {min}{space}{unit}"),
            // Of several files together.
            false if [low, high] == [min, max] => format!("{name}: {min} to {max}{space}{unit}"),
            false => format!("{name}: {min} to {max}{space}{unit} (96 % from {low} to {high})"),
        }
    }
}

fn array_info(array: Array) -> ArrayInfo {
    let label = array.to_string();
    let Array { name, shape, used_as, values, .. } = array;
    ArrayInfo { name, shape, used_as: used_as.map(Attribute::name), values, label }
}

/// Rounds a value that fits a 32-bit float to the shortest digits of that float.
fn shortest(x: f64) -> f64 {
    // Without the sign of a 0.
    let x = x + 0.0;
    let single = x as f32;
    if f64::from(single) == x { single.to_string().parse().unwrap_or(x) } else { x }
}

/// A list under a title, in lines of at most 100 columns where no item is longer.
fn listed(title: &str, items: &[String]) -> Vec<String> {
    const COLUMNS: usize = 100;
    let mut lines: Vec<String> = Vec::new();
    for (k, item) in items.iter().enumerate() {
        let comma = if k + 1 < items.len() { "," } else { "" };
        match lines.last_mut() {
            None => lines.push(format!("  {title}: {item}{comma}")),
            Some(line)
                if line.chars().count() + 1 + item.chars().count() + comma.len() > COLUMNS =>
            {
                lines.push(format!("    {item}{comma}"));
            }
            Some(line) => *line += &format!(" {item}{comma}"),
        }
    }
    lines
}

fn describe(info: &Info) -> String {
    let steps = match info.stride {
        Some(1) => String::new(),
        Some(stride) => format!(", by steps of {stride}"),
        None => ", unevenly numbered".into(),
    };
    let Info { pattern, frames, first, last, .. } = info;
    let numbers = match frames {
        1 => format!("1 frame, {first}"),
        _ => format!("{frames} frames, {first} to {last}{steps}"),
    };
    let mut lines = vec![format!("{pattern}: {numbers}")];
    lines.extend(info.diffuse.iter().map(|pattern| format!("beside it: {pattern}")));
    match (info.up.as_str(), info.up_from) {
        ("y", "flat") => lines.push("y points up in the files (flat)".to_owned()),
        ("y", _) => {}
        ("z", "guessed") => {
            lines.push(
                "z seems to point up in the files (guessed); places are in their axes".into(),
            );
        }
        (up, from) => {
            lines.push(format!("{up} points up in the files ({from}); places are in their axes"));
        }
    }
    for frame in &info.described {
        let attributes = match frame.attributes.as_slice() {
            [] => "positions only".to_owned(),
            names => names.join(", "),
        };
        // In the axes of the files, in which cameras are given too.
        let extent = |min: [f64; 3], max: [f64; 3]| {
            let along = |i: usize| (min[i], max[i]);
            let [x, y, z] = match info.up.as_str() {
                "z" => [along(0), (0.0 - max[2], 0.0 - min[2]), along(1)],
                _ => [0, 1, 2].map(along),
            };
            let [x, y, z] = [x, y, z].map(|(low, high)| format!("{low} to {high}"));
            format!("x {x}, y {y}, z {z} m")
        };
        lines.push(format!("frame {}: {}", frame.frame, frame.path));
        lines.push(format!("  {} particles, {attributes}", frame.particles));
        for (used, title) in [(true, "used"), (false, "ignored")] {
            let arrays = frame.arrays.iter().filter(|array| array.used_as.is_some() == used);
            let descriptions: Vec<String> = arrays.map(ArrayInfo::description).collect();
            lines.extend(listed(title, &descriptions));
        }
        for array in frame.arrays.iter().filter(|array| array.values.len() > 1) {
            let values: Vec<String> = array.values.iter().map(i64::to_string).collect();
            lines.push(format!("  {}: {}", array.label, values.join(", ")));
        }
        lines.extend(frame.ranges.iter().map(|range| format!("  {}", range.description())));
        lines.extend(frame.remarks.iter().map(|remark| format!("  {remark}")));
        lines.push(format!("  {}", extent(frame.min, frame.max)));
        if !frame.diffuse.is_empty() {
            let counts = frame.diffuse.iter().map(|(name, count)| format!("{count} {name}"));
            lines.push(format!("  beside it {}", counts.collect::<Vec<_>>().join(", ")));
        }
        if frame.outside > 0 {
            let bulk = extent(frame.bulk_min, frame.bulk_max);
            lines.push(format!("  {} lie outside of {bulk}", frame.outside));
        }
        lines.push(match frame.radius {
            Some(radius) => format!("  radius {radius} m"),
            None => "  no radii, and no spacing to estimate one from".to_owned(),
        });
    }
    lines.join("\n")
}
