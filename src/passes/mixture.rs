//! The mixture of fluids at each pixel: `shaders/mixture/`.
//!
//! Several fluids share the layers, because light is not refracted where they meet. They differ in
//! absorption: this pass sums length, and absorption times length, over all splats along a pixel's ray.
//! Inside the liquid, the mixture absorbs the light: this is exact for unrefracted light, whatever the
//! order of the fluids. Only fluids of different absorption need the pass.

use glam::{UVec2, Vec4};
use wgpu::TextureViewDimension::D2;

use super::CameraBinding;
use super::bins::Bins;
use super::splat_buffers::{self, SplatBuffers};
use crate::gpu::{self, Gpu, Span, TILE};
use crate::scene::{MAX_FLUIDS, Scene};

/// Format of the output: an error of half a thousandth is negligible against the effect of refraction.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

/// Draws the mixture of a view.
#[derive(Debug)]
pub struct Mixture {
    /// Output: absorption times length, as a share of [`strongest`], and length; one pixel if the
    /// fluids do not differ.
    pub view: wgpu::TextureView,
    /// The sums, and the emptying of tiles; compiled on first use.
    pipelines: Option<[wgpu::ComputePipeline; 2]>,
    absorptions: wgpu::Buffer,
    /// Tiles that have sums in this frame.
    summed: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
    empty_layout: wgpu::BindGroupLayout,
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
            gpu::storage_read_write(4),
        ];
        let empty = [gpu::storage_of(8), gpu::storage_texture(FORMAT, D2)];
        Self {
            view: create_view(gpu, UVec2::ONE),
            pipelines: None,
            absorptions: gpu::uniform_buffer::<[Vec4; MAX_FLUIDS]>(gpu, "fluids"),
            summed: create_summed(gpu, UVec2::ONE),
            layout: gpu.layout("mixture", wgpu::ShaderStages::COMPUTE, &bindings),
            empty_layout: gpu.layout("emptied mixture", wgpu::ShaderStages::COMPUTE, &empty),
        }
    }

    /// Replaces the output.
    pub fn resize(&mut self, gpu: &Gpu, size: UVec2) {
        (self.view, self.summed) = (create_view(gpu, size), create_summed(gpu, size));
    }

    /// As [`super::splat::Splat::share`].
    pub fn share(&mut self, other: &Self) {
        (self.view, self.summed) = (other.view.clone(), other.summed.clone());
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
        self.pipelines.get_or_insert_with(|| {
            let constants = camera.constants();
            let splats = splat_buffers::layout(gpu);
            let layouts = [&camera.layout, &splats, bins.read_layout(), &self.layout];
            let (file, entry) = ("mixture/sums.wgsl", "mixture_of_tiles");
            let sums = gpu::compute_pipeline(gpu, file, entry, &layouts, &constants);
            let layouts = [&camera.layout, &self.empty_layout];
            let file = "mixture/empty.wgsl";
            [sums, gpu::compute_pipeline(gpu, file, "empty", &layouts, &constants)]
        });
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
        let Some([sums, empty]) = &self.pipelines else { return };
        let state = bins.state();
        let resources = [
            self.absorptions.as_entire_binding(),
            wgpu::BindingResource::TextureView(&self.view),
            wgpu::BindingResource::TextureView(&state),
            self.summed.as_entire_binding(),
        ];
        let group = gpu::bind_group(gpu, "mixture", &self.layout, &resources);
        encoder.clear_buffer(&self.summed, 0, None);
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("mixture"),
                timestamp_writes: span.first().compute(),
            });
            pass.set_pipeline(empty);
            pass.set_bind_group(0, &camera.group, &[]);
            for class in 0..classes.len() {
                let emptied = bins.emptied(class);
                let view = wgpu::BindingResource::TextureView(&self.view);
                let resources = [emptied.tiles.as_entire_binding(), view];
                let group = gpu::bind_group(gpu, "emptied mixture", &self.empty_layout, &resources);
                pass.set_bind_group(1, &group, &[]);
                emptied.dispatch(&mut pass);
            }
        }
        for (class, splats) in classes.iter().enumerate() {
            let span = if class + 1 == classes.len() { span.last() } else { Span::default() };
            bins.draw(encoder, camera, class, splats, span, |pass, _, tiles| {
                pass.set_pipeline(sums);
                pass.set_bind_group(3, &group, &[]);
                pass.dispatch_workgroups_indirect(tiles, 0);
            });
        }
    }
}

fn create_summed(gpu: &Gpu, size: UVec2) -> wgpu::Buffer {
    let tiles = size.map(|n| n.div_ceil(TILE)).element_product();
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("summed tiles"),
        size: 4 * u64::from(tiles),
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn create_view(gpu: &Gpu, size: UVec2) -> wgpu::TextureView {
    let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING;
    gpu::texture(gpu, "mixture", size, 1, FORMAT, usage).create_view(&Default::default())
}
