//! The cards in the middle: the decoded surfaces, the readings or the values over time, and the figures of the stream.

use std::ops::RangeInclusive;

use decoupler_core::{live::ZeroGains, text::counted};
use decoupler_files::{
    export::{format_duration, format_number},
    figure::{
        HeatMap,
        surface::{Surface, SurfaceFigure},
    },
    live::{SourcePlan, Tally},
};
use eframe::egui::{Align, Label, Layout, Rect, RichText, Sense, Slider, Ui, WidgetInfo};

use super::{LiveView, engine::Answered, view::command_ui};
use crate::window::{
    plotting::{cells_ui, titled_plots_ui},
    shared::{Command, Effect, Look, Shared, ViewKind, surface_cards_ui, surface_ui, view_mode_ui},
    surface_view::SurfaceView,
    theme::{Theme, semibold, space, type_size},
    widgets::{
        card_ui, coloured_fact_ui, dim_ui, fact_ui, ghost_button, note_ui, primary_button, scrolled_ui,
        section_heading_ui, slider_ui,
    },
};

/// Shows the answers above, the readings or values and the figures below, and the replay bar at the bottom.
pub fn body_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let whole = ui.available_rect_before_wrap();
    let Some(answer) = view.shown.answer.clone() else {
        card_ui(ui, whole, |ui| invitation_ui(ui, view, shared, effects));
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
    let lower_height = (0.46 * cards.height()).clamp(space(60), space(100));
    let (upper, lower) = cards.split_top_bottom_at_y(cards.bottom() - lower_height);
    let figures_width = (0.42 * lower.width()).clamp(space(75), space(110));
    let (left, right) = lower.split_left_right_at_x(lower.right() - figures_width);
    let mut upper = upper.with_max_y(upper.bottom() - gap);
    let left = left.with_max_x(left.right() - gap);
    if let Some(readings) = &answer.readings {
        let readings = readings.clone().coloured(shared.look.colours);
        card_ui(ui, left, |ui| readings_ui(ui, &readings, &answer.faulty));
    }
    if let Some(chart) = &answer.chart {
        let (surface, beside) = upper.split_left_right_at_x(upper.center().x);
        let place = if answer.surfaces.is_empty() { upper } else { beside };
        let title = match answer.network.intervals {
            Some(_) => "Decoded values with their 90 % intervals",
            None => "Decoded values",
        };
        card_ui(ui, place, |ui| titled_plots_ui(ui, title, chart));
        let values_ui = |ui: &mut Ui| values_ui(ui, &answer);
        card_ui(ui, left, |ui| scrolled_ui(ui, "live targets", values_ui));
        upper = surface;
    }
    surfaces_ui(ui, upper, view, shared.look, effects);
    card_ui(ui, right, |ui| {
        scrolled_ui(ui, "live figures", |ui| figures_ui(ui, view, &answer, shared, effects));
    });
    ui.allocate_rect(whole, Sense::hover());
}

/// Height of the replay bar, in points.
const REPLAY_BAR_HEIGHT: f32 = space(12);

/// Shows the position in the recording and the speed.
fn replay_bar_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let Some(replay) = view.shown.replay else { return };
    if view.running.is_none() {
        ui.disable();
    }
    ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
        command_ui(ui, &Command::PlayReplay, view, shared, effects);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let text = RichText::new(format!("{:.1}×", view.source.speed)).size(type_size().note);
            ui.add_sized([space(8), space(6)], Label::new(text));
            if bar_slider_ui(ui, "Replay speed", (&mut view.source.speed, 1.0), 0.1..=10.0, space(24)) {
                view.steer();
            }
            dim_ui(ui, "Speed");
            ui.add_space(space(2));
            let text = format!("{:.2} of {:.2} s", replay.at_s, replay.length_s);
            ui.label(RichText::new(text).size(type_size().note));
            let mut at_s = replay.at_s;
            let (length_s, width) = (replay.length_s.max(f64::MIN_POSITIVE), ui.available_width() - space(2));
            if bar_slider_ui(ui, "Replay position", (&mut at_s, 0.0), 0.0..=length_s, width) {
                view.control(move |control, now| control.seek(at_s, now));
            }
        });
    });
}

