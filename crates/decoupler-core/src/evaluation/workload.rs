use std::time::Duration;

use super::{RunError, RunSettings};
use crate::{
    dataset::{Dataset, Simulation},
    decoupling::{DecoderKind, GaussianPrior},
    machine::{MemoryBudget, multiplications_per_second, node_pairs_per_row, node_pairs_per_second},
    network::{ScalingChoice, Shape},
    scene::{Movement, Rows},
    training::Method,
};

/// Memory and work of a run, from the sizes of its network and samples alone, so that both are known before it begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workload {
    /// Peak memory in bytes: drawn and scaled samples, equations of all trainings, and priors of the rows.
    pub bytes: u64,
    /// Number of pairs of nodes in the resistances of all drawn samples.
    node_pairs: f64,
    /// Number of multiplications per epoch of all trainings.
    epoch_multiplications: f64,
    /// Maximum number of epochs.
    pub epochs: usize,
}

/// Size of a training: of its set and of its networks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrainingSize {
    /// Number of training samples.
    pub samples: usize,
    /// Number of inputs.
    pub inputs: usize,
    /// Number of targets; of an array, the coordinates that vary.
    pub targets: usize,
    /// Number of networks: 1, or one for each row-wire.
    pub networks: usize,
}

impl TrainingSize {
    /// Returns the size of a training with these settings on a set that was read.
    pub fn of(settings: &RunSettings, training: &Dataset) -> Self {
        Self {
            samples: training.samples(),
            inputs: training.readings().ncols(),
            targets: training.targets().ncols(),
            networks: settings.source.row_model().decoders(training.row_count()),
        }
    }

    /// Returns the size of a training on samples that are yet to be drawn, as whole snapshots.
    ///
    /// # Errors
    /// If the samples are those of a recording, or the array lacks a row of the scene.
    pub fn drawn(settings: &RunSettings) -> Result<Self, RunError> {
        let simulation = settings.drawn()?;
        let Simulation { sensor, scene, .. } = simulation;
        let (scale, rows) = (sensor.scale, simulation.rows()?);
        let varying_axes = match (scene.movement, scene.rows) {
            (Movement::Xyz { .. }, _) => 3,
            // A network that does not know the row also learns the x coordinate.
            (Movement::Z, Rows::All) if scale.rows() > 1 => 2,
            (Movement::Z, _) => 1,
        };
        Ok(Self {
            samples: simulation.samples.div_ceil(rows) * rows,
            inputs: scale.columns(),
            targets: varying_axes * scale.nodes_per_row(),
            networks: scene.rows.model().decoders(rows),
        })
    }
}

impl Workload {
    /// Number of vectors with an entry for each weight in a method and its trainer.
    const VECTORS: usize = 8;

    /// Computes the workload of `settings` with a training of this size. Samples of a recording, which have been read by
    /// then, are not counted.
    pub fn of(settings: &RunSettings, size: TrainingSize) -> Self {
        let shape = Shape {
            inputs: size.inputs,
            hidden: settings.hidden,
            outputs: size.targets,
        };
        let (method, of_each) = (&settings.training.method, size.samples.div_ceil(size.networks.max(1)));
        let trainings = settings.starts * size.networks;
        // Whitening may leave inputs out, and fewer inputs may take more memory: their equations may be factored, those of
        // all inputs solved iteratively.
        let fewest = match settings.inputs.scaling {
            ScalingChoice::MinMax => shape.inputs,
            ScalingChoice::Whitening => 1,
        };
        let with_inputs = |inputs| method.equations_bytes(Shape { inputs, ..shape }, of_each);
        let equations_bytes = (fewest..=shape.inputs).map(with_inputs).max().unwrap_or(0);
        let bytes = (equations_bytes as u64).saturating_add(float_bytes(shape.weights(), Self::VECTORS));
        let drawing = settings.simulation().and_then(|simulation| drawing(simulation, size));
        let (drawn_bytes, node_pairs) = drawing.unwrap_or_default();
        Self {
            bytes: bytes.saturating_mul(trainings as u64).saturating_add(drawn_bytes),
            node_pairs,
            epoch_multiplications: trainings as f64 * method.epoch_multiplications(shape, of_each),
            epochs: settings.training.stopping.epochs,
        }
    }

