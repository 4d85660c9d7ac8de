use std::{
    fmt::Display,
    fs,
    path::Path,
    time::{Duration, Instant},
};

use decoupler_core::{dataset::DatasetError, job::Job};

use super::{Answer, LineInput, Lines, SessionError, SessionEvent, Source, Tally};
use crate::{
    export::NetworkFile,
    import::{LineParser, watch},
    machine::{ReadingBudget, system_cause},
};

/// Frames of an array, or samples of another sensor, for replay.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Time of each frame in seconds, in ascending order.
    times_s: Vec<f64>,
    /// Frames × readings of a frame.
    readings: Vec<f64>,
    /// Number of readings of a frame.
    length: usize,
    /// Index of the network of each sample; empty if a frame has all row-wires.
    row_indices: Vec<usize>,
}

/// Rate of frames without times, per second.
const RATE_WITHOUT_TIMES: f64 = 50.0;
/// Memory of a byte of text that is replayed: short numbers, in a vector that has just doubled.
const MEMORY_OF_BYTE: u64 = 8;

impl Recording {
    /// Reads the file at `path` for the network of `file`.
    ///
    /// Frames of an array are those of a file written by [`Recorder`](super::Recorder), or of another that `decode` reads.
    /// Malformed lines and rows out of order are counted in `tally`, and their frames left out; so is a last line that is cut off
    /// in a file with times. Samples of other sensors are read as by `decode`, from files of any format. Times are those of the
    /// file as far as they ascend; without any, frames come at an even rate.
    ///
    /// # Errors
    /// If the file cannot be read, lacks an input, or has no complete frame, or when it is no longer wanted.
    pub fn read(path: &Path, file: &NetworkFile, tally: &mut Tally, job: &Job<'_>) -> Result<Self, SessionError> {
        let mut recording = match &file.problem.sensor {
            Some(simulation) => {
                let scale = simulation.sensor.scale;
                let rows = simulation.scene.rows.read(scale.rows()).map_err(DatasetError::from)?;
                Self::of_array(path, file.line_parser(true, true)?, rows.len() * scale.columns(), tally)?
            }
            None => Self::of_samples(path, file, job)?,
        };
        if recording.times_s.is_empty() {
            let reason = String::from_iter(tally.first_bad.iter().map(|reason| format!("; {reason}")));
            let cause = "it contains no complete frame: record again, or choose another file";
            return Err(refused(path, format_args!("{cause}{reason}")));
        }
        recording.times_s = ascending(&recording.times_s);
        Ok(recording)
    }

    /// Reads frames with `length` readings; those without a time have NaN.
    fn of_array(path: &Path, parser: LineParser, length: usize, tally: &mut Tally) -> Result<Self, SessionError> {
        let found = fs::metadata(path).map_err(|error| refused(path, system_cause(&error)))?;
        if !found.is_file() {
            return Err(refused(path, "it is not a file; choose a recording"));
        }
        let claimed = ReadingBudget::now().claim(found.len().saturating_mul(MEMORY_OF_BYTE));
        claimed.map_err(|over| refused(path, over))?;
        let mut lines = LineInput::open(&Source::File(path.to_owned()), parser, 0)?;
        let (mut times_s, mut readings, mut frame_s) = (Vec::new(), Vec::new(), f64::NAN);
        let mut row = Answer::default();
        loop {
            let event = lines.take(Lines::PATIENCE, &mut row, &mut Vec::new());
            let whole = times_s.len() * length;
            match event {
                SessionEvent::Nothing => {}
                SessionEvent::Answer | SessionEvent::Bad(_) if !row.is_ended && frame_s.is_finite() => {
                    // Its last number may be cut off.
                    tally.bad(&format!("line {}, the last, is cut off and left out", row.line));
                    break;
                }
                SessionEvent::Bad(reason) => {
                    // The rest of its frame is left out without another word.
                    readings.truncate(whole);
                    tally.bad(&reason);
                }
                SessionEvent::Answer => {
                    let index = row.first_row.unwrap_or(0);
                    let expected = (readings.len() - whole) / row.readings.len();
                    if index != expected && expected > 0 {
                        let (line, expected) = (row.line, expected + 1);
                        let cause = "each frame needs its rows in ascending order";
                        tally.bad(&format!("line {line}: row {expected} is expected here: {cause}"));
                        readings.truncate(whole);
                    }
                    if index == 0 {
                        frame_s = row.recorded_s.unwrap_or(f64::NAN);
                    }
                    if index == 0 || index == expected {
                        readings.extend_from_slice(&row.readings);
                    }
                    if readings.len() == whole + length {
                        times_s.push(frame_s);
                    }
                }
                SessionEvent::End(end) => {
                    end?;
                    break;
                }
            }
        }
        readings.truncate(times_s.len() * length);
        Ok(Self {
            times_s,
            readings,
            length,
            row_indices: Vec::new(),
        })
    }

