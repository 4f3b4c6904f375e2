//! The measurements of `limpid report`: the code that scores methods must itself be correct.

use glam::{DVec2, DVec3, IVec2, UVec2};
use limpid::camera::Camera;
use limpid::renderer::Renderer;
use limpid::scene::Scene;
use limpid::settings::{Refract, Solver};
use limpid_io::project::Project;
use limpid_lab::reference::layers::{Layer, ViewSpace, entry, exit};
use limpid_lab::reference::optics;
use limpid_lab::report::intersect::{
    Answer, Bench, Method, Target, Truth, ViewLayers, score, truths, world_from_view,
};
use limpid_lab::report::{Stress, stress};

use crate::support::{Random, gpu};

fn camera() -> Camera {
    Camera {
        eye: DVec3::new(0.0, 0.0, 5.0),
        target: DVec3::ZERO,
        up: glam::Vec3::Y,
        fov_y: 45.0,
        near: None,
        lens: None,
    }
}

fn texel(view: &ViewSpace, size: UVec2, i: u32, plane: DVec3) -> [f32; 4] {
    let u = DVec2::new((i % size.x).into(), (i / size.x).into()) + 0.5;
    let z = 1.0 / plane.dot(view.omega(u));
    [plane.x as f32, plane.y as f32, plane.z as f32, z as f32]
}

/// The plane through a point with a normal.
fn plane(point: DVec3, normal: DVec3) -> DVec3 {
    normal / normal.dot(point)
}

/// Exits from liquid between two planes are exact to f64, through either of them, and a ray that
/// leaves the picture has none.
#[test]
fn exits_of_a_wedge_are_exact() {
    let size = UVec2::new(160, 120);
    let view = ViewSpace::new(&camera().uniform(size, DVec3::ZERO));
    let front = plane(DVec3::new(0.0, 0.0, -4.0), DVec3::new(0.05, -0.1, -1.0));
    let back = plane(DVec3::new(0.0, 0.0, -5.0), DVec3::new(-0.05, 0.08, -1.0));
    let layer = |pi: DVec3| Layer { size, planes: vec![pi; size.element_product() as usize] };
    let pair = [layer(front), layer(back)];
    let mut random = Random(3);
    let mut found = 0;
    for _ in 0..2000 {
        let u = random.pixel(size);
        let disparity = [front, back].map(|pi| pi.dot(view.omega(u)));
        let share = random.range(0.05, 0.95);
        let o = view.omega(u) / (disparity[0] + share * (disparity[1] - disparity[0]));
        let d = random.direction();
        let meet = |pi: DVec3| {
            let t = (1.0 - pi.dot(o)) / pi.dot(d);
            if t > 0.0 { t } else { f64::INFINITY }
        };
        let end = o + meet(front).min(meet(back)) * d;
        let hit = exit(&view, &[&pair], o, d, u.floor().as_ivec2());
        if end.is_finite() && end.z < -view.near && view.holds(view.pixel(end)) {
            let hit = hit.expect("it ends in the picture");
            assert!(hit.u.distance(view.pixel(end)) < 1e-6, "{} {}", hit.u, view.pixel(end));
            assert!((hit.depth + end.z).abs() < 1e-8 * hit.depth);
            found += 1;
        } else {
            assert_eq!(hit, None, "from {o} along {d}");
        }
    }
    assert!(found > 1000, "{found}");
}

/// Silhouettes and overlapping classes: liquid ends where its texels do, and touching classes are
/// one body.
#[test]
fn unions_and_silhouettes_have_exact_ends() {
    let size = UVec2::new(160, 120);
    let view = ViewSpace::new(&camera().uniform(size, DVec3::ZERO));
    let level = |z: f64| DVec3::new(0.0, 0.0, -1.0 / z);
    let half = |pi: DVec3, right: bool| Layer {
        size,
        planes: (0..size.element_product())
            .map(|i| if (i % size.x >= 100) == right { pi } else { DVec3::ZERO })
            .collect(),
    };
    let o = 4.5 * view.omega(DVec2::new(40.5, 60.5));
    let d = DVec3::new(1.0, 0.0, -0.02).normalize();
    let left = [half(level(4.0), false), half(level(5.0), false)];
    let hit = exit(&view, &[&left], o, d, IVec2::new(40, 60)).expect("a silhouette");
    assert!((hit.u.x - 100.0).abs() < 1e-9, "{}", hit.u);
    // Another class from there on, at the same depth: one body, which ends at its back or not at
    // all.
    let right = [half(level(4.0), true), half(level(5.0), true)];
    let hit = exit(&view, &[&left, &right], o, d, IVec2::new(40, 60));
    let end = (5.0 + o.z) / -d.z;
    let expected = Some(view.pixel(o + end * d)).filter(|&u| view.holds(u));
    assert_eq!(hit.map(|hit| hit.u.round()), expected.map(|u| u.round()));
}