/// Shows a slider that a double click resets to `usual`; returns true if its value has changed.
fn bar_slider_ui(
    ui: &mut Ui,
    name: &str,
    (value, usual): (&mut f64, f64),
    range: RangeInclusive<f64>,
    width: f32,
) -> bool {
    let before = *value;
    let is_logarithmic = *range.start() > 0.0;
    let slider = slider_ui(ui, Slider::new(value, range).logarithmic(is_logarithmic), width);
    if slider.double_clicked() {
        *value = usual;
    }
    slider.widget_info(|| WidgetInfo::slider(ui.is_enabled(), before, name));
    slider.on_hover_text("A double click resets it.");
    *value != before
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
        ui.horizontal(|ui| {
            ui.set_min_height(space(7));
            ui.label(RichText::new(&surface.title).font(semibold(type_size().title)));
            if index == 0 {
                let at_right = Layout::right_to_left(Align::Center);
                ui.with_layout(at_right, |ui| view_mode_ui(ui, look, effects));
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

/// Shows the text of an empty view, and the button that starts decoding.
fn invitation_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let (heading, text, button) = invitation(view, shared);
    ui.vertical_centered(|ui| {
        ui.add_space((0.5 * ui.available_height() - space(20)).max(0.0));
        ui.set_max_width(ui.available_width().min(space(105)));
        ui.label(RichText::new(heading).font(semibold(type_size().title)));
        ui.add_space(space(1));
        ui.label(RichText::new(text).color(Theme::of(ui).palette.dim));
        ui.add_space(space(4));
        if button.is_some_and(|button| ui.add(primary_button(button)).clicked()) {
            match button {
                Some(TRAIN) => effects.extend([Effect::Show(ViewKind::Train), Effect::Train]),
                _ => view.start(shared, effects),
            }
        }
        ui.add_space(space(2));
        let hint = "Four seconds of a ball that wanders over a simulated array, with a network that decodes them.";
        let sample = ui.add(ghost_button("Play the sample recording"));
        if sample.on_hover_text(hint).clicked() {
            view.play_sample(shared);
        }
    });
}

/// Buttons and heading of an empty view.
const TRAIN: &str = "Train a network now";
const START: &str = "Start this source";
const HEADING: &str = "Decode live readings";

/// Returns the heading and the text of an empty view, and its button.
fn invitation(view: &LiveView, shared: &Shared) -> (&'static str, String, Option<&'static str>) {
    if let Some(running) = &view.running {
        let text = match &view.shown.counts.last_bad {
            Some(reason) => format!("Malformed lines: {}. Last: {reason}.", view.shown.counts.bad),
            None => format!("It appears here as soon as it arrives from {}.", running.source_text()),
        };
        return ("Waiting for the first frame", text, None);
    }
    let Some((name, file)) = view.network(shared) else {
        let is_busy = shared.phase.is_busy();
        let mut text =
            "Train one with the settings of the Train view, which takes seconds to minutes, or open a network file.";
        if is_busy {
            text = "One is being trained in the Train view: it can be used here as soon as it is finished.";
        }
        let text = format!("Live decoding needs a trained network. {text}");
        return ("No network yet", text, (!is_busy).then_some(TRAIN));
    };
    let text = match view.plan(shared).map(|(_, plan)| plan.source) {
        Err(obstacle) => return (HEADING, obstacle, None),
        Ok(SourcePlan::Simulated(_)) => format!(
            "An indenter wanders over a simulated array and the network '{name}' decodes its readings, without any hardware. To \
             decode your own, choose a replay, a serial port or a TCP address on the left."
        ),
        Ok(_) if file.problem.sensor.is_some() => format!("The network '{name}' decodes its frames as they arrive."),
        Ok(_) => format!("The network '{name}' decodes its samples as they arrive, by the names of their columns."),
    };
    (HEADING, text, Some(START))
}

/// Shows the readings of an array as a map of rows and columns, with the faulty wires marked.
fn readings_ui(ui: &mut Ui, readings: &HeatMap, [rows, columns]: &[Vec<usize>; 2]) {
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        ui.label(RichText::new("Readings").font(semibold(type_size().title)));
    });
    let marks = (&**rows, &**columns, Theme::of(ui).palette.warning);
    if let Some(([row, column], cell)) = cells_ui(ui, "Live readings", readings, marks) {
        let drop_percent = format_number(readings.values[[row, column]]);
        let (row, column) = (&readings.rows[row], &readings.columns[column]);
        cell.on_hover_text_at_pointer(format!(
            "Row-wire {row}, column-wire {column}\ndrop from unloaded: {drop_percent} %"
        ));
    }
}

/// Shows the latest value of each target, with its uncertainty.
fn values_ui(ui: &mut Ui, answer: &Answered) {
    section_heading_ui(ui, "Targets");
    let intervals = answer.network.intervals.as_ref();
    for (index, (target, &value)) in answer.network.problem.targets.iter().zip(&answer.values).enumerate() {
        let half_width = intervals.and_then(|intervals| intervals.half_width(index, value));
        let half_width = half_width.map(|half_width| format!(" ± {}", format_number(half_width)));
        let hint = "Latest decoded value, ± half-width of its 90 % prediction interval if the network has one.";
        let value = format!("{}{}", format_number(value), half_width.unwrap_or_default());
        fact_ui(ui, &target.title(), hint, &value);
    }
}

/// Shows confidence, the stream, and of an array the unloaded state and the recording; warnings above everything else.
fn figures_ui(ui: &mut Ui, view: &mut LiveView, answer: &Answered, shared: &Shared, effects: &mut Vec<Effect>) {
    if let Some((_, consequence)) = &answer.fault {
        note_ui(ui, consequence);
    }
    section_heading_ui(ui, "Confidence");
    let palette = Theme::of(ui).palette;
    for fact in &answer.confidence {
        let colour = if fact.warns { palette.warning } else { palette.text };
        coloured_fact_ui(ui, fact.name, &fact.hint, &fact.value, colour);
    }
    section_heading_ui(ui, "Stream");
    stream_ui(ui, &view.shown.counts);
    if answer.readings.is_some() {
        zero_ui(ui, view);
        recording_ui(ui, view, shared, effects);
    }
    ui.add_space(space(2));
}

/// Shows rate, latency and losses of the stream.
fn stream_ui(ui: &mut Ui, counts: &Tally) {
    let rate = match counts.is_waiting {
        true => "waiting".to_owned(),
        false => format!("{:.0} frames per second", counts.frames_per_second),
    };
    fact_ui(ui, "Rate", "Frames per second (recent).", &rate);
    let hint = "Time from reading a frame to its answer: median and 99th percentile.";
    let quantile = |share| counts.latencies.quantile(share);
    let [median, high] = [0.5, 0.99].map(|share| quantile(share).map_or_else(|| format_number(None), format_duration));
    fact_ui(ui, "Latency", hint, &format!("p50 {median}, p99 {high}"));
    fact_ui(ui, "Decoded", "Frames since the start.", &counts.decoded.to_string());
    let hint = "Frames (lines of a device) that were replaced by newer ones before they could be decoded.";
    fact_ui(ui, "Dropped", hint, &counts.dropped.to_string());
    let hint = "Malformed lines, and frames that could not be decoded.";
    fact_ui(ui, "Bad", hint, &counts.bad.to_string());
    if let Some(reason) = &counts.last_bad {
        dim_ui(ui, &format!("Last: {reason}"));
    }
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
    let length = format!("{}, {:.1} s", counted(recorded.frames, "frame"), recorded.seconds);
    dim_ui(ui, &format!("Recorded {length}.")).on_hover_text(recorded.path.display().to_string());
    let replay = ui.add_enabled(recorded.frames > 0, ghost_button("Replay recording"));
    let hint = "Replays it with the network on the left. Export saves a copy of it.";
    if replay.on_hover_text(hint).clicked() {
        view.replay(&recorded.path, shared, effects);
    }
}
