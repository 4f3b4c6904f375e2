//! Writers of all formats: round trips, and reports of what a format cannot store.

use std::path::Path;

use glam::{DVec3, Vec3, dvec3};
use limpid::liquid::{Ellipsoid, Particles};
use limpid_io::Error;

use super::positions_only;

/// Uniform bits, from a linear congruential generator (Knuth's MMIX).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 32) as u32
    }

    fn below(&mut self, n: u32) -> u32 {
        ((u64::from(self.bits()) * u64::from(n)) >> 32) as u32
    }

    fn uniform(&mut self) -> f32 {
        self.bits() as f32 / u32::MAX as f32 - 0.5
    }

    /// A float of any magnitude that a position may have, or of a usual magnitude.
    fn float(&mut self) -> f32 {
        match self.below(4) {
            0 => Some(f32::from_bits(self.bits())).filter(|x| x.abs() < 1e18).unwrap_or(-0.0),
            _ => self.uniform(),
        }
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.float(), self.float(), self.float())
    }

    /// Particles with random attributes.
    fn particles(&mut self) -> Particles {
        let n = self.below(20) as usize;
        let offset = if self.below(4) == 0 { 1000.0 } else { 0.0 };
        let positions = (0..n).map(|_| self.vector() + offset).map(finite).collect();
        let mut particles = Particles::from_positions(positions);
        if self.below(2) == 0 {
            particles.velocities = Some((0..n).map(|_| self.vector()).collect());
        }
        if self.below(2) == 0 {
            particles.densities = Some((0..n).map(|_| self.float()).collect());
        }
        if self.below(2) == 0 {
            particles.radii = Some((0..n).map(|_| self.float().abs()).collect());
        }
        if self.below(2) == 0 {
            let wide = self.below(2) == 0;
            let id = |low: u32, high: u32| i64::from(high.cast_signed()) << 32 | i64::from(low);
            let ids = (0..n).map(|_| (self.bits(), self.bits()));
            let ids = ids.map(|(a, b)| if wide { id(a, b) } else { a.cast_signed().into() });
            particles.ids = Some(ids.collect());
        }
        if self.below(2) == 0 {
            let shape = |entry: [f32; 6]| {
                let [xx, yy, zz, xy, yz, xz] = entry;
                Ellipsoid { xx: 2.0 + xx, yy: 2.0 + yy, zz: 2.0 + zz, xy, yz, xz }
            };
            let entries = (0..n).map(|_| [0; 6].map(|_: i32| self.uniform()));
            particles.ellipsoids = Some(entries.map(shape).collect());
        }
        particles
    }
}

fn finite(position: Vec3) -> Vec3 {
    if position.is_finite() { position } else { Vec3::splat(-0.0) }
}

/// The bits of all numbers, to distinguish −0 from 0.
fn bits(particles: &Particles) -> impl PartialEq + std::fmt::Debug {
    let vectors = |vectors: &[Vec3]| -> Vec<u32> {
        vectors.iter().flat_map(|v| v.to_array().map(f32::to_bits)).collect()
    };
    let floats = |floats: &Vec<f32>| floats.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    let Particles { origin, positions, velocities, densities, radii, ids, ellipsoids, .. } =
        particles;
    (
        (*origin, vectors(positions), velocities.as_deref().map(vectors)),
        (densities.as_ref().map(floats), radii.as_ref().map(floats)),
        (ids.clone(), ellipsoids.clone()),
    )
}

/// Each format round-trips bit-identically, except for the attributes that it reports as lost.
#[test]
fn written_files_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(5);
    for case in 0..60 {
        let mut particles = random.particles();
        for extension in
            ["bgeo", "bgeo.gz", "bhclassic", "vtk", "vtu", "ply", "npy", "npz", "xyz", "pos", "csv"]
        {
            let path = folder.path().join(format!("{case}.{extension}"));
            if matches!(extension, "bgeo" | "bgeo.gz" | "bhclassic" | "ply") {
                for id in particles.ids.iter_mut().flatten() {
                    *id = i64::from(*id as i32);
                }
            }
            if extension == "pos" && random.below(2) == 0 {
                particles.radii = particles.radii.map(|radii| vec![0.25; radii.len()]);
            }
            let lost = limpid_io::particles::unsupported_attributes(&particles, &path).unwrap();
            limpid_io::particles::write(&particles, &path).unwrap();
            let mut expected = particles.clone();
            for name in &lost {
                match *name {
                    "velocity" => expected.velocities = None,
                    "density" => expected.densities = None,
                    "radius" => expected.radii = None,
                    "id" => expected.ids = None,
                    "ellipsoid" => expected.ellipsoids = None,
                    "radii that differ" => {
                        // Their mean replaces them, and the ellipsoids keep their size.
                        let read = limpid_io::particles::read(&path).unwrap();
                        let radius = read.radii.as_ref().map_or(0.0, |radii| radii[0]);
                        assert!(radius > 0.0, "{case}.{extension}");
                        expected.radii = read.radii;
                        expected.ellipsoids = read.ellipsoids;
                    }
                    other => panic!("{other}"),
                }
            }
            if extension == "pos" && expected.is_empty() {
                expected.radii = None;
            }
            let read = limpid_io::particles::read(&path).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(bits(&read), bits(&expected), "{case}.{extension}: {lost:?}");
        }
    }
}

/// Positions far from the origin keep their precision in the formats with 64-bit numbers.
#[test]
fn positions_far_from_the_origin_round_trip() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(6);
    let offset = dvec3(12345.6789, -98765.4321, 1e5);
    let places: Vec<DVec3> =
        (0..50).map(|_| offset + random.vector().as_dvec3().normalize_or_zero()).collect();
    let particles = Particles::from_places(&places);
    assert_ne!(particles.origin, DVec3::ZERO);
    for extension in ["vtk", "vtu", "ply", "npy", "npz", "csv"] {
        let path = folder.path().join(format!("a.{extension}"));
        assert_eq!(
            limpid_io::particles::unsupported_attributes(&particles, &path).unwrap(),
            [""; 0]
        );
        limpid_io::particles::write(&particles, &path).unwrap();
        let read = limpid_io::particles::read(&path).unwrap();
        for (i, place) in places.iter().enumerate() {
            let error = (read.origin + read.positions[i].as_dvec3()).distance(*place);
            assert!(error < 1e-6, "{extension}: particle {i} is {error} m off");
        }
    }
    for extension in ["bgeo", "xyz", "pos"] {
        let path = folder.path().join(format!("a.{extension}"));
        assert_eq!(
            limpid_io::particles::unsupported_attributes(&particles, &path).unwrap(),
            ["64-bit places"]
        );
        limpid_io::particles::write(&particles, &path).unwrap();
        assert_eq!(limpid_io::particles::read(&path).unwrap().positions[7], places[7].as_vec3());
    }
}

#[test]
fn errors_of_unwritable_formats_name_the_writable_ones() {
    for name in ["a.vtp", "a.obj", "a"] {
        let error = limpid_io::particles::write(&positions_only(), Path::new(name)).unwrap_err();
        assert!(matches!(error, Error::Format { .. }), "{error}");
        assert!(error.to_string().contains(".bgeo, "), "{error}");
        assert!(!Path::new(name).exists());
    }
}
