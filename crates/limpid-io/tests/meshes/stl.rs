//! STL, ASCII and binary.

use super::{box_corners, box_positions, box_triangles, check_box, check_message, le, read};

pub(crate) fn stl_ascii() -> Vec<u8> {
    let mut text = String::from("solid a box, with a vertex\n");
    for triangle in box_corners() {
        text += "  facet normal 0 0 0\n    outer loop\n";
        for corner in triangle {
            text += &format!("      vertex {} {:e} {}\n", corner.x, corner.y, corner.z);
        }
        text += "    endloop\n  endfacet\n";
    }
    (text + "endsolid a box\n").into()
}

pub(crate) fn stl_binary(header: &str) -> Vec<u8> {
    let mut bytes = format!("{header:80}").into_bytes();
    bytes.extend(12_u32.to_le_bytes());
    for triangle in box_triangles() {
        bytes.extend(le([f32::NAN; 3]));
        for i in triangle {
            bytes.extend(le(box_positions()[i as usize].map(|x| x as f32)));
        }
        bytes.extend([1, 2]);
    }
    bytes
}

#[test]
fn layouts() {
    for (name, bytes) in [
        ("ascii", stl_ascii()),
        ("upper", stl_ascii().to_ascii_uppercase()),
        ("unnamed", [b"solid\n", &stl_ascii()[27..]].concat()),
        ("two", [&stl_ascii()[..], b"\nsolid empty\nendsolid\n"].concat()),
        ("binary", stl_binary("")),
        ("called solid", stl_binary("solid in its header")),
    ] {
        let loaded = read("a.stl", &bytes).unwrap();
        assert_eq!(loaded.data.positions.len(), 8, "{name}");
        assert!(loaded.remarks.is_empty() && loaded.data.normals.is_empty());
        check_box(name, loaded);
    }
    let longer = [&stl_binary("")[..], b"123"].concat();
    let loaded = read("a.stl", &longer).unwrap();
    assert!(loaded.remarks[0].contains("a.stl: the 3 bytes after"), "{:?}", loaded.remarks);
    check_box("longer", loaded);
}

#[test]
fn negative_zeros_are_zeros() {
    let text = "solid\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n\
        endfacet\nfacet normal 0 0 0\nouter loop\nvertex -0 0 -0.0\nvertex 0 1 0\nvertex 0 0 1\nendloop\n\
        endfacet\nendsolid\n";
    assert_eq!(read("a.stl", text.as_bytes()).unwrap().data.triangles, [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn errors_name_the_place() {
    let text = String::from_utf8(stl_ascii()).unwrap();
    let check = |from: &str, to: &str, fragments: &[&str]| {
        assert!(text.contains(from), "{from}");
        check_message("a.stl", text.replacen(from, to, 1).as_bytes(), fragments);
    };
    check("vertex -0.5 0e0 1", "vertex nan 0 1", &["line 4", "NaN"]);
    check("vertex -0.5 0e0 1", "vertex 0 1", &["line 4", "expected three numbers"]);
    check("vertex -0.5 0e0 1", "vertex 0 1 x", &["line 4", "`x`"]);
    check("vertex -0.5 0e0 1", "", &["line 8", "a facet of 2 corners"]);
    check("vertex -0.5 0e0 1", "point 1 2 3", &["line 4", "point 1 2 3"]);
    check("endsolid a box", "", &["the file ends before `endsolid`"]);
    check_message("a.stl", b"solid\nendsolid", &["no triangles"]);
    check_message("a.stl", b"", &["an empty file"]);
    check_message("a.stl", b"\x89PNG", &["a PNG picture, not an STL mesh"]);
    let mut bytes = stl_binary("");
    check_message("a.stl", &bytes[..600], &["byte 84", "12 × 50 bytes"]);
    bytes[84 + 50 + 12..][..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    check_message("a.stl", &bytes, &["byte 146", "inf"]);
    for count in [4_000_000_000_u32, u32::MAX] {
        bytes[80..84].copy_from_slice(&count.to_le_bytes());
        check_message("a.stl", &bytes, &["byte 84", &format!("{count} × 50 bytes")]);
    }
    check_message("a.stl", &[0; 84], &["no triangles"]);
}
