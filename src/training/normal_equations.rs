use faer::{
    Accum, Mat, MatMut, MatRef, Par,
    dyn_stack::{MemBuffer, MemStack},
    linalg::{
        cholesky::llt,
        matmul::{
            matmul,
            triangular::{self, BlockStructure},
        },
        triangular_solve::solve_lower_triangular_in_place,
    },
};

use super::{
    Evaluation, Examples,
    examples::{Activations, BLOCK, column, column_mut},
    input_pairs::InputPairs,
};
use crate::network::{Mlp, Shape};

/// The normal equations `(JᵀJ + μI) δ = −Jᵀe` of the network's squared errors, without ever forming J.
///
/// With A = [inputs, 1], H̃ = [H, 1], D = 1 − H∘H, V̄ = V without its biases, and B the row-wise Kronecker product of D
/// and A (samples × h·n1), the Jacobian of output t is `[B diag(V̄ₜ ⊗ 1), H̃]`, hence
///
/// ```text
/// JwᵀJw = (V̄V̄ᵀ ⊗ 1) ∘ BᵀB       block t of JwᵀJv = diag(V̄ₜ ⊗ 1) C,  C = BᵀH̃       JvᵀJv = I ⊗ H̃ᵀH̃
/// S = μI + (V̄V̄ᵀ ⊗ 1) ∘ (BᵀB − C G⁻¹ Cᵀ),   G = H̃ᵀH̃ + μI       (Schur complement on W)
/// ```
///
/// BᵀB is symmetric in the hidden nodes and in the inputs, so it is one product of pairs: (pairs of columns of A)ᵀ ×
/// (pairs of columns of D). Hidden weights are numbered node by node here: weight (i, a) is i·n1 + a.
pub struct NormalEquations {
    shape: Shape,
    activations: Activations,
    /// Products of two slopes: block × h(h+1)/2, pair (i, j ≤ i) at i(i+1)/2 + j.
    slope_pairs: Mat<f64>,
    /// Dᵢ∘H̃_q: block × h(h+1), column q·h + i; the last h columns are D itself.
    slope_hidden: Mat<f64>,
    /// Error at the hidden nodes' net input: block × h.
    delta: Mat<f64>,
    input_pairs: InputPairs,
    /// BᵀB, packed: pairs of inputs × pairs of hidden nodes.
    gram: Mat<f64>,
    /// C: h·n1 × (h+1), column by column without gaps, so that it is also n1 × h(h+1).
    c: Vec<f64>,
    /// H̃ᵀH̃.
    g: Mat<f64>,
    /// Jwᵀe: n1 × h.
    gradient_w: Mat<f64>,
    /// Jvᵀe: (h+1) × outputs.
    gradient_v: Mat<f64>,
    room: Room,
}

/// Room for factoring and solving, used again for every μ.
struct Room {
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
}

impl NormalEquations {
    /// Room for a network of this shape and these examples.
    pub fn new(shape: Shape, examples: &Examples) -> Self {
        let (n1, h1) = (shape.inputs + 1, shape.hidden + 1);
        let (h, order) = (shape.hidden, shape.hidden_weights());
        let memory = llt::factor::cholesky_in_place_scratch::<f64>(order.max(h1), Par::Seq, Default::default());
        Self {
            shape,
            activations: Activations::new(shape),
            slope_pairs: Mat::zeros(BLOCK, h * h1 / 2),
            slope_hidden: Mat::zeros(BLOCK, h * h1),
            delta: Mat::zeros(BLOCK, h),
            input_pairs: InputPairs::new(examples),
            gram: Mat::zeros(n1 * (n1 + 1) / 2, h * h1 / 2),
            c: vec![0.0; order * h1],
            g: Mat::zeros(h1, h1),
            gradient_w: Mat::zeros(n1, h),
            gradient_v: Mat::zeros(h1, shape.outputs),
            room: Room {
                square: vec![0.0; n1 * n1],
                g_factor: Mat::zeros(h1, h1),
                f: Mat::zeros(order, h1),
                s: Mat::zeros(order, order),
                output: Mat::zeros(h1, shape.outputs),
                small: Mat::zeros(h1, h),
                step_w: Mat::zeros(order, 1),
                memory: MemBuffer::new(memory),
            },
        }
    }

