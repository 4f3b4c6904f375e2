//! Solids that move: keys, a mesh for each frame, rigid bodies.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use glam::{DQuat, DVec3, UVec2, Vec3};
use limpid::mesh::{Mesh, Placement, linear_from_srgb};
use limpid::scene::{Shape, Solid, Surface};
use limpid_io::adjustments::{Adjustments, Floor};
use limpid_io::input::{FrameTime, Input, Loader, Missing, files_of};
use limpid_io::open::Request;
use limpid_io::project::Project;
use tempfile::TempDir;

use super::assert_contains;
use crate::support::frames::harness;

/// The beginning of a scene whose particles are frames 0 to 4.
const FRAMES: &str = r#"
    [particles]
    source = "p_{}.csv"
    radius = 0.05
    [environment]
    radiance = [1, 1, 1]
    [camera]
    eye = [0, 0, 5]
    target = [0, 0, 0]
    fov_y = 40
"#;

/// A tetrahedron whose last corner is at `height`, and an open square.
fn wedge(height: f64) -> String {
    format!("v 0 0 0\nv 1 0 0\nv 0 0 1\nv 0 {height} 0\nf 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n")
}
const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";

/// A folder with the particles of five frames, one far from the others.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for frame in 0..5 {
        let text = "x,y,z\n0,-1,0\n0.1,-1,0\n0,-1,0.1\n";
        fs::write(folder.path().join(format!("p_{frame}.csv")), text).expect("a file");
    }
    fs::write(folder.path().join("wedge.obj"), wedge(1.0)).expect("a mesh");
    folder
}

fn write(folder: &TempDir, solids: &str) -> String {
    let path = folder.path().join("scene.toml");
    fs::write(&path, format!("{FRAMES}{solids}")).expect("a scene");
    path.to_string_lossy().into_owned()
}

fn open(folder: &TempDir, solids: &str) -> (Loader, Project) {
    Input::open(write(folder, solids)).expect("a scene").resolve().expect("particles")
}

#[track_caller]
fn error(folder: &TempDir, solids: &str) -> String {
    Input::open(write(folder, solids)).expect_err("a mistake").to_string()
}

/// A time from 0 to 4, between two frames if it is not whole.
fn time(at: f64) -> FrameTime {
    let frame = at.floor() as i64;
    let fraction = at - at.floor();
    FrameTime { frame, next: if fraction > 0.0 { frame + 1 } else { frame }, fraction }
}

fn solids((input, project): &(Loader, Project), at: f64) -> Vec<Solid> {
    let moved = input.moved(time(at), &project.scene).expect("solids");
    moved.solids(&project.scene.solids).into_owned()
}

fn placement(solid: &Solid) -> Placement {
    let Shape::Mesh { placement, .. } = solid.shape else { panic!("{solid:?} is no mesh") };
    placement
}

fn mesh(solid: &Solid) -> &Arc<Mesh> {
    let Shape::Mesh { mesh, .. } = &solid.shape else { panic!("{solid:?} is no mesh") };
    mesh
}

/// Between keys a mesh moves straight and turns at an even rate; outside them it stands still. Values that
/// no key has are the solid's own.
#[test]
fn keys_move_and_turn_meshes() {
    let folder = folder();
    let opened = open(
        &folder,
        r#"
        [[solid]]
        shape = "mesh"
        file = "wedge.obj"
        translate = [9, 9, 9]
        scale = 2
        [[solid.key]]
        frame = 1
        translate = [0, 0, 0]
        rotate = [0, 1, 0, 0]
        [[solid.key]]
        frame = 2
        translate = [1, 0, 0]
        [[solid.key]]
        frame = 3.5
        translate = [1, 3, 0]
        rotate = [0, 1, 0, 179]
        [[solid]]
        shape = "mesh"
        file = "wedge.obj"
        translate = [1, 2, 3]
        [[solid.key]]
        frame = 1
        quaternion = [0, 0, 0, 2]
        [[solid]]
        shape = "mesh"
        file = "wedge.obj"
        "#,
    );
    for (at, place, degrees) in [
        (0.0, [0.0, 0.0, 0.0], 0.0),
        (1.0, [0.0, 0.0, 0.0], 0.0),
        (1.25, [0.25, 0.0, 0.0], 17.9),
        (2.0, [1.0, 0.0, 0.0], 71.6),
        (2.25, [1.0, 0.5, 0.0], 89.5),
        (3.5, [1.0, 3.0, 0.0], 179.0),
        (4.0, [1.0, 3.0, 0.0], 179.0),
    ] {
        let solids = solids(&opened, at);
        let Placement { translate, rotate, scale } = placement(&solids[0]);
        assert!(translate.abs_diff_eq(DVec3::from(place), 1e-12), "{at}: {translate}");
        let expected = DQuat::from_rotation_y(f64::to_radians(degrees));
        assert!(rotate.abs_diff_eq(expected, 1e-12), "{at}: {rotate}, not {expected}");
        assert_eq!(scale, 2.0);
        let second = placement(&solids[1]);
        assert_eq!((second.translate, second.rotate), (DVec3::new(1.0, 2.0, 3.0), DQuat::IDENTITY));
        assert_eq!(solids[2], opened.1.scene.solids[2], "what has no key stands still");
        assert!(Arc::ptr_eq(mesh(&solids[0]), mesh(&solids[2])), "files are shared");
    }
    // At rest, without a time, the solid is where its own keys have it.
    assert_eq!(placement(&opened.1.scene.solids[0]).translate, DVec3::splat(9.0));
}

