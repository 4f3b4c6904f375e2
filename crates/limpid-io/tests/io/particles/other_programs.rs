//! Files that VTK and ASE wrote (`tests/data/formats/make.py`), files of other programs by the documentation of
//! their formats (`make_by_documentation.py`), and the text formats by theirs.

use std::fs;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use limpid_io::particles::{AttributeMap, Contents, ReadOptions, read};
use limpid_io::sequence::Sequence;

use super::{check_message, patched};

pub(crate) fn file(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/formats")).join(name)
}

/// All programs wrote the particles of the script, to their precision; those that could not write an
/// attribute lack it.
#[test]
fn files_of_other_programs_have_their_particles() {
    let all = ["velocity", "radius", "id"];
    for (name, attributes) in [
        ("vtk_zlib_appended.vtu", &all[..]),
        ("vtk_zlib_binary.vtu", &all),
        ("vtk_lz4_appended.vtu", &all),
        ("vtk_lz4_binary.vtu", &all),
        ("vtk_lzma_appended.vtu", &all),
        ("vtk_pieces.pvtu", &all),
        ("vtk_pieces.pvtp", &all),
        ("vtk_blocks.vtm", &all),
        ("ase.extxyz", &all),
        ("ase_plain.xyz", &[]),
        ("houdini.bgeo", &all),
        ("houdini.geo", &all),
        ("houdini.bgeo.sc", &all),
        ("Part_0005.bi4", &["velocity", "density", "radius", "id"]),
        ("krakatoa.prt", &["velocity", "id"]),
        ("mantaflow.uni", &[]),
        ("swift.hdf5", &["velocity", "density", "id"]),
        ("pysph.hdf5", &["velocity", "density"]),
        ("vtk_grid.vtkhdf", &all),
        ("vtk_points.vtkhdf", &all),
        ("plain.h5", &all),
    ] {
        let particles = read(&file(name)).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(particles.len(), 120, "{name}");
        for i in 0..120 {
            let at = |n: usize| n as f64 / 10.0;
            let expected = DVec3::new(at(i % 4), at(i / 4 % 5), at(i / 20));
            assert!(particles.place(i).distance(expected) < 1e-6, "{name}: {i}");
        }
        let found: Vec<_> = limpid_io::particles::attribute_names(&particles).collect();
        assert_eq!(found.len(), attributes.len(), "{name}: {found:?}");
        for (i, velocity) in particles.velocities.iter().flatten().enumerate() {
            let expected = Vec3::new(i as f32, 0.0, -(i as f32)) / 8.0;
            assert!(velocity.distance(expected) < 1e-5, "{name}: {velocity}");
        }
        assert!(particles.radii.iter().flatten().all(|&r| (r - 0.05).abs() < 1e-7), "{name}");
        let density = if name.ends_with(".bi4") { 1000.0 } else { 998.5 };
        assert!(particles.densities.iter().flatten().all(|&rho| rho == density), "{name}");
        assert!(particles.ids.iter().flatten().zip(1000..).all(|(&id, n)| id == n), "{name}");
    }
    // A compression that is not read is named with those that are.
    let bytes = fs::read(file("vtk_lzma_appended.vtu")).unwrap();
    let other = patched(&bytes, b"vtkLZMADataCompressor", b"vtkFutureCompressor__");
    check_message("a.vtu", &other, &["vtkFutureCompressor__", "LZMA or none"]);
}

/// Damaged blocks are errors that name the block, wherever they are damaged, and never other numbers: a
/// block of LZMA has a checksum, and one of LZ4 at least unpacks to its size.
#[test]
fn damaged_blocks_are_refused() {
    for name in ["vtk_lz4_appended.vtu", "vtk_lzma_appended.vtu"] {
        let mut bytes = fs::read(file(name)).unwrap();
        let start = bytes.windows(12).position(|w| w == b"encoding=\"ba").expect("appended data");
        let data = start + bytes[start..].iter().position(|&byte| byte == b'_').unwrap();
        for byte in &mut bytes[data + 40..data + 400] {
            *byte = b'A';
        }
        check_message("a.vtu", &bytes, &["a.vtu: byte", "block"]);
    }
    let bytes = fs::read(file("vtk_lzma_appended.vtu")).unwrap();
    let sound = limpid_io::particles::parse(Path::new("a.vtu"), &bytes).unwrap();
    let text = bytes.iter().rposition(|&byte| byte == b'_').unwrap() + 1;
    let end = bytes.len() - b"</AppendedData>".len();
    for at in (text..end).step_by(11) {
        let mut damaged = bytes.clone();
        damaged[at] = if damaged[at] == b'B' { b'C' } else { b'B' };
        // Cells and the order of bytes in padding do not change the particles.
        if let Ok(particles) = limpid_io::particles::parse(Path::new("a.vtu"), &damaged) {
            assert_eq!(particles, sound, "byte {at}");
        }
    }
}

