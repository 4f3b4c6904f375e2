//! Triangle meshes on the CPU: checks, distances and sides.

use std::sync::Arc;

use glam::{DQuat, DVec3, Vec2, Vec3};
use limpid::gpu::Gpu;
use limpid::mesh::{Mesh, MeshData, Placement};
use limpid::passes::mesh_buffers::MeshBuffers;
use limpid::scene::{Scene, Shape, Solid, Surface};
use limpid::wgpu;

/// A cube from −1 to 1, whose faces point outwards; each corner is one vertex.
fn cube() -> MeshData {
    let corner = |i: u32| DVec3::from([0, 1, 2].map(|bit| f64::from(i >> bit & 1) * 2.0 - 1.0));
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    MeshData {
        positions: (0..8).map(corner).collect(),
        triangles: faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        ..MeshData::default()
    }
}

fn shape(data: MeshData, placement: Placement) -> Shape {
    Shape::Mesh { mesh: Arc::new(Mesh::new(data).expect("a mesh")), placement }
}

/// Points by a Halton-like sequence within −3 to 3.
fn points() -> impl Iterator<Item = DVec3> {
    let step = DVec3::new(0.819_172_5, 0.671_043_6, 0.549_700_5);
    (1..20_000).map(move |i| 6.0 * (f64::from(i) * step).fract() - 3.0)
}

/// A cube's mesh has the distances, sides and normals of the box, wherever it is placed.
#[test]
fn distances_are_those_of_the_box() {
    let solid = Shape::Box { min: -DVec3::ONE, max: DVec3::ONE };
    let placement = Placement {
        translate: DVec3::new(1e5, -2e4, 3.0),
        rotate: DQuat::from_axis_angle(DVec3::new(0.48, 0.6, 0.64), 1.1),
        scale: 0.25,
    };
    let mesh = shape(cube(), placement);
    for x in points() {
        let (expected, normal) = solid.distance(x);
        let (distance, found) = mesh.distance(placement.world_from_mesh(x));
        assert!(
            (distance - 0.25 * expected).abs() < 1e-9,
            "{x}: {distance}, not 0.25 · {expected}"
        );
        // Within the box several faces may be nearest.
        if expected > 1e-6 {
            assert!(
                found.abs_diff_eq(placement.rotate * normal, 1e-6),
                "{x}: {found}, not {normal}"
            );
        }
        let limit = 0.1;
        let within = mesh.distance_within(placement.world_from_mesh(x), limit);
        assert_eq!(within.is_some(), distance.abs() <= limit, "{x}");
    }
}

/// A mesh is closed if its triangles enclose a volume, also where vertices are repeated; one that is inside
/// out is turned, and one with a hole or a reversed triangle is open.
#[test]
fn closedness() {
    let closed = |data: MeshData| Mesh::new(data).expect("a mesh").is_closed();
    assert!(closed(cube()));

    let repeated = |data: &MeshData| MeshData {
        positions: data.triangles.iter().flatten().map(|&i| data.positions[i as usize]).collect(),
        triangles: (0..data.triangles.len() as u32)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect(),
        ..MeshData::default()
    };
    assert!(closed(repeated(&cube())));

    let mut inside_out = cube();
    inside_out.triangles.iter_mut().for_each(|triangle| triangle.reverse());
    assert!(shape(inside_out, Placement::default()).distance(DVec3::ZERO).0 < 0.0);

    let mut holed = cube();
    holed.triangles.pop();
    assert!(!closed(holed));
    let mut reversed = cube();
    reversed.triangles[3].reverse();
    assert!(!closed(reversed));
}

