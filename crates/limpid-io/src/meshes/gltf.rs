//! glTF 2.0 (Khronos Group, "glTF 2.0 Specification", 2021), JSON and GLB:
//!
//! ```text
//! "glTF"   u32 2   u32 length of the file
//! u32 length   "JSON"   the document
//! u32 length   "BIN\0"   the first buffer; optional
//! ```
//!
//! The nodes of all scenes are read with their transforms, in 64 bits. Textures repeat, whatever their
//! samplers say. Read extensions are `KHR_mesh_quantization` and `KHR_texture_transform`; those of
//! materials and lights do not matter.

mod buffers;
mod document;

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3, Vec2};
use limpid::mesh::{Material, Texture};

use self::buffers::{Buffers, embedded, file_beside};
use self::document::{Document, Node, Preface, Primitive, TextureTransform, TextureUse};
use super::{Builder, Vertex, parse_texture};
use crate::error::{Error, Location, Result, Unpacked};
use crate::particles::cursor::Cursor;
use crate::particles::foreign;

// The JSON is our own, not the crate `gltf` (1.4), which panics on indices of accessors out of range, even
// while it validates, and overflows on counts of 0 and lengths of GLB below 12.
pub(super) fn read(path: &Path, bytes: &[u8], mesh: &mut Builder<'_>) -> Result<()> {
    let (document, binary) = if bytes.starts_with(b"glTF") {
        let Chunks { start, json, binary } = chunks(path, bytes)?;
        let place = |line: usize, column: usize| {
            let lines = json.split_inclusive(|&byte| byte == b'\n');
            let before: usize = lines.take(line.saturating_sub(1)).map(<[u8]>::len).sum();
            Location::Byte((start + before + column.saturating_sub(1)) as u64)
        };
        (parse(path, json, place)?, binary)
    } else if bytes.trim_ascii_start().starts_with(b"{") {
        (parse(path, bytes, |line, _| Location::Line(line as u64))?, None)
    } else {
        return Err(foreign(path, bytes, "a glTF mesh"));
    };
    check_extensions(path, &document)?;
    if !document.animations.is_empty() {
        mesh.remark("animations are not read; the nodes are as at rest");
    }
    let buffers = Buffers::read(path, &document, binary, mesh.budget)?;
    Reader {
        path,
        document: &document,
        buffers,
        mesh,
        materials: HashMap::new(),
        images: HashMap::new(),
    }
    .scenes()
}

/// The chunks of GLB.
struct Chunks<'a> {
    /// Where the JSON begins in the file.
    start: usize,
    json: &'a [u8],
    binary: Option<&'a [u8]>,
}

fn chunks<'a>(path: &'a Path, bytes: &'a [u8]) -> Result<Chunks<'a>> {
    let mut file = Cursor::new(path, bytes, false);
    file.take(4, "the magic")?;
    let version = u32::from_le_bytes(file.array("the version")?);
    if version != 2 {
        let problem = format!("version {version} of GLB; 2 can be read");
        return Err(Error::format(path, problem));
    }
    let length = u32::from_le_bytes(file.array("the length")?) as usize;
    if length > bytes.len() {
        let problem = format!("the header declares {length} bytes, the file has {}", bytes.len());
        return Err(file.error(problem));
    }
    let mut chunk = |expected: &[u8; 4], what: &str| -> Result<(usize, Option<&'a [u8]>)> {
        let length = u32::from_le_bytes(file.array(what)?) as usize;
        let kind = file.array::<4>(what)?;
        let start = file.offset;
        let bytes = file.take(length, what)?;
        Ok((start, (kind == *expected).then_some(bytes)))
    };
    let (start, json) = chunk(b"JSON", "the JSON chunk")?;
    let Some(json) = json else {
        return Err(Error::format(path, "the first chunk is not JSON"));
    };
    let more = bytes.get(start + json.len()..).is_some_and(|rest| rest.len() >= 8);
    // A chunk of an unknown kind is to be ignored.
    let binary = if more { chunk(b"BIN\0", "the binary chunk")?.1 } else { None };
    Ok(Chunks { start, json, binary })
}

