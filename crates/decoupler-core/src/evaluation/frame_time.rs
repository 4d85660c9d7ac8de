use std::time::{Duration, Instant};

use super::Run;
use crate::{
    dataset::Dataset,
    decoupling::{CompiledNetworks, DecodeError, Decoder},
};

/// Returns the time to decode a frame of the test set with the best network so far, in double precision on one thread;
/// `None` if the test set has readings that cannot be decoded.
pub fn network_frame_time(run: &Run) -> Option<Duration> {
    let mut decoder = CompiledNetworks::<f64>::new(&run.network(), run.test().row_count());
    let microseconds = frame_us(&mut decoder, run.test()).ok()?;
    Some(Duration::from_secs_f64(1e-6 * microseconds))
}

/// Returns what [`DecoderCost::frame_us`](super::DecoderCost::frame_us) is the time of, measured on `test`: "a sample", or
/// "a frame of 4 row-wires".
pub fn decoded_unit(test: &Dataset) -> String {
    match (test.frames(), test.row_count()) {
        (Ok(_), rows @ 2..) => format!("a frame of {rows} row-wires"),
        _ => "a sample".to_owned(),
    }
}

/// Returns the time in microseconds to decode a frame of `test`, or a sample if `test` does not consist of whole
/// frames: the median over blocks of frames, each long enough for the clock.
pub(super) fn frame_us(decoder: &mut dyn Decoder, test: &Dataset) -> Result<f64, DecodeError> {
    const FEWEST_BLOCKS: usize = 3;
    const MAX_BLOCKS: usize = 101;
    const BLOCK_SECONDS: f64 = 100e-6;
    const MAX_SECONDS: f64 = 0.03;
    let frames = test.frames().ok();
    let mut answer = vec![0.0; test.row_count() * test.outputs()];
    let mut at = 0;
    let mut decode = |count: usize| -> Result<f64, DecodeError> {
        let begun = Instant::now();
        for _ in 0..count {
            match &frames {
                Some(frames) => {
                    let readings = std::hint::black_box(frames.frame(at % frames.count()));
                    decoder.decode(readings, &mut answer)?;
                }
                None => {
                    let sample = at % test.samples();
                    let readings = std::hint::black_box(test.sample_readings(sample));
                    decoder.decode_row(test.row_index(sample), readings, &mut answer[..test.outputs()])?;
                }
            }
            std::hint::black_box(&answer);
            at += 1;
        }
        Ok(begun.elapsed().as_secs_f64())
    };
    // The first call fills the caches.
    decode(1)?;
    let once = decode(1)?.max(1e-9);
    let frames_in_block = (BLOCK_SECONDS / once).ceil() as usize;
    let mut blocks = Vec::new();
    let mut spent = 0.0;
    while blocks.len() < FEWEST_BLOCKS || (spent < MAX_SECONDS && blocks.len() < MAX_BLOCKS) {
        let seconds = decode(frames_in_block)?;
        spent += seconds;
        blocks.push(1e6 * seconds / frames_in_block as f64);
    }
    blocks.sort_by(f64::total_cmp);
    Ok(blocks[blocks.len() / 2])
}
