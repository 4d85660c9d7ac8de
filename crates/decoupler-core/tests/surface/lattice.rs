//! Surfaces through the nodes, against an independent implementation and at the extremes.

use decoupler_core::surface::{Grid, SurfaceError, SurfaceMap};

const THIN_PLATE: &str = "thin-plate spline (the biharmonic spline with a plane)";

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
    serde_json::from_str(include_str!("../fixtures/thin_plate.json")).unwrap()
}

fn lattice(count: usize, pitch_mm: f64) -> Vec<f64> {
    (0..count).map(|i| 8.0 + pitch_mm * i as f64).collect()
}

fn heights(count: usize) -> Vec<f64> {
    (0..count).map(|i| 4.5 + 0.5 * (1.7 * i as f64).sin()).collect()
}

/// Returns the surface at a place by bilinear interpolation of the grid's values; exact at grid points.
fn at(grid: &Grid, values: &[f64], (x_mm, y_mm): (f64, f64)) -> Option<f64> {
    let ix = grid.x_mm().iter().position(|x| (x - x_mm).abs() < 1e-9)?;
    let iy = grid.y_mm().iter().position(|y| (y - y_mm).abs() < 1e-9)?;
    Some(values[grid.index(ix, iy)])
}

#[test]
fn agrees_with_splines_of_fifty_digits() {
    for case in cases() {
        let map = SurfaceMap::new(&case.x_mm, &case.y_mm).unwrap();
        let is_line = case.x_mm.len() == 1 || case.y_mm.len() == 1;
        let expected = if is_line { "natural cubic spline" } else { THIN_PLATE };
        assert_eq!(map.interpolation(), expected, "{}", case.name);
        let values = map.evaluate(&case.node_values);
        let mut compared = 0;
        for (&point, &expected) in case.points_mm.iter().zip(&case.surface) {
            if let Some(value) = at(map.grid(), &values, point) {
                assert!(
                    (value - expected).abs() < 1e-12,
                    "{} at {point:?}: {value} is not {expected}",
                    case.name
                );
                compared += 1;
            }
        }
        assert!(
            compared >= if is_line { 3 } else { 16 },
            "{}: only {compared} of the reference points are on the grid",
            case.name
        );
    }
}

/// Asserts that constants and planes are reproduced on the array whose first node is at `origin_mm`.
fn assert_planes_are_kept((rows, per_row): (usize, usize), origin_mm: f64, unit_mm: f64) {
    let place = |index: usize, pitch: f64| origin_mm + pitch * unit_mm * index as f64;
    let x_mm: Vec<f64> = (0..rows).map(|row| place(row, 1.0)).collect();
    let y_mm: Vec<f64> = (0..per_row).map(|node| place(node, 2.0)).collect();
    let map = SurfaceMap::new(&x_mm, &y_mm).unwrap();
    assert!((rows, per_row) != (40, 40) || map.interpolation() == "bilinear");
    let level = map.evaluate(&vec![5.0; rows * per_row]);
    assert!(level.iter().all(|&value| value == 5.0), "{rows}×{per_row}");

    // Along a line of nodes the surface can only slope in that direction.
    let slope = |count: usize, slope: f64| if count > 1 { slope / unit_mm } else { 0.0 };
    let (slope_x, slope_y) = (slope(rows, -0.3), slope(per_row, 0.2));
    let plane = |x_mm: &[f64], y_mm: &[f64]| -> Vec<f64> {
        let height = |x: f64, y: f64| 5.0 + slope_x * (x - origin_mm) + slope_y * (y - origin_mm);
        let lines = x_mm.iter().map(|&x| y_mm.iter().map(move |&y| height(x, y)));
        lines.flatten().collect()
    };
    let values = map.evaluate(&plane(&x_mm, &y_mm));
    let expected = plane(map.grid().x_mm(), map.grid().y_mm());
    let off = values
        .iter()
        .zip(&expected)
        .map(|(value, expected)| (value - expected).abs());
    let off = off.fold(0.0, f64::max);
    assert!(
        off < 1e-9,
        "{rows}×{per_row} in {unit_mm} mm from {origin_mm} mm: off by {off:e}"
    );
}

#[test]
fn constants_and_planes_are_reproduced_on_every_array_in_every_unit_and_from_every_origin() {
    let small = (1..=5).flat_map(|rows| (1..=5).map(move |per_row| (rows, per_row)));
    let lines = [10, 32, 200].into_iter().flat_map(|count| [(1, count), (count, 1)]);
    let large = [
        (10, 6),
        (10, 8),
        (10, 10),
        (2, 32),
        (32, 3),
        (32, 31),
        (32, 32),
        (40, 40),
    ];
    for array in small.chain(lines).chain(large) {
        assert_planes_are_kept(array, 8.0, 1.0);
    }
    for array in [(1, 1), (1, 4), (3, 1), (2, 2), (3, 2), (10, 10), (40, 40)] {
        for (origin_mm, unit_mm) in [(0.0, 1e-6), (-3e3, 1e6), (1e6, 1.0), (-1e5, 1e-2)] {
            assert_planes_are_kept(array, origin_mm, unit_mm);
        }
    }
}

