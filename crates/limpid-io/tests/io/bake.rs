//! Baked simulations: reproducible and resumable frames, and the physical behaviour of the liquid.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec3, Vec3};
use limpid::liquid::Particles;
use limpid::mesh::{Mesh, MeshData, Placement};
use limpid::scene::Shape;
use limpid_io::Error;
use limpid_io::Result;
use limpid_io::bake::{self, Bake, Found, Progress, Store};
use limpid_io::project::Project;
use tempfile::TempDir;

const TANK: &str = "[simulation]
frames = 60
radius = 0.03
bounds = { min = [0.0, 0.0, 0.0], max = [0.6, inf, 0.6] }
[[simulation.block]]
min = [0.0, 0.0, 0.0]
max = [0.6, 0.36, 0.6]
";

/// A falling column, a pillar, an emitter and a drain.
const BUSY: &str = "[simulation]
frames = 12
radius = 0.03
bounds = { min = [0.0, -1.0, 0.0], max = [1.2, inf, 0.36] }
drain = { min = [-inf, 0.02, -inf], max = [1.0, inf, inf] }
[[simulation.block]]
min = [0.0, 0.1, 0.0]
max = [0.36, 0.9, 0.36]
[[simulation.emitter]]
center = [0.6, 0.8, 0.18]
direction = [0.3, -1.0, 0.0]
radius = 0.08
speed = 2.0
from = 0.1
[[solid]]
shape = 'box'
min = [0.5, 0.0, 0.1]
max = [0.7, 0.2, 0.2]
";

fn project(text: &str) -> Project {
    Project::parse(text, "test", Path::new(".")).unwrap()
}

/// Bakes a project's simulation.
fn run(
    project: &Project,
    name: &str,
    folder: &Path,
    mut goes_on: impl FnMut(Progress) -> bool,
) -> Result<()> {
    let simulation = project.source.simulation().expect("a simulation");
    let mut bake = Bake::in_folder(simulation, &project.scene.solids, name, folder)?;
    while bake.step()?.is_some_and(&mut goes_on) {}
    Ok(())
}

fn bake(text: &str, folder: &Path, max_frames: u32) -> Result<()> {
    run(&project(text), "x", folder, |progress| progress.done < max_frames)
}

fn frame(folder: &Path, number: u32) -> Particles {
    limpid_io::particles::read(&bake::frame_path(folder, "x", number)).unwrap()
}

/// All frames of a scene.
fn baked(text: &str) -> Vec<Particles> {
    let folder = TempDir::new().unwrap();
    bake(text, folder.path(), u32::MAX).unwrap();
    let frames = project(text).source.simulation().unwrap().frames;
    (1..=frames).map(|number| frame(folder.path(), number)).collect()
}

fn kinetic(particles: &Particles) -> f32 {
    let velocities = particles.velocities.as_deref().unwrap();
    velocities.iter().map(|v| 0.5 * v.length_squared()).sum::<f32>() / velocities.len() as f32
}

fn assert_finite(frames: &[Particles]) {
    for particles in frames {
        let velocities = particles.velocities.iter().flatten();
        assert!(particles.positions.iter().chain(velocities).all(|x| x.is_finite()));
        assert!(particles.densities.iter().flatten().all(|rho| rho.is_finite()));
    }
}

/// Frames are bit-identical on any number of threads, and after an interruption or damage to the last
/// frame, as the comparison of pictures from different machines requires.
#[test]
fn frames_are_reproducible_on_any_threads_and_after_interruption() {
    let whole = baked(BUSY);
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert!(pool.install(|| baked(BUSY)) == whole, "{threads} threads");
    }
    let folder = TempDir::new().unwrap();
    bake(BUSY, folder.path(), 5).unwrap();
    // A further frame may have been written before the bake stopped.
    let last = (5..).take_while(|&n| bake::frame_path(folder.path(), "x", n).exists()).last();
    std::fs::write(bake::frame_path(folder.path(), "x", last.unwrap()), b"cut off").unwrap();
    bake(BUSY, folder.path(), 9).unwrap();
    let mut reported = Vec::new();
    run(&project(BUSY), "x", folder.path(), |progress| {
        reported.push(progress.done);
        true
    })
    .unwrap();
    assert_eq!(reported, Vec::from_iter(1..=12));
    let resumed: Vec<_> = (1..=12).map(|number| frame(folder.path(), number)).collect();
    assert!(resumed == whole);
    // Particles appear and disappear, and keep their ids.
    let counts: Vec<_> = whole.iter().map(Particles::len).collect();
    assert!(counts.windows(2).any(|pair| pair[1] > pair[0]), "{counts:?}");
    assert!(whole.iter().all(|p| p.ids.as_ref().unwrap().is_sorted_by(|a, b| a < b)));
    assert_finite(&whole);
}

