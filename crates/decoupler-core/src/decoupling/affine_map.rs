use faer::{Mat, Side, linalg::solvers::Solve};
use glam::DVec3;
use ndarray::{Array2, Axis};

use super::{
    Precision,
    equations::Range,
    program::{Builder, Program},
    ridge::Regression,
    standardised::{Standard, folds},
};
use crate::{
    dataset::Dataset,
    network::{MinMax, NetworkError, Quantity, channel_noise},
    scene::NoiseSource,
    sensor::{Axes, RowConductance, SensorModel},
};

impl Program {
    /// The mean targets over all samples, whatever the readings are: the baseline.
    ///
    /// # Panics
    /// If there are no samples.
    pub fn mean(training: &Dataset) -> Self {
        let targets = training.targets();
        // As the mean of deviations, so that a large offset does not hide small changes.
        let first = targets.row(0);
        let off = (&targets - &first).mean_axis(Axis(0));
        let mean = off.expect("a training set has samples") + first;
        let mut map = Array2::zeros((training.channels() + 1, mean.len()));
        map.row_mut(training.channels()).assign(&mean);
        Self::of_map(&map, Quantity::Raw, &vec![0.0; training.channels()])
    }

    /// Fits an affine map to `training` by least squares, on `quantity` of the readings. Of the maps that fit equally well it
    /// is the one of minimum norm.
    ///
    /// # Errors
    /// If values cannot be scaled.
    pub fn least_squares(training: &Dataset, quantity: Quantity) -> Result<Self, NetworkError> {
        Self::affine(training, quantity, NoiseSource::default(), |regression| {
            regression.least_squares()
        })
    }

    /// Fits an affine map to `training` by ridge regression on the standardised `quantity` of the readings, with the penalty
    /// of each target chosen by cross-validation on blocks of samples, or on whole groups; `unseen` is as in
    /// [`Inputs::fit`](crate::network::Inputs::fit).
    ///
    /// # Errors
    /// If values cannot be scaled.
    pub fn ridge(training: &Dataset, quantity: Quantity, unseen: NoiseSource) -> Result<Self, NetworkError> {
        let folds = folds(training);
        Self::affine(training, quantity, unseen, |regression| {
            Ok(regression.ridge(folds.as_ref())?.map)
        })
    }

    fn affine(
        training: &Dataset,
        quantity: Quantity,
        unseen: NoiseSource,
        map: impl FnOnce(&Regression<'_>) -> Result<Array2<f64>, NetworkError>,
    ) -> Result<Self, NetworkError> {
        let readings = training.readings();
        quantity.check(readings)?;
        let standard = Standard::fit(readings, |reading| quantity.of(reading))?;
        let outputs = MinMax::fit(training.targets())?;
        let (ranges, varying) = (outputs.middles_and_half_widths(), outputs.varying());
        let channels = training.channels();
        let map = map(&Regression {
            samples: training.samples(),
            features: channels,
            outputs: varying.len(),
            write: &|sample, features, targets| {
                let values = readings.row(sample).into_iter().map(|&reading| quantity.of(reading));
                standard.write(values, features);
                for (scaled, &target) in targets.iter_mut().zip(&varying) {
                    *scaled = (training.sample_targets(sample)[target] - ranges[target].0) / ranges[target].1;
                }
            },
            noise: channel_noise(quantity, readings, unseen).changes(&standard.scale),
        })?;
        let weight = |(channel, output): (usize, usize)| map[[channel, output]] * standard.scale[channel];
        let weights = Array2::from_shape_fn((channels, varying.len()), weight);
        let mut builder = Builder::new(channels);
        let changes = builder.changes(quantity, &standard.centre, Precision::Double);
        let scaled = builder.affine_of(&changes, weights, &map.row(channels).to_vec());
        let targets = builder.restored(scaled, &outputs);
        Ok(builder.finish(targets))
    }
}

/// Affine estimate of the compressions of a row-wire's nodes from its readings, with the minimum expected squared error
/// if every node is pressed independently and uniformly over the stroke: a starting point for solving Eq. (2).
///
/// s_k is a sum over nodes. In x from −1 to 1 over the stroke, the contribution of a node is its mean plus
/// `a P₁(x) + b P₂(x) + c P₃(x)` with Legendre polynomials, whose variances are 1/3, 1/5 and 1/7 and which are
/// uncorrelated. With A, B and C the coefficients of all nodes (readings × nodes), the estimate is
/// `Aᵀ/3 (A Aᵀ/3 + B Bᵀ/5 + C Cᵀ/7)⁻¹ (s − s̄)`.
#[derive(Clone, Debug)]
pub(super) struct AffineStart {
    middle_mm: f64,
    /// g/s̄ in ohm.
    means_ohm: Vec<f64>,
    /// Nodes × readings, in mm per relative change of the conductance.
    gains_mm: Vec<f64>,
}

/// Variance added to each direction, relative to the sum of all variances, to make the matrix invertible.
const SMALLEST_VARIANCE: f64 = 1e-13;

impl AffineStart {
    /// Size in bytes of the estimate for one row-wire.
    pub(super) fn bytes(model: &SensorModel) -> usize {
        (model.scale.nodes_per_row() + 1) * model.scale.columns() * size_of::<f64>()
    }

