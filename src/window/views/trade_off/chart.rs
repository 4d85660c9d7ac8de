//! Charts and table of the points of a noise level, fastest first.

use decoupler_core::evaluation::TradeOffPoint;
use decoupler_files::{
    export::format_number,
    figure::{Ink, PlotFigure, TradeOffCost, TradeOffLevel, frame_time, point_facts, point_name, training_time},
};
use eframe::egui::{
    CursorIcon, Id, Pos2, Rect, Response, RichText, Sense, Stroke, Ui, Vec2, WidgetInfo, accesskit::Role,
};

use super::PointWish;
use crate::window::{
    plotting::{Pointer, colour, plots_ui},
    theme::{Theme, semibold, type_size},
    widgets::{ColumnWidth, TableCell, TableClick, TableColumn, TableRow, TableView, dim_ui},
};

/// Half the side of the square in which a point responds to the pointer.
const REACH: f32 = 7.0;

/// Shows both charts in the remaining space, with one point marked. A click marks a point and asks to load it, if it
/// can be loaded.
pub fn charts_ui(
    ui: &mut Ui,
    level: &TradeOffLevel,
    figure: &PlotFigure,
    marked: &mut Option<usize>,
    can_load: bool,
) -> Option<PointWish> {
    let drawn = plots_ui(ui, "trade-off", figure, Pointer::Picks);
    let mut wish = None;
    for (cost, drawn) in TradeOffCost::ALL.into_iter().zip(drawn) {
        for (number, point) in level.points.iter().enumerate() {
            let (x, y) = cost.of(point);
            let Some(at) = drawn.position(x, y) else { continue };
            let is_marked = *marked == Some(number);
            if is_marked {
                let ring = Stroke::new(1.6, Theme::of(ui).palette.text);
                ui.painter().circle_stroke(at, 8.0, ring);
            }
            let id = ui.scope_id().with((cost, number));
            let response = point_ui(ui, point, is_marked, can_load, cost, at, id);
            if response.clicked() {
                *marked = Some(number);
                wish = can_load.then_some(PointWish::Load(number));
            }
        }
    }
    wish
}

/// Shows the name and the figures of a point under the pointer.
fn point_ui(
    ui: &mut Ui,
    point: &TradeOffPoint,
    is_marked: bool,
    can_load: bool,
    cost: TradeOffCost,
    at: Pos2,
    id: Id,
) -> Response {
    let rect = Rect::from_center_size(at, Vec2::splat(2.0 * REACH));
    let response = ui.interact(rect, id, Sense::click());
    let name = point_name(point);
    response.widget_info(|| {
        let what = match cost {
            TradeOffCost::Decoding => "Decoding",
            TradeOffCost::Training => "Training",
        };
        WidgetInfo::selected(Role::Button, true, is_marked, format!("{what}: {name}"))
    });
    if response.hovered() {
        let ring = Stroke::new(1.6, Theme::of(ui).palette.text);
        ui.painter().circle_stroke(at, 8.0, ring);
    }
    response.on_hover_cursor(CursorIcon::PointingHand).on_hover_ui(|ui| {
        ui.spacing_mut().item_spacing.y = 1.0;
        ui.label(RichText::new(&name).font(semibold(type_size().note)));
        for fact in point_facts(point) {
            ui.label(RichText::new(fact).size(type_size().note));
        }
        dim_ui(
            ui,
            if can_load {
                "Click to load it into the Train view; right-click to export it"
            } else {
                "A training is running: the point cannot be loaded now"
            },
        );
    })
}

/// Returns a noise level as it would be typed.
pub fn noise_name(noise: f64) -> String {
    if noise == 0.0 || noise >= 0.01 {
        noise.to_string()
    } else {
        format!("{noise:e}")
    }
}

/// A column of figures.
#[derive(Clone, Copy, PartialEq)]
enum Figure {
    Error,
    ToModelBased,
    Frame,
    Training,
}

impl Figure {
    const ALL: [Self; 4] = [Self::Error, Self::ToModelBased, Self::Frame, Self::Training];

    /// Returns the heading; `has_nodes` is false for the targets of a recording.
    fn heading(self, has_nodes: bool) -> &'static str {
        match self {
            Self::Error if has_nodes => "Z %",
            Self::Error => "% of range",
            Self::ToModelBased => "× model-based",
            Self::Frame => "decoding",
            Self::Training => "training",
        }
    }

    fn text(self, point: &TradeOffPoint) -> String {
        match self {
            Self::Error => format_number(point.report.errors.percent()),
            Self::ToModelBased => format_number(point.to_model_based()),
            Self::Frame => frame_time(point.report.frame_us),
            Self::Training => training_time(point.training_seconds),
        }
    }

    /// Returns the index in [`TradeOffCost::ALL`] of the cost it shows.
    fn cost(self) -> Option<usize> {
        match self {
            Self::Error | Self::ToModelBased => None,
            Self::Frame => Some(0),
            Self::Training => Some(1),
        }
    }
}

const MEANING: &str = "Click to mark it in the charts. A blue time is on the Pareto front: no other point has as small \
                       an error in as little time.";

/// Lays out the table over the available space; a click marks a point.
pub fn table_ui(ui: &mut Ui, level: &TradeOffLevel, marked: &mut Option<usize>) {
    let palette = &Theme::of(ui).palette;
    let fronts = TradeOffCost::ALL.map(|cost| level.front(cost));
    // Ratios to rounding are meaningless.
    let has_model_based = level.points.iter().any(|point| point.to_model_based().is_some());
    let figures = Figure::ALL.into_iter();
    let figures: Vec<Figure> = figures
        .filter(|figure| has_model_based || *figure != Figure::ToModelBased)
        .collect();
    let names = TableColumn::text("").width(ColumnWidth::Rest);
    let headings = figures
        .iter()
        .map(|figure| TableColumn::figure(figure.heading(level.noise.is_some())));
    let columns: Vec<TableColumn<'_>> = std::iter::once(names).chain(headings).collect();
    let frame_us = |number: usize| level.points[number].report.frame_us;
    let mut order: Vec<usize> = (0..level.points.len()).collect();
    order.sort_by(|&a, &b| frame_us(a).total_cmp(&frame_us(b)));
    let row = |place: usize| {
        let number = order[place];
        let point = &level.points[number];
        let on_fronts = [fronts[0][number], fronts[1][number]];
        let is_chosen = on_fronts.contains(&true);
        let text = if is_chosen { palette.text } else { palette.dim };
        let name = point_name(point);
        let name_cell = TableCell::new(name.replace(" preset", ""))
            .colour(text)
            .strong(is_chosen);
        let texts: Vec<String> = figures.iter().map(|figure| figure.text(point)).collect();
        let label = format!("{name}: {}", texts.join(", "));
        let cells = figures.iter().zip(texts).map(|(figure, cell)| {
            // Costs on the Pareto front are emphasised.
            let is_strong = figure.cost().is_some_and(|cost| on_fronts[cost]);
            let colour = if is_strong { palette.accent } else { text };
            TableCell::new(cell).colour(colour).strong(is_strong)
        });
        TableRow::new(std::iter::once(name_cell).chain(cells))
            .labelled(label)
            .selected(*marked == Some(number))
            .meaning(MEANING)
            .dot(colour(Ink::of_decoder(point.report.kind), palette))
    };
    let click = TableView::new("trade table", &columns)
        .clickable()
        .show(ui, order.len(), row);
    if let Some(TableClick::Select(place) | TableClick::Open(place)) = click {
        *marked = Some(order[place]);
    }
}
