//! glTF and GLB.

mod damaged;
mod geometry;
mod materials;

use base64::prelude::{BASE64_STANDARD, Engine as _};
use limpid_io::Result;
use limpid_io::meshes::LoadedMesh;
use serde_json::{Value, json};

use super::{box_positions, box_triangles, check_message, le, read};

/// Positions of 32-bit floats, then indices of 16 bits.
pub(crate) fn box_bytes() -> Vec<u8> {
    let mut bytes: Vec<u8> = box_positions().iter().flat_map(|x| le(x.map(|x| x as f32))).collect();
    bytes.extend(box_triangles().as_flattened().iter().flat_map(|&i| (i as u16).to_le_bytes()));
    bytes
}

/// A document with the box in accessors 0 (positions) and 1 (indices), in a node without transform.
pub(crate) fn box_document(buffer: &Value) -> Value {
    json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR" },
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 96 },
            { "buffer": 0, "byteOffset": 96, "byteLength": 72 },
        ],
        "buffers": [buffer],
    })
}

pub(crate) fn data_uri(bytes: &[u8]) -> String {
    format!("data:application/octet-stream;base64,{}", BASE64_STANDARD.encode(bytes))
}

pub(crate) fn embedded() -> Value {
    let bytes = box_bytes();
    box_document(&json!({ "uri": data_uri(&bytes), "byteLength": bytes.len() }))
}

pub(crate) fn glb(document: &Value, binary: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut binary = binary.to_vec();
    binary.resize(binary.len().next_multiple_of(4), 0);
    let length = 12 + 8 + json.len() + 8 + binary.len();
    let word = |n: usize| (n as u32).to_le_bytes();
    [
        b"glTF".as_slice(),
        &word(2),
        &word(length),
        &word(json.len()),
        b"JSON",
        &json,
        &word(binary.len()),
        b"BIN\0",
        &binary,
    ]
    .concat()
}

pub(crate) fn box_glb() -> Vec<u8> {
    glb(&box_document(&json!({ "byteLength": 168 })), &box_bytes())
}

pub(crate) fn load_document(document: &Value) -> Result<LoadedMesh> {
    read("a.gltf", document.to_string().as_bytes())
}

/// The document with some values replaced, by their JSON pointers.
fn changed(document: &Value, changes: &[(&str, Value)]) -> Value {
    let mut document = document.clone();
    for (pointer, value) in changes {
        let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
        match document.pointer_mut(parent).expect("a parent") {
            Value::Array(items) if key == "-" => items.push(value.clone()),
            Value::Array(items) => items[key.parse::<usize>().expect("an index")] = value.clone(),
            parent => parent[key] = value.clone(),
        }
    }
    document
}

fn check_error(changes: &[(&str, Value)], fragments: &[&str]) {
    let document = changed(&embedded(), changes);
    check_message("a.gltf", document.to_string().as_bytes(), fragments);
}
