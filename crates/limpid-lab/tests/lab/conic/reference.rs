//! The walk along the conic, in f64.
//!
//! Tests the reference for the device, and the claims of the method's papers: closed forms of flat
//! water, the conic's algebra, all existing paths, and the radiometry of traced light.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, IVec2};
use limpid_lab::reference::conic::{Conic, LightSource, Path, Vertex, paths, walk};
use limpid_lab::reference::optics;

use super::{Pool, STEPS, WATER, assert_near, one_conic, overhead, wavy};
use crate::support::Random;

/// Flat water under a lamp, the textbook case: the point where Snell's law holds, both angles, and
/// the spread of the beam by the closed form of Walter et al.
#[test]
fn flat_water_matches_its_closed_form() {
    let pool = Pool::flat(8.0, 16);
    let source = LightSource::Point(DVec3::new(4.0, 0.0, 3.0));
    let path = pool.walk(source, DVec3::new(0.0, 0.0, -2.0)).expect("a path");
    assert_near(path.position.x, 1.196_433_729_8, 1e-9, "x");
    assert_near(path.position.y.abs() + path.position.z.abs(), 0.0, 1e-9, "y and z");
    let angle = |d: DVec3| d.z.abs().acos().to_degrees();
    assert_near(angle(path.to_receiver), 30.8886, 5e-5, "in water");
    assert_near(angle(path.to_light), 43.0614, 5e-5, "in air");
    assert_near(path.spread, 65.439_104, 1e-6, "D");
    assert_near(WATER * WATER / path.spread, 0.027_031_2, 5e-8, "eta^2 / D");
    let straight = path.magnification() / (16.0 + 25.0);
    assert_near(straight, WATER * WATER / path.spread, 1e-12, "the magnification's unit");

    let path = pool.walk(overhead(3.0), DVec3::new(0.0, 0.0, -2.0)).expect("a path");
    assert_near(path.spread, 35.8801, 1e-9, "D from overhead");
    assert!(path.position.length() < 1e-12);
}

/// D of flat water against its closed form at all angles, and the sun's D as the limit of a lamp's
/// over its squared distance.
#[test]
fn spread_under_flat_water_at_all_angles() {
    let pool = Pool::flat(20.0, 40);
    let mut random = Random(3);
    for _ in 0..200 {
        let receiver = DVec3::new(random.range(-1.0, 1.0), random.range(-1.0, 1.0), -2.0);
        let to = random.direction();
        let to = to.with_z(to.z.abs() + 0.4).normalize();
        let lamp = LightSource::Point(receiver + to * random.range(6.0, 12.0));
        let path = pool.walk(lamp, receiver).expect("a path");
        let d_l = match lamp {
            LightSource::Point(at) => at.distance(path.position),
            LightSource::Sun(_) => unreachable!("a lamp"),
        };
        let (c_p, c_l) = (path.to_receiver.z.abs(), path.to_light.z);
        let (d_p, eta) = (path.depth, WATER);
        let d = (d_p + eta * d_l) * (d_p * c_l / c_p + eta * d_l * c_p / c_l);
        assert_near(path.spread / d, 1.0, 1e-9, "D");

        let sun = pool.walk(LightSource::Sun(to), receiver).expect("a path");
        assert_near(sun.magnification(), sun.to_light.z / sun.to_receiver.z.abs(), 1e-9, "the sun");
        let far = 1e7;
        let star = pool.walk(LightSource::Point(receiver + far * to), receiver).expect("a path");
        assert_near(star.spread / (far * far) / sun.spread, 1.0, 1e-6, "the sun's limit");
    }
}

/// The triangle (0, 0), (1, 0), (0, 1) whose conic is a circle of radius delta / 2.
fn circle(p: DVec2, delta: f64) -> Conic {
    let positions = [DVec2::ZERO, DVec2::X, DVec2::Y];
    let normal = |x: DVec2| DVec3::new(-(x.y - p.y), x.x - p.x + delta, 1.0);
    let from = p.extend(-1.0);
    Conic::new(DVec3::Z, positions.map(|x| x.extend(0.0) - from), positions.map(normal))
}

