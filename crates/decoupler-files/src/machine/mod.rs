//! The machine that the program runs on: why its operating system refused something.

mod system_error;

pub use system_error::system_cause;
pub(crate) use system_error::system_words;
