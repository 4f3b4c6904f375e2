//! The scene's bind group, for all passes that see it: `shaders/common/scene.wgsl`, `shaders/common/lights.wgsl`.

use std::mem;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, UVec2, Vec3};
use wgpu::TextureViewDimension::{D2, D2Array};

use super::mesh_buffers::{MeshBuffers, MeshPlace};
use super::sphere_shadows::{LightGridData, Shadows};
use crate::environment::{Environment, Glow};
use crate::gpu::{self, Gpu};
use crate::light_view::CUBE;
use crate::light_view::PlacedView;
use crate::scene::{Light, MAX_LIGHTS, MAX_SOLIDS, Scene, Shape, Solid, Surface};

/// `Scene` of `common/scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct SceneUniform {
    /// Radiance straight up.
    pub zenith: [f32; 3],
    /// Padding.
    pub pad_zenith: u32,
    /// Radiance of the horizon.
    pub horizon: [f32; 3],
    /// Padding.
    pub pad_horizon: u32,
    /// Radiance straight down.
    pub nadir: [f32; 3],
    /// Padding.
    pub pad_nadir: u32,
    /// Mean radiance.
    pub ambient: [f32; 3],
    /// Padding.
    pub pad_ambient: u32,
    /// Directions of the glows, and their sharpness.
    pub glow_lobes: [[f32; 4]; 2],
    /// Radiance at the centres of the glows, with padding.
    pub glow_radiances: [[f32; 4]; 2],
}

/// `Solid` of `common/scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct SolidData {
    /// A point of the plane, or the centre of a box, sphere or mesh, relative to the eye, m.
    pub origin: [f32; 3],
    /// 0 plane, 1 box, 2 sphere, 3 mesh.
    pub shape: u32,
    /// A plane's normal, a box's half sides, a sphere's radius in x; a mesh's scale, its inverse, and the
    /// largest distance from the centre, unscaled.
    pub extent: [f32; 3],
    /// Half the side of a plane's square, m.
    pub half_extent: f32,
    /// Colour, or the colour of even tiles.
    pub even: [f32; 3],
    /// Side of a tile, m; 0 for one colour.
    pub tile: f32,
    /// Colour of odd tiles.
    pub odd: [f32; 3],
    /// 1 if the colour is an albedo.
    pub lit: u32,
    /// Position of the eye in the checker, in tiles modulo 2.
    pub phase: [f32; 3],
    /// Square of the inverse distance over which it fades, 1/m²; 0 if it does not.
    pub inv_fade2: f32,
    /// The point that it fades around, relative to the eye, m.
    pub middle: [f32; 3],
    /// Word of its texture, or 1 for a mesh's own colours, or 0.
    pub texture: u32,
    /// A mesh's rotation, a quaternion.
    pub rotation: [f32; 4],
    /// Row where a mesh begins, row of its first triangle, word of its first attributes.
    pub mesh: [u32; 3],
    /// Index in the scene.
    pub number: u32,
}

/// `Light` of `common/lights.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct LightData {
    /// Direction towards a sun, or a point light's position relative to the eye, m.
    pub place: [f32; 3],
    /// 0 sun, 1 point.
    pub kind: u32,
    /// Irradiance or radiant intensity.
    pub power: [f32; 3],
    /// Number of views along the unrefracted light besides the map's: 0, 1, or 6 for the faces of a cube.
    pub straight: u32,
    /// 1 if it has a caustic map.
    pub map: u32,
    /// Shape of its columns through foam, spray and bubbles; 0 without.
    pub spheres: u32,
    /// Padding.
    pub pad: [u32; 2],
}

/// `LightView` of `common/lights.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct LightViewData {
    /// Axis to the right.
    pub right: [f32; 3],
    /// Half the width: m for a sun, a tangent for a point light.
    pub half_width: f32,
    /// Axis upwards.
    pub up: [f32; 3],
    /// Half the height.
    pub half_height: f32,
    /// Axis towards the light.
    pub back: [f32; 3],
    /// Depth of a sun's far plane, m.
    pub far: f32,
    /// Origin relative to the eye, m.
    pub origin: [f32; 3],
    /// Width in texels.
    pub width: f32,
    /// Offset of its texels in the maps.
    pub corner: [u32; 2],
    /// Height in texels.
    pub height: f32,
    /// Its layer of the maps.
    pub layer: u32,
}

