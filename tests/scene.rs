//! Scene files, settings, environments, cameras and output files, without an adapter.
//!
//! Protects what users write by hand: that a good scene means what it says, and that every slip
//! in it is told with its place and its remedy instead of being ignored or drawn.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, Write as _};
use std::path::Path;

use glam::{DVec3, Mat3, UVec2, Vec3};
use image::{DynamicImage, Rgb, Rgb32FImage, RgbImage};
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::output::{OutputNames, write_atomically, write_png};
use limpid::particles::Up;
use limpid::scene::{Light, Scene, Shape, Surface};
use limpid::settings::{
    Curve, Fresnel, Kernel, Method, Reflections, Settings, Solids, Solver, Unit,
};
use limpid::{Error, Result};
use tempfile::TempDir;

/// Every table and every key that the reference scenes have, and then some.
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

fn parse(text: &str) -> Result<Scene> {
    Scene::parse(text, "test.toml", Path::new("scenes"), &[])
}

#[track_caller]
fn scene(text: &str) -> Scene {
    parse(text).unwrap_or_else(|error| panic!("{error}\nin {text}"))
}

/// The message of a scene that must be refused: one line, naming the file.
#[track_caller]
fn refused(text: &str) -> String {
    let error = parse(text).expect_err(text);
    assert!(matches!(error, Error::Scene { .. }), "{error:?}");
    assert_eq!(error.exit_code(), 2);
    let message = error.to_string();
    assert!(message.starts_with("test.toml: "), "{message}");
    assert!(!message.contains('\n'), "{message}");
    message
}

/// Checks that `FULL` with `from` replaced by `to` is refused at that line, with all of `parts`.
#[track_caller]
fn slip(from: &str, to: &str, parts: &[&str]) {
    assert_eq!(FULL.matches(from).count(), 1, "`{from}` is there once");
    let message = refused(&FULL.replace(from, to));
    let line = FULL[..FULL.find(from).unwrap()].matches('\n').count() + 1;
    let place = format!("test.toml: line {line}: ");
    assert!(message.starts_with(&place), "`{place}` expected: {message}");
    assert_tells(&message, parts);
}

#[track_caller]
fn assert_tells(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
}

fn close(a: Vec3, b: Vec3, tolerance: f32) -> bool {
    (a - b).abs().max_element() <= tolerance
}

/// Uniform in −1 to 1, from a linear congruential generator (Knuth's MMIX).
fn noise(seed: &mut u64) -> f32 {
    *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*seed >> 40) as f32 / (1u64 << 23) as f32 - 1.0
}

fn random(seed: &mut u64) -> Vec3 {
    Vec3::from_array([(); 3].map(|()| noise(seed)))
}

// ----------------------------------------------------------------------------------- scenes

/// Every key arrives where it belongs.
#[test]
fn a_full_scene_means_what_it_says() {
    let scene = scene(FULL);
    let particles = scene.particles.expect("the scene names its particles");
    // Paths are relative to the scene file.
    assert_eq!(Path::new(&particles.source), Path::new("scenes/../water/fluid_{}.bgeo"));
    assert_eq!((particles.frame, particles.radius), (Some(20), Some(0.025)));
    assert_eq!(particles.up, Up::Z);
    assert_eq!((scene.liquid.ior, scene.liquid.absorption), (1.4, Vec3::new(1.0, 0.5, 0.25)));
    let camera = Camera {
        eye: DVec3::new(0.0, 1.5, 4.0),
        target: DVec3::new(0.0, 0.25, 0.0),
        up: Vec3::Y,
        fov_y: 40.0,
        near: Some(0.01),
    };
    assert_eq!(scene.camera, Some(camera));
    let gradient = Environment::Gradient {
        zenith: Vec3::new(0.2, 0.4, 0.8),
        horizon: Vec3::new(0.8, 0.9, 1.0),
        nadir: Vec3::splat(0.3),
    };
    assert_eq!(scene.environment, gradient);

    let [floor, wall, ball] = scene.solids[..] else { panic!("three solids: {:?}", scene.solids) };
    let plane =
        Shape::Plane { origin: DVec3::new(0.0, -0.05, 0.0), normal: Vec3::Y, half_extent: 6.0 };
    let checker = Surface::Checker {
        tile: 0.25,
        even: Vec3::new(0.8, 0.8, 0.7),
        odd: Vec3::new(0.1, 0.2, 0.3),
    };
    assert_eq!((floor.shape, floor.surface, floor.lit), (plane, checker, false));
    let corners = Shape::Box { min: DVec3::new(-1.0, 0.0, -1.0), max: DVec3::new(1.0, 0.5, -0.9) };
    let color = Surface::Color(Vec3::new(0.5, 0.25, 0.125));
    assert_eq!((wall.shape, wall.surface, wall.lit), (corners, color, true));
    assert_eq!(ball.shape, Shape::Sphere { center: DVec3::new(0.0, 0.25, 0.5), radius: 0.25 });

    let [sun, lamp] = scene.lights[..] else { panic!("two lights: {:?}", scene.lights) };
    assert_eq!(sun, Light::Sun { direction: -Vec3::Y, irradiance: Vec3::splat(3.0) });
    let position = DVec3::new(1.0, 2.0, 3.0);
    assert_eq!(lamp, Light::Point { position, intensity: Vec3::new(4.0, 5.0, 6.0) });
    assert_eq!((scene.settings.refract.samples, scene.settings.refract.solver), (4, Solver::March));
    assert_eq!(scene.settings.smooth, Settings::default().smooth);
}

