//! What `limpid render --max-error` and `--budget` pick: `src/quality.toml` and the choice from it.
#![cfg(feature = "report")]

#[path = "support/frames.rs"]
mod frames;

use frames::{gpu, on_axis, scene, sphere, splats};
use glam::{UVec2, Vec3};
use limpid::Error;
use limpid::quality::{Choice, Curve, Limits};
use limpid::renderer::Renderer;
use limpid::report::curve::hit_errors;
use limpid::settings::Settings;

fn numbers(curve: &Curve) -> impl Iterator<Item = &Choice> {
    curve.intersectors.iter().chain(&curve.pictures)
}

/// Limits below, between and above all of some numbers.
fn limits(numbers: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut limits: Vec<f64> = numbers.flat_map(|n| [0.999 * n, n, 1.001 * n]).collect();
    limits.sort_by(f64::total_cmp);
    limits
}

/// Protects the file that is shipped: it can be read, its settings are settings, its first are the
/// defaults, which cost 1, and its numbers are numbers.
#[test]
fn the_shipped_curve_is_whole() {
    let curve = Curve::shipped();
    assert!(curve.intersectors.len() > 10 && curve.pictures.len() > 5);
    assert!(!curve.adapter.is_empty() && !curve.scenes.is_empty());
    for Choice { set, error_px, flip, cost } in numbers(curve) {
        Settings::default().with(set).expect("settings").check().expect("settings in their range");
        assert!((0.0..=10.0).contains(error_px), "{set:?}: {error_px}");
        assert!((0.0..=1.0).contains(flip) && cost.is_finite() && *cost > 0.0, "{set:?}");
    }
    let first = &curve.intersectors[0];
    assert_eq!(Settings::default().with(&first.set).expect("settings"), Settings::default());
    assert_eq!(first.cost, 1.0);
}

/// Protects `--max-error`: what is picked satisfies it, nothing cheaper does, and a looser error never
/// picks what is dearer.
#[test]
fn the_cheapest_within_an_error() {
    let curve = Curve::shipped();
    let mut last = f64::INFINITY;
    let mut picked = 0;
    for limit in limits(curve.intersectors.iter().map(|choice| choice.error_px)) {
        let Ok(choice) = curve.cheapest(limit) else {
            assert_eq!(picked, 0, "{limit}: a looser error finds nothing");
            continue;
        };
        picked += 1;
        assert!(choice.error_px <= limit);
        let cheaper = |other: &&Choice| other.error_px <= limit && other.cost < choice.cost;
        assert_eq!(curve.intersectors.iter().find(cheaper), None);
        assert!(choice.cost <= last, "{limit}: {} after {last}", choice.cost);
        last = choice.cost;
    }
    assert!(picked > 10);
}

/// Protects `--budget`, alone and with an error: what is picked satisfies both, nothing that does has
/// a better picture, and a larger budget never picks a worse one.
#[test]
fn the_best_within_a_budget() {
    let curve = Curve::shipped();
    let unit = 40.0;
    let errors = limits(curve.pictures.iter().map(|choice| choice.error_px));
    for max_error in errors.into_iter().map(Some).chain([None]) {
        let most = max_error.unwrap_or(f64::INFINITY);
        let fits = |choice: &&Choice, ms: f64| choice.error_px <= most && choice.cost * unit <= ms;
        let mut last = f64::INFINITY;
        for ms in limits(curve.pictures.iter().map(|choice| choice.cost * unit)) {
            let Ok(choice) = curve.best(max_error, ms, unit) else {
                assert_eq!(curve.pictures.iter().find(|other| fits(other, ms)), None);
                continue;
            };
            assert!(fits(&choice, ms));
            let better = |other: &&Choice| fits(other, ms) && other.flip < choice.flip;
            assert_eq!(curve.pictures.iter().find(better), None);
            assert!(choice.flip <= last);
            last = choice.flip;
        }
    }
}

