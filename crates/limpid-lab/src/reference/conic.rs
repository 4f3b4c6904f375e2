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

mod all;
mod form;
mod triangle;

use glam::{DVec2, DVec3, IVec2, UVec2};

use super::optics;
pub use all::paths;
pub use form::Conic;
use form::{EdgeCrossing, barycentric};
use triangle::{End, Sight, Triangle};

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

    let mut candidates: Vec<(f64, EdgeCrossing, End)> = [1.0, -1.0]
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
