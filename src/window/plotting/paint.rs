//! Shapes of figures, painted in the colours of the theme.

use decoupler_files::figure::{Align, Bounds, Colour, Ink, Shape, Stroke};
use eframe::egui::{
    self, Color32, FontId, Mesh, Painter, Pos2, Rect, Ui,
    epaint::{PathShape, TextShape},
};
use glam::Vec2;

use crate::window::theme::{Palette, Theme, rgb, type_size};

/// Returns a colour of a figure in the theme.
pub fn colour(colour: impl Into<Colour>, palette: &Palette) -> Color32 {
    let Colour { ink, opacity } = colour.into();
    let colour = match ink {
        Ink::Blue => palette.accent,
        Ink::Red => palette.bad,
        Ink::Green => palette.good,
        Ink::Orange => palette.warning,
        Ink::Violet => palette.violet,
        Ink::Cyan => palette.cyan,
        Ink::Grey | Ink::Label => palette.dim,
        Ink::Text => palette.text,
        Ink::Grid => palette.line,
        Ink::Edge => palette.line.lerp_to_gamma(palette.dim, 0.45),
        Ink::Ground => palette.panel,
        Ink::Missing => palette.raised,
        Ink::Rgb(colour) => rgb(colour),
    };
    if opacity < 1.0 {
        colour.gamma_multiply(opacity)
    } else {
        colour
    }
}

fn stroke(stroke: &Stroke, palette: &Palette) -> egui::Stroke {
    egui::Stroke::new(stroke.width, colour(stroke.colour, palette))
}

/// Paints shapes in their order; neighbouring areas become one mesh. Horizontal text is at whole pixels, to be crisp.
pub fn paint(painter: &Painter, palette: &Palette, shapes: &[Shape]) {
    let is_area = |shape: &Shape| matches!(shape, Shape::Area(..));
    for shapes in shapes.chunk_by(|one, other| is_area(one) && is_area(other)) {
        match &shapes[0] {
            Shape::Line(points, line) => {
                let points: Vec<Pos2> = points.iter().copied().map(to_egui).collect();
                let stroke = stroke(line, palette);
                match line.dashes {
                    Some([dash, gap]) => {
                        painter.extend(egui::Shape::dashed_line(&points, stroke, dash, gap));
                    }
                    None => {
                        painter.add(PathShape::line(points, stroke));
                    }
                }
            }
            Shape::Area(..) => {
                let mut mesh = Mesh::default();
                for shape in shapes {
                    let Shape::Area(corners, fill) = shape else { continue };
                    let (first, fill) = (mesh.vertices.len() as u32, colour(*fill, palette));
                    for corner in corners {
                        mesh.colored_vertex(to_egui(*corner), fill);
                    }
                    for corner in 2..corners.len() as u32 {
                        mesh.add_triangle(first, first + corner - 1, first + corner);
                    }
                }
                painter.add(mesh);
            }
            &Shape::Disc(at, radius, fill) => {
                painter.circle_filled(to_egui(at), radius, colour(fill, palette));
            }
            Shape::Ring(at, radius, line) => {
                painter.circle_stroke(to_egui(*at), *radius, stroke(line, palette));
            }
            Shape::Text(at, align, ink, text) => {
                let colour = colour(*ink, palette);
                let galley = painter.layout_no_wrap(text.clone(), font(), colour);
                let size = galley.size();
                let left = match align {
                    Align::Start => 0.0,
                    Align::Middle => 0.5 * size.x,
                    Align::End => size.x,
                    Align::Upright => {
                        let place = to_egui(*at) + egui::vec2(-0.5 * size.y, 0.5 * size.x);
                        painter.add(TextShape::new(place, galley, colour).with_angle(-std::f32::consts::FRAC_PI_2));
                        continue;
                    }
                };
                let pixel = painter.pixels_per_point();
                let corner = *at - Vec2::new(left, 0.5 * size.y);
                painter.galley(to_egui((corner * pixel).round() / pixel), galley, colour);
            }
        }
    }
}

/// Returns the size of a text of a figure.
pub fn measure(painter: &Painter, text: &str) -> Vec2 {
    let size = painter.layout_no_wrap(text.to_owned(), font(), Color32::WHITE).size();
    Vec2::new(size.x, size.y)
}

fn font() -> FontId {
    FontId::proportional(type_size().small)
}

/// Paints shapes over what `ui` shows.
pub(super) fn paint_over(ui: &Ui, clip: Rect, shapes: &[Shape]) {
    paint(&ui.painter().with_clip_rect(clip), &Theme::of(ui).palette, shapes);
}

/// Converts a rectangle.
pub fn bounds(rect: Rect) -> Bounds {
    Bounds {
        min: to_glam(rect.min),
        max: to_glam(rect.max),
    }
}

/// Converts a rectangle.
pub(super) fn rect(bounds: Bounds) -> Rect {
    Rect::from_min_max(to_egui(bounds.min), to_egui(bounds.max))
}

/// Converts a point.
pub fn to_egui(point: Vec2) -> Pos2 {
    Pos2::new(point.x, point.y)
}

/// Converts a point.
pub fn to_glam(point: Pos2) -> Vec2 {
    Vec2::new(point.x, point.y)
}
