//! Deposition of light: the surfaces that a map's texels show, and the exact share of landed light
//! that each texel receives.

use glam::{DVec2, DVec3, IVec2, UVec2};
use rayon::prelude::*;

use super::paths::{Beam, End, Landing, facing};
use super::{CausticMap, Chart, Flux, Receiver, Spot, index, power};
use crate::reference::Ray;
use crate::reference::layers::{self, Layer};
use crate::reference::surroundings::Surroundings;
use limpid::light_view::LightView;
use limpid::scene::Light;

/// The surfaces that the texels of a chart show, and the solids themselves for texels at edges.
pub(super) struct Receivers<'a> {
    pub(super) chart: Chart,
    pub(super) texels: Vec<Option<Receiver>>,
    pub(super) surroundings: Option<&'a Surroundings>,
}

/// Number of points that sample a texel at an edge.
pub(super) const EDGE_SAMPLES: u32 = 256;

impl<'a> Receivers<'a> {
    pub(super) fn new(chart: &Chart, surroundings: &'a Surroundings) -> Self {
        let (view, size) = (&chart.view, chart.view.size);
        let width = size.x as usize;
        let texel = |i: usize| IVec2::new((i % width) as i32, (i / width) as i32);
        let spots: Vec<_> = (0..width * size.y as usize)
            .into_par_iter()
            .map(|i| seen(chart, surroundings, texel(i).as_dvec2() + 0.5))
            .collect();
        let edge = |i: usize, spot: &Spot| {
            (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| IVec2::new(dx, dy))).any(|d| {
                let same = |j: usize| spots[j].is_some_and(|other| other.continues(spot));
                index(size, texel(i) + d).is_some_and(|j| !same(j))
            })
        };
        let receiver = |i: usize| {
            let spot = spots[i]?;
            let edge = edge(i, &spot);
            let corner = texel(i).as_dvec2();
            let area = patch_area(view, corner + 0.5, spot.point, spot.normal);
            let seen_at = |u: DVec2| seen(chart, surroundings, u);
            let shown = |k: &u32| {
                // Hammersley points.
                let n = f64::from(EDGE_SAMPLES);
                let reversed = f64::from(k.reverse_bits()) / 2f64.powi(32);
                let u = corner + DVec2::new((f64::from(*k) + 0.5) / n, reversed);
                seen_at(u).is_some_and(|other| other.continues(&spot))
            };
            let share = if edge {
                let count = (0..EDGE_SAMPLES).filter(shown).count().max(1);
                count as f64 / f64::from(EDGE_SAMPLES)
            } else {
                1.0
            };
            Some(Receiver { spot, area: share * area, edge })
        };
        let texels = (0..spots.len()).into_par_iter().map(receiver).collect();
        Self { chart: *chart, texels, surroundings: Some(surroundings) }
    }

    pub(super) fn of_planes(light: &LightView, view: &layers::ViewSpace, planes: &Layer) -> Self {
        let width = light.size.x;
        let receiver = |i: u32| {
            let texel = UVec2::new(i % width, i / width);
            let u = texel.as_dvec2() + 0.5;
            let plane = planes.at(texel.as_ivec2());
            let disparity = plane.dot(view.omega(u));
            (disparity > 0.0).then(|| {
                let (_, direction) = view.ray(u);
                let point = view.point(u, disparity);
                let normal = facing(view.normal(plane), direction);
                let cos = -direction.dot(normal);
                let distance2 = if light.orthographic { 1.0 } else { point.length_squared() };
                let area = light.pixel_extent(u) * distance2 / cos;
                Receiver { spot: Spot { solid: 0, part: 0, point, normal }, area, edge: false }
            })
        };
        let texels = (0..light.size.element_product()).into_par_iter().map(receiver).collect();
        Self { chart: Chart::whole(light), texels, surroundings: None }
    }

    /// The index of the texel, if it shows the surface of `spot` at `u`.
    pub(super) fn shows(&self, texel: IVec2, u: DVec2, spot: &Spot) -> Option<usize> {
        let i = index(self.chart.view.size, texel)?;
        let receiver = self.texels[i]?;
        let there = match self.surroundings.filter(|_| receiver.edge) {
            Some(surroundings) => seen(&self.chart, surroundings, u)?.continues(spot),
            None => true,
        };
        (there && receiver.spot.continues(spot)).then_some(i)
    }
}

