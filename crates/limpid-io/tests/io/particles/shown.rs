//! Attributes that are read to be shown in colours: of every format, whatever their names, beside their particles.

use std::path::Path;

use glam::Vec3;
use hdf5_pure::FileBuilder;
use limpid::liquid::Particles;
use limpid::mesh::linear_from_srgb;
use limpid_io::Result;
use limpid_io::particles::{Contents, ReadOptions};

use super::bgeo::bgeo_header;
use super::damaged::zlib;
use super::npy::npy;
use super::npz::npz;
use super::{be, le};

/// Six particles in a row at x = 0 to 5, of which the one at 2 has no position.
const COUNT: usize = 6;

fn x(i: usize) -> f32 {
    if i == 2 { f32::NAN } else { i as f32 }
}

/// Their temperature, flux, and colour in bytes.
fn temperature(i: f32) -> f32 {
    20.0 + 1.5 * i
}

fn flux(i: f32) -> [f32; 3] {
    [3.0 * i, -4.0 * i, 12.0 * i]
}

fn color(i: f32) -> [u8; 3] {
    [40 * i as u8, 255 - 10 * i as u8, 7]
}

fn parse(name: &str, bytes: &[u8], shown: &str, select: &str) -> Result<Contents> {
    let select = if select.is_empty() { Default::default() } else { select.parse()? };
    let shown = Some(shown.to_owned());
    Contents::parse(Path::new(name), bytes, &ReadOptions { shown, select, ..Default::default() })
}

/// The lines of text, or the rows of a table, of all particles.
fn rows<T>(row: impl Fn(usize) -> T) -> Vec<T> {
    (0..COUNT).map(row).collect()
}

fn words(separator: &str) -> String {
    let row = |i: usize| {
        let ([a, b, c], [r, g, bl]) = (flux(i as f32), color(i as f32));
        let numbers = [x(i), 0.0, 0.0, temperature(i as f32), a, b, c];
        let numbers = numbers.iter().map(f32::to_string).chain([r, g, bl].map(|c| c.to_string()));
        numbers.collect::<Vec<_>>().join(separator)
    };
    rows(row).join("\n")
}

/// A line for each number of an array, in text.
fn block(numbers: impl Fn(f32) -> Vec<f32>) -> String {
    let row = |i: usize| {
        let numbers: Vec<String> = numbers(i as f32).iter().map(f32::to_string).collect();
        numbers.join(" ")
    };
    rows(row).join("\n")
}

fn csv() -> Vec<u8> {
    let header = "x,y,z,Temperature [K],flux_x,flux_y,flux_z,red,green,blue";
    format!("{header}\n{}\n", words(",")).into_bytes()
}

fn extxyz() -> Vec<u8> {
    let properties = "pos:R:3:temperature:R:1:flux:R:3:color:I:3";
    format!("{COUNT}\nProperties={properties}\n{}\n", words(" ")).into_bytes()
}

fn lammps() -> Vec<u8> {
    format!(
        "ITEM: TIMESTEP\n5\nITEM: NUMBER OF ATOMS\n{COUNT}\nITEM: BOX BOUNDS pp pp pp\n0 9\n0 9\n0 9\n\
         ITEM: ATOMS x y z temperature fluxx fluxy fluxz r g b\n{}\n",
        words(" ")
    )
    .into_bytes()
}

fn ply(binary: bool) -> Vec<u8> {
    let format = if binary { "binary_big_endian" } else { "ascii" };
    let mut bytes = format!("ply\nformat {format} 1.0\nelement vertex {COUNT}\n").into_bytes();
    for name in ["x", "y", "z", "temperature", "flux_x", "flux_y", "flux_z"] {
        bytes.extend(format!("property float {name}\n").bytes());
    }
    bytes.extend(b"property uchar red\nproperty uchar green\nproperty uchar blue\n");
    bytes.extend(b"end_header\n");
    if !binary {
        bytes.extend(words(" ").bytes());
        return bytes;
    }
    for i in 0..COUNT {
        let [a, b, c] = flux(i as f32);
        bytes.extend(be([x(i), 0.0, 0.0, temperature(i as f32), a, b, c]));
        bytes.extend(color(i as f32));
    }
    bytes
}

