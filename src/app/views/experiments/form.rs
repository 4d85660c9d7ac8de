use thiserror::Error;

use super::{AxisForm, AxisKind, ListError, Topic};
use crate::evaluation::experiments::{Experiment, ExperimentError, PaperTable};

/// An experiment as the user sets it up.
#[derive(Clone, Debug, PartialEq)]
pub struct Form {
    /// Everything but the axes, which are typed.
    pub template: Experiment,
    /// One axis, or two of a sweep.
    pub axes: Vec<AxisForm>,
}

/// Why a form is no experiment yet.
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
    #[error("{0} cells are more than can be looked at: give fewer values, at most {MOST_CELLS} cells")]
    TooManyCells(usize),
}

/// The most cells of one experiment in the window.
const MOST_CELLS: usize = 400;

impl Form {
    /// What `topic` begins with: the paper's own values, or a small sweep.
    pub fn new(topic: Topic) -> Self {
        match topic {
            Topic::Table(table) => {
                let template = table.experiment();
                Self {
                    axes: vec![AxisForm::of(&template.axis)],
                    template,
                }
            }
            Topic::Sweep => {
                let mut template = PaperTable::HiddenNodes.experiment();
                template.base.training.stopping.epochs = 60;
                template.base.starts = 1;
                template.seeds = 1;
                Self {
                    template,
                    axes: vec![AxisForm::new(AxisKind::Hidden), AxisForm::new(AxisKind::Samples)],
                }
            }
        }
    }

    /// The experiment, sound as far as can be known before it is run.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn experiment(&self) -> Result<Experiment, FormError> {
        let mut axes = Vec::new();
        for axis in &self.axes {
            axes.push(axis.parse()?);
        }
        let cells = axes
            .iter()
            .fold(1, |cells: usize, axis| cells.saturating_mul(axis.len()));
        if cells > MOST_CELLS {
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
