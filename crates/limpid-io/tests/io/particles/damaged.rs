//! Files that are cut off, contradict themselves or are a part of a frame: never a part of the liquid without a word.

use std::fs;
use std::io::Write as _;
use std::path::Path;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use hdf5_pure::{AttrValue, FileBuilder};
use limpid::liquid::Particles;
use limpid_io::Error;
use limpid_io::frames::FrameSpec;
use limpid_io::particles::{Contents, ReadOptions, Remark, Unit};
use limpid_io::sequence::{Missing, Sequence};

use super::bgeo::gzip;
use super::other_programs::file;
use super::{all_attributes, check_message, positions_only};

pub(super) fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn write(folder: &Path, name: &str, particles: &Particles) {
    limpid_io::particles::write(particles, &folder.join(name)).expect("written");
}

fn open(folder: &Path, name: &str) -> limpid_io::Result<Sequence> {
    Sequence::open(folder.join(name).to_str().unwrap())
}

fn read(folder: &Path, name: &str) -> limpid_io::Result<Contents> {
    open(folder, name)?.frames[0].read(&ReadOptions::default())
}

/// A list that ends before its root does is cut off, wherever: at a tag, between tags, or within one.
#[test]
fn lists_that_are_cut_off() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for name in ["a.vtu", "b.vtu"] {
        write(folder.path(), name, &positions_only());
    }
    let grid = "<?xml version=\"1.0\"?>\n<VTKFile type=\"PUnstructuredGrid\">\n<PUnstructuredGrid>\n\
                <Piece Source=\"a.vtu\"/>\n<Piece Source=\"b.vtu\"></Piece>\n</PUnstructuredGrid>\n</VTKFile>\n";
    let blocks = "<VTKFile type=\"vtkMultiBlockDataSet\">\n<vtkMultiBlockDataSet>\n<Block index=\"0\">\n\
                  <DataSet file=\"a.vtu\"/>\n<DataSet file=\"b.vtu\"/>\n</Block>\n</vtkMultiBlockDataSet>\n</VTKFile>";
    let times = "<VTKFile type=\"Collection\"><Collection>\n<DataSet timestep=\"0\" file=\"a.vtu\"/>\n\
                 <DataSet timestep=\"1\" file=\"b.vtu\"/>\n</Collection></VTKFile>";
    let series =
        "{\"files\": [{\"name\": \"a.vtu\", \"time\": 0}, {\"name\": \"b.vtu\", \"time\": 1}]}";
    let lists = [
        ("l.pvtu", grid),
        ("l.pvtp", grid),
        ("l.vtm", blocks),
        ("l.pvd", times),
        ("l.series", series),
    ];
    for (name, text) in lists {
        fs::write(at(name), text).unwrap();
        let read = |name: &str| {
            let sequence = open(folder.path(), name)?;
            let frames = sequence.frames.iter();
            let read = frames.map(|frame| frame.read(&ReadOptions::default()));
            read.map(|contents| Ok(contents?.particles.len())).sum::<limpid_io::Result<usize>>()
        };
        assert_eq!(read(name).expect("whole"), 6, "{name}");
        let end = text.trim_end().len();
        for cut in 0..end {
            fs::write(at(name), &text[..cut]).unwrap();
            let error = read(name).expect_err("cut off");
            assert!(error.to_string().contains(name), "{name} at {cut}: {error}");
        }
        fs::remove_file(at(name)).unwrap();
    }
    let cut = grid.split_inclusive('\n').take(4).collect::<String>();
    check_message(
        "l.pvtu",
        cut.as_bytes(),
        &["l.pvtu: byte", "cut off", "<PUnstructuredGrid> has no end"],
    );
}

/// Raw appended data is no XML, but the document around it has an end.
#[test]
fn appended_data_without_an_end() {
    for name in ["vtk_zlib_appended.vtu", "vtk_lz4_appended.vtu"] {
        let bytes = fs::read(file(name)).unwrap();
        let end = bytes.trim_ascii_end().len() - b"</VTKFile>".len();
        for length in [end, end - 5, end - 18] {
            check_message(name, &bytes[..length], &["the file ends before </VTKFile>"]);
        }
    }
}

