//! Camera paths and turntables against closed forms, and the list of a film's pictures.

use std::path::Path;

use glam::{DVec3, Vec3};
use limpid::camera::Camera;
use limpid::liquid::Up;
use limpid_io::Error;
use limpid_io::camera_path::{CameraPath, Key, load_views};
use limpid_io::film::{Motion, Shot, shots};

/// Unevenly spaced times of keys.
const TIMES: [f64; 6] = [0.0, 0.25, 2.0, 2.1, 3.5, 7.0];

fn camera(eye: DVec3, target: DVec3) -> Camera {
    Camera { eye, target, up: Vec3::Y, fov_y: 40.0, near: None, lens: None }
}

fn path(keys: impl IntoIterator<Item = (f64, Camera)>) -> CameraPath {
    let keys = keys.into_iter().map(|(time, camera)| Key { time, camera });
    let path = CameraPath { keys: keys.collect() };
    path.check().expect("a good path");
    path
}

/// An irregular path.
fn irregular() -> CameraPath {
    path((0..).zip(TIMES).map(|(i, time)| {
        let x = f64::from(i);
        let eye = DVec3::new((3.0 * x).sin() * 4.0, 2.0 + (5.0 * x).cos(), 6.0 + (7.0 * x).sin());
        let target = DVec3::new((2.0 * x).cos(), (9.0 * x).sin(), -(x * 0.3));
        let up = Vec3::new(0.3 * (x as f32).sin(), 1.0, 0.2 * (x as f32).cos());
        (
            time,
            Camera {
                eye,
                target,
                up,
                fov_y: 40.0 + 10.0 * (4.0 * x as f32).sin(),
                near: None,
                lens: None,
            },
        )
    }))
}

/// Times before, between and after the keys.
fn times() -> impl Iterator<Item = f64> {
    (-10..=80).map(|i| f64::from(i) * 0.1 + 0.013)
}

#[track_caller]
fn assert_near(a: DVec3, b: DVec3, tolerance: f64) {
    assert!(a.distance(b) <= tolerance, "{a} is {} from {b}", a.distance(b));
}

/// A path passes exactly through its keys, and is constant before the first and after the last.
#[test]
fn a_path_passes_through_its_keys_and_is_constant_outside() {
    let path = irregular();
    for key in &path.keys {
        assert_eq!(path.at(key.time), key.camera);
    }
    assert_eq!(path.at(-1e300), path.keys[0].camera);
    assert_eq!(path.at(f64::NAN), path.keys[0].camera);
    assert_eq!(path.at(1e300), path.keys[5].camera);
    let one = CameraPath { keys: path.keys[2..3].to_vec() };
    assert_eq!([0.0, 2.0, 9.0].map(|time| one.at(time)), [one.keys[0].camera; 3]);
    assert_eq!((path.duration(), one.duration()), (7.0, 2.0));
}

/// Two keys are joined by a straight line at constant velocity.
#[test]
fn two_keys_are_a_straight_line() {
    let (a, b) = (DVec3::new(1.0, 2.0, 9.0), DVec3::new(-5.0, 3.0, 4.0));
    let path = path([(1.0, camera(a, DVec3::ZERO)), (4.0, camera(b, DVec3::X))]);
    for time in times() {
        let u = ((time - 1.0) / 3.0).clamp(0.0, 1.0);
        let camera = path.at(time);
        assert_near(camera.eye, a.lerp(b, u), 1e-14);
        assert_near(camera.target, DVec3::X * u, 1e-15);
        assert_eq!((camera.up, camera.fov_y), (Vec3::Y, 40.0));
    }
}

