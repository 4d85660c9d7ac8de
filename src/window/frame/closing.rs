use std::sync::Arc;

use decoupler_core::text::counted;
use eframe::egui::{Align, Layout, RichText, Ui, ViewportCommand};

use super::{
    DecouplerWindow,
    modal::{Modal, Reply, card_ui},
};
use crate::window::{
    job::Background,
    shared::{Phase, Shared, SourceKind, Unfinished, ViewKind},
    theme::{semibold, space, type_size},
    widgets::{dim_ui, ghost_button, primary_button},
};

/// The question about unfinished work before the window closes.
#[derive(Debug)]
pub(super) struct Closing {
    /// The work that was unfinished when the user was asked: its lines keep their places.
    lines: Vec<(&'static str, &'static str)>,
    /// True if the running training can be saved.
    can_save: bool,
    /// True once the user has decided to close: the window waits only for files that are being written.
    is_decided: bool,
    /// True if it does not even wait for these.
    is_forced: bool,
    /// Saves the running training for the next start, if the user has asked for that.
    saving: Option<Background<()>>,
}

impl DecouplerWindow {
    /// Lets the window close if nothing would be lost, or asks.
    pub(super) fn take_close_request(&mut self) {
        let is_requested = self.ctx.input(|input| input.viewport().close_requested());
        if is_requested && !matches!(self.modal, Some(Modal::Closing(_))) {
            let lines = Vec::from_iter(self.unfinished().into_iter().map(|(view, work)| (view, work.work)));
            let is_trained = matches!(self.shared.phase, Phase::Training | Phase::Paused | Phase::Calibrating);
            self.modal = Some(Modal::Closing(Closing {
                can_save: self.keeping.is_some() && is_trained && unfinished_training(&self.shared).is_some(),
                // Files alone need no question: the window shows that it waits for them.
                is_decided: lines.is_empty(),
                is_forced: false,
                lines,
                saving: None,
            }));
        }
        let Some(Modal::Closing(closing)) = &self.modal else {
            return;
        };
        let is_saved = closing.saving.as_ref().is_none_or(|saving| {
            saving.next_event();
            !saving.is_under_way()
        });
        let has_files = !is_saved || self.files.paths().next().is_some();
        let may_close = closing.is_decided && (!has_files || closing.is_forced);
        match (is_requested, may_close) {
            (true, true) if closing.saving.is_some() => {}
            (true, true) => self.worker.forget(),
            (false, true) => self.ctx.send_viewport_cmd(ViewportCommand::Close),
            (true, false) => {
                self.ctx.send_viewport_cmd(ViewportCommand::CancelClose);
                // The question must be visible.
                self.ctx.send_viewport_cmd(ViewportCommand::Minimized(false));
            }
            (false, false) => {}
        }
    }

    /// Closes the window once the files are written, that of the running training among them if it is to be kept.
    pub(super) fn leave(&mut self, keeps_training: bool) {
        if let Some(Modal::Closing(closing)) = &mut self.modal {
            closing.is_forced = closing.is_decided;
            closing.is_decided = true;
            if keeps_training {
                let save = self.worker.saver();
                let job = closing
                    .saving
                    .insert(Background::prompt("closing", Arc::clone(&self.wake)));
                job.start(move |_| save(), |_| ());
            }
        }
    }

    /// Returns the work that closing would cut short, with the name of its view.
    pub(super) fn unfinished(&mut self) -> Vec<(&'static str, Unfinished)> {
        let training = unfinished_training(&self.shared);
        let mut all = Vec::from_iter(training.map(|work| (ViewKind::Train.name(), work)));
        for view in ViewKind::ALL {
            let held = self.views.get(view).holdings(&self.shared);
            all.extend(held.unfinished.into_iter().map(|work| (view.name(), work)));
        }
        let runs = &self.shared.runs;
        if runs.path.is_some() && runs.unwritten > 0 {
            let count = counted(runs.unwritten as u64, "run");
            let progress = format!("{count} could not be written to the folder of runs");
            all.push(("Run list", Unfinished::new("Unwritten runs", progress)));
        }
        all
    }
}

/// Returns the training if it is being prepared or has unsaved epochs.
fn unfinished_training(shared: &Shared) -> Option<Unfinished> {
    let progress = match (shared.phase, shared.source) {
        (Phase::Idle | Phase::Ended(_) | Phase::Died, _) => return None,
        (Phase::Preparing, SourceKind::Array) => "its samples are being drawn".to_owned(),
        (Phase::Preparing, SourceKind::Recording) => "its files are being read".to_owned(),
        (Phase::Training | Phase::Paused | Phase::Calibrating, _) => {
            let run = shared.run.as_ref().filter(|run| !run.is_saved)?;
            let epoch = run.latest().map_or(0, |latest| latest.epoch);
            format!("epoch {epoch} of {}", run.settings().training.stopping.epochs)
        }
    };
    Some(Unfinished::new("Training", progress))
}

/// Lists the unfinished work and asks, or shows the `files` that closing waits for.
pub(super) fn closing_ui(
    ui: &Ui,
    closing: &Closing,
    unfinished: &[(&'static str, Unfinished)],
    files: &str,
) -> Option<Reply> {
    let heading = if closing.is_decided {
        "Finishing files"
    } else {
        "Close with unsaved work?"
    };
    card_ui(ui, "closing", space(150), |ui| {
        ui.label(RichText::new(heading).font(semibold(type_size().title)));
        ui.add_space(space(1));
        if closing.is_decided {
            ui.label(format!(
                "Still being written: {files}. The window will close afterwards."
            ));
        }
        for (view, work) in closing.lines.iter().filter(|_| !closing.is_decided) {
            let now = unfinished.iter().find(|(of, now)| of == view && now.work == *work);
            ui.horizontal(|ui| {
                ui.label(RichText::new(format!("{view}: {work}")).font(semibold(type_size().body)));
                dim_ui(ui, now.map_or("has ended", |(_, now)| &now.progress));
            });
        }
        ui.add_space(space(3));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let mut reply = None;
            // From right to left.
            if closing.can_save && !closing.is_decided {
                let button = ui.add(primary_button("Save training and close"));
                if button.on_hover_text("It can be resumed at the next start.").clicked() {
                    reply = Some(Reply::Leave { keeps_training: true });
                }
            }
            let name = if closing.is_decided {
                "Close without them"
            } else {
                "Close"
            };
            if ui.add(ghost_button(name)).clicked() {
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
