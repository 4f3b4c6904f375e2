//! Presets: valid settings, round trips through files, and overrides by scenes and the command line.

use std::path::Path;

use glam::{DVec3, UVec2, Vec3};
use limpid::liquid::Particles;
use limpid::liquid::classify::classify;
use limpid::scene::Scene;
use limpid::settings::{
    Curve, Filter, Fresnel, Kernel, Preset, Reflections, Settings, Solids, Solver, Unit,
};
use limpid_io::error::Error;
use limpid_io::project::{Project, overrides};

use crate::support::frames::{
    ellipsoid, harness, mean_difference, noise_turn, noise_vector, on_axis, sphere, splats,
};

fn parse(text: &str, overrides: &[&str]) -> Result<Scene, Error> {
    let overrides: Vec<_> = overrides.iter().map(|&text| text.to_owned()).collect();
    let mut project = Project::parse(text, "test.toml", Path::new("."))?;
    project.set(&overrides)?;
    project.check()?;
    Ok(project.scene)
}

fn settings(text: &str, overrides: &[&str]) -> Settings {
    parse(text, overrides).unwrap_or_else(|e| panic!("{e}\n{text}")).settings
}

/// Each preset is found by its name, is in range, and survives a round trip through a scene file.
#[test]
fn every_preset_survives_a_round_trip() {
    for preset in Preset::ALL {
        let name = preset.to_string();
        assert_eq!(overrides::preset(&name).unwrap(), preset);
        assert_eq!(toml::Value::from(name.clone()).try_into::<Preset>().unwrap(), preset);
        let expected = preset.settings();
        expected.check().unwrap_or_else(|e| panic!("{name}: {e}"));

        // Given by its name, by its tables, and by its tables over another preset.
        let named = format!("[settings]\npreset = \"{name}\"\n");
        let table = toml::Table::try_from(&expected).unwrap();
        let tables =
            |table| toml::Table::from_iter([("settings".to_owned(), toml::Value::Table(table))]);
        let mut both = table.clone();
        both.insert("preset".into(), "limpid".into());
        for text in [named, tables(table).to_string(), tables(both).to_string()] {
            assert_eq!(settings(&text, &[]), expected, "{text}");
        }
    }
    assert_eq!(Preset::Limpid.settings(), Settings::default());
}

/// The presets have the parameters of their papers, independent of the defaults.
#[test]
fn presets_match_their_papers() {
    let later = Preset::Imai2016.settings();
    let (c, s, r) = (&later.classify, &later.smooth, &later.refract);
    assert_eq!((c.kernel, c.max_ratio, c.smoothing), (Kernel::Volume, 4.0, 0.9));
    assert_eq!(c.splash_radius, 1.0);
    assert_eq!((s.filter, s.iterations, s.sigma), (Filter::PlaneFit, 5, 5.3));
    assert_eq!((s.unit, s.window, s.taps), (Unit::Pixel, 9.0, 9));
    assert_eq!((r.solver, r.interfaces, r.internal_bounces), (Solver::Secant, 4, 0));
    assert_eq!((r.fresnel, r.reflections), (Fresnel::Schlick, Reflections::Environment));
    assert_eq!(r.samples, 1);

    let earlier = Preset::Imai2014.settings();
    assert_eq!(earlier.smooth, limpid::settings::Smooth { filter: Filter::Bilateral, ..s.clone() });
    assert_eq!(earlier.refract, limpid::settings::Refract { interfaces: 2, ..r.clone() });

    let newton = Preset::Mayer2026.settings();
    let r = &newton.refract;
    assert_eq!((r.solver, r.iterations, r.interfaces), (Solver::Newton, 5, 2));
    assert_eq!((r.fresnel, r.solids, r.internal_bounces), (Fresnel::Schlick, Solids::Screen, 0));
    let classify = Settings::default().classify;
    assert_eq!(newton.classify, limpid::settings::Classify { iso_surface: false, ..classify });
    assert!(
        Preset::ALL.iter().all(|preset| {
            preset.settings().classify.iso_surface == (*preset == Preset::Limpid)
        })
    );
}

/// Imai et al. (2014) have neither splashes nor ellipsoids: every particle, also an isolated one, is a
/// sphere of radius r at its position, in a single pair of layers.
#[test]
fn imai2014_draws_spheres() {
    let r = 0.1;
    let mut positions = vec![Vec3::new(5.0, 0.0, 0.0)];
    for i in 0..125 {
        positions.push(2.0 * r * Vec3::new((i % 5) as f32, (i / 5 % 5) as f32, (i / 25) as f32));
    }
    let particles = Particles { positions: positions.clone(), ..Particles::default() };
    let drawn = classify(&particles, r, &Preset::Imai2014.settings().classify);
    assert_eq!((drawn.aggregates.len(), drawn.splashes.len()), (126, 0));
    for splat in &drawn.aggregates {
        let at = positions[splat.particle as usize];
        assert!((Vec3::from_array(splat.centre) - at).length() < 1e-6, "{splat:?} is not at {at}");
        assert!(splat.diagonal.iter().all(|a| (a - r).abs() < 1e-5), "{splat:?}");
        assert!(splat.off_diagonal.iter().all(|a| a.abs() < 1e-5), "{splat:?}");
    }
    // The later paper classifies the isolated particle as a splash.
    let drawn = classify(&particles, r, &Preset::Imai2016.settings().classify);
    assert_eq!((drawn.aggregates.len(), drawn.splashes.len()), (125, 1));
}

