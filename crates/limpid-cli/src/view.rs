//! The command `limpid view`.

use std::path::PathBuf;

use glam::UVec2;
use limpid::settings::Preset;
use limpid_io::frames::FrameSpec;
use limpid_io::input::Missing;
use limpid_io::project::overrides;

#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    inputs: crate::shared_args::Inputs,
    /// Render the input's particles in this scene.
    #[arg(long)]
    scene: Option<PathBuf>,
    /// Particle radius in metres, if the files have none.
    #[arg(long)]
    radius: Option<f32>,
    /// Start with the settings of a published method: limpid, imai2014, imai2016 or mayer2026.
    #[arg(long, value_name = "NAME", value_parser = overrides::preset)]
    preset: Option<Preset>,
    #[command(flatten)]
    changes: crate::shared_args::SceneChanges,
    /// Frames per second of the sequence [default: the scene's, or 30].
    #[arg(long, value_name = "F")]
    fps: Option<f64>,
    /// Start with a setting replaced: refract.solver=march, liquid.ior=1.4.
    #[arg(long, value_name = "PASS.NAME=VALUE")]
    set: Vec<String>,
    /// Frames: 1-3,5, 7-20:2, all [default: all].
    #[arg(long, allow_hyphen_values = true)]
    frames: Option<FrameSpec>,
    /// Treatment of frames that are missing or cannot be read: error, empty, or hold (repeat the frame before).
    #[arg(long, default_value = "error")]
    missing: Missing,
    /// Width and height of the window.
    #[arg(long, default_value = "1280x800", value_parser = crate::shared_args::parse_size)]
    size: UVec2,
    /// Memory for frames loaded ahead, MiB.
    #[arg(long, default_value = "1024", value_name = "MIB", value_parser = clap::value_parser!(u64).range(..1 << 40))]
    memory: u64,
    /// Memory for pictures that are kept for playback where drawing is slower than that, MiB; 0 keeps none.
    #[arg(long, default_value = "1024", value_name = "MIB", value_parser = clap::value_parser!(u64).range(..1 << 40))]
    flipbook: u64,
    /// Show a legend of the colors of --color-by over the picture, also over saved ones.
    #[arg(long)]
    legend: bool,
    #[command(flatten)]
    reading: crate::shared_args::Reading,
    /// Log events for tests and bug reports: one JSON object per line, with seconds since the start.
    /// `ui_ms` is the longest time that the interface was busy without a pause.
    #[arg(long, value_name = "FILE.jsonl")]
    log: Option<PathBuf>,
}

#[cfg(feature = "viewer")]
pub(crate) fn run(args: Args) -> anyhow::Result<u8> {
    use limpid_viewer::model::demos::DEMOS;
    use limpid_viewer::model::document::Source;
    use limpid_viewer::{Options, run};

    let mut overrides = Vec::from_iter(args.preset.map(|preset| format!("preset={preset}")));
    overrides.extend(args.set);
    let (input, frames) = args.inputs.resolve()?;
    let source = Source {
        input: input.map_or(Ok(String::new()), crate::shared_args::text)?,
        scene: args.scene,
        radius: args.radius,
        overrides,
        frames: args.frames.or(frames),
        missing: args.missing,
        options: args.reading.options(),
        adjustments: args.changes.adjustments(args.fps),
        ..Source::default()
    };
    let source = match source.input.is_empty() {
        false => Some(source),
        // The first screen.
        true if source == Source::default() => None,
        true => Some(Source { input: DEMOS[0].source()?.input, ..source }),
    };
    let shown = run(Options {
        source,
        window: args.size,
        memory: args.memory << 20,
        flipbook: args.flipbook << 20,
        legend: args.legend,
        recent: limpid_io::output::cache_folder().map(|folder| folder.join("recent.json")),
        log: args.log,
    });
    // Removes the temporary files of threads that end with the process.
    limpid_io::output::abandon();
    shown?;
    Ok(crate::SUCCESS)
}

#[cfg(not(feature = "viewer"))]
pub(crate) fn run(_args: Args) -> anyhow::Result<u8> {
    let problem = "this limpid was built without its window; build it with: \
                   cargo build --release --features viewer";
    Err(limpid_io::Error::Usage(problem.into()).into())
}
