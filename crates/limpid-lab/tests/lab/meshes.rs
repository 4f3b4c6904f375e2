//! Meshes as solids in the ground truth: a box's mesh is the box.

use std::sync::Arc;

use glam::{DQuat, DVec3, UVec2, Vec2, Vec3};
use limpid::mesh::{Material, Mesh, MeshData, Placement, Texture};
use limpid::scene::{Light, Scene, Shape, Solid, Surface};
use limpid_lab::reference::Ray;
use limpid_lab::reference::surroundings::Surroundings;

/// A box as a mesh of flat triangles.
fn boxed(min: DVec3, max: DVec3) -> MeshData {
    let corner =
        |i: u32| DVec3::from([0, 1, 2].map(|k| if i >> k & 1 == 0 { min[k] } else { max[k] }));
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    MeshData {
        positions: (0..8).map(corner).collect(),
        triangles: faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        ..MeshData::default()
    }
}

fn mesh(data: MeshData, placement: Placement) -> Shape {
    Shape::Mesh { mesh: Arc::new(Mesh::new(data).expect("a mesh")), placement }
}

/// Rays from around the origin.
fn rays() -> impl Iterator<Item = Ray> {
    let step = DVec3::new(0.819_172_5, 0.671_043_6, 0.549_700_5);
    (1..5000).map(move |i| {
        let at = |k: i32| 2.0 * (f64::from(i + k) * step).fract() - 1.0;
        let origin = 3.0 * at(0);
        Ray { origin, direction: (at(7001) - origin).normalize() }
    })
}

/// A lit box and its mesh are hit at the same places and have the same radiance, shadows included.
#[test]
fn a_box_and_its_mesh_look_alike() {
    let (min, max) = (DVec3::new(-0.5, 0.1, -0.4), DVec3::new(0.6, 0.8, 0.3));
    let placement =
        Placement { translate: DVec3::new(0.2, 0.0, 0.0), rotate: DQuat::IDENTITY, scale: 2.0 };
    let data = boxed((min - placement.translate) / 2.0, (max - placement.translate) / 2.0);
    let scene = |shape: Shape| {
        let surface = Surface::Color(Vec3::new(0.6, 0.5, 0.4));
        let floor =
            Shape::Plane { origin: DVec3::ZERO, normal: Vec3::Y, half_extent: f32::INFINITY };
        let solid = |shape| Solid { shape, surface: surface.clone(), lit: true };
        let sun = Light::Sun { direction: Vec3::new(-0.5, -1.0, 0.3), irradiance: Vec3::ONE };
        Scene { solids: vec![solid(floor), solid(shape)], lights: vec![sun], ..Scene::default() }
    };
    let [a, b] =
        [Shape::Box { min, max }, mesh(data, placement)].map(|s| Surroundings::new(&scene(s)));
    let mut hits = 0;
    for ray in rays() {
        let (first, second) = (a.hit(&ray), b.hit(&ray));
        assert_eq!(first.map(|hit| hit.solid), second.map(|hit| hit.solid), "{ray:?}");
        let (Some(first), Some(second)) = (first, second) else { continue };
        assert!((first.t - second.t).abs() < 1e-6, "{ray:?}: {} and {}", first.t, second.t);
        let off = a.radiance(&ray).distance(b.radiance(&ray));
        // Corners of the mesh are rounded to 32 bits, which moves the borders of shadows.
        assert!(off < 1e-6 || first.solid == 0, "{ray:?}: {off}");
        hits += usize::from(first.solid == 1);
    }
    assert!(hits > 500, "{hits}");
}

/// The texture of a mesh is looked up between the centres of its texels, and multiplied by the material's colour.
#[test]
fn textures_are_looked_up() {
    let pixels = vec![[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 255, 255]];
    let texture = Texture::new(UVec2::new(2, 2), pixels).expect("a texture");
    let data = MeshData {
        positions: vec![DVec3::Y, DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0)],
        coordinates: vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![Material {
            color: Vec3::new(1.0, 0.5, 0.25),
            texture: Some(Arc::new(texture)),
        }],
        ..MeshData::default()
    };
    let shape = mesh(data, Placement::default());
    let solid = Solid { shape, surface: Surface::Own, lit: false };
    let surroundings = Surroundings::new(&Scene { solids: vec![solid], ..Scene::default() });
    for (x, y, expected) in [
        (0.25, 0.75, DVec3::new(1.0, 0.0, 0.0)),
        (0.75, 0.75, DVec3::new(0.0, 0.5, 0.0)),
        (0.25, 0.25, DVec3::new(0.0, 0.0, 0.25)),
        (0.5, 0.5, DVec3::new(0.5, 0.25, 0.125)),
    ] {
        let ray = Ray { origin: DVec3::new(x, y, 1.0), direction: DVec3::NEG_Z };
        let seen = surroundings.radiance(&ray);
        assert!(seen.abs_diff_eq(expected, 1e-6), "({x}, {y}): {seen}, not {expected}");
    }
}
