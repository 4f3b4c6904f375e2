//! Classification on the device: the same splats as the CPU's tree finds, for any particles.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use glam::{DVec3, UVec2, Vec3};
use image::{DynamicImage, RgbImage};
use limpid::camera::Camera;
use limpid::error::Limited;
use limpid::gpu::Gpu;
use limpid::liquid::classify::{Classifier, Cloud, Splat, Splats, classify};
use limpid::liquid::{Ellipsoid, Particles};
use limpid::scene::Scene;
use limpid::settings::{Classify, Kernel};
use limpid::wgpu;
use limpid_io::error::Error;
use limpid_io::shared_classifier::Processor;
use limpid_io::shared_classifier::SharedClassifier;
use limpid_lab::compare::{PIXELS_PER_DEGREE, flip};

use crate::support::frames::{gpu, harness, noise, noise_vector, on_axis};

const R: f32 = 0.025;

/// Tolerances of centres and of the entries of A, in r, and of densities, relative to that at rest:
/// those documented in `src/liquid/classify/device.rs`.
const TOLERANCE: f32 = 1e-4;
const DENSITY_TOLERANCE: f32 = 1e-5;

/// Tolerance of splats that are moved to the iso-surface. Where the surface is only just found or not, and where marks
/// differ, one in a thousand may be anywhere.
const REFINED_TOLERANCE: f32 = 1e-3;

/// The default settings without the iso-surface.
fn unrefined() -> Classify {
    Classify { iso_surface: false, ..Default::default() }
}

/// The classifier shared by these tests; `None` without an adapter.
fn classifier() -> Option<&'static Classifier> {
    static CLASSIFIER: OnceLock<Option<Classifier>> = OnceLock::new();
    let open = || Some(Classifier::new(&gpu()?).expect("WebGPU's limits"));
    CLASSIFIER.get_or_init(open).as_ref()
}

fn cloud(positions: impl IntoIterator<Item = Vec3>) -> Particles {
    Particles::from_positions(positions.into_iter().collect())
}

/// A lattice centred on the origin, with `count` points along each axis; the step in r.
fn lattice(count: [i32; 3], step: f32) -> Vec<Vec3> {
    let axis = |k: usize| (0..count[k]).map(move |i| (i as f32 - (count[k] / 2) as f32) * step * R);
    axis(0)
        .flat_map(|x| axis(1).flat_map(move |y| axis(2).map(move |z| Vec3::new(x, y, z))))
        .collect()
}

/// Random particles in a cube, at a density relative to that at rest.
fn random(count: usize, seed: u64, density: f32) -> Vec<Vec3> {
    let mut seed = seed;
    let side = R * (count as f32 / density).cbrt();
    (0..count).map(|_| side * noise_vector(&mut seed)).collect()
}

/// A body, spray around it, and a few stray particles.
fn liquid(count: usize, seed: u64) -> Vec<Vec3> {
    let spray = random(count / 4, seed + 1, 0.15);
    let far = [Vec3::MAX, Vec3::MIN, 1e20 * Vec3::X, -1e30 * Vec3::ONE];
    random(count - count / 4, seed, 1.0).into_iter().chain(spray).chain(far).collect()
}

/// The splats of both lists by particle, and whether each is a splash.
fn by_particle(splats: &Splats) -> BTreeMap<u32, (bool, &Splat)> {
    let aggregates = splats.aggregates.iter().map(|splat| (splat.particle, (false, splat)));
    let splashes = splats.splashes.iter().map(|splat| (splat.particle, (true, splat)));
    aggregates.chain(splashes).collect()
}

