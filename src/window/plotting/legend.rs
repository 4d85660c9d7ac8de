use eframe::egui::{
    Color32, CornerRadius, FontId, Pos2, Rect, RichText, Sense, Shape, Stroke, StrokeKind, Ui, Vec2, vec2,
};

use super::cells::hue_colour;
use crate::window::theme::{Theme, space, type_size};
use decoupler_files::figure::{Key, LineStyle, Look, Marker};

const SAMPLE_WIDTH: f32 = space(4);

/// The width that a key takes with the room behind it, in points.
fn key_width(ui: &Ui, key: &Key) -> f32 {
    let font = FontId::proportional(type_size().note);
    let name = ui
        .painter()
        .layout_no_wrap(key.name.clone(), font, Color32::PLACEHOLDER);
    SAMPLE_WIDTH + space(1) + name.size().x + space(3)
}

/// The width that [`legend_ui`] takes in one row, in points.
pub fn legend_width(ui: &Ui, keys: &[Key]) -> f32 {
    keys.iter().map(|key| key_width(ui, key)).sum()
}

/// The keys side by side, in as many rows as they need; outside the plot, so that they cover nothing.
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
        // An area: as pale as it is behind the curves, with an edge.
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
