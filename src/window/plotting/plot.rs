//! Plots drawn with `egui_plot`, in axis coordinates: a logarithmic axis is linear in the logarithm.
//!
//! Labels at vertical reference lines.

use std::ops::RangeInclusive;

use decoupler_files::figure::{
    Hue, Key, LineAt, LineStyle, Look, Marker, Plot, PlotAxis, PointLabel, Series, along, place_labels,
};
use eframe::egui::{
    Color32, CornerRadius, FontId, Id, Pos2, Rangef, Rect, Response, RichText, Sense, Shape, Stroke, StrokeKind, Ui,
    Vec2, WidgetInfo, accesskit::Role, pos2, vec2,
};
use egui_plot::{
    AxisHints, Bar, BarChart, BoxElem, BoxPlot, BoxSpread, GridInput, GridMark, HLine, HoverPosition, Line,
    LineStyle as DrawnStyle, MarkerShape, PlotPoint as Place, PlotPoints, PlotTransform, PlotUi, Points, Span, VLine,
};
use glam::DVec2;

use super::{
    heat_map::{hue_colour, per_pixel},
    plot_figure::Pointer,
};
use crate::window::{
    theme::{Palette, Theme, space, type_size},
    widgets::focus_ring_ui,
};

/// Opacity of a shaded span of an axis.
const SPAN_TINT: f32 = 0.12;
/// Width of the number at a tick with its margin, in points.
const NUMBER_WIDTH: f64 = 50.0;
const NUMBER_HEIGHT: f64 = 16.0;
/// Minimum distance of grid lines, in points; the plot derives its scale from it.
const MIN_GRID: f32 = 8.0;
/// Points of a stepped line that are closer than this fraction of an axis are merged: a sharp turn would draw a spike.
const COINCIDENT: f64 = 5e-4;

/// Draws the plot over the space of `ui`; `id` distinguishes it from others in the window.
pub(super) fn plot_ui(ui: &mut Ui, id: Id, plot: &Plot, pointer: Pointer) -> (PlotTransform, Response) {
    let palette = Theme::of(ui).palette;
    let [x, y] = plot.ranges();
    let space = ui.available_size();
    let axis_hints = |hints: AxisHints<'static>, axis: &PlotAxis, apart: f32| {
        let described = axis.clone();
        hints
            .label(RichText::new(&axis.name).size(type_size().small).color(palette.dim))
            .formatter(move |mark, _| described.tick_text(mark.value, mark.step_size))
            // Numbers have full brightness wherever they fit.
            .label_spacing(Rangef::new(apart, apart + 1.0))
            .tick_label_color(palette.dim)
            .tick_label_font(FontId::proportional(type_size().small))
    };
    let may_move = pointer == Pointer::Moves;
    let shown = egui_plot::Plot::new(id)
        .id(id)
        .width(space.x)
        .height(space.y)
        .custom_x_axes(vec![axis_hints(AxisHints::new_x(), &plot.x, 24.0)])
        .custom_y_axes(vec![axis_hints(AxisHints::new_y(), &plot.y, 12.0)])
        .x_grid_spacer(|input| marks(&plot.x, &input, NUMBER_WIDTH))
        .y_grid_spacer(|input| marks(&plot.y, &input, NUMBER_HEIGHT))
        .grid_spacing(Rangef::new(MIN_GRID, 300.0))
        .show_background(false)
        .grid_color(palette.line)
        .allow_scroll(false)
        .allow_drag(may_move)
        .allow_zoom(may_move)
        .allow_boxed_zoom(may_move)
        .show_crosshair(false)
        .label_formatter(|position| tooltip_at(plot, position).filter(|_| may_move))
        .set_margin_fraction(Vec2::ZERO)
        .include_x(*x.start())
        .include_x(*x.end())
        .include_y(*y.start())
        .include_y(*y.end());
    let shown = if plot.has_equal_scales {
        shown.data_aspect(1.0)
    } else {
        shown
    };
    let shown = shown.show(ui, |plot_ui| {
        lines_behind(plot_ui, plot, &palette);
        let transform = *plot_ui.transform();
        let pixels = f64::from(transform.frame().width() * plot_ui.ctx().pixels_per_point());
        let extent = Extent {
            ranges: [&x, &y],
            column: transform.bounds().width() / pixels,
        };
        for series in &plot.series {
            draw_series(plot_ui, plot, series, extent, &palette);
        }
    });
    shown.response.widget_info(|| {
        let names: Vec<&str> = plot.series.iter().map(|series| &*series.name).collect();
        let label = format!("{} against {}: {}", plot.y.name, plot.x.name, names.join(", "));
        WidgetInfo::labeled(Role::Image, true, label)
    });
    ui.ctx()
        .accesskit_node_builder(shown.response.id, |node| node.set_description(plot.summary()));
    focus_ring_ui(ui, &shown.response);
    labels_ui(ui, plot, &shown.transform, id);
    point_labels_ui(ui, plot, &shown.transform);
    (shown.transform, shown.response)
}

