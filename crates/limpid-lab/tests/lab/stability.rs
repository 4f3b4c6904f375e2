//! Numerical range: scenes from millimetres to ten kilometres, up to 100 km from the world's
//! origin, fields of view from 5 to 150 degrees, any index of refraction, grazing views.

use std::path::Path;

use glam::{DVec2, DVec3, UVec2, Vec3};
use image::buffer::ConvertBuffer;
use limpid::camera::{Camera, Lens};
use limpid::environment::Environment;
use limpid::frame::FrameInput;
use limpid::liquid::classify::{Splats, add_wall_contacts, classify};
use limpid::offscreen::Picture;
use limpid::scene::{Light, Liquid, Scene, Shape, Solid, Surface};
use limpid::settings::{Reflections, Settings};
use limpid_lab::compare::compare;

use crate::support::frames::{
    self, Ellipsoid, FrameImages, Harness, View, ellipsoid, harness, noise, noise_turn,
    noise_vector,
};

const SIZE: UVec2 = UVec2::new(160, 120);

/// Side of the floor's tiles at scale 1, m.
const TILE: f64 = 0.25;

// ------------------------------------------------------------------------------ equivariance

/// The position and scale of a tank: a point x of it is at offset + scale·x.
#[derive(Clone, Copy, Debug)]
struct Place {
    offset: DVec3,
    scale: f64,
    /// Whether the particles' 32-bit positions include the offset.
    baked: bool,
}

const HERE: Place = Place { offset: DVec3::ZERO, scale: 1.0, baked: false };

impl Place {
    fn point(self, x: f64, y: f64, z: f64) -> DVec3 {
        self.offset + self.scale * DVec3::new(x, y, z)
    }

    fn length(self, x: f64) -> f32 {
        (self.scale * x) as f32
    }
}

/// A simulated dam break in a scene with every kind of position and length.
fn tank(place: Place) -> (Scene, Camera, Splats) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/data/double_dam_break/ParticleData_Fluid_20.bgeo");
    let mut particles = limpid_io::particles::read(&path).expect("the test's data");
    for position in &mut particles.positions {
        // Rounded to 10 fractional bits, so that 32-bit floats represent it exactly far away too.
        let rounded = (*position * 1024.0).round().as_dvec3() / 1024.0;
        let offset = if place.baked { place.offset } else { DVec3::ZERO };
        *position = (offset + place.scale * rounded).as_vec3();
    }
    if !place.baked {
        particles.origin = place.offset;
    }
    let lit = |shape, color| Solid { shape, surface: Surface::Color(color), lit: true };
    let checker = Surface::Checker {
        tile: place.length(TILE),
        even: Vec3::new(0.85, 0.80, 0.70),
        odd: Vec3::new(0.15, 0.20, 0.30),
    };
    let floor = Shape::Plane {
        origin: place.point(0.3, -0.05, 0.1),
        normal: Vec3::Y,
        half_extent: f32::INFINITY,
    };
    let wall = Shape::Box { min: place.point(-2.0, -1.0, -2.5), max: place.point(2.0, 0.8, -1.5) };
    let ball = Shape::Sphere { center: place.point(1.2, 0.2, 1.0), radius: place.length(0.2) };
    let intensity = Vec3::splat((place.scale * place.scale) as f32);
    // Adaptive sampling uses thresholds, which are not under test here.
    let mut settings = Settings::default();
    settings.refract.edge_samples = 1;
    let scene = Scene {
        liquid: Liquid {
            absorption: Vec3::new(1.2, 0.35, 0.12) / place.length(1.0),
            ..Default::default()
        },
        environment: Environment::Gradient {
            zenith: Vec3::new(0.20, 0.42, 0.85),
            horizon: Vec3::new(0.85, 0.90, 0.95),
            nadir: Vec3::splat(0.3),
        },
        solids: vec![
            Solid { shape: floor, surface: checker, lit: false },
            lit(wall, Vec3::new(0.7, 0.3, 0.2)),
            lit(ball, Vec3::new(0.2, 0.6, 0.3)),
        ],
        lights: vec![
            Light::Sun { direction: Vec3::new(0.3, -1.0, -0.2), irradiance: Vec3::ONE },
            Light::Point { position: place.point(0.5, 1.5, 1.5), intensity },
        ],
        settings,
        ..Scene::default()
    };
    let camera = Camera {
        eye: place.point(0.9, 1.5, 3.1),
        target: place.point(0.05, 0.12, 0.2),
        up: Vec3::Y,
        fov_y: 38.0,
        near: None,
        lens: None,
    };
    let mut splats = classify(&particles, place.length(0.025), &scene.settings.classify);
    add_wall_contacts(&mut splats, &scene.solids, scene.settings.classify.wetting);
    assert!(splats.aggregates.len() > 500 && splats.splashes.len() > 10);
    (scene, camera, splats)
}

