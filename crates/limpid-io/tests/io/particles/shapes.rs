//! Arrays with a row for each coordinate, of two dimensions, and with an axis of time steps: in `.npy`, `.npz` and HDF5.

use std::fs;
use std::path::Path;

use glam::Vec3;
use hdf5_pure::FileBuilder;
use limpid_io::particles::{Contents, ReadOptions, Remark};
use limpid_io::sequence::Sequence;

use super::npy::npy;
use super::npz::npz;
use super::{check_message, read};

/// Place of particle `i` at a step.
fn place(step: usize, i: usize) -> Vec3 {
    Vec3::new(i as f32, 0.5 * step as f32, -(i as f32) - 10.0 * step as f32)
}

/// The numbers of an array of these sizes, last axis fastest, each by its indices.
fn numbers(sizes: [usize; 3], number: impl Fn([usize; 3]) -> f32) -> Vec<f32> {
    let [a, b, c] = sizes;
    let indices = (0..a).flat_map(|i| (0..b).flat_map(move |j| (0..c).map(move |k| [i, j, k])));
    indices.map(number).collect()
}

fn bytes(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

fn contents(name: &str, bytes: &[u8]) -> Contents {
    Contents::parse(Path::new(name), bytes, &ReadOptions::default()).expect("valid")
}

/// The frames of a file as their numbers and contents, and its rate.
fn frames(name: &str, bytes: &[u8]) -> (Vec<i64>, Vec<Contents>, Option<f64>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    let sequence = Sequence::open(path.to_str().unwrap()).expect("a sequence");
    let numbers = sequence.frames.iter().map(|frame| frame.number).collect();
    let read = sequence.frames.iter().map(|frame| frame.read(&ReadOptions::default()).unwrap());
    (numbers, read.collect(), sequence.fps)
}

fn is_step(contents: &Contents, step: usize, count: usize) -> bool {
    contents.particles.positions == (0..count).map(|i| place(step, i)).collect::<Vec<_>>()
}

/// (3, n) is n particles, whose count is said, as (k, n) with rows of other quantities is; (3, 3) is rows. Attributes in
/// the same file follow, whichever way they lie themselves.
#[test]
fn a_row_for_each_coordinate() {
    const COUNT: usize = 5;
    let turned = bytes(&numbers([1, 3, COUNT], |[_, k, i]| place(0, i)[k]));
    let read = contents("a.npy", &npy("<f4", "False", "(3, 5)", &turned));
    assert!(is_step(&read, 0, COUNT));
    let expected =
        Remark::Transposed { array: "the array".into(), shape: vec![3, 5], particles: COUNT };
    assert_eq!(read.remarks, [expected]);
    let text = read.remarks[0].to_string();
    assert_eq!(text, "the array (3, 5) has a row for each coordinate: 5 particles");
    // The same array as Fortran stores it.
    let rows = bytes(&numbers([1, COUNT, 3], |[_, i, k]| place(0, i)[k]));
    assert!(is_step(&contents("a.npy", &npy("<f4", "True", "(3, 5)", &rows)), 0, COUNT));

    let square = contents("a.npy", &npy("<f4", "False", "(3, 3)", &rows[..36]));
    assert!(is_step(&square, 0, 3) && square.remarks.is_empty());

    let six = bytes(&numbers([1, 6, 80], |[_, k, i]| if k < 3 { place(0, i)[k] } else { 7.0 }));
    let read = contents("a.npy", &npy("<f4", "False", "(6, 80)", &six));
    assert!(is_step(&read, 0, 80));
    assert_eq!(read.arrays[0].to_string(), "rows after the third (80, 3)");

    let doubled: Vec<f32> = numbers([1, 3, COUNT], |[_, k, i]| 2.0 * place(0, i)[k]);
    let other = bytes(&numbers([1, COUNT, 3], |[_, i, k]| 2.0 * place(0, i)[k]));
    let density = bytes(&[1.0, 2.0, 3.0, 4.0, 5.0]);
    let variants = [("(3, 5)", bytes(&doubled)), ("(5, 3)", other)];
    for (shape, velocity) in variants {
        let archive = npz(
            &[
                ("positions.npy", npy("<f4", "False", "(3, 5)", &turned)),
                ("velocity.npy", npy("<f4", "False", shape, &velocity)),
                ("density.npy", npy("<f4", "False", "(1, 5)", &density)),
            ],
            true,
        );
        let particles = contents("a.npz", &archive).particles;
        let expected: Vec<Vec3> = (0..COUNT).map(|i| 2.0 * place(0, i)).collect();
        assert_eq!(particles.velocities, Some(expected), "{shape}");
        assert_eq!(particles.densities, Some(vec![1.0, 2.0, 3.0, 4.0, 5.0]));
    }

    let mut file = FileBuilder::new();
    let turned = numbers([1, 3, COUNT], |[_, k, i]| place(0, i)[k]);
    file.create_dataset("pos").with_f32_data(&turned).with_shape(&[3, COUNT as u64]);
    file.create_dataset("vel").with_f32_data(&doubled).with_shape(&[3, COUNT as u64]);
    let read = contents("a.h5", &file.finish().unwrap());
    assert!(is_step(&read, 0, COUNT) && read.particles.velocities.is_some());
    assert!(matches!(&read.remarks[..], [Remark::Transposed { array, .. }] if array == "pos"));
}

/// Two coordinates are x and y, with their velocities, and this is said.
#[test]
fn two_dimensions() {
    let flat = bytes(&numbers([1, 4, 2], |[_, i, k]| (i + k) as f32));
    let archive = npz(
        &[
            ("x.npy", npy("<f4", "False", "(4, 2)", &flat)),
            ("v.npy", npy("<f4", "False", "(4, 2)", &flat)),
            ("other.npy", npy("<f4", "False", "(4, 2)", &flat)),
        ],
        false,
    );
    let read = contents("a.npz", &archive);
    let expected: Vec<Vec3> = (0..4).map(|i| Vec3::new(i as f32, 1.0 + i as f32, 0.0)).collect();
    assert_eq!(read.particles.positions, expected);
    assert_eq!(read.particles.velocities, Some(expected.clone()));
    assert_eq!(read.remarks, [Remark::Planar { array: "x".into() }]);
    let alone = contents("a.npy", &npy("<f4", "False", "(4, 2)", &flat));
    assert_eq!(alone.particles.positions, expected);
    // An array of pairs without a name is none of positions.
    let pairs = npz(&[("other.npy", npy("<f4", "False", "(4, 2)", &flat))], false);
    check_message("a.npz", &pairs, &["no array", "other"]);
}

/// Steps of `.npy` are frames, wherever their axis is, and however the array lies in memory.
#[test]
fn steps_of_one_array() {
    const STEPS: usize = 4;
    const COUNT: usize = 6;
    let by_axes = |sizes: [usize; 3], axes: [usize; 3]| {
        let [step, particle, axis] = axes;
        bytes(&numbers(sizes, |at| place(at[step], at[particle])[at[axis]]))
    };
    for (order, shape, data) in [
        ("False", "(4, 6, 3)", by_axes([STEPS, COUNT, 3], [0, 1, 2])),
        ("False", "(4, 3, 6)", by_axes([STEPS, 3, COUNT], [0, 2, 1])),
        ("False", "(3, 4, 6)", by_axes([3, STEPS, COUNT], [1, 2, 0])),
        // Fortran's first axis is the fastest.
        ("True", "(3, 6, 4)", by_axes([STEPS, COUNT, 3], [0, 1, 2])),
        ("True", "(4, 6, 3)", by_axes([3, COUNT, STEPS], [2, 1, 0])),
    ] {
        let file = npy("<f4", order, shape, &data);
        let (numbers, contents, fps) = frames("rollout.npy", &file);
        assert_eq!((numbers, fps), (vec![0, 1, 2, 3], None), "{shape}");
        for (step, contents) in contents.iter().enumerate() {
            assert!(is_step(contents, step, COUNT), "{order} {shape}: step {step}");
        }
        check_message("rollout.npy", &file, &["several frames in one file", "name it alone"]);
    }
    // A single step is a file as any other, and none has no particles.
    let one = by_axes([1, COUNT, 3], [0, 1, 2]);
    assert!(is_step(&contents("a.npy", &npy("<f4", "False", "(1, 6, 3)", &one)), 0, COUNT));
    assert!(read("a.npy", &npy("<f4", "False", "(0, 6, 3)", &[])).unwrap().is_empty());
    // A step beyond the end of the file.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.npy");
    let data = by_axes([STEPS, COUNT, 3], [0, 1, 2]);
    fs::write(&path, npy("<f4", "False", "(4, 6, 3)", &data[..data.len() - 4])).unwrap();
    let sequence = Sequence::open(path.to_str().unwrap()).unwrap();
    assert!(sequence.frames[2].read(&ReadOptions::default()).is_ok());
    let error = sequence.frames[3].read(&ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("cut.npy: byte 128") && error.contains("beyond the end"), "{error}");
}

/// The arrays of an archive that change with time are read at the step, others for all; even times are a rate.
#[test]
fn steps_of_an_archive() {
    const STEPS: usize = 3;
    const COUNT: usize = 5;
    let places = bytes(&numbers([STEPS, COUNT, 3], |[step, i, k]| place(step, i)[k]));
    let speeds = bytes(&numbers([STEPS, COUNT, 3], |[step, i, k]| -place(step, i)[k]));
    let density = bytes(&numbers([1, STEPS, COUNT], |[_, step, i]| (10 * step + i) as f32));
    let radius = bytes(&[0.1, 0.2, 0.3, 0.4, 0.5]);
    let times: Vec<u8> = [1.0_f64, 1.5, 2.0].into_iter().flat_map(f64::to_le_bytes).collect();
    for deflated in [false, true] {
        let archive = npz(
            &[
                ("density.npy", npy("<f4", "False", "(3, 5)", &density)),
                ("positions.npy", npy("<f4", "False", "(3, 5, 3)", &places)),
                ("velocity.npy", npy("<f4", "False", "(3, 5, 3)", &speeds)),
                ("radius.npy", npy("<f4", "False", "(5,)", &radius)),
                ("time.npy", npy("<f8", "False", "(3,)", &times)),
            ],
            deflated,
        );
        let (numbers, contents, fps) = frames("rollout.npz", &archive);
        assert_eq!((numbers, fps), (vec![0, 1, 2], Some(2.0)), "{deflated}");
        for (step, contents) in contents.iter().enumerate() {
            assert!(is_step(contents, step, COUNT), "step {step}");
            let particles = &contents.particles;
            let expected: Vec<Vec3> = (0..COUNT).map(|i| -place(step, i)).collect();
            assert_eq!(particles.velocities, Some(expected));
            let expected = (0..COUNT).map(|i| (10 * step + i) as f32).collect();
            assert_eq!(particles.densities, Some(expected));
            assert_eq!(particles.radii, Some(vec![0.1, 0.2, 0.3, 0.4, 0.5]));
            // The times are the rate, and so used.
            assert!(contents.arrays.iter().all(|array| array.used_as.is_some()));
        }
        check_message("rollout.npz", &archive, &["several frames in one file"]);
    }
}

/// HDF5: a rollout in a group, H5MD with its steps and times, and the groups of H5Part.
#[test]
fn steps_of_hdf5() {
    const STEPS: usize = 3;
    const COUNT: usize = 5;
    let shape = [STEPS as u64, COUNT as u64, 3];
    let places = numbers([STEPS, COUNT, 3], |[step, i, k]| place(step, i)[k]);
    let check = |name: &str, bytes: &[u8], numbers: &[i64], rate: Option<f64>| {
        let (found, contents, fps) = frames("a.h5", bytes);
        assert_eq!((found.as_slice(), fps), (numbers, rate), "{name}");
        for (step, contents) in contents.iter().enumerate() {
            assert!(is_step(contents, step, COUNT), "{name}: step {step}");
            assert_eq!(contents.particles.densities, Some(vec![7.0; COUNT]), "{name}");
        }
        check_message("a.h5", bytes, &["several frames in one file"]);
    };
    let density = vec![7.0_f32; COUNT];

    let mut file = FileBuilder::new();
    let mut run = file.create_group("00000");
    run.create_dataset("position").with_f32_data(&places).with_shape(&shape);
    run.create_dataset("density").with_f32_data(&density);
    file.add_group(run.finish());
    check("rollout", &file.finish().unwrap(), &[0, 1, 2], None);

    // Columns with steps, two groups down, beside those of a wall.
    let mut file = FileBuilder::new();
    let mut run = file.create_group("run");
    for name in ["fluid", "boundary"] {
        let mut body = run.create_group(name);
        for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
            let column = numbers([1, STEPS, COUNT], |[_, step, i]| place(step, i)[k]);
            body.create_dataset(axis).with_f32_data(&column).with_shape(&shape[..2]);
        }
        let density = vec![7.0; STEPS * COUNT];
        body.create_dataset("rho").with_f32_data(&density).with_shape(&shape[..2]);
        run.add_group(body.finish());
    }
    file.add_group(run.finish());
    check("columns", &file.finish().unwrap(), &[0, 1, 2], None);

    let mut file = FileBuilder::new();
    let mut particles = file.create_group("particles");
    for (name, sign) in [("water", 1.0_f32), ("wall", -1.0)] {
        let mut body = particles.create_group(name);
        let mut position = body.create_group("position");
        let signed: Vec<f32> = places.iter().map(|x| sign * x).collect();
        position.create_dataset("value").with_f32_data(&signed).with_shape(&shape);
        position.create_dataset("step").with_i64_data(&[0, 100, 200]);
        position.create_dataset("time").with_f64_data(&[0.0, 0.02, 0.04]);
        body.add_group(position.finish());
        body.create_dataset("density").with_f32_data(&density);
        particles.add_group(body.finish());
    }
    file.add_group(particles.finish());
    check("H5MD", &file.finish().unwrap(), &[0, 100, 200], Some(50.0));

    let mut file = FileBuilder::new();
    for step in [10, 2, 0] {
        let mut group = file.create_group(&format!("Step#{step}"));
        let at = [0, 2, 10].iter().position(|&other| other == step).unwrap();
        for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
            let column: Vec<f64> = (0..COUNT).map(|i| f64::from(place(at, i)[k])).collect();
            group.create_dataset(axis).with_f64_data(&column);
        }
        group.create_dataset("rho").with_f32_data(&density);
        file.add_group(group.finish());
    }
    check("H5Part", &file.finish().unwrap(), &[0, 2, 10], None);
}
