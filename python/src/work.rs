//! Work of the numerics on behalf of Python: without the interpreter lock, and with Python exceptions instead of errors
//! and panics.

use std::{
    any::Any,
    fmt::Display,
    panic::{AssertUnwindSafe, catch_unwind},
    process,
    sync::{Arc, Mutex, OnceLock, PoisonError},
};

use pyo3::{
    exceptions::{PyRuntimeError, PyValueError},
    prelude::*,
};
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Process in which the module was loaded, whose threads the global pool has.
static LOADED_IN: OnceLock<u32> = OnceLock::new();
/// Pool of a forked process.
static FORKED: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Returns the `ValueError` with the message of `error`.
pub fn value_error(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Records the process that loads the module.
pub fn loaded() {
    LOADED_IN.get_or_init(process::id);
}

/// Runs `work` without the interpreter lock.
///
/// # Errors
/// `ValueError` with the message of an error; `RuntimeError` if `work` panics.
pub fn detached<T: Send, E: Display + Send>(py: Python<'_>, work: impl FnOnce() -> Result<T, E> + Send) -> PyResult<T> {
    let done = py.detach(|| catch_unwind(AssertUnwindSafe(|| in_pool(work))));
    match done {
        Ok(result) => result.map_err(value_error),
        Err(panic) => Err(PyRuntimeError::new_err(format!(
            "internal error, please report it: {}",
            message(&*panic)
        ))),
    }
}

/// Runs `work` in the global pool of threads or, after a fork, which leaves that pool without threads, in another one.
fn in_pool<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let process = process::id();
    if LOADED_IN.get().is_none_or(|&loaded_in| loaded_in == process) {
        return work();
    }
    let pool = {
        let mut forked = FORKED.lock().unwrap_or_else(PoisonError::into_inner);
        match &*forked {
            Some((of, pool)) if *of == process => Some(Arc::clone(pool)),
            _ => {
                let pool = ThreadPoolBuilder::new().build().ok().map(Arc::new);
                // The threads of a pool that was inherited do not exist, so it must not be joined.
                std::mem::forget(forked.take());
                *forked = pool.clone().map(|pool| (process, pool));
                pool
            }
        }
    };
    match pool {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

fn message(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no message")
}
