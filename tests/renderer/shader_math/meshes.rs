//! The meshes of `mesh.wgsl`: rays, nearness, normals and textures.
//!
//! Truth is a search through all triangles in 64 bits. The device's ray has an error of its own: it passes a
//! point at distance r from it with an error of ROUNDING·r, since each component of the point relative to the
//! ray's origin is rounded, and an edge function is known to within 10 half units in the last place of the
//! product of that distance and the edge (`EDGE_ROUNDING`). A hit may therefore be that of any ray within
//! this distance: what lies farther from all edges must agree, and the length along the ray differs by the
//! error over the cosine.

use std::sync::Arc;

use bytemuck::{bytes_of, cast_slice};
use glam::{DQuat, DVec3, UVec2, Vec2, Vec3};
use limpid::gpu::Gpu;
use limpid::mesh::{Material, Mesh, MeshData, Placement, Texture};
use limpid::passes::mesh_buffers::MeshBuffers;
use limpid::passes::scene_binding::SolidData;
use limpid::scene::{Scene, Shape, Solid, Surface};
use limpid::wgpu;
use wgpu::util::DeviceExt as _;

use crate::support::view::{NOTHING, case, vec3};
use crate::support::{Kernel, Random, gpu};

/// Error of a ray relative to the distance of what it passes: the position's rounding in three rotations and
/// a difference, and that of the edge functions.
const ROUNDING: f64 = 2e-6;

/// A solid's data and buffers, as the renderer uploads them.
pub(super) struct Uploaded {
    solids: wgpu::Buffer,
    meshes: MeshBuffers,
    pub(super) mesh: Arc<Mesh>,
    pub(super) placement: Placement,
}

pub(super) fn uploaded(gpu: &Gpu, data: MeshData, placement: Placement) -> Uploaded {
    let mesh = Arc::new(Mesh::new(data).expect("a mesh"));
    let shape = Shape::Mesh { mesh: mesh.clone(), placement };
    let solid = Solid { shape, surface: Surface::Own, lit: false };
    let scene = Scene { solids: vec![solid], ..Scene::default() };
    let mut meshes = MeshBuffers::new(gpu);
    meshes.prepare(gpu, &scene).expect("within limits");
    let data = SolidData::new(&scene.solids[0], 0, meshes.places[0], DVec3::ZERO);
    let mut bytes = bytes_of(&data).to_vec();
    bytes.resize(512 * size_of::<SolidData>(), 0);
    let solids = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("solids"),
        contents: &bytes,
        usage: wgpu::BufferUsages::UNIFORM,
    });
    Uploaded { solids, meshes, mesh, placement }
}

impl Uploaded {
    /// The solids and their triangles, then their attributes, which not every kernel reads.
    fn resources(&self) -> [(u32, u32, wgpu::BindingResource<'_>); 3] {
        [
            (2, 1, self.solids.as_entire_binding()),
            (2, 7, wgpu::BindingResource::TextureView(&self.meshes.geometry)),
            (2, 8, self.meshes.surfaces.as_entire_binding()),
        ]
    }

    /// Corners of all triangles in the world.
    pub(super) fn triangles(&self) -> Vec<[DVec3; 3]> {
        let place = |i: u32| {
            let x = self.mesh.origin() + self.mesh.vertices()[i as usize].as_dvec3();
            self.placement.world_from_mesh(x)
        };
        self.mesh.triangles().iter().map(|triangle| triangle.map(place)).collect()
    }

    /// Length, triangle and normal of the device's hits.
    pub(super) fn traced(&self, gpu: &Gpu, rays: &[[f32; 6]]) -> Vec<[f32; 5]> {
        let kernel = Kernel {
            imports: &["common/scene.wgsl"],
            body: "fn test(x: array<f32, 6>) -> array<f32, 5> {
                let hit = mesh_trace(0u, vec3f(x[0], x[1], x[2]), vec3f(x[3], x[4], x[5]), NOTHING, false);
                let any_one = mesh_trace(0u, vec3f(x[0], x[1], x[2]), vec3f(x[3], x[4], x[5]), NOTHING, true);
                if (hit.triangle == NO_TRIANGLE) != (any_one.triangle == NO_TRIANGLE) {
                    return array(-1.0, 0.0, 0.0, 0.0, 0.0);
                }
                if hit.triangle == NO_TRIANGLE {
                    return array(NOTHING, 0.0, 0.0, 0.0, 0.0);
                }
                let n = mesh_normal(0u, hit.triangle);
                return array(hit.t, f32(hit.triangle), n.x, n.y, n.z);
            }",
            constants: &[("SOLIDS", 1.0), ("MESHES", 1.0)],
            resources: &self.resources()[..2],
        };
        kernel.run(gpu, rays)
    }
}

