//! Particles in buffers of the device are drawn as those of the host.

use glam::{DVec3, UVec2, Vec3};
use image::{DynamicImage, RgbImage};
use limpid::camera::{Camera, Lens};
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::liquid::classify::{Classifier, Cloud, Splats, add_wall_contacts};
use limpid::liquid::{Attribute, Counter, DeviceParticles, Particles};
use limpid::motion::Motion;
use limpid::scene::{Light, Scene, Shape};
use limpid::settings::Classify;
use limpid::wgpu;
use limpid_lab::compare::{PIXELS_PER_DEGREE, flip};

use crate::support::frames::{
    FrameImages, Harness, diagnosed, glowing, harness, noise, noise_vector, on_axis, render,
};

const R: f32 = 0.025;
const SIZE: UVec2 = UVec2::new(160, 120);

/// A disordered body with a bump, a sheet beside it, and droplets above.
fn liquid() -> Vec<Vec3> {
    let mut seed = 5;
    let lattice = |count: [i32; 3], step: f32| {
        let of = move |k: usize| (0..count[k]).map(move |i| (i - count[k] / 2) as f32 * step * R);
        of(0).flat_map(move |x| of(1).flat_map(move |y| of(2).map(move |z| Vec3::new(x, y, z))))
    };
    let mut places: Vec<Vec3> = lattice([20, 8, 14], 2.0).collect();
    places.extend(lattice([6, 10, 6], 2.0));
    places.extend(lattice([1, 16, 16], 1.8).map(|p| p + Vec3::new(0.85, 0.15, 0.0)));
    for place in &mut places {
        *place += 0.3 * R * noise_vector(&mut seed);
    }
    places.extend((0..60).map(|_| Vec3::new(0.0, 0.7, 0.0) + 0.4 * noise_vector(&mut seed)));
    places
}

fn storage<T: bytemuck::NoUninit>(gpu: &Gpu, values: &[T]) -> wgpu::Buffer {
    gpu.buffer_with("test", wgpu::BufferUsages::STORAGE, values)
}

/// Particles at places that lie one after the other in a buffer.
fn packed(positions: &wgpu::Buffer, count: usize) -> DeviceParticles<'_> {
    DeviceParticles {
        positions: Attribute { buffer: positions, offset: 0, stride: 12 },
        count: count as u32,
        counter: None,
        radius: R,
        radii: None,
        origin: DVec3::ZERO,
        bounds: (DVec3::splat(-1.2), DVec3::splat(1.2)),
    }
}

fn words(places: &[Vec3]) -> Vec<f32> {
    places.iter().flat_map(|place| place.to_array()).collect()
}

/// Classifies particles on the device, where they stay.
fn record(gpu: &Gpu, classifier: &Classifier, particles: &DeviceParticles<'_>) -> Splats {
    record_in(gpu, classifier, particles, &Scene::default())
}

/// The same in a scene with solids.
fn record_in(
    gpu: &Gpu,
    classifier: &Classifier,
    particles: &DeviceParticles<'_>,
    scene: &Scene,
) -> Splats {
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let splats = classifier.record(&mut encoder, particles, scene);
    gpu.queue.submit([encoder.finish()]);
    splats.expect("particles in buffers")
}

fn camera() -> Camera {
    Camera { eye: DVec3::new(0.5, 0.9, 2.6), ..on_axis(0.0, 40.0) }
}

fn lit() -> Scene {
    let mut scene = Scene::around(DVec3::splat(-0.5), DVec3::splat(0.5), R);
    let direction = Vec3::new(0.3, -1.0, -0.2);
    scene.lights = vec![Light::Sun { direction, irradiance: Vec3::splat(2.0) }];
    scene
}

fn picture(images: &FrameImages) -> RgbImage {
    DynamicImage::ImageRgba8(images.picture.clone()).into_rgb8()
}

fn mean_flip(a: &FrameImages, b: &FrameImages) -> f64 {
    flip(&picture(a), &picture(b), PIXELS_PER_DEGREE).expect("of one size").mean()
}

fn assert_same_bits(a: &FrameImages, b: &FrameImages) {
    for (name, values) in &a.channels {
        let differ = values.iter().zip(b.channel(name)).filter(|(a, b)| a.to_bits() != b.to_bits());
        assert_eq!(differ.count(), 0, "{name}");
    }
}

