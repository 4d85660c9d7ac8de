use faer::MatRef;

use super::{
    output_layer::{OutputLayer, ridge},
    products::Products,
    schur::{Damping, SchurComplement},
};
use crate::{
    network::{Mlp, Shape},
    training::{Evaluation, Examples, activations::KeptActivations},
};

/// The normal equations of a network and its examples: evaluated, gathered, and solved for any damping.
pub struct NormalEquations {
    shape: Shape,
    activations: KeptActivations,
    products: Products,
    schur: SchurComplement,
    projection: OutputLayer,
}

impl NormalEquations {
    /// Room for a network of this shape and these examples.
    pub fn new(shape: Shape, examples: &Examples) -> Self {
        Self {
            shape,
            activations: KeptActivations::new(shape, examples),
            products: Products::new(shape, examples),
            schur: SchurComplement::new(shape),
            projection: OutputLayer::new(shape),
        }
    }

    /// About how much memory the equations of a network of this shape take: S, and BᵀB packed.
    pub fn bytes(shape: Shape) -> usize {
        let (n1, h, order) = (shape.inputs + 1, shape.hidden, shape.hidden_weights());
        let gram = (n1 * (n1 + 1) / 2).saturating_mul(h * (h + 1) / 2);
        order
            .saturating_mul(order)
            .saturating_add(gram)
            .saturating_mul(size_of::<f64>())
    }

    /// Mean squared error at the weights of `mlp`. To gather at the same weights next costs no second run of the
    /// network.
    pub fn mse(&mut self, mlp: &Mlp, examples: &Examples) -> f64 {
        self.activations.evaluate(mlp, examples) / examples.errors()
    }

    /// Gathers all products at the weights of `mlp`.
    pub fn gather(&mut self, mlp: &Mlp, examples: &Examples) -> Evaluation {
        self.products.gather(mlp, examples, &mut self.activations)
    }

    /// Solves for the step at damping `mu` from what was last gathered, at the same `mlp`; writes it in the order of
    /// [`Mlp::weights`]. Returns false, with `step` unspecified, if the damped matrix is not positive definite in
    /// the arithmetic: a larger `mu` is needed.
    pub fn solve(&mut self, mlp: &Mlp, mu: f64, step: &mut [f64]) -> bool {
        self.solve_with_decay(mlp, mu, 0.0, step)
    }

    /// As [`Self::solve`] for errors to whose sum of squares `decay`·Σw² is added: solves
    /// `(JᵀJ + damping·I) δ = −(Jᵀe + decay·w)`. The `damping` includes the `decay`.
    pub fn solve_with_decay(&mut self, mlp: &Mlp, damping: f64, decay: f64, step: &mut [f64]) -> bool {
        let damping = Damping {
            hidden: damping,
            output: damping,
        };
        if !self
            .schur
            .factor(&self.products, output_weights(self.shape, mlp), damping)
        {
            return false;
        }
        self.schur.solve(&self.products, mlp, decay, step);
        step.iter().all(|value| value.is_finite())
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
        let w = length(self.products.gradient_w.as_ref(), w);
        w.hypot(length(self.products.gradient_v.as_ref(), v))
    }

    /// tr (JᵀJ + damping·I)⁻¹ from what was last gathered; `None` if the matrix is not positive definite in the
    /// arithmetic.
    pub(in crate::training) fn trace_of_inverse(&mut self, mlp: &Mlp, damping: f64) -> Option<f64> {
        let v = output_weights(self.shape, mlp);
        let damping = Damping {
            hidden: damping,
            output: damping,
        };
        let factored = self.schur.factor(&self.products, v, damping);
        let trace = factored.then(|| self.schur.trace_of_inverse(v))?;
        trace.is_finite().then_some(trace)
    }

    /// Solves for the step of the hidden layer alone, the output layer being the best one for it at every point.
    pub(in crate::training) fn solve_hidden(&mut self, mlp: &Mlp, mu: f64, step: &mut [f64]) -> bool {
        let damping = Damping {
            hidden: mu,
            output: ridge(&self.products.g),
        };
        if !self
            .schur
            .factor(&self.products, output_weights(self.shape, mlp), damping)
        {
            return false;
        }
        self.schur.solve_hidden(&self.products, step);
        step.iter().all(|value| value.is_finite())
    }

    /// Gives `mlp` the output layer of least squared error for its hidden layer; false if there is none in the
    /// arithmetic.
    pub(in crate::training) fn solve_outputs(&mut self, mlp: &mut Mlp, examples: &Examples) -> bool {
        self.projection.solve(mlp, examples, &mut self.activations)
    }
}

/// V̄: h × outputs.
fn output_weights(shape: Shape, mlp: &Mlp) -> MatRef<'_, f64> {
    MatRef::from_row_major_slice(mlp.layers().1, shape.hidden + 1, shape.outputs).subrows(0, shape.hidden)
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
