//! Liquid at walls, seen from both sides.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::liquid::classify::Splats;
use limpid::mesh::{Mesh, MeshData, Placement};
use limpid::scene::{Scene, Shape, Solid, Surface};
use limpid_io::input::Input;
use limpid_io::project::Project;

use crate::support::frames::{Harness, harness};

const SIZE: UVec2 = UVec2::new(120, 90);

/// A block of liquid whose left face touches the plane x = 0.
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

/// A mesh of quads, each of four corners counterclockwise from outside, cut into small triangles.
fn mesh(quads: &[[DVec3; 4]]) -> Shape {
    const CUTS: u32 = 8;
    let mut data = MeshData::default();
    for &[a, b, c, d] in quads {
        let first = data.positions.len() as u32;
        for i in 0..=CUTS {
            for j in 0..=CUTS {
                let (u, v) = (f64::from(i) / f64::from(CUTS), f64::from(j) / f64::from(CUTS));
                data.positions.push(a.lerp(b, u).lerp(d.lerp(c, u), v));
            }
        }
        let at = |i: u32, j: u32| first + i * (CUTS + 1) + j;
        for (i, j) in (0..CUTS * CUTS).map(|k| (k / CUTS, k % CUTS)) {
            data.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            data.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    let mesh = Mesh::new(data).expect("a mesh");
    Shape::Mesh { mesh: Arc::new(mesh), placement: Placement::default() }
}

/// A box as a mesh.
fn boxed(min: DVec3, max: DVec3) -> Shape {
    let corner = |x: bool, y: bool, z: bool| {
        let pick = |high: bool, axis: usize| if high { max[axis] } else { min[axis] };
        DVec3::new(pick(x, 0), pick(y, 1), pick(z, 2))
    };
    let (f, t) = (false, true);
    let shape = mesh(&[
        [corner(f, f, f), corner(f, f, t), corner(f, t, t), corner(f, t, f)],
        [corner(t, f, f), corner(t, t, f), corner(t, t, t), corner(t, f, t)],
        [corner(f, f, f), corner(t, f, f), corner(t, f, t), corner(f, f, t)],
        [corner(f, t, f), corner(f, t, t), corner(t, t, t), corner(t, t, f)],
        [corner(f, f, f), corner(f, t, f), corner(t, t, f), corner(t, f, f)],
        [corner(f, f, t), corner(t, f, t), corner(t, t, t), corner(f, t, t)],
    ]);
    assert!(!shape.is_sheet(), "a box is closed");
    shape
}

/// A sheet at x = 0 whose triangles face +x, or −x.
fn sheet(faces_back: bool) -> Shape {
    let mut corners =
        [(-0.5, -1.2), (1.0, -1.2), (1.0, 1.2), (-0.5, 1.2)].map(|(y, z)| DVec3::new(0.0, y, z));
    if faces_back {
        corners.reverse();
    }
    let shape = mesh(&[corners]);
    assert!(shape.is_sheet());
    shape
}

fn from(eye: DVec3) -> Camera {
    let target = DVec3::new(0.0, 0.25, 0.0);
    Camera { eye, target, up: Vec3::Y, fov_y: 40.0, near: None, lens: None }
}

/// Number of pixels that the liquid changes.
fn changed(harness: &mut Harness, scene: &Scene, camera: &Camera, splats: &Splats) -> usize {
    let without = Splats { aggregates: Vec::new(), splashes: Vec::new(), ..splats.clone() };
    let [with, without] =
        [splats, &without].map(|splats| harness.render(scene, camera, splats, SIZE).picture);
    with.pixels().zip(without.pixels()).filter(|(a, b)| a != b).count()
}

/// Behind a wall no liquid is visible, whichever way the normal points, from a frontal or an oblique
/// view: the picture equals that without the liquid, although splats of bodies and droplets extend
/// through the wall.
#[test]
fn walls_occlude_the_liquid_behind_them() {
    let Some(mut harness) = harness() else { return };
    let thin = Shape::Box { min: DVec3::new(-0.01, -0.5, -1.2), max: DVec3::new(0.0, 1.0, 1.2) };
    let walls = [
        plane(Vec3::X, f32::INFINITY),
        plane(Vec3::NEG_X, f32::INFINITY),
        plane(Vec3::X, 1.0),
        thin,
        boxed(DVec3::new(-0.3, -0.5, -1.2), DVec3::new(0.0, 1.0, 1.2)),
        boxed(DVec3::new(-0.01, -0.5, -1.2), DVec3::new(0.0, 1.0, 1.2)),
        sheet(false),
        sheet(true),
    ];
    for wall in walls {
        let (scene, splats) = block(wall.clone());
        let spray = Splats {
            splashes: splats.aggregates.clone(),
            aggregates: Vec::new(),
            ..splats.clone()
        };
        for eye in [DVec3::new(-1.5, 0.3, 0.1), DVec3::new(-0.5, 0.7, 1.2)] {
            for splats in [&splats, &spray] {
                let seen = changed(&mut harness, &scene, &from(eye), splats);
                assert_eq!(seen, 0, "{wall:?} from {eye}");
            }
        }
        let seen = changed(&mut harness, &scene, &from(DVec3::new(1.5, 0.7, 0.6)), &splats);
        assert!(seen > 1000, "{wall:?}: the liquid covers {seen} pixels");
    }
}

/// A wall is wetted and looks the same whichever way its normal points.
#[test]
fn planes_are_wetted_on_both_sides() {
    let Some(mut harness) = harness() else { return };
    let camera = from(DVec3::new(1.5, 0.7, 0.6));
    let [a, b] = [Vec3::X, Vec3::NEG_X].map(|normal| {
        let (scene, splats) = block(plane(normal, f32::INFINITY));
        let images = harness.render(&scene, &camera, &splats, SIZE);
        (splats, images.picture)
    });
    assert_eq!(a.0.aggregates.len(), b.0.aggregates.len());
    let places = |splats: &Splats| splats.aggregates.iter().map(|s| s.centre).collect::<Vec<_>>();
    assert_eq!(places(&a.0), places(&b.0));
    assert!(
        a.0.aggregates.len() > 3100,
        "no copies of the 3000 particles: {}",
        a.0.aggregates.len()
    );
    assert_eq!(a.1, b.1);
}

/// A particle slightly beyond a wall stays connected to the others: the picture hardly changes.
#[test]
fn slight_leaks_do_not_change_the_picture() {
    let Some(mut harness) = harness() else { return };
    let (scene, mut splats) = block(plane(Vec3::X, f32::INFINITY));
    let move_outermost = |splats: &mut Splats, x: f32| {
        let nearest =
            splats.aggregates.iter_mut().min_by(|a, b| a.centre[0].total_cmp(&b.centre[0]));
        nearest.unwrap().centre[0] = x;
    };
    // Without the copies on the wall.
    let originals = splats.aggregates.iter().filter(|s| s.centre[0] > 1e-6).copied().collect();
    splats.aggregates = originals;
    let radius = splats.radius;
    let camera = from(DVec3::new(1.5, 0.7, 0.6));
    move_outermost(&mut splats, 0.0);
    let before = harness.render(&scene, &camera, &splats, SIZE).picture;
    move_outermost(&mut splats, -1e-3 * radius);
    let after = harness.render(&scene, &camera, &splats, SIZE).picture;
    let off = before
        .pixels()
        .zip(after.pixels())
        .filter(|(a, b)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 8));
    assert!(off.count() < 20, "the particle has moved by a thousandth of its radius");
}
