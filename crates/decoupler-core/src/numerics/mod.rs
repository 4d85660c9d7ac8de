//! Numerics that several modules share: least squares, distributions, special functions, and figures of samples.

mod convex;
mod interval;
mod minimise;
mod special;
mod statistics;

pub(crate) use convex::convex_weights;
pub use interval::Interval;
pub(crate) use interval::{Evidence, SumVariance};
pub(crate) use minimise::{Linearised, Spectrum, minimise};
pub(crate) use special::{chi_squared_quantile, normal_cdf, scaled_k0_k1, student_quantile, two_sided_normal_quantile};
pub(crate) use statistics::{
    autocorrelation, correlation_time, is_positive_mean, means_differ, median, quantile, standard_error,
};
