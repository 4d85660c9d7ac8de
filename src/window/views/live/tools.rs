//! The tools: buttons, keys and names of the actions, the replay bar, and the exports.

use std::{fs::File, io, ops::RangeInclusive, sync::Arc};

use decoupler_core::problem::Channel;
use decoupler_files::{
    export::{Cell, Table, TableColumn, atomic_write, is_same},
    live::Recorded,
};
use eframe::egui::{Align, Label, Layout, RichText, Slider, Ui, Widget, WidgetInfo};

use super::{LiveView, cards::surface_figure, engine::Answered};
use crate::window::{
    glossary,
    shared::{Command, Effect, FileTask, FileWords, Offers, Shared, Shown},
    theme::{space, type_size},
    widgets::{dim_ui, ghost_button, primary_button, slider_ui},
};

/// Commands on a source, from right to left.
const COMMANDS: [Command; 5] = [
    Command::Cancel("Stop live decoding"),
    Command::Begin("Start live decoding"),
    Command::Record,
    Command::ReZero,
    Command::PlayReplay,
];

/// Returns the text of the button of a command.
fn button(command: &Command, view: &LiveView) -> &'static str {
    match command {
        Command::Cancel(_) => "■ Stop",
        Command::Begin(_) => "▶ Start",
        Command::Record if view.is_recording() => "■ End recording",
        Command::Record => "● Record",
        Command::ReZero => "Re-zero",
        _ if view.shown.replay.is_some_and(|replay| replay.is_playing) => "⏸ Pause",
        _ => "▶ Play",
    }
}

/// Returns the reason why a command is not available now, if there is one.
fn obstacle(command: &Command, view: &LiveView, shared: &Shared) -> Option<String> {
    let (is_running, is_replay) = (view.running.is_some(), view.shown.replay.is_some());
    let reason = match command {
        Command::Begin(_) if is_running => "Frames are being decoded.",
        Command::Begin(_) => return view.plan(shared).err(),
        _ if !is_running => "Start a source first.",
        Command::PlayReplay if !is_replay => "There is no replay.",
        Command::Record | Command::ReZero if !view.has_sensor(shared) => "This needs the sensor model of an array.",
        Command::Record if is_replay => "A replay cannot be recorded.",
        _ => return None,
    };
    Some(reason.to_owned())
}

fn carry_out(command: &Command, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    match command {
        // The thread ends once the sender of its commands is dropped; the last frame stays on the screen.
        Command::Cancel(_) => view.running = None,
        Command::Begin(_) => view.start(shared, effects),
        Command::Record => view.record(shared),
        Command::ReZero => view.re_zero(),
        _ => {
            let plays = view.shown.replay.is_some_and(|replay| !replay.is_playing);
            view.control(move |control, now| control.play(plays, now));
        }
    }
}

/// Shows the button of a command.
fn command_ui(ui: &mut Ui, command: &Command, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let (about, obstacle, text) = (command.about(), obstacle(command, view, shared), button(command, view));
    let hint = match about.keys {
        Some(keys) => format!("{} ({}).", about.name, ui.ctx().format_shortcut(&keys)),
        None => glossary::UNLOADED_STATE.hint.to_owned(),
    };
    let button = ui.add_enabled_ui(obstacle.is_none(), |ui| match command {
        Command::Begin(_) => primary_button(text).ui(ui),
        Command::PlayReplay => ui.add(ghost_button(text).min_size([space(18), space(6)].into())),
        Command::Record => ui.add(ghost_button(text).selected(view.is_recording())),
        _ => ui.add(ghost_button(text)),
    });
    let button = button.inner.on_hover_text(hint);
    if button.on_disabled_hover_text(obstacle.unwrap_or_default()).clicked() {
        carry_out(command, view, shared, effects);
    }
}

/// Shows the buttons that control the source, from right to left.
pub fn tools_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let count = if view.has_sensor(shared) { 4 } else { 2 };
    for command in &COMMANDS[..count] {
        command_ui(ui, command, view, shared, effects);
    }
}

/// Offers the commands on the source.
pub fn take_commands(view: &mut LiveView, offers: &mut Offers<'_>, shared: &Shared, effects: &mut Vec<Effect>) {
    for command in COMMANDS {
        if offers.offer(command.clone(), obstacle(&command, view, shared).is_none()) {
            carry_out(&command, view, shared, effects);
        }
    }
}

/// Height of the replay bar, in points.
pub const REPLAY_BAR_HEIGHT: f32 = space(12);

