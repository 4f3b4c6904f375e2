//! Legacy VTK files, ASCII and binary, of versions 2.0 to 5.1.

use limpid::liquid::Particles;

use super::{
    DENSITIES, IDS, POSITIONS, RADII, VELOCITIES, all_attributes, be, check_left_out,
    check_message, patched, positions_only, read,
};

/// A file as simulators write it, such as `SPlisHSPlasH`.
pub(crate) fn vtk_4_1() -> Vec<u8> {
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

/// A file as `ParaView` writes it: doubles, metadata, 64-bit offsets, time and cell data.
pub(crate) fn vtk_5_1() -> Vec<u8> {
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

pub(crate) const VTK_ASCII: &str = "# vtk DataFile Version 3.0
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

/// Every integer type is read with its own width.
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
    check_left_out("a.vtk", &nan, 1);

    // Contradictory counts.
    let other = patched(&good, b"POINT_DATA 3", b"POINT_DATA 2");
    check_message("a.vtk", &other, &["byte", "2 points", "3"]);
    let field = patched(&good, b"density 1 3", b"density 1 2");
    check_message("a.vtk", &field, &["byte", "density", "2 entries, expected 3"]);
    let size = patched(&good, b"SCALARS id int 1", b"SCALARS id int 2");
    check_message("a.vtk", &size, &["byte"]);
    let size = patched(&good, b"density 1 3", b"density 9223372036854775807 3");
    check_message("a.vtk", &size, &["byte", "density"]);
    let second = [&good[..], b"POINTS 1 float\n", &[0; 12]].concat();
    check_message("a.vtk", &second, &["byte", "second POINTS"]);

    // Errors in ASCII files name the line.
    let text = |from: &str, to: &str| {
        assert!(VTK_ASCII.contains(from));
        VTK_ASCII.replacen(from, to, 1).into_bytes()
    };
    check_left_out("a.vtk", &text("-5.75", "nan"), 1);
    check_message("a.vtk", &text("-5.75", "x"), &["line 8", "expected a number", "`x`"]);
    check_message("a.vtk", &text("POINTS 3", "POINTS 2147483647"), &["line 11", "`CELLS`"]);
    check_message("a.vtk", &text("POINTS 3", "POINTS -3"), &["line 6", "-3"]);
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

/// Data of cells are those of points where each point has a vertex cell of its own, in whatever order; data of other
/// cells are listed as ignored. Data of points go before them.
#[test]
fn data_of_vertex_cells() {
    let file = |cells: &str, types: &str, point_data: &str| {
        format!(
            "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 3 float\n0 0 0 1 0 0 2 0 0\n\
             {cells}\nCELL_TYPES 3\n{types}\nCELL_DATA 3\nSCALARS density float 1\nLOOKUP_TABLE default\n7 8 9\n\
             {point_data}"
        )
    };
    let read = |text: &str| {
        let options = limpid_io::particles::ReadOptions::default();
        let path = std::path::Path::new("a.vtk");
        limpid_io::particles::Contents::parse(path, text.as_bytes(), &options).expect("valid")
    };
    let own = read(&file("CELLS 3 6\n1 2 1 0 1 1", "1 1 1", ""));
    assert_eq!(own.particles.densities, Some(vec![8.0, 9.0, 7.0]));
    let with_points = "POINT_DATA 3\nSCALARS rho float 1\nLOOKUP_TABLE default\n1 2 3\n";
    let both = read(&file("CELLS 3 6\n1 2 1 0 1 1", "1 1 1", with_points));
    assert_eq!(both.particles.densities, Some(vec![1.0, 2.0, 3.0]));
    for (cells, types) in
        [("CELLS 3 6\n1 2 1 0 1 0", "1 1 1"), ("CELLS 3 9\n2 0 1 2 1 2 2 0 2", "3 3 3")]
    {
        let other = read(&file(cells, types, ""));
        assert_eq!(other.particles.densities, None);
        assert_eq!(other.arrays[0].to_string(), "density (3)");
    }
}

/// METADATA as VTK's writer makes it ends at the blank line after all names of components, some of which are blank.
#[test]
fn metadata_with_blank_names() {
    let metadata = |names: &str, information: &str| {
        format!(
            "# vtk DataFile Version 5.1\nt\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n1 2 3\n\
             METADATA\n{names}{information}\n\nPOINT_DATA 1\nFIELD FieldData 2\nvelocity 3 1 float\n4 5 6\n\
             METADATA\n{names}{information}\ndensity 1 1 float\n7\n\
             METADATA\nCOMPONENT_NAMES\n\n{information}\n\nVECTORS other float\n0 0 0\n"
        )
    };
    let norm = "INFORMATION 1\nNAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0 1\n";
    for names in ["COMPONENT_NAMES\nX\n\n\n", "COMPONENT_NAMES\n\n\nZ\n", ""] {
        for information in ["", norm] {
            let text = metadata(names, information);
            let particles = read("a.vtk", text.as_bytes()).expect("valid");
            assert_eq!(particles.velocities, Some(vec![glam::Vec3::new(4.0, 5.0, 6.0)]), "{text}");
            assert_eq!(particles.densities, Some(vec![7.0]));
        }
    }
}
