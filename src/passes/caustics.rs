//! Caustics, the light that reaches solids through the liquid: `shaders/caustics/`.
//!
//! A light has a view of the liquid, drawn like the camera's. A map is made from its layers: each texel
//! holds the irradiance through the liquid on the solid that the light's straight ray through the texel
//! hits. The camera pass looks the map up wherever it sees a lit solid.
//!
//! - `forward` (E. Wallace, Rendering realtime caustics in WebGL, 2016; M. Renou, Real-time rendering
//!   of water caustics, 2020; Mayer, Assarsson and Sintorn 2026): a grid over the liquid's front; each
//!   vertex is refracted and traced, and the light of each cell is deposited on the map where its
//!   corners land. This version conserves light: it uses exact areas and folds of both signs, and
//!   splits cells at edges.
//! - `gather` (Granizo-Hidalgo and Holzschuch 2024): for each texel, a walk over the same grid finds the
//!   point of the surface that sends light there. The published method starts from a ray traced
//!   against a mesh of the pool; here one lookup gives the first triangle, because the straight line
//!   from a receiver to the light is a texel of the light's view: it needs no mesh and no ray tracing
//!   hardware.
//! - `straight`: no refraction, but the light loses what the liquid reflects and absorbs.

mod map;
mod pipelines;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, UVec2};

pub use self::map::CausticMap;
use self::pipelines::{Key, Layouts, MethodPipelines, Pipelines, large_groups};
use super::refract;
use super::scene_binding::SceneBinding;
use super::{CameraBinding, GBufferImages, Layers};
use crate::error::{Error, Limited, Result};
use crate::gpu::{self, Commands, Gpu, Piece, Span};
use crate::light_view::LightView;
use crate::scene::{Light, Scene};
use crate::settings::{self, Method};

/// `CausticParams` of `caustics/params.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// A sun's irradiance, or a point light's radiant intensity.
    pub power: [f32; 3],
    /// Most triangles that `gather` walks.
    pub steps: u32,
    /// Direction towards a sun, or a point light's position, in view space.
    pub light: [f32; 3],
    /// Number of interfaces that light is followed through.
    pub interfaces: u32,
    /// Grid cells along each side.
    pub cells: [u32; 2],
    /// Light on a level surface over that on a surface perpendicular to the view.
    pub gain: f32,
    /// Standard deviation of the blur, texels.
    pub blur: f32,
    /// The plane that extends a level surface, n·x = w in view space; 0 if there is none.
    pub level: [f32; 4],
    /// Subdivisions of a cell's side for depositing its light.
    pub subdivide: u32,
    /// 1 if the light is inside the liquid.
    pub wet: u32,
    /// Offset of the threads of this piece of a dispatch.
    pub first: [u32; 2],
    /// Offset of the view's texels in the maps.
    pub corner: [u32; 2],
    /// Index of the light.
    pub number: u32,
    /// Padding.
    pub pad: u32,
}

impl Params {
    /// The parameters for a light and its view.
    pub fn new(light: &Light, view: &LightView, settings: &settings::Caustics) -> Self {
        // A texel of a point light's view has no size in metres.
        let texel = 2.0 * view.half_extent.x / f64::from(view.size.x);
        let blur = if view.orthographic { f64::from(settings.blur) / texel } else { 0.0 };
        let back = view.view_from_world.transpose().z_axis;
        let (place, power, gain) = match *light {
            Light::Sun { direction, irradiance } => {
                let towards = -direction.as_dvec3().normalize();
                // For still water, which refracts the light; 1 if the view is along the light.
                let gain = if towards.distance(back) < 1e-9 { 1.0 } else { towards.y / back.y };
                (view.view_from_world * towards, irradiance, gain)
            }
            Light::Point { position, intensity } => {
                let place = view.view_from_world * (position - view.origin);
                (place, intensity, 1.0)
            }
        };
        Self {
            power: power.to_array(),
            steps: settings.steps,
            light: place.as_vec3().to_array(),
            interfaces: settings.interfaces,
            cells: cells(view.size, settings.grid).to_array(),
            gain: gain as f32,
            blur: blur as f32,
            level: view.level.map_or([0.0; 4], |height| {
                let up = view.view_from_world * DVec3::Y;
                let at = view.view_from_world * (height * DVec3::Y - view.origin);
                up.extend(up.dot(at)).as_vec4().to_array()
            }),
            subdivide: settings.subdivide,
            wet: 0,
            first: [0; 2],
            corner: [0; 2],
            number: 0,
            pad: 0,
        }
    }
}

