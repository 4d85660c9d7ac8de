use eframe::egui::{
    Align, Button, FontId, Label, Layout, Response, RichText, Sense, Stroke, Ui, Vec2, WidgetInfo, accesskit::Role,
};

use super::Action;
use crate::app::{
    shared::{Phase, State, View},
    theme::{Theme, semibold, space, type_size},
    views::compare::RunsAction,
    widgets::{ghost_button, primary_button, segmented_ui},
};

/// Name, snapshot, and the buttons that run the training.
pub fn top_bar_ui(ui: &mut Ui, state: &State) -> Vec<Action> {
    let mut actions = Vec::new();
    ui.horizontal_centered(|ui| {
        ui.add_space(space(1));
        mark_ui(ui);
        // The title of the window says it too: where there is little room the buttons go first.
        if ui.available_width() > space(250) {
            ui.add(Label::new(RichText::new("Decoupler").font(semibold(type_size().title))).selectable(false));
        }
        ui.add_space(space(4));
        let views = [
            (View::Train, "Train"),
            (View::Experiments, "Experiments"),
            (View::Compare, "Compare"),
            (View::Identifiability, "Identifiability"),
            (View::TradeOff, "Trade-off"),
        ];
        if let Some(view) = segmented_ui(ui, "View", &views, state.view, false) {
            actions.push(Action::ShowView(view));
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.add_space(space(1));
            theme_ui(ui, state, &mut actions);
            match state.view {
                View::Train => {
                    run_buttons_ui(ui, state, &mut actions);
                    ui.add_space(space(4));
                    let snapshots = state.test().map_or(0, |test| test.snapshots.len());
                    actions.extend(snapshot_ui(ui, state.look.snapshot, snapshots).map(Action::ShowSnapshot));
                }
                View::Experiments | View::Identifiability | View::TradeOff => {}
                View::Compare => {
                    let picked = snapshot_ui(ui, state.runs.snapshot, state.runs.snapshots());
                    actions.extend(picked.map(|snapshot| RunsAction::ShowSnapshot(snapshot).into()));
                }
            }
        });
    });
    actions
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

fn theme_ui(ui: &mut Ui, state: &State, actions: &mut Vec<Action>) {
    let is_dark = state.look.is_dark;
    let (text, label) = if is_dark {
        ("Light", "Switch to the light theme")
    } else {
        ("Dark", "Switch to the dark theme")
    };
    let button = ui.add(ghost_button(text)).on_hover_text(label);
    if button.clicked() {
        actions.push(Action::SetDark(!is_dark));
    }
}

fn run_buttons_ui(ui: &mut Ui, state: &State, actions: &mut Vec<Action>) {
    let is_busy = state.phase.is_busy();
    let stop = ui.add_enabled(is_busy, ghost_button("■ Stop"));
    if stop
        .on_hover_text("End the training; the best network so far stays (Ctrl+.)")
        .clicked()
    {
        actions.push(Action::Stop);
    }
    let held = state.phase == Phase::Paused;
    let (text, action) = if held {
        ("▶ Resume", Action::Resume)
    } else {
        ("⏸ Pause", Action::Pause)
    };
    let can_pause = matches!(state.phase, Phase::Training | Phase::Paused);
    if ui
        .add_enabled(can_pause, ghost_button(text))
        .on_hover_text("Hold the training, or go on (Ctrl+P)")
        .clicked()
    {
        actions.push(action);
    }
    let can_train = !is_busy && state.phase != Phase::Died;
    let train = ui.add_enabled(can_train, primary_button("▶ Train"));
    let can_continue = state.can_continue();
    let hint = if can_continue {
        "Begin anew: draw the sets and train the network (Ctrl+Enter)"
    } else {
        "Draw the sets and train the network (Ctrl+Enter)"
    };
    if train.on_hover_text(hint).clicked() {
        actions.push(Action::Train);
    }
    if can_continue {
        let hint = "Go on from the present weights with the method and the epochs on the left, counted from here; Train \
                    begins anew";
        let go_on = ui.add(ghost_button("Continue"));
        if go_on.on_hover_text(hint).clicked() {
            actions.push(Action::Continue);
        }
    }
}

/// The number of the snapshot on show, and arrows to its neighbours; returns the one picked.
fn snapshot_ui(ui: &mut Ui, shown: usize, snapshots: usize) -> Option<usize> {
    let mut picked = None;
    // Right to left: next, number, previous.
    let next = ui.add_enabled(shown + 1 < snapshots, arrow_button("›"));
    if name(next, "Next snapshot")
        .on_hover_text("Next snapshot of the test set (Page down)")
        .clicked()
    {
        picked = Some(shown + 1);
    }
    let number = if snapshots == 0 {
        "–".to_owned()
    } else {
        format!("{} of {snapshots}", shown + 1)
    };
    ui.label(number);
    let previous = ui.add_enabled(shown > 0, arrow_button("‹"));
    if name(previous, "Previous snapshot")
        .on_hover_text("Previous snapshot of the test set (Page up)")
        .clicked()
    {
        picked = Some(shown - 1);
    }
    let dim = Theme::of(ui).palette.dim;
    let font = FontId::proportional(type_size().body);
    let galley = ui.painter().layout_no_wrap("Test snapshot".to_owned(), font, dim);
    if ui.available_width() >= galley.size().x {
        ui.label(RichText::new("Test snapshot").color(dim));
    }
    picked
}

fn arrow_button(text: &str) -> Button<'_> {
    Button::new(text).min_size(Vec2::splat(space(6)))
}

fn name(response: Response, label: &'static str) -> Response {
    let is_enabled = response.enabled();
    response.widget_info(|| WidgetInfo::labeled(Role::Button, is_enabled, label));
    response
}
