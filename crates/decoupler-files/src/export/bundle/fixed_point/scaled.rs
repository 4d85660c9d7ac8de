/// A row of weights as whole numbers with a common power of two.
#[derive(Clone, Debug)]
pub(super) struct ScaledRow {
    /// The weights times 2^`bits`, rounded.
    pub(super) weights: Vec<i32>,
    pub(super) bits: i32,
    /// Sum of the rounding errors of the weights.
    pub(super) error: f64,
}

/// Most bits after the point of a weight.
const MAX_BITS: i32 = 20;

impl ScaledRow {
    /// Scales `weights` so that the largest takes `width` bits with its sign. `fewest` limits the power of two.
    ///
    /// `None` for a weight that is too large even with the fewest bits.
    pub(super) fn of(weights: &[f64], width: u32, fewest: i32) -> Option<Self> {
        let largest = weights
            .iter()
            .fold(0.0_f64, |largest, weight| largest.max(weight.abs()));
        let fitting = (f64::from((1 << (width - 1)) - 1) / largest).log2().floor();
        // Not a number for a weight that is none, and infinite for zeros.
        if fitting.is_nan() || fitting < f64::from(fewest) {
            return None;
        }
        let bits = fitting.min(f64::from(MAX_BITS)) as i32;
        let scale = 2.0_f64.powi(bits);
        let rounded: Vec<i32> = weights.iter().map(|weight| (weight * scale).round() as i32).collect();
        let errors = weights
            .iter()
            .zip(&rounded)
            .map(|(weight, &rounded)| (weight - f64::from(rounded) / scale).abs());
        Some(Self {
            error: errors.sum(),
            weights: rounded,
            bits,
        })
    }
}

/// A factor as a whole number divided by a power of two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Multiplier {
    pub(super) factor: i32,
    pub(super) shift: u8,
}

impl Multiplier {
    /// Relative rounding error.
    pub(super) const ERROR: f64 = 1.0 / (1_u32 << 29) as f64;

    /// A factor from some 1e-6 to 2²⁹.
    pub(super) fn of(factor: f64) -> Self {
        let shift = (29 - factor.log2().floor() as i32).clamp(0, 60);
        Self {
            factor: (factor * 2.0_f64.powi(shift)).round() as i32,
            shift: shift as u8,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_take_all_bits_and_tell_their_error() {
        let row = ScaledRow::of(&[1.0, -0.3, 0.1], 16, 0).unwrap();
        assert_eq!((row.bits, &row.weights[..]), (14, &[16384, -4915, 1638][..]));
        assert!((row.error - (0.3 - 4915.0 / 16384.0_f64).abs() - (0.1 - 1638.0 / 16384.0_f64).abs()).abs() < 1e-15);
        assert_eq!(ScaledRow::of(&[0.0], 16, 0).unwrap().bits, 20);
        assert!(ScaledRow::of(&[40_000.0], 16, 0).is_none());
        assert!(ScaledRow::of(&[f64::INFINITY], 24, 0).is_none());
    }

    #[test]
    fn factors_keep_thirty_bits() {
        for factor in [1.5e-5, 0.3, 1.0, 77.7, 65534.0, 3.2e7] {
            let Multiplier { factor: whole, shift } = Multiplier::of(factor);
            let relative = f64::from(whole) / 2.0_f64.powi(i32::from(shift)) / factor - 1.0;
            assert!(relative.abs() <= Multiplier::ERROR, "{factor}: {relative}");
        }
    }
}
