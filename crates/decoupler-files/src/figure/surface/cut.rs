//! Cells of the surface cut off at the ends of the value axis.

use glam::DVec3;

/// A corner of a cut polygon: its place, and its share of each corner of the cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CutCorner {
    pub(super) place: DVec3,
    pub(super) shares: [f64; 4],
}

/// Cuts a cell, whose corners go round it, at the levels `low` and `high`: polygons of the two triangles in which it is
/// drawn, without what lies beyond (Sutherland and Hodgman 1974), or with that moved to the level where `keeps_plateau`.
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

#[cfg(test)]
mod tests {
    use super::*;

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
            assert!(mixed.distance(place) < 1e-15, "the shares lead to the place");
        }
        assert_eq!(
            cut_cell(corners, 7.0, 9.0, false).count(),
            0,
            "nothing is left of what lies below"
        );
        let whole: f64 = cut_cell(corners, -1.0, 9.0, true).map(|polygon| area(&polygon)).sum();
        assert_eq!(whole, 1.0);
    }

    #[test]
    fn with_its_plateaus_a_cell_is_whole() {
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
}
