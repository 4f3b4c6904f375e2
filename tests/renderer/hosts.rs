//! Liquid in the frame of a host: a program that has drawn its own opaque scene.

use std::sync::Arc;

use glam::dcamera::rh::proj::directx::{
    orthographic, perspective, perspective_infinite, perspective_infinite_reverse,
};
use glam::{DMat4, DVec2, DVec3, Quat, UVec2, Vec3};
use limpid::camera::{Camera, Projection, View};
use limpid::diffuse::Diffuse;
use limpid::environment::Environment;
use limpid::frame::FrameInput;
use limpid::host::{Host, HostRays};
use limpid::liquid::classify::Splats;
use limpid::mesh::Texture;
use limpid::scene::{Scene, Shape, Solid, Surface};
use limpid::wgpu;

use crate::support::frames::{
    FrameImages, Harness, diagnosed, ellipsoid, glowing, harness, mean_difference, on_axis, render,
    scene, splats,
};
use crate::support::hosts::{host_of, texture};

const SIZE: UVec2 = UVec2::new(128, 96);

/// A checkered floor, a ball and a sky, with a lens of liquid before them.
fn world() -> (Scene, Splats, Camera) {
    let mut scene = scene();
    let (even, odd) = (Vec3::new(0.9, 0.8, 0.6), Vec3::new(0.1, 0.2, 0.4));
    let floor = Shape::Plane { origin: DVec3::NEG_Y, normal: Vec3::Y, half_extent: 8.0 };
    let ball = Shape::Sphere { center: DVec3::new(0.5, -0.6, -1.5), radius: 0.4 };
    scene.solids = vec![
        Solid { shape: floor, surface: Surface::Checker { tile: 4.0, even, odd }, lit: false },
        glowing(ball, Vec3::new(0.8, 0.1, 0.1)),
    ];
    scene.environment = Environment::Gradient {
        zenith: Vec3::new(0.2, 0.4, 0.9),
        horizon: Vec3::ONE,
        nadir: Vec3::splat(0.3),
    };
    let camera = Camera { eye: DVec3::new(0.0, 0.5, 4.0), ..on_axis(4.0, 40.0) };
    let lens = ellipsoid(Vec3::new(-0.2, 0.0, 0.5), Vec3::new(0.7, 0.6, 0.12), Quat::IDENTITY);
    let splats = splats(&[lens], &[], 0.12);
    (scene, splats, camera)
}

/// Reversed, infinite perspective.
fn usual() -> DMat4 {
    let aspect = f64::from(SIZE.x) / f64::from(SIZE.y);
    perspective_infinite_reverse(40f64.to_radians(), aspect, 0.01)
}

/// A view of parallel rays from the same place, and its projection of reversed depth.
fn parallel(camera: &Camera) -> (View, DMat4) {
    let half = DVec2::new(2.0, 1.5);
    let projection = Projection::Orthographic { low: -half, high: half };
    let view = View { projection, near: Some(0.0), ..View::from(camera) };
    (view, orthographic(-half.x, half.x, -half.y, half.y, 20.0, 0.0))
}

/// The scene as a host's alone: limpid knows none of its solids.
fn hosted(
    harness: &mut Harness,
    scene: &Scene,
    host: &Host,
    view: View,
    splats: &Splats,
) -> FrameImages {
    let known = Scene { solids: Vec::new(), ..scene.clone() };
    let input = FrameInput { host: Some(host), ..diagnosed(&known, view, splats, SIZE) };
    render(&harness.gpu, &mut harness.renderer, input)
}

fn rays(harness: &mut Harness) -> HostRays {
    harness.gpu.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    // The first call asks for the counts.
    let counts = harness.renderer.take_host_rays();
    harness.gpu.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    counts.or_else(|| harness.renderer.take_host_rays()).expect("a frame with a host was drawn")
}

