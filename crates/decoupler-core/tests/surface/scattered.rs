//! Surfaces through nodes that do not form a lattice, against an independent implementation and at the extremes.

use decoupler_core::surface::{SurfaceError, SurfaceMap};

const THIN_PLATE: &str = "thin-plate spline (the biharmonic spline with a plane)";

#[derive(serde::Deserialize)]
struct Case {
    name: String,
    places_mm: Vec<[f64; 2]>,
    node_values: Vec<f64>,
    points_mm: Vec<[f64; 2]>,
    surface: Vec<f64>,
}

fn hexagonal(rows: i32, pitch_mm: f64) -> Vec<[f64; 2]> {
    let row = |y: i32| {
        (0..8).map(move |x| {
            [
                pitch_mm * (f64::from(x) + 0.5 * f64::from(y % 2)),
                pitch_mm * 0.75_f64.sqrt() * f64::from(y),
            ]
        })
    };
    (0..rows).flat_map(row).collect()
}

/// Returns the index of the grid point nearest to a place, and its distance.
fn nearest(map: &SurfaceMap, [x_mm, y_mm]: [f64; 2]) -> (usize, f64) {
    let near = |points: &[f64], at: f64| {
        let distances = points.iter().map(|point| (point - at).abs()).enumerate();
        distances.min_by(|one, other| one.1.total_cmp(&other.1)).unwrap()
    };
    let ((ix, dx), (iy, dy)) = (near(map.grid().x_mm(), x_mm), near(map.grid().y_mm(), y_mm));
    (map.grid().index(ix, iy), dx.hypot(dy))
}

#[test]
fn agrees_with_splines_of_fifty_digits() {
    let cases: Vec<Case> = serde_json::from_str(include_str!("../fixtures/thin_plate_scattered.json")).unwrap();
    for case in cases {
        let map = SurfaceMap::scattered(&case.places_mm).unwrap();
        assert_eq!(map.interpolation(), THIN_PLATE);
        let values = map.evaluate(&case.node_values);
        let mut compared = 0;
        for (&point, &expected) in case.points_mm.iter().zip(&case.surface) {
            let (index, off_mm) = nearest(&map, point);
            assert!(off_mm < 1e-9, "{} at {point:?}", case.name);
            if !values[index].is_nan() {
                let error = (values[index] - expected).abs();
                assert!(error < 1e-11, "{} at {point:?}: {error:e}", case.name);
                compared += 1;
            }
        }
        assert!(compared >= 20, "{}: {compared}", case.name);
    }
}

#[test]
fn planes_are_reproduced_in_every_unit_and_from_every_origin() {
    for (unit, origin) in [(1.0, 0.0), (1e-6, 0.0), (1e9, 0.0), (1.0, 1e5)] {
        let places = Vec::from_iter(hexagonal(6, unit).iter().map(|[x, y]| [x + origin, y - origin]));
        let map = SurfaceMap::scattered(&places).unwrap();
        let plane = |[x, y]: [f64; 2]| 1.0 + (0.3 * (x - origin) - 0.2 * (y + origin)) / unit;
        let values = map.evaluate(&Vec::from_iter(places.iter().map(|&place| plane(place))));
        let grid = map.grid();
        let mut drawn = 0;
        for (ix, &x) in grid.x_mm().iter().enumerate() {
            for (iy, &y) in grid.y_mm().iter().enumerate() {
                let value = values[grid.index(ix, iy)];
                assert!(
                    value.is_nan() || (value - plane([x, y])).abs() < 1e-9 + 1e-15 * origin,
                    "{x} {y}"
                );
                drawn += usize::from(value.is_finite());
            }
        }
        assert!(drawn > values.len() * 9 / 10, "{drawn} of {}", values.len());
    }
}

