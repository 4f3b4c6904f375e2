//! Meshes and textures on the device: `shaders/common/mesh.wgsl`.

use std::sync::Arc;

use bytemuck::cast;
use glam::{Vec2, Vec3, Vec3A, Vec3Swizzles as _};
use obvhs::bvh2::node::Bvh2Node;

use crate::error::{Error, Limited, Result};
use crate::gpu::{self, Gpu};
use crate::mesh::{Mesh, Texture, linear_from_srgb, srgb_from_linear};
use crate::scene::{Scene, Shape, Solid, Surface};

/// Place of a solid's mesh or texture in the buffers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MeshPlace {
    /// Row where it begins, row of the first triangle, word of the first attributes.
    pub mesh: [u32; 3],
    /// Word of the solid's own texture, 0 for none.
    pub texture: u32,
}

/// Meshes and textures of a scene's solids, on the device.
///
/// They are uploaded again only if they differ from the last frame's; solids may share them.
#[derive(Debug)]
pub struct MeshBuffers {
    /// Nodes and triangles.
    pub geometry: wgpu::Buffer,
    /// Attributes, materials and textures.
    pub surfaces: wgpu::Buffer,
    /// For each solid of the scene.
    pub places: Vec<MeshPlace>,
    meshes: Vec<Arc<Mesh>>,
    textures: Vec<Arc<Texture>>,
    /// For each mesh and each texture.
    contents: Contents,
}

/// Rows and words before they are uploaded, and where in them the meshes and textures are.
#[derive(Debug, Default)]
struct Contents {
    meshes: Vec<[u32; 3]>,
    textures: Vec<u32>,
}

/// What is uploaded.
#[derive(Debug, Default)]
struct Data {
    geometry: Vec<[u32; 4]>,
    surfaces: Vec<u32>,
}

impl MeshBuffers {
    /// Creates buffers without meshes.
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            geometry: buffer(gpu, "meshes", &[[0u32; 4]; 2]),
            surfaces: buffer(gpu, "mesh surfaces", &[0u32; 4]),
            places: Vec::new(),
            meshes: Vec::new(),
            textures: Vec::new(),
            contents: Contents::default(),
        }
    }

    /// Uploads a scene's meshes and textures, if they are not there yet.
    ///
    /// # Errors
    /// [`Error::Limit`] if they exceed the device's largest buffer.
    pub fn prepare(&mut self, gpu: &Gpu, scene: &Scene) -> Result<()> {
        let meshes = distinct(scene.solids.iter().filter_map(|solid| mesh_of(&solid.shape)));
        let textures = distinct(scene.solids.iter().filter_map(|solid| texture_of(&solid.surface)));
        if !same(&meshes, &self.meshes) || !same(&textures, &self.textures) {
            let (contents, data) = lay_out(&meshes, &textures);
            check(gpu, &data)?;
            self.geometry = buffer(gpu, "meshes", &data.geometry);
            self.surfaces = buffer(gpu, "mesh surfaces", &data.surfaces);
            (self.meshes, self.textures, self.contents) = (meshes, textures, contents);
        }
        let place = |solid: &Solid| {
            let mesh =
                mesh_of(&solid.shape).map(|mesh| self.contents.meshes[index(&self.meshes, mesh)]);
            let texture = texture_of(&solid.surface)
                .map(|texture| self.contents.textures[index(&self.textures, texture)]);
            MeshPlace { mesh: mesh.unwrap_or_default(), texture: texture.unwrap_or_default() }
        };
        self.places = scene.solids.iter().map(place).collect();
        Ok(())
    }
}

fn mesh_of(shape: &Shape) -> Option<&Arc<Mesh>> {
    if let Shape::Mesh { mesh, .. } = shape { Some(mesh) } else { None }
}

fn texture_of(surface: &Surface) -> Option<&Arc<Texture>> {
    if let Surface::Texture { texture, .. } = surface { Some(texture) } else { None }
}

/// The different objects among shared ones, in order.
fn distinct<'a, T: 'a>(all: impl Iterator<Item = &'a Arc<T>>) -> Vec<Arc<T>> {
    let mut found: Vec<Arc<T>> = Vec::new();
    for one in all {
        if !found.iter().any(|other| Arc::ptr_eq(one, other)) {
            found.push(one.clone());
        }
    }
    found
}

