//! Whole frames: pictures do not depend on earlier frames, on the target, or on which of several
//! equivalent pipelines draws them.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::{DVec3, Quat, UVec2, Vec3};
use limpid::camera::{Camera, Lens, View};
use limpid::environment::Environment;
use limpid::frame::{FrameInput, Target};
use limpid::gpu::Gpu;
use limpid::liquid::Particles;
use limpid::liquid::classify::{Splats, classify};
use limpid::offscreen::Picture;
use limpid::offscreen::{Offscreen, PendingFrame};
use limpid::passes::Radiance;
use limpid::passes::tonemap::Tonemap;
use limpid::renderer::Renderer;
use limpid::scene::{Scene, Shape};
use limpid::settings::{Classify, Settings, Solids, Solver};
use limpid::wgpu;

use crate::support::frames::{
    FrameImages, Harness, diagnosed, ellipsoid, glowing, gpu, harness, limited, mean_difference,
    noise_vector, on_axis, render, scene, sphere, splats,
};

const SIZE: UVec2 = UVec2::new(120, 90);

/// A drop of 200 particles with some spray and default settings: floor, sky, absorption.
fn tank() -> (Scene, Camera, Splats) {
    tank_of(200)
}

fn tank_of(count: usize) -> (Scene, Camera, Splats) {
    let mut seed = 9;
    let positions = (0..count)
        .map(|i| {
            let reach = if i < count - 30 { Vec3::new(0.3, 0.2, 0.3) } else { Vec3::splat(0.8) };
            reach * noise_vector(&mut seed)
        })
        .collect();
    let particles = Particles { positions, ..Default::default() };
    let scene = Scene::around(DVec3::splat(-0.8), DVec3::splat(0.8), 0.06);
    let camera = Camera { eye: DVec3::new(0.7, 1.2, 2.4), ..on_axis(0.0, 40.0) };
    let drawn = classify(&particles, 0.06, &scene.settings.classify);
    assert!(drawn.splashes.len() > 10 && drawn.aggregates.len() > 100);
    (scene, camera, drawn)
}

/// All images of both frames are bitwise equal.
#[track_caller]
fn assert_same(a: &FrameImages, b: &FrameImages, why: &str) {
    let names = |shot: &FrameImages| {
        let mut names: Vec<_> = shot.channels.keys().cloned().collect();
        names.sort();
        names
    };
    assert_eq!(names(a), names(b), "{why}");
    for (name, values) in &a.channels {
        let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert!(bits(values) == bits(b.channel(name)), "{why}: {name} differs");
    }
    assert!(a.picture == b.picture, "{why}: the pictures differ");
}

/// Pictures of one frame from several views, perspective and parallel, equal single pictures from them.
#[test]
fn views_of_one_frame_equal_single_pictures() {
    let Some(gpu) = gpu() else { return };
    let (scene, camera, drawn) = tank();
    let parallel = Camera { lens: Some(Lens::Orthographic { height: 2.0 }), ..camera.turned(0.4) };
    let cameras = [camera, camera.turned(0.3), parallel, camera.turned(2.0), camera];
    let views = cameras.map(|camera| View::from(&camera));
    let input = FrameInput::new(&scene, &camera, &drawn, SIZE);
    let pictures = Offscreen::new(&gpu).draw_views(input, &views).expect("pictures");
    assert_eq!(pictures.len(), views.len());
    for (view, picture) in views.into_iter().zip(&pictures) {
        let alone = Offscreen::new(&gpu).draw(FrameInput { view, ..input }).expect("a picture");
        assert!(alone.into_image().into_rgba8() == *picture, "{view:?}");
    }
    assert!(pictures[0] != pictures[1], "the views are the same");
}

