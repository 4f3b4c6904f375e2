//! Projections, frames that the caller submits, and coverage.

use glam::dcamera::rh::proj::directx::{
    orthographic, perspective, perspective_infinite, perspective_infinite_reverse,
};
use glam::dcamera::rh::view::look_at_mat4;
use glam::{DMat4, DVec2, DVec3, UVec2, Vec3};
use image::RgbaImage;
use limpid::camera::{Camera, Lens, Projection, View};
use limpid::environment::Environment;
use limpid::frame::{FrameInput, Target};
use limpid::gpu::Gpu;
use limpid::liquid::classify::Splats;
use limpid::offscreen::{Offscreen, Picture};
use limpid::scene::{Scene, Shape, Surface};
use limpid::wgpu;

use crate::support::frames::{
    glowing, harness, mean_difference, noise_vector, on_axis, scene, sphere, splats,
};

const SIZE: UVec2 = UVec2::new(120, 90);

/// Drops before a checkered floor.
fn drops() -> (Scene, Splats) {
    let mut seed = 4;
    let drops: Vec<_> =
        (0..40).map(|_| sphere(0.6 * noise_vector(&mut seed) + 0.2 * Vec3::Y, 0.15)).collect();
    let mut scene = Scene::around(DVec3::splat(-0.6), DVec3::splat(0.6), 0.1);
    scene.settings.smooth.iterations = 0;
    scene.settings.refract.edge_samples = 1;
    (scene, splats(&drops, &drops[..5], 0.15))
}

/// Parallel rays that begin in the liquid leave it where it ends: their length inside is that of the ball.
#[test]
fn parallel_rays_may_begin_in_the_liquid() {
    let Some(mut harness) = harness() else { return };
    let splats = splats(&[sphere(Vec3::ZERO, 0.7)], &[], 0.7);
    let lens = Some(Lens::Orthographic { height: 1.2 });
    let camera = Camera { eye: DVec3::ZERO, target: DVec3::NEG_Z, lens, ..on_axis(1.0, 40.0) };
    let mut scene = scene();
    // One interface: rays end where they leave.
    scene.settings.refract.interfaces = 1;
    let images = harness.render(&scene, &camera, &splats, SIZE);
    images.assert_finite();
    for p in images.pixels() {
        let beside = (p.as_dvec2() + 0.5 - 0.5 * SIZE.as_dvec2()) * 1.2 / f64::from(SIZE.y);
        if beside.length() > 0.5 {
            continue;
        }
        let expected = (0.49 - beside.length_squared()).sqrt();
        assert!(
            (images.at("inside", p) - expected).abs() < 2e-3,
            "{p}: {}",
            images.at("inside", p)
        );
    }
}

/// A near plane behind the eye of parallel rays moves the eye there.
#[test]
fn parallel_rays_may_begin_behind_the_eye() {
    let Some(mut harness) = harness() else { return };
    let (scene, splats) = drops();
    let (eye, target) = (DVec3::new(0.2, 0.1, 0.3), DVec3::ZERO);
    let from = |eye: DVec3| look_at_mat4(eye, target, DVec3::Y);
    let back = (eye - target).normalize();
    let whole = |near: f64| orthographic(-1.2, 1.2, -0.9, 0.9, near, 20.0);
    let behind = View::from_matrices(from(eye), whole(-5.0)).unwrap();
    let moved = View::from_matrices(from(eye + 5.0 * back), whole(0.0)).unwrap();
    assert!(behind.eye.distance(moved.eye) < 1e-12 && behind.near().abs() < 1e-6);
    let [a, b] = [behind, moved].map(|view| harness.render(&scene, view, &splats, SIZE));
    assert!(mean_difference(&a, &b) < 1e-4);
    let negative = View { near: Some(-1.0), ..moved };
    assert!(negative.check().is_err());
}