/// Rims: where smoothing has left a front behind its back there is no liquid, and a ray ends where
/// it starts. This is its true end: an answer elsewhere, or none, is wrong.
#[test]
fn crossed_layers_end_immediately() {
    let size = UVec2::new(160, 120);
    let view = ViewSpace::new(&camera().uniform(size, DVec3::ZERO));
    let layer = |z: f64| Layer {
        size,
        planes: vec![DVec3::new(0.0, 0.0, -1.0 / z); size.element_product() as usize],
    };
    let u = DVec2::new(40.5, 60.5);
    let d = DVec3::new(0.2, 0.1, -1.0).normalize();
    for (front, back) in [(4.0, 3.9), (4.0, 2.0)] {
        let pair = [layer(front), layer(back)];
        let o = front * view.omega(u);
        let hit = exit(&view, &[&pair], o, d, u.floor().as_ivec2()).expect("it ends at once");
        assert!(hit.u.distance(u) < 1e-9 && (hit.depth - front).abs() < 1e-9, "{hit:?}");
        assert_eq!(hit.plane, pair[1].planes[0]);
        let right = score(&view, &[Truth::Hit(hit)], &[Answer::Hit(u, front)]);
        let far = score(&view, &[Truth::Hit(hit)], &[Answer::Hit(u, 2.0 * front)]);
        assert_eq!([right.solved, right.wrong, far.solved, far.wrong], [1, 0, 0, 1]);
        // A class around it that contains the ray continues.
        let around = [layer(3.5), layer(5.0)];
        let hit = exit(&view, &[&pair, &around], o, d, u.floor().as_ivec2()).expect("its back");
        assert!((hit.depth - 5.0).abs() < 1e-9, "{hit:?}");
    }
}

/// Entries are from the front, and a ray that passes behind an edge continues.
#[test]
fn entries_are_from_the_front() {
    let size = UVec2::new(160, 120);
    let view = ViewSpace::new(&camera().uniform(size, DVec3::ZERO));
    let floor = DVec3::new(0.0, 0.0, -1.0 / 6.0);
    let card = DVec3::new(0.0, 0.0, -1.0 / 5.0);
    let layer = Layer {
        size,
        planes: (0..size.element_product())
            .map(|i| if (90..110).contains(&(i % size.x)) { card } else { floor })
            .collect(),
    };
    let start = 5.4 * view.omega(DVec2::new(80.5, 60.5));
    // Passes behind the card and ends on the floor beyond it.
    let beyond = 6.0 * view.omega(DVec2::new(130.5, 60.5));
    let d = (beyond - start).normalize();
    let hit = entry(&view, &layer, start, d, IVec2::new(80, 60)).expect("the floor");
    assert!(hit.u.distance(DVec2::new(130.5, 60.5)) < 1e-6, "{}", hit.u);
    // Ends behind the card, where nothing is visible.
    let hidden = 6.0 * view.omega(DVec2::new(100.5, 60.5));
    let d = (hidden - start).normalize();
    let hit = entry(&view, &layer, start, d, IVec2::new(80, 60));
    assert!(hit.is_none_or(|hit| hit.u.x > 110.0), "{hit:?}");
}

/// Scores of answers that are right, off by a known distance, wrong in depth only, or given for an
/// unsolvable ray.
#[test]
fn scores_of_known_answers() {
    let size = UVec2::new(160, 120);
    let view = ViewSpace::new(&camera().uniform(size, DVec3::ZERO));
    let layer = Layer { size, planes: vec![DVec3::new(0.0, 0.0, -0.2); 160 * 120] };
    let o = 4.0 * view.omega(DVec2::new(60.5, 60.5));
    let hit = entry(&view, &layer, o, DVec3::NEG_Z, IVec2::new(60, 60)).expect("a level plane");
    let right = Answer::Hit(hit.u, hit.depth);
    let aside = |px: f64| Answer::Hit(hit.u + DVec2::new(px, 0.0), hit.depth);
    let cases = [
        (Truth::None, Answer::None, [0, 0, 0, 0]),
        (Truth::Hit(hit), right, [1, 1, 1, 0]),
        (Truth::Hit(hit), aside(0.6), [1, 1, 1, 0]),
        (Truth::Hit(hit), aside(1.5), [1, 1, 0, 0]),
        (Truth::Hit(hit), aside(2.5), [1, 1, 0, 1]),
        (Truth::Hit(hit), Answer::Hit(hit.u, 1.1 * hit.depth), [1, 1, 0, 1]),
        (Truth::Hit(hit), Answer::Missed, [1, 1, 0, 0]),
        (Truth::Unsolvable, right, [1, 0, 0, 1]),
        (Truth::Unsolvable, Answer::Missed, [1, 0, 0, 0]),
    ];
    for (truth, answer, expected) in cases {
        let s = score(&view, &[truth], &[answer]);
        assert_eq!([s.rays, s.solvable, s.solved, s.wrong], expected, "{truth:?} {answer:?}");
    }
    let both = score(&view, &[Truth::Hit(hit); 2], &[right, aside(0.6)]);
    assert!((both.rms_px - 0.18f64.sqrt()).abs() < 1e-9, "{}", both.rms_px);
    assert_eq!(both.solved_of_all(), 1.0);
}