/// A scene looks the same whether its solids are known, or its colour and depth, in perspective and with
/// parallel rays.
#[test]
fn solids_and_their_picture_refract_alike() {
    let Some(mut harness) = harness() else { return };
    let harness = &mut *harness;
    let (scene, splats, camera) = world();
    for (view, clip_from_view) in [((&camera).into(), usual()), parallel(&camera)] {
        let known = harness.render(&scene, view, &splats, SIZE);
        let gpu = &harness.gpu;
        let host = host_of(gpu, &mut harness.renderer, &scene, view, SIZE, clip_from_view);
        let shown = hosted(harness, &scene, &host, view, &splats);
        let HostRays { rays, fallbacks } = rays(harness);
        shown.assert_finite();
        let difference = mean_difference(&known, &shown);
        let covered = |p: &UVec2| known.at("depth.aggregate_front", *p) > 0.0;
        let count = known.pixels().filter(covered).count();
        println!("difference {difference:.5}, {fallbacks} of {rays} rays, {count} pixels");
        assert!(difference < 0.004, "{difference}");
        // At least one ray of each pixel goes through the liquid.
        assert!(rays as usize > count && fallbacks > 0, "{fallbacks} of {rays}");
        assert!(((rays - fallbacks) as usize) > count / 2, "{fallbacks} of {rays}");
        // Beside the liquid the host's picture passes unchanged.
        for p in known.pixels().filter(|p| !covered(p)) {
            assert_eq!(known.radiance(p), shown.radiance(p), "{p}");
        }
        // A checker that can fail: another scene behind the liquid is noticed.
        let mut other = scene.clone();
        other.solids.truncate(1);
        let other =
            host_of(&harness.gpu, &mut harness.renderer, &other, view, SIZE, clip_from_view);
        let wrong = Host { color: other.color, ..host };
        let wrong = hosted(harness, &scene, &wrong, view, &splats);
        assert!(mean_difference(&known, &wrong) > 2.0 * difference);
    }
}

/// All encodings of depth give the same picture.
#[test]
fn every_projection_gives_the_same_picture() {
    let Some(mut harness) = harness() else { return };
    let harness = &mut *harness;
    let (scene, splats, camera) = world();
    let (fov, aspect) = (40f64.to_radians(), f64::from(SIZE.x) / f64::from(SIZE.y));
    let view = View::from(&camera);
    let mut draw = |clip_from_view: DMat4| {
        let host = host_of(&harness.gpu, &mut harness.renderer, &scene, view, SIZE, clip_from_view);
        hosted(harness, &scene, &host, view, &splats)
    };
    let usual = draw(usual());
    for clip_from_view in [
        perspective(fov, aspect, 0.05, 100.0),
        perspective(fov, aspect, 100.0, 0.05),
        perspective_infinite(fov, aspect, 0.05),
    ] {
        let other = draw(clip_from_view);
        let difference = mean_difference(&usual, &other);
        // Forward depths have fewer digits in the distance.
        assert!(difference < 2e-4, "{difference}: {clip_from_view}");
    }
}

/// A jittered and an off-centre view with a host show what the same views show of known solids.
#[test]
fn hosts_may_be_off_centre() {
    let Some(mut harness) = harness() else { return };
    let harness = &mut *harness;
    let (scene, splats, camera) = world();
    for shift in [0.66 / SIZE.as_dvec2(), DVec2::new(0.0, -0.2)] {
        let mut clip_from_view = usual();
        clip_from_view.z_axis += shift.extend(0.0).extend(0.0);
        let view = View::from(&camera);
        let eye = DMat4::from_translation(-view.eye);
        let view_from_world = DMat4::from_mat3(view.view_from_world) * eye;
        let view = View::from_matrices(view_from_world, clip_from_view).unwrap();
        let known = harness.render(&scene, view, &splats, SIZE);
        let host = host_of(&harness.gpu, &mut harness.renderer, &scene, view, SIZE, clip_from_view);
        let shown = hosted(harness, &scene, &host, view, &splats);
        // The lens magnifies edges, which the picture shows a pixel wide.
        let difference = mean_difference(&known, &shown);
        // A checker that can fail: the picture of another view.
        let other = host_of(&harness.gpu, &mut harness.renderer, &scene, &camera, SIZE, usual());
        let other = hosted(harness, &scene, &other, view, &splats);
        let wrong = mean_difference(&known, &other);
        println!("{shift}: {difference:.5}, of another view {wrong:.5}");
        assert!(difference < 0.01 && wrong > difference + 0.004, "{shift}: {difference}, {wrong}");
    }
}

