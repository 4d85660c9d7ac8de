use serde::{Deserialize, Serialize};
use strum::VariantArray;

use super::Trial;
use crate::{
    dataset::{DatasetError, Division, Seed, SplitBy},
    evaluation::{
        CrossValidation, PublishedErrors, RunError, RunSettings,
        options::{HIDDEN, NOISE, SAMPLES, STARTS},
    },
    sensor::ArrayScale,
    settings::{EPOCHS, Field, Kind, Setting, SettingError, Value},
    training::{Method, StoppingRules, TrainingError},
};

/// A setting that an experiment varies, with its values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// Setting that it varies.
    pub kind: AxisKind,
    /// Values of the setting.
    pub values: Vec<Value>,
}

/// Setting that an axis varies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, strum::VariantArray)]
#[serde(rename_all = "snake_case")]
pub enum AxisKind {
    /// Number of hidden nodes.
    Hidden,
    /// Array scale.
    Array,
    /// Number of training samples; in a cross-validation, of all samples.
    Samples,
    /// Relative noise of the resistances.
    Noise,
    /// Quantity computed from the resistances.
    Inputs,
    /// Scaling of the inputs.
    Scaling,
    /// Training method.
    Method,
    /// Maximum number of epochs.
    Epochs,
    /// Number of starts.
    Starts,
    /// Rule by which a recording is divided.
    Split,
    /// Seed.
    Seed,
}

/// Settings of a cell that an axis can vary, in the order of [`AxisKind`], which is the one offered to the user.
static ROWS: [Setting<Cell>; 11] = [
    row("hidden nodes", HIDDEN, |cell| {
        Some(Field::Count(&mut cell.settings.hidden))
    }),
    row("array", Kind::Text, |cell| {
        let scale = &mut cell.settings.simulation_mut()?.sensor.scale;
        Some(Field::text(scale.to_string(), scale, str::parse))
    }),
    row("samples", SAMPLES, |cell| {
        let source = cell.settings.simulation_mut()?;
        Some(Field::Count(&mut source.samples))
    }),
    row("noise", NOISE, |cell| {
        let source = cell.settings.simulation_mut()?;
        Some(Field::Number(&mut source.scene.noise.relative))
    }),
    row("inputs", Kind::Choice, |cell| {
        cell.settings.simulation()?;
        Some(Field::named(&mut cell.settings.inputs.quantity))
    }),
    row("scaling", Kind::Choice, |cell| {
        Some(Field::named(&mut cell.settings.inputs.scaling))
    }),
    row("method", Kind::Choice, |cell| {
        let method = &mut cell.settings.training.method;
        Some(Field::text(method.short_name().to_owned(), method, Method::named))
    }),
    row(EPOCHS.name, EPOCHS.kind, |cell| {
        (EPOCHS.field)(&mut cell.settings.training.stopping)
    }),
    row("starts", STARTS, |cell| Some(Field::Count(&mut cell.settings.starts))),
    row("split", Kind::Choice, |cell| {
        Some(Field::named(&mut cell.division.as_mut()?.by))
    }),
    row("seed", Kind::Integer(0, u64::MAX), |cell| {
        Some(Field::Integer(&mut cell.settings.seed.0))
    }),
];

const fn row(name: &'static str, kind: Kind, field: fn(&mut Cell) -> Option<Field<'_>>) -> Setting<Cell> {
    Setting::new(name, kind, "", field)
}

impl AxisKind {
    /// Returns the row of the table of settings.
    pub fn setting(self) -> &'static Setting<Cell> {
        &ROWS[self as usize]
    }

    /// Name of the setting.
    pub fn name(self) -> &'static str {
        self.setting().name
    }

    /// Returns the settings of runs with the source of `settings`, in the order offered to the user.
    pub fn of_runs(settings: &RunSettings) -> impl Iterator<Item = Self> + use<> {
        let cell = Cell {
            settings: *settings,
            division: settings.simulation().is_none().then(Division::default),
            ..Cell::default()
        };
        let kinds = Self::VARIANTS.iter().copied();
        kinds.filter(move |kind| kind.setting().applies(&cell))
    }
}

impl Axis {
    /// Creates an axis of integers.
    pub fn integers(kind: AxisKind, values: impl IntoIterator<Item = u64>) -> Self {
        let values = values.into_iter().map(Value::Integer).collect();
        Self { kind, values }
    }

    /// Creates an axis of names.
    pub fn names(kind: AxisKind, values: impl IntoIterator<Item: ToString>) -> Self {
        let values = values.into_iter().map(|value| Value::Text(value.to_string())).collect();
        Self { kind, values }
    }

