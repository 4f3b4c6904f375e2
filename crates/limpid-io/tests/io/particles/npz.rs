//! `NumPy` archives, stored and deflated.

use std::io::Write;

use flate2::write::DeflateEncoder;
use flate2::{Compression, Crc};

use super::npy::{npy, npy_data, npy_fortran};
use super::{
    DENSITIES, IDS, RADII, VELOCITIES, all_attributes, be, check_message, le, patched,
    positions_only, read,
};

/// A zip archive of named members, stored or deflated.
pub(crate) fn npz(members: &[(&str, Vec<u8>)], deflated: bool) -> Vec<u8> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, contents) in members {
        let mut crc = Crc::new();
        crc.update(contents);
        let stored = if deflated {
            let mut encoder = DeflateEncoder::new(Vec::new(), Compression::fast());
            encoder.write_all(contents).unwrap();
            encoder.finish().unwrap()
        } else {
            contents.clone()
        };
        let method = if deflated { 8_u16 } else { 0 };
        let mut common = 20_u16.to_le_bytes().to_vec(); // version 2.0
        common.extend([0; 2]);
        common.extend(method.to_le_bytes());
        common.extend([0, 0, 0x21, 0]); // 1 January 1980
        for number in [crc.sum(), stored.len() as u32, contents.len() as u32] {
            common.extend(number.to_le_bytes());
        }
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0; 2]);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend((bytes.len() as u32).to_le_bytes());
        directory.extend(name.bytes());
        bytes.extend(b"PK\x03\x04");
        bytes.extend(&common);
        bytes.extend(name.bytes());
        bytes.extend(stored);
    }
    let start = bytes.len() as u32;
    let count = (members.len() as u16).to_le_bytes();
    bytes.extend(&directory);
    bytes.extend(b"PK\x05\x06\x00\x00\x00\x00");
    bytes.extend([count, count].concat());
    bytes.extend((directory.len() as u32).to_le_bytes());
    bytes.extend(start.to_le_bytes());
    bytes.extend([0; 2]);
    bytes
}

pub(crate) fn npz_members() -> Vec<(&'static str, Vec<u8>)> {
    let velocities = VELOCITIES.into_iter().flat_map(le).collect::<Vec<_>>();
    let ids = IDS.into_iter().flat_map(i32::to_le_bytes).collect::<Vec<_>>();
    vec![
        ("vel.npy", npy("<f4", "False", "(3, 3)", &velocities)),
        ("time.npy", npy("<f8", "False", "()", &[0; 8])),
        ("names.npy", npy("|O", "False", "(2,)", &[1, 2])),
        ("positions.npy", npy("<f4", "False", "(3, 3)", &npy_data())),
        ("readme.txt", b"nothing of ours".to_vec()),
        ("rho.npy", npy(">f4", "False", "(3,)", &be(DENSITIES))),
        ("radius.npy", npy("<f4", "True", "(3, 1)", &le(RADII))),
        ("ids.npy", npy("<i4", "False", "(3,)", &ids)),
    ]
}

#[test]
fn npz_variants() {
    for deflated in [false, true] {
        assert_eq!(read("a.npz", &npz(&npz_members(), deflated)).unwrap(), all_attributes());
        let float = npy("<f4", "False", "(3, 3)", &npy_data());
        for name in ["position.npy", "POS.npy", "x.npy", "points.npy", "arr_0.npy", "other.npy"] {
            let one = npz(&[(name, float.clone())], deflated);
            assert_eq!(read("a.npz", &one).unwrap(), positions_only(), "{name}");
        }
        let wide = npz(&[("x.npy", npy_fortran())], deflated);
        assert_eq!(read("a.npz", &wide).unwrap(), positions_only());
        // An array `x` is not one column of the positions, and a velocity is not a position.
        let velocity = ("v.npy", npy("<f4", "False", "(3, 3)", &npy_data()));
        let x = ("x.npy", npy("<f4", "False", "(9,)", &npy_data()));
        check_message("a.npz", &npz(&[velocity, x], deflated), &["(n, 3)", "v, x"]);
        let two = npz(&[("a.npy", float.clone()), ("b.npy", float.clone())], deflated);
        check_message("a.npz", &two, &["nor a single other one", "a, b"]);
    }
}

/// Objects that `PySPH` has pickled are named, with a whole line that unpacks them.
#[test]
fn pickled_arrays_are_named() {
    let object = npy("|O", "False", "()", b"\x80\x04}.");
    let pysph = npz(
        &[("version.npy", npy("<i8", "False", "()", &[0; 8])), ("particles.npy", object)],
        false,
    );
    check_message(
        "a.npz",
        &pysph,
        &["pickled by Python", "allow_pickle", "density=f['rho'])\"` writes"],
    );
}

#[test]
fn npz_malformed() {
    let good = npz(&npz_members(), false);
    let short =
        npz(&[npz_members()[3].clone(), ("rho.npy", npy("<f4", "False", "(2,)", &[0; 8]))], true);
    check_message("a.npz", &short, &["(rho.npy)", "byte 128", "2 entries for 3 particles"]);
    let claim = npz(&[("x.npy", npy("<f4", "False", "(2147483647, 3)", &npy_data()))], true);
    check_message("a.npz", &claim, &["(x.npy)", "byte", "2147483647 × 12"]);
    let nan = npz(&[("x.npy", npy("<f4", "False", "(1, 3)", &le([0.0, f32::NAN, 0.0])))], true);
    check_message("a.npz", &nan, &["(x.npy)", "byte 132", "particle 0", "position"]);
    let crc = patched(&good, &be([998.5]), &be([998.0]));
    check_message("a.npz", &crc, &["(rho.npy)", "damaged"]);
    check_message("a.npz", &good[..good.len() - 9], &["byte", "damaged"]);
    check_message("a.npz", &npz(&[], false), &["no array"]);
    check_message("a.npz", &npy_data(), &["not an archive"]);
}
