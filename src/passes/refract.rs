//! Refraction of light through the layers: `shaders/refract/`.
//!
//! The shader is specialised for the frame's features (splashes, absorption, solids that liquid can wet),
//! for the intersector and for all loop counts; each specialisation is compiled once and kept.

mod variant;

use bytemuck::{Pod, Zeroable};
use glam::UVec2;
use wgpu::BindingResource::TextureView;
use wgpu::TextureViewDimension::{D2, D2Array};

use super::diffuse::DiffuseImages;
use super::mixture::{self, Shares};
use super::tiles::TileLists;
use super::turbid::{self, TurbidImages};
use super::view_passes::ViewPasses;
use super::{Layers, Radiance};
use crate::environment::EvenLight;
use crate::gpu::{self, Bound, Commands, Gpu, Kernel, Pending, Span};
use crate::scene::{Scene, Shape, Solid};
use crate::settings::{self, Solver};
pub use variant::Variant;

/// `Params` of `refract/bindings.wgsl`.
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
    /// Scattering, 1/m; with several fluids, the scale of the mixture's scattering.
    pub scattering: [f32; 3],
    /// Mean cosine of scattering.
    pub anisotropy: f32,
    /// Share of light from everywhere outside that enters a turbid liquid.
    pub mean_transmittance: f32,
    /// Radius of particles, m.
    pub radius: f32,
    /// Radiance of which the sums of diffuse particles count shares.
    pub diffuse_white: f32,
    /// Padding.
    pub pad: u32,
    /// Corner of the cells of spheres relative to the eye, m.
    pub cells_first: [f32; 3],
    /// Side of a cell, m.
    pub cells_side: f32,
    /// Cells along each axis; 0 without spheres.
    pub cells_across: [u32; 3],
    /// Padding.
    pub pad_cells: u32,
}

/// Group 1 of the passes over pixels: the names of `refract/bindings.wgsl`, in its order.
pub const BINDINGS: [&str; 19] = [
    "params",
    "aggregate_layers",
    "splash_layers",
    "gbuffer_planes",
    "bounds",
    "mixture",
    "gbuffer_surfaces",
    "radiance",
    "diagnostics",
    "tiles",
    "host_color",
    "first_radiance",
    "body_radiance",
    "scattering_mixture",
    "turbid_light",
    "slab_table",
    "diffuse_above",
    "diffuse_inside",
    "cells",
];

/// Bytes before a list of pixels: the numbers of groups, pixels, rays and fallbacks.
const LIST_COUNTS: u64 = 16;

/// The picture of a frame, and memory between its passes.
#[derive(Debug)]
pub struct RefractImages {
    /// The linear picture.
    pub radiance: Radiance,
    /// The picture with one ray per pixel, of adaptive variants.
    first_radiance: wgpu::Texture,
    /// When counting: interfaces, length inside (m), solver iterations, solver failures; otherwise one pixel.
    pub diagnostics: wgpu::Texture,
    /// Background pixels that contain an edge, then liquid pixels whose picture has structure.
    listed: PixelList,
}

/// Pixels gathered to be drawn together: `refract/lists.wgsl`.
#[derive(Debug, Clone)]
struct PixelList {
    /// Counts of groups, pixels, rays and fallbacks, then pixels.
    list: wgpu::Buffer,
    /// Arguments of the indirect dispatch over them.
    dispatch: wgpu::Buffer,
}

/// Inputs of a frame's picture.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    /// The drawn view. Its bounds are read if [`Variant::bounds`] is set.
    pub eye: &'a ViewPasses,
    pub params: &'a Params,
    /// [`settings::Refract::structure`].
    pub structure: f32,
    /// A host's colour, or the background.
    pub behind: Option<&'a wgpu::TextureView>,
    /// Radiance of an opaque body.
    pub body: Option<&'a wgpu::Texture>,
    /// Light of a turbid liquid.
    pub turbid: Option<&'a TurbidImages>,
    /// Foam, spray, bubbles and dust.
    pub diffuse: Option<&'a DiffuseImages>,
    /// [`work`] per pixel.
    pub work: u64,
}

