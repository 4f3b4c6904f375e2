//! Foam, spray and bubbles against closed forms: coverage, light, refraction.

use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

use limpid::aov::{Aov, Part};
use limpid::camera::Camera;
use limpid::diffuse::{Diffuse, DiffuseKind};
use limpid::environment::Environment;
use limpid::frame::FrameInput;
use limpid::glam::{DVec2, DVec3, UVec2, Vec3};
use limpid::gpu::Gpu;
use limpid::liquid::classify::Splats;
use limpid::offscreen::Offscreen;
use limpid::scene::{Light, Scene, Shape, Solid, Surface};
use limpid_io::input::Input;
use limpid_io::project::Project;
use limpid_lab::reference::turbid::Random;

use crate::support::frames::gpu;

const SIZE: UVec2 = UVec2::new(96, 80);
const IOR: f64 = 1.33;

/// Looks at 0.
fn from(eye: DVec3) -> Camera {
    Camera { eye, target: DVec3::ZERO, up: Vec3::Y, fov_y: 20.0, near: None, lens: None }
}

/// Looks from 4 m along -z.
fn camera() -> Camera {
    from(DVec3::new(0.0, 0.0, 4.0))
}

/// Side of a pixel at depth 1 m, m.
fn pixel() -> f64 {
    2.0 * f64::tan(10f64.to_radians()) / f64::from(SIZE.y)
}

/// The linear picture.
struct Image(Part);

impl Image {
    fn channel(&self, name: &str) -> &[f32] {
        let channel = self.0.channels.iter().find(|channel| channel.name == name);
        &channel.expect("the picture has it").values
    }

    fn at(&self, name: &str, p: UVec2) -> f64 {
        self.channel(name)[(p.y * SIZE.x + p.x) as usize].into()
    }

    fn sum(&self, name: &str) -> f64 {
        self.channel(name).iter().copied().map(f64::from).sum()
    }
}

fn pixels() -> impl Iterator<Item = UVec2> {
    (0..SIZE.y).flat_map(|y| (0..SIZE.x).map(move |x| UVec2::new(x, y)))
}

fn draw(gpu: &Gpu, scene: &Scene, splats: &Splats, camera: &Camera, foam: Diffuse) -> Image {
    draw_at(gpu, scene, splats, camera, foam, SIZE)
}

fn draw_at(
    gpu: &Gpu,
    scene: &Scene,
    splats: &Splats,
    camera: &Camera,
    foam: Diffuse,
    size: UVec2,
) -> Image {
    let foam = Arc::new(foam);
    let mut offscreen = Offscreen::new(gpu);
    let input = FrameInput::new(scene, camera, splats, size);
    offscreen.draw(FrameInput { diffuse: Some(&foam), ..input }).expect("the frame is drawn");
    Image(offscreen.radiance().expect("the picture is read"))
}

fn no_liquid() -> Splats {
    Splats { radius: 0.05, ..Splats::default() }
}

/// Spheres alone, over nothing.
fn alone() -> Scene {
    let mut scene = Scene { environment: Environment::Constant(Vec3::ONE), ..Scene::default() };
    scene.solids.clear();
    scene.settings.refract.transparent = true;
    scene
}

/// A sphere covers the area of its outline, wherever it is among the pixels, within 2 %. The area's centre is the sphere's, within
/// a tenth of a pixel; within half a pixel for spheres that are less than two wide.
#[test]
fn a_sphere_covers_its_area() {
    let Some(gpu) = gpu() else { return };
    for pixels in [0.2, 0.5, 0.9, 1.4, 1.6, 1.9, 2.1, 3.0, 5.0, 10.0, 20.0] {
        for at in [DVec2::ZERO, DVec2::new(0.3, 0.1), DVec2::new(0.5, 0.8)] {
            let radius = pixels * 4.0 * pixel();
            let centre = (at * 4.0 * pixel()).extend(0.0);
            let foam = Diffuse::from_positions(vec![centre.as_vec3()], radius as f32);
            let image = draw(&gpu, &alone(), &no_liquid(), &camera(), foam);
            let outline = radius / (16.0 - radius * radius).sqrt();
            let area = PI * (outline / pixel()).powi(2);
            let covered = image.sum("A");
            assert!((covered / area - 1.0).abs() < 0.02, "{pixels} at {at}: {covered} of {area}");
            let moment = |p: UVec2| (p.as_dvec2() + 0.5) * image.at("A", p);
            let middle = self::pixels().map(moment).sum::<DVec2>() / covered;
            let expected = 0.5 * SIZE.as_dvec2() + DVec2::new(at.x, -at.y);
            let allowed = if pixels < 1.0 { 0.5 } else { 0.1 };
            assert!(
                (middle - expected).abs().max_element() < allowed,
                "{pixels} at {at}: {middle} for {expected}"
            );
        }
    }
}

