//! Liquid at walls: where it wets them, and that it does not come out of their other side.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{Splat, Splats};
use crate::scene::{Shape, Solid};

/// Lets aggregates wet the solids they rest on: a splat whose centre is within `reach` radii of a
/// solid is drawn a second time, moved along the solid's normal onto its surface. Planes are wet from
/// either side.
///
/// SPH boundaries hold liquid a particle's spacing off a wall. Without the copies a gap shows
/// between the two, and in it light is totally reflected that in a real tank never meets air.
pub fn wet(splats: &mut Splats, solids: &[Solid], reach: f32) {
    let origin = splats.origin;
    let touching = |splat: &Splat, number: u32, solid: &Solid| {
        let centre = Vec3::from_array(splat.centre).as_dvec3();
        let (distance, normal) = beside(&solid.shape, origin + centre);
        let near = distance > 0.0 && distance <= f64::from(reach * splat.radius);
        let moved = centre - distance * normal;
        near.then(|| Splat {
            centre: moved.as_vec3().to_array(),
            tags: splat.tags | wall(number, &solid.shape, normal),
            ..*splat
        })
    };
    let aggregates = &splats.aggregates;
    let copies: Vec<_> = aggregates
        .par_iter()
        .flat_map_iter(|splat| {
            let solids = (1..).zip(solids);
            solids.filter_map(move |(number, solid)| touching(splat, number, solid))
        })
        .collect();
    splats.aggregates.extend(copies);
}

/// Distance from a solid, negative inside, and the unit normal towards `x`: a plane's from the side
/// that `x` is on.
fn beside(shape: &Shape, x: DVec3) -> (f64, DVec3) {
    let (distance, normal) = shape.distance(x);
    match shape {
        Shape::Plane { .. } if distance < 0.0 => (-distance, -normal),
        _ => (distance, normal),
    }
}

/// What tells of a copy on a plane from which side it came: its place no longer does.
fn wall(number: u32, shape: &Shape, towards: DVec3) -> u32 {
    let Shape::Plane { normal, .. } = shape else { return 0 };
    let behind = normal.as_dvec3().dot(towards) < 0.0;
    number << Splat::WALL | if behind { Splat::WALL_FROM_BEHIND } else { 0 }
}

/// Where a view looks from.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Eye {
    /// From a point, m.
    At(DVec3),
    /// From far away, in this direction.
    Towards(DVec3),
}

impl Eye {
    /// Towards the eye from a point, of any length.
    fn direction(self, x: DVec3) -> DVec3 {
        match self {
            Self::At(eye) => eye - x,
            Self::Towards(direction) => direction,
        }
    }
}

/// Splats as a view is to see them that looks at thin solids from behind; none if all stay as they
/// are.
///
/// A splat at a wall reaches into it by its own size, which a plane or a thin box does not hide from
/// the other side. From there it is moved back until nothing of it comes out of the wall; the wall
/// hides that it was. From the liquid's own side nothing changes.
pub(crate) fn seen_past_walls(splats: &Splats, solids: &[Solid], eye: Eye) -> Option<Splats> {
    if solids.is_empty() {
        return None;
    }
    let extent = Extent::of(splats)?;
    let walls: Vec<_> = (1..)
        .zip(solids)
        .filter(|(_, solid)| extent.may_pass(&solid.shape, eye))
        .map(|(number, solid)| Wall::new(number, &solid.shape, splats))
        .collect();
    if walls.is_empty() {
        return None;
    }
    // Smoothing moves surfaces a little; the default contact bridges twice as much.
    let margin = 0.25 * f64::from(splats.radius);
    let moved = |splat: &Splat| {
        let mut centre = splats.origin + Vec3::from_array(splat.centre).as_dvec3();
        let longest = splat.longest();
        let mut any = false;
        for wall in &walls {
            let (distance, normal) = wall.to(splat, centre);
            if distance > longest {
                continue;
            }
            let reach = reach_along(splat, normal) - distance;
            let thickness = thickness(wall.shape, normal);
            let far_side = centre - (distance + thickness) * normal;
            if reach > thickness && eye.direction(far_side).dot(normal) < 0.0 {
                centre += (reach + margin) * normal;
                any = true;
            }
        }
        any.then(|| Splat { centre: (centre - splats.origin).as_vec3().to_array(), ..*splat })
    };
    let all = |list: &[Splat]| -> Vec<(usize, Splat)> {
        let moved = |(i, splat)| moved(splat).map(|splat| (i, splat));
        list.par_iter().enumerate().filter_map(moved).collect()
    };
    let (aggregates, splashes) = (all(&splats.aggregates), all(&splats.splashes));
    if aggregates.is_empty() && splashes.is_empty() {
        return None;
    }
    let mut seen = splats.clone();
    for (i, splat) in aggregates {
        seen.aggregates[i] = splat;
    }
    for (i, splat) in splashes {
        seen.splashes[i] = splat;
    }
    Some(seen)
}

