//! The folded parts of an import: division of the samples, filter of rows, memory, positions, joins and the layout of text files.

use decoupler_core::{dataset::SplitBy, evaluation::RunSettings};
use decoupler_files::import::{Condition, Decimal, DialectChoice, Encoding, Format, Meaning, Separator};
use eframe::egui::{Id, Response, TextEdit, Ui, WidgetInfo, accesskit::Role};

use super::{
    columns_card::bias,
    draft::{Draft, MemoryTexts, derived, file_name, joined, missing, spans},
    editor::RecordingEditor,
    files_section::FILES,
};
use crate::window::{
    glossary,
    shared::{Effect, FileTask, FileWords, Shared},
    widgets::{
        dim_ui,
        fields::{count_ui, input_text, list_ui, options_ui, percent_ui, quantity_ui, seed_ui},
        fold_ui, ghost_button, note_ui,
    },
};

/// Maximum number of lines before a table.
const MAX_LINES: usize = 1_000_000;

/// Summary of the join of the files.
pub(super) fn joined_summary(draft: &Draft) -> String {
    let is_by_time = draft.files.iter().all(|file| file.meanings.contains(&Meaning::Time));
    if is_by_time {
        "by time".to_owned()
    } else {
        "row by row".to_owned()
    }
}

/// The limits of the joins; changes `draft`.
pub(super) fn joined_ui(ui: &mut Ui, draft: &mut Draft) {
    let is_by_time = joined_summary(draft) == "by time";
    if !is_by_time {
        dim_ui(
            ui,
            "Rows belong together by their number. To join by time, make a column of each file “time” in the table.",
        );
        return;
    }
    let intervals: Vec<Option<f64>> = draft.files[1..]
        .iter()
        .map(|file| file.time.as_ref().and_then(|time| time.median_interval))
        .collect();
    let names: Vec<String> = draft.files[1..].iter().map(|file| file_name(&file.path)).collect();
    for ((joined, interval), name) in draft.joined().iter_mut().zip(intervals).zip(names) {
        ui.label(&name);
        let mut has_limit = joined.limit.is_some();
        let hint = "Largest time between a row and its partner. Otherwise half the median interval of the joined file.";
        let response = ui.checkbox(&mut has_limit, "Own limit");
        response.widget_info(|| WidgetInfo::selected(Role::CheckBox, true, has_limit, format!("Own limit for {name}")));
        response.on_hover_text(hint);
        let usual = interval.map_or(1.0, |interval| interval / 2.0);
        match (has_limit, &mut joined.limit) {
            (true, Some(limit)) => {
                quantity_ui(ui, "Limit", hint, limit, 1e-12..=1e12, "");
            }
            (true, limit @ None) => *limit = Some(usual),
            (false, limit) => {
                *limit = None;
                dim_ui(
                    ui,
                    &format!(
                        "Within {} of the time of a row.",
                        input_text((1e6 * usual).round() / 1e6)
                    ),
                );
            }
        }
    }
}

/// Summary of the layout: detected, or set by the user.
pub(super) fn layout_summary(draft: &Draft) -> String {
    if draft.plan.import.dialect == DialectChoice::default() {
        "detected".to_owned()
    } else {
        "custom".to_owned()
    }
}

