//! Protects the readers of particle files: each format and variant yields the particles that were
//! written, byte by byte, into it; damaged and foreign files yield an error that names the file,
//! the place and the remedy; and no file whatever makes a reader panic or allocate by a claim.

use std::io::Write;
use std::path::Path;

use base64::prelude::{BASE64_STANDARD, Engine as _};
use flate2::write::{DeflateEncoder, GzEncoder, ZlibEncoder};
use flate2::{Compression, Crc};
use glam::{DMat3, DVec3, Mat3, Vec3, dvec3};
use limpid::particles::{Ellipsoid, Particles, Up};
use limpid::passes::classify;
use limpid::settings::Settings;
use limpid::{Error, Result};

const POSITIONS: [[f32; 3]; 3] = [[0.5, -1.25, 2.0], [3.5, 4.0, -5.75], [0.0, 1e-3, 1e6]];
const VELOCITIES: [[f32; 3]; 3] = [[1.0, 0.0, -9.5], [0.25, 0.5, 0.75], [-0.0, 2.0, 3.0]];
const DENSITIES: [f32; 3] = [1000.0, 998.5, 1001.25];
const RADII: [f32; 3] = [0.025, 0.0, 0.5];
const IDS: [i32; 3] = [7, -1, 123_456_789];

fn positions_only() -> Particles {
    Particles::from_positions(POSITIONS.map(Vec3::from).to_vec())
}

fn all_attributes() -> Particles {
    Particles {
        velocities: Some(VELOCITIES.map(Vec3::from).to_vec()),
        densities: Some(DENSITIES.to_vec()),
        radii: Some(RADII.to_vec()),
        ids: Some(IDS.map(i64::from).to_vec()),
        ..positions_only()
    }
}

fn read(name: &str, bytes: &[u8]) -> Result<Particles> {
    Particles::parse(Path::new(name), bytes)
}

/// The message of the error that reading must end in; it must name the file.
fn message(name: &str, bytes: &[u8]) -> String {
    let text = match read(name, bytes) {
        Ok(particles) => panic!("{name}: an error expected, got {particles:?}"),
        Err(error) => error.to_string(),
    };
    assert!(text.contains(name), "{text}");
    text
}

fn check_message(name: &str, bytes: &[u8], fragments: &[&str]) {
    let text = message(name, bytes);
    for fragment in fragments {
        assert!(text.contains(fragment), "{fragment:?} not in: {text}");
    }
}

/// Bytes with the first occurrence of `from` replaced; `from` must be there.
fn patched(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let at = bytes.windows(from.len()).position(|window| window == from).expect("nothing to patch");
    [&bytes[..at], to, &bytes[at + from.len()..]].concat()
}

fn be<const N: usize>(numbers: [f32; N]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_be_bytes()).collect()
}

