//! The figures of a report.

use glam::DVec3;
use ndarray::{Array2, ArrayView2};

use crate::{
    export::NetworkFile,
    figure::{
        Decoded, Figure, PlotFigure, RegressionLine, TargetSurface, ends, histogram_figure, hysteresis_figure,
        loss_figure, regression_figure,
        surface::{Quantity, Surface, SurfaceFigure, ViewMode},
        training_state_figure, value_pairs,
    },
};
use decoupler_core::{
    dataset::{Dataset, Simulation},
    evaluation::{NodeAddress, recorded::HysteresisLoop},
    surface::SurfaceMap,
};

/// Maximum number of targets of a recording that have their own figures.
const MAX_TARGETS: usize = 8;

/// Captions and figures of a run; `answers` are the outputs of its network for `test`, and `loops` those of its targets.
pub(super) fn pictures(
    file: &NetworkFile,
    test: &Dataset,
    answers: &Array2<f64>,
    loops: &[Option<HysteresisLoop>],
) -> Vec<(String, Figure)> {
    let training = &file.training;
    let of_array = file.problem.sensor.as_ref().zip(file.scores.network.nodes());
    let surfaces = match of_array {
        Some((simulation, errors)) => array_surfaces(simulation, test, answers, errors.worst_node),
        None => target_surfaces(file, test, answers),
    };
    let mut pictures = Vec::from_iter(surfaces);
    let mut add = |caption: String, figure: PlotFigure| pictures.push((caption, figure.into()));
    add(
        "Mean squared error of every epoch, in scaled units.".to_owned(),
        loss_figure(&training.history, &training.stages, training.best_epoch),
    );
    add(
        "Gradient and the method's own quantities.".to_owned(),
        training_state_figure(&training.history, &training.stages),
    );
    let targets = || file.problem.targets.iter().take(MAX_TARGETS);
    let decoded = match of_array {
        Some(_) => vec![(
            (None, Decoded::Nodes),
            "Decoupled against actual z of the nodes of the test set.".to_owned(),
            "Distribution of the z errors of the test set.".to_owned(),
        )],
        None => Vec::from_iter({ targets().enumerate() }.map(|(index, target)| {
            let name = &target.name;
            (
                (Some(index), Decoded::Target(target)),
                format!("Decoded against actual values of {name} in the test set."),
                format!("Distribution of the errors of {name} in the test set."),
            )
        })),
    };
    for ((index, of), regression, histogram) in decoded {
        let pairs = value_pairs(test, answers, index);
        let line = RegressionLine::of(pairs.iter().copied());
        let point = |pair: usize| pairs[pair];
        add(regression, regression_figure((pairs.len(), &point), &line, of));
        add(histogram, histogram_figure(&pairs, of));
    }
    // An array has no loops.
    for (target, found) in targets().zip(loops) {
        if let Some(found) = found {
            let name = &target.name;
            add(
                format!("Mean decoded against actual values of {name} in the test set, loading and unloading."),
                hysteresis_figure(found, target),
            );
        }
    }
    pictures
}

/// Actual and decoded surface of the test sample with the largest error of a target that has a position, and the error;
/// `None` where no surface can be laid through the positions.
fn target_surfaces(file: &NetworkFile, test: &Dataset, answers: &Array2<f64>) -> Option<(String, Figure)> {
    let problem = &file.problem;
    let surface = TargetSurface::new(&problem.positions, &problem.targets).ok()?;
    let errors = file.scores.network.targets();
    let nodes = surface.nodes().iter().enumerate();
    let worst = nodes.filter_map(|(node, position)| Some((node, errors.get(position.target)?)));
    let (node, worst) = worst.max_by(|(_, one), (_, other)| one.worst.total_cmp(&other.worst))?;
    let targets = test.targets();
    let columns = targets.columns().into_iter();
    let ranges = columns.map(|column| ends(column.iter().copied()));
    let range = surface.range_of(&Vec::from_iter(ranges));
    let sample = Some(worst.worst_sample).filter(|&sample| sample < test.samples())?;
    let [actual, decoded] = [targets, answers.view()].map(|rows| rows.row(sample).to_vec());
    let name = &problem.targets[surface.nodes()[node].target].name;
    let caption = format!(
        "Sample {} of the test set, which has the largest error of all targets with a position ({name}, marked).",
        sample + 1
    );
    Some((caption, from_above(surface.surfaces(&actual, &decoded, range), node)))
}

/// Actual and decoupled surface of the snapshot of `worst`, which is marked, and the error; `None` where no surface can be
/// laid through the nodes.
fn array_surfaces(
    source: &Simulation,
    test: &Dataset,
    decoupled_mm: &Array2<f64>,
    worst: NodeAddress,
) -> Option<(String, Figure)> {
    let (scale, geometry) = (source.sensor.scale, &source.sensor.geometry);
    let rows = source.scene.rows.read(scale.rows()).ok()?;
    let (x_mm, y_mm) = geometry.lattice_mm(scale, &rows);
    let map = SurfaceMap::shared(&x_mm, &y_mm).ok()?;
    let snapshots = test.snapshots();
    let samples = snapshots.get(worst.snapshot)?;
    let nodes = |coordinates_mm: ArrayView2<'_, f64>| {
        let rows = samples.iter().map(|&sample| coordinates_mm.row(sample).to_vec());
        Vec::from_iter(rows.flat_map(|row| Vec::from_iter(row.chunks_exact(3).map(DVec3::from_slice))))
    };
    let nodes = [test.targets(), decoupled_mm.view()].map(nodes);
    let heights = geometry.height_mm - source.stroke_mm()..=geometry.height_mm;
    let place = rows.iter().position(|&row| row == worst.row)?;
    let caption = format!(
        "Snapshot {} of the test set, which has the node with the largest error (row {}, node {}, marked).",
        worst.snapshot + 1,
        worst.row + 1,
        worst.node + 1
    );
    let quantities = [Quantity::Height, Quantity::Error];
    // Errors below a nanometre are not distinguished by colour.
    let surfaces = Surface::compared("Decoupled", &map, nodes, quantities, heights, 1e-6);
    let marked = place * scale.nodes_per_row() + worst.node;
    Some((caption, from_above(surfaces, marked)))
}

/// The surfaces from above, with one node marked.
fn from_above(mut surfaces: [Surface; 3], marked: usize) -> Figure {
    surfaces.iter_mut().for_each(|surface| surface.mode = ViewMode::Top);
    SurfaceFigure {
        surfaces: surfaces.into(),
        marked_node: Some(marked),
        ..SurfaceFigure::default()
    }
    .into()
}
