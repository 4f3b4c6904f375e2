//! Particles with extreme floats, which must become finite splats.

use limpid::glam::Vec3;
use limpid::liquid::classify::{classify, estimate_radius};
use limpid::liquid::{Particles, Up};
use limpid::settings::Classify;

use super::damage::Random;

/// Ordinary numbers, and finite ones that overflow or underflow in 32-bit arithmetic.
const NUMBERS: [f32; 13] =
    [0.0, -0.0, 1.0, -1.0, 0.1, 0.2, 1e30, -1e30, f32::MAX, f32::MIN, 1e-45, -1e-40, 1e19];

fn random_particles(random: &mut Random, n: usize) -> Particles {
    let mut number = || NUMBERS[random.below(NUMBERS.len())];
    let mut vectors =
        || (0..n).map(|_| Vec3::new(number(), number(), number())).collect::<Vec<_>>();
    let (positions, velocities) = (vectors(), vectors());
    let mut floats = || (0..n).map(|_| number().abs()).collect::<Vec<_>>();
    let (densities, radii) = (floats(), floats());
    Particles {
        positions,
        velocities: Some(velocities),
        densities: Some(densities),
        radii: Some(radii),
        ids: Some((0..n as i64).map(|i| i % 5).collect()),
        ..Particles::default()
    }
}

/// Frames of any finite numbers, and interpolations between them, become finite splats.
#[test]
fn any_finite_particles_become_finite_splats() {
    let mut random = Random(1);
    for round in 0..300 {
        let n = 1 + random.below(24);
        let (a, b) = (random_particles(&mut random, n), random_particles(&mut random, n));
        let mut between = Particles::between(&a, &b, 0.3);
        between.to_y_up(Up::Z);
        for mut particles in [a, b, between] {
            particles.radii = particles.radii.filter(|_| round % 2 == 0);
            let radius = estimate_radius(&particles);
            let splats = classify(&particles, radius, &Classify::default());
            assert!(splats.origin.is_finite() && splats.radius.is_finite());
            for splat in splats.aggregates.iter().chain(&splats.splashes) {
                let numbers = [splat.centre, splat.diagonal, splat.off_diagonal];
                assert!(numbers.as_flattened().iter().all(|x| x.is_finite()), "{splat:?}");
            }
        }
    }
}

/// If all particles are neighbours of each other, shapes are computed from a sample of them, in seconds
/// instead of hours and with the same result.
#[test]
fn crowded_particles_are_sampled() {
    let n = 60_000;
    let mut random = Random(2);
    let mut number = || random.below(1 << 20) as f32 / (1 << 20) as f32;
    let positions = (0..n).map(|_| Vec3::new(number(), number(), number())).collect();
    let splats = classify(&Particles::from_positions(positions), 10.0, &Classify::default());
    assert_eq!((splats.aggregates.len(), splats.splashes.len()), (n, 0));
    // Within such a large radius all have the same neighbours: spheres around the middle.
    for splat in &splats.aggregates {
        let middle = splats.origin + Vec3::from_array(splat.centre).as_dvec3();
        assert!((middle - 0.5).length() < 0.2, "{splat:?}");
        let [x, y, z] = splat.diagonal;
        assert!((x / y - 1.0).abs() < 0.1 && (x / z - 1.0).abs() < 0.1, "{splat:?}");
    }
    let same = Particles::from_positions(vec![Vec3::ONE; n]);
    assert_eq!(classify(&same, 0.1, &Classify::default()).aggregates.len(), n);
}
