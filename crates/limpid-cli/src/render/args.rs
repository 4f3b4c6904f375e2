//! Arguments of `limpid render`.

use std::path::PathBuf;

use glam::UVec2;
use limpid::aov::{self, Aov};
use limpid::liquid::Up;
use limpid::settings::Preset;
use limpid_io::camera_axes::GivenCamera;
use limpid_io::frames::{FrameSpec, Shard};
use limpid_io::input::Missing;
use limpid_io::project::overrides;

/// Alias that makes clap read the list as one argument; it would read a `Vec` as one per value.
type AovList = Vec<Aov>;

#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(super) inputs: crate::shared_args::Inputs,
    /// Render the input's particles in this scene.
    #[arg(long)]
    pub(super) scene: Option<PathBuf>,
    /// The picture: .png, .jpg, .webp, or .exr for linear radiance; for several frames a name with a
    /// placeholder for the number (####, {}, %04d, $F4), or a folder [default: limpid.png,
    /// limpid_####.png]. Or a film: .mp4 or .webm, which need ffmpeg, .gif or .apng. - writes a PNG to
    /// standard output.
    #[arg(short, long)]
    pub(super) output: Option<PathBuf>,
    /// Width and height in pixels.
    #[arg(long, default_value = "1024x768", value_parser = crate::shared_args::parse_size)]
    pub(super) size: UVec2,
    /// Frames: 1-3,5, 1-10x2 (also 1-10:2), 10-1, -5..-1, 1-10@b, all; of files numbered by steps, those in the
    /// range [default: the scene's frame, or all].
    #[arg(long, allow_hyphen_values = true)]
    pub(super) frames: Option<FrameSpec>,
    /// A single picture at this time, in frames: 12.25 is a quarter of the way from 12 to 13.
    #[arg(long, allow_hyphen_values = true, value_name = "TIME", value_parser = parse_time)]
    pub(super) at: Option<f64>,
    /// The camera, in the axes of the particle files, in metres and degrees: `eye=1,2,3 target=0,0,0 fov_y=40`,
    /// optionally up=0,1,0 and near=0.01; `height=METRES` in place of `fov_y` for parallel rays [default: the scene's
    /// camera].
    #[arg(long, allow_hyphen_values = true, conflicts_with = "camera_path")]
    pub(super) camera: Option<GivenCamera>,
    /// The axis that points up where the camera's numbers count, y or z, whether of --camera, --camera-path or
    /// the scene [default: that of the particle files].
    #[arg(long, value_name = "AXIS", value_parser = crate::shared_args::parse_up)]
    pub(super) camera_up: Option<Up>,
    /// Treatment of frames that are missing or cannot be read: error, empty, or hold (repeat the frame before).
    #[arg(long, default_value = "error")]
    pub(super) missing: Missing,
    /// Memory for frames loaded ahead, MiB.
    #[arg(long, default_value = "1024", value_name = "MIB", value_parser = clap::value_parser!(u64).range(..1 << 40))]
    pub(super) memory: u64,
    #[command(flatten)]
    pub(super) reading: crate::shared_args::Reading,
    /// Render only share I of N of the frames: I/N, with I from 1.
    #[arg(long)]
    pub(super) shard: Option<Shard>,
    /// Skip frames whose picture is complete and was made from the same particles with the same
    /// settings, size and version.
    #[arg(long)]
    pub(super) skip_existing: bool,
    /// Share the frames with all processes started with this option, on any machine that has the
    /// output folder: each renders frames that no other has claimed. Skips existing pictures.
    #[arg(long)]
    pub(super) claim: bool,
    /// Take over claims that were not renewed for this long: their process has died or lost access.
    #[arg(long, value_name = "SECONDS", default_value = "120", requires = "claim", value_parser = clap::value_parser!(u64).range(1..=1 << 32))]
    pub(super) claim_timeout: u64,
    /// Make foam, spray and bubbles of the liquid up to the last frame that is drawn, and draw them: as `limpid
    /// whitewater` does, into the folder `whitewater` beside the pictures.
    #[arg(long, conflicts_with = "beside")]
    pub(super) whitewater: bool,
    /// Continue with the other frames if one fails; the exit code is then 1. A film repeats the picture before.
    #[arg(long)]
    pub(super) keep_going: bool,
    /// Append a line of JSON for each frame to a file, which several processes may share.
    #[arg(long, value_name = "FILE.jsonl")]
    pub(super) manifest: Option<PathBuf>,
    /// Pictures per second of a film and of the camera's motion [default: the sequence's frames per
    /// second if the scene has them, or 30].
    #[arg(long, value_name = "F")]
    pub(super) fps: Option<f64>,
    /// Playback speed: slow motion below 1, fast motion above. Particles are interpolated between
    /// frames by their ids and velocities.
    #[arg(long, value_name = "X")]
    pub(super) speed: Option<f64>,
    /// Move the camera along the keys in a file; a single frame of particles is shown for their
    /// duration.
    #[arg(long, value_name = "FILE.toml", conflicts_with = "turntable")]
    pub(super) camera_path: Option<PathBuf>,
    /// Rotate the camera about its target, with this duration of a full turn.
    #[arg(long, value_name = "SECONDS")]
    pub(super) turntable: Option<f64>,
    /// Draw a frame from each camera of a file, the keys of a camera path, whose times do not count: its particles are
    /// classified once.
    #[arg(long, value_name = "FILE.toml", conflicts_with_all = ["turntable", "camera_path", "camera"])]
    pub(super) views: Option<PathBuf>,
    /// Rays per pixel: 1 for previews, 4 for final frames.
    #[arg(long)]
    pub(super) samples: Option<u32>,
    /// Particle radius in metres, if the files have none.
    #[arg(long)]
    pub(super) radius: Option<f32>,
    /// Use a published method: limpid, imai2014, imai2016 or mayer2026. Replaces the scene's settings
    /// except caustics and tone mapping; --set is applied afterwards.
    #[arg(long, value_name = "NAME", value_parser = overrides::preset)]
    pub(super) preset: Option<Preset>,
    #[command(flatten)]
    pub(super) changes: crate::shared_args::SceneChanges,
    /// Replace a setting (`limpid settings` lists them): refract.solver=march; or the liquid: liquid.ior=1.4,
    /// "liquid.absorption=[1, 0.3, 0.1]", "fluid.2.absorption=[0, 0, 5]".
    #[arg(long, value_name = "PASS.NAME=VALUE")]
    pub(super) set: Vec<String>,
    /// Pick the fastest intersector whose hits have at most this RMS error in pixels, where a miss
    /// counts as 10; the most accurate of equally fast ones. All other settings stay. The costs are
    /// measured once for an adapter and a size, and the choice is reported. Not for frames shared by
    /// several machines, whose choices may differ.
    #[arg(long, value_name = "PX", value_parser = parse_limit, conflicts_with_all = ["shard", "claim", "skip_existing"])]
    pub(super) max_error: Option<f64>,
    /// Draw the best picture within this device time per frame, in ms: chooses intersector, rays,
    /// bounces, smoothing and intervals for each frame by the times of those before, and reports
    /// the first choice and how many frames took longer. Not for frames shared by several machines.
    #[arg(long, value_name = "MS", value_parser = parse_limit, conflicts_with_all = ["shard", "claim", "skip_existing"])]
    pub(super) budget: Option<f64>,
    /// Measure anew what settings cost, for --max-error or --budget.
    #[arg(long)]
    pub(super) calibrate: bool,
    /// Write coverage as alpha: only liquid and solids cover a pixel, not the environment. For .png,
    /// .webp and .exr.
    #[arg(long)]
    pub(super) alpha: bool,
    /// Draw several inputs beside each other, with one camera, one scale and one clock, and their names below.
    #[arg(long, conflicts_with_all = ["merge", "shard", "claim", "skip_existing", "keep_going", "manifest", "aov", "max_error", "budget", "calibrate", "stats"])]
    pub(super) beside: bool,
    /// Draw a legend of the colors of --color-by over the picture: a bar with its values, their name and unit.
    #[arg(long)]
    pub(super) legend: bool,
    /// Draw a bar of a round length, which holds at the depth of the liquid's middle, over the picture.
    #[arg(long)]
    pub(super) scale_bar: bool,
    /// Draw the directions of the files' axes over the picture.
    #[arg(long)]
    pub(super) axes: bool,
    /// Write intermediate images beside each picture, as NAME.aov.exr: a list, or all.
    #[arg(long, value_name = "LIST", value_parser = aov::parse_list)]
    pub(super) aov: Option<AovList>,
    /// Write adapter, counts and milliseconds per pass to a file.
    #[arg(long, value_name = "FILE.json")]
    pub(super) stats: Option<PathBuf>,
}

fn parse_time(text: &str) -> Result<f64, &'static str> {
    let time = text.parse().ok().filter(|time: &f64| time.is_finite());
    time.ok_or("expected a time in frames, as 12 or 12.25")
}

/// Parses a number above 0.
fn parse_limit(text: &str) -> Result<f64, &'static str> {
    let limit = text.parse().ok().filter(|limit: &f64| limit.is_finite() && *limit > 0.0);
    limit.ok_or("expected a number above 0")
}