#[test]
fn the_surface_ends_half_a_pitch_beyond_the_hull_and_far_from_every_node() {
    // A ring of radius 10 with a node every 30°, whose neighbours are 5.18 apart.
    let at = |radius: f64, degrees: f64| [radius * degrees.to_radians().cos(), radius * degrees.to_radians().sin()];
    let ring = Vec::from_iter((0..12).map(|node| at(10.0, 30.0 * f64::from(node))));
    let map = SurfaceMap::scattered(&ring).unwrap();
    let values = map.evaluate(&[3.0; 12]);
    let is_drawn = |place| values[nearest(&map, place).0] == 3.0;
    for degrees in (0..360).step_by(15).map(f64::from) {
        for (radius, drawn) in [(1.0, false), (4.0, true), (9.0, true), (12.0, true), (13.2, false)] {
            assert_eq!(is_drawn(at(radius, degrees)), drawn, "{radius} at {degrees}°");
        }
    }
    assert!(
        values.iter().all(|value| value.is_nan() || *value == 3.0),
        "level through equal nodes"
    );

    let hexagonal = hexagonal(5, 2.0);
    let map = SurfaceMap::scattered(&hexagonal).unwrap();
    let values = map.evaluate(&vec![1.0; hexagonal.len()]);
    let inside = map
        .grid()
        .inside_x()
        .flat_map(|ix| map.grid().inside_y().map(move |iy| (ix, iy)));
    let gaps = inside
        .filter(|&(ix, iy)| values[map.grid().index(ix, iy)].is_nan())
        .count();
    assert_eq!(gaps, 0, "the notches along the sides of a hexagonal skin are filled");
}

#[test]
fn nodes_without_a_surface_are_refused() {
    let refused = |places: &[[f64; 2]]| SurfaceMap::scattered(places).unwrap_err();
    assert!(matches!(refused(&[]), SurfaceError::NoNodes { .. }));
    assert!(matches!(
        refused(&[[0.0, 1.0], [f64::NAN, 0.0]]),
        SurfaceError::NotFinite { index: 1, .. }
    ));
    assert_eq!(refused(&[[1.0, 2.0]]), SurfaceError::OnOneLine);
    assert_eq!(refused(&[[0.0, 0.0], [1.0, 2.0]]), SurfaceError::OnOneLine);
    assert_eq!(
        refused(&[[0.0, 0.0], [1.0, 2.0], [3.0, 6.0 + 1e-9]]),
        SurfaceError::OnOneLine
    );
    assert_eq!(
        refused(&[[0.0, 0.0], [1.0, 2.0], [3.0, 1.0], [1.0, 2.0]]),
        SurfaceError::SamePlace { first: 1, second: 3 }
    );
    let mut near = hexagonal(4, 1.0);
    near.push([1.0, 1e-9]);
    assert_eq!(refused(&near), SurfaceError::Uneven);
    assert_eq!(
        refused(&hexagonal(126, 1.0)),
        SurfaceError::TooMany {
            count: 1008,
            most: 1000
        }
    );
    for scale in [f64::MAX, 1e300, 1e200, 1e-200, 1e-300, 5e-324] {
        match SurfaceMap::scattered(&hexagonal(4, scale)) {
            Ok(map) => {
                let values = map.evaluate(&Vec::from_iter((0..32).map(|node| f64::from(node % 5))));
                assert!(
                    values.iter().all(|value| value.is_nan() || value.abs() < 100.0),
                    "{scale:e}"
                );
                assert!(values.iter().any(|value| value.is_finite()), "{scale:e}");
                for axis in [map.grid().x_mm(), map.grid().y_mm()] {
                    assert!(axis.windows(2).all(|pair| pair[0] < pair[1]), "{scale:e}");
                }
            }
            Err(error) => assert!(error.to_string().len() < 200, "{error}"),
        }
    }
}

#[test]
fn a_thousand_nodes_are_drawn_and_a_missing_value_leaves_no_surface() {
    let places = hexagonal(125, 1.0);
    let map = SurfaceMap::scattered(&places).unwrap();
    let mut values = Vec::from_iter(places.iter().map(|[x, y]| 0.1 * x + 0.01 * y));
    assert!(map.evaluate(&values).iter().any(|value| value.is_finite()));
    values[500] = f64::NAN;
    assert!(map.evaluate(&values).iter().all(|value| value.is_nan()));
}
