//! Radiance of opaque bodies, of which the first interface is all that a picture shows: `shaders/shade/`.
//!
//! `around` finds the light from the environment, the solids and the body itself, along a few directions a pixel; `body`
//! averages it over neighbours and adds the lights.

use bytemuck::{Pod, Zeroable};
use glam::UVec2;
use wgpu::BindingResource::TextureView;
use wgpu::TextureViewDimension::D2;

use super::Layers;
use super::tiles::TileLists;
use super::view_passes::ViewPasses;
use crate::gpu::{self, Bound, Commands, Gpu, Kernel, Span};
use crate::scene::Scene;

/// Format of the light around each pixel: three packed colours, and a reflectance.
const AROUND: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

/// `Params` of `shade/surface.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// Albedo where no colours are given, linear RGB.
    pub albedo: [f32; 3],
    /// Index of refraction of the coat; 1 for none.
    pub ior: f32,
    /// Roughness of the coat, α.
    pub roughness: f32,
    /// Share of light from everywhere that enters the coat.
    pub mean_transmittance: f32,
    /// Radius of particles, m.
    pub radius: f32,
    /// Share of light from everywhere inside that the surface of a film around the body reflects; 0 for none.
    pub film_reflectance: f32,
}

/// Images of opaque bodies.
#[derive(Debug)]
pub struct ShadeImages {
    around: wgpu::Texture,
    /// Means over 4×4 pixels.
    means: wgpu::Texture,
    /// Radiance of the body at each pixel that shows it; elsewhere without meaning.
    pub radiance: wgpu::Texture,
}

/// Draws the radiance of an opaque body.
#[derive(Debug)]
pub struct Shade {
    tiles: TileLists,
    around: wgpu::ComputePipeline,
    means: wgpu::ComputePipeline,
    body: wgpu::ComputePipeline,
    /// Group 1 of these, by section of the tiles.
    sections: Vec<[Bound; 3]>,
}

impl ShadeImages {
    /// Creates the images of a picture of `size` pixels.
    pub fn new(gpu: &Gpu, size: UVec2) -> Self {
        let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING;
        Self {
            around: gpu.texture("light around", size, 1, AROUND, usage),
            means: gpu.texture("means of light", size, 1, AROUND, usage),
            radiance: gpu.texture("body", size, 1, Layers::FORMAT, usage),
        }
    }
}

impl Params {
    /// The parameters of a scene whose particles have `radius`, m.
    /// Liquid of index `film`, or 1, covers the body.
    pub fn new(scene: &Scene, radius: f32, film: f32) -> Self {
        let liquid = &scene.liquid;
        // Inside, as outside, even light is the same before and behind the surface.
        let film_reflectance =
            1.0 - mean_transmittance(film.max(1.0).into()) as f32 / film.max(1.0).powi(2);
        Self {
            albedo: liquid.color.to_array(),
            ior: liquid.ior,
            roughness: liquid.roughness,
            mean_transmittance: mean_transmittance(liquid.ior.into()) as f32,
            radius,
            film_reflectance,
        }
    }
}

/// Share of light from all directions of a hemisphere that enters a dielectric of index `eta`, at least 1.
fn mean_transmittance(eta: f64) -> f64 {
    const STEPS: u32 = 256;
    let reflectance = |cos_i: f64| {
        let cos_t = (1.0 - (1.0 - cos_i * cos_i) / (eta * eta)).sqrt();
        let along = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
        let across = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
        0.5 * (along * along + across * across)
    };
    // Over cos²θ, whose steps are equal shares of irradiance.
    let step = |i: u32| 1.0 - reflectance(((f64::from(i) + 0.5) / f64::from(STEPS)).sqrt());
    (0..STEPS).map(step).sum::<f64>() / f64::from(STEPS)
}

