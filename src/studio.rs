//! A renderer with a picture of its own: what `limpid render` and the viewer both draw with.

use glam::UVec2;
use image::RgbImage;

use crate::aov::{self, Aov};
use crate::camera::Camera;
use crate::error::Result;
use crate::gpu::{Gpu, PassTime};
use crate::passes::classify::Splats;
use crate::renderer::{Picture, Reading, Renderer};
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
        self.begin(scene, camera, splats, size)?.wait()
    }

    /// Tells the device to draw one frame of `size` pixels. While it does so the next one's particles can
    /// be uploaded: by beginning that one. Waits only where [`Renderer::timing`] is set.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn begin(
        &mut self,
        scene: &Scene,
        camera: &Camera,
        splats: &Splats,
        size: UVec2,
    ) -> Result<Drawing> {
        let same = self.picture.take().filter(|(old, _)| *old == size);
        let (_, picture) = match same {
            Some(same) => self.picture.insert(same),
            None => self.picture.insert((size, Picture::new(&self.gpu, size)?)),
        };
        let view = picture.view();
        let passes = self.renderer.render(scene, camera, splats, &view, Picture::FORMAT, size)?;
        let picture = picture.begin_reading(&self.gpu);
        Ok(Drawing { gpu: self.gpu.clone(), picture, passes })
    }

    /// Intermediate images of the last frame; some need [`Renderer::diagnose`] to have been set.
    ///
    /// # Errors
    /// As [`aov::read`].
    pub fn images(&self, chosen: &[Aov]) -> Result<Vec<aov::Part>> {
        aov::read(&self.gpu, &self.renderer.images(), chosen)
    }

    /// The last frame as a linear picture: radiance before exposure and tone mapping, W/(m² sr), for
    /// [`aov::write`].
    ///
    /// # Errors
    /// As [`aov::read`].
    pub fn radiance(&self) -> Result<aov::Part> {
        aov::read_radiance(&self.gpu, &self.renderer.images())
    }
}

/// One picture that the device has been told to draw.
#[derive(Debug)]
pub struct Drawing {
    gpu: Gpu,
    picture: Reading,
    passes: Vec<PassTime>,
}

impl Drawing {
    /// Waits for the picture, not for those that were begun after it.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    pub fn wait(self) -> Result<Shot> {
        let picture = image::DynamicImage::ImageRgba8(self.picture.wait(&self.gpu)?).into_rgb8();
        Ok(Shot { picture, passes: self.passes })
    }
}