fn le<const N: usize>(numbers: [f32; N]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

// ---- BGEO ----

/// Header of a file with these point attributes: name, size, type, defaults or strings.
fn bgeo_header(version: i32, points: i32, attributes: &[(&str, u16, i32, &[u8])]) -> Vec<u8> {
    let mut bytes = b"BgeoV".to_vec();
    for number in [version, points, 0, 0, 0, attributes.len() as i32, 0, 0, 0] {
        bytes.extend(number.to_be_bytes());
    }
    for (name, size, kind, defaults) in attributes {
        bytes.extend((name.len() as u16).to_be_bytes());
        bytes.extend(name.as_bytes());
        bytes.extend(size.to_be_bytes());
        bytes.extend(kind.to_be_bytes());
        bytes.extend(*defaults);
    }
    bytes
}

fn bgeo() -> Vec<u8> {
    let strings = [&[0, 0, 0, 2, 0, 1][..], b"a", &[0, 2], b"bc"].concat();
    let mut bytes = bgeo_header(
        5,
        3,
        &[
            ("id", 1, 1, &[0; 4]),
            ("group", 1, 4, &strings),
            ("velocity", 3, 5, &[0; 12]),
            ("uv", 2, 0, &[0; 8]),
            ("density", 1, 0, &[0; 4]),
            ("pscale", 1, 0, &[0; 4]),
        ],
    );
    for i in 0..3 {
        bytes.extend(be(POSITIONS[i]));
        bytes.extend(be([1.0]));
        bytes.extend(IDS[i].to_be_bytes());
        bytes.extend([0, 0, 0, 1]);
        bytes.extend(be(VELOCITIES[i]));
        bytes.extend(be([0.5, f32::NAN])); // not ours, so not our business
        bytes.extend(be([DENSITIES[i], RADII[i]]));
    }
    bytes.extend([0x00, 0xff]);
    bytes
}

fn bgeo_positions_only() -> Vec<u8> {
    let mut bytes = bgeo_header(5, 3, &[]);
    for position in POSITIONS {
        bytes.extend(be(position));
        bytes.extend(be([1.0]));
    }
    bytes
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn bgeo_variants() {
    assert_eq!(read("a.bgeo", &bgeo()).unwrap(), all_attributes());
    assert_eq!(read("a.BGEO", &bgeo_positions_only()).unwrap(), positions_only());
    assert_eq!(read("a.bhclassic", &bgeo()).unwrap(), all_attributes());
    assert_eq!(read("a.bgeo", &bgeo_header(5, 0, &[])).unwrap(), Particles::default());
    // Simulators gzip without saying so in the name.
    assert_eq!(read("a.bgeo", &gzip(&bgeo())).unwrap(), all_attributes());
    assert_eq!(read("a.bgeo.gz", &gzip(&bgeo())).unwrap(), all_attributes());
}

#[test]
fn bgeo_malformed() {
    let good = bgeo_positions_only();
    let count = |n: i32| patched(&good, &[0, 0, 0, 3], &n.to_be_bytes());
    check_message("a.bgeo", &count(4), &["byte 41", "points", "4 × 16 bytes", "48 are left"]);
    check_message("a.bgeo", &count(i32::MAX), &["byte 41", "2147483647"]);
    check_message("a.bgeo", &count(-1), &["byte 9", "0 or more", "-1"]);
    let attributes = |n: i32| [&good[..25], &n.to_be_bytes(), &good[29..]].concat();
    check_message("a.bgeo", &attributes(-2), &["byte 25", "attributes", "-2"]);
    check_message("a.bgeo", &attributes(i32::MAX), &["byte"]);
    check_message("a.bgeo", &bgeo_header(4, 0, &[]), &["version 4", ".bhclassic"]);
    check_message("a.bgeo", &bgeo_header(5, 0, &[("s", 1, 2, &[])]), &["byte", "s has type 2"]);
    let strings = bgeo_header(5, 0, &[("s", 1, 4, &[0xff; 4])]);
    check_message("a.bgeo", &strings, &["byte", "strings", "-1"]);
    let nan = patched(&good, &be([4.0]), &be([f32::NAN]));
    check_message("a.bgeo", &nan, &["byte 61", "particle 1", "position", "NaN", "finite"]);
    let mut cut = gzip(&bgeo());
    cut.truncate(cut.len() - 12);
    check_message("a.bgeo", &cut, &["byte", "gzip"]);
}

#[test]
fn attributes_must_be_sound() {
    let file = |name: &str, size: u16, kind: i32, value: &[u8]| {
        let header = bgeo_header(5, 1, &[(name, size, kind, &vec![0; 4 * usize::from(size)])]);
        [header, be([0.0, 0.0, 0.0, 1.0]), value.to_vec()].concat()
    };
    let inf = f32::INFINITY;
    let cases = [
        (file("v", 3, 5, &be([0.0, inf, 0.0])), "velocity"),
        (file("rho", 1, 0, &be([f32::NAN])), "density"),
        (file("radius", 1, 0, &be([-inf])), "radius"),
        (file("radii", 1, 0, &be([-0.5])), "radius -0.5, 0 or more"),
        (file("ids", 1, 0, &be([1.5])), "id 1.5, a 64-bit integer"),
    ];
    for (bytes, fragment) in cases {
        check_message("a.bgeo", &bytes, &["byte", "particle 0", fragment]);
    }
    // A known name with another shape is another attribute.
    let other = read("a.bgeo", &file("density", 3, 5, &be([inf, 0.0, 0.0]))).unwrap();
    assert_eq!(other.densities, None);
}

// ---- legacy VTK ----

/// As simulators write it, `SPlisHSPlasH` for one.
fn vtk_4_1() -> Vec<u8> {
    let mut bytes =
        b"# vtk DataFile Version 4.1\nfluid\nBINARY\nDATASET UNSTRUCTURED_GRID\n".to_vec();
    bytes.extend(b"POINTS 3 float\n");
    bytes.extend(POSITIONS.into_iter().flat_map(be));
    bytes.extend(b"\nCELLS 3 6\n");
    bytes.extend([1, 0, 1, 1, 1, 2].into_iter().flat_map(i32::to_be_bytes));
    bytes.extend(b"\nCELL_TYPES 3\n");
    bytes.extend([1, 1, 1].into_iter().flat_map(i32::to_be_bytes));
    bytes.extend(b"\nPOINT_DATA 3\nSCALARS id int 1\nLOOKUP_TABLE id_table\n");
    bytes.extend(IDS.into_iter().flat_map(i32::to_be_bytes));
    bytes.extend(b"\nFIELD FieldData 3\nvelocity 3 3 float\n");
    bytes.extend(VELOCITIES.into_iter().flat_map(be));
    bytes.extend(b"\ndensity 1 3 float\n");
    bytes.extend(be(DENSITIES));
    bytes.extend(b"\nradius 1 3 float\n");
    bytes.extend(be(RADII));
    bytes.extend(b"\n");
    bytes
}

/// As `ParaView` writes it: doubles, metadata, 64-bit offsets, time and cell data.
fn vtk_5_1() -> Vec<u8> {
    let wide = |numbers: [f32; 3]| numbers.map(|x| f64::from(x).to_be_bytes()).concat();
    let metadata =
        b"\nMETADATA\nINFORMATION 1\nNAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0 1\n\n";
    let mut bytes = b"# vtk DataFile Version 5.1\nvtk output\nBINARY\nDATASET POLYDATA\n".to_vec();
    bytes.extend(b"FIELD FieldData 1\nTIME 1 1 double\n");
    bytes.extend(0.5_f64.to_be_bytes());
    bytes.extend(b"\nPOINTS 3 double\n");
    bytes.extend(POSITIONS.into_iter().flat_map(wide));
    bytes.extend(metadata);
    bytes.extend(b"VERTICES 4 3\nOFFSETS vtktypeint64\n");
    bytes.extend([0, 1, 2, 3].into_iter().flat_map(i64::to_be_bytes));
    bytes.extend(b"\nCONNECTIVITY vtktypeint64\n");
    bytes.extend([0, 1, 2].into_iter().flat_map(i64::to_be_bytes));
    bytes.extend(b"\nCELL_DATA 3\nSCALARS radius unsigned_char\nLOOKUP_TABLE default\n");
    bytes.extend([1, 2, 3]);
    bytes.extend(b"\nPOINT_DATA 3\nNORMALS n float\n");
    bytes.extend([0; 36]);
    bytes.extend(b"\nVECTORS Velocity double\n");
    bytes.extend(VELOCITIES.into_iter().flat_map(wide));
    bytes.extend(metadata);
    bytes.extend(b"SCALARS pscale float\nLOOKUP_TABLE t\n");
    bytes.extend(be(RADII));
    bytes.extend(b"\nLOOKUP_TABLE t 2\n");
    bytes.extend([9; 8]);
    bytes.extend(b"\nFIELD FieldData 2\nrho 1 3 double\n");
    bytes.extend(wide(DENSITIES));
    bytes.extend(metadata);
    bytes.extend(b"id 1 3 vtktypeint64\n");
    bytes.extend(IDS.into_iter().flat_map(|id| i64::from(id).to_be_bytes()));
    bytes.extend(b"\n");
    bytes
}

const VTK_ASCII: &str = "# vtk DataFile Version 3.0
title
ASCII
DATASET UNSTRUCTURED_GRID

POINTS 3 float
0.5 -1.25 2 3.5 4
-5.75
0 1e-3 1e6

CELLS 3 6
1 0 1 1 1 2
CELL_TYPES 3
1 1 1
POINT_DATA 3
COLOR_SCALARS c 2
0 0 0.5 0.5 1 1
SCALARS id int
LOOKUP_TABLE default
7 -1 123456789
FIELD FieldData 2
v 3 3 float
1 0 -9.5 0.25 0.5 0.75 -0 2 3
METADATA
COMPONENT_NAMES
X%20Y

radii 1 3 double
0.025 0 0.5
SCALARS density float 1
LOOKUP_TABLE default
1000 998.5 1001.25
";

#[test]
fn vtk_variants() {
    assert_eq!(read("a.vtk", &vtk_4_1()).unwrap(), all_attributes());
    assert_eq!(read("a.vtk", &vtk_5_1()).unwrap(), all_attributes());
    assert_eq!(read("a.VTK", VTK_ASCII.as_bytes()).unwrap(), all_attributes());
    let dos = VTK_ASCII.replace('\n', "\r\n");
    assert_eq!(read("a.vtk", dos.as_bytes()).unwrap(), all_attributes());
    let without_table = patched(&vtk_4_1(), b"LOOKUP_TABLE id_table\n", b"");
    assert_eq!(read("a.vtk", &without_table).unwrap(), all_attributes());
    let empty = b"# vtk DataFile Version 5.1\n\nBINARY\nDATASET POLYDATA\nPOINTS 0 float\n\n";
    assert_eq!(read("a.vtk", empty).unwrap(), Particles::default());
    let text = "# vtk DataFile Version 2.0\n\nASCII\nDATASET POLYDATA\nPOINTS 3 double
        0.5 -1.25 2  3.5 4 -5.75  0 .001 1000000\nVERTICES 1 4\n3 0 1 2\n";
    assert_eq!(read("a.vtk", text.as_bytes()).unwrap(), positions_only());
}

/// Every integer type is stepped over by its own width.
#[test]
fn vtk_integer_types() {
    let types = [
        ("char", 1),
        ("unsigned_char", 1),
        ("short", 2),
        ("unsigned_short", 2),
        ("int", 4),
        ("unsigned_int", 4),
        ("vtkIdType", 4),
        ("long", 8),
        ("unsigned_long", 8),
        ("vtktypeint64", 8),
        ("vtktypeuint64", 8),
    ];
    for (name, width) in types {
        let scalars = format!("SCALARS id {name} 1\n");
        let id = |i: usize| [vec![0; width - 1], vec![i as u8]].concat();
        let from = [b"SCALARS id int 1\nLOOKUP_TABLE id_table\n".to_vec(), ids_be()].concat();
        let to = [scalars.into_bytes(), id(5), id(6), id(7)].concat();
        let particles = read("a.vtk", &patched(&vtk_4_1(), &from, &to)).unwrap();
        assert_eq!(particles, Particles { ids: Some(vec![5, 6, 7]), ..all_attributes() }, "{name}");
    }
}

fn ids_be() -> Vec<u8> {
    IDS.into_iter().flat_map(i32::to_be_bytes).collect()
}

#[test]
fn vtk_malformed() {
    let good = vtk_4_1();
    let points =
        |count: &str| patched(&good, b"POINTS 3", &[b"POINTS ", count.as_bytes()].concat());
    check_message("a.vtk", &points("2"), &["byte", "keyword", "as long as announced"]);
    check_message("a.vtk", &points("-3"), &["byte 66", "POINTS", "count", "-3"]);
    check_message("a.vtk", &points("2147483647"), &["byte 90", "2147483647 × 12"]);
    check_message("a.vtk", &points("18446744073709551615"), &["byte", "are left"]);
    check_message("a.vtk", &points("99999999999999999999"), &["byte", "count"]);
    check_message("a.vtk", &points(""), &["byte", "count"]);
    let nan = patched(&good, &be([4.0]), &be([f32::NAN]));
    check_message("a.vtk", &nan, &["byte 97", "particle 1", "position", "NaN"]);
    let bad = patched(&good, &be([998.5]), &be([f32::INFINITY]));
    check_message("a.vtk", &bad, &["byte", "particle 1", "density"]);

    // Counts that contradict each other.
    let other = patched(&good, b"POINT_DATA 3", b"POINT_DATA 2");
    check_message("a.vtk", &other, &["byte", "2 points", "3"]);
    let field = patched(&good, b"density 1 3", b"density 1 2");
    check_message("a.vtk", &field, &["byte", "density", "2 entries, 3 expected"]);
    let size = patched(&good, b"SCALARS id int 1", b"SCALARS id int 2");
    check_message("a.vtk", &size, &["byte"]);
    let size = patched(&good, b"density 1 3", b"density 9223372036854775807 3");
    check_message("a.vtk", &size, &["byte", "density"]);
    let second = [&good[..], b"POINTS 1 float\n", &[0; 12]].concat();
    check_message("a.vtk", &second, &["byte", "second POINTS"]);

    // Text names lines.
    let text = |from: &str, to: &str| {
        assert!(VTK_ASCII.contains(from));
        VTK_ASCII.replacen(from, to, 1).into_bytes()
    };
    check_message("a.vtk", &text("-5.75", "nan"), &["line 7", "particle 1", "position", "NaN"]);
    check_message("a.vtk", &text("-5.75", "x"), &["line 8", "number expected", "`x`"]);
    check_message("a.vtk", &text("POINTS 3", "POINTS 2147483647"), &["line 11", "`CELLS`"]);
    check_message("a.vtk", &text("POINTS 3", "POINTS -3"), &["line 6", "-3"]);
    check_message("a.vtk", &text("0.025 0", "0.025 -1"), &["line", "particle 1", "radius -1"]);
    check_message("a.vtk", &text("radii 1 3", "radii 0 99"), &["line", "99 entries"]);
    check_message("a.vtk", &text("v 3 3 float", "v 3 3 string"), &["line 22", "`string`"]);
    check_message("a.vtk", &text("v 3 3 float", "v 3 3"), &["line 22", "field"]);
    let cut = VTK_ASCII.split("998.5").next().unwrap();
    check_message("a.vtk", cut.as_bytes(), &["line 32", "row 1 of 3"]);

    check_message("a.vtk", &patched(&good, b"4.1", b"6.0"), &["6.0", "1.0 to 5.1"]);
    check_message("a.vtk", &patched(&good, b"BINARY", b"HEX"), &["line 3", "HEX"]);
    let grid = patched(&good, b"UNSTRUCTURED_GRID", b"RECTILINEAR_GRID");
    check_message("a.vtk", &grid, &["RECTILINEAR_GRID", "unstructured grid or polydata"]);
    check_message("a.vtk", b"# vtk DataFile Version 3.0\n\nASCII\n", &["line", "POINTS"]);
}

// ---- PLY ----

const PLY_PROPERTIES: &str = "property float x\nproperty float32 y\nproperty float z
property uchar red\nproperty float vx\nproperty float vy\nproperty float vz
property float density\nproperty float radius\nproperty int32 id\n";

fn ply_binary(order: &str) -> Vec<u8> {
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

trait Reversed {
    fn map_reverse(self) -> Self;
}

impl Reversed for [u8; 4] {
    fn map_reverse(mut self) -> Self {
        self.reverse();
        self
    }
}

/// Lists, doubles, and elements before and after the vertices.
fn ply_elaborate() -> Vec<u8> {
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

fn ply_ascii() -> String {
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
    check_message("a.ply", &patched(&good, &le([4.0]), &le([f32::NAN])), &["byte", "particle 1"]);
    let bad = patched(&good, &le([-9.5]), &le([f32::INFINITY]));
    check_message("a.ply", &bad, &["byte", "particle 0", "velocity"]);
    let lists = patched(&ply_elaborate(), b"strip 2", b"strip 2147483647");
    check_message("a.ply", &lists, &["byte", "strip"]);
    let length = patched(&ply_elaborate(), &[0, 0, 0, 1, 0xff], &[0xff, 0xff, 0xff, 0xff, 0xff]);
    check_message("a.ply", &length, &["byte", "a list's length: 0 or more"]);

    let text = |from: &str, to: &str| {
        assert!(ply_ascii().contains(from));
        ply_ascii().replacen(from, to, 1).into_bytes()
    };
    let first = 1 + ply_ascii().lines().position(|line| line.starts_with("0.5 ")).unwrap();
    let [line_0, line_1] = [first, first + 1].map(|line| format!("line {line}: "));
    check_message("a.ply", &text("3.5 4", "3.5 NaN"), &[&line_1, "particle 1", "position"]);
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

// ---- npy ----

fn npy(kind: &str, fortran: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let mut header =
        format!("{{'descr': '{kind}', 'fortran_order': {fortran}, 'shape': {shape}, }}");
    header += &" ".repeat(63 - (10 + header.len()) % 64);
    header += "\n";
    let length = (header.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), data].concat()
}

fn npy_data() -> Vec<u8> {
    POSITIONS.into_iter().flat_map(le).collect()
}

fn npy_fortran() -> Vec<u8> {
    let axes = [0, 1, 2].map(|k| POSITIONS.map(|p| f64::from(p[k]).to_be_bytes()).concat());
    npy(">f8", "True", "(3, 3)", &axes.concat())
}

#[test]
fn npy_variants() {
    let doubles = POSITIONS.map(|p| p.map(|x| f64::from(x).to_le_bytes()).concat()).concat();
    let floats = POSITIONS.map(be).concat();
    let variants = [
        npy("<f4", "False", "(3, 3)", &npy_data()),
        npy(">f4", "False", "(3, 3)", &floats),
        npy("<f8", "False", "(3, 3)", &doubles),
        npy_fortran(),
    ];
    for bytes in &variants {
        assert_eq!(read("a.npy", bytes).unwrap(), positions_only());
    }
    // Version 2 has a longer length.
    let v1 = &variants[0];
    let v2 = [b"\x93NUMPY\x02\x00", &v1[8..10], &[0, 0], &v1[10..]].concat();
    assert_eq!(read("a.npy", &v2).unwrap(), positions_only());
    assert!(read("a.npy", &npy("<f4", "False", "(0, 3)", &[])).unwrap().is_empty());
}

#[test]
fn npy_malformed() {
    let data = npy_data();
    let shaped = |shape: &str| npy("<f4", "False", shape, &data);
    check_message("a.npy", &shaped("(4, 3)"), &["byte 128", "4 × 12 bytes", "36 are left"]);
    check_message("a.npy", &shaped("(2147483647, 3)"), &["byte", "2147483647 × 12"]);
    check_message("a.npy", &shaped("(18446744073709551615, 3)"), &["byte", "are left"]);
    check_message("a.npy", &shaped("(-1, 3)"), &["byte", "count", "-1"]);
    for shape in ["(3,)", "(9, 1)", "(3, 4)", "(1, 3, 3)", "()"] {
        check_message("a.npy", &shaped(shape), &[shape, "(n, 3) expected"]);
    }
    check_message("a.npy", &shaped("3"), &["byte", "`shape`"]);
    for kind in ["<i4", "<f2", "|O", "<c8"] {
        check_message("a.npy", &npy(kind, "False", "(3, 3)", &data), &[kind, "floats expected"]);
    }
    check_message("a.npy", &npy("<f4", "Maybe", "(3, 3)", &data), &["`fortran_order`"]);
    let nested = npy("<f4", "False", &"(".repeat(50_000), &data);
    check_message("a.npy", &nested, &["byte", "`shape`"]);
    let nan = patched(&shaped("(3, 3)"), &le([4.0]), &le([f32::NAN]));
    check_message("a.npy", &nan, &["byte 144", "particle 1", "position"]);
    let nan = patched(&npy_fortran(), &4.0_f64.to_be_bytes(), &f64::NAN.to_be_bytes());
    check_message("a.npy", &nan, &["byte 160", "particle 1", "position"]);
    check_message("a.npy", b"\x93NUMPY\x09\x00", &["version 9"]);
}

// ---- xyz ----

#[test]
fn xyz_variants() {
    assert_eq!(read("a.xyz", &npy_data()).unwrap(), positions_only());
    let text = "0.5 -1.25 2\r\n3.5\t4  -5.75\n\n  0 1e-3 1e6";
    assert_eq!(read("a.xyz", text.as_bytes()).unwrap(), positions_only());
    assert!(read("a.xyz", b"").unwrap().is_empty());
}

#[test]
fn xyz_malformed() {
    let good = npy_data();
    check_message("a.xyz", &good[..35], &["byte 24", "particle 2", "12 bytes", "11 are left"]);
    let nan = patched(&good, &le([4.0]), &le([f32::NAN]));
    check_message("a.xyz", &nan, &["byte 16", "particle 1", "position"]);
    // The same from a file, which is read in another way.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.xyz");
    for bytes in [&good[..35], &nan, b"x", &bgeo()] {
        std::fs::write(&path, bytes).unwrap();
        let error = Particles::read(&path).unwrap_err().to_string();
        let told = message("a.xyz", bytes);
        assert!(error.ends_with(told.strip_prefix("a.xyz").unwrap()), "{error}");
    }
    check_message("a.xyz", b"1 2 3\n\n4 5\n", &["line 3", "particle 1", "2 words"]);
    check_message("a.xyz", b"1 2 3\nH 0 0\n", &["line 2", "number", "`H`"]);
    check_message("a.xyz", b"1 2 3\n4 5 inf\n", &["line 2", "particle 1", "position"]);
    check_message("a.xyz", &bgeo(), &["a BGEO file"]);
}

// ---- VTK's XML ----

/// How the arrays of a file are stored.
#[derive(Clone, Copy, PartialEq)]
enum Stored {
    Ascii,
    Inline,
    AppendedBase64,
    AppendedRaw,
}

/// How the headers of arrays are written.
#[derive(Clone, Copy)]
struct Headers {
    big: bool,
    /// 64-bit numbers.
    long: bool,
    /// Bytes of a block that zlib compresses.
    zlib: Option<usize>,
    /// A length is encoded apart from its bytes.
    apart: bool,
}

const PLAIN: Headers = Headers { big: false, long: false, zlib: None, apart: false };

impl Headers {
    fn words(&self, words: &[usize]) -> Vec<u8> {
        let word = |&word: &usize| match (self.long, self.big) {
            (true, true) => (word as u64).to_be_bytes().to_vec(),
            (true, false) => (word as u64).to_le_bytes().to_vec(),
            (false, true) => (word as u32).to_be_bytes().to_vec(),
            (false, false) => (word as u32).to_le_bytes().to_vec(),
        };
        words.iter().flat_map(word).collect()
    }

    /// A header and the bytes that it announces.
    fn split(&self, bytes: &[u8]) -> (Vec<u8>, Vec<u8>) {
        let Some(size) = self.zlib else { return (self.words(&[bytes.len()]), bytes.to_vec()) };
        let blocks: Vec<_> = bytes.chunks(size).map(zlib).collect();
        let mut words = vec![blocks.len(), size, bytes.len() % size];
        words.extend(blocks.iter().map(Vec::len));
        (self.words(&words), blocks.concat())
    }

    fn raw(&self, bytes: &[u8]) -> Vec<u8> {
        let (header, data) = self.split(bytes);
        [header, data].concat()
    }

    fn base64(&self, bytes: &[u8]) -> String {
        let (header, data) = self.split(bytes);
        if self.apart || self.zlib.is_some() {
            return BASE64_STANDARD.encode(header) + &BASE64_STANDARD.encode(data);
        }
        BASE64_STANDARD.encode([header, data].concat())
    }
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// A file with so many of the particles in each of its pieces.
fn vtu(kind: &str, pieces: &[usize], stored: Stored, headers: Headers) -> Vec<u8> {
    let order = if headers.big { "BigEndian" } else { "LittleEndian" };
    let header_type = if headers.long { "UInt64" } else { "UInt32" };
    let compressor =
        if headers.zlib.is_some() { " compressor=\"vtkZLibDataCompressor\"" } else { "" };
    let mut xml = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"{kind}\" version=\"1.0\" \
         byte_order=\"{order}\" header_type=\"{header_type}\"{compressor}>\n<{kind}>\n"
    );
    let mut appended = Vec::new();
    let mut array = |name: &str, size: usize, numbers: &[f32], integers: bool| {
        let kind = if integers { "Int32" } else { "Float32" };
        let word = |&number: &f32| {
            let word = if integers { (number as i32).to_be_bytes() } else { number.to_be_bytes() };
            if headers.big { word } else { word.map_reverse() }
        };
        let bytes: Vec<u8> = numbers.iter().flat_map(word).collect();
        let tag = format!("<DataArray type='{kind}' Name='{name}' NumberOfComponents='{size}'");
        let told = "<InformationKey name='RANGE'><Value index='0'> 7 </Value></InformationKey>";
        match stored {
            Stored::Ascii => {
                let text: Vec<String> = numbers.iter().map(f32::to_string).collect();
                format!("{tag} format='ascii'>\n{}\n{told}</DataArray>\n", text.join(" "))
            }
            Stored::Inline => {
                let text = headers.base64(&bytes);
                format!("{tag} format='binary'>{told}\n  {text}\n</DataArray>\n")
            }
            Stored::AppendedBase64 | Stored::AppendedRaw => {
                let offset = appended.len();
                if stored == Stored::AppendedRaw {
                    appended.extend(headers.raw(&bytes));
                } else {
                    appended.extend(headers.base64(&bytes).into_bytes());
                }
                format!("{tag} format='appended' offset='{offset}'/>\n")
            }
        }
    };
    let mut first = 0;
    for &n in pieces {
        let range = || first..first + n;
        xml += &format!("<Piece NumberOfPoints='{n}' NumberOfCells='{n}'>\n<PointData>\n");
        xml += &array("velocity", 3, VELOCITIES[range()].as_flattened(), false);
        xml += &array("pressure", 1, &RADII[range()], false);
        xml += &array("density", 1, &DENSITIES[range()], false);
        xml += &array("radius", 1, &RADII[range()], false);
        let ids: Vec<f32> =
            IDS[range()].iter().map(|&id| if id > 99 { 99.0 } else { id as f32 }).collect();
        xml += &array("id", 1, &ids, true);
        xml += "</PointData>\n<CellData/>\n<Points>\n";
        xml += &array("Points", 3, POSITIONS[range()].as_flattened(), false);
        xml += "</Points>\n<Cells>\n";
        xml += &array("density", 1, &[0.5], false); // not the points'
        xml += "</Cells>\n</Piece>\n";
        first += n;
    }
    xml += &format!("</{kind}>\n");
    let mut bytes = xml.into_bytes();
    if matches!(stored, Stored::AppendedBase64 | Stored::AppendedRaw) {
        let encoding = if stored == Stored::AppendedRaw { "raw" } else { "base64" };
        bytes.extend(format!("<AppendedData encoding=\"{encoding}\">\n  _").bytes());
        bytes.extend(appended);
        bytes.extend(b"\n</AppendedData>\n");
    }
    bytes.extend(b"</VTKFile>\n");
    bytes
}

/// Ids that fit a 32-bit float, in which [`vtu`] keeps them.
fn vtu_attributes() -> Particles {
    Particles { ids: Some(vec![7, -1, 99]), ..all_attributes() }
}

#[test]
fn vtu_variants() {
    let whole = [3];
    let long = Headers { long: true, ..PLAIN };
    let big = Headers { big: true, ..PLAIN };
    let zlib = |size| Headers { zlib: Some(size), ..PLAIN };
    let variants = [
        (Stored::Ascii, PLAIN),
        (Stored::Inline, PLAIN),
        (Stored::Inline, Headers { apart: true, ..PLAIN }),
        (Stored::Inline, Headers { apart: true, ..long }),
        (Stored::Inline, Headers { zlib: Some(8), ..long }),
        (Stored::Inline, zlib(12)),
        (Stored::AppendedBase64, PLAIN),
        (Stored::AppendedBase64, long),
        (Stored::AppendedBase64, Headers { big: true, ..long }),
        (Stored::AppendedBase64, zlib(1 << 15)),
        (Stored::AppendedRaw, big),
        (Stored::AppendedRaw, long),
        (Stored::AppendedRaw, Headers { big: true, ..zlib(4) }),
        (Stored::AppendedRaw, Headers { zlib: Some(36), ..long }),
    ];
    for (i, (stored, headers)) in variants.into_iter().enumerate() {
        let read = |kind: &str, pieces: &[_]| {
            let name = if kind == "PolyData" { "a.vtp" } else { "a.vtu" };
            let particles = read(name, &vtu(kind, pieces, stored, headers));
            particles.unwrap_or_else(|error| panic!("variant {i}: {error}"))
        };
        assert_eq!(read("UnstructuredGrid", &whole), vtu_attributes(), "variant {i}");
        assert_eq!(read("PolyData", &whole), vtu_attributes(), "variant {i}");
        let pieces = [1, 0, 2];
        assert_eq!(read("UnstructuredGrid", &pieces), vtu_attributes(), "variant {i} in pieces");
        assert_eq!(read("UnstructuredGrid", &[0]).len(), 0, "variant {i} of nothing");
        assert_eq!(read("UnstructuredGrid", &[]), Particles::default(), "variant {i} of no piece");
    }
}

/// An array of two places, letter by letter.
#[test]
fn vtu_by_hand() {
    let file = |array: &str| {
        format!(
            "<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\"><PolyData>\
             <Piece NumberOfPoints=\"2\"><Points>{array}</Points></Piece></PolyData></VTKFile>"
        )
    };
    let array = "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"binary\">\
        GAAAAAAAgD8AAABAAABAQAAAgEAAAKBAAADAQA==</DataArray>";
    let places = vec![Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)];
    let expected = Particles::from_positions(places);
    assert_eq!(read("a.vtp", file(array).as_bytes()).unwrap(), expected);
    let doubles =
        "<DataArray type=\"Float64\" NumberOfComponents=\"3\">1 2 3\n4 5. 6e0</DataArray>";
    assert_eq!(read("a.vtp", file(doubles).as_bytes()).unwrap(), expected);
}

#[test]
fn vtu_malformed() {
    let text = String::from_utf8(vtu("PolyData", &[3], Stored::Ascii, PLAIN)).unwrap();
    let with = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1).into_bytes()
    };
    let check = |from: &str, to: &str, fragments: &[&str]| {
        check_message("a.vtp", &with(from, to), fragments);
    };
    check("Points='3'", "Points='4'", &["byte", "velocity", "4 × 3 numbers", "9 found"]);
    check("Points='3'", "Points='-3'", &["byte", "NumberOfPoints", "count", "-3"]);
    check("Points='3'", "Points='18446744073709551615'", &["byte", "velocity"]);
    check("0.5 -1.25", "x -1.25", &["byte", "Points", "number", "`x`"]);
    check("0.5 -1.25", "nan -1.25", &["byte", "particle 0", "position", "NaN"]);
    check("type='Float32'", "type='String'", &["byte", "number type", "`String`"]);
    check("format='ascii'", "format='hex'", &["byte", "`hex`"]);
    check("format='ascii'", "format='appended' offset='9'", &["byte", "no appended data"]);
    check("type=\"PolyData\"", "type=\"ImageData\"", &["`ImageData`", "PolyData expected"]);
    check("UInt32", "UInt16", &["byte", "header type `UInt16`"]);
    check("LittleEndian", "Middle", &["byte", "byte order `Middle`"]);
    check("</VTKFile>", "", &["byte", "ends before </VTKFile>"]);
    check("</Points>", "</Point>", &["byte", "not XML"]);
    check("<VTKFile", "<Html", &["not VTK's"]);
    let lz4 = with("header_type", "compressor='vtkLZ4DataCompressor' header_type");
    check_message("a.vtp", &lz4, &["vtkLZ4DataCompressor", "zlib or none"]);

    let raw = |headers: Headers| vtu("UnstructuredGrid", &[3], Stored::AppendedRaw, headers);
    let length = patched(&raw(PLAIN), &[b'_', 36, 0, 0, 0], &[b'_', 37, 0, 0, 0]);
    check_message("a.vtu", &length, &["byte", "36 bytes expected, 37 announced"]);
    let beyond = patched(&raw(PLAIN), b"offset='0'", b"offset='18446744073709551615'");
    check_message("a.vtu", &beyond, &["byte", "beyond the file"]);
    let zlib = raw(Headers { zlib: Some(36), ..PLAIN });
    let start = [&b"_"[..], [1_u32, 36, 0].map(u32::to_le_bytes).as_flattened()].concat();
    let header = |words: [u32; 3]| {
        patched(&zlib, &start, &[&b"_"[..], words.map(u32::to_le_bytes).as_flattened()].concat())
    };
    check_message("a.vtu", &header([2, 36, 0]), &["byte", "velocity", "2 blocks of 36"]);
    check_message("a.vtu", &header([u32::MAX, 36, 0]), &["byte", "velocity", "announced"]);
    check_message("a.vtu", &header([36, 1, 0]), &["byte", "velocity"]);
    let block = patched(&zlib, &[0x78, 0x01], &[0x78, 0x02]);
    check_message("a.vtu", &block, &["byte", "velocity", "block 0"]);

    // What is claimed in one place must be claimed in all, and be possible.
    let claims = Headers { long: true, zlib: Some(36), ..PLAIN };
    let claims = patched(&raw(claims), b"Points='3'", b"Points='300000000000'");
    check_message("a.vtu", &claims, &["byte", "velocity", "3600000000000 bytes expected"]);
    let words = |words: [u64; 3]| [&b"_"[..], words.map(u64::to_le_bytes).as_flattened()].concat();
    let claims = patched(&claims, &words([1, 36, 0]), &words([1, 3_600_000_000_000, 0]));
    check_message("a.vtu", &claims, &["byte", "velocity", "cannot be in"]);
}

// ---- npz ----

/// A zip archive, byte by byte: members with names, as they are or deflated.
fn npz(members: &[(&str, Vec<u8>)], deflated: bool) -> Vec<u8> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, contents) in members {
        let mut crc = Crc::new();
        crc.update(contents);
        let stored = if deflated {
            let mut encoder = DeflateEncoder::new(Vec::new(), Compression::fast());
            encoder.write_all(contents).unwrap();
            encoder.finish().unwrap()
        } else {
            contents.clone()
        };
        let method = if deflated { 8_u16 } else { 0 };
        let mut common = 20_u16.to_le_bytes().to_vec(); // version 2.0
        common.extend([0; 2]);
        common.extend(method.to_le_bytes());
        common.extend([0, 0, 0x21, 0]); // 1 January 1980
        for number in [crc.sum(), stored.len() as u32, contents.len() as u32] {
            common.extend(number.to_le_bytes());
        }
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0; 2]);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend((bytes.len() as u32).to_le_bytes());
        directory.extend(name.bytes());
        bytes.extend(b"PK\x03\x04");
        bytes.extend(&common);
        bytes.extend(name.bytes());
        bytes.extend(stored);
    }
    let start = bytes.len() as u32;
    let count = (members.len() as u16).to_le_bytes();
    bytes.extend(&directory);
    bytes.extend(b"PK\x05\x06\x00\x00\x00\x00");
    bytes.extend([count, count].concat());
    bytes.extend((directory.len() as u32).to_le_bytes());
    bytes.extend(start.to_le_bytes());
    bytes.extend([0; 2]);
    bytes
}

