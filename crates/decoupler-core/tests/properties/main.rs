//! Properties that hold for arbitrary inputs, drawn from a fixed seed.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod scaling;
mod sensor;
mod surfaces;

use proptest::test_runner::{Config, RngSeed};

/// Number of cases of a property, the same in every run; failures need no record.
fn cases(count: u32) -> Config {
    Config {
        cases: count,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(2),
        ..Config::default()
    }
}
