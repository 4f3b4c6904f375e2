//! The ground truth of caustics against closed forms, against independent methods, and in pictures.

mod maps;
mod pictures;

use std::path::Path;

use limpid::glam::{DMat3, DVec2, DVec3, UVec2, Vec3};
use limpid::light_view::LightView;
use limpid::scene::{Light, Scene};
use limpid_io::project::Project;
use limpid_lab::reference::analytic::Pool;
use limpid_lab::reference::caustics::CausticMap;
use limpid_sim::waves::{WaveSpectrum, Waves};

const WATER: f64 = 1.33;

fn project(text: &str) -> Project {
    Project::parse(text, "test", Path::new("")).unwrap()
}

fn scene(text: &str) -> Scene {
    project(text).scene
}

fn clear(solids: &str) -> Scene {
    scene(&format!("[liquid]\nior = 1.33\nabsorption = [0.0, 0.0, 0.0]\n{solids}"))
}

const FLOOR: &str = "[[solid]]\nshape = \"plane\"\norigin = [0.0, -1.0, 0.0]\n";

fn sun(direction: DVec3) -> Light {
    Light::Sun { direction: direction.as_vec3(), irradiance: Vec3::new(3.0, 2.0, 1.0) }
}

const POWER: DVec3 = DVec3::new(3.0, 2.0, 1.0);

/// Light at 35.264 degrees from the vertical.
const OBLIQUE: DVec3 = DVec3::new(1.0, -std::f64::consts::SQRT_2, 0.0);

/// The view of a sun overhead, of a square around the y axis, from 50 m above to 50 m below.
fn overhead(half: f64, size: u32) -> LightView {
    LightView {
        origin: 50.0 * DVec3::Y,
        view_from_world: DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y).transpose(),
        half_extent: DVec2::splat(half),
        near: 0.0,
        far: 100.0,
        orthographic: true,
        size: UVec2::splat(size),
        level: None,
    }
}

/// The view of a light of everything between two corners; a sun's from high up, for water wider
/// than that.
fn light_view(light: &Light, min: DVec3, max: DVec3, scene: &Scene, resolution: u32) -> LightView {
    let view = LightView::new(light, (min, max), &scene.solids, 0.0, resolution, None).unwrap();
    let back = if view.orthographic { 10.0 } else { 0.0 };
    let origin = view.origin + back * view.view_from_world.transpose().z_axis;
    LightView { origin, far: view.far + back, ..view }
}

/// Flat or wavy water wider than any view here.
fn water(waves: Waves) -> Pool {
    Pool { waves, min: DVec2::splat(-100.0), max: DVec2::splat(100.0), bottom: f64::NEG_INFINITY }
}

fn waves(rms_slope: f64) -> Waves {
    Waves::new(&WaveSpectrum { count: 12, wavelengths: [0.4, 1.5], rms_slope, seed: 3 })
}

fn texel(map: &CausticMap, x: u32, y: u32) -> usize {
    assert!(x < map.view.size.x && y < map.view.size.y);
    (y * map.view.size.x + x) as usize
}

fn close(found: DVec3, expected: DVec3, relative: f64) -> bool {
    (found - expected).length() <= relative * expected.length()
}

/// Total power on the texels, W.
fn held(map: &CausticMap) -> DVec3 {
    let each = map.irradiance.iter().zip(&map.receivers);
    each.filter_map(|(&e, receiver)| Some(e * receiver.as_ref()?.area)).sum()
}

/// Checks that all light is accounted for, and that the texels hold the received light.
fn check_accounts(map: &CausticMap) {
    let f = map.flux;
    let ends = f.received + f.hidden + f.outside + f.missed + f.reflected + f.liquid;
    assert!(close(ends, f.transmitted, 1e-9), "{f:?}");
    assert!(close(held(map), f.received, 1e-9), "{} {:?}", held(map), f.received);
    assert!(f.transmitted.cmple(f.sent * (1.0 + 1e-12)).all());
}