fn npz_members() -> Vec<(&'static str, Vec<u8>)> {
    let velocities = VELOCITIES.into_iter().flat_map(le).collect::<Vec<_>>();
    let ids = IDS.into_iter().flat_map(i32::to_le_bytes).collect::<Vec<_>>();
    vec![
        ("vel.npy", npy("<f4", "False", "(3, 3)", &velocities)),
        ("time.npy", npy("<f8", "False", "()", &[0; 8])),
        ("names.npy", npy("|O", "False", "(2,)", &[1, 2])),
        ("positions.npy", npy("<f4", "False", "(3, 3)", &npy_data())),
        ("readme.txt", b"nothing of ours".to_vec()),
        ("rho.npy", npy(">f4", "False", "(3,)", &be(DENSITIES))),
        ("radius.npy", npy("<f4", "True", "(3, 1)", &le(RADII))),
        ("ids.npy", npy("<i4", "False", "(3,)", &ids)),
    ]
}

#[test]
fn npz_variants() {
    for deflated in [false, true] {
        assert_eq!(read("a.npz", &npz(&npz_members(), deflated)).unwrap(), all_attributes());
        let float = npy("<f4", "False", "(3, 3)", &npy_data());
        for name in ["position.npy", "POS.npy", "x.npy", "points.npy", "arr_0.npy", "other.npy"] {
            let one = npz(&[(name, float.clone())], deflated);
            assert_eq!(read("a.npz", &one).unwrap(), positions_only(), "{name}");
        }
        let wide = npz(&[("x.npy", npy_fortran())], deflated);
        assert_eq!(read("a.npz", &wide).unwrap(), positions_only());
        // A column for each axis is not what is called x, and a velocity is not a position.
        let velocity = ("v.npy", npy("<f4", "False", "(3, 3)", &npy_data()));
        let x = ("x.npy", npy("<f4", "False", "(9,)", &npy_data()));
        check_message("a.npz", &npz(&[velocity, x], deflated), &["(n, 3)", "v, x"]);
        let two = npz(&[("a.npy", float.clone()), ("b.npy", float.clone())], deflated);
        check_message("a.npz", &two, &["nor a single other one", "a, b"]);
    }
}

