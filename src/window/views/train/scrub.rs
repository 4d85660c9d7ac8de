//! Scrubbing: the networks of past epochs, selected with a slider under the charts or replayed one after the other. Their
//! results on the test set are computed in the background; the latest request wins.

use std::{sync::Arc, time::Duration};

use decoupler_core::{decoupling::ProgramDecoder, evaluation::TestErrors, problem::Problem};
use eframe::egui::{Align, Layout, RichText, Slider, Ui, Vec2, WidgetInfo, accesskit::Role};

use crate::window::{
    job::{Background, JobError, Jobs},
    shared::{Effect, Matter, Notice, RunResult, Shared},
    test_view::TestView,
    theme::{Theme, space, type_size},
    training_worker::{PastNetworks, RunId},
    widgets::{ghost_button, slider_ui},
};

/// Time of a replay, in seconds.
const REPLAY_SECONDS: f64 = 6.0;
/// Time between two frames of a replay.
const FRAME: Duration = Duration::from_millis(33);

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
    /// When the replay began, in seconds, and at which epoch.
    replay: Option<(f64, usize)>,
}

impl ScrubState {
    /// Starts on the latest epoch.
    pub fn new(jobs: &Jobs) -> Self {
        Self {
            of: None,
            wanted: None,
            result: None,
            job: Background::prompt("past network", jobs),
            replay: None,
        }
    }

    /// Returns the result of the displayed past epoch; `None` while the latest is displayed.
    pub fn result(&self) -> Option<&RunResult> {
        self.result.as_ref().filter(|_| self.wanted.is_some())
    }

    /// Returns the result of the displayed network of the current training, if it has one.
    pub(super) fn shown<'a>(&'a self, shared: &'a Shared) -> Option<&'a RunResult> {
        let latest = shared.result()?;
        Some(self.result().unwrap_or(latest))
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
    fn show(&mut self, epoch: usize, past: &PastNetworks) {
        let latest = past.epochs().next_back();
        self.wanted = past.nearest(epoch).filter(|epoch| Some(*epoch) != latest);
    }

    fn show_latest(&mut self) {
        (self.wanted, self.replay) = (None, None);
    }

    /// Shows the current epoch of a replay. Early epochs change most, so it advances on a logarithmic scale.
    fn advance(&mut self, now_seconds: f64, past: &PastNetworks) {
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
    pub fn follow(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
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
                    let reason = format!("The network of this epoch cannot be shown: {error}");
                    effects.push(Effect::Notify(Matter::Training, Notice::Failed(reason)));
                }
            }
        }
        let Some((run, wanted)) = run.zip(self.wanted) else {
            return;
        };
        // It may have been thinned out meanwhile.
        self.show(wanted, &run.past);
        let Some((epoch, present)) = self.wanted.zip(run.result.as_ref()) else {
            return;
        };
        let is_there = self.result.as_ref().is_some_and(|result| result.epochs_run == epoch);
        if !is_there && !self.job.is_under_way() {
            let (past, present) = (run.past.clone(), present.clone());
            let (problem, test) = (Arc::clone(&run.problem), run.test.clone());
            let compute = move |_: &_| result_at(epoch, &past, present, &problem, &test);
            self.job.start(compute, |computed| computed);
        }
    }
}

/// Returns the result of the network of an epoch, if it is kept; `present` is that of the same training now.
fn result_at(
    epoch: usize,
    past: &PastNetworks,
    present: RunResult,
    problem: &Problem,
    test: &TestView,
) -> Option<RunResult> {
    let past = past.at(epoch, &present.networks)?;
    let answers = ProgramDecoder::new(past.networks.decoder_program(problem, None)).answers_to(&test.set);
    Some(RunResult {
        errors: TestErrors::measure(problem, &test.set, &answers),
        network_alone: None,
        charts: Arc::new(test.charts(&answers)),
        remarks: Vec::new(),
        coverage: Vec::new(),
        intervals: None,
        best_epoch: past.best_epoch,
        defect: None,
        epochs_run: epoch,
        networks: Arc::new(past.networks),
        answers: Arc::new(answers),
        ..present
    })
}

/// Height of the bar, in points.
pub(super) const HEIGHT: f32 = space(8);

/// A slider over the epochs of the training, a button that replays them, and the way back to the latest.
pub fn scrub_bar_ui(ui: &mut Ui, scrub: &mut ScrubState, past: &PastNetworks) {
    let epochs: Vec<usize> = past.epochs().collect();
    let Some((&latest, others)) = epochs.split_last().filter(|(_, others)| !others.is_empty()) else {
        return;
    };
    let now_seconds = ui.input(|input| input.time);
    scrub.advance(now_seconds, past);
    if scrub.is_replaying() {
        ui.ctx().request_repaint_after(FRAME);
    }
    ui.horizontal(|ui| {
        ui.set_min_height(HEIGHT);
        let (text, name) = match scrub.is_replaying() {
            true => ("⏸", "Stop the replay"),
            false => ("▶", "Replay the training"),
        };
        let button = ui.add(ghost_button(text).min_size(Vec2::splat(space(6))));
        button.widget_info(|| WidgetInfo::labeled(Role::Button, true, name));
        let hint = "Replays the training: the surfaces, tables and charts of each epoch in turn.";
        if button.on_hover_text(hint).clicked() {
            let begin = (now_seconds, scrub.wanted.unwrap_or(epochs[0]));
            scrub.replay = scrub.replay.is_none().then_some(begin);
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let is_past = scrub.epoch().is_some();
            let button = ui.add_enabled(is_past, ghost_button("Latest").min_size(Vec2::new(0.0, space(6))));
            let hint = "Shows the latest network again. Export offers the displayed network and the best.";
            if button.on_hover_text(hint).clicked() {
                scrub.show_latest();
            }
            // As wide as the widest, so that the slider keeps its length.
            let palette = Theme::of(ui).palette;
            let (text, colour) = match scrub.epoch() {
                Some(epoch) => (format!("Network of epoch {epoch}"), palette.violet),
                None => (format!("Latest, epoch {latest}"), palette.dim),
            };
            let size = Vec2::new(space(38), space(6));
            // The slider is more useful where there is no room for both.
            if ui.available_width() > size.x + space(12) {
                ui.allocate_ui_with_layout(size, Layout::right_to_left(Align::Center), |ui| {
                    ui.set_min_width(size.x);
                    ui.label(RichText::new(text).size(type_size().note).color(colour));
                });
            }
            epoch_slider_ui(ui, scrub, past, others.len(), &epochs);
        });
    });
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
        scrub.replay = None;
        scrub.show(epochs[place.min(last)], past);
    }
    let mut hint = "Shows the network that a training stopped at this epoch would have kept.".to_owned();
    if past.stride() > 1 {
        let (stride, megabytes) = (past.stride(), PastNetworks::MAX_BYTES >> 20);
        hint += &format!(" Every {stride}th epoch is stored, to use no more than {megabytes} MB.");
    }
    slider.on_hover_text(hint);
}
