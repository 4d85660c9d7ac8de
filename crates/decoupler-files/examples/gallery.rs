//! Pictures of every printed figure, to look at: `cargo run --release --example gallery`, then open `target/pictures`.
#![expect(clippy::unwrap_used, reason = "it ends by panicking")]

use std::{fs, path::Path, sync::Arc};

use decoupler_core::{
    decoupling::DecoderKind,
    evaluation::{
        Preset, Run, RunSettings, TradeOffPoint,
        experiments::{Axis, AxisKind, ExperimentResults, PaperTable},
        measure_trade_off,
    },
    identifiability::Identifiability,
    job::Job,
    problem::Channel,
    sensor::{Axes, RelativeNoise},
    surface::SurfaceMap,
};
use decoupler_files::{
    export::{NetworkFile, report::RunReport},
    figure::{
        Decoded, Figure, PlotAxis, RegressionLine, TimeSeries, TradeOffLevel, TradeOffLimits, compared_losses_figure,
        experiment_figure, histogram_figure, loss_figure, node_figure, position_error_map, readings_figure,
        regression_figure, section_figure, singular_values_figure,
        surface::{Quantity, Section, SectionLine, Surface, SurfaceFigure, ViewMode},
        trade_off_figure, training_state_figure, value_pairs,
    },
    import::Setup,
};
use glam::DVec3;
use ndarray::Array2;

const PICTURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../target/pictures");

fn draw(name: &str, figure: impl Into<Figure>) {
    let picture = figure.into().draw();
    for extension in ["svg", "png"] {
        let path = format!("{PICTURES}/print-{name}.{extension}");
        picture.save(Path::new(&path)).unwrap();
    }
}

fn small(preset: Preset) -> RunSettings {
    let mut settings = preset.settings();
    let simulation = settings.simulation_mut().unwrap();
    simulation.sensor.scale = "10x6_3x18".parse().unwrap();
    (
        simulation.samples,
        simulation.validation_samples,
        simulation.test_samples,
    ) = (200, 50, 50);
    (settings.hidden, settings.training.stopping.epochs) = (6, 40);
    settings
}

