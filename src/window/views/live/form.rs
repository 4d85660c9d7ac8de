//! The form on the left: the network that decodes, and the source of what it decodes.

use std::{
    path::Path,
    sync::{Arc, mpsc::channel},
};

use decoupler_core::{dataset::Simulation, scene::Rows};
use decoupler_files::{
    export::{NetworkFile, format_percent},
    live::{Source, SourceError, SourcePlan},
};
use eframe::egui::{ComboBox, PopupCloseBehavior, TextEdit, Ui, WidgetInfo, accesskit::Role, vec2};

use super::LiveView;
use crate::window::{
    shared::{Effect, FileTask, FileWords, Shared},
    theme::space,
    widgets::{
        dim_ui,
        fields::{count_ui, percent_ui, quantity_ui},
        ghost_button, scrolled_ui, section_heading_ui, segmented_ui,
    },
};

/// Form of the source.
#[derive(Debug)]
pub struct SourceForm {
    /// Kind of source.
    pub kind: SourceKind,
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
        let is_simulated = self.kind == SourceKind::Simulated;
        // Networks trained without noise amplify noise strongly.
        let usual = if is_simulated { 1e-5 } else { 1e-3 };
        let of_scene = if noise.is_none() { usual } else { noise.relative };
        self.noise.unwrap_or(of_scene)
    }

    /// Returns the source. This is called in every frame and does not access the file system.
    ///
    /// # Errors
    /// If a field is empty or invalid, with what to do.
    pub fn plan(&self) -> Result<SourcePlan, String> {
        Ok(match self.kind {
            SourceKind::Simulated => SourcePlan::Simulated(self.frames_per_second),
            SourceKind::Replay if self.path.trim().is_empty() => {
                return Err("Choose the file to replay.".to_owned());
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
                let hint = "Rate at which the simulated array is read.";
                let rate = &mut self.frames_per_second;
                quantity_ui(ui, "Frames per second", hint, rate, 0.1..=10_000.0, "Hz");
            }
            SourceKind::Replay => {
                text_ui(ui, "File to replay", FRAMES.description, &mut self.path);
                // The field shows only the beginning of a long path.
                let path = Path::new(self.path.trim());
                if let (Some(name), true) = (path.file_name(), path.is_absolute()) {
                    dim_ui(ui, &name.display().to_string());
                }
            }
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
}

fn text_ui(ui: &mut Ui, name: &str, hint: &str, text: &mut String) {
    let label = ui.label(name).on_hover_text(hint);
    let edit = TextEdit::singleline(text)
        .desired_width(f32::INFINITY)
        .margin(vec2(space(2), space(1)));
    ui.add(edit).labelled_by(label.id).on_hover_text(hint);
}

/// Shows the network and the source, which cannot be changed while it is running.
pub fn form_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    scrolled_ui(ui, "live form", |ui| {
        section_heading_ui(ui, "Network");
        network_ui(ui, view, shared);
        section_heading_ui(ui, "Source");
        let simulation = view.network(shared).map(|(_, file)| file.problem.sensor);
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
                if ui.add(ghost_button("Choose file…")).on_hover_text(FRAMES.description).clicked() {
                    let (send, chosen) = channel();
                    view.chosen = Some(chosen);
                    effects.push(Effect::ChooseFile(FileTask::choose(FRAMES, "frames.csv", send)));
                }
                dim_ui(ui, "Frames and samples without times are replayed at 50 per second.");
            }
            if let Some(Some(simulation)) = &simulation {
                let hint = "Noise of a reading, simulated or of your device, relative to the reading (standard deviation). Fault \
                            and contact detection use it: too small a value causes false alarms.";
                let before = view.source.noise(simulation);
                let mut noise = before;
                percent_ui(ui, "Relative noise", hint, &mut noise, before, 0.0..=100.0);
                if noise != before {
                    view.source.noise = Some(noise);
                }
            }
        });
        ui.add_space(space(4));
    });
}

/// A network that is decoded with instead of the newest.
#[derive(Clone, Debug)]
pub struct Picked {
    /// Number of its run; `None` if it was opened from a file.
    pub run: Option<u64>,
    /// Its name.
    pub name: String,
    /// The network.
    pub file: Arc<NetworkFile>,
}

/// Shows the list of networks, and what the chosen one is.
fn network_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared) {
    let runs = shared.runs.workspace.runs.iter().rev();
    let newest = runs.clone().next();
    let newest = newest.map_or_else(|| "no run yet".to_owned(), |run| format!("Newest run: {}", run.name));
    let mut pick = view.picked.as_ref().map(|picked| picked.run);
    let (before, shown) = match &view.picked {
        Some(Picked { run: None, name, .. }) => (pick, format!("File: {name}")),
        Some(Picked { name, .. }) => (pick, name.clone()),
        None => (pick, newest.clone()),
    };
    let width = ui.available_width();
    let label = ui.label("Decode with");
    let combo = ComboBox::from_id_salt("live network").selected_text(shown).width(width);
    let combo = combo.close_behavior(PopupCloseBehavior::CloseOnClickOutside).truncate();
    let combo = combo.show_ui(ui, |ui| {
        let field = TextEdit::singleline(&mut view.search).hint_text("Search runs");
        let field = ui.add(field.desired_width(f32::INFINITY));
        field.widget_info(|| WidgetInfo::labeled(Role::SearchInput, true, "Search runs"));
        let words = view.search.to_lowercase();
        let mut picked = ui.selectable_value(&mut pick, None, newest).clicked();
        for run in runs.filter(|run| run.name.to_lowercase().contains(&words)) {
            picked |= ui.selectable_value(&mut pick, Some(Some(run.id)), &run.name).clicked();
        }
        if picked {
            view.search.clear();
            ui.close();
        }
    });
    let hint = "The network that decodes the frames: a finished run, or a network file that was opened. A replay is decoded \
                again as soon as another one is chosen.";
    combo.response.labelled_by(label.id).on_hover_text(hint);
    if let Some((_, file)) = view.network(shared) {
        let row = match file.problem.sensor.map(|simulation| simulation.scene.rows) {
            Some(Rows::One(row)) => format!(", row {} alone", row + 1),
            _ => String::new(),
        };
        let (source, hidden) = (file.source_name(), file.settings.hidden);
        dim_ui(ui, &format!("{source}, {hidden} hidden nodes{row}"));
        let name = if file.problem.has_nodes() { "Z error" } else { "Error" };
        let error = format_percent(file.scores.network.percent());
        dim_ui(ui, &format!("{name} on its test set {error}"));
    }
    if pick != before {
        view.pick(pick.flatten(), shared);
    }
}

/// Frames to replay.
const FRAMES: FileWords = FileWords {
    kind: "frames",
    description: "A recording made here, lines of resistances in ohm as the terminal command decode reads them, or for a network \
                  of a recording a file with its inputs under their names.",
    extensions: &["csv"],
};
