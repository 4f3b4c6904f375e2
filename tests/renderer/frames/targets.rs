//! Encoding of frames: formats, exposure, rounding, dithering and coverage.

use glam::{DVec3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::frame::{FrameInput, Target};
use limpid::gpu::Gpu;
use limpid::liquid::classify::Splats;
use limpid::offscreen::{Offscreen, Picture};
use limpid::passes::Radiance;
use limpid::passes::tonemap::Tonemap;
use limpid::renderer::Renderer;
use limpid::scene::Scene;
use limpid::settings::Settings;
use limpid::wgpu;

use super::{SIZE, tank};
use crate::support::frames::{Harness, gpu, harness, limited, on_axis, splats};

/// Draws into a caller's texture and reads its bytes.
fn bytes(
    gpu: &Gpu,
    renderer: &mut Renderer,
    format: wgpu::TextureFormat,
    (scene, camera, drawn): (&Scene, &Camera, &Splats),
) -> Vec<u8> {
    // Rows of a copy are aligned to 256 bytes.
    let size = UVec2::new(128, 96);
    let extent = wgpu::Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("a caller's"),
        size: extent,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let view = texture.create_view(&Default::default());
    let input = FrameInput::new(scene, camera, drawn, size);
    renderer.render(input, Target::View(&view, format)).expect("drawn");
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("readback"),
        size: u64::from(4 * size.x * size.y),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(4 * size.x),
                rows_per_image: None,
            },
        },
        extent,
    );
    gpu.queue.submit([encoder.finish()]);
    buffer.map_async(wgpu::MapMode::Read, .., |_| ());
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device answers");
    let bytes = buffer.get_mapped_range(..).expect("mapped").to_vec();
    buffer.unmap();
    bytes
}

/// The device encodes sRGB formats, limpid all others: the bytes agree up to rounding.
#[test]
fn srgb_targets_show_the_same() {
    let Some(mut harness) = harness() else { return };
    let Harness { gpu, renderer } = &mut *harness;
    let (scene, camera, drawn) = tank();
    let mut draw = |format| bytes(gpu, renderer, format, (&scene, &camera, &drawn));
    let plain = draw(wgpu::TextureFormat::Rgba8Unorm);
    let encoded = draw(wgpu::TextureFormat::Rgba8UnormSrgb);
    let mut swapped = draw(wgpu::TextureFormat::Bgra8Unorm);
    swapped.chunks_exact_mut(4).for_each(|texel| texel.swap(0, 2));
    let largest = |other: &[u8]| plain.iter().zip(other).map(|(a, b)| a.abs_diff(*b)).max();
    println!("sRGB {:?}, swapped {:?}", largest(&encoded), largest(&swapped));
    assert!(largest(&encoded) <= Some(1));
    assert_eq!(largest(&swapped), Some(0));
    let shades: std::collections::HashSet<_> = plain.chunks_exact(4).collect();
    assert!(shades.len() > 500, "a picture of {} colours", shades.len());
}

/// One stop doubles the linear values of the picture and does not affect the radiance.
#[test]
fn one_stop_of_exposure_doubles_the_picture() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, camera, drawn) = tank();
    let linear = |byte: u8| {
        let c = f64::from(byte) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    };
    let mut at = |exposure| {
        scene.settings.tonemap.exposure = exposure;
        harness.render(&scene, &camera, &drawn, SIZE)
    };
    let [dark, bright] = [at(-2.0), at(-1.0)];
    assert_eq!(dark.channel("radiance.G"), bright.channel("radiance.G"));
    for (p, (a, b)) in dark.pixels().zip(dark.picture.pixels().zip(bright.picture.pixels())) {
        for i in 0..3 {
            // Rounding of both bytes, as radiance.
            let step = |byte: u8| linear(byte.saturating_add(1)) - linear(byte);
            let slack = step(a[i]) + 0.5 * step(b[i]) + 1e-4;
            let off = (2.0 * linear(a[i]) - linear(b[i])).abs();
            assert!(off <= slack, "{p}: {} and {}", a[i], b[i]);
            // The picture stores the exposed radiance.
            let off = (linear(b[i]) - (0.5 * bright.radiance(p)[i]).min(1.0)).abs();
            assert!(off <= 0.6 * step(b[i]) + 1e-4, "{p}: {} of {}", b[i], bright.radiance(p));
        }
    }
}

/// Pictures hold the sRGB code that is nearest to the radiance: of each code's own value, and on both sides of the midpoints
/// between them. So they agree on all adapters. Pictures larger than a binding are drawn in bands of rows.
#[test]
fn radiance_is_rounded_to_the_nearest_code() {
    let Some(gpu) = gpu() else { return };
    // Of 64 rows at most.
    let small = limited(&gpu, |limits| limits.max_storage_buffer_binding_size = 66_000);
    for gpu in [gpu, small] {
        assert_codes(&gpu);
    }
}

