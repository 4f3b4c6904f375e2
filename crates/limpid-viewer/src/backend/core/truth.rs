//! Ground truth for small pictures, and the error of drawn pictures against it.

use glam::UVec2;
use image::RgbImage;

use crate::model::document::Document;
use limpid::camera::Camera;
use limpid::scene::{Liquid, Medium, Scene};
use limpid::settings::Settings;
use limpid_io::input::FrameTime;
use limpid_io::project::controls;
use limpid_sim::recipe::Recipe;

/// Size of the compared pictures.
pub(crate) const SIZE: UVec2 = UVec2::new(160, 120);

/// Most particles that can be meshed while the user waits.
const MAX_PARTICLES: usize = 60_000;

/// A traced picture and its inputs.
#[derive(Debug, Clone)]
pub struct Truth {
    /// The camera.
    pub(crate) camera: Camera,
    /// The frame time.
    pub(crate) at: FrameTime,
    /// Optical properties of the liquid.
    pub(crate) liquid: Liquid,
    /// The medium of each of several fluids.
    pub(crate) fluids: Vec<Medium>,
    /// The picture.
    pub(crate) picture: RgbImage,
}

/// A measurement of some settings.
#[derive(Debug, Clone)]
pub struct Point {
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
    pub fn new(settings: &Settings, ms: f64, flip: f64) -> Self {
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
    } else if scene.is_turbid() {
        Some("Ground truth is not available here for turbid liquids.")
    } else if scene.fluids.len() > 1 {
        Some("Ground truth is not available here for several liquids.")
    } else if !has_closed_form(document) && particles > MAX_PARTICLES {
        Some("Ground truth is not available here for so many particles.")
    } else {
        None
    }
}

/// Whether the recipe's body has a closed form.
fn has_closed_form(document: &Document) -> bool {
    let recipe = document.project.source.recipe();
    recipe.is_some_and(|r| matches!(r, Recipe::Ball { .. } | Recipe::Slab { .. } | Recipe::Pool(_)))
}
