use std::sync::Arc;

use crate::window::{
    job::{Job, JobError, Wake},
    shared::{RunResult, RunView, Shared},
    test_view::TestSet,
    training_worker::RunId,
};
use decoupler_core::{
    evaluation::{PastNetworks, Source, TestErrors},
    network::Networks,
};

/// Time of a replay, in seconds.
const REPLAY_SECONDS: f64 = 6.0;

/// The displayed past epoch, if one is.
#[derive(Debug)]
pub struct ScrubState {
    /// The training that it is of.
    of: Option<RunId>,
    /// The epoch wished for; `None` for the latest.
    wanted: Option<usize>,
    /// Result of the network of an epoch.
    result: Option<RunResult>,
    job: Job<Result<Option<RunResult>, JobError>>,
    /// When the replay began, in seconds, and at which epoch.
    replay: Option<(f64, usize)>,
}

impl ScrubState {
    /// On the latest epoch. `wake` is called when a result is there.
    pub fn new(wake: Wake) -> Self {
        Self {
            of: None,
            wanted: None,
            result: None,
            job: Job::prompt("past network", wake),
            replay: None,
        }
    }

    /// The result of the displayed past epoch; `None` while the latest is.
    pub fn result(&self) -> Option<&RunResult> {
        self.result.as_ref().filter(|_| self.wanted.is_some())
    }

    /// The epoch wished for; `None` for the latest.
    pub fn epoch(&self) -> Option<usize> {
        self.wanted
    }

    /// Returns true while epochs follow each other.
    pub fn is_replaying(&self) -> bool {
        self.replay.is_some()
    }

    /// Shows the network of the epoch at or before this one.
    pub fn show(&mut self, epoch: usize, past: &PastNetworks) {
        let latest = past.epochs().next_back();
        self.wanted = past.nearest(epoch).filter(|epoch| Some(*epoch) != latest);
    }

    /// Shows the latest network again.
    pub fn show_latest(&mut self) {
        (self.wanted, self.replay) = (None, None);
    }

    /// Replays from the displayed epoch, or from the first one; or stops there.
    pub fn toggle_replay(&mut self, now_seconds: f64, past: &PastNetworks) {
        self.replay = match self.replay {
            Some(_) => None,
            None => {
                let begin = self.wanted.or_else(|| past.epochs().next());
                begin.map(|epoch| (now_seconds, epoch))
            }
        };
    }

    /// Shows the epoch that the replay has come to. Early epochs change most, so it runs by their logarithm.
    pub fn replay(&mut self, now_seconds: f64, past: &PastNetworks) {
        let (Some((begun, first)), Some(last)) = (self.replay, past.epochs().next_back()) else {
            return;
        };
        let share = (now_seconds - begun) / REPLAY_SECONDS;
        if share >= 1.0 {
            return self.show_latest();
        }
        let [first, last] = [first, last].map(|epoch| (epoch as f64).ln_1p());
        let epoch = (first + share.max(0.0) * (last - first)).exp_m1();
        self.show(epoch.round() as usize, past);
    }

    /// Leaves an epoch of another training, and computes what the one wished for makes of the test set.
    pub fn follow(&mut self, shared: &Shared) {
        let run = shared.shown_run();
        let id = run.map(|run| run.id);
        if self.of != id {
            self.show_latest();
            self.job.abandon();
            (self.of, self.result) = (id, None);
        }
        while let Some(computed) = self.job.next_event() {
            match computed {
                Ok(Some(result)) => self.result = Some(result),
                // A defect in the program, or an epoch thinned out meanwhile.
                Ok(None) | Err(_) => self.show_latest(),
            }
        }
        let Some((run, wanted)) = run.zip(self.wanted) else {
            return;
        };
        // It may have been thinned out meanwhile.
        self.show(wanted, &run.past);
        let Some(epoch) = self.wanted else { return };
        let is_there = self.result.as_ref().is_some_and(|result| result.epochs_run == epoch);
        if !is_there && !self.job.is_under_way() {
            self.compute(run, epoch);
        }
    }

    fn compute(&mut self, run: &RunView, epoch: usize) {
        let Some(present) = &run.result else { return };
        let (past, networks, test) = (run.past.clone(), Arc::clone(&present.networks), run.test.clone());
        let (is_idle, source) = (present.is_idle, run.settings().source);
        // The displayed surface is laid there too, as with the training's own results.
        let snapshot = present.frame.as_ref().map_or(0, |(snapshot, _)| *snapshot);
        self.job.start(
            move |_| {
                let result = result_at(epoch, &past, &networks, &source, &test)?;
                let array = test.array();
                let recording = test.recording();
                Some(RunResult {
                    is_idle,
                    frame: array.map(|test| (snapshot, test.frame(result.answers.view(), snapshot))),
                    charts: recording.map(|test| Arc::new(test.charts(&result.answers))),
                    ..result
                })
            },
            |computed| computed,
        );
    }
}

fn result_at(
    epoch: usize,
    past: &PastNetworks,
    present: &Networks,
    source: &Source,
    test: &TestSet,
) -> Option<RunResult> {
    let past = past.at(epoch, present)?;
    let (networks, best_epoch) = (past.networks, past.best_epoch);
    let answers = networks.decouple(test.set());
    Some(RunResult {
        errors: TestErrors::measure(source, test.set(), &answers),
        answers: Arc::new(answers),
        frame: None,
        charts: None,
        remarks: Vec::new(),
        best_epoch,
        defect: None,
        epochs_run: epoch,
        starts_ended: 0,
        wall_time: None,
        frame_time: None,
        is_idle: true,
        networks: Arc::new(networks),
    })
}
