//! A renderer with a picture of its own: what `limpid render` and the viewer both draw with.

use glam::UVec2;
use image::RgbImage;

use crate::aov::{self, Aov};
use crate::camera::Camera;
use crate::error::Result;
use crate::gpu::{Gpu, PassTime};
use crate::passes::classify::Splats;
use crate::renderer::{Picture, Renderer};
use crate::scene::Scene;

/// Draws pictures into memory.
#[derive(Debug)]
pub struct Studio {
    gpu: Gpu,
    /// What draws; its `timing` and `diagnose` are the caller's to set.
    pub renderer: Renderer,
    picture: Option<(UVec2, Picture)>,
}

/// One picture, and what it took.
#[derive(Debug, Clone)]
pub struct Shot {
    /// The picture, sRGB.
    pub picture: RgbImage,
    /// The time of each pass, if [`Renderer::timing`] is set.
    pub passes: Vec<PassTime>,
}

impl Studio {
    /// Compiles the passes.
    pub fn new(gpu: &Gpu) -> Self {
        Self { gpu: gpu.clone(), renderer: Renderer::new(gpu), picture: None }
    }

    /// The device that it draws with.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Draws one frame of `size` pixels and waits for it.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn draw(
        &mut self,
        scene: &Scene,
        camera: &Camera,
        splats: &Splats,
        size: UVec2,
    ) -> Result<Shot> {
        let same = self.picture.take().filter(|(old, _)| *old == size);
        let (_, picture) = match same {
            Some(same) => self.picture.insert(same),
            None => self.picture.insert((size, Picture::new(&self.gpu, size)?)),
        };
        let view = picture.view();
        let passes = self.renderer.render(scene, camera, splats, &view, Picture::FORMAT, size)?;
        let picture = image::DynamicImage::ImageRgba8(picture.read(&self.gpu)?).into_rgb8();
        Ok(Shot { picture, passes })
    }

    /// Intermediate images of the last frame; some need [`Renderer::diagnose`] to have been set.
    ///
    /// # Errors
    /// As [`aov::read`].
    pub fn images(&self, chosen: &[Aov]) -> Result<Vec<aov::Part>> {
        aov::read(&self.gpu, &self.renderer.images(), chosen)
    }
}
