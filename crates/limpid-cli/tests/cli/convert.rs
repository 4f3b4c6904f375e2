//! `limpid convert`: names and contents of the written files, messages about attributes that a format
//! cannot store, and no unfinished files after errors.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use glam::Vec3;
use limpid::liquid::{Ellipsoid, Particles};
use tempfile::TempDir;

/// Runs `limpid convert`; returns exit code and stderr.
fn convert(folder: &Path, args: &[&str]) -> (i32, String) {
    let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_limpid"));
    let output = command.current_dir(folder).arg("convert").args(args).output().unwrap();
    assert_eq!(String::from_utf8(output.stdout).unwrap(), "", "{args:?}: nothing is printed");
    (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
}

#[track_caller]
fn succeed(folder: &Path, args: &[&str]) {
    assert_eq!(convert(folder, args), (0, String::new()), "{args:?}");
}

/// Runs a conversion that must fail with `code` and one line, and returns that line.
#[track_caller]
fn fail(folder: &Path, code: i32, args: &[&str]) -> String {
    let (found, stderr) = convert(folder, args);
    assert_eq!(found, code, "{args:?}: {stderr}");
    assert!(stderr.starts_with("limpid: ") && stderr.matches('\n').count() == 1, "{stderr}");
    stderr
}

/// Names of all entries of a folder, including hidden files.
fn names(folder: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).unwrap();
    entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

#[track_caller]
fn assert_names(folder: &Path, expected: &[&str]) {
    assert_eq!(names(folder), expected.iter().map(|&name| name.to_owned()).collect());
}

fn particles(n: usize) -> Particles {
    let positions = (0..n).map(|i| Vec3::new(i as f32, 0.5, -0.25 * i as f32)).collect();
    Particles {
        velocities: Some(vec![Vec3::Z; n]),
        ids: Some((0..n as i64).collect()),
        ..Particles::from_positions(positions)
    }
}

/// Frames 8 to 11, of 8 to 11 particles.
fn sequence() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for n in 8..12 {
        limpid_io::particles::write(&particles(n), &folder.path().join(format!("water_{n}.vtk")))
            .unwrap();
    }
    folder
}

fn read(folder: &Path, name: &str) -> Particles {
    limpid_io::particles::read(&folder.join(name)).unwrap()
}

/// The output is an argument, or `-o` as of other commands.
#[test]
fn the_output_may_be_named_as_elsewhere() {
    let folder = sequence();
    let folder = folder.path();
    succeed(folder, &["water_8.vtk", "a.ply"]);
    succeed(folder, &["water_8.vtk", "-o", "b.ply"]);
    succeed(folder, &["--output=c.ply", "water_8.vtk"]);
    let read = |name: &str| fs::read(folder.join(name)).unwrap();
    assert!(read("a.ply") == read("b.ply") && read("a.ply") == read("c.ply"));
    assert!(fail(folder, 2, &["water_8.vtk", "d.ply", "-o", "e.ply"]).contains("-o"));
    assert!(fail(folder, 2, &["water_8.vtk"]).contains("OUTPUT"));
    assert!(!folder.join("d.ply").exists() && !folder.join("e.ply").exists());
}

#[test]
fn one_file() {
    let folder = sequence();
    let folder = folder.path();
    for name in ["out.bgeo", "out.vtu", "out.ply", "out.npz", "out.csv"] {
        succeed(folder, &["water_9.vtk", name]);
        assert_eq!(read(folder, name), particles(9), "{name}");
    }
}

