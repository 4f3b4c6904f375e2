//! Meshes in GLB.

use limpid::glam::DVec3;

use super::{Fields, Reader, Written, places};

/// A member with a number that is right or contradicts the rest.
fn member(f: &mut Fields, key: &str, value: usize) -> String {
    let value = f.number(key, value as u64);
    format!("\"{}\": {value}", f.text("a key", key))
}

/// A member by which a valid file may have other triangles.
fn free(f: &mut Fields, key: &str, value: usize) -> String {
    let (value, name) = (f.free_number(key, value as u64), f.text("a key", key));
    f.excuse(name != key);
    format!("\"{name}\": {value}")
}

/// A mesh of seven triangles.
pub(super) fn glb(f: &mut Fields) -> Written {
    let places = places(12);
    let triangles: Vec<u16> = (0..7).flat_map(|i| [i, i + 1, i + 5]).collect();
    let corners: Vec<DVec3> = triangles.iter().map(|&corner| places[usize::from(corner)]).collect();
    let positions: Vec<u8> =
        places.iter().flat_map(|p| p.as_vec3().to_array()).flat_map(f32::to_le_bytes).collect();
    let indices: Vec<u8> = triangles.iter().flat_map(|corner| corner.to_le_bytes()).collect();

    let views = [(0, positions.len()), (positions.len(), indices.len())].map(|(start, length)| {
        let buffer = member(f, "buffer", 0);
        let (start, length) = (free(f, "byteOffset", start), member(f, "byteLength", length));
        format!("{{{buffer}, {start}, {length}}}")
    });
    let accessor = |f: &mut Fields, view: usize, kind: usize, count: String, shape: &str| {
        // Another view or another type of the indices may be as valid.
        let (view, kind) = if view == 0 {
            (member(f, "bufferView", view), member(f, "componentType", kind))
        } else {
            (free(f, "bufferView", view), free(f, "componentType", kind))
        };
        let shape = f.text("a shape", shape);
        format!("{{{view}, {kind}, {count}, \"type\": \"{shape}\"}}")
    };
    let count = member(f, "count", places.len());
    let points = accessor(f, 0, 5126, count, "VEC3");
    let count = free(f, "count", triangles.len());
    let corner = accessor(f, 1, 5123, count, "SCALAR");
    let (attribute, indices_of) = (member(f, "POSITION", 0), free(f, "indices", 1));
    let mode = free(f, "mode", 4);
    let [asset, scenes, nodes, meshes, primitives, accessors, buffer_views, buffers] =
        ["asset", "scenes", "nodes", "meshes", "primitives", "accessors", "bufferViews", "buffers"]
            .map(|key| f.text("a key", key));
    let version = f.text("the version", "2.0");
    let (node, mesh) = (f.number("a node", 0), member(f, "mesh", 0));
    let length = member(f, "byteLength", positions.len() + indices.len());
    let json = format!(
        "{{\"{asset}\": {{\"version\": \"{version}\"}}, \"{scenes}\": [{{\"nodes\": [{node}]}}], \
         \"{nodes}\": [{{{mesh}}}], \"{meshes}\": [{{\"{primitives}\": [{{\"attributes\": \
         {{{attribute}}}, {indices_of}, {mode}}}]}}], \"{accessors}\": [{points}, {corner}], \
         \"{buffer_views}\": [{}, {}], \"{buffers}\": [{{{length}}}]}}",
        views[0], views[1]
    );
    let mut json = f.part("the document", json.into_bytes());
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut binary = [positions, indices].concat();
    binary.resize(binary.len().next_multiple_of(4), 0);
    let binary = f.part("the buffer", binary);

    let int = |number: u64| (number as u32).to_le_bytes();
    let mut bytes = f.text("the magic", "glTF").into_bytes();
    bytes.extend(int(f.number("the version", 2)));
    let whole = 12 + 8 + json.len() + 8 + binary.len();
    bytes.extend(int(f.number("the length", whole as u64)));
    for (kind, chunk) in [("JSON", json), ("BIN\0", binary)] {
        bytes.extend(int(f.number("the length of a chunk", chunk.len() as u64)));
        bytes.extend(f.text("the kind of a chunk", kind).bytes());
        bytes.extend(chunk);
    }
    let files = vec![("a.glb".into(), f.cut("the file", bytes))];
    Written { files, frames: vec![corners], reader: Reader::Mesh }
}