/// The conic's coefficients are the paper's (equation 12), for any triangle.
#[test]
fn coefficients_match_the_paper() {
    let mut random = Random(4);
    for _ in 0..200 {
        let [l, v0, v1, v2, n0, n1, n2] = std::array::from_fn(|_| random.direction());
        let columns = [l.cross(v1 - v0), l.cross(v2 - v0), l.cross(v0)];
        let rows = [n1 - n0, n2 - n0, n0];
        let k = rows.map(|n| columns.map(|q| n.dot(q)));
        let expected =
            [k[0][0], k[1][1], k[0][1] + k[1][0], k[0][2] + k[2][0], k[1][2] + k[2][1], k[2][2]];
        let got = Conic::new(l, [v0, v1, v2], [n0, n1, n2]).coefficients();
        for (got, expected) in got.into_iter().zip(expected) {
            assert_near(got, expected, 1e-14, "a coefficient");
        }
    }
}

/// Crossings of edges: two on each of two edges, two on one edge, none for a circle inside, none
/// for a tangent one; and almost linear quadratics.
#[test]
fn edge_crossings_of_known_circles() {
    let roots = |conic: &Conic| [0, 1, 2].map(|edge| conic.edge_roots(edge));
    let inside = circle(DVec2::new(0.35, 0.3), 0.1);
    assert_eq!(roots(&inside), [[None; 2]; 3]);

    let four = circle(DVec2::new(0.55, 0.25), 0.6);
    for edge in [0, 1] {
        let [a, b] = four.edge_roots(edge).map(|s| s.expect("a root"));
        assert_near(a, 0.084_168_8, 5e-8, "the first");
        assert_near(b, 0.415_831_2, 5e-8, "the second");
    }
    assert_eq!(four.edge_roots(2), [None; 2]);

    let six = circle(DVec2::new(0.62, 0.25), 0.74);
    for edge in [0, 1] {
        let [s, none] = six.edge_roots(edge);
        assert_near(s.expect("a root"), 0.522_763_6, 5e-8, "on the leg");
        assert_eq!(none, None);
    }
    let [a, b] = six.edge_roots(2).map(|s| s.expect("a root"));
    assert_near(a, 0.422_863_8, 5e-8, "on the hypotenuse");
    assert_near(b, 0.577_136_2, 5e-8, "on the hypotenuse");

    // A tangent circle does not cross the edge: zero crossings or two, never one.
    for delta in [0.5 - 1e-15, 0.5, 0.5 + 1e-15] {
        let touches = circle(DVec2::new(0.55, 0.25), delta);
        let count = touches.edge_roots(0).iter().flatten().count();
        assert!(count != 1, "{count}");
    }

    // 1e-12 s^2 + s - 1/2, and its mirror image.
    let line = |a: f64, h: f64, b: f64| Conic { vertices: [a, b, 1.0], edges: [h, 1.0, 1.0] };
    let root = |a, h, b| line(a, h, b).edge_roots(0)[0].expect("a root");
    assert_near(root(-0.5, 0.0, 0.5 + 1e-12), 0.5, 1e-12, "almost linear");
    assert_near(root(0.5 + 1e-12, 0.0, -0.5), 0.5, 1e-12, "almost linear");
    assert_eq!(line(0.0, 0.0, 0.0).edge_roots(0), [None; 2]);
}

/// No cracks: triangles on both sides of an edge, and walks in either direction, have bit-identical
/// crossings.
#[test]
fn neighbours_have_identical_crossings() {
    let mut random = Random(5);
    let mut crossings = 0;
    for _ in 0..2000 {
        let [l, a, b, c, d, na, nb, nc, nd] = std::array::from_fn(|_| random.direction());
        let one = Conic::new(l, [a, b, c], [na, nb, nc]);
        let other = Conic::new(l, [d, a, b], [nd, na, nb]);
        assert_eq!(one.edge_roots(0), other.edge_roots(2));
        crossings += one.edge_roots(0).iter().flatten().count();
        // The curve leaves a triangle as often as it enters it.
        let all: usize = (0..3).map(|edge| one.edge_roots(edge).iter().flatten().count()).sum();
        assert_eq!(all % 2, 0);
    }
    assert!(crossings > 500, "{crossings}");
}

