use std::{collections::BTreeSet, f64::consts::TAU, fmt, iter::Sum, mem::discriminant, ops::Range};

use faer::{Mat, Side, linalg::solvers::Solve};

use glam::DVec3;

use crate::{
    decoupling::{DecodeError, Estimator},
    numerics::chi_squared_quantile,
    scene::{Loading, Scene},
    sensor::{ArrayScale, SensorError, SensorModel},
};

/// Faulty wire, counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FaultyWire {
    /// A row-wire.
    Row(usize),
    /// A column-wire, its amplifier or its converter.
    Column(usize),
    /// This column-wire and the next.
    Columns(usize),
}

/// Cause of a fault, as far as the readings determine it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultCause {
    /// Readings are at the end of the converter's range, or higher than those of the intact wire.
    Open,
    /// Readings do not change.
    Stuck,
    /// The two wires touch.
    Shorted,
    /// Readings are 1 + `relative` times the resistances.
    Gain {
        /// Relative error of the readings.
        relative: f64,
    },
    /// The readings contradict all others in a way that no other cause explains.
    Unknown,
}

/// Event of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultEvent {
    /// A fault was identified: its wire should be left out.
    Named {
        /// Faulty wire.
        wire: FaultyWire,
        /// Most probable cause.
        cause: FaultCause,
        /// Probability of this wire, summed over all causes, given that exactly one fault explains the readings.
        probability: f64,
    },
    /// The readings contradict Eq. (2), and no fault of a single wire explains them.
    Unexplained,
    /// The readings agree with Eq. (2) again.
    Recovered,
}

/// Checks whether Eq. (2) explains the frames, identifies the faulty wire if it does not, and decodes without it.
///
/// A frame is suspicious if its residual after decoding, χ² = Σ (ln m − ln R)²/σ² over all readings m with relative noise
/// σ, exceeds a limit that intact frames exceed with a probability of 10⁻³. When [`Self::PERSISTENCE`] consecutive frames
/// are suspicious, the faults of single wires that explain them by the same limit are compared by their evidence: the
/// probability density of all readings by Laplace's approximation (MacKay, "Bayesian interpolation", Neural Computation
/// 4, 1992), where readings of the faulty wire are predicted from the others. The most probable fault is named if its
/// probability is at least [`Self::SURE`].
///
/// Faults that Eq. (2) explains by some deformation cannot be found: two row-wires that touch, for example.
#[derive(Debug)]
pub struct WireCheck {
    model: SensorModel,
    /// Row-wires read.
    rows: Vec<usize>,
    /// Estimator of the scene, for answers.
    decoder: Estimator,
    /// True if the deformations of neighbouring rows are correlated.
    has_neighbours: bool,
    /// Estimator of any presses, for the residual.
    estimator: Estimator,
    axes: &'static [usize],
    stroke_mm: f64,
    /// Resistances with all nodes half-way down: rows × M4.
    half_way_ohm: Vec<f64>,
    /// Relative noise of each reading (standard deviation): rows × M4.
    deviations: Vec<f64>,
    /// Standard deviation of the gain error of a row; 0 for none.
    common: f64,
    /// Logarithm of the reading above which the converter clips.
    log_full_scale: f64,
    /// Coordinates, displacements (M2) and resistances (M4) of the latest estimate.
    coordinates_mm: Vec<f64>,
    displacements_mm: Vec<DVec3>,
    predicted_ohm: Vec<f64>,
    /// Most probable logarithm of the gain of the row, and columns of the latest residual.
    log_gain: f64,
    used: Vec<usize>,
    /// Last event; [`FaultEvent::Recovered`] at first.
    state: FaultEvent,
    /// Consecutive suspicious frames, each rows × M4.
    suspicious_ohm: Vec<f64>,
    /// Number of consecutive suspicious frames since the last comparison.
    suspicious: usize,
    /// Number of suspicious frames at which faults are compared again.
    next_comparison: usize,
    /// Number of consecutive frames without a fault.
    normal: usize,
}

