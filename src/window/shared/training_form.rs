use std::{path::PathBuf, sync::Arc};

use decoupler_core::{
    evaluation::{Combination, MAX_STARTS, RunSettings},
    settings::{Field, Kind},
    text::Named,
    training::{Method, StoppingRules, TrainerState},
};
use decoupler_files::{
    export::NetworkFile,
    figure::Figure,
    import::{Plan, Setup},
};
use eframe::egui::{ComboBox, RichText, Ui};

use super::{Exporting, FileTask, Look, SourceKind};
use crate::window::{
    glossary,
    theme::{Theme, space, type_size},
    widgets::fields::{capitalised, count_ui, input_text, quantity_ui, usually},
};

/// The choice of the method; changes `method`.
pub fn method_choice_ui(ui: &mut Ui, method: &mut Method) {
    // The longest names fill a line.
    let label = ui.label("Method").on_hover_text(glossary::METHOD.hint);
    let combo = ComboBox::from_id_salt("method")
        .selected_text(method.name())
        .width(ui.available_width())
        .height(space(90));
    let shown = combo.show_ui(ui, |ui| {
        for option in Method::all() {
            let is_selected = option.short_name() == method.short_name();
            let choice = ui
                .selectable_label(is_selected, option.name())
                .on_hover_text(option.summary());
            if choice.clicked() && !is_selected {
                *method = option;
            }
        }
    });
    shown.response.labelled_by(label.id);
    let dim = Theme::of(ui).palette.dim;
    ui.label(RichText::new(method.summary()).size(type_size().note).color(dim));
}

/// The settings of the chosen method, the number of starts, and how they become one network; changes all. A paused
/// training (`is_new` is false) keeps its starts.
pub fn method_settings_ui(ui: &mut Ui, settings: &mut RunSettings, is_new: bool) {
    let method = &mut settings.training.method;
    let usual = method.with_defaults();
    for setting in method.settings() {
        let (Some(default), Some(range)) = (setting.number(&usual), setting.range()) else {
            continue;
        };
        let hint = format!("{} Default {}.", setting.help, input_text(default));
        if let Some(Field::Number(value)) = (setting.field)(method) {
            quantity_ui(
                ui,
                &capitalised(setting.name),
                &hint,
                value,
                usually(default, range),
                "",
            );
            if matches!(setting.kind, Kind::Integer(..)) {
                *value = value.round();
            }
        }
    }
    let hint = format!("{} Default 1.", glossary::STARTS.hint);
    ui.add_enabled_ui(is_new, |ui| {
        count_ui(ui, "Starts", &hint, &mut settings.starts, usually(1, 1..=MAX_STARTS));
        let label = ui.label("Combine starts").on_hover_text(glossary::COMBINE.hint);
        let combo = ComboBox::from_id_salt("combine").selected_text(combination_name(settings.combine));
        let shown = combo.show_ui(ui, |ui| {
            for &option in Combination::ALL {
                ui.selectable_value(&mut settings.combine, option, combination_name(option));
            }
        });
        shown.response.labelled_by(label.id);
    });
}

/// Name of a way to combine starts.
pub fn combination_name(combine: Combination) -> &'static str {
    match combine {
        Combination::Best => "keep the best",
        Combination::Mean => "average their answers",
    }
}

