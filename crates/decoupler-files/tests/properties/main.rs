//! Properties that hold for arbitrary inputs, drawn from a fixed seed.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod files;

use proptest::test_runner::{Config, RngSeed};

/// Number of cases of a property. They are the same in every run, so failures need no record.
fn cases(count: u32) -> Config {
    Config {
        cases: count,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(2),
        ..Config::default()
    }
}
