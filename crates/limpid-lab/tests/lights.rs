//! Lit pictures by the renderer: direct light, shadows and light through particles, against closed
//! forms, against light traced in f64, and from frame to frame.

#[path = "../../../tests/support/even_light.rs"]
mod even_light;
#[path = "../../../tests/support/frames.rs"]
mod frames;

use std::f64::consts::PI;
use std::path::Path;

use even_light::even_light;
use frames::{FrameImages, Harness, View, gpu, harness, render, scene, splats};
use glam::{DVec2, DVec3, UVec2, Vec3, Vec3Swizzles as _};
use image::DynamicImage;
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::light_view::LightView;
use limpid::liquid::classify::Splats;
use limpid::offscreen::Picture;
use limpid::renderer::Renderer;
use limpid::scene::{Light, Scene, Shape, Solid, Surface};
use limpid::settings::Method;
use limpid_io::input::Input;
use limpid_io::project::Project;
use limpid_lab::compare::{PIXELS_PER_DEGREE, flip};
use limpid_lab::reference::analytic::{Ball, Pool};
use limpid_lab::reference::caustics::{Views, beams, on_solids};
use limpid_lab::reference::optics::fresnel;
use limpid_lab::reference::surroundings::Surroundings;
use limpid_lab::reference::trace::{MAX_DEPTH, trace_lit};
use limpid_lab::reference::{Liquid, Ray};
use limpid_lab::report::caustics::{Bench, relative_l1};
use limpid_lab::report::intersect::ViewLayers;
use limpid_sim::recipe::Recipe;
use limpid_sim::waves::{WaveSpectrum, Waves};

const SIZE: UVec2 = UVec2::new(120, 90);
const IOR: f64 = 1.33;

/// Uniform radiance of the sky, which is also the ambient light.
const SKY: f64 = 0.3;

fn camera(eye: DVec3, target: DVec3, fov_y: f32) -> Camera {
    Camera { eye, target, up: Vec3::Y, fov_y, near: None }
}

/// A lit solid of albedo 0.5.
fn lit(shape: Shape) -> Solid {
    Solid { shape, surface: Surface::Color(Vec3::splat(0.5)), lit: true }
}

fn floor() -> Solid {
    lit(Shape::Plane { origin: DVec3::ZERO, normal: Vec3::Y, half_extent: f32::INFINITY })
}

fn sun(direction: Vec3) -> Light {
    Light::Sun { direction, irradiance: Vec3::splat(2.0) }
}

/// Solids and lights under a uniform sky, without liquid.
fn dry(solids: &[Solid], lights: &[Light]) -> Scene {
    Scene {
        environment: Environment::Constant(Vec3::splat(SKY as f32)),
        solids: solids.to_vec(),
        lights: lights.to_vec(),
        ..scene()
    }
}

fn nothing() -> Splats {
    splats(&[], &[], 0.05)
}

/// The particles of `recipe` among lit solids under a uniform sky, with the default settings; red
/// light is absorbed.
fn wet(recipe: &str, solids: &[Solid], lights: &[Light]) -> (Scene, Splats) {
    let text = format!(
        "[recipe]\n{recipe}\n[liquid]\nior = {IOR:?}\nabsorption = [1.0, 0.0, 0.0]\n\
         [environment]\nradiance = [{SKY:?}, {SKY:?}, {SKY:?}]\n\
         [camera]\neye = [0.0, 0.0, 1.0]\ntarget = [0.0, 0.0, 0.0]\nfov_y = 40.0\n"
    );
    let mut project = Project::parse(&text, "lights", Path::new(".")).expect("a valid scene");
    let scene = &mut project.scene;
    scene.solids = solids.to_vec();
    scene.lights = lights.to_vec();
    scene.settings.caustics.resolution = 128;
    scene.settings.caustics.grid = 128;
    let input = Input::from_project(project, "lights").expect("a recipe");
    let (input, project) = input.resolve().expect("a camera");
    let loaded = input.load(&input.sequence.frames[0], &project.scene).expect("particles");
    (project.scene, loaded.splats)
}

/// A block of liquid on the floor, 2 m wide and 0.4 m high.
fn slab(lights: &[Light]) -> (Scene, Splats) {
    let at = "kind = \"slab\"\nmin = [-1.0, 0.0, -1.0]\nmax = [1.0, 0.4, 1.0]\ncount = 20000";
    wet(at, &[floor()], lights)
}

/// A drop of radius 0.5 m with its centre 1.6 m above the floor.
const DROP: Ball = Ball { center: DVec3::new(0.0, 1.6, 0.0), radius: 0.5 };

fn drop(lights: &[Light]) -> (Scene, Splats) {
    let at = "kind = \"ball\"\ncenter = [0.0, 1.6, 0.0]\nradius = 0.5\ncount = 5000";
    let (mut scene, drop) = wet(at, &[floor()], lights);
    scene.settings.caustics.margin = 1.0;
    (scene, drop)
}

/// The world-space ray through a pixel position.
fn ray(camera: &Camera, view: &View, u: DVec2) -> Ray {
    Ray { origin: camera.eye, direction: view.world_vector(view.omega(u)).normalize() }
}

/// The point where the ray through a pixel's centre hits the floor.
fn on_floor(camera: &Camera, view: &View, p: UVec2) -> Option<DVec3> {
    let ray = ray(camera, view, p.as_dvec2() + 0.5);
    let t = -ray.origin.y / ray.direction.y;
    (t > 0.0).then(|| ray.at(t))
}

#[track_caller]
fn assert_close(got: DVec3, expected: DVec3, tolerance: f64, what: &str) {
    let error = ((got - expected) / expected).abs().max_element();
    assert!(error <= tolerance, "{what}: {got}, not {expected}: off by {error:e}");
}

// ------------------------------------------------------------------------- light without liquid

/// A box 1 m high under a sun at 45° shadows 1 m of the floor next to it; in the shadow only the
/// sky lights the floor, around it also the sun by its cosine, at every pixel.
#[test]
fn box_shadows_have_their_closed_form() {
    let Some(mut harness) = harness() else { return };
    let stand =
        lit(Shape::Box { min: DVec3::new(-0.5, 0.0, -0.5), max: DVec3::new(0.5, 1.0, 0.5) });
    let scene = dry(&[floor(), stand], &[sun(Vec3::new(1.0, -1.0, 0.0))]);
    let camera = camera(DVec3::new(1.5, 5.0, 3.0), DVec3::new(0.7, 0.0, 0.0), 40.0);
    let shot = harness.render(&scene, &camera, &nothing(), SIZE);
    let view = View::new(&camera, SIZE);
    let surroundings = Surroundings::new(&scene);
    let mut seen = [0, 0];
    for p in shot.pixels() {
        let hit = surroundings.hit(&ray(&camera, &view, p.as_dvec2() + 0.5));
        let Some(x) = hit.filter(|hit| hit.solid == 0).map(|hit| hit.point) else { continue };
        // Signed distance to the border of the shadow's rectangle, positive inside.
        let inside = (0.5 - (x.x - 1.0).abs()).min(0.5 - x.z.abs());
        if inside.abs() < 1e-3 {
            continue;
        }
        let dark = inside > 0.0;
        let direct = if dark { 0.0 } else { 2.0 * 0.5f64.sqrt() / PI };
        assert_close(shot.radiance(p), DVec3::splat(0.5 * (SKY + direct)), 1e-5, &format!("{x}"));
        seen[usize::from(dark)] += 1;
    }
    assert!(seen[0] > 2000 && seen[1] > 300, "{seen:?}");
}

