//! Messages of `render` on standard error: a line for the input, one for the output, and notices of
//! likely mistakes.

use std::fs;
use std::path::Path;

use super::{SIZE, adapter, assert_contains, folder, project, run};

/// Runs `render`, which must succeed, and returns the lines on stderr.
#[track_caller]
fn messages(folder: &Path, args: &[&str]) -> Vec<String> {
    let args: Vec<_> = ["render", SIZE].into_iter().chain(args.iter().copied()).collect();
    let outcome = run(folder, &args);
    assert_eq!((outcome.code, outcome.stdout.as_str()), (0, ""), "{args:?}: {}", outcome.stderr);
    let lines = outcome.stderr.lines().map(|line| line.strip_prefix("limpid: ").unwrap());
    lines.map(str::to_owned).collect()
}

/// The CSV text of a small block of liquid of this spacing and corner, with additional columns.
fn block(spacing: f64, columns: &str, values: &str, corner: [f64; 3]) -> String {
    let mut text = format!("x,y,z{columns}\n");
    for i in 0..6 * 6 * 6 {
        let [x, y, z] = [i % 6, i / 6 % 6, i / 36].map(|i| f64::from(i) * spacing);
        text += &format!("{},{},{}{values}\n", x + corner[0], y + corner[1], z + corner[2]);
    }
    text
}

/// `render` prints a line for its input and one for its output; with `--quiet` none.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn a_line_for_input_and_one_for_output() {
    if !adapter() {
        return;
    }
    let folder = folder();
    let text = block(0.05, ",vx,vy,vz,Diameter", ",0,0,0,0.05", [0.0; 3]);
    fs::write(folder.path().join("a.csv"), &text).unwrap();
    let lines = messages(folder.path(), &["a.csv", "--radius=0.025", "-o", "a.png"]);
    assert_eq!(lines.len(), 2, "{lines:?}");
    let start = "216 particles, radius 0.025 m (--radius), ";
    assert!(lines[0].starts_with(start), "{lines:?}");
    assert_contains(&lines[0], &["vx vy vz used, Diameter ignored; "]);
    assert_eq!(lines[1], "wrote a.png");
    let quiet = messages(folder.path(), &["a.csv", "--radius=0.025", "-o", "a.png", "--quiet"]);
    assert!(quiet.is_empty(), "{quiet:?}");

    fs::write(folder.path().join("w_0100.csv"), &text).unwrap();
    fs::write(folder.path().join("w_0200.csv"), &text).unwrap();
    let several = ["w_{}.csv", "--radius=0.025", "-o", "out/"];
    let lines = messages(folder.path(), &several);
    assert_eq!(lines[1..], ["wrote 2 pictures, out/frame_0100.png to out/frame_0200.png"]);
    let lines = messages(folder.path(), &[&several[..], &["--skip-existing"]].concat());
    assert_eq!(lines, ["2 of 2 pictures already exist"]);
    fs::remove_file(folder.path().join("out/frame_0200.png")).unwrap();
    let lines = messages(folder.path(), &[&several[..], &["--skip-existing"]].concat());
    assert_eq!(lines[1..], ["wrote out/frame_0200.png; 1 already existed"]);
    // The rate of a film is assumed if it is not given.
    let lines = messages(folder.path(), &["w_{}.csv", "--radius=0.025", "-o", "film.apng"]);
    assert_contains(
        &lines[0],
        &["frames per second are not known, 30 assumed; set them with --fps"],
    );
    assert_eq!(lines[2..], ["wrote film.apng, 2 pictures"]);
    let lines =
        messages(folder.path(), &["w_{}.csv", "--radius=0.025", "-o", "b.apng", "--fps=25"]);
    assert_eq!(lines.len(), 2, "{lines:?}");
}

/// Missing frames are reported once, with their treatment.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn gaps_are_reported() {
    if !adapter() {
        return;
    }
    let folder = folder();
    for number in [10, 20, 50, 70] {
        let text = block(0.05, "", "", [0.0; 3]);
        fs::write(folder.path().join(format!("w_{number}.csv")), text).unwrap();
    }
    let render = |args: &[&str]| {
        let args = [&["w_{}.csv", "--radius=0.025", "-o", "out/"], args].concat();
        messages(folder.path(), &args)
    };
    let lines = render(&[]);
    assert_contains(&lines[0], &["frames are missing and left out", ": 30 to 40, 60"]);
    assert_eq!(lines.len(), 3, "{lines:?}");
    let lines = render(&["--missing=hold"]);
    assert_contains(&lines[0], &["drawn as the frame before: 30 to 40, 60"]);
    assert_contains(&lines[2], &["wrote 7 pictures"]);
    assert_eq!(render(&["--frames=10,70"]).len(), 2, "selected frames have no gaps");
}

