//! Refinement of the drawn surface: splats at the boundary of a body are moved along its normal, so that they end
//! at an iso-surface of the SPH density. Those of a sheet have the surface on both sides: they get its thickness.
//!
//! The mean of the neighbours places a splat by where its neighbours happen to be, so that single particles stand
//! out of a flat surface. The iso-surface averages over all of them. Meshes of SPH are made from it; the
//! level and the smoothing step are those of F. Löschner, T. Böttcher, S. R. Jeske and J. Bender, "Weighted
//! Laplacian Smoothing for Surface Reconstruction of Particle-based Fluids", Vision, Modeling, and Visualization
//! 2023, and of their program splashsurf. Instead of a mesh, each splat has one point of the surface, which moves
//! along its normal only.
//!
//! The density is Σ Vⱼ W(x − xⱼ), normalised by the volumes Vⱼ = mⱼ/ρⱼ, so that it is 1 inside whatever the
//! spacing. W is the cubic spline. The step of smoothing takes off a little of convex surfaces; putting it back,
//! as Taubin's and other filters do, brings back more noise than it is worth. Sums are relative to the member and in units of its radius r.

use glam::{DMat3, DVec3, Mat4, Vec3, Vec4};
use rayon::prelude::*;

use super::grid::{self, Grid};
use super::tree::Tree;
use super::{Cloud, Member, Splat, shape};
use crate::settings::{Classify, Kernel};

/// Radius of the kernel, in r.
const SUPPORT: f32 = 4.0;
/// Normalised density at the surface.
const LEVEL: f32 = 0.6;
/// Farthest that the surface may be from a particle, in r.
const FARTHEST: f32 = 3.0;
/// Radius of the mean of normals, in r.
const NORMALS: f32 = 3.0;
/// Radius of the smoothing step, in r.
const SMOOTHING: f32 = 3.5;
/// Offset of the neighbours' mean, in h, from which splats are moved, and at which they are moved all the way. Along
/// the short axis, the offsets at which a sheet begins to have two different sides, and at which it is none.
const OFFSETS: [f32; 2] = [0.05, 0.08];
/// Ratio of the two shorter axes up to which a splat is flat enough for a sheet's, and from which it is not.
const FLAT: [f32; 2] = [0.7, 0.9];
/// Largest distance between a particle of a sheet and the sheet's sides, in r.
const HALF_SHEET: f32 = 2.0;
/// Largest share by which one side's distance is reduced, so that axes stay positive.
const THINNEST: f64 = 0.75;
/// Cosine between normals from which points count in the mean of normals, and at which they do so fully: the other
/// side of a sheet does not.
const ONE_SIDE: [f32; 2] = [-0.5, 0.5];
/// The same for the smoothing step, which edges should survive.
const ONE_FACE: [f32; 2] = [0.35, 0.95];

/// Whether the settings ask for the refinement.
pub(super) fn refines(settings: &Classify) -> bool {
    settings.iso_surface && settings.kernel == Kernel::Fitted
}

/// Neighbours, at most, of a member whose splat may be moved.
pub(super) fn most_neighbours(support: f32) -> f64 {
    4.0 * grid::most_shared(support)
}

/// The mean of the neighbours, in h, of a member whose splat may be moved. Members with more neighbours than any
/// liquid has stay where they are, for their time.
pub(super) fn movable(
    mean: DVec3,
    neighbours: u32,
    surrounded: bool,
    settings: &Classify,
) -> Option<Vec3> {
    let crowd = f64::from(neighbours) > most_neighbours(settings.support);
    (refines(settings) && !surrounded && !crowd).then(|| mean.as_vec3())
}