/// Compares splats with those of the CPU's tree: returns the errors of centres and of entries of A,
/// in r. Differences in exact properties are errors.
fn compare(found: &Splats, cloud: &Cloud, settings: &Classify) -> Result<[f32; 2], String> {
    let tree = cloud.classify_by_tree(settings);
    if (found.radius, found.origin) != (tree.radius, tree.origin) {
        return Err(format!("{} at {}, not {}", found.radius, found.origin, tree.radius));
    }
    for list in [&found.aggregates, &found.splashes] {
        if !list.is_sorted_by_key(|splat| splat.particle) {
            return Err("not in the order of the file".into());
        }
    }
    // The classes that hold whatever the rounding.
    let with = |by: f32| {
        let splash_density = settings.splash_density + by;
        cloud.classify_by_tree(&Classify { splash_density, ..settings.clone() })
    };
    let (low, high) = (with(-DENSITY_TOLERANCE), with(DENSITY_TOLERANCE));
    let (low, high, tree) = (by_particle(&low), by_particle(&high), by_particle(&tree));
    let found_by = by_particle(found);
    if !found_by.keys().eq(tree.keys())
        || found_by.len() != found.aggregates.len() + found.splashes.len()
    {
        return Err(format!("{} splats, not {}", found_by.len(), tree.len()));
    }
    let mut worst = [0.0f32; 2];
    let refined = settings.iso_surface && settings.kernel == Kernel::Fitted;
    let tolerance = if refined { REFINED_TOLERANCE } else { TOLERANCE };
    let mut exceptions = if refined { found.aggregates.len() / 1000 } else { 0 };
    // Marks are a heuristic with its own threshold, where rounding may decide.
    let mut marks = 0;
    for (particle, (splash, a)) in found_by {
        let (expected, b) = tree[&particle];
        if low[&particle].0 && !splash || !high[&particle].0 && splash {
            return Err(format!("{particle} is splash: {splash}"));
        }
        if (a.radius, a.fluid()) != (b.radius, b.fluid()) {
            return Err(format!("{a:?}, not {b:?}"));
        }
        if splash != expected {
            continue;
        }
        marks += usize::from(a.is_buried() != b.is_buried());
        // `max_element` would hide a NaN.
        let off = |a: [f32; 3], b: [f32; 3]| {
            let off = (Vec3::from(a) - Vec3::from(b)).abs();
            if off.is_finite() { off.max_element() } else { f32::INFINITY }
        };
        let axes = off(a.diagonal, b.diagonal).max(off(a.off_diagonal, b.off_diagonal));
        let errors = [off(a.centre, b.centre), axes];
        for (worst, error) in worst.iter_mut().zip(errors) {
            let error = error / a.radius;
            if error > tolerance {
                if error.is_finite() && exceptions > 0 {
                    exceptions -= 1;
                    continue;
                }
                return Err(format!("{error:e} r: {a:?}, not {b:?}"));
            }
            *worst = worst.max(error);
        }
    }
    if marks > found.aggregates.len() / 1000 {
        return Err(format!("{marks} marks of {}", found.aggregates.len()));
    }
    Ok(worst)
}

/// Asserts that the device handles these particles and finds the same as the tree.
#[track_caller]
fn assert_equal(name: &str, particles: &Particles, settings: &Classify) {
    let Some(classifier) = classifier() else { return };
    let cloud = Cloud::new(particles, R);
    let served = classifier.classify_on_device(&cloud, settings).expect("the device works");
    let splats = served.unwrap_or_else(|| panic!("{name}: falls back to the CPU"));
    match compare(&splats, &cloud, settings) {
        Ok([centres, axes]) => {
            eprintln!("{name}: centres within {centres:.1e} r, axes within {axes:.1e} r");
        }
        Err(problem) => panic!("{name}: {problem}"),
    }
}

/// The tested settings: the defaults, those without refinement, volume-preserving kernels with the papers' ratio, and
/// everything an aggregate.
fn tested_settings() -> [Classify; 4] {
    let volume =
        Classify { kernel: Kernel::Volume, max_ratio: 4.0, smoothing: 0.9, ..Default::default() };
    let all =
        Classify { splash_density: 0.0, max_ratio: 4.0, long_axis: 100.0, ..Default::default() };
    [Classify::default(), unrefined(), volume, all]
}

