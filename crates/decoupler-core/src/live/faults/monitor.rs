use super::{
    diagnosis::{Diagnosis, FaultCause, FaultyWire, PERSISTENCE, SURE},
    evidence::{Evidence, Explained},
    row_fit::{FitPrior, RowFit, RowReadings},
    shorts::Shorts,
};
use crate::{
    dataset::{Seed, Stream},
    numerics::chi_squared_quantile,
    scene::Scene,
    sensor::{ArrayScale, SensorError, SensorModel},
};

/// Checks whether Eq. (2) explains the frames, and identifies the faulty wire if it does not.
///
/// A frame is suspicious if no deformation explains its readings: if the minimum χ² of all rows under weak priors exceeds
/// a limit that a normal frame exceeds with a probability of at most 10⁻³. At the true deformation, χ² is that of the
/// noise, with as many degrees of freedom as readings, and the minimum is never larger. When
/// [`FaultMonitor::PERSISTENCE`] consecutive frames are suspicious, all single-wire faults are compared by their
/// evidence. The most probable fault is reported if its probability is at least [`FaultMonitor::SURE`] and it explains
/// these frames by the same measure.
///
/// The readings of two touching wires may also be explained by some deformation. A short is therefore also reported if
/// the readings of two wires remain equal while the array is pressed in different ways, which is improbable for wires
/// that do not touch. It is reported until the readings differ in [`FaultMonitor::PERSISTENCE`] consecutive frames.
///
/// Checking a normal frame does not allocate.
#[derive(Clone, Debug)]
pub struct FaultMonitor {
    one: RowFit,
    two: RowFit,
    prior: FitPrior,
    shorts: Shorts,
    rows: Vec<usize>,
    columns: usize,
    nodes_per_row: usize,
    nodes_per_column: usize,
    /// χ² of the prior of a row-wire at the worst deformation within the ranges.
    of_priors: f64,
    state: State,
    /// Consecutive suspicious frames, each rows × M4.
    suspicious_ohm: Vec<f64>,
    /// Number of consecutive suspicious frames, stored or not.
    suspicious: usize,
    /// Number of suspicious frames at which faults are compared again.
    next_comparison: usize,
    /// Number of consecutive frames without a fault.
    normal: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Normal,
    Named(Diagnosis),
    Unexplained,
}

/// Event of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultEvent {
    /// A fault was identified: its wires should be left out.
    Named(Diagnosis),
    /// The readings contradict Eq. (2), and no single-wire fault explains them.
    Unexplained,
    /// The readings agree with Eq. (2) again.
    Recovered,
}

/// Normal deviate that is exceeded with a probability of 10⁻³.
const DEVIATE: f64 = 3.090_232_306_167_814;
/// Largest array that is checked: unknowns of a row, and column-wires.
const MAX_UNKNOWNS: usize = 64;
const MAX_COLUMNS: usize = 128;
/// Largest interval between comparisons of unexplained frames, in units of [`FaultMonitor::PERSISTENCE`].
const LONGEST_WAIT: usize = 1024;

impl FaultMonitor {
    /// Number of consecutive frames that must be suspicious for a fault to be reported, or normal for it to be cleared.
    pub const PERSISTENCE: usize = PERSISTENCE;
    /// Minimum probability at which a fault is reported.
    pub const SURE: f64 = SURE;

    /// Returns `true` unless the array is too large to check every frame.
    pub fn is_affordable(scale: ArrayScale, scene: &Scene) -> bool {
        scene.unknowns_per_row(scale) <= MAX_UNKNOWNS && scale.columns() <= MAX_COLUMNS
    }

