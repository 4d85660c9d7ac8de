use ndarray::{Array2, Axis, Slice};

use super::{
    AffineLayer, DecodeError, Decoder, Description, Layer, LayeredMap, NotDescribed, least_squares::fit_least_squares,
    linear_fit::LinearFit, units::Units,
};
use crate::{
    dataset::Dataset,
    network::{InputChoice, InputScaling, Inputs, MinMax, Quantity, ScalingError, channel_noise},
    scene::NoiseSource,
};

/// An affine map from readings to targets, with the scalings on both sides folded into its matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct AffineMap {
    quantity: Quantity,
    /// Centre of each channel, subtracted from its values.
    centre: Vec<f64>,
    /// Matrix from centred channels to targets (channels × varying targets), in standard layout.
    matrix: Array2<f64>,
    /// Targets for all channels at their centres.
    base: Vec<f64>,
    /// Indices of the varying targets.
    varying: Vec<usize>,
    /// Buffer for the centred channels of one row.
    values: Vec<f64>,
    /// Buffer for the changes of the varying targets in one row.
    changes: Vec<f64>,
}

impl AffineMap {
    /// Fits the map to `training` by least squares, on `quantity` of the readings.
    ///
    /// # Errors
    /// If values cannot be scaled.
    pub fn least_squares(training: &Dataset, quantity: Quantity) -> Result<Self, ScalingError> {
        let values = training.readings().mapv(|reading| quantity.of(reading));
        let inputs = Inputs::new(quantity, InputScaling::MinMax(MinMax::fit(values.view())?));
        let outputs = MinMax::fit(training.targets())?;
        let coefficients = fit_least_squares(training, &inputs, &outputs)?;
        Ok(Self::folded(&inputs, &coefficients, &outputs))
    }

    /// Fits the map to `training` by ridge regression, each target with the penalty of its least leave-one-out error;
    /// `unseen` is as in [`Inputs::fit`].
    ///
    /// # Errors
    /// If values cannot be scaled.
    pub fn ridge(training: &Dataset, choice: InputChoice, unseen: NoiseSource) -> Result<Self, ScalingError> {
        let inputs = Inputs::fit_all(choice, training.readings())?;
        let outputs = MinMax::fit(training.targets())?;
        let y = outputs.scale(training.targets());
        let units = Units::of(training, inputs.of(training.readings()), y);
        let changes = inputs.changes_of(&channel_noise(inputs.quantity(), training.readings(), unseen));
        let fit = LinearFit::new(&inputs, &units, changes.view())?;
        Ok(Self::folded(&inputs, &fit.coefficients(), &outputs))
    }

    /// Folds the scalings into `coefficients` (inputs + 1 × varying outputs, the constant last).
    fn folded(inputs: &Inputs, coefficients: &Array2<f64>, outputs: &MinMax) -> Self {
        let (centre, to_inputs) = inputs.affine();
        let ranges = outputs.middles_and_half_widths();
        let varying = outputs.varying();
        let mut base: Vec<f64> = ranges.iter().map(|range| range.0).collect();
        let n = inputs.count();
        let mut matrix = to_inputs.t().dot(&coefficients.slice_axis(Axis(0), Slice::from(..n)));
        for (output, &target) in varying.iter().enumerate() {
            let half_width = ranges[target].1;
            matrix.column_mut(output).mapv_inplace(|value| value * half_width);
            base[target] += coefficients[[n, output]] * half_width;
        }
        Self {
            quantity: inputs.quantity(),
            values: vec![0.0; centre.len()],
            centre,
            matrix: matrix.as_standard_layout().into_owned(),
            base,
            changes: vec![0.0; varying.len()],
            varying,
        }
    }
}

impl AffineMap {
    /// Writes the centred channels. Returns `true` if all readings are valid: found out in the same pass, which a separate
    /// one would lengthen by 6 % of decoding.
    #[inline(always)]
    fn read(&mut self, readings: &[f64], of: impl Fn(f64) -> f64) -> bool {
        let mut is_sound = true;
        for ((value, &reading), centre) in self.values.iter_mut().zip(readings).zip(&self.centre) {
            *value = of(reading) - centre;
            is_sound &= self.quantity.accepts(reading);
        }
        is_sound
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
        let is_sound = match self.quantity {
            Quantity::Conductance => self.read(readings, |ohm| 1.0 / ohm),
            quantity => self.read(readings, |reading| quantity.of(reading)),
        };
        if !is_sound {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        decoupling::decode_set,
        network::ScalingChoice,
        scene::Scene,
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
            let ridge = AffineMap::ridge(&set, InputChoice::BEST, NoiseSource::default()).unwrap();
            for mut map in [least_squares, ridge] {
                let answer = decode_set(&mut map, &other).unwrap();
                assert!(answer.iter().all(|value| value.is_finite()));
            }
        }
    }

    #[test]
    fn targets_that_are_affine_in_the_quantity_come_back_by_ridge() {
        let set = with_target(&draw("1x4_2x12", 60), |ohm| 4.0 + 20.0 / ohm[3] - 7.0 / ohm[8]);
        for scaling in [ScalingChoice::Whitening, ScalingChoice::MinMax] {
            let choice = InputChoice {
                scaling,
                ..InputChoice::BEST
            };
            let answer = decode_set(
                &mut AffineMap::ridge(&set, choice, NoiseSource::default()).unwrap(),
                &set,
            )
            .unwrap();
            for (answer, truth) in answer.rows().into_iter().zip(set.targets().rows()) {
                assert_eq!(answer[0], truth[0], "what does not vary stays");
                assert!((answer[2] - truth[2]).abs() < 1e-6, "{} {}", answer[2], truth[2]);
            }
        }
    }

    #[test]
    fn readings_outside_the_quantitys_domain_are_named() {
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
}
