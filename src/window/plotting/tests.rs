//! Figures on the screen and in print show the same content.

use std::collections::BTreeSet;

use eframe::egui::{Color32, Context, Pos2, RawInput, Rect, Shape, Ui, pos2, vec2};
use resvg::usvg::roxmltree::Document;

use super::*;
use crate::window::theme;
use decoupler_core::{
    dataset::SplitBy,
    decoupling::DecoderKind,
    evaluation::{
        CrossValidation, Preset, Run, RunSets, RunSettings, TradeOffPoint,
        experiments::{Axis, AxisKind, Experiment, ExperimentResults, PaperTable, TrialSamples, run_experiments},
        measure_trade_off,
    },
    identifiability::Identifiability,
    job::Job,
    machine::MemoryBudget,
    sensor::{Axes, RelativeNoise},
    training::EpochRecord,
};
use decoupler_files::figure::{
    Decoded, EpochOutline, Figure, RegressionLine, TradeOffCost, TradeOffLevel, TradeOffLimits, compared_losses_figure,
    experiment_figure, histogram_figure, loss_figure, node_figure, regression_figure, singular_values_figure,
    trade_off_figure, training_state_figure, value_pairs,
};

/// Texts and numbers of marks in a picture.
#[derive(Debug, Default, PartialEq)]
struct Seen {
    /// Discs, rings and dots.
    circles: usize,
    /// Solid lines of at least [`LONG`] points.
    curves: usize,
    /// Texts, without the numbers at ticks.
    words: BTreeSet<String>,
}

const LONG: usize = 12;

impl Seen {
    fn read(&mut self, text: &str) {
        let is_number = text.replace('−', "-").parse::<f64>().is_ok();
        if !is_number && !text.trim().is_empty() {
            self.words.insert(text.trim().to_owned());
        }
    }

    fn look_at(&mut self, shape: &Shape) {
        match shape {
            Shape::Vec(shapes) => shapes.iter().for_each(|shape| self.look_at(shape)),
            Shape::Circle(_) => self.circles += 1,
            Shape::Path(path) if !path.closed && path.points.len() >= LONG => self.curves += 1,
            Shape::Text(text) => self.read(text.galley.text()),
            _ => {}
        }
    }
}

fn on_screen(figure: &Figure) -> Seen {
    let mut seen = Seen::default();
    shapes_on_screen(figure, |shape| seen.look_at(shape));
    seen
}

/// Calls `look` with every shape that the window draws for a figure.
fn shapes_on_screen(figure: &Figure, mut look: impl FnMut(&Shape)) {
    let ctx = Context::default();
    theme::install(&ctx, true);
    // The positions of the axes are known after the first frame.
    for frame in 0..3 {
        let input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, vec2(1400.0, 600.0))),
            ..RawInput::default()
        };
        let draw = |ui: &mut Ui| match figure {
            Figure::Plots(plots) => {
                plots_ui(ui, "figure", plots);
            }
            Figure::HeatMap(map) => {
                cells_ui(ui, "map", map, (&[], &[], Color32::WHITE));
            }
            Figure::Surfaces(_) => unreachable!("surfaces have tests of their own"),
        };
        let output = ctx.run_ui(input, draw);
        if frame == 2 {
            output.shapes.iter().for_each(|shape| look(&shape.shape));
        }
        output.drop_without_applying_deltas();
    }
}

fn in_print(figure: &Figure) -> Seen {
    let picture = figure.draw();
    let document = Document::parse(picture.svg()).unwrap();
    let mut seen = Seen::default();
    for element in document.descendants().filter(|node| node.is_element()) {
        match element.tag_name().name() {
            "circle" => seen.circles += 1,
            // On the screen, a dashed line is drawn as separate dashes.
            "path" if element.has_attribute("stroke") && !element.has_attribute("stroke-dasharray") => {
                let lines = element.attribute("d").unwrap_or_default().split('M');
                seen.curves += lines.filter(|line| line.split(' ').count() >= LONG).count();
            }
            "text" => seen.read(element.text().unwrap_or_default()),
            _ => {}
        }
    }
    seen
}

#[track_caller]
fn same(name: &str, figure: impl Into<Figure>) -> Seen {
    let figure = figure.into();
    let (mut screen, mut print) = (on_screen(&figure), in_print(&figure));
    // Labels of points are left out where there is no room.
    if let Figure::Plots(plots) = &figure {
        let points = plots
            .plots
            .iter()
            .flat_map(|plot| &plot.series)
            .flat_map(|series| &series.points);
        for label in points.filter_map(|point| point.label.as_ref()) {
            screen.words.remove(label);
            print.words.remove(label);
        }
    }
    assert_eq!(screen, print, "{name}: the window, then print");
    screen
}

