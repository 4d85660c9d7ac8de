use std::{borrow::Cow, collections::HashSet};

use ndarray::{Array2, ArrayView2, Axis};
use rand::Rng;

use crate::{dataset::Dataset, scene::NoiseSource};

/// Returns `x` and `y` (samples × anything) without samples that repeat an earlier one in both. A sample that is held out
/// while its copy is not tells nothing about new samples.
pub(super) fn distinct(x: ArrayView2<'_, f64>, y: ArrayView2<'_, f64>) -> (Array2<f64>, Array2<f64>) {
    let mut seen = HashSet::new();
    let is_new = |&sample: &usize| {
        let values = x.row(sample).into_iter().chain(y.row(sample));
        seen.insert(values.map(|value| value.to_bits()).collect::<Vec<u64>>())
    };
    let kept: Vec<usize> = (0..x.nrows()).filter(is_new).collect();
    (x.select(Axis(0), &kept), y.select(Axis(0), &kept))
}

/// Returns `training` with the noise that its readings lack: what a curved map makes of noise is learned from samples.
pub(super) fn with_noise<'a>(training: &'a Dataset, unseen: NoiseSource, rng: &mut impl Rng) -> Cow<'a, Dataset> {
    let mut training = Cow::Borrowed(training);
    if !unseen.is_none() {
        training.to_mut().disturb_by(unseen, rng);
    }
    training
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn only_samples_that_repeat_in_both_are_left_out() {
        let x = array![[1.0, 2.0], [1.0, 2.0], [1.0, 2.0], [3.0, 2.0]];
        let y = array![[5.0], [6.0], [5.0], [5.0]];
        let (x, y) = distinct(x.view(), y.view());
        assert_eq!(x, array![[1.0, 2.0], [1.0, 2.0], [3.0, 2.0]]);
        assert_eq!(y, array![[5.0], [6.0], [5.0]]);
    }
}