fn parse(path: &Path, json: &[u8], place: impl Fn(usize, usize) -> Location) -> Result<Document> {
    let unread = |version: &str| {
        let problem = format!("version {version} of glTF; 2 can be read, export it as glTF 2.0");
        Error::format(path, problem)
    };
    let document: Document = serde_json::from_slice(json).map_err(|error| {
        let preface: Preface = serde_json::from_slice(json).unwrap_or_default();
        match preface.asset.version.as_str() {
            version if version.starts_with("1.") => unread(version),
            _ => Error::malformed(path, place(error.line(), error.column()), error.to_string()),
        }
    })?;
    match document.asset.version.as_str() {
        "" => Err(Error::format(path, "JSON, but not glTF: it has no `asset` with a `version`")),
        version if version.starts_with("2.") => Ok(document),
        version => Err(unread(version)),
    }
}

/// Fails if a mesh requires an extension that is not read.
fn check_extensions(path: &Path, document: &Document) -> Result<()> {
    // Their colours are elsewhere.
    const OTHER_COLORS: &str = "KHR_materials_pbrSpecularGlossiness";
    let known = |name: &&String| {
        ["KHR_mesh_quantization", "KHR_texture_transform", "KHR_lights_punctual"]
            .contains(&name.as_str())
            || (name.starts_with("KHR_materials_") && *name != OTHER_COLORS)
    };
    match document.extensions_required.iter().find(|name| !known(name)) {
        Some(name) => {
            let problem = format!("it requires {name}, which is not read; export without it");
            Err(Error::format(path, problem))
        }
        None => Ok(()),
    }
}

/// Vertices of a node, by their accessors and the coordinates' transform.
type Attributes = (usize, Option<usize>, Option<(usize, [u64; 5])>);

struct Reader<'a, 'm, 'b> {
    path: &'a Path,
    document: &'a Document,
    buffers: Buffers<'a>,
    mesh: &'m mut Builder<'b>,
    /// Indices of the materials in the mesh by those in the document.
    materials: HashMap<Option<usize>, u32>,
    /// Textures by the index of their image.
    images: HashMap<usize, Option<Arc<Texture>>>,
}

impl<'a> Reader<'a, '_, '_> {
    fn error(&self, part: &str, problem: &str) -> Error {
        self.buffers.error(part, problem)
    }

    /// Accounts for memory and work: small files can repeat large meshes.
    fn take(&self, count: usize, size: usize) -> Result<()> {
        let bytes = (count as u64).saturating_mul(size as u64);
        let taken = self.mesh.budget.take(bytes, self.path, Location::Byte(0));
        taken.map_err(|error| match error {
            Error::TooLarge { path, location, limit, .. } => {
                Error::TooLarge { path, location, what: Unpacked::Instances, limit }
            }
            error => error,
        })
    }

    /// Adds the meshes of all nodes, parents before children.
    fn scenes(mut self) -> Result<()> {
        let document = self.document;
        let mut is_root = vec![document.scenes.is_empty(); document.nodes.len()];
        for (i, scene) in document.scenes.iter().enumerate() {
            for &node in &scene.nodes {
                match is_root.get_mut(node) {
                    Some(root) => *root = true,
                    None => {
                        let problem = format!("nodes[{node}] does not exist");
                        return Err(self.error(&format!("scenes[{i}]"), &problem));
                    }
                }
            }
        }
        if document.scenes.is_empty() {
            for &child in document.nodes.iter().flat_map(|node| &node.children) {
                is_root.get_mut(child).into_iter().for_each(|root| *root = false);
            }
        }
        let roots: Vec<usize> = (0..is_root.len()).filter(|&node| is_root[node]).collect();
        let mut seen = vec![false; document.nodes.len()];
        // The nodes that remain, and the transform of their parent, at each depth.
        let mut rest = vec![(roots.iter(), DAffine3::IDENTITY)];
        while let Some((nodes, parent)) = rest.last_mut() {
            let Some(&index) = nodes.next() else {
                rest.pop();
                continue;
            };
            let part = format!("nodes[{index}]");
            let Some((node, seen)) = document.nodes.get(index).zip(seen.get_mut(index)) else {
                return Err(self.error(&part, "it does not exist"));
            };
            if std::mem::replace(seen, true) {
                let problem = "it has several parents, or is its own; nodes must form a tree";
                return Err(self.error(&part, problem));
            }
            let transform = *parent * local(node).map_err(|problem| self.error(&part, problem))?;
            rest.push((node.children.iter(), transform));
            self.node(node, transform, &part)?;
        }
        Ok(())
    }

