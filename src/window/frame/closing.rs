use std::path::Path;

use decoupler_core::text::counted;
use eframe::egui::{Align, Layout, RichText, Ui, ViewportCommand};

use super::{
    DecouplerWindow,
    modal::{Modal, Reply, card_ui},
};
use crate::window::{
    shared::{Phase, Shared, Unfinished, ViewKind},
    theme::{semibold, space, type_size},
    widgets::{dim_ui, ghost_button, primary_button},
};

/// The question about unfinished work before the window closes.
#[derive(Debug)]
pub(super) struct Closing {
    /// The work that was unfinished when the user was asked: its lines keep their places.
    lines: Vec<String>,
    /// True if the running training can be saved.
    can_save: bool,
    /// True once the user has decided to close.
    is_decided: bool,
}

impl DecouplerWindow {
    /// Lets the window close if nothing would be lost, or asks.
    pub(super) fn take_close_request(&mut self) {
        let is_decided = matches!(&self.modal, Some(Modal::Closing(closing)) if closing.is_decided);
        if !self.ctx.input(|input| input.viewport().close_requested()) {
            if is_decided {
                self.ctx.send_viewport_cmd(ViewportCommand::Close);
            }
            return;
        }
        if !matches!(self.modal, Some(Modal::Closing(_))) {
            let unfinished = self.unfinished();
            if unfinished.is_empty() {
                return self.worker.forget();
            }
            let is_trained = matches!(self.shared.phase, Phase::Training | Phase::Paused | Phase::Calibrating);
            self.modal = Some(Modal::Closing(Closing {
                can_save: self.keeping.is_some() && is_trained && unfinished_training(&self.shared).is_some(),
                lines: Vec::from_iter(unfinished.into_iter().map(|work| work.name)),
                is_decided: false,
            }));
        }
        if !is_decided {
            self.ctx.send_viewport_cmd(ViewportCommand::CancelClose);
            // The question must be visible.
            self.ctx.send_viewport_cmd(ViewportCommand::Minimized(false));
        }
    }

    /// Closes the window. Files that are being written are waited for; so is the running training, if it is to be kept.
    pub(super) fn leave(&mut self, keeps_training: bool) {
        if let Some(Modal::Closing(closing)) = &mut self.modal {
            closing.is_decided = true;
        }
        if keeps_training {
            self.worker.save();
        } else {
            self.worker.forget();
        }
    }

    /// Returns the work that closing would cut short.
    pub(super) fn unfinished(&mut self) -> Vec<Unfinished> {
        let mut all = Vec::from_iter(unfinished_training(&self.shared));
        for view in ViewKind::ALL {
            all.extend(self.views.get(view).holdings(&self.shared).unfinished);
        }
        let written = |path: &Path| Unfinished::new("File", path.display(), "is being written and will be finished");
        all.extend(self.files.paths().map(written));
        let runs = &self.shared.runs;
        if runs.path.is_some() && runs.unwritten > 0 {
            let count = counted(runs.unwritten as u64, "run");
            let progress = format!("{count} could not be written to the folder of runs");
            all.push(Unfinished::new("Run list", "Unwritten runs", progress));
        }
        all
    }
}

/// Returns the training if it is being prepared or has unsaved epochs.
fn unfinished_training(shared: &Shared) -> Option<Unfinished> {
    let progress = match shared.phase {
        Phase::Idle | Phase::Ended(_) => return None,
        Phase::Preparing => "its samples are being drawn or read".to_owned(),
        Phase::Training | Phase::Paused | Phase::Calibrating => {
            let run = shared.run.as_ref().filter(|run| !run.is_saved)?;
            let epoch = run.latest().map_or(0, |latest| latest.epoch);
            format!("epoch {epoch} of {}", run.settings().training.stopping.epochs)
        }
    };
    Some(Unfinished::new("Train", "Training", progress))
}

/// Lists the unfinished work and asks.
pub(super) fn closing_ui(ui: &Ui, closing: &Closing, unfinished: &[Unfinished]) -> Option<Reply> {
    card_ui(ui, "closing", space(150), |ui| {
        ui.label(RichText::new("Close with unsaved work?").font(semibold(type_size().title)));
        ui.add_space(space(1));
        for name in &closing.lines {
            let now = unfinished.iter().find(|now| now.name == *name);
            ui.horizontal(|ui| {
                ui.label(RichText::new(name).font(semibold(type_size().body)));
                dim_ui(ui, now.map_or("has ended", |now| &now.progress));
            });
        }
        ui.add_space(space(3));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let mut reply = None;
            // From right to left.
            if closing.can_save {
                let button = ui.add(primary_button("Save training and close"));
                if button.on_hover_text("It can be resumed at the next start.").clicked() {
                    reply = Some(Reply::Leave { keeps_training: true });
                }
            }
            if ui.add(ghost_button("Close")).clicked() {
                reply = Some(Reply::Leave { keeps_training: false });
            }
            if ui.add(ghost_button("Cancel")).clicked() {
                reply = Some(Reply::Close);
            }
            reply
        })
        .inner
    })
}