/// The shared harness and a classifier; `None` without an adapter.
fn open() -> Option<(std::sync::MutexGuard<'static, Harness>, Classifier)> {
    let harness = harness()?;
    let classifier = Classifier::new(&harness.gpu).expect("WebGPU's limits");
    Some((harness, classifier))
}

/// Pictures from the device's particles are those of the host's, from outside, from within the bounds, and with parallel
/// rays; and they have the same bits in every run.
#[test]
fn pictures_are_those_of_the_host() {
    let Some((mut harness, classifier)) = open() else { return };
    let gpu = harness.gpu.clone();
    let places = liquid();
    let positions = storage(&gpu, &words(&places));
    let particles = Particles::from_positions(places.clone());
    let bounds = particles.bounds().expect("particles");
    let on_device = DeviceParticles { bounds, ..packed(&positions, places.len()) };
    let cloud = Cloud::new(&particles, R);
    let on_host = cloud.classify_each(&Classify::default());
    let by_tree = cloud.classify_by_tree(&Classify::default());
    let within = Camera { eye: DVec3::new(0.2, 0.45, 0.95), ..camera() };
    let parallel = Camera { lens: Some(Lens::Orthographic { height: 2.0 }), ..camera() };
    let views = [("outside", camera()), ("within", within), ("parallel", parallel)];
    let scene = Scene::around(DVec3::splat(-0.5), DVec3::splat(0.5), R);
    for (name, view) in views {
        let expected = harness.render(&scene, &view, &on_host, SIZE);
        let splats = record(&gpu, &classifier, &on_device);
        let found = harness.render(&scene, &view, &splats, SIZE);
        let mean = mean_flip(&expected, &found);
        let by_tree = mean_flip(&expected, &harness.render(&scene, &view, &by_tree, SIZE));
        eprintln!("{name}: mean FLIP {mean:.1e}, by the tree {by_tree:.1e}");
        // Rays amplify the last bits, in which the host's ways differ too.
        assert!(mean < 3e-3, "{name}: {mean}");
        let splats = record(&gpu, &classifier, &on_device);
        assert_same_bits(&found, &harness.render(&scene, &view, &splats, SIZE));
    }
    // Particles that are not drawn are noticed.
    let fewer = DeviceParticles { count: on_device.count - 200, ..on_device };
    let splats = record(&gpu, &classifier, &fewer);
    let expected = harness.render(&scene, &camera(), &on_host, SIZE);
    let mean = mean_flip(&expected, &harness.render(&scene, &camera(), &splats, SIZE));
    assert!(mean > 4e-3, "{mean}");
}

/// Bodies wet a floor, a thin wall, a box and a ball as those of the host do; without that the pictures differ.
#[test]
fn bodies_wet_solids() {
    let Some((mut harness, classifier)) = open() else { return };
    let gpu = harness.gpu.clone();
    let places = liquid();
    let positions = storage(&gpu, &words(&places));
    let particles = Particles::from_positions(places.clone());
    let bounds = particles.bounds().expect("particles");
    let on_device = DeviceParticles { bounds, ..packed(&positions, places.len()) };
    let mut scene = Scene::around(bounds.0, bounds.1, R);
    let solid = |shape| glowing(shape, Vec3::new(0.2, 0.5, 0.1));
    let plane = |origin, normal| Shape::Plane { origin, normal, half_extent: 0.4 };
    let min = DVec3::new(0.1, 0.2, -0.2);
    scene.solids.extend([
        solid(plane(DVec3::new(-0.53, 0.0, 0.0), Vec3::NEG_X)),
        solid(Shape::Box { min, max: min + 0.3 }),
        solid(Shape::Sphere { center: DVec3::new(-0.2, 0.35, 0.1), radius: 0.12 }),
    ]);
    let unwetted = Cloud::new(&particles, R).classify_each(&Classify::default());
    let mut on_host = unwetted.clone();
    add_wall_contacts(&mut on_host, &scene.solids, scene.settings.classify.wetting);
    assert!(on_host.aggregates.len() > unwetted.aggregates.len() + 200);
    let expected = harness.render(&scene, &camera(), &on_host, SIZE);
    let splats = record_in(&gpu, &classifier, &on_device, &scene);
    let mean = mean_flip(&expected, &harness.render(&scene, &camera(), &splats, SIZE));
    let without = mean_flip(&expected, &harness.render(&scene, &camera(), &unwetted, SIZE));
    eprintln!("mean FLIP {mean:.1e}; without copies {without:.1e}");
    assert!(mean < 3e-3 && without > 5.0 * mean, "{mean}, {without}");
}

