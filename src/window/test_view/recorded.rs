use std::sync::Arc;

use ndarray::{Array2, Axis};

use decoupler_core::{
    dataset::Dataset,
    evaluation::{Channel, Problem},
    surface::SurfaceError,
};
use decoupler_files::figure::{HeatMap, RegressionLine, TargetSurface, position_error_map};

/// Test samples of a recording, ready to be drawn.
#[derive(Clone, Debug)]
pub struct RecordedTest {
    /// The samples.
    pub set: Arc<Dataset>,
    /// Description of the channels.
    pub problem: Arc<Problem>,
    /// Smallest and largest value of each target.
    pub ranges: Arc<[(f64, f64)]>,
    /// Positions of targets.
    pub positions: Positions,
}

/// Positions of targets on the skin.
#[derive(Clone, Debug)]
pub enum Positions {
    /// No target has one.
    None,
    /// No surface goes through them.
    NoSurface(SurfaceError),
    /// The surface through them.
    Surface(Arc<TargetSurface>),
}

/// What charts of all test samples of a recording show: computed away from the window's thread.
#[derive(Debug)]
pub struct TargetCharts {
    /// Lines through the actual and decoded values of each target.
    pub lines: Vec<RegressionLine>,
    /// Error over the position, or why there is none.
    pub error_map: Result<Arc<HeatMap>, &'static str>,
}

impl Positions {
    fn of(problem: &Problem) -> Self {
        if problem.positions.is_empty() {
            return Self::None;
        }
        match TargetSurface::new(&problem.positions, &problem.targets) {
            Ok(surface) => Self::Surface(Arc::new(surface)),
            Err(reason) => Self::NoSurface(reason),
        }
    }
}

impl RecordedTest {
    /// Prepares the test samples `set`, whose channels are those of `problem`.
    pub fn new(set: Arc<Dataset>, problem: Arc<Problem>) -> Self {
        let range = |target| {
            let values = set.targets();
            let extreme = |pick: fn(f64, f64) -> f64, none| values.column(target).iter().copied().fold(none, pick);
            (extreme(f64::min, f64::INFINITY), extreme(f64::max, f64::NEG_INFINITY))
        };
        Self {
            ranges: (0..set.outputs()).map(range).collect(),
            positions: Positions::of(&problem),
            set,
            problem,
        }
    }

    /// Computes the charts of these answers (samples × targets).
    pub fn charts(&self, answers: &Array2<f64>) -> TargetCharts {
        let line = |target| {
            let (actual, decoded) = (self.set.targets(), answers.column(target));
            RegressionLine::of(actual.column(target).iter().copied().zip(decoded.iter().copied()))
        };
        TargetCharts {
            lines: (0..self.set.outputs()).map(line).collect(),
            error_map: match &self.positions {
                // Targets that have positions are no positions themselves.
                Positions::None => error_map(&self.set, answers, &self.problem.targets),
                _ => Err(NO_PAIR),
            },
        }
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

/// Two targets that are positions in one unit, for a map: lengths, or without units coordinates by their names. Columns
/// without names may be anything, and so coordinates too.
fn position_pair(targets: &[Channel]) -> Option<[usize; 2]> {
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
