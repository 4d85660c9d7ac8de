use clap::Args;

use super::{specification::Specification, train_options::TrainOptions, trials::Trials};
use crate::terminal::{
    failure::Failure,
    import_arguments::ImportArguments,
    parsers::{count, seed},
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
