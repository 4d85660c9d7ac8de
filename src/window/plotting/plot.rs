//! Plots drawn by `egui_plot`, with its axes, grid, zoom and tooltips, in places of the axes: a logarithmic axis is
//! linear in the logarithm.

use decoupler_files::figure::{Form, Ink, LineAt, LineStyle, Marker, Plot, PlotAxis, PlotFigure, Scale, Series};
use eframe::egui::{
    Align, Color32, FontId, Id, Label, Layout, Painter, Popup, Pos2, Rangef, Rect, Response, RichText, Sense, Stroke,
    Ui, UiBuilder, Vec2, WidgetInfo, accesskit::Role,
};
use egui_plot::{
    AxisHints, Bar, BarChart, BoxElem, BoxPlot, BoxSpread, FilledArea, GridInput, GridMark, HLine, HoverPosition, Line,
    LineStyle as DrawnStyle, MarkerShape, PlotPoint as Place, PlotPoints, PlotTransform, PlotUi, Points, Span, VLine,
};

use super::paint::{bounds, colour, measure, paint, paint_over, to_glam};
use crate::window::{
    theme::{Palette, Theme, semibold, space, type_size},
    widgets::{dim_ui, focus_ring_ui},
};

/// Opacity of a shaded span of an axis, and of a band.
const SPAN_TINT: f32 = 0.12;
const BAND_TINT: f32 = 0.22;
/// Room for the number at a tick, in points.
const NUMBER: [f64; 2] = [50.0, 16.0];
/// Room for half the number at the right end of a plot, in addition to that in a card, in points.
const BEYOND: f32 = 8.0;
/// Minimum distance of grid lines, in points; the plot derives its scale from it.
const MIN_GRID: f32 = 8.0;
/// Points of a stepped line that are closer than this fraction of an axis are merged: a sharp turn would draw a spike.
const COINCIDENT: f64 = 5e-4;

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
    /// Its response to the pointer.
    pub response: Response,
    transform: PlotTransform,
}

impl DrawnPlot<'_> {
    /// Returns the position of a point on the screen; `None` if it cannot be shown on an axis.
    pub fn position(&self, x: f64, y: f64) -> Option<Pos2> {
        let [x, y] = self.plot.place(x, y)?;
        Some(self.transform.position_from_point(&Place::new(x, y)))
    }

    /// Returns the place on the horizontal axis of a screen position.
    pub fn place_at(&self, at: Pos2) -> f64 {
        self.transform.value_from_position(at).x
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
                let distance = match series.form {
                    // Even a low bar is hit anywhere above its base.
                    Form::Bars(width) if (x - value.x).abs() <= 0.5 * width => 0.0,
                    Form::Bars(_) => continue,
                    _ => self.transform.position_from_point(&Place::new(x, y)).distance(at),
                };
                if distance <= REACH && nearest.is_none_or(|(least, _)| distance < least) {
                    nearest = Some((distance, item));
                }
            }
        }
        nearest.map(|(_, item)| item)
    }
}

/// Draws a title and the plots.
pub fn titled_plots_ui(ui: &mut Ui, title: &str, figure: &PlotFigure) {
    ui.label(RichText::new(title).font(semibold(type_size().title)));
    plots_ui(ui, title, figure);
}

/// Room for the names and the numbers of plots below each other, and for their horizontal axis.
const NAME: f32 = space(18);
const NUMBERS: f32 = space(12);
const AXIS: f32 = space(9);

/// Maximum width of a plot with equal scales as a multiple of its height: in a low card it is stretched.
const MAX_ASPECT: f32 = 1.6;

/// Minimum width of the legend and the notes next to a square plot.
const NOTES_WIDTH: f32 = space(48);