/// Extended XYZ: columns by `Properties`, quoted or not, in any order; without it an element and the
/// position. Errors name line and particle.
#[test]
fn extended_xyz() {
    let parse = |name: &str, text: &str| {
        Contents::parse(Path::new(name), text.as_bytes(), &ReadOptions::default())
    };
    let text = "2\nLattice=\"1 0 0 0 1 0 0 0 1\" Properties=\"id:I:1:pos:R:3:rho:R:1\" Time=0.5\n\
                7 1.0 2.0 3.0 998.5\n9 4 5e-1 -6 1001\n";
    for name in ["a.xyz", "a.extxyz"] {
        let contents = parse(name, text).expect("valid");
        assert_eq!(contents.particles.positions[1], Vec3::new(4.0, 0.5, -6.0));
        assert_eq!(contents.particles.ids, Some(vec![7, 9]));
        assert_eq!(contents.particles.densities, Some(vec![998.5, 1001.0]));
    }
    let plain = parse("a.xyz", "1\nany comment\nHe 1 2 3\n").expect("valid");
    assert_eq!(plain.particles.positions, [Vec3::new(1.0, 2.0, 3.0)]);
    assert_eq!(parse("a.xyz", "0\n\n").expect("no particles").particles.len(), 0);

    check_message("a.xyz", b"2\n\nHe 1 2 3\n", &["particle 1", "expected 2 lines"]);
    check_message("a.extxyz", b"1\n\nHe 1 two 3\n", &["line 3", "particle 0", "position", "`two`"]);
    check_message("a.extxyz", b"1\nProperties=pos:R\n1 2 3\n", &["Properties=name:type:size"]);
    check_message("a.extxyz", b"1\nProperties=species:S:1\nHe\n", &["no columns x, y and z"]);
    check_message("a.extxyz", b"x y z\n1 2 3\n", &["begins with the number of particles"]);
    let two = b"1\n\nHe 1 2 3\n1\n\nHe 1 2 4\n";
    check_message("a.extxyz", two, &["several frames", "name it alone"]);
    // A claimed number of particles allocates nothing.
    check_message("a.xyz", b"99999999999999\n\nHe 1 2 3\n", &["particle 1"]);
}

/// LAMMPS dumps: positions as such, unwrapped, or as shares of the box; attributes by the names of their
/// columns.
#[test]
fn lammps_dumps() {
    let dump = |columns: &str, rows: &str| {
        format!(
            "ITEM: TIMESTEP\n100\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS pp pp ff\n-1 3\n0 10\n2 4\n\
             ITEM: ATOMS {columns}\n{rows}"
        )
    };
    let parse = |text: &str| {
        let options = ReadOptions {
            map: "density=c_rho".parse::<AttributeMap>().unwrap(),
            ..Default::default()
        };
        let plain = ReadOptions::default();
        let options = if text.contains("c_rho") { &options } else { &plain };
        Contents::parse(Path::new("a.lammpstrj"), text.as_bytes(), options)
            .expect("valid")
            .particles
    };
    let rows = "4 1 0.25 0.5 1 1 2 3 0.01 7\n5 1 0 0 0 4 5 6 0.02 8\n";
    let named = parse(&dump("id type x y z vx vy vz radius c_rho", rows));
    assert_eq!(named.positions, [Vec3::new(0.25, 0.5, 1.0), Vec3::ZERO]);
    assert_eq!(named.velocities, Some(vec![Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)]));
    assert_eq!((named.ids, named.radii), (Some(vec![4, 5]), Some(vec![0.01, 0.02])));
    assert_eq!(named.densities, Some(vec![7.0, 8.0]));
    let shares = parse(&dump("id xs ys zs", "1 0.25 0.5 1\n2 0 0 0\n"));
    assert_eq!(shares.positions, [Vec3::new(0.0, 5.0, 4.0), Vec3::new(-1.0, 0.0, 2.0)]);
    let unwrapped = parse(&dump("xu yu zu", "0.25 0.5 1\n0 0 0\n"));
    assert_eq!(unwrapped.positions[0], Vec3::new(0.25, 0.5, 1.0));

    let message = |text: &str, parts: &[&str]| check_message("a.dump", text.as_bytes(), parts);
    message(&dump("x y z", "1 2 3\n"), &["particle 1", "expected 2 lines"]);
    message(&dump("x y z", "1 2 3\n1 2\n"), &["line 11", "particle 1", "no such column"]);
    message(
        &dump("x y z vx", "1 2 3 4\n1 2 3\n"),
        &["line 11", "particle 1", "3 columns, expected 4"],
    );
    message("ITEM: TIMESTEP\n1\n", &["no section `ITEM: ATOMS`"]);
    message("nothing\n", &["not a LAMMPS dump"]);
    let tilted = dump("xs ys zs", "0 0 0\n0 0 0\n").replace("0 10\n", "0 10 0.5\n");
    message(&tilted, &["tilted", "dump x y z"]);
    let twice = dump("x y z", "1 2 3\n1 2 4\n") + &dump("x y z", "1 2 3\n1 2 4\n");
    message(&twice, &["several frames", "name it alone"]);
}

