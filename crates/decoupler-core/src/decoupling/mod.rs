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
//! | [`NewtonDecoder`] | solves Eq. (2) by the [`Estimator`]: the Gauss-Newton method, with prior if the scene has noise |
//! | [`PolishedDecoder`] | another decoder's answer, improved by a few steps of the [`Estimator`] |
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
mod kind;
mod radial_basis;
mod ridge;
mod takagi_sugeno;

pub use affine_map::{AffineMap, TrainingMean};
pub use compiled::{CompiledNetworks, Real};
pub use decoder::{DecodeError, Decoder, SolvedRows, decode_set, resistance_residual};
pub use description::{AffineLayer, Description, Layer, LayeredMap, NotDescribed};
pub use equation_decoders::{NewtonDecoder, PolishedDecoder};
pub use equations::{Estimate, Estimator, LARGEST_ERROR, NewtonStop, RowChoice, RowProblemDescription, Solution};
pub(crate) use equations::{GaussianPrior, ranges};
pub use kind::{DecoderKind, Fit, FitError, FitProblem, Precision};
pub use radial_basis::RadialBasisNetwork;
pub(crate) use ridge::{Regression, ridge};
pub use takagi_sugeno::TakagiSugeno;
