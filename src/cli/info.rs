//! `limpid info`.

use std::process::ExitCode;

use limpid::frames::FrameSpec;
use limpid::input::Input;
use serde::Serialize;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// A scene, a particle file, a pattern or a folder.
    input: String,
    /// Frames to describe [default: the first].
    #[arg(long, allow_hyphen_values = true)]
    frames: Option<FrameSpec>,
    /// Particle radius in metres, where the files have none.
    #[arg(long)]
    radius: Option<f32>,
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
    described: Vec<FrameInfo>,
}

#[derive(Serialize)]
struct FrameInfo {
    frame: i64,
    path: String,
    particles: usize,
    min: [f32; 3],
    max: [f32; 3],
    attributes: Vec<&'static str>,
    /// m; estimated from the spacing unless given.
    radius: f32,
    splashes: usize,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let mut input = Input::open(&args.input, &[])?;
    if let Some(radius) = args.radius {
        input = input.with_radius(radius)?;
    }
    let frames = &input.sequence.frames;
    let chosen = match &args.frames {
        Some(spec) => spec.select(&input.sequence)?,
        None => frames.iter().take(1).collect(),
    };
    let mut info = Info {
        pattern: input.sequence.pattern.clone(),
        frames: frames.len(),
        first: frames.first().map_or(0, |frame| frame.number),
        last: frames.last().map_or(0, |frame| frame.number),
        described: Vec::new(),
    };
    for frame in chosen {
        let particles = input.particles(frame)?;
        let scene = input.scene_for(frame, &[])?;
        let loaded = input.load(frame, &scene)?;
        let attributes = [
            ("velocity", particles.velocities.is_some()),
            ("density", particles.densities.is_some()),
            ("radius", particles.radii.is_some()),
            ("id", particles.ids.is_some()),
        ];
        info.described.push(FrameInfo {
            frame: frame.number,
            path: frame.path.display().to_string(),
            particles: loaded.particles,
            min: loaded.bounds.0.to_array(),
            max: loaded.bounds.1.to_array(),
            attributes: attributes.iter().filter(|(_, has)| *has).map(|(name, _)| *name).collect(),
            radius: loaded.splats.radius,
            splashes: loaded.splats.splashes.len(),
        });
    }
    let text = if args.json { serde_json::to_string_pretty(&info)? } else { describe(&info) };
    super::print(&text)?;
    Ok(ExitCode::SUCCESS)
}

fn describe(info: &Info) -> String {
    let mut lines =
        vec![format!("{}: {} frames, {} to {}", info.pattern, info.frames, info.first, info.last)];
    for frame in &info.described {
        let attributes = match frame.attributes.as_slice() {
            [] => "positions only".to_owned(),
            names => names.join(", "),
        };
        let [x, y, z] = [0, 1, 2].map(|i| format!("{} to {}", frame.min[i], frame.max[i]));
        lines.push(format!("frame {}: {}", frame.frame, frame.path));
        lines.push(format!("  {} particles, {attributes}", frame.particles));
        lines.push(format!("  x {x}, y {y}, z {z} m"));
        lines.push(format!("  radius {} m, {} splashes", frame.radius, frame.splashes));
    }
    lines.join("\n")
}