/// Draws the plots side by side in the remaining space, and the legend and the notes: next to a square plot if there is room,
/// else above.
pub fn plots_ui<'a>(ui: &mut Ui, id: &str, figure: &'a PlotFigure) -> Vec<DrawnPlot<'a>> {
    let head_ui = |ui: &mut Ui| {
        legend_ui(ui, figure);
        for note in &figure.notes {
            dim_ui(ui, note);
        }
    };
    let is_square = matches!(&figure.plots[..], [plot] if plot.has_equal_scales);
    let left_by_square = ui.available_width() - ui.available_height() - 2.0 * space(3);
    let are_notes_right = is_square && left_by_square >= NOTES_WIDTH;
    // A low card is for the curves; their names are under the pointer.
    let low = if is_square { space(64) } else { space(30) };
    if !are_notes_right && ui.available_height() >= low {
        head_ui(ui);
    }
    let whole = ui.available_rect_before_wrap();
    let count = figure.plots.len().max(1) as f32;
    let mut width = (whole.width() - (count - 1.0) * space(3)) / count;
    if are_notes_right {
        width = (width - NOTES_WIDTH).min(MAX_ASPECT * whole.height());
    }
    let height = (whole.height() - AXIS) / count;
    let slot = |index: usize| {
        if figure.is_stacked {
            let top = whole.top() + height * index as f32;
            let is_last = index + 1 == figure.plots.len();
            let bottom = if is_last {
                whole.bottom()
            } else {
                top + height - space(2)
            };
            return Rect::from_x_y_ranges(whole.x_range(), top..=bottom);
        }
        let left = whole.left() + (width + space(3)) * index as f32;
        Rect::from_min_size([left, whole.top()].into(), Vec2::new(width, whole.height()))
    };
    let widths = figure
        .plots
        .iter()
        .map(|plot| measure(ui.painter(), &plot.y.name).x + space(6));
    let names = widths.fold(0.0, f32::max).min(NAME);
    let plots = figure.plots.iter().enumerate().map(|(index, plot)| {
        let is_last = index + 1 == figure.plots.len();
        let mut slot = slot(index);
        if figure.is_stacked {
            let place = slot.with_max_x(slot.left() + names).shrink2(Vec2::new(0.0, space(2)));
            let name = Label::new(RichText::new(&plot.y.name).size(type_size().note)).wrap();
            let mut name_ui = ui.new_child(UiBuilder::new().max_rect(place));
            name_ui.set_clip_rect(place);
            name_ui.add(name);
            slot.min.x += names;
        }
        let track = figure.is_stacked.then_some(is_last);
        let mut slot = ui.new_child(UiBuilder::new().max_rect(slot));
        let (transform, response) = plot_ui(&mut slot, Id::unique((id, index)), plot, track);
        let mut drawn = DrawnPlot {
            plot,
            has_pointer: response.contains_pointer(),
            hovered: None,
            clicked: None,
            response,
            transform,
        };
        drawn.hovered = drawn.response.hover_pos().and_then(|at| drawn.item_at(at));
        drawn.clicked = drawn.hovered.filter(|_| drawn.response.clicked());
        drawn
    });
    let plots = plots.collect();
    if are_notes_right {
        let place = whole.with_min_x(slot(1).left()).with_min_y(whole.top() + space(4));
        head_ui(&mut ui.new_child(UiBuilder::new().max_rect(place)));
    }
    ui.allocate_rect(whole, Sense::hover());
    plots
}

/// Draws the entries of the legend side by side, in as many rows as needed; outside the plots, where they cover nothing.
fn legend_ui(ui: &mut Ui, figure: &PlotFigure) {
    let palette = &Theme::of(ui).palette;
    let keys = figure.keys();
    if keys.is_empty() {
        return;
    }
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = space(1);
        for (name, look) in keys {
            // A line and its name stay together.
            let width = (1.2 * measure(ui.painter(), name).x + space(7)).min(ui.max_rect().width());
            let entry = Layout::left_to_right(Align::Center);
            ui.allocate_ui_with_layout(Vec2::new(width, space(5)), entry, |ui| {
                let (place, _) = ui.allocate_exact_size(Vec2::splat(space(4)), Sense::hover());
                let sample = look.sample(to_glam(place.left_center()), place.width());
                paint(ui.painter(), palette, &sample);
                ui.add(Label::new(RichText::new(name).size(type_size().note).color(palette.dim)).truncate());
            });
            ui.add_space(space(2));
        }
    });
}

