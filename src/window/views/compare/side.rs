use std::{path::Path, sync::Arc};

use decoupler_core::job::Job;
use decoupler_files::{
    export::NetworkFile,
    figure::{Decoded, PlotFigure, RegressionLine, regression_figure, surface::Surface},
};
use ndarray::Array2;

use crate::window::{
    job::{Background, Jobs},
    shared::{LoadedRun, sentence},
    test_view::TestView,
};

/// One side of the comparison.
#[derive(Debug)]
pub(super) struct Side {
    /// The run on this side.
    id: Option<u64>,
    /// Its test set with the answers, or why they are not available; `None` until they are ready.
    pub(super) compared: Option<Result<Compared, String>>,
    /// Target of a recording whose chart is shown.
    pub(super) target: usize,
    /// Work that prepares them; the newest run wins.
    job: Background<Result<Compared, String>>,
}

impl Side {
    pub(super) fn new(jobs: &Jobs) -> Self {
        Self {
            id: None,
            compared: None,
            target: 0,
            job: Background::new("compared run", jobs),
        }
    }

    /// Prepares `run` in the background if it is another one, and takes what is ready, to show it at `snapshot`.
    pub(super) fn follow(&mut self, run: Option<LoadedRun<'_>>, snapshot: usize) {
        let id = run.map(|run| run.id);
        if self.id != id {
            (self.id, self.compared) = (id, None);
            self.job.abandon();
            if let Some(run) = run {
                let file = Arc::clone(run.file);
                self.job.start(
                    move |report| Compared::new(&file, &Job::new(&|| report.is_cancelled())),
                    |prepared| {
                        let failed = |error| format!("The test samples of this run could not be prepared: {error}");
                        prepared.map_err(failed)?
                    },
                );
            }
        }
        if let Some(compared) = self.job.next_event() {
            self.compared = Some(compared);
            self.show(snapshot);
        }
    }

    /// Draws the surfaces of a snapshot, or of the last one if there are fewer.
    pub(super) fn show(&mut self, snapshot: usize) {
        if let Some(Ok(compared)) = &mut self.compared {
            let drawing = compared.test.drawing(Some(&compared.answers), snapshot);
            compared.surfaces = drawing.and_then(|drawing| drawing.decoded);
        }
    }

    /// Returns what is ready.
    pub(super) fn ready(&self) -> Option<&Compared> {
        self.compared.as_ref()?.as_ref().ok()
    }

    /// Returns the number of snapshots that can be drawn.
    pub(super) fn snapshots(&self) -> usize {
        let drawn = self.ready().filter(|compared| compared.surfaces.is_some());
        drawn.map_or(0, |compared| compared.test.snapshots())
    }

    /// Returns the chart of decoded against actual values of the chosen target, if the run has no surfaces.
    pub(super) fn chart(&self) -> Option<PlotFigure> {
        let Compared {
            test, answers, lines, ..
        } = self.ready().filter(|compared| compared.surfaces.is_none())?;
        let target = self.target;
        let (line, channel) = lines.get(target).zip(test.problem.targets.get(target))?;
        let pair = |sample| (test.set.targets()[[sample, target]], answers[[sample, target]]);
        let samples: (usize, &dyn Fn(usize) -> (f64, f64)) = (test.set.samples(), &pair);
        Some(regression_figure(samples, line, Decoded::Target(channel)))
    }
}

/// Test set of a run with the answers of its network.
#[derive(Debug)]
pub(super) struct Compared {
    pub(super) test: TestView,
    /// Samples × targets.
    answers: Array2<f64>,
    /// The decoded surface of the snapshot and its error, where there is one through the targets.
    pub(super) surfaces: Option<[Surface; 2]>,
    /// Regression lines of the targets.
    lines: Vec<RegressionLine>,
}

impl Compared {
    /// Simulates the test set of a run again, or reads it from the files of its recording.
    fn new(file: &NetworkFile, job: &Job<'_>) -> Result<Self, String> {
        let test = match &file.recorded {
            None => TestView::draw(&file.settings).map_err(|error| error.to_string())?,
            Some(recorded) => {
                if let [missing, ..] = recorded.missing()[..] {
                    return Err(format!(
                        "The recording '{}' no longer exists, so its test samples cannot be shown. Put the file back to \
                         see them; errors, loss and settings are kept with the run.",
                        missing.display()
                    ));
                }
                let sets = file.setup().sets(Path::new(""), job, &mut |_| ());
                let sets = sets.and_then(|sets| sets.check_saved(Some(recorded)).map(|()| sets));
                let set = sets.map_err(|error| sentence(&error.to_string()))?.sets.test;
                let (problem, order) = (Arc::new(file.problem.clone()), recorded.plan.test_order());
                TestView::new(set, problem, order).map_err(|error| error.to_string())?
            }
        };
        let answers = file.decoder().answers_to(&test.set);
        Ok(Self {
            surfaces: None,
            lines: test.charts(&answers).lines,
            test,
            answers,
        })
    }
}
