//! Results are bit-identical for any number of threads.

use decoupler_core::{
    network::{Mlp, Shape},
    training::{Examples, Method, Problem, StoppingRules, Trainer, TrainingSettings},
};
use ndarray::Array2;

use crate::problems::wave;

/// Weights after `epochs` of a problem that is large enough to be parallelised.
fn train(method: Method, samples: usize, threads: usize, epochs: usize) -> Mlp {
    let shape = Shape {
        inputs: 40,
        hidden: 34,
        outputs: 5,
    };
    let columns = |count, first| Array2::from_shape_fn((samples, count), |(row, column)| wave(row, first + column));
    let (inputs, targets) = (columns(shape.inputs, 0), columns(shape.outputs, 100));
    let problem = Problem {
        training: Examples::new(inputs.view(), targets.view()),
        validation: None,
        test: None,
    };
    let start = Mlp::from_weights(shape, (0..shape.weights()).map(|index| 0.3 * wave(index, 9)).collect());
    let settings = TrainingSettings {
        method,
        stopping: StoppingRules::default(),
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("the thread pool can be built").install(|| {
        let mut trainer = Trainer::new(start, problem, settings).expect("it can be trained");
        for _ in 0..epochs {
            trainer.step();
        }
        trainer.present().clone()
    })
}

/// With few samples for this many weights conjugate gradients are faster, with many the factorised equations.
#[test]
fn one_two_and_three_threads_are_bit_identical() {
    for method in Method::all() {
        for samples in [2100, 7000] {
            let one = train(method, samples, 1, 2);
            for threads in [2, 3] {
                let same = one == train(method, samples, threads, 2);
                assert!(same, "{method} with {samples} samples on {threads} threads");
            }
        }
    }
}
