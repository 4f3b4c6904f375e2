//! Text files with several frames are sequences.

use std::fs;
use std::io::Write as _;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::Vec3;
use limpid_io::particles::{ReadOptions, Remark};
use limpid_io::sequence::{Frame, Sequence};

use super::other_programs::file;

fn open(folder: &Path, name: &str, text: &str) -> limpid_io::Result<Sequence> {
    let path = folder.join(name);
    fs::write(&path, text).unwrap();
    Sequence::open(path.to_str().unwrap())
}

fn numbers(sequence: &Sequence) -> Vec<i64> {
    sequence.frames.iter().map(|frame| frame.number).collect()
}

/// The first position of each frame, along x.
fn first_x(sequence: &Sequence) -> Vec<f32> {
    let read = |frame: &Frame| frame.read(&ReadOptions::default()).expect("a frame");
    sequence.frames.iter().map(|frame| read(frame).particles.positions[0].x).collect()
}

fn step(number: i64, rows: &str) -> String {
    let count = rows.lines().count();
    format!(
        "ITEM: TIMESTEP\n{number}\nITEM: NUMBER OF ATOMS\n{count}\nITEM: BOX BOUNDS pp pp pp\n0 1\n0 1\n\
         0 1\nITEM: ATOMS id x y z\n{rows}"
    )
}

/// A trajectory of ASE has its frames, numbered from 0, and each has its particles. It is one in its folder too,
/// and by a pattern.
#[test]
fn frames_of_ase() {
    let path = file("ase_frames.extxyz");
    let sequence = Sequence::open(path.to_str().unwrap()).expect("a sequence");
    assert_eq!((numbers(&sequence), first_x(&sequence)), (vec![0, 1, 2], vec![0.0, 1.0, 2.0]));
    let last = sequence.frames[2].read(&ReadOptions::default()).unwrap();
    assert_eq!(last.particles.len(), 8);
    assert!(last.particles.positions[7].distance(Vec3::new(2.3, 0.1, 0.0)) < 1e-6);

    let folder = tempfile::tempdir().unwrap();
    fs::copy(&path, folder.path().join("run_7.extxyz")).unwrap();
    for input in ["", "run_{}.extxyz", "run*"] {
        let input = folder.path().join(input);
        let sequence = Sequence::open(input.to_str().unwrap()).expect("a sequence");
        assert_eq!(numbers(&sequence), [0, 1, 2], "{}", input.display());
    }
}

/// Frames of LAMMPS have the numbers of their time steps. A step that a continued run has written again counts
/// once, and steps that begin again are numbered from 0. Lines before the step are those of its frame.
#[test]
fn frames_of_lammps() {
    let folder = tempfile::tempdir().unwrap();
    let open = |text: &str| open(folder.path(), "a.lammpstrj", text).expect("a sequence");
    let (a, b, c) = (step(0, "1 0 0 0\n"), step(100, "1 1 0 0\n"), step(200, "1 2 0 0\n2 3 0 0\n"));
    let all = open(&format!("ITEM: UNITS\nlj\nITEM: TIME\n0.5\n{a}{b}\n\nITEM: TIME\n0.5\n{c}"));
    assert_eq!((numbers(&all), first_x(&all)), (vec![0, 100, 200], vec![0.0, 1.0, 2.0]));
    let continued = open(&format!("{a}{b}{b}{c}"));
    assert_eq!(numbers(&continued), [0, 100, 200]);
    let again = open(&format!("{a}{b}{a}{c}"));
    assert_eq!((numbers(&again), first_x(&again)), (vec![0, 1, 2, 3], vec![0.0, 1.0, 0.0, 2.0]));
    // Equal steps of other places are all kept, and every frame says why its number is not the step.
    let other = step(100, "1 9 0 0\n");
    let equal = open(&format!("{a}{b}{other}{c}"));
    assert_eq!((numbers(&equal), first_x(&equal)), (vec![0, 1, 2, 3], vec![0.0, 1.0, 9.0, 2.0]));
    let told = equal.frames[3].read(&ReadOptions::default()).expect("a frame").remarks;
    assert_eq!(told, [Remark::Renumbered { step: 100 }]);
    assert_eq!(first_x(&open(&format!("{b}{other}"))), [1.0, 9.0]);
    assert_eq!(first_x(&open(&format!("{b}{b}{b}"))), [1.0], "the same frame thrice");
    let single = open(&b);
    assert_eq!((numbers(&single), single.frames[0].section), (vec![0], None));
}