/// Index that finds the members near a place. Both kinds call a member by its place in their own memory.
pub(super) enum Search<'a> {
    /// By cells.
    Grid(Grid<'a>),
    /// Where no grid serves.
    Tree(Tree<'a>),
}

impl Search<'_> {
    /// The same search for other members.
    fn like<'b>(&self, members: &'b [Member]) -> Search<'b> {
        match self {
            Self::Grid(grid) => Search::Grid(grid.like(members)),
            Self::Tree(_) => Search::Tree(Tree::new(members)),
        }
    }

    /// The indices of the members by their numbers.
    fn order(&self) -> Vec<u32> {
        match self {
            Self::Grid(grid) => grid.order().to_vec(),
            Self::Tree(tree) => (0..tree.members().len() as u32).collect(),
        }
    }

    /// The volume of a particle of `radius`, m, in the units of [`Search::places`].
    fn volume(&self, radius: f32) -> f32 {
        match self {
            Self::Grid(grid) => (radius / grid.radius()).powi(3),
            Self::Tree(_) => 1.0,
        }
    }

    /// As [`Search::near`], with several members at once: their first number, and the positions, m, and volumes of it and
    /// of those that follow it. `radius`: of the particle whose neighbours they are, m.
    fn places(
        &self,
        ends: [Vec3; 2],
        reach: f32,
        radius: f32,
        mut act: impl FnMut(usize, &[Vec4]),
    ) {
        match self {
            Self::Grid(grid) => {
                let (low, high) = around(ends, reach);
                grid.slots_of(low, high).for_each(|slots| act(slots.start, grid.places(slots)));
            }
            Self::Tree(tree) => self.near(ends, reach, |number| {
                let member = &tree.members()[number];
                act(number, &[member.position().extend(volume(member.radius, radius))]);
            }),
        }
    }

    /// Calls `act` with the numbers of all members within `reach` of the points from `a` to `b`, m, and of others.
    fn near(&self, [a, b]: [Vec3; 2], reach: f32, act: impl FnMut(usize)) {
        let (low, high) = around([a, b], reach);
        match self {
            Self::Grid(grid) => grid.slots_of(low, high).flatten().for_each(act),
            Self::Tree(tree) => {
                let half = 0.5 * (b.as_dvec3() - a.as_dvec3());
                tree.within(0.5 * a + 0.5 * b, f64::from(reach) * 1.001 + half.length(), act);
            }
        }
    }
}

/// A box around the points within `reach` of two others, with a margin for rounding.
fn around([a, b]: [Vec3; 2], reach: f32) -> (Vec3, Vec3) {
    let margin = 4.0 * f32::EPSILON * a.abs().max(b.abs());
    (a.min(b) - reach - margin, a.max(b) + reach + margin)
}

/// A line from a particle on which the surface is looked for.
#[derive(Clone, Copy)]
struct Line {
    /// Unit vector.
    out: Vec3,
    /// Farthest that the surface may be, in r.
    farthest: f32,
    /// Share of its way that the splat is moved.
    share: f32,
}

/// A particle whose splat may be moved.
struct Start {
    /// Index of its splat.
    aggregate: u32,
    at: Vec3,
    radius: f32,
    /// Out of the liquid.
    out: Option<Line>,
    /// To both sides of a sheet.
    sides: Option<[Line; 2]>,
    /// The sheet's normal, times the share by which the particle belongs to a sheet.
    sheet: Vec3,
}

impl Start {
    /// A start where there is something to look for. The mean is that of the neighbours, in h.
    fn new(aggregate: usize, splat: &Splat, mean: Vec3, member: &Member) -> Option<Self> {
        let offset = mean.length();
        let share = smoothstep(OFFSETS, offset);
        let line = |out, farthest, share| Line { out, farthest, share };
        let out = (offset >= OFFSETS[0]).then(|| line(-mean / offset, FARTHEST, share));
        let (axis, flatness) = shape::short_axis(splat.axes());
        let share =
            (1.0 - smoothstep(OFFSETS, mean.dot(axis).abs())) * (1.0 - smoothstep(FLAT, flatness));
        let sides = (share > 0.0).then(|| [axis, -axis].map(|out| line(out, HALF_SHEET, share)));
        (out.is_some() || sides.is_some()).then_some(Self {
            aggregate: aggregate as u32,
            at: member.position(),
            radius: member.radius,
            out,
            sides,
            sheet: share * axis,
        })
    }

