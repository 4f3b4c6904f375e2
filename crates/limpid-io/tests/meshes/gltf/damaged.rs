//! Damaged documents.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::{box_glb, changed, check_error, embedded, load_document};
use crate::{check_box, check_message};

#[test]
fn indices_and_lengths_out_of_range_name_their_part() {
    let most = json!(4_000_000_000_u64);
    let huge = json!(u64::MAX);
    for (pointer, part) in [
        ("/scenes/0/nodes/0", "scenes[0]: nodes["),
        ("/nodes/0/mesh", "nodes[0]: meshes["),
        ("/meshes/0/primitives/0/attributes/POSITION", "primitives[0]: accessors["),
        ("/meshes/0/primitives/0/indices", "primitives[0]: accessors["),
        ("/accessors/0/bufferView", "accessors[0]: bufferViews["),
        ("/accessors/0/count", "accessors[0]: "),
        ("/accessors/1/count", "accessors[1]: "),
        ("/accessors/0/byteOffset", "accessors[0]: "),
        ("/bufferViews/0/buffer", "bufferViews[0]: buffers["),
        ("/bufferViews/0/byteLength", "bufferViews[0]: "),
        ("/bufferViews/0/byteOffset", "bufferViews[0]: "),
        ("/bufferViews/0/byteStride", "accessors[0]: "),
        ("/buffers/0/byteLength", "buffers[0]: `byteLength`"),
        ("/accessors/0/componentType", "accessors[0]: unknown `componentType`"),
    ] {
        check_error(&[(pointer, most.clone())], &[part]);
        check_error(&[(pointer, huge.clone())], &[part]);
    }
    check_error(&[("/meshes/0/primitives/0/material", 0.into())], &["materials[0] does not exist"]);
    check_error(
        &[("/bufferViews/0/byteStride", 0.into())],
        &["`byteStride` 0 of items of 12 bytes"],
    );
    check_error(&[("/accessors/0/type", "VEC4".into())], &["the type is VEC4, expected VEC3"]);
    check_error(&[("/accessors/0/count", 7.into())], &["primitives[0]: index 7; there are 7"]);
    check_error(&[("/accessors/0/count", 0.into())], &["primitives[0]: index 0; there are 0"]);
    check_error(
        &[("/buffers/0/uri", "file:///etc/hostname".into())],
        &["buffers[0]", "no file beside"],
    );
    check_error(&[("/buffers/0/uri", "data:x;base64,*".into())], &["buffers[0]: not base64"]);
    check_error(
        &[("/nodes/0/rotation", json!([0, 0, 0, 0]))],
        &["nodes[0]: `rotation`", "quaternion", "not zero"],
    );
    check_error(&[("/nodes/0/scale", json!([1e300, 1, 1]))], &["nodes[0]", "less than 1e18"]);
    check_error(&[("/nodes/0/children", json!([0]))], &["nodes[0]", "must form a tree"]);
    check_error(&[("/nodes/0/children", json!([5]))], &["nodes[5]: it does not exist"]);
    check_error(
        &[("/nodes", json!([{ "children": [1] }, { "children": [2, 2] }, { "children": [0] }]))],
        &["nodes[", "must form a tree"],
    );
    check_error(&[("/nodes/0", json!({ "mesh": -1 }))], &["line 1", "invalid value"]);
    let pretty = serde_json::to_string_pretty(&embedded()).unwrap();
    let broken = pretty.replacen("\"count\": 8", "\"count\": eight", 1);
    let line = 1 + broken[..broken.find("eight").unwrap()].matches('\n').count();
    check_message("a.gltf", broken.as_bytes(), &[&format!("line {line}: expected value")]);
}

#[test]
fn errors_of_glb_name_the_byte() {
    let bytes = box_glb();
    let with = |at: usize, number: u32| {
        let mut bytes = bytes.clone();
        bytes[at..at + 4].copy_from_slice(&number.to_le_bytes());
        bytes
    };
    check_message("a.glb", &with(4, 1), &["version 1 of GLB"]);
    check_message("a.glb", &with(8, u32::MAX), &["byte 8", "4294967295 bytes"]);
    check_message("a.glb", &with(12, u32::MAX), &["byte 20", "the JSON chunk"]);
    check_message("a.glb", &with(16, 0), &["the first chunk is not JSON"]);
    check_message("a.glb", &with(20, 0), &["byte 20"]);
    check_message("a.glb", &with(8, 0)[..11], &["byte 8", "the length"]);
    let json = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    check_message("a.glb", &with(20 + json, 4_000_000_000), &["the binary chunk"]);
    // An unknown second chunk is ignored, so that the buffer has no data.
    check_message("a.glb", &with(24 + json, 7), &["buffers[0]: no data"]);
}

/// Nodes are not visited by recursion, so that a long chain of them does not overflow the stack.
#[test]
fn deep_trees_are_read() {
    const DEPTH: usize = 200_000;
    let nodes: Vec<Value> = (1..DEPTH).map(|child| json!({ "children": [child] })).collect();
    let mut document = changed(&embedded(), &[("/nodes", nodes.into())]);
    document["nodes"].as_array_mut().unwrap().push(json!({ "mesh": 0 }));
    check_box("deep", load_document(&document).unwrap());
    let nested = "[".repeat(100_000);
    for key in ["x", "nodes", "animations"] {
        let document = format!("{{\"{key}\":{nested}");
        check_message("a.gltf", document.as_bytes(), &["line 1"]);
    }
}

/// A small file cannot make large work: neither many vertices nor many empty primitives.
#[test]
fn repeated_meshes_are_limited() {
    let started = Instant::now();
    let nodes = vec![json!({ "mesh": 0 }); 4000];
    let roots: Vec<usize> = (0..nodes.len()).collect();
    let points = vec![json!({ "attributes": {}, "mode": 0 }); 4000];
    let document = changed(
        &embedded(),
        &[
            ("/nodes", nodes.into()),
            ("/scenes/0/nodes", roots.into()),
            ("/meshes/0/primitives", points.into()),
        ],
    );
    check_message(
        "a.gltf",
        document.to_string().as_bytes(),
        &["repeat meshes", "more than 1073741824 bytes"],
    );
    assert!(started.elapsed() < Duration::from_secs(60));
}
