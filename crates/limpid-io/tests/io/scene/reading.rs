//! Reading of scene files: the meaning, default and range of each key, and errors.

use std::path::Path;

use glam::{DVec3, UVec2, Vec3};
use image::{Rgb, RgbImage};
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::liquid::Up;
use limpid::scene::{Light, Shape, Surface};
use limpid::settings::{Settings, Solver};
use limpid_io::Error;
use limpid_io::project::{LiquidSource, Project};

use super::{FULL, assert_contains, parse, project, scene};

/// The message for a scene that must be refused: one line that names the file.
#[track_caller]
fn refused(text: &str) -> String {
    let error = parse(text).expect_err(text);
    assert!(matches!(error, Error::Scene { .. }), "{error:?}");
    assert_eq!(error.category() as u8, 2);
    let message = error.to_string();
    assert!(message.starts_with("test.toml: "), "{message}");
    assert!(!message.contains('\n'), "{message}");
    message
}

/// Checks that `FULL` with `from` replaced by `to` is refused at that line, with `parts` in the message.
#[track_caller]
fn assert_error_at(from: &str, to: &str, parts: &[&str]) {
    assert_eq!(FULL.matches(from).count(), 1, "`{from}` occurs once");
    let message = refused(&FULL.replace(from, to));
    let line = FULL[..FULL.find(from).unwrap()].matches('\n').count() + 1;
    let place = format!("test.toml: line {line}: ");
    assert!(message.starts_with(&place), "`{place}` expected: {message}");
    assert_contains(&message, parts);
}

/// Every key sets its field.
#[test]
fn every_key_sets_its_field() {
    let Project { scene, source, camera, .. } = project(FULL);
    let LiquidSource::File(particles) = source else { panic!("expected particles from a file") };
    // Paths are relative to the scene file.
    assert_eq!(Path::new(&particles.source), Path::new("scenes/../water/fluid_{}.bgeo"));
    assert_eq!((particles.frame, particles.radius), (Some(20), Some(0.025)));
    assert_eq!(particles.up, Some(Up::Z));
    assert_eq!((scene.liquid.ior, scene.liquid.absorption), (1.4, Vec3::new(1.0, 0.5, 0.25)));
    let expected = Camera {
        eye: DVec3::new(0.0, 1.5, 4.0),
        target: DVec3::new(0.0, 0.25, 0.0),
        up: Vec3::Y,
        fov_y: 40.0,
        near: Some(0.01),
        lens: None,
    };
    assert_eq!(camera, Some(expected));
    let gradient = Environment::Gradient {
        zenith: Vec3::new(0.2, 0.4, 0.8),
        horizon: Vec3::new(0.8, 0.9, 1.0),
        nadir: Vec3::splat(0.3),
    };
    assert_eq!(scene.environment, gradient);

    let [floor, wall, ball] = &scene.solids[..] else { panic!("three solids: {:?}", scene.solids) };
    let plane =
        Shape::Plane { origin: DVec3::new(0.0, -0.05, 0.0), normal: Vec3::Y, half_extent: 6.0 };
    let checker = Surface::Checker {
        tile: 0.25,
        even: Vec3::new(0.8, 0.8, 0.7),
        odd: Vec3::new(0.1, 0.2, 0.3),
    };
    assert_eq!((&floor.shape, &floor.surface, floor.lit), (&plane, &checker, false));
    let corners = Shape::Box { min: DVec3::new(-1.0, 0.0, -1.0), max: DVec3::new(1.0, 0.5, -0.9) };
    let color = Surface::Color(Vec3::new(0.5, 0.25, 0.125));
    assert_eq!((&wall.shape, &wall.surface, wall.lit), (&corners, &color, true));
    assert_eq!(ball.shape, Shape::Sphere { center: DVec3::new(0.0, 0.25, 0.5), radius: 0.25 });

    let [sun, lamp] = scene.lights[..] else { panic!("two lights: {:?}", scene.lights) };
    assert_eq!(sun, Light::Sun { direction: -Vec3::Y, irradiance: Vec3::splat(3.0) });
    let position = DVec3::new(1.0, 2.0, 3.0);
    assert_eq!(lamp, Light::Point { position, intensity: Vec3::new(4.0, 5.0, 6.0) });
    assert_eq!((scene.settings.refract.samples, scene.settings.refract.solver), (4, Solver::March));
    assert_eq!(scene.settings.smooth, Settings::default().smooth);
}

