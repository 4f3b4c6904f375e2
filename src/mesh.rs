//! Triangle meshes: solids of any shape.
//!
//! A [`Mesh`] is shared between the solids that show it and is not copied. Rays meet it in
//! `shaders/common/mesh.wgsl`; here are its distances, for contact and for simulations.

use std::collections::HashMap;
use std::fmt;
use std::sync::Arc;

use glam::{DQuat, DVec3, UVec2, Vec2, Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::bvh2::{Bvh2, node::Bvh2Node};
use obvhs::ploc::PlocBuilder;
use obvhs::{BvhBuildParams, INVALID};
use rayon::prelude::*;
use serde::Serialize;

use crate::camera::is_position;
use crate::environment::is_radiance;
use crate::error::{Error, Result};

mod nearest;
mod ray;

pub use nearest::Nearest;

/// A mesh as files hold it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MeshData {
    /// Corners of the triangles, in the mesh's own space and unit.
    pub positions: Vec<DVec3>,
    /// Shading normals of any length: one per position, or none for flat triangles.
    pub normals: Vec<Vec3>,
    /// Texture coordinates: one per position, or none. (0, 0) is the first corner of a texture's first
    /// row, (1, 1) the last corner of its last.
    pub coordinates: Vec<Vec2>,
    /// Indices of positions, counterclockwise as seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Colours and textures; if there are none, the mesh is grey.
    pub materials: Vec<Material>,
    /// Index of each triangle's material, or none if all triangles have the first.
    pub material_of: Vec<u32>,
}

/// Colour of a part of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Linear RGB, which multiplies the texture.
    pub color: Vec3,
    /// The texture, which repeats.
    pub texture: Option<Arc<Texture>>,
}

impl Default for Material {
    fn default() -> Self {
        Self { color: Vec3::splat(0.7), texture: None }
    }
}

/// A picture on a surface.
#[derive(Clone, PartialEq, Eq)]
pub struct Texture {
    size: UVec2,
    pixels: Vec<[u8; 4]>,
}

impl fmt::Debug for Texture {
    /// Differs between different textures, and is short.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digest = digest(self.pixels.iter().map(|&pixel| u32::from_le_bytes(pixel).into()));
        write!(f, "Texture({}, {digest:016x})", self.size)
    }
}

/// A number that differs between different sequences: FNV-1a (Fowler, Noll and Vo 1991) of whole words.
fn digest(words: impl Iterator<Item = u64>) -> u64 {
    words.fold(0xcbf2_9ce4_8422_2325, |hash, word| {
        (hash ^ word).wrapping_mul(0x0100_0000_01b3).rotate_left(23)
    })
}

impl Texture {
    /// A texture from sRGB-encoded pixels, row by row from the top; alpha is not used.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the number of pixels differs from the size, or is 0.
    pub fn new(size: UVec2, pixels: Vec<[u8; 4]>) -> Result<Self> {
        if pixels.is_empty() || pixels.len() as u64 != u64::from(size.x) * u64::from(size.y) {
            let problem = format!("{} pixels do not make a picture of {size}", pixels.len());
            return Err(Error::invalid("texture", problem));
        }
        Ok(Self { size, pixels })
    }

    /// Width and height, pixels.
    pub fn size(&self) -> UVec2 {
        self.size
    }

    /// The pixels, row by row from the top.
    pub fn pixels(&self) -> &[[u8; 4]] {
        &self.pixels
    }
}

/// Linear share of an sRGB-encoded one, both 0 to 1 (IEC 61966-2-1).
pub fn linear_from_srgb(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// The inverse of [`linear_from_srgb`].
pub fn srgb_from_linear(c: f32) -> f32 {
    if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
}

/// A mesh that can be drawn: checked, and searchable by rays and points.
#[derive(Clone)]
pub struct Mesh {
    /// Place from which [`Mesh::vertices`] count.
    origin: DVec3,
    vertices: Vec<Vec3>,
    normals: Vec<Vec3>,
    coordinates: Vec<Vec2>,
    /// In the order of the leaves of `bvh`.
    triangles: Vec<[u32; 3]>,
    material_of: Vec<u32>,
    materials: Vec<Material>,
    bvh: Bvh2,
    closed: bool,
    features: nearest::Features,
}

impl fmt::Debug for Mesh {
    /// Differs between different meshes, and is short.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { triangles, normals, coordinates, material_of, materials, .. } = self;
        let normals = normals.iter().flat_map(|n| n.to_array());
        let attributes = normals.chain(coordinates.iter().flat_map(|uv| uv.to_array()));
        let attributes = attributes.map(|x| x.to_bits().into());
        let attributes = digest(attributes.chain(material_of.iter().map(|&i| i.into())));
        let (count, corners) = (triangles.len(), self.digest());
        write!(f, "Mesh({count} triangles, {corners:016x}, {attributes:016x}, {materials:?})")
    }
}

