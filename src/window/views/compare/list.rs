use std::time::Duration;

use eframe::egui::{Button, Id, RichText, TextEdit, Ui, WidgetInfo, accesskit::Role};

use super::view::unlike_paper;
use crate::window::{
    shared::{Effect, PLACES, Phase, Shared},
    theme::{space, type_size},
    widgets::{dim_ui, ghost_button, scrolled_ui, section_heading_ui},
};
use decoupler_core::text::counted;
use decoupler_files::export::{KeptRun, NetworkFile, format_duration, format_percent};

/// The finished trainings, the newest first.
/// `removing` is the run that the user is asked about before it is removed.
pub fn run_list_ui(ui: &mut Ui, shared: &Shared, removing: &mut Option<u64>, effects: &mut Vec<Effect>) {
    let runs = &shared.runs;
    scrolled_ui(ui, "runs", |ui| {
        section_heading_ui(ui, "Runs");
        if runs.workspace.runs.is_empty() {
            dim_ui(ui, "Every finished training is kept here, with its network.");
            ui.add_space(space(2));
            let can_train = !shared.phase.is_busy() && shared.phase != Phase::Died;
            if ui.add_enabled(can_train, ghost_button("Train a network now")).clicked() {
                effects.extend([Effect::ShowTraining, Effect::Train]);
            }
        } else {
            dim_ui(ui, "Choose one as A and one as B to see them side by side.");
        }
        for (position, run) in runs.workspace.runs.iter().enumerate().rev() {
            ui.add_space(space(2));
            ui.separator();
            ui.push_id(run.id, |ui| run_ui(ui, shared, (position, run), removing, effects));
        }
        ui.add_space(space(2));
        match &runs.path {
            Some(path) => dim_ui(ui, "Kept from session to session.").on_hover_text(path.display().to_string()),
            None => dim_ui(ui, "Not kept after this session."),
        };
    });
}

fn run_ui(
    ui: &mut Ui,
    shared: &Shared,
    (position, run): (usize, &KeptRun),
    removing: &mut Option<u64>,
    effects: &mut Vec<Effect>,
) {
    let name = &run.name;
    name_ui(ui, position, run, effects);
    dim_ui(ui, &conditions(&run.file));
    let time = Duration::try_from_secs_f64(run.file.training.seconds).unwrap_or_default();
    let text = format!(
        "{} {}, {} on one thread",
        if run.file.problem.has_nodes { "Z" } else { "Error" },
        format_percent(run.file.scores.network.percent()),
        format_duration(time)
    );
    ui.label(RichText::new(text).size(type_size().note));
    if *removing == Some(run.id) {
        ui.horizontal(|ui| {
            ui.label("Remove this run?");
            if ui.button("Remove").clicked() {
                effects.push(Effect::RemoveRun(run.id));
                *removing = None;
            }
            if ui.button("Keep").clicked() {
                *removing = None;
            }
        });
        return;
    }
    ui.horizontal(|ui| {
        for (place, letter) in PLACES.into_iter().enumerate() {
            let is_pinned = shared.runs.workspace.pinned[place] == Some(run.id);
            let button = Button::selectable(is_pinned, letter)
                .frame_when_inactive(true)
                .min_size([space(6), space(6)].into());
            let response = ui.add(button);
            response.widget_info(|| WidgetInfo::selected(Role::Button, true, is_pinned, format!("{name} as {letter}")));
            let hint = if is_pinned { "Hide" } else { "Show on this side" };
            if response.on_hover_text(hint).clicked() {
                effects.push(Effect::PinRun(place, (!is_pinned).then_some(run.id)));
            }
        }
        let can_take = !shared.phase.is_busy();
        let take = ui.add_enabled(can_take, Button::new("Settings").min_size([0.0, space(6)].into()));
        take.widget_info(|| WidgetInfo::labeled(Role::Button, can_take, format!("Use the settings of {name}")));
        if take.on_hover_text("Uses its settings for the next training.").clicked() {
            let setup = Box::new(run.file.setup());
            effects.extend([Effect::TakeSetup(setup), Effect::ShowTraining]);
        }
        let remove = ui.add(Button::new("Remove…").min_size([0.0, space(6)].into()));
        remove.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Remove {name}")));
        if remove.clicked() {
            *removing = Some(run.id);
        }
    });
}

/// The name, to be changed in place; what is typed counts when the field is left.
fn name_ui(ui: &mut Ui, position: usize, run: &KeptRun, effects: &mut Vec<Effect>) {
    let id = Id::unique(("run name", run.id));
    let typed: Option<String> = ui.data(|data| data.get_temp(id));
    let mut name = typed.clone().unwrap_or_else(|| run.name.clone());
    let edit = ui.add(TextEdit::singleline(&mut name).id(id).desired_width(f32::INFINITY));
    ui.ctx()
        .accesskit_node_builder(edit.id, |node| node.set_label(format!("Name of run {}", position + 1)));
    if edit.changed() {
        ui.data_mut(|data| data.insert_temp(id, name.clone()));
    }
    // Also a field that lost the focus while another view was displayed.
    if !edit.has_focus() && typed.is_some() {
        ui.data_mut(|data| data.remove::<String>(id));
        if name != run.name {
            effects.push(Effect::RenameRun(run.id, name));
        }
    }
}

/// Returns the conditions of the run in a line.
fn conditions(file: &NetworkFile) -> String {
    let settings = &file.settings;
    let starts = match settings.starts {
        1 => String::new(),
        starts => format!(", {starts} starts"),
    };
    let simulated = settings.simulated();
    let samples = simulated.map_or(String::new(), |settings| {
        format!(", {}", counted(settings.source.samples, "sample"))
    });
    let mut text = format!(
        "{}, {} hidden, {}{samples}, seed {}{starts}",
        file.source_name(),
        settings.hidden,
        settings.training.method.short_name(),
        settings.seed
    );
    for words in simulated.iter().flat_map(unlike_paper) {
        text += &format!(", {words}");
    }
    text
}
