//! The number of threads changes no bit.

mod training_problems;

use decoupler::{
    network::{Mlp, Shape},
    training::{Examples, Method, Problem, StoppingRules, Trainer, TrainingSettings},
};
use ndarray::Array2;
use training_problems::wave;

/// Weights after `epochs` of a problem that is large enough to be divided in all its parts.
fn train(method: Method, threads: usize, epochs: usize) -> Mlp {
    let shape = Shape {
        inputs: 40,
        hidden: 34,
        outputs: 5,
    };
    let columns = |count, first| Array2::from_shape_fn((700, count), |(row, column)| wave(row, first + column));
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
    pool.expect("threads can be had").install(|| {
        let mut trainer = Trainer::new(start, problem, settings).expect("it can be trained");
        for _ in 0..epochs {
            trainer.step();
        }
        trainer.present().clone()
    })
}

#[test]
fn one_two_and_three_threads_give_the_same_bits() {
    for method in Method::all() {
        let one = train(method, 1, 3);
        for threads in [2, 3] {
            assert_eq!(one, train(method, threads, 3), "{method} on {threads} threads");
        }
    }
}
