//! Projects: a scene with the source of its particles, its cameras, and the processor that classifies.

mod bodies;
mod commented;
pub mod controls;
pub mod differences;
mod diffuse;
mod file;
mod lengths;
mod mesh_sequence;
mod mesh_source;
mod motion;
pub mod overrides;
mod recent;
mod sections;
mod solids;

pub use diffuse::DiffuseSource;
pub use file::FILE_KIND;
pub(crate) use file::is_scale;
pub use motion::{Moved, SolidMotion};
pub use solids::{Given, SolidFiles};

use std::path::{Path, PathBuf};
use std::slice;

use self::bodies::Bodies;
use serde::{Deserialize, Serialize};

use crate::camera_axes::CameraAxes;
use crate::color_by::ColorBy;
use crate::error::{Error, Result};
use crate::media::MediumName;
use crate::particles::{AttributeMap, Selection};
use crate::shared_classifier::Processor;
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::glam::Vec3;
use limpid::liquid::Up;
use limpid::look::{Body, Look};
use limpid::scene::{Kind, Light, Liquid, Scene, Shape};
use limpid_sim::recipe::Recipe;
use limpid_sim::sim::Simulation;

/// The contents of a scene file: a scene, the source of its particles, and its views.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Project {
    /// The scene.
    pub scene: Scene,
    /// The files of its meshes and textures.
    pub solid_files: SolidFiles,
    /// How its solids move.
    pub motion: SolidMotion,
    /// The source of the particles.
    pub source: LiquidSource,
    /// Foam, spray, bubbles and dust; `None` looks for their files beside those of the liquid.
    pub diffuse: Option<Vec<DiffuseSource>>,
    /// The camera; `None` fits one to the particles.
    pub camera: Option<Camera>,
    /// The axes in which the camera counts until [`crate::input::Input::resolve`] turns it into the world.
    pub camera_axes: CameraAxes,
    /// Further named views, which a report measures too.
    pub views: Vec<NamedView>,
    /// The processor that classifies the particles.
    pub processor: Processor,
    /// The attribute that colours an opaque body, if its particles do not share one colour.
    pub color_by: Option<ColorBy>,
    /// Length of clear liquid behind which the colours of its particles are seen, m; `None` if it is the body's
    /// [thickness](Body::thickness).
    pub tint_thickness: Option<f64>,
    /// Colours of the opaque fluids among several, linear RGB from 0 to 1: of each fluid, if it is opaque. Empty if none is.
    pub opaque_fluids: Vec<Option<Vec3>>,
    /// The parts of the scene that a look provides once the particles are known; `None` if the scene is
    /// complete.
    pub automatic: Option<Automatic>,
}

/// The parts of a scene that come from a [`Look`], because its file does not have them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Automatic {
    /// The look.
    pub look: Look,
    /// Whether it provides the environment.
    pub environment: bool,
    /// The look whose sky that is, if it is another one.
    pub sky: Option<Look>,
    /// Whether it provides the ground.
    pub ground: bool,
    /// Height of that ground, m; below liquid and solids if absent.
    pub height: Option<f64>,
    /// Whether it provides the light.
    pub light: bool,
    /// Whether it provides the absorption.
    pub absorption: bool,
    /// The medium that it scales to the body.
    pub medium: Option<MediumName>,
    /// Whether it provides the settings of the caustics.
    pub caustics: bool,
    /// Whether it provides the tone mapping.
    pub tonemap: bool,
    /// Whether it filters patterns.
    pub patterns: bool,
}

impl Automatic {
    /// Everything from a look.
    pub fn all(look: Look) -> Self {
        Self {
            look,
            environment: true,
            sky: None,
            ground: true,
            height: None,
            light: true,
            absorption: true,
            medium: None,
            caustics: true,
            tonemap: true,
            patterns: true,
        }
    }

