//! The points of a level of noise, fastest first.

use eframe::egui::Ui;

use crate::window::{
    plotting::hue_colour,
    theme::Theme,
    widgets::{ColumnWidth, TableCell, TableClick, TableColumn, TableRow, TableView},
};
use decoupler_core::evaluation::{TradeOffCost, TradeOffLevel, TradeOffPoint};
use decoupler_files::{
    export::format_number,
    figure::{frame_time, point_name, training_time},
};

/// A column of figures.
#[derive(Clone, Copy, PartialEq)]
enum Figure {
    Error,
    ToLimit,
    Frame,
    Training,
}

impl Figure {
    const ALL: [Self; 4] = [Self::Error, Self::ToLimit, Self::Frame, Self::Training];

    /// Heading; `has_nodes` is false for the targets of a recording.
    fn heading(self, has_nodes: bool) -> &'static str {
        match self {
            Self::Error if has_nodes => "Z %",
            Self::Error => "% of range",
            Self::ToLimit => "× limit",
            Self::Frame => "decoding",
            Self::Training => "training",
        }
    }

    fn text(self, point: &TradeOffPoint) -> String {
        match self {
            Self::Error => format_number(point.report.errors.percent()),
            Self::ToLimit => format_number(point.to_reference()),
            Self::Frame => frame_time(point.report.cost.frame_us),
            Self::Training => training_time(point.training_seconds),
        }
    }

    /// The cost it shows, by its place in [`TradeOffCost::ALL`].
    fn cost(self) -> Option<usize> {
        match self {
            Self::Error | Self::ToLimit => None,
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
    // Without noise there is no limit to compare with.
    let has_limit = level.points.iter().any(|point| point.to_reference().is_some());
    let figures = Figure::ALL.into_iter();
    let figures: Vec<Figure> = figures
        .filter(|figure| has_limit || *figure != Figure::ToLimit)
        .collect();
    let names = TableColumn::text("").width(ColumnWidth::Rest);
    let headings = figures
        .iter()
        .map(|figure| TableColumn::figure(figure.heading(level.noise.is_some())));
    let columns: Vec<TableColumn<'_>> = std::iter::once(names).chain(headings).collect();
    let frame_us = |number: usize| level.points[number].report.cost.frame_us;
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
            // A cost is strong where nothing else costs as little for as small an error.
            let is_strong = figure.cost().is_some_and(|cost| on_fronts[cost]);
            let colour = if is_strong { palette.accent } else { text };
            TableCell::new(cell).colour(colour).strong(is_strong)
        });
        TableRow::new(std::iter::once(name_cell).chain(cells))
            .labelled(label)
            .selected(*marked == Some(number))
            .meaning(MEANING)
            .dot(hue_colour(point.report.kind.colour().into(), palette))
    };
    let click = TableView::new("trade table", &columns)
        .clickable()
        .show(ui, order.len(), row);
    if let Some(TableClick::Select(place) | TableClick::Open(place)) = click {
        *marked = Some(order[place]);
    }
}
