//! Textures: what is decoded, and that all formats agree on which way up they are.

use std::fs;
use std::io::Cursor;

use image::{DynamicImage, ImageFormat, Rgb32FImage, RgbaImage};
use limpid::glam::{DVec3, UVec2, Vec3};
use limpid::mesh::MeshData;
use limpid_io::Error;
use limpid_io::meshes::texture;
use serde_json::json;

use super::{folder, load_files, path};

const RED: [u8; 4] = [255, 0, 0, 255];
const GREEN: [u8; 4] = [0, 255, 0, 255];
const BLUE: [u8; 4] = [0, 0, 255, 255];
const WHITE: [u8; 4] = [255, 255, 255, 0];

/// A picture of 2×2 pixels, row by row from the top.
pub(crate) fn png(pixels: [[u8; 4]; 4]) -> Vec<u8> {
    let picture = RgbaImage::from_raw(2, 2, pixels.concat()).expect("a picture");
    encoded(&picture.into(), ImageFormat::Png)
}

fn encoded(picture: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).expect("a picture");
    bytes.into_inner()
}

/// The colour at a corner of the square from (0, 0) to (1, 1).
fn color_at(data: &MeshData, x: f64, y: f64) -> [u8; 4] {
    let vertex = data.positions.iter().position(|&p| p == DVec3::new(x, y, 0.0)).expect("a corner");
    let texture = data.materials[data.material_of[0] as usize].texture.as_ref().expect("a texture");
    // A quarter towards the middle.
    let place = 0.5 * data.coordinates[vertex] + 0.25;
    let pixel = (place * texture.size().as_vec2()).as_uvec2();
    texture.pixels()[(pixel.y * texture.size().x + pixel.x) as usize]
}

/// The first row of the picture is at the top of a square that is mapped upright, in each format.
#[test]
fn all_formats_agree_on_the_first_row() {
    let picture = png([RED, GREEN, BLUE, WHITE]);
    let ply = "ply\nformat ascii 1.0\ncomment TextureFile four colours.png\nelement vertex 4\n\
        property float x\nproperty float y\nproperty float z\nproperty float u\nproperty float v\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n4 0 1 2 3\n";
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl a\n\
        f 1/1 2/2 3/3 4/4\n";
    let numbers: [f32; 20] =
        [0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0., 0., 1., 1., 1., 1., 0., 0., 0.];
    let gltf = json!({
        "asset": { "version": "2.0" },
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{
            "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "material": 0, "mode": 6,
        }] }],
        "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
        "textures": [{ "source": 0 }],
        "images": [{ "uri": "four%20colours.png" }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3" },
            { "bufferView": 0, "byteOffset": 48, "componentType": 5126, "count": 4, "type": "VEC2" },
        ],
        "bufferViews": [{ "buffer": 0, "byteLength": 80 }],
        "buffers": [{ "uri": super::gltf::data_uri(&super::le(numbers)), "byteLength": 80 }],
    });
    let gltf = gltf.to_string();
    let library = b"newmtl a\nmap_Kd D:\\elsewhere\\four colours.png\n";
    let beside: [(&str, &[u8]); 2] = [("a.mtl", library), ("four colours.png", &picture)];
    for (name, bytes) in [("a.ply", ply), ("a.obj", obj), ("a.gltf", &gltf)] {
        let files = [(name, bytes.as_bytes()), beside[0], beside[1]];
        let loaded = load_files(&files).unwrap();
        assert!(loaded.remarks.is_empty(), "{name}: {:?}", loaded.remarks);
        let data = loaded.data;
        assert_eq!(data.materials[0].color, Vec3::ONE, "{name}");
        let found = [(0., 1.), (1., 1.), (0., 0.), (1., 0.)].map(|(x, y)| color_at(&data, x, y));
        assert_eq!(found, [RED, GREEN, BLUE, WHITE], "{name}");
        let without = load_files(&files[..2]).unwrap();
        assert!(
            without.remarks[0].contains("four colours.png: cannot read"),
            "{:?}",
            without.remarks
        );
        assert!(without.data.materials.iter().all(|material| material.texture.is_none()));
    }
}

/// Two materials with one picture share it.
#[test]
fn a_texture_is_decoded_once() {
    let obj = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n";
    let library = b"newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd ./a.png\n";
    let files: [(&str, &[u8]); 3] =
        [("a.obj", obj), ("a.mtl", library), ("a.png", &png([RED, GREEN, BLUE, WHITE]))];
    let materials = load_files(&files).unwrap().data.materials;
    let [a, b] = [0, 1].map(|i| materials[i].texture.clone().unwrap());
    assert!(std::sync::Arc::ptr_eq(&a, &b));
}

#[test]
fn pictures_of_8_and_16_bits_are_decoded() {
    let picture = RgbaImage::from_raw(2, 2, [RED, GREEN, BLUE, WHITE].concat()).unwrap();
    let picture = DynamicImage::from(picture);
    let wide = DynamicImage::from(picture.to_rgba16());
    let files = [
        ("a.png", encoded(&picture, ImageFormat::Png), true),
        ("wide.png", encoded(&wide, ImageFormat::Png), true),
        ("a.webp", encoded(&picture, ImageFormat::WebP), true),
        ("called.png", encoded(&picture.to_rgb8().into(), ImageFormat::Jpeg), false),
    ];
    for (name, bytes, exact) in files {
        let folder = folder(&[(name, &bytes)]);
        let texture = texture(&path(&folder, name)).unwrap();
        assert_eq!(texture.size(), UVec2::new(2, 2));
        assert!(!exact || texture.pixels() == [RED, GREEN, BLUE, WHITE], "{name}");
    }
}

#[test]
fn other_files_are_errors() {
    let linear =
        encoded(&Rgb32FImage::from_raw(1, 1, vec![1.0; 3]).unwrap().into(), ImageFormat::Hdr);
    let whole = png([RED, GREEN, BLUE, WHITE]);
    for (bytes, problem) in [
        (&b""[..], "not a picture for a texture (PNG, JPEG, WebP)"),
        (b"P6 1 1 255 abc", "not a picture for a texture"),
        (&linear, "not a picture for a texture"),
        (&whole[..40], "a.png"),
    ] {
        let folder = folder(&[("a.png", bytes)]);
        let error = texture(&path(&folder, "a.png")).unwrap_err().to_string();
        assert!(error.contains(problem), "{error}");
    }
    let folder = folder(&[]);
    assert!(matches!(texture(folder.path()), Err(Error::Io { .. })));
    assert!(matches!(texture(&path(&folder, "a.png")), Err(Error::Io { .. })));
    // A header that declares a picture of 4 billion by 4 billion pixels.
    let mut large = whole.clone();
    large[16..24].fill(0x7f);
    fs::write(path(&folder, "a.png"), &large).unwrap();
    assert!(texture(&path(&folder, "a.png")).is_err());
    for length in 0..whole.len() {
        fs::write(path(&folder, "a.png"), &whole[..length]).unwrap();
        let _ = texture(&path(&folder, "a.png"));
    }
}
