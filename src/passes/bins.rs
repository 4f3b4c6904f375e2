//! Lists of the splats that each tile of the picture needs: `shaders/bins/`.
//!
//! Splats are projected and counted by tile; a prefix sum of the counts tells where each list starts; then the lists
//! are filled. Their order differs from run to run, and no pass depends on it.
//!
//! The memory for the lists is known before they are made, from bounds of the splats on the CPU. Where it exceeds what
//! one binding holds, the picture is drawn in bands of tiles; splats that exceed one binding are drawn in chunks.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use glam::{Mat3, UVec2, Vec3};
use rayon::prelude::*;

use super::CameraBinding;
use super::splat_buffers::{self, SplatBuffers};
use crate::camera::CameraUniform;
use crate::gpu::{self, Gpu, Grain, Span, TILE};
use crate::liquid::classify::Splat as SplatData;

/// Index of the bodies and sheets in pairs of classes.
pub const AGGREGATES: usize = 0;
/// Index of the droplets.
pub const SPLASHES: usize = 1;

/// `Params` of `bins/params.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// Splats of the chunk.
    pub splats: u32,
    /// Threads that share a splat's tiles.
    pub lanes: u32,
    /// Tiles of the picture.
    pub tiles: [u32; 2],
    /// Entries of the lists of a band, not counting those of its last tile.
    pub entries: u32,
    /// The band.
    pub band: u32,
    /// Scale of the ellipsoids that tiles list.
    pub swell: f32,
    /// Padding.
    pub pad: u32,
}

/// Threads of a workgroup in `bins/tiles.wgsl`.
pub const THREADS: u32 = 64;
/// Counts that a workgroup of `bins/scan.wgsl` sums.
const BLOCK: u32 = 1024;
/// Splats from which one thread each fills a card.
const MANY: u32 = 1 << 16;
/// Threads that share a splat's tiles where there are fewer.
const LANES: u32 = 8;
/// Layers of the state that chunks hand over: four sums, or two depths of each of two gaps.
const STATES: u32 = 4;

/// The lists of a view.
#[derive(Debug)]
pub struct Bins {
    layouts: Layouts,
    pipelines: Pipelines,
    classes: [Vec<Chunk>; 2],
    /// Of each class and tile, whether it is drawn: in the frame before or, once its lists are made, in this one.
    filled: [wgpu::Buffer; 2],
    /// State of each pixel that a chunk hands over to the next; one pixel unless [`Bins::prepare`] finds that it is needed.
    state: wgpu::Texture,
    grain: Grain,
}

#[derive(Debug)]
struct Layouts {
    project: wgpu::BindGroupLayout,
    scan: wgpu::BindGroupLayout,
    fill: wgpu::BindGroupLayout,
    read: wgpu::BindGroupLayout,
}

#[derive(Debug)]
struct Pipelines {
    project: wgpu::ComputePipeline,
    count_large: wgpu::ComputePipeline,
    sum: wgpu::ComputePipeline,
    /// By whether the chunk is the first and the last.
    scan: HashMap<[bool; 2], wgpu::ComputePipeline>,
    arrange: wgpu::ComputePipeline,
    fill: wgpu::ComputePipeline,
    fill_large: wgpu::ComputePipeline,
}

/// The lists of one binding of splats.
#[derive(Debug, Clone)]
struct Chunk {
    params: Params,
    buffers: Buffers,
    project: wgpu::BindGroup,
    scan: wgpu::BindGroup,
    bands: Vec<Band>,
}

#[derive(Debug, Clone)]
struct Band {
    fill: wgpu::BindGroup,
    read: wgpu::BindGroup,
}

#[derive(Debug, Clone)]
struct Buffers {
    placed: wgpu::Buffer,
    rects: wgpu::Buffer,
    counts: wgpu::Buffer,
    starts: wgpu::Buffer,
    cursors: wgpu::Buffer,
    list: wgpu::Buffer,
    large: wgpu::Buffer,
    blocks: wgpu::Buffer,
    busy: wgpu::Buffer,
    emptied: wgpu::Buffer,
    dispatches: wgpu::Buffer,
}