/// A header's number of particles is that of the particles: fewer, more and less than none are errors, and so is what
/// follows the last. Checksums are read to their end.
#[test]
fn counts_that_lie() {
    let prt = |count: i64, rows: &[u8]| {
        let mut head = b"\xc0PRT\r\n\x1a\n".to_vec();
        head.extend(56_i32.to_le_bytes());
        head.extend([0; 32]);
        head.extend(1_i32.to_le_bytes());
        head.extend(count.to_le_bytes());
        head.extend([4_i32, 1, 44].iter().flat_map(|n| n.to_le_bytes()));
        head.extend(b"Position".iter().chain(&[0; 24]));
        head.extend([4_i32, 3, 0].iter().flat_map(|n| n.to_le_bytes()));
        [&head[..], rows].concat()
    };
    let rows: Vec<u8> = (0..30).flat_map(|n| (n as f32).to_le_bytes()).collect();
    let packed = zlib(&rows);
    let good = limpid_io::particles::parse(Path::new("a.prt"), &prt(10, &packed)).expect("valid");
    assert_eq!(good.len(), 10);
    let none = limpid_io::particles::parse(Path::new("a.prt"), &prt(0, &zlib(&[]))).expect("valid");
    assert!(none.is_empty());
    for (count, part) in
        [(0, "more than"), (9, "more than"), (11, "132 bytes"), (-1, "did not finish")]
    {
        check_message("a.prt", &prt(count, &packed), &["a.prt: byte", part]);
    }
    for cut in 1..=6 {
        check_message("a.prt", &prt(10, &packed[..packed.len() - cut]), &["cut off"]);
    }
    let mut other = packed.clone();
    *other.last_mut().unwrap() ^= 1;
    check_message("a.prt", &prt(10, &other), &["damaged"]);
    check_message("a.prt", &prt(10, &[&packed[..], b"more"].concat()), &["4 bytes follow"]);

    let uni = |count: i32| {
        let mut head = b"PB02".to_vec();
        head.extend([count, 8, 8, 8, 0, 16].iter().flat_map(|n| n.to_le_bytes()));
        head.extend([0; 264]);
        head.extend([0; 160]);
        head
    };
    for bytes in [uni(10), gzip(&uni(10))] {
        let particles = limpid_io::particles::parse(Path::new("a.uni"), &bytes).expect("valid");
        assert_eq!(particles.len(), 10);
    }
    for (count, part) in
        [(4, "96 bytes follow the 4"), (0, "follow"), (11, "11 × 16"), (-1, "-1 particles")]
    {
        for bytes in [uni(count), gzip(&uni(count))] {
            check_message("a.uni", &bytes, &["a.uni: byte", part]);
        }
    }

    // Arrays of NumPy, alone and in an archive, points of PLY, and points of BGEO.
    let folder = tempfile::tempdir().unwrap();
    let bytes = |name: &str, particles: &Particles| {
        write(folder.path(), name, particles);
        fs::read(folder.path().join(name)).unwrap()
    };
    let replaced =
        |bytes: &[u8], from: &str, to: &str| super::patched(bytes, from.as_bytes(), to.as_bytes());
    let npy = bytes("a.npy", &positions_only());
    check_message(
        "a.npy",
        &replaced(&npy, "(3, 3)", "(2, 3)"),
        &["12 bytes follow the array of shape (2, 3)"],
    );
    for particles in [positions_only(), all_attributes()] {
        let ply = bytes("a.ply", &particles);
        check_message(
            "a.ply",
            &replaced(&ply, "vertex 3", "vertex 2"),
            &["bytes follow the elements"],
        );
        let bgeo = bytes("a.bhclassic", &particles);
        let few = super::patched(&bgeo, &3_i32.to_be_bytes(), &1_i32.to_be_bytes());
        check_message("a.bhclassic", &few, &["1 points announced, but 2 more follow"]);
    }
}

