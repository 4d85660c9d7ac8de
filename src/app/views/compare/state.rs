use std::{fmt, sync::Arc};

use ndarray::Array2;

use crate::{
    app::{
        job::{Job, Wake},
        shared::{Effect, Matter, Notice, RightCard, RunList},
        test_view::{Frame, TestView},
    },
    export::NetworkFile,
};

/// The Compare view.
pub struct CompareView {
    /// Contents of the two places.
    pub places: [Place; 2],
    /// Snapshot of both test sets.
    pub snapshot: usize,
    /// Surface shown of both networks.
    pub card: RightCard,
    /// The run that the user is asked about before it is removed.
    pub removing: Option<u64>,
    /// Number of runs with which its places were last filled, until both are.
    pub(super) opened_with: Option<usize>,
    /// The node under the pointer, lit on both surfaces.
    pub node: Option<usize>,
    wake: Wake,
}

/// One of the two places.
#[derive(Debug, Default)]
pub struct Place {
    /// The run in it.
    id: Option<u64>,
    /// Surfaces of the run, once they are prepared.
    pub compared: Option<Compared>,
    /// Job that prepares them.
    job: Option<Job<Result<Box<Compared>, String>>>,
}

/// A run as it is drawn.
#[derive(Clone, Debug)]
pub struct Compared {
    /// Its test set.
    pub test: TestView,
    /// Coordinates that its network decodes: samples × 3·M2.
    pub decoupled_mm: Arc<Array2<f64>>,
    /// The snapshot on show: actual, decoupled, difference.
    pub frames: [Frame; 3],
}

/// Reason for which a run on a recording has no surfaces here.
const NO_SURFACES: &str = "Surfaces of recordings are shown in the Train view.";

impl Compared {
    fn new(file: &NetworkFile) -> Result<Self, String> {
        let settings = file.settings.simulated().ok_or(NO_SURFACES)?;
        let test = TestView::draw(&settings).map_err(|error| error.to_string())?;
        let decoupled_mm = Arc::new(file.network.decouple(&test.set));
        let mut compared = Self {
            test,
            decoupled_mm,
            frames: Default::default(),
        };
        compared.show(0);
        Ok(compared)
    }

    /// Makes the frames of `snapshot`, or of the last one if there are fewer.
    fn show(&mut self, snapshot: usize) {
        let snapshot = self.test.nearest_snapshot(snapshot);
        let actual = self.test.frame(self.test.set.targets(), snapshot);
        let decoupled = self.test.frame(self.decoupled_mm.view(), snapshot);
        let error = actual.error_of(&decoupled);
        self.frames = [actual, decoupled, error];
    }
}

impl CompareView {
    /// Nothing compared yet. `wake` is called when there is something to be drawn.
    pub fn new(wake: Wake) -> Self {
        Self {
            places: Default::default(),
            snapshot: 0,
            card: RightCard::default(),
            removing: None,
            opened_with: None,
            node: None,
            wake,
        }
    }

    /// Shows this snapshot of both test sets.
    pub(super) fn show_snapshot(&mut self, snapshot: usize) {
        self.snapshot = snapshot;
        for compared in self.places.iter_mut().filter_map(|place| place.compared.as_mut()) {
            compared.show(snapshot);
        }
    }

    /// Returns the number of snapshots of the larger of the two test sets.
    pub(super) fn snapshots(&self) -> usize {
        let compared = self.places.iter().filter_map(|place| place.compared.as_ref());
        compared
            .map(|compared| compared.test.snapshots.len())
            .max()
            .unwrap_or(0)
    }

    /// Fills empty places with the newest runs as the view opens, the older one first, and as runs arrive until both are
    /// filled.
    pub(super) fn fill_places(&mut self, runs: &RunList, effects: &mut Vec<Effect>) {
        let count = runs.workspace.runs.len();
        if self.opened_with.is_none_or(|seen| seen == count) {
            return;
        }
        let pinned = runs.workspace.pinned;
        let empty: Vec<usize> = (0..pinned.len()).filter(|&place| pinned[place].is_none()).collect();
        let others = runs.workspace.runs.iter().rev().map(|run| run.id);
        let others = others.filter(|id| !pinned.contains(&Some(*id)));
        let mut newest: Vec<u64> = others.take(empty.len()).collect();
        self.opened_with = (newest.len() < empty.len()).then_some(count);
        newest.reverse();
        let filled = empty.into_iter().zip(newest);
        effects.extend(filled.map(|(place, id)| Effect::PinRun(place, Some(id))));
    }

    /// Prepares what is to be drawn in the two places on threads, and takes what they have prepared.
    pub(super) fn follow(&mut self, runs: &RunList, effects: &mut Vec<Effect>) {
        for (number, place) in self.places.iter_mut().enumerate() {
            let run = runs.pinned(number);
            if place.id != run.map(|run| run.id) {
                *place = Place::default();
                if let Some(run) = run {
                    (place.id, place.job) = (Some(run.id), Some(prepare(&run.file, &self.wake)));
                }
            }
            let Some(prepared) = place.job.as_ref().and_then(Job::next_event) else {
                continue;
            };
            place.job = None;
            match prepared {
                Ok(mut compared) => {
                    if self.snapshot > 0 {
                        compared.show(self.snapshot);
                    }
                    place.compared = Some(*compared);
                }
                Err(reason) => {
                    effects.extend([
                        Effect::PinRun(number, None),
                        Effect::Tell(Matter::Comparison, Notice::Failed(reason)),
                    ]);
                }
            }
        }
    }
}

/// Draws the test set of a run and what its network makes of it, in the background.
fn prepare(file: &Arc<NetworkFile>, wake: &Wake) -> Job<Result<Box<Compared>, String>> {
    let mut job = Job::new("compared run", Arc::clone(wake));
    let file = Arc::clone(file);
    job.start(
        move |_| Compared::new(&file).map(Box::new),
        |prepared| {
            prepared.unwrap_or_else(|error| Err(format!("The surfaces of this run could not be prepared: {error}")))
        },
    );
    job
}

impl fmt::Debug for CompareView {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CompareView").finish_non_exhaustive()
    }
}
