//! PLY (Greg Turk, "The PLY Polygon File Format", 1994): the elements `vertex` and `face`, in ASCII or
//! binary of either byte order.
//!
//! Normals are `nx ny nz`. Texture coordinates are `u v` or `texture_u texture_v`, of which the second grows
//! upwards, as `MeshLab` writes them, or `s t`, of which t grows downwards, as Mitsuba reads them. Their
//! texture is named by a comment: `comment TextureFile name.png`. Faces are lists `vertex_indices` or `vertex_index`. Colours of vertices are not read.

use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use limpid::mesh::{Material, MeshData};

use super::{Builder, Vertex};
use crate::error::{Error, Result};
use crate::particles::cursor::Cursor;
use crate::particles::foreign;
use crate::particles::ply::{Element, Encoding, Property, has_magic, header, record, skip};
use crate::particles::table::Column;

pub(super) fn read(path: &Path, bytes: &[u8], mesh: &mut Builder<'_>) -> Result<()> {
    if !has_magic(bytes) {
        return Err(foreign(path, bytes, "a PLY mesh"));
    }
    let mut file = Cursor::new(path, bytes, true);
    let (encoding, elements) = header(&mut file)?;
    let at = |name: &str| elements.iter().position(|element| element.name == name);
    let Some(vertex) = at("vertex") else {
        return Err(file.error("the header has no `element vertex`"));
    };
    let Some(face) = at("face") else {
        let problem = "points without faces (`element face`); export the surface as a mesh";
        return Err(Error::format(path, problem));
    };
    let comments = bytes.get(..file.offset).unwrap_or_default();
    texture(comments, mesh)?;
    file.source.text = encoding == Encoding::Ascii;
    for (i, element) in elements.iter().enumerate().take(vertex.max(face) + 1) {
        if i == vertex {
            vertices(&mut file, element, encoding, mesh)?;
        } else if i == face {
            faces(&mut file, element, encoding, elements[vertex].count, mesh)?;
        } else {
            skip(&mut file, element, encoding)?;
        }
    }
    Ok(())
}

/// Adds a material with the texture that the header's comments name.
fn texture(header: &[u8], mesh: &mut Builder<'_>) -> Result<()> {
    let header = String::from_utf8_lossy(header);
    let mut names = header.lines().filter_map(|line| line.strip_prefix("comment TextureFile "));
    let Some(name) = names.next() else { return Ok(()) };
    if names.next().is_some() {
        mesh.remark("of several textures (`TextureFile`) the first is used");
    }
    let path = mesh.beside(name.trim());
    if let Some(texture) = mesh.texture(&path)? {
        let material = Material { color: Vec3::ONE, texture: Some(texture) };
        mesh.mesh.data.materials.push(material);
    }
    Ok(())
}

/// The bytes of a mesh's file: its triangles, with texture coordinates if it has them.
pub(crate) fn write(mesh: &MeshData) -> Vec<u8> {
    let has_coordinates = !mesh.coordinates.is_empty();
    let coordinates = if has_coordinates { "property float s\nproperty float t\n" } else { "" };
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double y\n\
         property double z\n{coordinates}element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        mesh.positions.len(),
        mesh.triangles.len()
    )
    .into_bytes();
    for (i, position) in mesh.positions.iter().enumerate() {
        bytes.extend(position.to_array().iter().flat_map(|x| x.to_le_bytes()));
        if has_coordinates {
            bytes.extend(mesh.coordinates[i].to_array().iter().flat_map(|x| x.to_le_bytes()));
        }
    }
    for triangle in &mesh.triangles {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|corner| corner.to_le_bytes()));
    }
    bytes
}

fn vertices(
    file: &mut Cursor<'_>,
    element: &Element,
    encoding: Encoding,
    mesh: &mut Builder<'_>,
) -> Result<()> {
    let columns = element.columns(encoding);
    let find = |name: &str| columns.iter().find(|(n, _)| *n == name).map(|(_, column)| *column);
    let (Some(x), Some(y), Some(z)) = (find("x"), find("y"), find("z")) else {
        let problem = "the vertices have no properties x, y and z";
        return Err(Error::format(file.source.path, problem));
    };
    let normal = find("nx").zip(find("ny")).zip(find("nz"));
    let pairs = [("s", "t", false), ("u", "v", true), ("texture_u", "texture_v", true)];
    let coordinates =
        pairs.into_iter().find_map(|(u, v, upwards)| Some((find(u)?, find(v)?, upwards)));
    mesh.has_normals = normal.is_some();
    mesh.has_coordinates = coordinates.is_some();
    if find("red").is_some() {
        mesh.remark("the colours of vertices are not read");
    }

    let big_endian = encoding == Encoding::BigEndian;
    let mut row = Vec::new();
    for _ in 0..element.count {
        row.clear();
        let offset = file.offset;
        let keep = &mut |number: &[u8]| row.extend_from_slice(number);
        record(file, element, encoding, keep, &mut |_, _| {})?;
        let number = |column: Column| column.number(&row, big_endian);
        let mut vertex =
            Vertex { position: DVec3::from([x, y, z].map(number)), ..Vertex::default() };
        if let Some(((x, y), z)) = normal {
            vertex.normal = DVec3::from([x, y, z].map(number)).as_vec3();
        }
        if let Some((u, v, upwards)) = coordinates {
            let v = if upwards { 1.0 - number(v) } else { number(v) };
            vertex.coordinates = Vec2::new(number(u) as f32, v as f32);
        }
        mesh.vertex(vertex, |problem| file.source.error(start(file, offset), problem))?;
    }
    Ok(())
}

fn faces(
    file: &mut Cursor<'_>,
    element: &Element,
    encoding: Encoding,
    vertices: usize,
    mesh: &mut Builder<'_>,
) -> Result<()> {
    let list = |names: &[&str]| {
        let named = |property: &Property| match property {
            Property::List { name, .. } => names.contains(&name.as_str()),
            Property::Number { .. } => false,
        };
        element.properties.iter().position(named)
    };
    let Some(corners_at) = list(&["vertex_indices", "vertex_index"]) else {
        let problem = "the faces have no list `vertex_indices`";
        return Err(Error::format(file.source.path, problem));
    };
    if list(&["texcoord"]).is_some() {
        let problem =
            "the texture coordinates of faces (`texcoord`) are not read; export them per vertex";
        mesh.remark(problem);
    }
    let (mut items, mut corners) = (Vec::new(), Vec::new());
    for _ in 0..element.count {
        items.clear();
        let offset = file.offset;
        let item = &mut |k, item| {
            if k == corners_at {
                items.push(item);
            }
        };
        record(file, element, encoding, &mut |_| {}, item)?;
        corners.clear();
        for &item in &items {
            if !(0.0..vertices as f64).contains(&item) || item.fract() != 0.0 {
                let problem =
                    format!("a face has corner {item}; there are {vertices} vertices, from 0");
                return Err(file.source.error(start(file, offset), problem));
            }
            corners.push(item as u32);
        }
        mesh.polygon(&corners, 0)?;
    }
    Ok(())
}

/// The place of the record that was read from `offset`: in text, blank lines may precede it.
fn start(file: &Cursor<'_>, offset: usize) -> usize {
    if file.source.text { file.start } else { offset }
}
