//! Rays against meshes, many and hostile, judged in 64 bits.
//!
//! The truth is the triangles themselves in 64 bits, found by a tree of obvhs' own making. obvhs' traversal
//! in 32 bits does not serve: it rounds as much as the device, lets rays through between triangles, and
//! misses boxes from afar. It is judged alongside, and its failures are told.
//!
//! `LIMPID_RAYS=1000000` traces that many instead of the usual.

use std::env;
use std::time::Duration;

use glam::{DMat3, DQuat, DVec3, Vec3, Vec3A};
use limpid::mesh::{MeshData, Placement};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;
use rayon::prelude::*;

use super::meshes::{Uploaded, ball, uploaded};
use crate::support::view::{NOTHING, case, vec3};
use crate::support::{Random, gpu};

/// Half a unit in the last place of 1.
const UNIT: f64 = 1.0 / (1u64 << 24) as f64;

/// Error of a ray's result, measured against the truth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wrong {
    /// No ray within the tolerance meets the triangle.
    Beside,
    /// The triangle is met, at another length.
    Length,
    /// A nearer triangle, or any, was missed.
    Missed,
}

/// Triangles in 64 bits, in the order in which the device numbers them.
struct Truth {
    triangles: Vec<[DVec3; 3]>,
    bvh: Bvh2,
    middle: DVec3,
    reach: f64,
}

impl Truth {
    fn new(triangles: Vec<[DVec3; 3]>, middle: DVec3) -> Self {
        let corners = triangles.iter().flatten();
        let reach = corners.map(|x| x.distance(middle)).fold(0.0, f64::max);
        // Different growths: equal boxes take obvhs quadratic time.
        let boxes: Vec<Aabb> = (triangles.iter().enumerate())
            .map(|(i, triangle)| {
                let tight = Aabb::from_points(&triangle.map(|x| Vec3A::from(x.as_vec3())));
                let growth = 1e-5 * reach as f32 * (1.0 + (i * 7919 % 1009) as f32 / 1009.0);
                Aabb::new(tight.min - growth, tight.max + growth)
            })
            .collect();
        let bvh = build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Duration::default());
        Self { triangles, bvh, middle, reach }
    }

    /// Distance, m, by which the device may displace a ray, from rounding to `UNIT`, relative.
    ///
    /// *Into the mesh's space.* The difference of two places that are P from the world's origin and D apart
    /// rounds by P + D; the quaternion and the two cross products that rotate by it by 14 of the length, once
    /// of the place and once of the direction along D; scaling and starting at the middle by 8. With the
    /// square root of three components at worst that is below 40 (P + D).
    ///
    /// *Across the ray.* Corners are then within 3 R, the reach; shearing them rounds by 7 each, of both
    /// components 10; and rays within 17 of an edge (`ON_EDGE`) hit it. That is 3 (10 + 17) R, and 19 R are
    /// left for the lengths, whose error moves the hit along the ray.
    fn displacement(&self, o: DVec3) -> f64 {
        let away = self.middle.length() + o.distance(self.middle);
        UNIT * (40.0 * away + 100.0 * self.reach)
    }

    /// How much further the length to a triangle may be off than the ray is displaced, m. The displacement
    /// grows by 1 / cos θ, and the plane is tilted by the normal's rounding: a product of two edges, 8 of the
    /// product of their lengths, relative to twice the area. No further than the triangle is long.
    fn length_error(&self, d: DVec3, corners: [DVec3; 3], displacement: f64) -> f64 {
        let mut edges = [corners[1] - corners[0], corners[2] - corners[1], corners[0] - corners[2]];
        edges.sort_by(|a, b| a.length().total_cmp(&b.length()));
        let n = edges[0].cross(edges[1]);
        let [short, middle, long] = edges.map(DVec3::length);
        let tilt = 8.0 * UNIT * short * middle * long / n.length();
        let cos_theta = n.dot(d).abs() / (n.length() * d.length());
        ((displacement + tilt) / cos_theta).min(long)
    }

    /// Judges a result: the length along the ray and the triangle, or neither.
    fn judge(&self, o: DVec3, d: DVec3, hit: Option<(f64, usize)>) -> Result<(), Wrong> {
        let displacement = self.displacement(o);
        if let Some((t, triangle)) = hit {
            let corners = self.triangles[triangle];
            if line_distance(o, d, corners) > displacement {
                return Err(Wrong::Beside);
            }
            let along = displacement + self.length_error(d, corners, displacement);
            if point_distance(o + t * d, corners) > along {
                return Err(Wrong::Length);
            }
        }
        let t = hit.map_or(f64::INFINITY, |(t, _)| t);
        let nearer = |triangle: &[DVec3; 3]| {
            let Some((at, inner)) = crossing(o, d, *triangle) else { return false };
            let error = displacement + self.length_error(d, *triangle, displacement);
            inner > displacement && at > error && at + error < t
        };
        if self.along(o, d, displacement).any(|i| nearer(&self.triangles[i])) {
            return Err(Wrong::Missed);
        }
        Ok(())
    }

    /// The triangles of all leaves within a distance of the ray's line.
    fn along(&self, o: DVec3, d: DVec3, within: f64) -> impl Iterator<Item = usize> {
        let nodes = &self.bvh.nodes;
        let mut rest = vec![0usize];
        let mut found = Vec::new();
        while let Some(i) = rest.pop() {
            let to = |x: Vec3A, grown: f64| Vec3::from(x).as_dvec3() + grown - o;
            let (low, high) = (to(nodes[i].aabb.min, -within), to(nodes[i].aabb.max, within));
            let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
            for axis in 0..3 {
                // 0/0, on a side of the box, leaves both as they are.
                let (a, b) = (low[axis] / d[axis], high[axis] / d[axis]);
                (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
            }
            if enter > leave {
                continue;
            }
            let first = nodes[i].first_index as usize;
            if nodes[i].is_leaf() {
                found.extend(first..first + nodes[i].prim_count as usize);
            } else {
                rest.extend([first, first + 1]);
            }
        }
        found.into_iter().map(|i| self.bvh.primitive_indices[i] as usize)
    }

    /// obvhs' own result, in 32 bits.
    fn by_obvhs(&self, o: DVec3, d: DVec3) -> Option<(f64, usize)> {
        let triangle = |i: usize| self.triangles[self.bvh.primitive_indices[i] as usize];
        let mut hit = RayHit::none();
        let ray = Ray::new_inf(o.as_vec3a(), d.as_vec3a());
        self.bvh.ray_traverse(ray, &mut hit, |ray, i| {
            let [v0, v1, v2] = triangle(i).map(DVec3::as_vec3a);
            Triangle { v0, v1, v2 }.intersect(ray)
        });
        let place = self.bvh.primitive_indices.get(hit.primitive_id as usize);
        place.map(|&i| (hit.t.into(), i as usize))
    }
}

