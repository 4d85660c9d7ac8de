use std::{
    fs::{self, File},
    io::{BufRead, BufReader, Seek, SeekFrom},
    ops::{ControlFlow, RangeInclusive},
    path::Path,
    time::{Duration, Instant},
};

use ndarray::Array3;

use super::{Lines, Recording, SessionError, tally::Tally};
use crate::{
    export::NetworkFile,
    import::ParsedLine,
    machine::{ReadingBudget, system_cause},
};

/// Replay of a recording: its frames come at their recorded times, at an adjustable speed.
#[derive(Debug)]
pub struct Replay {
    recording: Recording,
    /// Index of the network of each sample; empty if a frame has all row-wires.
    row_indices: Vec<usize>,
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

/// A frame that is due.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Due {
    pub(super) index: usize,
    /// Number of frames before it that were not taken in time.
    pub(super) missed: usize,
}

/// Position in a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReplayState {
    /// Time of the displayed frame, from the first, in seconds.
    pub at_s: f64,
    /// Time of the last frame, from the first, in seconds.
    pub length_s: f64,
    /// False while it is paused.
    pub is_playing: bool,
}

/// Speeds from slowest to fastest.
const SPEEDS: RangeInclusive<f64> = 0.1..=10.0;

impl Replay {
    /// Prepares the replay of the file at `path` for the network of `file`, from the first frame, not playing. Malformed
    /// lines of an array are counted in `tally`.
    ///
    /// # Errors
    /// If the file cannot be read, or has no complete frame.
    pub(super) fn open(
        path: &Path,
        file: &NetworkFile,
        tally: &mut Tally,
        is_wanted: &dyn Fn() -> bool,
        now: Instant,
    ) -> Result<Self, SessionError> {
        let (recording, row_indices) = match &file.problem.sensor {
            Some(_) => (read_frames(path, file, tally)?, Vec::new()),
            None => read_samples(path, file, is_wanted)?,
        };
        Ok(Self::new(recording, row_indices, now))
    }

    fn new(recording: Recording, row_indices: Vec<usize>, now: Instant) -> Self {
        Self {
            anchor: (recording.times_s()[0], now),
            recording,
            row_indices,
            speed: 1.0,
            is_playing: false,
            next: 0,
            is_wanted: true,
        }
    }

    /// Returns the time of a frame in seconds.
    pub(super) fn frame_time_s(&self, index: usize) -> f64 {
        self.recording.times_s()[index]
    }

