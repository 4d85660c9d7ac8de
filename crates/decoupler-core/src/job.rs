//! Work that can be cancelled.

use thiserror::Error;

/// Work that takes longer than a frame of the window, and that its caller can cancel.
///
/// It is passed down to everything that loops over samples, epochs or folds. Once it is cancelled, the work ends with
/// the error [`Cancelled`] at the next [`check`](Self::check). What is found on the way is handed to callbacks.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    is_cancelled: &'a dyn Fn() -> bool,
}

/// The caller cancelled the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("cancelled")]
pub struct Cancelled;

impl<'a> Job<'a> {
    /// Work that is never cancelled.
    pub const UNINTERRUPTED: Job<'static> = Job {
        is_cancelled: &|| false,
    };

    /// Returns work that ends once `is_cancelled`, which is called often: before every epoch, say.
    pub fn new(is_cancelled: &'a dyn Fn() -> bool) -> Self {
        Self { is_cancelled }
    }

    /// Returns `true` once the work is cancelled.
    pub fn is_cancelled(&self) -> bool {
        (self.is_cancelled)()
    }

    /// Ends the work if it is cancelled.
    ///
    /// # Errors
    /// [`Cancelled`] once it is.
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }
}