/// Returns the visible ticks.
fn marks(axis: &PlotAxis, input: &GridInput, number: f64) -> Vec<GridMark> {
    // Length of a number on the axis.
    let apart = input.base_step_size * number / f64::from(MIN_GRID);
    let ticks = axis.ticks(&(input.bounds.0..=input.bounds.1), apart);
    let step_size = ticks.step;
    let mark = |value| GridMark { value, step_size };
    ticks.places.into_iter().map(mark).collect()
}

/// Returns the tooltip of the point under the pointer.
fn tooltip_at(plot: &Plot, position: &HoverPosition<'_>) -> Option<String> {
    let HoverPosition::NearDataPoint {
        plot_name, position, ..
    } = position
    else {
        return None;
    };
    // Items are named by the number of their series.
    let series = plot.series.get(plot_name.parse::<usize>().ok()?)?;
    let distance = |[x, y]: [f64; 2]| (x - position.x).abs() + (y - position.y).abs();
    let placed = plot.placed(series);
    let (point, _) = placed.min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)))?;
    Some(plot.words(series, point))
}

fn stroke(hue: Hue, style: LineStyle, palette: &Palette) -> (Stroke, DrawnStyle) {
    let colour = hue_colour(hue, palette);
    match style {
        LineStyle::Solid => (Stroke::new(1.8, colour), DrawnStyle::Solid),
        LineStyle::Dashed => (Stroke::new(1.4, colour), DrawnStyle::dashed_dense()),
        LineStyle::Dotted => (Stroke::new(1.0, colour.gamma_multiply(0.7)), DrawnStyle::dotted_dense()),
        LineStyle::Fine => (Stroke::new(1.0, colour.gamma_multiply(0.55)), DrawnStyle::Solid),
    }
}

/// Draws spans and reference lines.
fn lines_behind(plot_ui: &mut PlotUi<'_>, plot: &Plot, palette: &Palette) {
    for span in &plot.spans {
        if let [Some(from), Some(to)] = [span.range.start(), span.range.end()].map(|end| plot.x.place(*end)) {
            let fill = hue_colour(span.hue, palette).gamma_multiply(SPAN_TINT);
            let drawn = Span::new(&*span.name, from..=to).fill(fill);
            plot_ui.span(drawn.border_color(Color32::TRANSPARENT));
        }
    }
    for (number, line) in plot.lines.iter().enumerate() {
        let (stroke, style) = stroke(line.hue, line.style, palette);
        let name = format!("{} {number}", line.name);
        match line.at {
            LineAt::X(value) => {
                if let Some(place) = plot.x.place(value) {
                    plot_ui.vline(VLine::new(name, place).stroke(stroke).style(style));
                }
            }
            LineAt::Y(value) => {
                if let Some(place) = plot.y.place(value) {
                    plot_ui.hline(HLine::new(name, place).stroke(stroke).style(style));
                }
            }
        }
    }
}

/// Ranges of the axes, and the width of a column of pixels on the x axis.
#[derive(Clone, Copy)]
struct Extent<'a> {
    ranges: [&'a RangeInclusive<f64>; 2],
    column: f64,
}