/// Each likely mistake is reported in one line with its remedy; a correct run reports none.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn likely_mistakes_are_reported() {
    if !adapter() {
        return;
    }
    let folder = folder();
    let folder = folder.path();
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    write("a.csv", &block(0.05, "", "", [0.0; 3]));
    let render = |args: &[&str]| {
        let lines = messages(folder, &[args, &["-o", "a.png"]].concat());
        assert_eq!(lines.last().unwrap(), "wrote a.png");
        lines[1..lines.len() - 1].join("\n")
    };
    let radius = "--radius=0.025";
    assert_eq!(render(&["a.csv", radius]), "");

    let away = "--camera=eye=0,0,5 target=0,0,9 fov_y=40";
    let line = render(&["a.csv", radius, away]);
    assert_contains(&line, &["no liquid is visible: all 216 particles", "--camera"]);
    let near = "--camera=eye=0.3,0.3,0.5 target=0.3,0.3,0 fov_y=20";
    assert_contains(
        &render(&["a.csv", radius, near]),
        &["% of the particles are out of the picture"],
    );

    // Particles in metres with a radius in centimetres.
    assert_contains(
        &render(&["a.csv", "--radius=2.5"]),
        &["much closer together than their radius of 2.5 m", "--scale 0.001"],
    );
    // Places in millimetres with a radius in metres.
    write("wide.csv", &block(50.0, "", "", [0.0; 3]));
    let line = render(&["wide.csv", radius]);
    assert_contains(&line, &["much farther apart than their radius of 0.025 m", "--scale 0.001"]);
    assert_eq!(render(&["wide.csv", radius, "--scale=0.001"]), "", "the remedy does not help");
    write("none.csv", "x,y,z\n");
    let lines = messages(folder, &["none.csv", "-o", "a.png"]);
    assert_contains(&lines[0], &["no picture has particles"]);
    // A radius column that was never filled in.
    write("zero.csv", &block(0.05, ",radius", ",0", [0.0; 3]));
    let lines = messages(folder, &["zero.csv", "-o", "a.png"]);
    assert_contains(&lines[0], &["m (guessed)", "radius ignored"]);

    write("mm.csv", &block(50.0, "", "", [0.0; 3]));
    // A look tints the liquid in proportion to its size; water itself is opaque at that size.
    assert_eq!(render(&["mm.csv", "--radius=25"]), "");
    let line = render(&["mm.csv", "--radius=25", "--tint=physical"]);
    assert_contains(&line, &["extend over 250 m", "--scale 0.001"]);
    let scaled = ["mm.csv", "--radius=0.025", "--tint=physical", "--scale=0.001"];
    assert_eq!(render(&scaled), "", "the remedy does not help");

    let sun = "[[light]]\nsun = { direction = [0, -1, 0], irradiance = [1, 1, 1] }\n";
    let floor = "[[solid]]\nshape = \"plane\"\norigin = [0, -1, 0]\n";
    write("dark.toml", &format!("{floor}{sun}"));
    write("lit.toml", &format!("{floor}lit = true\n{sun}"));
    let line = render(&["a.csv", radius, "--scene=dark.toml"]);
    assert_contains(&line, &["[[light]] has no effect", "`lit = true`"]);
    assert_eq!(render(&["a.csv", radius, "--scene=lit.toml"]), "");
    let lamp = "[[light]]\npoint = { position = [0.12, 0.12, 0.12], intensity = [1, 1, 1] }\n";
    write("lamp.toml", &format!("{floor}lit = true\n{sun}{lamp}"));
    let line = render(&["a.csv", radius, "--scene=lamp.toml"]);
    assert_contains(&line, &["no caustics by [[light]] 2:", "shines straight through"]);

    let mesh = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int i\nend_header\n\
        0 0 0\n0.05 0 0\n0 0.05 0\n3 0 1 2\n";
    write("mesh.ply", mesh);
    assert_contains(&render(&["mesh.ply", radius]), &["a mesh (cells: 1)"]);
}

/// Messages shorten very long arguments, but keep their ends.
#[test]
fn long_arguments_are_shortened_in_messages() {
    let folder = folder();
    let long = format!("first{}last", "q".repeat(5000));
    let commands: [&[&str]; 4] = [
        &["info", &long],
        &["render", "--size", &long],
        &["render", "--aov", &long],
        &["render", "--set", &format!("liquid.{long}=1")],
    ];
    for args in commands {
        let outcome = run(folder.path(), args);
        assert_ne!(outcome.code, 0);
        assert!(outcome.stderr.len() < 2000, "{} bytes", outcome.stderr.len());
        assert_contains(&outcome.stderr, &["first", "last"]);
    }
}

/// A key of another shape is refused like an unknown key.
#[test]
fn keys_of_other_shapes_are_refused() {
    let project = project();
    let scene = "[[solid]]\nshape = \"sphere\"\ncenter = [0, 0, 0]\nradius = 1\nhalf_extent = 2\n";
    fs::write(project.path().join("a.toml"), scene).unwrap();
    let line = super::fail(project.path(), 2, &["render", "water", "--scene=a.toml"]);
    assert_contains(&line, &["[[solid]] 1: a sphere has no half_extent; it takes center, radius"]);
}
