//! The form on the left: the network that decodes, and the source of what it decodes.

use std::{
    ops::RangeInclusive,
    path::PathBuf,
    sync::{
        Arc,
        mpsc::{Sender, channel},
    },
};

use decoupler_core::{dataset::Simulation, scene::Rows};
use decoupler_files::{
    export::{NetworkFile, format_percent},
    live::{Motion, Source, SourcePlan},
};
use eframe::egui::{ComboBox, TextEdit, Ui, vec2};

use super::LiveView;
use crate::window::{
    shared::{Effect, FileTask, FileWords, Purpose, RunList, Shared},
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

/// Value of a field, which the user changes.
enum Value<'a> {
    Text(&'a mut String),
    Count(&'a mut usize, RangeInclusive<usize>),
    Quantity(&'a mut f64, RangeInclusive<f64>, &'static str),
}

/// Default noise of a reading of a real source if the network's scene has none.
const USUAL_NOISE: f64 = 1e-3;
/// Default noise of the simulated source if the network's scene has none: networks trained without noise amplify noise
/// strongly.
const SLIGHT_NOISE: f64 = 1e-5;

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
            SourceKind::Simulated => SLIGHT_NOISE,
            SourceKind::Replay | SourceKind::Serial | SourceKind::Tcp => USUAL_NOISE,
        };
        self.noise.unwrap_or(of_scene)
    }

    /// Returns the source. This is called in every frame and does not access the file system.
    ///
    /// # Errors
    /// If a field is empty or invalid, or there is no sensor to simulate, with what to do.
    pub fn plan(&self, has_sensor: bool) -> Result<SourcePlan, String> {
        let filled = |text: &str, todo: &str| match text.trim() {
            "" => Err(todo.to_owned()),
            text => Ok(text.to_owned()),
        };
        Ok(match self.kind {
            SourceKind::Simulated if !has_sensor => {
                let reason = "A network of a recording decodes a file, a serial port or a TCP address: there is no sensor \
                              model to simulate. Choose one of them as the source.";
                return Err(reason.to_owned());
            }
            SourceKind::Simulated => SourcePlan::Simulated(self.frames_per_second),
            SourceKind::Replay => {
                SourcePlan::Replay(filled(&self.path, "Choose a file of frames, or record one.")?.into())
            }
            SourceKind::Serial => {
                let todo = "Give the name of the serial port, for example /dev/ttyUSB0 or COM3.";
                let baud = u32::try_from(self.baud).unwrap_or(u32::MAX);
                SourcePlan::Stream(Source::Serial(filled(&self.port, todo)?, baud))
            }
            SourceKind::Tcp => {
                let todo = "Give the address as HOST:PORT, for example localhost:5000.";
                let source = format!("tcp:{}", filled(&self.address, todo)?).parse();
                SourcePlan::Stream(source.map_err(|error: <Source as std::str::FromStr>::Err| error.to_string())?)
            }
        })
    }

    /// Returns the fields of the chosen kind with their hints, and a note on what it sends.
    fn fields(&mut self, has_sensor: bool) -> (Vec<(&'static str, &'static str, Value<'_>)>, &'static str) {
        let either = |array, recording| if has_sensor { array } else { recording };
        let lines = either(
            "Lines of CSV: the number of the row-wire and its resistances in ohm, or a whole snapshot in one line, row by row.",
            "Lines of CSV: the inputs of the network in their order, after the number of the row-wire if there is a network for \
             each, or under their names in a header.",
        );
        match self.kind {
            SourceKind::Simulated => {
                let rate = Value::Quantity(&mut self.frames_per_second, 0.1..=10_000.0, "Hz");
                let hint = "Rate at which the simulated array is read.";
                (vec![("Frames per second", hint, rate)], "")
            }
            SourceKind::Replay => {
                let hint = either(
                    "CSV of frames: a recording made here, or lines of resistances in ohm as the terminal command decode \
                     reads them.",
                    "File with the inputs of the network under their names, such as the recording that it was trained on.",
                );
                let note = either(
                    "Frames without a column time_s are replayed at 50 per second.",
                    "Samples are replayed at their times or, without a time column, at 50 per second.",
                );
                (vec![("Frames", hint, Value::Text(&mut self.path))], note)
            }
            SourceKind::Serial => {
                let port = "Name of the port: /dev/ttyUSB0, /dev/ttyACM0, COM3.";
                let baud = "Bits per second, as set in the device: 8 data bits, no parity, 1 stop bit.";
                let fields = vec![
                    ("Port", port, Value::Text(&mut self.port)),
                    ("Baud", baud, Value::Count(&mut self.baud, 1..=100_000_000)),
                ];
                (fields, lines)
            }
            SourceKind::Tcp => {
                let hint = "Host and port of the sender, as HOST:PORT.";
                (vec![("Address", hint, Value::Text(&mut self.address))], lines)
            }
        }
    }

    fn noise_ui(&mut self, ui: &mut Ui, simulation: &Simulation) {
        let hint = match self.kind {
            SourceKind::Simulated => {
                "Noise of a simulated reading, relative to the reading (standard deviation). Fault detection uses it."
            }
            _ => {
                "Noise of a reading of your device, relative to the reading (standard deviation). Fault and contact \
                 detection use it: too small a value causes false alarms."
            }
        };
        let before = self.noise(simulation);
        let mut noise = before;
        quantity_ui(ui, "Relative noise", hint, &mut noise, 0.0..=1.0, "");
        if noise != before {
            self.noise = Some(noise);
        }
    }
}