/// Uniform and uniformly accelerated motion are reproduced exactly at any spacing of the keys in time.
/// Tangents that ignore the times fail this at the first short interval.
#[test]
fn lines_and_parabolas_in_time_are_exact() {
    let eye = |t: f64| DVec3::new(1.0 + 2.0 * t, 3.0 - 0.5 * t, 8.0 + 0.4 * t * t - 0.1 * t);
    let target = |t: f64| DVec3::new(0.1 * t, -0.2 * t, 0.0);
    let up = |t: f64| Vec3::new(0.1 * t as f32, 1.0, 0.0);
    let fov_y = |t: f64| 30.0 + 2.0 * t as f32;
    let path = path(TIMES.map(|t| {
        (
            t,
            Camera {
                eye: eye(t),
                target: target(t),
                up: up(t),
                fov_y: fov_y(t),
                near: None,
                lens: None,
            },
        )
    }));
    for time in times() {
        let held = time.clamp(0.0, 7.0);
        let camera = path.at(time);
        assert_near(camera.eye, eye(held), 1e-13);
        assert_near(camera.target, target(held), 1e-14);
        assert!(camera.up.distance(up(held)) < 1e-6);
        assert!((camera.fov_y - fov_y(held)).abs() < 1e-4);
    }
}

/// Position and velocity are continuous at the keys.
#[test]
fn position_and_velocity_are_continuous() {
    /// Relative change of the velocity at `time`.
    fn velocity_jump(at: impl Fn(f64) -> DVec3, time: f64) -> f64 {
        let h = 1e-5;
        let [before, here, after] = [-h, 0.0, h].map(|dt| at(time + dt));
        let (left, right) = ((here - before) / h, (after - here) / h);
        left.distance(right) / (1.0 + left.length())
    }
    let path = irregular();
    // The measure detects the kinks of a polygon through the same keys.
    let polygon = |time: f64| {
        let i = path.keys.partition_point(|key| key.time <= time).clamp(1, TIMES.len() - 1);
        let (a, b) = (path.keys[i - 1], path.keys[i]);
        a.camera.eye.lerp(b.camera.eye, (time - a.time) / (b.time - a.time))
    };
    for time in &TIMES[1..5] {
        assert!(velocity_jump(|t| path.at(t).eye, *time) < 0.01);
        assert!(velocity_jump(|t| path.at(t).target, *time) < 0.01);
        assert!(velocity_jump(polygon, *time) > 0.1);
    }
}

/// A path far from the world's origin keeps its precision.
#[test]
fn a_path_far_from_the_origin_is_precise() {
    let near = irregular();
    let offset = DVec3::new(6.4e6, -1e6, 2e6);
    let keys = near.keys.iter().map(|key| {
        let Camera { eye, target, .. } = key.camera;
        (key.time, Camera { eye: eye + offset, target: target + offset, ..key.camera })
    });
    let far = path(keys);
    for time in times() {
        let (near, far) = (near.at(time), far.at(time));
        // A few times the spacing of 64-bit numbers there, 1e-9.
        assert_near(far.eye - far.target, near.eye - near.target, 2e-8);
    }
}

/// Every camera of a path defines a view, whatever the keys; the renderer refuses others.
#[test]
fn no_camera_on_a_path_is_degenerate() {
    let opposite = |up| Camera { up, ..camera(DVec3::Z, DVec3::ZERO) };
    let wide = |fov_y| Camera { fov_y, ..camera(DVec3::Z, DVec3::ZERO) };
    let paths = [
        // Straight through the target, half-way.
        path([(0.0, camera(DVec3::Z, DVec3::ZERO)), (2.0, camera(DVec3::NEG_Z, DVec3::ZERO))]),
        // Over the top, where the view direction is parallel to up.
        path([
            (0.0, camera(DVec3::new(-1.0, 1.0, 0.0), DVec3::ZERO)),
            (2.0, camera(DVec3::new(1.0, 1.0, 0.0), DVec3::ZERO)),
        ]),
        // Up reverses through zero.
        path([(0.0, opposite(Vec3::Y)), (2.0, opposite(Vec3::NEG_Y))]),
        // Overshoots 180 and 0 degrees.
        path([(0.0, wide(1.0)), (0.1, wide(179.0)), (2.0, wide(179.0)), (2.1, wide(0.5))]),
        // Velocities beyond the range of numbers.
        path([
            (0.0, camera(DVec3::Z, DVec3::ZERO)),
            (1e-320, camera(DVec3::Z * 1e17, DVec3::ZERO)),
            (2.0, camera(DVec3::Y + DVec3::Z, DVec3::ZERO)),
        ]),
    ];
    for (number, path) in paths.iter().enumerate() {
        for i in 0..=2100 {
            let time = f64::from(i) * 1e-3;
            let camera = path.at(time);
            camera.check().unwrap_or_else(|e| panic!("path {number} at {time} s: {e}: {camera:?}"));
        }
    }
    // The valid parts are kept: the position of the eye, and the keys' directions.
    let through = paths[0].at(1.0);
    assert_eq!((through.eye, through.up), (DVec3::ZERO, Vec3::Y));
    assert_near(through.target.normalize().abs(), DVec3::Z, 1e-12);
    let top = paths[1].at(1.0);
    assert_eq!((top.eye, top.target), (DVec3::Y, DVec3::ZERO));
    assert_eq!(paths[2].at(1.0).up.abs(), Vec3::Y);
}

