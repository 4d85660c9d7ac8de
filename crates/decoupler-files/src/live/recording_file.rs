use std::{
    fs::{self, File, OpenOptions},
    io::{self, ErrorKind},
    path::{Path, PathBuf},
};

use super::Recorder;
use crate::machine::system_cause;

/// A finished recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Its file.
    pub path: PathBuf,
    /// Number of frames.
    pub frames: u64,
    /// Time from the first to the last frame, in seconds.
    pub seconds: f64,
}

/// A recording in progress: every frame is written to the file as soon as it arrives.
#[derive(Debug)]
pub(super) struct RecordingFile {
    path: PathBuf,
    /// The file of the recorder.
    file: File,
    recorder: Recorder<File>,
    frames: u64,
    /// Times of the first and the last frame in seconds.
    span_s: Option<(f64, f64)>,
}

impl RecordingFile {
    /// Creates a file with a unique name in `folder`, which is created if it is missing.
    ///
    /// # Errors
    /// If the file cannot be created, with the reason.
    pub(super) fn create(folder: &Path, rows: &[usize], columns: usize) -> Result<Self, String> {
        let created = fs::create_dir_all(folder).and_then(|()| new_file(folder));
        let refused = |error: io::Error| {
            let (folder, cause) = (folder.display(), system_cause(&error));
            format!("cannot record to the folder '{folder}': {cause}")
        };
        let (path, file) = created.map_err(refused)?;
        let recorder = file
            .try_clone()
            .and_then(|file| Recorder::new(file, rows, columns))
            .inspect_err(|_| {
                // A part of the header is no recording; the error is reported in any case.
                let _ = fs::remove_file(&path);
            })
            .map_err(refused)?;
        Ok(Self {
            path,
            file,
            recorder,
            frames: 0,
            span_s: None,
        })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a frame.
    ///
    /// # Errors
    /// If it cannot be written, with the reason; earlier frames stay in the file, and no part of this one.
    pub(super) fn record(&mut self, time_s: f64, frame_ohm: &[f64]) -> Result<(), String> {
        self.recorder.record(time_s, frame_ohm).map_err(|error| {
            // Readers leave out a part of a line, too.
            let _ = self.file.set_len(self.recorder.whole_bytes());
            let (path, cause) = (self.path.display(), system_cause(&error));
            format!("the recording '{path}' has ended: {cause}; earlier frames are kept")
        })?;
        self.frames += 1;
        self.span_s = Some((self.span_s.map_or(time_s, |(first_s, _)| first_s), time_s));
        Ok(())
    }

    /// Returns the number of frames and the time from the first to the last, in seconds.
    pub(super) fn length(&self) -> (u64, f64) {
        (
            self.frames,
            self.span_s.map_or(0.0, |(first_s, last_s)| last_s - first_s),
        )
    }

    /// Ends the recording.
    pub(super) fn end(self) -> Recorded {
        let (frames, seconds) = self.length();
        Recorded {
            path: self.path,
            frames,
            seconds,
        }
    }
}

fn new_file(folder: &Path) -> io::Result<(PathBuf, File)> {
    let mut number = 1_u64;
    loop {
        let path = folder.join(format!("recording-{number:04}.csv"));
        match OpenOptions::new().write(true).create_new(true).open(&path) {
            Ok(file) => return Ok((path, file)),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => number += 1,
            Err(error) => return Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::BufReader;

    use super::*;
    use crate::live::Recording;

    #[test]
    fn each_recording_has_its_own_file_that_is_complete_after_every_frame() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("not yet there");
        let [mut first, second] = [0, 1].map(|_| RecordingFile::create(&folder, &[0], 2).unwrap());
        assert_ne!(first.path(), second.path());
        for frame in 1..=3 {
            first.record(0.5 * f64::from(frame), &[1.0, f64::from(frame)]).unwrap();
            let file = BufReader::new(File::open(first.path()).unwrap());
            let recording = Recording::read(file, &[0], 1, 2).unwrap();
            assert_eq!(recording.times_s().len(), frame as usize);
        }
        let recorded = first.end();
        assert_eq!((recorded.frames, recorded.seconds), (3, 1.0));
    }

    #[test]
    fn a_folder_that_cannot_be_created_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let message = RecordingFile::create(&file.join("recordings"), &[0], 2).unwrap_err();
        assert!(message.starts_with("cannot record to the folder"), "{message}");
    }
}
