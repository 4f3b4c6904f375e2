//! The command `limpid whitewater`.

use std::path::PathBuf;
use std::time::Duration;

use limpid::glam::Vec3;
use limpid::liquid::Up;
use limpid::scene::Scene;
use limpid_io::Error;
use limpid_io::adjustments::Adjustments;
use limpid_io::claim::Claims;
use limpid_io::frames::FrameSpec;
use limpid_io::input::{Loader, Missing};
use limpid_io::notice::diffuse_counts;
use limpid_io::open::Request;
use limpid_io::whitewater::{Choices, Files, Making};

use crate::{sharing, signals, standard, terminal};

/// Age at which a claim of a process that has died is taken over, and interval at which claims are checked.
const STALE: Duration = Duration::from_secs(120);
const POLL: Duration = Duration::from_millis(500);

/// Exit code if some frames failed and others did not.
const FAILED_CODE: u8 = 1;

// Choices of whitewater; a doc comment here would become their help.
#[derive(clap::Args)]
struct Whitewater {
    /// Seed of the random numbers of whitewater.
    #[arg(long, value_name = "N", default_value = "1")]
    seed: u64,
    /// Factor of the number of foam, spray and bubbles: 0 to 1000.
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = parse_amount)]
    amount: f32,
    /// Raise dust from the ground, as turbid liquid does without this option.
    #[arg(long)]
    dust: bool,
}

/// Choices for a scene, whose turbid liquid raises dust.
pub(crate) fn choices_for(scene: &Scene, choices: Choices) -> Choices {
    let turbid = scene.liquid.scattering != Vec3::ZERO;
    Choices { dust: choices.dust || turbid, ..choices }
}

#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    inputs: crate::shared_args::Inputs,
    /// Folder for the frames, `NAME_whitewater_0001.bgeo` and so on. Beside those of the liquid, all commands find them.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Format of the frames: bgeo, bgeo.gz, bhclassic, vtk, vtu, ply, npz or csv.
    #[arg(long, value_name = "EXTENSION", default_value = "bgeo")]
    format: String,
    #[command(flatten)]
    whitewater: Whitewater,
    /// Keep particles out of the solids of this scene.
    #[arg(long)]
    scene: Option<PathBuf>,
    /// Particle radius in metres, if the files have none.
    #[arg(long)]
    radius: Option<f32>,
    /// Frames per second of the simulation [default: the scene's, or what positions and velocities tell, or 30].
    #[arg(long)]
    fps: Option<f64>,
    /// The axis that points up in the files: y or z.
    #[arg(long, value_parser = crate::shared_args::parse_up)]
    up: Option<Up>,
    /// Length of the files' unit in metres: 0.001 for millimetres.
    #[arg(long, value_name = "METRES", value_parser = crate::shared_args::parse_scale)]
    scale: Option<f64>,
    /// Treatment of frames that are missing or cannot be read: error, empty, or hold (repeat the frame before).
    #[arg(long, default_value = "error")]
    missing: Missing,
    /// Continue with the liquid of the frame before if one fails; the exit code is then 1.
    #[arg(long)]
    keep_going: bool,
    #[command(flatten)]
    reading: crate::shared_args::Reading,
}

fn parse_amount(text: &str) -> Result<f32, &'static str> {
    let amount = text.parse().ok().filter(|amount: &f32| (0.0..=1000.0).contains(amount));
    amount.ok_or("expected 0 to 1000")
}

pub(crate) fn run(args: &Args) -> anyhow::Result<u8> {
    let (input, _) = args.inputs.resolve()?;
    let request = Request {
        input,
        scene: args.scene.clone(),
        radius: args.radius,
        missing: args.missing,
        options: args.reading.options(),
        adjustments: Adjustments {
            up: args.up,
            scale: args.scale,
            fps: args.fps,
            ..Adjustments::default()
        },
        ..Request::default()
    };
    let opened = standard::open(&request)?;
    let files = Files::of(&opened.loader, &args.output, &args.format);
    let Whitewater { seed, amount, dust } = args.whitewater;
    let scene = &opened.project.scene;
    let choices = choices_for(scene, Choices { seed, amount, dust });
    signals::finish_first();
    let made = make(&opened.loader, scene, files.clone(), choices, args.keep_going, i64::MAX)?;
    if let Some(code) = made.interrupted {
        return Ok(code);
    }
    let counts = made.last.map(|counts| {
        let each = diffuse_counts(counts).unwrap_or_else(|| "nothing".into());
        format!(": {each} in the last frame")
    });
    let text = format!("{}{}", files.pattern().display(), counts.unwrap_or_default());
    terminal::print(&text)?;
    Ok(if made.failed.is_empty() { crate::SUCCESS } else { FAILED_CODE })
}

/// The outcome of making frames.
pub(crate) struct Outcome {
    /// Frames whose liquid could not be read.
    failed: Vec<i64>,
    /// Particles of the last frame by kind, if it was made now.
    last: Option<[usize; 4]>,
    /// The exit code of a signal that ended the work.
    pub(crate) interrupted: Option<u8>,
}

/// Makes the frames up to a number, alone: if another process makes them, waits for it.
pub(crate) fn make(
    loader: &Loader,
    scene: &Scene,
    files: Files,
    choices: Choices,
    keep_going: bool,
    until: i64,
) -> limpid_io::Result<Outcome> {
    let fail = |source| Error::Io { path: files.folder.clone(), action: "create", source };
    std::fs::create_dir_all(&files.folder).map_err(fail)?;
    let claims = sharing::claims(STALE);
    let record = files.record();
    let mut told = false;
    let _claim = loop {
        if let Some(claim) = claims.take(&record)? {
            break claim;
        }
        if !std::mem::replace(&mut told, true) {
            terminal::warn(format!(
                "waiting for whitewater that is made by {}",
                Claims::holder(&record)
            ));
        }
        if let Some(code) = signals::received() {
            return Ok(Outcome { failed: Vec::new(), last: None, interrupted: Some(code) });
        }
        std::thread::sleep(POLL);
    };
    let mut making = Making::new(loader, scene, files, choices, keep_going)?;
    let frames = loader.sequence.frames.iter().filter(|frame| frame.number <= until).count();
    let bar = terminal::progress(frames);
    let mut outcome = Outcome { failed: Vec::new(), last: None, interrupted: None };
    for _ in 0..frames {
        let step = making.step();
        if step.is_err() {
            bar.finish_and_clear();
        }
        let Some(progress) = step? else { break };
        bar.inc(1);
        outcome.last = progress.counts;
        if let Some(problem) = progress.problem {
            bar.suspend(|| terminal::warn(format!("frame {}: {problem}", progress.number)));
            outcome.failed.push(progress.number);
        }
        outcome.interrupted = signals::received();
        if outcome.interrupted.is_some() {
            break;
        }
    }
    bar.finish_and_clear();
    if !outcome.failed.is_empty() {
        let failed = FrameSpec::list(outcome.failed.clone());
        terminal::warn(format!("made with the liquid of the frame before: {failed}"));
    }
    Ok(outcome)
}