fn main() {
    fs::create_dir_all(PICTURES).unwrap();
    let mut run = Run::prepare(small(Preset::Paper)).unwrap();
    while run.step().is_none() {}
    let (history, stages) = (run.leader().history(), run.leader().stages());
    draw("loss", loss_figure(history, stages, run.leader().best_epoch()));
    draw("state", training_state_figure(history, stages));
    let runs = [Some(("A: first run", history)), Some(("B: second run", &history[..20]))];
    draw("compared", compared_losses_figure(runs));
    let decoupled = run.decouple_test();
    let pairs = value_pairs(run.test(), &decoupled, None);
    draw("histogram", histogram_figure(&pairs, Decoded::Nodes));
    let line = RegressionLine::of(pairs.iter().copied());
    let regression = regression_figure((pairs.len(), &|pair| pairs[pair]), &line, Decoded::Nodes);
    draw("regression", regression);
    let file = NetworkFile::from_run(&run, None).unwrap();
    let report = RunReport {
        name: Some("gallery"),
        file: &file,
        defect: None,
        decoders: &[],
        test: run.test(),
    };
    report.save(&Path::new(PICTURES).join("print-report.html")).unwrap();

    let xy = |node: usize| (8.0 + (node / 6) as f64, 3.0 + 2.0 * (node % 6) as f64);
    let dent = |node: usize| 5.0 - 0.9 * (-0.1 * ((xy(node).0 - 12.0).powi(2) + (xy(node).1 - 8.0).powi(2))).exp();
    let nodes: Vec<DVec3> = (0..60)
        .map(|node| DVec3::new(xy(node).0, xy(node).1, dent(node)))
        .collect();
    let wobble = |node: &DVec3| node.with_z(node.z + 0.05 * (3.0 * node.x + node.y).sin());
    let decoded: Vec<DVec3> = nodes.iter().map(wobble).collect();
    draw("nodes", node_figure(&nodes, Some(&decoded), Some(&[0.1; 60]), 6));
    let rows: Vec<f64> = (0..10).map(|row| 8.0 + f64::from(row)).collect();
    let columns: Vec<f64> = (0..6).map(|node| 3.0 + 2.0 * f64::from(node)).collect();
    let map = Arc::new(SurfaceMap::new(&rows, &columns).unwrap());
    let errors: Vec<DVec3> = nodes.iter().zip(&decoded).map(|(a, d)| a.with_z(d.z - a.z)).collect();
    let surfaces = [
        Surface::through("Actual", &map, nodes.clone(), Quantity::Height, 4.0..=5.0),
        Surface::through("Decoupled", &map, decoded.clone(), Quantity::Height, 4.0..=5.0),
        Surface::through("Error", &map, errors, Quantity::Error, -0.05..=0.05),
    ];
    let section = Section {
        line: SectionLine::RowWire(4),
        at_mm: 12.0,
    };
    let read: Vec<usize> = (0..10).collect();
    let of_section = section_figure(&section, &read, &surfaces[0], Some(&surfaces[1]));
    draw("section", of_section);
    for mode in [ViewMode::ThreeD, ViewMode::Top] {
        let figure = SurfaceFigure {
            surfaces: surfaces.clone().map(|surface| Surface { mode, ..surface }).into(),
            marked_node: Some(27),
            section: Some(section),
            ..SurfaceFigure::default()
        };
        draw(&format!("surfaces-{mode:?}"), figure);
    }
    let beyond = Surface {
        range: 4.4..=4.9,
        ..surfaces[0].clone()
    };
    draw(
        "plateau",
        SurfaceFigure {
            surfaces: vec![beyond],
            ..SurfaceFigure::default()
        },
    );

    for table in [
        PaperTable::HiddenNodes,
        PaperTable::CrossValidation,
        PaperTable::ArrayScales,
    ] {
        let figure = experiment_figure(&ExperimentResults::new(table.experiment()));
        draw(&format!("table-{table:?}"), figure);
    }
    let mut sweep = PaperTable::ArrayScales.experiment();
    sweep.second_axis = Some(Axis::integers(AxisKind::Hidden, [6, 8, 10, 12]));
    let Figure::HeatMap(mut sweep) = experiment_figure(&ExperimentResults::new(sweep)) else {
        panic!("two axes");
    };
    sweep.values = Array2::from_shape_fn(sweep.values.dim(), |(row, column)| match (row, column) {
        (3, 2) => f64::NAN,
        _ => 0.3 * (1.0 + row as f64) * 3_f64.powi(column as i32),
    });
    draw("sweep", *sweep);
    let drops = Array2::from_shape_fn((10, 18), |(row, column)| {
        4.0 * (-0.1 * ((row as f64 - 4.0).powi(2) + (column as f64 - 9.0).powi(2))).exp()
    });
    draw("readings", readings_figure(drops, &read, 4.0));

    let settings = small(Preset::Paper);
    let row = |row| {
        let sensor = &settings.simulation().unwrap().sensor;
        Identifiability::of_row(sensor, row, &[DVec3::Z * 0.3; 6], Axes::Z, RelativeNoise::default()).unwrap()
    };
    let rows: Vec<_> = (0..10).map(row).collect();
    draw("singular-values", singular_values_figure(&rows, 2, 0.001));
    let mut points = Vec::new();
    for preset in Preset::ALL {
        let settings = small(preset);
        let sets = Setup::from(settings).sets("".as_ref(), &Job::UNINTERRUPTED, &mut |_| ());
        let kinds = [
            DecoderKind::Mean,
            DecoderKind::Ridge,
            DecoderKind::Network,
            DecoderKind::Newton,
        ];
        let on_point = |_, point: Result<TradeOffPoint, _>, _: Option<&_>| {
            points.push(TradeOffPoint {
                preset: Some(preset),
                ..point.unwrap()
            });
        };
        measure_trade_off(
            &settings,
            &sets.unwrap().sets,
            &[3, 6],
            &kinds,
            &Job::UNINTERRUPTED,
            on_point,
        )
        .unwrap();
    }
    let noise = Some(0.0);
    draw(
        "trade-off",
        trade_off_figure(&TradeOffLevel { noise, points }, &TradeOffLimits::default()),
    );

    let channels = ["x", "y", "force"].map(|name| Channel::new(name, Some(if name == "force" { "N" } else { "mm" })));
    let values = Array2::from_shape_fn((200, 3), |(sample, target)| {
        (0.05 * sample as f64 + target as f64).sin()
    });
    let actual = &values + 0.1;
    let series = TimeSeries {
        targets: &channels,
        axis: PlotAxis::linear("time (s)"),
        places: &Vec::from_iter((0..200).map(|at| 0.05 * f64::from(at))),
        gaps: &[100],
        decoded: values.view(),
        actual: Some(actual.view()),
        intervals: None,
    };
    draw("over-time", series.figure(0..3, &(0.0..=10.0)));
    let targets = Array2::from_shape_fn((900, 2), |(sample, axis)| [sample % 30, sample / 30][axis] as f64 / 3.0);
    let answers = targets.mapv(|value| value + 0.3 * (value * 2.0).sin());
    let of_positions = position_error_map(targets.view(), answers.view(), ["x", "y"], Some("mm"));
    draw("position-errors", of_positions.unwrap());
}
