//! Marks on a plateau, which is drawn at the end of the value axis for what lies beyond: a rim and hatching, so that no one
//! takes it for a height.

use glam::DVec3;

use super::{contour::cross_cell, field::Field};

/// Lines of the hatching along the longer side of a surface, about.
const HATCHES: usize = 22;

/// Calls `mark` with the ends of each piece of the rim and of the hatching in the cell at `(ix, iy)`; nothing where the
/// cell has no part beyond the axis that is drawn.
pub(super) fn plateau_marks(field: &Field<'_>, ix: usize, iy: usize, mut mark: impl FnMut([DVec3; 2])) {
    if !field.keeps_plateau(ix, iy) {
        return;
    }
    let corners = field.corners_mm(ix, iy);
    let values = corners.map(|corner| corner.z);
    for (end, side) in [(*field.shown().start(), -1.0), (*field.shown().end(), 1.0)] {
        let excess = |place: DVec3| side * (place.z - end);
        if !corners.iter().any(|corner| excess(*corner) > 0.0) {
            continue;
        }
        let flat = |place: DVec3| place.with_z(end);
        cross_cell(values, end, |ends| {
            mark(ends.map(|(a, b, part)| flat(corners[a].lerp(corners[b], f64::from(part)))));
        });
        // Along the diagonal of every few cells; those of neighbours meet.
        let [a, b, c, d] = corners;
        let points = field.grid.x_mm().len().max(field.grid.y_mm().len());
        if (ix + iy).is_multiple_of((points / HATCHES).max(1)) {
            // The cell bends along the other diagonal.
            let middle = a.lerp(c, 0.5);
            for [from, to] in [[b, middle], [middle, d]] {
                if let Some(ends) = beyond([from, to], excess) {
                    mark(ends.map(flat));
                }
            }
        }
    }
}

/// The part of a straight line where `excess`, which is linear along it, is above 0.
fn beyond([from, to]: [DVec3; 2], excess: impl Fn(DVec3) -> f64) -> Option<[DVec3; 2]> {
    let (here, there) = (excess(from), excess(to));
    let crossing = || from.lerp(to, here / (here - there));
    match (here > 0.0, there > 0.0) {
        (true, true) => Some([from, to]),
        (true, false) => Some([from, crossing()]),
        (false, true) => Some([crossing(), to]),
        (false, false) => None,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec2;

    use super::*;
    use crate::figure::surface::{Bounds, Card, Drawing, OrbitCamera, Quantity, Surface, ViewMode};
    use decoupler_core::surface::SurfaceMap;

    /// A flat sheet 5 high over 6 × 6 nodes, of which the middle overshoots to `top`.
    fn overshot(top: f64, mode: ViewMode) -> Surface {
        let places: Vec<f64> = (0..6).map(f64::from).collect();
        let map = Arc::new(SurfaceMap::new(&places, &places).expect("a lattice"));
        let is_middle = |node: usize| (2..4).contains(&(node / 6)) && (2..4).contains(&(node % 6));
        let heights: Vec<f64> = (0..36).map(|node| if is_middle(node) { top } else { 5.0 }).collect();
        let values = map.evaluate(&heights);
        let node = |node: usize| DVec3::new(places[node / 6], places[node % 6], heights[node]);
        Surface {
            title: String::new(),
            values: values.into(),
            nodes: (0..36).map(node).collect(),
            map,
            quantity: Quantity::Height,
            range: 4.0..=5.0,
            mode,
            colours: Default::default(),
        }
    }

    fn laid_out(surface: &Surface) -> Drawing {
        surface.lay_out(
            OrbitCamera::default(),
            &Card {
                bounds: Bounds::of([Vec2::ZERO, Vec2::splat(400.0)]),
                measure: &|text| Vec2::new(6.0 * text.chars().count() as f32, 14.0),
                colours: surface.colours.colours(),
            },
        )
    }

    /// Returns true if any painted piece of the surface covers a place of the screen.
    fn covers(drawing: &Drawing, place: Vec2) -> bool {
        let mesh = &drawing.mesh;
        let covers = |corners: [Vec2; 3]| {
            let [a, b, c] = corners;
            let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| (to - from).perp_dot(place - from));
            sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0)
        };
        mesh.strips().flat_map(|(cells, _)| cells).any(|&cell| {
            let [a, b, c, d] = mesh.corners(cell).map(|corner| mesh.vertices[corner].at);
            covers([a, b, c]) || covers([a, c, d])
        })
    }

    #[test]
    fn an_overshoot_leaves_no_hole_and_is_marked() {
        for (top, mode) in [(5.6, ViewMode::ThreeD), (3.4, ViewMode::ThreeD), (5.6, ViewMode::Top)] {
            let surface = overshot(top, mode);
            let drawing = laid_out(&surface);
            let end = if top > 5.0 { 5.08 } else { 3.92 };
            for step in 0..121 {
                let place = DVec3::new(2.0 + 0.1 * f64::from(step / 11), 2.0 + 0.1 * f64::from(step % 11), end);
                let at = drawing.sight.point(place).as_vec2();
                assert!(covers(&drawing, at), "{top} {mode:?}: a hole at {place}");
            }
            let note = drawing.note.unwrap_or_default();
            assert_eq!(note.contains("hatched"), mode == ViewMode::ThreeD, "{note}");
        }
    }

    #[test]
    fn the_hatching_lies_on_the_plateau_only() {
        let surface = overshot(5.6, ViewMode::ThreeD);
        let field = Field::new(&surface);
        let mut marks = 0;
        let (x_mm, y_mm) = (field.grid.x_mm(), field.grid.y_mm());
        for ix in 0..x_mm.len() - 1 {
            for iy in 0..y_mm.len() - 1 {
                plateau_marks(&field, ix, iy, |ends| {
                    marks += 1;
                    for place in ends {
                        assert_eq!(place.z, 5.08);
                        let near = |at: f64| (1.0..=4.0).contains(&at);
                        assert!(near(place.x) && near(place.y), "{place} is not near the overshoot");
                    }
                });
            }
        }
        assert!(marks > 20, "{marks}");
        let within = overshot(5.05, ViewMode::ThreeD);
        assert!(
            laid_out(&within).note.is_none(),
            "what the box has room for is no overshoot"
        );
    }
}
