//! Classification and splat shapes: known answers and invariances.

mod densities;
mod iso_surface;
mod shapes;

use glam::{DVec3, Mat3, Vec3};
use iso_surface::unrefined;
use limpid::liquid::Particles;
use limpid::liquid::classify::{Cloud, Splat, Splats, add_wall_contacts, classify};
use limpid::scene::{Shape, Solid, Surface};
use limpid::settings::{Classify, Kernel};

const R: f32 = 0.025;

fn cloud(positions: impl IntoIterator<Item = Vec3>) -> Particles {
    Particles { positions: positions.into_iter().collect(), ..Default::default() }
}

/// Lattice centred on the origin with `count` points along each axis; `step` in r.
fn lattice(count: [i32; 3], step: [f32; 3]) -> Vec<Vec3> {
    let axis =
        |k: usize| (0..count[k]).map(move |i| (i as f32 - (count[k] / 2) as f32) * step[k] * R);
    axis(0)
        .flat_map(|x| axis(1).flat_map(move |y| axis(2).map(move |z| Vec3::new(x, y, z))))
        .collect()
}

/// Uniform in 0 to 1, from a linear congruential generator (Knuth's MMIX).
fn noise(seed: &mut u64) -> f32 {
    *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*seed >> 40) as f32 / (1u64 << 24) as f32
}

/// Random particles in a cube, at about the density of a body at rest.
fn random(count: usize, seed: u64) -> Vec<Vec3> {
    let mut seed = seed;
    let side = 2.0 * R * (count as f32).cbrt();
    (0..count).map(|_| Vec3::from_array([(); 3].map(|()| noise(&mut seed))) * side).collect()
}

/// Index of the particle at the origin.
fn middle(positions: &[Vec3]) -> u32 {
    positions.iter().position(|&p| p == Vec3::ZERO).expect("a particle at the origin") as u32
}

fn all(splats: &Splats) -> impl Iterator<Item = &Splat> {
    splats.aggregates.iter().chain(&splats.splashes)
}

fn find(splats: &Splats, particle: u32) -> Splat {
    *all(splats).find(|s| s.particle == particle).expect("a splat for the particle")
}

fn is_splash(splats: &Splats, particle: u32) -> bool {
    splats.splashes.iter().any(|s| s.particle == particle)
}