/// Omitted keys have the documented defaults; an empty file is a scene without particles.
#[test]
fn omitted_keys_have_defaults() {
    let empty = project("");
    assert_eq!((empty.source, empty.camera), (LiquidSource::Unspecified, None));
    let empty = empty.scene;
    assert_eq!((empty.liquid.ior, empty.solids.len(), empty.lights.len()), (1.33, 0, 0));
    assert_eq!(empty.environment, Environment::default());
    assert_eq!(empty.settings, Settings::default());

    let few = project(
        r#"
        [particles]
        source = "a.ply"
        [camera]
        eye = [0, 0, 1]     # integers are valid numbers
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
    let particles = &few.source.files()[0];
    assert_eq!((particles.frame, particles.radius, particles.up), (None, None, None));
    let (camera, few) = (few.camera.unwrap(), few.scene);
    assert_eq!((camera.up, camera.near), (Vec3::Y, None));
    assert_eq!(camera.near(), 1e-3);
    let Environment::Gradient { horizon, nadir, .. } = few.environment else { panic!() };
    assert_eq!(horizon, nadir, "the nadir defaults to the horizon");
    let Shape::Plane { normal, half_extent, .. } = few.solids[0].shape else { panic!() };
    assert_eq!((normal, half_extent), (Vec3::Z, f32::INFINITY));
    assert!(!few.solids[0].lit);
}

/// The three kinds of environment, and the scale.
#[test]
fn environments() {
    let constant = scene("[environment]\nradiance = [0.5, 1.0, 2.0]\nscale = 2.0").environment;
    assert_eq!(constant, Environment::Constant(Vec3::new(1.0, 2.0, 4.0)));
    assert_eq!(constant.mean(), Vec3::new(1.0, 2.0, 4.0));

    let folder = tempfile::tempdir().unwrap();
    RgbImage::from_pixel(4, 2, Rgb([255, 0, 255])).save(folder.path().join("sky.png")).unwrap();
    let text = "[environment]\nmap = \"sky.png\"\nscale = 0.5";
    let map = Project::parse(text, "test.toml", folder.path()).unwrap().scene.environment;
    let pixels = vec![[0.5, 0.0, 0.5, 1.0]; 8].into();
    assert_eq!(map, Environment::Map { size: UVec2::new(4, 2), pixels });

    let both = refused("[environment]\nradiance = [1, 1, 1]\nmap = \"sky.png\"");
    assert_contains(&both, &["one of", "radiance", "gradient", "map"]);
    // A missing map is an I/O error, not an error in the scene.
    let error = parse("[environment]\nmap = \"none.png\"").unwrap_err();
    assert!(matches!(error, Error::Io { .. }), "{error:?}");
    assert_contains(&error.to_string(), &["scenes", "none.png"]);
}

/// A background is the picture of its file, survives saving, also with comments, and is missed by name.
#[test]
fn backgrounds() {
    let folder = tempfile::tempdir().unwrap();
    RgbImage::from_pixel(4, 2, Rgb([255, 0, 255])).save(folder.path().join("sky.png")).unwrap();
    let text = "[background]\nfile = \"sky.png\"\n";
    let project = Project::parse(text, "test.toml", folder.path()).unwrap();
    let background = project.scene.background.as_ref().expect("a background");
    assert_eq!((background.size(), background.pixels()[0]), (UVec2::new(4, 2), [255, 0, 255, 255]));
    let written = [project.to_toml(None).unwrap(), project.to_commented_toml(None).unwrap()];
    for written in written {
        let again = Project::parse(&written, "test.toml", folder.path()).unwrap();
        assert_eq!(again.scene.background, project.scene.background, "{written}");
    }
    let error = parse("[background]\nfile = \"none.png\"").unwrap_err();
    assert_contains(&error.to_string(), &["none.png"]);
}

/// An unknown key in any table is an error with its line and the nearest known key.
#[test]
fn unknown_keys_suggest_the_nearest() {
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
        // Names of values.
        ("\"z\"", "\"zz\"", "zz", "z"),
        ("\"sphere\"", "\"spheer\"", "spheer", "sphere"),
        ("\"march\"", "\"marsh\"", "marsh", "march"),
    ];
    for (from, to, unknown, nearest) in keys {
        assert_error_at(from, to, &[unknown, &format!("did you mean `{nearest}`?")]);
    }
}

