//! Liquid at walls: wetting, and keeping splats from showing through thin walls.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{Splat, Splats};
use crate::scene::{Shape, Solid};

/// Makes aggregates wet the solids that they rest on: for each splat whose centre is within `reach` radii
/// of a solid, adds a copy moved along the solid's normal onto its surface. Planes are wetted from both
/// sides.
///
/// SPH boundaries keep liquid one particle spacing off a wall. Without the copies there is a visible
/// gap, with total reflection that a real tank does not have.
pub fn add_wall_contacts(splats: &mut Splats, solids: &[Solid], reach: f32) {
    add_copies(splats, solids, reach, &[1.0]);
}

/// As [`add_wall_contacts`] for opaque bodies, with another copy half-way to the solid: light enters clear liquid through the
/// groove between a splat and its copy, but an opaque body shows it.
pub fn add_closed_wall_contacts(splats: &mut Splats, solids: &[Solid], reach: f32) {
    add_copies(splats, solids, reach, &[0.5, 1.0]);
}

/// Adds copies of the aggregates within `reach` radii of a solid, moved by these shares of the way to its surface.
fn add_copies(splats: &mut Splats, solids: &[Solid], reach: f32, shares: &[f64]) {
    let origin = splats.origin;
    let touching = |splat: &Splat, number: u32, solid: &Solid| {
        let centre = Vec3::from_array(splat.centre).as_dvec3();
        let limit = f64::from(reach * splat.radius);
        let (distance, normal) = beside(&solid.shape, origin + centre, limit)?;
        let tags = match &solid.shape {
            Shape::Plane { normal: own, .. } => wall(number, own.as_dvec3(), normal),
            shape if shape.is_sheet() => {
                let (_, own) = shape.distance_within(origin + centre, limit)?;
                wall(number, own, normal)
            }
            _ => 0,
        };
        (distance > 0.0).then(|| {
            let copy = |share: &f64| Splat {
                centre: (centre - share * distance * normal).as_vec3().to_array(),
                tags: splat.tags | tags,
                ..*splat
            };
            shares.iter().map(copy).collect::<Vec<_>>()
        })
    };
    let aggregates = &splats.aggregates;
    let copies: Vec<_> = aggregates
        .par_iter()
        .flat_map_iter(|splat| {
            let solids = (1..).zip(solids);
            solids.filter_map(move |(number, solid)| touching(splat, number, solid)).flatten()
        })
        .collect();
    splats.aggregates.extend(copies);
}

/// Distance from a solid, negative inside, and the unit normal there, if the surface is within `limit`. The
/// normal of a sheet points to the side of `x`.
fn beside(shape: &Shape, x: DVec3, limit: f64) -> Option<(f64, DVec3)> {
    let (distance, normal) = shape.distance_within(x, limit)?;
    let flips = distance < 0.0 && shape.is_sheet();
    Some(if flips { (-distance, -normal) } else { (distance, normal) })
}

/// Tag bits that record the sheet of a copy and its original side, which its position no longer tells.
/// `normal` is the sheet's own there.
fn wall(number: u32, normal: DVec3, towards: DVec3) -> u32 {
    let behind = normal.dot(towards) < 0.0;
    number << Splat::WALL | if behind { Splat::WALL_FROM_BEHIND } else { 0 }
}

/// The eye of a view.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Eye {
    /// At a point, m (perspective).
    At(DVec3),
    /// Infinitely far away in this direction (orthographic).
    Towards(DVec3),
}

impl Eye {
    /// Direction from a point towards the eye, of any length.
    fn direction(self, x: DVec3) -> DVec3 {
        match self {
            Self::At(eye) => eye - x,
            Self::Towards(direction) => direction,
        }
    }
}

