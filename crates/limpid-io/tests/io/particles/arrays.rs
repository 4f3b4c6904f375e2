//! The list of a file's arrays, used or not, and the mapping of arrays to attributes.

use std::path::Path;

use glam::Vec3;
use limpid::liquid::Particles;
use limpid_io::particles::{Array, Attribute, AttributeMap, Contents, ReadOptions};

use super::bgeo::bgeo;
use super::csv::CSV;
use super::npy::{npy, npy_data};
use super::npz::{npz, npz_members};
use super::ply::{ply_ascii, ply_elaborate};
use super::pos::pos;
use super::vtk::vtk_4_1;
use super::vtu::{PLAIN, Stored, vtu};
use super::{DENSITIES, POSITIONS, RADII, VELOCITIES, all_attributes, le, positions_only};

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
        for map in ["radius=no", "velocity=density,radius=no"] {
            let error = contents(name, bytes, map).unwrap_err().to_string();
            let parts = [name, "=no: no array `no` of one number a particle", "(3, 3)"];
            let wrong = ["velocity=density: no array `density` of 3 numbers"];
            let contains = |parts: &[&str]| parts.iter().all(|part| error.contains(part));
            assert!(contains(&parts) || contains(&wrong), "{error}");
        }
    }
    let error = contents("a.xyz", b"1 2 3", "radius=h").unwrap_err().to_string();
    assert!(error.contains("there are: none"), "{error}");
}

/// The text of a map is read back as the same map; a comma separates arrays of an attribute, and attributes.
#[test]
fn maps_are_read_back() {
    let cases = [
        ("velocity=U,radius=h", "radius=h,velocity=U"),
        ("position=x,y,z,radius=d/2", "position=x,y,z,radius=d*0.5"),
        ("radius=d * 0.25, velocity = a b:0 , c , e", "radius=d*0.25,velocity=a b:0,c,e"),
        ("diameter=Particle Diameter", "radius=Particle Diameter*0.5"),
        ("diameter=d/10,id=none", "id=none,radius=d*0.05"),
        ("density=1000*rel", "density=rel*1000"),
        ("velocity=u,v", "velocity=u,v"),
    ];
    for (text, written) in cases {
        let map: AttributeMap = text.parse().expect(text);
        assert_eq!(map.to_string(), written);
        assert_eq!(written.parse::<AttributeMap>().unwrap(), map, "{text}");
        let table = toml::to_string(&map).unwrap();
        assert_eq!(toml::from_str::<AttributeMap>(&table).unwrap(), map, "{table}");
    }
    let wrong = [
        ("radius", "expected ATTRIBUTE=ARRAY"),
        ("radius=", "expected ATTRIBUTE=ARRAY"),
        ("position=x,,z", "expected ATTRIBUTE=ARRAY"),
        ("size=h", "no attribute `size`; there are: position, velocity"),
        ("radius=a,radius=b", "radius is given twice"),
        ("radius=a,diameter=b", "radius is given twice"),
        ("radius=a,b", "radius takes one array, not 2"),
        ("position=x,y", "position takes one array, or 3, not 2"),
        ("radius=d/0", "expected a factor above 0"),
        ("radius=d*-1", "expected a factor above 0"),
        ("id=n*2", "id takes no factor"),
    ];
    for (map, problem) in wrong {
        let error = map.parse::<AttributeMap>().unwrap_err().to_string();
        assert!(error.contains(map) && error.contains(problem), "{error}");
    }
}

/// Diameters and other multiples are scaled, whatever the format; `none` leaves an attribute out.
#[test]
fn mapped_arrays_have_factors() {
    let radii = |name: &str, bytes: &[u8], map: &str| {
        contents(name, bytes, map).unwrap().particles.radii.map(|radii| radii[2])
    };
    let vtk = vtk_4_1();
    let archive = npz(&npz_members(), false);
    let files =
        [("a.csv", CSV.as_bytes()), ("a.bgeo", &bgeo()), ("a.npz", &archive), ("a.vtk", &vtk)];
    for (name, bytes) in files {
        let given = if name == "a.bgeo" { "pscale" } else { "radius" };
        for (map, radius) in
            [("radius=R/2", 0.25), ("radius=R*3", 1.5), ("diameter=R", 0.25), ("radius=R", 0.5)]
        {
            let map = map.replace('R', given);
            assert_eq!(radii(name, bytes, &map), Some(radius), "{name} {map}");
        }
        let left_out = contents(name, bytes, "radius=none,id=none").unwrap();
        assert_eq!((left_out.particles.radii, left_out.particles.ids), (None, None), "{name}");
        assert!(left_out.particles.velocities.is_some(), "{name}");
    }
}