/// Protects whoever asks for too much: an error of usage that names the best that can be had.
#[test]
fn impossible_limits_name_the_best() {
    let curve = Curve::shipped();
    let best = numbers(curve).map(|choice| choice.error_px).fold(f64::INFINITY, f64::min);
    let told = |error: Error| match error {
        Error::Usage(text) => text,
        other => panic!("{other}"),
    };
    let text = told(curve.cheapest(0.5 * best).expect_err("too exact"));
    let least = curve.intersectors.iter().map(|c| c.error_px).fold(f64::INFINITY, f64::min);
    assert!(text.contains("--max-error") && text.contains(&format!("{least} (")), "{text}");
    let text = told(curve.best(None, 1e-9, 100.0).expect_err("too fast"));
    let least = curve.pictures.iter().map(|c| c.cost).fold(f64::INFINITY, f64::min);
    assert!(
        text.contains("--budget") && text.contains(&format!("{:.2} ms", 100.0 * least)),
        "{text}"
    );
    let text = told(curve.best(Some(0.5 * best), 1e9, 1.0).expect_err("too exact"));
    assert!(text.contains("--max-error") && text.contains("refract.solver="), "{text}");
}

/// Protects the pick on a device: a budget that is ample gives the best picture and says what it takes, one
/// that is none is refused, and without limits nothing is touched.
#[test]
fn picks_are_measured() {
    let Some(gpu) = gpu() else { return };
    let curve = Curve::shipped();
    let camera = on_axis(4.0, 40.0);
    let splats = splats(&[sphere(Vec3::ZERO, 0.5)], &[], 0.1);
    let pick = |limits: Limits| {
        let mut scene = scene();
        let frame = |_: &_| Ok((camera, splats.clone()));
        let size = UVec2::new(160, 120);
        let picked = curve.pick(limits, || Ok(gpu.clone()), &mut scene, frame, size);
        (picked, scene.settings)
    };
    let (picked, settings) = pick(Limits { max_error: None, budget: Some(1e6) });
    let picked = picked.expect("affordable").expect("a budget");
    assert!(picked.ms.is_some_and(|ms| (0.0..1e6).contains(&ms)));
    let flips = curve.pictures.iter().map(|choice| choice.flip);
    assert_eq!(picked.choice.flip, flips.fold(f64::INFINITY, f64::min));
    assert_eq!(settings, scene().settings.with(&picked.choice.set).expect("settings"));
    let (refused, settings) = pick(Limits { max_error: None, budget: Some(1e-9) });
    assert!(matches!(refused, Err(Error::Usage(_))), "{refused:?}");
    assert_eq!(settings, scene().settings);
    let (picked, settings) = pick(Limits::default());
    assert!(picked.expect("no limit").is_none() && settings == scene().settings);
}

/// Protects the curve from rot: two of its errors, measured again, are what the file says, to 15 % and
/// 0.02 pixels. The checker is shown a failing case: they are not each other's.
#[test]
fn errors_are_what_is_measured() {
    let Some(gpu) = gpu() else { return };
    let curve = Curve::shipped();
    let of = |solver: &str| {
        let named = |choice: &&Choice| choice.set[0] == format!("refract.solver={solver}");
        curve.intersectors.iter().find(named).expect("a row").clone()
    };
    let rows = [of("guarded"), of("plane")];
    let sets = rows.each_ref().map(|row| row.set.clone());
    let mut renderer = Renderer::new(&gpu);
    let measured = hit_errors(&gpu, &mut renderer, &sets).expect("measured");
    let close = |got: f64, row: &Choice| (got - row.error_px).abs() <= 0.15 * row.error_px + 0.02;
    for (row, &got) in rows.iter().zip(&measured) {
        println!("{:?}: {got}, {} in the file", row.set, row.error_px);
        assert!(
            close(got, row),
            "{:?}: {got}, not {}: limpid report --curve",
            row.set,
            row.error_px
        );
    }
    assert!(!close(measured[0], &rows[1]));
}
