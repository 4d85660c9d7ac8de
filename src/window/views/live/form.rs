//! The form on the left: the network that decodes, and the source of what it decodes.

use std::{
    path::PathBuf,
    sync::{Arc, mpsc::channel},
};

use decoupler_core::{dataset::Simulation, scene::Rows};
use decoupler_files::{
    export::{NetworkFile, format_percent},
    live::{Motion, Source, SourceError, SourcePlan},
};
use eframe::egui::{ComboBox, TextEdit, Ui, vec2};

use super::LiveView;
use crate::window::{
    shared::{Effect, FileTask, FileWords, RunList, Shared},
    theme::space,
    widgets::{
        dim_ui,
        fields::{count_ui, quantity_ui},
        ghost_button, note_ui, scrolled_ui, section_heading_ui, segmented_ui,
    },
};

/// Form of the source.
#[derive(Debug)]
pub struct SourceForm {
    /// Kind of source.
    pub kind: SourceKind,
    /// Motion of the simulated indenter.
    pub motion: Motion,
    /// File to be replayed, as typed.
    pub path: String,
    /// Recorded seconds per second.
    pub speed: f64,
    frames_per_second: f64,
    /// Noise of a reading, if it differs from that of the network's scene.
    noise: Option<f64>,
    port: String,
    baud: usize,
    address: String,
}

/// Kind of source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SourceKind {
    /// Without hardware.
    Simulated,
    /// A recording, or another file of frames.
    Replay,
    /// A serial port.
    Serial,
    /// A socket.
    Tcp,
}

impl Default for SourceForm {
    fn default() -> Self {
        Self {
            kind: SourceKind::Simulated,
            motion: Motion::Wandering,
            path: String::new(),
            speed: 1.0,
            frames_per_second: 50.0,
            noise: None,
            port: "/dev/ttyUSB0".to_owned(),
            baud: 115_200,
            address: "localhost:5000".to_owned(),
        }
    }
}

impl SourceForm {
    /// Returns the noise of a reading, relative to the reading, for a network of this simulation.
    pub fn noise(&self, simulation: &Simulation) -> f64 {
        let noise = simulation.scene.noise.in_test();
        let of_scene = match self.kind {
            _ if !noise.is_none() => noise.relative,
            // Networks trained without noise amplify noise strongly.
            SourceKind::Simulated => 1e-5,
            SourceKind::Replay | SourceKind::Serial | SourceKind::Tcp => 1e-3,
        };
        self.noise.unwrap_or(of_scene)
    }

    /// Returns the source. This is called in every frame and does not access the file system.
    ///
    /// # Errors
    /// If a field is empty or invalid, or there is no sensor to simulate, with what to do.
    pub fn plan(&self, has_sensor: bool) -> Result<SourcePlan, String> {
        Ok(match self.kind {
            SourceKind::Simulated if has_sensor => SourcePlan::Simulated(self.frames_per_second),
            SourceKind::Simulated => {
                let reason = "A network of a recording decodes a file, a serial port or a TCP address: there is no sensor \
                              model to simulate. Choose one of them as the source.";
                return Err(reason.to_owned());
            }
            SourceKind::Replay if self.path.trim().is_empty() => {
                return Err("Choose a file of frames, or record one.".to_owned());
            }
            SourceKind::Replay => SourcePlan::Replay(self.path.trim().into()),
            SourceKind::Serial => {
                let baud = u32::try_from(self.baud).unwrap_or(u32::MAX);
                SourcePlan::Stream(Source::Serial(self.port.trim().to_owned(), baud))
            }
            SourceKind::Tcp => {
                let source = format!("tcp:{}", self.address.trim()).parse();
                SourcePlan::Stream(source.map_err(|error: SourceError| error.to_string())?)
            }
        })
    }