#[test]
fn npz_malformed() {
    let good = npz(&npz_members(), false);
    let short =
        npz(&[npz_members()[3].clone(), ("rho.npy", npy("<f4", "False", "(2,)", &[0; 8]))], true);
    check_message("a.npz", &short, &["(rho.npy)", "byte 128", "2 entries for 3 particles"]);
    let claim = npz(&[("x.npy", npy("<f4", "False", "(2147483647, 3)", &npy_data()))], true);
    check_message("a.npz", &claim, &["(x.npy)", "byte", "2147483647 × 12"]);
    let nan = npz(&[("x.npy", npy("<f4", "False", "(1, 3)", &le([0.0, f32::NAN, 0.0])))], true);
    check_message("a.npz", &nan, &["(x.npy)", "byte 132", "particle 0", "position"]);
    let crc = patched(&good, &be([998.5]), &be([998.0]));
    check_message("a.npz", &crc, &["(rho.npy)", "damaged"]);
    check_message("a.npz", &good[..good.len() - 9], &["byte", "damaged"]);
    check_message("a.npz", &npz(&[], false), &["no array"]);
    check_message("a.npz", &npy_data(), &["not an archive"]);
}

// ---- pos and ani ----

fn pos(radius: f32) -> Vec<u8> {
    [3_u32.to_le_bytes().to_vec(), le([radius]), npy_data()].concat()
}

