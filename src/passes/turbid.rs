//! Light around a turbid liquid, and what slabs of it scatter: `shaders/turbid/`.
//!
//! Each pixel looks along a few directions from the first surface of the liquid and from the last; the mean over pixels
//! around it is the light there. Refraction reads it where a ray enters the liquid, and adds what the liquid on the
//! ray's way scatters: that of a level slab between these lights, by the table of [`slab`].

pub mod slab;

use bytemuck::{Pod, Zeroable};
use glam::UVec2;
use wgpu::BindingResource::TextureView;
use wgpu::TextureViewDimension::D2;

use super::Layers;
use super::mixture::{self, Shares};
use super::scene_binding::SceneVariant;
use super::tiles::TileLists;
use super::view_passes::ViewPasses;
use crate::gpu::{self, Bound, Commands, Gpu, Kernel, Span};
use crate::scene::Scene;

/// Format of the light: packed colours.
const LIGHT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

/// `Params` of `turbid/params.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// Absorption, 1/m; with several fluids, the scale of the mixture's absorption.
    pub absorption: [f32; 3],
    /// Radius of particles, m.
    pub radius: f32,
    /// Scattering, 1/m, likewise.
    pub scattering: [f32; 3],
    /// Index of refraction.
    pub ior: f32,
}

/// Images of turbid liquids.
#[derive(Debug)]
pub struct TurbidImages {
    /// Light on the first surface at each pixel, on the last, and of a wet solid.
    pub light: wgpu::Texture,
    /// Means over 4×4 pixels.
    means: wgpu::Texture,
    /// Light that slabs scatter.
    pub table: wgpu::Texture,
    /// Index and anisotropy of the table.
    optics: (f32, f32),
}

/// Draws the light around a turbid liquid.
#[derive(Debug)]
pub struct Turbid {
    tiles: TileLists,
    around: wgpu::ComputePipeline,
    average: wgpu::ComputePipeline,
    spread: wgpu::ComputePipeline,
    /// Group 1 of these, by section of the tiles.
    sections: Vec<[Bound; 3]>,
}

/// Light of no liquid.
pub fn no_light(gpu: &Gpu) -> wgpu::TextureView {
    let usage = wgpu::TextureUsages::TEXTURE_BINDING;
    gpu.texture("no light", UVec2::ONE, 1, LIGHT, usage).create_view(&Default::default())
}

impl TurbidImages {
    /// Creates the images of a picture of `size` pixels of a scene.
    pub fn new(gpu: &Gpu, size: UVec2, scene: &Scene) -> Self {
        let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING;
        Self {
            light: gpu.texture("light on the liquid", size, 1, LIGHT, usage),
            means: gpu.texture("means of light", size, 1, LIGHT, usage),
            table: create_table(gpu, optics(scene)),
            optics: optics(scene),
        }
    }

    /// Replaces the table, if it is not the scene's.
    pub fn update(&mut self, gpu: &Gpu, scene: &Scene) {
        if self.optics != optics(scene) {
            self.optics = optics(scene);
            self.table = create_table(gpu, self.optics);
        }
    }
}

/// Index and anisotropy.
fn optics(scene: &Scene) -> (f32, f32) {
    (scene.liquid.ior, mixture::anisotropy(scene))
}

fn create_table(gpu: &Gpu, (ior, g): (f32, f32)) -> wgpu::Texture {
    let texels = slab::Table::new(ior.into(), g.into()).texture();
    let size = UVec2::new(slab::THICKNESSES as u32, (2 * slab::COSINES * slab::ALBEDOS) as u32);
    let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
    let table = gpu.texture("slabs", size, 1, Layers::FORMAT, usage);
    let layout = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(size.x * size_of::<[f32; 4]>() as u32),
        rows_per_image: None,
    };
    let bytes = bytemuck::cast_slice(&texels);
    gpu.queue.write_texture(table.as_image_copy(), bytes, layout, table.size());
    table
}

