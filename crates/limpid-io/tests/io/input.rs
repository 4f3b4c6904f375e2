//! The radius and the view of a sequence: one of each for all frames, whatever its first frames contain
//! and however its frames are distributed.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Mat3, UVec2, Vec2, Vec3};
use limpid::camera::{Camera, CameraUniform};
use limpid::environment::Environment;
use limpid::liquid::{Particles, Up};
use limpid::look::Look;
use limpid::scene::{Light, Scene};
use limpid_io::Error;
use limpid_io::adjustments::{Adjustments, Sun};
use limpid_io::camera_axes::GivenCamera;
use limpid_io::camera_path::{CameraPath, Key};
use limpid_io::input::{FrameTime, Input, Loaded, Loader, Missing, UpFrom};
use limpid_io::notice;
use limpid_io::open::{Opened, Request};
use limpid_io::particles::ReadOptions;
use limpid_io::project::Project;
use tempfile::TempDir;

use crate::support::Random;

/// A folder of `.xyz` frames, numbered from 0.
fn frames(contents: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (number, text) in contents.iter().enumerate() {
        std::fs::write(folder.path().join(format!("w_{number}.xyz")), text).unwrap();
    }
    folder
}

fn open(folder: &TempDir) -> Input {
    Input::open(folder.path().join("w_{}.xyz").to_str().unwrap()).unwrap()
}

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
    // What is written is read back.
    let project = Project { source: input.source(), ..project };
    let text = project.to_commented_toml(None).unwrap();
    let read = Project::parse(&text, "b.toml", Path::new("")).unwrap();
    assert_eq!(read.source, project.source);
    assert_eq!(read.source.files()[1].select.to_string(), "PHASE in 2,3");

    std::fs::write(&scene, fluid("phase")).unwrap();
    let error = Input::open(scene.to_str().unwrap()).unwrap_err().to_string();
    assert!(error.contains("line 4") && error.contains("select `phase`: "), "{error}");
    // What a command selects replaces what the scene does.
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

/// A jittered block of 20³ particles with a spacing of 0.05 m, so 1 m wide.
fn block(random: &mut Random) -> Vec<Vec3> {
    let along = || (0..20).map(|i| 0.05 * f64::from(i));
    let lattice = along().flat_map(|x| along().flat_map(move |y| along().map(move |z| (x, y, z))));
    lattice.map(|at| (DVec3::from(at) + 0.01 * random.direction()).as_vec3()).collect()
}

/// Escaped particles do not affect the view: the bounds of the bulk are bit-identical to those without
/// them, and they are counted.
#[test]
fn escaped_particles_are_outside_the_bulk() {
    let mut random = Random(1);
    let cloud = block(&mut random);
    let whole = Particles::from_positions(cloud.clone()).bulk().unwrap();
    for (escaped, distance) in [1, 8, 10].into_iter().flat_map(|n| [10.0, 1e3, 1e6].map(|d| (n, d)))
    {
        let mut places = cloud.clone();
        // At the front, since the order in the file must not matter.
        let lost = (0..escaped).map(|_| (distance * random.direction()).as_vec3() + 0.5);
        places.splice(0..0, lost);
        let bulk = Particles::from_positions(places).bulk().unwrap();
        assert_eq!(bulk.outside, escaped, "at {distance}");
        assert_eq!(bulk.bounds, whole.bounds, "{escaped} at {distance}");
    }
}

