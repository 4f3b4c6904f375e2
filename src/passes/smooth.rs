//! Smoothing of the aggregate layers: `shaders/smooth/`.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use glam::UVec2;
use wgpu::TextureViewDimension::{D2, D2Array};

use super::gaps::Gaps;
use super::tiles::{Filled, TileLists};
use super::{CameraBinding, Layers};
use crate::gpu::{self, Commands, Gpu, Span};
use crate::settings::{self, Filter};

/// Parameters of one iteration, as in `smooth/iterate.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// Distance between taps, in pixels or in particle radii.
    pub stride: f32,
    /// Particle radius, m.
    pub radius: f32,
    /// 1/σ², 1/m².
    pub inv_sigma2: f32,
    /// δ, m.
    pub delta: f32,
    /// μ, m.
    pub mu: f32,
    /// Smallest distance between taps with which the iteration changes a texel, in pixels.
    pub least: f32,
}

impl Params {
    /// The parameters of each iteration.
    pub fn iterations(settings: &settings::Smooth, radius: f32) -> Vec<Self> {
        let in_radii = settings.unit == settings::Unit::Radius;
        let window = if in_radii { settings.window } else { settings.window - 1.0 };
        let stride = window / (settings.taps - 1) as f32;
        (0..settings.iterations)
            .map(|i| Self {
                // Taps have gaps, so each iteration reaches half as far as the one before.
                stride: stride * 0.5f32.powi(i as i32),
                radius,
                inv_sigma2: (settings.sigma * radius).powi(-2),
                delta: settings.delta * radius,
                mu: settings.mu * radius,
                // Taps closer than half a pixel would be moved apart to one, and liquid far away be smoothed over
                // more of its radii than liquid near by.
                least: if in_radii && i > 0 { 0.5 } else { 0.0 },
            })
            .collect()
    }
}

/// One specialisation of `iterate`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Variant {
    filter: Filter,
    taps: u32,
    unit: settings::Unit,
}

impl Variant {
    fn new(settings: &settings::Smooth) -> Self {
        Self { filter: settings.filter, taps: settings.taps, unit: settings.unit }
    }

    fn constants(self) -> [(&'static str, f64); 2] {
        let in_radii = self.unit == settings::Unit::Radius;
        [("TAPS", (self.taps / 2).into()), ("IN_RADII", f64::from(u8::from(in_radii)))]
    }

    fn shader(self) -> &'static str {
        match self.filter {
            Filter::PlaneFit => "smooth/plane_fit.wgsl",
            Filter::Bilateral => "smooth/bilateral.wgsl",
            Filter::NarrowRange => "smooth/narrow_range.wgsl",
        }
    }
}

/// Smooths a pair of layers.
#[derive(Debug)]
pub struct Smooth {
    /// Output: smoothed planes.
    pub layers: Layers,
    prepare: wgpu::ComputePipeline,
    iterate: HashMap<Variant, wgpu::ComputePipeline>,
    /// By the number of gaps.
    planes: HashMap<u32, wgpu::ComputePipeline>,
    copy: HashMap<u32, wgpu::ComputePipeline>,
    /// For each gap; compiled on first use.
    gaps: Vec<GapPipelines>,
    /// Whether planes bear the sizes of their particles.
    sizes: bool,
    /// Without and with backs.
    blank: [wgpu::ComputePipeline; 2],
    blank_layout: wgpu::BindGroupLayout,
    /// Tiles of the layers and states.
    filled: Filled,
    layout: wgpu::BindGroupLayout,
    /// Normal and depth, written alternately.
    states: [Layers; 2],
    splatted: Layers,
    frame: Frame,
}

/// Constants of all kernels.
fn constants_of(camera: &CameraBinding, sizes: bool) -> Vec<(&'static str, f64)> {
    [&camera.constants()[..], &[("SIZES", f64::from(u8::from(sizes)))]].concat()
}

fn prepare_kernel(
    gpu: &Gpu,
    camera: &CameraBinding,
    layout: &wgpu::BindGroupLayout,
    sizes: bool,
) -> wgpu::ComputePipeline {
    let layouts = [&camera.layout, layout];
    let constants = constants_of(camera, sizes);
    gpu::compute_pipeline(gpu, "smooth/plane_fit.wgsl", "prepare", &layouts, &constants)
}

/// Iterations that smooth the sides of gaps, at most: they are seen through the liquid in front of them.
const MOST_GAP_ITERATIONS: usize = 3;