/// A band of a chunk, whose lists are made.
#[derive(Debug, Clone, Copy)]
pub struct Part {
    /// No chunk of the class is before.
    pub first: bool,
    /// No chunk of the class follows.
    pub last: bool,
}

impl Part {
    /// Specialisation: whether the chunk is the first and the last.
    pub fn ends(self) -> [bool; 2] {
        [self.first, self.last]
    }
}

/// Tiles of a class that have splats no more.
#[derive(Debug, Clone, Copy)]
pub struct Emptied<'a> {
    /// The tiles: `TileList`, by number.
    pub tiles: &'a wgpu::Buffer,
    /// Arguments of the dispatch over them.
    dispatches: &'a wgpu::Buffer,
}

impl Emptied<'_> {
    /// Dispatches a workgroup for each tile.
    pub fn dispatch(self, pass: &mut wgpu::ComputePass<'_>) {
        pass.dispatch_workgroups_indirect(self.dispatches, EMPTIED);
    }
}

/// Offset of the arguments over the emptied tiles; those over the busy ones are first.
const EMPTIED: u64 = 16;

/// The splats of a class, of which lists are made.
#[derive(Debug, Clone, Copy)]
pub struct Listed<'a> {
    /// The splats.
    pub splats: &'a [SplatData],
    /// The same on the device.
    pub buffers: &'a SplatBuffers,
}

impl Bins {
    /// Compiles the pipelines; [`Bins::prepare`] allocates the lists.
    pub fn new(gpu: &Gpu, camera: &CameraBinding) -> Self {
        let layouts = Layouts::new(gpu);
        let splats = splat_buffers::layout(gpu);
        let constants = camera.constants();
        let project = |entry: &str| {
            let layouts = [&camera.layout, &splats, &layouts.project];
            gpu::compute_pipeline(gpu, "bins/project.wgsl", entry, &layouts, &constants)
        };
        let scan = |entry: &str| layouts.scan_pipeline(gpu, entry, [true, true]);
        let fill = |entry: &str| {
            let layouts = [&camera.layout, &splats, &layouts.fill];
            gpu::compute_pipeline(gpu, "bins/fill.wgsl", entry, &layouts, &[])
        };
        let pipelines = Pipelines {
            project: project("project"),
            count_large: project("count_large"),
            sum: scan("sum"),
            scan: HashMap::from([([true, true], scan("scan"))]),
            arrange: scan("arrange"),
            fill: fill("fill"),
            fill_large: fill("fill_large"),
        };
        Self {
            layouts,
            pipelines,
            classes: [Vec::new(), Vec::new()],
            filled: [(); 2].map(|()| create_filled(gpu, UVec2::ONE)),
            state: create_state(gpu, UVec2::ONE),
            grain: gpu.grain(),
        }
    }