fn assert_codes(gpu: &Gpu) {
    let linear = |code: f64| {
        let c = code / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    };
    // Columns are codes; rows are at them, before their upper midpoint, and after it, by turns.
    let (size, offsets) = (UVec2::new(256, 150), [0.0, 0.499, 0.501]);
    let row = |y: u32| {
        let offset = offsets[y as usize % 3];
        let row = (0..256).map(move |k| linear((f64::from(k) + offset).min(255.4)) as f32);
        row.flat_map(|c| [c, c, c, 1.0])
    };
    let texels: Vec<f32> = (0..size.y).flat_map(row).collect();
    let extent = wgpu::Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("known radiance"),
        size: extent,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let layout = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(16 * size.x),
        rows_per_image: None,
    };
    let bytes = bytemuck::cast_slice(&texels);
    gpu.queue.write_texture(texture.as_image_copy(), bytes, layout, extent);

    let picture = Picture::new(gpu, size).expect("a picture");
    let mut tonemap = Tonemap::new(gpu, false);
    let settings = Settings::default().tonemap;
    let prepared = tonemap.prepare(gpu, &settings, Target::Picture(&picture));
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let radiance = Radiance { texture };
    tonemap.record(gpu, &mut encoder, &radiance, &prepared, Default::default());
    gpu.queue.submit([encoder.finish()]);
    for (x, y, pixel) in picture.read(gpu).expect("it is read").enumerate_pixels() {
        let expected = (x + u32::from(y % 3 == 2)).min(255) as u8;
        assert_eq!(
            pixel.0,
            [expected, expected, expected, 255],
            "code {x} + {}",
            offsets[y as usize % 3]
        );
    }
}

/// Dithered pictures have no bands: their bytes differ from the encoded radiance by less than a step, and not on average over
/// a block, where rounding leaves up to half a step in smooth gradients. Nothing is dithered by default.
#[test]
fn dithered_gradients_have_no_bands() {
    let Some(mut harness) = harness() else { return };
    let (zenith, horizon) = (Vec3::new(0.23, 0.24, 0.25), Vec3::new(0.24, 0.25, 0.26));
    let mut scene = Scene {
        environment: Environment::Gradient { zenith, horizon, nadir: horizon },
        ..Scene::default()
    };
    let (eye, target) = (DVec3::new(0.0, 1.0, 5.0), DVec3::new(0.0, 2.0, 0.0));
    let camera = Camera { eye, target, ..on_axis(5.0, 40.0) };
    let mut largest_mean = |dither, most: f64| {
        scene.settings.tonemap.dither = dither;
        let shot = harness.render(&scene, &camera, &splats(&[], &[], 0.05), SIZE);
        let off = |p: UVec2| {
            let linear = shot.radiance(p).y;
            let encoded = 255.0 * (1.055 * linear.powf(1.0 / 2.4) - 0.055);
            f64::from(shot.picture.get_pixel(p.x, p.y).0[1]) - encoded
        };
        let mut largest = 0.0f64;
        for corner in
            (0..SIZE.y / 10).flat_map(|y| (0..SIZE.x / 10).map(move |x| 10 * UVec2::new(x, y)))
        {
            let block = (0..100).map(|i| off(corner + UVec2::new(i % 10, i / 10)));
            let (mut sum, mut furthest) = (0.0, 0.0f64);
            block.for_each(|off| (sum, furthest) = (sum + off, furthest.max(off.abs())));
            assert!(furthest <= most, "{corner}: {furthest} steps");
            largest = largest.max((sum / 100.0).abs());
        }
        largest
    };
    let (rounded, dithered) = (largest_mean(false, 0.51), largest_mean(true, 1.01));
    println!("blocks are off by up to {rounded} steps rounded, {dithered} dithered");
    assert!(rounded > 0.2, "the gradient has no bands to begin with: {rounded}");
    assert!(dithered < 0.08, "{dithered}");
    assert!(!Settings::default().tonemap.dither);
}

/// A picture has the requested size; empty and excessive sizes are refused.
#[test]
fn picture_has_the_requested_size() {
    let Some(gpu) = gpu() else { return };
    let frame = Picture::new(&gpu, UVec2::new(33, 21)).expect("a frame");
    let picture = frame.read(&gpu).expect("a picture");
    assert_eq!((picture.width(), picture.height()), (33, 21));
    assert!(Picture::new(&gpu, UVec2::new(0, 5)).is_err());
    assert!(Picture::new(&gpu, UVec2::splat(1 << 20)).is_err());
}

/// Four channels are the three of a picture and its coverage, or an opaque one.
#[test]
fn four_channels_are_three_and_coverage() {
    let Some(gpu) = gpu() else { return };
    let (mut scene, camera, splats) = tank();
    let mut offscreen = Offscreen::new(&gpu);
    for transparent in [false, true] {
        scene.settings.refract.transparent = transparent;
        let input = FrameInput::new(&scene, &camera, &splats, SIZE);
        let expected = offscreen.draw(input).unwrap();
        let pending = offscreen.begin(input).unwrap();
        let picture = pending.wait_rgba().unwrap();
        for (x, y, pixel) in picture.enumerate_pixels() {
            let [r, g, b] = expected.picture.get_pixel(x, y).0;
            let alpha = expected.coverage.as_ref().map_or(255, |alpha| alpha.get_pixel(x, y).0[0]);
            assert_eq!(pixel.0, [r, g, b, alpha]);
        }
    }
}
