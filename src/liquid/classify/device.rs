//! Classification on the device: `shaders/classify/`.
//!
//! A counting sort builds the same uniform grid as on the CPU. Then one thread per member sums over its
//! neighbours, finds the eigenvectors of their covariance by Jacobi rotations, and writes the member's
//! shape, which is read back. Within a cell members keep file order, so that the result does not depend
//! on scheduling.
//!
//! Sums have 32 bits, relative to the member and in units of h. Compared with the tree's 64-bit sums,
//! centres and axes are within 10⁻⁴ r, and the class differs only where the density is within 10⁻⁵ of
//! the threshold. The host moves the splats of the surface; their centres are then within 10⁻³ r, except for the few
//! where an iso-surface is only just found or not.

use std::sync::{Mutex, PoisonError};

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use rayon::prelude::*;

use super::grid::{self, Layout};
use super::surface::{self, Search};
use super::{Cloud, Splats, moments};
use crate::error::{Error, Limited, Result};
use crate::gpu::{self, Gpu};
#[cfg(not(target_arch = "wasm32"))]
use crate::liquid::particles::Particles;
use crate::settings::{Classify, Kernel};

/// Workgroup size of the sorting kernels, as in the shaders.
pub const SORTING: u32 = 256;
/// Workgroup size of `classify/shape.wgsl`.
const SHAPING: u32 = 64;
/// Cells per block of the prefix sum, as in `classify/sums.wgsl`.
pub const BLOCK: u32 = 2048;

/// Largest size of a frame's results, bytes, at which its buffers are kept for the next frame.
const KEPT: u64 = 256 << 20;

/// `Params` of `shaders/classify/params.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Params {
    /// Minimum corner of the grid, m.
    pub least: [f32; 3],
    /// Inverse cell width, 1/m.
    pub per_cell: f32,
    /// Maximum corner of the grid, m.
    pub greatest: [f32; 3],
    /// Number of members.
    pub members: u32,
    /// Cells along each axis.
    pub counts: [u32; 3],
    /// Number of cells.
    pub cells: u32,
    /// Neighbourhood radius h, in r.
    pub support: f32,
    /// Summed weight below which a member is a splash.
    pub least_weight: f32,
    /// Summed weight inside a body at rest.
    pub density_at_rest: f32,
    /// `k_r`.
    pub max_ratio: f32,
    /// 1 for [`Kernel::Volume`].
    pub volume_kernel: u32,
    /// Short semi-axis of fitted kernels, in r.
    pub short_axis: f32,
    /// Longest semi-axis of fitted kernels, in r.
    pub long_axis: f32,
    /// Radius of a splash, in r.
    pub splash_radius: f32,
    /// Sum of the squared cell counts above which the members are a crowd.
    pub most_squares: f32,
    /// Padding to a multiple of 16 bytes.
    pub pad: [u32; 3],
}

/// `Shaped` of `shaders/classify/shape.wgsl`: the device's result for one member.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Shaped {
    /// Mean of the neighbours from the member, m.
    pub mean: [f32; 3],
    /// Density relative to that inside a body at rest.
    pub density: f32,
    /// `A_xx, A_yy, A_zz`, m.
    pub diagonal: [f32; 3],
    /// [`Shaped::SPLASH`], [`Shaped::SURROUNDED`].
    pub flags: u32,
    /// `A_xy, A_xz, A_yz`, m.
    pub off_diagonal: [f32; 3],
    /// Members within h, including itself.
    pub count: u32,
}

impl Shaped {
    /// Flag: the member is a splash.
    pub const SPLASH: u32 = 1;
    /// Flag: the member is surrounded by liquid.
    pub const SURROUNDED: u32 = 2;
}

/// `Sum` of `shaders/classify/sums.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Sum {
    /// Members in a block of cells; after the scan, members in all preceding blocks.
    pub count: u32,
    /// Sum of the squared cell counts.
    pub squares: f32,
}

/// Classification on a device. Threads may share it; it serves one call at a time.
#[derive(Debug)]
pub struct Classifier {
    gpu: Gpu,
    count: wgpu::ComputePipeline,
    scan: [wgpu::ComputePipeline; 3],
    order: [wgpu::ComputePipeline; 2],
    shape: wgpu::ComputePipeline,
    params: wgpu::Buffer,
    /// Buffers of the largest frame so far.
    buffers: Mutex<Option<Buffers>>,
}