/// The kernels of a gap's sides.
#[derive(Debug)]
struct GapPipelines {
    prepare: wgpu::ComputePipeline,
    iterate: HashMap<Variant, wgpu::ComputePipeline>,
    carry: wgpu::ComputePipeline,
    planes: wgpu::ComputePipeline,
}

/// What the smoothing covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Coverage {
    /// Backs as well as fronts.
    pub backs: bool,
    /// Gaps that a pixel distinguishes.
    pub gaps: u32,
    /// Planes bear the sizes of their particles.
    pub sizes: bool,
}

/// Configuration of one frame's smoothing.
#[derive(Debug)]
struct Frame {
    variant: Variant,
    iterations: Vec<Params>,
    /// Backs are smoothed as well as fronts.
    backs: bool,
    /// Gaps that a pixel distinguishes.
    gaps: u32,
    /// Work of an iteration per pixel, in layer evaluations.
    work: u64,
}

impl Smooth {
    /// Compiles the kernels that all filters share; a filter is compiled on first use. `splatted` is
    /// the input.
    pub fn new(gpu: &Gpu, camera: &CameraBinding, splatted: &Layers) -> Self {
        let bindings = [
            gpu::uniform::<Params>(),
            gpu.layers(),
            gpu::storage_texture(Layers::FORMAT, D2Array),
            gpu::storage_texture(Layers::FORMAT, D2Array),
            gpu.layers(),
            gpu::storage_of(8),
            gpu::sampled(D2),
            gpu::sampled(D2Array),
        ];
        let layout = gpu.layout("smooth", wgpu::ShaderStages::COMPUTE, &bindings);
        let written = gpu::storage_texture(Layers::FORMAT, D2Array);
        let list = gpu::storage_of(8);
        let blank_layout = gpu.layout(
            "smooth blank",
            wgpu::ShaderStages::COMPUTE,
            &[
                list,
                list,
                written,
                written,
                written,
                gpu::storage_of(4),
                gpu::storage_read_write(4),
            ],
        );
        let (layers, states) = create_layers(gpu, splatted);
        Self {
            prepare: prepare_kernel(gpu, camera, &layout, false),
            iterate: HashMap::new(),
            planes: HashMap::new(),
            copy: HashMap::new(),
            gaps: Vec::new(),
            sizes: false,
            layers,
            layout,
            blank: [0.0, 1.0].map(|backs| {
                let constants = [("BACKS", backs)];
                let layouts = [&blank_layout];
                gpu::compute_pipeline(gpu, "smooth/blank.wgsl", "blank", &layouts, &constants)
            }),
            blank_layout,
            filled: Filled::new(gpu, UVec2::ONE),
            states,
            splatted: splatted.clone(),
            frame: Frame {
                variant: Variant::new(&settings::Smooth::default()),
                iterations: Vec::new(),
                backs: false,
                gaps: 0,
                work: 0,
            },
        }
    }

    /// Replaces the layers to match the size and mip levels of `splatted`.
    pub fn resize(&mut self, gpu: &Gpu, splatted: &Layers) {
        (self.layers, self.states) = create_layers(gpu, splatted);
        self.splatted = splatted.clone();
        let size = UVec2::new(splatted.texture.width(), splatted.texture.height());
        self.filled = Filled::new(gpu, size);
    }

    /// As [`super::splat::Splat::share`].
    pub fn share(&mut self, other: &Self) {
        (self.layers, self.states) = (other.layers.clone(), other.states.clone());
        (self.splatted, self.filled) = (other.splatted.clone(), other.filled.clone());
    }

