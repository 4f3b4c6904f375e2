//! The scenes of a report, each with its truth.

use std::path::Path;

use glam::{DVec3, UVec2};

use crate::reference::Liquid;
use crate::reference::analytic::{Ball, Block, Pool};
use crate::reference::mesh::{Mesh, Reconstruction};
use limpid::camera::Camera;
use limpid::scene::Scene;
use limpid_io::error::{Error, Result};
use limpid_io::input::{FrameTime, Input, Loaded};
use limpid_io::project::{Processor, Project};
use limpid_sim::recipe::Recipe;

/// The scenes of `sims/` that a report measures.
const RECIPES: [(&str, &str); 12] = [
    ("pool", include_str!("../../../../sims/pool.toml")),
    ("reef", include_str!("../../../../sims/reef.toml")),
    ("drop", include_str!("../../../../sims/drop.toml")),
    ("slab", include_str!("../../../../sims/slab.toml")),
    ("idol", include_str!("../../../../sims/idol.toml")),
    ("breaker", include_str!("../../../../sims/breaker.toml")),
    ("cascade", include_str!("../../../../sims/cascade.toml")),
    ("lagoon", include_str!("../../../../sims/lagoon.toml")),
    ("glass_ball", include_str!("../../../../sims/glass_ball.toml")),
    ("vase", include_str!("../../../../sims/vase.toml")),
    ("demo", ""),
    ("dam", include_str!("../../../../sims/dam.toml")),
];

/// A scene, its particles, and what their surface truly is.
pub struct Subject {
    /// Its name.
    pub name: &'static str,
    /// The scene, with the settings that it names.
    pub scene: Scene,
    /// Whether it is water whose surface alone is asked for, over solids.
    pub is_water: bool,
    /// Views: the scene's own, and those that it names besides.
    pub views: Vec<(String, Camera)>,
    /// The particles as the program would draw them.
    pub loaded: Loaded,
    /// The true surface.
    pub liquid: Box<dyn Liquid>,
    /// The corners of a box that holds the true surface, m.
    pub bounds: (DVec3, DVec3),
    /// What the true surface is.
    pub truth: &'static str,
    input: Input,
}

impl Subject {
    /// Makes the scene of this name.
    ///
    /// # Errors
    /// [`Error::Usage`] for a name that there is not; whatever making its particles or its mesh
    /// may raise.
    pub fn new(name: &str) -> Result<Self> {
        let (name, input, project) = open(name)?;
        let scene = &project.scene;
        let frame = &input.sequence.frames[0];
        let particles = input.particles(frame)?;
        let loaded = input.prepare(frame, &particles, scene)?;
        let (liquid, bounds, truth): (Box<dyn Liquid>, _, _) = match project.source.recipe() {
            Some(Recipe::Ball { center, radius, .. }) => {
                let bounds = (*center - *radius, *center + *radius);
                (Box::new(Ball { center: *center, radius: *radius }), bounds, "analytic")
            }
            Some(Recipe::Slab { min, max, .. }) => {
                (Box::new(Block { min: *min, max: *max }), (*min, *max), "analytic")
            }
            Some(Recipe::Pool(pool)) => {
                let (min, max) = (-pool.half_extent, pool.half_extent);
                let (waves, bottom) = (pool.surface(), -pool.depth);
                let bounds =
                    (DVec3::new(min.x, bottom, min.y), DVec3::new(max.x, waves.bound(), max.y));
                (Box::new(Pool { waves, min, max, bottom }), bounds, "analytic")
            }
            _ => {
                let how = Reconstruction::among(&scene.solids);
                let (at, radius) = (&particles.positions, loaded.splats.radius);
                let mesh = Mesh::reconstruct(at, radius, &how)?;
                let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
                let bounds =
                    (mesh.vertices().iter()).fold(none, |(min, max), v| (min.min(*v), max.max(*v)));
                (Box::new(mesh), bounds, "mesh")
            }
        };
        let camera = project.camera_for(loaded.bulk.bounds);
        let further = project.views.iter().map(|v| (format!("{name}:{}", v.name), v.camera));
        let views = std::iter::once((name.to_owned(), camera)).chain(further).collect();
        let is_water = matches!(project.source.recipe(), Some(Recipe::Pool(_)));
        let scene = project.scene;
        Ok(Self { name, scene, is_water, views, loaded, liquid, bounds, truth, input })
    }

    /// The scene with other settings, and its particles classified by them.
    ///
    /// # Errors
    /// As [`Input::prepare`].
    pub fn with(&self, settings: &limpid::settings::Settings) -> Result<(Scene, Loaded)> {
        // What belongs to the picture, not to a method, stays.
        let caustics = limpid::settings::Caustics {
            method: settings.caustics.method,
            ..self.scene.settings.caustics.clone()
        };
        let settings = limpid::settings::Settings { caustics, ..settings.clone() };
        let scene = Scene { settings: settings.clone(), ..self.scene.clone() };
        if settings.classify == self.scene.settings.classify {
            return Ok((scene, self.loaded.clone()));
        }
        let frame = &self.input.sequence.frames[0];
        let loaded = self.input.load(frame, &scene)?;
        Ok((scene, loaded))
    }
}

/// A scene of this name, or the file of one, with its particles; without its truth, which takes longer
/// than the rest.
///
/// # Errors
/// As [`Subject::new`], and as [`Input::open`] for a file.
pub fn load(name: &str) -> Result<(String, Project, Loaded)> {
    let (name, input, project) = if is_file(name) {
        let (input, project) = Input::open(name)?.resolve()?;
        let stem = Path::new(name).file_stem().unwrap_or_default();
        (stem.to_string_lossy().into_owned(), input, project)
    } else {
        let (name, input, project) = open(name)?;
        (name.to_owned(), input, project)
    };
    // What a report measures comes after it.
    let input = input.processed_by(Processor::Cpu);
    let frame = input.frame.unwrap_or(input.sequence.frames[0].number);
    let loaded = input.load(FrameTime::at(frame), &project.scene)?;
    Ok((name, project, loaded))
}

/// Whether what is to be measured is a file, not a scene's name.
pub(super) fn is_file(name: &str) -> bool {
    name.ends_with(".toml")
}

fn open(name: &str) -> Result<(&'static str, Input, Project)> {
    let (name, text) = find(name)?;
    let input = match text {
        "" => Input::demo()?,
        // The demo's particles, which the program has with it.
        text if name == "dam" => {
            Input::demo()?.with_project(Project::parse(text, name, Path::new(""))?)
        }
        text => Input::from_project(Project::parse(text, name, Path::new(""))?, name)?,
    };
    let (input, project) = input.resolve()?;
    Ok((name, input, project))
}

/// Refuses a name that is not a scene's.
///
/// # Errors
/// [`Error::Usage`] naming the scenes that there are.
pub fn check(name: &str) -> Result<()> {
    find(name).map(|_| ())
}

fn find(name: &str) -> Result<(&'static str, &'static str)> {
    RECIPES.into_iter().find(|(recipe, _)| *recipe == name).ok_or_else(|| {
        let known = RECIPES.map(|(recipe, _)| recipe).join(", ");
        Error::Usage(format!("no scene `{name}` to report on; there are {known}"))
    })
}

/// A size of `width` pixels in the shape of a scene's published pictures.
pub fn size(name: &str, width: u32) -> UVec2 {
    // Mayer et al. show 2000 × 1600, Imai et al. 4 : 3.
    let height = if name.starts_with("pool") || name.starts_with("reef") {
        4 * width / 5
    } else {
        3 * width / 4
    };
    UVec2::new(width, height)
}
