use std::{fmt, ops::RangeInclusive, str::FromStr, time::Duration};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Measured, PublishedErrors, RunError, Simulation, Source};
use crate::{
    dataset::{Dataset, LARGEST_SAMPLES, Seed},
    decoupling::{DecoderKind, GaussianPrior},
    machine::{MemoryBudget, Speed, node_pairs_per_row},
    network::{InputChoice, LARGEST_HIDDEN, ScalingChoice, Shape},
    scene::{Movement, RowModel, Rows, Scene},
    training::{Method, ScaledConjugateGradientSettings, StoppingRules, TrainingSettings},
};

/// Settings of a run. The same settings (and the same sets, if measured) give the same network, bit for bit.
///
/// `S` is the source of the samples: any [`Source`], or [`Simulation`] where only that is possible.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunSettings<S = Source> {
    /// Source of the samples.
    pub source: S,
    /// Input quantity and its scaling.
    pub inputs: InputChoice,
    /// Number of hidden nodes.
    pub hidden: usize,
    /// Number of starts: trainings from different random initialisations.
    pub starts: usize,
    /// How several starts become one network.
    #[serde(default, skip_serializing_if = "Combination::is_best")]
    pub combine: Combination,
    /// Weights with which a training begins.
    #[serde(default, skip_serializing_if = "Initialization::is_random")]
    pub initialization: Initialization,
    /// Training method, its settings, and the stopping rules.
    pub training: TrainingSettings,
    /// Seed from which all randomness follows.
    pub seed: Seed,
}

/// How several starts become the network that a run answers with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Combination {
    /// The network of the start with the lowest validation error, or training error if nothing is held out.
    #[default]
    Best,
    /// A committee: the mean of the answers of all starts. Starts share their scalings, so that the mean is exactly one
    /// network with the hidden nodes of all, [`Mlp::mean`](crate::network::Mlp::mean). Its error is never larger than
    /// the mean of their errors (Krogh and Vedelsby 1995).
    Mean,
}

/// Error for an unknown combination.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("'{0}' does not combine starts: give best or mean")]
pub struct CombinationError(String);

impl Combination {
    /// All combinations, in the order offered to the user.
    pub const ALL: [Self; 2] = [Self::Best, Self::Mean];

    fn is_best(&self) -> bool {
        *self == Self::Best
    }
}

impl fmt::Display for Combination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Best => "best",
            Self::Mean => "mean",
        })
    }
}

impl FromStr for Combination {
    type Err = CombinationError;

    fn from_str(text: &str) -> Result<Self, CombinationError> {
        let found = Self::ALL.into_iter().find(|choice| choice.to_string() == text.trim());
        found.ok_or_else(|| CombinationError(text.to_owned()))
    }
}

/// Weights with which a training begins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Initialization {
    /// Random weights ([Nguyen and Widrow](crate::network::nguyen_widrow)).
    #[default]
    Random,
    /// Ridge regression: one hidden node for each of its principal directions, in the linear range of tanh; random weights
    /// elsewhere.
    Ridge,
}

/// Error for an unknown initialisation.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("'{0}' is not an initialisation: give random or ridge")]
pub struct InitializationError(String);

impl Initialization {
    pub(super) fn is_random(&self) -> bool {
        *self == Self::Random
    }
}

impl fmt::Display for Initialization {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Random => "random",
            Self::Ridge => "ridge",
        })
    }
}

impl FromStr for Initialization {
    type Err = InitializationError;

    fn from_str(text: &str) -> Result<Self, InitializationError> {
        let mut choices = [Self::Random, Self::Ridge].into_iter();
        let found = choices.find(|choice| choice.to_string() == text.trim());
        found.ok_or_else(|| InitializationError(text.to_owned()))
    }
}

/// Settings of a run on simulated samples.
pub type SimulatedSettings = RunSettings<Simulation>;

/// Settings of a run on measured samples.
pub type MeasuredSettings = RunSettings<Measured>;

/// Maximum number of starts in a run: enough for the distribution of its results, and limited for memory.
pub const MAX_STARTS: usize = 100;