/// The layout of text files; changes `draft`. Returns true if the files must be inspected again.
pub(super) fn layout_ui(ui: &mut Ui, draft: &mut Draft) -> bool {
    for file in &draft.files {
        if let Format::Text(dialect) = &file.format {
            dim_ui(ui, &format!("{}: {dialect}.", file_name(&file.path)));
        }
    }
    let dialect = &mut draft.plan.import.dialect;
    let before = *dialect;
    let detected = (None, "detected", "As detected at the beginning of each file.");
    let separators = [
        detected,
        (Some(Separator::Comma), "comma", ","),
        (Some(Separator::Semicolon), "semicolon", ";"),
        (Some(Separator::Tab), "tab", "Tab character"),
        (Some(Separator::Bar), "bar", "|"),
        (Some(Separator::Space), "space", "Any number of spaces or tabs"),
    ];
    if let Some(picked) = list_ui(
        ui,
        "Separator",
        "Character between cells.",
        &separators,
        dialect.separator,
    ) {
        dialect.separator = picked;
    }
    let detected = (None, "detected", "As detected at the beginning of each file.");
    let decimals = [
        detected,
        (Some(Decimal::Point), "point", "1.5"),
        (Some(Decimal::Comma), "comma", "1,5"),
    ];
    if let Some(picked) = list_ui(
        ui,
        "Decimal",
        "Character before the decimal places.",
        &decimals,
        dialect.decimal,
    ) {
        dialect.decimal = picked;
    }
    let detected = (None, "detected", "As detected at the beginning of each file.");
    let headers = [
        detected,
        (Some(true), "yes", "The first row has the names of the columns."),
        (
            Some(false),
            "no",
            "The first row has numbers; columns are called c1, c2, …",
        ),
    ];
    if let Some(picked) = list_ui(ui, "Header", "Names in the first row.", &headers, dialect.header) {
        dialect.header = picked;
    }
    let detected = (None, "detected", "As detected at the beginning of each file.");
    let encodings = [
        detected,
        (Some(Encoding::Utf8), "utf-8", "With or without a byte-order mark"),
        (Some(Encoding::Latin1), "latin-1", "ISO 8859-1"),
        (Some(Encoding::Utf16Le), "utf-16le", "Little-endian"),
        (Some(Encoding::Utf16Be), "utf-16be", "Big-endian"),
    ];
    if let Some(picked) = list_ui(ui, "Encoding", "Encoding of the text.", &encodings, dialect.encoding) {
        dialect.encoding = picked;
    }
    let mut lines = dialect.skip_lines.unwrap_or(0);
    count_ui(
        ui,
        "Lines before",
        "Lines before the table, which are skipped.",
        &mut lines,
        0..=MAX_LINES,
    );
    dialect.skip_lines = (lines > 0).then_some(lines);
    *dialect != before
}

pub(super) const POSITIONS: FileWords = FileWords {
    kind: "file of positions",
    description: "A table of text with the header target,x,y: the name of each target, and where it lies on the skin in \
                  millimetres.",
    extensions: &["csv", "txt", "tsv"],
};

/// The file of positions, if there is one.
pub(super) fn positions_summary(draft: &Draft) -> String {
    let positions = draft.plan.import.positions.as_ref();
    positions.map_or_else(|| "none".to_owned(), |path| file_name(path))
}

/// The choice of the file with the positions of targets.
pub(super) fn positions_ui(ui: &mut Ui, task: FileTask, effects: &mut Vec<Effect>) {
    dim_ui(
        ui,
        "Targets that are deformations or forces at places of the skin, such as taxels: with their positions the actual and \
         the decoded surface of each test sample are shown. The file has the header target,x,y, in millimetres.",
    );
    let button = ui.add(ghost_button("Positions file…"));
    if button.on_hover_text(POSITIONS.description).clicked() {
        effects.push(Effect::ChooseFile(task));
    }
}

const TEST_FILES: FileWords = FileWords {
    kind: "recording for the test",
    description: "A recording with the same columns; all its samples are test samples.",
    ..FILES
};

impl RecordingEditor {
    /// Shows the folded parts of the import; changes the seed of `settings`.
    pub fn folds_ui(&mut self, ui: &mut Ui, settings: &mut RunSettings, shared: &Shared, effects: &mut Vec<Effect>) {
        let task = self.tests.task(TEST_FILES, String::new());
        let positions_task = self.positions.task(POSITIONS, String::new());
        let Some(draft) = &mut self.draft else { return };
        let mut reads_again = false;
        fold_ui(ui, "Samples", &samples_summary(draft, settings), |ui| {
            split_ui(ui, draft, settings.validation_fraction(), task, effects);
            seed_ui(ui, "Seed", glossary::SEED.hint, &mut settings.seed.0, 0);
        });
        fold_ui(ui, "Filter", &filter_summary(draft), |ui| {
            reads_again |= filter_ui(ui, draft);
        });
        fold_ui(ui, "Derived columns", &derived_summary(draft), |ui| {
            reads_again |= derived_ui(ui, draft);
        });
        fold_ui(ui, "Memory", &memory_summary(draft, shared), |ui| {
            memory_ui(ui, draft, shared.recording.is_automatic());
        });
        fold_ui(ui, "Positions", &positions_summary(draft), |ui| {
            positions_ui(ui, positions_task, effects);
        });
        if draft.files.len() > 1 {
            fold_ui(ui, "Joined files", &joined_summary(draft), |ui| joined_ui(ui, draft));
        }
        if draft.files.iter().any(|file| matches!(file.format, Format::Text(_))) {
            fold_ui(ui, "Layout of text", &layout_summary(draft), |ui| {
                reads_again |= layout_ui(ui, draft);
            });
        }
        if reads_again {
            self.read_again();
        }
    }
}

