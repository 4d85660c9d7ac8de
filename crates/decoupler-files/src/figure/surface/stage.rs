use glam::{DVec3, Vec2};

use super::{plan_axes::PlanAxes, projection::Projection};

/// Mapping of places to points on the screen.
pub(super) enum Stage<'a> {
    /// In space, lit.
    Space(&'a Projection),
    /// From above.
    Plan(&'a PlanAxes<'a>),
}

impl Stage<'_> {
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
