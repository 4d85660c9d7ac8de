//! Decoupling: readings in, deformation (or whatever was measured) out, by every way we know. Every way is a
//! [`Decoder`], of single rows and of whole frames.
//!
//! | decoder | how it decodes |
//! |---|---|
//! | [`TrainingMean`] | knows nothing: the baseline |
//! | [`AffineMap`] | an affine map, by least squares or with a ridge penalty chosen by cross-validation |
//! | [`RadialBasisNetwork`] | Gaussians around centres |
//! | [`TakagiSugeno`] | fuzzy rules with affine consequents |
//! | [`TakagiSugeno`] | fuzzy rules with affine consequents |
//! | [`CompiledNetworks`] | trained networks, fast, in double or single precision |
//! | [`NewtonDecoder`] | solves Eq. (2) |
//! | [`PolishedDecoder`] | another decoder's answer, then a few Newton steps |
//! | [`PosteriorDecoder`] | Newton's method with noise and prior |
//!
//! [`DecoderKind`] lists them with all that is said of each.
//! Decoders of readings alone come as [`PerRow`](crate::dataset::PerRow): one for every row-wire, or one for each.
//! [`resistance_residual`] tells how well an answer explains the readings, without ground truth.

mod affine_map;
mod box_posterior;
mod clusters;
mod compiled_network;
mod decoder;
mod equation_decoders;
mod gauss_newton;
mod kind;
mod least_squares;
mod newton;
mod newton_report;
mod posterior;
mod radial_basis;
mod real;
mod residual;
mod ridge;
mod row_prior;
mod row_problem;
mod takagi_sugeno;
mod training_mean;

pub use affine_map::AffineMap;
pub use compiled_network::CompiledNetworks;
pub use decoder::{DecodeError, Decoder, decode_set};
pub use equation_decoders::{NewtonDecoder, PolishedDecoder, PosteriorDecoder};
pub use kind::{ColourKey, DecoderKind, DecoderKindError, Precision};
pub use newton::Newton;
pub use newton_report::{NewtonReport, NewtonRules, NewtonStop};
pub use posterior::{Posterior, PosteriorReport};
pub use radial_basis::{Centres, RadialBasisNetwork, RadialBasisSettings};
pub use real::Real;
pub use residual::resistance_residual;
pub use takagi_sugeno::TakagiSugeno;
pub use training_mean::TrainingMean;
