//! PLY files, ASCII and binary in both byte orders.

use limpid::liquid::Particles;

use super::{
    DENSITIES, IDS, POSITIONS, RADII, Reversed, VELOCITIES, all_attributes, check_left_out,
    check_message, le, patched, positions_only, read,
};

const PLY_PROPERTIES: &str = "property float x\nproperty float32 y\nproperty float z
property uchar red\nproperty float vx\nproperty float vy\nproperty float vz
property float density\nproperty float radius\nproperty int32 id\n";

pub(crate) fn ply_binary(order: &str) -> Vec<u8> {
    let big = order == "big";
    let header = format!(
        "ply\nformat binary_{order}_endian 1.0\ncomment x\nelement vertex 3\n{PLY_PROPERTIES}end_header\n"
    );
    let mut bytes = header.into_bytes();
    let word = |bytes: [u8; 4]| if big { bytes } else { bytes.map_reverse() };
    for i in 0..3 {
        bytes.extend(POSITIONS[i].map(|x| word(x.to_be_bytes())).concat());
        bytes.push(255);
        bytes.extend(VELOCITIES[i].map(|x| word(x.to_be_bytes())).concat());
        bytes.extend([DENSITIES[i], RADII[i]].map(|x| word(x.to_be_bytes())).concat());
        bytes.extend(word(IDS[i].to_be_bytes()));
    }
    bytes
}

/// Lists, doubles, and elements before and after the vertices.
pub(crate) fn ply_elaborate() -> Vec<u8> {
    let header = "ply\r\nformat binary_big_endian 1.0\r\nobj_info by hand\r\n\
        element camera 1\r\nproperty double fov\r\n\
        element strip 2\r\nproperty list uchar short index\r\nproperty char end\r\n\
        element vertex 3\r\nproperty double x\r\nproperty list int float more\r\n\
        property double y\r\nproperty double z\r\n\
        element face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n";
    let mut bytes = header.as_bytes().to_vec();
    bytes.extend([0; 8]);
    bytes.extend([2, 0, 1, 0, 2, 9]);
    bytes.extend([0, 9]);
    for (i, [x, y, z]) in POSITIONS.into_iter().enumerate() {
        bytes.extend(f64::from(x).to_be_bytes());
        bytes.extend((i as i32).to_be_bytes());
        bytes.extend(vec![0xff; 4 * i]);
        bytes.extend([y, z].map(|x| f64::from(x).to_be_bytes()).concat());
    }
    bytes.extend([3, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 2]);
    bytes
}

pub(crate) fn ply_ascii() -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement strip 2\nproperty list uchar int i\n\
         element vertex 3\n{PLY_PROPERTIES}property list uchar int near\n\
         element face 1\nproperty list uchar int i\nend_header\n2 0 1\n0\n"
    );
    for i in 0..3 {
        let [x, y, z] = POSITIONS[i];
        let [vx, vy, vz] = VELOCITIES[i];
        let (density, radius, id) = (DENSITIES[i], RADII[i], IDS[i]);
        text += &format!("{x} {y} {z} 255 {vx} {vy} {vz} {density} {radius} {id} {i}");
        text += &" 5".repeat(i);
        text += "\n";
    }
    text + "3 0 1 2\n"
}

#[test]
fn ply_variants() {
    assert_eq!(read("a.ply", &ply_binary("little")).unwrap(), all_attributes());
    assert_eq!(read("a.Ply", &ply_binary("big")).unwrap(), all_attributes());
    assert_eq!(read("a.ply", &ply_elaborate()).unwrap(), positions_only());
    assert_eq!(read("a.ply", ply_ascii().as_bytes()).unwrap(), all_attributes());
    let dos = ply_ascii().replace('\n', "\r\n");
    assert_eq!(read("a.ply", dos.as_bytes()).unwrap(), all_attributes());
    let named = ply_ascii().replace("property float v", "property float velocity_");
    assert_eq!(read("a.ply", named.as_bytes()).unwrap(), all_attributes());
    let empty = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\n\
        property float y\nproperty float z\nend_header\n";
    assert_eq!(read("a.ply", empty.as_bytes()).unwrap(), Particles::default());
}

#[test]
fn ply_malformed() {
    let good = ply_binary("little");
    let count = |to: &str| patched(&good, b"vertex 3", &[b"vertex ", to.as_bytes()].concat());
    check_message("a.ply", &count("4"), &["byte", "vertices", "4 × 37 bytes", "111 are left"]);
    check_message("a.ply", &count("2147483647"), &["byte", "2147483647 × 37"]);
    check_message("a.ply", &count("18446744073709551615"), &["byte", "are left"]);
    check_message("a.ply", &count("-1"), &["line 4", "count", "-1"]);
    check_left_out("a.ply", &patched(&good, &le([4.0]), &le([f32::NAN])), 1);
    let lists = patched(&ply_elaborate(), b"strip 2", b"strip 2147483647");
    check_message("a.ply", &lists, &["byte", "strip"]);
    let length = patched(&ply_elaborate(), &[0, 0, 0, 1, 0xff], &[0xff, 0xff, 0xff, 0xff, 0xff]);
    check_message("a.ply", &length, &["byte", "a list's length: expected 0 or more"]);

    let text = |from: &str, to: &str| {
        assert!(ply_ascii().contains(from));
        ply_ascii().replacen(from, to, 1).into_bytes()
    };
    let first = 1 + ply_ascii().lines().position(|line| line.starts_with("0.5 ")).unwrap();
    let line_0 = format!("line {first}: ");
    check_left_out("a.ply", &text("3.5 4", "3.5 NaN"), 1);
    check_message("a.ply", &text("0.5 -1.25", "0.5 x"), &[&line_0, "`x`"]);
    check_message("a.ply", &text("0.5 -1.25", "0.5"), &[&line_0, "too few values"]);
    check_message("a.ply", &text("7 0\n", "7 0 9\n"), &[&line_0, "one value too many"]);
    check_message("a.ply", &text("vertex 3", "vertex 2147483647"), &["line", "too few values"]);
    check_message("a.ply", &text("strip 2", "strip -2"), &["line 3", "-2"]);
    let ends = ply_ascii().replace("vertex 3", "vertex 5").into_bytes();
    let ends = &ends[..ends.len() - "3 0 1 2\n".len()];
    check_message("a.ply", ends, &["line", "ends before the last vertex"]);

    check_message("a.ply", &text("property float x", "property float a"), &["x, y and z"]);
    check_message("a.ply", &text("property float x", "property real x"), &["line 6", "`real`"]);
    check_message("a.ply", &text("element vertex", "element points"), &["no `element vertex`"]);
    check_message("a.ply", &text("format ascii 1.0", "comment"), &["line", "no `format`"]);
    check_message("a.ply", &text("format ascii", "format utf8"), &["line 2", "unknown header"]);
    check_message("a.ply", b"ply\nproperty float x\n", &["line 2", "first element"]);
    check_message("a.ply", b"ply\nformat ascii 1.0\n", &["end_header"]);
}
