//! Triangle meshes as liquids, and their reconstruction from particles.

use std::time::Duration;

use glam::{DVec3, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use rayon::prelude::*;
use splashsurf_lib::nalgebra::Vector3;
use splashsurf_lib::neighborhood_search::neighborhood_search_spatial_hashing_parallel;
use splashsurf_lib::postprocessing::{marching_cubes_cleanup, par_laplacian_smoothing_inplace};
use splashsurf_lib::sph_interpolation::SphInterpolator;
use splashsurf_lib::{Aabb3d, Parameters, reconstruct_surface};

use super::wetting::Walls;
use super::{Crossing, Liquid, Ray};
use limpid::scene::{Shape, Solid};
use limpid_io::error::{Error, Result};

/// Parameters of the surface reconstruction. Lengths are in particle radii.
#[derive(Debug, Clone, PartialEq)]
pub struct Reconstruction {
    /// Half the support of a particle's density kernel.
    pub smoothing_length: f32,
    /// Side of the density grid's cubes.
    pub cube_size: f32,
    /// Share of the rest density that defines the surface.
    pub threshold: f32,
    /// Smoothing iterations, each moving vertices towards the mean of their neighbours.
    pub smoothing_iterations: usize,
    /// Whether vertices move less where particles are sparse, so that spray keeps its size.
    pub spares_the_sparse: bool,
    /// Solids that the liquid wets where it touches them: particles rest at a distance from solids,
    /// so the reconstructed surface alone would leave a gap.
    pub wetted: Vec<Shape>,
}

impl Default for Reconstruction {
    fn default() -> Self {
        Self {
            smoothing_length: 2.0,
            cube_size: 0.5,
            threshold: 0.6,
            smoothing_iterations: 25,
            spares_the_sparse: true,
            wetted: Vec::new(),
        }
    }
}

impl Reconstruction {
    /// The default parameters for liquid among solids, all of which it wets.
    pub fn among(solids: &[Solid]) -> Self {
        Self { wetted: solids.iter().map(|solid| solid.shape.clone()).collect(), ..Self::default() }
    }
}

/// Weighted number of neighbours at which a vertex is fully smoothed (`splashsurf`'s default).
const FULL_NEIGHBOURS: f32 = 13.0;
/// A closed surface of triangles, counterclockwise seen from outside.
pub struct Mesh {
    vertices: Vec<DVec3>,
    /// Unit normals of the vertices; 0 where triangles cancel.
    normals: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    bvh: Bvh2,
    /// The triangles' corners in the order of the BVH's leaves.
    corners: Vec<[DVec3; 3]>,
    /// Distance behind a ray's origin at which a crossing still counts, m: the rounding of a point
    /// on the mesh.
    slack: f64,
}

impl Mesh {
    /// Creates a mesh from vertex positions, m, and triangles of three vertices each. Vertex
    /// normals are the area-weighted mean of their triangles' normals.
    ///
    /// # Errors
    /// [`Error::Usage`] if a position is not finite or a triangle references a vertex that does not
    /// exist.
    pub fn new(vertices: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Self> {
        let is_in_range =
            |triangle: &[u32; 3]| triangle.iter().all(|&i| (i as usize) < vertices.len());
        if !vertices.iter().all(|v| v.as_vec3().is_finite()) || !triangles.iter().all(is_in_range) {
            let problem = "a mesh needs finite positions, and triangles of its own vertices";
            return Err(Error::Usage(problem.into()));
        }
        let mut normals = vec![DVec3::ZERO; vertices.len()];
        let place = |triangle: &[u32; 3]| triangle.map(|i| vertices[i as usize]);
        for triangle in &triangles {
            let [a, b, c] = place(triangle);
            for &i in triangle {
                normals[i as usize] += (b - a).cross(c - a);
            }
        }
        for normal in &mut normals {
            *normal = normal.normalize_or_zero();
        }

        let extent = vertices.iter().fold(0.0_f64, |most, v| most.max(v.abs().max_element()));
        // Boxes in f32 are enlarged by more than their rounding.
        let margin = 1e-6 * extent as f32 + f32::MIN_POSITIVE;
        let boxes: Vec<Aabb> = triangles
            .iter()
            .map(|triangle| {
                let corners = place(triangle).map(|v| Vec3A::from(v.as_vec3()));
                let tight = Aabb::from_points(&corners);
                Aabb::new(tight.min - margin, tight.max + margin)
            })
            .collect();
        let bvh = if boxes.is_empty() {
            Bvh2::default()
        } else {
            build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Duration::default())
        };
        let corners =
            bvh.primitive_indices.iter().map(|&i| place(&triangles[i as usize])).collect();
        Ok(Self { vertices, normals, triangles, bvh, corners, slack: 1e-12 * extent })
    }

    /// Reconstructs the surface of a liquid from particles of one radius, m: `splashsurf`'s
    /// marching cubes over the SPH density, with slivers removed, smoothed (Löschner, Böttcher,
    /// Jeske and Bender, Weighted Laplacian smoothing for surface reconstruction of particle-based
    /// fluids, 2023).
    ///
    /// # Errors
    /// [`Error::Usage`] if a position or the radius is invalid, or the particles extend so far that
    /// the grid is too large.
    pub fn reconstruct(particles: &[Vec3], radius: f32, how: &Reconstruction) -> Result<Self> {
        let radius_usable = radius.is_finite() && radius > 0.0;
        if !radius_usable || !particles.iter().all(|x| x.is_finite()) {
            let problem =
                "to reconstruct a surface, positions must be finite and the radius above 0";
            return Err(Error::Usage(problem.into()));
        }
        if particles.is_empty() {
            return Self::new(Vec::new(), Vec::new());
        }
        let positions: Vec<_> = particles.iter().map(|x| Vector3::from(x.to_array())).collect();
        let reach = 2.0 * how.smoothing_length * radius;
        let mut parameters = Parameters::new(radius, reach, how.cube_size * radius);
        parameters.iso_surface_threshold = how.threshold;
        let surface = reconstruct_surface::<i64, f32>(&positions, &parameters)
            .map_err(|e| Error::Usage(format!("no surface can be reconstructed: {e}")))?;

        let mut mesh = surface.mesh;
        let neighbours_of_vertices =
            marching_cubes_cleanup(&mut mesh, &surface.grid, None, 5, false);
        let densities = surface.particle_densities.unwrap_or_default();
        let weights = if how.spares_the_sparse {
            smoothing_weights(&positions, &densities, &mesh.vertices, &parameters)
        } else {
            vec![1.0; mesh.vertices.len()]
        };
        par_laplacian_smoothing_inplace(
            &mut mesh,
            &neighbours_of_vertices,
            how.smoothing_iterations,
            1.0,
            &weights,
        );

        let walls = Walls::new(&how.wetted, particles, radius.into());
        let vertices = (mesh.vertices.par_iter())
            .map(|v| walls.wetted(Vec3::from(<[f32; 3]>::from(*v)).as_dvec3()));
        let triangles = mesh.triangles.iter().map(|t| t.map(|i| i as u32));
        Self::new(vertices.collect(), triangles.collect())
    }

    /// Vertex positions, m.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Unit normals of the vertices; 0 where triangles cancel.
    pub fn normals(&self) -> &[DVec3] {
        &self.normals
    }

    /// Vertex indices of each triangle, counterclockwise seen from outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Finds the nearest triangle ahead that faces the requested way, of those that `keep` keeps by their
    /// index: its place in the order of leaves, its distance, and the weights of its corners.
    fn nearest(
        &self,
        ray: &Ray,
        inside: bool,
        keep: impl Fn(usize) -> bool,
    ) -> Option<(usize, f64, DVec3)> {
        let nodes = &self.bvh.nodes;
        let inverse = ray.direction.recip();
        // A ray whose origin was rounded through the opposite side of an edge leaves immediately.
        let least = if inside { -self.slack } else { 0.0 };
        let span = |node: usize, until: f64| {
            let aabb = nodes[node].aabb();
            let a = (Vec3::from(aabb.min).as_dvec3() - ray.origin) * inverse;
            let b = (Vec3::from(aabb.max).as_dvec3() - ray.origin) * inverse;
            let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
            (enter <= leave && leave >= least && enter < until).then_some(enter)
        };
        let shear = Shear::new(ray.direction);
        let mut best = None;
        let mut until = f64::INFINITY;
        let mut stack = Vec::with_capacity(64);
        if !nodes.is_empty() {
            stack.extend(span(0, until).map(|enter| (0, enter)));
        }
        while let Some((node, enter)) = stack.pop() {
            if enter >= until {
                continue;
            }
            let node = &nodes[node];
            let first = node.first_index as usize;
            if node.is_leaf() {
                for i in first..first + node.prim_count as usize {
                    let Some((t, weights)) = shear.hit(ray.origin, &self.corners[i], inside) else {
                        continue;
                    };
                    let kept = || keep(self.bvh.primitive_indices[i] as usize);
                    if t >= least && t < until && kept() {
                        until = t;
                        best = Some((i, t.max(0.0), weights));
                    }
                }
                continue;
            }
            match (span(first, until), span(first + 1, until)) {
                (Some(a), Some(b)) if a <= b => stack.extend([(first + 1, b), (first, a)]),
                (Some(a), Some(b)) => stack.extend([(first, a), (first + 1, b)]),
                (Some(a), None) => stack.push((first, a)),
                (None, Some(b)) => stack.push((first + 1, b)),
                (None, None) => {}
            }
        }
        best
    }
}

/// Where a ray meets a mesh, from either side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshHit {
    /// Distance along the ray, m.
    pub t: f64,
    /// Index of the triangle.
    pub triangle: usize,
    /// Shares of its corners.
    pub shares: DVec3,
}

