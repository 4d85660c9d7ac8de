use eframe::egui::{Color32, CornerRadius, FontId, Pos2, Rect, RichText, Sense, Stroke, StrokeKind, Ui, Vec2};

use crate::app::theme::{Theme, space, type_size};

/// How something looks in a chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A curve.
    Line,
    /// A dashed curve.
    Dashes,
    /// Hollow squares.
    Squares,
    /// Discs.
    Discs,
}

/// What a mark in a chart stands for.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    pub name: &'static str,
    pub mark: Mark,
    pub colour: Color32,
}

const SAMPLE_WIDTH: f32 = space(4);

/// The width that [`legend_ui`] takes, in points.
pub fn legend_width(ui: &Ui, keys: &[Key]) -> f32 {
    let font = FontId::proportional(type_size().note);
    let widths = keys.iter().map(|key| {
        let name = ui
            .painter()
            .layout_no_wrap(key.name.to_owned(), font.clone(), key.colour);
        SAMPLE_WIDTH + space(1) + name.size().x + space(3)
    });
    widths.sum()
}

/// What the marks stand for, side by side; outside the chart, so that it covers nothing.
pub fn legend_ui(ui: &mut Ui, keys: &[Key]) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = space(1);
        for key in keys {
            let (sample, _) = ui.allocate_exact_size(Vec2::new(SAMPLE_WIDTH, space(4)), Sense::hover());
            key.paint(ui, sample);
            ui.label(
                RichText::new(key.name)
                    .size(type_size().note)
                    .color(Theme::of(ui).palette.dim),
            );
            ui.add_space(space(2));
        }
    });
}

impl Key {
    fn paint(&self, ui: &Ui, sample: Rect) {
        let painter = ui.painter();
        let (middle, stroke) = (sample.center(), Stroke::new(1.8, self.colour));
        match self.mark {
            Mark::Line => {
                painter.hline(sample.x_range(), middle.y, stroke);
            }
            Mark::Dashes => {
                for start in [0.0, 6.0, 12.0] {
                    let left = sample.left() + start;
                    let ends = [Pos2::new(left, middle.y), Pos2::new(left + 3.5, middle.y)];
                    painter.line_segment(ends, stroke);
                }
            }
            Mark::Squares => {
                let square = Rect::from_center_size(middle, Vec2::splat(7.0));
                painter.rect_stroke(
                    square,
                    CornerRadius::ZERO,
                    Stroke::new(1.2, self.colour),
                    StrokeKind::Inside,
                );
            }
            Mark::Discs => {
                painter.circle_filled(middle, 3.0, self.colour);
            }
        }
    }
}