/// A frustum that is a part of a camera's shows that part of its picture: an off-centre projection changes
/// what is in the picture and nothing else.
#[test]
fn off_centre_views_are_parts_of_wider_ones() {
    let Some(mut harness) = harness() else { return };
    let (scene, splats) = drops();
    let camera = Camera { eye: DVec3::new(0.5, 0.9, 2.5), ..on_axis(0.0, 40.0) };
    let whole = harness.render(&scene, &camera, &splats, 2 * SIZE);
    let tangent = (0.5 * 40f64.to_radians()).tan() * DVec2::new(4.0 / 3.0, 1.0);
    for quarter in [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE] {
        let low = (quarter - 1.0) * tangent;
        let projection = Projection::Frustum { low, high: low + tangent };
        let view = View { projection, ..View::from(&camera) };
        let part = harness.render(&scene, view, &splats, SIZE);
        // The first row is the upper one.
        let corner = UVec2::new(quarter.x as u32 * SIZE.x, (1.0 - quarter.y) as u32 * SIZE.y);
        let off = |p: &UVec2| part.radiance(*p).distance(whole.radiance(*p + corner)) > 0.02;
        let depth = "depth.aggregate_front";
        let elsewhere =
            |p: &UVec2| (part.at(depth, *p) - whole.at(depth, *p + corner)).abs() > 1e-4;
        let covered = part.pixels().filter(|p| part.at(depth, *p) > 0.0).count();
        assert!(covered > 200, "{covered}");
        assert_eq!(part.pixels().filter(elsewhere).count(), 0, "{quarter}: depths");
        // Rays that leave the smaller picture see less of the liquid.
        let different = part.pixels().filter(off).count();
        assert!(different < covered / 4, "{quarter}: {different} of {covered} pixels");
    }
}

/// In an orthographic view a ball covers the pixels within its radius, at the depth of a sphere.
#[test]
fn orthographic_views_show_lengths() {
    let Some(mut harness) = harness() else { return };
    let (centre, radius, height) = (Vec3::new(0.3, -0.2, 0.5), 0.4, 2.0);
    let splats = splats(&[sphere(centre, radius)], &[], radius);
    let lens = Some(Lens::Orthographic { height });
    let camera = Camera { lens, ..on_axis(3.0, 40.0) };
    let images = harness.render(&scene(), &camera, &splats, SIZE);
    images.assert_finite();
    let pixel = height / f64::from(SIZE.y);
    let mut covered = 0;
    for p in images.pixels() {
        let middle = p.as_dvec2() + 0.5 - 0.5 * SIZE.as_dvec2();
        let place = DVec2::new(middle.x, -middle.y) * pixel;
        let beside = place.distance(centre.truncate().as_dvec2());
        let [front, back] =
            ["depth.aggregate_front", "depth.aggregate_back"].map(|name| images.at(name, p));
        let r = f64::from(radius);
        if beside < r - 0.01 {
            let half = (r * r - beside * beside).sqrt();
            let depth = 3.0 - f64::from(centre.z);
            assert!((front - (depth - half)).abs() < 1e-4, "{p}: {front}");
            assert!((back - (depth + half)).abs() < 1e-4, "{p}: {back}");
            let normal = images.normal("normal.aggregate_front", p);
            let expected = (place - centre.truncate().as_dvec2()).extend(half) / r;
            assert!(normal.distance(expected) < 1e-3, "{p}: {normal}, not {expected}");
            covered += 1;
        } else if beside > r + 0.01 {
            assert_eq!(front, 0.0, "{p}");
        }
    }
    assert!(covered > 600, "{covered}");
}

/// An orthographic picture is that of a camera far away with a narrow field of view.
#[test]
fn orthographic_views_are_the_limit_of_distant_ones() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, _) = drops();
    let splats = splats(&[sphere(Vec3::new(0.1, 0.0, 0.0), 0.6)], &[], 0.6);
    // A tile's border may be anywhere in a pixel.
    scene.solids[0].surface = Surface::Color(Vec3::new(0.6, 0.5, 0.3));
    let direction = DVec3::new(0.2, 0.35, 0.9).normalize();
    let at = |distance: f64| Camera { eye: direction * distance, ..on_axis(0.0, 40.0) };
    let height = 1.8;
    let near = Camera { lens: Some(Lens::Orthographic { height }), ..at(3.0) };
    let parallel = harness.render(&scene, &near, &splats, SIZE);
    parallel.assert_finite();
    // Farther away the perspective picture loses digits: a ray's start has a relative slack.
    let distance = 40.0;
    let fov_y = (2.0 * (0.5 * height / distance).atan().to_degrees()) as f32;
    let far = Camera { fov_y, near: Some(35.0), ..at(distance) };
    let distant = harness.render(&scene, &far, &splats, SIZE);
    let off = |p: &UVec2| parallel.radiance(*p).distance(distant.radiance(*p)) > 0.1;
    let different = parallel.pixels().filter(off).count();
    let covered = parallel.pixels().filter(|p| parallel.at("interfaces", *p) > 0.0).count();
    let mean = mean_difference(&parallel, &distant);
    assert!(
        covered > 2000 && different < covered / 10,
        "{different} of {covered} pixels, {mean} in the mean"
    );
}

