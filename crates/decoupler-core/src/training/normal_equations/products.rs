//! The products of which the equations consist, summed over blocks of samples.

use faer::{Mat, MatMut, MatRef};

use super::plan::{CHUNK, Plan, Solution};
use crate::{
    network::Shape,
    training::{
        activations::{Activations, add_gradient, change_each, multiply_into},
        examples::{BLOCK, Block, column, column_mut, fill_pairs, pairs},
        parallel::{accumulate_lower, add_product},
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
    /// Jᵀe in the order of [`Mlp::weights`](crate::network::Mlp::weights).
    pub(super) gradient: Vec<f64>,
    /// Pairs of inputs, if the solver needs them: n1(n1+1)/2 × block.
    pairs: Mat<f64>,
    /// D: block × h.
    slopes: Mat<f64>,
    /// Columns of a product: block × up to [`CHUNK`].
    columns: Mat<f64>,
    /// Error at the hidden nodes' net input: block × h.
    delta: Mat<f64>,
}

impl Sums {
    pub(super) fn new(plan: &Plan) -> Self {
        let shape = plan.shape;
        let (h, n1, h1) = (shape.hidden, shape.inputs + 1, shape.hidden + 1);
        let (rows, columns) = plan.gram();
        Self {
            shape,
            solution: plan.solution,
            gram: Mat::zeros(rows, columns),
            c: vec![0.0; h * n1 * h1],
            g: Mat::zeros(h1, h1),
            gradient: vec![0.0; shape.weights()],
            pairs: match plan.solution {
                Solution::Factored => Mat::zeros(pairs(n1), BLOCK),
                Solution::Iterated => Mat::new(),
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

    pub(super) fn clear(&mut self) {
        self.gram.fill(0.0);
        self.g.fill(0.0);
        self.c.fill(0.0);
        self.gradient.fill(0.0);
    }

    /// Adds the sums of another part.
    pub(super) fn add(&mut self, other: &Self) {
        self.gram += &other.gram;
        self.g += &other.g;
        change_each(&mut self.c, &other.c, |sum, value| *sum += value);
        change_each(&mut self.gradient, &other.gradient, |sum, value| *sum += value);
    }

    /// Adds a block of samples, with the weights `v` of the output layer from errors to hidden nodes.
    pub(super) fn add_block(&mut self, v: &[f64], block: &Block, now: &Activations) {
        let (inputs, h) = (self.shape.inputs, self.shape.hidden);
        let (a, hidden) = (block.inputs.as_ref(), now.hidden(block));
        let mut slopes = self.slopes.as_mut().subrows_mut(0, block.samples());
        let mut columns = self.columns.as_mut().subrows_mut(0, block.samples());
        for node in 0..h {
            let slopes = column_mut(slopes.as_mut(), node);
            change_each(slopes, column(hidden, node), |slope, h| *slope = 1.0 - h * h);
        }
        let slope = |node| column(slopes.as_ref(), node);

        match self.solution {
            Solution::Factored => {
                let mut pairs = self.pairs.as_mut().subcols_mut(0, block.samples());
                fill_pairs(a, pairs.as_mut());
                let nodes = (0..h).flat_map(|i| (0..=i).map(move |j| (i, j)));
                let factors = nodes.map(|(i, j)| (slope(i), slope(j)));
                add_products(self.gram.as_mut(), pairs.as_ref(), columns.as_mut(), factors);
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

        let delta = self.delta.as_mut();
        add_gradient(
            &mut self.gradient,
            1.0,
            (self.shape, v),
            (block, now),
            delta,
            add_product,
        );
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
            elimination::unpack,
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
                close(
                    "gradient of W",
                    sums.gradient[hidden(i, a)],
                    gradient[(hidden(i, a), 0)],
                );
                for (q, t) in (0..h1).flat_map(|q| (0..outputs).map(move |t| (q, t))) {
                    let ours = v[(i, t)] * sums.c()[(i * n1 + a, q)];
                    close("C", ours, normal[(hidden(i, a), output(q, t))]);
                }
            }
            for (q, t) in (0..h1).flat_map(|q| (0..outputs).map(move |t| (q, t))) {
                close(
                    "gradient of V",
                    sums.gradient[output(q, t)],
                    gradient[(output(q, t), 0)],
                );
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
