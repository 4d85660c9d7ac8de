//! Identifiability of an array: pictures, findings and status line.

use std::{ops::RangeInclusive, sync::Arc};

use decoupler_core::text::counted;
use decoupler_files::{
    export::format_number,
    figure::{
        Figure, PlotFigure, singular_values_figure,
        surface::{Quantity, Surface, SurfaceFigure, ViewMode},
    },
};
use eframe::egui::{Align, Layout, Rect, RichText, Sense, Ui, UiBuilder, Vec2};

use super::{Analysis, IdentifiabilityView};
use crate::window::{
    glossary,
    plotting::titled_plots_ui,
    shared::{Effect, Look, Shared, Shown, Status, Tone, colour_scale_ui, follow_surface, view_mode_ui},
    surface_view::{ColourBar, SurfaceView},
    test_view::Frame,
    theme::{Theme, semibold, space, type_size},
    widgets::{
        card_ui, fact_ui, fields::capitalised, note_ui, placeholder_ui, scrolled_ui, section_heading_ui, segmented_ui,
    },
};

/// Shows pattern and sensitivity above, singular values and findings below.
pub(super) fn identifiability_ui(
    ui: &mut Ui,
    shown: &mut IdentifiabilityView,
    shared: &Shared,
    effects: &mut Vec<Effect>,
) {
    let whole = ui.available_rect_before_wrap();
    let Some(analysis) = &shown.analysis else {
        card_ui(ui, whole, |ui| match &shown.problem {
            Some(problem) => {
                note_ui(ui, problem);
            }
            None => placeholder_ui(ui, "The singular values are being computed."),
        });
        return;
    };
    let gap = space(2);
    let lower_height = (0.44 * whole.height()).clamp(space(60), space(100));
    let (upper, lower) = whole.split_top_bottom_at_y(whole.bottom() - lower_height);
    let upper = upper.with_max_y(upper.max.y - gap);
    let width = 0.5 * (upper.width() - gap);
    let place = shown.place_of_axis(analysis.question.scene.movement.axes());
    let figure = identifiability_figure(shown, analysis, place, shared.look);
    let labels = ["Worst-seen deformation of each row", "Sensitivity of each node"];
    let mut pointed = (shown.axis, shown.node);
    for (card, (surface, label)) in figure.surfaces.iter().zip(labels).enumerate() {
        let left = upper.left() + (width + gap) * card as f32;
        let card = Rect::from_min_size([left, upper.top()].into(), Vec2::new(width, upper.height()));
        card_ui(ui, card, |ui| {
            let slot = surface_ui(ui, surface, label, shared.look, analysis, &mut pointed, effects);
            colour_scale_ui(ui, slot, surface, &figure.note(), shared.look, effects);
        });
    }
    let facts_width = (0.42 * lower.width()).clamp(space(75), space(110));
    let (left, right) = lower.split_left_right_at_x(lower.right() - facts_width);
    card_ui(ui, left.with_max_x(left.max.x - gap), |ui| {
        titled_plots_ui(ui, "Singular values", &singular_values(analysis));
    });
    card_ui(ui, right, |ui| {
        scrolled_ui(ui, "identifiability facts", |ui| {
            if let Some(problem) = &shown.problem {
                note_ui(ui, problem);
            }
            facts_ui(ui, analysis);
        });
    });
    ui.allocate_rect(whole, Sense::hover());
    (shown.axis, shown.node) = pointed;
}

pub(super) fn singular_values(analysis: &Analysis) -> PlotFigure {
    singular_values_figure(&analysis.rows, analysis.worst, analysis.hidden_below_per_mm())
}

/// Returns the range from 0 to the largest sensitivity along any axis.
fn sensitivity_range(analysis: &Analysis) -> RangeInclusive<f64> {
    let nodes = analysis.sensitivities.iter().flat_map(|frame| frame.nodes_mm.iter());
    let largest = nodes.map(|node| node.z).filter(|z| z.is_finite()).fold(0.0, f64::max);
    0.0..=largest.max(f64::MIN_POSITIVE)
}

