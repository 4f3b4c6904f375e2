//! The choices of `limpid render --max-error` and `--budget`, `crates/limpid-io/src/quality.toml`, against measurements.

use glam::UVec2;
use image::RgbImage;
use limpid::renderer::Renderer;
use limpid_io::input::{FrameTime, Input};
use limpid_io::quality::{Choice, Curve};
use limpid_lab::compare::{PIXELS_PER_DEGREE, flip};
use limpid_lab::reference::mesh::{Mesh, Reconstruction};
use limpid_lab::reference::trace::{MAX_DEPTH, trace_lit};
use limpid_lab::report::curve::hit_errors;

use crate::support::frames::gpu;

/// The shipped curve is up to date: two of its errors, measured again, match the file to 15 % and
/// 0.02 pixels. As a check of the comparison, they do not match each other.
#[test]
fn shipped_errors_match_measurements() {
    let Some(gpu) = gpu() else { return };
    let curve = Curve::shipped();
    let of = |solver: &str| {
        let named = |choice: &&Choice| choice.set[0] == format!("refract.solver={solver}");
        curve.intersectors.iter().find(named).expect("a row").clone()
    };
    let rows = [of("guarded"), of("plane")];
    let sets = rows.each_ref().map(|row| row.set.clone());
    let mut renderer = Renderer::new(&gpu);
    let measured = hit_errors(&gpu, &mut renderer, &sets).expect("measured");
    let close = |got: f64, row: &Choice| (got - row.error_px).abs() <= 0.15 * row.error_px + 0.02;
    for (row, &got) in rows.iter().zip(&measured) {
        println!("{:?}: {got}, {} in the file", row.set, row.error_px);
        assert!(
            close(got, row),
            "{:?}: {got}, not {}: limpid report --curve",
            row.set,
            row.error_px
        );
    }
    assert!(!close(measured[0], &rows[1]));
}

/// Pictures of the reference sequence, as `limpid render` has drawn them into folders with the scene's view,
/// against path-traced meshes of its particles: prints the mean FLIP of each folder. As a check of the
/// comparison, pictures of another frame are further from the truth.
#[test]
#[ignore = "needs the pictures of a run: LIMPID_PICTURES=FOLDER,…, of LIMPID_REFERENCE's double_dam_break_front"]
fn sequences_against_truths() {
    let (Ok(folders), Ok(reference)) =
        (std::env::var("LIMPID_PICTURES"), std::env::var("LIMPID_REFERENCE"))
    else {
        println!("skipped: LIMPID_PICTURES or LIMPID_REFERENCE is not set");
        return;
    };
    let folders: Vec<_> = folders.split(',').collect();
    let path = format!("{reference}/scenes/double_dam_break_front.toml");
    let (input, project) = Input::open(&path).expect("the scene").resolve().expect("particles");
    let scene = &project.scene;
    let frames: Vec<i64> = input.sequence.frames.iter().map(|frame| frame.number).collect();
    let picture = |folder: &str, number: i64| -> RgbImage {
        let path = format!("{folder}/frame_{number:04}.png");
        image::open(&path).unwrap_or_else(|e| panic!("{path}: {e}")).into_rgb8()
    };
    let mut sums = vec![0.0; folders.len()];
    let mut sum_of_others = 0.0;
    for (i, &number) in frames.iter().enumerate() {
        let at = FrameTime::at(number);
        let particles = input.particles(at).expect("particles");
        let loaded = input.prepare(at, &particles, scene).expect("splats");
        let how = Reconstruction::among(&scene.solids);
        let (places, radius) = (&particles.positions, loaded.splats.radius);
        let mesh = Mesh::reconstruct(places, radius, &how).expect("a mesh");
        let camera = project.camera_for(loaded.bulk.bounds);
        let first = picture(folders[0], number);
        let size = UVec2::new(first.width(), first.height());
        let truth = trace_lit(&mesh, scene, &camera, size, 4, MAX_DEPTH, &[]).to_srgb();
        let error = |picture: &RgbImage| {
            flip(&truth, picture, PIXELS_PER_DEGREE).expect("the same size").mean()
        };
        for (sum, folder) in sums.iter_mut().zip(&folders) {
            *sum += error(&picture(folder, number));
        }
        sum_of_others += error(&picture(folders[0], frames[(i + 10) % frames.len()]));
    }
    for (sum, folder) in sums.iter().zip(&folders) {
        println!(
            "{folder}: mean FLIP {:.4} of {} pictures",
            sum / frames.len() as f64,
            frames.len()
        );
    }
    assert!(sum_of_others > 1.2 * sums[0], "{sum_of_others} and {}", sums[0]);
}