/// A white sphere in even light is as bright as that: within 2 %, small and large.
#[test]
fn a_white_sphere_disappears_in_even_light() {
    let Some(gpu) = gpu() else { return };
    for pixels in [0.4, 1.0, 2.5, 12.0] {
        let radius = pixels * 4.0 * pixel();
        let foam = Diffuse::from_positions(vec![Vec3::ZERO], radius as f32);
        let image = draw(
            &gpu,
            &alone(),
            &no_liquid(),
            &camera(),
            Diffuse { colors: [Vec3::ONE; 4], ..foam },
        );
        let ratio = image.sum("G") / image.sum("A");
        assert!((ratio - 1.0).abs() < 0.02, "{pixels} pixels: {ratio}");
    }
}

/// Small spheres attenuate as Beer and Lambert say: those of a cloud, at random places, hide what independent discs do.
#[test]
fn a_cloud_attenuates_exponentially() {
    let Some(gpu) = gpu() else { return };
    let (count, half) = (16_000u32, 0.6);
    // Random places in a box around 0.
    let mut random = Random::new(1);
    let mut place = || DVec3::from_array([(); 3].map(|()| random.unit() * 2.0 - 1.0)) * half;
    let places: Vec<DVec3> = (0..count).map(|_| place()).collect();
    let radius = 0.3 * 4.0 * pixel();
    let foam = Diffuse::from_positions(places.iter().map(|x| x.as_vec3()).collect(), radius as f32);
    let image = draw(&gpu, &alone(), &no_liquid(), &camera(), foam);
    // Pixels around the middle see the whole depth of the box.
    let (mut covered, mut seen) = (0.0, 0.0);
    for p in pixels().filter(|p| p.as_dvec2().distance(SIZE.as_dvec2() / 2.0) < 30.0) {
        covered += image.at("A", p);
        seen += 1.0;
    }
    let per_volume = f64::from(count) / (2.0 * half).powi(3);
    let depth = per_volume * PI * radius * radius * 2.0 * half;
    let transmitted = 1.0 - covered / seen;
    let expected = (-depth).exp();
    assert!((transmitted.ln() / expected.ln() - 1.0).abs() < 0.02, "{transmitted} of {expected}");
}

/// The order of the particles changes no bit.
#[test]
fn the_order_of_particles_does_not_matter() {
    let Some(gpu) = gpu() else { return };
    let place = |i: usize| {
        let t = i as f32 * 0.37;
        Vec3::new(0.5 * t.sin(), 0.4 * (1.7 * t).cos(), 0.3 * (2.3 * t).sin())
    };
    let positions: Vec<Vec3> = (0..500).map(place).collect();
    let radii: Vec<f32> = (0..500).map(|i| 0.002 + 0.0001 * i as f32).collect();
    let foam = Diffuse { radii, ..Diffuse::from_positions(positions, 0.01) };
    let mut turned = foam.clone();
    turned.positions.reverse();
    turned.radii.reverse();
    let [a, b] = [foam, turned].map(|foam| draw(&gpu, &alone(), &no_liquid(), &camera(), foam));
    for channel in ["R", "G", "B", "A"] {
        assert!(a.channel(channel) == b.channel(channel), "{channel}");
    }
}

