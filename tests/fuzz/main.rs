//! Every reader and parser fed with damaged and arbitrary input: nothing panics, hangs or grows without bound, and what
//! is accepted is what was written, or answers with finite numbers.
//!
//! Inputs are the files of a corpus, and valid ones changed at random by a seeded generator, so that a failure comes back;
//! `FUZZ_ROUNDS=1000` in the environment multiplies their number for a campaign by hand. `bolero` replays the corpus. It
//! draws no inputs of its own here: without a fuzzer they come from a seed of the system, seldom pass the first brace and
//! never come back. Under `cargo bolero test` the same tests are targets of libFuzzer.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod arguments;
mod checkpoint_file;
mod corpus;
mod import;
mod mutation;
mod names;
mod network_file;
mod readings;
mod run_folder;
mod sealing;
mod trained;
