use std::{
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use clap::Args;

use super::{
    failure::Failure,
    follow_answers::{Answers, Form},
    follow_faults::Faults,
    follow_lines::Parser,
    follow_report::Report,
    interruption::Graceful,
    parsers::number,
};
use decoupler_core::live::{Keeping, Line, Lines, NextLine, ParsedLine, Source};
use decoupler_files::export::NetworkFile;

// Decoding of frames as they come.
#[derive(Args)]
pub(super) struct Follow {
    /// Decode frames as they come, each answer written to standard output at once
    ///
    /// --input is then - for standard input, a file or pipe, a serial port as DEVICE:BAUD, or tcp:HOST:PORT. A line is a
    /// row-wire as without --follow, also with the number of the row before the resistances, or a whole snapshot, row by
    /// row. From a file or pipe every line is decoded; from a port or socket the latest, once a line has waited for 0.1 s.
    /// Bad lines are counted and reported.
    #[arg(long, conflicts_with = "output")]
    pub(super) follow: bool,
    /// With --follow: form of the answers [default: csv]
    #[arg(long, value_name = "csv|jsonl", hide_possible_values = true)]
    format: Option<Form>,
    /// With --follow: report rate and latency on standard error every N seconds; always at the end, and on SIGUSR1
    #[arg(long, value_name = "SECONDS", value_parser = number)]
    report: Option<f64>,
    /// With --follow: relative noise of the readings (standard deviation) by which faults are judged [default: that of the
    /// network's scene]
    #[arg(long, value_name = "REL", value_parser = number)]
    noise: Option<f64>,
}

/// Longest wait for a line between looks at requests for a report and for the end.
const WAIT: Duration = Duration::from_millis(100);
/// Shortest time between checks for faults of frames from a device, so that they cost no frame.
const BETWEEN_CHECKS: Duration = Duration::from_millis(10);

impl Follow {
    /// Refuses arguments that only --follow uses.
    pub(super) fn check_unused(&self) -> Result<(), Failure> {
        let given = [
            (self.format.is_some(), "--format"),
            (self.report.is_some(), "--report"),
            (self.noise.is_some(), "--noise"),
        ];
        match given.into_iter().find(|(is_given, _)| *is_given) {
            Some((_, argument)) => Err(wrong(argument, "it needs --follow")),
            None => Ok(()),
        }
    }

    /// Gives every line of `source` to `take`, until it ends or fails, or until Ctrl-C; of a device, `kept` lines are kept at
    /// first. Reports as asked, on SIGUSR1, and at the end.
    fn follow(
        &self,
        source: Source,
        kept: usize,
        mut take: impl FnMut(Line<'_>, &mut Report) -> Result<Kept, Failure>,
    ) -> Result<(), Failure> {
        let asked = Arc::new(AtomicBool::new(false));
        // Without the signal there are still reports every so often and at the end.
        #[cfg(unix)]
        let _ = signal_hook::flag::register(signal_hook::consts::SIGUSR1, Arc::clone(&asked));
        let opened = source.open().map_err(Failure::Source)?;
        let spawned = Lines::spawn(opened, source.keeping(), source.begins_anywhere());
        let mut lines = spawned.map_err(Failure::Reader)?;
        lines.set_kept(kept);
        let graceful = Graceful::begin();
        let mut report = Report::new(source);
        let every = self.report.map(Duration::from_secs_f64);
        let end = loop {
            if asked.swap(false, Ordering::SeqCst) || every.is_some_and(|every| report.is_due(every)) {
                report.tell(lines.dropped());
            }
            if graceful.is_end_requested() {
                break Err(Failure::InterruptedFollow);
            }
            let line = match lines.next(WAIT) {
                NextLine::Line(line) => line,
                NextLine::None => continue,
                NextLine::End(Some(error)) => {
                    let input = report.source().clone();
                    break Err(Failure::Lost { input, source: error });
                }
                NextLine::End(None) => break report.end(),
            };
            match take(line, &mut report) {
                Ok(Kept::AsBefore) => {}
                Ok(Kept::Latest) => lines.set_kept(1),
                Err(failure) => break Err(failure),
            }
        };
        report.tell(lines.dropped());
        end
    }

    /// The source that `input` names, after a check of the other arguments.
    fn source(&self, input: &Path) -> Result<Source, Failure> {
        let input = input
            .to_str()
            .ok_or_else(|| wrong("--input", "its name is not UTF-8"))?;
        let source: Source = input.parse().map_err(|error| wrong("--input", error))?;
        if self.report.is_some_and(|seconds| !(seconds > 0.0 && seconds <= 1e9)) {
            return Err(wrong("--report", "give a number of seconds above 0"));
        }
        Ok(source)
    }

    /// Decodes `input` with the network of `file` until it ends, or until Ctrl-C.
    pub(super) fn run(&self, input: &Path, file: &NetworkFile) -> Result<(), Failure> {
        let simulated = file.settings.simulated();
        if simulated.is_none() && self.noise.is_some() {
            let reason = "the network of a recording has no model of a sensor to judge its faults; leave it out";
            return Err(wrong("--noise", reason));
        }
        let source = self.source(input)?;
        let keeping = source.keeping();
        let mut parser = Parser::new(file, keeping == Keeping::All)?;
        let mut answers = Answers::new(file, self.format.unwrap_or_default())?;
        let mut faults = match &simulated {
            Some(settings) => Faults::new(&settings.source, self.noise)?,
            None => Faults::none(),
        };
        let mut checked: Option<Instant> = None;
        let input = source.clone();
        let end = self.follow(source, answers.rows(), |Line { number, text, read_at }, report| {
            let Some(text) = text else {
                parser.count_bad();
                report_too_long(number, report);
                return Ok(Kept::AsBefore);
            };
            let parsed = match parser.parse(number, text) {
                Ok(ParsedLine::NoReadings) => return Ok(Kept::AsBefore),
                Ok(parsed) => parsed,
                Err(error) if error.is_final() && !(input.begins_anywhere() && number == 1) => {
                    return Err(error.failure(input.clone()));
                }
                Err(error) => {
                    report.bad(&error);
                    return Ok(Kept::AsBefore);
                }
            };
            let is_whole = faults.take(number, parsed);
            match answers.write(number, parsed, faults.left_out()) {
                Ok(true) => report.good(read_at.elapsed()),
                Ok(false) => {
                    report.bad(&format_args!(
                        "line {number}: readings so far from the training range that the network has no answer"
                    ));
                    return Ok(Kept::AsBefore);
                }
                Err(error) => return Err(Failure::Output(error)),
            }
            let is_snapshot = matches!(parsed, ParsedLine::Snapshot(_));
            let is_due = checked.is_none_or(|checked| checked.elapsed() >= BETWEEN_CHECKS);
            if is_whole && (keeping == Keeping::All || is_due) {
                faults.check(number);
                checked = Some(Instant::now());
            }
            Ok(if is_snapshot { Kept::Latest } else { Kept::AsBefore })
        });
        answers.warn();
        end
    }
}

/// Lines of a device that are kept while others come.
enum Kept {
    /// As many as before.
    AsBefore,
    /// Only the latest.
    Latest,
}

fn report_too_long(number: u64, report: &mut Report) {
    report.bad(&format_args!(
        "line {number}: it is longer than {} bytes",
        Lines::LONGEST
    ));
}

fn wrong(argument: &str, reason: impl std::fmt::Display) -> Failure {
    Failure::Arguments(format!("{argument}: {reason}"))
}