impl PartialEq for Mesh {
    /// Meshes are equal if they look the same from everywhere: their trees do not count.
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
            || self.origin == other.origin
                && self.vertices == other.vertices
                && self.normals == other.normals
                && self.coordinates == other.coordinates
                && self.triangles == other.triangles
                && self.material_of == other.material_of
                && self.materials == other.materials
    }
}

/// Where a mesh is in the world: scaled first, then rotated, then moved.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Placement {
    /// Position of the origin of the mesh's space, m.
    pub translate: DVec3,
    /// Unit quaternion.
    pub rotate: DQuat,
    /// Metres per unit of the mesh, above 0.
    pub scale: f64,
}

impl Default for Placement {
    fn default() -> Self {
        Self { translate: DVec3::ZERO, rotate: DQuat::IDENTITY, scale: 1.0 }
    }
}

impl Placement {
    /// The world's point of a point in the mesh's space.
    pub fn world_from_mesh(&self, x: DVec3) -> DVec3 {
        self.translate + self.rotate * (self.scale * x)
    }

    /// The point in the mesh's space of a point of the world.
    pub fn mesh_from_world(&self, x: DVec3) -> DVec3 {
        self.rotate.conjugate() * (x - self.translate) / self.scale
    }
}

/// Most levels of a tree: deeper ones, of triangles that overlap, are built anew of equal halves.
pub const MAX_DEPTH: usize = 48;

/// Triangles of a leaf: the shader counts them in 3 bits, and rays were fastest with two.
pub const MAX_LEAF: usize = 2;

impl Mesh {
    /// Checks a mesh and makes it searchable.
    ///
    /// Triangles without area are left out. A closed mesh whose triangles all face inwards is turned
    /// inside out, so that its inside is its inside.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a value out of range, and if no triangle is left.
    pub fn new(data: MeshData) -> Result<Self> {
        check(&data)?;
        let MeshData { positions, normals, coordinates, triangles, materials, material_of } = data;
        let (min, max) = positions
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
        let origin = 0.5 * (min + max);
        let vertices: Vec<Vec3> = positions.iter().map(|x| (x - origin).as_vec3()).collect();
        let welded = weld(&vertices);
        let closed = is_closed(&triangles, &welded);
        let with_material = (0..)
            .zip(triangles)
            .map(|(i, triangle)| (triangle, material_of.get(i as usize).copied().unwrap_or(0)));
        let has_area = |triangle: &[u32; 3]| area_vector(&vertices, triangle) != DVec3::ZERO;
        let (mut triangles, material_of): (Vec<_>, Vec<_>) =
            with_material.filter(|(triangle, _)| has_area(triangle)).unzip();
        if triangles.is_empty() {
            return Err(Error::invalid("mesh", "it has no triangle with an area"));
        }
        if closed && volume(&vertices, &triangles) < 0.0 {
            triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }

        let bvh = build(&vertices, &triangles);
        let order = bvh.primitive_indices.iter().map(|&i| i as usize);
        let (triangles, material_of): (Vec<_>, Vec<_>) =
            order.map(|i| (triangles[i], material_of[i])).unzip();
        let features = nearest::Features::new(&vertices, &triangles, &welded);
        let materials = if materials.is_empty() { vec![Material::default()] } else { materials };
        Ok(Self {
            origin,
            vertices,
            normals: normals.iter().map(|n| n.normalize_or_zero()).collect(),
            coordinates,
            triangles,
            material_of,
            materials,
            bvh,
            closed,
            features,
        })
    }

    /// Place from which the vertices count, in the mesh's own space.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Corners of the triangles, from [`Mesh::origin`].
    pub fn vertices(&self) -> &[Vec3] {
        &self.vertices
    }

    /// Unit shading normals, one per vertex, 0 where a file has none; empty for flat triangles.
    pub fn normals(&self) -> &[Vec3] {
        &self.normals
    }

    /// Texture coordinates, one per vertex, or empty.
    pub fn coordinates(&self) -> &[Vec2] {
        &self.coordinates
    }

    /// Indices of vertices, in the order of the tree's leaves.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Index of each triangle's material.
    pub fn material_of(&self) -> &[u32] {
        &self.material_of
    }

    /// Colours and textures; never empty.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// The tree over the triangles; leaves are ranges of [`Mesh::triangles`].
    pub fn nodes(&self) -> &[Bvh2Node] {
        &self.bvh.nodes
    }

