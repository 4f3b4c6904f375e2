//! Frames of an input: their radius and view, and what is missing.

use std::path::Path;

use glam::{DVec3, Mat3, UVec2, Vec2, Vec3};
use limpid::camera::CameraUniform;
use limpid::scene::Scene;
use limpid_io::Error;
use limpid_io::input::{FrameTime, Input, Loaded, Loader, Missing};
use limpid_io::particles::ReadOptions;
use limpid_io::project::Project;

use super::{frames, open};

/// Several fluids may come from one file: each is what its condition selects, and has its own radius.
#[test]
fn fluids_of_one_file_are_selected() {
    let folder = tempfile::tempdir().unwrap();
    let row = |i: u8, spacing: f64, of: u8| format!("{},0,0,{of},0\n", f64::from(i) * spacing);
    let rows: Vec<String> =
        (0..9).map(|i| row(i, 0.1, 1)).chain((0..5).map(|i| row(i, 0.4, 2))).collect();
    let text = format!("x,y,z,phase,Type\n{}", rows.concat());
    std::fs::write(folder.path().join("a.csv"), text).unwrap();
    let fluid = |select: &str| {
        format!("[[fluid]]\nsource = \"a.csv\"\nabsorption = [1, 0, 0]\nselect = \"{select}\"\n")
    };
    let scene = folder.path().join("a.toml");
    std::fs::write(&scene, fluid("phase==1") + &fluid("PHASE in 2,3")).unwrap();
    let input = Input::open(scene.to_str().unwrap()).unwrap();
    let (input, project) = input.resolve().unwrap();
    let particles = input.particles(FrameTime::at(0)).unwrap();
    assert_eq!(particles.fluids, Some([vec![0; 9], vec![1; 5]].concat()));
    let radii = particles.radii.unwrap();
    assert!(radii[13] > 2.0 * radii[0], "{radii:?}");
    // A written project is read back.
    let project = Project { source: input.source(), ..project };
    let text = project.to_commented_toml(None).unwrap();
    let read = Project::parse(&text, "b.toml", Path::new("")).unwrap();
    assert_eq!(read.source, project.source);
    assert_eq!(read.source.files()[1].select.to_string(), "PHASE in 2,3");

    std::fs::write(&scene, fluid("phase")).unwrap();
    let error = Input::open(scene.to_str().unwrap()).unwrap_err().to_string();
    assert!(error.contains("line 4") && error.contains("select `phase`: "), "{error}");
    // A command's selection replaces the scene's.
    std::fs::write(&scene, "[particles]\nsource = \"a.csv\"\nselect = \"phase==1\"\n").unwrap();
    let input = Input::open(scene.to_str().unwrap()).unwrap();
    let count = |input: &Input| input.loader.particles(FrameTime::at(0)).unwrap().len();
    assert_eq!(count(&input), 9);
    let options =
        |select: &str| ReadOptions { select: select.parse().unwrap(), ..ReadOptions::default() };
    assert_eq!(count(&input.clone().with_options(&ReadOptions::default())), 9);
    assert_eq!(count(&input.clone().with_options(&options("phase==2"))), 5);
    assert_eq!(count(&input.with_options(&options("all"))), 14);
}

/// Position in the picture of a point relative to the eye: −1 to 1 from edge to edge.
fn seen(view: &CameraUniform, x: Vec3) -> Vec2 {
    let x = Mat3::from_cols_array_2d(&view.view_from_world.map(|[x, y, z, _]| [x, y, z])) * x;
    x.truncate() / -x.z / view.tangent
}

const PAIR: &str = "50.0 1.0 0.0\n50.2 1.0 0.0\n";

/// A file that ends within a line, before text.
const CUT: &str = "0.1 0.2\nnonsense\n";

const CLOSER: &str = "50.0 1.0 0.0\n50.1 1.0 0.0\n";

/// The radius comes from the first frame with particles, as emitters begin with none, and stays, although
/// later frames have another spacing; the view contains the particles of all.
#[test]
fn the_first_nonempty_frame_sets_radius_and_view() {
    let folder = frames(&["", PAIR, CLOSER]);
    let (input, project) = open(&folder).resolve().unwrap();
    for (frame, particles) in input.sequence.frames.iter().zip([0, 2, 2]) {
        let loaded = input.load(frame, &project.scene).unwrap();
        assert_eq!(loaded.particles, particles);
        assert!((loaded.splats.radius - 0.1).abs() < 1e-6, "{}", loaded.splats.radius);
    }
    let target = project.camera.expect("a fitted camera").target;
    assert!(target.abs_diff_eq(DVec3::new(50.1, 1.0, 0.0), 0.05), "{target}");
}

