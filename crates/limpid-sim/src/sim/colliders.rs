//! Obstacles: the scene's solids and the simulation's bounds.

use std::sync::Arc;

use glam::{Vec3, Vec4, Vec4Swizzles as _};

use super::Extent;
use limpid::mesh::{Mesh, Placement};
use limpid::scene::{Shape, Solid};

/// An obstacle, convex unless it is a mesh. The 32-bit counterpart of [`Shape::distance`], with half-spaces
/// for walls, and finite planes as square plates, as they are drawn.
#[derive(Debug, Clone)]
enum Collider {
    /// All x with normal·x below `offset`.
    HalfSpace {
        normal: Vec3,
        offset: f32,
    },
    /// A square without thickness.
    Plate {
        origin: Vec3,
        normal: Vec3,
        half_extent: f32,
    },
    Box {
        center: Vec3,
        half: Vec3,
    },
    Sphere {
        center: Vec3,
        radius: f32,
    },
    Mesh {
        mesh: Arc<Mesh>,
        placement: Placement,
    },
}

impl Collider {
    /// Distance from `x` to the surface, negative inside, and the unit normal towards `x`; `None` if the
    /// surface of a mesh is farther than `limit`.
    fn distance(&self, x: Vec3, limit: f32) -> Option<(f32, Vec3)> {
        if let Self::Mesh { mesh, placement } = self {
            let at = placement.mesh_from_world(x.as_dvec3()) - mesh.origin();
            let nearest = mesh.nearest(at, f64::from(limit) / placement.scale)?;
            let behind = nearest.distance < 0.0 && !mesh.is_closed();
            let sign = if behind { -1.0 } else { 1.0 };
            let normal = placement.rotate * (sign * nearest.normal);
            return Some(((sign * placement.scale * nearest.distance) as f32, normal.as_vec3()));
        }
        Some(self.convex_distance(x))
    }

    /// As [`Collider::distance`], for all but meshes.
    fn convex_distance(&self, x: Vec3) -> (f32, Vec3) {
        match *self {
            Self::Mesh { .. } => (f32::INFINITY, Vec3::Y),
            Self::HalfSpace { normal, offset } => (normal.dot(x) - offset, normal),
            Self::Plate { origin, normal, half_extent } => {
                let offset = x - origin;
                let above = normal.dot(offset);
                let a = normal.abs();
                // The two coordinate axes closest to the plane, as in drawing.
                let axes = if a.y >= a.x.max(a.z) {
                    Vec3::new(1.0, 0.0, 1.0)
                } else if a.x >= a.z {
                    Vec3::new(0.0, 1.0, 1.0)
                } else {
                    Vec3::new(1.0, 1.0, 0.0)
                };
                let within = axes * offset;
                let beside =
                    within - within.clamp(-Vec3::splat(half_extent), Vec3::splat(half_extent));
                let nearest = above * normal + beside;
                let towards = if above < 0.0 { -normal } else { normal };
                (nearest.length(), nearest.normalize_or(towards))
            }
            Self::Box { center, half } => {
                let offset = x - center;
                let face = offset.abs() - half;
                let outside = face.max(Vec3::ZERO);
                let sign = Vec3::ONE.copysign(offset);
                if outside == Vec3::ZERO {
                    let normal = if face.x >= face.y.max(face.z) {
                        Vec3::X
                    } else if face.y >= face.z {
                        Vec3::Y
                    } else {
                        Vec3::Z
                    };
                    (face.max_element(), sign * normal)
                } else {
                    (outside.length(), sign * outside.normalize_or(Vec3::Y))
                }
            }
            Self::Sphere { center, radius } => {
                let offset = x - center;
                (offset.length() - radius, offset.normalize_or(Vec3::Y))
            }
        }
    }
}

/// All obstacles of a scene.
#[derive(Debug, Clone)]
pub(crate) struct Colliders {
    all: Vec<Collider>,
    /// Distance of particle centres from obstacles, m.
    radius: f32,
}

/// A tangent plane of an obstacle near a particle: unit normal, and its distance from the world's
/// origin along it.
pub(super) type Contact = Vec4;

/// Signed distance of `x` from a contact's plane.
#[inline]
pub(super) fn above(contact: Contact, x: Vec3) -> f32 {
    contact.xyz().dot(x) - contact.w
}