/// Nearer opaque spheres hide farther ones, and solids hide spheres behind them.
#[test]
fn nearer_things_hide_spheres() {
    let Some(gpu) = gpu() else { return };
    let places = vec![Vec3::new(0.0, 0.0, -0.5), Vec3::new(0.0, 0.0, 0.5)];
    let mut foam = Diffuse::from_positions(places, 0.15);
    foam.kinds = vec![DiffuseKind::Dust, DiffuseKind::Foam];
    let image = draw(&gpu, &alone(), &no_liquid(), &camera(), foam.clone());
    let middle = SIZE / 2;
    assert!(image.at("R", middle) / image.at("B", middle) < 1.01, "the white one is in front");
    let mut scene = alone();
    let wall =
        Shape::Plane { origin: DVec3::new(0.0, 0.0, 1.0), normal: Vec3::Z, half_extent: 9.0 };
    let surface = Surface::Color(Vec3::ZERO);
    scene.solids = vec![Solid { shape: wall, surface, lit: false }];
    let image = draw(&gpu, &scene, &no_liquid(), &camera(), foam);
    assert_eq!(image.sum("R"), 0.0);
}

/// Still liquid whose surface is at y = 0, deep 0.6 m.
fn pool() -> (Scene, Splats) {
    let text = "[recipe]\nkind = \"slab\"\nmin = [-1.2, -0.6, -1.2]\nmax = [1.2, 0.0, 1.2]\ncount = 30000\n\
                [liquid]\nior = 1.33\n[environment]\nradiance = [0.0, 0.0, 0.0]\n\
                [camera]\neye = [0.0, 0.0, 1.0]\ntarget = [0.0, 0.0, 0.0]\nfov_y = 40.0\n";
    let project = Project::parse(text, "diffuse", Path::new(".")).expect("a valid scene");
    let input = Input::from_project(project, "diffuse").expect("a recipe");
    let (input, project) = input.resolve().expect("a camera");
    let loaded = input.load(&input.sequence.frames[0], &project.scene).expect("particles");
    (Scene { solids: Vec::new(), ..project.scene }, loaded.splats)
}

/// A bubble below a level surface is seen where Snell's law says: within a pixel.
#[test]
fn bubbles_are_seen_refracted() {
    let Some(gpu) = gpu() else { return };
    let (mut scene, splats) = pool();
    scene.environment = Environment::Constant(Vec3::splat(0.2));
    let camera = from(DVec3::new(0.0, 2.0, 3.0));
    let none = draw(&gpu, &scene, &splats, &camera, Diffuse::default());
    for (depth, z) in [(0.1, 0.1), (0.3, 0.0), (0.45, -0.3)] {
        let mut foam = Diffuse::from_positions(vec![Vec3::new(0.0, -depth, z)], 0.012);
        foam.kinds = vec![DiffuseKind::Bubble];
        foam.colors = [Vec3::splat(8.0); 4];
        let image = draw(&gpu, &scene, &splats, &camera, foam);
        let (mut weight, mut row) = (0.0, 0.0);
        let added_at = |p: UVec2| image.at("G", p) - none.at("G", p);
        // The bottom of the liquid mirrors it weakly.
        let least = 0.2 * pixels().map(added_at).fold(0.0, f64::max);
        for p in pixels() {
            let added = (added_at(p) - least).max(0.0);
            weight += added;
            row += added * (f64::from(p.y) + 0.5);
        }
        // The point of the surface where the ray towards the bubble is refracted, by bisection.
        let (depth, z) = (f64::from(depth), f64::from(z));
        let (mut low, mut high) = (z, camera.eye.z);
        for _ in 0..60 {
            let at = 0.5 * (low + high);
            let sine = |across: f64, down: f64| across / across.hypot(down);
            let outside = sine(camera.eye.z - at, camera.eye.y);
            let inside = sine(at - z, depth);
            if IOR * inside > outside { high = at } else { low = at }
        }
        let towards = (DVec3::new(0.0, 0.0, low) - camera.eye).normalize();
        let ahead = -camera.eye.normalize();
        let up = DVec3::new(0.0, 3.0, -2.0).normalize();
        let expected = f64::from(SIZE.y) / 2.0 - towards.dot(up) / towards.dot(ahead) / pixel();
        assert!(weight > 0.0, "the bubble {depth} m below is seen");
        let seen = row / weight;
        assert!((seen - expected).abs() < 1.0, "{depth} m below: row {seen}, not {expected}");
    }
}

