//! Where the pictures are that other software made of the same particles.

use std::path::PathBuf;

/// The folder that `LIMPID_REFERENCE` names, with `scenes/NAME.toml` and `pictures/NAME.png`; they are not
/// part of what a user clones. Without it the test says that it is skipped, which
/// `LIMPID_REQUIRE_REFERENCE` forbids.
pub(crate) fn references() -> Option<PathBuf> {
    if let Some(folder) = std::env::var_os("LIMPID_REFERENCE") {
        let folder = PathBuf::from(folder);
        assert!(folder.is_dir(), "LIMPID_REFERENCE names no folder: {}", folder.display());
        return Some(folder);
    }
    let required = std::env::var_os("LIMPID_REQUIRE_REFERENCE").is_some();
    assert!(!required, "this test must not be skipped here: LIMPID_REFERENCE is not set");
    eprintln!("skipped: LIMPID_REFERENCE names no folder of reference pictures");
    None
}