    /// Reads samples; those without a time have NaN.
    fn of_samples(path: &Path, file: &NetworkFile, job: &Job<'_>) -> Result<Self, SessionError> {
        let recipe = file.recorded.as_ref().map(|recorded| recorded.plan.import.clone());
        let has_rows = file.network.only().is_none();
        let recipe = recipe.unwrap_or_default();
        let table = recipe.read_inputs(path, &file.problem, has_rows, &mut watch(job, &mut |_| ()))?;
        let row_indices = match has_rows {
            true => file.row_indices(&table).map_err(|reason| refused(path, reason))?,
            false => Vec::new(),
        };
        let (samples, length) = table.readings.dim();
        Ok(Self {
            times_s: table.times_s.unwrap_or_else(|| vec![f64::NAN; samples]),
            readings: table.readings.into_iter().collect(),
            length,
            row_indices,
        })
    }

    /// Returns the times of the frames in seconds, in ascending order.
    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// Returns the index of the last frame at or before a time; 0 before the first frame.
    pub fn frame_at(&self, time_s: f64) -> usize {
        self.times_s.partition_point(|other| *other <= time_s).saturating_sub(1)
    }

    /// Returns the readings of a frame: those of an array in ohm, row by row.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn frame(&self, index: usize) -> &[f64] {
        &self.readings[index * self.length..][..self.length]
    }
}

fn refused(path: &Path, cause: impl Display) -> SessionError {
    SessionError::Replay(path.to_owned(), cause.to_string())
}

/// Times that never step back: a frame with an earlier time than the one before, or none, comes one usual interval (median) after
/// it, and the following ones at their distances. Without any time, frames come at an even rate.
fn ascending(times_s: &[f64]) -> Vec<f64> {
    if times_s.iter().all(|time_s| time_s.is_nan()) {
        return Vec::from_iter((0..times_s.len()).map(|frame| frame as f64 / RATE_WITHOUT_TIMES));
    }
    let steps = Vec::from_iter(times_s.windows(2).map(|pair| pair[1] - pair[0]));
    let mut known = Vec::from_iter(steps.iter().copied().filter(|step| *step > 0.0));
    known.sort_unstable_by(f64::total_cmp);
    let usual_s = known.get(known.len() / 2).copied().unwrap_or(1.0 / RATE_WITHOUT_TIMES);
    let first_s = if times_s[0].is_finite() { times_s[0] } else { 0.0 };
    let rest = steps.iter().scan(first_s, |time_s, &step| {
        *time_s += if step >= 0.0 { step } else { usual_s };
        Some(*time_s)
    });
    std::iter::once(first_s).chain(rest).collect()
}

/// Replay of a recording: its frames come at their recorded times, at an adjustable speed.
#[derive(Debug)]
pub struct Replay {
    /// Position of the frame that was taken last.
    pub state: ReplayState,
    recording: Recording,
    /// True if no frame is dropped: every one is taken once and in order, also if it is not displayed.
    keeps_all: bool,
    /// Recorded seconds per second.
    speed: f64,
    /// Recorded time at an instant, from which it advances while playing.
    anchor: (f64, Instant),
    /// Index of the frame that is due, until it and all before it are taken.
    due: Option<usize>,
    /// Index of the next frame after it.
    next: usize,
    /// Number of frames that were taken in order.
    taken: usize,
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

impl Replay {
    /// Begins a replay from the first frame.
    pub(super) fn new(recording: Recording, keeps_all: bool, now: Instant) -> Self {
        let (first_s, last_s) = (recording.times_s[0], recording.times_s[recording.times_s.len() - 1]);
        Self {
            state: ReplayState {
                at_s: 0.0,
                length_s: last_s - first_s,
                is_playing: true,
            },
            recording,
            keeps_all,
            speed: 1.0,
            anchor: (first_s, now),
            due: Some(0),
            next: 1,
            taken: 0,
        }
    }

    /// Returns the recorded time at `now`.
    fn time_s(&self, now: Instant) -> f64 {
        let (time_s, since) = self.anchor;
        let since = if self.state.is_playing { since } else { now };
        time_s + self.speed * now.saturating_duration_since(since).as_secs_f64()
    }

