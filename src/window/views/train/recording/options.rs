//! The folded parts of the form of a recording. Each option of the import is a row of a table, with its name, its hint, and how
//! its text is read from the plan and written into it; one form shows them all.

use std::{fmt::Display, str::FromStr, sync::Arc};

use decoupler_core::{
    dataset::{Memory, SplitBy},
    evaluation::RunSettings,
    text::Named,
};
use decoupler_files::import::{Condition, Decimal, Encoding, Plan, Separator};
use eframe::egui::{Id, TextEdit, Ui};

use super::{
    editor::{RecordingEditor, Use},
    import::{Import, file_name},
};
use crate::window::{
    glossary,
    shared::{Effect, Shared},
    widgets::{
        dim_ui,
        fields::{input_text, list_ui, percent_ui, seed_ui},
        fold_ui, ghost_button, note_ui,
    },
};

/// An option of the import: a field that shows and edits a part of the plan as text, which is empty where nothing is given.
struct ImportOption {
    name: &'static str,
    hint: &'static str,
    field: Field,
    /// Text of the option in the plan.
    get: fn(&Plan) -> String,
    /// Writes a text into the plan; returns the reason if it is wrong.
    set: fn(&mut Plan, &str) -> Result<(), String>,
}

/// Kinds of fields.
enum Field {
    /// A text, with an example that is shown while it is empty.
    Text(&'static str),
    /// One of these texts, or nothing: what is detected in each file.
    OneOf(fn() -> Vec<&'static str>),
    /// Yes or nothing.
    Check,
}

const FILTER: [ImportOption; 2] = [
    ImportOption {
        name: "Only rows with",
        hint: "Only rows that meet this condition are used, for example c4<145.1 and c5!=0. Columns have their names in \
               the table.",
        field: Field::Text("c4 < 145.1"),
        get: |plan| joined(&plan.import.conditions, " and "),
        set: |plan, text| {
            let condition = given(text).map(str::parse::<Condition>).transpose();
            plan.import.conditions = Vec::from_iter(condition.map_err(|error| error.to_string())?);
            Ok(())
        },
    },
    ImportOption {
        name: "Missing cells",
        hint: "Numbers or texts that mark missing values, in all columns or in one, such as -1 or states.c5=-1, with \
               commas between them. Empty cells are missing anyway. Rows in which a cell that is used is missing are dropped.",
        field: Field::Text("-1, states.c5=-1"),
        get: |plan| joined(&plan.import.missing, ", "),
        set: |plan, text| items(text).map(|missing| plan.import.missing = missing),
    },
];

const COMPUTED: [ImportOption; 1] = [ImportOption {
    name: "Expressions",
    hint: "With commas between them: d=c1-c2 is a difference, q=c1/c2 a ratio; r=c1/start(2s) and r=c1-start(100) compare \
           with the mean of the first 2 seconds or 100 rows. Columns have their names in the table.",
    field: Field::Text("d=c1-c2, r=c1/start(2s)"),
    get: |plan| joined(&plan.import.derive, ", "),
    set: |plan, text| items(text).map(|derive| plan.import.derive = derive),
}];

const HISTORY: [ImportOption; 3] = [
    ImportOption {
        name: "Averages",
        hint: "Exponential averages of the readings with these time constants, as further inputs: 0.1s, 1s, 10s need a \
               column “time”; 20, 100 are numbers of samples.",
        field: Field::Text("0.1s, 1s, 10s"),
        get: |plan| joined(&history(plan).averages, ", "),
        set: |plan, text| items(text).map(|averages| set_history(plan, |history| history.averages = averages)),
    },
    ImportOption {
        name: "Lags",
        hint: "Readings this number of samples, or seconds, before each sample, as further inputs.",
        field: Field::Text("5, 10, 20"),
        get: |plan| joined(&history(plan).lags, ", "),
        set: |plan, text| items(text).map(|lags| set_history(plan, |history| history.lags = lags)),
    },
    ImportOption {
        name: "Differences",
        hint: "The past enters as its difference from the current reading; without averages and lags, from the sample before.",
        field: Field::Check,
        get: |plan| String::from(if history(plan).differences { YES } else { "" }),
        set: |plan, text| {
            set_history(plan, |history| history.differences = text == YES);
            Ok(())
        },
    },
];

const JOINS: [ImportOption; 1] = [ImportOption {
    name: "Limit",
    hint: "Maximum time between joined rows, in the unit of the times, for all joined files. Without it, half the median \
           interval of the joined file.",
    field: Field::Text("half the median interval"),
    get: |plan| {
        let limits = plan.import.join.iter().filter_map(|joined| joined.limit);
        joined(&Vec::from_iter(limits.map(input_text)), ", ")
    },
    set: |plan, text| {
        let is_limit = |limit: &f64| limit.is_finite() && *limit > 0.0;
        let limit = number(text, "a number above 0, in the unit of the times", is_limit)?;
        plan.import.join.iter_mut().for_each(|joined| joined.limit = limit);
        Ok(())
    },
}];

const FORMAT: [ImportOption; 5] = [
    ImportOption {
        name: "Separator",
        hint: "Separator of the cells; space stands for any number of spaces or tabs.",
        field: Field::OneOf(names::<Separator>),
        get: |plan| shown(plan.import.dialect.separator),
        set: |plan, text| named(text).map(|separator| plan.import.dialect.separator = separator),
    },
    ImportOption {
        name: "Decimal",
        hint: "Decimal separator: 1.5 or 1,5.",
        field: Field::OneOf(names::<Decimal>),
        get: |plan| shown(plan.import.dialect.decimal),
        set: |plan, text| named(text).map(|decimal| plan.import.dialect.decimal = decimal),
    },
    ImportOption {
        name: "Header",
        hint: "Whether the first row has the names of the columns. Without them, columns are called c1, c2, …",
        field: Field::OneOf(|| vec![YES, NO]),
        get: |plan| shown(plan.import.dialect.header.map(|header| if header { YES } else { NO })),
        set: |plan, text| {
            plan.import.dialect.header = given(text).map(|text| text == YES);
            Ok(())
        },
    },
    ImportOption {
        name: "Encoding",
        hint: "Encoding of the text.",
        field: Field::OneOf(names::<Encoding>),
        get: |plan| shown(plan.import.dialect.encoding),
        set: |plan, text| named(text).map(|encoding| plan.import.dialect.encoding = encoding),
    },
    ImportOption {
        name: "Lines before",
        hint: "Number of lines to skip before the table.",
        field: Field::Text(DETECTED),
        get: |plan| shown(plan.import.dialect.skip_lines),
        set: |plan, text| {
            let lines = number(text, "a whole number", |_| true)?;
            plan.import.dialect.skip_lines = lines.filter(|lines| *lines > 0);
            Ok(())
        },
    },
];

const YES: &str = "yes";
const NO: &str = "no";
const DETECTED: &str = "detected";

fn given(text: &str) -> Option<&str> {
    Some(text.trim()).filter(|text| !text.is_empty())
}

/// Returns the items in a text with commas between them.
fn items<T: FromStr<Err: Display>>(text: &str) -> Result<Vec<T>, String> {
    let texts = text.split(',').filter_map(given);
    texts
        .map(|text| text.parse().map_err(|error: T::Err| error.to_string()))
        .collect()
}

/// Returns the number in a text, if there is one; `what` completes the reason if it is wrong.
fn number<T: FromStr>(text: &str, what: &str, is_valid: impl Fn(&T) -> bool) -> Result<Option<T>, String> {
    let parsed = |text: &str| {
        text.parse()
            .ok()
            .filter(&is_valid)
            .ok_or_else(|| format!("'{text}' is not {what}"))
    };
    given(text).map(parsed).transpose()
}

fn joined<T: ToString>(items: &[T], separator: &str) -> String {
    Vec::from_iter(items.iter().map(ToString::to_string)).join(separator)
}

fn history(plan: &Plan) -> Memory {
    plan.import.memory.clone().unwrap_or_default()
}

fn set_history(plan: &mut Plan, set: impl FnOnce(&mut Memory)) {
    let mut memory = history(plan);
    set(&mut memory);
    plan.import.memory = Some(memory).filter(|memory| !memory.is_empty());
}

fn names<T: Named>() -> Vec<&'static str> {
    T::ALL.iter().map(|one| one.name()).collect()
}

/// Text of what is given, if anything is.
fn shown<T: ToString>(one: Option<T>) -> String {
    one.as_ref().map_or_else(String::new, T::to_string)
}

fn named<T: Named>(text: &str) -> Result<Option<T>, String> {
    given(text).map(T::parse).transpose().map_err(|error| error.to_string())
}

impl RecordingEditor {
    /// Shows the folded parts of the import; changes the seed of `settings`.
    pub fn folds_ui(&mut self, ui: &mut Ui, settings: &mut RunSettings, shared: &Shared, effects: &mut Vec<Effect>) {
        let Some(import) = &self.import else { return };
        let (plan, formats) = (Arc::clone(&import.plan), import.text_formats());
        let is_joined = !plan.import.join.is_empty();
        let samples = samples_summary(import, self.held_out(), settings);
        fold_ui(ui, "Samples", &samples, |ui| {
            self.split_ui(ui, settings.validation_fraction());
            let hint = "A recording with the same columns; all its samples are test samples. Files for the test that are \
                        joined have “test” in their names: open all of them at once.";
            let button = ui.add_enabled(!is_joined, ghost_button("Test file…"));
            if button.on_hover_text(hint).on_disabled_hover_text(hint).clicked() {
                effects.push(Effect::ChooseFile(self.ask(Use::Test, String::new())));
            }
            seed_ui(ui, "Seed", glossary::SEED.hint, &mut settings.seed.0, 0);
        });
        self.part_ui(ui, "Filter", "all", &[], &FILTER);
        let notes = [
            "Columns computed from others of the same file, such as a difference, a ratio, or the change since the start. \
             They are computed wherever the network decodes.",
        ];
        self.part_ui(ui, "Computed columns", "none", &notes, &COMPUTED);
        let is_automatic = shared.recording.is_automatic();
        let chosen = shared.chosen_run().and_then(|run| run.setup.plan());
        let chosen = chosen.map(|plan| history(plan).to_string());
        let usual = chosen
            .as_deref()
            .unwrap_or(if is_automatic { "automatic" } else { "none" });
        let notes = [
            "Sensors with hysteresis, creep or drift: the inputs of the network also contain what the readings were before, \
             within a group and across no gap in time. Chosen with the other settings unless it is given here.",
        ];
        self.part_ui(ui, "History of readings", usual, &notes, &HISTORY);
        if is_joined && plan.import.time.is_some() {
            self.part_ui(ui, "Joined files", "by time", &[], &JOINS);
        }
        if !formats.is_empty() {
            let notes = Vec::from_iter(formats.iter().map(String::as_str));
            self.part_ui(ui, "File format", DETECTED, &notes, &FORMAT);
        }
    }

