//! Refraction of light through the layers: `shaders/refract/`.
//!
//! The shader is specialised for the frame's features (splashes, absorption, solids that liquid can wet),
//! for the intersector and for all loop counts; each specialisation is compiled once and kept.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use glam::UVec2;
use wgpu::TextureViewDimension::{D2, D2Array};

use super::bounds::Bounds;
use super::mixture;
use super::scene_binding::{SceneBinding, SceneVariant};
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
    /// Only pixels whose picture has structure get as many, all others one.
    pub adaptive: bool,
    /// Rays per background pixel that contains an edge.
    pub edge_samples: u32,
    /// The frame has splashes.
    pub splash: bool,
    /// The intersector reads the bounds of the layers.
    pub bounds: bool,
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
            adaptive: settings.samples > 1 && settings.structure > 0.0,
            edge_samples: settings.edge_samples,
            splash,
            bounds: settings.solver == Solver::Guarded,
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

    /// The variant of the first rays of all pixels.
    fn first(self) -> Self {
        match self.adaptive {
            true => Self {
                samples: 1,
                adaptive: false,
                edge_samples: self.edge_samples.max(self.samples),
                ..self
            },
            false => self,
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
            Solver::Guarded => constants.push(("BOUNDS", f64::from(u8::from(self.bounds)))),
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

/// Bytes before a list of pixels: the number of them, of rays and of fallbacks.
const LIST_COUNTS: u64 = 12;

#[derive(Debug)]
struct Pipelines {
    liquid: wgpu::ComputePipeline,
    background: wgpu::ComputePipeline,
    edges: wgpu::ComputePipeline,
}

/// Pixels gathered to be drawn together: `refract/lists.wgsl`.
#[derive(Debug)]
struct PixelList {
    /// Counts of pixels, of rays and of fallbacks, then pixels.
    list: wgpu::Buffer,
    /// Arguments of the indirect dispatch over them.
    dispatch: wgpu::Buffer,
    gather: wgpu::BindGroup,
    draw: wgpu::BindGroup,
}

/// Pixels whose picture has structure: `refract/structure.wgsl`.
#[derive(Debug)]
struct Structure {
    /// Without and with splashes, for perspective and orthographic views; compiled on first use.
    find: [[Option<wgpu::ComputePipeline>; 2]; 2],
    params: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
}

/// Draws the liquid, and everything visible through and beside it.
#[derive(Debug)]
pub struct Refract {
    /// Output.
    pub radiance: Radiance,
    /// The picture with one ray per pixel, of adaptive variants.
    first_radiance: wgpu::Texture,
    /// Output when counting: interfaces, length inside (m), solver iterations, solver failures.
    pub diagnostics: wgpu::Texture,
    /// By variants, and whether the view is orthographic.
    pipelines: HashMap<(Variant, SceneVariant, bool), Pipelines>,
    /// The further rays of adaptive variants.
    structured: HashMap<(Variant, SceneVariant, bool), wgpu::ComputePipeline>,
    structure: Structure,
    params: wgpu::Buffer,
    /// Without and with mip levels of the layers.
    layouts: [wgpu::BindGroupLayout; 2],
    list_layouts: [wgpu::BindGroupLayout; 2],
    /// Background pixels that contain an edge, then liquid pixels whose picture has structure.
    listed: PixelList,
}

impl Refract {
    /// Creates the layout; pipelines are compiled on first use.
    pub fn new(gpu: &Gpu) -> Self {
        let layout = |layers: wgpu::BindingType| {
            let bindings = [
                gpu::uniform::<Params>(),
                layers,
                layers,
                gpu::sampled(D2),
                gpu::sampled(D2),
                gpu::sampled(D2),
                gpu::sampled(D2),
                gpu::storage_texture(Layers::FORMAT, D2),
                gpu::storage_texture(Layers::FORMAT, D2),
                gpu::storage_of(8),
                gpu::sampled(D2),
                gpu::sampled(D2),
            ];
            gpu.layout("refract", wgpu::ShaderStages::COMPUTE, &bindings)
        };
        let layouts = [gpu.layers(), gpu::sampled(D2Array)].map(layout);
        // Indirect arguments must not be bound where they are used, so drawing the pixels binds the list alone.
        let list_bindings = [gpu::storage_read_write(LIST_COUNTS + 4), gpu::storage_read_write(4)];
        let list_layouts = [&list_bindings[..], &list_bindings[..1]]
            .map(|bindings| gpu.layout("listed pixels", wgpu::ShaderStages::COMPUTE, bindings));
        Self {
            radiance: Radiance { texture: create_texture(gpu, "radiance", UVec2::ONE) },
            first_radiance: create_texture(gpu, "first radiance", UVec2::ONE),
            diagnostics: create_texture(gpu, "diagnostics", UVec2::ONE),
            pipelines: HashMap::new(),
            structured: HashMap::new(),
            structure: Structure::new(gpu),
            params: gpu::uniform_buffer::<Params>(gpu, "refract"),
            layouts,
            listed: PixelList::new(gpu, &list_layouts, UVec2::ONE),
            list_layouts,
        }
    }

    /// Replaces the textures; without `count` the diagnostics are one pixel.
    pub fn resize(&mut self, gpu: &Gpu, size: UVec2, count: bool) {
        self.radiance = Radiance { texture: create_texture(gpu, "radiance", size) };
        self.listed = PixelList::new(gpu, &self.list_layouts, size);
        let size = if count { size } else { UVec2::ONE };
        self.diagnostics = create_texture(gpu, "diagnostics", size);
    }

    /// Replaces the picture by `spare`, if that has its size, or by a new one, and returns it.
    pub(crate) fn take_radiance(
        &mut self,
        gpu: &Gpu,
        spare: Option<wgpu::Texture>,
    ) -> wgpu::Texture {
        let taken = &self.radiance.texture;
        let size = UVec2::new(taken.width(), taken.height());
        let spare = spare.filter(|spare| spare.size() == taken.size());
        let next = spare.unwrap_or_else(|| create_texture(gpu, "radiance", size));
        std::mem::replace(&mut self.radiance.texture, next)
    }

    /// Whether `variant` is compiled for the bound scene: it takes longer than all other pipelines together.
    pub fn is_compiled(&self, variant: Variant, eye: &ViewPasses) -> bool {
        let key = |variant| (variant, eye.scene.variant, eye.camera.is_orthographic());
        self.pipelines.contains_key(&key(variant.first()))
            && (!variant.adaptive || self.structured.contains_key(&key(variant)))
    }

    /// Writes the parameters and compiles `variant` if it is new. `structure` is [`settings::Refract::structure`].
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        camera: &CameraBinding,
        scene: &SceneBinding,
        variant: Variant,
        params: &Params,
        structure: f32,
    ) {
        gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(params));
        let [gather, draw] = &self.list_layouts;
        let layout = &self.layouts[usize::from(variant.mips())];
        let own = gpu::shader::Variant { mips: variant.mips(), ..Default::default() };
        let module = || gpu::shader::module(gpu, variant.shader(), own);
        let key = |variant| (variant, scene.variant, camera.is_orthographic());
        let pipeline = |module: &_, variant: Variant, entry: &str, list: &_| {
            let constants =
                [&variant.constants()[..], &scene.variant.constants(), &camera.constants()]
                    .concat();
            let layouts = [&camera.layout, layout, &scene.layout, list];
            gpu::module_pipeline(gpu, variant.shader(), module, entry, &layouts, &constants)
        };
        let structured = || {
            let is_new = variant.adaptive && !self.structured.contains_key(&key(variant));
            is_new.then(|| pipeline(&module(), variant, "structured_pixels", draw))
        };
        let first = variant.first();
        let all = || {
            let is_new = !self.pipelines.contains_key(&key(first));
            is_new.then(|| {
                let module = module();
                let (liquid, (background, edges)) = rayon::join(
                    || pipeline(&module, first, "refract_pixels", gather),
                    || {
                        let background = || pipeline(&module, first, "background_pixels", gather);
                        rayon::join(background, || pipeline(&module, first, "edge_pixels", draw))
                    },
                );
                Pipelines { liquid, background, edges }
            })
        };
        let (all, structured) = rayon::join(all, structured);
        self.pipelines.extend(all.map(|all| (key(first), all)));
        self.structured.extend(structured.map(|structured| (key(variant), structured)));
        if variant.adaptive {
            self.structure.prepare(gpu, camera, gather, variant.splash, structure);
            let picture = &self.radiance.texture;
            if self.first_radiance.size() != picture.size() {
                let size = UVec2::new(picture.width(), picture.height());
                self.first_radiance = create_texture(gpu, "first radiance", size);
            }
        }
    }

    /// Records the readback of the last picture's counts of rays with a host.
    pub fn record_host_rays(&self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) -> Pending {
        Pending::record(gpu, encoder, &self.listed.list, 4, LIST_COUNTS - 4)
    }

    /// Records the picture with a variant that was passed to [`Refract::prepare`] and takes
    /// [`work`] per pixel; `behind` is a host's colour or the background. `bounds` are those of the view's layers,
    /// if [`Variant::bounds`] is set.
    pub fn record(
        &self,
        commands: &mut Commands<'_>,
        eye: &ViewPasses,
        bounds: Option<&Bounds>,
        (variant, work): (Variant, u64),
        behind: Option<&wgpu::TextureView>,
        span: Span<'_>,
    ) {
        let gpu = commands.gpu;
        let view = |texture: &wgpu::Texture| texture.create_view(&Default::default());
        let gbuffer = &eye.images.gbuffer;
        let (planes, surfaces) = (view(&gbuffer.planes), view(&gbuffer.surfaces));
        let [radiance, first_radiance, diagnostics] =
            [&self.radiance.texture, &self.first_radiance, &self.diagnostics].map(view);
        let tiles = &eye.images.tiles;
        let mips = variant.mips();
        let layers_of =
            |layers: &'_ Layers| if mips { layers.mips.clone() } else { layers.view.clone() };
        let (aggregates, splashes) =
            (layers_of(eye.aggregate_layers()), layers_of(&eye.images.splat.splash));
        let group = |target: &wgpu::TextureView,
                     seen: &wgpu::TextureView,
                     list: &wgpu::Buffer,
                     section: u32| {
            let resources = [
                self.params.as_entire_binding(),
                wgpu::BindingResource::TextureView(&aggregates),
                wgpu::BindingResource::TextureView(&splashes),
                wgpu::BindingResource::TextureView(&planes),
                wgpu::BindingResource::TextureView(bounds.map_or(&planes, |bounds| &bounds.view)),
                wgpu::BindingResource::TextureView(&eye.images.mixture.view),
                wgpu::BindingResource::TextureView(&surfaces),
                wgpu::BindingResource::TextureView(target),
                wgpu::BindingResource::TextureView(&diagnostics),
                tiles.section(list, section),
                wgpu::BindingResource::TextureView(behind.unwrap_or(&planes)),
                wgpu::BindingResource::TextureView(seen),
            ];
            gpu::bind_group(gpu, "refract", &self.layouts[usize::from(mips)], &resources)
        };
        let key = |variant| (variant, eye.scene.variant, eye.camera.is_orthographic());
        let first = variant.first();
        let pipelines = &self.pipelines[&key(first)];
        let target = if variant.adaptive { &first_radiance } else { &radiance };
        let last = tiles.sections().end - 1;
        for section in tiles.sections() {
            commands.reserve(tiles.pixels().saturating_mul(work));
            self.listed.clear(commands.encoder, section == 0);
            let span = span.part(section == 0, section == last && !variant.adaptive);
            let mut pass = begin(commands.encoder, eye, span);
            let at = |which| tiles.dispatch(which, section);
            pass.set_bind_group(3, &self.listed.gather, &[]);
            pass.set_pipeline(&pipelines.background);
            pass.set_bind_group(1, &group(target, &planes, &tiles.background, section), &[]);
            pass.dispatch_workgroups_indirect(&tiles.dispatches, at(TileLists::BACKGROUND));
            pass.set_pipeline(&pipelines.liquid);
            pass.set_bind_group(1, &group(target, &planes, &tiles.liquid, section), &[]);
            pass.dispatch_workgroups_indirect(&tiles.dispatches, at(TileLists::LIQUID));
            pass.set_bind_group(3, &self.listed.draw, &[]);
            pass.set_pipeline(&pipelines.edges);
            pass.dispatch_workgroups_indirect(&self.listed.dispatch, 0);
        }
        if !variant.adaptive {
            return;
        }
        let [from, to] = [&self.first_radiance, &self.radiance.texture].map(|t| t.as_image_copy());
        commands.encoder.copy_texture_to_texture(from, to, self.radiance.texture.size());
        // Pixels in the next section are neighbours too: all have their first ray before.
        for section in tiles.sections() {
            commands.reserve(tiles.pixels().saturating_mul(work));
            self.listed.clear(commands.encoder, false);
            let mut pass = begin(commands.encoder, eye, span.part(false, section == last));
            self.structure.find(gpu, &mut pass, eye, (&first_radiance, &self.listed), section);
            pass.set_bind_group(3, &self.listed.draw, &[]);
            pass.set_pipeline(&self.structured[&key(variant)]);
            let group = group(&radiance, &first_radiance, &tiles.liquid, section);
            pass.set_bind_group(1, &group, &[]);
            pass.dispatch_workgroups_indirect(&self.listed.dispatch, 0);
        }
    }
}

