//! Arithmetic of programs, written so that it fills vector registers inside a SIMD-dispatched function.
//!
//! All values are held as doubles. In single precision, operands are rounded when they are loaded, and the arithmetic is
//! that of 32 bits.

use std::ops::{Add, Div, Mul, Sub};

use ndarray::Array2;

use super::Function;
use crate::{
    decoupling::Precision,
    network::{exp, tanh, tanh_single},
};

/// Floating-point type of an operation.
pub(super) trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + 'static
{
    const ZERO: Self;

    /// Rounds a double to the nearest value.
    fn of(value: f64) -> Self;

    fn to_f64(self) -> f64;

    fn tanh(self) -> Self;
}

impl Real for f64 {
    const ZERO: Self = 0.0;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }

    #[inline(always)]
    fn tanh(self) -> Self {
        tanh(self)
    }
}

impl Real for f32 {
    const ZERO: Self = 0.0;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    #[inline(always)]
    fn tanh(self) -> Self {
        tanh_single(self)
    }
}

/// Writes a function of each value. In single precision, all but the hyperbolic tangent are computed in double precision
/// and rounded.
#[inline(always)]
pub(super) fn map(precision: Precision, function: Function, values: &[f64], results: &mut [f64]) {
    match precision {
        Precision::Double => map_in::<f64>(function, values, results),
        Precision::Single => map_in::<f32>(function, values, results),
    }
}

#[inline(always)]
fn map_in<T: Real>(function: Function, values: &[f64], results: &mut [f64]) {
    match function {
        Function::Log1p => each::<T>(values, results, f64::ln_1p),
        Function::Gaussian => each::<T>(values, results, |x| exp(-x)),
        Function::Tanh => {
            for (result, &value) in results.iter_mut().zip(values) {
                *result = T::of(value).tanh().to_f64();
            }
        }
    }
}

#[inline(always)]
fn each<T: Real>(values: &[f64], results: &mut [f64], function: impl Fn(f64) -> f64) {
    for (result, &value) in results.iter_mut().zip(values) {
        *result = T::of(function(T::of(value).to_f64())).to_f64();
    }
}

/// Writes the differences of pairs of values.
#[inline(always)]
pub(super) fn subtract(precision: Precision, one: &[f64], other: &[f64], results: &mut [f64]) {
    match precision {
        Precision::Double => pairs::<f64>(one, other, results, |one, other| one - other),
        Precision::Single => pairs::<f32>(one, other, results, |one, other| one - other),
    }
}

/// Writes the quotients of pairs of values.
#[inline(always)]
pub(super) fn divide(precision: Precision, one: &[f64], other: &[f64], results: &mut [f64]) {
    match precision {
        Precision::Double => pairs::<f64>(one, other, results, |one, other| one / other),
        Precision::Single => pairs::<f32>(one, other, results, |one, other| one / other),
    }
}

/// Writes (one − other) / divisor, with the difference in double precision.
#[inline(always)]
pub(super) fn subtract_and_divide(precision: Precision, [one, other, divisor]: [&[f64]; 3], results: &mut [f64]) {
    let all = results.iter_mut().zip(one).zip(other).zip(divisor);
    match precision {
        Precision::Double => all.for_each(|(((result, one), other), divisor)| *result = (one - other) / divisor),
        Precision::Single => all.for_each(|(((result, one), other), &divisor)| {
            *result = f64::from((one - other) as f32 / divisor as f32);
        }),
    }
}

#[inline(always)]
fn pairs<T: Real>(one: &[f64], other: &[f64], results: &mut [f64], function: impl Fn(T, T) -> T) {
    for ((result, &one), &other) in results.iter_mut().zip(one).zip(other) {
        *result = function(T::of(one), T::of(other)).to_f64();
    }
}

/// A table (rows × columns) in the precision of its node.
#[derive(Clone, Debug)]
pub(super) enum Table {
    Double(Padded<f64>),
    Single {
        table: Padded<f32>,
        /// The values rounded to single precision.
        rounded: Vec<f32>,
    },
}

impl Table {
    /// Lays out tables one after the other, for this number of values.
    pub(super) fn new(precision: Precision, values: usize, tables: &[&Array2<f64>]) -> Self {
        match precision {
            Precision::Double => Self::Double(Padded::new(tables)),
            Precision::Single => Self::Single {
                table: Padded::new(tables),
                rounded: vec![0.0; values],
            },
        }
    }

    /// Writes [values, 1] · table with padding: an affine map whose biases are the last row.
    #[inline(always)]
    pub(super) fn affine(&mut self, values: &[f64], results: &mut [f64]) {
        match self {
            Self::Double(table) => table.affine(values, results),
            Self::Single { table, rounded } => {
                round(values, rounded);
                table.affine(rounded, results);
            }
        }
    }

    /// Writes the squared distances of the values from each column, with padding.
    #[inline(always)]
    pub(super) fn squared_distances(&mut self, values: &[f64], results: &mut [f64]) {
        match self {
            Self::Double(table) => table.squared_distances(values, results),
            Self::Single { table, rounded } => {
                round(values, rounded);
                table.squared_distances(rounded, results);
            }
        }
    }
}

#[inline(always)]
fn round(values: &[f64], rounded: &mut [f32]) {
    for (rounded, &value) in rounded.iter_mut().zip(values) {
        *rounded = value as f32;
    }
}

