//! The inputs of a frame, and its target.

use std::sync::Arc;

use glam::UVec2;

use crate::camera::View;
use crate::diffuse::Diffuse;
use crate::host::Host;
use crate::liquid::Colors;
use crate::liquid::classify::Splats;
use crate::motion::Motion;
use crate::scene::Scene;

pub use crate::passes::tonemap::{Picture, Target};

/// The inputs of a frame, and the choice of images beside its picture.
///
/// [`FrameInput::new`] has what every frame needs:
///
/// ```
/// # use limpid::{camera::Camera, frame::FrameInput, liquid::classify::Splats, scene::Scene};
/// # use limpid::glam::{DVec3, UVec2};
/// # let (scene, splats) = (Scene::default(), Splats::default());
/// # let (camera, size) = (Camera::fit(DVec3::ZERO, DVec3::ONE), UVec2::new(640, 480));
/// let input = FrameInput { diagnose: true, ..FrameInput::new(&scene, &camera, &splats, size) };
/// ```
#[derive(Debug, Clone, Copy)]
pub struct FrameInput<'a> {
    /// All but the liquid.
    pub scene: &'a Scene,
    /// The view of the picture.
    pub view: View,
    /// The liquid.
    pub splats: &'a Splats,
    /// The colours of an opaque body's particles: those of the [splats](Splats::colors), or the same ones
    /// [by another map](Colors::over).
    pub colors: Option<&'a Colors>,
    /// Foam, spray, bubbles and dust.
    pub diffuse: Option<&'a Arc<Diffuse>>,
    /// Pixels of the picture.
    pub size: UVec2,
    /// The picture of the program that uses limpid: liquid appears in it, and rays see it. Rays find
    /// the scene's solids where the host's picture does not show its own; the solids are not drawn.
    pub host: Option<&'a Host>,
    /// Draw the images of the first interface, [`Images::surface`], with motion vectors since the frame before.
    ///
    /// [`Images::surface`]: crate::renderer::Images::surface
    pub surface: Option<&'a Motion>,
    /// Draw the per-pixel counts and the G-buffer for [`Renderer::images`].
    ///
    /// [`Renderer::images`]: crate::renderer::Renderer::images
    pub diagnose: bool,
    /// Measure each pass with timestamp queries, where the device supports them.
    pub timing: bool,
    /// Skip the passes whose inputs are those of the last frame that was drawn so.
    pub reuse: bool,
}

impl<'a> FrameInput<'a> {
    /// A picture alone.
    pub fn new(scene: &'a Scene, view: impl Into<View>, splats: &'a Splats, size: UVec2) -> Self {
        Self {
            scene,
            view: view.into(),
            splats,
            colors: splats.colors.as_ref(),
            diffuse: None,
            size,
            host: None,
            surface: None,
            diagnose: false,
            timing: false,
            reuse: false,
        }
    }
}
