//! Coordinates of particles after reading: the up axis, precision far from the origin, bounds.

use glam::{DMat3, DVec3, Vec3, dvec3};
use limpid::liquid::{Ellipsoid, Particles, Up};

use super::npy::npy;
use super::{le, positions_only, read};

/// The conversion from z-up to y-up is a rotation: it maps up to up and preserves handedness.
#[test]
fn z_up_becomes_y_up() {
    let axes = vec![Vec3::X, Vec3::Y, Vec3::Z];
    let shape = Ellipsoid { xx: 1.0, yy: 2.0, zz: 3.0, xy: 0.1, yz: 0.2, xz: 0.3 };
    let mut particles = Particles {
        velocities: Some(axes.clone()),
        ellipsoids: Some(vec![shape; 3]),
        ..Particles::from_positions(axes)
    };
    particles.origin = dvec3(1.0, 2.0, 3.0);
    let before = particles.clone();
    particles.to_y_up(Up::Y);
    assert_eq!(particles, before);
    particles.to_y_up(Up::Z);
    assert_eq!(particles.positions, [Vec3::X, -Vec3::Z, Vec3::Y]);
    assert_eq!(particles.origin, dvec3(1.0, 3.0, -2.0));
    assert_eq!(particles.velocities.as_deref(), Some(&particles.positions[..]));
    let [x, y, z] = [0, 1, 2].map(|i| particles.positions[i]);
    assert_eq!(x.cross(y), z);
    let rotation = DMat3::from_cols(x.as_dvec3(), y.as_dvec3(), z.as_dvec3());
    let turned = particles.ellipsoids.unwrap()[0].matrix();
    assert_eq!(turned, rotation * shape.matrix() * rotation.transpose());
}

/// Positions in files of 64-bit numbers are kept to 1e-6 of the cloud's size, however far from the
/// origin. Those of 32-bit files, and of clouds near the origin, are unchanged.
#[test]
fn positions_far_from_the_origin_are_precise() {
    let places = |offset: DVec3| {
        [dvec3(0.001, 0.002, 0.003), dvec3(0.5123456789, -0.25, 0.75), dvec3(-0.1, 0.3, 0.9)]
            .map(|place| place + offset)
    };
    let offset = dvec3(12345.6789, -98765.4321, 1e5);
    let far = places(offset);
    let numbers = || far.iter().flat_map(|place| place.to_array());
    let text: String =
        far.iter().map(|place| format!("{} {} {}\n", place.x, place.y, place.z)).collect();
    let big: Vec<u8> = numbers().flat_map(f64::to_be_bytes).collect();
    let little: Vec<u8> = numbers().flat_map(f64::to_le_bytes).collect();
    let axes = [0, 1, 2].map(|k| far.map(|place| place[k].to_le_bytes()).concat()).concat();
    let property = |axis: &str| format!("property double {axis}\n");
    let ply = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\n{}{}{}end_header\n",
        property("x"),
        property("y"),
        property("z")
    );
    let vtk = b"# vtk DataFile Version 4.1\nfluid\nBINARY\nDATASET POLYDATA\nPOINTS 3 double\n";
    for (name, bytes) in [
        ("a.xyz", text.into_bytes()),
        ("a.npy", npy("<f8", "False", "(3, 3)", &little)),
        ("a.npy", npy("<f8", "True", "(3, 3)", &axes)),
        ("a.ply", [ply.into_bytes(), little].concat()),
        ("a.vtk", [vtk.to_vec(), big].concat()),
    ] {
        let particles = read(name, &bytes).unwrap();
        for (place, position) in far.iter().zip(&particles.positions) {
            let error = (particles.origin + position.as_dvec3()).distance(*place);
            assert!(error < 1e-6, "{name}: {position} from {}", particles.origin);
        }
        let (min, max) = particles.bounds().unwrap();
        assert!(min.distance(offset + dvec3(-0.1, -0.25, 0.003)) < 1e-6, "{name}: {min}");
        assert!(max.distance(offset + dvec3(0.5123456789, 0.3, 0.9)) < 1e-6, "{name}: {max}");
    }
    let near = Particles::from_places(&places(DVec3::splat(2.0)));
    assert_eq!(near.origin, DVec3::ZERO);
    let single: Vec<u8> = far.iter().flat_map(|place| le(place.as_vec3().to_array())).collect();
    let single = read("a.npy", &npy("<f4", "False", "(3, 3)", &single)).unwrap();
    assert_eq!(single.origin, DVec3::ZERO);
    assert_eq!(single.positions, far.map(|place| place.as_vec3()));
}

#[test]
fn bounds_enclose_all_particles() {
    assert_eq!(Particles::default().bounds(), None);
    let bounds = positions_only().bounds();
    assert_eq!(bounds, Some((dvec3(0.0, -1.25, -5.75), dvec3(3.5, 4.0, 1e6))));
}

/// Liquid far from the origin keeps its digits beside particles that are parked at the origin.
#[test]
fn parked_particles_cost_no_digits() {
    let pool = (0..1000).map(|i| [i % 10, i / 10 % 10, i / 100].map(|k| 0.01 * f64::from(k)));
    let offset = dvec3(4e6, -2e6, 1e5);
    let mut places = vec![DVec3::ZERO; 400];
    places.extend(pool.map(|x| DVec3::from(x) + offset));
    let numbers: Vec<u8> =
        places.iter().flat_map(|x| x.to_array()).flat_map(f64::to_le_bytes).collect();
    let particles = read("a.npy", &npy("<f8", "False", "(1400, 3)", &numbers)).unwrap();
    for (i, &place) in places.iter().enumerate().skip(400) {
        assert!(
            particles.place(i).abs_diff_eq(place, 1e-7),
            "{place} read as {}",
            particles.place(i)
        );
    }
    assert!(particles.place(0).length() < 1.0);
}
