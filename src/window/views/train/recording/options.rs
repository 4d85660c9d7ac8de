//! The folded parts of the form of a recording. Each option of the import is a row of a table, with its name, its hint, and how
//! its text is read from the plan and written into it; one form shows them all.

use std::{borrow::Cow, fmt::Display, str::FromStr};

use decoupler_core::{
    dataset::{Division, Memory, SplitBy},
    evaluation::RunSettings,
    text::Named,
};
use decoupler_files::import::{Condition, Decimal, Encoding, Format, Plan, Separator};
use eframe::egui::{Id, TextEdit, Ui};

use super::{
    editor::{RecordingEditor, Use},
    files_section::FILES,
    import::{Import, file_name},
};
use crate::window::{
    glossary,
    shared::{Effect, FileWords, Shared},
    widgets::{
        dim_ui,
        fields::{input_text, list_ui, options_ui, percent_ui, seed_ui},
        fold_ui, ghost_button, note_ui,
    },
};

/// An option of the import: a field that shows and edits a part of the plan as text.
struct ImportOption {
    name: Cow<'static, str>,
    hint: &'static str,
    field: Field,
    /// Text of the option in the plan; the second argument is the number of a joined file.
    get: fn(&Plan, usize) -> String,
    /// Writes a text into the plan; returns the reason if it is wrong.
    set: fn(&mut Plan, usize, &str) -> Result<(), String>,
    /// True if the files must be read again.
    reads: bool,
    joined: usize,
}