    fn node(&mut self, node: &'a Node, transform: DAffine3, part: &str) -> Result<()> {
        let Some(index) = node.mesh else { return Ok(()) };
        let Some(mesh) = self.document.meshes.get(index) else {
            return Err(self.error(part, &format!("meshes[{index}] does not exist")));
        };
        if node.skin.is_some() {
            let problem =
                "its mesh is moved by bones (`skin`), which are not read; apply the armature";
            return Err(self.buffers.unread(part, problem));
        }
        let weights = node.weights.as_ref().or(mesh.weights.as_ref());
        let morphed = weights.is_some_and(|weights| weights.iter().any(|&weight| weight != 0.0));
        let mut vertices = HashMap::new();
        for (i, primitive) in mesh.primitives.iter().enumerate() {
            let part = format!("{part}, meshes[{index}].primitives[{i}]");
            if morphed && !primitive.targets.is_empty() {
                let problem = "its shape keys (morph targets) are not read; apply them";
                return Err(self.buffers.unread(&part, problem));
            }
            self.primitive(primitive, transform, &mut vertices, &part)?;
        }
        Ok(())
    }

    /// Adds the triangles of a primitive; `known` are the vertices of this node's earlier ones.
    fn primitive(
        &mut self,
        primitive: &'a Primitive,
        transform: DAffine3,
        known: &mut HashMap<Attributes, u32>,
        part: &str,
    ) -> Result<()> {
        /// The work of an empty primitive, as the memory that it could take in its place.
        const EMPTY: usize = 256;
        self.take(1, EMPTY)?;
        let mode = primitive.mode.unwrap_or(4);
        if mode < 4 {
            // Points and lines.
            return Ok(());
        }
        let Some(&positions) = primitive.attributes.get("POSITION") else { return Ok(()) };
        let normals = primitive.attributes.get("NORMAL").copied();
        let texture = self.texture_of(primitive, part)?;
        let coordinates = texture.and_then(|texture| {
            let transform = texture.extensions.transform.as_ref();
            let set = transform.and_then(|transform| transform.tex_coord);
            let name = format!("TEXCOORD_{}", set.unwrap_or(texture.tex_coord));
            Some((*primitive.attributes.get(&name)?, transform))
        });
        // Without a texture, for one that is given in its place.
        let first = primitive.attributes.get("TEXCOORD_0").map(|&accessor| (accessor, None));
        let coordinates = coordinates.or(first.filter(|_| texture.is_none()));
        let bits = |(accessor, transform): (usize, Option<&TextureTransform>)| {
            let t = transform.unwrap_or(&TextureTransform::IDENTITY);
            let numbers = [t.offset[0], t.offset[1], t.rotation, t.scale[0], t.scale[1]];
            (accessor, numbers.map(f64::to_bits))
        };
        let key = (positions, normals, coordinates.map(bits));
        let start = match known.get(&key) {
            Some(&start) => start,
            None => {
                let start = self.vertices(positions, normals, coordinates, transform, part)?;
                known.insert(key, start);
                start
            }
        };
        let material = self.material(primitive, part)?;
        let count = self.buffers.count(positions, part)?;
        let mirrored = transform.matrix3.determinant() < 0.0;
        self.triangles(primitive, mode, (start, count), (material, mirrored), part)
    }

    /// Adds the vertices of some accessors and returns the index of the first.
    fn vertices(
        &mut self,
        positions: usize,
        normals: Option<usize>,
        coordinates: Option<(usize, Option<&TextureTransform>)>,
        transform: DAffine3,
        part: &str,
    ) -> Result<u32> {
        /// Memory of a vertex while it is read, bytes.
        const EACH: usize = size_of::<Vertex>() + size_of::<[f64; 8]>();
        let count = self.buffers.count(positions, part)?;
        let positions = self.buffers.vectors(positions, part)?;
        self.take(count, EACH)?;
        let normals = match normals {
            Some(normals) => {
                self.mesh.has_normals = true;
                self.buffers.vectors(normals, part)?
            }
            None => Vec::new(),
        };
        let texture_transform = coordinates.and_then(|(_, transform)| transform);
        let coordinates = match coordinates {
            Some((coordinates, _)) => {
                self.mesh.has_coordinates = true;
                self.buffers.items::<2>(coordinates, "VEC2", part)?
            }
            None => Vec::new(),
        };
        for (what, found) in [("NORMAL", normals.len()), ("TEXCOORD", coordinates.len())] {
            if found != 0 && found != count {
                let problem = format!("{found} items of {what} for {count} of POSITION");
                return Err(self.error(part, &problem));
            }
        }
        let of_normals = normal_transform(transform.matrix3);
        let start = self.mesh.mesh.data.positions.len();
        for (i, &position) in positions.iter().enumerate() {
            let mut vertex = Vertex {
                position: transform.transform_point3(position.into()),
                ..Vertex::default()
            };
            if let Some(&normal) = normals.get(i) {
                vertex.normal = (of_normals * DVec3::from(normal)).normalize_or_zero().as_vec3();
            }
            if let Some(&coordinates) = coordinates.get(i) {
                let transform = texture_transform.unwrap_or(&TextureTransform::IDENTITY);
                vertex.coordinates = transform.apply(coordinates.into());
            }
            let fail = |problem: String| self.buffers.error(part, &problem);
            self.mesh.vertex(vertex, fail)?;
        }
        u32::try_from(start).map_err(|_| self.error(part, "too many vertices"))
    }