/// The number of columns of a table is padded to a multiple of this.
pub(super) const LANES: usize = 4;

/// A table with its columns padded to whole vector registers.
#[derive(Clone, Debug)]
pub(super) struct Padded<T> {
    width: usize,
    values: Vec<T>,
}

impl<T: Real> Padded<T> {
    fn new(tables: &[&Array2<f64>]) -> Self {
        let width = tables[0].ncols().next_multiple_of(LANES);
        let mut values = Vec::new();
        for row in tables.iter().flat_map(|table| table.rows()) {
            values.extend(row.iter().map(|&value| T::of(value)));
            values.resize(values.len().next_multiple_of(width.max(1)), T::ZERO);
        }
        Self { width, values }
    }

    #[inline(always)]
    fn affine(&self, values: &[T], results: &mut [f64]) {
        let mut first = 0;
        while first < self.width {
            first += match self.width - first {
                16.. => self.sums::<16>(values, first, results),
                12.. => self.sums::<12>(values, first, results),
                8.. => self.sums::<8>(values, first, results),
                _ => self.sums::<LANES>(values, first, results),
            };
        }
    }

    /// Writes the sums `first..first + B` and returns B. Even and odd values are summed separately to hide the latency of
    /// additions.
    #[inline(always)]
    fn sums<const B: usize>(&self, values: &[T], first: usize, results: &mut [f64]) -> usize {
        let mut even = *self.columns::<B>(values.len(), first);
        let mut odd = [T::ZERO; B];
        let mut pairs = values.chunks_exact(2);
        let mut row = 0;
        for pair in &mut pairs {
            let (of_even, of_odd) = (self.columns::<B>(row, first), self.columns::<B>(row + 1, first));
            for lane in 0..B {
                even[lane] = even[lane] + pair[0] * of_even[lane];
                odd[lane] = odd[lane] + pair[1] * of_odd[lane];
            }
            row += 2;
        }
        if let [value] = *pairs.remainder() {
            let of_even = self.columns::<B>(row, first);
            for lane in 0..B {
                even[lane] = even[lane] + value * of_even[lane];
            }
        }
        for lane in 0..B {
            results[first + lane] = (even[lane] + odd[lane]).to_f64();
        }
        B
    }

    #[inline(always)]
    fn squared_distances(&self, values: &[T], results: &mut [f64]) {
        let mut first = 0;
        while first < self.width {
            first += match self.width - first {
                32.. => self.distances::<32>(values, first, results),
                16.. => self.distances::<16>(values, first, results),
                _ => self.distances::<LANES>(values, first, results),
            };
        }
    }

    /// Writes the squared distances `first..first + B` and returns B.
    #[inline(always)]
    fn distances<const B: usize>(&self, values: &[T], first: usize, results: &mut [f64]) -> usize {
        let mut squares = [T::ZERO; B];
        for (row, &value) in values.iter().enumerate() {
            let points = self.columns::<B>(row, first);
            for lane in 0..B {
                let apart = value - points[lane];
                squares[lane] = squares[lane] + apart * apart;
            }
        }
        for lane in 0..B {
            results[first + lane] = squares[lane].to_f64();
        }
        B
    }

    #[inline(always)]
    fn columns<const B: usize>(&self, row: usize, first: usize) -> &[T; B] {
        let begin = row * self.width + first;
        self.values[begin..begin + B].try_into().expect("B long")
    }
}

/// An affine map in which each output depends on at most one value: it restores the units and places of targets.
#[derive(Clone, Debug)]
pub(super) struct Placement {
    biases: Vec<f64>,
    /// Value, output and weight.
    terms: Vec<(usize, usize, f64)>,
}

impl Placement {
    /// `None` if an output depends on several values.
    pub(super) fn new(weights: &Array2<f64>, biases: &Array2<f64>) -> Option<Self> {
        let mut terms = Vec::new();
        for (output, column) in weights.columns().into_iter().enumerate() {
            let mut all = column.indexed_iter().filter(|(_, weight)| **weight != 0.0);
            terms.extend(all.next().map(|(value, &weight)| (value, output, weight)));
            if all.next().is_some() {
                return None;
            }
        }
        Some(Self {
            biases: biases.iter().copied().collect(),
            terms,
        })
    }

    #[inline(always)]
    pub(super) fn apply(&self, values: &[f64], results: &mut [f64]) {
        results.copy_from_slice(&self.biases);
        for &(value, output, weight) in &self.terms {
            results[output] += weight * values[value];
        }
    }
}

/// Writes the mean of the vectors (one after the other) with the softmax of `logits` as shares; `shares` is scratch.
#[inline(always)]
pub(super) fn blend(logits: &[f64], vectors: &[f64], shares: &mut [f64], results: &mut [f64]) {
    let largest = logits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut sum = 0.0;
    for (share, logit) in shares.iter_mut().zip(logits) {
        *share = exp(logit - largest);
        sum += *share;
    }
    results.fill(0.0);
    let size = results.len();
    for (share, vector) in shares.iter().zip(vectors.chunks_exact(size.max(1))) {
        for (result, value) in results.iter_mut().zip(vector) {
            *result += share / sum * value;
        }
    }
    for result in results {
        *result = if result.is_finite() { *result } else { 0.0 };
    }
}