/// Pictures begun while the device still draws earlier ones are unaffected by the particles uploaded
/// meanwhile, in smaller and larger buffers, and by other sizes.
#[test]
fn pipelined_pictures_equal_single_pictures() {
    let Some(gpu) = gpu() else { return };
    let frames: Vec<_> = [(300, SIZE), (200, SIZE), (400, SIZE), (200, SIZE / 2), (300, 2 * SIZE)]
        .into_iter()
        .map(|(count, size)| (tank_of(count), size))
        .collect();
    let alone = frames.iter().map(|((scene, camera, drawn), size)| {
        let input = FrameInput::new(scene, camera, drawn, *size);
        Offscreen::new(&gpu).draw(input).expect("a picture").picture
    });
    let alone: Vec<_> = alone.collect();
    let mut offscreen = Offscreen::new(&gpu);
    let begun: Vec<_> = frames
        .iter()
        .map(|((scene, camera, drawn), size)| {
            offscreen.begin(FrameInput::new(scene, camera, drawn, *size))
        })
        .collect();
    // In reverse order, which must not matter.
    for (begun, alone) in begun.into_iter().zip(alone).rev() {
        let picture = begun.and_then(PendingFrame::wait).expect("a picture").picture;
        assert!(picture == alone, "{:?} differs", picture.dimensions());
    }
}

/// Largest difference of radiance between two frames.
fn largest_difference(a: &FrameImages, b: &FrameImages) -> f64 {
    let off = |p| (a.radiance(p) - b.radiance(p)).abs().max_element();
    a.pixels().map(off).fold(0.0, f64::max)
}

/// A frame depends only on its inputs: a renderer that has drawn other frames, with other sizes, layers
/// and solids, draws it like a new renderer. Frames may thus be rendered in any order. Detects passes
/// that keep images of the last frame or size.
#[test]
fn frames_do_not_depend_on_each_other() {
    let Some(gpu) = gpu() else { return };
    let (scene, camera, drawn) = tank();
    let mut screen = scene.clone();
    screen.settings.refract.solids = Solids::Screen;
    let bodies = Splats { splashes: Vec::new(), ..drawn.clone() };
    let spray = Splats { aggregates: Vec::new(), ..drawn.clone() };
    let fewer = Splats { aggregates: drawn.aggregates[..40].to_vec(), ..drawn.clone() };
    let nothing = Splats { radius: 0.06, ..Default::default() };
    let large = UVec2::new(150, 101);
    let frames = [
        ("all", &scene, &drawn, SIZE),
        ("larger", &scene, &drawn, large),
        ("tiny", &scene, &drawn, UVec2::new(7, 5)),
        ("no spray", &scene, &bodies, SIZE),
        ("nothing", &scene, &nothing, SIZE),
        ("only spray", &scene, &spray, SIZE),
        ("fewer", &scene, &fewer, large),
        ("solids on the screen", &screen, &drawn, SIZE),
    ];
    let draw = |renderer: &mut Renderer,
                (_, scene, drawn, size): (&str, &Scene, &Splats, UVec2)| {
        let shot = render(&gpu, renderer, diagnosed(scene, &camera, drawn, size));
        shot.assert_finite();
        shot
    };
    // New renderers for the two frames that could inherit most; for the others, the first round.
    let mut kept = Renderer::new(&gpu);
    let first: Vec<_> = frames.iter().map(|&frame| draw(&mut kept, frame)).collect();
    for i in [0, 2] {
        assert_same(&draw(&mut Renderer::new(&gpu), frames[i]), &first[i], frames[i].0);
    }
    for i in [3, 0, 6, 1, 5, 2, 7, 4, 1, 3] {
        assert_same(&draw(&mut kept, frames[i]), &first[i], frames[i].0);
    }
    // Without diagnostics, which draw a G-buffer and count, the picture is the same.
    let plain = render(&gpu, &mut kept, FrameInput::new(&scene, &camera, &drawn, SIZE));
    assert!(!plain.has("interfaces") && !plain.has("solid_depth"));
    let difference = largest_difference(&plain, &first[0]);
    println!("without counting: {difference:e}");
    assert!(plain.picture == first[0].picture && difference < 1e-6, "{difference}");
}

/// An intersector that reads the bounds of the layers finds those of this frame, whichever one drew its layers.
/// Without them it skipped all liquid that rays enter again.
#[test]
fn bounds_are_found_where_another_intersector_drew_the_layers() {
    let Some(gpu) = gpu() else { return };
    let (guarded, camera, drawn) = tank();
    let mut march = guarded.clone();
    march.settings.refract.solver = Solver::March;
    let nothing = Splats { radius: drawn.radius, ..Default::default() };
    let mut kept = Renderer::new(&gpu);
    let mut draw = |scene: &Scene, splats: &Splats| {
        render(&gpu, &mut kept, FrameInput::new(scene, &camera, splats, SIZE))
    };
    let expected = draw(&guarded, &drawn);
    draw(&guarded, &nothing);
    draw(&march, &drawn);
    assert_same(&draw(&guarded, &drawn), &expected, "after another intersector");
}

