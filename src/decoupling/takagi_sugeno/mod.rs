//! Fuzzy rules with affine consequents.

mod antecedents;
mod consequents;
mod selection;

use ndarray::{Array2, Axis};
use rand::Rng;

use self::antecedents::normalise;
use super::frame::RowMap;
use crate::{
    dataset::Dataset,
    network::{InputChoice, Inputs, MinMax, Quantity, ScalingChoice, ScalingError},
};

/// A fuzzy system of Takagi and Sugeno (1985): rules "if the readings x are near centre i, then the coordinates are
/// Cᵢ·x + dᵢ", blended by their normalised firing strengths.
///
/// The antecedents are Gaussian memberships on whitened readings, centred on clusters of the training samples; the
/// consequents of all rules are found together by least squares with a small ridge penalty. A cross-validation chooses the
/// number of rules, the width of the memberships, how many inputs they look at, and the penalty.
#[derive(Clone, Debug)]
pub struct TakagiSugeno {
    quantity: Quantity,
    /// What each channel is taken relative to.
    centre: Vec<f64>,
    /// Logarithms of the memberships from centred channels, the whitening folded in: (M4 + 1) × rules, the constant last.
    antecedents: Array2<f64>,
    /// Coordinates in millimetres from centred channels, the scalings folded in: for each rule (M4 + 1) × varying
    /// coordinates, the constant last.
    consequents: Array2<f64>,
    /// The middle of every coordinate, which constant ones keep.
    middles_mm: Vec<f64>,
    /// Which coordinates vary.
    varying: Vec<usize>,
    /// Centred channels and a 1.
    values: Vec<f64>,
    strengths: Vec<f64>,
    changes_mm: Vec<f64>,
}

impl TakagiSugeno {
    /// Fits to a training set, on this quantity of the readings, whitened; `noise` as in [`Inputs::fit`]; `rng` chooses
    /// the folds of the cross-validation and where clusters begin.
    ///
    /// # Errors
    /// Values that cannot be scaled.
    pub fn fit(training: &Dataset, quantity: Quantity, noise: f64, rng: &mut impl Rng) -> Result<Self, ScalingError> {
        let scaling = ScalingChoice::Whitening;
        let inputs = Inputs::fit(
            InputChoice { quantity, scaling },
            training.resistances_ohm.view(),
            noise,
        )?;
        let outputs = MinMax::fit(training.coordinates_mm.view())?;
        let x = inputs.of(training.resistances_ohm.view());
        let y = outputs.scale(training.coordinates_mm.view());
        let (antecedents, ridge) = selection::choose(x.view(), y.view(), rng);
        let scaled = consequents::fit_consequents(&antecedents, x.view(), y.view(), ridge);
        Ok(Self::new(&inputs, &antecedents, &scaled, &outputs))
    }

    /// Folds the scalings into the rules.
    fn new(inputs: &Inputs, antecedents: &antecedents::Antecedents, scaled: &Array2<f64>, outputs: &MinMax) -> Self {
        let (centre, to_inputs) = inputs.affine();
        let (channels, n, rules) = (centre.len(), inputs.count(), antecedents.rules());
        let (slopes, offsets) = antecedents.logarithms(n);
        let slopes = slopes.dot(&to_inputs);
        let ranges = outputs.middles_and_half_widths();
        let varying = outputs.varying();
        let mut consequents = Array2::zeros((rules * (channels + 1), varying.len()));
        let of_rules = consequents.axis_chunks_iter_mut(Axis(0), channels + 1);
        for (mut folded, scaled) in of_rules.zip(scaled.axis_chunks_iter(Axis(0), n + 1)) {
            let (gains, constant) = scaled.split_at(Axis(0), n);
            let (mut folded_gains, mut folded_constant) = folded.view_mut().split_at(Axis(0), channels);
            folded_gains.assign(&to_inputs.t().dot(&gains));
            folded_constant.assign(&constant);
        }
        for (mut column, &coordinate) in consequents.columns_mut().into_iter().zip(&varying) {
            column *= ranges[coordinate].1;
        }
        let mut values = vec![0.0; channels];
        values.push(1.0);
        Self {
            quantity: inputs.quantity(),
            centre,
            antecedents: Array2::from_shape_fn((channels + 1, rules), |(channel, rule)| {
                slopes.get((rule, channel)).copied().unwrap_or(offsets[rule])
            }),
            consequents,
            middles_mm: ranges.iter().map(|range| range.0).collect(),
            changes_mm: vec![0.0; varying.len()],
            varying,
            values,
            strengths: vec![0.0; rules],
        }
    }

    /// Number of rules.
    pub fn rules(&self) -> usize {
        self.strengths.len()
    }
}

impl RowMap for TakagiSugeno {
    fn map(&mut self, readings_ohm: &[f64], coordinates_mm: &mut [f64]) {
        for ((value, &ohm), centre) in self.values.iter_mut().zip(readings_ohm).zip(&self.centre) {
            *value = self.quantity.of(ohm) - centre;
        }
        let in_order = "made in standard layout";
        let antecedents = self.antecedents.as_slice().expect(in_order);
        let consequents = self.consequents.as_slice().expect(in_order);
        self.strengths.fill(0.0);
        add_products(&mut self.strengths, &self.values, 1.0, antecedents);
        normalise(&mut self.strengths);
        self.changes_mm.fill(0.0);
        let of_rule = self.values.len() * self.changes_mm.len();
        for (rule, &strength) in self.strengths.iter().enumerate() {
            if strength > 0.0 {
                let consequents = &consequents[rule * of_rule..(rule + 1) * of_rule];
                add_products(&mut self.changes_mm, &self.values, strength, consequents);
            }
        }
        coordinates_mm.copy_from_slice(&self.middles_mm);
        for (&coordinate, &change) in self.varying.iter().zip(&self.changes_mm) {
            // Readings of 1e300 times those of the training set overflow.
            if change.is_finite() {
                coordinates_mm[coordinate] += change;
            }
        }
    }
}

/// Adds `factor` · values · matrix to `sums`, the matrix values × sums, row by row.
fn add_products(sums: &mut [f64], values: &[f64], factor: f64, matrix: &[f64]) {
    if sums.is_empty() {
        return;
    }
    for (value, row) in values.iter().zip(matrix.chunks_exact(sums.len())) {
        let value = factor * value;
        for (sum, weight) in sums.iter_mut().zip(row) {
            *sum += value * weight;
        }
    }
}