    /// Shows a folded part with notes and the fields of its options; `usual` is the summary while no option is given.
    fn part_ui(&mut self, ui: &mut Ui, name: &str, usual: &str, notes: &[&str], options: &[ImportOption]) {
        let Some(import) = &self.import else { return };
        let refusal = options.iter().find_map(|option| self.typed.get(option.name)?.1.clone());
        let given = options.iter().filter_map(|option| {
            let text = Some((option.get)(&import.plan)).filter(|text| !text.is_empty())?;
            Some(format!("{} {text}", option.name.to_lowercase()))
        });
        let given = Vec::from_iter(given).join(", ");
        let usual = if given.is_empty() { usual } else { &given };
        fold_ui(ui, name, refusal.as_deref().unwrap_or(usual), |ui| {
            for note in notes {
                dim_ui(ui, note);
            }
            for option in options {
                self.option_ui(ui, option);
            }
        });
    }

    /// Shows the field of an option, and writes what the user gives into the plan.
    fn option_ui(&mut self, ui: &mut Ui, option: &ImportOption) {
        let Some(import) = &self.import else { return };
        let (name, hint, shown) = (option.name, option.hint, (option.get)(&import.plan));
        let picked = match &option.field {
            Field::Text(example) => self.text_ui(ui, option, example, shown),
            Field::OneOf(texts) => {
                let mut options = vec![("", DETECTED, "As detected at the beginning of each file.")];
                options.extend(texts().into_iter().map(|text| (text, text, hint)));
                list_ui(ui, name, hint, &options, &shown).map(str::to_owned)
            }
            Field::Check => {
                let mut is_on = shown == YES;
                let check = ui.checkbox(&mut is_on, name).on_hover_text(hint);
                check.changed().then(|| String::from(if is_on { YES } else { "" }))
            }
        };
        if let Some(text) = picked {
            self.set(option, text);
        }
    }

