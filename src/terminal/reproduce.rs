use std::{
    collections::BTreeSet,
    io::{self, Write},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use clap::{Args, ValueEnum};
use decoupler_core::{
    dataset::{Seed, SplitBy},
    evaluation::{
        ErrorMeasure, MAX_STARTS, RunError,
        experiments::{
            self, Axis, AxisKind, Experiment, ExperimentResults, PaperTable, TrialSamples, run_experiments,
            worker_threads,
        },
    },
    network::LARGEST_HIDDEN,
    sensor::{ArrayScale, Geometry},
    training::StoppingRules,
};
use decoupler_files::{
    export::{
        ExperimentTable, atomic_write, cells_table, describe_conditions, describe_failures, describe_worse_than_mean,
        figures::PictureError, format_duration, trials_table, write_experiment_markdown,
    },
    figure::experiment_figure,
    machine::memory_budget,
};
use serde_json::{Value, json};

use super::{
    count,
    failure::Failure,
    interruption::Graceful,
    output::{check_output, print, progress_bar, warn},
    seed,
};

/// Reproduce the paper's tables next to the published figures
///
/// Runs every cell with several seeds on all cores and prints the published error next to the median, minimum and
/// maximum of ours and the baselines. Ctrl-C stops it and prints the finished tables.
#[derive(Args)]
#[command(allow_negative_numbers = true)]
pub(super) struct Reproduce {
    /// Table to reproduce
    #[arg(long, default_value = "all")]
    table: Tables,
    /// Number of consecutive seeds for each cell
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = count(1..=1000))]
    seeds: usize,
    /// First seed
    #[arg(long, default_value_t = 0, value_parser = seed)]
    seed: u64,
    #[arg(long, value_name = "N", value_parser = count(1..=StoppingRules::MAX_EPOCHS), help = defaults_help("Maximum number of epochs", |experiment| experiment.base.training.stopping.epochs))]
    epochs: Option<usize>,
    #[arg(long, value_name = "N", value_parser = count(1..=MAX_STARTS), help = defaults_help("Trainings of each network from different random weights; the one with the lowest validation error is kept", |experiment| experiment.base.starts))]
    starts: Option<usize>,
    /// Hidden nodes of Table 1 [default: 6,8,10,12,14,16]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = count(1..=LARGEST_HIDDEN))]
    hidden: Vec<usize>,
    /// Array scales of Table 3 [default: 10x6_3x18,10x8_4x24,10x10_5x30]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    arrays: Vec<ArrayScale>,
    /// Unit of the folds of Table 2: single samples, as in the paper, or whole snapshots, which keeps training and test
    /// samples of the same moment apart
    #[arg(long, value_enum, default_value = "sample")]
    fold_unit: Unit,
    /// Number of folds of Table 2
    #[arg(long, value_name = "K", default_value_t = 10, value_parser = count(2..=1000))]
    folds: usize,
    /// Number of times the samples of Table 2 are shuffled into new folds for each seed
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = count(1..=1000))]
    repeats: usize,
    /// Folder for the tables as CSV and Markdown and their figures as SVG and PNG; created if missing
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Tables {
    #[value(name = "1")]
    One,
    #[value(name = "2")]
    Two,
    #[value(name = "3")]
    Three,
    All,
}

#[derive(Clone, Copy, ValueEnum)]
enum Unit {
    Sample,
    Snapshot,
}

/// Help text that states the default of each table.
fn defaults_help(what: &str, value: fn(&Experiment) -> usize) -> String {
    let of = |table: PaperTable| format!("{} in Table {}", value(&table.experiment()), table.number());
    let defaults = PaperTable::ALL.map(of).join(", ");
    format!("{what} [default: {defaults}]")
}

