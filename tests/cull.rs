//! Culling of splats hidden inside a body leaves the layers bitwise unchanged.

#[path = "support/frames.rs"]
mod frames;

use std::collections::HashSet;

use frames::{
    FrameImages, Harness, gpu, harness, noise_vector, on_axis, render, scene, sphere, splats,
};
use glam::{DVec3, UVec2, Vec3};
use image::RgbaImage;
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::gpu::Gpu;
use limpid::liquid::Particles;
use limpid::liquid::classify::{Splat, Splats, classify};
use limpid::offscreen::Picture;
use limpid::passes::cull;
use limpid::renderer::Renderer;
use limpid::scene::{Light, Scene, Shape, Solid, Surface};

const SIZE: UVec2 = UVec2::new(160, 120);
/// Particles along the sides of the body.
const SIDE: usize = 46;
/// Half the particle spacing, m.
const R: f32 = 1.0 / SIDE as f32;

/// A slightly disordered cube from −1 to 1 m, with splats marked as by classification: all but two
/// layers on each side.
fn body() -> Splats {
    let mut seed = 5;
    let mut all = Vec::new();
    for i in 0..SIDE * SIDE * SIDE {
        let cell = [i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE];
        let place = Vec3::from_array(cell.map(|k| 2.0 * R * (k as f32 + 0.5) - 1.0));
        let inside = cell.iter().all(|&k| (2..SIDE - 2).contains(&k));
        let splat = sphere(place + 0.3 * R * noise_vector(&mut seed), 1.5 * R);
        all.push(Splat { tags: if inside { Splat::BURIED } else { 0 }, ..splat });
    }
    let buried = all.iter().filter(|splat| splat.is_buried()).count();
    assert!(buried >= cull::LEAST, "{buried} marked splats are too few for culling");
    splats(&all, &[], R)
}

/// The same splats without marks, so that all are drawn, in the same order.
fn unmarked(splats: &Splats) -> Splats {
    let mut all = splats.clone();
    all.aggregates.iter_mut().for_each(|splat| splat.tags &= !Splat::BURIED);
    all
}

/// Views from outside, at a slant, from near by, past an edge, from inside the liquid, and along a face.
fn views() -> [Camera; 6] {
    let looking = |eye: DVec3, target: DVec3| Camera { eye, target, ..on_axis(0.0, 50.0) };
    [
        on_axis(4.0, 40.0),
        looking(DVec3::new(2.5, 1.8, 2.9), DVec3::ZERO),
        looking(DVec3::new(0.1, 0.2, 1.15), DVec3::new(0.3, 0.0, 0.0)),
        looking(DVec3::new(1.4, 1.3, 1.2), DVec3::new(1.0, -0.6, -1.0)),
        looking(DVec3::new(0.1, 0.1, 0.2), DVec3::new(1.0, 0.3, -2.0)),
        looking(DVec3::new(0.0, 1.04, 3.0), DVec3::new(0.0, 0.97, 0.0)),
    ]
}

fn picture(harness: &mut Harness, scene: &Scene, camera: &Camera, splats: &Splats) -> RgbaImage {
    let target = Picture::new(&harness.gpu, SIZE).expect("a picture");
    let view = target.view();
    harness
        .renderer
        .render(scene, camera, splats, &view, Picture::FORMAT, SIZE)
        .expect("the frame is drawn");
    target.read(&harness.gpu).expect("the picture is read")
}

#[track_caller]
fn assert_same(a: &FrameImages, b: &FrameImages, what: &str) {
    for (name, values) in &a.channels {
        let differ = values.iter().zip(b.channel(name)).filter(|(x, y)| x.to_bits() != y.to_bits());
        assert_eq!(differ.count(), 0, "{what}: values of {name} differ");
    }
    assert_eq!(a.picture, b.picture, "{what}");
}

/// Culling does not change any image, in any view.
#[test]
fn culling_does_not_change_images() {
    let Some(mut harness) = harness() else { return };
    let (scene, marked) = (scene(), body());
    let all = unmarked(&marked);
    for (i, camera) in views().iter().enumerate() {
        let culled = harness.render(&scene, camera, &marked, SIZE);
        let drawn = harness.render(&scene, camera, &all, SIZE);
        assert_same(&culled, &drawn, &format!("view {i}"));
        let covered = culled.channel("depth.aggregate_front").iter().filter(|&&z| z > 0.0).count();
        assert!(covered > 2000, "view {i} shows {covered} pixels of liquid");
    }
}

/// Culling is exact in successive frames with more or fewer particles or another size.
#[test]
fn culling_is_exact_when_counts_and_sizes_change() {
    let Some(mut harness) = harness() else { return };
    let (scene, marked) = (scene(), body());
    let camera = &views()[1];
    // Includes counts just above a block, within the spare room of the first frame.
    let frames =
        [(67_328, SIZE), (75_700, SIZE), (60_000, SIZE), (75_700, SIZE / 2), (97_000, SIZE)];
    for (count, size) in frames {
        let part = Splats { aggregates: marked.aggregates[..count].to_vec(), ..marked.clone() };
        let culled = harness.render(&scene, camera, &part, size);
        let drawn = harness.render(&scene, camera, &unmarked(&part), size);
        assert_same(&culled, &drawn, &format!("{count} in {size}"));
    }
}

