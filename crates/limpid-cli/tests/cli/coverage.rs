//! Cut-outs with `--alpha`, and remarks on pictures without any liquid.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use image::{Rgba32FImage, RgbaImage};
use limpid::mesh::linear_from_srgb;

use super::{adapter, assert_contains, fail, folder, open, render, run, succeed};

/// Writes a ball of particles 0.02 m apart, each with these further columns.
fn write_ball(path: &Path, header: &str, columns: &str) {
    let mut text = format!("x,y,z{header}\n");
    for i in 0..1331 {
        let x = [i % 11, i / 11 % 11, i / 121].map(|n: i32| 0.02 * f64::from(n - 5));
        if x.iter().map(|x| x * x).sum::<f64>().sqrt() < 0.1 {
            writeln!(text, "{},{},{}{columns}", x[0], x[1], x[2]).unwrap();
        }
    }
    fs::write(path, text).unwrap();
}

fn rgba(path: &Path) -> RgbaImage {
    image::open(path).unwrap().into_rgba8()
}

const WHITE: &str = "[environment]\nradiance = [1, 1, 1]\n";
const CAMERA: &str = "[camera]\neye = [0, 0.1, 0.5]\ntarget = [0, 0, 0]\nfov_y = 34\n";

/// With several samples a cut-out has partial coverage at its outline, in every format that holds it: colours that are
/// not multiplied by it in PNG and WebP, and multiplied light in EXR. Over white it is the picture that is drawn in a
/// white world, over black that of a black one. One sample covers a pixel or not.
#[test]
fn cut_outs_fit_over_what_is_behind_them() {
    if !adapter() {
        return;
    }
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    let draw = |arguments: &[&str]| {
        render(folder.path(), &[&["ball.csv", "--radius=0.012"][..], arguments].concat());
    };
    write_ball(&at("ball.csv"), "", "");
    fs::write(at("white.toml"), format!("{WHITE}{CAMERA}")).unwrap();
    fs::write(at("black.toml"), format!("{}{CAMERA}", WHITE.replace('1', "0"))).unwrap();
    let cut = ["--scene=white.toml", "--alpha", "--samples=16"];
    for name in ["cut.png", "cut.webp", "cut.exr"] {
        draw(&[&cut[..], &["-o", name]].concat());
    }
    draw(&["--scene=black.toml", "--alpha", "--samples=16", "-o=black.png"]);
    draw(&["--scene=white.toml", "--alpha", "-o=one.png"]);
    let large = ["render", "--quiet", "ball.csv", "--radius=0.012", "--scene=white.toml"];
    succeed(folder.path(), &[&large[..], &["--size=256x192", "-o=large.png"]].concat());
    let (cut, one, large) = (rgba(&at("cut.png")), rgba(&at("one.png")), open(&at("large.png")));
    assert_eq!(cut, rgba(&at("cut.webp")), "WebP is lossless");
    let partial = cut.pixels().filter(|pixel| !matches!(pixel.0[3], 0 | 255)).count();
    assert!(partial > 60, "{partial} pixels are covered in part");
    assert!(one.pixels().all(|pixel| matches!(pixel.0[3], 0 | 255)));
    let alphas = |picture: &RgbaImage| picture.pixels().map(|pixel| pixel.0[3]).collect::<Vec<_>>();
    let black = rgba(&at("black.png"));
    assert_eq!(alphas(&cut), alphas(&black), "coverage does not depend on what is behind");

    let light = |value: u8| linear_from_srgb(f32::from(value) / 255.0);
    let linear: Rgba32FImage = image::open(at("cut.exr")).unwrap().into_rgba32f();
    for (x, y, pixel) in cut.enumerate_pixels() {
        let alpha = f32::from(pixel.0[3]) / 255.0;
        for c in 0..3 {
            let over_white = alpha * light(pixel.0[c]) + 1.0 - alpha;
            let all = (0..16).map(|i| light(large.get_pixel(4 * x + i % 4, 4 * y + i / 4).0[c]));
            let drawn = all.sum::<f32>() / 16.0;
            assert!((over_white - drawn).abs() < 0.02, "({x}, {y}): {over_white}, not {drawn}");
            let multiplied = linear.get_pixel(x, y).0[c];
            assert!(
                (multiplied - alpha * light(pixel.0[c])).abs() < 0.02,
                "({x}, {y}): {multiplied}"
            );
            // A black world has nothing to show.
            assert!(black.get_pixel(x, y).0[c] <= 1, "({x}, {y})");
        }
        assert!((linear.get_pixel(x, y).0[3] - alpha).abs() < 0.01, "({x}, {y})");
    }
    fail(folder.path(), 2, &["render", "ball.csv", "--alpha", "-o", "a.jpg"]);
}

/// A radius that nobody can see is said, whoever gave it, once for all frames, and so is a cut-out without any pixel.
#[test]
fn pictures_without_liquid_are_remarked() {
    if !adapter() {
        return;
    }
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    write_ball(&at("file_1.csv"), ",radius", ",1e-6");
    write_ball(&at("file_2.csv"), ",radius", ",1e-6");
    write_ball(&at("bare.csv"), "", "");
    // Most of them are too small, some are as they should be.
    let mut mixed = fs::read_to_string(at("file_1.csv")).unwrap();
    mixed = mixed.replacen(",1e-6", ",0.01", 20);
    fs::write(at("mixed.csv"), mixed).unwrap();
    fs::write(at("scene.toml"), "[particles]\nradius = 1e-6\n").unwrap();
    let said = |arguments: &[&str]| {
        let size = ["render", "--size=48x36", "-o=out_####.png"];
        let outcome = run(folder.path(), &[&size[..], arguments].concat());
        assert_eq!(outcome.code, 0, "{}", outcome.stderr);
        outcome.stderr
    };
    let invisible = "no liquid is visible: the particles are much farther apart than their radius of 0.000001 m";
    for arguments in [
        &["file_{}.csv"][..],
        &["bare.csv", "--radius=1e-6"],
        &["bare.csv", "--scene=scene.toml"],
        &["file_1.csv", "--alpha", "--floor=none"],
    ] {
        let told = said(arguments);
        assert_eq!(told.matches("no liquid is visible").count(), 1, "{arguments:?}: {told}");
        assert_contains(&told, &[invisible, "--radius"]);
    }
    let told = said(&["mixed.csv"]);
    assert!(!told.contains("no liquid"), "{told}");
    assert_contains(&told, &["much farther apart than their radius of 0.000001 m"]);
    assert!(!said(&["bare.csv"]).contains("farther apart"));
    // A solid in front of all of it covers pixels; without one, nothing does.
    let hidden =
        "floor = \"none\"\n[camera]\neye = [0, 0, 9]\ntarget = [0, 0, 0]\nheight = 0.001\n";
    fs::write(at("hidden.toml"), hidden.replace("[0, 0, 0]", "[0.1, 0, 0]")).unwrap();
    let told = said(&["bare.csv", "--scene=hidden.toml", "--alpha", "--radius=0.009"]);
    assert_contains(&told, &["no liquid is visible"]);
}
