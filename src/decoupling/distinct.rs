use std::collections::HashSet;

use ndarray::{Array2, ArrayView2, Axis};

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