fn small(preset: Preset) -> RunSettings {
    let mut settings = preset.settings();
    settings.simulation_mut().unwrap().sensor.scale = "4x4_2x12".parse().unwrap();
    (
        settings.simulation_mut().unwrap().samples,
        settings.simulation_mut().unwrap().validation_samples,
    ) = (80, 20);
    (settings.simulation_mut().unwrap().test_samples, settings.hidden) = (20, 3);
    settings.training.stopping.epochs = 30;
    settings
}

fn results(mut experiment: Experiment) -> ExperimentResults {
    experiment.base.training.stopping.epochs = 2;
    experiment.base.hidden = 2;
    (experiment.seeds, experiment.base.starts) = (2, 1);
    let mut results = ExperimentResults::new(experiment.clone());
    let threads = std::num::NonZero::<usize>::MIN;
    let record =
        |finished: decoupler_core::evaluation::experiments::Finished| results.record(finished.cell, finished.outcome);
    run_experiments(
        std::slice::from_ref(&experiment),
        &TrialSamples::Drawn(MemoryBudget::UNLIMITED),
        threads,
        || false,
        record,
    )
    .unwrap();
    results
}

#[test]
fn figures_of_a_training_are_the_same_on_screen_and_in_print() {
    let mut run = Run::prepare(small(Preset::Paper)).unwrap();
    while run.step().is_none() {}
    let (history, stages) = (run.leader().history(), run.leader().stages());
    let loss = same("loss", loss_figure(history, stages, run.leader().best_epoch()));
    assert_eq!(loss.curves, 3);
    assert!(loss.words.contains("mse (scaled)") && loss.words.contains("best weights"));
    let state = same("training state", training_state_figure(history, stages));
    assert!(state.words.contains("gradient") && state.words.contains("validation failures"));
    let runs = [("A: first run", history), ("B: second run", &history[..20])];
    let compared = same("compared losses", compared_losses_figure(runs.map(Some)));
    assert!(compared.words.contains("B: second run, test"), "{compared:?}");

    let decoupled_mm = run.decouple_test();
    let pairs_mm = value_pairs(run.test(), &decoupled_mm, None);
    let line = RegressionLine::of(pairs_mm.iter().copied());
    same("histogram", histogram_figure(&pairs_mm, Decoded::Nodes));
    let regression = same(
        "regression",
        regression_figure((pairs_mm.len(), &|pair| pairs_mm[pair]), &line, Decoded::Nodes),
    );
    // One dot per node, and one in the legend.
    assert_eq!(regression.circles, pairs_mm.len() + 1);
    assert!(regression.words.iter().any(|word| word.starts_with("Correlation R = ")));
    let nodes: Vec<_> = pairs_mm.iter().map(|pair| glam::DVec3::Z * pair.0).collect();
    let spread_mm = vec![0.1; nodes.len()];
    let figure = node_figure(&nodes, Some(&nodes), Some(&spread_mm), 4);
    assert_eq!(same("nodes", figure).circles, nodes.len() + 1);
}

#[test]
fn figures_of_experiments_are_the_same_on_screen_and_in_print() {
    let mut table_1 = PaperTable::HiddenNodes.experiment();
    table_1.axis = Axis::integers(AxisKind::Hidden, [2, 10]);
    let hidden = same("Table 1", experiment_figure(&results(table_1.clone())));
    assert!(
        hidden.words.contains("Eq. (12)") && hidden.words.contains("Eq. (13)"),
        "{hidden:?}"
    );
    let mut table_2 = PaperTable::CrossValidation.experiment();
    table_2.axis = Axis::integers(AxisKind::Samples, [40, 100]);
    table_2.cross_validation = Some(CrossValidation {
        folds: 2,
        repeats: 2,
        by: SplitBy::Random,
    });
    // Two cells of four trials, each with an error of Z and of X; the error of Y may be exactly 0.
    assert!(same("Fig. 5", experiment_figure(&results(table_2))).circles >= 2 * 2 * 4 + 2);
    let published = ExperimentResults::new(PaperTable::ArrayScales.experiment());
    assert!(
        same("Table 3", experiment_figure(&published))
            .words
            .contains("10×8_4×24")
    );
    table_1.second_axis = Some(Axis::integers(AxisKind::Samples, [40, 50]));
    let map = same("sweep", experiment_figure(&results(table_1)));
    assert!(map.words.contains("median Z error (%)") && map.words.contains("samples"));
}