    /// Computes the estimate for row-wire `row`; the middle of `stroke` if the matrix is singular.
    pub(super) fn new(model: &SensorModel, row: usize, stroke: Range) -> Self {
        let (readings, nodes) = (model.scale.columns(), model.scale.nodes_per_row());
        let half_mm = 0.5 * stroke.width();
        // Three-point Gauss quadrature, exact to the fifth degree.
        let points = [
            (-(0.6_f64.sqrt()), 5.0 / 9.0),
            (0.0, 8.0 / 9.0),
            (0.6_f64.sqrt(), 5.0 / 9.0),
        ];
        let mut mean = vec![0.0; readings];
        // Legendre coefficients of the derivatives; those of the contributions follow by integration.
        let mut slopes = [0; 3].map(|_| Mat::<f64>::zeros(readings, nodes));
        let mut conductance = RowConductance::new(model, Axes::Z);
        for (x, weight) in points {
            let pressed = vec![DVec3::Z * (stroke.middle() + half_mm * x); nodes];
            conductance.evaluate(model, row, &pressed);
            for (mean, sum) in mean.iter_mut().zip(conductance.sums()) {
                *mean += 0.5 * weight * sum;
            }
            let polynomials = [0.5, 1.5 * x, 2.5 * (1.5 * x * x - 0.5)];
            for (slopes, polynomial) in slopes.iter_mut().zip(polynomials) {
                for node in 0..nodes {
                    for (reading, derivative) in conductance.derivatives(node).iter().enumerate() {
                        slopes[(reading, node)] += half_mm * weight * polynomial * derivative;
                    }
                }
            }
        }
        let relative = |of: &dyn Fn(usize, usize) -> f64| Mat::from_fn(readings, nodes, |k, i| of(k, i) / mean[k]);
        let a = relative(&|k, i| slopes[0][(k, i)] - slopes[2][(k, i)] / 5.0);
        let b = relative(&|k, i| slopes[1][(k, i)] / 3.0);
        let c = relative(&|k, i| slopes[2][(k, i)] / 5.0);
        let third = &a * faer::Scale(1.0 / 3.0);
        let mut variance = &third * a.transpose()
            + &b * faer::Scale(1.0 / 5.0) * b.transpose()
            + &c * faer::Scale(1.0 / 7.0) * c.transpose();
        let total: f64 = (0..readings).map(|k| variance[(k, k)]).sum();
        for k in 0..readings {
            variance[(k, k)] += SMALLEST_VARIANCE * total;
        }
        let gains = variance.llt(Side::Lower).ok().map(|factor| factor.solve(&third));
        let gain = |place: usize| {
            let (node, reading) = (place / readings, place % readings);
            gains.as_ref().map_or(0.0, |gains| half_mm * gains[(reading, node)])
        };
        Self {
            middle_mm: stroke.middle(),
            means_ohm: mean.iter().map(|mean| model.resistivity_ohm_per_mm / mean).collect(),
            gains_mm: (0..nodes * readings).map(gain).collect(),
        }
    }