    /// Creates an axis from text.
    ///
    /// # Errors
    /// The first text that is not a value of the setting.
    pub fn parse<'a>(kind: AxisKind, texts: impl IntoIterator<Item = &'a str>) -> Result<Self, SettingError> {
        let setting = kind.setting();
        let mut cell = Cell {
            division: Some(Division::default()),
            ..Cell::default()
        };
        let value = |text: &str| {
            let value = setting.parse(text)?;
            setting.set(&mut cell, &value)?;
            // As the program writes it.
            Ok(setting.get(&cell).unwrap_or(value))
        };
        let values = texts.into_iter().map(value).collect::<Result<_, SettingError>>()?;
        Ok(Self { kind, values })
    }

    /// Returns value `index` as text.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn label(&self, index: usize) -> String {
        self.values[index].to_string()
    }

    /// Writes value `index` to `cell`. A method has its usual settings for the source, and a validation share that
    /// follows from the method is updated for a new one.
    ///
    /// # Errors
    /// If the value is none of the setting.
    ///
    /// # Panics
    /// If `index` is out of range.
    fn apply(&self, index: usize, cell: &mut Cell) -> Result<(), SettingError> {
        let usual = Some(cell.settings.validation_fraction());
        self.kind.setting().set(cell, &self.values[index])?;
        if let Some(division) = cell.division.as_mut().filter(|_| self.kind == AxisKind::Method) {
            let method = &mut cell.settings.training.method;
            if *method == Method::bayesian_regularization() {
                *method = Method::recorded_regularization();
            }
            if division.validation_fraction == usual {
                division.validation_fraction = Some(cell.settings.validation_fraction());
            }
        }
        Ok(())
    }
}

/// Grid of cells over one or two axes, each cell run with several seeds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Settings shared by all cells; their seed is the first of [`Self::seeds`].
    pub base: RunSettings,
    /// Recording to divide; `None` for a simulated array.
    pub recording: Option<ExperimentRecording>,
    /// First varied setting.
    pub axis: Axis,
    /// Second varied setting, if there is one.
    pub second_axis: Option<Axis>,
    /// Number of consecutive seeds for each cell; 1 if the seed is an axis.
    pub seeds: usize,
    /// Cross-validation for testing, instead of a separate test set.
    pub cross_validation: Option<CrossValidation>,
}

/// Recording of an experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentRecording {
    /// Name in titles.
    pub name: String,
    /// `true` if a column assigns its samples to groups.
    pub has_groups: bool,
    /// `true` if the test samples are in separate files.
    pub has_test_files: bool,
    /// Division of its samples, if no axis varies it.
    pub division: Division,
}

/// Cell of the grid, with its results so far.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cell {
    /// Index of its value on the first axis.
    pub column: usize,
    /// Index of its value on the second axis; 0 if there is none.
    pub row: usize,
    /// Settings of the cell, with the first seed.
    pub settings: RunSettings,
    /// Division of the recording, if the samples are recorded.
    pub division: Option<Division>,
    /// Errors that the paper reports for the cell, if there are any.
    pub published: Option<PublishedErrors>,
    /// Number of trials planned.
    pub expected: usize,
    /// Finished trials, sorted by seed and repeat regardless of the order in which they finished.
    pub trials: Vec<Trial>,
    /// Failures of trials ([`RunError::Trial`]), sorted likewise.
    pub failures: Vec<RunError>,
}

/// Maximum number of trainings in one experiment.
const MAX_TRAININGS: usize = 1_000_000;

/// Maximum number of seeds or repeats.
const MAX_TRIALS: usize = 1000;

impl Experiment {
    /// Returns the cells, row by row; at least one if [`Self::check`] succeeds.
    pub fn cells(&self) -> Vec<Cell> {
        let rows = self.second_axis.as_ref().map_or(1, |axis| axis.values.len());
        let columns = self.axis.values.len();
        (0..rows * columns)
            .map(|place| self.cell(place / columns, place % columns))
            .collect()
    }

    fn cell(&self, row: usize, column: usize) -> Cell {
        let mut cell = Cell {
            column,
            row,
            settings: self.base,
            division: self.recording.as_ref().map(|recording| recording.division),
            ..Cell::default()
        };
        for (axis, index) in self.axes().zip([column, row]) {
            // A value that the setting does not have is refused by `check`.
            let _ = axis.apply(index, &mut cell);
        }
        cell.published = cell.settings.published_by(self.cross_validation.is_some());
        cell.expected = self.trials_of(&cell.settings).count();
        cell
    }

    /// Returns the axes, one or two.
    pub fn axes(&self) -> impl Iterator<Item = &Axis> {
        std::iter::once(&self.axis).chain(&self.second_axis)
    }