    /// Adds the triangles of a primitive whose vertices are `count` from `start`.
    fn triangles(
        &mut self,
        primitive: &Primitive,
        mode: u64,
        (start, count): (u32, usize),
        (material, mirrored): (u32, bool),
        part: &str,
    ) -> Result<()> {
        /// Memory of a triangle while it is read, bytes.
        const EACH: usize = size_of::<[u32; 4]>() + size_of::<f64>();
        let corners: Vec<u32> = match primitive.indices {
            Some(indices) => {
                let items = self.buffers.items::<1>(indices, "SCALAR", part)?;
                self.take(items.len(), EACH)?;
                let outside = |&&[index]: &&[f64; 1]| {
                    !(0.0..count as f64).contains(&index) || index.fract() != 0.0
                };
                if let Some([index]) = items.iter().find(outside) {
                    let problem = format!("index {index}; there are {count} vertices, from 0");
                    return Err(self.error(part, &problem));
                }
                items.iter().map(|&[index]| start + index as u32).collect()
            }
            None => {
                self.take(count, EACH)?;
                (start..).take(count).collect()
            }
        };
        let mut triangle = |[a, b, c]: [u32; 3]| {
            self.mesh.triangle(if mirrored { [a, c, b] } else { [a, b, c] }, material)
        };
        match mode {
            4 => match corners.as_chunks() {
                (triangles, []) => triangles.iter().try_for_each(|&corners| triangle(corners)),
                _ => {
                    let problem = format!("{} corners do not make triangles", corners.len());
                    Err(self.error(part, &problem))
                }
            },
            5 => corners.array_windows().enumerate().try_for_each(|(i, &[a, b, c])| {
                // Each second triangle of a strip is turned over.
                triangle(if i % 2 == 0 { [a, b, c] } else { [a, c, b] })
            }),
            6 => {
                let Some((&first, rest)) = corners.split_first() else { return Ok(()) };
                rest.array_windows().try_for_each(|&[a, b]| triangle([first, a, b]))
            }
            _ => Err(self.error(part, &format!("unknown `mode` {mode}"))),
        }
    }

