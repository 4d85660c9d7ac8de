//! Text around a plot, placed so that nothing overlaps.

use std::sync::Arc;

use eframe::egui::{Color32, FontId, Galley, Painter, Pos2, Rect, Vec2};

use crate::app::theme::type_size;

/// Room kept free around every label, in points.
const CLEARANCE: f32 = 4.0;

/// The labels of one plot, in the order in which they claimed their places. They are kept as text: laid-out text holds
/// only until the font's texture is made anew.
pub(super) struct Labels {
    font: FontId,
    colour: Color32,
    placed: Vec<(Rect, String)>,
}

impl Labels {
    pub(super) fn new(colour: Color32) -> Self {
        Self {
            font: FontId::proportional(type_size().small),
            colour,
            placed: Vec::new(),
        }
    }

    fn galley(&self, painter: &Painter, text: &str) -> Arc<Galley> {
        painter.layout_no_wrap(text.to_owned(), self.font.clone(), self.colour)
    }

    /// Size that a text would take.
    pub(super) fn size(&self, painter: &Painter, text: &str) -> Vec2 {
        self.galley(painter, text).size()
    }

    /// Puts a text beside `anchor`, in the direction `away` (a unit vector) with `gap` between them. If the place is
    /// taken it moves on by up to `slide` points, or else stays away. Says whether it was placed.
    pub(super) fn beside(
        &mut self,
        painter: &Painter,
        anchor: Pos2,
        away: Vec2,
        gap: f32,
        slide: f32,
        text: &str,
    ) -> bool {
        let size = self.size(painter, text);
        // How far the text reaches from its middle towards the anchor.
        let reach = 0.5 * (away.x.abs() * size.x + away.y.abs() * size.y);
        let mut slid = 0.0;
        while slid <= slide {
            let rect = Rect::from_center_size(anchor + away * (gap + reach + slid), size);
            if !self
                .placed
                .iter()
                .any(|(other, _)| other.expand(CLEARANCE).intersects(rect))
            {
                self.placed.push((rect, text.to_owned()));
                return true;
            }
            slid += 4.0;
        }
        false
    }

    /// The rectangle that all labels cover.
    pub(super) fn bounds(&self) -> Rect {
        self.placed
            .iter()
            .fold(Rect::NOTHING, |bounds, (rect, _)| bounds.union(*rect))
    }

    #[cfg(test)]
    pub(super) fn rects(&self) -> impl Iterator<Item = Rect> + '_ {
        self.placed.iter().map(|(rect, _)| *rect)
    }

    pub(super) fn paint(&self, painter: &Painter) {
        let pixel = painter.pixels_per_point();
        for (rect, text) in &self.placed {
            // Whole pixels keep small text crisp.
            let corner = ((rect.min.to_vec2() * pixel).round() / pixel).to_pos2();
            painter.galley(corner, self.galley(painter, text), self.colour);
        }
    }
}
