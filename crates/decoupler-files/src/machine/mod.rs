//! The machine that the program runs on: its memory, and why its operating system refused something.

mod memory;
mod reading_budget;
mod system_error;

pub use memory::{limit_memory, memory_budget};
pub use reading_budget::{OverBudget, ReadingBudget};
pub use system_error::system_cause;
pub(crate) use system_error::system_words;
