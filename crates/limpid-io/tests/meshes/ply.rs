//! PLY meshes, ASCII and binary in both byte orders.

use limpid::glam::{DVec3, Vec2, Vec3};

use super::{BOX_FACES, box_positions, check_box, check_message, corners, read};

pub(crate) fn ply_ascii() -> Vec<u8> {
    let mut text = String::from(
        "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 8\nproperty float x\nproperty float y\n\
         property float z\nelement face 6\nproperty list uchar int vertex_indices\nend_header\n",
    );
    for [x, y, z] in box_positions() {
        text += &format!("{x} {y} {z}\n");
    }
    for [a, b, c, d] in BOX_FACES {
        text += &format!("4 {a} {b} {c} {d}\n");
    }
    text.into()
}

/// With other elements and properties among those that are read.
pub(crate) fn ply_binary(order: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat binary_{order}_endian 1.0\nelement camera 1\nproperty double fov\n\
         element vertex 8\nproperty uchar flags\nproperty double x\nproperty float y\nproperty float z\n\
         property list uchar short more\nelement face 6\nproperty short part\n\
         property list uchar uint vertex_index\nproperty uchar end\nelement last 1\nproperty int x\n\
         end_header\n"
    )
    .into_bytes();
    let ordered = |mut number: Vec<u8>| {
        if order == "little" {
            number.reverse();
        }
        number
    };
    bytes.extend([7; 8]);
    for [x, y, z] in box_positions() {
        bytes.push(9);
        bytes.extend(ordered(x.to_be_bytes().into()));
        bytes.extend(ordered((y as f32).to_be_bytes().into()));
        bytes.extend(ordered((z as f32).to_be_bytes().into()));
        bytes.extend([1, 0xff, 0xff]);
    }
    for face in BOX_FACES {
        bytes.extend([0, 3, 4]);
        face.iter().for_each(|i| bytes.extend(ordered(i.to_be_bytes().into())));
        bytes.push(8);
    }
    bytes.extend([0; 4]);
    bytes
}

#[test]
fn layouts() {
    for (name, bytes) in
        [("ascii", ply_ascii()), ("little", ply_binary("little")), ("big", ply_binary("big"))]
    {
        let loaded = read("a.PLY", &bytes).unwrap();
        assert_eq!(loaded.data.positions.len(), 8, "{name}");
        assert!(loaded.data.normals.is_empty() && loaded.data.coordinates.is_empty());
        assert!(loaded.data.materials.is_empty() && loaded.remarks.is_empty());
        check_box(name, loaded);
    }
    let faces_first = "ply\r\nformat ascii 1.0\r\nelement face 1\r\nproperty list uchar int vertex_index\r\n\
        element vertex 3\r\nproperty float z\r\nproperty float y\r\nproperty float x\r\nend_header\r\n\
        \r\n3 0 2 1\r\n1 2 3\r\n\r\n4 5 6\r\n7 8 9\r\n";
    let loaded = read("a.ply", faces_first.as_bytes()).unwrap();
    let at = |x, y, z| DVec3::new(x, y, z);
    assert_eq!(corners(&loaded.data), [[at(3., 2., 1.), at(9., 8., 7.), at(6., 5., 4.)]]);
}

