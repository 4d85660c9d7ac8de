//! The user's word on the files: which they are, how they are laid out and joined, which rows count, and how the
//! samples are divided.

use std::path::PathBuf;

use eframe::egui::{Align, Id, Label, Layout, Response, RichText, TextEdit, Ui, WidgetInfo, accesskit::Role};

use super::{
    draft::{Draft, file_name, missing},
    layout_form::{joined_summary, joined_ui, layout_summary, layout_ui},
    positions_form::{positions_summary, positions_ui},
    remarks::flattery,
    state::OwnDataView,
};
use crate::{
    app::{
        shared::{Effect, FileTask, FileWords, Purpose},
        theme::{Theme, semibold, space, type_size},
        widgets::{
            dim_ui,
            fields::{input_text, options_ui, percent_ui},
            fold_ui, ghost_button, note_ui, primary_button, section_heading_ui,
        },
    },
    dataset::SplitBy,
    import::{Condition, Format, Meaning},
};

/// Files that can be opened.
const FILES: FileWords = FileWords {
    kind: "recording",
    description: "A table of readings and targets (CSV or other text, .npy, .npz, .mat), a recipe, or a network or \
                  checkpoint of own data.",
    extensions: &["csv", "txt", "tsv", "dat", "npy", "npz", "mat", "json", "checkpoint"],
};

const TEST_FILES: FileWords = FileWords {
    kind: "recording for the test",
    description: "A recording with the same columns, of which all samples test.",
    ..FILES
};

impl OwnDataView {
    /// Task of opening a file.
    pub(super) fn open_task(&self) -> FileTask {
        FileTask {
            words: FILES,
            suggestion: String::new(),
            purpose: Purpose::Choose(self.choices.clone()),
        }
    }
}

/// An invitation to begin.
pub(super) fn invitation_ui(ui: &mut Ui, view: &OwnDataView, effects: &mut Vec<Effect>) {
    let dim = Theme::of(ui).palette.dim;
    ui.vertical_centered(|ui| {
        ui.add_space((0.5 * ui.available_height() - space(24)).max(space(2)));
        ui.label(RichText::new("Drop recordings here").font(semibold(type_size().title)));
        ui.add_space(space(2));
        ui.scope(|ui| {
            ui.set_max_width(space(120));
            let text = "Readings of a sensor with what was pressed: one file, or several that share a time, such as \
                        readings and positions. CSV and other text, .npy, .npz and .mat. What each column means is \
                        guessed from its name and numbers, and you correct the guess.";
            ui.label(RichText::new(text).color(dim));
        });
        ui.add_space(space(3));
        if ui.add(primary_button("Open files…")).clicked() {
            effects.push(Effect::ChooseFile(view.open_task()));
        }
    });
}

/// An open file by its use.
#[derive(Clone)]
enum OpenFile {
    /// A recording by its number: the first, or one that is joined to it.
    Recording(usize),
    /// A file for the test, by the recording in whose place it is read.
    Test(PathBuf),
    /// Positions of targets.
    Positions,
}

/// The files, and buttons to open others.
pub(super) fn files_ui(ui: &mut Ui, view: &mut OwnDataView, effects: &mut Vec<Effect>) {
    section_heading_ui(ui, "Files");
    let mut closed = None;
    if let Some(draft) = &view.draft {
        let recordings = draft.paths().into_iter().enumerate();
        let recordings = recordings.map(|(number, path)| (OpenFile::Recording(number), path));
        let tests = draft.tests();
        let tests = tests.map(|(recording, test)| (OpenFile::Test(recording.to_owned()), test.to_owned()));
        let positions = draft.plan.import.positions.iter();
        let positions = positions.map(|path| (OpenFile::Positions, path.clone()));
        for (file, path) in recordings.chain(tests).chain(positions) {
            let name = file_name(&path);
            let what = match &file {
                OpenFile::Recording(0) => String::new(),
                OpenFile::Recording(_) => ", joined".to_owned(),
                OpenFile::Test(recording) if draft.files.len() > 1 => {
                    format!(", for the test of {}", file_name(recording))
                }
                OpenFile::Test(_) => ", for the test".to_owned(),
                OpenFile::Positions => ", positions".to_owned(),
            };
            ui.horizontal(|ui| {
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    let close = ui.small_button("×");
                    close.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Close {name}")));
                    if close.on_hover_text("Closes this file.").clicked() {
                        closed = Some(file);
                    }
                    ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                        let text = format!("{name}{what}");
                        ui.add(Label::new(text).truncate())
                            .on_hover_text(path.display().to_string());
                    });
                });
            });
        }
    }
    match (closed, &mut view.draft) {
        (Some(OpenFile::Recording(number)), _) => view.close(number),
        (Some(OpenFile::Test(recording)), Some(draft)) => draft.close_test_file(&recording),
        (Some(OpenFile::Positions), Some(draft)) => draft.plan.import.positions = None,
        _ => {}
    }
    let (under_way, has_draft) = (view.opening.under_way.is_some(), view.draft.is_some());
    ui.horizontal(|ui| {
        let text = if has_draft { "Add file…" } else { "Open file…" };
        if ui.add(ghost_button(text)).on_hover_text(FILES.description).clicked() {
            effects.push(Effect::ChooseFile(view.open_task()));
        }
        let typed = ui.add(ghost_button("Type path…"));
        typed.widget_info(|| WidgetInfo::labeled(Role::Button, true, "Type the path of a recording"));
        if typed
            .on_hover_text("Type the path instead of choosing the file.")
            .clicked()
        {
            effects.push(Effect::TypePath(view.open_task()));
        }
        if under_way {
            if ui.add(ghost_button("Cancel")).clicked() {
                view.opening.cancel();
            }
        } else if has_draft
            && ui
                .add(ghost_button("Clear"))
                .on_hover_text("Closes all files.")
                .clicked()
        {
            view.draft = None;
        }
    });
}

