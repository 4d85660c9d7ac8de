//! Decoupling: from readings to deformation (or other measured targets), by several methods. Each is a [`Decoder`] of
//! single rows and of whole frames.
//!
//! | decoder | how it decodes |
//! |---|---|
//! | [`TrainingMean`] | always answers the mean of the training set: the baseline |
//! | [`AffineMap`] | an affine map, by least squares or ridge regression |
//! | [`RadialBasisNetwork`] | Gaussians around centres |
//! | [`TakagiSugeno`] | fuzzy rules with affine consequents |
//! | [`CompiledNetworks`] | trained networks, fast, in double or single precision |
//! | [`NewtonDecoder`] | solves Eq. (2) by the Gauss-Newton method |
//! | [`PolishedDecoder`] | another decoder's answer, improved by a few Gauss-Newton steps |
//! | [`PosteriorDecoder`] | the Gauss-Newton method with noise and prior |
//!
//! [`DecoderKind`] lists them with their names and meanings, and fits each. Decoders of readings alone come as
//! [`PerRow`](crate::dataset::PerRow): one shared by all row-wires, or one per row-wire. [`resistance_residual`]
//! measures how well an answer explains the readings, without ground truth. [`Description`] contains what a decoder
//! computes, as plain numbers, for programs that decode without this one.

mod affine_map;
mod compiled;
mod decoder;
mod description;
mod equation_decoders;
mod equations;
mod gauss_newton;
mod kind;
mod least_squares;
mod newton;
mod plain_newton;
mod posterior;
mod radial_basis;
mod ridge;
mod row_problem;
mod side_by_side;
mod takagi_sugeno;

pub use affine_map::{AffineMap, TrainingMean};
pub use compiled::{CompiledNetworks, Real};
pub use decoder::{DecodeError, Decoder, SolvedRows, decode_set, resistance_residual};
pub use description::{AffineLayer, Description, Layer, LayeredMap, NotDescribed};
pub use equation_decoders::{NewtonDecoder, PolishedDecoder, PosteriorDecoder};
pub use equations::{Estimate, Estimator};
pub use kind::{DecoderKind, DecoderKindError, Fit, FitError, FitProblem, Precision};
pub use newton::{LARGEST_ERROR, Newton, NewtonReport, NewtonRules, NewtonStop, Solution};
pub(crate) use posterior::SampledPosterior;
pub use posterior::{Posterior, PosteriorReport};
pub use radial_basis::RadialBasisNetwork;
pub(crate) use ridge::{Regression, ridge};
pub(crate) use row_problem::{GaussianPrior, Range, ranges};
pub use row_problem::{RowChoice, RowProblemDescription};
pub use takagi_sugeno::TakagiSugeno;
