use std::{hint::black_box, time::Instant};

use strum::{EnumMessage, VariantArray};

use super::{Coverage, Errors, PublishedErrors, Scores, TargetErrors, TestErrors, recorded::HysteresisLoop};
use crate::{
    dataset::Dataset,
    decoupling::{DecodeError, Decoder},
    numerics::median,
    problem::{Channel, Problem},
};

/// Error table with baselines and decoders as rows; the columns depend on the channels. Each target of a recording has
/// its table, and so have all targets together if they share a unit; all these tables have the same columns.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorTable {
    /// Target; `None` for the nodes of an array.
    pub target: Option<Channel>,
    /// Measures of error, one for each column.
    pub measures: &'static [ErrorMeasure],
    /// Rows: baselines, decoders, model-based and published figures.
    pub rows: Vec<ErrorRow>,
}

/// A row of an error table.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorRow {
    /// Name of the decoder or baseline.
    pub name: &'static str,
    /// Errors in the order of [`ErrorTable::measures`]; `None` where there is none: the paper reports only percentages
    /// of the coordinate.
    pub errors: Vec<Option<f64>>,
}

/// A measure of error: those of nodes, those of targets, and those of their intervals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, strum::EnumMessage, strum::VariantArray)]
pub enum ErrorMeasure {
    /// AveZerr, in percent.
    #[strum(message = "Mean |decoupled z − z| / |z| over samples and nodes, in percent of the coordinate (AveZerr)")]
    ZPercent,
    /// AveXerr, in percent.
    #[strum(message = "Mean |decoupled x − x| / |x| over samples and nodes, in percent of the coordinate (AveXerr)")]
    XPercent,
    /// AveYerr, in percent.
    #[strum(message = "Mean |decoupled y − y| / |y| over samples and nodes, in percent of the coordinate (AveYerr)")]
    YPercent,
    /// Mean |decoupled z − z|, in millimetres.
    #[strum(message = "Mean |decoupled z − z|, in millimetres")]
    ZMm,
    /// Mean |decoupled z − z|, in percent of the stroke.
    #[strum(message = "Mean |decoupled z − z|, in percent of the distance a node can travel")]
    ZStrokePercent,
    /// Largest |decoupled z − z|, in millimetres.
    #[strum(message = "Largest |decoupled z − z| of any node, in millimetres")]
    WorstMm,
    /// Root mean squared error, in the unit of the target.
    #[strum(message = "Root mean squared error, in the unit of the target")]
    Rmse,
    /// Mean absolute error, in the unit of the target.
    #[strum(message = "Mean absolute error, in the unit of the target")]
    Mae,
    /// Coefficient of determination R².
    #[strum(
        message = "Share of the target's variance that the answers explain: 1 is exact, 0 is no better than the mean"
    )]
    R2,
    /// Largest absolute error, in the unit of the target.
    #[strum(message = "Largest absolute error, in the unit of the target")]
    Worst,
    /// Mean absolute error in percent of the range of the target.
    #[strum(message = "Mean absolute error in percent of the range of the target")]
    RangePercent,
    /// Mean half-width of the intervals, in the unit of the target.
    #[strum(message = "Mean half-width of the 90 % intervals, in the unit of the target")]
    HalfWidth,
    /// Share of the samples within their intervals, in percent.
    #[strum(
        message = "Share of the test samples whose target is within its 90 % interval, in percent: about 90 if they are like the training samples"
    )]
    CoveragePercent,
}

/// Name of the row of the network.
const NETWORK: &str = "network";
/// Name of the row of the combination that a choice of settings found.
const CHOSEN: &str = "chosen";
/// Name of the row of the decoder that knows the sensor model.
const MODEL_BASED: &str = "model-based";

/// Name of the table of all targets.
const ALL_TARGETS: &str = "all targets";

impl ErrorMeasure {
    pub(super) const OF_NODES: &[Self] = Self::VARIANTS.split_at(Self::Rmse as usize).0;
    const OF_TARGETS_WITH_INTERVALS: &[Self] = Self::VARIANTS.split_at(Self::Rmse as usize).1;
    pub(super) const OF_TARGETS: &[Self] = Self::OF_TARGETS_WITH_INTERVALS.split_at(5).0;