fn draw_series(
    plot_ui: &mut PlotUi<'_>,
    plot: &Plot,
    series: &Series,
    Extent { ranges, column }: Extent<'_>,
    palette: &Palette,
) {
    // The tooltip is looked up by this number.
    let number = plot.series.iter().position(|other| std::ptr::eq(other, series));
    let name = number.unwrap_or_default().to_string();
    let colour = hue_colour(series.look.hue, palette);
    let width = |range: &RangeInclusive<f64>| range.end() - range.start();
    if let Some(bar_width) = series.bar_width {
        let placed: Vec<_> = plot.placed(series).collect();
        let bars = placed.iter().map(|(_, [x, y])| Bar::new(*x, *y).width(bar_width));
        let tooltips: Vec<(f64, String)> = placed
            .iter()
            .map(|(point, [x, _])| (*x, plot.words(series, point)))
            .collect();
        let chart = BarChart::new(&*name, bars.collect()).color(colour);
        plot_ui.bar_chart(chart.element_formatter(Box::new(move |bar, _| {
            let tooltip = tooltips.iter().find(|(x, _)| *x == bar.argument);
            tooltip.map(|(_, text)| text.clone()).unwrap_or_default()
        })));
    }
    if let Some(style) = series.look.line {
        let (stroke, style) = stroke(series.look.hue, style, palette);
        let places = series.points.iter().map(|point| plot.place(point.x, point.y));
        let places: Vec<Option<[f64; 2]>> = places.collect();
        // A missing point leaves a gap.
        for (part, stretch) in places
            .split(Option::is_none)
            .filter(|stretch| stretch.len() > 1)
            .enumerate()
        {
            let mut stretch: Vec<[f64; 2]> = stretch.iter().copied().flatten().collect();
            let is_stepped = stretch.windows(2).any(|ends| ends[0][0] == ends[1][0]);
            if is_stepped {
                let near = |a: f64, b: f64, range| (a - b).abs() < COINCIDENT * width(range);
                stretch.dedup_by(|a, b| near(a[0], b[0], ranges[0]) && near(a[1], b[1], ranges[1]));
            }
            let is_ascending = stretch.windows(2).all(|ends| ends[0][0] <= ends[1][0]);
            if is_ascending && !is_stepped {
                stretch = per_pixel(stretch, column);
            }
            let line = Line::new(&*name, PlotPoints::from(stretch)).id((&name, part));
            // A band would turn steps into slopes.
            plot_ui.line(line.stroke(stroke).style(style).allow_band(!is_stepped));
        }
    }
    let bars = plot.placed(series).filter_map(|(point, [x, y])| {
        let [low, high] = plot.bar_ends(point.bar?, ranges[1]);
        let spread = BoxSpread::new(low, y, y, y, high);
        let bar = BoxElem::new(x, spread)
            .box_width(0.0)
            .whisker_width(0.01 * width(ranges[0]));
        Some(bar.fill(colour).stroke(Stroke::new(1.2, colour.gamma_multiply(0.7))))
    });
    let bars: Vec<BoxElem> = bars.collect();
    if !bars.is_empty() {
        plot_ui.box_plot(
            BoxPlot::new(&*name, bars)
                .id((&name, "bars"))
                .color(colour)
                .allow_hover(false),
        );
    }
    let Some(marker) = series.look.marker else { return };
    let (shape, is_filled, radius) = match marker {
        Marker::Dot => (MarkerShape::Circle, true, 1.6),
        Marker::Disc => (MarkerShape::Circle, true, 3.2),
        Marker::Ring => (MarkerShape::Circle, false, 3.6),
        Marker::Halo => (MarkerShape::Circle, false, 9.0),
        Marker::Square => (MarkerShape::Square, false, 4.5),
        Marker::Diamond => (MarkerShape::Diamond, true, 5.0),
        Marker::HollowDiamond => (MarkerShape::Diamond, false, 5.0),
    };
    let places: Vec<[f64; 2]> = plot.placed(series).map(|(_, place)| place).collect();
    let points = Points::new(&*name, places)
        .id((&name, "points"))
        .shape(shape)
        .filled(is_filled);
    plot_ui.points(points.radius(radius).color(colour));
}

