//! The mixture of fluids at each pixel: `shaders/mixture/`.
//!
//! Several fluids share the layers, because light is not refracted where they meet. They differ in
//! absorption: this pass sums length, and absorption times length, over all splats along a pixel's ray. Of turbid fluids it
//! sums scattering too, into an image of its own.
//! Inside the liquid, the mixture absorbs the light: this is exact for unrefracted light, whatever the
//! order of the fluids. Only fluids of different absorption need the pass.

use glam::{UVec2, Vec3, Vec4};
use wgpu::BindingResource::TextureView;
use wgpu::TextureViewDimension::D2;

use super::CameraBinding;
use super::bins::Bins;
use crate::gpu::{self, Bound, Gpu, Span, TILE};
use crate::scene::{MAX_FLUIDS, Medium, Scene};

/// Format of the output: an error of half a thousandth is negligible against the effect of refraction.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

/// The mixture of a view.
#[derive(Debug, Clone)]
pub struct MixtureImages {
    /// Coefficients times length, as a share of [`Shares::strongest`], and length; one pixel if the fluids do not differ.
    pub view: wgpu::TextureView,
    /// Tiles that have sums in this frame.
    summed: wgpu::Buffer,
}

/// Draws the mixture of a view.
#[derive(Debug)]
pub struct Mixture {
    images: Bound,
    summed: wgpu::Buffer,
    /// By class and chunk of it.
    pipelines: Vec<Vec<wgpu::ComputePipeline>>,
    empty: wgpu::ComputePipeline,
    /// By class.
    emptied: Vec<Bound>,
}

/// Coefficients of each fluid, 1/m, which mix by the shares of the fluids.
#[derive(Debug, Clone, PartialEq)]
pub struct Shares(Vec<Vec3>);

impl Shares {
    /// The absorption.
    pub fn of_absorption(scene: &Scene) -> Self {
        Self(scene.absorptions())
    }

    /// The scattering, for the [anisotropy](anisotropy) of all: by the similarity of media of one σs(1 − g) (van de
    /// Hulst 1980, chapter 14).
    pub fn of_scattering(scene: &Scene) -> Self {
        let common = anisotropy(scene);
        let similar = |medium: &Medium| match medium.anisotropy == common {
            true => medium.scattering,
            false => medium.scattering * ((1.0 - medium.anisotropy) / (1.0 - common)),
        };
        Self(scene.media().iter().map(similar).collect())
    }

    /// The attenuation of light on its way to solids: absorption, and scattering with its forward part left out.
    pub fn of_attenuation(scene: &Scene) -> Self {
        let turbid = scene.is_turbid();
        let lost = |medium: &Medium| match turbid {
            true => medium.absorption + medium.scattering * (1.0 - medium.anisotropy),
            false => medium.absorption,
        };
        Self(scene.media().iter().map(lost).collect())
    }

    /// Whether the fluids differ.
    pub fn are_mixed(&self) -> bool {
        self.0.windows(2).any(|pair| pair[0] != pair[1])
    }

    /// The largest component of any fluid's, 1/m.
    pub fn strongest(&self) -> f32 {
        self.0.iter().fold(0.0, |most, coefficients| most.max(coefficients.max_element()))
    }

    /// Returns the coefficients of the only fluid, or the scale of the mixture's.
    pub fn uniform(&self) -> Vec3 {
        if self.are_mixed() { Vec3::splat(self.strongest()) } else { self.0[0] }
    }
}

/// The mean cosine of scattering in a mixture: the fluids' mean, by how much they scatter.
pub fn anisotropy(scene: &Scene) -> f32 {
    let media = scene.media();
    let strength = |medium: &Medium| medium.scattering.element_sum();
    let (all, first) = (media.iter().map(strength).sum::<f32>(), media[0].anisotropy);
    if all == 0.0 || media.iter().all(|medium| medium.anisotropy == first) {
        return first;
    }
    media.iter().map(|medium| medium.anisotropy * strength(medium)).sum::<f32>() / all
}

impl MixtureImages {
    /// Creates an empty image.
    pub fn new(gpu: &Gpu, size: UVec2) -> Self {
        Self { view: create_view(gpu, size), summed: create_summed(gpu, size) }
    }
}

impl Mixture {
    /// Prepares the sum over the first `classes` classes of particles of `radius`, m.
    pub fn prepare(
        gpu: &Gpu,
        camera: &CameraBinding,
        bins: &Bins,
        classes: usize,
        images: &MixtureImages,
        fluids: &Shares,
        radius: f32,
    ) -> Self {
        let strongest = fluids.strongest().max(f32::MIN_POSITIVE);
        let mut shares = [Vec4::ZERO; MAX_FLUIDS];
        for (share, &coefficients) in shares.iter_mut().zip(&fluids.0) {
            *share = (coefficients / strongest).extend(radius.max(f32::MIN_POSITIVE).recip());
        }
        let absorptions = gpu.buffer_with("fluids", gpu::UNIFORM, &shares);
        let MixtureImages { view, summed } = images.clone();
        let written = (gpu::storage_texture(FORMAT, D2), TextureView(&view));
        let bindings = [
            (gpu::uniform::<[Vec4; MAX_FLUIDS]>(), absorptions.as_entire_binding()),
            written.clone(),
            (gpu::state_texture(), TextureView(bins.state())),
            (gpu::storage_read_write(4), summed.as_entire_binding()),
        ];
        let images = gpu.bind("mixture", &bindings);
        let kernel = ("mixture/sums.wgsl", "mixture_of_tiles");
        let pipelines = |class| bins.pipelines(gpu, camera, class, kernel, &images.layout, |_| []);
        let pipelines = (0..classes).map(pipelines).collect();
        let emptied = |class| {
            let tiles = bins.emptied(class).tiles.as_entire_binding();
            gpu.bind("emptied mixture", &[(gpu::storage_of(8), tiles), written.clone()])
        };
        let emptied: Vec<_> = (0..classes).map(emptied).collect();
        let (layouts, constants) = ([&camera.layout, &emptied[0].layout], camera.constants());
        let empty = gpu.compute_pipeline("mixture/empty.wgsl", "empty", &layouts, &constants);
        Self { images, summed, pipelines, empty, emptied }
    }

    /// Records the sum, whose lists are recorded before.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        bins: &Bins,
        span: Span<'_>,
    ) {
        encoder.clear_buffer(&self.summed, 0, None);
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("mixture"),
                timestamp_writes: span.first().compute(),
            });
            pass.set_pipeline(&self.empty);
            pass.set_bind_group(0, &camera.group, &[]);
            for (class, emptied) in self.emptied.iter().enumerate() {
                pass.set_bind_group(1, &emptied.group, &[]);
                bins.emptied(class).dispatch(&mut pass);
            }
        }
        for (class, pipelines) in self.pipelines.iter().enumerate() {
            let is_last = class + 1 == self.pipelines.len();
            let span = if is_last { span.last() } else { Span::default() };
            bins.draw(encoder, class, pipelines, span, |pass, tiles| {
                pass.set_bind_group(3, &self.images.group, &[]);
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
    gpu.texture("mixture", size, 1, FORMAT, usage).create_view(&Default::default())
}
