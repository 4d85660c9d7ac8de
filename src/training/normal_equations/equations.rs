//! The normal equations of one network and its examples.

use faer::MatRef;

use super::{
    choice::factoring_is_cheaper,
    conjugate::ConjugateGradient,
    cost::Cost,
    elimination::{Elimination, output_weights, write_negative},
    hidden_solver::{HiddenSolver, System},
    output_layer::{OutputLayer, ridge},
    products::Products,
    schur::SchurComplement,
    weight_classes::{Decay, PerClass},
};
use crate::{
    network::{Mlp, Shape},
    training::{Evaluation, Examples, activations::KeptActivations},
};

/// The normal equations of a network and its examples: evaluated, gathered, and solved for any damping.
pub(in crate::training) struct NormalEquations<S: HiddenSolver + ?Sized = dyn HiddenSolver> {
    activations: KeptActivations,
    products: Products,
    elimination: Elimination,
    projection: OutputLayer,
    /// The hidden layer's right-hand side, then its negative step, node by node.
    right: Vec<f64>,
    solver: Box<S>,
}

/// Normal equations that are always factored.
pub(in crate::training) type FactoredEquations = NormalEquations<SchurComplement>;

impl NormalEquations {
    /// Allocates for a network of this shape and these examples, with the solver that costs less.
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

    /// About how many bytes [`Self::cheapest`] takes, beside the samples.
    pub(in crate::training) fn cheapest_bytes(shape: Shape, samples: usize) -> usize {
        if factoring_is_cheaper(shape, samples) {
            SchurComplement::cost(shape, samples).bytes()
        } else {
            ConjugateGradient::cost(shape, samples).bytes()
        }
    }

    /// About how many multiplications gathering and solving once with [`Self::cheapest`] take.
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

    /// About how many bytes [`Self::factored`] takes, beside the samples.
    pub(in crate::training) fn factored_bytes(shape: Shape, samples: usize) -> usize {
        SchurComplement::cost(shape, samples).bytes()
    }

    /// About how many multiplications gathering and solving once with [`Self::factored`] take.
    pub(in crate::training) fn factored_multiplications(shape: Shape, samples: usize) -> f64 {
        SchurComplement::cost(shape, samples).total()
    }

    /// Number of bytes that [`Self::trace_of_inverse`] takes in addition.
    pub(in crate::training) fn inverse_bytes(shape: Shape) -> usize {
        let (order, h1) = (shape.hidden_weights(), shape.hidden + 1);
        let entries = order.saturating_mul(order + h1).saturating_add(h1 * h1);
        entries.saturating_mul(size_of::<f64>())
    }

    /// About how many multiplications [`Self::trace_of_inverse`] takes: factor and inverse of S, and a triangular system
    /// of h + 1 columns for each output.
    pub(in crate::training) fn trace_multiplications(shape: Shape) -> f64 {
        let (order, h1) = (shape.hidden_weights() as f64, shape.hidden as f64 + 1.0);
        order * order * (order / 3.0 + h1 / 2.0 + shape.outputs as f64 * h1 / 2.0)
    }

    /// Returns tr (JᵀJ + damping·I)⁻¹ from the products last gathered; `None` if the matrix is not positive definite in
    /// the arithmetic.
    pub(in crate::training) fn trace_of_inverse(&mut self, mlp: &Mlp, damping: f64) -> Option<f64> {
        let (sums, v) = (self.products.sums(), output_weights(mlp));
        let damping = PerClass::all(damping);
        self.elimination.factor(sums, damping)?;
        self.solver.factor(sums, self.elimination.f.as_ref(), v, damping)?;
        let trace = self.solver.trace_of_inverse(&mut self.elimination, v);
        trace.is_finite().then_some(trace)
    }

    /// As [`Self::trace_of_inverse`], the part of each class of weights, which each have their damping.
    pub(in crate::training) fn traces_of_inverse(&mut self, mlp: &Mlp, damping: PerClass) -> Option<PerClass> {
        let (sums, v) = (self.products.sums(), output_weights(mlp));
        self.elimination.factor(sums, damping)?;
        self.solver.factor(sums, self.elimination.f.as_ref(), v, damping)?;
        let traces = self.solver.traces_of_inverse(&mut self.elimination, v);
        traces.values().iter().all(|trace| trace.is_finite()).then_some(traces)
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
            projection: OutputLayer::new(shape, gathering),
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
        self.products
            .gather(&*self.solver, mlp, examples, &mut self.activations)
    }

    /// Solves for the step at damping `mu` from the products last gathered, at the same `mlp`, and writes it in the order
    /// of [`Mlp::weights`]. `None`, with `step` unspecified, if the damped equations cannot be solved in the arithmetic:
    /// a larger `mu` is needed.
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