/// Cells of a grid with `grid` cells along the longer side of a view.
pub fn cells(size: UVec2, grid: u32) -> UVec2 {
    let pitch = f64::from(size.max_element()) / f64::from(grid);
    (size.as_dvec2() / pitch).round().as_uvec2().max(UVec2::ONE)
}

/// Sizes of a `GridVertex`, a `Landing` and a texel's sums, bytes.
const VERTEX: u64 = 32;
const LANDING: u64 = 48;
const LIGHT_SUMS: u64 = 24;

/// Memory of the maps' kernels, kept from frame to frame. Maps of one shape, which are drawn one after the other, share
/// it.
#[derive(Debug, Default)]
pub struct CausticBuffers {
    shapes: Vec<Buffers>,
}

/// Draws the map of a light.
#[derive(Debug)]
pub struct Caustics {
    pipelines: Pipelines,
    layouts: Layouts,
    buffers: Buffers,
}

/// Intermediate results of the kernels.
#[derive(Debug, Clone)]
struct Buffers {
    size: UVec2,
    cells: UVec2,
    grid: wgpu::Buffer,
    landings: wgpu::Buffer,
    sums: wgpu::Buffer,
    /// Cells and triangles of the grid that cover many texels.
    large: wgpu::Buffer,
    gathered: wgpu::Texture,
    /// The map before the blur and after its horizontal pass; `None` without blur.
    blur: Option<[wgpu::Texture; 2]>,
}

/// Inputs of a light's map.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    pub camera: &'a CameraBinding,
    pub scene: &'a SceneBinding,
    pub aggregate: &'a Layers,
    pub splash: Option<&'a Layers>,
    pub gbuffer: &'a GBufferImages,
    /// The mixture, if the fluids differ in absorption.
    pub mixture: Option<&'a wgpu::TextureView>,
    pub params: &'a Params,
}

/// Configuration of a light's map.
#[derive(Debug, Clone, Copy)]
pub struct MapConfig<'a> {
    /// Settings for the light's view, which may differ from the scene's.
    pub settings: &'a settings::Caustics,
    /// The frame has splashes.
    pub splash: bool,
    /// Gaps that the light's view distinguishes.
    pub gaps: u32,
    /// Size in texels.
    pub size: UVec2,
}

/// Destination of a light's map: one layer of both textures.
#[derive(Debug, Clone, Copy)]
pub struct Output<'a> {
    pub map: &'a wgpu::Texture,
    pub receivers: &'a wgpu::Texture,
    pub layer: u32,
}

impl CausticBuffers {
    /// Returns the buffers of a shape; creates them if there are none.
    fn of_shape(&mut self, gpu: &Gpu, size: UVec2, cells: UVec2, blur: bool) -> Buffers {
        let shape = (size, cells, blur);
        if let Some(kept) = self.shapes.iter().find(|buffers| buffers.shape() == shape) {
            return kept.clone();
        }
        self.shapes.push(Buffers::new(gpu, size, cells, blur));
        self.shapes[self.shapes.len() - 1].clone()
    }

    /// Frees all but those of these maps.
    pub fn keep(&mut self, maps: &[&Caustics]) {
        self.shapes.retain(|own| maps.iter().any(|map| map.buffers.shape() == own.shape()));
    }
}

