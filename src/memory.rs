//! Fallible allocation. Memory that grows with particles or pixels is reserved before use, so that a
//! frame fails with an error and can be retried instead of aborting the process.

use std::fmt::Display;

use bytemuck::Zeroable;

use crate::error::{Error, Result};

/// Bytes reserved for everything that does not grow with particles or pixels: stacks, messages, the
/// allocator's own pages.
const HEADROOM: usize = 8 << 20;

/// Fails if `bytes` more cannot be allocated in one block, which is then freed. For allocations inside
/// libraries (sorts, trees, parallel collections), whose failure would abort the process.
///
/// # Errors
/// [`Error::Memory`].
pub fn probe(bytes: usize, what: impl Display) -> Result<()> {
    reserve::<u8>(bytes.saturating_add(HEADROOM), what).map(drop)
}

/// Returns an empty vector with capacity for `count`.
///
/// # Errors
/// [`Error::Memory`].
pub fn reserve<T>(count: usize, what: impl Display) -> Result<Vec<T>> {
    let mut values = Vec::new();
    match values.try_reserve_exact(count) {
        Ok(()) => Ok(values),
        Err(_) => Err(out_of_memory::<T>(count, what)),
    }
}

/// Reserves room for `more` elements, with amortised growth as in `push`.
///
/// # Errors
/// [`Error::Memory`].
pub fn grow<T>(values: &mut Vec<T>, more: usize, what: impl Display) -> Result<()> {
    let length = values.len();
    values.try_reserve(more).map_err(|_| out_of_memory::<T>(length.saturating_add(more), what))
}

/// Returns a vector of `count` zeros.
///
/// # Errors
/// [`Error::Memory`].
pub fn zeroed<T: Zeroable>(count: usize, what: impl Display) -> Result<Vec<T>> {
    bytemuck::allocation::try_zeroed_vec(count).map_err(|()| out_of_memory::<T>(count, what))
}

/// Collects an iterator of known length.
///
/// # Errors
/// [`Error::Memory`].
pub fn collect<T>(values: impl ExactSizeIterator<Item = T>, what: impl Display) -> Result<Vec<T>> {
    let mut all = reserve(values.len(), what)?;
    all.extend(values);
    Ok(all)
}

fn out_of_memory<T>(count: usize, what: impl Display) -> Error {
    let bytes = (count as u64).saturating_mul(size_of::<T>() as u64);
    Error::Memory { mib: bytes.div_ceil(1 << 20), what: what.to_string() }
}
