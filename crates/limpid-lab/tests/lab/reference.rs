//! Rendered pictures against reference pictures.
//!
//! Measures the main quality figure of limpid: the mean FLIP to pictures of the same particles
//! whose surface was reconstructed and path-traced, in the folder that `LIMPID_REFERENCE` names.

use std::path::Path;

use glam::UVec2;
use glam::dcamera::rh::proj::directx::perspective_infinite_reverse;
use limpid::camera::{Projection, View};
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::host::Host;
use limpid::offscreen::Picture;
use limpid::renderer::Renderer;
use limpid::scene::Scene;
use limpid::wgpu::PollType;
use limpid_io::input::Input;
use limpid_lab::compare::{compare, load_picture};

use crate::support::hosts::host_of;
use crate::support::references::references;

const SCENES: [&str; 5] = [
    "double_dam_break_front",
    "double_dam_break_low",
    "double_dam_break_top",
    "double_dam_break_columns",
    "knot",
];

/// Upper bounds on the mean FLIP of all five together and of each one.
const MAX_MEAN: f64 = 0.065;
const MAX_ONE: f64 = 0.12;

/// Scenes with meshes, and the upper bounds on their mean FLIP.
const MESH_SCENES: [(&str, f64); 2] = [("obstacle_front", 0.068), ("obstacle_columns", 0.045)];

fn input(references: &Path, folder: &str, name: &str) -> Input {
    let path = references.join(folder).join(name).with_extension("toml");
    Input::open(path.to_str().expect("the path is UTF-8")).unwrap_or_else(|error| panic!("{error}"))
}

/// The scenes load unmodified and name an existing frame.
#[test]
fn scenes_load_unchanged() {
    let Some(references) = references() else { return };
    for name in SCENES {
        let Input { loader: input, project, .. } = input(&references, "scenes", name);
        let project = project.expect("a scene");
        assert!(project.camera.is_some(), "{name} has a camera");
        assert_eq!(project.scene.solids.len(), 1, "{name} has a floor");
        let frame = match input.frame {
            Some(number) => input.sequence.frame(number),
            None => input.sequence.frames.first(),
        };
        let particles = input.particles(frame.expect("the scene's frame")).unwrap();
        assert!(particles.len() > 1000, "{name}: {} particles", particles.len());
    }
}

/// Size of pictures that are compared with each other.
const SIZE: UVec2 = UVec2::new(1024, 768);

/// A device, unless there is none and none is required.
fn device() -> Option<Gpu> {
    match Gpu::headless() {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            let set = |name: &str| std::env::var(name).is_ok_and(|v| v == "1" || v == "true");
            let required = set("CI") || set("LIMPID_REQUIRE_GPU");
            assert!(!required, "this test must not be skipped here: {error}");
            eprintln!("skipped: {error}");
            None
        }
    }
}

/// Renders a scene with four samples per pixel at the size of its reference picture, and returns the mean FLIP.
fn mean_flip(gpu: &Gpu, renderer: &mut Renderer, input: Input, path: &Path) -> f64 {
    let (input, mut project) = input.resolve().unwrap();
    project.scene.settings.refract.samples = 4;
    let frame = match input.frame {
        Some(number) => input.sequence.frame(number).expect("the scene's frame"),
        None => &input.sequence.frames[0],
    };
    let loaded = input.load(frame, &project.scene).unwrap();
    let reference = load_picture(path).unwrap_or_else(|error| panic!("{error}"));
    let size = UVec2::from(reference.dimensions());
    let picture = Picture::new(gpu, size).unwrap();
    let camera = project.camera_for(loaded.bulk.bounds);
    let input = FrameInput::new(&project.scene, &camera, &loaded.splats, size);
    renderer.render(input, &picture).unwrap();
    let picture = image::DynamicImage::ImageRgba8(picture.read(gpu).unwrap()).into_rgb8();
    let (result, _) = compare(&reference, &picture).unwrap();
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let psnr = result.psnr_db.expect("not the reference itself");
    println!(
        "{name:<26} {:>9.4} {:>9.4} {:>8.4} {psnr:>9.2}",
        result.mean_flip, result.p99_flip, result.rmse
    );
    result.mean_flip
}

const COLUMNS: &str = "scene                      mean FLIP  99th pct     RMSE  PSNR, dB";

