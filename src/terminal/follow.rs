//! Live decoding: lines are decoded as they arrive.

use std::{
    fmt::Display,
    io::{self, BufWriter, Write, stdout},
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use clap::{Args, ValueEnum};
use decoupler_core::{
    live::{FaultEvent, FaultyWire},
    scene::Noise,
    text::{counted, inert},
};
use decoupler_files::{
    export::{NetworkFile, csv_cell, write_decoded},
    live::{Note, Session, SessionEvent, SessionPlan, Source, SourcePlan, Unit, Unwatched, Watched},
};

use ndarray::ArrayView1;
use serde_json::{Map, json};

use super::{
    decode::{OutsideTraining, with_half_widths, write_heading},
    failure::Failure,
    interruption::Graceful,
    intervals::{note_drift, note_unmonitored},
    number,
    output::{note, warn},
};

// Decoding of live frames.
#[derive(Args)]
pub(super) struct Follow {
    /// Decode frames as they arrive, writing each answer to standard output at once
    ///
    /// --data is then - for standard input, a file or pipe, a serial port as DEVICE:BAUD, or tcp:HOST:PORT. A line has
    /// the resistances of one row-wire as without --follow, optionally after its row number, or of a whole snapshot, row
    /// by row. From a file or pipe every line is decoded; from a port or socket, older lines are dropped once a line has
    /// waited for 0.1 s. Bad lines are counted and reported.
    #[arg(long, conflicts_with = "out")]
    pub(super) follow: bool,
    /// With --follow: output format [default: csv]
    #[arg(long, value_name = "csv|jsonl", hide_possible_values = true)]
    format: Option<Form>,
    /// With --follow: report rate and latency on standard error every N seconds; always at the end, and on SIGUSR1
    #[arg(long, value_name = "SECONDS", value_parser = number)]
    status: Option<f64>,
    /// With --follow: relative noise of the readings (standard deviation) assumed in fault detection [default: that of
    /// the network's scene]
    #[arg(long, value_name = "REL", value_parser = number)]
    fault_noise: Option<f64>,
}

/// Timeout of waiting for a line, after which requests for a report and to stop are checked.
const WAIT: Duration = Duration::from_millis(100);

impl Follow {
    /// Refuses arguments that only --follow uses.
    pub(super) fn check_unused(&self) -> Result<(), Failure> {
        let given = [
            (self.format.is_some(), "--format"),
            (self.status.is_some(), "--status"),
            (self.fault_noise.is_some(), "--fault-noise"),
        ];
        match given.into_iter().find(|(is_given, _)| *is_given) {
            Some((_, argument)) => Err(wrong(argument, "it needs --follow")),
            None => Ok(()),
        }
    }

    /// Decodes `input` with the network of `file` until it ends, or until a request to stop. Reports at the requested interval,
    /// on SIGUSR1, and at the end.
    pub(super) fn run(&self, input: &Path, file: NetworkFile) -> Result<(), Failure> {
        let noise = self.noise_of(&file)?;
        let source = self.source(input)?;
        let file = Arc::new(file);
        note_unmonitored(&file);
        let asked = Arc::new(AtomicBool::new(false));
        // Without the signal there are still reports at intervals and at the end.
        #[cfg(unix)]
        let _ = signal_hook::flag::register(signal_hook::consts::SIGUSR1, Arc::clone(&asked));
        let plan = SessionPlan {
            network: Arc::clone(&file),
            source: SourcePlan::Stream(source.clone()),
            noise,
            zero: None,
            unit: Unit::Lines,
        };
        let Some(mut session) = Session::open(plan, &|| true)? else {
            return Ok(());
        };
        warn_unwatched(&session);
        let graceful = Graceful::begin();
        let output = BufWriter::with_capacity(1 << 16, stdout().lock());
        let mut answers = Answers::new(&file, self.format.unwrap_or_default(), output);
        let mut report = Report::new(source);
        let every = self.status.map(Duration::from_secs_f64);
        let end = loop {
            if asked.swap(false, Ordering::SeqCst) || every.is_some_and(|every| report.is_due(every)) {
                report.print(&session);
            }
            if graceful.is_end_requested() {
                break Err(Failure::Interrupted(String::new()));
            }
            let event = session.next(Instant::now(), WAIT);
            for note in session.notes() {
                print_note(&file, &note);
            }
            match event {
                SessionEvent::Answer => {
                    let answer = Answer {
                        line: session.line(),
                        first_row: session.first_row(),
                        readings: session.readings(),
                        values: session.values(),
                        left_out: session.left_out(),
                    };
                    let kept = session.kept().iter().map(|kept| (&*kept.title, &*kept.text));
                    if let Err(error) = answers.write(&answer, kept).and_then(|()| answers.output.flush()) {
                        break Err(Failure::Output(error));
                    }
                    session.count();
                }
                SessionEvent::Bad(reason) => report.bad(&reason, &session),
                SessionEvent::Nothing => report.waiting(&session),
                SessionEvent::End(end) => break end.map_err(Failure::from),
            }
        };
        report.print(&session);
        answers.outside.warn();
        end
    }

    /// Noise assumed in fault detection.
    fn noise_of(&self, file: &NetworkFile) -> Result<Noise, Failure> {
        let Some(simulation) = &file.problem.sensor else {
            let reason =
                "fault detection needs a sensor model, which the network of a recording does not have; leave it out";
            return match self.fault_noise {
                Some(_) => Err(wrong("--fault-noise", reason)),
                None => Ok(Noise::default()),
            };
        };
        let mut scene = simulation.scene;
        if let Some(relative) = self.fault_noise {
            scene.noise = Noise::relative(relative);
            scene.check().map_err(|error| wrong("--fault-noise", error))?;
        }
        Ok(scene.noise.in_test())
    }

    /// Source named by `input`, after a check of the other arguments.
    fn source(&self, input: &Path) -> Result<Source, Failure> {
        let input = input.to_str().ok_or_else(|| wrong("--data", "its name is not UTF-8"))?;
        let source: Source = input.parse().map_err(|error| wrong("--data", error))?;
        if self.status.is_some_and(|seconds| !(seconds > 0.0 && seconds <= 1e9)) {
            return Err(wrong("--status", "give a number of seconds above 0"));
        }
        Ok(source)
    }
}

fn wrong(argument: &str, reason: impl Display) -> Failure {
    Failure::Arguments(format!("{argument}: {reason}"))
}

/// Reports why faults of the wires are not looked for, if they are not.
fn warn_unwatched(session: &Session) {
    let Some(Watched::Off(reason)) = session.array().map(|array| &array.watched) else {
        return;
    };
    let reason = match reason {
        Unwatched::NoNoise => {
            "fault detection needs the noise of the readings, and the network was trained without noise; give --fault-noise REL"
        }
        Unwatched::TooLarge => "the array is too large",
    };
    warn(format_args!("wires are not checked for faults: {reason}"));
}

fn print_note(file: &NetworkFile, note: &Note) {
    match note {
        Note::Start(line) => warn(format_args!(
            "line {line}: the lines at the start give the means of derived columns and are not decoded"
        )),
        Note::StepBack(line) => warn(format_args!(
            "line {line}: the time steps back: the history of readings restarts here and at every further step back; \
             send the lines in order of time"
        )),
        Note::NoRow(line) => warn(format_args!(
            "line {line}: wires are not checked for faults, because the line has no row number; add a column named row, \
             or send whole snapshots in one line"
        )),
        Note::Fault(line, fault @ FaultEvent::Named { .. }) => warn(format_args!(
            "line {line}: {fault}; left out from here on; frames are decoded from the other readings by the Gauss-Newton \
             method"
        )),
        Note::Fault(line, FaultEvent::Unexplained) => warn(format_args!(
            "line {line}: the readings contradict Eq. (2), and no single-wire fault explains them: the answers may be \
             wrong; check the wiring, the geometry and the order of the rows"
        )),
        Note::Fault(line, FaultEvent::Recovered) => warn(format_args!(
            "line {line}: {}; all wires are used",
            FaultEvent::Recovered
        )),
        Note::Drift(line, drift) => note_drift(file, *line, drift),
        Note::RecordingEnded(..) => {}
    }
}

/// Messages on standard error on the lines so far.
struct Report {
    source: Source,
    begin: Instant,
    last: Instant,
    /// True once it was reported that no line ends.
    has_warned_of_ends: bool,
    /// Number of bad lines since the last message.
    unreported: u64,
    last_reported: Instant,
}

/// Number of bad lines that are reported individually; after them at most one per second.
const MAX_REPORTED: u64 = 10;
const REPORT_INTERVAL: Duration = Duration::from_secs(1);

impl Report {
    fn new(source: Source) -> Self {
        let now = Instant::now();
        Self {
            source,
            begin: now,
            last: now,
            has_warned_of_ends: false,
            unreported: 0,
            last_reported: now,
        }
    }

    /// Reports a bad line, unless there are too many.
    fn bad(&mut self, reason: &str, session: &Session) {
        let bad = session.bad_lines();
        if bad > MAX_REPORTED && self.last_reported.elapsed() < REPORT_INTERVAL {
            self.unreported += 1;
            return;
        }
        self.last_reported = Instant::now();
        match std::mem::take(&mut self.unreported) {
            0 => warn(reason),
            unreported => warn(format_args!(
                "{reason} ({unreported} other bad lines since the last message)"
            )),
        }
        if let Source::Serial { baud, .. } = self.source
            && bad == MAX_REPORTED
            && session.latencies().count() == 0
        {
            warn(format_args!(
                "none of the first {MAX_REPORTED} lines is a frame: does the device send at {baud} baud?"
            ));
        }
    }

    /// Reports once that bytes arrive but no line ends.
    fn waiting(&mut self, session: &Session) {
        /// More than the time between two lines of any device.
        const PATIENCE: Duration = Duration::from_secs(2);
        if self.has_warned_of_ends || self.begin.elapsed() < PATIENCE {
            return;
        }
        let has_lines = session.latencies().count() + session.bad_lines() > 0;
        let unended = if has_lines { 0 } else { session.unended() };
        if unended > 0 {
            self.has_warned_of_ends = true;
            warn(format_args!(
                "{unended} bytes have arrived, but no line has ended: does the sender end lines with LF or CR LF?"
            ));
        }
    }

    /// Returns `true` once per interval.
    fn is_due(&mut self, every: Duration) -> bool {
        let is_due = self.last.elapsed() >= every;
        if is_due {
            self.last = Instant::now();
        }
        is_due
    }

    /// Prints the counts and latencies so far.
    fn print(&self, session: &Session) {
        let (counts, latencies) = (session.counts(), session.latencies());
        let (decoded, seconds) = (latencies.count(), self.begin.elapsed().as_secs_f64());
        note(format_args!(
            "{} decoded in {seconds:.1} s ({:.0} per second), {} bad, {} dropped; {latencies}",
            counted(decoded, "line"),
            decoded as f64 / seconds.max(1e-9),
            counts.bad,
            counts.dropped
        ));
    }
}

/// Output format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Form {
    /// CSV with the columns of `decode`.
    #[default]
    Csv,
    /// One JSON object per line.
    Jsonl,
}

