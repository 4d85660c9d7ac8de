use std::{
    error::Error,
    ffi::OsString,
    io::{Write, stderr},
    process::ExitCode,
};

use clap::{Parser, Subcommand, error::ErrorKind};

use super::{
    calibrate::Calibrate, decode::Decode, export::Export, failure::Failure, fine_tune::FineTune, inspect::Inspect,
    interruption, parse_error::one_line, reproduce::Reproduce, simulate::Simulate, sweep::Sweep, trade::Trade,
    train::Train,
};
pub use decoupler_files::export::exit_leaving_nothing;

/// Opens the window and returns when it is closed.
pub type Window = fn() -> Result<(), Box<dyn Error>>;

/// Decouples flexible tactile sensor arrays with back-propagation networks.
///
/// Without a command it opens the window.
#[derive(Parser)]
#[command(name = "decoupler", version, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
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
}

/// Runs the command that `arguments` (the program's name first) name, and returns the exit status. Without a command
/// it opens `window`.
pub fn run<A: Into<OsString> + Clone>(arguments: impl IntoIterator<Item = A>, window: Window) -> ExitCode {
    let done = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments.run(window),
        // Help and version are no errors; a reader that has gone away needs neither.
        Err(told) if matches!(told.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
            told.print().map_err(Failure::Output)
        }
        Err(error) => Err(Failure::Arguments(one_line(&error))),
    };
    match done {
        Err(failure) if !failure.is_broken_pipe() => {
            // There is no one to report to if this fails.
            let _ = match &failure {
                Failure::Interrupted(_)
                | Failure::InterruptedTrials { .. }
                | Failure::InterruptedTrade { .. }
                | Failure::InterruptedSweep { .. }
                | Failure::InterruptedFollow => {
                    writeln!(stderr(), "{failure}")
                }
                _ => writeln!(stderr(), "error: {failure}"),
            };
            ExitCode::from(failure.status())
        }
        _ => ExitCode::SUCCESS,
    }
}

impl Arguments {
    fn run(self, window: Window) -> Result<(), Failure> {
        if self.command.is_some() {
            interruption::install();
        }
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
            None => {
                window().map_err(Failure::Window)?;
                // A file that took too long to be written is not left half-written.
                exit_leaving_nothing(0)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn endless_values_are_cut_in_messages() {
        let long = "1".repeat(5000);
        let error = Arguments::try_parse_from(["decoupler", "simulate", "--array", &long]);
        let line = one_line(&error.err().unwrap());
        assert!(line.contains("is not an array scale") && line.len() < 500, "{line}");
    }

    #[test]
    fn the_commands_are_declared_without_contradiction() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn whatever_is_wrong_takes_one_line() {
        let cases = [
            ("train --hiden 3", "unexpected argument '--hiden' found"),
            ("train --hidden 0", "'0' for '--hidden"),
            ("train --array 10x6", "10x10_5x30"),
            ("train --method sgd", "lm, br, varpro"),
            ("train extra", "unexpected argument 'extra'"),
            ("decode --network n", "--input <FILE> --output <FILE>"),
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
