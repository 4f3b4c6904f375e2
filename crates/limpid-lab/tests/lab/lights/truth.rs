//! Lit pictures against light traced in 64 bits.

use std::path::Path;

use glam::{DVec3, Vec3};
use image::DynamicImage;
use limpid::camera::Camera;
use limpid::liquid::classify::Splats;
use limpid::scene::{Light, Scene, Shape, Surface};
use limpid::settings::Method;
use limpid_io::project::Project;
use limpid_lab::compare::{PIXELS_PER_DEGREE, flip};
use limpid_lab::reference::Liquid;
use limpid_lab::reference::analytic::Pool;
use limpid_lab::reference::caustics::on_solids;
use limpid_lab::reference::trace::{MAX_DEPTH, trace_lit};
use limpid_sim::recipe::Recipe;

use super::{DROP, SIZE, camera, drop, lit, sun, wet};
use crate::support::frames::{Harness, harness};

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