/// What is left out has the documented defaults; an empty file is a scene without particles.
#[test]
fn everything_has_a_default() {
    let empty = scene("");
    assert_eq!(empty.particles, None);
    assert_eq!(empty.camera, None);
    assert_eq!((empty.liquid.ior, empty.solids.len(), empty.lights.len()), (1.33, 0, 0));
    assert_eq!(empty.environment, Environment::default());
    assert_eq!(empty.settings, Settings::default());

    let few = scene(
        r#"
        [particles]
        source = "a.ply"
        [camera]
        eye = [0, 0, 1]     # whole numbers are numbers
        target = [0, 0, 0]
        fov_y = 40
        [environment]
        gradient = { zenith = [1, 1, 1], horizon = [2, 2, 2] }
        [[solid]]
        shape = "plane"
        origin = [0, 0, 0]
        normal = [0, 0, 2]
        "#,
    );
    let particles = few.particles.unwrap();
    assert_eq!((particles.frame, particles.radius, particles.up), (None, None, Up::Y));
    let camera = few.camera.unwrap();
    assert_eq!((camera.up, camera.near), (Vec3::Y, None));
    assert_eq!(camera.near(), 1e-3);
    let Environment::Gradient { horizon, nadir, .. } = few.environment else { panic!() };
    assert_eq!(horizon, nadir, "without a nadir, the horizon goes on below");
    let Shape::Plane { normal, half_extent, .. } = few.solids[0].shape else { panic!() };
    assert_eq!((normal, half_extent), (Vec3::Z, f32::INFINITY));
    assert!(!few.solids[0].lit);
}

/// The three kinds of environment, and its scale.
#[test]
fn environments() {
    let constant = scene("[environment]\nradiance = [0.5, 1.0, 2.0]\nscale = 2.0").environment;
    assert_eq!(constant, Environment::Constant(Vec3::new(1.0, 2.0, 4.0)));
    assert_eq!(constant.mean(), Vec3::new(1.0, 2.0, 4.0));

    let folder = tempfile::tempdir().unwrap();
    RgbImage::from_pixel(4, 2, Rgb([255, 0, 255])).save(folder.path().join("sky.png")).unwrap();
    let text = "[environment]\nmap = \"sky.png\"\nscale = 0.5";
    let map = Scene::parse(text, "test.toml", folder.path(), &[]).unwrap().environment;
    let pixels = vec![[0.5, 0.0, 0.5, 1.0]; 8].into();
    assert_eq!(map, Environment::Map { size: UVec2::new(4, 2), pixels });

    let both = refused("[environment]\nradiance = [1, 1, 1]\nmap = \"sky.png\"");
    assert_tells(&both, &["one of", "radiance", "gradient", "map"]);
    // A map that is not there is a missing file, not a slip in the scene.
    let error = parse("[environment]\nmap = \"none.png\"").unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error:?}");
    assert_tells(&error.to_string(), &["scenes", "none.png"]);
}

/// An unknown key is an error in every table, with its line and the key that was meant.
#[test]
fn unknown_keys_name_the_nearest() {
    let keys = [
        ("[liquid]", "[liquids]", "liquids", "liquid"),
        ("frame = 20", "frmae = 20", "frmae", "frame"),
        ("absorption = ", "absorbtion = ", "absorbtion", "absorption"),
        ("fov_y = ", "fovy = ", "fovy", "fov_y"),
        ("gradient = ", "gradiant = ", "gradiant", "gradient"),
        ("nadir = ", "nadiir = ", "nadiir", "nadir"),
        ("half_extent = ", "half_extend = ", "half_extend", "half_extent"),
        ("tile = ", "tyle = ", "tyle", "tile"),
        ("lit = ", "lid = ", "lid", "lit"),
        ("sun = ", "sunn = ", "sunn", "sun"),
        ("irradiance = ", "iradiance = ", "iradiance", "irradiance"),
        ("intensity = ", "intensty = ", "intensty", "intensity"),
        ("[settings.refract]", "[settings.refrcat]", "refrcat", "refract"),
        ("samples = 4", "sample = 4", "sample", "samples"),
        ("margin = 0.2", "margins = 0.2", "margins", "margin"),
        ("\"straight\"", "\"strait\"", "strait", "straight"),
        // Names that are values.
        ("\"z\"", "\"zz\"", "zz", "z"),
        ("\"sphere\"", "\"spheer\"", "spheer", "sphere"),
        ("\"march\"", "\"marsh\"", "marsh", "march"),
    ];
    for (from, to, unknown, nearest) in keys {
        slip(from, to, &[unknown, &format!("did you mean `{nearest}`?")]);
    }
}

/// A value of the wrong type, or a file that is no TOML, is told with its line.
#[test]
fn wrong_types_name_the_line() {
    slip("ior = 1.4", "ior = \"water\"", &["string"]);
    slip("frame = 20", "frame = 2.5", &["floating point"]);
    slip("lit = true", "lit = 1", &["boolean"]);
    slip("eye = [0.0, 1.5, 4.0]", "eye = [0.0, 1.5]", &["2"]);
    slip("max = [1.0, 0.5, -0.9]", "max = 1.0", &["floating point"]);
    slip("samples = 4", "samples = -4", &["-4"]);
    slip("fov_y = 40.0", "fov_y = 40 degrees", &[]);
    slip("near = 0.01", "fov_y = 41.0", &["duplicate"]);
    slip("sun = { direction = [0.0, -1.0, 0.0], ", "sun = { ", &["direction"]);
}

/// Keys that cannot be left out.
#[test]
fn missing_keys_are_named() {
    let missing = |key: &str| {
        let mut lines: Vec<_> = FULL.lines().collect();
        let at = lines.iter().position(|line| line.starts_with(&format!("{key} = "))).expect(key);
        lines.remove(at);
        refused(&lines.join("\n"))
    };
    assert_tells(&missing("source"), &["source"]);
    assert_tells(&missing("eye"), &["eye"]);
    assert_tells(&missing("target"), &["target"]);
    assert_tells(&missing("shape"), &["shape"]);
    assert_tells(&missing("origin"), &["[[solid]] 1", "plane", "origin"]);
    assert_tells(&missing("min"), &["[[solid]] 2", "box", "min"]);
    assert_tells(&missing("max"), &["[[solid]] 2", "box", "max"]);
    assert_tells(&missing("center"), &["[[solid]] 3", "sphere", "center"]);
    let no_radius = FULL.replace("radius = 0.25\n", "");
    assert_tells(&refused(&no_radius), &["[[solid]] 3", "sphere", "radius"]);
    assert_tells(&refused("[[light]]"), &["line 1"]);
    let two = "[[light]]\nsun = { direction = [0, -1, 0], irradiance = [1, 1, 1] }\npoint = 1";
    refused(two);
}

