//! Positions, indices and transforms.

use limpid::glam::DVec3;
use limpid::mesh::Mesh;
use serde_json::json;

use super::{box_bytes, box_document, box_glb, changed, data_uri, embedded, load_document};
use crate::{
    box_positions, box_triangles, check_box, check_message, corners, le, load_files, read,
};

#[test]
fn layouts() {
    check_box("embedded", load_document(&embedded()).unwrap());
    check_box("glb", read("a.GLB", &box_glb()).unwrap());
    check_box("glb without an extension of its own", read("a.gltf", &box_glb()).unwrap());
    let document =
        box_document(&json!({ "uri": "a%20box%C3%A9.bin", "byteLength": 168 })).to_string();
    let files: [(&str, &[u8]); 2] = [("a.gltf", document.as_bytes()), ("a boxé.bin", &box_bytes())];
    check_box("beside", load_files(&files).unwrap());
    let unpadded = data_uri(&box_bytes()[..]).trim_end_matches('=').to_owned();
    check_box(
        "unpadded",
        load_document(&changed(&embedded(), &[("/buffers/0/uri", unpadded.into())])).unwrap(),
    );
    let custom = changed(&embedded(), &[("/meshes/0/primitives/0/attributes/_BATCH", 0.into())]);
    check_box("an attribute of its own", load_document(&custom).unwrap());
    let pretty = serde_json::to_string_pretty(&embedded()).unwrap();
    check_box("pretty", read("a.gltf", format!("\n {pretty}\n").as_bytes()).unwrap());
}

#[test]
fn strides_offsets_and_sparse_values() {
    // Each position between other numbers; the last two are replaced.
    let mut bytes = vec![9; 4];
    for position in &box_positions()[..8] {
        bytes.extend(le(position.map(|x| x as f32)));
        bytes.extend([8; 4]);
    }
    let wrong = bytes.len() - 32;
    bytes[wrong..].fill(0);
    let sparse = bytes.len();
    bytes.extend([6, 7, 0, 0]);
    bytes.extend(box_positions()[6..].iter().flat_map(|x| le(x.map(|x| x as f32))));
    let indices = bytes.len();
    bytes.extend(box_triangles().as_flattened().iter().map(|&i| i as u8));
    let document = changed(
        &embedded(),
        &[
            ("/buffers/0", json!({ "uri": data_uri(&bytes), "byteLength": bytes.len() })),
            ("/bufferViews/0", json!({ "buffer": 0, "byteLength": sparse, "byteStride": 16 })),
            ("/bufferViews/1", json!({ "buffer": 0, "byteOffset": indices, "byteLength": 36 })),
            ("/bufferViews/-", json!({ "buffer": 0, "byteOffset": sparse, "byteLength": 28 })),
            ("/accessors/0/byteOffset", 4.into()),
            ("/accessors/1/componentType", 5121.into()),
            (
                "/accessors/0/sparse",
                json!({
                    "count": 2,
                    "indices": { "bufferView": 2, "componentType": 5121 },
                    "values": { "bufferView": 2, "byteOffset": 4 },
                }),
            ),
        ],
    );
    check_box("sparse", load_document(&document).unwrap());
    let outside = changed(&document, &[("/accessors/0/sparse/indices/byteOffset", 7.into())]);
    check_message("a.gltf", outside.to_string().as_bytes(), &["accessors[0]: sparse index"]);
}

#[test]
fn quantized_positions() {
    // -1 to 1 as signed bytes, of which -128 is -1 too; in strides of 4.
    let bytes = [0_i8, 0, 0, 9, 127, 0, 0, 9, 0, -128, 0, 9].map(|x| x as u8);
    let document = changed(
        &embedded(),
        &[
            ("/buffers/0", json!({ "uri": data_uri(&bytes), "byteLength": 12 })),
            ("/bufferViews/0", json!({ "buffer": 0, "byteLength": 12, "byteStride": 4 })),
            ("/bufferViews/1", json!({ "buffer": 0, "byteLength": 0 })),
            (
                "/accessors/0",
                json!({
                    "bufferView": 0, "componentType": 5120, "normalized": true, "count": 3, "type": "VEC3",
                }),
            ),
            ("/meshes/0/primitives/0", json!({ "attributes": { "POSITION": 0 } })),
            ("/extensionsRequired", json!(["KHR_mesh_quantization", "KHR_materials_unlit"])),
        ],
    );
    let loaded = load_document(&document).unwrap();
    assert_eq!(corners(&loaded.data), [[DVec3::ZERO, DVec3::X, DVec3::NEG_Y]]);
    // Otherwise a float's bytes would be read as numbers.
    let unsaid = changed(&document, &[("/extensionsRequired", json!(["KHR_materials_unlit"]))]);
    let expected = ["accessors[0]: `componentType` 5120 without KHR_mesh_quantization"];
    check_message("a.gltf", unsaid.to_string().as_bytes(), &expected);
}

