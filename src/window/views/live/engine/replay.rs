use std::{
    ops::RangeInclusive,
    time::{Duration, Instant},
};

use super::{
    counts::Tally,
    message::{Arrived, ReplayState},
};
use decoupler_core::live::{Lines, Recording};

/// A recording whose frames come at their times, faster or slower.
#[derive(Debug)]
pub(super) struct ReplayFrames {
    recording: Recording,
    /// Recorded seconds per second.
    speed: f64,
    is_playing: bool,
    /// Recorded time at a moment, from which time continues while it plays.
    anchor: (f64, Instant),
    /// Index of the frame that comes next.
    next: usize,
    /// True if the next frame is wanted whatever its time.
    is_wanted: bool,
}

/// Speeds from slowest to fastest.
const SPEEDS: RangeInclusive<f64> = 0.1..=10.0;

impl ReplayFrames {
    /// Begins with the frame at `at_s` after the first.
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

    /// Recorded time now.
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

    /// Continues, from the beginning after the end, or is paused.
    pub(super) fn play(&mut self, is_playing: bool, now: Instant) {
        if is_playing && self.next >= self.frames() {
            self.seek(0.0, now);
        }
        self.anchor = (self.time_s(now), now);
        self.is_playing = is_playing;
    }

    /// Shows the frame at a time in seconds after the first, and continues from there if it plays.
    pub(super) fn seek(&mut self, at_s: f64, now: Instant) {
        let time_s = self.first_s() + at_s.max(0.0);
        self.next = self.recording.frame_at(time_s);
        self.anchor = (self.recording.times_s()[self.next], now);
        self.is_wanted = true;
    }

    /// When the next frame is due; `None` while it is paused.
    pub(super) fn due(&self, now: Instant) -> Option<Instant> {
        if self.is_wanted {
            return Some(now);
        }
        let time_s = self.recording.times_s().get(self.next).filter(|_| self.is_playing)?;
        let wait_s = (time_s - self.time_s(now)) / self.speed;
        Some(now + Duration::try_from_secs_f64(wait_s.max(0.0)).unwrap_or(Duration::MAX / 4))
    }

    /// Writes the next frame, if it is due. Frames that no one took in time are dropped.
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

    /// Place of the frame at `time_s`.
    pub(super) fn state(&self, time_s: f64) -> ReplayState {
        let last_s = self.recording.times_s().last().copied().unwrap_or_default();
        ReplayState {
            at_s: time_s - self.first_s(),
            length_s: last_s - self.first_s(),
            is_playing: self.is_playing,
        }
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array3;

    use super::*;

    fn replay(speed: f64, start: Instant) -> ReplayFrames {
        let frames = Array3::from_shape_fn((100, 1, 1), |(frame, ..)| frame as f64 + 1.0);
        ReplayFrames::new(Recording::at_rate(frames, 20.0).unwrap(), 0.0, speed, true, start)
    }

    /// The frames that come until `millis` after the start, looked for every 5 ms.
    fn frames(replay: &mut ReplayFrames, tally: &mut Tally, start: Instant, millis: std::ops::Range<u64>) -> Vec<f64> {
        let mut came = Vec::new();
        for k in millis.step_by(5) {
            let mut ohm = [0.0];
            while replay.next(&mut ohm, tally, start + Duration::from_millis(k)).is_some() {
                came.push(ohm[0]);
            }
        }
        came
    }

    #[test]
    fn frames_come_at_their_times_faster_or_slower() {
        let start = Instant::now();
        let mut tally = Tally::new(start);
        for (speed, expected) in [(1.0, 11), (10.0, 100), (0.1, 2)] {
            let came = frames(&mut replay(speed, start), &mut tally, start, 0..505);
            let numbers: Vec<f64> = (1..=expected).map(f64::from).collect();
            assert_eq!(came, numbers, "{speed}");
        }
        assert_eq!(tally.counts().dropped, 0);
    }

    #[test]
    fn a_frame_sought_comes_at_once_and_the_end_stands_still() {
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
    fn the_latest_frame_wins_over_those_that_nobody_took() {
        let start = Instant::now();
        let (mut tally, mut replay) = (Tally::new(start), replay(1.0, start));
        assert_eq!(frames(&mut replay, &mut tally, start, 0..5), [1.0]);
        assert_eq!(frames(&mut replay, &mut tally, start, 1020..1025), [21.0]);
        assert_eq!(tally.counts().dropped, 19);
    }
}