/// Draws the labels of points.
fn point_labels_ui(ui: &Ui, plot: &Plot, transform: &PlotTransform) {
    let palette = Theme::of(ui).palette;
    let frame = *transform.frame();
    let painter = ui.painter().with_clip_rect(frame);
    // Most plots have no labels.
    if !plot.has_point_labels() {
        return;
    }
    let (mut labels, mut galleys, mut marks) = (Vec::new(), Vec::new(), Vec::new());
    let position = |[x, y]: [f64; 2]| {
        let at = transform.position_from_point(&Place::new(x, y));
        DVec2::new(f64::from(at.x), f64::from(at.y))
    };
    for series in &plot.series {
        if series.look.line.is_some() {
            let line: Vec<DVec2> = plot.placed(series).map(|(_, place)| position(place)).collect();
            marks.extend(along(&line));
        }
        for (point, place) in plot.placed(series).filter(|_| series.look.marker.is_some()) {
            let at = position(place);
            marks.push(at);
            let Some(label) = &point.label else { continue };
            let font = FontId::proportional(type_size().small);
            let galley = painter.layout_no_wrap(label.clone(), font, palette.text);
            let size = DVec2::new(f64::from(galley.size().x), f64::from(galley.size().y));
            labels.push(PointLabel { at, size });
            galleys.push(galley);
        }
    }
    let [low, high] = [frame.min, frame.max].map(|corner| DVec2::new(f64::from(corner.x), f64::from(corner.y)));
    for (corner, galley) in place_labels(&labels, &marks, (low, high)).into_iter().zip(galleys) {
        if let Some(corner) = corner {
            painter.galley(pos2(corner.x as f32, corner.y as f32), galley, palette.text);
        }
    }
}

/// Draws the label of each vertical reference line at one of its ends, with the full name of the line as a tooltip.
pub(super) fn labels_ui(ui: &Ui, plot: &Plot, transform: &PlotTransform, id: Id) {
    let palette = Theme::of(ui).palette;
    let frame = *transform.frame();
    let painter = ui.painter().with_clip_rect(frame);
    if plot.lines.iter().all(|line| line.label.is_none()) {
        return;
    }
    let placed = plot.series.iter().flat_map(|series| plot.placed(series));
    let points: Vec<Pos2> = placed
        .map(|(_, [x, y])| transform.position_from_point(&Place::new(x, y)))
        .collect();
    for (number, line) in plot.lines.iter().enumerate() {
        let (Some(label), LineAt::X(value)) = (&line.label, line.at) else {
            continue;
        };
        let Some(place) = plot.x.place(value) else { continue };
        let x = transform.position_from_point(&Place::new(place, 0.0)).x;
        if !frame.x_range().contains(x) {
            continue;
        }
        let font = FontId::proportional(type_size().small);
        let galley = painter.layout_no_wrap(label.clone(), font, palette.text);
        let rect = label_place(x, galley.size(), frame, &points);
        painter.galley(rect.min, galley, palette.text);
        let response = ui.interact(rect, id.with(("line", number)), Sense::hover());
        response.widget_info(|| WidgetInfo::labeled(Role::Label, true, &line.name));
        response.on_hover_text(&line.name);
    }
}

/// Returns the place of the label of a vertical line: to the right of its upper end if it fits there and covers no point,
/// else at the other end or side.
fn label_place(x: f32, size: Vec2, frame: Rect, points: &[Pos2]) -> Rect {
    let (right, left) = (x + space(1), x - space(1) - size.x);
    let (top, bottom) = (frame.top() + 1.0, frame.bottom() - 1.0 - size.y);
    let places = [(right, top), (left, top), (right, bottom), (left, bottom)];
    let places = places.map(|(x, y)| Rect::from_min_size(pos2(x, y), size));
    let fits = |rect: &&Rect| frame.x_range().contains(rect.left()) && frame.x_range().contains(rect.right());
    // Markers extend beyond their points.
    let is_free = |rect: &&Rect| !points.iter().any(|point| rect.expand(space(2)).contains(*point));
    let mut fitting = places.iter().filter(fits);
    let free = fitting.clone().find(is_free);
    *free.or(fitting.next()).unwrap_or(&places[0])
}

const SAMPLE_WIDTH: f32 = space(4);

/// Returns the width of a key with the space after it, in points.
fn key_width(ui: &Ui, key: &Key) -> f32 {
    let font = FontId::proportional(type_size().note);
    let name = ui
        .painter()
        .layout_no_wrap(key.name.clone(), font, Color32::PLACEHOLDER);
    SAMPLE_WIDTH + space(1) + name.size().x + space(3)
}

/// Returns the width of [`legend_ui`] in one row, in points.
pub fn legend_width(ui: &Ui, keys: &[Key]) -> f32 {
    keys.iter().map(|key| key_width(ui, key)).sum()
}

