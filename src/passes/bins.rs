//! Lists of the splats that each tile of the picture needs: `shaders/bins/`.
//!
//! Splats are projected and counted by tile; a prefix sum of the counts tells where each list starts; then the lists
//! are filled. Their order differs from run to run, and no pass depends on it.
//!
//! The memory for the lists is known before they are made, from bounds of the splats on the CPU. Where it exceeds what
//! one binding holds, the picture is drawn in bands of tiles; splats that exceed one binding are drawn in chunks.

mod capacity;

use bytemuck::{Pod, Zeroable};
use glam::UVec2;

use super::CameraBinding;
use super::splat_buffers::{self, SplatBuffers};
use crate::camera::CameraUniform;
use crate::gpu::{self, Bound, Gpu, Grain, Span, TILE};
use crate::liquid::blocks::{self, Block};
use crate::liquid::classify::{DeviceSplats, Splat as SplatData};

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
    /// 1 for the tiles beyond all bands, whose list is that of all splats.
    pub rest: u32,
    /// 0 draws all splats; a class + 1 draws only those that the device put in that class.
    pub kinds: u32,
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

/// Memory of a view's lists, kept from frame to frame.
#[derive(Debug, Clone)]
pub struct BinBuffers {
    /// Of each chunk of each class.
    chunks: [Vec<Buffers>; 2],
    /// Of each class and tile, whether it is drawn: in the frame before or, once its lists are made, in this one.
    filled: [wgpu::Buffer; 2],
    /// State of each pixel that a chunk hands over to the next; one pixel unless it is needed.
    state: wgpu::Texture,
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
    /// The list of all splats, where the memory for lists is an estimate.
    everything: Option<wgpu::Buffer>,
}

/// Memory for lists.
#[derive(Debug, Clone, Copy)]
struct Room {
    /// [`Params::entries`].
    entries: u64,
    bands: u64,
    /// Entries of the buffer.
    capacity: u64,
}

impl Room {
    /// For no more than `most` entries.
    fn for_most(gpu: &Gpu, splats: u32, most: u64) -> Self {
        match gpu.most_binding() / 4 {
            limit if most <= limit => {
                Self { entries: u32::MAX.into(), bands: 1, capacity: most.max(1) }
            }
            // A band may begin in the middle of a list, which has each splat once at most.
            limit => {
                let entries = limit.saturating_sub(splats.max(1).into()).max(1);
                Self { entries, bands: most / entries + 1, capacity: limit }
            }
        }
    }

    /// For about as many entries as there are; tiles beyond them look at all splats.
    fn for_likely(gpu: &Gpu, splats: u32, likely: u64) -> Self {
        let splats = u64::from(splats.max(1));
        let limit = (gpu.most_binding() / 4).saturating_sub(splats);
        let entries = likely.clamp(1, limit.max(1));
        Self { entries, bands: 1, capacity: entries + splats }
    }
}

/// The lists of a view's splats.
#[derive(Debug)]
pub struct Bins {
    camera: wgpu::BindGroup,
    classes: [Vec<Chunk>; 2],
    state: wgpu::TextureView,
    pipelines: Pipelines,
}

#[derive(Debug)]
struct Pipelines {
    project: wgpu::ComputePipeline,
    count_large: wgpu::ComputePipeline,
    sum: wgpu::ComputePipeline,
    arrange: wgpu::ComputePipeline,
    fill: wgpu::ComputePipeline,
    fill_large: wgpu::ComputePipeline,
}

/// The lists of one binding of splats.
#[derive(Debug)]
struct Chunk {
    params: Params,
    buffers: Buffers,
    splats: wgpu::BindGroup,
    project: Bound,
    scan: Bound,
    bands: Vec<Band>,
    /// The tiles beyond them, where the memory for lists is an estimate.
    rest: Option<Bound>,
    /// Depends on whether the chunk is the first and the last.
    scan_pipeline: wgpu::ComputePipeline,
    /// Workgroups among which large splats are divided.
    large_groups: u32,
}

#[derive(Debug)]
struct Band {
    fill: Bound,
    read: Bound,
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
    /// The same by blocks.
    pub blocks: &'a [Block],
    /// The same on the device.
    pub buffers: &'a SplatBuffers,
    /// Splats that only the device has, if there are any.
    pub device: Option<&'a DeviceSplats>,
}

impl BinBuffers {
    /// For the empty images of a view of `size` pixels.
    pub fn new(gpu: &Gpu, size: UVec2) -> Self {
        Self {
            chunks: [Vec::new(), Vec::new()],
            filled: [(); 2].map(|()| create_filled(gpu, size)),
            state: create_state(gpu, UVec2::ONE),
        }
    }
}

