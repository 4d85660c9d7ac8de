use decoupler_core::evaluation::Spread;
use decoupler_files::{
    export::format_number,
    figure::{Key, Plot, PlotFigure, multiples, step_for, tick_text},
};
use eframe::egui::{
    Align2, FontId, Id, Pos2, Rect, RichText, Sense, Stroke, StrokeKind, Ui, UiBuilder, Vec2, WidgetInfo,
    accesskit::Role, pos2,
};
use egui_plot::{PlotPoint as Place, PlotTransform};

use super::{legend_ui, legend_width, plot::plot_ui};
use crate::window::{
    theme::{Theme, radius, semibold, space, type_size},
    widgets::dim_ui,
};

/// Response of a plot to the pointer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pointer {
    /// The pointer pans and zooms the plot and shows the tooltip of a point.
    Moves,
    /// The points and bars respond to the pointer.
    Picks,
}

/// Plot drawn on the screen.
pub struct DrawnPlot<'a> {
    /// Plot that is drawn.
    pub plot: &'a Plot,
    /// True while the pointer is over it.
    pub has_pointer: bool,
    /// Index of the item under the pointer.
    pub hovered: Option<usize>,
    /// Index of the item that was clicked in this frame.
    pub clicked: Option<usize>,
    transform: PlotTransform,
}

impl DrawnPlot<'_> {
    /// Returns the position of a point on the screen; `None` if it cannot be shown on an axis.
    pub fn position(&self, x: f64, y: f64) -> Option<Pos2> {
        let [x, y] = self.plot.place(x, y)?;
        Some(self.transform.position_from_point(&Place::new(x, y)))
    }

    /// Returns the item at a screen position: the bar there, or the nearest point within reach.
    fn item_at(&self, at: Pos2) -> Option<usize> {
        /// Maximum distance between the pointer and a point.
        const REACH: f32 = 12.0;
        let value = self.transform.value_from_position(at);
        let mut nearest: Option<(f32, usize)> = None;
        for series in &self.plot.series {
            for (point, [x, y]) in self.plot.placed(series) {
                let Some(item) = point.item else { continue };
                let distance = match series.bar_width {
                    // Even a low bar is hit anywhere above its base.
                    Some(width) if (x - value.x).abs() <= 0.5 * width => 0.0,
                    Some(_) => continue,
                    None => self.transform.position_from_point(&Place::new(x, y)).distance(at),
                };
                if distance <= REACH && nearest.is_none_or(|(least, _)| distance < least) {
                    nearest = Some((distance, item));
                }
            }
        }
        nearest.map(|(_, item)| item)
    }
}

/// Draws a title with the legend next to it, or below if there is no room, and the plots.
pub fn titled_plots_ui(ui: &mut Ui, title: &str, figure: &PlotFigure) {
    let has_room = ui.horizontal(|ui| {
        ui.label(RichText::new(title).font(semibold(type_size().title)));
        legend_behind_ui(ui, &figure.keys)
    });
    if !has_room.inner {
        legend_ui(ui, &figure.keys);
    }
    plots_ui(ui, title, figure, Pointer::Moves);
}

/// Draws the legend at the right end of a row, if there is room for it; returns true if it was drawn.
pub fn legend_behind_ui(ui: &mut Ui, keys: &[Key]) -> bool {
    let spare = ui.available_width() - ui.spacing().item_spacing.x - legend_width(ui, keys);
    let has_room = spare >= space(3);
    if has_room {
        ui.add_space(spare);
        legend_ui(ui, keys);
    }
    has_room
}

/// Minimum width of the notes next to a square plot.
const NOTES_WIDTH: f32 = space(36);

/// Draws the plots side by side in the remaining space, and the notes: next to a square plot if there is room, else above.
pub fn plots_ui<'a>(ui: &mut Ui, id: &str, figure: &'a PlotFigure, pointer: Pointer) -> Vec<DrawnPlot<'a>> {
    let is_square = matches!(&figure.plots[..], [plot] if plot.has_equal_scales);
    let left_by_square = ui.available_width() - ui.available_height() - 2.0 * space(3);
    let are_notes_beside = is_square && left_by_square >= NOTES_WIDTH;
    if !are_notes_beside {
        notes_ui(ui, figure);
    }
    let whole = ui.available_rect_before_wrap();
    let count = figure.plots.len().max(1) as f32;
    let width = (whole.width() - (count - 1.0) * space(3)) / count;
    // Square, apart from the numbers at the axes.
    let width = if is_square {
        width.min(whole.height() + space(3))
    } else {
        width
    };
    let slot = |index: usize| {
        let left = whole.left() + (width + space(3)) * index as f32;
        Rect::from_min_size([left, whole.top()].into(), Vec2::new(width, whole.height()))
    };
    let plots = figure.plots.iter().enumerate().map(|(index, plot)| {
        let mut slot = ui.new_child(UiBuilder::new().max_rect(slot(index)));
        let (transform, response) = plot_ui(&mut slot, Id::unique((id, index)), plot, pointer);
        let mut drawn = DrawnPlot {
            plot,
            has_pointer: response.contains_pointer(),
            hovered: None,
            clicked: None,
            transform,
        };
        drawn.hovered = response.hover_pos().and_then(|at| drawn.item_at(at));
        drawn.clicked = drawn.hovered.filter(|_| response.clicked());
        drawn
    });
    let plots = plots.collect();
    if are_notes_beside {
        let place = whole.with_min_x(slot(1).left()).with_min_y(whole.top() + space(4));
        notes_ui(&mut ui.new_child(UiBuilder::new().max_rect(place)), figure);
    }
    ui.allocate_rect(whole, eframe::egui::Sense::hover());
    plots
}