/// Features that a scene lacks are compiled out, with the same picture as if they were present without
/// effect. Since different code computes it, the tolerance is a mean of 1e-4, for the few pixels in
/// which rounding decides the path of a ray.
#[test]
fn unused_features_do_not_change_the_picture() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, camera, mut drawn) = tank();
    drawn.splashes.clear();
    scene.solids.clear();
    scene.liquid.absorption = Vec3::ZERO;
    let plain = harness.render(&scene, &camera, &drawn, SIZE);
    plain.assert_finite();
    let mut check = |name: &str, scene: &Scene, drawn: &Splats| {
        let shot = harness.render(scene, &camera, drawn, SIZE);
        shot.assert_finite();
        let (mean, most) = (mean_difference(&plain, &shot), largest_difference(&plain, &shot));
        println!("{name}: mean {mean:.2e}, most {most:.2e}");
        assert!(mean < 1e-4, "{name}: {mean}");
    };
    // A splash behind the eye.
    let behind =
        Splats { splashes: vec![sphere((2.0 * camera.eye).as_vec3(), 0.1)], ..drawn.clone() };
    check("splash layers", &scene, &behind);
    let mut absorbing = scene.clone();
    absorbing.liquid.absorption = Vec3::splat(1e-20);
    check("absorption", &absorbing, &drawn);
    // A distant speck that no ray hits.
    let mut beside = scene.clone();
    let speck = Shape::Sphere { center: DVec3::new(3e4, 4e4, 5e4), radius: 1e-2 };
    beside.solids = vec![glowing(speck, Vec3::ONE)];
    check("solid and contact", &beside, &drawn);
    beside.settings.refract.contact = 0.0;
    check("solid", &beside, &drawn);
    beside.settings.refract.solids = Solids::Screen;
    check("solid on the screen", &beside, &drawn);
    // An environment of another kind.
    let mut constant = scene.clone();
    constant.environment = Environment::Constant(Vec3::splat(0.4));
    let constant = harness.render(&constant, &camera, &drawn, SIZE);
    let mut map = scene.clone();
    let pixels = vec![[0.4, 0.4, 0.4, 1.0]; 8];
    map.environment = Environment::Map { size: UVec2::new(4, 2), pixels: pixels.into() };
    let map = harness.render(&map, &camera, &drawn, SIZE);
    let mean = mean_difference(&constant, &map);
    println!("map: {mean:.2e}");
    assert!(mean < 1e-4, "{mean}");
}

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

/// Coplanar, collinear, coincident, single and widely scattered particles are drawn and finite.
#[test]
fn degenerate_particles_are_drawn() {
    let Some(mut harness) = harness() else { return };
    let (scene, camera, _) = tank();
    let cells = |n: i32| (0..n * n).map(move |i| Vec3::new((i % n) as f32, 0.0, (i / n) as f32));
    let clouds: [(&str, Vec<Vec3>); 6] = [
        ("coplanar", cells(14).map(|x| (x - 6.5 * Vec3::new(1.0, 0.0, 1.0)) * 0.1).collect()),
        ("collinear", (0..40).map(|i| Vec3::X * (0.05 * (i - 20) as f32)).collect()),
        ("coincident", vec![Vec3::splat(0.1); 50]),
        ("nearly coincident", (0..50).map(|i| Vec3::splat(0.1) + 1e-7 * i as f32).collect()),
        ("alone", vec![Vec3::ZERO]),
        (
            "far flung",
            vec![Vec3::ZERO, Vec3::splat(1e18), Vec3::NEG_X * 1e30, camera.eye.as_vec3()],
        ),
    ];
    for kernel in [limpid::settings::Kernel::Fitted, limpid::settings::Kernel::Volume] {
        let settings = Classify { kernel, splash_density: 0.1, ..Classify::default() };
        for (name, positions) in &clouds {
            let particles = Particles { positions: positions.clone(), ..Default::default() };
            let drawn = classify(&particles, 0.06, &settings);
            let shot = harness.render(&scene, &camera, &drawn, SIZE);
            shot.assert_finite();
            let covered = shot.channel("interfaces").iter().filter(|&&n| n > 0.0).count();
            println!("{name}: {covered} pixels");
            assert!(covered > 20, "{name} is not visible");
        }
    }
}

