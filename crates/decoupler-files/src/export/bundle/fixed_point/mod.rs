//! Networks in whole numbers: 16-bit weights and activations, 64-bit sums; where the products of a hidden layer nearly
//! cancel, its weights have 24 bits. Readings and outputs are 32-bit numbers of small units.
//!
//! Every number has a range that holds for any readings whatever, because each step begins with a saturation; sums can
//! therefore not wrap. The bound on the error is computed by interval analysis over the range of readings in training and
//! a tenth of it on either side.

mod change;
mod decoding;
mod logarithm;
mod quantise;
mod scaled;
mod tangent;
mod two_layers;
mod units;

use thiserror::Error;

pub(super) use self::{
    change::{CONDUCTANCE_BITS, HiddenWidth},
    logarithm::LogTable,
    quantise::{FixedNetwork, FixedNetworks, USUAL_BOUND},
    tangent::TangentTable,
    units::Units,
};

/// Reasons for which a network cannot leave in fixed point.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FixedPointError {
    /// Another decoder than a network.
    #[error("fixed16 is for networks only: give --precision f64 or f32")]
    NoNetwork,
    /// The file does not tell the range of the readings.
    #[error(
        "fixed16 needs the range of the readings in training, which the network file does not have: train again, or give --precision f32"
    )]
    NoRange,
    /// Resistances that no unit brings into 32 bits.
    #[error(
        "fixed16 reads resistances up to 1e9 ohm, and in training they were up to {0:.1e} ohm: give --precision f32"
    )]
    Reading(f64),
    /// Weights or outputs beyond what the numbers hold.
    #[error("fixed16 cannot hold {what}: {cure}, which keeps weights small, or give --precision f32")]
    Range {
        /// A way to train a network with smaller weights.
        cure: &'static str,
        /// Name of the value that is too large.
        what: &'static str,
    },
    /// An error bound that says nothing.
    #[error(
        "in whole numbers the error is only known to be below {bound:.3} times {scale}: {cure} (the network amplifies differences of its readings too much), or give --precision f32"
    )]
    Coarse {
        /// The bound, in proportion to the range.
        bound: f64,
        /// Name of the range.
        scale: &'static str,
        /// A way to train a network that amplifies less.
        cure: &'static str,
    },
}