#[test]
fn sequences() {
    let folder = sequence();
    let folder = folder.path();
    succeed(folder, &["water_{}.vtk", "out_%04d.ply"]);
    fs::create_dir(folder.join("water")).unwrap();
    for n in 8..12 {
        assert_eq!(read(folder, &format!("out_00{n:02}.ply")), particles(n));
        let name = format!("water_{n}.vtk");
        fs::rename(folder.join(&name), folder.join("water").join(&name)).unwrap();
    }
    succeed(folder, &["water", "frames/", "--frames", "9-11:2"]);
    assert_names(&folder.join("frames"), &["frame_0009.bgeo", "frame_0011.bgeo"]);
    assert_eq!(read(folder, "frames/frame_0011.bgeo"), particles(11));
    // An existing folder needs no slash, and `--skip-existing` keeps an existing file.
    fs::write(folder.join("frames/frame_0009.bgeo"), "notes").unwrap();
    succeed(folder, &["water/water_$F.vtk", "frames", "--skip-existing"]);
    assert_eq!(names(&folder.join("frames")).len(), 4);
    assert_eq!(fs::read(folder.join("frames/frame_0009.bgeo")).unwrap(), b"notes");
    // A file that is not a particle file is not replaced.
    let line = fail(folder, 2, &["water", "frames"]);
    assert!(line.contains("frame_0009.bgeo") && line.contains("choose another name"), "{line}");
    assert_eq!(fs::read(folder.join("frames/frame_0009.bgeo")).unwrap(), b"notes");
    fs::remove_file(folder.join("frames/frame_0009.bgeo")).unwrap();
    succeed(folder, &["water", "frames"]);
    assert_eq!(read(folder, "frames/frame_0009.bgeo"), particles(9));

    let line = fail(folder, 2, &["water", "one.ply"]);
    assert!(line.contains("4 frames cannot all be one.ply"), "{line}");
}

/// `--up z` rotates positions and velocities to y up.
#[test]
fn up_axis_is_converted() {
    let folder = sequence();
    let folder = folder.path();
    succeed(folder, &["water_8.vtk", "out.vtk", "--up", "z"]);
    let turned = read(folder, "out.vtk");
    assert_eq!(turned.positions[4], Vec3::new(4.0, -1.0, -0.5));
    assert_eq!(turned.velocities.unwrap()[4], Vec3::Y);
    let line = fail(folder, 2, &["water_8.vtk", "out.vtk", "--up", "x"]);
    assert!(line.contains("expected y or z"), "{line}");
}

/// Without `--up`, files that pictures are turned for are turned too, which is said.
#[test]
fn the_axis_is_that_of_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let rows: String =
        (0..64).map(|i| format!("{},{},{},{i}\n", i % 4, i / 4 % 4, i / 16)).collect();
    fs::write(folder.join("part.csv"), format!("Points:0,Points:1,Points:2,Idp\n{rows}")).unwrap();
    let flat: String = (0..64).map(|i| format!("{},0,{}\n", i % 8, i / 8)).collect();
    fs::write(folder.join("flat.csv"), format!("x,y,z\n{flat}")).unwrap();
    for (name, word, last) in [
        ("part.csv", "DualSPHysics", Vec3::new(3.0, 3.0, -3.0)),
        ("flat.csv", "flat", Vec3::new(7.0, 7.0, 0.0)),
    ] {
        let (code, stderr) = convert(folder, &[name, "out.vtk"]);
        let line = format!(
            "limpid: {name}: z points up ({word}), and the output is turned to y up; --up y leaves it\n"
        );
        assert_eq!((code, stderr), (0, line));
        assert_eq!(read(folder, "out.vtk").positions[63], last, "{name}");
        succeed(folder, &[name, "out.vtk", "--up", "y"]);
        assert_eq!(read(folder, "out.vtk").positions[63], Vec3::new(last.x, -last.z, last.y));
    }
}

/// Attributes that the format cannot store are reported once for all frames.
#[test]
fn lost_attributes_are_reported_once() {
    let folder = sequence();
    let folder = folder.path();
    let (code, stderr) = convert(folder, &["water_##.vtk", "out_##.xyz"]);
    assert_eq!(code, 0);
    assert_eq!(stderr, "limpid: out_##.xyz: this format has no room for id, velocity\n");
    assert_eq!(read(folder, "out_11.xyz").positions, particles(11).positions);

    let shaped = Particles {
        radii: Some(vec![0.1; 5]),
        ellipsoids: Some(vec![Ellipsoid::SPHERE; 5]),
        ..Particles::from_positions(particles(5).positions)
    };
    limpid_io::particles::write(&shaped, &folder.join("shaped.pos")).unwrap();
    succeed(folder, &["shaped.pos", "shaped.vtu"]);
    assert_eq!(read(folder, "shaped.vtu"), shaped);
    let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_limpid"));
    let info = command.current_dir(folder).args(["info", "shaped.pos"]).output().unwrap();
    let info = String::from_utf8(info.stdout).unwrap();
    assert!(info.contains("5 particles, radius, ellipsoid"), "{info}");
}

