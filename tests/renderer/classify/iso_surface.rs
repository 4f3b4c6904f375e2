//! The refinement of the drawn surface.

use super::{R, assert_drawable, cloud, lattice, matrix, noise, random};
use glam::{DVec3, Mat3, Vec3};
use limpid::liquid::classify::{Cloud, Splat, classify};
use limpid::liquid::{Ellipsoid, Particles};
use limpid::settings::{Classify, Kernel};

/// The settings without the refinement of the surface.
pub(super) fn unrefined() -> Classify {
    Classify { iso_surface: false, ..Default::default() }
}

/// Where a splat ends in the direction of a unit vector, m.
fn end(splat: &Splat, n: Vec3) -> f32 {
    Vec3::from_array(splat.centre).dot(n) + (matrix(splat) * n).length()
}

/// Mean and standard deviation, in r.
fn mean_and_spread(lengths: &[f32]) -> [f32; 2] {
    let count = lengths.len() as f32;
    let mean = lengths.iter().sum::<f32>() / count;
    let square = lengths.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / count;
    [mean / R, square.sqrt() / R]
}

/// The surface of a slab is flatter than its particles, which are out of place independently of each other: the hardest
/// case, as liquid has no such noise. It lies half a spacing above the topmost layer, where the liquid ends.
#[test]
fn a_slab_of_jittered_particles_is_flat() {
    let lattice = lattice([31, 31, 7], [2.0; 3]);
    let is_top = |p: Vec3| p.z > 5.9 * R && p.truncate().abs().max_element() < 22.0 * R;
    for most in [0.0, 0.2, 0.4] {
        let mut seed = 21;
        let mut by = move || most * R * (2.0 * noise(&mut seed) - 1.0);
        let particles = cloud(lattice.iter().map(|&p| p + Vec3::new(by(), by(), by())));
        let heights = |settings: &Classify| {
            let splats = classify(&particles, R, settings);
            let tops = splats.aggregates.iter().filter(|s| is_top(lattice[s.particle as usize]));
            mean_and_spread(&tops.map(|splat| end(splat, Vec3::Z)).collect::<Vec<_>>())
        };
        let ([_, rough], [height, flat]) = (heights(&unrefined()), heights(&Classify::default()));
        eprintln!("spread {rough:.4} r, refined {flat:.4} r, at {height:.3} r");
        assert!(flat <= 0.75 * rough + 1e-4, "spread {rough} r, refined {flat} r");
        assert!((height - 7.0).abs() < 0.1, "{height} r");
    }
}

/// The surface of a ball is at one distance from its centre.
#[test]
fn a_ball_is_round() {
    // Shells of equally spread points (Fibonacci's lattice), each in the volume of a particle at rest.
    let shell = |radius: f32| {
        let count = std::f32::consts::PI * radius * radius;
        let golden = std::f32::consts::PI * (3.0 - 5f32.sqrt());
        (0..count as u32).map(move |i| {
            let height = 1.0 - (2 * i + 1) as f32 / count;
            let flat = (1.0 - height * height).max(0.0).sqrt();
            let turn = golden * i as f32;
            radius * R * Vec3::new(flat * turn.cos(), flat * turn.sin(), height)
        })
    };
    let particles = cloud((0..6).flat_map(|k| shell((2 * k + 1) as f32)));
    let outer = |splat: &&Splat| particles.positions[splat.particle as usize].length() > 10.5 * R;
    let distances = |settings: &Classify| {
        let splats = classify(&particles, R, settings);
        let ends = splats.aggregates.iter().filter(outer);
        let ends = ends.map(|s| end(s, particles.positions[s.particle as usize].normalize()));
        mean_and_spread(&ends.collect::<Vec<_>>())
    };
    let ([_, rough], [distance, round]) =
        (distances(&unrefined()), distances(&Classify::default()));
    eprintln!("spread {rough:.4} r, refined {round:.4} r, at {distance:.3} r");
    assert!(round < 0.7 * rough, "spread {rough} r, refined {round} r");
    assert!((distance - 12.0).abs() < 0.3, "{distance} r");
}

/// Distance from a sheet's particles at which the normalised density falls below the level of the surface, in r. The
/// particles are at `lattice`, in r, and the distance is above the middle one.
fn half_thickness(lattice: &[Vec3]) -> f64 {
    let spline = |distance: f64| {
        let q = distance / 4.0;
        2.0 * (1.0 - q).max(0.0).powi(3) - 8.0 * (0.5 - q).max(0.0).powi(3)
    };
    let sum = |x: DVec3| lattice.iter().map(|p| spline(p.as_dvec3().distance(x))).sum::<f64>();
    // All particles near the middle have its volume.
    let alone = sum(DVec3::ZERO);
    let (mut low, mut high) = (0.0, 4.0);
    for _ in 0..40 {
        let z = 0.5 * (low + high);
        if sum(z * DVec3::Z) / alone > 0.6 { low = z } else { high = z }
    }
    low
}

