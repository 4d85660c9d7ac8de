//! Figures of decoupled nodes beside the actual ones.

use glam::DVec3;
use ndarray::Array2;

use super::{
    axis::{PlotAxis, TickRule},
    look::{Hue, Key, LineStyle, Look, Marker},
    plot::{LineAt, Plot, PlotPoint, ReferenceLine, Series},
    plot_figure::PlotFigure,
};
use crate::{
    dataset::Dataset,
    evaluation::{Channel, NodeAddress, format::format_number},
};

/// Largest number of nodes looked at in a figure; of a larger test set, evenly spaced ones.
const MOST_PAIRS: usize = 20_000;
const BINS: usize = 41;

/// Every so many nodes of a test set are looked at.
fn stride(test: &Dataset) -> usize {
    (test.targets().len() / 3).div_ceil(MOST_PAIRS).max(1)
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

/// Bins of a histogram of errors of z, symmetric about 0: as many on either side of the middle one, which holds no error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorBins {
    width_mm: f64,
}

impl ErrorBins {
    /// Returns the bins that hold all finite errors of these pairs of actual and decoupled z.
    pub fn new(pairs_mm: &[(f64, f64)]) -> Self {
        let errors = pairs_mm.iter().map(|(actual, decoupled)| (decoupled - actual).abs());
        let largest = errors.filter(|error| error.is_finite()).fold(1e-12, f64::max);
        Self {
            width_mm: largest / (BINS / 2) as f64,
        }
    }

    /// Number of bins.
    pub const COUNT: usize = BINS;

    /// Returns the bin of an error; `None` if it is not a number or beyond them.
    pub fn bin(&self, error_mm: f64) -> Option<usize> {
        let bin = (error_mm / self.width_mm).round() + (BINS / 2) as f64;
        (0.0..BINS as f64).contains(&bin).then_some(bin as usize)
    }

    /// Returns the errors that a bin holds, in millimetres.
    pub fn range_mm(&self, bin: usize) -> [f64; 2] {
        [-0.5, 0.5].map(|half| self.width_mm * (bin as f64 - (BINS / 2) as f64 + half))
    }

    /// Returns the pairs in a bin, those with the largest error first.
    pub fn pairs_in(&self, bin: usize, pairs_mm: &[(f64, f64)]) -> Vec<usize> {
        let error = |pair: usize| pairs_mm[pair].1 - pairs_mm[pair].0;
        let mut found: Vec<usize> = (0..pairs_mm.len())
            .filter(|&pair| self.bin(error(pair)) == Some(bin))
            .collect();
        found.sort_by(|&one, &other| error(other).abs().total_cmp(&error(one).abs()));
        found
    }

    fn counts(&self, pairs_mm: &[(f64, f64)]) -> [usize; BINS] {
        let mut counts = [0; BINS];
        let bins = pairs_mm
            .iter()
            .filter_map(|(actual, decoupled)| self.bin(decoupled - actual));
        bins.for_each(|bin| counts[bin] += 1);
        counts
    }
}

/// Distribution of the errors of z (decoupled − actual), in [`ErrorBins`]; the bar `chosen` stands out.
pub fn error_histogram_figure(pairs_mm: &[(f64, f64)], chosen: Option<usize>) -> PlotFigure {
    histogram(
        pairs_mm,
        chosen,
        "nodes",
        "error of z (mm), decoupled − actual".to_owned(),
    )
}

/// Distribution of the errors of a target (decoded − actual) in pairs of actual and decoded values, in [`ErrorBins`]; the
/// bar `chosen` stands out.
pub fn target_error_histogram_figure(pairs: &[(f64, f64)], target: &Channel, chosen: Option<usize>) -> PlotFigure {
    let title = format!("error of {}, decoded − actual", target.title());
    histogram(pairs, chosen, "samples", title)
}

/// Histogram of the errors of pairs, which are `items` of the test set.
fn histogram(pairs: &[(f64, f64)], chosen: Option<usize>, items: &str, title: String) -> PlotFigure {
    let bins = ErrorBins::new(pairs);
    let counts = bins.counts(pairs);
    let bars = |name: &str, hue: Hue, is_shown: &dyn Fn(usize) -> bool| Series {
        bar_width: Some(0.92 * bins.width_mm),
        points: (0..BINS)
            .filter(|&bin| is_shown(bin))
            .map(|bin| PlotPoint {
                item: Some(bin),
                ..PlotPoint::from([bins.width_mm * (bin as f64 - (BINS / 2) as f64), counts[bin] as f64])
            })
            .collect(),
        ..Series::new(name, Look::area(hue), [])
    };
    let mut series = vec![bars(items, Hue::Blue, &|bin| Some(bin) != chosen)];
    if let Some(chosen) = chosen {
        series.push(bars(&format!("chosen {items}"), Hue::Orange, &|bin| bin == chosen));
    }
    let plot = Plot::new(
        PlotAxis::linear(title),
        PlotAxis::linear(format!("{items} of the test set")).including([0.0]),
        series,
    );
    let no_error = ReferenceLine::new("no error", LineAt::X(0.0), Hue::Grey, LineStyle::Dashed);
    PlotFigure {
        keys: vec![Key::new("no error", Look::line(no_error.hue, no_error.style))],
        plots: vec![Plot {
            lines: vec![no_error],
            ..plot
        }],
        notes: Vec::new(),
    }
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
    fn every_finite_error_is_counted_once_and_zero_stands_in_the_middle() {
        let pairs = [0.0, 0.0, 1.0, -1.0, 0.5, f64::NAN].map(|error| (4.0, 4.0 + error));
        let bins = ErrorBins::new(&pairs);
        let counts = bins.counts(&pairs);
        assert_eq!(counts.iter().sum::<usize>(), 5);
        assert_eq!((counts[0], counts[BINS / 2], counts[BINS - 1]), (1, 2, 1));
        assert!((bins.width_mm - 0.05).abs() < 1e-15);
        assert_eq!(ErrorBins::new(&[]).counts(&[]), [0; BINS]);
        assert_eq!(ErrorBins::new(&[(4.0, 4.0); 3]).counts(&[(4.0, 4.0); 3])[BINS / 2], 3);
    }

    #[test]
    fn a_bar_holds_the_nodes_whose_errors_it_spans() {
        let pairs: Vec<(f64, f64)> = (0..200).map(|i| (4.0, 4.0 + (f64::from(i) * 0.731).sin())).collect();
        let bins = ErrorBins::new(&pairs);
        let mut held = 0;
        for bin in 0..ErrorBins::COUNT {
            let [low, high] = bins.range_mm(bin);
            let found = bins.pairs_in(bin, &pairs);
            held += found.len();
            let errors: Vec<f64> = found.iter().map(|&pair| pairs[pair].1 - pairs[pair].0).collect();
            assert!(
                errors.iter().all(|error| (low..=high).contains(error)),
                "{low} to {high}: {errors:?}"
            );
            assert!(
                errors.windows(2).all(|pair| pair[0].abs() >= pair[1].abs()),
                "{errors:?}"
            );
        }
        assert_eq!(held, pairs.len());
        let figure = error_histogram_figure(&pairs, Some(3));
        let bars = figure.plots[0]
            .series
            .iter()
            .map(|series| series.points.len())
            .collect::<Vec<_>>();
        assert_eq!(bars, [ErrorBins::COUNT - 1, 1]);
    }

    #[test]
    fn a_pair_leads_back_to_its_node() {
        use crate::{
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
