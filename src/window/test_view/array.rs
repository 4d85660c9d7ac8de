use std::{ops::RangeInclusive, sync::Arc};

use glam::DVec3;
use ndarray::{Array2, ArrayView2, Axis, Zip};
use thiserror::Error;

use decoupler_core::{
    dataset::Dataset,
    evaluation::{NodeAddress, Outlook, Pressed, RunError, SimulatedSettings},
    scene::Touch,
    sensor::SensorModel,
    surface::{SurfaceError, SurfaceMap},
};
use decoupler_files::{
    figure::{
        SequentialMap,
        surface::{Quantity, Surface, ViewMode},
    },
    import::SetupError,
};

/// Look of the surfaces of a test set.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceStyle {
    /// In space or from above.
    pub mode: ViewMode,
    /// Colours of heights.
    pub colours: SequentialMap,
    /// Heights that colours and axes span.
    pub heights: HeightScale,
    /// Errors at the ends of the colours, in millimetres, while they are locked; else those displayed.
    pub error_limit_mm: Option<f64>,
}

/// Heights that colours and axes span.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HeightScale {
    /// From full compression to rest, whatever is displayed.
    #[default]
    Stroke,
    /// From the lowest to the highest displayed node.
    Fitted,
}

/// A test set ready to be drawn: its samples, and the surface through the array's nodes.
#[derive(Clone, Debug)]
pub struct TestView {
    /// The samples.
    pub set: Arc<Dataset>,
    /// The samples of each snapshot, rows from first to last.
    pub snapshots: Arc<Vec<Vec<usize>>>,
    /// Heights of nodes to heights of the drawn grid.
    pub surface: Arc<SurfaceMap>,
    /// The sensor they were drawn for.
    pub sensor: SensorModel,
    /// The row-wires read, from 0: those of the nodes drawn.
    pub rows: Vec<usize>,
    /// The distance a node can travel.
    pub stroke_mm: f64,
    /// Readings of the sensor at rest, rows read × M4; none where it has none.
    pub unloaded_ohm: Option<Arc<Array2<f64>>>,
    /// Outlook of the scene; none where it takes long or cannot be computed.
    pub outlook: Option<Outlook>,
}

impl TestView {
    /// Draws the test set of `settings`.
    ///
    /// # Errors
    /// An impossible sensor, scene, or number of samples.
    pub fn draw(settings: &SimulatedSettings) -> Result<Self, TestViewError> {
        Ok(Self::of(settings, Arc::new(settings.draw_test()?))?)
    }

    /// Prepares the surface for a test set already drawn.
    ///
    /// # Errors
    /// Nodes through which no surface can be laid.
    pub fn of(settings: &SimulatedSettings, set: Arc<Dataset>) -> Result<Self, SurfaceError> {
        let sensor = settings.source.sensor;
        let row_count = sensor.scale.rows();
        // Of a row that does not exist there is no set either.
        let rows = settings.source.scene.rows.read(row_count).unwrap_or_default();
        let x_mm: Vec<f64> = rows.iter().map(|&row| sensor.geometry.row_x_mm(row)).collect();
        let nodes = 0..sensor.scale.nodes_per_row();
        let y_mm: Vec<f64> = nodes
            .map(|node| sensor.geometry.node_y_mm(sensor.scale, node))
            .collect();
        let stroke_mm = settings.source.stroke_mm();
        let unloaded = Pressed::new(&sensor, &rows, &Touch::default(), stroke_mm);
        Ok(Self {
            unloaded_ohm: unloaded.ok().map(|unloaded| Arc::new(unloaded.readings_ohm().clone())),
            snapshots: Arc::new(set.snapshots()),
            set,
            surface: Arc::new(SurfaceMap::new(&x_mm, &y_mm)?),
            sensor,
            rows,
            stroke_mm,
            outlook: outlook(settings),
        })
    }

    /// z from full compression to rest, in millimetres: what the height scale spans.
    pub fn z_range_mm(&self) -> RangeInclusive<f64> {
        let height_mm = self.sensor.geometry.height_mm;
        height_mm - self.stroke_mm..=height_mm
    }

    /// The number of a node among those drawn, row by row.
    pub fn node(&self, address: NodeAddress) -> Option<usize> {
        let row_index = self.rows.iter().position(|row_wire| *row_wire == address.row)?;
        Some(row_index * self.sensor.scale.nodes_per_row() + address.node)
    }

    /// The nearest snapshot there is.
    pub fn nearest_snapshot(&self, snapshot: usize) -> usize {
        snapshot.min(self.snapshots.len().saturating_sub(1))
    }