    /// Ends of a line.
    fn ends(&self, line: &Line) -> [Vec3; 2] {
        [self.at, self.at + line.farthest * self.radius * line.out]
    }
}

/// A point of the surface.
#[derive(Clone, Copy)]
struct Point {
    /// Index of the splat.
    aggregate: u32,
    /// Share of its way that the splat is moved.
    share: f32,
    /// Out of a sheet, on whose side the point lies.
    side: Option<Vec3>,
    /// As [`Start::sheet`].
    sheet: Vec3,
    /// The particle.
    at: Vec3,
    radius: f32,
    /// From the particle, m.
    offset: Vec3,
    normal: Vec3,
}

impl Point {
    /// The change of its splat that makes it end at the smoothed surface, `level` r along the normal from here.
    fn change(&self, splat: &Splat, level: f32, shift: DVec3) -> Move {
        let centre = Vec3::from_array(splat.centre).as_dvec3();
        let surface = self.at.as_dvec3() - shift + self.offset.as_dvec3();
        let normal = self.normal.as_dvec3();
        let level = f64::from(self.radius * level);
        let share = f64::from(self.share);
        let Some(out) = self.side else {
            // The sides of a sheet have points of their own: this one is for its rim.
            let share = share * (1.0 - f64::from(self.normal.dot(self.sheet).abs()));
            let up = (surface - centre).dot(normal) + level - (splat.axes() * normal).length();
            return Move { step: share * up * normal, longer: DMat3::ZERO };
        };
        // The centre halfway between the sides: each moves it by half of its own way.
        let out = out.as_dvec3();
        let axis = (splat.axes() * out).length();
        let up = (surface + level * normal - centre).dot(out) - axis;
        let half = 0.5 * share * up.max(-THINNEST * axis);
        Move { step: half * out, longer: half * outer_product(out) }
    }
}

/// A point as its neighbours see it. Small, since most candidates are too far away to count.
#[derive(Clone, Copy)]
struct Neighbor {
    /// The particle.
    at: Vec3,
    /// From the particle, m.
    offset: Vec3,
    normal: Vec3,
}

impl Neighbor {
    fn of(point: &Point) -> Self {
        Self { at: point.at, offset: point.offset, normal: point.normal }
    }

    /// From a point to this one, in r. The digits of points far from the origin are kept.
    fn from(&self, point: &Point) -> Vec3 {
        ((self.at - point.at) + (self.offset - point.offset)) / point.radius
    }
}

/// A change of a splat.
struct Move {
    /// Of the centre, m.
    step: DVec3,
    /// Of the axes matrix, m.
    longer: DMat3,
}

fn outer_product(v: DVec3) -> DMat3 {
    DMat3::from_cols(v.x * v, v.y * v, v.z * v)
}

impl Cloud {
    /// Moves the splats that have a mean of neighbours.
    pub(super) fn refine(&self, splats: &mut [Splat], means: &[Option<Vec3>], search: &Search<'_>) {
        let starts = self.starts(splats, means);
        if starts.is_empty() {
            return;
        }
        let densities = self.densities(search, &starts);
        let points: Vec<Point> = starts
            .par_iter()
            .map_init(Field::default, |field, start| field.points(start, search, &densities))
            .flatten_iter()
            .collect();
        drop(densities);
        let places: Vec<Member> = points
            .iter()
            .map(|p| Member {
                position: (p.at + p.offset).to_array(),
                radius: p.radius,
                particle: 0,
                fluid: 0,
            })
            .collect();
        let search = search.like(&places);
        let order = search.order();
        let mut points: Vec<Point> = order.par_iter().map(|&i| points[i as usize]).collect();
        let near: Vec<Neighbor> = points.par_iter().map(Neighbor::of).collect();
        points.par_iter_mut().for_each(|p| p.normal = mean_normal(p, &search, &near));
        let near: Vec<Neighbor> = points.par_iter().map(Neighbor::of).collect();
        let moves: Vec<Move> = points
            .par_iter()
            .map(|p| {
                let level = smoothing(p, &search, &near);
                p.change(&splats[p.aggregate as usize], level, self.shift)
            })
            .collect();
        for (point, change) in points.iter().zip(&moves) {
            splats[point.aggregate as usize].change(change.step, change.longer);
        }
    }