#[test]
fn pos_variants() {
    let expected = Particles { radii: Some(vec![0.25; 3]), ..positions_only() };
    assert_eq!(read("frame.0001.pos", &pos(0.25)).unwrap(), expected);
    assert_eq!(read("a.pos", &pos(0.0)).unwrap(), positions_only());
    assert_eq!(read("a.pos", &[0; 8]).unwrap(), Particles::default());
}

#[test]
fn pos_malformed() {
    let count = |n: u32| [&n.to_le_bytes(), &pos(0.25)[4..]].concat();
    check_message("a.pos", &count(4), &["byte 8", "4 × 12 bytes", "36 are left"]);
    check_message("a.pos", &count(u32::MAX), &["byte 8", "4294967295 × 12"]);
    check_message("a.pos", &count(2), &["byte 32", "12 bytes are left"]);
    check_message("a.pos", &pos(-1.0), &["byte 4", "radius -1"]);
    check_message("a.pos", &pos(f32::NAN), &["byte 4", "radius NaN"]);
    let nan = patched(&pos(0.25), &le([4.0]), &le([f32::NAN]));
    check_message("a.pos", &nan, &["byte 24", "particle 1", "position"]);
    check_message("a.pos", &bgeo(), &["a BGEO file"]);
}

/// The nine numbers are the columns of a matrix that takes the unit sphere to the ellipsoid, in
/// units of the radius; the turn that it begins with is of no consequence.
#[test]
fn ellipsoids_lie_beside_pos() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.0001.pos");
    let symmetric = [2.0, 0.5, 0.25, 0.5, 1.0, -0.125, 0.25, -0.125, 0.5];
    let turn = DMat3::from_axis_angle(dvec3(1.0, 2.0, 3.0).normalize(), 0.7);
    let turned = (Mat3::from_cols_array(&symmetric).as_dmat3() * turn).as_mat3();
    let ani = |maps: [[f32; 9]; 3]| {
        [3_u32.to_le_bytes().to_vec(), maps.into_iter().flat_map(le).collect()].concat()
    };
    std::fs::write(&path, pos(0.25)).unwrap();
    assert_eq!(Particles::read(&path).unwrap().ellipsoids, None);
    let maps = ani([symmetric, turned.to_cols_array(), [0.0; 9]]);
    std::fs::write(path.with_extension("ani"), &maps).unwrap();
    let ellipsoids = Particles::read(&path).unwrap().ellipsoids.unwrap();
    let expected = Ellipsoid { xx: 2.0, yy: 1.0, zz: 0.5, xy: 0.5, yz: -0.125, xz: 0.25 };
    assert_eq!(ellipsoids[0], expected);
    let difference = ellipsoids[1].matrix() - expected.matrix();
    assert!(difference.to_cols_array().iter().all(|x| x.abs() < 1e-6), "{difference}");
    assert!(ellipsoids[0].drawable() && ellipsoids[1].drawable() && !ellipsoids[2].drawable());

    let damaged = |bytes: &[u8], fragments: &[&str]| {
        std::fs::write(path.with_extension("ani"), bytes).unwrap();
        let text = Particles::read(&path).unwrap_err().to_string();
        for fragment in ["frame.0001.ani: byte"].iter().chain(fragments) {
            assert!(text.contains(fragment), "{fragment:?} not in: {text}");
        }
    };
    for length in 0..maps.len() {
        damaged(&maps[..length], &[]);
    }
    damaged(&[&maps[..], &[0]].concat(), &["1 bytes are left"]);
    damaged(&[&[2, 0, 0, 0], &maps[4..]].concat(), &["2 ellipsoids", "3 particles"]);
    damaged(
        &ani([[f32::INFINITY; 9], symmetric, symmetric]),
        &["byte 4", "particle 0", "ellipsoid"],
    );
}

