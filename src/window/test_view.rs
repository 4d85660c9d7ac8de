//! Test set of a run, ready to be drawn.

use std::{ops::RangeInclusive, sync::Arc};

use decoupler_core::{
    dataset::{Dataset, Simulation, SplitBy},
    evaluation::{NodeAddress, Outlook, RunError, RunSettings, node_rms_mm, recorded::HysteresisLoop},
    problem::{Channel, Problem},
    sensor::SensorModel,
    surface::{SurfaceError, SurfaceMap},
};
use decoupler_files::{
    figure::{
        HeatMap, RegressionLine, TargetSurface, position_error_map,
        surface::{Quantity, Surface},
        value_pairs,
    },
    import::SetupError,
};
use glam::DVec3;
use ndarray::{Array2, ArrayView2, Axis, Slice, Zip};
use thiserror::Error;

use super::timeline::Timeline;

/// Test set of a run, ready to be drawn.
#[derive(Clone, Debug)]
pub struct TestView {
    /// Samples.
    pub set: Arc<Dataset>,
    /// Description of the channels.
    pub problem: Arc<Problem>,
    /// The array that is read, if its model is known.
    pub skin: Option<Arc<Skin>>,
    /// Surface through targets that have positions, or why there is none.
    pub through: Option<Result<Arc<TargetSurface>, SurfaceError>>,
    /// Range of the targets with positions.
    range: RangeInclusive<f64>,
    /// Rule of the division, which determines the order of the samples.
    order: SplitBy,
    /// Where the samples are on an axis of time.
    pub timeline: Arc<Timeline>,
}

/// Array of which all drawn row-wires are read in each snapshot, and the surface through its nodes.
#[derive(Debug)]
pub struct Skin {
    /// Interpolation from the heights of nodes to those of the drawn grid.
    pub map: Arc<SurfaceMap>,
    /// Sensor of the samples.
    pub sensor: SensorModel,
    /// Row-wires that are read and drawn, from 0.
    pub rows: Vec<usize>,
    /// Distance that a node can travel.
    pub stroke_mm: f64,
    /// Readings of the sensor at rest, rows read × M4; `None` if they cannot be computed.
    pub unloaded_ohm: Option<Array2<f64>>,
    /// Outlook of the scene; `None` if it takes long or cannot be computed.
    pub outlook: Option<Outlook>,
}

/// Charts of all test samples, computed in the background.
#[derive(Debug)]
pub struct TestCharts {
    /// Regression lines through the actual and decoded values of each target, or of z of all nodes.
    pub lines: Vec<RegressionLine>,
    /// Errors of loading and unloading for each target that rises and falls.
    pub loops: Vec<Option<HysteresisLoop>>,
    /// Error over the position, if two targets are one.
    pub error_map: Option<HeatMap>,
    /// Root mean square error of each node of an array.
    pub spread_mm: Vec<f64>,
}

/// What is drawn of a snapshot of a test set.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// Actual surface.
    pub actual: Surface,
    /// Surface decoded by a network, and its error (decoded − actual).
    pub decoded: Option<[Surface; 2]>,
}

/// Range of heights shown by colours and axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HeightScale {
    /// Always from full compression to rest.
    #[default]
    Stroke,
    /// From the lowest to the highest displayed node.
    Fitted,
}

impl TestView {
    /// Draws the test set of `settings`.
    ///
    /// # Errors
    /// If the sensor, the scene or the number of samples is invalid.
    pub fn draw(settings: &RunSettings) -> Result<Self, TestViewError> {
        let simulation = settings.drawn()?;
        let set = Arc::new(simulation.draw_test(settings.seed)?);
        Ok(Self::new(set, Arc::new(simulation.problem()), SplitBy::Time)?)
    }

    /// Prepares the test samples `set`, whose channels are those of `problem`, in the order of a division by `order`.
    ///
    /// # Errors
    /// If no surface can be interpolated through the nodes of the array.
    pub fn new(set: Arc<Dataset>, problem: Arc<Problem>, order: SplitBy) -> Result<Self, SurfaceError> {
        let skin = problem.sensor.as_ref().map(Skin::new).transpose()?;
        let has_positions = !problem.positions.is_empty();
        let through = has_positions.then(|| TargetSurface::new(&problem.positions, &problem.targets).map(Arc::new));
        let at_positions = problem.positions.iter();
        let at_positions = at_positions.flat_map(|position| set.targets().column(position.target).to_vec());
        let (low, high) = at_positions.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        Ok(Self {
            skin: skin.map(Arc::new),
            through,
            range: low..=high,
            timeline: Arc::new(Timeline::numbered(set.samples())),
            set,
            problem,
            order,
        })
    }

