//! Selection of files and frames: an input finds its frames in the order of their numbers, or reports
//! what it looked for, and shards partition the frames.

use std::collections::BTreeSet;
use std::path::Path;

use limpid_io::Error;
use limpid_io::frames::{FrameSpec, Shard};
use limpid_io::sequence::{Missing, Sequence};
use tempfile::TempDir;

fn folder(names: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in names {
        std::fs::write(folder.path().join(name), b"").unwrap();
    }
    folder
}

fn open(folder: &TempDir, name: &str) -> Result<Sequence, Error> {
    Sequence::open(folder.path().join(name).to_str().unwrap())
}

fn numbers(sequence: &Sequence) -> Vec<i64> {
    sequence.frames.iter().map(|frame| frame.number).collect()
}

fn file_name(path: &Path) -> &str {
    path.file_name().unwrap().to_str().unwrap()
}

#[test]
fn a_single_file_is_numbered_by_its_last_digits() {
    let names = ["a_12_x.0034.bgeo.gz", "still.ply", "7.vtk", "k_19539_particles.vtk"];
    let folder = folder(&names);
    for (name, number) in names.into_iter().zip([34, 0, 7, 19539]) {
        let sequence = open(&folder, name).unwrap();
        assert_eq!(numbers(&sequence), [number], "{name}");
        assert_eq!(file_name(&sequence.frames[0].path), name);
    }
}

#[test]
fn patterns_in_every_notation() {
    let unpadded =
        folder(&["f_1.bgeo", "f_2.bgeo", "f_10.bgeo", "f_.bgeo", "f_1b.bgeo", "g_3.bgeo"]);
    for pattern in ["f_{}.bgeo", "f_%d.bgeo", "f_$F.bgeo", "f_#.bgeo"] {
        let sequence = open(&unpadded, pattern).unwrap();
        assert_eq!(numbers(&sequence), [1, 2, 10], "{pattern}");
        assert_eq!(file_name(&sequence.frame(10).unwrap().path), "f_10.bgeo");
        assert_eq!(sequence.frame(3), None);
        assert!(sequence.pattern.ends_with(pattern));
    }
    let padded = folder(&["p.0001.ply", "p.0020.ply", "p.12345.ply", "p.3.ply"]);
    for pattern in ["p.####.ply", "p.%04d.ply", "p.$F4.ply"] {
        assert_eq!(numbers(&open(&padded, pattern).unwrap()), [1, 20, 12345], "{pattern}");
    }
}

#[test]
fn an_existing_file_is_not_a_pattern() {
    let folder = folder(&["take#1.ply", "take21.ply"]);
    let sequence = open(&folder, "take#1.ply").unwrap();
    assert_eq!(file_name(&sequence.frames[0].path), "take#1.ply");
}

#[test]
fn a_pattern_without_files_names_a_similar_one() {
    let folder = folder(&["fluid_0001.bgeo", "wall.ply", "fluid.txt"]);
    let error = open(&folder, "fluid-{}.bgeo").unwrap_err();
    assert!(matches!(error, Error::Sequence { .. }));
    let text = error.to_string();
    assert!(text.contains("fluid-{}.bgeo") && text.contains("`fluid_0001.bgeo`"), "{text}");
    let error = open(&folder, "fluid_{}_{}.bgeo").unwrap_err().to_string();
    assert!(error.contains("two places"), "{error}");
}

#[test]
fn duplicate_numbers_are_errors() {
    let folder = folder(&["f1.ply", "f01.ply", "f2.ply"]);
    for input in ["f{}.ply", ""] {
        let error = open(&folder, input).unwrap_err().to_string();
        assert!(error.contains("f1.ply") && error.contains("f01.ply"), "{error}");
    }
}

