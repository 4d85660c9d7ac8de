use std::time::Duration;

use super::{RunError, SimulatedSettings};
use crate::{
    decoupling::{DecoderKind, Posterior},
    machine::{MachineMemory, Speed, node_pairs_per_row},
    network::{ScalingChoice, Shape},
    scene::{Movement, Rows},
};

/// Memory and work of a run, from the sizes in its settings alone, so that both are known before it begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workload {
    /// Memory at its peak, in bytes: samples, drawn and scaled, equations of all trainings, and priors of the rows.
    pub bytes: u64,
    /// Pairs of nodes in the resistances of all samples that are drawn.
    node_pairs: f64,
    /// Multiplications of an epoch of all trainings.
    epoch_multiplications: f64,
    /// Largest number of epochs.
    pub epochs: usize,
}

/// Time of a run on this machine, from rates measured on one thread. With more threads large runs are faster.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorkloadTime {
    /// Time to draw the samples.
    pub drawing: Duration,
    /// Time of an epoch.
    pub epoch: Duration,
    /// Time of all epochs, if none of the other stopping rules ends the training.
    pub all_epochs: Duration,
}

impl Workload {
    /// Computes the workload of `settings`.
    ///
    /// # Errors
    /// If the array lacks a row of the scene.
    pub fn of(settings: &SimulatedSettings) -> Result<Self, RunError> {
        let source = &settings.source;
        let size = source.model_size()?;
        let scale = source.sensor.scale;
        let whole = |samples: usize| samples.div_ceil(size.rows) * size.rows;
        let training = whole(source.samples);
        let held_out = whole(source.validation_samples) + whole(source.test_samples);
        let shape = largest_shape(settings);
        // Readings and targets: drawn, split, scaled, and in blocks for the training.
        let per_sample = 3 * scale.columns() + 3 * scale.coordinates_per_row() + shape.inputs + 1 + shape.outputs;
        let samples = float_bytes(training.saturating_add(held_out), per_sample);
        let trainings = settings.starts * size.networks;
        let of_each = training.div_ceil(size.networks);
        let method = &settings.training.method;
        /// Vectors of a method and its trainer with an entry for each weight.
        const VECTORS: usize = 8;
        // Whitening may leave inputs out, and products of fewer inputs may be kept where those of all are recomputed.
        let fewest = match settings.inputs.scaling {
            ScalingChoice::MinMax => shape.inputs,
            ScalingChoice::Whitening => 1,
        };
        let with_inputs = |inputs| method.equations_bytes(Shape { inputs, ..shape }, of_each);
        let equations_bytes = (fewest..=shape.inputs).map(with_inputs).max().unwrap_or(0);
        let training_bytes = (equations_bytes as u64).saturating_add(float_bytes(shape.weights(), VECTORS));
        let priors = Posterior::prior_bytes(&source.scene, size.rows, size.unknowns / size.rows);
        let per_row = node_pairs_per_row(&source.sensor);
        let bytes = samples
            .saturating_add(training_bytes.saturating_mul(trainings as u64))
            .saturating_add(priors);
        Ok(Self {
            bytes,
            node_pairs: (training + held_out) as f64 * per_row,
            epoch_multiplications: trainings as f64 * method.epoch_multiplications(shape, of_each),
            epochs: settings.training.stopping.epochs,
        })
    }

    /// Computes the workload of measuring `decoders` with networks of each number of `hidden` nodes, one after the other: that
    /// of the largest run.
    ///
    /// # Errors
    /// If the array lacks a row of the scene.
    pub fn of_trade_off(
        settings: &SimulatedSettings,
        hidden: &[usize],
        decoders: &[DecoderKind],
    ) -> Result<Self, RunError> {
        let trains = decoders.iter().any(|kind| kind.needs_network());
        let largest = hidden.iter().copied().max().filter(|_| trains);
        Self::of(&SimulatedSettings {
            hidden: largest.unwrap_or(1),
            ..*settings
        })
    }

    /// Returns `true` if it takes this much memory or time that the user should know before it begins: a gigabyte, some
    /// seconds to draw the samples, or a second an epoch.
    pub fn is_large(&self) -> bool {
        self.bytes > 1_000_000_000 || self.node_pairs > 1e10 || self.epoch_multiplications > 1e10
    }

    /// Computes the time on this machine. The first time its speed is measured, which takes some 20 ms.
    pub fn time(&self) -> WorkloadTime {
        let speed = Speed::measured();
        let duration = |seconds: f64| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        let epoch = self.epoch_multiplications / speed.multiplications;
        WorkloadTime {
            drawing: duration(self.node_pairs / speed.node_pairs),
            epoch: duration(epoch),
            all_epochs: duration(epoch * self.epochs as f64),
        }
    }

