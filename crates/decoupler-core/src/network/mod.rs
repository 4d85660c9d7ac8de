//! The three-layer network of the paper (Fig. 3): resistances, a tanh hidden layer and a linear output layer.
//!
//! A [`DecouplingNetwork`] is an [`Mlp`] with the scaling on both sides ([`Inputs`], [`MinMax`]); [`Networks`] are one
//! network shared by all row-wires or one per row-wire. Weights are initialised at random by [`nguyen_widrow`].

mod inputs;
mod mlp;
mod networks;
mod quantity;
mod scaling;
mod tanh;

pub use inputs::{InputChoice, Inputs, ScalingChoice};
pub(crate) use inputs::{InputScaling, channel_noise};
pub use mlp::{Mlp, Shape, nguyen_widrow};
pub use networks::{DecouplingNetwork, LARGEST_HIDDEN, Networks, suggested_hidden};
pub(crate) use quantity::ChannelNoise;
pub use quantity::{Domain, Quantity};
pub use scaling::MinMax;
pub(crate) use scaling::{MARGIN, Whitening};
pub(crate) use tanh::{exp, tanh, tanh_single};
pub use tanh::{tanh_in_place, tanh_in_place_single};

use ndarray::ArrayView2;
use thiserror::Error;

/// Error in fitting a decoder, or in fitting or reading a scaling or a network.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum NetworkError {
    /// There are no samples.
    #[error("there are no samples to scale")]
    Empty,
    /// A value is NaN or infinite.
    #[error("sample {}, channel {}: {value:?} is not a finite number; give finite readings and targets", .sample + 1, .channel + 1)]
    NotFinite {
        /// Index of the sample, from 0.
        sample: usize,
        /// Index of the channel, from 0.
        channel: usize,
        /// Value found.
        value: f64,
    },
    /// A reading is outside the domain of the chosen input quantity.
    #[error("sample {}, channel {}: {value:?} is not a resistance; give finite numbers above 0, or use the raw readings", .sample + 1, .channel + 1)]
    Reading {
        /// Index of the sample, from 0.
        sample: usize,
        /// Index of the channel, from 0.
        channel: usize,
        /// Reading found.
        value: f64,
    },
    /// The range of a channel overflows, or its reciprocal does.
    #[error(
        "channel {} ranges from {minimum:?} to {maximum:?}: too {}",
        .channel + 1,
        if *.is_wide { "wide to scale; use a larger unit" } else { "narrow to scale; use a smaller unit" }
    )]
    Range {
        /// Index of the channel, from 0.
        channel: usize,
        /// Smallest value of the channel.
        minimum: f64,
        /// Largest value of the channel.
        maximum: f64,
        /// `true` if the range itself overflows.
        is_wide: bool,
    },
    /// A decomposition did not converge, or sums overflowed.
    #[error(
        "the equations of the fit or of the principal components have no finite solution: look for extreme values in the \
         readings and targets, or scale the readings by their range"
    )]
    NotConverged,
    /// The limits of a scaling, or of the readings in the training set, are missing, not finite, or out of order.
    #[error("the {0} scaling is damaged: its limits are missing, not finite, or out of order")]
    DamagedScaling(&'static str),
    /// The number of weights in a layer does not match the scaling and the hidden nodes.
    #[error("the {layer} layer has {found} weights, but {expected} follow from the scaling and the hidden nodes")]
    LayerSize {
        /// Name of the layer.
        layer: &'static str,
        /// Number of weights found.
        found: usize,
        /// Number of weights expected.
        expected: usize,
    },
    /// A weight is NaN or infinite.
    #[error("weight {index} of the {layer} layer is not a finite number")]
    Weight {
        /// Name of the layer.
        layer: &'static str,
        /// Index of the weight, row by row from 0.
        index: usize,
    },
}

impl NetworkError {
    /// Checks that all values (samples × channels) are finite.
    ///
    /// # Errors
    /// [`Self::NotFinite`] at the first that is not.
    fn check_finite(values: ArrayView2<'_, f64>) -> Result<(), Self> {
        match values.indexed_iter().find(|(_, value)| !value.is_finite()) {
            Some(((sample, channel), &value)) => Err(Self::NotFinite { sample, channel, value }),
            None => Ok(()),
        }
    }
}
