//! The folded parts of an import: division of the samples, rows that count, positions, joins and the layout of text.

use eframe::egui::{Id, Response, TextEdit, Ui};

use super::{
    draft::{Draft, file_name, missing},
    editor::RecordingEditor,
    files_section::FILES,
    layout_form::{joined_summary, joined_ui, layout_summary, layout_ui},
    positions_form::{POSITIONS, positions_summary, positions_ui},
    remarks::bias,
};
use crate::window::{
    glossary,
    shared::{Effect, FileTask, FileWords},
    widgets::{
        dim_ui,
        fields::{input_text, options_ui, percent_ui, seed_ui},
        fold_ui, ghost_button, note_ui,
    },
};
use decoupler_core::{dataset::SplitBy, evaluation::RunSettings};
use decoupler_files::import::{Condition, Format, Meaning};

const TEST_FILES: FileWords = FileWords {
    kind: "recording for the test",
    description: "A recording with the same columns, of which all samples are test samples.",
    ..FILES
};

impl RecordingEditor {
    /// Shows the folded parts of the import; changes the seed of `settings`.
    pub fn folds_ui(&mut self, ui: &mut Ui, settings: &mut RunSettings, effects: &mut Vec<Effect>) {
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
    let (has_group, is_given) = (draft.has(Meaning::Group), draft.has_tests());
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
    percent_ui(
        ui,
        "Validation share",
        hint,
        &mut division.validation_fraction,
        usual_validation,
        0.0..=90.0,
    );
    if needs_validation && division.validation_fraction == 0.0 {
        note_ui(ui, "This method overfits where nothing is held out for validation.");
    }
    let button = ui.add(ghost_button("Test file…"));
    if button
        .on_hover_text("A recording of its own for the test, instead of a share.")
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

/// Returns true if the files are to be read again.
fn filter_ui(ui: &mut Ui, draft: &mut Draft) -> bool {
    let hint = "Only rows that meet this are used, such as c4<145.1 and c5!=0. Columns by their names in the table.";
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

/// A text with its name above.
fn text_ui(ui: &mut Ui, name: &str, hint: &str, example: &str, text: &mut String) -> Response {
    let label = ui.label(name).on_hover_text(hint);
    // Notes come and go above while it is being typed.
    let edit = TextEdit::singleline(text).id(Id::unique(("recording", name)));
    let edit = edit.desired_width(f32::INFINITY).hint_text(example);
    ui.add(edit).labelled_by(label.id).on_hover_text(hint)
}
