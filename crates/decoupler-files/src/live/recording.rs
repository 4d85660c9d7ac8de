use std::io::{self, Read, Write};

use ndarray::{Array3, ArrayView2, Axis};
use thiserror::Error;

use crate::import::{LONGEST_LINE, LineError, LineParser, ParsedLine, ReadError, Rows, Separator};

/// Writes frames with their times as CSV: one line per row-wire, with columns `time_s`, `row` (from 1) and `r_1` to
/// `r_M4` in ohm. `decode` reads these files too. Every frame is flushed, so that the file ends with a complete line even
/// if the program is terminated.
#[derive(Debug)]
pub struct Recorder<W: Write> {
    /// Lines of one frame, written together.
    text: Vec<u8>,
    rows: Vec<usize>,
    channels: usize,
    writer: W,
    /// Bytes of the header and of the frames written completely.
    whole_bytes: u64,
}

impl<W: Write> Recorder<W> {
    /// Writes the header for frames of these row-wires (from 0) with this many channels.
    ///
    /// # Errors
    /// If `writer` fails.
    pub fn new(mut writer: W, rows: &[usize], channels: usize) -> io::Result<Self> {
        let mut text = b"time_s,row".to_vec();
        for channel in 1..=channels {
            write!(text, ",r_{channel}")?;
        }
        text.push(b'\n');
        writer.write_all(&text)?;
        writer.flush()?;
        Ok(Self {
            whole_bytes: text.len() as u64,
            text,
            rows: rows.to_vec(),
            channels,
            writer,
        })
    }

    /// Length of the file up to the last frame written completely.
    pub fn whole_bytes(&self) -> u64 {
        self.whole_bytes
    }

    /// Writes a frame, rows × channels in ohm, with its time in seconds.
    ///
    /// # Errors
    /// If the writer fails; a part of the frame may then be written after [`Self::whole_bytes`].
    ///
    /// # Panics
    /// If the frame has the wrong length.
    pub fn record(&mut self, time_s: f64, frame_ohm: &[f64]) -> io::Result<()> {
        assert_eq!(frame_ohm.len(), self.rows.len() * self.channels);
        self.text.clear();
        for (row, readings_ohm) in self.rows.iter().zip(frame_ohm.chunks_exact(self.channels)) {
            write!(self.text, "{time_s:?},{}", row + 1)?;
            for ohm in readings_ohm {
                write!(self.text, ",{ohm:?}")?;
            }
            self.text.push(b'\n');
        }
        self.writer.write_all(&self.text)?;
        self.writer.flush()?;
        self.whole_bytes += self.text.len() as u64;
        Ok(())
    }
}

/// Recorded frames for replay.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Time of each frame in seconds, in ascending order.
    times_s: Vec<f64>,
    /// Frames × rows × channels in ohm.
    frames_ohm: Array3<f64>,
    /// Last line, if it is cut off.
    torn_line: Option<u64>,
}

/// Error in a recording.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// A field is missing or invalid.
    #[error(transparent)]
    Fields(#[from] ReadError),
    /// The time is missing or not in order.
    #[error("line {0}: the time is missing, invalid or earlier than on the previous line; record again")]
    Time(u64),
    /// The row-wire is not the one expected.
    #[error("line {line}: row {expected} is expected here: each frame needs its rows in ascending order")]
    Row {
        /// Line number.
        line: u64,
        /// Row expected, from 1.
        expected: usize,
    },
    /// There is no complete frame.
    #[error("it contains no complete frame: record again, or choose another file")]
    Empty,
}

