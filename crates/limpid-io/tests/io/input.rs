//! The radius and the view of a sequence: one of each for all frames, whatever its first frames contain
//! and however its frames are distributed.

mod axes;
mod bulk;
mod sequences;

use std::sync::Arc;

use glam::Vec3;
use limpid::environment::Environment;
use limpid::liquid::{Particles, Up};
use limpid::look::Look;
use limpid::scene::{Light, Scene};
use limpid_io::adjustments::{Adjustments, Sun};
use limpid_io::input::{FrameTime, Input, Loader};
use limpid_io::open::Request;
use tempfile::TempDir;

use crate::support::Random;

/// A folder of `.xyz` frames, numbered from 0.
fn frames(contents: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (number, text) in contents.iter().enumerate() {
        std::fs::write(folder.path().join(format!("w_{number}.xyz")), text).unwrap();
    }
    folder
}

fn open(folder: &TempDir) -> Input {
    Input::open(folder.path().join("w_{}.xyz").to_str().unwrap()).unwrap()
}

/// Text of a body of 20 × 8 × 12 particles on the level z = 0, which ends at a height; z is up.
fn z_up(height: impl Fn(f32, f32) -> f32) -> String {
    let all = (0..20 * 8 * 12).map(|i| [i % 20, i / 20 % 8, i / 160].map(|i| i as f32 + 0.5));
    let within = all.filter(|&[x, y, z]| z < height(x, y));
    within.map(|[x, y, z]| format!("{x} {y} {z}\n")).collect()
}

/// Another sky is that of its look, with the scene's own sun in it; light and ground stay.
#[test]
fn sky_is_replaced_alone() {
    let folder = frames(&[&z_up(|_, _| 9.0)]);
    let name = folder.path().join("w_0.xyz");
    let scene = |adjustments: Adjustments| {
        let request = Request { input: Some(name.clone()), adjustments, ..Request::default() };
        request.open().unwrap().project.scene
    };
    let (studio, night) = (Some(Look::Studio), Some(Look::Night));
    let sun = Some(Sun::At { azimuth: 90.0, elevation: 30.0 });
    let changed = scene(Adjustments { look: studio, sky: night, sun, ..Adjustments::default() });
    let of_studio = scene(Adjustments { look: studio, sun, ..Adjustments::default() });
    let of_night = scene(Adjustments { look: night, sun, ..Adjustments::default() });
    assert_eq!(changed.environment, of_night.environment);
    assert_eq!(changed, Scene { environment: of_night.environment, ..of_studio });

    // A sun of the scene's own.
    let chart =
        scene(Adjustments { look: studio, sky: Some(Look::Chart), ..Adjustments::default() });
    assert!(matches!(chart.environment, Environment::Gradient { .. }));
    let turned = scene(Adjustments { sky: night, ..Adjustments::default() });
    let Environment::Sky { glows, .. } = turned.environment else { panic!("no sky") };
    let Light::Sun { direction, .. } = turned.lights[0] else { panic!("no sun") };
    assert_eq!(glows[0].direction, -direction);
}

/// Particles of the caller are drawn as those of a file: with the same radius, axis, scene and splats.
#[test]
fn given_particles_are_those_of_a_file() {
    let mut random = Random(5);
    for up in [Up::Y, Up::Z] {
        // A wedge on a level floor, so that the axis can be guessed.
        let cells = (0..24 * 24 * 12).map(|i| [i % 24, i / 24 % 24, i / 576]);
        let wedge = cells.filter(|[x, _, z]| 2 * z <= *x);
        let grid = wedge.map(|cell| cell.map(|k| 0.1 * k as f32));
        let jitter = |x: f32, random: &mut Random| x + 0.01 * random.unit() as f32;
        let places = grid.map(|[x, y, z]| {
            let [x, y, z] = [x, y, z].map(|x| jitter(x, &mut random));
            if up == Up::Z { Vec3::new(x, y, z) } else { Vec3::new(x, z, y) }
        });
        let particles = Particles::from_positions(places.collect());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pool.npz");
        limpid_io::particles::write(&particles, &path).unwrap();
        let request = Request::default();
        let file = request.open_from(Input::open(path.to_str().unwrap()).unwrap()).unwrap();
        let given = Input::from_particles(Arc::new(particles), "positions");
        let given = request.open_from(given).unwrap();
        assert_eq!(given.loader.is_turned(), up == Up::Z);
        assert_eq!(given.loader.is_turned(), file.loader.is_turned());
        assert_eq!(given.project.camera, file.project.camera);
        assert_eq!(given.project.scene, file.project.scene);
        let load = |input: &Loader| input.load(FrameTime::at(0), &file.project.scene).unwrap();
        let (a, b) = (load(&given.loader), load(&file.loader));
        assert_eq!((&a.splats, a.particles, a.bounds), (&b.splats, b.particles, b.bounds));
    }
}

/// Particles that need not be turned are shared, not copied.
#[test]
fn given_particles_are_shared() {
    let particles = Arc::new(Particles::from_positions(vec![Vec3::ZERO, Vec3::X]));
    let input = Input::from_particles(particles.clone(), "positions");
    let opened = Request { radius: Some(0.5), ..Request::default() }.open_from(input).unwrap();
    let before = Arc::strong_count(&particles);
    assert!(before > 1);
    opened.loader.load(FrameTime::at(7), &opened.project.scene).unwrap();
    assert_eq!(Arc::strong_count(&particles), before);
    drop(opened);
    assert_eq!(Arc::strong_count(&particles), 1);
}
