//! The path from a point in the liquid through its front to a light, found by walking along the
//! curve that contains all such paths.
//!
//! After A. Granizo-Hidalgo and N. Holzschuch, Interactive Rendering of Caustics using Dimension
//! Reduction for Manifold Next-Event Estimation (I3D 2024). A point M of the surface refracts light
//! from L to P only if P, L, M and the normal at M lie in one plane: this is a conic in every
//! triangle with interpolated normals. The straight line from P to L gives a first point of it, M₀,
//! and the walk continues from triangle to triangle until Snell's law holds as well.
//!
//! Differences from the paper:
//! - The conic is kept in barycentric coordinates (Bernstein form). The form then depends at a
//!   vertex on this vertex and on an edge on its two ends only, so neighbours agree about crossings
//!   to the last bit, and the signs at the vertices alone determine how many there are: a root at a
//!   vertex is no special case.
//! - Arcs are paired by the direction in which the conic crosses an edge and, where that is
//!   ambiguous, by the order in which lines rotating about the arc's start meet the conic.
//! - Snell's law is tested by the tangential residual `g = (η ω_P + ω_L)·(m × n)`, which is defined
//!   for total reflection too. The normal m of the plane keeps its sign without being propagated:
//!   before M₀ and after it, it is ∓ PL × PM.
//! - The derivatives of the paper's equations 28 and 31 have the opposite signs, and the irradiance
//!   has an additional factor η², without which it differs from that of traced light.
//!
//! The walk finds one path per point; [`paths`] finds all, and shows what the walk misses.

use glam::{BVec2, DMat2, DVec2, DVec3, IVec2, UVec2};

use super::optics;

/// A light source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightSource {
    /// At infinity; the unit vector points towards it.
    Sun(DVec3),
    /// A point, m.
    Point(DVec3),
}

/// A vertex of the liquid's front.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vertex {
    /// The position, m.
    pub position: DVec3,
    /// The unit normal, out of the liquid, which is interpolated.
    pub normal: DVec3,
}

/// A regular grid over a light's view. Cell (i, j) has the triangles (i, j), (i+1, j), (i, j+1)
/// and (i+1, j), (i, j+1), (i+1, j+1).
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Number of cells, each at least 1.
    pub cells: UVec2,
    /// Vertices row by row, one more in each direction than cells; `None` where the light meets no
    /// liquid.
    pub vertices: Vec<Option<Vertex>>,
}

impl Grid {
    /// Creates the grid whose vertex (i, j) is `vertex(i, j)`.
    pub fn new(cells: UVec2, mut vertex: impl FnMut(UVec2) -> Option<Vertex>) -> Self {
        let vertices = (0..=cells.y).flat_map(|j| (0..=cells.x).map(move |i| UVec2::new(i, j)));
        Self { cells, vertices: vertices.map(&mut vertex).collect() }
    }

    /// Returns a vertex; `None` outside the grid too.
    pub fn vertex(&self, at: IVec2) -> Option<Vertex> {
        let inside = at.cmpge(IVec2::ZERO) & at.cmple(self.cells.as_ivec2());
        if !inside.all() {
            return None;
        }
        let at = at.as_uvec2();
        self.vertices[(at.y * (self.cells.x + 1) + at.x) as usize]
    }

    /// Finds the triangle that contains a position in units of cells, the first of two on their
    /// common edge.
    fn triangle_at(&self, at: DVec2) -> Option<[IVec2; 3]> {
        if !(at.cmpge(DVec2::ZERO) & at.cmple(self.cells.as_dvec2())).all() {
            return None;
        }
        let cell = at.floor().as_ivec2().clamp(IVec2::ZERO, self.cells.as_ivec2() - 1);
        let within = at - cell.as_dvec2();
        Some(if within.element_sum() <= 1.0 { lower(cell) } else { upper(cell) })
    }
}

fn lower(cell: IVec2) -> [IVec2; 3] {
    [cell, cell + IVec2::X, cell + IVec2::Y]
}

fn upper(cell: IVec2) -> [IVec2; 3] {
    [cell + IVec2::X, cell + IVec2::Y, cell + IVec2::ONE]
}

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
const EDGES: [[usize; 3]; 3] = [[0, 1, 2], [0, 2, 1], [1, 2, 0]];