/// Arrays that are not attributes are reported too, unless they are mapped.
#[test]
fn ignored_arrays_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("a.csv"), "x,y,z,Diameter,h\n0,0,0,5,0.5\n1,0,0,5,0.5\n").unwrap();
    let (code, stderr) = convert(folder, &["a.csv", "a.npz"]);
    assert_eq!(code, 0);
    assert!(stderr.starts_with("limpid: a.csv: Diameter, h are left out; --map "), "{stderr}");
    let (_, stderr) = convert(folder, &["a.csv", "b.npz", "--map", "radius=h"]);
    assert!(stderr.starts_with("limpid: a.csv: Diameter is left out"), "{stderr}");
    assert_eq!(read(folder, "b.npz").radii, Some(vec![0.5; 2]));
}

/// A damaged frame is reported and leaves no file; the other frames are complete.
#[test]
fn damaged_frames_are_reported_and_leave_no_file() {
    let folder = sequence();
    let folder = folder.path();
    let bytes = fs::read(folder.join("water_10.vtk")).unwrap();
    fs::write(folder.join("water_10.vtk"), &bytes[..bytes.len() / 2]).unwrap();
    fs::create_dir(folder.join("out")).unwrap();
    let line = fail(folder, 4, &["water_{}.vtk", "out"]);
    assert!(line.contains("water_10.vtk: byte "), "{line}");
    assert!(!folder.join("out/frame_0010.bgeo").exists());
    for name in names(&folder.join("out")) {
        let n = name["frame_00".len()..][..2].parse().unwrap();
        assert_eq!(read(folder, &format!("out/{name}")), particles(n));
    }
}

/// An unknown output format is refused before anything is read.
#[test]
fn unknown_formats_are_refused_before_anything_is_read() {
    let folder = sequence();
    let folder = folder.path();
    let before = names(folder);
    for output in ["out.obj", "out.vtp", "out_##.abc"] {
        let line = fail(folder, 3, &["water_8.vtk", output]);
        assert!(line.contains("can be written: .bgeo, "), "{line}");
    }
    let line = fail(folder, 4, &["nothing.vtk", "out.bgeo"]);
    assert!(line.contains("nothing.vtk"), "{line}");
    assert_eq!(names(folder), before);
}

/// A trajectory becomes a file for each of its frames, by their time steps, and the files of several ranks one
/// file with the particles of all.
#[test]
fn frames_in_one_file_and_in_several() {
    let folder = tempfile::tempdir().unwrap();
    let step = |number: i64| {
        format!(
            "ITEM: TIMESTEP\n{number}\nITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS pp pp pp\n0 1\n0 1\n0 1\n\
             ITEM: ATOMS x y z\n{number} 0 0\n"
        )
    };
    fs::write(folder.path().join("run.lammpstrj"), step(0) + &step(50)).unwrap();
    succeed(folder.path(), &["run.lammpstrj", "step_####.ply"]);
    let read = |name: &str| limpid_io::particles::read(&folder.path().join(name)).unwrap();
    assert_eq!(read("step_0050.ply").positions, [Vec3::new(50.0, 0.0, 0.0)]);
    succeed(folder.path(), &["run.lammpstrj", "first.ply", "--frames", "0"]);
    assert_names(folder.path(), &["first.ply", "run.lammpstrj", "step_0000.ply", "step_0050.ply"]);

    for rank in [0, 1] {
        let name = format!("rank{rank}_7.ply");
        limpid_io::particles::write(&particles(3 + rank), &folder.path().join(name)).unwrap();
    }
    succeed(folder.path(), &["rank{r}_{}.ply", "merged.npz"]);
    assert_eq!(read("merged.npz").len(), 7);
}