    /// Prepares to check frames of `rows` with the noise of `scene`, which must not be zero.
    ///
    /// # Errors
    /// If the model has no resistance.
    pub fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        let (one, scale) = (RowFit::new(model, scene, 1)?, model.scale);
        Ok(Self {
            two: RowFit::new(model, scene, 2)?,
            prior: FitPrior::weak(model, scene),
            shorts: Shorts::new(
                model,
                scene,
                rows,
                one.log_full_scale(),
                &mut Seed(0).rng(Stream::Expectation),
            )?,
            rows: rows.to_vec(),
            columns: scale.columns(),
            nodes_per_row: scale.nodes_per_row(),
            nodes_per_column: scale.nodes_per_column(),
            // Unknowns within their ranges are at most half a width from the middle.
            of_priors: 0.25 * scene.unknowns_per_row(scale) as f64,
            state: State::Normal,
            suspicious_ohm: Vec::with_capacity(Self::PERSISTENCE * rows.len() * scale.columns()),
            suspicious: 0,
            next_comparison: Self::PERSISTENCE,
            normal: 0,
            one,
        })
    }

    /// Returns the fault currently reported.
    pub fn named(&self) -> Option<Diagnosis> {
        match self.state {
            State::Named(diagnosis) => Some(diagnosis),
            State::Normal | State::Unexplained => None,
        }
    }

    /// Checks a frame of the row-wires read: rows × M4 readings in ohm, which must be finite and above 0.
    ///
    /// # Panics
    /// If the frame has the wrong length.
    pub fn check(&mut self, frame_ohm: &[f64]) -> Option<FaultEvent> {
        self.check_zeroed(frame_ohm, frame_ohm)
    }

    /// Checks a frame divided by the gains of the unloaded state; `raw_ohm` is the frame before the division. The gains
    /// may hide a short of two row-wires that was present when they were estimated.
    ///
    /// # Panics
    /// If a frame has the wrong length.
    pub fn check_zeroed(&mut self, raw_ohm: &[f64], frame_ohm: &[f64]) -> Option<FaultEvent> {
        assert_eq!(frame_ohm.len(), self.rows.len() * self.columns);
        assert_eq!(raw_ohm.len(), frame_ohm.len());
        self.shorts.observe(raw_ohm, frame_ohm);
        let shorted = self.shorts.held();
        let is_explained = self.is_explained(frame_ohm, None);
        if let Some(shorted) = shorted
            && (is_explained || self.named().is_none())
        {
            (self.suspicious, self.normal) = (0, 0);
            let is_known = self.named().is_some_and(|named| named.wire == shorted.wire);
            if is_known {
                return None;
            }
            self.state = State::Named(shorted);
            return Some(FaultEvent::Named(shorted));
        }
        if is_explained {
            self.suspicious = 0;
            // Eq. (2) may explain touching rows, but seldom touching columns.
            let is_shorted = |named: Diagnosis| {
                matches!(named.wire, FaultyWire::Rows(_))
                    && named.cause == FaultCause::Shorted
                    && self.shorts.are_equal(named.wire)
            };
            if self.named().is_some_and(is_shorted) {
                self.normal = 0;
                return None;
            }
            self.normal += 1;
            if self.normal == Self::PERSISTENCE && self.state != State::Normal {
                self.state = State::Normal;
                self.next_comparison = Self::PERSISTENCE;
                return Some(FaultEvent::Recovered);
            }
            return None;
        }
        self.normal = 0;
        if self
            .named()
            .is_some_and(|named| self.is_explained(frame_ohm, Some(named.wire)))
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
        let found = self.compare().or(shorted);
        let longest = LONGEST_WAIT * Self::PERSISTENCE;
        let wait = if found.is_some() {
            Self::PERSISTENCE
        } else {
            (2 * self.next_comparison).min(longest)
        };
        self.next_comparison = wait;
        self.suspicious = 0;
        let state = found.map_or(State::Unexplained, State::Named);
        let is_known = std::mem::replace(&mut self.state, state) == state;
        let event = found.map_or(FaultEvent::Unexplained, FaultEvent::Named);
        (!is_known).then_some(event)
    }

    /// Returns `true` if some deformation explains the readings, excluding those of `left_out`.
    fn is_explained(&mut self, frame_ohm: &[f64], left_out: Option<FaultyWire>) -> bool {
        let (mut chi_squared, mut readings, mut rows) = (0.0, 0, 0);
        for (&row, readings_ohm) in self.rows.iter().zip(frame_ohm.chunks_exact(self.columns)) {
            if left_out.is_some_and(|wire| wire.is_row(row)) {
                continue;
            }
            let fitted = self.one.solve(RowReadings {
                rows: &[(row, &self.prior)],
                readings_ohm,
                left_out: left_out.map_or([None; 2], FaultyWire::columns),
                nodes: self.nodes_per_row,
            });
            chi_squared += fitted.chi_squared;
            readings += fitted.readings;
            rows += 1;
        }
        chi_squared <= self.limit(readings, rows)
    }

    /// Limit of χ² for a normal fit of this many readings and rows.
    fn limit(&self, readings: usize, rows: usize) -> f64 {
        chi_squared_quantile(readings, DEVIATE) + self.of_priors * rows as f64
    }

    /// The fault that explains the last suspicious frames, if there is one.
    fn compare(&mut self) -> Option<Diagnosis> {
        let evidence = Evidence {
            one: &mut self.one,
            two: &mut self.two,
            prior: &self.prior,
            rows: &self.rows,
            columns: self.columns,
            nodes_per_row: self.nodes_per_row,
            nodes_per_column: self.nodes_per_column,
            frames_ohm: &self.suspicious_ohm,
        };
        let Explained {
            diagnosis,
            chi_squared,
            readings,
            rows,
        } = evidence.compare()?;
        (diagnosis.probability >= Self::SURE && chi_squared <= self.limit(readings, rows)).then_some(diagnosis)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::Noise;

    /// Without one of two row-wires, three readings and the prior of one row remain.
    #[test]
    fn left_out_wires_do_not_count_as_degrees_of_freedom() {
        let model = SensorModel::new("2x1_1x3".parse().unwrap());
        let scene = Scene {
            noise: Noise::relative(1e-3),
            ..Scene::default()
        };
        let mut monitor = FaultMonitor::new(&model, &scene, &[0, 1]).unwrap();
        let of_row = model.row_resistances(1, &[DVec3::Z * 0.5]).unwrap();
        let largest = (0..200).map(|tenths| {
            let mut frame_ohm = [&[1e-3; 3], &of_row[..]].concat();
            frame_ohm[3] *= 1.0 + 1e-4 * f64::from(tenths);
            let is_explained = monitor.is_explained(&frame_ohm, Some(FaultyWire::Row(0)));
            let fitted = monitor.one.solve(RowReadings {
                rows: &[(1, &monitor.prior)],
                readings_ohm: &frame_ohm[3..],
                left_out: [None; 2],
                nodes: 1,
            });
            if is_explained { fitted.chi_squared } else { 0.0 }
        });
        let largest = largest.fold(0.0, f64::max);
        // The χ² distribution with 3 degrees of freedom exceeds 16.266 with a probability of 10⁻³, and the prior's χ² of
        // an unknown at the end of its range is 0.25.
        assert!((15.0..17.0).contains(&largest), "{largest}");
    }
}
