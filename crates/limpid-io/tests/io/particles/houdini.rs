//! Houdini's geometry in JSON: layouts of attributes, and errors that name the attribute.

use std::path::Path;

use glam::{DVec3, Vec3};
use limpid::liquid::Particles;
use limpid_io::particles::{Contents, ReadOptions};

use super::check_message;

/// A document of this many points with these attributes.
fn geometry(points: usize, attributes: &[(&str, &str)]) -> String {
    let attribute = |(name, values): &(&str, &str)| {
        format!("[[\"type\",\"numeric\",\"name\",\"{name}\"],[\"size\",3,\"values\",[{values}]]]")
    };
    let attributes: Vec<String> = attributes.iter().map(attribute).collect();
    format!(
        "[\"pointcount\",{points},\n\"attributes\",[\"pointattributes\",[\n{}]]]",
        attributes.join(",\n")
    )
}

fn read(text: &str) -> Contents {
    Contents::parse(Path::new("a.geo"), text.as_bytes(), &ReadOptions::default())
        .unwrap_or_else(|error| panic!("{error}"))
}

const POSITIONS: &str = "\"size\",3,\"tuples\",[[1,2,3],[4,5,6.5],[7,8,9]]";

/// Pages interleave the parts of their points, and constant parts are stored once a page.
#[test]
fn pages_are_put_together() {
    let paged = "\"size\",4,\"pagesize\",2,\"packing\",[2,1,1],\
        \"constantpageflags\",[[],[false,true],[true,true]],\
        \"rawpagedata\",[1,2,4,5, 3,6, 1, 7,8, 9, 1]";
    let constant = "\"size\",3,\"pagesize\",2,\"constantpageflags\",[[true,false]],\
        \"rawpagedata\",[0,-1,0, 0,0,-2]";
    let particles = read(&geometry(3, &[("v", constant), ("P", paged)])).particles;
    let expected = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0), Vec3::new(7.0, 8.0, 9.0)];
    assert_eq!(particles.positions, expected);
    let velocities = vec![Vec3::NEG_Y, Vec3::NEG_Y, Vec3::new(0.0, 0.0, -2.0)];
    assert_eq!(particles.velocities, Some(velocities));
}

/// Attributes that are not used are listed; a mesh is told apart from points and particle systems.
#[test]
fn attributes_and_polygons_are_listed() {
    let text = geometry(3, &[("P", POSITIONS), ("Cd", POSITIONS), ("name", "")]);
    let contents = read(&text);
    let names: Vec<String> = contents.arrays.iter().map(ToString::to_string).collect();
    assert_eq!(names, ["Cd (3, 3)", "name (3)"]);
    assert_eq!(contents.cells, 0);
    let mesh = |kind: &str| {
        let counts = format!(
            "[\"vertexcount\",6,\"primitivecount\",2,\"primitives\",[[[\"type\",\"{kind}\"],[]]],"
        );
        read(&text.replacen('[', &counts, 1)).cells
    };
    assert_eq!((mesh("Polygon_run"), mesh("Part")), (2, 0));
    assert_eq!(
        read(&geometry(0, &[("P", "\"size\",3,\"tuples\",[]")])).particles,
        Particles::default()
    );
}

/// 64-bit positions keep their digits.
#[test]
fn places_far_from_the_origin() {
    let far = "\"size\",3,\"tuples\",[[10000000.1,0,0]]";
    let particles = read(&geometry(1, &[("P", far)])).particles;
    assert!(particles.place(0).distance(DVec3::new(10_000_000.1, 0.0, 0.0)) < 1e-6);
}

/// Every problem names the file and the attribute, and what was expected.
#[test]
fn damaged_geometry() {
    let check = |attributes: &[(&str, &str)], parts: &[&str]| {
        check_message("a.geo", geometry(3, attributes).as_bytes(), parts);
    };
    check(&[("Q", POSITIONS)], &["no point attribute `P`"]);
    check(&[("P", "\"size\",2")], &["attribute P: 2 numbers a point, expected 3"]);
    check(&[("P", "\"size\",3")], &["line 3", "attribute P", "no `rawpagedata`"]);
    let v = |data: &str| format!("\"size\",3,\"pagesize\",2,{data}");
    for (data, part) in [
        ("\"rawpagedata\",[1,2,3]", "expected 3 numbers for each of 3 points"),
        ("\"packing\",[2],\"rawpagedata\",[1]", "packing [2] of 3 numbers"),
        ("\"packing\",[2,1],\"rawpagedata\",[1,2,3,4,5,6]", "page 1 is cut off"),
        ("\"packing\",[2,1],\"rawpagedata\",[1,2,3,4,5,6,7,8,9,10]", "1 numbers follow"),
        ("\"tuples\",[[1,2,3],[1,2,3]]", "expected 3 numbers"),
        ("\"arrays\",[[1,2,3],[1,2,3],[1,2]]", "expected 3 numbers"),
    ] {
        check(&[("P", POSITIONS), ("v", &v(data))], &["line 4", part]);
    }
    let none = geometry(0, &[("P", "\"size\",3,\"arrays\",[[1],[2],[3]]")]);
    check_message("a.geo", none.as_bytes(), &["expected 3 numbers for each of 0 points"]);
    let many = geometry(100_000_000, &[("P", POSITIONS)]);
    check_message("a.geo", many.as_bytes(), &["100000000 points, more than can be in"]);
    check_message("a.geo", b"PGEOMETRY V5\nNPoints 1", &["Houdini's classic geometry in text"]);
    check_message("a.bgeo", b"[\"fileversion\",\"20\"]", &["no number `pointcount`"]);
}
