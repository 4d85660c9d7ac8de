//! The three-layer network of the paper (Fig. 3): resistances, a tanh hidden layer and a linear output layer.
//!
//! A [`DecouplingNetwork`] is an [`Mlp`] with the scaling on both sides ([`Inputs`], [`MinMax`]); [`Networks`] are one
//! network shared by all row-wires or one per row-wire. Weights are initialised at random by [`nguyen_widrow`].

mod channel_noise;
mod decoupling_network;
mod exponential;
mod inputs;
mod mlp;
mod networks;
mod quantity;
mod reading_range;
mod resolution;
mod scaling;
mod start;
mod suggestions;
mod tanh;
mod whitening;

pub use channel_noise::ChannelNoise;
pub use decoupling_network::{DecouplingNetwork, NetworkError};
pub(crate) use exponential::exp;
pub(crate) use inputs::channel_noise;
pub use inputs::{InputChoice, InputScaling, Inputs, ScalingChoice, ScalingChoiceError};
pub use mlp::{Mlp, Shape};
pub use networks::Networks;
pub use quantity::{Quantity, QuantityError};
pub use reading_range::ReadingRange;
pub use scaling::{MinMax, ScalingError};
pub use start::nguyen_widrow;
pub use suggestions::{HiddenSuggestions, LARGEST_HIDDEN};
pub use tanh::{tanh_in_place, tanh_in_place_single};
pub use whitening::Whitening;
