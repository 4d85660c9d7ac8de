use ndarray::Array2;

use crate::export::bundle::{portable::Portable, twofold::Twofold};
use decoupler_core::decoupling::Layer;

/// A network of one hidden layer with the hyperbolic tangent.
#[derive(Clone, Copy, Debug)]
pub(in crate::export::bundle) struct TwoLayers<'a> {
    /// R₀ of each channel.
    pub(super) centre: &'a [f64],
    /// Channels × hidden nodes.
    pub(super) hidden_weights: &'a Array2<Twofold>,
    pub(super) hidden_biases: &'a [Twofold],
    /// Hidden nodes × outputs.
    pub(super) output_weights: &'a Array2<Twofold>,
    pub(super) output_biases: &'a [Twofold],
}

impl<'a> TwoLayers<'a> {
    /// The networks of `portable`; `None` if it is another decoder.
    pub(super) fn of(portable: &'a Portable) -> Option<Vec<Self>> {
        let maps = portable.maps.iter();
        maps.map(|map| match &map.layers[..] {
            [Layer::Affine(hidden), Layer::Tanh, Layer::Affine(output)] => Some(Self {
                centre: &map.centre,
                hidden_weights: &hidden.weights,
                hidden_biases: &hidden.biases,
                output_weights: &output.weights,
                output_biases: &output.biases,
            }),
            _ => None,
        })
        .collect()
    }

    /// Largest size of an output, whatever the activations.
    pub(super) fn reach(&self, output: usize) -> f64 {
        let weights = self.output_weights.column(output);
        let of_weights: f64 = weights.iter().map(|weight| weight.to_f64().abs()).sum();
        self.output_biases[output].to_f64().abs() + of_weights
    }
}
