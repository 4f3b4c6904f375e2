//! The opaque scene: `shaders/gbuffer.wgsl`, and what all passes see of it,
//! `shaders/common/scene.wgsl`.

use std::collections::HashMap;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{UVec2, Vec3};
use wgpu::TextureViewDimension::D2;

use super::{CameraBinding, GBuffer, Layers};
use crate::environment::Environment;
use crate::gpu::{self, Gpu, Span};
use crate::scene::{Light, Scene, Shape, Solid, Surface};

/// `Scene` of `common/scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct SceneUniform {
    /// Radiance straight up.
    pub zenith: [f32; 3],
    /// Alignment.
    pub pad_zenith: u32,
    /// Radiance of the horizon.
    pub horizon: [f32; 3],
    /// Alignment.
    pub pad_horizon: u32,
    /// Radiance straight down.
    pub nadir: [f32; 3],
    /// Alignment.
    pub pad_nadir: u32,
    /// Mean radiance.
    pub ambient: [f32; 3],
    /// Alignment.
    pub pad_ambient: u32,
}

/// `Solid` of `common/scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct SolidData {
    /// A point of the plane; the centre of a box or sphere, m.
    pub origin: [f32; 3],
    /// 0 plane, 1 box, 2 sphere.
    pub shape: u32,
    /// A plane's normal, a box's half sides, a sphere's radius in x.
    pub extent: [f32; 3],
    /// Half the side of a plane's square, m.
    pub half_extent: f32,
    /// Colour, or that of even tiles.
    pub even: [f32; 3],
    /// Side of a tile, m; 0 for one colour.
    pub tile: f32,
    /// Colour of odd tiles.
    pub odd: [f32; 3],
    /// 1 if the colour is an albedo.
    pub lit: u32,
}

/// `Light` of `common/scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct LightData {
    /// A sun's direction towards it, or a point light's position.
    pub place: [f32; 3],
    /// 0 sun, 1 point.
    pub kind: u32,
    /// Irradiance or radiant intensity.
    pub power: [f32; 3],
    /// Alignment.
    pub pad: u32,
}

/// Solids that a scene can have: 32 KiB of uniform memory.
pub const MAX_SOLIDS: usize = 512;

/// Lights that a scene can have.
pub const MAX_LIGHTS: usize = 16;

/// What pipelines that see the scene are specialised for: the constants of `common/scene.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub(crate) struct SceneVariant {
    /// Number of solids.
    pub solids: u32,
    /// Number of lights.
    pub lights: u32,
    /// 0 constant, 1 gradient, 2 map.
    pub environment: u32,
}

impl SceneVariant {
    /// The variant for a scene.
    pub(crate) fn new(scene: &Scene) -> Self {
        let environment = match scene.environment {
            Environment::Constant(_) => 0,
            Environment::Gradient { .. } => 1,
            Environment::Map { .. } => 2,
        };
        let [solids, lights] = [scene.solids.len() as u32, scene.lights.len() as u32];
        Self { solids, lights, environment }
    }

    pub(crate) fn constants(self) -> [(&'static str, f64); 3] {
        [("SOLIDS", self.solids), ("LIGHTS", self.lights), ("ENVIRONMENT", self.environment)]
            .map(|(name, value)| (name, value.into()))
    }
}

/// The scene as passes bind it: group 2.
#[derive(Debug)]
pub(crate) struct SceneBinding {
    pub(crate) layout: wgpu::BindGroupLayout,
    pub(crate) group: wgpu::BindGroup,
    /// What pipelines are specialised for.
    pub(crate) variant: SceneVariant,
    uploaded: Option<(Vec<Solid>, Vec<Light>, Environment)>,
}

impl SceneBinding {
    /// Binds an empty scene; [`SceneBinding::upload`] replaces it.
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let bindings = [
            gpu::uniform::<SceneUniform>(),
            gpu::uniform::<[SolidData; MAX_SOLIDS]>(),
            gpu::uniform::<[LightData; MAX_LIGHTS]>(),
            gpu::sampled(D2),
        ];
        let layout = gpu.layout("scene", wgpu::ShaderStages::COMPUTE, &bindings);
        let group = bind(gpu, &layout, &[], &[], &Environment::default());
        Self { layout, group, variant: SceneVariant::default(), uploaded: None }
    }

    /// Uploads a scene's solids, lights and environment.
    pub(crate) fn upload(&mut self, gpu: &Gpu, scene: &Scene) {
        if self.uploaded.as_ref().is_some_and(|(solids, lights, environment)| {
            *solids == scene.solids
                && *lights == scene.lights
                && same(environment, &scene.environment)
        }) {
            return;
        }
        let solids: Vec<_> = scene.solids.iter().map(solid_data).collect();
        let lights: Vec<_> = scene.lights.iter().map(light_data).collect();
        self.group = bind(gpu, &self.layout, &solids, &lights, &scene.environment);
        self.variant = SceneVariant::new(scene);
        self.uploaded =
            Some((scene.solids.clone(), scene.lights.clone(), scene.environment.clone()));
    }
}

/// Whether two environments need no new upload; a map is known by its memory, not its pixels.
fn same(a: &Environment, b: &Environment) -> bool {
    match (a, b) {
        (
            Environment::Map { size: a, pixels: of_a },
            Environment::Map { size: b, pixels: of_b },
        ) => a == b && Arc::ptr_eq(of_a, of_b),
        (a, b) => a == b,
    }
}

