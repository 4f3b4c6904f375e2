//! The list of a file's arrays, used or not, and the mapping of arrays to attributes.

use std::path::Path;

use limpid_io::particles::{Array, Attribute, Contents, ReadOptions};

use super::bgeo::bgeo;
use super::csv::CSV;
use super::npy::{npy, npy_data};
use super::npz::{npz, npz_members};
use super::ply::{ply_ascii, ply_elaborate};
use super::pos::pos;
use super::vtk::vtk_4_1;
use super::vtu::{PLAIN, Stored, vtu};
use super::{DENSITIES, RADII, VELOCITIES, all_attributes, le};

fn contents(name: &str, bytes: &[u8], map: &str) -> limpid_io::Result<Contents> {
    let map = if map.is_empty() { Default::default() } else { map.parse()? };
    Contents::parse(Path::new(name), bytes, &ReadOptions { map, ..ReadOptions::default() })
}

/// The arrays of a file as `name (shape)`, with `: attribute` if used.
fn listed(name: &str, bytes: &[u8]) -> Vec<String> {
    let line = |array: &Array| match array.used_as {
        Some(attribute) => format!("{array}: {attribute}"),
        None => array.to_string(),
    };
    contents(name, bytes, "").unwrap().arrays.iter().map(line).collect()
}

#[test]
fn every_array_is_listed() {
    assert_eq!(
        listed("a.bgeo", &bgeo()),
        [
            "id (3): id",
            "group (3, 1)",
            "velocity (3, 3): velocity",
            "uv (3, 2)",
            "density (3): density",
            "pscale (3): radius"
        ]
    );
    assert_eq!(
        listed("a.csv", CSV.as_bytes()),
        [
            "vx vy vz (3, 3): velocity",
            "id (3): id",
            "density (3): density",
            "radius (3): radius",
            "other (3)"
        ]
    );
    assert_eq!(
        listed("a.npz", &npz(&npz_members(), true)),
        [
            "vel (3, 3): velocity",
            "time ()",
            "names (2)",
            "rho (3): density",
            "radius (3, 1): radius",
            "ids (3): id"
        ]
    );
    assert_eq!(
        listed("a.ply", ply_ascii().as_bytes()),
        [
            "vx vy vz (3, 3): velocity",
            "red (3)",
            "density (3): density",
            "radius (3): radius",
            "id (3): id",
            "near (3)"
        ]
    );
    assert_eq!(listed("a.pos", &pos(0.25)), ["radius (): radius"]);
    assert!(listed("a.npy", &npy("<f4", "False", "(3, 3)", &npy_data())).is_empty());
    // The pieces of an array are listed as one.
    let grid = vtu("UnstructuredGrid", &[1, 2], Stored::Ascii, PLAIN);
    assert!(listed("a.vtu", &grid).contains(&"pressure (3)".to_owned()));
    assert!(listed("a.vtk", &vtk_4_1()).contains(&"velocity (3, 3): velocity".to_owned()));
}

/// Attributes can be mapped to arrays of any name; the error of a missing array lists the existing ones.
#[test]
fn arrays_are_mapped() {
    let renamed = CSV.replace("vx,vy,vz", "U:0,U:1,U:2").replace("radius", "h");
    let plain = contents("a.csv", renamed.as_bytes(), "").unwrap().particles;
    assert!(plain.velocities.is_none() && plain.radii.is_none());
    let mapped = contents("a.csv", renamed.as_bytes(), "velocity=U,radius=h").unwrap();
    assert_eq!(mapped.particles, all_attributes());

    let ascii = ply_ascii().replace(" vx", " Ux").replace(" vy", " Uy").replace(" vz", " Uz");
    let mapped = contents("a.ply", ascii.as_bytes(), "vel=U").unwrap();
    assert_eq!(mapped.particles, all_attributes());

    let mut members = npz_members();
    (members[0].0, members[6].0) = ("U.npy", "h.npy");
    let archive = npz(&members, false);
    let mapped = contents("a.npz", &archive, "radius=h,velocity=u").unwrap();
    assert_eq!(mapped.particles, all_attributes());
    // A mapping overrides the usual names.
    let density = contents("a.npz", &archive, "density=h").unwrap().particles.densities;
    assert_eq!(density, Some(RADII.to_vec()));

    let bgeo = bgeo();
    let mapped = contents("a.bgeo", &bgeo, "radius=density").unwrap().particles;
    assert_eq!((mapped.radii, mapped.densities), (Some(DENSITIES.to_vec()), None));
    let xml = vtu("UnstructuredGrid", &[3], Stored::Ascii, PLAIN);
    let xml = String::from_utf8(xml).unwrap().replace("'velocity'", "'U'");
    let mapped = contents("a.vtu", xml.as_bytes(), "velocity=U").unwrap().particles;
    assert_eq!(mapped.velocities.unwrap().len(), VELOCITIES.len());

    for (name, bytes) in [("a.bgeo", bgeo.as_slice()), ("a.npz", &archive)] {
        for map in ["radius=none", "velocity=density,radius=none"] {
            let error = contents(name, bytes, map).unwrap_err().to_string();
            let parts = [name, "=none: no array `none` of one number a particle", "(3, 3)"];
            let wrong = ["velocity=density: no array `density` of 3 numbers"];
            let contains = |parts: &[&str]| parts.iter().all(|part| error.contains(part));
            assert!(contains(&parts) || contains(&wrong), "{error}");
        }
    }
    let error = contents("a.xyz", b"1 2 3", "radius=h").unwrap_err().to_string();
    assert!(error.contains("there are: none"), "{error}");
    for map in ["radius", "radius=", "size=h", "radius=a,radius=b"] {
        let error = map.parse::<limpid_io::particles::AttributeMap>().unwrap_err().to_string();
        assert!(error.contains(map), "{error}");
    }
}

