//! The frame, on one page.

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
use crate::passes::view_passes::{FrameInputs, SplatSet, ViewConfig, ViewPasses};
use crate::passes::{GBufferImages, Layers, Radiance};
use crate::scene::Scene;
use crate::settings::Solids;

/// Draws particle liquids with one device.
///
/// Frames are independent of each other: what is kept between them is memory, pipelines, and such
/// images of the last frame as the next would draw again bit by bit.
#[derive(Debug)]
pub struct Renderer {
    gpu: Gpu,
    splat_set: SplatSet,
    lights: Lights,
    eye: ViewPasses,
    mips: Option<Mips>,
    refract: Refract,
    tonemap: Tonemap,
    sized_for: (UVec2, bool),
    /// None after an error, or if nothing is to be kept.
    last: Option<LastFrame>,
    submissions: u32,
    /// Measure each pass with the device's timestamps, where it has them.
    pub timing: bool,
    /// Keep what [`Renderer::images`] needs: per-pixel counts, and the G-buffer.
    pub diagnose: bool,
    /// Draw only what has changed since the last frame; off unless set.
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
    /// The opaque scene, if it was drawn.
    pub gbuffer: Option<GBufferImages>,
    /// The caustic map of each light, if it has one.
    pub caustics: Vec<Option<CausticMap>>,
    /// The linear picture.
    pub radiance: Radiance,
    /// Interfaces, length inside (m), solver iterations, solver failures per ray; if
    /// [`Renderer::diagnose`] was set.
    pub diagnostics: Option<wgpu::Texture>,
}

impl Renderer {
    /// Compiles what every frame needs; the rest is compiled when a frame first needs it.
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            gpu: gpu.clone(),
            splat_set: SplatSet::new(gpu),
            lights: Lights::default(),
            eye: ViewPasses::new(gpu, false),
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
    /// sRGB formats are encoded by the device, others by limpid.
    ///
    /// Returns the time of each pass that ran if [`Renderer::timing`] is set, else nothing. It waits for
    /// the device to time it, and where a frame is so long that it is divided. What the last frame has
    /// drawn from the same input is not drawn again: [`Renderer::forget`].
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
        if !self.refract.is_compiled(frame.variant, &self.eye.scene) {
            // The device begins to draw while the longest shaders are compiled.
            commands.submit();
        }
        let (camera_binding, scene_binding) = (&self.eye.camera, &self.eye.scene);
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

    /// Fails for inputs that cannot be drawn.
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

    /// Gives the passes textures of the frame's size.
    fn resize(&mut self, frame: &Frame<'_>) {
        self.eye.resize(&self.gpu, frame.config);
        let size = (frame.config.size, self.diagnose);
        if self.sized_for != size {
            self.refract.resize(&self.gpu, size.0, self.diagnose);
            self.sized_for = size;
        }
    }

    /// Uploads changed inputs, and compiles what the frame's passes lack; light through the layers,
    /// the longest, is compiled later.
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
            self.eye.look_past_walls(gpu, frame.scene, &frame.uniform, eye, frame.splats);
        }
        let (views, maps) = (self.lights.views(), self.lights.maps());
        self.eye.prepare(gpu, inputs, &frame.uniform, eye, views, maps);
        self.tonemap.prepare(gpu, &frame.scene.settings.tonemap, format);
        Ok(())
    }

    /// Records the lights' maps, the layers and the G-buffer, as far as they must be drawn again.
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
            let names = ["splat", "splat splashes", "mixture", "tiles", "smooth", "gbuffer"];
            self.eye.record(&self.gpu, commands, inputs, timer, names);
        }
    }

    /// Records light through the layers, as far as it must be followed again.
    fn record_picture(
        &self,
        frame: &Frame<'_>,
        dirty: Dirty,
        commands: &mut Commands<'_>,
        timer: &mut Timer,
    ) {
        if let Some(mips) = self.mips.as_ref().filter(|_| dirty.surfaces && frame.variant.mips()) {
            let mut layers = vec![&self.eye.aggregate_layers().texture];
            layers.extend(self.eye.splash_layers().map(|splash| &splash.texture));
            layers.extend(frame.screen_solids.then_some(&self.eye.gbuffer.images.planes));
            mips.record(&self.gpu, &mut commands.encoder, &layers, timer.span("mips"));
        }
        if dirty.radiance {
            let span = timer.span("refract");
            let (variant, work) = (frame.variant, frame.work);
            self.refract.record(&self.gpu, commands, &self.eye, variant, work, span);
        }
    }

    /// Draws all of the next frame, also what the last one has drawn from the same input: to
    /// measure what a frame takes.
    pub fn forget(&mut self) {
        self.last = None;
    }

    /// Submissions of the last frame: more than a few, where one would hold the device too long.
    pub fn submissions(&self) -> u32 {
        self.submissions
    }

    /// Numbers, from 0, of the last frame's lights that shine through the liquid straight, without
    /// caustics: point lights in the liquid, and such as see it under more than 150 degrees.
    pub fn lights_without_caustics(&self) -> Vec<usize> {
        self.lights.without_caustics()
    }

    /// The intermediate images of the last frame.
    pub fn images(&self) -> Images {
        let (eye, refract) = (&self.eye, &self.refract);
        Images {
            aggregate: eye.aggregate.layers.clone(),
            smoothed: eye.aggregate_layers().clone(),
            splash: eye.splash_layers().cloned(),
            gbuffer: eye.has_gbuffer().then(|| eye.gbuffer.images.clone()),
            caustics: self.lights.caustic_maps(),
            radiance: refract.radiance.clone(),
            diagnostics: self.sized_for.1.then(|| refract.diagnostics.clone()),
        }
    }
}