/// Fit of some readings.
#[derive(Clone, Copy, Debug, Default)]
struct Fit {
    /// −2 ln of the probability density of their logarithms.
    score: f64,
    chi_squared: f64,
    /// Number of readings in χ².
    readings: usize,
    /// Number of rows decoded.
    rows: usize,
}

/// A reading predicted from others.
#[derive(Clone, Copy, Debug)]
struct Predicted {
    log_reading: f64,
    /// ln R̂ with the gain of the row.
    log_ohm: f64,
    variance: f64,
    /// Part of the variance that is noise of the reading.
    noise: f64,
}

/// A fault that may explain some frames.
type Hypothesis = (FaultyWire, FaultCause, Fit);

/// Normal deviate that is exceeded with a probability of 10⁻³.
const DEVIATE: f64 = 3.090_232_306_167_814;
/// Increase of χ² per unknown by the prior of the decoder: at most an eighth if nodes anywhere in their ranges have a
/// Gaussian prior with the variance of the range.
const OF_PRIOR: f64 = 0.25;
/// Factor by which presses may be deeper than in the scene.
const DEEPER: f64 = 1.5;
/// Minimum noise assumed: the accuracy of the model.
const SMALLEST_NOISE: f64 = 1e-6;
/// Range of the logarithm of an unknown reading or gain: from a seventh to sevenfold.
const WIDTH: f64 = 4.0;
/// Maximum number of column-wires examined in all frames.
const MAX_SUSPECTS: usize = 6;
/// Number of rows used to choose them.
const WORST_ROWS: usize = 2;
/// Largest array that is checked: unknowns of a row, and column-wires.
const MAX_UNKNOWNS: usize = 64;
const MAX_COLUMNS: usize = 128;
/// Largest interval between comparisons of unexplained frames, in units of [`WireCheck::PERSISTENCE`].
const LONGEST_WAIT: usize = 1024;

impl WireCheck {
    /// Number of consecutive frames that must be suspicious for a fault to be reported, or normal for it to be cleared.
    pub const PERSISTENCE: usize = 4;
    /// Minimum probability at which a fault is reported.
    pub const SURE: f64 = 0.99;

    /// Returns `true` unless the array is too large to check every frame.
    pub fn is_affordable(scale: ArrayScale, scene: &Scene) -> bool {
        scene.unknowns_per_row(scale) <= MAX_UNKNOWNS && scale.columns() <= MAX_COLUMNS
    }