/// A scalar radius applies to all particles.
#[test]
fn a_scalar_radius_applies_to_all() {
    let positions = ("x.npy", npy("<f4", "False", "(3, 3)", &npy_data()));
    for shape in ["()", "(1,)"] {
        let radius = ("radius.npy", npy("<f8", "False", shape, &0.25_f64.to_le_bytes()));
        let bytes = npz(&[positions.clone(), radius], false);
        let found = contents("a.npz", &bytes, "").unwrap();
        assert_eq!(found.particles.radii, Some(vec![0.25; 3]), "{shape}");
        assert_eq!(found.arrays[0].used_as, Some(Attribute::Radius));
    }
    let two = ("radius.npy", npy("<f4", "False", "(2,)", &le([0.1, 0.2])));
    let error = contents("a.npz", &npz(&[positions, two], false), "").unwrap_err().to_string();
    assert!(error.contains("radius has 2 entries for 3 particles"), "{error}");
}

/// A CSV header may follow a `#`, as written by `NumPy` and spreadsheets; other comments are ignored.
#[test]
fn a_header_may_be_a_comment() {
    for header in ["#", "# ", "# a remark, and another\n# "] {
        let text = format!("{header}{CSV}");
        assert_eq!(contents("a.csv", text.as_bytes(), "").unwrap().particles, all_attributes());
    }
    let remark = "# made by hand, x, y, z\n0,1,2\n3,4,5\n";
    let found = contents("a.csv", remark.as_bytes(), "").unwrap();
    assert_eq!((found.particles.len(), found.arrays.len()), (2, 0));
    let unnamed = contents("a.csv", b"0;1;2;9\n", "").unwrap().arrays;
    assert_eq!(unnamed[0].to_string(), "column 4 (1)");
}

/// Cells of meshes are counted, vertices are not.
#[test]
fn mesh_cells_are_counted() {
    let cells = |name: &str, bytes: &[u8]| contents(name, bytes, "").unwrap().cells;
    assert_eq!(cells("a.ply", ply_ascii().as_bytes()), 1);
    assert_eq!(cells("a.ply", &ply_elaborate()), 1);
    assert_eq!(cells("a.vtk", &vtk_4_1()), 0);
    let mesh = "# vtk DataFile Version 3.0\nmesh\nASCII\nDATASET UNSTRUCTURED_GRID\n\
        POINTS 3 float\n0 0 0 1 0 0 0 1 0\nCELLS 2 6\n3 0 1 2\n1 0\nCELL_TYPES 2\n5\n1\n";
    assert_eq!(cells("a.vtk", mesh.as_bytes()), 1);
    let mesh = "# vtk DataFile Version 3.0\nmesh\nASCII\nDATASET POLYDATA\n\
        POINTS 3 float\n0 0 0 1 0 0 0 1 0\nPOLYGONS 1 4\n3 0 1 2\n";
    assert_eq!(cells("a.vtk", mesh.as_bytes()), 1);
    let points = "<Points><DataArray type='Float32' NumberOfComponents='3'>\
        0 0 0 1 0 0 0 1 0</DataArray></Points>";
    let cell = "<Cells><DataArray type='Int32' Name='connectivity'>0 1 2 0</DataArray>\
        <DataArray type='Int32' Name='offsets'>3 4</DataArray>\
        <DataArray type='UInt8' Name='types'>5 1</DataArray></Cells>";
    let grid = format!(
        "<VTKFile type='UnstructuredGrid'><UnstructuredGrid>\
         <Piece NumberOfPoints='3' NumberOfCells='2'>{points}{cell}</Piece>\
         </UnstructuredGrid></VTKFile>"
    );
    assert_eq!(cells("a.vtu", grid.as_bytes()), 1);
    let poly = format!(
        "<VTKFile type='PolyData'><PolyData><Piece NumberOfPoints='3' NumberOfVerts='0' \
         NumberOfPolys='4' NumberOfStrips='2'>{points}</Piece></PolyData></VTKFile>"
    );
    assert_eq!(cells("a.vtp", poly.as_bytes()), 6);
}
