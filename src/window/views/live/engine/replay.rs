use std::{
    fs::{self, File},
    io::{BufRead, BufReader, Seek, SeekFrom},
    ops::RangeInclusive,
    path::Path,
    time::{Duration, Instant},
};

use decoupler_core::{scene::Rows, sensor::ArrayScale};
use decoupler_files::{
    import::{LineParser, ParsedLine},
    live::{Lines, Recording},
    machine::{ReadingBudget, system_cause},
};
use ndarray::Array3;

use super::{
    message::{Arrived, ReplayState},
    session::Tally,
};

/// Replay of a recording: its frames come at their recorded times, at an adjustable speed.
#[derive(Debug)]
pub(super) struct ReplayFrames {
    recording: Recording,
    /// Recorded seconds per second.
    speed: f64,
    is_playing: bool,
    /// Recorded time at an instant, from which it advances while playing.
    anchor: (f64, Instant),
    /// Index of the next frame.
    next: usize,
    /// True if the next frame is due now, whatever its time.
    is_wanted: bool,
}

/// Speeds from slowest to fastest.
const SPEEDS: RangeInclusive<f64> = 0.1..=10.0;

impl ReplayFrames {
    /// Creates a replay that begins `at_s` seconds after the first frame.
    pub(super) fn new(recording: Recording, at_s: f64, speed: f64, is_playing: bool, now: Instant) -> Self {
        let mut replay = Self {
            recording,
            speed: 1.0,
            is_playing: false,
            anchor: (0.0, now),
            next: 0,
            is_wanted: true,
        };
        replay.seek(at_s, now);
        replay.set_speed(speed, now);
        replay.play(is_playing, now);
        replay
    }

    fn first_s(&self) -> f64 {
        self.recording.times_s()[0]
    }

    fn frames(&self) -> usize {
        self.recording.times_s().len()
    }

    /// Returns the recorded time at `now`.
    fn time_s(&self, now: Instant) -> f64 {
        let (time_s, since) = self.anchor;
        if self.is_playing {
            time_s + self.speed * now.saturating_duration_since(since).as_secs_f64()
        } else {
            time_s
        }
    }

    pub(super) fn set_speed(&mut self, speed: f64, now: Instant) {
        self.anchor = (self.time_s(now), now);
        self.speed = speed.clamp(*SPEEDS.start(), *SPEEDS.end());
    }

    /// Pauses or resumes the replay; after the end, it restarts from the beginning.
    pub(super) fn play(&mut self, is_playing: bool, now: Instant) {
        if is_playing && self.next >= self.frames() {
            self.seek(0.0, now);
        }
        self.anchor = (self.time_s(now), now);
        self.is_playing = is_playing;
    }

    /// Seeks to a time in seconds after the first frame, and continues from there if it is playing.
    pub(super) fn seek(&mut self, at_s: f64, now: Instant) {
        let time_s = self.first_s() + at_s.max(0.0);
        self.next = self.recording.frame_at(time_s);
        self.anchor = (self.recording.times_s()[self.next], now);
        self.is_wanted = true;
    }

    /// Returns the time at which the next frame is due; `None` while it is paused.
    pub(super) fn due(&self, now: Instant) -> Option<Instant> {
        if self.is_wanted {
            return Some(now);
        }
        let time_s = self.recording.times_s().get(self.next).filter(|_| self.is_playing)?;
        let wait_s = (time_s - self.time_s(now)) / self.speed;
        Some(now + Duration::try_from_secs_f64(wait_s.max(0.0)).unwrap_or(Duration::MAX / 4))
    }

    /// Writes the next frame, if it is due. Frames that were not taken in time are dropped.
    pub(super) fn next(&mut self, frame_ohm: &mut [f64], tally: &mut Tally, now: Instant) -> Option<Arrived> {
        if self.due(now)? > now {
            return None;
        }
        if !std::mem::take(&mut self.is_wanted) {
            let latest = self.recording.frame_at(self.time_s(now));
            let late_s = (self.time_s(now) - self.recording.times_s()[self.next]) / self.speed;
            if late_s > Lines::PATIENCE.as_secs_f64() && latest > self.next {
                tally.dropped((latest - self.next) as u64);
                self.next = latest;
            }
        }
        let time_s = self.recording.times_s()[self.next];
        let readings = self.recording.frame_ohm(self.next);
        frame_ohm.iter_mut().zip(readings).for_each(|(to, ohm)| *to = *ohm);
        self.next += 1;
        if self.next >= self.frames() {
            self.anchor = (time_s, now);
            self.is_playing = false;
        }
        Some(Arrived { time_s, read_at: now })
    }

    /// Returns the position of the frame at `time_s`.
    pub(super) fn state(&self, time_s: f64) -> ReplayState {
        let last_s = self.recording.times_s().last().copied().unwrap_or_default();
        ReplayState {
            at_s: time_s - self.first_s(),
            length_s: last_s - self.first_s(),
            is_playing: self.is_playing,
        }
    }
}

/// Memory of a byte of text that is replayed: short numbers, in a vector that has just doubled.
const MEMORY_OF_BYTE: u64 = 8;
/// Rate of frames without times, per second.
pub(super) const RATE_WITHOUT_TIMES: f64 = 50.0;