/// Kinds of fields.
enum Field {
    /// A text, with an example that is shown while it is empty.
    Text(Cow<'static, str>),
    /// One of these texts.
    OneOf(fn() -> Vec<&'static str>),
    /// [`YES`] or [`NO`].
    Check,
}

const YES: &str = "yes";
const NO: &str = "no";
/// Text of an option that is detected at the beginning of each file.
const DETECTED: &str = "detected";

const FILTER: [ImportOption; 2] = [
    ImportOption {
        name: Cow::Borrowed("Only rows with"),
        hint: "Only rows that meet this condition are used, for example c4<145.1 and c5!=0. Columns have their names in \
               the table.",
        field: Field::Text(Cow::Borrowed("c4 < 145.1")),
        get: |plan, _| joined(&plan.import.conditions, " and "),
        set: |plan, _, text| {
            let condition = Some(text.trim()).filter(|text| !text.is_empty()).map(str::parse::<Condition>);
            plan.import.conditions = Vec::from_iter(condition.transpose().map_err(|error| error.to_string())?);
            Ok(())
        },
        reads: false,
        joined: 0,
    },
    ImportOption {
        name: Cow::Borrowed("Missing cells"),
        hint: "Numbers or texts that mark missing values, in all columns or in one, such as -1 or states.c5=-1, with \
               commas between them. Empty cells are missing anyway. Rows in which a cell that is used is missing are dropped.",
        field: Field::Text(Cow::Borrowed("-1, states.c5=-1")),
        get: |plan, _| joined(&plan.import.missing, ", "),
        set: |plan, _, text| {
            plan.import.missing = items(text)?;
            Ok(())
        },
        reads: true,
        joined: 0,
    },
];

const COMPUTED: [ImportOption; 1] = [ImportOption {
    name: Cow::Borrowed("Expressions"),
    hint: "With commas between them: d=c1-c2 is a difference, q=c1/c2 a ratio; r=c1/start(2s) and r=c1-start(100) compare \
           with the mean of the first 2 seconds or 100 rows. Columns have their names in the table.",
    field: Field::Text(Cow::Borrowed("d=c1-c2, r=c1/start(2s)")),
    get: |plan, _| joined(&plan.import.derive, ", "),
    set: |plan, _, text| {
        plan.import.derive = items(text)?;
        Ok(())
    },
    reads: true,
    joined: 0,
}];

const HISTORY: [ImportOption; 3] = [
    ImportOption {
        name: Cow::Borrowed("Averages"),
        hint: "Exponential averages of the readings with these time constants, as further inputs: 0.1s, 1s, 10s need a \
               column “time”; 20, 100 are numbers of samples.",
        field: Field::Text(Cow::Borrowed("0.1s, 1s, 10s")),
        get: |plan, _| plan.import.memory.as_ref().map_or_else(String::new, |memory| joined(&memory.averages, ", ")),
        set: |plan, _, text| {
            let averages = items(text)?;
            set_history(plan, |memory| memory.averages = averages);
            Ok(())
        },
        reads: false,
        joined: 0,
    },
    ImportOption {
        name: Cow::Borrowed("Lags"),
        hint: "Readings this number of samples, or seconds, before each sample, as further inputs.",
        field: Field::Text(Cow::Borrowed("5, 10, 20")),
        get: |plan, _| plan.import.memory.as_ref().map_or_else(String::new, |memory| joined(&memory.lags, ", ")),
        set: |plan, _, text| {
            let lags = items(text)?;
            set_history(plan, |memory| memory.lags = lags);
            Ok(())
        },
        reads: false,
        joined: 0,
    },
    ImportOption {
        name: Cow::Borrowed("Differences"),
        hint: "The past enters as its difference from the current reading; without averages and lags, from the sample before.",
        field: Field::Check,
        get: |plan, _| {
            let differences = plan.import.memory.as_ref().is_some_and(|memory| memory.differences);
            if differences { YES } else { NO }.to_owned()
        },
        set: |plan, _, text| {
            set_history(plan, |memory| memory.differences = text == YES);
            Ok(())
        },
        reads: false,
        joined: 0,
    },
];

const LIMIT: ImportOption = ImportOption {
    name: Cow::Borrowed("Limit"),
    hint: "Maximum time between joined rows, in the unit of the times. Without it, half the median interval of the joined \
           file.",
    field: Field::Text(Cow::Borrowed("")),
    get: |plan, joined| plan.import.join[joined].limit.map_or_else(String::new, input_text),
    set: |plan, joined, text| {
        let limit = Some(text.trim()).filter(|text| !text.is_empty());
        let parsed = limit.map(|text| text.parse().ok().filter(|limit: &f64| limit.is_finite() && *limit > 0.0).ok_or(text));
        let reason = |text| format!("'{text}' is not a number above 0, in the unit of the times");
        plan.import.join[joined].limit = parsed.transpose().map_err(reason)?;
        Ok(())
    },
    reads: false,
    joined: 0,
};

const FORMAT: [ImportOption; 5] = [
    ImportOption {
        name: Cow::Borrowed("Separator"),
        hint: "Separator of the cells; space stands for any number of spaces or tabs.",
        field: Field::OneOf(names::<Separator>),
        get: |plan, _| plan.import.dialect.separator.map_or(DETECTED, Named::name).to_owned(),
        set: |plan, _, text| {
            plan.import.dialect.separator = named(text)?;
            Ok(())
        },
        reads: true,
        joined: 0,
    },
    ImportOption {
        name: Cow::Borrowed("Decimal"),
        hint: "Decimal separator: 1.5 or 1,5.",
        field: Field::OneOf(names::<Decimal>),
        get: |plan, _| plan.import.dialect.decimal.map_or(DETECTED, Named::name).to_owned(),
        set: |plan, _, text| {
            plan.import.dialect.decimal = named(text)?;
            Ok(())
        },
        reads: true,
        joined: 0,
    },
    ImportOption {
        name: Cow::Borrowed("Header"),
        hint: "Whether the first row has the names of the columns. Without them, columns are called c1, c2, …",
        field: Field::OneOf(|| vec![DETECTED, YES, NO]),
        get: |plan, _| {
            let header = plan.import.dialect.header.map(|header| if header { YES } else { NO });
            header.unwrap_or(DETECTED).to_owned()
        },
        set: |plan, _, text| {
            plan.import.dialect.header = Some(text == YES).filter(|_| text != DETECTED);
            Ok(())
        },
        reads: true,
        joined: 0,
    },
    ImportOption {
        name: Cow::Borrowed("Encoding"),
        hint: "Encoding of the text.",
        field: Field::OneOf(names::<Encoding>),
        get: |plan, _| plan.import.dialect.encoding.map_or(DETECTED, Named::name).to_owned(),
        set: |plan, _, text| {
            plan.import.dialect.encoding = named(text)?;
            Ok(())
        },
        reads: true,
        joined: 0,
    },
    ImportOption {
        name: Cow::Borrowed("Lines before"),
        hint: "Number of lines to skip before the table.",
        field: Field::Text(Cow::Borrowed(DETECTED)),
        get: |plan, _| plan.import.dialect.skip_lines.map_or_else(String::new, |lines| lines.to_string()),
        set: |plan, _, text| {
            let lines = Some(text.trim()).filter(|text| !text.is_empty()).map(str::parse);
            let lines = lines.transpose().map_err(|_| format!("'{text}' is not a whole number"));
            plan.import.dialect.skip_lines = lines?.filter(|lines| *lines > 0);
            Ok(())
        },
        reads: true,
        joined: 0,
    },
];

/// Returns the items in a text with commas between them.
fn items<T: FromStr<Err: Display>>(text: &str) -> Result<Vec<T>, String> {
    let texts = text.split(',').map(str::trim).filter(|text| !text.is_empty());
    texts.map(|text| text.parse().map_err(|error: T::Err| error.to_string())).collect()
}

fn joined<T: ToString>(items: &[T], separator: &str) -> String {
    Vec::from_iter(items.iter().map(ToString::to_string)).join(separator)
}

fn set_history(plan: &mut Plan, set: impl FnOnce(&mut Memory)) {
    let mut memory = plan.import.memory.take().unwrap_or_default();
    set(&mut memory);
    plan.import.memory = Some(memory).filter(|memory| !memory.is_empty());
}

fn names<T: Named>() -> Vec<&'static str> {
    let names = T::ALL.iter().map(|one| one.name());
    std::iter::once(DETECTED).chain(names).collect()
}

fn named<T: Named>(text: &str) -> Result<Option<T>, String> {
    let given = Some(text).filter(|text| *text != DETECTED).map(T::parse);
    given.transpose().map_err(|error| error.to_string())
}

/// Text of an option that is being typed, or that was refused.
#[derive(Debug)]
pub(super) struct Typed {
    text: String,
    /// Result of writing it into the plan, once that was tried.
    tried: Option<Result<(), String>>,
}

impl Typed {
    /// Returns the reason if the text was refused.
    pub(super) fn refusal(&self) -> Option<String> {
        self.tried.clone()?.err()
    }
}

/// A folded part of the form.
struct Part {
    name: &'static str,
    summary: String,
    notes: Vec<String>,
    options: Vec<ImportOption>,
}

impl Part {
    /// A part whose summary are the texts of its options, or what is `usual`.
    fn of(name: &'static str, usual: &str, notes: Vec<String>, options: Vec<ImportOption>, plan: &Plan) -> Self {
        let texts = options.iter().map(|option| (option.get)(plan, option.joined));
        let texts = Vec::from_iter(texts.filter(|text| ![DETECTED, ""].contains(&text.as_str())));
        let summary = if texts.is_empty() { usual.to_owned() } else { texts.join(", ") };
        Self {
            name,
            summary,
            notes,
            options,
        }
    }
}

/// The parts below the samples.
fn parts(import: &Import, shared: &Shared) -> Vec<Part> {
    let plan = &import.plan;
    let files = &import.files;
    let filter = Part::of("Filter", "all", Vec::new(), FILTER.into(), plan);
    let note = "Columns computed from others of the same file, such as a difference, a ratio, or the change since the start. \
                They are computed wherever the network decodes.";
    let computed = Part::of("Computed columns", "none", vec![note.to_owned()], COMPUTED.into(), plan);
    let positions = plan.import.positions.as_ref();
    let note = "Targets that are deformations or forces at places of the skin, such as taxels: with their positions the \
                actual and the decoded surface of each test sample are shown. The file has the header target,x,y, in \
                millimetres.";
    let positions = Part {
        name: POSITIONS_PART,
        summary: positions.map_or_else(|| "none".to_owned(), |path| file_name(path)),
        notes: vec![note.to_owned()],
        options: Vec::new(),
    };
    let mut parts = vec![filter, computed, history(plan, shared), positions];
    if files.len() > 1 {
        let is_by_time = plan.import.time.is_some();
        let limit = |(joined, file): (usize, &decoupler_files::import::InspectedFile)| {
            let interval = file.time.as_ref().and_then(|time| time.median_interval);
            let usual = interval.map_or_else(String::new, |interval| input_text((5e5 * interval).round() / 1e6));
            ImportOption {
                name: format!("Limit for {}", file_name(&file.path)).into(),
                field: Field::Text(usual.into()),
                joined,
                ..LIMIT
            }
        };
        let (summary, notes, options) = if is_by_time {
            ("by time", Vec::new(), files[1..].iter().enumerate().map(limit).collect())
        } else {
            let note = "Rows belong together by their number. To join by time, make a column of each file “time” in the table.";
            ("row by row", vec![note.to_owned()], Vec::new())
        };
        parts.push(Part {
            name: "Joined files",
            summary: summary.to_owned(),
            notes,
            options,
        });
    }
    let detected = files.iter().filter_map(|file| match &file.format {
        Format::Text(dialect) => Some(format!("{}: {dialect}.", file_name(&file.path))),
        _ => None,
    });
    let detected = Vec::from_iter(detected);
    if !detected.is_empty() {
        parts.push(Part::of("File format", DETECTED, detected, FORMAT.into(), plan));
    }
    parts
}

fn history(plan: &Plan, shared: &Shared) -> Part {
    let is_automatic = shared.recording.is_automatic();
    let chosen = shared.chosen_run().and_then(|run| run.setup.plan());
    let summary = match (&plan.import.memory, is_automatic, chosen) {
        (None, true, None) => "automatic".to_owned(),
        (None, true, Some(plan)) => plan.import.memory.clone().unwrap_or_default().to_string(),
        (Some(memory), true, _) => format!("{memory}, fixed"),
        (memory, false, _) => memory.clone().unwrap_or_default().to_string(),
    };
    let note = "Sensors with hysteresis, creep or drift: the inputs of the network also contain what the readings were \
                before, within a group and across no gap in time.";
    let kept = "Chosen automatically while these fields are empty; what is given here is kept.";
    let kept = is_automatic.then(|| kept.to_owned());
    Part {
        name: "History of readings",
        summary,
        notes: std::iter::once(note.to_owned()).chain(kept).collect(),
        options: HISTORY.into(),
    }
}

const POSITIONS_PART: &str = "Positions";
const POSITIONS: FileWords = FileWords {
    kind: "file of positions",
    description: "A table of text with the header target,x,y: the name of each target, and where it lies on the skin in \
                  millimetres.",
    extensions: &["csv", "txt", "tsv"],
};
const TEST_FILES: FileWords = FileWords {
    kind: "recording for the test",
    description: "A recording with the same columns; all its samples are test samples.",
    ..FILES
};

impl RecordingEditor {
    /// Shows the folded parts of the import; changes the seed of `settings`.
    pub fn folds_ui(&mut self, ui: &mut Ui, settings: &mut RunSettings, shared: &Shared, effects: &mut Vec<Effect>) {
        let Some(import) = &self.import else { return };
        let parts = parts(import, shared);
        fold_ui(ui, "Samples", &samples_summary(import, settings), |ui| {
            self.split_ui(ui, settings.validation_fraction());
            let button = ui.add(ghost_button("Test file…"));
            let button = button.on_hover_text("A separate recording for the test, instead of a share.");
            if button.clicked() {
                effects.push(Effect::ChooseFile(self.ask(Use::Test, TEST_FILES, String::new())));
            }
            seed_ui(ui, "Seed", glossary::SEED.hint, &mut settings.seed.0, 0);
        });
        for part in parts {
            let typed = |option: &ImportOption| self.typed.get(&*option.name)?.refusal();
            let summary = part.options.iter().find_map(typed).unwrap_or(part.summary);
            fold_ui(ui, part.name, &summary, |ui| {
                for note in &part.notes {
                    dim_ui(ui, note);
                }
                for option in &part.options {
                    self.option_ui(ui, option);
                }
                if part.name == POSITIONS_PART {
                    let button = ui.add(ghost_button("Positions file…"));
                    if button.on_hover_text(POSITIONS.description).clicked() {
                        effects.push(Effect::ChooseFile(self.ask(Use::Positions, POSITIONS, String::new())));
                    }
                }
            });
        }
    }