    /// A text with its name above. Returns it once it was typed.
    fn text_ui(&mut self, ui: &mut Ui, option: &ImportOption, example: &str, shown: String) -> Option<String> {
        let ImportOption { name, hint, .. } = *option;
        let label = ui.label(name).on_hover_text(hint);
        let typed = self.typed.get(name);
        let (mut text, refusal) = typed.cloned().unwrap_or((shown, None));
        // Also one that lost the focus while another view was displayed.
        let is_untried = typed.is_some() && refusal.is_none();
        // Notes come and go above while it is being typed.
        let edit = TextEdit::singleline(&mut text).id(Id::unique(("recording", name)));
        let edit = ui.add(edit.desired_width(f32::INFINITY).hint_text(example));
        let edit = edit.labelled_by(label.id).on_hover_text(hint);
        if edit.changed() {
            self.typed.insert(name, (text.clone(), None));
        }
        if let Some(reason) = refusal.filter(|_| !edit.has_focus()) {
            note_ui(ui, &reason);
        }
        (is_untried && !edit.has_focus()).then_some(text)
    }

    /// Writes the text of an option into the plan, and reads the files again if they are read in another way now.
    fn set(&mut self, option: &ImportOption, text: String) {
        let Some(import) = &mut self.import else { return };
        let mut plan = Plan::clone(&import.plan);
        self.typed.remove(option.name);
        if let Err(reason) = (option.set)(&mut plan, &text) {
            self.typed.insert(option.name, (text, Some(reason)));
        } else if plan != *import.plan {
            let before = std::mem::replace(&mut import.plan, plan.into());
            let (now, before) = (&import.plan.import, &before.import);
            if (now.dialect, &now.derive, &now.missing) != (before.dialect, &before.derive, &before.missing) {
                self.read_again();
            }
        }
    }

