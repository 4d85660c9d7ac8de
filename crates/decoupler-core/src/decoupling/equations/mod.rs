//! Eq. (2) of a row-wire, and the estimator that solves it.

mod bounded;
mod estimate;
mod estimator;
mod lanes;
mod priors;
mod reading_noise;
mod row_problem;
mod side_by_side;
mod symmetry;
#[cfg(test)]
mod tests;
mod triangle;
mod upper;

pub use estimate::{Estimate, LARGEST_ERROR, Solution};
pub use estimator::Estimator;
pub(crate) use priors::GaussianPrior;
pub(crate) use row_problem::{Range, RowProblem};