/// A saved path, as from the viewer, is loaded bit-identically.
#[test]
fn a_saved_path_is_loaded_bit_identically() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("path.toml");
    let mut path = irregular();
    path.keys[0].camera.near = Some(0.1);
    path.keys[1].camera.eye.x = -0.0;
    path.keys[2].camera.eye.y = 1e-300;
    path.keys[3].camera.target.z = 1.0 / 3.0 * 1e17;
    path.keys[4].camera.fov_y = 0.1 + 0.2;
    path.save(&file).unwrap();
    let read = CameraPath::load(&file).unwrap();
    // Compared as text, since −0 equals 0.
    assert_eq!(format!("{read:?}"), format!("{path:?}"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// The defaults of a key's optional fields, and integers in place of floats.
#[test]
fn a_key_needs_time_eye_and_target() {
    let path = load("[[key]]\ntime = 1\neye = [0, 1, 4]\ntarget = [0, 1.5, 0]").unwrap();
    let camera = camera(DVec3::new(0.0, 1.0, 4.0), DVec3::new(0.0, 1.5, 0.0));
    assert_eq!(path.keys, [Key { time: 1.0, camera }]);
}

fn load(text: &str) -> Result<CameraPath, Error> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("path.toml");
    std::fs::write(&file, text).unwrap();
    CameraPath::load(&file)
}

/// The error of a bad path names the file, the line or key, and the cause.
#[test]
fn errors_name_file_key_and_cause() {
    let key = |time: &str, rest: &str| {
        let rest = if rest.is_empty() { "eye = [0, 0, 1]\ntarget = [0, 0, 0]" } else { rest };
        format!("[[key]]\ntime = {time}\n{rest}\n")
    };
    let same = "eye = [1, 2, 3]\ntarget = [1, 2, 3]";
    let up = "eye = [0, 0, 1]\ntarget = [0, 0, 0]\nup = [0, 0, 2]";
    let wide = "eye = [0, 0, 1]\ntarget = [0, 0, 0]\nfov_y = 180";
    let cases = [
        (String::new(), "[[key]]: none"),
        (key("nan", ""), "[[key]] 1: a time of NaN"),
        (key("inf", ""), "[[key]] 1: a time of inf"),
        (key("1", "") + &key("1", ""), "[[key]] 2: 1 s does not come after"),
        (key("1", "") + &key("2", "") + &key("-1", ""), "[[key]] 3: -1 s does not come after"),
        (key("0", same), "[[key]] 1: eye and target are the same point"),
        (key("0", up), "[[key]] 1: up is along the view direction"),
        (key("0", "") + &key("1", wide), "[[key]] 2: fov_y must be"),
        (key("0", "eye = [0, 0, inf]\ntarget = [0, 0, 0]"), "[[key]] 1: eye, target and up"),
        (key("0", "eye = [0, 0, 1]"), "line 1: missing field `target`"),
        (key("0", "eye = [0, 0, 1]\ntargets = [0, 0, 0]"), "did you mean `target`?"),
        (key("0", "eye = [0, 0]\ntarget = [0, 0, 0]"), "line 3"),
        ("[[keys]]\n".into(), "did you mean `key`?"),
        ("[[key]]\ntime = \n".into(), "line 2"),
    ];
    for (text, expected) in cases {
        let error = load(&text).expect_err(&text);
        assert!(matches!(error, Error::Scene { .. }), "{error:?}");
        let error = error.to_string();
        assert!(error.contains(expected), "`{expected}` is missing in: {error}");
        assert!(error.contains("path.toml: "), "{error}");
    }
    let error = CameraPath::load(Path::new("nowhere/path.toml")).unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error:?}");
    let mut path = irregular();
    path.keys.swap(1, 2);
    let folder = tempfile::tempdir().unwrap();
    path.save(&folder.path().join("path.toml")).expect_err("an unreadable path");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

// ------------------------------------------------------------------------------- turntable

/// A turned camera rotates about its up axis, keeps its distance, and returns after a full turn.
#[test]
fn turned_cameras_keep_their_distance_and_return() {
    let turn = std::f64::consts::TAU;
    let east = camera(DVec3::new(1.0, 3.0, 2.0) + DVec3::X * 4.0, DVec3::new(1.0, 2.0, 2.0));
    // Counter-clockwise from above: x goes to −z.
    let quarter = east.turned(0.25 * turn);
    assert_near(quarter.eye, DVec3::new(1.0, 3.0, -2.0), 1e-15);
    assert_eq!((quarter.target, quarter.up), (east.target, east.up));
    assert_eq!(east.turned(0.0), east);
    for offset in [DVec3::ZERO, DVec3::new(6.4e6, 1e6, -3e6)] {
        for up in [Vec3::Y, Vec3::new(0.0, 5.0, 1.0), Vec3::Z] {
            let ulp = 1e-15 * (1.0 + offset.length());
            let eye = DVec3::new(1.2, 0.7, -2.5) + offset;
            let start = Camera { up, ..camera(eye, offset) };
            assert_near(start.turned(turn).eye, start.eye, 4.0 * ulp);
            let axis = up.as_dvec3().normalize();
            for i in 0..36 {
                let camera = start.turned(f64::from(i) / 36.0 * turn);
                let (a, b) = (start.eye - offset, camera.eye - offset);
                assert!((a.length() - b.length()).abs() <= 4.0 * ulp);
                assert!((a.dot(axis) - b.dot(axis)).abs() <= 4.0 * ulp, "the height is kept");
                let [a, b] = [a, b].map(|x| x.reject_from(axis).normalize());
                let (sine, cosine) = (f64::from(i) / 36.0 * turn).sin_cos();
                assert!((a.cross(b).dot(axis) - sine).abs() < 1e-8);
                assert!((a.dot(b) - cosine).abs() < 1e-8);
            }
        }
    }
}

// -------------------------------------------------------------------------------- shots

fn fixed_camera() -> Camera {
    camera(DVec3::new(0.0, 1.0, 4.0), DVec3::ZERO)
}

fn summary(shots: &[Shot]) -> Vec<(i64, usize)> {
    shots.iter().map(|shot| (shot.number, shot.frame)).collect()
}

/// With a fixed camera, the pictures are the frames, with their numbers.
#[test]
fn shots_of_a_fixed_camera() {
    let shots = shots(&[20, 5, 7], fixed_camera(), &Motion::Still, 30.0).unwrap();
    assert_eq!(summary(&shots), [(20, 0), (5, 1), (7, 2)]);
    assert!(shots.iter().all(|shot| shot.camera == fixed_camera()));
}

/// The k-th picture is at k/fps seconds of the path.
#[test]
fn shots_along_a_path() {
    let motion = Motion::Path(irregular());
    let frames: Vec<i64> = (10..20).collect();
    let sequence = shots(&frames, fixed_camera(), &motion, 2.0).unwrap();
    assert_eq!(sequence.iter().map(|s| s.number).collect::<Vec<_>>(), frames);
    for (k, shot) in sequence.iter().enumerate() {
        assert_eq!((shot.frame, shot.camera), (k, irregular().at(k as f64 / 2.0)));
    }
    // A single frame: as long as the path, from the first to the last key, numbered by picture.
    let one = shots(&[42], fixed_camera(), &motion, 10.0).unwrap();
    assert_eq!(one.len(), 71);
    assert!((1..).zip(&one).all(|(number, shot)| (shot.number, shot.frame) == (number, 0)));
    assert_eq!(one[0].camera, irregular().keys[0].camera);
    assert_eq!(one[70].camera, irregular().keys[5].camera);
    // 0.1 s at 30 frames per second are 3 frames, although not in 64-bit arithmetic.
    let short = path([(0.0, fixed_camera()), (0.1, fixed_camera())]);
    assert_eq!(shots(&[42], fixed_camera(), &Motion::Path(short), 30.0).unwrap().len(), 4);
    // A path of one key is one picture, with the frame's number.
    let one = path([(0.0, fixed_camera())]);
    assert_eq!(
        summary(&shots(&[42], fixed_camera(), &Motion::Path(one), 30.0).unwrap()),
        [(42, 0)]
    );
}

/// Views are pictures of one frame from each key, whose times do not count and may be left out; a path needs them.
#[test]
fn views_are_keys_without_times() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("views.toml");
    let key = |time: &str| format!("[[key]]\n{time}eye = [1, 2, 3]\ntarget = [0, 0, 0]\n");
    std::fs::write(&file, key("") + &key("time = 3.0\n") + &key("time = 1.0\n")).unwrap();
    let views = load_views(&file, Up::Y, None).expect("three views");
    assert_eq!(views, [camera(DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO); 3]);
    let error = CameraPath::load(&file).unwrap_err().to_string();
    assert!(error.contains("views.toml: [[key]] 1: without a time"), "{error}");

    let listed = shots(&[42], fixed_camera(), &Motion::Views(views.clone()), 30.0).unwrap();
    assert_eq!(summary(&listed), [(1, 0), (2, 0), (3, 0)]);
    assert!(listed.iter().all(|shot| shot.camera == views[0] && shot.before.is_none()));
    let error = shots(&[1, 2], fixed_camera(), &Motion::Views(views), 30.0).unwrap_err();
    assert!(error.to_string().contains("expected one frame"), "{error}");

    for (text, problem) in [("", "[[key]]: none"), (&key("fov_y = 0.0\n"), "[[key]] 1: ")] {
        std::fs::write(&file, text).unwrap();
        let error = load_views(&file, Up::Y, None).unwrap_err().to_string();
        assert!(error.contains(problem), "{error}");
    }
}

