//! Making of whitewater in files: the same after an interruption, from files of any kind, and with damaged ones.

use std::fs;
use std::path::Path;

use limpid::diffuse::Diffuse;
use limpid::glam::Vec3;
use limpid::liquid::Particles;
use limpid::scene::Scene;
use limpid_io::input::{FrameTime, Input, Loader, Missing};
use limpid_io::particles::{self, read_diffuse};
use limpid_io::whitewater::{Files, Making};
use limpid_sim::whitewater::Choices;
use tempfile::TempDir;

const FRAMES: i64 = 6;
const RADIUS: f32 = 0.025;
const FPS: f32 = 50.0;

/// A frame of two blocks that fly through each other: a splash that is known at any time.
fn splash(frame: i64) -> Particles {
    let t = frame as f32 / FPS;
    let count = 12 * 8 * 8;
    let half = |i: usize| if i < count / 2 { 1.0 } else { -1.0 };
    let start =
        |i: usize| Vec3::new((i % 12) as f32, (i / 12 % 8) as f32, (i / 96) as f32) * 2.0 * RADIUS;
    let speed = |i: usize| Vec3::new(0.3 * (i % 5) as f32, 3.0 * half(i), 4.0 * half(i));
    Particles {
        velocities: Some((0..count).map(speed).collect()),
        ids: Some((0..count as i64).collect()),
        ..Particles::from_positions((0..count).map(|i| start(i) + t * speed(i)).collect())
    }
}

/// A folder with the splash in files of this extension, and a change to each frame.
fn folder(extension: &str, change: impl Fn(&mut Particles)) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for frame in 1..=FRAMES {
        let mut particles = splash(frame);
        change(&mut particles);
        let path = folder.path().join(format!("splash_{frame:03}.{extension}"));
        particles::write(&particles, &path).unwrap();
    }
    folder
}

fn open(folder: &Path) -> Loader {
    let input = Input::open(folder.join("splash_###.npz"))
        .or_else(|_| Input::open(folder.join("splash_###.bgeo")));
    input.unwrap().with_radius(RADIUS).unwrap().resolve().unwrap().0
}

/// Makes up to `most` frames; returns the numbers of those that were made now.
fn make(loader: &Loader, files: &Files, choices: Choices, most: usize) -> Vec<i64> {
    let scene = Scene::default();
    let mut making = Making::new(loader, &scene, files.clone(), choices, false).unwrap();
    let mut made = Vec::new();
    for _ in 0..most {
        let Some(progress) = making.step().unwrap() else { break };
        made.extend(progress.counts.is_some().then_some(progress.number));
    }
    made
}

fn all(files: &Files) -> Vec<Diffuse> {
    (1..=FRAMES).map(|number| read_diffuse(&files.path(number), RADIUS).unwrap()).collect()
}

#[test]
fn an_interrupted_run_gives_the_same_files() {
    let liquid = folder("npz", |_| {});
    let loader = open(liquid.path());
    let out = tempfile::tempdir().unwrap();
    let whole = Files::of(&loader, &out.path().join("a"), "npz");
    assert_eq!(whole.name, "splash_whitewater");
    assert_eq!(make(&loader, &whole, Choices::default(), 99), [1, 2, 3, 4, 5, 6]);
    let made = all(&whole);
    let [_, spray, bubbles, dust] = made[5].counts();
    assert!(spray > 5 && bubbles > 20 && dust == 0, "{:?}", made[5].counts());
    assert!(made[5].ages.is_some() && made[5].lifetimes.is_some());
    for extension in ["bgeo", "csv", "vtu", "ply"] {
        let parts = Files::of(&loader, &out.path().join(extension), extension);
        assert_eq!(make(&loader, &parts, Choices::default(), 3), [1, 2, 3]);
        // Existing frames are not made again.
        assert_eq!(make(&loader, &parts, Choices::default(), 99), [4, 5, 6]);
        assert_eq!(make(&loader, &parts, Choices::default(), 99), [0; 0]);
        assert_eq!(all(&parts), made, "{extension}");
    }
    // A frame that was cut, and those after it.
    fs::write(whole.path(4), "cut").unwrap();
    assert_eq!(make(&loader, &whole, Choices::default(), 99), [4, 5, 6]);
    assert_eq!(all(&whole), made);
    // Another seed makes others.
    let other = Choices { seed: 2, ..Choices::default() };
    assert_eq!(make(&loader, &whole, other, 99).len(), 6);
    assert_ne!(all(&whole)[5], made[5]);
}

