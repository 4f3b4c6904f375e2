//! Refraction of light through the layers: `shaders/refract/`.
//!
//! The shader is specialised for the frame's features (splashes, absorption, solids that liquid can wet),
//! for the intersector and for all loop counts; each specialisation is compiled once and kept.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use glam::UVec2;
use wgpu::TextureViewDimension::{D2, D2Array};

use super::gbuffer::{SceneBinding, SceneVariant};
use super::mixture;
use super::tiles::TileLists;
use super::view_passes::ViewPasses;
use super::{CameraBinding, Layers, Radiance};
use crate::environment::EvenLight;
use crate::gpu::{self, Commands, Gpu, Pending, Span};
use crate::scene::{Scene, Shape, Solid};
use crate::settings::{self, Fresnel, Reflections, Solids, Solver};

/// `Params` of `refract/interfaces.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// Absorption, 1/m; with several fluids, the scale of the mixture's absorption.
    pub absorption: [f32; 3],
    /// Index of refraction.
    pub ior: f32,
    /// Reach of wetting, m.
    pub contact: f32,
    /// Interfaces per ray.
    pub interfaces: u32,
    /// Strong internal reflections followed per ray.
    pub internal_bounces: u32,
    /// Share of the picture's height that `guarded` may step over without testing it.
    pub reach: f32,
    /// Shares of the ambient light that level liquid transmits: see [`EvenLight`].
    pub ambient_shares: [f32; 2],
    /// Path lengths of these shares, in metres per metre of depth.
    pub ambient_paths: [f32; 2],
    /// Depth of the eye below the liquid's surface, m; 0 outside of it.
    pub eye_depth: f32,
    /// Padding: uniforms come in blocks of 16 bytes.
    pub pad_eye_depth: [u32; 3],
}

/// One specialisation of the shader.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Variant {
    /// The intersector.
    pub solver: Solver,
    /// `newton` reads mip levels.
    pub filter: bool,
    /// Pixels between samples of `march`.
    pub stride: u32,
    /// Iterations of `newton` and `secant`.
    pub iterations: u32,
    /// Rays per pixel.
    pub samples: u32,
    /// Rays per background pixel that contains an edge.
    pub edge_samples: u32,
    /// The frame has splashes.
    pub splash: bool,
    /// The liquid absorbs.
    pub absorption: bool,
    /// The fluids differ in absorption.
    pub mixture: bool,
    /// The reflectance formula.
    pub fresnel: Fresnel,
    /// Scale radiance by the square of the index.
    pub radiance_scaling: bool,
    /// The liquid can wet a solid.
    pub contact: bool,
    /// How rays outside the liquid find the solids.
    pub solids: Solids,
    /// What reflected rays hit.
    pub reflections: Reflections,
    /// A host has drawn the opaque scene.
    pub host: bool,
    /// The scene has a background picture.
    pub background: bool,
    /// The environment covers no pixel.
    pub transparent: bool,
    /// Gaps between liquid and liquid that a pixel distinguishes.
    pub gaps: u32,
    /// Write the diagnostics.
    pub count: bool,
}

impl Variant {
    /// The variant with the fewest features that draws a frame.
    pub fn new(scene: &Scene, splash: bool, gaps: u32, host: bool, count: bool) -> Self {
        let settings = &scene.settings.refract;
        let iterates = matches!(settings.solver, Solver::Newton | Solver::Secant);
        Self {
            solver: settings.solver,
            // Settings that an intersector does not read must not create variants of it.
            filter: settings.filter && settings.solver == Solver::Newton,
            stride: if settings.solver == Solver::March { settings.stride } else { 1 },
            iterations: if iterates { settings.iterations } else { 0 },
            samples: settings.samples,
            edge_samples: settings.edge_samples,
            splash,
            absorption: mixture::strongest(scene) > 0.0,
            mixture: mixture::is_mixed(scene),
            fresnel: settings.fresnel,
            radiance_scaling: settings.radiance_scaling,
            contact: settings.contact > 0.0 && (host || !scene.solids.is_empty()),
            solids: if host || scene.solids.is_empty() { Solids::Exact } else { settings.solids },
            reflections: settings.reflections,
            host,
            background: scene.background.is_some() && !host,
            transparent: settings.transparent,
            gaps,
            count,
        }
    }