    /// The tiles of a class that have splats no more, or not yet in the first of several chunks.
    pub fn emptied(&self, class: usize) -> Emptied<'_> {
        let Buffers { emptied, dispatches, .. } = &self.classes[class][0].buffers;
        Emptied { tiles: emptied, dispatches }
    }

    /// Whether a class is drawn in several chunks.
    pub fn is_divided(&self, class: usize) -> bool {
        self.classes[class].len() > 1
    }

    /// Whether chunks are the first and the last of their class, for each kind that there is.
    pub fn ends(&self) -> Vec<[bool; 2]> {
        match self.classes.iter().map(Vec::len).max() {
            None | Some(0 | 1) => vec![[true, true]],
            Some(2) => vec![[true, true], [true, false], [false, true]],
            _ => vec![[true, true], [true, false], [false, true], [false, false]],
        }
    }

    /// The layout of group 2 of `splat/lists.wgsl`.
    pub fn read_layout(&self) -> &wgpu::BindGroupLayout {
        &self.layouts.read
    }

    /// The state that chunks hand over: `texture_storage_2d_array<r32uint, read_write>`.
    pub fn state(&self) -> wgpu::TextureView {
        gpu::array_view(&self.state)
    }

    /// Starts with the empty images of a view of `size` pixels.
    pub fn resize(&mut self, gpu: &Gpu, size: UVec2) {
        self.filled = [(); 2].map(|()| create_filled(gpu, size));
    }

    /// Takes the buffers of another view, which is drawn before.
    pub fn share(&mut self, other: &Self) {
        (self.state, self.filled) = (other.state.clone(), other.filled.clone());
        for (own, other) in self.classes.iter_mut().zip(&other.classes) {
            // [`Bins::prepare`] keeps the buffers.
            *own = other.clone();
        }
    }

    /// Allocates the lists of a view of `size` pixels, of splats up to `swell` times as large. `summed` keeps a state
    /// from one class to the other.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        camera: &CameraUniform,
        classes: [Listed<'_>; 2],
        swell: f32,
        summed: bool,
    ) {
        let size = camera.size.as_uvec2();
        let images = self.classes.iter_mut().zip(&self.filled);
        for ((chunks, filled), Listed { splats, buffers }) in images.zip(classes) {
            let mut old = std::mem::take(chunks).into_iter().map(|chunk| chunk.buffers);
            let mut rest = splats;
            for bound in buffers.chunks() {
                let (splats, others) = rest.split_at((bound.count as usize).min(rest.len()));
                rest = others;
                let lanes = match self.grain {
                    Grain::Pixel if bound.count < MANY => LANES,
                    _ => 1,
                };
                let tiles = size.map(|n| n.div_ceil(TILE)).to_array();
                let params =
                    Params { splats: bound.count, lanes, tiles, swell, ..Zeroable::zeroed() };
                let most = most_entries(splats, camera, swell);
                let old = old.next();
                let chunk = self.layouts.new_chunk(gpu, params, most, old.as_ref(), filled);
                chunks.push(chunk);
            }
        }
        for ends in self.ends() {
            let scan = || self.layouts.scan_pipeline(gpu, "scan", ends);
            self.pipelines.scan.entry(ends).or_insert_with(scan);
        }
        let handed_over = summed || self.classes.iter().any(|chunks| chunks.len() > 1);
        let wanted = if handed_over { size } else { UVec2::ONE };
        if (self.state.width(), self.state.height()) != (wanted.x, wanted.y) {
            self.state = create_state(gpu, wanted);
        }
    }

    /// Records the lists of a class.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        class: usize,
        splats: &SplatBuffers,
        span: Span<'_>,
    ) {
        for chunk in &self.classes[class] {
            let Buffers { large, busy, emptied, .. } = &chunk.buffers;
            for list in [large, busy, emptied] {
                encoder.clear_buffer(list, 0, Some(4));
            }
        }
        let last = self.classes[class].len() - 1;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("bins"),
            timestamp_writes: span.compute(),
        });
        for (i, (chunk, bound)) in self.classes[class].iter().zip(splats.chunks()).enumerate() {
            let [x, y] = chunk.params.tiles;
            let blocks = (x * y).div_ceil(BLOCK);
            pass.set_bind_group(0, &camera.group, &[]);
            pass.set_bind_group(1, &bound.group, &[]);
            pass.set_bind_group(2, &chunk.project, &[]);
            pass.set_pipeline(&self.pipelines.project);
            gpu::dispatch(&mut pass, chunk.groups());
            pass.set_pipeline(&self.pipelines.count_large);
            pass.dispatch_workgroups(self.large_groups(chunk), 1, 1);
            pass.set_bind_group(0, &chunk.scan, &[]);
            pass.set_pipeline(&self.pipelines.sum);
            gpu::dispatch(&mut pass, blocks);
            pass.set_pipeline(&self.pipelines.scan[&[i == 0, i == last]]);
            gpu::dispatch(&mut pass, blocks);
            pass.set_pipeline(&self.pipelines.arrange);
            pass.dispatch_workgroups(1, 1, 1);
            pass.set_bind_group(0, &camera.group, &[]);
            if let [whole] = &chunk.bands[..] {
                self.fill(&mut pass, chunk, whole);
            }
        }
    }

    fn fill(&self, pass: &mut wgpu::ComputePass<'_>, chunk: &Chunk, band: &Band) {
        pass.set_bind_group(2, &band.fill, &[]);
        pass.set_pipeline(&self.pipelines.fill);
        gpu::dispatch(pass, chunk.groups());
        pass.set_pipeline(&self.pipelines.fill_large);
        pass.dispatch_workgroups(self.large_groups(chunk), 1, 1);
    }

    /// Workgroups among which large splats are divided.
    fn large_groups(&self, chunk: &Chunk) -> u32 {
        let most = match self.grain {
            Grain::Pixel => 256,
            Grain::Column => 8,
        };
        chunk.params.splats.clamp(1, most)
    }

    /// Records a compute pass over each part of a class, whose lists are made by [`Bins::record`]: `draw` sets the
    /// pipeline and group 3 and dispatches, with the arguments in the buffer for a workgroup for each tile with splats.
    pub fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        class: usize,
        splats: &SplatBuffers,
        span: Span<'_>,
        mut draw: impl FnMut(&mut wgpu::ComputePass<'_>, Part, &wgpu::Buffer),
    ) {
        let chunks = &self.classes[class];
        for chunk in chunks.iter().filter(|chunk| chunk.bands.len() > 1) {
            encoder.clear_buffer(&chunk.buffers.cursors, 0, None);
        }
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("tiles of splats"),
            timestamp_writes: span.compute(),
        });
        pass.set_bind_group(0, &camera.group, &[]);
        for (i, (chunk, bound)) in chunks.iter().zip(splats.chunks()).enumerate() {
            for band in &chunk.bands {
                pass.set_bind_group(1, &bound.group, &[]);
                if chunk.bands.len() > 1 {
                    self.fill(&mut pass, chunk, band);
                }
                pass.set_bind_group(2, &band.read, &[]);
                let part = Part { first: i == 0, last: i + 1 == chunks.len() };
                draw(&mut pass, part, &chunk.buffers.dispatches);
            }
        }
    }
}