/// Frames are made again from the first whose liquid has changed.
#[test]
fn changed_liquid_is_noticed() {
    let liquid = folder("npz", |_| {});
    let loader = open(liquid.path());
    let files = Files::of(&loader, &liquid.path().join("w"), "npz");
    make(&loader, &files, Choices::default(), 99);
    let mut changed = splash(5);
    changed.positions.truncate(300);
    changed.velocities.as_mut().unwrap().truncate(300);
    changed.ids.as_mut().unwrap().truncate(300);
    particles::write(&changed, &liquid.path().join("splash_005.npz")).unwrap();
    assert_eq!(make(&loader, &files, Choices::default(), 99), [5, 6]);
}

/// Files without velocities have them by their ids or by their order, and times by velocities.
#[test]
fn velocities_and_times_are_found() {
    let counts = |change: fn(&mut Particles)| {
        let liquid = folder("npz", change);
        let loader = open(liquid.path());
        assert_eq!(loader.fps(), None);
        let files = Files::of(&loader, liquid.path(), "npz");
        make(&loader, &files, Choices::default(), 99);
        // Beside the liquid they are found.
        let beside = open(liquid.path());
        let found = beside.diffuse(FrameTime::at(6), RADIUS).unwrap().0.unwrap();
        (found.len() as f64, fs::read_to_string(files.record()).unwrap())
    };
    let (own, record) = counts(|_| {});
    let pace =
        |record: &str| record.contains("\"pace\": 0.02") || record.contains("\"pace\": 0.0199");
    assert!(pace(&record), "{record}");
    for change in [(|p: &mut Particles| p.velocities = None) as fn(&mut Particles), |p| {
        (p.velocities, p.ids) = (None, None);
    }] {
        // At 30 frames per second, if nothing tells, all is slower, and gravity seems less.
        let (found, _) = counts(change);
        assert!(found > 0.1 * own, "{found} {own}");
    }
}

#[test]
fn damaged_frames_are_errors_or_replaced() {
    let liquid = folder("npz", |_| {});
    fs::write(liquid.path().join("splash_003.npz"), "damaged").unwrap();
    let mut loader = open(liquid.path());
    let scene = Scene::default();
    let files = Files::of(&loader, &liquid.path().join("w"), "npz");
    let mut making =
        Making::new(&loader, &scene, files.clone(), Choices::default(), false).unwrap();
    assert!(making.step().unwrap().is_some() && making.step().unwrap().is_some());
    let error = making.step().unwrap_err().to_string();
    assert!(error.contains("splash_003.npz"), "{error}");
    assert!(!files.path(3).exists());
    // With the liquid of the frame before.
    let mut making = Making::new(&loader, &scene, files.clone(), Choices::default(), true).unwrap();
    let mut problems = Vec::new();
    while let Some(progress) = making.step().unwrap() {
        problems.extend(progress.problem.map(|problem| (progress.number, problem)));
    }
    assert!(
        matches!(problems.as_slice(), [(3, problem)] if problem.contains("splash_003")),
        "{problems:?}"
    );
    assert!(all(&files)[5].len() > 20);
    // A loader that replaces it has no fault.
    loader.missing = Missing::Hold;
    let held = Files::of(&loader, &liquid.path().join("held"), "npz");
    assert_eq!(make(&loader, &held, Choices::default(), 99).len(), 6);
}

#[test]
fn a_format_without_kinds_is_refused() {
    let liquid = folder("bgeo", |_| {});
    let loader = open(liquid.path());
    let scene = Scene::default();
    for extension in ["xyz", "pos", "txt"] {
        let files = Files::of(&loader, &liquid.path().join("w"), extension);
        let mut making = Making::new(&loader, &scene, files, Choices::default(), false).unwrap();
        let error = making.step().unwrap_err().to_string();
        assert!(error.contains("written"), "{error}");
    }
}
