//! The mixture of fluids at each pixel: `shaders/mixture.wgsl`.
//!
//! Several fluids share the layers, because light is not refracted where they meet. They differ in
//! absorption: this pass sums length, and absorption times length, over all splats along a pixel's ray.
//! Inside the liquid, the mixture absorbs the light: this is exact for unrefracted light, whatever the
//! order of the fluids. Only fluids of different absorption need the pass.

use std::collections::HashMap;

use glam::{UVec2, Vec4};
use wgpu::TextureViewDimension::D2;

use super::CameraBinding;
use super::bins::Bins;
use super::splat_buffers::{self, SplatBuffers};
use crate::gpu::{self, Gpu, Span};
use crate::scene::{MAX_FLUIDS, Scene};

/// Format of the output: an error of half a thousandth is negligible against the effect of refraction.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

/// Draws the mixture of a view.
#[derive(Debug)]
pub struct Mixture {
    /// Output: absorption times length, as a share of [`strongest`], and length; one pixel if the
    /// fluids do not differ.
    pub view: wgpu::TextureView,
    /// By whether the chunk is the first and the last.
    pipelines: HashMap<[bool; 2], wgpu::ComputePipeline>,
    absorptions: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
}

/// Whether a scene has fluids of different absorption.
pub fn is_mixed(scene: &Scene) -> bool {
    scene.absorptions().windows(2).any(|pair| pair[0] != pair[1])
}

/// The largest component of any fluid's absorption, 1/m.
pub fn strongest(scene: &Scene) -> f32 {
    scene.absorptions().iter().fold(0.0, |most, absorption| most.max(absorption.max_element()))
}

impl Mixture {
    /// Creates the layout; pipelines are compiled on first use.
    pub fn new(gpu: &Gpu) -> Self {
        let bindings = [
            gpu::uniform::<[Vec4; MAX_FLUIDS]>(),
            gpu::storage_texture(FORMAT, D2),
            gpu::state_texture(),
        ];
        Self {
            view: create_view(gpu, UVec2::ONE),
            pipelines: HashMap::new(),
            absorptions: gpu::uniform_buffer::<[Vec4; MAX_FLUIDS]>(gpu, "fluids"),
            layout: gpu.layout("mixture", wgpu::ShaderStages::COMPUTE, &bindings),
        }
    }

    /// Replaces the output.
    pub fn resize(&mut self, gpu: &Gpu, size: UVec2) {
        self.view = create_view(gpu, size);
    }

    /// As [`super::splat::Splat::share`].
    pub fn share(&mut self, other: &Self) {
        self.view = other.view.clone();
    }

    /// Uploads the fluids' absorption for particles of `radius` (m), and compiles what is missing.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        camera: &CameraBinding,
        bins: &Bins,
        scene: &Scene,
        radius: f32,
    ) {
        let strongest = strongest(scene).max(f32::MIN_POSITIVE);
        let mut shares = [Vec4::ZERO; MAX_FLUIDS];
        for (share, absorption) in shares.iter_mut().zip(scene.absorptions()) {
            *share = (absorption / strongest).extend(radius.max(f32::MIN_POSITIVE).recip());
        }
        gpu.queue.write_buffer(&self.absorptions, 0, bytemuck::cast_slice(&shares));
        for ends in [[true, true], [true, false], [false, true], [false, false]] {
            self.pipelines.entry(ends).or_insert_with(|| {
                let [first, last] = ends.map(|end| f64::from(u8::from(end)));
                let own = [("FIRST", first), ("LAST", last)];
                let constants = [&camera.constants()[..], &own].concat();
                let splats = splat_buffers::layout(gpu);
                let layouts = [&camera.layout, &splats, bins.read_layout(), &self.layout];
                let entry = "mixture_of_tiles";
                gpu::compute_pipeline(gpu, "mixture.wgsl", entry, &layouts, &constants)
            });
        }
    }

    /// Records the sum over the splats of all `classes`, whose lists are recorded before; requires
    /// [`Mixture::prepare`].
    pub fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        bins: &Bins,
        classes: &[&SplatBuffers],
        span: Span<'_>,
    ) {
        let state = bins.state();
        let resources = [
            self.absorptions.as_entire_binding(),
            wgpu::BindingResource::TextureView(&self.view),
            wgpu::BindingResource::TextureView(&state),
        ];
        let group = gpu::bind_group(gpu, "mixture", &self.layout, &resources);
        let ends = classes.len() - 1;
        for (class, splats) in classes.iter().enumerate() {
            let (begins, ends) = (class == 0, class == ends);
            let span = match (begins, ends) {
                (true, true) => span,
                (true, false) => span.first(),
                _ => span.last(),
            };
            bins.draw(encoder, camera, class, splats, span, |pass, part| {
                let variant = [begins && part.first, ends && part.last];
                pass.set_pipeline(&self.pipelines[&variant]);
                pass.set_bind_group(3, &group, &[]);
                gpu::dispatch(pass, part.groups);
            });
        }
    }
}

fn create_view(gpu: &Gpu, size: UVec2) -> wgpu::TextureView {
    let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING;
    gpu::texture(gpu, "mixture", size, 1, FORMAT, usage).create_view(&Default::default())
}