/// Frames that cannot be read, for whatever reason, are errors, left empty or held, and are told; neither radius nor
/// view depends on them. Half-way to a frame that is held, particles stand still.
#[test]
fn unreadable_frames_are_treated_as_missing() {
    let moved = "51.0 1.0 0.0\n51.2 1.0 0.0\n";
    let folder = frames(&[CUT, PAIR, CUT, "", moved]);
    std::fs::remove_file(folder.path().join("w_3.xyz")).unwrap();
    // A picture, and a folder where a file was.
    std::fs::write(folder.path().join("w_5.xyz"), b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR").unwrap();
    std::fs::create_dir(folder.path().join("w_6.xyz")).unwrap();
    let (mut input, project) = open(&folder).resolve().unwrap();
    let target = project.camera.unwrap().target;
    assert!((50.0..51.2).contains(&target.x), "{target}");
    let load = |input: &Loader, number| input.load(FrameTime::at(number), &project.scene);
    for (number, is_damaged) in [(0, true), (1, false), (2, true), (4, false), (5, true), (6, true)]
    {
        assert_eq!(load(&input, number).is_err(), is_damaged, "{number}");
    }
    let told = |loaded: &Loaded| {
        let remarks: Vec<String> = loaded.remarks.iter().map(ToString::to_string).collect();
        remarks.join("; ")
    };
    input.missing = Missing::Empty;
    for (number, particles) in [(0, 0), (1, 2), (2, 0), (3, 0), (4, 2), (5, 0), (6, 0)] {
        let loaded = load(&input, number).unwrap();
        assert_eq!(loaded.particles, particles, "{number}");
        let file = format!("w_{number}.xyz: ");
        let is_told = told(&loaded).contains(&file) && told(&loaded).contains("nothing is shown");
        assert_eq!(is_told, [0, 2, 5, 6].contains(&number), "{number}: {}", told(&loaded));
    }
    input.missing = Missing::Hold;
    for (number, x, shown) in
        [(1, 50.0, None), (2, 50.0, Some(1)), (3, 50.0, Some(1)), (6, 51.0, Some(4))]
    {
        let loaded = load(&input, number).unwrap();
        assert!((loaded.bounds.0.x - x).abs() < 1e-6, "{number}: {}", loaded.bounds.0.x);
        let expected =
            shown.map_or(String::new(), |shown| format!("; frame {shown} is shown in its place"));
        assert!(told(&loaded).ends_with(&expected), "{number}: {}", told(&loaded));
        assert_eq!(loaded.remarks.len(), usize::from(shown.is_some()));
    }
    assert_eq!(load(&input, 0).unwrap().particles, 0, "nothing is before the first");
    let half = FrameTime { frame: 1, next: 2, fraction: 0.5 };
    let still = input.load(half, &project.scene).unwrap();
    assert!((still.bounds.0.x - 50.0).abs() < 1e-6 && still.remarks.len() == 1);

    let folder = frames(&[CUT, CUT]);
    let mut input = open(&folder);
    input.loader.missing = Missing::Hold;
    let error = input.resolve().unwrap_err().to_string();
    assert!(error.contains("w_0.xyz"), "no frame can be read: {error}");
}

/// A piece that a frame's file lists is looked for before any frame is read.
#[test]
fn listed_pieces_are_looked_for_first() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let pieces = |piece: &str| {
        format!(
            "<VTKFile type=\"PUnstructuredGrid\"><PUnstructuredGrid><Piece Source=\"{piece}\"/></PUnstructuredGrid></VTKFile>"
        )
    };
    for name in ["a.xyz", "c.xyz", "d.xyz"] {
        std::fs::write(at(name), PAIR).unwrap();
    }
    std::fs::write(at("b.pvtu"), pieces("b_0.vtu")).unwrap();
    let listed = |files: &[&str]| {
        let sets: Vec<String> = (0..)
            .zip(files)
            .map(|(time, file)| format!("<DataSet timestep=\"{time}\" file=\"{file}\"/>"))
            .collect();
        let list = format!(
            "<VTKFile type=\"Collection\"><Collection>{}</Collection></VTKFile>",
            sets.concat()
        );
        std::fs::write(at("all.pvd"), list).unwrap();
        Input::open(at("all.pvd")).unwrap().loader
    };
    let all = [0, 1, 2].map(FrameTime::at);
    assert!(listed(&["a.xyz", "c.xyz", "d.xyz"]).check_files(&all).is_ok());
    let mut input = listed(&["a.xyz", "c.xyz", "b.pvtu"]);
    let error = input.check_files(&all).unwrap_err();
    assert!(matches!(error, Error::MissingFrames { .. }), "{error}");
    assert!(error.to_string().contains("b_0.vtu") && error.to_string().contains("all.pvd"));
    assert!(input.check_files(&all[..2]).is_ok(), "of the frames that are drawn");
    input.missing = Missing::Hold;
    assert!(input.check_files(&all).is_ok());
    let loaded = input.load(FrameTime::at(2), &Scene::default()).unwrap();
    assert_eq!(loaded.particles, 2, "held");
}