    /// Fills in the parts of a project's scene that shows this body.
    fn complete(&self, project: &mut Project, body: &Body) {
        let look = self.look.scene(body);
        if self.ground {
            let at = project.own_solids();
            for mut ground in look.solids {
                if let (Shape::Plane { origin, .. }, Some(height)) =
                    (&mut ground.shape, self.height)
                {
                    origin.y = height;
                }
                project.scene.solids.insert(at, ground);
                project.motion.insert(at);
            }
        }
        let scene = &mut project.scene;
        if self.light {
            scene.lights = look.lights;
        }
        if self.environment {
            scene.environment = look.environment;
        }
        if let Some(sky) = self.sky.filter(|_| self.environment) {
            set_sky(scene, sky, body);
        }
        if look.liquid.kind == Kind::Opaque && self.absorption {
            scene.liquid = look.liquid;
        } else if self.absorption {
            scene.liquid.absorption = look.liquid.absorption;
        }
        if let Some(medium) = self.medium {
            let scaled = medium.liquid(body.thickness() as f32);
            scene.liquid = Liquid { ior: scene.liquid.ior, ..scaled };
        }
        if self.caustics {
            scene.settings.caustics = look.settings.caustics;
        }
        if self.tonemap {
            scene.settings.tonemap = look.settings.tonemap;
        }
        if self.patterns {
            scene.settings.refract.filter_patterns = look.settings.refract.filter_patterns;
        }
    }
}

/// Gives a scene the sky of a look. Its sun stays where it is.
pub(crate) fn set_sky(scene: &mut Scene, look: Look, body: &Body) {
    scene.environment = look.scene(body).environment;
    let sun = scene.lights.iter().find_map(|light| match light {
        Light::Sun { direction, .. } => Some(-*direction),
        _ => None,
    });
    if let Some(towards) = sun {
        scene.environment.turn_sun(towards);
    }
}

/// The source of a scene's particles.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum LiquidSource {
    /// Particles given by the caller.
    #[default]
    Unspecified,
    /// A file or a sequence.
    File(ParticleSource),
    /// Several fluids, one for each of [`Scene::fluids`].
    Fluids(Vec<ParticleSource>),
    /// A recipe, which generates them from parameters.
    Recipe(Recipe),
    /// A simulation, whose baked frames are read: [`crate::bake::Bake`].
    Simulation(Simulation),
}

impl LiquidSource {
    /// The files or sequences: one, one for each fluid, or none.
    pub fn files(&self) -> &[ParticleSource] {
        match self {
            Self::File(file) => slice::from_ref(file),
            Self::Fluids(files) => files,
            _ => &[],
        }
    }

    /// As [`LiquidSource::files`], mutable.
    pub fn files_mut(&mut self) -> &mut [ParticleSource] {
        match self {
            Self::File(file) => slice::from_mut(file),
            Self::Fluids(files) => files,
            _ => &mut [],
        }
    }

    /// The recipe, if there is one.
    pub fn recipe(&self) -> Option<&Recipe> {
        if let Self::Recipe(recipe) = self { Some(recipe) } else { None }
    }

    /// The simulation, if there is one.
    pub fn simulation(&self) -> Option<&Simulation> {
        if let Self::Simulation(simulation) = self { Some(simulation) } else { None }
    }

    /// As [`LiquidSource::simulation`], mutable.
    pub fn simulation_mut(&mut self) -> Option<&mut Simulation> {
        if let Self::Simulation(simulation) = self { Some(simulation) } else { None }
    }
}

/// A particle file or sequence of a scene.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParticleSource {
    /// A file, a pattern or a folder, relative to the scene file; empty if the particles are given
    /// separately.
    #[serde(default, skip_serializing_if = "is_empty")]
    pub source: PathBuf,
    /// The frame drawn by default.
    #[serde(default)]
    pub frame: Option<i64>,
    /// Particle radius if the file has none, m; if absent too, estimated from the spacing.
    #[serde(default)]
    pub radius: Option<f32>,
    /// The axis of the file that points up; if absent, as its format tells, or y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub up: Option<Up>,
    /// Frames per second of the simulation, above 0, for slow motion and films; if absent, those of
    /// the film.
    #[serde(default)]
    pub fps: Option<f64>,
    /// Length of the file's unit, m: 0.001 for millimetres; 1 if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// The arrays of attributes with other than the usual names.
    #[serde(default, skip_serializing_if = "AttributeMap::is_empty")]
    pub map: AttributeMap,
    /// Which of its particles are read.
    #[serde(default, skip_serializing_if = "Selection::is_automatic")]
    pub select: Selection,
}