/// Frames do not depend on where they are kept, nor on a thread that writes them: a page keeps them in memory, and continues
/// where it was left.
#[test]
fn frames_are_the_same_in_any_store() {
    struct Direct<'a>(&'a Path);

    impl Store for Direct<'_> {
        fn find(&mut self, number: u32) -> Result<Found> {
            Ok(if self.path(number).exists() { Found::Whole } else { Found::Nothing })
        }

        fn path(&self, number: u32) -> PathBuf {
            bake::frame_path(self.0, "x", number)
        }

        fn write(&mut self, number: u32, particles: Particles, _: Found) -> Result<()> {
            limpid_io::particles::write(&particles, &self.path(number))
        }

        fn has_written(&mut self, _: bool) -> Result<bool> {
            Ok(true)
        }
    }

    let folder = TempDir::new().unwrap();
    let project = project(BUSY);
    let simulation = project.source.simulation().unwrap();
    let bake = || Bake::new(simulation, &project.scene.solids, "x", Direct(folder.path()));
    let mut begun = bake();
    for number in 1..=4 {
        // No frame is made before it is asked for.
        assert!(!bake::frame_path(folder.path(), "x", number).exists());
        assert_eq!(begun.step().unwrap().map(|progress| progress.done), Some(number));
    }
    let mut continued = bake();
    let mut reported = Vec::new();
    while let Some(progress) = continued.step().unwrap() {
        reported.push(progress.done);
    }
    assert_eq!(reported, Vec::from_iter(1..=12));
    let frames: Vec<_> = (1..=12).map(|number| frame(folder.path(), number)).collect();
    assert!(frames == baked(BUSY));
}

/// A frame that temporarily cannot be read is not removed, and neither are those before it.
#[test]
fn unreadable_frames_are_not_removed() {
    let folder = TempDir::new().unwrap();
    bake(BUSY, folder.path(), 3).unwrap();
    let there = |n: &u32| bake::frame_path(folder.path(), "x", *n).exists();
    let last = (1..).take_while(there).last().unwrap();
    let path = bake::frame_path(folder.path(), "x", last);
    std::fs::remove_file(&path).unwrap();
    std::fs::create_dir(&path).unwrap();
    let error = bake(BUSY, folder.path(), 9).unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error}");
    assert!((1..last).all(|n| there(&n)), "frames were removed");
}

/// A frame that was cut, changed or lost, whichever it is, is made again as it was, and no other is.
#[test]
fn damaged_frames_are_made_again() {
    let whole = baked(BUSY);
    let folder = TempDir::new().unwrap();
    bake(BUSY, folder.path(), u32::MAX).unwrap();
    let path = |number| bake::frame_path(folder.path(), "x", number);
    let change = |number, change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = std::fs::read(path(number)).unwrap();
        change(&mut bytes);
        std::fs::write(path(number), bytes).unwrap();
    };
    let rebake = || {
        let mut again = Vec::new();
        run(&project(BUSY), "x", folder.path(), |progress| {
            again.extend(progress.again.then_some(progress.done));
            true
        })
        .unwrap();
        let frames: Vec<_> = (1..=12).map(|number| frame(folder.path(), number)).collect();
        assert!(frames == whole, "{again:?}");
        again
    };
    assert!(rebake().is_empty());
    // Cut, of the same length with zeros, and a bit of a place.
    change(1, &|bytes| bytes.truncate(100));
    change(4, &|bytes| {
        let half = bytes.len() / 2;
        bytes[half..].fill(0);
    });
    change(5, &|bytes| bytes.clear());
    change(9, &|bytes| {
        let half = bytes.len() / 2;
        bytes[half] ^= 1;
    });
    std::fs::remove_file(path(7)).unwrap();
    std::fs::copy(path(11), path(12)).unwrap();
    assert_eq!(rebake(), [1, 4, 5, 9, 12]);
    assert!(rebake().is_empty());
    // A record without checksums, as of an earlier version: what cannot be read is made again.
    let record = folder.path().join("x.bake.json");
    let mut known: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&record).unwrap()).unwrap();
    known.as_object_mut().unwrap().remove("sums").unwrap();
    std::fs::write(&record, known.to_string()).unwrap();
    change(3, &|bytes| bytes.truncate(1000));
    assert_eq!(rebake(), [3]);
}

