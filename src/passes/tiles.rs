//! The tiles of the picture that liquid covers: `shaders/tiles.wgsl`.
//!
//! Later passes are dispatched over these tiles alone. On a software adapter, which executes both sides
//! of every branch, this makes the empty part of a picture cheap.

use bytemuck::{Pod, Zeroable};
use glam::UVec2;

use super::Layers;
use crate::gpu::{self, Bound, Commands, Gpu, Span, TILE};

/// Sorts tiles into liquid and background.
#[derive(Debug)]
pub struct Tiles {
    lists: TileLists,
    sort: wgpu::ComputePipeline,
    arrange: Arrange,
}

/// Makes the dispatches of lists that another pass has filled.
#[derive(Debug)]
pub struct Arrange {
    lists: Bound,
    pipeline: wgpu::ComputePipeline,
    /// Sections of the lists.
    count: u32,
}

/// The lists of tiles on the device.
#[derive(Debug, Clone)]
pub struct TileLists {
    /// Count, then the tiles that liquid covers: x + 65536 y.
    pub liquid: wgpu::Buffer,
    /// Count, then all others.
    pub background: wgpu::Buffer,
    /// Arguments of indirect dispatches, at offsets such as [`TileLists::LIQUID`].
    pub dispatches: wgpu::Buffer,
    size: UVec2,
    sections: Sections,
    sections_buffer: wgpu::Buffer,
}

/// `Sections` of `tiles.wgsl`: the division of the lists.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct Sections {
    /// Tiles per section.
    pub tiles: u32,
    /// 32-bit words per section in a list.
    pub words: u32,
    /// Number of sections.
    pub count: u32,
}

impl Sections {
    /// The sections of a view of `size` pixels on this device, for `each` work per pixel in the slowest
    /// pass.
    pub fn for_work(gpu: &Gpu, size: UVec2, each: u64) -> Self {
        let limits = gpu.device.limits();
        let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        Self::new(size, each, gpu.most_work(), limits.min_storage_buffer_offset_alignment, bytes)
    }

    /// The sections of a view of `size` pixels, for `each` work per pixel in the slowest pass: a section has
    /// at most `most` work, but at least one tile. Its lists begin at multiples of `alignment` bytes and
    /// take at most `bytes` in total.
    pub fn new(size: UVec2, each: u64, most: u64, alignment: u32, bytes: u64) -> Self {
        let all = size.map(|n| n.div_ceil(TILE)).element_product();
        let fit = most / each.saturating_mul(u64::from(TILE * TILE)).max(1);
        if fit >= u64::from(all) {
            return Self { tiles: all, words: 1 + all, count: 1 };
        }
        let aligned = |tiles: u32| {
            let words = (1 + tiles).next_multiple_of((alignment / 4).max(1));
            Self { tiles, words, count: all.div_ceil(tiles) }
        };
        let sections = aligned(fit.max(1) as u32);
        match 4 * u64::from(sections.words) * u64::from(sections.count) <= bytes {
            true => sections,
            // Fill the padding with tiles.
            false => aligned(sections.words - 1),
        }
    }
}

impl TileLists {
    /// Offset of the dispatch over the liquid's tiles.
    pub const LIQUID: u64 = 0;
    /// Offset of the dispatch over the liquid's tiles with front and back in z.
    pub const LIQUID_LAYERS: u64 = 16;
    /// Offset of the dispatch over the background's tiles.
    pub const BACKGROUND: u64 = 32;
    /// Bytes from one section's dispatches to the next.
    const DISPATCH_STRIDE: u64 = 48;

    /// Creates the lists of a view of `size` pixels, empty.
    pub fn new(gpu: &Gpu, size: UVec2, sections: Sections) -> Self {
        create_lists(gpu, size, sections)
    }

    /// The division of the lists, for shaders.
    pub fn sections_buffer(&self) -> &wgpu::Buffer {
        &self.sections_buffer
    }

    /// Records the emptying of both lists.
    pub fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        // Clear the counts, one at the start of each section.
        let cleared = (self.sections.count == 1).then_some(4);
        encoder.clear_buffer(&self.liquid, 0, cleared);
        encoder.clear_buffer(&self.background, 0, cleared);
    }

    /// Indices of the sections.
    pub fn sections(&self) -> std::ops::Range<u32> {
        0..self.sections.count
    }

    /// Workgroups over all tiles of a section, eight to each.
    pub fn groups_of_eight(&self) -> u32 {
        self.sections.tiles.div_ceil(8)
    }

    /// Pixels per section.
    pub fn pixels(&self) -> u64 {
        u64::from(self.sections.tiles) * u64::from(TILE * TILE)
    }

    /// The binding of a section of `list`.
    pub fn section<'a>(&self, list: &'a wgpu::Buffer, section: u32) -> wgpu::BindingResource<'a> {
        let bytes = 4 * u64::from(self.sections.words);
        let (offset, size) = (u64::from(section) * bytes, wgpu::BufferSize::new(bytes));
        wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer: list, offset, size })
    }

    /// Byte offset of the arguments of a section's dispatch.
    pub fn dispatch(&self, which: u64, section: u32) -> u64 {
        Self::DISPATCH_STRIDE * u64::from(section) + which
    }

    /// Records kernels over the tiles with liquid, one after the other: each over all sections, since a pixel reads what
    /// its neighbours in other sections have found. `groups` are the first bind groups of a section's kernel; a pixel
    /// takes `work` layer evaluations in each.
    pub fn run_on_liquid<'a, const N: usize>(
        &self,
        commands: &mut Commands<'_>,
        (label, span): (&str, Span<'_>),
        work: u64,
        kernels: [&wgpu::ComputePipeline; N],
        groups: impl Fn(u32, usize) -> [&'a wgpu::BindGroup; 3],
    ) {
        let last = self.sections().end - 1;
        for (kernel, pipeline) in kernels.into_iter().enumerate() {
            for section in self.sections() {
                commands.reserve(self.pixels() * work);
                let is_first = kernel == 0 && section == 0;
                let span = span.part(is_first, kernel + 1 == N && section == last);
                let mut pass = commands.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some(label),
                    timestamp_writes: span.compute(),
                });
                for (i, group) in (0..).zip(groups(section, kernel)) {
                    pass.set_bind_group(i, group, &[]);
                }
                pass.set_pipeline(pipeline);
                let at = self.dispatch(Self::LIQUID, section);
                pass.dispatch_workgroups_indirect(&self.dispatches, at);
            }
        }
    }
}