/// Shapes with equal or vanishing eigenvalues, and neighbours exactly at the edge of the support,
/// which a lattice has many of.
#[test]
fn lattices_sheets_lines_pairs_and_one_match_the_cpu() {
    let triangle = vec![Vec3::ZERO, Vec3::X * 2.0 * R, Vec3::new(1.0, 3f32.sqrt(), 0.0) * R];
    let shapes = [
        ("block", lattice([9, 10, 11], 2.0)),
        ("sheet", lattice([17, 17, 1], 2.0)),
        ("two sheets", lattice([15, 2, 15], 2.6)),
        ("line", lattice([1, 21, 1], 2.0)),
        ("dense line", lattice([101, 1, 1], 0.2)),
        ("triangle", triangle),
        ("pair", lattice([2, 1, 1], 1.0)),
        ("one", vec![Vec3::new(1.0, 2.0, 3.0)]),
    ];
    for (name, points) in shapes {
        for settings in tested_settings() {
            assert_equal(name, &cloud(points.clone()), &settings);
        }
    }
}

/// The neighbour search: neighbourhoods from the smallest to the largest, in bodies, in spray, at
/// the grid's border and beyond it.
#[test]
fn liquid_matches_the_cpu() {
    let liquid = cloud(liquid(6000, 1));
    for settings in tested_settings() {
        assert_equal("liquid", &liquid, &settings);
    }
    for support in [1.0, 2.0, 5.5, 10.0] {
        let settings = Classify { support, ..Default::default() };
        assert_equal(&format!("support {support}"), &cloud(random(3000, 2, 1.0)), &settings);
    }
}

/// Particles of different radii: the rows of cells that a large particle visits, and volumes as
/// weights.
#[test]
fn different_radii_match_the_cpu() {
    let mut seed = 3;
    let positions = liquid(5000, 4);
    for spread in [1.5, 3.9] {
        let radius = |_: &Vec3| R * f32::powf(spread, 2.0 * noise(&mut seed) - 1.0);
        let radii = Some(positions.iter().map(radius).collect());
        let particles = Particles { radii, ..cloud(positions.clone()) };
        for settings in tested_settings() {
            assert_equal(&format!("radii by {spread}"), &particles, &settings);
        }
    }
}

/// Precision: coincident and nearly coincident particles, far away, tiny and huge ones.
#[test]
fn duplicates_and_far_particles_match_the_cpu() {
    let settings = Classify::default();
    let body = random(1000, 5, 1.0);
    assert_equal("coincident", &cloud([Vec3::new(0.1, -7.3, 12.5); 50]), &settings);
    assert_equal("doubled", &cloud(body.iter().chain(&body).copied()), &settings);
    let close = [Vec3::ZERO, Vec3::X * 1e-30, Vec3::Y * 1e-20, Vec3::Z * 1e-7 * R];
    assert_equal("close", &cloud(close), &settings);
    let by = Vec3::new(8192.0, -4096.0, 8000.0);
    assert_equal("far", &cloud(body.iter().map(|&p| p + by)), &settings);
    let origin = DVec3::new(1e5 + 0.123, -7e4 - 0.456, 3e4 + 0.789);
    assert_equal("far origin", &Particles { origin, ..cloud(body.clone()) }, &settings);
    for scale in [1e-9, 1e9] {
        let radii = Some(vec![R * scale; body.len()]);
        let particles = Particles { radii, ..cloud(body.iter().map(|&p| p * scale)) };
        assert_equal(&format!("{scale:e} times as large"), &particles, &settings);
    }
}

/// Any number of particles: partial blocks of the sort and partial workgroups; an empty frame is
/// valid.
#[test]
fn any_particle_count_matches_the_cpu() {
    let settings = Classify::default();
    for count in [1, 2, 63, 64, 65, 255, 256, 257, 2047, 2048, 2049] {
        assert_equal(&format!("{count}"), &cloud(random(count, 6, 1.0)), &settings);
    }
    // As many cells as the particles can occupy, several blocks of them.
    assert_equal("spray", &cloud(random(9000, 7, 0.02)), &settings);
    let Some(classifier) = classifier() else { return };
    let none = classifier.classify(&Particles::default(), R, &settings).expect("the device works");
    assert_eq!(none, classify(&Particles::default(), R, &settings));
}