impl Mesh {
    /// The nearest triangle ahead of those that `keep` keeps by their index, whichever way it faces.
    pub fn hit(&self, ray: &Ray, keep: impl Fn(usize) -> bool) -> Option<MeshHit> {
        let sides = [false, true].map(|inside| self.nearest(ray, inside, &keep));
        let ahead = sides.into_iter().flatten().filter(|&(_, t, _)| t > 0.0);
        let (place, t, shares) = ahead.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let triangle = self.bvh.primitive_indices[place] as usize;
        Some(MeshHit { t, triangle, shares })
    }

    /// Geometric unit normal of a triangle.
    pub fn triangle_normal(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.triangles[triangle].map(|i| self.vertices[i as usize]);
        (b - a).cross(c - a).normalize_or(DVec3::Y)
    }
}

impl Liquid for Mesh {
    fn crossing(&self, ray: &Ray, inside: bool) -> Option<Crossing> {
        let (place, t, weights) = self.nearest(ray, inside, |_| true)?;
        let [a, b, c] = self.corners[place];
        let normal = (b - a).cross(c - a).normalize_or(-ray.direction);
        let triangle = self.triangles[self.bvh.primitive_indices[place] as usize];
        let [na, nb, nc] = triangle.map(|i| self.normals[i as usize]);
        let shading = (weights.x * na + weights.y * nb + weights.z * nc).normalize_or(normal);
        Some(Crossing { t, normal, shading })
    }

