//! Tracing ground truth.

use crate::backend::core::truth::{SIZE, Truth};
use crate::model::document::Document;
use limpid::camera::Camera;
use limpid::scene::Scene;
use limpid_io::error::Result;
use limpid_io::input::FrameTime;
use limpid_io::shared_classifier::Processor;
use limpid_lab::reference;
use limpid_lab::reference::analytic::{Ball, Block, Pool};
use limpid_lab::reference::mesh::{Mesh, Reconstruction};
use limpid_lab::reference::trace::{MAX_DEPTH, trace};
use limpid_sim::recipe::Recipe;

/// Rays per pixel of the ground truth.
const SAMPLES: u32 = 4;

/// The recipe's body, if it has a closed form.
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

/// Traces a view at a frame time: the exact body if there is one, otherwise a mesh of the particles.
///
/// # Errors
/// As [`limpid_io::input::Loader::particles`] and [`Mesh::reconstruct`].
pub(crate) fn of(
    document: &Document,
    scene: &Scene,
    camera: &Camera,
    at: FrameTime,
) -> Result<Truth> {
    let moved = document.input.moved(at, scene)?;
    let liquid = match analytic(document) {
        Some(liquid) => liquid,
        None => {
            let particles = document.input.particles(at)?;
            // Only the radius is needed, which takes no device.
            let on_cpu = document.input.clone().processed_by(Processor::Cpu);
            let radius = on_cpu.prepare(at, &particles, scene)?.splats.radius;
            let how = Reconstruction::among(&moved.solids(&scene.solids));
            Box::new(Mesh::reconstruct(&particles.positions, radius, &how)?)
        }
    };
    let picture = trace(&*liquid, &moved.scene(scene), camera, SIZE, SAMPLES, MAX_DEPTH).to_srgb();
    let (liquid, fluids) = (scene.liquid, scene.fluids.clone());
    Ok(Truth { camera: *camera, at, liquid, fluids, picture })
}
