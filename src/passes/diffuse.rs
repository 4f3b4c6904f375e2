//! Foam, spray, bubbles and dust: `shaders/diffuse/`.
//!
//! Each particle is a white sphere. It is placed where it is seen: before the liquid, or refracted by the liquid's first
//! surface. Probes on the picture look around for the light that reaches the spheres near them; then each sphere adds its
//! coverage and its radiance to the sums of its pixels. Sums of integers do not depend on the order. Refraction draws them over
//! its rays, whose later parts see the cells of a grid (`diffuse/cells.rs`).

mod cells;

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, UVec2, Vec3, Vec4};
use wgpu::BindingResource::TextureView;
use wgpu::TextureViewDimension::D2;

use self::cells::Cells;
use super::Layers;
use super::mixture::Shares;
use super::scene_binding::SceneVariant;
use super::spheres::{SphereChunk, Spheres};
use super::turbid::slab;
use super::view_passes::ViewPasses;
use crate::diffuse::Diffuse;
use crate::error::{Error, Limited, Result};
use crate::gpu::{self, Bound, Commands, Gpu, Kernel, Span};
use crate::scene::{Light, Scene};

/// `Params` of `diffuse/particles.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// Origin of the particles relative to the eye, world axes, m.
    pub origin: [f32; 3],
    /// Radius of the liquid's particles, m.
    pub radius: f32,
    /// Albedo of each kind, with padding.
    pub albedos: [[f32; 4]; 4],
    /// Absorption of the liquid, 1/m; with several fluids, the scale of the mixture's.
    pub absorption: [f32; 3],
    /// Index of refraction of the liquid.
    pub ior: f32,
    /// Number of spheres.
    pub count: u32,
    /// Share of light from everywhere outside that enters the liquid.
    pub mean_transmittance: f32,
    /// Radiance of which sums count shares.
    pub white: f32,
    /// Padding.
    pub pad: u32,
    /// Corner of the cells relative to the eye, m.
    pub cells_first: [f32; 3],
    /// Side of a cell, m.
    pub cells_side: f32,
    /// Cells along each axis.
    pub cells_across: [u32; 3],
    /// Padding.
    pub pad_end: u32,
}

/// Threads of a workgroup.
pub(super) const THREADS: u32 = 64;
/// Bytes of a placed sphere, and of a pixel's sums in one layer.
const PLACED: u64 = 32;
const SUMS: u64 = 16;
/// Pixels along the side of a probe of the light around spheres, and its texels: those of `diffuse/particles.wgsl`.
const PROBE_SIDE: u32 = 16;
const PROBE_TEXELS: u32 = 5;
/// Units of optical depth in a pixel's sums, and the least that lets nothing through: those of `diffuse/pixels.wgsl`.
pub const DEPTH_UNITS: f32 = 16384.0;
pub const OPAQUE_DEPTH: f32 = 5.99;
/// Workgroups among which large spheres are divided.
pub(super) const LARGE_GROUPS: u32 = 512;

/// The spheres of a frame on the device, and their sums.
#[derive(Debug)]
pub struct DiffuseImages {
    spheres: Spheres,
    /// By chunk of the spheres.
    seen: Vec<Seen>,
    /// Disparities of the nearest spheres, by probe.
    nearest: wgpu::Buffer,
    /// Light around them.
    probes: wgpu::TextureView,
    /// By pixel, in the air and in the liquid.
    sums: [wgpu::Buffer; 2],
    opaque: wgpu::Buffer,
    size: UVec2,
    cells: Cells,
    cell_sums: wgpu::Buffer,
}

/// Where the spheres of a chunk are seen.
#[derive(Debug)]
struct Seen {
    placed: wgpu::Buffer,
    large: wgpu::Buffer,
}