/// Neither shadow acne nor detached shadows: adjacent planes, boxes and spheres, as large as rooms
/// and as small as grains, 1000 km from the origin and seen from afar, against shadows in f64.
/// Pixels on an edge are skipped.
#[test]
fn solids_do_not_shadow_themselves() {
    let Some(mut harness) = harness() else { return };
    for (scale, moved, afar) in
        [(1.0, 0.0, 1.0), (1.0, 1e6, 1.0), (1e-3, 0.0, 1.0), (1.0, 0.0, 100.0), (1e3, 0.0, 1.0)]
    {
        let at = |x: f64, y: f64, z: f64| scale * DVec3::new(x, y, z) + moved;
        let radius = (0.4 * scale) as f32;
        let slope = Vec3::new(1.0, 2.0, 0.5).normalize();
        let half_extent = scale as f32;
        let plane =
            |normal, half_extent| Shape::Plane { origin: at(0.0, 0.0, 0.0), normal, half_extent };
        let ramp = Shape::Plane { origin: at(-1.5, 0.5, 0.0), normal: slope, half_extent };
        let solids = [
            plane(Vec3::Y, f32::INFINITY),
            ramp,
            Shape::Box { min: at(-0.4, 0.0, -0.4), max: at(0.4, 0.7, 0.4) },
            Shape::Sphere { center: at(0.9, 0.4, 0.3), radius },
            Shape::Sphere { center: at(0.0, 1.1, 0.0), radius },
        ];
        let lights = [sun(Vec3::new(0.6, -1.0, 0.3)), sun(Vec3::new(-0.9, -0.2, -0.5))];
        let scene = dry(&solids.map(lit), &lights);
        let eye = at(0.0, 0.3, 0.0) + afar * scale * DVec3::new(1.0, 2.5, 4.0);
        let camera = camera(eye, at(0.0, 0.3, 0.0), 45.0 / afar as f32);
        let shot = harness.render(&scene, &camera, &nothing(), SIZE);
        let view = View::new(&camera, SIZE);
        let surroundings = Surroundings::new(&scene);
        let (mut compared, mut off) = (0, Vec::new());
        for p in shot.pixels() {
            let truth = |dx, dy| {
                surroundings.radiance(&ray(&camera, &view, p.as_dvec2() + DVec2::new(dx, dy)))
            };
            let middle = truth(0.5, 0.5);
            let around = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|(x, y)| truth(x, y));
            if around.iter().all(|a| (a - middle).abs().max_element() < 0.1 * middle.max_element())
            {
                compared += 1;
                let error = ((shot.radiance(p) - middle) / middle).abs().max_element();
                if error > 2e-3 {
                    off.push((p, error));
                }
            }
        }
        println!("{scale} {moved} {afar}: {compared}, off {:?}", &off[..off.len().min(5)]);
        assert!(compared > 9000, "{compared}");
        assert!(off.is_empty(), "{} of {compared} at {scale}, {moved}, {afar}: {off:?}", off.len());
    }
}

/// Point lights: inverse square and cosine at every pixel, the shadow of a solid in between, and
/// none of a solid behind the light.
#[test]
fn point_lights_follow_the_inverse_square() {
    let Some(mut harness) = harness() else { return };
    let position = DVec3::new(0.3, 1.2, -0.2);
    let lights = [Light::Point { position, intensity: Vec3::new(4.0, 2.0, 1.0) }];
    let ball = |y: f64, radius| lit(Shape::Sphere { center: position.with_y(y), radius });
    let camera = camera(DVec3::new(0.0, 1.5, 6.0), DVec3::ZERO, 40.0);
    let view = View::new(&camera, SIZE);
    // A large ball behind the light, and a small one between it and the floor.
    for (solids, radius) in [
        (vec![floor()], 0.0),
        (vec![floor(), ball(2.5, 1.0)], 0.0),
        (vec![floor(), ball(0.6, 0.1)], 0.1),
    ] {
        let scene = dry(&solids, &lights);
        let shot = harness.render(&scene, &camera, &nothing(), SIZE);
        let surroundings = Surroundings::new(&scene);
        // The shadow of a ball halfway to the floor is a disc.
        let shadow = 1.2 * f64::tan(f64::asin(radius / 0.6));
        let mut seen = [0, 0];
        for p in shot.pixels() {
            let hit = surroundings.hit(&ray(&camera, &view, p.as_dvec2() + 0.5));
            let Some(x) = hit.filter(|hit| hit.solid == 0).map(|hit| hit.point) else { continue };
            let beside = x.distance(position.with_y(0.0)) - shadow;
            if x.length() > 8.0 || radius > 0.0 && beside.abs() < 1e-3 {
                continue;
            }
            let dark = beside < 0.0;
            let distance = x.distance(position);
            let share = if dark { 0.0 } else { 1.2 / distance.powi(3) / PI };
            let expected = 0.5 * (SKY + DVec3::new(4.0, 2.0, 1.0) * share);
            assert_close(shot.radiance(p), expected, 1e-4, &format!("{x}"));
            seen[usize::from(dark)] += 1;
        }
        assert!(seen[0] > 2000 && (radius == 0.0 || seen[1] > 10), "{seen:?}");
    }
}

