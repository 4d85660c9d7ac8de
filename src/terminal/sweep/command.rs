use std::{
    fs::{self, File, TryLockError},
    num::NonZero,
    panic::resume_unwind,
    path::{Path, PathBuf},
    str::FromStr,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Instant,
};

use clap::{Arg, ArgAction, ArgGroup, ArgMatches, Args, Command, FromArgMatches};
use decoupler_core::{
    evaluation::{RUN_OPTIONS, RunError, RunOption, experiments::worker_threads},
    text::counted,
};
use decoupler_files::export::{
    MergedSweep, SweepTableFormat, Trial, TrialId, WriteError, atomic_write, format_duration,
};
use serde_json::json;

use indicatif::ProgressBar;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{
    specification::{Specification, TrainOptions},
    trials::{Trials, train},
};
use crate::terminal::{
    count,
    failure::Failure,
    import_arguments::ImportArguments,
    interruption::Graceful,
    output::{check_output, input, print, progress_bar, value, warn},
    seed,
};

/// Train every combination of options, on one or many machines
///
/// A specification names the options of train that all trials share and those that vary:
///
///   {"train": {"array": "10x6_3x18"}, "axes": {"hidden": [6, 8, 10], "seed": [0, 1, 2]}}
///
/// trains nine networks. A specification of a recording has the options --data, --inputs, --targets, … or --recipe in
/// "train", with paths relative to its folder, or the recipe itself in "recording". Without a specification, give the
/// same as arguments, with values separated by commas:
///
///   decoupler sweep --data press.csv --inputs c1..c4 --targets fz --hidden 4,8,12 --method lm,br --seeds 3 --out results
///
/// The output of train --json for each trial is saved as a file in the folder. Running the command again trains only
/// missing trials, and any number of programs can fill one folder together: each leaves to the others the trials that they
/// are training. Ctrl-C, SIGTERM and SIGHUP save the trainings in
/// progress, which are resumed with bit-identical results. A trial gives bit-identical results on machines with the same
/// vector instructions; on others the last digits may differ.
#[derive(Args)]
pub(in crate::terminal) struct Sweep {
    /// Specification of the trials, as JSON
    #[arg(long, value_name = "FILE", value_parser = input, required_unless_present_any = ["merge", "varied"])]
    spec: Option<PathBuf>,
    #[command(flatten)]
    given: SweepArguments,
    /// Folder for the results, created if missing; with --merge the table, as CSV or JSON depending on the file extension
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// Train only part I of N parts, which together contain every trial once
    #[arg(long, value_name = "I/N", conflicts_with = "merge")]
    shard: Option<Shard>,
    /// Number of trials trained at the same time, each on one thread [default: number of cores]
    #[arg(long, value_name = "N", value_parser = count(1..=MAX_THREADS), conflicts_with = "merge")]
    threads: Option<usize>,
    /// Write one table of all trials in these folders, and list unfinished and conflicting trials; with --spec also those that
    /// have not begun
    #[arg(long, value_name = "DIR", num_args = 1..)]
    merge: Vec<PathBuf>,
}

const MAX_THREADS: usize = 1024;

impl Sweep {
    pub(in crate::terminal) fn run(self) -> Result<(), Failure> {
        let specified = self.spec.as_deref().map(Trials::read).transpose()?;
        match specified {
            trials if !self.merge.is_empty() => self.merge(trials.as_ref()),
            Some(trials) => self.fill(&trials),
            None => self.fill(&self.given.trials()?),
        }
    }

