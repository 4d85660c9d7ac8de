use std::{
    io::Read,
    ops::ControlFlow,
    path::Path,
    time::{Duration, Instant},
};

use ndarray::Array3;

use super::{
    counts::Tally,
    frame_source::Next,
    message::{LivePlan, SourcePlan},
    opening::open,
    replay::ReplayFrames,
    replay_file::RATE_WITHOUT_TIMES,
    source_lines::{SourceLine, SourceLines},
};
use decoupler_core::live::{Recording, Source};
use decoupler_files::{
    export::NetworkFile,
    import::{InputLine, InputLines},
};

/// Samples for a network of a recording. Each is the index of its network, then the readings in the order of the inputs.
#[derive(Debug)]
pub(super) enum TargetSource {
    Replay(Box<ReplayFrames>),
    Stream(Box<TargetLines>),
}

/// Samples from the lines of a device or socket.
#[derive(Debug)]
pub(super) struct TargetLines {
    lines: SourceLines,
    parser: InputLines,
}

impl TargetSource {
    /// Opens the source of `plan`; `None` if it is no longer wanted.
    pub(super) fn open(plan: &LivePlan, is_wanted: &dyn Fn() -> bool) -> Result<Option<Self>, String> {
        let file = &plan.network;
        Ok(Some(match &plan.source {
            SourcePlan::Simulated { .. } => {
                return Err("a recording has no model to simulate: choose a file or a device as the source".to_owned());
            }
            SourcePlan::Replay {
                path,
                at_s,
                speed,
                is_playing,
            } => {
                let recording = read(file, path, is_wanted);
                if !is_wanted() {
                    return Ok(None);
                }
                let replay = ReplayFrames::new(recording?, *at_s, *speed, *is_playing, Instant::now());
                Self::Replay(Box::new(replay))
            }
            SourcePlan::Stream(source) => {
                let Some(opened) = open(source, is_wanted)? else {
                    return Ok(None);
                };
                Self::Stream(Box::new(TargetLines::new(source, opened, file)?))
            }
        }))
    }

    /// Writes the next sample, for which a stream waits at most so long.
    pub(super) fn next(&mut self, patience: Duration, sample: &mut [f64], tally: &mut Tally) -> Next {
        match self {
            Self::Replay(replay) => match replay.next(sample, tally, Instant::now()) {
                Some(arrived) => Next::Frame(arrived),
                None => Next::Nothing,
            },
            Self::Stream(lines) => lines.next(patience, sample, tally),
        }
    }
}

/// Reads all samples of a file, which come at an even rate.
fn read(file: &NetworkFile, path: &Path, is_wanted: &dyn Fn() -> bool) -> Result<Recording, String> {
    let recipe = file.recorded.as_ref().map(|recorded| recorded.plan.import.clone());
    let watch = &mut |_| {
        if is_wanted() {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    };
    let (inputs, has_rows) = (&file.problem.inputs, file.network.only().is_none());
    let table = recipe.unwrap_or_default().read_inputs(path, inputs, has_rows, watch);
    let table = table.map_err(|error| error.to_string())?;
    let mut samples = Vec::with_capacity(table.readings.len() + table.readings.nrows());
    for (sample, readings) in table.readings.rows().into_iter().enumerate() {
        let row_index = match (&file.row_wires, &table.row_wires) {
            _ if !has_rows => 0,
            (Some(read), Some(of_samples)) => {
                let row = of_samples[sample];
                let index = read.iter().position(|read| *read == row);
                index.ok_or_else(|| {
                    let line = table.lines[sample];
                    format!(
                        "'{}', line {line}: there is no network for row {}",
                        path.display(),
                        row + 1
                    )
                })?
            }
            _ => {
                return Err(format!(
                    "'{}' has no column of row-wires, and there is a network for each",
                    path.display()
                ));
            }
        };
        samples.push(row_index as f64);
        samples.extend(readings);
    }
    let shape = (table.readings.nrows(), 1, 1 + inputs.len());
    let samples = Array3::from_shape_vec(shape, samples).expect("each sample has its row and all inputs");
    Recording::at_rate(samples, RATE_WITHOUT_TIMES).map_err(|error| format!("'{}': {error}", path.display()))
}

impl TargetLines {
    fn new(source: &Source, opened: Box<dyn Read + Send>, file: &NetworkFile) -> Result<Self, String> {
        Ok(Self {
            // The latest sample of each row-wire.
            lines: SourceLines::new(source, opened, file.network.values().len())?,
            parser: file.input_lines(),
        })
    }

    fn next(&mut self, patience: Duration, sample: &mut [f64], tally: &mut Tally) -> Next {
        let next = self.take_line(patience, sample);
        self.lines.count_dropped(tally);
        next
    }

    fn take_line(&mut self, patience: Duration, sample: &mut [f64]) -> Next {
        let SourceLine {
            number,
            arrived,
            text,
            is_fragment,
        } = match self.lines.take(patience) {
            Ok(line) => line,
            Err(next) => return next,
        };
        match self.parser.parse(number, text) {
            Ok(InputLine::NoReadings) => Next::Nothing,
            Ok(InputLine::Readings { row_index, readings }) => {
                sample[0] = row_index as f64;
                sample[1..].copy_from_slice(readings);
                Next::Frame(arrived)
            }
            Err(error) if error.is_final() && !is_fragment => {
                Next::End(Err(self.lines.failed(&format!("line {number}: {error}"))))
            }
            Err(error) => Next::Bad(format!("line {number}: {error}")),
        }
    }
}
