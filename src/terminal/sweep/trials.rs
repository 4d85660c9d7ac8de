use std::{
    collections::HashMap,
    fmt::Display,
    ops::ControlFlow,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

use decoupler_core::{
    decoupling::DecoderKind,
    evaluation::{Run, TrainingSize, Workload},
    job::Job,
};
use decoupler_files::{
    export::{
        CheckpointFile, Checkpointing, NetworkFile, Trial, TrialId, TrialOptions, decoders_in_order, recording_options,
        report::RunReport, train_options,
    },
    import::{ImportError, Plan, Setup, SetupSets, file_crc32},
    machine::memory_budget,
};
use serde_json::Value;

use super::{
    command::Claim,
    specification::{Specification, TrainOptions},
};
use crate::terminal::{
    failure::Failure, interruption::save_if_due, samples::sets, train::measure_decoders, train_report::Trained,
};

/// All trials of a specification, without duplicates, each accepted by `train`.
pub(super) struct Trials {
    specification: Specification,
    /// By position.
    ids: Vec<TrialId>,
    /// CRC-32 of the files of recordings in hexadecimal.
    checksums: Mutex<HashMap<PathBuf, String>>,
}

/// A trial to be trained.
pub(super) struct PlannedTrial {
    pub(super) id: TrialId,
    pub(super) setup: Setup,
    /// CRC-32 of the files of the recording, in the order of the plan.
    pub(super) crc32: Vec<String>,
    pub(super) decoders: Vec<DecoderKind>,
    pub(super) options: TrialOptions,
}

impl Trials {
    /// Reads the specification at `path`.
    pub(super) fn read(path: &Path) -> Result<Self, Failure> {
        let mut train = TrainOptions::new();
        let specification = Specification::read(path, &mut train)?;
        Self::of(specification, &mut train)
    }

    /// Plans the trials of `specification`.
    pub fn of(specification: Specification, train: &mut TrainOptions) -> Result<Self, Failure> {
        let mut trials = Self {
            specification,
            ids: Vec::new(),
            checksums: Mutex::default(),
        };
        let mut positions = HashMap::new();
        for position in 0..trials.specification.count()? {
            let trial = trials.parsed(position, train);
            let trial = trial.map_err(|failure| trials.error(position, failure))?;
            if let Some(first) = positions.insert(trial.id, position) {
                let first = trials.describe(first);
                let message = format!("the same options as {first}; leave one of the values out");
                return Err(trials.error(position, message));
            }
            trials.ids.push(trial.id);
        }
        Ok(trials)
    }

    fn parsed(&self, position: usize, train: &mut TrainOptions) -> Result<PlannedTrial, Failure> {
        let words = self.specification.words_at(position);
        let arguments = train.parse(words).map_err(Failure::Arguments)?;
        let setup = arguments.setup(&self.specification)?;
        if setup.plan().is_none() {
            // The array has the rows of the scene.
            TrainingSize::drawn(setup.settings())?;
        }
        let decoders = decoders_in_order(&arguments.decoders(&setup));
        let mut options = train_options(setup.settings(), &decoders);
        let crc32 = setup.plan().map_or(Ok(Vec::new()), |plan| self.crc32(plan))?;
        options.extend(
            setup
                .plan()
                .map(|plan| recording_options(plan, &crc32))
                .unwrap_or_default(),
        );
        Ok(PlannedTrial {
            id: Trial::id_of(&options),
            setup,
            crc32,
            decoders,
            options,
        })
    }

    /// Checksums of the files of `plan`, each read once.
    fn crc32(&self, plan: &Plan) -> Result<Vec<String>, ImportError> {
        let mut checksums = self.checksums.lock().unwrap_or_else(PoisonError::into_inner);
        let of_file = |path: PathBuf| match checksums.get(&path) {
            Some(crc32) => Ok(crc32.clone()),
            None => {
                let crc32 = file_crc32(&path, &mut |_| ControlFlow::Continue(()))?;
                checksums.insert(path, crc32.clone());
                Ok(crc32)
            }
        };
        plan.files().into_iter().map(of_file).collect()
    }

    /// The trial at `position`.
    pub(super) fn get(&self, position: usize, train: &mut TrainOptions) -> Result<PlannedTrial, Failure> {
        let trial = self.parsed(position, train);
        trial.map_err(|failure| self.error(position, failure))
    }

    pub(super) fn count(&self) -> usize {
        self.ids.len()
    }

    pub(super) fn id(&self, position: usize) -> TrialId {
        self.ids[position]
    }

    /// Number of a trial, from 1, with its values of the varied options.
    pub(super) fn describe(&self, position: usize) -> String {
        format!("trial {} ({})", position + 1, self.specification.describe(position))
    }

    fn error(&self, position: usize, message: impl Display) -> Failure {
        self.specification.error(&self.describe(position), message)
    }
}

/// Time between two checkpoints of a trial: the most that a killed program loses.
const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(10);

/// Trains the trial of `claim` and measures it as `train` does, with `parallel` trials at the same time. Returns none if
/// it was stopped, with a checkpoint from which it is resumed with bit-identical results.
pub(super) fn train(
    trial: &PlannedTrial,
    claim: &Claim,
    parallel: usize,
    is_stopped: impl Fn() -> bool,
) -> Result<Option<Trial>, Failure> {
    let begun = Instant::now();
    if trial.setup.plan().is_none() {
        let settings = trial.setup.settings();
        let mut workload = Workload::of(settings, TrainingSize::drawn(settings)?);
        workload.bytes = workload.bytes.saturating_mul(parallel as u64);
        workload.check_memory(memory_budget())?;
    }
    let (mut run, sets, before) = match resumed(trial, claim) {
        Some(resumed) => resumed,
        None => {
            let sets = sets(&trial.setup)?;
            let run = sets.run(&trial.setup, None, &Job::UNINTERRUPTED)?;
            (run, sets, Duration::ZERO)
        }
    };
    let files = sets.recorded().map_or(&[][..], |recorded| &recorded.files);
    let mut read = files.iter().zip(&trial.crc32);
    if let Some((changed, _)) = read.find(|(read, planned)| read.crc32 != **planned) {
        let message = format!(
            "'{}' has changed since the sweep was started; start it again",
            changed.path.display()
        );
        return Err(Failure::Arguments(message));
    }
    let mut checkpointing = Checkpointing::every(CHECKPOINT_INTERVAL, claim.checkpoint(), sets.recorded());
    while run.stop_reason().is_none() {
        if is_stopped() {
            checkpointing.save(&run)?;
            return Ok(None);
        }
        save_if_due(&mut checkpointing, &run);
        run.step();
    }
    let file = NetworkFile::from_run(&run, sets.recorded())?;
    let mut decoders = Vec::new();
    measure_decoders(&trial.decoders, &file, &sets, &mut decoders)?;
    let trained = Trained {
        run: &run,
        sets: &sets,
        report: RunReport {
            name: None,
            file: &file,
            defect: None,
            decoders: &decoders,
            test: run.test(),
        },
        optimism: &[],
    };
    let mut report = trained.object()?;
    report["warnings"] = trained.warnings().into();
    if sets.recorded().is_some() {
        make_comparable(&mut report);
    }
    let seconds = (before + begun.elapsed()).as_secs_f64();
    Ok(Some(Trial::new(trial.options.clone(), report, seconds)))
}

/// Makes reports on a recording identical on all machines: times have distinct names, and files have no folders.
fn make_comparable(report: &mut Value) {
    let Value::Object(fields) = report else { return };
    if let Some(seconds) = fields.remove("seconds") {
        fields.insert("training_seconds".to_owned(), seconds);
    }
    let files = fields.get_mut("files").and_then(Value::as_array_mut);
    for path in files.into_iter().flatten().filter_map(|file| file.get_mut("path")) {
        let name = path.as_str().and_then(|path| Path::new(path).file_name());
        if let Some(name) = name.map(|name| Value::from(name.to_string_lossy())) {
            *path = name;
        }
    }
}

/// The run saved in the checkpoint of `claim`, with its training time so far. A checkpoint that is damaged or does not
/// belong to the trial is ignored.
fn resumed(trial: &PlannedTrial, claim: &Claim) -> Option<(Run, SetupSets, Duration)> {
    let file = CheckpointFile::load(&claim.checkpoint()).ok()?;
    if file.settings != *trial.setup.settings() {
        return None;
    }
    let before = file.wall_time.unwrap_or_default();
    let (run, sets) = file.resume(&Job::UNINTERRUPTED, &mut |_| ()).ok()?;
    Some((run, sets, before))
}

#[cfg(test)]
mod tests {
    use std::{collections::BTreeSet, fs};

    use decoupler_core::{
        dataset::Seed,
        evaluation::{
            RunSettings,
            experiments::{Axis, AxisKind, Experiment, PaperTable},
        },
        scene::Noise,
    };
    use decoupler_files::export::sweep_specification;

    use super::*;

    /// The trials of a specification written by the window are those that the window runs.
    #[test]
    fn an_experiment_of_the_window_is_specified_trial_by_trial() {
        let mut template = PaperTable::HiddenNodes.experiment();
        template.base.simulation_mut().unwrap().scene.noise = Noise::relative(1e-3);
        template.base.seed = Seed(7);
        let experiments = [
            (
                Axis::integers(AxisKind::Hidden, [3, 5]),
                Some(Axis::integers(AxisKind::Samples, [40, 60])),
            ),
            (
                Axis::names(AxisKind::Method, ["lm", "br", "scg"]),
                Some(Axis::integers(AxisKind::Epochs, [2, 3])),
            ),
            (Axis::names(AxisKind::Array, ["4×3_2×6"]), None),
            (Axis::integers(AxisKind::Seed, [1, u64::MAX]), None),
        ];
        for (axis, second_axis) in experiments {
            let experiment = Experiment {
                axis,
                second_axis,
                seeds: 2,
                ..template.clone()
            };
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("sweep.json");
            fs::write(&path, sweep_specification(&experiment, None).unwrap().to_string()).unwrap();
            let trials = Trials::read(&path).unwrap();
            let mut train = TrainOptions::new();
            let specified = (0..trials.count()).map(|position| trials.get(position, &mut train).unwrap().setup);
            let specified: Vec<_> = specified.collect();
            let run: Vec<_> = experiment
                .cells()
                .into_iter()
                .flat_map(|cell| {
                    let seeds = experiment.seeds_of(&cell.settings);
                    seeds.map(move |seed| Setup::of(RunSettings { seed, ..cell.settings }, None).unwrap())
                })
                .collect();
            let texts =
                |setups: &[Setup]| -> BTreeSet<String> { setups.iter().map(|setup| format!("{setup:?}")).collect() };
            assert_eq!(specified.len(), run.len());
            assert_eq!(texts(&specified), texts(&run), "{:?}", experiment.axis);
        }
    }

    #[test]
    fn experiments_without_a_specification_give_a_reason() {
        let folds = sweep_specification(&PaperTable::CrossValidation.experiment(), None);
        assert!(folds.unwrap_err().to_string().contains("no cross-validation"));
        let mut squeezed = PaperTable::HiddenNodes.experiment();
        squeezed.base.simulation_mut().unwrap().scene.largest_compression = 0.3;
        let message = sweep_specification(&squeezed, None).unwrap_err().to_string();
        assert!(message.contains("the largest compression"), "{message}");
    }
}