impl Recording {
    /// Reads a file written by [`Recorder`] for these row-wires of an array with `array_rows` row-wires. An incomplete
    /// last frame is ignored, and so is a last line without its line break, whose last number may be cut off.
    ///
    /// # Errors
    /// If the file cannot be read, is malformed, or has no complete frame.
    pub fn read(source: impl Read, rows: &[usize], array_rows: usize, channels: usize) -> Result<Self, RecordingError> {
        let mut parser = LineParser::of_numbered_rows(channels, rows.to_vec(), array_rows);
        let mut texts = Rows::new(source, Separator::Comma, false).limited(LONGEST_LINE);
        let (mut times_s, mut readings_ohm): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        let (mut lines, mut torn_line) = (0, None);
        while texts.next_text().map_err(ReadError::from)? {
            let line = texts.line();
            if !texts.is_ended() && line > 1 {
                torn_line = Some(line);
                break;
            }
            let expected = lines % rows.len();
            let (row_index, readings, time_s) = match parser.parse(line, texts.text()) {
                Ok(ParsedLine::Row {
                    row_index,
                    readings,
                    time_s,
                    ..
                }) => (row_index, readings, time_s),
                Ok(_) => continue,
                Err(LineError::OtherRow(..)) => (None, &[][..], None),
                Err(error) => return Err(ReadError::from(error).into()),
            };
            if row_index != Some(expected) {
                return Err(RecordingError::Row {
                    line,
                    expected: rows[expected] + 1,
                });
            }
            let time_s = time_s.filter(|time_s| times_s.last().is_none_or(|last| time_s >= last));
            let time_s = time_s.ok_or(RecordingError::Time(line))?;
            readings_ohm.extend_from_slice(readings);
            if expected == 0 {
                times_s.push(time_s);
            }
            lines += 1;
        }
        let frames = lines / rows.len();
        if frames == 0 {
            return Err(RecordingError::Empty);
        }
        times_s.truncate(frames);
        readings_ohm.truncate(frames * rows.len() * channels);
        let shape = (frames, rows.len(), channels);
        Ok(Self {
            times_s,
            frames_ohm: Array3::from_shape_vec(shape, readings_ohm).expect("every line has all channels"),
            torn_line,
        })
    }

    /// Creates a recording of frames (frames × rows × channels in ohm) without times, at a constant rate.
    ///
    /// # Errors
    /// If there is no frame.
    pub fn at_rate(frames_ohm: Array3<f64>, frames_per_second: f64) -> Result<Self, RecordingError> {
        let frames = frames_ohm.len_of(Axis(0));
        let times_s = (0..frames).map(|frame| frame as f64 / frames_per_second);
        Self::at_times(times_s.collect(), frames_ohm)
    }

    /// Creates a recording of frames (frames × rows × channels in ohm) at these times in seconds, in ascending order.
    ///
    /// # Errors
    /// If there is no frame.
    ///
    /// # Panics
    /// If there is not one time for each frame.
    pub fn at_times(times_s: Vec<f64>, frames_ohm: Array3<f64>) -> Result<Self, RecordingError> {
        assert_eq!(times_s.len(), frames_ohm.len_of(Axis(0)), "a time for each frame");
        if times_s.is_empty() {
            return Err(RecordingError::Empty);
        }
        Ok(Self {
            times_s,
            frames_ohm,
            torn_line: None,
        })
    }

    /// Returns the number of the last line if it is cut off, as when the disk was full, and therefore ignored.
    pub fn torn_line(&self) -> Option<u64> {
        self.torn_line
    }

    /// Returns the times of the frames in seconds, in ascending order.
    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// Returns the index of the last frame at or before a time; 0 before the first frame.
    pub fn frame_at(&self, time_s: f64) -> usize {
        self.times_s.partition_point(|other| *other <= time_s).saturating_sub(1)
    }