/// Most views of a light: its map's, then the faces of a cube around it.
pub const LIGHT_VIEWS: usize = 1 + CUBE;

/// `LightViews` of `common/lights.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct LightViewsData {
    /// The views of each light.
    pub views: [LightViewData; MAX_LIGHTS * LIGHT_VIEWS],
    /// Columns of each light through foam, spray and bubbles.
    pub grids: [LightGridData; MAX_LIGHTS],
}

/// Specialisation of pipelines that use the scene: the constants of `common/scene.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct SceneVariant {
    /// Number of solids.
    pub solids: u32,
    /// Number of meshes among them.
    pub meshes: u32,
    /// Whether any is a plane.
    pub has_planes: bool,
    /// Whether any is a box.
    pub has_boxes: bool,
    /// Whether any is a sphere.
    pub has_spheres: bool,
    /// Whether any but a mesh has a texture.
    pub textures: bool,
    /// Whether any is lit.
    pub lit: bool,
    /// Number of lights.
    pub lights: u32,
    /// Whether any light has views besides its map's.
    pub straight_views: bool,
    /// 0 constant, 1 gradient, 2 map, 3 sky.
    pub environment: u32,
    /// Whether any solid fades into the environment.
    pub fades: bool,
    /// Whether patterns are filtered over a ray's footprint.
    pub filter_patterns: bool,
    /// Whether there are foam, spray or bubbles.
    pub spheres: bool,
}

impl SceneVariant {
    /// The variant for a scene.
    pub fn new(scene: &Scene) -> Self {
        let environment = match scene.environment {
            Environment::Constant(_) => 0,
            Environment::Gradient { .. } => 1,
            Environment::Map { .. } => 2,
            Environment::Sky { .. } => 3,
        };
        let is_mesh = |solid: &&Solid| matches!(solid.shape, Shape::Mesh { .. });
        let is_textured = |solid: &Solid| matches!(solid.surface, Surface::Texture { .. });
        let patterned = |solid: &Solid| !matches!(solid.surface, Surface::Color(_));
        let fades =
            scene.solids.iter().any(|solid| matches!(solid.surface, Surface::Ground { .. }));
        let filter_patterns =
            scene.settings.refract.filter_patterns && scene.solids.iter().any(patterned);
        let solids = scene.solids.len() as u32;
        let lights = if scene.is_lit() { scene.lights.len() as u32 } else { 0 };
        let any = |code| scene.solids.iter().any(|solid| shape_code(&solid.shape) == code);
        let lit = scene.solids.iter().any(|solid| solid.lit);
        Self {
            solids,
            meshes: scene.solids.iter().filter(is_mesh).count() as u32,
            has_planes: any(PLANE),
            has_boxes: any(BOX),
            has_spheres: any(SPHERE),
            textures: scene.solids.iter().any(is_textured),
            lit,
            lights,
            straight_views: false,
            environment,
            fades,
            filter_patterns,
            spheres: false,
        }
    }

    /// The variant for a frame with foam, spray and bubbles, which are lit whether or not solids are.
    #[must_use]
    pub fn with_spheres(self, scene: &Scene) -> Self {
        Self { spheres: true, lights: scene.lights.len() as u32, ..self }
    }

