//! Levenberg-Marquardt as the textbooks write it, with the dense Jacobian and the same GEMM library: what the structured
//! normal equations are measured against, in time and in the path they take.

use decoupler::{
    network::{Mlp, Shape},
    training::{Examples, Method, Problem, StoppingRules, Trainer, TrainingSettings},
};
use faer::{Mat, Side, prelude::Solve};
use ndarray::Array2;

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

/// Prints the ratio of the epochs' times and how far the two paths are apart after as many steps.
pub(crate) fn print() {
    faer::set_global_parallelism(faer::Par::Seq);
    let shape = Shape {
        inputs: 30,
        hidden: 12,
        outputs: 30,
    };
    let wave = |row: usize, column: usize| {
        (1.0 + 12.9898 * row as f64 + 78.233 * column as f64 + 0.71 * (row * column) as f64).sin()
    };
    let inputs = Array2::from_shape_fn((1000, shape.inputs), |(row, column)| wave(row, column));
    let teacher = Mlp::from_weights(shape, (0..shape.weights()).map(|index| wave(index, 3)).collect());
    // Not to be reached exactly: else the damping vanishes, and rounding decides the path of both.
    let noise = Array2::from_shape_fn((1000, shape.outputs), |(row, output)| 0.1 * wave(row, 500 + output));
    let targets = teacher.forward(inputs.view()) + noise;
    let start = Mlp::from_weights(shape, (0..shape.weights()).map(|index| 0.3 * wave(index, 1)).collect());
    let problem = Problem {
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
