//! Liquid that wets the solids which it touches.

use glam::{DVec3, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::surroundings::in_plane;
use super::wide;
use limpid::scene::Shape;

/// A surface within so many particle radii of a solid wets it.
const WETTING: f64 = 2.2;

/// So many particle radii deep in the solid it is drawn then, so that no gap is left along edges;
/// but at most half way through a solid that is thinner. A plane is taken for the face of something
/// thick.
const WET_DEPTH: f64 = 0.4;

/// Solids among particles.
pub(super) struct Walls<'a> {
    shapes: &'a [Shape],
    particles: &'a [Vec3],
    /// Of the particles, where there is a plane: it tells on which of its sides liquid is.
    tree: Option<ImmutableKdTree<f32, 3>>,
    radius: f64,
}

/// What a point has to do with a solid.
struct Beside {
    /// Distance from the surface, m; negative beyond it.
    distance: f64,
    /// The surface's unit normal, towards the liquid.
    normal: DVec3,
    /// Thickness of the solid beneath the surface, m.
    thickness: f64,
}

impl<'a> Walls<'a> {
    pub(super) fn new(shapes: &'a [Shape], particles: &'a [Vec3], radius: f64) -> Self {
        let sided = shapes.iter().any(|shape| matches!(shape, Shape::Plane { .. }));
        let tree = || {
            let places: Vec<[f32; 3]> = particles.iter().map(|x| x.to_array()).collect();
            ImmutableKdTree::new_from_slice(&places).expect("particles are counted in 32 bits")
        };
        Self { shapes, particles, tree: sided.then(tree), radius }
    }

    /// A point of the liquid's surface, moved into the solids that it touches.
    pub(super) fn wetted(&self, mut point: DVec3) -> DVec3 {
        let place = point;
        for shape in self.shapes {
            let Some(Beside { distance, normal, thickness }) = self.beside(shape, point, place)
            else {
                continue;
            };
            if distance < WETTING * self.radius {
                let depth = f64::min(WET_DEPTH * self.radius, 0.5 * thickness);
                point -= (distance + depth) * normal;
            }
        }
        point
    }

    /// `place` is where the point was before other solids moved it.
    fn beside(&self, shape: &Shape, point: DVec3, place: DVec3) -> Option<Beside> {
        match *shape {
            Shape::Plane { origin, normal, half_extent } => {
                let (origin, normal) = (wide(origin), wide(normal).normalize());
                let offset = point - origin;
                if in_plane(normal, offset).abs().max_element() > f64::from(half_extent) {
                    return None;
                }
                let near = f64::abs(offset.dot(normal)) < (WETTING + REACH) * self.radius;
                let nearest = self.nearest(place).filter(|_| near)?;
                let normal = if normal.dot(nearest - origin) < 0.0 { -normal } else { normal };
                Some(Beside { distance: offset.dot(normal), normal, thickness: f64::INFINITY })
            }
            Shape::Box { min, max } => {
                let (min, max) = (wide(min), wide(max));
                let offset = point - point.clamp(min, max);
                let distance = offset.length();
                if distance > 0.0 {
                    let normal = offset / distance;
                    // Through the box along the axis that the surface faces most.
                    let thickness = (max - min)[normal.abs().max_position()];
                    return Some(Beside { distance, normal, thickness });
                }
                let middle = 0.5 * (min + max);
                let beneath = 0.5 * (max - min) - (point - middle).abs();
                let axis = beneath.min_position();
                let normal = DVec3::AXES[axis] * (point - middle)[axis].signum();
                let thickness = (max - min)[axis];
                Some(Beside { distance: -beneath[axis], normal, thickness })
            }
            Shape::Sphere { center, radius } => {
                let offset = point - wide(center);
                let radius = f64::from(radius);
                let normal = offset.normalize_or(DVec3::Y);
                let distance = offset.length() - radius;
                Some(Beside { distance, normal, thickness: 2.0 * radius })
            }
        }
    }

    /// The particle nearest to a point, m.
    fn nearest(&self, point: DVec3) -> Option<DVec3> {
        let place = point.as_vec3().to_array();
        let query = self.tree.as_ref()?.query(&place);
        let found = query.nearest_one::<SquaredEuclidean<f64>>().execute();
        self.particles.get(found.item as usize).map(|x| x.as_dvec3())
    }
}

/// No surface is so many radii from its nearest particle.
const REACH: f64 = 4.0;
