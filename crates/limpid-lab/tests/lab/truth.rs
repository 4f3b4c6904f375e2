//! The ground truth against closed forms, and against pictures by independent software.

mod independent;
mod meshes;
mod solids;

use std::f64::consts::TAU;
use std::path::Path;

use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::glam::{DMat3, DVec2, DVec3, UVec2, Vec3};
use limpid::scene::Scene;
use limpid_io::project::Project;
use limpid_lab::reference::analytic::{Ball, Block, Drops, Ellipsoid, Pool};
use limpid_lab::reference::optics::{Interface, fresnel, reflect, refract, transmittance};
use limpid_lab::reference::trace::{Image, MAX_DEPTH, first_last, intervals, trace};
use limpid_lab::reference::{Crossing, Liquid, Ray};
use limpid_sim::waves::{WaveSpectrum, Waves};
use meshes::sphere_mesh;

/// A linear congruential generator (Knuth's MMIX): the same cases on every machine.
struct Random(u64);

impl Random {
    fn range(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        low + (high - low) * ((self.0 >> 11) as f64 / (1u64 << 53) as f64)
    }

    fn direction(&mut self) -> DVec3 {
        let z = self.range(-1.0, 1.0);
        let (sin, cos) = self.range(0.0, TAU).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, z)
    }
}

fn project(text: &str) -> Project {
    Project::parse(text, "test", Path::new("")).unwrap()
}

fn scene(text: &str) -> Scene {
    project(text).scene
}

fn ray(origin: DVec3, direction: DVec3) -> Ray {
    Ray { origin, direction: direction.normalize() }
}

/// The radiance seen straight down from a height of 3 m.
fn seen_down(liquid: &impl Liquid, scene: &Scene) -> DVec3 {
    let camera =
        Camera { eye: DVec3::new(0.0, 3.0, 0.0), up: Vec3::Z, ..looking(Vec3::X, Vec3::ZERO) };
    trace(liquid, scene, &camera, UVec2::ONE, 1, MAX_DEPTH).pixels[0]
}

fn looking(eye: Vec3, target: Vec3) -> Camera {
    let (eye, target) = (eye.to_array(), target.to_array());
    let text = format!("[camera]\neye = {eye:?}\ntarget = {target:?}\nfov_y = 40.0");
    project(&text).camera.unwrap()
}

const WATER: f64 = 1.33;

/// Laws of refraction: critical angle, Snell's angle, reflectances, and reciprocity of light,
/// whichever side is denser.
#[test]
fn optics_match_closed_forms() {
    let at = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        DVec3::new(sin, -cos, 0.0)
    };
    let n = DVec3::Y;
    assert!(refract(at(48.7534), n, 1.0 / WATER).is_some());
    assert!(refract(at(48.7536), n, 1.0 / WATER).is_none());
    assert_eq!(Interface::new(at(48.7536), n, 1.0 / WATER).reflectance, 1.0);
    let from_water = fresnel(45f64.to_radians().cos(), 1.0 / WATER);
    assert!((from_water - 0.13419).abs() < 1e-5, "{from_water}");
    let refracted = refract(at(30.0), n, WATER).unwrap();
    let angle = refracted.x.asin().to_degrees();
    assert!((angle - 22.0824).abs() < 1e-4, "{angle}");
    assert!((fresnel(1.0, WATER) - (0.33f64 / 2.33).powi(2)).abs() < 1e-15);
    assert_eq!(fresnel(0.0, WATER), 1.0);
    assert_eq!(fresnel(0.0, 1.0), 0.0);
    assert!((reflect(at(30.0), n) - DVec3::new(0.5, 0.75f64.sqrt(), 0.0)).length() < 1e-15);
    let left = transmittance(DVec3::new(0.0, 1.0, 2.0), 1.5);
    assert!((left - DVec3::new(1.0, (-1.5f64).exp(), (-3f64).exp())).length() < 1e-15);

    let mut random = Random(1);
    for _ in 0..1000 {
        let (d, n) = (random.direction(), random.direction());
        let n = if d.dot(n) > 0.0 { -n } else { n };
        let eta = random.range(0.3, 3.0);
        let interface = Interface::new(d, n, eta);
        let Some(refracted) = interface.refracted else {
            assert_eq!(interface.reflectance, 1.0);
            assert!(-d.dot(n) < (1.0 - eta * eta).sqrt() + 1e-12, "total only beyond the angle");
            continue;
        };
        assert!((refracted.cross(n) * eta - d.cross(n)).length() < 1e-12, "Snell");
        let back = Interface::new(-refracted, -n, 1.0 / eta);
        assert!((back.reflectance - interface.reflectance).abs() < 1e-9, "reciprocity");
        assert!((back.refracted.unwrap() + d).length() < 1e-6);
    }
}

