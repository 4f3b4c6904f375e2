//! Offscreen renderer, which draws pictures into memory.

use std::borrow::Cow;
#[cfg(not(target_arch = "wasm32"))]
use std::collections::VecDeque;

use glam::{UVec2, Vec3};
use image::{DynamicImage, GrayImage, RgbImage, Rgba, RgbaImage};

use crate::aov::{self, Aov};
#[cfg(not(target_arch = "wasm32"))]
use crate::camera::View;
use crate::error::Result;
use crate::frame::FrameInput;
use crate::gpu::{self, Gpu, PassTime, SubmittedTimes};
use crate::mesh::linear_from_srgb;
pub use crate::passes::tonemap::Picture;
use crate::passes::tonemap::srgb_byte;
use crate::renderer::Renderer;
use crate::scene::Scene;

/// A renderer that draws pictures into memory.
#[derive(Debug)]
pub struct Offscreen {
    gpu: Gpu,
    /// The renderer.
    pub renderer: Renderer,
    picture: Option<Picture>,
    /// Of the last frame: [`Offscreen::drawn_for_one`].
    side: u32,
}

/// A picture and its pass times.
#[derive(Debug, Clone)]
pub struct RenderedFrame {
    /// The picture, sRGB; its colours are those of the covered part of each pixel.
    pub picture: RgbImage,
    /// Share of each pixel that is covered, if it varies: [`crate::settings::Refract::transparent`].
    pub coverage: Option<GrayImage>,
    /// Time of each pass, if [`FrameInput::timing`] is set.
    pub passes: Vec<PassTime>,
}

impl RenderedFrame {
    fn of(picture: RgbaImage, transparent: bool, passes: Vec<PassTime>) -> Self {
        let (width, height) = picture.dimensions();
        let alpha = || picture.pixels().map(|pixel| pixel.0[3]).collect();
        let coverage = transparent.then(|| GrayImage::from_raw(width, height, alpha())).flatten();
        Self { picture: DynamicImage::ImageRgba8(picture).into_rgb8(), coverage, passes }
    }

    /// The picture, with an alpha channel if its coverage varies.
    pub fn into_image(self) -> DynamicImage {
        let Some(coverage) = self.coverage else { return DynamicImage::ImageRgb8(self.picture) };
        let pixels = self.picture.pixels().zip(coverage.pixels());
        let bytes = pixels.flat_map(|(color, alpha)| [color[0], color[1], color[2], alpha[0]]);
        let picture = RgbaImage::from_raw(coverage.width(), coverage.height(), bytes.collect());
        DynamicImage::ImageRgba8(picture.expect("both have the same size"))
    }
}

impl Offscreen {
    /// Creates the renderer and compiles its passes.
    pub fn new(gpu: &Gpu) -> Self {
        Self { gpu: gpu.clone(), renderer: Renderer::new(gpu), picture: None, side: 1 }
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Draws one frame of `size` pixels and waits for it.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn draw(&mut self, input: FrameInput<'_>) -> Result<RenderedFrame> {
        self.begin(input)?.wait()
    }

    /// Submits one frame of `size` pixels without waiting for it, so that the caller can begin the next
    /// frame (and upload its particles) meanwhile. Waits only if [`FrameInput::timing`] is set.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn begin(&mut self, input: FrameInput<'_>) -> Result<PendingFrame> {
        let mut frame = self.submit(input, false)?;
        pollster::block_on(frame.finish_times())?;
        Ok(frame)
    }