    /// Shows the fields of the chosen kind.
    fn fields_ui(&mut self, ui: &mut Ui) {
        let lines = "Lines of CSV. Of an array: the number of the row-wire and its resistances in ohm, or a whole snapshot in \
                     one line, row by row. Of another sensor: the inputs of the network in their order, or under their names \
                     in a header.";
        match self.kind {
            SourceKind::Simulated => {
                let (hint, rate) = (
                    "Rate at which the simulated array is read.",
                    &mut self.frames_per_second,
                );
                quantity_ui(ui, "Frames per second", hint, rate, 0.1..=10_000.0, "Hz");
            }
            SourceKind::Replay => text_ui(ui, "Frames", FRAMES.description, &mut self.path),
            SourceKind::Serial => {
                let hint = "Name of the port: /dev/ttyUSB0, /dev/ttyACM0, COM3.";
                text_ui(ui, "Port", hint, &mut self.port);
                let hint = "Bits per second, as set in the device: 8 data bits, no parity, 1 stop bit.";
                count_ui(ui, "Baud", hint, &mut self.baud, 1..=100_000_000);
                dim_ui(ui, lines);
            }
            SourceKind::Tcp => {
                let hint = "Host and port of the sender, as HOST:PORT.";
                text_ui(ui, "Address", hint, &mut self.address);
                dim_ui(ui, lines);
            }
        }
    }

    fn noise_ui(&mut self, ui: &mut Ui, simulation: &Simulation) {
        let hint = "Noise of a reading, simulated or of your device, relative to the reading (standard deviation). Fault and \
                    contact detection use it: too small a value causes false alarms.";
        let before = self.noise(simulation);
        let mut noise = before;
        quantity_ui(ui, "Relative noise", hint, &mut noise, 0.0..=1.0, "");
        if noise != before {
            self.noise = Some(noise);
        }
    }
}

fn text_ui(ui: &mut Ui, name: &str, hint: &str, text: &mut String) {
    let label = ui.label(name).on_hover_text(hint);
    let edit = TextEdit::singleline(text)
        .desired_width(f32::INFINITY)
        .margin(vec2(space(2), space(1)));
    ui.add(edit).labelled_by(label.id).on_hover_text(hint);
}

/// Shows the network and the source. Only the motion of the indenter can be changed while a source is running.
pub fn form_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    scrolled_ui(ui, "live form", |ui| {
        section_heading_ui(ui, "Network");
        network_ui(ui, view, shared, effects);
        section_heading_ui(ui, "Source");
        let simulation = view.network.network(&shared.runs).map(|(_, file)| file.problem.sensor);
        let has_sensor = view.has_sensor(shared);
        ui.add_enabled_ui(view.running.is_none(), |ui| {
            let kinds = [
                (SourceKind::Simulated, "Simulated"),
                (SourceKind::Replay, "Replay"),
                (SourceKind::Serial, "Serial"),
                (SourceKind::Tcp, "TCP"),
            ];
            let kinds = if has_sensor { &kinds[..] } else { &kinds[1..] };
            let kind = view.source.kind;
            view.source.kind = segmented_ui(ui, "Source", kinds, kind, false).unwrap_or(kind);
            ui.add_space(space(1));
            view.source.fields_ui(ui);
            if view.source.kind == SourceKind::Replay {
                open_ui(ui, view, "Choose file…", FRAMES, effects);
                dim_ui(ui, "Frames and samples without times are replayed at 50 per second.");
            }
            if let Some(simulation) = simulation.as_ref().and_then(Option::as_ref) {
                view.source.noise_ui(ui, simulation);
            }
        });
        if view.source.kind == SourceKind::Simulated && has_sensor {
            let motions = [
                (Motion::Wandering, "Wander"),
                (Motion::Held, "Hold"),
                (Motion::Lifted, "Lift"),
            ];
            ui.label("Indenter");
            if let Some(motion) = segmented_ui(ui, "Indenter", &motions, view.source.motion, true) {
                view.source.motion = motion;
                view.steer();
            }
        }
        if let (Err(obstacle), Some(_)) = (view.plan(shared), simulation) {
            ui.add_space(space(1));
            note_ui(ui, &obstacle);
        }
        ui.add_space(space(4));
    });
}

/// The network that decodes.
#[derive(Debug, Default)]
pub struct NetworkChoice {
    /// Its place.
    pub pick: Pick,
    /// The picked run.
    pub run: Option<Arc<NetworkFile>>,
    /// The file that was opened last, and its name.
    pub file: Option<(String, Arc<NetworkFile>)>,
}

/// Place of the network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pick {
    /// The newest run of the list.
    #[default]
    Newest,
    /// The run with this number.
    Run(u64),
    /// The file that was opened.
    File,
}

/// A network that was read for this view.
#[derive(Debug)]
pub enum Loaded {
    /// Of the run with this number.
    Run(u64, Arc<NetworkFile>),
    /// From a file of this name; that of the sample with its recording.
    File(String, Arc<NetworkFile>, Option<PathBuf>),
}

