//! The renderer: [`Renderer::render`] draws a frame.

use glam::{UVec2, Vec3, Vec3Swizzles as _};
use rayon::prelude::*;

use crate::camera::{Camera, CameraUniform};
use crate::dirty::{Dirty, LastFrame};
use crate::environment::Environment;
use crate::error::{Error, Limited, Result};
use crate::gpu::{Commands, Gpu, PassTime, Timer};
use crate::lights::Lights;
use crate::liquid::classify::{self, Splat, Splats};
use crate::passes::caustics::CausticMap;
use crate::passes::cull;
use crate::passes::mips::{self, Mips};
use crate::passes::refract::{self, Refract, Variant};
use crate::passes::smooth;
use crate::passes::tiles::Sections;
use crate::passes::tonemap::Tonemap;
use crate::passes::view_passes::{FrameInputs, PassNames, SplatSet, ViewConfig, ViewPasses};
use crate::passes::{GBufferImages, Layers, Radiance};
use crate::scene::Scene;
use crate::settings::Solids;

/// Draws particle liquids with one device.
///
/// Frames are independent of each other. The renderer keeps only memory, pipelines, and images of the
/// last frame that the next frame would redraw bit for bit.
#[derive(Debug)]
pub struct Renderer {
    gpu: Gpu,
    splat_set: SplatSet,
    lights: Lights,
    camera_view: ViewPasses,
    mips: Option<Mips>,
    refract: Refract,
    tonemap: Tonemap,
    sized_for: (UVec2, bool),
    /// Inputs of the last frame; `None` after an error, or without [`Renderer::reuse`].
    last: Option<LastFrame>,
    submissions: u32,
    /// Measure each pass with timestamp queries, where the device supports them.
    pub timing: bool,
    /// Draw the per-pixel counts and the G-buffer for [`Renderer::images`].
    pub diagnose: bool,
    /// Skip passes whose inputs have not changed since the last frame; off by default.
    pub reuse: bool,
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
    /// The G-buffer, if it was drawn.
    pub gbuffer: Option<GBufferImages>,
    /// The caustic map of each light, if it has one.
    pub caustics: Vec<Option<CausticMap>>,
    /// The linear picture.
    pub radiance: Radiance,
    /// Interfaces, length inside the liquid (m), solver iterations and solver failures of each pixel's
    /// rays; `None` unless [`Renderer::diagnose`] was set.
    pub diagnostics: Option<wgpu::Texture>,
}