/// Error for a number out of its range.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{what}: {count} is not possible, give from {} to {}", .allowed.start(), .allowed.end())]
pub struct CountError {
    /// Name of the setting.
    pub what: &'static str,
    /// Given number.
    pub count: usize,
    /// Allowed range.
    pub allowed: RangeInclusive<usize>,
}

impl Default for SimulatedSettings {
    /// Returns the paper's main experiment: 10×10_5×30, 12 hidden nodes, 1000 training and 100 test samples.
    fn default() -> Self {
        Self::of(Simulation::default(), InputChoice::PAPER)
    }
}

impl From<Measured> for RunSettings {
    /// Returns the settings for measured samples: raw readings scaled to [−1, 1], and 300 epochs of Bayesian
    /// regularisation for [recordings](Method::recorded_regularization) with nothing held out.
    ///
    /// Recordings are short, noisy, and vary over time, so a validation set of consecutive samples costs samples and
    /// can end the training by chance. With Levenberg-Marquardt, stopped on the last fifth of a recording of forces,
    /// errors vary twofold with the seed; with Bayesian regularisation on the whole recording they do not. It estimates
    /// the noise of each target, and regularises each class of weights with its own strength: with one strength for
    /// all, it is worse than ridge regression on 20 samples. Selecting the best of several starts by training error has no benefit.
    fn from(measured: Measured) -> Self {
        let mut settings = Self::of(measured.into(), InputChoice::MEASURED);
        settings.training.method = Method::recorded_regularization();
        settings.training.stopping = StoppingRules::recorded(&settings.training.method);
        settings
    }
}

impl From<SimulatedSettings> for RunSettings {
    fn from(settings: SimulatedSettings) -> Self {
        settings.with_source(settings.source.into())
    }
}

impl From<MeasuredSettings> for RunSettings {
    fn from(settings: MeasuredSettings) -> Self {
        settings.with_source(settings.source.into())
    }
}

impl<S> RunSettings<S> {
    fn of(source: S, inputs: InputChoice) -> Self {
        Self {
            source,
            inputs,
            hidden: 12,
            starts: 1,
            combine: Combination::Best,
            initialization: Initialization::Random,
            training: TrainingSettings::default(),
            seed: Seed::default(),
        }
    }

    fn with_source<T>(&self, source: T) -> RunSettings<T> {
        let &Self {
            source: _,
            inputs,
            hidden,
            starts,
            combine,
            initialization,
            training,
            seed,
        } = self;
        RunSettings {
            source,
            inputs,
            hidden,
            starts,
            combine,
            initialization,
            training,
            seed,
        }
    }

    /// Checks the numbers of hidden nodes and starts; the other parts are checked where they are used.
    ///
    /// # Errors
    /// The first number out of range.
    pub fn check_network(&self) -> Result<(), CountError> {
        check([
            ("hidden nodes", self.hidden, 1..=LARGEST_HIDDEN),
            ("starts", self.starts, 1..=MAX_STARTS),
            (
                "hidden nodes of all starts together",
                self.network_hidden(),
                1..=LARGEST_HIDDEN,
            ),
        ])
    }

    /// Number of hidden nodes of the network that a run answers with: those of all starts if their mean is kept.
    pub fn network_hidden(&self) -> usize {
        match self.combine {
            Combination::Best => self.hidden,
            Combination::Mean => self.hidden.saturating_mul(self.starts),
        }
    }
}

impl RunSettings {
    /// Default share of the training samples of a recording held out for validation: a fifth, or none if the method
    /// [needs none](Method::needs_validation).
    pub fn validation_fraction(&self) -> f64 {
        if self.training.method.needs_validation() {
            0.2
        } else {
            0.0
        }
    }

    /// Changes the method. On a recording, Bayesian regularisation with its usual settings gets [those for
    /// recordings](Method::recorded_regularization), and the [default rules](StoppingRules::recorded) of the present
    /// method become those of the new one.
    pub fn choose_method(&mut self, method: Method) {
        let before = std::mem::replace(&mut self.training.method, method);
        if matches!(self.source, Source::Simulated(_)) {
            return;
        }
        if method == Method::bayesian_regularization() {
            self.training.method = Method::recorded_regularization();
        }
        let (usual, then) = (StoppingRules::recorded(&before), StoppingRules::recorded(&method));
        let rules = &mut self.training.stopping;
        if rules.epochs == usual.epochs {
            rules.epochs = then.epochs;
        }
        if rules.max_fail == usual.max_fail {
            rules.max_fail = then.max_fail;
        }
    }

