//! Sweeps in the terminal: divided, repeated, killed, run by several programs at once, and merged.

pub(crate) mod driver;
mod filling;
mod merging;
mod recordings;
mod specifications;
mod stopping;