/// Snapshots of SWIFT and Gadget, and VTKHDF, say how many particles they have.
#[test]
fn counts_of_hdf5() {
    let build = |fill: &dyn Fn(&mut FileBuilder)| {
        let mut builder = FileBuilder::new();
        fill(&mut builder);
        builder.finish().expect("a file")
    };
    let positions = [0.5_f64, 1.0, 2.0, 3.0, 4.0, 5.0];
    let snapshot = |here: i64, total: &[(&str, i64)]| {
        build(&|file| {
            let mut header = file.create_group("Header");
            header.set_attr("NumPart_ThisFile", AttrValue::I64Array(vec![here, 7, 0, 0, 0, 0]));
            for (name, number) in total {
                header.set_attr(name, AttrValue::I64Array(vec![*number, 9]));
            }
            file.add_group(header.finish());
            let mut gas = file.create_group("PartType0");
            gas.create_dataset("Coordinates").with_f64_data(&positions).with_shape(&[2, 3]);
            file.add_group(gas.finish());
        })
    };
    let read = |bytes: &[u8]| {
        Contents::parse(Path::new("snap_000.0.hdf5"), bytes, &ReadOptions::default())
            .expect("valid")
    };
    assert_eq!(read(&snapshot(2, &[("NumPart_Total", 2), ("NumFilesPerSnapshot", 1)])).remarks, []);
    let particles = |total| Remark::Partial { found: 2, total, unit: Unit::Particles };
    let quarter = [("NumPart_Total", 8), ("NumFilesPerSnapshot", 4)];
    assert_eq!(read(&snapshot(2, &quarter)).remarks, [particles(8)]);
    let high = [("NumPart_Total", 2), ("NumPart_Total_HighWord", 1)];
    assert_eq!(read(&snapshot(2, &high)).remarks, [particles((1 << 32) + 2)]);
    let files = Remark::Partial { found: 1, total: 4, unit: Unit::Files };
    assert_eq!(read(&snapshot(2, &[("NumFilesPerSnapshot", 4)])).remarks, [files]);
    check_message("a.h5", &snapshot(3, &[]), &["NumPart_ThisFile is 3, but there are 2"]);
    check_message("a.h5", &snapshot(2, &[("NumPart_Total", 1)]), &["NumPart_Total is 1"]);
    check_message("a.h5", &snapshot(2, &[("NumPart_Total", -4)]), &["less than 0"]);

    let grid = |counts: &[i64]| {
        build(&|file| {
            let mut group = file.create_group("VTKHDF");
            group.set_attr("Type", AttrValue::String("UnstructuredGrid".into()));
            group.create_dataset("NumberOfPoints").with_i64_data(counts);
            group.create_dataset("Points").with_f64_data(&positions).with_shape(&[2, 3]);
            file.add_group(group.finish());
        })
    };
    for counts in [&[2][..], &[1, 1], &[0, 2, 0]] {
        assert_eq!(read(&grid(counts)).particles.len(), 2);
    }
    for (counts, said) in [(&[1][..], "1"), (&[2, 2], "4"), (&[-2], "-2"), (&[], "0")] {
        let said = format!("NumberOfPoints is {said}, but there are 2 points");
        check_message("a.vtkhdf", &grid(counts), &[&said]);
    }

    // All files of a snapshot are whole, whatever each of them says; some are not.
    let folder = tempfile::tempdir().unwrap();
    for rank in 0..4 {
        let name = format!("snap_012.{rank}.hdf5");
        fs::write(folder.path().join(name), snapshot(2, &quarter)).unwrap();
    }
    let sequence = open(folder.path(), "snap_012.{r}.hdf5").expect("a frame");
    assert_eq!((sequence.frames.len(), sequence.frames[0].number), (1, 12));
    let whole = read_frame(&sequence);
    assert_eq!((whole.particles.len(), whole.remarks), (8, vec![]));
    fs::remove_file(folder.path().join("snap_012.3.hdf5")).unwrap();
    let sequence = open(folder.path(), "snap_012.{r}.hdf5").expect("a frame");
    let six = Remark::Partial { found: 6, total: 8, unit: Unit::Particles };
    assert_eq!(read_frame(&sequence).remarks, [six]);
}

fn read_frame(sequence: &Sequence) -> Contents {
    sequence.frames[0].read(&ReadOptions::default()).expect("a frame")
}