/// Draws the sums of the spheres.
#[derive(Debug)]
pub struct DiffusePass {
    place: wgpu::ComputePipeline,
    around: wgpu::ComputePipeline,
    sums: [wgpu::ComputePipeline; 3],
    fill_cells: wgpu::ComputePipeline,
    light_cells: wgpu::ComputePipeline,
    /// Group 1 of placing, covering, adding and filling cells, by chunk, with its spheres.
    chunks: Vec<(u32, wgpu::Buffer, [Bound; 4])>,
    looks: Bound,
    cells: Bound,
    probes: u32,
    cell_count: u32,
    cleared: Vec<wgpu::Buffer>,
    /// Work of a sphere, in layer evaluations.
    work: u64,
}

impl DiffuseImages {
    /// Uploads the spheres of a frame for a picture of `size` pixels, or takes those that were kept, if they are the same.
    ///
    /// # Errors
    /// [`Error::Limit`] if the device cannot bind the sums of such a picture.
    pub fn new(gpu: &Gpu, diffuse: &Arc<Diffuse>, size: UVec2, kept: Option<Self>) -> Result<Self> {
        let is_same =
            |kept: &Self| kept.size == size && Arc::ptr_eq(&kept.spheres.diffuse, diffuse);
        if let Some(kept) = kept.filter(is_same) {
            return Ok(kept);
        }
        let pixels = u64::from(size.x) * u64::from(size.y);
        if SUMS * pixels > gpu.most_binding() {
            let problem = format!("binds no sums of {}x{} pixels", size.x, size.y);
            return Err(Error::Limit { adapter: gpu.adapter(), problem, of: Limited::Diffuse });
        }
        let probe_count = size.map(|n| n.div_ceil(PROBE_SIDE));
        let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::STORAGE_BINDING;
        let texels = probe_count * UVec2::new(PROBE_TEXELS, 1);
        let probes = gpu.texture("light around spheres", texels, 1, Layers::FORMAT, usage);
        let most = (gpu.most_binding() / PLACED) as usize;
        let spheres = Spheres::new(gpu, diffuse, most);
        let cells = Cells::new(diffuse, spheres.extent());
        let seen = |count: u64| Seen {
            placed: buffer(gpu, "placed spheres", PLACED * count),
            large: buffer(gpu, "large spheres", 4 + 4 * count),
        };
        let seen = spheres.chunks.iter().map(|chunk| seen(chunk.count.into())).collect();
        let sum = |label| buffer(gpu, label, SUMS * pixels);
        Ok(Self {
            spheres,
            seen,
            nearest: buffer(gpu, "nearest spheres", 4 * u64::from(probe_count.element_product())),
            probes: probes.create_view(&Default::default()),
            sums: [sum("spheres in the air"), sum("spheres in the liquid")],
            opaque: buffer(gpu, "opaque spheres", 8 * pixels),
            size,
            cells,
            cell_sums: buffer(gpu, "cells of spheres", cells.bytes()),
        })
    }

    /// Sums of the spheres in the air and in the liquid, by pixel, and their cells.
    pub fn sums(&self) -> [wgpu::Buffer; 3] {
        let [above, inside] = self.sums.clone();
        [above, inside, self.cell_sums.clone()]
    }

    /// Sums of the spheres in the air and in the liquid, by pixel.
    pub fn pixel_sums(&self) -> [wgpu::Buffer; 2] {
        self.sums.clone()
    }

    /// Where the cells lie relative to an eye: their corner, m, their side, m, and how many lie along each axis.
    pub fn placed_cells(&self, eye: DVec3) -> ([f32; 3], f32, [u32; 3]) {
        let Cells { first, side, across } = self.cells;
        ((first - eye).as_vec3().to_array(), side as f32, across.to_array())
    }

    /// Width and height of the picture, pixels.
    pub(super) fn size(&self) -> UVec2 {
        self.size
    }