fn begin<'a>(
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
    pass
}

impl Structure {
    fn new(gpu: &Gpu) -> Self {
        let bindings = [
            gpu::uniform::<StructureParams>(),
            gpu.layers(),
            gpu.layers(),
            gpu::sampled(D2),
            gpu::storage_of(8),
        ];
        Self {
            find: [const { [const { None }; 2] }; 2],
            params: gpu::uniform_buffer::<StructureParams>(gpu, "structure"),
            layout: gpu.layout("structure", wgpu::ShaderStages::COMPUTE, &bindings),
        }
    }

    fn prepare(
        &mut self,
        gpu: &Gpu,
        camera: &CameraBinding,
        list: &wgpu::BindGroupLayout,
        splash: bool,
        structure: f32,
    ) {
        let params = StructureParams { structure };
        gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(&params));
        let kept = &mut self.find[usize::from(camera.is_orthographic())][usize::from(splash)];
        kept.get_or_insert_with(|| {
            let splash = [("SPLASH", f64::from(u8::from(splash)))];
            let constants = [&camera.constants()[..], &splash].concat();
            let none = gpu.layout("none", wgpu::ShaderStages::COMPUTE, &[]);
            let layouts = [&camera.layout, &self.layout, &none, list];
            gpu::compute_pipeline(gpu, "refract/structure.wgsl", "find", &layouts, &constants)
        });
    }

    /// Lists the pixels of a section by the radiance of their first rays.
    fn find(
        &self,
        gpu: &Gpu,
        pass: &mut wgpu::ComputePass<'_>,
        eye: &ViewPasses,
        (radiance, listed): (&wgpu::TextureView, &PixelList),
        section: u32,
    ) {
        let splash = usize::from(eye.splash_layers().is_some());
        let pipeline = &self.find[usize::from(eye.camera.is_orthographic())][splash];
        let Some(pipeline) = pipeline else { return };
        let tiles = &eye.images.tiles;
        let resources = [
            self.params.as_entire_binding(),
            wgpu::BindingResource::TextureView(&eye.aggregate_layers().view),
            wgpu::BindingResource::TextureView(&eye.images.splat.splash.view),
            wgpu::BindingResource::TextureView(radiance),
            tiles.section(&tiles.liquid, section),
        ];
        pass.set_pipeline(pipeline);
        pass.set_bind_group(1, &gpu::bind_group(gpu, "structure", &self.layout, &resources), &[]);
        pass.set_bind_group(3, &listed.gather, &[]);
        let at = tiles.dispatch(TileLists::LIQUID, section);
        pass.dispatch_workgroups_indirect(&tiles.dispatches, at);
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

impl PixelList {
    fn new(gpu: &Gpu, [gather, draw]: &[wgpu::BindGroupLayout; 2], size: UVec2) -> Self {
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
        let usage = wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::INDIRECT;
        let dispatch = gpu::buffer_with(gpu, "listed groups", usage, &[0u32, 1, 1]);
        let resources = [list.as_entire_binding(), dispatch.as_entire_binding()];
        let gather = gpu::bind_group(gpu, "pixels listed", gather, &resources);
        let draw = gpu::bind_group(gpu, "pixels drawn", draw, &resources[..1]);
        Self { list, dispatch, gather, draw }
    }

    /// Records the emptying of the list; the counts of rays are kept unless `all`.
    fn clear(&self, encoder: &mut wgpu::CommandEncoder, all: bool) {
        encoder.clear_buffer(&self.list, 0, Some(if all { LIST_COUNTS } else { 4 }));
        encoder.clear_buffer(&self.dispatch, 0, Some(4));
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
        | wgpu::TextureUsages::COPY_SRC
        | wgpu::TextureUsages::COPY_DST;
    gpu::texture(gpu, label, size, 1, Layers::FORMAT, usage)
}