    /// Nodes of one snapshot and the surface through them, from coordinates of the shape of the set's.
    pub fn frame(&self, coordinates_mm: ArrayView2<'_, f64>, snapshot: usize) -> Frame {
        let samples = self.snapshots.get(snapshot).map_or(&[][..], Vec::as_slice);
        let coordinates = samples.iter().flat_map(|&sample| coordinates_mm.row(sample).to_vec());
        let coordinates: Vec<f64> = coordinates.collect();
        self.frame_of(coordinates.chunks_exact(3).map(DVec3::from_slice))
    }

    /// The surface through nodes at these places, row by row.
    pub fn frame_of(&self, nodes_mm: impl Iterator<Item = DVec3>) -> Frame {
        let nodes_mm: Arc<[DVec3]> = nodes_mm.collect();
        let z_mm: Vec<f64> = nodes_mm.iter().map(|node| node.z).collect();
        let grid_mm = self.surface.evaluate(&z_mm).into();
        Frame { nodes_mm, grid_mm }
    }

    /// Drops of the readings below those at rest, in percent: rows read × M4; `None` where the sensor has none at rest, or
    /// these are not of all rows.
    pub fn drops_percent(&self, readings_ohm: &Array2<f64>) -> Option<Array2<f64>> {
        let unloaded_ohm = self.unloaded_ohm.as_deref()?;
        if readings_ohm.dim() != unloaded_ohm.dim() {
            return None;
        }
        let ratios = Zip::from(readings_ohm).and(unloaded_ohm);
        Some(ratios.map_collect(|reading, unloaded| 100.0 * (1.0 - reading / unloaded)))
    }

    /// Readings of one snapshot: rows read × M4.
    pub fn readings_ohm(&self, snapshot: usize) -> Array2<f64> {
        let samples = self.snapshots.get(snapshot).map_or(&[][..], Vec::as_slice);
        self.set.readings().select(Axis(0), samples)
    }

    /// The surface of heights.
    pub fn heights(&self, title: impl Into<String>, frame: &Frame, style: SurfaceStyle) -> Surface {
        Surface {
            quantity: Quantity::Height,
            range: match style.heights {
                HeightScale::Stroke => self.z_range_mm(),
                HeightScale::Fitted => frame.range_mm().unwrap_or_else(|| self.z_range_mm()),
            },
            ..self.errors(title, frame, style)
        }
    }

    /// The surface of errors of z.
    pub fn errors(&self, title: impl Into<String>, frame: &Frame, style: SurfaceStyle) -> Surface {
        let locked = style.error_limit_mm.map(|limit| -limit..=limit);
        Surface {
            title: title.into(),
            map: Arc::clone(&self.surface),
            values: Arc::clone(&frame.grid_mm),
            nodes: Arc::clone(&frame.nodes_mm),
            quantity: Quantity::Error,
            range: locked.unwrap_or_else(|| frame.symmetric_range_mm()),
            mode: style.mode,
            colours: style.colours,
        }
    }
}

/// The outlook of arrays for which it takes a moment; those of the paper take a millisecond.
fn outlook(settings: &SimulatedSettings) -> Option<Outlook> {
    /// About a third of a second.
    const MAX_PRODUCTS: usize = 500_000_000;
    let scale = settings.source.sensor.scale;
    let unknowns = settings.source.scene.unknowns_per_row(scale);
    let matrix = unknowns.saturating_mul(scale.columns().max(unknowns));
    let products = matrix.saturating_mul(unknowns).saturating_mul(scale.rows());
    if products > MAX_PRODUCTS {
        return None;
    }
    Outlook::of(&settings.source).ok()
}

/// Reasons for which there is nothing to draw.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TestViewError {
    /// The samples cannot be drawn or trained on.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The samples cannot be read or drawn.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// No surface can be laid through the nodes.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
}

/// One snapshot to be drawn.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Position of each node, row by row.
    pub nodes_mm: Arc<[DVec3]>,
    /// Value at each grid point of the surface.
    pub grid_mm: Arc<[f64]>,
}

impl Frame {
    /// `decoupled` − this one: z of the nodes and of the grid.
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

    /// Returns the lowest and highest z of a node; `None` without any.
    pub fn range_mm(&self) -> Option<RangeInclusive<f64>> {
        let heights = || self.nodes_mm.iter().map(|node| node.z).filter(|z| z.is_finite());
        let (low, high) = (heights().reduce(f64::min)?, heights().reduce(f64::max)?);
        // Nothing finer than a nanometre is told apart.
        Some(low..=high.max(low + 1e-6))
    }

    /// ± the largest z of a node, so that zero keeps its colour.
    pub fn symmetric_range_mm(&self) -> RangeInclusive<f64> {
        let heights = self.nodes_mm.iter().map(|node| node.z.abs());
        let largest = heights.filter(|z| z.is_finite()).fold(0.0, f64::max);
        // Nothing finer than a nanometre is told apart.
        let largest = largest.max(1e-6);
        -largest..=largest
    }
}
