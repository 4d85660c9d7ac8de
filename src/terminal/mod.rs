//! The command line: `decoupler train`, `inspect`, `decode`, `export`, `calibrate`, `fine-tune`, `simulate`,
//! `reproduce`, `trade` and `sweep`.
//!
//! A command ends with status 0 on success, 1 on failure, and 2 for invalid arguments; the last two with one line on
//! standard error. Ctrl-C, SIGTERM and SIGHUP end it with status 130, 143 and 129; `train` first saves its results.
//!
//! Parsers of values used by several commands.

mod calibrate;
mod cross_validation;
pub(crate) mod decode;
mod export;
pub(crate) mod failure;
mod file_patterns;
mod follow;
mod import_arguments;
mod inspect;
mod interruption;
mod intervals;
pub(crate) mod output;
mod reproduce;
mod samples;
mod settings_arguments;
mod sweep;
mod trade;
mod train;
mod train_report;

pub use decoupler_files::export::exit_leaving_nothing;

use std::{
    error::Error,
    ffi::OsString,
    io::Write,
    ops::{RangeBounds, RangeInclusive},
    path::PathBuf,
    process::ExitCode,
};

use calibrate::Calibrate;
use clap::{CommandFactory, Parser, Subcommand, error::ErrorKind};
use clap_complete::Shell;
use decode::{Decode, FineTune};
use decoupler_files::machine::limit_memory;
use export::Export;
use failure::Failure;
use inspect::Inspect;
use output::{OutputArguments, messages};
use reproduce::Reproduce;
use samples::Simulate;
use settings_arguments::RARELY;
use sweep::Sweep;
use trade::Trade;
use train::Train;

/// Opens the window with these files, and returns when it is closed.
pub type Window = fn(Vec<PathBuf>) -> Result<(), Box<dyn Error>>;

/// Decouples flexible tactile sensor arrays with back-propagation networks.
///
/// Without a command it opens the window; decoupler FILE… opens it with these files.
#[derive(Parser)]
#[command(name = "decoupler", version, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    output: OutputArguments,
    /// Memory that trainings may use, and reading a file, in GB [default: that of the machine, and half of the free memory]
    #[arg(long, value_name = "GB", global = true, hide_short_help = true, help_heading = RARELY, value_parser = within(f64::MIN_POSITIVE.., "a number of GB above 0, for example 16"))]
    memory_limit: Option<f64>,
}

#[derive(Subcommand)]
enum Command {
    Train(Box<Train>),
    Inspect(Box<Inspect>),
    Decode(Decode),
    Export(Export),
    Calibrate(Box<Calibrate>),
    FineTune(Box<FineTune>),
    Simulate(Box<Simulate>),
    Reproduce(Reproduce),
    Trade(Box<Trade>),
    Sweep(Box<Sweep>),
    /// Print a script that completes commands and options in a shell
    Completions {
        /// Shell for which to write it
        shell: Shell,
    },
}

/// Runs the command in `arguments` (program name first), and returns the exit status. Without a command it opens
/// `window`.
pub fn run<A: Into<OsString> + Clone>(arguments: impl IntoIterator<Item = A>, window: Window) -> ExitCode {
    run_for_status(arguments, window).into()
}

/// As [`run`], for a program that passes the status on as a number.
pub fn run_for_status<A: Into<OsString> + Clone>(arguments: impl IntoIterator<Item = A>, window: Window) -> u8 {
    let arguments = Vec::from_iter(arguments.into_iter().map(Into::into));
    let files = arguments.iter().skip(1).map(PathBuf::from);
    output::begin();
    let begins_with_command = || {
        let commands = Arguments::command();
        let is_command = |word: &OsString| commands.get_subcommands().any(|command| *command.get_name() == **word);
        arguments.get(1).is_none_or(is_command)
    };
    let done = match Arguments::try_parse_from(&arguments) {
        // Only files, and no command.
        Err(_) if !begins_with_command() && files.clone().all(|file| file.exists()) => {
            window(files.collect()).map_err(Failure::Window)
        }
        Ok(arguments) => arguments.run(window),
        // Help and version are not errors; a closed output needs neither.
        Err(message) if matches!(message.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
            message.print().map_err(Failure::Output)
        }
        Err(error) => Err(Failure::Arguments(one_line(&error))),
    };
    match done {
        Err(failure) if !failure.is_broken_pipe() => {
            // There is no one to report to if this fails.
            let _ = match &failure {
                Failure::Interrupted(_) => writeln!(messages(), "{failure}"),
                _ => writeln!(messages(), "error: {}", without_long_words(&failure.to_string())),
            };
            failure.status()
        }
        _ => 0,
    }
}