    /// Returns the number of test samples and of all samples, once they are known.
    fn held_out(&self) -> Option<(usize, usize)> {
        let samples = self.reading.checked()?.samples;
        Some((samples[2], samples.iter().sum::<usize>().max(1)))
    }

    /// The division of the samples.
    fn split_ui(&mut self, ui: &mut Ui, usual_validation: f64) {
        let held_out = self.held_out();
        let Some(import) = &mut self.import else { return };
        let mut division = import.plan.division;
        let has_group = import.plan.import.has_groups();
        let offered = SplitBy::ALL.iter().filter(|by| has_group || **by != SplitBy::Group);
        let offered = Vec::from_iter(offered.map(|&by| (by, by.name(), bias(by))));
        let hint = "Rule by which samples are divided into training, validation and test. To split by group, make a column \
                    “group” in the table.";
        division.by = list_ui(ui, "Split by", hint, &offered, division.by).unwrap_or(division.by);
        if import.plan.test.is_some() {
            let text = "All samples of the test files are test samples; close these files to hold out a share instead.";
            dim_ui(ui, text);
        } else {
            let hint = "Share of the samples held out for testing.";
            percent_ui(ui, "Test share", hint, &mut division.test_fraction, 0.2, 1.0..=90.0);
            dim_ui(ui, bias(division.by));
            if let (SplitBy::Group, Some((held_out, all))) = (division.by, held_out) {
                let percent = 100 * held_out / all;
                dim_ui(ui, &format!("Held out: {held_out} of {all} samples ({percent} %)."));
            }
        }
        let hint = "Share of the other samples that selects the best weights and ends the training. Bayesian \
                    regularisation needs none.";
        let share = division.validation_fraction.get_or_insert(usual_validation);
        percent_ui(ui, "Validation share", hint, share, usual_validation, 0.0..=90.0);
        if usual_validation > 0.0 && *share == 0.0 {
            note_ui(ui, "This method overfits where nothing is held out for validation.");
        }
        if division != import.plan.division {
            import.edit().division = division;
        }
    }
}

fn samples_summary(import: &Import, held_out: Option<(usize, usize)>, settings: &RunSettings) -> String {
    let division = import.plan.division;
    let share = match held_out {
        // Whole groups are another share than the one asked for.
        Some((held_out, all)) if division.by == SplitBy::Group => (100 * held_out / all).to_string(),
        _ => input_text((1000.0 * division.test_fraction).round() / 10.0),
    };
    let split = match &import.plan.test {
        Some(test) => format!("test: {}", file_name(&test.data)),
        None => format!("{}, {share} % test", division.by),
    };
    format!("{split}, seed {}", settings.seed.0)
}

/// Returns a sentence on the bias of test errors by a rule of division.
pub(in crate::window::views::train) fn bias(by: SplitBy) -> &'static str {
    match by {
        SplitBy::Time => "The last part of the recording is held out for testing.",
        SplitBy::Group => "Whole groups are held out for testing: no press or session is in two sets.",
        SplitBy::Random => {
            "A random split is optimistic when neighbouring samples are similar. Compare with a split by group, or by time \
             if there are no groups."
        }
    }
}
