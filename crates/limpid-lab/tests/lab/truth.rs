//! The ground truth against closed forms, and against pictures by independent software.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use image::{Rgb, RgbImage};
use limpid::camera::Camera;
use limpid::environment::{Environment, EvenLight};
use limpid::glam::{DMat3, DVec2, DVec3, UVec2, UVec3, Vec3};
use limpid::scene::Scene;
use limpid_io::input::Input;
use limpid_io::project::Project;
use limpid_lab::compare::{compare, load_picture};
use limpid_lab::reference::analytic::{Ball, Block, Drops, Ellipsoid, Pool};
use limpid_lab::reference::mesh::{Mesh, Reconstruction};
use limpid_lab::reference::optics::{Interface, fresnel, reflect, refract, transmittance};
use limpid_lab::reference::surroundings::Surroundings;
use limpid_lab::reference::trace::{Image, MAX_DEPTH, first_last, intervals, trace};
use limpid_lab::reference::{Crossing, Liquid, Ray};
use limpid_sim::waves::{WaveSpectrum, Waves};

use crate::even_light::even_light;
use crate::support::references::references;

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

/// A solid in the liquid ends the ray after the path to it, through one interface, with radiance
/// scaled by the squared index.
#[test]
fn a_wet_floor_is_seen_through_one_interface() {
    let text = "[liquid]\nior = 1.33\nabsorption = [1.0, 0.5, 0.0]\n[environment]\n\
        radiance = [0.0, 0.0, 0.0]\n[[solid]]\nshape = \"plane\"\norigin = [0.0, -0.4, 0.0]\n\
        half_extent = 100.0\ncolor = [1.0, 1.0, 1.0]";
    let r = (0.33f64 / 2.33).powi(2);
    let expected = transmittance(DVec3::new(1.0, 0.5, 0.0), 0.4) * (1.0 - r) / (WATER * WATER);
    // The bottom of the liquid on the floor, and below it.
    for bottom in [-0.4, -0.9] {
        let (low, high) = (DVec3::new(-9.0, bottom, -9.0), DVec3::new(9.0, 0.0, 9.0));
        let found = seen_down(&Block { min: low, max: high }, &scene(text));
        assert!((found - expected).length() < 2e-3, "{bottom}: {found} {expected}");
    }
}

/// Ambient light of the sky on wet solids: reflected at the surface and absorbed on its way down,
/// as in the closed form, with or without walls around; unattenuated without liquid.
#[test]
fn ambient_light_is_attenuated_with_depth() {
    let absorption = DVec3::new(1.0, 0.3, 0.0);
    let text = |depth: f64| {
        format!(
            "[liquid]\nior = 1.33\nabsorption = [1.0, 0.3, 0.0]\n[environment]\n\
             radiance = [0.5, 0.5, 0.5]\n[[solid]]\nshape = \"plane\"\norigin = [0.0, -{depth:?}, 0.0]\n\
             half_extent = 100.0\ncolor = [0.8, 0.8, 0.8]\nlit = true\n"
        )
    };
    let r = (0.33f64 / 2.33).powi(2);
    for depth in [0.2, 1.0, 4.0] {
        let (low, high) = (DVec3::new(-90.0, -depth, -90.0), DVec3::new(90.0, 0.0, 90.0));
        let sea = Block { min: low, max: high };
        let down = transmittance(absorption, depth);
        let floor = 0.4 * even_light(WATER, absorption, depth);
        let expected = (1.0 - r) / (WATER * WATER) * down * floor + r * 0.5;
        let found = seen_down(&sea, &scene(&text(depth)));
        let off = ((found - expected) / expected).abs().max_element();
        println!("{depth} m: {found}, by the closed form {expected}: off by {off:.4}");
        assert!(off < 0.004, "{depth}: {found} {expected}");

        // A shaft of the same depth with black walls, which occlude no ambient light, as in the
        // air.
        let wall = |min: [f64; 3], max: [f64; 3]| {
            format!(
                "[[solid]]\nshape = \"box\"\nmin = {min:?}\nmax = {max:?}\ncolor = [0.0, 0.0, 0.0]\n"
            )
        };
        let shaft = text(depth)
            + &wall([-0.6, -5.0, -0.5], [-0.5, 0.0, 0.5])
            + &wall([0.5, -5.0, -0.5], [0.6, 0.0, 0.5])
            + &wall([-0.6, -5.0, -0.6], [0.6, 0.0, -0.5])
            + &wall([-0.6, -5.0, 0.5], [0.6, 0.0, 0.6]);
        let (low, high) = (DVec3::new(-0.5, -depth, -0.5), DVec3::new(0.5, 0.0, 0.5));
        let in_shaft = seen_down(&Block { min: low, max: high }, &scene(&shaft));
        assert!(((in_shaft - found) / found).abs().max_element() < 1e-6, "{in_shaft} {found}");
    }
    let air = Block { min: DVec3::splat(50.0), max: DVec3::splat(51.0) };
    assert!((seen_down(&air, &scene(&text(1.0))) - 0.5 * 0.8).length() < 1e-7);
}