    /// Sets the number of recorded seconds per second, from 0.1 to 10.
    pub fn set_speed(&mut self, speed: f64, now: Instant) {
        self.anchor = (self.time_s(now), now);
        self.speed = speed.clamp(0.1, 10.0);
    }

    /// Pauses or resumes the replay; after the end, it restarts from the beginning.
    pub fn play(&mut self, is_playing: bool, now: Instant) {
        if is_playing && self.next >= self.recording.times_s.len() {
            self.seek(0.0, now);
        }
        self.anchor = (self.time_s(now), now);
        self.state.is_playing = is_playing;
    }

    /// Seeks to a time in seconds after the first frame, and continues from there if it is playing.
    pub fn seek(&mut self, at_s: f64, now: Instant) {
        let index = self.recording.frame_at(self.recording.times_s[0] + at_s.max(0.0));
        self.anchor = (self.recording.times_s[index], now);
        (self.due, self.next) = (Some(index), index + 1);
    }

    /// Returns the time at which the next frame is due; `None` while it is paused.
    pub(super) fn due(&self, now: Instant) -> Option<Instant> {
        if self.due.is_some() {
            return Some(now);
        }
        let next_s = self.recording.times_s.get(self.next);
        let time_s = next_s.filter(|_| self.state.is_playing)?;
        let wait_s = (time_s - self.time_s(now)) / self.speed;
        Some(now + Duration::try_from_secs_f64(wait_s.max(0.0)).unwrap_or(Duration::MAX / 4))
    }

