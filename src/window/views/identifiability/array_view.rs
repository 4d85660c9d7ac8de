use std::{ops::RangeInclusive, sync::Arc};

use eframe::egui::{Align, Layout, Rect, RichText, Sense, Ui, UiBuilder, Vec2};

use super::{Analysis, IdentifiabilityView, facts::facts_ui};
use crate::window::{
    plotting::titled_plots_ui,
    shared::{Effect, Export, Look, Shared, colour_scale_ui, follow_surface, picture_exports, view_mode_ui},
    surface_view::{ColourBar, SurfaceView},
    test_view::Frame,
    theme::{Theme, semibold, space, type_size},
    widgets::{card_ui, note_ui, placeholder_ui, scrolled_ui, segmented_ui, state_ui},
};
use decoupler_core::text::counted;
use decoupler_files::{
    export::format_number,
    figure::{
        Figure, PlotFigure, singular_values_figure,
        surface::{Quantity, Surface, SurfaceFigure, ViewMode},
    },
};

/// Pattern and sensitivity above, singular values and what they come to below.
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
            let slot = surface_ui(ui, (surface, label), shared.look, analysis, &mut pointed, effects);
            colour_scale_ui(ui, slot, &surface.scale(), &figure.note(), shared.look, effects);
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

/// From no sensitivity to the largest of any axis.
fn sensitivity_range(analysis: &Analysis) -> RangeInclusive<f64> {
    let nodes = analysis.sensitivities.iter().flat_map(|frame| frame.nodes_mm.iter());
    let largest = nodes.map(|node| node.z).filter(|z| z.is_finite()).fold(0.0, f64::max);
    0.0..=largest.max(f64::MIN_POSITIVE)
}

/// The worst-seen pattern and the sensitivity of the nodes.
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

/// One of the two pictures: `axis` is the displayed one, `node` the one marked on both. Returns the place of the scale of its
/// colours.
fn surface_ui(
    ui: &mut Ui,
    (surface, label): (&Surface, &str),
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

/// Choice of the displayed coordinate, where several are unknown.
fn axes_ui(ui: &mut Ui, axis: &mut usize, analysis: &Analysis) {
    let axes = analysis.question.scene.movement.axes().indices();
    if axes.len() < 2 {
        return;
    }
    let options = [(0, "x"), (1, "y"), (2, "z")];
    *axis = segmented_ui(ui, "Displayed axis", &options, *axis, false).unwrap_or(*axis);
}

/// The surfaces and the singular values.
pub(super) fn analysis_exports<'a>(view: &'a IdentifiabilityView, shared: &'a Shared) -> Vec<Export<'a>> {
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
    let surfaces = picture_exports("Surfaces", "identifiability".to_owned(), surfaces);
    let values = picture_exports("Singular values", "singular-values".to_owned(), values);
    surfaces.chain(values).collect()
}

/// Shows the state of the analysis in the line at the bottom.
pub(super) fn status_ui(ui: &mut Ui, shown: &IdentifiabilityView) {
    let palette = Theme::of(ui).palette;
    let (colour, text) = match (&shown.problem, &shown.analysis) {
        _ if shown.is_pending => (palette.accent, "Computing".to_owned()),
        (Some(_), _) => (
            palette.bad,
            "This sensor or scene is not possible: the note says why".to_owned(),
        ),
        (None, Some(analysis)) => match analysis.warnings.len() {
            0 => (palette.good, "No warnings: nothing prevents decoupling".to_owned()),
            1 => (palette.warning, "1 warning".to_owned()),
            count => (palette.warning, format!("{count} warnings")),
        },
        (None, None) => (palette.dim, "Nothing computed yet".to_owned()),
    };
    ui.horizontal_centered(|ui| {
        state_ui(ui, colour, &text);
        if let Some(analysis) = &shown.analysis {
            let sensor = &analysis.question.sensor;
            let text = format!("{}, {} read", sensor.scale, counted(analysis.rows.len(), "row"));
            ui.label(RichText::new(text).size(type_size().note).color(palette.dim));
        }
    });
}
