use std::{
    io::{Write, stderr},
    path::Path,
};

use super::{
    checkpointing::Saving,
    failure::Failure,
    import_arguments::{with_bar, working_folder},
    interruption::Graceful,
    measured_report::{self, Folds, Judged, Report},
    output::progress_bar,
    train::Train,
};
use crate::{
    dataset::{self, Dataset, Division, SplitBy, Stream},
    evaluation::Channel,
    evaluation::{
        CrossValidated, Run, RunError, RunSettings,
        recorded::{Determination, SplitComparison},
    },
    export::{MeasuredCheckpointFile, MeasuredNetworkFile},
    import::{Plan, PlannedSets},
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
        let plan = file.plan.clone();
        self.import.check_resumed(&plan)?;
        let has_row_wires = plan.import.row_wire.is_some();
        let training = self
            .training
            .resumed_measured(&saved, &plan.import.inputs, has_row_wires)?;
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
        let mut end = self.train(&mut run, checkpointing);
        let division = plan.division;
        let file = MeasuredNetworkFile::from_run(&run, plan, channels)?;
        let saved = self.out.as_ref().map_or(Ok(()), |path| file.save(path));
        let answers = run.decouple_test();
        let mut flattery = Vec::new();
        if let Some(set) = set.filter(|_| end.is_ok()) {
            match self.compared(&run, &set, division, channels.1) {
                Ok(sentences) => flattery = sentences,
                Err(interrupted) => end = Err(interrupted),
            }
        }
        let flaw = run.flaw();
        let judged = Judged {
            flaw: flaw.as_ref(),
            wall_time: run.wall_time(),
            told: Determination::measure(run.test(), answers.view(), division.by),
            flattery,
        };
        measured_report::print(&report, &file, &judged, self.json)?;
        self.end(saved, end)
    }

    /// Trains again on a split by group (by time without groups), and says how optimistic the random test samples are. Ctrl-C
    /// ends only this comparison.
    fn compared(
        &self,
        run: &Run,
        set: &Dataset,
        division: Division,
        targets: &[Channel],
    ) -> Result<Vec<String>, Failure> {
        let by = SplitBy::honest(set);
        let graceful = Graceful::begin();
        announce_comparison(by);
        let settings = *run.settings();
        let honest = || -> Result<Run, RunError> {
            let parts = Division { by, ..division }.divide(set, &mut settings.seed.rng(Stream::Split))?;
            Run::on_sets(settings, parts.split(set), parts.test_set(set))
        };
        let mut honest = match honest() {
            Ok(honest) => honest,
            Err(error) => {
                return Ok(vec![format!(
                    "a random split flatters where neighbouring rows are alike, and how much is not known here: split by \
                     {by}, {error}"
                )]);
            }
        };
        let bar = progress_bar(
            self.json,
            settings.training.stopping.epochs,
            "{bar:30} second training, to compare",
        );
        while !graceful.is_end_requested() && honest.step().is_none() {
            bar.inc(1);
        }
        bar.finish_and_clear();
        if honest.stop_reason().is_none() {
            return Err(Failure::InterruptedComparison { by });
        }
        Ok(sentences(
            &SplitComparison::of(by, [&honest, run].map(Run::target_table)),
            targets,
        ))
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
        let by = plan.division.by;
        let dealt = dataset::Folds::by(set, folds, by, &mut settings.seed.rng(Stream::Split));
        let dealt = dealt.map_err(|error| Failure::Arguments(error.to_string()))?;
        let validated = CrossValidated::on_folds(settings, set, dealt, || false)?.expect("nothing cancels it");
        let (mut flattery, mut end) = (Vec::new(), Ok(()));
        if by == SplitBy::Random {
            let honest = SplitBy::honest(set);
            let graceful = Graceful::begin();
            announce_comparison(honest);
            let is_cancelled = || graceful.is_end_requested();
            match SplitComparison::complete(settings, set, folds, (by, &validated), &is_cancelled)? {
                Some(comparison) => flattery = sentences(&comparison, &recording.targets),
                None => end = Err(Failure::InterruptedComparison { by: honest }),
            }
        }
        let report = Folds::new(plan, &recording, settings, &validated, flattery);
        measured_report::print_folds(&report, &recording.targets, self.json)?;
        end
    }
}

/// Reports on standard error that the same settings are trained again.
fn announce_comparison(by: SplitBy) {
    // Nobody is left to tell if this fails.
    let _ = writeln!(
        stderr(),
        "training again on a split by {by}, to measure how optimistic random test samples are; Ctrl-C skips this"
    );
}

/// Returns `true` if the test samples are random ones of a recording.
fn flatters(plan: &Plan) -> bool {
    plan.division.by == SplitBy::Random && plan.test.is_none()
}

/// Says of each target how optimistic random test samples are.
fn sentences(comparison: &SplitComparison, targets: &[Channel]) -> Vec<String> {
    let targets = targets.iter().enumerate();
    targets
        .map(|(index, target)| comparison.sentence(index, &target.name))
        .collect()
}