/// One frame: its inputs, and what its passes are made for.
struct Frame<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    splats: &'a Splats,
    uniform: CameraUniform,
    config: ViewConfig,
    variant: Variant,
    /// The iterations of smoothing.
    fits: Vec<smooth::Params>,
    /// Of the slowest pass at a pixel, in evaluations of a layer.
    work: u64,
    /// A pixel's ray may start in liquid.
    starts_inside: bool,
    /// Light meets solids in the G-buffer.
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
            culled: cull::pays(gpu, splats),
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

/// Squares of the product of a splat's axes and its distance have to be numbers that 32-bit floats
/// hold: beyond, the liquid would not be seen.
fn check_scale(splats: &Splats, camera: &Camera) -> Result<()> {
    /// m². Pictures at these ends are as in the middle.
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

/// The camera; if it has the default near plane and the eye is outside of the liquid, but nearer to
/// it than that plane, with one in front of the liquid. Else that would count as around the eye: a
/// low eye with a far target would look out of the water.
fn clear_of_liquid(camera: &Camera, splats: &Splats, size: UVec2, support: f32) -> Camera {
    /// Share of the way to the liquid, for smoothing may bring a surface nearer.
    const BEFORE: f64 = 0.5;
    /// Splats are seen from the eye in 32-bit floats: nearer than this share of the origin's distance
    /// or of a radius, near and far sides are not told apart.
    const LEAST: (f64, f64) = (1e-6, 1e-3);
    if camera.near.is_some() {
        return *camera;
    }
    let uniform = camera.uniform(size, splats.origin);
    let eye = camera.eye - splats.origin;
    let ahead = (camera.target - camera.eye).normalize();
    // From the eye to the near plane's corners, per unit of its depth.
    let corner = f64::from(uniform.tangent.extend(1.0).length());
    let farthest = corner * f64::from(uniform.near);
    let clearance = |splat: &Splat| {
        let offset = Vec3::from_array(splat.centre).as_dvec3() - eye;
        let (distance, reach) = (offset.length(), splat.longest());
        if distance - reach >= farthest || offset.dot(ahead) + reach <= 0.0 {
            return f64::INFINITY;
        }
        let to_sphere = splat.axes().inverse();
        // A way of this length in sphere space is no shorter than that over the norm in the world.
        let norm = to_sphere.to_cols_array().map(|x| x * x).iter().sum::<f64>().sqrt();
        (((to_sphere * offset).length() - 1.0) / norm).max(distance - reach)
    };
    let all = splats.aggregates.par_iter().chain(&splats.splashes);
    let nearest = all.map(clearance).reduce(|| f64::INFINITY, f64::min);
    let outside = nearest > 0.0 && !classify::is_inside(splats, eye, support);
    if nearest >= farthest || !outside {
        return *camera;
    }
    let least = (LEAST.0 * eye.length()).max(LEAST.1 * f64::from(splats.radius));
    let near = (BEFORE * nearest / corner).max(least) as f32;
    Camera { near: Some(near.min(uniform.near)), ..*camera }
}

/// Whether the picture may have a pixel whose ray starts in liquid. Then it leaves by a back, also
/// where a ray is followed through one interface.
fn may_start_inside(splats: &Splats, camera: &Camera, size: UVec2) -> bool {
    let uniform = camera.uniform(size, splats.origin);
    // From the eye to the near plane's corners; and room for planes that are seen at a slant.
    let near = 32.0 * uniform.near * uniform.tangent.extend(1.0).length();
    splats.aggregates.iter().chain(&splats.splashes).any(|splat| {
        (uniform.origin + Vec3::from_array(splat.centre)).length()
            <= 1.001 * splat.longest() as f32 + near
    })
}

/// How far the liquid reaches above the eye, m: the highest particle of those that the vertical through
/// the eye passes, or nearly; 0 if there is none. `origin` is that of the splats, seen from the eye.
fn depth_below_surface(splats: &Splats, origin: Vec3) -> f32 {
    let height = |splat: &Splat| {
        let centre = origin + Vec3::from_array(splat.centre);
        let near = centre.xz().length() <= 2.0 * splat.radius;
        if near { centre.y + splat.radius } else { 0.0 }
    };
    splats.aggregates.par_iter().map(height).reduce(|| 0.0, f32::max)
}