/// Data added by the host: fluids, omitted particles, and shapes from the file.
#[test]
fn fluids_gaps_and_given_shapes_match_the_cpu() {
    let mut positions = liquid(2000, 8);
    positions[7] = Vec3::splat(f32::NAN);
    let count = positions.len();
    let mut radii = vec![R; count];
    radii[11] = 0.0;
    let fluids = (0..count).map(|i| (i % 3) as u8).collect();
    let shape = |i: usize| Ellipsoid { xx: 1.0 + (i % 5) as f32 * 0.2, ..Ellipsoid::SPHERE };
    let particles = Particles {
        radii: Some(radii),
        fluids: Some(fluids),
        ellipsoids: Some((0..count).map(shape).collect()),
        ..cloud(positions)
    };
    assert_equal("fluids", &particles, &Classify::default());
}

/// Cells deep inside a large body have one splat, those that have it on the CPU.
#[test]
fn interiors_match_the_cpu() {
    let Some(classifier) = classifier() else { return };
    let mut seed = 17;
    let block = lattice([70, 64, 62], 2.0);
    let block = block.into_iter().map(|p| p + 0.3 * R * noise_vector(&mut seed));
    let particles = cloud(block.filter(|p| p.distance(Vec3::ONE) > 10.0 * R));
    let on_cpu = classify(&particles, R, &Classify::default());
    let served = classifier.classify_on_device(&Cloud::new(&particles, R), &Classify::default());
    let found = served.expect("the device works").expect("a grid");
    let interior = |splats: &Splats| {
        let interior = splats.aggregates.iter().filter(|splat| splat.is_interior());
        let mut interior: Vec<Splat> = interior.copied().collect();
        interior.sort_by_key(|splat| splat.particle);
        interior
    };
    let (expected, spheres) = (interior(&on_cpu), interior(&found));
    assert!(expected.len() > 5000, "{}", expected.len());
    assert_eq!(expected.len(), spheres.len());
    for (a, b) in expected.iter().zip(&spheres) {
        assert_eq!((a.particle, a.tags), (b.particle, b.tags));
        let apart = Vec3::from(a.centre).distance(Vec3::from(b.centre));
        assert!(apart < TOLERANCE * R && (a.diagonal[1] - b.diagonal[1]).abs() < TOLERANCE * R);
    }
    let all = |splats: &Splats| [splats.aggregates.len(), splats.splashes.len()];
    assert_eq!(all(&on_cpu), all(&found));
    let moved = |(a, b): (&Splat, &Splat)| {
        Vec3::from(a.centre).distance(Vec3::from(b.centre)) > REFINED_TOLERANCE * R
    };
    let outside = on_cpu.aggregates.iter().zip(&found.aggregates);
    let apart = outside.filter(|(a, _)| !a.is_interior()).filter(|&pair| moved(pair)).count();
    assert!(apart < on_cpu.aggregates.len() / 1000, "{apart} splats");
}

/// Reproducibility: results do not depend on the order of threads, on earlier classifications, or
/// on concurrent calls.
#[test]
fn classification_is_deterministic() {
    let Some(classifier) = classifier() else { return };
    let settings = Classify::default();
    let body = cloud(liquid(8000, 9));
    let classified = |particles: &Particles| {
        classifier.classify(particles, R, &settings).expect("the device works")
    };
    let first = classified(&body);
    classified(&cloud(random(300, 10, 1.0)));
    // Repeated because threads often happen to run in the same order.
    for again in 0..20 {
        assert!(first == classified(&body), "{again}");
    }
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..3).map(|_| scope.spawn(|| classified(&body))).collect();
        for thread in threads {
            assert!(first == thread.join().expect("no panic"), "with others");
        }
    });
}

/// Particles that no grid can handle are classified by the CPU, bit-identically.
#[test]
fn unsupported_particles_fall_back_to_the_cpu() {
    let Some(classifier) = classifier() else { return };
    let settings = Classify::default();
    let mut radii = vec![R; 500];
    radii[0] = 9.0 * R;
    let body = random(500, 11, 1.0);
    let unlike = Particles { radii: Some(radii), ..cloud(body.clone()) };
    let wide = cloud(body.iter().map(|&p| 1e6 * p));
    let crowd = cloud([Vec3::ONE; 3000]);
    for (name, particles) in [("radii", unlike), ("wide", wide), ("crowd", crowd)] {
        let found = classifier.classify_on_device(&Cloud::new(&particles, R), &settings);
        assert!(found.expect("the device works").is_none(), "{name}");
        let splats = classifier.classify(&particles, R, &settings).expect("the device works");
        assert!(splats == classify(&particles, R, &settings), "{name}");
    }
}