/// Without escaped particles, the bounds of the bulk are those of all particles: of a compact cloud
/// with outliers, two distant bodies, a body with a thin jet, and a few particles.
#[test]
fn compact_and_separate_bodies_are_in_the_bulk() {
    let mut random = Random(2);
    let cloud = block(&mut random);
    let far = Vec3::new(0.0, 60.0, 0.0);
    let bodies = [cloud.clone(), cloud[..800].iter().map(|&x| x + far).collect()].concat();
    // A row of 75 particles, less than 1 % of all.
    let jet = (1..=75).map(|i| Vec3::new(0.5, 1.0 + 0.05 * i as f32, 0.5));
    let jet = cloud.iter().copied().chain(jet).collect();
    // Normally distributed: the sum of uniform numbers.
    let mut normal = || (0..12).map(|_| random.unit()).sum::<f64>() as f32;
    let gaussian = (0..5000).map(|_| Vec3::new(normal(), normal(), normal())).collect();
    let few = vec![Vec3::ZERO, Vec3::splat(0.1), Vec3::new(40.0, 0.0, 0.0)];
    let cases: [(&str, Vec<Vec3>); 5] = [
        ("cloud", gaussian),
        ("two bodies", bodies),
        ("jet", jet),
        ("few", few),
        ("one place", vec![Vec3::ONE; 100]),
    ];
    for (name, places) in cases {
        let particles = Particles::from_positions(places);
        let bulk = particles.bulk().unwrap();
        assert_eq!((Some(bulk.bounds), bulk.outside), (particles.bounds(), 0), "{name}");
    }
    assert_eq!(Particles::default().bulk(), None);
}

/// Parked particles have no influence on view, floor, radius and tint, are named with their number and place in the
/// axes of the file, and bring no advice about units.
#[test]
fn parked_particles_are_named_and_left_out() {
    let whole = block(&mut Random(7));
    let parked = |count: usize, place: Vec3| vec![place; count];
    // As dense as liquid of another spacing.
    let lattice = (0..3000)
        .map(|i| Vec3::new(900.0 + 0.01 * (i % 50) as f32, 0.01 * (i / 50) as f32, -900.0));
    let cases: [(&str, Vec<Vec3>, &str); 4] = [
        (
            "a clump",
            parked(80, Vec3::splat(1000.0)),
            "80 of the particles are far from all others, at 1000,1000,1000 m,",
        ),
        (
            "a third",
            parked(4000, Vec3::new(0.0, 0.0, -5e4)),
            "4,000 of the particles are far from all others, at 0,0,-50000 m,",
        ),
        (
            "a lattice",
            lattice.collect(),
            "3,000 of the particles are far from all others, from 900,0,-900 to",
        ),
        (
            "one",
            parked(1, Vec3::new(1e6, 0.5, 0.5)),
            "1 of the particles is far from all others, at 1000000,",
        ),
    ];
    let load = |places: Vec<Vec3>| {
        let given = Input::from_particles(Arc::new(Particles::from_positions(places)), "given");
        let opened = Request::default().open_from(given).unwrap();
        let loaded = opened.loader.load(FrameTime::at(0), &opened.project.scene).unwrap();
        let notices = notice::of_frame(&loaded, &opened.project.scene);
        (opened, notices.iter().map(ToString::to_string).collect::<Vec<_>>())
    };
    let (expected, none) = load(whole.clone());
    assert_eq!(none, [""; 0]);
    for (name, others, line) in cases {
        let (opened, notices) = load([others, whole.clone()].concat());
        assert_eq!(notices.len(), 1, "{name}: {notices:?}");
        assert!(notices[0].starts_with(line), "{name}: {}", notices[0]);
        let (found, expected) = (opened.loader.body().unwrap(), expected.loader.body().unwrap());
        assert_eq!(found.bounds, expected.bounds, "{name}");
        assert!((found.radius / expected.radius - 1.0).abs() < 0.02, "{name}: {}", found.radius);
    }
}

/// In a sequence without velocities what is at the same places in the first frame and the last waits, though it is heavier
/// and near enough to be another body; two bodies that both move are shown.
#[test]
fn frames_tell_what_waits() {
    let whole = block(&mut Random(9));
    let twice = whole.iter().flat_map(|&x| [x, x + Vec3::Z]);
    let beside: Vec<_> = twice.map(|x| x + Vec3::new(0.0, 20.0, 3.0)).collect();
    let open = |still: bool| {
        let folder = tempfile::tempdir().unwrap();
        for frame in 0..5 {
            let moved = 0.01 * frame as f32 * Vec3::X;
            let by = if still { Vec3::ZERO } else { moved };
            let places = beside.iter().map(|&x| x + by).chain(whole.iter().map(|&x| x + moved));
            let particles = Particles::from_positions(places.collect());
            let path = folder.path().join(format!("w_{frame}.npy"));
            limpid_io::particles::write(&particles, &path).unwrap();
        }
        let input = Input::open(folder.path().join("w_{}.npy").to_str().unwrap()).unwrap();
        let (input, project) = input.with_radius(0.025).unwrap().resolve().unwrap();
        let loaded = input.load(FrameTime::at(2), &project.scene).unwrap();
        (input.body().unwrap().bounds, loaded.bulk.outside)
    };
    let (bounds, outside) = open(true);
    assert!(bounds.1.y < 1.1 && outside == beside.len(), "{bounds:?}, {outside} outside");
    let (bounds, outside) = open(false);
    assert!(bounds.1.y > 20.0 && outside == 0, "{bounds:?}, {outside} outside");
}

