//! Which particles of a file are read: by conditions on its arrays, and, in layouts whose meaning is known, without
//! walls and bodies.

use std::path::Path;

use hdf5_pure::FileBuilder;
use limpid_io::particles::{Contents, ReadOptions, Remark, Selection};

use super::le;
use super::npy::npy;
use super::npz::npz;

fn parse(name: &str, bytes: &[u8], select: &str) -> limpid_io::Result<Contents> {
    let select = if select.is_empty() { Selection::Automatic } else { select.parse()? };
    Contents::parse(Path::new(name), bytes, &ReadOptions { select, ..ReadOptions::default() })
}

/// The x coordinates of the particles that are read: their numbers in the file.
fn read(name: &str, bytes: &[u8], select: &str) -> Vec<i32> {
    let contents = parse(name, bytes, select).expect(name);
    contents.particles.positions.iter().map(|position| position.x as i32).collect()
}

fn remarks(name: &str, bytes: &[u8], select: &str) -> Vec<Remark> {
    parse(name, bytes, select).expect(name).remarks
}

/// Six particles in a row with two numbers each, in several formats.
fn files(numbers: [(&str, [i32; 6]); 2]) -> Vec<(&'static str, Vec<u8>)> {
    let [(a, first), (b, second)] = numbers;
    let rows = || first.iter().zip(&second).enumerate();
    let lines = |row: fn(usize, &i32, &i32) -> String| {
        rows().map(|(i, (x, y))| row(i, x, y)).collect::<Vec<_>>().join("\n")
    };
    let csv = format!("x,y,z,{a},{b}\n{}\n", lines(|i, x, y| format!("{i},0,0,{x},{y}")));
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n\
         property int {a}\nproperty int {b}\nend_header\n{}\n",
        lines(|i, x, y| format!("{i} 0 0 {x} {y}"))
    );
    let dump = format!(
        "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n6\nITEM: BOX BOUNDS pp pp pp\n0 9\n0 9\n0 9\n\
         ITEM: ATOMS x y z {a} {b}\n{}\n",
        lines(|i, x, y| format!("{i} 0 0 {x} {y}"))
    );
    let list = |numbers: [i32; 6]| numbers.map(|x| x.to_string()).join(" ");
    let points: Vec<String> = (0..6).map(|i| format!("{i} 0 0")).collect();
    let points = points.join(" ");
    let vtk = format!(
        "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 6 float\n{points}\nPOINT_DATA 6\n\
         SCALARS {a} int 1\nLOOKUP_TABLE default\n{}\nFIELD f 1\n{b} 1 6 double\n{}\n",
        list(first),
        list(second)
    );
    let array = |kind: &str, name: &str, numbers: [i32; 6]| {
        format!("<DataArray type='{kind}' Name='{name}'>{}</DataArray>", list(numbers))
    };
    let vtu = format!(
        "<VTKFile type='UnstructuredGrid'><UnstructuredGrid><Piece NumberOfPoints='6' NumberOfCells='0'>\
         <PointData>{}{}</PointData><Points><DataArray type='Float32' NumberOfComponents='3'>{points}\
         </DataArray></Points></Piece></UnstructuredGrid></VTKFile>",
        array("UInt8", a, first),
        array("Float64", b, second)
    );
    let places: Vec<f32> = (0..6_u8).flat_map(|i| [i.into(), 0.0, 0.0]).collect();
    let bytes: Vec<u8> = places.iter().flat_map(|x| x.to_le_bytes()).collect();
    let column =
        |numbers: [i32; 6]| npy("<i4", "False", "(6,)", &numbers.map(i32::to_le_bytes).concat());
    let npz = npz(
        &[
            (&format!("{a}.npy"), column(first)),
            ("positions.npy", npy("<f4", "False", "(6, 3)", &bytes)),
            (&format!("{b}.npy"), npy("<f4", "False", "(6, 1)", &le(second.map(|x| x as f32)))),
        ],
        true,
    );
    let mut h5 = FileBuilder::new();
    h5.create_dataset("pos").with_f32_data(&places).with_shape(&[6, 3]);
    h5.create_dataset(a).with_i32_data(&first);
    h5.create_dataset(b).with_i32_data(&second);
    vec![
        ("a.csv", csv.into()),
        ("a.ply", ply.into()),
        ("a.lammpstrj", dump.into()),
        ("a.vtk", vtk.into()),
        ("a.vtu", vtu.into()),
        ("a.npz", npz),
        ("a.h5", h5.finish().unwrap()),
    ]
}