/// A scene without a camera gets one camera for all frames, which sees the first and the last.
#[test]
fn a_scene_without_a_camera_gets_one_for_all_frames() {
    let folder = frames(&[PAIR, "0.0 0.0 0.0\n1.0 0.0 0.0\n"]);
    let scene = Project::parse("", "empty", Path::new(".")).unwrap();
    let (_, project) = open(&folder).with_project(scene).resolve().unwrap();
    let camera = project.camera.expect("a fitted camera");
    let size = UVec2::new(1024, 768);
    let view = camera.uniform(size, camera.eye);
    for x in [DVec3::ZERO, DVec3::new(50.2, 1.0, 0.0)] {
        let at = seen(&view, (x - camera.eye).as_vec3());
        assert!(at.abs().max_element() < 1.0, "{x} is at {at}");
    }
}

/// Empty frames are drawn; a single particle without a radius is an error.
#[test]
fn empty_frames_and_single_particles() {
    let folder = frames(&["", ""]);
    let (input, project) = open(&folder).resolve().unwrap();
    assert_eq!(input.load(&input.sequence.frames[0], &project.scene).unwrap().particles, 0);

    let folder = frames(&["1.0 2.0 3.0\n"]);
    let error = open(&folder).resolve().unwrap_err();
    assert!(matches!(error, Error::UnknownRadius { .. }), "{error}");
    let (input, project) = open(&folder).with_radius(0.5).unwrap().resolve().unwrap();
    assert_eq!(input.load(&input.sequence.frames[0], &project.scene).unwrap().splats.radius, 0.5);
}

/// A scene's frame number is kept if the pattern matches only another frame.
#[test]
fn a_missing_frame_is_not_replaced_by_another() {
    let folder = frames(&[PAIR]);
    let text = "[particles]\nsource = \"w_{}.xyz\"\nframe = 7\n";
    std::fs::write(folder.path().join("scene.toml"), text).unwrap();
    let input = Input::open(folder.path().join("scene.toml").to_str().unwrap()).unwrap().loader;
    assert_eq!(input.frame, Some(7));
    assert!(input.sequence.frame(7).is_none());
}

/// Particles given with a scene that names others use the radius and the up axis of the scene.
#[test]
fn a_scene_sets_radius_and_up_axis() {
    let folder = frames(&["0.0 1.0 2.0\n5.0 1.0 2.0\n"]);
    let text = "[particles]\nsource = \"other.xyz\"\nradius = 0.25\nup = \"z\"\n";
    let scene = Project::parse(text, "scene", Path::new(".")).unwrap();
    let (input, project) = open(&folder).with_project(scene).resolve().unwrap();
    let frame = &input.sequence.frames[0];
    assert_eq!(input.load(frame, &project.scene).unwrap().splats.radius, 0.25);
    assert_eq!(input.particles(frame).unwrap().positions[0], Vec3::new(0.0, 2.0, -1.0));
    assert!(matches!(open(&folder).with_radius(-1.0), Err(Error::Usage(_))));
}
