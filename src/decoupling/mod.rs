//! Decoupling: resistances in, coordinates of nodes out, by every way we know.
//!
//! | decoder | what it is |
//! |---|---|
//! | [`TrainingMean`] | knows nothing: the baseline |
//! | [`RidgeMap`] | affine, with a penalty chosen by cross-validation |
//! | [`RadialBasisNetwork`] | Gaussians around centres |
//! | [`TakagiSugeno`] | fuzzy rules with affine consequents |
//! | [`CompiledNetworks`] | trained networks, fast, in double or single precision |
//! | [`NewtonDecoder`] | solves Eq. (2) |
//! | [`PolishedDecoder`] | any of them, then a few of Newton's steps |
//! | [`PosteriorDecoder`] | Newton's method with noise and prior |
//!
//! All are [`FrameDecoder`]s. [`resistance_residual`] tells how well an answer explains the readings, without ground truth.
//! [`Decoupler`] is the older interface of networks and baselines to rows without order.

mod box_posterior;
mod clusters;
mod compiled_network;
mod equation_decoders;
mod frame;
mod gauss_newton;
mod linear_map;
mod newton;
mod newton_report;
mod posterior;
mod radial_basis;
mod real;
mod residual;
mod ridge_map;
mod row_prior;
mod row_problem;
mod takagi_sugeno;
mod training_mean;

pub use compiled_network::CompiledNetworks;
pub use equation_decoders::{NewtonDecoder, PolishedDecoder, PosteriorDecoder};
pub use frame::{DecodeError, FrameDecoder, RowMap, RowMaps, decode_set, fit_rows};
pub use linear_map::LinearMap;
pub use newton::Newton;
pub use newton_report::{NewtonError, NewtonReport, NewtonRules, NewtonStop};
pub use posterior::{Posterior, PosteriorReport};
pub use radial_basis::{Centres, RadialBasisNetwork, RadialBasisSettings};
pub use real::Real;
pub use residual::resistance_residual;
pub use ridge_map::RidgeMap;
pub use takagi_sugeno::TakagiSugeno;
pub use training_mean::TrainingMean;

use ndarray::{Array2, ArrayView2};

use crate::network::DecouplingNetwork;

/// A way from resistances to coordinates.
pub trait Decoupler {
    /// Coordinates in millimetres (samples × 3·M2) from resistances in ohm (samples × M4).
    fn decouple(&self, resistances_ohm: ArrayView2<'_, f64>) -> Array2<f64>;
}

impl Decoupler for DecouplingNetwork {
    fn decouple(&self, resistances_ohm: ArrayView2<'_, f64>) -> Array2<f64> {
        Self::decouple(self, resistances_ohm)
    }
}

impl RowMap for TrainingMean {
    fn map(&mut self, _readings_ohm: &[f64], coordinates_mm: &mut [f64]) {
        coordinates_mm.copy_from_slice(self.coordinates_mm());
    }
}
