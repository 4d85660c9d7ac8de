use std::{
    fmt,
    io::Read,
    time::{Duration, Instant},
};

use super::{counts::Tally, frame_source::Next, message::Arrived};
use decoupler_core::{
    live::{Lines, NextLine, Source},
    text::system_cause,
};

/// Lines of a device or socket.
#[derive(Debug)]
pub(super) struct SourceLines {
    name: String,
    begins_anywhere: bool,
    lines: Lines,
    dropped: u64,
    /// When reading began.
    begun: Instant,
}

/// A line that has arrived.
pub(super) struct SourceLine<'a> {
    pub(super) number: u64,
    pub(super) arrived: Arrived,
    pub(super) text: &'a [u8],
    /// True for a first line of which only the end may have been read.
    pub(super) is_fragment: bool,
}

impl SourceLines {
    /// Reads what was `opened` in a thread of its own; the latest `kept` lines wait to be taken.
    pub(super) fn new(source: &Source, opened: Box<dyn Read + Send>, kept: usize) -> Result<Self, String> {
        let lines = Lines::spawn(opened, source.keeping(), source.begins_anywhere());
        let mut lines = lines.map_err(|error| format!("no thread could be started: {error}"))?;
        lines.set_kept(kept);
        Ok(Self {
            name: source.to_string(),
            begins_anywhere: source.begins_anywhere(),
            lines,
            dropped: 0,
            begun: Instant::now(),
        })
    }

    /// Changes the number of lines that wait to be taken.
    pub(super) fn set_kept(&mut self, kept: usize) {
        self.lines.set_kept(kept);
    }

    /// Waits for a line, at most so long.
    ///
    /// # Errors
    /// What came in its place: nothing, a line that is too long, or the end.
    pub(super) fn take(&mut self, patience: Duration) -> Result<SourceLine<'_>, Next> {
        let line = match self.lines.next(patience) {
            NextLine::Line(line) => line,
            NextLine::None => return Err(Next::Nothing),
            NextLine::End(None) => return Err(Next::End(Ok(()))),
            NextLine::End(Some(error)) => {
                let cause = system_cause(&error);
                return Err(Next::End(Err(format!(
                    "{} is lost: {cause}; connect it again",
                    self.name
                ))));
            }
        };
        let (number, read_at) = (line.number, line.read_at);
        let Some(text) = line.text else {
            return Err(Next::Bad(format!(
                "line {number}: it is longer than {} bytes",
                Lines::LONGEST
            )));
        };
        let time_s = read_at.saturating_duration_since(self.begun).as_secs_f64();
        Ok(SourceLine {
            number,
            arrived: Arrived { time_s, read_at },
            text,
            is_fragment: self.begins_anywhere && number == 1,
        })
    }

    /// Adds the lines dropped since this was last called to `tally`.
    pub(super) fn count_dropped(&mut self, tally: &mut Tally) {
        let dropped = self.lines.dropped();
        tally.dropped(dropped - self.dropped);
        self.dropped = dropped;
    }

    /// Message of an error that ends the reading.
    pub(super) fn failed(&self, error: &impl fmt::Display) -> String {
        format!("{}: {error}", self.name)
    }
}
