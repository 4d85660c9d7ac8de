//! Surfaces through targets that have positions on the skin.

use std::{ops::RangeInclusive, sync::Arc};

use glam::DVec3;

use super::{
    SequentialMap,
    surface::{Quantity, Surface, ViewMode},
};
use decoupler_core::{
    evaluation::{Channel, TargetPosition},
    surface::{SurfaceError, SurfaceMap},
};

/// Targets that have positions, and the surface through them.
#[derive(Clone, Debug)]
pub struct TargetSurface {
    map: Arc<SurfaceMap>,
    /// The targets at the nodes, in the order of the map.
    nodes: Vec<TargetPosition>,
    unit: Option<Arc<str>>,
}

impl TargetSurface {
    /// Prepares the surface through the targets with these positions: that of a lattice if they are one, else that of
    /// scattered nodes.
    ///
    /// # Errors
    /// [`SurfaceError`] if no surface goes through them: see [`SurfaceMap::scattered`].
    pub fn new(positions: &[TargetPosition], targets: &[Channel]) -> Result<Self, SurfaceError> {
        let first = positions.first().and_then(|first| targets.get(first.target));
        let (map, nodes) = match TargetPosition::lattice(positions) {
            Some(lattice) => (
                SurfaceMap::new(lattice.x_mm(), lattice.y_mm())?,
                lattice.places().iter().map(|&place| positions[place]).collect(),
            ),
            None => (
                SurfaceMap::scattered(&TargetPosition::places_mm(positions))?,
                positions.to_vec(),
            ),
        };
        Ok(Self {
            map: Arc::new(map),
            nodes,
            unit: first.and_then(|first| first.unit.as_deref()).map(Arc::from),
        })
    }

    /// The targets at the nodes, in the order of [`Surface::nodes`].
    pub fn nodes(&self) -> &[TargetPosition] {
        &self.nodes
    }

    /// Surfaces of a sample: the actual values, the decoded ones, and decoded minus actual. `actual` and `decoded` have an
    /// entry for each target, `range` is that of the values.
    pub fn surfaces(&self, actual: &[f64], decoded: &[f64], range: RangeInclusive<f64>) -> [Surface; 3] {
        let errors = Vec::from_iter(decoded.iter().zip(actual).map(|(decoded, actual)| decoded - actual));
        let largest = self
            .values(&errors)
            .map(f64::abs)
            .filter(|error| error.is_finite())
            .fold(0.0, f64::max);
        // Rounding has no colour of its own.
        let largest = largest.max(1e-9 * (range.end() - range.start()));
        let (value, error) = (
            Quantity::Target(self.unit.clone()),
            Quantity::TargetError(self.unit.clone()),
        );
        [
            self.surface("Actual", actual, value.clone(), range.clone()),
            self.surface("Decoded", decoded, value, range),
            self.surface("Error", &errors, error, -largest..=largest),
        ]
    }

    /// Range of the targets at the nodes, of which `ranges` are the least and largest values.
    pub fn range_of(&self, ranges: &[(f64, f64)]) -> RangeInclusive<f64> {
        let of_nodes = || self.nodes.iter().map(|node| ranges[node.target]);
        let low = of_nodes().map(|(low, _)| low).fold(f64::INFINITY, f64::min);
        low..=of_nodes().map(|(_, high)| high).fold(f64::NEG_INFINITY, f64::max)
    }

    /// The values at the nodes, of `of_targets` with one for each target.
    fn values(&self, of_targets: &[f64]) -> impl Iterator<Item = f64> {
        self.nodes.iter().map(|node| of_targets[node.target])
    }

    fn surface(&self, title: &str, of_targets: &[f64], quantity: Quantity, range: RangeInclusive<f64>) -> Surface {
        let values = Vec::from_iter(self.values(of_targets));
        let nodes = self.nodes.iter().zip(&values);
        Surface {
            title: title.to_owned(),
            map: Arc::clone(&self.map),
            values: self.map.evaluate(&values).into(),
            nodes: nodes
                .map(|(node, &value)| DVec3::new(node.x_mm, node.y_mm, value))
                .collect(),
            quantity,
            range,
            mode: ViewMode::default(),
            colours: SequentialMap::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2 × 3 targets with others between them, in an order of their own, and a plane over the skin.
    fn plane() -> (TargetSurface, Vec<f64>) {
        let channel = |unit: &str| Channel {
            name: String::new(),
            unit: Some(unit.to_owned()),
        };
        let targets = Vec::from_iter((0..8).map(|target| channel(if target == 3 { "°C" } else { "N" })));
        let places = [
            (7, 0.0, 5.0),
            (0, 2.0, 0.0),
            (6, 2.0, 10.0),
            (1, 0.0, 0.0),
            (4, 2.0, 5.0),
            (2, 0.0, 10.0),
        ];
        let positions = places.map(|(target, x_mm, y_mm)| TargetPosition { target, x_mm, y_mm });
        let mut values = vec![f64::NAN; 8];
        for position in &positions {
            values[position.target] = 1.0 + 0.5 * position.x_mm - 0.2 * position.y_mm;
        }
        (TargetSurface::new(&positions, &targets).unwrap(), values)
    }

    #[test]
    fn a_plane_over_the_skin_is_drawn_as_that_plane() {
        let (surface, actual) = plane();
        let decoded = Vec::from_iter(actual.iter().map(|value| value + 0.25));
        let [actual, decoded, error] = surface.surfaces(&actual, &decoded, -1.0..=2.0);
        let grid = actual.map.grid();
        for (ix, x) in grid.x_mm().iter().enumerate() {
            for (iy, y) in grid.y_mm().iter().enumerate() {
                let (at, expected) = (grid.index(ix, iy), 1.0 + 0.5 * x - 0.2 * y);
                assert!((actual.values[at] - expected).abs() < 1e-9, "{x} {y}");
                assert!((decoded.values[at] - expected - 0.25).abs() < 1e-9, "{x} {y}");
                assert!((error.values[at] - 0.25).abs() < 1e-9, "{x} {y}");
            }
        }
        for (node, place) in actual.nodes.iter().zip(surface.nodes()) {
            assert_eq!((node.x, node.y), (place.x_mm, place.y_mm));
            assert!((node.z - (1.0 + 0.5 * node.x - 0.2 * node.y)).abs() < 1e-12);
        }
        assert_eq!((error.range, actual.range), (-0.25..=0.25, -1.0..=2.0));
        assert_eq!(actual.quantity.axis_name(), "value (N)");
        assert_eq!(error.quantity.axis_name(), "error (N)");
    }

    #[test]
    fn the_range_is_that_of_the_targets_with_positions() {
        let (surface, _) = plane();
        let mut ranges = vec![(-1.0, 1.0); 8];
        (ranges[3], ranges[6], ranges[0]) = ((-100.0, 100.0), (-3.0, 0.0), (0.0, 2.0));
        assert_eq!(surface.range_of(&ranges), -3.0..=2.0);
    }
}