impl Arguments {
    fn run(self, window: Window) -> Result<(), Failure> {
        if self.command.is_some() {
            interruption::install();
        }
        if let Some(gigabytes) = self.memory_limit {
            limit_memory(gigabytes);
        }
        self.output.apply();
        match self.command {
            Some(Command::Train(train)) => train.run(),
            Some(Command::Inspect(inspect)) => inspect.run(),
            Some(Command::Decode(decode)) => decode.run(),
            Some(Command::Export(export)) => export.run(),
            Some(Command::Calibrate(calibrate)) => calibrate.run(),
            Some(Command::FineTune(fine_tune)) => fine_tune.run(),
            Some(Command::Simulate(simulate)) => simulate.run(),
            Some(Command::Reproduce(reproduce)) => reproduce.run(),
            Some(Command::Trade(trade)) => trade.run(),
            Some(Command::Sweep(sweep)) => sweep.run(),
            Some(Command::Completions { shell }) => {
                clap_complete::generate(shell, &mut Arguments::command(), "decoupler", &mut std::io::stdout());
                Ok(())
            }
            None => {
                window(Vec::new()).map_err(Failure::Window)?;
                // A file that takes too long to write is not left incomplete.
                exit_leaving_nothing(0)
            }
        }
    }
}

/// Returns a parser of integers in `allowed`.
pub(super) fn count(allowed: RangeInclusive<usize>) -> impl Fn(&str) -> Result<usize, String> + Clone {
    move |text| {
        let count = text.parse().ok().filter(|count| allowed.contains(count));
        count.ok_or_else(|| format!("give a whole number from {} to {}", allowed.start(), allowed.end()))
    }
}

/// Returns a parser of numbers in `allowed`; `what` completes "give …".
pub(super) fn within(
    allowed: impl RangeBounds<f64> + Clone,
    what: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| {
        let number = text
            .parse()
            .ok()
            .filter(|number: &f64| number.is_finite() && allowed.contains(number));
        number.ok_or_else(|| format!("give {what}"))
    }
}

/// Parses a finite number that is not negative.
pub(super) fn number(text: &str) -> Result<f64, String> {
    within(0.0.., "a number from 0, for example 1e-7")(text)
}

/// Parses a seed.
pub(super) fn seed(text: &str) -> Result<u64, String> {
    text.parse()
        .map_err(|_| format!("give a whole number from 0 to {}", u64::MAX))
}

/// Returns the parser's message on one line, without the usage text.
pub(super) fn one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let paragraphs = text.split("\n\n").map(|paragraph| {
        let lines: Vec<_> = paragraph.lines().map(str::trim).collect();
        lines.join(" ")
    });
    let messages = paragraphs.filter(|paragraph| {
        let aside = ["Usage:", "For more information"];
        !paragraph.is_empty() && !aside.iter().any(|start| paragraph.starts_with(start))
    });
    let line = messages.collect::<Vec<_>>().join("; ");
    let line = line.strip_prefix("error: ").unwrap_or(&line);
    without_long_words(line)
}

/// Returns a message without the middle of long words, such as arguments and names that it quotes.
fn without_long_words(message: &str) -> String {
    const LONGEST: usize = 300;
    const BEGINNING: usize = 150;
    const END: usize = 100;
    let shortened = |word: &str| match word.chars().count() {
        length if length > LONGEST => {
            let end = word.chars().skip(length - END);
            word.chars().take(BEGINNING).chain(['…']).chain(end).collect()
        }
        _ => word.to_owned(),
    };
    message.split(' ').map(shortened).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn long_values_are_truncated_in_messages() {
        let long = "1".repeat(5000);
        let error = Arguments::try_parse_from(["decoupler", "simulate", "--array", &long]);
        let line = one_line(&error.err().unwrap());
        assert!(line.contains("is not an array scale") && line.len() < 800, "{line}");
    }

    #[test]
    fn the_commands_are_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn every_error_takes_one_line() {
        let cases = [
            ("train --hiden 3", "unexpected argument '--hiden' found"),
            ("train --hidden 0", "'0' for '--hidden"),
            ("train --array 10x6", "10x10_5x30"),
            ("train --method sgd", "lm, br, scg"),
            ("train extra", "unexpected argument 'extra'"),
            ("decode --network n", "--data <FILE> --out <FILE>"),
            ("trian", "unrecognized subcommand 'trian'"),
            ("train --seed", "a value is required"),
        ];
        for (arguments, expected) in cases {
            let arguments = std::iter::once("decoupler").chain(arguments.split(' '));
            let line = one_line(&Arguments::try_parse_from(arguments).err().unwrap());
            assert!(line.contains(expected), "{line}");
            assert!(!line.contains('\n') && !line.contains("Usage"), "{line}");
        }
    }
}