/// Matrices as engines build them give the view that they were built from: forward and reversed depth, with
/// and without a far plane, off-centre and orthographic.
#[test]
fn views_are_read_from_matrices() {
    let camera = Camera { eye: DVec3::new(1.0, 2.0, 3.0), ..on_axis(0.0, 50.0) };
    let own = View::from(&camera);
    let view = look_at_mat4(camera.eye, camera.target, camera.up.as_dvec3());
    let (near, far) = (0.25, 80.0);
    let half = (0.5 * 50f64.to_radians()).tan() * DVec2::new(1.5, 1.0);
    let fov = 50f64.to_radians();
    let reversed = DMat4::from_cols_array_2d(&[
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0, 1.0],
    ]);
    let forward = perspective(fov, 1.5, near, far);
    let projections = [
        forward,
        reversed * forward,
        perspective_infinite(fov, 1.5, near),
        perspective_infinite_reverse(fov, 1.5, near),
    ];
    for projection in projections {
        let found = View::from_matrices(view, projection).expect("a view");
        let Projection::Frustum { low, high } = found.projection else { panic!("{found:?}") };
        assert!(low.abs_diff_eq(-half, 1e-12) && high.abs_diff_eq(half, 1e-12), "{found:?}");
        assert!((found.near() - near as f32).abs() < 1e-6, "{found:?}");
        assert!(found.eye.abs_diff_eq(own.eye, 1e-12));
        assert!(found.view_from_world.abs_diff_eq(own.view_from_world, 1e-12));
    }
    // Jitter moves the picture by a share of a pixel.
    let jitter = DMat4::from_translation(DVec3::new(0.01, -0.02, 0.0)) * forward;
    let Projection::Frustum { low, high } = View::from_matrices(view, jitter).unwrap().projection
    else {
        panic!("a frustum")
    };
    let middle = 0.5 * (low + high);
    assert!(middle.abs_diff_eq(DVec2::new(-0.01, 0.02) * half, 1e-12), "{middle}");

    for depth in [DMat4::IDENTITY, reversed] {
        let parallel = depth * orthographic(-2.0, 1.0, -0.5, 1.5, near, far);
        let found = View::from_matrices(view, parallel).expect("a view");
        let Projection::Orthographic { low, high } = found.projection else { panic!("{found:?}") };
        assert!(low.abs_diff_eq(DVec2::new(-2.0, -0.5), 1e-12), "{low}");
        assert!(high.abs_diff_eq(DVec2::new(1.0, 1.5), 1e-12), "{high}");
        assert!((found.near() - near as f32).abs() < 1e-5, "{found:?}");
    }
    let skewed = DMat4::from_scale(DVec3::new(1.0, 2.0, 1.0)) * view;
    assert!(View::from_matrices(skewed, forward).is_err());
    assert!(View::from_matrices(view, DMat4::IDENTITY * 2.0).is_err());
}

/// Cameras with a lens are read back as they were written, in a table and on the command line.
#[test]
fn lenses_are_read_as_written() {
    let pinhole = Lens::Pinhole {
        focal: DVec2::new(525.0, 520.5),
        principal: DVec2::new(319.5, 239.5),
        size: DVec2::new(640.0, 480.0),
    };
    for lens in [None, Some(Lens::Orthographic { height: 2.5 }), Some(pinhole)] {
        let camera = Camera { lens, ..on_axis(2.0, 40.0) };
        let table = toml::to_string(&camera).expect("a table");
        let read: Camera = toml::from_str(&table).expect("a camera");
        assert_eq!((read.eye, read.target, read.lens), (camera.eye, camera.target, lens));
        let text = camera.to_string();
        let parsed: Camera = text.parse().expect("a camera");
        assert_eq!((parsed.eye, parsed.lens), (camera.eye, lens), "{text}");
    }
    let posed: Camera = toml::from_str(
        "pose = [[1, 0, 0, 0.5], [0, -1, 0, 2.0], [0, 0, -1, 3.0], [0, 0, 0, 1]]\n\
         intrinsics = [525.0, 525.0, 320.0, 240.0]\nsize = [640, 480]",
    )
    .expect("a camera");
    assert_eq!(posed.eye, DVec3::new(0.5, 2.0, 3.0));
    assert_eq!(View::from(&posed).ahead(), DVec3::NEG_Z);
    for wrong in [
        "eye = [0, 0, 1]\nfov_y = 40.0",
        "eye = [0, 0, 1]\ntarget = [0, 0, 0]",
        "eye = [0, 0, 1]\ntarget = [0, 0, 0]\nfov_y = 40.0\nheight = 2.0",
        "pose = [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\nfov_y = 40.0",
        "eye = [0, 0, 1]\ntarget = [0, 0, 0]\nintrinsics = [1, 1, 1, 1]",
    ] {
        assert!(toml::from_str::<Camera>(wrong).is_err(), "{wrong}");
    }
}