    /// Writes the readings of a frame, and returns the index of the row-wire with which it begins.
    pub(super) fn read(&self, index: usize, readings: &mut Vec<f64>) -> usize {
        readings.clear();
        readings.extend(self.recording.frame_ohm(index));
        self.row_indices.get(index).copied().unwrap_or(0)
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

    /// Sets the number of recorded seconds per second, from 0.1 to 10.
    pub fn set_speed(&mut self, speed: f64, now: Instant) {
        self.anchor = (self.time_s(now), now);
        self.speed = speed.clamp(*SPEEDS.start(), *SPEEDS.end());
    }

    /// Pauses or resumes the replay; after the end, it restarts from the beginning.
    pub fn play(&mut self, is_playing: bool, now: Instant) {
        if is_playing && self.next >= self.frames() {
            self.seek(0.0, now);
        }
        self.anchor = (self.time_s(now), now);
        self.is_playing = is_playing;
    }

    /// Seeks to a time in seconds after the first frame, and continues from there if it is playing.
    pub fn seek(&mut self, at_s: f64, now: Instant) {
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

    /// Takes the next frame, if it is due. Frames that were not taken in time are missed.
    pub(super) fn take(&mut self, now: Instant) -> Option<Due> {
        if self.due(now)? > now {
            return None;
        }
        let mut missed = 0;
        if !std::mem::take(&mut self.is_wanted) {
            let latest = self.recording.frame_at(self.time_s(now));
            let late_s = (self.time_s(now) - self.frame_time_s(self.next)) / self.speed;
            if late_s > Lines::PATIENCE.as_secs_f64() && latest > self.next {
                missed = latest - self.next;
            }
        }
        let index = self.next + missed;
        self.next = index + 1;
        if self.next >= self.frames() {
            self.anchor = (self.frame_time_s(index), now);
            self.is_playing = false;
        }
        Some(Due { index, missed })
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
const RATE_WITHOUT_TIMES: f64 = 50.0;

/// Reads the frames of an array from a file: a recording with a time for each frame, or else lines as `decode` reads them, at
/// an even rate. Malformed lines are counted in `tally`, and incomplete frames are skipped.
fn read_frames(path: &Path, file: &NetworkFile, tally: &mut Tally) -> Result<Recording, SessionError> {
    let simulation = file.problem.sensor.as_ref().ok_or(SessionError::NoModel)?;
    let (scale, scene) = (simulation.sensor.scale, &simulation.scene);
    let read = scene.rows.read(scale.rows())?;
    let refused = |cause: &dyn std::fmt::Display| SessionError::Replay(path.to_owned(), cause.to_string());
    let system = |error: std::io::Error| refused(&system_cause(&error));
    let found = fs::metadata(path).map_err(system)?;
    if !found.is_file() {
        return Err(refused(&"it is not a file; choose a recording"));
    }
    let claimed = ReadingBudget::now().claim(found.len().saturating_mul(MEMORY_OF_BYTE));
    claimed.map_err(|over| refused(&over))?;
    let mut opened = File::open(path).map_err(system)?;
    let mut first = Vec::new();
    BufReader::new(&opened).read_until(b'\n', &mut first).map_err(system)?;
    opened.seek(SeekFrom::Start(0)).map_err(system)?;
    let reader = BufReader::new(opened);
    let has_times = first
        .split(|&byte| byte == b',')
        .any(|name| name.trim_ascii() == b"time_s");
    if has_times {
        let recording =
            Recording::read(reader, &read, scale.rows(), scale.columns()).map_err(|error| refused(&error))?;
        if let Some(line) = recording.torn_line() {
            tally.bad(&format!("line {line}, the last, is cut off and left out"));
        }
        return Ok(recording);
    }
    let mut lines = file.line_parser(true, true)?;
    let (columns, length) = (scale.columns(), read.len() * scale.columns());
    let mut all_ohm: Vec<f64> = Vec::new();
    let mut frame_ohm: Vec<f64> = Vec::with_capacity(length);
    for (line, number) in reader.split(b'\n').zip(1..) {
        match lines.parse(number, &line.map_err(system)?) {
            Ok(ParsedLine::Snapshot(readings)) => all_ohm.extend_from_slice(readings),
            Ok(ParsedLine::Row {
                row_index, readings, ..
            }) => {
                let begin = row_index.unwrap_or(0) * columns;
                if begin != frame_ohm.len() {
                    frame_ohm.clear();
                }
                // Otherwise an earlier row is missing, and the frame is incomplete.
                if begin == frame_ohm.len() {
                    frame_ohm.extend_from_slice(readings);
                }
                if frame_ohm.len() == length {
                    all_ohm.append(&mut frame_ohm);
                }
            }
            Ok(ParsedLine::NoReadings | ParsedLine::Start { .. }) => {}
            Err(error) if error.is_final() => return Err(refused(&error)),
            Err(error) => tally.bad(&error.to_string()),
        }
    }
    let frames = all_ohm.len() / length;
    let frames_ohm = Array3::from_shape_vec((frames, read.len(), columns), all_ohm);
    let frames_ohm = frames_ohm.expect("every frame has all readings");
    let recording = Recording::at_rate(frames_ohm, RATE_WITHOUT_TIMES);
    recording.map_err(|error| match &tally.counts.first_bad {
        Some(reason) => refused(&format_args!("{error}; {reason}")),
        None => refused(&error),
    })
}

/// Reads the samples for a network of a recording from a file, with the index of the network of each. They come at the times of
/// the file or, without a time column, at an even rate.
fn read_samples(
    path: &Path,
    file: &NetworkFile,
    is_wanted: &dyn Fn() -> bool,
) -> Result<(Recording, Vec<usize>), SessionError> {
    let refused = |cause: &dyn std::fmt::Display| SessionError::Replay(path.to_owned(), cause.to_string());
    let recipe = file.recorded.as_ref().map(|recorded| recorded.plan.import.clone());
    let watch = &mut |_| match is_wanted() {
        true => ControlFlow::Continue(()),
        false => ControlFlow::Break(()),
    };
    let has_rows = file.network.only().is_none();
    let table = recipe
        .unwrap_or_default()
        .read_inputs(path, &file.problem, has_rows, watch)?;
    let row_indices = match (&file.row_wires, &table.row_wires) {
        _ if !has_rows => Vec::new(),
        (Some(read), Some(of_samples)) => {
            let index = |(&row, &line): (&usize, &u64)| {
                let index = read.iter().position(|read| *read == row);
                index.ok_or_else(|| refused(&format_args!("line {line}: there is no network for row {}", row + 1)))
            };
            let indices = of_samples.iter().zip(&table.lines).map(index);
            indices.collect::<Result<_, _>>()?
        }
        _ => {
            return Err(refused(
                &"it has no column of row-wires, and there is a network for each",
            ));
        }
    };
    let (samples, inputs) = table.readings.dim();
    let readings = table.readings.into_shape_with_order((samples, 1, inputs));
    let readings = readings.expect("each sample is a frame of one row");
    let recording = match table.times_s {
        Some(times_s) => Recording::at_times(ascending(&times_s), readings),
        None => Recording::at_rate(readings, RATE_WITHOUT_TIMES),
    };
    Ok((recording.map_err(|error| refused(&error))?, row_indices))
}

/// Times that never step back: a sample with an earlier time than the one before, or none, comes one usual interval (median) after
/// it, and the following ones at their distances.
fn ascending(times_s: &[f64]) -> Vec<f64> {
    let steps = times_s.windows(2).map(|pair| pair[1] - pair[0]);
    let steps = Vec::from_iter(steps.map(|step| Some(step).filter(|step| *step >= 0.0)));
    let mut known = Vec::from_iter(steps.iter().flatten().copied().filter(|step| *step > 0.0));
    known.sort_unstable_by(f64::total_cmp);
    let usual_s = known.get(known.len() / 2).copied().unwrap_or(1.0 / RATE_WITHOUT_TIMES);
    let first_s = times_s
        .first()
        .copied()
        .filter(|time_s| time_s.is_finite())
        .unwrap_or(0.0);
    let mut time_s = first_s;
    let rest = steps.into_iter().map(|step| {
        time_s += step.unwrap_or(usual_s);
        time_s
    });
    std::iter::once(first_s).chain(rest).take(times_s.len()).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use decoupler_core::evaluation::{Run, RunSettings};

    use super::*;
    use crate::live::Recorder;

    fn replay(speed: f64, start: Instant) -> Replay {
        let frames = Array3::from_shape_fn((100, 1, 1), |(frame, ..)| frame as f64 + 1.0);
        let mut replay = Replay::new(Recording::at_rate(frames, 20.0).unwrap(), Vec::new(), start);
        replay.set_speed(speed, start);
        replay.play(true, start);
        replay
    }

    /// Returns the numbers of the frames, from 1, that come in `millis` after the start, polled every 5 ms, and of those missed.
    fn frames(replay: &mut Replay, start: Instant, millis: std::ops::Range<u64>) -> (Vec<usize>, usize) {
        let (mut received, mut missed) = (Vec::new(), 0);
        for k in millis.step_by(5) {
            while let Some(due) = replay.take(start + Duration::from_millis(k)) {
                received.push(due.index + 1);
                missed += due.missed;
            }
        }
        (received, missed)
    }

    #[test]
    fn frames_come_at_their_times_faster_or_slower() {
        let start = Instant::now();
        for (speed, expected) in [(1.0, 11), (10.0, 100), (0.1, 2)] {
            let received = frames(&mut replay(speed, start), start, 0..505);
            assert_eq!(received, (Vec::from_iter(1..=expected), 0), "{speed}");
        }
    }

    #[test]
    fn seeking_shows_a_frame_at_once_and_the_replay_stops_at_the_end() {
        let start = Instant::now();
        let mut replay = replay(1.0, start);
        replay.play(false, start);
        assert_eq!(frames(&mut replay, start, 0..1000).0, [1]);
        replay.seek(2.02, start);
        assert_eq!(frames(&mut replay, start, 0..1000).0, [41]);
        replay.seek(4.9, start);
        replay.play(true, start);
        assert_eq!(frames(&mut replay, start, 0..1000).0, [99, 100]);
        let state = replay.state(4.95);
        assert!(!state.is_playing && (state.length_s - 4.95).abs() < 1e-12 && replay.due(start).is_none());
        replay.play(true, start);
        assert_eq!(frames(&mut replay, start, 0..6).0, [1], "it begins again");
    }

    #[test]
    fn frames_not_taken_in_time_are_missed() {
        let start = Instant::now();
        let mut replay = replay(1.0, start);
        assert_eq!(frames(&mut replay, start, 0..5).0, [1]);
        assert_eq!(frames(&mut replay, start, 1020..1025), (vec![21], 19));
    }

    #[test]
    fn times_that_step_back_or_are_missing_continue_at_the_usual_interval() {
        let nan = f64::NAN;
        let found = ascending(&[5.0, 5.5, 6.0, nan, 7.0, 0.0, 0.25, 10.25]);
        assert_eq!(found, [5.0, 5.5, 6.0, 6.5, 7.0, 7.5, 7.75, 17.75]);
        assert_eq!(ascending(&[nan]), [0.0]);
        assert_eq!(ascending(&[]), [0.0; 0]);
    }

    /// A network of the rows of an array of 2 × 1 and 1 × 3 nodes.
    fn network() -> Arc<NetworkFile> {
        let mut settings = RunSettings::default();
        let simulation = settings.simulation_mut().unwrap();
        simulation.sensor.scale = "2x1_1x3".parse().unwrap();
        (simulation.samples, settings.hidden) = (40, 2);
        settings.training.stopping.epochs = 1;
        let mut run = Run::prepare(settings).unwrap();
        while run.step().is_none() {}
        Arc::new(NetworkFile::from_run(&run, None).unwrap())
    }

    fn read(text: &[u8]) -> (Result<Recording, String>, Tally) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.csv");
        fs::write(&path, text).unwrap();
        let mut tally = Tally::new(Instant::now());
        let read = read_frames(&path, &network(), &mut tally);
        (read.map_err(|error| error.to_string()), tally)
    }

    #[test]
    fn recordings_keep_their_times_and_other_files_come_at_an_even_rate() {
        let mut recorded = Vec::new();
        let mut recorder = Recorder::new(&mut recorded, &[0, 1], 3).unwrap();
        for time_s in [0.5, 0.75] {
            recorder.record(time_s, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap();
        }
        let (recording, _) = read(&recorded);
        assert_eq!(recording.unwrap().times_s(), [0.5, 0.75]);
        let texts: [&[u8]; 4] = [
            b"1,2,3\n4,5,6\n1,2,3\n4,5,6\n",
            b"row,r_1,r_2,r_3\n1,1,2,3\n2,4,5,6\n1,1,2,3\n2,4,5,6\n",
            b"1,2,3,4,5,6\n1,2,3,4,5,6\n",
            // The first line has lost its row-wire.
            b"row,r_3,r_2,r_1\n2,9,9,9\n1,3,2,1\n2,6,5,4\n1,3,2,1\n2,6,5,4\n",
        ];
        for text in texts {
            let recording = read(text).0.unwrap();
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
        let (recording, tally) = read(&recorded[..recorded.len() - 3]);
        assert_eq!(recording.unwrap().times_s(), [0.5]);
        let reason = tally.counts().last_bad.unwrap();
        assert!(reason.contains("line 5, the last, is cut off"), "{reason}");
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_file_is_refused_before_it_is_opened() {
        let mut tally = Tally::new(Instant::now());
        let refused = read_frames(Path::new("/dev/zero"), &network(), &mut tally);
        assert!(refused.unwrap_err().to_string().contains("it is not a file"));
    }

    #[test]
    fn headers_that_lack_a_resistance_are_refused() {
        let message = read(b"time,r_1,r_2\n1,2,3\n4,5,6\n").0.unwrap_err();
        assert!(message.contains("line 1: there is no column 'r_3'"), "{message}");
    }

    #[test]
    fn a_frame_with_a_bad_line_is_left_out_and_the_line_reported() {
        let (recording, tally) = read(b"1,2,3\n4,#,6\n1,2,3\n4,5,6\n");
        assert_eq!(recording.unwrap().times_s().len(), 1);
        let counts = tally.counts();
        assert!(counts.bad == 1 && counts.last_bad.unwrap().starts_with("line 2"));
        let message = read(b"1,2\n").0.unwrap_err();
        assert!(
            message.contains("frames.csv") && message.contains("line 1"),
            "{message}"
        );
    }
}
