use std::time::Duration;

use decoupler_core::{
    decoupling::Precision,
    evaluation::{ErrorMeasure, RunSettings, TradeOffPoint, TrainingSize, Workload},
    machine::MemoryBudget,
    text::counted,
};

use super::{
    Cell, Table, format_duration,
    table::cell,
    tables::{DECODER, FRAME, TIMES, error_cell, percent_of},
};
use crate::{
    figure::{TradeOffCost, TradeOffLevel, point_name},
    machine::memory_budget,
};

/// Returns the table of all points of all levels with all their figures, for programs.
pub fn trade_off_points(levels: &[TradeOffLevel]) -> Table {
    let is_array = levels.iter().any(|level| level.noise.is_some());
    // A recording does not have these columns.
    let of_array = |name: &str, value: Cell| is_array.then(|| cell(name, value));
    let row = |noise: Option<f64>, point: &TradeOffPoint, on_decoding: bool, on_training: bool| {
        let report = &point.report;
        let (model_based, nodes) = (point.model_based.as_ref(), report.errors.nodes());
        let settings = &point.settings;
        let precision = match report.precision {
            Precision::Double => "f64",
            Precision::Single => "f32",
        };
        let hidden = point.hidden();
        let cells = [
            of_array("noise", noise.into()),
            of_array("preset", point.preset.map(|preset| preset.to_string()).into()),
            Some(cell("decoder", report.kind.to_string())),
            Some(cell("precision", precision)),
            Some(cell("hidden", hidden)),
            Some(cell("method", point.method().map(|method| method.short_name()))),
            of_array("samples", settings.simulation().map(|array| array.samples).into()),
            Some(cell("epochs", hidden.map(|_| settings.training.stopping.epochs))),
            Some(cell(percent_of(is_array).field(), report.errors.percent())),
            of_array("z_mm", nodes.map(|errors| errors.z_mm).into()),
            Some(cell("frame_us", report.frame_us)),
            Some(cell("training_s", point.training_seconds)),
            of_array("residual", report.residual.into()),
            of_array(
                "model_based_z_percent",
                model_based.map(|errors| errors.z_percent).into(),
            ),
            of_array("model_based_z_mm", model_based.map(|errors| errors.z_mm).into()),
            Some(cell("on_decoding_front", on_decoding.to_string())),
            Some(cell("on_training_front", on_training.to_string())),
        ];
        cells.into_iter().flatten().collect()
    };
    Table::of_rows(levels.iter().flat_map(|level| {
        let [decoding, training] = TradeOffCost::ALL.map(|cost| level.front(cost));
        let points = level.points.iter().zip(decoding).zip(training);
        points.map(move |((point, on_decoding), on_training)| row(level.noise, point, on_decoding, on_training))
    }))
}

/// Returns the table of the points of one level, fastest first, for readers.
pub fn trade_off_summary(level: &TradeOffLevel) -> Table {
    let mut points: Vec<&TradeOffPoint> = level.points.iter().collect();
    points.sort_by(|a, b| a.report.frame_us.total_cmp(&b.report.frame_us));
    let is_array = level.noise.is_some();
    // Ratios to rounding are meaningless.
    let has_ratio = points.iter().any(|point| point.to_model_based().is_some());
    let row = |point: &TradeOffPoint| {
        let errors = &point.report.errors;
        let mut cells = vec![
            cell(DECODER, point_name(point)),
            error_cell(percent_of(is_array), errors.percent()),
        ];
        let z_mm = || error_cell(ErrorMeasure::ZMm, errors.nodes().map(|errors| errors.z_mm));
        cells.extend(is_array.then(z_mm));
        cells.extend(has_ratio.then(|| cell(TIMES, point.to_model_based())));
        cells.push(cell(FRAME, point.report.frame_us));
        cells.push(cell(("training_s", "training time", "s"), point.training_seconds));
        cells
    };
    Table::of_rows(points.into_iter().map(row))
}

/// Describes the memory and time that a run will take on this machine. The first call measures its speed, which takes
/// about 20 ms.
pub fn describe_workload(workload: &Workload) -> String {
    let gigabytes = |bytes: u64| format!("{:.1} GB", bytes as f64 * 1e-9);
    let machine = match memory_budget() {
        MemoryBudget::System(bytes) | MemoryBudget::User(bytes) => format!(" of {}", gigabytes(bytes)),
        MemoryBudget::Assumed(_) => String::new(),
    };
    format!(
        "about {}{machine} of memory; on one thread about {} to draw the samples and {}; the figures of the decoders take \
         additional time",
        gigabytes(workload.bytes),
        format_duration(workload.drawing_time()),
        describe_epochs(workload)
    )
}

