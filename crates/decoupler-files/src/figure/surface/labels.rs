//! Text around a plot, placed so that nothing overlaps.

use glam::Vec2;

use super::shapes::{Bounds, Text};

/// Room kept free around every label, in points.
const CLEARANCE: f32 = 4.0;

/// The labels of one plot, in the order in which they claimed their places.
pub(super) struct Labels<'a> {
    measure: &'a dyn Fn(&str) -> Vec2,
    placed: Vec<Text>,
}

impl<'a> Labels<'a> {
    pub(super) fn new(measure: &'a dyn Fn(&str) -> Vec2) -> Self {
        Self {
            measure,
            placed: Vec::new(),
        }
    }

    /// Size that a text would take.
    pub(super) fn size(&self, text: &str) -> Vec2 {
        (self.measure)(text)
    }

    /// Puts a text next to `anchor`, in the direction `away` (a unit vector) with `gap` between them. If the place is
    /// taken it moves on by up to `slide` points, or else stays away. Says whether it was placed.
    pub(super) fn beside(&mut self, anchor: Vec2, away: Vec2, gap: f32, slide: f32, text: &str) -> bool {
        let size = self.size(text);
        // How far the text reaches from its middle towards the anchor.
        let reach = 0.5 * away.abs().dot(size);
        let mut slid = 0.0;
        while slid <= slide {
            let bounds = Bounds::centred(anchor + away * (gap + reach + slid), size);
            let is_free = |other: &Text| !other.bounds.grown(CLEARANCE).intersects(&bounds);
            if self.placed.iter().all(is_free) {
                self.placed.push(Text {
                    bounds,
                    text: text.to_owned(),
                });
                return true;
            }
            slid += 4.0;
        }
        false
    }

    /// The rectangle that all labels cover.
    pub(super) fn bounds(&self) -> Bounds {
        let all = self.placed.iter().map(|label| label.bounds);
        all.fold(Bounds::NOTHING, Bounds::union)
    }

    pub(super) fn into_texts(self) -> Vec<Text> {
        self.placed
    }
}
