//! Scaled conjugate gradient (`trainscg`).

use serde::{Deserialize, Serialize};

use super::{
    ConjugateSettings, Evaluation, Examples, StopReason,
    activations::Backpropagation,
    method::{Algorithm, MethodState},
};
use crate::network::Mlp;

/// The scaled conjugate gradient (Møller 1993, the steps of his section 4 in order; `trainscg`). Along the direction p
/// the curvature δ = pᵀs is estimated from two gradients, s = (E′(w + σp/|p|) − E′(w)) |p|/σ, and raised by λ|p|² until
/// it is positive; the step is pᵀr/δ, where r is the negative gradient. λ is lowered or raised depending on how well
/// the quadratic model predicts the error. An epoch is one iteration, even if its step is rejected. With weight decay E
/// includes the penalty on the weights; the errors returned do not.
pub(super) struct ScaledConjugateGradient {
    settings: ConjugateSettings,
    state: ConjugateState,
    now: Evaluation,
    /// E at the weights: the mean squared error and the penalty.
    objective: f64,
    backpropagation: Backpropagation,
    moved: Mlp,
}

/// State of the scaled conjugate gradient, in Møller's notation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConjugateState {
    /// Direction p.
    pub(super) p: Vec<f64>,
    /// Residual r: the negative gradient.
    pub(super) r: Vec<f64>,
    /// Curvature δ along p.
    delta: f64,
    lambda: f64,
    lambda_bar: f64,
    /// `true` if the last step was accepted.
    success: bool,
    /// Number of accepted steps since the last restart of p from the gradient.
    since_restart: usize,
}

impl ScaledConjugateGradient {
    /// Starts with these settings of [`Method::ScaledConjugateGradient`](super::Method::ScaledConjugateGradient).
    pub(super) fn new(settings: ConjugateSettings, mlp: &Mlp, examples: &Examples) -> (Self, Evaluation) {
        let mut backpropagation = Backpropagation::new(mlp);
        let (now, objective) = penalized(&mut backpropagation, settings.decay, mlp, examples);
        let r: Vec<f64> = backpropagation.gradient.iter().map(|slope| -slope).collect();
        let method = Self {
            settings,
            state: ConjugateState {
                p: r.clone(),
                r,
                delta: 0.0,
                lambda: settings.lambda,
                lambda_bar: 0.0,
                success: true,
                since_restart: 0,
            },
            now,
            objective,
            backpropagation,
            moved: mlp.clone(),
        };
        (method, now)
    }

    /// Evaluates E and its gradient at `length` along p from `mlp`.
    fn evaluate_along(&mut self, mlp: &Mlp, length: f64, examples: &Examples) -> (Evaluation, f64) {
        let moved = mlp.weights().iter().zip(&self.state.p);
        for (target, (weight, p)) in self.moved.weights_mut().iter_mut().zip(moved) {
            *target = weight + length * p;
        }
        penalized(&mut self.backpropagation, self.settings.decay, &self.moved, examples)
    }

    /// Updates residual and direction (Møller's step 7) after an accepted step with μ = pᵀr.
    fn turn(&mut self, mu: f64) {
        let state = &mut self.state;
        state.since_restart += 1;
        let (mut square, mut mixed) = (0.0, 0.0);
        for (r, slope) in state.r.iter().zip(&self.backpropagation.gradient) {
            square += slope * slope;
            mixed -= slope * r;
        }
        state.since_restart %= state.r.len();
        let beta = (square - mixed) / mu;
        let is_kept = state.since_restart > 0 && beta.is_finite();
        let beta = if is_kept { beta } else { 0.0 };
        for ((p, r), slope) in state.p.iter_mut().zip(&mut state.r).zip(&self.backpropagation.gradient) {
            *r = -slope;
            *p = *r + beta * *p;
        }
        // Restart if p is not a descent direction.
        if dot(&state.p, &state.r) <= 0.0 {
            state.p.copy_from_slice(&state.r);
            state.since_restart = 0;
        }
    }
}

