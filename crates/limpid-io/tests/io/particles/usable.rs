//! Positions alone decide which particles are read: those without one are left out and counted, and what cannot
//! be used of the attributes is replaced or left out with a remark.

use std::path::Path;

use glam::{Vec3, vec3};
use limpid_io::Error;
use limpid_io::particles::{Contents, ReadOptions, Remark};

use super::bgeo::bgeo_header;
use super::npy::npy;
use super::npz::npz;
use super::{be, le};

fn parse(name: &str, bytes: &[u8]) -> Contents {
    Contents::parse(Path::new(name), bytes, &ReadOptions::default()).expect(name)
}

fn remarks(contents: &Contents) -> Vec<String> {
    contents.remarks.iter().map(Remark::to_string).collect()
}

/// A table of text, of one particle a line.
fn csv(header: &str, rows: &[&str]) -> Contents {
    parse("a.csv", [&[header], rows].concat().join("\n").as_bytes())
}

/// An array `positions` of particles in a row along x, and one more array.
fn archive(shape: &str, numbers: &[f64], name: &str) -> Contents {
    let bytes = |numbers: &[f64]| numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>();
    let places: Vec<f64> = (0..4).flat_map(|i| [f64::from(i), 0.0, 0.0]).collect();
    let positions = ("positions.npy", npy("<f8", "False", "(4, 3)", &bytes(&places)));
    let other = npy("<f8", "False", shape, &bytes(numbers));
    parse("a.npz", &npz(&[positions, (&format!("{name}.npy"), other)], false))
}

/// The attributes of the particles that are kept stay theirs, and do not suffer from those of the others.
#[test]
fn attributes_stay_with_their_particles() {
    let rows = [
        "0,0,0,1,0,0,10,1000,0.1",
        "nan,nan,nan,nan,nan,nan,nan,nan,nan",
        "2,0,0,3,0,0,12,1002,0.3",
        ",,,,,,,,",
        "4,0,0,5,0,0,14,1004,0.5",
    ];
    let found = csv("x,y,z,vx,vy,vz,id,density,radius", &rows);
    let particles = &found.particles;
    assert_eq!(particles.positions, [0.0, 2.0, 4.0].map(|x| vec3(x, 0.0, 0.0)));
    assert_eq!(particles.velocities, Some([1.0, 3.0, 5.0].map(|x| vec3(x, 0.0, 0.0)).to_vec()));
    assert_eq!(particles.densities, Some(vec![1000.0, 1002.0, 1004.0]));
    assert_eq!(particles.radii, Some(vec![0.1, 0.3, 0.5]));
    // Ids that are not integers leave the ids out, of whatever particles they are.
    assert_eq!(particles.ids, Some(vec![10, 12, 14]));
    let expected = "2 of 5 particles have no finite position below 1e18 and are left out (the first: particle 1)";
    assert_eq!(remarks(&found), [expected]);
}

/// More than half of the particles without a place are damage, unless the caller knows better.
#[test]
fn many_particles_without_a_place_are_damage() {
    let text = "x,y,z\n0,0,0\n1,1e18,1\n2,-inf,2\n3,3,1.#QNAN\n4,4,4\n";
    let read = |text: &str, skip_invalid| {
        let options = ReadOptions { skip_invalid, ..ReadOptions::default() };
        Contents::parse(Path::new("a.csv"), text.as_bytes(), &options)
    };
    let error = read(text, false).unwrap_err();
    assert!(matches!(error, Error::Unplaced { row: 1, unplaced: 3, particles: 5, .. }), "{error}");
    let expected = "a.csv: line 3: particle 1: position [1.0, 1e18, 1.0]; 3 of 5 particles have no finite \
        position below 1e18";
    assert_eq!(error.to_string(), expected);
    assert_eq!(read(text, true).unwrap().particles.positions, [Vec3::ZERO, Vec3::splat(4.0)]);
    assert_eq!(read("x,y,z\nnan,0,0\n", true).unwrap().particles.len(), 0);
    // Half of them are not.
    assert_eq!(read("x,y,z\nnan,0,0\n1,2,3\n", false).unwrap().particles.len(), 1);
}

/// Particles far from 0 keep the precision of their places when another has none.
#[test]
fn a_particle_without_a_place_costs_no_precision() {
    let bytes: Vec<u8> = [2e8, 0.0, 0.0, f64::NAN, 0.0, 0.0, 2e8 + 0.125, 0.0, 0.0]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let particles = parse("a.npy", &npy("<f8", "False", "(3, 3)", &bytes)).particles;
    assert_eq!(particles.place(1).x - particles.place(0).x, 0.125);
}

