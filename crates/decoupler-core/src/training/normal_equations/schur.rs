//! The Schur complement S on W, formed and factored, and values that differ between the classes of weights.

use faer::{
    Accum, Mat, MatMut, MatRef, Par,
    linalg::{
        matmul::{
            matmul,
            triangular::{self, BlockStructure},
        },
        triangular_inverse::invert_lower_triangular,
        triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place},
    },
};
use pulp::{Simd, WithSimd};

use super::{
    CHUNK, Cost,
    cholesky::{Cholesky, Elimination, fill, output_weights, substitute},
    conjugate::{HiddenSolver, System},
    equations::Sums,
};
use crate::{
    network::{Mlp, Shape},
    training::{
        Examples,
        activations::{BlockNow, KeptActivations, multiply_into},
        examples::{InputPairs, PairsBuffer, column, column_mut, pairs},
        parallel::{add_product, is_large},
    },
};

/// Solver with the Cholesky factor of S, in memory that is reused for every damping.
///
/// All of BᵀB is gathered, packed: pairs of inputs × pairs of hidden nodes, pair (i, j ≤ i) at i(i+1)/2 + j. BᵀB is
/// symmetric in both, so it is one product of pairs: (pairs of columns of A)ᵀ × (pairs of columns of D).
pub(in crate::training) struct SchurComplement {
    shape: Shape,
    input_pairs: InputPairs,
    /// Unpacked n1 × n1 block of BᵀB for each hidden node.
    squares: Vec<f64>,
    /// S, then its Cholesky factor; the lower triangle.
    s: Mat<f64>,
    cholesky: Cholesky,
    inverse: Option<Inverse>,
}

impl HiddenSolver for SchurComplement {
    fn new(shape: Shape, examples: &Examples) -> Self {
        let order = shape.hidden_weights();
        Self {
            shape,
            input_pairs: InputPairs::new(examples),
            squares: vec![0.0; order * (shape.inputs + 1)],
            s: Mat::zeros(order, order),
            cholesky: Cholesky::new(order),
            inverse: None,
        }
    }

    /// Gathering BᵀB takes n1²/2 · h²/2 multiplications per sample, solving order² (h+1)/2 + order³/6, with order =
    /// h·n1.
    fn cost(shape: Shape, samples: usize) -> Cost {
        let (n1, h) = (shape.inputs + 1, shape.hidden);
        let order = shape.hidden_weights();
        let [n1_, h_, order_] = [n1, h, order].map(|size| size as f64);
        Cost {
            shape,
            samples,
            gram_per_sample: n1_ * n1_ * h_ * h_ / 4.0,
            solving: order_ * order_ * ((h_ + 1.0) / 2.0 + order_ / 6.0),
            entries: order.saturating_mul(order + h + 1 + n1),
            gram: (pairs(n1), h * (h + 1) / 2),
            pairs: pairs(n1),
        }
    }

    fn pairs_buffer(&self) -> PairsBuffer {
        self.input_pairs.buffer(self.shape.inputs + 1)
    }

    fn add_gram(
        &self,
        gram: &mut Mat<f64>,
        now: &BlockNow<'_>,
        slopes: MatRef<'_, f64>,
        mut columns: MatMut<'_, f64>,
        pairs: &mut PairsBuffer,
    ) {
        let input_pairs = self.input_pairs.of(now.number, now.block, pairs);
        let (mut first, mut filled) = (0, 0);
        for i in 0..slopes.ncols() {
            for j in 0..=i {
                multiply_into(
                    column_mut(columns.as_mut(), filled + j),
                    column(slopes, i),
                    column(slopes, j),
                );
            }
            filled += i + 1;
            if filled >= CHUNK || i + 1 == slopes.ncols() {
                let sum = gram.as_mut().subcols_mut(first, filled);
                add_product(sum, input_pairs, columns.as_ref().subcols(0, filled), 1.0);
                (first, filled) = (first + filled, 0);
            }
        }
    }

    fn solve(&mut self, system: System<'_>, _: &mut KeptActivations, right: &mut [f64]) -> Option<()> {
        let System {
            mlp,
            sums,
            elimination,
            damping,
            ..
        } = system;
        self.factor(sums, elimination.f.as_ref(), output_weights(mlp), damping)?;
        let order = right.len();
        substitute(self.s.as_ref(), MatMut::from_column_major_slice_mut(right, order, 1));
        Some(())
    }
}

