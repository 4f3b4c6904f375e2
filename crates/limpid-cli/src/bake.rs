//! The command `limpid bake`.

use std::ops::ControlFlow;
use std::path::PathBuf;

use limpid_io::bake;
use limpid_io::project::Project;

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
    let bar = crate::terminal::progress(simulation.frames as usize);
    let baked = bake::bake(&simulation, &project.scene.solids, &name, &folder, |progress| {
        bar.set_position(progress.done.into());
        ControlFlow::Continue(())
    });
    bar.finish_and_clear();
    baked?;
    Ok(crate::SUCCESS)
}
