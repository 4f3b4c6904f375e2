//! Meshes and textures on the device: `shaders/common/mesh.wgsl`.

use std::sync::Arc;

use bytemuck::cast;
use glam::{UVec2, Vec2, Vec3, Vec3A, Vec3Swizzles as _};
use obvhs::bvh2::node::Bvh2Node;

use crate::error::{Error, Limited, Result};
use crate::gpu::Gpu;
use crate::memory;
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
    /// Nodes and triangles: a texture of integers.
    pub geometry: wgpu::TextureView,
    /// Attributes, materials and textures.
    pub surfaces: wgpu::Buffer,
    /// For each solid of the scene.
    pub places: Vec<MeshPlace>,
    meshes: Vec<Arc<Mesh>>,
    textures: Vec<Arc<Texture>>,
    /// Words of the last frame's textures, which outlive the meshes of a sequence.
    encoded: Vec<(Arc<Texture>, Vec<u32>)>,
    /// For each mesh and each texture.
    contents: Contents,
}

/// Rows and words before they are uploaded, and where in them the meshes and textures are.
#[derive(Debug, Default)]
struct Contents {
    meshes: Vec<[u32; 3]>,
    textures: Vec<u32>,
}

/// Contents of the buffers.
#[derive(Debug, Default)]
struct Data {
    geometry: Vec<[u32; 4]>,
    surfaces: Vec<u32>,
}

impl MeshBuffers {
    /// Creates buffers without meshes.
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            geometry: geometry(gpu, vec![[0; 4]]),
            surfaces: buffer(gpu, "mesh surfaces", &[0u32; 4]),
            places: Vec::new(),
            meshes: Vec::new(),
            textures: Vec::new(),
            encoded: Vec::new(),
            contents: Contents::default(),
        }
    }

    /// Uploads a scene's meshes and textures, if they are not there yet.
    ///
    /// # Errors
    /// [`Error::Limit`] if they exceed the device's largest texture or buffer, [`Error::Memory`].
    pub fn prepare(&mut self, gpu: &Gpu, scene: &Scene) -> Result<()> {
        let meshes = distinct(scene.solids.iter().filter_map(|solid| mesh_of(&solid.shape)));
        let textures = distinct(scene.solids.iter().filter_map(|solid| texture_of(&solid.surface)));
        if !same(&meshes, &self.meshes) || !same(&textures, &self.textures) {
            let in_materials = meshes.iter().flat_map(|mesh| mesh.materials());
            let in_materials = in_materials.filter_map(|material| material.texture.as_ref());
            self.encode(&distinct(in_materials.chain(&textures)))?;
            check(gpu, &meshes, &self.encoded)?;
            let (contents, data) = lay_out(&meshes, &textures, &self.encoded);
            self.geometry = geometry(gpu, data.geometry);
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

    /// Encodes the textures that were not in the last frame.
    fn encode(&mut self, textures: &[Arc<Texture>]) -> Result<()> {
        /// Bytes for each pixel: its word, its mip levels and its linear colour.
        const PIXEL: usize = 20;
        let mut last = std::mem::take(&mut self.encoded);
        for texture in textures {
            let words = match last.iter().position(|(other, _)| Arc::ptr_eq(other, texture)) {
                Some(i) => last.swap_remove(i).1,
                None => {
                    memory::probe(PIXEL * texture.pixels().len(), "a texture")?;
                    encoded(texture)
                }
            };
            self.encoded.push((texture.clone(), words));
        }
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
    gpu.buffer_with(label, usage, contents)
}

/// Texels in a line of the texture, unless all fit in one: `MESH_WIDTH_BITS` of the shader.
const WIDTH: usize = 1 << 12;

/// Rows as texels, line by line.
fn geometry(gpu: &Gpu, mut rows: Vec<[u32; 4]>) -> wgpu::TextureView {
    /// Lines that are uploaded at once: 64 MiB.
    const LINES: usize = 1024;
    let width = rows.len().min(WIDTH);
    rows.resize(rows.len().next_multiple_of(width), [0; 4]);
    let size = UVec2::new(width as u32, (rows.len() / width) as u32);
    let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
    let format = wgpu::TextureFormat::Rgba32Uint;
    let texture = gpu.texture("meshes", size, 1, format, usage);
    for (i, lines) in (0..).zip(rows.chunks(width * LINES)) {
        let height = (lines.len() / width) as u32;
        let origin = wgpu::Origin3d { x: 0, y: i * LINES as u32, z: 0 };
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo { origin, ..texture.as_image_copy() },
            bytemuck::cast_slice(lines),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(16 * size.x),
                rows_per_image: None,
            },
            wgpu::Extent3d { height, ..texture.size() },
        );
    }
    texture.create_view(&Default::default())
}