/// Follows the ray that passes through without internal reflection: its length inside, the ray
/// afterwards and the exit.
fn pass(liquid: &impl Liquid, from: &Ray, ior: f64) -> (f64, Ray, Crossing) {
    let enter = liquid.crossing(from, false).expect("the ray enters");
    let direction = refract(from.direction, enter.normal, ior).unwrap();
    let inside = Ray { origin: from.at(enter.t), direction };
    let leave = liquid.crossing(&inside, true).expect("the ray leaves");
    let direction = refract(direction, -leave.normal, 1.0 / ior).unwrap();
    (leave.t, Ray { origin: inside.at(leave.t), direction }, leave)
}

/// A ball, with known answers for two refractions: chord, deviation, absorption.
#[test]
fn a_ball_matches_its_closed_form() {
    let center = DVec3::new(0.3, -0.2, 0.1);
    let ball = Ball { center, radius: 1.0 };
    let from = ray(center + DVec3::new(0.5, 0.0, 7.0), DVec3::NEG_Z);
    let (chord, out, _) = pass(&ball, &from, WATER);
    assert!((chord - 1.85329).abs() < 1e-5, "{chord}");
    let deviation = out.direction.dot(from.direction).acos().to_degrees();
    assert!((deviation - 15.8352).abs() < 1e-4, "{deviation}");
    assert!((transmittance(DVec3::ONE, chord).x - 0.156721).abs() < 1e-6);

    // A rotated ellipsoid equals the ball if its axes are equal; otherwise entries and exits agree
    // with `contains` and with the normals.
    let turn = DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(0.4);
    let round = Ellipsoid::new(center, turn).unwrap();
    assert!((pass(&round, &from, WATER).0 - chord).abs() < 1e-12);
    let long = Ellipsoid::new(center, turn * DMat3::from_diagonal(DVec3::new(2.0, 1.0, 0.01)));
    let long = long.unwrap();
    let mut random = Random(2);
    for _ in 0..1000 {
        let towards = center + 0.3 * random.direction() * DVec3::new(1.0, 1.0, 0.01);
        let origin = center + 1e3 * random.direction();
        let from = ray(origin, towards - origin);
        let Some(enter) = long.crossing(&from, false) else { continue };
        let leave = long.crossing(&from, true).unwrap();
        assert!(long.contains(from.at(0.5 * (enter.t + leave.t))) && enter.t < leave.t);
        assert!(enter.normal.dot(from.direction) < 0.0 && leave.normal.dot(from.direction) > 0.0);
    }
    assert!(Ellipsoid::new(center, DMat3::from_diagonal(DVec3::new(1.0, 0.0, 1.0))).is_none());
}

/// Parallel faces: the ray is offset, not bent, and the incoherent sum over all internal
/// reflections is the plate's closed form.
#[test]
fn a_plate_matches_its_closed_form() {
    let (low, high) = (DVec3::new(-50.0, -0.4, -50.0), DVec3::new(50.0, 0.0, 50.0));
    let plate = Block { min: low, max: high };
    let from = ray(DVec3::new(0.0, 1.0, 0.0), DVec3::new(1.0, -3f64.sqrt(), 0.0));
    let (_, out, _) = pass(&plate, &from, WATER);
    assert!((out.direction - from.direction).length() < 1e-14, "parallel");
    let straight = from.at((from.origin.y + 0.4) / -from.direction.y);
    let inner = (0.5f64 / WATER).asin();
    let expected = 0.4 * (30f64.to_radians().tan() - inner.tan());
    assert!((straight.x - out.origin.x - expected).abs() < 1e-12);

    // Bright below, dark above: the radiance seen straight down is the transmittance.
    let two_skies = "[liquid]\nior = 1.33\nabsorption = [0.0, 0.0, 0.0]\n[environment.gradient]\n\
        zenith = [0.0, 0.0, 0.0]\nhorizon = [0.0, 0.0, 0.0]\nnadir = [1.0, 1.0, 1.0]";
    let down = |text: &str| seen_down(&plate, &scene(text));
    let r = (0.33f64 / 2.33).powi(2);
    let clear = down(two_skies).x;
    // Each path is truncated at a share below a thousandth.
    assert!((clear - (1.0 - r) / (1.0 + r)).abs() < 1e-3, "{clear}");
    let grey = down(&two_skies.replace("[0.0, 0.0, 0.0]\n[env", "[2.0, 2.0, 2.0]\n[env")).x;
    let a = (-0.8f64).exp();
    let expected = (1.0 - r).powi(2) * a / (1.0 - r * r * a * a);
    assert!((grey - expected).abs() < 1e-3, "{grey} {expected}");
}