    /// The texture of a primitive's base colour.
    fn texture_of(&self, primitive: &Primitive, part: &str) -> Result<Option<&'a TextureUse>> {
        let Some(index) = primitive.material else { return Ok(None) };
        let Some(material) = self.document.materials.get(index) else {
            return Err(self.error(part, &format!("materials[{index}] does not exist")));
        };
        let surface = material.pbr_metallic_roughness.as_ref();
        Ok(surface.and_then(|surface| surface.base_color_texture.as_ref()))
    }

    /// The index in the mesh of a primitive's material; without one, it is grey.
    fn material(&mut self, primitive: &Primitive, part: &str) -> Result<u32> {
        if let Some(&index) = self.materials.get(&primitive.material) {
            return Ok(index);
        }
        let mut material = Material::default();
        let described = primitive.material.and_then(|index| self.document.materials.get(index));
        if let Some(described) = described {
            let surface = described.pbr_metallic_roughness.as_deref();
            let [r, g, b, _] = surface.map_or([1.0; 4], |surface| surface.base_color_factor);
            material.color = DVec3::new(r, g, b).as_vec3();
        }
        if let Some(used) = self.texture_of(primitive, part)? {
            material.texture = self.texture(used.index, part)?;
        }
        if described.is_some_and(|described| is_transparent(described, material.texture.as_deref()))
        {
            self.mesh.remark_opaque("alphaMode or KHR_materials_transmission");
        }
        let fail = |problem: String| self.buffers.error(part, &problem);
        let index = self.mesh.material(material, fail)?;
        self.materials.insert(primitive.material, index);
        Ok(index)
    }

    fn texture(&mut self, index: usize, part: &str) -> Result<Option<Arc<Texture>>> {
        let Some(texture) = self.document.textures.get(index) else {
            return Err(self.error(part, &format!("textures[{index}] does not exist")));
        };
        let Some(source) = texture.source else {
            self.mesh
                .remark(&format!("textures[{index}] has no picture that can be read (`source`)"));
            return Ok(None);
        };
        if let Some(texture) = self.images.get(&source) {
            return Ok(texture.clone());
        }
        let texture = self.image(source)?;
        self.images.insert(source, texture.clone());
        Ok(texture)
    }

    fn image(&mut self, index: usize) -> Result<Option<Arc<Texture>>> {
        let part = format!("images[{index}]");
        let Some(image) = self.document.images.get(index) else {
            return Err(self.error(&part, "it does not exist"));
        };
        let name = self.path.join(&part);
        let parsed = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => match embedded(uri) {
                Some(Ok(bytes)) => parse_texture(&name, &bytes, self.mesh.budget),
                Some(Err(problem)) => Err(self.error(&part, &problem)),
                None => match file_beside(self.path, uri) {
                    Ok(path) => return self.mesh.texture(&path),
                    Err(problem) => Err(self.buffers.unread(&part, &problem)),
                },
            },
            (None, Some(view)) => {
                let (bytes, _) = self.buffers.view(view, &part)?;
                parse_texture(&name, bytes, self.mesh.budget)
            }
            (None, None) => Err(self.error(&part, "no `uri` and no `bufferView`")),
        };
        self.mesh.texture_or_remark(parsed)
    }
}

/// Whether anything shows through a material, whose base colour has this texture. Exporters call opaque ones `BLEND` too.
fn is_transparent(material: &document::Material, texture: Option<&Texture>) -> bool {
    let transmission = material.extensions.transmission.as_ref();
    if transmission.is_some_and(|transmission| transmission.transmission_factor > 0.0) {
        return true;
    }
    let surface = material.pbr_metallic_roughness.as_deref();
    let opacity = surface.map_or(1.0, |surface| surface.base_color_factor[3]);
    let is_partly = |texture: &Texture| texture.pixels().iter().any(|pixel| pixel[3] < u8::MAX);
    matches!(material.alpha_mode.as_deref(), Some("BLEND" | "MASK"))
        && (opacity < 1.0 || texture.is_some_and(is_partly))
}

impl TextureTransform {
    const IDENTITY: Self =
        Self { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None };

    /// Scales, turns counterclockwise as seen on the picture, and moves.
    fn apply(&self, coordinates: DVec2) -> Vec2 {
        let scaled = coordinates * DVec2::from(self.scale);
        let (sin, cos) = self.rotation.sin_cos();
        let turned = DVec2::new(cos * scaled.x + sin * scaled.y, cos * scaled.y - sin * scaled.x);
        (turned + DVec2::from(self.offset)).as_vec2()
    }
}

/// The transform of a node in its parent, or the problem of it.
fn local(node: &Node) -> Result<DAffine3, &'static str> {
    if let Some(matrix) = &node.matrix {
        return Ok(DAffine3::from_mat4(DMat4::from_cols_array(matrix)));
    }
    let vector = |vector: &Option<Box<[f64; 3]>>, default: DVec3| {
        vector.as_deref().map_or(default, |&vector| DVec3::from(vector))
    };
    let rotation = node.rotation.as_deref().map_or(DQuat::IDENTITY, |&q| DQuat::from_array(q));
    // A length that overflows or underflows leaves no direction.
    let rotation = rotation.normalize();
    if !rotation.is_normalized() {
        return Err("`rotation` must be a quaternion x, y, z, w that is not zero");
    }
    Ok(DAffine3::from_scale_rotation_translation(
        vector(&node.scale, DVec3::ONE),
        rotation,
        vector(&node.translation, DVec3::ZERO),
    ))
}

/// The inverse transpose, times a positive number: the cofactors, so that it exists for all matrices.
fn normal_transform(matrix: DMat3) -> DMat3 {
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    if matrix.determinant() < 0.0 { cofactors * -1.0 } else { cofactors }
}