fn same<T>(a: &[Arc<T>], b: &[Arc<T>]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| Arc::ptr_eq(a, b))
}

fn index<T>(all: &[Arc<T>], one: &Arc<T>) -> usize {
    all.iter().position(|other| Arc::ptr_eq(one, other)).expect("it was collected")
}

fn buffer<T: bytemuck::NoUninit>(gpu: &Gpu, label: &str, contents: &[T]) -> wgpu::Buffer {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
    gpu::buffer_with(gpu, label, usage, contents)
}

/// Fails if a buffer would be too large.
fn check(gpu: &Gpu, data: &Data) -> Result<()> {
    let limits = gpu.device.limits();
    let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let bytes = (16 * data.geometry.len() as u64).max(4 * data.surfaces.len() as u64);
    if bytes <= most {
        return Ok(());
    }
    let problem =
        format!("{} MiB of meshes and textures; most are {} MiB", bytes >> 20, most >> 20);
    Err(Error::Limit { adapter: gpu.adapter(), problem, of: Limited::Meshes })
}

/// Writes meshes and textures one after the other.
fn lay_out(meshes: &[Arc<Mesh>], textures: &[Arc<Texture>]) -> (Contents, Data) {
    // Word 0 means no texture, and word 1 a mesh's own colours.
    let mut data = Data { geometry: vec![[0; 4]; 2], surfaces: vec![0; 4] };
    let of_materials = meshes.iter().flat_map(|mesh| mesh.materials());
    let of_materials = distinct(of_materials.filter_map(|material| material.texture.as_ref()));
    let material_textures: Vec<u32> =
        of_materials.iter().map(|texture| put_texture(&mut data.surfaces, texture)).collect();
    let textures =
        textures.iter().map(|texture| put_texture(&mut data.surfaces, texture)).collect();
    let meshes = meshes.iter().map(|mesh| {
        let materials: Vec<u32> = mesh
            .materials()
            .iter()
            .map(|material| {
                let texture = material.texture.as_ref();
                let texture = texture.map_or(0, |t| material_textures[index(&of_materials, t)]);
                let word = data.surfaces.len() as u32;
                data.surfaces.extend(cast::<_, [u32; 3]>(material.color.to_array()));
                data.surfaces.push(texture);
                word
            })
            .collect();
        put_mesh(&mut data, mesh, &materials)
    });
    let contents = Contents { meshes: meshes.collect(), textures };
    (contents, data)
}

/// Appends a mesh's tree, triangles and attributes; `materials` are the words of its materials.
fn put_mesh(data: &mut Data, mesh: &Mesh, materials: &[u32]) -> [u32; 3] {
    let nodes = data.geometry.len() as u32;
    put_tree(&mut data.geometry, mesh);
    let triangles = data.geometry.len() as u32;
    let attributes = data.surfaces.len() as u32;
    data.geometry.reserve(3 * mesh.triangles().len());
    data.surfaces.reserve(10 * mesh.triangles().len());
    for (triangle, &material) in mesh.triangles().iter().zip(mesh.material_of()) {
        let corners = turned(mesh, triangle.map(|i| i as usize));
        data.geometry.extend(corners.map(|i| row(mesh.vertices()[i], 0)));
        data.surfaces.push(materials[material as usize]);
        for i in corners {
            let uv = mesh.coordinates().get(i).copied().unwrap_or_default();
            data.surfaces.extend(uv.to_array().map(f32::to_bits));
        }
        data.surfaces
            .extend(corners.map(|i| mesh.normals().get(i).map_or(NO_NORMAL, |&n| packed(n))));
    }
    [nodes, triangles, attributes]
}

/// Three numbers and an integer.
fn row(x: Vec3, fourth: u32) -> [u32; 4] {
    let [x, y, z] = x.to_array().map(f32::to_bits);
    [x, y, z, fourth]
}