/// A block of particles keeps the shapes that its file gives, where they are; one whose shape is
/// none gets a kernel, and a lone particle is a sphere.
#[test]
fn given_ellipsoids_are_drawn() {
    let r = 0.025_f32;
    let cell = |i: usize| Vec3::new((i % 6) as f32, (i / 6 % 6) as f32, (i / 36) as f32);
    let mut positions: Vec<Vec3> = (0..216).map(|i| 2.0 * r * cell(i)).collect();
    positions.push(Vec3::splat(5.0));
    let shape = Ellipsoid { xx: 1.5, yy: 0.75, zz: 1.0, xy: 0.25, yz: -0.125, xz: 0.0625 };
    let mut ellipsoids = vec![shape; positions.len()];
    ellipsoids[3] = Ellipsoid { xx: -1.0, ..shape };
    let bare = Particles::from_positions(positions.clone());
    let shaped = Particles { ellipsoids: Some(ellipsoids), ..bare.clone() };
    let settings = Settings::default().classify;
    let fitted = classify::classify(&bare, r, &settings);
    let given = classify::classify(&shaped, r, &settings);
    assert_eq!(given.splashes, fitted.splashes);
    assert_eq!(given.aggregates.len(), fitted.aggregates.len());
    for (given, fitted) in given.aggregates.iter().zip(&fitted.aggregates) {
        if given.particle == 3 {
            assert_eq!(given, fitted);
            continue;
        }
        assert_ne!(given.diagonal, fitted.diagonal);
        assert_eq!(given.centre, positions[given.particle as usize].to_array());
        let r = f64::from(r);
        assert_eq!(given.diagonal, [1.5, 0.75, 1.0].map(|x: f64| (r * x) as f32));
        assert_eq!(given.off_diagonal, [0.25, 0.0625, -0.125].map(|x: f64| (r * x) as f32));
    }
}

// ---- csv ----

const CSV: &str = "id,x,y,z,vx,vy,vz,density,other,radius
7,0.5,-1.25,2,1,0,-9.5,1000,a,0.025
-1,3.5,4,-5.75,0.25,0.5,0.75,998.5,\"b, c\",0

123456789,0,1e-3,1e6,-0,2,3,1001.25,,0.5
";

#[test]
fn csv_variants() {
    assert_eq!(read("a.csv", CSV.as_bytes()).unwrap(), all_attributes());
    let marked = [b"\xef\xbb\xbf", CSV.replace('\n', "\r\n").as_bytes()].concat();
    assert_eq!(read("a.csv", &marked).unwrap(), all_attributes());
    let quoted = CSV.replace("b, c", "b");
    assert_eq!(read("a.csv", quoted.replace(',', ";").as_bytes()).unwrap(), all_attributes());
    assert_eq!(read("a.CSV", quoted.replace(',', "\t").as_bytes()).unwrap(), all_attributes());
    let renamed = |x: [&str; 3], v: [&str; 3]| {
        let header = format!("id,{},{},density,other,radius", x.join(","), v.join(","));
        CSV.replacen(CSV.lines().next().unwrap(), &header, 1)
    };
    for (x, v) in [
        (["px", "py", "pz"], ["velocity_x", "velocity_y", "velocity_z"]),
        (
            ["\"Points:0\"", "\"Points:1\"", "\"Points:2\""],
            ["velocity:0", "velocity:1", "velocity:2"],
        ),
        (["Points_0", "Points_1", "Points_2"], ["Velocity_0", "Velocity_1", "Velocity_2"]),
        (["Pos.x [m]", "Pos.y [m]", "Pos.z [m]"], ["Vel.x [m/s]", "Vel.y [m/s]", "Vel.z [m/s]"]),
    ] {
        assert_eq!(read("a.csv", renamed(x, v).as_bytes()).unwrap(), all_attributes(), "{x:?}");
    }
    let bare = "0.5,-1.25,2,9\n3.5, 4 ,-5.75,9\n# a comment\n0,1e-3,1e6,9";
    assert_eq!(read("a.csv", bare.as_bytes()).unwrap(), positions_only());
    assert_eq!(read("a.csv", b"").unwrap(), Particles::default());
    assert_eq!(read("a.csv", b"x,y,z\n").unwrap(), Particles::default());
    let large = "x,y,z,id\n0,0,0,9007199254740993\n0,0,0,-3.0\n";
    let ids = read("a.csv", large.as_bytes()).unwrap().ids;
    assert_eq!(ids, Some(vec![9_007_199_254_740_993, -3]));
}

#[test]
fn csv_malformed() {
    let check = |from: &str, to: &str, fragments: &[&str]| {
        assert!(CSV.contains(from), "{from}");
        check_message("a.csv", CSV.replacen(from, to, 1).as_bytes(), fragments);
    };
    check("3.5,4", "3.5,w", &["line 3", "particle 1", "position", "`w`"]);
    check("0,1e-3", "0,nan", &["line 5", "particle 2", "position", "NaN"]);
    check("0.25,0.5", "0.25,inf", &["line 3", "particle 1", "velocity"]);
    check("-1,3.5", "1.5,3.5", &["line 3", "particle 1", "id", "`1.5`"]);
    check("1000,a,0.025", "1000", &["line 2", "particle 0", "radius", "no such column"]);
    check("1000,a,0.025", "1000,a,-1", &["line 2", "particle 0", "radius -1"]);
    check("x,y,z", "a,b,c", &["no columns x, y and z", "id, a, b, c"]);
    check_message("a.csv", b"1,2\n3,4\n", &["line 1", "position", "no such column"]);
    check_message("a.csv", &bgeo(), &["a BGEO file"]);
}

// ---- all formats ----

/// One good file of each kind.
fn samples() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("a.bgeo", bgeo()),
        ("b.bgeo", gzip(&bgeo())),
        ("a.vtk", vtk_4_1()),
        ("b.vtk", vtk_5_1()),
        ("c.vtk", VTK_ASCII.into()),
        ("a.ply", ply_binary("little")),
        ("b.ply", ply_binary("big")),
        ("c.ply", ply_elaborate()),
        ("d.ply", ply_ascii().into()),
        ("a.npy", npy("<f4", "False", "(3, 3)", &npy_data())),
        ("b.npy", npy_fortran()),
        ("a.xyz", npy_data()),
        ("b.xyz", b"0.5 1 2\n3 4 5\n6 7 8".into()),
        ("a.vtu", vtu("UnstructuredGrid", &[3], Stored::Ascii, PLAIN)),
        ("b.vtu", vtu("UnstructuredGrid", &[1, 2], Stored::Inline, PLAIN)),
        ("c.vtu", {
            let headers = Headers { big: true, long: true, ..PLAIN };
            vtu("UnstructuredGrid", &[3], Stored::AppendedBase64, headers)
        }),
        ("d.vtu", {
            let headers = Headers { zlib: Some(16), ..PLAIN };
            vtu("UnstructuredGrid", &[3], Stored::AppendedRaw, headers)
        }),
        ("a.npz", npz(&npz_members()[..4], false)),
        ("b.npz", npz(&npz_members()[3..], true)),
        ("a.pos", pos(0.25)),
        ("a.csv", CSV.into()),
    ]
}

