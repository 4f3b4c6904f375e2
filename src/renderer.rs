//! The frame, on one page.

use glam::{UVec2, Vec3, Vec3Swizzles as _};
use rayon::prelude::*;

use crate::camera::Camera;
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
use crate::passes::view_passes::{SplatSet, ViewConfig, ViewPasses};
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
    liquid: SplatSet,
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
            liquid: SplatSet::new(gpu),
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
        scene.check()?;
        camera.check()?;
        self.gpu.check()?;
        self.gpu.check_size(size)?;
        check_scale(splats, camera)?;
        let camera = &clear_of_liquid(camera, splats, size, scene.settings.classify.support);
        if let Environment::Map { size, pixels } = &scene.environment {
            self.gpu.check_image(*size, Limited::Environment)?;
            if pixels.is_empty() || pixels.len() != size.x as usize * size.y as usize {
                let problem = format!("{} pixels do not make a map of {size}", pixels.len());
                return Err(Error::invalid("environment", problem));
            }
        }
        let settings = &scene.settings;
        let screen_solids = settings.refract.solids == Solids::Screen && !scene.solids.is_empty();
        let has_splash = !splats.splashes.is_empty();
        let variant = Variant::new(scene, has_splash, self.diagnose);
        let gpu = &self.gpu;
        let starts_inside = may_start_inside(splats, camera, size);
        let backs = settings.refract.interfaces > 1 || self.diagnose || starts_inside;
        let lit = if scene.is_lit() { scene.lights.len() } else { 0 };
        let work = refract::work(&settings.refract, size, scene.solids.len(), lit);
        let work = work.max(smooth::work(&settings.smooth));
        let wanted = ViewConfig {
            size,
            splash: has_splash,
            mixture: variant.mixture,
            gbuffer: screen_solids || self.diagnose,
            levels: if variant.mips() { mips::levels(size) } else { 1 },
            backs,
            culled: cull::pays(gpu, splats),
            sections: Sections::for_work(gpu, size, work),
        };
        let last = self.last.take().filter(|_| self.reuse);
        let dirty = Dirty::since(last.as_ref(), scene, camera, splats, wanted, self.diagnose);
        self.eye.resize(gpu, wanted);
        if self.sized_for != (size, self.diagnose) {
            self.refract.resize(gpu, size, self.diagnose);
            self.sized_for = (size, self.diagnose);
        }

        let fits = smooth::Params::iterations(&settings.smooth, splats.radius);
        if dirty.splats {
            self.liquid.upload(gpu, splats);
        }
        if dirty.lights {
            let (liquid, culled) = (&self.liquid, wanted.culled);
            self.lights.prepare(gpu, scene, liquid, splats, culled, &fits)?;
        }
        let uniform = camera.uniform(size, splats.origin);
        let (views, maps) = (self.lights.views(), self.lights.maps());
        let liquid = &self.liquid;
        let eye = camera.eye;
        if dirty.surfaces {
            self.eye.look_past_walls(gpu, scene, &uniform, eye, splats);
        }
        self.eye.prepare(gpu, scene, liquid, &uniform, eye, views, maps, splats, &fits);

        let mut timer = Timer::new(gpu, self.timing);
        let mut commands = Commands::new(gpu);
        if dirty.lights {
            let lights = &self.lights;
            lights.record(gpu, &mut commands, scene, &self.liquid, splats, &fits, &mut timer);
        }
        if dirty.surfaces {
            let names = ["splat", "splat splashes", "mixture", "tiles", "smooth", "gbuffer"];
            self.eye.record(gpu, &mut commands, scene, &self.liquid, &fits, &mut timer, names);
        }
        if !self.refract.is_compiled(variant, &self.eye.scene) {
            // The device begins to draw while the longest shaders are compiled.
            commands.submit();
        }
        let mut params = refract::Params::new(scene, &settings.refract, splats.radius);
        if starts_inside && variant.absorption && scene.solids.iter().any(|solid| solid.lit) {
            params.eye_depth = depth_below_surface(splats, uniform.origin);
        }
        self.refract.prepare(gpu, &self.eye.camera, &self.eye.scene, variant, &params);
        self.tonemap.prepare(gpu, &settings.tonemap, format);
        if dirty.surfaces && variant.mips() {
            let mut layers = vec![&self.eye.aggregate_layers().texture];
            layers.extend(self.eye.splash_layers().map(|splash| &splash.texture));
            layers.extend(screen_solids.then_some(&self.eye.gbuffer.images.planes));
            let mips = self.mips.get_or_insert_with(|| Mips::new(gpu));
            mips.record(gpu, &mut commands.encoder, &layers, timer.span("mips"));
        }
        if dirty.radiance {
            let span = timer.span("refract");
            self.refract.record(gpu, &mut commands, &self.eye, variant, work, span);
        }
        let radiance = &self.refract.radiance;
        let encoder = &mut commands.encoder;
        self.tonemap.record(gpu, encoder, radiance, target, format, timer.span("tonemap"));
        let resolved = timer.resolve(gpu, encoder);
        commands.submit();
        self.submissions = commands.submissions;
        gpu.check()?;
        let diagnosed = self.diagnose;
        // A copy of all splats, for callers who want it.
        self.last = self
            .reuse
            .then(|| LastFrame::new(last, dirty, scene, camera, splats, wanted, diagnosed));
        timer.read(gpu, resolved.as_ref())
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
