//! Lit pictures by the renderer: direct light, shadows and light through particles, against closed
//! forms, against light traced in f64, and from frame to frame.

mod lamps;
mod liquid;
mod solids;
mod stability;
mod truth;

use std::path::Path;

use glam::{DVec2, DVec3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::liquid::classify::Splats;
use limpid::scene::{Light, Scene, Shape, Solid, Surface};
use limpid_io::input::Input;
use limpid_io::project::Project;
use limpid_lab::reference::Ray;
use limpid_lab::reference::analytic::Ball;
use limpid_lab::reference::optics::fresnel;

use crate::support::frames::{View, scene, splats};

const SIZE: UVec2 = UVec2::new(120, 90);
const IOR: f64 = 1.33;

/// Uniform radiance of the sky, which is also the ambient light.
const SKY: f64 = 0.3;

fn camera(eye: DVec3, target: DVec3, fov_y: f32) -> Camera {
    Camera { eye, target, up: Vec3::Y, fov_y, near: None, lens: None }
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

/// The transmittance of unpolarised light that enters water at an angle of the given cosine, and
/// the cosine of the refracted angle.
fn entering(cos_theta_i: f64) -> (f64, f64) {
    let cos_theta_t = (1.0 - (1.0 - cos_theta_i * cos_theta_i) / (IOR * IOR)).sqrt();
    (1.0 - fresnel(cos_theta_i, IOR), cos_theta_t)
}
