//! Location of reference pictures that other software rendered from the same particles.

use std::path::PathBuf;

/// The folder in `LIMPID_REFERENCE`, with `scenes/NAME.toml` and `pictures/NAME.png`, which are not part
/// of the repository. Without it the test is skipped with a message, or fails if
/// `LIMPID_REQUIRE_REFERENCE` is set.
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
