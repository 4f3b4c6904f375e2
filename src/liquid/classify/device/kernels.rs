//! The steps of classification.

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};

use super::buffers::{Buffers, POINT, blocks};
use super::{Params, SORTING, Sum, Wall};
use crate::gpu::{self, Gpu};
use crate::liquid::device_particles::DeviceParticles;

/// Workgroup size of the kernels with a thread for each member, cell or line.
const EACH: u32 = 64;

/// Bytes of a `Line` of `classify/line.wgsl`.
const LINE: u64 = 16;

/// Records all kernels, for bodies that wet these walls.
pub(super) fn record(
    gpu: &Gpu,
    encoder: &mut wgpu::CommandEncoder,
    buffers: &Buffers,
    params: &Params,
    walls: &[Wall],
) {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
    let uniform = gpu.buffer_with("classify", usage, &[*params]);
    let kernels = Kernels { gpu, buffers, params, uniform: &uniform };
    kernels.count(encoder);
    // Later kernels leave crowds alone.
    let total = size_of::<Sum>() as u64 * blocks(params.cells.into());
    let (from, to) = (total + offset_of!(Sum, squares) as u64, offset_of!(Params, squares) as u64);
    encoder.copy_buffer_to_buffer(&buffers.sums, from, &uniform, to, 4);
    let sum = size_of::<Sum>() as u64;
    encoder.copy_buffer_to_buffer(&buffers.sums, total, &buffers.total, 0, sum);
    kernels.shape(encoder);
    if !walls.is_empty() {
        kernels.wet(encoder, walls);
    }
}

/// `Source` of `classify/members.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Source {
    /// First word of the positions, and words from one to the next.
    pub(super) position: [u32; 2],
    /// The same of the radii.
    pub(super) radius: [u32; 2],
    /// 1 if there are radii.
    pub(super) has_radii: u32,
    /// Word of the number of particles.
    pub(super) counter: u32,
    /// 1 if there is one.
    pub(super) has_counter: u32,
    /// Radius of particles without, m.
    pub(super) common_radius: f32,
}

/// Records the reading of the members from the caller's buffers.
pub(super) fn gather(
    gpu: &Gpu,
    encoder: &mut wgpu::CommandEncoder,
    buffers: &Buffers,
    params: &Params,
    particles: &DeviceParticles<'_>,
) {
    let uniform = gpu.buffer_with("classify", wgpu::BufferUsages::STORAGE, &[*params]);
    let kernels = Kernels { gpu, buffers, params, uniform: &uniform };
    let (positions, radii, counter) = particles.parts(gpu);
    let source = Source {
        position: positions.words,
        radius: radii.map_or([0; 2], |radii| radii.words),
        has_radii: u32::from(radii.is_some()),
        counter: counter.map_or(0, |counter| counter.words[0]),
        has_counter: u32::from(counter.is_some()),
        common_radius: particles.radius,
    };
    let source = gpu.buffer_with("particles", wgpu::BufferUsages::STORAGE, &[source]);
    let (read, write) = (gpu::storage_of, gpu::storage_read_write);
    // Unused bindings need a buffer too.
    let (radii, counter) = (radii.unwrap_or(positions), counter.unwrap_or(positions));
    let gathering = kernels.step_on(
        "classify/members.wgsl",
        &[
            (gpu::storage::<Source>(), source.as_entire_binding()),
            (read(4), positions.resource()),
            (read(4), radii.resource()),
            (read(4), counter.resource()),
            (write(16), buffers.places.as_entire_binding()),
            (write(48), buffers.splats.as_entire_binding()),
        ],
    );
    // One fluid.
    encoder.clear_buffer(&buffers.tags, 0, Some(4));
    gathering.run(&mut begin(encoder), "gather", params.members.div_ceil(SORTING));
}

