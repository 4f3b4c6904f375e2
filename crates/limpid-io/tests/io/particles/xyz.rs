//! XYZ files, text and binary.

use super::bgeo::bgeo;
use super::npy::npy_data;
use super::{check_left_out, check_message, le, message, patched, positions_only, read};

#[test]
fn xyz_variants() {
    assert_eq!(read("a.xyz", &npy_data()).unwrap(), positions_only());
    let text = "0.5 -1.25 2\r\n3.5\t4  -5.75\n\n  0 1e-3 1e6";
    assert_eq!(read("a.xyz", text.as_bytes()).unwrap(), positions_only());
    assert!(read("a.xyz", b"").unwrap().is_empty());
}

#[test]
fn xyz_malformed() {
    let good = npy_data();
    check_message("a.xyz", &good[..35], &["byte 24", "particle 2", "12 bytes", "11 are left"]);
    let nan = patched(&good, &le([4.0]), &le([f32::NAN]));
    check_left_out("a.xyz", &nan, 1);
    // The same errors from a file, which is read by another path.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.xyz");
    let worse = patched(&nan, &le([-1.25]), &le([f32::INFINITY]));
    check_message("a.xyz", &worse, &["byte 4", "particle 0", "2 of 3 particles have no finite"]);
    for bytes in [&good[..35], &worse, b"x", &bgeo()] {
        std::fs::write(&path, bytes).unwrap();
        let error = limpid_io::particles::read(&path).unwrap_err().to_string();
        let expected = message("a.xyz", bytes);
        assert!(error.ends_with(expected.strip_prefix("a.xyz").unwrap()), "{error}");
    }
    check_message("a.xyz", b"1 2 3\n\n4 5\n", &["line 3", "particle 1", "2 words"]);
    check_message("a.xyz", b"1 2 3\nH 0 0\n", &["line 2", "number", "`H`"]);
    check_message("a.xyz", b"1 2 3\n4 5 inf\n6 nan 7\n", &["line 2", "particle 1", "position"]);
    check_message("a.xyz", &bgeo(), &["a BGEO file"]);
}