/// Keys of other shapes are offsets from where they are at rest.
#[test]
fn keys_move_other_shapes() {
    let folder = folder();
    let keys = "[[solid.key]]\nframe = 0\ntranslate = [0, 0, 0]\n\
        [[solid.key]]\nframe = 4\ntranslate = [0, 8, 0]\n";
    let opened = open(
        &folder,
        &format!(
            "[[solid]]\nshape = \"plane\"\norigin = [1, 2, 3]\n{keys}\
             [[solid]]\nshape = \"box\"\nmin = [0, 0, 0]\nmax = [1, 1, 1]\n{keys}\
             [[solid]]\nshape = \"sphere\"\ncenter = [0, 1, 0]\nradius = 0.5\n{keys}"
        ),
    );
    let solids = solids(&opened, 1.5);
    let moved = DVec3::new(0.0, 3.0, 0.0);
    let Shape::Plane { origin, .. } = solids[0].shape else { panic!("a plane") };
    assert_eq!(origin, DVec3::new(1.0, 5.0, 3.0));
    assert_eq!(solids[1].shape, Shape::Box { min: moved, max: moved + DVec3::ONE });
    let ball = Shape::Sphere { center: DVec3::new(0.0, 4.0, 0.0), radius: 0.5 };
    assert_eq!(solids[2].shape, ball);
}

/// Each mistake in a key is one message that names the scene, the solid and the key.
#[test]
fn mistakes_in_keys_are_named() {
    let folder = folder();
    let solid = |shape: &str, keys: &str| {
        let first = "[[solid]]\nshape = \"sphere\"\ncenter = [0, 0, 0]\nradius = 1\n";
        error(&folder, &format!("{first}[[solid]]\n{shape}\n{keys}"))
    };
    let ball = "shape = \"sphere\"\ncenter = [0, 0, 0]\nradius = 1";
    let cube = "shape = \"box\"\nmin = [0, 0, 0]\nmax = [1, 1, 1]";
    let hull = "shape = \"mesh\"\nfile = \"wedge.obj\"";
    let key = |frame: &str, rest: &str| format!("[[solid.key]]\nframe = {frame}\n{rest}\n");
    let moved = "translate = [0, 0, 0]";
    for (shape, keys, expected) in [
        (ball, key("1", moved) + &key("1", moved), "key 2: frame is 1, expected more than 1"),
        (ball, key("2", moved) + &key("1.5", moved), "key 2: frame is 1.5, expected more than 2"),
        (ball, key("nan", moved), "key 1: frame is NaN"),
        (ball, key("inf", moved), "key 1: frame is inf"),
        (ball, key("1", "translate = [0, inf, 0]"), "key 1: translate must be finite"),
        (ball, key("1", "rotate = [0, 1, 0, 5]"), "key 1: a sphere does not turn; take a mesh"),
        (cube, key("1", "quaternion = [0, 0, 0, 1]"), "key 1: a box does not turn; take a mesh"),
        (hull, key("1", ""), "key 1: needs translate, rotate or quaternion"),
        (hull, key("1", "rotate = [0, 0, 0, 5]"), "key 1: rotate takes an axis"),
        (hull, key("1", "rotate = [0, 1, 0, nan]"), "key 1: rotate takes"),
        (hull, key("1", "quaternion = [0, 0, 0, 0]"), "key 1: quaternion must not be zero"),
        (
            hull,
            key("1", "rotate = [0, 1, 0, 5]\nquaternion = [0, 0, 0, 1]"),
            "key 1: takes one of rotate and quaternion",
        ),
        (
            hull,
            key("1", "rotate = [0, 1, 0, 0]") + &key("2", "rotate = [0, 2, 0, 360]"),
            "key 2: turns by 360 degrees",
        ),
        (
            hull,
            key("1", "rotate = [0, 1, 0, 170]") + &key("2", "rotate = [0, -3, 0, 170]"),
            "key 2: turns by 340 degrees",
        ),
    ] {
        assert_contains(&solid(shape, &keys), &["scene.toml", "[[solid]] 2:", expected]);
    }
    assert_contains(&solid(ball, &key("1", "translat = [0, 0, 0]")), &["translat", "translate"]);
    assert_contains(&solid(ball, "[[solid.key]]\ntranslate = [0, 0, 0]\n"), &["frame"]);
    assert_contains(&solid(ball, &key("1", "translate = [0, 0, 0, 1]")), &["4 numbers"]);
}