fn value_ui(ui: &mut Ui, (name, hint, value): (&str, &str, Value<'_>)) {
    match value {
        Value::Count(count, range) => drop(count_ui(ui, name, hint, count, range)),
        Value::Quantity(quantity, range, unit) => drop(quantity_ui(ui, name, hint, quantity, range, unit)),
        Value::Text(text) => {
            let label = ui.label(name).on_hover_text(hint);
            let edit = TextEdit::singleline(text)
                .desired_width(f32::INFINITY)
                .margin(vec2(space(2), space(1)));
            ui.add(edit).labelled_by(label.id).on_hover_text(hint);
        }
    }
}

/// Shows the network and the source. Only the motion of the indenter can be changed while a source is running.
pub fn form_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    scrolled_ui(ui, "live form", |ui| {
        section_heading_ui(ui, "Network");
        network_ui(ui, view, shared, effects);
        section_heading_ui(ui, "Source");
        let simulation = view.network.network(&shared.runs).map(|(_, file)| file.problem.sensor);
        let has_sensor = simulation.is_none_or(|simulation| simulation.is_some());
        ui.add_enabled_ui(view.running.is_none(), |ui| {
            let kinds = [
                (SourceKind::Simulated, "Simulated"),
                (SourceKind::Replay, "Replay"),
                (SourceKind::Serial, "Serial"),
                (SourceKind::Tcp, "TCP"),
            ];
            let kinds = if has_sensor { &kinds[..] } else { &kinds[1..] };
            let source = &mut view.source;
            source.kind = segmented_ui(ui, "Source", kinds, source.kind, false).unwrap_or(source.kind);
            ui.add_space(space(1));
            let (fields, note) = source.fields(has_sensor);
            fields.into_iter().for_each(|field| value_ui(ui, field));
            if view.source.kind == SourceKind::Replay {
                open_ui(ui, view, LiveFile::Frames, effects);
            }
            if !note.is_empty() {
                dim_ui(ui, note);
            }
            if let Some(Some(simulation)) = &simulation {
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
                view.move_indenter();
            }
        }
        if let (Err(obstacle), true) = (view.plan(shared), simulation.is_some()) {
            ui.add_space(space(1));
            note_ui(ui, &obstacle);
        }
        ui.add_space(space(4));
    });
}

/// The network that decodes.
#[derive(Debug, Default)]
pub struct NetworkChoice {
    pick: Pick,
    /// The picked run.
    run: Option<Arc<NetworkFile>>,
    /// The file that was opened last, and its name.
    file: Option<(String, Arc<NetworkFile>)>,
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
    /// From a file of this name.
    File(String, Arc<NetworkFile>),
    /// That of the sample, with its recording.
    Sample(Arc<NetworkFile>, PathBuf),
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

    /// Decodes with this network of a run.
    pub fn take_run(&mut self, id: u64, file: Arc<NetworkFile>) {
        (self.pick, self.run) = (Pick::Run(id), Some(file));
    }

    /// Decodes with this network, which does not belong to a run.
    pub fn take_file(&mut self, name: String, file: Arc<NetworkFile>) {
        (self.pick, self.file) = (Pick::File, Some((name, file)));
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
        std::iter::once((Pick::Newest, newest))
            .chain(runs.map(|run| (Pick::Run(run.id), run.name.clone())))
            .chain(file)
            .collect()
    }
}

/// Shows the list of networks, and what the chosen one is.
fn network_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let runs = &shared.runs;
    let (picks, mut pick) = (view.network.picks(runs), view.network.pick);
    let shown = picks.iter().find(|(of, _)| *of == pick).unwrap_or(&picks[0]).1.clone();
    let width = ui.available_width();
    let label = ui.label("Decode with");
    let combo = ComboBox::from_id_salt("live network")
        .selected_text(shown)
        .width(width)
        .truncate();
    let combo = combo.show_ui(ui, |ui| {
        for (of, text) in picks {
            ui.selectable_value(&mut pick, of, text);
        }
    });
    let hint = "The network that decodes the frames: a finished run, or a network file. A replay is decoded again as soon as \
                another one is chosen.";
    combo.response.labelled_by(label.id).on_hover_text(hint);
    if let Some((_, network)) = view.network.network(runs) {
        for line in describe(network) {
            dim_ui(ui, &line);
        }
    }
    ui.add_space(space(1));
    open_ui(ui, view, LiveFile::Network, effects);
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

/// Describes a network in two lines: its array and rows, and its error.
fn describe(file: &NetworkFile) -> [String; 2] {
    let sensor = file.problem.sensor.as_ref();
    let rows = sensor.map(|simulation| match simulation.scene.rows {
        Rows::All => ", all rows".to_owned(),
        Rows::Known => ", known rows".to_owned(),
        Rows::One(row) => format!(", row {} alone", row + 1),
    });
    let (source, hidden) = (file.source_name(), file.settings.hidden);
    let error = format_percent(file.scores.network.percent());
    let name = if file.problem.has_nodes() { "Z error" } else { "Error" };
    [
        format!("{source}, {hidden} hidden{}", rows.unwrap_or_default()),
        format!("{name} on its test set {error}"),
    ]
}

/// A file that the user opens in the Live view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LiveFile {
    /// A network to decode with.
    Network,
    /// Frames to replay.
    Frames,
}

