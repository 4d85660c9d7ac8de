//! The cards in the middle: the decoded surfaces, the readings or the values over time, and the figures of the stream.

use decoupler_core::{live::ZeroGains, text::counted};
use decoupler_files::{
    export::{format_duration, format_number},
    figure::{
        HeatMap, TimeSeries,
        surface::{Surface, SurfaceFigure},
    },
    live::SourcePlan,
};
use eframe::egui::{Align, Layout, Rect, RichText, Sense, Slider, Ui, WidgetInfo};

use super::{LiveView, engine::Answered};
use crate::window::{
    plotting::{SeriesView, cells_ui},
    shared::{
        Command, Effect, Look, Shared, card_head_ui, command_button_ui, surface_cards_ui, surface_ui, target_choice_ui,
        view_mode_ui,
    },
    surface_view::SurfaceView,
    theme::{Theme, semibold, space, type_size},
    widgets::{
        card_ui, coloured_fact_ui, dim_ui, fact_ui, ghost_button, invitation_ui, note_ui, scrolled_ui,
        section_heading_ui, segmented_ui, slider_ui,
    },
};

/// Shows the surfaces, the readings or values, the figures, and the replay bar at the bottom.
pub fn body_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let whole = ui.available_rect_before_wrap();
    let Some(answer) = view.shown.answer.clone() else {
        card_ui(ui, whole, |ui| {
            let text = invitation(view, shared);
            if invitation_ui(ui, &text, "Play the sample recording", view.running.is_none()) {
                view.play_sample(shared);
            }
        });
        ui.allocate_rect(whole, Sense::hover());
        return;
    };
    let gap = space(2);
    let mut cards = whole;
    if view.shown.replay.is_some() {
        let (rest, bar) = whole.split_top_bottom_at_y(whole.bottom() - REPLAY_BAR_HEIGHT);
        card_ui(ui, bar, |ui| replay_bar_ui(ui, view, shared, effects));
        cards = rest.with_max_y(rest.bottom() - gap);
    }
    let split_below = |rect: Rect| {
        let height = (0.46 * rect.height()).clamp(space(45), space(100));
        let (upper, lower) = rect.split_top_bottom_at_y(rect.bottom() - height);
        (upper.with_max_y(upper.bottom() - gap), lower)
    };
    let split_right = |rect: Rect| {
        let width = (0.32 * rect.width()).clamp(space(75), space(100));
        let (left, right) = rect.split_left_right_at_x(rect.right() - width);
        (left.with_max_x(left.right() - gap), right)
    };
    // In a narrow window, the readings are left out.
    let is_narrow = cards.width() < space(130);
    let series = answer.series();
    let has_chart = series.is_some();
    let (main, rest) = if has_chart && !is_narrow {
        split_right(cards)
    } else {
        split_below(cards)
    };
    let (surfaces, values, figures) = match has_chart {
        true if answer.surfaces.is_empty() => (Rect::NOTHING, main, rest),
        true => {
            let (surfaces, chart) = split_below(main);
            (surfaces, chart, rest)
        }
        false if is_narrow => (main, Rect::NOTHING, rest),
        false => {
            let (readings, figures) = split_right(rest);
            (main, readings, figures)
        }
    };
    if !answer.surfaces.is_empty() {
        surfaces_ui(ui, surfaces, view, shared.look, effects);
    }
    if let Some(series) = &series {
        card_ui(ui, values, |ui| {
            if series.targets.len() > SeriesView::tracks(ui) {
                target_choice_ui(ui, "From target", "live target", series.targets, &mut view.series.first);
            }
            let name = |sample| format!("{} s", format_number(series.places[sample]));
            view.series.show(ui, "Decoded values", series, None, name);
        });
    }
    if let Some(readings) = answer.readings.as_ref().filter(|_| values.is_positive()) {
        let readings = readings.clone().coloured(shared.look.colours);
        card_ui(ui, values, |ui| readings_ui(ui, &readings, &answer.faulty));
    }
    card_ui(ui, figures, |ui| {
        scrolled_ui(ui, "live figures", |ui| figures_ui(ui, view, &answer, shared, effects));
    });
    ui.allocate_rect(whole, Sense::hover());
}

/// Height of the replay bar, in points.
const REPLAY_BAR_HEIGHT: f32 = space(12);
/// Speeds of a replay.
const SPEEDS: [(f64, &str); 4] = [(0.1, "0.1×"), (0.5, "0.5×"), (1.0, "1×"), (4.0, "4×")];

