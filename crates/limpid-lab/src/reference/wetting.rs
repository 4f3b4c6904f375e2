//! Contact of the reconstructed surface with solids: liquid wets the solids that it touches.

use glam::{DVec3, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::{in_plane, wide};
use limpid::scene::Shape;

/// Distance from a solid within which the surface wets it, particle radii.
const WETTING: f64 = 2.2;

/// Depth to which a wet surface is moved into the solid, particle radii, so that no gap is left
/// along edges; at most half the thickness of a thin solid. A plane counts as the face of a thick
/// solid.
const WET_DEPTH: f64 = 0.4;

/// Solids in contact with particles.
pub(super) struct Walls<'a> {
    shapes: &'a [Shape],
    particles: &'a [Vec3],
    /// Tree of the particles, if there is a plane: it determines which side of the plane is wet.
    tree: Option<ImmutableKdTree<f32, 3>>,
    radius: f64,
}

/// Position of a point relative to a solid.
struct Beside {
    /// Signed distance from the surface, m; negative inside.
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

    /// Moves a point of the liquid's surface into the solids that it touches.
    pub(super) fn wetted(&self, mut point: DVec3) -> DVec3 {
        let original_point = point;
        for shape in self.shapes {
            let Some(Beside { distance, normal, thickness }) =
                self.beside(shape, point, original_point)
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

    /// Locates `point` relative to a solid; `original_point` is its position before other solids
    /// moved it.
    fn beside(&self, shape: &Shape, point: DVec3, original_point: DVec3) -> Option<Beside> {
        match *shape {
            Shape::Plane { origin, normal, half_extent } => {
                let (origin, normal) = (wide(origin), wide(normal).normalize());
                let offset = point - origin;
                if in_plane(normal, offset).abs().max_element() > f64::from(half_extent) {
                    return None;
                }
                let near = f64::abs(offset.dot(normal)) < (WETTING + REACH) * self.radius;
                let nearest = self.nearest(original_point).filter(|_| near)?;
                let normal = if normal.dot(nearest - origin) < 0.0 { -normal } else { normal };
                Some(Beside { distance: offset.dot(normal), normal, thickness: f64::INFINITY })
            }
            Shape::Box { min, max } => {
                let (min, max) = (wide(min), wide(max));
                let offset = point - point.clamp(min, max);
                let distance = offset.length();
                if distance > 0.0 {
                    let normal = offset / distance;
                    // Thickness of the box along the axis that the surface faces most.
                    let thickness = (max - min)[normal.abs().max_position()];
                    return Some(Beside { distance, normal, thickness });
                }
                let middle = 0.5 * (min + max);
                let inner_distance = 0.5 * (max - min) - (point - middle).abs();
                let axis = inner_distance.min_position();
                let normal = DVec3::AXES[axis] * (point - middle)[axis].signum();
                let thickness = (max - min)[axis];
                Some(Beside { distance: -inner_distance[axis], normal, thickness })
            }
            // A mesh counts as thick: half of a thin one's thickness is not known.
            Shape::Mesh { .. } => {
                let reach = (WETTING + REACH) * self.radius;
                let (distance, normal) = shape.distance_within(point, reach)?;
                let away = distance < 0.0 && shape.is_sheet();
                let (distance, normal) =
                    if away { (-distance, -normal) } else { (distance, normal) };
                let thickness = if shape.is_sheet() { 0.0 } else { f64::INFINITY };
                Some(Beside { distance, normal, thickness })
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

    /// Finds the particle nearest to a point, m.
    fn nearest(&self, point: DVec3) -> Option<DVec3> {
        let coordinates = point.as_vec3().to_array();
        let query = self.tree.as_ref()?.query(&coordinates);
        let found = query.nearest_one::<SquaredEuclidean<f64>>().execute();
        self.particles.get(found.item as usize).map(|x| x.as_dvec3())
    }
}

/// Upper bound on the distance of a surface from its nearest particle, particle radii.
const REACH: f64 = 4.0;
