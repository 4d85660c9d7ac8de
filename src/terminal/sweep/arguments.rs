use std::str::FromStr;

use clap::Args;

use super::{specification::Specification, train_options::TrainOptions, trials::Trials};
use crate::terminal::{
    arguments::{count, seed},
    failure::Failure,
    import_arguments::ImportArguments,
};

// A sweep without a specification.
#[derive(Args)]
#[command(next_help_heading = "Without a specification")]
pub(super) struct SweepArguments {
    #[command(flatten)]
    axes: AxisArguments,
    /// Columns of --data that the network reads, separated by commas
    #[arg(
        long,
        value_name = "COLUMNS",
        value_delimiter = ',',
        requires = "data",
        conflicts_with = "spec"
    )]
    inputs: Vec<String>,
    /// Number of consecutive seeds [default: 1]
    #[arg(long, value_name = "N", value_parser = count(1..=1000), requires = "axes", conflicts_with = "spec")]
    seeds: Option<usize>,
    /// First seed [default: 0]
    #[arg(long, value_name = "SEED", value_parser = seed, requires = "axes", conflicts_with = "spec")]
    seed: Option<u64>,
    #[command(flatten)]
    import: ImportArguments,
}

// Values of the options that vary.
#[derive(Args)]
#[group(id = "axes", multiple = true, conflicts_with_all = ["spec", "merge"])]
struct AxisArguments {
    /// Numbers of hidden nodes
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    hidden: Vec<String>,
    /// Training methods
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    method: Vec<String>,
    /// Scalings of the inputs: minmax, whiten
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    scaling: Vec<String>,
    /// Maximum numbers of epochs
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    epochs: Vec<String>,
    /// Numbers of trainings from different random weights
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    starts: Vec<String>,
    /// Array scales, without --data
    #[arg(long, value_name = "LIST", value_delimiter = ',', conflicts_with_all = ["data", "recipe"])]
    array: Vec<String>,
    /// Numbers of training samples, without --data
    #[arg(long, value_name = "LIST", value_delimiter = ',', conflicts_with_all = ["data", "recipe"])]
    samples: Vec<String>,
}

impl SweepArguments {
    /// Trials of the arguments.
    pub(super) fn trials(&self) -> Result<Trials, Failure> {
        let recording = self.import.given(&self.inputs)?;
        let holds_out = self.import.holds_out();
        let axes = &self.axes;
        let axes = [
            ("array", &axes.array),
            ("samples", &axes.samples),
            ("scaling", &axes.scaling),
            ("hidden", &axes.hidden),
            ("method", &axes.method),
            ("epochs", &axes.epochs),
            ("starts", &axes.starts),
        ];
        let mut axes = Vec::from_iter(axes.into_iter().filter(|(_, values)| !values.is_empty()));
        let first = self.seed.unwrap_or(0);
        let seeds = (0..self.seeds.unwrap_or(1) as u64).map(|number| first.wrapping_add(number).to_string());
        let seeds = Vec::from_iter(seeds);
        axes.push(("seed", &seeds));
        let shared = recording.iter().filter(|_| holds_out);
        let shared = shared.map(|plan| format!("--validation-fraction={}", plan.division.validation_fraction));
        let mut train = TrainOptions::new();
        let specification = Specification::of_arguments(recording.clone(), shared.collect(), axes, &mut train)?;
        Ok(Trials::of(specification, &mut train)?)
    }
}

/// Every n-th trial, from the i-th on: one of n parts that together have every trial once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shard {
    /// From 0.
    index: usize,
    count: usize,
}

impl Default for Shard {
    fn default() -> Self {
        Self { index: 0, count: 1 }
    }
}

impl Shard {
    /// Positions of its trials among this many.
    pub(super) fn positions(self, trials: usize) -> impl Iterator<Item = usize> {
        (self.index..trials).step_by(self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/');
        let parts = parts.and_then(|(index, count)| Some((index.parse().ok()?, count.parse().ok()?)));
        match parts {
            Some((index, count)) if (1..=count).contains(&index) => Ok(Self {
                index: index - 1,
                count,
            }),
            _ => Err("give I/N, the part and the number of parts, from 1/N to N/N".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_of_any_number_have_every_trial_once() {
        for trials in [0, 1, 7, 24] {
            for count in 1..=30 {
                let shards = (1..=count).map(|index| format!("{index}/{count}").parse::<Shard>().unwrap());
                let mut positions: Vec<_> = shards.flat_map(|shard| shard.positions(trials)).collect();
                positions.sort_unstable();
                assert_eq!(positions, Vec::from_iter(0..trials), "{trials} in {count}");
            }
        }
        for wrong in ["", "1", "0/2", "3/2", "1/0", "-1/2", "1/2/3", "1/x"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