/// ASCII legacy files have colours from 0 to 1, which are linear as all floats; binary ones have bytes.
fn vtk() -> Vec<u8> {
    let mut bytes =
        format!("# vtk DataFile Version 3.0\na\nBINARY\nDATASET POLYDATA\nPOINTS {COUNT} float\n")
            .into_bytes();
    bytes.extend(rows(|i| be([x(i), 0.0, 0.0])).concat());
    let text = format!("\nPOINT_DATA {COUNT}\nSCALARS temperature float 1\nLOOKUP_TABLE default\n");
    bytes.extend(text.bytes());
    bytes.extend(rows(|i| be([temperature(i as f32)])).concat());
    bytes.extend(b"\nVECTORS flux float\n");
    bytes.extend(rows(|i| be(flux(i as f32))).concat());
    bytes.extend(b"\nCOLOR_SCALARS RGB 3\n");
    bytes.extend(rows(|i| color(i as f32)).concat());
    bytes
}

fn vtu() -> Vec<u8> {
    let array = |name: &str, kind: &str, width: usize, text: String| {
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{width}\" format=\"ascii\">\n{text}\n\
             </DataArray>\n"
        )
    };
    let places = array("Points", "Float32", 3, rows(|i| format!("{} 0 0", x(i))).join("\n"));
    let bytes = block(|i| color(i).map(f32::from).into());
    format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\">\n<UnstructuredGrid>\n\
         <Piece NumberOfPoints=\"{COUNT}\" NumberOfCells=\"0\">\n<Points>{places}</Points>\n<PointData>\n{}{}{}\
         <DataArray type=\"String\" Name=\"note\" format=\"ascii\">1 2</DataArray>\n</PointData>\n\
         </Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
        array("Temperature", "Float64", 1, block(|i| vec![temperature(i)])),
        array("flux", "Float32", 3, block(|i| flux(i).into())),
        array("Colors", "UInt8", 3, bytes),
    )
    .into_bytes()
}

/// Houdini's colours are linear floats.
fn linear(i: f32) -> [f32; 3] {
    color(i).map(|c| linear_from_srgb(f32::from(c) / 255.0))
}

fn bgeo() -> Vec<u8> {
    let attributes: [(&str, u16, i32, &[u8]); 3] =
        [("temperature", 1, 0, &[0; 4]), ("flux", 3, 5, &[0; 12]), ("Cd", 3, 0, &[0; 12])];
    let mut bytes = bgeo_header(5, COUNT as i32, &attributes);
    for i in 0..COUNT {
        bytes.extend(be([x(i), 0.0, 0.0, 1.0, temperature(i as f32)]));
        bytes.extend(be(flux(i as f32)));
        bytes.extend(be(linear(i as f32)));
    }
    bytes
}

fn geo() -> Vec<u8> {
    let attribute = |name: &str, width: usize, numbers: &dyn Fn(usize) -> Vec<f32>| {
        let tuples = rows(|i| format!("{:?}", numbers(i)).replace("NaN", "1e30")).join(",");
        format!(
            "[[\"type\",\"numeric\",\"name\",\"{name}\"],[\"size\",{width},\"values\",[\"size\",{width},\
             \"tuples\",[{tuples}]]]]"
        )
    };
    let attributes = [
        attribute("P", 3, &|i| vec![x(i), 0.0, 0.0]),
        attribute("temperature", 1, &|i| vec![temperature(i as f32)]),
        attribute("flux", 3, &|i| flux(i as f32).into()),
        attribute("Cd", 3, &|i| linear(i as f32).into()),
    ];
    let attributes = attributes.join(",");
    format!("[\"pointcount\",{COUNT},\"attributes\",[\"pointattributes\",[{attributes}]]]")
        .into_bytes()
}

fn archive() -> Vec<u8> {
    let shape = format!("({COUNT}, 3)");
    let vectors = |row: &dyn Fn(usize) -> [f32; 3]| rows(|i| le(row(i))).concat();
    npz(
        &[
            ("positions.npy", npy("<f4", "False", &shape, &vectors(&|i| [x(i), 0.0, 0.0]))),
            ("temperature.npy", {
                let numbers = rows(|i| f64::from(temperature(i as f32)).to_le_bytes()).concat();
                npy("<f8", "False", &format!("({COUNT},)"), &numbers)
            }),
            ("flux.npy", npy("<f4", "False", &shape, &vectors(&|i| flux(i as f32)))),
            ("color.npy", npy("|u1", "False", &shape, &rows(|i| color(i as f32)).concat())),
        ],
        true,
    )
}

