//! Scrubbing: the networks of past epochs, selected with a slider under the loss curves or replayed one after the other.
//! Their results on the test set are computed in the background; the latest request wins.

use std::{sync::Arc, time::Duration};

use decoupler_core::{decoupling::ProgramDecoder, evaluation::TestErrors, network::Networks, problem::Problem};
use eframe::egui::{Align, Layout, RichText, Slider, Ui, Vec2, WidgetInfo, accesskit::Role};

use crate::window::{
    job::{Background, JobError, Wake},
    shared::{RunResult, RunView, Shared},
    test_view::TestSet,
    theme::{Theme, space, type_size},
    training_worker::{PastNetworks, RunId},
    widgets::{ghost_button, slider_ui},
};

/// Time of a replay, in seconds.
const REPLAY_SECONDS: f64 = 6.0;

/// The displayed past epoch, if one is.
#[derive(Debug)]
pub struct ScrubState {
    /// The training of the epoch.
    of: Option<RunId>,
    /// Requested epoch; `None` for the latest.
    wanted: Option<usize>,
    /// Result of the network of an epoch.
    result: Option<RunResult>,
    job: Background<Result<Option<RunResult>, JobError>>,
    /// Reason why the network of an epoch could not be shown, until it is reported.
    failure: Option<JobError>,
    /// When the replay began, in seconds, and at which epoch.
    replay: Option<(f64, usize)>,
}

impl ScrubState {
    /// Starts on the latest epoch. `wake` is called when a result is there.
    pub fn new(wake: Wake) -> Self {
        Self {
            of: None,
            wanted: None,
            result: None,
            job: Background::prompt("past network", wake),
            failure: None,
            replay: None,
        }
    }

    /// Returns the result of the displayed past epoch; `None` while the latest is displayed.
    pub fn result(&self) -> Option<&RunResult> {
        self.result.as_ref().filter(|_| self.wanted.is_some())
    }

    /// Returns the requested epoch; `None` for the latest.
    pub fn epoch(&self) -> Option<usize> {
        self.wanted
    }

    /// Returns true while a replay is running.
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

    /// Starts a replay at the displayed past epoch, or at the first one; stops a running replay.
    pub fn toggle_replay(&mut self, now_seconds: f64, past: &PastNetworks) {
        self.replay = match self.replay {
            Some(_) => None,
            None => {
                let begin = self.wanted.or_else(|| past.epochs().next());
                begin.map(|epoch| (now_seconds, epoch))
            }
        };
    }

    /// Shows the current epoch of the replay. Early epochs change most, so it advances on a logarithmic scale.
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

    /// Leaves an epoch of another training, and computes the results of the requested epoch on the test set.
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
                // The epoch was thinned out meanwhile.
                Ok(None) => self.show_latest(),
                Err(error) => {
                    self.show_latest();
                    self.failure = Some(error);
                }
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

    /// Returns the reason why the network of an epoch could not be shown, once.
    pub(super) fn take_failure(&mut self) -> Option<String> {
        let error = self.failure.take()?;
        Some(format!("The network of this epoch cannot be shown: {error}"))
    }