    /// Takes the next frame, if it is due. Of an array, frames that were not taken in time are dropped.
    pub(super) fn take(&mut self, now: Instant, answer: &mut Answer, tally: &mut Tally) -> SessionEvent {
        if self.due(now).is_none_or(|due| due > now) {
            return SessionEvent::Nothing;
        }
        let (now_s, times_s) = (self.time_s(now), &self.recording.times_s);
        let due = *self.due.get_or_insert_with(|| {
            let first = self.next;
            let is_late = now_s - times_s[first] > self.speed * Lines::PATIENCE.as_secs_f64();
            let latest = if is_late { self.recording.frame_at(now_s) } else { first };
            let due = latest.max(first);
            tally.dropped += if self.keeps_all { 0 } else { (due - first) as u64 };
            self.next = due + 1;
            due
        });
        if self.next >= times_s.len() {
            (self.anchor, self.state.is_playing) = ((times_s[due], now), false);
        }
        let index = if self.keeps_all { due.min(self.taken) } else { due };
        self.due = Some(due).filter(|due| index < *due);
        answer.is_repeated = self.keeps_all && index < self.taken;
        self.taken = self.taken.max(index + 1);
        answer.readings.clear();
        answer.readings.extend_from_slice(self.recording.frame(index));
        answer.first_row = Some(self.recording.row_indices.get(index).copied().unwrap_or(0));
        (answer.time_s, answer.read_at) = (times_s[index], Some(now));
        self.state.at_s = times_s[index] - times_s[0];
        SessionEvent::Answer
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::sync::Arc;

    use decoupler_core::evaluation::{Run, RunSettings};

    use super::*;
    use crate::live::Recorder;

    fn replay(speed: f64, start: Instant) -> Replay {
        let recording = Recording {
            times_s: (0..100).map(|frame| f64::from(frame) / 20.0).collect(),
            readings: (1..=100).map(f64::from).collect(),
            length: 1,
            row_indices: Vec::new(),
        };
        let mut replay = Replay::new(recording, false, start);
        replay.set_speed(speed, start);
        replay.play(true, start);
        replay
    }

    /// Returns the numbers of the frames, from 1, that come in `millis` after the start, polled every 5 ms, and of those missed.
    fn frames(replay: &mut Replay, start: Instant, millis: std::ops::Range<u64>) -> (Vec<usize>, u64) {
        let (mut received, mut tally, mut answer) = (Vec::new(), Tally::default(), Answer::default());
        for k in millis.step_by(5) {
            let now = start + Duration::from_millis(k);
            while matches!(replay.take(now, &mut answer, &mut tally), SessionEvent::Answer) {
                received.push(answer.readings[0] as usize);
            }
        }
        (received, tally.dropped)
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
        let state = replay.state;
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
        assert_eq!(ascending(&[nan, nan]), [0.0, 0.02]);
    }

    /// A network of the rows of an array of 2 × 1 and 1 × 3 nodes.
    pub(in crate::live) fn network() -> Arc<NetworkFile> {
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
        let mut tally = Tally::default();
        let read = Recording::read(&path, &network(), &mut tally, &Job::UNINTERRUPTED);
        (read.map_err(|error| error.to_string()), tally)
    }

    /// Four frames of two rows with three channels.
    fn recorded() -> Vec<u8> {
        let mut file = Vec::new();
        let mut recorder = Recorder::new(&mut file, &[0, 1], 3).unwrap();
        for frame in 0..4 {
            let frame_ohm: Vec<f64> = (0..6).map(|k| 0.1 + f64::from(10 * frame + k)).collect();
            recorder.record(0.1 * f64::from(frame), &frame_ohm).unwrap();
        }
        file
    }

    #[test]
    fn recorded_frames_are_replayed_bit_for_bit() {
        let recording = read(&recorded()).0.unwrap();
        assert_eq!(recording.times_s(), [0.0, 0.1, 0.2, 0.1 * 3.0]);
        assert_eq!(recording.frame(2), [20.1, 21.1, 22.1, 23.1, 24.1, 25.1]);
        for (time_s, frame) in [(-1.0, 0), (0.0, 0), (0.15, 1), (0.2, 2), (99.0, 3)] {
            assert_eq!(recording.frame_at(time_s), frame, "{time_s}");
        }
    }

    #[test]
    fn a_recording_cut_off_anywhere_keeps_its_complete_frames() {
        let folder = tempfile::tempdir().unwrap();
        let (path, bytes, network) = (folder.path().join("cut.csv"), recorded(), network());
        let ends: Vec<usize> = (0..bytes.len()).filter(|&place| bytes[place] == b'\n').collect();
        for length in ends[2] + 1..bytes.len() {
            fs::write(&path, &bytes[..length]).unwrap();
            let mut tally = Tally::default();
            let recording = Recording::read(&path, &network, &mut tally, &Job::UNINTERRUPTED).unwrap();
            let whole = ends.iter().filter(|&&end| end < length).count() - 1;
            assert_eq!(recording.times_s().len(), whole / 2, "{length}");
            let is_torn = bytes[length - 1] != b'\n';
            let torn = format!("line {}, the last, is cut off and left out", whole + 2);
            assert_eq!(tally.last_bad, is_torn.then_some(torn), "{length}");
            assert_eq!(recording.frame(0), [0.1, 1.1, 2.1, 3.1, 4.1, 5.1]);
        }
        let message = read(&bytes[..=ends[1]]).0.unwrap_err();
        assert!(message.contains("no complete frame"), "{message}");
    }

    /// As when two recordings are joined, or a time is lost.
    #[test]
    fn times_that_do_not_ascend_continue_at_the_usual_interval() {
        let text = String::from_utf8(recorded()).unwrap();
        for time in ["0.05", "", "x"] {
            let (recording, tally) = read(text.replace("\n0.30000000000000004,", &format!("\n{time},")).as_bytes());
            let times_s = recording.unwrap().times_s().to_vec();
            assert!(
                (times_s[3] - 0.3).abs() < 1e-12 && tally.bad == 0,
                "{time}: {times_s:?}"
            );
        }
    }

    #[test]
    fn frames_with_rows_out_of_order_or_malformed_cells_are_left_out_and_the_line_reported() {
        let text = String::from_utf8(recorded()).unwrap();
        for (from, to, bad, expected) in [
            // The next frame finds the row of this line, too.
            ("\n0.1,2,", "\n0.1,1,", 2, "line 5: row 2 is expected here"),
            ("\n0.1,1,10.1", "\n0.1,1,-1", 1, "line 4, column 3: '-1'"),
        ] {
            let (recording, tally) = read(text.replacen(from, to, 1).as_bytes());
            assert_eq!(
                (recording.unwrap().times_s(), tally.bad),
                (&[0.0, 0.2, 0.30000000000000004][..], bad),
                "{to}"
            );
            let reason = tally.first_bad.unwrap();
            assert!(reason.starts_with(expected), "{reason}");
        }
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
            assert_eq!(recording.frame(1), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
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
        let reason = tally.last_bad.unwrap();
        assert!(reason.contains("line 5, the last, is cut off"), "{reason}");
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_file_is_refused_before_it_is_opened() {
        let refused = Recording::read(
            Path::new("/dev/zero"),
            &network(),
            &mut Tally::default(),
            &Job::UNINTERRUPTED,
        );
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
        assert!(tally.bad == 1 && tally.last_bad.unwrap().starts_with("line 2"));
        let message = read(b"1,2\n").0.unwrap_err();
        assert!(
            message.contains("frames.csv") && message.contains("line 1"),
            "{message}"
        );
    }
}
