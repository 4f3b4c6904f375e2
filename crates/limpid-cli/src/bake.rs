//! The command `limpid bake`.

use std::path::PathBuf;

use limpid_io::bake::{self, Bake};
use limpid_io::frames::FrameSpec;
use limpid_io::project::Project;

use crate::terminal;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// A scene (.toml) with a [simulation].
    scene: PathBuf,
    /// Folder for the frames, `NAME_0001.bgeo` and so on [default: baked/NAME beside the scene].
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Number of frames [default: the scene's].
    #[arg(long)]
    frames: Option<u32>,
    /// Replace existing frames instead of continuing after them.
    #[arg(long)]
    restart: bool,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<u8> {
    let mut project = Project::load(&args.scene)?;
    let simulation = project.simulation_mut(&args.scene.display().to_string())?;
    simulation.frames = args.frames.unwrap_or(simulation.frames);
    let simulation = simulation.clone();
    let name = args.scene.file_stem().unwrap_or_default().to_string_lossy();
    let folder = args.output.clone().unwrap_or_else(|| bake::folder(&args.scene));
    if args.restart {
        bake::clear(&name, &folder)?;
    }
    let mut bake = Bake::in_folder(&simulation, &project.scene.solids, &name, &folder)?;
    let bar = terminal::progress(simulation.frames as usize);
    let mut again = Vec::new();
    let baked = loop {
        match bake.step() {
            Ok(Some(progress)) => {
                bar.set_position(progress.done.into());
                again.extend(progress.again.then_some(i64::from(progress.done)));
            }
            Ok(None) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    bar.finish_and_clear();
    if !again.is_empty() {
        let were = if again.len() == 1 { "frame was" } else { "frames were" };
        let again = FrameSpec::list(again);
        terminal::remark(format!("{}: {were} damaged, and made again: {again}", folder.display()));
    }
    baked?;
    Ok(crate::SUCCESS)
}