    /// Whether the mesh encloses a volume: each edge joins triangles of opposite directions.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// Host memory, bytes, without textures.
    pub fn bytes(&self) -> u64 {
        /// Of a triangle: corners, material, edges, rims and its place in the tree.
        const TRIANGLE: usize = 12 + 4 + 36 + 1 + 4;
        let vectors = 2 * self.vertices.len() + self.normals.len();
        let bytes = size_of::<Vec3>() * vectors
            + size_of::<Vec2>() * self.coordinates.len()
            + TRIANGLE * self.triangles.len()
            + size_of::<Bvh2Node>() * self.bvh.nodes.len();
        bytes as u64
    }

    /// Largest distance of a vertex from [`Mesh::origin`].
    pub fn reach(&self) -> f32 {
        self.vertices.iter().map(|x| x.length_squared()).fold(0.0, f32::max).sqrt()
    }

    /// Bounding box from [`Mesh::origin`].
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let root = self.bvh.nodes[0].aabb;
        (root.min.into(), root.max.into())
    }

    /// A number that differs between different surfaces, whatever their colours.
    pub fn digest(&self) -> u64 {
        let corners = self.triangles.iter().flatten().map(|&i| self.vertices[i as usize]);
        let places = corners.flat_map(|x| x.to_array()).map(f64::from);
        digest(places.chain(self.origin.to_array()).map(f64::to_bits))
    }

    /// Flat triangles.
    #[must_use]
    pub fn with_flat_normals(self) -> Self {
        Self { normals: Vec::new(), ..self }
    }

    /// The means of the adjacent triangles' normals, weighted by angle.
    #[must_use]
    pub fn with_smooth_normals(self) -> Self {
        let normals = self.features.corner_normals();
        Self { normals, ..self }
    }

    /// With textures upside down.
    #[must_use]
    pub fn with_flipped_textures(mut self) -> Self {
        self.coordinates.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
        self
    }

    /// The same triangles with one material instead of the file's own.
    #[must_use]
    pub fn with_material(self, material: Material) -> Self {
        let material_of = vec![0; self.triangles.len()];
        Self { material_of, materials: vec![material], ..self }
    }
}

/// Fails for values out of range.
fn check(data: &MeshData) -> Result<()> {
    let fail = |problem: String| Err(Error::invalid("mesh", problem));
    let MeshData { positions, normals, coordinates, triangles, materials, material_of } = data;
    if let Some(i) = positions.iter().position(|&x| !is_position(x)) {
        return fail(format!("vertex {} is at {}: it must be finite", i + 1, positions[i]));
    }
    if positions.len() > INVALID as usize || triangles.len() > (INVALID / 2) as usize {
        return fail(format!("{} triangles are too many", triangles.len()));
    }
    let attributes = [("normals", normals.len()), ("texture coordinates", coordinates.len())];
    for (what, count) in attributes {
        if count != 0 && count != positions.len() {
            return fail(format!("{count} {what} for {} vertices", positions.len()));
        }
    }
    if !normals.iter().all(|n| n.is_finite()) || !coordinates.iter().all(|uv| uv.is_finite()) {
        return fail("normals and texture coordinates must be finite".into());
    }
    let outside = |triangle: &[u32; 3]| triangle.iter().any(|&i| i as usize >= positions.len());
    if let Some(i) = triangles.iter().position(outside) {
        let problem = format!(
            "triangle {} has corners {:?}, but there are {} vertices",
            i + 1,
            triangles[i],
            positions.len()
        );
        return fail(problem);
    }
    if !material_of.is_empty() && material_of.len() != triangles.len() {
        return fail(format!("{} materials for {} triangles", material_of.len(), triangles.len()));
    }
    if material_of.iter().any(|&i| i as usize >= materials.len()) {
        return fail("a triangle's material does not exist".into());
    }
    if !materials.iter().all(|material| is_radiance(material.color)) {
        return fail("a material's colour must be 0 to 1e12".into());
    }
    Ok(())
}

/// For each vertex, the first vertex at the same place: files repeat vertices where normals or texture
/// coordinates differ.
fn weld(vertices: &[Vec3]) -> Vec<u32> {
    let mut first = HashMap::with_capacity(vertices.len());
    // Adding 0 makes the negative zero positive.
    let key = |x: &Vec3| (x + 0.0).to_array().map(f32::to_bits);
    (0..).zip(vertices).map(|(i, x)| *first.entry(key(x)).or_insert(i)).collect()
}