/// Opens a device of the best adapter with limits changed by `limit`.
fn limited(limit: impl Fn(&mut wgpu::Limits)) -> Option<Gpu> {
    gpu()?;
    let descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    let instance = wgpu::Instance::new(descriptor);
    let adapter = pollster::block_on(instance.request_adapter(&Default::default())).ok()?;
    let mut required_limits = adapter.limits();
    limit(&mut required_limits);
    let descriptor = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
    let (device, queue) =
        pollster::block_on(adapter.request_device(&descriptor)).expect("less than it has");
    Some(Gpu::from_device(device, queue))
}

/// Small devices: frames larger than one binding are classified by the CPU, and a device that
/// cannot run the shaders is rejected with the limit that it lacks.
#[test]
fn frames_that_do_not_fit_fall_back_to_the_cpu() {
    let small = limited(|limits| limits.max_storage_buffer_binding_size = 48 * 1024);
    let Some(small) = small else { return };
    let classifier = Classifier::new(&small).expect("WebGPU's limits but for the binding");
    let settings = Classify::default();
    for (count, fits) in [(1000, true), (1100, false)] {
        let particles = cloud(random(count, 12, 1.0));
        let found = classifier.classify_on_device(&Cloud::new(&particles, R), &settings);
        assert_eq!(found.expect("the device works").is_some(), fits, "{count}");
        let splats = classifier.classify(&particles, R, &settings).expect("the device works");
        compare(&splats, &Cloud::new(&particles, R), &settings).expect("as on the CPU");
    }
    let weak = limited(|limits| limits.max_compute_invocations_per_workgroup = 128);
    let refused = Classifier::new(&weak.expect("there is one")).map(|_| ());
    assert!(matches!(&refused, Err(limpid::Error::Limit { of: Limited::Classify, .. })));
}

/// The `classify.on` setting: a request for the device is satisfied or refused with a reason;
/// otherwise the choice affects only speed and never fails.
#[test]
fn settings_choose_the_processor() {
    let particles = cloud(random(9000, 13, 1.0));
    let settings = Classify::default();
    let expected = classify(&particles, R, &Classify::default());
    let without_device = SharedClassifier::default();
    for processor in [Processor::Auto, Processor::Cpu] {
        let splats =
            without_device.classify(&particles, R, &settings, processor).expect("the CPU is there");
        assert!(splats == expected);
    }
    let refused = without_device.classify(&particles, R, &settings, Processor::Gpu);
    assert!(matches!(&refused, Err(Error::Usage(problem)) if problem.contains("classify.on")));

    let Some(gpu) = gpu() else { return };
    let shared = SharedClassifier::on(&gpu);
    let on_device =
        shared.classify(&particles, R, &settings, Processor::Gpu).expect("the device works");
    assert!(on_device != expected, "sums in another order differ in some bit");
    compare(&on_device, &Cloud::new(&particles, R), &Classify::default()).expect("as on the CPU");
    let auto = shared.classify(&particles, R, &settings, Processor::Auto).expect("never an error");
    let software = gpu.device.adapter_info().device_type == wgpu::DeviceType::Cpu;
    assert!(auto == *if software { &expected } else { &on_device });
    assert!(
        shared.classify(&particles, R, &settings, Processor::Cpu).expect("the CPU is there")
            == expected
    );

    // A caller that needs a device waits for it, or for the report that there is none.
    for (gpu, works) in [(Some(&gpu), true), (None, false)] {
        let shared = SharedClassifier::awaited();
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| shared.classify(&particles, R, &settings, Processor::Gpu));
            // A caller that does not need it does not wait.
            assert!(shared.classify(&particles, R, &settings, Processor::Cpu).is_ok());
            shared.set(gpu);
            let came = waiting.join().expect("no panic");
            assert_eq!(came.is_ok_and(|splats| splats == on_device), works);
        });
        // A closed classifier stays closed.
        shared.close();
        shared.set(gpu);
        assert!(shared.classify(&particles, R, &settings, Processor::Gpu).is_err());
    }
}

