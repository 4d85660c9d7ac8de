use std::sync::Arc;

use ndarray::Array2;

use super::{
    chart::BottomTab,
    decoders::{DecoderMeasuring, DecodersState},
    drawn::{Drawn, Frames},
    exports::PaperFigure,
    inspect::{Lighting, SectionChoice, TestPlace, drawn_nodes},
    press::PressState,
    recording::RecordingEditor,
    scrub::ScrubState,
};
use crate::window::{
    job::Wake,
    shared::{Effect, Look, RightCard, RunResult, RunView, Shared},
    test_view::RecordedTest,
};
use decoupler_core::training::StopReason;
use decoupler_files::import::Setup;

/// The Train view.
#[derive(Debug)]
pub struct TrainView {
    /// Snapshot of the test set: a frame of an array, a sample of a recording.
    pub snapshot: usize,
    /// Target of a recording whose values the charts show.
    pub(super) target: usize,
    /// The snapshot that the worker was informed of.
    pub(super) watched: usize,
    /// Surface shown on the right-hand card.
    pub right: RightCard,
    /// The chart below.
    pub tab: BottomTab,
    /// The thing that the pointer lights up in every picture.
    pub lights: Lighting,
    /// The wire along which the surfaces are cut.
    pub section: SectionChoice,
    /// True if each decoupled node has a bar of its root mean square error.
    pub has_error_bars: bool,
    /// Drawings of the test set.
    pub drawn: Drawn,
    /// The finger on the actual surface.
    pub press: PressState,
    /// The displayed past epoch.
    pub scrub: ScrubState,
    /// Recording that is trained on.
    pub(in crate::window) recording: RecordingEditor,
    /// Results of other decoders on the test set.
    pub decoders: DecodersState,
    pub(super) measuring: DecoderMeasuring,
}

impl TrainView {
    /// Nothing drawn yet. `wake` is called when a decoder is measured.
    pub fn new(wake: Wake) -> Self {
        Self {
            snapshot: 0,
            target: 0,
            watched: 0,
            right: RightCard::default(),
            tab: BottomTab::default(),
            lights: Lighting::default(),
            section: SectionChoice::default(),
            has_error_bars: false,
            drawn: Drawn::default(),
            press: PressState::new(&wake),
            scrub: ScrubState::new(Arc::clone(&wake)),
            recording: RecordingEditor::new(&wake),
            decoders: DecodersState::default(),
            measuring: DecoderMeasuring::new(wake),
        }
    }

    /// Draws what is displayed.
    pub(super) fn follow(&mut self, shared: &Shared) {
        self.scrub.follow(shared);
        let result = result_of(&self.scrub, shared);
        let target = shared.recorded_test().map_or(0, |test| self.target_of(test));
        self.snapshot = self.drawn.follow(shared, result, self.snapshot, target);
        self.press.follow(shared, result);
        let nodes = drawn_nodes(shared, self.frames().actual.nodes_mm.len());
        self.lights.node = self.lights.node.filter(|&node| node < nodes);
    }

    /// The current result: of the training so far, or of the past epoch that was brought back.
    pub fn result<'a>(&'a self, shared: &'a Shared) -> Option<&'a RunResult> {
        result_of(&self.scrub, shared)
    }

    /// The displayed surfaces: those under the finger, or those of the test set.
    pub fn frames(&self) -> &Frames {
        self.press.frames().unwrap_or(&self.drawn.frames)
    }

    /// Drops of the readings of the displayed surface below those at rest, in percent: rows read × M4.
    pub fn drops_percent(&self) -> Option<&Array2<f64>> {
        match self.press.shown() {
            Some(shown) => shown.drops_percent.as_ref(),
            None => self.drawn.drops_percent.as_ref(),
        }
    }

    /// Goes to a snapshot of the test set.
    pub(super) fn show_snapshot(&mut self, snapshot: usize) {
        self.snapshot = snapshot;
        self.press.let_go();
    }

    /// Number of snapshots of the current test set: frames of an array, samples of a recording.
    pub(super) fn snapshots(shared: &Shared) -> usize {
        let of_recording = || shared.recorded_test().map(|test| test.set.samples());
        let of_array = shared.test().map(|test| test.snapshots.len());
        of_array.or_else(of_recording).unwrap_or(0)
    }

    /// Target of `test` whose values the charts show: the one chosen, or the last.
    pub(super) fn target_of(&self, test: &RecordedTest) -> usize {
        self.target.min(test.set.outputs().saturating_sub(1))
    }

    /// Returns the root mean square error of each node, where error bars are on and there is a result.
    pub fn error_bars_mm(&self) -> Option<&[f64]> {
        self.has_error_bars.then(|| self.drawn.spread_mm()).flatten()
    }

    /// Goes to this value of the test set and marks its node.
    pub(super) fn go_to(&mut self, place: TestPlace) {
        self.show_snapshot(place.snapshot);
        self.lights.node = place.node;
    }

    /// Looks at a figure of the paper, and trains what it shows unless that is there.
    pub(super) fn show_paper_figure(&mut self, figure: PaperFigure, shared: &Shared, effects: &mut Vec<Effect>) {
        let settings = figure.settings();
        effects.push(Effect::Configure(Box::new(settings)));
        self.right = RightCard::Decoupled;
        self.tab = figure.tab().unwrap_or(self.tab);
        if let Some(mode) = figure.mode() {
            effects.push(Effect::Look(Look { mode, ..shared.look }));
        }
        let is_complete = |run: &RunView| {
            let was_stopped = run.stop_reason == Some(StopReason::Stopped);
            run.asked == Setup::from(settings) && run.stop_reason.is_some() && !was_stopped
        };
        if !shared.run.as_ref().is_some_and(is_complete) {
            effects.push(Effect::Train);
        }
    }
}

fn result_of<'a>(scrub: &'a ScrubState, shared: &'a Shared) -> Option<&'a RunResult> {
    let latest = shared.result()?;
    Some(scrub.result().unwrap_or(latest))
}