    fn starts(&self, splats: &[Splat], means: &[Option<Vec3>]) -> Vec<Start> {
        let start = |(i, (splat, &mean)): (usize, (&Splat, &Option<Vec3>))| {
            let mean = mean?;
            let member = self.members.binary_search_by_key(&splat.particle, |m| m.particle);
            Start::new(i, splat, mean, &self.members[member.expect("splats are members'")])
        };
        splats.par_iter().zip(means).enumerate().filter_map(start).collect()
    }

    /// Densities at the members near the starts, relative to those of the members alone, by the numbers of the search;
    /// at others they are 0.
    fn densities(&self, search: &Search<'_>, starts: &[Start]) -> Vec<f32> {
        match search {
            Search::Grid(grid) => {
                let mut marked = vec![false; grid.cells()];
                for start in starts {
                    for line in start.out.iter().chain(start.sides.iter().flatten()) {
                        let (low, high) = around(start.ends(line), SUPPORT * start.radius);
                        for cells in grid.cells_of(low, high) {
                            marked[cells.start as usize..cells.end as usize].fill(true);
                        }
                    }
                }
                grid.map_marked(&marked, SUPPORT, density)
            }
            Search::Tree(tree) => {
                let density = |member: &Member| {
                    let mut sum = 0.0;
                    let reach = f64::from(SUPPORT * member.radius);
                    let at = member.position().as_dvec3();
                    tree.within(member.position(), reach, |other| {
                        let other = &self.members[other];
                        let d = other.position().as_dvec3().distance(at) / reach;
                        let w = spline(Vec4::splat(d as f32)).x;
                        sum += f64::from(volume(other.radius, member.radius) * w);
                    });
                    sum as f32
                };
                self.members.par_iter().map(density).collect()
            }
        }
    }
}

/// The cubic spline kernel, 1 at 0 and 0 from 1 on.
fn spline(q: Vec4) -> Vec4 {
    let outer = (Vec4::ONE - q).max(Vec4::ZERO);
    let inner = (Vec4::splat(0.5) - q).max(Vec4::ZERO);
    2.0 * outer * outer * outer - 8.0 * inner * inner * inner
}

/// Its derivative.
fn slope(q: Vec4) -> Vec4 {
    let outer = (Vec4::ONE - q).max(Vec4::ZERO);
    let inner = (Vec4::splat(0.5) - q).max(Vec4::ZERO);
    24.0 * inner * inner - 6.0 * outer * outer
}

/// Volume of a particle relative to another one's. Bounded, so that products stay finite.
fn volume(of: f32, relative_to: f32) -> f32 {
    (of / relative_to).clamp(1e-9, 1e9).powi(3)
}

/// Density at a member with this position and relative volume, of candidates in packets.
fn density(own: Vec4, per_h: f32, packets: &[Mat4]) -> f32 {
    let from = [own.x, own.y, own.z].map(Vec4::splat);
    let mut sum = Vec4::ZERO;
    for packet in packets {
        let x = (packet.x_axis - from[0]) * per_h;
        let y = (packet.y_axis - from[1]) * per_h;
        let z = (packet.z_axis - from[2]) * per_h;
        let square = x * x + y * y + z * z;
        sum += packet.w_axis * spline(square.sqrt());
    }
    sum.element_sum() / own.w
}

