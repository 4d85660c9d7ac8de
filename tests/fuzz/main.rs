//! Every reader and parser fed with damaged and arbitrary input: nothing panics, hangs or grows without bound, and what
//! is accepted is what was written, or answers with finite numbers.
//!
//! Inputs are valid ones changed at random by a seeded generator, so that a failure comes back; `FUZZ_ROUNDS=1000` in the
//! environment multiplies their number for a campaign by hand. Not `bolero`: without a nightly compiler its engine draws
//! fresh bytes from a seed of the system, which seldom pass the first brace and never come back, and it does not change
//! the files of its corpus.

#![cfg(feature = "files")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod arguments;
mod checkpoint_file;
mod mutation;
mod names;
mod network_file;
mod readings;
mod run_folder;
mod sealing;
mod trained;