/// Numbers outside what can be drawn, each with its key. NaN and ∞ are never values.
#[test]
fn ranges() {
    let out = |from: &str, to: &str, parts: &[&str]| {
        assert_eq!(FULL.matches(from).count(), 1, "`{from}` is there once");
        assert_tells(&refused(&FULL.replace(from, to)), parts);
    };
    for ior in ["0.29", "3.5", "nan", "inf", "-1.33"] {
        out("ior = 1.4", &format!("ior = {ior}"), &["liquid", "ior"]);
    }
    for absorption in ["-0.5", "nan", "inf"] {
        let to = format!("absorption = [1.0, {absorption}, 0.25]");
        out("absorption = [1.0, 0.5, 0.25]", &to, &["liquid", "absorption"]);
    }
    for radius in ["0.0", "-0.025", "nan", "inf"] {
        out("radius = 0.025", &format!("radius = {radius}"), &["particles", "radius"]);
        out("radius = 0.25\n", &format!("radius = {radius}\n"), &["[[solid]] 3", "radius"]);
    }
    // As --radius: the cube of it is what a 32-bit float cannot hold.
    let tiny = "[[fluid]]\nsource = \"a.xyz\"\n[[fluid]]\nsource = \"b.xyz\"\nradius = 1e-30\n";
    assert_tells(&refused(tiny), &["[[fluid]] 2", "radius is 1e-30", "1e-12"]);
    out("radius = 0.025", "radius = 1e-30", &["[particles] radius"]);
    for fov_y in ["0.0", "180.0", "-40.0", "nan"] {
        out("fov_y = 40.0", &format!("fov_y = {fov_y}"), &["camera", "fov_y"]);
    }
    for near in ["0.0", "-0.1", "nan", "inf"] {
        out("near = 0.01", &format!("near = {near}"), &["camera", "near"]);
    }
    for half_extent in ["-6.0", "0.0", "nan"] {
        let to = format!("half_extent = {half_extent}");
        out("half_extent = 6.0", &to, &["[[solid]] 1", "half_extent"]);
    }
    for tile in ["0.0", "-0.25", "nan"] {
        out("tile = 0.25", &format!("tile = {tile}"), &["[[solid]] 1", "tile"]);
    }
    out("target = [0.0, 0.25, 0.0]", "target = [0.0, 1.5, 4.0]", &["camera", "same point"]);
    out("up = [0.0, 1.0, 0.0]", "up = [0.0, 1.25, 4.0]", &["camera", "up"]);
    out("up = [0.0, 1.0, 0.0]", "up = [0.0, 0.0, 0.0]", &["camera", "up"]);
    out("max = [1.0, 0.5, -0.9]", "max = [1.0, -0.5, -0.9]", &["[[solid]] 2", "min", "max"]);
    out("half_extent = 6.0", "normal = [0, 0, 0]", &["[[solid]] 1", "normal"]);
    out("direction = [0.0, -1.0, 0.0]", "direction = [0, 0, 0]", &["light", "direction"]);
    out("lit = true", "checker = { tile = 1, even = [1, 1, 1], odd = [0, 0, 0] }", &["color"]);
    out("samples = 4", "samples = 65", &["settings", "refract.samples", "1 to 64"]);

    for vector in ["origin = [0.0, -0.05, 0.0]", "irradiance = [3.0, 3.0, 3.0]"] {
        for value in ["nan", "inf"] {
            let to =
                vector.replace("0.0]", &format!("{value}]")).replace("3.0]", &format!("{value}]"));
            out(vector, &to, &[]);
        }
    }
    refused("[environment]\nradiance = [nan, 0.0, 0.0]");
    refused("[environment]\nscale = nan");
    refused("[environment]\nscale = -1.0");

    let lights = "[[light]]\nsun = { direction = [0, -1, 0], irradiance = [1, 1, 1] }\n";
    scene(&lights.repeat(16));
    assert_tells(&refused(&lights.repeat(17)), &["16 lights"]);
    let solids = "[[solid]]\nshape = \"sphere\"\ncenter = [0, 0, 0]\nradius = 1\n";
    scene(&solids.repeat(512));
    assert_tells(&refused(&solids.repeat(513)), &["512 solids"]);
}

// --------------------------------------------------------------------------------- settings

/// Each pass has its table in a scene.
#[test]
fn settings_of_every_pass() {
    let scene = scene(
        r#"
        [settings.classify]
        kernel = "volume"
        support = 3
        [settings.smooth]
        unit = "pixel"
        iterations = 2
        [settings.refract]
        solver = "newton"
        fresnel = "schlick"
        solids = "screen"
        reflections = "environment"
        radiance_scaling = false
        [settings.caustics]
        method = "gather"
        resolution = 256
        blur = 0.05
        [settings.tonemap]
        exposure = -1.5
        curve = "aces"
        "#,
    );
    let mut expected = Settings::default();
    (expected.classify.kernel, expected.classify.support) = (Kernel::Volume, 3.0);
    (expected.smooth.unit, expected.smooth.iterations) = (Unit::Pixel, 2);
    expected.refract.solver = Solver::Newton;
    expected.refract.fresnel = Fresnel::Schlick;
    expected.refract.solids = Solids::Screen;
    expected.refract.reflections = Reflections::Environment;
    expected.refract.radiance_scaling = false;
    (expected.caustics.method, expected.caustics.resolution) = (Method::Gather, 256);
    expected.caustics.blur = 0.05;
    (expected.tonemap.exposure, expected.tonemap.curve) = (-1.5, Curve::Aces);
    assert_eq!(scene.settings, expected);
}

