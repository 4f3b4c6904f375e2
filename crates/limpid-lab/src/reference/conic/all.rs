//! All paths through a grid, by search instead of a walk.

use glam::{DVec2, DVec3, IVec2};

use super::triangle::{End, Sight, Triangle};
use super::{Grid, LightSource, Path, lower, upper};

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