impl SchurComplement {
    /// Factors S for a damping of W, with V̄ (h × outputs) and F; `None` if it is not numerically positive definite.
    pub(super) fn factor(
        &mut self,
        sums: &Sums,
        f: MatRef<'_, f64>,
        v: MatRef<'_, f64>,
        damping: PerClass,
    ) -> Option<()> {
        let terms = Terms {
            gram: sums.gram.as_ref(),
            v,
            f,
            n1: self.shape.inputs + 1,
        };
        fill_schur(&terms, 0, self.s.as_mut(), &mut self.squares);
        for index in 0..self.s.nrows() {
            self.s[(index, index)] += damping.of_input(index % (self.shape.inputs + 1), self.shape.inputs);
        }
        self.cholesky.factor(self.s.as_mut())
    }

    /// Returns the trace of the inverse of the whole matrix last factored. From the blocks of the inverse it is `tr S⁻¹
    /// + m tr G⁻¹ + Σₜ tr S⁻¹ Rₜ Rₜᵀ` with Rₜ = diag(V̄ₜ ⊗ 1) C G⁻¹; with the factors S = L Lᵀ and G = Lg Lgᵀ this is
    /// `‖L⁻¹‖² + m ‖Lg⁻¹‖² + Σₜ ‖L⁻¹ Rₜ‖²` (Frobenius norms).
    pub(super) fn trace_of_inverse(&mut self, elimination: &mut Elimination, v: MatRef<'_, f64>) -> f64 {
        let outputs = self.shape.outputs as f64;
        let inverse = self.invert(elimination);
        let mut trace = squared_lower(&inverse.s) + outputs * squared_lower(&inverse.g);
        self.for_each_output(elimination, v, |r| trace += r.squared_norm_l2());
        trace
    }

    /// As [`Self::trace_of_inverse`], class by class: diagonal entry k is the squared norm of column k of L⁻¹, or of
    /// Lg⁻¹ and L⁻¹ Rₜ.
    pub(super) fn traces_of_inverse(&mut self, elimination: &mut Elimination, v: MatRef<'_, f64>) -> Traces {
        let Shape { inputs, hidden, .. } = self.shape;
        let inverse = self.invert(elimination);
        let squares = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
        let mut traces = Traces::default();
        for index in 0..inverse.s.ncols() {
            let square = squares(&column(inverse.s.as_ref(), index)[index..]);
            if index % (inputs + 1) == inputs {
                traces.hidden_biases += square;
            } else {
                traces.hidden_weights += square;
            }
        }
        let of_node: Vec<f64> = (0..=hidden)
            .map(|node| squares(&column(inverse.g.as_ref(), node)[node..]))
            .collect();
        self.for_each_output(elimination, v, |r| {
            let of_node = |node| of_node[node] + squares(column(r, node));
            traces.outputs.push(OutputTraces {
                weights: (0..hidden).map(of_node).sum(),
                bias: of_node(hidden),
            });
        });
        traces
    }

    /// Inverts the factors of S and G.
    fn invert(&mut self, elimination: &Elimination) -> &Inverse {
        let (order, h1) = (self.s.nrows(), self.shape.hidden + 1);
        let inverse = self.inverse.get_or_insert_with(|| Inverse::new(order, h1));
        invert_lower_triangular(inverse.s.as_mut(), self.s.as_ref(), Par::Seq);
        invert_lower_triangular(inverse.g.as_mut(), elimination.g_factor.as_ref(), Par::Seq);
        inverse
    }

    /// Calls `add` with L⁻¹ Rₜ for every output, after [`Self::invert`].
    fn for_each_output(
        &mut self,
        elimination: &mut Elimination,
        v: MatRef<'_, f64>,
        mut add: impl FnMut(MatRef<'_, f64>),
    ) {
        let n1 = self.shape.inputs + 1;
        let Elimination { g_factor, f, .. } = elimination;
        let Some(Inverse { r, .. }) = &mut self.inverse else {
            return;
        };
        // F = C Lg⁻ᵀ becomes C G⁻¹.
        solve_upper_triangular_in_place(g_factor.as_ref().transpose(), f.as_mut().transpose_mut(), Par::Seq);
        for output in 0..self.shape.outputs {
            fill(r.as_mut(), |index, column| v[(index / n1, output)] * f[(index, column)]);
            solve_lower_triangular_in_place(self.s.as_ref(), r.as_mut(), Par::Seq);
            add(r.as_ref());
        }
    }
}

/// Contributions of weights to the trace of an inverse.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::training) struct Traces {
    pub(in crate::training) hidden_weights: f64,
    pub(in crate::training) hidden_biases: f64,
    /// Of the weights of each output.
    pub(in crate::training) outputs: Vec<OutputTraces>,
}

/// Contributions of the weights of one output to the trace of an inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::training) struct OutputTraces {
    pub(in crate::training) weights: f64,
    pub(in crate::training) bias: f64,
}