    /// Prepares to check frames of `rows` with the noise of `scene`, which must not be zero. Presses may differ from those
    /// of the scene, but answers are the most probable ones for the scene.
    ///
    /// # Errors
    /// If the model has no resistance.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        let compression = scene.largest_compression;
        let any_press = Scene {
            loading: Loading::RandomNodes,
            largest_compression: (DEEPER * compression).min(0.5 * (1.0 + compression)),
            ..*scene
        };
        let noise = scene.noise.in_test();
        let source = noise.source(model)?;
        let own = |&ohm: &f64| source.relative_to(ohm).own.max(SMALLEST_NOISE);
        let stroke_mm = scene.stroke_mm(&model.geometry);
        let half_way = vec![DVec3::Z * (0.5 * stroke_mm); model.scale.nodes_per_row()];
        let half_way_ohm: Result<Vec<_>, _> = rows.iter().map(|&row| model.row_resistances(row, &half_way)).collect();
        let half_way_ohm = half_way_ohm?.concat();
        Ok(Self {
            model: *model,
            rows: rows.to_vec(),
            decoder: Estimator::new(model, scene, rows)?,
            has_neighbours: scene.loading != Loading::RandomNodes,
            estimator: Estimator::new(model, &any_press, rows)?,
            axes: scene.movement.axes().indices(),
            stroke_mm,
            deviations: half_way_ohm.iter().map(own).collect(),
            // Rows are decoded one by one but share this error: it must not be penalised more than once in total.
            common: noise.drift * (rows.len() as f64).sqrt(),
            log_full_scale: (noise.range_ohm(model)?.1 * (1.0 - 1e-9)).ln(),
            suspicious_ohm: Vec::new(),
            half_way_ohm,
            coordinates_mm: vec![0.0; model.scale.coordinates_per_row()],
            displacements_mm: half_way,
            predicted_ohm: vec![0.0; model.scale.columns()],
            log_gain: 0.0,
            used: Vec::with_capacity(model.scale.columns()),
            state: FaultEvent::Recovered,
            suspicious: 0,
            next_comparison: Self::PERSISTENCE,
            normal: 0,
        })
    }

    /// Returns the wire of the fault currently reported.
    pub fn named(&self) -> Option<FaultyWire> {
        match self.state {
            FaultEvent::Named { wire, .. } => Some(wire),
            FaultEvent::Unexplained | FaultEvent::Recovered => None,
        }
    }

    /// Checks a frame of the row-wires read: rows × M4 readings in ohm, which must be finite and above 0. Each state is
    /// reported once.
    ///
    /// # Panics
    /// If the frame has the wrong length.
    pub fn check(&mut self, frame_ohm: &[f64]) -> Option<FaultEvent> {
        assert_eq!(frame_ohm.len(), self.deviations.len());
        if self.is_explained(frame_ohm, None) {
            self.suspicious = 0;
            self.normal += 1;
            if self.normal == Self::PERSISTENCE && self.state != FaultEvent::Recovered {
                self.state = FaultEvent::Recovered;
                self.next_comparison = Self::PERSISTENCE;
                return Some(self.state);
            }
            return None;
        }
        self.normal = 0;
        if let Some(wire) = self.named()
            && self.is_explained(frame_ohm, Some(wire))
        {
            self.suspicious = 0;
            return None;
        }
        if self.suspicious.is_multiple_of(Self::PERSISTENCE) {
            self.suspicious_ohm.clear();
        }
        self.suspicious_ohm.extend_from_slice(frame_ohm);
        self.suspicious += 1;
        if self.suspicious < self.next_comparison {
            return None;
        }
        self.suspicious = 0;
        let frames_ohm = std::mem::take(&mut self.suspicious_ohm);
        let event = self.explain(&frames_ohm).unwrap_or(FaultEvent::Unexplained);
        self.next_comparison = match event {
            FaultEvent::Unexplained => (2 * self.next_comparison).min(LONGEST_WAIT * Self::PERSISTENCE),
            _ => Self::PERSISTENCE,
        };
        let is_known = match (self.state, event) {
            (FaultEvent::Named { wire: a, cause: b, .. }, FaultEvent::Named { wire, cause, .. }) => {
                a == wire && discriminant(&b) == discriminant(&cause)
            }
            (last, event) => last == event,
        };
        self.state = event;
        (!is_known).then_some(event)
    }

    /// Returns `true` if some deformation explains the readings, excluding those of `left_out`.
    fn is_explained(&mut self, frame_ohm: &[f64], left_out: Option<FaultyWire>) -> bool {
        let missing = left_out.map_or(0..0, FaultyWire::columns);
        let rows = frame_ohm.chunks_exact(self.columns()).enumerate();
        let fits = rows.filter_map(|(row_index, readings_ohm)| {
            let is_left_out = left_out == Some(FaultyWire::Row(self.rows[row_index]));
            (!is_left_out).then(|| self.residual(row_index, readings_ohm, &missing))
        });
        let all: Option<Fit> = fits.sum();
        all.is_some_and(|fit| self.is_within_limit(fit))
    }

    /// Returns `true` if χ² is that of intact wires; `false` for NaN.
    fn is_within_limit(&self, fit: Fit) -> bool {
        let unknowns = self.axes.len() * self.displacements_mm.len() * fit.rows;
        fit.chi_squared <= chi_squared_quantile(fit.readings, DEVIATE) + OF_PRIOR * unknowns as f64
    }

    /// Number of column-wires.
    pub fn columns(&self) -> usize {
        self.predicted_ohm.len()
    }

    /// Decodes a row, and returns its χ² with the most probable gain; `None` without an answer. The score is not set.
    fn residual(&mut self, row_index: usize, readings_ohm: &[f64], missing: &Range<usize>) -> Option<Fit> {
        let row = self.rows[row_index];
        let coordinates_mm = &mut self.coordinates_mm;
        let solved = (self.estimator).solve_without(missing.clone(), row, readings_ohm, coordinates_mm);
        solved.ok()?;
        let nodes = self.displacements_mm.iter_mut().zip(coordinates_mm.chunks_exact(3));
        for (node, (displacement, at)) in nodes.enumerate() {
            *displacement = self.model.displacement_mm(row, node, DVec3::from_slice(at));
        }
        let predicted = (self.model).row_resistances_into(row, &self.displacements_mm, &mut self.predicted_ohm);
        predicted.ok()?;
        self.used.clear();
        let (mut chi_squared, mut sum, mut weights) = (0.0, 0.0, 0.0);
        for column in (0..readings_ohm.len()).filter(|column| !missing.contains(column)) {
            let logs = [readings_ohm[column], self.predicted_ohm[column]].map(f64::ln);
            let (misfit, variance) = (logs[0] - logs[1], self.variance(row_index, column));
            // Where both are clipped, the reading is certain.
            if logs.iter().any(|log| *log < self.log_full_scale) {
                chi_squared += misfit * misfit / variance;
                sum += misfit / variance;
                weights += 1.0 / variance;
                self.used.push(column);
            }
        }
        // 0 without a common error, whose precision is infinite.
        self.log_gain = sum / (weights + self.common.powi(-2));
        Some(Fit {
            score: 0.0,
            chi_squared: chi_squared - sum * self.log_gain,
            readings: self.used.len(),
            rows: 1,
        })
    }

    /// Variance of the noise of ln m.
    fn variance(&self, row_index: usize, column: usize) -> f64 {
        self.deviations[row_index * self.columns() + column].powi(2)
    }

    /// Decodes all rows of the frames without the missing readings, and predicts these; `None` if a row has no answer.
    fn partial_rows(&mut self, frames_ohm: &[f64], missing: Range<usize>) -> Option<Vec<(Fit, Vec<Predicted>)>> {
        let lines = frames_ohm.chunks_exact(self.columns()).enumerate();
        let of_line = |(line, readings_ohm): (usize, &[f64])| {
            let row_index = line % self.rows.len();
            let mut fit = self.residual(row_index, readings_ohm, &missing)?;
            let (displacements_mm, predicted_ohm) = (&self.displacements_mm, &self.predicted_ohm);
            let jacobian = self.model.row_jacobian(self.rows[row_index], displacements_mm).ok()?;
            // Slopes of ln R by the unknowns, in units of their prior standard deviations: the stroke, and that of the gain.
            let moving = displacements_mm.len() * self.axes.len();
            let slopes = |column: usize| {
                Mat::from_fn(moving + 1, 1, |unknown, _| {
                    let (node, axis) = (unknown / self.axes.len(), unknown % self.axes.len());
                    if unknown == moving {
                        self.common
                    } else {
                        jacobian[[column, node, self.axes[axis]]] / predicted_ohm[column] * self.stroke_mm
                    }
                })
            };
            let mut precision = Mat::<f64>::identity(moving + 1, moving + 1);
            for &column in &self.used {
                let (noise, slopes) = (self.variance(row_index, column), slopes(column));
                precision += faer::Scale(1.0 / noise) * &slopes * slopes.transpose();
                fit.score += (TAU * noise).ln();
            }
            let factor = precision.llt(Side::Lower).ok()?;
            let diagonal = factor.L().diagonal().column_vector();
            fit.score += fit.chi_squared + 2.0 * diagonal.iter().map(|entry| entry.ln()).sum::<f64>();
            let predicted = missing.clone().map(|column| {
                let (noise, slopes) = (self.variance(row_index, column), slopes(column));
                Predicted {
                    log_reading: readings_ohm[column].ln(),
                    log_ohm: predicted_ohm[column].ln() + self.log_gain,
                    variance: noise + (slopes.transpose() * factor.solve(&slopes))[(0, 0)],
                    noise,
                }
            });
            Some((fit, predicted.collect()))
        };
        lines.map(of_line).collect()
    }

    /// The fault that explains these frames, if there is one.
    fn explain(&mut self, frames_ohm: &[f64]) -> Option<FaultEvent> {
        let intact: Vec<Fit> = (self.partial_rows(frames_ohm, 0..0)?.iter().map(|(fit, _)| *fit)).collect();
        let rows = 0..self.rows.len();
        let mut hypotheses: Vec<Hypothesis> = rows.map(|row| self.of_row(frames_ohm, row, &intact)).collect();
        let suspects = self.suspects(frames_ohm, &intact);
        for &column in &suspects {
            hypotheses.extend(self.of_column(frames_ohm, column)?);
            if suspects.contains(&(column + 1)) {
                hypotheses.push(self.of_short(frames_ohm, column)?);
            }
        }
        hypotheses.retain(|(.., fit)| self.is_within_limit(*fit));
        let &(wire, cause, best) = hypotheses.iter().min_by(|a, b| a.2.score.total_cmp(&b.2.score))?;
        let weight = |(.., fit): &Hypothesis| (-0.5 * (fit.score - best.score)).exp();
        let of_wire = hypotheses.iter().filter(|(other, ..)| *other == wire);
        let probability = of_wire.map(weight).sum::<f64>() / hypotheses.iter().map(weight).sum::<f64>();
        (probability >= Self::SURE).then_some(FaultEvent::Named {
            wire,
            cause,
            probability,
        })
    }

    /// A fault of a row-wire, which does not affect the other rows.
    fn of_row(&self, frames_ohm: &[f64], row_index: usize, intact: &[Fit]) -> Hypothesis {
        let (rows, columns) = (self.rows.len(), self.columns());
        let others = intact.iter().enumerate().filter(|(line, _)| line % rows != row_index);
        let lines = frames_ohm.chunks_exact(columns).skip(row_index).step_by(rows);
        let half_way_ohm = &self.half_way_ohm[row_index * columns..][..columns];
        let pairs = lines.flat_map(|line| line.iter().zip(half_way_ohm));
        let is_clipped = |ohm: f64| ohm.ln() >= self.log_full_scale;
        let is_open = pairs.clone().all(|(&ohm, half_way)| is_clipped(ohm) || ohm > *half_way);
        // Clipped readings are certain without any current.
        let uncertain = pairs.filter(|(ohm, _)| !(is_open && is_clipped(**ohm))).count();
        let cause = if is_open { FaultCause::Open } else { FaultCause::Unknown };
        let fit = others.map(|(_, fit)| *fit).chain([unpredicted(uncertain)]).sum();
        (FaultyWire::Row(self.rows[row_index]), cause, fit)
    }

    /// Column-wires without which the worst rows of the last frame have the smallest χ², and the neighbours of the best:
    /// two touching columns mask each other.
    fn suspects(&mut self, frames_ohm: &[f64], intact: &[Fit]) -> BTreeSet<usize> {
        let (rows, columns) = (self.rows.len(), self.columns());
        let mut lines: Vec<usize> = (intact.len() - rows..intact.len()).collect();
        lines.sort_by(|&a, &b| intact[b].chi_squared.total_cmp(&intact[a].chi_squared));
        lines.truncate(WORST_ROWS);
        let without = |column: usize| {
            let fits = lines.iter().map(|&line| {
                let readings_ohm = &frames_ohm[line * columns..][..columns];
                let fit = self.residual(line % rows, readings_ohm, &(column..column + 1));
                fit.map_or(f64::INFINITY, |fit| fit.chi_squared)
            });
            (fits.sum::<f64>(), column)
        };
        let mut order: Vec<(f64, usize)> = (0..columns).map(without).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let best = order[0].1;
        let neighbours = best.saturating_sub(1)..=(best + 1).min(columns - 1);
        (order
            .iter()
            .take(MAX_SUSPECTS)
            .map(|(_, column)| *column)
            .chain(neighbours))
        .collect()
    }

    /// Faults of a column-wire, from all rows without it.
    fn of_column(&mut self, frames_ohm: &[f64], column: usize) -> Option<[Hypothesis; 3]> {
        let rows = self.partial_rows(frames_ohm, column..column + 1)?;
        let rest: Fit = rows.iter().map(|(fit, _)| *fit).sum();
        let readings = rows.iter().flat_map(|(_, missing)| missing);
        let (level, of_level) = level(readings.clone().map(|reading| (reading.log_reading, reading.noise)));
        let is_clipped = |reading: &Predicted| reading.log_reading >= self.log_full_scale;
        let constant = if readings.clone().all(is_clipped) {
            // Certain without any current.
            (FaultCause::Open, Fit::default())
        } else if level >= self.log_full_scale {
            (FaultCause::Open, of_level)
        } else {
            (FaultCause::Stuck, of_level)
        };
        let misfits = readings.map(|reading| (reading.log_reading - reading.log_ohm, reading.variance));
        // A wire that is broken beyond some of its nodes has higher readings, which vary.
        let is_high = misfits.clone().all(|(misfit, _)| misfit > 0.0);
        let other = if is_high { FaultCause::Open } else { FaultCause::Unknown };
        let (log_gain, of_gain) = self::level(misfits);
        let relative = log_gain.exp_m1();
        let causes = [
            constant,
            (FaultCause::Gain { relative }, of_gain),
            (other, unpredicted(rows.len())),
        ];
        Some(causes.map(|(cause, fit)| (FaultyWire::Column(column), cause, [rest, fit].into_iter().sum())))
    }

    /// Two columns that touch: their readings differ only by noise, and have the mean conductance of both.
    fn of_short(&mut self, frames_ohm: &[f64], column: usize) -> Option<Hypothesis> {
        let rows = self.partial_rows(frames_ohm, column..column + 2)?;
        let of_rows = rows.iter().flat_map(|(fit, missing)| {
            let [one, other] = [missing[0], missing[1]];
            let noise = one.noise + other.noise;
            let apart = normal(one.log_reading - other.log_reading, noise);
            // The mean conductance is known at least as well as both on average.
            let log_ohm = -(0.5 * ((-one.log_ohm).exp() + (-other.log_ohm).exp())).ln();
            let misfit = 0.5 * (one.log_reading + other.log_reading) - log_ohm;
            let mean = normal(misfit, 0.5 * (one.variance + other.variance) - 0.25 * noise);
            [*fit, apart, mean]
        });
        Some((FaultyWire::Columns(column), FaultCause::Shorted, of_rows.sum()))
    }

    /// Decodes rows of a frame of all rows read (rows × M4, in ohm) by Eq. (2), without the wire of the fault currently
    /// reported, if there is one; writes absolute coordinates (3·M2 for each of `row_indices`).
    ///
    /// Readings of faulty column-wires have no influence. A faulty row-wire is interpolated from its neighbours in the same
    /// frame, or set to the mean deformation of the scene if nodes are independent or no neighbour is read. Each answer
    /// depends only on the readings given, not on earlier frames.
    ///
    /// # Errors
    /// If a reading is not a valid resistance.
    ///
    /// # Panics
    /// If the frame or the coordinates have the wrong length.
    pub fn decode(
        &mut self,
        frame_ohm: &[f64],
        row_indices: Range<usize>,
        coordinates_mm: &mut [f64],
    ) -> Result<(), DecodeError> {
        let (columns, outputs) = (self.columns(), self.model.scale.coordinates_per_row());
        let sizes = (self.rows.len() * columns, row_indices.len() * outputs);
        assert_eq!((frame_ohm.len(), coordinates_mm.len()), sizes, "whole rows");
        for (place, (row_index, mm)) in (row_indices.zip(coordinates_mm.chunks_exact_mut(outputs))).enumerate() {
            let row = self.rows[row_index];
            let is_dead = self.named() == Some(FaultyWire::Row(row));
            let left_out = match self.named() {
                Some(_) if is_dead => 0..columns,
                Some(wire) => wire.columns(),
                None => 0..0,
            };
            let readings_ohm = &frame_ohm[row_index * columns..][..columns];
            let solved = self.decoder.solve_without(left_out, row, readings_ohm, mm);
            solved.map_err(|error| error.after(place))?;
            if is_dead && self.has_neighbours {
                self.interpolate(frame_ohm, row, mm)?;
            }
        }
        Ok(())
    }

    /// Sets a row to the mean depth of its neighbours in the same frame, if it has any.
    fn interpolate(&mut self, frame_ohm: &[f64], row: usize, coordinates_mm: &mut [f64]) -> Result<(), DecodeError> {
        let (mut sums_mm, mut neighbours) = (vec![0.0; coordinates_mm.len()], 0.0);
        let mut neighbour_mm = sums_mm.clone();
        for row_index in 0..self.rows.len() {
            if self.rows[row_index].abs_diff(row) == 1 {
                self.decode(frame_ohm, row_index..row_index + 1, &mut neighbour_mm)?;
                sums_mm.iter_mut().zip(&neighbour_mm).for_each(|(sum, mm)| *sum += mm);
                neighbours += 1.0;
            }
        }
        let nodes = coordinates_mm.chunks_exact_mut(3).zip(sums_mm.chunks_exact(3));
        for (node, (mm, sum_mm)) in nodes.enumerate().filter(|_| neighbours > 0.0) {
            let depth_mm = self.model.geometry.height_mm - sum_mm[2] / neighbours;
            mm.copy_from_slice(&self.model.displaced_mm(row, node, DVec3::Z * depth_mm).to_array());
        }
        Ok(())
    }
}

