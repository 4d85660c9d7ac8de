//! Analysis of a recording in the terminal.

use std::{
    io::{self, IsTerminal as _, Write, stderr},
    time::{Duration, Instant},
};

use clap::{
    Args,
    builder::{PossibleValuesParser, TypedValueParser},
};
use decoupler_core::{
    dataset::{Dataset, Folds, Seed, SplitBy, Stream},
    evaluation::{
        RunError, RunSettings, Scores, TrainingSize, Workload,
        recorded::{Determinacy, Determination, Findings, FittedModel, Interval, StudyStep},
    },
    job::Job,
    network::LARGEST_HIDDEN,
    problem::Channel,
    scene::RowModel,
    text::capitalised,
};
use decoupler_files::{
    export::{describe_target, describe_warnings, format_below_one, format_duration, format_number},
    import::{Dropped, Recording},
};
use serde::Serialize;

use super::{
    count,
    failure::Failure,
    import_arguments::ImportArguments,
    inspect::{FileFound, files, write_files, write_warnings},
    output::{messages, print, print_object, progress_bar},
    samples::{with_bar, working_folder},
    seed,
};

// Models fitted to measure how well the readings determine the targets.
#[derive(Args)]
pub(super) struct StudyArguments {
    /// Columns of the sensor readings; with --targets, measure how well they determine the targets
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',')]
    pub(super) inputs: Vec<String>,
    /// Hidden nodes of the networks [default: 12]
    #[arg(long, value_name = "N", value_parser = count(1..=LARGEST_HIDDEN))]
    hidden: Option<usize>,
    /// Model that is fitted: ridge regression alone, or the network, which is compared with ridge [default: network]
    #[arg(long, value_name = "ridge|network", value_parser = model())]
    model: Option<FittedModel>,
    /// Time in seconds after which no more steps are begun; ridge regression comes first, and networks that would take much
    /// longer are not trained. What was left out is reported [default: 30; with --model, none]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    budget: Option<f64>,
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

fn seconds(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number| (0.0..1e9).contains(number));
    number.ok_or_else(|| "give a number of seconds, for example 120".to_owned())
}

/// Budget in seconds if none is given.
const BUDGET_S: f64 = 30.0;

impl StudyArguments {
    /// Returns `true` if any of them is given.
    pub(super) fn are_given(&self) -> bool {
        !self.inputs.is_empty()
            || self.hidden.is_some()
            || self.model.is_some()
            || self.budget.is_some()
            || self.seed.is_some()
    }

    /// Measures and prints how well the readings of a recording determine its targets.
    pub(super) fn run(&self, import: &ImportArguments, is_json: bool) -> Result<(), Failure> {
        const FOLDS: usize = 5;
        let plan = import.plan(&self.inputs)?;
        import.refuse_unused_shares()?;
        if plan.test.is_some() {
            let message = "--test-data: a recording is analysed by cross-validation; leave the test files out";
            return Err(Failure::Arguments(message.to_owned()));
        }
        let recording = with_bar(is_json, |watch| plan.recording(working_folder(), watch))?;
        import.save_recipe(&plan)?;
        let mut settings = RunSettings::measured(RowModel::Shared);
        settings.hidden = self.hidden.unwrap_or(settings.hidden);
        settings.seed = self.seed.map_or(settings.seed, Seed);
        let by = plan.division.by;
        let folds = import.folds.unwrap_or_else(|| by.folds_of(&recording.set, FOLDS));
        // Before the first step is announced.
        Folds::by(&recording.set, folds, by, &mut settings.seed.rng(Stream::Split)).map_err(RunError::from)?;
        let bar = progress_bar(is_json, 2, "{bar:20} {msg}");
        let begun = Instant::now();
        let begin = |stage: StudyStep| {
            bar.inc(1);
            bar.set_message(stage.to_string());
            // The bar is not shown in a log.
            if !stderr().is_terminal() {
                // There is no one to report to if this fails.
                let _ = writeln!(messages(), "{:.0} s: {stage}", begun.elapsed().as_secs_f64());
            }
        };
        let budget_s = self.budget.or(self.model.is_none().then_some(BUDGET_S));
        let is_spent = || budget_s.is_some_and(|budget_s| begun.elapsed().as_secs_f64() > budget_s);
        let time_of_networks = time_of_networks(&settings, &recording.set, folds);
        let affords_networks = budget_s.is_none_or(|budget_s| time_of_networks.as_secs_f64() <= LONGEST * budget_s);
        let affordable = match affords_networks {
            true => FittedModel::Network,
            false => FittedModel::Ridge,
        };
        let found = Findings::measure(
            &settings,
            &recording.set,
            (by, folds),
            self.model.unwrap_or(affordable),
            &begin,
            (&Job::UNINTERRUPTED, &is_spent),
        );
        bar.finish_and_clear();
        let findings = found?;
        let mut report = Report::new(by, &recording, &settings, folds, &findings);
        let mut steps = Vec::new();
        if !affords_networks && self.model.is_none() {
            let time = format_duration(time_of_networks);
            steps.push(format!("networks, of which {folds} take about {time} on one thread"));
        }
        steps.extend(findings.left_out.iter().map(|&step| left_out(step).to_owned()));
        if !steps.is_empty() {
            report.warnings.push(format!(
                "the budget of {} s does not suffice, so these were left out: {}; --budget SECONDS changes it, and --model \
                 ridge needs no networks",
                format_number(budget_s),
                steps.join("; ")
            ));
        }
        report.print(is_json)
    }
}

/// Time of the networks of a cross-validation on one thread, as a multiple of the budget, up to which they are begun: there may
/// be several threads, and most trainings end before their last epoch.
const LONGEST: f64 = 4.0;

