//! Splines through lattices of nodes with arbitrary distances, heights, units and origins.

use std::sync::Arc;

use decoupler_core::surface::SurfaceMap;
use proptest::prelude::*;

use crate::cases;

/// A lattice whose smallest distances are about 1 mm, and heights between 4 and 5 mm.
#[derive(Clone, Debug)]
struct Lattice {
    x_mm: Vec<f64>,
    y_mm: Vec<f64>,
    heights_mm: Vec<f64>,
}

impl Lattice {
    fn map(&self) -> SurfaceMap {
        SurfaceMap::new(&self.x_mm, &self.y_mm).unwrap()
    }

    /// The same nodes at other positions.
    fn moved(&self, place: impl Fn(f64) -> f64) -> Self {
        Self {
            x_mm: self.x_mm.iter().map(|&x| place(x)).collect(),
            y_mm: self.y_mm.iter().map(|&y| place(y)).collect(),
            heights_mm: self.heights_mm.clone(),
        }
    }

    fn surface(&self) -> Vec<f64> {
        self.map().evaluate(&self.heights_mm)
    }
}

/// Coordinates along one axis, not evenly spaced.
fn axis() -> impl Strategy<Value = Vec<f64>> {
    let distances = prop::collection::vec(1.0..3.0_f64, 0..5);
    (distances, -20.0..20.0_f64).prop_map(|(distances, first)| {
        let mut places = vec![first];
        for distance in distances {
            places.push(places[places.len() - 1] + distance);
        }
        places
    })
}

fn lattices() -> impl Strategy<Value = Lattice> {
    (axis(), axis()).prop_flat_map(|(x_mm, y_mm)| {
        let heights = prop::collection::vec(4.0..5.0_f64, x_mm.len() * y_mm.len());
        heights.prop_map(move |heights_mm| Lattice {
            x_mm: x_mm.clone(),
            y_mm: y_mm.clone(),
            heights_mm,
        })
    })
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(cases(32))]

    #[test]
    fn the_surface_passes_through_every_node(lattice in lattices()) {
        let (map, values) = (lattice.map(), lattice.surface());
        prop_assert_ne!(map.interpolation(), "bilinear");
        let place = |axis: &[f64], at: f64| axis.iter().position(|&point| point == at).unwrap();
        let nodes = lattice.x_mm.iter().flat_map(|&x| lattice.y_mm.iter().map(move |&y| (x, y)));
        for ((x, y), &height_mm) in nodes.zip(&lattice.heights_mm) {
            let point = map.grid().index(place(map.grid().x_mm(), x), place(map.grid().y_mm(), y));
            prop_assert_eq!(values[point], height_mm);
        }
    }

    #[test]
    fn planes_are_reproduced(lattice in lattices(), slopes in (-1.0..1.0_f64, -1.0..1.0_f64)) {
        let slope = |count: usize, slope: f64| if count > 1 { slope } else { 0.0 };
        let (slope_x, slope_y) = (slope(lattice.x_mm.len(), slopes.0), slope(lattice.y_mm.len(), slopes.1));
        let plane = |x: f64, y: f64| 5.0 + slope_x * x + slope_y * y;
        let map = lattice.map();
        let on = |x_mm: &[f64], y_mm: &[f64]| -> Vec<f64> {
            x_mm.iter().flat_map(|&x| y_mm.iter().map(move |&y| plane(x, y))).collect()
        };
        let values = map.evaluate(&on(&lattice.x_mm, &lattice.y_mm));
        let off = largest_difference(&values, &on(map.grid().x_mm(), map.grid().y_mm()));
        prop_assert!(off < 1e-11, "{off:e}");
    }

    #[test]
    fn the_unit_of_length_does_not_matter(lattice in lattices(), exponent in -6.0..6.0_f64) {
        let unit = 10_f64.powf(exponent);
        let off = largest_difference(&lattice.surface(), &lattice.moved(|place| unit * place).surface());
        prop_assert!(off < 1e-10, "{off:e}");
    }

    /// The origin costs as many digits as the coordinates lose.
    #[test]
    fn the_origin_does_not_matter(lattice in lattices(), origin in -1e4..1e4_f64) {
        let off = largest_difference(&lattice.surface(), &lattice.moved(|place| place + origin).surface());
        prop_assert!(off < 1e-9, "{off:e}");
    }

    #[test]
    fn the_order_of_the_wires_does_not_matter(
        (lattice, rows, nodes) in lattices().prop_flat_map(|lattice| {
            let order = |count: usize| Just(Vec::from_iter(0..count)).prop_shuffle();
            let (rows, nodes) = (order(lattice.x_mm.len()), order(lattice.y_mm.len()));
            (Just(lattice), rows, nodes)
        })
    ) {
        let per_row = lattice.y_mm.len();
        let shuffled = Lattice {
            x_mm: rows.iter().map(|&row| lattice.x_mm[row]).collect(),
            y_mm: nodes.iter().map(|&node| lattice.y_mm[node]).collect(),
            heights_mm: rows
                .iter()
                .flat_map(|&row| nodes.iter().map(move |&node| row * per_row + node))
                .map(|node| lattice.heights_mm[node])
                .collect(),
        };
        let off = largest_difference(&lattice.surface(), &shuffled.surface());
        prop_assert!(off < 1e-11, "{off:e}");
    }

    /// Reflecting the array reflects its surface; raising the array raises its surface.
    #[test]
    fn mirrored_and_raised_arrays_have_mirrored_and_raised_surfaces(lattice in lattices(), raise_mm in -5.0..5.0_f64) {
        let mut mirrored = lattice.moved(|place| -place).surface();
        mirrored.reverse();
        let off = largest_difference(&lattice.surface(), &mirrored);
        prop_assert!(off < 1e-11, "mirrored: {off:e}");
        let mut raised = lattice.clone();
        raised.heights_mm.iter_mut().for_each(|height_mm| *height_mm += raise_mm);
        let expected: Vec<f64> = lattice.surface().iter().map(|height_mm| height_mm + raise_mm).collect();
        let off = largest_difference(&raised.surface(), &expected);
        prop_assert!(off < 1e-11, "raised: {off:e}");
    }
}

#[test]
fn a_lattice_has_one_shared_map_as_long_as_it_is_used() {
    let (x_mm, y_mm) = ([0.0, 1.5, 4.0], [-1.0, 0.25, 3.0, 5.0]);
    let shared = || SurfaceMap::shared(&x_mm, &y_mm).unwrap();
    let first = shared();
    assert!(Arc::ptr_eq(&first, &shared()));
    let transposed = SurfaceMap::shared(&y_mm, &x_mm).unwrap();
    assert!(!Arc::ptr_eq(&first, &transposed));
    let heights_mm = Vec::from_iter((0..12).map(|node| f64::from(node * node % 7)));
    let own = SurfaceMap::new(&x_mm, &y_mm).unwrap();
    assert_eq!(first.evaluate(&heights_mm), own.evaluate(&heights_mm));
    assert!(SurfaceMap::shared(&x_mm, &[]).is_err());
    let used = Arc::downgrade(&first);
    drop(first);
    assert!(used.upgrade().is_none(), "it is no longer used");
}