/// A grid of random heights and normals.
fn rough(random: &mut Random, cells: u32, slope: f64) -> Pool {
    let side = 2.0 / f64::from(cells);
    let size = (cells + 1) * (cells + 1);
    let values: Vec<_> = (0..size)
        .map(|_| {
            let tilt = DVec2::new(random.range(-slope, slope), random.range(-slope, slope));
            (random.range(-0.2, 0.2) * side, tilt.extend(1.0).normalize())
        })
        .collect();
    let mut pool = Pool::flat(1.0, cells);
    for (vertex, (height, normal)) in pool.grid.vertices.iter_mut().zip(values) {
        let vertex = vertex.as_mut().expect("a vertex");
        vertex.position.z = height;
        vertex.normal = normal;
    }
    pool
}

/// Violation of Snell's law, as a vector along the surface.
fn violation(pool: &Pool, source: LightSource, receiver: DVec3, x: DVec2) -> DVec3 {
    let (height, normal) = pool.surface(x);
    let m = x.extend(height);
    let to_light = match source {
        LightSource::Sun(to) => to,
        LightSource::Point(at) => (at - m).normalize(),
    };
    let sum = WATER * (receiver - m).normalize() + to_light;
    sum - sum.dot(normal) * normal
}

/// Finds all paths by Newton's method from many points of every triangle, without using the curve.
fn paths_by_newton(pool: &Pool, source: LightSource, receiver: DVec3) -> Vec<DVec2> {
    const SEEDS: u32 = 12;
    let cells = pool.grid.cells;
    let side = 2.0 * pool.half / f64::from(cells.x);
    let mut found: Vec<DVec2> = Vec::new();
    for j in 0..cells.y * SEEDS {
        for i in 0..cells.x * SEEDS {
            let at = (DVec2::new(f64::from(i), f64::from(j)) + DVec2::new(0.31, 0.57))
                / f64::from(SEEDS);
            let cell = at.floor();
            let upper = (at - cell).element_sum() > 1.0;
            let place = |at: DVec2| pool.half * (2.0 * at / cells.as_dvec2() - 1.0);
            let mut at = at;
            let residual = |at: DVec2| {
                let x = place(at);
                violation(pool, source, receiver, DVec2::new(x.x, -x.y)).truncate()
            };
            for _ in 0..12 {
                let step = 1e-7;
                let r = residual(at);
                let dx = (residual(at + step * DVec2::X) - residual(at - step * DVec2::X)) / step;
                let dy = (residual(at + step * DVec2::Y) - residual(at - step * DVec2::Y)) / step;
                let jacobian = glam::DMat2::from_cols(0.5 * dx, 0.5 * dy);
                if jacobian.determinant() == 0.0 {
                    break;
                }
                let by = jacobian.inverse() * r;
                at -= by.clamp_length_max(0.3);
                let f = at - cell;
                let beyond = f.cmplt(DVec2::splat(-0.3)).any() || f.cmpgt(DVec2::splat(1.3)).any();
                if beyond || !at.is_finite() {
                    break;
                }
            }
            let f = at - cell;
            let within = f.cmpge(DVec2::ZERO).all()
                && f.cmplt(DVec2::ONE).all()
                && (f.element_sum() > 1.0) == upper;
            let x = place(at);
            let x = DVec2::new(x.x, -x.y);
            if within
                && residual(at).length() < 1e-10
                && found.iter().all(|y| y.distance(x) > 1e-7 * side)
            {
                found.push(x);
            }
        }
    }
    found
}

