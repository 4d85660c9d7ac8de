//! Where the test samples of a recording are on an axis of time.

use decoupler_core::{
    dataset::{Seed, SplitBy},
    text::format_number,
};
use decoupler_files::{figure::PlotAxis, import::Recordings};

/// Places of samples on an axis of time; of groups, if those tested are not neighbours in time; or of sample numbers.
#[derive(Clone, Debug)]
pub struct Timeline {
    /// The axis.
    pub axis: PlotAxis,
    /// Place of each sample, ascending.
    pub places: Vec<f64>,
    /// First sample after each gap.
    pub gaps: Vec<usize>,
    /// Name of each sample that has one: its group and its time.
    names: Vec<String>,
}

impl Timeline {
    /// Samples without times, one after the other.
    pub fn numbered(samples: usize) -> Self {
        Self {
            axis: PlotAxis::integers("test sample"),
            places: (1..=samples).map(|sample| sample as f64).collect(),
            gaps: Vec::new(),
            names: Vec::new(),
        }
    }

    /// The test samples of `recordings`, divided with this seed.
    pub fn of(recordings: &Recordings, seed: Seed) -> Self {
        let plan = &recordings.recorded.plan;
        let (recording, samples) = match &recordings.test {
            Some(test) => (test, Vec::from_iter(0..test.set.samples())),
            None => {
                let parts = plan.division.divide(&recordings.training.set, false, seed);
                (
                    &recordings.training,
                    parts.map_or_else(|_| Vec::new(), |parts| parts.test),
                )
            }
        };
        let times = recording.times.as_ref().map(|times| {
            let start = times.iter().copied().fold(f64::INFINITY, f64::min);
            Vec::from_iter(samples.iter().map(|&sample| times[sample] - start))
        });
        let group = |place: usize| recording.set.groups()[samples[place]];
        let has_groups = plan.import.has_groups();
        let mut gaps = times.as_deref().map_or_else(Vec::new, gaps);
        gaps.extend((1..samples.len()).filter(|&place| has_groups && group(place) != group(place - 1)));
        gaps.sort_unstable();
        gaps.dedup();
        let group_name = |place: usize| {
            let name = recording.group_names.get(group(place)).map(String::as_str);
            match (&plan.import.group, name) {
                // A number alone says little.
                (Some(column), Some(name)) if name.parse::<f64>().is_ok() => format!("{column} {name}"),
                (_, Some(name)) => name.to_owned(),
                (_, None) => format!("group {}", group(place) + 1),
            }
        };
        let clock = recording.clock.as_ref();
        let unit = clock
            .and_then(|clock| clock.unit.clone())
            .unwrap_or_else(|| "s".to_owned());
        let name = |place: usize| {
            let time = times
                .as_ref()
                .map(|times| format!("{} {unit}", format_number(times[place])));
            let group = has_groups.then(|| group_name(place));
            Vec::from_iter(group.into_iter().chain(time)).join(", ")
        };
        let names = Vec::from_iter((0..samples.len()).map(name));
        // Groups drawn at random are far from each other in time.
        let is_scattered = has_groups && (plan.division.by == SplitBy::Group || times.is_none());
        if is_scattered || times.as_ref().is_some_and(|times| !times.is_sorted()) {
            let starts = Vec::from_iter(std::iter::once(0).chain(gaps.iter().copied()).chain([samples.len()]));
            let places = starts.windows(2).enumerate().flat_map(|(stretch, ends)| {
                let last = (ends[1] - ends[0]).saturating_sub(1).max(1) as f64;
                (0..ends[1] - ends[0]).map(move |place| stretch as f64 - 0.45 + 0.9 * place as f64 / last)
            });
            let groups = starts[..starts.len() - 1].iter().map(|&first| group_name(first));
            return Self {
                places: places.collect(),
                axis: PlotAxis::of_names("", groups.collect()),
                gaps,
                names,
            };
        }
        let numbered = Self::numbered(samples.len());
        Self {
            axis: match &times {
                Some(_) => PlotAxis::linear(format!("time ({unit})")),
                None => numbered.axis,
            },
            places: times.unwrap_or(numbered.places),
            gaps,
            names,
        }
    }

    /// Returns the name of a sample.
    pub fn name(&self, sample: usize) -> String {
        let name = self.names.get(sample).filter(|name| !name.is_empty());
        name.cloned().unwrap_or_else(|| format!("Test sample {}", sample + 1))
    }
}

/// Returns the first samples after gaps in these times: steps back, and more than five times the median interval.
pub fn gaps(times: &[f64]) -> Vec<usize> {
    let intervals = Vec::from_iter(times.windows(2).map(|pair| pair[1] - pair[0]));
    let mut steps = Vec::from_iter(intervals.iter().copied().filter(|interval| *interval > 0.0));
    steps.sort_unstable_by(f64::total_cmp);
    let longest = steps.get(steps.len() / 2).map_or(f64::INFINITY, |median| 5.0 * median);
    let is_gap = |place: &usize| intervals[place - 1] < 0.0 || intervals[place - 1] > longest;
    (1..times.len()).filter(is_gap).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_is_a_step_back_or_more_than_five_intervals() {
        for (times, expected) in [
            (&[0.0, 0.1, 0.2, 0.3, 0.9, 1.0][..], &[4][..]),
            (&[0.0, 0.1, 0.2, 0.0, 0.1], &[3]),
            (&[0.0, 0.0, 0.1, 0.1, 0.2], &[]),
            (&[0.0, 0.1, 0.55], &[]),
            (&[], &[]),
        ] {
            assert_eq!(gaps(times), expected, "{times:?}");
        }
    }
}