/// A closed ball of `2 n²` triangles with bumps.
pub(super) fn ball(n: u32) -> MeshData {
    let mut data = MeshData::default();
    for j in 0..=n {
        for i in 0..n {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(n)).sin_cos();
            let (height, round) = (std::f64::consts::PI * f64::from(j) / f64::from(n)).sin_cos();
            let bump = 1.0 + 0.1 * f64::from((i * 7 + j * 3) % 5) / 5.0;
            let bump = if j == 0 || j == n { 1.0 } else { bump };
            // The poles are one place each, exactly.
            let height = if j == 0 || j == n { 0.0 } else { height };
            data.positions.push(bump * DVec3::new(height * cos, round, height * sin));
        }
    }
    for j in 0..n {
        for i in 0..n {
            let at = |di: u32, dj: u32| (j + dj) * n + (i + di) % n;
            data.triangles.push([at(0, 0), at(1, 0), at(1, 1)]);
            data.triangles.push([at(0, 0), at(1, 1), at(0, 1)]);
        }
    }
    data
}

/// Where a ray crosses a triangle, and how far from its border, m: negative outside. Lengths, cosines.
fn crossing(o: DVec3, d: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f64, f64, f64)> {
    let n = (b - a).cross(c - a).try_normalize()?;
    let cos_theta = n.dot(d);
    let t = (a - o).dot(n) / cos_theta;
    if !t.is_finite() {
        return None;
    }
    // Distance from the edges across the ray: a slanted triangle is narrower than it is.
    let across = |x: DVec3| x - x.dot(d) * d;
    let beyond = |a: DVec3, b: DVec3| {
        let edge = across(b - a);
        edge.cross(across(o - a)).dot(d) / edge.length().max(1e-300)
    };
    let sides = [beyond(a, b), beyond(b, c), beyond(c, a)];
    let inner = sides.map(|side| side * cos_theta.signum());
    Some((t, inner.into_iter().fold(f64::INFINITY, f64::min), cos_theta.abs()))
}

fn is_in_plane(o: DVec3, d: DVec3, [a, b, c]: [DVec3; 3], error: f64) -> bool {
    let n = (b - a).cross(c - a).normalize_or_zero();
    n.dot(d).abs() < 1e-6 && n.dot(a - o).abs() < error
}

/// Checks each ray against all triangles; returns the number of rays that had to agree exactly about hit or
/// miss.
fn check(gpu: &Gpu, uploaded: &Uploaded, rays: &[[f32; 6]]) -> usize {
    let triangles = uploaded.triangles();
    let mut sharp = 0;
    for (ray, result) in rays.iter().zip(uploaded.traced(gpu, rays)) {
        let (o, d) = (vec3(&ray[..3]), vec3(&ray[3..]).normalize());
        let t = f64::from(result[0]);
        let what = || format!("from {o} along {d}: {result:?}");
        assert!(t > 0.0, "both searches must agree, {}", what());
        let size = triangles.iter().flatten().map(|x| x.distance(o)).fold(0.0, f64::max);
        let error = ROUNDING * size;
        // A ray in the plane of a triangle may hit it anywhere, or not.
        if triangles.iter().any(|triangle| is_in_plane(o, d, *triangle, error)) {
            continue;
        }
        // Surely hit, and possibly hit.
        let crossings = triangles.iter().filter_map(|triangle| crossing(o, d, *triangle));
        let (mut sure, mut possible) = (f64::INFINITY, f64::INFINITY);
        let mut reached = false;
        for (at, inner, cos_theta) in crossings {
            let slack = error * (2.0 + 1.0 / cos_theta.max(1e-9));
            if inner >= -error && at > -slack {
                possible = possible.min(at - slack);
                reached |= (at - t).abs() <= slack + 1e-6 * t;
            }
            if inner > error && at > slack {
                sure = sure.min(at + slack);
            }
        }
        if t < NOTHING {
            assert!(reached, "no triangle is there, {}", what());
            assert!(
                t <= sure && t >= possible - error,
                "{possible} to {sure} expected, {}",
                what()
            );
        } else {
            assert!(sure == f64::INFINITY, "a hit at {sure} is missed, {}", what());
        }
        sharp += usize::from(sure < f64::INFINITY || possible == f64::INFINITY);
    }
    sharp
}