/// The point that a chart shows at a pixel position.
pub(super) fn seen(chart: &Chart, surroundings: &Surroundings, u: DVec2) -> Option<Spot> {
    let (origin, direction) = chart.view.ray(u);
    let ray = Ray { origin, direction };
    let hit = match &chart.face {
        Some(face) => surroundings.hit_side(face, &ray)?,
        None => surroundings.hit(&ray)?,
    };
    let spot = Spot::of(&hit, direction);
    // No light reaches points inside another solid.
    let bare = chart.face.is_none() || !surroundings.covers(hit.point, spot.normal);
    (bare && chart.takes(&spot)).then_some(spot)
}

/// Area of the surface through a point that one pixel covers, m².
pub(super) fn patch_area(view: &LightView, u: DVec2, point: DVec3, normal: DVec3) -> f64 {
    let (origin, direction) = view.ray(u);
    let distance2 = if view.orthographic { 1.0 } else { origin.distance_squared(point) };
    view.pixel_extent(u) * distance2 / -direction.dot(normal)
}

/// Number of rows of cells that are traced and deposited at once.
pub(super) const BAND: u32 = 32;

/// The grid of rays between which light is deposited, in pixels.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    pub(super) first: DVec2,
    pub(super) cell: f64,
    pub(super) cells: UVec2,
}

impl Grid {
    /// Rays from border to border of the frame.
    pub(super) fn corners(view: &LightView, density: u32) -> Self {
        let density = density.max(1);
        Self { first: DVec2::ZERO, cell: 1.0 / f64::from(density), cells: density * view.size }
    }

    /// Rays in the middle of each beam: at density 1 at texel centres.
    pub(super) fn centres(view: &LightView, density: u32) -> Self {
        let Self { cell, cells, .. } = Self::corners(view, density);
        Self { first: DVec2::splat(0.5 * cell), cell, cells: cells - 1 }
    }

    pub(super) fn at(&self, i: u32, j: u32) -> DVec2 {
        self.first + self.cell * UVec2::new(i, j).as_dvec2()
    }
}

/// A triangle between three neighbouring rays.
pub(super) struct Triangle<'a> {
    pub(super) corners: [&'a Beam; 3],
    /// Its centroid, pixels.
    pub(super) middle: DVec2,
}

/// Traces all rays of a grid, passes each row of triangles to `of_row`, in parallel, and the
/// results to `take`, in order.
pub(super) fn over_rows<T: Send>(
    grid: Grid,
    follow: impl Fn(DVec2) -> Beam + Sync,
    of_row: impl Fn(&mut dyn Iterator<Item = Triangle<'_>>) -> T + Sync,
    mut take: impl FnMut(Vec<T>),
) {
    let Grid { cell, cells, .. } = grid;
    let row = |j: u32| -> Vec<Beam> { (0..=cells.x).map(|i| follow(grid.at(i, j))).collect() };
    let mut last = row(0);
    for band in (0..cells.y).step_by(BAND as usize) {
        let end = cells.y.min(band + BAND);
        let mut rows = vec![last];
        rows.par_extend((band + 1..=end).into_par_iter().map(row));
        let made = (band..end).into_par_iter().map(|j| {
            let [upper, lower] = [0, 1].map(|k| &rows[(j - band + k) as usize]);
            let mut triangles = (0..cells.x).flat_map(|i| {
                let at = |k: u32| (i + k) as usize;
                let corner = grid.at(i, j);
                let first = [&upper[at(0)], &upper[at(1)], &lower[at(0)]];
                let second = [&lower[at(1)], &lower[at(0)], &upper[at(1)]];
                [(first, 1.0 / 3.0), (second, 2.0 / 3.0)]
                    .map(|(corners, third)| Triangle { corners, middle: corner + third * cell })
            });
            of_row(&mut triangles)
        });
        take(made.collect());
        last = rows.pop().unwrap_or_default();
    }
}

pub(super) fn lay_beams(
    source: &LightView,
    light: &Light,
    receivers: &[Receivers<'_>],
    grid: Grid,
    sum: &mut Sum,
    follow: impl Fn(DVec2) -> Beam + Sync,
) {
    let power = power(light) * (0.5 * grid.cell * grid.cell);
    let lay = |triangles: &mut dyn Iterator<Item = Triangle<'_>>| {
        let mut ledger = Ledger::new(receivers);
        for Triangle { corners, middle } in triangles {
            ledger.lay_triangle(corners, power * source.pixel_extent(middle), grid.cell);
        }
        ledger
    };
    over_rows(grid, follow, lay, |ledgers| sum.add(ledgers));
}

/// Accumulated power on each chart's texels.
pub(super) struct Sum {
    pub(super) power: Vec<Vec<DVec3>>,
    pub(super) flux: Flux,
}

impl Sum {
    pub(super) fn new(receivers: &[Receivers<'_>]) -> Self {
        let power = receivers.iter().map(|chart| vec![DVec3::ZERO; chart.texels.len()]);
        Self { power: power.collect(), flux: Flux::default() }
    }

    /// Adds in order, so that results do not depend on the number of threads.
    pub(super) fn add(&mut self, ledgers: Vec<Ledger<'_>>) {
        for ledger in ledgers {
            self.flux += ledger.flux;
            for (chart, texel, power) in ledger.deposits {
                self.power[chart as usize][texel as usize] += power;
            }
        }
    }

    /// Converts the sums to a map per chart.
    pub(super) fn finish(self, receivers: Vec<Receivers<'_>>) -> Vec<CausticMap> {
        let map = |(power, receivers): (Vec<DVec3>, Receivers<'_>)| {
            let irradiance = power.iter().zip(&receivers.texels).map(|(&power, receiver)| {
                receiver.map_or(DVec3::ZERO, |receiver| power / receiver.area)
            });
            CausticMap {
                view: receivers.chart.view,
                face: receivers.chart.face,
                irradiance: irradiance.collect(),
                receivers: receivers.texels,
                flux: self.flux,
            }
        };
        self.power.into_iter().zip(receivers).map(map).collect()
    }
}

/// Deposits of a part of the light.
pub(super) struct Ledger<'a> {
    pub(super) receivers: &'a [Receivers<'a>],
    /// Chart, texel and power.
    pub(super) deposits: Vec<(u32, u32, DVec3)>,
    pub(super) flux: Flux,
}

