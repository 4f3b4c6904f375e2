//! Smoothing of the aggregate layers: `shaders/smooth/`.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use glam::UVec2;
use wgpu::TextureViewDimension::D2Array;

use super::tiles::TileLists;
use super::{CameraBinding, Layers};
use crate::gpu::{self, Gpu, Span};
use crate::settings::{self, Filter};

/// One iteration's parameters, as `smooth/iterate.wgsl` has them.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// Taps to each side of the centre.
    pub taps: i32,
    /// Distance between taps, in pixels or in particle radii.
    pub stride: f32,
    /// 1 if `stride` is in particle radii.
    pub in_radii: u32,
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
    pub(crate) fn iterations(settings: &settings::Smooth, radius: f32) -> Vec<Self> {
        let in_radii = settings.unit == settings::Unit::Radius;
        let window = if in_radii { settings.window } else { settings.window - 1.0 };
        let stride = window / (settings.taps - 1) as f32;
        (0..settings.iterations)
            .map(|i| Self {
                taps: (settings.taps / 2) as i32,
                // With gaps between taps, each iteration looks half as far as the one before.
                stride: stride * 0.5f32.powi(i as i32),
                in_radii: u32::from(in_radii),
                radius,
                inv_sigma2: (settings.sigma * radius).powi(-2),
                delta: settings.delta * radius,
                mu: settings.mu * radius,
            })
            .collect()
    }
}

/// Smooths a pair of layers.
#[derive(Debug)]
pub(crate) struct Smooth {
    /// Output: smoothed planes.
    pub layers: Layers,
    prepare: wgpu::ComputePipeline,
    iterate: HashMap<Filter, wgpu::ComputePipeline>,
    planes: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    // Normal and depth, written alternately.
    states: [Layers; 2],
    splatted: Layers,
}

impl Smooth {
    /// Compiles what all filters share, and a filter when a frame first needs it; `splatted` is
    /// what it will smooth.
    pub(crate) fn new(gpu: &Gpu, camera: &CameraBinding, splatted: &Layers) -> Self {
        let bindings = [
            gpu::uniform::<Params>(),
            gpu::sampled(D2Array),
            gpu::storage_texture(Layers::FORMAT, D2Array),
            gpu::sampled(D2Array),
            gpu::storage_of(8),
        ];
        let layout = gpu.layout("smooth", wgpu::ShaderStages::COMPUTE, &bindings);
        let layouts = [&camera.layout, &layout];
        let pipeline = |entry: &str| {
            gpu::compute_pipeline(
                gpu,
                shader(Filter::PlaneFit),
                entry,
                &layouts,
                &camera.constants(),
            )
        };
        let (layers, states) = sized(gpu, splatted);
        Self {
            prepare: pipeline("prepare"),
            iterate: HashMap::new(),
            planes: pipeline("planes"),
            layers,
            layout,
            states,
            splatted: splatted.clone(),
        }
    }

    /// Replaces the layers by ones of the size and mip levels of `splatted`.
    pub(crate) fn resize(&mut self, gpu: &Gpu, splatted: &Layers) {
        (self.layers, self.states) = sized(gpu, splatted);
        self.splatted = splatted.clone();
    }

    /// Compiles `filter` if it is new.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, camera: &CameraBinding, filter: Filter) {
        let layouts = [&camera.layout, &self.layout];
        self.iterate.entry(filter).or_insert_with(|| {
            gpu::compute_pipeline(gpu, shader(filter), "iterate", &layouts, &camera.constants())
        });
    }

    /// Smooths the splatted layers, or the front alone, into [`Smooth::layers`] by a filter that
    /// [`Smooth::prepare`] was given.
    #[expect(clippy::too_many_arguments, reason = "its inputs, each by its name")]
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        tiles: &TileLists,
        filter: Filter,
        iterations: &[Params],
        backs: bool,
        span: Span<'_>,
    ) {
        // Only the liquid's tiles are written, and taps read beyond them.
        let [first, second] = &self.states;
        let mut begin = span.first();
        for layers in [first, second, &self.layers] {
            for layer in [Layers::FRONT, Layers::BACK] {
                gpu::clear(encoder, &gpu::layer_view(&layers.texture, layer), begin);
                begin = Span::default();
            }
        }
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("smooth"),
            timestamp_writes: span.last().compute(),
        });
        pass.set_bind_group(0, &camera.group, &[]);
        let mut step = |pipeline: &wgpu::ComputePipeline,
                        params: &Params,
                        from: &Layers,
                        to: &Layers| {
            // A buffer per iteration: a uniform written twice holds the last value for the frame.
            let params = gpu::buffer_with(gpu, "smooth", wgpu::BufferUsages::UNIFORM, &[*params]);
            let target = gpu::level_view(&to.texture, 0);
            let resources = [
                params.as_entire_binding(),
                wgpu::BindingResource::TextureView(&from.view),
                wgpu::BindingResource::TextureView(&target),
                wgpu::BindingResource::TextureView(&self.splatted.view),
                tiles.liquid.as_entire_binding(),
            ];
            pass.set_pipeline(pipeline);
            pass.set_bind_group(1, &gpu::bind_group(gpu, "smooth", &self.layout, &resources), &[]);
            let covered = if backs { TileLists::LIQUID_LAYERS } else { TileLists::LIQUID };
            pass.dispatch_workgroups_indirect(&tiles.dispatches, covered);
        };
        let [mut from, mut to] = [&self.states[0], &self.states[1]];
        let Some(last) = iterations.last() else { return };
        step(&self.prepare, last, &self.splatted, from);
        for params in iterations {
            step(&self.iterate[&filter], params, from, to);
            (from, to) = (to, from);
        }
        step(&self.planes, last, from, &self.layers);
    }
}

fn shader(filter: Filter) -> &'static str {
    match filter {
        Filter::PlaneFit => "smooth/plane_fit.wgsl",
        Filter::Bilateral => "smooth/bilateral.wgsl",
        Filter::NarrowRange => "smooth/narrow_range.wgsl",
    }
}

fn sized(gpu: &Gpu, splatted: &Layers) -> (Layers, [Layers; 2]) {
    let size = UVec2::new(splatted.texture.width(), splatted.texture.height());
    let usage = wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::RENDER_ATTACHMENT
        | wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::COPY_SRC;
    let new = |label: &str, levels| Layers::new(gpu, label, size, levels, usage);
    let levels = splatted.texture.mip_level_count();
    (new("smoothed layers", levels), [new("smooth state 0", 1), new("smooth state 1", 1)])
}
