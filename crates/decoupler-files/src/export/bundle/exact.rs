use ndarray::{Array1, Array2, ArrayView1};

use super::{folding::FoldedMap, portable::Portable, twofold::Twofold};
use decoupler_core::{
    decoupling::{AffineLayer, Layer},
    network::Quantity,
};

/// Answer of a decoder to a reading, and how much rounding can change it.
#[derive(Clone, Debug)]
pub(super) struct Exact {
    /// Outputs, exact except for their own last digits.
    pub(super) answers: Vec<f64>,
    /// Sums of magnitudes by which rounding errors grow.
    pub(super) growth: ErrorGrowth,
    /// Slopes of the outputs (outputs × channels) with respect to the changes of the readings.
    slopes: Array2<f64>,
}

/// Largest changes of an output relative to its scale, to first order, per relative error of each number that is added up in
/// each layer.
///
/// An error bound of a sum is a multiple of its magnitudes (N. J. Higham, Accuracy and Stability of Numerical Algorithms,
/// section 3.1), here carried through the layers behind it to the outputs.
#[derive(Clone, Debug, Default)]
pub(super) struct ErrorGrowth(pub(super) Vec<f64>);

impl ErrorGrowth {
    pub(super) fn largest(&self, other: &Self) -> Self {
        let at = |growth: &Self, layer: usize| growth.0.get(layer).copied().unwrap_or(0.0);
        let layers = self.0.len().max(other.0.len());
        Self((0..layers).map(|layer| at(self, layer).max(at(other, layer))).collect())
    }

    /// The largest of all layers.
    pub(super) fn most(&self) -> f64 {
        self.0.iter().copied().fold(0.0, f64::max)
    }
}

/// Values after a layer, with what is needed to carry errors through it.
struct Step {
    values: Vec<Twofold>,
    /// Sums of magnitudes of what is added up to each value.
    magnitudes: Vec<f64>,
    /// Slopes of the values (values × inputs of the layer).
    slopes: Array2<f64>,
}

/// Answers `readings` with twice the digits of double precision.
pub(super) fn decode_exactly(portable: &Portable, map: &FoldedMap, readings: &[f64]) -> Exact {
    let readings = readings.iter().zip(&map.centre);
    let mut values: Vec<_> = readings
        .map(|(&ohm, &centre)| change(portable.quantity, ohm, centre))
        .collect();
    let mut steps = Vec::new();
    for layer in &map.layers {
        let step = taken(layer, &values);
        values.clone_from(&step.values);
        steps.push(step);
    }
    let mut slopes = Array2::eye(values.len());
    let mut growth = Vec::new();
    for step in steps.iter().rev() {
        let of_output = |(row, scale): (ArrayView1<'_, f64>, &f64)| {
            let parts = row.iter().zip(&step.magnitudes).map(|(slope, size)| slope.abs() * size);
            parts.sum::<f64>() / scale
        };
        let outputs = slopes.rows().into_iter().zip(&portable.scales);
        growth.push(outputs.map(of_output).fold(0.0, f64::max));
        slopes = slopes.dot(&step.slopes);
    }
    growth.reverse();
    Exact {
        answers: values.iter().map(|value| value.to_f64()).collect(),
        growth: ErrorGrowth(growth),
        slopes,
    }
}

fn taken(layer: &Layer<Twofold>, inputs: &[Twofold]) -> Step {
    match layer {
        Layer::Affine(affine) => sums(affine, inputs),
        Layer::Tanh => {
            let values: Vec<Twofold> = inputs.iter().map(|value| value.tanh()).collect();
            // The slope of the hyperbolic tangent where it has this value.
            let slope = |value: &Twofold| (1.0 - value.to_f64()) * (1.0 + value.to_f64());
            let slopes: Vec<f64> = values.iter().map(slope).collect();
            let own = values.iter().zip(inputs).zip(&slopes);
            let own = own.map(|((value, sum), slope)| value.to_f64().abs() + slope * sum.to_f64().abs());
            Step {
                magnitudes: own.collect(),
                slopes: Array2::from_diag(&Array1::from(slopes)),
                values,
            }
        }
        Layer::Gaussians { centres } => gaussians(centres, inputs),
        Layer::Rules {
            memberships,
            consequents,
        } => blended(&sums(memberships, inputs), &sums(consequents, inputs)),
    }
}

fn sums(affine: &AffineLayer<Twofold>, inputs: &[Twofold]) -> Step {
    let mut values = affine.biases.clone();
    let mut magnitudes: Vec<f64> = values.iter().map(|bias| bias.to_f64().abs()).collect();
    for (&input, weights) in inputs.iter().zip(affine.weights.rows()) {
        for ((sum, magnitude), &weight) in values.iter_mut().zip(&mut magnitudes).zip(weights) {
            let product = input * weight;
            *sum = *sum + product;
            *magnitude += product.to_f64().abs();
        }
    }
    Step {
        values,
        magnitudes,
        slopes: affine.weights.t().mapv(Twofold::to_f64),
    }
}

