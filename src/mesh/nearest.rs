//! The point of a mesh nearest to a point, and the side that the point is on.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use obvhs::bvh2::node::Bvh2Node;

use super::{Mesh, corners};

/// The point of a mesh nearest to a given point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// The point.
    pub point: DVec3,
    /// Distance; negative if the given point is behind the surface: inside a closed mesh.
    pub distance: f64,
    /// Unit normal of the triangle there, or, on an edge or a corner, away from the point behind or
    /// towards the point in front.
    pub normal: DVec3,
    /// Whether the point lies on the rim of an open mesh.
    pub on_rim: bool,
    /// Index of the triangle.
    pub triangle: usize,
}

/// Normals that decide the side of a point whose nearest point lies on an edge or a corner: those of the
/// adjacent triangles, summed, at a corner weighted by angle (Bærentzen and Aanæs 2005).
#[derive(Debug, Clone)]
pub(super) struct Features {
    /// For each triangle, whether its edges from corner 0, 1 and 2 are on the rim, as bits.
    rims: Vec<u8>,
    /// For each triangle, the sums at its edges from corner 0, 1 and 2.
    edges: Vec<[Vec3; 3]>,
    /// The sum at each vertex.
    corners: Vec<Vec3>,
}

impl Features {
    pub(super) fn new(vertices: &[Vec3], triangles: &[[u32; 3]], welded: &[u32]) -> Self {
        let mut edge_sums: HashMap<(u32, u32), (DVec3, u32)> = HashMap::new();
        let mut corner_sums = vec![DVec3::ZERO; vertices.len()];
        for triangle in triangles {
            let places = corners(vertices, triangle);
            let normal = (places[1] - places[0]).cross(places[2] - places[0]).normalize_or_zero();
            for i in 0..3 {
                let edge = edge_sums.entry(edge_of(triangle, i, welded)).or_default();
                *edge = (edge.0 + normal, edge.1 + 1);
                let (next, last) = (places[(i + 1) % 3], places[(i + 2) % 3]);
                let angle = (next - places[i]).angle_between(last - places[i]);
                let angle = if angle.is_finite() { angle } else { 0.0 };
                corner_sums[welded[triangle[i] as usize] as usize] += angle * normal;
            }
        }
        let of = |triangle: &[u32; 3]| [0, 1, 2].map(|i| edge_sums[&edge_of(triangle, i, welded)]);
        let rim = |triangle: &[u32; 3]| {
            let [a, b, c] = of(triangle).map(|(_, count)| u8::from(count == 1));
            a | b << 1 | c << 2
        };
        Self {
            rims: triangles.iter().map(rim).collect(),
            edges: triangles.iter().map(|t| of(t).map(|(sum, _)| sum.as_vec3())).collect(),
            corners: welded.iter().map(|&i| corner_sums[i as usize].as_vec3()).collect(),
        }
    }
}

impl Features {
    /// Unit normals of the vertices, 0 where triangles cancel.
    pub(super) fn corner_normals(&self) -> Vec<Vec3> {
        self.corners.iter().map(|n| n.normalize_or_zero()).collect()
    }
}

/// The welded ends of a triangle's edge from corner `i`.
fn edge_of(triangle: &[u32; 3], i: usize, welded: &[u32]) -> (u32, u32) {
    let [a, b] = [triangle[i], triangle[(i + 1) % 3]].map(|i| welded[i as usize]);
    (a.min(b), a.max(b))
}

/// Part of a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Part {
    Face,
    /// From corner i to the next.
    Edge(usize),
    Corner(usize),
}

impl Mesh {
    /// The point of the mesh nearest to `x` (from [`Mesh::origin`]), if it is within `limit`.
    pub fn nearest(&self, x: DVec3, limit: f64) -> Option<Nearest> {
        let mut found: Option<(usize, Part, DVec3)> = None;
        // Boxes are in 32 bits.
        let slack = 1.0 + 1e-6;
        let mut least = limit * limit;
        let mut rest = vec![0usize];
        let nodes = self.nodes();
        let far = |node: &Bvh2Node| {
            let (min, max) = (Vec3::from(node.aabb.min), Vec3::from(node.aabb.max));
            x.distance_squared(x.clamp(min.as_dvec3(), max.as_dvec3()))
        };
        while let Some(index) = rest.pop() {
            let node = &nodes[index];
            if far(node) > least * slack {
                continue;
            }
            let first = node.first_index as usize;
            if !node.is_leaf() {
                let nearer = far(&nodes[first]) <= far(&nodes[first + 1]);
                rest.extend(if nearer { [first + 1, first] } else { [first, first + 1] });
                continue;
            }
            for triangle in first..first + node.prim_count as usize {
                let (part, point) =
                    nearest_of(x, corners(&self.vertices, &self.triangles[triangle]));
                let distance2 = x.distance_squared(point);
                if distance2 <= least {
                    least = distance2;
                    found = Some((triangle, part, point));
                }
            }
        }
        let (triangle, part, point) = found?;
        Some(self.beside(x, triangle, part, point))
    }

    fn beside(&self, x: DVec3, triangle: usize, part: Part, point: DVec3) -> Nearest {
        let [a, b, c] = corners(&self.vertices, &self.triangles[triangle]);
        let face = (b - a).cross(c - a).normalize_or(DVec3::Y);
        let rims = self.features.rims[triangle];
        let (sum, on_rim) = match part {
            Part::Face => (face, false),
            Part::Edge(i) => (self.features.edges[triangle][i].as_dvec3(), rims >> i & 1 == 1),
            Part::Corner(i) => {
                let sum = self.features.corners[self.triangles[triangle][i] as usize].as_dvec3();
                (sum, rims >> i & 1 == 1 || rims >> ((i + 2) % 3) & 1 == 1)
            }
        };
        let offset = x - point;
        let length = offset.length();
        let behind = offset.dot(sum) < 0.0;
        // On the surface the offset has no direction.
        let on_surface = length <= 1e-9 * (1.0 + x.abs().max_element());
        let normal = match (part, on_surface, behind) {
            (Part::Face, _, _) => face,
            (_, true, _) => sum.normalize_or(face),
            (_, _, true) => -offset / length,
            (_, _, false) => offset / length,
        };
        Nearest { point, distance: if behind { -length } else { length }, normal, on_rim, triangle }
    }
}

/// The point of a triangle nearest to `x`, and the part that it lies on (Ericson 2005, section 5.1.5).
fn nearest_of(x: DVec3, [a, b, c]: [DVec3; 3]) -> (Part, DVec3) {
    let (ab, ac) = (b - a, c - a);
    let ax = x - a;
    let (d1, d2) = (ab.dot(ax), ac.dot(ax));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (Part::Corner(0), a);
    }
    let bx = x - b;
    let (d3, d4) = (ab.dot(bx), ac.dot(bx));
    if d3 >= 0.0 && d4 <= d3 {
        return (Part::Corner(1), b);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (Part::Edge(0), a + d1 / (d1 - d3) * ab);
    }
    let cx = x - c;
    let (d5, d6) = (ab.dot(cx), ac.dot(cx));
    if d6 >= 0.0 && d5 <= d6 {
        return (Part::Corner(2), c);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (Part::Edge(2), a + d2 / (d2 - d6) * ac);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let along = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return (Part::Edge(1), b + along * (c - b));
    }
    let inverse = 1.0 / (va + vb + vc);
    (Part::Face, a + vb * inverse * ab + vc * inverse * ac)
}
