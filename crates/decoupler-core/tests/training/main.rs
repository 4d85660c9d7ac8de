//! Training: each method, its stopping rules and messages, and bit-identical results with any threads and pauses.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod causes;
mod conformance;
mod methods;
mod problems;
mod resume;
mod rows_and_folds;
mod run_starts;
mod stopping;
mod traces;
mod wide;
