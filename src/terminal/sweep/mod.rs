//! `decoupler sweep`: trains every combination of options. A trial is determined by its options and the program, its file
//! is named by their hash and written whole or not at all, and anyone who trains it holds a lock: so any number of programs,
//! on any machines that see the folder, may fill it together, end at any moment and be started again.

mod command;
mod filling;
mod specification;
mod trials;

pub(super) use command::Sweep;
