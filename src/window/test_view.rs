//! Test set of a simulated array or of a recording, ready to be drawn.

use std::{ops::RangeInclusive, sync::Arc};

use decoupler_core::{
    dataset::{Dataset, Simulation, SplitBy},
    evaluation::{NodeAddress, Outlook, Run, RunError, RunSettings, recorded::HysteresisLoop},
    problem::{Channel, Problem},
    sensor::SensorModel,
    surface::{SurfaceError, SurfaceMap},
};
use decoupler_files::{
    figure::{
        HeatMap, RegressionLine, SequentialMap, TargetSurface, position_error_map,
        surface::{Quantity, Surface, ViewMode},
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
    pub surface: Arc<SurfaceMap>,
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
            surface: SurfaceMap::shared(&x_mm, &y_mm)?,
            sensor,
            rows,
            stroke_mm,
            outlook: outlook(simulation),
        })
    }

    /// Returns the range of the height scale: z from full compression to rest, in millimetres.
    pub fn z_range_mm(&self) -> RangeInclusive<f64> {
        let height_mm = self.sensor.geometry.height_mm;
        height_mm - self.stroke_mm..=height_mm
    }

    /// Returns the index of a node among the drawn nodes, row by row.
    pub fn node(&self, address: NodeAddress) -> Option<usize> {
        let row_index = self.rows.iter().position(|row_wire| *row_wire == address.row)?;
        Some(row_index * self.sensor.scale.nodes_per_row() + address.node)
    }

    /// Returns the nearest existing snapshot.
    pub fn nearest_snapshot(&self, snapshot: usize) -> usize {
        snapshot.min(self.snapshots.len().saturating_sub(1))
    }

    /// Returns the nodes of a snapshot and the surface through them; `coordinates_mm` has the shape of the set's coordinates.
    pub fn frame(&self, coordinates_mm: ArrayView2<'_, f64>, snapshot: usize) -> Frame {
        let samples = self.snapshots.get(snapshot).map_or(&[][..], Vec::as_slice);
        let coordinates = samples.iter().flat_map(|&sample| coordinates_mm.row(sample).to_vec());
        let coordinates: Vec<f64> = coordinates.collect();
        self.frame_of(coordinates.chunks_exact(3).map(DVec3::from_slice))
    }

    /// Returns the surface through nodes at these positions, row by row.
    pub fn frame_of(&self, nodes_mm: impl Iterator<Item = DVec3>) -> Frame {
        let nodes_mm: Arc<[DVec3]> = nodes_mm.collect();
        let z_mm: Vec<f64> = nodes_mm.iter().map(|node| node.z).collect();
        let grid_mm = self.surface.evaluate(&z_mm).into();
        Frame { nodes_mm, grid_mm }
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

    /// Returns the surface of heights, over the whole stroke.
    pub fn heights(&self, title: impl Into<String>, frame: &Frame) -> Surface {
        self.through(title, frame, Quantity::Height, self.z_range_mm())
    }

    /// Returns the surface of errors of z.
    pub fn errors(&self, title: impl Into<String>, frame: &Frame) -> Surface {
        let errors = frame.nodes_mm.iter().map(|node| node.z.abs());
        // The resolution is a nanometre.
        let largest = errors.filter(|error| error.is_finite()).fold(1e-6, f64::max);
        self.through(title, frame, Quantity::Error, -largest..=largest)
    }

    fn through(
        &self,
        title: impl Into<String>,
        frame: &Frame,
        quantity: Quantity,
        range: RangeInclusive<f64>,
    ) -> Surface {
        Surface {
            title: title.into(),
            map: Arc::clone(&self.surface),
            values: Arc::clone(&frame.grid_mm),
            nodes: Arc::clone(&frame.nodes_mm),
            quantity,
            range,
            mode: ViewMode::default(),
            colours: SequentialMap::default(),
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

/// Snapshot to be drawn.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Position of each node, row by row.
    pub nodes_mm: Arc<[DVec3]>,
    /// Value at each grid point of the surface.
    pub grid_mm: Arc<[f64]>,
}

impl Frame {
    /// Returns `decoupled` minus this frame: z of the nodes and of the grid.
    pub fn error_of(&self, decoupled: &Self) -> Self {
        let nodes = self.nodes_mm.iter().zip(decoupled.nodes_mm.iter());
        let grid = self.grid_mm.iter().zip(decoupled.grid_mm.iter());
        Self {
            nodes_mm: nodes
                .map(|(actual, decoupled)| actual.with_z(decoupled.z - actual.z))
                .collect(),
            grid_mm: grid.map(|(actual, decoupled)| decoupled - actual).collect(),
        }
    }

    /// Returns the lowest and highest z of a node; `None` without nodes.
    pub fn range_mm(&self) -> Option<RangeInclusive<f64>> {
        let heights = || self.nodes_mm.iter().map(|node| node.z).filter(|z| z.is_finite());
        let (low, high) = (heights().reduce(f64::min)?, heights().reduce(f64::max)?);
        // The resolution is a nanometre.
        Some(low..=high.max(low + 1e-6))
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
    /// Error over the position, or the reason why there is none.
    pub error_map: Result<Arc<HeatMap>, &'static str>,
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
                _ => Err(NO_PAIR),
            },
        }
    }
}

const NO_PAIR: &str = "A map needs two targets that are positions: lengths in the same unit, or both without a unit.";

fn error_map(set: &Dataset, answers: &Array2<f64>, targets: &[Channel]) -> Result<Arc<HeatMap>, &'static str> {
    let pair = position_pair(targets).ok_or(NO_PAIR)?;
    let [actual, answers] = [set.targets(), answers.view()].map(|values| values.select(Axis(1), &pair));
    let names = pair.map(|target| targets[target].name.as_str());
    let map = position_error_map(actual.view(), answers.view(), names, targets[pair[0]].unit.as_deref());
    map.map(Arc::new)
        .ok_or("The positions of the test samples do not vary, so there is no map.")
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
