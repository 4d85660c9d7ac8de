use ndarray::{Array1, Array2, ArrayView2, Axis, Slice};
use rand::Rng;

use crate::decoupling::clusters::{distance2, k_means};

/// Antecedents of fuzzy rules: each has a Gaussian membership exp(−‖x − c‖² / 2σ²) around its centre c, a product of one
/// membership for each input, with one width σ for all of them.
#[derive(Clone, Debug)]
pub(super) struct Antecedents {
    /// Rules × the leading inputs that memberships look at.
    centres: Array2<f64>,
    /// 1 / 2σ².
    sharpness: f64,
}

impl Antecedents {
    /// One rule that holds everywhere.
    pub fn everywhere() -> Self {
        Self {
            centres: Array2::zeros((1, 0)),
            sharpness: 0.0,
        }
    }

    /// Memberships of this width around `centres`; where the width is 0, every rule fires alike.
    pub fn new(centres: Array2<f64>, width: f64) -> Self {
        let sharpness = 0.5 / (width * width);
        Self {
            centres,
            sharpness: if sharpness.is_finite() { sharpness } else { 0.0 },
        }
    }

    /// Centres of `rules` clusters of the leading `components` of the inputs `x` (samples × inputs), at most one for
    /// each sample, with their root mean square distance.
    pub fn clusters(x: ArrayView2<'_, f64>, components: usize, rules: usize, rng: &mut impl Rng) -> (Array2<f64>, f64) {
        let leading = x.slice_axis(Axis(1), Slice::from(..components.min(x.ncols())));
        let centres = k_means(leading, rules.clamp(1, x.nrows()), rng);
        let pairs = centres.rows().into_iter().enumerate();
        let squares: f64 = pairs
            .flat_map(|(i, a)| centres.rows().into_iter().take(i).map(move |b| distance2(a, b)))
            .sum();
        let count = centres.nrows() * (centres.nrows() - 1) / 2;
        let distance = (squares / count.max(1) as f64).sqrt();
        (centres, distance)
    }

    /// Number of rules.
    pub fn rules(&self) -> usize {
        self.centres.nrows()
    }

    /// Logarithms of the memberships as an affine map of `inputs` inputs: slopes (rules × inputs) and offsets. They lack
    /// −‖x‖² / 2σ², which all rules share and which normalising removes.
    pub fn logarithms(&self, inputs: usize) -> (Array2<f64>, Array1<f64>) {
        let slopes = Array2::from_shape_fn((self.rules(), inputs), |(rule, input)| {
            let coordinate = self.centres.get((rule, input)).copied().unwrap_or(0.0);
            2.0 * self.sharpness * coordinate
        });
        let offset = |centre: ndarray::ArrayView1<'_, f64>| -self.sharpness * centre.dot(&centre);
        let offsets = self.centres.rows().into_iter().map(offset).collect();
        (slopes, offsets)
    }

    /// Normalised firing strengths (samples × rules) of the inputs `x` (samples × inputs).
    pub fn firing_strengths(&self, x: ArrayView2<'_, f64>) -> Array2<f64> {
        let (slopes, offsets) = self.logarithms(x.ncols());
        // A product of one input is made column by column.
        let mut strengths = (x.dot(&slopes.t()) + &offsets).as_standard_layout().into_owned();
        for mut row in strengths.rows_mut() {
            normalise(row.as_slice_mut().expect("rows of a standard array are contiguous"));
        }
        strengths
    }
}

/// Logarithms of memberships, up to a common term, to firing strengths, whose sum is 1. The largest is subtracted first, so
/// that far from all centres the nearest rule fires and nothing is 0/0.
pub(super) fn normalise(strengths: &mut [f64]) {
    let largest = strengths.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut total = 0.0;
    for strength in strengths.iter_mut() {
        *strength = (*strength - largest).exp();
        total += *strength;
    }
    for strength in strengths {
        *strength /= total;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{Seed, Stream};
    use ndarray::array;

    #[test]
    fn far_from_all_centres_the_nearest_rule_fires() {
        let antecedents = Antecedents::new(array![[0.0, 0.0], [1.0, 0.0]], 0.1);
        // Both memberships are 0 in double precision.
        for far in [1e3, 1e8] {
            let strengths = antecedents.firing_strengths(array![[far, 7.0], [-far, 7.0]].view());
            assert_eq!(strengths, array![[0.0, 1.0], [1.0, 0.0]]);
        }
        let middle = antecedents.firing_strengths(array![[0.5, 1e3]].view());
        assert!((middle[[0, 0]] - 0.5).abs() < 1e-12, "{middle}");
    }

    #[test]
    fn coincident_centres_fire_alike() {
        let mut rng = Seed(0).rng(Stream::Expectation);
        let (centres, distance) = Antecedents::clusters(array![[2.0], [2.0], [2.0]].view(), 1, 2, &mut rng);
        assert_eq!((centres.nrows(), distance), (2, 0.0));
        let strengths = Antecedents::new(centres, distance).firing_strengths(array![[2.0], [-1e9]].view());
        assert_eq!(strengths, array![[0.5, 0.5], [0.5, 0.5]]);
    }
}