/// Where a line crosses a triangle's plane, in lengths of `d`, and how far within its edges as seen along the
/// line, m: negative outside.
fn crossing(o: DVec3, d: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f64, f64)> {
    let n = (b - a).cross(c - a);
    let t = (a - o).dot(n) / n.dot(d);
    let towards = d.normalize();
    let across = |x: DVec3| x - x.dot(towards) * towards;
    let beyond = |a: DVec3, b: DVec3| {
        let edge = across(b - a);
        edge.cross(across(o - a)).dot(towards) / edge.length()
    };
    let sides = [beyond(a, b), beyond(b, c), beyond(c, a)];
    let inner = sides.map(|side| side * n.dot(d).signum());
    let finite = t.is_finite() && inner.iter().all(|x| x.is_finite());
    finite.then(|| (t, inner.into_iter().fold(f64::INFINITY, f64::min)))
}

/// Distance of a line from a triangle.
fn line_distance(o: DVec3, d: DVec3, corners: [DVec3; 3]) -> f64 {
    if crossing(o, d, corners).is_some_and(|(_, inner)| inner >= 0.0) {
        return 0.0;
    }
    let towards = d.normalize();
    let seen = corners.map(|x| (x - o) - (x - o).dot(towards) * towards);
    border_distance(DVec3::ZERO, seen)
}

fn point_distance(x: DVec3, corners: [DVec3; 3]) -> f64 {
    let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let above = crossing(x, n, corners).filter(|&(_, inner)| inner >= 0.0);
    above.map_or_else(|| border_distance(x, corners), |(t, _)| t.abs() * n.length())
}

fn border_distance(x: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let to = |a: DVec3, b: DVec3| {
        let along = (x - a).dot(b - a) / (b - a).length_squared();
        let along = if along.is_finite() { along.clamp(0.0, 1.0) } else { 0.0 };
        x.distance(a.lerp(b, along))
    };
    to(a, b).min(to(b, c)).min(to(c, a))
}

