//! Scene files, settings, environments, cameras, moving solids and output files; all but one picture without an
//! adapter.
//!
//! Valid scenes are read correctly, and every mistake in a scene file is reported with its location and
//! its remedy, instead of being ignored or drawn.

mod camera;
mod environments;
mod looks;
mod motion;
mod opaque;
mod output;
mod reading;
mod saving;
mod settings;
mod shapes;
mod turbid;

use std::path::Path;

use glam::Vec3;
use limpid::scene::Scene;
use limpid_io::Result;
use limpid_io::project::Project;

/// A scene with every table and every key of the reference scenes, and more.
const FULL: &str = r#"
[particles]
source = "../water/fluid_{}.bgeo"
frame = 20
radius = 0.025
up = "z"

[liquid]
ior = 1.4
absorption = [1.0, 0.5, 0.25]

[camera]
eye = [0.0, 1.5, 4.0]
target = [0.0, 0.25, 0.0]
up = [0.0, 1.0, 0.0]
fov_y = 40.0
near = 0.01

[environment]
gradient = { zenith = [0.2, 0.4, 0.8], horizon = [0.8, 0.9, 1.0], nadir = [0.3, 0.3, 0.3] }

[[solid]]
shape = "plane"
origin = [0.0, -0.05, 0.0]
half_extent = 6.0
checker = { tile = 0.25, even = [0.8, 0.8, 0.7], odd = [0.1, 0.2, 0.3] }

[[solid]]
shape = "box"
min = [-1.0, 0.0, -1.0]
max = [1.0, 0.5, -0.9]
color = [0.5, 0.25, 0.125]
lit = true

[[solid]]
shape = "sphere"
center = [0.0, 0.25, 0.5]
radius = 0.25

[[light]]
sun = { direction = [0.0, -1.0, 0.0], irradiance = [3.0, 3.0, 3.0] }

[[light]]
point = { position = [1.0, 2.0, 3.0], intensity = [4.0, 5.0, 6.0] }

[settings.refract]
samples = 4
solver = "march"

[settings.caustics]
method = "straight"
margin = 0.2
"#;

fn parse(text: &str) -> Result<Project> {
    Project::parse(text, "test.toml", Path::new("scenes"))
}

#[track_caller]
fn project(text: &str) -> Project {
    parse(text).unwrap_or_else(|error| panic!("{error}\nin {text}"))
}

#[track_caller]
fn scene(text: &str) -> Scene {
    project(text).scene
}

#[track_caller]
fn assert_contains(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
}

/// Uniform in −1 to 1, from a linear congruential generator (Knuth's MMIX).
fn noise(seed: &mut u64) -> f32 {
    *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*seed >> 40) as f32 / (1u64 << 23) as f32 - 1.0
}

fn random(seed: &mut u64) -> Vec3 {
    Vec3::from_array([(); 3].map(|()| noise(seed)))
}
