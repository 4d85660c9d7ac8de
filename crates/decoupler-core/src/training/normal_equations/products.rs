//! The products of which the equations consist, gathered from the samples block by block.

use faer::{Accum, Mat, MatMut, MatRef, Par, linalg::matmul::matmul};

use super::{CHUNK, Cost, conjugate::HiddenSolver, equations::Sums};
use crate::{
    network::{Mlp, Shape},
    training::{
        Evaluation, Examples,
        activations::{BlockNow, KeptActivations, multiply, multiply_into, scale, tanh_slopes_into},
        examples::{BLOCK, PairsBuffer, column, column_mut},
        parallel::{add_product, for_each_part},
    },
};

/// Products summed over all samples.
pub(super) struct Products {
    /// Sums for each part of the samples; once gathered, the first contains the total.
    parts: Vec<(Sums, BlockBuffers)>,
}

/// Buffers for one block of samples.
struct BlockBuffers {
    pairs: PairsBuffer,
    /// D: block × h.
    slopes: Mat<f64>,
    /// Columns of a product: block × up to [`CHUNK`] or slightly more.
    columns: Mat<f64>,
    /// Error at the hidden nodes' net input: block × h.
    delta: Mat<f64>,
}

impl BlockBuffers {
    fn new(shape: Shape, pairs: PairsBuffer) -> Self {
        let (h, n1) = (shape.hidden, shape.inputs + 1);
        Self {
            pairs,
            slopes: Mat::zeros(BLOCK, h),
            columns: Mat::zeros(BLOCK, (h * (h + 1)).min(CHUNK + h).max(n1)),
            delta: Mat::zeros(BLOCK, h),
        }
    }
}

impl Products {
    /// Allocates for samples in this many `parts`.
    pub(super) fn new<S: HiddenSolver + ?Sized>(solver: &S, cost: &Cost, parts: usize) -> Self {
        let part = |_| {
            let buffers = BlockBuffers::new(cost.shape, solver.pairs_buffer());
            (Sums::new(cost.shape, cost.gram), buffers)
        };
        Self {
            parts: (0..parts).map(part).collect(),
        }
    }

    /// Returns the sums last gathered.
    pub(super) fn sums(&self) -> &Sums {
        &self.parts[0].0
    }

    /// Gathers all products at the weights of `mlp`, block by block of samples. If `precisions` is not empty, they are
    /// the products of the equations in which the errors and output weights of target t are multiplied by √ρₜ; only
    /// Jᵀe depends on it.
    pub(super) fn gather<S: HiddenSolver + ?Sized>(
        &mut self,
        solver: &S,
        mlp: &Mlp,
        precisions: &[f64],
        examples: &Examples,
        kept: &mut KeptActivations,
    ) -> Evaluation {
        let squares = kept.evaluate(mlp, examples);
        let (Shape { hidden, outputs, .. }, v) = (mlp.shape(), &mlp.layers().1);
        let weighted: Vec<f64> = if precisions.is_empty() {
            Vec::new()
        } else {
            v.iter()
                .zip(precisions.iter().cycle())
                .map(|(v, precision)| v * precision)
                .collect()
        };
        let v = if precisions.is_empty() { v } else { &weighted[..] };
        let v = MatRef::from_row_major_slice(v, hidden + 1, outputs).subrows(0, hidden);
        for_each_part(&mut self.parts, |(sums, _)| sums.clear());
        kept.for_each_block(mlp, examples, &mut self.parts, |(sums, buffers), now| {
            sums.add_second_order(solver, now, buffers);
            sums.add_gradient(now, v, buffers);
        });
        if let [(sums, _), others @ ..] = self.parts.as_mut_slice() {
            others.iter().for_each(|(other, _)| sums.add(other));
            for (target, precision) in precisions.iter().enumerate() {
                scale(column_mut(sums.gradient_v.as_mut(), target), precision.sqrt());
            }
        }
        let sums = self.sums();
        let length = sums.gradient_w.squared_norm_l2() + sums.gradient_v.squared_norm_l2();
        Evaluation {
            mse: squares / examples.errors(),
            gradient_norm: 2.0 * length.sqrt() / examples.errors(),
        }
    }
}

impl Sums {
    /// Adds a block to BᵀB, C and H̃ᵀH̃; leaves its slopes in their buffer.
    fn add_second_order<S: HiddenSolver + ?Sized>(
        &mut self,
        solver: &S,
        now: &BlockNow<'_>,
        buffers: &mut BlockBuffers,
    ) {
        let (hidden, samples) = (now.hidden(), now.block.samples());
        let mut slopes = buffers.slopes.as_mut().subrows_mut(0, samples);
        for i in 0..self.shape.hidden {
            tanh_slopes_into(column_mut(slopes.as_mut(), i), column(hidden, i));
        }
        let slopes = slopes.as_ref();
        let mut columns = buffers.columns.as_mut().subrows_mut(0, samples);
        solver.add_gram(&mut self.gram, now, slopes, columns.as_mut(), &mut buffers.pairs);
        self.add_c(now.block.inputs.as_ref(), hidden, slopes, columns);
        add_product(self.g.as_mut(), hidden.transpose(), hidden, 1.0);
    }