fn bind(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    solids: &[SolidData],
    lights: &[LightData],
    environment: &Environment,
) -> wgpu::BindGroup {
    let one_pixel = [[0f32; 4]];
    let ([zenith, horizon, nadir], (size, pixels)) = match environment {
        Environment::Constant(c) => ([*c; 3], (UVec2::ONE, &one_pixel[..])),
        Environment::Gradient { zenith, horizon, nadir } => {
            ([*zenith, *horizon, *nadir], (UVec2::ONE, &one_pixel[..]))
        }
        Environment::Map { size, pixels } => ([Vec3::ZERO; 3], (*size, &pixels[..])),
    };
    let uniform = SceneUniform {
        zenith: zenith.to_array(),
        horizon: horizon.to_array(),
        nadir: nadir.to_array(),
        ambient: environment.mean().to_array(),
        ..Zeroable::zeroed()
    };
    let uniform = gpu::buffer_with(gpu, "scene", wgpu::BufferUsages::UNIFORM, &[uniform]);
    let mut all_solids = [SolidData::zeroed(); MAX_SOLIDS];
    all_solids[..solids.len()].copy_from_slice(solids);
    let mut all_lights = [LightData::zeroed(); MAX_LIGHTS];
    all_lights[..lights.len()].copy_from_slice(lights);
    let usage = wgpu::BufferUsages::UNIFORM;
    let solids = gpu::buffer_with(gpu, "solids", usage, &all_solids);
    let lights = gpu::buffer_with(gpu, "lights", usage, &all_lights);
    let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
    let format = wgpu::TextureFormat::Rgba32Float;
    let map = gpu::texture(gpu, "environment", size, 1, format, usage);
    gpu.queue.write_texture(
        map.as_image_copy(),
        bytemuck::cast_slice(pixels),
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(16 * size.x),
            rows_per_image: None,
        },
        map.size(),
    );
    let resources = [
        uniform.as_entire_binding(),
        solids.as_entire_binding(),
        lights.as_entire_binding(),
        wgpu::BindingResource::TextureView(&map.create_view(&Default::default())),
    ];
    gpu::bind_group(gpu, "scene", layout, &resources)
}

fn solid_data(solid: &Solid) -> SolidData {
    let (shape, origin, extent, half_extent) = match solid.shape {
        Shape::Plane { origin, normal, half_extent } => (0, origin, normal, half_extent.min(1e30)),
        Shape::Box { min, max } => (1, 0.5 * (min + max), 0.5 * (max - min), 0.0),
        Shape::Sphere { center, radius } => (2, center, Vec3::splat(radius), 0.0),
    };
    let (even, tile, odd) = match solid.surface {
        Surface::Color(color) => (color, 0.0, color),
        Surface::Checker { tile, even, odd } => (even, tile, odd),
    };
    SolidData {
        origin: origin.to_array(),
        shape,
        extent: extent.to_array(),
        half_extent,
        even: even.to_array(),
        tile,
        odd: odd.to_array(),
        lit: u32::from(solid.lit),
    }
}

fn light_data(light: &Light) -> LightData {
    let (kind, place, power) = match *light {
        Light::Sun { direction, irradiance } => (0, -direction.normalize_or_zero(), irradiance),
        Light::Point { position, intensity } => (1, position, intensity),
    };
    LightData { place: place.to_array(), kind, power: power.to_array(), pad: 0 }
}

/// Draws the G-buffer.
#[derive(Debug)]
pub(crate) struct Gbuffer {
    /// Output.
    pub images: GBuffer,
    pipelines: HashMap<SceneVariant, wgpu::ComputePipeline>,
    layout: wgpu::BindGroupLayout,
}

impl Gbuffer {
    /// Makes the layout; a pipeline is compiled when a scene first needs it.
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let bindings =
            [gpu::storage_texture(Layers::FORMAT, D2), gpu::storage_texture(Layers::FORMAT, D2)];
        let layout = gpu.layout("gbuffer", wgpu::ShaderStages::COMPUTE, &bindings);
        Self { images: sized(gpu, UVec2::ONE), pipelines: HashMap::new(), layout }
    }

    /// Compiles the pipeline for the bound scene if it is new.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, camera: &CameraBinding, scene: &SceneBinding) {
        let layouts = [&camera.layout, &self.layout, &scene.layout];
        self.pipelines.entry(scene.variant).or_insert_with(|| {
            let constants = scene.variant.constants();
            gpu::compute_pipeline(gpu, "gbuffer.wgsl", "gbuffer", &layouts, &constants)
        });
    }

    /// Replaces the images.
    pub(crate) fn resize(&mut self, gpu: &Gpu, size: UVec2) {
        self.images = sized(gpu, size);
    }

    /// Draws the solids as the camera sees them.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        scene: &SceneBinding,
        span: Span<'_>,
    ) {
        let views = [&self.images.planes, &self.images.radiance]
            .map(|texture| texture.create_view(&Default::default()));
        let resources = views.each_ref().map(wgpu::BindingResource::TextureView);
        let group = gpu::bind_group(gpu, "gbuffer", &self.layout, &resources);
        let planes = &self.images.planes;
        let (x, y) = gpu::workgroups(UVec2::new(planes.width(), planes.height()));
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("gbuffer"),
            timestamp_writes: span.compute(),
        });
        pass.set_pipeline(&self.pipelines[&scene.variant]);
        pass.set_bind_group(0, &camera.group, &[]);
        pass.set_bind_group(1, &group, &[]);
        pass.set_bind_group(2, &scene.group, &[]);
        pass.dispatch_workgroups(x, y, 1);
    }
}

fn sized(gpu: &Gpu, size: UVec2) -> GBuffer {
    let usage = wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::COPY_SRC;
    let new = |label: &str| gpu::texture(gpu, label, size, 1, Layers::FORMAT, usage);
    GBuffer { planes: new("gbuffer planes"), radiance: new("gbuffer radiance") }
}