    /// Shows the field of an option, and writes what the user gives into the plan.
    fn option_ui(&mut self, ui: &mut Ui, option: &ImportOption) {
        let Some(import) = &self.import else { return };
        let shown = (option.get)(&import.plan, option.joined);
        match &option.field {
            Field::Text(example) => self.text_ui(ui, option, example, shown),
            Field::OneOf(texts) => {
                let hint = |text: &str| match text {
                    DETECTED => "As detected at the beginning of each file.",
                    _ => option.hint,
                };
                let options = Vec::from_iter(texts().into_iter().map(|text| (text, text, hint(text))));
                if let Some(picked) = list_ui(ui, &option.name, option.hint, &options, &shown) {
                    // Each of the texts is valid.
                    let _ = self.set(option, picked);
                }
            }
            Field::Check => {
                let mut is_on = shown == YES;
                if ui.checkbox(&mut is_on, &*option.name).on_hover_text(option.hint).changed() {
                    let _ = self.set(option, if is_on { YES } else { NO });
                }
            }
        }
    }

    /// A text with its name above. It takes effect while it is typed or, if the files must be read again, at the end.
    fn text_ui(&mut self, ui: &mut Ui, option: &ImportOption, example: &str, shown: String) {
        let label = ui.label(&*option.name).on_hover_text(option.hint);
        let typed = self.typed.remove(&*option.name);
        let (mut text, mut tried) = typed.map_or((shown, Some(Ok(()))), |typed| (typed.text, typed.tried));
        // Notes come and go above while it is being typed.
        let edit = TextEdit::singleline(&mut text).id(Id::unique(("recording", &*option.name)));
        let edit = ui.add(edit.desired_width(f32::INFINITY).hint_text(example));
        let edit = edit.labelled_by(label.id).on_hover_text(option.hint);
        if edit.changed() {
            tried = None;
        }
        // Also one that lost the focus while another view was displayed.
        let is_due = tried.is_none() && !(option.reads && edit.has_focus());
        if is_due {
            tried = Some(self.set(option, &text));
        }
        if let (Some(Err(reason)), false) = (&tried, edit.has_focus()) {
            note_ui(ui, reason);
        }
        if edit.has_focus() || !matches!(tried, Some(Ok(()))) {
            self.typed.insert(option.name.to_string(), Typed { text, tried });
        }
    }