fn draw(harness: &mut Harness, place: Place) -> FrameImages {
    let (scene, camera, splats) = tank(place);
    let images = harness.render(&scene, &camera, &splats, SIZE);
    images.assert_finite();
    images
}

/// Mean FLIP, the largest difference of any 8-bit channel, and the share of pixels that differ by
/// more than one level.
fn difference(a: &FrameImages, b: &FrameImages) -> (f64, u8, f64) {
    let (comparison, _) = compare(&a.picture.convert(), &b.picture.convert()).expect("one size");
    let off = |(a, b): (&image::Rgba<u8>, &image::Rgba<u8>)| {
        a.0.iter().zip(b.0).map(|(a, b)| a.abs_diff(b)).max().unwrap_or(0)
    };
    let offs: Vec<_> = a.picture.pixels().zip(b.picture.pixels()).map(off).collect();
    let changed = offs.iter().filter(|&&off| off > 1).count() as f64 / offs.len() as f64;
    (comparison.mean_flip, offs.into_iter().max().unwrap_or(0), changed)
}

/// A scene far from the world's origin looks the same as near it. Offsets are whole pairs of tiles
/// sideways, because the floor's pattern is counted from the world's origin.
#[test]
fn pictures_are_invariant_under_translation() {
    let Some(mut harness) = harness() else { return };
    let here = draw(&mut harness, HERE);
    for (offset, baked) in [
        // Exact in 32 bits, together with the particles' digits.
        (DVec3::new(1024.0, -512.0, 2048.0), true),
        (DVec3::new(-8000.0, 4096.0, 8191.0), true),
        // Needing 64 bits.
        (DVec3::new(98765.5, 4321.987654321, -54321.0), false),
        (DVec3::new(-1e5, -1e5 / 3.0, 1e5), false),
    ] {
        let there = draw(&mut harness, Place { offset, baked, ..HERE });
        let (flip, most, changed) = difference(&here, &there);
        println!("{offset}: mean FLIP {flip:.2e}, at most {most}, {changed:.2e} of the pixels");
        // A ray or two may cross a threshold, such as that of a strong reflection: FLIP spreads
        // such a pixel over its neighbours, and it is 5e-4 of the whole.
        assert!(flip < 1.1e-3 && changed < 1e-3, "{offset}: {flip:e}, {changed:e}");
    }
}

/// A scene of any size looks the same as at scale 1. Scaling by a power of two keeps all digits, so
/// the pictures are bit-identical if no constant is in metres.
#[test]
fn pictures_are_invariant_under_scaling() {
    let Some(mut harness) = harness() else { return };
    let here = draw(&mut harness, HERE);
    for scale in [1.0 / 1024.0, 8192.0, 1e-3, 1e4] {
        let there = draw(&mut harness, Place { scale, ..HERE });
        let (flip, most, changed) = difference(&here, &there);
        println!("{scale}: mean FLIP {flip:.2e}, at most {most}, {changed:.2e} of the pixels");
        if scale.log2().fract() == 0.0 {
            let same = here.channel("radiance.R") == there.channel("radiance.R");
            assert!(same, "{scale}: {most} in 8 bits");
        }
        // Measured: 2.1e-3 at 1e-3, where 2 rays of 1000 cross a threshold; small particles are smoothed over few
        // pixels, so that little of it is averaged away.
        assert!(flip < 2.5e-3 && changed < 3e-3, "{scale}: {flip:e}, {changed:e}");
    }
}

