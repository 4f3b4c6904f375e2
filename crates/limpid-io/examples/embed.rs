//! Draws limpid's liquid into the frame of another wgpu program.
//!
//! ```sh
//! cargo run --release --example embed                      # the built-in demo
//! cargo run --release --example embed -- water_0020.bgeo   # a particle file
//! ```
//!
//! The program has a world of its own: a textured cube and a floor, lit and drawn with its own pipeline into
//! its own linear colour and depth. limpid draws the liquid around and in front of them:
//!
//! 1. the program opens its device and draws its world;
//! 2. [`Gpu::from_device`] wraps the device for limpid, [`Host`] has the program's colour and depth;
//! 3. [`Renderer::prepare`] uploads, [`Renderer::record`] records into the program's encoder,
//!    [`Renderer::composite`] adds the liquid to the program's colour: limpid submits and waits for nothing;
//! 4. the program goes on with its frame: here it tone-maps its colour and saves `embed.png`.
//!
//! limpid itself never uses a window system.

use limpid::camera::View;
use limpid::environment::Environment;
use limpid::frame::FrameInput;
use limpid::glam::dcamera::rh::proj::directx::perspective_infinite_reverse;
use limpid::glam::dcamera::rh::view::look_at_mat4;
use limpid::glam::{DMat4, DVec3, UVec2, Vec3};
use limpid::gpu::Gpu;
use limpid::host::Host;
use limpid::renderer::Renderer;

// limpid re-exports the wgpu it was built with, so that the types match.
use limpid::wgpu;

use limpid_io::input::Input;

const SIZE: UVec2 = UVec2::new(800, 600);
/// The program's colour: linear and unbounded.
const HDR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
const SKY: Vec3 = Vec3::new(0.55, 0.7, 0.9);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let input = match std::env::args().nth(1) {
        Some(path) => Input::open(&path)?,
        None => Input::demo()?,
    };
    let (loader, project) = input.resolve()?;
    let loaded = loader.load(&loader.sequence.frames[0], &project.scene)?;
    let (min, max) = loaded.bulk.bounds;

    // ---- 1. The program's own: a device, a camera, and a world drawn into colour and depth.

    let (device, queue) = pollster::block_on(open_device())?;
    let reach = 0.5 * (max - min).max_element();
    let target = DVec3::new(0.5 * (min.x + max.x), min.y + 0.25 * reach, 0.5 * (min.z + max.z));
    let eye = target + DVec3::new(0.35, 0.6, 1.9) * reach;
    let view_from_world = look_at_mat4(eye, target, DVec3::Y);
    let aspect = f64::from(SIZE.x) / f64::from(SIZE.y);
    let clip_from_view = perspective_infinite_reverse(40f64.to_radians(), aspect, 0.05 * reach);
    let (color, depth) = (texture(&device, HDR), texture(&device, DEPTH));
    let half = 0.2 * reach;
    let centre =
        DVec3::new(target.x - 0.3 * reach, min.y + half, target.z - 0.25 * reach).as_vec3();
    let world = World::new(&device, clip_from_view * view_from_world, centre, half as f32);
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    world.draw(&mut encoder, &color, &depth);

    // ---- 2. limpid on the program's device. wgpu handles are reference-counted and cheap to clone.

    let gpu = Gpu::from_device(device.clone(), queue.clone());
    // Once per program, since it compiles the passes.
    let mut renderer = Renderer::new(&gpu);
    let host = Host { color: color.clone(), depth: depth.clone(), normals: None, clip_from_view };
    // Rays that leave the picture see the program's sky, and solids that limpid is told of. A coarse
    // world is enough; here there is none.
    let mut scene = project.scene;
    scene.environment = Environment::Constant(SKY);
    scene.solids.clear();
    // Coverage, so that only the liquid is added to the program's colour.
    scene.settings.refract.transparent = true;

    // ---- 3. One frame, within the program's. A loop repeats this part; the renderer keeps its memory.

    let view = View::from_matrices(view_from_world, clip_from_view)?;
    let input = FrameInput::new(&scene, view, &loaded.splats, SIZE);
    let frame = renderer.prepare(FrameInput { host: Some(&host), ..input })?;
    renderer.record(frame, &mut encoder);
    renderer.composite(&mut encoder, &color, HDR);

    // ---- 4. The program's own part again.

    let picture = texture(&device, wgpu::TextureFormat::Rgba8UnormSrgb);
    world.tonemap(&mut encoder, &color, &picture);
    let buffer = copy(&device, &mut encoder, picture.texture());
    queue.submit([encoder.finish()]);
    buffer.map_async(wgpu::MapMode::Read, .., |result| result.expect("the buffer can be mapped"));
    device.poll(wgpu::PollType::wait_indefinitely())?;
    let padded = buffer.get_mapped_range(..)?;
    let rows = padded.chunks_exact(padded_row() as usize);
    let pixels = rows.flat_map(|row| &row[..4 * SIZE.x as usize]).copied().collect();
    let picture = image::RgbaImage::from_raw(SIZE.x, SIZE.y, pixels).expect("four bytes per pixel");
    picture.save("embed.png")?;
    println!("embed.png: frame {} with {} particles", loaded.number, loaded.particles);
    // The device has finished, so the counts are there: asked for once, delivered by a poll.
    renderer.take_host_rays();
    device.poll(wgpu::PollType::wait_indefinitely())?;
    if let Some(rays) = renderer.take_host_rays() {
        println!("{:.0} % of the rays left what the program's picture shows", 100.0 * rays.share());
    }
    Ok(())
}

