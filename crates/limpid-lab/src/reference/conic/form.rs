//! The points of a triangle that refract light in the plane of a receiver and a light: a conic, and walks along it.

use glam::{BVec2, DMat2, DVec2, DVec3};

/// The points of a triangle p, q, r that are coplanar with their normal, a receiver and a light:
/// the zeros of a quadratic form K of barycentric coordinates b, `Σ b_i b_j K_ij`.
///
/// Below, a point (x, y) has the coordinates x of q and y of r.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conic {
    /// `K_pp`, `K_qq`, `K_rr`.
    pub vertices: [f64; 3],
    /// `K_pq`, `K_pr`, `K_qr`.
    pub edges: [f64; 3],
}

/// The ends of an edge in the order of [`Conic::edges`], and the vertex opposite.
pub(super) const EDGES: [[usize; 3]; 3] = [[0, 1, 2], [0, 2, 1], [1, 2, 0]];

/// Where a conic crosses an edge of its triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EdgeCrossing {
    pub(super) edge: usize,
    /// From the edge's first end to its second, 0 to 1.
    pub(super) s: f64,
    /// Whether the form rises from negative to positive along the edge.
    pub(super) rising: bool,
}

impl EdgeCrossing {
    pub(super) fn point(&self) -> DVec2 {
        match self.edge {
            0 => DVec2::new(self.s, 0.0),
            1 => DVec2::new(0.0, self.s),
            _ => DVec2::new(1.0 - self.s, self.s),
        }
    }
}

impl Conic {
    /// Creates the conic of a triangle for a receiver at the origin and a light in direction
    /// `light`.
    pub fn new(light: DVec3, positions: [DVec3; 3], normals: [DVec3; 3]) -> Self {
        let moments = positions.map(|x| light.cross(x));
        let vertices = [0, 1, 2].map(|i| normals[i].dot(moments[i]));
        let mixed =
            |a: usize, b: usize| 0.5 * (normals[a].dot(moments[b]) + normals[b].dot(moments[a]));
        Self { vertices, edges: EDGES.map(|[a, b, _]| mixed(a, b)) }
    }

    /// Returns the coefficients A to F of A x² + B y² + C x y + D x + E y + F, the paper's equation
    /// 12.
    pub fn coefficients(&self) -> [f64; 6] {
        let [p, q, r] = self.vertices;
        let [pq, pr, qr] = self.edges;
        [
            p + q - 2.0 * pq,
            p + r - 2.0 * pr,
            2.0 * (p + qr - pq - pr),
            2.0 * (pq - p),
            2.0 * (pr - p),
            p,
        ]
    }

    /// Finds its crossings of an edge, p–q, p–r or q–r for 0 to 2, in ascending order, each 0 to 1
    /// from the edge's first end. A tangent edge is not crossed.
    pub fn edge_roots(&self, edge: usize) -> [Option<f64>; 2] {
        let [rising, falling] = [true, false].map(|rising| self.crossing(edge, rising));
        match (rising.map(|c| c.s), falling.map(|c| c.s)) {
            (Some(a), Some(b)) => [Some(a.min(b)), Some(a.max(b))],
            (a, b) => [a.or(b), None],
        }
    }

    /// Finds where the form rises, or falls, through 0 along an edge; a zero at a vertex counts as
    /// positive. There is at most one of each.
    pub(super) fn crossing(&self, edge: usize, rising: bool) -> Option<EdgeCrossing> {
        let [from, to, _] = EDGES[edge];
        let s = edge_crossing(self.vertices[from], self.edges[edge], self.vertices[to], rising)?;
        Some(EdgeCrossing { edge, s, rising })
    }

    fn polar(&self, a: DVec2, b: DVec2) -> f64 {
        barycentric(a).dot(self.times(barycentric(b)))
    }

    fn times(&self, b: DVec3) -> DVec3 {
        let [p, q, r] = self.vertices;
        let [pq, pr, qr] = self.edges;
        DVec3::new(
            p * b.x + pq * b.y + pr * b.z,
            pq * b.x + q * b.y + qr * b.z,
            pr * b.x + qr * b.y + r * b.z,
        )
    }

    fn value(&self, x: DVec2) -> f64 {
        self.polar(x, x)
    }

    pub(super) fn gradient(&self, x: DVec2) -> DVec2 {
        let k = self.times(barycentric(x));
        2.0 * DVec2::new(k.y - k.x, k.z - k.x)
    }

    /// The quadratic part of the form.
    fn quadratic(&self, d: DVec2) -> f64 {
        let b = DVec3::new(-d.x - d.y, d.x, d.y);
        b.dot(self.times(b))
    }

