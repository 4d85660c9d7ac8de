use std::{
    io::Read,
    time::{Duration, Instant},
};

use super::{counts::Tally, frame_source::Next, message::Arrived};
use crate::{
    dataset::system_cause,
    live::{Keeping, LineParser, Lines, NextLine, ParsedLine, Source},
    scene::Rows,
    sensor::ArrayScale,
};

/// Frames from the lines of a device or socket.
#[derive(Debug)]
pub(super) struct StreamFrames {
    name: String,
    begins_anywhere: bool,
    lines: Lines,
    parser: LineParser,
    columns: usize,
    /// Latest readings of every row read: rows × M4.
    latest_ohm: Vec<f64>,
    /// Rows of which readings came since the last frame.
    is_new: Vec<bool>,
    dropped: u64,
    /// When reading began.
    begun: Instant,
}

impl StreamFrames {
    pub(super) fn new(
        source: &Source,
        opened: Box<dyn Read + Send>,
        scale: ArrayScale,
        rows: Rows,
        read: usize,
    ) -> Result<Self, String> {
        let keeping = source.keeping();
        let parser = LineParser::new(scale, rows, keeping == Keeping::All).map_err(|error| error.to_string())?;
        let lines = Lines::spawn(opened, keeping, source.begins_anywhere());
        let mut lines = lines.map_err(|error| format!("no thread could be started: {error}"))?;
        lines.set_kept(read);
        Ok(Self {
            name: source.to_string(),
            begins_anywhere: source.begins_anywhere(),
            lines,
            parser,
            columns: scale.columns(),
            latest_ohm: vec![0.0; read * scale.columns()],
            is_new: vec![false; read],
            dropped: 0,
            begun: Instant::now(),
        })
    }

    /// Waits for a line, at most so long, and writes the frame if it is whole with this line.
    pub(super) fn next(&mut self, patience: Duration, frame_ohm: &mut [f64], tally: &mut Tally) -> Next {
        let next = self.take_line(patience, frame_ohm);
        let dropped = self.lines.dropped();
        tally.dropped(dropped - self.dropped);
        self.dropped = dropped;
        next
    }

    fn take_line(&mut self, patience: Duration, frame_ohm: &mut [f64]) -> Next {
        let line = match self.lines.next(patience) {
            NextLine::Line(line) => line,
            NextLine::None => return Next::Nothing,
            NextLine::End(None) => return Next::End(Ok(())),
            NextLine::End(Some(error)) => {
                let cause = system_cause(&error);
                return Next::End(Err(format!("{} is lost: {cause}; connect it again", self.name)));
            }
        };
        let (number, read_at) = (line.number, line.read_at);
        let Some(text) = line.text else {
            self.parser.count_bad();
            return Next::Bad(format!("line {number}: it is longer than {} bytes", Lines::LONGEST));
        };
        let is_snapshot = match self.parser.parse(number, text) {
            Ok(ParsedLine::NoReadings) => return Next::Nothing,
            Ok(ParsedLine::Snapshot(readings_ohm)) => {
                frame_ohm.copy_from_slice(readings_ohm);
                true
            }
            Ok(ParsedLine::Row {
                row_index,
                readings_ohm,
            }) => {
                let index = row_index.unwrap_or(0);
                self.latest_ohm[index * self.columns..][..self.columns].copy_from_slice(readings_ohm);
                self.is_new[index] = true;
                if !self.is_new.iter().all(|is_new| *is_new) {
                    return Next::Nothing;
                }
                self.is_new.fill(false);
                frame_ohm.copy_from_slice(&self.latest_ohm);
                false
            }
            Err(error) if error.is_final() && !(self.begins_anywhere && number == 1) => {
                return Next::End(Err(format!("{}: {error}", self.name)));
            }
            Err(error) => return Next::Bad(error.to_string()),
        };
        if is_snapshot {
            self.lines.set_kept(1);
        }
        let time_s = read_at.saturating_duration_since(self.begun).as_secs_f64();
        Next::Frame(Arrived { time_s, read_at })
    }
}