/// The context shared by a frame's kernels.
#[derive(Clone, Copy)]
struct Kernels<'a> {
    gpu: &'a Gpu,
    buffers: &'a Buffers,
    params: &'a Params,
    uniform: &'a wgpu::Buffer,
}

/// A kernel with its bindings, of which the first are the parameters.
struct Step<'a> {
    gpu: &'a Gpu,
    file: &'static str,
    bound: gpu::Bound,
}

impl Step<'_> {
    fn run(&self, pass: &mut wgpu::ComputePass<'_>, entry: &str, groups: u32) {
        let layouts = [&self.bound.layout];
        pass.set_pipeline(&self.gpu.compute_pipeline(self.file, entry, &layouts, &[]));
        pass.set_bind_group(0, &self.bound.group, &[]);
        gpu::dispatch(pass, groups);
    }
}

fn begin(encoder: &mut wgpu::CommandEncoder) -> wgpu::ComputePass<'_> {
    encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
        label: Some("classify"),
        timestamp_writes: None,
    })
}

impl<'a> Kernels<'a> {
    /// A kernel's bindings.
    fn step(self, file: &'static str, buffers: &[(wgpu::BindingType, &wgpu::Buffer)]) -> Step<'a> {
        let whole =
            |&(ty, buffer): &(wgpu::BindingType, _)| (ty, wgpu::Buffer::as_entire_binding(buffer));
        self.step_on(file, &buffers.iter().map(whole).collect::<Vec<_>>())
    }

    /// As [`Kernels::step`], of parts of buffers.
    fn step_on(
        self,
        file: &'static str,
        resources: &[(wgpu::BindingType, wgpu::BindingResource<'_>)],
    ) -> Step<'a> {
        let params = [(gpu::storage::<Params>(), self.uniform.as_entire_binding())];
        let bindings = [&params, resources].concat();
        Step { gpu: self.gpu, file, bound: self.gpu.bind("classify", &bindings) }
    }

    /// Counts the members of each cell, and finds where those of each begin.
    fn count(self, encoder: &mut wgpu::CommandEncoder) {
        let (read, write) = (gpu::storage_of, gpu::storage_read_write);
        let Buffers { places, cell_of, counts, sums, starts, .. } = self.buffers;
        let counting = self.step(
            "classify/count.wgsl",
            &[(read(16), places), (write(8), cell_of), (write(4), counts)],
        );
        encoder.clear_buffer(counts, 0, None);
        let mut pass = begin(encoder);
        counting.run(&mut pass, "count", self.params.members.div_ceil(SORTING));
        self.scan(&mut pass, counts, sums, starts);
    }

    /// Exclusive prefix sums over the cells.
    fn scan(
        self,
        pass: &mut wgpu::ComputePass<'_>,
        counts: &wgpu::Buffer,
        sums: &wgpu::Buffer,
        starts: &wgpu::Buffer,
    ) {
        let (read, write) = (gpu::storage_of, gpu::storage_read_write);
        let scanning = self
            .step("classify/scan.wgsl", &[(read(4), counts), (write(8), sums), (write(4), starts)]);
        let blocks = blocks(self.params.cells.into()) as u32;
        scanning.run(pass, "add_blocks", blocks);
        scanning.run(pass, "add_sums", 1);
        scanning.run(pass, "begin_cells", blocks);
    }

    /// Sorts the members, and makes the splats.
    fn shape(self, encoder: &mut wgpu::CommandEncoder) {
        let Self { buffers, params, .. } = self;
        let (read, write) = (gpu::storage_of, gpu::storage_read_write);
        let Buffers { places, tags, cell_of, starts, interior, came, order, .. } = buffers;
        let Buffers { sorted, splats, means, fields, .. } = buffers;
        let (members, cells) = (params.members.div_ceil(EACH), params.cells.div_ceil(EACH));

        let mut pass = begin(encoder);
        if params.full > 0.0 {
            self.step("classify/interior.wgsl", &[(read(4), starts), (write(4), interior)])
                .run(&mut pass, "mark", cells);
        }
        let ordering = self.step(
            "classify/order.wgsl",
            &[
                (read(16), places),
                (read(8), cell_of),
                (read(4), starts),
                (read(4), interior),
                (write(4), came),
                (write(8), order),
                (write(16), sorted),
            ],
        );
        ordering.run(&mut pass, "scatter", params.members.div_ceil(SORTING));
        ordering.run(&mut pass, "arrange", params.members.div_ceil(SORTING));
        self.step(
            "classify/shape.wgsl",
            &[
                (read(4), starts),
                (read(16), sorted),
                (read(8), order),
                (read(4), tags),
                (write(48), splats),
                (write(16), means),
                (write(4), fields),
            ],
        )
        .run(&mut pass, "shape", members);
        if params.most_neighbours > 0 {
            self.refine(&mut pass);
        }
    }

    /// Moves the splats at the surface to the iso-surface.
    fn refine(self, pass: &mut wgpu::ComputePass<'_>) {
        let Self { buffers, params, .. } = self;
        let (read, write) = (gpu::storage_of, gpu::storage_read_write);
        let Buffers { counts, sums, starts, order, sorted, splats, means, fields, .. } = buffers;
        let Buffers { line_starts, lines, points, normals, .. } = buffers;
        let cells = params.cells.div_ceil(EACH);
        let listing = self.step(
            "classify/lines.wgsl",
            &[
                (read(4), starts),
                (read(8), order),
                (read(16), means),
                (read(48), splats),
                (read(4), line_starts),
                (write(4), counts),
                (write(LINE), lines),
            ],
        );
        listing.run(pass, "count_lines", cells);
        self.scan(pass, counts, sums, line_starts);
        listing.run(pass, "list_lines", cells);
        // How many lines there are only the device knows: threads beyond them end at once.
        let each_line = params.most_lines.div_ceil(EACH);
        self.step(
            "classify/points.wgsl",
            &[
                (read(4), starts),
                (read(16), sorted),
                (read(4), fields),
                (read(4), line_starts),
                (read(LINE), lines),
                (write(POINT), points),
            ],
        )
        .run(pass, "find_points", each_line);
        self.step(
            "classify/normals.wgsl",
            &[(read(4), line_starts), (read(POINT), points), (write(16), normals)],
        )
        .run(pass, "mean_normals", each_line);
        self.step(
            "classify/move.wgsl",
            &[
                (read(4), line_starts),
                (read(POINT), points),
                (read(16), normals),
                (read(LINE), lines),
                (read(16), means),
                (read(8), order),
                (write(48), splats),
            ],
        )
        .run(pass, "move_splats", each_line);
    }

    /// Copies the splats of bodies to the walls that they touch.
    fn wet(self, encoder: &mut wgpu::CommandEncoder, walls: &[Wall]) {
        let Self { gpu, buffers, params, .. } = self;
        let (read, write) = (gpu::storage_of, gpu::storage_read_write);
        let Buffers { counts, sums, starts, order, splats, line_starts, .. } = buffers;
        let walls = gpu.buffer_with("walls", wgpu::BufferUsages::STORAGE, walls);
        // The lines have been followed: their buffer has the first copies of cells now.
        let copying = self.step(
            "classify/walls.wgsl",
            &[
                (read(4), starts),
                (read(8), order),
                (gpu::storage::<Wall>(), &walls),
                (read(4), line_starts),
                (write(4), counts),
                (write(48), splats),
            ],
        );
        let (cells, copies) = (params.cells.div_ceil(EACH), params.most_copies.div_ceil(EACH));
        let mut pass = begin(encoder);
        copying.run(&mut pass, "count_copies", cells);
        self.scan(&mut pass, counts, sums, line_starts);
        copying.run(&mut pass, "list_copies", cells);
        copying.run(&mut pass, "hide_copies", copies);
    }
}