/// The defaults are in their own ranges, and each of them can be written down and read back: as
/// a scene's table, and as one override per key.
#[test]
fn every_default_survives_a_round_trip() {
    let defaults = Settings::default();
    defaults.check().unwrap();
    let table = toml::Table::try_from(&defaults).unwrap();
    let written =
        toml::to_string(&toml::Table::from_iter([("settings".to_owned(), table.clone().into())]));
    assert_eq!(scene(&written.unwrap()).settings, defaults);

    let mut keys = BTreeSet::new();
    for (pass, settings) in &table {
        for (key, value) in settings.as_table().unwrap() {
            let set = format!("{pass}.{key}={value}");
            assert_eq!(defaults.with(std::slice::from_ref(&set)).unwrap(), defaults, "{set}");
            keys.insert(set);
        }
    }
    assert!(keys.len() > 20, "{keys:?}");
    // Other values than the defaults, down to the last bit.
    for value in [0.1f32, 1.0 / 3.0, 1.0e-3, 123.456] {
        let set = [format!("smooth.sigma={value}")];
        assert_eq!(defaults.with(&set).unwrap().smooth.sigma, value);
    }
}

/// --set takes what one types in a shell.
#[test]
fn overrides() {
    let with = |sets: &[&str]| {
        let sets: Vec<_> = sets.iter().map(|&set| set.to_owned()).collect();
        Settings::default().with(&sets)
    };
    // Bare words are strings; quotes are fine too.
    assert_eq!(with(&["refract.solver=march"]).unwrap().refract.solver, Solver::March);
    assert_eq!(with(&["refract.solver=\"march\""]).unwrap().refract.solver, Solver::March);
    assert_eq!(with(&[" refract.solver = march "]).unwrap().refract.solver, Solver::March);
    // Whole numbers for floats, negative ones, exponents.
    assert_eq!(with(&["tonemap.exposure=2"]).unwrap().tonemap.exposure, 2.0);
    assert_eq!(with(&["tonemap.exposure=-2"]).unwrap().tonemap.exposure, -2.0);
    assert_eq!(with(&["smooth.sigma=1e1"]).unwrap().smooth.sigma, 10.0);
    assert_eq!(with(&["caustics.method=gather"]).unwrap().caustics.method, Method::Gather);
    assert_eq!(with(&["caustics.blur=1"]).unwrap().caustics.blur, 1.0);
    assert!(!with(&["refract.radiance_scaling=false"]).unwrap().refract.radiance_scaling);
    // The last of several wins, and others stay.
    let last = with(&["refract.samples=2", "smooth.taps=7", "refract.samples=3"]).unwrap();
    assert_eq!((last.refract.samples, last.smooth.taps), (3, 7));

    for (set, parts) in [
        ("refract.sampels=2", &["`sampels`", "did you mean `samples`"][..]),
        ("refrct.samples=2", &["`refrct`", "did you mean `refract`"]),
        ("refract.solver=marsh", &["`marsh`", "did you mean `march`"]),
        ("caustics.resolutoin=2", &["`resolutoin`", "did you mean `resolution`"]),
        ("caustics.method=photons", &["`photons`"]),
        ("splat.size=1", &["`splat`"]),
        ("refract.samples=2.5", &["2.5"]),
        ("refract.samples=many", &["many"]),
        ("refract.samples=[[1, 2], [3]]", &["sequence"]),
        ("refract.samples=99999999999", &["99999999999"]),
        ("refract.samples=", &[]),
        ("refract.samples", &["pass.name=value"]),
        ("samples=2", &["pass.name=value"]),
        ("=", &["pass.name=value"]),
        ("", &["pass.name=value"]),
    ] {
        let error = with(&["smooth.taps=7", set]).expect_err(set);
        assert!(matches!(error, Error::Scene { .. }), "{error:?}");
        let message = error.to_string();
        assert!(message.starts_with(&format!("--set {set}: ")), "{message}");
        assert!(!message.contains('\n'), "{message}");
        assert_tells(&message, parts);
    }
    // Overrides are checked with the scene that they complete.
    let samples = ["refract.samples=0".to_owned()];
    let error = Scene::parse(FULL, "test.toml", Path::new("."), &samples).unwrap_err();
    assert_tells(&error.to_string(), &["refract.samples", "1 to 64"]);
}

/// Ends of ranges are inside.
#[test]
fn settings_ranges() {
    for (key, inside, outside) in [
        ("classify.support", ["1", "10"], ["0.9", "11"]),
        ("classify.splash_density", ["0", "1"], ["-0.1", "1.1"]),
        ("classify.smoothing", ["0", "1"], ["-0.1", "nan"]),
        ("smooth.iterations", ["0", "64"], ["65", "1000"]),
        ("smooth.taps", ["3", "33"], ["4", "35"]),
        ("refract.interfaces", ["1", "8"], ["0", "9"]),
        ("refract.samples", ["1", "64"], ["0", "65"]),
        ("refract.edge_samples", ["1", "64"], ["0", "65"]),
        ("caustics.resolution", ["16", "8192"], ["15", "8193"]),
        ("caustics.grid", ["8", "8192"], ["7", "8193"]),
        ("caustics.interfaces", ["1", "2"], ["0", "3"]),
        ("caustics.steps", ["1", "4096"], ["0", "4097"]),
        ("caustics.blur", ["0", "10"], ["-0.1", "nan"]),
        ("caustics.margin", ["0", "10"], ["-0.1", "inf"]),
        ("tonemap.exposure", ["-64", "64"], ["inf", "nan"]),
    ] {
        let check = |value: &str| Settings::default().with(&[format!("{key}={value}")])?.check();
        for value in inside {
            check(value).unwrap_or_else(|error| panic!("{error}"));
        }
        for value in outside {
            let message = check(value).expect_err(value).to_string();
            let told = value.parse::<f32>().unwrap().to_string();
            assert_tells(&message, &["settings", key, &told]);
        }
    }
}

