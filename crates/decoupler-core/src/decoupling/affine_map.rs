use faer::{Mat, Side, linalg::solvers::Solve};
use glam::DVec3;
use ndarray::{Array1, Array2, Axis};
use serde::{Deserialize, Serialize};

use super::{
    AffineLayer, DecodeError, Decoder, Description, Layer, LayeredMap, NotDescribed,
    equations::Range,
    ridge::{Regression, Standard, folds},
};
use crate::{
    dataset::Dataset,
    network::{MinMax, NetworkError, Quantity, channel_noise},
    scene::NoiseSource,
    sensor::{Axes, RowConductance, SensorModel},
};

/// An affine map from readings to targets, with the input and output scalings folded into its matrix.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AffineMap {
    quantity: Quantity,
    /// Centre of each channel, subtracted from its values.
    centre: Vec<f64>,
    /// Matrix from centred channels to targets (channels × varying targets), in standard layout.
    matrix: Array2<f64>,
    /// Targets for readings at the channel centres.
    base: Vec<f64>,
    /// Indices of the varying targets.
    varying: Vec<usize>,
    /// Buffer for the centred channels of one row.
    values: Vec<f64>,
    /// Buffer for the offsets of the varying targets in one row.
    changes: Vec<f64>,
}

impl AffineMap {
    /// Fits the map to `training` by least squares, on `quantity` of the readings. Of the maps that fit equally well it is
    /// the one of minimum norm.
    ///
    /// # Errors
    /// If values cannot be scaled.
    pub fn least_squares(training: &Dataset, quantity: Quantity) -> Result<Self, NetworkError> {
        Self::fit(training, quantity, NoiseSource::default(), |regression| {
            regression.least_squares()
        })
    }

    /// Fits the map to `training` by ridge regression on the standardised `quantity` of the readings, with the penalty of
    /// each target chosen by cross-validation on blocks of samples, or on whole groups; `unseen` is as in
    /// [`Inputs::fit`](crate::network::Inputs::fit).
    ///
    /// # Errors
    /// If values cannot be scaled.
    pub fn ridge(training: &Dataset, quantity: Quantity, unseen: NoiseSource) -> Result<Self, NetworkError> {
        let folds = folds(training);
        Self::fit(training, quantity, unseen, |regression| {
            Ok(regression.ridge(folds.as_ref())?.map)
        })
    }

    fn fit(
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
        let mut base: Vec<f64> = ranges.iter().map(|range| range.0).collect();
        for (output, &target) in varying.iter().enumerate() {
            base[target] += map[[channels, output]] * ranges[target].1;
        }
        Ok(Self {
            quantity,
            values: vec![0.0; channels],
            matrix: Array2::from_shape_fn((channels, varying.len()), |(channel, output)| {
                map[[channel, output]] * standard.scale[channel] * ranges[varying[output]].1
            }),
            centre: standard.centre,
            base,
            changes: vec![0.0; varying.len()],
            varying,
        })
    }
}

impl AffineMap {
    /// Writes the centred channels. Returns `true` if all readings are valid; a separate pass for this check would
    /// take 6 % more time.
    #[inline(always)]
    fn read(&mut self, readings: &[f64], of: impl Fn(f64) -> f64) -> bool {
        let mut all_valid = true;
        for ((value, &reading), centre) in self.values.iter_mut().zip(readings).zip(&self.centre) {
            *value = of(reading) - centre;
            all_valid &= self.quantity.accepts(reading);
        }
        all_valid
    }
}

impl Decoder for AffineMap {
    fn channels(&self) -> usize {
        self.centre.len()
    }

    fn outputs(&self) -> usize {
        self.base.len()
    }

    fn decode_row(&mut self, _row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        let all_valid = match self.quantity {
            Quantity::Conductance => self.read(readings, |ohm| 1.0 / ohm),
            quantity => self.read(readings, |reading| quantity.of(reading)),
        };
        if !all_valid {
            DecodeError::check_for(self.quantity, readings)?;
        }
        self.changes.fill(0.0);
        let width = self.changes.len();
        let matrix = self.matrix.as_slice().expect("made in standard layout");
        for (channel, value) in self.values.iter().enumerate() {
            let row = &matrix[channel * width..(channel + 1) * width];
            for (change, weight) in self.changes.iter_mut().zip(row) {
                *change += value * weight;
            }
        }
        targets.copy_from_slice(&self.base);
        for (&target, change) in self.varying.iter().zip(&self.changes) {
            targets[target] += change;
        }
        Ok(())
    }