/// A sheet has two sides and ends at its rim.
#[test]
fn sheets_end_at_their_rim() {
    let data = MeshData {
        positions: [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
            .map(|(x, z)| DVec3::new(x, 0.0, z))
            .to_vec(),
        triangles: vec![[0, 2, 1], [0, 3, 2]],
        ..MeshData::default()
    };
    let sheet = shape(data, Placement::default());
    assert!(sheet.is_sheet());
    assert_eq!(sheet.distance(DVec3::new(0.5, 0.25, 0.4)), (0.25, DVec3::Y));
    assert_eq!(sheet.distance(DVec3::new(0.5, -0.25, 0.5)), (-0.25, DVec3::Y));
    assert_eq!(sheet.distance(DVec3::new(1.5, 0.25, 0.5)).0, f64::INFINITY);
}

/// Wrong meshes are errors that say what is wrong; triangles without area are left out.
#[test]
fn wrong_meshes_are_refused() {
    type Damage = fn(&mut MeshData);
    let cases: [(Damage, &str); 9] = [
        (|data| data.positions[3].y = f64::NAN, "vertex 4"),
        (|data| data.positions[0].x = 1e300, "vertex 1"),
        (|data| data.triangles[1][2] = 8, "triangle 2 has corners"),
        (|data| data.triangles.clear(), "no triangle"),
        (|data| data.triangles.iter_mut().for_each(|t| t[1] = t[0]), "no triangle"),
        (|data| data.normals = vec![Vec3::Y; 7], "7 normals for 8 vertices"),
        (|data| data.coordinates = vec![Vec2::NAN; 8], "must be finite"),
        (|data| data.material_of = vec![0; 12], "material does not exist"),
        (|data| data.material_of = vec![0; 3], "3 materials for 12 triangles"),
    ];
    for (damage, expected) in cases {
        let mut data = cube();
        damage(&mut data);
        let problem = Mesh::new(data).expect_err(expected).to_string();
        assert!(problem.contains(expected), "{problem}: `{expected}` expected");
    }
    let mut degenerate = cube();
    degenerate.triangles.push([1, 1, 2]);
    assert_eq!(Mesh::new(degenerate).expect("a mesh").triangles().len(), 12);
}

/// Levels of a mesh's tree and triangles in its leaves.
fn levels_and_triangles(mesh: &Mesh) -> (usize, u32) {
    let mut rest = vec![(0, 1)];
    let (mut deepest, mut count) = (0, 0);
    while let Some((node, level)) = rest.pop() {
        deepest = deepest.max(level);
        let node = &mesh.nodes()[node];
        if node.is_leaf() {
            count += node.prim_count;
        } else {
            let left = node.first_index as usize;
            rest.extend([(left, level + 1), (left + 1, level + 1)]);
        }
    }
    (deepest, count)
}

/// A hundred thousand triangles make a tree that the shader's stack holds, in short time, also if they are in
/// one place or all overlap.
#[test]
fn trees_are_shallow() {
    for spread in [0.0, 1e-3, 1.0, 100.0] {
        let mut data = MeshData::default();
        for i in 0..100_000u32 {
            let at = spread * DVec3::new(0.819_172_5, 0.671_043_6, 0.549_700_5) * f64::from(i);
            let corner = |k: u32| (0.31 * at + 0.618 * f64::from(i * k)).fract();
            data.positions.extend([
                spread * at.fract(),
                DVec3::X + corner(1),
                DVec3::Y + corner(2),
            ]);
            data.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
        }
        if spread == 0.0 {
            for corners in data.positions.chunks_mut(3) {
                corners.copy_from_slice(&[DVec3::ZERO, DVec3::X, DVec3::Y]);
            }
        }
        let mesh = Mesh::new(data).expect("a mesh");
        let (levels, triangles) = levels_and_triangles(&mesh);
        assert!(levels <= limpid::mesh::MAX_DEPTH, "{levels} at {spread}");
        assert_eq!(triangles as usize, mesh.triangles().len());
    }
}

/// A scene refuses a mesh's colours on other solids, and placements that are none.
#[test]
fn scenes_check_meshes() {
    let problem = |solid: Solid| {
        let scene = Scene { solids: vec![solid], ..Default::default() };
        scene.check().err().map(|e| e.to_string())
    };
    let mesh =
        |placement| Solid { shape: shape(cube(), placement), surface: Surface::Own, lit: true };
    assert_eq!(problem(mesh(Placement::default())), None);
    let flat = Placement { scale: 0.0, ..Placement::default() };
    assert!(problem(mesh(flat)).expect("an error").contains("scale"));
    let skewed = Placement { rotate: DQuat::from_xyzw(1.0, 1.0, 0.0, 0.0), ..Placement::default() };
    assert!(problem(mesh(skewed)).expect("an error").contains("quaternion"));
    let ball = Shape::Sphere { center: DVec3::ZERO, radius: 1.0 };
    let own = Solid { shape: ball, surface: Surface::Own, lit: false };
    assert!(problem(own).expect("an error").contains("only a mesh"));
}

/// A mesh that exceeds the device's buffers is an error that says by how much; a smaller one is uploaded
/// afterwards.
#[test]
fn meshes_beyond_the_device_are_refused() {
    let required_limits = wgpu::Limits {
        max_storage_buffer_binding_size: 1 << 20,
        max_uniform_buffer_binding_size: 1 << 16,
        ..wgpu::Limits::default()
    };
    let (device, queue) =
        wgpu::Device::noop(&wgpu::DeviceDescriptor { required_limits, ..Default::default() });
    let gpu = Gpu::from_device(device, queue);
    let scene = |count: u32| {
        let place = |i: u32| {
            DVec3::new((f64::from(i) * 0.618).fract(), f64::from(i % 3), 0.1 * f64::from(i))
        };
        let data = MeshData {
            positions: (0..3 * count).map(place).collect(),
            triangles: (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            ..MeshData::default()
        };
        let solid =
            Solid { shape: shape(data, Placement::default()), surface: Surface::Own, lit: true };
        Scene { solids: vec![solid], ..Scene::default() }
    };
    let mut buffers = MeshBuffers::new(&gpu);
    // Ten words each.
    let problem = buffers.prepare(&gpu, &scene(30_000)).expect_err("1 MiB holds less").to_string();
    assert!(problem.contains("MiB of meshes and textures; most are 1 MiB"), "{problem}");
    buffers.prepare(&gpu, &scene(10_000)).expect("it fits");
    assert!(buffers.surfaces.size() > 9_000 * 40, "{}", buffers.surfaces.size());
}
