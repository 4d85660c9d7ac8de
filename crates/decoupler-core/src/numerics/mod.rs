//! Numerics that several modules share: least squares, quantiles of distributions, and figures of samples.

mod minimise;
mod special;
mod statistics;

pub(crate) use minimise::{Linearised, Spectrum, Stop, minimise};
pub(crate) use special::{chi_squared_quantile, student_quantile, two_sided_normal_quantile};
pub(crate) use statistics::{median, quantile};