/// The folded parts of the import.
pub(super) fn import_folds_ui(ui: &mut Ui, view: &mut OwnDataView, effects: &mut Vec<Effect>) {
    let (needs_validation, choices) = (view.settings.validation_fraction() > 0.0, view.test_choices.clone());
    let positions_task = view.positions_task();
    let Some(draft) = &mut view.draft else { return };
    let mut looks_again = false;
    fold_ui(ui, "Split", &split_summary(draft), |ui| {
        let task = FileTask {
            words: TEST_FILES,
            suggestion: String::new(),
            purpose: Purpose::Choose(choices),
        };
        split_ui(ui, draft, needs_validation, task, effects);
    });
    fold_ui(ui, "Rows", &rows_summary(draft), |ui| looks_again |= rows_ui(ui, draft));
    fold_ui(ui, "Positions", &positions_summary(draft), |ui| {
        positions_ui(ui, positions_task, effects);
    });
    if draft.files.len() > 1 {
        fold_ui(ui, "Joined files", &joined_summary(draft), |ui| joined_ui(ui, draft));
    }
    if draft.files.iter().any(|file| matches!(file.format, Format::Text(_))) {
        fold_ui(ui, "Layout of text", &layout_summary(draft), |ui| {
            looks_again |= layout_ui(ui, draft);
        });
    }
    if looks_again {
        view.look_again();
    }
}

fn split_summary(draft: &Draft) -> String {
    match draft.tests().next() {
        Some((_, test)) => format!("test: {}", file_name(test)),
        None => format!(
            "{}, {} % test",
            draft.plan.division.by,
            input_text((1000.0 * draft.plan.division.test_fraction).round() / 10.0)
        ),
    }
}

fn split_ui(ui: &mut Ui, draft: &mut Draft, needs_validation: bool, task: FileTask, effects: &mut Vec<Effect>) {
    let (has_group, is_given) = (draft.has(Meaning::Group), draft.has_tests());
    let options = [
        (SplitBy::Time, "time", "The last part of the samples tests."),
        (SplitBy::Group, "group", "Whole groups test, drawn at random."),
        (SplitBy::Random, "random", "Single samples test, drawn at random."),
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
            "All samples of the files for the test are tested; close these files to divide the others.",
        );
    } else {
        let hint = "Share of the samples that test and are never trained on.";
        percent_ui(ui, "Test share", hint, &mut division.test_fraction, 0.2, 1.0..=90.0);
        match division.by {
            SplitBy::Random => {
                note_ui(ui, flattery(SplitBy::Random));
            }
            by => {
                dim_ui(ui, flattery(by));
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
        if needs_validation { 0.2 } else { 0.0 },
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

fn rows_summary(draft: &Draft) -> String {
    match (draft.conditions.trim(), draft.missing.trim()) {
        ("", "") => "all".to_owned(),
        ("", missing) => format!("missing: {missing}"),
        (conditions, _) => conditions.to_owned(),
    }
}

/// Returns true if the files are to be looked at anew.
fn rows_ui(ui: &mut Ui, draft: &mut Draft) -> bool {
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
    // Also one that lost the focus while another view was on show.
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
    let edit = TextEdit::singleline(text).id(Id::unique(("own data", name)));
    let edit = edit.desired_width(f32::INFINITY).hint_text(example);
    ui.add(edit).labelled_by(label.id).on_hover_text(hint)
}