#[test]
fn a_folder_is_one_sequence() {
    let one = folder(&["f_2.vtk", "f_10.vtk", "f_1.vtk", "notes.txt", ".f_3.vtk", "f_4.vtk.tmp"]);
    let sequence = open(&one, "").unwrap();
    assert_eq!(numbers(&sequence), [1, 2, 10]);
    assert!(sequence.pattern.ends_with("f_{}.vtk"), "{}", sequence.pattern);
    assert_eq!(open(&one, "f_{}.vtk").unwrap().frames, sequence.frames);

    let several = folder(&["fluid_1.ply", "fluid_2.ply", "foam_1.ply", "wall.ply"]);
    let error = open(&several, "").unwrap_err();
    assert!(matches!(error, Error::Sequence { .. }));
    let text = error.to_string();
    // Foam is no liquid beside others.
    assert!(text.contains("fluid_{}.ply, wall.ply"), "{text}");

    let none = folder(&["notes.txt"]);
    let text = open(&none, "").unwrap_err().to_string();
    assert!(text.contains("no particle files") && text.contains(".bgeo"), "{text}");
}

#[test]
fn missing_files_and_folders_are_io_errors() {
    for input in ["no-such-file.ply", "no-such-folder/f_{}.ply", "no-such-folder/", ""] {
        let error = Sequence::open(input).unwrap_err();
        assert!(matches!(error, Error::Io { .. }), "{input}: {error}");
    }
}