/// Whether each edge is passed as often in one direction as in the other.
fn is_closed(triangles: &[[u32; 3]], welded: &[u32]) -> bool {
    let mut edges: Vec<(u32, u32, bool)> = triangles
        .par_iter()
        .flat_map_iter(|triangle| {
            let [a, b, c] = triangle.map(|i| welded[i as usize]);
            [(a, b), (b, c), (c, a)].map(|(a, b)| (a.min(b), a.max(b), a < b))
        })
        .filter(|(a, b, _)| a != b)
        .collect();
    edges.par_sort_unstable();
    let balance = |edges: &[(u32, u32, bool)]| {
        let forward = edges.iter().filter(|edge| edge.2).count();
        2 * forward == edges.len()
    };
    !edges.is_empty() && edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).all(balance)
}

/// Twice the area of a triangle, along its normal.
fn area_vector(vertices: &[Vec3], triangle: &[u32; 3]) -> DVec3 {
    let [a, b, c] = corners(vertices, triangle);
    (b - a).cross(c - a)
}

/// Corners of a triangle, wide.
fn corners(vertices: &[Vec3], triangle: &[u32; 3]) -> [DVec3; 3] {
    triangle.map(|i| vertices[i as usize].as_dvec3())
}

/// Six times the enclosed volume; negative if the triangles face inwards.
fn volume(vertices: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
    let wedge = |triangle: &[u32; 3]| {
        let [a, b, c] = corners(vertices, triangle);
        a.dot(b.cross(c))
    };
    triangles.iter().map(wedge).sum()
}

/// A tree no deeper than [`MAX_DEPTH`].
fn build(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Bvh2 {
    let all = triangles.iter().flatten().map(|&i| Vec3A::from(vertices[i as usize]));
    let most = all.fold(0.0, |most: f32, x| most.max(x.abs().max_element()));
    // Boxes grow by different shares of a hundred-thousandth: pairing equal ones takes quadratic time, seven
    // minutes for a hundred thousand. All grow, so that no ray runs along a box's side exactly.
    let growth =
        |i: u32| 1e-5 * most * (0.1 + (i.wrapping_mul(0x9e37_79b9) >> 8) as f32 / (1 << 24) as f32);
    let boxes: Vec<Aabb> = (0u32..triangles.len() as u32)
        .into_par_iter()
        .map(|i| {
            let triangle = triangles[i as usize];
            let tight = Aabb::from_points(&triangle.map(|i| Vec3A::from(vertices[i as usize])));
            Aabb::new(tight.min - growth(i), tight.max + growth(i))
        })
        .collect();
    // As `obvhs::bvh2::builder::build_bvh2`, without its clock.
    let params =
        BvhBuildParams { max_prims_per_leaf: MAX_LEAF as u32, ..BvhBuildParams::medium_build() };
    let mut bvh = PlocBuilder::with_capacity(boxes.len()).build(
        params.ploc_search_distance,
        &boxes,
        (0..boxes.len() as u32).collect(),
        params.sort_precision,
        params.search_depth_threshold,
    );
    ReinsertionOptimizer::default().run(&mut bvh, params.reinsertion_batch_ratio, None);
    collapse(&mut bvh, params.max_prims_per_leaf, params.collapse_traversal_cost);
    if depth(&bvh.nodes) > MAX_DEPTH {
        bvh = balanced(&boxes);
    }
    bvh
}

/// Levels of a tree.
fn depth(nodes: &[Bvh2Node]) -> usize {
    let mut deepest = 0;
    let mut rest = vec![(0, 1)];
    while let Some((node, level)) = rest.pop() {
        deepest = deepest.max(level);
        let node: &Bvh2Node = &nodes[node];
        if !node.is_leaf() {
            let left = node.first_index as usize;
            rest.extend([(left, level + 1), (left + 1, level + 1)]);
        }
    }
    deepest
}

/// A tree of equal halves, for triangles that a better tree would hold too deep: many in one place.
fn balanced(boxes: &[Aabb]) -> Bvh2 {
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    let mut nodes = vec![Bvh2Node::default()];
    let mut rest = vec![(0, 0..boxes.len())];
    while let Some((node, range)) = rest.pop() {
        let ours = &mut order[range.clone()];
        let all = ours.iter().fold(Aabb::empty(), |all, &i| all.union(&boxes[i as usize]));
        if ours.len() <= MAX_LEAF {
            nodes[node] = Bvh2Node::new(all, ours.len() as u32, range.start as u32);
            continue;
        }
        let axis = Vec3::from(all.max - all.min).max_position();
        let middle = |i: &u32| boxes[*i as usize].min[axis] + boxes[*i as usize].max[axis];
        let half = ours.len() / 2;
        ours.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)));
        let left = nodes.len();
        nodes[node] = Bvh2Node::new(all, 0, left as u32);
        nodes.extend([Bvh2Node::default(); 2]);
        rest.push((left, range.start..range.start + half));
        rest.push((left + 1, range.start + half..range.end));
    }
    Bvh2 { nodes, primitive_indices: order, ..Bvh2::default() }
}
