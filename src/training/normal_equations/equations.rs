use faer::MatRef;

use super::{
    conjugate::{ConjugateGradient, System},
    cost::{Way, pushing_parts},
    elimination::{Elimination, output_weights, write_negative},
    output_layer::{OutputLayer, ridge},
    products::Products,
    schur::SchurComplement,
};
use crate::{
    network::{Mlp, Shape},
    training::{Evaluation, Examples, activations::KeptActivations},
};

/// The normal equations of a network and its examples: evaluated, gathered, and solved for any damping.
pub(in crate::training) struct NormalEquations {
    activations: KeptActivations,
    products: Products,
    elimination: Elimination,
    hidden: HiddenLayer,
    projection: OutputLayer,
    /// The hidden layer's right-hand side, then its negative step, node by node.
    right: Vec<f64>,
}

/// How the equations of the hidden layer are solved.
enum HiddenLayer {
    Factored(SchurComplement),
    Iterated(ConjugateGradient),
}

impl NormalEquations {
    /// Room for a network of this shape and these examples, solved in the way that is cheaper.
    pub(in crate::training) fn new(shape: Shape, examples: &Examples) -> Self {
        Self::solved_by(Way::cheaper(shape, examples.samples()), shape, examples)
    }

    /// Room for a network of this shape and these examples, solved in the given way. The trace of the inverse needs
    /// [`Way::Factored`].
    pub(in crate::training) fn solved_by(way: Way, shape: Shape, examples: &Examples) -> Self {
        let blocks = examples.blocks().len();
        let (gathering, pushing) = (way.gathering_parts(shape, blocks), pushing_parts(shape, blocks));
        let (hidden, parts) = match way {
            Way::Factored => (HiddenLayer::Factored(SchurComplement::new(shape)), gathering),
            Way::Iterated => {
                let conjugate = ConjugateGradient::new(shape, pushing);
                (HiddenLayer::Iterated(conjugate), gathering.max(pushing))
            }
        };
        Self {
            activations: KeptActivations::new(shape, examples, parts),
            products: Products::new(shape, examples, way.gram_part(), gathering),
            elimination: Elimination::new(shape),
            hidden,
            projection: OutputLayer::new(shape, gathering),
            right: vec![0.0; shape.hidden_weights()],
        }
    }

    /// Mean squared error at the weights of `mlp`. To gather at the same weights next costs no second run of the
    /// network.
    pub(in crate::training) fn mse(&mut self, mlp: &Mlp, examples: &Examples) -> f64 {
        self.activations.evaluate(mlp, examples) / examples.errors()
    }

    /// Gathers all products at the weights of `mlp`.
    pub(in crate::training) fn gather(&mut self, mlp: &Mlp, examples: &Examples) -> Evaluation {
        self.products.gather(mlp, examples, &mut self.activations)
    }

    /// Solves for the step at damping `mu` from what was last gathered, at the same `mlp`; writes it in the order of
    /// [`Mlp::weights`]. Returns false, with `step` unspecified, if the damped matrix is not positive definite in
    /// the arithmetic: a larger `mu` is needed.
    pub(in crate::training) fn solve(&mut self, mlp: &Mlp, examples: &Examples, mu: f64, step: &mut [f64]) -> bool {
        self.solve_with_decay(mlp, examples, mu, 0.0, step)
    }

    /// As [`Self::solve`] for errors to whose sum of squares `decay`·Σw² is added: solves
    /// `(JᵀJ + damping·I) δ = −(Jᵀe + decay·w)`. The `damping` includes the `decay`.
    pub(in crate::training) fn solve_with_decay(
        &mut self,
        mlp: &Mlp,
        examples: &Examples,
        damping: f64,
        decay: f64,
        step: &mut [f64],
    ) -> bool {
        if !self.elimination.factor(self.products.sums(), damping) {
            return false;
        }
        self.elimination
            .reduce(self.products.sums(), mlp, decay, &mut self.right);
        if !self.solve_for_hidden(mlp, examples, damping) {
            return false;
        }
        self.elimination
            .complete(self.products.sums(), mlp, decay, &self.right, step);
        step.iter().all(|value| value.is_finite())
    }

    /// Solves for the step of the hidden layer alone, the output layer being the best one for it at every point.
    pub(in crate::training) fn solve_hidden(
        &mut self,
        mlp: &Mlp,
        examples: &Examples,
        mu: f64,
        step: &mut [f64],
    ) -> bool {
        let sums = self.products.sums();
        if !self.elimination.factor(sums, ridge(&sums.g)) {
            return false;
        }
        let gradient = sums.gradient_w.col_iter().flat_map(|column| column.iter());
        self.right
            .iter_mut()
            .zip(gradient)
            .for_each(|(right, gradient)| *right = *gradient);
        if !self.solve_for_hidden(mlp, examples, mu) {
            return false;
        }
        let shape = mlp.shape();
        let right = MatRef::from_column_major_slice(&self.right, shape.inputs + 1, shape.hidden);
        write_negative(right, step);
        step.iter().all(|value| value.is_finite())
    }

    /// Replaces the right-hand side of the hidden layer by its solution.
    fn solve_for_hidden(&mut self, mlp: &Mlp, examples: &Examples, damping: f64) -> bool {
        let (sums, elimination) = (self.products.sums(), &self.elimination);
        match &mut self.hidden {
            HiddenLayer::Factored(schur) => {
                let factored = schur.factor(sums, elimination.f.as_ref(), output_weights(mlp), damping);
                if factored {
                    schur.solve(&mut self.right);
                }
                factored
            }
            HiddenLayer::Iterated(conjugate) => {
                let system = System {
                    mlp,
                    examples,
                    sums,
                    elimination,
                    damping,
                };
                conjugate.solve(system, &mut self.activations, &mut self.right)
            }
        }
    }

