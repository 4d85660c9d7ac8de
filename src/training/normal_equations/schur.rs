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

use super::{
    cholesky::{Cholesky, substitute},
    products::Products,
};
use crate::{
    network::{Mlp, Shape},
    training::{
        examples::{column, column_mut},
        input_pairs::InputPairs,
        parallel::is_large,
    },
};

/// What is added to the diagonals of JwᵀJw and JvᵀJv.
#[derive(Clone, Copy, Debug)]
pub(super) struct Damping {
    pub(super) hidden: f64,
    pub(super) output: f64,
}

/// The factored Schur complement S on W, with room used again for every damping.
pub(super) struct SchurComplement {
    shape: Shape,
    /// For each hidden node an n1 × n1 block of BᵀB, unpacked.
    squares: Vec<f64>,
    /// Cholesky factor of G.
    g_factor: Mat<f64>,
    /// C L⁻ᵀ, with L the factor of G.
    f: Mat<f64>,
    /// S, then its Cholesky factor; the lower triangle.
    s: Mat<f64>,
    /// G⁻¹ Jvᵀe, later the step of V: (h+1) × outputs.
    output: Mat<f64>,
    /// (h+1) × h.
    small: Mat<f64>,
    /// The step of W, node by node.
    step_w: Mat<f64>,
    cholesky: Cholesky,
    inverse: Option<Inverse>,
}

impl SchurComplement {
    pub(super) fn new(shape: Shape) -> Self {
        let (n1, h1, order) = (shape.inputs + 1, shape.hidden + 1, shape.hidden_weights());
        Self {
            shape,
            squares: vec![0.0; order * n1],
            g_factor: Mat::zeros(h1, h1),
            f: Mat::zeros(order, h1),
            s: Mat::zeros(order, order),
            output: Mat::zeros(h1, shape.outputs),
            small: Mat::zeros(h1, shape.hidden),
            step_w: Mat::zeros(order, 1),
            cholesky: Cholesky::new(order.max(h1)),
            inverse: None,
        }
    }

    /// Factors G and S for a damping, with V̄ (h × outputs); false if one of them is not positive definite in the
    /// arithmetic.
    pub(super) fn factor(&mut self, products: &Products, v: MatRef<'_, f64>, damping: Damping) -> bool {
        self.g_factor.copy_from(&products.g);
        for node in 0..self.g_factor.nrows() {
            self.g_factor[(node, node)] += damping.output;
        }
        if !self.cholesky.factor(self.g_factor.as_mut()) {
            return false;
        }
        self.f.copy_from(products.c());
        solve_lower_triangular_in_place(self.g_factor.as_ref(), self.f.as_mut().transpose_mut(), Par::Seq);
        let terms = Terms {
            gram: products.gram.as_ref(),
            v,
            f: self.f.as_ref(),
            n1: self.shape.inputs + 1,
        };
        fill_schur(&terms, 0, self.s.as_mut(), &mut self.squares);
        for index in 0..self.s.nrows() {
            self.s[(index, index)] += damping.hidden;
        }
        self.cholesky.factor(self.s.as_mut())
    }

    /// Solves for the step with what was last factored, the gradient being Jᵀe + decay·w; writes it in the order of
    /// [`Mlp::weights`](crate::network::Mlp::weights).
    pub(super) fn solve(&mut self, products: &Products, mlp: &Mlp, decay: f64, step: &mut [f64]) {
        let Shape {
            hidden: h,
            inputs,
            outputs,
        } = self.shape;
        let n1 = inputs + 1;
        let c = products.c();
        let w = MatRef::from_row_major_slice(mlp.layers().0, n1, h);
        let v_with_bias = MatRef::from_row_major_slice(mlp.layers().1, h + 1, outputs);
        let v = v_with_bias.subrows(0, h);
        let gradient_v = |row, column| products.gradient_v[(row, column)] + decay * v_with_bias[(row, column)];
        // Right-hand side: −Jwᵀe + Σₜ diag(V̄ₜ ⊗ 1) C G⁻¹ (Jvᵀe)ₜ.
        fill(self.output.as_mut(), gradient_v);
        substitute(self.g_factor.as_ref(), self.output.as_mut());
        matmul(
            self.small.as_mut(),
            Accum::Replace,
            self.output.as_ref(),
            v.transpose(),
            1.0,
            Par::Seq,
        );
        for i in 0..h {
            let mut right = self.step_w.as_mut().subrows_mut(i * n1, n1);
            fill(right.as_mut(), |input, _| {
                products.gradient_w[(input, i)] + decay * w[(input, i)]
            });
            let small = self.small.as_ref().subcols(i, 1);
            matmul(right, Accum::Add, c.subrows(i * n1, n1), small, -1.0, Par::Seq);
        }
        substitute(self.s.as_ref(), self.step_w.as_mut());
        // step_w is the negative step so far. Output layer: δV = −G⁻¹ (Jvᵀe + K V̄), K column i = Cᵢᵀ δwᵢ.
        for i in 0..h {
            let step = self.step_w.as_ref().subrows(i * n1, n1);
            let k = self.small.as_mut().subcols_mut(i, 1);
            matmul(
                k,
                Accum::Replace,
                c.subrows(i * n1, n1).transpose(),
                step,
                -1.0,
                Par::Seq,
            );
        }
        fill(self.output.as_mut(), gradient_v);
        matmul(self.output.as_mut(), Accum::Add, self.small.as_ref(), v, 1.0, Par::Seq);
        substitute(self.g_factor.as_ref(), self.output.as_mut());

        let (step_w, step_v) = step.split_at_mut(self.shape.hidden_weights());
        self.write_hidden(step_w);
        for (index, value) in step_v.iter_mut().enumerate() {
            *value = -self.output[(index / outputs, index % outputs)];
        }
    }