/// A simulation would ignore that its obstacles move: it is refused.
#[test]
fn simulations_refuse_moving_solids() {
    let folder = folder();
    let path = folder.path().join("sim.toml");
    let sims = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../sims"));
    let text = fs::read_to_string(sims.join("dam_break.toml")).expect("a scene");
    fs::write(&path, &text).expect("a scene");
    Project::load(&path).expect("still solids are taken");
    let ball = "\n[[solid]]\nshape = \"sphere\"\ncenter = [9, 9, 9]\nradius = 0.1\n";
    let key = "[[solid.key]]\nframe = 1\ntranslate = [0, 0, 0]\n";
    fs::write(&path, format!("{text}{ball}{key}")).expect("a scene");
    let error = Project::load(&path).expect_err("a mistake").to_string();
    assert_contains(&error, &["sim.toml", "[simulation]", "stand still"]);
}

/// Corners of meshes with the same triangles move straight between frames; another mesh takes over at its frame.
/// Files that are in use are read once.
#[test]
fn meshes_of_frames_are_interpolated() {
    let folder = folder();
    for (frame, text) in [(0, wedge(1.0)), (1, wedge(3.0)), (2, SQUARE.into()), (3, SQUARE.into())]
    {
        fs::write(folder.path().join(format!("hull_{frame:02}.obj")), text).expect("a mesh");
    }
    let opened = open(
        &folder,
        "[[solid]]\nshape = \"mesh\"\nfile = \"hull_%02d.obj\"\ntranslate = [0, 0, 1]\n\
         [[solid]]\nshape = \"mesh\"\nfile = \"hull_%02d.obj\"\nnormals = \"smooth\"\n",
    );
    let height = |at: f64| {
        let solids = solids(&opened, at);
        assert_eq!(placement(&solids[0]).translate, DVec3::Z);
        let mesh = mesh(&solids[0]);
        let tops = mesh.vertices().iter().map(|x| mesh.origin().y + f64::from(x.y));
        (tops.fold(f64::NEG_INFINITY, f64::max), mesh.triangles().len(), mesh.is_closed())
    };
    for (at, expected) in [
        (0.0, (1.0, 4, true)),
        (0.25, (1.5, 4, true)),
        (0.5, (2.0, 4, true)),
        (1.0, (3.0, 4, true)),
        (1.75, (3.0, 4, true)),
        (2.0, (1.0, 2, false)),
        (2.5, (1.0, 2, false)),
    ] {
        assert_eq!(height(at), expected, "at {at}");
    }
    let [a, b, c] = [0.0, 3.0, 0.0].map(|at| solids(&opened, at));
    assert!(Arc::ptr_eq(mesh(&a[0]), mesh(&c[0])), "a mesh in use is not read again");
    assert!(Arc::ptr_eq(mesh(&a[0]), mesh(&opened.1.scene.solids[0])));
    assert!(!Arc::ptr_eq(mesh(&a[0]), mesh(&b[0])));
    assert!(mesh(&a[0]).normals().is_empty());
    let half = solids(&opened, 0.5);
    assert_eq!(mesh(&half[1]).normals().len(), 4, "options hold for every frame");

    // Frame 4 has no mesh: as for particles, an error, nothing, or the frame before.
    let (mut input, project) = opened;
    let error = input.check_frames(&[0, 4]).expect_err("a missing frame").to_string();
    assert_contains(&error, &["hull_%02d.obj", "frame 4 is missing"]);
    let error = input.load(time(4.0), &project.scene).expect_err("a missing frame").to_string();
    assert_contains(&error, &["hull_%02d.obj", "frame 4 is missing"]);
    input.missing = Missing::Empty;
    let empty = input.moved(time(4.0), &project.scene).expect("no solids");
    assert!(empty.solids(&project.scene.solids).is_empty());
    input.missing = Missing::Hold;
    let held = input.moved(time(4.0), &project.scene).expect("solids");
    assert!(Arc::ptr_eq(mesh(&held.solids(&project.scene.solids)[0]), mesh(&b[0])));

    fs::write(folder.path().join("hull_03.obj"), "v 0 0 0\nv 1 0 0\nf 1 2 7\n").expect("a file");
    let opened = open(&folder, "[[solid]]\nshape = \"mesh\"\nfile = \"hull_{}.obj\"\n");
    let error = opened.0.load(time(3.0), &opened.1.scene).expect_err("damage").to_string();
    assert_contains(&error, &["hull_03.obj"]);
    // A damaged mesh is held as a missing one, and told.
    let (mut input, project) = opened;
    input.missing = Missing::Hold;
    let held = input.moved(time(3.0), &project.scene).expect("solids");
    assert_eq!(mesh(&held.solids(&project.scene.solids)[0]).triangles().len(), 2);
    let [remark] = held.remarks() else { panic!("{:?}", held.remarks()) };
    assert_contains(&remark.to_string(), &["hull_03.obj", "frame 2 is shown in its place"]);
    let error = self::error(&folder, "[[solid]]\nshape = \"mesh\"\nfile = \"hul_{}.obj\"\n");
    assert_contains(&error, &["hul_{}.obj", "no file of this name"]);
}