/// A frame that the caller submits is that of a frame drawn at once, with times that are collected without
/// waiting; recording submits nothing.
#[test]
fn recorded_frames_are_those_drawn_at_once() {
    let Some(harness) = harness() else { return };
    let gpu = harness.gpu.clone();
    let (scene, splats) = drops();
    let camera = Camera { eye: DVec3::new(0.5, 0.9, 2.5), ..on_axis(0.0, 40.0) };
    let expected: RgbaImage = {
        let mut offscreen = Offscreen::new(&gpu);
        let input = FrameInput::new(&scene, &camera, &splats, SIZE);
        let drawn = offscreen.draw(input).expect("a frame");
        drawn.into_image().into_rgba8()
    };
    let mut renderer = limpid::renderer::Renderer::new(&gpu);
    let target = Picture::new(&gpu, SIZE).expect("a picture");
    let input = FrameInput::new(&scene, &camera, &splats, SIZE);
    let frame = renderer.prepare(FrameInput { timing: true, ..input }).expect("it is prepared");
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    renderer.record(frame, &mut encoder);
    let settings = &scene.settings.tonemap;
    renderer.tonemap(settings, &mut encoder, &target);
    let blank = target.read(&gpu).expect("it is read");
    assert!(blank.pixels().all(|p| p.0 == [0; 4]), "nothing is submitted by recording");
    gpu.queue.submit([encoder.finish()]);
    assert_eq!(target.read(&gpu).expect("it is read"), expected);
    let mut times = renderer.take_pass_times();
    for _ in 0..1000 {
        let _ = gpu.device.poll(wgpu::PollType::Poll);
        times = times.or_else(|| renderer.take_pass_times());
    }
    let times = times.expect("the frame is done");
    assert!(times.iter().any(|pass| pass.name == "refract"), "{times:?}");
    assert!(renderer.take_pass_times().is_none(), "times are taken once");
}

/// A frame that is awaited is that of a frame waited for, on a device that was opened without blocking.
#[test]
fn awaited_frames_are_those_waited_for() {
    if harness().is_none() {
        return;
    }
    let (scene, splats) = drops();
    let camera = Camera { eye: DVec3::new(0.5, 0.9, 2.5), ..on_axis(0.0, 40.0) };
    let gpu = pollster::block_on(Gpu::request()).expect("there is an adapter");
    let mut offscreen = Offscreen::new(&gpu);
    let input = FrameInput::new(&scene, &camera, &splats, SIZE);
    let expected = offscreen.draw(input).expect("a frame").picture;
    let pending = offscreen.begin(input).expect("a frame");
    let awaited = std::thread::spawn(|| pollster::block_on(pending.ready()));
    while !awaited.is_finished() {
        gpu.device.poll(wgpu::PollType::Poll).expect("it is polled");
        std::thread::yield_now();
    }
    let awaited = awaited.join().expect("no panic").expect("a frame");
    assert_eq!(awaited.picture, expected);
}