/// Conditions select by any array of one number a particle, in every kind of format.
#[test]
fn conditions_select() {
    for (name, bytes) in files([("material", [1, 2, 3, 1, 2, 3]), ("Level", [0, 0, 0, 5, 5, 9])]) {
        let all = [0, 1, 2, 3, 4, 5].as_slice();
        let cases: [(&str, &[i32]); 15] = [
            ("", all),
            ("all", all),
            ("material==1", &[0, 3]),
            ("Material = 1", &[0, 3]),
            ("'material != 1'", &[1, 2, 4, 5]),
            ("material in 1,3", &[0, 2, 3, 5]),
            ("material in 2..3", &[1, 2, 4, 5]),
            ("material not in 2..3", &[0, 3]),
            ("material in {1, 3} and level>=5", &[3, 5]),
            ("material in 1,3,level<5", &[0, 2]),
            ("level<=4.5 AND material>2", &[2]),
            ("level in 1..=9", &[3, 4, 5]),
            ("material==1,material==2", &[]),
            ("level==-1", &[]),
            ("x>=3 and material!=1", &[4, 5]),
        ];
        for (select, kept) in cases {
            assert_eq!(read(name, &bytes, select), kept, "{name}: {select}");
        }
        let none = [Remark::NoneSelected { selection: "Level==7".into() }];
        assert_eq!(remarks(name, &bytes, "Level==7"), none);
        let error = parse(name, &bytes, "phase==1").unwrap_err().to_string();
        for part in [name, "select phase==1: no array `phase` of one number", "material (6"] {
            assert!(error.contains(part), "{part} not in: {error}");
        }
    }
}

/// DualSPHysics' walls and bodies are left out where its arrays show that `Type` is its own; elsewhere the numbers
/// of a type may mean anything.
#[test]
fn walls_of_known_layouts_are_left_out() {
    let types = [0, 1, 2, 3, 3, 0];
    for beside in ["Idp", "Mk", "Rhop"] {
        for (name, bytes) in files([("Type", types), (beside, [1, 2, 3, 4, 5, 6])]) {
            assert_eq!(read(name, &bytes, ""), [3, 4], "{name}");
            let left = Remark::LeftOut { count: 4, why: "Type 0 and 1 and 2".into() };
            assert_eq!(remarks(name, &bytes, ""), [left], "{name}");
            assert_eq!(read(name, &bytes, "all").len(), 6);
            assert_eq!(read(name, &bytes, "type<2"), [0, 1, 5]);
        }
        for (name, bytes) in files([("Type", [0, 1, 0, 0, 1, 0]), (beside, [1; 6])]) {
            assert_eq!(read(name, &bytes, "").len(), 6, "a file of walls alone: {name}");
        }
    }
    for (name, bytes) in files([("type", types), ("mass", [1; 6])]) {
        assert_eq!((read(name, &bytes, "").len(), remarks(name, &bytes, "").len()), (6, 0));
    }
    for (name, bytes) in files([("particle_type", [3, 5, 5, 3, 3, 0]), ("mass", [1; 6])]) {
        assert_eq!(read(name, &bytes, ""), [1, 2], "{name}");
    }
}

/// Ids, velocities and the like stay with their particles, and particles without a place are left out too.
#[test]
fn selected_particles_keep_their_attributes() {
    let text = "x,y,z,id,vx,vy,vz,Type,Mk\n0,0,0,7,1,0,0,3,1\n1,0,0,8,2,0,0,0,2\n2,nan,0,9,3,0,0,3,3\n\
                3,0,0,10,4,0,0,3,4\n";
    let found = parse("a.csv", text.as_bytes(), "").unwrap();
    let velocities: Vec<f32> = found.particles.velocities.iter().flatten().map(|v| v.x).collect();
    assert_eq!((found.particles.ids, velocities), (Some(vec![7, 10]), vec![1.0, 4.0]));
    assert_eq!(found.remarks.len(), 2);
    // Attributes decide too, and single numbers of them.
    assert_eq!(read("a.csv", text.as_bytes(), "id>7 and vx!=2"), [3]);
}

/// The values of integer arrays are found for users who want to choose among them.
#[test]
fn values_of_integers_are_found() {
    for (name, bytes) in files([("phase", [4, 4, 4, -2, -2, 9]), ("serial", [1, 2, 3, 4, 5, 6])]) {
        let options = ReadOptions { values: true, ..ReadOptions::default() };
        let arrays = Contents::parse(Path::new(name), &bytes, &options).expect(name).arrays;
        let phase = arrays.iter().find(|array| array.name == "phase").expect("listed");
        assert_eq!(phase.values, [-2, 4, 9], "{name}");
        assert_eq!(parse(name, &bytes, "").unwrap().arrays[0].values, [0_i64; 0]);
    }
}

#[test]
fn selections_are_read_back() {
    let texts = [
        ("all", "all"),
        ("type==1", "type==1"),
        ("type = 1, mk!=2", "type==1 and mk!=2"),
        ("mk in 1..3", "mk in 1..3"),
        ("\"mk not in [1, 3]\"", "mk not in 1,3"),
        ("particle type in 1,4..5.5 and rhop>=990", "particle type in 1,4..5.5 and rhop>=990"),
        ("x<-1e-3", "x<-0.001"),
    ];
    for (text, written) in texts {
        let selection: Selection = text.parse().expect(text);
        assert_eq!(selection.to_string(), written);
        assert_eq!(written.parse::<Selection>().unwrap(), selection, "{text}");
    }
    for text in
        ["", "type", "==1", "type==", "type==one", "type in", "mk in 3..1", "a==1 or b==2", "1,2"]
    {
        let error = text.parse::<Selection>().unwrap_err().to_string();
        assert!(error.starts_with(&format!("select `{text}`: ")), "{error}");
    }
}
