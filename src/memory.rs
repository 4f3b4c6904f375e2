//! Memory that may not be there. What grows with particles or pixels is asked for before it is used,
//! so that a frame fails with an error, and may be tried again, where the process would be aborted.

use std::fmt::Display;

use bytemuck::Zeroable;

use crate::error::{Error, Result};

/// What is left for everything that does not grow with particles or pixels: stacks, messages, the
/// allocator's own pages.
const REST: usize = 8 << 20;

/// Fails if `bytes` more cannot be allocated at once. None are kept: this is for what libraries
/// allocate themselves (sorts, trees, parallel collections), which would end the process.
///
/// # Errors
/// [`Error::Memory`].
pub fn probe(bytes: usize, what: impl Display) -> Result<()> {
    reserve::<u8>(bytes.saturating_add(REST), what).map(drop)
}

/// An empty vector with room for `count`.
///
/// # Errors
/// [`Error::Memory`].
pub fn reserve<T>(count: usize, what: impl Display) -> Result<Vec<T>> {
    let mut values = Vec::new();
    match values.try_reserve_exact(count) {
        Ok(()) => Ok(values),
        Err(_) => Err(missing::<T>(count, what)),
    }
}

/// Makes room for `more`, and for as many as there are if that does not suffice, as `push` does.
///
/// # Errors
/// [`Error::Memory`].
pub fn grow<T>(values: &mut Vec<T>, more: usize, what: impl Display) -> Result<()> {
    let length = values.len();
    values.try_reserve(more).map_err(|_| missing::<T>(length.saturating_add(more), what))
}

/// `count` zeros.
///
/// # Errors
/// [`Error::Memory`].
pub fn zeroed<T: Zeroable>(count: usize, what: impl Display) -> Result<Vec<T>> {
    bytemuck::allocation::try_zeroed_vec(count).map_err(|()| missing::<T>(count, what))
}

/// All of an iterator that tells its length.
///
/// # Errors
/// [`Error::Memory`].
pub fn collect<T>(values: impl ExactSizeIterator<Item = T>, what: impl Display) -> Result<Vec<T>> {
    let mut all = reserve(values.len(), what)?;
    all.extend(values);
    Ok(all)
}

fn missing<T>(count: usize, what: impl Display) -> Error {
    let bytes = (count as u64).saturating_mul(size_of::<T>() as u64);
    Error::Memory { mib: bytes.div_ceil(1 << 20), what: what.to_string() }
}
