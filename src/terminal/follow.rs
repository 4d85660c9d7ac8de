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
    job::Job,
    scene::Noise,
    text::{counted, inert},
};
use decoupler_files::{
    export::{NetworkFile, csv_cell, write_decoded},
    live::{Answer, Input, Note, Session, SessionError, SessionEvent, SessionPlan, Source, SourcePlan, Unit, Watched},
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
    #[arg(long, value_name = "csv|jsonl", hide_possible_values = true, conflicts_with = "out")]
    format: Option<Form>,
    /// With --follow: report rate and latency on standard error every N seconds; always at the end, and on SIGUSR1
    #[arg(long, value_name = "SECONDS", value_parser = seconds, conflicts_with = "out")]
    status: Option<Duration>,
    /// With --follow: relative noise of the readings (standard deviation) assumed in fault detection [default: that of
    /// the network's scene]
    #[arg(long, value_name = "REL", value_parser = number, conflicts_with = "out")]
    fault_noise: Option<f64>,
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|seconds| *seconds > 0.0 && *seconds <= 1e9);
    let seconds = seconds.ok_or("give a number of seconds above 0")?;
    Ok(Duration::from_secs_f64(seconds))
}

/// Timeout of waiting for a line, after which requests for a report and to stop are checked.
const WAIT: Duration = Duration::from_millis(100);

impl Follow {
    /// Decodes `input` with the network of `file` until it ends, or until a request to stop. Reports at the requested interval,
    /// on SIGUSR1, and at the end.
    pub(super) fn run(&self, input: &Path, file: NetworkFile) -> Result<(), Failure> {
        let noise = self.noise_of(&file)?;
        let input = input.to_str();
        let input = input.ok_or_else(|| wrong("--data", "its name is not UTF-8"))?;
        let source: Source = input.parse().map_err(|error| wrong("--data", error))?;
        let file = Arc::new(file);
        note_unmonitored(&file);
        let asked = Arc::new(AtomicBool::new(false));
        // Without the signal there are still reports at intervals and at the end.
        #[cfg(unix)]
        let _ = signal_hook::flag::register(signal_hook::consts::SIGUSR1, Arc::clone(&asked));
        let plan = SessionPlan {
            network: Arc::clone(&file),
            source: SourcePlan::Stream(source),
            noise,
            zero: None,
            unit: Unit::Lines,
        };
        let mut session = Session::open(plan, &Job::UNINTERRUPTED)?;
        warn_unwatched(&session);
        let graceful = Graceful::begin();
        let output = BufWriter::with_capacity(1 << 16, stdout().lock());
        let mut answers = Answers::new(&file, self.format.unwrap_or_default(), output);
        let begin = Instant::now();
        let mut report = Report {
            begin,
            last: begin,
            has_warned_of_ends: false,
            unreported: 0,
            last_reported: begin,
        };
        let end = loop {
            if asked.swap(false, Ordering::SeqCst) || self.status.is_some_and(|every| report.last.elapsed() >= every) {
                report.print(&session);
            }
            if graceful.is_end_requested() {
                break Err(Failure::Interrupted(String::new()));
            }
            let event = session.next(Instant::now(), WAIT);
            for note in session.notes.drain(..) {
                match note {
                    Note::Drift(line, drift) => note_drift(&file, line, &drift),
                    other => warn(&other),
                }
            }
            match event {
                SessionEvent::Answer => {
                    let written = answers.write(&session.last);
                    if let Err(error) = written.and_then(|()| answers.output.flush()) {
                        break Err(Failure::Output(error));
                    }
                    session.count();
                }
                SessionEvent::Bad(reason) => report.bad(&reason, &session),
                SessionEvent::Nothing => report.waiting(&session),
                // It was never open.
                SessionEvent::End(Err(error @ SessionError::Source(_))) => return Err(error.into()),
                SessionEvent::End(end) => break end.map_err(Failure::from),
            }
        };
        report.print(&session);
        answers.outside.warn();
        end
    }

    /// Noise assumed in fault detection.
    fn noise_of(&self, file: &NetworkFile) -> Result<Noise, Failure> {
        let mut scene = match &file.problem.sensor {
            Some(simulation) => simulation.scene,
            None if self.fault_noise.is_none() => return Ok(Noise::default()),
            None => {
                let reason = "fault detection needs a sensor model, which the network of a recording does not have; \
                              leave it out";
                return Err(wrong("--fault-noise", reason));
            }
        };
        scene.noise = self.fault_noise.map_or(scene.noise, Noise::relative);
        scene.check().map_err(|error| wrong("--fault-noise", error))?;
        Ok(scene.noise.in_test())
    }
}

fn wrong(argument: &str, reason: impl Display) -> Failure {
    Failure::Arguments(format!("{argument}: {reason}"))
}

