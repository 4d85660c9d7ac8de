//! Live decoding: lines are parsed and decoded as they arrive.

use std::{
    io::Write,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use clap::Args;
use decoupler_core::{
    dataset::{DatasetError, Place, Simulation},
    live::{FaultEvent, WireCheck},
    scene::Noise,
};
use decoupler_files::{
    export::NetworkFile,
    import::{LineError, LineParser, ParsedLine},
    live::{Keeping, Line, Lines, NextLine, Source},
};

use super::{
    failure::Failure,
    follow_report::{Answers, Form, Report},
    interruption::Graceful,
    number,
    output::messages,
};

// Decoding of live frames.
#[derive(Args)]
pub(super) struct Follow {
    /// Decode frames as they arrive, writing each answer to standard output at once
    ///
    /// --input is then - for standard input, a file or pipe, a serial port as DEVICE:BAUD, or tcp:HOST:PORT. A line has
    /// the resistances of one row-wire as without --follow, optionally after its row number, or of a whole snapshot, row
    /// by row. From a file or pipe every line is decoded; from a port or socket, older lines are dropped once a line has
    /// waited for 0.1 s. Bad lines are counted and reported.
    #[arg(long, conflicts_with = "output")]
    pub(super) follow: bool,
    /// With --follow: output format [default: csv]
    #[arg(long, value_name = "csv|jsonl", hide_possible_values = true)]
    format: Option<Form>,
    /// With --follow: report rate and latency on standard error every N seconds; always at the end, and on SIGUSR1
    #[arg(long, value_name = "SECONDS", value_parser = number)]
    report: Option<f64>,
    /// With --follow: relative noise of the readings (standard deviation) assumed in fault detection [default: that of
    /// the network's scene]
    #[arg(long, value_name = "REL", value_parser = number)]
    noise: Option<f64>,
}

/// Timeout of waiting for a line, after which requests for a report and to stop are checked.
const WAIT: Duration = Duration::from_millis(100);
/// Minimum time between fault checks of frames from a device, so that no frame is dropped because of them.
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

    /// Passes every line of `source` to `take`, until the source ends or fails, or a request to stop. For a device, `kept`
    /// lines are kept initially. Reports at the requested interval, on SIGUSR1, and at the end.
    fn follow(
        &self,
        source: Source,
        kept: usize,
        mut take: impl FnMut(Line<'_>, &mut Report) -> Result<Kept, Failure>,
    ) -> Result<(), Failure> {
        let asked = Arc::new(AtomicBool::new(false));
        // Without the signal there are still reports at intervals and at the end.
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
                report.print(lines.dropped());
            }
            if graceful.is_end_requested() {
                break Err(Failure::InterruptedFollow);
            }
            let line = match lines.next(WAIT) {
                NextLine::Line(line) => line,
                NextLine::None => {
                    report.waiting(lines.unended());
                    continue;
                }
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
        report.print(lines.dropped());
        end
    }

    /// Source named by `input`, after a check of the other arguments.
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
        let sensor = file.problem.sensor.as_ref();
        if sensor.is_none() && self.noise.is_some() {
            let reason =
                "fault detection needs a sensor model, which the network of a recording does not have; leave it out";
            return Err(wrong("--noise", reason));
        }
        let source = self.source(input)?;
        let keeping = source.keeping();
        let mut parser = Parser::new(file, keeping == Keeping::All)?;
        let mut answers = Answers::new(file, self.format.unwrap_or_default())?;
        let mut faults = match sensor {
            Some(simulation) => Faults::new(simulation, self.noise)?,
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
                Ok(ParsedLine::NoReadings | ParsedLine::Start { .. }) => return Ok(Kept::AsBefore),
                Ok(parsed) => parsed,
                Err(error) if error.is_final() && !(input.begins_anywhere() && number == 1) => {
                    return Err(Failure::Line(input.clone(), error));
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
                        "line {number}: the readings are so far outside the training range that the network's \
                         output is not a finite number"
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

/// Lines of a device that are kept when older ones are dropped.
enum Kept {
    /// The same number as before.
    AsBefore,
    /// Only the latest line.
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

/// Parser of the lines of an array or of a recording, which warns once.
pub(super) struct Parser {
    lines: LineParser,
    /// True once it was reported that the time steps back.
    has_stepped_back: bool,
}

impl Parser {
    /// Prepares to parse lines for the network of `file`. `is_complete` is true if no line of the input is lost.
    pub(super) fn new(file: &NetworkFile, is_complete: bool) -> Result<Self, Failure> {
        Ok(Self {
            lines: file.line_parser(is_complete)?,
            has_stepped_back: false,
        })
    }

    /// Returns the parsed line.
    pub(super) fn parse(&mut self, line: u64, text: &[u8]) -> Result<ParsedLine<'_>, LineError> {
        let parsed = self.lines.parse(line, text)?;
        match parsed {
            ParsedLine::Start { is_first: true } => warn(&format!(
                "line {line}: the lines at the start give the means of derived columns and are not decoded"
            )),
            ParsedLine::Row {
                place: Some(Place::AfterStepBack(_)),
                ..
            } if !std::mem::replace(&mut self.has_stepped_back, true) => warn(&format!(
                "line {line}: the time steps back: the history of readings restarts here and at every further \
                 step back; send the lines in order of time"
            )),
            _ => {}
        }
        Ok(parsed)
    }

    /// Counts a line that is too long to be parsed.
    pub(super) fn count_bad(&mut self) {
        self.lines.count_bad();
    }
}

/// Checks the frames composed of the lines for faults, and reports them.
pub(super) struct Faults {
    watch: Option<Watch>,
    /// True once it was reported that lines without a row number are not checked.
    is_reported: bool,
}

struct Watch {
    check: WireCheck,
    /// Latest readings of every row read: rows × M4.
    frame_ohm: Vec<f64>,
    /// True for rows with readings since the last check.
    is_new: Vec<bool>,
    columns: usize,
}

impl Faults {
    pub(super) fn new(source: &Simulation, relative_noise: Option<f64>) -> Result<Self, Failure> {
        let (sensor, mut scene) = (&source.sensor, source.scene);
        if let Some(relative) = relative_noise {
            scene.noise = Noise::relative(relative);
            scene
                .check()
                .map_err(|error| Failure::Arguments(format!("--noise: {error}")))?;
        }
        let scale = sensor.scale;
        let reason = if scene.noise.in_test().is_none() {
            Some(
                "fault detection needs the noise of the readings, and the network was trained without noise; give \
                 --noise REL",
            )
        } else if !WireCheck::is_affordable(scale, &scene) {
            Some("the array is too large")
        } else {
            None
        };
        if let Some(reason) = reason {
            warn(&format!("wires are not checked for faults: {reason}"));
            return Ok(Self {
                watch: None,
                is_reported: true,
            });
        }
        let rows = scene.rows.read(scale.rows()).map_err(DatasetError::from)?;
        Ok(Self {
            watch: Some(Watch {
                check: WireCheck::new(sensor, &scene, &rows).map_err(Failure::Sensor)?,
                frame_ohm: vec![0.0; rows.len() * scale.columns()],
                is_new: vec![false; rows.len()],
                columns: scale.columns(),
            }),
            is_reported: false,
        })
    }

    /// Checks nothing, for networks without a sensor model.
    pub(super) fn none() -> Self {
        Self {
            watch: None,
            is_reported: true,
        }
    }

    /// Check that decodes without the wires of the reported fault, if any, with the latest readings of every row read.
    pub(super) fn left_out(&mut self) -> Option<(&mut WireCheck, &[f64])> {
        let watch = self.watch.as_mut()?;
        Some((&mut watch.check, &watch.frame_ohm))
    }

    /// Stores the readings of a line; returns `true` if all rows have new readings since the last check.
    pub(super) fn take(&mut self, line: u64, parsed: ParsedLine<'_>) -> bool {
        let Some(watch) = &mut self.watch else { return false };
        match parsed {
            ParsedLine::Row {
                row_index: Some(index),
                readings,
                ..
            } => {
                watch.frame_ohm[index * watch.columns..][..watch.columns].copy_from_slice(readings);
                watch.is_new[index] = true;
            }
            ParsedLine::Snapshot(readings_ohm) => {
                watch.frame_ohm.copy_from_slice(readings_ohm);
                watch.is_new.fill(true);
            }
            ParsedLine::Row { row_index: None, .. } if !self.is_reported => {
                self.is_reported = true;
                warn(&format!(
                    "line {line}: wires are not checked for faults, because the line has no row number; add a column named \
                     row, or send whole snapshots in one line"
                ));
            }
            ParsedLine::Row { .. } | ParsedLine::Start { .. } | ParsedLine::NoReadings => {}
        }
        watch.is_new.iter().all(|is_new| *is_new)
    }

    /// Checks the latest readings, and reports changes.
    pub(super) fn check(&mut self, line: u64) {
        let Some(watch) = &mut self.watch else { return };
        watch.is_new.fill(false);
        match watch.check.check(&watch.frame_ohm) {
            Some(fault @ FaultEvent::Named { .. }) => {
                warn(&format!(
                    "line {line}: {fault}; left out from here on; frames are decoded from the other readings \
                     by the Gauss-Newton method"
                ));
            }
            Some(FaultEvent::Unexplained) => warn(&format!(
                "line {line}: the readings contradict Eq. (2), and no single-wire fault explains them: the answers may \
                 be wrong; check the wiring, the geometry and the order of the rows"
            )),
            Some(FaultEvent::Recovered) => {
                warn(&format!("line {line}: {}; all wires are used", FaultEvent::Recovered));
            }
            None => {}
        }
    }
}

fn warn(message: &str) {
    // There is no one to report to if this fails.
    let _ = writeln!(messages(), "warning: {message}");
}