/// Unlit scenes cost nothing: without lights, or without lit solids, no pass of a light runs and
/// there is no map; and a light without lit solids changes no bit of the picture.
#[test]
fn unlit_scenes_skip_light_passes() {
    let Some(mut harness) = harness() else { return };
    let Harness { gpu, renderer } = &mut *harness;
    let (lit, drop) = drop(&[sun(Vec3::new(0.3, -1.0, 0.2))]);
    let dark = Scene { lights: Vec::new(), ..lit.clone() };
    let mut glowing = lit.clone();
    glowing.solids.iter_mut().for_each(|solid| solid.lit = false);
    let glowing_dark = Scene { lights: Vec::new(), ..glowing.clone() };
    let camera = camera(DVec3::new(0.0, 2.5, 5.0), DVec3::Y, 40.0);
    let mut draw = |scene: &Scene| {
        renderer.timing = true;
        renderer.forget();
        let frame = Picture::new(gpu, SIZE).expect("a frame");
        let times = renderer
            .render(scene, &camera, &drop, &frame.view(), Picture::FORMAT, SIZE)
            .expect("the frame is drawn");
        renderer.timing = false;
        let names: Vec<_> = times.iter().map(|time| time.name).collect();
        let of_light = names.iter().any(|n| n.starts_with("light ") || *n == "caustics");
        let maps = renderer.images().caustics;
        (of_light, names.is_empty(), maps, render(gpu, renderer, scene, &camera, &drop, SIZE))
    };
    let (of_light, untimed, maps, _) = draw(&lit);
    assert!(of_light || untimed);
    assert!(maps.len() == 1 && maps[0].is_some());
    let same = |a: &FrameImages, b: &FrameImages| {
        a.channels.keys().all(|name| {
            let bits = |shot: &FrameImages| {
                shot.channel(name).iter().map(|v| v.to_bits()).collect::<Vec<_>>()
            };
            bits(a) == bits(b)
        })
    };
    let shots = [&dark, &glowing, &glowing_dark].map(|scene| {
        let (of_light, _, maps, shot) = draw(scene);
        assert!(!of_light && maps.is_empty(), "{maps:?}");
        shot
    });
    assert!(same(&shots[1], &shots[2]), "a light without lit solids changes the picture");
}

// ---------------------------------------------------------------------------- light through liquid

/// The transmittance of unpolarised light that enters water at an angle of the given cosine, and
/// the cosine of the refracted angle.
fn entering(cos_theta_i: f64) -> (f64, f64) {
    let cos_theta_t = (1.0 - (1.0 - cos_theta_i * cos_theta_i) / (IOR * IOR)).sqrt();
    (1.0 - fresnel(cos_theta_i, IOR), cos_theta_t)
}

/// Light under still liquid, from particles to the picture: the floor under a block receives E T
/// cos(theta) exp(-sigma l) by every method, to 3 % in its mean, so the methods agree; ambient
/// light is that of `even_light`; and the floor next to the block does not change.
#[test]
fn the_floor_under_a_slab_has_its_closed_form() {
    let Some(mut harness) = harness() else { return };
    let direction = Vec3::new(0.3, -1.0, 0.2);
    let (mut scene, slab) = slab(&[sun(direction)]);
    let camera = camera(DVec3::new(0.0, 6.0, 1.0), DVec3::ZERO, 36.0);
    let view = View::new(&camera, SIZE);
    let alone = harness.render(&scene, &camera, &Splats { radius: slab.radius, ..nothing() }, SIZE);
    let height = 0.4;
    let absorption = DVec3::X;
    let cos_theta_i = -direction.as_dvec3().normalize().y;
    let (transmitted, cos_theta_t) = entering(cos_theta_i);
    let arriving = 2.0 * transmitted * cos_theta_i * (-height / cos_theta_t * absorption).exp();
    let mut means = Vec::new();
    for method in Method::ALL {
        scene.settings.caustics.method = method;
        let shot = harness.render(&scene, &camera, &slab, SIZE);
        shot.assert_finite();
        let (mut sum, mut expected, mut spread, mut count) = (DVec3::ZERO, DVec3::ZERO, 0.0, 0);
        for p in shot.pixels() {
            let Some(x) = on_floor(&camera, &view, p) else { continue };
            let far = x.with_y(0.0).abs().max_element();
            if far > 1.6 {
                let (got, without) = (shot.radiance(p), alone.radiance(p));
                assert_close(got, without, 1e-3, &format!("{method:?}, beside the slab at {x}"));
            }
            if far > 0.6 {
                continue;
            }
            let ray = ray(&camera, &view, p.as_dvec2() + 0.5);
            let (seen, cos) = entering(-ray.direction.y);
            let lit = 0.5 * (SKY * even_light(IOR, absorption, height) + arriving / PI);
            let here = seen / (IOR * IOR) * (-height / cos * absorption).exp() * lit;
            let here = here + (1.0 - seen) * SKY;
            sum += shot.radiance(p);
            expected += here;
            spread += (shot.radiance(p) - here).abs().element_sum() / here.element_sum();
            count += 1;
        }
        let (mean, expected) = (sum / f64::from(count), expected / f64::from(count));
        let spread = spread / f64::from(count);
        println!("{method:?}: {mean}, expected {expected}, each off by {spread:.3}");
        assert!(count > 500, "{count}");
        assert_close(mean, expected, 0.03, &format!("{method:?}"));
        assert!(spread < 0.12, "{method:?}: {spread}");
        means.push(mean);
    }
    for mean in &means {
        assert_close(*mean, means[0], 0.03, "methods");
    }
}

/// `straight`, without caustics: under a plate in the air, the floor has the light that both faces
/// and absorption transmit, where a straight line to the sun passes through the plate, and nowhere
/// more light than without the plate.
#[test]
fn straight_light_is_attenuated_by_a_plate() {
    let Some(mut harness) = harness() else { return };
    let at = "kind = \"slab\"\nmin = [-1.0, 1.0, -1.0]\nmax = [1.0, 1.3, 1.0]\ncount = 15000";
    let (mut scene, plate) = wet(at, &[floor()], &[sun(Vec3::NEG_Y)]);
    scene.settings.caustics.method = Method::Straight;
    let camera = camera(DVec3::new(0.0, 0.7, 7.0), DVec3::new(0.0, 0.2, 0.0), 30.0);
    let view = View::new(&camera, SIZE);
    let shot = harness.render(&scene, &camera, &plate, SIZE);
    let (transmitted, _) = entering(1.0);
    let passed = transmitted * transmitted * (-0.3 * DVec3::X).exp();
    let (mut sum, mut count) = (DVec3::ZERO, 0);
    for p in shot.pixels() {
        // Pixels that see the floor under the plate, but not through it.
        let Some(x) =
            on_floor(&camera, &view, p).filter(|_| shot.at("depth.aggregate_front", p) == 0.0)
        else {
            continue;
        };
        assert!(shot.radiance(p).max_element() <= 0.5 * (SKY + 2.0 / PI) + 1e-5, "{x}");
        if x.x.abs() < 0.7 && x.z.abs() < 0.7 {
            sum += shot.radiance(p);
            count += 1;
        }
    }
    assert!(count > 100, "{count}");
    let expected = 0.5 * (SKY + 2.0 * passed / PI);
    assert_close(sum / f64::from(count), expected, 0.03, "under the plate");
}

