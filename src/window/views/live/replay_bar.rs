use eframe::egui::{Align, Key, Label, Layout, RichText, Slider, Ui, WidgetInfo};

use super::{LiveView, engine::Command};
use crate::window::{
    theme::{Theme, space, type_size},
    widgets::{dim_ui, ghost_button, slider_ui, with_shortcut},
};

/// Height of the bar, in points.
pub const REPLAY_BAR_HEIGHT: f32 = space(12);

/// The place in the recording, and the speed.
pub fn replay_bar_ui(ui: &mut Ui, view: &mut LiveView) {
    let Some(replay) = view.shown.replay else { return };
    let is_running = view.running.is_some();
    ui.add_enabled_ui(is_running, |ui| {
        ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
            let text = if replay.is_playing { "⏸ Pause" } else { "▶ Play" };
            let play = ui.add(ghost_button(text).min_size([space(18), space(6)].into()));
            if play
                .on_hover_text(with_shortcut(ui, "Plays or pauses the recording", Key::P))
                .clicked()
            {
                view.command(Command::Play(!replay.is_playing));
            }
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                speed_ui(ui, view);
                ui.add_space(space(2));
                let text = format!("{:.2} of {:.2} s", replay.at_s, replay.length_s);
                ui.label(RichText::new(text).size(type_size().note));
                let mut at_s = replay.at_s;
                let slider = Slider::new(&mut at_s, 0.0..=replay.length_s.max(f64::MIN_POSITIVE));
                let width = ui.available_width() - space(2);
                let slider = slider_ui(ui, slider, width);
                slider.widget_info(|| WidgetInfo::slider(is_running, replay.at_s, "Replay position"));
                if slider.double_clicked() {
                    view.command(Command::Seek(0.0));
                } else if slider.changed() {
                    view.command(Command::Seek(at_s));
                }
            });
        });
    });
}

fn speed_ui(ui: &mut Ui, view: &mut LiveView) {
    let colour = Theme::of(ui).palette.text;
    let text = format!("{:.1}×", view.source.speed);
    ui.add_sized(
        [space(8), space(6)],
        Label::new(RichText::new(text).size(type_size().note).color(colour)),
    );
    let before = view.source.speed;
    let slider = Slider::new(&mut view.source.speed, 0.1..=10.0).logarithmic(true);
    let slider = slider_ui(ui, slider, space(24));
    if slider.double_clicked() {
        view.source.speed = 1.0;
    }
    slider.widget_info(|| WidgetInfo::slider(true, before, "Replay speed"));
    slider.on_hover_text("Recorded seconds per second, from 0.1 to 10. A double click sets it to 1.");
    if view.source.speed != before {
        view.command(Command::Speed(view.source.speed));
    }
    dim_ui(ui, "Speed");
}