impl Reproduce {
    pub(super) fn run(self) -> Result<(), Failure> {
        let tables = self.tables();
        let experiments: Vec<Experiment> = tables.iter().map(|&table| self.experiment(table)).collect();
        experiments.iter().try_for_each(Experiment::check)?;
        if let Some(folder) = &self.out {
            prepare_folder(folder, &tables)?;
        }
        let begun = Instant::now();
        let mut results: Vec<_> = experiments.iter().cloned().map(ExperimentResults::new).collect();
        let trials = results
            .iter()
            .flat_map(|results| &results.cells)
            .map(|cell| cell.expected)
            .sum();
        let bar = progress_bar(trials, "{bar:30} {pos} of {len} trials, {elapsed} elapsed, {msg}");
        bar.set_message("estimating the time left");
        let graceful = Graceful::begin();
        let mut done = 0;
        run_experiments(
            &experiments,
            &TrialSamples::Drawn(memory_budget()),
            worker_threads(),
            || graceful.is_end_requested(),
            |finished| {
                results[finished.experiment].record(finished.cell, finished.outcome);
                done = finished.done;
                bar.set_position(done as u64);
                if let Some(time) = finished.time_left {
                    bar.set_message(format!("about {} left", format_duration(time)));
                }
            },
        )
        .map_err(|error| match error {
            RunError::Threads(_) => Failure::Run(error),
            error => Failure::Arguments(error.to_string()),
        })?;
        bar.finish_and_clear();
        drop(graceful);
        let reproduced: Vec<Reproduced> = tables.into_iter().zip(results).collect();
        // The figures are printed even if something fails here.
        let folder = self.out.iter();
        let written = folder.flat_map(|folder| reproduced.iter().flat_map(|table| write_files(folder, table)));
        let unwritten: Vec<PictureError> = written.filter_map(Result::err).collect();
        let took = begun.elapsed();
        reproduced
            .iter()
            .flat_map(|(_, results)| describe_worse_than_mean(results))
            .for_each(warn);
        print(|| object(&reproduced, took), |out| write_text(&reproduced, took, out))?;
        if !unwritten.is_empty() {
            return Err(Failure::Files(unwritten));
        }
        if done < trials {
            return Err(Failure::Interrupted(format!(" after {done} of {trials} trials")));
        }
        Ok(())
    }

    fn tables(&self) -> Vec<PaperTable> {
        match self.table {
            Tables::One => vec![PaperTable::HiddenNodes],
            Tables::Two => vec![PaperTable::CrossValidation],
            Tables::Three => vec![PaperTable::ArrayScales],
            Tables::All => PaperTable::ALL.to_vec(),
        }
    }

    fn experiment(&self, table: PaperTable) -> Experiment {
        let mut experiment = table.experiment();
        experiment.seeds = self.seeds;
        experiment.base.seed = Seed(self.seed);
        if let Some(epochs) = self.epochs {
            experiment.base.training.stopping.epochs = epochs;
        }
        if let Some(starts) = self.starts {
            experiment.base.starts = starts;
        }
        match experiment.axis.kind {
            AxisKind::Hidden if !self.hidden.is_empty() => {
                let hidden = self.hidden.iter().map(|&hidden| hidden as u64);
                experiment.axis = Axis::integers(AxisKind::Hidden, hidden);
            }
            AxisKind::Array if !self.arrays.is_empty() => {
                experiment.axis = Axis::names(AxisKind::Array, &self.arrays);
            }
            _ => {}
        }
        if let Some(cross_validation) = &mut experiment.cross_validation {
            cross_validation.folds = self.folds;
            cross_validation.repeats = self.repeats;
            cross_validation.by = match self.fold_unit {
                Unit::Sample => SplitBy::Random,
                Unit::Snapshot => SplitBy::Group,
            };
        }
        experiment
    }
}

/// Paths of the files of a table: its cells, its trials, the table in Markdown, and the figure as SVG and PNG.
fn files(folder: &Path, table: PaperTable) -> [PathBuf; 5] {
    let number = table.number();
    [
        format!("table_{number}.csv"),
        format!("table_{number}_trials.csv"),
        format!("table_{number}.md"),
        format!("table_{number}.svg"),
        format!("table_{number}.png"),
    ]
    .map(|name| folder.join(name))
}

