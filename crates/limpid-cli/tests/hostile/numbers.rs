//! Particles whose numbers are at the end of what floats hold: they are drawn as finite splats.

use limpid::glam::Vec3;
use limpid::liquid::classify::{classify, estimate_radius};
use limpid::liquid::{Particles, Up};
use limpid::settings::Classify;

use super::damage::Random;

/// Finite numbers that arithmetic in 32 bits does not survive, and ordinary ones.
const NUMBERS: [f32; 13] =
    [0.0, -0.0, 1.0, -1.0, 0.1, 0.2, 1e30, -1e30, f32::MAX, f32::MIN, 1e-45, -1e-40, 1e19];

fn any(random: &mut Random, n: usize) -> Particles {
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

/// Protects pictures from NaN and ∞: whatever finite numbers a frame has, and between two frames
/// too, each splat is finite.
#[test]
fn any_finite_particles_become_finite_splats() {
    let mut random = Random(1);
    for round in 0..300 {
        let n = 1 + random.below(24);
        let (a, b) = (any(&mut random, n), any(&mut random, n));
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

/// Protects time and sense: where all particles are neighbours of each other, those that stand for
/// the rest give the shapes that all would, in seconds instead of hours.
#[test]
fn a_crowd_is_drawn_from_a_sample() {
    let n = 60_000;
    let mut random = Random(2);
    let mut number = || random.below(1 << 20) as f32 / (1 << 20) as f32;
    let positions = (0..n).map(|_| Vec3::new(number(), number(), number())).collect();
    let splats = classify(&Particles::from_positions(positions), 10.0, &Classify::default());
    assert_eq!((splats.aggregates.len(), splats.splashes.len()), (n, 0));
    // All in one place, seen from so far: spheres around the middle.
    for splat in &splats.aggregates {
        let middle = splats.origin + Vec3::from_array(splat.centre).as_dvec3();
        assert!((middle - 0.5).length() < 0.2, "{splat:?}");
        let [x, y, z] = splat.diagonal;
        assert!((x / y - 1.0).abs() < 0.1 && (x / z - 1.0).abs() < 0.1, "{splat:?}");
    }
    let same = Particles::from_positions(vec![Vec3::ONE; n]);
    assert_eq!(classify(&same, 0.1, &Classify::default()).aggregates.len(), n);
}
