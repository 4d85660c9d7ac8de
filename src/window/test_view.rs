//! Test set of a simulated array or of a recording, ready to be drawn.

use std::sync::Arc;

use decoupler_core::{
    dataset::{Dataset, Simulation, SplitBy},
    evaluation::{NodeAddress, Outlook, Run, RunError, RunSettings, recorded::HysteresisLoop},
    problem::{Channel, Problem},
    sensor::SensorModel,
    surface::{SurfaceError, SurfaceMap},
};
use decoupler_files::{
    figure::{
        HeatMap, RegressionLine, TargetSurface, position_error_map,
        surface::{Quantity, Surface},
    },
    import::SetupError,
};
use glam::DVec3;
use ndarray::{Array2, ArrayView2, Axis, Zip};
use thiserror::Error;

/// Test set of a run, ready to be drawn.
#[expect(clippy::large_enum_variant, reason = "there is one a run")]
#[derive(Clone, Debug)]
pub enum TestSet {
    /// Nodes of a simulated array.
    Array(TestView),
    /// Targets of a recording.
    Recording(RecordedTest),
}

impl TestSet {
    /// Prepares the test set of `run`; recorded samples are in the order of a division by `order`.
    ///
    /// # Errors
    /// If no surface can be interpolated through the nodes of the array.
    pub fn of(run: &Run, order: SplitBy) -> Result<Self, TestViewError> {
        Ok(match &run.problem().sensor {
            Some(simulation) => Self::Array(TestView::of(simulation, Arc::clone(run.test()))?),
            None => Self::Recording(RecordedTest::new(
                Arc::clone(run.test()),
                Arc::clone(run.problem()),
                order,
            )),
        })
    }

    /// Samples.
    pub fn set(&self) -> &Arc<Dataset> {
        match self {
            Self::Array(test) => &test.set,
            Self::Recording(test) => &test.set,
        }
    }

    /// Returns the view of a simulated array; `None` for a recording.
    pub fn array(&self) -> Option<&TestView> {
        match self {
            Self::Array(test) => Some(test),
            Self::Recording(_) => None,
        }
    }

    /// Returns the view of a recording; `None` for a simulated array.
    pub fn recording(&self) -> Option<&RecordedTest> {
        match self {
            Self::Array(_) => None,
            Self::Recording(test) => Some(test),
        }
    }

    /// Returns what is drawn of `snapshot`, or of the last one if there are fewer; `answers` are the outputs of a network for
    /// the samples. `None` where no surface goes through the targets.
    pub fn drawing(&self, answers: Option<&Array2<f64>>, snapshot: usize) -> Option<Drawing> {
        match self {
            Self::Array(test) => Some(test.drawing(answers, snapshot)),
            Self::Recording(test) => test.drawing(answers, snapshot),
        }
    }

    /// Returns the number of test snapshots: whole frames of an array, or samples of a recording.
    pub fn snapshots(&self) -> usize {
        match self {
            Self::Array(test) => test.snapshots.len(),
            Self::Recording(test) => test.set.samples(),
        }
    }
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

/// Test set of an array, ready to be drawn: its samples, and the surface through the nodes.
#[derive(Clone, Debug)]
pub struct TestView {
    /// Samples.
    pub set: Arc<Dataset>,
    /// Samples of each snapshot, from the first row to the last.
    pub snapshots: Arc<Vec<Vec<usize>>>,
    /// Interpolation from the heights of nodes to those of the drawn grid.
    pub map: Arc<SurfaceMap>,
    /// Sensor of the samples.
    pub sensor: SensorModel,
    /// Row-wires that are read and drawn, from 0.
    pub rows: Vec<usize>,
    /// Distance that a node can travel.
    pub stroke_mm: f64,
    /// Readings of the sensor at rest, rows read × M4; `None` if they cannot be computed.
    pub unloaded_ohm: Option<Arc<Array2<f64>>>,
    /// Outlook of the scene; `None` if it takes long or cannot be computed.
    pub outlook: Option<Outlook>,
}

impl TestView {
    /// Draws the test set of `settings`.
    ///
    /// # Errors
    /// If the sensor, the scene or the number of samples is invalid.
    pub fn draw(settings: &RunSettings) -> Result<Self, TestViewError> {
        let simulation = settings.drawn()?;
        Ok(Self::of(simulation, Arc::new(simulation.draw_test(settings.seed)?))?)
    }