/// Appends a mesh's box, and its nodes in 65535 parts of it, depth first.
fn put_tree(geometry: &mut Vec<[u32; 4]>, mesh: &Mesh) {
    let (min, max) = mesh.bounds();
    let part = (max - min) / 65535.0;
    geometry.push(row(min, 0));
    geometry.push(row(part, 0));
    let (min, part) = (min.as_dvec3(), part.as_dvec3());
    let sides = |node: &Bvh2Node| {
        let parts = |corner: Vec3A| (Vec3::from(corner).as_dvec3() - min) / part;
        // Outwards, so that the box holds what it held.
        let low = parts(node.aabb.min).floor().to_array().map(|x| x as u16);
        let high = parts(node.aabb.max).ceil().to_array().map(|x| x as u16);
        [0, 1, 2].map(|i| u32::from(low[i]) | u32::from(high[i]) << 16)
    };
    let first = geometry.len();
    // Nodes to append, and rows of inner nodes whose descendants are all there.
    enum Next {
        Node(usize),
        End(usize),
    }
    let mut rest = vec![Next::Node(0)];
    while let Some(next) = rest.pop() {
        let node = match next {
            Next::Node(node) => &mesh.nodes()[node],
            Next::End(row) => {
                geometry[row][3] = ((geometry.len() - first) as u32) << 3;
                continue;
            }
        };
        let [x, y, z] = sides(node);
        geometry.push([x, y, z, node.first_index << 3 | node.prim_count]);
        if !node.is_leaf() {
            let left = node.first_index as usize;
            rest.extend([Next::End(geometry.len() - 1), Next::Node(left + 1), Next::Node(left)]);
        }
    }
}

/// The triangle from the corner in which its two shorter edges meet: their product is the most precise normal.
fn turned(mesh: &Mesh, corners: [usize; 3]) -> [usize; 3] {
    let place = |i: usize| mesh.vertices()[corners[i % 3]];
    let opposite = |i: usize| place(i + 1).distance_squared(place(i + 2));
    let first = (1..3).fold(0, |first, i| if opposite(i) > opposite(first) { i } else { first });
    [0, 1, 2].map(|i| corners[(first + i) % 3])
}

/// A normal that is not there: no vector's.
const NO_NORMAL: u32 = 0x8000_8000;

/// A unit vector as a point on the unfolded octahedron (Cigolle et al. 2014), in 16 bits each.
fn packed(n: Vec3) -> u32 {
    let sum = n.abs().element_sum();
    if sum == 0.0 {
        return NO_NORMAL;
    }
    let n = n / sum;
    let sign = Vec2::ONE.copysign(n.xy());
    let unfolded = if n.z >= 0.0 { n.xy() } else { (1.0 - n.yx().abs()) * sign };
    let [x, y] = (unfolded * 32767.0).round().to_array().map(|x| u32::from(x as i16 as u16));
    x | y << 16
}

/// Appends a texture with all mip levels.
fn put_texture(words: &mut Vec<u32>, texture: &Texture) -> u32 {
    let at = words.len() as u32;
    let size = texture.size();
    let levels = 1 + size.max_element().ilog2();
    words.extend([size.x, size.y, levels]);
    words.extend(texture.pixels().iter().map(|&pixel| u32::from_le_bytes(pixel)));
    let linear = |c: u8| linear_from_srgb(f32::from(c) / 255.0);
    let mut level: Vec<Vec3> = texture
        .pixels()
        .iter()
        .map(|&[r, g, b, _]| Vec3::from_array([r, g, b].map(linear)))
        .collect();
    let (mut width, mut height) = (size.x as usize, size.y as usize);
    for _ in 1..levels {
        let (half_width, half_height) = ((width / 2).max(1), (height / 2).max(1));
        let mean = |i: usize| {
            let (x, y) = (i % half_width * 2, i / half_width * 2);
            let (x1, y1) = ((x + 1).min(width - 1), (y + 1).min(height - 1));
            let at = |x: usize, y: usize| level[y * width + x];
            0.25 * (at(x, y) + at(x1, y) + at(x, y1) + at(x1, y1))
        };
        level = (0..half_width * half_height).map(mean).collect();
        (width, height) = (half_width, half_height);
        let encoded = |c: f32| (srgb_from_linear(c) * 255.0).round() as u8;
        words.extend(level.iter().map(|c| {
            let [r, g, b] = c.to_array().map(encoded);
            u32::from_le_bytes([r, g, b, 255])
        }));
    }
    at
}
