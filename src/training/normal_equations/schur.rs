use faer::{
    Accum, Mat, MatMut, MatRef, Par,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{
        cholesky::llt,
        matmul::{
            matmul,
            triangular::{self, BlockStructure},
        },
        triangular_inverse::invert_lower_triangular,
        triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place},
    },
};

use super::products::Products;
use crate::{
    network::{Mlp, Shape},
    training::{
        examples::{column, column_mut},
        input_pairs::InputPairs,
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
    /// One n1 × n1 block of BᵀB, unpacked.
    square: Vec<f64>,
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
    memory: MemBuffer,
    inverse: Option<Inverse>,
}

impl SchurComplement {
    pub(super) fn new(shape: Shape) -> Self {
        let (n1, h1, order) = (shape.inputs + 1, shape.hidden + 1, shape.hidden_weights());
        let memory = llt::factor::cholesky_in_place_scratch::<f64>(order.max(h1), Par::Seq, Default::default());
        Self {
            shape,
            square: vec![0.0; n1 * n1],
            g_factor: Mat::zeros(h1, h1),
            f: Mat::zeros(order, h1),
            s: Mat::zeros(order, order),
            output: Mat::zeros(h1, shape.outputs),
            small: Mat::zeros(h1, shape.hidden),
            step_w: Mat::zeros(order, 1),
            memory: MemBuffer::new(memory),
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
        if !cholesky(self.g_factor.as_mut(), MemStack::new(&mut self.memory)) {
            return false;
        }
        self.f.copy_from(products.c());
        solve_lower_triangular_in_place(self.g_factor.as_ref(), self.f.as_mut().transpose_mut(), Par::Seq);
        let (f, s) = (self.f.as_ref(), self.s.as_mut());
        let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
        triangular::matmul(s, lower, Accum::Replace, f, full, f.transpose(), full, 1.0, Par::Seq);
        complete(&products.gram, v, &mut self.square, self.s.as_mut());
        for index in 0..self.s.nrows() {
            self.s[(index, index)] += damping.hidden;
        }
        cholesky(self.s.as_mut(), MemStack::new(&mut self.memory))
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
        substitute(&self.g_factor, self.output.as_mut());
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
        substitute(&self.s, self.step_w.as_mut());
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
        substitute(&self.g_factor, self.output.as_mut());

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
        substitute(&self.s, self.step_w.as_mut());
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

/// Turns C G⁻¹ Cᵀ, in the lower triangle of `s`, into S without its damping.
fn complete(gram: &Mat<f64>, v: MatRef<'_, f64>, square: &mut [f64], mut s: MatMut<'_, f64>) {
    let h = v.nrows();
    let n1 = s.nrows() / h.max(1);
    pulp::Arch::new().dispatch(|| {
        for i in 0..h {
            for j in 0..=i {
                let packed = column(gram.as_ref(), i * (i + 1) / 2 + j);
                InputPairs::unpack(packed, n1, square);
                let weight: f64 = v.row(i).iter().zip(v.row(j).iter()).map(|(a, b)| a * b).sum();
                for b in 0..n1 {
                    let first = if i == j { b } else { 0 };
                    let values = &mut column_mut(s.as_mut(), j * n1 + b)[i * n1 + first..(i + 1) * n1];
                    for (value, product) in values.iter_mut().zip(&square[b * n1 + first..(b + 1) * n1]) {
                        *value = weight * (product - *value);
                    }
                }
            }
        }
    });
}

/// Replaces the lower triangle of `matrix` by its Cholesky factor; false if it is not positive definite.
pub(super) fn cholesky(matrix: MatMut<'_, f64>, memory: &mut MemStack) -> bool {
    llt::factor::cholesky_in_place(matrix, Default::default(), Par::Seq, memory, Default::default()).is_ok()
}

/// Replaces `right` by the solution for a matrix given by its Cholesky factor.
pub(super) fn substitute(factor: &Mat<f64>, right: MatMut<'_, f64>) {
    // It needs no memory of its own.
    llt::solve::solve_in_place(factor.as_ref(), right, Par::Seq, MemStack::new(&mut []));
}