/// Draws the liquid, and everything visible through and beside it.
#[derive(Debug)]
pub struct Refract {
    liquid: wgpu::ComputePipeline,
    background: wgpu::ComputePipeline,
    edges: wgpu::ComputePipeline,
    sections: Vec<Section>,
    tiles: TileLists,
    listed: PixelList,
    /// Group 3 of all passes: the list.
    list: Bound,
    structured: Option<Structured>,
    work: u64,
}

/// Group 1 of the passes over a section of the tiles.
#[derive(Debug)]
struct Section {
    liquid: Bound,
    background: Bound,
}

/// Draws the further rays of adaptive variants, of pixels whose picture has structure: `refract/structure.wgsl`.
#[derive(Debug)]
struct Structured {
    find: wgpu::ComputePipeline,
    draw: wgpu::ComputePipeline,
    /// Group 1 of both, by section of the tiles.
    sections: Vec<[Bound; 2]>,
    /// The picture with one ray per pixel, and that with all.
    pictures: [wgpu::Texture; 2],
}

impl RefractImages {
    /// Creates the images of a picture of `size` pixels; without `count` the diagnostics are one pixel.
    pub fn new(gpu: &Gpu, size: UVec2, count: bool) -> Self {
        let counted = if count { size } else { UVec2::ONE };
        Self {
            radiance: Radiance { texture: create_texture(gpu, "radiance", size) },
            first_radiance: create_texture(gpu, "first radiance", UVec2::ONE),
            diagnostics: create_texture(gpu, "diagnostics", counted),
            listed: PixelList::new(gpu, size),
        }
    }

    /// Replaces the picture by `spare`, if that has its size, or by a new one, and returns it.
    pub(crate) fn take_radiance(
        &mut self,
        gpu: &Gpu,
        spare: Option<wgpu::Texture>,
    ) -> wgpu::Texture {
        let taken = &self.radiance.texture;
        let spare = spare.filter(|spare| spare.size() == taken.size());
        let next = spare.unwrap_or_else(|| create_texture(gpu, "radiance", extent(taken)));
        std::mem::replace(&mut self.radiance.texture, next)
    }

    /// Records the readback of the last picture's counts of rays with a host.
    pub fn record_host_rays(&self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) -> Pending {
        Pending::record(gpu, encoder, &self.listed.list, 8, LIST_COUNTS - 8)
    }
}

impl Refract {
    /// Prepares the picture of `variant`. Its pipelines take longer to compile than all others together.
    pub fn prepare(
        gpu: &Gpu,
        variant: Variant,
        inputs: Inputs<'_>,
        images: &mut RefractImages,
    ) -> Self {
        let Inputs { eye, params, structure, behind, body, turbid, diffuse, work } = inputs;
        let tiles = &eye.images.tiles;
        if variant.adaptive && images.first_radiance.size() != images.radiance.texture.size() {
            let size = extent(&images.radiance.texture);
            images.first_radiance = create_texture(gpu, "first radiance", size);
        }
        let view = |texture: &wgpu::Texture| texture.create_view(&Default::default());
        let [radiance, first_radiance] =
            [&images.radiance.texture, &images.first_radiance].map(view);
        let diagnostics = view(&images.diagnostics);
        let planes = view(&eye.images.gbuffer.planes);
        let params = gpu.buffer_with("refract", gpu::UNIFORM, &[*params]);
        let body = body.map(view);
        let body = body.as_ref();
        let light = turbid.map_or_else(|| turbid::no_light(gpu), |turbid| view(&turbid.light));
        let table = turbid.map_or_else(|| planes.clone(), |turbid| view(&turbid.table));
        let turbid = [&light, &table];
        let (params, planes) = (&params, &planes);
        let diffuse = diffuse.map_or_else(
            || {
                [(); 3].map(|()| {
                    gpu.buffer_with("no spheres", wgpu::BufferUsages::STORAGE, &[0u32; 4])
                })
            },
            DiffuseImages::sums,
        );
        let pixels =
            Pixels { gpu, variant, eye, params, planes, behind, body, turbid, diffuse: &diffuse };
        let bind = |target: &_, seen: &_, list: &_, section| {
            pixels.bind([target, seen, &diagnostics], list, section)
        };
        let first = if variant.adaptive { &first_radiance } else { &radiance };
        let of_section = |section| Section {
            liquid: bind(first, planes, &tiles.liquid, section),
            background: bind(first, planes, &tiles.background, section),
        };
        let sections: Vec<_> = tiles.sections().map(of_section).collect();

        let list = images.listed.list.as_entire_binding();
        let list = gpu.bind("listed pixels", &[(gpu::storage_read_write(LIST_COUNTS + 4), list)]);
        let own = &sections[0].liquid.layout;
        let kernel = |variant, entry: &str| pixels.kernel(variant, entry, [own, &list.layout]);
        let first = variant.first();
        let kernels = [
            kernel(first, "refract_pixels"),
            kernel(first, "background_pixels"),
            kernel(first, "edge_pixels"),
        ];
        let structured = variant.adaptive.then(|| {
            let of_section = |section| {
                let found = bind_found(gpu, eye, structure, &first_radiance, section);
                [found, bind(&radiance, &first_radiance, &tiles.liquid, section)]
            };
            tiles.sections().map(of_section).collect::<Vec<_>>()
        });
        let ([liquid, background, edges], structured) = match structured {
            None => (gpu.pipelines(kernels), None),
            Some(sections) => {
                let [liquid, background, edges] = kernels;
                let find = find_kernel(gpu, eye, &sections[0][0].layout, &list);
                let draw = kernel(variant, "structured_pixels");
                let [liquid, background, edges, find, draw] =
                    gpu.pipelines([liquid, background, edges, find, draw]);
                let pictures = [&images.first_radiance, &images.radiance.texture].map(Clone::clone);
                ([liquid, background, edges], Some(Structured { find, draw, sections, pictures }))
            }
        };
        let (tiles, listed) = (tiles.clone(), images.listed.clone());
        Self { liquid, background, edges, sections, tiles, listed, list, structured, work }
    }

