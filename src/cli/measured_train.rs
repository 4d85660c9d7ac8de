use std::path::Path;

use super::{
    checkpointing::Saving,
    failure::Failure,
    import_arguments::{with_bar, working_folder},
    measured_report::{self, Folds, Judged, Report},
    output::progress_bar,
    train::Train,
};
use crate::{
    dataset::{self, Dataset, Division, SplitBy, Stream},
    evaluation::{
        CrossValidated, Run, RunError, RunSettings, TargetRow,
        recorded::{Determination, SplitComparison},
    },
    export::{MeasuredCheckpointFile, MeasuredNetworkFile},
    import::{Channel, Plan, PlannedSets},
};

impl Train {
    /// Trains on the samples of files.
    pub(super) fn run_measured(&self) -> Result<(), Failure> {
        let mut plan = self.import.plan(self.training.scene.columns())?;
        let settings = self.training.measured(plan.import.row_wire.is_some())?;
        if !self.import.holds_out() {
            plan.division.validation_fraction = settings.validation_fraction();
        }
        if let Some(folds) = self.import.folds {
            return self.cross_validate(&plan, &settings, folds);
        }
        let sets = self.sets(&plan, &settings)?;
        self.import.save_recipe(&plan)?;
        let report = Report::new(&plan, &sets);
        let plan = plan.absolute();
        let saving = Saving::Measured {
            samples_crc32: MeasuredCheckpointFile::checksum(&sets),
            plan: Box::new(plan.clone()),
        };
        let PlannedSets {
            split, test, recording, ..
        } = sets;
        let channels = (recording.inputs, recording.targets);
        let set = flatters(&plan).then_some(recording.set);
        let run = Run::on_sets(settings, split, test)?;
        self.finish_measured(run, plan, (&channels.0, &channels.1), saving, (report, set))
    }

    /// Resumes the training of a checkpoint on measured samples.
    pub(super) fn resume_measured(&self, path: &Path, file: MeasuredCheckpointFile) -> Result<(), Failure> {
        let saved = file.settings;
        self.training.check_resumed(&saved)?;
        let training = self.training.training(saved.training)?;
        let plan = file.plan.clone();
        let settings: RunSettings = saved.into();
        let sets = self.sets(&plan, &settings)?;
        let found = MeasuredCheckpointFile::checksum(&sets);
        if found != file.samples_crc32 {
            return Err(Failure::OtherSamples {
                path: path.to_owned(),
                data: plan.import.data,
            });
        }
        let report = Report::new(&plan, &sets);
        let saving = Saving::Measured {
            samples_crc32: found,
            plan: Box::new(plan.clone()),
        };
        let channels = (sets.recording.inputs.clone(), sets.recording.targets.clone());
        let set = flatters(&plan).then(|| sets.recording.set.clone());
        let mut run = file.resume(sets).map_err(|source| Failure::Resume {
            path: path.to_owned(),
            source,
        })?;
        self.continue_run(&mut run, saved.training, training)?;
        self.finish_measured(run, plan, (&channels.0, &channels.1), saving, (report, set))
    }

    fn sets(&self, plan: &Plan, settings: &RunSettings) -> Result<PlannedSets, Failure> {
        Ok(with_bar(self.json, |watch| {
            plan.sets(working_folder(), settings.seed, watch)
        })?)
    }

    fn finish_measured(
        &self,
        mut run: Run,
        plan: Plan,
        channels: (&[Channel], &[Channel]),
        saving: Saving,
        (report, set): (Report, Option<Dataset>),
    ) -> Result<(), Failure> {
        let checkpointing = self.checkpoint.checkpointing(saving);
        let end = self.train(&mut run, checkpointing);
        let division = plan.division;
        let file = MeasuredNetworkFile::from_run(&run, plan, channels)?;
        let saved = self.out.as_ref().map_or(Ok(()), |path| file.save(path));
        let mut rng = run.settings().seed.rng(Stream::Resampling);
        let answers = run.decouple_test();
        let flattery = match set.filter(|_| end.is_ok()) {
            Some(set) => self.compared_in_time(&run, &set, division, channels.1),
            None => Vec::new(),
        };
        let flaw = run.flaw();
        let judged = Judged {
            flaw: flaw.as_ref(),
            wall_time: run.wall_time(),
            told: Determination::measure(run.test(), answers.view(), division.by, &mut rng),
            flattery,
        };
        measured_report::print(&report, &file, &judged, self.json)?;
        self.end(saved, end)
    }

    /// Trains once more with the last samples for the test instead of random ones, and says how much these flatter.
    fn compared_in_time(&self, run: &Run, set: &Dataset, division: Division, targets: &[Channel]) -> Vec<String> {
        let division = Division {
            by: SplitBy::Time,
            ..division
        };
        let settings = *run.settings();
        let in_time = || -> Result<Run, RunError> {
            let parts = division.divide(set, &mut settings.seed.rng(Stream::Split))?;
            Run::on_sets(settings, parts.split(set), parts.test_set(set))
        };
        let mut in_time = match in_time() {
            Ok(in_time) => in_time,
            Err(error) => {
                return vec![format!(
                    "a random split flatters where neighbouring rows are alike, and how much is not known here: split by \
                     time, {error}"
                )];
            }
        };
        let bar = progress_bar(
            self.json,
            settings.training.stopping.epochs,
            "{bar:30} split by time, to compare",
        );
        while in_time.step().is_none() {
            bar.inc(1);
        }
        bar.finish_and_clear();
        sentences([&in_time, run].map(Run::target_table), targets)
    }

    fn cross_validate(&self, plan: &Plan, settings: &RunSettings, folds: usize) -> Result<(), Failure> {
        for (is_given, argument) in [
            (self.out.is_some(), "--out"),
            (self.checkpoint.checkpoint.is_some(), "--checkpoint"),
        ] {
            if is_given {
                let message =
                    format!("{argument}: --folds trains a network for each fold and keeps none; leave one out");
                return Err(Failure::Arguments(message));
            }
        }
        let recording = with_bar(self.json, |watch| plan.recording(working_folder(), watch))?;
        self.import.save_recipe(plan)?;
        let set = &recording.set;
        let validate = |by| -> Result<CrossValidated, Failure> {
            let dealt = dataset::Folds::by(set, folds, by, &mut settings.seed.rng(Stream::Split));
            let dealt = dealt.map_err(|error| Failure::Arguments(error.to_string()))?;
            let validated = CrossValidated::on_folds(settings, set, dealt, || false)?;
            Ok(validated.expect("nothing cancels it"))
        };
        let validated = validate(plan.division.by)?;
        let flattery = if plan.division.by == SplitBy::Random {
            let in_time = validate(SplitBy::Time)?;
            let tables = [&in_time, &validated].map(|validated| validated.target_table(set));
            sentences(tables, &recording.targets)
        } else {
            Vec::new()
        };
        let report = Folds::new(plan, &recording, settings, &validated, flattery);
        measured_report::print_folds(&report, &recording.targets, self.json)
    }
}

/// Returns `true` if the test samples are random ones of a recording.
fn flatters(plan: &Plan) -> bool {
    plan.division.by == SplitBy::Random && plan.test.is_none()
}

/// Says how much random test samples flatter; the tables are those of a split in time and of a random one.
fn sentences(tables: [Vec<TargetRow>; 2], targets: &[Channel]) -> Vec<String> {
    let comparison = SplitComparison::of(SplitBy::Time, tables);
    let targets = targets.iter().enumerate();
    targets
        .map(|(index, target)| comparison.sentence(index, &target.name))
        .collect()
}