impl Renderer {
    /// Compiles the pipelines that every frame needs; all others are compiled on first use.
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            gpu: gpu.clone(),
            splat_set: SplatSet::new(gpu),
            lights: Lights::default(),
            camera_view: ViewPasses::new(gpu, false),
            mips: None,
            refract: Refract::new(gpu),
            tonemap: Tonemap::new(gpu),
            sized_for: (UVec2::ONE, false),
            last: None,
            submissions: 0,
            timing: false,
            diagnose: false,
            reuse: false,
        }
    }

    /// Draws one frame into `target`, a view of `size` pixels in `format`.
    ///
    /// The device encodes sRGB formats; the shader encodes all others.
    ///
    /// Returns the time of each pass that ran if [`Renderer::timing`] is set, otherwise nothing. The call
    /// blocks on the device to read these times, and if the frame is so long that it is split into
    /// several submissions. With [`Renderer::reuse`], passes whose inputs have not changed are skipped;
    /// [`Renderer::forget`] prevents that.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] for a value out of range, [`crate::Error::Limit`] for a picture
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
        self.check(scene, camera, splats, size)?;
        let camera = &clear_of_liquid(camera, splats, size, scene.settings.classify.support);
        let frame = Frame::new(self, scene, camera, splats, size);

        let last = self.last.take().filter(|_| self.reuse);
        let diagnose = self.diagnose;
        let dirty = Dirty::since(last.as_ref(), scene, camera, splats, frame.config, diagnose);

        self.resize(&frame);
        self.prepare(&frame, dirty, format)?;

        let gpu = &self.gpu;
        let (mut timer, mut commands) = (Timer::new(gpu, self.timing), Commands::new(gpu));
        self.record_views(&frame, dirty, &mut commands, &mut timer);
        if !self.refract.is_compiled(frame.variant, &self.camera_view.scene) {
            // The device starts drawing while the largest shaders compile.
            commands.submit();
        }
        let (camera_binding, scene_binding) = (&self.camera_view.camera, &self.camera_view.scene);
        let params = &frame.refract_params();
        self.refract.prepare(gpu, camera_binding, scene_binding, frame.variant, params);
        if frame.variant.mips() {
            self.mips.get_or_insert_with(|| Mips::new(gpu));
        }
        self.record_picture(&frame, dirty, &mut commands, &mut timer);
        let (radiance, span) = (&self.refract.radiance, timer.span("tonemap"));
        self.tonemap.record(gpu, &mut commands.encoder, radiance, target, format, span);
        let resolved = timer.resolve(gpu, &mut commands.encoder);
        commands.submit();

        self.submissions = commands.submissions;
        gpu.check()?;
        let remember =
            || LastFrame::new(last, dirty, scene, camera, splats, frame.config, diagnose);
        self.last = self.reuse.then(remember);
        timer.read(gpu, resolved.as_ref())
    }

    /// Fails if the inputs cannot be drawn.
    fn check(&self, scene: &Scene, camera: &Camera, splats: &Splats, size: UVec2) -> Result<()> {
        scene.check()?;
        camera.check()?;
        self.gpu.check()?;
        self.gpu.check_size(size)?;
        check_scale(splats, camera)?;
        let Environment::Map { size, pixels } = &scene.environment else { return Ok(()) };
        self.gpu.check_image(*size, Limited::Environment)?;
        if pixels.is_empty() || pixels.len() != size.x as usize * size.y as usize {
            let problem = format!("{} pixels do not make a map of {size}", pixels.len());
            return Err(Error::invalid("environment", problem));
        }
        Ok(())
    }

    /// Resizes the passes' textures to the frame.
    fn resize(&mut self, frame: &Frame<'_>) {
        self.camera_view.resize(&self.gpu, frame.config);
        let size = (frame.config.size, self.diagnose);
        if self.sized_for != size {
            self.refract.resize(&self.gpu, size.0, self.diagnose);
            self.sized_for = size;
        }
    }

    /// Uploads changed inputs and compiles missing pipelines, except for refraction, which takes
    /// longest and is compiled later.
    fn prepare(
        &mut self,
        frame: &Frame<'_>,
        dirty: Dirty,
        format: wgpu::TextureFormat,
    ) -> Result<()> {
        let (gpu, eye) = (&self.gpu, frame.camera.eye);
        if dirty.splats {
            self.splat_set.upload(gpu, frame.splats);
        }
        let inputs = frame.inputs(&self.splat_set);
        if dirty.lights {
            self.lights.prepare(gpu, inputs, frame.config.culled)?;
        }
        if dirty.surfaces {
            self.camera_view.remove_splats_behind_walls(
                gpu,
                frame.scene,
                &frame.uniform,
                eye,
                frame.splats,
            );
        }
        let (views, maps) = (self.lights.views(), self.lights.maps());
        self.camera_view.prepare(gpu, inputs, &frame.uniform, eye, views, maps);
        self.tonemap.prepare(gpu, &frame.scene.settings.tonemap, format);
        Ok(())
    }

    /// Records the lights' maps, the layers and the G-buffer, as far as they are dirty.
    fn record_views(
        &self,
        frame: &Frame<'_>,
        dirty: Dirty,
        commands: &mut Commands<'_>,
        timer: &mut Timer,
    ) {
        let inputs = frame.inputs(&self.splat_set);
        if dirty.lights {
            self.lights.record(&self.gpu, commands, inputs, timer);
        }
        if dirty.surfaces {
            self.camera_view.record(&self.gpu, commands, inputs, timer, PassNames::CAMERA);
        }
    }

    /// Records mip levels and refraction, as far as they are dirty.
    fn record_picture(
        &self,
        frame: &Frame<'_>,
        dirty: Dirty,
        commands: &mut Commands<'_>,
        timer: &mut Timer,
    ) {
        if let Some(mips) = self.mips.as_ref().filter(|_| dirty.surfaces && frame.variant.mips()) {
            let mut layers = vec![&self.camera_view.aggregate_layers().texture];
            layers.extend(self.camera_view.splash_layers().map(|splash| &splash.texture));
            layers.extend(frame.screen_solids.then_some(&self.camera_view.gbuffer.images.planes));
            mips.record(&self.gpu, &mut commands.encoder, &layers, timer.span("mips"));
        }
        if dirty.radiance {
            let span = timer.span("refract");
            let (variant, work) = (frame.variant, frame.work);
            self.refract.record(&self.gpu, commands, &self.camera_view, variant, work, span);
        }
    }

    /// Discards the last frame, so that the next one runs all passes: for measuring the time of a
    /// complete frame.
    pub fn forget(&mut self) {
        self.last = None;
    }

    /// Number of submissions of the last frame: many, if a single one would occupy the device too long.
    pub fn submissions(&self) -> u32 {
        self.submissions
    }

    /// Indices of the last frame's lights without caustics, whose light is not refracted: point lights
    /// inside the liquid, and those from which it subtends more than 150 degrees.
    pub fn lights_without_caustics(&self) -> Vec<usize> {
        self.lights.without_caustics()
    }

    /// The intermediate images of the last frame.
    pub fn images(&self) -> Images {
        let (view, refract) = (&self.camera_view, &self.refract);
        Images {
            aggregate: view.aggregate.layers.clone(),
            smoothed: view.aggregate_layers().clone(),
            splash: view.splash_layers().cloned(),
            gbuffer: view.has_gbuffer().then(|| view.gbuffer.images.clone()),
            caustics: self.lights.caustic_maps(),
            radiance: refract.radiance.clone(),
            diagnostics: self.sized_for.1.then(|| refract.diagnostics.clone()),
        }
    }
}

