use std::f64::consts::TAU;

use super::{
    diagnosis::{Diagnosis, FaultCause, FaultyWire},
    row_fit::{FitPrior, RowFit, RowFitReport, RowReadings},
};

/// A hypothesis about the fault in some frames, with its evidence.
#[derive(Clone, Copy, Debug)]
struct Hypothesis {
    wire: FaultyWire,
    cause: FaultCause,
    /// −2 ln of the probability density of all readings.
    score: f64,
    /// χ² of all readings.
    chi_squared: f64,
    /// Number of readings in χ².
    readings: usize,
    /// Number of row fits in χ², each with its prior.
    rows: usize,
}

/// The most probable fault.
pub(super) struct Explained {
    pub(super) diagnosis: Diagnosis,
    /// χ² of the readings that the fault predicts.
    pub(super) chi_squared: f64,
    /// Number of these readings.
    pub(super) readings: usize,
    /// Number of row fits, each with its prior.
    pub(super) rows: usize,
}

/// Compares all single-wire faults by their evidence in the same frames.
///
/// A fault of a row-wire does not affect the other rows. A fault of a column-wire is judged by the prediction from the
/// other columns: R̂ of the fit without it, with its variance τ². For an unknown cause, readings are distributed
/// uniformly within [`WIDTH`].
pub(super) struct Evidence<'a> {
    /// Fit of one row-wire, and of two touching row-wires.
    pub(super) one: &'a mut RowFit,
    pub(super) two: &'a mut RowFit,
    pub(super) prior: &'a FitPrior,
    /// Row-wires read.
    pub(super) rows: &'a [usize],
    pub(super) columns: usize,
    pub(super) nodes_per_row: usize,
    pub(super) nodes_per_column: usize,
    /// Frames in ohm: frames × rows × M4.
    pub(super) frames_ohm: &'a [f64],
}

/// Range of the logarithm of an unknown reading or gain: from a seventh to sevenfold.
const WIDTH: f64 = 4.0;
/// Maximum number of column-wires examined on all lines.
const MAX_COLUMNS: usize = 8;
/// Number of lines used to choose them.
const WORST_LINES: usize = 4;

/// Prediction of a reading from a fit without its column.
#[derive(Clone, Copy)]
struct Predicted {
    /// ln m − ln R̂.
    misfit: f64,
    /// Variance σ² + τ².
    variance: f64,
}