    /// Solves for the step of the hidden layer alone, with the output layer following as its least-squares solution.
    pub(in crate::training) fn solve_hidden(
        &mut self,
        mlp: &Mlp,
        examples: &Examples,
        mu: f64,
        step: &mut [f64],
    ) -> Option<()> {
        let sums = self.products.sums();
        self.elimination.factor(sums, PerClass::all(ridge(&sums.g)))?;
        let gradient = sums.gradient_w.col_iter().flat_map(|column| column.iter());
        self.right
            .iter_mut()
            .zip(gradient)
            .for_each(|(right, gradient)| *right = *gradient);
        self.solve_for_hidden(mlp, examples, PerClass::all(mu))?;
        let shape = mlp.shape();
        let right = MatRef::from_column_major_slice(&self.right, shape.inputs + 1, shape.hidden);
        write_negative(right, step);
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
        // By `hypot`, since the squares overflow where the error weighs next to nothing against the weights.
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

    /// Gives `mlp` the output layer of least squared error for its hidden layer; `None` if there is none in the
    /// arithmetic.
    pub(in crate::training) fn solve_outputs(&mut self, mlp: &mut Mlp, examples: &Examples) -> Option<()> {
        self.projection.solve(mlp, examples, &mut self.activations)
    }
}

#[cfg(test)]
mod tests {
    use faer::linalg::solvers::DenseSolveCore;

    use super::{
        super::dense::{DampedLeastSquares, distance, errors, jacobian},
        *,
    };
    use crate::training::{
        backpropagation::Backpropagation,
        examples::tests::{random_examples, random_mlp},
    };