    pub fn shader(self) -> &'static str {
        match self.solver {
            Solver::Guarded => "refract/guarded.wgsl",
            Solver::March => "refract/march.wgsl",
            Solver::Newton => "refract/newton.wgsl",
            Solver::Secant => "refract/secant.wgsl",
            Solver::Plane => "refract/plane.wgsl",
            Solver::Plane3 => "refract/plane3.wgsl",
            Solver::Single => "refract/single.wgsl",
        }
    }

    /// Whether its intersector reads mip levels of the layers.
    pub fn mips(self) -> bool {
        self.filter || self.solver == Solver::Plane3
    }

    pub fn constants(self) -> Vec<(&'static str, f64)> {
        let mut constants = self.switches().to_vec();
        constants.push(("SAMPLES", self.samples.into()));
        constants.push(("EDGE_SAMPLES", self.edge_samples.into()));
        constants.push(("ITERATIONS", self.iterations.into()));
        constants.push(("GAPS", self.gaps.into()));
        match self.solver {
            Solver::Newton => constants.push(("FILTER", f64::from(u8::from(self.filter)))),
            Solver::March => constants.push(("STRIDE", self.stride.into())),
            _ => {}
        }
        constants
    }

    fn switches(self) -> [(&'static str, f64); 12] {
        [
            ("SPLASH", self.splash),
            ("ABSORPTION", self.absorption),
            ("MIXTURE", self.mixture),
            ("SCHLICK", self.fresnel == Fresnel::Schlick),
            ("RADIANCE_SCALING", self.radiance_scaling),
            ("CONTACT", self.contact),
            ("SCREEN_SOLIDS", self.solids == Solids::Screen),
            ("REFLECT_SOLIDS", self.reflections == Reflections::Scene),
            ("HOST", self.host),
            ("BACKGROUND", self.background),
            ("TRANSPARENT", self.transparent),
            ("COUNT", self.count),
        ]
        .map(|(name, on)| (name, f64::from(u8::from(on))))
    }
}

/// Edge pixels per workgroup.
const EDGE_GROUP: u64 = 64;

/// Bytes before the list of edge pixels: the number of them, of rays and of fallbacks.
const EDGE_COUNTS: u64 = 12;

#[derive(Debug)]
struct Pipelines {
    liquid: wgpu::ComputePipeline,
    background: wgpu::ComputePipeline,
    edges: wgpu::ComputePipeline,
}

/// Background pixels that contain an edge, gathered to be drawn together.
#[derive(Debug)]
struct Edges {
    /// Counts of edge pixels, of rays and of fallbacks, then pixels.
    list: wgpu::Buffer,
    /// Arguments of the indirect dispatch over them.
    dispatch: wgpu::Buffer,
    gather: wgpu::BindGroup,
    draw: wgpu::BindGroup,
}

/// Draws the liquid, and everything visible through and beside it.
#[derive(Debug)]
pub struct Refract {
    /// Output.
    pub radiance: Radiance,
    /// Output when counting: interfaces, length inside (m), solver iterations, solver failures.
    pub diagnostics: wgpu::Texture,
    /// By variants, and whether the view is orthographic.
    pipelines: HashMap<(Variant, SceneVariant, bool), Pipelines>,
    params: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
    edge_layouts: [wgpu::BindGroupLayout; 2],
    edges: Edges,
}

impl Refract {
    /// Creates the layout; pipelines are compiled on first use.
    pub fn new(gpu: &Gpu) -> Self {
        let bindings = [
            gpu::uniform::<Params>(),
            gpu::sampled(D2Array),
            gpu::sampled(D2Array),
            gpu::sampled(D2),
            gpu::sampled(D2),
            gpu::sampled(D2),
            gpu::storage_texture(Layers::FORMAT, D2),
            gpu::storage_texture(Layers::FORMAT, D2),
            gpu::storage_of(8),
            gpu::sampled(D2),
        ];
        let layout = gpu.layout("refract", wgpu::ShaderStages::COMPUTE, &bindings);
        // Indirect arguments must not be bound where they are used, so drawing edges binds the list alone.
        let edge_bindings = [gpu::storage_read_write(EDGE_COUNTS + 4), gpu::storage_read_write(4)];
        let edge_layouts = [&edge_bindings[..], &edge_bindings[..1]]
            .map(|bindings| gpu.layout("edges", wgpu::ShaderStages::COMPUTE, bindings));
        Self {
            radiance: Radiance { texture: create_texture(gpu, "radiance", UVec2::ONE) },
            diagnostics: create_texture(gpu, "diagnostics", UVec2::ONE),
            pipelines: HashMap::new(),
            params: gpu::uniform_buffer::<Params>(gpu, "refract"),
            layout,
            edges: Edges::new(gpu, &edge_layouts, UVec2::ONE),
            edge_layouts,
        }
    }

