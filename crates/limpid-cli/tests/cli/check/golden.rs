//! limpid's own golden frames: they are drawn as expected, are complete and small, and detect faults.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use limpid_lab::check::{Suite, Verdict};

use crate::support::gpu;

/// Path of limpid's own suite.
fn golden() -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("tests/golden/limpid.toml")
}

/// The scenes of `sims/` are drawn as expected. Failures are in `target/golden/index.html`.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn golden_frames() {
    let Some(gpu) = gpu() else { return };
    let suite = Suite::load(&golden()).expect("the suite");
    let report = suite.run(gpu, &[], |outcome| eprintln!("{outcome}")).expect("it runs");
    eprintln!("{:.1} s", report.seconds);
    let results = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("target/golden");
    report.write(&results).expect("results are written");
    assert_eq!(report.exit_code(), 0, "see {}", results.join("index.html").display());
}

/// Every scene of `sims/` has a golden frame, and all pictures together have less than 2 MB.
#[test]
fn golden_frames_are_complete_and_small() {
    let suite = Suite::load(&golden()).expect("the suite");
    let drawn: BTreeSet<_> = suite.entries.iter().map(|e| file_name(&e.input)).collect();
    let sims = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("sims");
    let names = fs::read_dir(sims).unwrap().map(|file| file.unwrap().file_name());
    let scenes: BTreeSet<_> = names
        .map(|name| name.to_string_lossy().into_owned())
        .filter(|name| name.ends_with(".toml"))
        .collect();
    let missing: Vec<_> = scenes.difference(&drawn).collect();
    assert!(missing.is_empty(), "{missing:?} have no golden frame");
    assert!(size(&golden().with_extension("")) < 2_000_000);
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Total size of the files below a folder, bytes.
fn size(folder: &Path) -> u64 {
    let files = fs::read_dir(folder).unwrap().map(|file| file.unwrap());
    files
        .map(|file| {
            let metadata = file.metadata().unwrap();
            if metadata.is_dir() { size(&file.path()) } else { metadata.len() }
        })
        .sum()
}

mod rare {
    use super::*;

    /// The golden frames detect small faults (a slightly wrong index of refraction, a missing bounce, no
    /// smoothing), both with the tolerance for the adapter of the frames and with the wider one
    /// for all others.
    #[test]
    #[ignore = "rare: scripts/nightly.sh runs it"]
    fn golden_frames_detect_faults() {
        let Some(gpu) = gpu() else { return };
        let text = fs::read_to_string(golden()).unwrap();
        let wide = text.replace("name = \"llvmpipe\"", "name = \"no such adapter\"");
        assert_ne!(text, wide);
        for fault in ["liquid.ior=1.31", "refract.internal_bounces=0", "smooth.iterations=0"] {
            for text in [&text, &wide] {
                let text = format!("set = [\"{fault}\"]\n{text}");
                let suite = Suite::parse(&text, &golden()).expect("a suite");
                let report =
                    suite.run(gpu, &["drop".into(), "slab".into()], |_| ()).expect("it runs");
                let failed: Vec<_> =
                    report.outcomes.iter().map(|o| (&o.name, o.verdict())).collect();
                assert!(report.count(Verdict::Failed) > 0, "{fault}: {failed:?}");
            }
        }
    }
}