/// Creates the folder and checks that every file can be written, before training starts.
fn prepare_folder(folder: &Path, tables: &[PaperTable]) -> Result<(), Failure> {
    Failure::make_folder(folder)?;
    let paths = tables.iter().flat_map(|&table| files(folder, table));
    paths.into_iter().try_for_each(|path| check_output("--out", &path))
}

/// Writes every file of a table, even if others fail.
fn write_files(folder: &Path, (table, results): &Reproduced) -> [Result<(), PictureError>; 5] {
    let [cells, trials, markdown, svg, png] = files(folder, *table);
    let picture = experiment_figure(results).draw();
    let (title, conditions) = (table.heading(), describe_conditions(&results.experiment));
    let write_markdown = |writer: &mut dyn Write| write_experiment_markdown(&title, &conditions, results, writer);
    [
        atomic_write(&cells, |writer| cells_table(results).write_csv(writer)).map_err(PictureError::from),
        atomic_write(&trials, |writer| trials_table(results).write_csv(writer)).map_err(PictureError::from),
        atomic_write(&markdown, write_markdown).map_err(PictureError::from),
        picture.save(&svg),
        picture.save(&png),
    ]
}

/// A table of the paper and its results.
type Reproduced = (PaperTable, ExperimentResults);

/// The object printed by `reproduce --json`.
fn object(reproduced: &[Reproduced], took: Duration) -> Value {
    let table = |(table, results): &Reproduced| {
        json!({
            "table": table.number(),
            "title": table.title(),
            "conditions": describe_conditions(&results.experiment),
            "seeds": results.experiment.seeds,
            "cross_validation": results.experiment.cross_validation,
            "is_complete": results.is_complete(),
            "cells": Vec::from_iter(results.cells.iter().filter_map(cell_object)),
            "failures": describe_failures(results),
            "remarks": describe_worse_than_mean(results),
        })
    };
    json!({
        "seconds": took.as_secs_f64(),
        "is_complete": reproduced.iter().all(|(_, results)| results.is_complete()),
        "tables": Vec::from_iter(reproduced.iter().map(table)),
    })
}

/// Figures of a cell of an array; `None` for a recording, which does not occur in the paper's tables.
fn cell_object(cell: &experiments::Cell) -> Option<Value> {
    let settings = cell.settings;
    let simulation = settings.simulation()?;
    Some(json!({
        "array": simulation.sensor.scale,
        "hidden": settings.hidden,
        "samples": simulation.samples,
        "method": settings.training.method.short_name(),
        "epochs": settings.training.stopping.epochs,
        "starts": settings.starts,
        "seed": settings.seed,
        "trials": cell.trials.len(),
        "expected_trials": cell.expected,
        "z_percent": cell.error(ErrorMeasure::ZPercent)?,
        "x_percent": cell.error(ErrorMeasure::XPercent)?,
        "y_percent": cell.error(ErrorMeasure::YPercent)?,
        "z_mm": cell.error(ErrorMeasure::ZMm)?,
        "mean_z_percent": cell.mean_percent(),
        "linear_z_percent": cell.linear_percent(),
        "epochs_run": cell.epochs_run(),
        "training_seconds": cell.training_seconds(),
        "epoch_ms": cell.epoch_ms(),
    }))
}

/// Writes each table with its conditions.
fn write_text(reproduced: &[Reproduced], took: Duration, out: &mut dyn Write) -> io::Result<()> {
    let mut notes = BTreeSet::new();
    for (table, results) in reproduced {
        writeln!(
            out,
            "{}\n{}\n",
            table.heading(),
            describe_conditions(&results.experiment)
        )?;
        let table = ExperimentTable::new(results);
        writeln!(out, "{}", table.table.aligned())?;
        notes.insert(table.note);
        for failure in describe_failures(results) {
            writeln!(out, "{failure}")?;
        }
        writeln!(out)?;
    }
    for note in notes {
        writeln!(out, "{note}")?;
    }
    writeln!(out, "{}", Geometry::ASSUMPTION)?;
    writeln!(out, "Took {}", format_duration(took))
}