/// Shows the position in the recording and the speed.
pub fn replay_bar_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let Some(replay) = view.shown.replay else { return };
    if view.running.is_none() {
        ui.disable();
    }
    ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
        command_ui(ui, &Command::PlayReplay, view, shared, effects);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let text = RichText::new(format!("{:.1}×", view.source.speed)).size(type_size().note);
            ui.add_sized([space(8), space(6)], Label::new(text));
            if bar_slider_ui(ui, "Replay speed", (&mut view.source.speed, 1.0), 0.1..=10.0, space(24)) {
                view.steer();
            }
            dim_ui(ui, "Speed");
            ui.add_space(space(2));
            let text = format!("{:.2} of {:.2} s", replay.at_s, replay.length_s);
            ui.label(RichText::new(text).size(type_size().note));
            let mut at_s = replay.at_s;
            let (range, width) = (
                0.0..=replay.length_s.max(f64::MIN_POSITIVE),
                ui.available_width() - space(2),
            );
            if bar_slider_ui(ui, "Replay position", (&mut at_s, 0.0), range, width) {
                view.control(move |control, now| control.seek(at_s, now));
            }
        });
    });
}

/// Shows a slider that a double click resets to `usual`; returns true if its value has changed.
fn bar_slider_ui(
    ui: &mut Ui,
    name: &str,
    (value, usual): (&mut f64, f64),
    range: RangeInclusive<f64>,
    width: f32,
) -> bool {
    let before = *value;
    let is_logarithmic = *range.start() > 0.0;
    let slider = slider_ui(ui, Slider::new(value, range).logarithmic(is_logarithmic), width);
    if slider.double_clicked() {
        *value = usual;
    }
    slider.widget_info(|| WidgetInfo::slider(ui.is_enabled(), before, name));
    slider.on_hover_text("A double click resets it.");
    *value != before
}

/// Returns what the view shows: the surfaces, the readings and their recording, or the values over time.
pub fn shown<'a>(view: &'a LiveView, shared: &'a Shared) -> Vec<Shown<'a>> {
    let answer = view.shown.answer.as_deref();
    let answer = answer.ok_or_else(|| "There is no frame yet: start a source.".to_owned());
    let surface = answer.clone();
    let surface = surface.map(|answer| || surface_figure(answer, None, shared.look).into());
    let surface = Shown::figure("Surface", "live-surface".to_owned(), surface);
    if let Ok(answer) = &answer
        && let Some(chart) = &answer.chart
    {
        let (chart, values) = (Ok(|| chart.clone().into()), Ok(|| values_table(answer)));
        let chart = Shown::figure("Decoded values", "live-values".to_owned(), chart);
        let values = Shown::table("Decoded values", "live-values".to_owned(), values);
        let surface = (!answer.surfaces.is_empty()).then_some(surface);
        return [chart].into_iter().chain(surface).chain([values]).collect();
    }
    let readings = answer.and_then(|answer| answer.readings.as_ref().ok_or_else(String::new));
    let readings = readings.map(|readings| || readings.clone().coloured(shared.look.colours).into());
    let recorded = view.shown.recorded.as_ref().map(save_recording);
    let recorded = recorded.ok_or_else(|| "Nothing is recorded: press Record while a source runs.".to_owned());
    vec![
        surface,
        Shown::figure("Readings", "live-readings".to_owned(), readings),
        Shown::file("Recording", recorded),
    ]
}

fn values_table(answer: &Answered) -> Table {
    let names = answer.network.problem.targets.iter().map(Channel::title);
    let columns = std::iter::once("time_s".to_owned()).chain(names);
    let row = |(time_s, values): &(f64, Arc<[f64]>)| {
        let values = std::iter::once(time_s).chain(values.iter());
        values.map(|&value| Cell::from(value)).collect()
    };
    Table {
        columns: columns.map(TableColumn::field).collect(),
        rows: answer.history.all().iter().map(row).collect(),
    }
}

/// Saves a copy of a recording.
fn save_recording(recorded: &Recorded) -> FileTask {
    let words = FileWords {
        kind: "recording",
        description: "Every frame with its time, as CSV: a line for each row-wire. It can be replayed here, and the terminal \
                      command decode reads it.",
        extensions: &["csv"],
    };
    let from = recorded.path.clone();
    FileTask::save(words, "recording", move |path| match is_same(path, &from) {
        true => Ok(()),
        false => atomic_write(path, |file| io::copy(&mut File::open(&from)?, file).map(drop)),
    })
}
