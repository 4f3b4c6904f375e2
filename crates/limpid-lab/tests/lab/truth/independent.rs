//! The whole pipeline against pictures that independent software made.

use std::path::Path;

use image::{Rgb, RgbImage};
use limpid::glam::UVec2;
use limpid_io::input::Input;
use limpid_lab::compare::{compare, load_picture};
use limpid_lab::reference::mesh::{Mesh, Reconstruction};
use limpid_lab::reference::trace::{MAX_DEPTH, trace};

use crate::support::references::references;

const SCENES: [&str; 5] = [
    "double_dam_break_front",
    "double_dam_break_low",
    "double_dam_break_top",
    "double_dam_break_columns",
    "knot",
];

/// Halves width and height: averages four pixels in linear light.
fn halved(picture: &RgbImage) -> RgbImage {
    RgbImage::from_fn(picture.width() / 2, picture.height() / 2, |x, y| {
        let four = [(0, 0), (1, 0), (0, 1), (1, 1)]
            .map(|(dx, dy)| picture.get_pixel(2 * x + dx, 2 * y + dy).0);
        Rgb([0, 1, 2].map(|c| {
            let linear = four.map(|p| {
                let v = f64::from(p[c]) / 255.0;
                if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
            });
            let mean = linear.iter().sum::<f64>() / 4.0;
            let encoded = if mean <= 0.003_130_8 {
                12.92 * mean
            } else {
                1.055 * mean.powf(1.0 / 2.4) - 0.055
            };
            (255.0 * encoded).round() as u8
        }))
    })
}

/// Mean FLIP between the pictures that splashsurf and Mitsuba made of the reference scenes and those of the whole
/// pipeline, from particles to pictures, at half their size for speed.
fn mean_flip_of(references: &Path, adjust: impl Fn(&mut Reconstruction)) -> f64 {
    let flips = SCENES.map(|name| {
        let path = references.join("scenes").join(name).with_extension("toml");
        let Input { loader: input, project, .. } =
            Input::open(path.to_str().expect("the path is UTF-8")).unwrap();
        let frame = match input.frame {
            Some(number) => input.sequence.frame(number).expect("the scene's frame"),
            None => &input.sequence.frames[0],
        };
        let particles = input.particles(frame).unwrap();
        let project = project.expect("a scene");
        let radius = project.source.files()[0].radius.expect("a radius");
        let scene = project.scene;
        let mut how = Reconstruction::among(&scene.solids);
        adjust(&mut how);
        let mesh = Mesh::reconstruct(&particles.positions, radius, &how).unwrap();

        let path = references.join("pictures").join(name).with_extension("png");
        let reference = halved(&load_picture(&path).unwrap());
        let size = UVec2::from(reference.dimensions());
        let camera = project.camera.expect("a camera");
        let picture = trace(&mesh, &scene, &camera, size, 4, MAX_DEPTH).to_srgb();
        let flip = compare(&reference, &picture).unwrap().0.mean_flip;
        println!("{name:<26} mean FLIP {flip:.4}");
        flip
    });
    let mean = flips.iter().sum::<f64>() / SCENES.len() as f64;
    println!("{:<26} mean FLIP {mean:.4}", "all");
    mean
}

/// The whole pipeline agrees with independent software. The mean FLIP is 0.0216.
#[test]
fn pictures_match_independent_software() {
    let Some(references) = references() else { return };
    let mean = mean_flip_of(&references, |_| ());
    assert!(mean <= 0.025, "mean FLIP {mean:.4}, at most 0.025 expected");
}

/// How far the truth depends on its mesher: other sane parameters change the pictures by as much as limpid's error. A
/// smaller error than this fits the mesher, not the liquid.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn other_meshes_of_the_same_particles_differ() {
    let Some(references) = references() else { return };
    let same = mean_flip_of(&references, |_| ());
    for (name, adjust) in [
        (
            "smoothed everywhere alike",
            (|how| how.spares_the_sparse = false) as fn(&mut Reconstruction),
        ),
        ("10 steps of smoothing instead of 25", |how| how.smoothing_iterations = 10),
        ("level 0.55, kernel 5 % smaller", |how| {
            (how.threshold, how.smoothing_length) = (0.55, 1.9);
        }),
    ] {
        println!("{name}:");
        let other = mean_flip_of(&references, adjust);
        assert!(other > 1.3 * same, "{name}: {other}, and {same} without the change");
    }
}