    /// Returns the methods that would train on the same recording in less than half of this time, with the time of each
    /// for the number of epochs that it gets by default.
    pub fn faster_methods(&self, settings: &RunSettings, size: TrainingSize) -> Vec<(Method, Duration)> {
        let present = self.training_time();
        let candidates = [Method::default(), Method::scaled_conjugate_gradient(0.0)];
        let of_each = candidates.into_iter().map(|method| {
            let mut other = *settings;
            other.choose_method(method);
            (method, Self::of(&other, size).training_time())
        });
        of_each.filter(|(_, time)| time.saturating_mul(2) < present).collect()
    }

    /// Computes the workload of measuring `decoders` with networks of each number of `hidden` nodes one after the
    /// other, which is the workload of the largest run.
    ///
    /// # Errors
    /// If the settings are those of a recording, or the array lacks a row of the scene.
    pub fn of_trade_off(settings: &RunSettings, hidden: &[usize], decoders: &[DecoderKind]) -> Result<Self, RunError> {
        let trains = decoders.iter().any(|kind| kind.needs_network());
        let largest = hidden.iter().copied().max().filter(|_| trains);
        let largest = RunSettings {
            hidden: largest.unwrap_or(1),
            ..*settings
        };
        Ok(Self::of(&largest, TrainingSize::drawn(&largest)?))
    }

    /// Returns `true` if the user should be warned of the memory or time before the run begins: more than a gigabyte,
    /// some seconds to draw the samples, or a second per epoch.
    pub fn is_large(&self) -> bool {
        self.bytes > 1_000_000_000 || self.node_pairs > 1e10 || self.epoch_multiplications > 1e10
    }

    /// Number of multiplications of all epochs.
    pub(super) fn multiplications(&self) -> f64 {
        self.epoch_multiplications * self.epochs as f64
    }

    /// Time to draw the samples on one thread of this machine. The first call of this or another time measures its speed,
    /// which takes about 20 ms; large runs are faster with more threads.
    pub fn drawing_time(&self) -> Duration {
        duration(self.node_pairs / node_pairs_per_second())
    }

    /// Time per epoch on one thread of this machine.
    pub fn epoch_time(&self) -> Duration {
        duration(self.epoch_multiplications / multiplications_per_second())
    }

    /// Time of all epochs on one thread of this machine, if none of the other stopping rules ends the training.
    pub fn training_time(&self) -> Duration {
        duration(self.multiplications() / multiplications_per_second())
    }

    /// Checks that the work fits into `memory`.
    ///
    /// # Errors
    /// [`RunError::Memory`] if it does not.
    pub fn check_memory(&self, memory: MemoryBudget) -> Result<(), RunError> {
        if self.bytes > memory.bytes() {
            return Err(RunError::Memory {
                bytes: self.bytes,
                memory,
            });
        }
        Ok(())
    }
}

fn duration(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
}

/// Returns the memory of drawn samples and the priors of their rows in bytes, and the number of pairs of their nodes; `None`
/// without the rows of the scene, where nothing can be drawn.
fn drawing(simulation: &Simulation, size: TrainingSize) -> Option<(u64, f64)> {
    let (rows, scale) = (simulation.rows().ok()?, simulation.sensor.scale);
    let whole = |samples: usize| samples.div_ceil(rows) * rows;
    let held_out = whole(simulation.validation_samples) + whole(simulation.test_samples);
    let drawn = size.samples.saturating_add(held_out);
    // Readings and targets are drawn, split, scaled, and copied to blocks for the training.
    let per_sample = 3 * scale.columns() + 3 * scale.coordinates_per_row() + size.inputs + 1 + size.targets;
    let needs_prior = !(simulation.scene.noise.in_test().is_none() && simulation.is_determined());
    let unknowns = simulation.scene.unknowns_per_row(scale);
    let prior = || GaussianPrior::bytes(simulation.scene.loading, rows, unknowns);
    let prior = if needs_prior { prior() } else { 0 };
    let node_pairs = drawn as f64 * node_pairs_per_row(&simulation.sensor);
    Some((float_bytes(drawn, per_sample).saturating_add(prior), node_pairs))
}