/// Returns the surfaces of the worst-seen pattern and of the sensitivity of the nodes.
pub(super) fn identifiability_figure(
    shown: &IdentifiabilityView,
    analysis: &Analysis,
    place: usize,
    look: Look,
) -> SurfaceFigure {
    let surface = |title: &str, frame: &Frame, quantity, range, mode| Surface {
        title: title.to_owned(),
        map: Arc::clone(&analysis.surface),
        values: Arc::clone(&frame.grid_mm),
        nodes: Arc::clone(&frame.nodes_mm),
        quantity,
        range,
        mode,
        colours: look.colours,
    };
    let (pattern, sensitivity) = (&analysis.patterns[place], &analysis.sensitivities[place]);
    let pattern = surface(
        "Worst-seen deformation",
        pattern,
        Quantity::Pattern,
        -1.0..=1.0,
        look.mode,
    );
    let (quantity, range) = (Quantity::Sensitivity, sensitivity_range(analysis));
    let sensitivity = surface("Sensitivity of each node", sensitivity, quantity, range, ViewMode::Top);
    SurfaceFigure {
        surfaces: vec![pattern, sensitivity],
        camera: look.camera,
        marked_node: shown.node,
        ..SurfaceFigure::default()
    }
}

/// Shows one of the two pictures; `axis` is the displayed axis, `node` the node marked on both. Returns the space for
/// its colour scale.
fn surface_ui(
    ui: &mut Ui,
    surface: &Surface,
    label: &str,
    look: Look,
    analysis: &Analysis,
    (axis, node): &mut (usize, Option<usize>),
    effects: &mut Vec<Effect>,
) -> Rect {
    let theme = Theme::of(ui);
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        ui.label(RichText::new(&surface.title).font(semibold(type_size().title)));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| match surface.quantity {
            Quantity::Pattern => view_mode_ui(ui, look, effects),
            _ => axes_ui(ui, axis, analysis),
        });
    });
    let space_left = ui.available_rect_before_wrap();
    let (picture, scale) = space_left.split_left_right_at_x(space_left.right() - ColourBar::WIDTH);
    let mut slot = ui.new_child(UiBuilder::new().max_rect(picture));
    let marked_node = *node;
    let view = SurfaceView {
        label,
        surface,
        marked_node,
        lit_nodes: &[],
        section: None,
        theme,
    };
    let shown = view.show(&mut slot, look.camera);
    follow_surface(&shown, look, node, effects);
    shown.node_tooltip_ui(|ui, node| node_ui(ui, analysis, surface, node));
    scale
}

fn node_ui(ui: &mut Ui, analysis: &Analysis, surface: &Surface, node: usize) {
    let per_row = analysis.question.sensor.scale.nodes_per_row();
    let (Some(at), Some(row)) = (surface.nodes.get(node), analysis.rows.get(node / per_row)) else {
        return;
    };
    let name = format!("Row {}, node {}", row.row + 1, node % per_row + 1);
    ui.label(RichText::new(name).font(semibold(type_size().note)));
    let value = format_number(at.z);
    let text = match surface.quantity {
        Quantity::Pattern => format!("{value} of the largest deflection"),
        _ => format!("readings change by {value} per mm"),
    };
    ui.label(RichText::new(text).size(type_size().note));
}

/// Shows the choice of the displayed coordinate, if several are unknown.
fn axes_ui(ui: &mut Ui, axis: &mut usize, analysis: &Analysis) {
    let axes = analysis.question.scene.movement.axes().indices();
    if axes.len() < 2 {
        return;
    }
    let options = [(0, "x"), (1, "y"), (2, "z")];
    *axis = segmented_ui(ui, "Displayed axis", &options, *axis, false).unwrap_or(*axis);
}

/// Returns what the view shows: surfaces and singular values.
pub(super) fn shown<'a>(view: &'a IdentifiabilityView, shared: &'a Shared) -> Vec<Shown<'a>> {
    let analysis = view.analysis.as_ref();
    let analysis = analysis.ok_or_else(|| match &view.problem {
        Some(problem) => problem.clone(),
        None => "The singular values are still being computed.".to_owned(),
    });
    let surfaces = analysis.clone().map(|analysis| {
        let place = view.place_of_axis(analysis.question.scene.movement.axes());
        move || Figure::from(identifiability_figure(view, analysis, place, shared.look))
    });
    let values = analysis.map(|analysis| || Figure::from(singular_values(analysis)));
    vec![
        Shown::figure("Surfaces", "identifiability".to_owned(), surfaces),
        Shown::figure("Singular values", "singular-values".to_owned(), values),
    ]
}