impl Caustics {
    /// Prepares the map of a view: chooses its buffers and compiles missing pipelines.
    ///
    /// # Errors
    /// [`Error::Limit`] for a map or a grid that the adapter cannot hold.
    pub fn prepare(
        gpu: &Gpu,
        camera: &CameraBinding,
        bound: &SceneBinding,
        scene: &Scene,
        config: MapConfig<'_>,
        kept: &mut CausticBuffers,
    ) -> Result<Self> {
        let MapConfig { settings, splash, gaps, size } = config;
        let cells = match settings.method {
            Method::Straight => UVec2::ONE,
            _ => cells(size, settings.grid),
        };
        gpu.check_image(size, Limited::CausticMap)?;
        let limits = gpu.device.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let needs = [
            ("resolution", settings.resolution, size, LIGHT_SUMS, Limited::CausticMap),
            ("grid", settings.grid, cells + 1, LANDING, Limited::CausticGrid),
        ];
        for (name, value, extent, bytes, of) in needs {
            if u64::from(extent.x) * u64::from(extent.y) * bytes > most {
                let most = most >> 20;
                let problem = format!(
                    "holds at most {most} MiB in one buffer, too little for caustics.{name} = \
                     {value}"
                );
                return Err(Error::Limit { adapter: gpu.adapter(), problem, of });
            }
        }
        let buffers = kept.of_shape(gpu, size, cells, settings.blur > 0.0);
        let key = Key::new(scene, bound, settings.method, (splash, gaps));
        let layouts = Layouts::new(gpu);
        let pipelines = Pipelines::new(gpu, &layouts, camera, bound, key);
        Ok(Self { pipelines, layouts, buffers })
    }

    /// Records the map of a light whose view was passed to [`Caustics::prepare`].
    pub fn record(
        &self,
        commands: &mut Commands<'_>,
        scene: &Scene,
        radius: f32,
        inputs: Inputs<'_>,
        output: Output<'_>,
        span: Span<'_>,
    ) {
        let buffers = &self.buffers;
        let (gpu, params) = (commands.gpu, inputs.params);
        let uniform = |label: &str, bytes: &[u8]| gpu.buffer_with(label, gpu::UNIFORM, bytes);
        let refract = refract::Params::of_light(scene, &scene.settings.refract, radius);
        let refract = uniform("light view", bytemuck::bytes_of(&refract));
        let planes = gpu::layer_view(&inputs.gbuffer.planes, 0);
        let splash = inputs.splash.unwrap_or(inputs.aggregate);
        let texture = wgpu::BindingResource::TextureView;
        let light_view = gpu.bind_group(
            "light view",
            &self.layouts.inputs,
            &[
                refract.as_entire_binding(),
                texture(&inputs.aggregate.view),
                texture(&splash.view),
                texture(&planes),
                // Bounds: light that has left the liquid does not enter it again.
                texture(&planes),
                texture(inputs.mixture.unwrap_or(&planes)),
            ],
        );
        let views = Views::of(buffers, &inputs, output);
        commands.encoder.clear_buffer(&buffers.sums, 0, None);
        commands.encoder.clear_buffer(&buffers.large, 0, Some(4));
        let work =
            Work::new(&scene.settings.caustics, buffers.size, params.blur, scene.solids.len());
        let cells = UVec2::from_array(params.cells);
        let mut steps = self.traced(gpu, &views, work, cells);
        steps.extend(self.resolved(&views, work));

        let most = gpu.most_work();
        let pieces = |step| Step::pieces(step, most);
        let parts: Vec<_> = steps.iter().flat_map(pieces).collect();
        commands.compute("caustics", span, &parts, |pass, (step, piece)| {
            let params = Params { first: piece.first.to_array(), ..*params };
            let params = uniform("caustics", bytemuck::bytes_of(&params));
            let all = [&[params.as_entire_binding()], &step.resources[..]].concat();
            pass.set_pipeline(step.pipeline);
            pass.set_bind_group(0, &inputs.camera.group, &[]);
            pass.set_bind_group(2, &inputs.scene.group, &[]);
            if step.group_index == 3 {
                pass.set_bind_group(1, &light_view, &[]);
            }
            let group = gpu.bind_group("caustics", step.layout, &all);
            pass.set_bind_group(step.group_index, &group, &[]);
            let (x, y) = gpu::workgroups(piece.size);
            pass.dispatch_workgroups(x, y, 1);
        });
    }

