//! `limpid render A B --beside`, and what is drawn over pictures on request.

use std::fs;
use std::path::Path;

use image::{GenericImageView as _, RgbImage};
use tempfile::TempDir;

use super::{adapter, assert_contains, fail, folder, open, run, succeed, write_water};

/// Sequences of blocks of water: `long` of three frames, `short` of two.
fn sequences() -> TempDir {
    let folder = folder();
    for (name, frames) in [("long", 3), ("short", 2)] {
        fs::create_dir(folder.path().join(name)).unwrap();
        for frame in 1..=frames {
            write_water(&folder.path().join(format!("{name}/w_{frame}.xyz")), 0.02 * frame as f32);
        }
    }
    folder
}

/// The parts of a picture of two inputs that show the water.
fn halves(path: &Path) -> (RgbImage, RgbImage) {
    let picture = open(path);
    let wide = (picture.width() - 2) / 2;
    let part = |left| picture.view(left, 0, wide, picture.height() - 12).to_image();
    (part(0), part(wide + 2))
}

/// Inputs stand beside each other with one camera and one scale: the same twice is the same picture twice, a smaller one
/// changes the view of the other, and each has its name.
#[test]
fn inputs_share_a_camera() {
    if !adapter() {
        return;
    }
    let folder = sequences();
    let at = |name: &str| folder.path().join(name);
    let draw = |inputs: [&str; 2], output: &str| {
        let options = ["render", "--quiet", "--beside", "--size=130x72", "-o", output];
        succeed(folder.path(), &[&options[..], &inputs].concat());
    };
    draw(["long/w_1.xyz", "long/w_1.xyz"], "same.png");
    let picture = open(&at("same.png"));
    assert_eq!(picture.dimensions(), (130, 72));
    let (left, right) = halves(&at("same.png"));
    assert_eq!(left, right);
    assert!(picture.view(0, 60, 64, 12).pixels().any(|(_, _, p)| p.0 == [255; 3]), "a name");
    let mut far = String::from("x,y,z\n");
    for i in 0..1000 {
        let x = [i % 10, i / 10 % 10, i / 100].map(|n| 0.05 * f64::from(n));
        far += &format!("{},{},{}\n", x[0] + 3.0, x[1], x[2]);
    }
    fs::write(at("far.csv"), far).unwrap();
    draw(["long/w_1.xyz", "far.csv"], "far.png");
    let (left, right) = halves(&at("far.png"));
    assert_ne!(left, halves(&at("same.png")).0, "the camera shows both");
    assert_ne!(left, right);
}

/// One clock: the shorter sequence holds its last frame, which is said; where rates are known and differ, pictures follow
/// time.
#[test]
fn inputs_share_a_clock() {
    if !adapter() {
        return;
    }
    let folder = sequences();
    let at = |name: &str| folder.path().join(name);
    let beside = |arguments: &[&str]| {
        let options = ["render", "--beside", "--size=98x60"];
        let outcome = run(folder.path(), &[&options[..], arguments].concat());
        assert_eq!(outcome.code, 0, "{}", outcome.stderr);
        outcome.stderr
    };
    let told = beside(&["long", "short", "-o", "p_#.png"]);
    assert_contains(
        &told,
        &["short: ends before the others: its frame 2 is held", "wrote 3 pictures"],
    );
    assert!(!told.contains("long: ends"), "{told}");
    let [second, third] = ["p_2.png", "p_3.png"].map(|name| halves(&at(name)));
    assert_ne!(second.0, third.0);
    assert_eq!(second.1, third.1);
    // Twice as many frames a second: three frames last as long as one and a half of the other.
    let scene =
        |source: &str, fps: f64| format!("[particles]\nsource = \"{source}\"\nfps = {fps}\n");
    fs::write(at("fast.toml"), scene("long", 20.0)).unwrap();
    fs::write(at("slow.toml"), scene("short", 10.0)).unwrap();
    let told = beside(&["fast.toml", "slow.toml", "-o", "t_#.png"]);
    assert_contains(&told, &["wrote 3 pictures, t_1.png to t_3.png"]);
    assert!(!told.contains("held"), "{told}");
    let [first, second] = ["t_1.png", "t_2.png"].map(|name| halves(&at(name)));
    assert_ne!(first.1, second.1, "between two frames, particles are interpolated");
    // As a film, and a single picture.
    beside(&["long", "short", "-o", "film.apng"]);
    assert!(at("film.apng").exists());
    beside(&["long", "short", "--at=2", "-o", "at.png"]);
    assert_eq!(halves(&at("at.png")), halves(&at("p_2.png")));
}

/// Errors name the input, and options for one input alone are refused.
#[test]
fn errors_name_the_input() {
    let folder = sequences();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("one.csv"), "x,y,z\n0,0,0\n").unwrap();
    for (arguments, code, parts) in [
        (&["long", "absent.csv"][..], 4, &["absent.csv"][..]),
        (&["long", "one.csv"], 2, &["one.csv", "radius"]),
        (&["long"], 2, &["--beside takes 2 to 6 inputs, not 1"]),
        (&["long", "short", "--claim"], 2, &["--beside", "--claim"]),
        (&["long", "short", "-o", "a_#.exr"], 2, &["names are written over the picture"]),
        (&["long", "short", "--size=20x20"], 2, &["no room for 2 pictures"]),
    ] {
        let line = fail(folder.path(), code, &[&["render", "--beside"][..], arguments].concat());
        assert_contains(&line, parts);
    }
}

/// A scale bar and axes are drawn over the lower corners, the rest of the picture is as without them; in an EXR they are
/// not, which is said.
#[test]
fn scale_bar_and_axes() {
    if !adapter() {
        return;
    }
    let folder = sequences();
    let at = |name: &str| folder.path().join(name);
    let draw = |arguments: &[&str]| {
        let options = ["render", "short/w_1.xyz", "--size=320x240"];
        let outcome = run(folder.path(), &[&options[..], arguments].concat());
        assert_eq!(outcome.code, 0, "{}", outcome.stderr);
        outcome.stderr
    };
    draw(&["-o", "plain.png"]);
    draw(&["--scale-bar", "--axes", "-o", "both.png"]);
    draw(&["--axes", "-o", "axes.png"]);
    let [plain, both, axes] = ["plain.png", "both.png", "axes.png"].map(|name| open(&at(name)));
    let differ = |a: &RgbImage, b: &RgbImage, left: u32, right: u32, top: u32, bottom: u32| {
        let of = |(x, y): (u32, u32)| a.get_pixel(x, y) != b.get_pixel(x, y);
        (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y))).filter(|&at| of(at)).count()
    };
    assert_eq!(differ(&plain, &both, 0, 320, 0, 170), 0);
    assert!(differ(&plain, &both, 0, 100, 210, 240) > 100, "the bar");
    assert!(differ(&plain, &both, 250, 320, 170, 240) > 100, "the axes");
    assert_eq!(differ(&plain, &axes, 0, 250, 0, 240), 0);
    let told = draw(&["--scale-bar", "-o", "a.exr"]);
    assert_contains(&told, &["--scale-bar and --axes are not drawn in an .exr"]);
}
