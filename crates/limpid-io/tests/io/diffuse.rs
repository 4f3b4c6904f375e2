//! Foam, spray, bubbles and dust from files: what their arrays mean, which files belong to which liquid, and what a scene
//! says about them.

use std::fs;
use std::path::Path;

use limpid::diffuse::{Diffuse, DiffuseKind};
use limpid::glam::{DVec3, Vec3};
use limpid::liquid::Particles;
use limpid_io::input::{FrameTime, Input, Loader};
use limpid_io::particles::{self, Remark, read_diffuse, write_diffuse};
use limpid_io::project::Project;
use tempfile::TempDir;

use DiffuseKind::{Bubble, Dust, Foam, Spray};

/// Some particles with all attributes, whose numbers have no short digits.
fn all_attributes() -> Diffuse {
    let third = |k: usize| (k as f32 + 1.0) / 3.0;
    Diffuse {
        positions: (0..5).map(|k| Vec3::new(third(k), -third(2 * k), third(k * k))).collect(),
        velocities: Some((0..5).map(|k| Vec3::splat(0.7 * third(k))).collect()),
        radii: (0..5).map(|k| 1e-3 * third(k)).collect(),
        kinds: vec![Foam, Spray, Bubble, Dust, Foam],
        ages: Some((0..5).map(third).collect()),
        lifetimes: Some((0..5).map(|k| 2.0 * third(k)).collect()),
        ..Diffuse::default()
    }
}

/// A file in a folder of its own.
fn file(name: &str, bytes: impl AsRef<[u8]>) -> (TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    (folder, path)
}

/// An array of 32-bit floats as numpy writes it.
fn npy(shape: [usize; 2], numbers: &[f32]) -> Vec<u8> {
    let [rows, columns] = shape;
    let header =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    let header = format!("{header:<117}\n");
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(header.bytes());
    bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
    bytes
}

#[test]
fn every_format_with_attributes_reads_back_what_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let written = all_attributes();
    for name in ["a.bgeo", "a.bgeo.gz", "a.bhclassic", "a.vtk", "a.vtu", "a.ply", "a.npz", "a.csv"]
    {
        let path = folder.path().join(name);
        write_diffuse(&written, &path).unwrap();
        assert_eq!(read_diffuse(&path, 1.0).unwrap(), written, "{name}");
        // As particles of a liquid they are read too.
        assert_eq!(particles::read(&path).unwrap().len(), 5, "{name}");
    }
    for name in ["a.xyz", "a.npy", "a.pos"] {
        let path = folder.path().join(name);
        let error = write_diffuse(&written, &path).unwrap_err().to_string();
        assert!(error.contains("holds no kinds") && !path.exists(), "{error}");
    }
    let far = Diffuse { origin: DVec3::splat(1e6), ..written };
    let error = write_diffuse(&far, &folder.path().join("b.bgeo")).unwrap_err().to_string();
    assert!(error.contains("32-bit places"), "{error}");
    let path = folder.path().join("b.npz");
    write_diffuse(&far, &path).unwrap();
    let read = read_diffuse(&path, 1.0).unwrap();
    let place = |of: &Diffuse| of.origin + of.positions[3].as_dvec3();
    assert!(place(&read).distance(place(&far)) < 1e-6);
}

/// The numbers of limpid, the bits of mantaflow, and what is neither.
#[test]
fn kinds_are_told_by_several_numbers() {
    let kinds = |text: &str| {
        let (_folder, path) = file("a.csv", text);
        read_diffuse(&path, 0.5).unwrap().kinds
    };
    for name in ["kind", "type", "ptype", "Kinds"] {
        let text = format!("x,y,z,{name}\n0,0,0,0\n1,0,0,1\n2,0,0,2\n3,0,0,3\n");
        assert_eq!(kinds(&text), [Foam, Spray, Bubble, Dust], "{name}");
    }
    assert_eq!(
        kinds("x,y,z,ptype\n0,0,0,8\n1,0,0,2\n2,0,0,4\n3,0,0,9\n"),
        [Foam, Spray, Bubble, Foam]
    );
    // VisualSPHysics has another order.
    assert_eq!(kinds("x,y,z,ParticleType\n0,0,0,0\n1,0,0,1\n2,0,0,2\n"), [Spray, Foam, Bubble]);
    assert_eq!(kinds("x,y,z,flags\n0,0,0,2\n1,0,0,2\n"), [Spray, Spray]);
    for wrong in ["x,y,z,kind\n0,0,0,0.5\n1,0,0,1\n", "x,y,z,kind\n0,0,0,-1\n1,0,0,1\n"] {
        assert_eq!(kinds(wrong), [Foam, Foam], "{wrong}");
    }
}

