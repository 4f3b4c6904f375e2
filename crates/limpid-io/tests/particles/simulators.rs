//! Files of DualSPHysics, Krakatoa and mantaflow: errors that name the place. Their contents are checked with
//! those of the other programs.

use std::path::Path;

use limpid_io::particles::{Contents, ReadOptions};

use super::bgeo::gzip;
use super::other_programs::file;
use super::{check_message, patched};

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(file(name)).expect("a file")
}

fn int(number: u32) -> [u8; 4] {
    number.to_le_bytes()
}

/// Only the fluid of DualSPHysics is read, with half of the distance between particles as its radius.
#[test]
fn dualsphysics() {
    let good = bytes("Part_0005.bi4");
    let read = |bytes: &[u8]| {
        Contents::parse(Path::new("a.bi4"), bytes, &ReadOptions::default())
            .expect("valid")
            .particles
    };
    let fluid = read(&good);
    assert_eq!((fluid.len(), fluid.radii.as_deref()), (120, Some(&[0.05; 120][..])));
    // Without bodies all of it is fluid.
    let all = patched(&good, &1000_u64.to_le_bytes(), &0_u64.to_le_bytes());
    assert_eq!(read(&all).len(), 130);

    let message = |from: &[u8], to: &[u8], parts: &[&str]| {
        check_message("a.bi4", &patched(&good, from, to), parts);
    };
    message(b"Posd", b"Posx", &["no array `Pos`", "Part_0000.bi4"]);
    message(b"#FileJBD", b"#FileJBE", &["not a file of DualSPHysics"]);
    message(b"\nVALUES", b"\nVALUEZ", &["byte 131", "expected VALUES"]);
    message(&int(3120), &int(3121), &["byte", "array Posd: 3121 bytes, expected 130 × 24"]);
    message(&int(3120), &int(u32::MAX), &["byte", "Posd", "4294967295", "are left"]);
    message(b"Dp\x0c", b"Dp\x63", &["unknown type 99"]);
}

/// Channels of Krakatoa: 16-bit velocities, ids, and a density that is not one of mass.
#[test]
fn krakatoa() {
    let good = bytes("krakatoa.prt");
    let options = ReadOptions::default();
    let contents = Contents::parse(Path::new("a.prt"), &good, &options).expect("valid");
    let names: Vec<String> = contents.arrays.iter().map(ToString::to_string).collect();
    assert_eq!(names, ["Velocity (120, 3)", "ID (120)", "Density (120)"]);
    assert_eq!(contents.particles.densities, None);
    let mapped = ReadOptions { map: "density=Density".parse().expect("a map"), ..options };
    let mapped = Contents::parse(Path::new("a.prt"), &good, &mapped).expect("valid");
    assert_eq!(mapped.particles.densities, Some(vec![0.05; 120]));

    let message = |from: &[u8], to: &[u8], parts: &[&str]| {
        check_message("a.prt", &patched(&good, from, to), parts);
    };
    message(&120_i64.to_le_bytes(), &(-1_i64).to_le_bytes(), &["byte 48", "did not finish"]);
    message(&120_i64.to_le_bytes(), &121_i64.to_le_bytes(), &["particles expected, found"]);
    message(&120_i64.to_le_bytes(), &(1_i64 << 40).to_le_bytes(), &["a.prt"]);
    message(b"Position", b"Location", &["no channel Position"]);
    let mut kind = [0; 32];
    kind[..8].copy_from_slice(b"Position");
    let unknown = [&kind[..], &int(77)].concat();
    message(&[&kind[..], &int(4)].concat(), &unknown, &["channel Position", "unknown type"]);
    check_message("a.prt", b"nonsense", &["not particles of Krakatoa"]);
}

/// Other files of mantaflow are named for what they are.
#[test]
fn mantaflow() {
    check_message("a.uni", &gzip(b"PD01...."), &["one attribute", "file of positions"]);
    check_message("a.uni", &gzip(b"MNT3...."), &["a grid of mantaflow"]);
    check_message("a.uni", b"nonsense", &["not particles of mantaflow"]);
    let head = [&b"PB02"[..], &[0xff; 4], &[0; 16], &int(16), &[0; 264]].concat();
    check_message("a.uni", &gzip(&head), &["byte 292", "4294967295 × 16 bytes", "0 are left"]);
    let wide = [&b"PB02"[..], &[1; 20], &int(28), &[0; 264]].concat();
    check_message("a.uni", &wide, &["particles of 16 bytes, found 28"]);
}
