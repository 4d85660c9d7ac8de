//! The normal equations of one network and its examples, and the sums over samples of which they consist.

use faer::{Mat, MatRef};

use super::{
    Cost,
    cholesky::{Elimination, output_weights},
    conjugate::{ConjugateGradient, HiddenSolver, System},
    factoring_is_cheaper,
    products::Products,
    schur::{Decay, PerClass, SchurComplement, Traces},
};
use crate::{
    network::{Mlp, Shape},
    training::{Evaluation, Examples, activations::KeptActivations},
};

/// Normal equations of a network and its examples: evaluated, gathered, and solved for any damping.
pub(in crate::training) struct NormalEquations<S: HiddenSolver + ?Sized = dyn HiddenSolver> {
    activations: KeptActivations,
    products: Products,
    elimination: Elimination,
    /// Right-hand side of the hidden layer, then its negative step, node by node.
    right: Vec<f64>,
    solver: Box<S>,
}

/// Normal equations that are always factored.
pub(in crate::training) type FactoredEquations = NormalEquations<SchurComplement>;

impl NormalEquations {
    /// Allocates for a network of this shape and these examples, with the cheaper solver.
    pub(in crate::training) fn cheapest(shape: Shape, examples: &Examples) -> Self {
        let samples = examples.samples();
        if factoring_is_cheaper(shape, samples) {
            let solver = Box::new(SchurComplement::new(shape, examples));
            Self::with_solver(solver, &SchurComplement::cost(shape, samples), examples)
        } else {
            let solver = Box::new(ConjugateGradient::new(shape, examples));
            Self::with_solver(solver, &ConjugateGradient::cost(shape, samples), examples)
        }
    }

    /// Approximate memory in bytes of [`Self::cheapest`], without the samples.
    pub(in crate::training) fn cheapest_bytes(shape: Shape, samples: usize) -> usize {
        if factoring_is_cheaper(shape, samples) {
            SchurComplement::cost(shape, samples).bytes()
        } else {
            ConjugateGradient::cost(shape, samples).bytes()
        }
    }

    /// Approximate number of multiplications to gather and solve once with [`Self::cheapest`].
    pub(in crate::training) fn cheapest_multiplications(shape: Shape, samples: usize) -> f64 {
        if factoring_is_cheaper(shape, samples) {
            SchurComplement::cost(shape, samples).total()
        } else {
            ConjugateGradient::cost(shape, samples).total()
        }
    }
}

impl NormalEquations<SchurComplement> {
    /// Allocates for a network of this shape and these examples.
    pub(in crate::training) fn factored(shape: Shape, examples: &Examples) -> Self {
        let solver = Box::new(SchurComplement::new(shape, examples));
        Self::with_solver(solver, &SchurComplement::cost(shape, examples.samples()), examples)
    }

    /// Approximate memory in bytes of [`Self::factored`], without the samples.
    pub(in crate::training) fn factored_bytes(shape: Shape, samples: usize) -> usize {
        SchurComplement::cost(shape, samples).bytes()
    }

    /// Approximate number of multiplications to gather and solve once with [`Self::factored`].
    pub(in crate::training) fn factored_multiplications(shape: Shape, samples: usize) -> f64 {
        SchurComplement::cost(shape, samples).total()
    }

    /// Additional memory in bytes of [`Self::trace_of_inverse`].
    pub(in crate::training) fn inverse_bytes(shape: Shape) -> usize {
        let (order, h1) = (shape.hidden_weights(), shape.hidden + 1);
        let entries = order.saturating_mul(order + h1).saturating_add(h1 * h1);
        entries.saturating_mul(size_of::<f64>())
    }

    /// Approximate number of multiplications of [`Self::trace_of_inverse`]: factor and inverse of S, and a triangular
    /// system of h + 1 columns for each output.
    pub(in crate::training) fn trace_multiplications(shape: Shape) -> f64 {
        let (order, h1) = (shape.hidden_weights() as f64, shape.hidden as f64 + 1.0);
        order * order * (order / 3.0 + h1 / 2.0 + shape.outputs as f64 * h1 / 2.0)
    }