impl Layouts {
    fn new(gpu: &Gpu) -> Self {
        let layout = |label: &str, bindings: &[wgpu::BindingType]| {
            gpu.layout(label, wgpu::ShaderStages::COMPUTE, bindings)
        };
        let (params, written) = (gpu.branching::<Params>(), gpu::storage_read_write);
        let (word, pair, rect, placed) = (4, 8, 16, PLACED);
        let read = gpu::storage_of;
        Self {
            project: layout(
                "projected splats",
                &[params, written(placed), written(rect), written(word), written(pair)],
            ),
            scan: layout(
                "scanned bins",
                &[
                    written(word),
                    written(pair),
                    written(pair),
                    written(word),
                    written(pair),
                    written(pair),
                    written(word),
                    written(32),
                ],
            ),
            fill: layout(
                "filled bins",
                &[params, read(rect), read(pair), written(pair), written(word), read(pair)],
            ),
            read: layout(
                "bins",
                &[params, read(placed), read(pair), read(pair), read(word), read(pair)],
            ),
        }
    }

    fn scan_pipeline(&self, gpu: &Gpu, entry: &str, ends: [bool; 2]) -> wgpu::ComputePipeline {
        let [first, last] = ends.map(|end| f64::from(u8::from(end)));
        let constants = [("FIRST", first), ("LAST", last)];
        gpu::compute_pipeline(gpu, "bins/scan.wgsl", entry, &[&self.scan], &constants)
    }

