//! Textbook Levenberg-Marquardt with the dense Jacobian and the same GEMM library: the reference for the time and the
//! iterates of the structured normal equations.

use decoupler_core::{
    network::{Mlp, Shape},
    training::{ExampleSets, Examples, Method, StoppingRules, Trainer, TrainingSettings},
};
use faer::{Mat, Side, prelude::Solve};
use ndarray::Array2;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use crate::timing::{median, time_ms};

const STEPS: usize = 20;

struct Dense {
    inputs: Array2<f64>,
    targets: Array2<f64>,
    mu: f64,
}

impl Dense {
    fn errors(&self, mlp: &Mlp) -> Mat<f64> {
        let errors = mlp.forward(self.inputs.view()) - &self.targets;
        Mat::from_fn(errors.len(), 1, |row, _| {
            errors[[row / errors.ncols(), row % errors.ncols()]]
        })
    }

    fn jacobian(&self, mlp: &Mlp) -> Mat<f64> {
        let Shape {
            inputs: n,
            hidden: h,
            outputs: m,
        } = mlp.shape();
        let (w, v) = (mlp.hidden_layer(), mlp.output_layer());
        let mut jacobian = Mat::zeros(self.inputs.nrows() * m, mlp.weights().len());
        for (sample, x) in self.inputs.rows().into_iter().enumerate() {
            for i in 0..h {
                let net: f64 = (0..n).map(|a| x[a] * w[[a, i]]).sum::<f64>() + w[[n, i]];
                let node = net.tanh();
                for t in 0..m {
                    let row = sample * m + t;
                    let slope = v[[i, t]] * (1.0 - node * node);
                    for a in 0..=n {
                        jacobian[(row, a * h + i)] = slope * if a < n { x[a] } else { 1.0 };
                    }
                    jacobian[(row, (n + 1) * h + i * m + t)] = node;
                    jacobian[(row, (n + 1) * h + h * m + t)] = 1.0;
                }
            }
        }
        jacobian
    }

    fn step(&mut self, mlp: &mut Mlp) {
        let (jacobian, errors) = (self.jacobian(mlp), self.errors(mlp));
        let (normal, gradient) = (jacobian.transpose() * &jacobian, jacobian.transpose() * &errors);
        loop {
            let mut damped = normal.clone();
            (0..damped.nrows()).for_each(|index| damped[(index, index)] += self.mu);
            let step = damped
                .llt(Side::Lower)
                .expect("it is positive definite")
                .solve(&gradient);
            let weights = mlp
                .weights()
                .iter()
                .enumerate()
                .map(|(index, weight)| weight - step[(index, 0)]);
            let candidate = Mlp::from_weights(mlp.shape(), weights.collect());
            if self.errors(&candidate).squared_norm_l2() < errors.squared_norm_l2() {
                *mlp = candidate;
                self.mu *= 0.1;
                return;
            }
            self.mu *= 10.0;
        }
    }
}

/// Prints the ratio of the times per epoch and the largest difference between the iterates.
pub(crate) fn print() {
    let shape = Shape {
        inputs: 30,
        hidden: 12,
        outputs: 30,
    };
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut numbers = |rows, columns, largest: f64| {
        Array2::from_shape_simple_fn((rows, columns), || rng.random_range(-largest..=largest))
    };
    let mut network =
        |largest| Mlp::from_weights(shape, numbers(1, shape.weights(), largest).into_raw_vec_and_offset().0);
    let (teacher, start) = (network(0.5), network(0.3));
    let inputs = numbers(1000, shape.inputs, 1.0);
    // The targets cannot be reached exactly: otherwise the damping vanishes and rounding decides both paths.
    let targets = teacher.forward(inputs.view()) + numbers(1000, shape.outputs, 0.5);
    let problem = ExampleSets {
        training: Examples::new(inputs.view(), targets.view()),
        validation: None,
        test: None,
    };
    let settings = TrainingSettings {
        method: Method::default(),
        stopping: StoppingRules::default(),
    };
    let mut trainer = Trainer::new(start.clone(), problem, settings).expect("it can be trained");
    let mut dense = Dense {
        inputs,
        targets,
        mu: 1e-3,
    };
    let mut mlp = start;
    let (mut ours, mut theirs, mut apart) = (Vec::new(), Vec::new(), 0.0_f64);
    for _ in 0..STEPS {
        ours.push(time_ms(|| trainer.step()));
        theirs.push(time_ms(|| dense.step(&mut mlp)));
        let largest = mlp
            .weights()
            .iter()
            .fold(0.0_f64, |largest, weight| largest.max(weight.abs()));
        let pairs = trainer.present().weights().iter().zip(mlp.weights());
        apart = pairs.map(|(a, b)| (a - b).abs() / largest).fold(apart, f64::max);
    }
    let (ours, theirs) = (median(&mut ours), median(&mut theirs));
    println!("\n## Against the dense Jacobian, 30-12-30, 1000 samples, one thread\n");
    println!("| | median ms |\n|---|---:|\n| dense | {theirs:.1} |\n| structured | {ours:.2} |\n");
    println!(
        "{:.0} times faster; largest difference of the weights over {STEPS} steps {apart:.1e}",
        theirs / ours
    );
}
