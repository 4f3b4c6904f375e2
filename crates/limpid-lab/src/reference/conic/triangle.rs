//! A triangle of the grid as a receiver sees it: where its conic obeys Snell's law, and the path of light there.

use glam::{DMat2, DVec2, DVec3, IVec2};

use super::form::{Conic, EDGES, EdgeCrossing, barycentric};
use super::{Grid, LightSource, Path};

/// A receiver and a light, with the index of refraction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sight {
    receiver: DVec3,
    /// Unit vector from the receiver to the light.
    pub(super) towards: DVec3,
    /// Distance to the light, m; `None` for a sun.
    distance: Option<f64>,
    ior: f64,
}

impl Sight {
    pub(super) fn new(source: &LightSource, receiver: DVec3, ior: f64) -> Option<Self> {
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
    pub(super) fn residual(&self, x: DVec3, normal: DVec3, m: DVec3) -> f64 {
        let normal = normal.normalize();
        let along = m.cross(normal).normalize_or_zero();
        (self.light_from(x).0 - self.ior * x.normalize()).dot(along)
    }
}

/// A triangle of the grid, with positions relative to the receiver.
#[derive(Debug, Clone, Copy)]
pub(super) struct Triangle {
    at: [IVec2; 3],
    pub(super) positions: [DVec3; 3],
    normals: [DVec3; 3],
    pub(super) conic: Conic,
}

impl Triangle {
    pub(super) fn new(grid: &Grid, sight: &Sight, at: [IVec2; 3]) -> Option<Self> {
        let [p, q, r] = at.map(|at| grid.vertex(at));
        let vertices = [p?, q?, r?];
        let positions = vertices.map(|v| v.position - sight.receiver);
        let normals = vertices.map(|v| v.normal);
        let conic = Conic::new(sight.towards, positions, normals);
        Some(Self { at, positions, normals, conic })
    }

    /// The neighbour across a crossing: that edge in the same direction, then the new vertex.
    pub(super) fn beyond(
        &self,
        grid: &Grid,
        sight: &Sight,
        crossing: &EdgeCrossing,
    ) -> Option<Self> {
        let [from, to, opposite] = EDGES[crossing.edge];
        // The two triangles of any edge of the grid form a parallelogram.
        let third = self.at[from] + self.at[to] - self.at[opposite];
        Self::new(grid, sight, [self.at[from], self.at[to], third])
    }

    pub(super) fn position(&self, x: DVec2) -> DVec3 {
        interpolate(self.positions, x)
    }

    pub(super) fn normal(&self, x: DVec2) -> DVec3 {
        interpolate(self.normals, x)
    }

    /// The point where the straight line to the light passes.
    pub(super) fn straight(&self, sight: &Sight) -> DVec2 {
        let side = self.positions.map(|x| sight.towards.cross(x));
        let area = |a: usize, b: usize| sight.towards.dot(side[a].cross(side[b]));
        let b = DVec3::new(area(1, 2), area(2, 0), area(0, 1));
        DVec2::new(b.y, b.z) / b.element_sum()
    }

    /// Finds the point of the arc from `a` to `b` where the residual is 0, given that its signs at
    /// the ends differ.
    pub(super) fn solve(
        &self,
        mut a: End,
        mut b: End,
        along: f64,
        residual: impl Fn(DVec2) -> f64,
    ) -> DVec2 {
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
    pub(super) fn path(&self, sight: &Sight, x: DVec2) -> Option<Path> {
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
pub(super) struct End {
    pub(super) x: DVec2,
    pub(super) g: f64,
}