    /// A chunk in these buffers.
    fn of_buffers(
        &self,
        gpu: &Gpu,
        params: Params,
        bands: u32,
        buffers: Buffers,
        filled: &wgpu::Buffer,
    ) -> Chunk {
        let group = gpu::bind_group;
        let [x, y] = params.tiles;
        let tiles = u64::from(x * y);
        let Buffers { placed, rects, counts, starts, cursors, list, large, blocks, .. } = &buffers;
        let counts = gpu::first_bytes(counts, 4 * tiles);
        let starts = gpu::first_bytes(starts, 4 * (tiles + 1));
        let cursors = gpu::first_bytes(cursors, 8 * tiles);
        let blocks = gpu::first_bytes(blocks, 4 * tiles.div_ceil(BLOCK.into()));
        let uniform =
            |band: u32| gpu::buffer_with(gpu, "bins", gpu::UNIFORM, &[Params { band, ..params }]);
        let first = uniform(0);
        let whole = wgpu::Buffer::as_entire_binding;
        let project = [whole(&first), whole(placed), whole(rects), counts.clone(), whole(large)];
        let scan = [
            counts,
            starts.clone(),
            cursors.clone(),
            blocks,
            whole(&buffers.busy),
            whole(&buffers.emptied),
            whole(filled),
            whole(&buffers.dispatches),
        ];
        let bands = (0..bands).map(|band| {
            let uniform = uniform(band);
            let fill = [
                whole(&uniform),
                whole(rects),
                starts.clone(),
                cursors.clone(),
                whole(list),
                whole(large),
            ];
            let read = [
                whole(&uniform),
                whole(placed),
                starts.clone(),
                cursors.clone(),
                whole(list),
                whole(&buffers.busy),
            ];
            Band {
                fill: group(gpu, "filled bins", &self.fill, &fill),
                read: group(gpu, "bins", &self.read, &read),
            }
        });
        let bands = bands.collect();
        let project = group(gpu, "projected splats", &self.project, &project);
        let scan = group(gpu, "scanned bins", &self.scan, &scan);
        Chunk { params, buffers, project, scan, bands }
    }

    /// The chunk of these splats, whose lists have `most` entries at most, in the buffers of another where they are
    /// large enough.
    fn new_chunk(
        &self,
        gpu: &Gpu,
        params: Params,
        most: u64,
        old: Option<&Buffers>,
        filled: &wgpu::Buffer,
    ) -> Chunk {
        let limits = gpu.device.limits();
        let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let splats = u64::from(params.splats.max(1));
        let [x, y] = params.tiles;
        let tiles = u64::from(x * y);
        // A band may begin in the middle of a list, which has each splat once at most.
        let (entries, bands, capacity) = match bytes / 4 {
            limit if most <= limit => (u64::from(u32::MAX), 1, most.max(1)),
            limit => {
                let entries = limit.saturating_sub(splats).max(1);
                (entries, most / entries + 1, limit)
            }
        };
        let buffer = |label: &str, old: Option<&wgpu::Buffer>, size: u64| match old {
            Some(old) if old.size() >= size => old.clone(),
            _ => {
                // With spare room, for frames that grow.
                let size = (size + size / 8).next_multiple_of(16).min(bytes / 16 * 16).max(size);
                let usage = wgpu::BufferUsages::STORAGE
                    | wgpu::BufferUsages::COPY_DST
                    | wgpu::BufferUsages::INDIRECT;
                gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some(label),
                    size,
                    usage,
                    mapped_at_creation: false,
                })
            }
        };
        let buffers = Buffers {
            placed: buffer("placed splats", old.map(|old| &old.placed), PLACED * splats),
            rects: buffer("rectangles", old.map(|old| &old.rects), 16 * splats),
            counts: buffer("counts", old.map(|old| &old.counts), 4 * tiles),
            starts: buffer("starts", old.map(|old| &old.starts), 4 * (tiles + 1)),
            cursors: buffer("cursors", old.map(|old| &old.cursors), 8 * tiles),
            list: buffer("lists", old.map(|old| &old.list), 4 * capacity),
            large: buffer("large splats", old.map(|old| &old.large), 4 * (splats + 1)),
            blocks: buffer("blocks", old.map(|old| &old.blocks), 4 * tiles.div_ceil(BLOCK.into())),
            busy: buffer("busy tiles", old.map(|old| &old.busy), 4 * (tiles + 1)),
            emptied: buffer("emptied tiles", old.map(|old| &old.emptied), 4 * (tiles + 1)),
            dispatches: buffer("dispatches", old.map(|old| &old.dispatches), 32),
        };
        let params = Params { entries: entries.min(u32::MAX.into()) as u32, ..params };
        self.of_buffers(gpu, params, bands as u32, buffers, filled)
    }
}