#[test]
fn lifetimes_are_seconds_left() {
    let read = |text: &str| {
        let (_folder, path) = file("a.csv", text);
        read_diffuse(&path, 0.5).unwrap()
    };
    let own = read("x,y,z,age,lifetime,pscale\n0,0,0,1,2,0.25\n1,0,0,0,3,0\n");
    assert_eq!((own.ages, own.lifetimes), (Some(vec![1.0, 0.0]), Some(vec![2.0, 3.0])));
    // Without a radius of its own.
    assert_eq!(own.radii, [0.25, 0.5]);
    // Houdini's `life` is the whole; the second of these is over.
    let houdini = read("x,y,z,age,life\n0,0,0,1,4\n1,0,0,5,4\n");
    assert_eq!((houdini.ages, houdini.lifetimes), (Some(vec![1.0]), Some(vec![3.0])));
    // Numbers that are none are left out.
    assert_eq!(read("x,y,z,age\n0,0,0,nan\n1,0,0,1\n").ages, None);
}

/// The buffers of demos on the GPU keep dead particles.
#[test]
fn the_fourth_column_is_a_lifetime() {
    let dead = [[3.0, 4.0, 5.0, 0.0], [6.0, 7.0, 8.0, -1.0]].as_flattened().repeat(4);
    let numbers = [&[0.0, 1.0, 2.0, 0.5][..], &dead].concat();
    let (_folder, path) = file("diffuse.npy", npy([9, 4], &numbers));
    let read = read_diffuse(&path, 0.5).unwrap();
    assert_eq!(read.positions, [Vec3::new(0.0, 1.0, 2.0)]);
    assert_eq!(read.lifetimes, Some(vec![0.5]));
    let (_folder, path) = file("diffuse.csv", "0,1,2,0.5\n3,4,5,-1\n");
    assert_eq!(read_diffuse(&path, 0.5).unwrap().lifetimes, Some(vec![0.5]));
}

/// A lattice of liquid, 8 particles of radius 0.5.
fn liquid() -> Particles {
    let at = |i: usize| Vec3::new((i % 2) as f32, (i / 2 % 2) as f32, (i / 4) as f32);
    Particles::from_positions((0..8).map(at).collect())
}

/// A folder with two frames of liquid and further files of diffuse particles, one of each name.
fn folder_with(liquids: &[&str], others: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in liquids {
        particles::write(&liquid(), &folder.path().join(name)).unwrap();
    }
    for name in others {
        let foam = Diffuse::from_positions(vec![Vec3::splat(0.5)], 0.01);
        // As FoamGenerator writes them: positions alone.
        particles::write(&Particles::from_positions(foam.positions), &folder.path().join(name))
            .unwrap();
    }
    folder
}

fn open(path: &Path) -> Loader {
    Input::open(path).unwrap().resolve().unwrap().0
}

fn kinds_at(loader: &Loader, frame: i64) -> Vec<DiffuseKind> {
    let (found, _) = loader.diffuse(FrameTime::at(frame), 0.5).unwrap();
    found.map(|found| found.kinds).unwrap_or_default()
}

#[test]
fn a_folder_of_water_and_foam_is_water_with_foam() {
    let liquids = ["water_0001.bgeo", "water_0002.bgeo"];
    let folder = folder_with(&liquids, &["water_foam_0002.bgeo", "water_spray_0002.bgeo"]);
    let names = ["", "water_{}.bgeo", "water*.bgeo"];
    for name in names {
        let loader = open(&folder.path().join(name));
        assert!(loader.sequence.pattern.contains("water_{}") || name.contains('*'));
        assert_eq!(loader.sequence.frames.len(), 2, "{name}");
        assert_eq!(kinds_at(&loader, 1), [], "{name}");
        assert_eq!(kinds_at(&loader, 2), [Foam, Spray], "{name}");
    }
    let (found, _) = open(folder.path()).diffuse(FrameTime::at(2), 0.5).unwrap();
    assert_eq!(found.unwrap().radii, [0.1, 0.1]);
    // One file of the sequence has its own foam, and a frame is loaded with it.
    let loader = open(&folder.path().join("water_0002.bgeo"));
    let loaded = loader.load(FrameTime::at(2), &Project::default().scene).unwrap();
    assert_eq!(loaded.diffuse.unwrap().counts(), [1, 1, 0, 0]);
    // Foam is opened by its own name.
    let foam = Input::open(folder.path().join("water_foam_{}.bgeo")).unwrap();
    let foam = foam.with_radius(0.5).unwrap().resolve().unwrap().0;
    assert_eq!(foam.sequence.frames.len(), 1);
    assert_eq!(foam.diffuse_patterns().count(), 0);
}

