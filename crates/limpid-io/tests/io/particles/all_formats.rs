//! Robustness of all formats: damaged files neither panic nor pass as valid, and foreign files are
//! identified.

use std::path::Path;

use limpid::liquid::Particles;
use limpid_io::Error;
use limpid_io::particles::{Contents, ReadOptions};

use super::bgeo::{bgeo, gzip};
use super::csv::CSV;
use super::npy::{npy, npy_data, npy_fortran};
use super::npz::{npz, npz_members};
use super::other_programs::file;
use super::ply::{ply_ascii, ply_binary, ply_elaborate};
use super::pos::pos;
use super::vtk::{VTK_ASCII, vtk_4_1, vtk_5_1};
use super::vtu::{Headers, PLAIN, Stored, vtu};
use super::{all_attributes, check_message, read};

const EXTENDED: &str = "3\nProperties=species:S:1:pos:R:3:velo:R:3:id:I:1\n\
    O 1 2 3 0 0 1 7\nO 4 5 6 0 0 1 8\nO 7 8 9 0 0 1 9\n";

const DUMP: &str = "ITEM: TIMESTEP\n5\nITEM: NUMBER OF ATOMS\n3\nITEM: BOX BOUNDS pp pp pp\n0 1\n0 1\n0 1\n\
    ITEM: ATOMS id xs ys zs\n1 0.1 0.2 0.3\n2 0.4 0.5 0.6\n3 0.7 0.8 0.9\n";

/// One valid file of each kind.
fn samples() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("a.bgeo", bgeo()),
        ("b.bgeo", gzip(&bgeo())),
        ("a.vtk", vtk_4_1()),
        ("b.vtk", vtk_5_1()),
        ("c.vtk", VTK_ASCII.into()),
        ("a.ply", ply_binary("little")),
        ("b.ply", ply_binary("big")),
        ("c.ply", ply_elaborate()),
        ("d.ply", ply_ascii().into()),
        ("a.npy", npy("<f4", "False", "(3, 3)", &npy_data())),
        ("b.npy", npy_fortran()),
        ("a.xyz", npy_data()),
        ("b.xyz", b"0.5 1 2\n3 4 5\n6 7 8".into()),
        ("a.vtu", vtu("UnstructuredGrid", &[3], Stored::Ascii, PLAIN)),
        ("b.vtu", vtu("UnstructuredGrid", &[1, 2], Stored::Inline, PLAIN)),
        ("c.vtu", {
            let headers = Headers { big: true, long: true, ..PLAIN };
            vtu("UnstructuredGrid", &[3], Stored::AppendedBase64, headers)
        }),
        ("d.vtu", {
            let headers = Headers { zlib: Some(16), ..PLAIN };
            vtu("UnstructuredGrid", &[3], Stored::AppendedRaw, headers)
        }),
        ("a.npz", npz(&npz_members()[..4], false)),
        ("b.npz", npz(&npz_members()[3..], true)),
        ("a.pos", pos(0.25)),
        ("a.csv", CSV.into()),
        ("a.extxyz", EXTENDED.into()),
        ("c.xyz", EXTENDED.into()),
        ("a.lammpstrj", DUMP.into()),
        ("e.vtu", std::fs::read(file("vtk_lz4_appended.vtu")).expect("a file")),
        ("c.bgeo", std::fs::read(file("houdini.bgeo")).expect("a file")),
        ("a.bgeo.sc", std::fs::read(file("houdini.bgeo.sc")).expect("a file")),
        ("a.geo", std::fs::read(file("houdini.geo")).expect("a file")),
        ("a.bi4", std::fs::read(file("Part_0005.bi4")).expect("a file")),
        ("a.prt", std::fs::read(file("krakatoa.prt")).expect("a file")),
        ("a.uni", std::fs::read(file("mantaflow.uni")).expect("a file")),
        ("a.h5", std::fs::read(file("plain.h5")).expect("a file")),
    ]
}

/// A file truncated at any byte (a large one at every few) is an error, or yields all its particles. (Only .xyz and .csv have no
/// count to check.)
#[test]
fn truncation_is_detected_everywhere() {
    for (name, bytes) in samples() {
        for length in (0..bytes.len()).step_by(1 + bytes.len() / 1500) {
            match read(name, &bytes[..length]) {
                Ok(particles) if name.ends_with("xyz") || name.ends_with("csv") => {
                    assert!(particles.len() <= 3);
                }
                Ok(particles) => {
                    let by_others = [
                        "e.vtu",
                        "c.bgeo",
                        "a.bgeo.sc",
                        "a.geo",
                        "a.bi4",
                        "a.prt",
                        "a.uni",
                        "a.h5",
                    ];
                    let count = if by_others.contains(&name) { 120 } else { 3 };
                    assert_eq!(particles.len(), count, "{name} cut to {length}");
                }
                Err(error) => assert!(error.to_string().contains(name), "{error}"),
            }
        }
    }
}

