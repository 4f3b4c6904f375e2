//! Shapes of splats: spheres, and ellipsoids within their bounds.

use glam::Vec3;
use limpid::liquid::classify::classify;
use limpid::settings::{Classify, Kernel};

use super::{
    R, aligned_axes, assert_axes, assert_drawable, bare, cloud, find, lattice, matrix, middle,
    place_of, random, round,
};

/// A lone splash keeps its position and radius.
#[test]
fn a_lone_particle_is_a_sphere_of_its_radius() {
    let place = Vec3::new(1.0, 2.0, 3.0);
    let splats = classify(&cloud([place]), R, &round());
    assert!(splats.aggregates.is_empty());
    assert_eq!(splats.splashes.len(), 1);
    assert_eq!(place_of(&splats, &splats.splashes[0]), place.as_dvec3());
    assert_eq!(splats.splashes[0].radius, R);
    assert_axes(&splats.splashes[0], [1.0; 3]);
}

/// A zero covariance yields a sphere, not NaN.
#[test]
fn a_lone_aggregate_is_a_sphere() {
    let splats = classify(&cloud([Vec3::ONE]), R, &bare(Kernel::Fitted));
    assert_axes(&splats.aggregates[0], [1.4; 3]);
    let splats = classify(&cloud([Vec3::ONE]), R, &bare(Kernel::Volume));
    assert_axes(&splats.aggregates[0], [1.0; 3]);
}

/// Coincident particles neither panic the tree nor get shapes from rounding errors.
#[test]
fn coincident_particles_are_spheres() {
    for place in [Vec3::ZERO, Vec3::new(0.1, -7.3, 1234.5)] {
        let splats = classify(&cloud([place; 10_000]), R, &round());
        assert_eq!(splats.aggregates.len(), 10_000);
        for splat in &splats.aggregates {
            assert_eq!(place_of(&splats, splat), place.as_dvec3());
            assert_axes(splat, [1.4; 3]);
        }
    }
}

/// A flat covariance is clamped to the ratio `k_r`, and the short axis is the fixed one.
#[test]
fn coplanar_particles_are_flat() {
    let sheet = lattice([21, 21, 1], [2.0, 2.0, 2.0]);
    let splat = find(&classify(&cloud(sheet.clone()), R, &bare(Kernel::Fitted)), middle(&sheet));
    assert_axes(&splat, [5.6, 5.6, 1.4]);
    let settings = Classify { long_axis: 2.8, ..bare(Kernel::Fitted) };
    assert_axes(
        &find(&classify(&cloud(sheet.clone()), R, &settings), middle(&sheet)),
        [2.8, 2.8, 1.4],
    );
}

/// A covariance of rank one is clamped likewise.
#[test]
fn collinear_particles_are_needles() {
    let line = lattice([1, 21, 1], [2.0; 3]);
    let splat = find(&classify(&cloud(line.clone()), R, &bare(Kernel::Fitted)), middle(&line));
    assert_axes(&splat, [1.4, 5.6, 1.4]);
}

/// Inside a body at rest, splats are spheres and stay in place.
#[test]
fn splats_inside_a_body_are_spheres() {
    let body = lattice([9; 3], [2.0; 3]);
    let splat = find(&classify(&cloud(body.clone()), R, &round()), middle(&body));
    assert_axes(&splat, [1.4; 3]);
    assert!(Vec3::from_array(splat.centre).length() < 1e-6 * R);
}

/// At a surface the short axis is along the normal, and the centre moves inwards.
#[test]
fn surface_splats_flatten_along_the_normal() {
    let body = lattice([13, 13, 7], [2.0; 3]);
    let top = body.iter().position(|p| p.truncate().length() == 0.0 && p.z > 5.9 * R).unwrap();
    let splat = find(&classify(&cloud(body.clone()), R, &round()), top as u32);
    let axes = aligned_axes(&splat);
    assert!((axes.z - 1.4).abs() < 1e-4 && axes.x > 1.5 && (axes.x - axes.y).abs() < 1e-4);
    assert!(splat.centre[2] < body[top].z - 0.1 * R);
}

/// Volume mode: fewer than 25 neighbours yield a sphere; a dense line is capped at exactly 1.2 r; a sheet
/// keeps the ratio up to the cap.
#[test]
fn volume_kernels_follow_the_papers() {
    let settings = bare(Kernel::Volume);
    let at_middle = |points: Vec<Vec3>| {
        let index = middle(&points);
        find(&classify(&cloud(points), R, &settings), index)
    };
    assert_axes(&at_middle(lattice([21, 1, 1], [2.0; 3])), [1.0; 3]);
    let k = 16f32.cbrt() / 4.0;
    assert_axes(&at_middle(lattice([101, 1, 1], [0.2; 3])), [1.2, k, k]);
    let thin = 0.25f32.powf(2.0 / 3.0);
    assert_axes(&at_middle(lattice([21, 21, 1], [1.0; 3])), [1.2, 1.2, thin]);
    assert_axes(&at_middle(lattice([9; 3], [2.0; 3])), [1.0; 3]);
}

/// Axes obey the caps and the ratio in all directions, not only along x, y and z.
#[test]
fn axes_stay_within_their_bounds() {
    let particles = cloud(random(2000, 3));
    for kernel in [Kernel::Fitted, Kernel::Volume] {
        let settings = Classify { splash_density: 0.0, kernel, ..Default::default() };
        let longest = if kernel == Kernel::Fitted { settings.long_axis } else { 1.2 };
        let splats = classify(&particles, R, &settings);
        assert_drawable(&splats);
        for splat in &splats.aggregates {
            for k in 0..200 {
                let (height, turn) = (k as f32 / 100.0 - 0.995, k as f32 * 2.4);
                let flat = (1.0 - height * height).sqrt();
                let direction = Vec3::new(flat * turn.cos(), flat * turn.sin(), height);
                let reach = (matrix(splat) * direction).length() / R;
                assert!(reach <= longest * 1.0001, "{reach}");
                assert!(reach >= longest.min(1.0) / settings.max_ratio * 0.999, "{reach}");
            }
        }
    }
}