    /// The number of spheres and group 1 of covering pixels, by chunk.
    pub(super) fn covered_chunks(&self, gpu: &Gpu, params: Params) -> Vec<(u32, Bound)> {
        let of_chunk = |(chunk, seen): (&SphereChunk, &Seen)| {
            let params = Params { count: chunk.count, ..params };
            let params = gpu.buffer_with("diffuse", gpu::UNIFORM, &[params]);
            (chunk.count, self.bind_covering(gpu, &params, seen))
        };
        self.spheres.chunks.iter().zip(&self.seen).map(of_chunk).collect()
    }

    fn bind_covering(&self, gpu: &Gpu, params: &wgpu::Buffer, seen: &Seen) -> Bound {
        let bindings = [
            (gpu::uniform::<Params>(), params.as_entire_binding()),
            (gpu::storage_read_write(8), self.opaque.as_entire_binding()),
            (gpu::storage_of(PLACED), seen.placed.as_entire_binding()),
            (gpu::storage_of(8), seen.large.as_entire_binding()),
        ];
        gpu.bind("covering spheres", &bindings)
    }

    /// The spheres.
    pub fn spheres(&self) -> &Spheres {
        &self.spheres
    }
}

/// Coverage of pixels with these sums, as `diffuse_of` in `refract/diffuse.wgsl`.
pub fn covered(sums: &[[u32; 4]]) -> Vec<f32> {
    let depths = sums.iter().map(|sums| sums[0] as f32 / DEPTH_UNITS);
    depths.map(|depth| if depth >= OPAQUE_DEPTH { 1.0 } else { 1.0 - (-depth).exp() }).collect()
}

fn buffer(gpu: &Gpu, label: &str, size: u64) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage: wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}

impl Params {
    /// The parameters of spheres in a scene, whose liquid's particles have `radius`, m, seen by `camera`, whose origin is at
    /// `eye`.
    pub fn new(scene: &Scene, images: &DiffuseImages, eye: DVec3, radius: f32) -> Self {
        let ior = scene.liquid.ior;
        let diffuse = &images.spheres.diffuse;
        let (cells_first, cells_side, cells_across) = images.placed_cells(eye);
        Self {
            origin: (diffuse.origin - eye).as_vec3().to_array(),
            radius,
            albedos: diffuse.colors.map(|color| color.extend(0.0).to_array()),
            absorption: Shares::of_absorption(scene).uniform().to_array(),
            ior,
            count: 0,
            mean_transmittance: slab::mean_transmittance(ior.into()) as f32,
            white: white(scene),
            cells_first,
            cells_side,
            cells_across,
            pad: 0,
            pad_end: 0,
        }
    }
}

/// About the radiance of white spheres in a scene; point lights count as if they were a metre away.
pub fn white(scene: &Scene) -> f32 {
    let power = |light: &Light| match light {
        Light::Sun { irradiance, .. } => *irradiance,
        Light::Point { intensity, .. } => *intensity,
    };
    let lights: Vec3 = scene.lights.iter().map(power).sum::<Vec3>() / std::f32::consts::PI;
    (scene.environment.mean() + lights).max_element().max(1e-6)
}