impl Evidence<'_> {
    /// Returns the most probable fault.
    pub(super) fn compare(mut self) -> Option<Explained> {
        let normal: Vec<RowFitReport> = (0..self.lines())
            .map(|line| self.fit(line, [None; 2], self.nodes_per_row))
            .collect();
        let mut hypotheses = Vec::new();
        self.add_rows(&normal, &mut hypotheses);
        let suspects = self.suspects(&normal);
        let left_out: Vec<ColumnLeftOut> = suspects
            .iter()
            .map(|&column| self.leave_out([Some(column), None]))
            .collect();
        for (column, left_out) in suspects.iter().zip(&left_out) {
            self.add_column(*column, left_out, &mut hypotheses);
        }
        for column in 0..self.columns.saturating_sub(1) {
            if suspects.contains(&column) && suspects.contains(&(column + 1)) {
                let left_out = self.leave_out([Some(column), Some(column + 1)]);
                hypotheses.push(left_out.shorted(column, self.log_readings(column), self.log_readings(column + 1)));
            }
        }
        let best = hypotheses.iter().min_by(|a, b| a.score.total_cmp(&b.score))?;
        let weight = |hypothesis: &Hypothesis| (-0.5 * (hypothesis.score - best.score)).exp();
        let all: f64 = hypotheses.iter().map(weight).sum();
        let of_wire = hypotheses.iter().filter(|other| other.wire == best.wire);
        let diagnosis = Diagnosis {
            wire: best.wire,
            cause: best.cause,
            probability: of_wire.map(weight).sum::<f64>() / all,
        };
        Some(Explained {
            diagnosis,
            chi_squared: best.chi_squared,
            readings: best.readings,
            rows: best.rows,
        })
    }

    /// Rows of all frames.
    fn lines(&self) -> usize {
        self.frames_ohm.len() / self.columns
    }

    fn readings_ohm(&self, line: usize) -> &[f64] {
        &self.frames_ohm[line * self.columns..(line + 1) * self.columns]
    }

    fn row(&self, line: usize) -> usize {
        self.rows[line % self.rows.len()]
    }

    fn log_readings(&self, column: usize) -> Vec<f64> {
        (0..self.lines())
            .map(|line| self.readings_ohm(line)[column].ln())
            .collect()
    }

    fn fit(&mut self, line: usize, left_out: [Option<usize>; 2], nodes: usize) -> RowFitReport {
        let rows = [(self.row(line), self.prior)];
        let readings_ohm = &self.frames_ohm[line * self.columns..(line + 1) * self.columns];
        self.one.solve(RowReadings {
            rows: &rows,
            readings_ohm,
            left_out,
            nodes,
        })
    }

    /// Adds the faults of row-wires.
    fn add_rows(&mut self, normal: &[RowFitReport], hypotheses: &mut Vec<Hypothesis>) {
        let total = sum(normal);
        for index in 0..self.rows.len() {
            let row = self.rows[index];
            let lines: Vec<usize> = (index..self.lines()).step_by(self.rows.len()).collect();
            let of_row = sum_of(normal, &lines);
            let rest = (total.score - of_row.score, total.chi_squared - of_row.chi_squared);
            let (rest_readings, rest_rows) = (total.readings - of_row.readings, self.lines() - lines.len());
            let mut add = |wire, cause, score: f64, chi_squared: f64, readings: usize| {
                let is_fitted = matches!(cause, FaultCause::Broken { .. });
                hypotheses.push(Hypothesis {
                    wire,
                    cause,
                    score: rest.0 + score,
                    chi_squared: rest.1 + chi_squared,
                    readings: rest_readings + readings,
                    rows: rest_rows + if is_fitted { lines.len() } else { 0 },
                });
            };
            let wire = FaultyWire::Row(row);
            let readings = lines.iter().flat_map(|&line| {
                let pairs = self.readings_ohm(line).iter().enumerate();
                pairs.map(move |(k, ohm)| (k, ohm.ln()))
            });
            let readings = readings.map(|(k, misfit)| Predicted {
                misfit,
                variance: self.one.deviation(row, k).powi(2),
            });
            let (score, chi_squared, count) = self.no_signal(readings);
            add(wire, FaultCause::NoSignal, score, chi_squared, count);
            for before_node in 1..self.nodes_per_row {
                let broken: Vec<RowFitReport> = lines
                    .iter()
                    .map(|&line| self.fit(line, [None; 2], before_node))
                    .collect();
                let broken = sum(&broken);
                add(
                    wire,
                    FaultCause::Broken { before_node },
                    broken.score,
                    broken.chi_squared,
                    broken.readings,
                );
            }
            let unknown = 2.0 * WIDTH.ln() * (lines.len() * self.columns) as f64;
            add(wire, FaultCause::Unknown, unknown, 0.0, 0);
            if let Some(next) = self.rows.iter().position(|&other| other == row + 1) {
                let next_lines: Vec<usize> = (next..self.lines()).step_by(self.rows.len()).collect();
                let of_next = sum_of(normal, &next_lines);
                let pairs = lines.iter().zip(&next_lines);
                let both: Vec<RowFitReport> = pairs.map(|(&line, &next)| self.fit_shorted_rows(line, next)).collect();
                let both = sum(&both);
                hypotheses.push(Hypothesis {
                    wire: FaultyWire::Rows(row),
                    cause: FaultCause::Shorted,
                    score: rest.0 - of_next.score + both.score,
                    chi_squared: rest.1 - of_next.chi_squared + both.chi_squared,
                    readings: rest_readings - of_next.readings + both.readings,
                    // Both rows have a prior in one fit.
                    rows: self.lines(),
                });
            }
        }
    }

    /// Fit of two touching rows: their readings differ only by noise, and their geometric means are those of both rows.
    fn fit_shorted_rows(&mut self, line: usize, next: usize) -> RowFitReport {
        let (row, next_row) = (self.row(line), self.row(next));
        let (mut score, mut chi_squared) = (0.0, 0.0);
        let mut means_ohm = Vec::with_capacity(self.columns);
        let pairs = self.readings_ohm(line).iter().zip(self.readings_ohm(next)).enumerate();
        for (k, (one, other)) in pairs {
            means_ohm.push((one * other).sqrt());
            let variance = self.one.deviation(row, k).powi(2) + self.one.deviation(next_row, k).powi(2);
            let misfit = (one / other).ln().powi(2) / variance;
            chi_squared += misfit;
            score += misfit + (TAU * variance).ln();
        }
        let fitted = self.two.solve(RowReadings {
            rows: &[(row, self.prior), (next_row, self.prior)],
            readings_ohm: &means_ohm,
            left_out: [None; 2],
            nodes: self.nodes_per_row,
        });
        RowFitReport {
            score: score + fitted.score,
            chi_squared: chi_squared + fitted.chi_squared,
            readings: self.columns + fitted.readings,
        }
    }

    /// Column-wires whose removal most improves the fit of the worst lines of the last frame, in ascending order.
    fn suspects(&mut self, normal: &[RowFitReport]) -> Vec<usize> {
        let mut lines: Vec<usize> = (self.lines() - self.rows.len()..self.lines()).collect();
        lines.sort_by(|&a, &b| normal[b].chi_squared.total_cmp(&normal[a].chi_squared));
        lines.truncate(WORST_LINES);
        let mut order: Vec<(f64, usize)> = Vec::with_capacity(self.columns);
        for column in 0..self.columns {
            let fits = lines
                .iter()
                .map(|&line| self.fit(line, [Some(column), None], self.nodes_per_row));
            order.push((fits.map(|fit| fit.chi_squared).sum(), column));
        }
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut suspects: Vec<usize> = order.iter().take(MAX_COLUMNS).map(|(_, column)| *column).collect();
        // Two touching columns mask each other: leaving out one does not improve the fit.
        if let Some(&(_, best)) = order.first() {
            suspects.extend([best.saturating_sub(1), (best + 1).min(self.columns - 1)]);
        }
        suspects.sort_unstable();
        suspects.dedup();
        suspects
    }
}