fn pool() -> Pool {
    let spectrum = WaveSpectrum { count: 20, wavelengths: [0.3, 2.0], rms_slope: 0.2, seed: 4 };
    Pool {
        waves: Waves::new(&spectrum),
        min: DVec2::splat(-2.0),
        max: DVec2::splat(2.0),
        bottom: f64::NEG_INFINITY,
    }
}

/// Crossings of a pool, which have no closed form: each lies on the waves, and none comes after a
/// change of sides that dense sampling finds.
#[test]
fn rays_never_miss_waves() {
    let pool = pool();
    let mut random = Random(5);
    let mut crossings = 0;
    for _ in 0..2000 {
        let height = random.range(-0.4, 0.4);
        let origin = DVec3::new(random.range(-1.9, 1.9), height, random.range(-1.9, 1.9));
        // Most rays are flat and meet several waves.
        let direction = random.direction() * DVec3::new(1.0, random.range(0.0, 0.5), 1.0);
        let ray = ray(origin, direction);
        let inside = pool.contains(origin);
        let crossing = pool.crossing(&ray, inside);
        let end = crossing.map_or(6.0, |c| c.t);
        let other = (1..2000).map(|i| f64::from(i) / 2000.0 * end).find(|&t| {
            let x = ray.at(t);
            let off = x.y - pool.waves.height(DVec2::new(x.x, x.z));
            let in_rectangle = x.x.abs() < 2.0 && x.z.abs() < 2.0;
            in_rectangle && (if inside { off > 1e-10 } else { off < -1e-10 })
        });
        assert_eq!(other, None, "{ray:?} from inside: {inside}, crossing {crossing:?}");
        let Some(crossing) = crossing else { continue };
        if crossing.normal.y > 0.0 {
            let x = ray.at(crossing.t);
            let residual = x.y - pool.waves.height(DVec2::new(x.x, x.z));
            assert!(residual.abs() < 1e-10, "{residual}");
            assert_eq!(crossing.normal.dot(ray.direction) > 0.0, inside);
            crossings += 1;
        } else {
            let side = ray.at(crossing.t).abs();
            assert!((side.x.max(side.z) - 2.0).abs() < 1e-12);
        }
    }
    assert!(crossings > 500, "{crossings}");

    // From afar, through a side, and on flat water.
    let far = ray(DVec3::new(0.0, 900.0, 500.0), DVec3::new(0.0, -900.0, -500.0));
    let hit = far.at(pool.crossing(&far, false).unwrap().t);
    assert!((hit.y - pool.waves.height(DVec2::new(hit.x, hit.z))).abs() < 1e-10);
    let side = ray(DVec3::new(-5.0, -1.0, 0.0), DVec3::X);
    let crossing = pool.crossing(&side, false).unwrap();
    assert_eq!((crossing.t, crossing.normal), (3.0, DVec3::NEG_X));
    let flat = Pool { waves: Waves::default(), ..pool };
    let slanted = ray(DVec3::Y, DVec3::new(1.0, -2.0, 0.0));
    assert!((flat.crossing(&slanted, false).unwrap().t - 1.25f64.sqrt()).abs() < 1e-12);
    assert_eq!(flat.crossing(&ray(DVec3::Y, DVec3::X), false), None);
}

const CHECKERED: &str = "[liquid]\nior = 1.33\nabsorption = [1.2, 0.35, 0.12]\n[camera]\n\
    eye = [0.4, 0.9, 3.0]\ntarget = [0.0, 0.0, 0.0]\nfov_y = 40.0\n[environment.gradient]\n\
    zenith = [0.3, 0.5, 0.9]\nhorizon = [0.8, 0.8, 0.9]\nnadir = [0.3, 0.3, 0.3]\n[[solid]]\n\
    shape = \"plane\"\norigin = [0.0, -0.8, 0.0]\nhalf_extent = 5.0\n\
    checker = { tile = 0.5, even = [0.8, 0.8, 0.7], odd = [0.2, 0.2, 0.3] }";