/// `--splittypes` of `FoamGenerator` puts the kind after the number.
#[test]
fn companions_are_told_by_their_names() {
    let patterns = |liquids: &[&str], others: &[&str]| {
        let folder = folder_with(liquids, others);
        let loader = open(&folder.path().join("dam_{}.vtk"));
        loader
            .diffuse_patterns()
            .map(|pattern| Path::new(pattern).file_name().unwrap().to_owned())
            .collect::<Vec<_>>()
    };
    let dam = ["dam_1.vtk", "dam_2.vtk"];
    let split = ["dam_1_bubbles.vtk", "dam_2_bubbles.vtk"];
    assert_eq!(patterns(&dam, &split), ["dam_{}_bubbles.vtk"]);
    assert_eq!(patterns(&dam, &["foam_1.vtk", "foam_2.vtk"]), ["foam_{}.vtk"]);
    assert_eq!(patterns(&dam, &["Dust.vtk"]), ["Dust.vtk"]);
    // Alone in the folder, whatever their names.
    assert_eq!(
        patterns(&dam, &["run7_diffuse_1.vtk", "run7_diffuse_2.vtk"]),
        ["run7_diffuse_{}.vtk"]
    );
    // Of another liquid.
    let two = [&dam[..], &["sea_1.vtk"]].concat();
    assert_eq!(patterns(&two, &["sea_foam_1.vtk", "sea_foam_2.vtk"]), [""; 0]);
    // No word, but a part of one.
    assert_eq!(patterns(&dam, &["sprayer_1.vtk"]), [""; 0]);
}

#[test]
fn a_scene_names_files_and_says_what_is_shown() {
    let folder = folder_with(&["water_0.csv", "water_1.csv"], &["water_foam_1.csv"]);
    let mut foam = all_attributes();
    foam.velocities = None;
    write_diffuse(&foam, &folder.path().join("own.npz")).unwrap();
    let scene = |frame: &str, tables: &str| {
        let text = format!(
            "[particles]\nsource = \"water_{{}}.csv\"\nradius = 0.5\nup = \"z\"\nscale = 2\n{frame}\n{tables}"
        );
        let path = folder.path().join("a.toml");
        fs::write(&path, text).unwrap();
        Input::open(&path).and_then(Input::resolve)
    };
    // One file is shown with the scene's frame, and turns and grows with the liquid.
    let own = "[[diffuse]]\nsource = \"own.npz\"\nkinds = [\"spray\", \"bubbles\"]\ncolor = [0.5, 0.5, 0.25]\n";
    let (loader, project) = scene("frame = 1", own).unwrap();
    assert_eq!(kinds_at(&loader, 0), []);
    let (_, remarks) = loader.diffuse(FrameTime::at(0), 0.5).unwrap();
    assert_eq!(remarks, [Remark::OfOtherFrame { file: "own.npz".into(), own: 1 }]);
    let shown = loader.diffuse(FrameTime::at(1), 0.5).unwrap().0.unwrap();
    assert_eq!(shown.kinds, [Spray, Bubble]);
    let Vec3 { x, y, z } = 2.0 * foam.positions[1];
    assert_eq!(shown.positions[0], Vec3::new(x, z, -y));
    assert_eq!(shown.radii[0], 2.0 * foam.radii[1]);
    let colored = Vec3::new(0.5, 0.5, 0.25);
    assert_eq!(&shown.colors[1..3], [colored; 2]);
    assert_ne!(shown.colors[0], colored);
    // A written scene is read back.
    let text = project.to_toml(None).unwrap();
    let read = Project::parse(&text, "b.toml", Path::new("")).unwrap();
    assert_eq!(read.diffuse, project.diffuse);
    // Without a frame it is shown with all.
    let (loader, _) = scene("", own).unwrap();
    assert_eq!([0, 1].map(|frame| kinds_at(&loader, frame).len()), [2, 2]);
    // Without a table the files beside are found, and none by an empty list.
    assert_eq!(kinds_at(&scene("", "").unwrap().0, 1), [Foam]);
    let (loader, _) = scene("", "").unwrap();
    assert_eq!(loader.diffuse_patterns().count(), 1);
    fs::write(
        folder.path().join("b.toml"),
        "diffuse = []\n[particles]\nsource = \"water_{}.csv\"\n",
    )
    .unwrap();
    assert_eq!(open(&folder.path().join("b.toml")).diffuse_patterns().count(), 0);
    for (wrong, problem) in [
        ("[[diffuse]]\nsource = \"own.npz\"\ncolor = [2, 0, 0]\n", "color must be between 0 and 1"),
        ("[[diffuse]]\nsource = \"own.npz\"\nradius = 0\n", "radius must be"),
        ("[[diffuse]]\nsource = \"gone.npz\"\n", "gone.npz"),
        ("[[diffuse]]\nsource = \"own.npz\"\nkinds = [\"snow\"]\n", "snow"),
    ] {
        let error = scene("", wrong).unwrap_err().to_string();
        assert!(error.contains(problem), "{error}");
    }
}