/// Names of LAMMPS and LIGGGHTS that say nothing of the format: the contents decide, for a file, in a folder and by a
/// pattern, with the number wherever it is; of a folder logs are not taken. Compressed files of any text are read.
#[test]
fn names_without_a_format() {
    let dump = step(1500, "1 1 2 3\n2 4 5 6\n");
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    gzip.write_all(dump.as_bytes()).unwrap();
    let gzip = gzip.finish().unwrap();
    let log = "LAMMPS (2 Aug 2023)\nStep Temp\n0 1\n";
    for (names, pattern, expected) in [
        (["dump.melt.0", "dump.melt.1500"], "dump.melt.*", [0, 1500]),
        (["dump1.liggghts", "dump2.liggghts"], "dump*.liggghts", [1, 2]),
        (["run_5.custom", "run_10.custom"], "run_{}.custom", [5, 10]),
        (["a_1.lammpstrj.gz", "a_2.lammpstrj.gz"], "a_*.lammpstrj.gz", [1, 2]),
        (["dump.7.gz", "dump.8.gz"], "dump.*.gz", [7, 8]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            let bytes = if name.ends_with("gz") { &gzip[..] } else { dump.as_bytes() };
            fs::write(folder.path().join(name), bytes).unwrap();
        }
        fs::write(folder.path().join("log.lammps"), log).unwrap();
        for log in ["thermo.out", "residuals.dat"] {
            fs::write(folder.path().join(log), "0 1 2\n100 3 4\n").unwrap();
        }
        for input in [folder.path().to_owned(), folder.path().join(pattern)] {
            let sequence = Sequence::open(input.to_str().unwrap()).expect(pattern);
            assert_eq!((numbers(&sequence), first_x(&sequence)), (expected.into(), vec![1.0; 2]));
        }
        let one = Sequence::open(folder.path().join(names[1]).to_str().unwrap()).unwrap();
        assert_eq!(numbers(&one), [expected[1]], "{}", names[1]);
    }
    // Several frames in a file of such a name are a sequence; a compressed one is to be unpacked first.
    let folder = tempfile::tempdir().unwrap();
    let two = step(0, "1 0 0 0\n") + &step(100, "1 1 0 0\n");
    let sequence = open(folder.path(), "dump.all", &two).expect("a sequence");
    assert_eq!((numbers(&sequence), first_x(&sequence)), (vec![0, 100], vec![0.0, 1.0]));
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    gzip.write_all(two.as_bytes()).unwrap();
    let path = folder.path().join("dump.all.gz");
    fs::write(&path, gzip.finish().unwrap()).unwrap();
    let message = limpid_io::particles::read(&path).unwrap_err().to_string();
    assert!(
        message.contains("several frames in one file") && message.contains("unpack it"),
        "{message}"
    );
}

/// Text of any other name is read if it is a table: with blanks or commas, with names or without; other text is not.
#[test]
fn tables_without_a_format() {
    let read =
        |name: &str, text: &str| limpid_io::particles::parse(Path::new(name), text.as_bytes());
    for (name, text) in [
        ("a.txt", "\u{feff}0.5 1  2 7\n3\t4 5 8\n"),
        ("a.dat", "# x y z rho\n0.5 1 2 7\n3 4 5 8\n"),
        ("a.asc", "x,y,z,rho\n0.5,1,2,7\n3,4,5,8\n"),
        ("a.particles", "\"x\" \"y\" \"z\" \"rho\"\n 0.5 1 2 7\n 3 4 5 8\n"),
    ] {
        let particles = read(name, text).expect(name);
        assert_eq!(
            particles.positions,
            [Vec3::new(0.5, 1.0, 2.0), Vec3::new(3.0, 4.0, 5.0)],
            "{name}"
        );
        let densities = text.contains("rho").then(|| vec![7.0, 8.0]);
        assert_eq!(particles.densities, densities, "{name}");
    }
    for text in ["LAMMPS (2 Aug 2023)\nunits lj\n", "Step Temp\n0 1\n", "1 2\n3 4\n", ""] {
        let message = read("log.txt", text).unwrap_err().to_string();
        assert!(message.contains("a kind of file that limpid does not know"), "{message}");
    }
}

/// An error in a frame names its line in the whole file; what follows a frame and is none is refused when the
/// file is opened; an unfinished last frame is an error once it is read; and no count is trusted.
#[test]
fn errors_name_the_line_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let open = |name: &str, text: &str| open(folder.path(), name, text);
    let error = |sequence: &Sequence, at: usize| {
        let read = sequence.frames[at].read(&ReadOptions::default());
        read.unwrap_err().to_string()
    };
    let bad = open("a.extxyz", "1\n\nO 0 0 0\n\n1\n\nO 0 zero 0\n").expect("two frames");
    assert_eq!(first_x(&Sequence { frames: vec![bad.frames[0].clone()], ..bad.clone() }), [0.0]);
    let message = error(&bad, 1);
    assert!(
        message.contains("a.extxyz: line 7: particle 0") && message.contains("`zero`"),
        "{message}"
    );
    let cut = open("a.xyz", "1\n\nO 0 0 0\n3\n\nO 0 0 0\n").expect("two frames");
    assert!(error(&cut, 1).contains("expected 3 lines"), "{}", error(&cut, 1));
    let claimed =
        open("a.xyz", "1\n\nO 0 0 0\n18446744073709551615\n\nO 0 0 0\n").expect("two frames");
    assert!(error(&claimed, 1).contains("particle 1"), "{}", error(&claimed, 1));
    for (name, text, parts) in [
        ("a.xyz", "1\n\nO 0 0 0\nthe end\n".into(), ["a.xyz: line 4", "`the end`"]),
        ("a.dump", step(0, "1 0 0 0\n") + "the end\n", ["a.dump: line 11", "`the end`"]),
    ] {
        let message = open(name, &text).unwrap_err().to_string();
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    }
    // Other files of these names are read as they were.
    let raw = open("raw.xyz", &"\0".repeat(24)).expect("one frame");
    assert_eq!(raw.frames.len(), 1);
    let plain = open("plain.xyz", "0 0 0\n1 1 1\n").expect("one frame");
    assert_eq!(plain.frames[0].section, None);
    // A frame beyond the limit of its size.
    let options = ReadOptions { max_unpacked: Some(8), ..ReadOptions::default() };
    let message = bad.frames[0].read(&options).unwrap_err().to_string();
    assert!(message.contains("expected at most 8"), "{message}");
}