impl LiveFile {
    /// Asks for its path, which is sent to `chosen`.
    fn choose(self, chosen: Sender<PathBuf>) -> FileTask {
        let (words, suggestion) = match self {
            Self::Network => {
                let words = FileWords {
                    kind: "network",
                    description: "A network saved by the Train view or by train --out in a terminal.",
                    extensions: &["json"],
                };
                (words, "network.json")
            }
            Self::Frames => {
                let words = FileWords {
                    kind: "frames",
                    description: "A recording made here, or lines of resistances in ohm as the terminal command decode reads them.",
                    extensions: &["csv"],
                };
                (words, "recording.csv")
            }
        };
        FileTask {
            words,
            suggestion: suggestion.to_owned(),
            purpose: Purpose::Choose(chosen),
        }
    }
}

/// Shows the button that opens a file.
fn open_ui(ui: &mut Ui, view: &mut LiveView, file: LiveFile, effects: &mut Vec<Effect>) {
    let text = match file {
        LiveFile::Network => "Open network file…",
        LiveFile::Frames => "Choose file…",
    };
    let (send, chosen) = channel();
    let task = file.choose(send);
    let button = ui.add(ghost_button(text));
    if button.on_hover_text(task.words.description).clicked() {
        view.chosen = Some((file, chosen));
        effects.push(Effect::ChooseFile(task));
    }
}