fn ray(o: DVec3, d: DVec3) -> [f32; 6] {
    case(&[&o.to_array(), &d.normalize().to_array()])
}

/// Random rays from within, beside and 10³ and 10⁴ radii away agree with the truth; so do rays at vertices,
/// along edges and in the planes of triangles.
#[test]
fn meshes_are_traced() {
    let Some(gpu) = gpu() else { return };
    let placement = Placement {
        translate: DVec3::new(0.3, -1.2, 2.0),
        rotate: DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -0.4, 2.1),
        scale: 0.37,
    };
    let uploaded = uploaded(gpu, ball(16), placement);
    let triangles = uploaded.triangles();
    let mut random = Random(31);
    let mut rays = Vec::new();
    for i in 0..30_000 {
        let away = [0.3, 1.5, 10.0, 1e3, 1e4][i % 5] * 0.4;
        let o = placement.translate + away * random.direction();
        let corners = triangles[(random.unit() * triangles.len() as f64) as usize];
        let aim = match i % 7 {
            0 => placement.translate + 0.5 * random.direction() * random.unit(),
            1 => corners[0],
            2 => corners[0].lerp(corners[1], random.unit()),
            3 => corners.into_iter().sum::<DVec3>() / 3.0,
            4 => o + random.direction(),
            5 => corners[2] + 1e-6 * random.direction(),
            // In the triangle's plane.
            _ => o + (corners[1] - corners[0]),
        };
        rays.push(ray(o, aim - o));
    }
    let sharp = check(gpu, &uploaded, &rays);
    assert!(sharp > 20_000, "only {sharp} sharp cases");
}

/// No ray slips through a closed mesh: from its inside every one meets it, also at vertices and edges.
#[test]
fn closed_meshes_have_no_gaps() {
    let Some(gpu) = gpu() else { return };
    let uploaded = uploaded(gpu, ball(64), Placement::default());
    let triangles = uploaded.triangles();
    let mut random = Random(32);
    let rays: Vec<_> = (0..200_000)
        .map(|i| {
            let o = 0.5 * random.direction() * random.unit();
            let [a, b, _] = triangles[i % triangles.len()];
            ray(o, a.lerp(b, if i % 3 == 0 { 0.0 } else { random.unit() }) - o)
        })
        .collect();
    let hits = uploaded.traced(gpu, &rays);
    let slipped = hits.iter().filter(|hit| !(hit[0] > 0.0 && f64::from(hit[0]) < NOTHING)).count();
    assert_eq!(slipped, 0);
}