fn samples_summary(draft: &Draft, settings: &RunSettings) -> String {
    let split = match draft.tests().next() {
        Some((_, test)) => format!("test: {}", file_name(test)),
        None => format!(
            "{}, {} % test",
            draft.plan.division.by,
            input_text((1000.0 * draft.plan.division.test_fraction).round() / 10.0)
        ),
    };
    format!("{split}, seed {}", settings.seed.0)
}

fn split_ui(ui: &mut Ui, draft: &mut Draft, usual_validation: f64, task: FileTask, effects: &mut Vec<Effect>) {
    let needs_validation = usual_validation > 0.0;
    let (has_group, is_given) = (draft.has_groups(), draft.has_tests());
    let options = [
        (
            SplitBy::Time,
            "time",
            "The last part of the recording is held out for testing.",
        ),
        (
            SplitBy::Group,
            "group",
            "Whole groups, drawn at random, are held out for testing.",
        ),
        (
            SplitBy::Random,
            "random",
            "Single samples, drawn at random, are held out for testing.",
        ),
    ];
    let offered: Vec<_> = options
        .into_iter()
        .filter(|(by, ..)| has_group || *by != SplitBy::Group)
        .collect();
    let hint = "Rule by which samples are divided into training, validation and test.";
    if let Some(by) = options_ui(ui, "Split by", hint, &offered, draft.plan.division.by) {
        draft.split_by(by);
    }
    let division = &mut draft.plan.division;
    if is_given {
        dim_ui(
            ui,
            "All samples of the test files are test samples; close these files to hold out a share instead.",
        );
    } else {
        let hint = "Share of the samples held out for testing.";
        percent_ui(ui, "Test share", hint, &mut division.test_fraction, 0.2, 1.0..=90.0);
        match division.by {
            SplitBy::Random => {
                note_ui(ui, bias(SplitBy::Random));
            }
            by => {
                dim_ui(ui, bias(by));
            }
        }
        if !has_group {
            dim_ui(ui, "To split by group, make a column “group” in the table.");
        }
    }
    let hint = "Share of the other samples that selects the best weights and ends the training. Bayesian regularisation \
                needs none.";
    let share = division.validation_fraction.get_or_insert(usual_validation);
    percent_ui(ui, "Validation share", hint, share, usual_validation, 0.0..=90.0);
    if needs_validation && *share == 0.0 {
        note_ui(ui, "This method overfits where nothing is held out for validation.");
    }
    let button = ui.add(ghost_button("Test file…"));
    if button
        .on_hover_text("A separate recording for the test, instead of a share.")
        .clicked()
    {
        effects.push(Effect::ChooseFile(task));
    }
}

fn filter_summary(draft: &Draft) -> String {
    match (draft.conditions.trim(), draft.missing.trim()) {
        ("", "") => "all".to_owned(),
        ("", missing) => format!("missing: {missing}"),
        (conditions, _) => conditions.to_owned(),
    }
}

/// Returns true if the files must be read again.
fn filter_ui(ui: &mut Ui, draft: &mut Draft) -> bool {
    let hint = "Only rows that meet this condition are used, such as c4<145.1 and c5!=0. Columns have their names in the table.";
    let response = text_ui(ui, "Only rows with", hint, "c4 < 145.1", &mut draft.conditions);
    let typed = draft.conditions.trim();
    if let (false, false, Err(error)) = (typed.is_empty(), response.has_focus(), typed.parse::<Condition>()) {
        note_ui(ui, &error.to_string());
    }
    let hint = "Numbers or texts that mean missing, in all columns or in one, such as -1 or states.c5=-1, with commas \
                between them. Empty cells are missing anyway. Rows in which a cell that is used is missing are dropped.";
    let response = text_ui(ui, "Missing cells", hint, "-1, states.c5=-1", &mut draft.missing);
    let is_new = missing(&draft.missing) != draft.plan.import.missing;
    // Also one that lost the focus while another view was displayed.
    let is_left = !response.has_focus() && is_new;
    if is_left {
        draft.plan.import.missing = missing(&draft.missing);
    }
    is_left
}