fn is_empty(path: &Path) -> bool {
    path.as_os_str().is_empty()
}

/// A further view of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedView {
    /// Its name.
    pub name: String,
    /// Its camera.
    pub camera: Camera,
    /// As [`Project::camera_axes`].
    #[serde(skip)]
    pub axes: CameraAxes,
}

impl From<Scene> for Project {
    fn from(scene: Scene) -> Self {
        Self { scene, ..Self::default() }
    }
}

impl Project {
    /// Checks all values against their ranges.
    ///
    /// # Errors
    /// [`limpid::Error::Invalid`] naming the first value out of range.
    pub fn check(&self) -> Result<()> {
        match &self.source {
            LiquidSource::Recipe(recipe) => recipe.check()?,
            LiquidSource::Simulation(simulation) => simulation.check()?,
            _ => {}
        }
        let camera = self.camera.iter().map(|camera| (self.camera_axes, camera));
        let views = self.views.iter().map(|view| (view.axes, &view.camera));
        camera.chain(views).try_for_each(|(axes, camera)| axes.check(camera))?;
        Ok(self.scene.check()?)
    }

    /// Turns the cameras into the world, of files where this axis points up.
    pub(crate) fn turn_cameras(&mut self, files: Up) {
        let world = CameraAxes::default();
        let axes = std::mem::replace(&mut self.camera_axes, world);
        self.camera = self.camera.map(|camera| axes.to_world(camera, files));
        for view in &mut self.views {
            let axes = std::mem::replace(&mut view.axes, world);
            view.camera = axes.to_world(view.camera, files);
        }
    }

    /// Fills in the parts that a look provides for this body.
    pub(crate) fn complete(&mut self, body: &Body) {
        if let Some(automatic) = self.automatic.take() {
            automatic.complete(self, body);
        }
    }

    /// Whether something in it has a place or a direction, in a world of y up.
    pub fn has_directions(&self) -> bool {
        let automatic = |part: fn(&Automatic) -> bool| self.automatic.as_ref().is_some_and(part);
        let sky = &self.scene.environment;
        let is_alike = matches!(sky, Environment::Constant(_)) || automatic(|own| own.environment);
        let is_placed = automatic(|own| own.height.is_some());
        let Scene { solids, lights, .. } = &self.scene;
        !(is_alike && solids.is_empty() && lights.is_empty())
            || is_placed
            || self.camera.is_some()
            || !self.views.is_empty()
            || !matches!(self.source, LiquidSource::Unspecified)
    }

    /// Whether its liquid is opaque once its look has completed it.
    pub fn is_opaque(&self) -> bool {
        let paints = |own: Automatic| own.look == Look::Paint && own.absorption;
        self.scene.is_opaque() || self.automatic.is_some_and(paints)
    }

    /// Number of the solids of its own. Those of the recipe and of the rigid bodies follow, which reading its file adds
    /// again.
    fn own_solids(&self) -> usize {
        let of_recipe = self.source.recipe().map_or(0, |recipe| recipe.solids().len());
        let of_bodies = self.motion.bodies().map_or(0, Bodies::len);
        self.scene.solids.len().saturating_sub(of_recipe + of_bodies)
    }

    /// The camera, or one fitted to `bounds`.
    pub fn camera_for(&self, bounds: (glam::DVec3, glam::DVec3)) -> Camera {
        self.camera.unwrap_or_else(|| Camera::fit(bounds.0, bounds.1))
    }

    /// The simulation.
    ///
    /// # Errors
    /// [`Error::Scene`] naming `origin` if there is none.
    pub fn simulation_mut(&mut self, origin: &str) -> Result<&mut Simulation> {
        self.source.simulation_mut().ok_or_else(|| Error::Scene {
            origin: origin.into(),
            problem: "has no [simulation] to bake".into(),
        })
    }
}