    fn fill(&self, trials: &Trials) -> Result<(), Failure> {
        let begun = Instant::now();
        let folder = &self.out;
        Failure::make_folder(folder)?;
        let positions = self.shard.unwrap_or_default().positions(trials.count());
        let of_shard = positions.len();
        let bar = progress_bar(of_shard, "{bar:30} {pos} of {len} trials, {elapsed} elapsed");
        let stop = Stop::begin();
        let threads = self.threads.and_then(NonZero::new).unwrap_or_else(worker_threads);
        let threads = NonZero::new(of_shard).map_or(threads, |trials| threads.min(trials));
        let filled = fill(folder, trials, positions, threads, &bar, &stop);
        bar.finish_and_clear();
        let filled = filled?;
        let count = |of: Attempt| filled.iter().filter(|attempt| **attempt == of).count();
        let [present, trained, elsewhere, failed] =
            [Attempt::Present, Attempt::Trained, Attempt::Elsewhere, Attempt::Failed].map(count);
        let seconds = begun.elapsed();
        let object = || {
            json!({
                "trials": of_shard,
                "present": present,
                "trained": trained,
                "elsewhere": elsewhere,
                "failed": failed,
                "seconds": seconds.as_secs_f64(),
            })
        };
        print(object, |output| {
            let (trials, time) = (counted(of_shard, "trial"), format_duration(seconds));
            let elsewhere = match elsewhere {
                0 => String::new(),
                count => format!("{count} left to other programs that train them, "),
            };
            writeln!(
                output,
                "{trials}: {present} already done, {trained} trained, {elsewhere}{failed} failed, in {time}"
            )
        })?;
        match stop.graceful.is_end_requested() {
            true if filled.len() < of_shard => Err(Failure::Interrupted(format!(
                " after {} of {of_shard} trials; the same command trains the rest",
                present + trained
            ))),
            _ if failed > 0 => Err(Failure::FailedTrials {
                failed,
                trials: of_shard,
            }),
            _ => Ok(()),
        }
    }

