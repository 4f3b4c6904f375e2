//! Relative densities, which tell splashes from aggregates.

use glam::Vec3;
use limpid::liquid::Particles;
use limpid::liquid::classify::classify;
use limpid::settings::Classify;

use super::{R, cloud, is_splash, lattice, middle, random, round};

/// Relative density of one particle, found by bisection of the threshold.
fn share(positions: &[Vec3], particle: u32) -> f32 {
    let (mut low, mut high) = (0.0, 2.0);
    for _ in 0..22 {
        let splash_density = 0.5 * (low + high);
        let settings = Classify { splash_density, ..Default::default() };
        let splats = classify(&cloud(positions.iter().copied()), R, &settings);
        if is_splash(&splats, particle) {
            high = splash_density;
        } else {
            low = splash_density;
        }
    }
    0.5 * (low + high)
}

/// The relative density of a body at rest is 1; other configurations have known values.
#[test]
fn relative_densities_are_known() {
    let of = |points: Vec<Vec3>| {
        let index = middle(&points);
        share(&points, index)
    };
    for (points, expected) in [
        (lattice([9; 3], [2.0; 3]), 1.0),
        (lattice([1; 3], [2.0; 3]), 0.05948),
        (lattice([2, 1, 1], [2.0; 3]), 0.11153),
        (lattice([3, 1, 1], [2.0; 3]), 0.16358),
        (lattice([21, 1, 1], [2.0; 3]), 0.16358),
        (lattice([21, 21, 1], [2.0; 3]), 0.42149),
        (lattice([21, 21, 2], [2.0; 3]), 0.71075),
    ] {
        let count = points.len();
        let share = of(points);
        assert!((share - expected).abs() < 1e-5, "{share}, not {expected}, of {count} particles");
    }
}

/// Thin sheets are aggregates, so that crowns and curtains do not fall apart into droplets.
#[test]
fn sheets_are_not_splashes() {
    for (count, step) in [
        ([21, 21, 1], [2.0; 3]),
        ([21, 21, 1], [2.6; 3]),
        ([21, 21, 2], [2.6, 2.6, 2.0]),
        ([21, 21, 2], [2.6; 3]),
    ] {
        let sheet = lattice(count, step);
        let splats = classify(&cloud(sheet.clone()), R, &Classify::default());
        assert!(!is_splash(&splats, middle(&sheet)), "{count:?}, spaced {step:?} r");
    }
}

/// Bodies have no splashes at faces, edges and corners.
#[test]
fn blocks_have_no_splashes() {
    let splats = classify(&cloud(lattice([6; 3], [2.0; 3])), R, &Classify::default());
    assert_eq!((splats.aggregates.len(), splats.splashes.len()), (216, 0));
}

/// Up to three particles are splashes, even in contact.
#[test]
fn droplets_are_splashes() {
    let triangle = vec![Vec3::ZERO, Vec3::X * 2.0 * R, Vec3::new(1.0, 3f32.sqrt(), 0.0) * R];
    for droplet in [lattice([2, 1, 1], [1.0; 3]), lattice([3, 1, 1], [2.0; 3]), triangle] {
        let splats = classify(&cloud(droplet.clone()), R, &round());
        assert_eq!(splats.splashes.len(), droplet.len());
        for (splat, place) in splats.splashes.iter().zip(droplet) {
            assert_eq!(splat.centre, place.to_array(), "splashes are not smoothed");
        }
    }
}

/// The search finds the same density as a sum over all pairs.
#[test]
fn density_equals_a_brute_force_reference() {
    let points = random(500, 4);
    let weight = |d: f64| (1.0 - d.powi(3)).max(0.0);
    let mut at_rest = 0.0;
    for p in lattice([7; 3], [2.0; 3]) {
        at_rest += weight(f64::from(p.length() / R) / 4.0);
    }
    let densities: Vec<f64> = points
        .iter()
        .map(|a| {
            let near =
                |b: &Vec3| weight((a.as_dvec3() - b.as_dvec3()).length() / (4.0 * f64::from(R)));
            points.iter().map(near).sum::<f64>() / at_rest
        })
        .collect();
    for threshold in [0.3, 0.5, 0.7, 0.9, 1.1] {
        let settings = Classify { splash_density: threshold, ..Default::default() };
        let splats = classify(&cloud(points.clone()), R, &settings);
        for (i, &density) in densities.iter().enumerate() {
            if (density - f64::from(threshold)).abs() > 1e-5 {
                assert_eq!(is_splash(&splats, i as u32), density < f64::from(threshold));
            }
        }
    }
}

/// Neighbours are weighted by volume: the relative density around a particle of twice the size is the
/// same.
#[test]
fn large_particle_among_small_ones_is_inside_a_body() {
    let body = lattice([13; 3], [2.0; 3]);
    let mut radii = vec![R; body.len()];
    radii[middle(&body) as usize] = 2.0 * R;
    let index = middle(&body);
    let particles = Particles { positions: body, radii: Some(radii), ..Default::default() };
    let splashes_at = |splash_density| {
        let settings = Classify { splash_density, ..Default::default() };
        is_splash(&classify(&particles, R, &settings), index)
    };
    assert!(!splashes_at(0.9) && splashes_at(1.15));
}