/// The enumeration, and with it the sign of the residual: on random meshes, rough enough for total
/// reflection along the curve, it finds exactly the paths that Newton's method finds, and the walk
/// finds one of them.
#[test]
fn enumeration_matches_newton_on_random_meshes() {
    let mut random = Random(6);
    let (mut total, mut several, mut walked, mut solvable, mut missed) = (0, 0, 0, 0, 0);
    for k in 0..60 {
        let slope = [0.1, 0.4, 0.8][k % 3];
        let pool = rough(&mut random, 6, slope);
        let receiver = DVec3::new(random.range(-0.3, 0.3), random.range(-0.3, 0.3), -1.0);
        let to = random.direction();
        let to = to.with_z(to.z.abs() + 0.8).normalize();
        let source =
            if k % 2 == 0 { LightSource::Sun(to) } else { LightSource::Point(receiver + 4.0 * to) };
        let expected = paths_by_newton(&pool, source, receiver);
        // On a rough mesh, triangles may face away from light that their normals let through.
        let found = paths(&pool.grid, &source, WATER, receiver);
        for x in &expected {
            let near = |p: &Path| p.position.truncate().distance(*x) < 1e-6;
            missed += i32::from(!found.iter().any(near));
        }
        for path in &found {
            let near = |x: &DVec2| path.position.truncate().distance(*x) < 1e-6;
            assert!(expected.iter().any(near), "mesh {k}: {path:?} not in {expected:?}");
        }
        total += expected.len();
        several += usize::from(found.len() > 1);
        let start = pool.straight(source, receiver).abs().max_element();
        solvable += usize::from(!found.is_empty() && start < pool.half);
        if let Some(path) = pool.walk(source, receiver) {
            let near = |p: &Path| p.position.distance(path.position) < 1e-9;
            assert!(found.iter().any(near), "mesh {k}: the walk's path is not among all paths");
            walked += 1;
        }
    }
    assert_eq!(missed, 0);
    assert!(total >= 60 && several > 0, "{total} paths, {several} receivers with several");
    assert!(walked + 2 >= solvable, "{walked} of {solvable} receivers");
}

/// Closed curves: circles inside the first triangle, circles that cross a triangle four times, or
/// one edge twice. The plane's normal is reversed after one turn, so there always is a root.
#[test]
fn walks_around_circles_find_a_path() {
    let mut random = Random(7);
    let fixed = [(0.35, 0.3, 0.1), (0.55, 0.25, 0.6), (0.62, 0.25, 0.74)];
    let drawn = (0..300).map(|_| (random.unit(), random.unit(), random.range(0.01, 0.8)));
    for (k, (x, y, delta)) in fixed.into_iter().chain(drawn.collect::<Vec<_>>()).enumerate() {
        let p = DVec2::new(x, y);
        let grid = one_conic(|x| DVec3::new(-(x.y - p.y), x.x - p.x + delta, 1.0));
        let receiver = p.extend(-1.0);
        let source = LightSource::Point(receiver + 3.0 * DVec3::Z);
        let path = walk(&grid, &source, WATER, receiver, p + 2.0, STEPS).expect("a path");
        let centre = p - 0.5 * delta * DVec2::X;
        let radius = path.position.truncate().distance(centre);
        assert_near(radius, 0.5 * delta, 1e-9, "the radius");
        assert!(k > 0 || path.steps == 0, "a circle inside the first triangle");
    }
}

/// The walk stays on the branch of a hyperbola that contains the straight line to the light.
#[test]
fn walks_stay_on_their_branch() {
    let mut random = Random(8);
    let mut found = 0;
    for _ in 0..300 {
        let p = DVec2::new(random.unit(), random.unit());
        let e = DVec2::new(random.range(-0.3, 0.3), random.range(-0.3, 0.3));
        // (2 s X - e_x)(2 s Y + e_y) = -e_x e_y around p.
        let s = random.range(0.1, 0.6);
        let grid = one_conic(|x| DVec3::new(e.x - s * (x.x - p.x), e.y + s * (x.y - p.y), 1.0));
        let receiver = p.extend(-1.0);
        let source = LightSource::Point(receiver + 3.0 * DVec3::Z);
        let Some(path) = walk(&grid, &source, WATER, receiver, p + 2.0, STEPS) else { continue };
        let x = path.position.truncate() - p;
        let branch = (2.0 * s * x.x - e.x) * -e.x;
        let form = 2.0 * s * x.x * x.y - e.x * x.y + e.y * x.x;
        assert!(branch > 0.0 && form.abs() < 1e-9, "{branch} {form}");
        let all = paths(&grid, &source, WATER, receiver);
        assert!(all.iter().any(|p| p.position.distance(path.position) < 1e-9));
        found += 1;
    }
    assert!(found > 100, "{found}");
}

