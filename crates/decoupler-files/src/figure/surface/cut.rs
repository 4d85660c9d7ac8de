//! Cuts of a surface: at the ends of the value axis, with the marks (rim and hatching) of a plateau there; along
//! contour lines (marching squares); and along a wire.

use decoupler_core::surface::Grid;
use glam::{DVec3, Vec2};

use super::{Surface, camera::Sight, field::Field};
use crate::figure::{
    Hue,
    drawing::{Ink, Shape, Stroke},
};

/// A corner of a cut polygon: its place, and its share of each corner of the cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CutCorner {
    pub(super) place: DVec3,
    pub(super) shares: [f64; 4],
}

/// Cuts a cell, whose corners go round it, at the levels `low` and `high`: polygons of the two triangles in which it is
/// drawn (Sutherland and Hodgman 1974). Parts beyond a level are left out, or moved to the level if `keeps_plateau`.
pub(super) fn cut_cell(
    corners: [DVec3; 4],
    low: f64,
    high: f64,
    keeps_plateau: bool,
) -> impl Iterator<Item = Vec<CutCorner>> {
    let corner = move |at: usize| {
        let mut shares = [0.0; 4];
        shares[at] = 1.0;
        CutCorner {
            place: corners[at],
            shares,
        }
    };
    let polygons = [[0, 1, 2], [0, 2, 3]].into_iter().flat_map(move |triangle| {
        let whole = triangle.map(corner).to_vec();
        let above = cut(&whole, |place| place.z - low);
        let within = cut(&above, |place| high - place.z);
        let [floor, ceiling] = [(low, -1.0), (high, 1.0)].map(|(level, side)| match keeps_plateau {
            true => flattened(cut(&whole, |place| side * (place.z - level)), level),
            false => Vec::new(),
        });
        [within, floor, ceiling]
    });
    polygons.filter(|polygon| polygon.len() > 2)
}

fn flattened(mut polygon: Vec<CutCorner>, level: f64) -> Vec<CutCorner> {
    polygon.iter_mut().for_each(|corner| corner.place.z = level);
    polygon
}

/// The part of a convex polygon where `excess` is not below 0.
fn cut(polygon: &[CutCorner], excess: impl Fn(DVec3) -> f64) -> Vec<CutCorner> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (at, &corner) in polygon.iter().enumerate() {
        let next = polygon[(at + 1) % polygon.len()];
        let (here, there) = (excess(corner.place), excess(next.place));
        if here >= 0.0 {
            kept.push(corner);
        }
        if (here >= 0.0) != (there >= 0.0) {
            let part = here / (here - there);
            let mut shares = corner.shares;
            for (share, next) in shares.iter_mut().zip(next.shares) {
                *share += part * (next - *share);
            }
            kept.push(CutCorner {
                place: corner.place.lerp(next.place, part),
                shares,
            });
        }
    }
    kept
}

/// Calls `draw` with the ends of each piece of the line `value = level`. An end is given as `(corner a, corner b,
/// part)`: at the fraction `part` of the side from a to b. Corners go round the cell.
pub(super) fn cross_cell(values: [f64; 4], level: f64, mut draw: impl FnMut([(usize, usize, f32); 2])) {
    let mut ends = [(0, 0, 0.0); 4];
    let mut found = 0;
    for a in 0..4 {
        let b = (a + 1) % 4;
        if (values[a] < level) != (values[b] < level) {
            ends[found] = (a, b, ((level - values[a]) / (values[b] - values[a])) as f32);
            found += 1;
        }
    }
    match found {
        2 => draw([ends[0], ends[1]]),
        // A saddle: the value in the middle decides which corners are connected.
        4 => {
            let middle_is_low = values.iter().sum::<f64>() < 4.0 * level;
            let first_is_low = values[0] < level;
            let [w, x, y, z] = ends;
            if middle_is_low == first_is_low {
                draw([w, x]);
                draw([y, z]);
            } else {
                draw([z, w]);
                draw([x, y]);
            }
        }
        _ => {}
    }
}

/// Approximate number of hatching lines along the longer side of a surface.
const HATCHES: usize = 22;

/// Calls `mark` with the ends of each piece of the rim and of the hatching in the cell at `(ix, iy)`; nothing if no
/// drawn part of the cell is beyond the axis.
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
        // Along the diagonals of every few cells; diagonals of neighbours meet.
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

/// Wire along which surfaces are cut, by its number from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SectionLine {
    /// Along y, through the nodes of the row-wire.
    RowWire(usize),
    /// Along x, above the column-wire.
    ColumnWire(usize),
}

/// Vertical plane along a wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// The wire.
    pub line: SectionLine,
    /// x of a row-wire, y of a column-wire.
    pub at_mm: f64,
}

impl SectionLine {
    /// Returns its name: "row-wire 3".
    pub fn name(self) -> String {
        match self {
            Self::RowWire(row) => format!("row-wire {}", row + 1),
            Self::ColumnWire(column) => format!("column-wire {}", column + 1),
        }
    }
}