/// Predictions of one or two columns from fits of all lines without them.
struct ColumnLeftOut {
    rest: RowFitReport,
    /// Predictions for the first column left out, intact and then broken before each node from 1 on, for every line.
    /// `None` if the reading is beyond the range of the converter, hence certain.
    predicted: Vec<Vec<Option<Predicted>>>,
    /// Mean conductance of both columns as ln R̂, with its variance excluding noise, for every line.
    shared: Vec<(f64, f64)>,
    /// Variance of the noise of the first column, for every line.
    noise: Vec<f64>,
}

impl Evidence<'_> {
    fn leave_out(&mut self, left_out: [Option<usize>; 2]) -> ColumnLeftOut {
        let [first, second] = left_out;
        let first = first.unwrap_or(0);
        let mut slopes = vec![0.0; self.one.unknowns.len()];
        let mut others = slopes.clone();
        let mut found = ColumnLeftOut {
            rest: RowFitReport {
                score: 0.0,
                chi_squared: 0.0,
                readings: 0,
            },
            predicted: vec![Vec::new(); self.nodes_per_column],
            shared: Vec::new(),
            noise: Vec::new(),
        };
        for line in 0..self.lines() {
            let fitted = self.fit(line, left_out, self.nodes_per_row);
            found.rest.score += fitted.score;
            found.rest.chi_squared += fitted.chi_squared;
            found.rest.readings += fitted.readings;
            let row = self.row(line);
            let noise = self.one.deviation(row, first).powi(2);
            found.noise.push(noise);
            let log_reading = self.readings_ohm(line)[first].ln();
            for (electrodes, predicted) in found.predicted.iter_mut().enumerate() {
                let log_ohm = if electrodes == 0 {
                    self.one.slopes_of(first, &mut slopes);
                    self.one.log_ohm[first]
                } else {
                    self.one.broken_column((row, first, electrodes), &mut slopes)
                };
                let is_certain = electrodes > 0 && self.one.is_clipped(log_reading, log_ohm);
                let variance = noise + self.one.variance(&mut slopes);
                let misfit = log_reading - log_ohm;
                predicted.push((!is_certain).then_some(Predicted { misfit, variance }));
            }
            if let Some(second) = second {
                let logs = [self.one.log_ohm[first], self.one.log_ohm[second]];
                let conductances = logs.map(|log_ohm| (-log_ohm).exp());
                let total = conductances[0] + conductances[1];
                self.one.slopes_of(first, &mut slopes);
                self.one.slopes_of(second, &mut others);
                for (slope, other) in slopes.iter_mut().zip(&others) {
                    *slope = (conductances[0] * *slope + conductances[1] * other) / total;
                }
                found.shared.push(((2.0 / total).ln(), self.one.variance(&mut slopes)));
            }
        }
        found
    }

    /// Score, χ² and number of the logarithms of readings that do not depend on the deformation: all at the end of the
    /// converter's range, which is certain without any current, or at another level.
    fn no_signal(&self, readings: impl Iterator<Item = Predicted> + Clone) -> (f64, f64, usize) {
        let full_scale = self.one.log_full_scale();
        if readings.clone().all(|reading| reading.misfit < full_scale) {
            let level = Level::of(readings.clone());
            // Its level is fitted.
            return (level.score, level.chi_squared, readings.count().saturating_sub(1));
        }
        let below = readings.filter(|reading| reading.misfit < full_scale);
        let square = |reading: &Predicted| (reading.misfit - full_scale).powi(2) / reading.variance;
        let chi_squared = below.clone().map(|reading| square(&reading)).sum::<f64>();
        let noise: f64 = below.clone().map(|reading| (TAU * reading.variance).ln()).sum();
        (chi_squared + noise, chi_squared, below.count())
    }

    /// Adds the faults of one column-wire.
    fn add_column(&self, column: usize, left_out: &ColumnLeftOut, hypotheses: &mut Vec<Hypothesis>) {
        let mut add = |cause, score: f64, chi_squared: f64, count: usize| {
            hypotheses.push(Hypothesis {
                readings: left_out.rest.readings + count,
                rows: left_out.noise.len(),
                wire: FaultyWire::Column(column),
                cause,
                score: left_out.rest.score + score,
                chi_squared: left_out.rest.chi_squared + chi_squared,
            });
        };
        let readings = self.log_readings(column);
        let constant = readings.iter().zip(&left_out.noise);
        let constant = constant.map(|(&misfit, &variance)| Predicted { misfit, variance });
        let (score, chi_squared, count) = self.no_signal(constant);
        add(FaultCause::NoSignal, score, chi_squared, count);
        for (before_node, predicted) in left_out.predicted.iter().enumerate().skip(1) {
            let predicted = predicted.iter().flatten();
            let chi_squared: f64 = predicted.clone().map(|p| p.misfit * p.misfit / p.variance).sum();
            let score = chi_squared + predicted.clone().map(|p| (TAU * p.variance).ln()).sum::<f64>();
            add(
                FaultCause::Broken { before_node },
                score,
                chi_squared,
                predicted.count(),
            );
        }
        let gain = Level::of(left_out.predicted[0].iter().flatten().copied());
        let relative = gain.mean.exp() - 1.0;
        let count = readings.len().saturating_sub(1);
        add(FaultCause::Gain { relative }, gain.score, gain.chi_squared, count);
        add(FaultCause::Unknown, 2.0 * WIDTH.ln() * readings.len() as f64, 0.0, 0);
    }
}

