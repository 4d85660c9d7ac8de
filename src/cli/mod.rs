//! The work without a window: `decoupler train`, `decode` and `simulate`.
//!
//! A command ends with status 0 when its work is done, 1 when it failed, 2 when its arguments were wrong; the last two
//! with one line on standard error.

mod arguments;
mod decode;
mod failure;
mod simulate;
mod train;
mod train_report;

pub use arguments::{Window, run};
