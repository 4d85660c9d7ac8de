//! Arithmetic of programs, written so that it fills vector registers inside a SIMD-dispatched function.
use ndarray::{Array2, LinalgScalar};

use super::{Domain, Function};
use crate::network::{exp, tanh, tanh_single};

/// Floating-point type of an operation.
pub(super) trait Real: LinalgScalar + Default + PartialOrd + Into<f64> {
    /// Rounds a double to the nearest value.
    fn of(value: f64) -> Self;

    fn tanh(self) -> Self;
}

impl Real for f64 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn tanh(self) -> Self {
        tanh(self)
    }
}

impl Real for f32 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn tanh(self) -> Self {
        tanh_single(self)
    }
}

/// True if all values are in the domain. Bit patterns of positive numbers are in the order of the numbers.
#[inline(always)]
pub(super) fn are_valid(domain: Domain, values: &[f64]) -> bool {
    let infinite = f64::INFINITY.to_bits();
    let largest = |pattern: fn(f64) -> u64| values.iter().fold(0, |largest, &value| pattern(value).max(largest));
    match domain {
        Domain::Finite => largest(|value| value.abs().to_bits()) < infinite,
        // 0 becomes the largest pattern.
        Domain::Positive => largest(|value| value.to_bits().wrapping_sub(1)) < infinite - 1,
    }
}

/// Writes a function of each value. In single precision, all but the hyperbolic tangent are computed in double precision
/// and rounded.
#[inline(always)]
pub(super) fn map<T: Real>(function: Function, values: &[T], results: &mut [T]) {
    match function {
        Function::Log1p => each(values, results, f64::ln_1p),
        Function::Gaussian => each(values, results, |x| exp(-x)),
        Function::Tanh => {
            for (result, value) in results.iter_mut().zip(values) {
                *result = value.tanh();
            }
        }
    }
}

#[inline(always)]
fn each<T: Real>(values: &[T], results: &mut [T], function: impl Fn(f64) -> f64) {
    for (result, value) in results.iter_mut().zip(values) {
        *result = T::of(function((*value).into()));
    }
}

/// Writes a function of pairs of values.
#[inline(always)]
pub(super) fn pairs<T: Real>(one: &[T], other: &[T], results: &mut [T], function: impl Fn(T, T) -> T) {
    for ((result, &one), &other) in results.iter_mut().zip(one).zip(other) {
        *result = function(one, other);
    }
}

/// Writes the nearest values within limits; NaN passes through.
#[inline(always)]
pub(super) fn clip<T: Real>(values: &[T], [low, high]: [&[T]; 2], results: &mut [T]) {
    let limits = low.iter().zip(high);
    for ((result, &value), (&low, &high)) in results.iter_mut().zip(values).zip(limits) {
        let above = if value < low { low } else { value };
        *result = if above > high { high } else { above };
    }
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
    /// An affine map with weights (inputs × outputs) and biases (1 × outputs).
    pub(super) fn of_affine(weights: &Array2<f64>, biases: &Array2<f64>) -> Self {
        Self::new(&[weights, biases], &SUMS)
    }

    /// Points (inputs × points).
    pub(super) fn of_points(points: &Array2<f64>) -> Self {
        Self::new(&[points], &DISTANCES)
    }

    /// Lays out tables one after the other.
    fn new(tables: &[&Array2<f64>], panels: &[usize]) -> Self {
        let width = tables[0].ncols().next_multiple_of(LANES);
        let rows = Vec::from_iter(tables.iter().flat_map(|table| table.rows()));
        let mut values = Vec::with_capacity(rows.len() * width);
        let mut first = 0;
        while first < width {
            let fitting = panels.iter().find(|&&panel| panel <= width - first);
            let end = first + fitting.copied().unwrap_or(LANES);
            for row in &rows {
                values.extend((first..end).map(|column| row.get(column).map_or(T::default(), |&value| T::of(value))));
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

    /// Writes values · weights + biases with padding.
    #[inline(always)]
    pub(super) fn affine(&self, values: &[T], results: &mut [T]) {
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
    fn sums<const B: usize>(&self, values: &[T], first: usize, results: &mut [T]) -> usize {
        let (biases, weights) = self
            .panel::<B>(first)
            .split_last()
            .expect("the biases are the last row");
        let (mut even, mut odd) = (*biases, [T::default(); B]);
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
            *result = even[lane] + odd[lane];
        }
        B
    }

    /// Writes the squared distances of the values from each point, with padding.
    #[inline(always)]
    pub(super) fn squared_distances(&self, values: &[T], results: &mut [T]) {
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
    fn distances<const B: usize>(&self, values: &[T], first: usize, results: &mut [T]) -> usize {
        let mut squares = [T::default(); B];
        for (&value, points) in values.iter().zip(self.panel::<B>(first)) {
            for lane in 0..B {
                let apart = value - points[lane];
                squares[lane] = squares[lane] + apart * apart;
            }
        }
        for (lane, result) in results[first..first + B].iter_mut().enumerate() {
            *result = squares[lane];
        }
        B
    }
}

/// Weights of which at most one per output is not 0: they restore the units and places of targets.
#[derive(Clone, Debug)]
pub(super) struct Placement(Vec<Term>);

/// An output that is not constant: bias + weight · value.
#[derive(Clone, Copy, Debug)]
struct Term {
    bias: f64,
    weight: f64,
    value: usize,
    output: usize,
}

impl Placement {
    /// `None` if an output depends on several values.
    pub(super) fn new(weights: &Array2<f64>, biases: &Array2<f64>) -> Option<Self> {
        let mut terms = Vec::new();
        for ((output, column), &bias) in weights.columns().into_iter().enumerate().zip(biases) {
            let mut all = column.indexed_iter().filter(|(_, weight)| **weight != 0.0);
            terms.extend(all.next().map(|(value, &weight)| Term {
                bias,
                weight,
                value,
                output,
            }));
            if all.next().is_some() {
                return None;
            }
        }
        Some(Self(terms))
    }

    /// Writes the outputs that are not constant.
    #[inline(always)]
    pub(super) fn apply(&self, values: &[f64], results: &mut [f64]) {
        for term in &self.0 {
            results[term.output] = term.bias + term.weight * values[term.value];
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
