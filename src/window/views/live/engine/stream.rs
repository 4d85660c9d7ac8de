use std::{io::Read, time::Duration};

use super::{
    counts::Tally,
    frame_source::Next,
    source_lines::{SourceLine, SourceLines},
};
use decoupler_core::{
    live::{Keeping, LineParser, ParsedLine, Source},
    scene::Rows,
    sensor::ArrayScale,
};

/// Frames from the lines of a device or socket.
#[derive(Debug)]
pub(super) struct StreamFrames {
    lines: SourceLines,
    parser: LineParser,
    columns: usize,
    /// Latest readings of every row read: rows × M4.
    latest_ohm: Vec<f64>,
    /// Rows of which readings came since the last frame.
    is_new: Vec<bool>,
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
        Ok(Self {
            lines: SourceLines::new(source, opened, read)?,
            parser,
            columns: scale.columns(),
            latest_ohm: vec![0.0; read * scale.columns()],
            is_new: vec![false; read],
        })
    }

    /// Waits for a line, at most so long, and writes the frame if it is whole with this line.
    pub(super) fn next(&mut self, patience: Duration, frame_ohm: &mut [f64], tally: &mut Tally) -> Next {
        let next = self.take_line(patience, frame_ohm);
        self.lines.count_dropped(tally);
        next
    }

    fn take_line(&mut self, patience: Duration, frame_ohm: &mut [f64]) -> Next {
        let SourceLine {
            number,
            arrived,
            text,
            is_fragment,
        } = match self.lines.take(patience) {
            Ok(line) => line,
            Err(next) => {
                if matches!(next, Next::Bad(_)) {
                    self.parser.count_bad();
                }
                return next;
            }
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
            Err(error) if error.is_final() && !is_fragment => {
                return Next::End(Err(self.lines.failed(&error)));
            }
            Err(error) => return Next::Bad(error.to_string()),
        };
        if is_snapshot {
            self.lines.set_kept(1);
        }
        Next::Frame(arrived)
    }
}