    /// Returns tr (JᵀJ + damping·I)⁻¹ from the products last gathered; `None` if the matrix is not numerically positive
    /// definite.
    pub(in crate::training) fn trace_of_inverse(&mut self, mlp: &Mlp, damping: f64) -> Option<f64> {
        let (sums, v) = (self.products.sums(), output_weights(mlp));
        let damping = PerClass::all(damping);
        self.elimination.factor(sums, damping)?;
        self.solver.factor(sums, self.elimination.f.as_ref(), v, damping)?;
        let trace = self.solver.trace_of_inverse(&mut self.elimination, v);
        trace.is_finite().then_some(trace)
    }

    /// Returns the contributions of weights to [`Self::trace_of_inverse`], with one damping per class.
    pub(in crate::training) fn traces_of_inverse(&mut self, mlp: &Mlp, damping: PerClass) -> Option<Traces> {
        let (sums, v) = (self.products.sums(), output_weights(mlp));
        self.elimination.factor(sums, damping)?;
        self.solver.factor(sums, self.elimination.f.as_ref(), v, damping)?;
        let traces = self.solver.traces_of_inverse(&mut self.elimination, v);
        traces
            .classes()
            .values()
            .iter()
            .all(|trace| trace.is_finite())
            .then_some(traces)
    }
}

impl<S: HiddenSolver + ?Sized> NormalEquations<S> {
    fn with_solver(solver: Box<S>, cost: &Cost, examples: &Examples) -> Self {
        let shape = cost.shape;
        let gathering = cost.gathering_parts(examples.blocks().len());
        Self {
            activations: KeptActivations::new(shape, examples, gathering.max(solver.parts())),
            products: Products::new(&*solver, cost, gathering),
            elimination: Elimination::new(shape),
            right: vec![0.0; shape.hidden_weights()],
            solver,
        }
    }

    /// Returns the mean squared error at the weights of `mlp`. Gathering at the same weights next does not run the
    /// network a second time.
    pub(in crate::training) fn mse(&mut self, mlp: &Mlp, examples: &Examples) -> f64 {
        self.activations.evaluate(mlp, examples) / examples.errors()
    }

    /// Gathers all products at the weights of `mlp`.
    pub(in crate::training) fn gather(&mut self, mlp: &Mlp, examples: &Examples) -> Evaluation {
        self.gather_weighted(mlp, &[], examples)
    }

    /// As [`Self::gather`], for the equations in which errors and output weights of target t are multiplied by √ρₜ,
    /// with ρ the `precisions` of the targets, or 1 if there are none. To solve them, pass a network whose output
    /// weights are multiplied, too.
    pub(in crate::training) fn gather_weighted(
        &mut self,
        mlp: &Mlp,
        precisions: &[f64],
        examples: &Examples,
    ) -> Evaluation {
        self.products
            .gather(&*self.solver, mlp, precisions, examples, &mut self.activations)
    }

    /// Returns the sum of squared errors of each target at the weights of `mlp`.
    pub(in crate::training) fn squares_of_targets(&mut self, mlp: &Mlp, examples: &Examples) -> Vec<f64> {
        self.activations.squares_of_outputs(mlp, examples)
    }

    /// Solves for the step at damping `mu` from the products last gathered, at the same `mlp`, and writes it in the
    /// order of [`Mlp::weights`]. Returns `None`, with `step` unspecified, if the damped equations are numerically
    /// singular: a larger `mu` is needed.
    pub(in crate::training) fn solve(
        &mut self,
        mlp: &Mlp,
        examples: &Examples,
        mu: f64,
        step: &mut [f64],
    ) -> Option<()> {
        self.solve_with_decay(mlp, examples, PerClass::all(mu), Decay::NONE, step)
    }

    /// As [`Self::solve`], with `decay`·Σw² of each class added to the sum of squared errors: solves
    /// `(JᵀJ + damping·I) δ = −(Jᵀe + decay·w)`. The `damping` includes the `decay`.
    pub(in crate::training) fn solve_with_decay(
        &mut self,
        mlp: &Mlp,
        examples: &Examples,
        damping: PerClass,
        decay: Decay<'_>,
        step: &mut [f64],
    ) -> Option<()> {
        let sums = self.products.sums();
        self.elimination.factor(sums, damping)?;
        self.elimination.reduce(sums, mlp, decay, &mut self.right);
        self.solve_for_hidden(mlp, examples, damping)?;
        self.elimination
            .complete(self.products.sums(), mlp, decay, &self.right, step);
        step.iter().all(|value| value.is_finite()).then_some(())
    }