/// Energy conservation: under uniform radiance 1, clear liquid of any shape is as bright as its
/// surroundings, and brighter by the squared index seen from within.
#[test]
fn clear_liquid_vanishes_under_uniform_radiance() {
    let mut scene = scene("[liquid]\nior = 1.33\nabsorption = [0.0, 0.0, 0.0]");
    scene.environment = Environment::Constant(Vec3::ONE);
    let size = UVec2::new(40, 30);
    let mesh = sphere_mesh(DVec3::ZERO, 1.0, 3);
    let block = Block { min: DVec3::splat(-0.7), max: DVec3::splat(0.7) };
    let check = |image: Image, expected: f64| {
        for radiance in image.pixels {
            assert!((radiance - DVec3::splat(expected)).length() < 1e-9, "{radiance}");
        }
    };
    let outside = looking(Vec3::new(0.5, 1.0, 2.5), Vec3::ZERO);
    check(trace(&mesh, &scene, &outside, size, 1, MAX_DEPTH), 1.0);
    check(trace(&block, &scene, &outside, size, 1, MAX_DEPTH), 1.0);
    let within = looking(Vec3::new(0.1, 0.2, 0.1), Vec3::new(0.3, 0.2, -1.0));
    let scaled = f64::from(scene.liquid.ior).powi(2);
    check(trace(&mesh, &scene, &within, size, 1, MAX_DEPTH), scaled);
    check(trace(&block, &scene, &within, size, 1, MAX_DEPTH), scaled);
    scene.settings.refract.radiance_scaling = false;
    check(trace(&mesh, &scene, &within, size, 1, MAX_DEPTH), 1.0);
}

/// Liquids of several bodies: rays go from one to the next, whatever their order.
#[test]
fn rays_pass_through_separate_drops() {
    let ball = |x: f64| Ellipsoid::new(x * DVec3::X, 0.5 * DMat3::IDENTITY).unwrap();
    for drops in [Drops(vec![ball(-2.0), ball(2.0)]), Drops(vec![ball(2.0), ball(-2.0)])] {
        let mut at = ray(-5.0 * DVec3::X, DVec3::X);
        for (inside, t) in [(false, 2.5), (true, 1.0), (false, 3.0), (true, 1.0)] {
            let crossing = drops.crossing(&at, inside).unwrap();
            assert!((crossing.t - t).abs() < 1e-12, "{}: {}", at.origin, crossing.t);
            assert_eq!(crossing.normal.x > 0.0, inside);
            at.origin = at.at(crossing.t);
        }
        assert_eq!(drops.crossing(&at, false), None);
        assert!(drops.contains(2.2 * DVec3::X) && !drops.contains(DVec3::ZERO));
    }
}

/// Perfect layers of two balls in a row: the front of the first and the back of the second, in view
/// space.
#[test]
fn layers_are_the_first_front_and_the_last_back() {
    struct Two([Ball; 2]);
    impl Liquid for Two {
        fn crossing(&self, ray: &Ray, inside: bool) -> Option<Crossing> {
            let of = |ball: &Ball| {
                let starts = (ray.origin.distance(ball.center) - ball.radius).abs() < 1e-9;
                let within = ball.contains(ray.origin) || (starts && inside);
                if inside && !within { None } else { ball.crossing(ray, inside) }
            };
            self.0.iter().filter_map(of).min_by(|a, b| a.t.total_cmp(&b.t))
        }
        fn contains(&self, point: DVec3) -> bool {
            self.0.iter().any(|ball| ball.contains(point))
        }
    }
    let ball = |x: f64| Ball { center: DVec3::new(x, 0.0, 0.0), radius: 1.0 };
    let camera = looking(Vec3::new(10.0, 0.0, 0.0), Vec3::ZERO);
    let size = UVec2::new(33, 33);
    let [front, back] = first_last(&Two([ball(0.0), ball(-4.0)]), &camera, size);
    let middle = 16 * 33 + 16;
    assert!(
        (front.depths[middle] - 9.0).abs() < 1e-12 && (back.depths[middle] - 15.0).abs() < 1e-12
    );
    assert!((front.normals[middle] - DVec3::Z).length() < 1e-12);
    assert!((back.normals[middle] + DVec3::Z).length() < 1e-12);
    assert_eq!((front.depths[0], back.depths[0], front.normals[0]), (0.0, 0.0, DVec3::ZERO));
    let found = intervals(&Two([ball(0.0), ball(-4.0)]), &camera, size);
    let ends = found[middle].concat();
    assert!(
        ends.iter().zip([9.0, 11.0, 13.0, 15.0]).all(|(a, b)| (a - b).abs() < 1e-8),
        "{ends:?}"
    );
    assert_eq!((ends.len(), found[0].len()), (4, 0));
    // The nearer ball alone is seen around the farther one.
    assert!(found.iter().any(|intervals| intervals.len() == 1));
    // No front exists for an eye inside.
    let camera = looking(Vec3::new(0.5, 0.0, 0.0), Vec3::ZERO);
    assert_eq!(intervals(&ball(0.0), &camera, size)[middle].len(), 1);
    let [front, back] = first_last(&ball(0.0), &camera, size);
    assert_eq!(front.depths[middle], 0.0);
    assert!((back.depths[middle] - 1.5).abs() < 1e-12);
}