/// The renderer's two paths for ambient light agree with the closed form within the tolerance of
/// `EvenLight`, from the surface down to where nothing is left.
#[test]
fn two_paths_approximate_the_whole_sky() {
    for ior in [1.2_f32, 1.333, 1.5, 2.0, 3.0] {
        let EvenLight { shares, paths } = EvenLight::below(ior);
        for (depth, tolerance) in [(0.0, 1e-5), (0.1, 1e-3), (0.5, 1e-3), (2.0, 1e-3), (8.0, 3e-3)]
        {
            let path = |i: usize| f64::from(shares[i]) * (-depth * f64::from(paths[i])).exp();
            let expected = even_light(ior.into(), DVec3::ONE, depth).x;
            let off = (path(0) + path(1)) / expected - 1.0;
            assert!(
                off.abs() < tolerance,
                "index {ior}, {depth} absorption lengths: off by {off:e}"
            );
        }
    }
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

/// A triangulated sphere: an icosahedron whose faces are subdivided `times` times.
fn sphere_mesh(center: DVec3, radius: f64, times: u32) -> Mesh {
    let g = 0.5 * (1.0 + 5f64.sqrt());
    let signs = [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)];
    let mut vertices: Vec<DVec3> = (0..3)
        .flat_map(|axis| {
            signs.map(|(a, b)| {
                let v = DVec3::new(a, b, 0.0).normalize();
                [v, DVec3::new(v.z, v.x, v.y), DVec3::new(v.y, v.z, v.x)][axis]
            })
        })
        .collect();
    // The faces are the triples of vertices at the smallest distance.
    let near = |a: DVec3, b: DVec3| a.distance(b) < 1.1;
    let mut triangles = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let [a, b, c] = [i, j, k].map(|v| vertices[v]);
                if near(a, b) && near(b, c) && near(c, a) {
                    let outward = (b - a).cross(c - a).dot(a) > 0.0;
                    triangles.push(if outward { [i, j, k] } else { [i, k, j] }.map(|v| v as u32));
                }
            }
        }
    }
    for _ in 0..times {
        let mut middles = std::collections::HashMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q): (u32, u32)| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    vertices.push((vertices[p as usize] + vertices[q as usize]).normalize());
                    vertices.len() as u32 - 1
                })
            });
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    let vertices = vertices.into_iter().map(|v| center + radius * v).collect();
    Mesh::new(vertices, triangles).unwrap()
}

