//! The list of mistakes, `mistakes.md`: its commands are run, and print what it says.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::{SIZE, adapter, dam, folder, run_with};

/// A command of the page, and the line that follows it.
struct Mistake {
    variables: Vec<(String, String)>,
    args: Vec<String>,
    line: String,
}

/// The commands in the page's blocks: `$ NAME=VALUE limpid ARGUMENT 'ARGUMENT'`.
fn mistakes() -> Vec<Mistake> {
    let page = include_str!("mistakes.md");
    let mut lines = page.lines();
    let mut mistakes = Vec::new();
    while let Some(line) = lines.next() {
        let Some(command) = line.strip_prefix("$ ") else { continue };
        let mut words = command.split(' ').map(|word| word.trim_matches('\'').to_owned());
        let variables = words.by_ref().take_while(|word| word != "limpid");
        let pair = |word: String| {
            let (name, value) = word.split_once('=').expect("a variable");
            (name.to_owned(), value.to_owned())
        };
        let variables = variables.map(pair).collect();
        let args = words.collect();
        let line = lines.next().expect("a line of output").to_owned();
        assert_eq!(lines.next(), Some("```"), "one line for: {command}");
        mistakes.push(Mistake { variables, args, line });
    }
    mistakes
}

/// The text of a block of particles of this spacing, with z up below an uneven surface.
fn block(spacing: f64) -> String {
    let mut text = "x,y,z\n".to_owned();
    for i in 0..20 * 8 * 12 {
        let [x, y, z] = [i % 20, i / 20 % 8, i / 160].map(f64::from);
        if z < 6.0 + 4.0 * (0.4 * x).sin() + (0.9 * y).cos() {
            let [x, y, z] = [x, y, z].map(|x| (x + 0.5) * spacing);
            writeln!(text, "{x},{y},{z}").unwrap();
        }
    }
    text
}

/// A table of three columns as an array of `NumPy` of shape (3, n).
fn transposed(table: &str) -> Vec<u8> {
    let numbers = table.lines().skip(1).flat_map(|row| row.split(','));
    let numbers: Vec<f32> = numbers.map(|number| number.parse().unwrap()).collect();
    let count = numbers.len() / 3;
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': (3, {count}), }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    for axis in 0..3 {
        bytes.extend(numbers.iter().skip(axis).step_by(3).flat_map(|number| number.to_le_bytes()));
    }
    bytes
}

/// Makes the files that the page's commands name.
fn make_files(folder: &Path) {
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    for name in ["water_1.bgeo", "water_2.bgeo", "water_4.bgeo", "foam_1.bgeo"] {
        fs::copy(dam("5"), folder.join(name)).unwrap();
    }
    fs::create_dir(folder.join("pictures")).unwrap();
    write("millimetres.csv", &block(10.0));
    write("z_up.csv", &block(0.01));
    write("parked.csv", &(block(0.01).replace("x,y,z", "x,z,y") + &"1000,1000,1000\n".repeat(20)));
    fs::write(folder.join("transposed.npy"), transposed(&block(0.01))).unwrap();
    write("one.csv", "x,y,z\n0.1,0.2,0.3\n");
    write("nothing.csv", "");
    write("nan.csv", "x,y,z\n0,0,0\n0.1,nan,0\n0.2,0,0\n");
    write("diverged.csv", "x,y,z\n0,0,0\n0.1,nan,0\n0.2,0,inf\n");
    write("ids.csv", "x,y,z,id\n0,0,0,0.3\n0.1,0,0,0.6\n");
    write("sized.csv", "x,y,z,radius\n0,0,0,0.05\n0.1,0,0,0.05\n");
    write("paraview.bgeo", "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\">\n");
    write("frames.zip", "PK\x03\x04");
    let set = |time: usize, file: &str| format!("<DataSet timestep=\"{time}\" file=\"{file}\"/>");
    let sets = [set(0, "water_1.bgeo"), set(1, "gone.bgeo"), set(2, "water_2.bgeo")].concat();
    write("list.pvd", &format!("<VTKFile><Collection>{sets}</Collection></VTKFile>"));
    write("cut.pvtu", "<VTKFile><PUnstructuredGrid>\n<Piece Source=\"water.vtu\"/>\n");
    let step = |step: usize, x: f64| {
        format!(
            "ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS pp pp pp\n0 1\n0 1\n0 1\n\
             ITEM: ATOMS id x y z\n1 {x} 0 0\n"
        )
    };
    write("steps.dump", &[step(0, 0.0), step(100, 0.1), step(100, 0.2)].concat());
    write("scene.toml", "[liquid]\nabsorbtion = [1.0, 0.3, 0.1]\n");
    let mesh = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int i\nend_header\n\
        0 0 0\n0.1 0 0\n0 0.1 0\n0 0 0.1\n3 0 1 2\n";
    write("mesh.ply", mesh);
}

/// A line without what differs between machines and versions: the name of the adapter, which ends the
/// description of the particles, and the list of formats.
fn lasting(line: &str) -> String {
    let line = match line.rsplit_once("; ") {
        Some((particles, _)) if particles.contains(" particles, radius ") => particles,
        _ => line,
    };
    match line.split_once("limpid reads .bgeo") {
        Some((before, _)) => format!("{before}limpid reads …"),
        None => line.to_owned(),
    }
}

/// Each command of the page prints the line below it; beside it only what is drawn and written.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn each_mistake_gets_the_line_of_the_page() {
    if !adapter() || !cfg!(target_os = "linux") {
        return;
    }
    let folder = folder();
    let folder = folder.path();
    make_files(folder);
    let mistakes = mistakes();
    assert!(mistakes.len() >= 20, "only {} mistakes", mistakes.len());
    let mut wrong = String::new();
    for Mistake { variables, args, line } in mistakes {
        let mut args: Vec<&str> = args.iter().map(String::as_str).collect();
        if args[0] == "render" && !args.contains(&"--size") {
            args.push(SIZE);
        }
        let variables: Vec<_> = variables.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
        let outcome = run_with(folder, &args, &variables);
        let expected = lasting(&line);
        let is_expected = |printed: &str| lasting(printed) == expected;
        let is_usual = |printed: &str| {
            printed.starts_with("limpid: wrote ") || printed.contains(" particles, radius ")
        };
        let mut printed = outcome.stderr.lines();
        let found = printed.clone().filter(|line| is_expected(line)).count();
        if found != 1 || !printed.all(|line| is_expected(line) || is_usual(line)) {
            writeln!(wrong, "{args:?}\n  page: {line}\n  run:  {}", outcome.stderr).unwrap();
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}
