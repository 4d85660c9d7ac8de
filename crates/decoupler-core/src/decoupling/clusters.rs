use ndarray::{Array2, ArrayView1, ArrayView2, Axis};
use rand::{Rng, seq::index};

/// Iterations of Lloyd's algorithm.
const ROUNDS: usize = 20;
/// Maximum number of samples that are clustered: a few per cluster are enough.
const MAX_CLUSTERED: usize = 1000;

/// Squared Euclidean distance.
#[inline]
pub(super) fn distance2(a: ArrayView1<'_, f64>, b: ArrayView1<'_, f64>) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// Means of `count` clusters of the rows of `x`, or of [`MAX_CLUSTERED`] of them, with initial centres drawn from the
/// rows by `rng`.
pub(super) fn k_means(x: ArrayView2<'_, f64>, count: usize, rng: &mut impl Rng) -> Array2<f64> {
    let most = MAX_CLUSTERED.max(count);
    let drawn = (x.nrows() > most).then(|| x.select(Axis(0), &index::sample(rng, x.nrows(), most).into_vec()));
    let x = drawn.as_ref().map_or(x, |drawn| drawn.view());
    let mut centres = x.select(Axis(0), &index::sample(rng, x.nrows(), count).into_vec());
    for _ in 0..ROUNDS {
        let mut sums = Array2::<f64>::zeros(centres.dim());
        let mut members = vec![0.0; count];
        for row in x.rows() {
            let distances = centres.rows().into_iter().map(|centre| distance2(row, centre));
            let nearest = distances
                .enumerate()
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .map_or(0, |(c, _)| c);
            sums.row_mut(nearest).scaled_add(1.0, &row);
            members[nearest] += 1.0;
        }
        let mut moved = false;
        for ((mut centre, sum), &members) in centres.rows_mut().into_iter().zip(sums.rows()).zip(&members) {
            // A cluster without members stays where it is.
            if members > 0.0 {
                let mean = &sum / members;
                moved |= mean != centre;
                centre.assign(&mean);
            }
        }
        if !moved {
            break;
        }
    }
    centres
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{Seed, Stream};
    use ndarray::array;

    #[test]
    fn clusters_are_found() {
        let x = array![[0.0, 0.1], [0.1, 0.0], [0.0, 0.0], [5.0, 5.1], [5.1, 5.0], [5.0, 5.0]];
        for seed in 0..5 {
            let mut centres = k_means(x.view(), 2, &mut Seed(seed).rng(Stream::Start));
            if centres[[0, 0]] > centres[[1, 0]] {
                centres.invert_axis(Axis(0));
            }
            assert!((centres[[0, 0]] - 0.1 / 3.0).abs() < 1e-12 && (centres[[1, 1]] - 15.1 / 3.0).abs() < 1e-12);
        }
    }
}