    /// Returns these settings as settings of a run on measured samples, if they are.
    pub fn measured(&self) -> Option<MeasuredSettings> {
        match self.source {
            Source::Simulated(_) => None,
            Source::Measured(measured) => Some(self.with_source(measured)),
        }
    }

    /// Returns these settings as settings of a simulation, if they are.
    pub fn simulated(&self) -> Option<SimulatedSettings> {
        let simulation = self.source.simulation()?;
        Some(self.with_source(*simulation))
    }
}

impl SimulatedSettings {
    /// Checks all numbers; the other parts are checked where they are used.
    ///
    /// # Errors
    /// The first number out of range.
    pub fn check_counts(&self) -> Result<(), CountError> {
        self.check_network()?;
        check([
            ("training samples", self.source.samples, 1..=LARGEST_SAMPLES),
            (
                "validation samples",
                self.source.validation_samples,
                0..=LARGEST_SAMPLES,
            ),
            ("test samples", self.source.test_samples, 1..=LARGEST_SAMPLES),
        ])
    }

    /// Returns the errors that the paper reports for this configuration, if there are any.
    pub fn published(&self) -> Option<PublishedErrors> {
        let published = PublishedErrors::of(self.source.sensor.scale, self.hidden, self.source.samples);
        published.filter(|_| self.is_papers_scene())
    }

    /// Returns `true` if the scene and inputs are those of the paper's experiments.
    pub fn is_papers_scene(&self) -> bool {
        self.source.scene == Scene::default() && self.inputs == InputChoice::PAPER
    }
}

fn check<const N: usize>(counts: [(&'static str, usize, RangeInclusive<usize>); N]) -> Result<(), CountError> {
    match counts.into_iter().find(|(_, count, allowed)| !allowed.contains(count)) {
        Some((what, count, allowed)) => Err(CountError { what, count, allowed }),
        None => Ok(()),
    }
}

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

/// Size of the training set of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordedSize {
    /// Number of training samples.
    pub samples: usize,
    /// Number of inputs.
    pub inputs: usize,
    /// Number of targets.
    pub targets: usize,
    /// Number of networks: 1, or one for each row-wire.
    pub networks: usize,
}

impl RecordedSize {
    /// Returns the size of a training set on which networks with these settings are trained.
    pub fn of(settings: &RunSettings, training: &Dataset) -> Self {
        Self {
            samples: training.samples(),
            inputs: training.readings().ncols(),
            targets: training.targets().ncols(),
            networks: match settings.source.row_model() {
                RowModel::Shared => 1,
                RowModel::Each => training.row_count(),
            },
        }
    }
}

/// Time of a run on this machine, from rates measured on one thread. Large runs are faster with more threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorkloadTime {
    /// Time to draw the samples.
    pub drawing: Duration,
    /// Time per epoch.
    pub epoch: Duration,
    /// Time of all epochs, if none of the other stopping rules ends the training.
    pub all_epochs: Duration,
}

impl Workload {
    /// Number of vectors with an entry for each weight in a method and its trainer.
    const VECTORS: usize = 8;

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
        // Readings and targets are drawn, split, scaled, and copied to blocks for the training.
        let per_sample = 3 * scale.columns() + 3 * scale.coordinates_per_row() + shape.inputs + 1 + shape.outputs;
        let samples = float_bytes(training.saturating_add(held_out), per_sample);
        let trainings = settings.starts * size.networks;
        let of_each = training.div_ceil(size.networks);
        let method = &settings.training.method;
        // Whitening may leave inputs out, and products of fewer inputs may be kept that would be recomputed for all.
        let fewest = match settings.inputs.scaling {
            ScalingChoice::MinMax => shape.inputs,
            ScalingChoice::Whitening => 1,
        };
        let with_inputs = |inputs| method.equations_bytes(Shape { inputs, ..shape }, of_each);
        let equations_bytes = (fewest..=shape.inputs).map(with_inputs).max().unwrap_or(0);
        let training_bytes = (equations_bytes as u64).saturating_add(float_bytes(shape.weights(), Self::VECTORS));
        let unknowns = size.unknowns / size.rows;
        // Exact readings that determine the deformation need no prior.
        let has_priors = !source.scene.noise.in_test().is_none() || scale.columns() <= unknowns;
        let priors = if has_priors {
            GaussianPrior::bytes(source.scene.loading, size.rows, unknowns)
        } else {
            0
        };
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