/// Devices whose bindings do not hold all splats cull in chunks, with the same result.
#[test]
fn culling_in_chunks_is_exact() {
    let Some(whole) = gpu() else { return };
    let wanted = whole.device.adapter_info();
    let descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    let adapters = wgpu::Instance::new(descriptor).enumerate_adapters(wanted.backend.into());
    let adapter = pollster::block_on(adapters).into_iter().find(|a| a.get_info() == wanted);
    let adapter = adapter.expect("the adapter of the other device");
    let required_limits =
        wgpu::Limits { max_storage_buffer_binding_size: 2 << 20, ..adapter.limits() };
    let descriptor = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
        .expect("limits below the adapter's");
    let small = Gpu::from_device(device, queue);
    let (scene, marked) = (scene(), body());
    assert!(size_of_val(&marked.aggregates[..]) > 2 * (2 << 20), "at least three chunks");
    let [parts, at_once] = [&small, &whole].map(|gpu| {
        let mut renderer = Renderer::new(gpu);
        renderer.diagnose = true;
        render(gpu, &mut renderer, &scene, &views()[1], &marked, SIZE)
    });
    assert_same(&parts, &at_once, "in chunks");
}

/// Wrong marks do not change depths: marks determine only which splats are drawn first.
#[test]
fn wrong_marks_do_not_change_depths() {
    let Some(mut harness) = harness() else { return };
    let (scene, marked) = (scene(), body());
    let camera = &views()[1];
    let drawn = harness.render(&scene, camera, &unmarked(&marked), SIZE);
    // Marks on all splats, on most regardless of position, and on many at the surface.
    let rules: [fn(usize, &Splat) -> bool; 3] =
        [|_, _| true, |i, _| i % 7 < 5, |i, splat| splat.is_buried() || i % 2 == 0];
    for (rule, marks) in rules.iter().enumerate() {
        let mut wrong = marked.clone();
        for (i, splat) in wrong.aggregates.iter_mut().enumerate() {
            splat.tags = if marks(i, splat) { Splat::BURIED } else { 0 };
        }
        assert!(wrong.aggregates.iter().filter(|splat| splat.is_buried()).count() >= cull::LEAST);
        // Splats at equal depths may be drawn in another order, so planes may differ there.
        let culled = harness.render(&scene, camera, &wrong, SIZE);
        for name in ["depth.aggregate_front", "depth.aggregate_back"] {
            assert_eq!(culled.channel(name), drawn.channel(name), "rule {rule}: {name}");
        }
    }
}

/// Culling is exact in the orthographic views of lights, and in frames that draw only fronts.
#[test]
fn culling_is_exact_for_lights_and_for_fronts_alone() {
    let Some(mut harness) = harness() else { return };
    let mut lit = scene();
    lit.environment = Environment::Constant(Vec3::splat(0.5));
    let floor = Shape::Box { min: DVec3::new(-3.0, -1.5, -3.0), max: DVec3::new(3.0, -1.2, 3.0) };
    lit.solids = vec![Solid { shape: floor, surface: Surface::Color(Vec3::ONE), lit: true }];
    let direction = Vec3::new(0.3, -1.0, 0.2);
    lit.lights = vec![Light::Sun { direction, irradiance: Vec3::ONE }];
    lit.settings.caustics.resolution = 96;
    lit.settings.caustics.grid = 96;
    let mut fronts = lit.clone();
    fronts.lights.clear();
    fronts.solids.clear();
    let [zenith, horizon, nadir] = [0.9, 0.5, 0.1].map(Vec3::splat);
    fronts.environment = Environment::Gradient { zenith, horizon, nadir };
    fronts.settings.refract.interfaces = 1;
    let marked = body();
    let all = unmarked(&marked);
    let camera = &views()[1];
    // With diagnostics, frames always draw backs.
    harness.renderer.diagnose = false;
    for (name, scene) in [("lit", &lit), ("fronts", &fronts)] {
        let [culled, drawn] =
            [&marked, &all].map(|splats| picture(&mut harness, scene, camera, splats));
        assert_eq!(culled, drawn, "{name}");
        // The picture is not uniform.
        let seen: HashSet<_> = culled.pixels().collect();
        assert!(seen.len() > 50, "{name} has {} colours", seen.len());
    }
    harness.renderer.diagnose = true;
}

/// Negative test: the comparison detects a single missing splat.
#[test]
fn missing_splat_is_detected() {
    let Some(mut harness) = harness() else { return };
    let (scene, marked) = (scene(), body());
    let camera = &views()[0];
    let whole = harness.render(&scene, camera, &marked, SIZE);
    let mut without = marked;
    // In the middle of the visible face.
    without.aggregates.remove((SIDE - 1) * SIDE * SIDE + (SIDE / 2) * SIDE + SIDE / 2);
    let holed = harness.render(&scene, camera, &without, SIZE);
    assert_ne!(whole.channel("depth.aggregate_front"), holed.channel("depth.aggregate_front"));
}

/// Classification marks most of a large body as surrounded, but no part of a sheet or drop.
#[test]
fn bodies_are_marked_as_surrounded_and_sheets_are_not() {
    let r = 0.02;
    let block = |counts: [usize; 3]| {
        let [x, y, z] = counts;
        let place = |i: usize| Vec3::new((i % x) as f32, (i / x % y) as f32, (i / x / y) as f32);
        let positions = (0..x * y * z).map(|i| 2.0 * r * place(i)).collect();
        let particles = Particles { positions, ..Default::default() };
        let splats = classify(&particles, r, &Default::default());
        splats.aggregates.iter().filter(|splat| splat.is_buried()).count()
    };
    let inside = block([20, 20, 20]);
    assert!((16usize.pow(3)..=18usize.pow(3)).contains(&inside), "{inside} of 8000");
    assert_eq!(block([40, 40, 1]), 0);
    assert_eq!(block([40, 40, 2]), 0);
    assert_eq!(block([2, 2, 2]), 0);
    assert_eq!(block([3, 3, 3]), 1, "the central particle");
}