/// Fails if the texture or the buffer would be too large, or memory is short.
fn check(gpu: &Gpu, meshes: &[Arc<Mesh>], textures: &[(Arc<Texture>, Vec<u32>)]) -> Result<()> {
    let limits = gpu.device.limits();
    let edge = u64::from(limits.max_texture_dimension_2d);
    // One line, if none of the shader's length fits.
    let texels = if edge < WIDTH as u64 { edge } else { WIDTH as u64 * edge };
    let of_geometry = 16 * texels;
    let of_surfaces = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let rows = |mesh: &Arc<Mesh>| MESH_HEADER + mesh.nodes().len() + 3 * mesh.triangles().len();
    let words =
        |mesh: &Arc<Mesh>| MATERIAL * mesh.materials().len() + TRIANGLE * mesh.triangles().len();
    let geometry = 16 * (2 + meshes.iter().map(rows).sum::<usize>());
    let of_textures = textures.iter().map(|(_, words)| words.len());
    let surfaces = 4 * (4 + of_textures.chain(meshes.iter().map(words)).sum::<usize>());
    let sizes = [(geometry as u64, of_geometry), (surfaces as u64, of_surfaces)];
    let Some((bytes, most)) = sizes.into_iter().find(|(bytes, most)| bytes > most) else {
        return memory::probe(geometry + surfaces, "meshes and textures");
    };
    let problem =
        format!("{} MiB of meshes and textures; most are {} MiB", bytes >> 20, most >> 20);
    Err(Error::Limit { adapter: gpu.adapter(), problem, of: Limited::Meshes })
}

/// Rows of a mesh before its nodes; words of a material, and of a triangle's attributes.
const MESH_HEADER: usize = 2;
const MATERIAL: usize = 4;
const TRIANGLE: usize = 10;

/// Writes textures and meshes one after the other.
fn lay_out(
    meshes: &[Arc<Mesh>],
    textures: &[Arc<Texture>],
    encoded: &[(Arc<Texture>, Vec<u32>)],
) -> (Contents, Data) {
    // Word 0 means no texture, and word 1 a mesh's own colours.
    let mut data = Data { geometry: vec![[0; 4]; 2], surfaces: vec![0; 4] };
    let put = |(texture, words): &(Arc<Texture>, Vec<u32>)| {
        let at = data.surfaces.len() as u32;
        data.surfaces.extend(words);
        (texture.clone(), at)
    };
    let (known, places): (Vec<_>, Vec<u32>) = encoded.iter().map(put).unzip();
    let place = |texture: &Arc<Texture>| places[index(&known, texture)];
    let meshes = meshes.iter().map(|mesh| {
        let materials: Vec<u32> = mesh
            .materials()
            .iter()
            .map(|material| {
                let word = data.surfaces.len() as u32;
                data.surfaces.extend(cast::<_, [u32; 3]>(material.color.to_array()));
                data.surfaces.push(material.texture.as_ref().map_or(0, place));
                word
            })
            .collect();
        put_mesh(&mut data, mesh, &materials)
    });
    let contents =
        Contents { meshes: meshes.collect(), textures: textures.iter().map(place).collect() };
    (contents, data)
}

/// Appends a mesh's tree, triangles and attributes; `materials` are the words of its materials.
fn put_mesh(data: &mut Data, mesh: &Mesh, materials: &[u32]) -> [u32; 3] {
    let nodes = data.geometry.len() as u32;
    put_tree(&mut data.geometry, mesh);
    let triangles = data.geometry.len() as u32;
    let attributes = data.surfaces.len() as u32;
    data.geometry.reserve(3 * mesh.triangles().len());
    data.surfaces.reserve(TRIANGLE * mesh.triangles().len());
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
        // Rounded outwards, so that the box does not shrink.
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

/// The words of a texture with all mip levels.
fn encoded(texture: &Texture) -> Vec<u32> {
    let size = texture.size();
    let levels = 1 + size.max_element().ilog2();
    let mut words = vec![size.x, size.y, levels];
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
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Guards against meshes that the shader reads from other texels than they were written to.
    #[test]
    fn lines_are_as_long_as_in_the_shader() {
        let bits = crate::gpu::shader::constant("common/mesh.wgsl", "MESH_WIDTH_BITS");
        assert_eq!(WIDTH as f64, bits.exp2());
    }
}