/// A turntable loops without a seam, and a shorter sequence repeats.
#[test]
fn shots_of_a_turntable() {
    let turn = std::f64::consts::TAU;
    let motion = Motion::Turntable(2.0);
    let one = shots(&[7], fixed_camera(), &motion, 4.0).unwrap();
    assert_eq!(summary(&one), (1..=8).map(|number| (number, 0)).collect::<Vec<_>>());
    for (k, shot) in one.iter().enumerate() {
        assert_near(shot.camera.eye, fixed_camera().turned(k as f64 / 8.0 * turn).eye, 1e-14);
    }
    // The last picture is one step before the first, which follows it in a loop.
    assert_near(one[7].camera.turned(turn / 8.0).eye, one[0].camera.eye, 1e-14);

    let three = shots(&[7, 8, 9], fixed_camera(), &motion, 4.0).unwrap();
    let frames = [0, 1, 2, 0, 1, 2, 0, 1];
    assert_eq!(summary(&three), (1..).zip(frames).collect::<Vec<_>>());

    let ten: Vec<i64> = (11..=20).collect();
    let ten = shots(&ten, fixed_camera(), &motion, 4.0).unwrap();
    assert_eq!(summary(&ten), (11..).zip(0..10).collect::<Vec<_>>());
    assert_eq!((ten[8].camera, ten[9].camera), (ten[0].camera, ten[1].camera));
}

/// Rates, turns and lengths out of range are errors, not hours of drawing.
#[test]
fn shots_out_of_range_are_errors() {
    for fps in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e4, 1e-3] {
        let error = shots(&[1], fixed_camera(), &Motion::Still, fps).unwrap_err();
        assert!(matches!(error, Error::Usage(_)), "{fps}: {error:?}");
    }
    for seconds in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e9] {
        let error = shots(&[1], fixed_camera(), &Motion::Turntable(seconds), 30.0).unwrap_err();
        assert!(matches!(error, Error::Usage(_)), "{seconds}: {error:?}");
    }
    let endless = path([(0.0, fixed_camera()), (1e12, fixed_camera())]);
    shots(&[1], fixed_camera(), &Motion::Path(endless), 30.0).expect_err("endless");
}
