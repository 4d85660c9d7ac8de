use std::{path::PathBuf, sync::Arc};

use ndarray::Array2;

use crate::{
    app::{
        shared::{RightCard, error_frame},
        test_view::{Frame, TestView},
    },
    evaluation::SimulatedSettings,
    export::{KeptRun, NetworkFile, Workspace},
};

/// The names of the two places.
pub const PLACES: [&str; 2] = ["A", "B"];

/// Everything the Compare view reads.
#[derive(Debug, Default)]
pub struct RunsState {
    /// The runs, and which two are compared.
    pub workspace: Workspace,
    /// What is drawn of the two, once it is prepared.
    pub compared: [Option<Compared>; 2],
    /// Snapshot of both test sets.
    pub snapshot: usize,
    /// What is shown of both networks.
    pub card: RightCard,
    /// The run that the user is asked about before it is removed.
    pub removing: Option<u64>,
    /// Where runs are kept; `None` while they are not.
    pub path: Option<PathBuf>,
}

/// A run as it is drawn.
#[derive(Clone, Debug)]
pub struct Compared {
    /// Which run.
    pub id: u64,
    /// Its test set.
    pub test: TestView,
    /// What its network makes of it: samples × 3·M2.
    pub decoupled_mm: Arc<Array2<f64>>,
    /// The snapshot on show: actual, decoupled, difference.
    pub frames: [Frame; 3],
}

impl Compared {
    /// Makes the frames of `snapshot`, or of the last one if there are fewer.
    pub fn show(&mut self, snapshot: usize) {
        let snapshot = self.test.nearest_snapshot(snapshot);
        let actual = self.test.frame(self.test.set.targets(), snapshot);
        let decoupled = self.test.frame(self.decoupled_mm.view(), snapshot);
        let error = error_frame(&actual, &decoupled);
        self.frames = [actual, decoupled, error];
    }
}

impl RunsState {
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

    /// How many snapshots the larger of the two test sets has.
    pub fn snapshots(&self) -> usize {
        let compared = self.compared.iter().flatten();
        compared
            .map(|compared| compared.test.snapshots.len())
            .max()
            .unwrap_or(0)
    }
}
