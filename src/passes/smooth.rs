//! Smoothing of the aggregate layers: `shaders/smooth/`.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use glam::UVec2;
use wgpu::TextureViewDimension::D2Array;

use super::tiles::TileLists;
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
    planes: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    /// Normal and depth, written alternately.
    states: [Layers; 2],
    splatted: Layers,
    frame: Frame,
}

/// Configuration of one frame's smoothing.
#[derive(Debug)]
struct Frame {
    variant: Variant,
    iterations: Vec<Params>,
    /// Backs are smoothed as well as fronts.
    backs: bool,
    /// Work of an iteration per pixel, in layer evaluations.
    work: u64,
}

impl Smooth {
    /// Compiles the kernels that all filters share; a filter is compiled on first use. `splatted` is
    /// the input.
    pub fn new(gpu: &Gpu, camera: &CameraBinding, splatted: &Layers) -> Self {
        let bindings = [
            gpu::uniform::<Params>(),
            gpu::sampled(D2Array),
            gpu::storage_texture(Layers::FORMAT, D2Array),
            gpu::storage_texture(Layers::FORMAT, D2Array),
            gpu::sampled(D2Array),
            gpu::storage_of(8),
        ];
        let layout = gpu.layout("smooth", wgpu::ShaderStages::COMPUTE, &bindings);
        let layouts = [&camera.layout, &layout];
        let pipeline = |entry: &str| {
            let shader = "smooth/plane_fit.wgsl";
            gpu::compute_pipeline(gpu, shader, entry, &layouts, &camera.constants())
        };
        let (layers, states) = create_layers(gpu, splatted);
        Self {
            prepare: pipeline("prepare"),
            iterate: HashMap::new(),
            planes: pipeline("planes"),
            layers,
            layout,
            states,
            splatted: splatted.clone(),
            frame: Frame {
                variant: Variant::new(&settings::Smooth::default()),
                iterations: Vec::new(),
                backs: false,
                work: 0,
            },
        }
    }

    /// Replaces the layers to match the size and mip levels of `splatted`.
    pub fn resize(&mut self, gpu: &Gpu, splatted: &Layers) {
        (self.layers, self.states) = create_layers(gpu, splatted);
        self.splatted = splatted.clone();
    }

    /// Sets the frame's iterations, for the front alone without `backs`, and compiles the filter on first
    /// use.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        camera: &CameraBinding,
        settings: &settings::Smooth,
        iterations: &[Params],
        backs: bool,
    ) {
        let layouts = [&camera.layout, &self.layout];
        let variant = Variant::new(settings);
        let iterations = iterations.to_vec();
        self.frame = Frame { variant, iterations, backs, work: work(settings) };
        self.iterate.entry(variant).or_insert_with(|| {
            let constants = [&camera.constants()[..], &variant.constants()].concat();
            gpu::compute_pipeline(gpu, variant.shader(), "iterate", &layouts, &constants)
        });
    }

    /// Records the smoothing of the splatted layers into [`Smooth::layers`]; requires [`Smooth::prepare`].
    pub fn record(
        &self,
        gpu: &Gpu,
        commands: &mut Commands<'_>,
        camera: &CameraBinding,
        tiles: &TileLists,
        span: Span<'_>,
    ) {
        let Frame { variant, iterations, backs, work } = &self.frame;
        // Only the liquid's tiles are written, but taps read beyond them.
        let [first, second] = &self.states;
        let mut begin = span.first();
        for texture in [&first.texture, &second.texture, &self.layers.texture] {
            for layer in [Layers::FRONT, Layers::BACK] {
                gpu::clear(commands.encoder, &gpu::layer_view(texture, layer), begin);
                begin = Span::default();
            }
        }
        let planes = gpu::level_view(&self.layers.texture, 0, D2Array);
        let Some(last) = iterations.last() else { return };
        let iterate = &self.iterate[variant];
        let mut steps = vec![(&self.prepare, last)];
        steps.extend(iterations.iter().map(|params| (iterate, params)));
        steps.push((&self.planes, last));
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

/// The work of an iteration per pixel, in layer evaluations.
pub fn work(settings: &settings::Smooth) -> u64 {
    2 * u64::from(settings.taps).pow(2)
}

fn create_layers(gpu: &Gpu, splatted: &Layers) -> (Layers, [Layers; 2]) {
    let size = UVec2::new(splatted.texture.width(), splatted.texture.height());
    let usage = wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::RENDER_ATTACHMENT
        | wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::COPY_SRC;
    let new = |label: &str, levels| Layers::new(gpu, label, size, levels, usage);
    let levels = splatted.texture.mip_level_count();
    (new("smoothed layers", levels), [new("smooth state 0", 1), new("smooth state 1", 1)])
}