/// Reads the frames of `read` row-wires from a file: a recording with a time for each frame, or else lines as `decode`
/// reads them, at an even rate. Malformed lines are counted in `tally`, and incomplete frames are skipped.
///
/// # Errors
/// If the file cannot be read or has no complete frame.
pub(super) fn read_replay(
    path: &Path,
    scale: ArrayScale,
    rows: Rows,
    read: &[usize],
    tally: &mut Tally,
) -> Result<Recording, String> {
    let refused = |cause: &dyn std::fmt::Display| format!("cannot replay '{}': {cause}", path.display());
    let system = |error: std::io::Error| refused(&system_cause(&error));
    let found = fs::metadata(path).map_err(system)?;
    if !found.is_file() {
        return Err(refused(&"it is not a file; choose a recording"));
    }
    let claimed = ReadingBudget::now().claim(found.len().saturating_mul(MEMORY_OF_BYTE));
    claimed.map_err(|over| refused(&over))?;
    let mut file = File::open(path).map_err(system)?;
    let mut first = Vec::new();
    BufReader::new(&file).read_until(b'\n', &mut first).map_err(system)?;
    file.seek(SeekFrom::Start(0)).map_err(system)?;
    let reader = BufReader::new(file);
    let has_times = first
        .split(|&byte| byte == b',')
        .any(|name| name.trim_ascii() == b"time_s");
    let recording = if has_times {
        let recording = Recording::read(reader, read, scale.rows(), scale.columns());
        if let Some(line) = recording.as_ref().ok().and_then(Recording::torn_line) {
            tally.bad(format!("line {line}, the last, is cut off and left out"));
        }
        recording.map_err(|error| error.to_string())
    } else {
        read_lines(reader, scale, rows, read.len(), tally)
    };
    recording.map_err(|reason| refused(&reason))
}