    /// Returns the number of test snapshots: whole frames of an array, or samples of a recording.
    pub fn snapshots(&self) -> usize {
        self.set.samples() / self.skin.as_ref().map_or(1, |skin| skin.rows.len())
    }

    /// Returns the surface through targets with positions, if there is one.
    pub fn through(&self) -> Option<&TargetSurface> {
        self.through.as_ref()?.as_deref().ok()
    }

    /// Returns what is drawn of `snapshot`; `answers` are the outputs of a network for the samples. `None` where no surface
    /// goes through the targets.
    pub fn drawing(&self, answers: Option<&Array2<f64>>, snapshot: usize) -> Option<Drawing> {
        if let Some(skin) = &self.skin {
            return Some(skin.drawing(&self.set, answers, snapshot));
        }
        let through = self.through()?;
        let decoded = answers.map_or(self.set.targets(), |answers| answers.view());
        let [actual, decoded] = [self.set.targets(), decoded].map(|values| values.row(snapshot).to_vec());
        let surfaces = through.surfaces(&actual, &decoded, self.range.clone());
        Some(Drawing::of(surfaces, answers.is_some()))
    }

    /// Computes the charts of these decoded values (samples × targets).
    pub fn charts(&self, answers: &Array2<f64>) -> TestCharts {
        let of_target = |target| RegressionLine::of(value_pairs(&self.set, answers, target).into_iter());
        if self.skin.is_some() {
            return TestCharts {
                lines: vec![of_target(None)],
                loops: Vec::new(),
                error_map: None,
                spread_mm: node_rms_mm(&self.set, answers),
            };
        }
        TestCharts {
            lines: (0..self.set.outputs()).map(|target| of_target(Some(target))).collect(),
            loops: HysteresisLoop::of_test(&self.set, answers.view(), self.order),
            // Targets that have positions are not positions themselves.
            error_map: match self.through {
                None => error_map(&self.set, answers, &self.problem.targets),
                Some(_) => None,
            },
            spread_mm: Vec::new(),
        }
    }
}

impl Skin {
    fn new(simulation: &Simulation) -> Result<Self, SurfaceError> {
        let sensor = simulation.sensor;
        // There is no test set of a row that does not exist.
        let rows = simulation.scene.rows.read(sensor.scale.rows()).unwrap_or_default();
        let (x_mm, y_mm) = sensor.geometry.lattice_mm(sensor.scale, &rows);
        Ok(Self {
            unloaded_ohm: unloaded_ohm(&sensor, &rows),
            map: SurfaceMap::shared(&x_mm, &y_mm)?,
            sensor,
            rows,
            stroke_mm: simulation.stroke_mm(),
            outlook: outlook(simulation),
        })
    }

    /// Returns the index of a node among the drawn nodes, row by row.
    pub fn node(&self, address: NodeAddress) -> Option<usize> {
        let row_index = self.rows.iter().position(|row_wire| *row_wire == address.row)?;
        Some(row_index * self.sensor.scale.nodes_per_row() + address.node)
    }

    /// Returns what is drawn of a snapshot of `set`; `answers` have the shape of its coordinates.
    pub fn drawing(&self, set: &Dataset, answers: Option<&Array2<f64>>, snapshot: usize) -> Drawing {
        let nodes = |coordinates_mm: ArrayView2<'_, f64>| {
            let coordinates = Vec::from_iter(
                coordinates_mm
                    .slice_axis(Axis(0), self.samples(snapshot))
                    .iter()
                    .copied(),
            );
            Vec::from_iter(coordinates.chunks_exact(3).map(DVec3::from_slice))
        };
        let decoded = answers.map_or(set.targets(), |answers| answers.view());
        let nodes = [set.targets(), decoded].map(nodes);
        let height_mm = self.sensor.geometry.height_mm;
        let (heights, quantities) = (
            height_mm - self.stroke_mm..=height_mm,
            [Quantity::Height, Quantity::Error],
        );
        // Errors below a nanometre are not distinguished by colour.
        let surfaces = Surface::compared("Decoded", &self.map, nodes, quantities, heights, 1e-6);
        Drawing::of(surfaces, answers.is_some())
    }

    /// Returns the drops of the readings of a snapshot of `set` below those at rest, in percent, rows read × M4; `None` if there
    /// are no readings at rest.
    pub fn drops_percent(&self, set: &Dataset, snapshot: usize) -> Option<Array2<f64>> {
        let readings = set.readings();
        let readings = readings.slice_axis(Axis(0), self.samples(snapshot));
        let ratios = Zip::from(readings).and(self.unloaded_ohm.as_ref()?);
        Some(ratios.map_collect(|reading, unloaded| 100.0 * (1.0 - reading / unloaded)))
    }

    /// Samples of a snapshot: snapshots follow one another, each with all rows.
    fn samples(&self, snapshot: usize) -> Slice {
        let rows = self.rows.len();
        Slice::from(snapshot * rows..(snapshot + 1) * rows)
    }
}