/// Draws the plot over the space of `ui`; `id` distinguishes it from others in the window. `track` is whether a plot among
/// several below each other is the last one, which has the horizontal axis of all.
fn plot_ui(ui: &mut Ui, id: Id, plot: &Plot, track: Option<bool>) -> (PlotTransform, Response) {
    let palette = Theme::of(ui).palette;
    let [x, y] = plot.ranges();
    let space = ui.available_size() - Vec2::new(BEYOND, 0.0);
    let painter = ui.painter().clone();
    let axis_hints = |hints: AxisHints<'static>, (axis, length): (&PlotAxis, f32), apart: f32| {
        let described = axis.clone();
        hints
            .label(
                RichText::new(shortened(&painter, &axis.name, length))
                    .size(type_size().small)
                    .color(palette.dim),
            )
            .formatter(move |mark, range| described.tick_text(mark.value, mark.step_size, range))
            // Numbers have full brightness wherever they fit.
            .label_spacing(Rangef::new(apart, apart + 1.0))
            .tick_label_color(palette.dim)
            .tick_label_font(FontId::proportional(type_size().small))
    };
    // Plots below each other are moved together by the caller.
    let may_move = track.is_none();
    let mut y_hints = axis_hints(AxisHints::new_y(), (&plot.y, space.y), 12.0);
    if track.is_some() {
        // The names are next to the plots, and their frames are below each other.
        y_hints = y_hints.label("").min_thickness(NUMBERS);
    } else if plot.y.scale == Scale::Logarithmic {
        // Its numbers are the longest, and change with every zoom.
        y_hints = y_hints.min_thickness(NUMBERS);
    }
    // A menu over the plot is not covered by tooltips.
    let is_covered = Popup::is_any_open(ui.ctx());
    let mut shown = egui_plot::Plot::new(id)
        .id(id)
        .width(space.x)
        .height(space.y)
        .custom_x_axes(vec![axis_hints(AxisHints::new_x(), (&plot.x, space.x), 24.0)])
        .custom_y_axes(vec![y_hints])
        .show_axes([track != Some(false), plot.y.scale != Scale::Hidden])
        .x_grid_spacer(|input| marks(&plot.x, &input, NUMBER[0]))
        .y_grid_spacer(|input| marks(&plot.y, &input, NUMBER[1]))
        .grid_spacing(Rangef::new(MIN_GRID, 300.0))
        .show_background(false)
        .grid_color(palette.line)
        .allow_scroll(false)
        .allow_drag(may_move)
        .allow_zoom(may_move)
        .allow_boxed_zoom(may_move)
        .allow_double_click_reset(may_move)
        .show_crosshair(false)
        .label_formatter(|position| tooltip_at(plot, position).filter(|_| may_move && !is_covered))
        .set_margin_fraction(Vec2::ZERO)
        .include_x(*x.start())
        .include_x(*x.end())
        .include_y(*y.start())
        .include_y(*y.end());
    // In a low card its width is of more use.
    if plot.has_equal_scales && space.x < 1.2 * space.y {
        shown = shown.data_aspect(1.0);
    }
    let shown = shown.show(ui, |plot_ui| {
        if let (Some(_), [.., from, to]) = (track, &plot.x.includes[..]) {
            plot_ui.set_plot_bounds_x(*from..=*to);
        }
        lines_behind(plot_ui, plot, &palette);
        for series in &plot.series {
            draw_series(plot_ui, plot, series, &palette);
        }
    });
    shown.response.widget_info(|| {
        let is_drawn = |series: &&Series| !series.points.is_empty() || matches!(series.form, Form::Across(_));
        let drawn = plot.series.iter().filter(is_drawn);
        let names: Vec<&str> = drawn.map(|series| &*series.name).collect();
        let label = format!("{} against {}: {}", plot.y.name, plot.x.name, names.join(", "));
        WidgetInfo::labeled(Role::Image, true, label)
    });
    ui.ctx()
        .accesskit_node_builder(shown.response.id, |node| node.set_description(plot.summary()));
    focus_ring_ui(ui, &shown.response);
    let frame = *shown.transform.frame();
    let at = |[x, y]: [f64; 2]| to_glam(shown.transform.position_from_point(&Place::new(x, y)));
    let labels = plot.lay_out_labels(bounds(frame), at, &|text| measure(ui.painter(), text));
    paint_over(ui, frame, &labels);
    (shown.transform, shown.response)
}

/// Returns the beginning of a name that fits into this length of an axis, apart from the numbers of the other.
fn shortened(painter: &Painter, name: &str, length: f32) -> String {
    let fits = |text: &str| measure(painter, text).x <= length - NUMBERS;
    let ends = name.char_indices().map(|(end, _)| end).rev();
    let shorter = ends.map(|end| format!("{}…", name[..end].trim_end()));
    let mut texts = std::iter::once(name.to_owned()).chain(shorter);
    texts.find(|text| fits(text)).unwrap_or_default()
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
    let HoverPosition::NearDataPoint { position, .. } = position else {
        return None;
    };
    let series = plot.series.iter().filter(|series| series.form == Form::Points);
    let points = series.flat_map(|series| plot.placed(series).map(move |(point, place)| (series, point, place)));
    let distance = |[x, y]: [f64; 2]| (x - position.x).abs() + (y - position.y).abs();
    let (series, point, _) = points.min_by(|a, b| distance(a.2).total_cmp(&distance(b.2)))?;
    Some(plot.words(series, point))
}

