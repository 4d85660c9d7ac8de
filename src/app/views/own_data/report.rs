use eframe::egui::{RichText, Ui};

use super::{
    checking::Checked,
    draft::Draft,
    error_table::error_tables_ui,
    model::{Trained, Validated},
    remarks::{flattery, sentence},
    state::OwnDataView,
};
use crate::{
    app::{
        shared::Phase,
        theme::{semibold, type_size},
        widgets::{dim_ui, fact_ui, note_ui, scrolled_ui, section_heading_ui},
    },
    dataset::SplitBy,
    export::{format_duration, format_number},
    sensor::counted,
};

/// Outcome of the import, and the errors of the network.
pub(super) fn report_ui(ui: &mut Ui, view: &OwnDataView) {
    scrolled_ui(ui, "own data report", |ui| {
        if let Some(shown) = &view.shown {
            errors_ui(ui, shown, view);
        }
        if let Some(validated) = &view.validated {
            validated_ui(ui, validated);
        }
        if view.draft.is_some() {
            samples_ui(ui, view);
        } else if view.shown.is_none() {
            section_heading_ui(ui, "Errors on the test set");
            dim_ui(
                ui,
                "The errors of each target in its own unit appear here: those of the network beside ridge regression and \
                 the mean.",
            );
        }
        if let Some(shown) = &view.shown {
            cost_ui(ui, shown);
        }
    });
}

fn samples_ui(ui: &mut Ui, view: &OwnDataView) {
    section_heading_ui(ui, "Samples");
    match &view.checking.checked {
        Some(Ok(checked)) => checked_ui(ui, checked, view.draft.as_ref()),
        Some(Err(reason)) => {
            note_ui(ui, &sentence(reason));
        }
        None if view.checking.is_under_way() => {
            dim_ui(ui, "The import is being tried out…");
        }
        None => {
            let reason = view.draft.as_ref().and_then(|draft| draft.obstacle());
            dim_ui(ui, &sentence(&reason.unwrap_or_default()));
        }
    }
}

fn checked_ui(ui: &mut Ui, checked: &Checked, draft: Option<&Draft>) {
    let [training, validation, test] = checked.samples;
    fact_ui(
        ui,
        "Training",
        "Samples that the network is fitted to.",
        &training.to_string(),
    );
    if validation > 0 {
        let meaning = "Samples that select the best weights and end the training.";
        fact_ui(ui, "Validation", meaning, &validation.to_string());
    }
    fact_ui(
        ui,
        "Test",
        "Samples on which all errors are measured.",
        &test.to_string(),
    );
    for file in &checked.files {
        let Some(join) = file.join else { continue };
        let name = file.path.file_name().unwrap_or_default().to_string_lossy();
        let offset = join.median_offset.map_or_else(String::new, |offset| {
            format!(", median {} apart", format_number(offset.abs()))
        });
        dim_ui(
            ui,
            &format!(
                "{name} is joined by time within {}{offset}; {} without partner, {} of its rows unused.",
                format_number(join.limit),
                counted(join.without_partner, "row"),
                join.unused
            ),
        );
    }
    for dropped in &checked.dropped {
        dim_ui(
            ui,
            &format!(
                "{} of {} rows dropped: {} (first on line {}).",
                dropped.rows, checked.rows, dropped.reason, dropped.first_line
            ),
        );
    }
    if let Some(positions) = &checked.positions {
        dim_ui(ui, &sentence(positions));
    }
    let is_random = draft.is_some_and(|draft| !draft.has_tests() && draft.plan.division.by == SplitBy::Random);
    if is_random {
        note_ui(ui, flattery(SplitBy::Random));
    }
    for warning in &checked.warnings {
        note_ui(ui, &sentence(warning));
    }
}

fn errors_ui(ui: &mut Ui, shown: &Trained, view: &OwnDataView) {
    section_heading_ui(ui, "Errors on the test set");
    let plan = &shown.file.plan;
    let is_changed = view.planned().is_some_and(|now| now.absolute != *plan)
        || view.asked.is_some_and(|asked| asked != view.settings);
    if is_changed && !view.phase.is_busy() {
        let name = &shown.name;
        dim_ui(
            ui,
            &format!("Of {name}: the import or the settings have changed since this training."),
        );
    }
    error_tables_ui(ui, &shown.file.targets, &shown.rows());
    if let Some(flaw) = &shown.flaw {
        note_ui(ui, &sentence(flaw));
    }
    for remark in &shown.remarks {
        note_ui(ui, &sentence(remark));
    }
    if plan.test.is_none() && plan.division.by == SplitBy::Random {
        note_ui(ui, flattery(SplitBy::Random));
    }
}

fn validated_ui(ui: &mut Ui, validated: &Validated) {
    section_heading_ui(ui, "Cross-validation");
    dim_ui(
        ui,
        &format!(
            "{} samples, each tested by a network that has not seen its fold: {}.",
            validated.samples, validated.folds
        ),
    );
    let rows: Vec<_> = ["training mean", "ridge", "network"]
        .into_iter()
        .zip(validated.table.iter().map(|row| &row.targets[..]))
        .collect();
    error_tables_ui(ui, &validated.targets, &rows);
    for remark in &validated.remarks {
        ui.label(RichText::new(sentence(remark)).size(type_size().note));
    }
}

fn cost_ui(ui: &mut Ui, shown: &Trained) {
    section_heading_ui(ui, "Training");
    ui.label(RichText::new(&shown.name).font(semibold(type_size().body)));
    let file = &shown.file;
    let settings = &file.settings;
    let layers = format!("{}–{}–{}", file.inputs.len(), settings.hidden, file.targets.len());
    fact_ui(ui, "Network", "Number of inputs, hidden nodes and targets.", &layers);
    let weights = file.network.weights().to_string();
    fact_ui(ui, "Weights", "Weights and biases of the network.", &weights);
    let method = settings.training.method.name();
    fact_ui(ui, "Trained by", "Algorithm that adjusted the weights.", method);
    let best = file.training.best_epoch.to_string();
    fact_ui(ui, "Best epoch", "Epoch of the weights that were kept.", &best);
    if let Phase::Ended(reason) = shown.phase {
        fact_ui(ui, "Ended", "Reason for which the training ended.", &reason.to_string());
    }
    if let Some(time) = shown.wall_time {
        fact_ui(
            ui,
            "Time",
            "Time of the training by the clock, all starts side by side.",
            &format_duration(time),
        );
    }
}