#[test]
fn transforms_multiply_from_the_root() {
    let document = changed(
        &embedded(),
        &[
            ("/scenes", json!([{ "nodes": [1] }, { "nodes": [2, 1] }, {}])),
            (
                "/nodes",
                json!([
                    { "mesh": 0, "scale": [2, 3, 4] },
                    { "translation": [10, 0, 0], "rotation": [0, 0, 0.5_f64.sqrt(), 0.5_f64.sqrt()], "children": [0] },
                    { "mesh": 0, "matrix": [0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 7, 8, 1e9, 1] },
                    { "mesh": 0 },
                ]),
            ),
        ],
    );
    let loaded = load_document(&document).unwrap();
    let expected = box_positions().map(DVec3::from);
    // Turned by a quarter about z: x becomes y.
    let turned = expected.map(|x| DVec3::new(10.0 - 3.0 * x.y, 2.0 * x.x, 4.0 * x.z));
    let moved = expected.map(|x| DVec3::new(x.y + 7.0, x.z + 8.0, x.x + 1e9));
    assert_eq!(loaded.data.positions.len(), 16, "the fourth node is in no scene");
    for (found, expected) in loaded.data.positions.iter().zip(turned.iter().chain(&moved)) {
        assert!(found.distance(*expected) < 1e-12 * expected.length(), "{found} {expected}");
    }
    let without_scenes = changed(&document, &[("/scenes", json!([]))]);
    assert_eq!(load_document(&without_scenes).unwrap().data.positions.len(), 24);
}

/// A mirrored box still faces outwards, and its normals are those of its triangles.
#[test]
fn mirrored_nodes_are_turned_outwards() {
    let normals: Vec<u8> = box_positions()
        .iter()
        .flat_map(|&x| le((DVec3::from(x) - DVec3::new(0.0, 1.0, 2.5)).as_vec3().to_array()))
        .collect();
    let bytes = [box_bytes(), normals].concat();
    for scale in [[1, 1, 1], [-1, 1, 1], [2, -3, 1], [-1, -1, 5], [-1, -2, -3]] {
        let document = changed(
            &embedded(),
            &[
                ("/buffers/0", json!({ "uri": data_uri(&bytes), "byteLength": bytes.len() })),
                ("/bufferViews/-", json!({ "buffer": 0, "byteOffset": 168, "byteLength": 96 })),
                (
                    "/accessors/-",
                    json!({
                        "bufferView": 2, "componentType": 5126, "count": 8, "type": "VEC3",
                    }),
                ),
                ("/meshes/0/primitives/0/attributes/NORMAL", 2.into()),
                ("/nodes/0/scale", json!(scale)),
            ],
        );
        let data = load_document(&document).unwrap().data;
        let wedge = |[a, b, c]: [DVec3; 3]| (a - data.positions[0]).dot((b - a).cross(c - a));
        assert!(corners(&data).into_iter().map(wedge).sum::<f64>() > 0.0, "{scale:?}");
        let middle = data.positions.iter().sum::<DVec3>() / 8.0;
        for (position, normal) in data.positions.iter().zip(&data.normals) {
            assert!(normal.is_normalized());
            // The inverse transpose of a diagonal matrix divides by it twice.
            let scale = DVec3::from(scale.map(f64::from));
            let expected = ((position - middle) / scale / scale).normalize();
            assert!(normal.as_dvec3().distance(expected) < 1e-6, "{scale}: {normal} {expected}");
        }
        assert!(Mesh::new(data).unwrap().is_closed());
    }
    // A scale of 0 makes a sheet, and no error.
    let flat = changed(&embedded(), &[("/nodes/0/scale", json!([1, 1, 0]))]);
    assert_eq!(load_document(&flat).unwrap().data.triangles.len(), 12);
}

#[test]
fn strips_and_fans() {
    let with = |mode: u64, indices: &[u8]| {
        let bytes = [box_bytes(), indices.to_vec()].concat();
        let document = changed(
            &embedded(),
            &[
                ("/buffers/0", json!({ "uri": data_uri(&bytes), "byteLength": bytes.len() })),
                (
                    "/bufferViews/1",
                    json!({ "buffer": 0, "byteOffset": 168, "byteLength": indices.len() }),
                ),
                (
                    "/accessors/1",
                    json!({
                        "bufferView": 1, "componentType": 5121, "count": indices.len(), "type": "SCALAR",
                    }),
                ),
                ("/meshes/0/primitives/0/mode", mode.into()),
            ],
        );
        load_document(&document)
    };
    assert_eq!(with(4, &[3, 2, 1]).unwrap().data.triangles, [[3, 2, 1]]);
    let strip = with(5, &[0, 1, 2, 3, 4]).unwrap();
    assert_eq!(strip.data.triangles, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
    let fan = with(6, &[5, 1, 2, 3]).unwrap();
    assert_eq!(fan.data.triangles, [[5, 1, 2], [5, 2, 3]]);
    for mode in [0, 1, 2, 3] {
        assert!(with(mode, &[0, 1, 2]).unwrap_err().to_string().contains("no triangles"));
    }
    for (mode, indices, problem) in [
        (4, &[0, 1, 2, 3][..], "4 corners do not make triangles"),
        (7, &[0, 1, 2], "unknown `mode` 7"),
        (5, &[0, 1, 255], "index 255; there are 8 vertices"),
    ] {
        let error = with(mode, indices).unwrap_err().to_string();
        assert!(error.contains(problem) && error.contains("primitives[0]"), "{error}");
    }
    assert!(with(6, &[1, 2]).is_err() && with(5, &[]).is_err());
}
