//! Ridge regression of standardised inputs, and the folds by which decoders choose its penalties.

use ndarray::{Array2, ArrayView2};

use super::ridge::{Regression, Ridge};
use crate::{
    dataset::{Dataset, DatasetError, Folds, Seed, SplitBy, Stream},
    network::NetworkError,
    numerics::mean,
};

/// Centre and scale of each feature. A feature that is constant, or nearly so, has the scale 0: its deviations are
/// rounding, and divided by their size they would turn a later change into an enormous one. A feature that varied much less
/// than others, such as an average over a rare pulse, keeps some of the difference for the same reason.
pub(crate) struct Standard {
    /// Means.
    pub centre: Vec<f64>,
    /// Reciprocal standard deviations, limited by [`Self::SMALLEST`].
    pub scale: Vec<f64>,
}

impl Standard {
    /// Deviation of a constant feature, relative to its largest absolute value.
    const CONSTANT: f64 = 1e-12;
    /// Smallest deviation by which a feature is divided, relative to the largest deviation of a feature.
    const SMALLEST: f64 = 0.1;

    /// Computes them for `of` the values (samples × features).
    ///
    /// # Errors
    /// If there are no values, or they overflow.
    pub fn fit(values: ArrayView2<'_, f64>, of: impl Fn(f64) -> f64) -> Result<Self, NetworkError> {
        if values.nrows() == 0 {
            return Err(NetworkError::Empty);
        }
        let (mut centre, mut deviations) = (Vec::new(), Vec::new());
        for feature in values.columns() {
            let feature = feature.mapv(&of);
            let mean = mean(feature.view());
            // Relative to the largest value, whose square may overflow.
            let largest = feature.fold(0.0_f64, |largest, value| largest.max(value.abs()));
            let off = feature.mapv(|value| (value - mean) / largest.max(f64::MIN_POSITIVE));
            let relative = off
                .mapv(|off| off * off / values.nrows() as f64)
                .iter()
                .sum::<f64>()
                .sqrt();
            centre.push(mean);
            deviations.push(if relative <= Self::CONSTANT {
                0.0
            } else {
                relative * largest
            });
        }
        let smallest = Self::SMALLEST * deviations.iter().copied().fold(0.0, f64::max);
        let scale = |&deviation: &f64| match deviation {
            0.0 => 0.0,
            _ => 1.0 / deviation.max(smallest),
        };
        let standard = Self {
            scale: deviations.iter().map(scale).collect(),
            centre,
        };
        let mut all = standard.centre.iter().chain(&deviations).chain(&standard.scale);
        if all.all(|value| value.is_finite()) {
            Ok(standard)
        } else {
            Err(NetworkError::NotConverged)
        }
    }

    /// Writes the standardised features of a sample with these values.
    pub fn write(&self, values: impl Iterator<Item = f64>, features: &mut [f64]) {
        for ((feature, value), (centre, scale)) in
            features.iter_mut().zip(values).zip(self.centre.iter().zip(&self.scale))
        {
            *feature = (value - centre) * scale;
        }
    }
}

/// Cross-validated ridge regression of `targets` (samples × targets) on standardised `inputs` (samples × inputs). Its map
/// takes the inputs as they are.
///
/// # Errors
/// If there are no samples, or the equations have no finite solution.
pub(crate) fn ridge(
    inputs: ArrayView2<'_, f64>,
    targets: ArrayView2<'_, f64>,
    folds: &Folds,
) -> Result<Ridge, NetworkError> {
    let standard = Standard::fit(inputs, |value| value)?;
    let offsets = Standard::fit(targets, |value| value)?.centre;
    let regression = Regression {
        samples: inputs.nrows(),
        features: inputs.ncols(),
        outputs: targets.ncols(),
        write: &|sample, features, outputs| {
            standard.write(inputs.row(sample).iter().copied(), features);
            // Squares of a large offset would hide the changes.
            let off = targets.row(sample).into_iter().zip(&offsets);
            outputs
                .iter_mut()
                .zip(off)
                .for_each(|(output, (target, offset))| *output = target - offset);
        },
        noise: Array2::zeros((0, inputs.ncols())),
    };
    let mut ridge = regression.ridge(Some(folds))?;
    for map in std::iter::once(&mut ridge.map).chain(&mut ridge.held_out) {
        for (t, mut column) in map.columns_mut().into_iter().enumerate() {
            column[inputs.ncols()] += offsets[t];
            for (i, (centre, scale)) in standard.centre.iter().zip(&standard.scale).enumerate() {
                column[i] *= scale;
                column[inputs.ncols()] -= centre * column[i];
            }
        }
    }
    Ok(ridge)
}

