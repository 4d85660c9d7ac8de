use crate::{
    decoupling::{DecodeError, LARGEST_ERROR, RowChoice, Solution},
    scene::{RowModel, Scene},
    sensor::{ArrayScale, SensorError, SensorModel},
};

/// Finds the row-wire of each row of a frame by trial, if rows are not known in the scene.
#[derive(Clone, Debug)]
pub(super) struct RowSearch {
    scale: ArrayScale,
    /// Row-wires read.
    rows: Vec<usize>,
    /// Logarithms of the resistances of each of `rows` at rest; empty if rows are known.
    rest: Vec<Vec<f64>>,
    twins: RowTwins,
    trial_mm: Vec<f64>,
}

/// Outcome of solving a row for a given row-wire.
pub(super) struct Trial<R> {
    /// Measure for comparing row-wires: the lowest is chosen.
    pub(super) score: f64,
    /// True if the row-wire is accepted without trying the others.
    pub(super) is_explained: bool,
    pub(super) report: R,
}

/// Relative misfit (root mean square) below which an answer explains its readings.
pub(super) const EXPLAINED: f64 = 1e-10;

impl<R> Trial<R> {
    /// Returns `true` if this row-wire is preferred to another: an explained one to one that is not, then the lower
    /// score. NaN is above all other scores.
    fn is_preferred_to(&self, other: Option<&Self>) -> bool {
        other.is_none_or(|other| {
            (!self.is_explained, self.score) < (!other.is_explained, other.score)
                || other.score.is_nan() && !self.score.is_nan()
        })
    }
}