    pub fn constants(self) -> [(&'static str, f64); 13] {
        [
            ("SOLIDS", self.solids),
            ("MESHES", self.meshes),
            ("HAS_PLANES", self.has_planes.into()),
            ("HAS_BOXES", self.has_boxes.into()),
            ("HAS_SPHERES", self.has_spheres.into()),
            ("TEXTURES", self.textures.into()),
            ("ANY_LIT", self.lit.into()),
            ("LIGHTS", self.lights),
            ("STRAIGHT_VIEWS", self.straight_views.into()),
            ("ENVIRONMENT", self.environment),
            ("FADES", self.fades.into()),
            ("FILTER_PATTERNS", self.filter_patterns.into()),
            ("SPHERES", self.spheres.into()),
        ]
        .map(|(name, value)| (name, value.into()))
    }
}

/// The scene's bind group, group 2 of all passes.
#[derive(Debug)]
pub struct SceneBinding {
    pub layout: wgpu::BindGroupLayout,
    pub group: wgpu::BindGroup,
    /// Specialisation of the pipelines.
    pub variant: SceneVariant,
    solids: wgpu::Buffer,
    lights: wgpu::Buffer,
    light_views: wgpu::Buffer,
    environment: Environment,
    maps: Option<LightMaps>,
    meshes: Option<(wgpu::TextureView, wgpu::Buffer)>,
    sphere_depths: wgpu::Buffer,
}

/// The maps of a scene's lights: `common/lights.wgsl`.
#[derive(Debug, Clone, PartialEq)]
pub struct LightMaps {
    /// Irradiance and share of direct light.
    pub maps: wgpu::Texture,
    /// Planes of the receivers.
    pub receivers: wgpu::Texture,
}

impl SceneBinding {
    /// Binds an empty scene; [`SceneBinding::upload`] replaces it.
    pub fn new(gpu: &Gpu) -> Self {
        let bindings = [
            gpu::uniform::<SceneUniform>(),
            gpu::uniform::<[SolidData; MAX_SOLIDS]>(),
            gpu.branching::<[LightData; MAX_LIGHTS]>(),
            gpu::sampled(D2),
            gpu::sampled(D2Array),
            gpu::sampled(D2Array),
            gpu::uniform::<LightViewsData>(),
            gpu::sampled_integers(),
            gpu::storage::<u32>(),
            gpu::storage::<u32>(),
        ];
        let layout = gpu.layout("scene", wgpu::ShaderStages::COMPUTE, &bindings);
        let solids = gpu.uniform_buffer::<[SolidData; MAX_SOLIDS]>("solids");
        let lights = gpu.uniform_buffer::<[LightData; MAX_LIGHTS]>("lights");
        let light_views = gpu.uniform_buffer::<LightViewsData>("light views");
        let environment = Environment::default();
        let buffers = [&solids, &lights, &light_views];
        let none = MeshBuffers::new(gpu);
        let sphere_depths = gpu.buffer_with("no spheres", wgpu::BufferUsages::STORAGE, &[0u32]);
        let group = bind(gpu, &layout, buffers, &environment, (None, &none, &sphere_depths));
        let variant = SceneVariant::default();
        let (maps, meshes) = (None, None);
        Self {
            layout,
            group,
            variant,
            solids,
            lights,
            light_views,
            environment,
            maps,
            meshes,
            sphere_depths,
        }
    }

