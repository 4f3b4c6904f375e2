//! The choice by `limpid render --max-error` and `--budget`, and its data, `crates/limpid-lab/src/quality.toml`.

#[path = "../../../tests/support/frames.rs"]
mod frames;

use frames::{gpu, on_axis, scene, sphere, splats};
use glam::{UVec2, Vec3};
use limpid::renderer::Renderer;
use limpid::settings::Settings;
use limpid_io::Error;
use limpid_io::project::overrides::replaced;
use limpid_lab::quality::{Choice, Curve, Limits, NOISE, Picked};
use limpid_lab::report::curve::hit_errors;

fn numbers(curve: &Curve) -> impl Iterator<Item = &Choice> {
    curve.intersectors.iter().chain(&curve.pictures)
}

/// Limits just below, at and above each of some numbers.
fn limits(numbers: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut limits: Vec<f64> = numbers.flat_map(|n| [0.999 * n, n, 1.001 * n]).collect();
    limits.sort_by(f64::total_cmp);
    limits
}

/// The shipped curve can be read, its settings are valid, the defaults come first and have cost 1,
/// and its figures are within their ranges.
#[test]
fn shipped_curve_is_valid() {
    let curve = Curve::shipped();
    assert!(curve.intersectors.len() > 10 && curve.pictures.len() > 5);
    assert!(!curve.adapter.is_empty() && !curve.scenes.is_empty());
    for Choice { set, error_px, flip, cost } in numbers(curve) {
        replaced(&Settings::default(), set)
            .expect("settings")
            .check()
            .expect("settings in their range");
        assert!((0.0..=10.0).contains(error_px), "{set:?}: {error_px}");
        assert!((0.0..=1.0).contains(flip) && cost.is_finite() && *cost > 0.0, "{set:?}");
    }
    let first = &curve.intersectors[0];
    assert_eq!(replaced(&Settings::default(), &first.set).expect("settings"), Settings::default());
    assert_eq!(first.cost, 1.0);
    // The defaults are among the pictures too.
    let picture = &curve.pictures[0];
    assert_eq!(
        replaced(&Settings::default(), &picture.set).expect("settings"),
        Settings::default()
    );
    let known = |choice: &Choice| (choice.error_px, choice.flip, choice.cost);
    assert_eq!(known(picture), known(first));
}

/// Synthetic frame times, ms: a constant plus a cost per pixel, higher where more texels are read.
/// Marching is as fast as any other at a small size and the slowest at a large one.
fn known_ms(set: &[String], pixels: f64) -> f64 {
    let per_pixel = |text: &String| match text.as_str() {
        "refract.solver=march" => 4e-5,
        "refract.stride=1" => 4e-4,
        "refract.solver=guarded" => 5e-5,
        "refract.reach=0.01" => 2e-5,
        "refract.samples=4" => 3e-4,
        "smooth.iterations=5" => 1e-4,
        _ => 1e-6,
    };
    250.0 + pixels * set.iter().map(per_pixel).sum::<f64>()
}

const SIZES: [f64; 3] = [256.0 * 192.0, 1280.0 * 720.0, 3840.0 * 2160.0];

/// Picks by synthetic frame times at a number of pixels.
fn pick(limits: Limits, pixels: f64) -> limpid_io::Result<Picked> {
    let curve = Curve::shipped();
    let candidates = curve.candidates(limits)?;
    let ms: Vec<_> = candidates.iter().map(|choice| known_ms(&choice.set, pixels)).collect();
    curve.decide(limits, &candidates, &ms)
}

/// `max_error`: the picked settings satisfy it, no other that does is faster by more than noise,
/// none as fast is more exact, and a looser error never picks slower settings.
#[test]
fn max_error_picks_the_fastest() {
    let curve = Curve::shipped();
    for pixels in SIZES {
        let mut last = f64::INFINITY;
        let mut picked = 0;
        for limit in limits(curve.intersectors.iter().map(|choice| choice.error_px)) {
            let Ok(found) = pick(Limits { max_error: Some(limit), budget: None }, pixels) else {
                assert_eq!(picked, 0, "{limit}: a looser error finds nothing");
                continue;
            };
            picked += 1;
            assert!(found.choice.error_px <= limit);
            let right = curve.intersectors.iter().filter(|other| other.error_px <= limit);
            for other in right {
                let ms = known_ms(&other.set, pixels);
                assert!(found.ms <= (1.0 + NOISE) * ms, "{limit}: {:?}", other.set);
                let better = ms <= found.ms && other.error_px < found.choice.error_px;
                assert!(!better, "{limit}: {:?} rather than {:?}", other.set, found.choice.set);
            }
            assert!(found.ms <= last, "{limit}: {} after {last}", found.ms);
            last = found.ms;
        }
        assert!(picked > 10);
    }
}

/// Choices depend on the size: at a small size, where all take equally long, the most exact is
/// picked; at a size where that one is slow, another that satisfies the error is.
#[test]
fn choices_depend_on_the_size() {
    let [small, _, large] = SIZES;
    let at = |pixels| pick(Limits { max_error: Some(1.0), budget: None }, pixels).unwrap().choice;
    assert!(at(small).set.contains(&"refract.stride=1".to_owned()), "{:?}", at(small));
    assert_eq!(at(large), Curve::shipped().intersectors[0], "the defaults keep it too");
    // By the times at the small size marching would be picked for both.
    let of = |choice: &Choice| known_ms(&choice.set, large);
    assert!(of(&at(small)) > 4.0 * of(&at(large)));
}