/// Shows the position in the recording and the speed.
fn replay_bar_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let Some(replay) = view.shown.replay else { return };
    if view.running.is_none() {
        ui.disable();
    }
    ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
        let play = ghost_button(if replay.is_playing { "⏸ Pause" } else { "▶ Play" });
        let play = play.min_size([space(18), space(6)].into());
        command_button_ui(ui, shared, Command::PlayReplay, play, None, effects);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if let Some(speed) = segmented_ui(ui, "Replay speed", &SPEEDS, view.source.speed, false) {
                view.source.speed = speed;
                view.steer();
            }
            ui.add_space(space(2));
            let text = format!("{:.2} of {:.2} s", replay.at_s, replay.length_s);
            ui.label(RichText::new(text).size(type_size().note));
            let mut at_s = replay.at_s;
            let range = 0.0..=replay.length_s.max(f64::MIN_POSITIVE);
            let width = ui.available_width() - space(2);
            let slider = slider_ui(ui, Slider::new(&mut at_s, range), width);
            slider.widget_info(|| WidgetInfo::slider(ui.is_enabled(), replay.at_s, "Replay position"));
            if at_s != replay.at_s {
                view.control(move |control, now| control.seek(at_s, now));
            }
        });
    });
}

/// Shows the decoded surface, the actual one next to it if it is known, and their colour scale.
fn surfaces_ui(ui: &mut Ui, rect: Rect, view: &mut LiveView, look: Look, effects: &mut Vec<Effect>) {
    let (Some(answer), node) = (&view.shown.answer, &mut view.node) else {
        return;
    };
    let figure = surface_figure(answer, *node, look);
    let cards = (rect, figure.surfaces.len());
    surface_cards_ui(ui, cards, &figure, look, effects, |ui, index, effects| {
        let surface = &figure.surfaces[index];
        card_head_ui(ui, &surface.title, |ui| {
            if index == 0 {
                view_mode_ui(ui, look, effects);
            }
        });
        let view = SurfaceView {
            label: &format!("Live {} surface", surface.title.to_lowercase()),
            surface,
            figure: &figure,
            is_touched: false,
        };
        let shown = surface_ui(ui, view, look, node, effects);
        shown.node_tooltip_ui(|ui, node| {
            let name = answer.nodes.get(node).map_or("", String::as_str);
            ui.label(RichText::new(name).font(semibold(type_size().note)));
            let unit = if answer.readings.is_some() { " mm" } else { "" };
            let values = answer.surfaces.iter().filter_map(|surface| {
                let value = format_number(surface.nodes.get(node)?.z);
                Some(format!("{} {value}{unit}", surface.title.to_lowercase()))
            });
            ui.label(RichText::new(Vec::from_iter(values).join(", ")).size(type_size().note));
        });
    });
}

/// Returns the surfaces of an answer on a common scale.
pub fn surface_figure(answer: &Answered, marked_node: Option<usize>, look: Look) -> SurfaceFigure {
    let dressed = |surface: &Surface| look.dressed(surface, surface.title.clone());
    SurfaceFigure {
        surfaces: answer.surfaces.iter().map(dressed).collect(),
        camera: look.camera,
        marked_node,
        ..SurfaceFigure::default()
    }
    .with_common_scales()
}

/// Returns what an empty view waits for.
fn invitation(view: &LiveView, shared: &Shared) -> String {
    if let Some(running) = &view.running {
        return match &view.shown.counts.last_bad {
            Some(reason) => format!("Malformed lines: {}. Last: {reason}.", view.shown.counts.bad),
            None => format!(
                "Waiting for the first {} from {}.",
                view.unit(shared),
                running.source_text()
            ),
        };
    }
    let Some((name, _)) = view.network(shared) else {
        return match shared.phase.is_busy() {
            true => "A network is being trained: it can be used here as soon as it is finished.".to_owned(),
            false => "Live decoding needs a trained network. The sample recording comes with one.".to_owned(),
        };
    };
    match view.plan(shared).map(|plan| plan.source) {
        Err(obstacle) => obstacle,
        Ok(SourcePlan::Simulated(_)) => format!(
            "Start shows an indenter that wanders over a simulated array, decoded by the network '{name}'. To decode your own \
             readings, choose a replay, a serial port or a TCP address on the left."
        ),
        Ok(_) => format!("Start decodes it with the network '{name}'."),
    }
}

/// Shows the readings of an array as a map of rows and columns, with the faulty wires marked.
fn readings_ui(ui: &mut Ui, readings: &HeatMap, [rows, columns]: &[Vec<usize>; 2]) {
    card_head_ui(ui, "Readings", |_| ());
    let marks = (&**rows, &**columns, Theme::of(ui).palette.warning);
    if let Some(([row, column], cell)) = cells_ui(ui, "Live readings", readings, marks) {
        let drop_percent = format_number(readings.values[[row, column]]);
        let (row, column) = (&readings.rows[row], &readings.columns[column]);
        cell.on_hover_text_at_pointer(format!(
            "Row-wire {row}, column-wire {column}\ndrop from unloaded: {drop_percent} %"
        ));
    }
}