/// A simulation in a basin that is far larger than its liquid: wider cells, not a crowd.
#[test]
fn liquid_in_a_large_basin_is_no_crowd() {
    let Some((mut harness, classifier)) = open() else { return };
    let gpu = harness.gpu.clone();
    let places = liquid();
    let positions = storage(&gpu, &words(&places));
    let tight = packed(&positions, places.len());
    let wide = DeviceParticles { bounds: (DVec3::splat(-20.0), DVec3::splat(20.0)), ..tight };
    let scene = Scene::around(DVec3::splat(-0.5), DVec3::splat(0.5), R);
    let [expected, found] = [tight, wide].map(|particles| {
        let splats = record(&gpu, &classifier, &particles);
        harness.render(&scene, &camera(), &splats, SIZE)
    });
    let mean = mean_flip(&expected, &found);
    eprintln!("mean FLIP {mean:.1e}");
    assert!(mean < 4e-3, "{mean}");
}

/// Motion vectors come from the host's velocities, one for each particle, whatever its splats were copied to; and frames
/// that reuse the last one's images draw the particles that there are now.
#[test]
fn frames_of_the_device_have_motion_and_reuse() {
    let Some((mut harness, classifier)) = open() else { return };
    let gpu = harness.gpu.clone();
    let places = liquid();
    let positions = storage(&gpu, &words(&places));
    let particles = packed(&positions, places.len());
    let scene = Scene::around(DVec3::splat(-0.5), DVec3::splat(0.5), R);
    let motion = Motion { velocities: vec![Vec3::X; places.len()], seconds: 0.1, previous: None };
    let splats = record_in(&gpu, &classifier, &particles, &scene);
    let camera = camera();
    let input = FrameInput { reuse: true, ..diagnosed(&scene, &camera, &splats, SIZE) };
    let input = FrameInput { surface: Some(&motion), ..input };
    let first = render(&gpu, &mut harness.renderer, input);
    let moves = first.channel("motion.X").iter().filter(|&&x| x > 1.0).count();
    assert!(moves > 1000, "{moves} pixels");
    // The same frame again, and one of other particles in the same buffers.
    let again = render(&gpu, &mut harness.renderer, input);
    assert_same_bits(&first, &again);
    let fewer = DeviceParticles { count: particles.count / 2, ..particles };
    let splats = record_in(&gpu, &classifier, &fewer, &scene);
    let input = FrameInput { reuse: true, ..diagnosed(&scene, &camera, &splats, SIZE) };
    let found = render(&gpu, &mut harness.renderer, input);
    assert!(mean_flip(&first, &found) > 0.01);
    assert_same_bits(&harness.render(&scene, &camera, &splats, SIZE), &found);
}

/// No particles, before any others.
#[test]
fn no_particles_are_nothing() {
    let Some((mut harness, classifier)) = open() else { return };
    let gpu = harness.gpu.clone();
    let positions = storage(&gpu, &[0.0f32; 3]);
    let splats = record(&gpu, &classifier, &packed(&positions, 0));
    let scene = Scene::around(DVec3::splat(-0.5), DVec3::splat(0.5), R);
    let found = harness.render(&scene, &camera(), &splats, SIZE);
    let nothing = Splats { radius: R, ..Splats::default() };
    assert_same_bits(&harness.render(&scene, &camera(), &nothing, SIZE), &found);
}

/// Lights see the device's particles.
#[test]
fn lights_see_particles_of_the_device() {
    let Some((mut harness, classifier)) = open() else { return };
    let gpu = harness.gpu.clone();
    let places = liquid();
    let positions = storage(&gpu, &words(&places));
    let particles = Particles::from_positions(places.clone());
    let on_host = Cloud::new(&particles, R).classify_each(&Classify::default());
    let bounds = particles.bounds().expect("particles");
    let on_device = DeviceParticles { bounds, ..packed(&positions, places.len()) };
    let expected = harness.render(&lit(), &camera(), &on_host, SIZE);
    let splats = record(&gpu, &classifier, &on_device);
    let mean = mean_flip(&expected, &harness.render(&lit(), &camera(), &splats, SIZE));
    let nothing = Splats { radius: R, ..Splats::default() };
    let dark = mean_flip(&expected, &harness.render(&lit(), &camera(), &nothing, SIZE));
    eprintln!("mean FLIP {mean:.1e}; without liquid {dark:.1e}");
    // The maps frame other boxes.
    assert!(mean < 0.01 && dark > 0.05, "{mean}, {dark}");
}