/// The rules that end a training, whose defaults are `usual`; changes `stopping`.
pub fn stopping_ui(ui: &mut Ui, stopping: &mut StoppingRules, usual: StoppingRules) {
    let hint = format!(
        "Largest number of epochs. {} Train counts from the first epoch, Continue from the current one.",
        glossary::EPOCH.hint
    );
    count_ui(
        ui,
        "Epochs",
        &hint,
        &mut stopping.epochs,
        usually(usual.epochs, 1..=StoppingRules::MAX_EPOCHS),
    );
    let hint = format!("{} Default {}.", glossary::VALIDATION_FAILURES.hint, usual.max_fail);
    count_ui(
        ui,
        "Validation failures",
        &hint,
        &mut stopping.max_fail,
        usually(usual.max_fail, 1..=StoppingRules::MAX_EPOCHS),
    );
    let hint = format!(
        "Training error at which training ends. Default 0.\n\n{}",
        glossary::MSE.hint
    );
    quantity_ui(
        ui,
        "Goal (mse)",
        &hint,
        &mut stopping.goal_mse,
        usually(usual.goal_mse, 0.0..=1e300),
        "",
    );
    let hint = format!(
        "Norm of the gradient below which training ends. Default 1e-7.\n\n{}",
        glossary::GRADIENT.hint
    );
    quantity_ui(
        ui,
        "Smallest gradient",
        &hint,
        &mut stopping.min_gradient,
        usually(usual.min_gradient, 0.0..=1e300),
        "",
    );
}

/// Request of a view to the window, which applies all of them in one place once everything is drawn.
#[derive(Clone, Debug)]
pub enum Effect {
    /// Change the settings of the next training.
    Configure(Box<RunSettings>),
    /// Change the settings of the next training on a recording.
    ConfigureRecording(Box<RunSettings>),
    /// Choose the settings of a training on a recording automatically, or not.
    ChooseAutomatically(bool),
    /// Use this plan of an import for the next training, or show what it lacks.
    Import(Result<Arc<Plan>, String>),
    /// Select the kind of source to train on.
    ChooseSource(SourceKind),
    /// Use the setup of another run for the next training.
    TakeSetup(Box<Setup>),
    /// Show the Train view.
    ShowTraining,
    /// Begin training.
    Train,
    /// Open the training saved in this checkpoint.
    OpenTraining(PathBuf),
    /// Show the training with this setup and these states of its starts.
    TakeUp(Box<Setup>, Vec<TrainerState>),
    /// Pause the training.
    Pause,
    /// Resume it.
    Resume,
    /// Stop it.
    Stop,
    /// Continue from the current weights with the method and the epochs of the settings.
    Continue,
    /// Set the look of all surfaces.
    Look(Look),
    /// Decode this snapshot in the results to come.
    Watch(usize),
    /// Ask for the path of a file.
    ChooseFile(FileTask),
    /// Let the user choose the form of an export.
    Export(Box<Exporting>),
    /// Put this text on the clipboard.
    Copy {
        /// The text.
        text: String,
        /// Message for the user.
        notice: String,
    },
    /// Put this picture on the clipboard.
    CopyPicture {
        /// The picture.
        figure: Box<Figure>,
        /// Message for the user.
        notice: String,
    },
    /// Keep the run of a network file that was opened.
    KeepRun(Box<NetworkFile>),
    /// Rename the kept run with this number.
    RenameRun(u64, String),
    /// Show the kept run with this number in one of the two places, or nothing.
    PinRun(usize, Option<u64>),
    /// Remove the run with this number.
    RemoveRun(u64),
    /// Show a notice to the user.
    Notify(Matter, Notice),
    /// Withdraw the failures of this subject, which have been resolved.
    Settle(Matter),
}

/// Notice to the user, shown once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Notice {
    /// Success.
    Done(String),
    /// A file was written at this path.
    Saved(String, PathBuf),
    /// Failure, with what to do.
    Failed(String),
}

/// Subject of a notice. A success also withdraws the failures of the same subject.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matter {
    /// The current training, or one that was to be shown.
    Training,
    /// A training that was cut short when the program ended.
    CutShort,
    /// Settings with which no training can begin.
    Settings,
    /// The test set of the settings.
    Preview,
    /// A file that the user has saved.
    File,
    /// Text on the clipboard.
    Clipboard,
    /// The run list.
    RunList,
    /// The Experiments view.
    Experiments,
    /// The Identifiability view.
    Identifiability,
    /// The Trade-off view.
    TradeOff,
    /// The Live view.
    Live,
    /// Files of the recording that is trained on.
    Recording,
    /// The file of the state restored at the next start.
    Memory,
}
