//! Liquid at walls, from either side.

#[path = "../../../tests/support/frames.rs"]
mod frames;

use std::path::Path;

use frames::{Stage, stage};
use glam::{DVec3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::liquid::classify::Splats;
use limpid::scene::{Scene, Shape, Solid, Surface};
use limpid_io::input::Input;
use limpid_io::project::Project;

const SIZE: UVec2 = UVec2::new(120, 90);

/// A block of liquid against the plane x = 0 at its left, and a view from the left or the right.
const BLOCK: &str = "
[recipe]
kind = \"slab\"
min = [0.0, 0.0, -0.4]
max = [0.7, 0.5, 0.4]
count = 3000
[environment]
gradient = { zenith = [0.2, 0.4, 0.8], horizon = [0.8, 0.9, 0.9], nadir = [0.3, 0.3, 0.3] }
";

fn block(wall: Shape) -> (Scene, Splats) {
    let mut project = Project::parse(BLOCK, "block", Path::new("")).unwrap();
    let (even, odd) = (Vec3::new(0.85, 0.8, 0.7), Vec3::new(0.15, 0.2, 0.3));
    let surface = Surface::Checker { tile: 0.11, even, odd };
    project.scene.solids = vec![Solid { shape: wall, surface, lit: false }];
    let input = Input::from_project(project, "block").unwrap();
    let (input, project) = input.resolve().unwrap();
    let splats = input.load(&input.sequence.frames[0], &project.scene).unwrap().splats;
    (project.scene, splats)
}

fn plane(normal: Vec3, half_extent: f32) -> Shape {
    Shape::Plane { origin: DVec3::new(0.0, 0.25, 0.0), normal, half_extent }
}

fn from(eye: DVec3) -> Camera {
    let target = DVec3::new(0.0, 0.25, 0.0);
    Camera { eye, target, up: Vec3::Y, fov_y: 40.0, near: None }
}

/// Pixels that the liquid changes.
fn changed(stage: &mut Stage, scene: &Scene, camera: &Camera, splats: &Splats) -> usize {
    let without = Splats { aggregates: Vec::new(), splashes: Vec::new(), ..splats.clone() };
    let [with, without] =
        [splats, &without].map(|splats| stage.shoot(scene, camera, splats, SIZE).picture);
    with.pixels().zip(without.pixels()).filter(|(a, b)| a != b).count()
}

/// Protects walls: from behind one, whichever way its normal points, nothing of the liquid is seen,
/// straight on or slanting; the wall is drawn as well as without the liquid. Droplets reach through
/// walls as bodies do.
#[test]
fn walls_hide_what_is_behind_them() {
    let Some(mut stage) = stage() else { return };
    let thin = Shape::Box { min: DVec3::new(-0.01, -0.5, -1.2), max: DVec3::new(0.0, 1.0, 1.2) };
    let walls = [
        plane(Vec3::X, f32::INFINITY),
        plane(Vec3::NEG_X, f32::INFINITY),
        plane(Vec3::X, 1.0),
        thin,
    ];
    for wall in walls {
        let (scene, splats) = block(wall);
        let spray = Splats {
            splashes: splats.aggregates.clone(),
            aggregates: Vec::new(),
            ..splats.clone()
        };
        for eye in [DVec3::new(-1.5, 0.3, 0.1), DVec3::new(-0.5, 0.7, 1.2)] {
            for splats in [&splats, &spray] {
                let seen = changed(&mut stage, &scene, &from(eye), splats);
                assert_eq!(seen, 0, "{wall:?} from {eye}");
            }
        }
        let seen = changed(&mut stage, &scene, &from(DVec3::new(1.5, 0.7, 0.6)), &splats);
        assert!(seen > 1000, "{wall:?}: the liquid itself, {seen} pixels");
    }
}

/// Protects planes' orientation: a wall is wet, and looks the same, whichever way its normal points.
#[test]
fn planes_are_wet_from_either_side() {
    let Some(mut stage) = stage() else { return };
    let camera = from(DVec3::new(1.5, 0.7, 0.6));
    let [a, b] = [Vec3::X, Vec3::NEG_X].map(|normal| {
        let (scene, splats) = block(plane(normal, f32::INFINITY));
        let shot = stage.shoot(&scene, &camera, &splats, SIZE);
        (splats, shot.picture)
    });
    assert_eq!(a.0.aggregates.len(), b.0.aggregates.len());
    let places = |splats: &Splats| splats.aggregates.iter().map(|s| s.centre).collect::<Vec<_>>();
    assert_eq!(places(&a.0), places(&b.0));
    assert!(a.0.aggregates.len() > 3100, "some of 3000 have a copy: {}", a.0.aggregates.len());
    assert_eq!(a.1, b.1);
}

/// Particles that leak a little through the floor they lie on belong to the others: the view from
/// above stays as it is.
#[test]
fn leaks_stay_where_they_are() {
    let Some(mut stage) = stage() else { return };
    let (scene, mut splats) = block(plane(Vec3::X, f32::INFINITY));
    let lowest = |splats: &mut Splats, x: f32| {
        let nearest =
            splats.aggregates.iter_mut().min_by(|a, b| a.centre[0].total_cmp(&b.centre[0]));
        nearest.unwrap().centre[0] = x;
    };
    // Copies on the wall are none of its particles.
    let originals = splats.aggregates.iter().filter(|s| s.centre[0] > 1e-6).copied().collect();
    splats.aggregates = originals;
    let radius = splats.radius;
    let camera = from(DVec3::new(1.5, 0.7, 0.6));
    lowest(&mut splats, 0.0);
    let before = stage.shoot(&scene, &camera, &splats, SIZE).picture;
    lowest(&mut splats, -1e-3 * radius);
    let after = stage.shoot(&scene, &camera, &splats, SIZE).picture;
    let off = before
        .pixels()
        .zip(after.pixels())
        .filter(|(a, b)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 8));
    assert!(off.count() < 20, "it moved by a thousandth of its radius");
}
