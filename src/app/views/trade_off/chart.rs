//! One chart: the error of every point against what it costs, both logarithmic.

use eframe::egui::{
    Color32, CursorIcon, Id, Pos2, Rect, RichText, Sense, Stroke, Ui, Vec2, WidgetInfo, accesskit::Role,
};
use egui_plot::{HLine, Line, LineStyle, MarkerShape, PlotPoint, PlotUi, Points, VLine};

use super::{
    TradeLimits, TradeLook,
    names::{point_facts, point_name},
};
use crate::{
    app::{
        plotting::{
            Key, Mark,
            plot_style::{log_marks, log_marks_across, log_text, plot},
        },
        theme::{Palette, Theme, semibold, type_size},
        widgets::dim_ui,
    },
    decoupling::{ColourKey, DecoderKind, Precision},
    evaluation::{Preset, TradeCost, TradeLevel, TradePoint},
};

/// Half the side of the square in which a point answers the pointer.
const REACH: f32 = 7.0;

/// The colour of a decoder.
pub fn colour(kind: DecoderKind, palette: &Palette) -> Color32 {
    match kind.colour() {
        ColourKey::Grey => palette.dim,
        ColourKey::Violet => palette.text,
        ColourKey::Blue => palette.accent,
        ColourKey::Orange => palette.test_series,
        ColourKey::Red => palette.bad,
        ColourKey::Green => palette.good,
        ColourKey::Cyan => palette.further_series,
    }
}

/// What the marks stand for.
pub fn keys(level: &TradeLevel, palette: &Palette) -> Vec<Key> {
    let is_there = |kind: &DecoderKind| level.points.iter().any(|point| point.report.kind == *kind);
    let key = |name, mark, colour| Key { name, mark, colour };
    let kinds = DecoderKind::ALL.into_iter().filter(is_there);
    let mut keys: Vec<Key> = kinds
        .map(|kind| key(kind.name(Precision::Double), Mark::Discs, colour(kind, palette)))
        .collect();
    keys.push(key("no other is better", Mark::Line, palette.dim));
    if limit(level).is_some() {
        keys.push(key("Bayesian reference", Mark::Dashes, palette.warning));
    }
    keys
}

/// The error of the reference, where it has a place on a logarithmic axis.
fn limit(level: &TradeLevel) -> Option<f64> {
    let percent = level.points.first()?.reference?.z_percent?;
    (percent > 0.0).then_some(percent)
}

/// Where a point stands: decimal logarithms of cost and error; none where an error is exactly 0 or has no meaning.
fn place(point: &TradePoint, cost: TradeCost) -> Option<[f64; 2]> {
    let (x, y) = cost.of(point);
    let place = [x.log10(), y.log10()];
    place.iter().all(|part| part.is_finite()).then_some(place)
}

/// The chart over the space that is left; returns the point that is clicked. One that can be loaded says so.
pub fn chart_ui(ui: &mut Ui, look: &TradeLook, level: &TradeLevel, cost: TradeCost, can_load: bool) -> Option<usize> {
    let palette = Theme::of(ui).palette;
    let id = match cost {
        TradeCost::Decoding => "trade decoding",
        TradeCost::Training => "trade training",
    };
    let chart = plot(ui, id, cost.name(), "Z error (%)")
        .x_grid_spacer(log_marks_across)
        .y_grid_spacer(log_marks)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_boxed_zoom(false)
        .set_margin_fraction(Vec2::new(0.06, 0.08));
    let chart = chart.x_axis_formatter(|mark, _| log_text(mark.value));
    let chart = chart.y_axis_formatter(|mark, _| log_text(mark.value));
    let shown = chart.show(ui, |plot_ui| {
        if let Some(limit) = limit(level) {
            let line = HLine::new("Bayesian reference", limit.log10()).color(palette.warning);
            plot_ui.hline(line.width(1.4).style(LineStyle::dashed_dense()));
        }
        if cost == TradeCost::Decoding {
            limits(plot_ui, look.limits, level, palette.accent);
        }
        front(plot_ui, level, cost, palette.dim);
        for point in &level.points {
            draw(plot_ui, point, cost, &palette);
        }
    });
    let at = |point: &TradePoint| {
        let [x, y] = place(point, cost)?;
        Some(shown.transform.position_from_point(&PlotPoint::new(x, y)))
    };
    let ringed = |number: usize, colour: Color32, radius: f32| {
        if let Some(at) = level.points.get(number).and_then(at) {
            ui.painter().circle_stroke(at, radius, Stroke::new(1.6, colour));
        }
    };
    for chosen in look.chosen(level).into_iter().flatten() {
        ringed(chosen, palette.accent, 9.0);
    }
    if let Some(marked) = look.marked {
        ringed(marked, palette.text, 8.0);
    }
    let mut clicked = None;
    for (number, point) in level.points.iter().enumerate() {
        if let Some(at) = at(point) {
            let id = ui.scope_id().with((id, number));
            let is_marked = look.marked == Some(number);
            if point_ui(ui, (point, is_marked, can_load), cost, at, id) {
                clicked = Some(number);
            }
        }
    }
    clicked
}