// ----------------------------------------------------------------------------- environments

fn radiance(x: u32, y: u32) -> [f32; 3] {
    [0.25 * (x + 1) as f32, 0.5 * (y + 1) as f32, 3.0]
}

/// Each format of environment maps keeps its values and its orientation.
#[test]
fn environment_files() {
    let folder = tempfile::tempdir().unwrap();
    let map = Rgb32FImage::from_fn(4, 2, |x, y| Rgb(radiance(x, y)));
    for (name, tolerance) in [("sky.exr", 0.0), ("sky.hdr", 3.0 / 128.0)] {
        let path = folder.path().join(name);
        DynamicImage::ImageRgb32F(map.clone()).save(&path).unwrap();
        let Environment::Map { size, pixels } = Environment::load(&path).unwrap() else { panic!() };
        assert_eq!(size, UVec2::new(4, 2));
        for (i, pixel) in (0..).zip(pixels.iter()) {
            let [r, g, b, one] = *pixel;
            let expected = Vec3::from_array(radiance(i % 4, i / 4));
            let found = Vec3::new(r, g, b);
            assert!(close(found, expected, tolerance), "{name}: {found}, not {expected}");
            assert_eq!(one, 1.0);
        }
    }
    // PNG is sRGB: 188 is half as bright as white, 55 a twentieth part at 4 %.
    let path = folder.path().join("sky.png");
    RgbImage::from_pixel(1, 1, Rgb([188, 0, 255])).save(&path).unwrap();
    let Environment::Map { pixels, .. } = Environment::load(&path).unwrap() else { panic!() };
    assert!((pixels[0][0] - 0.5029).abs() < 1e-4, "{pixels:?}");
    assert_eq!(pixels[0][1..], [0.0, 1.0, 1.0]);
    // The contents tell the format, not the name.
    fs::rename(&path, folder.path().join("png.hdr")).unwrap();
    let renamed = Environment::load(&folder.path().join("png.hdr")).unwrap();
    assert_eq!(renamed, Environment::Map { size: UVec2::ONE, pixels });
}

/// What is no picture, or not a whole one, is an error that names the file, never a panic.
#[test]
fn damaged_environment_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let code = |name: &str| {
        let error = Environment::load(&path(name)).expect_err(name);
        let message = error.to_string();
        assert!(message.contains(name) && !message.contains('\n'), "{message}");
        error.exit_code()
    };
    assert_eq!(code("none.hdr"), 4);
    fs::create_dir(path("folder.exr")).unwrap();
    assert_eq!(code("folder.exr"), 4);
    for name in ["text.txt", "text.hdr", "text.exr", "text.png", "empty.hdr", "empty.png"] {
        fs::write(path(name), if name.starts_with("text") { "no picture at all" } else { "" })
            .unwrap();
        assert!([3, 4].contains(&code(name)), "{name}");
    }
    let map = Rgb32FImage::from_fn(64, 32, |x, y| Rgb(radiance(x, y)));
    for name in ["cut.hdr", "cut.exr", "cut.png"] {
        let picture = DynamicImage::ImageRgb32F(map.clone());
        let picture = if name.ends_with("png") { picture.into_rgb8().into() } else { picture };
        picture.save(path(name)).unwrap();
        let whole = fs::read(path(name)).unwrap();
        for share in [1, 4, 7] {
            fs::write(path(name), &whole[..whole.len() * share / 8]).unwrap();
            assert!([3, 4].contains(&code(name)), "{name}");
        }
    }
    for (name, value) in [("nan.exr", f32::NAN), ("infinite.exr", f32::INFINITY)] {
        let map = Rgb32FImage::from_pixel(2, 1, Rgb([0.0, value, 0.0]));
        DynamicImage::ImageRgb32F(map).save(path(name)).unwrap();
        assert_eq!(code(name), 3);
    }
}

/// The mean is over solid angle: against a quadrature of its own, and closed forms.
#[test]
fn mean_of_an_environment() {
    let [zenith, horizon, nadir] = [Vec3::X, Vec3::new(0.5, 2.0, 0.0), Vec3::new(0.0, 1.0, 4.0)];
    let gradient = Environment::Gradient { zenith, horizon, nadir };
    // Uniform in solid angle is uniform in the sine of the elevation.
    let count = 1000;
    let sines = (0..count).map(|i| (2 * i + 1 - count) as f32 / count as f32);
    let at = |sine: f32| horizon.lerp(if sine > 0.0 { zenith } else { nadir }, sine.abs());
    let mean = sines.map(at).sum::<Vec3>() / count as f32;
    assert!(close(gradient.mean(), mean, 1e-3), "{} {mean}", gradient.mean());

    let map = |height: u32, color: &dyn Fn(u32) -> Vec3| {
        let pixels = (0..height)
            .flat_map(|row| {
                let c = color(row);
                [[c.x, c.y, c.z, 1.0]; 3]
            })
            .collect();
        Environment::Map { size: UVec2::new(3, height), pixels }
    };
    let even = map(7, &|_| Vec3::new(1.0, 2.0, 3.0));
    assert!(close(even.mean(), Vec3::new(1.0, 2.0, 3.0), 1e-6));
    let half = map(8, &|row| if row < 4 { Vec3::ONE } else { Vec3::ZERO });
    assert!(close(half.mean(), Vec3::splat(0.5), 1e-6));
    // A cap of 18° around the zenith is (1 − cos 18°) / 2 of the sphere.
    let cap = map(1000, &|row| if row < 100 { Vec3::ONE } else { Vec3::ZERO });
    let share = 0.5 * (1.0 - 18f32.to_radians().cos());
    assert!(close(cap.mean(), Vec3::splat(share), 1e-5), "{} {share}", cap.mean());
    assert!(close(cap.scaled(3.0).mean(), Vec3::splat(3.0 * share), 3e-5));
}