fn read_lines(
    reader: impl BufRead,
    scale: ArrayScale,
    rows: Rows,
    read: usize,
    tally: &mut Tally,
) -> Result<Recording, String> {
    let mut parser = LineParser::of_array(scale, rows, true).map_err(|error| error.to_string())?;
    let length = read * scale.columns();
    let mut all_ohm: Vec<f64> = Vec::new();
    let mut frame_ohm: Vec<f64> = Vec::with_capacity(length);
    for (line, number) in reader.split(b'\n').zip(1..) {
        let line = line.map_err(|error| system_cause(&error).to_string())?;
        match parser.parse(number, &line) {
            Ok(ParsedLine::NoReadings | ParsedLine::Start { .. }) => {}
            Ok(ParsedLine::Snapshot(readings_ohm)) => all_ohm.extend_from_slice(readings_ohm),
            Ok(ParsedLine::Row {
                row_index, readings, ..
            }) => {
                let index = row_index.unwrap_or(0);
                if index * scale.columns() != frame_ohm.len() {
                    frame_ohm.clear();
                }
                // Otherwise an earlier row is missing, and the frame is incomplete.
                if index * scale.columns() == frame_ohm.len() {
                    frame_ohm.extend_from_slice(readings);
                }
                if frame_ohm.len() == length {
                    all_ohm.append(&mut frame_ohm);
                }
            }
            Err(error) if error.is_final() => return Err(error.to_string()),
            Err(error) => tally.bad(error.to_string()),
        }
    }
    let frames = all_ohm.len() / length;
    let shape = (frames, read, scale.columns());
    let frames_ohm = Array3::from_shape_vec(shape, all_ohm).expect("every frame has all readings");
    let recording = Recording::at_rate(frames_ohm, RATE_WITHOUT_TIMES);
    recording.map_err(|error| match tally.counts().last_bad {
        Some(reason) => format!("{error}; {reason}"),
        None => error.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use decoupler_files::live::Recorder;
    use ndarray::Array3;

    use super::*;

    fn replay(speed: f64, start: Instant) -> ReplayFrames {
        let frames = Array3::from_shape_fn((100, 1, 1), |(frame, ..)| frame as f64 + 1.0);
        ReplayFrames::new(Recording::at_rate(frames, 20.0).unwrap(), 0.0, speed, true, start)
    }

    /// Returns the frames that come in `millis` after the start, polled every 5 ms.
    fn frames(replay: &mut ReplayFrames, tally: &mut Tally, start: Instant, millis: std::ops::Range<u64>) -> Vec<f64> {
        let mut received = Vec::new();
        for k in millis.step_by(5) {
            let mut ohm = [0.0];
            while replay.next(&mut ohm, tally, start + Duration::from_millis(k)).is_some() {
                received.push(ohm[0]);
            }
        }
        received
    }

    #[test]
    fn frames_come_at_their_times_faster_or_slower() {
        let start = Instant::now();
        let mut tally = Tally::new(start);
        for (speed, expected) in [(1.0, 11), (10.0, 100), (0.1, 2)] {
            let received = frames(&mut replay(speed, start), &mut tally, start, 0..505);
            let numbers: Vec<f64> = (1..=expected).map(f64::from).collect();
            assert_eq!(received, numbers, "{speed}");
        }
        assert_eq!(tally.counts().dropped, 0);
    }

    #[test]
    fn seeking_shows_a_frame_at_once_and_the_replay_stops_at_the_end() {
        let start = Instant::now();
        let (mut tally, mut replay) = (Tally::new(start), replay(1.0, start));
        replay.play(false, start);
        assert_eq!(frames(&mut replay, &mut tally, start, 0..1000), [1.0]);
        replay.seek(2.02, start);
        assert_eq!(frames(&mut replay, &mut tally, start, 0..1000), [41.0]);
        replay.seek(4.9, start);
        replay.play(true, start);
        assert_eq!(frames(&mut replay, &mut tally, start, 0..1000), [99.0, 100.0]);
        let state = replay.state(4.95);
        assert!(!state.is_playing && (state.length_s - 4.95).abs() < 1e-12 && replay.due(start).is_none());
        replay.play(true, start);
        assert_eq!(frames(&mut replay, &mut tally, start, 0..6), [1.0], "it begins again");
    }

    #[test]
    fn frames_not_taken_in_time_are_dropped() {
        let start = Instant::now();
        let (mut tally, mut replay) = (Tally::new(start), replay(1.0, start));
        assert_eq!(frames(&mut replay, &mut tally, start, 0..5), [1.0]);
        assert_eq!(frames(&mut replay, &mut tally, start, 1020..1025), [21.0]);
        assert_eq!(tally.counts().dropped, 19);
    }

    fn read(text: &[u8], rows: Rows) -> (Result<Recording, String>, Tally) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.csv");
        fs::write(&path, text).unwrap();
        let mut tally = Tally::new(Instant::now());
        let scale = "2x1_1x3".parse().unwrap();
        (read_replay(&path, scale, rows, &[0, 1], &mut tally), tally)
    }

    #[test]
    fn recordings_keep_their_times_and_other_files_come_at_an_even_rate() {
        let mut recorded = Vec::new();
        let mut recorder = Recorder::new(&mut recorded, &[0, 1], 3).unwrap();
        for time_s in [0.5, 0.75] {
            recorder.record(time_s, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap();
        }
        let (recording, _) = read(&recorded, Rows::Known);
        assert_eq!(recording.unwrap().times_s(), [0.5, 0.75]);
        let texts: [&[u8]; 4] = [
            b"1,2,3\n4,5,6\n1,2,3\n4,5,6\n",
            b"row,r_1,r_2,r_3\n1,1,2,3\n2,4,5,6\n1,1,2,3\n2,4,5,6\n",
            b"1,2,3,4,5,6\n1,2,3,4,5,6\n",
            // The first line has lost its row-wire.
            b"row,r_3,r_2,r_1\n2,9,9,9\n1,3,2,1\n2,6,5,4\n1,3,2,1\n2,6,5,4\n",
        ];
        for text in texts {
            let recording = read(text, Rows::Known).0.unwrap();
            assert_eq!(recording.times_s(), [0.0, 0.02], "{}", String::from_utf8_lossy(text));
            assert_eq!(
                recording.frame_ohm(1),
                ndarray::array![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
            );
        }
    }

    #[test]
    fn a_recording_cut_off_by_a_full_disk_is_replayed_and_the_line_reported() {
        let mut recorded = Vec::new();
        let mut recorder = Recorder::new(&mut recorded, &[0, 1], 3).unwrap();
        for time_s in [0.5, 0.75] {
            recorder.record(time_s, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.5]).unwrap();
        }
        let (recording, tally) = read(&recorded[..recorded.len() - 3], Rows::Known);
        assert_eq!(recording.unwrap().times_s(), [0.5]);
        let reason = tally.counts().last_bad.unwrap();
        assert!(reason.contains("line 5, the last, is cut off"), "{reason}");
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_file_is_refused_before_it_is_opened() {
        let mut tally = Tally::new(Instant::now());
        let refused = read_replay(
            Path::new("/dev/zero"),
            "2x1_1x3".parse().unwrap(),
            Rows::Known,
            &[0, 1],
            &mut tally,
        );
        assert!(refused.unwrap_err().contains("it is not a file"));
    }

    #[test]
    fn headers_that_lack_a_resistance_are_refused() {
        let (refused, _) = read(b"time,r_1,r_2\n1,2,3\n4,5,6\n", Rows::Known);
        let message = refused.unwrap_err();
        assert!(message.contains("line 1: there is no column 'r_3'"), "{message}");
    }

    #[test]
    fn a_frame_with_a_bad_line_is_left_out_and_the_line_reported() {
        let (recording, tally) = read(b"1,2,3\n4,#,6\n1,2,3\n4,5,6\n", Rows::Known);
        assert_eq!(recording.unwrap().times_s().len(), 1);
        let counts = tally.counts();
        assert!(counts.bad == 1 && counts.last_bad.unwrap().starts_with("line 2"));
        let (nothing, _) = read(b"1,2\n", Rows::Known);
        let message = nothing.unwrap_err();
        assert!(
            message.contains("frames.csv") && message.contains("line 1"),
            "{message}"
        );
    }
}
