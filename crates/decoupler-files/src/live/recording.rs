use std::{
    fs::{self, File, OpenOptions},
    io::{self, ErrorKind, Write},
    path::{Path, PathBuf},
};

use crate::machine::system_cause;

/// A recording, finished or in progress.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recorded {
    /// Its file; empty for another writer.
    pub path: PathBuf,
    /// Number of frames.
    pub frames: u64,
    /// Time from the first to the last frame, in seconds.
    pub seconds: f64,
}

/// A recording in progress, in a file.
pub type RecordingFile = Recorder<File>;

/// Writes frames with their times as CSV: one line per row-wire, with columns `time_s`, `row` (from 1) and `r_1` to
/// `r_M4` in ohm. `decode` reads these files too. Every frame is flushed, so that the file ends with a complete line even
/// if the program is terminated.
#[derive(Debug)]
pub struct Recorder<W: Write> {
    /// The file and its length so far.
    pub recorded: Recorded,
    /// Lines of one frame, written together.
    text: Vec<u8>,
    rows: Vec<usize>,
    channels: usize,
    writer: W,
    /// Bytes of the header and of the frames written completely.
    whole_bytes: u64,
    first_s: f64,
}

impl<W: Write> Recorder<W> {
    /// Writes the header for frames of these row-wires (from 0) with this many channels.
    ///
    /// # Errors
    /// If `writer` fails.
    pub fn new(writer: W, rows: &[usize], channels: usize) -> io::Result<Self> {
        let mut text = b"time_s,row".to_vec();
        for channel in 1..=channels {
            write!(text, ",r_{channel}")?;
        }
        text.push(b'\n');
        let mut recorder = Self {
            recorded: Recorded::default(),
            text,
            rows: rows.to_vec(),
            channels,
            writer,
            whole_bytes: 0,
            first_s: 0.0,
        };
        recorder.write()?;
        Ok(recorder)
    }

    /// Writes a frame, rows × channels in ohm, with its time in seconds.
    ///
    /// # Errors
    /// If the writer fails; a part of the frame may then be written.
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
        self.write()?;
        if self.recorded.frames == 0 {
            self.first_s = time_s;
        }
        self.recorded.frames += 1;
        self.recorded.seconds = time_s - self.first_s;
        Ok(())
    }

    fn write(&mut self) -> io::Result<()> {
        self.writer.write_all(&self.text)?;
        self.writer.flush()?;
        self.whole_bytes += self.text.len() as u64;
        Ok(())
    }
}

impl RecordingFile {
    /// Creates a file with a unique name in `folder`, which is created if it is missing, for frames of these row-wires (from 0)
    /// with this many channels.
    ///
    /// # Errors
    /// If the file cannot be created, with the reason.
    pub fn create(folder: &Path, rows: &[usize], columns: usize) -> Result<Self, String> {
        let begin = || {
            fs::create_dir_all(folder)?;
            let (path, file) = new_file(folder)?;
            // A part of the header is no recording; the error is reported in any case.
            let mut recorder = Self::new(file, rows, columns).inspect_err(|_| drop(fs::remove_file(&path)))?;
            recorder.recorded.path = path;
            Ok(recorder)
        };
        begin().map_err(|error: io::Error| {
            let (folder, cause) = (folder.display(), system_cause(&error));
            format!("cannot record to the folder '{folder}': {cause}")
        })
    }

    /// Writes a frame to the file.
    ///
    /// # Errors
    /// If it cannot be written, with the reason; earlier frames stay in the file, and no part of this one.
    pub(super) fn record_whole(&mut self, time_s: f64, frame_ohm: &[f64]) -> Result<(), String> {
        self.record(time_s, frame_ohm).map_err(|error| {
            // Readers leave out a part of a line, too.
            let _ = self.writer.set_len(self.whole_bytes);
            let (path, cause) = (self.recorded.path.display(), system_cause(&error));
            format!("the recording '{path}' has ended: {cause}; earlier frames are kept")
        })
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
    use decoupler_core::job::Job;

    use super::*;
    use crate::{
        export::NetworkFile,
        live::{Recording, Tally, replay::tests::network},
    };

    fn frames(path: &Path, network: &NetworkFile) -> usize {
        let read = Recording::read(path, network, &mut Tally::default(), &Job::UNINTERRUPTED);
        read.map_or(0, |recording| recording.times_s().len())
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
        let folder = tempfile::tempdir().unwrap();
        let (path, network) = (folder.path().join("full.csv"), network());
        let frame = |frame: u32| (0..6).map(|k| 0.1 + f64::from(10 * frame + k)).collect::<Vec<_>>();
        let mut whole = Vec::new();
        let mut recorder = Recorder::new(&mut whole, &[0, 1], 3).unwrap();
        (0..4).for_each(|k| recorder.record(0.1 * f64::from(k), &frame(k)).unwrap());
        for room in 30..whole.len() {
            let mut disk = Full(Vec::new(), room);
            let mut recorder = Recorder::new(&mut disk, &[0, 1], 3).unwrap();
            let failed = (0..4).find(|&k| recorder.record(0.1 * f64::from(k), &frame(k)).is_err());
            fs::write(&path, &whole[..recorder.whole_bytes as usize]).unwrap();
            assert_eq!(frames(&path, &network) as u32, failed.unwrap(), "{room}");
        }
    }

    #[test]
    fn each_recording_has_its_own_file_that_is_complete_after_every_frame() {
        let folder = tempfile::tempdir().unwrap();
        let (folder, network) = (folder.path().join("not yet there"), network());
        let [mut first, second] = [0, 1].map(|_| RecordingFile::create(&folder, &[0, 1], 3).unwrap());
        assert_ne!(first.recorded.path, second.recorded.path);
        for frame in 1..=3 {
            let frame_ohm = [1.0, 2.0, 3.0, 4.0, 5.0, f64::from(frame)];
            first.record(0.5 * f64::from(frame), &frame_ohm).unwrap();
            assert_eq!(frames(&first.recorded.path, &network), frame as usize);
        }
        assert_eq!((first.recorded.frames, first.recorded.seconds), (3, 1.0));
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