/// A scene of a tilted flat surface over a plane solid, seen from above, and its layers.
fn planar() -> (Scene, ViewLayers) {
    let toml = "
        [camera]
        eye = [0.0, 0.0, 5.0]
        target = [0.0, 0.0, 0.0]
        fov_y = 45.0
        [[solid]]
        shape = \"plane\"
        origin = [0.0, 0.0, -0.5]
        normal = [0.1, 0.2, 1.0]
        half_extent = 50.0";
    let scene = Project::parse(toml, "planar", "".as_ref()).unwrap().scene;
    let size = UVec2::new(160, 120);
    let view = ViewSpace::new(&camera().uniform(size, DVec3::ZERO));
    let water = plane(DVec3::new(0.0, 0.0, -4.5), DVec3::new(0.15, -0.1, -1.0));
    let floor = plane(DVec3::new(0.0, 0.0, -5.5), DVec3::new(0.1, 0.2, 1.0));
    let all = |pi: DVec3| (0..160 * 120).map(|i| texel(&view, size, i, pi)).collect::<Vec<_>>();
    let none = vec![[0.0; 4]; 160 * 120];
    let layers =
        ViewLayers { size, aggregate: [all(water), none], splash: None, solids: all(floor) };
    (scene, layers)
}

/// Every intersector solves a plane, except the one that does not intersect, and counts its texel
/// reads.
#[test]
fn every_intersector_solves_a_plane() {
    let Some(gpu) = gpu() else { return };
    let (scene, layers) = planar();
    let uniform = camera().uniform(layers.size, DVec3::ZERO);
    let view = ViewSpace::new(&uniform);
    let truths = truths(&world_from_view(&camera()), &uniform, &scene, &layers, Target::Solids);
    let bench = Bench::new(gpu, &uniform, &layers).unwrap();
    let refract = |solver| Refract { solver, ..Refract::default() };
    let mut settings = Solver::ALL.map(refract).to_vec();
    settings.push(Refract { filter: true, ..refract(Solver::Newton) });
    settings.extend([2, 4].map(|stride| Refract { stride, ..refract(Solver::March) }));
    let methods: Vec<_> = settings
        .iter()
        .map(|settings| Method {
            name: format!("{settings:?}"),
            words: String::new(),
            settings: Some(settings.clone()),
        })
        .collect();
    let measured = bench.measure(&methods, &scene, Target::Solids, 1).unwrap();
    for (method, measurement) in methods.iter().zip(&measured) {
        let score = score(&view, &truths, &measurement.answers);
        let solver = method.settings.as_ref().unwrap().solver;
        assert_eq!(score.rays, 160 * 120);
        assert!(score.solvable > 15_000, "{}", score.solvable);
        assert!(measurement.fetches >= 1.0, "{solver:?}");
        if solver == Solver::Single {
            // A check of the score itself: a lookup without intersection fails.
            assert!(score.solved_of_solvable() < 0.5, "{score:?}");
            continue;
        }
        // At the border of the picture mip levels cover less than their texels.
        let enough = if solver == Solver::Plane3 { 0.98 } else { 0.999 };
        assert!(score.solved_of_solvable() > enough, "{solver:?} {score:?}");
        assert!(score.wrong_accepts() < 0.002, "{solver:?} {score:?}");
        // The seed, the test, and a look back by the longest rays.
        if solver == Solver::Guarded {
            assert!(measurement.fetches < 3.5, "{}", measurement.fetches);
        }
    }
}

/// The rays of the truth obey Snell's law at the first surface.
#[test]
fn refraction_obeys_snell() {
    let n = DVec3::Z;
    let d = DVec3::new(30f64.to_radians().sin(), 0.0, -(30f64.to_radians().cos()));
    let inside = optics::refract(d, n, 1.33).expect("into water, all angles pass");
    assert!((inside.x.asin().to_degrees() - 22.0824).abs() < 1e-4);
}

/// Extreme scenes include spray, a pool, droplets next to the eye and an eye in the liquid; all
/// pixels are finite, and exactly rendered splats are close to the truth.
#[test]
fn extreme_scenes_are_finite_and_accurate() {
    let Some(gpu) = gpu() else { return };
    let rows = stress::measure(gpu, &mut Renderer::new(gpu), 2).expect("measured");
    for Stress { case, not_finite, median_error, worst_error, worst, .. } in &rows {
        println!("{case}: {median_error:.4}, at worst {worst_error:.4} ({worst})");
        assert_eq!(*not_finite, 0, "{case}");
        assert!(*worst_error < 0.02, "{case}: {worst_error}, {worst}");
    }
    for name in ["spray", "pool", "beside the eye", "eye in the liquid"] {
        assert!(rows.iter().any(|row| row.case.contains(name)), "{name}");
    }
}