fn hdf5() -> Vec<u8> {
    let mut file = FileBuilder::new();
    let vectors = |row: fn(usize) -> [f32; 3]| rows(row).concat();
    let shape = [COUNT as u64, 3];
    let places = vectors(|i| [x(i), 0.0, 0.0]);
    file.create_dataset("positions").with_f32_data(&places).with_shape(&shape);
    file.create_dataset("temperature").with_f32_data(&rows(|i| temperature(i as f32)));
    let fluxes = vectors(|i| flux(i as f32));
    file.create_dataset("flux").with_f32_data(&fluxes).with_shape(&shape);
    let colors = rows(|i| color(i as f32)).concat();
    file.create_dataset("rgb").with_u8_data(&colors).with_shape(&shape);
    file.finish().expect("a file")
}

fn prt() -> Vec<u8> {
    let mut bytes = b"\xc0PRT\r\n\x1a\n".to_vec();
    bytes.extend(56_i32.to_le_bytes());
    bytes.extend(b"Extensible Particle Format\0\0\0\0\0\0");
    bytes.extend(1_i32.to_le_bytes());
    bytes.extend((COUNT as i64).to_le_bytes());
    bytes.extend([4, 4, 44].iter().flat_map(|n: &i32| n.to_le_bytes()));
    let channels =
        [("Position", 4, 3, 0), ("Temperature", 4, 1, 12), ("Flux", 4, 3, 16), ("Color", 4, 3, 28)];
    for (name, kind, numbers, offset) in channels {
        let mut padded = name.as_bytes().to_vec();
        padded.resize(32, 0);
        bytes.extend(padded);
        bytes.extend([kind, numbers, offset].iter().flat_map(|n: &i32| n.to_le_bytes()));
    }
    let row = |i: usize| {
        let at = i as f32;
        [le([x(i), 0.0, 0.0]), le([temperature(at)]), le(flux(at)), le(linear(at))].concat()
    };
    [bytes, zlib(&rows(row).concat())].concat()
}

fn files() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("a.csv", csv()),
        ("a.extxyz", extxyz()),
        ("a.dump", lammps()),
        ("a.ply", ply(false)),
        ("b.ply", ply(true)),
        ("a.vtk", vtk()),
        ("a.vtu", vtu()),
        ("a.bgeo", bgeo()),
        ("a.geo", geo()),
        ("a.npz", archive()),
        ("a.h5", hdf5()),
        ("a.prt", prt()),
    ]
}

/// Checks that each particle has the value that was written beside it; x tells which it was.
fn check(name: &str, particles: &Particles, expected: impl Fn(f32) -> f32) {
    let values = particles.values.as_ref().unwrap_or_else(|| panic!("{name} has values"));
    assert_eq!(values.len(), particles.len());
    for (value, position) in values.iter().zip(&particles.positions) {
        let expected = expected(position.x);
        assert!((value - expected).abs() <= 1e-5 * expected.abs(), "{name}: {value} at {position}");
    }
}

/// Scalars, the lengths of vectors in one array or in columns, and colours are read from every format. Particles without
/// a position, and those that are not selected, take theirs with them.
#[test]
fn values_stay_beside_their_particles() {
    for (name, bytes) in files() {
        for (select, count) in [("", COUNT - 1), ("x>=3", 3), ("temperature<23.5", 2)] {
            let read = |shown: &str| {
                let contents = parse(name, &bytes, shown, select);
                contents.unwrap_or_else(|error| panic!("{name}: {error}")).particles
            };
            let heat = read("TEMPERATURE");
            assert_eq!((heat.len(), heat.colors.is_none()), (count, true), "{name} {select}");
            check(name, &heat, temperature);
            check(name, &read("flux"), |i| 13.0 * i);
            check(name, &read("x"), |i| i);
            let colored = read("color");
            for (found, position) in colored.colors.expect(name).iter().zip(&colored.positions) {
                let expected = Vec3::from(linear(position.x));
                assert!(
                    (*found - expected).abs().max_element() < 1e-6,
                    "{name}: {found} at {position}"
                );
            }
            assert_eq!(colored.values, None);
        }
    }
    // A column of a vector is a scalar.
    let column = parse("a.csv", &csv(), "flux_y", "").unwrap().particles;
    check("a.csv", &column, |i| -4.0 * i);
}

/// Nothing of it is read unless it is asked for.
#[test]
fn nothing_is_kept_unasked() {
    for (name, bytes) in files() {
        let contents = Contents::parse(Path::new(name), &bytes, &ReadOptions::default()).unwrap();
        assert_eq!((contents.particles.values, contents.particles.colors), (None, None), "{name}");
        assert!(contents.arrays.iter().all(|array| array.spread.is_none()));
    }
}