/// Any layout of the buffers: particles in structs behind a header, a number of particles that only the device knows,
/// and radii.
#[test]
fn layouts_of_buffers_do_not_matter() {
    let Some((mut harness, classifier)) = open() else { return };
    let gpu = harness.gpu.clone();
    let places = liquid();
    let positions = storage(&gpu, &words(&places));
    let plain = packed(&positions, places.len());
    let scene = Scene::around(DVec3::splat(-0.5), DVec3::splat(0.5), R);
    let splats = record(&gpu, &classifier, &plain);
    let expected = harness.render(&scene, &camera(), &splats, SIZE);

    // Five words a particle after three others, the last of them its radius.
    let mut structs = vec![f32::NAN; 3];
    structs.extend(places.iter().flat_map(|p| [p.x, p.y, p.z, 7.0, R]));
    let structs = storage(&gpu, &structs);
    let of_structs = DeviceParticles {
        positions: Attribute { buffer: &structs, offset: 12, stride: 20 },
        ..plain
    };
    let splats = record(&gpu, &classifier, &of_structs);
    assert_same_bits(&expected, &harness.render(&scene, &camera(), &splats, SIZE));
    let with_radii = DeviceParticles {
        radii: Some(Attribute { buffer: &structs, offset: 12 + 16, stride: 20 }),
        ..of_structs
    };
    let splats = record(&gpu, &classifier, &with_radii);
    let found = harness.render(&scene, &camera(), &splats, SIZE);
    // Planes bear the sizes of their particles then.
    assert!(mean_flip(&expected, &found) < 2e-3);

    // Room for more particles than there are.
    let mut more = places.clone();
    more.extend((0..500).map(|i| Vec3::splat(0.001 * i as f32)));
    let more = storage(&gpu, &words(&more));
    let counts = storage(&gpu, &[99, places.len() as u32]);
    let counted = DeviceParticles {
        counter: Some(Counter { buffer: &counts, offset: 4 }),
        ..packed(&more, places.len() + 500)
    };
    let splats = record(&gpu, &classifier, &counted);
    assert_same_bits(&expected, &harness.render(&scene, &camera(), &splats, SIZE));

    // Deep in a buffer of several kinds of data.
    let mut arena = vec![f32::NAN; 1000];
    arena.extend(words(&places));
    let arena = storage(&gpu, &arena);
    let in_arena = DeviceParticles {
        positions: Attribute { buffer: &arena, offset: 4000, stride: 12 },
        ..plain
    };
    let splats = record(&gpu, &classifier, &in_arena);
    assert_same_bits(&expected, &harness.render(&scene, &camera(), &splats, SIZE));

    // And none at all.
    let none = storage(&gpu, &[0u32]);
    let none = DeviceParticles { counter: Some(Counter { buffer: &none, offset: 0 }), ..counted };
    let splats = record(&gpu, &classifier, &none);
    let empty = Splats { radius: R, ..Splats::default() };
    let empty = harness.render(&scene, &camera(), &empty, SIZE);
    assert_eq!(mean_flip(&empty, &harness.render(&scene, &camera(), &splats, SIZE)), 0.0);
}

/// Particles that cannot be drawn are left out, whatever their numbers.
#[test]
fn particles_that_are_not_numbers_are_left_out() {
    let Some((mut harness, classifier)) = open() else { return };
    let gpu = harness.gpu.clone();
    let places = liquid();
    let scene = Scene::around(DVec3::splat(-0.5), DVec3::splat(0.5), R);
    let positions = storage(&gpu, &words(&places));
    let splats = record(&gpu, &classifier, &packed(&positions, places.len()));
    let expected = harness.render(&scene, &camera(), &splats, SIZE);
    let mut dirty = places;
    dirty.extend([Vec3::NAN, Vec3::INFINITY, Vec3::new(0.0, f32::NEG_INFINITY, 0.1)]);
    let radii: Vec<f32> = dirty.iter().map(|_| R).chain([f32::NAN, 0.0, -1.0]).collect();
    dirty.extend([Vec3::ZERO; 3]);
    let positions = storage(&gpu, &words(&dirty));
    let radii = storage(&gpu, &radii);
    let with_radii = DeviceParticles {
        radii: Some(Attribute { buffer: &radii, offset: 0, stride: 4 }),
        ..packed(&positions, dirty.len())
    };
    let splats = record(&gpu, &classifier, &with_radii);
    let found = harness.render(&scene, &camera(), &splats, SIZE);
    found.assert_finite();
    assert!(mean_flip(&expected, &found) < 2e-3);
}

