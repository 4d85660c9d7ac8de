use ndarray::{Array1, Array2, ArrayView2, Axis};

use super::Decoupler;
use crate::dataset::Dataset;

/// Answers with the mean coordinates of the training set, whatever it reads: what knowing nothing scores.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingMean {
    coordinates_mm: Array1<f64>,
}

impl TrainingMean {
    /// Takes the mean over all samples.
    ///
    /// # Panics
    /// If there are no samples.
    pub fn fit(training: &Dataset) -> Self {
        let coordinates_mm = training
            .coordinates_mm
            .mean_axis(Axis(0))
            .expect("a training set has samples");
        Self { coordinates_mm }
    }

    /// The mean, 3·M2.
    pub(super) fn coordinates_mm(&self) -> &[f64] {
        self.coordinates_mm.as_slice().expect("a mean is contiguous")
    }
}

impl Decoupler for TrainingMean {
    fn decouple(&self, resistances_ohm: ArrayView2<'_, f64>) -> Array2<f64> {
        let shape = (resistances_ohm.nrows(), self.coordinates_mm.len());
        self.coordinates_mm
            .broadcast(shape)
            .expect("a row broadcasts to many")
            .to_owned()
    }
}
