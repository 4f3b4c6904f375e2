//! Single `NumPy` arrays.

use std::path::Path;

use glam::Vec3;
use limpid_io::particles::{Contents, ReadOptions};

use super::{POSITIONS, be, check_left_out, check_message, le, patched, positions_only, read};

pub(crate) fn npy(kind: &str, fortran: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let mut header =
        format!("{{'descr': '{kind}', 'fortran_order': {fortran}, 'shape': {shape}, }}");
    header += &" ".repeat(63 - (10 + header.len()) % 64);
    header += "\n";
    let length = (header.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), data].concat()
}

pub(crate) fn npy_data() -> Vec<u8> {
    POSITIONS.into_iter().flat_map(le).collect()
}

pub(crate) fn npy_fortran() -> Vec<u8> {
    let axes = [0, 1, 2].map(|k| POSITIONS.map(|p| f64::from(p[k]).to_be_bytes()).concat());
    npy(">f8", "True", "(3, 3)", &axes.concat())
}

#[test]
fn npy_variants() {
    let doubles = POSITIONS.map(|p| p.map(|x| f64::from(x).to_le_bytes()).concat()).concat();
    let floats = POSITIONS.map(be).concat();
    let variants = [
        npy("<f4", "False", "(3, 3)", &npy_data()),
        npy(">f4", "False", "(3, 3)", &floats),
        npy("<f8", "False", "(3, 3)", &doubles),
        npy_fortran(),
    ];
    for bytes in &variants {
        assert_eq!(read("a.npy", bytes).unwrap(), positions_only());
    }
    // Whole numbers and half floats are numbers too.
    let whole: Vec<u8> = (0..9_i32).flat_map(i32::to_le_bytes).collect();
    let halves: Vec<u8> = [0_u16, 0x3c00, 0x4000].into_iter().flat_map(u16::to_le_bytes).collect();
    let first = |bytes: &[u8]| read("a.npy", bytes).unwrap().positions[0];
    for bytes in [npy("<i4", "False", "(3, 3)", &whole), npy("<f2", "False", "(1, 3)", &halves)] {
        assert_eq!(first(&bytes), Vec3::new(0.0, 1.0, 2.0));
    }
    // Version 2 has a longer length field.
    let v1 = &variants[0];
    let v2 = [b"\x93NUMPY\x02\x00", &v1[8..10], &[0, 0], &v1[10..]].concat();
    assert_eq!(read("a.npy", &v2).unwrap(), positions_only());
    assert!(read("a.npy", &npy("<f4", "False", "(0, 3)", &[])).unwrap().is_empty());
}

/// The first three of more columns are the positions; the others are listed as ignored.
#[test]
fn npy_of_more_columns() {
    let data: Vec<u8> = (0..16).flat_map(|n| (n as f32).to_le_bytes()).collect();
    let bytes = npy("<f4", "False", "(4, 4)", &data);
    let contents = Contents::parse(Path::new("a.npy"), &bytes, &ReadOptions::default());
    let contents = contents.expect("valid");
    let expected =
        [[0.0, 1.0, 2.0], [4.0, 5.0, 6.0], [8.0, 9.0, 10.0], [12.0, 13.0, 14.0]].map(Vec3::from);
    assert_eq!(contents.particles.positions, expected);
    let arrays: Vec<String> = contents.arrays.iter().map(ToString::to_string).collect();
    assert_eq!(arrays, ["columns after the third (4, 1)"]);
    assert!(contents.arrays[0].used_as.is_none());
}

#[test]
fn npy_malformed() {
    let data = npy_data();
    let shaped = |shape: &str| npy("<f4", "False", shape, &data);
    check_message("a.npy", &shaped("(4, 3)"), &["byte 128", "4 × 12 bytes", "36 are left"]);
    check_message("a.npy", &shaped("(2147483647, 3)"), &["byte", "2147483647 × 12"]);
    check_message("a.npy", &shaped("(18446744073709551615, 3)"), &["byte", "are left"]);
    check_message("a.npy", &shaped("(-1, 3)"), &["byte", "count", "-1"]);
    for shape in ["(3,)", "(9, 1)", "(1, 1, 3, 3)", "()"] {
        check_message("a.npy", &shaped(shape), &[shape, "expected (n, 3)"]);
    }
    check_message("a.npy", &shaped("3"), &["byte", "`shape`"]);
    for kind in ["|u1", "|b1", "|O", "<c8"] {
        check_message("a.npy", &npy(kind, "False", "(3, 3)", &data), &[kind, "expected floats"]);
    }
    check_message("a.npy", &npy("<f4", "Maybe", "(3, 3)", &data), &["`fortran_order`"]);
    let nested = npy("<f4", "False", &"(".repeat(50_000), &data);
    check_message("a.npy", &nested, &["byte", "`shape`"]);
    let nan = patched(&shaped("(3, 3)"), &le([4.0]), &le([f32::NAN]));
    check_left_out("a.npy", &nan, 1);
    let nan = patched(&npy_fortran(), &4.0_f64.to_be_bytes(), &f64::NAN.to_be_bytes());
    check_left_out("a.npy", &nan, 1);
    check_message("a.npy", b"\x93NUMPY\x09\x00", &["version 9"]);
}