/// A value of the wrong type and a TOML syntax error are reported with their line.
#[test]
fn type_and_syntax_errors_name_the_line() {
    assert_error_at("ior = 1.4", "ior = \"water\"", &["string"]);
    assert_error_at("frame = 20", "frame = 2.5", &["floating point"]);
    assert_error_at("lit = true", "lit = 1", &["boolean"]);
    assert_error_at("eye = [0.0, 1.5, 4.0]", "eye = [0.0, 1.5]", &["2"]);
    assert_error_at("max = [1.0, 0.5, -0.9]", "max = 1.0", &["floating point"]);
    assert_error_at("samples = 4", "samples = -4", &["-4"]);
    assert_error_at("fov_y = 40.0", "fov_y = 40 degrees", &[]);
    assert_error_at("near = 0.01", "fov_y = 41.0", &["duplicate"]);
    assert_error_at("sun = { direction = [0.0, -1.0, 0.0], ", "sun = { ", &["direction"]);
}

/// Errors of missing required keys name the key and its table.
#[test]
fn missing_keys_are_named() {
    let missing = |key: &str| {
        let mut lines: Vec<_> = FULL.lines().collect();
        let at = lines.iter().position(|line| line.starts_with(&format!("{key} = "))).expect(key);
        lines.remove(at);
        refused(&lines.join("\n"))
    };
    assert_contains(&missing("eye"), &["eye"]);
    assert_contains(&missing("target"), &["target"]);
    assert_contains(&missing("shape"), &["shape"]);
    assert_contains(&missing("origin"), &["[[solid]] 1", "plane", "origin"]);
    assert_contains(&missing("min"), &["[[solid]] 2", "box", "min"]);
    assert_contains(&missing("max"), &["[[solid]] 2", "box", "max"]);
    assert_contains(&missing("center"), &["[[solid]] 3", "sphere", "center"]);
    let no_radius = FULL.replace("radius = 0.25\n", "");
    assert_contains(&refused(&no_radius), &["[[solid]] 3", "sphere", "radius"]);
    assert_contains(&refused("[[light]]"), &["line 1"]);
    let two = "[[light]]\nsun = { direction = [0, -1, 0], irradiance = [1, 1, 1] }\npoint = 1";
    refused(two);
}

/// Errors of numbers out of range name the key. NaN and ∞ are never valid.
#[test]
fn numbers_out_of_range_are_errors() {
    let out = |from: &str, to: &str, parts: &[&str]| {
        assert_eq!(FULL.matches(from).count(), 1, "`{from}` occurs once");
        assert_contains(&refused(&FULL.replace(from, to)), parts);
    };
    for ior in ["0.29", "3.5", "nan", "inf", "-1.33"] {
        out("ior = 1.4", &format!("ior = {ior}"), &["liquid", "ior"]);
    }
    // A decimal comma makes two numbers of one.
    out(
        "absorption = [1.0, 0.5, 0.25]",
        "absorption = [1,0, 0.5, 0.25]",
        &["liquid.absorption has 4"],
    );
    for absorption in ["-0.5", "nan", "inf"] {
        let to = format!("absorption = [1.0, {absorption}, 0.25]");
        out("absorption = [1.0, 0.5, 0.25]", &to, &["liquid", "absorption"]);
    }
    for radius in ["0.0", "-0.025", "nan", "inf"] {
        out("radius = 0.025", &format!("radius = {radius}"), &["particles", "radius"]);
        out("radius = 0.25\n", &format!("radius = {radius}\n"), &["[[solid]] 3", "radius"]);
    }
    // As with --radius: its cube underflows a 32-bit float.
    let tiny = "[[fluid]]\nsource = \"a.xyz\"\n[[fluid]]\nsource = \"b.xyz\"\nradius = 1e-30\n";
    assert_contains(&refused(tiny), &["[[fluid]] 2", "radius is 1e-30", "1e-12"]);
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
    assert_contains(&refused(&lights.repeat(17)), &["16 lights"]);
    let solids = "[[solid]]\nshape = \"sphere\"\ncenter = [0, 0, 0]\nradius = 1\n";
    scene(&solids.repeat(512));
    assert_contains(&refused(&solids.repeat(513)), &["512 solids"]);
}

