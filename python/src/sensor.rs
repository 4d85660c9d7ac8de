//! The sensor model, its identifiability, and the error figures of the paper.

use decoupler_core::{
    dataset::Dataset,
    evaluation::Errors,
    identifiability::Identifiability,
    scene::Movement,
    sensor::{ArrayScale, Geometry, RelativeNoise, SensorModel},
    text::Named,
};
use glam::DVec3;
use ndarray::{Array2, Array3, Array5, ArrayView1, ArrayView3, Axis};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArray5, PyReadonlyArray3, PyReadonlyArray4};
use pyo3::{exceptions::PyValueError, prelude::*, types::PyDict};

use crate::{
    arrays::Matrix,
    work::{detached, value_error},
};

/// A sensor array: Eq. (1)-(2) of the paper.
#[pyclass(frozen, eq, module = "decoupler._native")]
#[derive(Clone, PartialEq)]
pub struct Sensor(pub SensorModel);

/// Geometry of a sensor, under the names of the attributes in Python.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Lengths {
    height_mm: f64,
    row_x0_mm: f64,
    row_pitch_mm: f64,
    node_pitch_mm: f64,
    column_y0_mm: f64,
    column_pitch_mm: f64,
    column_node_x0_mm: f64,
    column_node_pitch_mm: f64,
}

#[pymethods]
impl Sensor {
    #[new]
    fn new(scale: &str, geometry: &Bound<'_, PyAny>, resistivity_ohm_per_mm: f64) -> PyResult<Self> {
        let scale: ArrayScale = scale.parse().map_err(value_error)?;
        let Lengths {
            height_mm,
            row_x0_mm,
            row_pitch_mm,
            node_pitch_mm,
            column_y0_mm,
            column_pitch_mm,
            column_node_x0_mm,
            column_node_pitch_mm,
        } = geometry.extract()?;
        let model = SensorModel {
            scale,
            geometry: Geometry {
                height_mm,
                row_x0_mm,
                row_pitch_mm,
                node_pitch_mm,
                column_y0_mm,
                column_pitch_mm,
                column_node_x0_mm,
                column_node_pitch_mm,
            },
            resistivity_ohm_per_mm,
        };
        model.check().map_err(value_error)?;
        Ok(Self(model))
    }

    /// Array scale as text: `10x10_5x30`.
    #[getter]
    fn scale(&self) -> String {
        self.0.scale.to_string().replace('×', "x")
    }

    /// M1, M2, M3 and M4.
    #[getter]
    fn counts(&self) -> (usize, usize, usize, usize) {
        let scale = self.0.scale;
        (
            scale.rows(),
            scale.nodes_per_row(),
            scale.nodes_per_column(),
            scale.columns(),
        )
    }

    /// Positions (M1 × M2 × 3) in mm of nodes with these displacements (M1 × M2 × 3) in mm.
    fn positions<'py>(
        &self,
        py: Python<'py>,
        displacements: PyReadonlyArray3<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let all = self.displacements(displacements.as_array())?;
        let (rows, nodes, ..) = self.sizes();
        let mut positions = Array3::zeros((rows, nodes, 3));
        for ((row, node, axis), value) in positions.indexed_iter_mut() {
            *value = self.0.displaced_mm(row, node, all[row * nodes + node])[axis];
        }
        Ok(positions.into_pyarray(py))
    }

    /// Resistances (frames × M1 × M4) in ohm for displacements (frames × M1 × M2 × 3) in mm.
    fn resistances<'py>(
        &self,
        py: Python<'py>,
        displacements: PyReadonlyArray4<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let all = self.displacements_of_frames(&displacements)?;
        let (rows, nodes, columns) = self.sizes();
        let resistances = detached(py, || {
            let mut resistances = vec![0.0; all.len() * rows * columns];
            let rows_of_all = all.iter().flat_map(|frame| frame.chunks_exact(nodes).enumerate());
            for ((row, displacements), to) in rows_of_all.zip(resistances.chunks_exact_mut(columns)) {
                self.0.row_resistances_into(row, displacements, to)?;
            }
            Ok::<_, decoupler_core::sensor::SensorError>(resistances)
        })?;
        let resistances = Array3::from_shape_vec((all.len(), rows, columns), resistances);
        Ok(resistances.map_err(value_error)?.into_pyarray(py))
    }

    /// Derivatives (frames × M1 × M4 × M2 × 3) of the resistances in ohm/mm.
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        displacements: PyReadonlyArray4<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray5<f64>>> {
        let all = self.displacements_of_frames(&displacements)?;
        let (rows, nodes, columns) = self.sizes();
        let values = detached(py, || {
            let mut values = Vec::with_capacity(all.len() * rows * columns * nodes * 3);
            for (row, displacements) in all.iter().flat_map(|frame| frame.chunks_exact(nodes).enumerate()) {
                values.extend(self.0.row_jacobian(row, displacements)?);
            }
            Ok::<_, decoupler_core::sensor::SensorError>(values)
        })?;
        let shape = (all.len(), rows, columns, nodes, 3);
        let jacobian = Array5::from_shape_vec(shape, values);
        Ok(jacobian.map_err(value_error)?.into_pyarray(py))
    }

    /// Identifiability of a row-wire, from 0, at displacements (M2 × 3) in mm.
    #[allow(clippy::type_complexity, reason = "the parts of a Python tuple")]
    fn identifiability<'py>(
        &self,
        py: Python<'py>,
        row: usize,
        displacements: Matrix<'py>,
        axes: &str,
        noise: f64,
    ) -> PyResult<(
        Bound<'py, PyArray1<f64>>,
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray2<f64>>,
        f64,
        f64,
    )> {
        let displacements = displacements.view().to_array();
        let (_, nodes, _) = self.sizes();
        if displacements.dim() != (nodes, 3) {
            return Err(PyValueError::new_err(format!(
                "displacements of one row-wire are {nodes} × 3: nodes and (x, y, z) in mm"
            )));
        }
        if !(noise >= 0.0 && noise.is_finite()) {
            return Err(PyValueError::new_err(format!(
                "noise is {noise}: give a finite number from 0"
            )));
        }
        let axes = Movement::parse(axes).map_err(value_error)?.axes();
        let displacements = Vec::from_iter(displacements.rows().into_iter().map(vector));
        let own = RelativeNoise {
            own: noise,
            common: 0.0,
        };
        let found = detached(py, || Identifiability::of_row(&self.0, row, &displacements, axes, own))?;
        let rows_of = |vectors: &[DVec3]| Array2::from_shape_fn((vectors.len(), 3), |(node, axis)| vectors[node][axis]);
        Ok((
            found.singular_values_per_mm.clone().into_pyarray(py),
            rows_of(&found.worst_pattern).into_pyarray(py),
            rows_of(&found.sensitivity_per_mm).into_pyarray(py),
            found.condition(),
            found.worst_spread_mm(noise),
        ))
    }

    fn __reduce__(&self, py: Python<'_>) -> PyResult<(Py<PyAny>, (String,))> {
        let text = serde_json::to_string(&self.0).map_err(value_error)?;
        Ok((py.get_type::<Self>().getattr("_restore")?.unbind(), (text,)))
    }

    #[staticmethod]
    fn _restore(state: &str) -> PyResult<Self> {
        Ok(Self(serde_json::from_str(state).map_err(value_error)?))
    }
}