/// Cut off anywhere, a file is an error, or whole in what it says of its particles. (Only .xyz
/// and .csv have no count to hold against.)
#[test]
fn truncation_is_noticed_everywhere() {
    for (name, bytes) in samples() {
        for length in 0..bytes.len() {
            match read(name, &bytes[..length]) {
                Ok(particles) if name.ends_with("xyz") || name.ends_with("csv") => {
                    assert!(particles.len() <= 3);
                }
                Ok(particles) => assert_eq!(particles.len(), 3, "{name} cut to {length}"),
                Err(error) => assert!(error.to_string().contains(name), "{error}"),
            }
        }
    }
}

/// Damage of any one bit yields particles or an error, and the particles are sound.
#[test]
fn bit_flips_never_panic() {
    for (name, mut bytes) in samples() {
        for at in 0..bytes.len() {
            for bit in 0..8 {
                bytes[at] ^= 1 << bit;
                if let Ok(particles) = read(name, &bytes) {
                    assert_sound(&particles);
                }
                bytes[at] ^= 1 << bit;
            }
        }
    }
}

fn assert_sound(particles: &Particles) {
    let n = particles.len();
    let lengths = [
        particles.velocities.as_ref().map(Vec::len),
        particles.densities.as_ref().map(Vec::len),
        particles.radii.as_ref().map(Vec::len),
        particles.ids.as_ref().map(Vec::len),
        particles.ellipsoids.as_ref().map(Vec::len),
    ];
    assert!(lengths.iter().flatten().all(|&length| length == n));
    assert!(particles.positions.iter().all(|p| p.is_finite()));
    assert!(particles.velocities.iter().flatten().all(|v| v.is_finite()));
    assert!(particles.densities.iter().flatten().all(|rho| rho.is_finite()));
    assert!(particles.radii.iter().flatten().all(|r| r.is_finite() && *r >= 0.0));
}

#[test]
fn foreign_files_are_named() {
    let mut stl = vec![0; 84 + 50];
    stl[80] = 1;
    let houdini = b"\x7fNSJb\x00\x00\x00";
    for name in ["a.bgeo", "a.vtk", "a.ply", "a.npy", "a.xyz"] {
        assert!(matches!(read(name, &stl), Err(Error::Format { .. })), "{name}");
        check_message(name, &stl, &["binary STL"]);
        check_message(name, houdini, &["Houdini's new", ".bhclassic"]);
        check_message(name, b"<?xml version=\"1.0\"?>\n", &["XML", ".vtu"]);
    }
    for name in ["a.vtu", "a.vtp", "a.npz", "a.pos", "a.csv"] {
        check_message(name, &stl, &["binary STL"]);
        check_message(name, houdini, &["Houdini's new", ".bhclassic"]);
    }
    check_message("a.vtu", b"<?xml version=\"1.0\"?>\n<html/>", &["XML, but not VTK's"]);
    for name in ["a.bgeo", "a.vtk", "a.ply", "a.npy", "a.vtu", "a.npz"] {
        check_message(name, b"", &["an empty file"]);
        check_message(name, b"nonsense", &["an unknown kind"]);
    }
    check_message("a.ply", &vtk_4_1(), &["a legacy VTK file, not a PLY file"]);
    check_message("a.vtk", &gzip(&vtk_4_1()), &["gzip", "unpack"]);
    check_message("a.bgeo", &gzip(b"ply\n"), &["a PLY file"]);
}

#[test]
fn unknown_extensions_come_with_a_remedy() {
    check_message("a.pvd", b"", &["list of files", "frame_{}.vtu"]);
    check_message("a.ani", b"", &["ellipsoids", ".pos"]);
    check_message("a.bgeo.sc", b"", &["hsc -d", ".bhclassic"]);
    check_message("a.stl", b"", &["does not know", ".bgeo", ".npy"]);
    check_message("ply", b"", &["does not know"]);
    assert!(matches!(read("a.obj", b""), Err(Error::Format { .. })));
}

#[test]
fn files_are_read_as_their_contents() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    std::fs::write(&path, ply_ascii()).unwrap();
    assert_eq!(Particles::read(&path).unwrap(), all_attributes());
}

#[test]
fn a_missing_file_is_an_io_error() {
    let error = Particles::read(Path::new("no-such-file.ply")).unwrap_err();
    assert!(matches!(error, Error::Io { .. }));
    assert!(error.to_string().contains("no-such-file.ply: cannot read"), "{error}");
}

// ---- the struct itself ----

/// Protects handedness: the turn maps up to up and keeps cross products.
#[test]
fn z_up_becomes_y_up() {
    let axes = vec![Vec3::X, Vec3::Y, Vec3::Z];
    let shape = Ellipsoid { xx: 1.0, yy: 2.0, zz: 3.0, xy: 0.1, yz: 0.2, xz: 0.3 };
    let mut particles = Particles {
        velocities: Some(axes.clone()),
        ellipsoids: Some(vec![shape; 3]),
        ..Particles::from_positions(axes)
    };
    particles.origin = dvec3(1.0, 2.0, 3.0);
    let before = particles.clone();
    particles.to_y_up(Up::Y);
    assert_eq!(particles, before);
    particles.to_y_up(Up::Z);
    assert_eq!(particles.positions, [Vec3::X, -Vec3::Z, Vec3::Y]);
    assert_eq!(particles.origin, dvec3(1.0, 3.0, -2.0));
    assert_eq!(particles.velocities.as_deref(), Some(&particles.positions[..]));
    let [x, y, z] = [0, 1, 2].map(|i| particles.positions[i]);
    assert_eq!(x.cross(y), z);
    let turn = DMat3::from_cols(x.as_dvec3(), y.as_dvec3(), z.as_dvec3());
    let turned = particles.ellipsoids.unwrap()[0].matrix();
    assert_eq!(turned, turn * shape.matrix() * turn.transpose());
}

/// Protects digits: what a file of 64-bit numbers says is there to 1e-6 of the cloud's size,
/// however far from the origin; 32-bit files, and clouds near the origin, are as they are.
#[test]
fn far_particles_keep_their_digits() {
    let places = |offset: DVec3| {
        [dvec3(0.001, 0.002, 0.003), dvec3(0.5123456789, -0.25, 0.75), dvec3(-0.1, 0.3, 0.9)]
            .map(|place| place + offset)
    };
    let offset = dvec3(12345.6789, -98765.4321, 1e5);
    let far = places(offset);
    let numbers = || far.iter().flat_map(|place| place.to_array());
    let text: String =
        far.iter().map(|place| format!("{} {} {}\n", place.x, place.y, place.z)).collect();
    let big: Vec<u8> = numbers().flat_map(f64::to_be_bytes).collect();
    let little: Vec<u8> = numbers().flat_map(f64::to_le_bytes).collect();
    let axes = [0, 1, 2].map(|k| far.map(|place| place[k].to_le_bytes()).concat()).concat();
    let property = |axis: &str| format!("property double {axis}\n");
    let ply = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\n{}{}{}end_header\n",
        property("x"),
        property("y"),
        property("z")
    );
    let vtk = b"# vtk DataFile Version 4.1\nfluid\nBINARY\nDATASET POLYDATA\nPOINTS 3 double\n";
    for (name, bytes) in [
        ("a.xyz", text.into_bytes()),
        ("a.npy", npy("<f8", "False", "(3, 3)", &little)),
        ("a.npy", npy("<f8", "True", "(3, 3)", &axes)),
        ("a.ply", [ply.into_bytes(), little].concat()),
        ("a.vtk", [vtk.to_vec(), big].concat()),
    ] {
        let particles = read(name, &bytes).unwrap();
        for (place, position) in far.iter().zip(&particles.positions) {
            let error = (particles.origin + position.as_dvec3()).distance(*place);
            assert!(error < 1e-6, "{name}: {position} from {}", particles.origin);
        }
        let (min, max) = particles.bounds().unwrap();
        assert!(min.distance(offset + dvec3(-0.1, -0.25, 0.003)) < 1e-6, "{name}: {min}");
        assert!(max.distance(offset + dvec3(0.5123456789, 0.3, 0.9)) < 1e-6, "{name}: {max}");
    }
    let near = Particles::from_places(&places(DVec3::splat(2.0)));
    assert_eq!(near.origin, DVec3::ZERO);
    let single: Vec<u8> = far.iter().flat_map(|place| le(place.as_vec3().to_array())).collect();
    let single = read("a.npy", &npy("<f4", "False", "(3, 3)", &single)).unwrap();
    assert_eq!(single.origin, DVec3::ZERO);
    assert_eq!(single.positions, far.map(|place| place.as_vec3()));
}

#[test]
fn bounds_enclose_all_particles() {
    assert_eq!(Particles::default().bounds(), None);
    let bounds = positions_only().bounds();
    assert_eq!(bounds, Some((dvec3(0.0, -1.25, -5.75), dvec3(3.5, 4.0, 1e6))));
}