impl Bins {
    /// Allocates the lists of a view of splats up to `swell` times as large, in `kept` where it has room. `summed` keeps
    /// a state from one class to the other.
    pub fn prepare(
        gpu: &Gpu,
        camera: &CameraBinding,
        uniform: &CameraUniform,
        classes: [Listed<'_>; 2],
        swell: f32,
        summed: bool,
        kept: &mut BinBuffers,
    ) -> Self {
        let size = uniform.size.as_uvec2();
        let tiles = size.map(|n| n.div_ceil(TILE)).to_array();
        let BinBuffers { chunks: kept, filled, state } = kept;
        let classes: [Vec<Chunk>; 2] = std::array::from_fn(|class| {
            let Listed { splats, blocks, buffers, device } = classes[class];
            let mut old = std::mem::take(&mut kept[class]).into_iter();
            let (mut rest, count) = (splats, buffers.chunks().count());
            let chunks = buffers.chunks().enumerate().map(|(i, bound)| {
                let first = splats.len() - rest.len();
                // Of a binding that begins within a block, each splat is looked at.
                let starts_block = first.is_multiple_of(blocks::SIZE);
                let blocks = if starts_block { &blocks[first / blocks::SIZE..] } else { &[] };
                let (splats, others) = rest.split_at((bound.count as usize).min(rest.len()));
                rest = others;
                let lanes = match gpu.grain() {
                    Grain::Pixel if bound.count < MANY => LANES,
                    _ => 1,
                };
                let kinds = device.map_or(0, |_| class as u32 + 1);
                let params = Params {
                    splats: bound.count,
                    lanes,
                    tiles,
                    swell,
                    kinds,
                    ..Zeroable::zeroed()
                };
                let room = match device {
                    None => {
                        let most = capacity::most_entries(splats, blocks, uniform, swell);
                        Room::for_most(gpu, bound.count, most)
                    }
                    Some(device) => {
                        let likely = capacity::likely_entries(device, uniform, swell);
                        Room::for_likely(gpu, bound.count, likely)
                    }
                };
                let mut buffers = Buffers::new(gpu, params, room, old.next().as_ref());
                buffers.0.list_everything(gpu, device.map(|device| device.count));
                Chunk::new(gpu, bound, buffers, &filled[class], [i == 0, i + 1 == count])
            });
            chunks.collect()
        });
        *kept = classes
            .each_ref()
            .map(|chunks| chunks.iter().map(|chunk| chunk.buffers.clone()).collect());
        let handed_over = summed || classes.iter().any(|chunks| chunks.len() > 1);
        let wanted = if handed_over { size } else { UVec2::ONE };
        if (state.width(), state.height()) != (wanted.x, wanted.y) {
            *state = create_state(gpu, wanted);
        }
        let pipelines = Pipelines::new(gpu, camera, &classes[AGGREGATES][0]);
        let (camera, state) = (camera.group.clone(), gpu::array_view(state));
        Self { camera, classes, state, pipelines }
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

    /// The pipelines of the chunks of a class, for [`Bins::draw`]: of an entry point that reads the camera, the splats, the
    /// lists and `own` in groups 0 to 3, with constants that depend on whether the chunk is the first and the last.
    pub fn pipelines<const N: usize>(
        &self,
        gpu: &Gpu,
        camera: &CameraBinding,
        class: usize,
        (shader, entry): (&str, &str),
        own: &wgpu::BindGroupLayout,
        constants: impl Fn([bool; 2]) -> [(&'static str, f64); N],
    ) -> Vec<wgpu::ComputePipeline> {
        let count = self.classes[class].len();
        let splats = splat_buffers::layout(gpu);
        let pipeline = |(i, chunk): (usize, &Chunk)| {
            let constants = constants([i == 0, i + 1 == count]);
            let constants = [&camera.constants()[..], &constants].concat();
            let layouts = [&camera.layout, &splats, &chunk.bands[0].read.layout, own];
            gpu.compute_pipeline(shader, entry, &layouts, &constants)
        };
        self.classes[class].iter().enumerate().map(pipeline).collect()
    }

    /// The state that chunks hand over: `texture_storage_2d_array<r32uint, read_write>`.
    pub fn state(&self) -> &wgpu::TextureView {
        &self.state
    }

    /// Records the lists of a class.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, class: usize, span: Span<'_>) {
        for chunk in &self.classes[class] {
            let Buffers { large, busy, emptied, .. } = &chunk.buffers;
            for list in [large, busy, emptied] {
                encoder.clear_buffer(list, 0, Some(4));
            }
        }
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("bins"),
            timestamp_writes: span.compute(),
        });
        for chunk in &self.classes[class] {
            let [x, y] = chunk.params.tiles;
            let blocks = (x * y).div_ceil(BLOCK);
            pass.set_bind_group(0, &self.camera, &[]);
            pass.set_bind_group(1, &chunk.splats, &[]);
            pass.set_bind_group(2, &chunk.project.group, &[]);
            pass.set_pipeline(&self.pipelines.project);
            gpu::dispatch(&mut pass, chunk.groups());
            pass.set_pipeline(&self.pipelines.count_large);
            pass.dispatch_workgroups(chunk.large_groups, 1, 1);
            pass.set_bind_group(0, &chunk.scan.group, &[]);
            pass.set_pipeline(&self.pipelines.sum);
            gpu::dispatch(&mut pass, blocks);
            pass.set_pipeline(&chunk.scan_pipeline);
            gpu::dispatch(&mut pass, blocks);
            pass.set_pipeline(&self.pipelines.arrange);
            pass.dispatch_workgroups(1, 1, 1);
            pass.set_bind_group(0, &self.camera, &[]);
            if let [whole] = &chunk.bands[..] {
                self.fill(&mut pass, chunk, whole);
            }
        }
    }

    fn fill(&self, pass: &mut wgpu::ComputePass<'_>, chunk: &Chunk, band: &Band) {
        pass.set_bind_group(2, &band.fill.group, &[]);
        pass.set_pipeline(&self.pipelines.fill);
        gpu::dispatch(pass, chunk.groups());
        pass.set_pipeline(&self.pipelines.fill_large);
        pass.dispatch_workgroups(chunk.large_groups, 1, 1);
    }

    /// Records a compute pass over each chunk and band of a class, whose lists are made by [`Bins::record`], with the
    /// chunks' `pipelines`: `draw` sets group 3 and dispatches, with the arguments in the buffer for a workgroup for each
    /// tile with splats.
    pub fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        class: usize,
        pipelines: &[wgpu::ComputePipeline],
        span: Span<'_>,
        mut draw: impl FnMut(&mut wgpu::ComputePass<'_>, &wgpu::Buffer),
    ) {
        let chunks = &self.classes[class];
        for chunk in chunks.iter().filter(|chunk| chunk.bands.len() > 1) {
            encoder.clear_buffer(&chunk.buffers.cursors, 0, None);
        }
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("tiles of splats"),
            timestamp_writes: span.compute(),
        });
        pass.set_bind_group(0, &self.camera, &[]);
        for (chunk, pipeline) in chunks.iter().zip(pipelines) {
            for band in &chunk.bands {
                pass.set_bind_group(1, &chunk.splats, &[]);
                if chunk.bands.len() > 1 {
                    self.fill(&mut pass, chunk, band);
                }
                pass.set_bind_group(2, &band.read.group, &[]);
                pass.set_pipeline(pipeline);
                draw(&mut pass, &chunk.buffers.dispatches);
            }
            if let Some(rest) = &chunk.rest {
                pass.set_bind_group(1, &chunk.splats, &[]);
                pass.set_bind_group(2, &rest.group, &[]);
                pass.set_pipeline(pipeline);
                draw(&mut pass, &chunk.buffers.dispatches);
            }
        }
    }
}

