//! Pictures, findings and exports of an analysis.

use decoupler_files::{
    export::format_number,
    figure::{
        Figure, PlotFigure, singular_values_figure,
        surface::{Quantity, Surface, SurfaceFigure},
    },
};
use eframe::egui::{Align, Layout, RichText, Sense, Ui};

use super::{Analysis, SensorView, view::RECORDED};
use crate::window::{
    forms::meaning,
    plotting::titled_plots_ui,
    shared::{Effect, Look, Shared, Shown, SourceKind, surface_cards_ui, surface_ui, view_mode_ui},
    surface_view::SurfaceView,
    theme::{Theme, semibold, space, type_size},
    widgets::{card_ui, fact_ui, fields::capitalised, note_ui, scrolled_ui, section_heading_ui, segmented_ui},
};

/// Shows pattern and sensitivity above, singular values and findings below. Returns the axis and the node that the user
/// picked.
pub(super) fn analysis_ui(
    ui: &mut Ui,
    view: &SensorView,
    analysis: &Analysis,
    look: Look,
    effects: &mut Vec<Effect>,
) -> (usize, Option<usize>) {
    let whole = ui.available_rect_before_wrap();
    let gap = space(2);
    let lower_height = (0.44 * whole.height()).clamp(space(60), space(100));
    let (upper, lower) = whole.split_top_bottom_at_y(whole.bottom() - lower_height);
    let figure = surfaces_figure(view, analysis, look);
    let cards = (upper.with_max_y(upper.max.y - gap), figure.surfaces.len());
    let mut picked = (view.axis, view.node);
    surface_cards_ui(ui, cards, &figure, look, effects, |ui, place, effects| {
        pattern_ui(ui, &figure, place, look, analysis, &mut picked, effects);
    });
    let facts_width = (0.42 * lower.width()).clamp(space(75), space(110));
    let (left, right) = lower.split_left_right_at_x(lower.right() - facts_width);
    card_ui(ui, left.with_max_x(left.max.x - gap), |ui| {
        titled_plots_ui(ui, "Singular values", &singular_values(analysis));
    });
    card_ui(ui, right, |ui| {
        scrolled_ui(ui, "sensor facts", |ui| facts_ui(ui, analysis));
    });
    ui.allocate_rect(whole, Sense::hover());
    picked
}

fn singular_values(analysis: &Analysis) -> PlotFigure {
    singular_values_figure(&analysis.rows, analysis.worst, analysis.hidden_below_per_mm())
}

/// Returns the surfaces along the displayed axis, or along z if that does not move.
fn surfaces_figure(view: &SensorView, analysis: &Analysis, look: Look) -> SurfaceFigure {
    let axis = view.axis.min(analysis.surfaces.len() - 1);
    let [mut pattern, mut sensitivity] = analysis.surfaces[axis].clone();
    pattern.mode = look.mode;
    (pattern.colours, sensitivity.colours) = (look.colours, look.colours);
    SurfaceFigure {
        surfaces: vec![pattern, sensitivity],
        camera: look.camera,
        marked_node: view.node,
        ..SurfaceFigure::default()
    }
}

/// Shows one of the two pictures; `axis` is the displayed axis, `node` the node marked on both.
fn pattern_ui(
    ui: &mut Ui,
    figure: &SurfaceFigure,
    place: usize,
    look: Look,
    analysis: &Analysis,
    (axis, node): &mut (usize, Option<usize>),
    effects: &mut Vec<Effect>,
) {
    let surface = &figure.surfaces[place];
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        ui.label(RichText::new(&surface.title).font(semibold(type_size().title)));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| match surface.quantity {
            Quantity::Pattern => view_mode_ui(ui, look, effects),
            // Several coordinates are unknown.
            _ if analysis.surfaces.len() > 1 => {
                let options = [(0, "x"), (1, "y"), (2, "z")];
                *axis = segmented_ui(ui, "Displayed axis", &options, *axis, false).unwrap_or(*axis);
            }
            _ => {}
        });
    });
    let view = SurfaceView {
        label: ["Worst-seen deformation of each row", "Sensitivity of each node"][place],
        surface,
        figure,
        is_touched: false,
    };
    let shown = surface_ui(ui, view, look, node, effects);
    shown.node_tooltip_ui(|ui, node| node_ui(ui, analysis, surface, node));
}

fn node_ui(ui: &mut Ui, analysis: &Analysis, surface: &Surface, node: usize) {
    let per_row = analysis.sensor.scale.nodes_per_row();
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

/// Returns what the view shows: surfaces and singular values.
pub(super) fn shown<'a>(view: &'a SensorView, shared: &'a Shared) -> Vec<Shown<'a>> {
    let analysis = match (&view.analysis, &view.problem) {
        _ if shared.source == SourceKind::Recording => Err(RECORDED.to_owned()),
        (_, Some(problem)) => Err(problem.clone()),
        (Some(analysis), None) => Ok(analysis),
        (None, None) => Err("The singular values are still being computed.".to_owned()),
    };
    let surfaces = analysis
        .clone()
        .map(|analysis| || Figure::from(surfaces_figure(view, analysis, shared.look)));
    let values = analysis.map(|analysis| || Figure::from(singular_values(analysis)));
    vec![
        Shown::figure("Surfaces", "identifiability".to_owned(), surfaces),
        Shown::figure("Singular values", "singular-values".to_owned(), values),
    ]
}

/// Shows warnings with what to change, then the figures.
fn facts_ui(ui: &mut Ui, analysis: &Analysis) {
    section_heading_ui(ui, "Findings");
    if analysis.warnings.is_empty() {
        let text = RichText::new(summary(analysis)).size(type_size().note);
        ui.label(text.color(Theme::of(ui).palette.good));
    }
    for warning in &analysis.warnings {
        note_ui(ui, &format!("{}.", capitalised(warning)));
    }
    ui.add_space(space(2));
    for (name, value) in facts(analysis) {
        fact_ui(ui, name, meaning(name).unwrap_or_default(), &value);
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

/// Returns the figures, whose names are in the glossary.
fn facts(analysis: &Analysis) -> Vec<(&'static str, String)> {
    let (worst, noise) = (analysis.worst_row(), analysis.noise);
    let finite = |value: f64, unit: &str| match value.is_finite() {
        true => format!("{}{unit}", format_number(value)),
        false => "infinite".to_owned(),
    };
    let alike = analysis.alike.map_or_else(
        || "the row is known".to_owned(),
        |([first, second], difference)| format!("{} and {}, by {}", first + 1, second + 1, format_number(difference)),
    );
    let mut facts = vec![
        ("Unknowns of a row", worst.unknowns().to_string()),
        ("Readings of a row", worst.equations.to_string()),
        ("Condition number", finite(worst.condition(), "")),
        ("Worst row", (worst.row + 1).to_string()),
        ("Most similar rows", alike),
    ];
    if noise.total() > 0.0 {
        let seen = format!("{} of {}", analysis.patterns_seen(), worst.unknowns());
        let share = 100.0 * worst.remaining_share(noise.own, analysis.prior_mm);
        let remaining = format!("{} % of {} mm", format_number(share), format_number(analysis.prior_mm));
        facts.extend([
            ("Noise of a reading", format_number(noise.total())),
            ("Deformation patterns above the noise", seen),
            (
                "Uncertainty of the worst pattern",
                finite(worst.worst_spread_mm(noise.own), " mm"),
            ),
            ("Remaining spread", remaining),
        ]);
    }
    facts
}
