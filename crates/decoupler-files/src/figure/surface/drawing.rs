//! A surface laid out in a card, ready to be painted, and the placing of labels without overlap.

use decoupler_core::text::counted;
use glam::Vec2;

use super::{
    Surface, ViewMode,
    box_axes::Axes,
    camera::{OrbitCamera, PlotBox, Sight},
    field::Field,
    mesh::Mesh,
    nodes::Dots,
};
use crate::figure::{
    colour_map::ColourMap,
    drawing::{Align, Bounds, Ink, Measure, Shape},
};

/// Usual size of the labels of a box, in points.
const LABELS: Vec2 = Vec2::new(72.0, 56.0);
/// Free edge of a card, in points.
const EDGE: f32 = 8.0;

/// Space, text metrics and colours with which a surface is laid out.
pub struct Card<'a> {
    /// The space to fill.
    pub bounds: Bounds,
    /// Returns the size of a text.
    pub measure: Measure<'a>,
    /// The colours of the values.
    pub colours: &'a ColourMap,
}

/// A laid-out surface, in the order of painting.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// The frame with its ticks, numbers and names.
    pub frame: Vec<Shape>,
    /// The surface.
    pub mesh: Mesh,
    /// The nodes.
    pub dots: Dots,
    /// From points on the screen back to millimetres.
    pub sight: Sight,
    /// Note on parts beyond the axes and how they are drawn.
    pub note: Option<String>,
}

impl Surface {
    /// Lays the surface out as `camera` sees it.
    pub fn lay_out(&self, camera: OrbitCamera, card: &Card<'_>) -> Drawing {
        let field = Field::new(self);
        let value_name = self.quantity.axis_name();
        let names = ["x (mm)", "y (mm)", &*value_name];
        let (min_mm, max_mm) = field.box_mm();
        let inner = card.bounds.grown(-EDGE);
        let (plot_box, camera) = match self.mode {
            ViewMode::ThreeD => {
                let [width, height] = (card.bounds.size() - LABELS).max(Vec2::ONE).into();
                (PlotBox::new(min_mm, max_mm, height / width), Some(camera))
            }
            ViewMode::Top => (PlotBox::flat(min_mm, max_mm), None),
        };
        let axes = Axes::new(card.measure, inner, plot_box, camera, &field.range, names);
        let sight = axes.sight;
        let (mesh, dots) = match field.values.is_empty() {
            true => Default::default(),
            false => (Mesh::new(&field, &sight, card.colours), Dots::new(self, &field, &sight)),
        };
        let mut frame = axes.lines();
        frame.extend(axes.labels.shapes());
        Drawing {
            note: note(mesh.has_plateau, dots.beyond()),
            frame,
            mesh,
            dots,
            sight,
        }
    }
}

/// Returns the note on a part of the surface, or this number of nodes, beyond the axis and drawn at its end.
fn note(has_plateau: bool, nodes: usize) -> Option<String> {
    match (has_plateau, nodes) {
        (false, 0) => None,
        (true, 0) => Some("Beyond the axes: hatched".to_owned()),
        (true, _) => Some(format!("Beyond the axes: hatched, {}", counted(nodes, "node"))),
        (false, 1) => Some("1 node beyond the axes is drawn at their edge".to_owned()),
        (false, _) => Some(format!("{nodes} nodes beyond the axes are drawn at their edge")),
    }
}

/// Room kept free around every label, in points.
const CLEARANCE: f32 = 4.0;

/// The labels of one plot, in the order in which they were placed.
pub(super) struct Labels<'a> {
    measure: Measure<'a>,
    placed: Vec<(Bounds, String)>,
}

impl<'a> Labels<'a> {
    pub(super) fn new(measure: Measure<'a>) -> Self {
        Self {
            measure,
            placed: Vec::new(),
        }
    }

    /// Returns the size of a text.
    pub(super) fn size(&self, text: &str) -> Vec2 {
        (self.measure)(text)
    }

    /// Puts a text next to `anchor`, in the direction `away` (a unit vector) with `gap` between them. If the place is
    /// occupied, moves the text by up to `slide` points. Returns false if there is no room.
    pub(super) fn place_next_to(&mut self, anchor: Vec2, away: Vec2, gap: f32, slide: f32, text: &str) -> bool {
        let size = self.size(text);
        // Distance from the middle of the text to its side near the anchor.
        let reach = 0.5 * away.abs().dot(size);
        let mut slid = 0.0;
        while slid <= slide {
            let bounds = Bounds::centred(anchor + away * (gap + reach + slid), size);
            if self
                .bounds_of_each()
                .all(|other| !other.grown(CLEARANCE).intersects(&bounds))
            {
                self.placed.push((bounds, text.to_owned()));
                return true;
            }
            slid += 4.0;
        }
        false
    }

    pub(super) fn bounds_of_each(&self) -> impl Iterator<Item = Bounds> {
        self.placed.iter().map(|(bounds, _)| *bounds)
    }

    /// Returns the bounding rectangle of all labels.
    pub(super) fn bounds(&self) -> Bounds {
        self.bounds_of_each().fold(Bounds::NOTHING, Bounds::union)
    }

    fn shapes(self) -> impl Iterator<Item = Shape> {
        let texts = self.placed.into_iter();
        texts.map(|(bounds, text)| Shape::text(bounds.middle(), Align::Middle, Ink::Label, text))
    }
}