    /// Gathers all products at the weights of `mlp`, block by block of samples.
    pub fn gather(&mut self, mlp: &Mlp, examples: &Examples) -> Evaluation {
        let (h, h1, n1) = (self.shape.hidden, self.shape.hidden + 1, self.shape.inputs + 1);
        self.gram.fill(0.0);
        self.c.fill(0.0);
        self.g.fill(0.0);
        self.gradient_w.fill(0.0);
        self.gradient_v.fill(0.0);
        let v = MatRef::from_row_major_slice(mlp.layers().1, h1, self.shape.outputs);
        let mut squares = 0.0;
        for (index, block) in examples.blocks().iter().enumerate() {
            let samples = block.samples();
            squares += self.activations.forward(mlp, block);
            let hidden = self.activations.hidden.as_ref().subrows(0, samples);
            let errors = self.activations.errors.as_ref().subrows(0, samples);
            let mut slope_hidden = self.slope_hidden.as_mut().subrows_mut(0, samples);
            fill_slope_products(hidden, slope_hidden.as_mut());
            let slope_hidden = slope_hidden.as_ref();
            let slopes = slope_hidden.subcols(h * h, h);

            let mut slope_pairs = self.slope_pairs.as_mut().subrows_mut(0, samples);
            fill_slope_pairs(slopes, slope_pairs.as_mut());
            let input_pairs = self.input_pairs.of(index, block);
            matmul(
                self.gram.as_mut(),
                Accum::Add,
                input_pairs.transpose(),
                slope_pairs.as_ref(),
                1.0,
                Par::Seq,
            );
            let c = MatMut::from_column_major_slice_mut(&mut self.c, n1, h * h1);
            matmul(c, Accum::Add, block.inputs.transpose(), slope_hidden, 1.0, Par::Seq);
            matmul(self.g.as_mut(), Accum::Add, hidden.transpose(), hidden, 1.0, Par::Seq);

            matmul(
                self.gradient_v.as_mut(),
                Accum::Add,
                hidden.transpose(),
                errors,
                1.0,
                Par::Seq,
            );
            let mut delta = self.delta.as_mut().subrows_mut(0, samples);
            matmul(
                delta.as_mut(),
                Accum::Replace,
                errors,
                v.subrows(0, h).transpose(),
                1.0,
                Par::Seq,
            );
            for node in 0..h {
                let slopes = column(slopes, node);
                column_mut(delta.as_mut(), node)
                    .iter_mut()
                    .zip(slopes)
                    .for_each(|(delta, slope)| *delta *= slope);
            }
            matmul(
                self.gradient_w.as_mut(),
                Accum::Add,
                block.inputs.transpose(),
                delta.as_ref(),
                1.0,
                Par::Seq,
            );
        }
        let length = self.gradient_w.squared_norm_l2() + self.gradient_v.squared_norm_l2();
        Evaluation {
            mse: squares / examples.errors(),
            gradient_norm: 2.0 * length.sqrt() / examples.errors(),
        }
    }

