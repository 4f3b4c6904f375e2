//! Smoothing of the aggregate layers: `shaders/smooth/`.

use bytemuck::{Pod, Zeroable};
use glam::UVec2;
use wgpu::BindingResource::TextureView;
use wgpu::TextureViewDimension::{D2, D2Array};

use super::gaps::GapImages;
use super::tiles::{Filled, TileLists};
use super::{CameraBinding, Layers};
use crate::gpu::{self, Bound, Commands, Gpu, Span};
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
#[derive(Debug, Clone, Copy)]
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

/// The smoothed layers of a view.
#[derive(Debug, Clone)]
pub struct SmoothImages {
    /// Smoothed planes.
    pub layers: Layers,
    /// Normal and depth, written alternately.
    states: [Layers; 2],
    /// Tiles of the layers and states.
    filled: Filled,
}

/// Layers and tiles that the smoothing reads.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    /// Splatted layers of the aggregates; those of gaps are overwritten.
    pub splatted: &'a Layers,
    /// Layers of the splashes, if there are any.
    pub splash: Option<&'a Layers>,
    /// Tiles that liquid covers.
    pub tiles: &'a TileLists,
    /// Gaps of the layers.
    pub gaps: &'a GapImages,
}

/// Iterations that smooth the sides of gaps, at most: they are seen through the liquid in front of them.
const MOST_GAP_ITERATIONS: usize = 3;

/// Layers that are smoothed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Coverage {
    /// Backs as well as fronts.
    pub backs: bool,
    /// Gaps that a pixel distinguishes.
    pub gaps: u32,
    /// Planes bear the sizes of their particles.
    pub sizes: bool,
}

/// Smooths the layers of the aggregates, and the sides of their gaps.
#[derive(Debug)]
pub struct Smooth {
    camera: wgpu::BindGroup,
    blank: wgpu::ComputePipeline,
    /// By section of the tiles.
    blanked: Vec<Bound>,
    filled: Filled,
    whole: Steps,
    /// `None` without gaps.
    gaps: Option<Steps>,
}

/// Kernels that run one after the other on the same tiles.
#[derive(Debug)]
struct Steps {
    tiles: TileLists,
    /// Which of the tiles' dispatches they run on.
    covered: u64,
    /// Each with its bindings by section of the tiles.
    steps: Vec<(wgpu::ComputePipeline, Vec<Bound>)>,
    /// Work of a step per pixel, in layer evaluations.
    work: u64,
}

impl SmoothImages {
    /// Creates layers of the size and mip levels of `splatted`, empty.
    pub fn new(gpu: &Gpu, splatted: &Layers) -> Self {
        let size = UVec2::new(splatted.texture.width(), splatted.texture.height());
        let usage = wgpu::TextureUsages::STORAGE_BINDING
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC;
        let new =
            |label: &str, layers, levels| Layers::new(gpu, label, size, layers, levels, usage);
        let (all, levels) =
            (splatted.texture.depth_or_array_layers(), splatted.texture.mip_level_count());
        Self {
            layers: new("smoothed layers", all, levels),
            states: [new("smooth state 0", 2, 1), new("smooth state 1", 2, 1)],
            filled: Filled::new(gpu, size),
        }
    }
}

impl Smooth {
    /// Prepares these iterations. Without any, layers are copied, and texels with gaps flagged.
    pub fn prepare(
        gpu: &Gpu,
        camera: &CameraBinding,
        inputs: Inputs<'_>,
        images: &SmoothImages,
        settings: &settings::Smooth,
        iterations: &[Params],
        coverage: Coverage,
    ) -> Self {
        let constants = [("BACKS", f64::from(u8::from(coverage.backs)))];
        let blanked: Vec<_> = inputs
            .tiles
            .sections()
            .map(|section| bind_blank(gpu, inputs.tiles, images, section))
            .collect();
        let layouts = [&blanked[0].layout];
        let blank = gpu.compute_pipeline("smooth/blank.wgsl", "blank", &layouts, &constants);
        let kernels = Kernels { gpu, camera, settings, sizes: coverage.sizes };
        let whole = whole_steps(kernels, inputs, images, iterations, coverage);
        let gaps = (coverage.gaps > 0 && !iterations.is_empty())
            .then(|| gap_steps(kernels, inputs, images, iterations, coverage.gaps));
        let (camera, filled) = (camera.group.clone(), images.filled.clone());
        Self { camera, blank, blanked, filled, whole, gaps }
    }