impl DiffusePass {
    /// Prepares the sums of the spheres that `eye` sees, of a liquid whose particles have `radius`, m.
    pub fn prepare(
        gpu: &Gpu,
        eye: &ViewPasses,
        scene: &Scene,
        params: Params,
        images: &DiffuseImages,
        solid_work: usize,
    ) -> Self {
        let splash = eye.splash_layers();
        let (aggregates, splashes) =
            (&eye.aggregate_layers().view, &splash.unwrap_or(eye.aggregate_layers()).view);
        let planes = eye.images.gbuffer.planes.create_view(&Default::default());
        let cell_sums = &images.cell_sums;
        let bind_placing = |params: &wgpu::Buffer, chunk: &SphereChunk, seen: &Seen| {
            let bindings = [
                (gpu::uniform::<Params>(), params.as_entire_binding()),
                (gpu.layers(), TextureView(aggregates)),
                (gpu.layers(), TextureView(splashes)),
                (gpu::storage::<Vec4>(), chunk.spheres.as_entire_binding()),
                (gpu::storage::<u32>(), chunk.traits.as_entire_binding()),
                (gpu::storage_read_write(PLACED), seen.placed.as_entire_binding()),
                (gpu::storage_read_write(4), images.nearest.as_entire_binding()),
                (gpu::storage_read_write(8), seen.large.as_entire_binding()),
            ];
            gpu.bind("placed spheres", &bindings)
        };
        let bind_adding = |params: &wgpu::Buffer, seen: &Seen| {
            let [above, inside] = &images.sums;
            let bindings = [
                (gpu::uniform::<Params>(), params.as_entire_binding()),
                (gpu::sampled(D2), TextureView(&images.probes)),
                (gpu::storage_of(PLACED), seen.placed.as_entire_binding()),
                (gpu::storage_of(8), seen.large.as_entire_binding()),
                (gpu::storage_read_write(SUMS), above.as_entire_binding()),
                (gpu::storage_read_write(SUMS), inside.as_entire_binding()),
                (gpu::storage_of(8), images.opaque.as_entire_binding()),
                (gpu::sampled(D2), TextureView(&planes)),
            ];
            gpu.bind("sums of spheres", &bindings)
        };
        let bind_filling = |params: &wgpu::Buffer, chunk: &SphereChunk| {
            let bindings = [
                (gpu::uniform::<Params>(), params.as_entire_binding()),
                (gpu::storage::<Vec4>(), chunk.spheres.as_entire_binding()),
                (gpu::storage::<u32>(), chunk.traits.as_entire_binding()),
                (gpu::storage_read_write(4), cell_sums.as_entire_binding()),
            ];
            gpu.bind("filled cells", &bindings)
        };
        let of_chunk = |(chunk, seen): (&SphereChunk, &Seen)| {
            let params = Params { count: chunk.count, ..params };
            let params = gpu.buffer_with("diffuse", gpu::UNIFORM, &[params]);
            let bound = [
                bind_placing(&params, chunk, seen),
                images.bind_covering(gpu, &params, seen),
                bind_adding(&params, seen),
                bind_filling(&params, chunk),
            ];
            (chunk.count, seen.large.clone(), bound)
        };
        let chunks: Vec<_> = images.spheres.chunks.iter().zip(&images.seen).map(of_chunk).collect();
        let uniform = gpu.buffer_with("diffuse", gpu::UNIFORM, &[params]);
        let looks = gpu.bind(
            "light around spheres",
            &[
                (gpu::uniform::<Params>(), uniform.as_entire_binding()),
                (gpu.layers(), TextureView(aggregates)),
                (gpu.layers(), TextureView(splashes)),
                (gpu::storage_of(4), images.nearest.as_entire_binding()),
                (gpu::storage_texture(Layers::FORMAT, D2), TextureView(&images.probes)),
            ],
        );
        let cells = gpu.bind(
            "lit cells",
            &[
                (gpu::uniform::<Params>(), uniform.as_entire_binding()),
                (gpu::sampled(D2), TextureView(&images.probes)),
                (gpu::storage_read_write(16), cell_sums.as_entire_binding()),
            ],
        );
        // Radiance along one direction stands for many around it.
        let filter_patterns = eye.scene.variant.solids > 0;
        let filtered = SceneVariant { filter_patterns, ..eye.scene.variant };
        let splash = ("SPLASH", f64::from(u8::from(splash.is_some())));
        let constants = |scene: &SceneVariant, own: &[(&'static str, f64)]| {
            [own, &scene.constants(), &eye.camera.constants()].concat()
        };
        let kernel = |shader: &str, entry: &str, bound: &Bound, constants: &[_]| {
            let layouts = [&eye.camera.layout, &bound.layout, &eye.scene.layout];
            Kernel::new(shader, Default::default(), entry, &layouts, constants)
        };
        let [placing, covering, adding, filling] = &chunks[0].2;
        let (plain, looking) =
            (constants(&eye.scene.variant, &[]), constants(&filtered, &[splash]));
        let clear = ("CLEAR", f64::from(u8::from(!scene.is_opaque())));
        let placed = constants(&eye.scene.variant, &[splash, clear]);
        let shown = ("SHOWN", f64::from(u8::from(eye.config().host)));
        let added = constants(&eye.scene.variant, &[shown]);
        let [place, around, small, cover, large, fill_cells, light_cells] = gpu.pipelines([
            kernel("diffuse/place.wgsl", "place", placing, &placed),
            kernel("diffuse/around.wgsl", "look_around", &looks, &looking),
            kernel("diffuse/sums.wgsl", "add_small", adding, &added),
            kernel("diffuse/cover.wgsl", "cover", covering, &eye.camera.constants()),
            kernel("diffuse/sums.wgsl", "add_large", adding, &added),
            kernel("diffuse/fill_cells.wgsl", "fill_cells", filling, &eye.camera.constants()),
            kernel("diffuse/cells.wgsl", "light_cells", &cells, &plain),
        ]);
        let mut cleared = [&images.nearest, &images.opaque, cell_sums].map(Clone::clone).to_vec();
        cleared.extend(images.sums.clone());
        Self {
            place,
            around,
            sums: [small, cover, large],
            fill_cells,
            light_cells,
            chunks,
            looks,
            cells,
            cell_count: images.cells.count(),
            probes: images.size.map(|n| n.div_ceil(PROBE_SIDE)).element_product(),
            cleared,
            work: 16 + (solid_work * (1 + scene.lights.len())) as u64,
        }
    }

    /// Records the sums.
    pub fn record(&self, commands: &mut Commands<'_>, eye: &ViewPasses, span: Span<'_>) {
        for buffer in &self.cleared {
            commands.encoder.clear_buffer(buffer, 0, None);
        }
        for (_, large, _) in &self.chunks {
            commands.encoder.clear_buffer(large, 0, Some(4));
        }
        let spheres: u64 = self.chunks.iter().map(|(count, ..)| u64::from(*count)).sum();
        let mut run = |work: u64, span: Span<'_>, draw: &dyn Fn(&mut wgpu::ComputePass<'_>)| {
            commands.reserve(work);
            let mut pass = commands.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("diffuse"),
                timestamp_writes: span.compute(),
            });
            pass.set_bind_group(0, &eye.camera.group, &[]);
            pass.set_bind_group(2, &eye.scene.group, &[]);
            draw(&mut pass);
        };
        run(spheres * self.work, span.first(), &|pass| {
            for (pipeline, which) in [(&self.place, 0), (&self.fill_cells, 3)] {
                pass.set_pipeline(pipeline);
                for (count, _, bound) in &self.chunks {
                    pass.set_bind_group(1, &bound[which].group, &[]);
                    gpu::dispatch(pass, count.div_ceil(THREADS));
                }
            }
        });
        let looks = u64::from(self.probes * THREADS) * 12;
        run(looks, span.part(false, false), &|pass| {
            pass.set_pipeline(&self.around);
            pass.set_bind_group(1, &self.looks.group, &[]);
            gpu::dispatch(pass, self.probes);
        });
        run(spheres * self.work, span.last(), &|pass| {
            let [small, cover, large] = &self.sums;
            for (pipeline, which, is_small) in
                [(cover, 1, false), (small, 2, true), (large, 2, false)]
            {
                pass.set_pipeline(pipeline);
                for (count, _, bound) in &self.chunks {
                    pass.set_bind_group(1, &bound[which].group, &[]);
                    let groups = if is_small { count.div_ceil(THREADS) } else { LARGE_GROUPS };
                    gpu::dispatch(pass, groups);
                }
            }
            pass.set_pipeline(&self.light_cells);
            pass.set_bind_group(1, &self.cells.group, &[]);
            gpu::dispatch(pass, self.cell_count.div_ceil(THREADS));
        });
    }
}