fn stroke(ink: Ink, style: LineStyle, palette: &Palette) -> (Stroke, DrawnStyle) {
    let colour = colour(ink, palette);
    match style {
        LineStyle::Solid => (Stroke::new(1.8, colour), DrawnStyle::Solid),
        LineStyle::Dashed => (Stroke::new(1.4, colour), DrawnStyle::dashed_dense()),
        LineStyle::Dotted => (Stroke::new(1.0, colour.gamma_multiply(0.7)), DrawnStyle::dotted_dense()),
        LineStyle::Fine => (Stroke::new(1.0, colour.gamma_multiply(0.55)), DrawnStyle::Solid),
    }
}

/// Draws spans and reference lines.
fn lines_behind(plot_ui: &mut PlotUi<'_>, plot: &Plot, palette: &Palette) {
    for (Series { name, look, .. }, at) in plot.lines_across() {
        let (stroke, style) = stroke(look.ink, look.line.unwrap_or(LineStyle::Solid), palette);
        match at {
            LineAt::Between(ends) => {
                if let [Some(from), Some(to)] = ends.map(|end| plot.x.place(end)) {
                    let fill = colour(look.ink, palette).gamma_multiply(SPAN_TINT);
                    let band = Span::new(name, from..=to).fill(fill);
                    plot_ui.span(band.border_color(Color32::TRANSPARENT));
                }
            }
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

fn draw_series(plot_ui: &mut PlotUi<'_>, plot: &Plot, series: &Series, palette: &Palette) {
    let name = &*series.name;
    let colour = colour(series.look.ink, palette);
    if series.form == Form::Band {
        for band in plot.bands(series) {
            let [xs, low, high] = [0, 1, 2].map(|part| Vec::from_iter(band.iter().map(|ends| ends[part])));
            let area = FilledArea::new(name, &xs, &low, &high).fill_color(colour.gamma_multiply(BAND_TINT));
            plot_ui.add(area.allow_hover(false));
        }
        return;
    }
    let [x_range, y_range] = plot.ranges();
    let (width, height) = (x_range.end() - x_range.start(), y_range.end() - y_range.start());
    if let Form::Bars(bar_width) = series.form {
        let placed = plot.placed(series);
        let bars = placed.map(|(point, [x, y])| Bar::new(x, y).width(bar_width).name(plot.words(series, point)));
        let chart = BarChart::new(name, bars.collect()).color(colour);
        plot_ui.bar_chart(chart.element_formatter(Box::new(|bar, _| bar.name.clone())));
    }
    if let (Form::Points, Some(style)) = (series.form, series.look.line) {
        let (stroke, style) = stroke(series.look.ink, style, palette);
        for mut stretch in plot.stretches(series) {
            let is_stepped = stretch.windows(2).any(|ends| ends[0][0] == ends[1][0]);
            if is_stepped {
                let near = |a: f64, b: f64, extent: f64| (a - b).abs() < COINCIDENT * extent;
                stretch.dedup_by(|a, b| near(a[0], b[0], width) && near(a[1], b[1], height));
            }
            let line = Line::new(name, PlotPoints::from(stretch));
            // A band would turn steps into slopes.
            plot_ui.line(line.stroke(stroke).style(style).allow_band(!is_stepped));
        }
    }
    let bars = plot.placed(series).filter_map(|(point, [x, y])| {
        let [low, high] = plot.bar_ends(point.bar?, &y_range);
        let bar = BoxElem::new(x, BoxSpread::new(low, y, y, y, high));
        let bar = bar.box_width(0.0).whisker_width(0.01 * width);
        Some(bar.fill(colour).stroke(Stroke::new(1.2, colour.gamma_multiply(0.7))))
    });
    let bars: Vec<BoxElem> = bars.collect();
    if !bars.is_empty() {
        plot_ui.box_plot(BoxPlot::new(name, bars).color(colour).allow_hover(false));
    }
    let (shape, is_filled, radius) = match series.look.marker {
        Some(Marker::Dot) => (MarkerShape::Circle, true, 1.6),
        Some(Marker::Disc) => (MarkerShape::Circle, true, 3.2),
        Some(Marker::Ring) => (MarkerShape::Circle, false, 3.6),
        Some(Marker::Halo) => (MarkerShape::Circle, false, 9.0),
        Some(Marker::Square) => (MarkerShape::Square, false, 4.5),
        Some(Marker::Diamond) => (MarkerShape::Diamond, true, 5.0),
        Some(Marker::HollowDiamond) => (MarkerShape::Diamond, false, 5.0),
        None => return,
    };
    let places: Vec<[f64; 2]> = plot.placed(series).map(|(_, place)| place).collect();
    let points = Points::new(name, places).shape(shape).filled(is_filled);
    plot_ui.points(points.radius(radius).color(colour));
}
