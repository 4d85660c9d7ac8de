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

/// Writes the nearest values within limits; NaN passes through.
#[inline(always)]
pub(super) fn clip(precision: Precision, values: &[f64], [low, high]: [&[f64]; 2], results: &mut [f64]) {
    let limits = low.iter().zip(high);
    for ((result, &value), (&low, &high)) in results.iter_mut().zip(values).zip(limits) {
        let above = if value < low { low } else { value };
        let clipped = if above > high { high } else { above };
        *result = match precision {
            Precision::Double => clipped,
            Precision::Single => f64::from(clipped as f32),
        };
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
    /// Lays out tables one after the other.
    fn new(precision: Precision, tables: &[&Array2<f64>], panels: &[usize]) -> Self {
        match precision {
            Precision::Double => Self::Double(Padded::new(tables, panels)),
            Precision::Single => {
                let table = Padded::new(tables, panels);
                let rounded = vec![0.0; table.rows];
                Self::Single { table, rounded }
            }
        }
    }

    /// An affine map with weights (inputs × outputs) and biases (1 × outputs).
    pub(super) fn of_affine(precision: Precision, weights: &Array2<f64>, biases: &Array2<f64>) -> Self {
        Self::new(precision, &[weights, biases], &SUMS)
    }

    /// Points (inputs × points).
    pub(super) fn of_points(precision: Precision, points: &Array2<f64>) -> Self {
        Self::new(precision, &[points], &DISTANCES)
    }

    /// Writes values · weights + biases with padding.
    #[inline(always)]
    pub(super) fn affine(&mut self, values: &[f64], results: &mut [f64]) {
        match self {
            Self::Double(table) => table.affine(values, results),
            Self::Single { table, rounded } => {
                table.affine(round(values, rounded), results);
            }
        }
    }

    /// Writes the squared distances of the values from each point, with padding.
    #[inline(always)]
    pub(super) fn squared_distances(&mut self, values: &[f64], results: &mut [f64]) {
        match self {
            Self::Double(table) => table.squared_distances(values, results),
            Self::Single { table, rounded } => {
                table.squared_distances(round(values, rounded), results);
            }
        }
    }
}

#[inline(always)]
fn round<'a>(values: &[f64], rounded: &'a mut [f32]) -> &'a [f32] {
    let rounded = &mut rounded[..values.len()];
    for (rounded, &value) in rounded.iter_mut().zip(values) {
        *rounded = value as f32;
    }
    rounded
}

/// The number of columns of a table is padded to a multiple of this.
pub(super) const LANES: usize = 4;

/// A table whose columns are padded to whole vector registers and divided into panels that are summed in registers.
#[derive(Clone, Debug)]
pub(super) struct Padded<T> {
    rows: usize,
    width: usize,
    /// Panel by panel, each rows × its width.
    values: Vec<T>,
}

/// Widths of the panels of an affine map: the first that fits, or the last.
const SUMS: [usize; 4] = [16, 12, 8, LANES];
/// Widths of the panels of points.
const DISTANCES: [usize; 3] = [32, 16, LANES];

impl<T: Real> Padded<T> {
    fn new(tables: &[&Array2<f64>], panels: &[usize]) -> Self {
        let width = tables[0].ncols().next_multiple_of(LANES);
        let rows = Vec::from_iter(tables.iter().flat_map(|table| table.rows()));
        let mut values = Vec::with_capacity(rows.len() * width);
        let mut first = 0;
        while first < width {
            let fitting = panels.iter().find(|&&panel| panel <= width - first);
            let end = first + fitting.copied().unwrap_or(LANES);
            for row in &rows {
                values.extend((first..end).map(|column| row.get(column).map_or(T::ZERO, |&value| T::of(value))));
            }
            first = end;
        }
        Self {
            rows: rows.len(),
            width,
            values,
        }
    }

    /// The rows of the panel with the columns `first..first + B`.
    #[inline(always)]
    fn panel<const B: usize>(&self, first: usize) -> &[[T; B]] {
        self.values[first * self.rows..(first + B) * self.rows].as_chunks().0
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
        let (biases, weights) = self
            .panel::<B>(first)
            .split_last()
            .expect("the biases are the last row");
        let (mut even, mut odd) = (*biases, [T::ZERO; B]);
        let (pairs, last) = values.as_chunks::<2>();
        let (of_pairs, of_last) = weights.as_chunks::<2>();
        for (pair, [of_even, of_odd]) in pairs.iter().zip(of_pairs) {
            for lane in 0..B {
                even[lane] = even[lane] + pair[0] * of_even[lane];
                odd[lane] = odd[lane] + pair[1] * of_odd[lane];
            }
        }
        if let ([value], [of_even]) = (last, of_last) {
            for lane in 0..B {
                even[lane] = even[lane] + *value * of_even[lane];
            }
        }
        for (lane, result) in results[first..first + B].iter_mut().enumerate() {
            *result = (even[lane] + odd[lane]).to_f64();
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
        for (&value, points) in values.iter().zip(self.panel::<B>(first)) {
            for lane in 0..B {
                let apart = value - points[lane];
                squares[lane] = squares[lane] + apart * apart;
            }
        }
        for (lane, result) in results[first..first + B].iter_mut().enumerate() {
            *result = squares[lane].to_f64();
        }
        B
    }
}

/// Weights of which at most one per output is not 0: they restore the units and places of targets.
#[derive(Clone, Debug)]
pub(super) struct Placement(Vec<Term>);

/// A product that is added to an output.
#[derive(Clone, Copy, Debug)]
struct Term {
    weight: f64,
    value: usize,
    output: usize,
}

impl Placement {
    /// `None` if an output depends on several values.
    pub(super) fn new(weights: &Array2<f64>) -> Option<Self> {
        let mut terms = Vec::new();
        for (output, column) in weights.columns().into_iter().enumerate() {
            let mut all = column.indexed_iter().filter(|(_, weight)| **weight != 0.0);
            terms.extend(all.next().map(|(value, &weight)| Term { weight, value, output }));
            if all.next().is_some() {
                return None;
            }
        }
        Some(Self(terms))
    }

    /// Adds the products to the biases.
    #[inline(always)]
    pub(super) fn add(&self, values: &[f64], results: &mut [f64]) {
        for &Term { weight, value, output } in &self.0 {
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