impl Pipelines {
    /// For the chunks of a view, whose bindings have the same types.
    fn new(gpu: &Gpu, camera: &CameraBinding, chunk: &Chunk) -> Self {
        let splats = splat_buffers::layout(gpu);
        let (project, fill) = (&chunk.project.layout, &chunk.bands[0].fill.layout);
        let pipeline = |shader: &str, entry: &str, own| {
            let layouts = [&camera.layout, &splats, own];
            let constants = if own == project { &camera.constants()[..] } else { &[] };
            gpu.compute_pipeline(shader, entry, &layouts, constants)
        };
        let scan = |entry: &str| {
            let constants = [("FIRST", 1.0), ("LAST", 1.0)];
            gpu.compute_pipeline("bins/scan.wgsl", entry, &[&chunk.scan.layout], &constants)
        };
        Self {
            project: pipeline("bins/project.wgsl", "project", project),
            count_large: pipeline("bins/project.wgsl", "count_large", project),
            sum: scan("sum"),
            arrange: scan("arrange"),
            fill: pipeline("bins/fill.wgsl", "fill", fill),
            fill_large: pipeline("bins/fill.wgsl", "fill_large", fill),
        }
    }
}

impl Buffers {
    /// For lists in this room, with the parameters and the number of bands: those of another frame where they are large
    /// enough.
    fn new(gpu: &Gpu, params: Params, room: Room, old: Option<&Self>) -> (Self, Params, u32) {
        let bytes = gpu.most_binding();
        let splats = u64::from(params.splats.max(1));
        let [x, y] = params.tiles;
        let tiles = u64::from(x * y);
        let Room { entries, bands, capacity } = room;
        let buffer = |label: &str, old: Option<&wgpu::Buffer>, size: u64| match old {
            Some(old) if old.size() >= size => old.clone(),
            _ => {
                let spare = gpu::spare(size);
                let size = (size + spare).next_multiple_of(16).min(bytes / 16 * 16).max(size);
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
        let buffers = Self {
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
            everything: old.and_then(|old| old.everything.clone()),
        };
        let params = Params { entries: entries.min(u32::MAX.into()) as u32, ..params };
        (buffers, params, bands as u32)
    }

    /// Keeps the list of this many splats, or none.
    fn list_everything(&mut self, gpu: &Gpu, splats: Option<u32>) {
        let Some(count) = splats else {
            self.everything = None;
            return;
        };
        let bytes = 4 * u64::from(count.max(1));
        if self.everything.as_ref().is_none_or(|list| list.size() < bytes) {
            let numbers: Vec<u32> = (0..count.max(1)).collect();
            let storage = wgpu::BufferUsages::STORAGE;
            self.everything = Some(gpu.buffer_with("all splats", storage, &numbers));
        }
    }
}

impl Chunk {
    /// The chunk of the splats `bound`, in these buffers. `ends`: whether it is the first and the last.
    fn new(
        gpu: &Gpu,
        bound: &splat_buffers::Chunk,
        (buffers, params, bands): (Buffers, Params, u32),
        filled: &wgpu::Buffer,
        ends: [bool; 2],
    ) -> Self {
        let [x, y] = params.tiles;
        let tiles = u64::from(x * y);
        let Buffers { placed, rects, large, list, busy, .. } = &buffers;
        let whole = wgpu::Buffer::as_entire_binding;
        let (read, written) = (gpu::storage_of, gpu::storage_read_write);
        let (word, pair, rect) = (4, 8, 16);
        let counts = gpu::first_bytes(&buffers.counts, 4 * tiles);
        let starts = gpu::first_bytes(&buffers.starts, 4 * (tiles + 1));
        let cursors = gpu::first_bytes(&buffers.cursors, 8 * tiles);
        let blocks = gpu::first_bytes(&buffers.blocks, 4 * tiles.div_ceil(BLOCK.into()));
        let uniform = |band: u32, rest: u32| {
            gpu.buffer_with("bins", gpu::UNIFORM, &[Params { band, rest, ..params }])
        };
        let of_params = gpu.branching::<Params>();
        let first = uniform(0, 0);
        let project = [
            (of_params, whole(&first)),
            (written(PLACED), whole(placed)),
            (written(rect), whole(rects)),
            (written(word), counts.clone()),
            (written(pair), whole(large)),
        ];
        let scan = [
            (written(word), counts),
            (written(pair), starts.clone()),
            (written(pair), cursors.clone()),
            (written(word), blocks),
            (written(pair), whole(busy)),
            (written(pair), whole(&buffers.emptied)),
            (written(word), whole(filled)),
            (written(32), whole(&buffers.dispatches)),
        ];
        let project = gpu.bind("projected splats", &project);
        let scan = gpu.bind("scanned bins", &scan);
        let lists = |uniform: &wgpu::Buffer, list: &wgpu::Buffer| {
            let lists = [
                (of_params, whole(uniform)),
                (read(PLACED), whole(placed)),
                (read(pair), starts.clone()),
                (read(pair), cursors.clone()),
                (read(word), whole(list)),
                (read(pair), whole(busy)),
            ];
            gpu.bind("bins", &lists)
        };
        let rest = buffers.everything.as_ref().map(|all| lists(&uniform(bands, 1), all));
        let bands = (0..bands).map(|band| {
            let uniform = uniform(band, 0);
            let fill = [
                (of_params, whole(&uniform)),
                (read(rect), whole(rects)),
                (read(pair), starts.clone()),
                (written(pair), cursors.clone()),
                (written(word), whole(list)),
                (read(pair), whole(large)),
            ];
            Band { fill: gpu.bind("filled bins", &fill), read: lists(&uniform, list) }
        });
        let bands = bands.collect();
        let [first, last] = ends.map(|end| f64::from(u8::from(end)));
        let constants = [("FIRST", first), ("LAST", last)];
        let scan_pipeline =
            gpu.compute_pipeline("bins/scan.wgsl", "scan", &[&scan.layout], &constants);
        let most_groups = match gpu.grain() {
            Grain::Pixel => 256,
            Grain::Column => 8,
        };
        let large_groups = params.splats.clamp(1, most_groups);
        let splats = bound.group.clone();
        Self { params, buffers, splats, project, scan, bands, rest, scan_pipeline, large_groups }
    }

    /// Workgroups that project and list its splats.
    fn groups(&self) -> u32 {
        (self.params.splats * self.params.lanes).div_ceil(THREADS)
    }
}

/// Bytes of a `ViewSplat`.
const PLACED: u64 = 48;

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
    gpu.texture("chunk state", size, STATES, wgpu::TextureFormat::R32Uint, usage)
}