/// Where lists are longer than was expected, nothing is dropped: the bounds say that the particles are far away, while they
/// are in front of the eye.
#[test]
fn wrong_bounds_drop_nothing() {
    let Some((mut harness, classifier)) = open() else { return };
    let gpu = harness.gpu.clone();
    let places = liquid();
    let positions = storage(&gpu, &words(&places));
    let right = packed(&positions, places.len());
    let far = DVec3::new(0.0, 0.0, -200.0);
    let wrong = DeviceParticles { bounds: (far - 1.0, far + 1.0), ..right };
    let scene = Scene::around(DVec3::splat(-0.5), DVec3::splat(0.5), R);
    let near = Camera { eye: DVec3::new(0.1, 0.3, 0.75), ..camera() };
    // The other way round, tiles that are not drawn would show the right frame.
    let [found, expected] = [wrong, right].map(|particles| {
        let splats = record(&gpu, &classifier, &particles);
        harness.render(&scene, &near, &splats, 2 * SIZE)
    });
    // Fewer cells: sums in another order.
    assert!(mean_flip(&expected, &found) < 2e-3);
}

/// More neighbours than there is time for: spheres.
#[test]
fn crowds_are_spheres() {
    let Some((mut harness, classifier)) = open() else { return };
    let gpu = harness.gpu.clone();
    let mut seed = 3;
    let places: Vec<Vec3> = (0..3000).map(|_| Vec3::splat(0.01 * noise(&mut seed))).collect();
    let positions = storage(&gpu, &words(&places));
    let splats = record(&gpu, &classifier, &packed(&positions, places.len()));
    let scene = Scene::around(DVec3::splat(-0.5), DVec3::splat(0.5), R);
    let images = harness.render(&scene, &camera(), &splats, SIZE);
    images.assert_finite();
    let nothing = Splats { radius: R, ..Splats::default() };
    let nothing = harness.render(&scene, &camera(), &nothing, SIZE);
    let (drawn, without) = (picture(&images), picture(&nothing));
    let covered = drawn.pixels().zip(without.pixels()).filter(|(a, b)| a != b).count();
    assert!((5..200).contains(&covered), "{covered} pixels");
}

/// Buffers that do not fit are refused with the reason, and nothing is recorded.
#[test]
fn wrong_buffers_are_refused() {
    let Some((harness, classifier)) = open() else { return };
    let gpu = &harness.gpu;
    let positions = storage(gpu, &[0.0f32; 30]);
    let right = packed(&positions, 10);
    let copied = gpu.buffer_with("test", wgpu::BufferUsages::COPY_SRC, &[0.0f32; 30]);
    let at = |buffer, offset, stride| Attribute { buffer, offset, stride };
    let wrong = [
        (DeviceParticles { count: 11, ..right }, "120 bytes"),
        (DeviceParticles { positions: at(&positions, 4, 12), ..right }, "124"),
        (DeviceParticles { positions: at(&positions, 0, 8), ..right }, "stride of 8"),
        (DeviceParticles { positions: at(&positions, 2, 12), ..right }, "offset of 2"),
        (DeviceParticles { positions: at(&copied, 0, 12), ..right }, "STORAGE"),
        (DeviceParticles { radii: Some(at(&copied, 0, 4)), ..right }, "radii"),
        (DeviceParticles { radius: 0.0, ..right }, "radius of 0"),
        (DeviceParticles { radius: f32::NAN, ..right }, "radius of NaN"),
        (DeviceParticles { bounds: (DVec3::ONE, DVec3::ZERO), ..right }, "bounds"),
        (DeviceParticles { bounds: (DVec3::MIN, DVec3::MAX), ..right }, "bounds"),
        (
            DeviceParticles { counter: Some(Counter { buffer: &positions, offset: 120 }), ..right },
            "counter",
        ),
    ];
    for (particles, reason) in wrong {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let refused = classifier.record(&mut encoder, &particles, &Scene::default());
        let message = refused.map(|_| ()).expect_err(reason).to_string();
        assert!(message.starts_with("particles: ") && message.contains(reason), "{message}");
    }
}
