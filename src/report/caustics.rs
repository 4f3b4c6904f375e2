//! Caustic maps measured: their time, their error, and whether light is kept.

use glam::{DVec2, DVec3, UVec2};
use rayon::prelude::*;

use super::intersect::{ViewLayers, upload};
use crate::error::Result;
use crate::gpu::{self, Gpu, Timer};
use crate::light_view::LightView;
use crate::passes::caustics::{CausticMap, Caustics, Inputs, Output, Params};
use crate::passes::gbuffer::SceneBinding;
use crate::passes::{CameraBinding, GBuffer, Layers};
use crate::reference::surroundings::Surroundings;
use crate::reference::trace::first_last_along;
use crate::reference::{Liquid, Ray};
use crate::scene::Scene;

impl ViewLayers {
    /// A liquid and the solids as a light sees them, exactly.
    pub fn of_light(liquid: &(impl Liquid + ?Sized), scene: &Scene, view: &LightView) -> Self {
        let surroundings = Surroundings::new(scene);
        let size = view.size;
        let texels: Vec<_> = (0..size.element_product())
            .into_par_iter()
            .map(|i| {
                let center = DVec2::new((i % size.x).into(), (i / size.x).into()) + 0.5;
                let (origin, direction) = view.ray(center);
                let ray = Ray { origin, direction };
                let [front, back] = first_last_along(liquid, &ray, liquid.contains(origin))
                    .map(|c| c.map_or([0.0; 4], |c| view.texel(ray.at(c.t), c.normal)));
                let solid = surroundings.hit(&ray);
                let solid = solid.map_or([0.0; 4], |hit| view.texel(hit.point, hit.normal));
                (front, (back, solid))
            })
            .collect();
        let (front, (back, solids)): (Vec<_>, (Vec<_>, Vec<_>)) = texels.into_iter().unzip();
        Self { size, aggregate: [front, back], splash: None, solids }
    }
}

/// One light over given layers, on the device.
pub struct Bench {
    gpu: Gpu,
    view: LightView,
    camera: CameraBinding,
    scene: SceneBinding,
    aggregate: Layers,
    splash: Option<Layers>,
    gbuffer: GBuffer,
    outputs: [wgpu::Texture; 2],
    caustics: Caustics,
}

/// What one run made.
#[derive(Debug, Clone)]
pub struct Run {
    /// Irradiance on each texel's receiver by light through liquid, W/m², and 1 where liquid leaves
    /// the direct light alone; rows from the top.
    pub irradiance: Vec<[f32; 4]>,
    /// Depth of each texel's receiver in the light's view, m; 0 where there is none.
    pub depths: Vec<f32>,
    /// What `gather` found: irradiance, and 1 where it solved, 2 where it did not, 0 where there
    /// was nothing to solve.
    pub gathered: Vec<[f32; 4]>,
    /// Milliseconds on the device, 0 where it has no timestamps.
    pub ms: f64,
}

impl Bench {
    /// Uploads a light's layers.
    ///
    /// # Errors
    /// [`crate::Error::Adapter`] if they are too large.
    pub fn new(gpu: &Gpu, scene: &Scene, view: &LightView, layers: &ViewLayers) -> Result<Self> {
        gpu.check_size(layers.size)?;
        let camera = CameraBinding::new(gpu, view.orthographic);
        camera.write(gpu, &view.uniform(view.origin));
        let mut bound = SceneBinding::new(gpu);
        bound.upload(gpu, scene, view.origin, &[], None);
        let pair = |texels: &[Vec<[f32; 4]>; 2]| {
            let texture = upload(gpu, layers.size, &[&texels[0], &texels[1]]);
            let view = gpu::array_view(&texture);
            Layers { texture, view }
        };
        let planes = upload(gpu, layers.size, &[&layers.solids]);
        let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::COPY_SRC;
        let output = |label| {
            let usage = usage | wgpu::TextureUsages::TEXTURE_BINDING;
            gpu::texture(gpu, label, layers.size, 1, Layers::FORMAT, usage)
        };
        Ok(Self {
            gpu: gpu.clone(),
            view: *view,
            aggregate: pair(&layers.aggregate),
            splash: layers.splash.as_ref().map(pair),
            gbuffer: GBuffer { radiance: planes.clone(), planes },
            outputs: [output("map"), output("receivers")],
            caustics: Caustics::new(gpu, &camera),
            camera,
            scene: bound,
        })
    }