impl Colliders {
    pub(crate) fn new(solids: &[Solid], bounds: Option<Extent>, radius: f32) -> Self {
        let solid = |solid: &Solid| match solid.shape {
            Shape::Plane { origin, normal, half_extent } if half_extent.is_infinite() => {
                let offset = normal.as_dvec3().dot(origin) as f32;
                Collider::HalfSpace { normal, offset }
            }
            Shape::Plane { origin, normal, half_extent } => {
                Collider::Plate { origin: origin.as_vec3(), normal, half_extent }
            }
            Shape::Box { min, max } => Collider::Box {
                center: (0.5 * (min + max)).as_vec3(),
                half: (0.5 * (max - min)).as_vec3(),
            },
            Shape::Sphere { center, radius } => {
                Collider::Sphere { center: center.as_vec3(), radius }
            }
            Shape::Mesh { ref mesh, placement } => Collider::Mesh { mesh: mesh.clone(), placement },
        };
        let walls = bounds.into_iter().flat_map(|bounds| {
            let (min, max) = (bounds.min.as_vec3(), bounds.max.as_vec3());
            (0..3).flat_map(move |i| [(Vec3::AXES[i], min[i]), (-Vec3::AXES[i], -max[i])])
        });
        let walls = walls.filter(|(_, offset)| offset.is_finite());
        let walls = walls.map(|(normal, offset)| Collider::HalfSpace { normal, offset });
        Self { all: solids.iter().map(solid).chain(walls).collect(), radius }
    }

    /// Position of a particle placed at `x`, moved clear of nearby obstacles; `None` inside a solid.
    pub(crate) fn place(&self, x: Vec3) -> Option<Vec3> {
        let mut contacts = Vec::new();
        self.contacts(x, self.radius, &mut contacts);
        let outside = contacts.iter().all(|&contact| above(contact, x) > 0.0);
        outside.then(|| self.project(&contacts, x))
    }

    /// Moves a particle from `from` towards `to`, sliding along obstacles. At any speed it stays on its
    /// side of every obstacle: a convex one lies behind the tangent plane at its nearest point, and the path
    /// up to that plane is free; a mesh leaves free only the ball around the particle that it does not
    /// enter.
    pub(crate) fn sweep(&self, from: Vec3, to: Vec3) -> Vec3 {
        /// Gap below which a particle touches an obstacle, relative to the radius.
        const TOUCHING: f32 = 1e-3;
        const STEPS: u32 = 32;
        let mut at = from;
        let mut rest = to - from;
        for _ in 0..STEPS {
            let mut free = 1.0;
            let mut touched = None;
            for collider in &self.all {
                let limit = rest.length() + self.radius;
                let Some((distance, normal)) = collider.distance(at, limit) else { continue };
                let approach = -rest.dot(normal);
                let gap = distance - self.radius;
                if matches!(collider, Collider::Mesh { .. }) {
                    let ball = gap.max(0.5 * distance);
                    if ball > 0.0 && ball < rest.length() {
                        free = f32::min(free, ball / rest.length());
                    }
                }
                if approach <= gap.max(1e-6 * self.radius) {
                    continue;
                }
                if gap > TOUCHING * self.radius {
                    free = gap.min(free * approach) / approach;
                } else {
                    touched = Some(normal);
                }
            }
            if let Some(normal) = touched {
                rest -= rest.dot(normal) * normal;
                continue;
            }
            at += free * rest;
            if free == 1.0 {
                break;
            }
            rest *= 1.0 - free;
        }
        at
    }

    /// Appends the tangent planes of all obstacles within `reach` of `x`; of planes that face the same
    /// way, only the nearest.
    pub(super) fn contacts(&self, x: Vec3, reach: f32, contacts: &mut Vec<Contact>) {
        /// Cosine of the largest angle between two planes that count as one wall.
        const SAME_WALL: f32 = 0.9;
        let first = contacts.len();
        for collider in &self.all {
            // Particles that a mesh has swallowed are pushed out from any depth up to the reach.
            let Some((distance, normal)) = collider.distance(x, reach) else { continue };
            if distance >= reach {
                continue;
            }
            let contact = normal.extend(normal.dot(x) - distance);
            let known = contacts.iter_mut().skip(first);
            match known.into_iter().find(|known| known.xyz().dot(normal) > SAME_WALL) {
                Some(known) if above(*known, x) > distance => *known = contact,
                Some(_) => {}
                None => contacts.push(contact),
            }
        }
    }

    /// Moves `x` out of its contacts, to one radius from their planes.
    #[inline]
    pub(super) fn project(&self, contacts: &[Contact], mut x: Vec3) -> Vec3 {
        for &contact in contacts {
            let depth = self.radius - above(contact, x);
            if depth > 0.0 {
                x += depth * contact.xyz();
            }
        }
        x
    }
}
