//! The most memory that this process has held, where the system tells.

use std::fs;

/// Forgets the peak so far (Linux).
pub(crate) fn reset_peak() {
    // Without it the peak is that of the whole process, which only grows.
    let _ = fs::write("/proc/self/clear_refs", "5");
}

/// The peak since then, bytes.
pub(crate) fn peak() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib << 10)
}
