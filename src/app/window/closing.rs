use eframe::egui::{Align, Frame, Id, Layout, Margin, Modal, RichText, Ui, ViewportCommand};

use super::DecouplerWindow;
use crate::app::{
    shared::{Effect, Phase},
    theme::{semibold, space, type_size},
    views::checkpoint_task,
    widgets::{ghost_button, primary_button},
};

/// Stage of closing the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Closing {
    /// The user is asked what becomes of the unfinished training.
    Asking,
    /// The training is to be saved, and the user is asked where.
    ChoosingPath,
    /// The window closes once every file is written.
    Finishing,
    /// The window closes, whatever is lost.
    Now,
}

impl DecouplerWindow {
    /// Lets the window close when nothing is lost by it.
    pub(super) fn take_close_request(&mut self) {
        let is_requested = self.ctx.input(|input| input.viewport().close_requested());
        if is_requested && self.closing.is_none() {
            self.closing = Some(Closing::Asking);
        }
        let loses_nothing = !self.has_unfinished_training() && self.unfinished_view().is_none();
        match self.closing {
            Some(Closing::Asking) if loses_nothing => {
                if self.shared.phase == Phase::Preparing {
                    self.apply(Effect::Stop);
                }
                self.closing = Some(Closing::Finishing);
            }
            // The user thought better of saving, and so of closing.
            Some(Closing::ChoosingPath) if !self.dialogs.is_asking() && self.saving.is_none() => {
                self.closing = None;
            }
            _ => {}
        }
        let may_close = match self.closing {
            Some(Closing::Finishing) => self.files.paths().next().is_none(),
            Some(Closing::Now) => true,
            _ => false,
        };
        if may_close && !is_requested {
            self.ctx.send_viewport_cmd(ViewportCommand::Close);
        }
        if is_requested && !may_close {
            self.ctx.send_viewport_cmd(ViewportCommand::CancelClose);
            // The question must be seen.
            self.ctx.send_viewport_cmd(ViewportCommand::Minimized(false));
        }
    }

    /// Returns true if closing loses epochs.
    fn has_unfinished_training(&self) -> bool {
        let is_saved = self.shared.run.as_ref().is_some_and(|run| run.is_saved);
        matches!(self.shared.phase, Phase::Training | Phase::Paused) && !is_saved
    }

    /// Name of a view with a training of its own that closing would lose.
    fn unfinished_view(&mut self) -> Option<&'static str> {
        let mut views = self.views.all().into_iter();
        views.find_map(|view| view.has_unfinished().then(|| view.name()))
    }

    /// Asks about the unfinished training, or tells what closing waits for.
    pub(super) fn closing_ui(&mut self, ui: &Ui) {
        let (heading, text, buttons): (_, _, &[_]) = match self.closing {
            Some(Closing::Asking) if !self.has_unfinished_training() => {
                let view = self.unfinished_view().unwrap_or_default();
                let text = format!(
                    "The training of the {view} view has not ended. Closing discards it; to keep it, stay, pause it and \
                     export its checkpoint."
                );
                let buttons = &[("Stay", None), ("Discard and close", Some(Closing::Finishing))];
                ("Close during a training?", text, buttons)
            }
            Some(Closing::Asking) => (
                "Close during a training?",
                format!(
                    "{} Closing discards it unless it is saved.",
                    self.how_far_the_training_is()
                ),
                &[
                    ("Save checkpoint and close…", Some(Closing::ChoosingPath)),
                    ("Discard and close", Some(Closing::Finishing)),
                    ("Stay", None),
                ],
            ),
            Some(Closing::Finishing) => {
                let names = self.files.paths().map(|path| path.display().to_string());
                let text = format!(
                    "Still being written: {}. The window closes by itself after that.",
                    names.collect::<Vec<_>>().join(", ")
                );
                let buttons = &[("Stay", None), ("Close without them", Some(Closing::Now))];
                ("Finishing files", text, buttons)
            }
            Some(Closing::ChoosingPath | Closing::Now) | None => return,
        };
        let mut chosen = None;
        let frame = Frame::popup(ui.style()).inner_margin(Margin::same(16));
        let modal = Modal::new(Id::unique("closing")).frame(frame).show(ui.ctx(), |ui| {
            ui.set_width(space(110));
            ui.label(RichText::new(heading).font(semibold(type_size().title)));
            ui.label(text);
            ui.add_space(space(3));
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                for (number, &(text, then)) in buttons.iter().enumerate() {
                    let button = if number == 0 {
                        ui.add(primary_button(text))
                    } else {
                        ui.add(ghost_button(text))
                    };
                    if button.clicked() {
                        chosen = Some(then);
                    }
                }
            });
        });
        if modal.should_close() {
            chosen = Some(None);
        }
        let Some(closing) = chosen else { return };
        self.closing = closing;
        if let (Some(Closing::ChoosingPath), Some(run)) = (closing, &self.shared.run) {
            self.apply(Effect::ChooseFile(checkpoint_task(run)));
        }
        ui.request_repaint();
    }

    fn how_far_the_training_is(&self) -> String {
        let run = self.shared.run.as_ref();
        let latest = run.and_then(|run| Some((run, run.latest()?)));
        latest.map_or_else(
            || "The training has only just begun.".to_owned(),
            |(run, latest)| {
                let epochs = run.settings.training.stopping.epochs;
                format!("The training is at epoch {} of {epochs}.", latest.epoch)
            },
        )
    }
}
