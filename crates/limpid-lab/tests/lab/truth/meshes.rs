//! Meshes as liquid: they converge, have no holes, and are made of any particles.

use limpid::environment::Environment;
use limpid::glam::{DVec3, UVec2, Vec3};
use limpid_io::project::Project;
use limpid_lab::compare::compare;
use limpid_lab::reference::Liquid;
use limpid_lab::reference::analytic::Ball;
use limpid_lab::reference::mesh::{Mesh, Reconstruction};
use limpid_lab::reference::trace::{MAX_DEPTH, trace};

use super::{CHECKERED, Random, looking, project, ray, scene};

/// A triangulated sphere: an icosahedron whose faces are subdivided `times` times.
pub(super) fn sphere_mesh(center: DVec3, radius: f64, times: u32) -> Mesh {
    let g = 0.5 * (1.0 + 5f64.sqrt());
    let signs = [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)];
    let mut vertices: Vec<DVec3> = (0..3)
        .flat_map(|axis| {
            signs.map(|(a, b)| {
                let v = DVec3::new(a, b, 0.0).normalize();
                [v, DVec3::new(v.z, v.x, v.y), DVec3::new(v.y, v.z, v.x)][axis]
            })
        })
        .collect();
    // The faces are the triples of vertices at the smallest distance.
    let near = |a: DVec3, b: DVec3| a.distance(b) < 1.1;
    let mut triangles = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let [a, b, c] = [i, j, k].map(|v| vertices[v]);
                if near(a, b) && near(b, c) && near(c, a) {
                    let outward = (b - a).cross(c - a).dot(a) > 0.0;
                    triangles.push(if outward { [i, j, k] } else { [i, k, j] }.map(|v| v as u32));
                }
            }
        }
    }
    for _ in 0..times {
        let mut middles = std::collections::HashMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q): (u32, u32)| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    vertices.push((vertices[p as usize] + vertices[q as usize]).normalize());
                    vertices.len() as u32 - 1
                })
            });
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    let vertices = vertices.into_iter().map(|v| center + radius * v).collect();
    Mesh::new(vertices, triangles).unwrap()
}

/// Finer meshes converge to the picture of the exact ball.
#[test]
fn finer_meshes_converge_to_the_ball() {
    let Project { scene, camera, .. } = project(CHECKERED);
    let camera = camera.unwrap();
    let size = UVec2::new(96, 72);
    let (center, radius) = (DVec3::new(0.1, 0.1, 0.0), 0.7);
    let ball = Ball { center, radius };
    let exact = trace(&ball, &scene, &camera, size, 4, MAX_DEPTH).to_srgb();
    let errors = [3, 4, 5].map(|times| {
        let mesh = sphere_mesh(center, radius, times);
        let found = trace(&mesh, &scene, &camera, size, 4, MAX_DEPTH).to_srgb();
        compare(&exact, &found).unwrap().0.mean_flip
    });
    println!("mean FLIP to the ball: {errors:?}");
    assert!(errors[1] < errors[0] && errors[2] < errors[1] && errors[2] < 0.01, "{errors:?}");
}

/// A closed mesh has no leaks: rays at edges, at vertices and at random cross it an even number of
/// times, alternately in and out, and `contains` is right.
#[test]
fn a_closed_mesh_has_no_holes() {
    let mesh = sphere_mesh(DVec3::new(3.0, -2.0, 5.0), 1.0, 3);
    let center = DVec3::new(3.0, -2.0, 5.0);
    assert!(mesh.contains(center) && !mesh.contains(center + 1.1 * DVec3::Y));
    let mut random = Random(6);
    for i in 0..3000 {
        let [a, b, c] =
            mesh.triangles()[i % mesh.triangles().len()].map(|v| mesh.vertices()[v as usize]);
        let target = [a, 0.5 * (a + b), center, (a + b + c) / 3.0][i % 4];
        let origin = center + random.range(1.2, 100.0) * random.direction();
        let from = ray(origin, target - origin);
        let mut at = from;
        let mut inside = false;
        let mut count = 0;
        while let Some(crossing) = mesh.crossing(&at, inside).filter(|_| count < 10) {
            assert_eq!(crossing.normal.dot(at.direction) > 0.0, inside);
            at.origin = at.at(crossing.t);
            inside = !inside;
            count += 1;
        }
        // A ray that grazes a corner from outside may enter and leave at the same rounded distance.
        let to_center = center - from.origin;
        let miss = to_center.reject_from_normalized(from.direction).length();
        assert!(miss > 0.99 || (!inside && count == 2), "{i}: {count} crossings, {miss} beside");
    }
}

/// Open meshes give finite pictures as bright as their surroundings.
#[test]
fn open_meshes_give_finite_pictures() {
    let corners = [DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, -1.0, 0.0), DVec3::Y];
    let mesh = Mesh::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap();
    let mut scene = scene("[liquid]\nior = 1.33\nabsorption = [0.0, 3.0, 3.0]");
    scene.environment = Environment::Constant(Vec3::ONE);
    for eye in [2.0, -2.0] {
        let camera = looking(Vec3::new(0.2, 0.1, eye), Vec3::ZERO);
        let image = trace(&mesh, &scene, &camera, UVec2::splat(16), 1, MAX_DEPTH);
        assert!(image.pixels.iter().all(|c| (*c - DVec3::ONE).length() < 1e-9));
    }
    assert!(Mesh::new(corners.to_vec(), vec![[0, 1, 3]]).is_err());
    assert!(Mesh::new(vec![DVec3::NAN], Vec::new()).is_err());
    let nothing = Mesh::new(Vec::new(), Vec::new()).unwrap();
    assert_eq!(nothing.crossing(&ray(DVec3::ZERO, DVec3::X), false), None);
    assert!(!nothing.contains(DVec3::ZERO));
}

/// Edge cases of the reconstruction: no particle, one, coincident ones, and invalid numbers.
#[test]
fn few_particles_are_meshed_and_invalid_ones_rejected() {
    let how = Reconstruction::default();
    assert!(Mesh::reconstruct(&[], 0.1, &how).unwrap().triangles().is_empty());
    for particles in [vec![Vec3::ONE], vec![Vec3::ONE; 5]] {
        let mesh = Mesh::reconstruct(&particles, 0.1, &how).unwrap();
        assert!(mesh.vertices().iter().all(|v| v.distance(DVec3::ONE) < 0.4));
    }
    assert!(Mesh::reconstruct(&[Vec3::NAN], 0.1, &how).is_err());
    assert!(Mesh::reconstruct(&[Vec3::ONE], 0.0, &how).is_err());
    assert!(Mesh::reconstruct(&[Vec3::ONE], f32::INFINITY, &how).is_err());
}