/// Any single-bit error yields an error or valid particles.
#[test]
fn bit_flips_never_panic() {
    for (name, mut bytes) in samples() {
        // In large files some bits are enough.
        for bit in (0..8 * bytes.len()).step_by(1 + bytes.len() / 1500 * 7) {
            bytes[bit / 8] ^= 1 << (bit % 8);
            if let Ok(particles) = read(name, &bytes) {
                assert_valid(&particles);
            }
            // Arrays that are described and shown are unpacked too.
            let shown = Some("color".to_owned());
            let options = ReadOptions { values: true, shown, ..ReadOptions::default() };
            let _ = Contents::parse(Path::new(name), &bytes, &options);
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
    }
}

fn assert_valid(particles: &Particles) {
    let n = particles.len();
    let lengths = [
        particles.velocities.as_ref().map(Vec::len),
        particles.densities.as_ref().map(Vec::len),
        particles.radii.as_ref().map(Vec::len),
        particles.ids.as_ref().map(Vec::len),
        particles.ellipsoids.as_ref().map(Vec::len),
    ];
    assert!(lengths.iter().flatten().all(|&length| length == n));
    assert!(particles.positions.iter().all(|p| p.is_finite()));
    assert!(particles.velocities.iter().flatten().all(|v| v.is_finite()));
    assert!(particles.densities.iter().flatten().all(|rho| rho.is_finite()));
    assert!(particles.radii.iter().flatten().all(|r| r.is_finite() && *r >= 0.0));
}

#[test]
fn foreign_files_are_identified() {
    let mut stl = vec![0; 84 + 50];
    stl[80] = 1;
    let houdini = b"\x7fNSJb\x00\x00\x00";
    check_message("a.bgeo", houdini, &["no number `pointcount`"]);
    check_message("a.bgeo", &stl, &["binary STL"]);
    for name in ["a.vtk", "a.ply", "a.npy", "a.xyz"] {
        assert!(matches!(read(name, &stl), Err(Error::Format { .. })), "{name}");
        check_message(name, &stl, &["binary STL"]);
        check_message(name, houdini, &["Houdini's new", ".bgeo"]);
        check_message(name, b"<?xml version=\"1.0\"?>\n", &["XML", ".vtu"]);
    }
    for name in ["a.vtu", "a.vtp", "a.npz", "a.pos", "a.csv"] {
        check_message(name, &stl, &["binary STL"]);
        check_message(name, houdini, &["Houdini's new", ".bgeo"]);
    }
    check_message("a.vtu", b"<?xml version=\"1.0\"?>\n<html/>", &["XML, but not VTK's"]);
    for name in ["a.bgeo", "a.vtk", "a.ply", "a.npy", "a.vtu", "a.npz"] {
        check_message(name, b"", &["an empty file"]);
        check_message(name, b"nonsense", &["an unknown kind"]);
    }
    check_message("a.ply", &vtk_4_1(), &["a legacy VTK file, not a PLY file"]);
    check_message("a.vtk", &gzip(&vtk_4_1()), &["gzip", "unpack"]);
    check_message("a.bgeo", &gzip(b"ply\n"), &["a PLY file"]);
}

#[test]
fn unknown_extensions_are_errors_with_a_remedy() {
    check_message("a.pvd", b"", &["list of files", "sequence"]);
    check_message("a.ani", b"", &["ellipsoids", ".pos"]);
    check_message("a.stl", b"", &["a mesh", "a surface", "limpid draws particles", ".ply"]);
    check_message("a.usda", b"", &["USD", "pip install usd-core", "'Point' in", "or [0])]\"`"]);
    check_message("a.xdmf", b"<?xml", &["XDMF", ".h5", ".vtu"]);
    check_message("a.ABC", b"", &["Alembic", "ply_export"]);
    check_message("run.tar.gz", b"", &["an archive", "unpack"]);
    check_message("a.ffp3", b"", &["FLIP Fluids", ".ply"]);
    check_message("PartInfo.ibi4", b"", &["DualSPHysics", "Part_0000.bi4"]);
    check_message("a.nothing", b"", &["does not know", ".bgeo", ".npy"]);
    check_message("ply", b"", &["does not know"]);
    assert!(matches!(read("a.obj", b""), Err(Error::Format { .. })));
}

#[test]
fn a_file_is_read_like_its_contents() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    std::fs::write(&path, ply_ascii()).unwrap();
    assert_eq!(limpid_io::particles::read(&path).unwrap(), all_attributes());
}

#[test]
fn a_missing_file_is_an_io_error() {
    let error = limpid_io::particles::read(Path::new("no-such-file.ply")).unwrap_err();
    assert!(matches!(error, Error::Io { .. }));
    assert!(error.to_string().contains("no-such-file.ply: cannot read"), "{error}");
}