/// One frame: its inputs, and the configuration of its passes.
struct Frame<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    splats: &'a Splats,
    uniform: CameraUniform,
    config: ViewConfig,
    variant: Variant,
    /// Parameters of each smoothing iteration.
    fits: Vec<smooth::Params>,
    /// Work per pixel of the slowest pass, in layer evaluations.
    work: u64,
    /// A pixel's ray may start inside the liquid.
    starts_inside: bool,
    /// Rays intersect solids in the G-buffer.
    screen_solids: bool,
}

impl<'a> Frame<'a> {
    fn new(
        renderer: &Renderer,
        scene: &'a Scene,
        camera: &'a Camera,
        splats: &'a Splats,
        size: UVec2,
    ) -> Self {
        let (gpu, diagnose, settings) = (&renderer.gpu, renderer.diagnose, &scene.settings);
        let screen_solids = settings.refract.solids == Solids::Screen && !scene.solids.is_empty();
        let splash = !splats.splashes.is_empty();
        let variant = Variant::new(scene, splash, diagnose);
        let starts_inside = may_start_inside(splats, camera, size);
        let lit = if scene.is_lit() { scene.lights.len() } else { 0 };
        let work = refract::work(&settings.refract, size, scene.solids.len(), lit);
        let work = work.max(smooth::work(&settings.smooth));
        let config = ViewConfig {
            size,
            splash,
            mixture: variant.mixture,
            gbuffer: screen_solids || diagnose,
            levels: if variant.mips() { mips::levels(size) } else { 1 },
            backs: settings.refract.interfaces > 1 || diagnose || starts_inside,
            culled: cull::is_worthwhile(gpu, splats),
            sections: Sections::for_work(gpu, size, work),
        };
        Self {
            scene,
            camera,
            splats,
            uniform: camera.uniform(size, splats.origin),
            config,
            variant,
            fits: smooth::Params::iterations(&settings.smooth, splats.radius),
            work,
            starts_inside,
            screen_solids,
        }
    }

    fn inputs<'b>(&'b self, splat_set: &'b SplatSet) -> FrameInputs<'b> {
        let Self { scene, splats, fits, .. } = self;
        FrameInputs { scene, splats, splat_set, fits }
    }

    fn refract_params(&self) -> refract::Params {
        let Self { scene, splats, .. } = self;
        let mut params = refract::Params::new(scene, &scene.settings.refract, splats.radius);
        let lit = scene.solids.iter().any(|solid| solid.lit);
        if self.starts_inside && self.variant.absorption && lit {
            params.eye_depth = depth_below_surface(splats, self.uniform.origin);
        }
        params
    }
}

