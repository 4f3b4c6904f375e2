//! BGEO files of version 5, plain and gzipped, and checks of attributes common to all formats.

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::Vec3;
use limpid::liquid::Particles;

use super::{
    DENSITIES, IDS, POSITIONS, RADII, VELOCITIES, all_attributes, be, check_left_out,
    check_message, patched, positions_only, read,
};

/// Header of a file with these point attributes: name, size, type, defaults or strings.
pub(crate) fn bgeo_header(
    version: i32,
    points: i32,
    attributes: &[(&str, u16, i32, &[u8])],
) -> Vec<u8> {
    let mut bytes = b"BgeoV".to_vec();
    for number in [version, points, 0, 0, 0, attributes.len() as i32, 0, 0, 0] {
        bytes.extend(number.to_be_bytes());
    }
    for (name, size, kind, defaults) in attributes {
        bytes.extend((name.len() as u16).to_be_bytes());
        bytes.extend(name.as_bytes());
        bytes.extend(size.to_be_bytes());
        bytes.extend(kind.to_be_bytes());
        bytes.extend(*defaults);
    }
    bytes
}

pub(crate) fn bgeo() -> Vec<u8> {
    let strings = [&[0, 0, 0, 2, 0, 1][..], b"a", &[0, 2], b"bc"].concat();
    let mut bytes = bgeo_header(
        5,
        3,
        &[
            ("id", 1, 1, &[0; 4]),
            ("group", 1, 4, &strings),
            ("velocity", 3, 5, &[0; 12]),
            ("uv", 2, 0, &[0; 8]),
            ("density", 1, 0, &[0; 4]),
            ("pscale", 1, 0, &[0; 4]),
        ],
    );
    for i in 0..3 {
        bytes.extend(be(POSITIONS[i]));
        bytes.extend(be([1.0]));
        bytes.extend(IDS[i].to_be_bytes());
        bytes.extend([0, 0, 0, 1]);
        bytes.extend(be(VELOCITIES[i]));
        bytes.extend(be([0.5, f32::NAN])); // unused attributes are not checked
        bytes.extend(be([DENSITIES[i], RADII[i]]));
    }
    bytes.extend([0x00, 0xff]);
    bytes
}

fn bgeo_positions_only() -> Vec<u8> {
    let mut bytes = bgeo_header(5, 3, &[]);
    for position in POSITIONS {
        bytes.extend(be(position));
        bytes.extend(be([1.0]));
    }
    bytes
}

pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn bgeo_variants() {
    assert_eq!(read("a.bgeo", &bgeo()).unwrap(), all_attributes());
    assert_eq!(read("a.BGEO", &bgeo_positions_only()).unwrap(), positions_only());
    assert_eq!(read("a.bhclassic", &bgeo()).unwrap(), all_attributes());
    assert_eq!(read("a.bgeo", &bgeo_header(5, 0, &[])).unwrap(), Particles::default());
    // Simulators write gzip without `.gz` in the name.
    assert_eq!(read("a.bgeo", &gzip(&bgeo())).unwrap(), all_attributes());
    assert_eq!(read("a.bgeo.gz", &gzip(&bgeo())).unwrap(), all_attributes());
}

#[test]
fn bgeo_malformed() {
    let good = bgeo_positions_only();
    let count = |n: i32| patched(&good, &[0, 0, 0, 3], &n.to_be_bytes());
    check_message("a.bgeo", &count(4), &["byte 41", "points", "4 × 16 bytes", "48 are left"]);
    check_message("a.bgeo", &count(i32::MAX), &["byte 41", "2147483647"]);
    check_message("a.bgeo", &count(-1), &["byte 9", "0 or more", "-1"]);
    let attributes = |n: i32| [&good[..25], &n.to_be_bytes(), &good[29..]].concat();
    check_message("a.bgeo", &attributes(-2), &["byte 25", "attributes", "-2"]);
    check_message("a.bgeo", &attributes(i32::MAX), &["byte"]);
    check_message("a.bgeo", &bgeo_header(4, 0, &[]), &["version 4", ".bhclassic"]);
    check_message("a.bgeo", &bgeo_header(5, 0, &[("s", 1, 2, &[])]), &["byte", "s has type 2"]);
    let strings = bgeo_header(5, 0, &[("s", 1, 4, &[0xff; 4])]);
    check_message("a.bgeo", &strings, &["byte", "strings", "-1"]);
    let nan = patched(&good, &be([4.0]), &be([f32::NAN]));
    check_left_out("a.bgeo", &nan, 1);
    let mut cut = gzip(&bgeo());
    cut.truncate(cut.len() - 12);
    check_message("a.bgeo", &cut, &["byte", "gzip"]);
}

/// Written files are read back bit-identically, plain and gzipped, as baked frames require.
#[test]
fn bgeo_round_trip() {
    let folder = tempfile::tempdir().unwrap();
    let places = [Vec3::new(0.1, -2.0, 3e-7), Vec3::ZERO, Vec3::splat(7.5)];
    let bare = Particles::from_positions(places.to_vec());
    let full = Particles {
        velocities: Some(vec![Vec3::X, Vec3::NEG_Y, Vec3::new(0.3, 0.2, 0.1)]),
        densities: Some(vec![1000.0, 998.5, 1.0]),
        radii: Some(vec![0.1, 0.0, 0.25]),
        ids: Some(vec![7, -3, i32::MAX.into()]),
        ..bare.clone()
    };
    for particles in [Particles::default(), bare, full.clone()] {
        for name in ["a.bgeo", "a.bgeo.gz", "a.bhclassic"] {
            let path = folder.path().join(name);
            limpid_io::particles::write(&particles, &path).unwrap();
            assert_eq!(limpid_io::particles::read(&path).unwrap(), particles, "{name}");
        }
    }
    let large = Particles { ids: Some(vec![1 << 40, 0, 0]), ..full };
    let path = folder.path().join("large.bgeo");
    assert!(
        limpid_io::particles::write(&large, &path).unwrap_err().to_string().contains("32-bit ids")
    );
    assert!(!path.exists());
}
