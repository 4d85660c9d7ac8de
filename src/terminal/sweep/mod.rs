//! `decoupler sweep`: trains every combination of options. A trial is determined by its options and the program. Its file
//! is named by their hash and written atomically, and the program that trains it holds a lock. Therefore any number of
//! programs, on any machines with access to the folder, can fill it together, stop at any moment and be started again.

mod command;
mod specification;
mod trials;

pub(super) use command::Sweep;
