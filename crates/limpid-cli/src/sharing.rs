//! Sharing of work with other processes, on any machine that has the folder.

use std::time::Duration;

use limpid_io::claim::Claims;

/// The name of this machine.
pub(crate) fn host() -> String {
    gethostname::gethostname().to_string_lossy().into_owned()
}

/// Claims in the name of this process.
pub(crate) fn claims(timeout: Duration) -> Claims {
    let (version, host) = (env!("CARGO_PKG_VERSION"), host());
    let owner = format!("limpid {version} on {host}, process {}\n", std::process::id());
    Claims::new(owner, timeout)
}
