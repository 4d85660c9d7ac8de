//! Numbers that carry their derivatives with respect to up to nine parameters.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Most parameters of a problem.
pub(super) const MAX_PARAMETERS: usize = 9;

#[derive(Clone, Copy, Debug)]
pub(super) struct Dual {
    pub(super) value: f64,
    pub(super) slopes: [f64; MAX_PARAMETERS],
}

impl Dual {
    pub(super) fn constant(value: f64) -> Self {
        let slopes = [0.0; MAX_PARAMETERS];
        Self { value, slopes }
    }

    pub(super) fn parameter(index: usize, value: f64) -> Self {
        let mut parameter = Self::constant(value);
        parameter.slopes[index] = 1.0;
        parameter
    }

    /// A function of this number by its value and its derivative there.
    fn chain(self, value: f64, derivative: f64) -> Self {
        let slopes = self.slopes.map(|slope| derivative * slope);
        Self { value, slopes }
    }

    fn combined(self, other: Self, value: f64, by_self: f64, by_other: f64) -> Self {
        let slopes = std::array::from_fn(|k| by_self * self.slopes[k] + by_other * other.slopes[k]);
        Self { value, slopes }
    }

    pub(super) fn exp(self) -> Self {
        let value = self.value.exp();
        self.chain(value, value)
    }

    pub(super) fn sin(self) -> Self {
        self.chain(self.value.sin(), self.value.cos())
    }

    pub(super) fn cos(self) -> Self {
        self.chain(self.value.cos(), -self.value.sin())
    }

    pub(super) fn atan(self) -> Self {
        self.chain(self.value.atan(), 1.0 / (1.0 + self.value * self.value))
    }

    pub(super) fn square(self) -> Self {
        self * self
    }

    pub(super) fn pow(self, exponent: Self) -> Self {
        let value = self.value.powf(exponent.value);
        let by_base = exponent.value * self.value.powf(exponent.value - 1.0);
        self.combined(exponent, value, by_base, value * self.value.ln())
    }
}

impl Neg for Dual {
    type Output = Self;

    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl Add for Dual {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        self.combined(other, self.value + other.value, 1.0, 1.0)
    }
}

impl Sub for Dual {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self.combined(other, self.value - other.value, 1.0, -1.0)
    }
}

impl Mul for Dual {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        self.combined(other, self.value * other.value, other.value, self.value)
    }
}

impl Div for Dual {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        self.combined(other, value, 1.0 / other.value, -value / other.value)
    }
}

macro_rules! with_constants {
    ($($operator:ident $method:ident),*) => {$(
        impl $operator<f64> for Dual {
            type Output = Self;

            fn $method(self, other: f64) -> Self {
                self.$method(Self::constant(other))
            }
        }

        impl $operator<Dual> for f64 {
            type Output = Dual;

            fn $method(self, other: Dual) -> Dual {
                Dual::constant(self).$method(other)
            }
        }
    )*};
}

with_constants!(Add add, Sub sub, Mul mul, Div div);
