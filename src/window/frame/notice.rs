use eframe::egui::{Align, Frame, Layout, Margin, RichText, Stroke, Ui};

use crate::window::{
    shared::Notice,
    theme::{Theme, radius},
};

/// Reply of the user to a notice.
pub enum Reply {
    /// It has been read.
    Dismiss,
    /// The training thread shall start again.
    Restart,
}

/// A strip above the work: what went wrong and what to do, or that something worked. The training thread can be started
/// again from it if it `can_restart`.
pub fn notice_ui(ui: &mut Ui, notice: &Notice, can_restart: bool) -> Option<Reply> {
    let mut reply = None;
    let palette = Theme::of(ui).palette;
    let (text, colour) = match notice {
        Notice::Done(text) => (text, palette.good),
        Notice::Failed(text) => (text, palette.bad),
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
                    reply = Some(Reply::Dismiss);
                }
                if can_restart && ui.button("Start again").clicked() {
                    reply = Some(Reply::Restart);
                }
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    ui.add(eframe::egui::Label::new(RichText::new(text).color(colour)).wrap());
                });
            });
        });
    });
    reply
}
