//! Settings of the passes and overrides from the command line: defaults, ranges, errors.

use std::collections::BTreeSet;

use glam::Vec3;
use limpid::settings::{
    Curve, Filter, Fresnel, Kernel, Method, Reflections, Settings, Solids, Solver, Unit,
};
use limpid_io::Error;
use limpid_io::project::overrides::replaced;
use limpid_io::shared_classifier::Processor;

use super::{FULL, assert_contains, parse, scene};

/// Each pass has a table in a scene.
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

/// The defaults are in range, and survive a round trip as a scene's table and as one override per key.
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
            assert_eq!(replaced(&defaults, std::slice::from_ref(&set)).unwrap(), defaults, "{set}");
            keys.insert(set);
        }
    }
    assert!(keys.len() > 20, "{keys:?}");
    // Other values, bit-identically.
    for value in [0.1f32, 1.0 / 3.0, 1.0e-3, 123.456] {
        let set = [format!("smooth.sigma={value}")];
        assert_eq!(replaced(&defaults, &set).unwrap().smooth.sigma, value);
    }
}

/// Overrides accept the usual notations of a shell, and errors suggest the nearest name.
#[test]
fn override_notations_and_errors() {
    let with = |sets: &[&str]| {
        let sets: Vec<_> = sets.iter().map(|&set| set.to_owned()).collect();
        replaced(&Settings::default(), &sets)
    };
    // Bare words are strings; quotes are allowed.
    assert_eq!(with(&["refract.solver=march"]).unwrap().refract.solver, Solver::March);
    assert_eq!(with(&["refract.solver=\"march\""]).unwrap().refract.solver, Solver::March);
    assert_eq!(with(&[" refract.solver = march "]).unwrap().refract.solver, Solver::March);
    // Integers for floats, negative numbers, exponents.
    assert_eq!(with(&["tonemap.exposure=2"]).unwrap().tonemap.exposure, 2.0);
    assert_eq!(with(&["tonemap.exposure=-2"]).unwrap().tonemap.exposure, -2.0);
    assert_eq!(with(&["smooth.sigma=1e1"]).unwrap().smooth.sigma, 10.0);
    assert_eq!(with(&["caustics.method=gather"]).unwrap().caustics.method, Method::Gather);
    assert_eq!(with(&["caustics.blur=1"]).unwrap().caustics.blur, 1.0);
    assert!(!with(&["refract.radiance_scaling=false"]).unwrap().refract.radiance_scaling);
    // The last of several wins, and the others are kept.
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
        assert!(matches!(error, Error::Override { .. }), "{error:?}");
        let message = error.to_string();
        assert!(message.starts_with(&format!("{set}: ")), "{message}");
        assert!(!message.contains('\n'), "{message}");
        assert_contains(&message, parts);
    }
    // Ranges are checked together with the scene.
    let samples = ["refract.samples=0".to_owned()];
    let mut project = parse(FULL).expect("a scene");
    project.set(&samples).expect("a number");
    let error = project.check().unwrap_err();
    assert_contains(&error.to_string(), &["refract.samples", "1 to 64"]);
}

/// Ranges include their ends.
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
        let check = |value: &str| {
            let settings = replaced(&Settings::default(), &[format!("{key}={value}")]);
            settings.expect("a number").check()
        };
        for value in inside {
            check(value).unwrap_or_else(|error| panic!("{error}"));
        }
        for value in outside {
            let message = check(value).expect_err(value).to_string();
            let printed = value.parse::<f32>().unwrap().to_string();
            assert_contains(&message, &["settings", key, &printed]);
        }
    }
}

/// Overrides of the liquid, the fluids and the processor change only their target, and invalid ones are
/// errors.
#[test]
fn liquid_and_processor_can_be_overridden() {
    let text = "[[fluid]]\nsource = \"a\"\n[[fluid]]\nsource = \"b\"\n";
    let mut project = parse(text).expect("a scene");
    let before = project.scene.clone();
    let set = ["liquid.ior=1.5", "fluid.2.absorption=[1, 2.5, 3.0]", "classify.on=cpu"];
    project.set(&set.map(String::from)).expect("an index, an absorption, a processor");
    let scene = &project.scene;
    assert_eq!((scene.liquid.ior, scene.fluids[1].absorption), (1.5, Vec3::new(1.0, 2.5, 3.0)));
    assert_eq!(scene.fluids[0], before.fluids[0]);
    assert_eq!(project.processor, Processor::Cpu);
    for bad in [
        "liquid.ior=wet",
        "liquid.colour=[1,1,1]",
        "fluid.3.absorption=[1,1,1]",
        "fluid.0.absorption=[1,1,1]",
        "liquid.absorption=[1,1]",
        "liquid.ior",
        "classify.on=both",
    ] {
        let error = project.set(&[bad.into()]).expect_err(bad).to_string();
        assert!(error.contains(bad), "{error}");
    }
}

/// The names of the smoothing filters in settings, and the ranges of their parameters.
#[test]
fn smoothing_filters_and_parameters() {
    let with = |set: &str| replaced(&Settings::default(), &[set.to_owned()]);
    const FILTERS: [Filter; 3] = [Filter::PlaneFit, Filter::Bilateral, Filter::NarrowRange];
    assert_eq!(Settings::default().smooth.filter, Filter::PlaneFit);
    for (name, filter) in ["plane-fit", "bilateral", "narrow-range"].into_iter().zip(FILTERS) {
        let set = with(&format!("smooth.filter={name}")).unwrap();
        assert_eq!(set.smooth.filter, filter);
    }
    let unknown = with("smooth.filter=bilatreal").unwrap_err().to_string();
    assert!(unknown.contains("did you mean `bilateral`"), "{unknown}");
    for (key, ends, outside) in
        [("delta", ["0.001", "1e6"], ["0", "nan"]), ("mu", ["0", "1000"], ["-1", "1001"])]
    {
        for value in ends {
            with(&format!("smooth.{key}={value}")).unwrap().check().unwrap();
        }
        for value in outside {
            let settings = with(&format!("smooth.{key}={value}")).unwrap();
            let message = settings.check().unwrap_err().to_string();
            assert!(message.contains(&format!("smooth.{key} is")), "{message}");
        }
    }
}