    /// Writes the estimate for readings in ohm, before it is clamped to the stroke.
    pub(super) fn estimate(&self, readings_ohm: &[f64], compressions_mm: &mut [f64]) {
        compressions_mm.fill(self.middle_mm);
        let readings = self.means_ohm.len();
        for (compression, gains) in compressions_mm.iter_mut().zip(self.gains_mm.chunks_exact(readings)) {
            let parts = gains.iter().zip(readings_ohm).zip(&self.means_ohm);
            *compression += parts.map(|((gain, ohm), mean)| gain * (mean - ohm) / ohm).sum::<f64>();
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::{
        dataset::{Dataset, Seed, Stream},
        decoupling::{ProgramDecoder, decode_set},
        scene::{Scene, standard_normal},
        sensor::SensorModel,
    };

    fn draw(scale: &str, samples: usize) -> Dataset {
        let model = SensorModel::new(scale.parse().unwrap());
        Dataset::simulate(&model, &Scene::default(), samples, &mut Seed(0).rng(Stream::Training)).unwrap()
    }

    /// Returns `set` with its third target replaced by a function of the readings.
    fn answers(map: Program, set: &Dataset) -> Array2<f64> {
        decode_set(&mut ProgramDecoder::new(map), set).unwrap()
    }

    fn with_target(set: &Dataset, target: impl Fn(&[f64]) -> f64) -> Dataset {
        let mut targets = set.targets().to_owned();
        for sample in 0..set.samples() {
            targets[[sample, 2]] = target(set.sample_readings(sample));
        }
        let row_wires: Vec<usize> = (0..set.samples()).map(|sample| set.row_wire(sample).unwrap()).collect();
        Dataset::new(
            set.readings().to_owned(),
            targets,
            Some(&row_wires),
            set.groups().to_vec(),
        )
        .unwrap()
    }

    #[test]
    fn an_affine_relation_is_found_exactly() {
        let set = with_target(&draw("10x6_3x18", 300), |ohm| 3.0 * ohm[0] - 0.5 * ohm[17] + 4.0);
        let answer = answers(Program::least_squares(&set, Quantity::Resistance).unwrap(), &set);
        for (ours, truth) in answer.column(2).iter().zip(set.targets().column(2)) {
            assert!((ours - truth).abs() < 1e-10 * truth.abs());
        }
    }

    #[test]
    fn too_few_or_duplicate_samples_give_a_finite_map() {
        let other = draw("10x6_3x18", 10);
        for set in [draw("1x6_3x18", 1), draw("1x6_3x18", 2), other.select(&[3; 50])] {
            let least_squares = Program::least_squares(&set, Quantity::Resistance).unwrap();
            let ridge = Program::ridge(&set, Quantity::Conductance, NoiseSource::default()).unwrap();
            for map in [least_squares, ridge] {
                assert!(answers(map, &other).iter().all(|value| value.is_finite()));
            }
        }
    }

    #[test]
    fn ridge_recovers_targets_affine_in_the_quantity() {
        let set = with_target(&draw("1x4_2x12", 60), |ohm| 4.0 + 20.0 / ohm[3] - 7.0 / ohm[8]);
        let map = Program::ridge(&set, Quantity::Conductance, NoiseSource::default()).unwrap();
        let answer = answers(map, &set);
        for (answer, truth) in answer.rows().into_iter().zip(set.targets().rows()) {
            assert_eq!(answer[0], truth[0], "constant targets keep their value");
            assert!((answer[2] - truth[2]).abs() < 1e-6, "{} {}", answer[2], truth[2]);
        }
    }

    #[test]
    fn overflow_is_an_error() {
        let readings = Array2::from_shape_fn((3, 1), |(s, _)| [f64::MAX, -f64::MAX, 3.0][s]);
        let targets = Array2::from_shape_fn((3, 1), |(s, _)| s as f64);
        let set = Dataset::new(readings, targets, None, vec![0, 1, 2]).unwrap();
        assert_eq!(
            Program::least_squares(&set, Quantity::Raw),
            Err(NetworkError::NotConverged)
        );
    }

    /// Two channels that are constant apart from a rare pulse (one also from rounding) and their decaying averages: in
    /// training they carry no information, later they vary.
    #[test]
    fn averages_of_channels_that_were_constant_leave_ridge_better_than_the_mean() {
        let draw = |samples: usize, is_training: bool, seed: u64| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut averages = [[0.0; 4]; 2];
            let mut readings = Array2::zeros((samples, 13));
            let mut targets = Array2::zeros((samples, 1));
            for sample in 0..samples {
                for channel in 0..3 {
                    readings[[sample, channel]] = standard_normal(&mut rng);
                }
                let is_pressed = !is_training && sample % 50 < 25;
                let pulse = f64::from(u8::from(is_training && (500..503).contains(&sample)));
                let values = [
                    pulse + f64::from(u8::from(is_pressed)),
                    5.3 * (1.0 + 1e-16 * standard_normal(&mut rng)) + f64::from(u8::from(is_pressed)),
                ];
                for (place, (value, averages)) in values.into_iter().zip(&mut averages).enumerate() {
                    readings[[sample, 3 + 5 * place]] = value;
                    for (k, (average, span)) in averages.iter_mut().zip([3.0, 10.0, 30.0, 100.0]).enumerate() {
                        *average = if sample == 0 {
                            value
                        } else {
                            *average + (value - *average) / span
                        };
                        readings[[sample, 4 + 5 * place + k]] = *average;
                    }
                }
                targets[[sample, 0]] =
                    readings[[sample, 0]] - 0.5 * readings[[sample, 1]] + 0.3 * standard_normal(&mut rng);
            }
            Dataset::new(readings, targets, None, (0..samples).collect()).unwrap()
        };
        let (training, test) = (draw(1000, true, 1), draw(500, false, 2));
        let map = Program::ridge(&training, Quantity::Raw, NoiseSource::default()).unwrap();
        let rmse = |program: Program| {
            let off = answers(program, &test) - test.targets();
            off.mapv(|error| error * error).mean().unwrap().sqrt()
        };
        // The noise of the targets is 0.3.
        let (ours, mean) = (rmse(map), rmse(Program::mean(&training)));
        assert!(ours < mean, "{ours} {mean}");
    }

    /// The mean distance of a uniform compression from the middle is a quarter of the stroke.
    #[test]
    fn the_estimate_is_within_a_few_thousandths_of_the_stroke() {
        for array in ["10x6_3x18", "10x10_5x30", "2x1_1x3"] {
            let model = SensorModel::new(array.parse().unwrap());
            let rows = model.scale.rows();
            let set = Dataset::simulate(&model, &Scene::default(), 30 * rows, &mut Seed(0).rng(Stream::Test)).unwrap();
            let stroke = Range {
                lowest: 0.0,
                highest: 1.0,
            };
            let starts: Vec<AffineStart> = (0..rows).map(|row| AffineStart::new(&model, row, stroke)).collect();
            let mut errors_mm = 0.0;
            let mut estimate_mm = vec![0.0; model.scale.nodes_per_row()];
            for sample in 0..set.samples() {
                starts[set.row_index(sample)].estimate(set.sample_readings(sample), &mut estimate_mm);
                let truth = set.sample_targets(sample).chunks_exact(3);
                errors_mm += estimate_mm
                    .iter()
                    .zip(truth)
                    .map(|(ours, truth)| (ours - (5.0 - truth[2])).abs())
                    .sum::<f64>();
            }
            let mean_mm = errors_mm / (set.samples() * estimate_mm.len()) as f64;
            assert!(mean_mm < 0.01, "{array}: {mean_mm}");
        }
    }
}
