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
    let all = patched(&good, &1120_u64.to_le_bytes(), &120_u64.to_le_bytes());
    let all = patched(&all, &1000_u64.to_le_bytes(), &0_u64.to_le_bytes());
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

/// `.prt` as Partio writes it (`PRT.cpp`): names with a capital, integers and floats of 32 bits, and attributes of text,
/// which its header counts, but which have no channel.
#[test]
fn partio() {
    let written = |texts: i32| {
        let mut bytes = b"\xc0PRT\r\n\x1a\n".to_vec();
        bytes.extend(56_i32.to_le_bytes());
        bytes.extend(b"Extensible Particle Format\0\0\0\0\0\0");
        bytes.extend(1_i32.to_le_bytes());
        bytes.extend(3_i64.to_le_bytes());
        bytes.extend([4, 4 + texts, 44].iter().flat_map(|n| n.to_le_bytes()));
        let channels =
            [("Id", 1, 1, 0), ("Position", 4, 3, 4), ("Radius", 4, 1, 16), ("Velocity", 4, 3, 20)];
        for (name, kind, numbers, offset) in channels {
            let mut padded = name.as_bytes().to_vec();
            padded.resize(32, 0);
            bytes.extend(padded);
            bytes.extend([kind, numbers, offset].iter().flat_map(|n: &i32| n.to_le_bytes()));
        }
        let mut rows = Vec::new();
        for n in 0..3_i16 {
            rows.extend(i32::from(7 + n).to_le_bytes());
            let numbers = [f32::from(n), 0.5, -2.0, 0.25, 0.0, f32::from(n), 1.0];
            rows.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        }
        [bytes, super::damaged::zlib(&rows)].concat()
    };
    for texts in [0, 2] {
        let particles =
            limpid_io::particles::parse(Path::new("a.prt"), &written(texts)).expect("valid");
        assert_eq!(particles.positions[2].to_array(), [2.0, 0.5, -2.0]);
        assert_eq!(particles.velocities.expect("velocities")[1].to_array(), [0.0, 1.0, 1.0]);
        assert_eq!((particles.ids, particles.radii), (Some(vec![7, 8, 9]), Some(vec![0.25; 3])));
    }
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
    // Where the velocities are.
    let [at, elsewhere] =
        [0, 12].map(|offset| [&kind[..], &int(4), &int(3), &int(offset)].concat());
    message(&at, &elsewhere, &["channels that lie in one another"]);
    check_message("a.prt", b"nonsense", &["not particles of Krakatoa"]);
}

/// Other files of mantaflow are named for what they are.
#[test]
fn mantaflow() {
    check_message("a.uni", &gzip(b"PD01...."), &["one attribute", "file of positions"]);
    check_message("a.uni", &gzip(b"MNT3...."), &["a grid of mantaflow"]);
    check_message("a.uni", b"nonsense", &["not particles of mantaflow"]);
    let head = [&b"PB02"[..], &[0xff; 4], &[0; 16], &int(16), &[0; 264]].concat();
    check_message("a.uni", &gzip(&head), &["byte 4", "-1 particles, expected 0 or more"]);
    let wide = [&b"PB02"[..], &[1; 20], &int(28), &[0; 264]].concat();
    check_message("a.uni", &wide, &["particles of 16 bytes, found 28"]);
}