/// A telephoto shows from a thousand and ten thousand kilometres what parallel rays show from near by, and, but for the
/// noise of 32-bit depths, what it shows from two kilometres; parallel rays show the same from anywhere.
#[test]
fn far_cameras_show_what_near_ones_do() {
    let Some(mut harness) = harness() else { return };
    let (scene, camera, splats) = tank(HERE);
    let back = (camera.eye - camera.target).normalize();
    let height = 2.2;
    let mut draw = |distance: f64, parallel: bool| {
        let fov_y = 2.0 * (0.5 * height / distance).atan().to_degrees();
        let camera = Camera {
            eye: camera.target + distance * back,
            fov_y: fov_y as f32,
            lens: parallel.then_some(Lens::Orthographic { height }),
            ..camera
        };
        harness.render(&scene, &camera, &splats, SIZE)
    };
    let near = draw(8.0, true);
    for (distance, parallel, limit) in [
        // Measured: 3.2e-3 at 1e5 m, where 3 of 1000 rays cross a threshold.
        (1e5, false, 6e-3),
        (1e6, false, 6e-3),
        (1e7, false, 6e-3),
        (1e6, true, 6e-3),
        (1e7, true, 6e-3),
        // Measured: 5.4e-2, by a fifth of a pixel of perspective and the noise of depths at 8e4 radii.
        (2e3, false, 0.07),
    ] {
        let (flip, most, changed) = difference(&near, &draw(distance, parallel));
        println!(
            "{distance} m, parallel {parallel}: mean FLIP {flip:.2e}, at most {most}, {changed:.2e}"
        );
        assert!(flip < limit, "{distance} m, parallel {parallel}: mean FLIP {flip:.2e}");
    }
}

/// A telephoto near the ground shows from very far away what parallel rays show from near by: the ground that it meets long
/// before the liquid has faded into the environment.
#[test]
fn far_cameras_look_over_a_ground_that_fades() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, camera, splats) = tank(HERE);
    let (even, odd) = (Vec3::splat(0.8), Vec3::splat(0.2));
    // Beneath all liquid.
    let origin = DVec3::new(0.3, -0.15, 0.1);
    let shape = Shape::Plane { origin, normal: Vec3::Y, half_extent: f32::INFINITY };
    let surface = Surface::Ground { tile: 0.25, even, odd, fade: 6.0 };
    scene.solids = vec![Solid { shape, surface, lit: false }];
    let height = 2.2;
    let mut draw = |eye: DVec3| {
        let fov_y = 2.0 * (0.5 * height / (eye - camera.target).length()).atan().to_degrees();
        harness.render(&scene, &Camera { eye, fov_y: fov_y as f32, ..camera }, &splats, SIZE)
    };
    // Higher than the target by a hand, as someone who looks across a plain.
    let across = |distance: f64| camera.target + DVec3::new(0.0, 0.1, distance);
    // At 8e4 radii, depths have noise.
    let near = draw(across(2e3));
    let far = draw(across(1e6));
    for (name, other, distance, limit) in [("near", &near, 1e6, 0.07), ("far", &far, 1e7, 1e-2)] {
        let (flip, most, changed) = difference(other, &draw(across(distance)));
        println!("{name}, {distance} m: mean FLIP {flip:.2e}, at most {most}, {changed:.2e}");
        assert!(flip < limit, "{name}, {distance} m: mean FLIP {flip:.2e}");
    }
}

/// Where parallel rays would show something else, as a horizon, the camera is refused with its limit, and not where
/// the particles are resolved.
#[test]
fn far_cameras_are_refused_before_a_horizon() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, camera, splats) = tank(HERE);
    let Harness { gpu, renderer } = &mut *harness;
    let frame = Picture::new(gpu, SIZE).expect("a frame");
    let mut draw = |scene: &Scene, distance: f64| {
        // From a hand above the floor.
        let eye = camera.target + distance * DVec3::Z;
        let fov_y = (2.0 * (1.1 / distance).atan().to_degrees()) as f32;
        let camera = Camera { eye, fov_y, ..camera };
        renderer.render(FrameInput::new(scene, &camera, &splats, SIZE), &frame)
    };
    for fades in [false, true] {
        if fades {
            let (even, odd) = (Vec3::splat(0.8), Vec3::splat(0.2));
            scene.solids[0].surface = Surface::Ground { tile: 0.25, even, odd, fade: 6.0 };
        }
        draw(&scene, 100.0).expect("it is near");
        for distance in [1e6, 1e7] {
            let error = draw(&scene, distance).expect_err("it is far away").to_string();
            assert!(error.contains("camera") && error.contains("move it nearer than"), "{error}");
        }
    }
}

