use eframe::egui::{Sense, Ui};

use super::{
    LiveView,
    cards::{invitation_ui, readings_ui, surfaces_ui},
    figures_card::figures_ui,
    source_form,
    targets_card::targets_ui,
    tools::{self, REPLAY_BAR_HEIGHT, replay_bar_ui},
};
use crate::window::{
    shared::{Effect, FileInUse, Holdings, Offers, Shared, Shown, Status, Tone, View},
    theme::space,
    widgets::{card_ui, scrolled_ui},
};
use decoupler_core::{live::FaultEvent, text::counted};
use decoupler_files::live::{SourcePlan, Watched};

impl View for LiveView {
    fn take_events(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        self.follow(effects);
        if self.network.take_events() && self.running.is_some() {
            self.restart(shared);
        }
        self.source.take_events();
        self.take_sample(shared, effects);
    }

    fn holdings(&self, _shared: &Shared) -> Holdings {
        let replayed = self.running.as_ref().and_then(|running| match &running.source {
            SourcePlan::Replay(path) => Some(FileInUse::Recording(path.clone())),
            _ => None,
        });
        let recorded = self.recording.clone().map(FileInUse::Recorded);
        Holdings {
            is_computing: self.running.is_some(),
            unfinished: Vec::new(),
            files: replayed.into_iter().chain(recorded).collect(),
        }
    }

    fn take_commands(&mut self, offers: &mut Offers<'_>, shared: &Shared, effects: &mut Vec<Effect>) {
        tools::offer_actions(self, offers, shared, effects);
    }

    fn tools_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        tools::tools_ui(ui, self, shared, effects);
    }

    fn shown<'a>(&'a self, shared: &'a Shared) -> Vec<Shown<'a>> {
        tools::shown(self, shared)
    }

    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        source_form::form_ui(ui, self, shared, effects);
    }

    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) -> Option<Status> {
        live_ui(ui, self, shared, effects);
        self.report_drawn();
        Some(status(self))
    }
}

/// Shows the surfaces above, readings and figures below, and the replay bar at the bottom.
fn live_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let whole = ui.available_rect_before_wrap();
    if !view.shown.has_answer() {
        card_ui(ui, whole, |ui| invitation_ui(ui, view, shared, effects));
        ui.allocate_rect(whole, Sense::hover());
        return;
    }
    let gap = space(2);
    let mut cards = whole;
    if view.shown.replay.is_some() {
        let (rest, bar) = whole.split_top_bottom_at_y(whole.bottom() - REPLAY_BAR_HEIGHT);
        card_ui(ui, bar, |ui| replay_bar_ui(ui, view));
        cards = rest.with_max_y(rest.bottom() - gap);
    }
    if view.shown.targets.is_some() {
        targets_ui(ui, cards, view, shared, effects);
        ui.allocate_rect(whole, Sense::hover());
        return;
    }
    let lower_height = (0.46 * cards.height()).clamp(space(60), space(100));
    let (upper, lower) = cards.split_top_bottom_at_y(cards.bottom() - lower_height);
    surfaces_ui(ui, upper.with_max_y(upper.bottom() - gap), view, shared, effects);
    let figures_width = (0.42 * lower.width()).clamp(space(75), space(110));
    let (left, right) = lower.split_left_right_at_x(lower.right() - figures_width);
    card_ui(ui, left.with_max_x(left.right() - gap), |ui| {
        readings_ui(ui, view, shared.look.colours);
    });
    card_ui(ui, right, |ui| {
        scrolled_ui(ui, "live figures", |ui| figures_ui(ui, view, shared, effects));
    });
    ui.allocate_rect(whole, Sense::hover());
}

/// Shows the state of the stream in the line at the bottom.
fn status(view: &LiveView) -> Status {
    let counts = &view.shown.counts;
    let watched = view.shown.frame.as_ref().map(|frame| &frame.watched);
    let (tone, text) = match (&view.running, watched) {
        (None, _) if counts.decoded > 0 => (
            Tone::Calm,
            format!("Stopped after {}", counted(counts.decoded, "frame")),
        ),
        (None, _) => (Tone::Calm, "Ready: press Start".to_owned()),
        (Some(_), _) if !view.shown.has_answer() => (Tone::Busy, "Waiting for the first frame".to_owned()),
        (Some(_), _) if counts.is_waiting => (Tone::Warning, "No frame for two seconds".to_owned()),
        (Some(_), Some(Watched::Checked(FaultEvent::Named { wire, .. }))) => (Tone::Warning, format!("Fault: {wire}")),
        (Some(_), Some(Watched::Checked(FaultEvent::Unexplained))) => {
            (Tone::Warning, "The readings contradict Eq. (2)".to_owned())
        }
        (Some(running), _) => match (&running.source, view.shown.replay) {
            (SourcePlan::Replay(_), Some(replay)) if !replay.is_playing => (Tone::Calm, "Replay paused".to_owned()),
            (SourcePlan::Replay(_), _) => (Tone::Good, "Replaying".to_owned()),
            _ => (Tone::Good, "Live".to_owned()),
        },
    };
    let mut status = Status::new(tone, text);
    {
        if let Some(running) = &view.running {
            let source = match &running.source {
                SourcePlan::Simulated(_) => "simulated".to_owned(),
                SourcePlan::Replay(path) => path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
                SourcePlan::Stream(source) => source.to_string(),
            };
            status.notes.push(format!("{}, {source}", running.network));
            if counts.decoded > 0 {
                status
                    .notes
                    .push(format!("{:.0} frames per second", counts.frames_per_second));
            }
        }
        if let Some(recorded) = view.shown.recording.as_ref().filter(|_| view.recording.is_some()) {
            let frames = counted(recorded.frames, "frame");
            status
                .notes
                .push(format!("● Recording: {frames}, {:.1} s", recorded.seconds));
        }
    }
    status
}
