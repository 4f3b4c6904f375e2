//! Shadows of foam, spray and bubbles: the optical depth from each light on, in the columns of a grid of its own.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use super::spheres::{SphereChunk, Spheres};
use crate::gpu::{self, Bound, Commands, Gpu, Kernel, Span};
use crate::scene::{Light, MAX_LIGHTS};

/// `LightGrid` of `common/light_grid.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct LightGridData {
    /// Axes: along the sides of the grid and away from the light. Of a sun, in shares of the grid per metre.
    pub right: [f32; 3],
    /// Columns along a side.
    pub columns: u32,
    /// The second axis.
    pub up: [f32; 3],
    /// Word of the first column.
    pub first: u32,
    /// The third axis.
    pub away: [f32; 3],
    /// Binary logarithm of a lamp's least distance, m.
    pub near: f32,
    /// Origin relative to the eye, m.
    pub origin: [f32; 3],
    /// Shares of the grid per unit of that logarithm; 0 for a sun, negative for an octahedron.
    pub scale: f32,
}

/// `ShadowParams` of `sphere_shadows.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ShadowParams {
    /// Origin of the particles relative to that of the grids, m.
    pub origin: [f32; 3],
    /// Number of spheres.
    pub count: u32,
    /// Number of lights.
    pub lights: u32,
    /// Padding.
    pub pad: [u32; 3],
    /// Each light's grid.
    pub grids: [LightGridData; MAX_LIGHTS],
}

/// Threads of a workgroup.
const THREADS: u32 = 64;

/// Slices of a column: `LIGHT_SLICES` of `common/light_grid.wgsl`.
pub const SLICES: u32 = 32;

/// Least cosine between the directions to the middle and to a corner of the spheres' box at which a lamp's columns lie in a
/// frustum; those of nearer lamps lie around it.
const WIDEST: f64 = 0.5;

/// Fewest and most columns along a side.
const COLUMNS: [f64; 2] = [8.0, 128.0];

/// The grids of all lights of a frame, and the passes that fill them.
#[derive(Debug)]
pub struct Shadows {
    /// Words of the columns of all grids.
    pub depths: wgpu::Buffer,
    grids: Vec<LightGrid>,
    shade: wgpu::ComputePipeline,
    sum: wgpu::ComputePipeline,
    /// By chunk of the spheres, with its number of them.
    chunks: Vec<(u32, Bound)>,
}

/// Where a light's columns lie in world space.
#[derive(Debug, Clone, Copy)]
pub struct LightGrid {
    origin: DVec3,
    /// To the right, up, and away from the light.
    axes: [DVec3; 3],
    columns: u32,
    first: u32,
    /// A lamp's least distance, as a binary logarithm, and shares of the grid per unit of it.
    distances: [f64; 2],
}

impl LightGrid {
    /// The grid of a light through a box.
    fn new(light: &Light, [low, high]: [DVec3; 2], columns: u32, first: u32) -> Self {
        let corner = |i: usize| {
            let side = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
            DVec3::new(side(0), side(1), side(2))
        };
        match *light {
            Light::Sun { direction, .. } => {
                let away = direction.as_dvec3().normalize_or(DVec3::NEG_Y);
                let (right, up) = away.any_orthonormal_pair();
                let mut axes = [right, up, away];
                let mut origin = DVec3::ZERO;
                for axis in &mut axes {
                    let along = (0..8).map(|i| corner(i).dot(*axis));
                    let least = along.clone().fold(f64::INFINITY, f64::min);
                    let most = along.fold(f64::NEG_INFINITY, f64::max);
                    origin += least * *axis;
                    *axis /= (most - least).max(f64::MIN_POSITIVE);
                }
                Self { origin, axes, columns, first, distances: [0.0; 2] }
            }
            Light::Point { position, .. } => {
                let away = (0.5 * (low + high) - position).normalize_or(DVec3::NEG_Y);
                let (right, up) = away.any_orthonormal_pair();
                let to = |i: usize| corner(i) - position;
                let cosine = (0..8).map(|i| to(i).normalize_or_zero().dot(away));
                if cosine.fold(1.0, f64::min) > WIDEST {
                    let largest = |f: &dyn Fn(usize) -> f64| (0..8).map(f).fold(0.0, f64::max);
                    let far = largest(&|i| to(i).dot(away));
                    let near = far - largest(&|i| far - to(i).dot(away));
                    let tangent =
                        |axis: DVec3| largest(&|i| (to(i).dot(axis) / to(i).dot(away)).abs());
                    let axes = [right / tangent(right), up / tangent(up), away];
                    let distances = [near.log2(), (far / near).log2().max(1e-6).recip()];
                    return Self { origin: position, axes, columns, first, distances };
                }
                let far = (0..8).map(|i| to(i).length()).fold(0.0, f64::max);
                let nearest = position.distance(position.clamp(low, high));
                let near = nearest.max(1e-3 * far).log2();
                let scale = -(far.log2() - near).max(1e-6).recip();
                let axes = [right, up, away];
                Self { origin: position, axes, columns, first, distances: [near, scale] }
            }
        }
    }

