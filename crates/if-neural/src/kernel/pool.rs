//! Scratch memory that outlives a call.

use std::sync::{Mutex, PoisonError};

/// Buffers that are lent to one tile at a time and kept: after the first calls, as many exist as
/// threads have run at once, and nothing is allocated any more.
#[derive(Debug)]
pub(crate) struct Pool<T>(Mutex<Vec<T>>);

impl<T> Default for Pool<T> {
    fn default() -> Self {
        Pool(Mutex::default())
    }
}

/// A copy starts without buffers.
impl<T> Clone for Pool<T> {
    fn clone(&self) -> Self {
        Pool::default()
    }
}

impl<T> Pool<T> {
    /// Runs `work` with a buffer, made by `make` if none is free. A buffer is lost when `work`
    /// panics.
    pub(crate) fn with<R>(&self, make: impl FnOnce() -> T, work: impl FnOnce(&mut T) -> R) -> R {
        // A poisoned lock holds whole buffers: they are pushed and popped whole.
        let free = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut buffer = free.unwrap_or_else(make);
        let result = work(&mut buffer);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(buffer);
        result
    }
}
