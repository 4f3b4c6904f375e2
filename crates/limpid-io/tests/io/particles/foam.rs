//! OpenFOAM's parcels.

use std::fs;
use std::path::Path;

use glam::Vec3;
use limpid_io::particles::{Contents, ReadOptions, read};
use limpid_io::sequence::Sequence;

use super::check_message;

fn foam(class: &str, object: &str, data: &str) -> String {
    format!(
        "/*---*- C++ -*---*\\\n  =========   OpenFOAM: parcels; {{}} ()\n\\*---*/\nFoamFile\n{{\n    version 2.0;\n    \
         format ascii;\n    class {class};\n    location \"0.1/lagrangian/spray\";\n    object {object};\n}}\n\
         // * * * //\n\n{data}\n\n// **** //\n"
    )
}

const CLOUD: &str = "Cloud<basicKinematicCloud>";

/// Places are read with what is beside them: diameters are twice the radius, and uniform values are those of all. A case
/// is a sequence of its times.
#[test]
fn clouds_and_cases() {
    let folder = tempfile::tempdir().unwrap();
    for (time, x) in [("0.1", 1.0), ("0.05", 0.5), ("0.15", 1.5)] {
        let cloud = folder.path().join(time).join("lagrangian/spray");
        fs::create_dir_all(&cloud).unwrap();
        let write = |name: &str, class: &str, data: &str| {
            fs::write(cloud.join(name), foam(class, name, data)).unwrap();
        };
        write("positions", CLOUD, &format!("2\n(\n({x} 2 3) 17\n(4 5 -6e-1) 18\n)"));
        write("U", "vectorField", "2 ( (1 0 0) (0 1 0) )");
        write("d", "scalarField", "2{0.5}");
        write("origId", "labelField", "2\n(\n7\n9\n)\n");
    }
    fs::create_dir(folder.path().join("constant")).unwrap();
    let options = ReadOptions::default();
    let file = folder.path().join("0.1/lagrangian/spray/positions");
    let particles = Contents::read(&file, &options).expect("valid").particles;
    assert_eq!(particles.positions, [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, -0.6)]);
    assert_eq!(particles.velocities, Some(vec![Vec3::X, Vec3::Y]));
    assert_eq!(particles.radii, Some(vec![0.25; 2]));
    assert_eq!(particles.ids, Some(vec![7, 9]));

    let case = Sequence::open(folder.path().to_str().unwrap()).expect("a case");
    let first = |k: usize| case.frames[k].read(&options).unwrap().particles.positions[0].x;
    assert_eq!((case.frames.len(), [0, 1, 2].map(first)), (3, [0.5, 1.0, 1.5]));
    assert!((case.fps.expect("even times") - 20.0).abs() < 1e-9);

    let attribute = read(&file.with_file_name("U")).unwrap_err().to_string();
    assert!(attribute.contains("`vectorField`"), "{attribute}");
    fs::create_dir_all(folder.path().join("0.1/lagrangian/other")).unwrap();
    fs::copy(&file, folder.path().join("0.1/lagrangian/other/positions")).unwrap();
    let two = Sequence::open(folder.path().to_str().unwrap()).unwrap_err().to_string();
    assert!(two.contains("several clouds in 0.1/lagrangian: other, spray"), "{two}");
}

/// Binary files and places within cells are named; counts are not trusted.
#[test]
fn what_is_refused() {
    let positions = |data: &str| foam(CLOUD, "positions", data).into_bytes();
    let binary = String::from_utf8(positions("")).unwrap().replace("ascii", "binary");
    check_message("positions", binary.as_bytes(), &["foamFormatConvert"]);
    check_message("positions", &positions("1((0.1 0.2 0.3 0.4) 5 1 2)"), &["foamToVTK"]);
    check_message(
        "positions",
        &positions("3((0 0 0) 1 (1 1 1) 2)"),
        &["line", "expected a number"],
    );
    check_message(
        "positions",
        &positions("1((0 0 0) 1 (1 1 1) 2)"),
        &["line", "more than the 1 items"],
    );
    check_message("positions", &positions("1((0 zero 0) 1)"), &["particle 0", "`zero`"]);
    check_message("positions", &positions("18446744073709551615((0 0 0) 1"), &["the file ends"]);
    assert!(
        limpid_io::particles::parse(Path::new("positions"), &positions("0\n(\n)"))
            .unwrap()
            .is_empty()
    );
}
