//! `compare`: the difference of two pictures as text, as JSON, as a picture and as an exit code.

use serde_json::Value;

use super::{assert_contains, open, pictures, run, succeed};

/// The difference as text, and the exit code of `--max-flip`.
#[test]
fn compare_as_text() {
    let folder = pictures();
    let text = succeed(folder.path(), &["compare", "a.png", "b.png"]);
    assert_contains(
        &text,
        &["mean FLIP", "RMSE", "PSNR", "worst pixel (20, 11)", "[255, 255, 255]"],
    );
    let text = succeed(folder.path(), &["compare", "a.png", "a.png", "--max-flip", "0"]);
    assert_contains(&text, &["mean FLIP 0.0000", "identical"]);
    succeed(folder.path(), &["compare", "a.png", "b.png", "--max-flip", "0.9"]);

    // A difference above the limit is a result, not an error: code 1, and the text on stdout.
    let outcome = run(folder.path(), &["compare", "a.png", "b.png", "--max-flip", "0.0001"]);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (1, ""));
    assert_contains(&outcome.stdout, &["mean FLIP"]);
}

/// The difference by `--json` and `--diff`.
#[test]
fn compare_as_json_and_as_a_picture() {
    let folder = pictures();
    let json = |args: &[&str]| -> Value {
        let args: Vec<_> = ["compare", "--json"].into_iter().chain(args.iter().copied()).collect();
        serde_json::from_str(&succeed(folder.path(), &args)).expect("JSON and nothing else")
    };
    let differs = json(&["a.png", "b.png", "--diff", "diff.png"]);
    let flip = differs["mean_flip"].as_f64().unwrap();
    assert!(flip > 0.0 && flip < 0.2, "{flip}");
    assert!(differs["rmse"].as_f64().unwrap() > 0.0);
    assert!(differs["psnr_db"].as_f64().unwrap() > 10.0);
    assert_eq!(differs["worst"]["x"], 20);
    assert_eq!(differs["worst"]["y"], 11);
    let same = json(&["a.png", "a.png", "--diff", "same.png"]);
    assert_eq!(same["mean_flip"], 0.0);
    assert_eq!(same["psnr_db"], Value::Null);

    let diff = open(&folder.path().join("diff.png"));
    assert_eq!(diff.dimensions(), (32, 24));
    let brightness = |x, y| diff.get_pixel(x, y).0.iter().map(|&c| u32::from(c)).sum::<u32>();
    assert!(brightness(20, 11) > 200 + brightness(2, 2), "the pixel that differs is not bright");
    let same = open(&folder.path().join("same.png"));
    assert!(
        same.pixels().all(|pixel| pixel == same.get_pixel(0, 0)),
        "the picture of no difference has several colours"
    );
}
