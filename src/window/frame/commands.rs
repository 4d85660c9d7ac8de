use std::ops::RangeInclusive;

use decoupler_core::evaluation::{RUN_OPTIONS, RunSettings};
use decoupler_files::figure::SequentialMap;
use eframe::egui::{Context, Key, Modifiers, util::undoer::Undoer};

use super::{
    DecouplerWindow,
    help::{Help, Page},
    modal::{Modal, Palette},
    top_bar::SMALL,
};
use crate::window::{
    forms::preset_between,
    shared::{
        Command, Effect, Look, Matter, Notice, Offer, Offers, Phase, RecordingDraft, Shared, SourceKind, ViewKind,
    },
    training_worker::{Origin, Request},
};

/// Interface scales offered to the user, relative to the default.
pub(super) const SCALES: RangeInclusive<f32> = 0.8..=2.0;

/// Step between scales.
const STEP: f32 = 0.1;

impl DecouplerWindow {
    /// Offers the commands of the current view and of the window, and carries out those that the user asked for.
    pub(super) fn take_commands(&mut self, ctx: &Context, effects: &mut Vec<Effect>) {
        // On many keyboards plus is the shifted equals sign.
        if self.modal.is_none() && ctx.input_mut(|input| input.consume_key(Modifiers::COMMAND, Key::Equals)) {
            self.picked = Some(Command::Larger);
        }
        let is_listed = self.picked.is_some() || matches!(self.modal, Some(Modal::Palette(_)));
        let mut offers = Offers::new(ctx, &self.shared, self.picked.take(), self.modal.is_none());
        let mut take = |kind: ViewKind, offers: &mut Offers<'_>, effects: &mut Vec<Effect>| {
            let view = self.views.get(kind);
            view.take_commands(offers, &self.shared, effects);
            // These have no keys, and take longer to list.
            for shown in is_listed.then(|| view.shown(&self.shared)).into_iter().flatten() {
                let why_not = shown.item.as_ref().err();
                if offers.offer_unless(Command::Export(shown.action()), why_not) {
                    effects.push(shown.ask());
                }
            }
        };
        let kind = self.shared.shown;
        take(kind, &mut offers, effects);
        let mut of_others = Vec::new();
        for other in ViewKind::ALL {
            if other != kind && is_listed {
                // Nothing is picked, and no key is heard.
                let mut listed = Offers::new(ctx, &self.shared, None, false);
                take(other, &mut listed, &mut Vec::new());
                let of = Some(other);
                of_others.extend(listed.into_list().into_iter().map(|offer| Offer { of, ..offer }));
            }
        }
        let mut commands = self.commands();
        commands.retain(|command| offers.offer_unless(command.clone(), self.own_obstacle(command)));
        self.shared.offers = offers.into_list();
        self.shared.offers.extend(of_others);
        commands.iter().for_each(|command| self.carry_out(command));
    }

    /// Returns the commands of the window.
    fn commands(&self) -> Vec<Command> {
        let is_dark = self.shared.look.is_dark;
        let mut commands = vec![Command::Undo, Command::Redo];
        commands.extend(ViewKind::ALL.map(Command::Show));
        commands.push(if is_dark { Command::Light } else { Command::Dark });
        commands.extend(SequentialMap::ALL.map(Command::Colours));
        commands.extend([Command::Larger, Command::Smaller, Command::UsualSize, Command::Form]);
        commands.extend([Command::Search, Command::Keys, Command::Glossary, Command::About]);
        commands
    }

    /// Returns the reason why a command of the window is not available now that the shared state does not know.
    fn own_obstacle(&self, command: &Command) -> Option<&'static str> {
        let scale = self.ctx.zoom_factor();
        let (is_met, obstacle) = match command {
            Command::Undo => (self.undoer.has_undo(&drafts(&self.shared)), "Nothing has changed."),
            Command::Redo => (self.undoer.has_redo(&drafts(&self.shared)), "Nothing was undone."),
            Command::Larger => (scale < *SCALES.end() - 0.5 * STEP, "It is as large as possible."),
            Command::Smaller => (scale > *SCALES.start() + 0.5 * STEP, "It is as small as possible."),
            Command::UsualSize => ((scale - 1.0).abs() > 0.5 * STEP, "It has this size."),
            Command::Form => (
                self.ctx.content_rect().width() < SMALL,
                "In a window of this width they are always shown.",
            ),
            _ => return None,
        };
        (!is_met).then_some(obstacle)
    }

    /// Carries out a command of the training or of the window.
    pub(super) fn carry_out(&mut self, command: &Command) {
        let shared = &mut self.shared;
        let look = shared.look;
        match command {
            Command::Train => match shared.setup() {
                Ok(setup) if shared.source == SourceKind::Recording && shared.recording.is_automatic() => {
                    self.begin(Origin::Chosen(Box::new(setup)));
                }
                Ok(setup) => self.begin(Origin::New(Box::new(setup))),
                Err(obstacle) => self.notices.fail(Matter::Settings, obstacle),
            },
            // The settings may have changed in the same frame.
            Command::TrainLonger if command.obstacle(shared).is_some() => {}
            Command::TrainLonger => {
                shared.phase = Phase::Training;
                self.notices.settle(Matter::Training);
                self.notices.settle(Matter::Settings);
                self.worker.ask(Request::Continue(shared.settings().training));
            }
            Command::PauseTraining if shared.phase == Phase::Paused => {
                // The settings on the left are always those of the running training.
                if let Some(run) = &mut shared.run {
                    run.is_saved = false;
                    let training = run.asked.settings.training;
                    shared.set_training(training);
                }
                shared.phase = Phase::Training;
                self.worker.ask(Request::Resume);
            }
            Command::PauseTraining => {
                shared.phase = Phase::Paused;
                self.worker.ask(Request::Pause);
            }
            Command::StopTraining => {
                self.worker.ask(Request::Stop);
                // The training being prepared does not begin; the previous one stays.
                if shared.phase == Phase::Preparing {
                    shared.phase = shared.phase_at_rest();
                }
            }
            Command::Undo => {
                let earlier = self.undoer.undo(&drafts(&self.shared)).cloned();
                self.take_drafts("Undone", earlier);
            }
            Command::Redo => {
                let later = self.undoer.redo(&drafts(&self.shared)).cloned();
                self.take_drafts("Redone", later);
            }
            Command::Show(view) => self.show(*view),
            Command::Dark | Command::Light => {
                let is_dark = *command == Command::Dark;
                self.look(Look { is_dark, ..look });
            }
            &Command::Colours(colours) => self.look(Look { colours, ..look }),
            Command::Larger => self.set_scale(self.ctx.zoom_factor() + STEP),
            Command::Smaller => self.set_scale(self.ctx.zoom_factor() - STEP),
            Command::UsualSize => self.set_scale(1.0),
            Command::Form => self.shows_form ^= true,
            Command::Search => self.modal = Some(Modal::Palette(Palette::default())),
            Command::Keys => self.modal = Some(Modal::Help(Help::open(Page::Keys, ""))),
            Command::Glossary => self.modal = Some(Modal::Help(Help::open(Page::Glossary, ""))),
            Command::About => self.modal = Some(Modal::Help(Help::open(Page::About, ""))),
            // Those of views, which carry them out.
            _ => self.picked = Some(command.clone()),
        }
        self.ctx.request_repaint();
    }

    /// Sets the interface scale, rounded to whole steps and limited to [`SCALES`].
    pub(super) fn set_scale(&mut self, scale: f32) {
        let scale = ((scale / STEP).round() * STEP).clamp(*SCALES.start(), *SCALES.end());
        self.ctx.set_zoom_factor(scale);
        self.chosen.scale = Some(scale);
    }

    /// Takes settings that were undone or redone, says what has changed, and shows it.
    fn take_drafts(&mut self, done: &str, taken: Option<Drafts>) {
        let Some(taken) = taken else { return };
        let present = drafts(&self.shared);
        let [before, after] = if done == "Undone" {
            [&taken, &present]
        } else {
            [&present, &taken]
        };
        let text = format!("{done}: {}", difference(before, after));
        if !matches!(self.shared.shown, ViewKind::Train | ViewKind::Sensor) {
            self.show(ViewKind::Train);
        }
        let (source, draft, mut recording) = taken;
        match &recording.plan {
            Ok(plan) if self.shared.recording.plan.as_ref() != Ok(plan) => self.views.open_plan(plan),
            Ok(_) => {}
            // Undoing closes no files.
            Err(_) => recording.plan.clone_from(&self.shared.recording.plan),
        }
        self.shared.recording = recording;
        self.shared.draft = draft;
        self.choose_source(source);
        self.notices.add(Matter::Settings, Notice::Done(text));
    }
}