fn frames(spec: &str) -> Vec<i64> {
    let frames = spec.parse::<FrameSpec>().and_then(|spec| spec.frames());
    frames.unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn frame_specs_in_every_notation() {
    assert_eq!(frames("5"), [5]);
    assert_eq!(frames("1-3,5,7-12:2"), [1, 2, 3, 5, 7, 9, 11]);
    assert_eq!(frames("1-10x4"), [1, 5, 9]);
    assert_eq!(frames("1-10@4"), [1, 5, 9]);
    assert_eq!(frames(" 3, 5-6 ,  9\t1 "), [3, 5, 6, 9, 1]);
    assert_eq!(frames("4-6,1-5"), [4, 5, 6, 1, 2, 3]);
    assert_eq!(frames("-5"), [-5]);
    assert_eq!(frames("-3--1"), [-3, -2, -1]);
    assert_eq!(frames("-1-1"), [-1, 0, 1]);
    assert_eq!(frames("0007-0008"), [7, 8]);
    assert_eq!(frames("5-5@b"), [5]);
    assert_eq!(frames("10-7"), [10, 9, 8, 7]);
    assert_eq!(frames("-5..-3,1..3"), [-5, -4, -3, 1, 2, 3]);
    assert_eq!(frames("2--2"), [2, 1, 0, -1, -2]);
    for spec in ["1-10s4", "1-10:4", "1-10step4", "1-10by4", "1-10every4", "1..10x4"] {
        assert_eq!(frames(spec), [1, 5, 9], "{spec}");
    }
    for spec in ["10-1x4", "10-1x-4", "10..1s4"] {
        assert_eq!(frames(spec), [10, 6, 2], "{spec}");
    }
    assert_eq!(frames("1-10y3"), [2, 3, 5, 6, 8, 9]);
    assert_eq!(frames("10-1y3"), [9, 8, 6, 5, 3, 2]);
    assert_eq!(frames("1-3,2-4,3"), [1, 2, 3, 4]);
    assert_eq!(frames("9223372036854775807-9223372036854775806").len(), 2);
    assert_eq!(frames("1-9223372036854775807:9223372036854775807"), [1]);
    assert_eq!("all".parse::<FrameSpec>().unwrap(), FrameSpec::All);
}

/// Frame specs are written as they are parsed, so that failed frames can be passed to the next run.
#[test]
fn frame_specs_are_written_as_parsed() {
    for (spec, written) in [
        ("all", "all"),
        ("1,2,3,5,7,8", "1-3,5,7-8"),
        ("-3--1,4", "-3--1,4"),
        ("10-8", "10-8"),
        ("1-10:3,20-10y4, -1..5@b", "1-10x3,20-10y4,-1-5@b"),
        ("9223372036854775806,9223372036854775807", "9223372036854775806-9223372036854775807"),
    ] {
        let parsed: FrameSpec = spec.parse().unwrap();
        assert_eq!(parsed.to_string(), written);
        assert_eq!(written.parse::<FrameSpec>().unwrap(), parsed);
    }
}

/// Binary order first covers the whole range coarsely, and skips nothing.
#[test]
fn binary_order_halves_the_gaps() {
    assert_eq!(frames("1-10@b"), [1, 10, 5, 3, 7, 2, 4, 6, 8, 9]);
    for last in 1..200 {
        let order = frames(&format!("-7-{last}@b"));
        let set: BTreeSet<i64> = order.iter().copied().collect();
        assert_eq!(order.len(), set.len());
        assert!(set.into_iter().eq(-7..=last));
        assert_eq!(order[..2], [-7, last]);
    }
}

#[test]
fn bad_frame_specs_are_usage_errors() {
    let cases = [
        "",
        ",",
        "x",
        "1-",
        "-",
        "1--",
        "1-2-3",
        "1...5",
        "1..",
        "1-5y1",
        "1-5y0",
        "1-5x",
        "1-10stepx",
        "10-1:--2",
        "10-1@-b",
        "1-10:",
        "1-10:0",
        "1-10:-1",
        "1-10@c",
        "1-10xb",
        "5x2",
        "1-5:2:2",
        "99999999999999999999",
        "1,two",
        "1-20000000",
        "-9223372036854775808-9223372036854775807",
        "-9223372036854775808-9223372036854775807@b",
        "1-6000000,1-6000000",
    ];
    for spec in cases {
        match spec.parse::<FrameSpec>().and_then(|spec| spec.frames()) {
            Err(Error::Usage(text)) => assert!(text.starts_with("frames"), "{text}"),
            other => panic!("{spec:?}: {other:?}"),
        }
    }
}

#[test]
fn frames_are_selected_from_a_sequence() {
    let folder = folder(&["f1.ply", "f2.ply", "f4.ply"]);
    let sequence = open(&folder, "f{}.ply").unwrap();
    let select = |spec: &str| {
        let frames = spec.parse::<FrameSpec>().unwrap().select(&sequence)?;
        Ok::<Vec<i64>, Error>(frames.into_iter().map(|frame| frame.number).collect())
    };
    assert_eq!(select("all").unwrap(), [1, 2, 4]);
    assert_eq!(select("4,1").unwrap(), [4, 1]);
    let error = select("1-4,9").unwrap_err();
    assert!(matches!(error, Error::MissingFrames { .. }));
    let text = error.to_string();
    assert!(text.contains("2 of 5 frames are missing: 3, 9; there are 3 from 1 to 4"), "{text}");
}

/// Files that are numbered by steps: a range means the frames between its ends, whatever steps it counts; gaps
/// and held frames follow the stride, and no number between two files is ever a frame.
#[test]
fn ranges_of_steps_count_files() {
    let numbered = |numbers: &[i64]| {
        let names: Vec<String> = numbers.iter().map(|n| format!("w_{n}.ply")).collect();
        let folder = folder(&names.iter().map(String::as_str).collect::<Vec<_>>());
        open(&folder, "w_{}.ply").unwrap()
    };
    let select = |sequence: &Sequence, spec: &str, missing| {
        spec.parse::<FrameSpec>().unwrap().numbers(sequence, missing)
    };
    let even = numbered(&[0, 1500, 3000, 4500, 6000]);
    assert_eq!((even.even_stride(), even.is_by_steps(), even.gaps()), (Some(1500), true, vec![]));
    for (spec, expected) in [
        ("1500-6000", &[1500, 3000, 4500, 6000][..]),
        ("1-6100", &[1500, 3000, 4500, 6000]),
        ("-5-1500", &[0, 1500]),
        ("6000-1500", &[6000, 4500, 3000, 1500]),
        ("0-6000x2", &[0, 3000, 6000]),
        ("0-6000x3000", &[0, 3000, 6000]),
        ("0-6000y3000", &[1500, 4500]),
        ("0-6000@b", &[0, 6000, 3000, 1500, 4500]),
        ("3000,0-1500", &[3000, 0, 1500]),
    ] {
        for missing in [Missing::Error, Missing::Hold, Missing::Empty] {
            assert_eq!(select(&even, spec, missing).unwrap(), expected, "{spec}");
        }
    }
    for (spec, problem) in [
        ("1600-2900", "no frame is in 1600-2900; there are 5 from 0 to 6000, by steps of 1500"),
        ("1600", "1 of 1 frames are missing: 1600; there are 5"),
        ("4500-9000", "2 of 4 frames are missing: 7500, 9000"),
    ] {
        let error = select(&even, spec, Missing::Error).unwrap_err().to_string();
        assert!(error.contains(problem), "{error}");
    }
    // More numbers than frames may be selected, of which few are frames.
    assert_eq!(select(&even, "0-30000000", Missing::Empty).unwrap().len(), 20_001);

    // A gap of the stride, in negative numbers.
    let gap = numbered(&[-40, -20, 20, 40]);
    assert!(select(&gap, "-40-40", Missing::Error).is_err());
    assert_eq!(select(&gap, "-40-40", Missing::Hold).unwrap(), [-40, -20, 0, 20, 40]);

    // Steps of varying length, and a last one out of turn, as of a restart.
    for numbers in [&[0, 1500, 3100][..], &[7, 1501, 3107, 4600], &[0, 1500, 3000, 4500, 4501]] {
        let uneven = numbered(numbers);
        assert_eq!((uneven.even_stride(), uneven.gaps()), (None, vec![]));
        for missing in [Missing::Error, Missing::Hold] {
            assert_eq!(select(&uneven, "8-4600", missing).unwrap(), numbers[1..]);
            assert_eq!(select(&uneven, "0-9999", missing).unwrap(), numbers);
            assert_eq!(select(&uneven, "all", missing).unwrap(), numbers);
        }
    }

    // Frames that follow each other are numbered by 1, however many are missing.
    for numbers in [&[1, 2, 4][..], &[1, 3, 6], &[1, 2, 3, 4, 900], &[5]] {
        let frames = numbered(numbers);
        assert_eq!((frames.even_stride(), frames.is_by_steps()), (Some(1), false), "{numbers:?}");
    }
    assert!(select(&numbered(&[1, 3, 6]), "1-6", Missing::Error).is_err());
}

/// Together, any number of shards contains every frame once.
#[test]
fn shards_partition_the_frames() {
    for count in 1..12 {
        let mut all: Vec<i64> = Vec::new();
        for index in 1..=count {
            let shard: Shard = format!("{index}/{count}").parse().unwrap();
            let mine: Vec<i64> = shard.of(0..10).collect();
            assert!(mine.iter().all(|frame| *frame as usize % count == index - 1));
            all.extend(mine);
        }
        all.sort_unstable();
        assert!(all.into_iter().eq(0..10));
    }
    assert!(Shard::default().of(0..10).eq(0..10));
    for bad in ["", "1", "0/4", "5/4", "1/0", "-1/4", "a/b", "1/2/3"] {
        assert!(matches!(bad.parse::<Shard>(), Err(Error::Usage(_))), "{bad:?}");
    }
}

/// Frames before time 0 have negative numbers.
#[test]
fn frame_numbers_may_be_negative() {
    let folder = folder(&["w_-2.xyz", "w_-1.xyz", "w_0.xyz", "w_1.xyz", "w_-.xyz"]);
    let sequence = open(&folder, "w_{}.xyz").unwrap();
    assert_eq!(numbers(&sequence), [-2, -1, 0, 1]);
    let spec: FrameSpec = "-2--1".parse().unwrap();
    assert_eq!(spec.select(&sequence).unwrap().len(), 2);
}