/// Random places in a box of spheres that take `depth` of optical depth along 1 m.
fn cloud(low: DVec3, high: DVec3, radius: f64, depth: f64) -> Diffuse {
    let count = (depth * (high - low).element_product() / (PI * radius * radius)).round() as usize;
    let mut random = Random::new(1);
    let mut place = || low + (high - low) * DVec3::from_array([(); 3].map(|()| random.unit()));
    let places = (0..count).map(|_| place().as_vec3()).collect();
    let cloud = Diffuse::from_positions(places, radius as f32);
    Diffuse { kinds: vec![DiffuseKind::Spray; count], ..cloud }
}

/// Mean green of the pixels within 15 pixels of the middle.
fn middle(image: &Image) -> f64 {
    let near = |p: &UVec2| p.as_dvec2().distance(SIZE.as_dvec2() / 2.0) < 15.0;
    let (sum, count) = pixels()
        .filter(near)
        .fold((0.0, 0.0), |(sum, count), p| (sum + image.at("G", p), count + 1.0));
    sum / count
}

const SUN: Light = Light::Sun { direction: Vec3::NEG_Y, irradiance: Vec3::splat(3.0) };

/// Alone under a sun: a floor at `height`.
fn floor(height: f64, light: Light) -> Scene {
    let mut scene = alone();
    scene.settings.refract.transparent = false;
    scene.environment = Environment::Constant(Vec3::ZERO);
    let origin = DVec3::new(0.0, height, 0.0);
    let shape = Shape::Plane { origin, normal: Vec3::Y, half_extent: f32::INFINITY };
    scene.solids = vec![Solid { shape, surface: Surface::Color(Vec3::ONE), lit: true }];
    scene.lights = vec![light];
    scene
}

/// A cloud dims a floor below it as Beer and Lambert say, under a sun and under a lamp: the exponents agree within 4 %.
#[test]
fn spheres_cast_shadows() {
    let Some(gpu) = gpu() else { return };
    let lamp = Light::Point { position: DVec3::new(0.0, 6.0, 0.0), intensity: Vec3::splat(100.0) };
    // From between the floor and the cloud.
    let camera = from(DVec3::new(0.0, 0.4, 0.8));
    let (low, high) = (DVec3::new(-0.5, 0.5, -0.5), DVec3::new(0.5, 1.5, 0.5));
    for light in [SUN, lamp] {
        let scene = floor(0.0, light);
        let [without, with] = [Diffuse::default(), cloud(low, high, 0.002, 1.2)]
            .map(|foam| middle(&draw(&gpu, &scene, &no_liquid(), &camera, foam)));
        let depth = (without / with).ln();
        assert!((depth / 1.2 - 1.0).abs() < 0.04, "{light:?}: {depth}");
    }
}

/// One sphere's shadow takes the light of its disc.
#[test]
fn a_sphere_takes_the_light_of_its_disc() {
    let Some(gpu) = gpu() else { return };
    let scene = floor(0.0, SUN);
    let camera = Camera { up: Vec3::NEG_Z, ..from(DVec3::new(0.0, 4.0, 0.0)) };
    let black = |radius: f32| {
        // Behind the eye, from where its shadow alone is seen.
        let foam = Diffuse::from_positions(vec![Vec3::new(0.0, 9.0, 0.0)], radius);
        Diffuse { colors: [Vec3::ZERO; 4], ..foam }
    };
    for radius in [0.1f32, 0.25] {
        let [without, with] = [Diffuse::default(), black(radius)]
            .map(|foam| draw(&gpu, &scene, &no_liquid(), &camera, foam).sum("G"));
        let area = (without - with) / without * f64::from(SIZE.element_product());
        let expected = PI * (f64::from(radius) / (4.0 * pixel())).powi(2);
        assert!((area / expected - 1.0).abs() < 0.1, "{radius} m: {area} of {expected} pixels");
    }
}

/// A cloud above still liquid dims the light on the ground below it as much as on dry ground.
#[test]
fn spheres_dim_caustics() {
    let Some(gpu) = gpu() else { return };
    let (pool, splats) = pool();
    let scene = Scene { liquid: pool.liquid, ..floor(-0.6, SUN) };
    let camera = from(DVec3::new(0.0, 1.0, 1.2));
    let (low, high) = (DVec3::new(-1.5, 2.0, -1.5), DVec3::new(1.5, 3.0, 1.5));
    let [without, with] = [Diffuse::default(), cloud(low, high, 0.02, 0.8)]
        .map(|foam| middle(&draw(&gpu, &scene, &splats, &camera, foam)));
    let depth = (without / with).ln();
    assert!((depth / 0.8 - 1.0).abs() < 0.06, "{depth}");
}