// ------------------------------------------------------------------------------------ stress

/// An f64 tracer for one ellipsoid over a floor, in front of a box, with the rules of
/// `refract/interfaces.wgsl`. Everything is in view space, except the surroundings, which are along
/// the world's axes.
struct Truth {
    view: View,
    body: Ellipsoid,
    ior: f64,
    /// Height of the floor relative to the view's origin.
    floor: f64,
    half_extent: f64,
    middle: DVec3,
    pillar: [DVec3; 2],
    tile: f64,
    origin: DVec3,
}

const ZENITH: DVec3 = DVec3::new(0.2, 0.4, 0.9);
const HORIZON: DVec3 = DVec3::new(0.8, 0.9, 0.7);
const NADIR: DVec3 = DVec3::new(0.4, 0.2, 0.1);
const EVEN: DVec3 = DVec3::new(0.7, 0.6, 0.5);
const ODD: DVec3 = DVec3::new(0.5, 0.6, 0.7);
const PILLAR: DVec3 = DVec3::new(0.3, 0.1, 0.6);

/// Unpolarised reflectance, and the cosine of the refracted angle.
fn fresnel(cos_i: f64, eta: f64) -> (f64, f64) {
    let cos2_t = ((eta - 1.0) * (eta + 1.0) + cos_i * cos_i) / (eta * eta);
    if cos2_t < 0.0 {
        return (1.0, 0.0);
    }
    let cos_t = cos2_t.sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), cos_t)
}

fn environment(world: DVec3) -> DVec3 {
    HORIZON.lerp(if world.y > 0.0 { ZENITH } else { NADIR }, world.y.abs())
}

impl Truth {
    fn environment(&self, d: DVec3) -> DVec3 {
        environment(self.view.world_vector(d))
    }

    /// Finds the nearest solid along a view-space ray: its distance and radiance.
    fn solid(&self, o: DVec3, d: DVec3) -> Option<(f64, DVec3)> {
        let (o, d) = (self.view.world_point(o), self.view.world_vector(d));
        let t = (self.floor - o.y) / d.y;
        let at = o + t * d;
        let beside = (at - self.middle).abs();
        let on_floor = t > 0.0 && beside.x.max(beside.z) <= self.half_extent;
        let tiles = ((at + self.origin) / self.tile).floor();
        let even = (tiles.x + tiles.z).rem_euclid(2.0) == 0.0;
        let floor = on_floor.then_some((t, if even { EVEN } else { ODD }));
        let [a, b] = self.pillar.map(|corner| (corner - o) / d);
        let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
        let t = if near > 0.0 { near } else { far };
        let pillar = (near <= far && t > 0.0).then_some((t, PILLAR));
        floor.into_iter().chain(pillar).min_by(|a, b| a.0.total_cmp(&b.0))
    }

    fn lookup(&self, o: DVec3, d: DVec3) -> DVec3 {
        self.solid(o, d).map_or_else(|| self.environment(d), |(_, color)| color)
    }