impl Traces {
    /// Sums over the weights of each class.
    pub(in crate::training) fn classes(&self) -> PerClass {
        PerClass {
            hidden_weights: self.hidden_weights,
            hidden_biases: self.hidden_biases,
            output_weights: self.outputs.iter().map(|output| output.weights).sum(),
            output_biases: self.outputs.iter().map(|output| output.bias).sum(),
        }
    }
}

/// Memory for the trace of the inverse, allocated on first use.
struct Inverse {
    s: Mat<f64>,
    g: Mat<f64>,
    r: Mat<f64>,
}

impl Inverse {
    fn new(order: usize, h1: usize) -> Self {
        Self {
            s: Mat::zeros(order, order),
            g: Mat::zeros(h1, h1),
            r: Mat::zeros(order, h1),
        }
    }
}

/// Returns the sum of squares in the lower triangle.
fn squared_lower(matrix: &Mat<f64>) -> f64 {
    let columns = (0..matrix.ncols()).map(|index| &column(matrix.as_ref(), index)[index..]);
    columns.flatten().map(|value| value * value).sum()
}

/// Fills the lower triangle of S, except for its damping: (V̄V̄ᵀ ⊗ 1) ∘ (BᵀB − F Fᵀ). `s` holds the columns of the
/// nodes from `first` on, from their diagonal down; `squares` has n1² entries for each of those nodes.
fn fill_schur(terms: &Terms<'_>, first: usize, s: MatMut<'_, f64>, squares: &mut [f64]) {
    let nodes = s.ncols() / terms.n1;
    if nodes > 1 && is_large(s.nrows() * s.ncols() * terms.n1) {
        let half = nodes / 2;
        let (left, right) = s.split_at_col_mut(half * terms.n1);
        let right = right.subrows_mut(half * terms.n1, left.nrows() - half * terms.n1);
        let (left_squares, right_squares) = squares.split_at_mut(half * terms.n1 * terms.n1);
        rayon::join(
            || fill_schur(terms, first, left, left_squares),
            || fill_schur(terms, first + half, right, right_squares),
        );
        return;
    }
    let mut s = s;
    let f = terms.f.subrows(first * terms.n1, s.nrows());
    let (mut triangle, mut below) = s.as_mut().split_at_row_mut(nodes * terms.n1);
    let (f_triangle, f_below) = f.split_at_row(nodes * terms.n1);
    let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
    let (replace, right) = (Accum::Replace, f_triangle.transpose());
    triangular::matmul(
        triangle.as_mut(),
        lower,
        replace,
        f_triangle,
        full,
        right,
        full,
        1.0,
        Par::Seq,
    );
    matmul(below.as_mut(), replace, f_below, right, 1.0, Par::Seq);
    pulp::Arch::new().dispatch(Completion {
        terms,
        first,
        s,
        square: &mut squares[..terms.n1 * terms.n1],
    });
}

/// Terms of S.
struct Terms<'a> {
    gram: MatRef<'a, f64>,
    v: MatRef<'a, f64>,
    f: MatRef<'a, f64>,
    n1: usize,
}

/// Turns F Fᵀ, in the columns of `s`, into S without its damping. A struct instead of a closure so that the body is
/// inlined into the SIMD-dispatched function.
struct Completion<'a, 'b> {
    terms: &'a Terms<'b>,
    first: usize,
    s: MatMut<'a, f64>,
    /// Buffer of n1 × n1.
    square: &'a mut [f64],
}

impl WithSimd for Completion<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Terms { gram, v, n1, .. } = *self.terms;
        let (mut s, square) = (self.s, self.square);
        for j in 0..s.ncols() / n1 {
            for i in j..s.nrows() / n1 {
                let (node, other) = (self.first + i, self.first + j);
                InputPairs::unpack(column(gram, node * (node + 1) / 2 + other), n1, square);
                let products = v.row(node).iter().zip(v.row(other).iter());
                let weight: f64 = products.map(|(a, b)| a * b).sum();
                for b in 0..n1 {
                    let start = if i == j { b } else { 0 };
                    let values = &mut column_mut(s.as_mut(), j * n1 + b)[i * n1 + start..(i + 1) * n1];
                    for (value, product) in values.iter_mut().zip(&square[b * n1 + start..(b + 1) * n1]) {
                        *value = weight * (product - *value);
                    }
                }
            }
        }
    }
}

/// Value for each class of weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::training) struct PerClass<T = f64> {
    /// Weights from inputs to hidden nodes.
    pub(in crate::training) hidden_weights: T,
    /// Biases of hidden nodes.
    pub(in crate::training) hidden_biases: T,
    /// Weights from hidden nodes to outputs.
    pub(in crate::training) output_weights: T,
    /// Biases of outputs.
    pub(in crate::training) output_biases: T,
}

