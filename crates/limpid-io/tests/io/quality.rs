//! The choice by `limpid render --max-error` and `--budget`, and its data, `crates/limpid-io/src/quality.toml`.

use glam::UVec2;
use limpid::settings::Settings;
use limpid_io::Error;
use limpid_io::project::overrides::replaced;
use limpid_io::quality::calibration::{dominated, measure};
use limpid_io::quality::{Choice, Curve, Limits, List, NOISE};

use crate::support::frames::gpu;

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
        "layers.intervals=2" => 2e-4,
        _ => 1e-6,
    };
    250.0 + pixels * set.iter().map(per_pixel).sum::<f64>()
}

const SIZES: [f64; 3] = [256.0 * 192.0, 1280.0 * 720.0, 3840.0 * 2160.0];

/// Synthetic costs of a list at a number of pixels.
fn costs(list: List, pixels: f64) -> Vec<f64> {
    let all = Curve::shipped().choices(list);
    let ms = |choice: &Choice| known_ms(&choice.set, pixels);
    all.iter().map(|choice| ms(choice) / ms(&all[0])).collect()
}

/// Picks by an error alone, at a number of pixels.
fn pick(max_error: f64, pixels: f64) -> limpid_io::Result<&'static Choice> {
    let (curve, limits) = (Curve::shipped(), Limits { max_error: Some(max_error), budget: None });
    let index = curve.fastest(limits, &costs(List::Intersectors, pixels))?;
    Ok(&curve.intersectors[index])
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
            let Ok(found) = pick(limit, pixels) else {
                assert_eq!(picked, 0, "{limit}: a looser error finds nothing");
                continue;
            };
            picked += 1;
            assert!(found.error_px <= limit);
            let found_ms = known_ms(&found.set, pixels);
            let right = curve.intersectors.iter().filter(|other| other.error_px <= limit);
            for other in right {
                let ms = known_ms(&other.set, pixels);
                assert!(found_ms <= (1.0 + NOISE) * ms, "{limit}: {:?}", other.set);
                let better = ms <= found_ms && other.error_px < found.error_px;
                assert!(!better, "{limit}: {:?} rather than {:?}", other.set, found.set);
            }
            assert!(found_ms <= last, "{limit}: {found_ms} after {last}");
            last = found_ms;
        }
        assert!(picked > 10);
    }
}

/// Choices depend on the size: at a small size, where all take equally long, the most exact is
/// picked; at a size where that one is slow, another that satisfies the error is.
#[test]
fn choices_depend_on_the_size() {
    let [small, _, large] = SIZES;
    let at = |pixels| pick(0.9, pixels).unwrap();
    assert!(at(small).set.contains(&"refract.stride=1".to_owned()), "{:?}", at(small));
    assert_eq!(at(large), &Curve::shipped().intersectors[0], "the defaults keep it too");
    // By the times at the small size marching would be picked for both.
    let of = |choice: &Choice| known_ms(&choice.set, large);
    assert!(of(at(small)) > 3.0 * of(at(large)));
}

/// Of intersectors whose times differ only by noise the most exact is picked, whichever was
/// measured to be the fastest.
#[test]
fn ties_are_resolved_by_error() {
    let curve = Curve::shipped();
    let limits = Limits { max_error: Some(100.0), budget: None };
    let count = curve.intersectors.len();
    let exact = curve.intersectors.iter().map(|c| c.error_px).fold(f64::INFINITY, f64::min);
    for fastest in 0..count {
        let mut costs = vec![1.0 + 0.9 * NOISE; count];
        costs[fastest] = 1.0;
        let picked = curve.fastest(limits, &costs).unwrap();
        assert_eq!(curve.intersectors[picked].error_px, exact, "{fastest}");
        // Beyond noise the faster one is picked.
        costs[fastest] = 0.99 / (1.0 + NOISE);
        assert_eq!(curve.fastest(limits, &costs).unwrap(), fastest);
    }
}

