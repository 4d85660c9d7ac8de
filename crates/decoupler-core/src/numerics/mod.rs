//! Numerics that several modules share: quantiles of distributions, and figures of samples.

mod special;
mod statistics;

pub(crate) use special::{chi_squared_quantile, student_quantile, two_sided_normal_quantile};
pub(crate) use statistics::{median, quantile};
