//! The machine that the program runs on: its memory and its speed, from which memory and time of a run are stated before it
//! begins.

mod memory;
mod speed;

pub use memory::{MachineMemory, MemorySource};
pub(crate) use speed::{Speed, node_pairs_per_row};