/// A black cloud that still liquid mirrors dims its mirror image by its optical depth, whether its cells are wide or half as
/// wide: within 6 % of the exponent.
#[test]
fn liquid_mirrors_spheres() {
    let Some(gpu) = gpu() else { return };
    let (mut scene, splats) = pool();
    scene.environment = Environment::Constant(Vec3::ONE);
    scene.settings.refract.internal_bounces = 0;
    let eye = DVec3::new(0.0, 0.5, 2.5);
    let camera = from(eye);
    let (low, high) = (DVec3::new(-1.0, 0.02, -1.2), DVec3::new(1.0, 1.5, -0.2));
    let cosine = eye.normalize().y;
    let inside = (1.0 - (1.0 - cosine * cosine) / (IOR * IOR)).sqrt();
    let (s, p) = (
        (cosine - IOR * inside) / (cosine + IOR * inside),
        (IOR * cosine - inside) / (IOR * cosine + inside),
    );
    let reflectance = 0.5 * (s * s + p * p);
    // Along the mirrored sight line.
    let expected = 0.7 / eye.normalize().z;
    for radius in [0.012, 0.006] {
        let cloud = Diffuse { colors: [Vec3::ZERO; 4], ..cloud(low, high, radius, 0.7) };
        let [without, with] = [Diffuse::default(), cloud]
            .map(|foam| middle(&draw(&gpu, &scene, &splats, &camera, foam)));
        let depth = -(1.0 - (without - with) / reflectance).ln();
        assert!((depth / expected - 1.0).abs() < 0.06, "{radius} m: {depth} of {expected}");
    }
}

/// A lamp behind the eye lights a sphere as Schoenberg's law says, though no solid is lit: two thirds of what a disc of the
/// same colour would reflect, within 4 %, as the
/// eye sees less than half of a near one.
#[test]
fn lights_reach_spheres_without_lit_solids() {
    let Some(gpu) = gpu() else { return };
    let mut scene = alone();
    scene.environment = Environment::Constant(Vec3::ZERO);
    scene.lights = vec![Light::Sun { direction: Vec3::NEG_Z, irradiance: Vec3::splat(3.0) }];
    for pixels in [0.4, 1.0, 12.0] {
        let foam = Diffuse::from_positions(vec![Vec3::ZERO], (pixels * 4.0 * pixel()) as f32);
        let foam = Diffuse { colors: [Vec3::ONE; 4], ..foam };
        let image = draw(&gpu, &scene, &no_liquid(), &camera(), foam);
        let ratio = image.sum("G") / image.sum("A") / (3.0 / PI * 2.0 / 3.0);
        assert!((ratio - 1.0).abs() < 0.04, "{pixels} pixels: {ratio}");
    }
}