impl Drawing {
    fn of([actual, decoded, error]: [Surface; 3], is_decoded: bool) -> Self {
        Self {
            actual,
            decoded: is_decoded.then_some([decoded, error]),
        }
    }
}

/// Returns the readings of the sensor at rest, rows read × M4; `None` if they cannot be computed.
fn unloaded_ohm(sensor: &SensorModel, rows: &[usize]) -> Option<Array2<f64>> {
    let at_rest = vec![DVec3::ZERO; sensor.scale.nodes_per_row()];
    let readings = rows.iter().map(|&row| sensor.row_resistances(row, &at_rest));
    let readings = readings.collect::<Result<Vec<_>, _>>().ok()?.concat();
    Array2::from_shape_vec((rows.len(), sensor.scale.columns()), readings).ok()
}

/// Returns the outlook if it can be computed quickly; the arrays of the paper take a millisecond.
fn outlook(simulation: &Simulation) -> Option<Outlook> {
    /// About a third of a second.
    const MAX_PRODUCTS: usize = 500_000_000;
    let scale = simulation.sensor.scale;
    let unknowns = simulation.scene.unknowns_per_row(scale);
    let matrix = unknowns.saturating_mul(scale.columns().max(unknowns));
    let products = matrix.saturating_mul(unknowns).saturating_mul(scale.rows());
    if products > MAX_PRODUCTS {
        return None;
    }
    Outlook::of(simulation).ok()
}

/// Reasons why a test set cannot be drawn.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TestViewError {
    /// The samples cannot be drawn or trained on.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The samples cannot be read or drawn.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// No surface can be interpolated through the nodes.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
}

fn error_map(set: &Dataset, answers: &Array2<f64>, targets: &[Channel]) -> Option<HeatMap> {
    let pair = position_pair(targets)?;
    let [actual, answers] = [set.targets(), answers.view()].map(|values| values.select(Axis(1), &pair));
    let names = pair.map(|target| targets[target].name.as_str());
    position_error_map(actual.view(), answers.view(), names, targets[pair[0]].unit.as_deref())
}

/// Returns two targets that are coordinates in the same unit, for a map: lengths, or targets without units whose names are
/// those of coordinates. Columns without names may be coordinates, too.
fn position_pair(targets: &[Channel]) -> Option<[usize; 2]> {
    const LENGTHS: [&str; 6] = ["m", "cm", "mm", "µm", "um", "nm"];
    let may_be = |channel: &Channel| match &channel.unit {
        None => is_coordinate(&channel.name),
        Some(unit) => LENGTHS.contains(&unit.trim()),
    };
    let candidates = Vec::from_iter((0..targets.len()).filter(|&target| may_be(&targets[target])));
    let pairs = candidates.iter().enumerate();
    let mut pairs = pairs.flat_map(|(place, &one)| candidates[place + 1..].iter().map(move |&other| [one, other]));
    pairs.find(|[one, other]| targets[*one].unit == targets[*other].unit)
}

/// Returns `true` if a full name ends like that of a coordinate, such as `probe_x`, or is that of a column without a header.
fn is_coordinate(name: &str) -> bool {
    let own = name.rsplit('.').next().unwrap_or(name).to_lowercase();
    let has_no_header = own
        .strip_prefix('c')
        .is_some_and(|number| number.parse::<usize>().is_ok());
    let last = own
        .rsplit(|letter: char| !letter.is_alphanumeric())
        .next()
        .unwrap_or_default();
    has_no_header || ["x", "y", "z", "px", "py", "pz"].contains(&last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_needs_two_coordinates_in_one_unit() {
        let pair = |titles: &str| {
            let channel = |title: &str| {
                let (name, unit) = title.split_once('/').unwrap_or((title, ""));
                Channel::new(name, Some(unit).filter(|unit| !unit.is_empty()))
            };
            position_pair(&Vec::from_iter(titles.split(' ').map(channel)))
        };
        for (titles, expected) in [
            ("x/mm y/mm", Some([0, 1])),
            ("force/N a/mm b/mm", Some([1, 2])),
            ("x/mm y/cm", None),
            ("fx/N fy/N", None),
            ("states.c2 states.c3", Some([0, 1])),
            ("probe_x probe.y", Some([0, 1])),
            ("weight waist", None),
        ] {
            assert_eq!(pair(titles), expected, "{titles}");
        }
    }
}