    /// Returns the seeds of the cell with these settings.
    pub fn seeds_of(&self, settings: &RunSettings) -> impl Iterator<Item = Seed> + use<> {
        let is_axis = self.axes().any(|axis| axis.kind == AxisKind::Seed);
        let (first, seeds) = (settings.seed.0, if is_axis { 1 } else { self.seeds });
        (0..seeds as u64).map(move |offset| Seed(first.wrapping_add(offset)))
    }

    /// Returns the seed and the repeat of each trial of the cell with these settings.
    pub(super) fn trials_of(&self, settings: &RunSettings) -> impl Iterator<Item = (Seed, usize)> + use<> {
        let repeats = self.repeats_and_folds().0;
        let of_seed = move |seed| (0..repeats).map(move |repeat| (seed, repeat));
        self.seeds_of(settings).flat_map(of_seed)
    }

    /// Number of trials per seed, and of networks trained per trial, each with the number of starts in the settings.
    pub(super) fn repeats_and_folds(&self) -> (usize, usize) {
        self.cross_validation
            .map_or((1, 1), |validation| (validation.repeats, validation.folds))
    }

    /// Checks everything that can be checked before samples are drawn.
    ///
    /// # Errors
    /// The first problem found.
    pub fn check(&self) -> Result<(), RunError> {
        if let Some(empty) = self.axes().find(|axis| axis.values.is_empty()) {
            return Err(RunError::NoValues(empty.kind.name()));
        }
        if self.second_axis.as_ref().map(|second| second.kind) == Some(self.axis.kind) {
            return Err(RunError::SameAxes(self.axis.kind.name()));
        }
        let (repeats, folds) = self.repeats_and_folds();
        RunError::check_count("seeds", self.seeds, 1..=MAX_TRIALS)?;
        RunError::check_count("repeats", repeats, 1..=MAX_TRIALS)?;
        let factors = [self.seeds, repeats, folds, self.base.starts];
        let factors = self.axes().map(|axis| axis.values.len()).chain(factors);
        let trainings = factors.fold(1, usize::saturating_mul);
        if trainings > MAX_TRAININGS {
            let max = MAX_TRAININGS;
            return Err(RunError::TooManyTrainings { trainings, max });
        }
        self.check_source()?;
        self.cells().iter().try_for_each(|cell| self.check_cell(cell))
    }

    /// Checks that source and axes match.
    fn check_source(&self) -> Result<(), RunError> {
        let of = match (self.base.simulation(), &self.recording) {
            (Some(_), None) => "simulated arrays",
            (None, Some(_)) => "recordings",
            _ => return Err(RunError::OtherSamples),
        };
        if self.recording.is_some() && self.cross_validation.is_some() {
            return Err(RunError::CrossValidation);
        }
        for axis in self.axes() {
            if !AxisKind::of_runs(&self.base).any(|kind| kind == axis.kind) {
                return Err(RunError::NoSetting {
                    axis: axis.kind.name(),
                    of,
                });
            }
            let mut cell = self.cell(0, 0);
            for index in 0..axis.values.len() {
                axis.apply(index, &mut cell).map_err(TrainingError::from)?;
            }
        }
        Ok(())
    }

    fn check_cell(&self, cell: &Cell) -> Result<(), RunError> {
        cell.settings.training.check().map_err(TrainingError::from)?;
        cell.settings.check_counts()?;
        if let (Some(recording), Some(division)) = (&self.recording, cell.division) {
            division.check()?;
            if division.by == SplitBy::Group && !recording.has_groups {
                return Err(RunError::NoGroups);
            }
        }
        let Some(simulation) = cell.settings.simulation() else {
            return Ok(());
        };
        simulation.scene.check()?;
        if let Some(CrossValidation { folds, by, .. }) = self.cross_validation {
            let rows = simulation.rows()?;
            let snapshots = simulation.samples.div_ceil(rows);
            let (units, unit) = match by {
                SplitBy::Random => (snapshots * rows, "sample"),
                SplitBy::Time | SplitBy::Group => (snapshots, "snapshot"),
            };
            DatasetError::check_folds(folds, units, unit)?;
        }
        Ok(())
    }
}

/// Table of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PaperTable {
    /// Table 1: different numbers of hidden nodes.
    HiddenNodes,
    /// Table 2 and Fig. 5: 10-fold cross-validation of a large and a small dataset.
    CrossValidation,
    /// Table 3: different array scales.
    ArrayScales,
}

impl PaperTable {
    /// All tables, in the paper's order.
    pub const ALL: [Self; 3] = [Self::HiddenNodes, Self::CrossValidation, Self::ArrayScales];

    /// Number of the table in the paper.
    pub fn number(self) -> u8 {
        self as u8 + 1
    }

