//! The products of which the equations consist, summed over blocks of samples.

use faer::{Mat, MatMut, MatRef};

use super::plan::{CHUNK, Plan, Solution};
use crate::{
    network::Shape,
    training::{
        Examples,
        activations::{BlockNow, multiply, multiply_into, scale, tanh_slopes_into},
        examples::{BLOCK, PairsBuffer, column, column_mut},
        parallel::{accumulate_lower, add_product, product},
    },
};

/// Sums over samples, with buffers for one block of them.
pub(super) struct Sums {
    shape: Shape,
    solution: Solution,
    /// Entries of BᵀB that the solver needs: [`Plan::gram`].
    pub(super) gram: Mat<f64>,
    /// C: h·n1 × (h+1), column by column without gaps, so that it is also n1 × h(h+1).
    c: Vec<f64>,
    /// H̃ᵀH̃.
    pub(super) g: Mat<f64>,
    /// Jwᵀe: n1 × h.
    pub(super) gradient_w: Mat<f64>,
    /// Jvᵀe: (h+1) × outputs.
    pub(super) gradient_v: Mat<f64>,
    /// Pairs of inputs, if they are not kept.
    pairs: PairsBuffer,
    /// D: block × h.
    slopes: Mat<f64>,
    /// Columns of a product: block × up to [`CHUNK`].
    columns: Mat<f64>,
    /// Error at the hidden nodes' net input: block × h.
    delta: Mat<f64>,
}

impl Sums {
    pub(super) fn new(plan: &Plan, examples: &Examples) -> Self {
        let shape = plan.shape;
        let (h, n1, h1) = (shape.hidden, shape.inputs + 1, shape.hidden + 1);
        let (rows, columns) = plan.gram();
        Self {
            shape,
            solution: plan.solution,
            gram: Mat::zeros(rows, columns),
            c: vec![0.0; h * n1 * h1],
            g: Mat::zeros(h1, h1),
            gradient_w: Mat::zeros(n1, h),
            gradient_v: Mat::zeros(h1, shape.outputs),
            pairs: match plan.solution {
                Solution::Factored => examples.pairs_buffer(),
                Solution::Iterated => PairsBuffer::unused(),
            },
            slopes: Mat::zeros(BLOCK, h),
            columns: Mat::zeros(BLOCK, (h * h1).min(CHUNK).max(n1)),
            delta: Mat::zeros(BLOCK, h),
        }
    }