/// Ties at a vertex: the path does not depend on which of its triangles the walk starts in.
#[test]
fn walks_from_a_vertex_agree() {
    let mut random = Random(9);
    for _ in 0..20 {
        let pool = rough(&mut random, 6, 0.2);
        let corner = IVec2::new(3, 3);
        let vertex = pool.grid.vertex(corner).expect("a vertex").position;
        let to = random.direction();
        let to = to.with_z(to.z.abs() + 2.0).normalize();
        let receiver = vertex - to;
        let source = LightSource::Point(vertex + 2.0 * to);
        let found =
            [(0.1, 0.1), (0.1, -0.05), (0.05, -0.1), (-0.1, -0.1), (-0.05, 0.1), (-0.1, 0.05)].map(
                |(x, y)| {
                    let at = corner.as_dvec2() + 1e-12 * DVec2::new(x, y);
                    walk(&pool.grid, &source, WATER, receiver, at, STEPS).map(|path| path.position)
                },
            );
        let first = found[0].expect("a path");
        for other in found {
            assert!(other.is_some_and(|x| x.distance(first) < 1e-10), "{found:?}");
        }
    }
}

/// The walk passes regions of total reflection, where the refracted ray does not exist, and ends
/// where there is nothing to find: light from below, the edge of the grid, too few steps, holes.
#[test]
fn walks_pass_total_reflection_and_terminate() {
    let pool = Pool::flat(16.0, 64);
    let receiver = DVec3::new(0.0, 0.0, -2.0);
    let far = LightSource::Point(DVec3::new(30.0, 3.0, 3.0));
    let begin = pool.straight(far, receiver);
    assert!(begin.length() / 2.0 > 48.76_f64.to_radians().tan(), "total reflection at {begin}");
    let path = pool.walk(far, receiver).expect("a path");
    assert!(path.steps > 20);
    assert_eq!(pool.walk_within(far, receiver, 10), None);

    let low = 5.0_f64.to_radians();
    let sun = LightSource::Sun(DVec3::new(low.cos(), 0.0, low.sin()));
    // The straight ray misses the grid; from other starts the walk ends as well.
    assert_eq!(walk(&pool.grid, &sun, WATER, receiver, DVec2::new(77.7, 32.0), STEPS), None);
    for at in [DVec2::ZERO, DVec2::splat(64.0), DVec2::new(63.9, 0.3)] {
        walk(&pool.grid, &sun, WATER, receiver, at, STEPS);
    }
    for below in [
        LightSource::Point(DVec3::new(1.0, 0.2, -0.5)),
        LightSource::Sun(DVec3::new(0.6, 0.0, -0.8)),
    ] {
        for at in [DVec2::splat(32.2), DVec2::new(34.3, 32.1)] {
            assert_eq!(walk(&pool.grid, &below, WATER, receiver, at, STEPS), None);
        }
    }
    let mut torn = Pool::flat(16.0, 64);
    torn.grid.vertices[32 * 65 + 40] = None;
    torn.grid.vertices[33 * 65 + 40] = None;
    torn.grid.vertices[31 * 65 + 40] = None;
    let lamp = LightSource::Point(DVec3::new(12.0, 0.0, 3.0));
    assert!(pool.walk(lamp, receiver).is_some_and(|path| path.position.x < 2.5));
    let at = pool.cell(pool.straight(lamp, receiver));
    assert_eq!(walk(&torn.grid, &lamp, WATER, receiver, at, STEPS), None);
    // Grazing rays are rejected or finite.
    let tilted = Pool::new(8.0, 16, |x| Vertex {
        position: x.extend(0.0),
        normal: DVec3::new(0.6, 0.0, 0.8),
    });
    for depth in [1e-2, 1e-3, 1e-4] {
        let lamp = LightSource::Point(DVec3::new(6.0, 0.1, depth));
        let path = tilted.walk(lamp, DVec3::new(-2.0, 0.0, -depth));
        assert!(path.is_none_or(|path| path.magnification().is_finite()));
    }
}

/// A derivative by fourth-order differences.
fn derivative(f: impl Fn(f64) -> DVec3, step: f64) -> DVec3 {
    let central = |step: f64| (f(step) - f(-step)) / (2.0 * step);
    (4.0 * central(step) - central(2.0 * step)) / 3.0
}