    /// Length of Jᵀe + decay·w from what was last gathered.
    pub(in crate::training) fn gradient_length(&self, mlp: &Mlp, decay: f64) -> f64 {
        let (w, v) = mlp.layers();
        // By `hypot`, since the squares overflow where the error weighs next to nothing against the weights.
        let length = |gradient: MatRef<'_, f64>, weights: &[f64]| -> f64 {
            let weights = MatRef::from_row_major_slice(weights, gradient.nrows(), gradient.ncols());
            let columns = gradient.col_iter().zip(weights.col_iter());
            columns
                .flat_map(|(gradient, weights)| gradient.iter().zip(weights.iter()))
                .map(|(gradient, weight)| gradient + decay * weight)
                .fold(0.0, f64::hypot)
        };
        let w = length(self.products.sums().gradient_w.as_ref(), w);
        w.hypot(length(self.products.sums().gradient_v.as_ref(), v))
    }

    /// tr (JᵀJ + damping·I)⁻¹ from what was last gathered; `None` if the matrix is not positive definite in the
    /// arithmetic, or was never to be formed.
    pub(in crate::training) fn trace_of_inverse(&mut self, mlp: &Mlp, damping: f64) -> Option<f64> {
        let HiddenLayer::Factored(schur) = &mut self.hidden else {
            return None;
        };
        let (sums, v) = (self.products.sums(), output_weights(mlp));
        let factored =
            self.elimination.factor(sums, damping) && schur.factor(sums, self.elimination.f.as_ref(), v, damping);
        let trace = factored.then(|| schur.trace_of_inverse(&mut self.elimination, v))?;
        trace.is_finite().then_some(trace)
    }

    /// Gives `mlp` the output layer of least squared error for its hidden layer; false if there is none in the
    /// arithmetic.
    pub(in crate::training) fn solve_outputs(&mut self, mlp: &mut Mlp, examples: &Examples) -> bool {
        self.projection.solve(mlp, examples, &mut self.activations)
    }
}

#[cfg(test)]
mod tests {
    use faer::{Mat, prelude::Solve};

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

    /// The largest difference of the step, solved in this way, from the dense one, relative to its largest entry.
    fn distance_from_dense(way: Way, mlp: &Mlp, examples: &Examples, mu: f64) -> f64 {
        let mut equations = NormalEquations::solved_by(way, mlp.shape(), examples);
        equations.gather(mlp, examples);
        // As after a rejected step: another network was evaluated since.
        equations.mse(&Mlp::zeros(mlp.shape()), examples);
        let mut step = vec![0.0; mlp.weights().len()];
        assert!(equations.solve(mlp, examples, mu, &mut step));
        let dense = dense_step(mlp, examples, mu);
        let largest = dense.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let differences = step.iter().zip(&dense).map(|(ours, dense)| (ours - dense).abs());
        differences.fold(0.0, f64::max) / largest
    }

    #[test]
    fn the_step_is_that_of_the_dense_jacobian() {
        for (inputs, hidden, outputs, samples) in [(5, 4, 3, 300), (1, 1, 1, 3), (7, 2, 1, 40), (12, 6, 5, 513)] {
            let mlp = random_mlp(inputs, hidden, outputs, 1);
            let examples = random_examples(samples, inputs, outputs, 2);
            for mu in [1e-3, 1.0, 1e6] {
                for (way, close) in [(Way::Factored, 1e-12), (Way::Iterated, 1e-6)] {
                    let distance = distance_from_dense(way, &mlp, &examples, mu);
                    let what = format!("{way:?}, {inputs}-{hidden}-{outputs}, mu {mu}");
                    assert!(distance < close, "{what}: {distance:e}");
                }
            }
        }
    }

    /// Enough samples that they are divided into parts.
    #[test]
    fn parts_of_the_samples_add_up() {
        let (mlp, examples) = (random_mlp(20, 12, 5, 3), random_examples(40_000, 20, 5, 4));
        for way in [Way::Factored, Way::Iterated] {
            assert!(way.gathering_parts(mlp.shape(), examples.blocks().len()) > 1);
            let mut equations = NormalEquations::solved_by(way, mlp.shape(), &examples);
            let expected = crate::training::backpropagation::Backpropagation::new(&mlp).evaluate(&mlp, &examples);
            let ours = equations.gather(&mlp, &examples);
            assert!((ours.gradient_norm - expected.gradient_norm).abs() < 1e-13);
        }
        let step = |way| {
            let mut equations = NormalEquations::solved_by(way, mlp.shape(), &examples);
            equations.gather(&mlp, &examples);
            let mut step = vec![0.0; mlp.weights().len()];
            assert!(equations.solve(&mlp, &examples, 1.0, &mut step));
            step
        };
        let (factored, iterated) = (step(Way::Factored), step(Way::Iterated));
        for (a, b) in factored.iter().zip(&iterated) {
            assert!((a - b).abs() < 1e-6 * a.abs().max(1e-3), "{a} {b}");
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
        for way in [Way::Factored, Way::Iterated] {
            let mut equations = NormalEquations::solved_by(way, mlp.shape(), &examples);
            equations.gather(&mlp, &examples);
            for mu in [0.0, 1e-300, 1e-3, 1e300] {
                let mut step = vec![0.0; mlp.weights().len()];
                if equations.solve(&mlp, &examples, mu, &mut step) {
                    assert!(step.iter().all(|value| value.is_finite()), "{way:?}, mu {mu}");
                }
            }
        }
    }
}