/// What waits at rest while the rest moves is left out by the lights too, though it is as dense as liquid, heavier and near
/// enough to be another body.
#[test]
fn lights_see_what_moves() {
    let whole = block(&mut Random(8));
    let twice = whole.iter().flat_map(|&x| [x, x + Vec3::Z]);
    let waiting: Vec<_> = twice.map(|x| x + Vec3::new(20.0, 0.0, 0.0)).collect();
    let lit = |still: &[Vec3]| {
        let mut particles = Particles::from_positions([still, &whole].concat());
        let velocity = |i: usize| if i < still.len() { Vec3::ZERO } else { Vec3::X };
        particles.velocities = Some((0..particles.len()).map(velocity).collect());
        let given = Input::from_particles(Arc::new(particles), "given").with_radius(0.025).unwrap();
        let opened = Request::default().open_from(given).unwrap();
        let loaded = opened.loader.load(FrameTime::at(0), &opened.project.scene).unwrap();
        let views = limpid::lights::views(&opened.project.scene, &loaded.splats);
        (views, loaded.bulk.bounds, loaded.bulk.outside)
    };
    let (alone, beside) = (lit(&[]), lit(&waiting));
    assert!(alone.0.iter().all(Option::is_some));
    assert_eq!((beside.0, beside.1), (alone.0, alone.1));
    assert_eq!((alone.2, beside.2), (0, waiting.len()));
}

/// The view and the floor of a file without a scene come from the bulk of the first frame.
#[test]
fn an_escaped_particle_does_not_change_view_and_floor() {
    let places = block(&mut Random(3));
    let escaped = [places.clone(), vec![Vec3::new(3.0, -1e6, 0.0)]].concat();
    let [whole, escaped] = [places, escaped].map(|places| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bgeo");
        limpid_io::particles::write(&Particles::from_positions(places), &path).unwrap();
        let input = Input::open(path.to_str().unwrap()).unwrap().with_radius(0.025).unwrap();
        let (input, project) = input.resolve().unwrap();
        (input.load(&input.sequence.frames[0], &project.scene).unwrap(), project)
    });
    assert_eq!(escaped.1.camera, whole.1.camera);
    assert_eq!(escaped.1.scene.solids, whole.1.scene.solids);
    assert_eq!((escaped.0.bulk.outside, whole.0.bulk.outside), (1, 0));
    assert_eq!(escaped.0.bulk.bounds, whole.0.bounds);
    assert_eq!(escaped.0.bounds.0.y, -1e6);
}

/// Text of a body of 20 × 8 × 12 particles on the level z = 0, which ends at a height; z is up.
fn z_up(height: impl Fn(f32, f32) -> f32) -> String {
    let all = (0..20 * 8 * 12).map(|i| [i % 20, i / 20 % 8, i / 160].map(|i| i as f32 + 0.5));
    let within = all.filter(|&[x, y, z]| z < height(x, y));
    within.map(|[x, y, z]| format!("{x} {y} {z}\n")).collect()
}

/// Without a scene z is up if a frame shows that, be it a later one; the view follows. `--up` and a scene
/// decide against it.
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
    let scene = Project::parse("", "empty", Path::new(".")).unwrap();
    assert!(!open(&folder).with_project(scene).resolve().unwrap().0.is_turned());
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
        // What is written of it reads back as the same view.
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

