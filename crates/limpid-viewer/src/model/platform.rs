//! Where the viewer runs.

/// Whether it runs in a web page, which has no files, no threads and no other programs.
pub(crate) const IN_BROWSER: bool = cfg!(target_arch = "wasm32");