    /// Solves for the step at damping `mu` from what was last gathered, at the same `mlp`; writes it in the order of
    /// [`Mlp::weights`]. Returns false, with `step` unspecified, if the damped matrix is not positive definite in
    /// the arithmetic: a larger `mu` is needed.
    pub fn solve(&mut self, mlp: &Mlp, mu: f64, step: &mut [f64]) -> bool {
        let (h, h1, n1) = (self.shape.hidden, self.shape.hidden + 1, self.shape.inputs + 1);
        let v = MatRef::from_row_major_slice(mlp.layers().1, h1, self.shape.outputs).subrows(0, h);
        let c = MatRef::from_column_major_slice(&self.c, h * n1, h1);
        let room = &mut self.room;

        room.g_factor.copy_from(&self.g);
        for node in 0..h1 {
            room.g_factor[(node, node)] += mu;
        }
        if !factor(room.g_factor.as_mut(), &mut room.memory) {
            return false;
        }
        room.f.copy_from(c);
        solve_lower_triangular_in_place(room.g_factor.as_ref(), room.f.as_mut().transpose_mut(), Par::Seq);
        let (f, s) = (room.f.as_ref(), room.s.as_mut());
        let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
        triangular::matmul(s, lower, Accum::Replace, f, full, f.transpose(), full, 1.0, Par::Seq);
        complete_schur_complement(&self.gram, v, mu, &mut room.square, room.s.as_mut());
        if !factor(room.s.as_mut(), &mut room.memory) {
            return false;
        }

        // Right-hand side: −Jwᵀe + Σₜ diag(V̄ₜ ⊗ 1) C G⁻¹ (Jvᵀe)ₜ.
        room.output.copy_from(&self.gradient_v);
        let memory = MemStack::new(&mut room.memory);
        llt::solve::solve_in_place(room.g_factor.as_ref(), room.output.as_mut(), Par::Seq, memory);
        matmul(
            room.small.as_mut(),
            Accum::Replace,
            room.output.as_ref(),
            v.transpose(),
            1.0,
            Par::Seq,
        );
        for i in 0..h {
            let mut right = room.step_w.as_mut().subrows_mut(i * n1, n1);
            right.copy_from(self.gradient_w.as_ref().subcols(i, 1));
            matmul(
                right,
                Accum::Add,
                c.subrows(i * n1, n1),
                room.small.as_ref().subcols(i, 1),
                -1.0,
                Par::Seq,
            );
        }
        let memory = MemStack::new(&mut room.memory);
        llt::solve::solve_in_place(room.s.as_ref(), room.step_w.as_mut(), Par::Seq, memory);
        // step_w is the negative step so far. Output layer: δV = −G⁻¹ (Jvᵀe + K V̄), K column i = Cᵢᵀ δwᵢ.
        for i in 0..h {
            let step = room.step_w.as_ref().subrows(i * n1, n1);
            let k = room.small.as_mut().subcols_mut(i, 1);
            matmul(
                k,
                Accum::Replace,
                c.subrows(i * n1, n1).transpose(),
                step,
                -1.0,
                Par::Seq,
            );
        }
        room.output.copy_from(&self.gradient_v);
        matmul(room.output.as_mut(), Accum::Add, room.small.as_ref(), v, 1.0, Par::Seq);
        let memory = MemStack::new(&mut room.memory);
        llt::solve::solve_in_place(room.g_factor.as_ref(), room.output.as_mut(), Par::Seq, memory);

        let (step_w, step_v) = step.split_at_mut(self.shape.hidden_weights());
        for (index, value) in step_w.iter_mut().enumerate() {
            let (input, node) = (index / h, index % h);
            *value = -room.step_w[(node * n1 + input, 0)];
        }
        for (index, value) in step_v.iter_mut().enumerate() {
            *value = -room.output[(index / self.shape.outputs, index % self.shape.outputs)];
        }
        step.iter().all(|value| value.is_finite())
    }
}

/// Fills Dᵢ∘H̃_q = (1 − Hᵢ²)∘H̃_q, column q·h + i, from H̃.
fn fill_slope_products(hidden: MatRef<'_, f64>, mut products: MatMut<'_, f64>) {
    let h = hidden.ncols() - 1;
    for i in 0..h {
        let outputs = column(hidden, i);
        for (slope, output) in column_mut(products.as_mut(), h * h + i).iter_mut().zip(outputs) {
            *slope = 1.0 - output * output;
        }
    }
    let (mut products, slopes) = products.split_at_col_mut(h * h);
    for q in 0..h {
        for i in 0..h {
            let factors = column(slopes.as_ref(), i).iter().zip(column(hidden, q));
            for (product, (slope, output)) in column_mut(products.as_mut(), q * h + i).iter_mut().zip(factors) {
                *product = slope * output;
            }
        }
    }
}

/// Fills Dᵢ∘Dⱼ, column i(i+1)/2 + j for j ≤ i.
fn fill_slope_pairs(slopes: MatRef<'_, f64>, mut pairs: MatMut<'_, f64>) {
    for i in 0..slopes.ncols() {
        for j in 0..=i {
            let factors = column(slopes, i).iter().zip(column(slopes, j));
            for (pair, (a, b)) in column_mut(pairs.as_mut(), i * (i + 1) / 2 + j).iter_mut().zip(factors) {
                *pair = a * b;
            }
        }
    }
}

/// Turns C G⁻¹ Cᵀ, in the lower triangle of `s`, into S.
fn complete_schur_complement(gram: &Mat<f64>, v: MatRef<'_, f64>, mu: f64, square: &mut [f64], mut s: MatMut<'_, f64>) {
    let h = v.nrows();
    let n1 = s.nrows() / h.max(1);
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
    for index in 0..s.nrows() {
        s[(index, index)] += mu;
    }
}

/// Replaces the lower triangle of `matrix` by its Cholesky factor; false if it is not positive definite.
fn factor(matrix: MatMut<'_, f64>, memory: &mut MemBuffer) -> bool {
    let memory = MemStack::new(memory);
    llt::factor::cholesky_in_place(matrix, Default::default(), Par::Seq, memory, Default::default()).is_ok()
}