impl NetworkChoice {
    /// Returns the chosen network and its name; `None` if there is none.
    pub fn network<'a>(&'a self, runs: &'a RunList) -> Option<(&'a str, &'a Arc<NetworkFile>)> {
        let picked = match self.pick {
            Pick::File => self.file.as_ref().map(|(name, file)| (&**name, file)),
            Pick::Run(id) => runs.run(id).map(|run| &*run.name).zip(self.run.as_ref()),
            Pick::Newest => None,
        };
        // A run that was removed is replaced by the newest.
        picked.or_else(|| runs.newest().map(|run| (run.name, run.file)))
    }

    /// Returns the networks that can be picked, with their texts.
    fn picks(&self, runs: &RunList) -> Vec<(Pick, String)> {
        let newest = runs.workspace.runs.last();
        let newest = newest.map_or_else(|| "no run yet".to_owned(), |run| format!("Newest run: {}", run.name));
        let file = self
            .file
            .as_ref()
            .map(|(name, _)| (Pick::File, format!("File: {name}")));
        let runs = runs.workspace.runs.iter().rev();
        let runs = runs.map(|run| (Pick::Run(run.id), run.name.clone()));
        std::iter::once((Pick::Newest, newest))
            .chain(runs)
            .chain(file)
            .collect()
    }
}

/// Shows the list of networks, and what the chosen one is.
fn network_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let runs = &shared.runs;
    let (picks, mut pick) = (view.network.picks(runs), view.network.pick);
    let shown = picks.iter().find(|(of, _)| *of == pick).unwrap_or(&picks[0]);
    let width = ui.available_width();
    let label = ui.label("Decode with");
    let combo = ComboBox::from_id_salt("live network")
        .selected_text(&shown.1)
        .width(width)
        .truncate();
    let combo = combo.show_ui(ui, |ui| {
        for (of, text) in &picks {
            ui.selectable_value(&mut pick, *of, text);
        }
    });
    let hint = "The network that decodes the frames: a finished run, or a network file. A replay is decoded again as soon as \
                another one is chosen.";
    combo.response.labelled_by(label.id).on_hover_text(hint);
    if let Some((_, file)) = view.network.network(runs) {
        let rows = file
            .problem
            .sensor
            .as_ref()
            .map(|simulation| match simulation.scene.rows {
                Rows::All => ", all rows".to_owned(),
                Rows::Known => ", known rows".to_owned(),
                Rows::One(row) => format!(", row {} alone", row + 1),
            });
        let (source, hidden) = (file.source_name(), file.settings.hidden);
        dim_ui(ui, &format!("{source}, {hidden} hidden{}", rows.unwrap_or_default()));
        let name = if file.problem.has_nodes() { "Z error" } else { "Error" };
        let error = format_percent(file.scores.network.percent());
        dim_ui(ui, &format!("{name} on its test set {error}"));
    }
    ui.add_space(space(1));
    open_ui(ui, view, "Open network file…", NETWORK, effects);
    match pick {
        _ if pick == view.network.pick => {}
        Pick::Run(id) => {
            let (run, folder) = (runs.run(id).cloned(), runs.path.clone().unwrap_or_default());
            view.load(move || {
                let run = run.ok_or("the run was removed")?;
                Ok(Loaded::Run(id, run.load(&folder).map_err(|error| error.to_string())?))
            });
        }
        Pick::Newest | Pick::File => {
            view.network.pick = pick;
            view.restart(shared);
        }
    }
}

/// A network to decode with.
pub const NETWORK: FileWords = FileWords {
    kind: "network",
    description: "A network saved by the Train view or by train --out in a terminal.",
    extensions: &["json"],
};

/// Frames to replay.
const FRAMES: FileWords = FileWords {
    kind: "frames",
    description: "A recording made here, lines of resistances in ohm as the terminal command decode reads them, or for a network \
                  of a recording a file with its inputs under their names.",
    extensions: &["csv"],
};

/// Shows the button that opens a file.
fn open_ui(ui: &mut Ui, view: &mut LiveView, text: &str, words: FileWords, effects: &mut Vec<Effect>) {
    if ui.add(ghost_button(text)).on_hover_text(words.description).clicked() {
        let (send, chosen) = channel();
        view.chosen = Some((words, chosen));
        let suggestion = format!("{}.{}", words.kind, words.extensions[0]);
        effects.push(Effect::ChooseFile(FileTask::choose(words, &suggestion, send)));
    }
}