    /// Returns the readings of a frame in ohm: rows × channels.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn frame_ohm(&self, index: usize) -> ArrayView2<'_, f64> {
        self.frames_ohm.index_axis(Axis(0), index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorded() -> Vec<u8> {
        let mut file = Vec::new();
        let mut recorder = Recorder::new(&mut file, &[0, 2], 3).unwrap();
        for frame in 0..4 {
            let frame_ohm: Vec<f64> = (0..6).map(|k| 0.1 + f64::from(10 * frame + k)).collect();
            recorder.record(0.1 * f64::from(frame), &frame_ohm).unwrap();
        }
        file
    }

    fn read(bytes: &[u8]) -> Result<Recording, RecordingError> {
        Recording::read(bytes, &[0, 2], 3, 3)
    }

    #[test]
    fn recorded_frames_are_replayed_bit_for_bit() {
        let recording = read(&recorded()).unwrap();
        assert_eq!(recording.times_s(), [0.0, 0.1, 0.2, 0.1 * 3.0]);
        assert_eq!(
            recording.frame_ohm(2),
            ndarray::array![[20.1, 21.1, 22.1], [23.1, 24.1, 25.1]]
        );
        for (time_s, frame) in [(-1.0, 0), (0.0, 0), (0.15, 1), (0.2, 2), (99.0, 3)] {
            assert_eq!(recording.frame_at(time_s), frame, "{time_s}");
        }
    }

    #[test]
    fn frames_without_times_have_a_constant_rate() {
        let frames = Array3::from_shape_fn((3, 2, 3), |(frame, row, k)| (100 * frame + 10 * row + k) as f64);
        let recording = Recording::at_rate(frames, 20.0).unwrap();
        assert_eq!(recording.times_s(), [0.0, 0.05, 0.1]);
        assert_eq!(
            recording.frame_ohm(1),
            ndarray::array![[100.0, 101.0, 102.0], [110.0, 111.0, 112.0]]
        );
        let empty = Recording::at_rate(Array3::zeros((0, 2, 3)), 20.0);
        assert!(matches!(empty, Err(RecordingError::Empty)));
    }

    #[test]
    fn a_truncated_recording_keeps_its_complete_frames() {
        let bytes = recorded();
        let lines: Vec<&[u8]> = bytes.split_inclusive(|&byte| byte == b'\n').collect();
        assert_eq!(read(&lines[..6].concat()).unwrap().times_s().len(), 2);
        assert!(matches!(read(&lines[..2].concat()), Err(RecordingError::Empty)));
    }

    #[test]
    fn a_recording_cut_off_anywhere_keeps_its_complete_frames() {
        let bytes = recorded();
        let ends: Vec<usize> = (0..bytes.len()).filter(|&place| bytes[place] == b'\n').collect();
        for length in ends[2] + 1..bytes.len() {
            let recording = read(&bytes[..length]).unwrap();
            let whole = ends.iter().filter(|&&end| end < length).count() - 1;
            assert_eq!(recording.times_s().len(), whole / 2, "{length}");
            let is_torn = bytes[length - 1] != b'\n';
            assert_eq!(recording.torn_line(), is_torn.then_some(whole as u64 + 2), "{length}");
            assert_eq!(
                recording.frame_ohm(0),
                ndarray::array![[0.1, 1.1, 2.1], [3.1, 4.1, 5.1]]
            );
        }
    }

    #[test]
    fn a_failed_writer_leaves_a_length_of_whole_frames() {
        /// A disk with room for some more bytes.
        struct Full(Vec<u8>, usize);
        impl Write for Full {
            fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
                let room = bytes.len().min(self.1 - self.0.len());
                self.0.extend_from_slice(&bytes[..room]);
                if room == 0 {
                    Err(io::ErrorKind::StorageFull.into())
                } else {
                    Ok(room)
                }
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let whole = recorded();
        for room in 30..whole.len() {
            let mut disk = Full(Vec::new(), room);
            let mut recorder = Recorder::new(&mut disk, &[0, 2], 3).unwrap();
            let frame = |frame: u32| (0..6).map(|k| 0.1 + f64::from(10 * frame + k)).collect::<Vec<_>>();
            let failed = (0..4).find(|&k| recorder.record(0.1 * f64::from(k), &frame(k)).is_err());
            let bytes = recorder.whole_bytes() as usize;
            let recording = read(&whole[..bytes]);
            assert_eq!(
                recording.map_or(0, |read| read.times_s().len()) as u32,
                failed.unwrap(),
                "{room}"
            );
        }
    }

    #[test]
    fn errors_name_their_line() {
        let text = String::from_utf8(recorded()).unwrap();
        for (from, to, expected) in [
            ("0.1,3", "0.1,1", "line 5: row 3 is expected"),
            ("0.2,1", "0.05,1", "line 6: the time"),
            ("time_s", "time", "line 2: the time"),
            ("0.1,1,10.1", "0.1,1,-1", "line 4, column 3: '-1'"),
        ] {
            let message = read(text.replacen(from, to, 1).as_bytes()).unwrap_err().to_string();
            assert!(message.starts_with(expected), "{message}");
        }
    }
}