    fn contains(&self, point: DVec3) -> bool {
        // Not along any axis, edge or diagonal that a model is likely to have.
        let ray = Ray { origin: point, direction: DVec3::new(0.3714, 0.8307, 0.4146).normalize() };
        let leaves = self.nearest(&ray, true, |_| true).map(|hit| hit.1);
        let enters = self.nearest(&ray, false, |_| true).map(|hit| hit.1);
        leaves.is_some_and(|leaves| enters.is_none_or(|enters| leaves < enters))
    }
}

/// A ray's direction as a permutation and a shear that map it to the z axis (Woop, Benthin and
/// Wald, Watertight ray/triangle intersection, 2013): two triangles that share an edge evaluate the
/// side of a ray to the same rounded number, so no ray slips through between them.
struct Shear {
    axes: [usize; 3],
    factors: DVec3,
}

impl Shear {
    fn new(d: DVec3) -> Self {
        let z = d.abs().max_position();
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        // Keeps the winding of triangles, which a mirrored direction would reverse.
        let (x, y) = if d[z] < 0.0 { (y, x) } else { (x, y) };
        Self { axes: [x, y, z], factors: DVec3::new(d[x], d[y], 1.0) / d[z] }
    }

    /// Distance to a triangle seen from its back (`inside`) or its front, and the weights of its
    /// corners at the hit.
    fn hit(&self, origin: DVec3, corners: &[DVec3; 3], inside: bool) -> Option<(f64, DVec3)> {
        let [x, y, z] = self.axes;
        let [a, b, c] = corners.map(|corner| {
            let v = (corner - origin).to_array();
            let height = self.factors.z * v[z];
            DVec3::new(v[x] - self.factors.x * v[z], v[y] - self.factors.y * v[z], height)
        });
        let weights =
            DVec3::new(c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
        let facing = if inside { -weights } else { weights };
        let sum = weights.element_sum();
        if facing.min_element() < 0.0 || sum == 0.0 {
            return None;
        }
        let weights = weights / sum;
        Some((weights.dot(DVec3::new(a.z, b.z, c.z)), weights))
    }
}

/// Smoothing weight of each vertex, 0 to 1, by the number of neighbours of the particles around it.
fn smoothing_weights(
    positions: &[Vector3<f32>],
    densities: &[f32],
    vertices: &[Vector3<f32>],
    parameters: &Parameters<f32>,
) -> Vec<f32> {
    let reach = parameters.compact_support_radius;
    let mut domain = Aabb3d::from_points(positions);
    domain.grow_uniformly(reach);
    let mut neighbours = Vec::new();
    neighborhood_search_spatial_hashing_parallel::<i64, f32>(
        &domain,
        positions,
        reach,
        &mut neighbours,
    );
    // Near neighbours count more than those at the edge of the support.
    let counts: Vec<f32> = (positions.iter().zip(&neighbours))
        .map(|(x, neighbours)| {
            let weight = |&j: &usize| {
                1.0 - ((x - positions[j]).norm_squared() / (reach * reach)).clamp(0.0, 1.0)
            };
            neighbours.iter().map(weight).sum()
        })
        .collect();

    let volume = 4.0 / 3.0 * std::f32::consts::PI * parameters.particle_radius.powi(3);
    let mass = volume * parameters.rest_density;
    let interpolator = SphInterpolator::new(positions, densities, mass, reach);
    let mut weights = interpolator.interpolate_scalar_quantity(&counts, vertices, true);
    for weight in &mut weights {
        // Perlin's smooth step; 0/0, at a vertex far from all particles, counts as 0.
        let x = if weight.is_nan() { 0.0 } else { (*weight / FULL_NEIGHBOURS).clamp(0.0, 1.0) };
        *weight = x * x * x * (x * (6.0 * x - 15.0) + 10.0);
    }
    weights
}