impl Section {
    /// Returns the curve in which the plane cuts the surface of these `values` on a grid, linear between its points as the
    /// surface is drawn; empty if it misses the grid.
    pub fn curve_mm(&self, grid: &Grid, values: &[f64]) -> Vec<DVec3> {
        let (across, along) = match self.line {
            SectionLine::RowWire(_) => (grid.x_mm(), grid.y_mm()),
            SectionLine::ColumnWire(_) => (grid.y_mm(), grid.x_mm()),
        };
        let Some((before, share)) = cell(across, self.at_mm).filter(|_| values.len() == grid.len()) else {
            return Vec::new();
        };
        let value = |across: usize, along: usize| match self.line {
            SectionLine::RowWire(_) => values[grid.index(across, along)],
            SectionLine::ColumnWire(_) => values[grid.index(along, across)],
        };
        let points = along.iter().enumerate().map(|(index, &at_mm)| {
            // At a grid point, a gap next to it does not matter.
            let height = match share {
                0.0 => value(before, index),
                _ => (1.0 - share) * value(before, index) + share * value(before + 1, index),
            };
            match self.line {
                SectionLine::RowWire(_) => DVec3::new(self.at_mm, at_mm, height),
                SectionLine::ColumnWire(_) => DVec3::new(at_mm, self.at_mm, height),
            }
        });
        points.collect()
    }

    /// Returns the curve along the surface as it is drawn: in several pieces if it has gaps or is clipped at the box of the
    /// axes.
    pub fn shapes(&self, surface: &Surface, sight: &Sight) -> Vec<Shape> {
        let field = Field::new(surface);
        let curve = self.curve_mm(field.grid, field.values);
        let drawn: Vec<Option<DVec3>> = curve.into_iter().map(|place| field.drawn_at(place)).collect();
        let pieces = drawn.split(Option::is_none).filter(|piece| piece.len() > 1);
        let shapes = pieces.flat_map(|piece| {
            let points: Vec<Vec2> = piece.iter().flatten().map(|at| sight.drawn(*at)).collect();
            let strokes = [
                Stroke::new(Ink::Ground.at(0.7), 3.5),
                Stroke::new(Ink::Hue(Hue::Orange), 1.8),
            ];
            strokes.map(|stroke| Shape::Line(points.clone(), stroke))
        });
        shapes.collect()
    }
}

