//! `.pos` and its ellipsoids, `.ani`: reading, drawing and writing.

use glam::{DMat3, Mat3, Vec3, dvec3};
use limpid::liquid::classify;
use limpid::liquid::{Ellipsoid, Particles};
use limpid::settings::Classify;
use limpid_io::particles::{Contents, ReadOptions};

use super::bgeo::bgeo;
use super::npy::npy_data;
use super::{check_left_out, check_message, le, patched, positions_only, read};

pub(crate) fn pos(radius: f32) -> Vec<u8> {
    [3_u32.to_le_bytes().to_vec(), le([radius]), npy_data()].concat()
}

#[test]
fn pos_variants() {
    let expected = Particles { radii: Some(vec![0.25; 3]), ..positions_only() };
    assert_eq!(read("frame.0001.pos", &pos(0.25)).unwrap(), expected);
    assert_eq!(read("a.pos", &pos(0.0)).unwrap(), positions_only());
    assert_eq!(read("a.pos", &[0; 8]).unwrap(), Particles::default());
}

#[test]
fn pos_malformed() {
    let count = |n: u32| [&n.to_le_bytes(), &pos(0.25)[4..]].concat();
    check_message("a.pos", &count(4), &["byte 8", "4 × 12 bytes", "36 are left"]);
    check_message("a.pos", &count(u32::MAX), &["byte 8", "4294967295 × 12"]);
    check_message("a.pos", &count(2), &["byte 32", "12 bytes are left"]);
    check_message("a.pos", &pos(-1.0), &["byte 4", "radius -1"]);
    check_message("a.pos", &pos(f32::NAN), &["byte 4", "radius NaN"]);
    let nan = patched(&pos(0.25), &le([4.0]), &le([f32::NAN]));
    check_left_out("a.pos", &nan, 1);
    check_message("a.pos", &bgeo(), &["a BGEO file"]);
}

/// The nine numbers are the columns of a matrix that maps the unit sphere to the ellipsoid, in units of
/// the radius; a rotation applied first has no effect.
#[test]
fn ellipsoids_are_read_from_ani() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.0001.pos");
    let symmetric = [2.0, 0.5, 0.25, 0.5, 1.0, -0.125, 0.25, -0.125, 0.5];
    let rotation = DMat3::from_axis_angle(dvec3(1.0, 2.0, 3.0).normalize(), 0.7);
    let turned = (Mat3::from_cols_array(&symmetric).as_dmat3() * rotation).as_mat3();
    let ani = |maps: [[f32; 9]; 3]| {
        [3_u32.to_le_bytes().to_vec(), maps.into_iter().flat_map(le).collect()].concat()
    };
    std::fs::write(&path, pos(0.25)).unwrap();
    assert_eq!(limpid_io::particles::read(&path).unwrap().ellipsoids, None);
    let maps = ani([symmetric, turned.to_cols_array(), [0.0; 9]]);
    std::fs::write(path.with_extension("ani"), &maps).unwrap();
    let ellipsoids = limpid_io::particles::read(&path).unwrap().ellipsoids.unwrap();
    let expected = Ellipsoid { xx: 2.0, yy: 1.0, zz: 0.5, xy: 0.5, yz: -0.125, xz: 0.25 };
    assert_eq!(ellipsoids[0], expected);
    let difference = ellipsoids[1].matrix() - expected.matrix();
    assert!(difference.to_cols_array().iter().all(|x| x.abs() < 1e-6), "{difference}");
    assert!(ellipsoids[0].drawable() && ellipsoids[1].drawable() && !ellipsoids[2].drawable());

    let damaged = |bytes: &[u8], fragments: &[&str]| {
        std::fs::write(path.with_extension("ani"), bytes).unwrap();
        let text = limpid_io::particles::read(&path).unwrap_err().to_string();
        for fragment in ["frame.0001.ani: byte"].iter().chain(fragments) {
            assert!(text.contains(fragment), "{fragment:?} not in: {text}");
        }
    };
    for length in 0..maps.len() {
        damaged(&maps[..length], &[]);
    }
    damaged(&[&maps[..], &[0]].concat(), &["1 bytes are left"]);
    damaged(&[&[2, 0, 0, 0], &maps[4..]].concat(), &["2 ellipsoids", "3 particles"]);
    // A map that is not finite is none that can be drawn.
    std::fs::write(path.with_extension("ani"), ani([[f32::INFINITY; 9], symmetric, symmetric]))
        .unwrap();
    let contents = Contents::read(&path, &ReadOptions::default()).unwrap();
    assert_eq!(contents.particles.ellipsoids.unwrap()[..2], [Ellipsoid::default(), expected]);
    let parts = ["ellipsoid: 1 of 3 values are not finite", "a fitted shape stands for them"];
    let remark = contents.remarks[0].to_string();
    assert!(parts.iter().all(|part| remark.contains(part)), "{remark}");
    // The ellipsoids of the particles that are left stay theirs.
    std::fs::write(&path, patched(&pos(0.25), &le([0.5]), &le([f32::NAN]))).unwrap();
    let contents = Contents::read(&path, &ReadOptions::default()).unwrap();
    assert_eq!(contents.particles.ellipsoids.unwrap(), [expected; 2]);
}