    /// C: h·n1 × (h+1).
    pub(super) fn c(&self) -> MatRef<'_, f64> {
        MatRef::from_column_major_slice(&self.c, self.shape.hidden_weights(), self.shape.hidden + 1)
    }

    /// Entry of Jwᵀe + `decay`, which has an entry for each weight or is empty.
    pub(super) fn right_w(&self, decay: &[f64], input: usize, node: usize) -> f64 {
        let decay = decay.get(input * self.shape.hidden + node);
        self.gradient_w[(input, node)] + decay.copied().unwrap_or_default()
    }

    /// Entry of Jvᵀe + `decay`, which has an entry for each weight or is empty.
    pub(super) fn right_v(&self, decay: &[f64], node: usize, output: usize) -> f64 {
        let decay = decay.get(self.shape.hidden_weights() + node * self.shape.outputs + output);
        self.gradient_v[(node, output)] + decay.copied().unwrap_or_default()
    }

    fn sums(&mut self) -> [&mut Mat<f64>; 4] {
        [&mut self.gram, &mut self.g, &mut self.gradient_w, &mut self.gradient_v]
    }

    pub(super) fn clear(&mut self) {
        self.c.fill(0.0);
        self.sums().into_iter().for_each(|sum| sum.fill(0.0));
    }

    /// Adds the sums of another part.
    pub(super) fn add(&mut self, other: &Self) {
        self.c.iter_mut().zip(&other.c).for_each(|(sum, value)| *sum += value);
        let others = [&other.gram, &other.g, &other.gradient_w, &other.gradient_v];
        self.sums()
            .into_iter()
            .zip(others)
            .for_each(|(sum, other)| *sum += other);
    }

    /// Multiplies Jvᵀe by the roots of the targets' precisions.
    pub(super) fn scale_outputs(&mut self, precisions: &[f64]) {
        for (target, precision) in precisions.iter().enumerate() {
            scale(column_mut(self.gradient_v.as_mut(), target), precision.sqrt());
        }
    }

    /// Adds a block of samples, with the weights `v` of the output layer from errors to hidden nodes.
    pub(super) fn add_block(&mut self, v: &[f64], now: &BlockNow<'_>, examples: &Examples) {
        let Shape {
            inputs,
            hidden: h,
            outputs,
        } = self.shape;
        let (a, hidden, errors) = (now.block.inputs.as_ref(), now.hidden(), now.errors());
        let mut slopes = self.slopes.as_mut().subrows_mut(0, now.block.samples());
        let mut delta = self.delta.as_mut().subrows_mut(0, now.block.samples());
        let mut columns = self.columns.as_mut().subrows_mut(0, now.block.samples());
        for node in 0..h {
            tanh_slopes_into(column_mut(slopes.as_mut(), node), column(hidden, node));
        }
        let slope = |node| column(slopes.as_ref(), node);

        match self.solution {
            Solution::Factored => {
                let pairs = examples.input_pairs(now.number, &mut self.pairs);
                let nodes = (0..h).flat_map(|i| (0..=i).map(move |j| (i, j)));
                let factors = nodes.map(|(i, j)| (slope(i), slope(j)));
                add_products(self.gram.as_mut(), pairs, columns.as_mut(), factors);
            }
            Solution::Iterated => {
                // AᵀDᵢ²A for each node i.
                for node in 0..h {
                    let mut weighted = columns.as_mut().subcols_mut(0, inputs + 1);
                    for input in 0..=inputs {
                        multiply_into(column_mut(weighted.as_mut(), input), slope(node), column(a, input));
                    }
                    let sum = self.gram.as_mut().subcols_mut(node * (inputs + 1), inputs + 1);
                    accumulate_lower(sum, weighted.as_ref().transpose(), weighted.as_ref(), 1.0);
                }
            }
        }
        // Column q·h + i of C has the factors Dᵢ and H̃_q.
        let c = MatMut::from_column_major_slice_mut(&mut self.c, inputs + 1, h * (h + 1));
        let nodes = (0..=h).flat_map(|q| (0..h).map(move |i| (i, q)));
        let factors = nodes.map(|(i, q)| (slope(i), column(hidden, q)));
        add_products(c, a.transpose(), columns, factors);
        add_product(self.g.as_mut(), hidden.transpose(), hidden, 1.0);

        add_product(self.gradient_v.as_mut(), hidden.transpose(), errors, 1.0);
        let v = MatRef::from_row_major_slice(v, h + 1, outputs).subrows(0, h);
        product(delta.as_mut(), errors, v.transpose());
        for node in 0..h {
            multiply(column_mut(delta.as_mut(), node), slope(node));
        }
        add_product(self.gradient_w.as_mut(), a.transpose(), delta.as_ref(), 1.0);
    }
}

/// Adds `left` times the matrix whose columns are the elementwise products of `factors`, as many columns at a time as
/// the buffer `columns` has.
fn add_products<'a>(
    mut sum: MatMut<'_, f64>,
    left: MatRef<'_, f64>,
    mut columns: MatMut<'_, f64>,
    mut factors: impl Iterator<Item = (&'a [f64], &'a [f64])>,
) {
    let width = columns.ncols();
    for first in (0..sum.ncols()).step_by(width) {
        let count = width.min(sum.ncols() - first);
        for (index, (a, b)) in factors.by_ref().take(count).enumerate() {
            multiply_into(column_mut(columns.as_mut(), index), a, b);
        }
        let right = columns.as_ref().subcols(0, count);
        add_product(sum.as_mut().subcols_mut(first, count), left, right, 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{
            NormalEquations,
            elimination::output_weights,
            schur::unpack,
            tests::dense::{errors, jacobian},
        },
        *,
    };
    use crate::training::examples::tests::{random_examples, random_mlp};

    /// Compares JᵀJ and Jᵀe entry by entry, for more than one block of samples.
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
        let [factored, iterated] = [Plan::factored, Plan::iterated].map(|plan| {
            let mut equations = NormalEquations::new(&plan(mlp.shape(), examples.samples()), &examples);
            equations.gather(&mlp, &[], &examples);
            equations.parts.swap_remove(0)
        });
        let v = output_weights(&mlp);
        let mixing = v * v.transpose();
        let (hidden, output) = (
            |i: usize, a: usize| a * h + i,
            |q: usize, t: usize| h * n1 + q * outputs + t,
        );
        for sums in [&factored, &iterated] {
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
            unpack(column(factored.gram.as_ref(), i * (i + 1) / 2 + j), n1, &mut square);
            for (a, b) in (0..n1).flat_map(|a| (0..n1).map(move |b| (a, b))) {
                let dense = normal[(hidden(i, a), hidden(j, b))];
                close("all of BᵀB", mixing[(i, j)] * square[b * n1 + a], dense);
                if i == j && a >= b {
                    let ours = mixing[(i, i)] * iterated.gram[(a, i * n1 + b)];
                    close("blocks of BᵀB", ours, dense);
                }
            }
        }
    }
}
