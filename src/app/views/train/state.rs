use std::sync::Arc;

use ndarray::Array2;

use super::{
    bottom_tab::BottomTab,
    decoders::{DecoderMeasuring, DecodersState},
    drawn::{Drawn, Frames},
    inspect::{Lighting, SectionChoice},
    paper_figure::PaperFigure,
    press::PressState,
    scrub::ScrubState,
};
use crate::{
    app::{
        job::Wake,
        shared::{Effect, Look, RightCard, RunResult, RunView, Shared},
    },
    evaluation::NodeAddress,
    import::Setup,
    training::StopReason,
};

/// The Train view.
#[derive(Debug)]
pub struct TrainView {
    /// Snapshot of the test set.
    pub snapshot: usize,
    /// The snapshot that the worker was told of.
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
    /// The past epoch on show.
    pub scrub: ScrubState,
    /// Results of other decoders on the test set.
    pub decoders: DecodersState,
    pub(super) measuring: DecoderMeasuring,
}

impl TrainView {
    /// Nothing drawn yet. `wake` is called when a decoder is measured.
    pub fn new(wake: Wake) -> Self {
        Self {
            snapshot: 0,
            watched: 0,
            right: RightCard::default(),
            tab: BottomTab::default(),
            lights: Lighting::default(),
            section: SectionChoice::default(),
            has_error_bars: false,
            drawn: Drawn::default(),
            press: PressState::new(&wake),
            scrub: ScrubState::new(Arc::clone(&wake)),
            decoders: DecodersState::default(),
            measuring: DecoderMeasuring::new(wake),
        }
    }

    /// Draws what is on show.
    pub(super) fn follow(&mut self, shared: &Shared) {
        self.scrub.follow(shared);
        let result = result_of(&self.scrub, shared);
        self.snapshot = self.drawn.follow(shared, result, self.snapshot);
        self.press.follow(shared, result);
        let nodes = self.frames().actual.nodes_mm.len();
        self.lights.node = self.lights.node.filter(|&node| node < nodes);
    }

    /// The result on show: of the training so far, or of the past epoch that was brought back.
    pub fn result<'a>(&'a self, shared: &'a Shared) -> Option<&'a RunResult> {
        result_of(&self.scrub, shared)
    }

    /// The surfaces on show: those under the finger, or those of the test set.
    pub fn frames(&self) -> &Frames {
        self.press.frames().unwrap_or(&self.drawn.frames)
    }

    /// Drops of the readings of the surface on show below those at rest, in percent: rows read × M4.
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

    /// Returns the root mean square error of each node, where error bars are on and there is a result.
    pub fn error_bars_mm(&self) -> Option<&[f64]> {
        self.has_error_bars.then(|| self.drawn.spread_mm()).flatten()
    }

    /// Goes to this node and marks it.
    pub(super) fn go_to(&mut self, address: NodeAddress, shared: &Shared) {
        self.show_snapshot(address.snapshot);
        self.lights.node = shared.test().and_then(|test| test.node(address));
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