/// The extended triangle under `m`, for tracing light through it.
struct Tilted {
    corners: [Vertex; 3],
}

impl Tilted {
    fn at(pool: &Pool, m: DVec2) -> Self {
        let at = pool.cell(m);
        let cell = at.floor().as_ivec2();
        let upper = (at - at.floor()).element_sum() > 1.0;
        let of = if upper { [(1, 0), (0, 1), (1, 1)] } else { [(0, 0), (1, 0), (0, 1)] };
        let corner = |(i, j)| pool.grid.vertex(cell + IVec2::new(i, j)).expect("a vertex");
        Self { corners: of.map(corner) }
    }

    /// Intersects a ray with its plane; returns the point and the interpolated normal there.
    fn meet(&self, o: DVec3, d: DVec3) -> (DVec3, DVec3) {
        let [a, b, c] = self.corners;
        let (e1, e2) = (b.position - a.position, c.position - a.position);
        let n = e1.cross(e2);
        let x = o + (a.position - o).dot(n) / d.dot(n) * d;
        let y = (x - a.position).cross(e2).dot(n) / n.length_squared();
        let z = e1.cross(x - a.position).dot(n) / n.length_squared();
        (x, (a.normal + y * (b.normal - a.normal) + z * (c.normal - a.normal)).normalize())
    }
}

/// D against finite differences of rays from the receiver, on triangles with tilted normals: two of
/// the derivatives have the wrong sign in print.
#[test]
fn spread_matches_finite_differences() {
    let mut random = Random(10);
    let mut checked = 0;
    while checked < 100 {
        let pool = rough(&mut random, 6, 0.4);
        let receiver = DVec3::new(random.range(-0.3, 0.3), random.range(-0.3, 0.3), -1.0);
        let to = random.direction();
        let to = to.with_z(to.z.abs() + 0.8).normalize();
        let sun = checked % 2 == 0;
        let source =
            if sun { LightSource::Sun(to) } else { LightSource::Point(receiver + 4.0 * to) };
        let Some(path) = pool.walk(source, receiver) else { continue };
        let triangle = Tilted::at(&pool, path.position.truncate());
        let arrive = |d: DVec3| {
            let (m, n) = triangle.meet(receiver, d);
            let out = optics::refract(d, -n, 1.0 / WATER).expect("it leaves");
            match source {
                LightSource::Sun(_) => out,
                // The point on the plane through the lamp, perpendicular to the path.
                LightSource::Point(at) => {
                    m + (at - m).dot(path.to_light) / out.dot(path.to_light) * out
                }
            }
        };
        let (u, v) = path.to_receiver.any_orthonormal_pair();
        let step = 1e-5;
        let d = -path.to_receiver;
        let [du, dv] = [u, v].map(|turn| derivative(|s| arrive((d + s * turn).normalize()), step));
        let expected = du.cross(dv).length();
        assert_near(path.spread / expected, 1.0, 1e-6, "D");
        checked += 1;
    }
}

/// Irradiance on the floor by light traced forward through one triangle: the transmitted light over
/// the area where it lands.
fn traced(pool: &Pool, towards: DVec3, path: &Path, receiver: DVec3) -> f64 {
    let triangle = Tilted::at(pool, path.position.truncate());
    let arrive = |o: DVec3| {
        let (m, n) = triangle.meet(o, -towards);
        let d = optics::refract(-towards, n, WATER).expect("it enters");
        m + (receiver.z - m.z) / d.z * d
    };
    let (u, v) = towards.any_orthonormal_pair();
    let step = 1e-5;
    let [du, dv] = [u, v].map(|side| derivative(|s| arrive(path.position + s * side), step));
    (1.0 - optics::fresnel(towards.dot(path.normal), WATER)) / du.cross(dv).length()
}

