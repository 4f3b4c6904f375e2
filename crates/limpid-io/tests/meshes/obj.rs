//! Wavefront OBJ and MTL.

use limpid::glam::{DVec3, Vec2, Vec3};

use super::{BOX_FACES, box_positions, check_box, check_message, corners, load_files, read};

pub(crate) fn obj() -> Vec<u8> {
    let mut text = String::from("# a box\no box\n");
    for [x, y, z] in box_positions() {
        text += &format!("v {x} {y} {z}\n");
    }
    for [a, b, c, d] in BOX_FACES.map(|face| face.map(|i| i + 1)) {
        text += &format!("f {a} {b} {c} {d}\n");
    }
    text.into()
}

#[test]
fn layouts() {
    check_box("plain", read("a.obj", &obj()).unwrap());
    let text = String::from_utf8(obj()).unwrap();
    check_box("dos", read("a.OBJ", text.replace('\n', "\r\n").as_bytes()).unwrap());
    let relative = text.replace("f 1 5 7 3", "f -8 -4 -2 -6");
    check_box("relative", read("a.obj", relative.as_bytes()).unwrap());
    let continued = text.replace("f 1 5 7 3", "f 1 5 \\\n7 3");
    check_box("continued", read("a.obj", continued.as_bytes()).unwrap());
    let weighted = text.replace("v -0.5 0 1\n", "v -0.5 0 1 1.0 0.5 0.5 0.5\n");
    check_box("weighted", read("a.obj", weighted.as_bytes()).unwrap());
    let others = format!("{text}p 1\nl 1 2\ns off\ng a b\nvp 1 2\ncurv 0 1 1 2\n");
    check_box("others", read("a.obj", others.as_bytes()).unwrap());
}

#[test]
fn corners_join_positions_coordinates_and_normals() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0.25\nvt 0.5\nvn 0 0 1\nvn 1 0 0\n\
        f 1/1/1 2/2/1 3/2/1\nf 1/1/1 3/2/1 4/3/2\nf 1//2 2//2 3\nf 1 2/1 3\n";
    let loaded = read("a.obj", text.as_bytes()).unwrap();
    let data = &loaded.data;
    assert_eq!(data.triangles[..2], [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(
        data.coordinates[..4],
        [Vec2::Y, Vec2::new(1.0, 0.75), Vec2::new(1.0, 0.75), Vec2::new(0.5, 1.0)]
    );
    assert_eq!(data.normals[..4], [Vec3::Z, Vec3::Z, Vec3::Z, Vec3::X]);
    // Corners without them have none, which is 0.
    assert_eq!((data.normals[4], data.coordinates[4]), (Vec3::X, Vec2::ZERO));
    assert_eq!(data.normals[data.triangles[2][2] as usize], Vec3::ZERO);
    let at = |x, y, z| DVec3::new(x, y, z);
    assert_eq!(corners(data)[3], [at(0., 0., 0.), at(1., 0., 0.), at(1., 1., 0.)]);
}

#[test]
fn materials_are_those_of_the_files_beside() {
    let text = "mtllib some colours.mtl\nmtllib b.mtl c.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n\
        f 1 2 3\nusemtl red hot\nf 1 2 3\nusemtl dark\nf 1 2 3\nusemtl red hot\nf 2 1 3\n\
        usemtl absent\nf 1 2 3\nusemtl pictured\nf 1 2 3\n";
    let first = b"Kd 1 1 1\nnewmtl red hot\nKa 0 0 0\n Kd 0.9 0.1 0.2\nNs 5\n";
    let second =
        b"newmtl dark\nKd 0.25\nnewmtl pictured\nmap_Kd -s 2 2 2 -clamp on C:\\maps\\no such.png\n";
    let files: [(&str, &[u8]); 3] =
        [("a.obj", text.as_bytes()), ("some colours.mtl", first), ("b.mtl", second)];
    let loaded = load_files(&files).unwrap();
    let grey = Vec3::splat(0.7);
    let colors: Vec<Vec3> = loaded.data.materials.iter().map(|material| material.color).collect();
    assert_eq!(colors, [grey, Vec3::new(0.9, 0.1, 0.2), Vec3::splat(0.25), grey, grey]);
    assert_eq!(loaded.data.material_of, [0, 1, 2, 1, 3, 4]);
    let remarks = loaded.remarks.join("\n");
    for fragment in [
        "c.mtl: cannot read",
        "its materials are grey",
        "b.mtl: line 4: the options of `map_Kd`",
        "a.obj: the material `absent` is not described",
        "no such.png: cannot read",
    ] {
        assert!(remarks.contains(fragment), "{fragment:?} not in: {remarks}");
    }
    assert_eq!(loaded.remarks.len(), 4, "{remarks}");
}

/// A remark, one a file, names transparent materials, which are drawn opaque.
#[test]
fn transparent_materials_are_remarks() {
    let text = b"mtllib b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n";
    let cases = [
        ("d 0.25", 1),
        ("d -halo 0.25", 1),
        ("Tr 0.75", 1),
        ("map_d holes.png", 1),
        ("d 1", 0),
        ("Tr 0", 0),
        ("Tr 1", 0),
        ("d", 0),
    ];
    for (line, count) in cases {
        let library = format!("newmtl a\nKd 1 1 1\n{line}\nnewmtl b\n{line}\n");
        let loaded = load_files(&[("a.obj", text), ("b.mtl", library.as_bytes())]).unwrap();
        assert_eq!(loaded.remarks.len(), count, "{line}: {:?}", loaded.remarks);
        let all = |remark: &String| remark.contains("a.obj") && remark.contains("drawn opaque");
        assert!(loaded.remarks.iter().all(all), "{line}: {:?}", loaded.remarks);
    }
}

#[test]
fn colours_that_are_none_are_remarks() {
    let text = b"mtllib b.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    for color in ["spectral file.rfl 1", "1 2", "x", ""] {
        let library = format!("newmtl a\nKd {color}\n");
        let loaded = load_files(&[("a.obj", text), ("b.mtl", library.as_bytes())]).unwrap();
        assert_eq!(loaded.data.materials[0].color, Vec3::splat(0.7));
        assert!(loaded.remarks[0].contains("b.mtl: line 2: `Kd"), "{:?}", loaded.remarks);
    }
    for color in ["-1 0 0", "nan 0 0", "1e20 0 0"] {
        let library = format!("newmtl a\nKd {color}\n");
        let error = load_files(&[("a.obj", text), ("b.mtl", library.as_bytes())]).unwrap_err();
        assert!(error.to_string().contains("a.obj: line 6: colour ["), "{error}");
    }
}