/// Lists of VTK files: times become the rate of the sequence, and every list names what is wrong with it.
#[test]
fn lists_of_files() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for name in ["a_5.vtu", "b.vtu", "c.vtu"] {
        fs::copy(file("vtk_zlib_appended.vtu"), at(name)).unwrap();
    }
    let open = |name: &str, text: &str| {
        fs::write(at(name), text).unwrap();
        Sequence::open(at(name).to_str().unwrap())
    };
    let pvd = |sets: &str| {
        format!(
            "<?xml version=\"1.0\"?><VTKFile type=\"Collection\"><Collection>{sets}</Collection></VTKFile>"
        )
    };
    let set = |time: f64, file: &str| {
        format!("<DataSet timestep=\"{time}\" part=\"0\" file=\"{file}\"/>")
    };
    let three = set(0.0, "a_5.vtu") + &set(0.04, "b.vtu") + &set(0.08, "c.vtu");
    let listed = open("run.pvd", &pvd(&three)).expect("a list");
    let numbers: Vec<i64> = listed.frames.iter().map(|frame| frame.number).collect();
    assert_eq!((numbers, listed.frames[1].path.clone()), (vec![0, 1, 2], at("b.vtu")));
    assert!((listed.fps.expect("a rate") - 25.0).abs() < 1e-6);
    let series = r#"{"file-series-version": "1.0", "files": [
        {"name": "a_5.vtu", "time": 0}, {"name": "b.vtu", "time": 1}, {"name": "c.vtu", "time": 3}]}"#;
    let listed = open("run.vtu.series", series).expect("a list");
    assert_eq!((listed.frames.len(), listed.fps), (3, None), "the times are uneven");

    let problem = |name: &str, text: &str| open(name, text).unwrap_err().to_string();
    for (name, text, parts) in [
        ("e.pvd", pvd(""), ["e.pvd", "names no files"]),
        ("e.pvd", pvd(&(set(0.0, "b.vtu") + &set(1.0, "b.vtu"))), ["b.vtu", "listed twice"]),
        ("e.pvd", pvd(&(set(1.0, "b.vtu") + &set(1.0, "c.vtu"))), ["several parts", "time 1"]),
        ("e.pvd", "<VTKFile><Collection".into(), ["e.pvd", "not XML"]),
        // An entry that names no file, one of another name, and one without its end.
        (
            "e.pvd",
            pvd(&three.replacen("file=", "fil=", 1)),
            ["e.pvd", "without the attribute file"],
        ),
        (
            "e.pvd",
            pvd(&three.replacen("<Data", "<Dat", 1)),
            ["e.pvd: byte", "<DatSet> names a file"],
        ),
        ("e.pvd", pvd(&three.replacen("/>", "", 1)), ["e.pvd: byte", "not XML"]),
        ("e.series", "{".into(), ["e.series", "not a list of files"]),
    ] {
        let message = problem(name, &text);
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    }
    // Pieces that are missing, or no pieces.
    let pieces = |name: &str| {
        format!(
            "<VTKFile><PUnstructuredGrid><Piece Source=\"{name}\"/></PUnstructuredGrid></VTKFile>"
        )
    };
    for (source, part) in [("none.vtu", "none.vtu: cannot read"), ("x.pvtu", "expected a .vtu")] {
        fs::write(at("p.pvtu"), pieces(source)).unwrap();
        let message = read(&at("p.pvtu")).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    }
    fs::write(at("p.pvtu"), pieces("")).unwrap();
    let message = read(&at("p.pvtu")).unwrap_err().to_string();
    assert!(message.contains("without the attribute Source"), "{message}");
    // Blocks may be empty, as those of a rank without particles.
    let blocks = "<VTKFile><vtkMultiBlockDataSet><DataSet index='0'/><DataSet index='1' file='b.vtu'/>\
                  </vtkMultiBlockDataSet></VTKFile>";
    fs::write(at("p.vtm"), blocks).unwrap();
    assert!(!read(&at("p.vtm")).expect("one block").is_empty());
    fs::remove_file(at("p.vtm")).unwrap();
    // The pieces beside a list are not frames.
    fs::remove_file(at("p.pvtu")).unwrap();
    for name in ["w_1.pvtu", "w_2.pvtu"] {
        fs::write(at(name), pieces("b.vtu")).unwrap();
    }
    let sequence = Sequence::open(folder.path().to_str().unwrap()).expect("two frames");
    assert_eq!(sequence.frames.len(), 2);
}