/// A mesh is read with its placement, normals and texture, saved, and read back the same; solids share a file.
#[test]
fn meshes_are_read_and_saved() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let wedge = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n\
        f 1/1 3/3 2/2\nf 1/1 2/2 4/3\nf 1/1 4/3 3/2\nf 2/1 3/2 4/3\n";
    std::fs::write(file("wedge.obj"), wedge).unwrap();
    RgbImage::from_pixel(2, 2, Rgb([200, 100, 50])).save(file("red.png")).unwrap();
    let text = r#"
        [environment]
        radiance = [1, 1, 1]
        [[solid]]
        shape = "mesh"
        file = "wedge.obj"
        scale = 0.5
        rotate = [0, 2, 0, 90]
        translate = [1, 2, 3]
        lit = true
        [[solid]]
        shape = "mesh"
        file = "wedge.obj"
        color = [0.1, 0.2, 0.3]
        [[solid]]
        shape = "mesh"
        file = "wedge.obj"
        texture = "red.png"
        flip = true
        normals = "smooth"
        [[solid]]
        shape = "plane"
        origin = [0, 0, 0]
        texture = "red.png"
        tile = 0.5
    "#;
    std::fs::write(file("scene.toml"), text).unwrap();
    let project = Project::load(&file("scene.toml")).unwrap();
    let [a, b, c, floor] = &project.scene.solids[..] else { panic!("four solids") };
    let Shape::Mesh { mesh, placement } = &a.shape else { panic!("a mesh") };
    assert!(mesh.is_closed());
    let corner = placement.world_from_mesh(DVec3::X);
    assert!(corner.abs_diff_eq(DVec3::new(1.0, 2.0, 2.5), 1e-12), "{corner}");
    let Shape::Mesh { mesh: shared, .. } = &b.shape else { panic!("a mesh") };
    assert!(std::sync::Arc::ptr_eq(mesh, shared));
    assert_eq!(
        (&a.surface, &b.surface),
        (&Surface::Own, &Surface::Color(Vec3::new(0.1, 0.2, 0.3)))
    );
    let Shape::Mesh { mesh: painted, .. } = &c.shape else { panic!("a mesh") };
    assert_eq!((painted.materials().len(), painted.normals().len()), (1, painted.vertices().len()));
    assert!(matches!(floor.surface, Surface::Texture { tile: 0.5, .. }));

    project.save(&file("saved.toml")).unwrap();
    let saved = Project::load(&file("saved.toml")).unwrap();
    assert_eq!(saved.scene.solids, project.scene.solids);

    for (from, to, expected) in [
        ("file = \"wedge.obj\"", "", "a mesh needs file"),
        ("file = \"wedge.obj\"", "file = \"wedge.dwg\"", "wedge.dwg"),
        ("scale = 0.5", "scale = 0", "scale"),
        ("scale = 0.5", "radius = 0.5", "a mesh has no radius"),
        ("rotate = [0, 2, 0, 90]", "rotate = [0, 0, 0, 90]", "axis"),
        ("tile = 0.5", "", "needs tile"),
        ("texture = \"red.png\"\n        tile", "tile", "texture"),
        ("texture = \"red.png\"", "texture = \"blue.png\"", "blue.png"),
    ] {
        let wrong = text.replacen(from, to, 1);
        assert_ne!(wrong, text, "{from}");
        std::fs::write(file("wrong.toml"), wrong).unwrap();
        let error = Project::load(&file("wrong.toml")).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}: `{expected}` expected");
    }
}
