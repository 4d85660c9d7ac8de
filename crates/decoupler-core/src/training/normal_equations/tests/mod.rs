use faer::linalg::solvers::DenseSolveCore;

pub(in crate::training) mod dense;

use self::dense::{DampedLeastSquares, distance, errors, jacobian};
use super::*;
use crate::{
    network::Shape,
    training::{
        activations::Backpropagation,
        examples::tests::{random_examples, random_mlp},
    },
};

/// Returns the equations with every solver, and its name.
fn solvers(shape: Shape, examples: &Examples) -> [(&'static str, NormalEquations); 2] {
    let plans = [
        ("factored", Plan::factored(shape, examples.samples())),
        ("conjugate gradients", Plan::iterated(shape, examples.samples())),
    ];
    plans.map(|(name, plan)| (name, NormalEquations::new(&plan, examples)))
}

/// Returns the step at damping `mu`, solved as after a rejected step: another network was evaluated in between.
fn step(equations: &mut NormalEquations, mlp: &Mlp, examples: &Examples, mu: f64) -> Option<Vec<f64>> {
    equations.gather(mlp, &[], examples);
    equations.mse(&Mlp::zeros(mlp.shape()), examples);
    let (right, mut step) = (equations.gradient().to_vec(), vec![0.0; mlp.weights().len()]);
    equations.solve(mlp, examples, [mu; 4], &right, &mut step)?;
    Some(step)
}

/// Rounding errors and the residual of conjugate gradients are amplified by the condition number κ of the normal
/// equations. The directions in which the step is then inaccurate hardly change the linearised error, so its decrease
/// is still accurate to six digits.
#[test]
fn the_step_agrees_with_the_dense_jacobian() {
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
            let case = format!("{inputs}-{hidden}-{outputs}, mu {mu:e}, condition {condition:.1e}");
            let rounding = 30.0 * f64::EPSILON * condition;
            match step(&mut factored, &mlp, &examples, mu) {
                Some(step) => {
                    let distance = distance(&step, &expected);
                    assert!(distance < rounding.max(1e-12), "{case}, factored: {distance:e}");
                }
                // Lost in rounding.
                None => assert!(rounding > 1.0, "{case}, factored"),
            }
            match step(&mut iterated, &mlp, &examples, mu) {
                Some(step) => {
                    let distance = distance(&step, &expected);
                    let missed = dense.missed(&step, &expected);
                    assert!(missed < 1e-6, "{case}, iterated: {missed:e}");
                    let close = rounding + 1e-8 * condition;
                    assert!(distance < close || condition > 1e6, "{case}, iterated: {distance:e}");
                }
                None => assert!(rounding > 1.0, "{case}, iterated"),
            }
        }
    }
}

/// Decay that differs between the classes of weights, with output biases drawn towards given values, compared with the
/// explicit matrix.
#[test]
fn every_class_of_weights_decays_at_its_own_rate() {
    let (inputs, hidden, outputs) = (5, 4, 3);
    let (mlp, examples) = (
        random_mlp(inputs, hidden, outputs, 1),
        random_examples(300, inputs, outputs, 2),
    );
    let rates = [0.3, 7.0, 0.05, 40.0];
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
        matrix[(index, index)] += damping[class(index)];
        let towards = if index < 36 { 0.0 } else { biases[index - 36] };
        right[(index, 0)] += rates[class(index)] * (weight - towards);
    }
    let inverse = matrix.partial_piv_lu().inverse();
    let step = &inverse * &right;

    let mut equations = NormalEquations::new(&Plan::factored(mlp.shape(), examples.samples()), &examples);
    equations.gather(&mlp, &[], &examples);
    let mut ours = vec![0.0; mlp.weights().len()];
    let decay = decay_slopes(&mlp, rates, &biases);
    let sum = Vec::from_iter(
        decay
            .iter()
            .zip(equations.gradient())
            .map(|(decay, slope)| slope + decay),
    );
    equations.solve(&mlp, &examples, damping, &sum, &mut ours).unwrap();
    let expected: Vec<f64> = (0..ours.len()).map(|index| -step[(index, 0)]).collect();
    assert!(distance(&ours, &expected) < 1e-11, "{:e}", distance(&ours, &expected));
    assert!((length(&sum) / right.norm_l2() - 1.0).abs() < 1e-12, "{}", length(&sum));
    let traces = equations.traces_of_inverse(&mlp, damping).unwrap().classes();
    let mut expected = [0.0; 4];
    (0..ours.len()).for_each(|index| expected[class(index)] += inverse[(index, index)]);
    for (ours, expected) in traces.iter().zip(expected) {
        assert!((ours / expected - 1.0).abs() < 1e-11, "{traces:?}, {expected:?}");
    }
}

/// With enough samples to be divided into parts.
#[test]
fn parts_of_the_samples_add_up() {
    let (mlp, examples) = (random_mlp(20, 12, 5, 3), random_examples(40_000, 20, 5, 4));
    let expected = Backpropagation::new(&mlp).evaluate(&mlp, &examples);
    let blocks = examples.blocks().len();
    assert!(Plan::factored(mlp.shape(), 40_000).gathering_parts(blocks) > 1);
    assert!(Plan::iterated(mlp.shape(), 40_000).gathering_parts(blocks) > 1);
    let [factored, iterated] = solvers(mlp.shape(), &examples).map(|(name, mut equations)| {
        let ours = equations.gather(&mlp, &[], &examples);
        assert!((ours.gradient_norm - expected.gradient_norm).abs() < 1e-13, "{name}");
        step(&mut equations, &mlp, &examples, 1.0).unwrap()
    });
    for (a, b) in factored.iter().zip(&iterated) {
        assert!((a - b).abs() < 1e-6 * a.abs().max(1e-3), "{a} {b}");
    }
}

#[test]
fn the_evaluation_agrees_with_back_propagation() {
    let mlp = random_mlp(6, 5, 4, 3);
    let examples = random_examples(400, 6, 4, 4);
    let ours = NormalEquations::new(&Plan::cheapest(mlp.shape(), 400), &examples).gather(&mlp, &[], &examples);
    let expected = Backpropagation::new(&mlp).evaluate(&mlp, &examples);
    assert!((ours.mse - expected.mse).abs() < 1e-14);
    assert!((ours.gradient_norm - expected.gradient_norm).abs() < 1e-14);
}

#[test]
fn a_singular_system_is_rejected_or_solved_but_never_nan() {
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