    /// Every solver, with its name.
    fn solvers(shape: Shape, examples: &Examples) -> [(&'static str, NormalEquations); 2] {
        let samples = examples.samples();
        let factored = NormalEquations::<dyn HiddenSolver>::with_solver(
            Box::new(SchurComplement::new(shape, examples)),
            &SchurComplement::cost(shape, samples),
            examples,
        );
        let iterated = NormalEquations::<dyn HiddenSolver>::with_solver(
            Box::new(ConjugateGradient::new(shape, examples)),
            &ConjugateGradient::cost(shape, samples),
            examples,
        );
        [("factored", factored), ("conjugate gradients", iterated)]
    }

    /// The step at damping `mu`, solved as after a rejected step: another network was evaluated since.
    fn step(equations: &mut NormalEquations, mlp: &Mlp, examples: &Examples, mu: f64) -> Option<Vec<f64>> {
        equations.gather(mlp, examples);
        equations.mse(&Mlp::zeros(mlp.shape()), examples);
        let mut step = vec![0.0; mlp.weights().len()];
        equations.solve(mlp, examples, mu, &mut step)?;
        Some(step)
    }

    /// Rounding is amplified by the condition number κ of the normal equations, and so is the residual that conjugate
    /// gradients leave. The directions in which the step is then uncertain hardly change the linearised error: at least
    /// its decrease is found to six digits.
    #[test]
    fn the_step_is_that_of_the_dense_jacobian() {
        for (inputs, hidden, outputs, samples) in [
            (5, 4, 3, 300),
            (1, 1, 1, 3),
            (7, 2, 1, 40),
            (12, 6, 5, 513),
            (8, 12, 2, 40),
            (10, 16, 3, 90),
        ] {
            let mlp = random_mlp(inputs, hidden, outputs, 1);
            let examples = random_examples(samples, inputs, outputs, 2);
            for mu in [1e-14, 1e-10, 1e-6, 1e-3, 1.0, 1e6] {
                let dense = DampedLeastSquares::new(&mlp, &examples, mu);
                let (expected, condition) = (dense.step(), dense.normal_condition());
                let [(_, mut factored), (_, mut iterated)] = solvers(mlp.shape(), &examples);
                let what = format!("{inputs}-{hidden}-{outputs}, mu {mu:e}, condition {condition:.1e}");
                let rounding = 30.0 * f64::EPSILON * condition;
                match step(&mut factored, &mlp, &examples, mu) {
                    Some(step) => {
                        let distance = distance(&step, &expected);
                        assert!(distance < rounding.max(1e-12), "{what}, factored: {distance:e}");
                    }
                    // Lost in rounding.
                    None => assert!(rounding > 1.0, "{what}, factored"),
                }
                match step(&mut iterated, &mlp, &examples, mu) {
                    Some(step) => {
                        let distance = distance(&step, &expected);
                        let missed = dense.missed(&step, &expected);
                        assert!(missed < 1e-6, "{what}, iterated: {missed:e}");
                        let close = rounding + 1e-8 * condition;
                        assert!(distance < close || condition > 1e6, "{what}, iterated: {distance:e}");
                    }
                    None => assert!(rounding > 1.0, "{what}, iterated"),
                }
            }
        }
    }

    /// Decay that differs between the classes of weights, of output biases towards values of their own, beside the matrix
    /// written out.
    #[test]
    fn every_class_of_weights_decays_at_its_own_rate() {
        let (inputs, hidden, outputs) = (5, 4, 3);
        let (mlp, examples) = (
            random_mlp(inputs, hidden, outputs, 1),
            random_examples(300, inputs, outputs, 2),
        );
        let rates = PerClass {
            hidden_weights: 0.3,
            hidden_biases: 7.0,
            output_weights: 0.05,
            output_biases: 40.0,
        };
        let (biases, damping) = ([0.5, -0.3, 0.1], rates.map(|rate| rate + 0.2));
        let class = |weight: usize| match weight {
            0..20 => 0,
            20..24 => 1,
            24..36 => 2,
            _ => 3,
        };
        let (jacobian, errors) = (jacobian(&mlp, &examples), errors(&mlp, &examples));
        let mut matrix = jacobian.transpose() * &jacobian;
        let mut right = jacobian.transpose() * &errors;
        for (index, weight) in mlp.weights().iter().enumerate() {
            matrix[(index, index)] += damping.values()[class(index)];
            let towards = if index < 36 { 0.0 } else { biases[index - 36] };
            right[(index, 0)] += rates.values()[class(index)] * (weight - towards);
        }
        let inverse = matrix.partial_piv_lu().inverse();
        let step = &inverse * &right;

        let mut equations = NormalEquations::factored(mlp.shape(), &examples);
        equations.gather(&mlp, &examples);
        let (decay, mut ours) = (Decay::new(rates, &biases), vec![0.0; mlp.weights().len()]);
        equations
            .solve_with_decay(&mlp, &examples, damping, decay, &mut ours)
            .unwrap();
        let expected: Vec<f64> = (0..ours.len()).map(|index| -step[(index, 0)]).collect();
        assert!(distance(&ours, &expected) < 1e-11, "{:e}", distance(&ours, &expected));
        let length = equations.gradient_length(&mlp, decay);
        assert!((length / right.norm_l2() - 1.0).abs() < 1e-12, "{length}");
        let traces = equations.traces_of_inverse(&mlp, damping).unwrap().values();
        let mut expected = [0.0; 4];
        (0..ours.len()).for_each(|index| expected[class(index)] += inverse[(index, index)]);
        for (ours, expected) in traces.iter().zip(expected) {
            assert!((ours / expected - 1.0).abs() < 1e-11, "{traces:?}, {expected:?}");
        }
        let whole = equations.trace_of_inverse(&mlp, 0.7).unwrap();
        let parts: f64 = equations
            .traces_of_inverse(&mlp, PerClass::all(0.7))
            .unwrap()
            .values()
            .iter()
            .sum();
        assert!((whole / parts - 1.0).abs() < 1e-13);
    }

    /// Enough samples that they are divided into parts.
    #[test]
    fn parts_of_the_samples_add_up() {
        let (mlp, examples) = (random_mlp(20, 12, 5, 3), random_examples(40_000, 20, 5, 4));
        let expected = Backpropagation::new(&mlp).evaluate(&mlp, &examples);
        let blocks = examples.blocks().len();
        assert!(SchurComplement::cost(mlp.shape(), 40_000).gathering_parts(blocks) > 1);
        assert!(ConjugateGradient::cost(mlp.shape(), 40_000).gathering_parts(blocks) > 1);
        let [factored, iterated] = solvers(mlp.shape(), &examples).map(|(name, mut equations)| {
            let ours = equations.gather(&mlp, &examples);
            assert!((ours.gradient_norm - expected.gradient_norm).abs() < 1e-13, "{name}");
            step(&mut equations, &mlp, &examples, 1.0).unwrap()
        });
        for (a, b) in factored.iter().zip(&iterated) {
            assert!((a - b).abs() < 1e-6 * a.abs().max(1e-3), "{a} {b}");
        }
    }

    #[test]
    fn it_evaluates_as_back_propagation_does() {
        let mlp = random_mlp(6, 5, 4, 3);
        let examples = random_examples(400, 6, 4, 4);
        let ours = NormalEquations::cheapest(mlp.shape(), &examples).gather(&mlp, &examples);
        let expected = Backpropagation::new(&mlp).evaluate(&mlp, &examples);
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
        for (name, mut equations) in solvers(mlp.shape(), &examples) {
            for mu in [0.0, 1e-300, 1e-3, 1e300] {
                if let Some(step) = step(&mut equations, &mlp, &examples, mu) {
                    assert!(step.iter().all(|value| value.is_finite()), "{name}, mu {mu}");
                }
            }
        }
    }
}