// ---------------------------------------------------------------------------------- shapes

/// Distances to solids against closed forms, and normals that are their gradients: contact and
/// wetting stand on both.
#[test]
fn distances_to_solids() {
    let mut seed = 1;
    let [min, max] = [DVec3::new(-0.5, -0.2, 0.1), DVec3::new(0.3, 0.6, 0.5)];
    let center = DVec3::new(0.1, -0.2, 0.3);
    let normal = Vec3::new(1.0, 2.0, -2.0) / 3.0;
    let plane = Shape::Plane { origin: center, normal, half_extent: f32::INFINITY };
    for _ in 0..10_000 {
        let x = 1.5 * random(&mut seed).as_dvec3();

        let (distance, outward) = Shape::Sphere { center, radius: 0.4 }.distance(x);
        assert!((distance - (x.distance(center) - f64::from(0.4f32))).abs() < 1e-12);
        assert!(outward.abs_diff_eq((x - center).normalize(), 1e-12));

        assert_eq!(plane.distance(x), ((x - center).dot(normal.as_dvec3()), normal.as_dvec3()));

        let solid = Shape::Box { min, max };
        let (distance, outward) = solid.distance(x);
        let nearest = x.clamp(min, max);
        if nearest == x {
            let depth = (x - min).min(max - x).min_element();
            assert!((distance + depth).abs() < 1e-12, "{x}: {distance}, not −{depth}");
        } else {
            assert!((distance - x.distance(nearest)).abs() < 1e-12, "{x}: {distance}");
            assert!(outward.abs_diff_eq((x - nearest).normalize(), 1e-9), "{x}: {outward}");
        }
        assert!((outward.length() - 1.0).abs() < 1e-12);
        // A step of the distance against the normal ends on the surface.
        let surface = solid.distance(x - distance * outward).0;
        assert!(surface.abs() < 1e-12, "{x}: {surface} off the surface");
    }
}

/// Special places: on a surface, in a centre, at a corner, beside a square.
#[test]
fn distances_at_special_places() {
    let floor =
        Shape::Plane { origin: DVec3::new(1.0, 0.0, 0.0), normal: Vec3::Y, half_extent: 2.0 };
    assert_eq!(floor.distance(DVec3::new(2.5, -0.5, 1.5)), (-0.5, DVec3::Y));
    assert_eq!(floor.distance(DVec3::new(3.0, 0.0, -2.0)), (0.0, DVec3::Y));
    for beside in [DVec3::new(3.1, 0.1, 0.0), DVec3::new(-1.1, 0.1, 0.0), DVec3::new(0.0, 0.1, 2.1)]
    {
        assert_eq!(floor.distance(beside).0, f64::INFINITY, "beside a square there is nothing");
    }
    let cube = Shape::Box { min: -DVec3::ONE, max: DVec3::ONE };
    let ball = Shape::Sphere { center: DVec3::ZERO, radius: 1.0 };
    for solid in [cube, ball] {
        let (distance, normal) = solid.distance(DVec3::ZERO);
        assert_eq!(distance, -1.0);
        assert!(normal.is_normalized());
    }
    for (x, outward) in [
        (DVec3::new(2.0, 2.0, 2.0), DVec3::ONE.normalize()),
        (DVec3::new(-2.0, 0.0, 0.0), -DVec3::X),
        (DVec3::new(0.0, 1.0, 0.0), DVec3::Y),
        (DVec3::new(0.5, -0.25, -0.9), -DVec3::Z),
    ] {
        let (distance, normal) = cube.distance(x);
        assert!(distance.is_finite() && normal.abs_diff_eq(outward, 1e-12), "{x}: {normal}");
    }
}

// ---------------------------------------------------------------------------------- camera

/// A camera that defines no view is refused with the key to blame.
#[test]
fn cameras_that_see_nothing() {
    let good = Camera::fit(-DVec3::ONE, DVec3::ONE);
    good.check().unwrap();
    let bad = [
        (Camera { target: good.eye, ..good }, "eye"),
        (Camera { eye: DVec3::NAN, ..good }, "eye"),
        (Camera { target: DVec3::INFINITY, ..good }, "target"),
        (Camera { up: Vec3::ZERO, ..good }, "up"),
        (Camera { up: Vec3::NAN, ..good }, "up"),
        (Camera { up: (good.eye - good.target).as_vec3(), ..good }, "up"),
        (Camera { up: 1e-3 * (good.target - good.eye).as_vec3(), ..good }, "up"),
        (Camera { fov_y: 0.0, ..good }, "fov_y"),
        (Camera { fov_y: 180.0, ..good }, "fov_y"),
        (Camera { fov_y: f32::NAN, ..good }, "fov_y"),
        (Camera { near: Some(0.0), ..good }, "near"),
        (Camera { near: Some(f32::INFINITY), ..good }, "near"),
    ];
    for (camera, key) in bad {
        let error = camera.check().expect_err(key);
        assert!(matches!(error, Error::Scene { .. }));
        assert_tells(&error.to_string(), &["camera", key]);
    }
    // Looking straight down needs another up, not another camera.
    let down = Camera { eye: DVec3::new(0.0, 3.0, 0.0), target: DVec3::ZERO, ..good };
    assert!(down.check().is_err());
    Camera { up: -Vec3::Z, ..down }.check().unwrap();
}