impl Tiles {
    /// Prepares the sorting of the tiles into `lists` by the splatted layers.
    pub fn prepare(
        gpu: &Gpu,
        lists: &TileLists,
        aggregate: &Layers,
        splash: Option<&Layers>,
    ) -> Self {
        let arrange = Arrange::with_splashes(gpu, lists, aggregate, splash);
        let constants = [("SPLASH", f64::from(u8::from(splash.is_some())))];
        let layouts = [&arrange.lists.layout];
        let sort = gpu.compute_pipeline("tiles.wgsl", "sort", &layouts, &constants);
        Self { lists: lists.clone(), sort, arrange }
    }

    /// Records the sorting of the tiles.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, span: Span<'_>) {
        self.lists.clear(encoder);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("tiles"),
            timestamp_writes: span.compute(),
        });
        pass.set_bind_group(0, &self.arrange.lists.group, &[]);
        pass.set_pipeline(&self.sort);
        let (x, y) = gpu::workgroups(self.lists.size.map(|n| n.div_ceil(TILE)));
        pass.dispatch_workgroups(x, y, 1);
        self.arrange.dispatch(&mut pass);
    }
}

impl Arrange {
    /// Prepares the dispatches of `lists`, filled from `layers`.
    pub fn prepare(gpu: &Gpu, lists: &TileLists, layers: &Layers) -> Self {
        Self::with_splashes(gpu, lists, layers, None)
    }

    fn with_splashes(
        gpu: &Gpu,
        lists: &TileLists,
        aggregate: &Layers,
        splash: Option<&Layers>,
    ) -> Self {
        let splash = splash.unwrap_or(aggregate);
        let list = gpu::storage_read_write(8);
        let bindings = [
            (gpu.layers(), wgpu::BindingResource::TextureView(&aggregate.view)),
            (gpu.layers(), wgpu::BindingResource::TextureView(&splash.view)),
            (list, lists.liquid.as_entire_binding()),
            (list, lists.background.as_entire_binding()),
            (gpu::storage_read_write(48), lists.dispatches.as_entire_binding()),
            (gpu::storage::<Sections>(), lists.sections_buffer.as_entire_binding()),
        ];
        let count = lists.sections.count;
        let lists = gpu.bind("tiles", &bindings);
        let pipeline = gpu.compute_pipeline("tiles.wgsl", "arrange", &[&lists.layout], &[]);
        Self { lists, pipeline, count }
    }

    /// Records the dispatches.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_bind_group(0, &self.lists.group, &[]);
        self.dispatch(&mut pass);
    }

    fn dispatch(&self, pass: &mut wgpu::ComputePass<'_>) {
        pass.set_pipeline(&self.pipeline);
        gpu::dispatch(pass, self.count);
    }
}

fn create_lists(gpu: &Gpu, size: UVec2, sections: Sections) -> TileLists {
    let (words, count) = (u64::from(sections.words), u64::from(sections.count));
    let buffer = |label: &str, size: u64, usage: wgpu::BufferUsages| {
        gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage: usage | wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        })
    };
    let list = |label: &str| buffer(label, 4 * words * count, wgpu::BufferUsages::COPY_DST);
    TileLists {
        liquid: list("liquid tiles"),
        background: list("background tiles"),
        dispatches: buffer(
            "tile dispatches",
            TileLists::DISPATCH_STRIDE * count,
            wgpu::BufferUsages::INDIRECT,
        ),
        size,
        sections,
        sections_buffer: gpu.buffer_with("tile sections", wgpu::BufferUsages::STORAGE, &[sections]),
    }
}

/// Which tiles of an image contain liquid: those of the frame before, and those of this one.
///
/// An empty tile need not be written again: software adapters take 30 ns for each texel.
#[derive(Debug, Clone)]
pub struct Filled {
    /// `array<u32>`, one for each tile.
    pub before: wgpu::Buffer,
    /// The same of this frame.
    pub now: wgpu::Buffer,
}

impl Filled {
    /// Of a new image of `size` pixels, which is empty.
    pub fn new(gpu: &Gpu, size: UVec2) -> Self {
        let tiles = size.map(|n| n.div_ceil(TILE)).element_product();
        let buffer = || {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("filled tiles"),
                size: 4 * u64::from(tiles),
                usage: wgpu::BufferUsages::STORAGE
                    | wgpu::BufferUsages::COPY_SRC
                    | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        Self { before: buffer(), now: buffer() }
    }

    /// Records the end of the frame.
    pub fn end(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.copy_buffer_to_buffer(&self.now, 0, &self.before, 0, None);
    }
}