impl Params {
    /// The parameters of a scene whose particles have `radius`, m.
    pub fn new(scene: &Scene, radius: f32) -> Self {
        Self {
            absorption: Shares::of_absorption(scene).uniform().to_array(),
            radius,
            scattering: Shares::of_scattering(scene).uniform().to_array(),
            ior: scene.liquid.ior,
        }
    }
}

impl Turbid {
    /// Prepares the light around the liquid that `eye` shows, whose particles have `radius`, m.
    pub fn prepare(
        gpu: &Gpu,
        eye: &ViewPasses,
        scene: &Scene,
        radius: f32,
        images: &TurbidImages,
    ) -> Self {
        let params = gpu.buffer_with("turbid", gpu::UNIFORM, &[Params::new(scene, radius)]);
        let view = |texture: &wgpu::Texture| texture.create_view(&Default::default());
        let [light, means, table] = [&images.light, &images.means, &images.table].map(view);
        let splash = eye.splash_layers();
        let (aggregates, splashes) =
            (&eye.aggregate_layers().view, &splash.unwrap_or(eye.aggregate_layers()).view);
        let tiles = &eye.images.tiles;
        let read = gpu::sampled(D2);
        let of_section = |section| {
            let shared = [
                (gpu::uniform::<Params>(), params.as_entire_binding()),
                (gpu.layers(), TextureView(aggregates)),
                (gpu.layers(), TextureView(splashes)),
                (read, TextureView(&eye.images.mixture.view)),
                (gpu::storage_of(8), tiles.section(&tiles.liquid, section)),
            ];
            let found = [
                (read, TextureView(&eye.images.scattering.view)),
                (read, TextureView(&table)),
                (gpu::storage_texture(LIGHT, D2), TextureView(&light)),
            ];
            let from_to = |from, to| {
                let images = [
                    (gpu::sampled_integers(), TextureView(from)),
                    (gpu::storage_texture(LIGHT, D2), TextureView(to)),
                ];
                gpu.bind("light on the liquid", &[&shared[..], &images].concat())
            };
            [
                gpu.bind("light around", &[&shared[..], &found].concat()),
                from_to(&light, &means),
                from_to(&means, &light),
            ]
        };
        let sections: Vec<_> = tiles.sections().map(of_section).collect();
        let on = |on: bool| f64::from(u8::from(on));
        let splash = ("SPLASH", on(splash.is_some()));
        let mixtures = [
            ("MIXTURE", on(Shares::of_absorption(scene).are_mixed())),
            ("SCATTERING_MIXTURE", on(Shares::of_scattering(scene).are_mixed())),
        ];
        // Radiance along one direction stands for many around it.
        let filter_patterns = eye.scene.variant.solids > 0;
        let scene_variant = SceneVariant { filter_patterns, ..eye.scene.variant };
        let shared = [&[splash][..], &eye.camera.constants(), &scene_variant.constants()].concat();
        let kernel = |shader: &str, entry: &str, bound: &Bound, own: &[(&'static str, f64)]| {
            let layouts = [&eye.camera.layout, &bound.layout, &eye.scene.layout];
            Kernel::new(shader, Default::default(), entry, &layouts, &[own, &shared].concat())
        };
        let [found, averaged, _] = &sections[0];
        let [around, average, spread] = gpu.pipelines([
            kernel("turbid/around.wgsl", "look_around", found, &mixtures),
            kernel("turbid/means.wgsl", "average", averaged, &[]),
            kernel("turbid/means.wgsl", "spread", averaged, &[]),
        ]);
        Self { tiles: tiles.clone(), around, average, spread, sections }
    }

    /// Records the light.
    pub fn record(&self, commands: &mut Commands<'_>, eye: &ViewPasses, span: Span<'_>) {
        let Self { tiles, around, average, spread, sections } = self;
        tiles.run_on_liquid(
            commands,
            ("turbid", span),
            WORK,
            [around, average, spread],
            |section, kernel| {
                let own = &sections[section as usize][kernel];
                [&eye.camera.group, &own.group, &eye.scene.group]
            },
        );
    }
}

/// Work of a pixel, in layer evaluations: steps along its directions, and the solids.
const WORK: u64 = 3 * 12;