    /// Replaces the textures; without `count` the diagnostics are one pixel.
    pub fn resize(&mut self, gpu: &Gpu, size: UVec2, count: bool) {
        self.radiance = Radiance { texture: create_texture(gpu, "radiance", size) };
        self.edges = Edges::new(gpu, &self.edge_layouts, size);
        let size = if count { size } else { UVec2::ONE };
        self.diagnostics = create_texture(gpu, "diagnostics", size);
    }

    /// Whether `variant` is compiled for the bound scene: it takes longer than all other pipelines together.
    pub fn is_compiled(&self, variant: Variant, eye: &ViewPasses) -> bool {
        self.pipelines.contains_key(&(variant, eye.scene.variant, eye.camera.is_orthographic()))
    }

    /// Writes the parameters and compiles `variant` if it is new.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        camera: &CameraBinding,
        scene: &SceneBinding,
        variant: Variant,
        params: &Params,
    ) {
        gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(params));
        let [gather, draw] = &self.edge_layouts;
        let key = (variant, scene.variant, camera.is_orthographic());
        self.pipelines.entry(key).or_insert_with(|| {
            let constants =
                [&variant.constants()[..], &scene.variant.constants(), &camera.constants()]
                    .concat();
            let module =
                gpu::shader::module(gpu, variant.shader(), gpu::shader::Variant::default());
            let pipeline = |entry: &str, edges: &wgpu::BindGroupLayout| {
                let layouts = [&camera.layout, &self.layout, &scene.layout, edges];
                gpu::module_pipeline(gpu, variant.shader(), &module, entry, &layouts, &constants)
            };
            let (liquid, (background, edges)) = rayon::join(
                || pipeline("refract_pixels", gather),
                || {
                    let background = || pipeline("background_pixels", gather);
                    rayon::join(background, || pipeline("edge_pixels", draw))
                },
            );
            Pipelines { liquid, background, edges }
        });
    }

    /// Records the readback of the last picture's counts of rays with a host.
    pub fn record_host_rays(&self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) -> Pending {
        Pending::record(gpu, encoder, &self.edges.list, 4, EDGE_COUNTS - 4)
    }

    /// Records the picture with a variant that was passed to [`Refract::prepare`] and takes
    /// [`work`] per pixel; `behind` is a host's colour or the background.
    pub fn record(
        &self,
        commands: &mut Commands<'_>,
        eye: &ViewPasses,
        variant: Variant,
        behind: Option<&wgpu::TextureView>,
        work: u64,
        span: Span<'_>,
    ) {
        let gpu = commands.gpu;
        let view = |texture: &wgpu::Texture| texture.create_view(&Default::default());
        let gbuffer = &eye.gbuffer.images;
        let (planes, surfaces) = (view(&gbuffer.planes), view(&gbuffer.surfaces));
        let (radiance, diagnostics) = (view(&self.radiance.texture), view(&self.diagnostics));
        let tiles = &eye.tiles.lists;
        let group = |list: &wgpu::Buffer, section: u32| {
            let resources = [
                self.params.as_entire_binding(),
                wgpu::BindingResource::TextureView(&eye.aggregate_layers().view),
                wgpu::BindingResource::TextureView(&eye.splash.layers.view),
                wgpu::BindingResource::TextureView(&planes),
                wgpu::BindingResource::TextureView(&eye.mixture.view),
                wgpu::BindingResource::TextureView(&surfaces),
                wgpu::BindingResource::TextureView(&radiance),
                wgpu::BindingResource::TextureView(&diagnostics),
                tiles.section(list, section),
                wgpu::BindingResource::TextureView(behind.unwrap_or(&planes)),
            ];
            gpu::bind_group(gpu, "refract", &self.layout, &resources)
        };
        let pipelines =
            &self.pipelines[&(variant, eye.scene.variant, eye.camera.is_orthographic())];
        for section in tiles.sections() {
            commands.reserve(tiles.pixels().saturating_mul(work));
            let encoder = &mut *commands.encoder;
            let counts = if section == 0 { EDGE_COUNTS } else { 4 };
            encoder.clear_buffer(&self.edges.list, 0, Some(counts));
            encoder.clear_buffer(&self.edges.dispatch, 0, Some(4));
            let span = span.part(section == 0, section + 1 == tiles.sections().end);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("refract"),
                timestamp_writes: span.compute(),
            });
            let at = |which| tiles.dispatch(which, section);
            pass.set_bind_group(0, &eye.camera.group, &[]);
            pass.set_bind_group(2, &eye.scene.group, &[]);
            pass.set_bind_group(3, &self.edges.gather, &[]);
            pass.set_pipeline(&pipelines.background);
            pass.set_bind_group(1, &group(&tiles.background, section), &[]);
            pass.dispatch_workgroups_indirect(&tiles.dispatches, at(TileLists::BACKGROUND));
            pass.set_pipeline(&pipelines.liquid);
            pass.set_bind_group(1, &group(&tiles.liquid, section), &[]);
            pass.dispatch_workgroups_indirect(&tiles.dispatches, at(TileLists::LIQUID));
            pass.set_bind_group(3, &self.edges.draw, &[]);
            pass.set_pipeline(&pipelines.edges);
            pass.dispatch_workgroups_indirect(&self.edges.dispatch, 0);
        }
    }
}