/// Particles of a block keep the ellipsoids and the positions of the file; one with an invalid ellipsoid
/// gets a fitted shape, and an isolated particle stays a sphere.
#[test]
fn ellipsoids_of_a_file_are_drawn() {
    let r = 0.025_f32;
    let cell = |i: usize| Vec3::new((i % 6) as f32, (i / 6 % 6) as f32, (i / 36) as f32);
    let mut positions: Vec<Vec3> = (0..216).map(|i| 2.0 * r * cell(i)).collect();
    positions.push(Vec3::splat(5.0));
    let shape = Ellipsoid { xx: 1.5, yy: 0.75, zz: 1.0, xy: 0.25, yz: -0.125, xz: 0.0625 };
    let mut ellipsoids = vec![shape; positions.len()];
    ellipsoids[3] = Ellipsoid { xx: -1.0, ..shape };
    let bare = Particles::from_positions(positions.clone());
    let shaped = Particles { ellipsoids: Some(ellipsoids), ..bare.clone() };
    // Shapes from the file do not take part in the refinement of the surface around them.
    let settings = Classify { iso_surface: false, ..Classify::default() };
    let fitted = classify::classify(&bare, r, &settings);
    let given = classify::classify(&shaped, r, &settings);
    assert_eq!(given.splashes, fitted.splashes);
    assert_eq!(given.aggregates.len(), fitted.aggregates.len());
    for (given, fitted) in given.aggregates.iter().zip(&fitted.aggregates) {
        if given.particle == 3 {
            assert_eq!(given, fitted);
            continue;
        }
        assert_ne!(given.diagonal, fitted.diagonal);
        assert_eq!(given.centre, positions[given.particle as usize].to_array());
        let r = f64::from(r);
        assert_eq!(given.diagonal, [1.5, 0.75, 1.0].map(|x: f64| (r * x) as f32));
        assert_eq!(given.off_diagonal, [0.25, 0.0625, -0.125].map(|x: f64| (r * x) as f32));
    }
}

/// Overwriting a frame removes the old frame's ellipsoids, which would be taken for those of the new
/// one.
#[test]
fn overwriting_a_frame_removes_its_ellipsoids() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pos");
    let shaped = Particles { ellipsoids: Some(vec![Ellipsoid::SPHERE; 3]), ..positions_only() };
    limpid_io::particles::write(&shaped, &path).unwrap();
    assert_eq!(limpid_io::particles::read(&path).unwrap(), shaped);
    limpid_io::particles::write(&positions_only(), &path).unwrap();
    assert_eq!(limpid_io::particles::read(&path).unwrap(), positions_only());
    assert!(!path.with_extension("ani").exists());
}

/// Ellipsoids keep their size when different radii, their units, are replaced by the mean.
#[test]
fn ellipsoids_keep_their_size_with_a_mean_radius() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pos");
    let radii = vec![1.0, 2.0, 6.0];
    let shape = Ellipsoid { xx: 2.0, ..Ellipsoid::SPHERE };
    let particles = Particles {
        radii: Some(radii.clone()),
        ellipsoids: Some(vec![shape; 3]),
        ..positions_only()
    };
    limpid_io::particles::write(&particles, &path).unwrap();
    let read = limpid_io::particles::read(&path).unwrap();
    assert_eq!(read.radii, Some(vec![3.0; 3]));
    for (ellipsoid, radius) in read.ellipsoids.unwrap().iter().zip(radii) {
        assert!((3.0 * ellipsoid.xx - 2.0 * radius).abs() < 1e-6);
        assert!((3.0 * ellipsoid.yy - radius).abs() < 1e-6);
    }
}