    /// Draws one frame from several views instead of its own: with four channels, as [`PendingFrame::wait_rgba`]. Its
    /// splats are uploaded once, and its lights' maps are drawn once. Each picture is read back while later ones are drawn.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn draw_views(&mut self, input: FrameInput<'_>, views: &[View]) -> Result<Vec<RgbaImage>> {
        /// Pictures that are drawn or read back at a time.
        const IN_FLIGHT: usize = 3;
        let mut pending = VecDeque::with_capacity(IN_FLIGHT);
        let mut pictures = Vec::with_capacity(views.len());
        for (i, &view) in views.iter().enumerate() {
            if pending.len() == IN_FLIGHT {
                pictures.extend(pending.pop_front().map(PendingFrame::wait_rgba).transpose()?);
            }
            let mut frame = self.submit(FrameInput { view, reuse: true, ..input }, i > 0)?;
            pollster::block_on(frame.finish_times())?;
            pending.push_back(frame);
        }
        for last in pending {
            pictures.push(last.wait_rgba()?);
        }
        Ok(pictures)
    }

    /// As [`Offscreen::draw`], for code that browsers and other programs share: waiting yields in a browser and
    /// blocks elsewhere.
    ///
    /// # Errors
    /// As `Renderer::render`.
    pub async fn finish(&mut self, input: FrameInput<'_>) -> Result<RenderedFrame> {
        let mut frame = self.submit(input, false)?;
        frame.finish_times().await?;
        let picture = reduced(frame.picture.finish(&frame.gpu).await?, frame.side);
        Ok(RenderedFrame::of(picture, frame.transparent, frame.passes))
    }

    /// Side of the square of pixels that are drawn for each pixel of a picture. Layers hold one surface a pixel, whose rays
    /// all meet it or not, so that outlines are steps however many rays there are. Where coverage varies, smaller pixels
    /// take the place of rays.
    fn drawn_for_one(&self, scene: &Scene, size: UVec2) -> u32 {
        const MOST: u32 = 4;
        /// Largest number of pixels to draw.
        const MOST_PIXELS: u64 = 1 << 24;
        let refract = &scene.settings.refract;
        let fits = |side: u32| {
            let area = u64::from(size.x) * u64::from(size.y) * u64::from(side * side);
            area <= MOST_PIXELS && self.gpu.check_size(size * side).is_ok()
        };
        let wanted = (1..MOST).find(|side| side * side >= refract.samples).unwrap_or(MOST);
        let wanted = if refract.transparent { wanted } else { 1 };
        (2..=wanted).rev().find(|&side| fits(side)).unwrap_or(1)
    }

    /// Submits one frame of `size` pixels; its pass times are still to be read. The caller may know that it has the last
    /// frame's splats.
    fn submit(&mut self, input: FrameInput<'_>, has_last_splats: bool) -> Result<PendingFrame> {
        self.side = self.drawn_for_one(input.scene, input.size);
        let (side, size) = (self.side, input.size * self.side);
        let mut scene = Cow::Borrowed(input.scene);
        if side > 1 {
            let samples = &mut scene.to_mut().settings.refract.samples;
            *samples = (*samples / (side * side)).max(1);
        }
        let reusable = self.picture.take().filter(|old| old.size() == size);
        let picture = match reusable {
            Some(reusable) => self.picture.insert(reusable),
            None => self.picture.insert(Picture::new(&self.gpu, size)?),
        };
        let input = FrameInput { scene: &scene, size, ..input };
        let times = self.renderer.submit_frame(input, &*picture, has_last_splats)?;
        let picture = picture.begin_reading(&self.gpu);
        let transparent = scene.settings.refract.transparent;
        let gpu = self.gpu.clone();
        Ok(PendingFrame { gpu, picture, transparent, side, times, passes: Vec::new() })
    }

    /// As [`Offscreen::images`]; waits as [`Offscreen::finish`].
    ///
    /// # Errors
    /// As [`aov::read`].
    pub async fn finish_images(&self, chosen: &[Aov]) -> Result<Vec<aov::Part>> {
        let parts = aov::finish(&self.gpu, &self.renderer.images(), chosen).await?;
        Ok(parts.into_iter().map(|part| part.reduced(self.side)).collect())
    }

    /// As [`Offscreen::radiance`]; waits as [`Offscreen::finish`].
    ///
    /// # Errors
    /// As [`aov::read`].
    pub async fn finish_radiance(&self) -> Result<aov::Part> {
        let images = self.renderer.images();
        let texture = &images.radiance.texture;
        let part = aov::finish_linear(&self.gpu, texture, images.transparent).await?;
        Ok(part.reduced(self.side))
    }

    /// Reads intermediate images of the last frame; some require [`FrameInput::diagnose`].
    ///
    /// # Errors
    /// As [`aov::read`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn images(&self, chosen: &[Aov]) -> Result<Vec<aov::Part>> {
        pollster::block_on(self.finish_images(chosen))
    }

    /// Reads the linear radiance of the last frame, before exposure and tone mapping, W/(m² sr), for
    /// `exr::write` of `limpid-io`.
    ///
    /// # Errors
    /// As [`aov::read`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn radiance(&self) -> Result<aov::Part> {
        pollster::block_on(self.finish_radiance())
    }

    /// As [`Offscreen::radiance`], later or never: takes the picture, as [`Renderer::take_radiance`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn take_radiance(&mut self, spare: Option<wgpu::Texture>) -> PendingRadiance {
        let transparent = self.renderer.images().transparent;
        let texture = self.renderer.take_radiance(spare);
        PendingRadiance { gpu: self.gpu.uninterrupted(), texture, transparent, side: self.side }
    }
}

/// A frame that has been submitted.
#[derive(Debug)]
pub struct PendingFrame {
    gpu: Gpu,
    picture: PendingPicture,
    transparent: bool,
    /// [`Offscreen::drawn_for_one`].
    side: u32,
    /// The times of the passes, while they are still to be read.
    times: Option<SubmittedTimes>,
    passes: Vec<PassTime>,
}

impl PendingFrame {
    async fn finish_times(&mut self) -> Result<()> {
        if let Some(times) = self.times.take() {
            self.passes = times.finish(&self.gpu).await?;
        }
        Ok(())
    }