/// Light of a drop, from particles to the picture: of the light that the drop intercepts, the share
/// missing on the floor is what its two faces reflect, its inside absorbs and it refracts out of
/// the light's view, within 4 %; and behind the drop there is a spot brighter than under the sun
/// alone, although it is far beyond the focus.
#[test]
fn a_drop_transmits_its_light() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, drop) = drop(&[sun(Vec3::NEG_Y)]);
    // Enough samples not to miss the spot.
    scene.settings.refract.samples = 16;
    let camera = camera(DVec3::new(0.0, 0.9, 4.0), DVec3::new(0.0, 0.1, 0.0), 46.0);
    let size = UVec2::new(200, 150);
    let view = View::new(&camera, size);
    let with = harness.render(&scene, &camera, &drop, size);
    let map = harness.renderer.images().caustics[0].clone().expect("a map");
    let without =
        harness.render(&scene, &camera, &Splats { radius: drop.radius, ..nothing() }, size);
    let (mut missing, mut brightest) = (DVec3::ZERO, 0.0f64);
    for p in with.pixels() {
        let Some(x) = on_floor(&camera, &view, p) else { continue };
        if x.x.abs().max(x.z.abs()) > 1.4 {
            continue;
        }
        assert_eq!(with.at("depth.aggregate_front", p), 0.0, "the drop hides the floor at {x}");
        let ray = x - camera.eye;
        // A pixel's area on the floor.
        let cosine = -ray.y / ray.length();
        let omega = view.through(p);
        let solid_angle = view.footprint().powi(2) / omega.length().powi(3);
        let area = solid_angle * ray.length_squared() / cosine;
        let radiosity = PI / 0.5 * (without.radiance(p) - with.radiance(p));
        missing += area * radiosity;
        brightest = brightest.max(with.radiance(p).y / without.radiance(p).y);
    }
    // Integrates over the distance from the axis at which light enters.
    let half = map.view.half_extent.x.min(1.4);
    let n = 4000;
    let passed: DVec3 = (0..n)
        .map(|i| {
            let b = (f64::from(i) + 0.5) / f64::from(n);
            let cos_i = (1.0 - b * b).sqrt();
            let (transmitted, cos_t) = entering(cos_i);
            // Deviation towards the axis by each face.
            let turned = b.asin() - cos_t.acos();
            let x = DROP.radius * (b - 2.0 * cos_t * turned.sin());
            let y = DROP.center.y + DROP.radius * (cos_i - 2.0 * cos_t * turned.cos());
            let lands = x - y * (2.0 * turned).tan();
            let kept = lands.abs() < half && 2.0 * turned < 0.5 * PI;
            let inside = (-2.0 * DROP.radius * cos_t * DVec3::X).exp();
            2.0 * b / f64::from(n) * transmitted * transmitted * inside * f64::from(u8::from(kept))
        })
        .sum();
    let in_the_way = 2.0 * PI * DROP.radius * DROP.radius;
    let got = 1.0 - missing / in_the_way;
    println!("passed {got}, expected {passed}; brightest {brightest}");
    assert!((got - passed).abs().max_element() < 0.04, "{got}, not {passed}");
    assert!(brightest > 1.6, "{brightest}");
}

/// With several lights the maps are layers of one texture, and the picture is the sum of the
/// contributions of the single lights.
#[test]
fn contributions_of_lights_add() {
    let Some(mut harness) = harness() else { return };
    let lights = [
        sun(Vec3::new(0.5, -1.0, 0.1)),
        Light::Point {
            position: DVec3::new(-0.8, 4.0, 0.5),
            intensity: Vec3::new(20.0, 10.0, 5.0),
        },
    ];
    let (mut scene, drop) = drop(&lights);
    // Adaptive sampling uses a threshold, which is not under test here.
    scene.settings.refract.edge_samples = 1;
    let camera = camera(DVec3::new(0.5, 2.5, 5.0), DVec3::new(0.0, 0.7, 0.0), 40.0);
    let mut draw = |lights: &[Light]| {
        let scene = Scene { lights: lights.to_vec(), ..scene.clone() };
        let shot = harness.render(&scene, &camera, &drop, SIZE);
        (shot, harness.renderer.images().caustics.iter().flatten().count())
    };
    let (both, maps) = draw(&lights);
    assert_eq!(maps, 2);
    let [first, second, none] = [&lights[..1], &lights[1..], &[]].map(|lights| draw(lights).0);
    let mut lit = 0.0f64;
    for p in both.pixels() {
        let dark = none.radiance(p);
        let sum = first.radiance(p) + second.radiance(p) - dark;
        let error = (both.radiance(p) - sum).abs().max_element();
        assert!(error < 1e-4 * sum.max_element().max(1.0), "{p}: {error}");
        lit = lit.max((second.radiance(p) - dark).max_element());
    }
    assert!(lit > 0.1, "{lit}");
}

/// Frames with caustics are bit-identical when rendered again, in another order, and by a new
/// renderer.
#[test]
fn lit_frames_are_independent() {
    let Some(gpu) = gpu() else { return };
    let point = Light::Point { position: DVec3::new(0.5, 4.0, 0.3), intensity: Vec3::splat(20.0) };
    let (one, drop) = drop(&[sun(Vec3::new(0.3, -1.0, 0.2))]);
    let (two, slab) = slab(&[point, sun(Vec3::new(-0.5, -1.0, 0.2))]);
    let mut gathered = two.clone();
    gathered.settings.caustics.method = Method::Gather;
    let mut larger = one.clone();
    larger.settings.caustics.resolution = 200;
    larger.settings.caustics.grid = 150;
    larger.settings.caustics.blur = 0.02;
    let dark = Scene { lights: Vec::new(), ..one.clone() };
    let nothing = nothing();
    let frames = [
        (&one, &drop),
        (&two, &slab),
        (&dark, &drop),
        (&gathered, &slab),
        (&larger, &drop),
        (&two, &nothing),
    ];
    let camera = camera(DVec3::new(0.5, 2.5, 5.0), DVec3::new(0.0, 0.7, 0.0), 40.0);
    let size = UVec2::new(80, 60);
    let draw = |renderer: &mut Renderer, (scene, drawn): (&Scene, &Splats)| {
        let shot = render(&gpu, renderer, scene, &camera, drawn, size);
        let maps = renderer.images().caustics;
        let maps: Vec<_> = maps.iter().flatten().map(|m| m.read(&gpu).expect("a map")).collect();
        let texels = maps.iter().flat_map(|(map, depth)| map.as_flattened().iter().chain(depth));
        let texels: Vec<_> = texels.map(|v| v.to_bits()).collect();
        let radiance = ["R", "G", "B"].map(|c| {
            let values = shot.channel(&format!("radiance.{c}")).iter();
            values.map(|v| v.to_bits()).collect::<Vec<_>>()
        });
        (radiance, texels)
    };
    let mut kept = Renderer::new(&gpu);
    let first: Vec<_> = frames.iter().map(|&frame| draw(&mut kept, frame)).collect();
    assert!(draw(&mut Renderer::new(&gpu), frames[4]) == first[4], "by a new renderer");
    for i in [4, 1, 1, 5, 0, 3, 2, 4, 0] {
        assert!(draw(&mut kept, frames[i]) == first[i], "frame {i}");
    }
}

