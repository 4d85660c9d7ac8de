//! The three-layer network of the paper (Fig. 3): resistances, a tanh hidden layer and a linear output layer.
//!
//! A [`DecouplingNetwork`] is an [`Mlp`] with the scaling on both sides ([`Inputs`], [`MinMax`]); [`Networks`] are one
//! network shared by all row-wires or one per row-wire. Weights are initialised at random by [`nguyen_widrow`].

mod error;
mod inputs;
mod mlp;
mod networks;
mod quantity;
mod scaling;
mod tanh;
mod whitening;

pub use error::NetworkError;
pub use inputs::{InputChoice, Inputs, ScalingChoice};
pub(crate) use inputs::{InputScaling, channel_noise};
pub use mlp::{Mlp, Shape, nguyen_widrow};
pub use networks::{DecouplingNetwork, LARGEST_HIDDEN, Networks, suggested_hidden};
pub(crate) use quantity::ChannelNoise;
pub use quantity::Quantity;
pub(crate) use scaling::MARGIN;
pub use scaling::MinMax;
pub(crate) use tanh::{exp, tanh, tanh_single};
pub use tanh::{tanh_in_place, tanh_in_place_single};
pub(crate) use whitening::Whitening;