impl<T: Copy> PerClass<T> {
    /// Creates the same value for every class.
    pub(in crate::training) fn all(value: T) -> Self {
        Self {
            hidden_weights: value,
            hidden_biases: value,
            output_weights: value,
            output_biases: value,
        }
    }

    /// Applies `of` to the value of each class.
    pub(in crate::training) fn map<U>(self, of: impl Fn(T) -> U) -> PerClass<U> {
        PerClass {
            hidden_weights: of(self.hidden_weights),
            hidden_biases: of(self.hidden_biases),
            output_weights: of(self.output_weights),
            output_biases: of(self.output_biases),
        }
    }

    /// Returns the value for a weight of the hidden layer: `input` equal to `inputs` is the bias.
    pub(super) fn of_input(&self, input: usize, inputs: usize) -> T {
        if input == inputs {
            self.hidden_biases
        } else {
            self.hidden_weights
        }
    }

    /// Returns the value for a weight of the output layer: `node` equal to `hidden` is the bias.
    pub(super) fn of_node(&self, node: usize, hidden: usize) -> T {
        if node == hidden {
            self.output_biases
        } else {
            self.output_weights
        }
    }

    /// Returns the values class by class.
    pub(in crate::training) fn values(self) -> [T; 4] {
        [
            self.hidden_weights,
            self.hidden_biases,
            self.output_weights,
            self.output_biases,
        ]
    }
}

impl PerClass {
    /// Returns the product class by class.
    pub(in crate::training) fn times(self, other: Self) -> Self {
        Self {
            hidden_weights: self.hidden_weights * other.hidden_weights,
            hidden_biases: self.hidden_biases * other.hidden_biases,
            output_weights: self.output_weights * other.output_weights,
            output_biases: self.output_biases * other.output_biases,
        }
    }
}

/// Decay of the weights towards zero, and of output biases towards given values.
#[derive(Clone, Copy, Debug)]
pub(in crate::training) struct Decay<'a> {
    rates: PerClass,
    /// Value for each output bias; empty for zeros.
    biases: &'a [f64],
}

impl<'a> Decay<'a> {
    pub(in crate::training) const NONE: Self = Self {
        rates: PerClass {
            hidden_weights: 0.0,
            hidden_biases: 0.0,
            output_weights: 0.0,
            output_biases: 0.0,
        },
        biases: &[],
    };

    /// Creates a decay with these rates, of output biases towards `biases`, or towards zero if that is empty.
    pub(in crate::training) fn new(rates: PerClass, biases: &'a [f64]) -> Self {
        Self { rates, biases }
    }

    /// Returns half the derivative of the decay with respect to a weight of the hidden layer.
    pub(super) fn pull_in_hidden(&self, (input, inputs): (usize, usize), weight: f64) -> f64 {
        self.rates.of_input(input, inputs) * weight
    }

    /// Returns half the derivative of the decay with respect to a weight of the output layer.
    pub(super) fn pull_in_output(&self, (node, hidden): (usize, usize), output: usize, weight: f64) -> f64 {
        let bias = self.biases.get(output).filter(|_| node == hidden);
        self.rates.of_node(node, hidden) * bias.map_or(weight, |bias| weight - bias)
    }
}

/// Returns the number of weights in each class.
pub(in crate::training) fn class_sizes(shape: Shape) -> PerClass<usize> {
    let Shape {
        inputs,
        hidden,
        outputs,
    } = shape;
    PerClass {
        hidden_weights: inputs * hidden,
        hidden_biases: hidden,
        output_weights: hidden * outputs,
        output_biases: outputs,
    }
}

/// Returns Σw² of each class; for output biases, the squared distances from `biases`, or from zero if that is empty.
pub(in crate::training) fn class_squares(mlp: &Mlp, biases: &[f64]) -> PerClass {
    let mut rest = mlp.weights();
    let sizes = class_sizes(mlp.shape());
    let mut next = |size: usize| {
        let (class, others) = rest.split_at(size);
        rest = others;
        class.iter().map(|weight| weight * weight).sum()
    };
    let mut squares = PerClass {
        hidden_weights: next(sizes.hidden_weights),
        hidden_biases: next(sizes.hidden_biases),
        output_weights: next(sizes.output_weights),
        output_biases: next(sizes.output_biases),
    };
    if !biases.is_empty() {
        let ours = &mlp.weights()[mlp.weights().len() - biases.len()..];
        squares.output_biases = ours.iter().zip(biases).map(|(ours, bias)| (ours - bias).powi(2)).sum();
    }
    squares
}