    /// Makes the map of one of the scene's lights, by the scene's settings. Lengths in settings are
    /// in units of `radius`, m.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    ///
    /// # Panics
    /// If the scene has no such light.
    pub fn run(&mut self, scene: &Scene, light: usize, radius: f32) -> Result<Run> {
        let (gpu, camera, bound) = (&self.gpu, &self.camera, &self.scene);
        let size = self.view.size;
        self.caustics.prepare(gpu, camera, bound, scene, self.splash.is_some(), size);
        let params = Params::new(&scene.lights[light], &self.view, &scene.settings.caustics);
        let inputs = Inputs {
            camera,
            scene: bound,
            aggregate: &self.aggregate,
            splash: self.splash.as_ref(),
            gbuffer: &self.gbuffer,
        };
        let [map, receivers] = &self.outputs;
        let output = Output { map, receivers, layer: 0 };
        let mut timer = Timer::new(gpu, true);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let span = timer.span("caustics");
        self.caustics.record(gpu, &mut encoder, scene, radius, &params, inputs, output, span);
        let resolved = timer.resolve(gpu, &mut encoder);
        gpu.queue.submit([encoder.finish()]);
        gpu.check()?;
        let ms = timer.read(gpu, resolved.as_ref())?.first().map_or(0.0, |time| time.ms);

        let [map, receivers] = self.outputs.clone();
        let map = CausticMap { view: self.view, map, receivers, layer: 0 };
        let (irradiance, depths) = map.read(gpu)?;
        let gathered = match self.caustics.gathered() {
            Some(texture) => bytemuck::pod_collect_to_vec(&gpu::read_texture(gpu, texture, 0)?),
            None => Vec::new(),
        };
        Ok(Run { irradiance, depths, gathered, ms })
    }
}

/// Relative L1 difference of two maps of irradiance: Σ|a − b| / Σ b, over red, green and blue and
/// all texels for which `counts` holds.
pub fn relative_l1(map: &[[f32; 4]], truth: &[DVec3], counts: impl Fn(usize) -> bool) -> f64 {
    let (mut difference, mut sum) = (0.0, 0.0);
    for (i, (a, b)) in map.iter().zip(truth).enumerate() {
        if counts(i) {
            let a = DVec3::new(a[0].into(), a[1].into(), a[2].into());
            difference += (a - b).abs().element_sum();
            sum += b.element_sum();
        }
    }
    difference / sum.max(f64::MIN_POSITIVE)
}

/// The light that a map holds, W per channel: irradiance times the receivers' areas.
pub fn received(view: &LightView, run: &Run, scene: &Scene) -> DVec3 {
    let surroundings = Surroundings::new(scene);
    let size: UVec2 = view.size;
    let texel = |(i, e): (usize, &[f32; 4])| {
        let i = i as u32;
        let center = DVec2::new((i % size.x).into(), (i / size.x).into()) + 0.5;
        let (origin, direction) = view.ray(center);
        let Some(hit) = surroundings.hit(&Ray { origin, direction }) else { return DVec3::ZERO };
        let distance2 = if view.orthographic { 1.0 } else { hit.t * hit.t };
        let cos_theta = hit.normal.dot(direction).abs();
        let area = view.pixel_extent(center) * distance2 / cos_theta;
        area * DVec3::new(e[0].into(), e[1].into(), e[2].into())
    };
    run.irradiance.par_iter().enumerate().map(texel).sum()
}