/// Fails if the product of a splat's axes and its distance, squared, leaves the range of 32-bit
/// floats: the liquid would be invisible.
fn check_scale(splats: &Splats, camera: &Camera) -> Result<()> {
    /// Range of radius times distance, m²; pictures are correct up to both ends.
    const PRODUCTS: std::ops::RangeInclusive<f64> = 1e-18..=1e18;
    let (radius, distance) = (f64::from(splats.radius), camera.eye.distance(camera.target));
    let empty = splats.aggregates.is_empty() && splats.splashes.is_empty();
    if empty || PRODUCTS.contains(&(radius * distance)) {
        return Ok(());
    }
    let problem = format!(
        "a particle radius of {radius:e} m seen from {distance:e} m cannot be drawn: their product must be \
         1e-18 to 1e18 m²; choose another unit of length"
    );
    Err(Error::invalid("particles", problem))
}

/// Moves a default near plane in front of the liquid, if the eye is outside the liquid but nearer to
/// it than that plane. Otherwise the liquid would count as surrounding the eye: a low eye with a far
/// target would look out of the water.
fn clear_of_liquid(camera: &Camera, splats: &Splats, size: UVec2, support: f32) -> Camera {
    /// Near plane over the distance to the liquid, less than 1 because smoothing may move a surface nearer.
    const NEAR_SHARE: f64 = 0.5;
    /// Least near plane, over the origin's distance and over a radius: any nearer, 32-bit floats cannot
    /// distinguish the near and far sides of splats.
    const MIN_SHARES: (f64, f64) = (1e-6, 1e-3);
    if camera.near.is_some() {
        return *camera;
    }
    let uniform = camera.uniform(size, splats.origin);
    let eye = camera.eye - splats.origin;
    let ahead = (camera.target - camera.eye).normalize();
    // Distance from the eye to the near plane's corners, per unit of depth.
    let corner = f64::from(uniform.tangent.extend(1.0).length());
    let farthest = corner * f64::from(uniform.near);
    let clearance = |splat: &Splat| {
        let offset = Vec3::from_array(splat.centre).as_dvec3() - eye;
        let (distance, reach) = (offset.length(), splat.longest());
        if distance - reach >= farthest || offset.dot(ahead) + reach <= 0.0 {
            return f64::INFINITY;
        }
        let to_sphere = splat.axes().inverse();
        // A distance in world space is at least the one in sphere space over the norm.
        let norm = to_sphere.to_cols_array().map(|x| x * x).iter().sum::<f64>().sqrt();
        (((to_sphere * offset).length() - 1.0) / norm).max(distance - reach)
    };
    let all = splats.aggregates.par_iter().chain(&splats.splashes);
    let nearest = all.map(clearance).reduce(|| f64::INFINITY, f64::min);
    let outside = nearest > 0.0 && !classify::is_inside(splats, eye, support);
    if nearest >= farthest || !outside {
        return *camera;
    }
    let least = (MIN_SHARES.0 * eye.length()).max(MIN_SHARES.1 * f64::from(splats.radius));
    let near = (NEAR_SHARE * nearest / corner).max(least) as f32;
    Camera { near: Some(near.min(uniform.near)), ..*camera }
}

/// Whether a pixel's ray may start inside the liquid. It then leaves through a back, even if rays are
/// followed through one interface only.
fn may_start_inside(splats: &Splats, camera: &Camera, size: UVec2) -> bool {
    let uniform = camera.uniform(size, splats.origin);
    // Distance from the eye to the near plane's corners, with a margin for planes at grazing angles.
    let near = 32.0 * uniform.near * uniform.tangent.extend(1.0).length();
    splats.aggregates.iter().chain(&splats.splashes).any(|splat| {
        (uniform.origin + Vec3::from_array(splat.centre)).length()
            <= 1.001 * splat.longest() as f32 + near
    })
}

/// Depth of the eye below the liquid's surface, m: up to the highest particle near the vertical through
/// the eye; 0 if there is none. `origin` is the splats' origin relative to the eye.
fn depth_below_surface(splats: &Splats, origin: Vec3) -> f32 {
    let height = |splat: &Splat| {
        let centre = origin + Vec3::from_array(splat.centre);
        let near = centre.xz().length() <= 2.0 * splat.radius;
        if near { centre.y + splat.radius } else { 0.0 }
    };
    splats.aggregates.par_iter().map(height).reduce(|| 0.0, f32::max)
}
