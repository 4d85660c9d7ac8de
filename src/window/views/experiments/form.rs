use thiserror::Error;

use super::{AxisForm, ListError, Topic};
use decoupler_core::{
    evaluation::experiments::{Axis, AxisKind, Experiment, ExperimentError, PaperTable},
    training::Method,
};
use decoupler_files::import::{Plan, Setup};

/// An experiment as the user sets it up.
#[derive(Clone, Debug, PartialEq)]
pub struct Form {
    /// Everything but the axes, which are typed.
    pub template: Experiment,
    /// Plan by which a recording is read; `None` for a simulated array.
    pub plan: Option<Plan>,
    /// One axis, or two of a sweep.
    pub axes: Vec<AxisForm>,
}

/// Reasons for which a form is not yet an experiment.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FormError {
    /// A value that cannot be understood.
    #[error(transparent)]
    List(#[from] ListError),
    /// Values that cannot be run.
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
    /// More than can be looked at.
    #[error("{0} cells are more than can be looked at: give fewer values, at most {MAX_CELLS} cells")]
    TooManyCells(usize),
}

/// The most cells of one experiment in the window.
const MAX_CELLS: usize = 400;

impl Form {
    /// Returns the default form of `topic`: the paper's own values, or a small sweep.
    pub fn new(topic: Topic) -> Self {
        match topic {
            Topic::Table(table) => {
                let template = table.experiment();
                Self {
                    axes: vec![AxisForm::of(&template.axis)],
                    template,
                    plan: None,
                }
            }
            Topic::Sweep => {
                let mut template = PaperTable::HiddenNodes.experiment();
                template.base.training.stopping.epochs = 60;
                template.base.starts = 1;
                template.seeds = 1;
                Self {
                    template,
                    plan: None,
                    axes: [AxisKind::Hidden, AxisKind::Samples].map(AxisForm::new).into(),
                }
            }
        }
    }

    /// Setup of the base.
    pub fn setup(&self) -> Option<Setup> {
        Setup::of(self.template.base, self.plan.clone())
    }

    /// Takes `setup` as the base. An axis that its source does not have gives way to another.
    pub fn take(&mut self, setup: &Setup) {
        self.template.base = *setup.settings();
        self.template.recording = setup.experiment_recording();
        self.plan = setup.plan().cloned();
        let offered: Vec<AxisKind> = self.offered().collect();
        for place in 0..self.axes.len() {
            let is_free = |kind: &&AxisKind| self.axes.iter().all(|axis| axis.kind != **kind);
            if !offered.contains(&self.axes[place].kind)
                && let Some(&kind) = offered.iter().find(is_free)
            {
                self.axes[place] = AxisForm::new(kind);
            }
        }
    }

    /// Settings that an axis can vary.
    pub fn offered(&self) -> impl Iterator<Item = AxisKind> + use<> {
        AxisKind::of_source(&self.template.base.source)
    }

    /// Gives methods on a recording the settings that suit recordings.
    fn suited(&self, axis: Axis) -> Axis {
        let Axis::Method(mut methods) = axis else { return axis };
        if self.plan.is_some() {
            let recorded = Method::recorded_regularization();
            let is_same = |method: &&mut Method| method.short_name() == recorded.short_name();
            methods.iter_mut().filter(is_same).for_each(|method| *method = recorded);
        }
        Axis::Method(methods)
    }

    /// The experiment, sound as far as can be known before it is run.
    ///
    /// # Errors
    /// If it is not a possible experiment.
    pub fn experiment(&self) -> Result<Experiment, FormError> {
        let mut axes = Vec::new();
        for axis in &self.axes {
            axes.push(self.suited(axis.parse()?));
        }
        let cells = axes
            .iter()
            .fold(1, |cells: usize, axis| cells.saturating_mul(axis.len()));
        if cells > MAX_CELLS {
            return Err(FormError::TooManyCells(cells));
        }
        let mut axes = axes.into_iter();
        let mut experiment = self.template.clone();
        if let Some(first) = axes.next() {
            experiment.axis = first;
        }
        experiment.second_axis = axes.next();
        experiment.check()?;
        Ok(experiment)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoupler_core::{
        evaluation::{Measured, RunSettings, SimulatedSettings},
        scene::RowModel,
    };

    #[test]
    fn every_topic_begins_with_what_can_be_run() {
        for topic in Topic::ALL {
            let experiment = Form::new(topic).experiment().unwrap();
            match topic {
                Topic::Table(table) => assert_eq!(experiment, table.experiment()),
                Topic::Sweep => assert_eq!(experiment.cells().len(), 12),
            }
        }
    }

    #[test]
    fn a_recording_changes_the_axes_that_it_does_not_have() {
        let plan = Plan::default();
        let settings = RunSettings::from(Measured { rows: RowModel::Shared });
        let setup = Setup::recording(settings, plan);
        let mut form = Form::new(Topic::Sweep);
        form.take(&setup);
        assert_eq!(form.setup(), Some(setup));
        let kinds: Vec<_> = form.axes.iter().map(|axis| axis.kind).collect();
        assert_eq!(kinds, [AxisKind::Hidden, AxisKind::Scaling], "samples are of arrays");
        let experiment = form.experiment().unwrap();
        assert_eq!(experiment.base, settings);
        // Bayesian regularisation has the settings that suit recordings, as in the Train view.
        form.axes[1] = AxisForm {
            kind: AxisKind::Method,
            values: "lm br".to_owned(),
        };
        let Some(Axis::Method(methods)) = form.experiment().unwrap().second_axis else {
            panic!("the second axis is of methods");
        };
        assert_eq!(methods[1], Method::recorded_regularization());
        form.axes[1] = AxisForm::new(AxisKind::Split);
        assert_eq!(form.experiment().unwrap().cells().len(), 8);
        form.axes[1].values = "group".to_owned();
        assert!(
            form.experiment()
                .unwrap_err()
                .to_string()
                .contains("no column of groups")
        );
        form.take(&SimulatedSettings::default().into());
        assert_eq!(form.axes[1].kind, AxisKind::Array);
        assert_eq!(form.template.recording, None);
    }

    #[test]
    fn what_cannot_be_run_says_why() {
        let with = |values: &str| {
            let mut form = Form::new(Topic::Sweep);
            form.axes[0].values = values.to_owned();
            form.experiment().unwrap_err().to_string()
        };
        assert!(with("").contains("no values for hidden nodes"));
        assert!(with("0").contains("hidden nodes: 0 is not possible"));
        let many: Vec<String> = (1..=200).map(|hidden| hidden.to_string()).collect();
        assert!(with(&many.join(" ")).contains("600 cells"));
        let mut form = Form::new(Topic::Sweep);
        form.axes[1] = AxisForm::new(AxisKind::Hidden);
        assert!(
            form.experiment()
                .unwrap_err()
                .to_string()
                .contains("both axes vary hidden nodes")
        );
    }
}
