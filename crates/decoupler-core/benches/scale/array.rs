//! Computing time of a frame of one array.

use std::hint::black_box;

use decoupler_core::{
    dataset::{Dataset, Seed, Stream},
    decoupling::{Decoder, Estimator, NewtonDecoder, Precision, ProgramDecoder, Solution},
    network::{InputChoice, Networks, Quantity, ScalingChoice},
    scene::{Rows, Scene},
    sensor::{ArrayScale, SensorModel},
};

use crate::{
    row_arithmetic::RowArithmetic,
    timing::{median, time_ms},
    untrained::untrained_networks,
};

/// An array with known rows, and some frames of it.
pub(crate) struct Array {
    pub(crate) scale: ArrayScale,
    model: SensorModel,
    scene: Scene,
    set: Dataset,
}

/// Number of frames drawn, enough for every channel to vary.
const FRAMES: usize = 4;
/// Number of repetitions, of which the median is used.
const TURNS: usize = 7;

impl Array {
    pub(crate) fn new(scale: &str) -> Self {
        let scale: ArrayScale = scale.parse().unwrap();
        let model = SensorModel::new(scale);
        let scene = Scene {
            rows: Rows::Known,
            ..Scene::default()
        };
        let samples = FRAMES * scale.rows();
        let set = Dataset::simulate(&model, &scene, samples, &mut Seed(0).rng(Stream::Training)).unwrap();
        Self {
            scale,
            model,
            scene,
            set,
        }
    }

    /// Milliseconds to draw a frame.
    pub(crate) fn drawing_ms(&self) -> f64 {
        let mut rng = Seed(1).rng(Stream::Training);
        let rows = self.scale.rows();
        let mut draw = || black_box(Dataset::simulate(&self.model, &self.scene, rows, &mut rng)).map(drop);
        median(&mut Vec::from_iter((0..TURNS).map(|_| time_ms(&mut draw))))
    }

    fn frame(&self) -> &[f64] {
        let readings = self.set.readings();
        &readings.to_slice().unwrap()[..self.scale.rows() * self.scale.columns()]
    }

    fn decoding_ms(&self, decoder: &mut dyn Decoder) -> f64 {
        let frame = self.frame().to_vec();
        let mut answer = vec![0.0; self.scale.rows() * self.scale.coordinates_per_row()];
        let mut repeat = |times: usize| {
            time_ms(|| {
                for _ in 0..times {
                    decoder.decode(black_box(&frame), &mut answer).unwrap();
                    black_box(&answer);
                }
            }) / times as f64
        };
        repeat(1);
        let times = (5.0 / repeat(1)).clamp(1.0, 1000.0) as usize;
        median(&mut Vec::from_iter((0..TURNS).map(|_| repeat(times))))
    }

    /// Milliseconds per frame of networks with this many hidden nodes, in double and in single precision.
    pub(crate) fn network_ms(&self, hidden: usize) -> [f64; 2] {
        let networks = self.networks(hidden);
        [Precision::Double, Precision::Single]
            .map(|precision| self.decoding_ms(&mut ProgramDecoder::new(networks.program(precision))))
    }

    fn networks(&self, hidden: usize) -> Networks {
        let choice = InputChoice {
            quantity: Quantity::Conductance,
            scaling: ScalingChoice::MinMax,
        };
        untrained_networks(&self.set, choice, hidden)
    }

    /// Measures the Gauss-Newton method on a frame.
    pub(crate) fn newton(&self) -> NewtonFrame {
        let rows = Vec::from_iter(0..self.scale.rows());
        let mut estimator = Estimator::new(&self.model, &self.scene, &rows).unwrap();
        let mut coordinates = vec![0.0; self.scale.coordinates_per_row()];
        let (mut steps, mut unsolved, mut error_mm) = (0, 0, 0.0_f64);
        for &row in &rows {
            let report = estimator
                .solve(row, self.set.sample_readings(row), &mut coordinates)
                .unwrap();
            steps += report.steps;
            unsolved += usize::from(report.solution != Solution::Unique);
            let truth = self.set.sample_targets(row);
            error_mm = coordinates
                .iter()
                .zip(truth)
                .fold(error_mm, |most, (a, b)| most.max((a - b).abs()));
        }
        let steps_per_row = steps as f64 / rows.len() as f64;
        let mut decoder = NewtonDecoder::new(&self.model, &self.scene, &rows).unwrap();
        let evaluations = steps_per_row.round() as usize;
        let mut arithmetic = RowArithmetic::of_newton(self.scale, evaluations).work(rows.len());
        let arithmetic_ms = median(&mut Vec::from_iter((0..TURNS).map(|_| time_ms(&mut arithmetic))));
        NewtonFrame {
            ms: self.decoding_ms(&mut decoder),
            arithmetic_ms,
            steps_per_row,
            unsolved,
            error_mm,
        }
    }
}

/// A frame solved by the Gauss-Newton method.
pub(crate) struct NewtonFrame {
    pub(crate) ms: f64,
    /// The same number of square roots, divisions and products in plain loops.
    pub(crate) arithmetic_ms: f64,
    pub(crate) steps_per_row: f64,
    /// Number of rows without a unique solution.
    pub(crate) unsolved: usize,
    /// Largest error of a coordinate.
    pub(crate) error_mm: f64,
}