/// Work of a ray through the solids: a mesh's tree is as much as many other solids.
pub fn solid_work(scene: &Scene) -> usize {
    /// Nodes and triangles that a ray meets, about.
    const MESH: usize = 40;
    let of = |solid: &Solid| if matches!(solid.shape, Shape::Mesh { .. }) { MESH } else { 1 };
    scene.solids.iter().map(of).sum()
}

/// The most work of a pixel, in layer evaluations: in a picture of `size` and a scene whose solids take `solids`
/// and which has `lights` lights, 0 if nothing is lit.
pub fn work(settings: &settings::Refract, size: UVec2, solids: usize, lights: usize) -> u64 {
    let walk = match settings.solver {
        Solver::March => (size.x + size.y).div_ceil(settings.stride),
        // An estimate of the usual count; the solver's bounds are higher.
        Solver::Guarded => 32,
        Solver::Newton | Solver::Secant => settings.iterations + 1,
        Solver::Plane | Solver::Plane3 | Solver::Single => 2,
    };
    let solids = (solids * (1 + lights)) as u64;
    // One more for the ray up from a wet solid.
    let turns = u64::from(settings.interfaces + settings.internal_bounces + 1);
    let liquid = u64::from(settings.samples) * turns * (u64::from(walk) + solids);
    let background = u64::from(settings.samples.max(settings.edge_samples)) * (1 + solids);
    liquid.max(background)
}

impl Edges {
    fn new(gpu: &Gpu, [gather, draw]: &[wgpu::BindGroupLayout; 2], size: UVec2) -> Self {
        /// As `most_edges` of the shader.
        const MOST: u64 = 65535 * EDGE_GROUP;
        let limit = gpu.device.limits().max_storage_buffer_binding_size;
        let pixels = u64::from(size.x) * u64::from(size.y);
        let list = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("edges"),
            size: (EDGE_COUNTS + 4 * pixels.min(MOST)).min(limit / 4 * 4),
            usage: wgpu::BufferUsages::STORAGE
                | wgpu::BufferUsages::COPY_DST
                | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let usage = wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::INDIRECT;
        let dispatch = gpu::buffer_with(gpu, "edge groups", usage, &[0u32, 1, 1]);
        let resources = [list.as_entire_binding(), dispatch.as_entire_binding()];
        let gather = gpu::bind_group(gpu, "edges found", gather, &resources);
        let draw = gpu::bind_group(gpu, "edges drawn", draw, &resources[..1]);
        Self { list, dispatch, gather, draw }
    }
}

impl Params {
    /// The parameters of a frame whose particles have `radius`, m.
    pub fn new(scene: &Scene, settings: &settings::Refract, radius: f32) -> Self {
        let absorption = match mixture::is_mixed(scene) {
            true => [mixture::strongest(scene); 3],
            false => scene.absorptions()[0].to_array(),
        };
        let ambient = EvenLight::below(scene.liquid.ior);
        Self {
            absorption,
            ior: scene.liquid.ior,
            contact: settings.contact * radius,
            interfaces: settings.interfaces,
            internal_bounces: settings.internal_bounces,
            reach: settings.reach,
            ambient_shares: ambient.shares,
            ambient_paths: ambient.paths,
            eye_depth: 0.0,
            pad_eye_depth: [0; 3],
        }
    }
}

fn create_texture(gpu: &Gpu, label: &str, size: UVec2) -> wgpu::Texture {
    let usage = wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::COPY_SRC;
    gpu::texture(gpu, label, size, 1, Layers::FORMAT, usage)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Guards against lost edge pixels: the shader assumes a list of the same length.
    #[test]
    fn edge_groups_are_those_of_the_shader() {
        let group = gpu::shader::constant("refract/pixels.wgsl", "EDGE_GROUP");
        assert_eq!(group, EDGE_GROUP as f64);
    }
}