/// A host's normals change nothing on planes, whose depths tell the same, and where they are missing, depths
/// take their place; wrong normals are seen.
#[test]
fn normals_of_a_host_are_used_where_it_has_them() {
    let Some(mut harness) = harness() else { return };
    let harness = &mut *harness;
    let (mut scene, splats, camera) = world();
    scene.solids.truncate(1);
    let view = View::from(&camera);
    let host = host_of(&harness.gpu, &mut harness.renderer, &scene, view, SIZE, usual());
    let plain = hosted(harness, &scene, &host, view, &splats);
    let mut with = |normal: Vec3, gap: usize| {
        let texel =
            |i: usize| if i.is_multiple_of(gap) { [0.0; 4] } else { normal.extend(0.0).to_array() };
        let texels: Vec<f32> = (0..(SIZE.x * SIZE.y) as usize).flat_map(texel).collect();
        let format = wgpu::TextureFormat::Rgba32Float;
        let normals = Some(texture(&harness.gpu, SIZE, format, &texels));
        let frame = hosted(harness, &scene, &Host { normals, ..host.clone() }, view, &splats);
        frame.assert_finite();
        mean_difference(&plain, &frame)
    };
    let (right, partial) = (with(3.0 * Vec3::Y, usize::MAX), with(0.1 * Vec3::Y, 3));
    let wrong = with(Vec3::new(1.0, 0.1, 0.0), usize::MAX);
    println!("{right:.6}, {partial:.6}, {wrong:.6}");
    assert!(right < 1e-3 && partial < 1e-3 && wrong > 2.0 * right.max(partial));
}

/// As solids do, the host's scene hides liquid behind it, in perspective and in orthographic views.
#[test]
fn hosts_hide_liquid_behind_them() {
    let Some(mut harness) = harness() else { return };
    let harness = &mut *harness;
    let (mut scene, splats, camera) = world();
    let wall = Shape::Box { min: DVec3::new(-0.3, -2.0, 1.2), max: DVec3::new(4.0, 2.0, 1.4) };
    scene.solids.push(glowing(wall, Vec3::new(0.1, 0.7, 0.2)));
    for (view, clip_from_view) in [((&camera).into(), usual()), parallel(&camera)] {
        let known = harness.render(&scene, view, &splats, SIZE);
        let gpu = &harness.gpu;
        let host = host_of(gpu, &mut harness.renderer, &scene, view, SIZE, clip_from_view);
        let shown = hosted(harness, &scene, &host, view, &splats);
        shown.assert_finite();
        let green = |p: &UVec2| known.radiance(*p).distance(DVec3::new(0.1, 0.7, 0.2)) < 1e-6;
        let pixels: Vec<_> = known.pixels().filter(green).collect();
        assert!(pixels.len() > 1000, "{} pixels of the wall", pixels.len());
        let differs = |p: &&UVec2| shown.radiance(**p) != known.radiance(**p);
        assert_eq!(pixels.iter().filter(differs).count(), 0);
    }
}

/// Solids that limpid is told of are met where the host's picture does not show its scene, and the picture is
/// preferred where it does.
#[test]
fn told_solids_are_found_outside_the_picture() {
    let Some(mut harness) = harness() else { return };
    let harness = &mut *harness;
    let (mut scene, splats, camera) = world();
    // Behind the eye, seen only by reflection.
    let behind = Shape::Plane { origin: DVec3::Z * 6.0, normal: Vec3::NEG_Z, half_extent: 20.0 };
    scene.solids.push(glowing(behind, Vec3::new(3.0, 0.0, 3.0)));
    let view = View::from(&camera);
    let known = harness.render(&scene, view, &splats, SIZE);
    let host = host_of(&harness.gpu, &mut harness.renderer, &scene, view, SIZE, usual());
    let without = hosted(harness, &scene, &host, view, &splats);
    let input = FrameInput { host: Some(&host), ..diagnosed(&scene, view, &splats, SIZE) };
    let told = render(&harness.gpu, &mut harness.renderer, input);
    let counts = rays(harness);
    let (without, told) = (mean_difference(&known, &without), mean_difference(&known, &told));
    println!("told {told:.5}, not told {without:.5}, {counts:?}");
    assert!(told < 0.004 && without > 2.0 * told, "{told}, {without}");
}