    /// Name in files, heading, and fixed unit.
    fn names(self) -> (&'static str, &'static str, &'static str) {
        match self {
            Self::ZPercent => ("z_percent", "Z", "%"),
            Self::XPercent => ("x_percent", "X", "%"),
            Self::YPercent => ("y_percent", "Y", "%"),
            Self::ZMm => ("z_mm", "Z", "mm"),
            Self::ZStrokePercent => ("z_full_scale_percent", "Z", "% of the stroke"),
            Self::WorstMm => ("worst_mm", "worst node", "mm"),
            Self::Rmse => ("rmse", "RMSE", ""),
            Self::Mae => ("mae", "MAE", ""),
            Self::R2 => ("r2", "R²", ""),
            Self::Worst => ("worst", "worst", ""),
            Self::RangePercent => ("percent_of_range", "MAE", "% of range"),
            Self::CoveragePercent => ("coverage_percent", "in 90 % interval", "%"),
            Self::HalfWidth => ("half_width", "90 % interval ±", ""),
        }
    }

    /// Name in files, such as `z_percent`.
    pub fn field(self) -> &'static str {
        self.names().0
    }

    /// Returns the heading and the fixed unit; the unit is empty if it is the unit of the target.
    pub fn heading(self) -> (&'static str, &'static str) {
        (self.names().1, self.names().2)
    }

    /// Returns the definition in a sentence.
    pub fn definition(self) -> &'static str {
        self.get_message().unwrap_or_default()
    }

    /// Returns this measure of the errors of a target; `None` for measures of nodes, and where it is undefined.
    pub fn of_target(self, errors: &TargetErrors) -> Option<f64> {
        self.of(Figures::Target(errors))
    }

    pub(super) fn of(self, figures: Figures<'_>) -> Option<f64> {
        match (self, figures) {
            (Self::ZPercent, Figures::Nodes(errors)) => errors.z_percent,
            (Self::XPercent, Figures::Nodes(errors)) => errors.x_percent,
            (Self::YPercent, Figures::Nodes(errors)) => errors.y_percent,
            (Self::ZMm, Figures::Nodes(errors)) => Some(errors.z_mm),
            (Self::ZStrokePercent, Figures::Nodes(errors)) => Some(errors.z_full_scale_percent),
            (Self::WorstMm, Figures::Nodes(errors)) => Some(errors.worst_mm),
            (Self::ZPercent, Figures::Published(published)) => Some(published.z_percent),
            (Self::XPercent, Figures::Published(published)) => Some(published.x_percent),
            (Self::YPercent, Figures::Published(published)) => Some(published.y_percent),
            (Self::Rmse, Figures::Target(errors)) => Some(errors.rmse),
            (Self::Mae, Figures::Target(errors)) => Some(errors.mae),
            (Self::R2, Figures::Target(errors)) => errors.r2,
            (Self::Worst, Figures::Target(errors)) => Some(errors.worst),
            (Self::RangePercent, Figures::Target(errors)) => errors.percent_of_range,
            (Self::CoveragePercent, Figures::Intervals(coverage)) => Some(100.0 * coverage.share),
            (Self::HalfWidth, Figures::Intervals(coverage)) => Some(coverage.half_width),
            _ => None,
        }
    }
}