/// A box of `12 n²` triangles whose corners are on round numbers.
fn grid(n: u32) -> MeshData {
    let mut data = MeshData::default();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let first = data.positions.len() as u32;
            for (j, i) in (0..=n).flat_map(|j| (0..=n).map(move |i| (j, i))) {
                let at = |i: u32| 2.0 * f64::from(i) / f64::from(n) - 1.0;
                let mut x = DVec3::splat(side);
                (x[(axis + 1) % 3], x[(axis + 2) % 3]) = (at(i), at(j));
                data.positions.push(x);
            }
            for (j, i) in (0..n).flat_map(|j| (0..n).map(move |i| (j, i))) {
                let at = |di: u32, dj: u32| first + (j + dj) * (n + 1) + i + di;
                let (a, b, c, d) = (at(0, 0), at(1, 0), at(1, 1), at(0, 1));
                let outwards = [[a, b, c], [a, c, d]];
                let turned = |[a, b, c]: [u32; 3]| if side > 0.0 { [a, b, c] } else { [a, c, b] };
                data.triangles.extend(outwards.map(turned));
            }
        }
    }
    data
}

/// Needles from any of their corners, slivers that are flat to the last digits, tiny triangles, many in one
/// place and a fan in one plane.
fn degenerate(count: u32) -> MeshData {
    let mut data = MeshData::default();
    let mut random = Random(33);
    for i in 0..count {
        let a = random.direction() * random.unit();
        let thin = random.magnitude(1e-7, 1e-2);
        let (b, long) = (a + random.direction(), a + 2.0 * random.direction());
        let mut corners = match i % 6 {
            0 => [a, long, a + thin * random.direction()],
            1 => [a, b, a.lerp(b, random.unit()) + thin * random.direction()],
            2 => [DVec3::ZERO, DVec3::X, DVec3::Y],
            3 => [a, a + thin * random.direction(), a + thin * random.direction()],
            4 => [DVec3::NEG_Z, long.with_z(-1.0), b.with_z(-1.0)],
            _ => [a, b, a],
        };
        corners.rotate_left(i as usize / 6 % 3);
        data.positions.extend(corners);
        data.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    data
}

/// Random rays, and rays at what is hard: edges, corners, planes of triangles and the sides of boxes, from
/// everywhere and from 10³ and 10⁴ radii away.
fn rays(truth: &Truth, count: usize, seed: u64) -> Vec<[f32; 6]> {
    let mut random = Random(seed);
    let Truth { triangles, middle, reach, .. } = truth;
    let one = |i: usize| {
        let away = [0.0, 0.4, 1.3, 10.0, 1e3, 1e4][i % 6] * reach;
        let mut o = *middle + away * random.direction();
        let mut corner = [0, 1, 2];
        corner.rotate_left(i % 3);
        let of = (random.unit() * triangles.len() as f64) as usize;
        let [a, b, c] = corner.map(|k| triangles[of][k]);
        let (s, t) = (random.unit(), random.unit());
        let inside = a.lerp(b, s).lerp(c, t);
        let aim = match i % 11 {
            0 => *middle + reach * random.unit() * random.direction(),
            1 => o + random.direction(),
            2 => a,
            3 => a.lerp(b, s),
            4 => inside,
            // A little beside an edge.
            5 => a.lerp(b, s) + reach * random.magnitude(1e-8, 1e-4) * random.direction(),
            // From the surface, along it, and away from it.
            6 => {
                o = if i.is_multiple_of(2) { inside } else { a };
                [o + random.direction(), c, c + (b - a)][i % 3]
            }
            // In the triangle's plane, beside it and across it.
            7 => {
                let in_plane =
                    (b - a) * random.range(-1.0, 1.0) + (c - a) * random.range(-1.0, 1.0);
                o = inside + in_plane.normalize_or_zero() * away;
                if i.is_multiple_of(2) { o + in_plane } else { a.lerp(b, random.range(-1.0, 2.0)) }
            }
            // Along the axes, through corners and edges.
            8 => {
                let axis = DVec3::AXES[i / 11 % 3] * [1.0, -1.0][i / 33 % 2];
                o = [a, a.lerp(b, 0.5), inside][i / 66 % 3] - away.max(0.1 * reach) * axis;
                o + axis
            }
            // With one component of 0.
            9 => {
                o[i / 11 % 3] = a[i / 11 % 3];
                a
            }
            // Along an edge.
            _ => {
                o = a - (b - a).normalize_or(DVec3::X) * away;
                b
            }
        };
        let d = (aim - o).normalize_or(DVec3::Y);
        let zeros =
            DMat3::from_diagonal(DVec3::from(d.to_array().map(|x| f64::from(x.abs() > 1e-15))));
        case(&[&o.to_array(), &(zeros * d).to_array()])
    };
    (0..count).map(one).collect()
}

/// Numbers of rays that the truth refuses, of the device and of obvhs.
fn wrong(truth: &Truth, rays: &[[f32; 6]], results: &[[f32; 5]]) -> (usize, usize) {
    let judged = rays.par_iter().zip(results).map(|(ray, result)| {
        let (o, d) = (vec3(&ray[..3]), vec3(&ray[3..]));
        let t = f64::from(result[0]);
        let hit = (t < NOTHING).then_some((t, result[1] as usize));
        // Negative if the search for any hit and that for the nearest disagree.
        let ours = if t < 0.0 { Err(Wrong::Missed) } else { truth.judge(o, d, hit) };
        if let Err(wrong) = ours {
            eprintln!("{wrong:?}: {result:?} from {o} along {d}");
        }
        let theirs = truth.judge(o, d, truth.by_obvhs(o, d));
        (usize::from(ours.is_err()), usize::from(theirs.is_err()))
    });
    judged.reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1))
}

