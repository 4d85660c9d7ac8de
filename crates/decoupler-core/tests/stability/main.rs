//! The stability matrix: every method, decoder and scene at its extremes, judged independently of the code under test. A cell
//! is *right* (it agrees with an independent truth, or stays within a bound that is computed), *refused* or *flagged* (with
//! cause and cure), and never plausible but wrong.
//!
//! `cargo test --release --test stability` runs every job; without `--release` every eleventh is run.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod decoders;
mod judge;
mod methods;
mod scenes;
mod situations;

use judge::{Job, Verdict};
use rayon::prelude::*;

/// One in this many jobs is run.
const STRIDE: usize = if cfg!(debug_assertions) { 11 } else { 1 };

#[test]
fn every_cell_is_right_refused_or_flagged() {
    let rooms = [methods::jobs(), decoders::jobs(), scenes::jobs()];
    let jobs = Vec::from_iter(rooms.into_iter().flat_map(|jobs| jobs.into_iter().step_by(STRIDE)));
    // A panic counts as a wrong cell, with its message.
    std::panic::set_hook(Box::new(|_| {}));
    let cells: Vec<(String, Verdict)> = jobs.par_iter().flat_map_iter(Job::cells).collect();
    let _ = std::panic::take_hook();
    let right = cells.iter().filter(|cell| cell.1 == Verdict::Right).count();
    assert!(
        2 * right > cells.len(),
        "only {right} of {} cells are right",
        cells.len()
    );
    let is_wrong = |cell: &&(String, Verdict)| matches!(cell.1, Verdict::Wrong(_));
    let wrong = Vec::from_iter(cells.iter().filter(is_wrong));
    assert!(
        wrong.is_empty(),
        "{} of {} cells are wrong: {wrong:#?}",
        wrong.len(),
        cells.len()
    );
}