/// Fit of so many readings that nothing predicts.
fn unpredicted(readings: usize) -> Fit {
    Fit {
        score: 2.0 * WIDTH.ln() * readings as f64,
        ..Fit::default()
    }
}

/// Fit of a normal value with this misfit and variance.
fn normal(misfit: f64, variance: f64) -> Fit {
    let chi_squared = misfit * misfit / variance;
    Fit {
        score: chi_squared + (TAU * variance).ln(),
        chi_squared,
        readings: 1,
        rows: 0,
    }
}

/// Fit of values, each with its variance, that have a common unknown mean, uniform within [`WIDTH`]; and that mean.
fn level(values: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, Fit) {
    let precision: f64 = values.clone().map(|(_, variance)| 1.0 / variance).sum();
    let mean = values.clone().map(|(value, variance)| value / variance).sum::<f64>() / precision;
    let mut fit: Fit = values.map(|(value, variance)| normal(value - mean, variance)).sum();
    fit.score += 2.0 * WIDTH.ln() - (TAU / precision).ln();
    fit.readings = fit.readings.saturating_sub(1);
    (mean, fit)
}

impl Sum for Fit {
    fn sum<I: Iterator<Item = Self>>(fits: I) -> Self {
        fits.fold(Self::default(), |sum, fit| Self {
            score: sum.score + fit.score,
            chi_squared: sum.chi_squared + fit.chi_squared,
            readings: sum.readings + fit.readings,
            rows: sum.rows + fit.rows,
        })
    }
}