/// Returns the splats, which have this extent, adjusted for a view that sees thin solids from behind, or `None` if none
/// changes.
///
/// A splat at a wall penetrates it by its own size, and would show on the far side of a plane or a thin
/// box. If the eye is on that side, the splat is moved back until it no longer protrudes, with a margin for smoothing; the
/// wall hides the displacement. Views from the liquid's side do not change.
pub(crate) fn seen_past_walls(
    splats: &Splats,
    extent: Extent,
    solids: &[Solid],
    eye: Eye,
) -> Option<Splats> {
    if solids.is_empty() {
        return None;
    }
    let walls: Vec<_> = (1..)
        .zip(solids)
        .filter(|(_, solid)| extent.may_pass(&solid.shape, eye))
        .map(|(number, solid)| Wall::new(number, &solid.shape, splats))
        .collect();
    if walls.is_empty() {
        return None;
    }
    // Smoothing moves surfaces slightly, and pixels at a slanted wall are deep; the default contact distance is
    // longer than this margin.
    let margin = 0.4 * f64::from(splats.radius);
    let moved = |splat: &Splat| {
        let mut centre = splats.origin + Vec3::from_array(splat.centre).as_dvec3();
        let longest = splat.longest();
        let mut any = false;
        for wall in &walls {
            let Some((distance, normal)) = wall.to(splat, centre, longest) else { continue };
            let reach = reach_along(splat, normal) - distance;
            let thickness = thickness(wall.shape, centre - distance * normal, normal, longest);
            let far_side = centre - (distance + thickness) * normal;
            if reach + margin > thickness && eye.direction(far_side).dot(normal) < 0.0 {
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

/// A solid that splats may penetrate.
struct Wall<'a> {
    /// Number of the solid, from 1.
    number: u32,
    shape: &'a Shape,
    /// Normal towards the liquid, for a plane with liquid on one side only, leaked particles aside.
    side: Option<DVec3>,
}

/// Smallest ratio between the particles on the two sides of a plane at which the minority counts as
/// leaked.
const LEAKS: usize = 20;

impl<'a> Wall<'a> {
    fn new(number: u32, shape: &'a Shape, splats: &Splats) -> Self {
        let Shape::Plane { normal, .. } = shape else { return Self { number, shape, side: None } };
        let normal = normal.as_dvec3();
        let sides = |splat: &Splat| {
            let centre = splats.origin + Vec3::from_array(splat.centre).as_dvec3();
            let near = beside(shape, centre, f64::from(2.0 * splat.radius));
            let counts = near.is_some() && !splat.is_copy();
            let towards = near.map_or(DVec3::ZERO, |(_, towards)| towards);
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

    /// As [`beside`], but relative to the side that the splat belongs to: for a copy on a sheet its
    /// original side, for a leaked particle the side of the others.
    fn to(&self, splat: &Splat, centre: DVec3, limit: f64) -> Option<(f64, DVec3)> {
        let (mut distance, mut towards) = beside(self.shape, centre, limit)?;
        if self.shape.is_sheet() && splat.tags >> Splat::WALL & 0x3ff == self.number {
            let (_, normal) = self.shape.distance_within(centre, limit)?;
            let behind = splat.tags & Splat::WALL_FROM_BEHIND != 0;
            towards = if behind { -normal } else { normal };
            distance = 0.0;
        }
        Some(match self.side {
            Some(side) if side.dot(towards) < 0.0 && distance <= f64::from(splat.radius) => {
                (-distance, side)
            }
            _ => (distance, towards),
        })
    }
}

/// Extent of a splat from its centre in the direction of a unit vector, m.
fn reach_along(splat: &Splat, n: DVec3) -> f64 {
    (splat.axes() * n).length()
}

/// Extent of a solid along a unit normal, m, behind a point of its surface; at least `limit` if it is more.
fn thickness(shape: &Shape, surface: DVec3, normal: DVec3, limit: f64) -> f64 {
    match *shape {
        Shape::Mesh { ref mesh, placement } if mesh.is_closed() => {
            let at = placement.mesh_from_world(surface) - mesh.origin();
            let direction = placement.rotate.conjugate() * -normal;
            let most = limit / placement.scale;
            placement.scale * mesh.hit(at, direction, 1e-6 * most, most).unwrap_or(most)
        }
        Shape::Mesh { .. } => 0.0,
        Shape::Plane { .. } => 0.0,
        Shape::Box { min, max } => normal.abs().dot(max - min),
        Shape::Sphere { radius, .. } => 2.0 * f64::from(radius),
    }
}

/// Bounding box of the splat centres, m, and the largest splat extent.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Extent {
    pub(crate) min: DVec3,
    pub(crate) max: DVec3,
    pub(crate) reach: f64,
}

impl Extent {
    /// Whether a splat may protrude from a solid towards the eye.
    fn may_pass(&self, shape: &Shape, eye: Eye) -> bool {
        match *shape {
            Shape::Plane { origin, normal, .. } => {
                let normal = normal.as_dvec3();
                let towards =
                    if eye.direction(origin).dot(normal) < 0.0 { -normal } else { normal };
                let middle = (0.5 * (self.min + self.max) - origin).dot(towards);
                let nearest = middle - towards.abs().dot(0.5 * (self.max - self.min));
                // Ignores copies, which lie on the plane up to rounding.
                nearest < -1e-4 * self.reach
            }
            Shape::Box { min, max } => {
                let near = self.min.cmple(max + self.reach) & self.max.cmpge(min - self.reach);
                (max - min).min_element() < self.reach && near.all()
            }
            Shape::Mesh { ref mesh, placement } => {
                let (low, high) = mesh.bounds();
                let (low, high) = (low.as_dvec3(), high.as_dvec3());
                let middle = placement.world_from_mesh(mesh.origin() + 0.5 * (low + high));
                let axes = glam::DMat3::from_quat(placement.rotate).abs();
                let beside = 0.5 * placement.scale * (axes * (high - low)) + self.reach;
                (self.min.cmple(middle + beside) & self.max.cmpge(middle - beside)).all()
            }
            Shape::Sphere { center, radius } => {
                let beside = self.reach + f64::from(radius);
                let near = self.min.cmple(center + beside) & self.max.cmpge(center - beside);
                2.0 * f64::from(radius) < self.reach && near.all()
            }
        }
    }
}