/// Everything that the user sets for the next training.
pub(super) type Drafts = (SourceKind, RunSettings, RecordingDraft);

/// Undo and redo history of the settings. A drag counts as one change, and so do changes less than a second apart.
pub(super) type DraftsUndoer = Undoer<Drafts>;

/// Returns the current settings; their plan is shared, not copied.
pub(super) fn drafts(shared: &Shared) -> Drafts {
    (shared.source, shared.draft, shared.recording.clone())
}

/// Returns what was changed: "hidden, epochs", "preset Best accuracy".
fn difference(before: &Drafts, after: &Drafts) -> String {
    let settings = |(source, draft, recording): &Drafts| match source {
        SourceKind::Array => *draft,
        SourceKind::Recording => recording.settings,
    };
    let [a, b] = [before, after].map(settings);
    let mut names: Vec<_> = RUN_OPTIONS.iter().map(|option| &option.setting).collect();
    names.retain(|setting| setting.get(&a) != setting.get(&b));
    match &names[..] {
        _ if before.0 != after.0 => "source of the samples".to_owned(),
        [] if after.2.plan == Err(RecordingDraft::NOTHING_OPEN.to_owned()) => "Clear".to_owned(),
        [] if before.2.plan != after.2.plan => "import".to_owned(),
        [] if before.2.is_auto != after.2.is_auto => "automatic settings".to_owned(),
        [] if a.source != b.source => "sensor or scene".to_owned(),
        [] => "settings of the method".to_owned(),
        [_, _, ..] if let Some(preset) = preset_between(&a, &b) => format!("preset {preset}"),
        [first, second, third, _, ..] => format!("{}, {}, {} and others", first.name, second.name, third.name),
        few => Vec::from_iter(few.iter().map(|setting| setting.name)).join(", "),
    }
}