impl<'a> Ledger<'a> {
    pub(super) fn new(receivers: &'a [Receivers<'a>]) -> Self {
        Self { receivers, deposits: Vec::new(), flux: Flux::default() }
    }

    /// Accounts for a ray that carries some power; returns the landing and the power to deposit
    /// there.
    pub(super) fn account(&mut self, beam: &Beam, sent: DVec3) -> Option<(Landing, DVec3)> {
        let left = beam.transmittance * sent;
        match beam.end {
            End::Dry => return None,
            End::Landed(_) => {}
            End::Missed => self.flux.missed += left,
            End::Reflected => self.flux.reflected += left,
            End::Liquid => self.flux.liquid += left,
        }
        self.flux.sent += sent;
        self.flux.transmitted += left;
        beam.landing().map(|landing| (landing, left))
    }

    /// Deposits the light between three rays, `cell` apart, on the triangle between their landings;
    /// if these are not on one surface, each ray's third around its own landing.
    pub(super) fn lay_triangle(&mut self, corners: [&Beam; 3], sent: DVec3, cell: f64) {
        let thirds = corners.map(|beam| self.account(beam, sent / 3.0));
        if let [Some(a), Some(b), Some(c)] = thirds
            && let [Some(u), Some(v), Some(w)] = [a, b, c].map(|(landing, _)| landing.u)
            && together(corners)
        {
            self.lay(&[u, v, w], &a.0, a.1 + b.1 + c.1);
            return;
        }
        for (landing, power) in thirds.into_iter().flatten() {
            let Some(u) = landing.u else {
                self.flux.outside += power;
                continue;
            };
            let square = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)];
            self.lay(&square.map(|d| u + cell * DVec2::from(d)), &landing, power);
        }
    }

    /// Spreads power uniformly over a convex polygon in the map.
    pub(super) fn lay(&mut self, polygon: &[DVec2], landing: &Landing, power: DVec3) {
        let low = polygon.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = polygon.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        let centre = polygon.iter().sum::<DVec2>() / polygon.len() as f64;
        let size = self.size(landing);
        let framed = low.cmpge(DVec2::ZERO).all() && high.cmplt(size).all();
        if framed && low.floor() == high.floor() {
            self.deposit(low.floor().as_ivec2(), centre, landing, power);
            return;
        }
        let whole = Polygon::new(polygon);
        let area = whole.area();
        // Degenerates to a line or a point at a perfect focus: its area would be rounding.
        if area <= 1e-7 * (high - low).length() {
            for &u in polygon {
                self.lay_at(u, landing, power / polygon.len() as f64);
            }
            return;
        }
        let first = low.max(DVec2::ZERO).floor();
        let last = high.min(size - 0.5).floor();
        let mut laid = 0.0;
        let mut y = first.y;
        while y <= last.y {
            let strip = whole.cut(1, y, 1.0).cut(1, y + 1.0, -1.0);
            let mut x = first.x;
            while x <= last.x {
                let piece = strip.cut(0, x, 1.0).cut(0, x + 1.0, -1.0);
                let share = piece.area() / area;
                if share > 0.0 {
                    laid += share;
                    let texel = DVec2::new(x, y).as_ivec2();
                    self.deposit(texel, piece.middle(), landing, share * power);
                }
                x += 1.0;
            }
            y += 1.0;
        }
        if !framed {
            self.flux.outside += (1.0 - laid).max(0.0) * power;
        }
    }

    pub(super) fn lay_point(&mut self, landing: Landing, power: DVec3) {
        match landing.u {
            Some(u) => self.lay_at(u, &landing, power),
            None => self.flux.outside += power,
        }
    }

    /// Size of the landing's chart, pixels.
    fn size(&self, landing: &Landing) -> DVec2 {
        self.receivers[landing.chart].chart.view.size.as_dvec2()
    }

    pub(super) fn lay_at(&mut self, u: DVec2, landing: &Landing, power: DVec3) {
        if u.cmpge(DVec2::ZERO).all() && u.cmplt(self.size(landing)).all() {
            self.deposit(u.floor().as_ivec2(), u, landing, power);
        } else {
            self.flux.outside += power;
        }
    }

    fn deposit(&mut self, texel: IVec2, u: DVec2, landing: &Landing, power: DVec3) {
        match self.receivers[landing.chart].shows(texel, u, &landing.spot) {
            Some(i) => {
                self.flux.received += power;
                self.deposits.push((landing.chart as u32, i as u32, power));
            }
            None => self.flux.hidden += power,
        }
    }
}