    /// Sets the frame's iterations and what they cover, and compiles the filter on first
    /// use.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        camera: &CameraBinding,
        settings: &settings::Smooth,
        iterations: &[Params],
        coverage: Coverage,
    ) {
        let Coverage { backs, gaps, sizes } = coverage;
        if self.sizes != sizes {
            self.prepare = prepare_kernel(gpu, camera, &self.layout, sizes);
            self.iterate.clear();
            self.planes.clear();
            self.gaps.clear();
            self.sizes = sizes;
        }
        let layouts = [&camera.layout, &self.layout];
        let sized = constants_of(camera, sizes);
        let variant = Variant::new(settings);
        let iterations = iterations.to_vec();
        self.frame = Frame { variant, iterations, backs, gaps, work: work(settings) };
        let counted = |entry: &str| {
            let constants = [&sized[..], &[("GAPS", gaps.into())]].concat();
            gpu::compute_pipeline(gpu, "smooth/plane_fit.wgsl", entry, &layouts, &constants)
        };
        if self.frame.iterations.is_empty() {
            self.copy.entry(gaps).or_insert_with(|| counted("copy"));
            return;
        }
        self.planes.entry(gaps).or_insert_with(|| counted("planes"));
        self.iterate.entry(variant).or_insert_with(|| {
            let constants = [&sized[..], &variant.constants()].concat();
            gpu::compute_pipeline(gpu, variant.shader(), "iterate", &layouts, &constants)
        });
        for gap in 0..gaps {
            let constants = [&sized[..], &[("GAP", gap.into())]].concat();
            if self.gaps.len() == gap as usize {
                let pipeline = |entry: &str| {
                    let shader = "smooth/plane_fit.wgsl";
                    gpu::compute_pipeline(gpu, shader, entry, &layouts, &constants)
                };
                self.gaps.push(GapPipelines {
                    prepare: pipeline("prepare"),
                    iterate: HashMap::new(),
                    carry: pipeline("carry"),
                    planes: pipeline("planes"),
                });
            }
            self.gaps[gap as usize].iterate.entry(variant).or_insert_with(|| {
                let constants = [&constants[..], &variant.constants()].concat();
                gpu::compute_pipeline(gpu, variant.shader(), "iterate", &layouts, &constants)
            });
        }
    }

    /// Records the smoothing of the splatted layers into [`Smooth::layers`]; requires [`Smooth::prepare`]. Without
    /// iterations it copies them, and flags texels with gaps. `splash` are the splashes' layers, if there are any.
    pub fn record(
        &self,
        commands: &mut Commands<'_>,
        camera: &CameraBinding,
        tiles: &TileLists,
        gaps: &Gaps,
        splash: Option<&Layers>,
        span: Span<'_>,
    ) {
        let gpu = commands.gpu;
        let Frame { variant, iterations, backs, gaps: count, work } = &self.frame;
        let planes = gpu::level_view(&self.layers.texture, 0, D2Array);
        self.record_blank(commands, tiles, &planes, span.first());
        let unused = Params::zeroed();
        let steps = match iterations.last() {
            None => vec![(&self.copy[count], &unused)],
            Some(last) => {
                let iterate = &self.iterate[variant];
                let mut steps = vec![(&self.prepare, last)];
                steps.extend(iterations.iter().map(|params| (iterate, params)));
                steps.push((&self.planes[count], last));
                steps
            }
        };
        let flags = gaps.tiles.create_view(&Default::default());
        let splash = splash.unwrap_or(&self.splatted);
        // One buffer per iteration: a uniform written twice holds its last value for the whole frame.
        let buffer = |params: &Params| gpu::buffer_with(gpu, "smooth", gpu::UNIFORM, &[*params]);
        let steps = (0..).zip(steps).map(|(i, (pipeline, params))| (i, pipeline, buffer(params)));
        let steps: Vec<(usize, &wgpu::ComputePipeline, wgpu::Buffer)> = steps.collect();
        let work = tiles.pixels().saturating_mul(*work);
        let of_step = |step| tiles.sections().map(move |section| ((step, section), work));
        let parts: Vec<_> = steps.iter().flat_map(of_step).collect();
        commands.compute(
            "smooth",
            span.last(),
            &parts,
            |pass, ((i, pipeline, params), section)| {
                let resources = [
                    params.as_entire_binding(),
                    wgpu::BindingResource::TextureView(&self.states[(i + 1) % 2].view),
                    wgpu::BindingResource::TextureView(&self.states[i % 2].view),
                    wgpu::BindingResource::TextureView(&planes),
                    wgpu::BindingResource::TextureView(&self.splatted.view),
                    tiles.section(&tiles.liquid, *section),
                    wgpu::BindingResource::TextureView(&flags),
                    wgpu::BindingResource::TextureView(&splash.view),
                ];
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, &camera.group, &[]);
                pass.set_bind_group(
                    1,
                    &gpu::bind_group(gpu, "smooth", &self.layout, &resources),
                    &[],
                );
                let covered = if *backs { TileLists::LIQUID_LAYERS } else { TileLists::LIQUID };
                let at = tiles.dispatch(covered, *section);
                pass.dispatch_workgroups_indirect(&tiles.dispatches, at);
            },
        );
    }
}