    /// Records the smoothing of the splatted layers.
    pub fn record(&self, commands: &mut Commands<'_>, span: Span<'_>) {
        self.record_blank(commands, span.first());
        self.whole.record(commands, &self.camera, "smooth", span.last());
    }

    /// Records the emptying of all that the steps do not write.
    fn record_blank(&self, commands: &mut Commands<'_>, span: Span<'_>) {
        let mut pass = commands.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("smooth blank"),
            timestamp_writes: span.compute(),
        });
        pass.set_pipeline(&self.blank);
        for bound in &self.blanked {
            pass.set_bind_group(0, &bound.group, &[]);
            gpu::dispatch(&mut pass, self.whole.tiles.groups_of_eight());
        }
        drop(pass);
        self.filled.end(commands.encoder);
    }

    /// Records the smoothing of the sides of gaps, after [`Smooth::record`].
    pub fn record_gaps(&self, commands: &mut Commands<'_>, span: Span<'_>) {
        if let Some(gaps) = &self.gaps {
            gaps.record(commands, &self.camera, "smooth gaps", span);
        }
    }
}

impl Steps {
    fn record(
        &self,
        commands: &mut Commands<'_>,
        camera: &wgpu::BindGroup,
        label: &'static str,
        span: Span<'_>,
    ) {
        let work = self.tiles.pixels().saturating_mul(self.work);
        let of_step = |step| self.tiles.sections().map(move |section| ((step, section), work));
        let parts: Vec<_> = self.steps.iter().flat_map(of_step).collect();
        commands.compute(label, span, &parts, |pass, &((pipeline, bound), section)| {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, camera, &[]);
            pass.set_bind_group(1, &bound[section as usize].group, &[]);
            let at = self.tiles.dispatch(self.covered, section);
            pass.dispatch_workgroups_indirect(&self.tiles.dispatches, at);
        });
    }
}

/// Group 0 of `smooth/blank.wgsl`.
fn bind_blank(gpu: &Gpu, tiles: &TileLists, images: &SmoothImages, section: u32) -> Bound {
    let planes = gpu::level_view(&images.layers.texture, 0, D2Array);
    let (list, written) = (gpu::storage_of(8), gpu::storage_texture(Layers::FORMAT, D2Array));
    let bindings = [
        (list, tiles.section(&tiles.liquid, section)),
        (list, tiles.section(&tiles.background, section)),
        (written, TextureView(&images.states[0].view)),
        (written, TextureView(&images.states[1].view)),
        (written, TextureView(&planes)),
        (gpu::storage_of(4), images.filled.before.as_entire_binding()),
        (gpu::storage_read_write(4), images.filled.now.as_entire_binding()),
    ];
    gpu.bind("smooth blank", &bindings)
}

/// Images of a step, as in `smooth/iterate.wgsl`.
#[derive(Clone, Copy)]
struct StepImages<'a> {
    state: &'a wgpu::TextureView,
    next: &'a wgpu::TextureView,
    planes: &'a wgpu::TextureView,
    splatted: &'a wgpu::TextureView,
    flags: &'a wgpu::TextureView,
    splash: &'a wgpu::TextureView,
}

fn bind_step(
    gpu: &Gpu,
    params: &wgpu::Buffer,
    images: StepImages<'_>,
    tiles: wgpu::BindingResource<'_>,
) -> Bound {
    let written = gpu::storage_texture(Layers::FORMAT, D2Array);
    let bindings = [
        (gpu::uniform::<Params>(), params.as_entire_binding()),
        (gpu.layers(), TextureView(images.state)),
        (written, TextureView(images.next)),
        (written, TextureView(images.planes)),
        (gpu.layers(), TextureView(images.splatted)),
        (gpu::storage_of(8), tiles),
        (gpu::sampled(D2), TextureView(images.flags)),
        (gpu::sampled(D2Array), TextureView(images.splash)),
    ];
    gpu.bind("smooth", &bindings)
}

/// The kernels of a frame.
#[derive(Clone, Copy)]
struct Kernels<'a> {
    gpu: &'a Gpu,
    camera: &'a CameraBinding,
    settings: &'a settings::Smooth,
    /// Planes bear the sizes of their particles.
    sizes: bool,
}