    /// Finds where the arc from `x` leaves the triangle. It is followed with the positive side of
    /// the form on its right or, for `along` = -1, on its left. `None` for an arc that closes
    /// inside.
    pub(super) fn exit(&self, x: DVec2, along: f64) -> Option<EdgeCrossing> {
        // The triangle lies on the other side of p–r.
        let out = [along < 0.0, along > 0.0, along < 0.0];
        let found = [0, 1, 2].map(|edge| self.crossing(edge, out[edge]));
        let mut candidates = found.into_iter().flatten();
        let first = candidates.next()?;
        let mut best = (self.turn(x, along, &first), first);
        for way in candidates {
            let turn = self.turn(x, along, &way);
            if turn > best.0 {
                best = (turn, way);
            }
        }
        Some(best.1)
    }

    /// Cosine of the angle by which a line through `x`, rotated from the tangent in the direction
    /// in which the arc bends, reaches a crossing. Every line meets the conic once more, so this
    /// orders the crossings along the arc; those beyond infinity come later.
    fn turn(&self, x: DVec2, along: f64, crossing: &EdgeCrossing) -> f64 {
        let to = crossing.point() - x;
        let length = to.length();
        if length < 1e-9 {
            // Touches the edge that it came through, or crosses another immediately.
            return if crossing.edge == 0 && x.y == 0.0 { -2.0 } else { 2.0 };
        }
        let gradient = self.gradient(x);
        let tangent = along * gradient.perp();
        let bend = -self.quadratic(tangent).signum() * gradient;
        let behind = to.dot(bend) < -1e-9 * length * bend.length();
        let cosine = to.dot(tangent) / (length * tangent.length());
        if behind { -cosine } else { cosine }
    }

    /// A point of the arc from `a` to `b`, at about the fraction `w`.
    pub(super) fn arc_point(&self, a: DVec2, b: DVec2, along: f64, w: f64) -> DVec2 {
        let (at_a, at_b) = (self.gradient(a), self.gradient(b));
        let chord = b - a;
        let (across_a, across_b) = (at_a.normalize_or_zero(), at_b.normalize_or_zero());
        let tangent = along * across_a.perp();
        if across_a.dot(across_b) > 0.5 && tangent.dot(chord) > 0.0 {
            // Slightly curved: perpendicular to the chord. The form vanishes at both of its ends.
            let across = (across_a + across_b).normalize();
            let on = a + w * chord;
            let form = 2.0 * w * (1.0 - w) * self.polar(a, b);
            let half = 0.5 * self.gradient(on).dot(across);
            let root = (half * half - form * self.quadratic(across)).max(0.0).sqrt();
            let divisor = half + root.copysign(half);
            return if divisor == 0.0 { on } else { on - form / divisor * across };
        }
        // Strongly curved: on the line through `a` between the tangent and the chord.
        let mut line = tangent + chord.normalize_or_zero();
        if chord.length_squared() == 0.0 || line.length_squared() < 1e-12 {
            line = -self.quadratic(tangent).signum() * across_a;
        }
        let on_line = a - at_a.dot(line) / self.quadratic(line) * line;
        if on_line.is_finite() { on_line } else { a + w * chord }
    }

    /// Finds a closed conic inside the triangle, without crossings: two opposite points of it.
    pub(super) fn island(&self) -> Option<[DVec2; 2]> {
        let [a, b, c, d, e, _] = self.coefficients();
        let hessian = DMat2::from_cols(DVec2::new(2.0 * a, c), DVec2::new(c, 2.0 * b));
        if hessian.determinant() <= 0.0 {
            return None;
        }
        let centre = -(hessian.inverse() * DVec2::new(d, e));
        let inside = centre.cmpge(DVec2::ZERO) == BVec2::TRUE && centre.element_sum() <= 1.0;
        let value = self.value(centre);
        // Otherwise it encloses the triangle, or is empty.
        let within = inside && (value < 0.0) != (self.vertices[0] < 0.0);
        let radius = (-value / a).max(0.0).sqrt();
        within.then(|| [1.0, -1.0].map(|s| centre + s * radius * DVec2::X))
    }
}

pub(super) fn barycentric(x: DVec2) -> DVec3 {
    DVec3::new(1.0 - x.x - x.y, x.x, x.y)
}

/// Finds where a (1−s)² + 2 h s (1−s) + b s² rises, or falls, through 0 in 0..=1; 0 counts as
/// positive.
fn edge_crossing(a: f64, h: f64, b: f64, rising: bool) -> Option<f64> {
    let discriminant = h * h - a * b;
    if discriminant <= 0.0 && (a < 0.0) == (b < 0.0) {
        return None;
    }
    let root = discriminant.max(0.0).sqrt();
    // s / (1 − s) as v / u, by the form of the quadratic's root that avoids cancellation.
    let (exists, u, v) = match (rising, h < 0.0) {
        (true, true) => (b >= 0.0, b, root - h),
        (true, false) => (a < 0.0, root + h, -a),
        (false, true) => (a >= 0.0, root - h, a),
        (false, false) => (b < 0.0, -b, root + h),
    };
    exists.then(|| if u + v > 0.0 { v / (u + v) } else { 0.0 })
}