#[test]
fn normals_coordinates_and_polygons() {
    for (u, v, upwards) in [("s", "t", false), ("u", "v", true), ("texture_u", "texture_v", true)] {
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n\
             property float z\nproperty float nx\nproperty float ny\nproperty float nz\n\
             property float {u}\nproperty float {v}\nproperty uchar red\nproperty uchar green\n\
             property uchar blue\nelement face 3\nproperty list uchar int vertex_indices\nend_header\n\
             0 0 0 0 0 2 0 0 1 2 3\n1 0 0 0 0 2 1 0.25 1 2 3\n2 1 0 0 0 2 1 1 1 2 3\n\
             1 2 0 0 1 0 0.5 1 1 2 3\n0 1 0 0 0 2 0 1 1 2 3\n5 0 1 2 3 4\n2 0 1\n0\n"
        );
        let loaded = read("a.ply", text.as_bytes()).unwrap();
        let data = loaded.data;
        assert_eq!(data.triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
        assert_eq!(data.normals[3], Vec3::Y);
        assert_eq!(data.normals[4], 2.0 * Vec3::Z);
        let expected = match upwards {
            true => (Vec2::Y, Vec2::new(1.0, 0.75)),
            false => (Vec2::ZERO, Vec2::new(1.0, 0.25)),
        };
        assert_eq!((data.coordinates[0], data.coordinates[1]), expected);
        assert_eq!(loaded.remarks.len(), 1);
        assert!(
            loaded.remarks[0].contains("a.ply: the colours of vertices"),
            "{:?}",
            loaded.remarks
        );
    }
}

#[test]
fn errors_name_the_place() {
    let text = String::from_utf8(ply_ascii()).unwrap();
    let check = |from: &str, to: &str, fragments: &[&str]| {
        assert!(text.contains(from), "{from}");
        check_message("a.ply", text.replace(from, to).as_bytes(), fragments);
    };
    check("4 0 4 6 2", "4 0 4 6 8", &["line 19", "corner 8; there are 8 vertices"]);
    check("4 0 4 6 2", "4 0 4 6 -1", &["line 19", "corner -1"]);
    check("4 0 4 6 2", "4 0 4 6 1.5", &["line 19", "corner 1.5"]);
    check("4 0 4 6 2", "4 0 4 6 x", &["line 19", "corner NaN"]);
    check("4 0 4 6 2", "4 0 4 6", &["line 19", "too few values"]);
    check("4 0 4 6 2", "4000000000 0 4 6", &["line 19", "too few values"]);
    check(
        "\n0.5 2 4\n",
        "\n0.5 nan 4\n",
        &["line 18", "vertex 8", "NaN", "expected less than 1e18"],
    );
    check("\n0.5 2 4\n", "\n0.5 1e30 4\n", &["line 18", "vertex 8"]);
    check("vertex_indices", "corners", &["no list `vertex_indices`"]);
    check("element face", "element edge", &["points without faces", "export the surface"]);
    check("element face 6", "element face 0", &["no triangles"]);
    check("element vertex", "element point", &["no `element vertex`"]);
    check("property float z", "property float w", &["no properties x, y and z"]);
    check("element vertex 8", "element vertex 4000000000", &["line "]);
    check_message("a.ply", b"glTF", &["a glTF mesh, not a PLY mesh"]);
    check_message("a.ply", b"", &["an empty file"]);
    let mut bytes = ply_binary("little");
    let first = bytes.len() - 4 - 20 * 6 + 3;
    bytes[first] = 200;
    check_message("a.ply", &bytes, &[&format!("byte {}", first - 3), "corner 200"]);
}

#[test]
fn wrong_counts_take_no_memory() {
    let binary = |elements: &str| {
        format!("ply\nformat binary_little_endian 1.0\n{elements}\nend_header\n1234567890")
            .into_bytes()
    };
    let vertex = "property float x\nproperty float y\nproperty float z";
    let face = "property list uint int vertex_indices";
    let most = 4_000_000_000_u64;
    for elements in [
        format!("element vertex {most}\n{vertex}\nelement face 1\n{face}"),
        format!("element face {most}\n{face}\nelement vertex 0\n{vertex}"),
        format!("element nothing {most}\nelement vertex 0\n{vertex}\nelement face {most}\n{face}"),
        format!("element vertex 0\n{vertex}\nelement face {most}"),
        format!("element vertex {}\n{vertex}\nelement face 1\n{face}", u64::MAX),
    ] {
        check_message("a.ply", &binary(&elements), &[]);
    }
}