/// Reports why faults of the wires are not looked for, if they are not.
fn warn_unwatched(session: &Session) {
    let reason = match session.array.as_ref().map(|array| &array.watched) {
        Some(Watched::NoNoise) => {
            "fault detection needs the noise of the readings, and the network was trained without noise; give --fault-noise REL"
        }
        Some(Watched::TooLarge) => "the array is too large",
        Some(Watched::Checked(_)) | None => return,
    };
    warn(format_args!("wires are not checked for faults: {reason}"));
}

/// Messages on standard error on the lines so far.
struct Report {
    begin: Instant,
    /// Time of the last report of rate and latency.
    last: Instant,
    /// True once it was reported that no line ends.
    has_warned_of_ends: bool,
    /// Number of bad lines since the last message on one.
    unreported: u64,
    last_reported: Instant,
}

/// Number of bad lines that are reported individually; after them at most one per second.
const MAX_REPORTED: u64 = 10;
const REPORT_INTERVAL: Duration = Duration::from_secs(1);
/// More than the time between two lines of any device.
const PATIENCE: Duration = Duration::from_secs(2);

impl Report {
    /// Reports a bad line, unless there are too many.
    fn bad(&mut self, reason: &str, session: &Session) {
        let bad = session.tally.bad;
        if bad > MAX_REPORTED && self.last_reported.elapsed() < REPORT_INTERVAL {
            self.unreported += 1;
            return;
        }
        self.last_reported = Instant::now();
        match std::mem::take(&mut self.unreported) {
            0 => warn(reason),
            others => warn(format_args!(
                "{reason} ({others} other bad lines since the last message)"
            )),
        }
        if let (Input::Lines(lines), MAX_REPORTED, 0) = (&session.input, bad, session.tally.decoded)
            && let Source::Serial(_, baud) = lines.source
        {
            warn(format_args!(
                "none of the first {MAX_REPORTED} lines is a frame: does the device send at {baud} baud?"
            ));
        }
    }

    /// Reports once that bytes arrive but no line ends.
    fn waiting(&mut self, session: &Session) {
        let Input::Lines(lines) = &session.input else { return };
        let has_lines = session.tally.decoded + session.tally.bad > 0;
        if self.has_warned_of_ends || has_lines || self.begin.elapsed() < PATIENCE {
            return;
        }
        if let unended @ 1.. = lines.lines.unended() {
            self.has_warned_of_ends = true;
            warn(format_args!(
                "{unended} bytes have arrived, but no line has ended: does the sender end lines with LF or CR LF?"
            ));
        }
    }

    /// Prints the counts and latencies so far.
    fn print(&mut self, session: &Session) {
        self.last = Instant::now();
        let (tally, seconds) = (&session.tally, self.begin.elapsed().as_secs_f64());
        let (lines, rate) = (counted(tally.decoded, "line"), tally.decoded as f64 / seconds.max(1e-9));
        note(format_args!(
            "{lines} decoded in {seconds:.1} s ({rate:.0} per second), {} bad, {} dropped; {}",
            tally.bad, tally.dropped, tally.latencies
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

    /// Writes an answer after the cells kept from its line.
    pub(super) fn write(&mut self, answer: &Answer) -> io::Result<()> {
        let (problem, kept) = (&self.file.problem, &answer.kept);
        let (line, readings, values) = (answer.line, &answer.readings, &answer.values);
        let rows = values.len() / problem.targets.len();
        let (mut readings_outside, mut targets_outside) = (Some(0), 0);
        let of_rows = readings.chunks_exact(readings.len() / rows);
        let of_rows = of_rows.zip(values.chunks_exact(problem.targets.len()));
        for (row, (readings, values)) in (answer.first_row.unwrap_or(0)..).zip(of_rows) {
            let of_row = self.outside.count(self.file.network.at(row), line, readings, values);
            readings_outside = readings_outside.zip(of_row.readings).map(|(sum, count)| sum + count);
            targets_outside += of_row.targets;
        }
        if self.form == Form::Csv {
            if !std::mem::replace(&mut self.has_heading, true) {
                write_heading(self.file, kept.iter().map(|kept| &*kept.title), rows, &mut self.output)?;
            }
            for cell in kept {
                write!(self.output, "{},", csv_cell(&inert(&cell.text)))?;
            }
            with_half_widths(self.file, values, &mut self.values);
            let values = ArrayView1::from(&self.values);
            return write_decoded(values, readings_outside, targets_outside, &mut self.output);
        }
        let mut object = json!({"line": line, "readings_outside": readings_outside});
        if problem.has_nodes() {
            object["coordinates_mm"] = json!(values);
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
        if !kept.is_empty() {
            let cells = kept.iter().map(|kept| (kept.title.clone(), json!(kept.text)));
            object["columns"] = Map::from_iter(cells).into();
        }
        writeln!(self.output, "{object}")
    }
}