    fn description(&self) -> Result<Description, NotDescribed> {
        let map = AffineLayer::of_varying(&self.matrix, &self.varying, &self.base);
        Ok(Description::of_maps(vec![LayeredMap {
            quantity: self.quantity,
            centre: self.centre.clone(),
            layers: vec![Layer::Affine(map)],
        }]))
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

    /// Describes the coordinates (3·M2) of the nodes of row-wire `row` at the estimate, before they are clamped to
    /// the stroke.
    pub(super) fn description(&self, model: &SensorModel, row: usize) -> LayeredMap {
        let (readings, nodes) = (self.means_ohm.len(), model.scale.nodes_per_row());
        let middles = (0..nodes).flat_map(|node| model.displaced_mm(row, node, DVec3::Z * self.middle_mm).to_array());
        let weight = |(reading, coordinate): (usize, usize)| match coordinate % 3 {
            // z is upwards, and (mean − R)/R is the mean times the change of the conductance.
            2 => -self.gains_mm[coordinate / 3 * readings + reading] * self.means_ohm[reading],
            _ => 0.0,
        };
        LayeredMap {
            quantity: Quantity::Conductance,
            centre: self.means_ohm.iter().map(|ohm| 1.0 / ohm).collect(),
            layers: vec![Layer::Affine(AffineLayer {
                weights: Array2::from_shape_fn((readings, 3 * nodes), weight),
                biases: middles.collect(),
            })],
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

/// Decoder that always answers the mean targets of the training set: the baseline.
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
        let targets = training.targets();
        // As the mean of deviations, so that a large offset does not hide small changes.
        let first = targets.row(0);
        let off = (&targets - &first).mean_axis(Axis(0));
        Self {
            channels: training.channels(),
            targets: off.expect("a training set has samples") + first,
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

#[cfg(test)]
mod tests {
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::{
        dataset::{Dataset, Seed, Stream},
        decoupling::decode_set,
        scene::{Scene, standard_normal},
        sensor::SensorModel,
    };

    fn draw(scale: &str, samples: usize) -> Dataset {
        let model = SensorModel::new(scale.parse().unwrap());
        Dataset::simulate(&model, &Scene::default(), samples, &mut Seed(0).rng(Stream::Training)).unwrap()
    }

    /// Returns `set` with its third target replaced by a function of the readings.
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
        let mut map = AffineMap::least_squares(&set, Quantity::Resistance).unwrap();
        let answer = decode_set(&mut map, &set).unwrap();
        for (ours, truth) in answer.column(2).iter().zip(set.targets().column(2)) {
            assert!((ours - truth).abs() < 1e-10 * truth.abs());
        }
    }

    #[test]
    fn too_few_or_duplicate_samples_give_a_finite_map() {
        let other = draw("10x6_3x18", 10);
        for set in [draw("1x6_3x18", 1), draw("1x6_3x18", 2), other.select(&[3; 50])] {
            let least_squares = AffineMap::least_squares(&set, Quantity::Resistance).unwrap();
            let ridge = AffineMap::ridge(&set, Quantity::Conductance, NoiseSource::default()).unwrap();
            for mut map in [least_squares, ridge] {
                let answer = decode_set(&mut map, &other).unwrap();
                assert!(answer.iter().all(|value| value.is_finite()));
            }
        }
    }

    #[test]
    fn ridge_recovers_targets_affine_in_the_quantity() {
        let set = with_target(&draw("1x4_2x12", 60), |ohm| 4.0 + 20.0 / ohm[3] - 7.0 / ohm[8]);
        let mut map = AffineMap::ridge(&set, Quantity::Conductance, NoiseSource::default()).unwrap();
        let answer = decode_set(&mut map, &set).unwrap();
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
            AffineMap::least_squares(&set, Quantity::Raw),
            Err(NetworkError::NotConverged)
        );
    }

    #[test]
    fn readings_outside_the_domain_are_refused() {
        let set = draw("1x4_2x12", 30);
        let mut readings = set.sample_readings(0).to_vec();
        readings[5] = -1.0;
        for (quantity, is_refused) in [
            (Quantity::Resistance, true),
            (Quantity::Conductance, true),
            (Quantity::Raw, false),
        ] {
            let mut map = AffineMap::least_squares(&set, quantity).unwrap();
            let result = map.decode(&readings, &mut [0.0; 12]);
            assert_eq!(result.is_err(), is_refused, "{quantity}");
            if let Err(error) = result {
                assert!(error.to_string().starts_with("row 1, reading 6: -1"), "{error}");
            }
        }
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
        let mut map = AffineMap::ridge(&training, Quantity::Raw, NoiseSource::default()).unwrap();
        let rmse = |decoder: &mut dyn Decoder| {
            let off = decode_set(decoder, &test).unwrap() - test.targets();
            off.mapv(|error| error * error).mean().unwrap().sqrt()
        };
        // The noise of the targets is 0.3.
        let (ours, mean) = (rmse(&mut map), rmse(&mut TrainingMean::fit(&training)));
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