/// Stray particles do not reduce the resolution of the maps: a splash at a thousand times the
/// slab's width changes no view, and a drop above a lamp leaves the lamp a map of the slab.
#[test]
fn stray_splashes_do_not_change_the_maps() {
    let Some(mut harness) = harness() else { return };
    let lamp = Light::Point { position: DVec3::new(0.0, 1.6, 0.0), intensity: Vec3::ONE };
    let (scene, whole) = slab(&[sun(Vec3::new(0.3, -1.0, 0.2)), lamp]);
    let camera = camera(DVec3::new(0.0, 2.0, 4.0), DVec3::ZERO, 40.0);
    let mut views = |splash: Option<Vec3>| -> Vec<LightView> {
        let mut splats = whole.clone();
        splats.splashes.extend(splash.map(|at| frames::sphere(at, whole.radius)));
        harness.render(&scene, &camera, &splats, UVec2::new(16, 12));
        let maps = harness.renderer.images().caustics;
        maps.into_iter().map(|map| map.expect("a map").view).collect()
    };
    let alone = views(None);
    for lost in [Vec3::new(2000.0, 0.0, 0.0), Vec3::new(10.0, -2000.0, 500.0)] {
        assert_eq!(views(Some(lost)), alone, "a splash at {lost}");
    }
    let below = views(Some(Vec3::new(0.1, 2.0, 0.0)));
    let change = below[1].half_extent / alone[1].half_extent;
    assert!((change - 1.0).abs().max_element() < 0.1, "{change}");
}

/// `caustics.blur` is the standard deviation, in metres, of a blurred spot in either direction, and
/// the map keeps its light, to 2 %.
#[test]
fn blur_has_its_width_and_keeps_light() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, drop) = drop(&[sun(Vec3::NEG_Y)]);
    let camera = camera(DVec3::new(0.0, 2.5, 5.0), DVec3::Y, 40.0);
    let mut measure = |blur: f32| {
        scene.settings.caustics.blur = blur;
        harness.render(&scene, &camera, &drop, UVec2::new(32, 24));
        let map = harness.renderer.images().caustics[0].clone().expect("a map");
        let (irradiance, _) = map.read(&harness.gpu).expect("a map");
        let size = map.view.size;
        let (mut sum, mut moment, mut most) = (0.0, 0.0, 0.0f64);
        for (e, i) in irradiance.iter().zip(0..) {
            let u = UVec2::new(i % size.x, i / size.x).as_dvec2() + 0.5;
            let x = (2.0 * u / size.as_dvec2() - 1.0) * map.view.half_extent;
            sum += f64::from(e[1]);
            moment += f64::from(e[1]) * x.length_squared();
            most = most.max(e[1].into());
        }
        (sum, moment / sum, most)
    };
    let (sum, moment, most) = measure(0.0);
    for blur in [0.03, 0.1] {
        let (blurred, wider, less) = measure(blur);
        let width = (0.5 * (wider - moment)).max(0.0).sqrt();
        println!("{blur}: light {}, width {width}, peak {}", blurred / sum, less / most);
        assert!((blurred / sum - 1.0).abs() < 0.02, "{blur}: {blurred}, not {sum}");
        assert!((width / f64::from(blur) - 1.0).abs() < 0.1, "{width}, not {blur}");
        assert!(less < 0.8 * most, "{less} of {most}");
    }
}

/// Radiance is finite wherever the light is: in the liquid, on its surface, on a solid, straight
/// above, along the floor, below it; with a liquid of no particle, one and many.
#[test]
fn unusual_lights_give_finite_pictures() {
    let Some(mut harness) = harness() else { return };
    let point =
        |x, y, z| Light::Point { position: DVec3::new(x, y, z), intensity: Vec3::splat(5.0) };
    let lights = [
        point(0.0, 0.2, 0.0),
        point(0.0, 0.4, 0.0),
        point(0.0, 0.45, 0.0),
        point(2.0, 0.0, 0.0),
        point(0.0, 1e5, 0.0),
        point(0.0, -2.0, 0.0),
        sun(Vec3::NEG_Y),
        sun(Vec3::Y),
        sun(Vec3::X),
        sun(Vec3::new(1.0, -1e-3, 0.0)),
        sun(Vec3::new(1e-20, -1e-20, 0.0)),
        sun(Vec3::new(1e-5, -1e5, 0.0)),
    ];
    let (mut scene, slab) = slab(&[]);
    let one = Splats { aggregates: slab.aggregates[..1].to_vec(), ..slab.clone() };
    let spray = Splats {
        aggregates: Vec::new(),
        splashes: vec![frames::sphere(Vec3::new(0.1, 0.5, 0.2), 0.05)],
        ..slab
    };
    scene.settings.caustics.resolution = 64;
    scene.settings.caustics.grid = 64;
    let camera = camera(DVec3::new(0.5, 2.0, 3.0), DVec3::new(0.0, 0.2, 0.0), 40.0);
    let size = UVec2::new(48, 36);
    for method in Method::ALL {
        scene.settings.caustics.method = method;
        for light in lights {
            scene.lights = vec![light];
            for drawn in [&slab, &one, &spray, &nothing()] {
                // The kinds of liquid select pipeline variants, which one method covers.
                if drawn.aggregates.len() < 2 && method != Method::Forward {
                    continue;
                }
                let shot = harness.render(&scene, &camera, drawn, size);
                shot.assert_finite();
                let name = format!("{method:?}, {light:?}");
                let least =
                    shot.pixels().map(|p| shot.radiance(p).min_element()).fold(1.0, f64::min);
                assert!(least >= 0.0, "{name}: {least}");
                for map in harness.renderer.images().caustics.iter().flatten() {
                    let (irradiance, depths) = map.read(&harness.gpu).expect("a map");
                    let good = |v: &f32| v.is_finite() && *v >= 0.0;
                    assert!(irradiance.as_flattened().iter().all(good), "{name}: map");
                    assert!(depths.iter().all(|d| d.is_finite()), "{name}: depths");
                }
            }
        }
    }
}

/// A camera in the liquid sees the floor lit by light through the surface, attenuated on the way to
/// the camera, and finite everywhere.
#[test]
fn the_floor_is_lit_for_a_submerged_camera() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, slab) = slab(&[sun(Vec3::NEG_Y)]);
    let camera = camera(DVec3::new(0.0, 0.25, 0.3), DVec3::new(0.0, 0.0, 0.0), 40.0);
    let mut draw = |scene: &Scene| harness.render(scene, &camera, &slab, SIZE);
    let lit = draw(&scene);
    lit.assert_finite();
    scene.lights.clear();
    let dark = draw(&scene);
    let view = View::new(&camera, SIZE);
    let (mut sum, mut count) = (DVec3::ZERO, 0);
    for p in lit.pixels() {
        let Some(x) = on_floor(&camera, &view, p).filter(|x| x.abs().max_element() < 0.5) else {
            continue;
        };
        let left = (-(x - camera.eye).length() * DVec3::X).exp();
        sum += (lit.radiance(p) - dark.radiance(p)) / left;
        count += 1;
    }
    assert!(count > 1000, "{count}");
    let expected = 0.5 * 2.0 / PI * entering(1.0).0 * (-0.4 * DVec3::X).exp();
    assert_close(sum / f64::from(count), expected, 0.05, "light on the floor");
}