    /// Adds to C column by column: Dᵢ∘H̃_q is column q·h + i.
    fn add_c(
        &mut self,
        inputs: MatRef<'_, f64>,
        hidden: MatRef<'_, f64>,
        slopes: MatRef<'_, f64>,
        mut columns: MatMut<'_, f64>,
    ) {
        let (h, h1, n1) = (self.shape.hidden, self.shape.hidden + 1, self.shape.inputs + 1);
        let (mut first, mut filled) = (0, 0);
        for q in 0..h1 {
            for i in 0..h {
                multiply_into(
                    column_mut(columns.as_mut(), filled + i),
                    column(slopes, i),
                    column(hidden, q),
                );
            }
            filled += h;
            if filled >= CHUNK || q == h {
                let c = MatMut::from_column_major_slice_mut(&mut self.c, n1, h * h1);
                let sum = c.subcols_mut(first, filled);
                add_product(sum, inputs.transpose(), columns.as_ref().subcols(0, filled), 1.0);
                (first, filled) = (first + filled, 0);
            }
        }
    }

    /// Adds a block to Jwᵀe, with the weights `v` (h × outputs) from errors to hidden nodes, and to Jvᵀe; its slopes
    /// must still be in their buffer.
    fn add_gradient(&mut self, now: &BlockNow<'_>, v: MatRef<'_, f64>, buffers: &mut BlockBuffers) {
        let (hidden, errors, samples) = (now.hidden(), now.errors(), now.block.samples());
        add_product(self.gradient_v.as_mut(), hidden.transpose(), errors, 1.0);
        let mut delta = buffers.delta.as_mut().subrows_mut(0, samples);
        matmul(delta.as_mut(), Accum::Replace, errors, v.transpose(), 1.0, Par::Seq);
        let slopes = buffers.slopes.as_ref().subrows(0, samples);
        for node in 0..self.shape.hidden {
            multiply(column_mut(delta.as_mut(), node), column(slopes, node));
        }
        add_product(
            self.gradient_w.as_mut(),
            now.block.inputs.transpose(),
            delta.as_ref(),
            1.0,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{
            cholesky::output_weights,
            conjugate::ConjugateGradient,
            dense::{errors, jacobian},
            schur::SchurComplement,
        },
        *,
    };
    use crate::training::examples::{
        InputPairs,
        tests::{random_examples, random_mlp},
    };

    /// Returns the products gathered for one of the solvers.
    fn gathered<S: HiddenSolver>(mlp: &Mlp, examples: &Examples) -> Products {
        let solver = S::new(mlp.shape(), examples);
        let cost = S::cost(mlp.shape(), examples.samples());
        let mut products = Products::new(&solver, &cost, 2);
        let mut kept = KeptActivations::new(mlp.shape(), examples, 2);
        products.gather(&solver, mlp, &[], examples, &mut kept);
        products
    }

    /// Compares JᵀJ and Jᵀe entry by entry, for more than one block of samples in two parts.
    #[test]
    fn the_products_agree_with_the_dense_jacobian() {
        let (mlp, examples) = (random_mlp(5, 4, 3, 1), random_examples(2 * BLOCK + 44, 5, 3, 2));
        let (h, h1, n1, outputs) = (4, 5, 6, 3);
        let jacobian = jacobian(&mlp, &examples);
        let normal = jacobian.transpose() * &jacobian;
        let gradient = jacobian.transpose() * errors(&mlp, &examples);
        let close = |what: &str, ours: f64, dense: f64| {
            assert!(
                (ours - dense).abs() < 1e-11 * normal.norm_max(),
                "{what}: {ours} {dense}"
            );
        };
        let (factored, iterated) = (
            gathered::<SchurComplement>(&mlp, &examples),
            gathered::<ConjugateGradient>(&mlp, &examples),
        );
        let v = output_weights(&mlp);
        let mixing = v * v.transpose();
        let (hidden, output) = (
            |i: usize, a: usize| a * h + i,
            |q: usize, t: usize| h * n1 + q * outputs + t,
        );
        for sums in [factored.sums(), iterated.sums()] {
            for (i, a) in (0..h).flat_map(|i| (0..n1).map(move |a| (i, a))) {
                close("gradient of W", sums.gradient_w[(a, i)], gradient[(hidden(i, a), 0)]);
                for (q, t) in (0..h1).flat_map(|q| (0..outputs).map(move |t| (q, t))) {
                    let ours = v[(i, t)] * sums.c()[(i * n1 + a, q)];
                    close("C", ours, normal[(hidden(i, a), output(q, t))]);
                }
            }
            for (q, t) in (0..h1).flat_map(|q| (0..outputs).map(move |t| (q, t))) {
                close("gradient of V", sums.gradient_v[(q, t)], gradient[(output(q, t), 0)]);
                for p in 0..h1 {
                    close("G", sums.g[(p, q)], normal[(output(p, t), output(q, t))]);
                }
            }
        }
        let mut square = vec![0.0; n1 * n1];
        for (i, j) in (0..h).flat_map(|i| (0..=i).map(move |j| (i, j))) {
            InputPairs::unpack(
                column(factored.sums().gram.as_ref(), i * (i + 1) / 2 + j),
                n1,
                &mut square,
            );
            for (a, b) in (0..n1).flat_map(|a| (0..n1).map(move |b| (a, b))) {
                let dense = normal[(hidden(i, a), hidden(j, b))];
                close("all of BᵀB", mixing[(i, j)] * square[b * n1 + a], dense);
                if i == j && a >= b {
                    let ours = mixing[(i, i)] * iterated.sums().gram[(a, i * n1 + b)];
                    close("blocks of BᵀB", ours, dense);
                }
            }
        }
    }
}
