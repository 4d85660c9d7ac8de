//! Surfaces through the nodes, against an independent implementation and at the extremes.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use decoupler::surface::{Axis, Grid, Interpolation, SurfaceError, SurfaceMap};

#[derive(serde::Deserialize)]
struct Case {
    name: String,
    x_mm: Vec<f64>,
    y_mm: Vec<f64>,
    node_values: Vec<f64>,
    points_mm: Vec<(f64, f64)>,
    surface: Vec<f64>,
}

fn cases() -> Vec<Case> {
    serde_json::from_str(include_str!("fixtures/griddata_v4.json")).unwrap()
}

fn lattice(count: usize, pitch_mm: f64) -> Vec<f64> {
    (0..count).map(|i| 8.0 + pitch_mm * i as f64).collect()
}

fn heights(count: usize) -> Vec<f64> {
    (0..count).map(|i| 4.5 + 0.5 * (1.7 * i as f64).sin()).collect()
}

/// The surface at a place by bilinear lookup in the grid's values; exact where the place is a grid point.
fn at(grid: &Grid, values: &[f64], (x_mm, y_mm): (f64, f64)) -> Option<f64> {
    let ix = grid.x_mm().iter().position(|x| (x - x_mm).abs() < 1e-9)?;
    let iy = grid.y_mm().iter().position(|y| (y - y_mm).abs() < 1e-9)?;
    Some(values[grid.index(ix, iy)])
}

#[test]
fn agrees_with_griddata_v4() {
    for case in cases() {
        let map = SurfaceMap::new(&case.x_mm, &case.y_mm).unwrap();
        assert_eq!(map.interpolation(), Interpolation::BiharmonicSpline, "{}", case.name);
        let values = map.evaluate(&case.node_values);
        let mut compared = 0;
        for (&point, &expected) in case.points_mm.iter().zip(&case.surface) {
            if let Some(value) = at(map.grid(), &values, point) {
                assert!(
                    (value - expected).abs() < 1e-9,
                    "{} at {point:?}: {value} is not {expected}",
                    case.name
                );
                compared += 1;
            }
        }
        assert!(
            compared >= 20,
            "{}: only {compared} of the reference points are on the grid",
            case.name
        );
    }
}

#[test]
fn passes_through_every_node() {
    for (rows, per_row, interpolation) in [
        (10, 10, Interpolation::BiharmonicSpline),
        (10, 6, Interpolation::BiharmonicSpline),
        (2, 2, Interpolation::BiharmonicSpline),
        (40, 40, Interpolation::Bilinear),
        (1, 10, Interpolation::Bilinear),
        (10, 1, Interpolation::Bilinear),
        (1, 1, Interpolation::Bilinear),
    ] {
        let (x_mm, y_mm) = (lattice(rows, 1.0), lattice(per_row, 2.0));
        let map = SurfaceMap::new(&x_mm, &y_mm).unwrap();
        assert_eq!(map.interpolation(), interpolation, "{rows}×{per_row}");
        let node_values = heights(rows * per_row);
        let values = map.evaluate(&node_values);
        for (row, &x) in x_mm.iter().enumerate() {
            for (node, &y) in y_mm.iter().enumerate() {
                let value = at(map.grid(), &values, (x, y));
                assert_eq!(
                    value,
                    Some(node_values[row * per_row + node]),
                    "{rows}×{per_row} at {row}, {node}"
                );
            }
        }
        assert!(values.iter().all(|value| value.is_finite()));
    }
}

#[test]
fn the_order_of_the_wires_does_not_matter() {
    let (x_mm, y_mm) = (lattice(3, 1.0), lattice(2, 2.0));
    let node_values = heights(6);
    let straight = SurfaceMap::new(&x_mm, &y_mm).unwrap().evaluate(&node_values);
    let back: Vec<f64> = x_mm.iter().rev().copied().collect();
    let swapped: Vec<f64> = node_values.chunks(2).rev().flatten().copied().collect();
    let reversed = SurfaceMap::new(&back, &y_mm).unwrap().evaluate(&swapped);
    assert!(straight.iter().zip(&reversed).all(|(a, b)| (a - b).abs() < 1e-12));
}