    /// Records the picture.
    pub fn record(&self, commands: &mut Commands<'_>, eye: &ViewPasses, span: Span<'_>) {
        let Self { tiles, listed, structured, .. } = self;
        let work = tiles.pixels().saturating_mul(self.work);
        let last = tiles.sections().end - 1;
        for (section, bound) in tiles.sections().zip(&self.sections) {
            commands.reserve(work);
            listed.clear(commands.encoder, section == 0);
            let mut pass = self.begin(commands.encoder, eye, span.part(section == 0, false));
            let at = |which| tiles.dispatch(which, section);
            pass.set_pipeline(&self.background);
            pass.set_bind_group(1, &bound.background.group, &[]);
            pass.dispatch_workgroups_indirect(&tiles.dispatches, at(TileLists::BACKGROUND));
            pass.set_pipeline(&self.liquid);
            pass.set_bind_group(1, &bound.liquid.group, &[]);
            pass.dispatch_workgroups_indirect(&tiles.dispatches, at(TileLists::LIQUID));
            drop(pass);
            listed.size_dispatch(commands.encoder);
            let span = span.part(false, section == last && structured.is_none());
            let mut pass = self.begin(commands.encoder, eye, span);
            pass.set_pipeline(&self.edges);
            pass.set_bind_group(1, &bound.liquid.group, &[]);
            pass.dispatch_workgroups_indirect(&listed.dispatch, 0);
        }
        let Some(Structured { find, draw, sections, pictures: [first, all] }) = structured else {
            return;
        };
        let [from, to] = [first, all].map(|picture| picture.as_image_copy());
        commands.encoder.copy_texture_to_texture(from, to, all.size());
        // Pixels in the next section are neighbours too: all have their first ray before.
        for (section, [found, drawn]) in tiles.sections().zip(sections) {
            commands.reserve(work);
            listed.clear(commands.encoder, false);
            let mut pass = self.begin(commands.encoder, eye, span.part(false, false));
            pass.set_pipeline(find);
            pass.set_bind_group(1, &found.group, &[]);
            let at = tiles.dispatch(TileLists::LIQUID, section);
            pass.dispatch_workgroups_indirect(&tiles.dispatches, at);
            drop(pass);
            listed.size_dispatch(commands.encoder);
            let mut pass = self.begin(commands.encoder, eye, span.part(false, section == last));
            pass.set_pipeline(draw);
            pass.set_bind_group(1, &drawn.group, &[]);
            pass.dispatch_workgroups_indirect(&listed.dispatch, 0);
        }
    }