    fn set(&mut self, option: &ImportOption, text: &str) -> Result<(), String> {
        let Some(import) = &mut self.import else { return Ok(()) };
        let mut plan = Plan::clone(&import.plan);
        (option.set)(&mut plan, option.joined, text)?;
        if plan != *import.plan {
            import.plan = plan.into();
            if option.reads {
                self.read_again();
            }
        }
        Ok(())
    }

    /// The division of the samples.
    fn split_ui(&mut self, ui: &mut Ui, usual_validation: f64) {
        let Some(import) = &mut self.import else { return };
        let mut division = import.plan.division;
        let has_group = import.plan.import.has_groups();
        let options = [
            (SplitBy::Time, "time", "The last part of the recording is held out for testing."),
            (SplitBy::Group, "group", "Whole groups, drawn at random, are held out for testing."),
            (SplitBy::Random, "random", "Single samples, drawn at random, are held out for testing."),
        ];
        let offered = options.into_iter().filter(|(by, ..)| has_group || *by != SplitBy::Group);
        let hint = "Rule by which samples are divided into training, validation and test.";
        if let Some(by) = options_ui(ui, "Split by", hint, &Vec::from_iter(offered), division.by) {
            division.by = by;
        }
        if import.plan.test.is_some() {
            dim_ui(
                ui,
                "All samples of the test files are test samples; close these files to hold out a share instead.",
            );
        } else {
            let hint = "Share of the samples held out for testing.";
            percent_ui(ui, "Test share", hint, &mut division.test_fraction, 0.2, 1.0..=90.0);
            if division.by == SplitBy::Random {
                note_ui(ui, bias(division.by));
            } else {
                dim_ui(ui, bias(division.by));
            }
            if !has_group {
                dim_ui(ui, "To split by group, make a column “group” in the table.");
            }
        }
        let hint = "Share of the other samples that selects the best weights and ends the training. Bayesian \
                    regularisation needs none.";
        let mut share = division.validation_fraction.unwrap_or(usual_validation);
        percent_ui(ui, "Validation share", hint, &mut share, usual_validation, 0.0..=90.0);
        if usual_validation > 0.0 && share == 0.0 {
            note_ui(ui, "This method overfits where nothing is held out for validation.");
        }
        division.validation_fraction = Some(share);
        if division != import.plan.division {
            import.edit().division = division;
        }
    }
}

fn samples_summary(import: &Import, settings: &RunSettings) -> String {
    let Division { by, test_fraction, .. } = import.plan.division;
    let split = match import.tests().first() {
        Some((.., test)) => format!("test: {}", file_name(test)),
        None => format!("{by}, {} % test", input_text((1000.0 * test_fraction).round() / 10.0)),
    };
    format!("{split}, seed {}", settings.seed.0)
}

/// Returns a sentence on the bias of test errors by a rule of division.
pub(in crate::window::views::train) fn bias(by: SplitBy) -> &'static str {
    match by {
        SplitBy::Time => "The last part of the recording is held out for testing.",
        SplitBy::Group => "Whole groups are held out for testing: no press or session is in two sets.",
        SplitBy::Random => {
            "A random split is optimistic when neighbouring rows are similar. Compare with a split by group, or by time \
             if there are no groups."
        }
    }
}
