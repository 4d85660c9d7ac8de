//! The toolbar, the replay bar, the actions and the files of the Live view.

use std::{
    fs::File,
    io,
    path::{Path, PathBuf},
    sync::{Arc, mpsc::Sender},
};

use decoupler_core::problem::Channel;
use decoupler_files::{
    export::{Cell, Table, TableColumn, WriteError, atomic_write},
    live::Recorded,
};
use eframe::egui::{Align, Button, Key, Label, Layout, RichText, Slider, Ui, WidgetInfo};

use super::{
    LiveView,
    cards::{figure_of, surface_figure},
    engine::LiveTargets,
    targets_card,
};
use crate::window::{
    glossary,
    shared::{Command, Effect, FileTask, FileWords, Offers, Shared, Shown},
    theme::{Theme, space, type_size},
    widgets::{dim_ui, ghost_button, primary_button, slider_ui, with_shortcut},
};

/// Shows the buttons that control the source, from right to left.
pub fn tools_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let is_running = view.running.is_some();
    let stop = ui.add_enabled(is_running, ghost_button("■ Stop"));
    if stop
        .on_hover_text(with_shortcut(ui, "Ends live decoding", Key::Period))
        .clicked()
    {
        view.stop();
    }
    let obstacle = view.obstacle(shared);
    let start = ui.add_enabled(!is_running && obstacle.is_none(), primary_button("▶ Start"));
    let why_not = obstacle.as_deref().unwrap_or("Frames are being decoded.");
    if start
        .on_hover_text(with_shortcut(
            ui,
            "Decodes the frames of the source as they arrive",
            Key::Enter,
        ))
        .on_disabled_hover_text(why_not)
        .clicked()
    {
        view.start(shared, effects);
    }
    ui.add_space(space(2));
    if !view.has_sensor(shared) {
        return;
    }
    record_ui(ui, view, shared);
    let zero = ui.add_enabled(is_running, ghost_button("Re-zero"));
    let hint = glossary::UNLOADED_STATE.hint;
    if zero.on_hover_text(hint).clicked() {
        view.re_zero();
    }
}

fn record_ui(ui: &mut Ui, view: &LiveView, shared: &Shared) {
    let is_recording = view.recording.is_some();
    let text = if is_recording {
        "■ End recording"
    } else {
        "● Record"
    };
    let mut button: Button<'_> = ghost_button(text);
    if is_recording {
        button = button.fill(Theme::of(ui).palette.selected);
    }
    let button = ui.add_enabled(view.can_record(), button);
    let why_not = if view.running.is_some() {
        "A replay cannot be recorded."
    } else {
        "Start a source first."
    };
    if button
        .on_hover_text(with_shortcut(
            ui,
            "Writes every frame with its time to a new file, as it arrives",
            Key::R,
        ))
        .on_disabled_hover_text(why_not)
        .clicked()
    {
        view.toggle_recording(shared);
    }
}

/// Offers the actions on the source.
pub fn offer_actions(view: &mut LiveView, offers: &mut Offers<'_>, shared: &Shared, effects: &mut Vec<Effect>) {
    let is_running = view.running.is_some();
    let can_start = !is_running && view.obstacle(shared).is_none();
    if offers.offer(Command::Begin("Start live decoding"), can_start) {
        view.start(shared, effects);
    }
    if offers.offer(Command::Cancel("Stop live decoding"), is_running) {
        view.stop();
    }
    if offers.offer(Command::Record, view.can_record()) {
        view.toggle_recording(shared);
    }
    if offers.offer(Command::ReZero, is_running && view.has_sensor(shared)) {
        view.re_zero();
    }
    let replay = view.shown.replay;
    let is_pressed = offers.offer(Command::PlayReplay, replay.is_some());
    if let Some(replay) = replay.filter(|_| is_pressed) {
        view.control(move |control, now| control.play(!replay.is_playing, now));
    }
}

/// Height of the replay bar, in points.
pub const REPLAY_BAR_HEIGHT: f32 = space(12);

/// Shows the position in the recording and the speed.
pub fn replay_bar_ui(ui: &mut Ui, view: &mut LiveView) {
    let Some(replay) = view.shown.replay else { return };
    let is_running = view.running.is_some();
    ui.add_enabled_ui(is_running, |ui| {
        ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
            let text = if replay.is_playing { "⏸ Pause" } else { "▶ Play" };
            let play = ui.add(ghost_button(text).min_size([space(18), space(6)].into()));
            if play
                .on_hover_text(with_shortcut(ui, "Plays or pauses the recording", Key::P))
                .clicked()
            {
                view.control(move |control, now| control.play(!replay.is_playing, now));
            }
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                speed_ui(ui, view);
                ui.add_space(space(2));
                let text = format!("{:.2} of {:.2} s", replay.at_s, replay.length_s);
                ui.label(RichText::new(text).size(type_size().note));
                let mut at_s = replay.at_s;
                let slider = Slider::new(&mut at_s, 0.0..=replay.length_s.max(f64::MIN_POSITIVE));
                let width = ui.available_width() - space(2);
                let slider = slider_ui(ui, slider, width);
                slider.widget_info(|| WidgetInfo::slider(is_running, replay.at_s, "Replay position"));
                if slider.double_clicked() {
                    view.control(|control, now| control.seek(0.0, now));
                } else if slider.changed() {
                    view.control(move |control, now| control.seek(at_s, now));
                }
            });
        });
    });
}