/// Whether neighbouring rays passed through the same surfaces and landed on the same one.
pub(super) fn together(corners: [&Beam; 3]) -> bool {
    let spots = corners.map(|beam| {
        let [enter, leave] = beam.interfaces;
        [enter, leave, beam.landing().map(|landing| landing.spot)]
    });
    let charts = corners.map(|beam| beam.landing().map(|landing| landing.chart));
    if charts != [charts[0]; 3] {
        return false;
    }
    let pair = |i: usize, j: usize| {
        spots[i].iter().zip(&spots[j]).all(|pair| match pair {
            (Some(a), Some(b)) => a.continues(b),
            (None, None) => true,
            _ => false,
        })
    };
    pair(0, 1) && pair(1, 2) && pair(2, 0)
}

/// A convex polygon: at most a quadrilateral clipped by the four sides of a texel, which has eight
/// corners, and a few more where rounding duplicates some.
#[derive(Clone, Copy)]
pub(super) struct Polygon {
    pub(super) corners: [DVec2; 16],
    pub(super) count: usize,
}

impl Polygon {
    pub(super) fn new(corners: &[DVec2]) -> Self {
        let mut polygon = Self { corners: [DVec2::ZERO; 16], count: 0 };
        for &corner in corners {
            polygon.push(corner);
        }
        polygon
    }

    pub(super) fn push(&mut self, corner: DVec2) {
        let repeated = self.corners().last() == Some(&corner);
        if !repeated && self.count < self.corners.len() {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }

    pub(super) fn corners(&self) -> &[DVec2] {
        &self.corners[..self.count]
    }

    /// Clips to the positive (`side` = 1) or negative (−1) side of a line across an axis
    /// (Sutherland and Hodgman 1974).
    pub(super) fn cut(&self, axis: usize, at: f64, side: f64) -> Self {
        let mut part = Self::new(&[]);
        let corners = self.corners();
        for (i, &b) in corners.iter().enumerate() {
            let a = corners[(i + corners.len() - 1) % corners.len()];
            let (da, db) = (side * (a[axis] - at), side * (b[axis] - at));
            if (da < 0.0) != (db < 0.0) {
                let mut border = a.lerp(b, da / (da - db));
                border[axis] = at;
                part.push(border);
            }
            if db >= 0.0 {
                part.push(b);
            }
        }
        part
    }

    pub(super) fn area(&self) -> f64 {
        let corners = self.corners();
        let Some(&o) = corners.first() else { return 0.0 };
        // Relative to a corner, to keep precision anywhere in the map.
        let sides = corners.windows(2).map(|ab| (ab[0] - o).perp_dot(ab[1] - o));
        0.5 * sides.sum::<f64>().abs()
    }

    pub(super) fn middle(&self) -> DVec2 {
        self.corners().iter().sum::<DVec2>() / self.count.max(1) as f64
    }
}
