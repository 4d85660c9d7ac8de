use decoupler_core::{
    evaluation::{
        RunError,
        experiments::{Axis, AxisKind, Experiment, PaperTable},
    },
    settings::{Kind, SettingError},
};
use decoupler_files::import::{Plan, Setup};
use thiserror::Error;

use super::Topic;

/// Form of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Form {
    /// The experiment without its axes, which are typed.
    pub template: Experiment,
    /// Plan by which a recording is read; `None` for a simulated array.
    pub plan: Option<Plan>,
    /// One axis, or two of a sweep.
    pub axes: Vec<AxisForm>,
}

/// Error in a form.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FormError {
    /// A value that cannot be parsed.
    #[error(transparent)]
    List(#[from] ListError),
    /// Values that do not make a valid experiment.
    #[error(transparent)]
    Experiment(#[from] RunError),
    /// Too many cells to display.
    #[error("{0} cells are too many to display: give fewer values, at most {MAX_CELLS} cells")]
    TooManyCells(usize),
}

/// Maximum number of cells of an experiment in the window.
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

    /// Returns the setup of the base.
    pub fn setup(&self) -> Option<Setup> {
        Setup::of(self.template.base, self.plan.clone())
    }

    /// Uses `setup` as the base. An axis that its source does not have is replaced by another.
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

    /// Returns the settings that an axis can vary.
    pub fn offered(&self) -> impl Iterator<Item = AxisKind> + use<> {
        AxisKind::of_runs(&self.template.base)
    }

    /// Returns the experiment, validated as far as possible without running it.
    ///
    /// # Errors
    /// If the form is not a valid experiment.
    pub fn experiment(&self) -> Result<Experiment, FormError> {
        let mut axes = Vec::new();
        for axis in &self.axes {
            axes.push(axis.parse()?);
        }
        let cells = axes
            .iter()
            .fold(1, |cells: usize, axis| cells.saturating_mul(axis.values.len()));
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

/// An axis as typed by the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AxisForm {
    /// Setting that is varied.
    pub kind: AxisKind,
    /// Its values, separated by commas or blanks.
    pub values: String,
}

/// Error in a typed list of values.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ListError {
    /// Not a number.
    #[error("{name}: {message}; write a list such as {example}")]
    Number {
        /// The axis.
        name: &'static str,
        /// Error message.
        message: String,
        /// Example of a valid list.
        example: &'static str,
    },
    /// Not a valid value of the axis.
    #[error("{name}: {message}")]
    Word {
        /// The axis.
        name: &'static str,
        /// Error message, with the valid values.
        message: String,
    },
    /// A value out of range.
    #[error(transparent)]
    Value(#[from] SettingError),
}

/// Returns the label of a setting.
pub fn axis_label(kind: AxisKind) -> &'static str {
    match kind {
        AxisKind::Hidden => "Hidden nodes",
        AxisKind::Array => "Array scales",
        AxisKind::Samples => "Samples",
        AxisKind::Noise => "Noise",
        AxisKind::Inputs => "Inputs",
        AxisKind::Scaling => "Scaling",
        AxisKind::Method => "Methods",
        AxisKind::Epochs => "Epochs",
        AxisKind::Starts => "Starts",
        AxisKind::Split => "Split",
        AxisKind::Seed => "Seeds",
    }
}

/// Returns the initial values of a setting, as typed.
pub fn axis_example(kind: AxisKind) -> &'static str {
    match kind {
        AxisKind::Hidden => "6, 8, 10, 12",
        AxisKind::Array => "10×6_3×18, 10×8_4×24, 10×10_5×30",
        AxisKind::Samples => "100, 300, 1000",
        AxisKind::Noise => "0, 0.001, 0.01",
        AxisKind::Inputs => "resistance, conductance, log",
        AxisKind::Scaling => "minmax, whiten",
        AxisKind::Method => "lm, scg, rp",
        AxisKind::Epochs => "30, 100, 300",
        AxisKind::Starts => "1, 3, 10",
        AxisKind::Split => "time, random",
        AxisKind::Seed => "0, 1, 2",
    }
}

