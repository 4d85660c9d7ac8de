use super::{Cell, Table, TableColumn, format_number, format_percent, table::cell};
use crate::import::{Recording, SetupSets};
use decoupler_core::{
    dataset::{Dataset, Seed, SplitBy},
    evaluation::{
        Coverage, DecoderReport, ErrorMeasure, ErrorRow, ErrorTable, Errors, HalfWidth, Intervals, Scores,
        TargetErrors, TestErrors,
        auto::{AutoRecord, Tried, TriedModel},
        recorded::{
            Determinacy, Determination, Findings, TargetFindings, Undetermined, channel_remarks, target_remarks,
        },
    },
    problem::{Channel, Problem, TargetPosition},
    training::EpochRecord,
};

/// Returns the error table: a row for each decoder and baseline; for a recording, a row for each of them and each
/// target.
pub fn error_table(tables: &[ErrorTable]) -> Table {
    let has_targets = tables.iter().any(|table| table.target.is_some());
    let of_row = |table: &ErrorTable, row: &ErrorRow| {
        let target = || table.target.as_ref().map_or(String::new(), Channel::title);
        let target = has_targets.then(|| cell(("target", "Target", ""), target()));
        let mut cells = Vec::from_iter(target);
        cells.push(cell(("decoupler", "Decoder", ""), row.name));
        let errors = table.measures.iter().zip(&row.errors);
        cells.extend(errors.map(|(measure, error)| error_cell(*measure, *error)));
        cells
    };
    let rows = { tables.iter() }.flat_map(|table| table.rows.iter().map(move |row| of_row(table, row)));
    Table::of_rows(rows)
}

/// Returns the table of measured decoders: for an array a row for each, and the `model_based` errors if they exceed
/// rounding errors; for a recording a row for each decoder and target.
pub fn decoder_table(problem: &Problem, reports: &[DecoderReport], model_based: Option<&TestErrors>) -> Table {
    let name = |report: &DecoderReport| cell(DECODER, report.kind.name(report.precision));
    if !problem.has_nodes() {
        let row = |report: &DecoderReport, target: &Channel, errors: &TargetErrors| {
            let measures = [ErrorMeasure::Rmse, ErrorMeasure::R2, ErrorMeasure::RangePercent];
            let mut cells = vec![name(report), cell(("target", "Target", ""), target.title())];
            cells.extend(measures.map(|measure| error_cell(measure, measure.of_target(errors))));
            cells.push(cell(FRAME, report.frame_us));
            cells.push(cell(("fit_seconds", "fit", "s"), report.fit_seconds));
            cells
        };
        return Table::of_rows(reports.iter().flat_map(|report| {
            let targets = problem.targets.iter().zip(report.errors.targets());
            targets.map(move |(target, errors)| row(report, target, errors))
        }));
    }
    let model_based = model_based.and_then(TestErrors::nodes);
    let model_based = model_based.filter(|errors| !errors.is_rounding());
    let row = |name: (TableColumn, Cell), errors: Option<&Errors>, report: Option<&DecoderReport>| {
        let mut cells = vec![
            name,
            error_cell(ErrorMeasure::ZPercent, errors.and_then(|errors| errors.z_percent)),
            error_cell(ErrorMeasure::ZMm, errors.map(|errors| errors.z_mm)),
        ];
        cells.extend(model_based.map(|exact| cell(TIMES, errors.and_then(|errors| errors.times(exact)))));
        cells.push(cell("residual", report.and_then(|report| report.residual)));
        cells.push(cell(FRAME, report.map(|report| report.frame_us)));
        cells
    };
    let rows = { reports.iter() }.map(|report| row(name(report), report.errors.nodes(), Some(report)));
    Table::of_rows(rows.chain(model_based.map(|errors| row(cell(DECODER, "model-based"), Some(errors), None))))
}