/// A scene reads whitewater with the axes and the unit of its first fluid; a table of others would place it elsewhere.
#[test]
fn tables_have_the_axes_of_the_first_fluid() {
    let folder = folder_with(&["water_0.csv", "oil_0.csv"], &["oil_foam_0.csv"]);
    let tables = |oil: &str| {
        let water = "[[fluid]]\nsource = \"water_0.csv\"\nradius = 0.5\nup = \"y\"\n";
        let oil = format!("[[fluid]]\nsource = \"oil_0.csv\"\nradius = 0.5\n{oil}\n");
        let path = folder.path().join("a.toml");
        fs::write(&path, [water, &oil].concat()).unwrap();
        open(&path).diffuse_sources(&[0])
    };
    let [table] = &tables("up = \"y\"").unwrap()[..] else { panic!("one table") };
    assert!(table.source.ends_with("oil_foam_{}.csv"), "{table:?}");
    for oil in ["up = \"z\"", "up = \"y\"\nscale = 0.1"] {
        let error = tables(oil).unwrap_err().to_string();
        assert!(error.contains("oil_foam_{}.csv") && error.contains("first fluid"), "{error}");
    }
}

/// Between frames particles fly on, and those that disappear meanwhile are gone.
#[test]
fn particles_move_between_frames() {
    let folder = folder_with(&["water_0.csv", "water_1.csv"], &[]);
    let mut foam = all_attributes();
    foam.lifetimes = Some(vec![0.04, 1.0, 1.0, 1.0, 1.0]);
    write_diffuse(&foam, &folder.path().join("water_foam_0.csv")).unwrap();
    let path = folder.path().join("a.toml");
    fs::write(&path, "[particles]\nsource = \"water_{}.csv\"\nfps = 10\n").unwrap();
    let loader = open(&path);
    let at = FrameTime { frame: 0, next: 1, fraction: 0.5 };
    let later = loader.diffuse(at, 0.5).unwrap().0.unwrap();
    assert_eq!(later.len(), 4);
    let (x, v) = (foam.positions[1], foam.velocities.unwrap()[1]);
    assert!(later.positions[0].distance(x + 0.05 * v) < 1e-6);
    assert!((later.ages.unwrap()[0] - foam.ages.unwrap()[1] - 0.05).abs() < 1e-6);
}

/// Those of one file with several frames, as a buffer of a simulation in Python.
#[test]
fn steps_of_one_array_are_frames() {
    let folder = folder_with(&["water_0.csv", "water_1.csv"], &[]);
    let header =
        format!("{:<117}\n", "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 50, 3), }");
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(header.bytes());
    bytes.extend((0..300).flat_map(|k| (k as f32).to_le_bytes()));
    fs::write(folder.path().join("foam.npy"), bytes).unwrap();
    let loader = open(folder.path());
    assert_eq!([0, 1].map(|frame| kinds_at(&loader, frame).len()), [50, 50]);
    let (found, _) = loader.diffuse(FrameTime::at(1), 0.5).unwrap();
    assert_eq!(found.unwrap().positions[0], Vec3::new(150.0, 151.0, 152.0));
}