/// Opens a device as any wgpu program does, here without a window.
async fn open_device() -> Result<(wgpu::Device, wgpu::Queue), Box<dyn std::error::Error>> {
    let instance =
        wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let adapter = instance.request_adapter(&wgpu::RequestAdapterOptions::default()).await?;
    // limpid works with wgpu's default limits and features, up to their picture size. To time the passes,
    // request `TIMESTAMP_QUERY` here.
    let (device, queue) = adapter.request_device(&wgpu::DeviceDescriptor::default()).await?;
    println!("{}", adapter.get_info().name);
    Ok((device, queue))
}

/// A texture of the program that passes draw into and read.
fn texture(device: &wgpu::Device, format: wgpu::TextureFormat) -> wgpu::TextureView {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("the program's"),
        size: extent(),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// The program's world: a textured cube on a floor, lit by a sun.
struct World {
    device: wgpu::Device,
    draw: wgpu::RenderPipeline,
    tonemap: wgpu::RenderPipeline,
    uniform: wgpu::BindGroup,
}

const SHADER: &str = r"
struct Uniform { clip_from_world: mat4x4f, centre: vec3f, half: f32, sky: vec3f }
@group(0) @binding(0) var<uniform> world: Uniform;

// `at` counts in half sides of the cube.
struct Varying { @builtin(position) clip: vec4f, @location(0) at: vec3f, @location(1) normal: vec3f }

// Six faces of the cube, then the floor: two triangles each.
@vertex fn vertex(@builtin(vertex_index) index: u32) -> Varying {
    let face = index / 6u;
    let corner = array(vec2f(-1, -1), vec2f(1, -1), vec2f(-1, 1), vec2f(-1, 1), vec2f(1, -1), vec2f(1, 1))[index % 6u];
    let side = select(-1.0, 1.0, face % 2u == 0u);
    let axis = face / 2u;
    var place = vec3f(corner, side);
    var normal = vec3f(0, 0, side);
    if axis == 1u { place = place.zxy; normal = normal.zxy; }
    if axis == 2u { place = place.yzx; normal = normal.yzx; }
    // A turn about the vertical, so that three faces show.
    let turn = mat3x3f(vec3f(0.8, 0, -0.6), vec3f(0, 1, 0), vec3f(0.6, 0, 0.8));
    var turned = turn * place;
    normal = turn * normal;
    if face == 6u {
        place = vec3f(40.0 * corner.x, -1.0, 40.0 * corner.y);
        turned = place;
        normal = vec3f(0, 1, 0);
    }
    let clip = world.clip_from_world * vec4f(world.centre + world.half * turned, 1.0);
    return Varying(clip, place, normal);
}

@fragment fn lit(in: Varying) -> @location(0) vec4f {
    let on_floor = in.normal.y > 0.99 && in.at.y < 0.0;
    let tiles = floor(in.at * select(2.0, 0.7, on_floor) + 0.01);
    let odd = (i32(tiles.x) + i32(tiles.y) + i32(tiles.z)) % 2 != 0;
    let floor_color = select(vec3f(0.75, 0.7, 0.6), vec3f(0.25, 0.28, 0.3), odd);
    let cube_color = select(vec3f(0.9, 0.35, 0.1), vec3f(0.95, 0.85, 0.3), odd);
    let color = select(cube_color, floor_color, on_floor);
    let sun = max(dot(in.normal, normalize(vec3f(0.5, 0.8, 0.3))), 0.0);
    return vec4f(color * (0.35 + 0.9 * sun), 1.0);
}

@vertex fn screen(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@group(0) @binding(1) var hdr: texture_2d<f32>;

@fragment fn tonemap(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let color = textureLoad(hdr, vec2i(at.xy), 0).rgb;
    return vec4f(color / (1.0 + 0.15 * color), 1.0);
}
";

impl World {
    fn new(device: &wgpu::Device, clip_from_world: DMat4, centre: Vec3, half: f32) -> Self {
        let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("the program's"),
            source: wgpu::ShaderSource::Wgsl(SHADER.into()),
        });
        let pipeline = |vertex: &str, fragment: &str, format, depth: bool| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(fragment),
                layout: None,
                vertex: wgpu::VertexState {
                    module: &shader,
                    entry_point: Some(vertex),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: depth.then(|| wgpu::DepthStencilState {
                    format: DEPTH,
                    depth_write_enabled: Some(true),
                    // Reversed: the nearest has the greatest depth.
                    depth_compare: Some(wgpu::CompareFunction::Greater),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &shader,
                    entry_point: Some(fragment),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    targets: &[Some(wgpu::ColorTargetState::from(format))],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let draw = pipeline("vertex", "lit", HDR, true);
        let tonemap = pipeline("screen", "tonemap", wgpu::TextureFormat::Rgba8UnormSrgb, false);
        let mut values = clip_from_world.as_mat4().to_cols_array().to_vec();
        values.extend(centre.to_array());
        values.push(half);
        values.extend(SKY.extend(0.0).to_array());
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("world"),
            size: 4 * values.len() as u64,
            usage: wgpu::BufferUsages::UNIFORM,
            mapped_at_creation: true,
        });
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        buffer.get_mapped_range_mut(..).expect("it was created mapped").copy_from_slice(&bytes);
        buffer.unmap();
        let uniform = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("world"),
            layout: &draw.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }],
        });
        Self { device: device.clone(), draw, tonemap, uniform }
    }

    /// Draws cube and floor before the sky.
    fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        color: &wgpu::TextureView,
        depth: &wgpu::TextureView,
    ) {
        let [r, g, b] = SKY.as_dvec3().to_array();
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("the program's world"),
            color_attachments: &[Some(attachment(color, wgpu::Color { r, g, b, a: 1.0 }))],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.draw);
        pass.set_bind_group(0, &self.uniform, &[]);
        pass.draw(0..42, 0..1);
    }

    /// Tone-maps the program's colour.
    fn tonemap(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        color: &wgpu::TextureView,
        picture: &wgpu::TextureView,
    ) {
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("the program's colour"),
            layout: &self.tonemap.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry {
                binding: 1,
                resource: wgpu::BindingResource::TextureView(color),
            }],
        });
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("the program's picture"),
            color_attachments: &[Some(attachment(picture, wgpu::Color::BLACK))],
            ..Default::default()
        });
        pass.set_pipeline(&self.tonemap);
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..3, 0..1);
    }
}

/// A colour attachment that is cleared first.
fn attachment(view: &wgpu::TextureView, clear: wgpu::Color) -> wgpu::RenderPassColorAttachment<'_> {
    wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations { load: wgpu::LoadOp::Clear(clear), store: wgpu::StoreOp::Store },
    }
}

fn extent() -> wgpu::Extent3d {
    wgpu::Extent3d { width: SIZE.x, height: SIZE.y, depth_or_array_layers: 1 }
}

/// wgpu requires every row of a copy to begin at a multiple of 256 bytes.
fn padded_row() -> u32 {
    (4 * SIZE.x).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}

/// Records a copy of the picture into a buffer that can be mapped.
fn copy(
    device: &wgpu::Device,
    encoder: &mut wgpu::CommandEncoder,
    texture: &wgpu::Texture,
) -> wgpu::Buffer {
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read back"),
        size: u64::from(padded_row() * SIZE.y),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded_row()),
                rows_per_image: None,
            },
        },
        extent(),
    );
    buffer
}
