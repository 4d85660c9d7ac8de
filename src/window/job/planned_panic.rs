//! Panics planned by tests in the work of a job.

use std::cell::Cell;

use super::Report;

/// Message of the panics.
pub(in crate::window) const MESSAGE: &str = "a planned panic";

thread_local! {
    static PLANNED: Cell<Option<&'static str>> = const { Cell::new(None) };
}

/// Makes the work panic that the job of this name starts next from this thread.
pub(in crate::window) fn plan(name: &'static str) {
    PLANNED.set(Some(name));
}

/// Returns true until the planned panic has been started.
pub(in crate::window) fn is_pending() -> bool {
    PLANNED.get().is_some()
}

/// Returns `work` of the job `name`, preceded by a panic if that is planned.
pub(super) fn before<E, T>(
    name: &'static str,
    work: impl FnOnce(&Report<E>) -> T + Send + 'static,
) -> impl FnOnce(&Report<E>) -> T + Send + 'static {
    let panics = PLANNED.get() == Some(name);
    if panics {
        PLANNED.set(None);
    }
    move |report| {
        assert!(!panics, "{MESSAGE}");
        work(report)
    }
}
