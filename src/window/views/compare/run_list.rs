use std::time::Duration;

use decoupler_core::text::counted;
use decoupler_files::{
    export::{KeptRun, format_duration, format_percent},
    import::Setup,
};
use eframe::egui::{Button, Id, RichText, TextEdit, Ui, WidgetInfo, accesskit::Role};

use super::figures::named_settings;
use crate::window::{
    shared::{Effect, PLACES, RunsRequest, Shared},
    theme::{space, type_size},
    widgets::{dim_ui, scrolled_ui, section_heading_ui},
};

/// Shows the finished trainings, newest first; `removing` is the run whose removal awaits confirmation.
pub(super) fn run_list_ui(ui: &mut Ui, shared: &Shared, removing: &mut Option<u64>, effects: &mut Vec<Effect>) {
    let runs = &shared.runs;
    scrolled_ui(ui, "runs", |ui| {
        section_heading_ui(ui, "Runs");
        if runs.workspace.runs.is_empty() {
            dim_ui(
                ui,
                "Every finished training is kept here, with its network: press Train in the Train view.",
            );
        } else {
            dim_ui(ui, "Choose one as A and one as B to see them side by side.");
        }
        for (position, run) in runs.workspace.runs.iter().enumerate().rev() {
            ui.add_space(space(2));
            ui.separator();
            ui.push_id(run.id, |ui| {
                name_ui(ui, position, run, effects);
                dim_ui(ui, &conditions(&run.summary.setup));
                let time = Duration::try_from_secs_f64(run.summary.seconds).unwrap_or_default();
                let what = if run.summary.has_nodes { "Z" } else { "Error" };
                let percent = format_percent(run.summary.percent);
                let text = format!("{what} {percent}, training time {}", format_duration(time));
                ui.label(RichText::new(text).size(type_size().note));
                ui.horizontal(|ui| match *removing == Some(run.id) {
                    true => confirm_ui(ui, run, removing, effects),
                    false => buttons_ui(ui, shared, run, removing, effects),
                });
            });
        }
        ui.add_space(space(2));
        match &runs.path {
            Some(path) => dim_ui(ui, "Kept from session to session.").on_hover_text(path.display().to_string()),
            None => dim_ui(ui, "Not kept after this session."),
        };
    });
}

fn confirm_ui(ui: &mut Ui, run: &KeptRun, removing: &mut Option<u64>, effects: &mut Vec<Effect>) {
    ui.label("Remove this run?");
    if ui.button("Remove").clicked() {
        effects.push(Effect::ChangeRuns(RunsRequest::Remove(run.id)));
        *removing = None;
    }
    if ui.button("Keep").clicked() {
        *removing = None;
    }
}

fn buttons_ui(ui: &mut Ui, shared: &Shared, run: &KeptRun, removing: &mut Option<u64>, effects: &mut Vec<Effect>) {
    let name = &run.name;
    let size = [space(6), space(6)].into();
    for (place, letter) in PLACES.into_iter().enumerate() {
        let is_pinned = shared.runs.workspace.pinned[place] == Some(run.id);
        let button = Button::selectable(is_pinned, letter).frame_when_inactive(true);
        let response = ui.add(button.min_size(size));
        response.widget_info(|| WidgetInfo::selected(Role::Button, true, is_pinned, format!("{name} as {letter}")));
        let hint = if is_pinned { "Hide" } else { "Show on this side" };
        if response.on_hover_text(hint).clicked() {
            effects.push(Effect::ChangeRuns(RunsRequest::Pin(
                place,
                (!is_pinned).then_some(run.id),
            )));
        }
    }
    let can_open = !shared.phase.is_busy();
    let open = ui.add_enabled(can_open, Button::new("Open").min_size(size));
    open.widget_info(|| WidgetInfo::labeled(Role::Button, can_open, format!("Open {name}")));
    if open
        .on_hover_text("Shows it in the Train view, with its settings.")
        .clicked()
    {
        effects.push(Effect::OpenRun(run.id));
    }
    let remove = ui.add(Button::new("Remove…").min_size(size));
    remove.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Remove {name}")));
    if remove.clicked() {
        *removing = Some(run.id);
    }
}

/// Shows the name in an editable field; a change takes effect when the field loses the focus.
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
    // This includes a field that lost the focus while another view was displayed.
    if !edit.has_focus() && typed.is_some() {
        ui.data_mut(|data| data.remove::<String>(id));
        if name != run.name {
            effects.push(Effect::ChangeRuns(RunsRequest::Rename(run.id, name)));
        }
    }
}

/// Returns the settings of the run in one line: what every run has, and what is not usual.
fn conditions(setup: &Setup) -> String {
    let settings = setup.settings();
    let (hidden, method) = (settings.hidden, settings.training.method.short_name());
    let mut parts = vec![setup.source_name(), format!("{hidden} hidden"), method.to_owned()];
    parts.extend(
        settings
            .simulation()
            .map(|simulation| counted(simulation.samples, "sample")),
    );
    parts.push(format!("seed {}", settings.seed));
    let others = named_settings(settings).filter(|(.., is_usual)| !is_usual);
    let others = others.filter(|(name, ..)| !["hidden nodes", "method"].contains(name));
    parts.extend(others.map(|(name, value, _)| format!("{name} {value}")));
    parts.join(", ")
}