/// A fitted camera sees the whole box, whatever its size and place, and fills a fair share of
/// the picture with it.
#[test]
fn a_fitted_camera_sees_everything() {
    let mut seed = 2;
    for i in 0..1000 {
        let scale = 10f64.powi(i % 9 - 4);
        let mut random = || random(&mut seed).as_dvec3();
        let centre = 3.0 * scale * random();
        let half = scale * random().abs();
        let (min, max) = (centre - half, centre + half);
        let camera = Camera::fit(min, max);
        camera.check().unwrap();
        let uniform = camera.uniform(UVec2::new(64, 48), DVec3::ZERO);
        let view_from_world =
            Mat3::from_cols_array_2d(&uniform.view_from_world.map(|[x, y, z, _]| [x, y, z]));
        let mut reach = 0f32;
        for corner in 0..8 {
            let bit = |axis: u32| f64::from(corner >> axis & 1);
            let corner = min + (max - min) * DVec3::new(bit(0), bit(1), bit(2));
            let seen = view_from_world * (corner - camera.eye).as_vec3();
            assert!(-seen.z > uniform.near, "{min} {max}: a corner is nearer than the near plane");
            let place = glam::Vec2::new(seen.x, seen.y).abs() / (-seen.z * uniform.tangent);
            assert!(place.max_element() <= 1.0, "{min} {max}: a corner is at {place}");
            reach = reach.max(place.max_element());
        }
        assert!(reach > 0.3, "{min} {max}: the box fills {reach} of the picture");
    }
}

/// A box without volume is what one particle or a flat sheet has, anywhere in space.
#[test]
fn a_camera_fits_flat_boxes() {
    for place in [DVec3::ZERO, DVec3::ONE, DVec3::new(-30.0, 100.0, 7.0), DVec3::splat(1000.0)] {
        Camera::fit(place, place).check().unwrap_or_else(|error| panic!("{place}: {error}"));
        Camera::fit(place, place + DVec3::X).check().unwrap();
        // The scene around one particle shows it: the eye is outside of it.
        let scene = Scene::around(place, place, 0.1);
        scene.check().unwrap_or_else(|error| panic!("{place}: {error}"));
        let camera = scene.camera.expect("a view of the particle");
        assert!(camera.eye.distance(place) > 0.2, "{place}: the eye is in the particle");
        // Nor does a particle of unknown size make a floor of endless tiles.
        Scene::around(place, place, 0.0).check().unwrap_or_else(|error| panic!("{error}"));
    }
}

// ---------------------------------------------------------------------------------- output

/// Names of pictures, in every dialect in which frames are written.
#[test]
fn output_names() {
    let folder = tempfile::tempdir().unwrap();
    let existing = folder.path().to_str().unwrap();
    let numbered = [
        ("a.png", 1, 7, "a.png"),
        ("a_{}.png", 1, 7, "a_7.png"),
        ("a_{}.png", 3, 12345, "a_12345.png"),
        ("a_####.png", 3, 7, "a_0007.png"),
        ("a_#.png", 3, 12, "a_12.png"),
        ("a_##.png", 3, 123, "a_123.png"),
        ("a_%d.png", 3, 7, "a_7.png"),
        ("a_%04d.png", 3, 7, "a_0007.png"),
        ("a_%4d.png", 3, 7, "a_0007.png"),
        ("a_$F.png", 3, 7, "a_7.png"),
        ("a.$F4.png", 3, 7, "a.0007.png"),
        ("####", 3, 7, "0007"),
        ("a_####.png", 3, -7, "a_-0007.png"),
        ("out/", 1, 7, "out/frame_0007.png"),
        ("out/", 3, 70000, "out/frame_70000.png"),
        // Only the file's name is numbered, not the folder's.
        ("take#2/a_####.png", 3, 7, "take#2/a_0007.png"),
        ("take{}/a.png", 1, 7, "take{}/a.png"),
        // A per cent sign alone is none.
        ("100%.png", 1, 7, "100%.png"),
        ("50%_%04d.png", 3, 7, "50%_0007.png"),
        ("50%_####.png", 3, 7, "50%_0007.png"),
    ];
    for (output, frames, frame, expected) in numbered {
        let names = OutputNames::parse(output, frames).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(names.path(frame), Path::new(expected), "{output}");
    }
    let inside = OutputNames::parse(existing, 3).unwrap().path(7);
    assert_eq!(inside, folder.path().join("frame_0007.png"));

    for output in ["a.png", "take{}/a.png", "100%.png"] {
        let error = OutputNames::parse(output, 3).unwrap_err();
        assert!(matches!(error, Error::Usage(_)), "{error:?}");
        assert_tells(&error.to_string(), &["3 frames", output, "####"]);
    }
}

fn names(folder: &TempDir) -> Vec<String> {
    let entries = fs::read_dir(folder.path()).unwrap();
    let mut names: Vec<_> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// A file is there as a whole or not at all: a failed write keeps what was there before, and
/// leaves no temporary file.
#[test]
fn files_are_written_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.txt");
    let full = |file: &mut io::BufWriter<&fs::File>| {
        file.write_all(&[b'x'; 100_000])?;
        Err(io::Error::new(io::ErrorKind::StorageFull, "the disk is full"))
    };
    let error = write_atomically(&path, full).unwrap_err();
    assert!(matches!(error, Error::Io { action: "write", .. }), "{error:?}");
    assert_tells(&error.to_string(), &["a.txt", "the disk is full"]);
    assert_eq!(names(&folder), [""; 0]);

    write_atomically(&path, |file| file.write_all(b"first")).unwrap();
    write_atomically(&path, full).unwrap_err();
    assert_eq!(fs::read(&path).unwrap(), b"first");
    write_atomically(&path, |file| file.write_all(b"second")).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"second");
    assert_eq!(names(&folder), ["a.txt"]);

    // A name that is taken by a folder, and a folder that is a file or not there.
    fs::create_dir(folder.path().join("taken")).unwrap();
    for name in ["taken", "a.txt/b.txt", "none/b.txt"] {
        let error = write_atomically(&folder.path().join(name), |file| file.write_all(b"lost"));
        let message = error.unwrap_err().to_string();
        assert_tells(&message, &[name, "cannot write"]);
        assert!(!message.contains(".limpid-"), "the temporary name is nobody's concern: {message}");
    }
    assert_eq!(names(&folder), ["a.txt", "taken"]);
}