fn truth_of(uploaded: &Uploaded) -> Truth {
    let middle = uploaded.placement.world_from_mesh(uploaded.mesh.origin());
    Truth::new(uploaded.triangles(), middle)
}

/// No ray hits what is not there, misses what is there or measures it wrongly, beyond what rounding explains.
#[test]
fn hostile_rays_meet_the_triangles() {
    let Some(gpu) = gpu() else { return };
    let count = env::var("LIMPID_RAYS").map_or(60_000, |n| n.parse().expect("a number of rays"));
    let placement = Placement {
        translate: DVec3::new(0.3, -1.2, 2.0),
        rotate: DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -0.4, 2.1),
        scale: 0.37,
    };
    let subjects = [
        ("ball", ball(16), placement),
        ("100,000 triangles", ball(224), Placement::default()),
        ("grid", grid(8), Placement::default()),
        ("turned grid", grid(3), placement),
        ("degenerate", degenerate(600), Placement::default()),
    ];
    let mut found = 0;
    for (seed, (name, data, placement)) in (51..).zip(subjects) {
        let uploaded = uploaded(gpu, data, placement);
        let truth = truth_of(&uploaded);
        let rays = rays(&truth, count / 5, seed);
        let results = uploaded.traced(gpu, &rays);
        let hits = results.iter().filter(|result| f64::from(result[0]) < NOTHING).count();
        let (ours, theirs) = wrong(&truth, &rays, &results);
        let rays = rays.len();
        println!(
            "{name}: {rays} rays, {hits} hits, {ours} wrong; obvhs in 32 bits: {theirs} wrong"
        );
        assert!(hits > rays / 10, "{name}: {hits} hits");
        found += ours;
    }
    assert_eq!(found, 0);
}

/// The judge notices one triangle that is moved by a thousandth of the mesh, and one that is missing.
#[test]
fn a_moved_triangle_is_noticed() {
    let Some(gpu) = gpu() else { return };
    let uploaded = uploaded(gpu, ball(8), Placement::default());
    let truth = truth_of(&uploaded);
    let rays = rays(&truth, 5000, 61);
    let results = uploaded.traced(gpu, &rays);
    assert_eq!(wrong(&truth, &rays, &results).0, 0);
    let changed = |by: DVec3, scale: f64| {
        let mut triangles = uploaded.triangles();
        let middle = triangles[20].into_iter().sum::<DVec3>() / 3.0;
        triangles[20] = triangles[20].map(|x| middle + scale * (x - middle) + by);
        wrong(&Truth::new(triangles, truth.middle), &rays, &results).0
    };
    let [a, b, c] = uploaded.triangles()[20];
    let n = (b - a).cross(c - a).normalize();
    let (moved, gone) = (changed(1e-3 * n, 1.0), changed(DVec3::ZERO, 1e-3));
    assert!(moved > 5 && gone > 5, "{moved} and {gone} noticed");
}
