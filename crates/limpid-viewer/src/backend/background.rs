//! Work that must not hold up the interface.

/// Runs `work` on a thread of its own.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn spawn(work: impl FnOnce() + Send + 'static) {
    std::thread::spawn(work);
}

/// Runs `work` at once: in a browser, what is long is the worker's.
#[cfg(target_arch = "wasm32")]
pub(crate) fn spawn(work: impl FnOnce()) {
    work();
}

/// Drops a possibly large value on a thread, because that can take too long for the interface.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn drop_in_background(what: impl Send + 'static) {
    spawn(move || drop(what));
}

/// Drops a value, which in a browser is a small one: the worker has the large ones.
#[cfg(target_arch = "wasm32")]
pub(crate) fn drop_in_background(what: impl Sized) {
    drop(what);
}
