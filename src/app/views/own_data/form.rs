use eframe::egui::{DragValue, Ui};

use super::{
    import_form::{files_ui, import_folds_ui},
    state::OwnDataView,
};
use crate::{
    app::{
        shared::{Effect, Phase, method_choice_ui, method_settings_ui, stopping_ui},
        theme::space,
        widgets::{
            dim_ui,
            fields::{count_ui, field_ui, input_text, options_ui},
            fold_ui, ghost_button, note_ui, scrolled_ui,
        },
    },
    evaluation::{Measured, RunSettings},
    import::Meaning,
    network::{HiddenSuggestions, LARGEST_HIDDEN, ScalingChoice},
    scene::RowModel,
    sensor::counted,
};

/// Largest number of folds offered.
const MOST_FOLDS: usize = 1000;

/// The files, the network and the parts of the import, in the order in which they are needed.
pub(super) fn form_ui(ui: &mut Ui, view: &mut OwnDataView, effects: &mut Vec<Effect>) {
    scrolled_ui(ui, "own data form", |ui| {
        let (is_busy, is_held) = (view.phase.is_busy(), view.phase == Phase::Paused);
        ui.add_enabled_ui(!is_busy, |ui| files_ui(ui, view, effects));
        ui.add_space(space(2));
        ui.separator();
        ui.add_enabled_ui(!is_busy, |ui| hidden_ui(ui, view));
        let before = view.settings.training.method;
        ui.add_enabled_ui(!is_busy || is_held, |ui| {
            method_choice_ui(ui, &mut view.settings.training.method);
        });
        if !is_held && view.settings.training.method.short_name() != before.short_name() {
            view.follow_method(before);
        }
        ui.add_space(space(2));
        ui.separator();
        if let Some(reason) = view.draft.as_ref().and_then(|draft| draft.lack()) {
            note_ui(ui, &reason);
        }
        ui.add_enabled_ui(!is_busy, |ui| {
            import_folds_ui(ui, view, effects);
            inputs_fold_ui(ui, view);
        });
        ui.add_enabled_ui(!is_busy || is_held, |ui| {
            let summary = format!("{} epochs", view.settings.training.stopping.epochs);
            fold_ui(ui, "When to stop", &summary, |ui| {
                stopping_ui(ui, &mut view.settings.training.stopping);
            });
            fold_ui(ui, "Method settings", &method_summary(&view.settings), |ui| {
                let RunSettings { training, starts, .. } = &mut view.settings;
                method_settings_ui(ui, &mut training.method, starts, !is_busy);
                let hint = "Seed of all random numbers: the same seed gives the same network and split.";
                ui.add_enabled_ui(!is_busy, |ui| {
                    field_ui(ui, "Seed", hint, |ui| {
                        ui.add_sized(
                            [space(16), space(6)],
                            DragValue::new(&mut view.settings.seed.0).speed(0.1),
                        )
                    });
                });
            });
        });
        ui.add_enabled_ui(!is_busy, |ui| folds_ui(ui, view));
        ui.add_space(space(4));
    });
}

/// The number of hidden nodes, with what the rules of thumb suggest.
fn hidden_ui(ui: &mut Ui, view: &mut OwnDataView) {
    let hint = "Number of nodes in the tanh layer between inputs and targets.";
    count_ui(ui, "Hidden nodes", hint, &mut view.settings.hidden, 1..=LARGEST_HIDDEN);
    let Some(draft) = &view.draft else { return };
    let (inputs, targets) = (draft.count(Meaning::Input), draft.count(Meaning::Target));
    if inputs > 0 && targets > 0 {
        let suggestions = HiddenSuggestions::new(inputs, targets);
        let (low, high) = (*suggestions.square_root.start(), *suggestions.square_root.end());
        let text = format!(
            "{}, {}. Rules of thumb: {}, or {low} to {high}",
            counted(inputs, "input"),
            counted(targets, "target"),
            suggestions.logarithm
        );
        dim_ui(ui, &text);
    }
}

/// Scaling of the inputs, and one network or several where the row-wires are known.
fn inputs_fold_ui(ui: &mut Ui, view: &mut OwnDataView) {
    let has_row_wires = view.has_row_wires();
    let settings = &mut view.settings;
    let rows = if has_row_wires { view.rows } else { RowModel::Shared };
    settings.source = Measured { rows }.into();
    let summary = match settings.inputs.scaling {
        ScalingChoice::MinMax => "min-max",
        ScalingChoice::Whitening => "whitening",
    };
    fold_ui(ui, "Network inputs", summary, |ui| {
        let options = [
            (ScalingChoice::MinMax, "Min-max", "Each input scaled to −1 to 1."),
            (
                ScalingChoice::Whitening,
                "Whitening",
                "Principal components, each divided by its spread: components of small variance count as much as large \
                 ones.",
            ),
        ];
        if let Some(picked) = options_ui(
            ui,
            "Scaling",
            "Scaling of the inputs.",
            &options,
            settings.inputs.scaling,
        ) {
            settings.inputs.scaling = picked;
        }
        if has_row_wires {
            let options = [
                (RowModel::Shared, "All", "One network for every row-wire."),
                (
                    RowModel::Each,
                    "Known",
                    "One network per row-wire, which knows which one it reads.",
                ),
            ];
            let hint = "One network for all row-wires or one for each.";
            if let Some(rows) = options_ui(ui, "Rows", hint, &options, settings.source.row_model()) {
                view.rows = rows;
            }
        }
    });
}

fn method_summary(settings: &RunSettings) -> String {
    let mut method = settings.training.method;
    let first = method.settings().into_iter().next();
    let first = first.map(|setting| format!("{} {}, ", setting.name, input_text(*setting.value)));
    let starts = match settings.starts {
        1 => "1 start".to_owned(),
        starts => format!("{starts} starts"),
    };
    format!("{}{starts}", first.unwrap_or_default())
}

/// Cross-validation.
fn folds_ui(ui: &mut Ui, view: &mut OwnDataView) {
    let summary = format!("{} folds", view.validation.folds);
    let can_begin = view.obstacle().is_none();
    let mut is_wanted = false;
    fold_ui(ui, "Cross-validation", &summary, |ui| {
        let hint = "Number of parts, each of which is tested by a network trained on the others.";
        count_ui(ui, "Folds", hint, &mut view.validation.folds, 2..=MOST_FOLDS);
        let hint = "Repeats the cross-validation with random folds and tells how much lower the errors look. It takes twice \
                    as long.";
        ui.checkbox(&mut view.validation.compares_random, "Compare with random folds")
            .on_hover_text(hint);
        dim_ui(
            ui,
            "Tests on every sample, and says with an interval how well the readings tell each target. It takes as many \
             trainings as there are folds.",
        );
        is_wanted = ui.add_enabled(can_begin, ghost_button("Cross-validate")).clicked();
    });
    if is_wanted {
        view.validate();
    }
}