#[test]
fn errors_name_the_line() {
    let text = String::from_utf8(obj()).unwrap();
    let check = |to: &str, fragments: &[&str]| {
        check_message("a.obj", text.replace("f 1 5 7 3", to).as_bytes(), fragments);
    };
    check("f 1 5 7 9", &["line 11", "no vertex 9: there are 8"]);
    check("f 1 5 7 0", &["line 11", "no vertex 0"]);
    check("f 1 5 7 -9", &["line 11", "no vertex -9"]);
    check("f 1 5 7/1 3", &["line 11", "no texture vertex 1: there are 0"]);
    check("f 1 5 7//1 3", &["line 11", "no normal 1"]);
    check("f 1 5 7/1/1/1 3", &["line 11"]);
    check("f 1 5 7 4000000001", &["line 11", "no vertex 4000000001"]);
    check("f 1 5 7 9223372036854775807", &["line 11"]);
    check("f 1 5 7 -9223372036854775808", &["line 11"]);
    check("f 1 5 7 99999999999999999999", &["line 11", "expected the number of a vertex"]);
    check("f 1 5", &["line 11", "a face of 2 corners"]);
    check("f / 5 7", &["line 11", "expected a corner"]);
    check("v 1 2", &["line 11", "2 numbers, expected 3"]);
    check("v 1 2 x", &["line 11", "expected a number, found `x`"]);
    check("v 1 2 nan\nf 1 5 -1", &["line 12", "NaN"]);
    check("vn 1 2 inf\nf 1 5 7//1", &["line 12", "normal"]);
    check("vt nan\nf 1 5 7/1", &["line 12", "texture coordinates"]);
    // Joining a million lines one by one must not take quadratic time.
    let many = "\\\n".repeat(1_000_000);
    for nothing in ["", "v 1 2 3\n", "nonsense", "\\", &many] {
        check_message("a.obj", nothing.as_bytes(), &["no triangles"]);
    }
}
