//! The lists of the splats that each tile needs: however they are made, each image has the same bits.

use glam::{DVec3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::gpu::{Gpu, Grain};
use limpid::liquid::classify::{Splat, Splats};
use limpid::renderer::Renderer;
use limpid::scene::{Light, Medium, Scene, Shape, Solid, Surface};

use crate::support::frames::{
    FrameImages, Harness, diagnosed, gpu, harness, limited, noise_vector, on_axis, render, scene,
    sphere, splats,
};

const SIZE: UVec2 = UVec2::new(161, 119);
/// Particles along the sides of the body.
const SIDE: usize = 24;
/// Half the particle spacing, m.
const R: f32 = 1.0 / SIDE as f32;

/// A slightly disordered cube from −1 to 1 m with an air gap in its middle, and drops in front of and behind it.
fn body() -> Splats {
    let mut seed = 5;
    let mut bodies = Vec::new();
    for i in 0..SIDE * SIDE * SIDE {
        let cell = [i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE];
        let place = Vec3::from_array(cell.map(|k| 2.0 * R * (k as f32 + 0.5) - 1.0));
        if place.z.abs() > 0.25 {
            bodies.push(sphere(place + 0.3 * R * noise_vector(&mut seed), 1.5 * R));
        }
    }
    let mut drops = Vec::new();
    for i in 0..400 {
        let place = 1.8 * noise_vector(&mut seed);
        let fluid = u32::from(i % 3 == 0);
        drops.push(Splat { tags: fluid, ..sphere(place, 0.02 + 0.001 * (i % 40) as f32) });
    }
    splats(&bodies, &drops, R)
}

/// Two fluids, so that mixtures are summed.
fn mixed() -> Scene {
    let mut scene = scene();
    scene.fluids = [Vec3::new(1.0, 0.2, 0.1), Vec3::new(0.1, 3.0, 0.4)].map(Medium::clear).to_vec();
    scene
}

/// Views from outside, at a slant, from near by, past an edge, from inside the liquid, and along a face.
fn views() -> [Camera; 6] {
    let looking = |eye: DVec3, target: DVec3| Camera { eye, target, ..on_axis(0.0, 50.0) };
    [
        on_axis(4.0, 40.0),
        looking(DVec3::new(2.5, 1.8, 2.9), DVec3::ZERO),
        looking(DVec3::new(0.1, 0.2, 1.15), DVec3::new(0.3, 0.0, 0.0)),
        looking(DVec3::new(1.4, 1.3, 1.2), DVec3::new(1.0, -0.6, -1.0)),
        looking(DVec3::new(0.1, 0.1, 0.4), DVec3::new(1.0, 0.3, -2.0)),
        looking(DVec3::new(0.0, 1.04, 3.0), DVec3::new(0.0, 0.97, 0.0)),
    ]
}

#[track_caller]
fn assert_same(a: &FrameImages, b: &FrameImages, what: &str) {
    for (name, values) in &a.channels {
        let differ = values.iter().zip(b.channel(name)).filter(|(x, y)| x.to_bits() != y.to_bits());
        assert_eq!(differ.count(), 0, "{what}: values of {name} differ");
    }
    assert_eq!(a.picture, b.picture, "{what}");
}

fn draw(gpu: &Gpu, scene: &Scene, camera: &Camera, splats: &Splats) -> FrameImages {
    render(gpu, &mut Renderer::new(gpu), diagnosed(scene, camera, splats, SIZE))
}

/// A thread for a pixel, or for a column of pixels: the same bits, in all views, of the camera and of lights.
#[test]
fn grains_draw_the_same() {
    let Some(gpu) = gpu() else { return };
    let liquid = body();
    let mut lit = mixed();
    lit.environment = Environment::Constant(Vec3::splat(0.5));
    let floor = Shape::Box { min: DVec3::new(-3.0, -1.5, -3.0), max: DVec3::new(3.0, -1.2, 3.0) };
    lit.solids = vec![Solid { shape: floor, surface: Surface::Color(Vec3::ONE), lit: true }];
    let direction = Vec3::new(0.3, -1.0, 0.2);
    lit.lights = vec![Light::Sun { direction, irradiance: Vec3::ONE }];
    lit.settings.caustics.resolution = 96;
    lit.settings.caustics.grid = 96;
    let [pixels, columns] =
        [Grain::Pixel, Grain::Column].map(|grain| gpu.clone().with_grain(grain));
    for (i, camera) in views().iter().enumerate() {
        let scene = if i == 1 { &lit } else { &mixed() };
        let [a, b] = [&pixels, &columns].map(|gpu| draw(gpu, scene, camera, &liquid));
        assert_same(&a, &b, &format!("view {i}"));
        let covered = a.channel("depth.aggregate_front").iter().filter(|&&z| z > 0.0).count();
        assert!(covered > 2000, "view {i} shows {covered} pixels of liquid");
    }
}

/// Lists that exceed the memory for them are made for one band of tiles after the other, and splats that exceed a
/// binding are drawn in chunks, with the same result.
#[test]
fn bands_and_chunks_draw_the_same() {
    let Some(whole) = gpu() else { return };
    let scene = mixed();
    // Bindings of 6,000 splats, whose lists have at most 72,000 entries.
    let small = limited(&whole, |limits| limits.max_storage_buffer_binding_size = 288_000);
    for camera in [&views()[1], &views()[2], &views()[4]] {
        let mut liquid = body();
        assert!(liquid.aggregates.len() > 6000, "two chunks");
        // Spheres behind all else that fill the picture: each is in the list of each tile.
        let forward = (camera.target - camera.eye).normalize();
        let (backs, tiles) = (300, 21 * 15);
        assert!(backs * tiles > 72_000, "several bands");
        for i in 0..backs {
            let centre = camera.eye + (40.0 + 0.01 * i as f64) * forward;
            liquid.aggregates.insert(19 * i, sphere(centre.as_vec3(), 35.0));
        }
        for grain in [Grain::Pixel, Grain::Column] {
            let [parts, at_once] = [&small, &whole]
                .map(|gpu| draw(&gpu.clone().with_grain(grain), &scene, camera, &liquid));
            assert_same(&parts, &at_once, &format!("{grain:?}"));
            let front = at_once.channel("depth.aggregate_front");
            assert!(front.iter().all(|&z| z > 0.0), "the spheres fill the picture");
        }
    }
}

/// The order of the lists differs from run to run; pictures do not.
#[test]
fn runs_draw_the_same() {
    let Some(mut harness) = harness() else { return };
    let (scene, liquid) = (mixed(), body());
    let camera = &views()[1];
    let first = harness.render(&scene, camera, &liquid, SIZE);
    for run in 0..3 {
        let again = draw(&harness.gpu, &scene, camera, &liquid);
        assert_same(&first, &again, &format!("run {run}"));
    }
}

/// Successive frames with more or fewer particles, or of another size, are drawn as in a new renderer.
#[test]
fn frames_do_not_depend_on_those_before() {
    let Some(mut harness) = harness() else { return };
    let (scene, all) = (mixed(), body());
    let camera = &views()[1];
    let whole = all.aggregates.len();
    for (count, size) in
        [(whole / 2, SIZE), (whole, SIZE), (1, SIZE), (whole, SIZE / 2), (0, SIZE), (whole, SIZE)]
    {
        let part = Splats { aggregates: all.aggregates[..count].to_vec(), ..all.clone() };
        let next = harness.render(&scene, camera, &part, size);
        let mut renderer = Renderer::new(&harness.gpu);
        let new = render(&harness.gpu, &mut renderer, diagnosed(&scene, camera, &part, size));
        assert_same(&next, &new, &format!("{count} in {size}"));
    }
}

/// Splats that cover hundreds of tiles, beside and before many small ones, are all drawn.
#[test]
fn large_splats_are_drawn_everywhere() {
    let Some(mut harness) = harness() else { return };
    let mut liquid = body();
    // In front of all else, over the whole picture.
    liquid.aggregates.insert(77, sphere(Vec3::new(0.0, 0.0, -40.0), 43.5));
    let frame = harness.render(&scene(), &on_axis(4.0, 40.0), &liquid, SIZE);
    let front = frame.channel("depth.aggregate_front");
    assert!(front.iter().all(|&z| z > 0.0 && z < 1.5), "the sphere is in front everywhere");
}

/// Negative test: the comparison detects a single missing splat.
#[test]
fn missing_splat_is_detected() {
    let Some(mut harness) = harness() else { return };
    let (scene, liquid) = (mixed(), body());
    let camera = &views()[0];
    let whole = harness.render(&scene, camera, &liquid, SIZE);
    let mut without = liquid;
    without.aggregates.pop();
    let holed = render_again(&mut harness, &scene, camera, &without);
    assert_ne!(whole.channel("depth.aggregate_front"), holed.channel("depth.aggregate_front"));
}

fn render_again(
    harness: &mut Harness,
    scene: &Scene,
    camera: &Camera,
    splats: &Splats,
) -> FrameImages {
    harness.render(scene, camera, splats, SIZE)
}