    /// Merges the folders; `specified` are the trials that they should contain, if these are known.
    fn merge(&self, specified: Option<&Trials>) -> Result<(), Failure> {
        let out = &self.out;
        let format = SweepTableFormat::of(out).ok_or_else(|| {
            let message = format!(
                "--out '{}': with --merge give a file that ends in .csv or .json",
                out.display()
            );
            Failure::Arguments(message)
        })?;
        check_output("--out", out)?;
        let mut merged = MergedSweep::read(&self.merge)?;
        if let Some(trials) = specified {
            let missing = (0..trials.count()).filter(|&position| !merged.has(trials.id(position)));
            merged.missing = missing.map(|position| trials.describe(position)).collect();
        }
        atomic_write(out, |writer| format.write(&merged, writer))?;
        print(
            || value(&merged),
            |output| {
                for (what, trials) in [("missing", &merged.missing), ("conflicting", &merged.conflicting)] {
                    for trial in trials {
                        writeln!(output, "{what}: {trial}")?;
                    }
                }
                for message in &merged.damaged {
                    writeln!(output, "unreadable: {message}")?;
                }
                let trials = counted(merged.trials.len(), "trial");
                writeln!(output, "{trials}; digest of options and results: {}", merged.digest)
            },
        )?;
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

/// Trains those of the trials at `positions` that neither have a result in `folder` nor are being trained by another program,
/// each on one of `threads` threads. Returns early once `stop` is requested.
///
/// # Errors
/// If results cannot be written. A trial that cannot be trained is reported on standard error, and the others continue.
fn fill(
    folder: &Path,
    trials: &Trials,
    positions: impl Iterator<Item = usize> + Send,
    threads: NonZero<usize>,
    bar: &ProgressBar,
    stop: &Stop,
) -> Result<Vec<Attempt>, Failure> {
    let threads = threads.get();
    let pool = |_| {
        ThreadPoolBuilder::new()
            .num_threads(1)
            .thread_name(|_| "trial".to_owned())
            .build()
    };
    let pools: Result<Vec<ThreadPool>, _> = (0..threads).map(pool).collect();
    let pools = pools.map_err(|error| Failure::Run(RunError::Threads(error.to_string())))?;
    let positions = Mutex::new(positions);
    let next = || positions.lock().unwrap_or_else(PoisonError::into_inner).next();
    let work = || {
        let mut options = TrainOptions::new();
        let mut filled = Vec::new();
        while let Some(position) = next().filter(|_| !stop.is_requested()) {
            match attempt(folder, trials, position, threads, stop, &mut options)? {
                Ok(Some(attempt)) => filled.push(attempt),
                Ok(None) => break,
                Err(failure) => {
                    let trial = trials.describe(position);
                    bar.suspend(|| warn(format_args!("{trial}: {failure}; the other trials continue")));
                    filled.push(Attempt::Failed);
                }
            }
            bar.inc(1);
        }
        Ok(filled)
    };
    thread::scope(|scope| {
        let workers = pools.iter().map(|pool| {
            scope.spawn(|| {
                let worked: Result<Vec<Attempt>, WriteError> = pool.install(work);
                worked.inspect_err(|_| stop.fail())
            })
        });
        // All are started before the first is joined.
        let workers = Vec::from_iter(workers).into_iter();
        // The panic of the scope itself would not contain the reason.
        let worked = workers.map(|worker| worker.join().unwrap_or_else(|panic| resume_unwind(panic)));
        Ok(worked.collect::<Result<Vec<_>, _>>()?.concat())
    })
}

/// Outcome of a trial.
#[derive(Clone, Copy, PartialEq)]
enum Attempt {
    /// Finished before.
    Present,
    Trained,
    /// In training by another program, and left to it.
    Elsewhere,
    Failed,
}

/// Trains the trial at `position` unless it is finished or being trained; `None` if it was stopped, and saved in a checkpoint.
fn attempt(
    folder: &Path,
    trials: &Trials,
    position: usize,
    parallel: usize,
    stop: &Stop,
    options: &mut TrainOptions,
) -> Result<Result<Option<Attempt>, Failure>, WriteError> {
    let claim = match Claim::take(folder, trials.id(position))? {
        Claimed::Ours(claim) => claim,
        Claimed::Done => return Ok(Ok(Some(Attempt::Present))),
        Claimed::Theirs => return Ok(Ok(Some(Attempt::Elsewhere))),
    };
    match trials
        .get(position, options)
        .and_then(|trial| train(&trial, &claim, parallel, || stop.is_requested()))
    {
        Ok(Some(trial)) => {
            trial.save_in(folder)?;
            claim.finish();
            Ok(Ok(Some(Attempt::Trained)))
        }
        Ok(None) => Ok(Ok(None)),
        Err(failure) => Ok(Err(failure)),
    }
}

/// Requests to stop: a signal, such as the SIGTERM by which clusters announce that a job must end, or a failure of another
/// thread.
pub(super) struct Stop {
    graceful: Graceful,
    failed: AtomicBool,
}

impl Stop {
    pub(super) fn begin() -> Self {
        Self {
            graceful: Graceful::begin(),
            failed: AtomicBool::new(false),
        }
    }

    /// Stops every thread because one of them cannot continue.
    pub(super) fn fail(&self) {
        self.failed.store(true, Ordering::Relaxed);
    }

    pub(super) fn is_requested(&self) -> bool {
        self.failed.load(Ordering::Relaxed) || self.graceful.is_end_requested()
    }
}

/// The right to train a trial, held by a lock that the system releases in any case when the program ends.
pub(super) struct Claim {
    path: PathBuf,
    /// Locked while it is open.
    _file: File,
}

/// State of a trial for a program that would train it.
pub(super) enum Claimed {
    /// Claimed for this program.
    Ours(Claim),
    /// Another program is training it.
    Theirs,
    /// It already has a result.
    Done,
}

impl Claim {
    /// Claims the trial `id` of `folder`.
    pub(super) fn take(folder: &Path, id: TrialId) -> Result<Claimed, WriteError> {
        let result = Trial::path(folder, id);
        let path = folder.join(format!("{id}.claim"));
        if result.exists() {
            // A program killed at that moment left its claim next to the result; a running program still holds the lock.
            if let Ok(file) = File::options().write(true).open(&path)
                && file.try_lock().is_ok()
            {
                Self { path, _file: file }.finish();
            }
            return Ok(Claimed::Done);
        }
        let mut options = File::options();
        let file = options.create(true).truncate(false).write(true).open(&path);
        let file = file.map_err(|source| WriteError::io(&path, source))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => return Ok(Claimed::Theirs),
            // Some file systems have no locks: two programs may then train the same trial, and the first result is kept.
            Ok(()) | Err(TryLockError::Error(_)) => {}
        }
        let claim = Self { path, _file: file };
        // The last holder may have finished the trial before releasing the lock. The file is removed only after the
        // result exists, so no program can hold another lock of the same name and find no result.
        if result.exists() {
            claim.finish();
            return Ok(Claimed::Done);
        }
        Ok(Claimed::Ours(claim))
    }

    /// File of the checkpoint of the unfinished training.
    pub(super) fn checkpoint(&self) -> PathBuf {
        self.path.with_extension("checkpoint")
    }

    /// Ends the claim on a finished trial and removes all files but the result.
    pub(super) fn finish(self) {
        for path in [self.checkpoint(), self.path] {
            match fs::remove_file(path) {
                // A remaining file does no harm.
                Ok(()) | Err(_) => {}
            }
        }
    }
}

// A sweep without a specification.
#[derive(Args)]
#[command(next_help_heading = "Without a specification")]
pub(super) struct SweepArguments {
    #[command(flatten)]
    axes: Axes,
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
    #[arg(long, value_name = "N", value_parser = count(1..=1000), requires = "varied", conflicts_with = "spec")]
    seeds: Option<usize>,
    /// First seed [default: 0]
    #[arg(long, value_name = "SEED", value_parser = seed, requires = "varied", conflicts_with = "spec")]
    seed: Option<u64>,
    #[command(flatten)]
    import: ImportArguments,
}

/// Options of the settings, each with values separated by commas.
struct Axes(Vec<(String, Vec<String>)>);

impl Axes {
    /// Settings that can be varied, by their options.
    fn offered() -> impl Iterator<Item = (String, &'static RunOption)> {
        let varied = RUN_OPTIONS.iter();
        let varied = varied.filter(|row| !row.is_rare() && !["inputs", "seed"].contains(&row.setting.name));
        varied.map(|row| (row.setting.word("-"), row))
    }
}

impl Args for Axes {
    fn augment_args(command: Command) -> Command {
        let group = ArgGroup::new("varied")
            .multiple(true)
            .conflicts_with_all(["spec", "merge"]);
        let group = group.args(Self::offered().map(|(word, _)| word));
        let argument = |(word, row): (String, &RunOption)| {
            let argument = Arg::new(word.clone())
                .long(word)
                .value_name("LIST")
                .value_delimiter(',');
            argument
                .action(ArgAction::Append)
                .help(row.setting.help.trim_end_matches('.'))
        };
        command.args(Self::offered().map(argument)).group(group)
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for Axes {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let given = Self::offered().filter_map(|(word, _)| {
            let values = matches.get_many::<String>(&word)?.cloned().collect();
            Some((word, values))
        });
        Ok(Self(given.collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl SweepArguments {
    /// Trials described by the arguments.
    pub(super) fn trials(&self) -> Result<Trials, Failure> {
        let recording = match self.import.is_given() {
            true => Some(self.import.plan(&self.inputs)?),
            false => None,
        };
        if recording.is_none() {
            self.import.check_unused()?;
        }
        let first = self.seed.unwrap_or(0);
        let seeds = (0..self.seeds.unwrap_or(1) as u64).map(|number| first.wrapping_add(number).to_string());
        let mut axes = self.axes.0.clone();
        axes.push(("seed".to_owned(), seeds.collect()));
        let mut train = TrainOptions::new();
        let specification = Specification::of_arguments(recording, axes, &mut train)?;
        Trials::of(specification, &mut train)
    }
}

/// Every n-th trial, from the i-th on: one of n parts, which together contain every trial once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shard {
    /// Counted from 0.
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
    pub(super) fn positions(self, trials: usize) -> impl ExactSizeIterator<Item = usize> + Send {
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
    fn shards_contain_every_trial_once() {
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
