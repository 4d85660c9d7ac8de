//! The stability matrix: every method, decoder, scene, surface and file at its extremes, judged independently of the
//! code under test. A cell is *right* (it agrees with an independent truth, or stays within a bound that is computed),
//! *refused* or *flagged* (with cause and cure), and never plausible but wrong.
//!
//! `cargo test --release --test stability -- --nocapture` prints the whole table; without `--release` every eleventh job
//! is run.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(clippy::print_stdout, reason = "the table is what the test is for")]

mod decoders;
mod files;
mod judge;
mod methods;
mod readings;
mod scenes;
mod sensors;
mod situations;
mod surfaces;
mod table;

use judge::Job;
use rayon::prelude::*;
use table::Table;

/// One in this many jobs is run.
const STRIDE: usize = if cfg!(debug_assertions) { 11 } else { 1 };

#[test]
fn every_cell_is_right_refused_or_flagged() {
    let rooms = [
        sensors::jobs(),
        methods::jobs(),
        decoders::jobs(),
        readings::jobs(),
        scenes::jobs(),
        surfaces::jobs(),
        files::jobs(),
    ];
    let jobs: Vec<Job> = rooms
        .into_iter()
        .flat_map(|jobs| jobs.into_iter().step_by(STRIDE))
        .collect();
    // A panic counts as a wrong cell; its message is in the table.
    std::panic::set_hook(Box::new(|_| {}));
    let cells = jobs.par_iter().flat_map_iter(Job::cells).collect();
    let _ = std::panic::take_hook();
    let table = Table::new(cells);
    println!("{table}");
    assert_eq!(
        table.wrong(),
        0,
        "cells are plausible but wrong: the table above names them"
    );
}