    /// Time of each pass, if [`FrameInput::timing`] is set: [`Offscreen::begin`] has waited for them.
    pub fn passes(&self) -> &[PassTime] {
        &self.passes
    }

    /// Waits for this frame, not for later ones.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn wait(self) -> Result<RenderedFrame> {
        let picture = reduced(self.picture.wait(&self.gpu)?, self.side);
        Ok(RenderedFrame::of(picture, self.transparent, self.passes))
    }

    /// As [`PendingFrame::wait`], for programs that take four channels: coverage is alpha if it varies, which is 255
    /// otherwise.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn wait_rgba(self) -> Result<RgbaImage> {
        let mut picture = reduced(self.picture.wait(&self.gpu)?, self.side);
        if !self.transparent {
            picture.pixels_mut().for_each(|pixel| pixel.0[3] = 255);
        }
        Ok(picture)
    }

    /// As [`PendingFrame::wait`], without blocking, as [`PendingPicture::ready`].
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    pub async fn ready(self) -> Result<RenderedFrame> {
        let picture = reduced(self.picture.ready(&self.gpu).await?, self.side);
        Ok(RenderedFrame::of(picture, self.transparent, self.passes))
    }
}

/// The linear radiance of a frame, on the device.
#[cfg(not(target_arch = "wasm32"))]
#[derive(Debug)]
pub struct PendingRadiance {
    gpu: Gpu,
    texture: wgpu::Texture,
    transparent: bool,
    /// [`Offscreen::drawn_for_one`].
    side: u32,
}

#[cfg(not(target_arch = "wasm32"))]
impl PendingRadiance {
    /// Reads it, as [`Offscreen::radiance`].
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn read(&self) -> Result<aov::Part> {
        Ok(aov::read_linear(&self.gpu, &self.texture, self.transparent)?.reduced(self.side))
    }

    /// Gives the texture back, for another frame.
    pub fn into_spare(self) -> wgpu::Texture {
        self.texture
    }
}

impl Picture {
    /// Reads the picture back, waiting for the device.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn read(&self, gpu: &Gpu) -> Result<RgbaImage> {
        self.begin_reading(gpu).wait(gpu)
    }

    /// Submits a copy of the picture; the next frame may be drawn into it at once.
    pub fn begin_reading(&self, gpu: &Gpu) -> PendingPicture {
        PendingPicture { size: self.size(), bytes: self.begin_reading_bytes(gpu) }
    }
}

/// A picture that is being read back.
#[derive(Debug)]
pub struct PendingPicture {
    size: UVec2,
    bytes: gpu::Reading,
}

impl PendingPicture {
    /// Waits for the picture, not for later submissions.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn wait(self, gpu: &Gpu) -> Result<RgbaImage> {
        pollster::block_on(self.finish(gpu))
    }

    /// The picture; waits as [`Offscreen::finish`].
    async fn finish(self, gpu: &Gpu) -> Result<RgbaImage> {
        Ok(image_of(self.size, self.bytes.finish(gpu).await?))
    }

    /// As [`PendingPicture::wait`], without blocking. Browsers poll their devices; other programs call
    /// `gpu.device.poll` from another thread or between turns of their executor.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    pub async fn ready(self, gpu: &Gpu) -> Result<RgbaImage> {
        Ok(image_of(self.size, self.bytes.ready(gpu).await?))
    }
}

/// A picture of which each pixel was drawn as `side`² smaller ones: the means of their coverage and, as far as they are
/// covered, of their light.
fn reduced(picture: RgbaImage, side: u32) -> RgbaImage {
    if side == 1 {
        return picture;
    }
    let light: [f32; 256] = std::array::from_fn(|c| linear_from_srgb(c as f32 / 255.0));
    RgbaImage::from_fn(picture.width() / side, picture.height() / side, |x, y| {
        let mut sum = Vec3::ZERO;
        let mut covered = 0.0;
        for (i, j) in (0..side).flat_map(|j| (0..side).map(move |i| (i, j))) {
            let Rgba([r, g, b, a]) = *picture.get_pixel(x * side + i, y * side + j);
            let a = f32::from(a) / 255.0;
            sum += a * Vec3::from([r, g, b].map(|c| light[usize::from(c)]));
            covered += a;
        }
        let color = if covered > 0.0 { sum / covered } else { Vec3::ZERO };
        let [r, g, b] = color.to_array().map(|c| srgb_byte(f64::from(c)));
        let alpha = 255.0 * covered / (side * side) as f32;
        Rgba([r, g, b, alpha.round() as u8])
    })
}

fn image_of(size: UVec2, bytes: Vec<u8>) -> RgbaImage {
    RgbaImage::from_raw(size.x, size.y, bytes).expect("a picture has four bytes per pixel")
}
