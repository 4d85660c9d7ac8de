use std::{path::PathBuf, sync::Arc};

use crate::{
    evaluation::SimulatedSettings,
    export::{KeptRun, NetworkFile, Workspace},
};

/// The names of the two places.
pub const PLACES: [&str; 2] = ["A", "B"];

/// The finished trainings.
#[derive(Debug, Default)]
pub struct RunList {
    /// The runs, and which two are compared.
    pub workspace: Workspace,
    /// Whether the thread that keeps them has ended, which the user was told.
    pub has_worker_died: bool,
    /// Where runs are kept; `None` while they are not.
    pub path: Option<PathBuf>,
}

impl RunList {
    /// The run with this number.
    pub fn run(&self, id: u64) -> Option<&KeptRun> {
        self.workspace.runs.iter().find(|run| run.id == id)
    }

    /// The run in one of the two places.
    pub fn pinned(&self, place: usize) -> Option<&KeptRun> {
        self.run(self.workspace.pinned[place]?)
    }

    /// A run of these contents, not yet in the list.
    pub fn new_run(&self, file: Arc<NetworkFile>) -> KeptRun {
        let largest = self.workspace.runs.iter().map(|run| run.id).max();
        KeptRun {
            id: largest.unwrap_or(0) + 1,
            name: self.new_name(&file.settings),
            file,
        }
    }

    /// Array, hidden nodes and method; numbered if there is such a name.
    fn new_name(&self, settings: &SimulatedSettings) -> String {
        let method = settings.training.method.short_name();
        let name = format!("{} h{} {method}", settings.source.sensor.scale, settings.hidden);
        let is_taken = |name: &str| self.workspace.runs.iter().any(|run| run.name == name);
        let numbered = (2..).map(|number| format!("{name} ({number})"));
        let mut names = std::iter::once(name.clone()).chain(numbered);
        names.find(|name| !is_taken(name)).unwrap_or(name)
    }
}