    /// Solves S δW = −Jwᵀe with what was last factored; writes δW in the order of
    /// [`Mlp::weights`](crate::network::Mlp::weights).
    pub(super) fn solve_hidden(&mut self, products: &Products, step: &mut [f64]) {
        let n1 = self.shape.inputs + 1;
        fill(self.step_w.as_mut(), |index, _| {
            products.gradient_w[(index % n1, index / n1)]
        });
        substitute(self.s.as_ref(), self.step_w.as_mut());
        self.write_hidden(step);
    }

    fn write_hidden(&self, step: &mut [f64]) {
        let (h, n1) = (self.shape.hidden, self.shape.inputs + 1);
        for (index, value) in step.iter_mut().enumerate() {
            let (input, node) = (index / h, index % h);
            *value = -self.step_w[(node * n1 + input, 0)];
        }
    }

    /// The trace of the inverse of the whole matrix, with what was last factored. By the blocks of the inverse it is
    /// `tr S⁻¹ + m tr G⁻¹ + Σₜ tr S⁻¹ Rₜ Rₜᵀ` with Rₜ = diag(V̄ₜ ⊗ 1) C G⁻¹; with the factors S = L Lᵀ and G = Lg Lgᵀ that
    /// is `‖L⁻¹‖² + m ‖Lg⁻¹‖² + Σₜ ‖L⁻¹ Rₜ‖²` (Frobenius).
    pub(super) fn trace_of_inverse(&mut self, v: MatRef<'_, f64>) -> f64 {
        let n1 = self.shape.inputs + 1;
        let room = self
            .inverse
            .get_or_insert_with(|| Inverse::new(self.s.nrows(), self.g_factor.nrows()));
        invert_lower_triangular(room.s.as_mut(), self.s.as_ref(), Par::Seq);
        invert_lower_triangular(room.g.as_mut(), self.g_factor.as_ref(), Par::Seq);
        let mut trace = squared_lower(&room.s) + self.shape.outputs as f64 * squared_lower(&room.g);
        let upper = self.g_factor.as_ref().transpose();
        // f = C Lg⁻ᵀ becomes C G⁻¹.
        solve_upper_triangular_in_place(upper, self.f.as_mut().transpose_mut(), Par::Seq);
        for output in 0..self.shape.outputs {
            fill(room.r.as_mut(), |index, column| {
                v[(index / n1, output)] * self.f[(index, column)]
            });
            solve_lower_triangular_in_place(self.s.as_ref(), room.r.as_mut(), Par::Seq);
            trace += room.r.squared_norm_l2();
        }
        trace
    }
}

/// Room for the trace of the inverse, made when first asked for.
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

/// The sum of squares of the lower triangle.
fn squared_lower(matrix: &Mat<f64>) -> f64 {
    let columns = (0..matrix.ncols()).map(|index| &column(matrix.as_ref(), index)[index..]);
    columns.flatten().map(|value| value * value).sum()
}

fn fill(mut matrix: MatMut<'_, f64>, value: impl Fn(usize, usize) -> f64) {
    for index in 0..matrix.ncols() {
        for (row, entry) in column_mut(matrix.as_mut(), index).iter_mut().enumerate() {
            *entry = value(row, index);
        }
    }
}

/// Fills the lower triangle of S, but for its damping: (V̄V̄ᵀ ⊗ 1) ∘ (BᵀB − F Fᵀ). `s` holds the columns of the nodes from
/// `first` on, from their diagonal down; `squares` has n1² entries for each of those nodes.
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
    pulp::Arch::new().dispatch(|| complete(terms, first, s.as_mut(), squares));
}

/// What S is made of.
struct Terms<'a> {
    gram: MatRef<'a, f64>,
    v: MatRef<'a, f64>,
    f: MatRef<'a, f64>,
    n1: usize,
}

/// Turns F Fᵀ into S without its damping.
#[inline(always)]
fn complete(terms: &Terms<'_>, first: usize, mut s: MatMut<'_, f64>, squares: &mut [f64]) {
    let Terms { gram, v, n1, .. } = *terms;
    let square = &mut squares[..n1 * n1];
    for j in 0..s.ncols() / n1 {
        for i in j..s.nrows() / n1 {
            let (node, other) = (first + i, first + j);
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
