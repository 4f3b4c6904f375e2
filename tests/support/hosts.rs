//! Support for tests with a host: what a program would have drawn of a scene's solids and environment, drawn
//! by limpid itself.

use glam::{DMat4, DVec4, UVec2};
use limpid::aov::{self, Aov, Part};
use limpid::camera::View;
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::host::Host;
use limpid::liquid::classify::Splats;
use limpid::offscreen::Picture;
use limpid::renderer::Renderer;
use limpid::scene::Scene;
use limpid::wgpu;

/// Colour and depth of a scene without its liquid, with depths as `clip_from_view` has them.
pub(crate) fn host_of(
    gpu: &Gpu,
    renderer: &mut Renderer,
    scene: &Scene,
    view: impl Into<View>,
    size: UVec2,
    clip_from_view: DMat4,
) -> Host {
    let picture = Picture::new(gpu, size).unwrap();
    let nothing = Splats { radius: 1.0, ..Splats::default() };
    let input = FrameInput::new(scene, view, &nothing, size);
    renderer.render(FrameInput { diagnose: true, ..input }, &picture).unwrap();
    let chosen = [Aov::Radiance, Aov::SolidDepth];
    let part = aov::read(gpu, &renderer.images(), &chosen).unwrap().remove(0);
    let colors = ["R", "G", "B"].map(|c| channel(&part, &format!("radiance.{c}")));
    let colors = colors[0].iter().zip(colors[1]).zip(colors[2]);
    let colors: Vec<f32> = colors.flat_map(|((r, g), b)| [*r, *g, *b, 1.0]).collect();
    let reversed = depth_of(clip_from_view, 1.0) > depth_of(clip_from_view, 1.1);
    let cleared = if reversed { 0.0 } else { 1.0 };
    let depth = |z: &f32| match *z {
        0.0 => cleared,
        z => depth_of(clip_from_view, z.into()) as f32,
    };
    let depths: Vec<f32> = channel(&part, "solid_depth").iter().map(depth).collect();
    Host {
        color: texture(gpu, size, wgpu::TextureFormat::Rgba32Float, &colors),
        depth: texture(gpu, size, wgpu::TextureFormat::R32Float, &depths),
        normals: None,
        clip_from_view,
    }
}

/// Depth in clip space of a point on the axis at a depth in m.
fn depth_of(clip_from_view: DMat4, z: f64) -> f64 {
    let clip = clip_from_view * DVec4::new(0.0, 0.0, -z, 1.0);
    clip.z / clip.w
}

fn channel<'a>(part: &'a Part, name: &str) -> &'a [f32] {
    let found = part.channels.iter().find(|channel| channel.name == name);
    &found.unwrap_or_else(|| panic!("no channel {name}")).values
}

/// A texture with these values.
pub(crate) fn texture(
    gpu: &Gpu,
    size: UVec2,
    format: wgpu::TextureFormat,
    values: &[f32],
) -> wgpu::TextureView {
    let extent = wgpu::Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("host"),
        size: extent,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let bytes: &[u8] = bytemuck::cast_slice(values);
    let row = bytes.len() as u32 / size.y;
    let layout =
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
    gpu.queue.write_texture(texture.as_image_copy(), bytes, layout, extent);
    texture.create_view(&Default::default())
}
