use std::{sync::Arc, time::Duration};

use ndarray::{Array2, Axis};

use crate::{
    app::shared::Phase,
    dataset::Dataset,
    evaluation::Channel,
    evaluation::{TargetErrors, TargetRow},
    export::{MeasuredCheckpointFile, MeasuredNetworkFile},
    figure::{HeatMap, RegressionLine, TargetSurface, position_error_map},
    import::Recording,
    surface::SurfaceError,
};

/// A network trained on recordings, as far as the window knows it.
#[derive(Clone, Debug)]
pub(super) struct Trained {
    /// Name in the list of runs.
    pub(super) name: String,
    /// Settings, plan, network, record and errors.
    pub(super) file: Arc<MeasuredNetworkFile>,
    /// Test samples and the network's answers, if they are at hand.
    pub(super) tested: Option<Arc<Tested>>,
    /// State of its training.
    pub(super) phase: Phase,
    /// Epochs run by the start that is furthest.
    pub(super) epochs_run: usize,
    /// Time of the training by the clock, if it is known.
    pub(super) wall_time: Option<Duration>,
    /// Defect of the training, once that has ended.
    pub(super) flaw: Option<String>,
    /// Remarks beside the errors.
    pub(super) remarks: Vec<String>,
    /// The training as it stands, while it is paused or has ended.
    pub(super) checkpoint: Option<Arc<MeasuredCheckpointFile>>,
}

/// Test samples and the answers to them.
#[derive(Debug)]
pub(super) struct Tested {
    set: Arc<Dataset>,
    /// Samples × targets.
    pub(super) answers: Array2<f64>,
    /// Least and largest value of each target.
    pub(super) ranges: Vec<(f64, f64)>,
    /// Lines through the actual and decoded values of each target.
    pub(super) lines: Vec<RegressionLine>,
    /// Error over the position, or why there is none.
    pub(super) error_map: Result<Arc<HeatMap>, &'static str>,
    /// Positions of targets.
    pub(super) positions: Positions,
}

/// Positions of targets on the skin.
#[derive(Clone, Debug)]
pub(super) enum Positions {
    /// No target has one.
    None,
    /// No surface goes through them.
    NoSurface(SurfaceError),
    /// The surface through them.
    Surface(Arc<TargetSurface>),
}

impl Positions {
    /// The positions in a recording.
    pub(super) fn of(recording: &Recording) -> Self {
        if recording.positions.is_empty() {
            return Self::None;
        }
        match TargetSurface::new(&recording.positions, &recording.targets) {
            Ok(surface) => Self::Surface(Arc::new(surface)),
            Err(reason) => Self::NoSurface(reason),
        }
    }
}

impl Tested {
    /// Test samples with the answers to them, and what charts of all of them show: computed here, away from the window's
    /// thread.
    pub(super) fn new(
        set: impl Into<Arc<Dataset>>,
        answers: Array2<f64>,
        positions: Positions,
        targets: &[Channel],
    ) -> Self {
        let set: Arc<Dataset> = set.into();
        let range = |target| {
            let values = set.targets();
            let extreme = |pick: fn(f64, f64) -> f64, none| values.column(target).iter().copied().fold(none, pick);
            (extreme(f64::min, f64::INFINITY), extreme(f64::max, f64::NEG_INFINITY))
        };
        let line = |target| {
            let (actual, decoded) = (set.targets(), answers.column(target));
            RegressionLine::of(actual.column(target).iter().copied().zip(decoded.iter().copied()))
        };
        let error_map = match &positions {
            // Targets that have positions are no positions themselves.
            Positions::None => error_map(&set, &answers, targets),
            _ => Err(NO_PAIR),
        };
        Self {
            ranges: (0..set.outputs()).map(range).collect(),
            lines: (0..set.outputs()).map(line).collect(),
            error_map,
            answers,
            set,
            positions,
        }
    }

    /// The test samples.
    pub(super) fn set(&self) -> &Dataset {
        &self.set
    }

    /// Errors of the answers, target by target.
    pub(super) fn errors(&self) -> Vec<TargetErrors> {
        TargetErrors::measure(self.set.targets(), self.answers.view())
    }

    /// Actual and decoded value of a target of a sample.
    pub(super) fn pair(&self, sample: usize, target: usize) -> (f64, f64) {
        let at = [sample, target];
        (self.set.targets()[at], self.answers[at])
    }
}

const NO_PAIR: &str = "A map needs two targets that are positions: lengths in the same unit, or both without a unit.";