    fn begin<'a>(
        &self,
        encoder: &'a mut wgpu::CommandEncoder,
        eye: &ViewPasses,
        span: Span<'_>,
    ) -> wgpu::ComputePass<'a> {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("refract"),
            timestamp_writes: span.compute(),
        });
        pass.set_bind_group(0, &eye.camera.group, &[]);
        pass.set_bind_group(2, &eye.scene.group, &[]);
        pass.set_bind_group(3, &self.list.group, &[]);
        pass
    }
}

/// Inputs that all passes over pixels share: `refract/pixels.wgsl`.
#[derive(Clone, Copy)]
struct Pixels<'a> {
    gpu: &'a Gpu,
    variant: Variant,
    eye: &'a ViewPasses,
    params: &'a wgpu::Buffer,
    planes: &'a wgpu::TextureView,
    behind: Option<&'a wgpu::TextureView>,
    body: Option<&'a wgpu::TextureView>,
    /// Light around a turbid liquid, and the light of slabs.
    turbid: [&'a wgpu::TextureView; 2],
    /// Sums of diffuse particles in the air and in the liquid, and their cells.
    diffuse: &'a [wgpu::Buffer; 3],
}

impl Pixels<'_> {
    /// Group 1, of a section of a list of tiles.
    fn bind(
        self,
        [radiance, first_radiance, diagnostics]: [&wgpu::TextureView; 3],
        list: &wgpu::Buffer,
        section: u32,
    ) -> Bound {
        let Self { gpu, variant, eye, params, planes, behind, body, turbid, diffuse } = self;
        let ([light, table], [above, inside, cells]) = (turbid, diffuse);
        let gbuffer_surfaces = eye.images.gbuffer.surfaces.create_view(&Default::default());
        let mips = variant.mips();
        let view = |layers: &Layers| if mips { layers.mips.clone() } else { layers.view.clone() };
        let aggregate_layers = view(eye.aggregate_layers());
        let splash_layers = view(&eye.images.splat.splash);
        let layers = if mips { gpu::sampled(D2Array) } else { gpu.layers() };
        let (read, written) = (gpu::sampled(D2), gpu::storage_texture(Layers::FORMAT, D2));
        let bindings: [_; BINDINGS.len()] = [
            (gpu::uniform::<Params>(), params.as_entire_binding()),
            (layers, TextureView(&aggregate_layers)),
            (layers, TextureView(&splash_layers)),
            (read, TextureView(planes)),
            (read, TextureView(&eye.images.bounds)),
            (read, TextureView(&eye.images.mixture.view)),
            (read, TextureView(&gbuffer_surfaces)),
            (written, TextureView(radiance)),
            (written, TextureView(diagnostics)),
            (gpu::storage_of(8), eye.images.tiles.section(list, section)),
            (read, TextureView(behind.unwrap_or(planes))),
            (read, TextureView(first_radiance)),
            (read, TextureView(body.unwrap_or(planes))),
            (read, TextureView(&eye.images.scattering.view)),
            (gpu::sampled_integers(), TextureView(light)),
            (read, TextureView(table)),
            (gpu::storage_of(16), above.as_entire_binding()),
            (gpu::storage_of(16), inside.as_entire_binding()),
            (gpu::storage_of(16), cells.as_entire_binding()),
        ];
        gpu.bind("refract", &bindings)
    }

    fn kernel(
        self,
        variant: Variant,
        entry: &str,
        [own, list]: [&wgpu::BindGroupLayout; 2],
    ) -> Kernel {
        let (camera, scene) = (&self.eye.camera, &self.eye.scene);
        let mips = gpu::shader::Words { mips: variant.mips(), ..Default::default() };
        let constants =
            [&variant.constants()[..], &scene.variant.constants(), &camera.constants()].concat();
        let layouts = [&camera.layout, own, &scene.layout, list];
        Kernel::new(variant.shader(), mips, entry, &layouts, &constants)
    }
}

