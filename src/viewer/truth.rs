//! Ground truth for small pictures, and how far what was drawn is from it.

use glam::{UVec2, Vec3};
use image::RgbImage;

use super::controls;
use super::document::Document;
use crate::camera::Camera;
use crate::error::Result;
use crate::input::Moment;
use crate::project::Processor;
use crate::recipe::Recipe;
use crate::reference;
use crate::reference::analytic::{Ball, Block, Pool};
use crate::reference::mesh::{Mesh, Reconstruction};
use crate::reference::trace::{MAX_DEPTH, trace};
use crate::scene::{Liquid, Scene};
use crate::settings::Settings;

/// Size of the pictures that are compared.
pub(super) const SIZE: UVec2 = UVec2::new(160, 120);

/// Rays per pixel of the truth.
const SAMPLES: u32 = 4;

/// More particles are too many to make a mesh from while somebody waits.
const MOST: usize = 60_000;

/// A traced picture, and of what.
#[derive(Debug, Clone)]
pub(super) struct Truth {
    /// The view.
    pub(super) camera: Camera,
    /// The moment.
    pub(super) at: Moment,
    /// What the liquid does to light.
    liquid: Liquid,
    /// What each of several liquids does.
    fluids: Vec<Vec3>,
    /// The picture.
    pub(super) picture: RgbImage,
}

/// What was drawn with some settings.
#[derive(Debug, Clone)]
pub(super) struct Point {
    /// The settings.
    pub(super) settings: Settings,
    /// How they differ from the defaults, in a few words.
    pub(super) description: String,
    /// Time of all passes, ms.
    pub(super) ms: f64,
    /// Mean FLIP to the truth, 0 to 1.
    pub(super) flip: f64,
}

impl Truth {
    /// Whether it is that of a scene seen from a camera at a moment.
    pub(super) fn fits(&self, scene: &Scene, camera: &Camera, at: Option<Moment>) -> bool {
        let of = (&self.camera, Some(self.at), &self.liquid, &self.fluids);
        of == (camera, at, &scene.liquid, &scene.fluids)
    }
}

impl Point {
    /// What was measured of `settings`.
    pub(super) fn new(settings: &Settings, ms: f64, flip: f64) -> Self {
        let changed = controls::differences(&Settings::default(), settings);
        let words: Vec<String> = changed
            .iter()
            .take(6)
            .map(|(control, value)| format!("{}={value}", control.path()))
            .collect();
        let description = if words.is_empty() { "defaults".into() } else { words.join(" ") };
        Self { settings: settings.clone(), description, ms, flip }
    }
}

/// Why a scene has no cheap truth, if it has none.
pub(super) fn missing(
    document: &Document,
    scene: &Scene,
    particles: usize,
) -> Option<&'static str> {
    if scene.is_lit() {
        Some("Scenes in which light falls through the liquid have no cheap truth.")
    } else if scene.fluids.len() > 1 {
        Some("Scenes with several liquids have no cheap truth.")
    } else if analytic(document).is_none() && particles > MOST {
        Some("So many particles have no cheap truth.")
    } else {
        None
    }
}

/// The body that the recipe says, where it has a closed form.
fn analytic(document: &Document) -> Option<Box<dyn reference::Liquid>> {
    match *document.project.source.recipe()? {
        Recipe::Ball { center, radius, .. } => Some(Box::new(Ball { center, radius })),
        Recipe::Slab { min, max, .. } => Some(Box::new(Block { min, max })),
        Recipe::Pool(pool) => {
            let (min, max, bottom) = (-pool.half_extent, pool.half_extent, -pool.depth);
            Some(Box::new(Pool { waves: pool.surface(), min, max, bottom }))
        }
        _ => None,
    }
}

/// Traces a view of a moment: the exact body, or a mesh of the particles where there is none.
///
/// # Errors
/// As [`crate::input::Input::particles`] and [`Mesh::reconstruct`].
pub(super) fn of(document: &Document, scene: &Scene, camera: &Camera, at: Moment) -> Result<Truth> {
    let liquid = match analytic(document) {
        Some(liquid) => liquid,
        None => {
            let particles = document.input.particles(at)?;
            // The radius alone is wanted, which needs no device.
            let on_cpu = document.input.clone().processed_by(Processor::Cpu);
            let radius = on_cpu.prepare(at, &particles, scene)?.splats.radius;
            let how = Reconstruction::among(&scene.solids);
            Box::new(Mesh::reconstruct(&particles.positions, radius, &how)?)
        }
    };
    let picture = trace(&*liquid, scene, camera, SIZE, SAMPLES, MAX_DEPTH).to_srgb();
    let (liquid, fluids) = (scene.liquid, scene.fluids.clone());
    Ok(Truth { camera: *camera, at, liquid, fluids, picture })
}