/// Radiometry: under waves, before and behind their focus, the irradiance of every path is that of
/// traced light, E T dA/dA'. Also measures the method's bias: the light along paths that the walk
/// does not find.
#[test]
fn irradiance_under_waves_matches_traced_light() {
    let pool = wavy(3.0, 120);
    let towards = DVec3::new(0.3, 0.2, 1.0).normalize();
    let source = LightSource::Sun(towards);
    let mut random = Random(11);
    const RECEIVERS: u32 = 150;
    // Depth; the minimum share of receivers with one path; the minimum share of the light that is
    // found.
    for (depth, one, light) in [(2.0, 0.99, 0.99), (5.0, 0.2, 0.3)] {
        let (mut found, mut single, mut got, mut all) = (0, 0, 0.0, 0.0);
        for _ in 0..RECEIVERS {
            let receiver = DVec3::new(random.range(-0.5, 0.5), random.range(-0.5, 0.5), -depth);
            let irradiance =
                |p: &Path, most: f64| p.irradiance(DVec3::ONE, DVec3::ZERO, DVec3::Z, most).x;
            let every = paths(&pool.grid, &source, WATER, receiver);
            for path in &every {
                let expected = traced(&pool, towards, path, receiver);
                let ratio = irradiance(path, f64::INFINITY) / expected;
                // Interpolated normals differ slightly from the triangles' slopes, so forward and
                // backward light differ to that extent.
                assert_near(ratio, 1.0, 0.01 * (1.0 + expected), "irradiance");
            }
            all += every.iter().map(|p| irradiance(p, 20.0)).sum::<f64>();
            single += u32::from(every.len() == 1);
            if let Some(path) = pool.walk(source, receiver) {
                assert!(every.iter().any(|p| p.position.distance(path.position) < 1e-9));
                found += 1;
                got += irradiance(&path, 20.0);
            }
        }
        let share = f64::from(single) / f64::from(RECEIVERS);
        assert!(found * 100 > RECEIVERS * 97, "{found} found");
        assert!(share >= one && got >= light * all, "{share} with one path, {} found", got / all);
    }
}

/// A lens transmits all its light to floors before and behind its focus, and makes a finite bright
/// spot at the focus.
#[test]
fn a_lens_conserves_light() {
    let curvature = 0.2;
    let pool = Pool::heights(0.5, 40, |x| (-0.5 * curvature * x.length_squared(), -curvature * x));
    let focus = WATER / ((WATER - 1.0) * curvature);
    let sent: f64 = 1.0 - optics::fresnel(1.0, WATER);
    for (depth, tolerance) in [(0.3, 0.02), (0.6, 0.03)].map(|(d, t)| (d * focus, t)) {
        let texels = 40;
        let side = 1.0 / f64::from(texels);
        let mut received = 0.0;
        for j in 0..texels {
            for i in 0..texels {
                let x = (DVec2::new(f64::from(i), f64::from(j)) + 0.5) * side - 0.5;
                let receiver = x.extend(-depth);
                let light = pool
                    .walk(LightSource::Sun(DVec3::Z), receiver)
                    .map_or(0.0, |path| path.irradiance(DVec3::ONE, DVec3::ZERO, DVec3::Z, 1e3).x);
                received += light * side * side;
            }
        }
        assert_near(received / sent, 1.0, tolerance, "the share of the light that arrives");
    }
    let spot = pool.walk(LightSource::Sun(DVec3::Z), DVec3::new(0.0, 0.0, -focus)).expect("a path");
    let bright = spot.irradiance(DVec3::ONE, DVec3::ZERO, DVec3::Z, 30.0);
    assert!(bright.is_finite() && bright.x <= 30.0 && bright.x > 20.0, "{bright}");
}

/// The documented bias: behind the focus of a wave three paths exist, and the walk finds one.
#[test]
fn three_paths_exist_behind_a_focus() {
    let (amplitude, k) = (0.05, TAU / 2.0);
    let pool = Pool::heights(2.5, 100, |x| {
        (amplitude * (k * x.x).cos(), DVec2::new(-amplitude * k * (k * x.x).sin(), 0.0))
    });
    let receiver = DVec3::new(0.011, 0.007, -16.0);
    let source = LightSource::Sun(DVec3::Z);
    let near: Vec<_> = paths(&pool.grid, &source, WATER, receiver)
        .into_iter()
        .filter(|path| path.position.x.abs() < 1.0)
        .collect();
    assert_eq!(near.len(), 3);
    let path = pool.walk(source, receiver).expect("a path");
    assert!(near.iter().any(|p| p.position.distance(path.position) < 1e-9));
}
