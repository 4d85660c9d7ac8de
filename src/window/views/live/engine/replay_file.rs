use std::{
    fs::File,
    io::{BufRead, BufReader, Seek, SeekFrom},
    path::Path,
};

use ndarray::Array3;

use super::counts::Tally;
use decoupler_core::{
    live::{LineParser, ParsedLine, Recording},
    scene::Rows,
    sensor::ArrayScale,
    text::system_cause,
};

/// Largest file that is replayed: all of it is kept in memory.
const LARGEST_BYTES: u64 = 1 << 30;
/// Rate of frames that come without times.
pub(super) const RATE_WITHOUT_TIMES: f64 = 50.0;

/// Reads the frames of `read` row-wires from a file: a recording with a time for each frame, or else lines as `decode`
/// reads them, at an even rate. Lines that are no frame are counted in `tally`, and frames that lack a row left out.
///
/// # Errors
/// If the file cannot be read or has no whole frame.
pub(super) fn read_replay(
    path: &Path,
    scale: ArrayScale,
    rows: Rows,
    read: &[usize],
    tally: &mut Tally,
) -> Result<Recording, String> {
    let refused = |cause: &dyn std::fmt::Display| format!("cannot replay '{}': {cause}", path.display());
    let system = |error: std::io::Error| refused(&system_cause(&error));
    let mut file = File::open(path).map_err(system)?;
    let bytes = file.metadata().map_err(system)?.len();
    if bytes > LARGEST_BYTES {
        return Err(refused(&format_args!(
            "it has {:.1} GB, and at most 1 GB is kept in memory; cut it, or decode it with decoupler decode",
            bytes as f64 / 1e9
        )));
    }
    let mut first = Vec::new();
    BufReader::new(&file).read_until(b'\n', &mut first).map_err(system)?;
    file.seek(SeekFrom::Start(0)).map_err(system)?;
    let reader = BufReader::new(file);
    let has_times = first
        .split(|&byte| byte == b',')
        .any(|name| name.trim_ascii() == b"time_s");
    let recording = if has_times {
        Recording::read(reader, read, scale.rows(), scale.columns()).map_err(|error| error.to_string())
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
    let mut parser = LineParser::new(scale, rows, true).map_err(|error| error.to_string())?;
    let length = read * scale.columns();
    let mut all_ohm: Vec<f64> = Vec::new();
    let mut frame_ohm: Vec<f64> = Vec::with_capacity(length);
    for (line, number) in reader.split(b'\n').zip(1..) {
        let line = line.map_err(|error| system_cause(&error).to_string())?;
        match parser.parse(number, &line) {
            Ok(ParsedLine::NoReadings) => {}
            Ok(ParsedLine::Snapshot(readings_ohm)) => all_ohm.extend_from_slice(readings_ohm),
            Ok(ParsedLine::Row {
                row_index,
                readings_ohm,
            }) => {
                let index = row_index.unwrap_or(0);
                if index * scale.columns() != frame_ohm.len() {
                    frame_ohm.clear();
                }
                // Otherwise a row before it is missing, and the frame is not whole.
                if index * scale.columns() == frame_ohm.len() {
                    frame_ohm.extend_from_slice(readings_ohm);
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
    use std::{fs, time::Instant};

    use super::*;
    use decoupler_core::live::Recorder;

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
    fn names_that_lack_a_resistance_are_refused() {
        let (refused, _) = read(b"time,r_1,r_2\n1,2,3\n4,5,6\n", Rows::Known);
        let message = refused.unwrap_err();
        assert!(message.contains("line 1: there is no column r_3"), "{message}");
    }

    #[test]
    fn a_frame_with_a_bad_line_is_left_out_and_the_line_told() {
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