/// The floor of a pool receives the ambient light that is left at its depth, compared with an unlit
/// floor of the same radiance; seen from above, at a slant and from inside the liquid. The
/// particles' surface may be up to a radius below the block's.
#[test]
fn ambient_light_is_attenuated_with_depth() {
    let Some(mut harness) = harness() else { return };
    let absorption = DVec3::new(1.0, 0.3, 0.0);
    for depth in [0.2, 1.0, 4.0] {
        let (side, bottom) = (4.0 * depth, DVec3::new(0.0, -depth, 0.0));
        let at = format!(
            "kind = \"slab\"\nmin = [-{side:?}, -{depth:?}, -{side:?}]\n\
             max = [{side:?}, 0.0, {side:?}]\ncount = 20000"
        );
        let floor = Shape::Plane { origin: bottom, normal: Vec3::Y, half_extent: f32::INFINITY };
        let (mut scene, drawn) = wet(&at, &[lit(floor)], &[]);
        scene.liquid.absorption = absorption.as_vec3();
        let glowing = |radiance: f64| {
            let mut scene = scene.clone();
            scene.solids[0].surface = Surface::Color(Vec3::splat(radiance as f32));
            scene.solids[0].lit = false;
            scene
        };
        let scenes = [scene.clone(), glowing(0.5 * SKY), glowing(0.0)];
        for (eye, target) in
            [([0.0, 3.0, 0.5], 0.0), ([0.0, 1.5, 3.0], 0.0), ([0.0, -0.4, 0.2], -1.0)]
        {
            let eye = depth * DVec3::from_array(eye);
            let camera = camera(eye, DVec3::new(0.0, target * depth, 0.0), 36.0);
            let view = View::new(&camera, SIZE);
            let shots = scenes.each_ref().map(|s| harness.render(s, &camera, &drawn, SIZE));
            let (mut sums, mut count) = ([DVec3::ZERO; 3], 0);
            for p in shots[0].pixels() {
                let ray = ray(&camera, &view, p.as_dvec2() + 0.5);
                let at = ray.at(eye.y.abs() / ray.direction.y.abs());
                if ray.direction.y >= 0.0 || at.xz().abs().max_element() > 2.5 * depth {
                    continue;
                }
                for (sum, shot) in sums.iter_mut().zip(&shots) {
                    *sum += shot.radiance(p);
                }
                count += 1;
            }
            assert!(count > 2000, "{count}");
            let share = (sums[0] - sums[2]) / (sums[1] - sums[2]);
            let depths = [depth, depth - f64::from(drawn.radius)];
            let [least, most] = depths.map(|depth| even_light(IOR, absorption, depth));
            println!("{depth} m, from {eye}: {share}, {least} to {most}");
            assert!(share.cmpge(0.99 * least).all() && share.cmple(1.01 * most).all(), "{share}");
        }
    }
}

/// Finds the end of the shadow on the floor next to a block that extends to x = 0.6 m, under a sun
/// at 45 degrees from −x, by the share of dark pixels between 0.8 and 1.6 m.
fn shadow_end(harness: &mut Harness, scene: &Scene, drawn: &Splats) -> f64 {
    let camera = camera(DVec3::new(1.2, 5.0, 0.0), DVec3::new(1.2, 0.0, 0.01), 26.0);
    let view = View::new(&camera, SIZE);
    let shot = harness.render(scene, &camera, drawn, SIZE);
    let half_lit = 0.5 * (SKY + 0.5 * 2.0 * 0.5f64.sqrt() / PI);
    let (mut dark, mut seen) = (0.0, 0.0);
    for p in shot.pixels() {
        let Some(x) = on_floor(&camera, &view, p) else { continue };
        if x.z.abs() < 0.3 && (0.8..1.6).contains(&x.x) {
            dark += f64::from(u8::from(shot.radiance(p).y < half_lit));
            seen += 1.0;
        }
    }
    assert!(seen > 500.0, "{seen}");
    0.8 + 0.8 * dark / seen
}

/// Shadows of liquid without walls: the floor has no direct light where the straight line to the
/// sun meets the block, although the map looks along refracted light; and a bump on the top, far
/// from the edge that casts the shadow, does not move its end.
#[test]
fn a_block_of_liquid_casts_a_straight_shadow() {
    let Some(mut harness) = harness() else { return };
    let at = "kind = \"slab\"\nmin = [-0.6, 0.0, -0.6]\nmax = [0.6, 0.6, 0.6]\ncount = 15000";
    let (scene, block) = wet(at, &[floor()], &[sun(Vec3::new(1.0, -1.0, 0.0))]);
    let level = shadow_end(&mut harness, &scene, &block);
    assert!(harness.renderer.images().caustics[0].as_ref().is_some_and(|m| m.view.level.is_some()));
    let mut bumped = block.clone();
    for splat in &block.aggregates {
        let [x, y, z] = splat.centre.map(f64::from);
        if x < -0.25 && y > 0.3 {
            let centre = [x, y + 0.25, z].map(|v| v as f32);
            bumped.aggregates.push(limpid::liquid::classify::Splat { centre, ..*splat });
        }
    }
    let bump = shadow_end(&mut harness, &scene, &bumped);
    assert!(harness.renderer.images().caustics[0].as_ref().is_some_and(|m| m.view.level.is_none()));
    println!("the shadow ends at {level} m, {bump} m with a bump");
    // The block's edge is rounded by about a particle.
    assert!((level - 1.2).abs() < 0.04, "{level}, not 1.2 m");
    assert!((bump - level).abs() < 0.015, "{level} m, {bump} m with a bump");
}