/// A solid that splats may reach through.
struct Wall<'a> {
    /// From 1.
    number: u32,
    shape: &'a Shape,
    /// The normal of the one side of a plane that liquid is on, but for particles that leak through it.
    side: Option<DVec3>,
}

/// Of the particles at a plane, at most one in so many leaks through it.
const LEAKS: usize = 20;

impl<'a> Wall<'a> {
    fn new(number: u32, shape: &'a Shape, splats: &Splats) -> Self {
        let Shape::Plane { normal, .. } = shape else { return Self { number, shape, side: None } };
        let normal = normal.as_dvec3();
        let sides = |splat: &Splat| {
            let centre = splats.origin + Vec3::from_array(splat.centre).as_dvec3();
            let (distance, towards) = beside(shape, centre);
            let counts = distance <= f64::from(2.0 * splat.radius) && !splat.is_copy();
            let front = towards.dot(normal) > 0.0;
            [usize::from(counts && front), usize::from(counts && !front)]
        };
        let sum = |a: [usize; 2], b: [usize; 2]| [a[0] + b[0], a[1] + b[1]];
        let all = splats.aggregates.par_iter().chain(&splats.splashes);
        let [front, behind] = all.map(sides).reduce(|| [0, 0], sum);
        let side = if behind * LEAKS < front {
            Some(normal)
        } else if front * LEAKS < behind {
            Some(-normal)
        } else {
            None
        };
        Self { number, shape, side }
    }

    /// As [`beside`], from the side that a splat belongs to: a copy on a plane to that which it came
    /// from, and one that leaks to that of the others.
    fn to(&self, splat: &Splat, centre: DVec3) -> (f64, DVec3) {
        let (mut distance, mut towards) = beside(self.shape, centre);
        if let Shape::Plane { normal, .. } = self.shape
            && splat.tags >> Splat::WALL & 0x3ff == self.number
        {
            let behind = splat.tags & Splat::WALL_FROM_BEHIND != 0;
            towards = if behind { -normal.as_dvec3() } else { normal.as_dvec3() };
            distance = 0.0;
        }
        match self.side {
            Some(side) if side.dot(towards) < 0.0 && distance <= f64::from(splat.radius) => {
                (-distance, side)
            }
            _ => (distance, towards),
        }
    }
}

/// How far a splat reaches from its centre in the direction of a unit vector, m.
fn reach_along(splat: &Splat, n: DVec3) -> f64 {
    (splat.axes() * n).length()
}

/// A solid's extent along a unit normal, m.
fn thickness(shape: &Shape, normal: DVec3) -> f64 {
    match *shape {
        Shape::Plane { .. } => 0.0,
        Shape::Box { min, max } => normal.abs().dot(max - min),
        Shape::Sphere { radius, .. } => 2.0 * f64::from(radius),
    }
}

/// The box around the centres of a frame's splats, m, and how far any reaches from its own.
struct Extent {
    min: DVec3,
    max: DVec3,
    reach: f64,
}

impl Extent {
    fn of(splats: &Splats) -> Option<Self> {
        let empty = || (Vec3::INFINITY, Vec3::NEG_INFINITY, 0.0f64);
        let join =
            |a: (Vec3, Vec3, f64), b: (Vec3, Vec3, f64)| (a.0.min(b.0), a.1.max(b.1), a.2.max(b.2));
        let one = |splat: &Splat| {
            let centre = Vec3::from_array(splat.centre);
            (centre, centre, splat.longest())
        };
        let all = splats.aggregates.par_iter().chain(&splats.splashes);
        let (min, max, reach) = all.map(one).reduce(empty, join);
        let place = |x: Vec3| splats.origin + x.as_dvec3();
        min.is_finite().then(|| Self { min: place(min), max: place(max), reach })
    }

    /// Whether a splat may reach through a solid, towards the eye.
    fn may_pass(&self, shape: &Shape, eye: Eye) -> bool {
        match *shape {
            Shape::Plane { origin, normal, .. } => {
                let normal = normal.as_dvec3();
                let towards =
                    if eye.direction(origin).dot(normal) < 0.0 { -normal } else { normal };
                let middle = (0.5 * (self.min + self.max) - origin).dot(towards);
                let nearest = middle - towards.abs().dot(0.5 * (self.max - self.min));
                // Copies are on the plane but for rounding.
                nearest < -1e-4 * self.reach
            }
            Shape::Box { min, max } => {
                let near = self.min.cmple(max + self.reach) & self.max.cmpge(min - self.reach);
                (max - min).min_element() < self.reach && near.all()
            }
            Shape::Sphere { center, radius } => {
                let beside = self.reach + f64::from(radius);
                let near = self.min.cmple(center + beside) & self.max.cmpge(center - beside);
                2.0 * f64::from(radius) < self.reach && near.all()
            }
        }
    }
}