/// Where a conic crosses an edge of its triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Crossing {
    edge: usize,
    /// From the edge's first end to its second, 0 to 1.
    s: f64,
    /// Whether the form rises from negative to positive along the edge.
    rising: bool,
}

impl Crossing {
    fn point(&self) -> DVec2 {
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
    fn crossing(&self, edge: usize, rising: bool) -> Option<Crossing> {
        let [from, to, _] = EDGES[edge];
        let s = edge_crossing(self.vertices[from], self.edges[edge], self.vertices[to], rising)?;
        Some(Crossing { edge, s, rising })
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

    fn gradient(&self, x: DVec2) -> DVec2 {
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
    fn exit(&self, x: DVec2, along: f64) -> Option<Crossing> {
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
    fn turn(&self, x: DVec2, along: f64, crossing: &Crossing) -> f64 {
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
    fn arc_point(&self, a: DVec2, b: DVec2, along: f64, w: f64) -> DVec2 {
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
    fn island(&self) -> Option<[DVec2; 2]> {
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

fn barycentric(x: DVec2) -> DVec3 {
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

/// A receiver and a light, with the index of refraction.
#[derive(Debug, Clone, Copy)]
struct Sight {
    receiver: DVec3,
    /// Unit vector from the receiver to the light.
    towards: DVec3,
    /// Distance to the light, m; `None` for a sun.
    distance: Option<f64>,
    ior: f64,
}

impl Sight {
    fn new(source: &LightSource, receiver: DVec3, ior: f64) -> Option<Self> {
        let (towards, distance) = match *source {
            LightSource::Sun(towards) => (towards.try_normalize()?, None),
            LightSource::Point(at) => {
                let to = at - receiver;
                (to.try_normalize()?, Some(to.length()))
            }
        };
        Some(Self { receiver, towards, distance, ior })
    }

    /// Returns the unit vector from a point to the light, and the distance for a point light.
    fn light_from(&self, x: DVec3) -> (DVec3, Option<f64>) {
        match self.distance {
            None => (self.towards, None),
            Some(distance) => {
                let to = distance * self.towards - x;
                (to.normalize(), Some(to.length()))
            }
        }
    }

    /// Violation of Snell's law along the surface, in the plane with normal `m`; only the side of
    /// `m` matters.
    fn residual(&self, x: DVec3, normal: DVec3, m: DVec3) -> f64 {
        let normal = normal.normalize();
        let along = m.cross(normal).normalize_or_zero();
        (self.light_from(x).0 - self.ior * x.normalize()).dot(along)
    }
}

/// A triangle of the grid, with positions relative to the receiver.
#[derive(Debug, Clone, Copy)]
struct Triangle {
    at: [IVec2; 3],
    positions: [DVec3; 3],
    normals: [DVec3; 3],
    conic: Conic,
}

impl Triangle {
    fn new(grid: &Grid, sight: &Sight, at: [IVec2; 3]) -> Option<Self> {
        let [p, q, r] = at.map(|at| grid.vertex(at));
        let vertices = [p?, q?, r?];
        let positions = vertices.map(|v| v.position - sight.receiver);
        let normals = vertices.map(|v| v.normal);
        let conic = Conic::new(sight.towards, positions, normals);
        Some(Self { at, positions, normals, conic })
    }

    /// The neighbour across a crossing: that edge in the same direction, then the new vertex.
    fn beyond(&self, grid: &Grid, sight: &Sight, crossing: &Crossing) -> Option<Self> {
        let [from, to, opposite] = EDGES[crossing.edge];
        // The two triangles of any edge of the grid form a parallelogram.
        let third = self.at[from] + self.at[to] - self.at[opposite];
        Self::new(grid, sight, [self.at[from], self.at[to], third])
    }

    fn position(&self, x: DVec2) -> DVec3 {
        interpolate(self.positions, x)
    }

    fn normal(&self, x: DVec2) -> DVec3 {
        interpolate(self.normals, x)
    }

    /// The point where the straight line to the light passes.
    fn straight(&self, sight: &Sight) -> DVec2 {
        let side = self.positions.map(|x| sight.towards.cross(x));
        let area = |a: usize, b: usize| sight.towards.dot(side[a].cross(side[b]));
        let b = DVec3::new(area(1, 2), area(2, 0), area(0, 1));
        DVec2::new(b.y, b.z) / b.element_sum()
    }

    /// Finds the point of the arc from `a` to `b` where the residual is 0, given that its signs at
    /// the ends differ.
    fn solve(&self, mut a: End, mut b: End, along: f64, residual: impl Fn(DVec2) -> f64) -> DVec2 {
        let mut last = 0;
        for _ in 0..200 {
            let w = (a.g / (a.g - b.g)).clamp(1e-3, 1.0 - 1e-3);
            let x = self.conic.arc_point(a.x, b.x, along, w);
            let end = End { x, g: residual(x) };
            if end.g.abs() < 1e-15 || a.x.distance(b.x) < 1e-15 {
                return x;
            }
            // An end kept twice in a row counts half (the Illinois rule).
            if (end.g < 0.0) == (a.g < 0.0) {
                a = end;
                b.g *= if last == 1 { 0.5 } else { 1.0 };
                last = 1;
            } else {
                b = end;
                a.g *= if last == -1 { 0.5 } else { 1.0 };
                last = -1;
            }
        }
        if a.g.abs() < b.g.abs() { a.x } else { b.x }
    }

    /// The path through a point, if light can take it.
    fn path(&self, sight: &Sight, x: DVec2) -> Option<Path> {
        if barycentric(x).min_element() < -1e-6 {
            return None;
        }
        let position = self.position(x);
        let raw = self.normal(x);
        let normal = raw.try_normalize()?;
        let [p, q, r] = self.positions;
        let (e1, e2) = (q - p, r - p);
        let plane = e1.cross(e2).try_normalize()?;
        let plane = if plane.dot(normal) < 0.0 { -plane } else { plane };
        let depth = position.length();
        let to_receiver = -position / depth;
        let (to_light, distance) = sight.light_from(position);
        let bent = sight.ior * to_receiver + to_light;
        let violated = (bent - bent.dot(normal) * normal).length();
        let inside = to_receiver.dot(normal) < 0.0 && to_receiver.dot(plane) < 0.0;
        let outside = to_light.dot(normal) > 0.0 && to_light.dot(plane) > 0.0;
        if !(inside && outside && violated < 1e-9) {
            return None;
        }

        let bend = bent.dot(normal);
        let edges = DMat2::from_cols(
            DVec2::new(e1.dot(e1), e1.dot(e2)),
            DVec2::new(e1.dot(e2), e2.dot(e2)),
        );
        let (u, v) = to_receiver.any_orthonormal_pair();
        let [du, dv] = [u, v].map(|turn| {
            let moved = -depth * (turn - turn.dot(plane) / to_receiver.dot(plane) * to_receiver);
            let step = edges.inverse() * DVec2::new(e1.dot(moved), e2.dot(moved));
            let tilted = step.x * (self.normals[1] - self.normals[0])
                + step.y * (self.normals[2] - self.normals[0]);
            let tilted = (tilted - tilted.dot(normal) * normal) / raw.length();
            let ratio = to_receiver.dot(normal) / to_light.dot(normal);
            let bending = (sight.ior * sight.ior * ratio + sight.ior)
                * (turn.dot(normal) + to_receiver.dot(tilted));
            let light = -sight.ior * turn + bending * normal + bend * tilted;
            match distance {
                None => light,
                Some(distance) => moved - moved.dot(to_light) * to_light + distance * light,
            }
        });
        Some(Path {
            position: sight.receiver + position,
            normal,
            to_receiver,
            to_light,
            depth,
            spread: du.cross(dv).length(),
            ior: sight.ior,
            straight: sight.distance.map_or(1.0, |d| d * d),
            steps: 0,
        })
    }
}

fn interpolate(values: [DVec3; 3], x: DVec2) -> DVec3 {
    values[0] + x.x * (values[1] - values[0]) + x.y * (values[2] - values[0])
}

/// An end of an arc, with its residual.
#[derive(Clone, Copy)]
struct End {
    x: DVec2,
    g: f64,
}

/// A light path from a source through the liquid's front to a receiver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Path {
    /// The point where it enters the liquid, m.
    pub position: DVec3,
    /// The interpolated unit normal there, out of the liquid.
    pub normal: DVec3,
    /// The unit vector from there to the receiver.
    pub to_receiver: DVec3,
    /// The unit vector from there to the light.
    pub to_light: DVec3,
    /// Length inside the liquid, m.
    pub depth: f64,
    /// The spread D of a beam from the receiver: m²/sr at a point light, dimensionless at a sun,
    /// where it is a ratio of solid angles.
    pub spread: f64,
    /// Number of triangles walked through to find it.
    pub steps: u32,
    ior: f64,
    straight: f64,
}

impl Path {
    /// Irradiance perpendicular to the ray at the receiver over that of straight light, before
    /// reflection and absorption: η²/D times the squared distance to a point light. Infinite on a
    /// caustic.
    pub fn magnification(&self) -> f64 {
        self.ior * self.ior * self.straight / self.spread
    }

    /// Irradiance on a receiver with unit `normal`, W/m².
    ///
    /// `power` is a point light's intensity in W/sr, or a sun's irradiance in W/m². The
    /// magnification is clamped to `most`.
    pub fn irradiance(&self, power: DVec3, absorption: DVec3, normal: DVec3, most: f64) -> DVec3 {
        let transmitted = 1.0 - optics::fresnel(self.to_light.dot(self.normal), self.ior);
        let focus = self.magnification().min(most) / self.straight;
        let cosine = self.to_receiver.dot(normal).abs();
        power * (transmitted * focus * cosine) * optics::transmittance(absorption, self.depth)
    }
}

/// Finds the first path by a walk along the curve, at most `steps` triangles in each direction.
///
/// `at` is the receiver's position in the light's view, in units of the grid's cells. `ior` is the
/// liquid's index over that outside. `None` if the curve ends, at the edge of the grid or of the
/// liquid, without a path, and for a receiver without liquid above it.
pub fn walk(
    grid: &Grid,
    source: &LightSource,
    ior: f64,
    receiver: DVec3,
    at: DVec2,
    steps: u32,
) -> Option<Path> {
    let sight = Sight::new(source, receiver, ior)?;
    let (start, x) = start(grid, &sight, at)?;
    // Light along the normal is not refracted.
    if let Some(path) = start.path(&sight, x) {
        return Some(path);
    }
    let tangent = start.conic.gradient(x).perp();
    let tangent = tangent.x * (start.positions[1] - start.positions[0])
        + tangent.y * (start.positions[2] - start.positions[0]);
    let forward = sight.towards.cross(tangent.normalize_or_zero());
    let begin = End { x, g: sight.residual(start.position(x), start.normal(x), forward) };
    // Near its start the walk uses the plane of the start: rounding may put a first exit before it.
    let residual = |triangle: &Triangle, x: DVec2, way: f64| {
        let position = triangle.position(x);
        let m = way * sight.towards.cross(position) / position.length() + 1e-6 * forward;
        sight.residual(position, triangle.normal(x), m)
    };

    let mut candidates: Vec<(f64, Crossing, End)> = [1.0, -1.0]
        .into_iter()
        .filter_map(|way| {
            let exit = start.conic.exit(x, way)?;
            let x = exit.point();
            Some((way, exit, End { x, g: residual(&start, x, way) }))
        })
        .collect();
    if candidates.is_empty() {
        // The whole curve is in this triangle; after one turn the plane's normal is reversed.
        let opposite = start.conic.arc_point(x, x, 1.0, 0.5);
        let half = End { x: opposite, g: residual(&start, opposite, 1.0) };
        let end = End { x, g: -begin.g };
        let (a, b) = if half.g * begin.g <= 0.0 { (begin, half) } else { (half, end) };
        return start.path(&sight, start.solve(a, b, 1.0, |x| residual(&start, x, 1.0)));
    }
    // First the direction in which the residual falls more, or already changes sign.
    candidates.sort_by(|a, b| (a.2.g * begin.g.signum()).total_cmp(&(b.2.g * begin.g.signum())));
    for (way, mut exit, mut b) in candidates {
        let (mut triangle, mut a, mut along) = (start, begin, way);
        for step in 0..=steps {
            if (a.g < 0.0) != (b.g < 0.0) {
                let root = triangle.solve(a, b, along, |x| residual(&triangle, x, way));
                if let Some(path) = triangle.path(&sight, root) {
                    return Some(Path { steps: step, ..path });
                }
            }
            let Some(next) = triangle.beyond(grid, &sight, &exit) else { break };
            along = if exit.rising { 1.0 } else { -1.0 };
            a = End { x: DVec2::new(exit.s, 0.0), g: b.g };
            triangle = next;
            let Some(ahead) = triangle.conic.exit(a.x, along) else { break };
            exit = ahead;
            b = End { x: exit.point(), g: residual(&triangle, exit.point(), way) };
        }
    }
    None
}

/// Offsets towards all triangles around a vertex, in cells; the first is zero.
const NUDGES: [DVec2; 7] = [
    DVec2::ZERO,
    DVec2::new(1e-6, 1e-6),
    DVec2::new(2e-6, -1e-6),
    DVec2::new(1e-6, -2e-6),
    DVec2::new(-1e-6, -1e-6),
    DVec2::new(-2e-6, 1e-6),
    DVec2::new(-1e-6, 2e-6),
];

/// Finds the triangle in which the walk starts, and the point. Of the triangles that meet there, it
/// chooses one that the curve enters.
fn start(grid: &Grid, sight: &Sight, at: DVec2) -> Option<(Triangle, DVec2)> {
    let mut first = None;
    for nudge in NUDGES {
        let Some(at) = grid.triangle_at(at + nudge) else { continue };
        let Some(triangle) = Triangle::new(grid, sight, at) else { continue };
        let x = triangle.straight(sight);
        if !x.is_finite() {
            continue;
        }
        let near = |way: f64| {
            triangle.conic.exit(x, way).is_some_and(|exit| exit.point().distance(x) < 1e-6)
        };
        // Where the curve only cuts off a corner, it has no direction to follow.
        if barycentric(x).min_element() > 1e-9 || near(1.0) != near(-1.0) {
            return Some((triangle, x));
        }
        first = first.or(Some((triangle, x)));
    }
    first
}

/// Finds all paths through the grid, including those that the walk does not reach.
pub fn paths(grid: &Grid, source: &LightSource, ior: f64, receiver: DVec3) -> Vec<Path> {
    let Some(sight) = Sight::new(source, receiver, ior) else { return Vec::new() };
    let cells = grid.cells.as_ivec2();
    let cells = (0..cells.y).flat_map(|j| (0..cells.x).map(move |i| IVec2::new(i, j)));
    cells
        .flat_map(|cell| [lower(cell), upper(cell)])
        .filter_map(|at| Triangle::new(grid, &sight, at))
        .flat_map(|triangle| triangle_paths(&triangle, &sight))
        .collect()
}

/// Levels of bisection of an arc, in case it has several roots.
const BISECTIONS: u32 = 4;

fn triangle_paths(triangle: &Triangle, sight: &Sight) -> Vec<Path> {
    let conic = &triangle.conic;
    // Every arc once, from its entry.
    let entries = [true, false, true];
    let mut arcs: Vec<_> = (0..3)
        .filter_map(|edge| conic.crossing(edge, entries[edge]))
        .filter_map(|entry| {
            let from = entry.point();
            Some((from, conic.exit(from, 1.0)?.point()))
        })
        .collect();
    if arcs.is_empty() {
        arcs.extend(conic.island().into_iter().flat_map(|[a, b]| [(a, b), (b, a)]));
    }
    // The plane's normal from the better conditioned of two cross products, on the side of `m`.
    let plane = |x: DVec2, m: DVec3| {
        let by_normal = sight.towards.cross(triangle.normal(x).normalize_or_zero());
        let by_position = sight.towards.cross(triangle.position(x).normalize_or_zero());
        let longer = by_normal.length_squared() > by_position.length_squared();
        let normal = if longer { by_normal } else { by_position }.normalize_or_zero();
        if normal.dot(m) < 0.0 { -normal } else { normal }
    };
    let residual = |x: DVec2, m: DVec3| sight.residual(triangle.position(x), triangle.normal(x), m);
    let mut found: Vec<Path> = Vec::new();
    for (from, to) in arcs {
        let mut points = vec![from, to];
        for _ in 0..BISECTIONS {
            let refined: Vec<_> = points
                .windows(2)
                .flat_map(|ends| [ends[0], conic.arc_point(ends[0], ends[1], 1.0, 0.5)])
                .collect();
            points = refined;
            points.push(to);
        }
        let mut m = plane(from, DVec3::ZERO);
        for ends in points.windows(2) {
            let next_m = plane(ends[1], m);
            let a = End { x: ends[0], g: residual(ends[0], m) };
            let b = End { x: ends[1], g: residual(ends[1], next_m) };
            if (a.g < 0.0) != (b.g < 0.0) {
                let root = triangle.solve(a, b, 1.0, |x| residual(x, plane(x, m)));
                found.extend(triangle.path(sight, root));
            }
            m = next_m;
        }
    }
    found
}
