use std::{
    path::PathBuf,
    sync::{
        Arc,
        mpsc::{Receiver, channel},
    },
};

use decoupler_core::{dataset::Simulation, scene::Rows};
use decoupler_files::{
    export::{NetworkFile, format_percent},
    live::{Motion, Source, SourcePlan},
};
use eframe::egui::{ComboBox, TextEdit, Ui, vec2};

use super::{LiveView, tools::LiveFile};
use crate::window::{
    job::{Background, Wake},
    shared::{Effect, RunList, Shared},
    theme::space,
    widgets::{
        dim_ui,
        fields::{count_ui, quantity_ui},
        ghost_button, note_ui, scrolled_ui, section_heading_ui, segmented_ui,
    },
};

/// Form of the source of the frames.
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
    chosen: Option<Receiver<PathBuf>>,
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
            chosen: None,
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
    /// If a field is empty or invalid, with what to do.
    pub fn plan(&self) -> Result<SourcePlan, String> {
        let filled = |text: &str, todo: &str| match text.trim() {
            "" => Err(todo.to_owned()),
            text => Ok(text.to_owned()),
        };
        Ok(match self.kind {
            SourceKind::Simulated => SourcePlan::Simulated(self.frames_per_second),
            SourceKind::Replay => {
                SourcePlan::Replay(filled(&self.path, "Choose a file of frames, or record one.")?.into())
            }
            SourceKind::Serial => SourcePlan::Stream(Source::Serial(
                filled(
                    &self.port,
                    "Give the name of the serial port, for example /dev/ttyUSB0 or COM3.",
                )?,
                u32::try_from(self.baud).unwrap_or(u32::MAX),
            )),
            SourceKind::Tcp => {
                let address = filled(
                    &self.address,
                    "Give the address as HOST:PORT, for example localhost:5000.",
                )?;
                let source: Result<Source, _> = format!("tcp:{address}").parse();
                SourcePlan::Stream(source.map_err(|error| error.to_string())?)
            }
        })
    }

    /// Takes the file that the user has chosen; returns `true` if there is one.
    pub fn take_events(&mut self) -> bool {
        let path = self.chosen.as_ref().and_then(|chosen| chosen.try_recv().ok());
        let Some(path) = path else { return false };
        self.chosen = None;
        self.path = path.display().to_string();
        true
    }

    /// Shows the form. `simulation` is that of the chosen network if it is of an array; `has_sensor` is false for a
    /// network of a recording. Only the motion of the indenter can be changed while a source is running.
    pub fn form_ui(
        &mut self,
        ui: &mut Ui,
        simulation: Option<&Simulation>,
        has_sensor: bool,
        is_running: bool,
        effects: &mut Vec<Effect>,
    ) {
        ui.add_enabled_ui(!is_running, |ui| {
            let kinds = [
                (SourceKind::Simulated, "Simulated"),
                (SourceKind::Replay, "Replay"),
                (SourceKind::Serial, "Serial"),
                (SourceKind::Tcp, "TCP"),
            ];
            let kinds = if has_sensor { &kinds[..] } else { &kinds[1..] };
            self.kind = segmented_ui(ui, "Source", kinds, self.kind, false).unwrap_or(self.kind);
            ui.add_space(space(1));
            match self.kind {
                SourceKind::Simulated => {
                    let hint = "Rate at which the simulated array is read.";
                    let rate = &mut self.frames_per_second;
                    quantity_ui(ui, "Frames per second", hint, rate, 0.1..=10_000.0, "Hz");
                }
                SourceKind::Replay => self.file_ui(ui, has_sensor, effects),
                SourceKind::Serial => {
                    let hint = "Name of the port: /dev/ttyUSB0, /dev/ttyACM0, COM3.";
                    text_ui(ui, "Port", hint, &mut self.port);
                    let hint = "Bits per second, as set in the device: 8 data bits, no parity, 1 stop bit.";
                    count_ui(ui, "Baud", hint, &mut self.baud, 1..=100_000_000);
                    dim_ui(ui, if has_sensor { LINES } else { INPUT_LINES });
                }
                SourceKind::Tcp => {
                    let hint = "Host and port of the sender, as HOST:PORT.";
                    text_ui(ui, "Address", hint, &mut self.address);
                    dim_ui(ui, if has_sensor { LINES } else { INPUT_LINES });
                }
            }
            self.noise_ui(ui, simulation);
        });
        if self.kind == SourceKind::Simulated && has_sensor {
            let motions = [
                (Motion::Wandering, "Wander"),
                (Motion::Held, "Hold"),
                (Motion::Lifted, "Lift"),
            ];
            ui.label("Indenter");
            self.motion = segmented_ui(ui, "Indenter", &motions, self.motion, true).unwrap_or(self.motion);
        }
    }

    fn noise_ui(&mut self, ui: &mut Ui, simulation: Option<&Simulation>) {
        let Some(simulation) = simulation else { return };
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

    fn file_ui(&mut self, ui: &mut Ui, has_sensor: bool, effects: &mut Vec<Effect>) {
        let hint = if has_sensor {
            "CSV of frames: a recording made here, or lines of resistances in ohm as the terminal command decode reads them."
        } else {
            "File with the inputs of the network under their names, such as the recording that it was trained on."
        };
        text_ui(ui, "Frames", hint, &mut self.path);
        let file = LiveFile::Frames;
        if ui
            .add(ghost_button(file.button()))
            .on_hover_text(file.words().description)
            .clicked()
        {
            let (send, chosen) = channel();
            self.chosen = Some(chosen);
            effects.push(Effect::ChooseFile(file.choose(send)));
        }
        dim_ui(
            ui,
            if has_sensor {
                "Frames without a column time_s are replayed at 50 per second."
            } else {
                "Samples are replayed at their times or, without a time column, at 50 per second."
            },
        );
    }
}