impl Sensor {
    /// M1, M2 and M4.
    fn sizes(&self) -> (usize, usize, usize) {
        let scale = self.0.scale;
        (scale.rows(), scale.nodes_per_row(), scale.columns())
    }

    /// Displacements of each frame, row by row.
    fn displacements_of_frames(&self, frames: &PyReadonlyArray4<'_, f64>) -> PyResult<Vec<Vec<DVec3>>> {
        let frames = frames.as_array();
        frames
            .axis_iter(Axis(0))
            .map(|frame| self.displacements(frame))
            .collect()
    }

    /// Displacements of one frame, row by row.
    fn displacements(&self, frame: ArrayView3<'_, f64>) -> PyResult<Vec<DVec3>> {
        let (rows, nodes, _) = self.sizes();
        if frame.dim() != (rows, nodes, 3) {
            let (a, b, c) = frame.dim();
            return Err(PyValueError::new_err(format!(
                "displacements are {a} × {b} × {c}, the array needs {rows} × {nodes} × 3: row-wires, nodes and (x, y, z) in mm"
            )));
        }
        Ok(frame.lanes(Axis(2)).into_iter().map(vector).collect())
    }
}

fn vector(lane: ArrayView1<'_, f64>) -> DVec3 {
    DVec3::new(lane[0], lane[1], lane[2])
}

/// Errors of decoded coordinates (samples × 3·M2) in mm, as in the paper's tables.
#[pyfunction]
#[pyo3(signature = (truth, decoded, stroke_mm, row_wires = None, snapshots = None))]
pub fn node_errors<'py>(
    py: Python<'py>,
    truth: Matrix<'py>,
    decoded: Matrix<'py>,
    stroke_mm: f64,
    row_wires: Option<Vec<usize>>,
    snapshots: Option<Vec<usize>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (truth, decoded) = (truth.view().to_array(), decoded.view().to_array());
    let ((samples, columns), found) = (truth.dim(), decoded.dim());
    if found != (samples, columns) {
        return Err(PyValueError::new_err(format!(
            "y_pred is {} × {}, y_true {samples} × {columns}: give one answer for each coordinate",
            found.0, found.1
        )));
    }
    if columns % 3 != 0 {
        return Err(PyValueError::new_err(format!(
            "{columns} coordinates are not x, y and z of whole nodes: give a multiple of 3"
        )));
    }
    if !(stroke_mm > 0.0 && stroke_mm.is_finite()) {
        return Err(PyValueError::new_err(format!(
            "stroke_mm is {stroke_mm}: give a length above 0"
        )));
    }
    let groups = snapshots.unwrap_or_else(|| (0..samples).collect());
    let readings = Array2::zeros((samples, 1));
    let truth = Dataset::new(readings, truth, row_wires.as_deref(), groups).map_err(value_error)?;
    let errors = detached(py, || Ok::<_, String>(Errors::measure(&truth, &decoded, stroke_mm)))?;
    let figures = PyDict::new(py);
    figures.set_item("z_percent", errors.z_percent)?;
    figures.set_item("x_percent", errors.x_percent)?;
    figures.set_item("y_percent", errors.y_percent)?;
    figures.set_item("z_mm", errors.z_mm)?;
    figures.set_item("z_full_scale_percent", errors.z_full_scale_percent)?;
    figures.set_item("worst_mm", errors.worst_mm)?;
    let worst = errors.worst_node;
    figures.set_item("worst_node", (worst.snapshot, worst.row, worst.node))?;
    Ok(figures)
}

/// Default geometry and resistivity, and the note on them.
#[pyfunction]
pub fn default_geometry(py: Python<'_>) -> PyResult<(Bound<'_, PyDict>, f64, &'static str)> {
    let sensor = SensorModel::default();
    let text = serde_json::to_string(&sensor.geometry).map_err(value_error)?;
    let geometry = py.import("json")?.call_method1("loads", (text,))?;
    Ok((
        geometry.cast_into::<PyDict>()?,
        sensor.resistivity_ohm_per_mm,
        Geometry::ASSUMPTION,
    ))
}