    /// Computes the workload of a training on a recording. Its samples, which have been read by then, are not counted.
    pub fn of_recording(settings: &RunSettings, size: RecordedSize) -> Self {
        let shape = Shape {
            inputs: size.inputs,
            hidden: settings.hidden,
            outputs: size.targets,
        };
        let (method, of_each) = (&settings.training.method, size.samples.div_ceil(size.networks.max(1)));
        let trainings = settings.starts * size.networks;
        let bytes =
            (method.equations_bytes(shape, of_each) as u64).saturating_add(float_bytes(shape.weights(), Self::VECTORS));
        Self {
            bytes: bytes.saturating_mul(trainings as u64),
            node_pairs: 0.0,
            epoch_multiplications: trainings as f64 * method.epoch_multiplications(shape, of_each),
            epochs: settings.training.stopping.epochs,
        }
    }

    /// Returns the methods that would train on the same recording in less than half of this time, with the time of each
    /// for the number of epochs that it gets by default.
    pub fn faster_methods(&self, settings: &RunSettings, size: RecordedSize) -> Vec<(Method, Duration)> {
        let present = self.time().all_epochs;
        let candidates = [
            Method::default(),
            Method::ScaledConjugateGradient(ScaledConjugateGradientSettings::default()),
        ];
        let of_each = candidates.into_iter().map(|method| {
            let mut other = *settings;
            other.choose_method(method);
            (method, Self::of_recording(&other, size).time().all_epochs)
        });
        of_each.filter(|(_, time)| time.saturating_mul(2) < present).collect()
    }

    /// Computes the workload of measuring `decoders` with networks of each number of `hidden` nodes one after the
    /// other, which is the workload of the largest run.
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

    /// Returns `true` if the user should be warned of the memory or time before the run begins: more than a gigabyte,
    /// some seconds to draw the samples, or a second per epoch.
    pub fn is_large(&self) -> bool {
        self.bytes > 1_000_000_000 || self.node_pairs > 1e10 || self.epoch_multiplications > 1e10
    }

    /// Returns `true` if samples are drawn, not read.
    pub fn draws_samples(&self) -> bool {
        self.node_pairs > 0.0
    }

    /// Computes the time on this machine. The first call measures its speed, which takes about 20 ms.
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

    /// Checks that the work fits into `memory`.
    ///
    /// # Errors
    /// [`RunError::Memory`] if it does not.
    pub fn check_memory(&self, memory: MemoryBudget) -> Result<(), RunError> {
        if self.bytes > memory.bytes {
            return Err(RunError::Memory {
                bytes: self.bytes,
                memory,
            });
        }
        Ok(())
    }
}

/// Returns the shape of a network with these settings if the scaling leaves out no input.
fn largest_shape(settings: &SimulatedSettings) -> Shape {
    let (scene, scale) = (&settings.source.scene, settings.source.sensor.scale);
    let varying_axes = match (scene.movement, scene.rows) {
        (Movement::Xyz { .. }, _) => 3,
        // A network that does not know the row also learns the x coordinate.
        (Movement::Z, Rows::All) if scale.rows() > 1 => 2,
        (Movement::Z, _) => 1,
    };
    Shape {
        inputs: scale.columns(),
        hidden: settings.hidden,
        outputs: varying_axes * scale.nodes_per_row(),
    }
}