/// A file of the ranks that is missing is named, with and without a place for the frame's number.
#[test]
fn missing_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let check = |present: &[&str], pattern: &str, missing: Option<&str>| {
        for name in present {
            write(folder.path(), name, &positions_only());
        }
        let opened = open(folder.path(), pattern);
        match missing {
            None => {
                assert_eq!(read_frame(&opened.expect("frames")).particles.len(), 3 * present.len());
            }
            Some(part) => {
                let error = opened.expect_err("incomplete").to_string();
                assert!(error.contains(pattern) && error.contains(part), "{error}");
            }
        }
        present.iter().for_each(|name| fs::remove_file(folder.path().join(name)).unwrap());
    };
    check(&["a.0.vtu", "a.1.vtu", "a.2.vtu"], "a.{r}.vtu", None);
    check(&["a.1.vtu", "a.2.vtu"], "a.{r}.vtu", None);
    check(&["a.0.vtu", "a.2.vtu"], "a.{r}.vtu", Some("rank 1 is missing"));
    check(&["p_r0_7.csv", "p_r3_7.csv"], "p_r{r}_{}.csv", Some("rank 1 is missing"));
    check(&["p_r2_7.csv", "p_r3_7.csv"], "p_r{r}_{}.csv", Some("rank 0 is missing"));
    check(&["Part_p00_0007.ply", "Part_p01_0007.ply"], "Part_p{r}_{}.ply", None);
    check(&["b_0.vtu", "b_1.vtu"], "c_{r}.vtu", Some("no file of this name"));
}

/// An attribute that a part of a frame lacks is ignored, and the part named: of pieces, of ranks, and of the bodies of
/// `PySPH`. Parts without particles lack nothing.
#[test]
fn unequal_parts() {
    let folder = tempfile::tempdir().unwrap();
    let some =
        Particles { radii: Some(vec![0.1; 3]), ids: Some(vec![1, 2, 3]), ..positions_only() };
    let list = |names: &[&str]| {
        let pieces: String = names.iter().map(|n| format!("<Piece Source=\"{n}\"/>")).collect();
        let text = format!("<VTKFile><PUnstructuredGrid>{pieces}</PUnstructuredGrid></VTKFile>");
        fs::write(folder.path().join("l.pvtu"), text).unwrap();
    };
    let check = |contents: &Contents, lacking: &str| {
        let particles = &contents.particles;
        assert!(
            particles.velocities.is_none() && particles.radii.is_some() && particles.ids.is_some()
        );
        let velocity = contents.arrays.iter().find(|array| array.name.contains("velocity"));
        assert_eq!(velocity.map(|array| array.used_as), Some(None), "{lacking}");
        let told = contents.remarks.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
        for part in ["velocity", "is ignored", lacking, "lacks it", "density"] {
            assert!(told.contains(part), "{part}: {told}");
        }
    };
    for extension in ["vtu", "vtk"] {
        let name = |n: usize| format!("p{n}.{extension}");
        write(folder.path(), &name(0), &all_attributes());
        write(folder.path(), &name(1), &some);
        write(folder.path(), &name(2), &Particles::default());
        list(&[&name(0), &name(1), &name(2)]);
        check(&read(folder.path(), "l.pvtu").expect("a frame"), &name(1));
        list(&[&name(0), &name(2)]);
        let whole = read(folder.path(), "l.pvtu").expect("a frame");
        assert_eq!((whole.remarks.len(), whole.particles.velocities.is_some()), (0, true));
    }
    for extension in ["csv", "ply", "npz"] {
        write(folder.path(), &format!("one_r0_5.{extension}"), &some);
        write(folder.path(), &format!("one_r1_5.{extension}"), &all_attributes());
        let contents =
            read(folder.path(), &format!("one_r{{r}}_{{}}.{extension}")).expect("a frame");
        check(&contents, &format!("one_r0_5.{extension}"));
    }

    let mut builder = FileBuilder::new();
    let mut particles = builder.create_group("particles");
    for (name, columns) in
        [("water", &["x", "y", "z", "u", "v", "w", "rho"][..]), ("fluid", &["x", "y", "z"])]
    {
        let mut body = particles.create_group(name);
        let mut arrays = body.create_group("arrays");
        for column in columns {
            arrays.create_dataset(column).with_f64_data(&[1.0, 2.0]);
        }
        body.add_group(arrays.finish());
        particles.add_group(body.finish());
    }
    builder.add_group(particles.finish());
    let bytes = builder.finish().unwrap();
    let contents =
        Contents::parse(Path::new("a.hdf5"), &bytes, &ReadOptions::default()).expect("valid");
    assert_eq!((contents.particles.len(), contents.particles.velocities.is_none()), (4, true));
    let told: Vec<String> = contents.remarks.iter().map(ToString::to_string).collect();
    assert_eq!(told, ["u v w is ignored: fluid lacks it", "rho is ignored: fluid lacks it"]);
}

