//! glTF and GLB.

use std::time::{Duration, Instant};

use base64::prelude::{BASE64_STANDARD, Engine as _};
use limpid::glam::{DVec3, Vec2, Vec3};
use limpid::mesh::Mesh;
use limpid_io::Result;
use limpid_io::meshes::LoadedMesh;
use serde_json::{Value, json};

use super::{
    box_positions, box_triangles, check_box, check_message, corners, le, load_files, read,
};

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

#[test]
fn materials_and_their_coordinates() {
    // Three texture coordinates of two sets.
    let coordinates = [le([0.0, 0.0, 1.0, 0.0, 1.0, 1.0]), le([0.5; 6])].concat();
    let bytes = [box_bytes(), coordinates].concat();
    let accessor = |offset: u32| {
        json!({
            "bufferView": 2, "byteOffset": offset, "componentType": 5126, "count": 3, "type": "VEC2",
        })
    };
    let position = json!({ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" });
    let attributes = json!({ "POSITION": 0, "TEXCOORD_0": 2, "TEXCOORD_1": 3 });
    let primitive = |material: u32| json!({ "attributes": attributes, "material": material });
    let image = super::textures::png([[255, 0, 0, 255]; 4]);
    let texture = |set: u32| json!({ "baseColorTexture": { "index": 0, "texCoord": set } });
    let mut turned = texture(0);
    turned["baseColorTexture"]["extensions"] = json!({ "KHR_texture_transform": {
        "offset": [0.25, 0.5], "rotation": std::f64::consts::FRAC_PI_2, "scale": [2, 3],
    } });
    let document = changed(
        &embedded(),
        &[
            ("/buffers/0", json!({ "uri": data_uri(&bytes), "byteLength": bytes.len() })),
            ("/bufferViews/-", json!({ "buffer": 0, "byteOffset": 168, "byteLength": 48 })),
            (
                "/accessors",
                json!([position, {
            "bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR",
        }, accessor(0), accessor(24)]),
            ),
            (
                "/meshes/0/primitives",
                json!([
                    primitive(1), primitive(0), { "attributes": attributes }, primitive(2), primitive(3), primitive(0),
                ]),
            ),
            (
                "/materials",
                json!([
                    { "pbrMetallicRoughness": { "baseColorFactor": [0.1, 0.2, 0.3, 0.4] } },
                    { "pbrMetallicRoughness": texture(1) },
                    { "pbrMetallicRoughness": turned },
                    { "name": "nothing" },
                ]),
            ),
            ("/textures", json!([{ "source": 0 }])),
            (
                "/images",
                json!([{ "uri": format!("data:image/png;base64,{}", BASE64_STANDARD.encode(image)) }]),
            ),
        ],
    );
    let loaded = load_document(&document).unwrap();
    let data = loaded.data;
    assert_eq!(data.material_of, [0, 1, 2, 3, 4, 1]);
    let colors: Vec<Vec3> = data.materials.iter().map(|material| material.color).collect();
    let (one, grey) = (Vec3::ONE, Vec3::splat(0.7));
    assert_eq!(colors, [one, Vec3::new(0.1, 0.2, 0.3), grey, one, one]);
    let textured: Vec<bool> =
        data.materials.iter().map(|material| material.texture.is_some()).collect();
    assert_eq!(textured, [true, false, false, true, false]);
    // Vertices of the second set, of the first, and of the turned first.
    assert_eq!(data.positions.len(), 9);
    assert_eq!(data.coordinates[..3], [Vec2::splat(0.5); 3]);
    assert_eq!(data.coordinates[3..6], [Vec2::ZERO, Vec2::X, Vec2::ONE]);
    // Counterclockwise, as seen on the picture, from right to up; the picture's second axis is down.
    let expected =
        [Vec2::new(0.25, 0.5), Vec2::new(0.25, 0.5 - 2.0), Vec2::new(0.25 + 3.0, 0.5 - 2.0)];
    for (found, expected) in data.coordinates[6..].iter().zip(expected) {
        assert!(found.distance(expected) < 1e-6, "{found} {expected}");
    }
}

/// What is drawn opaque though the document has it transparent is said, once a document; a `BLEND` through which nothing
/// shows is not.
#[test]
fn transparent_materials_are_remarks() {
    let png = |alpha| {
        let bytes = super::textures::png([[255, 0, 0, alpha]; 4]);
        json!([{ "uri": format!("data:image/png;base64,{}", BASE64_STANDARD.encode(bytes)) }])
    };
    let factor = |alpha: f64| json!({ "baseColorFactor": [1, 1, 1, alpha] });
    let textured = json!({ "baseColorTexture": { "index": 0 } });
    let transmission =
        |factor: f64| json!({ "KHR_materials_transmission": { "transmissionFactor": factor } });
    let cases = [
        (json!({ "alphaMode": "BLEND", "pbrMetallicRoughness": factor(0.2) }), 255, true),
        (json!({ "alphaMode": "MASK", "pbrMetallicRoughness": textured }), 0, true),
        (json!({ "alphaMode": "BLEND", "pbrMetallicRoughness": textured }), 128, true),
        (json!({ "extensions": transmission(1.0) }), 255, true),
        (json!({ "extensions": transmission(0.0) }), 255, false),
        (json!({ "alphaMode": "OPAQUE", "pbrMetallicRoughness": factor(0.2) }), 255, false),
        (json!({ "alphaMode": "BLEND", "pbrMetallicRoughness": textured }), 255, false),
        (json!({ "pbrMetallicRoughness": textured }), 128, false),
    ];
    for (material, alpha, told) in cases {
        let document = changed(
            &embedded(),
            &[
                ("/materials", json!([material, material])),
                ("/textures", json!([{ "source": 0 }])),
                ("/images", png(alpha)),
                ("/meshes/0/primitives/0/material", 0.into()),
            ],
        );
        let remarks = load_document(&document).unwrap().remarks;
        assert_eq!(remarks.len(), usize::from(told), "{material}: {remarks:?}");
        assert!(remarks.iter().all(|remark| remark.contains("drawn opaque")), "{remarks:?}");
    }
}

#[test]
fn missing_pictures_are_remarks() {
    for (image, problem) in [
        (json!({ "uri": "no%20such.png" }), "no such.png: cannot read"),
        (json!({ "uri": "https://a.b/c.png" }), "is no file beside"),
        (json!({ "uri": "data:image/png;base64,AAAA" }), "images[0]: not a picture"),
        (json!({ "uri": "data:image/png,AAAA" }), "without base64"),
        (json!({ "bufferView": 0, "mimeType": "image/png" }), "images[0]: not a picture"),
        (json!({}), "no `uri`"),
    ] {
        let document = changed(
            &embedded(),
            &[
                (
                    "/materials",
                    json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }]),
                ),
                ("/textures", json!([{ "source": 0 }])),
                ("/images", json!([image])),
                ("/meshes/0/primitives/0/material", 0.into()),
                ("/animations", json!([{}])),
            ],
        );
        let loaded = load_document(&document).unwrap();
        assert!(
            loaded.remarks[0].contains("a.gltf: animations are not read"),
            "{:?}",
            loaded.remarks
        );
        assert!(loaded.remarks[1].contains(problem), "{problem}: {:?}", loaded.remarks);
        assert!(loaded.remarks[1].contains("its colour alone"));
        check_box(problem, loaded);
    }
}