/// Writes answers, without allocation in steady state for CSV.
pub(super) struct Answers<'a, W> {
    file: &'a NetworkFile,
    /// Answers with the half-widths of their intervals.
    values: Vec<f64>,
    pub(super) outside: OutsideTraining<'a>,
    form: Form,
    has_heading: bool,
    pub(super) output: W,
}

/// An answer, for one or more row-wires of a line.
pub(super) struct Answer<'a> {
    pub(super) line: u64,
    /// Index of the first row-wire among those that the network reads.
    pub(super) first_row: usize,
    pub(super) readings: &'a [f64],
    pub(super) values: &'a [f64],
    /// Wire that was left out because of its fault.
    pub(super) left_out: Option<FaultyWire>,
}

impl<'a, W: Write> Answers<'a, W> {
    pub(super) fn new(file: &'a NetworkFile, form: Form, output: W) -> Self {
        Self {
            file,
            values: Vec::new(),
            outside: OutsideTraining::new(&file.problem),
            form,
            has_heading: form == Form::Jsonl,
            output,
        }
    }

    /// Writes an answer after the cells kept from its line, each with its title.
    pub(super) fn write<'b>(
        &mut self,
        answer: &Answer,
        kept: impl ExactSizeIterator<Item = (&'b str, &'b str)> + Clone,
    ) -> io::Result<()> {
        let (
            problem,
            &Answer {
                line, readings, values, ..
            },
        ) = (&self.file.problem, answer);
        let rows = values.len() / problem.targets.len();
        let (mut readings_outside, mut targets_outside) = (Some(0), 0);
        let of_rows = readings.chunks_exact(readings.len() / rows);
        for (row, (readings, values)) in of_rows.zip(values.chunks_exact(problem.targets.len())).enumerate() {
            let network = self.file.network.at(answer.first_row + row);
            let of_row = self.outside.count(network, line, readings, values);
            readings_outside = readings_outside.zip(of_row.readings).map(|(sum, count)| sum + count);
            targets_outside += of_row.targets;
        }
        if self.form == Form::Csv {
            if !std::mem::replace(&mut self.has_heading, true) {
                write_heading(self.file, kept.clone().map(|(title, _)| title), rows, &mut self.output)?;
            }
            for (_, cell) in kept {
                write!(self.output, "{},", csv_cell(&inert(cell)))?;
            }
            with_half_widths(self.file, values, &mut self.values);
            let values = ArrayView1::from(&self.values);
            return write_decoded(values, readings_outside, targets_outside, &mut self.output);
        }
        let mut object = json!({"line": line, "readings_outside": readings_outside});
        if problem.has_nodes() {
            object["coordinates_mm"] = values.into();
            object["coordinates_outside"] = targets_outside.into();
            object["left_out"] = answer.left_out.map(|wire| wire.to_string()).into();
        } else {
            let names = || problem.targets.iter().map(|target| target.name.clone());
            object["targets"] = names()
                .zip(values.iter().map(|value| (*value).into()))
                .collect::<Map<_, _>>()
                .into();
            object["targets_outside"] = targets_outside.into();
            let half_width = |(index, value): (usize, &f64)| self.file.intervals.as_ref()?.half_width(index, *value);
            let half_widths = names().zip(values.iter().enumerate().map(half_width));
            let half_widths = half_widths.filter_map(|(name, half_width)| Some((name, half_width?.into())));
            let half_widths = half_widths.collect::<Map<_, _>>();
            if !half_widths.is_empty() {
                object["half_widths_90"] = half_widths.into();
            }
        }
        if kept.len() > 0 {
            object["columns"] = kept
                .map(|(title, cell)| (title.to_owned(), cell.into()))
                .collect::<Map<_, _>>()
                .into();
        }
        writeln!(self.output, "{object}")
    }
}
