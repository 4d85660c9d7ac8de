use eframe::egui::{
    Align, ComboBox, Layout, Rect, RichText, Sense, TextWrapMode, Ui, Vec2, containers::menu::MenuButton,
};

use super::{
    TradeAction, TradeEnding, TradeFile, TradeOutcome, TradeState,
    chart::{chart_ui, keys},
    choices::choices_ui,
    names::noise_name,
    table::table_ui,
};
use crate::{
    app::{
        file_task::FileTask,
        plotting::{legend_ui, legend_width},
        shared::State,
        theme::{Theme, semibold, space, type_size},
        widgets::{card_ui, dim_ui, ghost_button, placeholder_ui, scrolled_ui, segmented_ui},
        window::Action,
    },
    evaluation::{TradeCost, TradeLevel},
    export::format_duration,
};

/// The middle of the Trade-off view: both charts above, the table and the choices below.
pub fn trade_ui(ui: &mut Ui, state: &State) -> Vec<Action> {
    let mut actions = Vec::new();
    let whole = ui.available_rect_before_wrap();
    let (Some(outcome), Some(level)) = (&state.trade.outcome, state.trade.shown()) else {
        card_ui(ui, whole, |ui| {
            placeholder_ui(
                ui,
                "Press Measure: every decoder appears here with its error, its time for a frame and its training time, \
                 at several levels of noise.",
            );
        });
        return actions;
    };
    let gap = space(2);
    let lower_height = (0.38 * whole.height()).clamp(space(50), space(85));
    let (upper, lower) = whole.split_top_bottom_at_y(whole.bottom() - lower_height);
    card_ui(ui, upper.with_max_y(upper.max.y - gap), |ui| {
        head_ui(ui, state, outcome, &mut actions);
        legends_ui(ui, level);
        charts_ui(ui, state, level, &mut actions);
    });
    let choices_width = (0.4 * lower.width()).clamp(space(76), space(105));
    let (left, right) = lower.split_left_right_at_x(lower.right() - choices_width);
    card_ui(ui, left.with_max_x(left.max.x - gap), |ui| {
        actions.extend(table_ui(ui, state, level));
    });
    card_ui(ui, right, |ui| {
        scrolled_ui(ui, "trade choices", |ui| actions.extend(choices_ui(ui, state, level)));
    });
    ui.allocate_rect(whole, Sense::hover());
    actions
}

fn head_ui(ui: &mut Ui, state: &State, outcome: &TradeOutcome, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        ui.label(RichText::new("Speed against accuracy").font(semibold(type_size().title)));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            export_ui(ui, outcome, actions);
            level_ui(ui, &state.trade, outcome, actions);
        });
    });
}

/// Few levels stand side by side, many in a list.
fn level_ui(ui: &mut Ui, trade: &TradeState, outcome: &TradeOutcome, actions: &mut Vec<Action>) {
    let names: Vec<String> = outcome.plan.noises.iter().map(|&noise| noise_name(noise)).collect();
    let picked = if names.len() <= 5 {
        let options: Vec<_> = names
            .iter()
            .enumerate()
            .map(|(level, name)| (level, name.as_str()))
            .collect();
        segmented_ui(ui, "Noise on show", &options, trade.level, false)
    } else {
        let mut picked = None;
        let combo = ComboBox::from_id_salt("noise on show").selected_text(&names[trade.level]);
        combo.show_ui(ui, |ui| {
            for (level, name) in names.iter().enumerate() {
                if ui.selectable_label(level == trade.level, name).clicked() {
                    picked = Some(level);
                }
            }
        });
        picked
    };
    actions.extend(picked.map(TradeAction::ShowLevel).map(Action::from));
    dim_ui(ui, "Noise");
}

fn export_ui(ui: &mut Ui, outcome: &TradeOutcome, actions: &mut Vec<Action>) {
    ui.add_enabled_ui(outcome.points().0 > 0, |ui| {
        let button = MenuButton::from_button(ghost_button("Export"));
        let (button, _) = button.ui(ui, |ui| {
            ui.style_mut().wrap_mode = Some(TextWrapMode::Extend);
            for file in TradeFile::ALL {
                let choice = ui.button(file.name()).on_hover_text(file.description());
                if choice.clicked() {
                    actions.push(Action::ChooseFile(FileTask::SaveTrade(file)));
                }
            }
        });
        button.on_disabled_hover_text("There is nothing to export before the first point is measured");
    });
}

/// In as many rows as they need, then what the shapes mean.
fn legends_ui(ui: &mut Ui, level: &TradeLevel) {
    let keys = keys(level, &Theme::of(ui).palette);
    let rows = (legend_width(ui, &keys) / ui.available_width()).ceil().max(1.0) as usize;
    for row in keys.chunks(keys.len().div_ceil(rows)) {
        legend_ui(ui, row);
    }
    dim_ui(
        ui,
        "Discs: paper preset; diamonds: best preset; hollow: 32 bits; rings: the answers below; dotted: their limits.",
    );
}

fn charts_ui(ui: &mut Ui, state: &State, level: &TradeLevel, actions: &mut Vec<Action>) {
    let place = ui.available_rect_before_wrap();
    if level.points.is_empty() {
        let text = match state.trade.running {
            Some(_) => "The points of this noise appear as they are measured.",
            None => "The measurement ended before this noise.",
        };
        placeholder_ui(ui, text);
        return;
    }
    let gap = space(3);
    let width = 0.5 * (place.width() - gap);
    for (number, cost) in TradeCost::ALL.into_iter().enumerate() {
        let left = place.left() + (width + gap) * number as f32;
        let rect = Rect::from_min_size([left, place.top()].into(), Vec2::new(width, place.height()));
        let mut slot = ui.new_child(eframe::egui::UiBuilder::new().max_rect(rect));
        actions.extend(chart_ui(&mut slot, state, level, cost));
    }
}

/// What is going on, in the line at the bottom.
pub fn status_ui(ui: &mut Ui, trade: &TradeState) {
    let palette = Theme::of(ui).palette;
    let (colour, text) = match (&trade.running, &trade.outcome) {
        (Some(_), Some(outcome)) => {
            let (done, all) = outcome.points();
            (palette.accent, format!("Measuring: {done} of {all} points"))
        }
        (_, Some(outcome)) => {
            let (done, all) = outcome.points();
            let took = outcome
                .took
                .map_or_else(String::new, |took| format!(" in {}", format_duration(took)));
            match outcome.ending {
                Some(TradeEnding::Complete) => (palette.good, format!("Measured {all} points{took}")),
                _ => (palette.warning, format!("Ended early: {done} of {all} points{took}")),
            }
        }
        (_, None) => (palette.dim, "Ready: press Measure".to_owned()),
    };
    ui.horizontal_centered(|ui| {
        ui.spacing_mut().item_spacing.x = space(4);
        let (dot, _) = ui.allocate_exact_size(Vec2::splat(space(2)), Sense::hover());
        ui.painter().circle_filled(dot.center(), 4.0, colour);
        ui.label(RichText::new(text).size(type_size().note));
        if let Some(outcome) = &trade.outcome {
            let text = format!("{}, one thread, median of many", outcome.plan.base.source.sensor.scale);
            ui.label(RichText::new(text).size(type_size().note).color(palette.dim));
        }
    });
}
