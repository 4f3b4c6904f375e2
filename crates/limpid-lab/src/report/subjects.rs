//! The scenes of a report, with their ground truth.

use std::path::Path;

use glam::{DVec3, UVec2};

use crate::reference::Liquid;
use crate::reference::analytic::{Ball, Block, Pool};
use crate::reference::mesh::{Mesh, Reconstruction};
use limpid::camera::Camera;
use limpid::liquid::particles::Particles;
use limpid::scene::Scene;
use limpid::sims;
use limpid_io::error::{Error, Result};
use limpid_io::input::{FrameTime, Input, Loaded, Loader};
use limpid_io::project::Project;
use limpid_io::shared_classifier::Processor;
use limpid_sim::recipe::Recipe;

/// The scenes of `sims/` that a report measures.
const RECIPES: [(&str, &str); 12] = [
    ("pool", sims::POOL),
    ("reef", sims::REEF),
    ("drop", sims::DROP),
    ("slab", sims::SLAB),
    ("idol", sims::IDOL),
    ("breaker", sims::BREAKER),
    ("cascade", sims::CASCADE),
    ("lagoon", sims::LAGOON),
    ("glass_ball", sims::GLASS_BALL),
    ("vase", sims::VASE),
    ("demo", ""),
    ("dam", sims::DAM),
];

/// A scene, its particles, and their true surface.
pub struct Subject {
    /// Its name.
    pub name: &'static str,
    /// The scene, with its own settings.
    pub scene: Scene,
    /// Whether it is water over solids of which only the surface is measured.
    pub is_water: bool,
    /// Views: the scene's own, and its further named ones.
    pub views: Vec<(String, Camera)>,
    /// The particles as the program would render them.
    pub loaded: Loaded,
    /// The true surface.
    pub liquid: Box<dyn Liquid>,
    /// Corners of a box around the true surface, m.
    pub bounds: (DVec3, DVec3),
    /// Kind of the true surface: `analytic` or `mesh`.
    pub truth: &'static str,
    input: Loader,
}

impl Subject {
    /// Loads the scene of this name.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown name; any error of generating its particles or its mesh.
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

    /// Returns the scene with other settings, and its particles classified with them.
    ///
    /// # Errors
    /// As [`Loader::prepare`].
    pub fn with(&self, settings: &limpid::settings::Settings) -> Result<(Scene, Loaded)> {
        // Settings of the picture, as opposed to the method, stay.
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

    /// Returns the scene with other settings, and these particles classified with them.
    ///
    /// # Errors
    /// As [`Loader::prepare`].
    pub fn prepared(
        &self,
        particles: &Particles,
        settings: &limpid::settings::Settings,
    ) -> Result<(Scene, Loaded)> {
        let scene = Scene { settings: settings.clone(), ..self.scene.clone() };
        let loaded = self.input.prepare(&self.input.sequence.frames[0], particles, &scene)?;
        Ok((scene, loaded))
    }

    /// Returns the particles after this time, s, along their velocities, and the mesh around them; `None` without
    /// velocities.
    ///
    /// # Errors
    /// As [`Loader::particles`] and [`Mesh::reconstruct`].
    pub fn after(&self, seconds: f64) -> Result<Option<(Particles, Mesh)>> {
        let mut particles = self.input.particles(&self.input.sequence.frames[0])?;
        let Some(velocities) = &particles.velocities else { return Ok(None) };
        for (position, velocity) in particles.positions.iter_mut().zip(velocities) {
            *position += seconds as f32 * *velocity;
        }
        let how = Reconstruction::among(&self.scene.solids);
        let mesh = Mesh::reconstruct(&particles.positions, self.loaded.splats.radius, &how)?;
        Ok(Some((particles, mesh)))
    }
}

/// Loads a scene by name or file, with its particles but without its truth, which takes longer than
/// the rest.
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
    // Classification precedes what a report measures.
    let input = input.processed_by(Processor::Cpu);
    let frame = input.frame.unwrap_or(input.sequence.frames[0].number);
    let loaded = input.load(FrameTime::at(frame), &project.scene)?;
    let scene = loaded.scene(&project.scene).into_owned();
    let project = Project { scene, ..project };
    Ok((name, project, loaded))
}

/// Whether a scene to measure is given as a file instead of a name.
pub(super) fn is_file(name: &str) -> bool {
    name.ends_with(".toml")
}

fn open(name: &str) -> Result<(&'static str, Loader, Project)> {
    let (name, text) = find(name)?;
    let input = match text {
        "" => Input::demo()?,
        // Uses the demo's particles, which are embedded in the program.
        text if name == "dam" => {
            Input::demo()?.with_project(Project::parse(text, name, Path::new(""))?)
        }
        text => Input::from_project(Project::parse(text, name, Path::new(""))?, name)?,
    };
    let (input, project) = input.resolve()?;
    Ok((name, input, project))
}

/// Checks that a scene of this name exists.
///
/// # Errors
/// [`Error::Usage`] listing the scenes.
pub fn check(name: &str) -> Result<()> {
    find(name).map(|_| ())
}

fn find(name: &str) -> Result<(&'static str, &'static str)> {
    RECIPES.into_iter().find(|(recipe, _)| *recipe == name).ok_or_else(|| {
        let known = RECIPES.map(|(recipe, _)| recipe).join(", ");
        Error::Usage(format!("no scene `{name}` to report on; there are {known}"))
    })
}

/// Returns a size of `width` pixels with the aspect ratio of a scene's published pictures.
pub fn size(name: &str, width: u32) -> UVec2 {
    // Mayer et al. use 2000 × 1600, Imai et al. 4 : 3.
    let height = if name.starts_with("pool") || name.starts_with("reef") {
        4 * width / 5
    } else {
        3 * width / 4
    };
    UVec2::new(width, height)
}