/// Shows the latest values, confidence, the stream, and of an array the unloaded state and the recording; warnings above
/// everything else.
fn figures_ui(ui: &mut Ui, view: &mut LiveView, answer: &Answered, shared: &Shared, effects: &mut Vec<Effect>) {
    if let Some((_, consequence)) = &answer.fault {
        note_ui(ui, consequence);
    }
    if let Some(TimeSeries { targets, intervals, .. }) = answer.series() {
        section_heading_ui(ui, "Targets");
        for (index, (target, &value)) in targets.iter().zip(&answer.values).enumerate() {
            let half_width = intervals.and_then(|intervals| intervals.half_width(index, value));
            let half_width = half_width.map(|half_width| format!(" ± {}", format_number(half_width)));
            let hint = "Latest decoded value, ± half-width of its 90 % prediction interval if the network has one.";
            let value = format!("{}{}", format_number(value), half_width.unwrap_or_default());
            fact_ui(ui, &target.title(), hint, &value);
        }
    }
    section_heading_ui(ui, "Confidence");
    let palette = Theme::of(ui).palette;
    for fact in &answer.confidence {
        let colour = if fact.warns { palette.warning } else { palette.text };
        coloured_fact_ui(ui, fact.name, &fact.hint, &fact.value, colour);
    }
    section_heading_ui(ui, "Stream");
    let counts = &view.shown.counts;
    let hint = "Time from reading a frame to its answer: median and 99th percentile.";
    let quantile = |share| counts.latencies.quantile(share);
    let [median, high] = [0.5, 0.99].map(|share| quantile(share).map_or_else(|| format_number(None), format_duration));
    fact_ui(ui, "Latency", hint, &format!("median {median}, 99 % within {high}"));
    fact_ui(ui, "Decoded", "Answers so far.", &counts.decoded.to_string());
    let hint = "Frames (lines of a device) that were replaced by newer ones before they could be decoded.";
    fact_ui(ui, "Dropped", hint, &counts.dropped.to_string());
    let hint = "Malformed lines, and frames that could not be decoded.";
    fact_ui(ui, "Bad", hint, &counts.bad.to_string());
    if let Some(reason) = &counts.last_bad {
        dim_ui(ui, &format!("Last: {reason}"));
    }
    if answer.readings.is_some() {
        zero_ui(ui, view);
        recording_ui(ui, view, shared, effects);
    }
    ui.add_space(space(2));
}

fn zero_ui(ui: &mut Ui, view: &mut LiveView) {
    let Some(ZeroGains { gains, in_contact, .. }) = &view.shown.zero else {
        return;
    };
    section_heading_ui(ui, "Zero");
    let low = gains.iter().copied().fold(f64::MAX, f64::min);
    let high = gains.iter().copied().fold(f64::MIN, f64::max);
    let hint = "Smallest and largest gain: reading in the unloaded state over the resistance of the model at rest.";
    fact_ui(ui, "Gains", hint, &format!("{low:.4} to {high:.4}"));
    let touched = in_contact.iter().filter(|touched| **touched).count();
    let touched = format!("{touched} of {}", in_contact.len());
    let hint = "Of rows in contact only the gains of their columns were taken, so that the contact is kept.";
    fact_ui(ui, "Rows in contact", hint, &touched);
    let clear = ui.add(ghost_button("Clear zero"));
    let hint = "Compares readings with the model at rest again.";
    if clear.on_hover_text(hint).clicked() {
        view.clear_zero();
    }
}

fn recording_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    // The status line shows one that is under way.
    let Some(recorded) = view.shown.recorded.clone().filter(|_| !view.is_recording()) else {
        return;
    };
    section_heading_ui(ui, "Recording");
    let name = recorded.path.file_name().unwrap_or_default().display();
    let text = format!(
        "Recorded {}, {:.1} s: {name}",
        counted(recorded.frames, "frame"),
        recorded.seconds
    );
    dim_ui(ui, &text).on_hover_text(recorded.path.display().to_string());
    let replay = ui.add_enabled(recorded.frames > 0, ghost_button("Replay recording"));
    let hint = "Replays it with the network on the left. Export saves a copy of it.";
    if replay.on_hover_text(hint).clicked() {
        view.replay(&recorded.path, shared, effects);
    }
}