/// Returns the estimated time of the networks of a cross-validation on one thread.
fn time_of_networks(settings: &RunSettings, set: &Dataset, folds: usize) -> Duration {
    let size = TrainingSize {
        samples: set.samples() - set.samples() / folds.max(1),
        inputs: set.channels(),
        targets: set.outputs(),
        networks: 1,
    };
    Workload::of(settings, size)
        .training_time()
        .saturating_mul(folds as u32)
}

/// Describes a step of the study that was left out.
fn left_out(step: StudyStep) -> &'static str {
    match step {
        StudyStep::Folds => "the network (R² is that of ridge regression)",
        StudyStep::OtherFolds => "the comparison with a random split",
    }
}

/// The object printed by `inspect --targets --json`.
#[derive(Serialize)]
pub(super) struct Report<'a> {
    files: Vec<FileFound>,
    rows: usize,
    samples: usize,
    dropped: &'a [Dropped],
    split: String,
    folds: usize,
    hidden: usize,
    seed: u64,
    targets: Vec<Target<'a>>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Target<'a> {
    name: &'a str,
    unit: Option<&'a str>,
    /// R² of the better of network and ridge.
    r2: Option<Interval>,
    better: Option<&'static str>,
    /// `determined`, `weakly determined`, `uncertain` or `not determined`.
    standing: Option<&'static str>,
    sentence: String,
    r2_network: Option<Interval>,
    r2_ridge: Option<Interval>,
    /// RMSE of the network relative to that of ridge.
    network_to_ridge: Option<Interval>,
    /// RMSE of the network and of ridge with honest and with random folds.
    splits: Option<Splits>,
}

#[derive(Serialize)]
struct Splits {
    by: String,
    network: f64,
    ridge: f64,
    random_network: f64,
    random_ridge: f64,
    sentence: String,
}

fn name_of(model: FittedModel) -> &'static str {
    match model {
        FittedModel::Ridge => "ridge",
        FittedModel::Network => "network",
    }
}

impl<'a> Report<'a> {
    pub(super) fn new(
        by: SplitBy,
        recording: &'a Recording,
        settings: &RunSettings,
        folds: usize,
        findings: &Findings,
    ) -> Self {
        let mut warnings = recording.warnings.clone();
        warnings.extend(describe_warnings(recording, by, findings));
        let targets = recording.targets.iter().enumerate();
        Self {
            files: files(std::iter::once(recording)),
            rows: recording.rows,
            samples: recording.set.samples(),
            dropped: &recording.dropped,
            split: by.to_string(),
            folds,
            hidden: settings.hidden,
            seed: settings.seed.0,
            targets: targets
                .map(|(index, channel)| Target::new(index, channel, findings))
                .collect(),
            warnings,
        }
    }

    pub(super) fn print(&self, is_json: bool) -> Result<(), Failure> {
        if is_json {
            return print_object(self);
        }
        print(|out| {
            write_files(&self.files, self.rows, self.dropped, out)?;
            writeln!(
                out,
                "{} samples, {} folds by {}; 95 % confidence intervals from blocks or groups of samples\n",
                self.samples, self.folds, self.split
            )?;
            self.write_targets(out)?;
            self.write_splits(out)?;
            write_warnings(&self.warnings, out)
        })
    }

    fn write_targets(&self, out: &mut impl Write) -> io::Result<()> {
        for target in &self.targets {
            write!(out, "{}", capitalised(&target.sentence))?;
            let of =
                |name: &str, r2: Option<Interval>| r2.map(|r2| format!("{name} {}", format_below_one(r2.value, 2)));
            let of: Vec<String> = [of("network", target.r2_network), of("ridge", target.r2_ridge)]
                .into_iter()
                .flatten()
                .collect();
            writeln!(
                out,
                "{}",
                if of.len() > 1 {
                    format!(" ({})", of.join(", "))
                } else {
                    String::new()
                }
            )?;
        }
        writeln!(out)
    }

    fn write_splits(&self, out: &mut impl Write) -> io::Result<()> {
        let splits: Vec<&Splits> = self
            .targets
            .iter()
            .filter_map(|target| target.splits.as_ref())
            .collect();
        if splits.is_empty() {
            return Ok(());
        }
        for splits in splits {
            writeln!(out, "{}", capitalised(&splits.sentence))?;
        }
        writeln!(out)
    }
}

impl<'a> Target<'a> {
    fn new(index: usize, channel: &'a Channel, findings: &Findings) -> Self {
        let of = &findings.targets[index];
        let (best, name) = (of.best(), &channel.name);
        let r2 = |determination: Option<Determination>| determination.map(|of| of.r2);
        Self {
            name,
            unit: channel.unit.as_deref(),
            r2: r2(best.map(|(_, determination)| determination)),
            better: best.map(|(model, _)| name_of(model)),
            standing: best.map(|(_, determination)| match determination.determinacy() {
                Determinacy::Determined => "determined",
                Determinacy::WeaklyDetermined => "weakly determined",
                Determinacy::Uncertain => "uncertain",
                Determinacy::NotDetermined => "not determined",
            }),
            sentence: describe_target(name, of),
            r2_network: r2(of.network),
            r2_ridge: r2(of.ridge.ok()),
            network_to_ridge: of.gain,
            splits: findings.comparison.as_ref().map(|comparison| {
                let rmse = |scores: &Scores| {
                    [&scores.network, &scores.baselines.linear].map(|errors| errors.targets()[index].rmse)
                };
                let [network, ridge] = rmse(&comparison.honest);
                let [random_network, random_ridge] = rmse(&comparison.random);
                Splits {
                    by: comparison.by.to_string(),
                    network,
                    ridge,
                    random_network,
                    random_ridge,
                    sentence: comparison.sentence(index, name),
                }
            }),
        }
    }
}