/// Group 1 of `refract/structure.wgsl`, of a section of the tiles and the radiance of first rays.
fn bind_found(
    gpu: &Gpu,
    eye: &ViewPasses,
    structure: f32,
    radiance: &wgpu::TextureView,
    section: u32,
) -> Bound {
    let params = StructureParams { structure };
    let params = gpu.buffer_with("structure", gpu::UNIFORM, &[params]);
    let tiles = &eye.images.tiles;
    let bindings = [
        (gpu::uniform::<StructureParams>(), params.as_entire_binding()),
        (gpu.layers(), TextureView(&eye.aggregate_layers().view)),
        (gpu.layers(), TextureView(&eye.images.splat.splash.view)),
        (gpu::sampled(D2), TextureView(radiance)),
        (gpu::storage_of(8), tiles.section(&tiles.liquid, section)),
    ];
    gpu.bind("structure", &bindings)
}

/// The kernel that lists pixels by the radiance of their first rays.
fn find_kernel(gpu: &Gpu, eye: &ViewPasses, found: &wgpu::BindGroupLayout, list: &Bound) -> Kernel {
    let splash = [("SPLASH", f64::from(u8::from(eye.splash_layers().is_some())))];
    let constants = [&eye.camera.constants()[..], &splash].concat();
    let none = gpu.layout("none", wgpu::ShaderStages::COMPUTE, &[]);
    let layouts = [&eye.camera.layout, found, &none, &list.layout];
    let words = gpu::shader::Words::default();
    Kernel::new("refract/structure.wgsl", words, "find", &layouts, &constants)
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

impl PixelList {
    fn new(gpu: &Gpu, size: UVec2) -> Self {
        let limit = gpu.device.limits().max_storage_buffer_binding_size;
        let pixels = u64::from(size.x) * u64::from(size.y);
        let list = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("listed pixels"),
            size: (LIST_COUNTS + 4 * pixels).min(limit / 4 * 4),
            usage: wgpu::BufferUsages::STORAGE
                | wgpu::BufferUsages::COPY_DST
                | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::INDIRECT;
        let dispatch = gpu.buffer_with("listed groups", usage, &[0u32, 1, 1]);
        Self { list, dispatch }
    }

    /// Records the emptying of the list; the counts of rays are kept unless `all`.
    fn clear(&self, encoder: &mut wgpu::CommandEncoder, all: bool) {
        encoder.clear_buffer(&self.list, 0, Some(if all { LIST_COUNTS } else { 8 }));
    }

    /// Records the size of the dispatch over the list. It is copied rather than written by shaders, for which it would be
    /// one storage buffer more than WebGPU's core allows.
    fn size_dispatch(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.copy_buffer_to_buffer(&self.list, 0, &self.dispatch, 0, 4);
    }
}

/// `Params` of `refract/structure.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct StructureParams {
    /// Least second difference of the picture, as a share of its radiance.
    pub structure: f32,
}

impl Params {
    /// The parameters of a frame whose particles have `radius`, m.
    pub fn new(scene: &Scene, settings: &settings::Refract, radius: f32) -> Self {
        let uniform = |shares: &Shares| shares.uniform().to_array();
        let [absorption, scattering] =
            [Shares::of_absorption(scene), Shares::of_scattering(scene)].map(|s| uniform(&s));
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
            scattering,
            anisotropy: mixture::anisotropy(scene),
            mean_transmittance: turbid::slab::mean_transmittance(scene.liquid.ior.into()) as f32,
            radius,
            diffuse_white: 1.0,
            pad: 0,
            cells_first: [0.0; 3],
            cells_side: 1.0,
            cells_across: [0; 3],
            pad_cells: 0,
        }
    }

    /// The same for the view of a light, which no scattered light reaches.
    pub fn of_light(scene: &Scene, settings: &settings::Refract, radius: f32) -> Self {
        let absorption = Shares::of_attenuation(scene).uniform().to_array();
        Self { absorption, ..Self::new(scene, settings, radius) }
    }
}

fn extent(texture: &wgpu::Texture) -> UVec2 {
    UVec2::new(texture.width(), texture.height())
}

fn create_texture(gpu: &Gpu, label: &str, size: UVec2) -> wgpu::Texture {
    let usage = wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::COPY_SRC
        | wgpu::TextureUsages::COPY_DST;
    gpu.texture(label, size, 1, Layers::FORMAT, usage)
}
