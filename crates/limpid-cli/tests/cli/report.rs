//! `limpid report --against`: comparison with the errors of an earlier report.

use std::fs;

use super::{adapter, assert_contains, folder, run};

/// Errors are reproducible, although times are not; an increased error is reported by name with exit
/// code 1; a file that is not a report is refused before anything is measured.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn increased_errors_are_reported() {
    if !adapter() {
        return;
    }
    let folder = folder();
    let measure = ["report", "--quick", "--scenes=drop", "--kinds=smooth", "--width=32"];
    let run = |args: &[&str]| run(folder.path(), args);
    assert_eq!(run(&[&measure[..], &["--out=before"]].concat()).code, 0);
    let against = [&measure[..], &["--out=after", "--against=before/report.json"]].concat();
    let same = run(&against);
    assert_eq!(same.code, 0, "{}", same.stderr);
    assert_contains(&same.stdout, &[" 0 in one alone", " 0 better, 0 worse"]);

    let path = folder.path().join("before/report.json");
    let mut earlier: serde_json::Value =
        serde_json::from_slice(&fs::read(&path).unwrap()).expect("JSON");
    let rows = earlier["rows"].as_array_mut().expect("rows");
    let row = rows.iter_mut().find(|row| row["method"] == "bilateral").expect("the filter");
    row["error"] = (0.5 * row["error"].as_f64().expect("an error")).into();
    fs::write(&path, earlier.to_string()).unwrap();
    let worse = run(&against);
    assert_eq!(worse.code, 1, "{}", worse.stderr);
    assert_contains(&worse.stdout, &["1 worse, 1 of them by more", "drop bilateral", "+100.00 %"]);

    fs::write(&path, "[]").unwrap();
    let refused = run(&against);
    assert_eq!(refused.code, 3, "{}", refused.stderr);
    assert_contains(&refused.stderr, &["before/report.json", "not the JSON of a report"]);
}
