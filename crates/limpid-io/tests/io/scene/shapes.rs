//! Distances to solids and their normals, on which contact and wetting depend.

use glam::{DVec3, Vec3};
use limpid::scene::Shape;

use super::random;

/// Distances to solids agree with closed forms, and normals are their gradients.
#[test]
fn distances_to_solids() {
    let mut seed = 1;
    let [min, max] = [DVec3::new(-0.5, -0.2, 0.1), DVec3::new(0.3, 0.6, 0.5)];
    let center = DVec3::new(0.1, -0.2, 0.3);
    let normal = Vec3::new(1.0, 2.0, -2.0) / 3.0;
    let plane = Shape::Plane { origin: center, normal, half_extent: f32::INFINITY };
    for _ in 0..10_000 {
        let x = 1.5 * random(&mut seed).as_dvec3();

        let (distance, outward) = Shape::Sphere { center, radius: 0.4 }.distance(x);
        assert!((distance - (x.distance(center) - f64::from(0.4f32))).abs() < 1e-12);
        assert!(outward.abs_diff_eq((x - center).normalize(), 1e-12));

        assert_eq!(plane.distance(x), ((x - center).dot(normal.as_dvec3()), normal.as_dvec3()));

        let solid = Shape::Box { min, max };
        let (distance, outward) = solid.distance(x);
        let nearest = x.clamp(min, max);
        if nearest == x {
            let depth = (x - min).min(max - x).min_element();
            assert!((distance + depth).abs() < 1e-12, "{x}: {distance}, not −{depth}");
        } else {
            assert!((distance - x.distance(nearest)).abs() < 1e-12, "{x}: {distance}");
            assert!(outward.abs_diff_eq((x - nearest).normalize(), 1e-9), "{x}: {outward}");
        }
        assert!((outward.length() - 1.0).abs() < 1e-12);
        // A step by the distance against the normal ends on the surface.
        let surface = solid.distance(x - distance * outward).0;
        assert!(surface.abs() < 1e-12, "{x}: {surface} off the surface");
    }
}

/// Special points: on a surface, at a centre, at a corner, beside a finite plane.
#[test]
fn distances_at_special_points() {
    let floor =
        Shape::Plane { origin: DVec3::new(1.0, 0.0, 0.0), normal: Vec3::Y, half_extent: 2.0 };
    assert_eq!(floor.distance(DVec3::new(2.5, -0.5, 1.5)), (-0.5, DVec3::Y));
    assert_eq!(floor.distance(DVec3::new(3.0, 0.0, -2.0)), (0.0, DVec3::Y));
    for beside in [DVec3::new(3.1, 0.1, 0.0), DVec3::new(-1.1, 0.1, 0.0), DVec3::new(0.0, 0.1, 2.1)]
    {
        assert_eq!(floor.distance(beside).0, f64::INFINITY, "beside a finite plane");
    }
    let cube = Shape::Box { min: -DVec3::ONE, max: DVec3::ONE };
    let ball = Shape::Sphere { center: DVec3::ZERO, radius: 1.0 };
    for solid in [cube.clone(), ball] {
        let (distance, normal) = solid.distance(DVec3::ZERO);
        assert_eq!(distance, -1.0);
        assert!(normal.is_normalized());
    }
    for (x, outward) in [
        (DVec3::new(2.0, 2.0, 2.0), DVec3::ONE.normalize()),
        (DVec3::new(-2.0, 0.0, 0.0), -DVec3::X),
        (DVec3::new(0.0, 1.0, 0.0), DVec3::Y),
        (DVec3::new(0.5, -0.25, -0.9), -DVec3::Z),
    ] {
        let (distance, normal) = cube.distance(x);
        assert!(distance.is_finite() && normal.abs_diff_eq(outward, 1e-12), "{x}: {normal}");
    }
}