fn derived_summary(draft: &Draft) -> String {
    match &draft.plan.import.derive[..] {
        [] => "none".to_owned(),
        derive => joined(&Vec::from_iter(derive.iter().map(|derived| &derived.name)), ", "),
    }
}

/// Returns true if the files must be read again.
fn derived_ui(ui: &mut Ui, draft: &mut Draft) -> bool {
    dim_ui(
        ui,
        "Columns computed from others of the same file, such as a difference, a ratio, or the change since the start. They \
         are computed wherever the network decodes.",
    );
    let hint = "With commas between them: d=c1-c2 is a difference, q=c1/c2 a ratio; r=c1/start(2s) and r=c1-start(100) compare \
                with the mean of the first 2 seconds or 100 rows. Columns have their names in the table.";
    let response = text_ui(ui, "Expressions", hint, "d=c1-c2, r=c1/start(2s)", &mut draft.derived);
    if response.has_focus() {
        return false;
    }
    match derived(&draft.derived) {
        Ok(derive) if derive != draft.plan.import.derive => {
            draft.plan.import.derive = derive;
            true
        }
        Ok(_) => false,
        Err(error) => {
            note_ui(ui, &error);
            false
        }
    }
}

fn memory_summary(draft: &Draft, shared: &Shared) -> String {
    let is_automatic = shared.recording.is_automatic();
    let chosen = shared.chosen_run().and_then(|run| run.setup.plan());
    match (draft.memory.parsed(), is_automatic, chosen) {
        (Err(reason), ..) => reason,
        (Ok(None), true, None) => "automatic".to_owned(),
        (Ok(None), true, Some(plan)) => plan.import.memory.clone().unwrap_or_default().to_string(),
        (Ok(Some(memory)), true, _) => format!("{memory}, fixed"),
        (Ok(memory), false, _) => memory.unwrap_or_default().to_string(),
    }
}

fn memory_ui(ui: &mut Ui, draft: &mut Draft, is_automatic: bool) {
    dim_ui(
        ui,
        "Sensors with hysteresis, creep or drift: the inputs of the network also contain what the readings were before, \
         within a group and across no gap in time.",
    );
    if is_automatic {
        dim_ui(
            ui,
            "Chosen automatically while these fields are empty; what is given here is kept.",
        );
    }
    let MemoryTexts {
        averages,
        lags,
        differences,
    } = &mut draft.memory;
    let hint = "Exponential averages of the readings with these time constants, as further inputs: 0.1s, 1s, 10s need a \
                column “time”; 20, 100 are numbers of samples.";
    let fields = [
        ("Averages", hint, "0.1s, 1s, 10s", averages),
        (
            "Lags",
            "Readings this number of samples, or seconds, before each sample, as further inputs.",
            "5, 10, 20",
            lags,
        ),
    ];
    for (name, hint, example, text) in fields {
        let response = text_ui(ui, name, hint, example, text);
        if let (false, Err(error)) = (response.has_focus(), spans(text)) {
            note_ui(ui, &error);
        }
    }
    let hint = "The past enters as its difference from the present reading; without averages and lags, from the sample before.";
    ui.checkbox(differences, "Differences").on_hover_text(hint);
}

/// A text with its name above.
fn text_ui(ui: &mut Ui, name: &str, hint: &str, example: &str, text: &mut String) -> Response {
    let label = ui.label(name).on_hover_text(hint);
    // Notes come and go above while it is being typed.
    let edit = TextEdit::singleline(text).id(Id::unique(("recording", name)));
    let edit = edit.desired_width(f32::INFINITY).hint_text(example);
    ui.add(edit).labelled_by(label.id).on_hover_text(hint)
}