impl FaultyWire {
    /// Returns the faulty column-wires.
    pub fn columns(self) -> Range<usize> {
        match self {
            Self::Row(_) => 0..0,
            Self::Column(column) => column..column + 1,
            Self::Columns(first) => first..first + 2,
        }
    }
}

impl fmt::Display for FaultyWire {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Row(row) => write!(f, "row-wire {}", row + 1),
            Self::Column(column) => write!(f, "column-wire {}", column + 1),
            Self::Columns(first) => write!(f, "column-wires {} and {}", first + 1, first + 2),
        }
    }
}

impl fmt::Display for FaultEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (wire, cause, probability) = match *self {
            Self::Named {
                wire,
                cause,
                probability,
            } => (wire, cause, probability),
            Self::Unexplained => return write!(f, "the readings contradict Eq. (2)"),
            Self::Recovered => return write!(f, "the readings agree with Eq. (2) again"),
        };
        write!(f, "{wire}: ")?;
        match cause {
            FaultCause::Open => write!(f, "open, as if broken or not connected"),
            FaultCause::Stuck => write!(f, "stuck, its readings do not change"),
            FaultCause::Shorted => write!(f, "shorted, the wires touch"),
            FaultCause::Gain { relative } => {
                write!(f, "gain changed, readings off by {:+.2} %", 100.0 * relative)
            }
            FaultCause::Unknown => write!(f, "its readings contradict all others"),
        }?;
        write!(f, " (probability {probability:.4})")
    }
}