const LINES: &str = "Lines of CSV: the number of the row-wire and its resistances in ohm, or a whole snapshot in one \
                     line, row by row.";

const INPUT_LINES: &str = "Lines of CSV: the inputs of the network in their order, after the number of the row-wire if there is a \
                           network for each, or under their names in a header.";

fn text_ui(ui: &mut Ui, name: &str, hint: &str, text: &mut String) {
    let label = ui.label(name).on_hover_text(hint);
    let edit = TextEdit::singleline(text)
        .desired_width(f32::INFINITY)
        .margin(vec2(space(2), space(1)));
    ui.add(edit).labelled_by(label.id).on_hover_text(hint);
}

/// Shows the network, the source and the fault.
pub fn form_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    scrolled_ui(ui, "live form", |ui| {
        section_heading_ui(ui, "Network");
        let is_another = view.network.form_ui(ui, &shared.runs, effects);
        if is_another && view.running.is_some() {
            view.restart(shared);
        }
        section_heading_ui(ui, "Source");
        let network = view.network.network(&shared.runs).map(|(_, file)| file.clone());
        let simulation = network.as_ref().and_then(|file| file.problem.sensor);
        let motion = view.source.motion;
        let has_sensor = view.has_sensor(shared);
        view.source
            .form_ui(ui, simulation.as_ref(), has_sensor, view.running.is_some(), effects);
        let fault = view.fault;
        if let (SourceKind::Simulated, Some(simulation)) = (view.source.kind, &simulation) {
            let scale = simulation.sensor.scale;
            let read = simulation.scene.rows.read(scale.rows()).unwrap_or_default();
            view.fault.form_ui(ui, scale, &read);
        }
        if (view.source.motion, view.fault) != (motion, fault) {
            view.simulate(simulation.as_ref());
        }
        if let (Some(obstacle), true) = (view.obstacle(shared), network.is_some()) {
            ui.add_space(space(1));
            note_ui(ui, &obstacle);
        }
        ui.add_space(space(4));
    });
}

/// The network that decodes.
#[derive(Debug)]
pub struct NetworkChoice {
    pick: NetworkPick,
    /// The run that was picked, once it is loaded.
    run: Option<(u64, Arc<NetworkFile>)>,
    /// The file that was opened.
    file: Option<(String, Arc<NetworkFile>)>,
    problem: Option<String>,
    chosen: Option<Receiver<PathBuf>>,
    loading: Background<Result<Loaded, String>>,
}

/// A network that was read for this view.
enum Loaded {
    /// Of the run with this number.
    Run(u64, Arc<NetworkFile>),
    /// From a file of this name.
    File(String, Arc<NetworkFile>),
}

/// Place of the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum NetworkPick {
    /// The newest run of the list.
    Newest,
    /// The run with this number.
    Run(u64),
    /// The file that was opened.
    File,
}

impl NetworkChoice {
    /// The newest run.
    pub fn new(wake: Wake) -> Self {
        Self {
            pick: NetworkPick::Newest,
            run: None,
            file: None,
            problem: None,
            chosen: None,
            loading: Background::prompt("network file", wake),
        }
    }