impl RowSearch {
    pub(super) fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        let rest = rest_of_searched(model, scene, rows)?;
        Ok(Self {
            scale: model.scale,
            twins: RowTwins::of(model, scene, rows, &rest),
            rest,
            rows: rows.to_vec(),
            trial_mm: vec![0.0; model.scale.coordinates_per_row()],
        })
    }

    /// Number of readings per row.
    pub(super) fn channels(&self) -> usize {
        self.scale.columns()
    }

    /// Number of coordinates per row.
    pub(super) fn outputs(&self) -> usize {
        self.scale.coordinates_per_row()
    }

    /// Row-wires read, if the row-wire of each row of a frame is known.
    pub(super) fn known_rows(&self) -> Option<&[usize]> {
        self.rest.is_empty().then_some(&self.rows)
    }

    /// Row-wires read, and how the row-wire of a reading is determined.
    pub(super) fn description(&self) -> (&[usize], RowChoice) {
        let tried = || RowChoice::Tried {
            rest: self.rest.clone(),
        };
        let choice = if self.rest.is_empty() {
            RowChoice::Given
        } else {
            tried()
        };
        (&self.rows, choice)
    }

    /// Returns `true` if rows are not known.
    pub(super) fn is_needed(&self) -> bool {
        !self.rest.is_empty()
    }

    /// Row-wires that may have the same readings as others.
    pub(super) fn twins(&self) -> &RowTwins {
        &self.twins
    }

    /// Solves one row with `solve`, which solves for a given row-wire. Returns the report on the chosen row-wire.
    ///
    /// If rows are not known, row-wires are tried in order of similarity with their readings at rest, and the one
    /// with the lowest score is chosen; rows that mirror each other may then be confused.
    pub(super) fn solve<R>(
        &mut self,
        row_index: usize,
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
        mut solve: impl FnMut(usize, &[f64], &mut [f64]) -> Result<Trial<R>, DecodeError>,
    ) -> Result<Option<R>, DecodeError> {
        DecodeError::check(readings_ohm)?;
        if self.rest.is_empty() {
            return Ok(Some(solve(self.rows[row_index], readings_ohm, coordinates_mm)?.report));
        }
        let mut taken: Option<Trial<R>> = None;
        for row_wire in self.order(readings_ohm) {
            let trial = solve(row_wire, readings_ohm, &mut self.trial_mm)?;
            let is_explained = trial.is_explained;
            if trial.is_preferred_to(taken.as_ref()) {
                taken = Some(trial);
                coordinates_mm.copy_from_slice(&self.trial_mm);
            }
            if is_explained {
                break;
            }
        }
        Ok(taken.map(|trial| trial.report))
    }

    /// As [`Self::solve`], for several rows side by side, of one frame or several: `solve` solves each for a given
    /// row-wire. Returns the report on the chosen row-wire for each row.
    pub(super) fn solve_rows<R>(
        &self,
        row_indices: &[usize],
        readings_ohm: &[f64],
        coordinates_mm: &mut [f64],
        mut solve: impl FnMut(&[usize], &[f64], &mut [f64]) -> Result<Vec<Trial<R>>, DecodeError>,
    ) -> Result<Vec<Option<R>>, DecodeError> {
        if self.rest.is_empty() {
            let row_wires: Vec<usize> = row_indices.iter().map(|&index| self.rows[index]).collect();
            let trials = solve(&row_wires, readings_ohm, coordinates_mm)?;
            return Ok(trials.into_iter().map(|trial| Some(trial.report)).collect());
        }
        let (channels, outputs) = (self.channels(), self.outputs());
        let readings_of = |place: usize| &readings_ohm[place * channels..][..channels];
        let order = |place: usize| self.order(readings_of(place)).into_iter();
        let mut orders: Vec<_> = (0..row_indices.len()).map(order).collect();
        let mut taken: Vec<Option<Trial<R>>> = row_indices.iter().map(|_| None).collect();
        loop {
            let is_open = |place: &usize| taken[*place].as_ref().is_none_or(|trial| !trial.is_explained);
            let open: Vec<usize> = (0..taken.len()).filter(is_open).collect();
            let row_wires: Vec<usize> = open.iter().filter_map(|&place| orders[place].next()).collect();
            if row_wires.is_empty() {
                break;
            }
            let readings_ohm: Vec<f64> = open.iter().flat_map(|&place| readings_of(place)).copied().collect();
            let mut trials_mm = vec![0.0; open.len() * outputs];
            let found = solve(&row_wires, &readings_ohm, &mut trials_mm)?;
            let trials = trials_mm.chunks_exact(outputs).zip(found);
            for (&place, (trial_mm, trial)) in open.iter().zip(trials) {
                if trial.is_preferred_to(taken[place].as_ref()) {
                    taken[place] = Some(trial);
                    coordinates_mm[place * outputs..][..outputs].copy_from_slice(trial_mm);
                }
            }
        }
        Ok(taken.into_iter().map(|trial| Some(trial?.report)).collect())
    }

    /// Row-wires in order of similarity of their readings at rest with these readings.
    fn order(&self, readings_ohm: &[f64]) -> Vec<usize> {
        let unlike = |rest: &Vec<f64>| -> f64 {
            let differences = rest.iter().zip(readings_ohm).map(|(rest, ohm)| ohm.ln() - rest);
            differences.map(|difference| difference * difference).sum()
        };
        let mut order: Vec<(f64, usize)> = self.rest.iter().map(unlike).zip(self.rows.iter().copied()).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        order.into_iter().map(|(_, row_wire)| row_wire).collect()
    }
}

/// Row-wires that give the same readings as another one, by symmetry, if rows are not known.
///
/// The electrodes of a column-wire are evenly spaced, so readings stay the same if any nodes are mirrored about their
/// middle. Without sideways movement, row-wires mirror each other only as a whole, also at rest. With it, a row has a
/// twin if each of its nodes, or its mirror image, is within reach of the nodes of one row-wire. The same positions
/// as nodes of another row-wire are not a twin: they are the same answer.
#[derive(Clone, Debug, Default)]
pub(super) struct RowTwins {
    /// x of the row-wires whose readings at rest all equal those of another one.
    at_rest_x_mm: Vec<f64>,
    sideways: Option<Sideways>,
    /// True if every row has a twin.
    is_everywhere: bool,
}

/// Row-wires whose nodes move sideways.
#[derive(Clone, Debug)]
struct Sideways {
    rows_x_mm: Vec<f64>,
    largest_shift_mm: f64,
    /// Twice the x of the middle of the electrodes of a column-wire.
    twice_middle_mm: f64,
}