/// Files of a list that are missing are frames that are missing: an error for all of them, and otherwise held or empty,
/// also before the first and after the last that is there.
#[test]
fn listed_files_that_are_missing() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.vtu", "b.vtu"] {
        write(folder.path(), name, &positions_only());
    }
    let pvd = |names: &[&str]| {
        let sets = names.iter().enumerate();
        let sets: String =
            sets.map(|(t, name)| format!("<DataSet timestep=\"{t}\" file=\"{name}\"/>")).collect();
        format!("<VTKFile><Collection>{sets}</Collection></VTKFile>")
    };
    let series = |names: &[&str]| {
        let files: Vec<String> =
            names.iter().map(|name| format!("{{\"name\": \"{name}\"}}")).collect();
        format!("{{\"files\": [{}]}}", files.join(","))
    };
    for (name, list) in [("l.pvd", &pvd as &dyn Fn(&[&str]) -> String), ("l.series", &series)] {
        for (names, gap) in [
            (["a.vtu", "gone.vtu", "b.vtu"], 1),
            (["gone.vtu", "a.vtu", "b.vtu"], 0),
            (["a.vtu", "b.vtu", "gone.vtu"], 2),
        ] {
            fs::write(folder.path().join(name), list(&names)).unwrap();
            let sequence = open(folder.path(), name).expect("a sequence");
            assert_eq!((sequence.frames.len(), sequence.gaps()), (2, vec![(gap, gap)]));
            let error = FrameSpec::All.numbers(&sequence, Missing::Error).unwrap_err();
            assert!(matches!(error, Error::MissingFrames { .. }), "{error}");
            assert!(error.to_string().contains("gone.vtu"), "{error}");
            for missing in [Missing::Hold, Missing::Empty] {
                assert_eq!(FrameSpec::All.numbers(&sequence, missing).expect("frames"), [0, 1, 2]);
            }
        }
        fs::write(folder.path().join(name), list(&["gone.vtu", "lost.vtu"])).unwrap();
        let error = open(folder.path(), name).unwrap_err().to_string();
        assert!(error.contains("none of its files") && error.contains("gone.vtu"), "{error}");
        fs::write(folder.path().join(name), list(&["a.vtu", "b.vtu"])).unwrap();
        let whole = open(folder.path(), name).expect("a sequence");
        assert!(whole.absent.is_empty() && whole.gaps().is_empty());
    }
}

/// Parts of a document share the limit of its memory, whatever their names and formats.
#[test]
fn parts_share_the_limit() {
    let folder = tempfile::tempdir().unwrap();
    let many = Particles::from_positions(vec![glam::Vec3::ONE; 10_000]);
    let limited = |name: &str, limit: u64| {
        let options = ReadOptions { max_unpacked: Some(limit), ..ReadOptions::default() };
        open(folder.path(), name).expect("a sequence").frames[0].read(&options)
    };
    fs::create_dir(folder.path().join("d")).unwrap();
    for extension in ["vtu", "vtk"] {
        write(folder.path(), &format!("p.{extension}"), &many);
        let pieces: String = (0..8)
            .map(|n| format!("<Piece Source=\"{}p.{extension}\"/>", "d/../".repeat(n)))
            .collect();
        let text = format!("<VTKFile><PUnstructuredGrid>{pieces}</PUnstructuredGrid></VTKFile>");
        fs::write(folder.path().join("l.pvtu"), text).unwrap();
        assert!(limited(&format!("p.{extension}"), 500_000).is_ok());
        assert_eq!(limited("l.pvtu", 2_400_000).expect("enough").particles.len(), 80_000);
        let error = limited("l.pvtu", 600_000).unwrap_err();
        assert!(matches!(error, Error::TooLarge { limit: 600_000, .. }), "{error}");
    }
    for extension in ["csv", "xyz", "npz", "bgeo"] {
        for rank in 0..8 {
            write(folder.path(), &format!("s_{rank}.{extension}"), &many);
        }
        let error = limited(&format!("s_{{r}}.{extension}"), 700_000).unwrap_err();
        assert!(matches!(error, Error::TooLarge { limit: 700_000, .. }), "{extension}: {error}");
    }
}