    /// Its shape in `common/light_grid.wgsl`: of a sun a box, of a lamp a frustum or an octahedron.
    pub fn shape(&self) -> u32 {
        match self.distances[1] {
            0.0 => 1,
            scale if scale > 0.0 => 2,
            _ => 3,
        }
    }

    /// The grid relative to an eye.
    pub fn data(&self, eye: DVec3) -> LightGridData {
        let Self { origin, axes, columns, first, distances } = *self;
        let [right, up, away] = axes.map(|axis| axis.as_vec3().to_array());
        let [near, scale] = distances.map(|x| x as f32);
        let origin = (origin - eye).as_vec3().to_array();
        LightGridData { right, columns, up, first, away, near, origin, scale }
    }
}

impl Shadows {
    /// Prepares the grids of the lights; takes the memory of those before, if they have this size.
    pub fn prepare(gpu: &Gpu, lights: &[Light], spheres: &Spheres, kept: Option<Self>) -> Self {
        let extent = spheres.extent();
        let [least, most] = COLUMNS;
        let columns =
            (2.0 * (spheres.diffuse.len() as f64).sqrt()).ceil().clamp(least, most) as u32;
        let each = columns * columns * SLICES;
        let grids = (0..).zip(lights);
        let grids: Vec<_> =
            grids.map(|(i, light)| LightGrid::new(light, extent, columns, i * each)).collect();
        let bytes = 4 * u64::from(each) * grids.len() as u64;
        let depths = kept
            .map(|kept| kept.depths)
            .filter(|depths| depths.size() == bytes)
            .unwrap_or_else(|| {
                gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("shadows of spheres"),
                    size: bytes,
                    usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                })
            });
        let mut params = ShadowParams { lights: grids.len() as u32, ..Zeroable::zeroed() };
        for (data, grid) in params.grids.iter_mut().zip(&grids) {
            *data = grid.data(spheres.diffuse.origin);
        }
        let of_chunk = |chunk: &SphereChunk| {
            let mut params = params;
            params.count = chunk.count;
            let params = gpu.buffer_with("shadows", gpu::UNIFORM, &[params]);
            let bindings = [
                (gpu.branching::<ShadowParams>(), params.as_entire_binding()),
                (gpu::storage_of(16), chunk.spheres.as_entire_binding()),
                (gpu::storage::<u32>(), chunk.traits.as_entire_binding()),
                (gpu::storage_read_write(4), depths.as_entire_binding()),
            ];
            (chunk.count, gpu.bind("shadows of spheres", &bindings))
        };
        let chunks: Vec<_> = spheres.chunks.iter().map(of_chunk).collect();
        let layout = &chunks[0].1.layout;
        let kernel = |entry: &str| {
            Kernel::new("sphere_shadows.wgsl", Default::default(), entry, &[layout], &[])
        };
        let [shade, sum] = gpu.pipelines([kernel("shade_columns"), kernel("sum_columns")]);
        Self { depths, grids, shade, sum, chunks }
    }

    /// The grid of each light.
    pub fn grids(&self) -> &[LightGrid] {
        &self.grids
    }

    /// Records the filling of the grids.
    pub fn record(&self, commands: &mut Commands<'_>, span: Span<'_>) {
        commands.encoder.clear_buffer(&self.depths, 0, None);
        let spheres: u64 = self.chunks.iter().map(|(count, _)| u64::from(*count)).sum();
        commands.reserve(spheres * self.grids.len() as u64);
        let mut pass = commands.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("sphere shadows"),
            timestamp_writes: span.compute(),
        });
        pass.set_pipeline(&self.shade);
        for (count, bound) in &self.chunks {
            pass.set_bind_group(0, &bound.group, &[]);
            gpu::dispatch(&mut pass, count.div_ceil(THREADS) * self.grids.len() as u32);
        }
        pass.set_pipeline(&self.sum);
        let columns = (self.depths.size() / u64::from(4 * SLICES)) as u32;
        gpu::dispatch(&mut pass, columns.div_ceil(THREADS));
    }
}
