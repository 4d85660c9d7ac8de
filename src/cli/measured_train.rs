use std::path::Path;

use super::{
    checkpointing::Saving,
    failure::Failure,
    import_arguments::{with_bar, working_folder},
    measured_report::{self, Folds, Report},
    train::Train,
};
use crate::{
    dataset::{self, Stream},
    evaluation::{CrossValidated, Run, RunSettings},
    export::{MeasuredCheckpointFile, MeasuredNetworkFile},
    import::{Plan, PlannedSets},
    training::Method,
};

impl Train {
    /// Trains on the samples of files.
    pub(super) fn run_measured(&self) -> Result<(), Failure> {
        let mut plan = self.import.plan(self.training.scene.columns())?;
        let settings = self.training.measured(plan.import.row_wire.is_some())?;
        if let (Method::BayesianRegularization(_), false) = (settings.training.method, self.import.holds_out()) {
            plan.division.validation_fraction = 0.0;
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
        drop(recording.set);
        let run = Run::on_sets(settings, split, test)?;
        self.finish_measured(run, plan, (&channels.0, &channels.1), saving, report)
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
        let mut run = file.resume(sets).map_err(|source| Failure::Resume {
            path: path.to_owned(),
            source,
        })?;
        self.continue_run(&mut run, saved.training, training)?;
        self.finish_measured(run, plan, (&channels.0, &channels.1), saving, report)
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
        channels: (&[crate::import::Channel], &[crate::import::Channel]),
        saving: Saving,
        report: Report,
    ) -> Result<(), Failure> {
        let checkpointing = self.checkpoint.checkpointing(saving);
        let end = self.train(&mut run, checkpointing);
        let file = MeasuredNetworkFile::from_run(&run, plan, channels)?;
        let saved = self.out.as_ref().map_or(Ok(()), |path| file.save(path));
        measured_report::print(&report, &file, run.flaw().as_ref(), run.wall_time(), self.json)?;
        self.end(saved, end)
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
        let mut rng = settings.seed.rng(Stream::Split);
        let dealt = dataset::Folds::by(&recording.set, folds, plan.division.by, &mut rng);
        let dealt = dealt.map_err(|error| Failure::Arguments(error.to_string()))?;
        let validated = CrossValidated::on_folds(settings, &recording.set, dealt, || false)?;
        let table = validated
            .map(|validated| validated.target_table(&recording.set))
            .unwrap_or_default();
        let report = Folds::new(plan, &recording, settings, folds, &table);
        measured_report::print_folds(&report, &recording.targets, &table, self.json)
    }
}
