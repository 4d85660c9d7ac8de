use std::{fs, io::Write, num::NonZero, path::PathBuf, time::Instant};

use clap::Args;
use serde::Serialize;

use super::{
    arguments::SweepArguments,
    filling::{Filled, fill},
    job_script::Engine,
    shard::Shard,
    stop::Stop,
    trials::Trials,
};
use crate::terminal::{
    failure::Failure,
    output::{print, print_object, progress_bar},
    parsers::count,
};
use decoupler_core::evaluation::experiments::worker_threads;
use decoupler_files::export::{MergedSweep, SweepTableFormat, atomic_write, check_writable, format_duration};

/// Train every combination of options, on one machine or on many
///
/// A specification names the options of train that all trials share and those that vary:
///
///   {"train": {"array": "10x6_3x18"}, "axes": {"hidden": [6, 8, 10], "seed": [0, 1, 2]}}
///
/// trains nine networks. A specification of a recording has the options --data, --inputs, --targets, … or --recipe in
/// "train", with paths relative to its folder, or the recipe itself in "recording". Without a specification the same is given
/// as arguments, with values separated by commas:
///
///   decoupler sweep --data press.csv --inputs c1..c4 --targets fz --hidden 4,8,12 --method lm,br --seeds 3 --out results
///
/// It keeps what train --json prints of each trial in a file of the folder. Running it again trains only
/// what is missing, and any number of programs may fill one folder together. Ctrl-C and SIGTERM save the trainings at
/// work, which are resumed with bit-identical results. The same trial gives the same bits on machines with the same vector
/// instructions; on others the last digits may differ.
#[derive(Args)]
pub(in crate::terminal) struct Sweep {
    /// Specification of the trials, as JSON
    #[arg(
        long,
        value_name = "FILE",
        required_unless_present_any = ["merge", "axes"],
        conflicts_with = "merge"
    )]
    spec: Option<PathBuf>,
    #[command(flatten)]
    given: SweepArguments,
    /// Folder for the results, created if missing; with --merge the table, as CSV or JSON by the ending
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Train only part I of N parts that together have every trial once
    #[arg(long, value_name = "I/N", conflicts_with_all = ["merge", "engine"])]
    shard: Option<Shard>,
    /// Number of trials trained at the same time, each on one thread [default: number of cores]
    #[arg(long, value_name = "N", value_parser = count(1..=MAX_THREADS), conflicts_with_all = ["merge", "engine"])]
    threads: Option<usize>,
    /// Print a script that has this program distribute the trials, and train nothing
    #[arg(
        long,
        value_name = "slurm|parallel|hyperqueue",
        value_enum,
        hide_possible_values = true,
        conflicts_with = "merge"
    )]
    engine: Option<Engine>,
    /// Number of jobs in the script [default: one for each trial, at most 1000]
    #[arg(long, value_name = "N", value_parser = count(1..=MAX_JOBS), requires = "engine")]
    jobs: Option<usize>,
    /// Write one table of all trials in these folders, and name those that are missing or conflict
    #[arg(long, value_name = "DIR", num_args = 1..)]
    merge: Vec<PathBuf>,
    /// Print one JSON object instead of text and progress
    #[arg(long, conflicts_with = "engine")]
    json: bool,
}

const MAX_THREADS: usize = 1024;
const MAX_JOBS: usize = 100_000;

#[derive(Serialize)]
struct FilledReport {
    trials: usize,
    present: usize,
    trained: usize,
    failed: usize,
    seconds: f64,
}

impl Sweep {
    pub(in crate::terminal) fn run(self) -> Result<(), Failure> {
        match (&self.spec, self.engine) {
            (None, _) if !self.merge.is_empty() => self.merge(),
            (None, Some(_)) => {
                let message = "--engine: jobs need a specification; write one and give it with --spec";
                Err(Failure::Arguments(message.to_owned()))
            }
            (None, None) => self.fill(&self.given.trials()?),
            (Some(specification), None) => self.fill(&Trials::read(specification)?),
            (Some(specification), Some(engine)) => {
                let trials = Trials::read(specification)?.count();
                let jobs = self.jobs.unwrap_or(Engine::MAX_JOBS).min(trials);
                let script = engine.script(specification, &self.out, trials, jobs)?;
                print(|output| write!(output, "{script}"))
            }
        }
    }

    fn fill(&self, trials: &Trials) -> Result<(), Failure> {
        let begun = Instant::now();
        let folder = &self.out;
        fs::create_dir_all(folder).map_err(|source| Failure::MakeFolder {
            path: folder.clone(),
            source,
        })?;
        trials.save_plan(folder)?;
        let positions: Vec<_> = self.shard.unwrap_or_default().positions(trials.count()).collect();
        let of_shard = positions.len();
        let bar = progress_bar(self.json, of_shard, "{bar:30} {pos} of {len} trials, {elapsed} elapsed");
        let stop = Stop::begin();
        let threads = self
            .threads
            .and_then(NonZero::new)
            .unwrap_or_else(|| worker_threads(false));
        let filled = fill(folder, trials, positions, threads, &bar, &stop);
        bar.finish_and_clear();
        let Filled {
            present,
            trained,
            failed,
        } = filled?;
        if self.json {
            print_object(&FilledReport {
                trials: of_shard,
                present,
                trained,
                failed,
                seconds: begun.elapsed().as_secs_f64(),
            })?;
        } else {
            let time = format_duration(begun.elapsed());
            print(|output| {
                writeln!(
                    output,
                    "{of_shard} trials: {present} were there, {trained} trained, {failed} failed, in {time}"
                )
            })?;
        }
        match stop.signal_status() {
            Some(status) if present + trained + failed < of_shard => Err(Failure::InterruptedSweep {
                done: present + trained,
                trials: of_shard,
                status,
            }),
            _ if failed > 0 => Err(Failure::FailedTrials {
                failed,
                trials: of_shard,
            }),
            _ => Ok(()),
        }
    }

    fn merge(&self) -> Result<(), Failure> {
        let out = &self.out;
        let format = SweepTableFormat::of(out).ok_or_else(|| {
            let message = format!(
                "--out '{}': with --merge give a file that ends in .csv or .json",
                out.display()
            );
            Failure::Arguments(message)
        })?;
        check_writable(out)?;
        let merged = MergedSweep::read(&self.merge)?;
        atomic_write(out, |writer| format.write(&merged, writer))?;
        if self.json {
            print_object(&merged)?;
        } else {
            print(|output| {
                for (what, trials) in [("missing", &merged.missing), ("conflicting", &merged.conflicting)] {
                    for trial in trials {
                        writeln!(output, "{what}: {trial}")?;
                    }
                }
                for message in &merged.damaged {
                    writeln!(output, "unreadable: {message}")?;
                }
                let trials = merged.trials.len();
                writeln!(
                    output,
                    "{trials} trials; digest of options and results: {}",
                    merged.digest
                )
            })?;
        }
        if merged.is_whole() {
            return Ok(());
        }
        Err(Failure::IncompleteSweep {
            missing: merged.missing.len(),
            conflicting: merged.conflicting.len(),
            unreadable: merged.damaged.len(),
            out: out.clone(),
        })
    }
}