/// A damaged bake record is reported as such.
#[test]
fn a_damaged_record_is_reported() {
    let folder = TempDir::new().unwrap();
    bake(BUSY, folder.path(), 2).unwrap();
    std::fs::write(folder.path().join("x.bake.json"), "{").unwrap();
    let error = bake(BUSY, folder.path(), 3).unwrap_err().to_string();
    assert!(error.contains("x.bake.json: not the record of a bake"), "{error}");
}

/// A sequence is not continued with other parameters, but may be with more frames.
#[test]
fn frames_of_other_parameters_are_not_continued() {
    let folder = TempDir::new().unwrap();
    bake(BUSY, folder.path(), 2).unwrap();
    let error = bake(&BUSY.replace("speed = 2.0", "speed = 2.5"), folder.path(), 3).unwrap_err();
    assert!(matches!(error, Error::OtherBake { .. }), "{error}");
    // More frames of the same simulation are allowed.
    bake(&BUSY.replace("frames = 12", "frames = 13"), folder.path(), 3).unwrap();
    bake::clear("x", folder.path()).unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// A settled tank conserves its volume, is level, and comes to rest.
#[test]
fn a_settled_tank_conserves_volume_and_rests() {
    let frames = baked(TANK);
    let last = frames.last().unwrap();
    assert_eq!(last.len(), 600);
    let densities = last.densities.as_deref().unwrap();
    let inner = last.positions.iter().zip(densities).filter(|(x, _)| x.y < 0.27);
    let (sum, count) = inner.fold((0.0, 0), |(sum, count), (_, rho)| (sum + rho, count + 1));
    let density = sum / count as f32;
    let level = 2.0 * last.positions.iter().map(|x| x.y).sum::<f32>() / last.len() as f32;
    println!("density {density}, level {level}, kinetic {}", kinetic(last));
    assert!((density / 1000.0 - 1.0).abs() < 0.03, "{density}");
    assert!((level / 0.36 - 1.0).abs() < 0.03, "{level}");
    // The surface, over a 3 × 3 grid of columns.
    for field in 0..9 {
        let inside = |x: &&Vec3| (x.x / 0.2) as i32 == field % 3 && (x.z / 0.2) as i32 == field / 3;
        let top = last.positions.iter().filter(inside).map(|x| x.y).fold(0.0, f32::max);
        assert!((top - 0.33).abs() < 0.03, "field {field}: {top}");
    }
    let settling = frames.iter().map(kinetic).fold(0.0, f32::max);
    assert!(kinetic(last) < 1e-3 && kinetic(last) < settling, "{} {settling}", kinetic(last));
}

/// A deep tank conserves its volume: liquid below 36 layers is not compressed, and nothing boils. With
/// the three iterations of shallow liquid, the level would fall by a tenth.
#[test]
fn a_deep_tank_conserves_volume_and_rests() {
    let frames = baked(
        "[simulation]
frames = 60
radius = 0.0125
bounds = { min = [0.0, 0.0, 0.0], max = [0.2, inf, 0.2] }
[[simulation.block]]
min = [0.0, 0.0, 0.0]
max = [0.2, 0.9, 0.2]
",
    );
    let last = frames.last().unwrap();
    assert_eq!(last.len(), 8 * 36 * 8);
    let density = |to: f32| {
        let densities = last.densities.as_deref().unwrap();
        let below = last.positions.iter().zip(densities).filter(|(x, _)| x.y < to);
        let (sum, count) = below.fold((0.0, 0), |(sum, count), (_, rho)| (sum + rho, count + 1));
        sum / count as f32
    };
    let (inner, bottom) = (density(0.8), density(0.1));
    let level = 2.0 * last.positions.iter().map(|x| x.y).sum::<f32>() / last.len() as f32;
    let speed = (2.0 * kinetic(last)).sqrt();
    println!("density {inner}, at the bottom {bottom}, level {level}, speed {speed}");
    assert!((inner / 1000.0 - 1.0).abs() < 0.03, "{inner}");
    assert!((bottom / 1000.0 - 1.0).abs() < 0.03, "{bottom}");
    assert!((level / 0.9 - 1.0).abs() < 0.03, "{level}");
    assert!(speed < 0.05, "{speed}");
}

/// Two balls at (−x, 0, 0) and (x, y, 0) that approach each other without gravity.
fn collide(keys: &str, radius: f32, [x, y]: [f32; 2], speed: f32) -> Vec<Particles> {
    baked(&format!(
        "[simulation]
frames = 15
gravity = [0.0, 0.0, 0.0]
{keys}
[[simulation.block]]
center = [-{x:?}, 0.0, 0.0]
radius = {radius:?}
velocity = [{speed:?}, 0.0, 0.0]
[[simulation.block]]
center = [{x:?}, {y:?}, 0.0]
radius = {radius:?}
velocity = [-{speed:?}, 0.0, 0.0]
"
    ))
}

/// Cohesion limits how far colliding drops spread, without net force: their centre of mass stays in
/// place.
#[test]
fn cohesion_limits_spreading() {
    let spread = |cohesion: f32| {
        let keys = format!("radius = 0.01\nviscosity = 0.0\ncohesion = {cohesion:?}");
        let frames = collide(&keys, 0.07, [0.07, 0.0], 0.6);
        let last = &frames[14];
        let center = last.positions.iter().sum::<Vec3>() / last.len() as f32;
        assert!(center.length() < 2e-3, "{center}");
        let squares = last.positions.iter().map(|x| x.distance_squared(center)).sum::<f32>();
        (squares / last.len() as f32).sqrt()
    };
    let (free, held) = (spread(0.0), spread(60.0));
    println!("spread {free} without cohesion, {held} with it");
    assert!(held < 0.9 * free, "{held} {free}");
}

/// A single particle falls according to the closed form, to first order in the step, and moves straight
/// without gravity.
#[test]
fn a_single_particle_falls_freely() {
    let text = "[simulation]
frames = 31
radius = 0.05
[[simulation.block]]
min = [0.0, 0.0, 0.0]
max = [0.1, 0.1, 0.1]
velocity = [1.0, 4.0, 0.0]
";
    let frames = baked(text);
    let (first, last) = (frames[0].positions[0], frames[30].positions[0]);
    let expected = first + Vec3::new(1.0, 4.0 - 0.5 * 9.81, 0.0);
    // Gravity is applied at the beginning of a step: half a step's fall too much per step.
    assert!((last - expected).length() < 0.51 * 9.81 / 60.0, "{last} {expected}");
    let velocity = frames[30].velocities.as_ref().unwrap()[0];
    assert!((velocity - Vec3::new(1.0, 4.0 - 9.81, 0.0)).length() < 1e-2, "{velocity}");
    let straight =
        baked(&text.replace("radius = 0.05", "radius = 0.05\ngravity = [0.0, 0.0, 0.0]"));
    let expected = straight[0].positions[0] + Vec3::new(1.0, 4.0, 0.0);
    assert!((straight[30].positions[0] - expected).length() < 1e-3);
}

/// A collision without gravity conserves momentum and gains no energy.
#[test]
fn a_collision_conserves_momentum() {
    let frames = collide("radius = 0.03", 0.2, [0.3, 0.05], 1.0);
    let momentum = |p: &Particles| p.velocities.iter().flatten().sum::<Vec3>() / p.len() as f32;
    let drift = (momentum(&frames[14]) - momentum(&frames[0])).length();
    assert!(drift < 0.02, "{drift}");
    assert!(kinetic(&frames[14]) < 1.02 * kinetic(&frames[0]));
}

/// Coincident blocks, a block inside a solid, an emitter at a wall, and no particles at all give no NaN,
/// and no particle passes through a thin plate at any speed.
#[test]
fn extremes_stay_finite_and_outside_solids() {
    let frames = baked(
        "[simulation]
frames = 6
radius = 0.03
[[simulation.block]]
min = [0.0, 0.2, 0.0]
max = [0.3, 0.5, 0.3]
velocity = [0.0, -60.0, 0.0]
[[simulation.block]]
min = [0.0, 0.2, 0.0]
max = [0.3, 0.5, 0.3]
[[simulation.block]]
min = [2.0, 0.0, 0.0]
max = [2.3, 0.3, 0.3]
[[simulation.emitter]]
center = [2.5, 0.1, 0.1]
direction = [-1.0, 0.0, 0.0]
radius = 0.1
speed = 5.0
[[solid]]
shape = 'box'
min = [-50.0, -0.002, -50.0]
max = [50.0, 0.0, 50.0]
[[solid]]
shape = 'box'
min = [1.9, -0.1, -0.1]
max = [2.4, 0.5, 0.5]
",
    );
    assert_finite(&frames);
    assert_eq!(frames[0].len() - 250, frames[0].positions.iter().filter(|x| x.x > 1.0).count());
    for x in frames.iter().flat_map(|frame| &frame.positions) {
        assert!(x.y > 0.0, "{x} is below the plate");
    }
    let none = baked(
        "[simulation]
frames = 3
radius = 0.03
[[simulation.emitter]]
center = [0.0, 1.0, 0.0]
direction = [0.0, 1.0, 0.0]
radius = 0.1
speed = 1.0
from = 10.0
",
    );
    assert!(none.iter().all(Particles::is_empty));
}

/// The scene of a million particles has the documented number of them, and a swell's velocities are the
/// derivatives of its positions.
#[test]
fn velocities_of_a_swell_are_derivatives() {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("sims/million.toml");
    let mut full = Project::load(&path).unwrap();
    let block = full.source.simulation_mut().unwrap();
    let size = (block.blocks[0].max.unwrap() - block.blocks[0].min.unwrap()) / 0.025;
    assert_eq!(size.round().element_product(), 1_056_000.0);
    let frames = baked(
        "[simulation]
kind = 'swell'
frames = 3
fps = 1000.0
radius = 0.05
waves = { count = 10, wavelengths = [0.5, 2.0], rms_slope = 0.1, seed = 1 }
[[simulation.block]]
min = [0.0, 0.0, 0.0]
max = [2.0, 0.5, 1.0]
",
    );
    let moved = frames[2].positions.iter().zip(&frames[0].positions).map(|(b, a)| (b - a) / 0.002);
    for (velocity, moved) in frames[1].velocities.as_ref().unwrap().iter().zip(moved) {
        assert!((velocity - moved).length() < 1e-2, "{velocity} {moved}");
    }
}

/// Every example simulation loads, and the small ones compute two frames.
#[test]
fn every_example_simulation_starts() {
    for (name, count) in [("dam_break", 9_000..=20_000), ("fountain", 0..=100)] {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
            .join(format!("sims/{name}.toml"));
        let mut project = Project::load(&path).unwrap();
        project.source.simulation_mut().unwrap().frames = 2;
        let folder = TempDir::new().unwrap();
        run(&project, "x", folder.path(), |_| true).unwrap();
        assert!(count.contains(&frame(folder.path(), 1).len()), "{name}");
        assert_finite(&[frame(folder.path(), 2)]);
    }
    for name in ["wave", "steps", "crown", "million"] {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
            .join(format!("sims/{name}.toml"));
        assert!(Project::load(&path).unwrap().source.simulation().is_some(), "{name}");
    }
}

/// The frames of a baked scene are found beside it, with the simulation's radius and rate; opening it
/// before the bake is an error.
#[test]
fn a_baked_scene_is_an_input() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("drop.toml");
    let text = "[simulation]\nframes = 3\nfps = 24.0\nradius = 0.03\n\
                [[simulation.block]]\ncenter = [0.0, 1.0, 0.0]\nradius = 0.2\n";
    std::fs::write(&path, text).unwrap();
    let name = path.to_str().unwrap();
    let error = limpid_io::input::Input::open(name).unwrap_err();
    assert!(matches!(&error, Error::NotBaked { scene } if scene == name), "{error}");
    assert_eq!(error.category() as u8, 4);

    run(&Project::load(&path).unwrap(), "drop", &bake::folder(&path), |_| true).unwrap();
    let input = limpid_io::input::Input::open(name).unwrap();
    assert_eq!(input.loader.fps(), Some(24.0));
    let (input, project) = input.resolve().unwrap();
    let numbers: Vec<_> = input.sequence.frames.iter().map(|frame| frame.number).collect();
    assert_eq!(numbers, [1, 2, 3]);
    assert_eq!(input.load(&input.sequence.frames[2], &project.scene).unwrap().splats.radius, 0.03);
}

