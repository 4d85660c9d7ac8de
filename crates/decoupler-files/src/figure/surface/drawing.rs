//! A surface laid out in a card, ready to be painted, and the placing of labels without overlap.

use decoupler_core::text::counted;
use glam::{DVec3, Vec2};

use super::{
    Surface, ViewMode,
    box_axes::{BoxAxes, PlanAxes},
    camera::{OrbitCamera, PlotBox, Projection, Sight},
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
        let (mut frame, labels, (mesh, dots), sight) = match self.mode {
            ViewMode::ThreeD => {
                let [width, height] = (card.bounds.size() - LABELS).max(Vec2::ONE).into();
                let plot_box = PlotBox::new(min_mm, max_mm, height / width);
                let axes = BoxAxes::new(card.measure, inner, plot_box, camera, &field.range, names);
                let painted = self.paint(&field, &Projector::Space(&axes.projection), card);
                let sight = Sight::of_projection(&axes.projection);
                (axes.lines(), axes.labels, painted, sight)
            }
            ViewMode::Top => {
                let names = [names[0], names[1]];
                let axes = PlanAxes::new(card.measure, inner, min_mm.truncate(), max_mm.truncate(), names);
                let painted = self.paint(&field, &Projector::Plan(&axes), card);
                let sight = Sight::of_plan(&axes);
                (axes.lines(), axes.labels, painted, sight)
            }
        };
        frame.extend(labels.shapes());
        Drawing {
            note: note(mesh.has_plateau, dots.beyond()),
            frame,
            mesh,
            dots,
            sight,
        }
    }

    fn paint(&self, field: &Field<'_>, stage: &Projector<'_>, card: &Card<'_>) -> (Mesh, Dots) {
        if field.values.is_empty() {
            return <(Mesh, Dots)>::default();
        }
        (
            Mesh::new(field, stage, card.colours),
            Dots::new(&self.nodes, field, stage),
        )
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

/// Mapping of places to points on the screen.
pub(super) enum Projector<'a> {
    /// In space, lit.
    Space(&'a Projection),
    /// From above.
    Plan(&'a PlanAxes<'a>),
}

impl Projector<'_> {
    /// Returns the position on the screen of a place with a value.
    pub(super) fn point(&self, place: DVec3) -> Vec2 {
        match self {
            Self::Space(projection) => projection.point(place),
            Self::Plan(plan) => plan.point(place.truncate()),
        }
    }

    /// Returns the place of the eye, for a picture in space.
    pub(super) fn eye_mm(&self) -> Option<DVec3> {
        match self {
            Self::Space(projection) => Some(projection.plot_box.place_mm(projection.eye)),
            Self::Plan(_) => None,
        }
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