    /// Checks that there is the memory.
    ///
    /// # Errors
    /// [`RunError::Memory`] if it has not.
    pub fn check_memory(&self) -> Result<(), RunError> {
        let memory = MachineMemory::of_this_machine();
        if self.bytes > memory.bytes {
            return Err(RunError::Memory {
                bytes: self.bytes,
                memory,
            });
        }
        Ok(())
    }
}

/// Shape of a network of these settings if no input is left out by its scaling.
fn largest_shape(settings: &SimulatedSettings) -> Shape {
    let (scene, scale) = (&settings.source.scene, settings.source.sensor.scale);
    let varying_axes = match (scene.movement, scene.rows) {
        (Movement::Xyz { .. }, _) => 3,
        // A network that does not know the row also learns its x.
        (Movement::Z, Rows::All) if scale.rows() > 1 => 2,
        (Movement::Z, _) => 1,
    };
    Shape {
        inputs: scale.columns(),
        hidden: settings.hidden,
        outputs: varying_axes * scale.nodes_per_row(),
    }
}

/// Bytes of this many rows of numbers.
fn float_bytes(rows: usize, columns: usize) -> u64 {
    (rows as u64).saturating_mul((columns * size_of::<f64>()) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::training::Method;

    fn settings(array: &str, method: &str, hidden: usize) -> SimulatedSettings {
        let mut settings = SimulatedSettings {
            hidden,
            ..SimulatedSettings::default()
        };
        settings.source.sensor.scale = array.parse().unwrap();
        let mut methods = Method::all().into_iter();
        settings.training.method = methods.find(|other| other.short_name() == method).unwrap();
        settings
    }

    #[test]
    fn large_runs_are_told_from_ordinary_ones() {
        let cases = [
            ("10x10_5x30", "lm", 12, false),
            ("10x10_5x30", "br", 16, false),
            ("10x6_3x18", "rp", 64, false),
            ("10x10_5x30", "br", 512, true),
            ("512x512_512x512", "lm", 4, true),
            ("512x512_512x512", "gd", 1, true),
        ];
        for (array, method, hidden, is_large) in cases {
            let workload = Workload::of(&settings(array, method, hidden)).unwrap();
            assert_eq!(workload.is_large(), is_large, "{array} {method} {hidden}: {workload:?}");
        }
    }

    #[test]
    fn kept_products_and_draws_of_priors_are_counted() {
        let mut known = settings("10x10_5x30", "lm", 12);
        known.source.scene.rows = Rows::Known;
        known.source.samples = 60_000;
        // 31·32/2 products of two inputs and 12 + 1 + 10 activations of each sample.
        let kept = 8 * 60_000 * (496 + 23);
        assert!(Workload::of(&known).unwrap().bytes > kept);
        // Products of all 31 inputs would take 40 MB for each row, those of 27 take 30 MB and are kept.
        known.source.samples = 100_000;
        let by_range = Workload::of(&known).unwrap().bytes;
        known.inputs.scaling = ScalingChoice::Whitening;
        let whitened = Workload::of(&known).unwrap().bytes;
        assert!(whitened > by_range + 10 * 30_000_000, "{whitened} {by_range}");
        let mut smooth = settings("512x512_1x512", "gd", 1);
        smooth.source.scene.loading = "smooth:4".parse().unwrap();
        let bytes = Workload::of(&smooth).unwrap().bytes;
        assert!(bytes > 8 * 512 * 512 * 4000, "{bytes}");
    }

    /// Bayesian regularisation holds the factor and the inverse of the equations of the hidden layer: (31·512)² each.
    #[test]
    fn the_equations_dominate_the_memory_of_wide_networks() {
        let bytes = Workload::of(&settings("10x10_5x30", "br", 512)).unwrap().bytes as f64;
        let two_matrices = 2.0 * 8.0 * (31.0 * 512.0_f64).powi(2);
        assert!((1.0..1.4).contains(&(bytes / two_matrices)), "{bytes}");
    }

    #[test]
    fn what_no_machine_has_is_refused() {
        let mut settings = settings("512x512_1x512", "lm", 512);
        settings.source.validation_samples = 1_000_000;
        settings.source.test_samples = 1_000_000;
        settings.starts = 100;
        let workload = Workload::of(&settings).unwrap();
        assert!(workload.bytes > 500_000_000_000, "{workload:?}");
        let memory = MachineMemory::of_this_machine();
        if memory.bytes < workload.bytes {
            let message = workload.check_memory().unwrap_err().to_string();
            assert!(message.contains(&format!("GB of memory, and {memory}")), "{message}");
        }
    }
}
