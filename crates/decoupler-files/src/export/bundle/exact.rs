use std::ops::{Add, Div, Mul, Neg, Sub};

use decoupler_core::network::Quantity;
use ndarray::{Array1, Array2, ArrayView1};

use super::{
    layers::{AffineLayer, Layer},
    portable::{FoldedMap, Portable},
};

/// Answer of a decoder to a reading, and its sensitivity to rounding.
#[derive(Clone, Debug)]
pub(super) struct Exact {
    /// Outputs, exact to about their last digits.
    pub(super) answers: Vec<f64>,
    /// Sums of magnitudes by which rounding errors grow.
    pub(super) growth: ErrorGrowth,
    /// Slopes of the outputs (outputs × channels) with respect to the changes of the readings.
    slopes: Array2<f64>,
}

/// Largest changes of an output relative to its scale, to first order, per relative error of each term of the sums in
/// each layer.
///
/// An error bound of a sum is a multiple of its magnitudes (N. J. Higham, Accuracy and Stability of Numerical Algorithms,
/// section 3.1), here propagated through the following layers to the outputs.
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

/// Values after a layer, with the quantities needed to propagate errors through it.
struct Step {
    values: Vec<Twofold>,
    /// Sum of the magnitudes of the terms of each value.
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
            // The slope of the hyperbolic tangent at this value.
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

impl Exact {
    /// Bound on the change of an output relative to its scale, to first order, when each of the `readings` may be wrong
    /// by up to `errors`.
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

/// Number of about 32 decimal digits: the unevaluated sum of two doubles, the second below half a unit in the last place
/// of the first.
///
/// Exported networks are compared with values computed in it, because the program's own double precision is no more
/// accurate than theirs. Algorithms: T. J. Dekker, Numerische Mathematik 18 (1971), 224-242; Y. Hida, X. S. Li and D.
/// H. Bailey, Library for double-double and quad-double arithmetic (2007).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Twofold {
    high: f64,
    low: f64,
}

/// ln 2.
const LN_2: Twofold = Twofold {
    high: std::f64::consts::LN_2,
    low: 2.319_046_813_846_299_6e-17,
};

impl Twofold {
    pub(super) const ZERO: Self = Self { high: 0.0, low: 0.0 };

    /// The nearest double.
    pub(super) fn to_f64(self) -> f64 {
        self.high
    }

    /// a + b where |a| ≥ |b|.
    fn of_ordered(a: f64, b: f64) -> Self {
        let high = a + b;
        Self {
            high,
            low: b - (high - a),
        }
    }

    /// Natural logarithm, by one Newton step on eʸ = x from the logarithm in double precision.
    pub(super) fn ln(self) -> Self {
        let near = libm::log(self.high);
        let excess = self * (-Self::from(near)).exp() - Self::from(1.0);
        // ln(1 + e) = e − e²/2 + …, and |e| is about 1e-16.
        Self::from(near) + excess - excess * excess * Self::from(0.5)
    }

    /// e to this power, which is at most about 700; 0 if the result is below the smallest normal number.
    pub(super) fn exp(self) -> Self {
        /// r is divided by 2⁶ and the power squared as often.
        const HALVINGS: i32 = 6;
        if self.high < -745.0 {
            return Self::ZERO;
        }
        let doublings = (self.high / LN_2.high).round();
        let r = (self - LN_2 * Self::from(doublings)) * Self::from(0.5_f64.powi(HALVINGS));
        let (mut term, mut less_one) = (r, r);
        // |r| < 0.0055: the term after these is below 1e-33.
        for n in 2..=12 {
            term = term * r / Self::from(f64::from(n));
            less_one = less_one + term;
        }
        // (1 + e)² − 1 = 2e + e², which loses fewer digits than squaring 1 + e.
        for _ in 0..HALVINGS {
            less_one = less_one * Self::from(2.0) + less_one * less_one;
        }
        let power = less_one + Self::from(1.0);
        let scale = 2.0_f64.powi(doublings as i32);
        Self {
            high: power.high * scale,
            low: power.low * scale,
        }
    }