#[test]
fn far_from_a_press_the_surface_stays_level() {
    let (x_mm, y_mm) = (lattice(10, 1.0), lattice(10, 2.0));
    let map = SurfaceMap::new(&x_mm, &y_mm).unwrap();
    let mut nodes = vec![5.0; 100];
    nodes[22] = 4.9;
    let values = map.evaluate(&nodes);
    for (ix, &x) in map.grid().x_mm().iter().enumerate() {
        for (iy, &y) in map.grid().y_mm().iter().enumerate() {
            // Four pitches of the coarser axis from the press.
            if (x - x_mm[2]).hypot(y - y_mm[2]) > 8.0 {
                let off = values[map.grid().index(ix, iy)] - 5.0;
                assert!(off.abs() < 1e-3, "{off} mm at ({x}, {y})");
            }
        }
    }
}

/// The natural cubic spline through (0, 0), (1, 1), (2, 0) by hand: (3x − x³)/2 up to the middle.
#[test]
fn a_single_row_is_a_cubic_curve_constant_across() {
    let cubic = |x: f64| if x < 0.0 { 1.5 * x } else { 1.5 * x - 0.5 * x.powi(3) };
    let along_x = SurfaceMap::new(&[0.0, 1.0, 2.0], &[7.0]).unwrap();
    let along_y = SurfaceMap::new(&[7.0], &[2.0, 0.0, 1.0]).unwrap();
    for (map, nodes) in [(along_x, [0.0, 1.0, 0.0]), (along_y, [0.0, 0.0, 1.0])] {
        let (grid, values) = (map.grid(), map.evaluate(&nodes));
        let is_along_x = grid.x_mm().len() > grid.y_mm().len();
        for (ix, &x) in grid.x_mm().iter().enumerate() {
            for (iy, &y) in grid.y_mm().iter().enumerate() {
                let along = if is_along_x { x } else { y };
                let expected = cubic(1.0 - (along - 1.0).abs());
                let value = values[grid.index(ix, iy)];
                assert!((value - expected).abs() < 1e-14, "{value} at {along}, not {expected}");
            }
        }
    }
}

/// With a factor of a million between neighbouring distances, any smooth curve overshoots by as much.
#[test]
fn nodes_too_uneven_for_a_spline_are_joined_bilinearly() {
    for (x_mm, y_mm) in [
        (vec![0.0, 1e-6, 1.0], vec![0.0, 1.0]),
        (vec![0.0, 1e-6, 1.0], vec![0.0]),
        (vec![0.0], vec![0.0, 1e-6, 1.0]),
        ((0..10).map(|row| 1e-9 * f64::from(row)).collect(), vec![0.0, 1.0, 2.0]),
    ] {
        let map = SurfaceMap::new(&x_mm, &y_mm).unwrap();
        assert_eq!(map.interpolation(), "bilinear");
        let values = map.evaluate(&heights(x_mm.len() * y_mm.len()));
        let inside = map
            .grid()
            .inside_x()
            .flat_map(|ix| map.grid().inside_y().map(move |iy| (ix, iy)));
        for (ix, iy) in inside {
            let is_line = x_mm.len() == 1 || y_mm.len() == 1;
            let value = values[map.grid().index(ix, iy)];
            assert!((4.0..=5.0).contains(&value) || is_line && value.is_finite(), "{value}");
        }
    }
}

#[test]
fn coordinates_of_any_magnitude_are_drawn_or_refused() {
    for scale in [f64::MAX, 1e307, 1e200, 1e12, 1e-12, 1e-200, 1e-307, 5e-324] {
        for (x, y) in [(1, 1), (1, 4), (4, 1), (3, 3)] {
            let lattice = |count: i32| -> Vec<f64> { (0..count).map(|i| scale * f64::from(i - 1)).collect() };
            match SurfaceMap::new(&lattice(x), &lattice(y)) {
                Ok(map) => {
                    let values = map.evaluate(&heights((x * y) as usize));
                    assert!(values.iter().all(|value| value.is_finite()), "{x}×{y} at {scale:e}");
                    for axis in [map.grid().x_mm(), map.grid().y_mm()] {
                        assert!(axis.windows(2).all(|pair| pair[0] < pair[1]), "{scale:e}: {axis:?}");
                    }
                }
                Err(error) => assert!(error.to_string().len() < 200, "{error}"),
            }
        }
    }
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
    let mut node_values = vec![5.0; 100];
    node_values[45] = f64::NAN;
    let values = map.evaluate(&node_values);
    let missing = values.iter().filter(|value| value.is_nan()).count();
    assert!(
        missing > 0 && missing < values.len() / 10,
        "{missing} of {}",
        values.len()
    );
    assert!(values.iter().all(|value| value.is_nan() || (value - 5.0).abs() < 1e-6));
}

#[test]
fn invalid_places_are_refused() {
    let refused = |x: &[f64], y: &[f64]| SurfaceMap::new(x, y).unwrap_err();
    assert_eq!(refused(&[], &[1.0]), SurfaceError::NoNodes { axis: "x" });
    assert_eq!(
        refused(&[1.0], &[2.0, 3.0, 2.0]),
        SurfaceError::Duplicate {
            axis: "y",
            first: 0,
            second: 2,
            value_mm: 2.0
        }
    );
    assert!(matches!(
        refused(&[f64::NAN], &[1.0]),
        SurfaceError::NotFinite {
            axis: "x",
            index: 0,
            ..
        }
    ));
    assert_eq!(
        refused(&[0.0], &[f64::INFINITY]).to_string(),
        "y coordinate 0 is inf mm; nodes need finite coordinates within ±1e300 mm"
    );
}