/// Answers the pointer at a point with its name and figures; returns whether it is clicked.
fn point_ui(
    ui: &mut Ui,
    (point, is_marked, can_load): (&TradePoint, bool, bool),
    cost: TradeCost,
    at: Pos2,
    id: Id,
) -> bool {
    let rect = Rect::from_center_size(at, Vec2::splat(2.0 * REACH));
    let response = ui.interact(rect, id, Sense::click());
    let name = point_name(point);
    response.widget_info(|| {
        let what = match cost {
            TradeCost::Decoding => "Decoding",
            TradeCost::Training => "Training",
        };
        WidgetInfo::selected(Role::Button, true, is_marked, format!("{what}: {name}"))
    });
    if response.hovered() {
        let ring = Stroke::new(1.6, Theme::of(ui).palette.text);
        ui.painter().circle_stroke(at, 8.0, ring);
    }
    let response = response.on_hover_cursor(CursorIcon::PointingHand).on_hover_ui(|ui| {
        ui.spacing_mut().item_spacing.y = 1.0;
        ui.label(RichText::new(&name).font(semibold(type_size().note)));
        for fact in point_facts(point) {
            ui.label(RichText::new(fact).size(type_size().note));
        }
        dim_ui(
            ui,
            if can_load {
                "Click to load it into the Train view"
            } else {
                "A training is under way: it cannot be loaded now"
            },
        );
    });
    response.clicked()
}

/// From point to point that no other beats, in steps: between them nothing better was measured.
fn front(plot_ui: &mut PlotUi<'_>, level: &TradeLevel, cost: TradeCost, colour: Color32) {
    let chosen = level.points.iter().zip(level.front(cost));
    let places = chosen.filter(|(_, is_chosen)| *is_chosen);
    let mut places: Vec<[f64; 2]> = places.filter_map(|(point, _)| place(point, cost)).collect();
    places.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut steps: Vec<[f64; 2]> = Vec::new();
    for place in places {
        if let Some(&[_, y]) = steps.last() {
            steps.push([place[0], y]);
        }
        steps.push(place);
    }
    // Corner by corner: a line through points that nearly coincide would be drawn with spikes.
    for ends in steps.windows(2) {
        let line = Line::new("no other is better", ends.to_vec());
        plot_ui.line(line.color(colour.gamma_multiply(0.7)).width(1.4));
    }
}

/// The limits of the two questions, where they lie among the points.
fn limits(plot_ui: &mut PlotUi<'_>, limits: TradeLimits, level: &TradeLevel, colour: Color32) {
    let places = || {
        level
            .points
            .iter()
            .filter_map(|point| place(point, TradeCost::Decoding))
    };
    let is_among = |value: f64, axis: usize| {
        let of_axis = || places().map(|place| place[axis]);
        of_axis().any(|other| other <= value) && of_axis().any(|other| other >= value)
    };
    let colour = colour.gamma_multiply(0.45);
    let (x, y) = (limits.microseconds.log10(), limits.percent.log10());
    if is_among(x, 0) {
        let line = VLine::new("longest time", x).color(colour);
        plot_ui.vline(line.width(1.0).style(LineStyle::dotted_dense()));
    }
    if is_among(y, 1) {
        let line = HLine::new("largest error", y).color(colour);
        plot_ui.hline(line.width(1.0).style(LineStyle::dotted_dense()));
    }
}

/// Discs are of the paper's preset, diamonds of the best; hollow ones compute in 32 bits.
fn draw(plot_ui: &mut PlotUi<'_>, point: &TradePoint, cost: TradeCost, palette: &Palette) {
    let Some(place) = place(point, cost) else { return };
    let (shape, radius) = match point.preset {
        Preset::Paper => (MarkerShape::Circle, 3.6),
        Preset::Best => (MarkerShape::Diamond, 5.0),
    };
    let is_double = point.report.precision == Precision::Double;
    let points = Points::new("points", vec![place]).shape(shape).filled(is_double);
    plot_ui.points(points.radius(radius).color(colour(point.report.kind, palette)));
}