fn matrix(splat: &Splat) -> Mat3 {
    let [xx, yy, zz] = splat.diagonal;
    let [xy, xz, yz] = splat.off_diagonal;
    Mat3::from_cols_array_2d(&[[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
}

/// World position of a splat.
fn place_of(splats: &Splats, splat: &Splat) -> DVec3 {
    splats.origin + Vec3::from_array(splat.centre).as_dvec3()
}

/// Every splat is finite, with positive definite A.
fn assert_drawable(splats: &Splats) {
    for splat in all(splats) {
        let a = matrix(splat).as_dmat3() * (1.0 / f64::from(splat.radius));
        assert!(a.is_finite() && splat.centre.iter().all(|c| c.is_finite()), "{splat:?}");
        let minor = a.x_axis.x * a.y_axis.y - a.x_axis.y * a.y_axis.x;
        assert!(a.x_axis.x > 0.0 && minor > 0.0 && a.determinant() > 0.0, "{splat:?}");
    }
}

/// Semi-axes along x, y and z, in r, of an axis-aligned ellipsoid.
fn aligned_axes(splat: &Splat) -> Vec3 {
    let off = Vec3::from_array(splat.off_diagonal).abs().max_element();
    assert!(off < 1e-5 * splat.radius, "not aligned: {splat:?}");
    Vec3::from_array(splat.diagonal) / splat.radius
}

#[track_caller]
fn assert_axes(splat: &Splat, expected: [f32; 3]) {
    let axes = aligned_axes(splat);
    assert!(axes.abs_diff_eq(expected.into(), 1e-4), "{axes}, not {expected:?}");
}

/// Settings without splashes, without a cap on the long axis, and without the refinement of the surface.
fn bare(kernel: Kernel) -> Classify {
    Classify {
        iso_surface: false,
        splash_density: 0.0,
        max_ratio: 4.0,
        kernel,
        short_axis: 1.4,
        long_axis: 100.0,
        ..Default::default()
    }
}

/// Settings with round numbers, independent of the defaults.
fn round() -> Classify {
    Classify {
        splash_density: 0.2,
        short_axis: 1.4,
        long_axis: 2.8,
        splash_radius: 1.0,
        max_ratio: 4.0,
        smoothing: 0.9,
        ..Default::default()
    }
}

/// A frame without particles is valid.
#[test]
fn no_particles_give_no_splats() {
    let splats = classify(&Particles::default(), R, &Classify::default());
    assert_eq!(splats, Splats { radius: R, ..Default::default() });
}

/// Classification does not depend on the distance from the origin, within 1e-5 r, and splats near the
/// origin are relative to it.
#[test]
fn far_clouds_keep_their_precision() {
    let settings = Classify::default();
    // With 10 fractional bits, so that 32-bit floats are exact at 8192 m too.
    let body: Vec<_> = random(1000, 31).iter().map(|p| (p * 1024.0).round() / 1024.0).collect();
    let near = classify(&cloud(body.clone()), R, &settings);
    assert_eq!(near.origin, DVec3::ZERO);
    let by = DVec3::new(8192.0, -4096.0, 8000.0);
    let exact = cloud(body.iter().map(|&p| p + by.as_vec3()));
    let elsewhere = DVec3::new(1e5 + 0.123, -7e4 - 0.456, 3e4 + 0.789);
    let counted = Particles { origin: elsewhere, ..cloud(body) };
    for (particles, by) in [(exact, by), (counted, elsewhere)] {
        let far = classify(&particles, R, &settings);
        assert_eq!(all(&far).count(), all(&near).count());
        assert_eq!(far.splashes.len(), near.splashes.len());
        for (a, b) in all(&near).zip(all(&far)) {
            assert_eq!(a.particle, b.particle);
            let error = (place_of(&near, a) + by).distance(place_of(&far, b));
            assert!(error < 1e-5 * f64::from(R), "{error:e}");
            assert!(matrix(a).abs_diff_eq(matrix(b), 1e-5 * R));
        }
    }
}

/// Wetting is exact far from the origin: copies lie on the solid beyond the precision of 32-bit
/// coordinates.
#[test]
fn far_splats_wet_solids() {
    let floor = DVec3::new(98765.4321, -12345.6789, 1e5);
    let shape = Shape::Plane { origin: floor, normal: Vec3::Y, half_extent: f32::INFINITY };
    let surface = Surface::Color(Vec3::ONE);
    let sheet: Vec<_> = lattice([9, 1, 9], [2.0; 3]);
    let origin = floor + DVec3::Y * f64::from(1.5 * R);
    let particles = Particles { origin, ..cloud(sheet) };
    let mut splats = classify(&particles, R, &Classify::default());
    let drawn = splats.aggregates.len();
    add_wall_contacts(&mut splats, &[Solid { shape, surface, lit: false }], 2.0);
    assert_eq!(splats.aggregates.len(), 2 * drawn, "each aggregate has a copy");
    for copy in &splats.aggregates[drawn..] {
        let height = place_of(&splats, copy).y - floor.y;
        assert!(height.abs() < 1e-6 * f64::from(R), "{height:e}");
    }
}

/// Grid and tree agree: centres and axes to 10⁻⁵ r, and classes exactly; refined ones to 10⁻⁴ r but for one in a
/// thousand. The grid applies except to crowds and widely scattered particles.
#[test]
fn grid_equals_tree() {
    let mut seed = 13;
    let body = random(8000, 12);
    let radii: Vec<_> = body.iter().map(|_| R * (0.5 + 1.5 * noise(&mut seed))).collect();
    let mixed = Particles { positions: body.clone(), radii: Some(radii), ..Default::default() };
    let spray = body.iter().map(|&p| 2.0 * p);
    let strays = body.iter().copied().chain([Vec3::MAX, Vec3::MIN, 1e20 * Vec3::X]);
    let clouds = [cloud(body.clone()), mixed, cloud(spray), cloud(strays)];
    for particles in &clouds {
        let cloud = Cloud::new(particles, R);
        for kernel in [Kernel::Fitted, Kernel::Volume] {
            let settings = Classify { kernel, ..unrefined() };
            assert!(cloud.has_grid(&settings));
            let (grid, tree) = (cloud.classify(&settings), cloud.classify_by_tree(&settings));
            assert_eq!(grid.aggregates.len(), tree.aggregates.len());
            for (a, b) in all(&grid).zip(all(&tree)) {
                assert_eq!(a.particle, b.particle);
                let centres = Vec3::from_array(a.centre) - Vec3::from_array(b.centre);
                assert!(centres.abs().max_element() < 1e-5 * a.radius, "{a:?}, {b:?}");
                assert!(matrix(a).abs_diff_eq(matrix(b), 1e-5 * a.radius), "{a:?}, {b:?}");
            }
        }
    }
    // Refinement magnifies rounding; where the surface is only just found or not, it decides.
    for particles in &clouds {
        let cloud = Cloud::new(particles, R);
        let [grid, tree] = [Cloud::classify, Cloud::classify_by_tree]
            .map(|classify| classify(&cloud, &Classify::default()));
        let off = |(a, b): (&Splat, &Splat)| {
            let off =
                |a: [f32; 3], b: [f32; 3]| (Vec3::from(a) - Vec3::from(b)).abs().max_element();
            let axes = off(a.diagonal, b.diagonal).max(off(a.off_diagonal, b.off_diagonal));
            off(a.centre, b.centre).max(axes) / a.radius
        };
        let mut off: Vec<f32> = all(&grid).zip(all(&tree)).map(off).collect();
        off.sort_unstable_by(f32::total_cmp);
        let worst = off[off.len() - 1 - off.len() / 1000];
        eprintln!("refined: within {worst:.1e} r, at most {:.1e} r", off[off.len() - 1]);
        assert!(worst < 1e-4, "{worst} r");
    }
    let crowd = Cloud::new(&cloud([Vec3::ONE; 5000]), R);
    let wide = Cloud::new(&cloud(body.iter().map(|&p| 1e6 * p)), R);
    assert!([crowd, wide].iter().all(|cloud| !cloud.has_grid(&Classify::default())));
}

/// Results do not depend on the world axes.
#[test]
fn rotating_the_particles_rotates_the_splats() {
    let points = random(1000, 5);
    let quarter = Mat3::from_cols(Vec3::Y, Vec3::NEG_X, Vec3::Z);
    let cycle = Mat3::from_cols(Vec3::Y, Vec3::Z, Vec3::X);
    for kernel in [Kernel::Fitted, Kernel::Volume] {
        let settings = Classify { kernel, splash_density: 0.5, ..Default::default() };
        let straight = classify(&cloud(points.clone()), R, &settings);
        assert!(!straight.splashes.is_empty());
        for turn in [quarter, cycle] {
            let turned = classify(&cloud(points.iter().map(|&p| turn * p)), R, &settings);
            assert_eq!(turned.splashes.len(), straight.splashes.len());
            for (a, b) in all(&straight).zip(all(&turned)) {
                assert_eq!(a.particle, b.particle);
                let moved = turn * Vec3::from_array(a.centre) - Vec3::from_array(b.centre);
                assert!(moved.length() < 1e-4 * R);
                let expected = turn * matrix(a) * turn.transpose();
                assert!(matrix(b).abs_diff_eq(expected, 1e-4 * R), "{expected} {}", matrix(b));
            }
        }
    }
}

/// Lengths are multiples of r: scaling by four scales the splats exactly.
#[test]
fn scaling_the_particles_scales_the_splats() {
    let points = random(1000, 6);
    let small = classify(&cloud(points.clone()), R, &Classify::default());
    let large = classify(&cloud(points.iter().map(|&p| 4.0 * p)), 4.0 * R, &Classify::default());
    assert_eq!(large.radius, 4.0 * small.radius);
    for (a, b) in all(&small).zip(all(&large)) {
        assert_eq!(matrix(a) * 4.0, matrix(b));
        assert_eq!(a.centre.map(|c| 4.0 * c), b.centre);
    }
}

/// Results do not depend on the number of threads.
#[test]
fn thread_count_does_not_change_results() {
    let particles = cloud(random(30_000, 7));
    let settings = Classify { splash_density: 0.7, ..Default::default() };
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let splats = pool.install(|| classify(&particles, R, &settings));
        let bytes = [&splats.aggregates, &splats.splashes]
            .map(|list| bytemuck::cast_slice::<Splat, u8>(list).to_vec());
        (splats, bytes)
    };
    let (splats, one) = run(1);
    for threads in [2, 2, 3] {
        assert!(one == run(threads).1, "{threads} threads");
    }
    // Every particle occurs once, in file order.
    assert!(splats.aggregates.is_sorted_by_key(|s| s.particle));
    assert!(splats.splashes.is_sorted_by_key(|s| s.particle));
    assert_eq!(splats.aggregates.len() + splats.splashes.len(), 30_000);
    assert!(!splats.aggregates.is_empty() && !splats.splashes.is_empty());
}

/// Radii from the file override the default, per particle.
#[test]
fn radii_of_the_file_are_honoured() {
    let small = random(500, 8);
    let far = Vec3::new(100.0, 0.0, 0.0);
    let large = random(300, 9).into_iter().map(|p| 2.0 * p + far);
    let particles = Particles {
        positions: small.iter().copied().chain(large.clone()).collect(),
        radii: Some([vec![R; 500], vec![2.0 * R; 300]].concat()),
        ..Default::default()
    };
    let both = classify(&particles, f32::NAN, &Classify::default());
    assert_eq!(both.radius, R);
    let alone = [
        (0, classify(&cloud(small), R, &Classify::default())),
        (500, classify(&cloud(large), 2.0 * R, &Classify::default())),
    ];
    for (first, splats) in &alone {
        for splat in all(splats) {
            let found = find(&both, splat.particle + first);
            assert_eq!(found.radius, splat.radius);
            assert!(matrix(&found).abs_diff_eq(matrix(splat), 1e-5 * R));
            assert_eq!(is_splash(&both, found.particle), is_splash(splats, splat.particle));
        }
    }
}

/// Particles that cannot be drawn are skipped, and the others keep their indices.
#[test]
fn unusable_particles_are_skipped() {
    let bad = [0.0, -0.0, -R, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e-40, f32::MAX];
    let mut positions: Vec<_> = (0..bad.len() + 1).map(|i| Vec3::X * i as f32).collect();
    positions.push(Vec3::new(0.0, f32::NAN, 0.0));
    positions.push(Vec3::INFINITY);
    let radii = [&bad[..], &[R, R, R]].concat();
    let particles = Particles { positions, radii: Some(radii), ..Default::default() };
    let splats = classify(&particles, R, &Classify::default());
    let kept: Vec<_> = all(&splats).map(|s| s.particle).collect();
    assert_eq!(kept, [bad.len() as u32]);
    assert_eq!(splats.radius, R);

    let none = classify(&cloud([Vec3::ZERO]), 0.0, &Classify::default());
    assert!(none.aggregates.is_empty() && none.splashes.is_empty());
}

/// Extreme positions and radii yield finite splats.
#[test]
fn adversarial_particles_stay_finite() {
    let tiny = f32::from_bits(1);
    let body = random(500, 10);
    let offset = |by: Vec3| body.iter().map(move |&p| p + by).collect::<Vec<_>>();
    let mixed = [1e30, -1e30, f32::MAX, f32::MIN, 0.0, tiny, -tiny, 1e6, 1e6, 1e19, -1e19];
    let mixed = mixed.iter().flat_map(|&x| mixed.iter().map(move |&y| Vec3::new(x, y, y - x)));
    let clouds = [
        (offset(Vec3::splat(1e6)), R),
        (offset(Vec3::new(1e30, 0.0, -1e30)), R),
        (mixed.filter(|p| p.is_finite()).chain(body.iter().copied()).collect(), R),
        (body.iter().chain(&body).copied().collect(), R),
        (body.iter().map(|&p| p * 1e-40).collect(), R),
        (body.iter().map(|&p| p * 1e-10).collect(), R * 1e-10),
        (body.iter().map(|&p| p * 1e12).collect(), R * 1e12),
        (vec![Vec3::ZERO, Vec3::X * tiny, Vec3::Y * 1e-30, Vec3::Z * 1e-7 * R], R),
        (lattice([41, 1, 1], [1e-4; 3]), R),
    ];
    for kernel in [Kernel::Fitted, Kernel::Volume] {
        for splash_density in [0.0, 0.2, 1e30] {
            for (points, radius) in &clouds {
                let settings = Classify { kernel, splash_density, ..Default::default() };
                let splats = classify(&cloud(points.iter().copied()), *radius, &settings);
                assert_eq!(all(&splats).count(), points.len(), "every particle has a splat");
                assert_drawable(&splats);
            }
        }
    }
}

/// Distant stray particles do not change the splats of the others.
#[test]
fn stray_particles_change_nothing() {
    let body = random(2000, 12);
    let stray = [f32::MAX, f32::MIN, 1e30, -1e30, 1e20, -1e20]
        .map(|x| [Vec3::X, Vec3::Y, Vec3::ONE].map(|v| v * x));
    let with = classify(
        &cloud(body.iter().copied().chain(stray.into_iter().flatten())),
        R,
        &Classify::default(),
    );
    let without = classify(&cloud(body), R, &Classify::default());
    for splat in all(&without) {
        let found = find(&with, splat.particle);
        assert!(matrix(&found).abs_diff_eq(matrix(splat), 1e-5 * R));
        assert_eq!(is_splash(&with, splat.particle), is_splash(&without, splat.particle));
    }
    assert_eq!(with.splashes.len(), without.splashes.len() + 18);
}

/// The largest and smallest valid settings yield finite splats.
#[test]
fn extreme_settings_stay_finite() {
    let particles = cloud(random(300, 11));
    for kernel in [Kernel::Fitted, Kernel::Volume] {
        for support in [1.0, 2.0, 10.0] {
            for max_ratio in [1.0, 100.0] {
                let settings = Classify {
                    support,
                    max_ratio,
                    kernel,
                    smoothing: 1.0,
                    splash_density: 0.0,
                    ..Default::default()
                };
                let splats = classify(&particles, R, &settings);
                assert_drawable(&splats);
                if max_ratio == 1.0 {
                    splats.aggregates.iter().for_each(|s| {
                        let a = aligned_axes(s);
                        assert!(a.max_element() - a.min_element() < 1e-5);
                    });
                }
            }
        }
    }
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