    /// Output of `gather` for the last light: irradiance and state.
    pub fn gathered(&self) -> &wgpu::Texture {
        &self.buffers.gathered
    }

    /// Kernels that find where light lands, of a grid of `cells`.
    fn traced<'a>(
        &'a self,
        gpu: &Gpu,
        views: &'a Views,
        work: Work,
        cells: UVec2,
    ) -> Vec<Step<'a>> {
        let Self { layouts, buffers, .. } = self;
        let (grid, landings) =
            (buffers.grid.as_entire_binding(), buffers.landings.as_entire_binding());
        let texture = wgpu::BindingResource::TextureView;
        let vertices = cells + 1;
        let begun = |pipeline| Step {
            pipeline,
            group_index: 3,
            layout: &layouts.grid,
            resources: vec![buffers.grid.as_entire_binding()],
            extent: vertices,
            work: work.grid,
        };
        match &self.pipelines.tracing {
            MethodPipelines::Straight => Vec::new(),
            MethodPipelines::Forward { grid: first, trace, deposit, deposit_large } => {
                let traced = Step {
                    pipeline: trace,
                    group_index: 3,
                    layout: &layouts.forward,
                    resources: vec![grid.clone(), landings.clone()],
                    extent: vertices,
                    work: work.trace,
                };
                let (sums, large) = (&buffers.sums, &buffers.large);
                let (sums, large) = (sums.as_entire_binding(), large.as_entire_binding());
                let resources = vec![grid, landings, texture(&views.planes), sums, large];
                let deposited = |pipeline, extent| Step {
                    pipeline,
                    group_index: 1,
                    layout: &layouts.deposit,
                    resources: resources.clone(),
                    extent,
                    work: work.deposit,
                };
                // Of a workgroup for each large cell, whose number of threads differs.
                let groups = UVec2::new(large_groups(gpu).0 * gpu::TILE, gpu::TILE);
                let large = deposited(deposit_large, groups);
                vec![begun(first), traced, deposited(deposit, cells), large]
            }
            MethodPipelines::Gather { grid: first, walk } => {
                let walked = Step {
                    pipeline: walk,
                    group_index: 3,
                    layout: &layouts.gather,
                    resources: vec![grid, texture(&views.gathered)],
                    extent: buffers.size,
                    work: work.gather,
                };
                vec![begun(first), walked]
            }
        }
    }

    /// Kernels that make the map of the sums, and blur it.
    fn resolved<'a>(&'a self, views: &'a Views, work: Work) -> Vec<Step<'a>> {
        let Self { layouts, pipelines, buffers, .. } = self;
        let texture = wgpu::BindingResource::TextureView;
        let Views { planes, gathered, map, receivers, blur } = views;
        // Layers of the maps are written one at a time but never read that way: OpenGL lacks such views.
        let unblurred = blur.as_ref().map_or(map, |[unblurred, _]| unblurred);
        let sums = buffers.sums.as_entire_binding();
        let mut steps = vec![Step {
            pipeline: &pipelines.resolve,
            group_index: 3,
            layout: &layouts.resolve,
            resources: vec![sums, texture(gathered), texture(unblurred), texture(receivers)],
            extent: buffers.size,
            work: work.resolve,
        }];
        if let Some([unblurred, across]) = blur {
            let ways = [(unblurred, across), (across, map)];
            steps.extend(pipelines.blur.iter().zip(ways).map(|(pipeline, (from, to))| Step {
                pipeline,
                group_index: 1,
                layout: &layouts.blur,
                resources: vec![texture(from), texture(planes), texture(to)],
                extent: buffers.size,
                work: work.blur,
            }));
        }
        steps
    }
}

/// Views of the textures that the kernels read and write.
struct Views {
    planes: wgpu::TextureView,
    gathered: wgpu::TextureView,
    map: wgpu::TextureView,
    receivers: wgpu::TextureView,
    /// The map before the blur, and after the blur along one axis; if it is blurred.
    blur: Option<[wgpu::TextureView; 2]>,
}

