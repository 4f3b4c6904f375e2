//! Ground truth for small pictures, and how far what was drawn is from it.

use glam::UVec2;
use image::RgbImage;

use super::document::Document;
use crate::camera::Camera;
use crate::error::Result;
use crate::input::Moment;
use crate::recipe::Recipe;
use crate::reference::Liquid;
use crate::reference::analytic::{Ball, Block, Pool};
use crate::reference::mesh::{Mesh, Reconstruction};
use crate::reference::trace::{MAX_DEPTH, trace};
use crate::scene::Scene;
use crate::settings::Settings;

/// Size of the pictures that are compared.
pub const SIZE: UVec2 = UVec2::new(160, 120);

/// Rays per pixel of the truth.
const SAMPLES: u32 = 4;

/// More particles are too many to make a mesh from while somebody waits.
const MOST: usize = 60_000;

/// A traced picture, and of what.
#[derive(Debug, Clone)]
pub struct Truth {
    /// The view.
    pub camera: Camera,
    /// The moment.
    pub at: Moment,
    /// The picture.
    pub picture: RgbImage,
}

/// What was drawn with some settings.
#[derive(Debug, Clone)]
pub struct Point {
    /// The settings.
    pub settings: Settings,
    /// Time of all passes, ms.
    pub ms: f64,
    /// Mean FLIP to the truth, 0 to 1.
    pub flip: f64,
}

/// Why a scene has no cheap truth, if it has none.
pub fn missing(scene: &Scene, particles: usize) -> Option<&'static str> {
    if scene.is_lit() {
        Some("Scenes in which light falls through the liquid have no cheap truth.")
    } else if scene.fluids.len() > 1 {
        Some("Scenes with several liquids have no cheap truth.")
    } else if analytic(scene).is_none() && particles > MOST {
        Some("So many particles have no cheap truth.")
    } else {
        None
    }
}

/// The body that the recipe says, where it has a closed form.
fn analytic(scene: &Scene) -> Option<Box<dyn Liquid>> {
    match scene.recipe? {
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
pub fn of(document: &Document, scene: &Scene, camera: &Camera, at: Moment) -> Result<Truth> {
    let liquid = match analytic(scene) {
        Some(liquid) => liquid,
        None => {
            let particles = document.input.particles(at)?;
            let radius = document.input.prepare(at, &particles, scene)?.splats.radius;
            let how = Reconstruction::on_floor(scene);
            Box::new(Mesh::reconstruct(&particles.positions, radius, &how)?)
        }
    };
    let picture = trace(&*liquid, scene, camera, SIZE, SAMPLES, MAX_DEPTH).to_srgb();
    Ok(Truth { camera: *camera, at, picture })
}