    /// Replaces the right-hand side of the hidden layer by its solution.
    fn solve_for_hidden(&mut self, mlp: &Mlp, examples: &Examples, damping: PerClass) -> Option<()> {
        let system = System {
            mlp,
            examples,
            sums: self.products.sums(),
            elimination: &self.elimination,
            damping,
        };
        self.solver.solve(system, &mut self.activations, &mut self.right)
    }

    /// Returns the length of Jᵀe + decay·w from the products last gathered.
    pub(in crate::training) fn gradient_length(&self, mlp: &Mlp, decay: Decay<'_>) -> f64 {
        let (w, v) = mlp.layers();
        let Shape { inputs, hidden, .. } = mlp.shape();
        // `hypot` avoids overflow of the squares when the error is negligible compared with the decay.
        let length = |gradient: MatRef<'_, f64>, weights: &[f64], pull: &dyn Fn(usize, usize, f64) -> f64| -> f64 {
            let weights = MatRef::from_row_major_slice(weights, gradient.nrows(), gradient.ncols());
            let columns = gradient.col_iter().zip(weights.col_iter()).enumerate();
            let entries = columns.flat_map(|(column, (gradient, weights))| {
                let entries = gradient.iter().zip(weights.iter()).enumerate();
                entries.map(move |(row, (gradient, weight))| gradient + pull(row, column, *weight))
            });
            entries.fold(0.0, f64::hypot)
        };
        let sums = self.products.sums();
        let w = length(sums.gradient_w.as_ref(), w, &|row, _, weight| {
            decay.pull_in_hidden((row, inputs), weight)
        });
        w.hypot(length(sums.gradient_v.as_ref(), v, &|row, column, weight| {
            decay.pull_in_output((row, hidden), column, weight)
        }))
    }
}

/// Sums over samples.
pub(super) struct Sums {
    pub(super) shape: Shape,
    /// Entries of BᵀB that the solver needs.
    pub(super) gram: Mat<f64>,
    /// C: h·n1 × (h+1), column by column without gaps, so that it is also n1 × h(h+1).
    pub(super) c: Vec<f64>,
    /// H̃ᵀH̃.
    pub(super) g: Mat<f64>,
    /// Jwᵀe: n1 × h.
    pub(super) gradient_w: Mat<f64>,
    /// Jvᵀe: (h+1) × outputs.
    pub(super) gradient_v: Mat<f64>,
}

impl Sums {
    pub(super) fn new(shape: Shape, (rows, columns): (usize, usize)) -> Self {
        let (h, n1, h1) = (shape.hidden, shape.inputs + 1, shape.hidden + 1);
        Self {
            shape,
            gram: Mat::zeros(rows, columns),
            c: vec![0.0; h * n1 * h1],
            g: Mat::zeros(h1, h1),
            gradient_w: Mat::zeros(n1, h),
            gradient_v: Mat::zeros(h1, shape.outputs),
        }
    }

    /// C: h·n1 × (h+1).
    pub(super) fn c(&self) -> MatRef<'_, f64> {
        let h1 = self.shape.hidden + 1;
        MatRef::from_column_major_slice(&self.c, self.shape.hidden_weights(), h1)
    }

    pub(super) fn clear(&mut self) {
        self.c.fill(0.0);
        for sum in [&mut self.gram, &mut self.g, &mut self.gradient_w, &mut self.gradient_v] {
            sum.fill(0.0);
        }
    }

    /// Adds the sums of another part.
    pub(super) fn add(&mut self, other: &Self) {
        self.c.iter_mut().zip(&other.c).for_each(|(sum, value)| *sum += value);
        self.gram += &other.gram;
        self.g += &other.g;
        self.gradient_w += &other.gradient_w;
        self.gradient_v += &other.gradient_v;
    }
}

#[cfg(test)]
mod tests;