/// Returns the number of bytes in this many rows of numbers.
fn float_bytes(rows: usize, columns: usize) -> u64 {
    (rows as u64).saturating_mul((columns * size_of::<f64>()) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{machine::MemorySource, training::Method};

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
            let workload = Workload::of(&settings(array, method, hidden)).unwrap();
            assert_eq!(workload.is_large(), is_large, "{array} {method} {hidden}: {workload:?}");
        }
    }

    #[test]
    fn kept_products_and_covariances_of_priors_are_counted() {
        let mut known = settings("10x10_5x30", "lm", 12);
        known.source.scene.rows = Rows::Known;
        known.source.samples = 60_000;
        // 31·32/2 products of two inputs and 12 + 1 + 10 activations of each sample.
        let kept = 8 * 60_000 * (496 + 23);
        assert!(Workload::of(&known).unwrap().bytes > kept);
        // Products of all 31 inputs would take 40 MB for each row; those of 27 inputs take 30 MB and are kept.
        known.source.samples = 100_000;
        let by_range = Workload::of(&known).unwrap().bytes;
        known.inputs.scaling = ScalingChoice::Whitening;
        let whitened = Workload::of(&known).unwrap().bytes;
        assert!(whitened > by_range + 10 * 30_000_000, "{whitened} {by_range}");
        let mut smooth = settings("512x512_1x512", "gd", 1);
        smooth.source.scene.loading = "smooth:4".parse().unwrap();
        let bytes = Workload::of(&smooth).unwrap().bytes;
        // The products and the factor of the covariance of each row.
        assert!(bytes > 8 * 2 * 512 * 512 * 512, "{bytes}");
    }

    /// Bayesian regularisation holds the factor and the inverse of the equations of the hidden layer: (31·512)² each.
    #[test]
    fn the_equations_dominate_the_memory_of_wide_networks() {
        let bytes = Workload::of(&settings("10x10_5x30", "br", 512)).unwrap().bytes as f64;
        let two_matrices = 2.0 * 8.0 * (31.0 * 512.0_f64).powi(2);
        assert!((1.0..1.4).contains(&(bytes / two_matrices)), "{bytes}");
    }

    #[test]
    fn more_memory_than_the_machine_has_is_rejected() {
        let mut settings = settings("512x512_1x512", "lm", 512);
        settings.source.validation_samples = 1_000_000;
        settings.source.test_samples = 1_000_000;
        settings.starts = 100;
        let workload = Workload::of(&settings).unwrap();
        assert!(workload.bytes > 500_000_000_000, "{workload:?}");
        let memory = MemoryBudget {
            bytes: 500_000_000_000,
            source: MemorySource::System,
        };
        let message = workload.check_memory(memory).unwrap_err().to_string();
        assert!(
            message.contains("GB of memory, and the machine has 500.0 GB"),
            "{message}"
        );
        assert!(workload.check_memory(MemoryBudget::UNLIMITED).is_ok());
    }

    #[test]
    fn a_method_chosen_for_a_recording_brings_its_settings_and_rules_unless_the_user_set_others() {
        let measured = || RunSettings::from(Measured { rows: RowModel::Shared });
        let scg = Method::ScaledConjugateGradient(ScaledConjugateGradientSettings::default());
        let mut settings = measured();
        settings.choose_method(scg);
        let rules = settings.training.stopping;
        assert_eq!((rules.epochs, rules.max_fail), (2000, 100));
        settings.choose_method(Method::bayesian_regularization());
        assert_eq!(settings, measured());
        settings.training.stopping.epochs = 50;
        settings.choose_method(scg);
        let rules = settings.training.stopping;
        assert_eq!((rules.epochs, rules.max_fail), (50, 100));
        let mut simulated = RunSettings::from(SimulatedSettings::default());
        simulated.choose_method(scg);
        assert_eq!(simulated.training.stopping, StoppingRules::default());
    }

    #[test]
    fn wide_inputs_make_a_training_on_a_recording_long_and_conjugate_gradients_faster() {
        let settings = RunSettings::from(Measured { rows: RowModel::Shared });
        let size = RecordedSize {
            samples: 5000,
            inputs: 192,
            targets: 3,
            networks: 1,
        };
        let workload = Workload::of_recording(&settings, size);
        let small = Workload::of_recording(&settings, RecordedSize { inputs: 6, ..size });
        assert!(workload.epoch_multiplications > 100.0 * small.epoch_multiplications);
        let faster = workload.faster_methods(&settings, size);
        assert!(
            faster.iter().any(|(method, _)| method.short_name() == "scg"),
            "{faster:?}"
        );
        assert!(!workload.draws_samples());
    }
}
