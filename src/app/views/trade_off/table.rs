//! The points of a level of noise, fastest first.

use eframe::egui::{
    Align2, CursorIcon, FontId, Pos2, Rect, RichText, ScrollArea, Sense, Stroke, TextWrapMode, Ui, WidgetInfo,
    WidgetText, accesskit::Role, pos2, vec2,
};

use crate::{
    app::{
        plotting::hue_colour,
        theme::{Theme, semibold, space, type_size},
    },
    evaluation::{TradeCost, TradeLevel, TradePoint},
    export::format_number,
    figure::trade_words::{frame_time, point_name, training_time},
};

/// A column of figures.
#[derive(Clone, Copy, PartialEq)]
enum Column {
    Error,
    ToLimit,
    Frame,
    Training,
}

impl Column {
    const ALL: [Self; 4] = [Self::Error, Self::ToLimit, Self::Frame, Self::Training];
    const WIDTH: f32 = space(18);

    fn heading(self) -> &'static str {
        match self {
            Self::Error => "Z %",
            Self::ToLimit => "× limit",
            Self::Frame => "a frame",
            Self::Training => "training",
        }
    }

    fn text(self, point: &TradePoint) -> String {
        match self {
            Self::Error => format_number(point.report.errors.z_percent),
            Self::ToLimit => format_number(point.to_reference()),
            Self::Frame => frame_time(point.report.cost.frame_us),
            Self::Training => training_time(point.training_seconds),
        }
    }

    /// The cost it shows, by its place in [`TradeCost::ALL`].
    fn cost(self) -> Option<usize> {
        match self {
            Self::Error | Self::ToLimit => None,
            Self::Frame => Some(0),
            Self::Training => Some(1),
        }
    }
}

/// Lays out the table over the available space; a click marks a point.
pub fn table_ui(ui: &mut Ui, level: &TradeLevel, marked: &mut Option<usize>) {
    let palette = Theme::of(ui).palette;
    let fronts = TradeCost::ALL.map(|cost| level.front(cost));
    // Without noise there is no limit to compare with.
    let columns = Column::ALL.into_iter();
    let has_limit = level.points.iter().any(|point| point.to_reference().is_some());
    let columns: Vec<Column> = columns
        .filter(|column| has_limit || *column != Column::ToLimit)
        .collect();
    let mut order: Vec<usize> = (0..level.points.len()).collect();
    order.sort_by(|&a, &b| {
        level.points[a]
            .report
            .cost
            .frame_us
            .total_cmp(&level.points[b].report.cost.frame_us)
    });
    ui.spacing_mut().item_spacing.y = 0.0;
    // The strip of the scroll bar stays free.
    let width = ui.available_width() - space(3);
    let small = FontId::proportional(type_size().small);
    let (line, _) = ui.allocate_exact_size(vec2(width, space(5)), Sense::hover());
    for (number, column) in columns.iter().enumerate() {
        let at = right_end(line, columns.len() - number);
        ui.painter()
            .text(at, Align2::RIGHT_CENTER, column.heading(), small.clone(), palette.dim);
    }
    ui.painter()
        .hline(line.x_range(), line.bottom(), Stroke::new(1.0, palette.line));
    let body = ScrollArea::vertical()
        .id_salt("trade table")
        .auto_shrink([false, false]);
    body.show_rows(ui, space(6), order.len(), |ui, range| {
        for &number in &order[range] {
            let on_fronts = [fronts[0][number], fronts[1][number]];
            let row = (&level.points[number], *marked == Some(number));
            if row_ui(ui, row, on_fronts, (&columns, width)) {
                *marked = Some(number);
            }
        }
    });
}

/// The right end of the column that is so many from the right.
fn right_end(line: Rect, from_right: usize) -> Pos2 {
    let left_of_it = (from_right - 1) as f32 * Column::WIDTH;
    pos2(line.right() - left_of_it, line.center().y)
}

/// Whether the row was clicked.
fn row_ui(
    ui: &mut Ui,
    (point, is_marked): (&TradePoint, bool),
    on_fronts: [bool; 2],
    (columns, width): (&[Column], f32),
) -> bool {
    let palette = Theme::of(ui).palette;
    let (line, response) = ui.allocate_exact_size(vec2(width, space(6)), Sense::click());
    let name = point_name(point);
    response.widget_info(|| {
        let figures: Vec<String> = columns.iter().map(|column| column.text(point)).collect();
        let label = format!("{name}: {}", figures.join(", "));
        WidgetInfo::selected(Role::Row, true, is_marked, label)
    });
    if is_marked {
        ui.painter().rect_filled(line, 3.0, palette.selected);
    } else if response.hovered() {
        ui.painter().rect_filled(line, 3.0, palette.raised);
    }
    let dot = pos2(line.left() + space(2), line.center().y);
    ui.painter()
        .circle_filled(dot, 3.0, hue_colour(point.report.kind.colour().into(), &palette));
    let is_chosen = on_fronts.contains(&true);
    let font = |is_strong: bool| {
        if is_strong {
            semibold(type_size().note)
        } else {
            FontId::proportional(type_size().note)
        }
    };
    let text = if is_chosen { palette.text } else { palette.dim };
    let name = RichText::new(name.replace(" preset", "")).color(text);
    let room = line.width() - Column::WIDTH * columns.len() as f32 - space(4);
    let galley = WidgetText::from(name).into_galley(ui, Some(TextWrapMode::Truncate), room, font(is_chosen));
    let at = pos2(line.left() + space(4), line.center().y - 0.5 * galley.size().y);
    ui.painter().galley(at, galley, text);
    for (number, column) in columns.iter().enumerate() {
        // A cost is strong where nothing else costs as little for as small an error.
        let is_strong = column.cost().is_some_and(|cost| on_fronts[cost]);
        let colour = if is_strong { palette.accent } else { text };
        let at = right_end(line, columns.len() - number);
        ui.painter()
            .text(at, Align2::RIGHT_CENTER, column.text(point), font(is_strong), colour);
    }
    ui.painter()
        .hline(line.x_range(), line.bottom(), Stroke::new(0.5, palette.line));
    let response = response.on_hover_cursor(CursorIcon::PointingHand);
    let response = response.on_hover_text(
        "Click to mark it in the charts. Where a time is blue, no other point has as small an error in as little time.",
    );
    response.clicked()
}