impl Classifier {
    /// Compiles the pipelines.
    ///
    /// # Errors
    /// [`Error::Limit`] if the device has less than WebGPU's default limits for compute shaders.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let limits = gpu.device.limits();
        let enough = limits.max_storage_buffers_per_shader_stage >= 8
            && limits.max_compute_invocations_per_workgroup >= SORTING
            && limits.max_compute_workgroup_size_x >= SORTING
            && limits.max_compute_workgroup_storage_size >= 2 * 4 * SORTING
            && limits.max_compute_workgroups_per_dimension >= gpu::ROW;
        if !enough {
            let problem = "cannot classify: its limits for compute shaders are below WebGPU's";
            return Err(Error::Limit {
                adapter: gpu.adapter(),
                problem: problem.into(),
                of: Limited::Classify,
            });
        }
        let read = |bytes| gpu::storage_of(bytes);
        let write = |bytes| gpu::storage_read_write(bytes);
        let layout = |bindings: &[wgpu::BindingType]| {
            let params = [gpu::storage::<Params>()];
            let bindings = [&params, bindings].concat();
            gpu.layout("classify", wgpu::ShaderStages::COMPUTE, &bindings)
        };
        let pipeline = |file: &str, entry: &str, layout: &wgpu::BindGroupLayout| {
            gpu::compute_pipeline(gpu, file, entry, &[layout], &[])
        };
        let counting = layout(&[read(16), write(8), write(4)]);
        let scanning = layout(&[read(4), write(8), write(4)]);
        let ordering =
            layout(&[read(16), read(8), read(4), read(8), write(4), write(8), write(16)]);
        let shaping = layout(&[read(4), read(16), read(8), read(8), write(48)]);
        Ok(Self {
            count: pipeline("classify/count.wgsl", "count", &counting),
            scan: ["add_blocks", "add_sums", "begin_cells"]
                .map(|entry| pipeline("classify/scan.wgsl", entry, &scanning)),
            order: ["scatter", "arrange"]
                .map(|entry| pipeline("classify/order.wgsl", entry, &ordering)),
            shape: pipeline("classify/shape.wgsl", "shape", &shaping),
            params: gpu::uniform_buffer::<Params>(gpu, "classify"),
            buffers: Mutex::default(),
            gpu: gpu.clone(),
        })
    }

    /// As [`super::classify`], on the device.
    ///
    /// Falls back to the CPU for frames without a grid ([`Cloud::has_grid`]) and for frames that exceed
    /// the device's limits: at 48 bytes per particle in one binding, 128 MiB hold 2.8 million.
    ///
    /// # Errors
    /// As [`Gpu::check`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn classify(
        &self,
        particles: &Particles,
        default_radius: f32,
        settings: &Classify,
    ) -> Result<Splats> {
        self.classify_cloud(&Cloud::new(particles, default_radius), settings)
    }

    /// As [`Classifier::classify`].
    ///
    /// # Errors
    /// As [`Gpu::check`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn classify_cloud(&self, cloud: &Cloud, settings: &Classify) -> Result<Splats> {
        pollster::block_on(self.finish(cloud, settings))
    }

    /// As `Classifier::classify_cloud`, for code that browsers and other programs share: waiting yields in a browser
    /// and blocks elsewhere.
    ///
    /// # Errors
    /// As [`Gpu::check`].
    pub async fn finish(&self, cloud: &Cloud, settings: &Classify) -> Result<Splats> {
        match self.finish_shapes(cloud, settings).await? {
            Some(shaped) => Ok(cloud.splats_of(&shaped, settings)),
            None => Ok(cloud.classify(settings)),
        }
    }

    /// Returns the result for each member, in order; `None` if the device cannot classify the cloud.
    ///
    /// # Errors
    /// As [`Gpu::check`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn shaped(&self, cloud: &Cloud, settings: &Classify) -> Result<Option<Vec<Shaped>>> {
        pollster::block_on(self.finish_shapes(cloud, settings))
    }

    /// As `Classifier::shaped`; waits as [`Classifier::finish`].
    #[expect(
        clippy::await_holding_lock,
        reason = "outside of browsers nothing is awaited, and in one a single task classifies at a time"
    )]
    async fn finish_shapes(
        &self,
        cloud: &Cloud,
        settings: &Classify,
    ) -> Result<Option<Vec<Shaped>>> {
        let Some(layout) = Layout::of(&cloud.members, cloud.radius, settings.support) else {
            return Ok(None);
        };
        let (members, cells) = (cloud.members.len() as u64, layout.cells() as u64);
        let limits = self.gpu.device.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        if size_of::<Shaped>() as u64 * (members + 1) > most || 4 * (cells + 1) > most {
            return Ok(None);
        }
        let params = params(&layout, cloud, settings);
        let places: Vec<[f32; 4]> = cloud
            .members
            .par_iter()
            .map(|m| [m.position[0], m.position[1], m.position[2], m.radius])
            .collect();

        // No rayon call while this is locked: it might run another task that locks it too.
        let mut kept = self.buffers.lock().unwrap_or_else(PoisonError::into_inner);
        let old = kept.take();
        let (most_members, most_cells) = old.as_ref().map_or((0, 0), |b| (b.members, b.cells));
        let old = old.filter(|b| b.members >= members && b.cells >= cells);
        // Spare room, as the next frame may have slightly more.
        let room = |count: u64, bytes: u64| (count + count / 8).min(most / bytes - 1);
        let (each, cell) = (size_of::<Shaped>() as u64, size_of::<u32>() as u64);
        let buffers = match old {
            Some(old) => Some(old),
            None => {
                let members = room(members, each).max(most_members);
                Buffers::new(&self.gpu, members, room(cells, cell).max(most_cells)).await
            }
        };
        let Some(buffers) = buffers else { return Ok(None) };
        let submission = self.submit(&buffers, &params, &places);
        let bytes = Buffers::read_bytes(members);
        let (shaped, all) = gpu::read_mapped(&self.gpu, &buffers.staging, bytes, submission, |b| {
            let (all, shaped) = b.split_at(size_of::<Sum>());
            let all: Sum = bytemuck::pod_read_unaligned(all);
            (bytemuck::pod_collect_to_vec::<u8, Shaped>(shaped), all)
        })
        .await?;
        // Large buffers are released, for drawing needs device memory too.
        *kept = Some(buffers).filter(|buffers| buffers.members * each <= KEPT);
        Ok((all.squares <= params.most_squares).then_some(shaped))
    }

    /// Records and submits all kernels and the copy of their results.
    fn submit(
        &self,
        buffers: &Buffers,
        params: &Params,
        places: &[[f32; 4]],
    ) -> wgpu::SubmissionIndex {
        let (members, cells) = (u64::from(params.members), u64::from(params.cells));
        let Buffers { places: at, cell_of, counts, sums, starts, came, order, sorted, .. } =
            buffers;
        let gpu = &self.gpu;
        gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(params));
        gpu.queue.write_buffer(at, 0, bytemuck::cast_slice(places));

        let group = |pipeline: &wgpu::ComputePipeline, buffers: &[&wgpu::Buffer]| {
            let all = std::iter::once(&self.params).chain(buffers.iter().copied());
            let resources: Vec<_> = all.map(wgpu::Buffer::as_entire_binding).collect();
            gpu::bind_group(gpu, "classify", &pipeline.get_bind_group_layout(0), &resources)
        };
        let counting = group(&self.count, &[at, cell_of, counts]);
        let scanning = group(&self.scan[0], &[counts, sums, starts]);
        let ordering = group(&self.order[0], &[at, cell_of, starts, sums, came, order, sorted]);
        let shaping = group(&self.shape, &[starts, sorted, order, sums, &buffers.shaped]);

        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.clear_buffer(counts, 0, None);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("classify"),
            timestamp_writes: None,
        });
        let mut run = |pipeline, group: &wgpu::BindGroup, groups: u32| {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, group, &[]);
            gpu::dispatch(&mut pass, groups);
        };
        let sorters = params.members.div_ceil(SORTING);
        let blocks = blocks(cells);
        run(&self.count, &counting, sorters);
        run(&self.scan[0], &scanning, blocks as u32);
        run(&self.scan[1], &scanning, 1);
        run(&self.scan[2], &scanning, blocks as u32);
        run(&self.order[0], &ordering, sorters);
        run(&self.order[1], &ordering, sorters);
        run(&self.shape, &shaping, params.members.div_ceil(SHAPING));
        drop(pass);
        let sum = size_of::<Sum>() as u64;
        encoder.copy_buffer_to_buffer(sums, sum * blocks, &buffers.staging, 0, sum);
        let shaped = size_of::<Shaped>() as u64 * members;
        encoder.copy_buffer_to_buffer(&buffers.shaped, 0, &buffers.staging, sum, shaped);
        gpu.queue.submit([encoder.finish()])
    }
}

