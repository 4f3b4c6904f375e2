//! The command `limpid scene`.

use std::path::PathBuf;

use glam::UVec2;
use limpid::look::Framing;
use limpid_io::input::Missing;
use limpid_io::open::Request;
use limpid_io::project::Project;

use crate::{standard, terminal};

#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    inputs: crate::shared_args::Inputs,
    /// Complete this scene with the input's particles.
    #[arg(long)]
    scene: Option<PathBuf>,
    /// Width and height in pixels of the pictures that the camera is for.
    #[arg(long, default_value = "1024x768", value_parser = crate::shared_args::parse_size)]
    size: UVec2,
    /// Particle radius in metres, if the files have none.
    #[arg(long)]
    radius: Option<f32>,
    #[command(flatten)]
    changes: crate::shared_args::SceneChanges,
    /// Frames per second of the sequence.
    #[arg(long, value_name = "F")]
    fps: Option<f64>,
    /// Replace a setting (`limpid settings` lists them): refract.solver=march.
    #[arg(long, value_name = "PASS.NAME=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    reading: crate::shared_args::Reading,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<u8> {
    let input = args.inputs.resolve()?.0;
    // The scene names it.
    input.clone().map(crate::shared_args::text).transpose()?;
    let request = Request {
        input,
        scene: args.scene.clone(),
        radius: args.radius,
        overrides: args.set.clone(),
        camera: None,
        camera_up: None,
        missing: Missing::Hold,
        options: args.reading.options(),
        adjustments: args.changes.adjustments(args.fps),
        framing: Framing::of(args.size),
        ..Request::default()
    };
    let opened = standard::open(&request)?;
    let project = Project { source: opened.loader.source(), ..opened.project };
    terminal::print(project.to_commented_toml(None)?.trim_end())?;
    Ok(crate::SUCCESS)
}