/// Draws the keys side by side, in as many rows as needed; outside the plot, where they cover nothing.
pub fn legend_ui(ui: &mut Ui, keys: &[Key]) {
    let available = ui.available_width();
    let mut rows: Vec<Vec<&Key>> = Vec::new();
    let mut taken = f32::INFINITY;
    for key in keys {
        let width = key_width(ui, key);
        if taken + width > available {
            rows.push(Vec::new());
            taken = 0.0;
        }
        taken += width;
        rows.last_mut().expect("a row was just begun").push(key);
    }
    for row in rows {
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = space(1);
            for key in row {
                let (sample, _) = ui.allocate_exact_size(Vec2::new(SAMPLE_WIDTH, space(4)), Sense::hover());
                paint_sample(ui, key.look, sample);
                ui.label(
                    RichText::new(&key.name)
                        .size(type_size().note)
                        .color(Theme::of(ui).palette.dim),
                );
                ui.add_space(space(2));
            }
        });
    }
}

fn paint_sample(ui: &Ui, look: Look, sample: Rect) {
    let colour = hue_colour(look.hue, &Theme::of(ui).palette);
    let (painter, middle) = (ui.painter(), sample.center());
    let ends = [Pos2::new(sample.left(), middle.y), Pos2::new(sample.right(), middle.y)];
    let dashes = |dash: f32, gap: f32| Shape::dashed_line(&ends, Stroke::new(1.8, colour), dash, gap);
    match look.line {
        Some(LineStyle::Solid) => {
            painter.line_segment(ends, Stroke::new(1.8, colour));
        }
        Some(LineStyle::Fine) => {
            painter.line_segment(ends, Stroke::new(1.0, colour));
        }
        Some(LineStyle::Dashed) => {
            painter.extend(dashes(3.5, 2.5));
        }
        Some(LineStyle::Dotted) => {
            painter.extend(dashes(1.5, 1.5));
        }
        None => {}
    }
    if look.line.is_none() && look.marker.is_none() {
        // A shaded area, as pale as behind the curves, with an edge.
        let area = sample.shrink2(vec2(0.0, space(1)));
        let (fill, edge) = (colour.gamma_multiply(0.3), Stroke::new(1.0, colour.gamma_multiply(0.6)));
        painter.rect(area, CornerRadius::ZERO, fill, edge, StrokeKind::Inside);
        return;
    }
    let hollow = Stroke::new(1.2, colour);
    let diamond =
        |radius: f32| [(0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)].map(|(x, y)| middle + radius * vec2(x, y));
    match look.marker {
        Some(Marker::Dot) => painter.circle_filled(middle, 1.6, colour),
        Some(Marker::Disc) => painter.circle_filled(middle, 3.0, colour),
        Some(Marker::Ring) => painter.circle_stroke(middle, 3.4, hollow),
        Some(Marker::Halo) => painter.circle_stroke(middle, 6.0, hollow),
        Some(Marker::Square) => {
            let square = Rect::from_center_size(middle, Vec2::splat(7.0));
            painter.rect_stroke(square, CornerRadius::ZERO, hollow, StrokeKind::Inside)
        }
        Some(Marker::Diamond) => painter.add(Shape::convex_polygon(diamond(4.4).into(), colour, Stroke::NONE)),
        Some(Marker::HollowDiamond) => painter.add(Shape::closed_line(diamond(4.4).into(), hollow)),
        None => return,
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_lines_avoid_points() {
        let frame = Rect::from_min_max(pos2(100.0, 50.0), pos2(500.0, 250.0));
        let size = Vec2::new(40.0, 12.0);
        let place = |x: f32, points: &[Pos2]| label_place(x, size, frame, points);
        assert_eq!(
            place(200.0, &[]).min,
            pos2(204.0, 51.0),
            "to the right of the upper end"
        );
        assert_eq!(place(480.0, &[]).right(), 476.0, "no room on the right");
        let point = pos2(220.0, 56.0);
        assert_eq!(place(200.0, &[point]).right(), 196.0, "a point on the right");
        let below = place(110.0, &[pos2(130.0, 56.0)]);
        assert_eq!(
            (below.left(), below.bottom()),
            (114.0, 249.0),
            "no room on the left either"
        );
        let everywhere: Vec<Pos2> = (0..400)
            .map(|at| pos2(100.0 + (at % 20) as f32 * 20.0, 50.0 + (at / 20) as f32 * 10.0))
            .collect();
        assert_eq!(
            place(200.0, &everywhere).min,
            pos2(204.0, 51.0),
            "the first place if every place covers a point"
        );
    }
}