/// Another sky is that of its look, with the scene's own sun in it; light and ground stay.
#[test]
fn sky_is_replaced_alone() {
    let folder = frames(&[&z_up(|_, _| 9.0)]);
    let name = folder.path().join("w_0.xyz");
    let scene = |adjustments: Adjustments| {
        let request = Request { input: Some(name.clone()), adjustments, ..Request::default() };
        request.open().unwrap().project.scene
    };
    let (studio, night) = (Some(Look::Studio), Some(Look::Night));
    let sun = Some(Sun::At { azimuth: 90.0, elevation: 30.0 });
    let changed = scene(Adjustments { look: studio, sky: night, sun, ..Adjustments::default() });
    let of_studio = scene(Adjustments { look: studio, sun, ..Adjustments::default() });
    let of_night = scene(Adjustments { look: night, sun, ..Adjustments::default() });
    assert_eq!(changed.environment, of_night.environment);
    assert_eq!(changed, Scene { environment: of_night.environment, ..of_studio });

    // A sun of the scene's own.
    let chart =
        scene(Adjustments { look: studio, sky: Some(Look::Chart), ..Adjustments::default() });
    assert!(matches!(chart.environment, Environment::Gradient { .. }));
    let turned = scene(Adjustments { sky: night, ..Adjustments::default() });
    let Environment::Sky { glows, .. } = turned.environment else { panic!("no sky") };
    let Light::Sun { direction, .. } = turned.lights[0] else { panic!("no sun") };
    assert_eq!(glows[0].direction, -direction);
}

/// Particles of the caller are drawn as those of a file: with the same radius, axis, scene and splats.
#[test]
fn given_particles_are_those_of_a_file() {
    let mut random = Random(5);
    for up in [Up::Y, Up::Z] {
        // A wedge on a level floor, so that the axis can be guessed.
        let cells = (0..24 * 24 * 12).map(|i| [i % 24, i / 24 % 24, i / 576]);
        let wedge = cells.filter(|[x, _, z]| 2 * z <= *x);
        let grid = wedge.map(|cell| cell.map(|k| 0.1 * k as f32));
        let jitter = |x: f32, random: &mut Random| x + 0.01 * random.unit() as f32;
        let places = grid.map(|[x, y, z]| {
            let [x, y, z] = [x, y, z].map(|x| jitter(x, &mut random));
            if up == Up::Z { Vec3::new(x, y, z) } else { Vec3::new(x, z, y) }
        });
        let particles = Particles::from_positions(places.collect());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pool.npz");
        limpid_io::particles::write(&particles, &path).unwrap();
        let request = Request::default();
        let file = request.open_from(Input::open(path.to_str().unwrap()).unwrap()).unwrap();
        let given = Input::from_particles(Arc::new(particles), "positions");
        let given = request.open_from(given).unwrap();
        assert_eq!(given.loader.is_turned(), up == Up::Z);
        assert_eq!(given.loader.is_turned(), file.loader.is_turned());
        assert_eq!(given.project.camera, file.project.camera);
        assert_eq!(given.project.scene, file.project.scene);
        let load = |input: &Loader| input.load(FrameTime::at(0), &file.project.scene).unwrap();
        let (a, b) = (load(&given.loader), load(&file.loader));
        assert_eq!((&a.splats, a.particles, a.bounds), (&b.splats, b.particles, b.bounds));
    }
}

/// Particles that need not be turned are shared, not copied.
#[test]
fn given_particles_are_shared() {
    let particles = Arc::new(Particles::from_positions(vec![Vec3::ZERO, Vec3::X]));
    let input = Input::from_particles(particles.clone(), "positions");
    let opened = Request { radius: Some(0.5), ..Request::default() }.open_from(input).unwrap();
    let before = Arc::strong_count(&particles);
    assert!(before > 1);
    opened.loader.load(FrameTime::at(7), &opened.project.scene).unwrap();
    assert_eq!(Arc::strong_count(&particles), before);
    drop(opened);
    assert_eq!(Arc::strong_count(&particles), 1);
}
