//! The figures of a report.

use std::sync::Arc;

use glam::DVec3;
use ndarray::Array2;

use crate::{
    dataset::Dataset,
    evaluation::{NodeAddress, SimulatedSettings},
    export::NetworkFile,
    figure::{
        Figure, SequentialMap, error_histogram_figure, loss_figure, regression_figure,
        surface::{OrbitCamera, Quantity, Surface, SurfaceFigure, ViewMode},
        training_state_figure, z_pairs_mm,
    },
    surface::SurfaceMap,
};

/// Captions and figures of a run: `decoupled_mm` are the answers of its network to `test`.
pub(super) fn pictures(
    file: &NetworkFile,
    settings: &SimulatedSettings,
    test: &Dataset,
    decoupled_mm: &Array2<f64>,
) -> Vec<(String, Figure)> {
    let training = &file.training;
    let pairs_mm = z_pairs_mm(test, decoupled_mm);
    let worst = file
        .scores
        .network
        .nodes()
        .map_or_else(Default::default, |errors| errors.worst_node);
    let mut pictures = Vec::new();
    if let Some(surfaces) = surfaces(settings, test, decoupled_mm, worst) {
        let caption = format!(
            "Snapshot {} of the test set, which has the worst node of all (row {}, node {}, marked).",
            worst.snapshot + 1,
            worst.row + 1,
            worst.node + 1
        );
        pictures.push((caption, surfaces.into()));
    }
    pictures.extend([
        (
            "Errors of every epoch, mean squared, in scaled units.".to_owned(),
            loss_figure(&training.history, &training.stages, training.best_epoch).into(),
        ),
        (
            "Gradient and the method's own quantities.".to_owned(),
            training_state_figure(&training.history, &training.stages).into(),
        ),
        (
            "Distribution of the z errors of the test set.".to_owned(),
            error_histogram_figure(&pairs_mm, None).into(),
        ),
        (
            "Decoupled against actual z of the nodes of the test set.".to_owned(),
            regression_figure(&pairs_mm).into(),
        ),
    ]);
    pictures
}

/// Actual and decoupled surface of the snapshot of `worst`, which is marked, and the error; `None` where no surface can be
/// laid through the nodes.
fn surfaces(
    settings: &SimulatedSettings,
    test: &Dataset,
    decoupled_mm: &Array2<f64>,
    worst: NodeAddress,
) -> Option<SurfaceFigure> {
    let source = &settings.source;
    let (scale, geometry) = (source.sensor.scale, &source.sensor.geometry);
    let rows = source.scene.rows.read(scale.rows()).ok()?;
    let x_mm: Vec<f64> = rows.iter().map(|&row| geometry.row_x_mm(row)).collect();
    let nodes = 0..scale.nodes_per_row();
    let y_mm: Vec<f64> = nodes.map(|node| geometry.node_y_mm(scale, node)).collect();
    let map = Arc::new(SurfaceMap::new(&x_mm, &y_mm).ok()?);
    let snapshots = test.snapshots();
    let samples = snapshots.get(worst.snapshot)?;
    let nodes_of = |row: ndarray::ArrayView1<'_, f64>| -> Vec<DVec3> {
        let coordinates = row.to_vec();
        coordinates.chunks_exact(3).map(DVec3::from_slice).collect()
    };
    let targets = test.targets();
    let actual: Vec<DVec3> = samples
        .iter()
        .flat_map(|&sample| nodes_of(targets.row(sample)))
        .collect();
    let decoupled: Vec<DVec3> = samples
        .iter()
        .flat_map(|&sample| nodes_of(decoupled_mm.row(sample)))
        .collect();
    let error: Vec<DVec3> = actual
        .iter()
        .zip(&decoupled)
        .map(|(a, d)| a.with_z(d.z - a.z))
        .collect();
    let surface = |title: &str, nodes: Vec<DVec3>, quantity, range| {
        let z_mm: Vec<f64> = nodes.iter().map(|node| node.z).collect();
        Surface {
            title: title.to_owned(),
            map: Arc::clone(&map),
            values: map.evaluate(&z_mm).into(),
            nodes: nodes.into(),
            quantity,
            range,
            mode: ViewMode::Top,
            colours: SequentialMap::default(),
        }
    };
    let heights = geometry.height_mm - source.stroke_mm()..=geometry.height_mm;
    let errors_mm = error.iter().map(|node| node.z.abs()).filter(|z| z.is_finite());
    // Nothing finer than a nanometre is told apart.
    let largest_mm = errors_mm.fold(1e-6, f64::max);
    let place = rows.iter().position(|&row| row == worst.row)?;
    Some(SurfaceFigure {
        surfaces: vec![
            surface("Actual", actual, Quantity::Height, heights.clone()),
            surface("Decoupled", decoupled, Quantity::Height, heights),
            surface("Error", error, Quantity::Error, -largest_mm..=largest_mm),
        ],
        camera: OrbitCamera::default(),
        marked_node: Some(place * scale.nodes_per_row() + worst.node),
        ..SurfaceFigure::default()
    })
}