/// Returns the point of an ascending axis before a place, and the fraction of the way to the next; `None` outside the
/// axis.
fn cell(points_mm: &[f64], at_mm: f64) -> Option<(usize, f64)> {
    let after = points_mm.partition_point(|point| *point <= at_mm);
    let before = after.checked_sub(1)?;
    // A wire through the nodes is at a grid point, up to rounding.
    let pitch = points_mm.get(1)? - points_mm[0];
    if let Some(near) = [before, after].into_iter().find(|&near| {
        let point = points_mm.get(near);
        point.is_some_and(|point| (point - at_mm).abs() < 1e-9 * pitch)
    }) {
        return Some((near, 0.0));
    }
    let next = points_mm.get(after)?;
    Some((before, (at_mm - points_mm[before]) / (next - points_mm[before])))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use decoupler_core::surface::SurfaceMap;
    use glam::Vec2;

    use super::*;
    use crate::figure::drawing::Bounds;
    use crate::figure::surface::{Card, Drawing, OrbitCamera, Quantity, Surface, ViewMode};

    fn area(polygon: &[CutCorner]) -> f64 {
        let flat = |at: usize| polygon[at % polygon.len()].place.truncate();
        0.5 * (0..polygon.len())
            .map(|at| flat(at).perp_dot(flat(at + 1)))
            .sum::<f64>()
    }

    /// The plane z = 4 x + 2 y over the unit square leaves between 1 and 3 the area by hand: all less the triangle below
    /// (½ · ¼ · ½) and the part above 4 x + 2 y = 3 (a trapezium, x from ¾ to ¼ along y: ½).
    #[test]
    fn a_plane_is_cut_along_its_levels() {
        let plane = |x: f64, y: f64| DVec3::new(x, y, 4.0 * x + 2.0 * y);
        let corners = [plane(0.0, 0.0), plane(1.0, 0.0), plane(1.0, 1.0), plane(0.0, 1.0)];
        let polygons: Vec<_> = cut_cell(corners, 1.0, 3.0, false).collect();
        let total: f64 = polygons.iter().map(|polygon| area(polygon)).sum();
        assert!((total - (1.0 - 0.0625 - 0.5)).abs() < 1e-15, "{total}");
        for corner in polygons.iter().flatten() {
            let place = corner.place;
            assert!((place.z - 4.0 * place.x - 2.0 * place.y).abs() < 1e-15);
            assert!((1.0 - 1e-15..=3.0 + 1e-15).contains(&place.z));
            let mixed: DVec3 = corners
                .iter()
                .zip(corner.shares)
                .map(|(corner, share)| *corner * share)
                .sum();
            assert!(mixed.distance(place) < 1e-15, "the shares give the place");
        }
        assert_eq!(cut_cell(corners, 7.0, 9.0, false).count(), 0, "nothing below is left");
        let whole: f64 = cut_cell(corners, -1.0, 9.0, true).map(|polygon| area(&polygon)).sum();
        assert_eq!(whole, 1.0);
    }

    #[test]
    fn a_cell_is_complete_with_its_plateaus() {
        let plane = |x: f64, y: f64| DVec3::new(x, y, 4.0 * x + 2.0 * y);
        let corners = [plane(0.0, 0.0), plane(1.0, 0.0), plane(1.0, 1.0), plane(0.0, 1.0)];
        let polygons: Vec<_> = cut_cell(corners, 1.0, 3.0, true).collect();
        let at_level = |level: f64| {
            let flat = polygons
                .iter()
                .filter(|polygon| polygon.iter().all(|corner| corner.place.z == level));
            flat.map(|polygon| area(polygon)).sum::<f64>()
        };
        assert!((at_level(1.0) - 0.0625).abs() < 1e-15 && (at_level(3.0) - 0.5).abs() < 1e-15);
        let total: f64 = polygons.iter().map(|polygon| area(polygon)).sum();
        assert!((total - 1.0).abs() < 1e-15, "{total}");
    }

    fn pieces(values: [f64; 4]) -> Vec<[(usize, usize, f32); 2]> {
        let mut pieces = Vec::new();
        cross_cell(values, 0.5, |piece| pieces.push(piece));
        pieces
    }

    #[test]
    fn a_slope_is_crossed_once() {
        assert_eq!(pieces([0.0, 1.0, 1.0, 0.0]), [[(0, 1, 0.5), (2, 3, 0.5)]]);
        assert!(pieces([0.0, 0.1, 0.2, 0.3]).is_empty());
    }

    #[test]
    fn a_saddle_is_crossed_twice_around_its_lower_or_upper_corners() {
        // Middle low: the high corners 1 and 3 are cut off.
        assert_eq!(
            pieces([0.0, 0.8, 0.0, 0.8]),
            [[(0, 1, 0.625), (1, 2, 0.375)], [(2, 3, 0.625), (3, 0, 0.375)]]
        );
        // Middle high: the low corners 0 and 2 are.
        assert_eq!(pieces([0.1, 1.0, 0.1, 1.0])[0][0].0, 3);
    }

    /// A flat sheet at height 5 over 6 × 6 nodes, whose middle overshoots to `top`.
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
        mesh.strips().flat_map(|(cells, _)| cells).any(|cell| {
            let [a, b, c, d] = cell.map(|corner| mesh.vertices[corner].at);
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
    fn only_the_plateau_is_hatched() {
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
        assert!(laid_out(&within).note.is_none(), "within the box there is no overshoot");
    }

    /// A plane over 3 × 4 nodes, which every interpolation reproduces.
    fn plane() -> (SurfaceMap, Vec<f64>) {
        let (x, y) = ([8.0, 9.0, 10.0], [3.0, 5.0, 7.0, 9.0]);
        let map = SurfaceMap::new(&x, &y).unwrap();
        let nodes: Vec<f64> = x.iter().flat_map(|x| y.iter().map(move |y| height(*x, *y))).collect();
        let values = map.evaluate(&nodes);
        (map, values)
    }

    fn height(x: f64, y: f64) -> f64 {
        4.0 + 0.1 * x - 0.03 * y
    }

    #[test]
    fn a_plane_is_cut_in_straight_lines() {
        let (map, values) = plane();
        for line in [SectionLine::RowWire(0), SectionLine::ColumnWire(4)] {
            // On nodes, between them, and in the margin beyond them.
            for at_mm in [9.0, 8.37, 9.999_999, 7.6] {
                let curve = Section { line, at_mm }.curve_mm(map.grid(), &values);
                assert!(curve.len() > 20, "{line:?} at {at_mm}");
                for place in curve {
                    let fixed = if matches!(line, SectionLine::RowWire(_)) {
                        place.x
                    } else {
                        place.y
                    };
                    assert!((fixed - at_mm).abs() < 1e-12);
                    assert!((place.z - height(place.x, place.y)).abs() < 1e-9, "{place} of {line:?}");
                }
            }
        }
    }

    #[test]
    fn nothing_is_cut_outside_the_surface_and_a_gap_next_to_a_wire_does_not_matter() {
        let (map, mut values) = plane();
        let grid = map.grid();
        let outside = Section {
            line: SectionLine::RowWire(0),
            at_mm: 2.0,
        };
        assert!(outside.curve_mm(grid, &values).is_empty());
        let row = grid.x_mm().iter().position(|x| (x - 9.0).abs() < 1e-9).unwrap();
        for iy in 0..grid.y_mm().len() {
            values[grid.index(row + 1, iy)] = f64::NAN;
        }
        let on = Section {
            line: SectionLine::RowWire(1),
            at_mm: 9.0 + 1e-13,
        };
        assert!(on.curve_mm(grid, &values).iter().all(|place| place.z.is_finite()));
    }
}
