//! HDF5: the layouts of simulators, and damaged files.

use std::fs;
use std::path::Path;

use glam::Vec3;
use hdf5_pure::{AttrValue, FileBuilder};
use limpid_io::particles::{Contents, ReadOptions};

use super::other_programs::file;
use super::{check_message, patched, read};

fn parse(bytes: &[u8], map: &str) -> Contents {
    let map = if map.is_empty() { Default::default() } else { map.parse().unwrap() };
    let options = ReadOptions { map, ..ReadOptions::default() };
    Contents::parse(Path::new("a.h5"), bytes, &options).expect("valid")
}

fn ignored(contents: &Contents) -> Vec<String> {
    let ignored = contents.arrays.iter().filter(|array| array.used_as.is_none());
    ignored.map(ToString::to_string).collect()
}

/// Arrays that are no attributes are listed: the wall of `PySPH` as one, smoothing lengths, which are no
/// radii; and other gases of a snapshot are left alone. `--map` reads them.
#[test]
fn what_is_not_read_is_listed() {
    let pysph = parse(&fs::read(file("pysph.hdf5")).unwrap(), "");
    let names = ignored(&pysph);
    for name in ["boundary (2, 3)", "h (120)", "gid (120)"] {
        assert!(names.iter().any(|n| n == name), "{name}: {names:?}");
    }
    let swift = fs::read(file("swift.hdf5")).unwrap();
    assert_eq!(ignored(&parse(&swift, "")), ["SmoothingLengths (120)"]);
    let mapped = parse(&swift, "radius=SmoothingLengths").particles;
    assert_eq!(mapped.radii, Some(vec![0.12; 120]));
    assert_eq!(
        parse(&fs::read(file("vtk_points.vtkhdf")).unwrap(), "").cells,
        0,
        "vertices are no mesh"
    );
}

/// Positions are found at the root or in the only group that has some, as array or as columns; several liquids
/// of `PySPH` are one; solids alone are refused.
#[test]
fn layouts() {
    let build = |fill: &dyn Fn(&mut FileBuilder)| {
        let mut builder = FileBuilder::new();
        fill(&mut builder);
        builder.finish().expect("a file")
    };
    let columns = build(&|file| {
        for (name, x) in [("x", 0.5), ("y", 2.0), ("z", -1.0)] {
            file.create_dataset(name).with_f64_data(&[x, 0.25]);
        }
        file.create_dataset("rho").with_f32_data(&[1000.0, 999.0]);
    });
    let particles = parse(&columns, "").particles;
    assert_eq!(particles.positions, [Vec3::new(0.5, 2.0, -1.0), Vec3::splat(0.25)]);
    assert_eq!(particles.densities, Some(vec![1000.0, 999.0]));

    let with_groups = |names: &[&str]| {
        build(&|file| {
            for name in names {
                let mut group = file.create_group(name);
                group
                    .create_dataset("anything")
                    .with_f32_data(&[1.0, 2.0, 3.0])
                    .with_shape(&[1, 3]);
                file.add_group(group.finish());
            }
        })
    };
    assert_eq!(parse(&with_groups(&["frame"]), "").particles.positions, [Vec3::new(1.0, 2.0, 3.0)]);
    check_message("a.h5", &with_groups(&["one", "two"]), &["several groups: one, two"]);
    check_message("a.h5", &build(&|_| ()), &["no PartType0", "VTKHDF"]);

    let bodies = |names: &[&str]| {
        build(&|file| {
            let mut particles = file.create_group("particles");
            for (i, name) in names.iter().enumerate() {
                let mut body = particles.create_group(name);
                let mut arrays = body.create_group("arrays");
                for axis in ["x", "y", "z", "u", "v", "w"] {
                    arrays.create_dataset(axis).with_f64_data(&[i as f64]);
                }
                body.add_group(arrays.finish());
                particles.add_group(body.finish());
            }
            file.add_group(particles.finish());
        })
    };
    for (names, expected) in [
        (&["fluid", "solid", "cube"][..], vec![0.0]),
        (&["drop", "tank", "jet"], vec![0.0, 2.0]),
        (&["water", "fluid_2"], vec![0.0, 1.0]),
    ] {
        let particles = parse(&bodies(names), "").particles;
        let mut x: Vec<f32> = particles.positions.iter().map(|x| x.x).collect();
        x.sort_by(f32::total_cmp);
        assert_eq!(x, expected, "{names:?}");
        let velocities = particles.velocities.expect("u, v, w");
        assert!(velocities.iter().zip(&particles.positions).all(|(v, x)| v == x));
    }
    check_message("a.h5", &bodies(&["solid", "wall"]), &["only solids (", "no liquid"]);

    let steps = build(&|file| {
        let mut vtk = file.create_group("VTKHDF");
        vtk.set_attr("Type", AttrValue::AsciiString("PolyData".into()));
        let mut steps = vtk.create_group("Steps");
        steps.set_attr("NSteps", AttrValue::I64(3));
        vtk.add_group(steps.finish());
        file.add_group(vtk.finish());
    });
    check_message("a.vtkhdf", &steps, &["3 time steps", "a file of its own"]);
}

