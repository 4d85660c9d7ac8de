//! Decoupling: from readings to deformation (or other measured targets), by several methods. Each is a [`Decoder`] of
//! single rows and of whole frames.
//!
//! | decoder | how it decodes |
//! |---|---|
//! | [`ProgramDecoder`] | evaluates a [`Program`]: trained networks, and all decoders that are fitted to samples |
//! | [`NewtonDecoder`] | solves Eq. (2) by the Gauss-Newton method |
//! | [`PolishedDecoder`] | another decoder's answer, improved by a few Gauss-Newton steps |
//! | [`PosteriorDecoder`] | the Gauss-Newton method with noise and prior |
//!
//! [`DecoderKind`] lists them with their names and meanings, and fits each. A [`Program`] is the only forward pass outside
//! training; exports print it for other languages. [`resistance_residual`] measures how well an answer explains the
//! readings, without ground truth.

mod affine_map;
mod decoder;
mod equation_decoders;
mod equations;
mod gauss_newton;
mod kind;
mod least_squares;
mod newton;
mod plain_newton;
mod posterior;
mod program;
mod radial_basis;
mod ridge;
mod row_problem;
mod side_by_side;
mod takagi_sugeno;

pub use decoder::{DecodeError, Decoder, Description, NotDescribed, SolvedRows, decode_set, resistance_residual};
pub use equation_decoders::{NewtonDecoder, PolishedDecoder, PosteriorDecoder};
pub use equations::{Estimate, Estimator};
pub use kind::{DecoderKind, DecoderKindError, Fit, FitError, FitProblem, Precision};
pub use newton::{LARGEST_ERROR, Newton, NewtonReport, NewtonRules, NewtonStop, Solution};
pub(crate) use posterior::SampledPosterior;
pub use posterior::{Posterior, PosteriorReport};
pub use program::{Builder, Changes, Domain, Function, Node, NodeId, Operation, Program, ProgramDecoder};
pub(crate) use ridge::{Regression, ridge};
pub(crate) use row_problem::{GaussianPrior, Range, ranges};
pub use row_problem::{RowChoice, RowProblemDescription};
