//! The command `limpid web`.

mod page;
mod scene_files;
mod site;

use std::path::{Path, PathBuf};

use limpid_io::Error;
use limpid_io::bake;
use limpid_io::camera_axes::GivenCamera;
use limpid_io::frames::FrameSpec;
use limpid_io::input::Missing;
use limpid_io::open::{Opened, Request};
use limpid_io::project::{LiquidSource, ParticleSource, Project};

use self::site::Site;
use crate::{standard, terminal};

#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    inputs: crate::shared_args::Inputs,
    /// The folder of the site, which is created. Only a site that this command wrote, and nobody changed, is replaced.
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Show the input's particles in this scene.
    #[arg(long)]
    scene: Option<PathBuf>,
    /// Frames: 1-3,5, 7-20:2, all [default: all].
    #[arg(long, allow_hyphen_values = true)]
    frames: Option<FrameSpec>,
    /// The camera, as for `limpid render` [default: the scene's camera, or one that fits the visitor's window].
    #[arg(long, allow_hyphen_values = true)]
    camera: Option<GivenCamera>,
    /// Particle radius in metres, if the files have none.
    #[arg(long)]
    radius: Option<f32>,
    #[command(flatten)]
    changes: crate::shared_args::SceneChanges,
    /// Frames per second of the sequence [default: the scene's, or 30].
    #[arg(long, value_name = "F")]
    fps: Option<f64>,
    /// Replace a setting (`limpid settings` lists them): refract.solver=march.
    #[arg(long, value_name = "PASS.NAME=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    reading: crate::shared_args::Reading,
    /// The folder of the page, which scripts/web.sh builds [default: page beside this program, or web/dist of the
    /// repository].
    #[arg(long, value_name = "FOLDER")]
    page: Option<PathBuf>,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<u8> {
    let (input, listed) = args.inputs.resolve()?;
    if input.is_none() && args.scene.is_none() {
        let problem = "expected an INPUT: frames or a scene, as in limpid web frames/ -o site";
        return Err(Error::Usage(problem.into()).into());
    }
    if input.as_deref().is_some_and(standard::is_dash) {
        let problem = "-: a site is made from files; save standard input as one";
        return Err(Error::Usage(problem.into()).into());
    }
    let page = page::find(args.page.as_deref())?;
    let mut site = Site::begin(&args.output)?;
    let request = Request {
        input,
        scene: args.scene.clone(),
        radius: args.radius,
        overrides: args.set.clone(),
        camera: args.camera,
        missing: Missing::Error,
        options: args.reading.options(),
        adjustments: args.changes.adjustments(args.fps),
        ..Request::default()
    };
    let opened = request.open()?;
    let spec = args.frames.clone().or(listed).unwrap_or_default();
    let numbers = spec.numbers(&opened.loader.sequence, Missing::Error)?;
    let project = project_of(&request, &opened, &numbers)?;
    scene_files::add(&mut site, &project, &numbers)?;
    page::add(&mut site, &page, numbers.len() > 1)?;
    let bytes = site.finish()?;
    let (site, mib) = (args.output.display(), bytes.div_ceil(1 << 20));
    terminal::remark(format!(
        "{site}: {mib} MiB for any server; to look at it: python3 -m http.server --directory {site}"
    ));
    Ok(crate::SUCCESS)
}

/// The scene of the site, with the files of its particles.
fn project_of(request: &Request, opened: &Opened, numbers: &[i64]) -> limpid_io::Result<Project> {
    let input = request.input.as_deref();
    let scene_input =
        input.filter(|path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")));
    let mut source = opened.loader.source();
    if let LiquidSource::Simulation(simulation) = &source {
        // Its baked frames; the page would simulate them again.
        let scene = scene_input.or(request.scene.as_deref()).unwrap_or(Path::new(""));
        let name = scene.file_stem().unwrap_or_default().to_string_lossy();
        source = LiquidSource::File(ParticleSource {
            source: bake::frame_pattern(&bake::folder(scene), &name).into(),
            radius: Some(simulation.particle_radius() as f32),
            up: Some(limpid::liquid::Up::Y),
            ..ParticleSource::default()
        });
    }
    for particles in source.files_mut() {
        if particles.source.as_os_str().is_empty() {
            let problem = "the particles of a site are in files: name them";
            return Err(Error::Usage(problem.into()));
        }
        particles.fps = opened.loader.fps();
        particles.frame = particles.frame.filter(|frame| numbers.contains(frame));
    }
    // Companions of the frames are named, since servers list no folders.
    let whitewater = opened.loader.diffuse_sources(numbers)?;
    let diffuse = Some(whitewater).filter(|sources| !sources.is_empty());
    let mut project = Project { source, diffuse, ..opened.project.clone() };
    let scene = request.scene.as_deref().or(scene_input);
    let has_camera = match scene {
        Some(scene) => Project::load(scene)?.camera.is_some(),
        None => false,
    };
    if !has_camera && request.camera.is_none() {
        // The page fits one to its window.
        project.camera = None;
    }
    // It would read many frames to find out.
    if let (Some(by), Some(scale)) = (&mut project.color_by, opened.loader.color_scale()?) {
        by.range = Some(scale.range);
    }
    Ok(project)
}
