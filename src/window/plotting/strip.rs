use eframe::egui::{Align2, FontId, Rect, Sense, Stroke, StrokeKind, Ui, Vec2, WidgetInfo, accesskit::Role, pos2};

use crate::window::theme::{Theme, radius, space, type_size};
use decoupler_core::evaluation::Spread;
use decoupler_files::{
    export::format_number,
    figure::{multiples, step_for, tick_text},
};

/// One dot for each value on a line, with a box over the middle half of them.
#[derive(Clone, Copy, Debug)]
pub struct StripChart<'a> {
    /// Name of the picture, for assistive technology.
    pub label: &'a str,
    /// Name of the axis, drawn below it.
    pub axis: &'a str,
    /// The values; those that are not numbers have no dot.
    pub values: &'a [Option<f64>],
    /// The place of the value in the accent colour.
    pub marked: usize,
    /// Quartiles and extremes of the values.
    pub spread: Spread,
}

const DOT_RADIUS: f32 = 3.5;

/// Draws the strip over the available width.
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
    // Values that are all alike get an axis around them.
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
    // The marked one lies above the others.
    let numbered = chart.values.iter().enumerate();
    let (others, marked): (Vec<_>, Vec<_>) = numbered.partition(|(number, _)| *number != chart.marked);
    for (number, value) in others.into_iter().chain(marked) {
        let Some(value) = value.filter(|value| value.is_finite()) else {
            continue;
        };
        // Three heights keep dots of near values apart.
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
        None => response.on_hover_text("One dot for each start, the kept one in colour; box: quartiles, line: median."),
    };
}