/// Of intersectors whose times differ only by noise the most exact is picked, whichever was
/// measured to be the fastest.
#[test]
fn ties_are_resolved_by_error() {
    let curve = Curve::shipped();
    let limits = Limits { max_error: Some(100.0), budget: None };
    let candidates = curve.candidates(limits).unwrap();
    let exact = candidates.iter().map(|choice| choice.error_px).fold(f64::INFINITY, f64::min);
    for fastest in 0..candidates.len() {
        let mut ms = vec![20.0 * (1.0 + 0.9 * NOISE); candidates.len()];
        ms[fastest] = 20.0;
        let picked = curve.decide(limits, &candidates, &ms).unwrap();
        assert_eq!(picked.choice.error_px, exact, "{:?}", candidates[fastest].set);
        // Beyond noise the faster one is picked.
        ms[fastest] = 20.0 / (1.0 + NOISE);
        let picked = curve.decide(limits, &candidates, &ms).unwrap();
        assert_eq!(&picked.choice, candidates[fastest]);
    }
}

/// `budget`, alone and with an error: the picked settings satisfy both; a larger budget never
/// picks a worse picture; and if the defaults fit, nothing worse than they are is picked.
#[test]
fn budget_picks_the_best() {
    let curve = Curve::shipped();
    let default = &curve.intersectors[0];
    for pixels in SIZES {
        let errors = limits(curve.pictures.iter().map(|choice| choice.error_px));
        for max_error in errors.into_iter().map(Some).chain([None]) {
            let most = max_error.unwrap_or(f64::INFINITY);
            let mut last = (true, f64::INFINITY);
            let times = curve.pictures.iter().map(|choice| known_ms(&choice.set, pixels));
            for budget in limits(times) {
                let fits = |choice: &&Choice| {
                    choice.error_px <= most && known_ms(&choice.set, pixels) <= budget
                };
                let found = pick(Limits { max_error, budget: Some(budget) }, pixels);
                let Ok(Picked { choice, ms }) = found else {
                    assert_eq!(curve.pictures.iter().find(fits), None);
                    continue;
                };
                assert!(fits(&&choice) && ms <= budget);
                let quality = (choice.error_px > default.error_px, choice.flip);
                assert!(quality <= last, "{budget}: {quality:?} after {last:?}");
                last = quality;
                let defaults_fit =
                    curve.pictures.iter().filter(fits).any(|c| c == &curve.pictures[0]);
                if defaults_fit {
                    assert!(choice.error_px <= default.error_px, "{budget}: {choice:?}");
                    assert!(choice.flip <= default.flip, "{budget}: {choice:?}");
                }
            }
        }
    }
}

/// Limits that cannot be satisfied are usage errors that name the best possible choice.
#[test]
fn impossible_limits_name_the_best() {
    let curve = Curve::shipped();
    let best = numbers(curve).map(|choice| choice.error_px).fold(f64::INFINITY, f64::min);
    let refusal = |max_error: Option<f64>, budget: Option<f64>| match pick(
        Limits { max_error, budget },
        SIZES[0],
    ) {
        Err(Error::Usage(text)) => text,
        other => panic!("{other:?}"),
    };
    let text = refusal(Some(0.5 * best), None);
    let least = curve.intersectors.iter().map(|c| c.error_px).fold(f64::INFINITY, f64::min);
    assert!(text.contains("max_error") && text.contains(&format!("{least} (")), "{text}");
    let text = refusal(None, Some(1e-9));
    let times = curve.pictures.iter().map(|c| known_ms(&c.set, SIZES[0]));
    let least = times.fold(f64::INFINITY, f64::min);
    assert!(text.contains("budget") && text.contains(&format!("{least:.2} ms")), "{text}");
    let text = refusal(Some(0.5 * best), Some(1e9));
    assert!(text.contains("max_error") && text.contains("refract.solver="), "{text}");
}

/// Picking on a device: an ample budget gives the best picture and its frame time, an impossible
/// one is rejected, and without limits nothing changes.
#[test]
fn picks_are_measured_on_the_device() {
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
    assert!((0.0..1e6).contains(&picked.ms));
    let flips = curve.pictures.iter().map(|choice| choice.flip);
    assert_eq!(picked.choice.flip, flips.fold(f64::INFINITY, f64::min));
    assert_eq!(settings, replaced(&scene().settings, &picked.choice.set).expect("settings"));
    // An error limit is satisfied by measured settings as well.
    let (picked, settings) = pick(Limits { max_error: Some(1.0), budget: None });
    let picked = picked.expect("some are so exact").expect("a limit");
    assert!(picked.choice.error_px <= 1.0 && picked.ms > 0.0, "{picked:?}");
    assert_eq!(settings, replaced(&scene().settings, &picked.choice.set).expect("settings"));
    let (refused, settings) = pick(Limits { max_error: None, budget: Some(1e-9) });
    assert!(matches!(refused, Err(Error::Usage(_))), "{refused:?}");
    assert_eq!(settings, scene().settings);
    let (picked, settings) = pick(Limits::default());
    assert!(picked.expect("no limit").is_none() && settings == scene().settings);
}

/// The shipped curve is up to date: two of its errors, measured again, match the file to 15 % and
/// 0.02 pixels. As a check of the comparison, they do not match each other.
#[test]
fn shipped_errors_match_measurements() {
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