/// The image `diffuse` has the coverage that the picture has as alpha, divided into air and liquid.
#[test]
fn the_image_of_foam_is_its_coverage() {
    let Some(gpu) = gpu() else { return };
    let places = vec![Vec3::ZERO, Vec3::new(0.3, 0.1, 0.0), Vec3::new(-0.2, 0.0, 0.5)];
    let foam = Diffuse { radii: vec![0.2, 0.003, 0.05], ..Diffuse::from_positions(places, 0.1) };
    let foam = Arc::new(foam);
    let (scene, camera, splats) = (alone(), camera(), no_liquid());
    let mut offscreen = Offscreen::new(&gpu);
    let input = FrameInput::new(&scene, &camera, &splats, SIZE);
    offscreen.draw(FrameInput { diffuse: Some(&foam), ..input }).expect("the frame is drawn");
    let picture = Image(offscreen.radiance().expect("the picture is read"));
    let parts = offscreen.images(&[Aov::Diffuse]).expect("the image is read");
    let [part] = parts.try_into().expect("one part");
    let image = Image(part);
    let differs = |channel: &str| {
        let pairs = image.channel(channel).iter().zip(picture.channel("A"));
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    assert!(differs("diffuse.coverage") < 1e-5 && differs("diffuse.air") < 1e-5);
    assert_eq!(image.sum("diffuse.liquid"), 0.0);
    offscreen.draw(input).expect("the frame is drawn");
    assert_eq!(offscreen.images(&[Aov::Diffuse]).expect("nothing is read"), []);
}

/// Drifting spheres of 0.2 to 4 pixels change pictures from frame to frame as they change pictures of four times the resolution,
/// averaged to the same pixels: within 5 %.
#[test]
fn drifting_spheres_do_not_flicker() {
    const FINE: u32 = 4;
    let Some(gpu) = gpu() else { return };
    let mut random = Random::new(7);
    let mut uniform = |low: f64, high: f64| low + (high - low) * random.unit();
    let side = 4.0 * pixel();
    let place = |x: f64, y: f64| DVec3::new(x, y, 0.0).as_vec3();
    let spheres: Vec<_> = (0..300)
        .map(|_| {
            let at = place(uniform(-0.6, 0.6), uniform(-0.5, 0.5));
            let moved = place(uniform(-0.5, 0.5) * side, uniform(-0.5, 0.5) * side);
            (at, moved, uniform(0.2f64.ln(), 4f64.ln()).exp() * side)
        })
        .collect();
    let frame = |i: usize| {
        let at = spheres.iter().map(|&(at, moved, _)| at + i as f32 * moved).collect();
        let radii = spheres.iter().map(|&(.., radius)| radius as f32).collect();
        Diffuse { radii, ..Diffuse::from_positions(at, 0.1) }
    };
    let covered = |i: usize, fine: u32| {
        let size = fine * SIZE;
        let image = draw_at(&gpu, &alone(), &no_liquid(), &camera(), frame(i), size);
        let mut sums = vec![0.0; SIZE.element_product() as usize];
        for (k, &alpha) in (0..).zip(image.channel("A")) {
            let p = UVec2::new(k % size.x, k / size.x) / fine;
            sums[(p.y * SIZE.x + p.x) as usize] += f64::from(alpha) / f64::from(fine * fine);
        }
        sums
    };
    let change = |fine: u32| {
        let frames: Vec<_> = (0..4).map(|i| covered(i, fine)).collect();
        let pairs = frames.windows(2).flat_map(|pair| pair[0].iter().zip(&pair[1]));
        pairs.map(|(a, b)| (a - b).abs()).sum::<f64>()
    };
    let ratio = change(1) / change(FINE);
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
}

/// Pictures of a sequence show a sphere come and go as its opacity does, from nothing to nothing.
#[test]
fn spheres_fade_as_they_age() {
    let Some(gpu) = gpu() else { return };
    let at = |age: f32| {
        let foam = Diffuse::from_positions(vec![Vec3::ZERO], (1.3 * 4.0 * pixel()) as f32);
        Diffuse { ages: Some(vec![age]), lifetimes: Some(vec![1.0 - age]), ..foam }
    };
    let covered = |age: f32| draw(&gpu, &alone(), &no_liquid(), &camera(), at(age)).sum("A");
    let whole = covered(0.5);
    for i in 0..=10 {
        let age = 0.1 * i as f32;
        let share = covered(age) / whole;
        let expected = f64::from(at(age).opacity(0));
        assert!((share - expected).abs() < 0.02, "{age} s: {share} of {expected}");
    }
    assert_eq!((covered(0.0), covered(1.0)), (0.0, 0.0));
}

/// A renderer that reuses passes draws foam that comes, changes and goes.
#[test]
fn foam_that_changes_is_drawn_anew() {
    let Some(gpu) = gpu() else { return };
    let foam = |x: f32| Some(Arc::new(Diffuse::from_positions(vec![Vec3::new(x, 0.0, 0.0)], 0.1)));
    let mut kept = Offscreen::new(&gpu);
    let (scene, splats, camera) = (alone(), no_liquid(), camera());
    let mut last = None;
    for diffuse in [None, foam(0.0), foam(0.1), None] {
        let input = FrameInput::new(&scene, &camera, &splats, SIZE);
        let input = FrameInput { diffuse: diffuse.as_ref(), reuse: true, ..input };
        let picture = kept.draw(input).expect("the frame is drawn").picture;
        let new = Offscreen::new(&gpu).draw(input).expect("the frame is drawn").picture;
        assert!(picture == new);
        assert!(last.as_ref() != Some(&picture), "foam changes the picture");
        last = Some(picture);
    }
}