/// 0 to 1 between two edges.
fn smoothstep([low, high]: [f32; 2], x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The normalised density along a member's line: the members near by, relative to it and in units of its radius.
#[derive(Default)]
struct Field {
    near: Vec<Vec4>,
    /// Transposed in groups of four: x, y, z and volume over density.
    packets: Vec<Mat4>,
}

impl Field {
    /// The surface around a particle: out of the liquid, and both sides of a sheet.
    fn points(
        &mut self,
        start: &Start,
        search: &Search<'_>,
        densities: &[f32],
    ) -> impl Iterator<Item = Point> + use<> {
        let mut point = |line: &Line| {
            self.gather(start, line, search, densities);
            self.point(start, line)
        };
        let out = start.out.as_ref().and_then(&mut point);
        let sides = start.sides.as_ref().and_then(|[a, b]| Some([point(a)?, point(b)?]));
        let of_side = |(line, p): (Line, Point)| Point { side: Some(line.out), ..p };
        let sides = start.sides.into_iter().flatten().zip(sides.into_iter().flatten());
        out.into_iter().chain(sides.map(of_side))
    }

    fn gather(&mut self, start: &Start, line: &Line, search: &Search<'_>, densities: &[f32]) {
        self.near.clear();
        let per_r = 1.0 / start.radius;
        let per_volume = 1.0 / search.volume(start.radius);
        let (farthest, limit) = (Vec4::splat(line.farthest), Vec4::splat(SUPPORT * SUPPORT));
        let (from, out) = (start.at, line.out);
        let reach = SUPPORT * start.radius;
        search.places(start.ends(line), reach, start.radius, |first, places| {
            for (first, four) in (first..).step_by(4).zip(places.chunks(4)) {
                let mut columns = [Vec4::INFINITY; 4];
                columns[..four.len()].copy_from_slice(four);
                let rows = Mat4::from_cols_array_2d(&columns.map(|v| v.to_array())).transpose();
                let x = (rows.x_axis - from.x) * per_r;
                let y = (rows.y_axis - from.y) * per_r;
                let z = (rows.z_axis - from.z) * per_r;
                let along = (x * out.x + y * out.y + z * out.z).max(Vec4::ZERO).min(farthest);
                let (dx, dy, dz) = (x - along * out.x, y - along * out.y, z - along * out.z);
                // False for an offset that overflows.
                let mut within = (dx * dx + dy * dy + dz * dz).cmplt(limit).bitmask();
                while within != 0 {
                    let i = within.trailing_zeros() as usize;
                    within &= within - 1;
                    let weight = rows.w_axis[i] * per_volume / densities[first + i];
                    self.near.push(Vec4::new(x[i], y[i], z[i], weight));
                }
            }
        });
        self.near.resize(self.near.len().next_multiple_of(4), Vec4::ZERO);
        self.packets.clear();
        let packets = self.near.chunks_exact(4);
        self.packets.extend(packets.map(|v| Mat4::from_cols(v[0], v[1], v[2], v[3]).transpose()));
    }

    fn value(&self, at: Vec3) -> f32 {
        let mut sum = Vec4::ZERO;
        for packet in &self.packets {
            let x = packet.x_axis - at.x;
            let y = packet.y_axis - at.y;
            let z = packet.z_axis - at.z;
            let distance = (x * x + y * y + z * z).sqrt();
            sum += packet.w_axis * spline(distance / SUPPORT);
        }
        sum.element_sum()
    }

    /// A vector along the gradient.
    fn gradient(&self, at: Vec3) -> Vec3 {
        let mut sums = [Vec4::ZERO; 3];
        for packet in &self.packets {
            let x = at.x - packet.x_axis;
            let y = at.y - packet.y_axis;
            let z = at.z - packet.z_axis;
            let distance = (x * x + y * y + z * z).sqrt();
            // The slope at 0 is 0.
            let along = distance.max(Vec4::splat(1e-6));
            let w = packet.w_axis * slope(distance / SUPPORT) / along;
            sums = [sums[0] + w * x, sums[1] + w * y, sums[2] + w * z];
        }
        sums.map(Vec4::element_sum).into()
    }

    /// The first place on the line at which the density falls below the level.
    fn point(&self, start: &Start, line: &Line) -> Option<Point> {
        /// Steps along the line, and of the search between two of them.
        const STEPS: [u32; 2] = [6, 4];
        let out = line.out;
        let above = |t: f32| self.value(t * out) - LEVEL;
        let (mut inner, mut outer) = ((0.0, above(0.0)), (0.0, 0.0));
        if inner.1 < 0.0 {
            return None;
        }
        for step in 1..=STEPS[0] {
            let t = line.farthest * step as f32 / STEPS[0] as f32;
            outer = (t, above(t));
            if outer.1 < 0.0 {
                break;
            }
            inner = outer;
        }
        if outer.1 >= 0.0 {
            return None;
        }
        // The Illinois variant of the false position: superlinear, and never outside the bracket.
        let between = |inner: (f32, f32), outer: (f32, f32)| {
            inner.0 + (outer.0 - inner.0) * inner.1 / (inner.1 - outer.1)
        };
        let mut last = 0;
        for _ in 0..STEPS[1] {
            let t = between(inner, outer);
            let value = above(t);
            if value >= 0.0 {
                inner = (t, value);
                outer.1 *= if last == 1 { 0.5 } else { 1.0 };
                last = 1;
            } else {
                outer = (t, value);
                inner.1 *= if last == -1 { 0.5 } else { 1.0 };
                last = -1;
            }
        }
        let place = between(inner, outer) * out;
        let normal = (-self.gradient(place)).try_normalize()?;
        let offset = start.radius * place;
        (start.at + offset).is_finite().then_some(Point {
            aggregate: start.aggregate,
            share: line.share,
            side: None,
            sheet: start.sheet,
            at: start.at,
            radius: start.radius,
            offset,
            normal,
        })
    }
}

/// Normal at a point, averaged over the points around it.
fn mean_normal(point: &Point, search: &Search<'_>, points: &[Neighbor]) -> Vec3 {
    let mut sum = Vec3::ZERO;
    search.near([point.at + point.offset; 2], NORMALS * point.radius, |other| {
        let other = &points[other];
        let near = 1.0 - other.from(point).length_squared() / (NORMALS * NORMALS);
        if near > 0.0 {
            let w = near * near * smoothstep(ONE_SIDE, point.normal.dot(other.normal));
            sum += w * other.normal;
        }
    });
    sum.try_normalize().unwrap_or(point.normal)
}

/// How far a step of Laplacian smoothing moves a point along its normal, in r.
fn smoothing(point: &Point, search: &Search<'_>, points: &[Neighbor]) -> f32 {
    let (mut sum, mut weight) = (0.0, 0.0);
    search.near([point.at + point.offset; 2], SMOOTHING * point.radius, |other| {
        let other = &points[other];
        let to = other.from(point);
        let near = 1.0 - to.length_squared() / (SMOOTHING * SMOOTHING);
        if near > 0.0 {
            let w = near * near * smoothstep(ONE_FACE, point.normal.dot(other.normal));
            sum += w * to.dot(point.normal);
            weight += w;
        }
    });
    if weight > 0.0 { sum / weight } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The constants are the same in Rust and WGSL.
    #[test]
    fn constants_match_the_shaders() {
        let [points, shape] = ["classify/points.wgsl", "classify/shape.wgsl"];
        let [normals, moves] = ["classify/normals.wgsl", "classify/move.wgsl"];
        let table = [
            (points, "FIELD", SUPPORT),
            (points, "LEVEL", LEVEL),
            (points, "FARTHEST", FARTHEST),
            (points, "HALF_SHEET", HALF_SHEET),
            (points, "LEAST_OFFSET", OFFSETS[0]),
            (points, "FULL_OFFSET", OFFSETS[1]),
            (shape, "FLAT", FLAT[0]),
            (shape, "NOT_FLAT", FLAT[1]),
            (normals, "NORMALS", NORMALS),
            (normals, "OTHER_SIDE_FROM", ONE_SIDE[0]),
            (normals, "ONE_SIDE", ONE_SIDE[1]),
            (moves, "SMOOTHING", SMOOTHING),
            (moves, "OTHER_FACE", ONE_FACE[0]),
            (moves, "ONE_FACE", ONE_FACE[1]),
            (moves, "THINNEST", THINNEST as f32),
        ];
        for (file, name, value) in table {
            assert_eq!(crate::gpu::shader::constant(file, name) as f32, value, "{file}: {name}");
        }
    }
}