impl Smooth {
    /// Records the emptying of all that the steps do not write.
    fn record_blank(
        &self,
        commands: &mut Commands<'_>,
        tiles: &TileLists,
        planes: &wgpu::TextureView,
        span: Span<'_>,
    ) {
        let mut pass = commands.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("smooth blank"),
            timestamp_writes: span.compute(),
        });
        pass.set_pipeline(&self.blank[usize::from(self.frame.backs)]);
        for section in tiles.sections() {
            let resources = [
                tiles.section(&tiles.liquid, section),
                tiles.section(&tiles.background, section),
                wgpu::BindingResource::TextureView(&self.states[0].view),
                wgpu::BindingResource::TextureView(&self.states[1].view),
                wgpu::BindingResource::TextureView(planes),
                self.filled.before.as_entire_binding(),
                self.filled.now.as_entire_binding(),
            ];
            let group =
                gpu::bind_group(commands.gpu, "smooth blank", &self.blank_layout, &resources);
            pass.set_bind_group(0, &group, &[]);
            gpu::dispatch(&mut pass, tiles.groups_of_eight());
        }
        drop(pass);
        self.filled.end(commands.encoder);
    }

    /// Records the smoothing of the sides of gaps, after [`Smooth::record`]. The splatted and the smoothed layers
    /// hold its states by turns.
    pub fn record_gaps(
        &self,
        gpu: &Gpu,
        commands: &mut Commands<'_>,
        camera: &CameraBinding,
        gaps: &Gaps,
        span: Span<'_>,
    ) {
        let Frame { variant, iterations, gaps: count, work, .. } = &self.frame;
        // The state that `record` left behind.
        let [whole, unused] = match iterations.len() % 2 {
            0 => [&self.states[0], &self.states[1]],
            _ => [&self.states[1], &self.states[0]],
        };
        let iterations = &iterations[..iterations.len().min(MOST_GAP_ITERATIONS)];
        let Some(last) = iterations.last() else { return };
        let tiles = &gaps.tile_lists;
        let flags = gaps.tiles.create_view(&Default::default());
        let unused = gpu::level_view(&unused.texture, 0, D2Array);
        let buffer = |params: &Params| gpu::buffer_with(gpu, "smooth", gpu::UNIFORM, &[*params]);
        let mut steps = Vec::new();
        for pipelines in self.gaps.iter().take(*count as usize) {
            let iterate = &pipelines.iterate[variant];
            steps.push((&pipelines.prepare, buffer(last)));
            // The last state must be in the splatted layers.
            if iterations.len().is_multiple_of(2) {
                steps.push((&pipelines.carry, buffer(last)));
            }
            steps.extend(iterations.iter().map(|params| (iterate, buffer(params))));
            steps.push((&pipelines.planes, buffer(last)));
        }
        let textures = [&self.splatted, &self.layers];
        let targets = textures.map(|layers| gpu::level_view(&layers.texture, 0, D2Array));
        let work = tiles.pixels().saturating_mul(*work);
        let of_step = |step| tiles.sections().map(move |section| ((step, section), work));
        let parts: Vec<_> = (0..steps.len()).flat_map(of_step).collect();
        commands.compute("smooth gaps", span, &parts, |pass, &(i, section)| {
            let (pipeline, params) = &steps[i];
            let resources = [
                params.as_entire_binding(),
                wgpu::BindingResource::TextureView(&targets[i % 2]),
                wgpu::BindingResource::TextureView(&targets[(i + 1) % 2]),
                wgpu::BindingResource::TextureView(&unused),
                wgpu::BindingResource::TextureView(&whole.view),
                tiles.section(&tiles.liquid, section),
                wgpu::BindingResource::TextureView(&flags),
                wgpu::BindingResource::TextureView(&whole.view),
            ];
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &camera.group, &[]);
            pass.set_bind_group(1, &gpu::bind_group(gpu, "smooth", &self.layout, &resources), &[]);
            let at = tiles.dispatch(TileLists::LIQUID_LAYERS, section);
            pass.dispatch_workgroups_indirect(&tiles.dispatches, at);
        });
    }
}

/// The work of an iteration per pixel, in layer evaluations.
pub fn work(settings: &settings::Smooth) -> u64 {
    2 * u64::from(settings.taps).pow(2)
}

fn create_layers(gpu: &Gpu, splatted: &Layers) -> (Layers, [Layers; 2]) {
    let size = UVec2::new(splatted.texture.width(), splatted.texture.height());
    let usage = wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::COPY_SRC;
    let new = |label: &str, layers, levels| Layers::new(gpu, label, size, layers, levels, usage);
    let (all, levels) =
        (splatted.texture.depth_or_array_layers(), splatted.texture.mip_level_count());
    (
        new("smoothed layers", all, levels),
        [new("smooth state 0", 2, 1), new("smooth state 1", 2, 1)],
    )
}