/// Temporary files are private; what they become is as readable as any other file.
#[cfg(unix)]
#[test]
fn files_have_ordinary_permissions() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let [ours, plain] = ["ours", "plain"].map(|name| folder.path().join(name));
    write_atomically(&ours, |file| file.write_all(b"x")).unwrap();
    fs::write(&plain, "x").unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&ours), mode(&plain));
}

/// Devices and sockets are never replaced by a file: `-o /dev/null` as root must stay harmless.
#[cfg(unix)]
#[test]
fn what_is_no_file_is_not_replaced() {
    use std::os::unix::fs::FileTypeExt;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("socket");
    let _socket = std::os::unix::net::UnixListener::bind(&path).unwrap();
    write_atomically(&path, |file| file.write_all(b"x")).unwrap_err();
    assert!(fs::metadata(&path).unwrap().file_type().is_socket());
    assert_eq!(names(&folder), ["socket"]);
}

/// A PNG holds the pixels that were given, in any size.
#[test]
fn pngs_keep_their_pixels() {
    let folder = tempfile::tempdir().unwrap();
    for (width, height) in [(1, 1), (3, 7), (640, 1)] {
        let picture = RgbImage::from_fn(width, height, |x, y| Rgb([x as u8, y as u8, 200]));
        let path = folder.path().join("a.png");
        write_png(&path, &picture).unwrap();
        assert_eq!(image::open(&path).unwrap(), DynamicImage::ImageRgb8(picture));
    }
}

/// Protects saved scenes: what is written is read as the same scene, for every scene that comes
/// with the program.
#[test]
fn scenes_survive_being_written() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("sims");
    let mut count = 0;
    for entry in fs::read_dir(&folder).expect("there are scenes") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|e| e != "toml") {
            continue;
        }
        count += 1;
        let text = fs::read_to_string(&path).expect("it can be read");
        let parse = |text: &str| Scene::parse(text, "scene", Path::new(""), &[]);
        let scene = parse(&text).expect("it is a scene");
        let written = scene.to_toml(None).expect("it can be written");
        let again =
            parse(&written).unwrap_or_else(|e| panic!("{}: {e}\n{written}", path.display()));
        assert_eq!(again, scene, "{}\n{written}", path.display());
    }
    assert!(count > 5);
}

/// Protects what the scenes that come with the program do not have: several fluids, a sphere, a
/// point light, further views, an environment map.
#[test]
fn scene_with_everything_survives_being_saved() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    Rgb32FImage::from_fn(4, 2, |x, y| Rgb([0.1 + x as f32, 1e-3, 7.5 * y as f32]))
        .save(at("sky.exr"))
        .expect("a map");
    let text = r#"
        [[fluid]]
        source = "a_{}.bgeo"
        radius = 0.01
        fps = 24.0
        color = [0.9, 0.5, 0.1]
        [[fluid]]
        source = "b.ply"
        up = "z"
        frame = 3
        [liquid]
        ior = 1.1
        [[view]]
        name = "near"
        camera = { eye = [0.1, 2, 3], target = [0, 0, 0], fov_y = 30 }
        [environment]
        map = "sky.exr"
        scale = 0.3
        [[solid]]
        shape = "sphere"
        center = [0.1, 0.2, 0.3]
        radius = 0.7
        lit = true
        [[solid]]
        shape = "plane"
        origin = [0, -1, 0]
        normal = [0, 0, 2]
        [[light]]
        point = { position = [0.1, 5, 0], intensity = [1, 2, 3] }
        [settings]
        preset = "mayer2026"
        smooth = { sigma = 0.3 }
    "#;
    fs::write(at("scene.toml"), text).expect("it is written");
    let scene = Scene::load(&at("scene.toml")).expect("it is a scene");
    assert!(matches!(scene.lights[0], Light::Point { .. }));
    scene.save(&at("saved.toml")).expect("it is saved");
    assert_eq!(Scene::load(&at("saved.toml")).expect("it is a scene"), scene);
    let written = fs::read_to_string(at("saved.toml")).expect("text");
    assert!(
        written.contains("source = \"a_{}.bgeo\""),
        "what is beside it has a short name: {written}"
    );
    assert!(scene.to_toml(None).is_err(), "a map needs a file");
}

/// Protects overrides of the liquid: the right one changes, and what is none is refused.
#[test]
fn liquid_can_be_overridden() {
    let text = "[[fluid]]\nsource = \"a\"\n[[fluid]]\nsource = \"b\"\n";
    let mut scene = Scene::parse(text, "scene", Path::new(""), &[]).expect("a scene");
    let before = scene.clone();
    scene.set_optics("liquid.ior=1.5").expect("an index");
    scene.set_optics("fluid.2.absorption=[1, 2.5, 3.0]").expect("an absorption");
    assert_eq!((scene.liquid.ior, scene.fluids[1].absorption), (1.5, Vec3::new(1.0, 2.5, 3.0)));
    assert_eq!(scene.fluids[0], before.fluids[0]);
    for bad in [
        "liquid.ior=wet",
        "liquid.colour=[1,1,1]",
        "fluid.3.absorption=[1,1,1]",
        "fluid.0.absorption=[1,1,1]",
        "liquid.absorption=[1,1]",
        "liquid.ior",
    ] {
        let error = scene.set_optics(bad).expect_err(bad).to_string();
        assert!(error.contains(bad), "{error}");
    }
}
