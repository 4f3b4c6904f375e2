//! The frame, on one page.

use glam::UVec2;

use crate::camera::Camera;
use crate::environment::Environment;
use crate::error::{Error, Result};
use crate::gpu::{self, Gpu, PassTime, Timer};
use crate::passes::classify::Splats;
use crate::passes::gbuffer::{Gbuffer, SceneBinding};
use crate::passes::mips::{self, Mips};
use crate::passes::refract::{self, Refract, Variant};
use crate::passes::smooth::{self, Smooth};
use crate::passes::splat::Splat;
use crate::passes::tiles::Tiles;
use crate::passes::tonemap::Tonemap;
use crate::passes::{CameraBinding, GBuffer, Layers, Radiance};
use crate::scene::Scene;
use crate::settings::Solids;

/// Draws particle liquids with one device.
///
/// Frames are independent of each other: what is kept between them is memory and pipelines.
#[derive(Debug)]
pub struct Renderer {
    gpu: Gpu,
    camera: CameraBinding,
    scene: SceneBinding,
    aggregate: Splat,
    splash: Splat,
    tiles: Tiles,
    smooth: Smooth,
    gbuffer: Gbuffer,
    mips: Mips,
    refract: Refract,
    tonemap: Tonemap,
    sized_for: Sized,
    smoothed: bool,
    /// Measure each pass with the device's timestamps, where it has them.
    pub timing: bool,
    /// Keep what [`Renderer::images`] needs: per-pixel counts, and the G-buffer.
    pub diagnose: bool,
}

/// What the textures were made for.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sized {
    size: UVec2,
    splash: bool,
    gbuffer: bool,
    count: bool,
    levels: u32,
}

/// The intermediate images of the last frame.
#[derive(Debug, Clone)]
pub struct Images {
    /// Aggregate layers before smoothing.
    pub aggregate: Layers,
    /// Aggregate layers after smoothing.
    pub smoothed: Layers,
    /// Splash layers, if the frame had splashes.
    pub splash: Option<Layers>,
    /// The opaque scene, if it was drawn.
    pub gbuffer: Option<GBuffer>,
    /// The linear picture.
    pub radiance: Radiance,
    /// Interfaces, length inside (m), solver iterations, solver failures per ray; if
    /// [`Renderer::diagnose`] was set.
    pub diagnostics: Option<wgpu::Texture>,
}

impl Renderer {
    /// Compiles the passes.
    pub fn new(gpu: &Gpu) -> Self {
        let camera = CameraBinding::new(gpu);
        let scene = SceneBinding::new(gpu);
        let aggregate = Splat::new(gpu, &camera);
        let splash = Splat::new(gpu, &camera);
        let tiles = Tiles::new(gpu);
        let smooth = Smooth::new(gpu, &camera, &aggregate.layers);
        let gbuffer = Gbuffer::new(gpu);
        let mips = Mips::new(gpu);
        let refract = Refract::new(gpu);
        let tonemap = Tonemap::new(gpu);
        let sized_for =
            Sized { size: UVec2::ONE, splash: false, gbuffer: false, count: false, levels: 1 };
        Self {
            gpu: gpu.clone(),
            camera,
            scene,
            aggregate,
            splash,
            tiles,
            smooth,
            gbuffer,
            mips,
            refract,
            tonemap,
            sized_for,
            smoothed: false,
            timing: false,
            diagnose: false,
        }
    }