#[test]
fn what_is_not_read_is_named() {
    let draco = json!(["KHR_draco_mesh_compression"]);
    check_error(
        &[("/extensionsRequired", draco.clone())],
        &["KHR_draco_mesh_compression", "export without"],
    );
    check_error(
        &[
            ("/extensionsUsed", draco),
            ("/accessors/0", json!({ "componentType": 5126, "count": 8, "type": "VEC3" })),
        ],
        &[
            "accessors[0]: no data",
            "KHR_draco_mesh_compression is not read, export without compression",
        ],
    );
    check_error(
        &[("/accessors/0/componentType", 5125.into())],
        &["accessors[0]: 32-bit integers", "for indices alone"],
    );
    let meshopt = json!(["EXT_meshopt_compression"]);
    check_error(
        &[("/extensionsUsed", meshopt), ("/buffers/0", json!({ "byteLength": 168 }))],
        &["buffers[0]: no data", "EXT_meshopt_compression is not read"],
    );
    check_error(
        &[("/nodes/0/skin", 0.into())],
        &["nodes[0]", "bones (`skin`)", "apply the armature"],
    );
    check_error(
        &[("/nodes/0/weights", json!([0, 1])), ("/meshes/0/primitives/0/targets", json!([{}, {}]))],
        &["meshes[0].primitives[0]", "morph targets"],
    );
    let unmoved =
        [("/nodes/0/weights", json!([0, 0])), ("/meshes/0/primitives/0/targets", json!([{}, {}]))];
    check_box("unmoved", load_document(&changed(&embedded(), &unmoved)).unwrap());
    check_error(
        &[("/asset/version", "1.0".into())],
        &["version 1.0 of glTF", "export it as glTF 2.0"],
    );
    check_message("a.gltf", br#"{"asset":{"version":"1.1"},"nodes":{}}"#, &["version 1.1"]);
    check_message("a.gltf", b"{}", &["not glTF", "`asset`"]);
    check_message("a.gltf", b"ply\n", &["a PLY file, not a glTF mesh"]);
    check_message("a.glb", b"", &["an empty file"]);
}

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