fn le<const N: usize>(numbers: [f32; N]) -> Vec<u8> {
    numbers.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// The first frame of a container and a float, as SPlisHSPlasH writes it, and the poses of a later one: the float
/// at `x`, turned about y by some degrees.
fn bodies(x: f32, degrees: f32) -> (Vec<u8>, Vec<u8>) {
    let mut first = 2_u32.to_le_bytes().to_vec();
    for (scale, is_wall, color) in
        [([9.0; 3], 1, [0.1, 0.4, 0.6, 1.0]), ([1.0, 2.0, 0.5], 0, [1.0, 0.5, 0.0, 1.0])]
    {
        first.extend(9_u32.to_le_bytes());
        first.extend(b"wedge.obj");
        first.extend(le(scale));
        first.push(is_wall);
        first.extend(le(color));
    }
    let (sin, cos) = degrees.to_radians().sin_cos();
    let container = le([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let float = le([x, 0.0, 0.0, cos, 0.0, -sin, 0.0, 1.0, 0.0, sin, 0.0, cos]);
    let poses = [container, float].concat();
    ([first, poses.clone()].concat(), poses)
}

/// Rigid bodies become solids with their meshes, scales and colours, and move between the poses of frames.
#[test]
fn rigid_bodies_move_between_frames() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("rb_data_0.bin"), bodies(0.0, 0.0).0).expect("a file");
    fs::write(at("rb_data_1.bin"), bodies(4.0, 90.0).1).expect("a file");
    let table = "[[solid]]\nshape = \"sphere\"\ncenter = [0, 0, 0]\nradius = 1\n\
        [rigid_bodies]\nsource = \"rb_data_{}.bin\"\nlit = true\n";
    let opened = open(&folder, table);
    let rest = &opened.1.scene.solids;
    assert_eq!(rest.len(), 2, "the sphere and the float");
    assert_eq!(rest[1].surface, Surface::Color(Vec3::new(1.0, linear_from_srgb(0.5), 0.0)));
    assert!(rest[1].lit);
    let float = mesh(&rest[1]);
    let corners = || float.vertices().iter().copied();
    let (min, max) = (corners().fold(Vec3::MAX, Vec3::min), corners().fold(Vec3::MIN, Vec3::max));
    assert_eq!(max - min, Vec3::new(1.0, 2.0, 0.5), "the scale is the mesh's");
    for (at, x, degrees) in [(0.0, 0.0, 0.0), (0.25, 1.0, 22.5), (0.5, 2.0, 45.0), (1.0, 4.0, 90.0)]
    {
        let solids = solids(&opened, at);
        assert_eq!(solids[0], rest[0]);
        assert!(Arc::ptr_eq(mesh(&solids[1]), float));
        let Placement { translate, rotate, scale } = placement(&solids[1]);
        assert_eq!((translate, scale), (x * DVec3::X, 1.0));
        let turned = rotate * DVec3::X;
        let expected = DQuat::from_rotation_y(f64::to_radians(degrees)) * DVec3::X;
        assert!(turned.abs_diff_eq(expected, 1e-6), "{at}: {turned}, not {expected}");
    }
    let missing = opened.0.load(time(2.0), &opened.1.scene).expect_err("no frame").to_string();
    assert_contains(&missing, &["rb_data_{}.bin", "frame 2 is missing"]);

    let both = open(&folder, &format!("{table}walls = true\nup = \"z\"\n"));
    assert_eq!(both.1.scene.solids.len(), 3);
    // z is up in the files: what turns about their y turns about −z.
    let turned = placement(&solids(&both, 1.0)[2]);
    assert_eq!(turned.translate, 4.0 * DVec3::X);
    assert!((turned.rotate * DVec3::X).abs_diff_eq(DVec3::NEG_Y, 1e-6), "{}", turned.rotate);
    let up = placement(&solids(&both, 0.0)[2]).rotate * DVec3::Z;
    assert!(up.abs_diff_eq(DVec3::Y, 1e-12), "{up}");

    // Bodies that cannot move have one frame.
    let one = table.replace("{}", "0");
    let still = open(&folder, &one);
    assert_eq!(solids(&still, 3.5), still.1.scene.solids);

    // Damage is told with its file; a later frame is not the first; so is a body without an extent.
    fs::write(at("rb_data_1.bin"), &bodies(4.0, 90.0).1[..90]).expect("a file");
    let damaged = open(&folder, table);
    let error = damaged.0.load(time(1.0), &damaged.1.scene).expect_err("damage").to_string();
    assert_contains(&error, &["rb_data_1.bin: byte"]);
    let error = self::error(&folder, &table.replace("{}", "1"));
    assert_contains(&error, &["rb_data_1.bin", "first frame"]);
    let mut flat = bodies(0.0, 0.0).0;
    let scale = 4 + (4 + 9 + 12 + 1 + 16) + 4 + 9;
    flat[scale..scale + 4].copy_from_slice(&[0; 4]);
    fs::write(at("rb_data_0.bin"), flat).expect("a file");
    assert_contains(&self::error(&folder, table), &["rb_data_0.bin", "body 2", "scale"]);
    let unknown = table.replace("lit", "lid");
    assert_contains(&self::error(&folder, &unknown), &["lid", "lit"]);
    assert_contains(
        &self::error(&folder, "[rigid_bodies]\nsource = \"rb_{}.bin\"\n"),
        &["rb_{}.bin"],
    );
}

/// Motion survives saving, in both forms of a scene, and its files are inputs that no output may replace.
#[test]
fn motion_survives_saving() {
    let folder = folder();
    for frame in 0..2 {
        let path = folder.path().join(format!("hull_{frame}.obj"));
        fs::write(path, wedge(1.0)).expect("a mesh");
    }
    fs::write(folder.path().join("rb_data_0.bin"), bodies(0.0, 0.0).0).expect("a file");
    let text = r#"
        [[solid]]
        shape = "box"
        min = [0, 0, 0]
        max = [1, 1, 1]
        [[solid]]
        shape = "mesh"
        file = "hull_{}.obj"
        [[solid.key]]
        frame = 0.1
        translate = [0.1, 0.2, 0.3]
        rotate = [1, 2, 3, 40]
        [[solid.key]]
        frame = 2
        quaternion = [0.1, 0.2, 0.3, 0.4]
        [rigid_bodies]
        source = "rb_data_{}.bin"
        walls = true
    "#;
    let path = write(&folder, text);
    let project = Project::load(path.as_ref()).expect("a scene");
    let saved = folder.path().join("saved.toml");
    project.save(&saved).expect("a saved scene");
    assert_eq!(Project::load(&saved).expect("a scene"), project);
    let written = fs::read_to_string(&saved).expect("text");
    assert_contains(
        &written,
        &["file = \"hull_{}.obj\"", "source = \"rb_data_{}.bin\"", "[[solid.key]]"],
    );
    let commented = project.to_commented_toml(None).expect("text");
    let again = Project::parse(&commented, "again", Path::new("")).expect(&commented);
    assert_eq!((&again.motion, &again.scene), (&project.motion, &project.scene), "{commented}");
    assert_contains(&commented, &["# Solids of SPlisHSPlasH", "# between keys"]);
    let files = files_of(&path);
    for name in ["hull_0.obj", "hull_1.obj", "rb_data_0.bin"] {
        assert!(files.contains(&folder.path().join(name)), "{name} is not in {files:?}");
    }
}

/// A ground that is taken away does not leave its motion, or that of others, to another solid.
#[test]
fn motion_follows_its_solid() {
    let folder = folder();
    let key = |y: f64| format!("[[solid.key]]\nframe = 0\ntranslate = [0, {y}, 0]\n");
    let ball = "[[solid]]\nshape = \"sphere\"\ncenter = [0, 0, 0]\nradius = 1\n";
    let ground = "[[solid]]\nshape = \"plane\"\norigin = [0, 0, 0]\n";
    let text = format!("{ball}{}{ground}{}{ball}{ball}{}", key(1.0), key(2.0), key(3.0));
    let heights = |floor: Option<Floor>| {
        let request = Request {
            input: Some(write(&folder, &text).into()),
            adjustments: Adjustments { floor, ..Adjustments::default() },
            ..Request::default()
        };
        let opened = request.open().expect("a scene");
        let loaded = opened.loader.load(time(1.0), &opened.project.scene).expect("a frame");
        let scene = loaded.scene(&opened.project.scene).into_owned();
        let height = |solid: &Solid| match solid.shape {
            Shape::Plane { origin, .. } => origin.y,
            Shape::Sphere { center, .. } => center.y,
            _ => f64::NAN,
        };
        scene.solids.iter().map(height).collect::<Vec<_>>()
    };
    assert_eq!(heights(None), [1.0, 2.0, 0.0, 3.0]);
    assert_eq!(heights(Some(Floor::At(-5.0))), [1.0, -3.0, 0.0, 3.0]);
    assert_eq!(heights(Some(Floor::None)), [1.0, 0.0, 3.0]);
}

/// Liquid wets the solids of its own frame.
#[test]
fn contacts_are_those_of_the_frame() {
    let folder = folder();
    let mut block = String::from("x,y,z\n");
    for i in 0..1000 {
        let [x, y, z] = [i % 10, i / 10 % 10, i / 100].map(|k| 0.1 * f64::from(k));
        block += &format!("{x},{y},{z}\n");
    }
    for frame in 0..5 {
        fs::write(folder.path().join(format!("p_{frame}.csv")), &block).expect("a file");
    }
    let (input, project) = open(
        &folder,
        "[[solid]]\nshape = \"box\"\nmin = [-9, -9, -9]\nmax = [9, -5, 9]\n\
         [[solid.key]]\nframe = 1\ntranslate = [0, 0, 0]\n\
         [[solid.key]]\nframe = 3\ntranslate = [0, 4.95, 0]\n",
    );
    let count =
        |at: f64| input.load(time(at), &project.scene).expect("a frame").splats.aggregates.len();
    let dry = count(1.0);
    assert_eq!(count(2.5), dry, "a floor below the liquid does not touch it");
    assert!(count(3.0) >= dry + 50, "a layer of {dry} particles lies on the floor");
    assert_eq!(count(0.0), dry, "a frame does not depend on those before it");
}

/// Two frames, and a time between them, show the ball where it is.
#[test]
fn frames_show_solids_where_they_are() {
    const SIZE: UVec2 = UVec2::new(80, 40);
    let Some(mut harness) = harness() else { return };
    let folder = folder();
    let (input, project) = open(
        &folder,
        "[[solid]]\nshape = \"sphere\"\ncenter = [-1, 0, 0]\nradius = 0.2\ncolor = [0.5, 0, 0]\n\
         [[solid.key]]\nframe = 0\ntranslate = [0, 0, 0]\n\
         [[solid.key]]\nframe = 1\ntranslate = [2, 0, 0]\n",
    );
    let camera = project.camera.expect("a camera");
    // At 5 m half of the 40 pixels are 5 tan 20° m: a metre is 11 pixels.
    let places = [29, 40, 51];
    for (at, shown) in [(0.0, 29), (1.0, 51), (0.5, 40), (0.0, 29)] {
        let loaded = input.load(time(at), &project.scene).expect("a frame");
        let scene = loaded.scene(&project.scene);
        let picture = harness.render(&scene, &camera, &loaded.splats, SIZE).picture;
        for x in places {
            let is_red = picture.get_pixel(x, 20).0[1] == 0;
            assert_eq!(is_red, x == shown, "pixel {x} at {at}: {:?}", picture.get_pixel(x, 20));
        }
    }
}