/// Data of the cells of VTKHDF are those of points where each point has a vertex cell of its own, in the same order;
/// others are listed.
#[test]
fn data_of_vertex_cells() {
    let file = |points: &[i64]| {
        let mut builder = FileBuilder::new();
        let mut vtk = builder.create_group("VTKHDF");
        vtk.set_attr("Type", AttrValue::AsciiString("PolyData".into()));
        let places = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0];
        vtk.create_dataset("Points").with_f32_data(&places).with_shape(&[2, 3]);
        let mut vertices = vtk.create_group("Vertices");
        vertices.create_dataset("Connectivity").with_i64_data(points);
        vtk.add_group(vertices.finish());
        let mut data = vtk.create_group("CellData");
        data.create_dataset("density").with_f32_data(&[7.0, 8.0]);
        vtk.add_group(data.finish());
        builder.add_group(vtk.finish());
        parse(&builder.finish().expect("a file"), "")
    };
    assert_eq!(file(&[0, 1]).particles.densities, Some(vec![7.0, 8.0]));
    let other = file(&[1, 1]);
    assert_eq!(
        (other.particles.densities.as_ref(), ignored(&other)),
        (None, vec!["density (2)".into()])
    );
}

/// Soft links are followed, through other links and to groups; those to nothing are left out, and those to other files
/// are named. Files by h5py.
#[test]
fn links() {
    let places: Vec<Vec3> = (0..8)
        .map(|i| Vec3::new((i / 4) as f32, (i / 2 % 2) as f32, (i % 2) as f32) * 0.5 + 0.25)
        .collect();
    let soft = parse(&fs::read(file("h5py_soft_links.h5")).unwrap(), "");
    assert_eq!(soft.particles.positions, places);
    assert_eq!(soft.particles.velocities, Some(places.iter().map(|x| 2.0 * x).collect()));
    assert!(soft.particles.densities.is_none() && soft.remarks.is_empty());

    let latest = parse(&fs::read(file("h5py_links_latest.h5")).unwrap(), "");
    assert_eq!(latest.particles.positions, places);
    assert!(latest.particles.velocities.is_none());
    let remark = latest.remarks.iter().map(ToString::to_string).collect::<Vec<_>>();
    assert_eq!(remark, ["Velocities is ignored: velocity is in the file other.h5"]);

    let many = parse(&fs::read(file("h5py_many_links.h5")).unwrap(), "");
    assert_eq!((many.particles.positions, many.arrays.len()), (places, 40));

    let external = fs::read(file("h5py_external.h5")).unwrap();
    check_message("a.h5", &external, &["Coordinates is a link to the file other.h5"]);
}

/// Layouts of HDF5 2.0, version 5, with each kind of index.
#[test]
fn layouts_of_the_latest_version() {
    let read = parse(&fs::read(file("h5py_layout_5.h5")).unwrap(), "").particles;
    assert_eq!(read.positions[6], Vec3::new(0.75, 0.75, 0.25));
    assert!(read.velocities.unwrap().iter().zip(&read.positions).all(|(v, x)| *v == 2.0 * x));
    assert_eq!(read.densities, Some(vec![1000.0; 8]));
    assert_eq!(read.ids, Some((0..8).collect()));
}