#[test]
fn mean_flip_to_the_references() {
    let Some(references) = references() else { return };
    let Some(gpu) = device() else { return };
    let mut renderer = Renderer::new(&gpu);
    println!("{COLUMNS}");
    let flips = SCENES.map(|name| {
        let path = references.join("pictures").join(name).with_extension("png");
        (name, mean_flip(&gpu, &mut renderer, input(&references, "scenes", name), &path))
    });
    let mean = flips.iter().map(|(_, flip)| flip).sum::<f64>() / flips.len() as f64;
    println!("{:<26} {mean:>9.4}", "mean");
    for (name, flip) in flips {
        assert!(flip <= MAX_ONE, "{name}: mean FLIP {flip:.4}, at most {MAX_ONE} expected");
    }
    assert!(mean <= MAX_MEAN, "mean FLIP {mean:.4}, at most {MAX_MEAN} expected");
}

/// Scenes with textured meshes in the liquid load unchanged and match their pictures.
#[test]
fn meshes_match_their_references() {
    let Some(references) = references() else { return };
    let Some(gpu) = device() else { return };
    let mut renderer = Renderer::new(&gpu);
    println!("{COLUMNS}");
    for (name, most) in MESH_SCENES {
        let path = references.join("mesh_pictures").join(name).with_extension("png");
        let flip = mean_flip(&gpu, &mut renderer, input(&references, "mesh_scenes", name), &path);
        assert!(flip <= most, "{name}: mean FLIP {flip:.4}, at most {most} expected");
    }
}

/// Scenes look alike whether their solids are known, or only what a host has drawn of them, as far as nothing that
/// it does not show is seen: if limpid is told of the solids for that. Reports both, and the share of rays that
/// the host's picture did not answer.
#[test]
fn hosts_refract_as_known_solids_do() {
    /// Bounds on the mean FLIP with solids that are told of, and without: there the environment takes the place of
    /// floors and obstacles that are out of the picture or hidden in it.
    const MAX_FLIPS: [f64; 2] = [0.01, 0.03];
    let Some(references) = references() else { return };
    let Some(gpu) = device() else { return };
    let mut renderer = Renderer::new(&gpu);
    println!("scene                       told of not told of  fallbacks");
    let scenes = SCENES.map(|name| ("scenes", name)).into_iter();
    let scenes = scenes.chain(MESH_SCENES.map(|(name, _)| ("mesh_scenes", name)));
    // The first two in every run of the tests.
    let count = if std::env::var_os("LIMPID_HOSTS").is_some() { usize::MAX } else { 2 };
    for (folder, name) in scenes.take(count) {
        let (input, mut project) = input(&references, folder, name).resolve().unwrap();
        project.scene.settings.refract.samples = 4;
        let number = input.frame.unwrap_or_else(|| input.sequence.frames[0].number);
        let frame = input.sequence.frame(number).expect("the scene's frame");
        let loaded = input.load(frame, &project.scene).unwrap();
        let view = View::from(&project.camera_for(loaded.bulk.bounds));
        let Projection::Perspective { fov_y } = view.projection else {
            panic!("{name} has a camera of a field of view");
        };
        let (fov_y, aspect) = (f64::from(fov_y).to_radians(), SIZE.x as f64 / SIZE.y as f64);
        let clip_from_view = perspective_infinite_reverse(fov_y, aspect, 0.01);
        let told = &project.scene;
        let draw = |scene: &Scene, host: Option<&Host>, renderer: &mut Renderer| {
            let picture = Picture::new(&gpu, SIZE).unwrap();
            let input = FrameInput::new(scene, view, &loaded.splats, SIZE);
            renderer.render(FrameInput { host, ..input }, &picture).unwrap();
            image::DynamicImage::ImageRgba8(picture.read(&gpu).unwrap()).into_rgb8()
        };
        let known = draw(told, None, &mut renderer);
        let host = host_of(&gpu, &mut renderer, told, view, SIZE, clip_from_view);
        let not_told = &Scene { solids: Vec::new(), ..told.clone() };
        let flips = [told, not_told].map(|scene| {
            let shown = draw(scene, Some(&host), &mut renderer);
            compare(&known, &shown).unwrap().0.mean_flip
        });
        let rays = loop {
            gpu.device.poll(PollType::wait_indefinitely()).unwrap();
            if let Some(rays) = renderer.take_host_rays() {
                break rays;
            }
        };
        let [with, without] = flips;
        println!("{name:<26} {with:>8.4} {without:>11.4} {:>8.1} %", 100.0 * rays.share());
        for (flip, most) in flips.into_iter().zip(MAX_FLIPS) {
            assert!(flip <= most, "{name}: mean FLIP {flip:.4}, at most {most} expected");
        }
    }
}