/// An attribute that a file lacks is an error that names those that it has.
#[test]
fn missing_attributes_are_told() {
    for (name, bytes) in files() {
        for wanted in ["pressure", "velocity", "density"] {
            let error = parse(name, &bytes, wanted, "").expect_err(name).to_string();
            let told = error.contains(&format!("{name}: no `{wanted}` to color by; there are: "));
            let lower = error.to_lowercase();
            let named = ["temperature", "flux", ", x, y, z"].iter().all(|n| lower.contains(n));
            assert!(told && named && !lower.contains("[k]"), "{error}");
        }
    }
}

/// Ranges are those of the particles that are read: without those that have no position, or are not selected.
#[test]
fn arrays_are_described() {
    for (name, bytes) in files() {
        for (select, low) in [("", 0.0), ("x>=3", 3.0)] {
            let select =
                if select.is_empty() { Default::default() } else { select.parse().unwrap() };
            let options = ReadOptions { values: true, select, ..Default::default() };
            let contents = Contents::parse(Path::new(name), &bytes, &options).unwrap();
            let spread = |wanted: &str| {
                let named = |array: &&limpid_io::particles::Array| {
                    array.name.to_lowercase().starts_with(wanted)
                };
                let array = contents.arrays.iter().find(named).unwrap_or_else(|| panic!("{name}"));
                array.spread.unwrap_or_else(|| panic!("{name}: {wanted}")).extremes
            };
            assert_eq!(spread("temperature"), [temperature(low), temperature(5.0)], "{name}");
            let [least, most] = spread("flux");
            let (of_vector, of_column) = ([13.0 * low, 65.0], [3.0 * low, 15.0]);
            assert!([of_vector, of_column].contains(&[least, most]), "{name}: {least} {most}");
        }
    }
    let contents = Contents::parse(
        Path::new("a.csv"),
        &csv(),
        &ReadOptions { values: true, ..Default::default() },
    );
    let array = &contents.unwrap().arrays[0];
    assert_eq!(array.name_and_unit(), ("Temperature", "K"));
}

/// OpenFOAM has an attribute a file, beside the positions.
#[test]
fn clouds_have_files_beside() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = folder.path().join("0.1/lagrangian/spray");
    std::fs::create_dir_all(&cloud).unwrap();
    let write = |name: &str, class: &str, data: &str| {
        let text = format!(
            "FoamFile\n{{\n version 2.0;\n format ascii;\n class {class};\n object {name};\n}}\n{data}\n"
        );
        std::fs::write(cloud.join(name), text).unwrap();
    };
    write("positions", "Cloud<spray>", "2\n(\n(1 2 3) 17\n(4 5 6) 18\n)");
    write("T", "scalarField", "2 ( 300 310.5 )");
    write("tauStress", "vectorField", "2{(0 3 4)}");
    let read = |shown: &str| {
        let options = ReadOptions { shown: Some(shown.into()), ..Default::default() };
        Contents::read(&cloud.join("positions"), &options)
    };
    assert_eq!(read("t").unwrap().particles.values, Some(vec![300.0, 310.5]));
    assert_eq!(read("tauStress").unwrap().particles.values, Some(vec![5.0; 2]));
    let error = read("p").unwrap_err().to_string();
    assert!(error.contains("T, tauStress"), "{error}");
}

/// Two-dimensional vectors, values that are no numbers, one number named color, and colours with a fourth number.
#[test]
fn unusual_attributes() {
    let read =
        |text: &str, shown: &str| parse("a.csv", text.as_bytes(), shown, "").unwrap().particles;
    let planar = read("x,y,z,f_x,f_y\n0,0,0,3,4\n1,0,0,6,8\n", "f");
    assert_eq!(planar.values, Some(vec![5.0, 10.0]));
    let missing = read("x,y,z,t\n0,0,0,nan\n1,0,0,-inf\n2,0,0,7\n", "t").values.unwrap();
    assert!(missing[0].is_nan() && missing[1].is_nan() && missing[2] == 7.0);
    let marked = read("x,y,z,color\n0,0,0,2\n1,0,0,3\n", "color");
    assert_eq!((marked.values, marked.colors), (Some(vec![2.0, 3.0]), None));
    let of_four = read("x,y,z,r,g,b,a\n0,0,0,0.25,0.5,1,1\n", "color");
    assert_eq!(of_four.colors, Some(vec![Vec3::new(0.25, 0.5, 1.0)]));
}