    /// Returns the title of the table.
    pub fn title(self) -> &'static str {
        match self {
            Self::HiddenNodes => "Errors with different numbers of hidden nodes",
            Self::CrossValidation => "Errors by cross-validation of a large and a small dataset",
            Self::ArrayScales => "Errors with different array scales",
        }
    }

    /// Returns the number and title of the table.
    pub fn heading(self) -> String {
        format!("Table {}: {}", self.number(), self.title())
    }

    /// Returns the experiment that reproduces the table. The paper does not report the number of epochs: epochs and
    /// starts are chosen to reproduce all tables in about a minute on two cores. All epochs are run; the validation set
    /// only selects the weights.
    pub fn experiment(self) -> Experiment {
        let (axis, epochs, starts, cross_validation) = match self {
            Self::HiddenNodes => (Axis::integers(AxisKind::Hidden, [6, 8, 10, 12, 14, 16]), 300, 3, None),
            Self::CrossValidation => {
                let sizes = Axis::integers(AxisKind::Samples, [1000, 100]);
                (sizes, 80, 1, Some(CrossValidation::default()))
            }
            Self::ArrayScales => (Axis::names(AxisKind::Array, ArrayScale::PRESETS), 300, 3, None),
        };
        let mut base = RunSettings::default();
        base.training.stopping.epochs = epochs;
        base.training.stopping.max_fail = StoppingRules::MAX_EPOCHS;
        base.starts = starts;
        Experiment {
            base,
            recording: None,
            axis,
            second_axis: None,
            seeds: 5,
            cross_validation,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_tables_cover_all_published_figures() {
        let mut published = 0;
        for table in PaperTable::ALL {
            let experiment = table.experiment();
            experiment.check().unwrap();
            for cell in experiment.cells() {
                published += usize::from(cell.published.is_some());
                assert_eq!(
                    cell.published.unwrap().table == 2,
                    table == PaperTable::CrossValidation,
                    "{cell:?}"
                );
            }
        }
        assert_eq!(published, 11);
    }

    #[test]
    fn every_axis_has_the_row_of_its_setting() {
        assert_eq!(AxisKind::VARIANTS.len(), ROWS.len());
        for kind in AxisKind::VARIANTS {
            let in_file = serde_json::to_value(kind).unwrap();
            assert!(kind.name().starts_with(in_file.as_str().unwrap()), "{kind:?}");
        }
    }

    #[test]
    fn cells_are_the_product_of_the_axes() {
        let experiment = Experiment {
            second_axis: Some(Axis::names(AxisKind::Method, ["lm", "br"])),
            ..PaperTable::ArrayScales.experiment()
        };
        let cells = experiment.cells();
        assert_eq!(cells.len(), 6);
        for (index, cell) in cells.iter().enumerate() {
            assert_eq!((cell.row, cell.column), (index / 3, index % 3));
            let simulation = cell.settings.simulation().unwrap();
            assert_eq!(simulation.sensor.scale, ArrayScale::PRESETS[cell.column]);
            assert_eq!(cell.settings.training.method, Method::all()[cell.row]);
        }
    }

    #[test]
    fn invalid_experiments_are_rejected_before_anything_is_run() {
        let table = |change: fn(&mut Experiment)| {
            let mut experiment = PaperTable::CrossValidation.experiment();
            change(&mut experiment);
            experiment.check().unwrap_err().to_string()
        };
        let cases = [
            (
                table(|e| e.axis = Axis::integers(AxisKind::Hidden, [])),
                "no values for hidden nodes",
            ),
            (
                table(|e| e.axis = Axis::integers(AxisKind::Hidden, [6, 0])),
                "hidden nodes: 0",
            ),
            (
                table(|e| e.second_axis = Some(Axis::integers(AxisKind::Samples, [10]))),
                "both axes vary samples",
            ),
            (table(|e| e.seeds = 0), "seeds: 0"),
            (table(|e| e.base.starts = 0), "starts: 0"),
            (table(|e| e.base.training.stopping.epochs = 0), "epochs"),
            (
                table(|e| {
                    e.cross_validation = Some(CrossValidation {
                        folds: 11,
                        by: SplitBy::Group,
                        repeats: 1,
                    });
                }),
                "11 folds of 10 snapshots",
            ),
            (
                table(|e| {
                    e.axis = Axis::integers(AxisKind::Hidden, 1..=500);
                    e.seeds = 1000;
                }),
                "50000000 trainings",
            ),
        ];
        for (message, expected) in cases {
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn a_seed_axis_replaces_the_seeds() {
        let experiment = Experiment {
            axis: Axis::integers(AxisKind::Seed, [4, 9]),
            ..PaperTable::HiddenNodes.experiment()
        };
        for (cell, seed) in experiment.cells().iter().zip([4, 9]) {
            assert_eq!(experiment.seeds_of(&cell.settings).collect::<Vec<_>>(), [Seed(seed)]);
        }
    }
}