/// With `transparent` the host's scene is not in limpid's picture: coverage is that of the liquid.
#[test]
fn transparent_pictures_hold_the_liquid_alone() {
    let Some(mut harness) = harness() else { return };
    let harness = &mut *harness;
    let (mut scene, splats, camera) = world();
    scene.settings.refract.transparent = true;
    let host = host_of(&harness.gpu, &mut harness.renderer, &scene, &camera, SIZE, usual());
    let shown = hosted(harness, &scene, &host, (&camera).into(), &splats);
    let mut filled = 0;
    for p in shown.pixels() {
        let alpha = shown.picture.get_pixel(p.x, p.y).0[3];
        let liquid = shown.at("depth.aggregate_front", p) > 0.0;
        assert!(liquid || alpha == 0 && shown.radiance(p) == DVec3::ZERO, "{p}: {alpha}");
        assert!(!liquid || alpha > 0 || shown.radiance(p) == DVec3::ZERO, "{p}");
        filled += usize::from(liquid && alpha == 255);
    }
    assert!(filled > 500, "{filled} pixels of liquid");
}

/// A host's depth hides foam by the pixel as the solids that it shows do; without its depth all foam is seen.
#[test]
fn hosts_hide_foam() {
    let Some(mut harness) = harness() else { return };
    let harness = &mut *harness;
    let (scene, _, camera) = world();
    let nothing = Splats { radius: 1.0, ..Splats::default() };
    let view = View::from(&camera);
    let host = host_of(&harness.gpu, &mut harness.renderer, &scene, view, SIZE, usual());
    // Before and behind the ball, as seen from the eye: a large sphere, and a row of small ones across its rim. They are black, as
    // a host's solids light no foam.
    let ball = Vec3::new(0.5, -0.6, -1.5);
    let eye = camera.eye.as_vec3();
    let at = |way: f32, beside: f32| eye.lerp(ball, way) + beside * Vec3::X;
    let row = (0..60).map(|i| 0.02 * (i - 30) as f32);
    let small = row.flat_map(|x| [at(0.9, x), at(1.2, x)]);
    let places: Vec<_> = [at(0.8, 0.0), at(1.2, 0.1)].into_iter().chain(small).collect();
    let radii = (0..places.len()).map(|i| if i < 2 { 0.1 } else { 0.01 }).collect();
    let foam = Diffuse { radii, colors: [Vec3::ZERO; 4], ..Diffuse::from_positions(places, 0.1) };
    let foam = Arc::new(foam);
    let unknown = Scene { solids: Vec::new(), ..scene.clone() };
    let mut draw = |scene: &Scene, host: Option<&Host>, diffuse: Option<&Arc<Diffuse>>| {
        let input = FrameInput { host, diffuse, ..diagnosed(scene, view, &nothing, SIZE) };
        render(&harness.gpu, &mut harness.renderer, input)
    };
    let known = draw(&scene, None, Some(&foam));
    let shown = draw(&unknown, Some(&host), Some(&foam));
    let without = draw(&unknown, Some(&host), None);
    let (same, other) = (mean_difference(&known, &shown), mean_difference(&without, &shown));
    assert!(same < 0.1 * other, "{same} from that of known solids, {other} from that without foam");

    // A checker that can fail: nothing is hidden by a depth that was cleared.
    let cleared = vec![0.0; (SIZE.x * SIZE.y) as usize];
    let depth = texture(&harness.gpu, SIZE, wgpu::TextureFormat::R32Float, &cleared);
    let flat = Host { depth, ..host };
    let input = FrameInput {
        host: Some(&flat),
        diffuse: Some(&foam),
        ..diagnosed(&unknown, view, &nothing, SIZE)
    };
    let seen = render(&harness.gpu, &mut harness.renderer, input);
    assert!(mean_difference(&known, &seen) > 0.1 * other, "{}", mean_difference(&known, &seen));
}