/// Needles, slivers, triangles in one place and a sheet seen edge-on are traced like others.
#[test]
fn degenerate_triangles_are_traced() {
    let Some(gpu) = gpu() else { return };
    let mut data = MeshData::default();
    let mut random = Random(33);
    for i in 0..600u32 {
        let a = random.direction() * random.unit();
        let (b, c) = match i % 4 {
            0 => (a + 2.0 * random.direction(), a + 1e-5 * random.direction()),
            1 => (a + random.direction(), a),
            2 => (DVec3::X, DVec3::Y),
            _ => (a + 1e-6 * random.direction(), a + 1e-6 * random.direction()),
        };
        let a = if i % 4 == 2 { DVec3::ZERO } else { a };
        data.positions.extend([a, b, c]);
        data.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let uploaded = uploaded(gpu, data, Placement::default());
    let triangles = uploaded.triangles();
    let rays: Vec<_> = (0..20_000)
        .map(|i| {
            let o = 3.0 * random.direction();
            let [a, b, c] = triangles[i % triangles.len()];
            let inside = a.lerp(b, random.unit()).lerp(c, random.unit());
            let aim =
                if i % 5 == 0 { DVec3::new(random.unit(), random.unit(), 0.0) } else { inside };
            let o = if i % 10 == 0 { DVec3::new(o.x, o.y, 0.0) } else { o };
            ray(o, aim - o)
        })
        .collect();
    check(gpu, &uploaded, &rays);
}

/// A point counts as near exactly within the reach, and the CPU's distance agrees.
#[test]
fn nearness_is_that_of_the_distance() {
    let Some(gpu) = gpu() else { return };
    let placement =
        Placement { translate: DVec3::Y, rotate: DQuat::from_rotation_x(1.0), scale: 2.0 };
    let uploaded = uploaded(gpu, ball(16), placement);
    let kernel = Kernel {
        imports: &["common/scene.wgsl"],
        body: "fn test(x: array<f32, 4>) -> array<f32, 1> {
            return array(f32(mesh_is_near(0u, vec3f(x[0], x[1], x[2]), x[3])));
        }",
        constants: &[("SOLIDS", 1.0), ("MESHES", 1.0)],
        resources: &uploaded.resources()[..2],
    };
    let shape = Shape::Mesh { mesh: uploaded.mesh.clone(), placement };
    let mut random = Random(34);
    let cases: Vec<[f32; 4]> = (0..20_000)
        .map(|_| {
            let x = placement.translate + 3.0 * random.unit() * random.direction();
            case(&[&x.to_array(), &[random.magnitude(1e-3, 1.0)]])
        })
        .collect();
    let results: Vec<[f32; 1]> = kernel.run(gpu, &cases);
    let mut near = 0;
    for (x, [result]) in cases.iter().zip(results) {
        let (distance, _) = shape.distance(vec3(&x[..3]));
        let reach = f64::from(x[3]);
        if (distance.abs() - reach).abs() > 1e-5 {
            assert_eq!(result == 1.0, distance.abs() <= reach, "{x:?}: {distance}");
        }
        near += usize::from(result == 1.0);
    }
    assert!((1000..19_000).contains(&near), "{near}");
}

/// A square of two triangles shows its texture upright: (0, 0) is the first texel, and lookups between the
/// centres of texels are bilinear and repeat.
#[test]
fn textures_are_upright_and_bilinear() {
    let Some(gpu) = gpu() else { return };
    let pixels = vec![[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 255, 255]];
    let texture = Texture::new(UVec2::new(2, 2), pixels).expect("a texture");
    let material = Material { color: Vec3::new(1.0, 0.5, 0.25), texture: Some(Arc::new(texture)) };
    let data = MeshData {
        // The first row of the texture is above.
        positions: vec![DVec3::Y, DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0)],
        coordinates: vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![material],
        ..MeshData::default()
    };
    let uploaded = uploaded(gpu, data, Placement::default());
    let kernel = Kernel {
        imports: &["common/scene.wgsl"],
        body: "fn test(x: array<f32, 2>) -> array<f32, 3> {
            let hit = mesh_trace(0u, vec3f(x[0], x[1], 1.0), vec3f(0.0, 0.0, -1.0), NOTHING, false);
            let c = mesh_color(solids[0], hit.triangle, vec3f(x[0], x[1], 0.0), 1.0, 0.0);
            return array(c.x, c.y, c.z);
        }",
        constants: &[("SOLIDS", 1.0), ("MESHES", 1.0)],
        resources: &uploaded.resources(),
    };
    let cases = [
        [0.25f32, 0.75],
        [0.75, 0.75],
        [0.25, 0.25],
        [0.75, 0.25],
        [0.5, 0.5],
        [0.25, 0.5],
        [0.999, 0.75],
    ];
    let expected = [
        [1.0, 0.0, 0.0],
        [0.0, 0.5, 0.0],
        [0.0, 0.0, 0.25],
        [1.0, 0.5, 0.25],
        [0.5, 0.25, 0.125],
        [0.5, 0.0, 0.125],
        // Halfway from the last column to the first, which follows it.
        [0.499, 0.2505, 0.0],
    ];
    let results: Vec<[f32; 3]> = kernel.run(gpu, &cases);
    for ((x, result), expected) in cases.iter().zip(&results).zip(expected) {
        let off = Vec3::from_array(*result).distance(Vec3::from_array(expected));
        assert!(off < 3e-3, "{x:?}: {result:?}, not {expected:?}");
    }
    assert!(!cast_slice::<_, f32>(&results).iter().any(|c| c.is_nan()));
}