/// Positions and velocities are read from one array for each number, found by themselves where they have the
/// usual names, and from any arrays that a map names, in every kind of format.
#[test]
fn vectors_are_read_from_columns() {
    let column = |of: [[f32; 3]; 3], axis: usize| of.map(|row| row[axis]);
    let array =
        |name: &'static str, numbers: [f32; 3]| (name, npy("<f4", "False", "(3,)", &le(numbers)));
    let named = |names: [&'static str; 6]| {
        let member = |(k, name)| {
            let of = if k < 3 { POSITIONS } else { VELOCITIES };
            array(name, column(of, k % 3))
        };
        npz(&names.into_iter().enumerate().map(member).collect::<Vec<_>>(), false)
    };
    let expected =
        Particles { velocities: Some(VELOCITIES.map(Vec3::from).to_vec()), ..positions_only() };
    let usual = named(["x.npy", "y.npy", "z.npy", "u.npy", "v.npy", "w.npy"]);
    assert_eq!(contents("a.npz", &usual, "").unwrap().particles, expected);
    let listed = contents("a.npz", &usual, "").unwrap().arrays;
    assert_eq!(listed[0].to_string(), "u v w (3, 3)");
    let other = named(["a.npy", "b.npy", "c.npy", "d.npy", "e.npy", "f.npy"]);
    let map = "position=a,b,c,velocity=d,E,f";
    assert_eq!(contents("a.npz", &other, map).unwrap().particles, expected);
    let error = contents("a.npz", &other, "position=a,b,x").unwrap_err().to_string();
    assert!(
        error.contains("position=a,b,x: no such array of positions; there are: a, b"),
        "{error}"
    );

    let text =
        CSV.replacen("x,y,z,vx,vy,vz", "Position[i] (m),Position[j] (m),Position[k] (m),u,v,w", 1);
    assert_eq!(contents("a.csv", text.as_bytes(), "").unwrap().particles, all_attributes());
    let text = CSV.replacen("x,y,z,vx,vy,vz", "east,north,height,vx,vy,vz", 1);
    let map = "position=east,north,height,velocity=vx,vy,vz";
    assert_eq!(contents("a.csv", text.as_bytes(), map).unwrap().particles, all_attributes());
    let mapped = contents("a.csv", text.as_bytes(), map).unwrap().arrays;
    assert_eq!(mapped[0].used_as, Some(Attribute::Position));

    let ply = ply_ascii().replace("property float x", "property float px2");
    assert!(contents("a.ply", ply.as_bytes(), "").is_err());
    let read = contents("a.ply", ply.as_bytes(), "position=px2,y,z").unwrap();
    assert_eq!(read.particles, all_attributes());

    // In formats with a place for positions, other arrays may take theirs.
    let swapped = contents("a.bgeo", &bgeo(), "position=velocity,velocity=none").unwrap();
    assert_eq!(swapped.particles.positions, VELOCITIES.map(Vec3::from));
    let columns = contents("a.vtk", &vtk_4_1(), "position=density,radius,density").unwrap();
    let expected: Vec<Vec3> =
        (0..3).map(|i| Vec3::new(DENSITIES[i], RADII[i], DENSITIES[i])).collect();
    assert_eq!(columns.particles.positions, expected);
    let missing = contents("a.bgeo", &bgeo(), "velocity=density,pscale,w").unwrap_err().to_string();
    assert!(missing.contains("velocity=density,pscale,w: no arrays"), "{missing}");
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