/// Uniform bits, from a linear congruential generator (Knuth's MMIX).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 32) as u32
    }

    fn below(&mut self, n: u32) -> u32 {
        ((u64::from(self.bits()) * u64::from(n)) >> 32) as u32
    }

    fn uniform(&mut self) -> f32 {
        self.bits() as f32 / u32::MAX as f32 - 0.5
    }

    /// Any float that a place may have, or one of the size that files hold.
    fn float(&mut self) -> f32 {
        match self.below(4) {
            0 => Some(f32::from_bits(self.bits())).filter(|x| x.abs() < 1e18).unwrap_or(-0.0),
            _ => self.uniform(),
        }
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.float(), self.float(), self.float())
    }

    /// Each attribute is there or not.
    fn particles(&mut self) -> Particles {
        let n = self.below(20) as usize;
        let offset = if self.below(4) == 0 { 1000.0 } else { 0.0 };
        let positions = (0..n).map(|_| self.vector() + offset).map(finite).collect();
        let mut particles = Particles::from_positions(positions);
        if self.below(2) == 0 {
            particles.velocities = Some((0..n).map(|_| self.vector()).collect());
        }
        if self.below(2) == 0 {
            particles.densities = Some((0..n).map(|_| self.float()).collect());
        }
        if self.below(2) == 0 {
            particles.radii = Some((0..n).map(|_| self.float().abs()).collect());
        }
        if self.below(2) == 0 {
            let wide = self.below(2) == 0;
            let id = |low: u32, high: u32| i64::from(high.cast_signed()) << 32 | i64::from(low);
            let ids = (0..n).map(|_| (self.bits(), self.bits()));
            let ids = ids.map(|(a, b)| if wide { id(a, b) } else { a.cast_signed().into() });
            particles.ids = Some(ids.collect());
        }
        if self.below(2) == 0 {
            let shape = |entry: [f32; 6]| {
                let [xx, yy, zz, xy, yz, xz] = entry;
                Ellipsoid { xx: 2.0 + xx, yy: 2.0 + yy, zz: 2.0 + zz, xy, yz, xz }
            };
            let entries = (0..n).map(|_| [0; 6].map(|_: i32| self.uniform()));
            particles.ellipsoids = Some(entries.map(shape).collect());
        }
        particles
    }
}

fn finite(position: Vec3) -> Vec3 {
    if position.is_finite() { position } else { Vec3::splat(-0.0) }
}

/// All numbers as they are stored, so that −0 is not 0.
fn bits(particles: &Particles) -> impl PartialEq + std::fmt::Debug {
    let vectors = |vectors: &[Vec3]| -> Vec<u32> {
        vectors.iter().flat_map(|v| v.to_array().map(f32::to_bits)).collect()
    };
    let floats = |floats: &Vec<f32>| floats.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    let Particles { origin, positions, velocities, densities, radii, ids, ellipsoids, .. } =
        particles;
    (
        (*origin, vectors(positions), velocities.as_deref().map(vectors)),
        (densities.as_ref().map(floats), radii.as_ref().map(floats)),
        (ids.clone(), ellipsoids.clone()),
    )
}

/// Protects all writers: what a format holds is read back to the bit; what it does not, it says.
#[test]
fn what_is_written_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(5);
    for case in 0..60 {
        let mut particles = random.particles();
        for extension in
            ["bgeo", "bgeo.gz", "bhclassic", "vtk", "vtu", "ply", "npy", "npz", "xyz", "pos", "csv"]
        {
            let path = folder.path().join(format!("{case}.{extension}"));
            if matches!(extension, "bgeo" | "bgeo.gz" | "bhclassic" | "ply") {
                for id in particles.ids.iter_mut().flatten() {
                    *id = i64::from(*id as i32);
                }
            }
            if extension == "pos" && random.below(2) == 0 {
                particles.radii = particles.radii.map(|radii| vec![0.25; radii.len()]);
            }
            let lost = particles.lost(&path).unwrap();
            particles.write(&path).unwrap();
            let mut expected = particles.clone();
            for name in &lost {
                match *name {
                    "velocity" => expected.velocities = None,
                    "density" => expected.densities = None,
                    "radius" => expected.radii = None,
                    "id" => expected.ids = None,
                    "ellipsoid" => expected.ellipsoids = None,
                    "radii that differ" => {
                        // Their mean stands for them, and the shapes keep their size.
                        let read = Particles::read(&path).unwrap();
                        let radius = read.radii.as_ref().map_or(0.0, |radii| radii[0]);
                        assert!(radius > 0.0, "{case}.{extension}");
                        expected.radii = read.radii;
                        expected.ellipsoids = read.ellipsoids;
                    }
                    other => panic!("{other}"),
                }
            }
            if extension == "pos" && expected.is_empty() {
                expected.radii = None;
            }
            let read = Particles::read(&path).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(bits(&read), bits(&expected), "{case}.{extension}: {lost:?}");
        }
    }
}

/// Protects digits of places far from 0, in the formats that have room for them.
#[test]
fn far_places_are_written_with_their_digits() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(6);
    let offset = dvec3(12345.6789, -98765.4321, 1e5);
    let places: Vec<DVec3> =
        (0..50).map(|_| offset + random.vector().as_dvec3().normalize_or_zero()).collect();
    let particles = Particles::from_places(&places);
    assert_ne!(particles.origin, DVec3::ZERO);
    for extension in ["vtk", "vtu", "ply", "npy", "npz", "csv"] {
        let path = folder.path().join(format!("a.{extension}"));
        assert_eq!(particles.lost(&path).unwrap(), [""; 0]);
        particles.write(&path).unwrap();
        let read = Particles::read(&path).unwrap();
        for (i, place) in places.iter().enumerate() {
            let error = (read.origin + read.positions[i].as_dvec3()).distance(*place);
            assert!(error < 1e-6, "{extension}: particle {i} is {error} m off");
        }
    }
    for extension in ["bgeo", "xyz", "pos"] {
        let path = folder.path().join(format!("a.{extension}"));
        assert_eq!(particles.lost(&path).unwrap(), ["64-bit places"]);
        particles.write(&path).unwrap();
        assert_eq!(Particles::read(&path).unwrap().positions[7], places[7].as_vec3());
    }
}

/// Protects frames that are written anew: shapes of the old one would be taken for theirs.
#[test]
fn ellipsoids_of_a_replaced_frame_go() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pos");
    let shaped = Particles { ellipsoids: Some(vec![Ellipsoid::SPHERE; 3]), ..positions_only() };
    shaped.write(&path).unwrap();
    assert_eq!(Particles::read(&path).unwrap(), shaped);
    positions_only().write(&path).unwrap();
    assert_eq!(Particles::read(&path).unwrap(), positions_only());
    assert!(!path.with_extension("ani").exists());
}

/// The size of a shape is what it was, though its unit, the radius, is another.
#[test]
fn radii_that_differ_leave_shapes_as_large() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pos");
    let radii = vec![1.0, 2.0, 6.0];
    let shape = Ellipsoid { xx: 2.0, ..Ellipsoid::SPHERE };
    let particles = Particles {
        radii: Some(radii.clone()),
        ellipsoids: Some(vec![shape; 3]),
        ..positions_only()
    };
    particles.write(&path).unwrap();
    let read = Particles::read(&path).unwrap();
    assert_eq!(read.radii, Some(vec![3.0; 3]));
    for (ellipsoid, radius) in read.ellipsoids.unwrap().iter().zip(radii) {
        assert!((3.0 * ellipsoid.xx - 2.0 * radius).abs() < 1e-6);
        assert!((3.0 * ellipsoid.yy - radius).abs() < 1e-6);
    }
}

#[test]
fn unwritable_formats_are_named() {
    for name in ["a.vtp", "a.obj", "a"] {
        let error = positions_only().write(Path::new(name)).unwrap_err();
        assert!(matches!(error, Error::Format { .. }), "{error}");
        assert!(error.to_string().contains(".bgeo, "), "{error}");
        assert!(!Path::new(name).exists());
    }
}

/// Protects baked frames: what is written is what is read, to the bit, plain and as gzip.
#[test]
fn bgeo_is_written_as_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let places = [Vec3::new(0.1, -2.0, 3e-7), Vec3::ZERO, Vec3::splat(7.5)];
    let bare = Particles::from_positions(places.to_vec());
    let full = Particles {
        velocities: Some(vec![Vec3::X, Vec3::NEG_Y, Vec3::new(0.3, 0.2, 0.1)]),
        densities: Some(vec![1000.0, 998.5, 1.0]),
        radii: Some(vec![0.1, 0.0, 0.25]),
        ids: Some(vec![7, -3, i32::MAX.into()]),
        ..bare.clone()
    };
    for particles in [Particles::default(), bare, full.clone()] {
        for name in ["a.bgeo", "a.bgeo.gz", "a.bhclassic"] {
            let path = folder.path().join(name);
            particles.write(&path).unwrap();
            assert_eq!(Particles::read(&path).unwrap(), particles, "{name}");
        }
    }
    let large = Particles { ids: Some(vec![1 << 40, 0, 0]), ..full };
    let path = folder.path().join("large.bgeo");
    assert!(large.write(&path).unwrap_err().to_string().contains("32-bit ids"));
    assert!(!path.exists());
}
