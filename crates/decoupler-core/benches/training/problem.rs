//! Networks and samples of any size.

use decoupler_core::{
    network::{Mlp, Shape},
    training::{ExampleSets, Examples, Method, StoppingRules, Trainer, TrainingSettings},
};
use ndarray::Array2;
use rayon::ThreadPoolBuilder;

use crate::timing::{median, time_ms};

/// Sizes of a network and its training set.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sizes {
    pub(crate) shape: Shape,
    pub(crate) samples: usize,
}

impl Sizes {
    /// Sizes for an array with `nodes` nodes on each row-wire: its readings in, the x and z of its nodes out.
    pub(crate) fn array(nodes: usize, hidden: usize, samples: usize) -> Self {
        let shape = Shape {
            inputs: 3 * nodes,
            hidden,
            outputs: 2 * nodes,
        };
        Self { shape, samples }
    }

    pub(crate) fn trainer(self, method: Method) -> Trainer {
        let Self { shape, samples } = self;
        let columns = |count, first| Array2::from_shape_fn((samples, count), |(row, column)| wave(row, first + column));
        let problem = ExampleSets {
            training: Examples::new(columns(shape.inputs, 0).view(), columns(shape.outputs, 2000).view()),
            validation: None,
            test: None,
        };
        let start = Mlp::from_weights(shape, (0..shape.weights()).map(|index| 0.3 * wave(index, 1)).collect());
        let settings = TrainingSettings {
            method,
            stopping: StoppingRules::default(),
        };
        Trainer::new(start, problem, settings).expect("it can be trained")
    }

    /// Returns the median time of an epoch in milliseconds.
    pub(crate) fn epoch_ms(self, method: Method, threads: usize, epochs: usize) -> f64 {
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("the thread pool can be built");
        pool.install(|| {
            let mut trainer = self.trainer(method);
            median(&mut (0..epochs).map(|_| time_ms(|| trainer.step())).collect::<Vec<_>>())
        })
    }
}

/// Numbers in [−1, 1] without repetition.
fn wave(row: usize, column: usize) -> f64 {
    (1.0 + 12.9898 * row as f64 + 78.233 * column as f64 + 0.71 * (row * column) as f64).sin()
}