    /// Prepares the surface for an existing test set.
    ///
    /// # Errors
    /// If no surface can be interpolated through the nodes.
    pub fn of(simulation: &Simulation, set: Arc<Dataset>) -> Result<Self, SurfaceError> {
        let sensor = simulation.sensor;
        let row_count = sensor.scale.rows();
        // There is no test set of a row that does not exist.
        let rows = simulation.scene.rows.read(row_count).unwrap_or_default();
        let (x_mm, y_mm) = sensor.geometry.lattice_mm(sensor.scale, &rows);
        let stroke_mm = simulation.stroke_mm();
        Ok(Self {
            unloaded_ohm: unloaded_ohm(&sensor, &rows).map(Arc::new),
            snapshots: Arc::new(set.snapshots()),
            set,
            map: SurfaceMap::shared(&x_mm, &y_mm)?,
            sensor,
            rows,
            stroke_mm,
            outlook: outlook(simulation),
        })
    }

    /// Returns the index of a node among the drawn nodes, row by row.
    pub fn node(&self, address: NodeAddress) -> Option<usize> {
        let row_index = self.rows.iter().position(|row_wire| *row_wire == address.row)?;
        Some(row_index * self.sensor.scale.nodes_per_row() + address.node)
    }

    /// Returns what is drawn of `snapshot`, or of the last one if there are fewer; `answers` have the shape of the set's
    /// coordinates.
    pub fn drawing(&self, answers: Option<&Array2<f64>>, snapshot: usize) -> Drawing {
        let snapshot = snapshot.min(self.snapshots.len().saturating_sub(1));
        let samples = self.snapshots.get(snapshot).map_or(&[][..], Vec::as_slice);
        let nodes = |coordinates_mm: ArrayView2<'_, f64>| {
            let rows = samples.iter().map(|&sample| coordinates_mm.row(sample).to_vec());
            Vec::from_iter(rows.flat_map(|row| Vec::from_iter(row.chunks_exact(3).map(DVec3::from_slice))))
        };
        let decoded = answers.map_or(self.set.targets(), |answers| answers.view());
        let nodes = [self.set.targets(), decoded].map(nodes);
        let height_mm = self.sensor.geometry.height_mm;
        let (heights, quantities) = (
            height_mm - self.stroke_mm..=height_mm,
            [Quantity::Height, Quantity::Error],
        );
        // Errors below a nanometre are not distinguished by colour.
        let surfaces = Surface::compared("Decoded", &self.map, nodes, quantities, heights, 1e-6);
        Drawing::of(surfaces, answers.is_some())
    }

    /// Returns the drops of the readings below those at rest, in percent, rows read × M4; `None` if there are no readings at
    /// rest, or the given readings do not cover all rows.
    pub fn drops_percent(&self, readings_ohm: &Array2<f64>) -> Option<Array2<f64>> {
        let unloaded_ohm = self.unloaded_ohm.as_deref()?;
        if readings_ohm.dim() != unloaded_ohm.dim() {
            return None;
        }
        let ratios = Zip::from(readings_ohm).and(unloaded_ohm);
        Some(ratios.map_collect(|reading, unloaded| 100.0 * (1.0 - reading / unloaded)))
    }