const CHECKERED: &str = "[liquid]\nior = 1.33\nabsorption = [1.2, 0.35, 0.12]\n[camera]\n\
    eye = [0.4, 0.9, 3.0]\ntarget = [0.0, 0.0, 0.0]\nfov_y = 40.0\n[environment.gradient]\n\
    zenith = [0.3, 0.5, 0.9]\nhorizon = [0.8, 0.8, 0.9]\nnadir = [0.3, 0.3, 0.3]\n[[solid]]\n\
    shape = \"plane\"\norigin = [0.0, -0.8, 0.0]\nhalf_extent = 5.0\n\
    checker = { tile = 0.5, even = [0.8, 0.8, 0.7], odd = [0.2, 0.2, 0.3] }";

/// Finer meshes converge to the picture of the exact ball.
#[test]
fn finer_meshes_converge_to_the_ball() {
    let Project { scene, camera, .. } = project(CHECKERED);
    let camera = camera.unwrap();
    let size = UVec2::new(96, 72);
    let (center, radius) = (DVec3::new(0.1, 0.1, 0.0), 0.7);
    let ball = Ball { center, radius };
    let exact = trace(&ball, &scene, &camera, size, 4, MAX_DEPTH).to_srgb();
    let errors = [3, 4, 5].map(|times| {
        let mesh = sphere_mesh(center, radius, times);
        let found = trace(&mesh, &scene, &camera, size, 4, MAX_DEPTH).to_srgb();
        compare(&exact, &found).unwrap().0.mean_flip
    });
    println!("mean FLIP to the ball: {errors:?}");
    assert!(errors[1] < errors[0] && errors[2] < errors[1] && errors[2] < 0.01, "{errors:?}");
}

/// A closed mesh has no leaks: rays at edges, at vertices and at random cross it an even number of
/// times, alternately in and out, and `contains` is right.
#[test]
fn a_closed_mesh_has_no_holes() {
    let mesh = sphere_mesh(DVec3::new(3.0, -2.0, 5.0), 1.0, 3);
    let center = DVec3::new(3.0, -2.0, 5.0);
    assert!(mesh.contains(center) && !mesh.contains(center + 1.1 * DVec3::Y));
    let mut random = Random(6);
    for i in 0..3000 {
        let [a, b, c] =
            mesh.triangles()[i % mesh.triangles().len()].map(|v| mesh.vertices()[v as usize]);
        let target = [a, 0.5 * (a + b), center, (a + b + c) / 3.0][i % 4];
        let origin = center + random.range(1.2, 100.0) * random.direction();
        let from = ray(origin, target - origin);
        let mut at = from;
        let mut inside = false;
        let mut count = 0;
        while let Some(crossing) = mesh.crossing(&at, inside).filter(|_| count < 10) {
            assert_eq!(crossing.normal.dot(at.direction) > 0.0, inside);
            at.origin = at.at(crossing.t);
            inside = !inside;
            count += 1;
        }
        // A ray that grazes a corner from outside may enter and leave at the same rounded distance.
        let to_center = center - from.origin;
        let miss = to_center.reject_from_normalized(from.direction).length();
        assert!(miss > 0.99 || (!inside && count == 2), "{i}: {count} crossings, {miss} beside");
    }
}

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

/// Open meshes give finite pictures as bright as their surroundings.
#[test]
fn open_meshes_give_finite_pictures() {
    let corners = [DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, -1.0, 0.0), DVec3::Y];
    let mesh = Mesh::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap();
    let mut scene = scene("[liquid]\nior = 1.33\nabsorption = [0.0, 3.0, 3.0]");
    scene.environment = Environment::Constant(Vec3::ONE);
    for eye in [2.0, -2.0] {
        let camera = looking(Vec3::new(0.2, 0.1, eye), Vec3::ZERO);
        let image = trace(&mesh, &scene, &camera, UVec2::splat(16), 1, MAX_DEPTH);
        assert!(image.pixels.iter().all(|c| (*c - DVec3::ONE).length() < 1e-9));
    }
    assert!(Mesh::new(corners.to_vec(), vec![[0, 1, 3]]).is_err());
    assert!(Mesh::new(vec![DVec3::NAN], Vec::new()).is_err());
    let nothing = Mesh::new(Vec::new(), Vec::new()).unwrap();
    assert_eq!(nothing.crossing(&ray(DVec3::ZERO, DVec3::X), false), None);
    assert!(!nothing.contains(DVec3::ZERO));
}