/// Figures in which a measure is looked up.
#[derive(Clone, Copy)]
pub(super) enum Figures<'a> {
    Nodes(&'a Errors),
    Published(&'a PublishedErrors),
    Target(&'a TargetErrors),
    Intervals(&'a Coverage),
}

impl ErrorRow {
    fn new(name: &'static str, measures: &[ErrorMeasure], figures: Figures<'_>) -> Self {
        let errors = measures.iter().map(|measure| measure.of(figures)).collect();
        Self { name, errors }
    }
}

impl ErrorTable {
    /// Returns the tables of the baselines, the network, the model-based decoder unless its errors are only rounding, and
    /// the published errors, if there are any.
    pub fn of_scores(problem: &Problem, scores: &Scores, published: Option<&PublishedErrors>) -> Vec<Self> {
        let baselines = &scores.baselines;
        let mut rows = vec![
            ("training mean", &baselines.mean),
            (baselines.linear_name(), &baselines.linear),
        ];
        match &scores.network_alone {
            Some(alone) => rows.extend([(NETWORK, alone), (CHOSEN, &scores.network)]),
            None => rows.push((NETWORK, &scores.network)),
        }
        // Exact readings that determine the deformation leave only rounding errors.
        let model_based = baselines.model_based.as_ref();
        let model_based = model_based.filter(|errors| !errors.nodes().is_some_and(Errors::is_rounding));
        rows.extend(model_based.map(|errors| (MODEL_BASED, errors)));
        let mut tables = Self::of_errors(problem, &rows);
        if !problem.has_nodes() && scores.coverage.iter().any(Option::is_some) {
            let coverage = scores.coverage.iter().copied().chain(std::iter::repeat(None));
            tables
                .iter_mut()
                .zip(coverage)
                .for_each(|(table, coverage)| table.add_coverage(coverage));
        }
        let last = tables.last_mut();
        if let (Some(published), Some(table)) = (published, last.filter(|_| problem.has_nodes())) {
            let row = ErrorRow::new("published", table.measures, Figures::Published(published));
            table.rows.push(row);
        }
        tables
    }

    /// Name of the row of what is used: `chosen` if there is one, otherwise `network`.
    pub fn used(&self) -> &'static str {
        match self.rows.iter().any(|row| row.name == CHOSEN) {
            true => CHOSEN,
            false => NETWORK,
        }
    }

    /// Adds rows for the errors of the network while each target rises and while it falls; `loops` are in the order of
    /// the targets, `None` for those that do not rise and fall.
    pub fn add_loops(tables: &mut [Self], loops: &[Option<HysteresisLoop>]) {
        for (table, found) in tables.iter_mut().zip(loops) {
            let Some(HysteresisLoop { loading, unloading, .. }) = found else {
                continue;
            };
            let rows = match table.used() {
                CHOSEN => [("chosen, loading", loading), ("chosen, unloading", unloading)],
                _ => [("network, loading", loading), ("network, unloading", unloading)],
            };
            let row = |(name, errors)| ErrorRow::new(name, table.measures, Figures::Target(errors));
            table.rows.extend(rows.map(row));
        }
    }

    /// Adds the measures of the intervals of what is used.
    fn add_coverage(&mut self, coverage: Option<Coverage>) {
        let used = self.used();
        self.measures = ErrorMeasure::OF_TARGETS_WITH_INTERVALS;
        let added = &self.measures[ErrorMeasure::OF_TARGETS.len()..];
        for row in &mut self.rows {
            let coverage = coverage.as_ref().filter(|_| row.name == used);
            let of = |measure: &ErrorMeasure| measure.of(Figures::Intervals(coverage?));
            row.errors.extend(added.iter().map(of));
        }
    }

    /// Returns the tables of these errors, each with its name.
    pub fn of_errors(problem: &Problem, rows: &[(&'static str, &TestErrors)]) -> Vec<Self> {
        if problem.has_nodes() {
            let measures = ErrorMeasure::OF_NODES;
            let row = |(name, errors): &(&'static str, &TestErrors)| {
                Some(ErrorRow::new(name, measures, Figures::Nodes(errors.nodes()?)))
            };
            let rows = rows.iter().filter_map(row).collect();
            return vec![Self {
                target: None,
                measures,
                rows,
            }];
        }
        let measures = ErrorMeasure::OF_TARGETS;
        let table = |target: Channel, errors: &dyn Fn(&TestErrors) -> Option<TargetErrors>| Self {
            target: Some(target),
            measures,
            rows: Vec::from_iter(rows.iter().filter_map(|(name, of_row)| {
                let errors = errors(of_row)?;
                Some(ErrorRow::new(name, measures, Figures::Target(&errors)))
            })),
        };
        let targets = problem.targets.iter().enumerate();
        let mut tables = Vec::from_iter(
            targets.map(|(index, target)| table(target.clone(), &|errors| errors.targets().get(index).copied())),
        );
        if let Some(unit) = problem.shared_unit().filter(|_| problem.targets.len() > 1) {
            let all = Channel::new(ALL_TARGETS, Some(unit));
            tables.push(table(all, &|errors| TargetErrors::over_all(errors.targets())));
        }
        tables
    }
}

/// Returns the unit to which [`frame_us`] measured on `test` refers: "a
/// sample", or "a frame of 4 row-wires".
pub fn decoded_unit(test: &Dataset) -> String {
    match (test.frames(), test.row_count()) {
        (Ok(_), rows @ 2..) => format!("a frame of {rows} row-wires"),
        _ => "a sample".to_owned(),
    }
}

/// Returns the time in microseconds to decode a frame of `test`, or a sample if `test` does not consist of whole
/// frames, on one thread: the median over blocks of frames, each long enough for the clock.
///
/// # Errors
/// If a reading of `test` cannot be decoded.
pub fn frame_us(decoder: &mut dyn Decoder, test: &Dataset) -> Result<f64, DecodeError> {
    const FEWEST_BLOCKS: usize = 3;
    const MAX_BLOCKS: usize = 101;
    const BLOCK_SECONDS: f64 = 100e-6;
    const MAX_SECONDS: f64 = 0.03;
    let frames = test.frames().ok();
    let count = frames.as_ref().map_or(test.samples(), Vec::len);
    let mut places = (0..count).cycle();
    let mut answer = vec![0.0; test.row_count() * test.outputs()];
    let mut decode = |count: usize| -> Result<f64, DecodeError> {
        let begun = Instant::now();
        for place in places.by_ref().take(count) {
            match &frames {
                Some(frames) => decoder.decode(black_box(&frames[place]), &mut answer)?,
                None => {
                    let readings = black_box(test.sample_readings(place));
                    decoder.decode_row(test.row_index(place), readings, &mut answer[..test.outputs()])?;
                }
            }
            black_box(&answer);
        }
        Ok(begun.elapsed().as_secs_f64())
    };
    // The first call fills the caches.
    decode(1)?;
    let once = decode(1)?.max(1e-9);
    let frames_in_block = (BLOCK_SECONDS / once).ceil() as usize;
    let mut blocks = Vec::new();
    let mut spent = 0.0;
    while blocks.len() < FEWEST_BLOCKS || (spent < MAX_SECONDS && blocks.len() < MAX_BLOCKS) {
        let seconds = decode(frames_in_block)?;
        spent += seconds;
        blocks.push(1e6 * seconds / frames_in_block as f64);
    }
    Ok(median(blocks))
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;
    use crate::problem::Channel;
    use crate::problem::Problem;

    fn problem(units: [&str; 2]) -> Problem {
        let channel = |(name, unit): (&str, &str)| Channel::new(name, Some(unit));
        Problem {
            targets: ["a", "b"].into_iter().zip(units).map(channel).collect(),
            ..Problem::default()
        }
    }

    #[test]
    fn targets_that_share_a_unit_have_a_table_for_all_targets() {
        // From scikit-learn: mean_squared_error(t, a) ** 0.5, mean_absolute_error, r2_score (uniform average), max.
        let targets = array![[0.0, 10.0], [1.0, 12.0], [2.0, 14.0], [3.0, 18.0]];
        let answers = array![[0.5, 10.0], [1.0, 11.0], [2.0, 14.0], [2.0, 20.0]];
        let errors = TestErrors::Targets(TargetErrors::measure(targets.view(), answers.view()));
        let tables = ErrorTable::of_errors(&problem(["N", "N"]), &[("ridge", &errors)]);
        assert_eq!(tables.len(), 3);
        let all = &tables[2];
        assert_eq!(all.target.as_ref().unwrap().title(), "all targets (N)");
        let expected = [0.883_883_476_483_184_4, 0.5625, 0.803_571_428_571_428_6, 2.0, 10.937_5];
        for (found, expected) in all.rows[0].errors.iter().zip(expected) {
            assert!((found.unwrap() - expected).abs() < 1e-12, "{found:?} {expected}");
        }
        let of_two_units = ErrorTable::of_errors(&problem(["N", "mm"]), &[("ridge", &errors)]);
        assert_eq!(of_two_units.len(), 2);
    }
}