/// Lights too close to the liquid for one view: under a lamp over a wide pool each point of the
/// floor receives what Fresnel reflection and absorption (Beer and Lambert) leave on the straight
/// line.
#[test]
fn a_lamp_close_to_a_pool_is_absorbed() {
    let Some(mut harness) = harness() else { return };
    let position = DVec3::new(0.1, 0.55, 0.05);
    let lamp = Light::Point { position, intensity: Vec3::splat(3.0) };
    let (mut scene, slab) = slab(&[lamp]);
    let camera = camera(DVec3::new(0.0, 3.0, 0.2), DVec3::ZERO, 30.0);
    let lit = harness.render(&scene, &camera, &slab, SIZE);
    lit.assert_finite();
    assert_eq!(harness.renderer.lights_without_caustics(), [0]);
    scene.lights.clear();
    let dark = harness.render(&scene, &camera, &slab, SIZE);
    let view = View::new(&camera, SIZE);
    let mut shares: [Vec<DVec3>; 3] = Default::default();
    for p in lit.pixels() {
        let ray = ray(&camera, &view, p.as_dvec2() + 0.5);
        let (seen, cos) = entering(-ray.direction.y);
        let t = (0.4 - ray.origin.y) / ray.direction.y;
        let across = ray.direction.with_y(0.0) / IOR * (0.4 / cos);
        let x = (ray.at(t) + across).with_y(0.0);
        let distance = x.distance(position);
        let cos_light = position.y / distance;
        if x.abs().max_element() > 0.8 {
            continue;
        }
        let left = (-0.4 / cos_light * DVec3::X).exp() * entering(cos_light).0;
        let arriving = 3.0 * cos_light / (distance * distance) * left;
        let expected = 0.5 / PI * arriving * seen / (IOR * IOR) * (-0.4 / cos * DVec3::X).exp();
        let ring = (x.distance(position.with_y(0.0)) / 0.3) as usize;
        if let Some(ring) = shares.get_mut(ring) {
            ring.push((lit.radiance(p) - dark.radiance(p)) / expected);
        }
    }
    for (i, ring) in shares.iter().enumerate() {
        let mean = ring.iter().sum::<DVec3>() / ring.len() as f64;
        println!("{i}: {mean} of {}", ring.len());
        assert!(ring.len() > 50, "{}", ring.len());
        assert_close(mean, DVec3::ONE, 0.05, &format!("ring {i}"));
    }
}

/// Each pass of each view of lamps in the liquid is timed.
#[test]
fn passes_of_many_lamps_are_timed() {
    let Some(mut harness) = harness() else { return };
    let lamp = |i: i32| Light::Point {
        position: DVec3::new(0.3 * f64::from(i % 3 - 1), 0.2, 0.3 * f64::from(i / 3 - 1)),
        intensity: Vec3::splat(1.0),
    };
    let lamps: Vec<_> = (0..6).map(lamp).collect();
    let (mut scene, slab) = slab(&lamps);
    scene.settings.caustics.resolution = 48;
    let Harness { gpu, renderer } = &mut *harness;
    renderer.timing = true;
    let camera = camera(DVec3::new(0.0, 6.0, 1.0), DVec3::ZERO, 36.0);
    let frame = Picture::new(gpu, SIZE).expect("a frame");
    let times = renderer.render(&scene, &camera, &slab, &frame.view(), Picture::FORMAT, SIZE);
    renderer.timing = false;
    let times = times.expect("the frame is drawn");
    let count = times.iter().filter(|time| time.name == "caustics").count();
    assert!(times.is_empty() || count == 36, "{count} of six faces of six lamps");
}

/// Lamps in the liquid: a lamp in a drop lights the floor by exp(−σ r) times the transmittance of
/// one face; a lamp at the bottom of a block by exp(−σ d) alone.
#[test]
fn a_lamp_in_the_liquid_is_absorbed() {
    let Some(mut harness) = harness() else { return };
    let lamp = |position| Light::Point { position, intensity: Vec3::splat(3.0) };
    let (scene, drop) = drop(&[lamp(DROP.center)]);
    let outside = camera(DVec3::new(0.0, 0.9, 4.0), DVec3::new(0.0, 0.1, 0.0), 40.0);
    let view = View::new(&outside, SIZE);
    let shot = harness.render(&scene, &outside, &drop, SIZE);
    let (mut sum, mut count) = (DVec3::ZERO, 0);
    for p in shot.pixels() {
        let Some(x) = on_floor(&outside, &view, p).filter(|x| x.length() < 1.2) else { continue };
        let distance = x.distance(DROP.center);
        let left = entering(1.0).0 * (-DROP.radius * DVec3::X).exp();
        let arriving = 3.0 * DROP.center.y / distance.powi(3) * left;
        sum += shot.radiance(p) / (0.5 * (SKY + arriving / PI));
        count += 1;
    }
    println!("drop: {}", sum / f64::from(count));
    assert!(count > 300, "{count}");
    assert_close(sum / f64::from(count), DVec3::ONE, 0.03, "under a lamp in a drop");

    let position = DVec3::new(0.1, 0.3, 0.1);
    let (mut scene, slab) = slab(&[lamp(position)]);
    let diver = camera(DVec3::new(0.0, 0.25, 0.3), DVec3::new(0.0, 0.0, 0.0), 40.0);
    let view = View::new(&diver, SIZE);
    let lit = harness.render(&scene, &diver, &slab, SIZE);
    scene.lights.clear();
    let dark = harness.render(&scene, &diver, &slab, SIZE);
    let (mut sum, mut count) = (DVec3::ZERO, 0);
    for p in lit.pixels() {
        let Some(x) = on_floor(&diver, &view, p).filter(|x| x.abs().max_element() < 0.5) else {
            continue;
        };
        let distance = x.distance(position);
        let arriving = 3.0 * position.y / distance.powi(3) * (-distance * DVec3::X).exp();
        let left = (-x.distance(diver.eye) * DVec3::X).exp();
        sum += (lit.radiance(p) - dark.radiance(p)) / (0.5 / PI * arriving * left);
        count += 1;
    }
    println!("block: {}", sum / f64::from(count));
    assert!(count > 1000, "{count}");
    assert_close(sum / f64::from(count), DVec3::ONE, 0.03, "a lamp in a block");
}

// -------------------------------------------------------------------------------- against the truth

/// Mean FLIP of the picture against one traced in f64 through the true surface, lit by true maps;
/// and of the picture without caustics against the same.
fn against_truth(
    harness: &mut Harness,
    scene: &Scene,
    drawn: &Splats,
    liquid: &dyn Liquid,
    bounds: (DVec3, DVec3),
    camera: &Camera,
) -> [f64; 2] {
    let mut draw = |method| {
        let mut scene = scene.clone();
        scene.settings.caustics.method = method;
        let shot = harness.render(&scene, camera, drawn, SIZE);
        (DynamicImage::ImageRgba8(shot.picture).into_rgb8(), harness.renderer.images().caustics)
    };
    let (straight, _) = draw(Method::Straight);
    let (picture, maps) = draw(Method::Forward);
    let interfaces = scene.settings.caustics.interfaces;
    assert!(maps.iter().all(Option::is_some));
    let truth = |light| Some(on_solids(liquid, bounds, scene, light, interfaces, 128, 3));
    let maps: Vec<_> = scene.lights.iter().map(truth).collect();
    let truth = trace_lit(liquid, scene, camera, SIZE, 16, MAX_DEPTH, &maps).to_srgb();
    [picture, straight].map(|p| flip(&truth, &p, PIXELS_PER_DEGREE).expect("of one size").mean())
}

