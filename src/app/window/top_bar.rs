use eframe::egui::{Align, Label, Layout, RichText, Sense, Stroke, Ui, Vec2};

use crate::app::{
    theme::{Theme, semibold, space, type_size},
    widgets::{ghost_button, segmented_ui},
};

/// Name, views, and the tools of the one on show, which `tools_ui` lays out from right to left. Returns the view picked,
/// by its place, and whether the user wants the other theme.
pub fn top_bar_ui(
    ui: &mut Ui,
    views: &[(usize, &str)],
    shown: usize,
    tools_ui: impl FnOnce(&mut Ui),
) -> (Option<usize>, bool) {
    ui.horizontal_centered(|ui| {
        ui.add_space(space(1));
        mark_ui(ui);
        // The title of the window says it too: where there is little room the buttons go first.
        if ui.available_width() > space(250) {
            ui.add(Label::new(RichText::new("Decoupler").font(semibold(type_size().title))).selectable(false));
        }
        ui.add_space(space(4));
        let picked = segmented_ui(ui, "View", views, shown, false);
        let is_other_theme = ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.add_space(space(1));
            let is_other_theme = theme_ui(ui);
            tools_ui(ui);
            is_other_theme
        });
        (picked, is_other_theme.inner)
    })
    .inner
}

fn mark_ui(ui: &mut Ui) {
    let theme = Theme::of(ui);
    let (rect, _) = ui.allocate_exact_size(Vec2::splat(space(5)), Sense::hover());
    // Three wires crossed by three, with one node pressed: the sensor in small.
    let painter = ui.painter();
    let stroke = Stroke::new(1.2, theme.palette.dim);
    let inner = rect.shrink(space(1) - 1.0);
    for step in 0..3 {
        let share = 0.5 * step as f32;
        painter.hline(inner.x_range(), inner.top() + share * inner.height(), stroke);
        painter.vline(inner.left() + share * inner.width(), inner.y_range(), stroke);
    }
    painter.circle_filled(inner.center(), 3.5, theme.palette.accent);
}

/// Returns whether the user wants the other theme.
fn theme_ui(ui: &mut Ui) -> bool {
    let (text, label) = if Theme::of(ui).is_dark {
        ("Light", "Switch to the light theme")
    } else {
        ("Dark", "Switch to the dark theme")
    };
    ui.add(ghost_button(text)).on_hover_text(label).clicked()
}