/// A sheet of one layer ends at the surface on both sides, whichever way it is turned, and no side is rougher than
/// without the refinement. (Particles that are 0.4 r out of place in all directions form no sheet: some are refined, their
/// neighbours are not.)
#[test]
fn a_sheet_has_its_thickness_and_flat_sides() {
    let lattice = lattice([31, 31, 1], [2.0; 3]);
    let expected = half_thickness(&lattice.iter().map(|p| *p / R).collect::<Vec<_>>()) as f32;
    let turn = Mat3::from_axis_angle(Vec3::new(0.3, 0.5, 0.8).normalize(), 1.0);
    for most in [0.0, 0.1, 0.2] {
        let mut seed = 27;
        let mut by = move || most * R * (2.0 * noise(&mut seed) - 1.0);
        let jittered = lattice.iter().map(|&p| turn * (p + Vec3::new(by(), by(), by())));
        let particles = cloud(jittered);
        for n in [turn * Vec3::Z, turn * Vec3::NEG_Z] {
            let ends = |settings: &Classify| {
                let splats = classify(&particles, R, settings);
                let inner = |splat: &&Splat| {
                    lattice[splat.particle as usize].truncate().abs().max_element() < 22.0 * R
                };
                let ends = splats.aggregates.iter().filter(inner).map(|splat| end(splat, n));
                mean_and_spread(&ends.collect::<Vec<_>>())
            };
            let ([_, rough], [height, flat]) = (ends(&unrefined()), ends(&Classify::default()));
            eprintln!(
                "spread {rough:.4} r, refined {flat:.4} r, at {height:.4} r of {expected:.4} r"
            );
            let tolerance = 0.005 + 0.1 * most;
            assert!((height - expected).abs() < tolerance, "{height} r, not {expected} r");
            assert!(flat <= rough + 1e-4, "spread {rough} r, refined {flat} r");
        }
    }
}

/// The refinement changes centres and axes of splats at the surface and nothing else: neither splashes, nor what is
/// surrounded by liquid, nor shapes from the file, nor kernels of constant volume.
#[test]
fn only_splats_at_the_surface_change() {
    let body = random(3000, 22).into_iter().chain(random(300, 23).into_iter().map(|p| 4.0 * p));
    let particles = cloud(body);
    let (with, without) =
        (classify(&particles, R, &Classify::default()), classify(&particles, R, &unrefined()));
    assert_eq!(with.splashes, without.splashes);
    assert!(with.splashes.len() > 50);
    let (mut moved, mut stretched, mut buried) = (0, 0, 0);
    for (a, b) in with.aggregates.iter().zip(&without.aggregates) {
        let still = a.centre == b.centre;
        let shaped =
            Splat { centre: b.centre, diagonal: b.diagonal, off_diagonal: b.off_diagonal, ..*a };
        assert_eq!(shaped, *b, "only centre and axes may differ");
        let longer = (a.diagonal, a.off_diagonal) != (b.diagonal, b.off_diagonal);
        assert!(!longer || !a.is_buried(), "{a:?}, {b:?}");
        stretched += usize::from(longer);
        assert!(still || !a.is_buried(), "{a:?}, {b:?}");
        moved += usize::from(!still);
        buried += usize::from(a.is_buried());
    }
    assert!(moved > 500 && stretched > 50, "{moved} moved, {stretched} stretched");
    assert!(buried > 50, "{buried} buried");

    let volume = |iso_surface| Classify { kernel: Kernel::Volume, iso_surface, ..unrefined() };
    assert_eq!(classify(&particles, R, &volume(true)), classify(&particles, R, &volume(false)));
    let given = Some(vec![Ellipsoid { xx: 1.5, ..Ellipsoid::SPHERE }; particles.len()]);
    let given = Particles { ellipsoids: given, ..particles };
    assert_eq!(classify(&given, R, &Classify::default()), classify(&given, R, &unrefined()));
}

/// Particles of all sizes, which no grid serves, at one place, apart, and in each other.
#[test]
fn surfaces_of_particles_of_all_sizes_stay_finite() {
    let mut seed = 24;
    for spread in [10.0f32, 1e3, 1e12] {
        let body = random(800, 25);
        let radii = body.iter().map(|_| R * spread.powf(2.0 * noise(&mut seed) - 1.0)).collect();
        let positions = body.iter().chain(&body[..100]).copied().collect();
        let radii = [radii, vec![R; 100]].concat();
        let particles = Particles { positions, radii: Some(radii), ..Default::default() };
        let settings = Classify { splash_density: 0.0, ..Default::default() };
        assert!(!Cloud::new(&particles, R).has_grid(&settings));
        let splats = classify(&particles, R, &settings);
        assert!(splats.aggregates.len() > 800);
        assert_drawable(&splats);
    }
}
