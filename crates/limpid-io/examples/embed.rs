//! Draws limpid's liquid into a texture of a wgpu program.
//!
//! ```sh
//! cargo run --release --example embed                      # the built-in demo
//! cargo run --release --example embed -- water_0020.bgeo   # a particle file
//! ```
//!
//! A program that draws with wgpu already has a device, a queue and a target. limpid uses all three:
//!
//! 1. the program opens its device and creates its texture;
//! 2. [`Gpu::from_device`] wraps the device for limpid, [`Renderer::new`] compiles the passes;
//! 3. [`Renderer::render`] draws a frame into the program's view, on the program's queue;
//! 4. the program uses the texture: here it reads it back and saves `embed.png`.
//!
//! A window works the same way: pass the view of the surface's current texture to `render`, and present
//! it afterwards. limpid itself never uses a window system.

use limpid::glam::UVec2;
use limpid::gpu::Gpu;
use limpid::renderer::Renderer;

// limpid re-exports the wgpu it was built with, so that the types match.
use limpid::wgpu;

use limpid_io::input::Input;

const SIZE: UVec2 = UVec2::new(640, 480);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // ---- 1. The program's own: a device, a queue, a texture.

    let (device, queue) = pollster::block_on(open_device())?;

    // Any 8-bit colour format works. With an sRGB format the hardware encodes the colours, with others
    // limpid does.
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("the program's picture"),
        size: extent(),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8UnormSrgb,
        // limpid draws into it; this program copies from it.
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());

    // ---- 2. limpid on the program's device. wgpu handles are reference-counted and cheap to clone.

    let gpu = Gpu::from_device(device.clone(), queue.clone());
    // Once per program, since it compiles the passes.
    let mut renderer = Renderer::new(&gpu);

    // ---- 3. One frame. A loop repeats this part; the renderer keeps its memory.

    let input = match std::env::args().nth(1) {
        Some(path) => Input::open(&path)?,
        None => Input::demo()?,
    };
    // The scene of the input, or a default one around bare particles. To build one in code instead, fill
    // in a `limpid::scene::Scene`: all its fields are public.
    let (input, project) = input.resolve()?;
    let frame = &input.sequence.frames[0];
    // Particles are classified on the CPU, or with `Input::classified` on the device; this may also run
    // on another thread.
    let loaded = input.load(frame, &project.scene)?;
    let camera = project.camera_for(loaded.bulk.bounds);
    renderer.render(&project.scene, &camera, &loaded.splats, &view, texture.format(), SIZE)?;

    // ---- 4. The program's own part again. The queue executes this copy after the frame.

    let pixels = read_back(&device, &queue, &texture)?;
    let picture = image::RgbaImage::from_raw(SIZE.x, SIZE.y, pixels).expect("four bytes per pixel");
    picture.save("embed.png")?;
    println!("embed.png: frame {} with {} particles", loaded.number, loaded.particles);
    Ok(())
}

/// Opens a device as any wgpu program does, here without a window.
async fn open_device() -> Result<(wgpu::Device, wgpu::Queue), Box<dyn std::error::Error>> {
    let instance =
        wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let adapter = instance.request_adapter(&wgpu::RequestAdapterOptions::default()).await?;
    let (device, queue) = adapter
        .request_device(&wgpu::DeviceDescriptor {
            label: Some("the program's device"),
            // limpid works with wgpu's default limits, up to their picture size. To time the passes,
            // request `TIMESTAMP_QUERY` here.
            required_features: wgpu::Features::empty(),
            ..Default::default()
        })
        .await?;
    println!("{}", adapter.get_info().name);
    Ok((device, queue))
}

/// Copies the texture to memory with packed rows.
fn read_back(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    texture: &wgpu::Texture,
) -> Result<Vec<u8>, Box<dyn std::error::Error>> {
    // wgpu requires every row of a copy to begin at a multiple of 256 bytes.
    let row = 4 * SIZE.x;
    let padded_row = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read back"),
        size: u64::from(padded_row * SIZE.y),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded_row),
                rows_per_image: None,
            },
        },
        extent(),
    );
    queue.submit([encoder.finish()]);

    // The buffer is mapped once the device has finished all submitted work.
    buffer.map_async(wgpu::MapMode::Read, .., |result| result.expect("the buffer can be mapped"));
    device.poll(wgpu::PollType::wait_indefinitely())?;
    let padded = buffer.get_mapped_range(..)?;
    Ok(padded.chunks_exact(padded_row as usize).flat_map(|r| &r[..row as usize]).copied().collect())
}

fn extent() -> wgpu::Extent3d {
    wgpu::Extent3d { width: SIZE.x, height: SIZE.y, depth_or_array_layers: 1 }
}