#[test]
fn few_unusable_numbers_are_replaced() {
    let first = |what: &str, by: &str| {
        format!("{what} (the first: of particle 1), and {by} stands for them")
    };
    let mut numbers = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0];
    numbers[4] = f64::INFINITY;
    let found = archive("(4, 3)", &numbers, "velocity");
    let velocities = found.particles.velocities.clone().unwrap();
    assert_eq!((velocities[1], velocities[2]), (Vec3::ZERO, vec3(7.0, 8.0, 9.0)));
    let expected = first("velocity: 1 of 4 values are not finite", "0");
    assert_eq!(remarks(&found), [expected]);

    // 1e39 is infinite as a 32-bit float.
    let found = archive("(4,)", &[990.0, 1e39, 1000.0, 1010.0], "rho");
    assert_eq!(found.particles.densities, Some(vec![990.0, 1000.0, 1000.0, 1010.0]));
    let expected = first("rho: 1 of 4 values are not finite", "the median of the others");
    assert_eq!(remarks(&found), [expected]);

    let found = archive("(4, 1)", &[0.1, -1.0, f64::NAN, 0.1], "pscale");
    assert_eq!(found.particles.radii, Some(vec![0.1; 4]));
    let expected =
        first("pscale: 2 of 4 values are not finite or negative", "the median of the others");
    assert_eq!(remarks(&found), [expected]);
}

/// The file is read without an attribute that cannot be used, whatever its format.
#[test]
fn an_unusable_attribute_is_left_out() {
    let float_ids = archive("(4,)", &[0.0, 0.25, 1.0, 0.5], "id");
    let expected = "id is ignored: 2 of 4 values are not integers (the first: of particle 1)";
    assert_eq!(
        (float_ids.particles.ids.clone(), remarks(&float_ids)),
        (None, vec![expected.into()])
    );
    assert_eq!(float_ids.arrays[0].used_as, None);
    let found = csv("x,y,z,id", &["0,0,0,7", "1,0,0,0.5"]);
    assert_eq!((found.particles.len(), found.particles.ids), (2, None));
    let found = archive("(4,)", &[-1.0; 4], "radius");
    let expected =
        "radius is ignored: 4 of 4 values are not finite or negative (the first: of particle 0)";
    assert_eq!((found.particles.radii.clone(), remarks(&found)), (None, vec![expected.into()]));
    let found = archive("(4, 2)", &[1.0; 8], "density");
    let expected = "density is ignored: 2 numbers a particle, expected 1";
    assert_eq!((found.particles.densities.clone(), remarks(&found)), (None, vec![expected.into()]));

    let file = |name: &str, size: u16, kind: i32, value: &[u8]| {
        let header = bgeo_header(5, 1, &[(name, size, kind, &vec![0; 4 * usize::from(size)])]);
        [header, be([0.0, 0.0, 0.0, 1.0]), value.to_vec()].concat()
    };
    let cases = [
        (file("v", 3, 5, &be([0.0, f32::INFINITY, 0.0])), "v is ignored: 1 of 1 values"),
        (file("rho", 1, 0, &be([f32::NAN])), "rho is ignored"),
        (file("radius", 1, 0, &be([f32::NEG_INFINITY])), "radius is ignored"),
        (file("ids", 1, 0, &be([1.5])), "ids is ignored"),
        (file("density", 3, 5, &be([1.0, 0.0, 0.0])), "density is ignored: 3 numbers a particle"),
    ];
    for (bytes, expected) in cases {
        let found = parse("a.bgeo", &bytes);
        assert_eq!(found.particles.len(), 1);
        assert_eq!(super::all_names(&found.particles), Vec::<&str>::new());
        assert!(remarks(&found)[0].starts_with(expected), "{:?}", remarks(&found));
    }
}

/// Velocities of two numbers are those of a simulation in the plane in which the particles lie.
#[test]
fn velocities_of_two_numbers_lie_in_the_plane_of_the_particles() {
    let rows = |flat: fn(f32) -> [f32; 3]| (0..4_u8).map(move |i| flat(i.into()));
    let plane = |flat: fn(f32) -> [f32; 3]| {
        let places: Vec<u8> = rows(flat).flat_map(le).collect();
        let positions = ("positions.npy", npy("<f4", "False", "(4, 3)", &places));
        let velocities = le([1.0, 2.0]).repeat(4);
        let velocities = ("velocity.npy", npy("<f4", "False", "(4, 2)", &velocities));
        parse("a.npz", &npz(&[positions, velocities], false))
    };
    let first = |found: &Contents| found.particles.velocities.as_ref().map(|all| all[3]);
    assert_eq!(first(&plane(|i| [i, i * i, 0.0])), Some(vec3(1.0, 2.0, 0.0)));
    assert_eq!(first(&plane(|i| [i, 0.5, i * i])), Some(vec3(1.0, 0.0, 2.0)));
    let solid = plane(|i| [i, i * i, 1.0 / (1.0 + i)]);
    assert_eq!(first(&solid), None);
    assert_eq!(remarks(&solid), ["velocity is ignored: 2 numbers a particle, expected 3"]);

    let columns = csv("x,y,z,vx,vy", &["0,0,0,1,2", "1,1,0,3,4"]);
    let expected = vec![vec3(1.0, 2.0, 0.0), vec3(3.0, 4.0, 0.0)];
    assert_eq!(columns.particles.velocities, Some(expected));
}
