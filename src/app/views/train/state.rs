use super::{
    chart::BottomTab,
    decoders::{DecoderMeasuring, DecodersState},
    drawn::Drawn,
    paper_figure::PaperFigure,
};
use crate::{
    app::{
        job::Wake,
        shared::{Effect, Look, RightCard, RunView, Shared},
    },
    evaluation::NodeAddress,
    training::StopReason,
};

/// The Train view.
#[derive(Debug)]
pub struct TrainView {
    /// Snapshot of the test set.
    pub snapshot: usize,
    /// What the right-hand card shows.
    pub right: RightCard,
    /// The chart below.
    pub tab: BottomTab,
    /// The node under the pointer, marked on every picture.
    pub node: Option<usize>,
    /// Whether each decoupled node has a bar that tells how far it is off in general.
    pub has_error_bars: bool,
    /// What is drawn.
    pub drawn: Drawn,
    /// What other decoders make of the test set.
    pub decoders: DecodersState,
    pub(super) measuring: DecoderMeasuring,
}

impl TrainView {
    /// Nothing drawn yet. `wake` is called when a decoder is measured.
    pub fn new(wake: Wake) -> Self {
        Self {
            snapshot: 0,
            right: RightCard::default(),
            tab: BottomTab::default(),
            node: None,
            has_error_bars: false,
            drawn: Drawn::default(),
            decoders: DecodersState::default(),
            measuring: DecoderMeasuring::new(wake),
        }
    }

    /// Draws what is on show.
    pub(super) fn follow(&mut self, shared: &Shared) {
        self.snapshot = self.drawn.follow(shared, self.snapshot);
        self.node = self.node.filter(|&node| node < self.drawn.frames.actual.nodes_mm.len());
    }

    /// How far each node is off in general, where that is asked for and there is a result.
    pub fn error_bars_mm(&self) -> Option<&[f64]> {
        self.has_error_bars.then(|| self.drawn.spread_mm()).flatten()
    }

    /// Goes to this node and marks it.
    pub(super) fn go_to(&mut self, address: NodeAddress, shared: &Shared) {
        self.snapshot = address.snapshot;
        self.node = shared.test().and_then(|test| test.node(address));
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
            run.asked == settings && run.stop_reason.is_some() && !was_stopped
        };
        if !shared.run.as_ref().is_some_and(is_complete) {
            effects.push(Effect::Train);
        }
    }
}