/// Returns the number of bytes in this many rows of numbers.
fn float_bytes(rows: usize, columns: usize) -> u64 {
    (rows as u64).saturating_mul((columns * size_of::<f64>()) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(array: &str, method: &str, hidden: usize) -> RunSettings {
        let mut settings = RunSettings {
            hidden,
            ..RunSettings::default()
        };
        settings.simulation_mut().unwrap().sensor.scale = array.parse().unwrap();
        let mut methods = Method::all().into_iter();
        settings.training.method = methods.find(|other| other.short_name() == method).unwrap();
        settings
    }

    fn drawn(settings: &RunSettings) -> Workload {
        Workload::of(settings, TrainingSize::drawn(settings).unwrap())
    }

    #[test]
    fn large_runs_are_distinguished_from_ordinary_ones() {
        let cases = [
            ("10x10_5x30", "lm", 12, false),
            ("10x10_5x30", "br", 16, false),
            ("10x6_3x18", "rp", 64, false),
            ("10x10_5x30", "br", 512, true),
            ("512x512_512x512", "lm", 4, true),
            ("512x512_512x512", "gd", 1, true),
        ];
        for (array, method, hidden, is_large) in cases {
            let workload = drawn(&settings(array, method, hidden));
            assert_eq!(workload.is_large(), is_large, "{array} {method} {hidden}: {workload:?}");
        }
    }

    #[test]
    fn covariances_of_priors_are_counted() {
        let mut smooth = settings("512x512_1x512", "gd", 1);
        smooth.simulation_mut().unwrap().scene.loading = "smooth:4".parse().unwrap();
        let bytes = drawn(&smooth).bytes;
        // The products and the factor of the covariance of each row.
        assert!(bytes > 8 * 2 * 512 * 512 * 512, "{bytes}");
    }

    /// Bayesian regularisation holds the factor and the inverse of the equations of the hidden layer: (31·512)² each.
    #[test]
    fn the_equations_dominate_the_memory_of_wide_networks() {
        let bytes = drawn(&settings("10x10_5x30", "br", 512)).bytes as f64;
        let two_matrices = 2.0 * 8.0 * (31.0 * 512.0_f64).powi(2);
        assert!((1.0..1.4).contains(&(bytes / two_matrices)), "{bytes}");
    }

    #[test]
    fn more_memory_than_the_machine_has_is_rejected() {
        let mut settings = settings("512x512_1x512", "lm", 512);
        settings.simulation_mut().unwrap().validation_samples = 1_000_000;
        settings.simulation_mut().unwrap().test_samples = 1_000_000;
        settings.starts = 100;
        let workload = drawn(&settings);
        assert!(workload.bytes > 500_000_000_000, "{workload:?}");
        let memory = MemoryBudget::System(500_000_000_000);
        let message = workload.check_memory(memory).unwrap_err().to_string();
        assert!(
            message.contains("GB of memory, and the machine has 500.0 GB"),
            "{message}"
        );
        assert!(workload.check_memory(MemoryBudget::UNLIMITED).is_ok());
    }

    #[test]
    fn wide_inputs_make_a_training_on_a_recording_long_and_conjugate_gradients_faster() {
        let settings = RunSettings::measured(crate::scene::RowModel::Shared);
        let size = TrainingSize {
            samples: 5000,
            inputs: 192,
            targets: 3,
            networks: 1,
        };
        let workload = Workload::of(&settings, size);
        let small = Workload::of(&settings, TrainingSize { inputs: 6, ..size });
        assert!(workload.epoch_multiplications > 100.0 * small.epoch_multiplications);
        let faster = workload.faster_methods(&settings, size);
        assert!(
            faster.iter().any(|(method, _)| method.short_name() == "scg"),
            "{faster:?}"
        );
        assert_eq!(workload.node_pairs, 0.0, "nothing is drawn");
    }
}
