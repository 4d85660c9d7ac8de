use std::time::Duration;

use eframe::egui::{Align, Layout, RichText, Slider, Ui, Vec2, WidgetInfo, accesskit::Role};

use super::ScrubState;
use crate::window::{
    theme::{Theme, space, type_size},
    widgets::{ghost_button, slider_ui},
};
use decoupler_core::evaluation::PastNetworks;

/// Height of the bar, in points.
pub(in crate::window::views::train) const HEIGHT: f32 = space(8);

/// Time between two frames of a replay.
const FRAME: Duration = Duration::from_millis(33);

/// A slider over the epochs of the training, a button that replays them, and the way back to the latest.
pub fn scrub_bar_ui(ui: &mut Ui, scrub: &mut ScrubState, past: &PastNetworks) {
    let epochs: Vec<usize> = past.epochs().collect();
    let Some((&latest, others)) = epochs.split_last().filter(|(_, others)| !others.is_empty()) else {
        return;
    };
    let now_seconds = ui.input(|input| input.time);
    if scrub.is_replaying() {
        scrub.replay(now_seconds, past);
        ui.ctx().request_repaint_after(FRAME);
    }
    ui.horizontal(|ui| {
        ui.set_min_height(HEIGHT);
        replay_button_ui(ui, scrub, now_seconds, past);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let is_past = scrub.epoch().is_some();
            let button = ui.add_enabled(is_past, ghost_button("Latest").min_size(Vec2::new(0.0, space(6))));
            if button
                .on_hover_text("Shows the latest network again. Export offers the displayed network and the best.")
                .clicked()
            {
                scrub.show_latest();
                ui.request_repaint();
            }
            // As wide as the widest, so that the slider keeps its length.
            let palette = Theme::of(ui).palette;
            let (text, colour) = match scrub.epoch() {
                Some(epoch) => (format!("Network of epoch {epoch}"), palette.warning),
                None => (format!("Latest, epoch {latest}"), palette.dim),
            };
            let size = Vec2::new(space(38), space(6));
            ui.allocate_ui_with_layout(size, Layout::right_to_left(Align::Center), |ui| {
                ui.set_min_width(size.x);
                ui.label(RichText::new(text).size(type_size().note).color(colour));
            });
            epoch_slider_ui(ui, scrub, past, others.len(), &epochs);
        });
    });
}

fn replay_button_ui(ui: &mut Ui, scrub: &mut ScrubState, now_seconds: f64, past: &PastNetworks) {
    let (text, name) = if scrub.is_replaying() {
        ("⏸", "Stop the replay")
    } else {
        ("▶", "Replay the training")
    };
    let button = ui.add(ghost_button(text).min_size(Vec2::splat(space(6))));
    button.widget_info(|| WidgetInfo::labeled(Role::Button, true, name));
    let hint = "Replays the training: the surfaces, tables and histogram of each epoch in turn.";
    if button.on_hover_text(hint).clicked() {
        scrub.toggle_replay(now_seconds, past);
        ui.request_repaint();
    }
}

fn epoch_slider_ui(ui: &mut Ui, scrub: &mut ScrubState, past: &PastNetworks, last: usize, epochs: &[usize]) {
    let shown = scrub
        .epoch()
        .map_or(last, |epoch| epochs.partition_point(|other| *other < epoch));
    let mut place = shown;
    let width = (ui.available_width() - space(2)).max(space(10));
    let slider = slider_ui(ui, Slider::new(&mut place, 0..=last), width);
    if slider.double_clicked() {
        place = last;
    }
    slider.widget_info(|| WidgetInfo::slider(true, epochs[place.min(last)] as f64, "Epoch of the displayed network"));
    if place != shown {
        // The hand takes over from the replay.
        if scrub.is_replaying() {
            scrub.toggle_replay(0.0, past);
        }
        scrub.show(epochs[place.min(last)], past);
        ui.request_repaint();
    }
    let hint = match past.stride() {
        1 => "Brings back the network that a training stopped at this epoch would have kept.".to_owned(),
        stride => format!(
            "Brings back the network that a training stopped at this epoch would have kept. Every {stride}th is \
             remembered, so that they take no more than {} MB.",
            PastNetworks::MAX_BYTES >> 20
        ),
    };
    slider.on_hover_text(hint);
}
