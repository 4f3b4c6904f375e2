//! A synthetic report with all kinds of rows, for tests.

use image::{Rgb, RgbImage};

use super::elisions::Elision;
use super::passes::Budget;
use super::rates::Rates;
use super::{ErrorKind, Figure, Orders, Report, Row, RowKind, Stress};

/// An empty report.
pub(super) fn empty() -> Report {
    Report {
        adapter: "made <up>".into(),
        quick: false,
        rows: Vec::new(),
        rates: None,
        budgets: Vec::new(),
        elisions: Vec::new(),
        orders: Vec::new(),
        stress: Vec::new(),
        figures: Vec::new(),
    }
}

fn intersect(scene: &str, method: &str, settings: &str, ms: f64, missed: f64, wrong: f64) -> Row {
    Row {
        fetches: Some(4.0 * ms),
        iterations: Some(ms),
        solved_of_solvable: Some(1.0 - missed),
        solved_of_all: Some(0.7 * (1.0 - missed)),
        wrong_accepts: Some(wrong),
        rms_px: Some(0.1),
        ..Row::new(RowKind::Intersect, scene, method, settings)
    }
    .timed(&[0.9 * ms, ms, 1.1 * ms])
    .with_error(
        0.7 * missed + 0.3 * wrong,
        ErrorKind::RaysWrong,
        "the same layers, intersected exactly",
    )
}

/// A report with all kinds of rows.
pub(super) fn sample() -> Report {
    let mut rows = Vec::new();
    for scene in ["pool", "pool:2"] {
        for i in 0..8 {
            let missed = 0.8 * 0.13f64.powi(i) + 2e-3;
            let (settings, ms) = (format!("iterations={i}"), 0.12 + 0.09 * f64::from(i));
            rows.push(intersect(scene, "newton", &settings, ms, missed, 0.003 * f64::from(i)));
        }
        rows.push(intersect(scene, "guarded", "", 0.58, 2e-4, 1e-4));
        rows.push(intersect(scene, "secant", "", 0.61, 0.013, 0.006));
        rows.push(intersect(scene, "march", "", 9.1, 0.0, 0.0));
        rows.push(intersect(scene, "march", "step=2", 4.6, 3e-4, 2e-4));
        rows.push(intersect(scene, "one-layer", "", 1.3, 0.08, 0.07));
        rows.push(intersect(scene, "plane", "", 0.05, 0.55, 0.3));
        rows.push(intersect(scene, "plane3", "", 0.09, 0.42, 0.2));
    }
    for (i, method) in ["none", "bilateral", "narrow-range", "plane-fit"].into_iter().enumerate() {
        let (ms, error) = (0.1 + 2.0 * i as f64, 9.0 / (1.0 + i as f64));
        for (kind, times) in [
            (ErrorKind::NormalMedianDegrees, 1.0),
            (ErrorKind::NormalP90Degrees, 3.0),
            (ErrorKind::DepthRmsAllRadii, 0.05),
            (ErrorKind::DepthRmsNineTenthsRadii, 0.02),
        ] {
            let row = Row::new(RowKind::Smooth, "ball", method, "").timed(&[ms]);
            rows.push(row.with_error(times * error, kind, "analytic"));
        }
    }
    let row = Row::new(RowKind::Caustics, "cove", "nearest", "").timed(&[0.4]);
    rows.push(row.with_error(0.12, ErrorKind::RelativeL1, "photons"));
    for (method, ms, error) in [
        ("limpid", 14.0, 0.067),
        ("march", 31.0, 0.0668),
        ("newton", 12.5, 0.074),
        ("<i>", 2.0, 0.15),
    ] {
        let row = Row::new(RowKind::Picture, "front", method, "samples=4").timed(&[ms, 1.1 * ms]);
        rows.push(row.with_error(error, ErrorKind::MeanFlip, "path traced"));
    }
    for (pass, ms) in [("splat", 1.2), ("smooth", 3.1), ("refract", 4.4), ("tonemap", 0.05)] {
        rows.push(Row::new(RowKind::Pass, "front", pass, "samples=4").timed(&[ms, 1.02 * ms]));
    }
    let gradient = |blue: u8| {
        RgbImage::from_fn(160, 120, move |x, y| Rgb([(x * 255 / 159) as u8, (2 * y) as u8, blue]))
    };
    let panels = [("truth", 80), ("limpid", 90), ("difference", 0)];
    Report {
        adapter: "made <up>".into(),
        quick: true,
        rows,
        rates: Some(Rates { bytes_per_s: 9e9, operations_per_s: 7e10 }),
        budgets: vec![Budget {
            scene: "front".into(),
            size: [1024, 768],
            pass: "splat".into(),
            bytes: 2.5e7,
            operations: 1.2e9,
            floor_ms: Some(17.1),
            ms: Some(111.0),
        }],
        elisions: vec![Elision {
            name: "no splashes: no splash layers".into(),
            forced_by: "a splash behind the eye".into(),
            same: true,
            ms: Some(40.0),
            forced_ms: Some(50.0),
        }],
        orders: vec![Orders { scene: "front".into(), ss: 0.02, sa: 0.01, as_: 0.03, aa: 0.94 }],
        stress: vec![Stress {
            case: "ior 1 to 2.5".into(),
            pictures: 64,
            not_finite: 0,
            median_error: 0.0031,
            worst_error: 0.09,
            worst: "ior=2.5".into(),
        }],
        figures: vec![Figure {
            title: "A dam break".into(),
            scene: "front".into(),
            panels: panels.map(|(caption, blue)| (caption.into(), gradient(blue))).into(),
        }],
    }
}

/// `report.json` has the documented keys and no others.
#[test]
fn json_keys() {
    let text = serde_json::to_string_pretty(&sample()).expect("a report is JSON");
    let json: serde_json::Value = serde_json::from_str(&text).expect("what was written is JSON");
    let keys = |value: &serde_json::Value| -> Vec<String> {
        let mut keys: Vec<_> = value.as_object().expect("an object").keys().cloned().collect();
        keys.sort();
        keys
    };
    assert_eq!(
        keys(&json),
        ["adapter", "budgets", "elisions", "orders", "quick", "rates", "rows", "stress",]
    );
    let all = "error error_kind fetches iterations kind method ms ms_spread rms_px scene settings \
               solved_of_all solved_of_solvable truth wrong_accepts";
    assert_eq!(keys(&json["rows"][0]).join(" "), all);
    let rows = json["rows"].as_array().expect("a list");
    let pass = rows.iter().find(|row| row["kind"] == "pass").expect("a pass");
    assert_eq!(keys(pass).join(" "), "kind method ms ms_spread scene settings");
    assert!(!text.contains("null"));
    let budget = "bytes floor_ms ms operations pass scene size";
    assert_eq!(keys(&json["budgets"][0]).join(" "), budget);
    assert_eq!(keys(&json["elisions"][0]).join(" "), "forced_by forced_ms ms name same");
    assert_eq!(keys(&json["orders"][0]).join(" "), "aa as sa scene ss");
    let stress = "case median_error not_finite pictures worst worst_error";
    assert_eq!(keys(&json["stress"][0]).join(" "), stress);
}