#[test]
fn figures_of_decoders_and_rows_are_the_same_on_screen_and_in_print() {
    let mut points = Vec::new();
    for preset in Preset::ALL {
        let kinds = [DecoderKind::Ridge, DecoderKind::Network, DecoderKind::Newton];
        let settings = small(preset);
        let sets = RunSets::draw(&settings, MemoryBudget::UNLIMITED, &Job::UNINTERRUPTED).unwrap();
        let on_point = |_, point: Result<TradeOffPoint, _>, _: Option<&_>| {
            let preset = Some(preset);
            let mut point = point.unwrap();
            // Times that differ clearly: a name that would cover another one is left out.
            point.report.frame_us = 2.0_f64.powi(points.len() as i32);
            point.training_seconds = 1.0 + points.len() as f64;
            points.push(TradeOffPoint { preset, ..point });
        };
        measure_trade_off(&settings, &sets, &[3], &kinds, &Job::UNINTERRUPTED, on_point).unwrap();
    }
    let level = TradeOffLevel {
        noise: Some(0.0),
        points,
    };
    let limits = TradeOffLimits {
        percent: 50.0,
        microseconds: 1e9,
    };
    let figure = trade_off_figure(&level, &limits);
    // A click on a point marks the decoder that it shows.
    for (point, item) in { figure.plots[0].series.iter() }
        .flat_map(|series| &series.points)
        .filter_map(|of| Some((of, of.item?)))
    {
        assert_eq!((point.x, point.y), TradeOffCost::Decoding.of(&level.points[item]));
    }
    let trade_off = same("trade-off", figure);
    let note = "Discs: paper preset, diamonds: best preset, hollow: 32 bits.";
    for word in ["Network", note, "Pareto front"] {
        assert!(trade_off.words.contains(word), "{word}: {trade_off:?}");
    }
    let settings = small(Preset::Paper);
    let pressed = [glam::DVec3::Z * 0.3; 4];
    let row = |row| {
        Identifiability::of_row(
            &settings.simulation().unwrap().sensor,
            row,
            &pressed,
            Axes::Z,
            RelativeNoise::default(),
        )
        .unwrap()
    };
    let rows: Vec<_> = (0..4).map(row).collect();
    let singular_values = same("singular values", singular_values_figure(&rows, 2, 0.01));
    assert_eq!(singular_values.circles, rows[2].unknowns() + 1);
}

/// The chart of a million epochs has a few points per pixel on screen, and every peak keeps its height.
#[test]
fn a_million_epochs_are_drawn_by_min_and_max_per_pixel() {
    const PEAKS: [usize; 3] = [31_337, 500_000, 999_983];
    let mse = |epoch: usize| match epoch {
        _ if PEAKS.contains(&epoch) => 80.0,
        _ if PEAKS.contains(&(epoch + 7)) => 1e-4,
        _ => 1.0 + 0.1 * (epoch as f64 * 0.01).sin(),
    };
    let history: Vec<EpochRecord> = (0..1_000_000)
        .map(|epoch| EpochRecord {
            epoch,
            training_mse: mse(epoch),
            validation_mse: None,
            test_mse: None,
            gradient_norm: 1.0,
            parameter: 1e-3,
            effective_parameters: None,
            validation_failures: 0,
        })
        .collect();
    let mut outline = EpochOutline::default();
    history.chunks(10_000).for_each(|records| outline.extend(records));
    let figure = Figure::from(loss_figure(outline.records(), &[], 0));
    let mut curves = Vec::new();
    shapes_on_screen(&figure, |shape| curves_of(shape, &mut curves));
    let curve = curves.iter().max_by_key(|points| points.len()).unwrap();
    assert!(
        (1300..4 * 1400).contains(&curve.len()),
        "{} points on 1400 pixels",
        curve.len()
    );
    let ends = |of: fn(&Pos2) -> f32, points: &[Pos2]| {
        let ends = points.iter().map(of);
        ends.fold((f32::MAX, f32::MIN), |(low, high), at| (low.min(at), high.max(at)))
    };
    let (top, bottom) = ends(|point| point.y, curve);
    // The curve spans the full width, so the positions of the epochs follow from its ends.
    let (from, to) = ends(|point| point.x, curve);
    for peak in PEAKS {
        let x = from + (to - from) * peak as f32 / 999_999.0;
        let near: Vec<Pos2> = curve
            .iter()
            .copied()
            .filter(|point| (point.x - x).abs() < 2.0)
            .collect();
        let (highest, lowest) = ends(|point| point.y, &near);
        assert!(
            highest < top + 0.5 && lowest > bottom - 0.5,
            "the peak of epoch {peak}: {near:?}"
        );
    }
}

/// Collects the points of all lines, and both edges of the bands that replace dense lines.
fn curves_of(shape: &Shape, curves: &mut Vec<Vec<Pos2>>) {
    match shape {
        Shape::Vec(shapes) => shapes.iter().for_each(|shape| curves_of(shape, curves)),
        Shape::Path(path) if !path.closed => curves.push(path.points.clone()),
        Shape::Band(band) => {
            let edges = band
                .points
                .iter()
                .flat_map(|point| [point.y.min, point.y.max].map(|y| pos2(point.x, y)));
            curves.push(edges.collect());
        }
        _ => {}
    }
}