    /// Returns the readings of a snapshot, rows read × M4.
    pub fn readings_ohm(&self, snapshot: usize) -> Array2<f64> {
        let samples = self.snapshots.get(snapshot).map_or(&[][..], Vec::as_slice);
        self.set.readings().select(Axis(0), samples)
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

/// What is drawn of a sample of a test set.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// Actual surface.
    pub actual: Surface,
    /// Surface decoded by a network, and its error (decoded − actual).
    pub decoded: Option<[Surface; 2]>,
}

impl Drawing {
    fn of([actual, decoded, error]: [Surface; 3], is_decoded: bool) -> Self {
        Self {
            actual,
            decoded: is_decoded.then_some([decoded, error]),
        }
    }
}

/// Test samples of a recording, ready to be drawn.
#[derive(Clone, Debug)]
pub struct RecordedTest {
    /// Samples.
    pub set: Arc<Dataset>,
    /// Description of the channels.
    pub problem: Arc<Problem>,
    /// Minimum and maximum of each target.
    pub ranges: Arc<[(f64, f64)]>,
    /// Positions of targets.
    pub positions: Positions,
    /// Rule of the division, which determines the order of the samples.
    order: SplitBy,
}

/// Positions of targets on the skin.
#[derive(Clone, Debug)]
pub enum Positions {
    /// No target has a position.
    None,
    /// No surface can be interpolated through the positions.
    NoSurface(SurfaceError),
    /// Surface through the positions.
    Surface(Arc<TargetSurface>),
}

/// Charts of all test samples of a recording, computed in the background.
#[derive(Debug)]
pub struct TargetCharts {
    /// Regression lines through the actual and decoded values of each target.
    pub lines: Vec<RegressionLine>,
    /// Errors of loading and unloading for each target that rises and falls.
    pub loops: Vec<Option<HysteresisLoop>>,
    /// Error over the position, if two targets are one.
    pub error_map: Option<HeatMap>,
}

impl Positions {
    fn of(problem: &Problem) -> Self {
        if problem.positions.is_empty() {
            return Self::None;
        }
        match TargetSurface::new(&problem.positions, &problem.targets) {
            Ok(surface) => Self::Surface(Arc::new(surface)),
            Err(reason) => Self::NoSurface(reason),
        }
    }
}

impl RecordedTest {
    /// Prepares the test samples `set`, whose channels are those of `problem`, in the order of a division by `order`.
    pub fn new(set: Arc<Dataset>, problem: Arc<Problem>, order: SplitBy) -> Self {
        let range = |target| {
            let values = set.targets();
            let extreme = |pick: fn(f64, f64) -> f64, none| values.column(target).iter().copied().fold(none, pick);
            (extreme(f64::min, f64::INFINITY), extreme(f64::max, f64::NEG_INFINITY))
        };
        Self {
            ranges: (0..set.outputs()).map(range).collect(),
            positions: Positions::of(&problem),
            set,
            problem,
            order,
        }
    }

    /// Returns what is drawn of `sample`, or of the last one if there are fewer.
    pub fn drawing(&self, answers: Option<&Array2<f64>>, sample: usize) -> Option<Drawing> {
        let Positions::Surface(through) = &self.positions else {
            return None;
        };
        let sample = sample.min(self.set.samples().saturating_sub(1));
        let decoded = answers.map_or(self.set.targets(), |answers| answers.view());
        let [actual, decoded] = [self.set.targets(), decoded].map(|values| values.row(sample).to_vec());
        let surfaces = through.surfaces(&actual, &decoded, through.range_of(&self.ranges));
        Some(Drawing::of(surfaces, answers.is_some()))
    }

    /// Computes the charts of these decoded values (samples × targets).
    pub fn charts(&self, answers: &Array2<f64>) -> TargetCharts {
        let line = |target| {
            let (actual, decoded) = (self.set.targets(), answers.column(target));
            RegressionLine::of(actual.column(target).iter().copied().zip(decoded.iter().copied()))
        };
        TargetCharts {
            lines: (0..self.set.outputs()).map(line).collect(),
            loops: HysteresisLoop::of_test(&self.set, answers.view(), self.order),
            error_map: match &self.positions {
                // Targets that have positions are not positions themselves.
                Positions::None => error_map(&self.set, answers, &self.problem.targets),
                _ => None,
            },
        }
    }
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
