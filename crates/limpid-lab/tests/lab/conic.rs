//! The walk along the curve of coplanar points, in f64 and on the device: known answers of its
//! algebra, its paths against all existing ones, and its irradiance against traced light.

mod device;
mod reference;

use glam::{DVec2, DVec3, IVec2, UVec2};
use limpid_lab::reference::conic::{Grid, LightSource, Path, Vertex, walk};
use limpid_sim::waves::{WaveSpectrum, Waves};

const WATER: f64 = 1.33;
const STEPS: u32 = 1000;

#[track_caller]
fn assert_near(got: f64, expected: f64, tolerance: f64, what: &str) {
    let error = (got - expected).abs();
    assert!(error <= tolerance, "{what}: {got}, expected {expected}, off by {error:e}");
}

/// A grid over the square from -half to half at z = 0, seen from above, with y down.
struct Pool {
    half: f64,
    grid: Grid,
}

impl Pool {
    fn new(half: f64, cells: u32, vertex: impl Fn(DVec2) -> Vertex) -> Self {
        let place = |at: UVec2| {
            let x = half * (2.0 * at.as_dvec2() / f64::from(cells) - 1.0);
            Some(vertex(DVec2::new(x.x, -x.y)))
        };
        Self { half, grid: Grid::new(UVec2::splat(cells), place) }
    }

    fn flat(half: f64, cells: u32) -> Self {
        Self::new(half, cells, |x| Vertex { position: x.extend(0.0), normal: DVec3::Z })
    }

    /// A height field with its gradient.
    fn heights(half: f64, cells: u32, f: impl Fn(DVec2) -> (f64, DVec2)) -> Self {
        Self::new(half, cells, |x| {
            let (height, slope) = f(x);
            Vertex { position: x.extend(height), normal: (-slope).extend(1.0).normalize() }
        })
    }

    /// The point of the grid vertically above or below a point, in cells.
    fn cell(&self, x: DVec2) -> DVec2 {
        0.5 * (DVec2::new(x.x, -x.y) / self.half + 1.0) * self.grid.cells.as_dvec2()
    }

    /// Walks from where the straight line to the light meets the surface, near z = 0.
    fn walk(&self, source: LightSource, receiver: DVec3) -> Option<Path> {
        self.walk_within(source, receiver, STEPS)
    }

    fn walk_within(&self, source: LightSource, receiver: DVec3, steps: u32) -> Option<Path> {
        let at = self.cell(self.straight(source, receiver));
        walk(&self.grid, &source, WATER, receiver, at, steps)
    }

    /// Finds where the straight line to the light passes through the grid, by bisection on the
    /// triangles' heights.
    fn straight(&self, source: LightSource, receiver: DVec3) -> DVec2 {
        let to = match source {
            LightSource::Sun(to) => to / to.z,
            LightSource::Point(at) => (at - receiver) / (at.z - receiver.z),
        };
        let (mut low, mut high) = (-2.0, 2.0);
        for _ in 0..60 {
            let z = 0.5 * (low + high);
            let x = (receiver + (z - receiver.z) * to).truncate();
            if self.height(x) > z { low = z } else { high = z }
        }
        (receiver + (0.5 * (low + high) - receiver.z) * to).truncate()
    }

    fn height(&self, x: DVec2) -> f64 {
        self.surface(x).0
    }

    /// The height of the triangles and the interpolated normal.
    fn surface(&self, x: DVec2) -> (f64, DVec3) {
        let at = self.cell(x);
        let cell = at.floor().as_ivec2().clamp(IVec2::ZERO, self.grid.cells.as_ivec2() - 1);
        let f = at - cell.as_dvec2();
        let v = |i, j| self.grid.vertex(cell + IVec2::new(i, j)).expect("a vertex");
        let (a, b, c, d) = (v(0, 0), v(1, 0), v(0, 1), v(1, 1));
        let (o, p, q, s, t) = if f.element_sum() <= 1.0 {
            (a, b, c, f.x, f.y)
        } else {
            (d, c, b, 1.0 - f.x, 1.0 - f.y)
        };
        let mix = |o: DVec3, p: DVec3, q: DVec3| o + s * (p - o) + t * (q - o);
        let normal = mix(o.normal, p.normal, q.normal).normalize();
        (mix(o.position, p.position, q.position).z, normal)
    }
}

fn overhead(height: f64) -> LightSource {
    LightSource::Point(DVec3::new(0.0, 0.0, height))
}

/// A grid of unit cells from -2 to 3 at z = 0 with linear normals: one conic everywhere.
fn one_conic(normal: impl Fn(DVec2) -> DVec3) -> Grid {
    Grid::new(UVec2::splat(5), |at| {
        let x = at.as_dvec2() - 2.0;
        Some(Vertex { position: x.extend(0.0), normal: normal(x) })
    })
}

fn waves() -> Waves {
    Waves::new(&WaveSpectrum { count: 12, wavelengths: [0.8, 2.0], rms_slope: 0.08, seed: 3 })
}

fn wavy(half: f64, cells: u32) -> Pool {
    let waves = waves();
    Pool::heights(half, cells, |x| (waves.height(x), waves.slope(x)))
}