impl AxisForm {
    /// Creates an axis with its initial values.
    pub fn new(kind: AxisKind) -> Self {
        Self {
            kind,
            values: axis_example(kind).to_owned(),
        }
    }

    /// Creates the typed form of `axis`.
    pub fn of(axis: &Axis) -> Self {
        let values: Vec<String> = (0..axis.values.len()).map(|index| axis.label(index)).collect();
        Self {
            kind: axis.kind,
            values: values.join(", "),
        }
    }

    /// Parses the axis.
    ///
    /// # Errors
    /// The first value that cannot be parsed.
    pub fn parse(&self) -> Result<Axis, ListError> {
        let is_between = |letter: char| letter == ',' || letter == ';' || letter.is_whitespace();
        let words = self.values.split(is_between).filter(|word| !word.is_empty());
        Axis::parse(self.kind, words).map_err(|error| {
            let SettingError::Text(_, message) = error else {
                return ListError::Value(error);
            };
            let (name, example) = (axis_label(self.kind), axis_example(self.kind));
            match self.kind.setting().kind {
                Kind::Choice | Kind::Text => ListError::Word { name, message },
                Kind::Number(..) | Kind::Integer(..) => ListError::Number { name, message, example },
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use decoupler_core::{evaluation::RunSettings, scene::RowModel, training::Method};

    use super::*;

    #[test]
    fn the_default_form_of_every_topic_can_be_run() {
        for topic in Topic::ALL {
            let experiment = Form::new(topic).experiment().unwrap();
            match topic {
                Topic::Table(table) => assert_eq!(experiment, table.experiment()),
                Topic::Sweep => assert_eq!(experiment.cells().len(), 12),
            }
        }
    }

    #[test]
    fn axes_that_a_recording_lacks_are_replaced() {
        let plan = Plan::default();
        let settings = RunSettings::measured(RowModel::Shared);
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
        let cells = form.experiment().unwrap().cells();
        let last = cells.last().unwrap().settings.training.method;
        assert_eq!(last, Method::recorded_regularization());
        form.axes[1] = AxisForm::new(AxisKind::Split);
        assert_eq!(form.experiment().unwrap().cells().len(), 8);
        form.axes[1].values = "group".to_owned();
        assert!(
            form.experiment()
                .unwrap_err()
                .to_string()
                .contains("no column of groups")
        );
        form.take(&RunSettings::default().into());
        assert_eq!(form.axes[1].kind, AxisKind::Array);
        assert_eq!(form.template.recording, None);
    }

    #[test]
    fn invalid_forms_give_a_reason() {
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

    #[test]
    fn initial_values_are_parsed_and_printed_unchanged() {
        for kind in AxisKind::of_runs(&RunSettings::default()).chain([AxisKind::Split]) {
            let form = AxisForm::new(kind);
            let axis = form.parse().unwrap();
            assert!(axis.values.len() >= 2, "{kind:?}");
            assert_eq!(AxisForm::of(&axis), form);
        }
    }

    #[test]
    fn separators_do_not_matter_and_errors_name_the_value() {
        let parse = |kind, values: &str| {
            AxisForm {
                kind,
                values: values.to_owned(),
            }
            .parse()
        };
        assert_eq!(
            parse(AxisKind::Hidden, " 6;8\n10,,12 "),
            Ok(Axis::integers(AxisKind::Hidden, [6, 8, 10, 12]))
        );
        let cases = [
            (
                AxisKind::Hidden,
                "6, eight",
                "Hidden nodes: 'eight' is not a whole number",
            ),
            (AxisKind::Samples, "-5", "Samples: '-5'"),
            (AxisKind::Array, "10x6", "'10x6' is not an array scale"),
            (AxisKind::Noise, "0.1 a", "Noise: 'a' is not a number"),
            (
                AxisKind::Split,
                "time daily",
                "Split: 'daily' is not a split: give time",
            ),
            (
                AxisKind::Method,
                "lm magic",
                "'magic' is not a training method: give lm",
            ),
        ];
        for (kind, values, expected) in cases {
            let message = parse(kind, values).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