/// Shows the state of the analysis in the line at the bottom.
pub(super) fn status(shown: &IdentifiabilityView) -> Status {
    let (tone, text) = match (&shown.problem, &shown.analysis) {
        _ if shown.is_pending => (Tone::Busy, "Computing".to_owned()),
        (Some(_), _) => (
            Tone::Bad,
            "This sensor or scene is not possible: the note says why".to_owned(),
        ),
        (None, Some(analysis)) => match analysis.warnings.len() {
            0 => (Tone::Good, "No warnings: nothing prevents decoupling".to_owned()),
            1 => (Tone::Warning, "1 warning".to_owned()),
            count => (Tone::Warning, format!("{count} warnings")),
        },
        (None, None) => (Tone::Calm, "Nothing computed yet".to_owned()),
    };
    let status = Status::new(tone, text);
    match &shown.analysis {
        Some(analysis) => {
            let sensor = &analysis.question.sensor;
            status.with_note(format!(
                "{}, {} read",
                sensor.scale,
                counted(analysis.rows.len(), "row")
            ))
        }
        None => status,
    }
}

/// Shows warnings with what to change, then the figures.
pub fn facts_ui(ui: &mut Ui, analysis: &Analysis) {
    section_heading_ui(ui, "Findings");
    if analysis.warnings.is_empty() {
        let text = RichText::new(summary(analysis)).size(type_size().note);
        ui.label(text.color(Theme::of(ui).palette.good));
    }
    for warning in &analysis.warnings {
        note_ui(ui, &format!("{}.", capitalised(warning)));
    }
    ui.add_space(space(2));
    for (name, meaning, value) in facts(analysis) {
        fact_ui(ui, name, meaning, &value);
    }
}

/// Returns the summary shown where there are no warnings.
fn summary(analysis: &Analysis) -> String {
    let (seen, patterns) = (analysis.patterns_seen(), analysis.worst_row().unknowns());
    if analysis.noise.total() == 0.0 {
        "Without noise, the readings determine every deformation.".to_owned()
    } else if seen == patterns {
        "Every deformation pattern is above the noise.".to_owned()
    } else {
        format!(
            "The noise hides {} of {patterns} deformation patterns: for those, a decoder can only give the most \
             likely value. To see more, lower the noise, reduce the height, widen the node pitch, or add column-wires.",
            patterns - seen
        )
    }
}

fn facts(analysis: &Analysis) -> Vec<(&'static str, &'static str, String)> {
    let worst = analysis.worst_row();
    let condition = worst.condition();
    let condition = if condition.is_finite() {
        format_number(condition)
    } else {
        "infinite".to_owned()
    };
    let alike = analysis.alike.map_or_else(
        || "the row is known".to_owned(),
        |([first, second], difference)| format!("{} and {}, by {}", first + 1, second + 1, format_number(difference)),
    );
    let mut facts = vec![
        (
            "Unknowns of a row",
            "Number of coordinates to decode from the readings of one row-wire.",
            worst.unknowns().to_string(),
        ),
        (
            "Readings of a row",
            "Number of resistances measured for one row-wire, one for each column-wire.",
            worst.equations.to_string(),
        ),
        ("Condition number", glossary::CONDITION_NUMBER.hint, condition),
        (
            "Worst row",
            "The row-wire with the smallest singular value.",
            (worst.row + 1).to_string(),
        ),
        (
            "Most similar rows",
            "The two row-wires with the most similar readings at rest, and their relative difference.",
            alike,
        ),
    ];
    if analysis.noise.total() > 0.0 {
        facts.extend(noise_facts(analysis));
    }
    facts
}

fn noise_facts(analysis: &Analysis) -> [(&'static str, &'static str, String); 4] {
    let worst = analysis.worst_row();
    let spread_mm = worst.worst_spread_mm(analysis.noise.own);
    let spread = if spread_mm.is_finite() {
        format!("{} mm", format_number(spread_mm))
    } else {
        "infinite".to_owned()
    };
    let share = 100.0 * worst.remaining_share(analysis.noise.own, analysis.prior_mm);
    let prior = format_number(analysis.prior_mm);
    [
        (
            "Noise of a reading",
            "Relative standard deviation of one reading, from all noise sources of the scene.",
            format_number(analysis.noise.total()),
        ),
        (
            "Deformation patterns above the noise",
            "Number of deformation patterns of the worst row that the readings determine better than the scene alone \
             does.",
            format!("{} of {}", analysis.patterns_seen(), worst.unknowns()),
        ),
        (
            "Uncertainty of the worst pattern",
            "Standard deviation of the worst-seen deformation pattern, in mm, from the readings alone.",
            spread,
        ),
        (
            "Remaining spread",
            "Spread of the deformation after a reading, in percent of its spread before (root mean square over \
             patterns).",
            format!("{} % of {prior} mm", format_number(share)),
        ),
    ]
}
