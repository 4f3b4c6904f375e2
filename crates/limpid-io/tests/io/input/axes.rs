//! The axis that points up, in files and for cameras.

use std::path::Path;

use glam::{DVec3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::liquid::Up;
use limpid_io::adjustments::Adjustments;
use limpid_io::camera_axes::GivenCamera;
use limpid_io::camera_path::{CameraPath, Key};
use limpid_io::input::{FrameTime, Input, UpFrom};
use limpid_io::notice;
use limpid_io::open::{Opened, Request};
use limpid_io::project::Project;

use super::{frames, open, z_up};

/// Without a scene z is up if a frame shows that, be it a later one; the view follows. `--up` and a scene with
/// directions of its own decide against it.
#[test]
fn the_axis_that_points_up_is_guessed() {
    let wave = z_up(|x, y| 6.0 + 4.0 * (0.4 * x).sin() + (0.9 * y).cos());
    let folder = frames(&[&z_up(|_, _| 9.0), &wave]);
    let (input, project) = open(&folder).resolve().unwrap();
    assert!(input.is_turned());
    let top = input.particles(FrameTime::at(0)).unwrap().bounds().unwrap().1;
    assert_eq!(top, DVec3::new(19.5, 8.5, -0.5), "the first frame is turned too");
    let camera = project.camera.unwrap();
    assert!(camera.target.z < 0.0 && camera.eye.y > camera.target.y, "{camera:?}");
    let loaded = input.load(FrameTime::at(1), &project.scene).unwrap();
    assert_eq!(loaded.up, (Up::Z, UpFrom::Guess));

    let name = Some(folder.path().join("w_{}.xyz"));
    let adjustments = Adjustments { up: Some(Up::Y), ..Adjustments::default() };
    let opened = Request { input: name, adjustments, ..Request::default() }.open().unwrap();
    assert!(!opened.loader.is_turned());
    for (text, has_directions) in [
        ("", false),
        ("look = \"night\"", false),
        ("floor = 0", true),
        ("[[light]]\nsun = { direction = [0, -1, 0], irradiance = [1, 1, 1] }", true),
        ("[[solid]]\nshape = \"sphere\"\ncenter = [0, 0, 0]\nradius = 1", true),
        ("[camera]\neye = [0, 0, 1]\ntarget = [0, 0, 0]\nfov_y = 40", true),
        ("[particles]\nradius = 0.5", true),
    ] {
        let scene = Project::parse(text, "scene", Path::new(".")).unwrap();
        let turned = open(&folder).with_project(scene).resolve().unwrap().0.is_turned();
        assert_eq!(turned, !has_directions, "{text}");
    }
    let calm = frames(&[&z_up(|_, _| 9.0)]);
    assert!(!open(&calm).resolve().unwrap().0.is_turned());
}

/// The text of a table with these columns of a block of 8 × 6 × 4 particles, after the columns of the places.
fn table(columns: &str, place: impl Fn([i32; 3]) -> [i32; 3]) -> String {
    let others = columns.split(',').count() - 3;
    let rows = (0..8 * 6 * 4).map(|i| {
        let [x, y, z] = place([i % 8, i / 8 % 6, i / 48]);
        format!("{x},{y},{z}{}\n", ",1".repeat(others))
    });
    format!("{columns}\n{}", rows.collect::<String>())
}

/// The axis that points up is told by the format, the names of arrays or the plane of the particles.
#[test]
fn the_axis_that_points_up_is_told() {
    let its = (Up::Z, UpFrom::Format("DualSPHysics"));
    let block = |place| place;
    let vtk = |array: &str| {
        let places: String =
            (0..64).map(|i| format!("{} {} {}\n", i % 4, i / 4 % 4, i / 16)).collect();
        format!(
            "# vtk DataFile Version 3.0\nPartFluid\nASCII\nDATASET POLYDATA\nPOINTS 64 float\n{places}\
             POINT_DATA 64\nSCALARS {array} float 1\nLOOKUP_TABLE default\n{}",
            "1000\n".repeat(64)
        )
    };
    let cases: [(&str, String, (Up, UpFrom)); 10] = [
        ("paraview.csv", table("Points:0,Points:1,Points:2,Idp,Type", block), its),
        ("part.csv", table("Pos.x [m],Pos.y [m],Pos.z [m],Rhop [kg/m^3]", block), its),
        ("walls.csv", table("Points_0,Points_1,Points_2,Mk", block), its),
        ("partvtk.vtk", vtk("Rhop"), its),
        ("other.vtk", vtk("density"), (Up::Y, UpFrom::Default)),
        ("box.csv", table("x,y,z,type", block), (Up::Y, UpFrom::Default)),
        ("xz.csv", table("x,y,z", |[x, y, z]| [8 * z + x, 0, y]), (Up::Z, UpFrom::Flat)),
        (
            "xz_away.csv",
            table("x,y,z", |[x, y, z]| [900 + x, -7, 4 * y + z]),
            (Up::Z, UpFrom::Flat),
        ),
        ("xy.csv", table("x,y,z", |[x, y, z]| [8 * z + x, y, 3]), (Up::Y, UpFrom::Flat)),
        (
            "line.csv",
            table("x,y,z", |[x, y, z]| [48 * z + 8 * y + x, 0, 0]),
            (Up::Y, UpFrom::Default),
        ),
    ];
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    for (name, text, expected) in &cases {
        std::fs::write(path(name), text).unwrap();
        let resolved = Input::open(path(name).to_str().unwrap()).unwrap().resolve().unwrap().0;
        assert_eq!(resolved.up(), *expected, "{name}");
        assert_eq!(resolved.is_turned(), expected.0 == Up::Z, "{name}");
    }
    let bi4 = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/formats/Part_0005.bi4");
    let bare = Input::open(bi4.to_str().unwrap()).unwrap();
    assert_eq!(bare.resolve().unwrap().0.up(), its);

    // An option goes before a scene, a scene before the format, and the format before the scene's silence.
    let of = |name: &str, up: Option<Up>, scene: &str| {
        std::fs::write(path("scene.toml"), scene.replace("FILE", name)).unwrap();
        let input = Some(path("scene.toml"));
        let adjustments = Adjustments { up, ..Adjustments::default() };
        let opened = Request { input, adjustments, ..Request::default() }.open().unwrap();
        opened.loader.up()
    };
    let silent = "[particles]\nsource = \"FILE\"\nradius = 0.5\n";
    let complete = "[environment]\n[camera]\neye = [9, 9, 9]\ntarget = [0, 0, 0]\nfov_y = 40\n";
    for rest in ["", complete] {
        let silent = format!("{silent}{rest}");
        assert_eq!(of("part.csv", None, &silent), its);
        assert_eq!(of("xz.csv", None, &silent), (Up::Z, UpFrom::Flat));
        assert_eq!(of("part.csv", Some(Up::Y), &silent), (Up::Y, UpFrom::Option));
        let told = silent.replace("radius", "up = \"y\"\nradius");
        assert_eq!(of("part.csv", None, &told), (Up::Y, UpFrom::Scene));
    }
}

/// The camera of the file's own axes sees each place where another program's formulas put it: right and up of the
/// direction of view, by the depth or, for parallel rays, in metres.
fn assert_seen_as(ours: &Camera, own: &Camera, what: &str) {
    let ahead = (own.target - own.eye).normalize();
    let right = ahead.cross(own.up.as_dvec3()).normalize();
    let axes = [right, right.cross(ahead), -ahead];
    let view = limpid::camera::View::from(ours).view_from_world;
    for place in [DVec3::new(0.3, -0.2, 0.1), DVec3::new(0.0, 0.4, 0.7), own.target] {
        let expected = DVec3::from(axes.map(|axis| axis.dot(place - own.eye)));
        let seen = view * (Up::Z.to_y_up(place) - ours.eye);
        assert!(seen.abs_diff_eq(expected, 1e-6), "{what}: {place} at {seen}, not {expected}");
    }
    assert_eq!((ours.lens, ours.near), (own.lens, own.near), "{what}");
}

/// Cameras are in the axes of files with z up, whether given as an option, by a scene or as a path, unless something else
/// is said.
#[test]
fn cameras_count_in_the_axes_of_the_files() {
    let folder = frames(&[&z_up(|x, y| 6.0 + 4.0 * (0.4 * x).sin() + (0.9 * y).cos())]);
    let pattern = folder.path().join("w_{}.xyz");
    let request = Request { input: Some(pattern), ..Request::default() };
    let paraview = "eye=1.2,-1.4,0.8 target=0.25,0.15,0.1 up=0,0,1 fov_y=30";
    let cases = [
        paraview,
        "eye=1.2,-1.4,0.8 target=0.25,0.15,0.1 up=0,0,1 height=2.5",
        "eye=1.2,-1.4,0.8 target=0.25,0.15,0.1 up=0,0.2,1 intrinsics=500,510,320,240 size=640,480",
        "eye=0.5,0.5,9 target=0.5,0.5,0 up=0,1,0 fov_y=30 near=0.1",
        "eye=0.5,-9,0.5 target=0.5,0.5,0.5 fov_y=30",
        "eye=9,3,0.5 target=0.5,0.5,0.5 height=4",
    ];
    for text in cases {
        let mut own = Camera::parse(text).unwrap();
        if !text.contains("up=") {
            own.up = Vec3::Z;
        }
        let given: GivenCamera = text.parse().unwrap();
        let opened = Request { camera: Some(given), ..request.clone() }.open().unwrap();
        assert_eq!((opened.loader.up().0, opened.camera_up), (Up::Z, Up::Z));
        assert_seen_as(&opened.project.camera.unwrap(), &own, text);
        // As before, if that is said.
        let camera_up = Some(Up::Y);
        let told = Request { camera: Some(given), camera_up, ..request.clone() }.open();
        match told {
            Ok(told) => {
                let camera = told.project.camera.unwrap();
                assert_eq!((camera.eye, camera.target), (own.eye, own.target), "{text}");
            }
            // Along the view there.
            Err(error) => assert!(error.to_string().contains("up is along"), "{error}"),
        }
    }
    assert!("eye=0,5,0 target=0,0,0 fov_y=30 up=0,1,0".parse::<GivenCamera>().is_err());

    // By a scene, and by its views. Scenes that limpid wrote have an `up` along y.
    let camera =
        |up: &str| format!("eye = [1.2, -1.4, 0.8]\ntarget = [0.25, 0.15, 0.1]\n{up}fov_y = 30\n");
    let own = Camera::parse(paraview).unwrap();
    for (up, is_own) in [
        ("", true),
        ("up = [0, 0, 1]\n", true),
        ("up = [0, 1, 0]\n", false),
        ("up_axis = \"y\"\n", false),
        ("up = [0, 0, 1]\nup_axis = \"z\"\n", true),
    ] {
        let text = format!(
            "[particles]\nsource = \"{}\"\nup = \"z\"\n[camera]\n{}[[view]]\nname = \"other\"\n[view.camera]\n{}",
            folder.path().join("w_0.xyz").display(),
            camera(up),
            camera(up)
        );
        let scene = Project::parse(&text, "scene", Path::new("")).unwrap();
        let again = Project::parse(&scene.to_toml(None).unwrap(), "again", Path::new("")).unwrap();
        assert_eq!(
            (&again.camera, again.camera_axes, &again.views),
            (&scene.camera, scene.camera_axes, &scene.views)
        );
        let open = |camera_up| {
            let input = Input::from_project(scene.clone(), "scene").unwrap();
            let opened = Request { camera_up, ..Request::default() }.open_from(input).unwrap();
            let cameras = [opened.project.camera.unwrap(), opened.project.views[0].camera];
            assert_eq!(cameras[0], cameras[1]);
            (cameras[0], opened)
        };
        let (found, opened) = open(None);
        match is_own {
            true => assert_seen_as(&found, &own, up),
            false => assert_eq!((found.eye, opened.camera_up), (own.eye, Up::Y), "{up}"),
        }
        // The written project reads back as the same view.
        let written = Project { source: opened.loader.source(), ..opened.project };
        let written = Project::parse(&written.to_toml(None).unwrap(), "w", Path::new("")).unwrap();
        let input = Input::from_project(written, "w").unwrap();
        assert_eq!(input.resolve().unwrap().1.camera, Some(found), "{up}");
        // An option decides.
        let told = if up.contains("0, 1, 0") { Vec3::Y } else { Vec3::Z };
        assert_seen_as(&open(Some(Up::Z)).0, &Camera { up: told, ..own }, up);
    }

    // As a path.
    let path = folder.path().join("path.toml");
    let key = |time: f64, up: &str| format!("[[key]]\ntime = {time}\n{}", camera(up));
    let load = |text: String, told| {
        std::fs::write(&path, text).unwrap();
        CameraPath::load_for(&path, Up::Z, told).unwrap().keys[0].camera
    };
    assert_seen_as(&load(key(0.0, ""), None), &own, "path");
    assert_seen_as(&load(key(0.0, "up = [0, 0, 1]\n"), None), &own, "path");
    assert_eq!(load(key(0.0, "up = [0, 1, 0]\n"), None).eye, own.eye);
    assert_eq!(load(key(0.0, ""), Some(Up::Y)).eye, own.eye);
    let above = Camera { up: -Vec3::Z, ..own };
    let saved = CameraPath { keys: vec![Key { time: 0.0, camera: above }] };
    saved.save(&path).unwrap();
    assert_eq!(CameraPath::load_for(&path, Up::Z, None).unwrap(), saved);
}

/// A camera that sees none of the bulk is told where that is, in the axes in which it was given; one that
/// sees it is not, in parallel projection as well.
#[test]
fn unseen_liquid_is_described_in_the_axes_of_the_camera() {
    let folder = frames(&[&z_up(|x, y| 6.0 + 4.0 * (0.4 * x).sin() + (0.9 * y).cos())]);
    let pattern = folder.path().join("w_{}.xyz");
    let notice = |camera: &str, camera_up| {
        let camera = Some(camera.parse().unwrap());
        let request =
            Request { input: Some(pattern.clone()), camera, camera_up, ..Request::default() };
        let Opened { loader: input, project, camera_up, .. } = request.open().unwrap();
        let loaded = input.load(FrameTime::at(0), &project.scene).unwrap();
        let found =
            notice::of_view(&loaded, &project.camera.unwrap(), UVec2::new(64, 48), camera_up);
        found.map(|notice| notice.to_string())
    };
    for lens in ["fov_y=40", "height=14"] {
        let front = format!("eye=10,-30,4 target=10,4,4 {lens}");
        assert_eq!(notice(&front, None), None, "{lens}");
        let away = format!("eye=10,-30,4 target=10,-60,4 {lens}");
        let line = notice(&away, None).expect("nothing is seen");
        assert!(
            line.contains("around 10,4,")
                && line.contains("19 x 7 x ")
                && line.ends_with("where z is up"),
            "{line}"
        );
        let line = notice(&format!("eye=10,4,30 target=10,4,60 {lens}"), Some(Up::Y));
        let line = line.expect("nothing is seen");
        assert!(line.contains(",-4 m") && line.ends_with("where y is up"), "{line}");
    }
    // Beside a narrow parallel picture.
    assert!(notice("eye=40,-30,4 target=40,4,4 height=14", None).is_some());
}