    /// Uploads a scene's solids and lights relative to `eye`, the lights' views, and the environment if it
    /// has changed; meshes and the shadows of spheres are on the device.
    pub fn upload(
        &mut self,
        gpu: &Gpu,
        (scene, meshes, shadows): (&Scene, &MeshBuffers, Option<&Shadows>),
        eye: DVec3,
        views: &[PlacedView],
        maps: Option<&LightMaps>,
    ) {
        let solids = (0..).zip(&scene.solids).zip(&meshes.places);
        let mut solids: Vec<_> = solids
            .map(|((number, solid), &place)| SolidData::new(solid, number, place, eye))
            .collect();
        solids.sort_by_key(|solid| solid.shape == MESH);
        let mut lights: Vec<_> = scene.lights.iter().map(|light| light_data(light, eye)).collect();
        let grids = shadows.map_or(&[][..], Shadows::grids);
        for (light, grid) in lights.iter_mut().zip(grids) {
            light.spheres = grid.shape();
        }
        let grids: Vec<_> = grids.iter().map(|grid| grid.data(eye)).collect();
        let mut light_views = vec![LightViewData::zeroed(); LIGHT_VIEWS * lights.len()];
        for placed in views {
            light_views[LIGHT_VIEWS * placed.light + placed.slot] = light_view_data(placed, eye);
            let light = &mut lights[placed.light];
            light.map |= u32::from(placed.slot == 0);
            light.straight = light.straight.max(placed.straight);
        }
        gpu.queue.write_buffer(&self.solids, 0, bytemuck::cast_slice(&solids));
        gpu.queue.write_buffer(&self.lights, 0, bytemuck::cast_slice(&lights));
        gpu.queue.write_buffer(&self.light_views, 0, bytemuck::cast_slice(&light_views));
        let grids_at = mem::offset_of!(LightViewsData, grids) as u64;
        gpu.queue.write_buffer(&self.light_views, grids_at, bytemuck::cast_slice(&grids));
        let mesh_buffers = Some((meshes.geometry.clone(), meshes.surfaces.clone()));
        let same_environment = self.environment == scene.environment;
        let sphere_depths = shadows.map_or(&self.sphere_depths, |shadows| &shadows.depths).clone();
        let same_buffers = self.meshes == mesh_buffers && self.sphere_depths == sphere_depths;
        if !same_environment || self.maps.as_ref() != maps || !same_buffers {
            let environment = &scene.environment;
            let buffers = [&self.solids, &self.lights, &self.light_views];
            let bound = (maps, meshes, &sphere_depths);
            self.group = bind(gpu, &self.layout, buffers, environment, bound);
            self.environment = environment.clone();
            self.maps = maps.cloned();
            self.meshes = mesh_buffers;
            self.sphere_depths = sphere_depths;
        }
        let straight_views = views.iter().any(|placed| placed.straight > 0);
        let variant = SceneVariant { straight_views, ..SceneVariant::new(scene) };
        self.variant = if shadows.is_some() { variant.with_spheres(scene) } else { variant };
    }
}

fn bind(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    [solids, lights, light_views]: [&wgpu::Buffer; 3],
    environment: &Environment,
    (light_maps, meshes, sphere_depths): (Option<&LightMaps>, &MeshBuffers, &wgpu::Buffer),
) -> wgpu::BindGroup {
    let one_pixel = [[0f32; 4]];
    let [zenith, horizon, nadir] = match *environment {
        Environment::Constant(c) => [c; 3],
        Environment::Gradient { zenith, horizon, nadir }
        | Environment::Sky { zenith, horizon, nadir, .. } => [zenith, horizon, nadir],
        Environment::Map { .. } => [Vec3::ZERO; 3],
    };
    let glows =
        if let Environment::Sky { glows, .. } = environment { *glows } else { [Glow::NONE; 2] };
    let (size, pixels) = match environment {
        Environment::Map { size, pixels } => (*size, &pixels[..]),
        _ => (UVec2::ONE, &one_pixel[..]),
    };
    let uniform = SceneUniform {
        zenith: zenith.to_array(),
        horizon: horizon.to_array(),
        nadir: nadir.to_array(),
        ambient: environment.mean().to_array(),
        glow_lobes: glows.map(|glow| glow.direction.extend(glow.sharpness).to_array()),
        glow_radiances: glows.map(|glow| glow.radiance.extend(0.0).to_array()),
        ..Zeroable::zeroed()
    };
    let uniform = gpu.buffer_with("scene", gpu::UNIFORM, &[uniform]);
    let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
    let format = wgpu::TextureFormat::Rgba32Float;
    let map = gpu.texture("environment", size, 1, format, usage);
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
    let layers = gpu.array_layers(1);
    let placeholder = |label| gpu.texture(label, UVec2::ONE, layers, format, usage);
    let [maps, receivers] = match light_maps {
        Some(light_maps) => [&light_maps.maps, &light_maps.receivers].map(gpu::array_view),
        None => {
            ["no caustic maps", "no receivers"].map(|label| gpu::array_view(&placeholder(label)))
        }
    };
    let resources = [
        uniform.as_entire_binding(),
        solids.as_entire_binding(),
        lights.as_entire_binding(),
        wgpu::BindingResource::TextureView(&map.create_view(&Default::default())),
        wgpu::BindingResource::TextureView(&maps),
        wgpu::BindingResource::TextureView(&receivers),
        light_views.as_entire_binding(),
        wgpu::BindingResource::TextureView(&meshes.geometry),
        meshes.surfaces.as_entire_binding(),
        sphere_depths.as_entire_binding(),
    ];
    gpu.bind_group("scene", layout, &resources)
}

/// The shape's code in `common/scene.wgsl`.
fn shape_code(shape: &Shape) -> u32 {
    match shape {
        Shape::Plane { .. } => PLANE,
        Shape::Box { .. } => BOX,
        Shape::Sphere { .. } => SPHERE,
        Shape::Mesh { .. } => MESH,
    }
}

// The codes of shapes, as in the shader.
const PLANE: u32 = 0;
const BOX: u32 = 1;
const SPHERE: u32 = 2;
const MESH: u32 = 3;

/// A mesh's own colours in place of a texture.
const OWN_COLORS: u32 = 1;

impl SolidData {
    /// A solid relative to the eye, m; `number` is its index in the scene.
    pub fn new(solid: &Solid, number: u32, place: MeshPlace, eye: DVec3) -> Self {
        let (origin, extent, half_extent) = match solid.shape {
            Shape::Plane { origin, normal, half_extent } if half_extent < f32::INFINITY => {
                (origin - eye, normal, half_extent)
            }
            // An infinite plane is given by its point nearest to the eye, which is the most precise.
            Shape::Plane { origin, normal, .. } => {
                ((origin - eye).project_onto(normal.as_dvec3()), normal, 1e30)
            }
            Shape::Box { min, max } => {
                (0.5 * (min + max) - eye, (0.5 * (max - min)).as_vec3(), 0.0)
            }
            Shape::Sphere { center, radius } => (center - eye, Vec3::splat(radius), 0.0),
            Shape::Mesh { ref mesh, placement } => {
                let scale = placement.scale;
                let extent = Vec3::new(scale as f32, scale.recip() as f32, mesh.reach());
                (placement.world_from_mesh(mesh.origin()) - eye, extent, 0.0)
            }
        };
        let (even, tile, odd, fade) = match solid.surface {
            Surface::Texture { tile, .. } => (Vec3::ONE, tile, Vec3::ONE, f32::INFINITY),
            Surface::Own => (Vec3::ONE, 0.0, Vec3::ONE, f32::INFINITY),
            Surface::Color(color) => (color, 0.0, color, f32::INFINITY),
            Surface::Checker { tile, even, odd } => (even, tile, odd, f32::INFINITY),
            Surface::Ground { tile, even, odd, fade } => (even, tile, odd, fade),
        };
        let middle = match solid.shape {
            Shape::Plane { origin, .. } => origin,
            Shape::Box { min, max } => 0.5 * (min + max),
            Shape::Sphere { center, .. } => center,
            Shape::Mesh { placement, .. } => placement.translate,
        };
        let rotation = match solid.shape {
            Shape::Mesh { placement, .. } => placement.rotate.as_quat().to_array(),
            _ => [0.0; 4],
        };
        let texture = if solid.surface == Surface::Own { OWN_COLORS } else { place.texture };
        // Tiles are counted from the world's origin.
        let phase = match tile {
            0.0 => DVec3::ZERO,
            tile => (eye / f64::from(tile)).rem_euclid(DVec3::splat(2.0)),
        };
        Self {
            origin: origin.as_vec3().to_array(),
            shape: shape_code(&solid.shape),
            extent: extent.to_array(),
            half_extent,
            even: even.to_array(),
            tile,
            odd: odd.to_array(),
            lit: u32::from(solid.lit),
            phase: phase.as_vec3().to_array(),
            inv_fade2: fade.recip().powi(2),
            middle: (middle - eye).as_vec3().to_array(),
            texture,
            rotation,
            mesh: place.mesh,
            number,
        }
    }
}

fn light_data(light: &Light, eye: DVec3) -> LightData {
    let (kind, place, power) = match *light {
        Light::Sun { direction, irradiance } => (0, -direction.normalize_or_zero(), irradiance),
        Light::Point { position, intensity } => (1, (position - eye).as_vec3(), intensity),
    };
    LightData { place: place.to_array(), kind, power: power.to_array(), ..Zeroable::zeroed() }
}

fn light_view_data(placed: &PlacedView, eye: DVec3) -> LightViewData {
    let view = &placed.view;
    let [right, up, back] = view.view_from_world.transpose().to_cols_array_2d();
    let narrow = |axis: [f64; 3]| axis.map(|x| x as f32);
    LightViewData {
        right: narrow(right),
        half_width: view.half_extent.x as f32,
        up: narrow(up),
        half_height: view.half_extent.y as f32,
        back: narrow(back),
        far: if view.orthographic { view.far as f32 } else { 0.0 },
        origin: (view.origin - eye).as_vec3().to_array(),
        width: view.size.x as f32,
        corner: placed.corner.to_array(),
        height: view.size.y as f32,
        layer: placed.layer,
    }
}
