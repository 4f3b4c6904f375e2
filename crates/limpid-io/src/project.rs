//! A scene and what it is made from: particles, their view, and how the work is done.

mod file;
pub mod overrides;

pub use file::FILE_KIND;

use std::slice;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::particles::AttributeMap;
use crate::shared_classifier::Processor;
use limpid::camera::Camera;
use limpid::liquid::Up;
use limpid::scene::Scene;
use limpid_sim::recipe::Recipe;
use limpid_sim::sim::Simulation;

/// A scene file: what the picture shows, and what it is made from.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Project {
    /// What the picture shows.
    pub scene: Scene,
    /// Where the particles come from.
    pub source: LiquidSource,
    /// The view; `None` fits one to the particles.
    pub camera: Option<Camera>,
    /// Further views of interest, by name; a report measures them too.
    pub views: Vec<NamedView>,
    /// What classifies the particles.
    pub processor: Processor,
}

/// Where the particles of a scene come from.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum LiquidSource {
    /// The caller has them.
    #[default]
    Unspecified,
    /// From a file or a sequence.
    File(ParticleSource),
    /// Of several fluids, one for each of [`Scene::fluids`].
    Fluids(Vec<ParticleSource>),
    /// Made from parameters.
    Recipe(Recipe),
    /// Simulated, and read from the frames that were baked: [`crate::bake::bake`].
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

    /// As [`LiquidSource::files`], to change them.
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

    /// As [`LiquidSource::simulation`], to change it.
    pub fn simulation_mut(&mut self) -> Option<&mut Simulation> {
        if let Self::Simulation(simulation) = self { Some(simulation) } else { None }
    }
}

/// A particle file or sequence, as a scene names it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParticleSource {
    /// A file, a pattern or a folder, relative to the scene file.
    pub source: String,
    /// The frame to draw when no other is asked for.
    #[serde(default)]
    pub frame: Option<i64>,
    /// Particle radius, m, where the file has none; estimated from the spacing if absent.
    #[serde(default)]
    pub radius: Option<f32>,
    /// Which axis of the file points up.
    #[serde(default)]
    pub up: Up,
    /// Frames per second of the simulation, above 0, for slow motion and films; if absent, that of
    /// the film.
    #[serde(default)]
    pub fps: Option<f64>,
    /// Which arrays attributes are read from, where they go by other names than the usual ones.
    #[serde(default, skip_serializing_if = "AttributeMap::is_empty")]
    pub map: AttributeMap,
}

/// A further view of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedView {
    /// Its name.
    pub name: String,
    /// Its camera.
    pub camera: Camera,
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
    /// [`limpid::Error::Invalid`] naming the first value that is out of its range.
    pub fn check(&self) -> Result<()> {
        match &self.source {
            LiquidSource::Recipe(recipe) => recipe.check()?,
            LiquidSource::Simulation(simulation) => simulation.check()?,
            _ => {}
        }
        let views = self.views.iter().map(|view| &view.camera);
        self.camera.iter().chain(views).try_for_each(Camera::check)?;
        Ok(self.scene.check()?)
    }

    /// The camera, or one that fits `bounds`.
    pub fn camera_for(&self, bounds: (glam::DVec3, glam::DVec3)) -> Camera {
        self.camera.unwrap_or_else(|| Camera::fit(bounds.0, bounds.1))
    }

    /// The simulation.
    ///
    /// # Errors
    /// [`Error::Scene`] of `origin` if there is none.
    pub fn simulation_mut(&mut self, origin: &str) -> Result<&mut Simulation> {
        self.source.simulation_mut().ok_or_else(|| Error::Scene {
            origin: origin.into(),
            problem: "has no [simulation] to bake".into(),
        })
    }
}
