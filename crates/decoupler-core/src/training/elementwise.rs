//! Elementwise products of columns, dispatched to the machine's SIMD instructions.

use pulp::{Simd, WithSimd};

/// Writes `a ∘ b`.
pub(super) fn multiply_into(product: &mut [f64], a: &[f64], b: &[f64]) {
    pulp::Arch::new().dispatch(|| {
        for ((product, a), b) in product.iter_mut().zip(a).zip(b) {
            *product = a * b;
        }
    });
}

/// Writes `factor · a`.
pub(super) fn scale_into(product: &mut [f64], factor: f64, a: &[f64]) {
    pulp::Arch::new().dispatch(|| {
        for (product, a) in product.iter_mut().zip(a) {
            *product = factor * a;
        }
    });
}

/// Multiplies `values` by `factors`.
pub(super) fn multiply(values: &mut [f64], factors: &[f64]) {
    pulp::Arch::new().dispatch(|| {
        for (value, factor) in values.iter_mut().zip(factors) {
            *value *= factor;
        }
    });
}

/// Multiplies `values` by `factor`.
pub(super) fn scale(values: &mut [f64], factor: f64) {
    pulp::Arch::new().dispatch(|| {
        for value in &mut *values {
            *value *= factor;
        }
    });
}

/// Adds `factor · a` to `sum`.
pub(super) fn add_scaled(sum: &mut [f64], factor: f64, a: &[f64]) {
    pulp::Arch::new().dispatch(|| {
        for (sum, a) in sum.iter_mut().zip(a) {
            *sum += factor * a;
        }
    });
}

/// Multiplies `values` by the derivatives of tanh where its values are `h`: 1 − h².
pub(super) fn multiply_by_tanh_slopes(values: &mut [f64], h: &[f64]) {
    pulp::Arch::new().dispatch(|| {
        for (value, h) in values.iter_mut().zip(h) {
            *value *= 1.0 - h * h;
        }
    });
}

/// Writes the derivative of tanh where its value is `h`: 1 − h².
pub(super) fn tanh_slopes_into(slopes: &mut [f64], h: &[f64]) {
    pulp::Arch::new().dispatch(|| {
        for (slope, h) in slopes.iter_mut().zip(h) {
            *slope = 1.0 - h * h;
        }
    });
}

/// Subtracts `targets` from `outputs`; returns the sum of squares, in eight partial sums of fixed order.
pub(super) fn subtract(outputs: &mut [f64], targets: &[f64]) -> f64 {
    pulp::Arch::new().dispatch(Subtraction { outputs, targets })
}

/// A struct instead of a closure so that the body is inlined into the SIMD-dispatched function.
struct Subtraction<'a> {
    outputs: &'a mut [f64],
    targets: &'a [f64],
}

impl WithSimd for Subtraction<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        const LANES: usize = 8;
        let mut sums = [0.0; LANES];
        let (outputs, last_outputs) = self.outputs.as_chunks_mut::<LANES>();
        let (targets, last_targets) = self.targets.as_chunks::<LANES>();
        for (outputs, targets) in outputs.iter_mut().zip(targets) {
            for lane in 0..LANES {
                outputs[lane] -= targets[lane];
                sums[lane] += outputs[lane] * outputs[lane];
            }
        }
        for ((output, target), sum) in last_outputs.iter_mut().zip(last_targets).zip(&mut sums) {
            *output -= target;
            *sum += *output * *output;
        }
        sums.iter().sum()
    }
}