    /// Returns the chosen network and its name; `None` if there is none, or it is still being read.
    pub fn network<'a>(&'a self, runs: &'a RunList) -> Option<(&'a str, &'a Arc<NetworkFile>)> {
        let picked = match self.pick {
            NetworkPick::File => return self.file.as_ref().map(|(name, file)| (&**name, file)),
            NetworkPick::Run(id) => runs.run(id),
            NetworkPick::Newest => None,
        };
        match picked {
            Some(run) => {
                let (_, file) = self.run.as_ref().filter(|(read, _)| *read == run.id)?;
                Some((&run.name, file))
            }
            // A run that was removed is replaced by the newest.
            None => runs.newest().map(|run| (run.name, run.file)),
        }
    }

    /// Reads the run that was just picked, if it is not in memory; returns `true` if it is.
    fn read_picked(&mut self, runs: &RunList) -> bool {
        self.problem = None;
        let NetworkPick::Run(id) = self.pick else { return true };
        let Some(run) = runs.run(id).cloned() else { return true };
        if let Some(file) = &run.file {
            self.run = Some((id, Arc::clone(file)));
            return true;
        }
        let folder = runs.path.clone().unwrap_or_default();
        self.load(move || Ok(Loaded::Run(id, run.load(&folder).map_err(|error| error.to_string())?)));
        false
    }

    fn load(&mut self, read: impl FnOnce() -> Result<Loaded, String> + Send + 'static) {
        self.problem = None;
        self.loading.start(
            move |_| read(),
            |read| read.unwrap_or_else(|error| Err(error.to_string())),
        );
    }

    /// Decodes with this network, which does not belong to a run.
    pub fn take(&mut self, name: &str, file: Arc<NetworkFile>) {
        self.problem = None;
        self.file = Some((name.to_owned(), file));
        self.pick = NetworkPick::File;
    }

    /// Reads the file that the user has opened; returns `true` once another network is loaded.
    pub fn take_events(&mut self) -> bool {
        if let Some(path) = self.chosen.as_ref().and_then(|chosen| chosen.try_recv().ok()) {
            self.chosen = None;
            self.load(move || {
                let file = NetworkFile::load(&path).map_err(|error| error.to_string())?;
                let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
                Ok(Loaded::File(name.into_owned(), Arc::new(file)))
            });
        }
        match self.loading.next_event() {
            Some(Ok(Loaded::Run(id, file))) => {
                self.run = Some((id, file));
                self.pick == NetworkPick::Run(id)
            }
            Some(Ok(Loaded::File(name, file))) => {
                self.take(&name, file);
                true
            }
            Some(Err(reason)) => {
                self.problem = Some(reason);
                let read = self.run.as_ref().map(|(id, _)| NetworkPick::Run(*id));
                if matches!(self.pick, NetworkPick::Run(_)) && read != Some(self.pick) {
                    self.pick = NetworkPick::Newest;
                }
                false
            }
            None => false,
        }
    }

    /// Shows the list of networks; returns `true` if another one is chosen.
    pub fn form_ui(&mut self, ui: &mut Ui, runs: &RunList, effects: &mut Vec<Effect>) -> bool {
        let before = self.pick;
        let newest = runs.workspace.runs.last();
        let newest = newest.map_or_else(|| "no run yet".to_owned(), |run| format!("Newest run: {}", run.name));
        let file = self.file.as_ref().map(|(name, _)| format!("File: {name}"));
        let shown = match self.pick {
            NetworkPick::Newest => None,
            NetworkPick::Run(id) => runs.run(id).map(|run| run.name.clone()),
            NetworkPick::File => file.clone(),
        };
        let shown = shown.unwrap_or_else(|| newest.clone());
        let width = ui.available_width();
        let label = ui.label("Decode with");
        let combo = ComboBox::from_id_salt("live network")
            .selected_text(shown)
            .width(width)
            .truncate();
        let combo = combo.show_ui(ui, |ui| {
            ui.selectable_value(&mut self.pick, NetworkPick::Newest, newest);
            for run in runs.workspace.runs.iter().rev() {
                ui.selectable_value(&mut self.pick, NetworkPick::Run(run.id), &run.name);
            }
            if let Some(file) = file {
                ui.selectable_value(&mut self.pick, NetworkPick::File, file);
            }
        });
        let hint = "The network that decodes the frames: a finished run, or a network file. A replay is decoded again as \
                    soon as another one is chosen.";
        combo.response.labelled_by(label.id).on_hover_text(hint);
        if let Some((_, network)) = self.network(runs) {
            let (array, error) = describe_network(network);
            dim_ui(ui, &array);
            dim_ui(ui, &error);
        }
        ui.add_space(space(1));
        let file = LiveFile::Network;
        let button = ui.add(ghost_button(file.button()));
        if button.on_hover_text(file.words().description).clicked() {
            let (send, chosen) = channel();
            self.chosen = Some(chosen);
            effects.push(Effect::ChooseFile(file.choose(send)));
        }
        if let Some(problem) = &self.problem {
            note_ui(ui, problem);
        }
        self.pick != before && self.read_picked(runs)
    }
}

/// Describes a network in two lines: its array and rows, and its error.
fn describe_network(file: &NetworkFile) -> (String, String) {
    let sensor = file.problem.sensor.as_ref();
    let rows = sensor.map(|simulation| match simulation.scene.rows {
        Rows::All => ", all rows".to_owned(),
        Rows::Known => ", known rows".to_owned(),
        Rows::One(row) => format!(", row {} alone", row + 1),
    });
    let source = format!(
        "{}, {} hidden{}",
        file.source_name(),
        file.settings.hidden,
        rows.unwrap_or_default()
    );
    let error = format_percent(file.scores.network.percent());
    let name = if file.problem.has_nodes() { "Z error" } else { "Error" };
    (source, format!("{name} on its test set {error}"))
}
