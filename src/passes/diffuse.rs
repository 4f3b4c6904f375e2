//! Foam, spray, bubbles and dust: `shaders/diffuse/`.
//!
//! Each particle is a white sphere. It is placed where it is seen: before the liquid, or refracted by the liquid's first
//! surface. A tile with spheres looks around for the light that reaches them; then each sphere adds its coverage and its
//! radiance to the sums of its pixels. Sums of integers do not depend on the order. Refraction draws them over its rays.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, UVec2, Vec3, Vec4};
use wgpu::BindingResource::TextureView;

use super::mixture::Shares;
use super::scene_binding::SceneVariant;
use super::turbid::slab;
use super::view_passes::ViewPasses;
use crate::diffuse::Diffuse;
use crate::error::{Error, Limited, Result};
use crate::gpu::{self, Bound, Commands, Gpu, Span, TILE};
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
    /// 1 if the liquid lets light through.
    pub clear: u32,
    /// Share of light from everywhere outside that enters the liquid.
    pub mean_transmittance: f32,
    /// Radiance of which sums count shares.
    pub white: f32,
}

/// Threads of a workgroup.
const THREADS: u32 = 64;
/// Bytes of a placed sphere, of a tile's light, and of a pixel's sums in one layer.
const PLACED: u64 = 32;
const PROBE: u64 = 64;
const SUMS: u64 = 16;
/// Workgroups among which large spheres are divided.
const LARGE_GROUPS: u32 = 512;

/// The spheres of a frame on the device, and their sums.
#[derive(Debug)]
pub struct DiffuseImages {
    /// Each as large as one binding allows.
    chunks: Vec<Chunk>,
    /// By tile.
    nearest: wgpu::Buffer,
    probes: wgpu::Buffer,
    /// By pixel, in the air and in the liquid.
    sums: [wgpu::Buffer; 2],
    opaque: wgpu::Buffer,
    size: UVec2,
    uploaded: Arc<Diffuse>,
}

#[derive(Debug)]
struct Chunk {
    count: u32,
    spheres: wgpu::Buffer,
    traits: wgpu::Buffer,
    placed: wgpu::Buffer,
    large: wgpu::Buffer,
}

/// Draws the sums of the spheres.
#[derive(Debug)]
pub struct DiffusePass {
    place: wgpu::ComputePipeline,
    around: wgpu::ComputePipeline,
    sums: [wgpu::ComputePipeline; 3],
    /// Group 1 of placing and adding, by chunk, with its spheres.
    chunks: Vec<(u32, wgpu::Buffer, [Bound; 2])>,
    looks: Bound,
    tiles: u32,
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
        let is_same = |kept: &Self| kept.size == size && Arc::ptr_eq(&kept.uploaded, diffuse);
        if let Some(kept) = kept.filter(is_same) {
            return Ok(kept);
        }
        let pixels = u64::from(size.x) * u64::from(size.y);
        if SUMS * pixels > gpu.most_binding() {
            let problem = format!("binds no sums of {}x{} pixels", size.x, size.y);
            return Err(Error::Limit { adapter: gpu.adapter(), problem, of: Limited::Diffuse });
        }
        let tiles = u64::from(size.map(|n| n.div_ceil(TILE)).element_product());
        let most = (gpu.most_binding() / PLACED) as usize;
        let range = |start: usize| start..(start + most).min(diffuse.len());
        let chunks = (0..diffuse.len()).step_by(most);
        let sum = |label| buffer(gpu, label, SUMS * pixels);
        Ok(Self {
            chunks: chunks.map(|start| Chunk::new(gpu, diffuse, range(start))).collect(),
            nearest: buffer(gpu, "nearest spheres", 4 * tiles),
            probes: buffer(gpu, "light around spheres", PROBE * tiles),
            sums: [sum("spheres in the air"), sum("spheres in the liquid")],
            opaque: buffer(gpu, "opaque spheres", 8 * pixels),
            size,
            uploaded: diffuse.clone(),
        })
    }

    /// Sums of the spheres in the air and in the liquid.
    pub fn sums(&self) -> [wgpu::Buffer; 2] {
        self.sums.clone()
    }
}

impl Chunk {
    fn new(gpu: &Gpu, diffuse: &Diffuse, range: std::ops::Range<usize>) -> Self {
        let sphere = |i: usize| diffuse.positions[i].extend(diffuse.radii[i]);
        let spheres: Vec<Vec4> = range.clone().map(sphere).collect();
        let traits_of = |i: usize| {
            let opacity = (diffuse.opacity(i) * 65535.0).round() as u32;
            diffuse.kinds[i] as u32 | opacity << 2
        };
        let traits: Vec<u32> = range.clone().map(traits_of).collect();
        let count = range.len() as u64;
        Self {
            count: range.len() as u32,
            spheres: gpu.buffer_with("spheres", wgpu::BufferUsages::STORAGE, &spheres),
            traits: gpu.buffer_with("traits", wgpu::BufferUsages::STORAGE, &traits),
            placed: buffer(gpu, "placed spheres", PLACED * count),
            large: buffer(gpu, "large spheres", 4 + 4 * count),
        }
    }
}

fn buffer(gpu: &Gpu, label: &str, size: u64) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