    /// Hyperbolic tangent, with the error of double precision (about 1e-16).
    pub(super) fn tanh(self) -> Self {
        let near = libm::tanh(self.high);
        let slope = (1.0 - near) * (1.0 + near);
        Self::of_ordered(near, self.low * slope)
    }
}

impl From<f64> for Twofold {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl Add for Twofold {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let high = self.high + other.high;
        let of_other = high - self.high;
        let error = (self.high - (high - of_other)) + (other.high - of_other);
        Self::of_ordered(high, error + self.low + other.low)
    }
}

impl Neg for Twofold {
    type Output = Self;

    fn neg(self) -> Self {
        Self {
            high: -self.high,
            low: -self.low,
        }
    }
}

impl Sub for Twofold {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Twofold {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let high = self.high * other.high;
        let error = self.high.mul_add(other.high, -high);
        Self::of_ordered(high, error + (self.high * other.low + self.low * other.high))
    }
}

impl Div for Twofold {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other * Self::from(first);
        let second = rest.high / other.high;
        let rest = rest - other * Self::from(second);
        Self::of_ordered(first, second) + Self::from(rest.high / other.high)
    }
}

#[cfg(test)]
mod tests {
    use dashu_float::{DBig, FBig, round::mode::HalfEven};
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    use super::*;

    /// Bits of the reference.
    const BITS: usize = 160;

    fn exact(value: Twofold) -> FBig<HalfEven, 2> {
        let part = |part: f64| {
            FBig::<HalfEven, 2>::try_from(part)
                .unwrap()
                .with_precision(BITS)
                .value()
        };
        part(value.high) + part(value.low)
    }

    fn relative(ours: Twofold, truth: &FBig<HalfEven, 2>) -> f64 {
        ((exact(ours) - truth) / truth).to_f64().value().abs()
    }

    #[test]
    fn every_operation_keeps_thirty_digits() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        for _ in 0..200 {
            let mut draw = || Twofold::from(rng.random_range(0.01..900.0)) / Twofold::from(rng.random_range(1.0..7.0));
            let (a, b) = (draw(), draw());
            let (exact_a, exact_b) = (exact(a), exact(b));
            let cases = [
                ("sum", a + b, &exact_a + &exact_b),
                ("product", a * b, &exact_a * &exact_b),
                ("quotient", a / b, &exact_a / &exact_b),
                ("logarithm of a quotient", (a / b).ln(), exact(a / b).ln()),
            ];
            for (name, ours, truth) in cases {
                assert!(
                    relative(ours, &truth) < 1e-29,
                    "{name} of {a:?} and {b:?}: {ours:?} {truth}"
                );
            }
            assert!(((exact(a - b) - (exact_a - exact_b)).to_f64().value() / a.high.max(b.high)).abs() < 1e-30);
        }
    }

    #[test]
    fn the_constant_is_the_logarithm_of_two() {
        let ln_2 = "0.69314718055994530941723212145817656808".parse::<DBig>().unwrap();
        let difference = exact(LN_2).to_decimal().value() - ln_2;
        assert!(difference.to_f64().value().abs() < 1e-32);
    }

    #[test]
    fn the_tangent_is_that_of_double_precision_and_follows_the_second_part() {
        for x in [-30.0, -1.5, -1e-8, 0.0, 0.3, 2.0] {
            assert_eq!(Twofold::from(x).tanh().to_f64(), libm::tanh(x), "{x}");
        }
        let (x, step) = (0.7, 1e-17);
        let moved = (Twofold { high: x, low: step }.tanh() - Twofold::from(x).tanh()).to_f64();
        let slope = 1.0 - f64::tanh(x).powi(2);
        assert!((moved / step - slope).abs() < 1e-9, "{moved}");
    }
}
