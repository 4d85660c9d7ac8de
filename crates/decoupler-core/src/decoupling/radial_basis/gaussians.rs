use ndarray::{Array2, ArrayView1};

use crate::{decoupling::clusters::distance2, network::exp};

/// Gaussians of one width around centres, laid out so that centres lie side by side in vector registers.
#[derive(Clone, Debug)]
pub(super) struct Gaussians {
    /// Number of centres, padded to a multiple of [`LANES`].
    width: usize,
    /// Inputs × padded centres.
    centres: Vec<f64>,
    /// 1 / (2 · width²).
    sharpness: f64,
}

/// Centres are padded to a multiple of this number.
const LANES: usize = 8;

impl Gaussians {
    /// Lays out `centres` (centres × inputs).
    pub(super) fn new(centres: &Array2<f64>, sharpness: f64) -> Self {
        let (count, inputs) = centres.dim();
        let width = count.next_multiple_of(LANES);
        let mut laid_out = vec![0.0; inputs * width];
        for ((centre, input), &value) in centres.indexed_iter() {
            laid_out[input * width + centre] = value;
        }
        Self {
            width,
            centres: laid_out,
            sharpness,
        }
    }

    /// Number of centres with padding.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Roots of the sharpness, and centres (inputs × `count`) in proportion to it.
    pub(super) fn in_units_of_width(&self, count: usize) -> (f64, Array2<f64>) {
        let root = self.sharpness.sqrt();
        let inputs = self.centres.len() / self.width.max(1);
        let centre = |(input, centre): (usize, usize)| root * self.centres[input * self.width + centre];
        (root, Array2::from_shape_fn((inputs, count), centre))
    }

    /// Writes the Gaussians at `x`, one for each centre with padding, whose values mean nothing.
    #[inline(always)]
    pub(super) fn evaluate(&self, x: &[f64], values: &mut [f64]) {
        let mut first = 0;
        while first < self.width {
            first += match self.width - first {
                32.. => self.block::<32>(x, first, values),
                16.. => self.block::<16>(x, first, values),
                _ => self.block::<LANES>(x, first, values),
            };
        }
    }

    /// Writes the Gaussians `first..first + B` and returns B. Several registers are filled at once, so that additions
    /// need not wait for each other.
    #[inline(always)]
    fn block<const B: usize>(&self, x: &[f64], first: usize, values: &mut [f64]) -> usize {
        let mut squares = [0.0; B];
        for (&x, centres) in x.iter().zip(self.centres.chunks_exact(self.width)) {
            let centres: &[f64; B] = centres[first..first + B].try_into().expect("B long");
            for lane in 0..B {
                let apart = x - centres[lane];
                squares[lane] += apart * apart;
            }
        }
        for lane in 0..B {
            values[first + lane] = exp(-self.sharpness * squares[lane]);
        }
        B
    }
}

/// Returns the Gaussian around `centre` at `x`.
pub(super) fn gaussian(x: ArrayView1<'_, f64>, centre: ArrayView1<'_, f64>, sharpness: f64) -> f64 {
    (-sharpness * distance2(x, centre)).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centres_side_by_side_are_those_one_by_one() {
        for (count, inputs) in [(1, 1), (7, 3), (100, 30), (33, 0)] {
            let centres = Array2::from_shape_fn((count, inputs), |(c, i)| (1.7 * c as f64 + 0.3 * i as f64).sin());
            let x = Array2::from_shape_fn((1, inputs), |(_, i)| (0.9 * i as f64).cos());
            let gaussians = Gaussians::new(&centres, 0.4);
            let mut values = vec![0.0; gaussians.width()];
            gaussians.evaluate(x.as_slice().unwrap(), &mut values);
            for (centre, value) in centres.rows().into_iter().zip(&values) {
                assert!(
                    (value / gaussian(x.row(0), centre, 0.4) - 1.0).abs() < 1e-14,
                    "{count} {inputs}"
                );
            }
        }
    }
}