fn error_map(set: &Dataset, answers: &Array2<f64>, targets: &[Channel]) -> Result<Arc<HeatMap>, &'static str> {
    let pair = position_pair(targets).ok_or(NO_PAIR)?;
    let [actual, answers] = [set.targets(), answers.view()].map(|values| values.select(Axis(1), &pair));
    let names = pair.map(|target| targets[target].name.as_str());
    let map = position_error_map(actual.view(), answers.view(), names, targets[pair[0]].unit.as_deref());
    map.map(Arc::new)
        .ok_or("The positions of the test samples do not vary, so there is no map.")
}

impl Trained {
    /// The network of a file, without test samples.
    pub(super) fn of_file(file: Arc<MeasuredNetworkFile>) -> Self {
        Self {
            name: String::new(),
            epochs_run: file.training.history.last().map_or(0, |record| record.epoch),
            phase: file.training.stop_reason.map_or(Phase::Idle, Phase::Ended),
            tested: None,
            wall_time: None,
            flaw: None,
            remarks: Vec::new(),
            checkpoint: None,
            file,
        }
    }

    /// Positions of the targets, as far as the test samples are at hand.
    pub(super) fn positions(&self) -> &Positions {
        self.tested
            .as_ref()
            .map_or(&Positions::None, |tested| &tested.positions)
    }

    /// Errors of the mean, of ridge and of the network, in this order.
    pub(super) fn rows(&self) -> [(&'static str, &[TargetErrors]); 3] {
        [
            ("training mean", &self.file.mean),
            ("ridge", &self.file.ridge),
            ("network", &self.file.errors),
        ]
    }
}

/// Result of a cross-validation.
#[derive(Clone, Debug)]
pub(super) struct Validated {
    /// Number of folds, and the rule by which they were made.
    pub(super) folds: String,
    /// Number of samples, each tested once.
    pub(super) samples: usize,
    /// Names and units of the targets.
    pub(super) targets: Vec<Channel>,
    /// Errors of the mean, of ridge and of the networks.
    pub(super) table: Vec<TargetRow>,
    /// Remarks on the readings, target by target, and where a network is no better than ridge.
    pub(super) remarks: Vec<String>,
}

/// Two targets that are positions in one unit, for a map: lengths, or without units coordinates by their names. Columns
/// without names may be anything, and so coordinates too.
pub(super) fn position_pair(targets: &[Channel]) -> Option<[usize; 2]> {
    const LENGTHS: [&str; 6] = ["m", "cm", "mm", "µm", "um", "nm"];
    let may_be = |channel: &Channel| match &channel.unit {
        None => is_coordinate(&channel.name),
        Some(unit) => LENGTHS.contains(&unit.trim()),
    };
    let candidates = Vec::from_iter((0..targets.len()).filter(|&target| may_be(&targets[target])));
    let pairs = candidates.iter().enumerate();
    let mut pairs = pairs.flat_map(|(place, &one)| candidates[place + 1..].iter().map(move |&other| [one, other]));
    pairs.find(|[one, other]| targets[*one].unit == targets[*other].unit)
}

/// Tells whether a full name ends as that of a coordinate, such as `probe_x`, or is that of a column without a header.
fn is_coordinate(name: &str) -> bool {
    let own = name.rsplit('.').next().unwrap_or(name).to_lowercase();
    let has_no_header = own
        .strip_prefix('c')
        .is_some_and(|number| number.parse::<usize>().is_ok());
    let last = own
        .rsplit(|letter: char| !letter.is_alphanumeric())
        .next()
        .unwrap_or_default();
    has_no_header || ["x", "y", "z", "px", "py", "pz"].contains(&last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_needs_two_coordinates_in_one_unit() {
        let pair = |titles: &str| {
            let channel = |title: &str| {
                let (name, unit) = title.split_once('/').unwrap_or((title, ""));
                Channel {
                    name: name.to_owned(),
                    unit: (!unit.is_empty()).then(|| unit.to_owned()),
                }
            };
            position_pair(&Vec::from_iter(titles.split(' ').map(channel)))
        };
        for (titles, expected) in [
            ("x/mm y/mm", Some([0, 1])),
            ("force/N a/mm b/mm", Some([1, 2])),
            ("x/mm y/cm", None),
            ("fx/N fy/N", None),
            ("states.c2 states.c3", Some([0, 1])),
            ("probe_x probe.y", Some([0, 1])),
            ("weight waist", None),
        ] {
            assert_eq!(pair(titles), expected, "{titles}");
        }
    }
}
