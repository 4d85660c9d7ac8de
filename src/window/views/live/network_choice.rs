use std::{
    path::PathBuf,
    sync::{
        Arc,
        mpsc::{Receiver, channel},
    },
};

use eframe::egui::{ComboBox, Ui};

use super::files::LiveFile;
use crate::window::{
    job::{Job, Wake},
    shared::{Effect, RunList},
    theme::space,
    widgets::{dim_ui, ghost_button, note_ui},
};
use decoupler_core::scene::Rows;
use decoupler_files::export::{NetworkFile, format_percent};

/// The network that decodes.
#[derive(Debug)]
pub struct NetworkChoice {
    pick: NetworkPick,
    file: Option<(String, Arc<NetworkFile>)>,
    problem: Option<String>,
    chosen: Option<Receiver<PathBuf>>,
    loading: Job<Result<(PathBuf, Box<NetworkFile>), String>>,
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
            file: None,
            problem: None,
            chosen: None,
            loading: Job::prompt("network file", wake),
        }
    }

    /// The network chosen and its name; `None` if there is none.
    pub fn network<'a>(&'a self, runs: &'a RunList) -> Option<(&'a str, &'a Arc<NetworkFile>)> {
        let run = match self.pick {
            NetworkPick::File => {
                let (name, file) = self.file.as_ref()?;
                return Some((name, file));
            }
            NetworkPick::Run(id) => runs.run(id),
            NetworkPick::Newest => None,
        };
        // A run that was removed gives way to the newest.
        let run = run.or(runs.workspace.runs.last())?;
        Some((&run.name, &run.file))
    }

    /// Decodes with this network, which is of no run.
    pub fn take(&mut self, name: &str, file: Arc<NetworkFile>) {
        self.problem = None;
        self.file = Some((name.to_owned(), file));
        self.pick = NetworkPick::File;
    }

    /// Takes the file that the user has opened; returns `true` once its network is there.
    pub fn take_events(&mut self) -> bool {
        if let Some(path) = self.chosen.as_ref().and_then(|chosen| chosen.try_recv().ok()) {
            self.chosen = None;
            self.loading.start(
                move |_| {
                    let file = NetworkFile::load(&path).map_err(|error| error.to_string())?;
                    Ok((path, Box::new(file)))
                },
                |loaded| loaded.unwrap_or_else(|error| Err(error.to_string())),
            );
        }
        match self.loading.next_event() {
            Some(Ok((path, file))) => {
                let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
                self.take(&name, Arc::from(file));
                true
            }
            Some(Err(reason)) => {
                self.problem = Some(reason);
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
        let shown = match (self.pick, self.network(runs)) {
            (NetworkPick::Run(id), Some((name, _))) if runs.run(id).is_some() => name.to_owned(),
            (NetworkPick::File, _) => file.clone().unwrap_or_default(),
            _ => newest.clone(),
        };
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
            let (array, error) = in_words(network);
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
        self.pick != before
    }
}

/// Array and rows of a network, and its error, each in a line.
fn in_words(file: &NetworkFile) -> (String, String) {
    let rows = file
        .settings
        .simulated()
        .map(|settings| match settings.source.scene.rows {
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
    let name = if file.problem.has_nodes { "Z error" } else { "Error" };
    (source, format!("{name} on its test set {error}"))
}