/// Difference of the logarithms of resistances at rest below which row-wires mirror each other.
const SAME_AT_REST: f64 = 1e-13;

impl RowTwins {
    /// Returns the twins among `rows` of `model` with these logarithms of the resistances at rest; none if rows are
    /// known.
    pub(super) fn of(model: &SensorModel, scene: &Scene, rows: &[usize], rest: &[Vec<f64>]) -> Self {
        let is_same = |a: &Vec<f64>, b: &Vec<f64>| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= SAME_AT_REST);
        let has_twin = |index: &usize| rest.iter().filter(|other| is_same(&rest[*index], other)).count() > 1;
        let geometry = &model.geometry;
        let largest_shift_mm = scene.movement.largest_shift_mm();
        let electrodes = model.scale.nodes_per_column() - 1;
        let sideways = Sideways {
            rows_x_mm: rows.iter().map(|&row| geometry.row_x_mm(row)).collect(),
            largest_shift_mm,
            twice_middle_mm: 2.0 * geometry.column_node_x0_mm + geometry.column_node_pitch_mm * electrodes as f64,
        };
        Self {
            at_rest_x_mm: (0..rest.len())
                .filter(has_twin)
                .map(|index| geometry.row_x_mm(rows[index]))
                .collect(),
            sideways: (largest_shift_mm > 0.0 && rest.len() > 1).then_some(sideways),
            // Readings of electrodes with the same x depend only on the distance from it, which combines height and
            // x.
            is_everywhere: rest.len() > 1 && electrodes == 0,
        }
    }

    /// Returns the status of an answer with these coordinates, which is not unique if it has a twin.
    pub(super) fn unless_twin(&self, solution: Solution, coordinates_mm: &[f64]) -> Solution {
        match solution {
            Solution::Unique if self.has(coordinates_mm) => Solution::Undetermined,
            solution => solution,
        }
    }

    /// Returns `true` if another row-wire may have the same readings.
    fn has(&self, coordinates_mm: &[f64]) -> bool {
        let sideways = self.sideways.as_ref();
        self.is_everywhere
            || self.at_rest_x_mm.contains(&coordinates_mm[0])
            || sideways.is_some_and(|sideways| sideways.has(coordinates_mm))
    }
}

impl Sideways {
    fn has(&self, coordinates_mm: &[f64]) -> bool {
        let smallest_mm = LARGEST_ERROR * 2.0 * self.largest_shift_mm;
        let reach_mm = self.largest_shift_mm + smallest_mm;
        let x_mm = coordinates_mm.iter().step_by(3);
        let pairs = x_mm.map(|x_mm| (x_mm, self.twice_middle_mm - x_mm));
        self.rows_x_mm.iter().any(|row_x_mm| {
            let is_within = |x_mm: f64| (x_mm - row_x_mm).abs() <= reach_mm;
            let mut may_be = pairs.clone().map(|(x_mm, mirrored_mm)| {
                let is_other = is_within(mirrored_mm) && (mirrored_mm - x_mm).abs() > smallest_mm;
                (is_within(*x_mm) || is_within(mirrored_mm), is_other)
            });
            let mut has_other = false;
            may_be.all(|(is_possible, is_other)| {
                has_other |= is_other;
                is_possible
            }) && has_other
        })
    }
}

/// Returns the logarithms of the resistances at rest of each of `rows`; empty if rows are known.
///
/// # Errors
/// If the sensor has no resistances at rest.
pub(super) fn rest_of_searched(
    model: &SensorModel,
    scene: &Scene,
    rows: &[usize],
) -> Result<Vec<Vec<f64>>, SensorError> {
    let at_rest = vec![glam::DVec3::ZERO; model.scale.nodes_per_row()];
    let searched = match scene.rows.model() {
        RowModel::Each => &[],
        RowModel::Shared => rows,
    };
    let rest = |&row: &usize| {
        let readings = model.row_resistances(row, &at_rest)?;
        Ok(readings.into_iter().map(f64::ln).collect())
    };
    searched.iter().map(rest).collect()
}