impl Params {
    /// The parameters of spheres in a scene, whose liquid's particles have `radius`, m, seen by `camera`, whose origin is at
    /// `eye`.
    pub fn new(scene: &Scene, diffuse: &Diffuse, eye: DVec3, radius: f32) -> Self {
        let ior = scene.liquid.ior;
        Self {
            origin: (diffuse.origin - eye).as_vec3().to_array(),
            radius,
            albedos: diffuse.colors.map(|color| color.extend(0.0).to_array()),
            absorption: Shares::of_absorption(scene).uniform().to_array(),
            ior,
            count: 0,
            clear: u32::from(!scene.is_opaque()),
            mean_transmittance: slab::mean_transmittance(ior.into()) as f32,
            white: white(scene),
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
        let tiles = &eye.images.tiles;
        let written = gpu::storage_read_write(4);
        let bind_placing = |params: &wgpu::Buffer, chunk: &Chunk| {
            let bindings = [
                (gpu::uniform::<Params>(), params.as_entire_binding()),
                (gpu.layers(), TextureView(aggregates)),
                (gpu.layers(), TextureView(splashes)),
                (gpu::storage::<Vec4>(), chunk.spheres.as_entire_binding()),
                (gpu::storage_of(8), tiles.section(&tiles.liquid, 0)),
                (gpu::storage::<u32>(), chunk.traits.as_entire_binding()),
                (gpu::storage_read_write(PLACED), chunk.placed.as_entire_binding()),
                (written, images.nearest.as_entire_binding()),
                (gpu::storage_read_write(8), chunk.large.as_entire_binding()),
            ];
            gpu.bind("placed spheres", &bindings)
        };
        let bind_adding = |params: &wgpu::Buffer, chunk: &Chunk| {
            let [above, inside] = &images.sums;
            let bindings = [
                (gpu::uniform::<Params>(), params.as_entire_binding()),
                (gpu::storage_of(PLACED), chunk.placed.as_entire_binding()),
                (gpu::storage::<u32>(), images.nearest.as_entire_binding()),
                (gpu::storage_of(8), chunk.large.as_entire_binding()),
                (gpu::storage_of(PROBE), images.probes.as_entire_binding()),
                (gpu::storage_read_write(SUMS), above.as_entire_binding()),
                (gpu::storage_read_write(SUMS), inside.as_entire_binding()),
                (gpu::storage_read_write(8), images.opaque.as_entire_binding()),
            ];
            gpu.bind("sums of spheres", &bindings)
        };
        let of_chunk = |chunk: &Chunk| {
            let params = Params { count: chunk.count, ..params };
            let params = gpu.buffer_with("diffuse", gpu::UNIFORM, &[params]);
            let bound = [bind_placing(&params, chunk), bind_adding(&params, chunk)];
            (chunk.count, chunk.large.clone(), bound)
        };
        let chunks: Vec<_> = images.chunks.iter().map(of_chunk).collect();
        let uniform = gpu.buffer_with("diffuse", gpu::UNIFORM, &[params]);
        let looks = gpu.bind(
            "light around spheres",
            &[
                (gpu::uniform::<Params>(), uniform.as_entire_binding()),
                (gpu.layers(), TextureView(aggregates)),
                (gpu.layers(), TextureView(splashes)),
                (gpu::storage::<u32>(), images.nearest.as_entire_binding()),
                (gpu::storage_of(8), tiles.section(&tiles.liquid, 0)),
                (gpu::storage_read_write(PROBE), images.probes.as_entire_binding()),
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
            gpu.kernel(shader, Default::default(), entry, &layouts, constants)
        };
        let [placing, adding] = &chunks[0].2;
        let (plain, looking) =
            (constants(&eye.scene.variant, &[]), constants(&filtered, &[splash]));
        let placed = constants(&eye.scene.variant, &[splash]);
        let [place, around, small, cover, large] = gpu.pipelines([
            kernel("diffuse/place.wgsl", "place", placing, &placed),
            kernel("diffuse/around.wgsl", "look_around", &looks, &looking),
            kernel("diffuse/sums.wgsl", "add_small", adding, &plain),
            kernel("diffuse/sums.wgsl", "cover", adding, &plain),
            kernel("diffuse/sums.wgsl", "add_large", adding, &plain),
        ]);
        let lights = if scene.is_lit() { scene.lights.len() } else { 0 };
        let mut cleared = vec![images.nearest.clone(), images.opaque.clone()];
        cleared.extend(images.sums.clone());
        Self {
            place,
            around,
            sums: [small, cover, large],
            chunks,
            looks,
            tiles: images.size.map(|n| n.div_ceil(TILE)).element_product(),
            cleared,
            work: 16 + (solid_work * (1 + lights)) as u64,
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
            pass.set_pipeline(&self.place);
            for (count, _, [placing, _]) in &self.chunks {
                pass.set_bind_group(1, &placing.group, &[]);
                gpu::dispatch(pass, count.div_ceil(THREADS));
            }
        });
        let looks = u64::from(self.tiles * THREADS) * 12;
        run(looks, span.part(false, false), &|pass| {
            pass.set_pipeline(&self.around);
            pass.set_bind_group(1, &self.looks.group, &[]);
            gpu::dispatch(pass, self.tiles);
        });
        run(spheres * self.work, span.last(), &|pass| {
            let [small, cover, large] = &self.sums;
            for pipeline in [cover, small, large] {
                pass.set_pipeline(pipeline);
                for (count, _, [_, adding]) in &self.chunks {
                    pass.set_bind_group(1, &adding.group, &[]);
                    let is_small = std::ptr::eq(pipeline, small);
                    let groups = if is_small { count.div_ceil(THREADS) } else { LARGE_GROUPS };
                    gpu::dispatch(pass, groups);
                }
            }
        });
    }
}