/// Blocks of the prefix sum, which has one entry more than there are cells.
fn blocks(cells: u64) -> u64 {
    cells / u64::from(BLOCK) + 1
}

fn params(layout: &Layout, cloud: &Cloud, settings: &Classify) -> Params {
    let at_rest = moments::density_at_rest(settings.support.into());
    let members = cloud.members.len();
    let crowd = grid::most_shared(settings.support) * members as f64;
    Params {
        least: layout.min.to_array(),
        per_cell: layout.per_cell,
        greatest: layout.max.to_array(),
        members: members as u32,
        counts: layout.counts.to_array(),
        cells: layout.cells() as u32,
        support: settings.support,
        least_weight: (f64::from(settings.splash_density) * at_rest) as f32,
        density_at_rest: at_rest as f32,
        max_ratio: settings.max_ratio.max(1.0),
        volume_kernel: u32::from(settings.kernel == Kernel::Volume),
        short_axis: settings.short_axis,
        long_axis: settings.long_axis,
        splash_radius: settings.splash_radius,
        most_squares: crowd as f32,
        pad: [0; 3],
    }
}

impl Cloud {
    /// Builds splats from the device's results; shapes from the file replace computed ones. The refinement of the
    /// surface is the host's.
    fn splats_of(&self, shaped: &[Shaped], settings: &Classify) -> Splats {
        use rayon::iter::Either;
        let grid = surface::refines(settings).then(|| self.grid(settings)).flatten();
        let splat = |(member, shaped): (&super::Member, &Shaped)| {
            if shaped.flags & Shaped::SPLASH != 0 {
                return Either::Left(member.splash(settings, self.shift));
            }
            let surrounded = shaped.flags & Shaped::SURROUNDED != 0;
            if let Some(ellipsoid) = self.given(member) {
                let splat = member.given(ellipsoid, self.shift);
                return Either::Right((splat.buried(surrounded), None));
            }
            let [mean, diagonal, off_diagonal] =
                [shaped.mean, shaped.diagonal, shaped.off_diagonal]
                    .map(|v| DVec3::from_array(v.map(f64::from)));
            let centre = member.position().as_dvec3() + f64::from(settings.smoothing) * mean;
            let splat =
                member.splat(centre - self.shift, moments::symmetric(diagonal, off_diagonal));
            let h = f64::from(settings.support) * f64::from(member.radius);
            let mean = surface::movable(mean / h, shaped.count, surrounded, settings);
            Either::Right((splat.buried(surrounded), mean))
        };
        let search = grid.map(Search::Grid);
        let shaped: Vec<_> = self.members.par_iter().zip(shaped).map(splat).collect();
        self.splats(shaped.into_iter(), search.as_ref())
    }
}