impl Algorithm for ScaledConjugateGradient {
    fn step(&mut self, mlp: &mut Mlp, examples: &Examples) -> Result<Evaluation, StopReason> {
        let square = dot(&self.state.p, &self.state.p);
        if square == 0.0 {
            return Err(StopReason::GradientSmall);
        }
        if !square.is_finite() {
            return Err(StopReason::Diverged);
        }
        if self.state.success {
            let sigma = self.settings.sigma / square.sqrt();
            self.evaluate_along(mlp, sigma, examples);
            let differences = self.backpropagation.gradient.iter().zip(&self.state.r);
            let along = differences.zip(&self.state.p).map(|((slope, r), p)| p * (slope + r));
            self.state.delta = along.sum::<f64>() / sigma;
        }
        let state = &mut self.state;
        state.delta += (state.lambda - state.lambda_bar) * square;
        if state.delta <= 0.0 || state.delta.is_nan() {
            let delta = if state.delta.is_finite() { state.delta } else { 0.0 };
            state.lambda_bar = 2.0 * (state.lambda - delta / square);
            state.delta = -delta + state.lambda * square;
            state.lambda = state.lambda_bar;
        }
        let mu = dot(&state.p, &state.r);
        let (delta, length) = (state.delta, mu / state.delta);
        let (then, objective) = self.evaluate_along(mlp, length, examples);
        let predicted = 2.0 * delta * (self.objective - objective) / (mu * mu);
        // A non-finite error counts as much worse than predicted.
        let comparison = then
            .if_finite()
            .map_or(MIN_COMPARISON, |_| predicted.max(MIN_COMPARISON));
        self.state.success = comparison >= 0.0;
        if self.state.success {
            std::mem::swap(mlp, &mut self.moved);
            (self.now, self.objective) = (then, objective);
            self.turn(mu);
            self.state.lambda_bar = 0.0;
            if comparison >= 0.75 {
                self.state.lambda = (0.25 * self.state.lambda).max(f64::MIN_POSITIVE);
            }
        } else {
            self.state.lambda_bar = self.state.lambda;
        }
        if comparison < 0.25 {
            self.state.lambda += delta * (1.0 - comparison) / square;
        }
        let is_finite = self.state.lambda.is_finite();
        if is_finite {
            Ok(self.now)
        } else {
            Err(StopReason::LambdaLarge)
        }
    }

    fn parameter(&self) -> f64 {
        self.state.lambda
    }

    fn state(&self) -> MethodState {
        MethodState::ScaledConjugateGradient(self.state.clone())
    }

    fn restore(&mut self, state: MethodState) {
        if let MethodState::ScaledConjugateGradient(state) = state {
            self.state = state;
        }
    }
}

/// Evaluates the errors of `mlp`, and E with its gradient: the mean squared error and the penalty on the weights.
fn penalized(backpropagation: &mut Backpropagation, decay: f64, mlp: &Mlp, examples: &Examples) -> (Evaluation, f64) {
    let mut evaluation = backpropagation.evaluate(mlp, examples);
    if decay == 0.0 {
        return (evaluation, evaluation.mse);
    }
    let per_error = decay / examples.errors();
    for (slope, weight) in backpropagation.gradient.iter_mut().zip(mlp.weights()) {
        *slope += 2.0 * per_error * weight;
    }
    evaluation.gradient_norm = dot(&backpropagation.gradient, &backpropagation.gradient).sqrt();
    (
        evaluation,
        evaluation.mse + per_error * dot(mlp.weights(), mlp.weights()),
    )
}

/// Lower limit on the comparison of actual and predicted error.
const MIN_COMPARISON: f64 = -1e3;

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::examples::tests::{random_examples, random_mlp};

    fn start(lambda: f64, decay: f64, mlp: &Mlp, examples: &Examples) -> (ScaledConjugateGradient, Evaluation) {
        let sigma = 5e-5;
        ScaledConjugateGradient::new(ConjugateSettings { sigma, lambda, decay }, mlp, examples)
    }

    #[test]
    fn an_overflow_of_lambda_is_not_reported_as_a_small_gradient() {
        let (mut mlp, examples) = (random_mlp(3, 4, 2, 1), random_examples(50, 3, 2, 2));
        let (mut method, start) = start(1e300, 0.0, &mlp, &examples);
        assert!(start.gradient_norm > 0.1);
        let reason = (0..100).find_map(|_| method.step(&mut mlp, &examples).err());
        assert_eq!(reason, Some(StopReason::LambdaLarge));
    }

    /// At the end of a training every central difference of the penalised error vanishes.
    #[test]
    fn weight_decay_ends_where_the_penalised_error_is_lowest() {
        const DECAY: f64 = 0.3;
        let (mut mlp, examples) = (random_mlp(3, 4, 2, 1), random_examples(50, 3, 2, 2));
        let objective = |mlp: &Mlp| {
            let squares: f64 = mlp.weights().iter().map(|weight| weight * weight).sum();
            Backpropagation::new(mlp).evaluate(mlp, &examples).mse + DECAY * squares / 100.0
        };
        let (mut method, start) = start(5e-7, DECAY, &mlp, &examples);
        let before = objective(&mlp);
        let last = (0..2000)
            .map_while(|_| method.step(&mut mlp, &examples).ok())
            .last()
            .unwrap();
        assert!(objective(&mlp) < 0.9 * before && last.gradient_norm < 1e-6 * start.gradient_norm);
        for place in 0..mlp.weights().len() {
            let moved = |step: f64| {
                let mut moved = mlp.clone();
                moved.weights_mut()[place] += step;
                objective(&moved)
            };
            let slope = (moved(1e-4) - moved(-1e-4)) / 2e-4;
            assert!(slope.abs() < 1e-7, "{place}: {slope}");
        }
    }
}
