//! Ground truth for small pictures, and the error of drawn pictures against it.

use glam::{UVec2, Vec3};
use image::RgbImage;

use crate::model::document::Document;
use limpid::camera::Camera;
use limpid::scene::{Liquid, Scene};
use limpid::settings::Settings;
use limpid_io::error::Result;
use limpid_io::input::FrameTime;
use limpid_io::project::controls;
use limpid_io::shared_classifier::Processor;
use limpid_lab::reference;
use limpid_lab::reference::analytic::{Ball, Block, Pool};
use limpid_lab::reference::mesh::{Mesh, Reconstruction};
use limpid_lab::reference::trace::{MAX_DEPTH, trace};
use limpid_sim::recipe::Recipe;

/// Size of the compared pictures.
pub(crate) const SIZE: UVec2 = UVec2::new(160, 120);

/// Rays per pixel of the ground truth.
const SAMPLES: u32 = 4;

/// Most particles that can be meshed while the user waits.
const MAX_PARTICLES: usize = 60_000;

/// A traced picture and its inputs.
#[derive(Debug, Clone)]
pub(crate) struct Truth {
    /// The camera.
    pub(crate) camera: Camera,
    /// The frame time.
    pub(crate) at: FrameTime,
    /// Optical properties of the liquid.
    liquid: Liquid,
    /// Absorption of each of several fluids.
    fluids: Vec<Vec3>,
    /// The picture.
    pub(crate) picture: RgbImage,
}

/// A measurement of some settings.
#[derive(Debug, Clone)]
pub(crate) struct Point {
    /// The settings.
    pub(crate) settings: Settings,
    /// Some settings that differ from the defaults, as text.
    pub(crate) description: String,
    /// Time of all passes, ms.
    pub(crate) ms: f64,
    /// Mean FLIP to the truth, 0 to 1.
    pub(crate) flip: f64,
}

impl Truth {
    /// Whether it is the truth of a scene seen from a camera at a frame time.
    pub(crate) fn fits(&self, scene: &Scene, camera: &Camera, at: Option<FrameTime>) -> bool {
        let inputs = (&self.camera, Some(self.at), &self.liquid, &self.fluids);
        inputs == (camera, at, &scene.liquid, &scene.fluids)
    }
}

impl Point {
    /// Creates the measurement of `settings`.
    pub(crate) fn new(settings: &Settings, ms: f64, flip: f64) -> Self {
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

/// Why ground truth would take too long for a scene; `None` if it would not.
pub(crate) fn missing(
    document: &Document,
    scene: &Scene,
    particles: usize,
) -> Option<&'static str> {
    if scene.is_lit() {
        Some("Ground truth is not available here for lit scenes.")
    } else if scene.fluids.len() > 1 {
        Some("Ground truth is not available here for several liquids.")
    } else if analytic(document).is_none() && particles > MAX_PARTICLES {
        Some("Ground truth is not available here for so many particles.")
    } else {
        None
    }
}

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
/// As [`limpid_io::input::Input::particles`] and [`Mesh::reconstruct`].
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