/// Views that cannot be a host's are refused with what is wrong.
#[test]
fn unusable_hosts_are_refused() {
    let Some(mut harness) = harness() else { return };
    let harness = &mut *harness;
    let (scene, splats, camera) = world();
    let pixels = vec![0.5; (4 * SIZE.x * SIZE.y) as usize];
    let color = texture(&harness.gpu, SIZE, wgpu::TextureFormat::Rgba32Float, &pixels);
    let small = texture(&harness.gpu, SIZE / 2, wgpu::TextureFormat::R32Float, &pixels[..48 * 64]);
    let depth = texture(&harness.gpu, SIZE, wgpu::TextureFormat::R32Float, &pixels[..128 * 96]);
    let usable = Host { color, depth, normals: None, clip_from_view: usual() };
    let flat = DMat4::from_cols(usual().x_axis, usual().y_axis, usual().z_axis, glam::DVec4::ZERO);
    for (host, problem) in [
        (Host { depth: small, ..usable.clone() }, "host depth: its size is [64, 48]"),
        (Host { clip_from_view: flat, ..usable.clone() }, "all points the same depth"),
        (Host { clip_from_view: parallel(&camera).1, ..usable.clone() }, "is orthographic"),
        (Host { clip_from_view: -usual(), ..usable }, "looking down -z"),
    ] {
        let input = FrameInput { host: Some(&host), ..diagnosed(&scene, &camera, &splats, SIZE) };
        let error = harness.renderer.prepare(input).unwrap_err();
        assert!(error.to_string().contains(problem), "{error}");
    }
}

/// A background picture is seen unchanged beside the liquid, and through it as a host's sky is.
#[test]
fn backgrounds_are_seen_and_refracted() {
    let Some(mut harness) = harness() else { return };
    let harness = &mut *harness;
    let (mut scene, splats, camera) = world();
    scene.solids.clear();
    scene.settings.refract.edge_samples = 16;
    let pixel = |i: u32| {
        let (x, y) = (i % SIZE.x, i / SIZE.x);
        [(2 * x) as u8, (2 * y) as u8, if (x / 16 + y / 16) % 2 == 0 { 200 } else { 40 }, 255]
    };
    let pixels: Vec<_> = (0..SIZE.x * SIZE.y).map(pixel).collect();
    let texture = Texture::new(SIZE, pixels).unwrap();
    let linear = limpid::background::fitted(&texture, SIZE);
    scene.background = Some(Arc::new(texture));
    let nothing = Splats { radius: 1.0, ..Splats::default() };
    let alone = harness.render(&scene, &camera, &nothing, SIZE);
    let known = harness.render(&scene, &camera, &splats, SIZE);
    let covered = |p: &UVec2| known.at("depth.aggregate_front", *p) > 0.0;
    for p in known.pixels() {
        let [r, g, b, _] = linear[(p.y * SIZE.x + p.x) as usize];
        let expected = DVec3::new(r.into(), g.into(), b.into());
        assert!(alone.radiance(p).distance(expected) < 1e-6, "{p}: {}", alone.radiance(p));
        assert!(covered(&p) || known.radiance(p).distance(expected) < 1e-6, "{p}");
    }
    let color = self::texture(
        &harness.gpu,
        SIZE,
        wgpu::TextureFormat::Rgba32Float,
        bytemuck::cast_slice(&linear),
    );
    let cleared = vec![0.0; (SIZE.x * SIZE.y) as usize];
    let depth = self::texture(&harness.gpu, SIZE, wgpu::TextureFormat::R32Float, &cleared);
    let host = Host { color, depth, normals: None, clip_from_view: usual() };
    scene.background = None;
    let without = harness.render(&scene, &camera, &splats, SIZE);
    let hosted = hosted(harness, &scene, &host, (&camera).into(), &splats);
    assert!(mean_difference(&known, &hosted) < 1e-4, "{}", mean_difference(&known, &hosted));
    assert!(mean_difference(&without, &known) > 0.1);
}