/// Each key of a scene overrides its preset; the other keys of the table are the preset's.
#[test]
fn a_scene_overrides_its_preset() {
    let text = r#"
        [settings]
        preset = "imai2016"
        [settings.classify]
        support = 3
        [settings.refract]
        solver = "march"
        interfaces = 4
        internal_bounces = 4
        [settings.tonemap]
        curve = "aces"
    "#;
    let mut expected = Preset::Imai2016.settings();
    expected.classify.support = 3.0;
    expected.refract.solver = Solver::March;
    // A key that is set to the default overrides the preset too.
    expected.refract.internal_bounces = Settings::default().refract.internal_bounces;
    expected.tonemap.curve = Curve::Aces;
    assert_eq!(settings(text, &[]), expected);
    // The order of the keys does not matter.
    let inline = "settings = { refract = { samples = 4 }, preset = \"imai2014\" }";
    let mut expected = Preset::Imai2014.settings();
    expected.refract.samples = 4;
    assert_eq!(settings(inline, &[]), expected);
}

/// A preset on the command line replaces the scene's settings except caustics and tone mapping, which
/// belong to the picture. Overrides of single settings are applied afterwards.
#[test]
fn the_command_line_overrides_the_scene() {
    let text = r#"
        [settings]
        preset = "imai2016"
        [settings.refract]
        solver = "march"
        [settings.caustics]
        resolution = 64
        [settings.tonemap]
        exposure = -1.5
    "#;
    let mut expected = Preset::Mayer2026.settings();
    expected.tonemap.exposure = -1.5;
    expected.caustics.resolution = 64;
    assert_eq!(settings(text, &["preset=mayer2026"]), expected);
    assert_eq!(settings(text, &[" preset = \"mayer2026\" "]), expected);
    expected.refract.iterations = 3;
    assert_eq!(settings(text, &["preset=mayer2026", "refract.iterations=3"]), expected);
    // In order: later overrides replace earlier ones.
    expected.refract.iterations = 5;
    assert_eq!(settings(text, &["refract.iterations=3", "preset=mayer2026"]), expected);

    // The program applies --preset before --set, in whichever order they are given.
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_limpid"));
        let output = command.current_dir(folder.path()).arg("render").args(args).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let wrong = ["--set", "refract.samples=0", "--preset", "imai2016"];
    let (code, message) = run(&wrong);
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("refract.samples is 0"), "{message}");
    let (code, message) = run(&["--preset", "imai2015"]);
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("--preset") && message.contains("did you mean `imai201"), "{message}");
}

/// An unknown preset is reported with the line of the file and the nearest known name.
#[test]
fn an_unknown_preset_is_reported_with_the_nearest() {
    for (wrong, right) in
        [("mayer2025", "mayer2026"), ("Limpid", "limpid"), ("imai-2016", "imai2016")]
    {
        let scene = format!("[liquid]\nior = 1.3\n[settings]\npreset = \"{wrong}\"");
        let errors = [
            (overrides::preset(wrong).unwrap_err(), ""),
            (parse(&scene, &[]).unwrap_err(), "test.toml: line 4: "),
            (parse("", &[&format!("preset={wrong}")]).unwrap_err(), "preset="),
        ];
        for (error, start) in errors {
            let message = error.to_string();
            assert_eq!(error.category() as u8, 2, "{message}");
            assert!(message.starts_with(start) && !message.contains('\n'), "{message}");
            assert!(message.contains(&format!("`{wrong}`")), "{message}");
            assert!(message.contains(&format!("did you mean `{right}`")), "{message}");
        }
    }
    // A preset is not a key of a single pass, and errors in other keys keep their line.
    let inside = parse("[settings.smooth]\npreset = \"limpid\"", &[]).unwrap_err().to_string();
    assert!(inside.contains("line 2") && inside.contains("`preset`"), "{inside}");
    let beside = "[settings]\npreset = \"imai2016\"\n[settings.smooth]\ntips = 3";
    let beside = parse(beside, &[]).unwrap_err().to_string();
    assert!(beside.contains("line 4") && beside.contains("did you mean `taps`"), "{beside}");
}

/// Every preset draws finite pictures, which differ from those of the others.
#[test]
fn every_preset_draws() {
    let Some(mut harness) = harness() else { return };
    let mut seed = 5;
    let body: Vec<_> = (0..60)
        .map(|_| {
            let centre = noise_vector(&mut seed) * Vec3::new(0.6, 0.4, 0.4);
            let axes = 0.14 + 0.05 * noise_vector(&mut seed);
            ellipsoid(centre, axes, noise_turn(&mut seed))
        })
        .collect();
    let drawn = splats(&body, &[sphere(Vec3::new(0.3, 0.3, 0.8), 0.1)], 0.08);
    let mut scene = Scene::around(-DVec3::ONE, DVec3::ONE, 0.08);
    let pictures = Preset::ALL.map(|preset| {
        scene.settings = preset.settings();
        let picture = harness.render(&scene, &on_axis(3.0, 40.0), &drawn, UVec2::new(96, 72));
        picture.assert_finite();
        picture
    });
    for (i, a) in pictures.iter().enumerate() {
        for b in &pictures[..i] {
            assert!(mean_difference(a, b) > 1e-4);
        }
    }
}