/// Liquid that is poured onto a mesh flows as around the same box, and does not enter it. Places agree to a
/// tenth of a radius while particles fall and hit; later they part, since collisions amplify rounding, but the
/// liquid's middle and extent stay within three tenths.
#[test]
fn meshes_stop_liquid_as_boxes_do() {
    const RADIUS: f64 = 0.02;
    let text = "[simulation]
frames = 40
radius = 0.02
bounds = { min = [-0.3, 0.0, -0.3], max = [0.3, inf, 0.3] }
[[simulation.block]]
min = [-0.12, 0.3, -0.1]
max = [0.12, 0.5, 0.14]
[[simulation.emitter]]
center = [0.02, 0.6, 0.01]
direction = [0.0, -1.0, 0.0]
radius = 0.06
speed = 3.0
[[solid]]
shape = 'box'
min = [-0.1, 0.0, -0.08]
max = [0.08, 0.2, 0.1]
";
    let boxed = project(text);
    let shape = boxed.scene.solids[0].shape.clone();
    let Shape::Box { min, max } = shape else { unreachable!() };
    let corner =
        |i: u32| DVec3::from([0, 1, 2].map(|k| if i >> k & 1 == 0 { min[k] } else { max[k] }));
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let data = MeshData {
        positions: (0..8).map(corner).collect(),
        triangles: faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        ..MeshData::default()
    };
    let mesh = Arc::new(Mesh::new(data).unwrap());
    let mut meshed = boxed.clone();
    meshed.scene.solids[0].shape = Shape::Mesh { mesh, placement: Placement::default() };

    let [boxed, meshed] = [boxed, meshed].map(|project| {
        let folder = TempDir::new().unwrap();
        run(&project, "x", folder.path(), |_| true).unwrap();
        (1..=40).map(|number| frame(folder.path(), number)).collect::<Vec<_>>()
    });
    let mut touched = false;
    for (number, (a, b)) in (1..).zip(boxed.iter().zip(&meshed)) {
        assert_eq!(a.ids, b.ids, "frame {number}");
        let apart = (a.positions.iter().zip(&b.positions))
            .map(|(x, y)| f64::from(x.distance(*y)) / RADIUS)
            .fold(0.0, f64::max);
        let deepest = |particles: &Particles| {
            let places = particles.positions.iter().map(|x| particles.origin + x.as_dvec3());
            places.map(|x| shape.distance(x).0 / RADIUS).fold(f64::INFINITY, f64::min)
        };
        let (a_gap, b_gap) = (deepest(a), deepest(b));
        assert!(a_gap > 0.99 && b_gap > 0.99, "frame {number}: {a_gap} and {b_gap} radii");
        assert!(number > 10 || apart < 0.1, "frame {number}: {apart} radii apart");
        let ((mean, spread), (b_mean, b_spread)) = (middle(a), middle(b));
        let off = f64::from(mean.distance(b_mean).max(spread.distance(b_spread))) / RADIUS;
        assert!(off < 0.3, "frame {number}: the middle or the extent is {off} radii off");
        touched |= a_gap < 1.01;
    }
    assert!(touched, "no particle met the box");
}

/// Mean and root mean square place of particles.
fn middle(particles: &Particles) -> (Vec3, Vec3) {
    let mean = |f: fn(Vec3) -> Vec3| {
        particles.positions.iter().map(|&x| f(x)).sum::<Vec3>() / particles.len() as f32
    };
    (mean(|x| x), mean(|x| x * x).powf(0.5))
}
