//! Damaged and arbitrary input for every reader and parser: nothing panics, hangs or grows without bound, and accepted
//! input equals what was written or gives finite numbers.
//!
//! Inputs are the files of a corpus, and valid inputs mutated by a seeded random generator, so failures are
//! reproducible; `FUZZ_ROUNDS` in the environment multiplies their number: 3 in `.ci/run`, 1000 in a campaign by hand.
//! `bolero` only replays the corpus: without a fuzzer, its own inputs come from a seed of the system, rarely get past
//! the first brace and are not reproducible. Under `cargo bolero test` the same tests are libFuzzer targets.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod archives;
mod arguments;
mod checkpoint_file;
mod corpus;
mod expressions;
mod frame_recording;
mod import;
mod input_lines;
mod live_lines;
mod mutation;
mod network_file;
mod readings;
mod recipe_file;
mod run_folder;
mod sealing;
mod sensor_file;
mod sweep_folder;
mod sweep_specification;
mod time_stamps;
mod trained;
mod window_file;