    /// The minimum and the maximum radiance that the pixel may have; `None` where a texel's plane
    /// is not representative: at the rim, and where the ray leaves outside the picture.
    fn pixel(&self, p: UVec2) -> Option<[DVec3; 2]> {
        let u = p.as_dvec2() + 0.5;
        let around = |reach: f64| {
            (0..9).map(move |i| reach * DVec2::new(f64::from(i % 3) - 1.0, f64::from(i / 3) - 1.0))
        };
        // Hits behind the eye do not count.
        let ahead = |hits: [f64; 2]| hits[0] > 0.0;
        let covers = |u: DVec2| self.body.hits(DVec3::ZERO, self.view.omega(u)).is_some_and(ahead);
        let covered = around(2.0).filter(|&by| covers(u + by)).count();
        let d = self.view.omega(u).normalize();
        let mut range = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let mut admit = |color: DVec3| range = [range[0].min(color), range[1].max(color)];
        match covered {
            0 => {
                // Within 1/20 of a pixel, rounding decides on which side of an edge a ray passes.
                around(0.05).for_each(|by| {
                    admit(self.lookup(DVec3::ZERO, self.view.omega(u + by).normalize()));
                });
                return Some(range);
            }
            9 => {}
            _ => return None,
        }
        let entry = self.body.hits(DVec3::ZERO, d)?[0];
        if self.solid(DVec3::ZERO, d).is_some_and(|(t, _)| t <= entry * 1.001) {
            return None;
        }
        let entry = entry * d;
        let n = self.body.normal(entry);
        let cos_i = -d.dot(n);
        let (f, cos_t) = fresnel(cos_i, self.ior);
        let reflected = f * self.environment(d.reflect(n));
        if f >= 1.0 {
            return Some([reflected; 2]);
        }
        let within = (d / self.ior + (cos_i / self.ior - cos_t) * n).normalize();
        let exit = entry + self.body.hits(entry, within)?[1] * within;
        if exit.z > -self.view.near {
            return None;
        }
        let q = self.view.pixel(exit);
        if q.min_element() < 2.0 || (q - SIZE.as_dvec2()).max_element() > -2.0 {
            return None;
        }
        // The normal there is that of the texel's centre, or of a neighbour: within 3/4 pixel.
        let [front, back] = self.body.hits(DVec3::ZERO, self.view.omega(q))?;
        let side = usize::from((-exit.z - front).abs() > (-exit.z - back).abs());
        for by in around(0.75) {
            let omega = self.view.omega(q + by);
            let m = -self.body.normal(self.body.hits(DVec3::ZERO, omega)?[side] * omega);
            let cos_j = -within.dot(m);
            if cos_j <= 0.0 {
                return None;
            }
            let (g, cos_u) = fresnel(cos_j, self.ior.recip());
            let kept = reflected + (1.0 - f) * g * self.environment(within.reflect(m));
            let out = (within * self.ior + (cos_j * self.ior - cos_u) * m).normalize();
            admit(if g < 1.0 {
                kept + (1.0 - f) * (1.0 - g) * self.lookup(exit, out)
            } else {
                kept
            });
        }
        Some(range)
    }
}

/// Generates a case of the stress test from a seed.
fn stress(seed: &mut u64) -> (Scene, Camera, Splats, Truth) {
    let mut unit = || f64::from(noise(seed));
    let scale = (unit() * 1e7f64.ln()).exp() * 1e-3;
    let far = (unit() * 1e6f64.ln()).exp() * 0.1;
    // Half of the views are wide.
    let fov_y = if unit() < 0.5 { 5.0 + 145.0 * unit() } else { 5.0 * (unit() * 30f64.ln()).exp() };
    let ior = [1.0003, 1.1, 1.33, 1.33, 1.5, 2.4, 1.0 / 1.33][(unit() * 7.0) as usize];
    let axes = if unit() < 0.5 {
        DVec3::splat(scale)
    } else {
        scale * DVec3::new(0.4 + 0.6 * unit(), 0.4 + 0.6 * unit(), 0.4 + 0.6 * unit())
    };
    let tangent = (0.5 * fov_y).to_radians().tan();
    // The ellipsoid fills the picture, or is so close that only its rim does: a grazing view.
    let grazing = unit() < 0.4;
    let filled = if grazing { 1.6 } else { 0.6 };
    let distance = scale * (1.0 / (filled * tangent)).max(1.1 + 0.3 * unit());
    let origin = far * noise_vector(seed).normalize_or(Vec3::X).as_dvec3();
    let centre = (scale as f32) * 0.1 * noise_vector(seed);
    let body = ellipsoid(centre, axes.as_vec3(), noise_turn(seed));
    let back = noise_vector(seed).normalize_or(Vec3::Z).as_dvec3();
    let middle = centre.as_dvec3();
    let eye = middle + distance * back;
    let aside = noise_vector(seed).as_dvec3().cross(back).normalize();
    // Distance of a sphere's silhouette from its centre, at the depth of the centre.
    let rim = scale / (1.0 - (scale / distance).powi(2)).sqrt();
    let target = middle + aside * if grazing { 0.9 * rim } else { 0.2 * scale };
    let up = noise_vector(seed);

    let floor = DVec3::new(0.0, -1.6 * scale, 0.0);
    let pillar = middle - 3.0 * scale * back;
    let pillar = [pillar - 0.5 * scale, pillar + 0.5 * scale];
    let half_extent = (8.0 * scale) as f32;
    let tile = scale as f32;
    let checker = Surface::Checker { tile, even: EVEN.as_vec3(), odd: ODD.as_vec3() };
    let mut scene = frames::scene();
    scene.liquid.ior = ior as f32;
    scene.environment = Environment::Gradient {
        zenith: ZENITH.as_vec3(),
        horizon: HORIZON.as_vec3(),
        nadir: NADIR.as_vec3(),
    };
    scene.solids = vec![
        Solid {
            shape: Shape::Plane { origin: origin + floor, normal: Vec3::Y, half_extent },
            surface: checker,
            lit: false,
        },
        frames::glowing(
            Shape::Box { min: origin + pillar[0], max: origin + pillar[1] },
            PILLAR.as_vec3(),
        ),
    ];
    scene.settings.refract.contact = 0.0;
    scene.settings.refract.internal_bounces = 0;
    scene.settings.refract.reflections = Reflections::Environment;
    let local = Camera { eye, target, up, fov_y: fov_y as f32, near: None, lens: None };
    let camera = Camera { eye: origin + eye, target: origin + target, ..local };
    let view = View::new(&local, SIZE);
    let truth = Truth {
        body: Ellipsoid::new(&view, &body),
        view,
        ior: f64::from(ior as f32),
        floor: floor.y,
        half_extent: half_extent.into(),
        middle: floor,
        pillar,
        tile: tile.into(),
        origin,
    };
    let splats = Splats { origin, ..frames::splats(&[body], &[], tile) };
    (scene, camera, splats, truth)
}

