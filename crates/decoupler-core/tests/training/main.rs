//! Trainings: each method, how it stops, what it says, and that neither threads nor pauses change a bit.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod causes;
mod methods;
mod problems;
mod resume;
mod stopping;
mod threads;
mod traces;
mod wide;
