use std::path::PathBuf;

use decoupler_files::export::{KeptRun, KeptRuns};

/// The names of the two places.
pub const PLACES: [&str; 2] = ["A", "B"];

/// The finished trainings.
#[derive(Debug, Default)]
pub struct RunList {
    /// The runs, and which two are compared.
    pub workspace: KeptRuns,
    /// Folder in which runs are kept; `None` while they are not.
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
}
