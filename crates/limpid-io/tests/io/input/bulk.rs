//! The bulk of the particles: what escaped or waits is not of it.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use limpid::liquid::Particles;
use limpid_io::input::{FrameTime, Input};
use limpid_io::notice;
use limpid_io::open::Request;

use crate::support::Random;

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

/// Particles that wait at rest while others move are left out by the lights too, though they are as dense as liquid,
/// heavier and near enough to be another body.
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