fn notes_ui(ui: &mut Ui, figure: &PlotFigure) {
    for note in &figure.notes {
        dim_ui(ui, note);
    }
}

/// Strip chart: one dot per value on a line, with a box from the first to the third quartile.
#[derive(Clone, Copy, Debug)]
pub struct StripChart<'a> {
    /// Name of the picture, for assistive technology.
    pub label: &'a str,
    /// Name of the axis, drawn below it.
    pub axis: &'a str,
    /// Values; NaN has no dot.
    pub values: &'a [Option<f64>],
    /// Index of the value in the accent colour.
    pub marked: usize,
    /// Quartiles and extremes of the values.
    pub spread: Spread,
}

const DOT_RADIUS: f32 = 3.5;

/// Draws the chart over the available width.
pub fn strip_ui(ui: &mut Ui, chart: &StripChart<'_>) {
    let palette = Theme::of(ui).palette;
    let line_height = type_size().small + space(1);
    let strip_height = space(10);
    let size = Vec2::new(ui.available_width(), strip_height + 2.0 * line_height + space(1));
    let (whole, response) = ui.allocate_exact_size(size, Sense::hover());
    let strip = Rect::from_min_size(whole.min, Vec2::new(size.x, strip_height)).shrink2(Vec2::new(space(5), 0.0));
    let Spread {
        smallest,
        lower_quartile,
        median,
        upper_quartile,
        largest,
    } = chart.spread;
    // If all values are equal, the axis extends to both sides of them.
    let margin = if largest > smallest {
        0.0
    } else {
        (0.1 * largest.abs()).max(1e-12)
    };
    let (low, high) = (smallest - margin, largest + margin);
    let x = |value: f64| strip.left() + ((value - low) / (high - low)) as f32 * strip.width();
    let painter = ui.painter();

    let axis = Stroke::new(1.0, palette.line);
    painter.hline(whole.x_range(), strip.bottom(), axis);
    let step = step_for(&(low..=high), 6);
    let font = FontId::proportional(type_size().small);
    for mark in multiples(&(low..=high), step) {
        painter.vline(x(mark), strip.bottom()..=strip.bottom() + space(1), axis);
        let place = pos2(x(mark), strip.bottom() + space(1));
        painter.text(
            place,
            Align2::CENTER_TOP,
            tick_text(mark, step),
            font.clone(),
            palette.dim,
        );
    }
    let place = whole.center_bottom();
    painter.text(place, Align2::CENTER_BOTTOM, chart.axis, font, palette.dim);

    let middle = strip.center().y;
    let half =
        Rect::from_x_y_ranges(x(lower_quartile)..=x(upper_quartile), strip.y_range()).shrink2(Vec2::new(0.0, space(2)));
    painter.rect(
        half,
        radius() / 3,
        palette.hovered,
        Stroke::new(1.0, palette.line),
        StrokeKind::Outside,
    );
    painter.vline(x(median), half.y_range(), Stroke::new(1.5, palette.dim));

    let pointer = response.hover_pos();
    let mut hovered = None;
    // The marked dot is drawn above the others.
    let numbered = chart.values.iter().enumerate();
    let (others, marked): (Vec<_>, Vec<_>) = numbered.partition(|(number, _)| *number != chart.marked);
    for (number, value) in others.into_iter().chain(marked) {
        let Some(value) = value.filter(|value| value.is_finite()) else {
            continue;
        };
        // Three heights separate the dots of similar values.
        let row = (number % 3) as f32 - 1.0;
        let centre = pos2(x(value), middle + row * 2.4 * DOT_RADIUS);
        let is_marked = number == chart.marked;
        let colour = if is_marked { palette.accent } else { palette.dim };
        let dot_radius = if is_marked { DOT_RADIUS + 1.0 } else { DOT_RADIUS };
        painter.circle(centre, dot_radius, colour, Stroke::new(1.0, palette.panel));
        if pointer.is_some_and(|pointer| pointer.distance(centre) <= dot_radius + 2.0) {
            hovered = Some((number, value));
        }
    }
    let text = format!(
        "{} dots from {} to {}, median {}",
        chart.values.len(),
        format_number(smallest),
        format_number(largest),
        format_number(median)
    );
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, format!("{}: {text}", chart.label)));
    match hovered {
        Some((number, value)) => response.on_hover_text(format!("Start {}: {}", number + 1, format_number(value))),
        None => response.on_hover_text("One dot per start; the kept one is in colour. Box: quartiles; line: median."),
    };
}