    /// Draws one frame into `target`, a view of `size` pixels in `format`.
    ///
    /// The scene's own `camera` and `particles` are not used: a view and classified particles
    /// are the caller's to choose. sRGB formats are encoded by the device, others by limpid.
    ///
    /// Returns the time of each pass if [`Renderer::timing`] is set, else nothing at once,
    /// without waiting for the device.
    ///
    /// # Errors
    /// [`crate::Error::Scene`] for a value out of range, [`crate::Error::Adapter`] for a picture
    /// that is too large, [`crate::Error::DeviceLost`].
    pub fn render(
        &mut self,
        scene: &Scene,
        camera: &Camera,
        splats: &Splats,
        target: &wgpu::TextureView,
        format: wgpu::TextureFormat,
        size: UVec2,
    ) -> Result<Vec<PassTime>> {
        scene.check()?;
        camera.check()?;
        self.gpu.check_size(size)?;
        if let Environment::Map { size, pixels } = &scene.environment {
            self.gpu.check_size(*size)?;
            if pixels.len() != size.element_product() as usize {
                let problem = format!("{} pixels do not make a map of {size}", pixels.len());
                return Err(Error::Scene { origin: "environment".into(), problem });
            }
        }
        let settings = &scene.settings;
        let screen_solids = settings.refract.solids == Solids::Screen && !scene.solids.is_empty();
        let has_splash = !splats.splashes.is_empty();
        let variant = Variant::new(scene, has_splash, self.diagnose);
        self.resize(Sized {
            size,
            splash: has_splash,
            gbuffer: screen_solids || self.diagnose,
            count: self.diagnose,
            levels: if variant.mips() { mips::levels(size) } else { 1 },
        });

        let fits = smooth::Params::iterations(&settings.smooth, splats.radius);
        self.smoothed = !fits.is_empty();
        let gpu = &self.gpu;
        self.camera.write(gpu, &camera.uniform(size, splats.origin));
        self.scene.upload(gpu, scene, camera.eye);
        self.aggregate.upload(gpu, &splats.aggregates);
        self.splash.upload(gpu, &splats.splashes);
        let params = refract::Params::new(&scene.liquid, &settings.refract, splats.radius);
        if self.smoothed {
            self.smooth.prepare(gpu, &self.camera, settings.smooth.filter);
        }
        self.refract.prepare(gpu, &self.camera, &self.scene, variant, &params);
        if self.sized_for.gbuffer {
            self.gbuffer.prepare(gpu, &self.camera, &self.scene);
        }
        self.tonemap.prepare(gpu, &settings.tonemap, format);

        let mut timer = Timer::new(gpu, self.timing);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let (camera, scene) = (&self.camera, &self.scene);
        self.aggregate.record(&mut encoder, camera, timer.span("splat"));
        if has_splash {
            self.splash.record(&mut encoder, camera, timer.span("splat splashes"));
        }
        let splash = has_splash.then_some(&self.splash.layers);
        let aggregate = &self.aggregate.layers;
        self.tiles.record(gpu, &mut encoder, aggregate, splash, timer.span("tiles"));
        let tiles = &self.tiles.lists;
        if self.smoothed {
            let (filter, span) = (settings.smooth.filter, timer.span("smooth"));
            self.smooth.record(gpu, &mut encoder, camera, tiles, filter, &fits, span);
        }
        if self.sized_for.gbuffer {
            self.gbuffer.record(gpu, &mut encoder, camera, scene, timer.span("gbuffer"));
        }
        if variant.mips() {
            let mut layers = vec![&self.aggregate_layers().texture];
            layers.extend(splash.map(|splash| &splash.texture));
            layers.extend(screen_solids.then_some(&self.gbuffer.images.planes));
            self.mips.record(gpu, &mut encoder, &layers, timer.span("mips"));
        }
        self.refract.record(
            gpu,
            &mut encoder,
            camera,
            scene,
            self.aggregate_layers(),
            &self.splash.layers,
            &self.gbuffer.images,
            tiles,
            variant,
            timer.span("refract"),
        );
        let radiance = &self.refract.radiance;
        self.tonemap.record(gpu, &mut encoder, radiance, target, format, timer.span("tonemap"));
        let resolved = timer.resolve(gpu, &mut encoder);
        gpu.queue.submit([encoder.finish()]);
        gpu.check()?;
        timer.read(gpu, resolved.as_ref())
    }

    /// The intermediate images of the last frame.
    pub fn images(&self) -> Images {
        Images {
            aggregate: self.aggregate.layers.clone(),
            smoothed: self.aggregate_layers().clone(),
            splash: self.sized_for.splash.then(|| self.splash.layers.clone()),
            gbuffer: self.sized_for.gbuffer.then(|| self.gbuffer.images.clone()),
            radiance: self.refract.radiance.clone(),
            diagnostics: self.sized_for.count.then(|| self.refract.diagnostics.clone()),
        }
    }

    /// What the liquid is drawn from: smoothed, if anything was.
    fn aggregate_layers(&self) -> &Layers {
        if self.smoothed { &self.smooth.layers } else { &self.aggregate.layers }
    }

    /// Gives each pass what it needs at this size, and one pixel to those that do not run.
    fn resize(&mut self, wanted: Sized) {
        if wanted == self.sized_for {
            return;
        }
        let used = |on: bool| if on { (wanted.size, wanted.levels) } else { (UVec2::ONE, 1) };
        self.aggregate.resize(&self.gpu, wanted.size, wanted.levels);
        let (size, levels) = used(wanted.splash);
        self.splash.resize(&self.gpu, size, levels);
        self.tiles.resize(&self.gpu, wanted.size);
        self.smooth.resize(&self.gpu, &self.aggregate.layers);
        let (size, levels) = used(wanted.gbuffer);
        self.gbuffer.resize(&self.gpu, size, levels);
        self.refract.resize(&self.gpu, wanted.size, wanted.count);
        self.sized_for = wanted;
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
        let bytes = gpu::read_texture(gpu, &self.texture, 0)?;
        let picture =
            image::RgbaImage::from_raw(self.texture.width(), self.texture.height(), bytes);
        Ok(picture.expect("the texture has four bytes per pixel"))
    }
}