fn speed_ui(ui: &mut Ui, view: &mut LiveView) {
    let colour = Theme::of(ui).palette.text;
    let text = format!("{:.1}×", view.source.speed);
    ui.add_sized(
        [space(8), space(6)],
        Label::new(RichText::new(text).size(type_size().note).color(colour)),
    );
    let before = view.source.speed;
    let slider = Slider::new(&mut view.source.speed, 0.1..=10.0).logarithmic(true);
    let slider = slider_ui(ui, slider, space(24));
    if slider.double_clicked() {
        view.source.speed = 1.0;
    }
    slider.widget_info(|| WidgetInfo::slider(true, before, "Replay speed"));
    slider.on_hover_text("Recorded seconds per second, from 0.1 to 10. A double click sets it to 1.");
    if view.source.speed != before {
        let speed = view.source.speed;
        view.control(move |control, now| control.set_speed(speed, now));
    }
    dim_ui(ui, "Speed");
}

/// Returns what the view shows: pictures of the latest frame and the recording, or the values of a network of a recording.
pub fn shown<'a>(view: &'a LiveView, shared: &'a Shared) -> Vec<Shown<'a>> {
    if let Some(targets) = &view.shown.targets {
        let chart = Ok(|| targets_card::chart(targets).into());
        let mut shown = vec![Shown::figure("Decoded values", "live-values".to_owned(), chart)];
        if let Some(figure) = targets_card::surface_figure(targets, None, shared.look) {
            let surface = Ok(move || figure.clone().into());
            shown.push(Shown::figure("Surface", "live-surface".to_owned(), surface));
        }
        let values = Ok(|| values_table(targets));
        shown.push(Shown::table("Decoded values", "live-values".to_owned(), values));
        return shown;
    }
    let frame = view.shown.frame.as_ref();
    let frame = frame.ok_or_else(|| "There is no frame yet: start a source.".to_owned());
    let surface = frame
        .clone()
        .map(|frame| || surface_figure(frame, None, shared.look).into());
    let readings = frame.map(|frame| {
        || {
            figure_of(frame, view.drops.largest_percent())
                .coloured(shared.look.colours)
                .into()
        }
    });
    let recording = view.recorded.as_ref().map(save_recording);
    let recording = recording.ok_or_else(|| "Nothing is recorded: press Record while a source runs.".to_owned());
    vec![
        Shown::figure("Surface", "live-surface".to_owned(), surface),
        Shown::figure("Readings", "live-readings".to_owned(), readings),
        Shown::file("Recording", recording),
    ]
}

fn values_table(targets: &LiveTargets) -> Table {
    let names = targets.network.problem.targets.iter().map(Channel::title);
    let row = |(time_s, values): &(f64, Arc<[f64]>)| {
        let values = std::iter::once(time_s).chain(values.iter());
        values.map(|&value| Cell::from(value)).collect()
    };
    Table {
        columns: std::iter::once("time_s".to_owned())
            .chain(names)
            .map(TableColumn::field)
            .collect(),
        rows: targets.all.all().iter().map(row).collect(),
    }
}

const NETWORK: FileWords = FileWords {
    kind: "network",
    description: "A network saved by the Train view or by train --out in a terminal.",
    extensions: &["json"],
};

const FRAMES: FileWords = FileWords {
    kind: "frames",
    description: "A recording made here, or lines of resistances in ohm as the terminal command decode reads them.",
    extensions: &["csv"],
};

const RECORDING: FileWords = FileWords {
    kind: "recording",
    description: "Every frame with its time, as CSV: a line for each row-wire. It can be replayed here, and the \
                  terminal command decode reads it.",
    extensions: &["csv"],
};

/// A file that the user opens in the Live view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LiveFile {
    /// A network to decode with.
    Network,
    /// Frames to replay.
    Frames,
}

impl LiveFile {
    /// Returns the label of its button.
    pub fn button(self) -> &'static str {
        match self {
            Self::Network => "Open network file…",
            Self::Frames => "Choose file…",
        }
    }

    /// Returns its description.
    pub fn words(self) -> FileWords {
        match self {
            Self::Network => NETWORK,
            Self::Frames => FRAMES,
        }
    }

    /// Asks for its path, which is sent to `chosen`.
    pub fn choose(self, chosen: Sender<PathBuf>) -> FileTask {
        let suggestion = match self {
            Self::Network => "network.json",
            Self::Frames => "recording.csv",
        };
        FileTask::choose(self.words(), suggestion, chosen)
    }
}

/// Saves a copy of a recording.
pub fn save_recording(recorded: &Recorded) -> FileTask {
    let from = recorded.path.clone();
    let write = move |path: &Path| -> Result<(), WriteError> {
        // The chosen path may be that of the recording itself.
        let is_same = path
            .canonicalize()
            .ok()
            .is_some_and(|path| from.canonicalize().ok() == Some(path));
        if is_same {
            return Ok(());
        }
        atomic_write(path, |file| io::copy(&mut File::open(&from)?, file).map(drop))
    };
    FileTask::save(RECORDING, "recording", write)
}
