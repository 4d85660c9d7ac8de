use ndarray::{Array1, Array2, Axis};

use super::{AffineLayer, DecodeError, Decoder, Description, Layer, LayeredMap, NotDescribed};
use crate::{dataset::Dataset, network::Quantity};

/// Decoder that always answers the mean targets of the training set, the score of knowing nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingMean {
    channels: usize,
    targets: Array1<f64>,
}

impl TrainingMean {
    /// Computes the mean targets over all samples.
    ///
    /// # Panics
    /// If there are no samples.
    pub fn fit(training: &Dataset) -> Self {
        let targets = training.targets().mean_axis(Axis(0));
        Self {
            channels: training.channels(),
            targets: targets.expect("a training set has samples"),
        }
    }
}

impl Decoder for TrainingMean {
    fn channels(&self) -> usize {
        self.channels
    }

    fn outputs(&self) -> usize {
        self.targets.len()
    }

    fn decode_row(&mut self, _row_index: usize, _readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        targets.copy_from_slice(self.targets.as_slice().expect("a mean is contiguous"));
        Ok(())
    }

    fn description(&self) -> Result<Description, NotDescribed> {
        let mean = AffineLayer {
            weights: Array2::zeros((self.channels, self.targets.len())),
            biases: self.targets.to_vec(),
        };
        Ok(Description::of_maps(vec![LayeredMap {
            quantity: Quantity::Raw,
            centre: vec![0.0; self.channels],
            layers: vec![Layer::Affine(mean)],
        }]))
    }
}
