//! The three-layer network of the paper (Fig. 3): resistances, a tanh hidden layer, a linear output layer; with the
//! scaling on both sides and the random start.

mod decoupling_network;
mod mlp;
mod scaling;
mod start;
mod suggestions;
mod tanh;

pub use decoupling_network::{DecouplingNetwork, NetworkError};
pub use mlp::{Mlp, Shape};
pub use scaling::{MinMax, ScalingError};
pub use start::nguyen_widrow;
pub use suggestions::{HiddenSuggestions, LARGEST_HIDDEN};
pub use tanh::tanh_in_place;
