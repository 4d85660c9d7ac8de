//! Response of the points of the charts to the pointer.

use eframe::egui::{
    CursorIcon, Id, Pos2, Rect, Response, RichText, Sense, Stroke, Ui, Vec2, WidgetInfo, accesskit::Role,
};

use super::PointWish;
use crate::window::{
    plotting::{Pointer, plots_ui},
    shared::{DecoderSource, decoder_forms_ui},
    theme::{Theme, semibold, type_size},
    widgets::{claim_right_click, dim_ui},
};
use decoupler_core::evaluation::{TradeOffCost, TradeOffLevel, TradeOffPoint};
use decoupler_files::figure::{PlotFigure, point_facts, point_name};

/// Half the side of the square in which a point answers the pointer.
const REACH: f32 = 7.0;

/// Both charts over the space that is left, one point marked. A click marks a point and asks to load it, if it can be
/// loaded; a right-click opens the formats in which its decoder can be exported from `source`.
pub fn charts_ui(
    ui: &mut Ui,
    (level, figure): (&TradeOffLevel, &PlotFigure),
    marked: &mut Option<usize>,
    can_load: bool,
    source: impl Fn(usize) -> Option<DecoderSource>,
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
            let response = point_ui(ui, (point, is_marked, can_load), cost, at, id);
            if response.clicked() {
                *marked = Some(number);
                wish = can_load.then_some(PointWish::Load(number));
            }
            claim_right_click(ui, &response);
            response.context_menu(|ui| {
                dim_ui(ui, &format!("Export {}", point_name(point)));
                let source = source(number);
                let task = source.and_then(|source| decoder_forms_ui(ui, point.report.kind, &source));
                wish = wish.take().or(task.map(|task| PointWish::Export(Box::new(task))));
            });
        }
    }
    wish
}

/// Answers the pointer at a point with its name and figures.
fn point_ui(
    ui: &mut Ui,
    (point, is_marked, can_load): (&TradeOffPoint, bool, bool),
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