/// Buffers for one frame: 100 bytes per member and 8 per cell on the device, and 48 per member in
/// host-visible memory.
#[derive(Debug)]
struct Buffers {
    /// Capacity in members.
    members: u64,
    /// Capacity in cells.
    cells: u64,
    /// Position and radius of each member.
    places: wgpu::Buffer,
    /// Cell of each member, and its arrival rank in the cell.
    cell_of: wgpu::Buffer,
    /// Members in each cell.
    counts: wgpu::Buffer,
    /// [`Sum`] of each block of cells, then the total.
    sums: wgpu::Buffer,
    /// First sorted index of each cell.
    starts: wgpu::Buffer,
    /// Members by cell, in arrival order.
    came: wgpu::Buffer,
    /// Members by cell, in file order, with their cells.
    order: wgpu::Buffer,
    /// Positions and radii by cell, in file order.
    sorted: wgpu::Buffer,
    /// Results, in file order.
    shaped: wgpu::Buffer,
    /// Readback of the total [`Sum`] and of `shaped`.
    staging: wgpu::Buffer,
}

impl Buffers {
    /// Allocates the buffers; `None` if the device is out of memory.
    async fn new(gpu: &Gpu, members: u64, cells: u64) -> Option<Self> {
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let of = |label: &str, size: u64, usage: wgpu::BufferUsages| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let storage = wgpu::BufferUsages::STORAGE;
        let (to, from) = (wgpu::BufferUsages::COPY_DST, wgpu::BufferUsages::COPY_SRC);
        let sums = size_of::<Sum>() as u64 * (blocks(cells) + 1);
        let shaped = size_of::<Shaped>() as u64 * members;
        let buffers = Self {
            members,
            cells,
            places: of("places", 16 * members, storage | to),
            cell_of: of("cells of members", 8 * members, storage),
            counts: of("members of cells", 4 * (cells + 1), storage | to),
            sums: of("sums of blocks", sums, storage | from),
            starts: of("starts of cells", 4 * (cells + 1), storage),
            came: of("members as they came", 4 * members, storage),
            order: of("members by cell", 8 * members, storage),
            sorted: of("places by cell", 16 * members, storage),
            shaped: of("shaped members", shaped, storage | from),
            staging: of("readback", Self::read_bytes(members), to | wgpu::BufferUsages::MAP_READ),
        };
        scope.pop().await.is_none().then_some(buffers)
    }

    /// Bytes read back for this many members.
    fn read_bytes(members: u64) -> u64 {
        size_of::<Sum>() as u64 + size_of::<Shaped>() as u64 * members
    }
}