/// The whole lit picture of a drop over a checkered floor under a sun and a point light.
#[test]
fn a_lit_drop_matches_the_truth() {
    let Some(mut harness) = harness() else { return };
    let point = Light::Point { position: DVec3::new(-1.5, 5.0, 1.0), intensity: Vec3::splat(15.0) };
    let (mut scene, drawn) = drop(&[sun(Vec3::new(0.3, -1.0, -0.2)), point]);
    scene.settings.refract.samples = 4;
    let (even, odd) = (Vec3::splat(0.5), Vec3::new(0.2, 0.25, 0.3));
    scene.solids[0].surface = Surface::Checker { tile: 0.25, even, odd };
    let bounds = (DROP.center - DROP.radius, DROP.center + DROP.radius);
    let camera = camera(DVec3::new(0.7, 2.0, 5.0), DVec3::new(0.0, 0.8, 0.0), 36.0);
    let [forward, straight] = against_truth(&mut harness, &scene, &drawn, &DROP, bounds, &camera);
    println!("FLIP {forward}, without caustics {straight}");
    assert!(forward < 0.045 && forward < straight, "{forward}, {straight}");
}

/// The whole lit picture of a walled pool with waves, seen from above.
#[test]
fn a_lit_pool_matches_the_truth() {
    let Some(mut harness) = harness() else { return };
    let at = "kind = \"pool\"\nhalf_extent = [2.0, 2.0]\ndepth = 1.0\nhull = 0.25\ncount = 25000\n\
              waves = { count = 6, wavelengths = [0.8, 2.0], rms_slope = 0.07, seed = 4 }";
    let wall = |x0, z0, x1, z1| {
        lit(Shape::Box { min: DVec3::new(x0, -1.5, z0), max: DVec3::new(x1, 0.2, z1) })
    };
    let bottom = DVec3::NEG_Y;
    let solids = [
        lit(Shape::Plane { origin: bottom, normal: Vec3::Y, half_extent: f32::INFINITY }),
        wall(-2.2, -2.2, -2.0, 2.2),
        wall(2.0, -2.2, 2.2, 2.2),
        wall(-2.0, -2.2, 2.0, -2.0),
        wall(-2.0, 2.0, 2.0, 2.2),
    ];
    let (mut scene, drawn) = wet(at, &solids, &[sun(Vec3::new(-0.4, -1.0, 0.3))]);
    let project =
        Project::parse(&format!("[recipe]\n{at}"), "pool", Path::new(".")).expect("a pool");
    let Some(Recipe::Pool(pool)) = project.source.recipe() else { panic!("a pool") };
    scene.settings.caustics.interfaces = 1;
    scene.settings.refract.samples = 4;
    scene.liquid.absorption = Vec3::new(0.3, 0.1, 0.05);
    let liquid = Pool {
        waves: pool.surface(),
        min: -pool.half_extent,
        max: pool.half_extent,
        bottom: f64::NEG_INFINITY,
    };
    let bounds = (DVec3::new(-2.0, -1.0, -2.0), DVec3::new(2.0, liquid.waves.bound(), 2.0));
    let camera = camera(DVec3::new(0.5, 4.5, 3.0), DVec3::new(0.0, -0.6, 0.0), 36.0);
    let [forward, straight] = against_truth(&mut harness, &scene, &drawn, &liquid, bounds, &camera);
    println!("FLIP {forward}, without caustics {straight}");
    assert!(forward < 0.065 && forward < 0.8 * straight, "{forward}, {straight}");
}

// --------------------------------------------------------------------------------- temporal
// stability

/// Temporal stability: over 24 frames of a moving pool, with exact layers in one view of the light,
/// the map changes from frame to frame by as much as the true one, to 10 %. A flickering map
/// changes more, a lagging or smeared one less.
#[test]
fn caustics_change_as_the_truth_does() {
    let Some(gpu) = gpu() else { return };
    let spectrum = WaveSpectrum { count: 6, wavelengths: [1.0, 3.0], rms_slope: 0.05, seed: 7 };
    let waves = Waves::new(&spectrum);
    let bottom = DVec3::new(0.0, -2.0, 0.0);
    let shape = Shape::Plane { origin: bottom, normal: Vec3::Y, half_extent: f32::INFINITY };
    let mut scene = dry(&[lit(shape)], &[sun(Vec3::new(-0.4, -1.0, 0.3))]);
    scene.settings.caustics.interfaces = 1;
    scene.settings.caustics.grid = 192;
    let (light, resolution) = (&scene.lights[0], 96);
    let bounds = |half: f64| (DVec3::new(-half, -2.0, -half), DVec3::new(half, 0.0, half));
    let level = Some((0.0, IOR));
    let view = LightView::new(light, bounds(3.0), &scene.solids, 0.0, resolution, level);
    let view = view.expect("a light that sees the pool");
    let source = LightView::new(light, bounds(5.0), &scene.solids, 0.0, resolution, None);
    let source = source.expect("a light that sees the pool");
    // The border receives light from outside the view.
    let inner = |i: usize| {
        let p = UVec2::new(i as u32 % view.size.x, i as u32 / view.size.x);
        p.min(view.size - 1 - p).cmpgt(view.size / 8).all()
    };
    let (mut maps, mut truths) = (Vec::new(), Vec::new());
    for frame in 0..24 {
        let waves = waves.at(f64::from(frame) / 30.0);
        let pool = Pool {
            waves,
            min: DVec2::splat(-30.0),
            max: DVec2::splat(30.0),
            bottom: f64::NEG_INFINITY,
        };
        let layers = ViewLayers::of_light(&pool, &scene, &view);
        let mut bench = Bench::new(&gpu, &scene, &view, &layers).expect("layers");
        let run = bench.run(&scene, 0, 1e-3).expect("a map");
        let views = Views { light: &source, map: &view };
        let truth = beams(&pool, &scene, light, views, 1, 3);
        let error = relative_l1(&run.irradiance, &truth.irradiance, inner);
        assert!(error < 0.05, "frame {frame}: {error}");
        let green: Vec<_> = run.irradiance.iter().map(|e| f64::from(e[1])).collect();
        maps.push(green);
        truths.push(truth.irradiance.iter().map(|e| e.y).collect::<Vec<_>>());
    }
    let changes = |frames: &[Vec<f64>]| -> f64 {
        let pairs = frames.windows(2).flat_map(|w| w[0].iter().zip(&w[1]).enumerate());
        pairs.filter(|(i, _)| inner(*i)).map(|(_, (a, b))| (a - b).abs()).sum()
    };
    let (moved, truth) = (changes(&maps), changes(&truths));
    println!("moves by {} of the truth", moved / truth);
    assert!((moved / truth - 1.0).abs() < 0.1, "{moved}, not {truth}");
    // The true maps do change.
    let light: f64 = truths.iter().flatten().sum();
    assert!(truth > 0.01 * light, "{truth} of {light}");
}