fn describe_epochs(workload: &Workload) -> String {
    let [epoch, all] = [workload.epoch_time(), workload.training_time()].map(format_duration);
    format!("{epoch} per epoch, {all} for {}", counted(workload.epochs, "epoch"))
}

/// Describes the time that a training on a recording will take on this machine, and if it is more than a minute, what
/// would take less; `None` if it is below ten seconds. The first call measures the speed of the machine, which takes
/// about 20 ms.
pub fn describe_recorded_workload(settings: &RunSettings, size: TrainingSize) -> Option<String> {
    const SHORT: Duration = Duration::from_secs(10);
    const LONG: Duration = Duration::from_secs(60);
    let workload = Workload::of(settings, size);
    let all_epochs = workload.training_time();
    if all_epochs < SHORT {
        return None;
    }
    let mut text = format!("on one thread about {}", describe_epochs(&workload));
    if all_epochs > LONG {
        let faster = workload.faster_methods(settings, size).into_iter();
        let faster = faster.map(|(method, time)| {
            let (name, time) = (method.short_name(), format_duration(time));
            format!("{method} ({name}) takes about {time}")
        });
        let faster = Vec::from_iter(faster.chain(["fewer hidden nodes or epochs take less".to_owned()]));
        text += &format!("; {}", faster.join(", "));
    }
    Some(text)
}

#[cfg(test)]
mod tests {
    use decoupler_core::{
        dataset::{Dataset, Split},
        decoupling::DecoderKind,
        evaluation::{Run, RunSets, measure_trade_off},
        scene::RowModel,
    };
    use ndarray::Array2;

    use super::*;
    use decoupler_core::job::Job;

    #[test]
    fn a_long_training_on_a_recording_is_announced_with_faster_methods() {
        let size = |inputs| TrainingSize {
            samples: 10_000,
            inputs,
            targets: 3,
            networks: 1,
        };
        let mut settings = RunSettings::measured(RowModel::Shared);
        assert_eq!(describe_recorded_workload(&settings, size(1)), None);
        settings.hidden = 24;
        let text = describe_recorded_workload(&settings, size(192)).unwrap();
        assert!(
            text.contains("for 300 epochs; ") && text.contains("(scg) takes about"),
            "{text}"
        );
    }

    #[test]
    fn points_of_a_recording_have_no_columns_of_a_sensor_model() {
        let set = |from: usize| {
            let readings = Array2::from_shape_fn((40, 2), |(row, channel)| {
                ((from + row) as f64 * [0.3, 0.7][channel]).sin()
            });
            let targets = Array2::from_shape_fn((40, 1), |(row, _)| readings[[row, 0]] * readings[[row, 1]]);
            Dataset::new(readings, targets, None, (0..40).collect()).unwrap()
        };
        let split = Split {
            training: set(0),
            validation: None,
        };
        let mut settings = RunSettings::measured(RowModel::Shared);
        settings.training.stopping.epochs = 3;
        let mut points = Vec::new();
        let keep = |_, point: Result<TradeOffPoint, _>, run: Option<&Run>| {
            let point = point.unwrap();
            let time = run.map(|run| run.wall_time().unwrap().as_secs_f64());
            assert!(
                time.is_none_or(|time| time == point.training_seconds),
                "that of the training"
            );
            points.push(point);
        };
        let kinds = [DecoderKind::Ridge, DecoderKind::Network];
        measure_trade_off(
            &settings,
            &RunSets::new(split, set(40)),
            &[2],
            &kinds,
            &Job::UNINTERRUPTED,
            keep,
        )
        .unwrap();
        let level = TradeOffLevel { noise: None, points };
        let fields = |table: &Table| Vec::from_iter(table.columns.iter().map(|column| column.field.clone()));
        let summary = trade_off_summary(&level);
        assert_eq!(
            fields(&summary),
            ["decoder", "percent_of_range", "frame_us", "training_s"]
        );
        assert_eq!(summary.columns[1].title(), "MAE (% of range)");
        let table = trade_off_points(&[level]);
        let expected = [
            "decoder",
            "precision",
            "hidden",
            "method",
            "epochs",
            "percent_of_range",
            "frame_us",
            "training_s",
            "on_decoding_front",
            "on_training_front",
        ];
        assert_eq!(fields(&table), expected);
        assert_eq!(table.rows.len(), 3, "ridge, and the network in two precisions");
        assert!(table.rows.iter().all(|row| row.len() == expected.len()));
    }
}