impl Kernels<'_> {
    /// One step on these tiles, with further constants.
    fn step(
        self,
        entry: &str,
        constants: &[(&str, f64)],
        params: &Params,
        images: StepImages<'_>,
        tiles: &TileLists,
    ) -> (wgpu::ComputePipeline, Vec<Bound>) {
        let Self { gpu, camera, settings, sizes } = self;
        // One buffer per step: a uniform written twice holds its last value for the whole frame.
        let params = gpu.buffer_with("smooth", gpu::UNIFORM, &[*params]);
        let bind = |section| bind_step(gpu, &params, images, tiles.section(&tiles.liquid, section));
        let bound: Vec<_> = tiles.sections().map(bind).collect();
        let variant = Variant::new(settings);
        let sized = [("SIZES", f64::from(u8::from(sizes)))];
        let mut all = [&camera.constants()[..], &sized, constants].concat();
        let iterates = entry == "iterate";
        if iterates {
            all.extend(variant.constants());
        }
        let shader = if iterates { variant.shader() } else { "smooth/plane_fit.wgsl" };
        let layouts = [&camera.layout, &bound[0].layout];
        (gpu.compute_pipeline(shader, entry, &layouts, &all), bound)
    }
}

/// The steps from the splatted layers to the smoothed ones.
fn whole_steps(
    kernels: Kernels<'_>,
    inputs: Inputs<'_>,
    images: &SmoothImages,
    iterations: &[Params],
    coverage: Coverage,
) -> Steps {
    let Inputs { splatted, splash, tiles, gaps } = inputs;
    let planes = gpu::level_view(&images.layers.texture, 0, D2Array);
    let flags = gaps.tiles.create_view(&Default::default());
    let states = &images.states;
    let step = |i: usize, entry: &str, constants: &[(&str, f64)], params: &Params| {
        let images = StepImages {
            state: &states[(i + 1) % 2].view,
            next: &states[i % 2].view,
            planes: &planes,
            splatted: &splatted.view,
            flags: &flags,
            splash: &splash.unwrap_or(splatted).view,
        };
        kernels.step(entry, constants, params, images, tiles)
    };
    let counted = [("GAPS", coverage.gaps.into())];
    let steps = match iterations.last() {
        None => vec![step(0, "copy", &counted, &Params::zeroed())],
        Some(last) => {
            let mut steps = vec![step(0, "prepare", &[], last)];
            let iterate = |(i, params)| step(i, "iterate", &[], params);
            steps.extend((1..).zip(iterations).map(iterate));
            steps.push(step(steps.len(), "planes", &counted, last));
            steps
        }
    };
    let covered = if coverage.backs { TileLists::LIQUID_LAYERS } else { TileLists::LIQUID };
    Steps { tiles: tiles.clone(), covered, steps, work: work(kernels.settings) }
}

/// The steps for the sides of gaps. The splatted and the smoothed layers hold their states by turns.
fn gap_steps(
    kernels: Kernels<'_>,
    inputs: Inputs<'_>,
    images: &SmoothImages,
    iterations: &[Params],
    count: u32,
) -> Steps {
    let Inputs { splatted, gaps, .. } = inputs;
    // The state that `whole_steps` leave behind.
    let [whole, unused] = match iterations.len() % 2 {
        0 => [&images.states[0], &images.states[1]],
        _ => [&images.states[1], &images.states[0]],
    };
    let iterations = &iterations[..iterations.len().min(MOST_GAP_ITERATIONS)];
    let unused = gpu::level_view(&unused.texture, 0, D2Array);
    let flags = gaps.tiles.create_view(&Default::default());
    let targets =
        [splatted, &images.layers].map(|layers| gpu::level_view(&layers.texture, 0, D2Array));
    let tiles = &gaps.tile_lists;
    let mut steps = Vec::new();
    for gap in 0..count {
        let constants = [("GAP", gap.into())];
        let mut step = |entry: &str, params: &Params| {
            let images = StepImages {
                state: &targets[steps.len() % 2],
                next: &targets[(steps.len() + 1) % 2],
                planes: &unused,
                splatted: &whole.view,
                flags: &flags,
                splash: &whole.view,
            };
            steps.push(kernels.step(entry, &constants, params, images, tiles));
        };
        let Some(last) = iterations.last() else { break };
        step("prepare", last);
        // The last state must be in the splatted layers.
        if iterations.len().is_multiple_of(2) {
            step("carry", last);
        }
        iterations.iter().for_each(|params| step("iterate", params));
        step("planes", last);
    }
    let (covered, work) = (TileLists::LIQUID_LAYERS, work(kernels.settings));
    Steps { tiles: tiles.clone(), covered, steps, work }
}

/// The work of an iteration per pixel, in layer evaluations.
pub fn work(settings: &settings::Smooth) -> u64 {
    2 * u64::from(settings.taps).pow(2)
}