/// Extreme splats that classification does not produce (needles, sheets, specks, one around the world,
/// at the eye, coincident), each alone and all together, yield finite images.
#[test]
fn adversarial_splats_are_finite() {
    let Some(mut harness) = harness() else { return };
    let (scene, camera, _) = tank();
    let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.3, 0.9, 2.1);
    let eye = camera.eye.as_vec3();
    let ahead = eye - eye.normalize() * camera.near();
    let adversarial = [
        ellipsoid(Vec3::ZERO, Vec3::new(1e-4, 1e-4, 1.0), turn),
        ellipsoid(Vec3::ZERO, Vec3::new(1e-4, 1.0, 1.0), turn),
        ellipsoid(Vec3::ZERO, Vec3::new(1e-4, 1.0, 1.0), Quat::from_rotation_y(1.2870022)),
        ellipsoid(Vec3::ZERO, Vec3::new(100.0, 1e-3, 100.0), Quat::IDENTITY),
        sphere(Vec3::ZERO, 1e-6),
        sphere(Vec3::ZERO, 1e-3),
        sphere(Vec3::ZERO, 1e4),
        sphere(Vec3::new(0.0, -1e5, 0.0), 1e5),
        sphere(eye, 1e-3),
        sphere(eye, 0.5),
        sphere(ahead, 1e-4),
        sphere(ahead, camera.near()),
        sphere(Vec3::new(1e6, 1e6, -1e6), 10.0),
        sphere(Vec3::ZERO, 0.3),
        sphere(Vec3::ZERO, 0.3),
    ];
    let mut finite = |aggregates: &[_], splashes: &[_], smoothed: bool| {
        let mut scene = scene.clone();
        scene.settings.smooth.iterations = if smoothed { 5 } else { 0 };
        let shot = harness.render(&scene, &camera, &splats(aggregates, splashes, 0.06), SIZE);
        shot.assert_finite();
        assert!(shot.pixels().all(|p| shot.radiance(p).cmpge(DVec3::ZERO).all()));
    };
    for (i, splat) in adversarial.iter().enumerate() {
        println!("splat {i}");
        finite(&[*splat], &[], true);
        finite(&[*splat], &[adversarial[13]], false);
    }
    finite(&adversarial, &[], true);
    finite(&adversarial[..8], &adversarial[8..], true);
    finite(&adversarial[8..], &adversarial[..8], false);
}