/// Targets of half floats get linear light, and a composed frame leaves what liquid does not cover.
#[test]
fn float_targets_are_linear_and_composed_over() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, splats) = drops();
    scene.solids.clear();
    scene.settings.refract.transparent = true;
    let camera = Camera { eye: DVec3::new(0.5, 0.9, 2.5), ..on_axis(0.0, 40.0) };
    let format = wgpu::TextureFormat::Rgba16Float;
    let texture = harness.gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("half floats"),
        size: wgpu::Extent3d { width: SIZE.x, height: SIZE.y, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let target = texture.create_view(&Default::default());
    let images = harness.render(&scene, &camera, &splats, SIZE);
    let gpu = harness.gpu.clone();
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let load = wgpu::LoadOp::Clear(wgpu::Color { r: 3.0, g: 0.25, b: 7.0, a: 1.0 });
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: &target,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
        })],
        ..Default::default()
    });
    harness.renderer.composite(&mut encoder, &target, format);
    gpu.queue.submit([encoder.finish()]);
    let read = || gpu.read_texture(&texture, 0).expect("it is read");
    let composed = halves(&read());
    for p in images.pixels() {
        let i = (p.y * SIZE.x + p.x) as usize;
        let covered = images.at("depth.aggregate_front", p) > 0.0;
        let expected = if covered { images.radiance(p) } else { DVec3::new(3.0, 0.25, 7.0) };
        let close = (composed[i] - expected).abs().cmple(1e-3 * expected.abs() + 1e-6);
        assert!(close.all(), "{p}: {}, expected {expected}", composed[i]);
    }
    scene.settings.refract.transparent = false;
    scene.environment = Environment::Constant(Vec3::new(4.0, 0.5, 0.25));
    let input = FrameInput::new(&scene, &camera, &splats, SIZE);
    harness.renderer.render(input, Target::View(&target, format)).expect("a frame");
    let nothing = images.pixels().find(|p| images.at("depth.aggregate_front", *p) == 0.0).unwrap();
    let linear = halves(&read())[(nothing.y * SIZE.x + nothing.x) as usize];
    assert_eq!(linear, DVec3::new(4.0, 0.5, 0.25), "neither bounded nor encoded");
}

/// Red, green and blue of pixels of four half floats.
fn halves(bytes: &[u8]) -> Vec<DVec3> {
    let half = |bytes: &[u8]| {
        let bits = u16::from_le_bytes([bytes[0], bytes[1]]);
        let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023) / 1024.0);
        let value = match exponent {
            0 => fraction * 2f64.powi(-14),
            _ => (1.0 + fraction) * 2f64.powi(exponent - 15),
        };
        if bits >> 15 == 1 { -value } else { value }
    };
    let pixel = |p: &[u8]| DVec3::new(half(&p[..2]), half(&p[2..4]), half(&p[4..6]));
    bytes.chunks_exact(8).map(pixel).collect()
}

/// Coverage is the share of rays that meet liquid or a solid: over black and over white, pixels without liquid
/// differ by what is not covered; liquid covers its pixels; colours are premultiplied.
#[test]
fn coverage_is_what_backgrounds_do_not_show_through() {
    let Some(harness) = harness() else { return };
    let gpu = harness.gpu.clone();
    let (mut scene, splats) = drops();
    let ball = Shape::Sphere { center: DVec3::new(-0.9, 0.1, 0.0), radius: 0.35 };
    scene.solids = vec![glowing(ball, Vec3::new(0.7, 0.4, 0.2))];
    scene.settings.refract.edge_samples = 16;
    let camera = Camera { eye: DVec3::new(0.0, 0.3, 3.0), ..on_axis(0.0, 45.0) };
    let mut offscreen = Offscreen::new(&gpu);
    let mut radiance = |scene: &Scene| {
        let input = FrameInput::new(scene, &camera, &splats, SIZE);
        let drawn = offscreen.draw(input).expect("a frame");
        (drawn.coverage, offscreen.radiance().expect("radiance").channels)
    };
    let opaque = [0.0, 1.0].map(|c| {
        scene.environment = Environment::Constant(Vec3::splat(c));
        let (coverage, channels) = radiance(&scene);
        assert!(coverage.is_none() && channels.len() == 3);
        channels
    });
    scene.settings.refract.transparent = true;
    scene.environment = Environment::Constant(Vec3::ZERO);
    let (coverage, covered) = radiance(&scene);
    let coverage = coverage.expect("coverage").into_raw();
    assert_eq!(covered.len(), 4);
    let alpha = &covered[3].values;
    let (mut partly, mut liquid) = (0, 0);
    for i in 0..alpha.len() {
        let shows = opaque[1][0].values[i] - opaque[0][0].values[i];
        assert!((f32::from(coverage[i]) - 255.0 * alpha[i]).abs() <= 0.51, "{i}");
        if alpha[i] == 1.0 && shows > 1.0 / 255.0 {
            liquid += 1; // which the background shows through, refracted
            continue;
        }
        assert!((1.0 - shows - alpha[i]).abs() <= 1.0 / 255.0, "{i}: {shows}, {}", alpha[i]);
        for c in 0..3 {
            let (over, black) = (covered[c].values[i], opaque[0][c].values[i]);
            assert!((over - black).abs() <= 1.0 / 255.0, "{i}: {over}, not {black}");
        }
        partly += usize::from(alpha[i] > 0.02 && alpha[i] < 0.98);
    }
    assert!(partly > 30 && liquid > 300, "{partly} {liquid}");
}
