//! The passes of a frame, in order, and the data that flows between them.
//!
//! The outputs of a view's passes, [`view_passes::ViewImages`], are kept from frame to frame. A pass is what `prepare`
//! returns for one frame: it uploads parameters, binds images, and compiles missing pipelines, which the device keeps.
//! `record` encodes the commands under a timestamp span. A pass is one file here and one of the same name in `shaders/`.

use glam::UVec2;

use crate::camera::CameraUniform;
use crate::gpu::{self, Gpu};

pub mod bins;
pub mod bounds;
pub mod caustics;
pub mod color;
pub mod diffuse;
pub mod gaps;
pub mod gbuffer;
pub mod host;
pub mod mesh_buffers;
pub mod mips;
pub mod mixture;
pub mod opaque;
pub mod refract;
pub mod scene_binding;
pub mod shade;
pub mod smooth;
pub mod sphere_shadows;
pub mod spheres;
pub mod splat;
pub mod splat_buffers;
pub mod surface;
pub mod tiles;
pub mod tonemap;
pub mod turbid;
pub mod view_passes;

/// A front and a back layer of tangent planes, and two more for each gap between liquid and liquid: layers of
/// one texture.
///
/// A texel stores the plane π·X = 1 in view space, in 1/m, and its depth in m. 32-bit floats:
/// at grazing angles, 16-bit planes lack the precision that Newton's method needs.
#[derive(Debug, Clone)]
pub struct Layers {
    /// [`Layers::FORMAT`], layers [`Layers::FRONT`], [`Layers::BACK`] and those of [`Layers::gap`].
    pub texture: wgpu::Texture,
    /// All layers at mip level 0.
    pub view: wgpu::TextureView,
    /// All layers at all mip levels.
    pub mips: wgpu::TextureView,
}

impl Layers {
    /// π in red, green and blue, depth in alpha; all 0 where empty.
    pub const FORMAT: wgpu::TextureFormat = gpu::LAYER_FORMAT;
    /// The layer of nearest fronts.
    pub const FRONT: u32 = 0;
    /// The layer of farthest backs.
    pub const BACK: u32 = 1;

    /// The layers of a gap, counted from the eye: the back in front of it, and the front behind it. Both or
    /// neither are empty, and both are undefined in tiles without gaps.
    pub const fn gap(gap: u32) -> [u32; 2] {
        [2 + 2 * gap, 3 + 2 * gap]
    }

    fn new(
        gpu: &Gpu,
        label: &str,
        size: UVec2,
        layers: u32,
        levels: u32,
        usage: wgpu::TextureUsages,
    ) -> Self {
        let texture = gpu.mipped_texture(label, size, layers, levels, Self::FORMAT, usage);
        Self::of(texture)
    }

    /// The layers in a texture.
    pub fn of(texture: wgpu::Texture) -> Self {
        let view = gpu::level_view(&texture, 0, wgpu::TextureViewDimension::D2Array);
        let mips = gpu::array_view(&texture);
        Self { texture, view, mips }
    }
}

/// The opaque scene as the camera sees it.
#[derive(Debug, Clone)]
pub struct GBufferImages {
    /// Planes as in [`Layers`], in one layer.
    pub planes: wgpu::Texture,
    /// Unit normal in world space and the solid's number, as 32-bit floats.
    pub surfaces: wgpu::Texture,
}

/// A linear picture: RGB radiance and coverage. 32-bit floats keep the emission of an unlit solid
/// exact to the last bit of an 8-bit picture.
#[derive(Debug, Clone)]
pub struct Radiance {
    /// The picture.
    pub texture: wgpu::Texture,
}

/// The camera's bind group, group 0 of all passes.
#[derive(Debug)]
pub struct CameraBinding {
    buffer: wgpu::Buffer,
    pub layout: wgpu::BindGroupLayout,
    pub group: wgpu::BindGroup,
    orthographic: bool,
}

impl CameraBinding {
    pub fn new(gpu: &Gpu, orthographic: bool) -> Self {
        let buffer = gpu.uniform_buffer::<CameraUniform>("camera");
        let bindings = [gpu::uniform::<CameraUniform>()];
        let layout = gpu.layout("camera", wgpu::ShaderStages::COMPUTE, &bindings);
        let group = gpu.bind_group("camera", &layout, &[buffer.as_entire_binding()]);
        Self { buffer, layout, group, orthographic }
    }

    pub fn write(&self, gpu: &Gpu, camera: &CameraUniform) {
        gpu.queue.write_buffer(&self.buffer, 0, bytemuck::bytes_of(camera));
    }

    /// Whether the view's rays are parallel.
    pub fn is_orthographic(&self) -> bool {
        self.orthographic
    }

    /// Specialisation constants of every pipeline that uses this camera.
    pub fn constants(&self) -> [(&'static str, f64); 1] {
        [("ORTHOGRAPHIC", f64::from(u8::from(self.orthographic)))]
    }
}