/// The unit of length does not matter: a world in millimetres or kilometres gives the same picture, up to
/// rounding and the rays that it decides. Detects hidden constants in metres.
#[test]
fn scale_does_not_change_the_picture() {
    let Some(mut harness) = harness() else { return };
    let mut scene = scene();
    scene.settings.smooth.iterations = 5;
    scene.liquid.absorption = Vec3::new(3.0, 1.0, 0.3);
    let (_, camera, drawn) = tank();
    let metres = harness.render(&scene, &camera, &drawn, SIZE);
    for scale in [1e-4f32, 1e-2, 1e3] {
        let splat = |splat: &limpid::liquid::classify::Splat| {
            let scaled = |v: [f32; 3]| v.map(|x| x * scale);
            limpid::liquid::classify::Splat {
                centre: scaled(splat.centre),
                radius: splat.radius * scale,
                diagonal: scaled(splat.diagonal),
                off_diagonal: scaled(splat.off_diagonal),
                ..*splat
            }
        };
        let scaled = Splats {
            aggregates: drawn.aggregates.iter().map(splat).collect(),
            splashes: drawn.splashes.iter().map(splat).collect(),
            radius: drawn.radius * scale,
            origin: drawn.origin * f64::from(scale),
            is_hull: false,
            device: None,
            bulk: None,
        };
        let mut scene = scene.clone();
        scene.liquid.absorption /= scale;
        let camera = Camera { eye: camera.eye * f64::from(scale), ..camera };
        let shot = harness.render(&scene, &camera, &scaled, SIZE);
        shot.assert_finite();
        let mean = mean_difference(&metres, &shot);
        println!("{scale}: {mean:.2e}");
        assert!(mean < 1e-3, "{scale}: {mean}");
    }
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

/// A class of splats that exceeds one binding is drawn in parts, with the same picture.
#[test]
fn splats_beyond_one_binding_are_drawn_in_parts() {
    let Some(whole) = gpu() else { return };
    // Room for 1,000 splats in a binding.
    let parts = limited(&whole, |limits| limits.max_storage_buffer_binding_size = 48_000);
    let (scene, camera, drawn) = tank_of(2500);
    assert!(drawn.aggregates.len() > 2000, "{} aggregates", drawn.aggregates.len());
    let [whole, parts] = [whole, parts].map(|gpu| {
        let input = FrameInput::new(&scene, &camera, &drawn, SIZE);
        render(&gpu, &mut Renderer::new(&gpu), input)
    });
    assert!(whole.picture == parts.picture);
}

/// A taken radiance is that of its frame, whatever is drawn afterwards, and the next frame goes into the spare.
#[test]
fn a_taken_radiance_stays() {
    let Some(gpu) = gpu() else { return };
    let (scene, camera, splats) = tank();
    let other = Camera { eye: DVec3::new(-0.7, 0.8, 2.0), ..camera };
    let mut offscreen = Offscreen::new(&gpu);
    let mut draw = |camera: &Camera, spare: Option<wgpu::Texture>| {
        let frame = offscreen.draw(FrameInput::new(&scene, camera, &splats, SIZE)).unwrap();
        let read = offscreen.radiance().unwrap();
        (frame.picture, read, offscreen.take_radiance(spare))
    };
    let (first_picture, first, taken) = draw(&camera, None);
    let (second_picture, second, again) = draw(&other, None);
    assert_ne!(first, second);
    assert_eq!(taken.read().unwrap(), first, "after another frame");
    assert_eq!(again.read().unwrap(), second);
    // Two frames later the spare is drawn into.
    let spare = taken.into_spare();
    let (third_picture, third, _) = draw(&camera, Some(spare.clone()));
    assert_eq!((&third_picture, &third), (&first_picture, &first));
    let (fourth_picture, _, taken) = draw(&other, None);
    assert_eq!(fourth_picture, second_picture);
    assert_eq!(taken.into_spare(), spare);
}

/// An interrupted frame ends with an error; the handle draws the same picture afterwards, and others are not
/// affected.
#[test]
fn an_interrupt_ends_a_frame() {
    let Some(gpu) = gpu() else { return };
    let (scene, camera, splats) = tank();
    let interrupt = Arc::new(AtomicBool::new(false));
    let mut offscreen = Offscreen::new(&gpu.clone().with_interrupt(interrupt.clone()));
    let input = FrameInput::new(&scene, &camera, &splats, SIZE);
    let expected = offscreen.draw(input).unwrap().picture;
    interrupt.store(true, Ordering::Relaxed);
    let ended = offscreen.draw(input);
    assert!(matches!(ended, Err(limpid::Error::Interrupted)), "{:?}", ended.err());
    let other = Offscreen::new(&gpu).draw(input).unwrap().picture;
    assert_eq!(other, expected);
    interrupt.store(false, Ordering::Relaxed);
    // Interrupted after it was submitted.
    let pending = offscreen.begin(input).unwrap();
    interrupt.store(true, Ordering::Relaxed);
    assert!(matches!(pending.wait(), Err(limpid::Error::Interrupted)));
    interrupt.store(false, Ordering::Relaxed);
    assert_eq!(offscreen.draw(input).unwrap().picture, expected);
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

/// An adapter is chosen by a part of its name, whatever the environment says.
#[test]
fn adapters_are_chosen_by_name() {
    let Some(gpu) = gpu() else { return };
    let adapter = gpu.adapter();
    let part = adapter.split(' ').next().unwrap_or_default().to_uppercase();
    // Another backend may have the same adapter by a longer name.
    let found = Gpu::named(&part).unwrap().adapter();
    assert!(found.to_uppercase().contains(&part), "{found} is not {part}");
    let error = Gpu::named("Voodoo 2").unwrap_err().to_string();
    assert!(
        error.contains("`Voodoo 2`; there are: ") && error.to_uppercase().contains(&part),
        "{error}"
    );
}
