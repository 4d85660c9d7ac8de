use std::time::{Duration, Instant};

use ndarray::Axis;

use super::Run;
use crate::{
    dataset::Dataset,
    decoupling::{CompiledNetworks, DecodeError, FrameDecoder, Real},
    network::Networks,
};

/// Time to decode a frame of the test set by the best network so far, in double precision on one thread. `None` if the
/// test set has readings that are no resistances.
pub fn network_frame_time(run: &Run) -> Option<Duration> {
    let mut decoder = compiled::<f64>(&run.network(), run.test().rows());
    let microseconds = frame_us(&mut *decoder, run.test()).ok()?;
    Some(Duration::from_secs_f64(1e-6 * microseconds))
}

/// Networks of `rows` row-wires, ready to decode.
pub(super) fn compiled<T: Real + 'static>(networks: &Networks, rows: usize) -> Box<dyn FrameDecoder> {
    Box::new(match networks.each() {
        [only] => CompiledNetworks::<T>::shared(only, rows),
        each => CompiledNetworks::<T>::each(each),
    })
}

/// Microseconds to decode a frame of `test`: the median over blocks of frames, each long enough for the clock.
pub(super) fn frame_us(decoder: &mut dyn FrameDecoder, test: &Dataset) -> Result<f64, DecodeError> {
    const FEWEST_BLOCKS: usize = 3;
    const MOST_BLOCKS: usize = 101;
    const BLOCK_SECONDS: f64 = 100e-6;
    const MOST_SECONDS: f64 = 0.03;
    let frames: Vec<_> = test.resistances_ohm.axis_chunks_iter(Axis(0), test.rows()).collect();
    let mut answer_mm = vec![0.0; test.rows() * test.coordinates_mm.ncols()];
    let mut at = 0;
    let mut decode = |frames_in_block: usize| -> Result<f64, DecodeError> {
        let begun = Instant::now();
        for _ in 0..frames_in_block {
            let frame = frames[at % frames.len()];
            let readings = frame.to_slice().expect("rows of a standard array are contiguous");
            decoder.decode(std::hint::black_box(readings), &mut answer_mm)?;
            std::hint::black_box(&answer_mm);
            at += 1;
        }
        Ok(begun.elapsed().as_secs_f64())
    };
    // The first fills the caches.
    decode(1)?;
    let once = decode(1)?.max(1e-9);
    let frames_in_block = (BLOCK_SECONDS / once).ceil() as usize;
    let mut blocks = Vec::new();
    let mut spent = 0.0;
    while blocks.len() < FEWEST_BLOCKS || (spent < MOST_SECONDS && blocks.len() < MOST_BLOCKS) {
        let seconds = decode(frames_in_block)?;
        spent += seconds;
        blocks.push(1e6 * seconds / frames_in_block as f64);
    }
    blocks.sort_by(f64::total_cmp);
    Ok(blocks[blocks.len() / 2])
}
