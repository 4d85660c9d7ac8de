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
    shared::{Command, Effect, Look, Matter, Notice, Offer, Offers, RecordingDraft, Shared, SourceKind, ViewKind},
};

/// Interface scales offered to the user, relative to the default.
pub(super) const SCALES: RangeInclusive<f32> = 0.8..=2.0;

/// Step between scales.
const STEP: f32 = 0.1;

impl DecouplerWindow {
    /// Offers the commands of the current view and of the window, and carries out those that the user asked for.
    pub(super) fn take_commands(&mut self, ctx: &Context, effects: &mut Vec<Effect>) -> Vec<Offer> {
        // On many keyboards plus is the shifted equals sign.
        if self.modal.is_none() && ctx.input_mut(|input| input.consume_key(Modifiers::COMMAND, Key::Equals)) {
            self.picked = Some(Command::Larger);
        }
        let is_listed = self.picked.is_some() || matches!(self.modal, Some(Modal::Palette(_)));
        let mut offers = Offers::new(ctx, self.picked.take(), self.modal.is_none());
        let mut take = |kind: ViewKind, offers: &mut Offers<'_>, effects: &mut Vec<Effect>| {
            let view = self.views.get(kind);
            view.take_commands(offers, &self.shared, effects);
            // These have no keys, and take longer to list.
            for shown in is_listed.then(|| view.shown(&self.shared)).into_iter().flatten() {
                if offers.offer(Command::Export(shown.action()), shown.item.is_ok()) {
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
                let mut listed = Offers::new(ctx, None, false);
                take(other, &mut listed, &mut Vec::new());
                let of = Some(other);
                of_others.extend(listed.into_list().into_iter().map(|offer| Offer { of, ..offer }));
            }
        }
        for (command, is_possible) in self.commands() {
            if offers.offer(command.clone(), is_possible) {
                self.carry_out(&command);
            }
        }
        let mut list = offers.into_list();
        list.extend(of_others);
        list
    }

    /// Returns the commands of the window, and whether each is possible now.
    fn commands(&self) -> Vec<(Command, bool)> {
        let (shared, look) = (&self.shared, self.shared.look);
        // The settings of a running training cannot change.
        let is_free = !shared.phase.is_busy();
        let drafts = drafts(shared);
        let scale = self.ctx.zoom_factor();
        let mut commands = vec![
            (Command::Undo, is_free && self.undoer.has_undo(&drafts)),
            (Command::Redo, is_free && self.undoer.has_redo(&drafts)),
        ];
        commands.extend(ViewKind::ALL.map(|view| (Command::Show(view), view != shared.shown)));
        commands.push((if look.is_dark { Command::Light } else { Command::Dark }, true));
        commands.extend(SequentialMap::ALL.map(|map| (Command::Colours(map), map != look.colours)));
        commands.extend([
            (Command::Larger, scale < *SCALES.end() - 0.5 * STEP),
            (Command::Smaller, scale > *SCALES.start() + 0.5 * STEP),
            (Command::UsualSize, (scale - 1.0).abs() > 0.5 * STEP),
            (Command::Form, self.ctx.content_rect().width() < SMALL),
            (Command::Search, true),
            (Command::Keys, true),
            (Command::Glossary, true),
            (Command::About, true),
        ]);
        commands
    }

    /// Carries out a command of the window.
    pub(super) fn carry_out(&mut self, command: &Command) {
        let look = self.shared.look;
        match command {
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
