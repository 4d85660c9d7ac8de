use std::ops::{Add, Div, Mul};

use crate::network::{tanh_in_place, tanh_in_place_single};

/// Floating-point type in which networks decode.
pub trait Real: Copy + Send + Add<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// Zero.
    const ZERO: Self;
    /// Machine epsilon, the relative spacing of numbers.
    const EPSILON: f64;

    /// Rounds a double to the nearest value.
    fn of(value: f64) -> Self;

    /// Converts to a double.
    fn to_f64(self) -> f64;

    /// Replaces each value by its hyperbolic tangent.
    fn tanh_in_place(values: &mut [Self]);
}

impl Real for f64 {
    const ZERO: Self = 0.0;
    const EPSILON: f64 = f64::EPSILON;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }

    #[inline(always)]
    fn tanh_in_place(values: &mut [Self]) {
        tanh_in_place(values);
    }
}

impl Real for f32 {
    const ZERO: Self = 0.0;
    const EPSILON: f64 = f32::EPSILON as f64;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    #[inline(always)]
    fn tanh_in_place(values: &mut [Self]) {
        tanh_in_place_single(values);
    }
}
