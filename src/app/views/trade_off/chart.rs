//! What the points of the charts answer to the pointer.

use eframe::egui::{CursorIcon, Id, Pos2, Rect, RichText, Sense, Stroke, Ui, Vec2, WidgetInfo, accesskit::Role};

use crate::{
    app::{
        plotting::{Pointer, plots_ui},
        theme::{Theme, semibold, type_size},
        widgets::dim_ui,
    },
    evaluation::{TradeCost, TradeLevel, TradePoint},
    figure::{
        PlotFigure,
        trade_words::{point_facts, point_name},
    },
};

/// Half the side of the square in which a point answers the pointer.
const REACH: f32 = 7.0;

/// Both charts over the space that is left, one point marked; returns the point that is clicked. One that can be loaded
/// says so.
pub fn charts_ui(
    ui: &mut Ui,
    (level, figure): (&TradeLevel, &PlotFigure),
    marked: Option<usize>,
    can_load: bool,
) -> Option<usize> {
    let drawn = plots_ui(ui, "trade-off", figure, Pointer::Picks);
    let mut clicked = None;
    for (cost, drawn) in TradeCost::ALL.into_iter().zip(drawn) {
        for (number, point) in level.points.iter().enumerate() {
            let (x, y) = cost.of(point);
            let Some(at) = drawn.position(x, y) else { continue };
            let is_marked = marked == Some(number);
            if is_marked {
                let ring = Stroke::new(1.6, Theme::of(ui).palette.text);
                ui.painter().circle_stroke(at, 8.0, ring);
            }
            let id = ui.scope_id().with((cost, number));
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
