//! Standard input and standard output in place of files: `-`.

use std::fs;
use std::path::Path;

use limpid::glam::Vec3;
use limpid::liquid::Particles;
use limpid_io::particles;

use super::{SIZE, adapter, assert_contains, folder, render};

/// Runs the program with this standard input; returns its code, standard output and standard error.
fn pipe(folder: &Path, args: &[&str], input: &[u8]) -> (i32, Vec<u8>, String) {
    let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_limpid"));
    command.env("NODEVICE_SELECT", "1").current_dir(folder).args(args);
    let output = command.write_stdin(input).output().expect("the program starts");
    let stderr = String::from_utf8(output.stderr).expect("stderr is UTF-8");
    (output.status.code().expect("no signal"), output.stdout, stderr)
}

/// A cube of particles as a file of this name, and its bytes.
fn cube(folder: &Path, name: &str) -> Vec<u8> {
    let at = |i: usize| Vec3::new((i % 5) as f32, (i / 5 % 5) as f32, (i / 25) as f32) * 0.1;
    let particles = Particles::from_positions((0..125).map(at).collect());
    particles::write(&particles, &folder.join(name)).expect("it can be written");
    fs::read(folder.join(name)).expect("it can be read")
}

/// `render - -o -` draws the same as from the file, to the bit, and puts nothing else on standard output.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn render_from_pipe_to_pipe() {
    if !adapter() {
        return;
    }
    let folder = folder();
    for name in ["cube.npz", "cube.ply"] {
        let bytes = cube(folder.path(), name);
        render(folder.path(), &[name, "-o", "file.png"]);
        let (code, png, stderr) = pipe(folder.path(), &["render", SIZE, "-", "-o", "-"], &bytes);
        assert_eq!(code, 0, "{stderr}");
        assert!(stderr.contains("wrote standard output"), "{stderr}");
        let picture = image::load_from_memory_with_format(&png, image::ImageFormat::Png);
        let expected = image::open(folder.path().join("file.png")).unwrap();
        assert!(picture.expect("a PNG") == expected, "{name}");
    }
    // Particles that differ are drawn again, though both come from the same place.
    let args = ["render", "-q", SIZE, "-", "-o", "a.png", "--skip-existing"];
    let first = cube(folder.path(), "cube.npz");
    assert_eq!(pipe(folder.path(), &args, &first).0, 0);
    let drawn = fs::read(folder.path().join("a.png")).unwrap();
    let other = Particles::from_positions(vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z]);
    particles::write(&other, &folder.path().join("other.ply")).unwrap();
    let other = fs::read(folder.path().join("other.ply")).unwrap();
    assert_eq!(pipe(folder.path(), &args, &other).0, 0);
    assert!(fs::read(folder.path().join("a.png")).unwrap() != drawn);
}

/// `info`, `scene` and `convert` read standard input; a scene of it names no file and can be drawn with one.
#[test]
fn info_scene_and_convert_from_a_pipe() {
    let folder = folder();
    let bytes = cube(folder.path(), "cube.ply");
    let (code, stdout, stderr) = pipe(folder.path(), &["info", "-"], &bytes);
    let stdout = String::from_utf8(stdout).unwrap();
    assert_eq!(code, 0, "{stderr}");
    assert_contains(&stdout, &["standard input: 1 frame,", "stdin.ply", "125 particles"]);

    let (code, stdout, stderr) = pipe(folder.path(), &["convert", "-", "out.npz"], &bytes);
    assert_eq!((code, stdout.len()), (0, 0), "{stderr}");
    let read = |name: &str| particles::read(&folder.path().join(name)).expect("particles");
    assert_eq!(read("out.npz"), read("cube.ply"));

    let (code, stdout, stderr) = pipe(folder.path(), &["scene", "-"], &bytes);
    assert_eq!(code, 0, "{stderr}");
    let scene = String::from_utf8(stdout).unwrap();
    assert!(!scene.contains("stdin"), "{scene}");
    fs::write(folder.path().join("scene.toml"), &scene).unwrap();
    let again = pipe(folder.path(), &["scene", "-", "--scene", "scene.toml"], &bytes);
    assert_eq!((again.0, String::from_utf8(again.1).unwrap()), (0, scene), "{}", again.2);
}

/// Inputs and outputs that cannot be piped are refused before anything is drawn, by one line that tells the way out.
#[test]
fn pipes_have_limits() {
    let folder = folder();
    let bytes = cube(folder.path(), "cube.npz");
    let bgeo = cube(folder.path(), "cube.bhclassic");
    let mut mib = vec![0; 2 << 20];
    mib[..4].copy_from_slice(b"PK\x03\x04");
    let foreign: &[&str] = &["standard input: ", "to a file, whose name tells"];
    for (args, input, code, parts) in [
        (&["info", "-"][..], &bgeo[..], 3, foreign),
        (&["info", "-"], b"", 3, &["standard input: it is empty"]),
        (&["info", "-"], &bytes[..300], 4, &["stdin.npz", "damaged"]),
        (
            &["info", "-", "--max-unpacked", "1"],
            &mib,
            4,
            &["standard input", "1048576 bytes", "--max-unpacked"],
        ),
        (&["render", "-q", "-", "-o", "-", "--claim"], &bytes, 2, &["-o -: --claim", "write .png"]),
        (
            &["render", "-q", "-", "-o", "-", "--turntable", "1"],
            &bytes,
            2,
            &["-o -: one picture, not 30"],
        ),
    ] {
        let (found, stdout, stderr) = pipe(folder.path(), args, input);
        assert_eq!(
            (found, stdout.len(), stderr.lines().count()),
            (code, 0, 1),
            "{args:?}: {stderr}"
        );
        assert_contains(&stderr, parts);
    }
}