/// Whole numbers are coordinates, and bytes are none; floats that are not IEEE 754's are refused by their type, as
/// positions, or ignored, as attributes.
#[test]
fn types_of_numbers() {
    let build = |fill: &dyn Fn(&mut FileBuilder)| {
        let mut builder = FileBuilder::new();
        fill(&mut builder);
        builder.finish().expect("a file")
    };
    let whole = build(&|file| {
        file.create_dataset("Coordinates").with_i32_data(&[1, -2, 3]).with_shape(&[1, 3]);
    });
    assert_eq!(parse(&whole, "").particles.positions, [Vec3::new(1.0, -2.0, 3.0)]);
    let colours = build(&|file| {
        file.create_dataset("Coordinates").with_u8_data(&[1, 2, 3]).with_shape(&[1, 3]);
    });
    check_message("a.h5", &colours, &["Coordinates has integers of 1 bytes"]);
    let bias = fs::read(file("h5py_bias.h5")).unwrap();
    check_message("a.h5", &bias, &["Coordinates has floats of 4 bytes that are not IEEE 754's"]);
}

/// Files of other kinds, other data of VTK, positions that are none, and sizes that no file of this length can
/// have.
#[test]
fn errors_name_the_array() {
    check_message("a.h5", b"x y z\n1 2 3\n", &["not an HDF5 file"]);
    check_message("a.h5", b"", &["an empty file"]);
    check_message("a.npz", &fs::read(file("plain.h5")).unwrap(), &["this is an HDF5 file"]);
    let points = fs::read(file("vtk_points.vtkhdf")).unwrap();
    let image = patched(&points, b"PolyData", b"HyperBox");
    check_message("a.vtkhdf", &image, &["type `HyperBox`", "UnstructuredGrid or PolyData"]);

    let mut builder = FileBuilder::new();
    builder.create_dataset("pos").with_f32_data(&[0.0, 1.0, f32::NAN]).with_shape(&[1, 3]);
    let nan = builder.finish().unwrap();
    check_message("a.h5", &nan, &["a.h5 (/pos): byte", "particle 0", "finite"]);

    // Chunks and arrays of 2⁴⁰ particles.
    let mut claimed = fs::read(file("swift.hdf5")).unwrap();
    let (count, large) = (120_u64.to_le_bytes(), (1_u64 << 40).to_le_bytes());
    for at in 0..claimed.len() - 8 {
        if claimed[at..at + 8] == count {
            claimed[at..at + 8].copy_from_slice(&large);
        }
    }
    let parts = ["a.h5 (PartType0/Coordinates)", "26388279066624 bytes cannot be in a file of"];
    check_message("a.h5", &claimed, &parts);
}

/// A chunk that claims fewer bytes than its numbers take: the last one would be made up.
#[test]
fn short_chunks_are_damage() {
    let sound = fs::read(file("h5py_chunk.h5")).unwrap();
    let contents = parse(&sound, "");
    assert_eq!(contents.particles.positions[9].z, 0.805_750_8);
    // In the node of the tree of chunks.
    let node = sound.windows(5).position(|bytes| bytes == b"TREE\x01").expect("a tree of chunks");
    let mut short = sound;
    assert_eq!(short[node + 24], 120);
    short[node + 24] = 119;
    let parts = ["a.h5 (PartType0/Coordinates)", "a chunk of 119 bytes where 120 are expected"];
    check_message("a.h5", &short, &parts);
}

/// No damage makes the reader panic, run for ever or take memory; the file is named. Half of the files are cut
/// off, the others have a few changed bytes.
#[test]
fn damaged_files_are_refused() {
    let mut seed = 1_u64;
    let mut random = |below: usize| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as usize % below
    };
    let names = [
        "swift.hdf5",
        "pysph.hdf5",
        "vtk_grid.vtkhdf",
        "vtk_points.vtkhdf",
        "plain.h5",
        "h5py_soft_links.h5",
        "h5py_links_latest.h5",
        "h5py_many_links.h5",
        "h5py_layout_5.h5",
    ];
    let mut refused = 0;
    for name in names {
        let sound = fs::read(file(name)).unwrap();
        for round in 0..120 {
            let mut bytes = sound.clone();
            if round % 2 == 0 {
                bytes.truncate(random(sound.len()));
            } else {
                for _ in 0..1 + random(6) {
                    let at = random(bytes.len());
                    bytes[at] = random(256) as u8;
                }
            }
            if let Err(error) = read(name, &bytes) {
                let message = error.to_string();
                assert!(message.contains(name) && !message.contains('\n'), "{message}");
                assert!(!message.contains("its decoder failed"), "round {round} of {name} panics");
                refused += 1;
            }
        }
    }
    assert!(refused > 300, "only {refused} files were refused");
}
