//! One of the two `unsafe` blocks of limpid, the other being `pipeline_cache.rs`; the library forbids them.

/// Mesa's device-select layer asks a Wayland or X server which GPU to prefer, and complains on
/// standard error where there is none. limpid chooses its adapter itself.
#[expect(unsafe_code, reason = "setting a variable is unsound only beside other threads")]
pub(crate) fn leave_window_systems_alone() {
    // SAFETY: the first thing that `main` does; no other thread exists yet.
    unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
}
