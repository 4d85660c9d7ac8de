//! The estimator of a row of Eq. (2).

mod bounded;
mod estimator;
mod priors;
mod reading_noise;
#[cfg(test)]
mod tests;

pub use estimator::{Estimate, Estimator};
