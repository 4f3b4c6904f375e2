//! Rays through a mesh, in 64 bits: the thickness of solids.

use glam::{DVec3, Vec3};

use super::{Mesh, corners};

impl Mesh {
    /// The least length along o + t d at which the ray meets a triangle, between `near` and `far`. `o` counts
    /// from [`Mesh::origin`].
    pub fn hit(&self, o: DVec3, d: DVec3, near: f64, far: f64) -> Option<f64> {
        let mut least = far;
        let mut found = None;
        let mut rest = vec![0usize];
        while let Some(index) = rest.pop() {
            let node = &self.nodes()[index];
            let to = |corner: Vec3| (corner.as_dvec3() - o) / d;
            let (a, b) = (to(node.aabb.min.into()), to(node.aabb.max.into()));
            let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
            if enter > leave * (1.0 + 1e-6) + 1e-12 || leave < near || enter > least {
                continue;
            }
            let first = node.first_index as usize;
            if !node.is_leaf() {
                rest.extend([first, first + 1]);
                continue;
            }
            for triangle in &self.triangles[first..first + node.prim_count as usize] {
                let t = crossing(o, d, corners(&self.vertices, triangle));
                if let Some(t) = t.filter(|&t| t > near && t < least) {
                    least = t;
                    found = Some(t);
                }
            }
        }
        found
    }
}

/// Where a ray crosses a triangle (Möller and Trumbore 1997).
fn crossing(o: DVec3, d: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let p = d.cross(ac);
    let determinant = ab.dot(p);
    let ao = o - a;
    let q = ao.cross(ab);
    let (u, v) = (ao.dot(p) / determinant, d.dot(q) / determinant);
    let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
    inside.then(|| ac.dot(q) / determinant)
}
