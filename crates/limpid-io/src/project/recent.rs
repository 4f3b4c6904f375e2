//! The frames that were read last.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::Result;

/// The frames that were read last, by number: slow motion needs the same two again and again, often on several
/// threads.
#[derive(Debug)]
pub(super) struct Recent<T>(Mutex<VecDeque<(i64, Arc<T>)>>);

impl<T> Default for Recent<T> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<T> Recent<T> {
    /// Number of frames in memory: two, and two for threads that are ahead.
    const KEPT: usize = 4;

    /// The frame of this number; `read` reads it if it is not in memory. Threads that need it at once may read it
    /// each, and get the same.
    pub(super) fn get(&self, number: i64, read: impl FnOnce() -> Result<T>) -> Result<Arc<T>> {
        match self.shared(number, None) {
            Some(frame) => Ok(frame),
            // Without the lock: reading may wait for threads that wait for it.
            None => {
                let frame = Arc::new(read()?);
                Ok(self.shared(number, Some(&frame)).unwrap_or(frame))
            }
        }
    }

    /// The frame of this number that is in memory, or `new`, which is then.
    fn shared(&self, number: i64, new: Option<&Arc<T>>) -> Option<Arc<T>> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = kept.iter().position(|(known, _)| *known == number);
        let frame = found.and_then(|at| kept.remove(at)).map(|(_, frame)| frame);
        let frame = frame.or_else(|| new.cloned())?;
        kept.push_back((number, frame.clone()));
        if kept.len() > Self::KEPT {
            kept.pop_front();
        }
        Some(frame)
    }
}