/// Bytes of a `ViewSplat`.
const PLACED: u64 = 48;

impl Chunk {
    /// Workgroups that project and list its splats.
    fn groups(&self) -> u32 {
        (self.params.splats * self.params.lanes).div_ceil(THREADS)
    }
}

fn create_filled(gpu: &Gpu, size: UVec2) -> wgpu::Buffer {
    let tiles = size.map(|n| n.div_ceil(TILE)).element_product();
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("filled tiles"),
        size: 4 * u64::from(tiles),
        usage: wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    })
}

fn create_state(gpu: &Gpu, size: UVec2) -> wgpu::Texture {
    let usage = wgpu::TextureUsages::STORAGE_BINDING;
    gpu::texture(gpu, "chunk state", size, STATES, wgpu::TextureFormat::R32Uint, usage)
}

/// Upper bound of the entries of the lists of splats `swell` times as large: tiles that boxes around them touch.
fn most_entries(splats: &[SplatData], camera: &CameraUniform, swell: f32) -> u64 {
    let [x, y, z] = camera.view_from_world.map(|[x, y, z, _]| Vec3::new(x, y, z));
    let view_from_world = Mat3::from_cols(x, y, z);
    let orthographic = camera.far > 0.0;
    let tiles = (camera.size / TILE as f32).ceil();
    let count = |splat: &SplatData| -> u64 {
        let center = view_from_world * (camera.origin + Vec3::from_array(splat.centre));
        let ([a, b, c], [d, e, f]) =
            (splat.diagonal.map(f32::abs), splat.off_diagonal.map(f32::abs));
        let reach = swell * (a + d + e).max(d + b + f).max(e + f + c);
        let (near, far) = (-center.z - reach, -center.z + reach);
        // With a margin against rounding, which differs on the device.
        let margin = 1e-5 * (center.length() + reach);
        if far + margin <= camera.near {
            return 0;
        }
        let cut = !orthographic && near - margin <= camera.near;
        let along = |axis: usize| -> u64 {
            if cut {
                return tiles[axis] as u64;
            }
            let (low, high) = (center[axis] - reach, center[axis] + reach);
            let [low, high] = match orthographic {
                true => [low, high],
                false => [
                    low / if low < 0.0 { near } else { far },
                    high / if high < 0.0 { far } else { near },
                ],
            };
            let pixel = |at: f32| {
                let ndc = (at - camera.shift[axis]) / camera.tangent[axis];
                (if axis == 0 { ndc } else { -ndc } * 0.5 + 0.5) * camera.size[axis]
            };
            let (first, last) =
                (pixel(low).min(pixel(high)) - 2.0, pixel(low).max(pixel(high)) + 2.0);
            if !(last >= 0.0 && first <= camera.size[axis]) {
                return 0;
            }
            let tile = |at: f32| (at / TILE as f32).floor().clamp(0.0, tiles[axis] - 1.0);
            (tile(last) - tile(first)) as u64 + 1
        };
        along(0) * along(1)
    };
    splats.par_iter().map(count).sum()
}