/// Folds by which a decoder chooses penalties and widths: blocks in the order of the samples between groups, or whole groups
/// if these are scattered. The fewer samples there are, the fewer a fold holds out: a twentieth, a tenth, or a fifth. There are
/// fewer folds if there are fewer groups. `None` for a single sample.
pub(super) fn folds(set: &Dataset) -> Option<Folds> {
    let samples = set.samples();
    let count = match samples {
        ..=50 => 20,
        51..=200 => 10,
        _ => 5,
    };
    let runs = set.groups().chunk_by(|one, next| one == next).count();
    let by = if runs == set.snapshots().len() {
        SplitBy::Time
    } else {
        SplitBy::Group
    };
    let divide = |folds| Folds::by(set, folds, by, &mut Seed(0).rng(Stream::Split));
    match divide(count) {
        Ok(folds) => Some(folds),
        Err(DatasetError::Folds { units, .. }) if units >= 2 => divide(units).ok(),
        // A single group.
        Err(_) if samples >= 2 => Some(Folds::consecutive(samples, count.min(samples))),
        Err(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::scene::standard_normal;

    #[test]
    fn constant_features_have_no_scale_and_extremes_have_one() {
        let mut rng = ChaCha8Rng::seed_from_u64(12);
        let x = Array2::from_shape_simple_fn((50, 1), || standard_normal(&mut rng));
        for (size, offset, varies) in [
            (1.0, 0.0, true),
            (0.0, 5.3, false),
            (0.0, 0.0, false),
            (1e-16, 5.3, false),
            (1e-9, 5.3, true),
            (1e-200, 0.0, true),
            (1e200, 0.0, true),
        ] {
            let values = x.mapv(|value| size * value + offset);
            let standard = Standard::fit(values.view(), |value| value).unwrap();
            assert_eq!(standard.scale[0] > 0.0, varies, "{size} {offset}");
            if varies {
                let mut scaled = [0.0];
                let square = |value: &f64| {
                    standard.write([*value].into_iter(), &mut scaled);
                    scaled[0] * scaled[0]
                };
                let variance = values.iter().map(square).sum::<f64>() / 50.0;
                assert!((variance - 1.0).abs() < 1e-6, "{size} {offset}: {variance}");
            }
        }
        let none = Array2::zeros((0, 2));
        assert!(matches!(
            Standard::fit(none.view(), |value| value),
            Err(NetworkError::Empty)
        ));
    }

    #[test]
    fn inputs_are_standardised_and_large_offsets_kept() {
        let inputs = Array2::from_shape_fn((60, 3), |(s, i)| {
            ((7 * s + 13 * i * s + i) as f64).sin() * 10.0_f64.powi(2 * i as i32)
        });
        let targets = Array2::from_shape_fn((60, 2), |(s, t)| match t {
            0 => 3.0 * inputs[[s, 0]] - 0.2 * inputs[[s, 2]] + 5.0,
            _ => inputs[[s, 1]] + 1e6,
        });
        let map = ridge(inputs.view(), targets.view(), &Folds::consecutive(60, 4))
            .unwrap()
            .map;
        for (found, expected) in [
            (map[[0, 0]], 3.0),
            (map[[1, 0]], 0.0),
            (map[[2, 0]], -0.2),
            (map[[3, 0]], 5.0),
            (map[[1, 1]], 1.0),
            (map[[3, 1]], 1e6),
        ] {
            assert!((found - expected).abs() < 1e-6, "{map}");
        }
    }

    #[test]
    fn folds_leave_groups_whole() {
        let set = |groups: Vec<usize>| {
            let values = Array2::zeros((groups.len(), 1));
            Dataset::new(values.clone(), values, None, groups).unwrap()
        };
        // Groups one after another, scattered, few of them, and a single one.
        for (groups, count) in [
            ((0..60).map(|s| s / 4).collect::<Vec<_>>(), 10),
            ((0..45).collect(), 20),
            ((0..300).map(|s| s / 4).collect(), 5),
            ((0..60).map(|s| s % 15).collect(), 10),
            ((0..60).map(|s| s % 3).collect(), 3),
        ] {
            let set = set(groups.clone());
            let folds = folds(&set).unwrap();
            assert_eq!(folds.count(), count);
            for fold in 0..count {
                let others = folds.without(&[fold]);
                let is_elsewhere = |sample: &usize| others.iter().any(|&other| groups[other] == groups[*sample]);
                assert!(!folds.test(fold).iter().any(is_elsewhere), "{groups:?}");
            }
        }
        assert_eq!(folds(&set(vec![7; 60])).unwrap().test(0), Vec::from_iter(0..6));
        assert!(folds(&set(vec![7])).is_none());
    }
}