/// Edge cases of the reconstruction: no particle, one, coincident ones, and invalid numbers.
#[test]
fn few_particles_are_meshed_and_invalid_ones_rejected() {
    let how = Reconstruction::default();
    assert!(Mesh::reconstruct(&[], 0.1, &how).unwrap().triangles().is_empty());
    for particles in [vec![Vec3::ONE], vec![Vec3::ONE; 5]] {
        let mesh = Mesh::reconstruct(&particles, 0.1, &how).unwrap();
        assert!(mesh.vertices().iter().all(|v| v.distance(DVec3::ONE) < 0.4));
    }
    assert!(Mesh::reconstruct(&[Vec3::NAN], 0.1, &how).is_err());
    assert!(Mesh::reconstruct(&[Vec3::ONE], 0.0, &how).is_err());
    assert!(Mesh::reconstruct(&[Vec3::ONE], f32::INFINITY, &how).is_err());
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

/// Liquid among solids wets all solids that it touches, in any order, for either direction of a
/// plane's normal and however thin a box is, and never protrudes behind a box.
#[test]
fn all_touched_solids_are_wet() {
    let scene = scene(
        "[[solid]]\nshape = \"plane\"\norigin = [0.0, 0.3, 0.5]\nnormal = [1.0, 0.0, 0.0]\n\
        [[solid]]\nshape = \"plane\"\norigin = [0.0, 0.0, 0.0]\n\
        [[solid]]\nshape = \"plane\"\norigin = [1.0, 0.3, 0.5]\nnormal = [1.0, 0.0, 0.0]\n\
        half_extent = 2.0\n\
        [[solid]]\nshape = \"box\"\nmin = [-1.0, 0.0, -0.5]\nmax = [2.0, 2.0, 0.0]\n\
        [[solid]]\nshape = \"box\"\nmin = [-1.0, 0.0, 1.0]\nmax = [2.0, 2.0, 1.001]\n\
        [[solid]]\nshape = \"sphere\"\ncenter = [0.5, 0.1, 0.5]\nradius = 0.2",
    );
    let (radius, ball) = (0.05, Vec3::new(0.5, 0.1, 0.5));
    // Centres at least a radius away from all solids.
    let lattice = (0..10 * 7 * 10).map(|i| {
        let place = UVec3::new(i % 10, i / 100, i / 10 % 10).as_vec3();
        2.0 * radius * (place + 0.5)
    });
    let particles: Vec<Vec3> = lattice.filter(|x| x.distance(ball) >= 0.2 + radius).collect();
    let how = Reconstruction::among(&scene.solids);
    let mesh = Mesh::reconstruct(&particles, radius, &how).unwrap();
    let surroundings = Surroundings::new(&scene);
    // Up to the solid, or beyond it by no more than coordinates are rounded.
    let touches = |hit: f64, crossing: f64| hit <= crossing + 1e-6 * (1.0 + crossing);
    let mut random = Random(5);
    let mut met = [0; 6];
    for i in 0..3000 {
        let mut on = || random.range(0.15, 0.85);
        let low = 0.1 + 0.4 * on();
        let (a, b) = (on(), on());
        let (origin, to, behind) = match i % 5 {
            0 => (DVec3::new(0.5, low, 0.5), DVec3::new(0.0, low, b), DVec3::NEG_X),
            1 => (DVec3::new(a, 0.5, b), DVec3::new(a, 0.0, b), DVec3::NEG_Y),
            2 => (DVec3::new(0.5, low, 0.5), DVec3::new(1.0, low, b), DVec3::X),
            3 => (DVec3::new(0.5, low, 0.5), DVec3::new(a, low, 0.0), DVec3::NEG_Z),
            _ => (DVec3::new(0.5, low, 0.5), DVec3::new(a, low, 1.0), DVec3::Z),
        };
        // From the liquid to the solid, except where the ball leaves less room than a particle
        // needs.
        let narrow = i % 5 == 1 && (0.12..0.4).contains(&DVec2::new(a - 0.5, b - 0.5).length());
        if mesh.contains(origin) && !narrow {
            let inwards = ray(origin, to - origin);
            let hit = surroundings.hit(&inwards).expect("a solid");
            met[hit.solid] += 1;
            let crossing = mesh.crossing(&inwards, true);
            let wet = crossing.is_none_or(|c| touches(hit.t, c.t));
            assert!(wet, "gap before solid {}: {inwards:?} {crossing:?}", hit.solid);
        }
        // And from behind a box; a plane is the face of a thick solid.
        if i % 5 < 3 {
            continue;
        }
        let outwards = ray(to + 0.6 * behind, -behind);
        let hit = surroundings.hit(&outwards).expect("a solid");
        let crossing = mesh.crossing(&outwards, false);
        let hidden = crossing.is_none_or(|c| touches(hit.t, c.t));
        assert!(hidden, "liquid behind solid {}: {outwards:?} {crossing:?}", hit.solid);
    }
    assert!(met.iter().all(|&count| count > 40), "{met:?}");
}

/// Solids and lights: the nearest solid is visible, in its colour, under Lambert's law.
#[test]
fn surroundings_match_the_scene() {
    let surroundings = Surroundings::new(&scene(
        "[environment]\nradiance = [0.1, 0.2, 0.3]\n\
        [[light]]\nsun = { direction = [0.0, -2.0, 0.0], irradiance = [3.0, 3.0, 3.0] }\n\
        [[light]]\npoint = { position = [0.0, 4.0, 0.0], intensity = [8.0, 0.0, 0.0] }\n\
        [[solid]]\nshape = \"plane\"\norigin = [0.0, 0.0, 0.0]\nhalf_extent = 6.0\n\
        color = [0.5, 0.5, 1.0]\nlit = true\n\
        [[solid]]\nshape = \"box\"\nmin = [2.0, -1.0, -1.0]\nmax = [4.0, 1.0, 1.0]\n\
        checker = { tile = 0.5, even = [1.0, 1.0, 1.0], odd = [0.0, 0.0, 0.0] }\n\
        [[solid]]\nshape = \"sphere\"\ncenter = [-4.0, 1.0, 0.0]\nradius = 1.0\n\
        color = [0.7, 0.6, 0.5]",
    ));
    let down = |x: f64| ray(DVec3::new(x, 2.0, 0.1), DVec3::NEG_Y);
    let floor = surroundings.radiance(&ray(DVec3::Y, DVec3::NEG_Y));
    let expected = DVec3::new(0.5, 0.5, 1.0)
        * (DVec3::new(0.1, 0.2, 0.3) + (DVec3::splat(3.0) + 0.5 * DVec3::X) / PI);
    assert!((floor - expected).length() < 1e-6, "{floor} {expected}");
    assert_eq!(surroundings.hit(&down(3.2)).map(|h| (h.t, h.solid)), Some((1.0, 1)));
    assert_eq!(surroundings.radiance(&down(3.2)), DVec3::ONE);
    assert_eq!(surroundings.radiance(&down(3.7)), DVec3::ZERO);
    let sphere = surroundings.radiance(&ray(DVec3::new(-4.0, 5.0, 0.0), DVec3::NEG_Y));
    assert!((sphere - DVec3::new(0.7, 0.6, 0.5)).length() < 1e-6);
    assert!((surroundings.radiance(&down(9.0)) - DVec3::new(0.1, 0.2, 0.3)).length() < 1e-6);
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

const SCENES: [&str; 5] = [
    "double_dam_break_front",
    "double_dam_break_low",
    "double_dam_break_top",
    "double_dam_break_columns",
    "knot",
];

/// Halves width and height: averages four pixels in linear light.
fn halved(picture: &RgbImage) -> RgbImage {
    RgbImage::from_fn(picture.width() / 2, picture.height() / 2, |x, y| {
        let four = [(0, 0), (1, 0), (0, 1), (1, 1)]
            .map(|(dx, dy)| picture.get_pixel(2 * x + dx, 2 * y + dy).0);
        Rgb([0, 1, 2].map(|c| {
            let linear = four.map(|p| {
                let v = f64::from(p[c]) / 255.0;
                if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
            });
            let mean = linear.iter().sum::<f64>() / 4.0;
            let encoded = if mean <= 0.003_130_8 {
                12.92 * mean
            } else {
                1.055 * mean.powf(1.0 / 2.4) - 0.055
            };
            (255.0 * encoded).round() as u8
        }))
    })
}

/// Mean FLIP between the pictures that splashsurf and Mitsuba made of the reference scenes and those of the whole
/// pipeline, from particles to pictures, at half their size for speed.
fn mean_flip_of(references: &Path, adjust: impl Fn(&mut Reconstruction)) -> f64 {
    let flips = SCENES.map(|name| {
        let path = references.join("scenes").join(name).with_extension("toml");
        let input = Input::open(path.to_str().expect("the path is UTF-8")).unwrap();
        let frame = match input.frame {
            Some(number) => input.sequence.frame(number).expect("the scene's frame"),
            None => &input.sequence.frames[0],
        };
        let particles = input.particles(frame).unwrap();
        let project = input.project.expect("a scene");
        let radius = project.source.files()[0].radius.expect("a radius");
        let scene = project.scene;
        let mut how = Reconstruction::among(&scene.solids);
        adjust(&mut how);
        let mesh = Mesh::reconstruct(&particles.positions, radius, &how).unwrap();

        let path = references.join("pictures").join(name).with_extension("png");
        let reference = halved(&load_picture(&path).unwrap());
        let size = UVec2::from(reference.dimensions());
        let camera = project.camera.expect("a camera");
        let picture = trace(&mesh, &scene, &camera, size, 4, MAX_DEPTH).to_srgb();
        let flip = compare(&reference, &picture).unwrap().0.mean_flip;
        println!("{name:<26} mean FLIP {flip:.4}");
        flip
    });
    let mean = flips.iter().sum::<f64>() / SCENES.len() as f64;
    println!("{:<26} mean FLIP {mean:.4}", "all");
    mean
}

/// The whole pipeline agrees with independent software. The mean FLIP is 0.0216.
#[test]
fn pictures_match_independent_software() {
    let Some(references) = references() else { return };
    let mean = mean_flip_of(&references, |_| ());
    assert!(mean <= 0.025, "mean FLIP {mean:.4}, at most 0.025 expected");
}

/// How far the truth depends on its mesher: other sane parameters change the pictures by as much as limpid's error. A
/// smaller error than this fits the mesher, not the liquid.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn other_meshes_of_the_same_particles_differ() {
    let Some(references) = references() else { return };
    let same = mean_flip_of(&references, |_| ());
    for (name, adjust) in [
        (
            "smoothed everywhere alike",
            (|how| how.spares_the_sparse = false) as fn(&mut Reconstruction),
        ),
        ("10 steps of smoothing instead of 25", |how| how.smoothing_iterations = 10),
        ("level 0.55, kernel 5 % smaller", |how| {
            (how.threshold, how.smoothing_length) = (0.55, 1.9);
        }),
    ] {
        println!("{name}:");
        let other = mean_flip_of(&references, adjust);
        assert!(other > 1.3 * same, "{name}: {other}, and {same} without the change");
    }
}
