//! A renderer with a picture of its own: what `limpid render` and the viewer both draw with.

use glam::UVec2;
use image::RgbImage;

use crate::aov::{self, Aov};
use crate::camera::Camera;
use crate::error::Result;
use crate::gpu::{self, Gpu, PassTime};
use crate::liquid::classify::Splats;
use crate::renderer::Renderer;
use crate::scene::Scene;

/// Draws pictures into memory.
#[derive(Debug)]
pub struct Offscreen {
    gpu: Gpu,
    /// What draws; its `timing` and `diagnose` are the caller's to set.
    pub renderer: Renderer,
    picture: Option<(UVec2, Picture)>,
}

/// One picture, and what it took.
#[derive(Debug, Clone)]
pub struct RenderedFrame {
    /// The picture, sRGB.
    pub picture: RgbImage,
    /// The time of each pass, if [`Renderer::timing`] is set.
    pub passes: Vec<PassTime>,
}

impl Offscreen {
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
    ) -> Result<RenderedFrame> {
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
    ) -> Result<PendingFrame> {
        let same = self.picture.take().filter(|(old, _)| *old == size);
        let (_, picture) = match same {
            Some(same) => self.picture.insert(same),
            None => self.picture.insert((size, Picture::new(&self.gpu, size)?)),
        };
        let view = picture.view();
        let passes = self.renderer.render(scene, camera, splats, &view, Picture::FORMAT, size)?;
        let picture = picture.begin_reading(&self.gpu);
        Ok(PendingFrame { gpu: self.gpu.clone(), picture, passes })
    }

    /// Intermediate images of the last frame; some need [`Renderer::diagnose`] to have been set.
    ///
    /// # Errors
    /// As [`aov::read`].
    pub fn images(&self, chosen: &[Aov]) -> Result<Vec<aov::Part>> {
        aov::read(&self.gpu, &self.renderer.images(), chosen)
    }

    /// The last frame as a linear picture: radiance before exposure and tone mapping, W/(m² sr), for
    /// `limpid-io`'s `exr::write`.
    ///
    /// # Errors
    /// As [`aov::read`].
    pub fn radiance(&self) -> Result<aov::Part> {
        aov::read_radiance(&self.gpu, &self.renderer.images())
    }
}

/// One picture that the device has been told to draw.
#[derive(Debug)]
pub struct PendingFrame {
    gpu: Gpu,
    picture: PendingPicture,
    passes: Vec<PassTime>,
}

impl PendingFrame {
    /// Waits for the picture, not for those that were begun after it.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    pub fn wait(self) -> Result<RenderedFrame> {
        let picture = image::DynamicImage::ImageRgba8(self.picture.wait(&self.gpu)?).into_rgb8();
        Ok(RenderedFrame { picture, passes: self.passes })
    }
}

/// A picture of its own for [`Renderer::render`], and its way to memory.
#[derive(Debug)]
pub struct Picture {
    texture: wgpu::Texture,
}

impl Picture {
    /// 8 bits per channel, sRGB values as they are stored in a PNG.
    pub const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

    /// A picture of `size` pixels.
    ///
    /// # Errors
    /// As [`Gpu::check_size`].
    pub fn new(gpu: &Gpu, size: UVec2) -> Result<Self> {
        gpu.check_size(size)?;
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC;
        Ok(Self { texture: gpu::texture(gpu, "frame", size, 1, Self::FORMAT, usage) })
    }

    /// The view to render into.
    pub fn view(&self) -> wgpu::TextureView {
        self.texture.create_view(&Default::default())
    }

    /// Waits for the device and returns the picture.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    pub fn read(&self, gpu: &Gpu) -> Result<image::RgbaImage> {
        self.begin_reading(gpu).wait(gpu)
    }

    /// Tells the device to copy the picture as it is now; the next may be rendered at once.
    pub fn begin_reading(&self, gpu: &Gpu) -> PendingPicture {
        let size = UVec2::new(self.texture.width(), self.texture.height());
        PendingPicture { size, texels: gpu::begin_reading(gpu, &self.texture, 0) }
    }
}

/// A picture on its way to memory.
#[derive(Debug)]
pub struct PendingPicture {
    size: UVec2,
    texels: gpu::Reading,
}

impl PendingPicture {
    /// Waits for the picture, not for what the device was told after it.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    pub fn wait(self, gpu: &Gpu) -> Result<image::RgbaImage> {
        let bytes = self.texels.wait(gpu)?;
        let picture = image::RgbaImage::from_raw(self.size.x, self.size.y, bytes);
        Ok(picture.expect("the texture has four bytes per pixel"))
    }
}
