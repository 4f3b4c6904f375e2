//! The radius and the view of a sequence: one of each for all frames, whatever its first frames contain
//! and however its frames are distributed.

#[allow(dead_code, reason = "only the generator is used")]
#[path = "../../../tests/support/mod.rs"]
mod support;

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Mat3, UVec2, Vec2, Vec3};
use limpid::camera::CameraUniform;
use limpid::environment::Environment;
use limpid::liquid::{Particles, Up};
use limpid::look::Look;
use limpid::scene::{Light, Scene};
use limpid_io::Error;
use limpid_io::adjustments::{Adjustments, Sun};
use limpid_io::input::{FrameTime, Input};
use limpid_io::open::Request;
use limpid_io::project::Project;
use support::Random;
use tempfile::TempDir;

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

/// Position in the picture of a point relative to the eye: −1 to 1 from edge to edge.
fn seen(view: &CameraUniform, x: Vec3) -> Vec2 {
    let x = Mat3::from_cols_array_2d(&view.view_from_world.map(|[x, y, z, _]| [x, y, z])) * x;
    x.truncate() / -x.z / view.tangent
}

const PAIR: &str = "50.0 1.0 0.0\n50.2 1.0 0.0\n";
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
    let input = Input::open(folder.path().join("scene.toml").to_str().unwrap()).unwrap();
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
    assert!(loaded.turned);

    let name = Some(folder.path().join("w_{}.xyz").to_str().unwrap().to_owned());
    let adjustments = Adjustments { up: Some(Up::Y), ..Adjustments::default() };
    let opened = Request { input: name, adjustments, ..Request::default() }.open().unwrap();
    assert!(!opened.input.is_turned());
    let scene = Project::parse("", "empty", Path::new(".")).unwrap();
    assert!(!open(&folder).with_project(scene).resolve().unwrap().0.is_turned());
    let calm = frames(&[&z_up(|_, _| 9.0)]);
    assert!(!open(&calm).resolve().unwrap().0.is_turned());
}

/// Another sky is that of its look, with the scene's own sun in it; light and ground stay.
#[test]
fn sky_is_replaced_alone() {
    let folder = frames(&[&z_up(|_, _| 9.0)]);
    let name = folder.path().join("w_0.xyz").to_str().unwrap().to_owned();
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
        assert_eq!(given.input.is_turned(), up == Up::Z);
        assert_eq!(given.input.is_turned(), file.input.is_turned());
        assert_eq!(given.project.camera, file.project.camera);
        assert_eq!(given.project.scene, file.project.scene);
        let load = |input: &Input| input.load(FrameTime::at(0), &file.project.scene).unwrap();
        let (a, b) = (load(&given.input), load(&file.input));
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
    opened.input.load(FrameTime::at(7), &opened.project.scene).unwrap();
    assert_eq!(Arc::strong_count(&particles), before);
    drop(opened);
    assert_eq!(Arc::strong_count(&particles), 1);
}