fn gaussians(centres: &Array2<Twofold>, inputs: &[Twofold]) -> Step {
    let mut slopes = Array2::zeros((centres.ncols(), inputs.len()));
    let (mut values, mut magnitudes) = (Vec::new(), Vec::new());
    for (centre, mut slopes) in centres.columns().into_iter().zip(slopes.rows_mut()) {
        let (mut square, mut magnitude) = (Twofold::ZERO, 0.0);
        for ((&input, &centre), slope) in inputs.iter().zip(centre).zip(&mut slopes) {
            let apart = input - centre;
            square = square + apart * apart;
            let sizes = input.to_f64().abs() + centre.to_f64().abs() + apart.to_f64().abs();
            magnitude += 2.0 * apart.to_f64().abs() * sizes;
            *slope = -2.0 * apart.to_f64();
        }
        let value = (-square).exp();
        slopes *= value.to_f64();
        magnitudes.push(value.to_f64() * (1.0 + magnitude));
        values.push(value);
    }
    Step {
        values,
        magnitudes,
        slopes,
    }
}

/// The consequents blended by the memberships with these logarithms.
fn blended(logarithms: &Step, consequents: &Step) -> Step {
    let rules = logarithms.values.len();
    let outputs = consequents.values.len() / rules;
    let largest = (logarithms.values.iter().copied()).fold(logarithms.values[0], |largest, value| {
        if value.to_f64() > largest.to_f64() {
            value
        } else {
            largest
        }
    });
    let strengths: Vec<Twofold> = logarithms.values.iter().map(|&value| (value - largest).exp()).collect();
    let total = strengths.iter().fold(Twofold::ZERO, |sum, &strength| sum + strength);
    let mut step = Step {
        values: vec![Twofold::ZERO; outputs],
        magnitudes: vec![0.0; outputs],
        slopes: Array2::zeros((outputs, logarithms.slopes.ncols())),
    };
    let shares: Vec<Twofold> = strengths.iter().map(|&strength| strength / total).collect();
    for (rule, &share) in shares.iter().enumerate() {
        for (output, sum) in step.values.iter_mut().enumerate() {
            *sum = *sum + share * consequents.values[rule * outputs + output];
        }
    }
    for (rule, share) in shares.iter().map(|share| share.to_f64()).enumerate() {
        let of_logarithm =
            logarithms.magnitudes[rule] + logarithms.values[rule].to_f64().abs() + largest.to_f64().abs();
        for output in 0..outputs {
            let place = rule * outputs + output;
            let answer = consequents.values[place].to_f64();
            // ∂(Σ φ y)/∂ ln φ of one rule.
            let of_share = share * (answer - step.values[output].to_f64());
            step.magnitudes[output] +=
                share * (answer.abs() + consequents.magnitudes[place]) + of_share.abs() * of_logarithm;
            let mut slopes = step.slopes.row_mut(output);
            slopes.scaled_add(share, &consequents.slopes.row(place));
            slopes.scaled_add(of_share, &logarithms.slopes.row(rule));
        }
    }
    step
}

impl Exact {
    /// Bound on the change of an output relative to its scale, to first order, when each of the `readings` answered may be
    /// wrong by up to `errors`.
    pub(super) fn change_by(&self, portable: &Portable, map: &FoldedMap, readings: &[f64], errors: &[f64]) -> f64 {
        let steps = readings.iter().zip(errors).zip(&map.centre);
        let steps: Vec<f64> = steps
            .map(|((&ohm, &error), &centre)| slope_of_change(portable.quantity, ohm, centre) * error)
            .collect();
        let of_output = |(slopes, scale): (ArrayView1<'_, f64>, &f64)| {
            let parts = slopes.iter().zip(&steps).map(|(slope, step)| (slope * step).abs());
            parts.sum::<f64>() / scale
        };
        let outputs = self.slopes.rows().into_iter().zip(&portable.scales);
        outputs.map(of_output).fold(0.0, f64::max)
    }
}

/// Derivative of the change of a reading with respect to the reading.
fn slope_of_change(quantity: Quantity, ohm: f64, centre: f64) -> f64 {
    match quantity {
        Quantity::Resistance | Quantity::Raw => 1.0,
        Quantity::Conductance => -centre / ohm / ohm,
        Quantity::LogResistance => 1.0 / ohm,
    }
}

fn change(quantity: Quantity, ohm: f64, centre: f64) -> Twofold {
    let (ohm, centre) = (Twofold::from(ohm), Twofold::from(centre));
    match quantity {
        Quantity::Resistance | Quantity::Raw => ohm - centre,
        Quantity::Conductance => (centre - ohm) / ohm,
        Quantity::LogResistance => (ohm / centre).ln(),
    }
}