#[cfg(test)]
mod tests {
    use faer::prelude::Solve;

    use super::*;
    use crate::training::examples::tests::{random_examples, random_mlp};

    /// The same step from the Jacobian itself, one row per sample and output.
    fn dense_step(mlp: &Mlp, examples: &Examples, mu: f64) -> Vec<f64> {
        let Shape {
            inputs,
            hidden,
            outputs,
        } = mlp.shape();
        let (rows, weights) = (examples.samples() * outputs, mlp.weights().len());
        let (w, v) = (mlp.hidden_layer(), mlp.output_layer());
        let mut jacobian = Mat::<f64>::zeros(rows, weights);
        let mut errors = Mat::<f64>::zeros(rows, 1);
        let mut row = 0;
        for block in examples.blocks() {
            for s in 0..block.samples() {
                let net = |i: usize| (0..=inputs).map(|a| block.inputs[(s, a)] * w[[a, i]]).sum::<f64>();
                let mut h: Vec<f64> = (0..hidden).map(|i| net(i).tanh()).collect();
                h.push(1.0);
                for t in 0..outputs {
                    let output: f64 = (0..=hidden).map(|q| h[q] * v[[q, t]]).sum();
                    errors[(row, 0)] = output - block.targets[(s, t)];
                    for i in 0..hidden {
                        for a in 0..=inputs {
                            let slope = 1.0 - h[i] * h[i];
                            jacobian[(row, a * hidden + i)] = v[[i, t]] * slope * block.inputs[(s, a)];
                        }
                    }
                    for (q, value) in h.iter().enumerate() {
                        jacobian[(row, mlp.shape().hidden_weights() + q * outputs + t)] = *value;
                    }
                    row += 1;
                }
            }
        }
        let mut normal = jacobian.transpose() * &jacobian;
        (0..weights).for_each(|k| normal[(k, k)] += mu);
        let step = normal
            .llt(faer::Side::Lower)
            .unwrap()
            .solve(jacobian.transpose() * errors);
        (0..weights).map(|k| -step[(k, 0)]).collect()
    }

    #[test]
    fn the_step_is_that_of_the_dense_jacobian() {
        for (inputs, hidden, outputs, samples) in [(5, 4, 3, 300), (1, 1, 1, 3), (7, 2, 1, 40), (12, 6, 5, 513)] {
            let mlp = random_mlp(inputs, hidden, outputs, 1);
            let examples = random_examples(samples, inputs, outputs, 2);
            let mut equations = NormalEquations::new(mlp.shape(), &examples);
            equations.gather(&mlp, &examples);
            for mu in [1e-3, 1.0, 1e6] {
                let mut step = vec![0.0; mlp.weights().len()];
                assert!(equations.solve(&mlp, mu, &mut step));
                let dense = dense_step(&mlp, &examples, mu);
                let largest = dense.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
                let error = step
                    .iter()
                    .zip(&dense)
                    .map(|(ours, dense)| (ours - dense).abs())
                    .fold(0.0, f64::max);
                assert!(
                    error < 1e-12 * largest,
                    "{inputs}-{hidden}-{outputs}, mu {mu}: {error} of {largest}"
                );
            }
        }
    }

    #[test]
    fn it_evaluates_as_back_propagation_does() {
        let mlp = random_mlp(6, 5, 4, 3);
        let examples = random_examples(400, 6, 4, 4);
        let ours = NormalEquations::new(mlp.shape(), &examples).gather(&mlp, &examples);
        let expected = crate::training::backpropagation::Backpropagation::new(&mlp).evaluate(&mlp, &examples);
        assert!((ours.mse - expected.mse).abs() < 1e-14);
        assert!((ours.gradient_norm - expected.gradient_norm).abs() < 1e-14);
    }

    #[test]
    fn a_singular_system_is_refused_or_solved_but_never_nan() {
        let mlp = Mlp::zeros(Shape {
            inputs: 3,
            hidden: 2,
            outputs: 2,
        });
        let examples = random_examples(2, 3, 2, 5);
        let mut equations = NormalEquations::new(mlp.shape(), &examples);
        equations.gather(&mlp, &examples);
        for mu in [0.0, 1e-300, 1e-3, 1e300] {
            let mut step = vec![0.0; mlp.weights().len()];
            if equations.solve(&mlp, mu, &mut step) {
                assert!(step.iter().all(|value| value.is_finite()), "mu {mu}");
            }
        }
    }
}