    fn compute(&mut self, run: &RunView, epoch: usize) {
        let Some(present) = &run.result else { return };
        let (past, networks, test) = (run.past.clone(), Arc::clone(&present.networks), run.test.clone());
        let (is_idle, problem) = (present.is_idle, Arc::clone(&run.problem));
        // The displayed snapshot is decoded too, as in the results of the training itself.
        let snapshot = present.frame.as_ref().map_or(0, |(snapshot, _)| *snapshot);
        self.job.start(
            move |_| {
                let result = result_at(epoch, &past, &networks, &problem, &test)?;
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
    problem: &Problem,
    test: &TestSet,
) -> Option<RunResult> {
    let past = past.at(epoch, present)?;
    let (networks, best_epoch) = (past.networks, past.best_epoch);
    let answers = ProgramDecoder::new(networks.decoder_program(problem, None)).answers_to(test.set());
    Some(RunResult {
        network_alone: None,
        errors: TestErrors::measure(problem, test.set(), &answers),
        answers: Arc::new(answers),
        frame: None,
        charts: None,
        remarks: Vec::new(),
        coverage: Vec::new(),
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

/// Height of the bar, in points.
pub(in crate::window::views::train) const HEIGHT: f32 = space(8);

/// Time between two frames of a replay.
const FRAME: Duration = Duration::from_millis(33);

/// A slider over the epochs of the training, a button that replays them, and the way back to the latest.
pub fn scrub_bar_ui(ui: &mut Ui, scrub: &mut ScrubState, past: &PastNetworks) {
    let epochs: Vec<usize> = past.epochs().collect();
    let Some((&latest, others)) = epochs.split_last().filter(|(_, others)| !others.is_empty()) else {
        return;
    };
    let now_seconds = ui.input(|input| input.time);
    if scrub.is_replaying() {
        scrub.replay(now_seconds, past);
        ui.ctx().request_repaint_after(FRAME);
    }
    ui.horizontal(|ui| {
        ui.set_min_height(HEIGHT);
        replay_button_ui(ui, scrub, now_seconds, past);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let is_past = scrub.epoch().is_some();
            let button = ui.add_enabled(is_past, ghost_button("Latest").min_size(Vec2::new(0.0, space(6))));
            if button
                .on_hover_text("Shows the latest network again. Export offers the displayed network and the best.")
                .clicked()
            {
                scrub.show_latest();
                ui.request_repaint();
            }
            // As wide as the widest, so that the slider keeps its length.
            let palette = Theme::of(ui).palette;
            let (text, colour) = match scrub.epoch() {
                Some(epoch) => (format!("Network of epoch {epoch}"), palette.warning),
                None => (format!("Latest, epoch {latest}"), palette.dim),
            };
            let size = Vec2::new(space(38), space(6));
            ui.allocate_ui_with_layout(size, Layout::right_to_left(Align::Center), |ui| {
                ui.set_min_width(size.x);
                ui.label(RichText::new(text).size(type_size().note).color(colour));
            });
            epoch_slider_ui(ui, scrub, past, others.len(), &epochs);
        });
    });
}

fn replay_button_ui(ui: &mut Ui, scrub: &mut ScrubState, now_seconds: f64, past: &PastNetworks) {
    let (text, name) = if scrub.is_replaying() {
        ("⏸", "Stop the replay")
    } else {
        ("▶", "Replay the training")
    };
    let button = ui.add(ghost_button(text).min_size(Vec2::splat(space(6))));
    button.widget_info(|| WidgetInfo::labeled(Role::Button, true, name));
    let hint = "Replays the training: the surfaces, tables and histogram of each epoch in turn.";
    if button.on_hover_text(hint).clicked() {
        scrub.toggle_replay(now_seconds, past);
        ui.request_repaint();
    }
}

fn epoch_slider_ui(ui: &mut Ui, scrub: &mut ScrubState, past: &PastNetworks, last: usize, epochs: &[usize]) {
    let shown = scrub
        .epoch()
        .map_or(last, |epoch| epochs.partition_point(|other| *other < epoch));
    let mut place = shown;
    let width = (ui.available_width() - space(2)).max(space(10));
    let slider = slider_ui(ui, Slider::new(&mut place, 0..=last), width);
    if slider.double_clicked() {
        place = last;
    }
    slider.widget_info(|| WidgetInfo::slider(true, epochs[place.min(last)] as f64, "Epoch of the displayed network"));
    if place != shown {
        // Dragging stops the replay.
        if scrub.is_replaying() {
            scrub.toggle_replay(0.0, past);
        }
        scrub.show(epochs[place.min(last)], past);
        ui.request_repaint();
    }
    let hint = match past.stride() {
        1 => "Shows the network that a training stopped at this epoch would have kept.".to_owned(),
        stride => format!(
            "Shows the network that a training stopped at this epoch would have kept. Every {stride}th epoch is \
             stored, to use no more than {} MB.",
            PastNetworks::MAX_BYTES >> 20
        ),
    };
    slider.on_hover_text(hint);
}