#[test]
fn a_lone_node_gives_a_level_surface() {
    let values = SurfaceMap::new(&[8.0], &[15.5]).unwrap().evaluate(&[4.2]);
    assert!(values.iter().all(|&value| value == 4.2));
}

#[test]
fn a_singular_spline_falls_back_to_bilinear() {
    // All four nodes e apart along the sides: φ(e) = 0, and the diagonals alone make G singular for no lattice,
    // so stretch one side until the determinant of the 2 × 2 lattice, (s + d)² − (…)² in its symmetries, vanishes.
    let phi = |r: f64| r * r * (r.ln() - 1.0);
    // Eigenvalue of the vector (1, 1, −1, −1): φ(a) − φ(b) − φ(diagonal); zero for this b with a = 1.
    let (mut low, mut high) = (0.1_f64, std::f64::consts::E);
    let eigenvalue = |b: f64| phi(1.0) - phi(b) - phi((1.0 + b * b).sqrt());
    assert!(eigenvalue(low) * eigenvalue(high) < 0.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if eigenvalue(low) * eigenvalue(middle) <= 0.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    let map = SurfaceMap::new(&[0.0, 1.0], &[0.0, low]).unwrap();
    assert_eq!(map.interpolation(), Interpolation::Bilinear);
    let values = map.evaluate(&[4.0, 4.5, 5.0, 4.2]);
    assert!(values.iter().all(|value| (4.0..=5.0).contains(value)));

    let pair = SurfaceMap::new(&[0.0], &[0.0, std::f64::consts::E]).unwrap();
    assert_eq!(pair.interpolation(), Interpolation::Bilinear);
}

#[test]
fn the_grid_reaches_half_a_pitch_beyond_the_nodes() {
    let map = SurfaceMap::new(&lattice(10, 1.0), &lattice(10, 2.0)).unwrap();
    let grid = map.grid();
    let ends = |axis: &[f64]| (axis[0], axis[axis.len() - 1]);
    assert_eq!((ends(grid.x_mm()), ends(grid.y_mm())), ((7.5, 17.5), (7.0, 27.0)));
    assert!((90..=120).contains(&grid.x_mm().len()) && (90..=120).contains(&grid.y_mm().len()));
    assert!(grid.x_mm().windows(2).all(|pair| pair[0] < pair[1]));
    assert!(!grid.is_inside(0, 50) && grid.is_inside(*grid.inside_x().start(), 50));
    assert_eq!(grid.x_mm()[*grid.inside_x().start()], 8.0);
    assert_eq!(grid.x_mm()[*grid.inside_x().end()], 17.0);
}

#[test]
fn long_axes_are_thinned() {
    let map = SurfaceMap::new(&lattice(1000, 1.0), &lattice(3, 2.0)).unwrap();
    assert!(map.grid().x_mm().len() < 150);
    assert!(map.evaluate(&heights(3000)).iter().all(|value| value.is_finite()));
}

#[test]
fn a_missing_value_leaves_a_gap_around_its_node() {
    let map = SurfaceMap::new(&lattice(10, 1.0), &lattice(10, 2.0)).unwrap();
    let mut node_values = heights(100);
    node_values[45] = f64::NAN;
    let values = map.evaluate(&node_values);
    let missing = values.iter().filter(|value| value.is_nan()).count();
    assert!(
        missing > 0 && missing < values.len() / 10,
        "{missing} of {}",
        values.len()
    );
}

#[test]
fn impossible_places_are_refused() {
    let refused = |x: &[f64], y: &[f64]| SurfaceMap::new(x, y).unwrap_err();
    assert_eq!(refused(&[], &[1.0]), SurfaceError::NoNodes { axis: Axis::X });
    assert_eq!(
        refused(&[1.0], &[2.0, 3.0, 2.0]),
        SurfaceError::Duplicate {
            axis: Axis::Y,
            first: 0,
            second: 2,
            value_mm: 2.0
        }
    );
    assert!(matches!(
        refused(&[f64::NAN], &[1.0]),
        SurfaceError::NotFinite {
            axis: Axis::X,
            index: 0,
            ..
        }
    ));
    assert_eq!(
        refused(&[0.0], &[f64::INFINITY]).to_string(),
        "y coordinate 0 is inf mm; every node needs a finite place"
    );
}