impl ColumnLeftOut {
    /// Hypothesis that two columns touch: their readings differ only by noise, and have the mean conductance of both.
    fn shorted(&self, column: usize, one: Vec<f64>, other: Vec<f64>) -> Hypothesis {
        let mut chi_squared = self.rest.chi_squared;
        let mut score = self.rest.score;
        for (line, (one, other)) in one.iter().zip(&other).enumerate() {
            let (log_ohm, variance) = self.shared[line];
            let apart = (one - other, 2.0 * self.noise[line]);
            let mean = (0.5 * (one + other) - log_ohm, 0.5 * self.noise[line] + variance);
            for (misfit, variance) in [apart, mean] {
                chi_squared += misfit * misfit / variance;
                score += misfit * misfit / variance + (TAU * variance).ln();
            }
        }
        Hypothesis {
            wire: FaultyWire::Columns(column),
            cause: FaultCause::Shorted,
            score,
            chi_squared,
            readings: self.rest.readings + 2 * self.noise.len(),
            rows: self.noise.len(),
        }
    }
}

/// Values with a common unknown mean, uniform within [`WIDTH`].
struct Level {
    mean: f64,
    score: f64,
    chi_squared: f64,
}

impl Level {
    fn of(values: impl Iterator<Item = Predicted> + Clone) -> Self {
        let precision: f64 = values.clone().map(|value| 1.0 / value.variance).sum();
        let mean = values.clone().map(|value| value.misfit / value.variance).sum::<f64>() / precision;
        let chi_squared: f64 = values
            .clone()
            .map(|value| (value.misfit - mean).powi(2) / value.variance)
            .sum();
        let noise: f64 = values.map(|value| (TAU * value.variance).ln()).sum();
        Self {
            mean,
            score: chi_squared + noise + 2.0 * WIDTH.ln() - (TAU / precision).ln(),
            chi_squared,
        }
    }
}

fn sum(fits: &[RowFitReport]) -> RowFitReport {
    RowFitReport {
        score: fits.iter().map(|fit| fit.score).sum(),
        chi_squared: fits.iter().map(|fit| fit.chi_squared).sum(),
        readings: fits.iter().map(|fit| fit.readings).sum(),
    }
}

fn sum_of(fits: &[RowFitReport], lines: &[usize]) -> RowFitReport {
    sum(&lines.iter().map(|&line| fits[line]).collect::<Vec<_>>())
}
