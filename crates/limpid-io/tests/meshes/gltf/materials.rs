//! Materials, their pictures, and what is left out.

use base64::prelude::{BASE64_STANDARD, Engine as _};
use limpid::glam::{Vec2, Vec3};
use serde_json::json;

use super::{box_bytes, changed, check_error, data_uri, embedded, load_document};
use crate::{check_box, check_message, le};

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
    let image = crate::textures::png([[255, 0, 0, 255]; 4]);
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

/// A remark, one a document, names transparent materials, which are drawn opaque; not a `BLEND` through which nothing
/// shows.
#[test]
fn transparent_materials_are_remarks() {
    let png = |alpha| {
        let bytes = crate::textures::png([[255, 0, 0, alpha]; 4]);
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
