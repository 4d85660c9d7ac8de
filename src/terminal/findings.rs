//! Findings on a recording, in the terminal.

use clap::{
    Args,
    builder::{PossibleValuesParser, TypedValueParser},
};

use super::{
    failure::Failure,
    findings_report::Report,
    import_arguments::ImportArguments,
    output::progress_bar,
    parsers::{count, seed},
    samples::{with_bar, working_folder},
};
use decoupler_core::{
    dataset::Seed,
    evaluation::{
        Measured, RunSettings,
        recorded::{Findings, FittedModel, Stage},
    },
    network::LARGEST_HIDDEN,
    scene::RowModel,
};

// Models that are fitted to measure how well the readings determine the targets.
#[derive(Args)]
pub(super) struct StudyArguments {
    /// Columns that the sensor gives; with --targets, how well they determine the targets is measured and printed
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',')]
    pub(super) inputs: Vec<String>,
    /// Hidden nodes of the networks [default: 12]
    #[arg(long, value_name = "N", value_parser = count(1..=LARGEST_HIDDEN))]
    hidden: Option<usize>,
    /// What is fitted without each channel and to fewer samples; with ridge, no network is trained [default: the network
    /// where it is better]
    #[arg(long, value_name = "ridge|network", value_parser = model())]
    model: Option<FittedModel>,
    /// Seed of all random numbers [default: 0]
    #[arg(long, value_parser = seed)]
    seed: Option<u64>,
}

fn model() -> impl TypedValueParser<Value = FittedModel> {
    PossibleValuesParser::new(["ridge", "network"]).map(|name| match name.as_str() {
        "ridge" => FittedModel::Ridge,
        _ => FittedModel::Network,
    })
}

impl StudyArguments {
    /// Returns `true` if any of them is given.
    pub(super) fn are_given(&self) -> bool {
        !self.inputs.is_empty() || self.hidden.is_some() || self.model.is_some() || self.seed.is_some()
    }

    /// Measures how well the readings of a recording determine its targets, and prints it.
    pub(super) fn run(&self, import: &ImportArguments, is_json: bool) -> Result<(), Failure> {
        const FOLDS: usize = 5;
        let plan = import.plan(&self.inputs)?;
        if plan.test.is_some() {
            let message = "--test-data: a recording is analysed by cross-validation; leave the test files out";
            return Err(Failure::Arguments(message.to_owned()));
        }
        let recording = with_bar(is_json, |watch| plan.recording(working_folder(), watch))?;
        import.save_recipe(&plan)?;
        let mut settings = RunSettings::from(Measured { rows: RowModel::Shared });
        settings.hidden = self.hidden.unwrap_or(settings.hidden);
        settings.seed = self.seed.map_or(settings.seed, Seed);
        let by = plan.division.by;
        let folds = import.folds.unwrap_or_else(|| by.folds_of(&recording.set, FOLDS));
        let bar = progress_bar(is_json, 4, "{bar:20} {msg}");
        let begin = |stage: Stage| {
            bar.inc(1);
            bar.set_message(stage.to_string());
        };
        let divided = (&plan.division, folds);
        let found = Findings::measure(&settings, &recording.set, divided, self.model, &begin, &|| false);
        bar.finish_and_clear();
        let Some(findings) = found? else { return Ok(()) };
        Report::new(&plan, &recording, &settings, folds, &findings).print(is_json)
    }
}