/// One drop over a floor, of any size, position and index, seen from anywhere, has no NaN in any
/// image and the radiance that an f64 tracer computes.
///
/// A texel is the tangent plane at its centre, so the exit's normal is that of a point within 3/4
/// of a pixel: the tracer evaluates nine of these, and the device must lie between the minimum and
/// the maximum result, within 3e-3. An edge between two colours may pass between the nine, and a
/// ray that leaves at a slant may hit the neighbouring plane: 3 % of the pixels may differ.
#[test]
fn drops_anywhere_match_the_tracer() {
    let Some(mut harness) = harness() else { return };
    let mut seed = 77;
    let (mut liquid, mut all_wrong) = (0, 0);
    for case in 0..24 {
        let (scene, camera, splats, truth) = stress(&mut seed);
        let images = harness.render(&scene, &camera, &splats, SIZE);
        let what = format!(
            "case {case}: scale {:.3}, {} from the origin, fov {:.1}, ior {:.4}",
            truth.tile, splats.origin, camera.fov_y, truth.ior
        );
        images.assert_finite();
        let (mut compared, mut wrong, mut worst, mut background, mut stray) = (0, 0, 0f64, 0, 0);
        for p in images.pixels() {
            let Some([least, most]) = truth.pixel(p) else { continue };
            let found = images.radiance(p);
            let off = (least - found).max(found - most).max_element();
            if images.at("interfaces", p) > 0.0 {
                compared += 1;
                wrong += u32::from(off > 3e-3);
                worst = worst.max(off);
            } else {
                background += 1;
                stray += u32::from(off > 1e-5);
            }
        }
        println!(
            "{what}: {wrong} of {compared} wrong by up to {worst:.2e}, {stray} of {background}"
        );
        assert!(wrong * 33 <= compared + 33, "{what}: {wrong} of {compared}, up to {worst}");
        assert!(stray == 0, "{what}: {stray} of the background");
        liquid += compared;
        all_wrong += wrong;

        // The same with everything that the tracer does not model.
        let mut full = scene;
        full.settings = Settings::default();
        full.liquid.absorption = Vec3::splat(0.5 / truth.tile as f32);
        let images = harness.render(&full, &camera, &splats, SIZE);
        images.assert_finite();
        assert!(images.pixels().all(|p| images.radiance(p).min_element() >= 0.0), "{what}");
    }
    println!("{all_wrong} of {liquid} wrong");
    assert!(all_wrong * 200 <= liquid, "{all_wrong} of {liquid}");
    assert!(liquid > 50_000, "{liquid}");
}
