//! Figures of decoupled nodes next to the actual ones.

use glam::DVec3;
use ndarray::Array2;

use super::{
    axis::{PlotAxis, TickRule},
    look::{Hue, Key, Look, Marker},
    plot::{Plot, PlotFigure, PlotPoint, Series},
};
use decoupler_core::{dataset::Dataset, evaluation::NodeAddress, text::format_number};

/// Largest number of nodes looked at in a figure; of a larger test set, evenly spaced ones.
const MAX_PAIRS: usize = 20_000;

/// Every this many nodes of a test set are looked at.
fn stride(test: &Dataset) -> usize {
    (test.targets().len() / 3).div_ceil(MAX_PAIRS).max(1)
}

/// Returns actual and decoupled z of the nodes of a test set, in millimetres. `decoupled_mm` has the shape of its
/// targets.
pub fn z_pairs_mm(test: &Dataset, decoupled_mm: &Array2<f64>) -> Vec<(f64, f64)> {
    let actual = test.targets();
    let every_z = actual.iter().zip(decoupled_mm).skip(2).step_by(3);
    every_z
        .step_by(stride(test))
        .map(|(actual, decoupled)| (*actual, *decoupled))
        .collect()
}

/// Returns the node that one of [`z_pairs_mm`] belongs to; `None` beyond the last.
pub fn pair_address(test: &Dataset, pair: usize) -> Option<NodeAddress> {
    let per_sample = test.outputs() / 3;
    let place = pair * stride(test);
    let (sample, node) = (place / per_sample.max(1), place % per_sample.max(1));
    Some(NodeAddress {
        snapshot: *test.groups().get(sample)?,
        row: test.row_wire(sample).unwrap_or(0),
        node,
    })
}

/// The paper's Fig. 6: z of the nodes at these positions, row by row; actual as squares, decoupled as discs, each with a
/// bar of ± `spread_mm` if that is given.
pub fn node_figure(
    actual_mm: &[DVec3],
    decoupled_mm: Option<&[DVec3]>,
    spread_mm: Option<&[f64]>,
    nodes_per_row: usize,
) -> PlotFigure {
    let numbered = |nodes_mm: &[DVec3]| -> Vec<[f64; 2]> {
        let numbered = nodes_mm.iter().enumerate();
        numbered
            .map(|(node, position)| [(node + 1) as f64, position.z])
            .collect()
    };
    let actual = Series::new("actual", Look::marker(Hue::Grey, Marker::Square), numbered(actual_mm));
    let decoupled = decoupled_mm.map(|decoupled_mm| {
        let look = Look::marker(Hue::Blue, Marker::Disc);
        let mut series = Series::new("decoupled", look, numbered(decoupled_mm));
        for (point, spread) in series.points.iter_mut().zip(spread_mm.unwrap_or_default()) {
            point.bar = Some([point.y - spread, point.y + spread]);
        }
        series
    });
    let mut series = vec![actual];
    series.extend(decoupled);
    for series in &mut series {
        for (node, point) in series.points.iter_mut().enumerate() {
            point.note = Some(node_words(&series.name, point, node, nodes_per_row.max(1)));
            point.item = Some(node);
        }
    }
    // A tick at the last node of a row.
    let x = PlotAxis::linear("node, row by row").ticked(TickRule::Every(nodes_per_row.max(1) as f64));
    PlotFigure {
        keys: series
            .iter()
            .map(|series| Key::new(&series.name, series.look))
            .collect(),
        plots: vec![Plot::new(x, PlotAxis::linear("z (mm)"), series)],
        notes: Vec::new(),
    }
}

fn node_words(name: &str, point: &PlotPoint, node: usize, nodes_per_row: usize) -> String {
    let (row, of_row) = (node / nodes_per_row + 1, node % nodes_per_row + 1);
    let mut words = format!("Row {row}, node {of_row}\n{name} z: {} mm", format_number(point.y));
    if let Some([low, high]) = point.bar {
        words += &format!(" ± {} mm", format_number(0.5 * (high - low)));
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_leads_back_to_its_node() {
        use decoupler_core::{
            dataset::{Seed, Stream},
            scene::Scene,
            sensor::SensorModel,
        };
        let sensor = SensorModel::new("10x6_3x18".parse().unwrap());
        let test = Dataset::simulate(&sensor, &Scene::default(), 20, &mut Seed(0).rng(Stream::Test)).unwrap();
        let mut decoupled = test.targets().to_owned();
        // The third node of row-wire 4 in the second snapshot.
        decoupled[[13, 8]] += 0.25;
        let pairs = z_pairs_mm(&test, &decoupled);
        let off = pairs
            .iter()
            .position(|(actual, decoupled)| actual != decoupled)
            .unwrap();
        let expected = NodeAddress {
            snapshot: 1,
            row: 3,
            node: 2,
        };
        assert_eq!(pair_address(&test, off), Some(expected));
        assert_eq!(pair_address(&test, pairs.len()), None);
    }

    #[test]
    fn a_lit_node_has_a_halo_at_each_of_its_points() {
        let nodes = |z_mm: [f64; 3]| z_mm.map(|z| DVec3::new(1.0, 2.0, z));
        let (actual, decoupled) = (nodes([4.0, 4.5, 5.0]), nodes([4.1, 4.4, 5.0]));
        let figure = node_figure(&actual, Some(&decoupled), None, 3).lighting(|item| item == 1, &[]);
        let lit = figure.plots[0].series.last().unwrap();
        assert_eq!(lit.look.marker, Some(Marker::Halo));
        let places: Vec<[f64; 2]> = lit.points.iter().map(|point| [point.x, point.y]).collect();
        assert_eq!(places, [[2.0, 4.5], [2.0, 4.4]]);
    }

    #[test]
    fn a_node_is_named_by_its_row() {
        let nodes = |z_mm: [f64; 3]| z_mm.map(|z| DVec3::new(1.0, 2.0, z));
        let (actual, decoupled) = (nodes([4.0, 4.5, 5.0]), nodes([4.1, 4.4, 5.0]));
        let figure = node_figure(&actual, Some(&decoupled), Some(&[0.1, 0.2, 0.3]), 2);
        let decoupled = &figure.plots[0].series[1];
        assert_eq!(
            decoupled.points[2].note.as_deref(),
            Some("Row 2, node 1\ndecoupled z: 5.00 mm ± 0.300 mm")
        );
        assert_eq!(
            node_figure(&actual, None, None, 1).keys.len(),
            1,
            "nothing decoupled yet"
        );
    }
}