impl Views {
    fn of(buffers: &Buffers, inputs: &Inputs<'_>, output: Output<'_>) -> Self {
        let view = |texture: &wgpu::Texture| gpu::layer_view(texture, 0);
        let blur = buffers.blur.as_ref().filter(|_| inputs.params.blur > 0.0);
        Self {
            planes: view(&inputs.gbuffer.planes),
            gathered: view(&buffers.gathered),
            map: gpu::layer_view(output.map, output.layer),
            receivers: gpu::layer_view(output.receivers, output.layer),
            blur: blur.map(|between| between.each_ref().map(view)),
        }
    }
}

/// A kernel over `extent` threads, each with `work` layer evaluations.
struct Step<'a> {
    pipeline: &'a wgpu::ComputePipeline,
    /// Index of the bind group that holds the parameters and `resources`.
    group_index: u32,
    layout: &'a wgpu::BindGroupLayout,
    resources: Vec<wgpu::BindingResource<'a>>,
    extent: UVec2,
    work: u64,
}

impl<'a> Step<'a> {
    /// Splits the dispatch into pieces of at most `most` work, each with its work.
    fn pieces(&self, most: u64) -> impl Iterator<Item = ((&Self, Piece), u64)> {
        let pieces = gpu::pieces(self.extent, self.work, most);
        pieces.into_iter().map(move |piece| {
            let threads = u64::from(piece.size.x) * u64::from(piece.size.y);
            ((self, piece), threads.saturating_mul(self.work))
        })
    }
}

/// Work of one thread of each kernel, in layer evaluations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Work {
    /// Per vertex: four planes, and a test for solids in front of it.
    pub grid: u64,
    /// Per path: the walks to its exit from the liquid and to its receiver.
    pub trace: u64,
    /// Per cell: its parts, and additional rays where its light is torn apart.
    pub deposit: u64,
    /// Per texel: its triangles.
    pub gather: u64,
    /// Per texel.
    pub resolve: u64,
    /// Per texel: its neighbours within three standard deviations.
    pub blur: u64,
}

impl Work {
    /// The work for a map of `size` texels, blurred by `blur` texels, in a scene with `solids` solids.
    pub fn new(settings: &settings::Caustics, size: UVec2, blur: f32, solids: usize) -> Self {
        let solids = solids as u64;
        let reach = (3.0 * blur).min(size.max_element() as f32) as u64;
        Self {
            grid: 8 + solids,
            trace: u64::from(settings.interfaces) * 64 + solids,
            deposit: u64::from(settings.subdivide).pow(2) * 32 + 32 * solids,
            gather: 64 + 2 * u64::from(settings.steps) + solids,
            resolve: 8,
            blur: 1 + 2 * reach,
        }
    }
}

impl Buffers {
    /// Size of the map, cells of the grid, and whether the map is blurred.
    fn shape(&self) -> (UVec2, UVec2, bool) {
        (self.size, self.cells, self.blur.is_some())
    }

    fn new(gpu: &Gpu, size: UVec2, cells: UVec2, blur: bool) -> Self {
        let vertices = u64::from((cells + 1).element_product());
        let buffer = |label: &str, size: u64| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage: wgpu::BufferUsages::STORAGE
                    | wgpu::BufferUsages::COPY_DST
                    | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            })
        };
        let usage = wgpu::TextureUsages::STORAGE_BINDING
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC;
        let image = |label| gpu.texture(label, size, 1, Layers::FORMAT, usage);
        Self {
            size,
            cells,
            grid: buffer("caustic grid", vertices * VERTEX),
            landings: buffer("landings", vertices * LANDING),
            sums: buffer("light sums", u64::from(size.element_product()) * LIGHT_SUMS),
            large: buffer("large cells", 4 + 8 * u64::from(cells.element_product())),
            gathered: image("gathered"),
            blur: blur.then(|| ["unblurred", "blurred across"].map(image)),
        }
    }
}
