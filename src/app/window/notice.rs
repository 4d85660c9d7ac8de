use eframe::egui::{Align, Frame, Layout, Margin, RichText, Stroke, Ui};

use super::Action;
use crate::app::{
    shared::{Notice, Phase, State},
    theme::{Theme, radius},
};

/// A strip above the work: what went wrong and what to do, or that something worked. Nothing while there is nothing to tell.
pub fn notice_ui(ui: &mut Ui, state: &State) -> Vec<Action> {
    let mut actions = Vec::new();
    let palette = Theme::of(ui).palette;
    let (text, colour) = match &state.notice {
        Some(Notice::Done(text)) => (text, palette.good),
        Some(Notice::Failed(text)) => (text, palette.bad),
        None => return actions,
    };
    let frame = Frame::new()
        .fill(palette.panel)
        .stroke(Stroke::new(1.0, colour))
        .corner_radius(radius())
        .inner_margin(Margin::symmetric(12, 6));
    frame.show(ui, |ui| {
        ui.horizontal(|ui| {
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                if ui.button("Dismiss").clicked() {
                    actions.push(Action::DismissNotice);
                }
                if state.phase == Phase::Died && ui.button("Start again").clicked() {
                    actions.push(Action::RestartWorker);
                }
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    ui.add(eframe::egui::Label::new(RichText::new(text).color(colour)).wrap());
                });
            });
        });
    });
    actions
}
