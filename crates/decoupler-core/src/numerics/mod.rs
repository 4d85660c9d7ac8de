//! Numerics that several modules share: least squares, distributions, special functions, and figures of samples.

mod interval;
mod minimise;
mod special;
mod statistics;

pub use interval::Interval;
pub(crate) use interval::{Evidence, SumVariance};
pub(crate) use minimise::{Linearised, Spectrum, convex_weights, minimise};
pub(crate) use special::{chi_squared_quantile, normal_cdf, scaled_k0_k1, student_quantile, two_sided_normal_quantile};
pub(crate) use statistics::{
    autocorrelation, correlation_time, interpolated, is_positive_mean, mean, means_differ, median, quantile,
    root_mean_square, standard_error,
};