/// A column of a table for readers: name in files, heading and unit.
type Column = (&'static str, &'static str, &'static str);

pub(super) const DECODER: Column = ("decoder", "Decoder", "");
pub(super) const TIMES: Column = ("times_model_based", "times model-based", "");
pub(super) const FRAME: Column = ("frame_us", "a frame", "µs");

/// Measure by which the errors of an array, or of a recording, are compared.
pub(super) fn percent_of(is_array: bool) -> ErrorMeasure {
    match is_array {
        true => ErrorMeasure::ZPercent,
        false => ErrorMeasure::RangePercent,
    }
}

/// Returns an error with its column.
pub(super) fn error_cell(measure: ErrorMeasure, error: Option<f64>) -> (TableColumn, Cell) {
    let (heading, unit) = measure.heading();
    let value = match measure {
        ErrorMeasure::R2 => Cell::R2(error),
        _ => error.into(),
    };
    cell((measure.field(), heading, unit), value)
}

/// Definitions of the columns of [`search_table`].
const SEARCH_MEANINGS: [&str; 8] = [
    "Weight in the answer: the convex combination with the lowest error of held-out answers.",
    "Quantity, memory and scaling of the inputs.",
    "Training mean, ridge, kernel ridge, or networks × hidden nodes and their training method; * marks the network that is \
     trained.",
    "Weights with which the trainings begin: random, or ridge regression with random weights added.",
    "Root mean square error of held-out answers in cross-validation, relative to the standard deviation of each target: \
     100 % for always answering the mean.",
    "Standard error of the error, from the differences between folds.",
    "Epoch with the lowest error, at which training stops; + if the budget cut off the candidate before.",
    "Estimated time on one core, counted against the budget.",
];

/// Returns the candidates of a search as a table; the choice is marked.
pub fn search_table(record: &AutoRecord) -> Table {
    let row = |(place, tried): (usize, &Tried)| {
        let share = match tried.share > 0.0 {
            true => Cell::from(100.0 * tried.share),
            false => "".into(),
        };
        let mark = if place == record.chosen { "*" } else { "" };
        let cut_off = if tried.is_cut_off { "+" } else { "" };
        let (begin, epochs) = match tried.model {
            TriedModel::Network { begin, epochs, .. } => (begin.to_string(), format!("{epochs}{cut_off}")),
            _ => Default::default(),
        };
        vec![
            cell(("share_percent", "share", "%"), share),
            cell(("features", "inputs", ""), tried.features()),
            cell("model", format!("{}{mark}", tried.model)),
            cell(("begin", "begins at", ""), begin),
            cell(("error_percent", "error", "%"), 100.0 * tried.error),
            cell(("standard_error_percent", "±", "%"), 100.0 * tried.standard_error),
            cell("epochs", epochs),
            cell(("seconds", "time", "s"), tried.seconds),
        ]
    };
    let mut table = Table::of_rows(record.tried.iter().enumerate().map(row));
    for (column, meaning) in table.columns.iter_mut().zip(SEARCH_MEANINGS) {
        column.meaning = meaning;
    }
    table
}

/// Describes how the settings were chosen, in one sentence.
pub fn describe_search(record: &AutoRecord) -> String {
    format!(
        "Answer chosen from {} candidates by cross-validation on {} of the training samples{}; {:.0} s of one core and {:.0} s of \
         training within a budget of {} s (*: the network that is trained)",
        record.tried.len(),
        match record.by {
            SplitBy::Time => format!("{} blocks of time", record.folds),
            SplitBy::Group => format!("{} sets of groups", record.folds),
            SplitBy::Random => format!("{} random parts", record.folds),
        },
        record.combined.map_or(String::new(), |error| format!(
            ", error of the combination {}",
            format_percent(100.0 * error)
        )),
        record.seconds(),
        record.training_s,
        record.budget_s
    )
}

/// Returns the errors of every epoch.
pub fn loss_table(history: &[EpochRecord]) -> Table {
    let row = |record: &EpochRecord| {
        vec![
            cell("epoch", record.epoch),
            cell("training_mse", record.training_mse),
            cell("validation_mse", record.validation_mse),
            cell("test_mse", record.test_mse),
            cell("gradient_norm", record.gradient_norm),
            cell("parameter", record.parameter),
            cell("effective_parameters", record.effective_parameters),
        ]
    };
    Table::of_rows(history.iter().map(row))
}

/// Warns of targets that the readings explain little of or that could not be judged; `measured` has an entry for each target.
pub fn describe_determinacy(
    targets: &[Channel],
    measured: &[Result<Determination, Undetermined>],
    is_combined: bool,
) -> Vec<String> {
    let explains = match is_combined {
        true => "the chosen combination explains",
        false => "the network explains",
    };
    let of = |(target, measured): (&Channel, &Result<Determination, Undetermined>)| match measured {
        Err(cause) => Some(format!("{}: {cause}", target.name)),
        Ok(found) if found.determinacy() == Determinacy::Determined => None,
        Ok(found) => Some(found.sentence(&target.name, explains)),
    };
    targets.iter().zip(measured).filter_map(of).collect()
}

/// Describes the half-widths of the targets whose intervals vary with the answer; `None` if there are none.
pub fn describe_half_widths(targets: &[Channel], intervals: &Intervals) -> Option<String> {
    let describe = |(target, half_width): (&Channel, &Option<HalfWidth>)| {
        let half_width = half_width.as_ref()?;
        let widths = || half_width.by_answer.iter().map(|point| point[1]);
        let (min, max) = (widths().reduce(f64::min)?, widths().reduce(f64::max)?);
        let [min, max, constant] = [min, max, half_width.constant].map(format_number);
        let name = &target.name;
        Some(format!(
            "{name} {min} to {max} (one for all answers together: {constant})"
        ))
    };
    let described: Vec<String> = targets.iter().zip(&intervals.targets).filter_map(describe).collect();
    (!described.is_empty()).then(|| {
        format!(
            "The half-width above is the mean over the test samples. It varies with the answer: {}. decode writes that of each \
             answer, and exports contain the one for all answers.",
            described.join(", ")
        )
    })
}

/// Warns of the targets whose intervals contain significantly fewer test samples than stated, with cause and remedy.
pub fn describe_coverage(targets: &[Channel], coverage: &[Option<Coverage>]) -> Vec<String> {
    let describe = |(target, coverage): (&Channel, &Option<Coverage>)| {
        let coverage = coverage.as_ref().filter(|of| of.is_too_low() || of.is_too_high())?;
        let cause = if coverage.is_too_high() {
            "they are too wide for these samples: part of the training recording was answered much worse than this test part; \
             look for a stretch of it that differs"
                .to_owned()
        } else if coverage.bias.abs() > 0.5 * coverage.half_width {
            let [bias, half_width] = [coverage.bias, coverage.half_width].map(format_number);
            format!(
                "the test part is offset from the training part (mean error {bias}, half-width {half_width}): re-zero the \
                 sensor, or record training data closer to the time of use"
            )
        } else {
            "the test part differs from the training part: record training data that cover its conditions, or split by \
             group"
                .to_owned()
        };
        let [low, high] = coverage.expected;
        let [share, low, high] = [coverage.share, low, high].map(|share| format!("{:.0}", 100.0 * share));
        let name = &target.name;
        Some(format!(
            "the 90 % intervals of {name} contain {share} % of the test samples (expected {low} to {high} %): {cause}"
        ))
    };
    targets.iter().zip(coverage).filter_map(describe).collect()
}

/// Describes the positions of targets: their number, and the grid if they form one; `None` if no target has a position.
pub fn describe_positions(positions: &[TargetPosition]) -> Option<String> {
    let count = match positions.len() {
        0 => return None,
        1 => "1 target has a position".to_owned(),
        count => format!("{count} targets have positions"),
    };
    Some(match TargetPosition::lattice(positions) {
        Some(([x_mm, y_mm], _)) => format!("{count}: a grid of {} × {}", x_mm.len(), y_mm.len()),
        None => format!("{count}, scattered over the skin"),
    })
}

/// Describes how much of a target the readings explain, judged by the better of ridge and kernel ridge regression.
pub fn describe_target(name: &str, found: &TargetFindings) -> String {
    match found.best() {
        Some((best, _)) if found.kernel.is_some() => best.sentence(name, "ridge and kernel ridge regression explain"),
        Some((best, _)) => best.sentence(name, "ridge regression explains"),
        None => {
            let cause = found.ridge.err();
            let cause = cause.map_or_else(|| "nothing can be judged".to_owned(), |cause| cause.to_string());
            format!("{name}: {cause}")
        }
    }
}

/// Warns of readings that may be leaks, and of changes of the targets that were not tested, in the samples of a recording.
pub fn describe_samples(sets: &SetupSets) -> Vec<String> {
    let Some(recordings) = &sets.recordings else {
        return Vec::new();
    };
    let (training, test) = (&sets.sets.split.training, &sets.sets.test);
    let Recording { problem, set, .. } = &recordings.training;
    let (inputs, targets) = (&problem.features(), &problem.targets);
    let division = recordings.recorded.plan.division;
    let mut warnings = target_remarks(training, division.by, inputs, targets);
    // In time, the first samples are those for testing unless they are for training.
    let trained = division.divide(set, false, Seed(0)).map(|parts| parts.training);
    let tests_first = trained.is_ok_and(|samples| samples.first() != Some(&0));
    if division.by == SplitBy::Time && recordings.test.is_none() && tests_first {
        let text = "all changes of the targets are in the last part of the recording, so that the first part was held out \
                    for testing in its place";
        warnings.push(text.to_owned());
    }
    let is_constant = |set: &Dataset, target: usize| {
        let values = set.targets();
        let values = values.column(target);
        values.iter().all(|value| *value == values[0])
    };
    for (target, Channel { name, .. }) in targets.iter().enumerate() {
        if is_constant(training, target) && !is_constant(test, target) {
            warnings.push(format!(
                "{name} is constant in the training samples, so that the network always answers this constant: record its \
                 changes, or split another way"
            ));
        }
    }
    warnings
}

/// Returns remarks on the channels and targets of a recording that is divided by `by`, and on possible leaks.
pub fn describe_warnings(recording: &Recording, by: SplitBy, findings: &Findings) -> Vec<String> {
    let Recording { problem, set, .. } = recording;
    let mut warnings = channel_remarks(set, by, &problem.features(), &problem.targets);
    warnings.extend(findings.record.leaks(&problem.targets));
    warnings
}

/// Warns of the targets on which the network is worse than ridge, or no better to three digits; `None` if there are none.
///
/// The errors show that ridge is the better choice; they do not show why.
pub fn describe_worse_than_ridge(problem: &Problem, scores: &Scores) -> Option<String> {
    /// Maximum number of targets that are named; a skin can have hundreds.
    const NAMED: usize = 3;
    let errors = scores.network.targets().iter().zip(scores.baselines.linear.targets());
    let all = problem.targets.iter().zip(errors);
    // R² is undefined for a target that is constant in the test samples.
    let worse = all.filter(|(_, (network, ridge))| network.r2.is_some() && network.rmse > ridge.rmse);
    let mut comparison = "no better than";
    let mut targets = Vec::new();
    for (Channel { name, .. }, (network, ridge)) in worse {
        let (of_network, of_ridge) = (format_number(network.rmse), format_number(ridge.rmse));
        targets.push(if of_network == of_ridge {
            format!("{name} (RMSE {of_ridge} for both)")
        } else {
            comparison = "worse than";
            format!("{name} (RMSE {of_network}, ridge {of_ridge})")
        });
    }
    let more = match targets.len() {
        0 => return None,
        count if count > NAMED + 1 => {
            targets.truncate(NAMED);
            format!(" and {} more", count - NAMED)
        }
        _ => String::new(),
    };
    let targets = targets.join(", ");
    Some(match scores.network_alone {
        None => format!(
            "the network is {comparison} ridge regression for {targets}{more}: use ridge, or compare other settings by \
             cross-validation"
        ),
        Some(_) => format!(
            "on these test samples, the chosen combination is {comparison} ridge regression for {targets}{more}, though not \
             in cross-validation on the training samples"
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoupler_core::dataset::Simulation;

    #[test]
    fn an_error_table_has_gaps_where_the_paper_gives_no_error() {
        let row = ErrorRow {
            name: "published",
            errors: vec![Some(2.28), Some(0.22), Some(2.39e-12), None, None, None],
        };
        let problem = Problem {
            sensor: Some(Simulation::default()),
            ..Problem::default()
        };
        let mut errors = ErrorTable::of_errors(&problem, &[]);
        errors[0].rows.push(row);
        let mut table = Vec::new();
        error_table(&errors).write_csv(&mut table).unwrap();
        assert_eq!(
            String::from_utf8(table).unwrap(),
            "decoupler,z_percent,x_percent,y_percent,z_mm,z_full_scale_percent,worst_mm\n\
             published,2.28,0.22,2.39e-12,,,\n"
        );
    }

    #[test]
    fn loss_curves_keep_every_bit() {
        let record = EpochRecord {
            epoch: 3,
            training_mse: 0.1 + 0.2,
            validation_mse: None,
            test_mse: Some(1e-300),
            gradient_norm: f64::INFINITY,
            parameter: 1e-3,
            effective_parameters: None,
            validation_failures: 0,
        };
        let mut table = Vec::new();
        loss_table(&[record]).write_csv(&mut table).unwrap();
        let text = String::from_utf8(table).unwrap();
        assert_eq!(text.lines().nth(1), Some("3,0.30000000000000004,,1e-300,,0.001,"));
    }
}