/// `budget`, alone and with an error: of all choices that satisfy both, the ladder's first has the best
/// picture; a larger budget never picks a worse one; and if the defaults fit, nothing worse than they are
/// is picked.
#[test]
fn budget_picks_the_best() {
    let curve = Curve::shipped();
    let default = &curve.intersectors[0];
    for pixels in SIZES {
        let errors = limits(curve.pictures.iter().map(|choice| choice.error_px));
        for max_error in errors.into_iter().map(Some).chain([None]) {
            let most = max_error.unwrap_or(f64::INFINITY);
            let limit = Limits { max_error, budget: Some(1.0) };
            let ladder = curve.ladder(limit, &costs(List::Pictures, pixels));
            let ladder: Vec<_> = ladder.into_iter().flatten().map(|i| &curve.pictures[i]).collect();
            let ms = |choice: &Choice| known_ms(&choice.set, pixels);
            assert!(ladder.windows(2).all(|pair| ms(pair[1]) < ms(pair[0])), "each is cheaper");
            let mut last = (true, f64::INFINITY);
            for budget in limits(curve.pictures.iter().map(ms)) {
                let fits = |choice: &&Choice| choice.error_px <= most && ms(choice) <= budget;
                let Some(choice) = ladder.iter().find(|choice| ms(choice) <= budget) else {
                    assert_eq!(curve.pictures.iter().find(fits), None);
                    continue;
                };
                assert!(choice.error_px <= most);
                let quality = |choice: &Choice| (choice.error_px > default.error_px, choice.flip);
                let found = quality(choice);
                for other in curve.pictures.iter().filter(fits) {
                    assert!(found <= quality(other), "{budget}: {other:?}, not {choice:?}");
                }
                assert!(found <= last, "{budget}: {found:?} after {last:?}");
                last = found;
                if fits(&&curve.pictures[0]) {
                    assert!(choice.error_px <= default.error_px, "{budget}: {choice:?}");
                    assert!(choice.flip <= default.flip, "{budget}: {choice:?}");
                }
            }
        }
    }
}

/// An error that cannot be satisfied is a usage error that names the best possible choice.
#[test]
fn impossible_errors_name_the_best() {
    let curve = Curve::shipped();
    let refusal = |limits| match curve.candidates(limits) {
        Err(Error::Usage(text)) => text,
        other => panic!("{other:?}"),
    };
    for (budget, list) in [(None, List::Intersectors), (Some(1e9), List::Pictures)] {
        let errors = curve.choices(list).iter().map(|choice| choice.error_px);
        let least = errors.fold(f64::INFINITY, f64::min);
        let limits = |share: f64| Limits { max_error: Some(share * least), budget };
        let text = refusal(limits(0.5));
        assert!(text.contains("max_error") && text.contains(&format!("{least} (")), "{text}");
        assert!(text.contains("refract.solver="), "{text}");
        assert!(curve.candidates(limits(1.0)).is_ok());
    }
}

/// A choice that another beats in everything is measured no further: whatever the limits, leaving it out
/// changes no pick. One that is alike, or better in something, is not left out.
#[test]
fn dominated_choices_are_never_picked() {
    let curve = Curve::shipped();
    let mut left_out = 0;
    for list in [List::Intersectors, List::Pictures] {
        let choices = curve.choices(list);
        for pixels in SIZES {
            // Further apart, so that some are.
            let costs: Vec<_> = costs(list, pixels).iter().map(|cost| cost.powi(4)).collect();
            let out: Vec<_> =
                (0..choices.len()).filter(|&i| dominated(list, choices, &costs, i)).collect();
            left_out += out.len();
            for limit in limits(choices.iter().map(|choice| choice.error_px)) {
                let budget = (list == List::Pictures).then_some(1.0);
                let limits = Limits { max_error: Some(limit), budget };
                let picked = match list {
                    List::Intersectors => curve.fastest(limits, &costs).map(|i| vec![i]),
                    List::Pictures => curve.ladder(limits, &costs),
                };
                let picked = picked.unwrap_or_default();
                assert!(!picked.iter().any(|i| out.contains(i)), "{limit}: {picked:?}, {out:?}");
            }
        }
        let alike = vec![1.0; choices.len()];
        assert!((0..choices.len()).all(|i| !dominated(list, choices, &alike, i)));
    }
    assert!(left_out > 0, "some are left out");
}

/// A calibration on the device has a cost for each choice, relative to the defaults. Settings that there are
/// not are refused.
#[test]
fn calibrations_are_measured_on_the_device() {
    let Some(gpu) = gpu() else { return };
    let curve = Curve::shipped();
    let choices = &curve.pictures[..4];
    let costs = measure(&gpu, List::Pictures, choices, UVec2::new(96, 72)).expect("measured");
    assert_eq!((costs.len(), costs[0]), (4, 1.0));
    assert!(costs.iter().all(|cost| (1e-2..1e2).contains(cost)), "{costs:?}");
    let unknown = Choice { set: vec!["refract.solver=none".into()], ..curve.pictures[0].clone() };
    assert!(measure(&gpu, List::Pictures, &[unknown], UVec2::new(8, 8)).is_err());
}