fn picture(splats: &Splats) -> Option<RgbImage> {
    const SIZE: UVec2 = UVec2::new(160, 120);
    let mut harness = harness()?;
    let scene = Scene::around(DVec3::splat(-0.5), DVec3::splat(0.5), R);
    let camera = Camera { eye: DVec3::new(0.6, 0.8, 1.8), ..on_axis(0.0, 35.0) };
    let images = harness.render(&scene, &camera, splats, SIZE);
    Some(DynamicImage::ImageRgba8(images.picture).into_rgb8())
}

/// Pictures do not visibly depend on where their particles were classified.
#[test]
fn pictures_match() {
    let Some(classifier) = classifier() else { return };
    let settings = Classify::default();
    let mut seed = 14;
    let body =
        lattice([16, 12, 16], 2.0).into_iter().map(|p| p + 0.3 * R * noise_vector(&mut seed));
    let particles = cloud(body.chain(random(100, 15, 0.01)));
    let on_device = classifier.classify(&particles, R, &settings).expect("the device works");
    let on_cpu = Cloud::new(&particles, R).classify_by_tree(&settings);
    assert!(on_cpu.splashes.len() > 20 && on_cpu.aggregates.len() > 3000);
    let (Some(a), Some(b)) = (picture(&on_device), picture(&on_cpu)) else { return };
    let mean = flip(&b, &a, PIXELS_PER_DEGREE).expect("of one size").mean();
    eprintln!("mean FLIP {mean:.1e}");
    // The CPU's grid and its tree differ by half of this: rays amplify the last bits.
    assert!(mean < 2e-3, "{mean}");
    // The comparison detects a shift of a tenth of a radius.
    let mut moved = on_device;
    moved.aggregates.iter_mut().for_each(|splat| splat.centre[0] += 0.1 * R);
    let seen = flip(&b, &picture(&moved).expect("as before"), PIXELS_PER_DEGREE);
    let seen = seen.expect("of one size").mean();
    assert!(seen > 1e-2, "{seen}");
}

/// The comparison above detects every kind of difference.
#[test]
fn comparison_detects_planted_differences() {
    let settings = unrefined();
    let particles = cloud(liquid(1000, 16));
    let cloud = Cloud::new(&particles, R);
    let right = cloud.classify_by_tree(&settings);
    assert_eq!(compare(&right, &cloud, &settings), Ok([0.0; 2]));
    let planted = |change: &dyn Fn(&mut Splats)| {
        let mut wrong = right.clone();
        change(&mut wrong);
        compare(&wrong, &cloud, &settings)
    };
    let little = 2.0 * TOLERANCE * R;
    assert!(planted(&|s| s.aggregates[3].centre[1] += little).is_err());
    assert!(planted(&|s| s.aggregates[3].diagonal[2] += little).is_err());
    assert!(planted(&|s| s.aggregates[3].off_diagonal[0] += little).is_err());
    assert!(planted(&|s| s.aggregates[3].centre[0] = f32::NAN).is_err());
    assert!(planted(&|s| s.splashes[3].centre[1] += little).is_err());
    assert!(planted(&|s| s.aggregates.swap(4, 5)).is_err());
    assert!(planted(&|s| s.aggregates.truncate(9)).is_err());
    assert!(planted(&|s| s.aggregates[9].tags = 1).is_err());
    assert!(planted(&|s| s.aggregates.iter_mut().for_each(|s| s.tags ^= Splat::BURIED)).is_err());
    assert!(planted(&|s| s.radius = 2.0 * R).is_err());
    let changed = |s: &mut Splats| {
        let splat = s.splashes.remove(2);
        let at = s.aggregates.partition_point(|other| other.particle < splat.particle);
        s.aggregates.insert(at, splat);
    };
    assert!(planted(&changed).is_err_and(|problem| problem.contains("splash")));
}