impl Shade {
    /// Prepares the body that `eye` shows, whose particles have `radius`, m, and `colors`, if those are given. Liquid of index
    /// `film` covers it; 1 for none.
    pub fn prepare(
        gpu: &Gpu,
        eye: &ViewPasses,
        scene: &Scene,
        (radius, film): (f32, f32),
        colors: Option<&wgpu::Texture>,
        images: &ShadeImages,
    ) -> Self {
        let params = Params::new(scene, radius, film);
        let params = gpu.buffer_with("shade", gpu::UNIFORM, &[params]);
        let view = |texture: &wgpu::Texture| texture.create_view(&Default::default());
        let [around, means, radiance] = [&images.around, &images.means, &images.radiance].map(view);
        let color = colors.map_or_else(|| eye.images.mixture.view.clone(), view);
        let splash = eye.splash_layers();
        let (aggregates, splashes) =
            (&eye.aggregate_layers().view, &splash.unwrap_or(eye.aggregate_layers()).view);
        let tiles = &eye.images.tiles;
        let of_section = |section| {
            let shared = [
                (gpu::uniform::<Params>(), params.as_entire_binding()),
                (gpu.layers(), TextureView(aggregates)),
                (gpu.layers(), TextureView(splashes)),
                (gpu::sampled(D2), TextureView(&color)),
                (gpu::storage_of(8), tiles.section(&tiles.liquid, section)),
            ];
            let found = [(gpu::storage_texture(AROUND, D2), TextureView(&around))];
            let averaged = [
                (gpu::sampled_integers(), TextureView(&around)),
                (gpu::storage_texture(AROUND, D2), TextureView(&means)),
            ];
            let drawn = [
                (gpu::sampled_integers(), TextureView(&means)),
                (gpu::storage_texture(Layers::FORMAT, D2), TextureView(&radiance)),
            ];
            [
                gpu.bind("light around", &[&shared[..], &found].concat()),
                gpu.bind("means of light", &[&shared[..], &averaged].concat()),
                gpu.bind("body", &[&shared[..], &drawn].concat()),
            ]
        };
        let sections: Vec<_> = tiles.sections().map(of_section).collect();
        let on = |on: bool| f64::from(u8::from(on));
        let own = [
            ("SPLASH", on(splash.is_some())),
            ("COLORED", on(colors.is_some())),
            ("COATED", on(scene.liquid.ior > 1.0)),
        ];
        // Radiance along one direction stands for many around it.
        let scene_variant = super::scene_binding::SceneVariant {
            filter_patterns: eye.scene.variant.solids > 0,
            ..eye.scene.variant
        };
        let constants = [&own[..], &scene_variant.constants(), &eye.camera.constants()].concat();
        let kernel = |shader: &str, entry: &str, bound: &Bound| {
            let layouts = [&eye.camera.layout, &bound.layout, &eye.scene.layout];
            Kernel::new(shader, Default::default(), entry, &layouts, &constants)
        };
        let [found, averaged, drawn] = &sections[0];
        let [around, means, body] = gpu.pipelines([
            kernel("shade/around.wgsl", "look_around", found),
            kernel("shade/means.wgsl", "average", averaged),
            kernel("shade/body.wgsl", "shade_body", drawn),
        ]);
        Self { tiles: tiles.clone(), around, means, body, sections }
    }

    /// Records the body's radiance.
    pub fn record(&self, commands: &mut Commands<'_>, eye: &ViewPasses, span: Span<'_>) {
        let Self { tiles, around, means, body, sections } = self;
        tiles.run_on_liquid(
            commands,
            ("shade", span),
            WORK,
            [around, means, body],
            |section, kernel| {
                let own = &sections[section as usize][kernel];
                [&eye.camera.group, &own.group, &eye.scene.group]
            },
        );
    }
}

/// Work of a pixel, in layer evaluations: steps along its directions.
const WORK: u64 = 5 * 12;

#[cfg(test)]
mod tests {
    use super::*;

    /// Known shares: 1 without a coat; for 1.5 the hemispherical reflectance is 0.0918 (d'Eon and Irving 2011, section 4).
    #[test]
    fn coats_let_light_in() {
        assert!((mean_transmittance(1.0) - 1.0).abs() < 1e-12);
        assert!((mean_transmittance(1.5) - (1.0 - 0.0918)).abs() < 1e-3);
    }
}
