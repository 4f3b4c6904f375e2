//! Device memory of classification.

use super::{BLOCK, Layout, Splat, Sum};
use crate::gpu::{self, Gpu};
use crate::liquid::classify::iso_surface;
use crate::settings::Classify;

/// Lines for which there is always room where members may have three each.
const LINES: u64 = 3 << 20;

/// Bytes of a `Point` of `classify/line.wgsl`, the largest item of a line.
pub(super) const POINT: u64 = 32;

/// How much buffers have room for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Capacity {
    pub(super) members: u64,
    /// Splats of members, and copies of them.
    pub(super) splats: u64,
    pub(super) cells: u64,
    /// Lines on which the iso-surface is looked for.
    pub(super) lines: u64,
}

impl Capacity {
    /// For a frame of this many members and copies of splats; `None` for more than a binding of the device holds.
    ///
    /// Members of sheets have up to three lines, those of bodies one if they are at the surface. From a million members on
    /// there is room for three million lines, or for one each if that is more; splats beyond it are not moved.
    pub(super) fn for_frame(
        gpu: &Gpu,
        [members, copies]: [usize; 2],
        layout: &Layout,
        settings: &Classify,
    ) -> Option<Self> {
        let most = gpu.most_binding();
        let (members, cells) = (members as u64, layout.cells() as u64);
        let splats = members + copies as u64;
        if size_of::<Splat>() as u64 * (splats + 1) > most || 4 * (cells + 1) > most {
            return None;
        }
        let lines = match iso_surface::refines(settings) {
            true => (3 * members).min(members.max(LINES)).min(most / POINT),
            false => 1,
        };
        Some(Self { members, splats, cells, lines })
    }

    pub(super) fn holds(self, other: Self) -> bool {
        self.max(other) == self
    }

    pub(super) fn max(self, other: Self) -> Self {
        Self {
            members: self.members.max(other.members),
            splats: self.splats.max(other.splats),
            cells: self.cells.max(other.cells),
            lines: self.lines.max(other.lines),
        }
    }
}

/// Buffers for one frame: 120 bytes per member, 12 per cell and 64 per line on the device, and 48 per member in
/// host-visible memory.
#[derive(Debug)]
pub(super) struct Buffers {
    pub(super) capacity: Capacity,
    /// Position and radius of each member.
    pub(super) places: wgpu::Buffer,
    /// Tags of each member, or one for all.
    pub(super) tags: wgpu::Buffer,
    /// Cell of each member, and its arrival rank in the cell.
    pub(super) cell_of: wgpu::Buffer,
    /// Members in each cell, later lines.
    pub(super) counts: wgpu::Buffer,
    /// The total [`Sum`] of the members.
    pub(super) total: wgpu::Buffer,
    /// [`Sum`] of each block of cells, then the total.
    pub(super) sums: wgpu::Buffer,
    /// First sorted index of each cell.
    pub(super) starts: wgpu::Buffer,
    /// Whether each cell is interior.
    pub(super) interior: wgpu::Buffer,
    /// Members by cell, in arrival order.
    pub(super) came: wgpu::Buffer,
    /// Members by cell, in file order, with their cells.
    pub(super) order: wgpu::Buffer,
    /// Positions and radii by cell, in file order.
    pub(super) sorted: wgpu::Buffer,
    /// Splats, in file order.
    pub(super) splats: wgpu::Buffer,
    /// Means of neighbours, in sorted order.
    pub(super) means: wgpu::Buffer,
    /// Densities whose iso-surface is looked for, in sorted order.
    pub(super) fields: wgpu::Buffer,
    /// First line of each cell.
    pub(super) line_starts: wgpu::Buffer,
    pub(super) lines: wgpu::Buffer,
    /// Points of the iso-surface on the lines.
    pub(super) points: wgpu::Buffer,
    /// Averaged normals of the points.
    pub(super) normals: wgpu::Buffer,
    /// Readback of the total [`Sum`] and of `splats`, once that was needed.
    staging: Option<wgpu::Buffer>,
}

impl Buffers {
    /// As [`Buffers::allocate`], with a readback; `None` if the device is out of memory.
    pub(super) async fn new(gpu: &Gpu, wanted: Capacity) -> Option<Self> {
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let mut buffers = Self::allocate(gpu, wanted);
        buffers.staging(gpu);
        scope.pop().await.is_none().then_some(buffers)
    }

    /// Allocates the buffers, with spare room as the next frame may have slightly more.
    pub(super) fn allocate(gpu: &Gpu, wanted: Capacity) -> Self {
        let most = gpu.most_binding();
        // Nothing of no bytes can be bound.
        let room = |count: u64, bytes: u64| {
            let spare = gpu::spare(count * bytes) / bytes;
            (count + spare).min(most / bytes - 1).max(count).max(1)
        };
        let capacity = Capacity {
            members: room(wanted.members, 16),
            splats: room(wanted.splats, size_of::<Splat>() as u64),
            cells: room(wanted.cells, 4),
            lines: room(wanted.lines, POINT),
        };
        let Capacity { members, splats, cells, lines } = capacity;
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
        let splats = size_of::<Splat>() as u64 * splats;
        Self {
            capacity,
            places: of("places", 16 * members, storage | to),
            tags: of("tags of members", 4 * members, storage | to),
            cell_of: of("cells of members", 8 * members, storage),
            counts: of("members of cells", 4 * (cells + 1), storage | to),
            total: of("sum of members", size_of::<Sum>() as u64, to | from),
            sums: of("sums of blocks", sums, storage | from),
            starts: of("starts of cells", 4 * (cells + 1), storage),
            interior: of("interior cells", 4 * cells, storage),
            came: of("members as they came", 4 * members, storage),
            order: of("members by cell", 8 * members, storage),
            sorted: of("places by cell", 16 * members, storage),
            splats: of("splats of members", splats, storage | from),
            means: of("means of neighbours", 16 * members, storage),
            fields: of("densities of members", 4 * members, storage),
            line_starts: of("lines of cells", 4 * (cells + 1), storage),
            lines: of("lines", 16 * lines, storage),
            points: of("points of the surface", POINT * lines, storage),
            normals: of("normals of the surface", 16 * lines, storage),
            staging: None,
        }
    }

    /// Uploads a frame.
    pub(super) fn upload(&self, gpu: &Gpu, places: &[[f32; 4]], tags: &[u32]) {
        gpu.queue.write_buffer(&self.places, 0, bytemuck::cast_slice(places));
        gpu.queue.write_buffer(&self.tags, 0, bytemuck::cast_slice(tags));
    }

    /// The buffer for reading a frame back.
    pub(super) fn staging(&mut self, gpu: &Gpu) -> wgpu::Buffer {
        let size = size_of::<Sum>() as u64 + size_of::<Splat>() as u64 * self.capacity.splats;
        let create = || {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("readback"),
                size,
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                mapped_at_creation: false,
            })
        };
        self.staging.get_or_insert_with(create).clone()
    }
}

/// Blocks of the prefix sum, which has one entry more than there are cells.
pub(super) fn blocks(cells: u64) -> u64 {
    cells / u64::from(BLOCK) + 1
}
